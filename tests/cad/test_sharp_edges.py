"""Where a cut crosses sharp edges, the beam is normal to its wall except close to the edge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.gp import gp_Pnt
from OCP.TopoDS import TopoDS_Compound
from scipy.stats import norm
from tests.cad.sheets import Folded, folded
from tests.cad.test_bent_parts import square_tube
from tests.cad.test_meshes import stl
from tests.cad.test_part import cylinder, write_step

from conftest import ROOT
from kerfpath import Contour
from kerfpath.cad import EDGE_TURN, Part, read
from kerfpath.cad.sharp_edges import Sampled, turn_at_edges
from kerfpath.contour import angle_between
from kerfpath.errors import InputError
from kerfpath.operations import quick_turns, slow_turns, smooth_axes, start_at

NORMAL = np.radians(0.1)
"""rad: what law and documentation promise."""


def dense(contour: Contour) -> tuple[np.ndarray, np.ndarray]:
    """Points (K, 3) m and axes (K, 3) every 0.05 mm, and at the nodes."""
    s = np.union1d(contour.s, np.arange(contour.s[0], contour.s[-1], 5e-5))
    return contour.at(s)


def walls_and_distances(sheet: Folded, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The normals (K, 3) of the walls that points in m lie on, and their distance from folds."""
    flat = 1e3 * points[:, [0, 2]]
    a, b = sheet.corners[:-1], sheet.corners[1:]
    share = ((flat[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1)
    on = a + np.clip(share, 0, 1)[..., None] * (b - a)
    wall = np.linalg.norm(flat[:, None] - on, axis=2).argmin(axis=1)
    folds = sheet.corners[1:-1]
    return sheet.normals[wall], np.linalg.norm(flat[:, None] - folds, axis=2).min(axis=1) / 1e3


def loops_over_folds(part: Part) -> list[str]:
    return [loop.name for loop in part.pick(side="outer") if loop.edge_turns]


@pytest.mark.parametrize("edge_turn", [EDGE_TURN, 3e-4, 4e-3])
@pytest.mark.parametrize("seed", range(4))
def test_the_beam_is_normal_to_its_wall_except_close_to_an_edge(seed: int, edge_turn: float):
    """By the normals that the generator of the sheet knows; and STEP and mesh say the same."""
    sheet = folded(seed)
    part = read(sheet.shape, edge_turn=edge_turn)
    names = loops_over_folds(part)
    assert len(names) == len(sheet.corners) - 1  # the trim line, and a hole across each fold
    for name in names:
        contour = part.contour(name)
        points, axes = dense(contour)
        normals, away = walls_and_distances(sheet, points)
        off = angle_between(-axes, normals)
        assert off[away > edge_turn].max(initial=0.0) < NORMAL  # small holes are near the fold
        assert off.max() <= max(turn.angle for turn in part.loop(name).edge_turns) / 2 + NORMAL
        assert part.departure(name, contour).axis_error < 0.002  # axis_tolerance of `contour`


@pytest.mark.parametrize("seed", range(4))
def test_a_solid_and_its_mesh_have_the_same_axes(seed: int, tmp_path: Path):
    sheet = folded(seed)
    solid = read(sheet.shape)
    vertices, triangles = solid.mesh(2e-6)
    mesh = read(stl(tmp_path / "a.stl", 1e3 * vertices[triangles]), unit="mm")
    names = loops_over_folds(mesh)
    assert len(names) == len(loops_over_folds(solid))
    for name in loops_over_folds(solid):
        one = solid.contour(name)
        other = min(map(mesh.contour, names), key=lambda each: _apart(one, each))
        nearest = np.linalg.norm(other.points - one.points[0], axis=1).argmin()
        other = start_at(other, other.s[nearest])
        s = np.linspace(0, one.length, 2000)
        points, axes = one.at(one.s[0] + s)
        others = other.at(other.s[0] + s * other.length / one.length)
        # Chords of 2 um error shift the place by up to 0.02 mm, in which the beam turns by 1 deg.
        assert np.abs(points - others[0]).max() < 3e-5
        assert angle_between(axes, others[1]).max() < np.radians(1.5)
        normals, away = walls_and_distances(sheet, points)
        assert angle_between(-others[1], normals)[away > 1.03e-3].max() < NORMAL


def _apart(one: Contour, other: Contour) -> float:
    return float(np.abs(one.points.mean(axis=0) - other.points.mean(axis=0)).sum()) + abs(
        one.length - other.length
    )


def test_the_beam_turns_evenly_and_is_halfway_at_the_edge():
    part = read(square_tube(), edge_turn=2e-3)
    (rim, _) = part.pick(kind="outer", side="outer")
    assert [np.degrees(turn.angle) for turn in rim.edge_turns] == pytest.approx([90] * 4)
    contour = part.contour(rim.name)
    for turn in rim.edge_turns:
        middle = np.linalg.norm(contour.points[:-1] - turn.at, axis=1).argmin()
        assert contour.points[middle] == pytest.approx(turn.at, abs=1e-9)
        begun = start_at(contour, contour.s[middle])
        s = np.linspace(-3e-3, 3e-3, 61)
        _, axes = begun.at(begun.s[0] + np.mod(s, begun.length))
        steps = np.degrees(angle_between(axes[1:], axes[:-1]))
        assert steps == pytest.approx(np.where(np.abs(s[1:] - 5e-5) < 2e-3, 2.25, 0.0), abs=1e-6)
        across = begun.axes[0] * np.sqrt(2)
        assert np.sort(np.abs(across)) == pytest.approx([0, 1, 1], abs=1e-9)
    ends = contour.s[contour.bend_ends]
    assert len(ends) == 8
    (note,) = part.notes
    assert f"within 2 mm before and behind sharp edges: {rim.name} by up to 90 deg" in note


def test_between_close_edges_the_beam_turns_from_edge_to_edge():
    """A flat of 0.6 mm between two folds of 45 deg: the beam is normal to it in its middle."""
    bend = np.radians(45)
    x, z = 0.6 * np.cos(bend), -0.6 * np.sin(bend)
    points = np.array([[-5, 0, 0], [0, 0, 0], [x, 0, z], [x, 0, z - 5]])
    normals = np.array([[0, 0, 1], [np.sin(bend), 0, np.cos(bend)], [1, 0, 0]])
    line = Sampled(points, normals[[0, 0, 1, 2]], normals[[0, 1, 2, 2]])
    made, turned = turn_at_edges(line, 1.0, is_closed=False)
    # Where it begins to turn, the edges, their middle, and where it ends.
    assert np.linalg.norm(np.diff(made, axis=0), axis=1) == pytest.approx([4, 1, 0.3, 0.3, 1, 4])
    leans = np.degrees(np.arctan2(turned[:, 0], turned[:, 2]))
    assert leans == pytest.approx([0, 0, 22.5, 45, 67.5, 90, 90])


def test_what_turns_little_is_left_as_it_is_and_what_folds_back_is_refused():
    points = np.array([[0.0, 0, 0], [5, 0, 0], [10, 0, 0]])
    for lean, count in ((0.05, 3), (0.5, 5)):
        tilted = np.array([np.sin(np.radians(lean)), 0, np.cos(np.radians(lean))])
        up = np.array([0.0, 0, 1])
        line = Sampled(points, np.array([up, up, tilted]), np.array([up, tilted, tilted]))
        made, _ = turn_at_edges(line, 1.0, is_closed=False)
        assert len(made) == count
    flat = np.array([up, -up, -up])
    with pytest.raises(InputError, match="fold back on each other near 5, 0, 0 mm"):
        turn_at_edges(Sampled(points, np.array([up, up, -up]), flat), 1.0, is_closed=False)


def test_a_curve_drawn_across_a_fold_follows_the_same_rule():
    """The normal jumps inside such a curve, not at an end of it."""
    sheet = folded(1)
    (x0, z0), (x1, z1), (x2, z2) = sheet.corners[:3]
    both, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(both)
    builder.Add(both, sheet.shape)
    # A line that leaves its wall at the fold would leave the sheet, so it runs along the fold's
    # two walls as two lines that share an end there.
    for ends in (((x0 + x1) / 2, (z0 + z1) / 2), ((x1 + x2) / 2, (z1 + z2) / 2)):
        a, b = gp_Pnt(float(x1), 5.0, float(z1)), gp_Pnt(float(ends[0]), 5.0, float(ends[1]))
        builder.Add(both, BRepBuilderAPI_MakeEdge(a, b).Edge())
    part = read(both)
    (line,) = part.pick(kind="open")
    points, axes = dense(part.contour(line.name, closed=False))
    normals, away = walls_and_distances(sheet, points)
    assert angle_between(-axes, normals)[away > EDGE_TURN].max() < NORMAL
    assert len(line.edge_turns) == 1


def test_the_distance_is_checked_and_belongs_to_drawings_of_faces(tmp_path: Path):
    with pytest.raises(InputError, match=r"edge_turn: expected at least 0\.0002 m"):
        read(square_tube(), edge_turn=1e-4)
    (tmp_path / "a.csv").write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n5,0,0,0,0,1\n")
    with pytest.raises(InputError, match="edge_turn: expected a drawing of faces, got a table"):
        read(tmp_path / "a.csv", edge_turn=2e-3)


def test_smoothed_axes_turn_over_the_distance_that_was_asked_for() -> None:
    """Flats have few nodes: the averages of an axis that jumps by 90 deg are known in between."""
    part = read(square_tube(), edge_turn=3e-4)
    rim = part.pick(kind="outer", side="outer")[0]
    drawn = part.contour(rim.name)
    made = smooth_axes(drawn, 3e-3, limit=np.pi / 2)
    corner = int(np.linalg.norm(drawn.points[1:-1], axis=1).argmin()) + 1
    begun = start_at(made, drawn.s[corner])
    s = np.linspace(-8e-3, 8e-3, 321)
    _, axes = begun.at(begun.s[0] + np.mod(s, begun.length))
    share = norm.cdf(s, scale=3e-3)  # of the second wall
    lean = angle_between(axes, np.tile(drawn.at(drawn.s[corner] - 0.01)[1], (len(s), 1)))
    assert np.degrees(lean) == pytest.approx(np.degrees(np.arctan2(share, 1 - share)), abs=1.0)


# ------------------------------------------------------------------ nodes that follow the turn


def test_at_the_speed_for_the_turn_nodes_even_in_time_follow_it():
    part = read(square_tube(cylinder(6, 10, (100, 0, 35))))
    for name in loops_over_folds(part):
        path = part.contour(name)
        for step in (5e-4, 2e-3, 8e-3):
            edges = [turn.at for turn in part.loop(name).edge_turns]
            _, shares = quick_turns(path, edges, distance=part.edge_turn, step=step)
            assert shares == pytest.approx(0.2e-3 / step, rel=0.02)  # 45 deg per mm
            slowed = slow_turns(path, edges, distance=part.edge_turn, step=step)
            nodes = slowed.resample(dt=step / 0.05, speed=0.05, bend_ends=True)
            turn = np.degrees(angle_between(nodes.axes[1:], nodes.axes[:-1]))
            assert turn.max() < 9 + 1e-6
            assert slowed.speed_share.min() == pytest.approx(shares.min())
            assert part.departure(name, nodes).axis_error < np.radians(0.2)
            # Elsewhere nodes are far apart, with room for the ramps on small holes.
            assert np.diff(nodes.s).max() > 0.5 * step
    assert slow_turns(path, edges, distance=1e-3, step=1e-4) is path
    assert slow_turns(path, [], distance=1e-3, step=1e-2) is path


JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-45"
[part]
file = "part.step"
xyz_mm = [1200, 0, 600]
rpy_deg = [0, 0, 0]
edge_turn_mm = 0.5
[[contour]]
pick = "skin1/outer1"
speed_m_min = 3
spacing_mm = 2
[plan]
gamma_step_deg = 20
[program]
language = "none"
"""


def test_the_nodes_of_a_job_follow_the_turn_within_the_tolerance_of_its_audit(tmp_path: Path):
    from kerfpath.job import prepare, read_job

    write_step(tmp_path / "part.step", square_tube())
    (tmp_path / "job.toml").write_text(JOB)
    (request,) = prepare(read_job(tmp_path / "job.toml")).contours
    (cut,) = request.candidates
    s = np.linspace(0, cut.path.s[-1], 20000)
    off = angle_between(cut.path.at(s)[1], cut.nodes.at(s)[1])
    assert off.max() < np.radians(1.0)
    assert len(cut.nodes) < 250
    assert "the speed falls to 5% where the beam turns about sharp edges" in request.closer
    table = JOB.replace("spacing_mm = 2", "count = 101")
    (tmp_path / "job.toml").write_text(table)
    (request,) = prepare(read_job(tmp_path / "job.toml")).contours
    assert "between its nodes the tool axis is up to 34.2 deg from that of the path" in (
        request.closer
    )


# --------------------------------------------------------------------------- what stays the same

SHIPPED = sorted(
    path
    for folder in ("src/kerfpath/demo", "examples/parts")
    for path in (ROOT / folder).glob("*.step")
)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_loops_that_cross_no_sharp_edge_do_not_depend_on_the_distance(path: Path):
    """Of the shipped parts only two trims, of the beam, cross sharp edges."""
    short, long = (read(path, edge_turn=edge_turn) for edge_turn in (3e-4, 5e-3))
    crossing = [loop.name for loop in short.loops if loop.edge_turns]
    assert len(crossing) == (2 if path.name == "beam.step" else 0)
    for loop in short.pick():
        same = np.array_equal(short.contour(loop.name).axes, long.contour(loop.name).axes)
        assert same == (loop.name not in crossing)
