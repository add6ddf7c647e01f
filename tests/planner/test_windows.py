"""Windows of gamma: kept at every node, never cheaper, and named where they close the way."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import GammaWindow, InputError, NoFeasiblePath, audit, fastest_speed, plan, refine
from kerfpath.graph import gamma_grid
from kerfpath.losses import Loss
from kerfpath.planner import layered_graph
from kerfpath.windows import nodes_of, room_beside, samples_inside, with_window_ends

STEP = np.radians(5)
SAME = 1e-3
"""Relative: refinements stop where the model promises less than 1e-4 a step, from either side."""
ROUNDING = 1e-8
"""rad: the ends of windows are samples but for 1e-9 rad."""


@pytest.fixture(scope="module")
def nodes(circle):
    return circle.resample(count=61)


@pytest.fixture(scope="module")
def task(nodes, arm, tool, placement):
    where = {"tool": tool, "placement": placement, "gamma_step": STEP, "postures": (0, 1)}
    return (nodes, arm), where | {"speed": 0.1, "certify": None}


@pytest.fixture(scope="module")
def free(task):
    return plan(*task[0], **task[1])


def over(nodes, first, last, low, high):
    """A window over nodes first to last, low to high in deg."""
    s = nodes.s[[first, last]]
    return GammaWindow(start=s[0], end=s[1], low=np.radians(low), high=np.radians(high))


def outside(made, windows):
    """By how much gamma is out of windows at most, rad."""
    worst = 0.0
    for w, here in zip(windows, nodes_of(windows, made.contour.s), strict=True):
        off = np.abs(np.angle(np.exp(1j * (made.gamma - w.low - w.width / 2))))[here]
        worst = max(worst, float((off - w.width / 2).max()))
    return worst


@pytest.mark.parametrize("seed", range(4))
def test_a_plan_keeps_its_windows_and_costs_no_less(task, nodes, free, seed):
    rng = np.random.default_rng(seed)
    first, last = np.sort(rng.integers(0, 61, 2))
    middle = np.degrees(free.gamma[first]) + rng.uniform(-60, 60)
    width = rng.choice([0.3, 3.0, 17.0])
    windows = (over(nodes, first, last, middle - width / 2, middle + width / 2),)
    made = plan(*task[0], **task[1], gamma_windows=windows)
    assert outside(made, windows) <= ROUNDING
    assert made.cost >= free.cost * (1 - SAME)
    assert audit(made) == []


@pytest.mark.parametrize("method", ["exact", "paper"])
def test_a_grid_has_the_ends_of_its_windows_and_keeps_them(task, nodes, free, method):
    windows = (over(nodes, 10, 20, 12.3, 14.1), over(nodes, 15, 40, 13.2, 40))
    gamma = with_window_ends(gamma_grid(STEP), windows)
    ends = np.radians([12.3, 14.1, 13.2, 40])
    assert np.abs(gamma[:, None] - ends).min(axis=0).max() < 1e-12
    assert (np.diff(gamma) > 0).all()
    options = task[1] | {"method": method, "refine": False}
    made = plan(*task[0], **options, gamma_windows=windows)
    assert outside(made, windows) <= ROUNDING


def test_a_window_about_the_best_course_changes_nothing(task, nodes, free):
    off = np.degrees(np.unwrap(free.gamma))
    window = over(nodes, 0, 60, off.min() - 30, off.max() + 30)
    made = plan(*task[0], **task[1], gamma_windows=(window,))
    assert made.cost == pytest.approx(free.cost, rel=SAME)


def test_a_window_may_cross_half_a_turn(task, nodes):
    windows = (over(nodes, 5, 30, 176, -178),)
    assert windows[0].width == pytest.approx(np.radians(6))
    where = {k: task[1][k] for k in ("tool", "placement", "gamma_step")}
    graph = layered_graph(*task[0], **where, gamma_windows=windows)
    at = graph.gamma[graph.sample[graph.start[10] : graph.start[11]]]
    assert len(at)
    assert (np.abs(np.degrees(at)) >= 176 - 1e-6).all()
    options = {k: v for k, v in task[1].items() if k != "postures"}
    made = plan(*task[0], **options | {"speed": 0.01}, gamma_windows=windows)
    assert outside(made, windows) <= ROUNDING


def test_what_a_nearly_whole_window_leaves_out_is_not_stepped_across():
    window = GammaWindow(start=0, end=1, low=np.radians(5), high=np.radians(4))
    gamma, s = with_window_ends(gamma_grid(STEP), [window]), np.zeros(1)
    inside = samples_inside([window], s, gamma)[0]
    here, there = (np.argmin(np.abs(gamma - np.radians(a))) for a in (4, 5))
    assert inside[[here, there]].all()
    assert there == here + 2
    assert not inside[here + 1]


def test_room_is_that_of_all_windows():
    windows = (
        GammaWindow(start=0, end=1, low=3.0, high=-3.0),
        GammaWindow(start=1, end=2, low=-3.2, high=-2.9),
    )
    low, high = room_beside(windows, np.array([0.5, 1.0, 3.0]), np.array([3.1, -3.1, 0.0]))
    np.testing.assert_allclose(low, [3.0, -3.2, -np.inf])
    np.testing.assert_allclose(high, [2 * np.pi - 3, -3.0, np.inf])


def test_a_window_off_every_pose_is_the_reason(task, nodes):
    windows = (over(nodes, 10, 20, 0, 10), over(nodes, 18, 25, 50, 60))
    with pytest.raises(NoFeasiblePath, match="outside the pinned window of gamma") as caught:
        plan(*task[0], **task[1], gamma_windows=windows)
    assert caught.value.node == 17
    assert [why.loss for why in caught.value.lost_by(Loss.PINNED)] == [Loss.PINNED]
    assert caught.value.closed is None
    assert "without the windows of gamma 144 would be left" in str(caught.value)


def test_a_way_closed_by_a_window_is_said_to_be(task, nodes):
    # Two pins half a turn apart, one interval apart: no speed limit lets gamma follow.
    windows = (over(nodes, 30, 30, 0, 10), over(nodes, 31, 31, 90, 100))
    with pytest.raises(NoFeasiblePath, match="windows of gamma hold") as caught:
        plan(*task[0], **task[1] | {"speed": 1.0}, gamma_windows=windows)
    assert caught.value.closed is None


@pytest.mark.parametrize("method", ["exact", "continuous"])
def test_a_window_at_the_start_of_a_closed_motion_holds_at_its_end(task, nodes, method):
    windows = (over(nodes, 0, 0, 12.3, 33.1),)
    made = plan(*task[0], **task[1], method=method, closure="periodic", gamma_windows=windows)
    assert outside(made, windows) <= ROUNDING
    assert np.abs(np.angle(np.exp(1j * (made.gamma[-1] - made.gamma[0])))) <= ROUNDING
    assert audit(made) == []


def test_nodes_between_nodes_keep_a_window(task, nodes, circle):
    windows = (over(nodes, 10, 25, 20.2, 21.1),)
    made = plan(*task[0], **task[1], gamma_windows=windows)
    fine = circle.resample(count=181)
    found = refine(made, nodes=replace(fine, s=fine.s))
    assert found.done, found.statement
    assert outside(found.plan, windows) <= ROUNDING
    assert audit(found.plan) == []


def test_the_fastest_speed_is_that_within_windows(task, nodes):
    where = {k: task[1][k] for k in ("tool", "placement", "gamma_step", "postures")}
    windows = (over(nodes, 10, 25, 20.2, 21.1), over(nodes, 40, 45, 60, 61))
    assert fastest_speed(*task[0], **where, gamma_windows=windows).speed <= fastest_speed(
        *task[0], **where
    ).speed * (1 + 1e-9)


def test_an_edited_plan_fails_its_audit(task, nodes, free):
    window = over(nodes, 10, 20, np.degrees(free.gamma[15]) + 20, np.degrees(free.gamma[15]) + 30)
    spoilt = replace(free, settings=replace(free.settings, gamma_windows=(window,)))
    # What the plan says of gamma does not count.
    spoilt = replace(spoilt, gamma=np.full(len(nodes), window.low + 0.01))
    (issue,) = (i for i in audit(spoilt) if i.code == "gamma-window")
    assert 10 <= issue.node <= 20
    made = plan(*task[0], **task[1], gamma_windows=(window,))
    assert audit(made) == []


@pytest.mark.parametrize("frames", ["tangent", "rotation-minimising"])
def test_the_audit_counts_gamma_as_the_plan_does(task, nodes, frames):
    windows = (over(nodes, 0, 12, 20, 20), over(nodes, 40, 45, 20, 20))
    made = plan(*task[0], **task[1] | {"frames": frames, "speed": 0.02}, gamma_windows=windows)
    np.testing.assert_allclose(np.degrees(made.gamma[[3, 42]]), 20, atol=1e-6)
    assert audit(made) == []


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((0.2, 0.1, 0, 1), "end: expected at least the start"),
        ((0, 1, -np.pi, np.pi), "leaves nothing of the circle out"),
        ((0, 1, 0, 7), "high: expected an angle from -2 pi to 2 pi rad, got 7 rad"),
        ((0, np.nan, 0, 1), "end: "),
    ],
)
def test_bad_windows_are_refused_by_their_name(values, said):
    with pytest.raises(InputError, match=f"^gamma_windows.*{said}"):
        GammaWindow(**dict(zip(("start", "end", "low", "high"), values, strict=True)))


def test_a_window_at_no_node_is_refused(task, nodes):
    middle = (nodes.s[3] + nodes.s[4]) / 2
    window = GammaWindow(start=middle, end=middle, low=0, high=1)
    with pytest.raises(InputError, match=r"window 1, from .* holds at no node of contour 'circle'"):
        plan(*task[0], **task[1], gamma_windows=(window,))
