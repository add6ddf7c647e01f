"""Several external axes at once: who carries whom, and plans against a dense search."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Contour, InputError, NoFeasiblePath, Tilt, audit, fastest_speed, plan
from kerfpath.auditor import chain_of
from kerfpath.auditor.between import bound_between_nodes
from kerfpath.auditor.motion import motion_of
from kerfpath.planner import external_course
from kerfpath.robots import ExternalAxis

SLOW = {"velocity": 1.0, "acceleration": 2.0}
TURN = {"lower": -2.0, "upper": 2.0, **SLOW}
POINT = np.array([1.2, 0.0, 0.3])


@pytest.fixture(scope="module")
def three(arm):
    """A rail under the arm, and under the part a table that is tilted."""
    railed = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, **SLOW)
    tilted = railed.with_positioner([1, 0, 0], POINT, name="tilt", **TURN)
    return tilted.with_positioner([0, 0, 1], POINT, name="turn", **TURN | {"endless": True})


def gantry(arm):
    """A column that turns on a rail and carries the arm, and a rail that carries the part."""
    axes = (
        ExternalAxis(name="bridge", kind="linear", carries="robot", axis=[1, 0, 0]),
        ExternalAxis(
            name="column", kind="rotary", carries="robot", axis=[0, 0, 1], point=[0, 2, 0]
        ),
        ExternalAxis(name="shuttle", kind="linear", carries="part", axis=[0, 1, 1]),
    )
    robot = arm
    for axis in axes:
        robot = robot.with_external(axis, lower=-1.0, upper=1.0, **SLOW)
    return robot


def test_the_first_axis_of_a_side_carries_the_next(three, arm):
    """By hand: the part is turned on its table, then the table is tilted; the arm slides."""
    q = np.random.default_rng(1).uniform(-1, 1, (20, 9))
    seen = three.forward(q)
    for joints, T in zip(q, seen, strict=True):
        x, tilt, turn = joints[6:]
        R = Rotation.from_rotvec([tilt, 0, 0]) * Rotation.from_rotvec([0, 0, turn])
        flange = arm.forward(joints[:6])
        # Where the flange is in the world: as the part carries along what it sees.
        want = flange[:3, 3] + [0, x, 0]
        np.testing.assert_allclose(R.apply(T[:3, 3] - POINT) + POINT, want, atol=1e-12)
        np.testing.assert_allclose(R.as_matrix() @ T[:3, :3], flange[:3, :3], atol=1e-12)


@pytest.mark.parametrize("robot", ["three", "gantry"])
def test_both_kinematics_agree_and_so_do_their_derivatives(robot, three, arm):
    robot = three if robot == "three" else gantry(arm)
    q = np.random.default_rng(2).uniform(-1, 1, (30, 9))
    chain = chain_of(robot)
    T = robot.forward(q)
    np.testing.assert_allclose(chain.forward(q), T, atol=1e-12)
    columns = chain.twists(q, T[:, :3, 3])
    h = 1e-6
    for i in range(3):
        step = h * (np.arange(9) == 6 + i)
        ahead, behind = robot.forward(q + step), robot.forward(q - step)
        moved = (ahead - behind)[:, :3, 3] / (2 * h)
        turned = Rotation.from_matrix(ahead[:, :3, :3] @ behind[:, :3, :3].transpose(0, 2, 1))
        np.testing.assert_allclose(columns[:, :3, i], moved, atol=1e-8)  # h^2, rounding over h
        np.testing.assert_allclose(columns[:, 3:, i], turned.as_rotvec() / (2 * h), atol=1e-8)
    for joints, want in zip(q[:5], T, strict=False):
        held = robot.held(joints[6:])
        np.testing.assert_allclose(held.forward(joints[:6]), want, atol=1e-12)
        np.testing.assert_allclose(chain_of(held).forward(joints[None, :6])[0], want, atol=1e-12)


def ring(count=25):
    """Once about a tube that lies along y, its axis through POINT; part frame there."""
    t = np.linspace(0, 2 * np.pi, count)
    points = np.c_[0.08 * np.cos(t), 0.02 * np.sin(2 * t), 0.08 * np.sin(t)]
    return Contour(points, np.c_[-np.cos(t), 0 * t, -np.sin(t)], name="ring")


def at_point():
    T = np.eye(4)
    T[:3, 3] = POINT
    return T


def errors(made):
    """What is wrong at the nodes, which are too far apart for what is between them."""
    found = audit(made, path_tolerance=1e-2)
    return [each for each in found if each.level == "error" and "-between" not in each.code]


def chuck(arm, **change):
    """A chuck that turns the tube without end."""
    travel = {"lower": -np.pi, "upper": np.pi, "endless": True, **SLOW, **change}
    return arm.with_positioner([0, 1, 0], POINT, name="chuck", **travel)


@pytest.mark.slow
def test_a_tube_is_cut_all_round_on_a_chuck_where_the_arm_alone_cannot(arm, tool):
    options = {"tool": tool, "placement": at_point(), "speed": 0.04, "gamma_step": np.radians(6)}
    contour = ring(121)
    with pytest.raises(NoFeasiblePath):
        plan(contour, arm, **options)
    made = plan(contour, chuck(arm), **options)
    assert np.ptp(made.unwrapped[:, 6]) > np.radians(45)
    assert audit(made, path_tolerance=1e-3) == []
    # What the bound between the nodes says holds at samples that it has not seen.
    chain = chain_of(made.robot)
    reached = bound_between_nodes(made, chain, motion_of(made, chain, "linear", 8), "linear")
    fine = motion_of(made, chain, "linear", 97)
    slack = 1.1e-5  # what the bound leaves to be hidden, and rounding
    assert (fine.q.min(axis=1) >= reached.low[:, :7] - slack)[~reached.open].all()
    assert (fine.q.max(axis=1) <= reached.high[:, :7] + slack)[~reached.open].all()


@pytest.mark.parametrize("case", ["rail", "table", "both"])
def test_it_costs_at_most_a_hundredth_more_than_a_dense_search_finds(case, arm, tool):
    rng = np.random.default_rng({"rail": 3, "table": 4, "both": 5}[case])
    y, wave = np.linspace(-0.3, 0.3, 9), rng.uniform(0.02, 0.1)
    points = np.c_[wave * np.sin(8 * y), y, 0 * y]
    contour = Contour(points, np.c_[0.2 * np.sin(5 * y), 0 * y, -np.ones(9)], name="wave")
    robot = arm
    if case != "table":
        robot = robot.on_rail([0, 1, 0], lower=-0.4, upper=0.4, step=0.1, **SLOW)
    if case != "rail":
        travel = TURN | {"lower": -0.4, "upper": 0.4, "step": 0.2}
        robot = robot.with_positioner([0, 0, 1], POINT, **travel)
    options = {"tool": tool, "placement": at_point(), "speed": 0.05, "gamma_step": np.radians(20)}
    dense = plan(contour, robot, method="exact", **options)
    found = plan(contour, robot, **options)
    assert found.cost <= 1.01 * dense.cost
    assert audit(found, path_tolerance=5e-3) == []


def test_a_course_may_be_given_and_is_checked(arm, tool):
    options = {"tool": tool, "placement": at_point(), "speed": 0.04, "gamma_step": np.radians(6)}
    contour, robot = ring(61), chuck(arm)
    # The simple rule: the table turns so that the tool always comes from above.
    rule = np.linspace(np.pi / 2, 2.5 * np.pi, 61)[:, None]
    ruled = plan(contour, robot, external=rule, **options)
    assert plan(contour, robot, **options).cost <= ruled.cost * 1.001
    with pytest.raises(InputError, match=r"external: expected shape"):
        plan(contour, robot, external=rule[:-1], **options)
    bound = chuck(arm, endless=False)
    with pytest.raises(InputError, match=r"external: chuck is at .* outside its range"):
        plan(contour, bound, external=rule, **options)
    with pytest.raises(InputError, match=r"chuck: the exact search .* needs a step"):
        plan(contour, robot, method="exact", **options)


def test_a_tilt_costs_no_more_than_the_nominal_axis(arm, tool):
    options = {"tool": tool, "placement": at_point(), "speed": 0.04, "gamma_step": np.radians(12)}
    contour, robot = ring(41), chuck(arm)
    rigid = plan(contour, robot, **options)
    made = plan(contour, robot, tilt=Tilt(cone=np.radians(4), steps=1, cost=0.01), **options)
    assert made.cost < rigid.cost
    assert made.tilt.any()
    assert not errors(made)


@pytest.mark.slow
def test_other_courses_may_be_faster_than_the_gentlest(arm, tool):
    options = {"tool": tool, "placement": at_point(), "gamma_step": np.radians(12)}
    contour, robot = ring(41), chuck(arm)
    gentlest = external_course(contour, robot, tool=tool, placement=at_point())
    along = fastest_speed(contour, robot, external=gentlest, refine=True, **options)
    found = fastest_speed(contour, robot, refine=True, **options)
    assert found.speed >= along.speed
    # There is a plan at the speed that is named.
    made = plan(contour, robot, speed=found.speed * 0.999, **options)
    assert not errors(made)
    too_fast = r"no admissible .*nothing about others(; joint \d is chuck)?$"
    with pytest.raises(NoFeasiblePath, match=too_fast):
        plan(contour, robot, speed=found.speed * 3, **options)


def test_axes_that_do_not_go_together_are_refused(arm, three):
    with pytest.raises(InputError, match="at most 3 external axes, got 4: rail, tilt, turn, more"):
        three.on_rail([1, 0, 0], lower=0, upper=1, name="more", **SLOW)
    railed = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, **SLOW)
    with pytest.raises(InputError, match="two of its external axes are named 'rail'"):
        railed.on_rail([1, 0, 0], lower=0, upper=1, **SLOW)
    with pytest.raises(InputError, match="rail: a linear axis cannot be endless"):
        arm.on_rail([1, 0, 0], lower=0, upper=1, endless=True, **SLOW)
    with pytest.raises(InputError, match="held: expected shape"):
        three.held(0.1)
