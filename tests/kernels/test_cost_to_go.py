"""The kernels of the search: to the bit the scalar recursion, vectorised, from any thread."""

import contextlib
import re
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numba
import numpy as np
import pytest
from tests.search.posed import problem_of

import naive
from from_python import from_python
from kerfpath import NoFeasiblePath, shortest_path
from kerfpath.kernels import exact, limits
from kerfpath.kernels import search as kernel
from kerfpath.kernels.cost_to_go import SIX, cost_to_go
from kerfpath.kernels.search import LostTime
from kerfpath.search.exact import NO_SEAM, best_allowed
from kerfpath.search.problem import sort_layers

distance, fill_increment, is_shut, late_cost, shut_edges = map(
    from_python,
    (kernel.distance, kernel.fill_increment, kernel.is_shut, kernel.late_cost, kernel.shut_edges),
)
velocity_time = from_python(limits.velocity_time)


def graph(rng, **sizes):
    """A sorted graph, in every other one with some edges shut."""
    q, start, o = naive.random_instance(rng, **sizes)
    _, shut, _ = naive.random_closures(rng, start, rng.choice([0.0, 0.6]))
    asked = ("dt", "velocity", "acceleration", "eta_v", "eta_a")
    asked += ("endless", "vertex_cost", "weights")
    problem = problem_of(q, start, shut=shut, **{name: o[name] for name in asked})
    aim = problem.aim._replace(metric=0, acceleration=problem.aim.velocity)
    return sort_layers(problem.layers, aim.velocity), aim


def scalar(layers, aim, allowed):
    """Fill the bound by all pairs of neighbouring layers."""
    h = np.where(allowed, 0.0, np.inf)
    start = layers.start
    for k in range(len(start) - 3, -1, -1):
        for p in range(start[k], start[k + 1]):
            best = np.inf
            for j in range(start[k + 1], start[k + 2]):
                rho, tail = distance(layers, aim, p, j), layers.cost[j]
                rho = np.inf if is_shut(layers.shut, *shut_edges(layers, p), j) else rho
                if aim.lost.penalty > 0 and rho < np.inf:
                    dq = np.empty(len(aim.velocity))
                    fill_increment(layers, p, j, dq)
                    rho += late_cost(aim.lost, aim.lost.stretch * velocity_time(dq, aim.velocity))
                if aim.minimax:
                    best = min(best, max(rho, max(tail, h[j])))
                else:
                    best = min(best, rho + (tail + h[j]), aim.lost.leap + (tail + h[j]))
            h[p] = best if allowed[p] else np.inf
    return h


@pytest.mark.parametrize("minimax", [False, True])
@pytest.mark.parametrize("metric", range(3))
def test_the_bound_is_that_of_the_scalar_recursion_to_the_bit(metric, minimax):
    rng = np.random.default_rng(31)
    finite = 0
    for capped in (False, True) * 15:
        layers, aim = graph(rng, layers=(1, 7), size=(1, 40))
        aim = aim._replace(metric=metric, minimax=minimax)
        if capped:
            aim = aim._replace(cap=0.7 * float(aim.weight.sum()))
        allowed = rng.random(len(layers.low)) < 0.9
        h = np.empty(len(layers.low))
        cost_to_go(layers, aim, allowed, h)
        np.testing.assert_array_equal(h, scalar(layers, aim, allowed))
        finite += int(np.isfinite(h[: layers.start[-2]]).sum())
    assert finite > 300


@pytest.mark.parametrize("leap", [3.0, np.inf])
@pytest.mark.parametrize("metric", range(3))
def test_lost_time_and_leaps_count_with_the_distance(metric, leap):
    rng = np.random.default_rng(32)
    finite = 0
    for _ in range(20):
        layers, aim = graph(rng, layers=(1, 7), size=(1, 40))
        aim = aim._replace(metric=metric, timed=True, lost=LostTime(2.0, 2.5, leap))
        allowed = rng.random(len(layers.low)) < 0.9
        h = np.empty(len(layers.low))
        cost_to_go(layers, aim, allowed, h)
        np.testing.assert_allclose(h, scalar(layers, aim, allowed), rtol=1e-13)
        finite += int(np.isfinite(h[: layers.start[-2]]).sum())
    assert finite > 300


@pytest.mark.slow
@pytest.mark.skipif(bool(numba.config.BOUNDSCHECK), reason="a loop that checks indices jumps")
def test_its_innermost_loop_takes_several_numbers_at_once():
    # Python's own min, a sum that may be reordered or a constant infinity would undo it unnoticed.
    rng = np.random.default_rng(0)
    while len((made := graph(rng, layers=(3, 4), size=(5, 9)))[0].q) != SIX:
        pass
    layers, aim = made
    fresh = numba.njit(nogil=True)(cost_to_go.py_func)
    fresh(layers, aim, np.ones(len(layers.low), bool), np.empty(len(layers.low)))
    assert re.search(r"llvm\.minnum\.v\d+f64", next(iter(fresh.inspect_llvm().values())))


def test_without_a_bound_too_no_path_begins_where_it_is_not_allowed():
    rng, tried = np.random.default_rng(33), 0
    for _ in range(60):
        layers, aim = graph(rng, layers=(2, 7), size=(4, 12))
        for v in range(layers.start[1]):
            allowed = np.ones(len(layers.low), np.bool_)
            allowed[: layers.start[1]] = np.arange(layers.start[1]) == v
            h = np.empty(len(allowed))
            cost_to_go(layers, aim, allowed, h)
            found = best_allowed(layers, aim, allowed, NO_SEAM, 0.0)
            few = exact.recursion(layers, aim, h, np.inf, NO_SEAM, 0, 2).cost
            assert few >= (np.inf if found is None else found.cost * (1 - 1e-12))
            tried += few < np.inf
    assert tried > 100


def feasible_instances(count):
    """Return the first random graphs that have a path, with what is asked of them."""
    found, seed = [], 0
    while len(found) < count:
        rng = np.random.default_rng(seed)
        q, start, o = naive.random_instance(rng, layers=(5, 9), size=(5, 20))
        o["method"], seed = "exact", seed + 1
        with contextlib.suppress(NoFeasiblePath):
            shortest_path(q, start, **o)
            found.append(((q, start), o))
    return found


@pytest.mark.slow
def test_the_answer_is_the_same_from_any_thread_or_process():
    asked = feasible_instances(40)

    def answers(pool):
        futures = [pool.submit(shortest_path, *where, **what) for where, what in asked]
        return [(tuple(f.result().index), f.result().cost.hex()) for f in futures]

    with ThreadPoolExecutor(1) as one, ThreadPoolExecutor(4) as four:
        want = answers(one)
        assert answers(four) == want
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert answers(pool) == want
