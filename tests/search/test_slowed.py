"""The path to be slowed down, against trying every pair of edges; its edges, bad input."""

import itertools

import numpy as np
import pytest
from tests.search.posed import slowed_path

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.search import slowed as slowed_module

ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0]}


def instance(rng, below=0.0, **sizes):
    q, start, o = naive.random_instance(rng, **sizes)
    if below:
        o["vertex_cost"] = o["vertex_cost"] - below * rng.random(len(q))
    for name in ("posture", "objective", "method"):
        o.pop(name)
    o["velocity"] = o["velocity"] * rng.choice([1, 0.3])
    o["acceleration"] = o["acceleration"] * rng.choice([1, 0.1, 0.01])
    return q, start, o | {"penalty": float(rng.choice([0.3, 3, 100]))}


def price_of(q, start, index, o):
    """Cost of one path by its definition, and the time that each step loses."""
    path = q[start[:-1] + index]
    d = naive.difference(path[:-1], path[1:], o["endless"])
    time = (np.abs(d) / (o["eta_v"] * o["velocity"] * o["dt"])).max(axis=1)
    limit = o["eta_a"] * o["acceleration"] * o["dt"] ** 2
    time[1:] = np.maximum(time[1:], np.sqrt(np.abs(np.diff(d, axis=0)) / limit).max(axis=1))
    lost = np.maximum(0, time - 1)
    rho = sum(naive.distance(step, o["weights"], o["metric"]) for step in d)
    return rho + o["vertex_cost"][start[:-1] + index].sum() + o["penalty"] * lost.sum(), lost


def agree(rng, **sizes):
    q, start, o = instance(rng, **sizes)
    got = slowed_path(q, start, **o)
    cost, lost = price_of(q, start, got.index, o)
    # Rounding only: sums of the same numbers in another order.
    assert got.cost == pytest.approx(naive.slowed(q, start, **o), rel=1e-10, abs=1e-12)
    assert got.cost == pytest.approx(cost, rel=1e-10, abs=1e-12)
    np.testing.assert_allclose(got.lost, lost, rtol=1e-9, atol=1e-12)
    return lost.sum() > 0


@pytest.mark.slow
def test_the_optimum_agrees_with_trying_every_pair_of_edges():
    rng = np.random.default_rng(51)
    lost = sum(agree(rng, layers=(1, 9), size=(1, 12)) for _ in range(2000))
    assert 500 < lost < 1900


@pytest.mark.slow
@pytest.mark.parametrize(("stretch", "corner", "around"), [(1.01, 1e-3, 1), (1.5, 1e-9, 2)])
def test_where_the_search_begins_does_not_change_the_answer(
    monkeypatch, change_effort, stretch, corner, around
):
    monkeypatch.setattr(slowed_module, "FIRST_STRETCH", stretch)
    monkeypatch.setattr(slowed_module, "CORNER", corner)
    monkeypatch.setattr(slowed_module, "AROUND", around)
    change_effort(recorded_states=30)
    rng = np.random.default_rng(52)
    for _ in range(400):
        agree(rng, layers=(1, 14), size=(1, 10))


def test_costs_below_zero_change_nothing_but_the_optimum(change_effort):
    change_effort(recorded_states=30)
    rng = np.random.default_rng(56)
    for _ in range(300):
        agree(rng, below=rng.choice([0.3, 20.0]), layers=(1, 9), size=(1, 10))


def test_the_oracle_itself_agrees_with_enumeration():
    rng = np.random.default_rng(53)
    for _ in range(150):
        q, start, o = instance(rng, layers=(2, 5), size=(1, 4))
        paths = itertools.product(*[range(m) for m in np.diff(start)])
        best = min(price_of(q, start, np.array(path), o)[0] for path in paths)
        assert naive.slowed(q, start, **o) == pytest.approx(best, rel=1e-9)


def test_where_a_path_keeps_its_time_and_time_is_dear_it_is_the_shortest():
    rng = np.random.default_rng(54)
    compared = 0
    for _ in range(400):
        q, start, o = naive.random_instance(rng)
        for name in ("posture", "objective", "method"):
            o.pop(name)
        try:
            want = shortest_path(q, start, **o)
        except NoFeasiblePath:
            continue
        got = slowed_path(q, start, penalty=1e6, **o)
        assert not got.lost.any()
        assert got.cost == pytest.approx(want.cost, rel=1e-10, abs=1e-12)
        compared += 1
    assert compared > 100


def test_less_is_lost_where_time_is_dearer():
    rng = np.random.default_rng(55)
    for _ in range(100):
        q, start, o = instance(rng, layers=(3, 9), size=(4, 12))
        lost = [slowed_path(q, start, **(o | {"penalty": p})).lost.sum() for p in (0.1, 1, 10, 100)]
        assert (np.diff(lost) <= 1e-9).all()


def test_the_only_path_loses_what_its_steps_ask_for():
    q = [[0.0], [2.0], [2.5], [2.5]]
    path = slowed_path(q, [0, 1, 2, 3, 4], weights=[0.0], penalty=10.0, **ONE)
    np.testing.assert_allclose(path.lost, [1.0, np.sqrt(1.5) - 1, 0.0])
    assert path.cost == pytest.approx(10 * np.sqrt(1.5))


def test_one_layer_takes_its_cheapest_vertex():
    path = slowed_path([[0.0], [1.0]], [0, 2], vertex_cost=[2.0, 1.0], **ONE)
    assert (path.index.tolist(), path.cost, len(path.lost)) == ([1], 1.0, 0)


def test_an_empty_layer_and_bad_input_are_refused():
    with pytest.raises(NoFeasiblePath, match="layer 1 is empty"):
        slowed_path([[0.0], [0.1]], [0, 1, 1, 2], **ONE)
    with pytest.raises(InputError, match="penalty: expected a number above 0"):
        slowed_path([[0.0]], [0, 1], penalty=0.0, **ONE)
    with pytest.raises(InputError, match="weights: must not be negative"):
        slowed_path([[0.0]], [0, 1], weights=[-1.0], **ONE)
    with pytest.raises(InputError, match="metric: expected one of"):
        slowed_path([[0.0]], [0, 1], metric="taxi", **ONE)
    with pytest.raises(InputError, match="at least one joint"):
        slowed_path(np.zeros((1, 0)), [0, 1], dt=1.0, velocity=[], acceleration=[])
