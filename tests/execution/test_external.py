"""Rails and tables between the targets: against the held arm, another kinematics, dense samples."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.post.external_cells import CELLS, ExternalCase, moving_plan, with_axes

from conftest import pose
from kerfpath import robot
from kerfpath.auditor import chain_of
from kerfpath.execution import executed, from_stop_to_stop, keep, keep_limits, run_along, timing_of
from kerfpath.post import Controller, LinearMove, build_program, with_tips
from programs import arc

ARM = robot("abb_irb4600_60_205").with_limits(
    acceleration=np.radians([320, 270, 420, 1300, 1400, 2000])
)
C = np.sqrt(0.5)
TOOL = pose([0.15, 0, 0.30], [[C, 0, C], [0, 1, 0], [-C, 0, C]])
PLACED = pose([1.2, 0.1, 0.4])
COUNT = 41
RADIUS = 0.0871
"""m, of the arc."""
NARROW = 0.001
"""m: zones beside which the moves stay straight on most of their way."""
HOW = list(zip(CELLS, ("auto", NARROW, NARROW, "auto"), strict=True))


def made(cell, courses, speed=0.1):
    """A plan whose external axes go along courses of an angle, (COUNT,) rad, to values (E,)."""
    axes = with_axes(ARM, CELLS[cell], PLACED[:3, 3] + [0.03, 0.02, -0.05])
    values = courses(np.linspace(0, 2, COUNT)[:, None], np.arange(1.0, len(CELLS[cell]) + 1))
    return moving_plan(arc(count=COUNT), axes, TOOL, PLACED, values, speed)


def waves(t, k):
    return 0.2 * np.sin(t + k) + 0.1 * k


@cache
def moving(cell):
    return made(cell, waves)


@cache
def run_of(cell, zone="auto", orientation="slerp"):
    (run,) = executed(
        build_program([moving(cell)], zone=zone), controller=Controller(orientation=orientation)
    )
    return run


def joints_at(run, plan, time):
    """The joints (m, n) at times (m,) by the arm as it stands: one pose after the other."""
    x = values_at(run, plan, time)
    poses = plan.T_base_part @ run.tool_motion.poses(time) @ np.linalg.inv(plan.T_flange_tip)
    near = np.stack([np.interp(time, run.time, joint) for joint in run.q.T], axis=1)
    q = [
        plan.robot.held(at).arm.nearest(T[None], q[None, :6])[0]
        for at, T, q in zip(x, poses, near, strict=True)
    ]
    return np.hstack([q, x])


def values_at(run, plan, time):
    """The external values at times: piecewise linear, in zones averaged over as long as they last.

    The average of a bent line over a window of its zone's length about the time is a parabola
    that is tangent to it at both ends.
    """
    motion, found = run.tool_motion, []
    bend = np.abs(time[:, None] - motion.time).argmin(axis=1)
    corner, half = motion.time[bend], motion.half[bend]
    inside = np.abs(time - corner) < half
    half = np.where(inside, half, 1.0)
    for values in plan.q[:, 6:].T:
        start, end = (np.interp(time + by * half, motion.time, values) for by in (-1, 1))
        first = (start + values[bend]) / 2 * (corner - time + half)
        second = (values[bend] + end) / 2 * (time + half - corner)
        plain = np.interp(time, motion.time, values)
        found.append(np.where(inside, (first + second) / (2 * half), plain))
    return np.stack(found, axis=1)


@pytest.mark.parametrize("orientation", ["slerp", "two-angle", "wrist"])
@pytest.mark.parametrize("cell", ["turn-tilt", "rail+table"])
def test_axes_that_stand_still_leave_the_motion_of_the_held_arm(cell, orientation):
    still = made(cell, lambda t, k: 0.1 * k + 0 * t)
    x = still.q[0, 6:]
    held = replace(
        still, robot=still.robot.held(x), q=still.q[:, :6], turn=still.turn[:, :6],
        settings=replace(still.settings, weights=np.ones(6)),
    )  # fmt: skip
    ours, alone = (
        executed(build_program([each]), controller=Controller(orientation=orientation))[0]
        for each in (still, held)
    )
    np.testing.assert_array_equal(ours.time, alone.time)
    np.testing.assert_allclose(ours.q[:, :6], alone.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.q[:, 6:], np.tile(x, (len(ours.q), 1)), rtol=0, atol=1e-15)
    np.testing.assert_allclose(ours.T, alone.T, rtol=0, atol=1e-12)
    # 1e-15 rad of rounding over steps of 1e-4 s, of which the second difference is 1e-7 rad/s^2.
    for name in ("velocity_share", "acceleration_share"):
        one, other = getattr(ours, name), getattr(alone, name)
        np.testing.assert_allclose(one[:, :6], other, rtol=0, atol=1e-5)
        np.testing.assert_allclose(one[:, 6:], 0, rtol=0, atol=1e-5)
    assert timing_of(ours).seconds == pytest.approx(timing_of(alone).seconds, rel=1e-6)
    if orientation == "wrist":
        assert ours.sampled == alone.sampled != ""
    else:
        # Both proofs end within 2 % of what is seen.
        assert ours.velocity_bound == pytest.approx(alone.velocity_bound, rel=0.02)
        assert ours.acceleration_bound == pytest.approx(alone.acceleration_bound, rel=0.02)


@pytest.mark.parametrize(("cell", "zone"), HOW)
def test_axes_go_evenly_and_the_tip_straight_in_the_part_by_another_kinematics(cell, zone):
    plan, run = moving(cell), run_of(cell, zone)
    np.testing.assert_allclose(run.q[:, 6:], values_at(run, plan, run.time), rtol=0, atol=1e-12)
    assert (np.ptp(run.q[:, 6:], axis=0) > 0.05).all()
    # The audit's chain of joint frames, axes and all, shares nothing with the inverse kinematics.
    seen = chain_of(plan.robot).forward(run.q) @ plan.T_flange_tip
    np.testing.assert_allclose(seen, plan.T_base_part @ run.T, rtol=0, atol=1e-9)
    motion = run.tool_motion
    k = np.clip(np.searchsorted(motion.time, run.time) - 1, 0, COUNT - 2)
    own = np.minimum(run.time - motion.time[k], motion.time[k + 1] - run.time)
    straight = own > np.maximum(motion.half[k], motion.half[k + 1])
    assert straight.sum() >= COUNT
    start, end = motion.T[k, :3, 3], motion.T[k + 1, :3, 3]
    share = (run.time - motion.time[k]) / motion.duration[k]
    on = start + share[:, None] * (end - start)
    np.testing.assert_allclose(run.T[straight, :3, 3], on[straight], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("cell", "zone"), HOW)
def test_the_joints_turn_smoothly_through_every_border_of_a_zone(cell, zone):
    plan, run = moving(cell), run_of(cell, zone)
    d, inner = 1e-6, run.tool_motion.borders[1:-1]
    before, here, after = (joints_at(run, plan, inner + by) for by in (-d, 0.0, d))
    velocity, acceleration = plan.robot.speed_limits()
    most = run.acceleration_bound * acceleration
    # What the rates differ by over 1e-6 s is the acceleration; 1e-14 rad of rounding over it.
    jump = np.abs((after - here) - (here - before)) / d
    assert (jump <= most * d * 1.01 + 1e-7 * velocity).all()


@pytest.mark.slow
@pytest.mark.parametrize(("cell", "zone"), HOW)
def test_the_peaks_are_those_of_dense_differences_and_below_the_bounds(cell, zone):
    plan, run = moving(cell), run_of(cell, zone)
    borders = run.tool_motion.borders
    long = np.diff(borders)
    shares = np.linspace(0.01, 0.99, 9)
    time = (borders[:-1, None] + long[:, None] * shares).ravel()
    d = np.repeat(0.005 * long, len(shares))
    before, here, after = (joints_at(run, plan, time + by * d) for by in (-1, 0, 1))
    velocity, acceleration = plan.robot.speed_limits()
    fast = np.abs((after - before) / (2 * d[:, None]) / velocity)
    sharp = np.abs((after - 2 * here + before) / d[:, None] ** 2 / acceleration)
    # Between the three samples of a stretch a little more may lie.
    assert 0.97 * fast.max() <= run.peak_velocity.share <= fast.max() * 1.01
    assert 0.97 * sharp.max() <= run.peak_acceleration.share <= sharp.max() * 1.01
    # 1e-14 rad of rounding in a second difference over 2e-5 s.
    assert fast.max() <= run.velocity_bound * (1 + 1e-6)
    assert sharp.max() <= run.acceleration_bound * (1 + 1e-4)
    assert run.velocity_bound <= 1.02 * fast.max()
    assert run.acceleration_bound <= 1.02 * sharp.max()


def test_under_a_tip_that_stands_the_table_turns_the_part():
    robot = ARM.with_positioner(
        [0, 0, 1], PLACED[:3, 3], lower=-9, upper=9, velocity=4.0, acceleration=20.0
    )
    circle = arc(count=COUNT)
    flat = replace(circle, points=circle.points * [1, 1, 0], axes=np.tile([0, 0, -1], (COUNT, 1)))
    angle = np.unwrap(np.arctan2(flat.points[:, 1], flat.points[:, 0]))
    plan = moving_plan(flat, robot, TOOL, PLACED, -angle[:, None], 0.05)
    (run,) = executed(build_program([plan], zone=0.0005))
    tip = (robot.alone().forward(run.q[:, :6]) @ TOOL)[:, :3, 3]
    # It goes along chords in the part, that are off their arcs by a few hundredths of a mm.
    chord = np.linalg.norm(np.diff(flat.points, axis=0), axis=1).max()
    assert np.linalg.norm(tip - tip.mean(axis=0), axis=1).max() < 1.5 * chord**2 / (8 * RADIUS)
    turned = np.linalg.norm(run.T[-1, :3, 3] - run.T[0, :3, 3])
    assert turned > RADIUS
    assert run.velocity_share[:, 6] == pytest.approx(-0.05 / RADIUS / 4.0, rel=0.01)


@pytest.mark.slow
def test_what_axes_need_between_the_nodes_is_brought_within_the_limits():
    plan = moving("rail+table")
    sharp = np.abs(run_of("rail+table").acceleration_share).max(axis=0)
    _, acceleration = plan.robot.speed_limits()
    nodes = np.abs(plan.acceleration_share).max(axis=0)
    assert (sharp > nodes)[6:].all()
    # A robot that can just do at the nodes what each joint has to do there.
    tight = replace(plan, robot=plan.robot.with_limits(acceleration=acceleration * nodes * 1.0001))
    before = executed(build_program([tight]))[0]
    assert before.peak_acceleration.share > 1.001
    kept = keep_limits(tight)
    assert kept.done, kept.statement
    assert kept.rounds > 0
    assert max(kept.run.velocity_bound, kept.run.acceleration_bound) <= 1
    assert np.abs(kept.plan.external - tight.external).max() > 1e-5
    np.testing.assert_array_equal(kept.plan.time, tight.time)


def test_an_axis_that_needs_too_much_is_named(monkeypatch):
    monkeypatch.setattr(keep, "ROUNDS", 1)  # the words are those of ten
    plan = made("rail+table", waves, speed=0.04)
    _, acceleration = plan.robot.speed_limits()
    needed = acceleration * np.abs(plan.acceleration_share).max(axis=0)
    # The arm has room to spare, the axes have none; zones are next to nothing.
    room = np.append(np.full(6, 3.0), [1.01, 1.02])
    tight = replace(plan, robot=plan.robot.with_limits(acceleration=needed * room))
    kept = keep_limits(tight, lambda one: build_program([one], zone_error=1e-7))
    assert not kept.done
    worst = max(("rail", "turn"), key=lambda name: peak_of(kept.run, name, plan.robot))
    assert f"between the nodes {worst} needs" in kept.statement


def peak_of(run, name, robot):
    return np.abs(run.acceleration_share[:, robot.joint_names.index(name)]).max()


@pytest.mark.parametrize("language", ["rapid", "krl"])
@pytest.mark.parametrize("cell", ["turn-tilt", "rail+table"])
def test_a_program_read_back_runs_as_the_one_that_was_written(cell, language):
    case = ExternalCase(cell, language)
    program = build_program([case.plan(COUNT)])
    read = with_tips(
        case.read(case.files(program)), program.robot, program.T_flange_tip, program.T_base_part
    )
    moves = [
        replace(
            ours,
            T_part_tip=back.T_part_tip,
            q=np.append(ours.q[:6], back.external_of(read.externals)),
            speed=back.speed,
            zone=back.zone,
        )
        for ours, back in zip(program.moves, read.moves, strict=True)
        if isinstance(ours, LinearMove)
    ]
    (run,), (again,) = (
        [
            run_along(
                part, program.robot, T_base_part=program.T_base_part,
                T_flange_tip=program.T_flange_tip,
            )
            for part in from_stop_to_stop(each)
        ]
        for each in (program.sections[0].moves, moves)
    )  # fmt: skip
    # Speeds are said in um/s, positions to a tenth of a um: 0.2 um over an interval of 0.07 s.
    assert again.tool_motion.time[-1] == pytest.approx(run.tool_motion.time[-1], rel=1e-4)
    for name in ("peak_velocity", "peak_acceleration"):
        assert getattr(again, name).share == pytest.approx(getattr(run, name).share, rel=0.01)
    assert again.acceleration_bound == pytest.approx(run.acceleration_bound, rel=0.03)
