"""Closed vertices and shut edges in every search, against oracles that set them infinite."""

import numpy as np
import pytest
from tests.search.posed import interrupted_path, least_interval, slowed_path
from tests.search.test_rotation import instance as turning

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path

ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0]}


def instance(rng, closure="free", **sizes):
    """A random instance with looser limits than elsewhere, and some of it closed."""
    q, start, o = naive.random_instance(rng, **sizes)
    o |= {"method": "exact", "velocity": 1.5 * o["velocity"], "acceleration": 3 * o["acceleration"]}
    if closure == "periodic":
        q = np.vstack([q, q[: start[1]] + 2 * np.pi * o["endless"]])
        start = np.append(start, len(q))
        for name in ("posture", "vertex_cost"):
            o[name] = np.concatenate([o[name], o[name][: start[1]]])
    return q, start, o, *closed(rng, start, o, closure)


def closed(rng, start, o, closure="free", share=0.7):
    """Close some of an instance; the shut edges, and the same as matrices."""
    infinite, shut, passable = naive.random_closures(rng, start, share, closure)
    o["vertex_cost"] = o["vertex_cost"] + infinite
    return shut, passable


def without(o, *names):
    return {name: value for name, value in o.items() if name not in names}


def require_open(start, index, o, passable):
    assert np.isfinite(o["vertex_cost"][start[:-1] + index]).all()
    assert all(ok[a, b] for ok, a, b in zip(passable, index, index[1:], strict=False))


def refused(search, *args, **options):
    with pytest.raises(NoFeasiblePath) as caught:
        search(*args, **options)
    assert caught.value.proved
    return caught.value


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_the_best_path_uses_nothing_that_is_closed(closure):
    rng, found = np.random.default_rng(61), 0
    for _ in range(500):
        q, start, o, shut, passable = instance(rng, closure, layers=(2, 8), size=(1, 9))
        want = naive.second_order(q, start, closure, passable, **o)
        if want is None:
            refused(shortest_path, q, start, closure=closure, shut=shut, **o)
            continue
        got = shortest_path(q, start, closure=closure, shut=shut, **o)
        # Rounding only: sums of the same numbers in another order.
        assert got.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
        require_open(start, got.index, o, passable)
        found += 1
    assert 100 < found < 450


def test_the_paper_s_procedure_neither():
    rng, found = np.random.default_rng(62), 0
    for _ in range(300):
        q, start, o, shut, passable = instance(rng)
        o["method"] = str(rng.choice(["paper", "known"]))
        want = naive.path_planning(q, start, passable=passable, **o)
        if want is None:
            with pytest.raises(NoFeasiblePath):
                shortest_path(q, start, shut=shut, **o)
            continue
        got = shortest_path(q, start, shut=shut, **o)
        np.testing.assert_array_equal(got.index, want[0])
        found += 1
    assert 100 < found < 280


@pytest.mark.slow
@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_nor_does_one_within_rotation_limits(closure):
    rng, found, limited = np.random.default_rng(63), 0, 0
    for _ in range(250):
        q, start, rotation, o = turning(rng, closure)
        shut, passable = closed(rng, start, o, closure, share=0.3)
        want = naive.rotated(q, start, closure, rotation, passable, **o)
        o |= {"closure": closure, "shut": shut}
        if want is None:
            refused(shortest_path, q, start, rotation=rotation, **o)
            continue
        got = shortest_path(q, start, rotation=rotation, **o)
        assert got.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
        require_open(start, got.index, o, passable)
        found += 1
        limited += shortest_path(q, start, **o).cost < got.cost
    assert found > 30
    assert limited > 3


def test_the_fewest_interruptions_around_what_is_closed():
    rng, seen = np.random.default_rng(64), []
    for _ in range(500):
        q, start, o, shut, passable = instance(rng, layers=(2, 10))
        o = without(o, "posture", "method")
        o["acceleration"] = o["acceleration"] * rng.choice([0.02, 0.1, 1.0])
        want = naive.interrupted(q, start, passable, **o)
        if want is None:
            refused(interrupted_path, q, start, shut=shut, **o)
            continue
        got = interrupted_path(q, start, shut=shut, **o)
        assert got.interruptions == want[0]
        assert got.cost == pytest.approx(want[1], rel=1e-10, abs=1e-12)
        for p in got.pieces:
            m = len(p.index)
            require_open(start[p.first : p.first + m + 1], p.index, o, passable[p.first :])
        seen.append(got.interruptions)
    assert min(seen.count(i) for i in range(3)) > 15


def test_the_path_to_slow_down_around_what_is_closed():
    rng, found = np.random.default_rng(65), 0
    for _ in range(400):
        q, start, o, shut, passable = instance(rng)
        o = without(o, "posture", "method", "objective")
        o |= {"penalty": float(rng.choice([0.3, 3, 100])), "velocity": 0.3 * o["velocity"]}
        want = naive.slowed(q, start, passable=passable, **o)
        if want == np.inf:
            refused(slowed_path, q, start, shut=shut, **o)
            continue
        got = slowed_path(q, start, shut=shut, **o)
        assert got.cost == pytest.approx(want, rel=1e-10, abs=1e-12)
        require_open(start, got.index, o, passable)
        found += 1
    assert 150 < found < 390


def test_the_least_interval_around_what_is_closed():
    rng, found = np.random.default_rng(66), 0
    for _ in range(400):
        q, start, o, shut, passable = instance(rng, layers=(2, 8))
        cost = np.where(np.isfinite(o["vertex_cost"]), 0.0, np.inf)
        o = {k: o[k] for k in ("velocity", "acceleration", "endless", "eta_v", "eta_a")}
        o["vertex_cost"] = cost
        want = naive.quickest(q, start, passable=passable, **o)
        if want == np.inf:
            refused(least_interval, q, start, shut=shut, **o)
            continue
        got = least_interval(q, start, shut=shut, **o)
        # The cap has its slack of 1e-12 a step beside rounding.
        assert got.dt == pytest.approx(want, rel=1e-10, abs=1e-12)
        require_open(start, got.index, o, passable)
        found += 1
    assert 150 < found < 390


def every_edge(start, k):
    ranges = [np.arange(start[i], start[i + 1]) for i in (k, k + 1)]
    return np.stack(np.meshgrid(*ranges), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("at", [0, 1, 2])
def test_one_interval_shut_is_no_way_and_is_counted(at):
    q, start = np.zeros((8, 1)), np.arange(0, 9, 2)
    shut = every_edge(start, at)
    broken = refused(shortest_path, q, start, shut=shut, **ONE)
    assert (broken.node, broken.back) == (at, at + 1)
    assert broken.counts == {"shut edges": 4}
    assert "of 4 edges, forbidden by shut edges: 4" in str(broken)
    paper = refused(shortest_path, q, start, shut=shut, method="paper", **ONE)
    pieces = refused(interrupted_path, q, start, shut=shut, **ONE)
    dip = refused(slowed_path, q, start, shut=shut, **ONE)
    fast = refused(least_interval, q, start, shut=shut, velocity=[1.0], acceleration=[1.0])
    for other in (paper, pieces, dip, fast):
        assert (other.node, other.counts) == (at, broken.counts)
    # One edge left open is the path.
    index = shortest_path(q, start, shut=shut[1:], **ONE).index
    assert (start[at] + index[at], start[at + 1] + index[at + 1]) == tuple(shut[0])


def test_two_layers_and_an_only_interval():
    q, start = np.array([[0.0], [0.5], [0.0], [0.5]]), [0, 2, 4]
    assert shortest_path(q, start, shut=[[0, 2], [1, 3]], **ONE).cost == 0.5
    assert refused(shortest_path, q, start, shut=every_edge(start, 0), **ONE).node == 0


def test_the_only_way_back_over_the_seam_can_be_shut():
    """Three vertices a layer that are far apart: a closed path stays where it begins."""
    q = np.tile([[0.0], [5.0], [10.0]], (4, 1))
    o = ONE | {"closure": "periodic", "vertex_cost": np.tile([0.0, 1.0, 2.0], 4)}
    start = np.arange(0, 13, 3)
    assert shortest_path(q, start, **o).index.tolist() == [0, 0, 0, 0]
    assert shortest_path(q, start, shut=[[6, 9]], **o).index.tolist() == [1, 1, 1, 1]
    assert shortest_path(q, start, shut=[[6, 9], [1, 4]], **o).index.tolist() == [2, 2, 2, 2]
    none = refused(shortest_path, q, start, shut=[[6, 9], [1, 4], [5, 8]], **o)
    assert none.counts == {"velocity, joint 1": 2, "shut edges": 1}


def test_a_layer_of_closed_vertices_is_empty():
    q, start = np.zeros((6, 1)), [0, 2, 4, 6]
    for k in range(3):
        cost = np.zeros(6)
        cost[2 * k : 2 * k + 2] = np.inf
        o = {"vertex_cost": cost} | ONE
        for search in (shortest_path, interrupted_path, slowed_path):
            broken = refused(search, q, start, **o)
            assert broken.node == k - 1
            assert broken.counts == {"closed vertices": 2}
        broken = refused(shortest_path, q, start, method="paper", **o)
        assert broken.counts == {"closed vertices": 2}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shut": [[0, 1]]}, r"shut: an edge leads .* next layer, got \[0, 1\]"),
        ({"shut": [[0, 4]]}, "next layer"),
        ({"shut": [[2, 0]]}, "next layer"),
        ({"shut": [[-1, 2]]}, "next layer"),
        ({"shut": [[4, 6]]}, "next layer"),
        ({"shut": [0, 2]}, "shut: expected shape"),
        ({"shut": [[0.5, 2]]}, "shut: expected whole numbers"),
        ({"vertex_cost": np.full(6, -np.inf)}, "but not -inf"),
        ({"vertex_cost": np.full(6, np.nan)}, "vertex_cost"),
    ],
)
def test_bad_closures_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        shortest_path(np.zeros((6, 1)), [0, 2, 4, 6], **ONE | change)


def test_what_is_fastest_knows_no_cost_of_vertices():
    with pytest.raises(InputError, match="a vertex is open"):
        least_interval(
            np.zeros((4, 1)), [0, 2, 4], velocity=[1], acceleration=[1], vertex_cost=np.ones(4)
        )
