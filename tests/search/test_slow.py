"""Paths for hopeless speeds: beside the exact least interval, with and without accelerations."""

import numpy as np
import pytest
from tests.search.posed import least_interval, problem_of

import naive
from kerfpath import NoFeasiblePath
from kerfpath.search import edges_allowed, find_slow_path, velocity_allows


def instance(rng):
    q, start, o = naive.random_instance(rng, layers=(2, 8), size=(1, 8))
    return q, start, {k: o[k] for k in ("velocity", "acceleration", "endless", "eta_v", "eta_a")}


@pytest.mark.parametrize("seed", range(60))
def test_a_slow_path_takes_what_velocities_need_or_more_and_the_least_interval_no_more(seed):
    q, start, o = instance(np.random.default_rng([77, seed]))
    exact = least_interval(q, start, **o)
    # With accelerations without bound the exact search is of the velocities alone.
    fast = least_interval(q, start, **(o | {"acceleration": np.full(q.shape[1], 1e12)}))
    found = find_slow_path(problem_of(q, start, **o))
    rounding = 1e-8
    assert fast.dt * (1 - rounding) <= exact.dt <= found.dt * (1 + rounding)

    path = q[start[:-1] + found.index]
    d = np.abs(naive.difference(path[:-1], path[1:], o["endless"]))
    need = (d / (o["eta_v"] * o["velocity"])).max()
    assert need <= fast.dt * (1 + rounding) + 1e-12
    change = np.diff(naive.difference(path[:-1], path[1:], o["endless"]), axis=0)
    sharp = np.sqrt(np.abs(change) / (o["eta_a"] * o["acceleration"])).max(initial=0.0)
    assert found.dt == pytest.approx(max(need, sharp), rel=1e-12)
    assert found.limit == ("acceleration" if sharp > need else "velocity")


@pytest.mark.parametrize("seed", range(30))
def test_velocities_allow_an_interval_from_the_least_one_on(seed):
    q, start, o = instance(np.random.default_rng([78, seed]))
    free = o | {"acceleration": np.full(q.shape[1], 1e12)}
    fast = least_interval(q, start, **free).dt
    problem = problem_of(q, start, **o)
    assert velocity_allows(problem, fast * (1 + 1e-3) + 1e-6)
    # The search grants 1e-9 rad on every step: shares of a least interval that is not tiny.
    if fast > 1e-3:
        assert not velocity_allows(problem, fast * (1 - 1e-3))


def test_where_no_path_is_left_it_is_said():
    q, start = np.zeros((3, 2)), np.array([0, 1, 2, 3])
    limits = {"velocity": np.ones(2), "acceleration": np.ones(2)}
    shut = problem_of(q, start, shut=[[1, 2]], **limits)
    with pytest.raises(NoFeasiblePath, match="node 1 to node 2"):
        find_slow_path(shut)
    assert not velocity_allows(shut, 1.0)
    still = find_slow_path(problem_of(q, start, **limits))
    assert still.dt == 0.0


def test_the_edges_that_an_interval_allows_are_counted():
    rng = np.random.default_rng(5)
    # Small enough that none is left out.
    q, start = rng.uniform(-1, 1, (40, 2)), np.array([0, 10, 25, 40])
    limits = {"velocity": [1.0, 0.5], "acceleration": np.ones(2), "endless": [False, True]}
    for dt in (0.1, 0.5, 3.0):
        kept = sum(
            (np.abs(naive.difference(p, j, [False, True])) <= dt * np.array([1.0, 0.5])).all()
            for a, b, c in ((0, 10, 25), (10, 25, 40))
            for p in q[a:b]
            for j in q[b:c]
        )
        assert edges_allowed(problem_of(q, start, **limits), dt) == pytest.approx(kept)
