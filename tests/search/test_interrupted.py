"""The fewest interruptions against a recursion over their number; the edges of the answer."""

import itertools

import numpy as np
import pytest
from tests.search.posed import interrupted_path

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.search import piece_spans

ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [0.1]}


def instance(rng, **sizes):
    """A random instance whose accelerations are tight enough to interrupt some."""
    q, start, o = naive.random_instance(rng, **sizes)
    for name in ("posture", "method"):
        del o[name]
    o["acceleration"] = o["acceleration"] * rng.choice([0.05, 0.2, 0.5, 1.0])
    return q, start, o


def cut(q, start, pieces, o):
    """The edges (K-1, n) that are cut and the vertex costs of all visits; checks (6) in pieces."""
    bound = o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 2e-9
    edges, visits, at = [], [], 0
    for piece in pieces:
        assert piece.first == at
        assert len(piece.index) >= min(2, len(start) - 1)
        vertices = start[at : at + len(piece.index)] + piece.index
        assert (vertices < start[at + 1 : at + 1 + len(piece.index)]).all()
        d = naive.difference(q[vertices[:-1]], q[vertices[1:]], o["endless"])
        assert (np.abs(np.diff(d, axis=0)) <= bound).all()
        edges += list(d)
        visits += list(o["vertex_cost"][vertices])
        at += len(piece.index) - 1
    assert at == len(start) - 2
    return np.array(edges).reshape(-1, q.shape[1]), visits


def agree(rng, make=instance, *, long=False, **sizes):
    """Compare one random instance with the oracle; return the number of interruptions or None."""
    q, start, o = make(rng, **sizes)
    least = {}
    if long:
        s = np.cumsum(rng.choice([0.5, 1.0, 1.0, 1.5], size=len(start) - 1))
        least = {"s": s, "least_piece": rng.choice([0.4, 1.2, 1.6, 2.5, 3.3])}
    want = naive.interrupted(q, start, **least, **o)
    if want is None:
        with pytest.raises(NoFeasiblePath) as caught:
            interrupted_path(q, start, **least, **o)
        assert caught.value.proved
        return None
    got = interrupted_path(q, start, **least, **o)
    if long and got.interruptions:
        ends = [*(p.first for p in got.pieces), len(start) - 2]
        assert (np.diff(s[ends]) >= least["least_piece"] - 1e-9).all()
    assert got.optimal
    assert got.interruptions == want[0]
    edges, visits = cut(q, start, got.pieces, o)
    assert (np.abs(edges) <= o["eta_v"] * o["velocity"] * o["dt"] + 2e-9).all()
    parts = [naive.distance(d, o["weights"], o["metric"]) for d in edges] + visits
    # Rounding only: sums of the same numbers in another order.
    assert got.cost == pytest.approx(want[1], rel=1e-10, abs=1e-12)
    assert got.cost == pytest.approx((max if o["objective"] == "max" else sum)(parts), rel=1e-10)
    assert sum(parts) == pytest.approx(want[2], rel=1e-10, abs=1e-12)
    return got.interruptions


@pytest.mark.parametrize("count", [500, pytest.param(3000, marks=pytest.mark.slow)])
def test_number_and_cost_agree_with_trying_everything(count):
    rng = np.random.default_rng(31 + count)
    seen = [agree(rng, layers=(1, 12), size=(1, 9)) for _ in range(count)]
    assert min(seen.count(None), *(seen.count(i) for i in range(4))) > count / 40
    assert max(i for i in seen if i is not None) > 4


def rewarded(rng, **sizes):
    """An instance whose vertices cost less than nothing, some of them."""
    q, start, o = instance(rng, **sizes)
    return q, start, o | {"vertex_cost": o["vertex_cost"] - 2 * rng.random(len(q))}


def test_costs_below_zero_count_at_every_visit():
    rng = np.random.default_rng(38)
    seen = [agree(rng, rewarded, layers=(1, 12), size=(1, 9)) for _ in range(200)]
    seen += [agree(rng, rewarded, long=True, layers=(2, 10), size=(1, 7)) for _ in range(200)]
    assert min(seen.count(None), *(seen.count(i) for i in range(3))) > 10


def tracks(rng):
    """Overlapping stretches that are held without a change: much freedom where to interrupt."""
    K, spans = int(rng.integers(14, 24)), [(0, int(rng.integers(3, 7)))]
    while spans[-1][1] < K - 1:
        a, b = spans[-1]
        spans.append((int(rng.integers(max(a + 1, b - 4), b + 1)), b + int(rng.integers(2, 7))))
    layers = [[10.0 * i for i, (a, b) in enumerate(spans) if a <= k <= b] for k in range(K)]
    start = np.cumsum([0, *map(len, layers)])
    o = {
        "dt": 1.0, "velocity": np.ones(1), "acceleration": np.ones(1), "endless": np.zeros(1, bool),
        "weights": np.ones(1), "metric": "manhattan", "objective": rng.choice(["sum", "max"]),
        "eta_v": 1.0, "eta_a": 1.0, "vertex_cost": rng.uniform(0.1, 1, size=start[-1]).round(1),
    }  # fmt: skip
    return np.concatenate(layers)[:, None], start, o


@pytest.mark.parametrize(("make", "count"), [(instance, 400), (tracks, 200)])
def test_pieces_of_a_least_length_agree_with_trying_everything(make, count, monkeypatch):
    looked_at = []
    tight = piece_spans._tight
    monkeypatch.setattr(
        piece_spans, "_tight", lambda *given: looked_at.append(given) or tight(*given)
    )
    rng = np.random.default_rng(35 + count)
    seen = [agree(rng, make, long=True) for _ in range(count)]
    cut = sum(bool(i) for i in seen)
    assert min(seen.count(None), cut) > count / 20
    assert max(i for i in seen if i is not None) > 4
    if make is tracks:  # spans had to be halved
        assert len(looked_at) > cut + 5


def test_a_least_length_moves_an_interruption_or_refuses():
    # Three vertices in a row at a time go straight; the greedy reach leaves one edge at the end.
    q = [[0.0], [0.5], [1.0], [1.0], [1.0], [1.0]]
    s = np.arange(6) * 0.01

    def ends(**least):
        cut = interrupted_path(q, np.arange(7), weights=[1.0], **least, **ONE)
        return [p.first for p in cut.pieces]

    assert ends() == [0, 2]
    assert ends(s=s, least_piece=0.02) == [0, 2]
    with pytest.raises(
        NoFeasiblePath, match=r"pieces of 25 mm or more .* number of interruptions is 1"
    ) as e:
        ends(s=s, least_piece=0.025)
    assert (e.value.node, e.value.proved) == (2, True)


def test_a_least_length_needs_to_know_where_the_nodes_are():
    q = [[0.0], [0.5], [1.0]]
    for s, words in ((None, "got nothing"), ([0.0, 0.2, 0.1], "farther"), ([0.0, 1.0], "s: ")):
        with pytest.raises(InputError, match=words):
            interrupted_path(q, np.arange(4), s=s, least_piece=0.1, **ONE)


def test_the_oracle_itself_agrees_with_enumeration():
    rng = np.random.default_rng(32)
    interrupted = 0
    for i in range(240):
        q, start, o = instance(rng, layers=(1, 5), size=(1, 4))
        least = {"least_piece": 2.0} if i % 2 else {}
        want = naive.interrupted(q, start, **least, **o)
        best = min(plans(q, start, o, **least), default=None)
        assert (want is None) == (best is None)
        if want is not None:
            np.testing.assert_allclose(want, best, rtol=1e-9)
            interrupted += want[0] > 0
    assert interrupted > 20


def plans(q, start, o, least_piece=0):
    """(number, cost, sum) of every admissible plan, one by one."""
    bound_v = o["eta_v"] * o["velocity"] * o["dt"] + naive.TOLERANCE
    bound_a = o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + naive.TOLERANCE
    layers = [range(a, b) for a, b in itertools.pairwise(start)]
    inner = range(1, len(layers) - 1)
    for breaks in itertools.chain(*(itertools.combinations(inner, m) for m in range(len(layers)))):
        if breaks and (np.diff([0, *breaks, len(layers) - 1]) < least_piece).any():
            continue
        nodes = sorted([*range(len(layers)), *breaks])
        for path in itertools.product(*(layers[k] for k in nodes)):
            path = np.array(path)
            pieces = np.split(path, np.flatnonzero(np.diff(nodes) == 0) + 1)
            d = [naive.difference(q[p[:-1]], q[p[1:]], o["endless"]) for p in pieces]
            slow = all((np.abs(e) <= bound_v).all() for e in d)
            if slow and all((np.abs(np.diff(e, axis=0)) <= bound_a).all() for e in d):
                parts = [naive.distance(x, o["weights"], o["metric"]) for e in d for x in e]
                parts += list(o["vertex_cost"][path])
                yield len(breaks), (max if o["objective"] == "max" else sum)(parts), sum(parts)


def test_without_a_record_the_answer_is_the_same(change_effort):
    change_effort(recorded_states=3)
    rng = np.random.default_rng(33)
    assert sum(bool(agree(rng, layers=(4, 12))) for _ in range(200)) > 50


def test_a_path_that_exists_is_not_interrupted_and_is_the_best_one():
    rng = np.random.default_rng(34)
    same = 0
    for _ in range(200):
        q, start, o = instance(rng)
        try:
            path = shortest_path(q, start, **o)
        except NoFeasiblePath:
            continue
        whole = interrupted_path(q, start, **o)
        assert whole.interruptions == 0
        assert whole.cost == path.cost
        np.testing.assert_array_equal(whole.pieces[0].index, path.index)
        same += 1
    assert same > 50


def test_one_vertex_a_layer_stops_where_the_turn_is_too_sharp():
    q = [[0.0], [0.5], [1.0], [1.0], [1.0]]
    plan = interrupted_path(q, np.arange(6), weights=[1.0], vertex_cost=[1.0] * 5, **ONE)
    assert [(p.first, p.index.tolist()) for p in plan.pieces] == [(0, [0, 0, 0]), (2, [0, 0, 0])]
    # Node 2 is visited before and after the interruption.
    assert plan.cost == pytest.approx(1.0 + 6.0)


def test_the_piece_after_begins_at_whichever_vertex_is_best():
    # The fast way over 0.5 cannot be entered from rest: from 0.1 the robot moves over to it.
    q = [[0.0], [0.0], [0.1], [0.5], [0.9]]
    plan = interrupted_path(q, [0, 1, 2, 4, 5], weights=[1.0], **ONE)
    assert [(p.first, p.index.tolist()) for p in plan.pieces] == [(0, [0, 0, 0]), (2, [1, 0])]
    assert plan.cost == pytest.approx(0.1 + 0.4)


def test_one_layer_is_one_piece():
    plan = interrupted_path([[0.0], [9.0]], [0, 2], vertex_cost=[2.0, 1.0], **ONE)
    assert [(p.first, p.index.tolist()) for p in plan.pieces] == [(0, [1])]
    assert (plan.cost, plan.interruptions) == (1.0, 0)


@pytest.mark.parametrize(
    ("start", "node"), [([0, 0, 1, 2], -1), ([0, 1, 1, 2], 0), ([0, 1, 2, 2], 1), ([0, 2, 2, 2], 0)]
)
def test_no_interruption_fills_an_empty_layer(start, node):
    with pytest.raises(NoFeasiblePath, match="is empty") as caught:
        interrupted_path([[0.0], [0.1]], start, **ONE)
    assert (caught.value.node, caught.value.proved) == (node, True)


def test_no_interruption_helps_an_edge_that_is_too_fast():
    q = [[0.0], [0.5], [0.5], [9.0], [8.0]]
    with pytest.raises(NoFeasiblePath, match="from node 2 to node 3") as caught:
        interrupted_path(q, [0, 1, 2, 3, 5], **ONE)
    assert (caught.value.node, caught.value.counts) == (2, {"velocity, joint 1": 2})


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="metric: expected one of"):
        interrupted_path([[0.0]], [0, 1], metric="taxi", **ONE)
