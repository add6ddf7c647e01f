"""Limits on the accumulated rotation of endless joints, against trying every path."""

import numpy as np
import pytest

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path

INF = np.inf


def instance(rng, closure):
    """A random instance whose endless joints turn on, and are limited about where it matters."""
    long = {"layers": (3, 7), "size": (2, 5)}
    wide = {"layers": (3, 5), "size": (2, 9)}
    q, start, o = naive.random_instance(rng, **(long if rng.random() < 0.5 else wide))
    K, endless = len(start) - 1, o["endless"]
    endless[0] = True
    turns = rng.integers(-1, 2, len(endless)) if closure == "periodic" else rng.normal(0, 1, 1)
    step = np.where(endless, 2 * np.pi * turns / K, 0.0)
    q = q + np.repeat(np.arange(K), np.diff(start))[:, None] * step
    o["velocity"] = rng.uniform(1, 2) * o["velocity"] + np.abs(step) / o["dt"]
    o["acceleration"] = rng.choice([1.0, 2.0, 4.0]) * o["acceleration"]
    o["method"] = "exact"
    if closure == "periodic":
        first = q[: start[1]] + 2 * np.pi * endless
        q, start = np.vstack([q, first]), np.append(start, len(q) + start[1])
        for name in ("posture", "vertex_cost"):
            o[name] = np.concatenate([o[name], o[name][: start[1]]])
    limit = rng.uniform(0, 4, len(endless))
    free = feasible(q, start, closure, o)
    if free is not None:
        limit = turned(q[start[:-1] + free.index], endless) * rng.uniform(0.3, 1.3)
    rotation = np.where(endless & (rng.random(len(endless)) < 0.8), limit, INF)
    return q, start, rotation, o


def lattice(rng, closure):
    """An instance of many steps of half a turn, its limits whole steps."""
    q, start, o = naive.lattice_instance(rng)
    o |= {"method": "exact"}
    o["endless"][0] = True
    if closure == "periodic":
        q, start = np.vstack([q, q[: start[1]]]), np.append(start, len(q) + start[1])
        for name in ("posture", "vertex_cost"):
            o[name] = np.concatenate([o[name], o[name][: start[1]]])
    limit = np.pi / 2 * rng.integers(1, 6, len(o["endless"])) + 1e-3
    return q, start, np.where(o["endless"] & (rng.random(q.shape[1]) < 0.8), limit, INF), o


def turned(path, endless):
    """Largest angle (n,) that each joint turns away from where the path (K, n) begins."""
    return np.abs(np.cumsum(naive.difference(path[:-1], path[1:], endless), axis=0)).max(axis=0)


def feasible(q, start, closure, o, rotation=None):
    try:
        return shortest_path(q, start, closure=closure, rotation=rotation, **o)
    except NoFeasiblePath:
        return None


def agree(rng, closure, make=instance):
    """Compare one random instance with the oracle; return what the limits made of it."""
    q, start, rotation, o = make(rng, closure)
    want = naive.rotated(q, start, closure, rotation, **o)
    free = feasible(q, start, closure, o)
    if want is None:
        with pytest.raises(NoFeasiblePath) as caught:
            shortest_path(q, start, closure=closure, rotation=rotation, **o)
        assert caught.value.proved
        node_agrees(q, start, rotation, o, caught.value.node)
        if free is None:
            sooner = "rotation limit" in str(caught.value)
            with pytest.raises(NoFeasiblePath) as unlimited:
                shortest_path(q, start, closure=closure, **o)
            assert sooner == (caught.value.node < unlimited.value.node)
            return "closed sooner" if sooner else "no path"
        assert "rotation limit" in str(caught.value)
        reason_agrees(q, start, closure, rotation, o, caught.value)
        return "closed"
    got = shortest_path(q, start, closure=closure, rotation=rotation, **o)
    assert got.optimal
    path = start[:-1] + got.index
    d = naive.difference(q[path[:-1]], q[path[1:]], o["endless"])
    assert (np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + 2e-9).all()
    assert (turned(q[path], o["endless"]) <= rotation + 2e-9).all()
    if closure == "periodic":
        assert got.index[0] == got.index[-1]
        d = np.vstack([d, d[0]])
    bound = o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 2e-9
    assert (np.abs(np.diff(d, axis=0)) <= bound).all()
    d = d[: len(start) - 2]
    parts = [naive.distance(r, o["weights"], o["metric"]) for r in d] + list(o["vertex_cost"][path])
    # Rounding only: sums of the same numbers in another order.
    assert got.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
    assert got.cost == pytest.approx((max if o["objective"] == "max" else sum)(parts), rel=1e-10)
    assert sum(parts) == pytest.approx(want[1], rel=1e-10, abs=1e-12)
    if (turned(q[start[:-1] + free.index], o["endless"]) > rotation + 1e-9).any():
        return "other"
    np.testing.assert_array_equal(got.index, free.index)
    return "as without"


def reason_agrees(q, start, closure, rotation, o, broken):
    """The joints that are named, and the last node that is reached, by the oracle."""

    def passes(limited):
        only = np.where(np.isin(np.arange(len(rotation)), limited), rotation, INF)
        return naive.rotated(q, start, closure, only, **o) is not None

    limited = np.flatnonzero(np.isfinite(rotation))
    named = [i for i in limited if f"joint {i + 1} (" in str(broken)]
    opening = [i for i in limited if passes(np.setdiff1d(limited, i))]
    assert named == opening or not (opening or passes(named))
    assert ("without rotation limits" in str(broken)) == (opening == [])


def node_agrees(q, start, rotation, o, last):
    """The last node that a path within the limits reaches, by the oracle."""

    def passable(node):
        part = slice(start[node + 1])
        cut = o | {name: o[name][part] for name in ("posture", "vertex_cost")}
        return naive.rotated(q[part], start[: node + 2], "free", rotation, **cut) is not None

    K = len(start) - 1
    assert last == 0 or passable(last)
    assert last == K - 1 or not passable(last + 1)


@pytest.mark.parametrize("closure", ["free", "periodic"])
@pytest.mark.parametrize("count", [300, pytest.param(1500, marks=pytest.mark.slow)])
def test_the_optimum_agrees_with_trying_every_path(closure, count):
    rng = np.random.default_rng(41 + count)
    seen = [agree(rng, closure) for _ in range(count)]
    kinds = "no path", "closed", "other", "as without"
    assert min(seen.count(kind) for kind in kinds) > count / 50
    assert seen.count("closed sooner") > count / 100


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_half_a_turn_goes_one_way_within_limits_too(closure):
    rng = np.random.default_rng(45)
    seen = [agree(rng, closure, lattice) for _ in range(400)]
    kinds = "no path", "closed", "other", "as without"
    assert min(seen.count(kind) for kind in kinds) > 4


ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [9.0], "endless": [True], "weights": [1.0]}
"""An endless joint whose steps are at most 1 rad."""
TURNING = np.linspace(0, 4 * np.pi, 15)[:, None]
"""Two turns in 15 layers of one vertex."""


def test_a_limit_of_zero_holds_the_joint_still():
    q, dear = [[0.0], [0.5], [0.1], [0.5], [0.1], [0.5]], [0.0, 1.0] * 3
    assert shortest_path(q, [0, 2, 4, 6], vertex_cost=dear, **ONE).cost == pytest.approx(0.1)
    path = shortest_path(q, [0, 2, 4, 6], vertex_cost=dear, rotation=[0.0], **ONE)
    np.testing.assert_array_equal(path.index, [1, 1, 1])
    with pytest.raises(NoFeasiblePath, match=r"joint 1 \(0 rad\) leaves no path from node 1 on"):
        shortest_path(q[:5], [0, 2, 4, 5], rotation=[0.0], **ONE)


def test_the_way_round_counts_turn_after_turn():
    start = np.arange(16)
    free = shortest_path(TURNING, start, **ONE)
    path = shortest_path(TURNING, start, rotation=[4 * np.pi], **ONE)
    assert path.cost == free.cost == pytest.approx(4 * np.pi)
    with pytest.raises(NoFeasiblePath, match="from node 13 on; without it there is") as caught:
        shortest_path(TURNING, start, rotation=[4 * np.pi - 0.01], **ONE)
    assert (caught.value.proved, caught.value.node, caught.value.back) == (True, 13, None)


def test_a_vertex_on_another_turn_is_another_place():
    # On from 330 degrees, 20 are 380: nearer than 240, but beyond the limit.
    degrees = [0, 90, 180, 260, 330, 20, 240, 300]
    start = [0, 1, 2, 3, 4, 5, 7, 8]
    near = {**ONE, "velocity": [2.0]}
    q = np.radians(degrees)[:, None]
    assert shortest_path(q, start, **near).index[5] == 0
    path = shortest_path(q, start, rotation=[np.radians(340)], **near)
    assert path.index[5] == 1


def test_a_limit_larger_than_needed_changes_nothing():
    rng = np.random.default_rng(44)
    same = 0
    for closure in ("free", "periodic"):
        for _ in range(100):
            q, start, _, o = instance(rng, closure)
            path = feasible(q, start, closure, o)
            if path is None:
                continue
            most = turned(q[start[:-1] + path.index], o["endless"])
            limited = feasible(q, start, closure, o, np.where(o["endless"], most, INF))
            np.testing.assert_array_equal(limited.index, path.index)
            assert limited.cost == path.cost
            same += 1
    assert same > 50


def test_a_lap_that_turns_once_needs_a_limit_of_a_turn():
    q, start = TURNING[:8], np.arange(9)
    path = shortest_path(q, start, closure="periodic", rotation=[2 * np.pi], **ONE)
    assert path.cost == pytest.approx(2 * np.pi)
    with pytest.raises(NoFeasiblePath, match=r"joint 1 \(6 rad\) leaves no path; without it"):
        shortest_path(q, start, closure="periodic", rotation=[6.0], **ONE)


def test_limits_that_close_the_way_only_together_are_both_named():
    # Either joint can stay and leave the turning to the other.
    q = [[0.0, 0.0], [0.8, 0.0], [0.0, 0.8]]
    two = {"dt": 1.0, "velocity": [1.0] * 2, "acceleration": [9.0] * 2, "endless": [True] * 2}
    with pytest.raises(NoFeasiblePath, match=r"joint 1 .* and of joint 2 .* without any one of"):
        shortest_path(q, [0, 1, 3], rotation=[0.5, 0.5], **two)
    with pytest.raises(NoFeasiblePath, match=r"joint 1 .* and of joint 2 .* without rotation"):
        shortest_path([[0.0, 0.0], [0.8, 0.8]], [0, 1, 2], rotation=[0.5, 0.5], **two)
    with pytest.raises(NoFeasiblePath, match=r"of joint 2 \(0.5 rad\) leaves"):
        shortest_path([[0.0, 0.0], [0.4, 0.8]], [0, 1, 2], rotation=[0.5, 0.5], **two)


def test_where_the_limit_ends_all_paths_before_they_break_it_is_named():
    q = np.append(TURNING, [[99.0]], axis=0)[[*range(12), 15]]  # no step leads to the last node
    start = np.arange(14)
    with pytest.raises(NoFeasiblePath, match="no admissible edge from node 11 to") as caught:
        shortest_path(q, start, **ONE)
    assert (caught.value.node, caught.value.back) == (11, 12)
    said = (
        r"joint 1 \(3 rad\) leaves no path from node 3 on; without it there is a path to node 11, "
        "and there no admissible edge from node 11 to node 12"
    )
    with pytest.raises(NoFeasiblePath, match=said) as caught:
        shortest_path(q, start, rotation=[3.0], **ONE)
    assert (caught.value.proved, caught.value.node, caught.value.back) == (True, 3, None)
    with pytest.raises(NoFeasiblePath, match=r"^no admissible edge from node 11 to") as caught:
        shortest_path(q, start, rotation=[12.0], **ONE)
    assert (caught.value.node, caught.value.reached) == (11, None)


def test_one_layer_turns_nowhere():
    assert shortest_path([[1.0]], [0, 1], rotation=[0.0], **ONE).cost == 0.0


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"rotation": [1.0], "endless": [False]}, "joint 1 is not endless and already limited"),
        ({"rotation": [-1.0]}, "must not be negative"),
        ({"rotation": [np.nan]}, "must be a number, but rotation"),
        ({"rotation": [1.0, 1.0]}, "expected shape"),
        ({"rotation": [1.0], "method": "paper"}, 'needs method="exact"'),
    ],
)
def test_bad_input_is_refused(change, match):
    with pytest.raises(InputError, match=match):
        shortest_path([[0.0], [0.1]], [0, 1, 2], **(ONE | change))
