"""Branches of the joints over gamma, courses through valleys, and their screening."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

import kerfpath
from from_python import from_python
from kerfpath.kernels import screening as kernel
from kerfpath.kernels.continuous import Steps
from kerfpath.kernels.metric import increments_between, wrap
from kerfpath.kernels.screening import Energy
from kerfpath.planner.branches import HALVINGS, INTERVALS, SAG, TO_EDGES, TURN, sample_branches
from kerfpath.planner.screening import SHARP, SMOOTH, Screening, within
from kerfpath.search import METRIC_CODES, Course, Valleys

DT = 0.04
"""s"""
ROUNDED = 1e-7
"""rad: what rounding leaves of joints close to a singularity."""


@pytest.fixture(scope="module")
def robot():
    """Axes 4 and 6 may turn by 400 degrees either way."""
    limits = {"acceleration": np.radians([320, 270, 420, 1300, 1400, 2000])}
    return kerfpath.robot("abb_irb4600_60_205").with_limits(**limits)


@pytest.fixture(scope="module")
def tool():
    bent = np.eye(4)
    bent[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    bent[:3, 3] = 0.1, 0.0, 0.3
    return bent


@pytest.fixture(scope="module")
def frames():
    """Ten nodes, 8 mm apart, with the beam turning from straight down to 10 degrees off."""
    K = 10
    H = np.tile(np.eye(4), (K, 1, 1))
    for k, tilt in enumerate(np.radians(np.linspace(0.0, 10.0, K))):
        down = np.diag([1.0, -1.0, -1.0])
        c, s = np.cos(tilt), np.sin(tilt)
        H[k, :3, :3] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ down
        H[k, :3, 3] = 1.4, 0.008 * k, 0.5
    return H


@pytest.fixture(scope="module")
def step(robot):
    return robot.velocity_limits() * DT


@pytest.fixture(scope="module")
def branches(robot, frames, tool, step):
    return sample_branches(robot, frames, tool, step)


def poses(frames, gamma, tool):
    spin = np.tile(np.eye(4), (len(gamma), 1, 1))
    spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
    spin[:, 1, 0], spin[:, 0, 1] = np.sin(gamma), -np.sin(gamma)
    return frames @ spin @ np.linalg.inv(tool)


def test_samples_are_poses_of_their_node_and_posture_inside_the_ranges(
    robot, frames, tool, branches
):
    T = poses(frames[branches.node], branches.gamma, tool)
    np.testing.assert_allclose(robot.forward(branches.q), T, atol=ROUNDED)
    q, reach = robot.arm.inverse_all(T)
    own = np.arange(len(T)), branches.posture
    assert reach[own].all()
    np.testing.assert_allclose(wrap(q[own] - branches.q), 0, atol=ROUNDED)
    limits = robot.joint_limits()
    inside = (branches.q >= limits.lower - 1e-8) & (branches.q <= limits.upper + 1e-8)
    assert (inside | limits.endless).all()
    assert set(branches.posture) <= set(range(robot.postures))


def test_every_sample_of_the_grid_that_has_a_pose_is_there(robot, frames, tool, branches):
    limits = robot.joint_limits()
    gamma = 2 * np.pi * np.arange(INTERVALS) / INTERVALS - np.pi
    q, reach = robot.arm.inverse_nodes(frames, gamma, tool)
    turns = 2 * np.pi * np.arange(-3, 4)[:, None]
    on = q[..., None, :] + turns
    fits = ((on >= limits.lower) & (on <= limits.upper)).any(axis=-2) | limits.endless
    node, number, posture = np.nonzero(reach & fits.all(axis=-1))
    here = {
        (int(k), int(p), round(float(g), 9))
        for k, p, g in zip(branches.node, branches.posture, branches.gamma, strict=True)
    }
    for k, m, p in zip(node, number, posture, strict=True):
        assert (k, p, round(float(wrap(gamma[m])), 9)) in here


@pytest.mark.parametrize("seed", range(12))
def test_a_branch_between_two_samples_of_the_grid_is_there(seed, robot, frames, tool, step):
    """The range of one joint ends it on one side, that of another joint on the other."""
    rng = np.random.default_rng(seed)
    spacing = 2 * np.pi / INTERVALS
    while True:
        width = rng.uniform(0.1, 0.5) * spacing
        low = rng.integers(INTERVALS) * spacing - np.pi + rng.uniform(0.1, 0.4) * spacing
        ends = poses(np.repeat(frames[:1], 2, axis=0), np.array([low, low + width]), tool)
        q, reach = robot.arm.inverse_all(ends)
        posture = int(rng.integers(robot.postures))
        one, other = q[:, posture]
        if not reach[:, posture].all() or np.abs(q[:, posture]).max() > 3.0:
            continue
        a, b = rng.permutation(6)[:2]
        if min(abs(other[a] - one[a]), abs(other[b] - one[b])) > 0.02 * width:
            break
    lower, upper = np.full(6, -np.pi), np.full(6, np.pi)
    for joint, end, inward in ((a, one, other), (b, other, one)):  # each keeps its side of an end
        (lower if end[joint] < inward[joint] else upper)[joint] = end[joint]
    narrow = robot.with_limits(lower=lower, upper=upper, couplings=())
    found = sample_branches(narrow, frames[:1], tool, step, [posture])
    away = np.mod(found.gamma - low, 2 * np.pi)
    assert ((away > 0) & (away < width)).any()


def test_joints_between_neighbours_are_nearly_straight(robot, frames, tool, step, branches):
    one, other = branches.one, branches.other
    apart = one != other
    width = np.mod(branches.gamma[other] - branches.gamma[one], 2 * np.pi)
    wide = apart & (width > 4 * np.pi / INTERVALS / 2**HALVINGS)
    one, other, width = one[wide], other[wide], width[wide]
    middle = branches.gamma[one] + width / 2
    q, _ = robot.arm.inverse_all(poses(frames[branches.node[one]], middle, tool))
    q = q[np.arange(len(q)), branches.posture[one]]
    across = increments_between(branches.q[one], branches.q[other], branches.endless)
    sag = increments_between(branches.q[one], q, branches.endless) - across / 2
    assert (np.abs(sag) <= SAG * step + ROUNDED).all()
    assert (np.abs(across) <= TURN + ROUNDED).all()


def test_samples_are_close_where_the_wrist_swings(robot, tool, step):
    """At gamma 0 axis 5 is 0.1 degrees from its singularity: axes 4 and 6 swing about there."""
    q = np.array([0.1, 0.2, 0.3, 0.4, np.radians(0.1), 0.5])
    frames = (robot.forward(q) @ tool)[None]
    found = sample_branches(robot, frames, tool, step)
    near = np.abs(found.gamma) < np.radians(2)
    same = (np.abs(wrap(found.q - q)) < ROUNDED).all(axis=1)
    assert same[near].any()
    own = near & (found.posture == found.posture[same][0])
    turned = np.sort(found.q[own, 3])
    assert turned[-1] - turned[0] > np.pi / 2
    assert np.diff(turned).max() < TURN
    assert own.sum() > 20


def test_the_end_of_a_branch_is_met_closely(robot, frames, tool, step):
    """Joint 4 may not turn beyond 1 rad: the last samples are within a 2^7th of an interval."""
    upper = robot.upper.copy()
    upper[3] = 1.0
    held = robot.with_limits(upper=upper)
    found = sample_branches(held, frames, tool, step)
    width = 2 * np.pi / INTERVALS / 2**TO_EDGES
    joined = np.concatenate([found.one, found.other])[np.tile(found.one != found.other, 2)]
    times = np.bincount(joined, minlength=len(found.q))
    ends = np.flatnonzero(times == 1)
    checked = 0
    for v in ends.tolist():
        beyond = found.gamma[v] + np.array([-1.01, 1.01]) * width
        at = np.repeat(frames[found.node[v]][None], 2, axis=0)
        q, reach = held.arm.inverse_all(poses(at, beyond, tool))
        q, reach = q[:, found.posture[v]], reach[:, found.posture[v]]
        turned = found.q[v] + wrap(q - found.q[v])
        out = (
            ~reach | (turned > upper + 1e-9).any(axis=1) | (turned < held.lower - 1e-9).any(axis=1)
        )
        checked += out.any()
        assert out.any()
    assert checked


def test_only_the_postures_asked_for_are_sampled(robot, frames, tool, step):
    assert set(sample_branches(robot, frames, tool, step, (2, 5)).posture) <= {2, 5}


def test_a_range_beyond_a_turn_is_no_range(robot, frames, tool, step):
    """Joints that may turn by more than a turn are compared modulo a turn, others are not."""
    wide = robot.upper - robot.lower > 2 * np.pi
    found = sample_branches(robot, frames, tool, step)
    np.testing.assert_array_equal(found.endless, wide | robot.endless)


# -----------------------------------------------------------------------------
# Courses.


def steps_of(robot, step, metric="manhattan", objective="sum"):
    weights = np.ascontiguousarray(1 / robot.velocity_limits())
    return Steps(weights, METRIC_CODES[metric], objective == "max", np.inf, -step, step)


def length(q, steps, metric, objective):
    d = np.abs(np.diff(q, axis=0)) * steps.weight
    each = {"manhattan": d.sum(1), "euclid": np.sqrt((d * d).sum(1)), "chebychev": d.max(1)}[metric]
    return each.sum() if objective == "sum" else each.max()


@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("metric", ["manhattan", "euclid", "chebychev"])
def test_courses_keep_the_velocities_and_the_first_is_the_cheapest(
    robot, step, branches, metric, objective
):
    steps = steps_of(robot, step, metric, objective)
    valleys = Valleys(branches, steps, np.zeros(len(branches.q)))
    courses = list(islice(valleys.courses(), 20))
    assert len(courses) > 3
    for course in courses:
        assert (np.abs(np.diff(course.q, axis=0)) <= step * (1 + 1e-6) + 1e-8).all()
        # Values are interpolated between samples whose joints leave a line by a tenth of a step.
        assert length(course.q, steps, metric, objective) >= 0.8 * valleys.value
    assert length(courses[0].q, steps, metric, objective) <= 1.05 * valleys.value + 1e-9
    for k, course in enumerate(courses):
        assert not any(course.like(other) for other in courses[:k])


def test_the_value_is_the_same_from_the_other_end(robot, frames, tool, step, branches):
    steps = steps_of(robot, step)
    back = sample_branches(robot, frames[::-1], tool, step)
    one, other = (Valleys(each, steps, np.zeros(len(each.q))).value for each in (branches, back))
    # Interpolation is not symmetric.
    assert other == pytest.approx(one, rel=0.02)


def test_closed_samples_are_not_passed(robot, step, branches):
    steps = steps_of(robot, step)
    shut = branches.posture != 1
    valleys = Valleys(branches, steps, np.where(shut, np.inf, 0.0))
    assert {int(p) for course in valleys.courses() for p in course.posture} == {1}
    nothing = Valleys(branches, steps, np.full(len(branches.q), np.inf))
    assert nothing.value == np.inf
    assert not list(nothing.courses())


def test_valleys_without_a_course_are_counted(robot, step, branches):
    valleys = Valleys(branches, steps_of(robot, step), np.zeros(len(branches.q)))
    courses = list(valleys.courses())
    left = [valleys.left(courses[:count]) for count in range(1, len(courses) + 1)]
    assert (np.diff(left) <= 0).all()
    assert left[0] > 3
    assert left[-1] == 0


def test_nothing_leads_on_if_the_steps_are_too_small(robot, branches):
    none = steps_of(robot, np.full(6, 1e-9))
    valleys = Valleys(branches, none, np.zeros(len(branches.q)))
    assert valleys.value == np.inf
    assert not list(valleys.courses())


# -----------------------------------------------------------------------------
# Screening.

ENERGY = Energy(
    weight=np.array([1.0, 2.0, 0.5]),
    metric=METRIC_CODES["manhattan"],
    minimax=False,
    smooth=0.05,
    power=6.0,
    velocity=np.array([0.3, 0.2, 0.25]),
    acceleration=np.array([0.1, 0.1, 0.2]),
    lower=np.array([-0.5, -np.inf, -0.4]),
    upper=np.array([0.5, np.inf, 0.4]),
    price=30.0,
)
"""Limits that random motions break."""


@pytest.mark.parametrize("minimax", [False, True])
@pytest.mark.parametrize("metric", ["manhattan", "euclid", "chebychev"])
def test_the_model_of_the_energy_has_its_slope(metric, minimax):
    """Against central differences, with joints that are curved functions of gamma."""
    rng = np.random.default_rng(4)
    energy = ENERGY._replace(metric=METRIC_CODES[metric], minimax=minimax)
    a, b, c = (rng.normal(size=(7, 3)) * size for size in (0.3, 0.5, 0.2))
    gamma, scale = rng.normal(size=7) * 0.5, np.ones(1)

    def joints(g):
        return a + b * g[:, None] + c * g[:, None] ** 2

    def value(g):
        out = np.empty(1)
        kernel.energies(joints(g)[None], energy, scale, out)
        return out[0]

    gradient, bands = np.empty(7), np.empty((7, 3))
    fill = from_python(kernel._fill_model)
    fill(joints(gamma), b + 2 * c * gamma[:, None], 2 * c, energy, 1.0, np.empty((7, 3)), gradient,
         bands)  # fmt: skip
    h = 1e-6
    slope = [(value(gamma + h * e) - value(gamma - h * e)) / (2 * h) for e in np.eye(7)]
    np.testing.assert_allclose(gradient, slope, rtol=1e-5, atol=1e-5)
    assert np.abs(gradient).max() > 0.1


def test_five_diagonals_are_solved_as_a_full_matrix():
    rng = np.random.default_rng(5)
    lower = np.tril(np.triu(rng.normal(size=(9, 9)), -2)) + 3 * np.eye(9)
    full, gradient = lower @ lower.T, rng.normal(size=9)
    bands = np.zeros((9, 3))
    for j in range(3):
        bands[j:, j] = np.diagonal(full, -j)
    out, factors = np.empty(9), np.empty((9, 3))
    solve = from_python(kernel._solve)
    assert solve(bands, 0.0, gradient, factors, out)
    np.testing.assert_allclose(out, np.linalg.solve(full, -gradient), rtol=1e-10)
    bands[4, 0] = -1.0
    assert not solve(bands, 0.0, gradient, factors, out)


@pytest.fixture(scope="module")
def screening(robot, frames, tool, step):
    limits, (_, acceleration) = robot.joint_limits(), robot.speed_limits()
    return Screening(
        robot=robot,
        frames=frames,
        tool=tool,
        limits=limits,
        energy=ENERGY._replace(
            weight=np.ascontiguousarray(1 / robot.velocity_limits()),
            velocity=step,
            acceleration=acceleration * DT**2,
            lower=np.where(limits.endless, -np.inf, limits.lower),
            upper=np.where(limits.endless, np.inf, limits.upper),
        ),
    )


@pytest.fixture(scope="module")
def courses(robot, step, branches):
    valleys = Valleys(branches, steps_of(robot, step), np.zeros(len(branches.q)))
    return list(islice(valleys.courses(), 12))


@pytest.mark.parametrize("share", [0.05, 0.4, 1.0, 2.5])
def test_a_time_is_that_of_steps_between_the_least_ones_and_equal_ones(screening, courses, share):
    """Steps under (5) are a bound from below, steps all as long as the sharpest one from above."""
    q = np.array([course.q for course in courses])
    energy = screening.energy
    faster = energy._replace(
        velocity=energy.velocity * share, acceleration=energy.acceleration * share**2
    )
    time, interval = (
        replace(screening, energy=faster, aim=aim).scores(q) for aim in ("time", "interval")
    )
    fast = np.abs(np.diff(q, axis=1) / faster.velocity).max(axis=2)
    assert (time >= np.maximum(fast, 1.0).sum(axis=1)).all()
    assert (time <= fast.shape[1] * np.maximum(interval, 1.0) + 1e-9).all()


@pytest.mark.parametrize("stages", [SMOOTH, SHARP])
def test_screened_motions_are_motions_of_the_arm_and_better_than_their_courses(
    robot, frames, tool, screening, courses, stages
):
    found = screening.screened(courses, stages)
    assert found
    scores = screening.scores(np.array([course.q for course in found]))
    assert (np.diff(scores) >= 0).all()
    begun = screening.scores(np.array([course.q for course in courses]))
    # The last stage still rounds the distances: it may end a little above the cheapest course.
    assert scores[0] <= begun.min() * (1 + 1e-3)
    for course in found:
        T = poses(frames, course.gamma, tool)
        np.testing.assert_allclose(robot.forward(course.q), T, atol=ROUNDED)
        assert (np.abs(np.diff(course.q, axis=0)) < np.pi).all()


def test_alike_motions_are_kept_once_and_unreachable_ones_dropped(screening, courses):
    twice = [courses[0], courses[0]]
    assert len(screening.screened(twice, SHARP)) == 1
    away = screening.frames.copy()
    away[:, 0, 3] += 9.0
    assert screening.screened(courses[:1], ())
    assert not replace(screening, frames=away).screened(courses, SHARP)


def in_posture(screening, posture, gamma):
    K = len(screening.frames)
    return Course(np.full(K, gamma), np.zeros((K, 6)), np.full(K, posture))


def test_of_two_poses_of_a_wrist_one_motion_is_screened(robot, screening):
    """Both lead to the same; where a range binds one of them, it is the other."""
    clear = []
    for gamma in np.radians(range(0, 360, 20)):
        both = screening._motions([in_posture(screening, mu, gamma) for mu in (0, 1)])
        clear += [gamma] if len(both.q) == 2 and screening.is_unbound(both.q).all() else []
    flip = {mu: [in_posture(screening, mu, gamma) for gamma in clear[:2]] for mu in (0, 1)}
    one, other = (screening._motions(flip[mu]) for mu in (0, 1))
    assert len(one.q) == 2
    np.testing.assert_allclose(np.abs(np.diff(one.q, axis=1)), np.abs(np.diff(other.q, axis=1)))
    assert screening.is_unbound(np.concatenate([one.q, other.q])).all()
    for first, second in ((0, 1), (1, 0)):
        both = screening.screened(flip[first] + flip[second], SHARP)
        alone = screening.screened(flip[first], SHARP)
        assert [c.posture[0] for c in both] == [first] * len(alone)
        np.testing.assert_array_equal([c.gamma for c in both], [c.gamma for c in alone])
    upper, largest = robot.upper.copy(), [each.q[..., 4].max() for each in (one, other)]
    upper[4] = max(largest) + 0.1
    held = replace(screening, limits=robot.with_limits(upper=upper).joint_limits())
    kept = held._without_flipped(held._motions(flip[0] + flip[1]))
    assert set(kept.posture.ravel()) == {int(np.argmin(largest))}


def test_the_score_of_a_motion_within_the_limits_is_its_cost(screening):
    still = np.tile(np.linspace(0, 1e-4, 10)[:, None], 6)[None]
    cost = np.abs(np.diff(still[0], axis=0) * screening.energy.weight).sum()
    assert screening.scores(still)[0] == pytest.approx(cost, rel=1e-12)
    jump = still.copy()
    jump[0, 5:] += 2.0 * screening.energy.velocity
    assert screening.scores(jump)[0] > 1.2 * cost


def test_joints_are_shifted_by_whole_turns_into_their_ranges(robot):
    limits = robot.joint_limits()
    q = np.tile(np.linspace(-0.2, 0.2, 5)[:, None], 6)
    off = q + 2 * np.pi * np.array([1, -1, 2, 0, -3, 3])
    np.testing.assert_allclose(within(limits, off), q, atol=1e-12)


def test_courses_are_alike_by_gamma_and_posture():
    course = Course(np.zeros(3), np.zeros((3, 6)), np.zeros(3, int))
    assert course.like(course._replace(gamma=np.full(3, 2 * np.pi + 0.01)))
    assert not course.like(course._replace(gamma=np.array([0, 0.1, 0])))
    assert not course.like(course._replace(posture=np.array([0, 1, 0])))
