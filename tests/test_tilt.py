"""The tolerance of the tool axis: its convention, its laws, and the audit that holds it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.robots.test_five_axes import ARM, TOOLS

import naive
from conftest import ROOT, pose
from kerfpath import (
    Contour,
    InputError,
    NoFeasiblePath,
    Tilt,
    audit,
    fastest_speed,
    plan,
    plan_in_pieces,
    refine,
)
from kerfpath.auditor import checks
from kerfpath.graph import gamma_grid
from kerfpath.job import read_plan_file
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.planner import layered_graph
from kerfpath.planner.collision_free import _gamma_neighbours
from kerfpath.post import build_program, post
from kerfpath.tilt import tilt_frames

CONE = np.radians(6)


@pytest.fixture(scope="module")
def arc(circle):
    """A third of the circle on the dome, 25 nodes."""
    return Contour(circle.points[:41], circle.axes[:41], name="arc").resample(count=25)


@pytest.fixture(scope="module")
def options(tool, placement):
    return {"tool": tool, "placement": placement, "speed": 0.02, "gamma_step": np.radians(10)}


@pytest.fixture(scope="module")
def made(arc, arm, options):
    return plan(arc, arm, tilt=Tilt(cone=CONE, steps=2, cost=0.1), method="exact", **options)


@pytest.mark.parametrize(("steps", "count"), [(0, 1), (1, 5), (2, 13), (3, 29), (5, 81)])
def test_the_samples_are_the_grid_points_inside_the_cone(steps, count):
    samples = Tilt(cone=0.3, steps=steps).samples()
    assert len(samples) == count  # lattice points in a circle, Gauss
    np.testing.assert_array_equal(samples[0], [0, 0])
    angle = np.hypot(*samples.T)
    assert angle.max() <= 0.3 * (1 + 1e-15)  # the rim itself is inside
    assert steps == 0 or angle.max() == pytest.approx(0.3)
    assert len(Tilt(cone=0.0, steps=steps).samples()) == 1


def test_lead_turns_the_beam_ahead_and_lean_aside():
    H = np.diag([1.0, -1, -1, 1])  # the beam down, x ahead, y to the right
    lead, lean = (tilt_frames(H, H[:3, 0], np.array(t)) for t in ([0.2, 0], [0, 0.2]))
    s, c = np.sin(0.2), np.cos(0.2)
    np.testing.assert_allclose(lead[:3, 2], [s, 0, -c], atol=1e-15)
    np.testing.assert_allclose(lean[:3, 2], -s * H[:3, 1] + [0, 0, -c], atol=1e-15)
    both = tilt_frames(H, H[:3, 0], np.array([0.3, -0.4]))
    assert np.arccos(both[:3, 2] @ H[:3, 2]) == pytest.approx(0.5)


def test_no_steps_and_no_cone_are_no_tilt(arc, arm, options):
    plain = plan(arc, arm, **options)
    for none in (Tilt(cone=0.1, steps=0, cost=3), Tilt(cone=0, steps=3, cost=3)):
        same = plan(arc, arm, tilt=none, **options)
        for name in ("q", "gamma", "posture", "turn", "cost", "counts"):
            np.testing.assert_equal(getattr(same, name), getattr(plain, name))
        assert not same.tilt.any()


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["sum", "max"])
def test_freedom_lowers_the_cost_and_its_price_raises_it(objective, arc, arm, options):
    plain = plan(arc, arm, objective=objective, **options).cost
    costs = [
        plan(
            arc, arm, tilt=Tilt(cone=CONE, steps=1, cost=cost), objective=objective, **options
        ).cost
        for cost in (0.0, 0.5, 1e6)
    ]
    assert costs[0] < plain
    assert costs == sorted(costs)
    assert costs[2] == pytest.approx(plain, rel=1e-12)  # too dear: the same path


@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("frames", ["tangent", "rotation-minimising"])
def test_the_plan_is_the_best_of_every_tilt_gamma_posture_and_turn(
    objective, frames, circle, arm, tool, placement
):
    bent = Contour(circle.points[:20:5], circle.axes[:20:5])
    wide = arm.with_limits(endless=[0] * 6, upper=np.where(np.arange(6) == 5, 7.0, arm.upper))
    tilt, step, dt = Tilt(cone=0.1, steps=1, cost=0.02), np.radians(120), 2.0
    speed = np.diff(bent.s).max() / dt
    space = {"tool": tool, "placement": placement, "gamma_step": step, "frames": frames}
    space["postures"] = range(2)
    # By hand: the tangent of each node, and every solution of every tilted and turned frame.
    layers, costs = [], []
    for k, H in enumerate(placement @ bent.frames(frames)):
        n = H[:3, 2]
        ahead = placement[:3, :3] @ (bent.points[min(k + 1, 3)] - bent.points[min(k, 2)])
        x = ahead - (ahead @ n) * n
        x /= np.linalg.norm(x)
        y = np.cross(n, x)
        q, cost = [], []
        for lead, lean in [(0, 0), (0.1, 0), (-0.1, 0), (0, 0.1), (0, -0.1)]:
            turned = H.copy()
            turned[:3, :3] = Rotation.from_rotvec(lead * y + lean * x).as_matrix() @ H[:3, :3]
            for g in gamma_grid(step):
                spin = pose([0, 0, 0], Rotation.from_rotvec([0, 0, g]).as_matrix())
                found = wide.inverse(turned @ spin @ np.linalg.inv(tool))
                some = found.posture < 2  # the brute force is cubic in the size of a layer
                q.append(found.q[some])
                cost += [0.02 * abs(lead + lean)] * int(some.sum())
        layers.append(np.vstack(q))
        costs += cost
    start = np.concatenate([[0], np.cumsum([len(layer) for layer in layers])])
    velocity, acceleration = wide.speed_limits()
    want, _ = naive.second_order(
        np.vstack(layers),
        start,
        "free",
        vertex_cost=np.array(costs),
        dt=dt,
        velocity=velocity,
        acceleration=acceleration,
        eta_v=1.0,
        eta_a=1.0,
        endless=wide.endless,
        weights=1 / (velocity * dt),
        metric="manhattan",
        objective=objective,
    )
    made = plan(bent, wide, speed=speed, tilt=tilt, objective=objective, method="exact", **space)
    np.testing.assert_array_equal(
        np.diff(layered_graph(bent, wide, tilt=tilt, **space).start), np.diff(start)
    )
    assert made.cost == pytest.approx(want, rel=1e-9)  # two ways to the same poses
    assert made.tilt.any()


def test_gamma_and_the_axis_are_those_of_the_tilted_frame(made, tool):
    T = made.robot.forward(made.q) @ tool
    assert made.tilt.any()
    np.testing.assert_allclose(T[:, :3, 2], made.axes, atol=1e-9)
    x = T[:, :3, 0]
    angle = np.arctan2((x * made.frames[:, :3, 1]).sum(1), (x * made.frames[:, :3, 0]).sum(1))
    np.testing.assert_allclose(np.cos(angle - made.gamma), 1, atol=1e-12)
    distances = np.abs(made.increments * made.settings.weights).sum()
    assert made.cost == pytest.approx(distances + 0.1 * np.hypot(*made.tilt.T).sum(), rel=1e-12)


def codes(plan, **options):
    return {issue.code for issue in audit(plan, **options)}


def test_the_audit_holds_the_tilted_axis_and_the_cone(made):
    for interpolation in ("linear", "joint"):
        assert audit(made, interpolation=interpolation, path_tolerance=1e-3) == []
    held = replace(made.settings, tilt=Tilt(cone=CONE / 2, steps=1))
    assert codes(replace(made, settings=held)) == {"tilt"}
    assert codes(replace(made, settings=replace(made.settings, tilt=None))) == {"tilt"}
    # The axes were never asked for as they are.
    assert {"axis-at-nodes", "axis-between-nodes"} <= codes(replace(made, tilt=None))
    other = made.tilt.copy()
    other[7] += [0, 1e-4]
    assert "axis-at-nodes" in codes(replace(made, tilt=other))
    assert codes(replace(made, tilt=-made.tilt)) >= {"axis-at-nodes"}


def test_between_the_nodes_the_axis_is_held_against_the_drawing(made, arc):
    """A drawing whose axis wobbles between the nodes, where no plan can have followed it."""
    s = np.linspace(0, arc.length, 24 * 10 + 1)
    points, axes = arc.at(s)
    wobble = 0.05 * np.sin(np.pi * s / (arc.length / 24))[:, None] * [1.0, 0, 0]
    drawn = Contour(points, axes + wobble, s=s)
    table = {check.code: check for check in checks(made, reference=drawn)}
    assert table["axis-at-nodes"].ok
    assert table["axis-between-nodes"].value == pytest.approx(0.05, rel=0.2)  # plus the slerp's own
    assert not table["axis-between-nodes"].ok


def test_off_the_grid_the_tilt_stays_and_gamma_moves(made, arc, arm, options):
    off = plan(arc, arm, tilt=made.settings.tilt, refine=True, **options)
    assert off.cost < made.cost
    assert audit(off, path_tolerance=1e-3) == []
    grid = made.settings.tilt.samples()
    assert all((np.abs(grid - tilt).max(axis=1) < 1e-15).any() for tilt in off.tilt)
    distances = np.abs(off.increments * off.settings.weights).sum()
    assert off.cost == pytest.approx(distances + off.node_cost.sum(), rel=1e-12)
    finer = refine(made, nodes=arc.resample(count=49))
    assert not finer.done
    assert "tilts hold at the plan's own nodes" in finer.statement


def test_tilt_is_all_the_freedom_of_five_axes():
    t = np.linspace(0, 2 * np.pi, 4001)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0 * t]
    loop = Contour(points, np.tile([0, 0, -1.0], (4001, 1)), closed=True).resample(count=61)
    cell = {"tool": TOOLS["straight"], "placement": pose([1.1, 0.0, 0.5])}
    tilt = Tilt(cone=np.radians(8), steps=2, cost=0.01)
    # Straight down: axis 4 whirls where the wrist is stretched, and the tilt goes round that.
    rigid = fastest_speed(loop, ARM, **cell).speed
    freed = fastest_speed(loop, ARM, tilt=tilt, **cell).speed
    assert freed > rigid
    between = (rigid + freed) / 2
    with pytest.raises(NoFeasiblePath):
        plan(loop, ARM, speed=between, **cell)
    made = plan(loop, ARM, speed=between, tilt=tilt, **cell)
    assert made.proof.optimal
    assert audit(made, interpolation="joint", path_tolerance=1e-2, axis_tolerance=0.1) == []


@pytest.mark.slow
def test_a_loop_may_return_to_where_it_began(circle, arm, options):
    coarse = circle.resample(count=41)
    closed = plan(coarse, arm, tilt=Tilt(cone=CONE, steps=1), closure="periodic", **options)
    np.testing.assert_allclose(closed.tilt[0], closed.tilt[-1])
    assert audit(closed, path_tolerance=1e-3) == []


def test_the_feed_dips_with_a_tilt(arc, arm, options):
    fast = options | {"speed": 1.0, "eta_a": 0.2}
    tilt = Tilt(cone=CONE, steps=1, cost=0.1)
    made = plan(arc, arm, tilt=tilt, feed="dip", refine=True, **fast)
    assert made.feed is not None
    assert audit(made, path_tolerance=1e-3) == []


def test_a_plan_file_keeps_the_tilt_and_its_program_is_written(made, tmp_path):
    entry = plan_entry(made, "arc", checks(made))
    assert np.shape(entry["nodes"]["lead_lean_rad"]) == (25, 2)
    text = plan_text(plan_document(made.robot, made.T_flange_tip, made.T_base_part, [entry], {}))
    (tmp_path / "plan.json").write_text(text)
    (read,) = read_plan_file(tmp_path / "plan.json").plans
    assert read.settings.tilt == made.settings.tilt
    np.testing.assert_array_equal(read.tilt, made.tilt)
    assert audit(read, path_tolerance=1e-3) == []
    program = build_program([read])
    first = program.sections[0].steps[2].T_part_tip
    axis = made.T_base_part[:3, :3].T @ made.axes[0]
    np.testing.assert_allclose(first[:3, 2], axis, atol=1e-6)
    assert "MODULE" in post(program, "rapid")[f"{program.name}.mod"]
    with pytest.raises(InputError, match="belongs to another contour"):
        build_program([replace(read, tilt=None)])


def test_the_graph_tells_its_variants_apart(arc, arm, options):
    tilt = Tilt(cone=CONE, steps=1)
    space = {name: options[name] for name in ("tool", "placement", "gamma_step")}
    graph = layered_graph(arc, arm, tilt=tilt, **space)
    plain = layered_graph(arc, arm, **space)
    assert sum(graph.counts().values()) == 5 * sum(plain.counts().values())
    np.testing.assert_array_equal(graph.reason[:, :36], plain.reason)
    nominal = graph.variant == 0
    np.testing.assert_array_equal(graph.q[nominal], plain.q)
    admitted = graph.reason.reshape(25, 5, 36, 8) == 0
    np.testing.assert_array_equal(graph.reason_by_gamma == 0, admitted.any(axis=1))
    for side in _gamma_neighbours(graph).T:
        has = side >= 0
        np.testing.assert_array_equal(graph.variant[side[has]], graph.variant[has])
    kept = plan(arc, arm, graph=graph, tilt=tilt, **options)
    np.testing.assert_array_equal(kept.q, plan(arc, arm, tilt=tilt, **options).q)
    for other in (None, Tilt(cone=CONE, steps=2)):
        with pytest.raises(InputError, match="graph: it was built with another tilt"):
            plan(arc, arm, graph=graph, tilt=other, **options)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"cone": -0.1}, "tilt cone: must not be negative"),
        ({"cone": np.nan}, "tilt cone: expected a finite number"),
        ({"cone": 1.6}, "tilt cone: expected less than pi/2 rad"),
        ({"cone": 0.1, "cost": -1}, "tilt cost: must not be negative, got -1 1/rad"),
        ({"cone": 0.1, "steps": 1.5}, "tilt steps: expected a whole number"),
        ({"cone": 0.1, "steps": -1}, "tilt steps: expected a whole number"),
    ],
)
def test_a_bad_tilt_is_refused(wrong, message):
    with pytest.raises(InputError, match=message):
        Tilt(**wrong)


def test_what_a_tilt_does_not_go_with_is_refused(arc, arm, options):
    with pytest.raises(InputError, match='tilt: expected none with interruptions "fewest"'):
        plan_in_pieces(arc, arm, tilt=Tilt(cone=CONE), **options)


@pytest.mark.slow
def test_the_example_of_the_page_runs(capsys):
    page = (ROOT / "docs" / "tilt-and-extra-axes.md").read_text()
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        exec(compile(code, "tilt-and-extra-axes.md", "exec"), {})
        assert capsys.readouterr().out.strip().endswith("audit passed")
