"""How far a run leaves its contour: corners of a square and circles, known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Contour, Response, plan
from kerfpath.execution import (
    IDEAL,
    ToolMotion,
    executed,
    path_error,
    roundness,
    share_within,
    timing_of,
)
from kerfpath.execution.executed import Executed
from kerfpath.post import LinearMove, build_program

SIDE, ZONE = 0.02, 0.004


def run_round_a_corner(zone, lean=0.0):
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, :3, 3] = [[0, 0, 0], [SIDE, 0, 0], [SIDE, SIDE, 0]]
    c, s = np.cos(lean), np.sin(lean)
    T[:, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    moves = [
        LinearMove(T_part_tip=pose, q=np.zeros(6), speed=0.1, duration=0.2, zone=each)
        for pose, each in zip(T[1:], (zone, 0.0), strict=True)
    ]
    motion = ToolMotion.of(T[0], moves)
    time = np.linspace(0, motion.time[-1], 2001)
    none = np.zeros((len(time), 6))
    run = Executed(
        section="", robot=None, T_base_part=np.eye(4), T_flange_tip=np.eye(4),
        tool_motion=motion, time=time, planned=time, q=none, T=motion.poses(time),
        velocity_share=none,
        acceleration_share=none, velocity_bound=0.0, acceleration_bound=0.0,
    )  # fmt: skip
    points = np.array([[0, 0, 0], [SIDE / 2, 0, 0], [SIDE, 0, 0], [SIDE, SIDE / 2, 0]])
    points = np.vstack([points, [[SIDE, SIDE, 0]]])
    return run, Contour(points, np.tile([0.0, 0.0, 1.0], (5, 1)))


def test_a_rounded_corner_is_a_quarter_of_its_zone_from_either_side():
    run, path = run_round_a_corner(ZONE)
    off = path_error(run, path)
    # The vertex of the parabola: a quarter of the zone inwards along both sides.
    assert off.largest == pytest.approx(ZONE / 4, rel=1e-3)
    assert off.time[off.worst] == pytest.approx(SIDE / 0.1, abs=1e-3)
    assert off.axis.max() == pytest.approx(0, abs=1e-9)


def test_a_lean_of_the_tool_is_its_angle():
    run, path = run_round_a_corner(ZONE, lean=0.03)
    assert path_error(run, path).axis.max() == pytest.approx(0.03, rel=1e-6)


def test_without_zones_it_stays_on_the_path():
    run, path = run_round_a_corner(0.0)
    assert path_error(run, path).largest == pytest.approx(0, abs=1e-12)


# -----------------------------------------------------------------------------
# Runs whose joints lag: circles, which shrink.

SPEED, SIGMA, RADIUS = 0.1, 0.03, 0.01


@pytest.fixture(scope="module")
def hole():
    t = np.linspace(0, 2 * np.pi, 241)
    points = RADIUS * np.c_[np.cos(t), np.sin(t), 0 * t]
    return Contour(points, np.tile([0.0, 0.0, -1.0], (241, 1)), closed=True)


@pytest.fixture(scope="module")
def cut(hole, arm, tool, placement):
    made = plan(
        hole.resample(spacing=0.0005), arm, tool=tool, placement=placement, speed=SPEED,
        certify=None,
    )  # fmt: skip
    (run,) = executed(build_program([made], zone_error=1e-5, thin_tolerance=0))
    return run


def off_of(run, hole, response, **options):
    timing = timing_of(run, **options)
    return path_error(run, hole, timing=timing, response=response)


def test_without_lag_it_is_off_by_its_corners_at_every_sample_of_time(cut, hole):
    off = off_of(cut, hole, IDEAL)
    assert off.largest == pytest.approx(path_error(cut, hole).largest, abs=1e-6)
    assert not off.lag.any()
    assert not off.friction.any()
    assert off.cause.startswith("rounding of corners")


def test_a_lag_makes_a_hole_smaller_and_says_so(cut, hole):
    found = roundness(off_of(cut, hole, Response(sigma=[SIGMA])), hole)
    asked = roundness(off_of(cut, hole, IDEAL), hole)
    assert found.drawn == pytest.approx(2 * RADIUS, rel=1e-4)
    assert asked.executed == pytest.approx(2 * RADIUS, rel=1e-3)
    share = np.exp(-((SIGMA * SPEED / RADIUS) ** 2) / 2)
    # The joints speed up and slow down at the ends of the cut, where they lag less.
    assert found.executed == pytest.approx(share * asked.executed, rel=5e-3)
    assert found.out_of_round > asked.out_of_round


def test_the_way_most_of_which_is_closer_than_the_worst(cut, hole):
    off = off_of(cut, hole, Response(sigma=[SIGMA], sigma_range=[0.02, 0.04]))
    assert 0 < off.usual <= off.largest
    low, high = off.ends
    assert low < off.largest < high
    assert "lag of the joints" in off.cause
    assert np.abs(off.tip - off.lag).max() <= off.rounding.max() + 3e-6  # chords of 0.3 mm


def test_friction_is_counted_after_reversals(hole, cut):
    # Joints 1 to 3 of a circle reverse twice each, joints that only follow less than that.
    off = off_of(cut, hole, replace(Response(sigma=[SIGMA]), friction=1e-3))
    assert {each.joint for each in off.reversals} <= {0, 1, 2}
    assert len(off.reversals) >= 4
    assert off.friction.max() > 1e-4
    assert "reversed" in off.cause


def test_a_lower_speed_keeps_the_tolerance_and_hardly_a_higher_one(cut, hole):
    response, tolerance = Response(sigma=[SIGMA]), 1e-4
    share = share_within(cut, hole, tolerance, response)
    assert 0 < share < 1
    assert off_of(cut, hole, response, speed_share=share).largest <= tolerance
    assert off_of(cut, hole, response, speed_share=1.04 * share).largest > tolerance
    assert share_within(cut, hole, 1.0, response) == 1.0
    assert share_within(cut, hole, 1e-9, response) is None


def test_a_tolerance_that_hardly_leaves_more_than_the_corners_is_not_sought_for_ever(cut, hole):
    """A speed so low that its samples take all memory was tried first."""
    response = Response(sigma=[SIGMA])
    corners = off_of(cut, hole, response).rounding.max()
    assert share_within(cut, hole, corners * (1 + 1e-9), response) is None


def test_a_line_and_half_a_circle_are_no_holes(cut, hole):
    line = Contour(np.c_[np.linspace(0, 1, 20), np.zeros((20, 2))], np.tile([0.0, 0, 1], (20, 1)))
    half = Contour(hole.points[:121], hole.axes[:121])
    off = off_of(cut, hole, IDEAL)
    assert roundness(off, line) is None
    assert roundness(off, half) is None
