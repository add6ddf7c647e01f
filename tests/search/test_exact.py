"""The exact search against trying every pair of edges; its answers, its edges, bad input."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.limits import Limits
from kerfpath.search import NoCheaperPath, SearchProblem, find_cheaper, find_shortest

ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0]}


def instance(rng, closure, below=0.0, make=naive.random_instance, **sizes):
    q, start, options = make(rng, **sizes)
    options |= {"method": "exact"}
    if below:
        options["vertex_cost"] = options["vertex_cost"] - below * rng.random(len(q))
    if closure == "periodic":
        # The last layer repeats the first, endless joints turned once more.
        first = q[: start[1]] + 2 * np.pi * options["endless"]
        q = np.vstack([q, first])
        start = np.append(start, len(q))
        for name in ("posture", "vertex_cost"):
            options[name] = np.concatenate([options[name], options[name][: start[1]]])
    return q, start, options


def admissible(q, o, closure):
    d = naive.difference(q[:-1], q[1:], o["endless"])
    ok = (np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + 2e-9).all()
    changes = np.diff(d, axis=0)
    if closure == "periodic":
        changes = np.vstack([changes, d[0] - d[-1]])
    return ok and (np.abs(changes) <= o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 2e-9).all()


def cost_of(q, start, index, o):
    d = naive.difference(q[:-1], q[1:], o["endless"])
    parts = [naive.distance(r, o["weights"], o["metric"]) for r in d]
    parts += list(o["vertex_cost"][start[:-1] + index])
    return max(parts), sum(parts)


def agree(rng, closure, **sizes):
    """Compare one random instance with the oracle; return whether there was a path."""
    q, start, o = instance(rng, closure, **sizes)
    want = naive.second_order(q, start, closure, **o)
    if want is None:
        with pytest.raises(NoFeasiblePath) as caught:
            shortest_path(q, start, closure=closure, **o)
        assert caught.value.proved
        return False
    got = shortest_path(q, start, closure=closure, **o)
    assert got.optimal
    path = q[start[:-1] + got.index]
    assert len(path) < 2 or admissible(path, o, closure)
    largest, total = cost_of(path, start, got.index, o)
    # Rounding only: sums of the same numbers in another order.
    assert got.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
    assert got.cost == pytest.approx(largest if o["objective"] == "max" else total, rel=1e-10)
    assert total == pytest.approx(want[1], rel=1e-10, abs=1e-12)
    if closure == "periodic":
        assert got.index[0] == got.index[-1]
    return True


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_the_optimum_agrees_with_trying_every_pair_of_edges(closure):
    rng = np.random.default_rng(21)
    feasible = sum(agree(rng, closure) for _ in range(500))
    assert 100 < feasible < 480


@pytest.mark.parametrize("rotation", [None, 0.5])
@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_a_cheaper_path_is_the_best_one_if_that_costs_less(closure, rotation):
    """Also if all paths without closure and rotation limits cost less; else none is found."""
    rng, seen = np.random.default_rng(22), {"found": 0, "none": 0, "no path": 0}
    for _ in range(150):
        q, start, o = instance(rng, closure)
        limits = Limits.of(*(o.pop(name) for name in ("velocity", "acceleration")),
                           eta_v=o.pop("eta_v"), eta_a=o.pop("eta_a"))  # fmt: skip
        most = None if rotation is None else np.where(o["endless"], rotation, np.inf)
        problem = SearchProblem(
            q=q, start=start, limits=limits, closure=closure, rotation=most, **o
        )
        try:
            best = find_shortest(problem)
        except NoFeasiblePath:
            seen["no path"] += 1
            with pytest.raises(NoCheaperPath):
                find_cheaper(problem, np.inf)
            continue
        for share in (0.5, 1.0, 1 + 1e-9, 2.0):
            most_cost = share * best.cost
            if best.cost < most_cost:
                seen["found"] += 1
                assert find_cheaper(problem, most_cost).cost == best.cost
            else:
                seen["none"] += 1
                with pytest.raises(NoCheaperPath):
                    find_cheaper(problem, most_cost)
    assert min(seen.values()) > 10


@pytest.mark.parametrize("below", [0.3, 20.0])
@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_costs_below_zero_change_nothing_but_the_optimum(change_effort, closure, below):
    change_effort(recorded_states=30)
    rng = np.random.default_rng(26)
    # From one layer back to it all steps are 0 but for rounding, which is no tie to break.
    assert sum(agree(rng, closure, below=below, layers=(2, 9)) for _ in range(300)) > 60
    for cost in ([-3.0, -2.0], [3.0, 2.0]):
        for objective in ("sum", "max"):
            path = shortest_path(
                [[0.0], [0.1]],
                [0, 2],
                vertex_cost=cost,
                objective=objective,
                closure=closure,
                **ONE,
            )
            assert path.cost == min(cost)


@pytest.mark.slow
@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_half_a_turn_goes_the_way_that_the_values_go(closure):
    rng = np.random.default_rng(27)
    feasible = sum(agree(rng, closure, make=naive.lattice_instance) for _ in range(1500))
    assert 200 < feasible < 1450


def test_of_half_a_turn_both_ways_are_as_long_but_not_as_even():
    # On from -90 to 0 the joint goes to 180 as evenly as to -180 it does not: (6) tells them apart.
    turning = {"dt": 1.0, "velocity": [4.0], "acceleration": [2.0], "endless": [True]}
    for last, broken in (([np.pi], False), ([-np.pi], True), ([-3 * np.pi], False)):
        q = [[-np.pi / 2], [0.0], last]
        if broken:
            with pytest.raises(NoFeasiblePath, match="acceleration"):
                shortest_path(q, [0, 1, 2, 3], **turning)
        else:
            assert shortest_path(q, [0, 1, 2, 3], **turning).optimal


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_optimum_agrees_on_five_thousand_instances(seed):
    rng = np.random.default_rng(100 + seed)
    for _ in range(2500):
        agree(rng, str(rng.choice(["free", "free", "periodic"])), layers=(1, 8), size=(1, 8))


def test_the_oracle_itself_agrees_with_enumeration():
    rng = np.random.default_rng(22)
    for closure in ("free", "periodic"):
        for _ in range(150):
            q, start, o = instance(rng, closure, layers=(2, 5), size=(1, 4))
            best = (np.inf, np.inf)
            for path in itertools.product(*[range(a, b) for a, b in itertools.pairwise(start)]):
                index = np.array(path) - start[:-1]
                if closure == "periodic" and index[0] != index[-1]:
                    continue
                if admissible(q[list(path)], o, closure):
                    largest, total = cost_of(q[list(path)], start, index, o)
                    best = min(best, (largest if o["objective"] == "max" else total, total))
            want = naive.second_order(q, start, closure, **o)
            assert (want is None) == (best[0] == np.inf)
            if want is not None:
                np.testing.assert_allclose(want, best, rtol=1e-9)


def test_the_exact_path_is_never_worse_than_the_greedy_one_and_sometimes_better():
    rng = np.random.default_rng(23)
    better = found = 0
    for _ in range(400):
        q, start, o = instance(rng, "free", layers=(4, 9), size=(4, 14))
        try:
            greedy = shortest_path(q, start, **(o | {"method": "paper"})).cost
        except NoFeasiblePath:
            greedy = np.inf
        try:
            exact = shortest_path(q, start, **o).cost
        except NoFeasiblePath:
            assert greedy == np.inf
            continue
        assert exact <= greedy * (1 + 1e-12)
        better += exact < greedy * (1 - 1e-9) < np.inf
        found += greedy == np.inf
    assert better > 0
    assert found > 0


def test_the_path_that_the_greedy_test_cannot_see():
    q = [[0.0], [0.4], [0.5], [1.0]]
    path = shortest_path(q, [0, 1, 3, 4], dt=1.0, velocity=[1.0], acceleration=[0.05])
    np.testing.assert_array_equal(path.index, [0, 1, 0])
    assert path.optimal


def test_a_dead_end_says_how_far_any_path_goes_and_what_forbids_the_rest():
    # Both ways to 0.5 go fast; neither may stop at once: acceleration closes the way to node 3.
    q = [[0.0], [0.5], [0.95], [0.95]]
    with pytest.raises(NoFeasiblePath, match="from node 2 to node 3") as caught:
        shortest_path(q, [0, 1, 2, 3, 4], dt=1.0, velocity=[1.0], acceleration=[0.1])
    assert caught.value.proved
    assert caught.value.node == 2
    assert caught.value.counts == {"acceleration, joint 1": 1}
    assert caught.value.back == 2


def test_a_cut_is_bracketed_from_both_ends():
    rng = np.random.default_rng(25)
    seen = 0
    for _ in range(300):
        q, start, o = instance(rng, "free", layers=(3, 8), size=(1, 6))
        if naive.second_order(q, start, "free", **o) is not None:
            continue
        with pytest.raises(NoFeasiblePath) as caught:
            shortest_path(q, start, **o)
        broken, K = caught.value, len(start) - 1

        def passable(a, b, q=q, start=start, o=o):
            part = slice(start[a], start[b + 1])
            cut = o | {k: o[k][part] for k in ("posture", "vertex_cost")}
            return naive.second_order(q[part], start[a : b + 2] - start[a], "free", **cut)

        assert passable(0, broken.node) is not None
        assert passable(0, broken.node + 1) is None
        assert passable(broken.back, K - 1) is not None
        assert passable(broken.back - 1, K - 1) is None
        seen += 1
    assert seen > 50


@pytest.mark.parametrize(
    ("start", "node"), [([0, 0, 1, 2], -1), ([0, 1, 1, 2], 0), ([0, 1, 2, 2], 1)]
)
def test_an_empty_layer_is_an_answer_with_its_node(start, node):
    with pytest.raises(NoFeasiblePath, match="is empty") as caught:
        shortest_path([[0.0], [0.1]], start, **ONE)
    assert (caught.value.node, caught.value.proved) == (node, True)


def test_a_break_before_an_empty_layer_is_where_it_is():
    with pytest.raises(NoFeasiblePath, match="from node 0 to node 1") as caught:
        shortest_path([[0.0], [9.0]], [0, 1, 2, 2], **ONE)
    assert caught.value.node == 0


def test_a_loop_that_cannot_close_says_so():
    # From either vertex paths reach the end, but none the vertex it left: joint 1 moves one way.
    q = [[0.0], [0.3], [0.4], [0.6], [0.0], [0.3]]
    with pytest.raises(NoFeasiblePath) as caught:
        shortest_path(
            q, [0, 2, 4, 6], dt=1.0, velocity=[0.5], acceleration=[0.01], closure="periodic"
        )
    assert caught.value.proved


def test_an_endless_joint_may_close_a_turn_later():
    t = np.linspace(0, 2 * np.pi, 9)
    q = t[:, None]
    options = {"dt": 1.0, "velocity": [1.0], "acceleration": [0.01], "closure": "periodic"}
    path = shortest_path(q, np.arange(10), endless=[True], weights=[1.0], **options)
    assert path.cost == pytest.approx(2 * np.pi)
    with pytest.raises(InputError, match=r"their vertices 0 differ by 6.28 rad"):
        shortest_path(q, np.arange(10), **options)


def test_ends_that_do_not_repeat_are_refused():
    with pytest.raises(InputError, match="they have 1 and 2 vertices"):
        shortest_path([[0.0], [0.1], [0.2]], [0, 1, 3], closure="periodic", **ONE)


def test_the_bound_cannot_hide_a_dear_optimum(change_effort):
    # Forgetting what it recorded must not change the answer.
    change_effort(recorded_states=3)
    rng = np.random.default_rng(24)
    assert sum(agree(rng, "free") for _ in range(200)) > 50


@settings(derandomize=True, max_examples=150, deadline=None)
@given(
    q=hnp.arrays(float, st.tuples(st.integers(0, 6), st.integers(0, 3)), elements=st.floats(-4, 4)),
    start=st.lists(st.integers(-1, 7), max_size=5),
    limit=st.floats(),
    closure=st.sampled_from(["free", "periodic"]),
)
def test_whatever_comes_no_crash(q, start, limit, closure):
    limits = {"velocity": [limit] * q.shape[1], "acceleration": [limit] * q.shape[1]}
    try:
        path = shortest_path(q, start, dt=0.1, closure=closure, **limits)
    except (InputError, NoFeasiblePath):
        return
    assert len(path.index) == len(start) - 1


def test_a_cut_is_bracketed_by_vertices_too():
    """Both ends reach the middle layer, one in its first vertex, the other in its second."""
    limits = {"dt": 1.0, "velocity": [1.0], "acceleration": [9.0]}
    with pytest.raises(NoFeasiblePath) as broken:
        shortest_path([[0.0], [0.0], [3.0], [3.0]], [0, 1, 3, 4], **limits)
    assert (broken.value.node, broken.value.back) == (1, 1)
    assert broken.value.reached.tolist() == [0]
    assert broken.value.leaving.tolist() == [1]
