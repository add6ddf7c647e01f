"""The problem of a search: built once, what it holds, and what it refuses."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from tests.search.posed import problem_of

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.search import (
    find_interrupted,
    find_least_interval,
    find_relaxations,
    find_shortest,
    find_slowed,
)

ONE = {"q": [[0.0], [1.0]], "start": [0, 1, 2], "velocity": [2.0], "acceleration": [8.0]}


def one(**change):
    return problem_of(**ONE | {"dt": 0.5} | change)


def test_it_holds_what_is_asked_in_the_kernels_own_units():
    problem = one(eta_v=0.5, eta_a=0.25, objective="max", metric="euclid")
    aim = problem.aim
    assert (aim.velocity.tolist(), aim.acceleration.tolist()) == ([0.5], [0.5])
    assert (aim.weight.tolist(), aim.minimax) == ([1.0], True)
    assert (problem.layers.cost == 0).all()
    with pytest.raises(FrozenInstanceError):
        problem.dt = 1.0
    assert repr(problem).startswith("SearchProblem(q=array 2 x 1, start=[0, 1, 2], dt=0.5, ")


def answer(search, *args, **options):
    try:
        found = search(*args, **options)
    except NoFeasiblePath as broken:
        return str(broken)
    return found.index.tolist(), found.cost


def test_a_problem_changed_and_changed_back_is_solved_the_same():
    rng = np.random.default_rng(81)
    for _ in range(50):
        q, start, o = naive.random_instance(rng)
        problem = problem_of(q, start, **o)
        other = replace(problem, objective="sum", dt=2 * problem.dt, method="exact")
        again = replace(other, objective=o["objective"], dt=problem.dt, method=o["method"])
        assert answer(find_shortest, again) == answer(shortest_path, q, start, **o)


def test_freed_it_asks_for_no_more_than_the_limits():
    problem = one(
        q=[[0.0], [1.0], [0.0], [1.0]], start=[0, 2, 4], vertex_cost=[1, np.inf, 2, 0],
        closure="periodic", rotation=[9.0], endless=[True],
    ).free()  # fmt: skip
    assert problem.closure == "free"
    assert np.isinf(problem.rotation).all()
    np.testing.assert_array_equal(problem.vertex_cost, [0, np.inf, 0, 0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt": 0.0}, "dt: expected a number above 0 s"),
        ({"start": [0, 2, 1]}, "start: expected K\\+1 offsets"),
        ({"q": np.zeros((2, 0))}, "at least one joint"),
        ({"acceleration": [1.0, 1.0]}, r"acceleration: expected shape \(1\), got \(2,\)"),
        ({"endless": [True, False]}, "endless: expected shape"),
        ({"method": "best"}, "method: expected one of exact, paper, known, got 'best'"),
        ({"closure": "open"}, "closure: expected one of"),
        ({"posture": [0]}, "posture: expected shape"),
        ({"rotation": [1.0]}, "rotation: joint 1 is not endless"),
        ({"method": "paper", "closure": "periodic"}, 'closure: "periodic" needs method="exact"'),
        (
            {"method": "known", "rotation": [1.0], "endless": [True]},
            'rotation: a limit needs method="exact"',
        ),
    ],
)
def test_what_does_not_fit_is_refused_before_any_search(change, message):
    with pytest.raises(InputError, match=message):
        one(**change)


@pytest.mark.parametrize(
    "search", [find_interrupted, find_least_interval, find_relaxations, find_slowed]
)
@pytest.mark.parametrize("change", [{"closure": "periodic"}, {"rotation": [1.0]}])
def test_a_search_refuses_what_it_does_not_know(search, change):
    problem = one(endless=[True], **change)
    with pytest.raises(InputError, match='needs closure "free" and no rotation limit'):
        search(problem)


def test_a_slowed_path_adds_up():
    with pytest.raises(InputError, match='objective: a slowed path needs "sum", got "max"'):
        find_slowed(one(objective="max"))
