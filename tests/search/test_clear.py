"""The lazy search for a clear path against checking everything, on made-up checks."""

import itertools

import numpy as np
import pytest
from tests.search.posed import clear_path, interrupted_path, least_interval, slowed_path

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.search import CheckedEdges


class Checks:
    """Made-up prices of vertices and made-up closed edges, and how often each was asked about."""

    def __init__(self, rng, q, start, closure, vertices, edges, cost=0.0):
        N, K = len(q), len(start) - 1
        self.start = start
        self.price = np.where(rng.random(N) < vertices, np.inf, cost * rng.random(N))
        if closure == "periodic":
            self.price[start[-2] :] = self.price[: start[1]]
        self.open = [
            rng.random((start[k + 1] - start[k], start[k + 2] - start[k + 1])) >= edges
            for k in range(K - 1)
        ]
        self.vertices_asked = np.zeros(N, int)
        self.edges_asked = {}

    def known(self, q, around=None):
        checks = {"price": self.vertices, "passable": self.passable, "blocked": self.blocked}
        return CheckedEdges(q, self.start, around=around, **checks)

    def blocked(self, p, j):
        """Two in three of what is closed."""
        k = np.searchsorted(self.start, p, side="right") - 1
        closed = [
            not self.open[i][a - self.start[i], b - self.start[i + 1]]
            for i, a, b in zip(k, p, j, strict=True)
        ]
        return np.array(closed, bool) & ((p + j) % 3 > 0)

    @property
    def shut(self):
        edges = [np.argwhere(~m) + self.start[k : k + 2] for k, m in enumerate(self.open)]
        return np.concatenate([np.empty((0, 2), int), *edges])

    def require_open(self, index, first=0):
        start, rest = self.start[first:], self.open[first:]
        assert np.isfinite(self.price[start[: len(index)] + index]).all()
        edges = itertools.pairwise(index)
        assert all(m[a, b] for m, (a, b) in zip(rest, edges, strict=False))

    def vertices(self, v):
        self.vertices_asked[v] += 1
        return self.price[v]

    def passable(self, p, j):
        k = np.searchsorted(self.start, p, side="right") - 1
        assert (np.searchsorted(self.start, j, side="right") - 1 == k + 1).all()
        for edge in zip(p, j, strict=True):
            self.edges_asked[edge] = self.edges_asked.get(edge, 0) + 1
        return np.array(
            [
                self.open[i][a - self.start[i], b - self.start[i + 1]]
                for i, a, b in zip(k, p, j, strict=True)
            ]
        )


def instance(rng, closure, **sizes):
    q, start, o = naive.random_instance(rng, **sizes)
    # Looser limits than elsewhere: what closes the way here are the checks.
    o |= {"method": "exact", "velocity": 1.5 * o["velocity"], "acceleration": 3 * o["acceleration"]}
    if closure == "periodic":
        q = np.vstack([q, q[: start[1]] + 2 * np.pi * o["endless"]])
        start = np.append(start, len(q))
        for name in ("posture", "vertex_cost"):
            o[name] = np.concatenate([o[name], o[name][: start[1]]])
    return q, start, o


def beside(rng, q, start):
    """Neighbours in the order of the rows, in half of the cases none."""
    if rng.random() < 0.5:
        return None
    around = np.c_[np.arange(len(q)) - 1, np.append(np.arange(1, len(q)), -1)]
    inner = np.isin(np.arange(len(q)), start)
    around[inner, 0] = -1
    around[np.append(inner[1:], True), 1] = -1
    return around


def agree(rng, closure, share, cost=0.0, **sizes):
    """Compare one random instance with checking everything; returns what is known, or None."""
    q, start, o = instance(rng, closure, **sizes)
    checks = Checks(rng, q, start, closure, share * rng.random(), share * rng.random(), cost)
    all_of_it = o | {"vertex_cost": o["vertex_cost"] + checks.price}
    want = naive.second_order(q, start, closure, checks.open, **all_of_it)
    known = checks.known(q, beside(rng, q, start))
    o["closure"] = closure
    if want is None or want[0] == np.inf:
        with pytest.raises(NoFeasiblePath) as caught:
            clear_path(shortest_path, known, **o)
        assert caught.value.proved
    else:
        found = clear_path(shortest_path, known, **o)
        assert found.optimal
        assert found.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
        checks.require_open(found.index)
        assert closure == "free" or found.index[0] == found.index[-1]
    assert known.vertices_checked == checks.vertices_asked.sum()
    assert len(checks.edges_asked) <= known.edges_checked
    assert checks.vertices_asked.max() <= 1
    assert max(checks.edges_asked.values(), default=0) <= 1
    return None if want is None else known


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_the_lazy_optimum_is_that_of_checking_everything(share):
    rng = np.random.default_rng(31)
    found = [agree(rng, "free", share, layers=(1, 7), size=(1, 7)) for _ in range(400)]
    made = [f for f in found if f is not None]
    assert 100 < len(made) < 395
    assert sum(f.searches > 2 for f in made) > 20
    assert sum(f.edges_closed > 1 for f in made) > 15


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_the_same_holds_for_closed_paths(share):
    rng = np.random.default_rng(32)
    found = [agree(rng, "periodic", share, layers=(2, 7), size=(1, 6)) for _ in range(300)]
    made = [f for f in found if f is not None]
    assert len(made) > 60
    assert sum(f.edges_closed > 1 for f in made) > 10


def test_a_price_per_vertex_is_added_and_paid_only_where_it_is_worth_it():
    rng = np.random.default_rng(33)
    found = [agree(rng, "free", 0.2, cost=2.0, layers=(2, 6), size=(2, 7)) for _ in range(300)]
    assert sum(f is not None for f in found) > 150


def all_of(checks, o):
    """The closures as the searches take them, and what is open in the answer."""
    return {"shut": checks.shut, "vertex_cost": o.get("vertex_cost", 0.0) + checks.price}


SLOWED = ("dt", "velocity", "acceleration", "endless", "vertex_cost", "weights", "metric")
LEAST = ("velocity", "acceleration", "endless", "eta_v", "eta_a")


@pytest.mark.slow
@pytest.mark.parametrize("search", [interrupted_path, slowed_path, least_interval])
def test_every_search_finds_its_lazy_optimum(search):
    """The searches themselves are held against oracles with closures in `test_shut`."""
    rng, found, tried = np.random.default_rng(35), 0, 0
    for _ in range(250):
        q, start, o = instance(rng, "free", layers=(2, 9), size=(1, 8))
        checks = Checks(rng, q, start, "free", 0.6 * rng.random(), 0.6 * rng.random())
        if search is interrupted_path:
            o["acceleration"] = o["acceleration"] * 0.1
            o = {k: v for k, v in o.items() if k not in ("posture", "method")}
        else:
            o = {k: o[k] for k in (SLOWED if search is slowed_path else LEAST)}
        known = checks.known(q, beside(rng, q, start))
        try:
            want = search(q, start, **o | all_of(checks, o))
        except NoFeasiblePath:
            with pytest.raises(NoFeasiblePath, match=r"collision|velocity") as caught:
                clear_path(search, known, **o)
            assert caught.value.proved
            continue
        got = clear_path(search, known, **o)
        if search is interrupted_path:
            assert got.interruptions == want.interruptions
            for piece in got.pieces:
                checks.require_open(piece.index, piece.first)
        else:
            checks.require_open(got.index)
        cost = "dt" if search is least_interval else "cost"
        assert getattr(got, cost) == pytest.approx(getattr(want, cost), rel=1e-10, abs=1e-12)
        found += 1
        tried += known.searches > 2
    assert found > 100
    assert tried > 50


def test_within_rotation_limits_too():
    rng, found, other = np.random.default_rng(36), 0, 0
    for i in range(120):
        closure = ("free", "periodic")[i % 2]
        q, start, o = instance(rng, closure, layers=(3, 6), size=(2, 6))
        limit = np.where(o["endless"], rng.uniform(0.1, 1.5, q.shape[1]), np.inf)
        checks = Checks(rng, q, start, closure, 0.4 * rng.random(), 0.4 * rng.random())
        known = checks.known(q, beside(rng, q, start))
        o |= {"closure": closure, "rotation": limit}
        try:
            want = shortest_path(q, start, **o | all_of(checks, o))
        except NoFeasiblePath:
            with pytest.raises(NoFeasiblePath):
                clear_path(shortest_path, known, **o)
            continue
        got = clear_path(shortest_path, known, **o)
        assert got.cost == pytest.approx(want.cost, rel=1e-10, abs=1e-12)
        checks.require_open(got.index)
        found += 1
        other += known.edges_closed > 0
    assert found > 25
    assert other > 10


def test_what_one_search_learnt_serves_the_next():
    rng = np.random.default_rng(37)
    q, start, o = instance(rng, "free", layers=(8, 9), size=(8, 9))
    checks = Checks(rng, q, start, "free", 0.2, 0.2)
    known = checks.known(q)
    clear_path(shortest_path, known, **o)
    searches = known.searches
    assert searches > 1
    clear_path(shortest_path, known, **o)
    assert known.searches == searches + 1
    assert checks.vertices_asked.max() == 1
    assert max(checks.edges_asked.values()) == 1


def test_rings_around_closed_edges_save_searches():
    """A band of 40 x 30 vertices; between two layers only one corner of the edges is open."""
    x = np.linspace(-1, 1, 30)
    q, start = np.tile(x[:, None], (40, 1)), np.arange(0, 1201, 30)
    around = np.c_[np.arange(-1, 1199), np.append(np.arange(1, 1200), -1)]
    around[::30, 0] = around[29::30, 1] = -1
    o = {"dt": 1.0, "velocity": [0.3], "acceleration": [1.0], "metric": "chebychev"}

    def passable(p, j):
        return (p // 30 != 20) | ((p % 30 > 26) & (j % 30 > 26))

    taken, costs = [], []
    for neighbours in (None, around):
        known = CheckedEdges(
            q, start, price=lambda v: np.zeros(len(v)), passable=passable,
            blocked=lambda p, j: ~passable(p, j), around=neighbours,
        )  # fmt: skip
        costs.append(clear_path(shortest_path, known, **o).cost)
        taken.append(known.searches)
    assert costs[0] == costs[1]
    assert taken[0] > 25
    assert taken[1] < 10


def test_nothing_closed_costs_one_search_and_one_check_of_each_vertex_and_edge_of_the_path():
    rng = np.random.default_rng(34)
    q, start = rng.uniform(-1, 1, (300, 3)), np.arange(0, 301, 10)
    o = {"dt": 1.0, "velocity": np.full(3, 3.0), "acceleration": np.full(3, 9.0)}
    known = CheckedEdges(
        q, start, price=lambda v: np.zeros(len(v)), passable=lambda p, j: np.ones(len(p), bool)
    )
    found = clear_path(shortest_path, known, **o)
    assert (known.searches, known.vertices_checked, known.edges_checked) == (1, 30, 29)
    np.testing.assert_array_equal(found.index, shortest_path(q, start, **o).index)


def test_most_of_a_graph_is_never_looked_at():
    """A wall with one hole across a drifting band of 100 layers by 50 vertices."""
    x = np.linspace(-1, 1, 50)
    q = np.tile(x[:, None], (100, 1))
    start = np.arange(0, 5001, 50)
    o = {"dt": 1.0, "velocity": [0.1], "acceleration": [1.0], "metric": "chebychev"}
    layer = np.repeat(np.arange(100), 50)
    closed = np.isin(layer, range(40, 60)) & (q[:, 0] < 0.5)
    around = np.c_[np.arange(-1, 4999), np.append(np.arange(1, 5000), -1)]
    around[::50, 0] = around[49::50, 1] = -1
    known = CheckedEdges(
        q, start, price=lambda v: np.where(closed[v], np.inf, 0.0),
        passable=lambda p, j: np.ones(len(p), bool), around=around,
    )  # fmt: skip
    found = clear_path(shortest_path, known, **o)
    every = shortest_path(q, start, vertex_cost=np.where(closed, np.inf, 0.0), **o)
    assert found.cost == pytest.approx(every.cost)
    assert known.vertices_checked < 5000 / 3
    assert known.searches < 20


def test_where_all_is_closed_the_answer_names_collision():
    q, start = np.zeros((6, 1)), [0, 2, 4, 6]
    o = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0]}

    def free(v):
        return np.zeros(len(v))

    wall = CheckedEdges(
        q, start, price=lambda v: np.where((v == 2) | (v == 3), np.inf, 0.0),
        passable=lambda p, j: np.ones(len(p), bool),
    )  # fmt: skip
    with pytest.raises(NoFeasiblePath, match="clear; forbidden by collision at the node: 2") as no:
        clear_path(shortest_path, wall, **o)
    assert no.value.proved
    assert no.value.node == 0
    assert no.value.counts == {"collision at the node": 2}
    gate = CheckedEdges(q, start, price=free, passable=lambda p, j: p > 2)
    with pytest.raises(NoFeasiblePath, match="clear; forbidden by collision on the way: 4") as no:
        clear_path(shortest_path, gate, **o)
    assert no.value.node == 0
    q[4:] = 5
    far = CheckedEdges(q, start, price=free, passable=lambda p, j: p > 0)
    with pytest.raises(NoFeasiblePath, match=r"by velocity, joint 1: 4$"):
        clear_path(shortest_path, far, **o)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"method": "paper"}, 'method: only "exact"'),
        ({"price": lambda v: -np.ones(len(v))}, "price: .* a negative one or NaN"),
        ({"price": lambda v: np.full(len(v), np.nan)}, "a negative one or NaN"),
        ({"price": lambda v: np.zeros(1)}, "another shape"),
        ({"around": np.zeros((2, 2))}, "around: expected shape"),
        ({"dt": -1}, "dt: expected a number above 0"),
        ({"velocity": [1, 2]}, "velocity: expected shape"),
    ],
)
def test_bad_input_is_refused(change, message):
    options = {
        "price": lambda v: np.zeros(len(v)), "passable": lambda p, j: np.ones(len(p), bool),
        "dt": 1.0, "velocity": [1.0], "acceleration": [1.0], "around": None,
    } | change  # fmt: skip
    checks = {name: options.pop(name) for name in ("price", "passable", "around")}

    def run():
        clear_path(shortest_path, CheckedEdges(np.zeros((4, 1)), [0, 2, 4], **checks), **options)

    with pytest.raises(InputError, match=message):
        run()
