"""Moves too short for the controller are merged within a tolerance; what remains is reported."""

from dataclasses import replace

import numpy as np
import pytest
from tests.post.cases import ARMS

from kerfpath import Contour, robot
from kerfpath.execution import executed
from kerfpath.post import (
    STRETCHED,
    Controller,
    LinearMove,
    build_program,
    deviations,
    language,
    may_replace,
    post,
    preflight,
    read_program,
)
from kerfpath.post.thinning import Thinning
from programs import frames, hand_plan

SPEED = 2 / 60
"""m/s, at which 0.1 mm take 3 ms."""


def straight(count, step=1e-4):
    points = np.c_[step * np.arange(count), np.zeros((count, 2))]
    return Contour(points, np.tile([0.0, 0.0, -1.0], (count, 1)), name="straight")


def round_(count, radius, step=1e-4):
    angle = step / radius * np.arange(count)
    points = radius * np.c_[np.sin(angle), 1 - np.cos(angle), 0 * angle]
    axes = np.tile([0.0, 0.0, -1.0], (count, 1))
    return Contour(points, axes, x=np.tile([1.0, 0.0, 0.0], (count, 1)), name="round")


def planned(name, contour, speed=SPEED):
    arm, place = ARMS[name]
    tool, placement = frames()
    placement[:3, 3] = place
    return hand_plan(contour, robot(arm), tool, placement, speed=speed)


def inner(program):
    """The moves of the cut, from its second node on."""
    return [m for m in program.moves if isinstance(m, LinearMove)][1:-1]


def settings_of(name, **given):
    return language(name).settings(laser_output="x1" if name in ("rapid", "val3") else 1, **given)


def test_times_are_rounded_up_to_the_shortest_and_to_whole_cycles():
    time = np.array([0.001, 0.012, 0.016, 0.0161, 0.030])
    fanuc = Controller(shortest=0.016, cycle=0.008)
    np.testing.assert_allclose(
        time * (1 + fanuc.stretch(time)), [0.016, 0.016, 0.016, 0.024, 0.032]
    )
    np.testing.assert_allclose(
        time * (1 + Controller(shortest=0.012).stretch(time)), np.maximum(time, 0.012)
    )
    assert not Controller().stretch(time).any()
    # 600 moves of 100 ms ran 62.5 s on a controller with a cycle of 8 ms.
    assert 600 * 0.1 * (1 + fanuc.stretch(np.array([0.1]))[0]) == pytest.approx(62.4)


@pytest.mark.parametrize("name", ARMS)
def test_straight_cuts_keep_the_shortest_move_and_their_time(name):
    plan = planned(name, straight(301))
    program = build_program([plan], language=name)
    took = np.array([move.duration for move in inner(program)])
    controller = language(name).controller()
    assert (controller.stretch(took) <= STRETCHED).all()
    assert len(took) > 0.5 * 0.9 / max(controller.shortest, controller.cycle)
    assert took.sum() == pytest.approx(plan.time[-1])
    assert sum(m.duration * m.speed for m in inner(program)) == pytest.approx(0.03)
    assert "cycle-as-run" not in [issue.code for issue in preflight(program, name)]
    options = settings_of(name)
    read = read_program(post(program, name, options), name, program.robot, options)
    assert deviations(program, read, language(name), options) == []


@pytest.mark.parametrize("tolerance", [5e-6, 2e-5])
@pytest.mark.parametrize("radius", [1e-3, 5e-3, 50e-3])
def test_every_node_left_out_is_near_the_move_in_its_place(radius, tolerance):
    plan = planned("rapid", round_(120, radius))
    program = build_program([plan], thin_tolerance=tolerance)
    points = plan.contour.points
    ends = np.array([points[0], *(move.T_part_tip[:3, 3] for move in inner(program))])
    starts, chords = ends[:-1], np.diff(ends, axis=0)
    share = ((points[:, None] - starts) * chords).sum(-1) / (chords**2).sum(-1)
    on = starts + np.clip(share, 0, 1)[..., None] * chords
    off = np.linalg.norm(points[:, None] - on, axis=-1).min(axis=1)
    assert off.max() <= tolerance
    # A chord of a circle is that far from it: no longer one is possible.
    longest = max(np.linalg.norm(chords, axis=1))
    assert longest <= np.sqrt(8 * radius * tolerance) * 1.01


def by_trying(took, feasible, controller):
    """The least time of moves over the intervals, and the most targets with it, by all ways."""
    best = {0: (0.0, 0)}
    for j in range(1, len(took) + 1):
        found = []
        for i in range(j):
            time = took[i:j].sum()
            if j - i == 1 or feasible(i, j):
                longer = time * (1 + controller.stretch(np.array([time]))[0])
                found.append((best[i][0] + longer, best[i][1] - 1))
        best[j] = min(found, key=lambda each: (round(each[0], 9), each[1]))
    return best[len(took)]


@pytest.mark.parametrize("name", ["rapid", "fanuc"])
@pytest.mark.parametrize("radius", [2e-3, 6e-3, 1.0])
def test_no_choice_of_targets_takes_less_time(name, radius):
    plan = planned(name, round_(60, radius))
    program = build_program([plan], language=name)
    controller = language(name).controller()
    took = np.array([move.duration for move in inner(program)])
    time = (took * (1 + controller.stretch(took))).sum()
    points, at = plan.contour.points, np.diff(plan.time)
    q = plan.unwrapped

    def feasible(i, j):
        share = ((plan.time[i:j] - plan.time[i]) / (plan.time[j] - plan.time[i]))[:, None]
        tip = points[i] + share * (points[j] - points[i]) - points[i:j]
        joints = q[i] + share * (q[j] - q[i]) - q[i:j]
        near = np.linalg.norm(tip, axis=1).max() <= 2e-5
        return near and np.abs(joints).max() <= np.radians(0.2)

    least, most = by_trying(at, feasible, controller)
    assert time == pytest.approx(least, abs=1e-6)
    assert len(took) == -most


def test_switches_and_stops_keep_their_targets():
    kinds = np.zeros(61, dtype=np.int64)
    kinds[20:35] = 3  # micro joint
    plan = planned("rapid", replace(straight(61), kind=kinds))
    moves = inner(build_program([plan]))
    switched = [move.T_part_tip[0, 3] for move in moves if move.switches]
    np.testing.assert_allclose(switched, [2e-3, 3.5e-3, 6e-3], atol=1e-9)
    everywhere = build_program([plan], zone=0)
    assert len(inner(everywhere)) == 60


def test_nothing_is_left_out_without_need():
    plan = planned("rapid", straight(31, step=1e-3))
    assert len(inner(build_program([plan]))) == 30
    assert len(inner(build_program([planned("rapid", straight(301))], thin_tolerance=0))) == 300


@pytest.mark.parametrize("name", ARMS)
def test_what_is_still_too_short_is_a_warning_or_by_the_setting_an_error(name):
    program = build_program([planned(name, straight(301))], language=name, thin_tolerance=0)
    (issue,) = [i for i in preflight(program, name, settings_of(name)) if i.code == "cycle-as-run"]
    assert issue.level == "warning"
    assert issue.place.startswith("straight, move ")
    for words in ("300 of 302 moves", "x, y, z = ", "lasts 3 ms", "spacing_mm or thin_mm"):
        assert words in issue.message
    given = settings_of(name, shortest_move_ms=10.0)
    (issue,) = [i for i in preflight(program, name, given) if i.code == "cycle-as-run"]
    assert issue.level == "error"
    free = settings_of(name, shortest_move_ms=0.0)
    if name == "fanuc":
        free = free.model_copy(update={"interpolation_ms": 0.0})
    assert "cycle-as-run" not in [i.code for i in preflight(program, name, free)]


def test_the_model_takes_the_cycle_into_account():
    plan = planned("fanuc", straight(101, step=5e-4))
    plan = replace(plan, robot=plan.robot.with_limits(acceleration=np.full(6, 20.0)))
    program = build_program([plan], thin_tolerance=0)
    (run,) = executed(program, controller=language("fanuc").controller())
    np.testing.assert_allclose(run.tool_motion.duration, 0.016)  # of 15 ms
    np.testing.assert_allclose(run.tool_motion.stretch, 1 / 15)


def test_an_edit_may_leave_out_nodes_only_where_moves_are_too_short():
    controller = Controller(shortest=0.024)
    assert may_replace(controller, 0.003, 20)
    assert not may_replace(controller, 0.003, 30)
    assert not may_replace(controller, 0.030, 2)
    assert not may_replace(Controller(), 0.001, 2)


@pytest.mark.parametrize("bent", [40, 41])
def test_targets_where_the_path_bends_least_are_left_out(bent):
    # 101 moves become 49 of two and one of three: where that one is decides which targets remain.
    points = straight(102).points.copy()
    points[bent, 1] = 5e-6
    axes = np.tile([0.0, 0.0, -1.0], (102, 1))
    x = np.tile([1.0, 0.0, 0.0], (102, 1))
    plan = planned("rapid", Contour(points, axes, x=x, name="bent"))
    program = build_program([plan], zone=1e-4, language="none")
    thinning = Thinning(
        controller=Controller(shortest=0.005), tolerance=1e-5, zone=1e-4, zone_error=1e-5
    )
    moves = inner(thinning.of(program))
    assert len(moves) == 50
    corner = inner(program)[bent - 1].T_part_tip
    assert any((move.T_part_tip == corner).all() for move in moves)
