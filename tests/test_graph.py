"""The layered graph: every admissible pose, every loss counted."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from kerfpath import Band, Comfort, InputError, robot
from kerfpath.graph import build, gamma_grid
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph
from kerfpath.planner.layers import within_margins
from kerfpath.robots import FAMILIES


@pytest.fixture(scope="module")
def frames(circle, placement):
    return np.ascontiguousarray(placement @ circle.frames("rotation-minimising"))


@pytest.mark.equation(10)
@pytest.mark.equation(11)
def test_the_graph_holds_exactly_the_solutions_of_each_turned_frame(frames, arm, tool):
    few, gamma = frames[::30], gamma_grid(np.radians(20))
    bounded = arm.with_limits(endless=[0] * 6)  # several turns of axes 4 and 6
    graph = build(few, bounded, T_flange_tip=tool, gamma=gamma)
    for k, H in enumerate(few):
        layer = slice(graph.start[k], graph.start[k + 1])
        want = []
        for j, g in enumerate(gamma):
            Rz = np.eye(4)
            Rz[:2, :2] = [[np.cos(g), -np.sin(g)], [np.sin(g), np.cos(g)]]
            found = bounded.inverse(H @ Rz @ np.linalg.inv(tool))
            want += [(j, p, *q) for p, q in zip(found.posture, found.q, strict=True)]
        want = np.array(want)
        np.testing.assert_array_equal(graph.sample[layer], want[:, 0])
        np.testing.assert_array_equal(graph.posture[layer], want[:, 1])
        # Two ways to multiply the same three matrices.
        np.testing.assert_allclose(graph.q[layer], want[:, 2:], atol=1e-9)


def test_every_candidate_is_admitted_or_counted_under_one_reason(frames, arm, tool):
    gamma = gamma_grid(np.radians(10))
    graph = build(frames, arm, T_flange_tip=tool, gamma=gamma)
    assert sum(graph.counts().values()) == len(frames) * 36 * 8
    assert sum(graph.counts(3).values()) == 36 * 8
    assert {sum(graph.counts(k).values()) for k in range(len(frames))} == {36 * 8}
    # Axes 4 and 6 are endless: one vertex for each admitted posture.
    assert len(graph.q) == graph.counts()["admitted"]
    assert "unreachable" not in graph.counts() or graph.counts()["unreachable"] > 0
    assert any("joint" in reason for reason in graph.counts())


def test_the_reason_names_the_joint_that_is_out_of_range(frames, arm, tool):
    gamma = gamma_grid(np.radians(10))
    turns = np.full(6, 9.0)
    turns[4] = 3.2
    upper = turns.copy()
    upper[4] = -0.5
    narrow = arm.with_limits(lower=-turns, upper=upper, endless=[0] * 6)
    graph = build(frames[:3], narrow, T_flange_tip=tool, gamma=gamma)
    counts = graph.counts()
    assert set(counts) <= {"admitted", "unreachable", "joint 5 low", "joint 5 high"}
    assert counts["joint 5 high"] > 0
    assert counts["admitted"] > 0


def test_pieces_and_threads_leave_no_trace(frames, arm, tool, monkeypatch):
    gamma = gamma_grid(np.radians(5))
    done = []
    whole = build(frames, arm, T_flange_tip=tool, gamma=gamma, progress=done.append)
    assert sum(done) == len(frames)
    monkeypatch.setitem(FAMILIES, "opw", replace(FAMILIES["opw"], poses_at_once=300))
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    pools = Mock(wraps=ThreadPoolExecutor)
    monkeypatch.setattr("kerfpath.graph.ThreadPoolExecutor", pools)
    pieces = build(frames, arm, T_flange_tip=tool, gamma=gamma)
    for name in ("q", "start", "sample", "posture", "turn", "reason"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(pieces, name))
    pools.assert_called_once_with(3)


def test_the_gamma_grid_is_even_and_covers_the_circle_once():
    gamma = gamma_grid(np.radians(1))
    assert len(gamma) == 360
    assert gamma[-1] == pytest.approx(np.pi)
    assert gamma[0] > -np.pi
    assert len(gamma_grid(np.radians(7))) == 52  # 360 / 7 is not whole: the step gets finer
    assert len(gamma_grid(2 * np.pi)) == 1


@pytest.mark.parametrize("step", [0, -1, 7, np.nan, np.inf])
def test_a_bad_step_is_refused(step):
    with pytest.raises(InputError, match="gamma_step"):
        gamma_grid(step)


def test_without_limits_nothing_is_admitted(frames, tool):
    with pytest.raises(InputError, match="joint limits are not known"):
        build(frames, robot("kuka_kr120_r2500_pro"), T_flange_tip=tool, gamma=gamma_grid(1.0))


def test_a_graph_is_thinned_once_for_the_same_margins(circle, arm, tool, placement):
    given = {"tool": tool, "placement": placement}
    options = PlanOptions(
        gamma_step=np.radians(10), comfort=Comfort(limits=Band(margin=0.2)), retract=0.05, floor=0.3
    )
    graph = layered_graph(circle, arm, options=options, **given)
    assert 0 < len(graph.q) < len(build_all(circle, arm, tool, placement).q)
    assert within_margins(graph, arm, options, tool, circle.s) is graph
    # What asks for anything else is looked at again, and finds what it would find by itself.
    for other in (
        replace(options, comfort=Comfort(limits=Band(margin=0.4))),
        replace(options, floor=0.5),
        replace(options, retract=0.2),
    ):
        again = within_margins(graph, arm, other, tool, circle.s)
        alone = layered_graph(circle, arm, options=other, **given)
        assert again.kept == alone.kept != graph.kept
        np.testing.assert_array_equal(again.q, alone.q)
    narrow = arm.with_limits(upper=arm.upper - 0.3)
    assert within_margins(graph, narrow, options, tool, circle.s) is not graph
    assert within_margins(graph, arm, options, tool, circle.s, periodic=True) is not graph
    assert graph.part(3, 9).kept is None


def build_all(circle, arm, tool, placement):
    return layered_graph(circle, arm, tool=tool, placement=placement, gamma_step=np.radians(10))
