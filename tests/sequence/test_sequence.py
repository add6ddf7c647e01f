"""Order of cutting and transfer moves."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations, product
from time import monotonic

import numpy as np
import pytest

import kerfpath
from kerfpath import Contour, InputError, NoFeasiblePath, Plan, plan
from kerfpath.auditor import transfer_checks
from kerfpath.cell import box_between, cell_of
from kerfpath.effort import current_effort
from kerfpath.operations import start_at
from kerfpath.post import JointMove, build_program, post, preflight
from kerfpath.sequence import (
    PlannedCuts,
    best_order,
    cheapest_posture,
    common_postures,
    effort_for,
    inner_first,
    longest_search,
    order_candidates,
    order_plans,
    plan_part,
)
from kerfpath.sequence.part import MANY, SOME, WORTH
from kerfpath.transfer import back_off, least_time, on_near_turns, transfer_move
from programs import read_text, text_of

STEP = np.radians(10)


def every_order(group, own, between, first, last, before, rest=None):
    """The least time over all orders and candidates, one by one."""
    G = group.max() + 1
    best, rest = np.inf, np.zeros((G, G)) if rest is None else rest
    for groups in permutations(range(G)):
        place = {g: k for k, g in enumerate(groups)}
        if any(place[g] >= place[h] for g, h in before):
            continue
        for chosen in product(*(np.flatnonzero(group == g) for g in groups)):
            c = np.array(chosen)
            time = first[c[0]] + own[c].sum() + between[c[:-1], c[1:]].sum() + last[c[-1]]
            if time < best and all(
                own[c[i + 1 : j]].sum() + between[c[i:j], c[i + 1 : j + 1]].sum()
                >= rest[groups[i], groups[j]]
                for i, j in combinations(range(G), 2)
            ):
                best = time
    return best


@pytest.mark.parametrize("seed", range(12))
def test_the_order_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    G = int(rng.integers(1, 6))
    group = np.concatenate([np.arange(G), rng.integers(0, G, rng.integers(0, 4))])
    C = len(group)
    own, first, last = rng.random((3, C))
    between = rng.random((C, C))
    between[rng.random((C, C)) < 0.15] = np.inf
    before = [(g, g + 1) for g in range(G - 1) if rng.random() < 0.4]
    best = every_order(group, own, between, first, last, before)
    if np.isinf(best):
        with pytest.raises(NoFeasiblePath) as none:
            best_order(group, own, between, first=first, last=last, before=before)
        assert none.value.proved
        return
    found = best_order(group, own, between, first=first, last=last, before=before)
    # The solver counts in ticks of 0.1 ms, one rounding for each candidate and move.
    assert found.duration == pytest.approx(best, abs=1e-4 * (2 * G + 2))
    assert found.optimal
    assert sorted(group[found.candidates]) == list(range(G))


@pytest.mark.parametrize("seed", range(12))
def test_the_order_with_rests_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    G = int(rng.integers(3, 6))
    group = np.concatenate([np.arange(G), rng.integers(0, G, rng.integers(0, 4))])
    C = len(group)
    own, first, last = rng.random((3, C))
    between = rng.random((C, C))
    before = [(0, 1)] if seed % 3 == 0 else []
    rest = np.triu(np.where(rng.random((G, G)) < 0.4, rng.uniform(0.5, 2.5, (G, G)), 0.0), 1)
    asked = {"first": first, "last": last, "before": before, "rest": rest + rest.T}
    best = every_order(group, own, between, first, last, before, rest + rest.T)
    if np.isinf(best):
        with pytest.raises(NoFeasiblePath, match="time between near ones") as none:
            best_order(group, own, between, **asked)
        assert none.value.proved
        return
    found = best_order(group, own, between, **asked)
    # The solver counts in ticks of 0.1 ms, one rounding for each candidate and move; a rest may be
    # short by less, and of random times none decides by so little.
    assert found.duration == pytest.approx(best, abs=1e-4 * (2 * G + 2))
    assert found.optimal


@pytest.mark.parametrize("seed", range(3))
def test_many_groups_get_their_rest_even_in_no_time(seed):
    rng = np.random.default_rng(seed)
    place = rng.uniform(0, 1, (40, 2))
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    rest = np.where((apart < 0.15) & (apart > 0), 2.0, 0.0)
    own = np.full(40, 0.5)
    for seconds in (1e-6, 3.0):
        found = best_order(np.arange(40), own, apart, rest=rest, seconds=seconds)
        c = found.candidates
        end = np.cumsum(own[c] + np.append(0.0, apart[c[:-1], c[1:]]))
        gap = (end - own[c])[None] - end[:, None]
        assert np.triu(rest[np.ix_(c, c)] - gap, 1).max() < 1e-4  # 82 roundings of 1 us
        assert found.at_least <= found.duration


def test_orders_that_contradict_are_refused_and_shapes_too():
    with pytest.raises(NoFeasiblePath, match="contradict"):
        best_order([0, 1], [0, 0], np.zeros((2, 2)), before=[(0, 1), (1, 0)])
    with pytest.raises(InputError, match="every number from 0 to 2"):
        best_order([0, 2], [0, 0], np.zeros((2, 2)))
    with pytest.raises(InputError, match="times >= 0"):
        best_order([0, 1], [0, 0], np.full((2, 2), -1.0))
    for wrong in ([[0, 1], [2, 0]], [[1, 0], [0, 0]], [[0, -1], [-1, 0]]):
        with pytest.raises(InputError, match="rest: expected times"):
            best_order([0, 1], [0, 0], np.zeros((2, 2)), rest=wrong)


def test_least_time_is_that_of_a_trapezoid():
    v, a = np.array([1.0, 2.0]), np.array([4.0, 1.0])
    # 3 rad at 1 rad/s, a quarter of a second to gain it; 0.5 rad never gains 2 rad/s.
    assert least_time([[3.0, 0.0]], v, a)[0] == pytest.approx(3.25)
    assert least_time([[0.0, 0.5]], v, a)[0] == pytest.approx(2 * np.sqrt(0.5))
    assert least_time([[0.0, 0.0]], v, a)[0] == 0
    # Along a straight motion no joint can do better than alone.
    rng = np.random.default_rng(0)
    dq = rng.normal(size=(50, 2))
    alone = np.max([least_time(dq * keep, v, a) for keep in np.eye(2)], axis=0)
    assert (least_time(dq, v, a) >= alone - 1e-12).all()


@pytest.fixture(scope="module")
def ring():
    t = -np.linspace(0, 2 * np.pi, 60)[:-1]
    points = np.c_[0.03 * np.cos(t), 0.03 * np.sin(t), 0 * t]
    return Contour(points, np.tile([0, 0, -1.0], (59, 1)), closed=True, name="ring")


def moved(contour, x, y, name):
    return Contour(contour.points + np.array([x, y, 0]), contour.axes, closed=True, name=name)


def test_a_move_goes_straight_where_it_is_clear_and_around_where_not(arm, tool):
    q0, q1 = np.radians([[-30, 10, 10, 0, 60, 0], [30, 10, 10, 0, 60, 0]])
    free = transfer_move(arm, q0, q1, cell=cell_of(arm, tool=tool))
    assert len(free.q) == 2
    assert free.clear
    assert not transfer_move(arm, q0, q1).clear
    tip = (arm.forward((q0 + q1) / 2) @ tool)[:3, 3]
    post = box_between([tip[0] - 0.02, -0.02, -0.5], [tip[0] + 0.02, 0.02, tip[2] + 0.1])
    cell = cell_of(arm, tool=tool, fixtures={"post": post})
    assert cell.clear([q0, q1]).all()
    assert not cell.clear_motion([q0], [q1])[0]
    around = transfer_move(arm, q0, q1, cell=cell)
    assert len(around.q) > 2
    assert cell.clear_motion(around.q[:-1], around.q[1:]).all()
    assert around.duration > free.duration
    np.testing.assert_array_equal(around.q[[0, -1]], [q0, q1])
    again = transfer_move(arm, q0, q1, cell=cell)
    np.testing.assert_array_equal(again.q, around.q)


def test_a_move_from_within_a_fixture_says_which(arm, tool):
    q0, q1 = np.radians([[0, 10, 10, 0, 60, 0], [30, 10, 10, 0, 60, 0]])
    tip = (arm.forward(q0) @ tool)[:3, 3]
    block = box_between(tip - 0.05, tip + 0.05)
    cell = cell_of(arm, tool=tool, fixtures={"block": block})
    with pytest.raises(NoFeasiblePath, match=r"start .* not clear: .*'block'") as none:
        transfer_move(arm, q0, q1, cell=cell)
    assert none.value.proved


def test_inner_contours_come_first(ring):
    big = Contour(3 * ring.points, ring.axes, closed=True, name="trim")
    beside = moved(ring, 0.3, 0, "beside")
    assert inner_first([big, ring, beside]) == [(1, 0)]
    below = Contour(ring.points, -ring.axes, closed=True)
    assert inner_first([big, below]) == []


@pytest.fixture(scope="module")
def part(ring):
    places = [(0.0, 0.0), (0.2, 0.0), (0.0, 0.2), (0.2, 0.2)]
    return [moved(ring, x, y, f"hole {i}") for i, (x, y) in enumerate(places)]


def rest(contour):
    return contour.resample(count=20)


def test_a_part_is_cut_in_less_time_than_in_the_order_given(part, arm, tool, placement):
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    starts = [
        [rest(start_at(c, s)) for s in np.linspace(0, c.length, 3, endpoint=False)] for c in part
    ]
    given = plan_part([s[0] for s in starts[::2] + starts[1::2]], arm, given_order=True, **asked)
    free = plan_part(starts, arm, pierce_time=0.3, **asked)
    assert free.order.optimal
    assert [free.plans[k].name for k in range(4)] == [part[i].name for i, _ in free.chosen]
    assert free.air_time < given.air_time
    assert free.piercing_time == pytest.approx(1.2)
    assert free.cycle_time == pytest.approx(free.cutting_time + free.air_time + free.piercing_time)
    assert {p.name for p in free.plans} == {c.name for c in part}
    # Each move begins and ends where its contours back off to.
    for k, move in enumerate(free.moves):
        before, after = free.plans[k : k + 2]
        np.testing.assert_allclose(move.q[0], back_off(before, "end", 0.05), atol=1e-9)
        np.testing.assert_allclose(move.q[-1], back_off(after, "start", 0.05), atol=1e-9)


def test_each_contour_has_its_own_time_to_pierce(part, arm, tool, placement):
    """The times go with the contours into the order, and are those of the contours between."""
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    rested, times = [rest(c) for c in part], (0.1, 0.2, 0.4, 0.8)
    own = plan_part(rested, arm, pierce_time=times, **asked)
    same = plan_part(rested, arm, pierce_time=0.2, **asked)
    assert own.piercing_time == pytest.approx(1.5)
    assert [own.pierce_time[k] for k in range(4)] == [times[i] for i, _ in own.chosen]
    assert own.order.duration == pytest.approx(own.cycle_time, abs=1e-3)
    assert own.chosen == same.chosen
    between = own.rests[0, 3] - same.rests[0, 3]
    assert between == pytest.approx(sum(own.pierce_time[1:3]) - 0.4)


@pytest.mark.slow
def test_a_part_in_one_posture_never_takes_less_time_than_the_free_one(part, arm, tool, placement):
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    home = np.radians([0, -20, 10, 0, 60, 0])
    rested, kept = [rest(c) for c in part], 0
    free = plan_part(rested, arm, home=home, **asked)
    for posture in range(arm.postures):
        try:
            one = plan_part(rested, arm, home=home, postures=(posture,), **asked)
        except NoFeasiblePath:
            continue
        kept += 1
        # The solver counts in ticks of 0.1 ms, one rounding for each candidate and move.
        assert free.cycle_time <= one.cycle_time + 1e-3
    assert kept > 1


def test_postures_are_common_that_half_of_the_contours_can_have():
    served = [[0, 1], [0, 2], [0, 1], [3]]
    assert common_postures(served, [None] * 4, [[0]] * 4) == [[0, 1], [0], [0, 1], []]
    assert common_postures([[0, 1], [0, 1]], [(1,), None], [[0]] * 2) == [[1], [0, 1]]


def test_plans_are_offered_on_the_turns_that_are_near(part, tool, placement):
    arm = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    wide = arm.with_limits(lower=np.full(6, -2 * np.pi), upper=np.full(6, 2 * np.pi))
    made = plan(
        rest(part[0]), arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP, certify=None
    )
    q, turn = made.q.copy(), made.turn.copy()
    up = -np.sign(q[:, 5].mean())  # away from the limit that is nearer
    q[:, 5] += up * 2 * np.pi
    away = replace(made, robot=wide, q=q, turn=turn + up.astype(int) * np.eye(6, dtype=int)[5])
    assert (np.abs(q) < 2 * np.pi).all()
    near = on_near_turns(away, None)
    assert len(near) == 2
    assert near[0] is away
    np.testing.assert_allclose(near[1].q, made.q, atol=1e-12)
    np.testing.assert_array_equal(near[1].turn, made.turn)
    assert len(on_near_turns(replace(made, robot=wide), None, made.q[0])) == 1


@pytest.mark.parametrize("home", [None, np.radians([0, -20, 10, 0, 60, 0])])
def test_moves_of_open_cuts_run_from_the_end_of_each_to_the_start_of_the_next(
    arm, tool, placement, home
):
    x, zero = np.linspace(0, 0.06, 16), np.zeros(16)
    lines = [
        Contour(np.c_[x, zero + y, zero], np.tile([0, 0, -1.0], (16, 1)), closed=False, name=name)
        for name, y in (("near", 0.0), ("middle", 0.05), ("far", 0.1))
    ]
    asked = {"tool": tool, "placement": placement, "speed": 0.05, "gamma_step": STEP}
    cut = plan_part(lines, arm, home=home, retract=0.02, **asked)
    ends = [back_off(p, "end", 0.02) for p in cut.plans]
    starts = [back_off(p, "start", 0.02) for p in cut.plans]
    if home is None:
        starts, ends = starts[1:], ends[:-1]
    else:
        starts, ends = [*starts, home], [home, *ends]
    assert len(cut.moves) == len(starts)
    for move, end, start in zip(cut.moves, ends, starts, strict=True):
        np.testing.assert_allclose(move.q[0], end, atol=1e-9)
        if start is home:  # endless joints come home on any turn
            np.testing.assert_allclose(np.exp(1j * move.q[-1]), np.exp(1j * home), atol=1e-9)
        else:
            np.testing.assert_allclose(move.q[-1], start, atol=1e-9)
    build_program(cut.plans, moves=cut.moves, retract=0.02)


def test_home_heat_and_precedence_are_kept(part, arm, tool, placement):
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    home = np.radians([0, -20, 10, 0, 60, 0])
    cut = plan_part([rest(c) for c in part], arm, home=home, before=[(3, 0)], **asked)
    names = [p.name for p in cut.plans]
    assert names.index("hole 3") < names.index("hole 0")
    assert len(cut.moves) == 5
    np.testing.assert_array_equal(cut.moves[0].q[0], home)
    # Neighbours are 140 mm apart from rim to rim, diagonals 223 mm: with 150 mm asked for, no
    # order of four corners of a square is left.
    with pytest.raises(NoFeasiblePath, match="no order"):
        plan_part([rest(c) for c in part], arm, heat_spacing=0.15, **asked)
    three = plan_part([rest(c) for c in (part[0], part[3])], arm, heat_spacing=0.15, **asked)
    assert len(three.plans) == 2
    # After a second they may: the others take longer.
    cooled = plan_part([rest(c) for c in part], arm, heat_spacing=0.15, heat_time=1.0, **asked)
    done = [int(p.name.removeprefix("hole ")) for p in cooled.plans]
    for i, j in combinations(range(4), 2):
        if {done[i], done[j]} not in ({0, 3}, {1, 2}):  # across the square
            assert cooled.rests[i, j] >= 1.0 - 1e-2
    with pytest.raises(NoFeasiblePath, match="time between near ones"):
        plan_part([rest(c) for c in part], arm, heat_spacing=0.15, heat_time=1e3, **asked)


@pytest.fixture(scope="module")
def walled(part, arm, tool, placement):
    """The four holes with a wall between them, and the cell; planned from and to a home."""
    at = np.array([p.points.mean(axis=0) for p in part]) @ placement[:3, :3].T + placement[:3, 3]
    middle, top = at.mean(axis=0), at[:, 2].max()
    wall = box_between(middle - [0.3, 0.005, 0.1], [middle[0] + 0.3, middle[1] + 0.005, top + 0.05])
    cell = cell_of(arm, tool=tool, placement=placement, fixtures={"wall": wall})
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    asked["postures"] = (0,)  # in another one, all moves are clear
    home = np.radians([0, -20, 10, 0, 60, 0])
    rested = [rest(c) for c in part]
    return cell, plan_part(rested, arm, home=home, cell=cell, retract=0.01, **asked)


def test_moves_between_contours_go_around_what_stands_there(walled):
    cell, cut = walled
    assert len(cut.moves) == len(cut.plans) + 1
    for move in cut.moves:
        assert move.clear
        assert cell.sweep.clear(move.q[:-1], move.q[1:], cell.required, cell.scene.distances).all()
    assert max(len(move.q) for move in cut.moves) > 2


def test_one_program_for_the_part_says_that_its_air_moves_are_clear(walled):
    _, cut = walled
    program = build_program(cut.plans, moves=cut.moves, retract=0.01, name="part")
    assert [issue for issue in preflight(program) if issue.level == "error"] == []
    assert "air-moves" not in {issue.code for issue in preflight(program)}
    text = text_of(post(program))
    assert "proved clear in the planned cell" in text
    corners = [step.q for step in program.steps if isinstance(step, JointMove)]
    # All corners, for each contour from where it may be begun on; the way home has no such start.
    expected = np.vstack([*(move.q for move in cut.moves[:-1]), cut.moves[-1].q[1:]])
    np.testing.assert_allclose(corners, expected, atol=1e-9)
    assert len(read_text(text, program.robot).sections) == 4
    with pytest.raises(InputError, match="expected 3 moves between 4 plans, or 5"):
        build_program(cut.plans, moves=cut.moves[:2])


def test_the_audit_holds_moves_through_the_air_to_limits_time_and_cell(walled, arm):
    cell, cut = walled
    for move in cut.moves:
        table = transfer_checks(arm, move.q, move.time, cell=cell)
        codes = {"air-time", "air-limits", "collision", "collision-own", "collision-open"}
        assert {check.code for check in table} == codes
        assert all(check.ok for check in table)
    around = max(cut.moves, key=lambda move: len(move.q))
    fast = transfer_checks(arm, around.q, 0.9 * around.time, cell=cell)
    assert [check.code for check in fast if not check.ok] == ["air-time"]
    straight = transfer_checks(arm, around.q[[0, -1]], [0.0, 9.0], cell=cell)
    assert [check.code for check in straight if not check.ok] == ["collision"]
    beyond = around.q.copy()
    beyond[1, 1] = np.radians(170)
    assert "air-limits" in [
        c.code for c in transfer_checks(arm, beyond, 9 * around.time) if not c.ok
    ]


def test_what_contradicts_the_given_order_or_does_not_exist_is_refused(part, arm, tool, placement):
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": STEP}
    two = [rest(c) for c in part[:2]]
    with pytest.raises(NoFeasiblePath, match="contradict"):
        plan_part(two, arm, given_order=True, before=[(1, 0)], **asked)
    with pytest.raises(InputError, match="before: expected pairs of numbers from 0 to 1"):
        plan_part(two, arm, before=[(0, 2)], **asked)
    with pytest.raises(InputError, match="heat_spacing"):
        plan_part(two, arm, heat_spacing=-0.1, **asked)
    with pytest.raises(TypeError, match=r"'gama_step'; the options are .*gamma_step.*retract"):
        plan_part(two, arm, gama_step=0.1, **asked)


def test_a_cut_that_the_tool_cannot_back_off_from_is_infeasible(part, arm, tool, placement):
    with pytest.raises(NoFeasiblePath, match="cannot back off by 2000 mm") as none:
        plan_part(
            [rest(part[0])], arm, tool=tool, placement=placement, speed=0.1, gamma_step=STEP,
            retract=5.0,
        )  # fmt: skip
    assert none.value.proved


def test_a_loop_around_a_tube_has_no_inside(ring):
    around = Contour(ring.points, -ring.points, closed=True, name="cut-off")
    hole = moved(ring, 0, 0, "hole")
    assert inner_first([around, hole]) == []


@pytest.fixture(scope="module")
def lane(arm, tool, ring):
    """Two holes in a lane too narrow to turn in: behind itself the arm stays there, or does not."""
    placement = np.eye(4)
    placement[:3, 3] = 0.9, 0.0, 0.6
    walls = {
        "left": box_between([-1.2, 0.34, -0.2], [1.3, 0.39, 3]),
        "right": box_between([-1.2, -0.39, -0.2], [1.3, -0.34, 3]),
    }
    cell = cell_of(arm, tool=tool, placement=placement, fixtures=walls)
    asked = {"tool": tool, "placement": placement, "speed": 0.05, "gamma_step": np.radians(20)}
    holes = [
        moved(ring, x, y, name).resample(count=16)
        for x, y, name in ((0, 0, "near"), (0.1, 0.05, "far"))
    ]
    ahead, behind = (
        [plan(hole, arm, postures=(posture,), cell=cell, **asked) for hole in holes]
        for posture in (0, 4)
    )
    home = np.radians([0, -20, 10, 0, 60, 0])
    folded = np.array(behind[0].q[0])
    folded[1] -= 0.3
    return holes, cell, asked, ahead, behind, home, folded


def test_where_no_way_is_found_the_contours_the_bodies_and_what_was_tried_are_named(lane):
    _, cell, _, ahead, behind, home, _ = lane
    given = [[behind[0]], [ahead[1]]]
    begun = monotonic()
    with pytest.raises(NoFeasiblePath) as none:
        order_plans(given, home=home, cell=cell, retract=0.01, seconds=0.5)
    said = str(none.value)
    assert not none.value.proved
    assert re.search(r"contour '(near|far)' in posture (rear|front)/up/plus", said)
    assert re.search(
        r"'(left|right)' and '.*' come [\d.]+ mm nearer than allowed \d+ % of the way", said
    )
    assert "no order is left" in said
    # No search goes on from an end that is locked in: two of them told that.
    assert monotonic() - begun < longest_search(0.5)


@pytest.mark.slow
def test_a_posture_that_cannot_be_left_is_reconsidered(lane, arm):
    holes, cell, asked, ahead, behind, home, folded = lane
    questions = []

    def more(i):
        questions.append(i)
        return [ahead[0]] if i == 0 else []

    given = [[behind[0]], [ahead[1]]]
    found = order_plans(given, home=home, cell=cell, retract=0.01, seconds=0.5, more=more)
    assert sorted(found.chosen) == [(0, 1), (1, 0)]
    assert len(given[0]) == 1
    assert len(questions) == len(set(questions))
    assert all(move.clear for move in found.moves)
    # Ahead is the shorter cut; a home from which only the folded arm gets there needs the other.
    free = plan_part(holes, arm, home=home, cell=cell, retract=0.01, seconds=0.5, **asked)
    assert {int(p.posture[0]) // 4 for p in free.plans} == {0}
    from_there = plan_part(holes, arm, home=folded, cell=cell, retract=0.01, seconds=0.5, **asked)
    assert {int(p.posture[0]) // 4 for p in from_there.plans} == {1}
    with pytest.raises(NoFeasiblePath, match=r"from home to the start of contour '.*also tried"):
        order_plans(
            [[a] for a in ahead], home=folded, cell=cell, retract=0.01, seconds=0.5,
            more=lambda i: [ahead[i]],
        )  # fmt: skip


def test_what_is_in_the_way_of_backing_off_is_named(lane, arm, tool):
    *_, asked, ahead, _, _, _ = lane

    def under(height):
        roof = box_between([0.7, -0.3, height], [1.4, 0.3, height + 0.1])
        return cell_of(arm, tool=tool, placement=asked["placement"], fixtures={"roof": roof})

    heights = np.arange(0.8, 3.0, 0.1)
    lowest = next(cell for cell in map(under, heights) if cell.clear(ahead[0].q).all())
    with pytest.raises(NoFeasiblePath, match=r"backs off node 0 by 300 mm: ") as none:
        order_plans([[ahead[0]]], cell=lowest, retract=0.3, seconds=0.5)
    said = str(none.value)
    assert said.startswith("contour 'near': in posture front/up/plus")
    assert re.search(r"('roof' and '.*'|'.*' and 'roof') come [\d.]+ mm nearer than allowed", said)


def test_an_end_that_may_not_be_first_or_last_is_left_in_the_middle():
    between = np.ones((3, 3))
    order = best_order(
        [0, 1, 2], np.ones(3), between, first=[np.inf, 0, 0], last=[np.inf, 0, np.inf]
    )
    assert order.candidates.tolist() == [2, 0, 1]
    with pytest.raises(InputError, match="first: expected 3 times >= 0"):
        best_order([0, 1, 2], np.ones(3), between, first=[-1, 0, 0])


class Settled(PlannedCuts[Plan]):
    """Candidates whose final form cuts slower by a factor; those of some contours are refused."""

    def __init__(self, factor: float, refused: int = 0) -> None:
        self.factor, self.left, self.seen = factor, refused, list[Plan]()

    def plan_of(self, one: Plan) -> Plan:
        return one

    def in_posture(self, contour: int, posture: int, *, quick: bool) -> Plan | None:
        return None

    def with_plan(self, one: Plan, plan: Plan) -> Plan | None:
        return plan

    def settled(self, ones: Sequence[Plan]) -> list[Plan | None]:
        return [self._settled(one) for one in ones]

    def _settled(self, one: Plan) -> Plan | None:
        self.seen.append(one)
        if self.left:
            self.left -= 1
            return None
        return replace(one, q=one.q + 1e-9, time=one.time * self.factor)


@pytest.fixture(scope="module")
def two_starts(part, arm, tool, placement):
    asked = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": np.radians(30)}
    starts = [(loop, start_at(loop, loop.s[30])) for loop in part[:3]]
    return [[plan(c, arm, **asked, certify=None) for c in both] for both in starts]


def ordered(two_starts, cuts):
    none = [()] * len(two_starts)
    return order_candidates([list(each) for each in two_starts], cuts, none, none)


def test_only_the_chosen_candidates_are_brought_into_their_final_form(two_starts):
    cuts = Settled(1.0)
    found = ordered(two_starts, cuts)
    assert len(cuts.seen) == len(found.plans) == 3
    assert found.order.duration == pytest.approx(order_plans(two_starts).order.duration, rel=1e-6)
    assert found.order.at_least <= found.order.duration
    chosen = {(made.name, made.q[0].tobytes()) for made in found.plans}
    assert chosen == {(made.name, (made.q[0] + 1e-9).tobytes()) for made in cuts.seen}


def test_others_are_chosen_where_the_final_form_is_refused_or_much_slower(two_starts):
    refusing = Settled(1.0, refused=1)
    found = ordered(two_starts, refusing)
    assert len(refusing.seen) == 4
    assert refusing.seen[0].name in {made.name for made in found.plans}
    slower = Settled(2.0)
    found = ordered(two_starts, slower)
    assert len(slower.seen) == 6  # the others looked better until they were settled, too
    assert found.cutting_time == pytest.approx(2 * sum(made[0].time[-1] for made in two_starts))
    with pytest.raises(NoFeasiblePath, match="none of its plans may be used"):
        ordered(two_starts, Settled(1.0, refused=6))


def test_of_many_contours_one_posture_is_common():
    few, many = ([[0, 1, 3]] * n + [[1, 2]] * 4 for n in (MANY - 4, MANY - 3))
    planned = [[3]] * (MANY - 5) + [[1]] * 6
    every = common_postures(few, [None] * len(few), planned[:MANY])
    assert every == [[0, 1, 3]] * (MANY - 4) + [[1]] * 4
    # The one that most are planned in, not one that all can be cut in.
    one = common_postures(many, [None] * len(many), planned)
    assert one == [[3]] * (MANY - 3) + [[]] * 4
    assert common_postures([[]] * len(many), [None] * len(many), planned) == [[]] * len(many)


def test_the_posture_of_many_contours_is_the_cheapest_that_most_can_be_cut_in():
    asked = []

    def cost(contour, posture):
        asked.append((contour, posture))
        return np.inf if posture == 0 and contour == 99 else float(2 - posture % 3)

    wanted = [None] * 100
    assert cheapest_posture(100, wanted, 4, cost) == 2
    assert len({contour for contour, _ in asked}) == SOME
    assert {0, 99} <= {contour for contour, _ in asked}
    assert cheapest_posture(100, [(0, 1)] * 99 + [(0,)], 4, cost) == 1
    assert cheapest_posture(100, [(3,)] * 100, 3, cost) is None
    dear = cheapest_posture(100, wanted, 4, lambda i, p: np.inf if p == 2 and i == 0 else 2.0 - p)
    assert dear == 3


def test_motions_are_said_to_be_turned_and_orders_to_be_sought(two_starts):
    said = []
    none = [()] * len(two_starts)
    every = [range(each[0].robot.postures) for each in two_starts]
    order_candidates(
        [each[:1] for each in two_starts], Settled(1.0), none, [list(one) for one in every],
        progress=lambda *words: said.append(words),
    )  # fmt: skip
    whats = list(dict.fromkeys(what for what, _, _ in said))
    name = two_starts[0][0].name
    assert whats[0] == f"{name}: other postures"
    assert [each for each in whats if ":" not in each] == [
        "turning motions about the beam", "order and moves, at most 240 s without a solution"
    ]  # fmt: skip
    turning = [(done, total) for what, done, total in said if what.startswith("turning")]
    assert turning[:3] == [(0, 3), (1, 3), (2, 3)]


def test_a_draft_is_an_order_that_the_solver_can_only_better():
    rng = np.random.default_rng(5)
    group = np.repeat(np.arange(12), 2)
    between = rng.uniform(0.1, 1.0, (24, 24))
    before = [(0, 3), (5, 2)]
    draft = best_order(group, np.ones(24), between, before=before, draft=True)
    best = best_order(group, np.ones(24), between, before=before)
    assert best.at_least <= best.duration <= draft.duration
    assert draft.at_least <= best.duration + 1e-9
    places = group[draft.candidates].tolist()
    assert sorted(places) == list(range(12))
    assert places.index(0) < places.index(3)
    assert places.index(5) < places.index(2)
    # It never ends above the order that it begins with.
    again = best_order(
        group, np.ones(24), between, before=before, draft=True, begin=group[best.candidates]
    )
    assert again.duration == pytest.approx(best.duration)


def test_the_solver_ends_after_its_work_with_the_same_order():
    rng = np.random.default_rng(6)
    group = np.repeat(np.arange(40), 3)
    between, before = rng.uniform(0.1, 1.0, (120, 120)), [(k, k + 20) for k in range(20)]
    one, two = (
        best_order(group, np.ones(120), between, before=before, seconds=0.5) for _ in range(2)
    )
    assert not one.optimal
    assert one.candidates.tolist() == two.candidates.tolist()
    assert one.at_least == two.at_least > 0


def test_valleys_of_many_contours_are_explored_where_more_may_be_saved():
    usual = current_effort().worth_exploring
    for count, worth in ((MANY, usual), (MANY + 1, WORTH)):
        with effort_for(count):
            assert current_effort().worth_exploring == worth
    assert current_effort().worth_exploring == usual


def test_the_former_home_of_transfer_moves_warns():
    from kerfpath import transfer
    from kerfpath.plans import TransferMove

    with pytest.warns(DeprecationWarning, match="now kerfpath.plans.TransferMove"):
        assert transfer.TransferMove is TransferMove
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = transfer.nothing
