"""Reports and tables of external axes: their own units, and the scene as the part sees it."""

import csv

import numpy as np
import plotly.graph_objects as go
import pytest
from scipy.spatial.transform import Rotation

from conftest import pose
from kerfpath import Contour, plan
from kerfpath.auditor import checks
from kerfpath.cell import Mesh, box, box_between, cell_of, surface
from kerfpath.front.criteria import criteria_named
from kerfpath.job.output.writing import trajectory_text
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph
from kerfpath.report import ContourSection, render
from kerfpath.report.motion import joint_positions, limit_shares
from kerfpath.report.scene import add_cell, poses_shown, scene
from kerfpath.robots import carried
from kerfpath.transfer import transfer_move

CENTRE = [1.3, 0.0, 0.5]
SLOW = {"velocity": 1.0, "acceleration": 2.0}


@pytest.fixture(scope="module")
def shown(arm, tool):
    """A short cut on a rail and a table that both move, in a cell with things on either."""
    railed = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, **SLOW)
    turn = {"lower": -np.pi, "upper": np.pi, "endless": True, **SLOW}
    robot = railed.with_positioner([0, 0, 1], CENTRE, name="table", **turn)
    slab = box_between([-0.3, -0.3, -0.02], [0.3, 0.3, 0.0])
    cell = cell_of(
        robot, tool=tool, placement=pose(CENTRE), near_miss=1e-3, floor=0.0,
        part=Mesh(vertices=slab.points, triangles=slab.triangles, name="slab"),
        fixtures={
            "clamp": box([0.05] * 3, pose([1.55, 0.2, 0.53])),
            "post": box([0.1, 0.1, 1.0], pose([0.2, -2.2, 0.5])),
            "cabinet": box([0.2, 0.2, 0.2], pose([-0.7, 0.0, 0.2])),
        },
        on={"clamp": "table", "cabinet": "rail"},
    )  # fmt: skip
    # A bevel on a spiral about the table: it turns, and the rail follows the radius.
    t, r = np.linspace(-2.0, -1.1, 21), np.linspace(0.15, 0.25, 21)
    c, s = np.cos(t), np.sin(t)
    contour = Contour(np.c_[r * c, r * s, 0 * t], np.c_[-c / 2, -s / 2, 0 * t - 1], name="line")
    contour = contour.resample(count=21)
    course = np.c_[np.linspace(-0.1, 0.1, 21), np.linspace(0.4, -0.4, 21)]
    options = {"tool": tool, "placement": pose(CENTRE), "gamma_step": np.radians(6)}
    weights = [1.0] * 6 + [1e-3] * 2  # the axes cost next to nothing, and move
    made = plan(contour, robot, speed=0.05, external=course, weights=weights, **options)
    assert np.ptp(made.external, axis=0).min() > 0.01
    graph = layered_graph(contour, robot, external=made.external[:, None], **options)
    return made, cell, graph


def test_each_axis_has_a_panel_in_its_own_unit(shown):
    made, _, _ = shown
    figure = joint_positions(made)
    traces = {trace.name: trace for trace in figure.data}
    assert list(traces) == [*(f"joint {i}" for i in range(1, 7)), "rail", "table"]
    np.testing.assert_allclose(traces["rail"].y, made.unwrapped[:, 6] * 1e3, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(
        traces["table"].y, np.degrees(made.unwrapped[:, 7]), rtol=1e-5, atol=1e-4
    )
    assert traces["rail"].hovertemplate == "%{y:.2f} mm"
    assert figure.layout.yaxis7.ticksuffix == " mm"
    assert figure.layout.yaxis8.ticksuffix == "°"
    titles = " ".join(note.text for note in figure.layout.annotations)
    assert "limits \N{MINUS SIGN}1000 mm to 1000 mm" in titles
    domains = [figure.layout[f"yaxis{i}"].domain for i in (5, 7)]
    assert domains[0][0] > domains[1][1]  # a row of its own, below
    names = [trace.name for trace in limit_shares(made).data]
    assert names[6:8] == ["rail", "table"]


def test_the_scene_is_what_the_part_sees(shown):
    made, cell, _ = shown
    figure, poses = go.Figure(), poses_shown([made])
    add_cell(figure, cell, made.T_base_part, poses)
    drawn: dict[str, list] = {}
    for trace in figure.data:
        drawn.setdefault(trace.name, []).append(np.c_[trace.x, trace.y, trace.z])
    assert "floor" not in drawn
    assert len(drawn["clamp"]) == 1  # it goes with the part, wherever that is
    assert len(drawn["post"]) == len(drawn["cabinet"]) == len(poses)
    axes = made.robot.externals
    bodies = {body.name: body for body in cell.bodies}
    for i, (_, q) in enumerate(poses):
        part = carried(axes, q[6:], "part") @ made.T_base_part
        for name, moved in (("post", np.eye(4)), ("cabinet", carried(axes, q[6:], "robot"))):
            T = np.linalg.inv(part) @ moved
            points = surface(bodies[name].shape)[0] @ T[:3, :3].T + T[:3, 3]
            np.testing.assert_allclose(drawn[name][i], points * 1e3, atol=1e-3)
    clamp = surface(bodies["clamp"].shape)[0] - CENTRE
    np.testing.assert_allclose(drawn["clamp"][0], clamp * 1e3, atol=1e-3)


@pytest.mark.parametrize(("turn", "drag"), [(0.0, "turntable"), (np.pi, "orbit")])
def test_the_cell_stands_upright_whatever_way_up_the_part_is(arm, tool, turn, drag):
    """A turntable of plotly would turn the z axis of the part upright, and the cell over."""
    slab = box_between([-0.3, -0.3, -0.02], [0.3, 0.3, 0.0])
    placement = pose(CENTRE, Rotation.from_euler("x", turn).as_matrix())
    part = Mesh(vertices=slab.points, triangles=slab.triangles, name="slab")
    cell = cell_of(arm, tool=tool, placement=placement, near_miss=1e-3, part=part)
    seen = scene([], (slab.points, slab.triangles), cell).layout.scene
    assert (seen.camera.up.z, seen.dragmode) == (np.cos(turn), drag)


def test_a_whole_page_is_made(shown):
    made, cell, graph = shown
    table = checks(made, path_tolerance=5e-3, cell=cell)
    section = ContourSection(
        name="line", graph=graph, path=made.contour, plan=made, checks=table
    )  # fmt: skip
    page = render("line", [section], cell=cell, facts=[])
    assert "rail, mm</th>" in page
    assert f"{made.criteria.displacement[6] * 1e3:,.1f}" in page
    assert "excess over the limits of rail" in page


def test_the_trajectory_names_axes_and_units(shown):
    made, _, _ = shown
    q = made.q[0].copy()
    q[6] += 0.4
    move = transfer_move(made.robot, q, made.q[0])
    rows = list(csv.DictReader(trajectory_text([made], [move, move]).splitlines()))
    assert list(rows[0])[9:12] == ["q6_deg", "rail_mm", "table_deg"]
    cut = [row for row in rows if row["contour"] == "line"]
    np.testing.assert_allclose([float(row["rail_mm"]) for row in cut], made.q[:, 6] * 1e3)
    np.testing.assert_allclose([float(row["table_deg"]) for row in cut], np.degrees(made.q[:, 7]))
    air = [row for row in rows if row["kind"] == "air"]
    np.testing.assert_allclose(float(air[0]["rail_mm"]), q[6] * 1e3)


def test_criteria_of_one_axis_go_by_its_number_and_are_called_by_its_name(shown):
    made, _, _ = shown
    (found,) = criteria_named(["range_7"], made.robot, options=PlanOptions(), cell=None, home=None)
    assert found.words.endswith(", rail")
    assert found.unit == "m"
