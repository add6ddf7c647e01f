"""Targets moved by the model of the response: nearer to the drawing, and within every limit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holes import round_hole
from kerfpath import Contour, InputError, Response, plan
from kerfpath.auditor import checks
from kerfpath.execution import (
    Compensator,
    lengths_of,
    longest_run,
    moved,
    path_error,
    speed_of,
    timing_of,
)
from kerfpath.execution.compensation import HOLDS, in_order, lacking, smoothed
from kerfpath.post import build_program

SIGMA, RADIUS, SPEED = 0.025, 0.01, 0.06
LAG = Response(sigma=[SIGMA])
TOLERANCE = 5e-5


def run_of(made, bounded):
    return longest_run(build_program([made]), bounded=bounded)


def unbroken(made, run):
    return ""


def broken(made, run):
    over = max(run.velocity_bound, run.acceleration_bound)
    failed = [row.code for row in checks(made) if row.level == "error" and not row.ok]
    return f"{over:.3g} of a limit" if over > 1.001 else ", ".join(failed)


def by(path, how=LAG, **about):
    usual = {"tolerance": TOLERANCE, "most": 2e-3, "run": run_of, "broken": broken}
    return Compensator(path=path, response=how, **usual | about)


@pytest.fixture(scope="module")
def path():
    return round_hole(RADIUS)


@pytest.fixture(scope="module")
def made(path, arm, tool, placement):
    nodes = path.resample(spacing=0.001)
    return plan(nodes, arm, tool=tool, placement=placement, speed=SPEED, certify=None)


def off(made, path, how=LAG):
    run = run_of(made, False)
    return path_error(run, path, timing=timing_of(run), response=how).largest


def test_the_executed_path_comes_within_the_tolerance_with_every_limit_kept(made, path):
    found = by(path).of(made)
    assert not found.failure
    # A low-pass takes (sigma v)^2 / (2 r) off the radius, more where the leads turn.
    shrunk = (SIGMA * SPEED) ** 2 / (2 * RADIUS)
    assert shrunk < found.before < 1.6 * shrunk
    assert found.rest <= TOLERANCE
    assert off(found.plan, path) == found.rest
    assert off(made, path) == found.before
    assert broken(found.plan, found.run) == ""
    shift = np.linalg.norm(found.plan.contour.points - made.contour.points, axis=1)
    assert shift.max() == pytest.approx(found.largest)
    # The circle grows by what it shrinks, and the ends of the leads stay.
    inner = np.abs(made.contour.s - made.contour.s.mean()) < RADIUS
    assert shift[inner] == pytest.approx(shrunk, rel=0.15)
    np.testing.assert_allclose(shift[[0, -1]], 0, atol=1e-12)
    np.testing.assert_allclose(found.plan.q[[0, -1]], made.q[[0, -1]], rtol=0, atol=1e-9)


def test_the_tool_turns_as_planned_and_the_cut_keeps_its_speed(made, path):
    found = by(path).of(made).plan
    np.testing.assert_array_equal(found.time, made.time)
    np.testing.assert_allclose(
        found.T_part_tip[:, :3, :3], made.T_part_tip[:, :3, :3], rtol=0, atol=1e-9
    )
    run = run_of(found, False)
    T = path_error(run, path, timing=timing_of(run), response=LAG).T
    speed = np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1) / 0.002
    under_way = slice(int(0.4 * len(speed)), int(0.6 * len(speed)))
    np.testing.assert_allclose(speed[under_way], SPEED, rtol=0.02)


def test_a_straight_slow_line_stays_as_it_is(arm, tool, placement):
    points = np.c_[np.linspace(0, 0.1, 51), np.zeros((51, 2))]
    line = Contour(points, np.tile([0.0, 0.0, -1.0], (51, 1)))
    made = plan(line, arm, tool=tool, placement=placement, speed=0.03, certify=None)
    found = by(line).of(made)
    assert (found.failure, found.rounds, found.largest) == ("", 0, 0.0)
    assert found.plan is made


def test_every_round_is_nearer(made, path):
    rests = [by(path, tolerance=each, broken=unbroken).of(made).rest for each in (2e-4, 4e-5, 1e-5)]
    assert rests[0] >= rests[1] >= rests[2]
    assert by(path, tolerance=1e-9, broken=unbroken).of(made).failure.startswith("with moved")


@pytest.mark.slow
def test_what_breaks_a_limit_is_refused_with_a_speed_that_does_not(made, path):
    fast = replace(made, time=made.time * 0.25)
    compensator = by(path)
    found = compensator.of(fast)
    assert found.failure
    assert found.plan is fast
    assert found.rest == found.before
    share = compensator.share(fast)
    assert 0.25 < share < 1
    slow = replace(fast, time=fast.time / share)
    kept = compensator.of(slow)
    assert kept.failure == ""
    assert kept.rest <= TOLERANCE
    assert broken(kept.plan, kept.run) == ""
    assert compensator.of(replace(fast, time=fast.time / (1.06 * share))).failure


def test_targets_are_not_moved_further_than_allowed(made, path):
    found = by(path, most=1e-4, broken=unbroken).of(made)
    assert "compensate_most_mm" in found.failure
    assert found.largest == 0


def test_no_compensation_above_the_speed_for_which_the_response_holds(made, path):
    found = by(path, replace(LAG, fastest=0.05)).of(made)
    assert found.failure == ("the response is not known above 3 m/min, and the cut has 3.6 m/min")
    assert by(path).fastest == HOLDS
    assert speed_of(made) == pytest.approx(SPEED)


def test_ideal_joints_have_nothing_to_compensate(made, path):
    with pytest.raises(InputError, match="got an ideal response"):
        by(path, Response()).of(made)


def test_elastic_joints_with_friction_are_compensated_too(made, path):
    how = Response(sigma=[0.02], mass=[1e-4, 8e-5, -3e-5], inertia=[0, 1.5e-4, 0], friction=1e-4)
    found = by(path, how, tolerance=1e-4).of(made)
    assert found.rest < 0.6 * found.before


# -----------------------------------------------------------------------------
# Points and ways.


@given(st.integers(0, 2**31))
def test_samples_in_order_have_the_least_sum_of_squares(seed):
    rng = np.random.default_rng(seed)
    points, way = rng.normal(size=(4, 3)), rng.normal(size=(6, 3))
    found = in_order(points, way)
    assert (np.diff(found) >= 0).all()
    every = [
        (i, j, k, m) for i in range(6) for j in range(i, 6) for k in range(j, 6)
        for m in range(k, 6)
    ]  # fmt: skip
    sums = [((points - way[list(each)]) ** 2).sum() for each in every]
    assert ((points - way[found]) ** 2).sum() == pytest.approx(min(sums), rel=1e-12)


def test_a_way_that_passes_a_place_twice_is_told_apart():
    a = np.linspace(0, 4 * np.pi, 401)
    way = np.c_[np.cos(a), np.sin(a), 1e-9 * a]
    found = in_order(1.1 * way[::20], way)
    np.testing.assert_array_equal(found, np.arange(0, 401, 20))


def test_a_smaller_circle_lacks_its_difference_outwards():
    a = np.linspace(0, 2 * np.pi, 361)
    circle = np.c_[np.cos(a), np.sin(a), 0 * a]
    off = lacking(circle[::10], 0.9 * circle)
    np.testing.assert_allclose(off, 0.1 * circle[::10], rtol=0, atol=1e-4)


def test_smoothing_keeps_what_is_even_and_fades_at_the_ends():
    time = np.linspace(0, 1, 101)
    found = smoothed(np.ones((101, 3)), time, 0.02)
    np.testing.assert_allclose(found[10:-10], 1, rtol=0, atol=1e-5)
    np.testing.assert_array_equal(found[[0, -1]], 0)
    fast = smoothed(np.sin(200 * time)[:, None] * np.ones(3), time, 0.02)
    assert np.abs(fast[20:-20]).max() < 0.01


def test_moved_nodes_have_the_lengths_of_their_chords(made):
    nodes = made.contour
    np.testing.assert_allclose(lengths_of(nodes, nodes.points), nodes.s - nodes.s[0], atol=1e-12)
    np.testing.assert_allclose(
        lengths_of(nodes, 2 * nodes.points), 2 * (nodes.s - nodes.s[0]), atol=1e-12
    )
    far = np.zeros((len(nodes), 3))
    far[5, 2] = 10.0
    assert moved(made, far) is None
