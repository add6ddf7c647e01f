"""What joints need between the targets: by dense sampling, and least where zones are wide."""

import numpy as np
import pytest

from kerfpath import plan
from kerfpath.execution import executed
from kerfpath.post import Controller, build_program

STEP = np.radians(10)


@pytest.fixture(scope="module")
def made(circle, arm, tool, placement):
    return plan(circle, arm, tool=tool, placement=placement, speed=0.3, gamma_step=STEP)


def run_of(made, **options):
    (run,) = executed(build_program([made], **options))
    return run


def peaks_of(made, run, arm):
    """Return the peak shares by inverse kinematics of many more poses, all solutions looked at."""
    motion, step = run.tool_motion, 1e-4
    time = np.arange(2 * step, motion.time[-1] - 2 * step, 5e-4)
    planned = made.unwrapped
    q = []
    for at in (time - step, time, time + step):
        poses = made.T_base_part @ motion.poses(at) @ np.linalg.inv(made.T_flange_tip)
        near = np.stack([np.interp(at, motion.time, joint) for joint in planned.T], axis=1)
        solved, reach = arm.arm.inverse_all(poses)
        solved += 2 * np.pi * np.round((near[:, None] - solved) / (2 * np.pi))
        apart = np.where(reach, np.abs(solved - near[:, None]).max(axis=2), np.inf)
        q.append(solved[np.arange(len(at)), apart.argmin(axis=1)])
    velocity, acceleration = arm.speed_limits()
    return (
        np.abs((q[2] - q[0]) / (2 * step) / velocity).max(),
        np.abs((q[2] - 2 * q[1] + q[0]) / step**2 / acceleration).max(),
    )


@pytest.mark.parametrize("zone", ["auto", 0.001])
def test_the_peaks_are_those_of_dense_sampling(zone, made, arm):
    run = run_of(made, zone=zone)
    velocity, acceleration = peaks_of(made, run, arm)
    # Both sample: of what is smooth between, a percent or two may lie beside the samples.
    assert run.peak_velocity.share == pytest.approx(velocity, rel=0.01)
    assert run.peak_acceleration.share == pytest.approx(acceleration, rel=0.03)


def test_with_zones_that_meet_the_motion_keeps_what_the_nodes_keep(made):
    at_nodes = made.criteria.peak_acceleration.max()
    auto = run_of(made).peak_acceleration
    # Zones end at 0.49 of the way: 2 % more; the rest is what straight moves do to joints.
    assert auto.share == pytest.approx(at_nodes, rel=0.06)
    narrow = [run_of(made, zone=zone).peak_acceleration.share for zone in (2e-3, 1e-3, 5e-4)]
    assert auto.share < narrow[0] < narrow[1] < narrow[2]
    # In half the zone the same turn takes half the time.
    assert narrow[2] == pytest.approx(2 * narrow[1], rel=0.1)


def test_between_zones_that_meet_rounding_is_not_taken_for_acceleration(made):
    # As long as there is room: stretches of 1e-9 s and less are left between zones.
    (run,) = executed(build_program([made]), controller=Controller(corner=1.0))
    assert np.diff(run.tool_motion.borders).min() < 1e-6
    at_nodes = made.criteria.peak_acceleration.max()
    assert run.peak_acceleration.share == pytest.approx(at_nodes, rel=0.05)
    assert run.acceleration_bound == pytest.approx(run.peak_acceleration.share, rel=0.03)


def test_it_is_known_when_a_run_was_planned_to_be_where_it_is(made):
    run = run_of(made)
    # Chords of a circle are shorter than their arcs.
    assert run.tool_motion.time[-1] < made.time[-1] * (1 - 1e-4)
    at_targets = np.interp(run.tool_motion.time, run.time, run.planned)[1:-1]
    # Interpolated over the corners that it has at the targets.
    np.testing.assert_allclose(at_targets, made.time[1:-1], rtol=0, atol=1e-4 * made.time[1])


def test_the_peak_says_the_joint_and_when(made):
    run = run_of(made, zone=0.001)
    share, joint, time = run.peak_acceleration
    m = int(np.argmin(np.abs(run.time - time)))
    assert abs(run.acceleration_share[m, joint]) == share == np.abs(run.acceleration_share).max()
    assert 0 < time < made.time[-1]


def test_the_tip_passes_nodes_by_no_more_than_is_allowed(made):
    assert 0 < run_of(made, zone_error=2e-5).missed <= 2e-5 * (1 + 1e-9)
    assert run_of(made, zone_error=2e-5).missed < run_of(made).missed <= 1e-4


def test_stops_leave_nothing_to_round(made):
    assert executed(build_program([made], zone=0.0)) == ()
