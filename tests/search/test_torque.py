"""The exact search under torque limits, against trying every pair of edges with pinocchio."""

import numpy as np
import pytest
from tests.arms import oracle_of, random_arm
from tests.search.test_exact import cost_of, instance

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.limits import Limits, TorqueLimit
from kerfpath.losses import Loss
from kerfpath.search import SearchProblem, find_interrupted, find_least_interval, find_slowed


def torque_instance(rng, closure, **sizes):
    """An instance whose torque limits bind: set from what its best path without them asks for."""
    q, start, o = instance(rng, closure, **sizes)
    n, K = q.shape[1], len(start) - 1
    arm, model = random_arm(rng, n)
    # Steps at a rate at which gravity, velocities and accelerations all have a share.
    o["velocity"], o["acceleration"] = o["velocity"] * o["dt"], o["acceleration"] * o["dt"] ** 2
    o["dt"] = float(rng.uniform(0.15, 0.6))
    o["velocity"], o["acceleration"] = o["velocity"] / o["dt"], o["acceleration"] / o["dt"] ** 2
    bound = np.full(n, 30.0)
    try:
        best = shortest_path(q, start, closure=closure, **o)
    except NoFeasiblePath:
        best = None
    if best is not None and K > 2:
        path = q[start[:-1] + best.index]
        d, dt = naive.difference(path[:-1], path[1:], o["endless"]), o["dt"]
        tau = arm.torque(path[1:-1], (d[1:] + d[:-1]) / (2 * dt), np.diff(d, axis=0) / dt**2)
        # What it asks for, or less of some joint, or more.
        bound = np.abs(tau).max(axis=0) * rng.choice([0.8, 0.95, 1.0, 1.3, 2.0], n) + 1e-6
    return q, start, o, TorqueLimit(bound=bound, dynamics=arm), oracle_of(model, bound, o["dt"])


def agree(rng, closure, **sizes):
    """Compare an instance with the oracle; return whether torques closed it or made it dearer."""
    q, start, o, torque, kept = torque_instance(rng, closure, **sizes)
    want = naive.second_order(q, start, closure, kept=kept, **o)
    free = naive.second_order(q, start, closure, **o)
    if want is None:
        with pytest.raises(NoFeasiblePath) as caught:
            shortest_path(q, start, closure=closure, torque=torque, **o)
        assert caught.value.proved
        return "open" if free is None else "closed"
    got = shortest_path(q, start, closure=closure, torque=torque, **o)
    assert got.optimal
    path = q[start[:-1] + got.index]
    d = naive.difference(path[:-1], path[1:], o["endless"])
    if len(d) > 1:
        assert kept(path[1:-1], d[:-1], d[1:]).all()
    if closure == "periodic" and len(d) > 0:
        assert kept(path[:1], d[-1:], d[:1]).all()
    largest, total = cost_of(path, start, got.index, o)
    # Rounding only: sums of the same numbers in another order.
    assert got.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
    assert got.cost == pytest.approx(largest if o["objective"] == "max" else total, rel=1e-10)
    assert total == pytest.approx(want[1], rel=1e-10, abs=1e-12)
    return "dearer" if want[0] > free[0] * (1 + 1e-9) else "same"


@pytest.mark.parametrize("closure", ["free", "periodic"])
def test_the_optimum_agrees_with_trying_every_pair_of_edges(closure):
    rng = np.random.default_rng(77)
    seen = [agree(rng, closure, layers=(1, 7), size=(1, 9)) for _ in range(200)]
    # Limits that bind, and limits that close the way.
    assert seen.count("dearer") >= 10
    assert seen.count("closed") >= 10


def posed(seed=3):
    """An instance whose torque limits make the best path dearer."""
    rng = np.random.default_rng(seed)
    while True:
        q, start, o, torque, kept = torque_instance(rng, "free", layers=(6, 8), size=(5, 8))
        found = [naive.second_order(q, start, "free", kept=k, **o) for k in (kept, None)]
        if found[0] is not None and found[0][0] > found[1][0] * 1.01:
            return q, start, o, torque


def test_limits_that_do_not_bind_change_nothing():
    q, start, o, torque = posed()
    wide = TorqueLimit(bound=torque.bound * 1e6, dynamics=torque.dynamics)
    free, loose = (shortest_path(q, start, torque=t, **o) for t in (None, wide))
    np.testing.assert_array_equal(free.index, loose.index)
    assert free.cost == loose.cost < shortest_path(q, start, torque=torque, **o).cost


def test_a_path_and_its_reverse_are_as_good():
    q, start, o, torque = posed()
    sizes = np.diff(start)
    back = np.concatenate([[0], np.cumsum(sizes[::-1])])
    order = np.concatenate([np.arange(start[k], start[k + 1]) for k in range(len(sizes))[::-1]])
    turned = {**o, "vertex_cost": o["vertex_cost"][order], "posture": o["posture"][order]}
    one = shortest_path(q, start, torque=torque, **o)
    other = shortest_path(q[order], back, torque=torque, **turned)
    assert other.cost == pytest.approx(one.cost, rel=1e-12)


def test_a_rotation_limit_and_torque_limits_hold_together():
    rng = np.random.default_rng(8)
    seen = 0
    while seen < 12:
        q, start, o, torque, kept = torque_instance(rng, "free", layers=(3, 5), size=(2, 5))
        if not o["endless"].any():
            continue
        turning = rng.uniform(0.3, 3.0)
        rotation = np.where(o["endless"], turning, np.inf)
        # Every path by hand.
        best = np.inf
        for index in np.ndindex(*np.diff(start)):
            path = q[start[:-1] + np.array(index)]
            d = naive.difference(path[:-1], path[1:], o["endless"])
            slow = (np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + 1e-9).all()
            sharp = o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 1e-9
            turned = np.abs(np.cumsum(d, axis=0))[:, o["endless"]].max(initial=0.0)
            gentle = (np.abs(np.diff(d, axis=0)) <= sharp).all() and turned <= turning
            if slow and gentle and kept(path[1:-1], d[:-1], d[1:]).all():
                costs = cost_of(path, start, np.array(index), o)
                best = min(best, costs[0 if o["objective"] == "max" else 1])
        if best == np.inf:
            with pytest.raises(NoFeasiblePath):
                shortest_path(q, start, torque=torque, rotation=rotation, **o)
            continue
        got = shortest_path(q, start, torque=torque, rotation=rotation, **o)
        assert got.cost == pytest.approx(best, rel=1e-10)
        seen += 1


def test_no_path_says_which_torque_forbids_it():
    """A joint that lies level and may only be still: its torque is that of gravity."""
    arm, _ = random_arm(np.random.default_rng(5), 2)
    q = np.zeros((3, 2))
    still = arm.torque(q[:1], q[:1], q[:1])[0]
    assert abs(still[1]) > 1e-3
    one = {"dt": 0.1, "velocity": [1.0, 1.0], "acceleration": [1.0, 1.0]}
    for share in (0.99, 1.01):
        bound = np.abs(still) * [2.0, share] + 1e-9
        limit = TorqueLimit(bound=bound, dynamics=arm)
        if share > 1:
            assert shortest_path(q, [0, 1, 2, 3], torque=limit, **one).optimal
            continue
        with pytest.raises(NoFeasiblePath, match="forbidden by torque, joint 2: 1") as caught:
            shortest_path(q, [0, 1, 2, 3], torque=limit, **one)
        assert caught.value.node == 1
        assert [reason.loss for reason in caught.value.counts] == [Loss.TORQUE]


def test_searches_that_do_not_know_torques_refuse_them():
    q, start, o, torque = posed()
    for method in ("paper", "known"):
        with pytest.raises(InputError, match='torque: a limit needs method="exact"'):
            shortest_path(q, start, torque=torque, **{**o, "method": method})
    limits = Limits.of(o["velocity"], o["acceleration"], torque=torque)
    problem = SearchProblem(q=q, start=start, dt=o["dt"], limits=limits)
    for search in (find_least_interval, find_slowed):
        with pytest.raises(InputError, match="limits on the torque are not supported"):
            search(problem)
    other, _ = random_arm(np.random.default_rng(1), q.shape[1] + 1)
    limit = TorqueLimit(bound=np.ones(q.shape[1] + 1), dynamics=other)
    with pytest.raises(InputError, match=r"torque: expected shape \(\d\)"):
        shortest_path(q, start, torque=limit, **o)


def test_pieces_keep_torque_limits():
    """Where it may be interrupted, each piece keeps them at the nodes inside it."""
    q, start, o, torque = posed()
    tight = TorqueLimit(bound=torque.bound * 0.7, dynamics=torque.dynamics)
    for limit in (torque, tight):
        asked = Limits.of(
            o["velocity"], o["acceleration"], eta_v=o["eta_v"], eta_a=o["eta_a"], torque=limit
        )
        found = find_interrupted(
            SearchProblem(q=q, start=start, dt=o["dt"], limits=asked, endless=o["endless"])
        )
        for piece in found.pieces:
            nodes = slice(piece.first, piece.first + len(piece.index))
            path = q[start[nodes] + piece.index]
            d = naive.difference(path[:-1], path[1:], o["endless"])
            tau = np.full(len(d), o["dt"])
            shares = limit.shares(np.vstack([path[:1], path[:1] + np.cumsum(d, axis=0)]), tau)
            assert (np.abs(shares) <= 1 + 1e-9).all()
