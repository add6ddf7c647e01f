"""Rails and positioners: joints more, against the plain robot that stands there."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.robots.test_five_axes import ARM, TOOLS

import naive
from conftest import pose, rebuilt
from kerfpath import Contour, InputError, NoFeasiblePath, Tilt, audit, plan
from kerfpath.auditor import chain_of, checks
from kerfpath.cell import cell_of
from kerfpath.certifier import certify
from kerfpath.comfort import Band, Comfort, measure, measures
from kerfpath.effort import changed_effort
from kerfpath.graph import external_grid, gamma_grid
from kerfpath.job import read_plan_file
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.planner import layered_graph
from kerfpath.post import build_program
from kerfpath.robots import Arm, Robot, RobotLimits
from kerfpath.urdf import KinematicChain

RAIL = {"velocity": 2.0, "acceleration": 4.0, "step": 0.1}
TABLE = {"velocity": 2.0, "acceleration": 4.0, "step": np.radians(15)}


@pytest.fixture(scope="module")
def railed(arm):
    return arm.on_rail([0, 2, 0], lower=-1.0, upper=1.0, **RAIL)


@pytest.fixture(scope="module")
def turning(arm):
    return arm.with_positioner([0, 0, 1], [1.2, 0, 0], lower=-1.0, upper=1.0, **TABLE)


@pytest.fixture(scope="module")
def short(circle):
    return Contour(circle.points[:21], circle.axes[:21], name="short")


@pytest.fixture(scope="module")
def options(tool, placement):
    return {"tool": tool, "placement": placement, "speed": 0.02, "gamma_step": np.radians(15)}


def line(half, count):
    """A straight cut along y, in the part frame, tool down."""
    y = np.linspace(-half, half, count)
    return Contour(np.c_[0 * y, y, 0 * y], np.tile([0, 0, -1.0], (count, 1)), name="line")


def moved(arm, T):
    return rebuilt(arm, T_base_foot=T @ arm.T_base_foot)


@pytest.mark.parametrize("kind", ["rail", "positioner"])
@pytest.mark.parametrize("objective", ["sum", "max"])
def test_a_range_of_one_point_is_the_plain_robot_moved_there(kind, objective, arm, short, options):
    if kind == "rail":
        one = arm.on_rail([0, 1, 0], lower=0.2, upper=0.2, **RAIL)
        T = pose([0, 0.2, 0])
        placement = options["placement"]
    else:
        one = arm.with_positioner([0, 0, 1], [1.2, 0, 0], lower=0.3, upper=0.3, **TABLE)
        # By hand: the part is turned, the robot stays.
        R = Rotation.from_rotvec([0, 0, 0.3]).as_matrix()
        T, point = np.eye(4), np.array([1.2, 0, 0])
        placement = pose(point - R @ point, R) @ options["placement"]
    on_grid = options | {"objective": objective, "method": "exact"}
    made = plan(short, one, **on_grid)
    plain = plan(short, moved(arm, T), **on_grid | {"placement": placement})
    assert made.cost == pytest.approx(plain.cost, rel=1e-9)  # two ways to the same frames
    # Both turns of the wrist cost the same, so that the paths may differ; their graphs may not.
    space = {name: options[name] for name in ("tool", "placement", "gamma_step")}
    graph = layered_graph(short, one, **space).q
    other = layered_graph(short, moved(arm, T), **space | {"placement": placement}).q
    np.testing.assert_allclose(graph[:, :6], other, atol=1e-9)
    np.testing.assert_array_equal(made.q[:, 6], 0.2 if kind == "rail" else 0.3)
    assert made.counts == plain.counts
    assert audit(made, path_tolerance=1e-3) == []


@pytest.mark.parametrize("kind", ["railed", "turning"])
def test_both_kinematics_agree_and_a_held_axis_is_a_robot_moved(kind, request):
    robot = request.getfixturevalue(kind)
    rng = np.random.default_rng(5)
    q = rng.uniform(-1, 1, (50, 7))
    T = robot.forward(q)
    chain = chain_of(robot)
    np.testing.assert_allclose(chain.forward(q), T, atol=1e-12)
    for x, want in zip(q[:5], T[:5], strict=True):
        there = robot.held(x[6])
        np.testing.assert_allclose(there.forward(x[:6]), want, atol=1e-12)
        np.testing.assert_allclose(chain_of(there).forward(x[None, :6])[0], want, atol=1e-12)
        found = there.inverse(want).q
        assert np.abs(found - x[:6]).max(axis=1).min() < 1e-9
    _, J = chain.jacobian(q)
    h = 1e-6
    for i in range(6):
        step = h * (np.arange(7) == i)
        difference = (chain.forward(q + step) - chain.forward(q - step))[:, :3, 3] / (2 * h)
        np.testing.assert_allclose(J[:, :3, i], difference, atol=1e-8)  # h^2, and rounding over h


def test_a_positioner_turns_the_part_about_its_axis(turning, arm):
    """What the robot meets at x is the part turned by x, right-handed, about the point."""
    q = np.array([[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]])
    seen, plain = turning.forward(q)[0], arm.forward(q[0, :6])
    R, point = Rotation.from_rotvec([0, 0, 0.7]), np.array([1.2, 0, 0])
    np.testing.assert_allclose(R.apply(seen[:3, 3] - point) + point, plain[:3, 3], atol=1e-12)
    np.testing.assert_allclose(R.as_matrix() @ seen[:3, :3], plain[:3, :3], atol=1e-12)


@pytest.mark.slow
def test_a_cut_beyond_the_reach_needs_the_rail(arm, railed, tool, placement):
    long = line(2.4, 97)  # nodes 50 mm apart; the arm reaches 2.05 m
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(15), "speed": 0.05}
    with pytest.raises(NoFeasiblePath, match="no admissible pose"):
        plan(long, arm, **options)
    made = plan(long, railed, method="exact", **options)
    assert made.proof.optimal
    assert made.q.shape == (97, 7)
    assert np.ptp(made.q[:, 6]) > 0.5
    for interpolation in ("linear", "joint"):
        table = {c.code: c for c in checks(made, interpolation=interpolation, path_tolerance=0.02)}
        assert table["external-limits"].unit == "m"
        assert all(c.ok for c in table.values())
    refined = plan(long, railed, **options)
    assert refined.cost < made.cost
    with changed_effort(certificate_pairs=100_000, certificate_pairs_per_node=0):
        assert "the bound holds for any values of" in certify(refined).statement
    assert not refined.turn[:, 6].any()
    assert audit(refined, path_tolerance=0.02) == []


def test_a_rail_of_many_metres_is_a_length_and_has_no_turns(arm, tool, placement):
    far = arm.on_rail([0, 1, 0], lower=0.0, upper=12.0, **RAIL)
    there = placement.copy()
    there[1, 3] = 8.0
    cell = {"tool": tool, "placement": there, "gamma_step": np.radians(30), "speed": 0.02}
    made = plan(line(0.1, 9), far, **cell)
    assert made.q[:, 6].min() > 2 * np.pi
    assert not made.turn[:, 6].any()
    assert audit(made, path_tolerance=1e-2) == []


@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("kind", ["rail", "positioner"])
def test_the_plan_is_the_best_of_all_positions_tilts_gammas_and_postures(
    kind, objective, arm, circle, tool, placement
):
    bent = Contour(circle.points[:16:5], circle.axes[:16:5])
    if kind == "rail":
        robot = arm.on_rail([1, 0, 0], lower=-0.05, upper=0.05, **RAIL | {"step": 0.05})
    else:
        robot = arm.with_positioner([0, 0, 1], [1.2, 0, 0], lower=-0.1, upper=0.1,
                                    **TABLE | {"step": 0.1})  # fmt: skip
    dt, step = 2.0, np.radians(120)
    speed, tilt = np.diff(bent.s).max() / dt, Tilt(cone=0.1, cost=0.02)
    space = {"tool": tool, "placement": placement, "gamma_step": step, "postures": (0, 1)}
    graph = layered_graph(bent, robot, tilt=tilt, **space)
    layers, costs = [], []
    along = bent.along @ placement[:3, :3].T
    for H, x in zip(placement @ bent.frames("rotation-minimising"), along, strict=True):
        y, rows = np.cross(H[:3, 2], x), []
        for (lead, lean), position in ((t, p) for t in tilt.samples() for p in samples_of(robot)):
            for g in gamma_grid(step):
                T = H.copy()
                T[:3, :3] = Rotation.from_rotvec(lead * y + lean * x).as_matrix() @ H[:3, :3]
                T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec([0, 0, g]).as_matrix()
                found = robot.held(position).inverse(T @ np.linalg.inv(tool))
                some = found.q[found.posture < 2]
                rows += [np.column_stack([some, np.full(len(some), position)])]
                costs += [0.02 * np.hypot(lead, lean)] * len(some)
        layers.append(np.vstack(rows))
    velocity, acceleration = robot.speed_limits()
    start = np.concatenate([[0], np.cumsum([len(layer) for layer in layers])])
    np.testing.assert_array_equal(graph.start, start)
    np.testing.assert_allclose(graph.q, np.vstack(layers), atol=1e-9)
    want, _ = naive.second_order(
        np.vstack(layers), start, "free", vertex_cost=np.array(costs), dt=dt, velocity=velocity,
        acceleration=acceleration, eta_v=1.0, eta_a=1.0, endless=robot.endless,
        weights=1 / (velocity * dt), metric="manhattan", objective=objective,
    )  # fmt: skip
    made = plan(bent, robot, speed=speed, tilt=tilt, objective=objective, method="exact", **space)
    assert made.cost == pytest.approx(want, rel=1e-9)  # two ways to the same poses


def samples_of(robot):
    return external_grid(robot)[:, 0]


def test_five_axes_ride_too():
    t = np.linspace(0, 2 * np.pi, 4001)
    points = np.c_[0.1 * np.cos(t), 0.1 * np.sin(t), 0 * t]
    axes = np.c_[-0.3 + 0 * t, -0.2 * np.sin(t), -np.ones_like(t)]
    loop = Contour(points, axes, closed=True).resample(count=61)
    rides = ARM.on_rail([0, 1, 0], lower=-0.3, upper=0.3, **RAIL)
    cell = {"tool": TOOLS["offset"], "placement": pose([1.1, 0.0, 0.5]), "speed": 0.05}
    made = plan(loop, rides, **cell)
    assert made.q.shape == (61, 6)
    assert made.cost <= plan(loop, ARM, **cell).cost  # zero is one of its places
    for interpolation in ("linear", "joint"):
        assert audit(made, interpolation=interpolation, path_tolerance=1e-2) == []


@pytest.mark.parametrize("kind", ["railed", "turning"])
def test_the_audit_finds_what_is_wrong_with_the_extra_joint(kind, short, options, request):
    robot = request.getfixturevalue(kind)
    made = plan(short, robot, **options)
    assert audit(made, path_tolerance=1e-3) == []

    def codes(**change):
        return {issue.code for issue in audit(replace(made, **change), path_tolerance=1e-3)}

    q = made.q.copy()
    q[4, 6] += 1e-4
    assert {"tip-at-nodes", "acceleration"} & codes(q=q)
    narrow = np.append(robot.upper[:6], made.q[:, 6].max() - 1e-3)
    lower = np.minimum(robot.lower, np.append(robot.lower[:6], narrow[6] - 1))
    assert codes(robot=robot.with_limits(lower=lower, upper=narrow)) == {"external-limits"}


def test_the_speed_of_the_extra_joint_is_held(arm, tool, placement):
    """A cut that only a rail in motion can follow is refused to a rail that is too slow."""
    long = line(2.4, 97)
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(30), "speed": 0.05}
    slow = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, **RAIL | {"velocity": 0.005})
    with pytest.raises(NoFeasiblePath, match="rail"):
        plan(long, slow, **options)
    # What it may accelerate is not quantised by a grid: a twentieth of 0.2 m / (1 s)^2 will do.
    lazy = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, **RAIL | {"acceleration": 0.01})
    assert audit(plan(long, lazy, **options), path_tolerance=0.02) == []


@pytest.mark.parametrize("kind", ["railed", "turning"])
def test_a_plan_file_keeps_the_extra_joint_in_its_own_unit(kind, short, options, tmp_path, request):
    robot = request.getfixturevalue(kind)
    made = plan(short, robot, **options)
    entry = plan_entry(made, "short", checks(made))
    assert np.shape(entry["nodes"]["q_rad"]) == (21, 6)
    np.testing.assert_array_equal(entry["nodes"]["external_q"], made.q[:, 6:])
    assert entry["external_weights_per"] == [made.settings.weights[6]]
    text = plan_text(plan_document(robot, made.T_flange_tip, made.T_base_part, [entry], {}))
    (tmp_path / "plan.json").write_text(text)
    (read,) = read_plan_file(tmp_path / "plan.json").plans
    np.testing.assert_array_equal(read.q, made.q)
    np.testing.assert_array_equal(read.settings.weights, made.settings.weights)
    assert plan_entry(read, "short", [])["criteria"] == entry["criteria"]
    assert (
        plan_text(plan_document(read.robot, read.T_flange_tip, read.T_base_part, [entry], {}))
        == text
    )
    assert audit(read, path_tolerance=1e-3) == []


def test_what_does_not_go_with_an_extra_joint_is_refused_in_one_line(
    railed, turning, arm, short, options, tool, placement
):
    for robot in (railed, turning):
        with pytest.raises(InputError, match=r"use robot.held\(x\).inverse"):
            robot.inverse(np.eye(4))
    cell = cell_of(arm, tool=tool)
    made = plan(short, railed, **options)
    with pytest.raises(InputError, match=r"cell: it was built with other external axes \(none\)"):
        plan(short, railed, cell=cell, **options)
    with pytest.raises(InputError, match=r"cell: it was built with other external axes \(none\)"):
        audit(made, cell=cell)
    with pytest.raises(InputError, match="controllers move rail along an arc in different ways"):
        build_program([made], arc_tolerance=1e-4)
    space = {name: options[name] for name in ("tool", "placement", "gamma_step")}
    graph = layered_graph(short, railed, **space)
    with pytest.raises(InputError, match="graph: its vertices have 7 joints"):
        plan(short, arm, graph=graph, **options)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lower": 1.0}, "rail: its limits are reversed, lower 1 m is above upper 0 m"),
        ({"step": 0.0}, "rail step: expected a number above 0 m"),
        ({"velocity": -1.0}, r"velocity: must be positive, but velocity\[6\]"),
        ({"direction": [0, 0, 0]}, "rail axis: expected a direction"),
        ({"direction": [0, 0]}, "rail axis: expected shape"),
    ],
)
def test_a_bad_rail_is_refused(change, message, arm):
    travel = {"direction": [1, 0, 0], "lower": 0.0, "upper": 0.0, **RAIL} | change
    with pytest.raises(InputError, match=message):
        arm.on_rail(**travel)


def test_an_arm_without_limits_takes_no_rail(arm):
    unknown = replace(arm, limits=RobotLimits())
    with pytest.raises(InputError, match="joint limits are not known"):
        unknown.on_rail([1, 0, 0], lower=0, upper=1, **RAIL)


def test_comfort_is_that_of_the_arm(arm, railed, short, options):
    comfort = Comfort(
        wrist=Band(margin=0.2, width=0.3, cost=0.1), limits=Band(margin=0.3, width=0.2, cost=0.1)
    )
    made = plan(short, railed, comfort=comfort, refine=True, **options)
    assert audit(made, path_tolerance=1e-3) == []
    own = made.q[:, :6]
    for name, value in measures(railed, made.q).items():
        np.testing.assert_array_equal(value, measure(name, arm, own))
    # At its end the rail is far from no limit of the arm, and no margin in rad is one in m.
    q = np.append(own[0], 1.0)
    assert measure("limits", railed, q[None])[0] == measure("limits", arm, own[:1])[0]
    narrowed = comfort.narrowed(railed, made.q)
    assert (narrowed.lower[6], narrowed.upper[6]) == (-1.0, 1.0)


def test_a_general_arm_is_held_where_its_rail_stands(arm):
    frames = chain_of(arm)
    described = Robot(
        id="described",
        arm=Arm(
            kinematics="general",
            geometry={},
            chain=KinematicChain(origins=frames.origins, axes=frames.axes, end=frames.tip),
        ),
        limits=arm.limits,
    )
    rides = described.on_rail([1, 1, 0], lower=-1.0, upper=1.0, **RAIL)
    q = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    want = arm.on_rail([1, 1, 0], lower=-1.0, upper=1.0, **RAIL).forward(q)
    np.testing.assert_allclose(rides.forward(q), want, atol=1e-9)
    np.testing.assert_allclose(rides.held(0.7).forward(q[:6]), want, atol=1e-9)
    np.testing.assert_allclose(chain_of(rides).forward(q[None])[0], want, atol=1e-9)
    found = rides.held(0.7).inverse(want).q
    assert np.abs(found - q[:6]).max(axis=1).min() < 1e-6
    with pytest.raises(InputError, match=r"use robot.held\(x\)"):
        rides.inverse(want)
