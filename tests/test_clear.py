"""The lazy search for a clear path against checking everything, on made-up checks."""

import itertools

import numpy as np
import pytest

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.search import clear_path


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


def agree(rng, closure, share, cost=0.0, **sizes):
    """Compare one random instance with checking everything; returns what was found, or None."""
    q, start, o = instance(rng, closure, **sizes)
    checks = Checks(rng, q, start, closure, share * rng.random(), share * rng.random(), cost)
    all_of_it = o | {"vertex_cost": o["vertex_cost"] + checks.price}
    want = naive.second_order(q, start, closure, checks.open, **all_of_it)
    around = None
    if rng.random() < 0.5:
        around = np.c_[np.arange(len(q)) - 1, np.append(np.arange(1, len(q)), -1)]
        inner = np.isin(np.arange(len(q)), start)
        around[inner, 0] = -1
        around[np.append(inner[1:], True), 1] = -1
    lazy = {"price": checks.vertices, "passable": checks.passable, "around": around}
    if want is None or want[0] == np.inf:
        with pytest.raises(NoFeasiblePath) as caught:
            clear_path(q, start, closure=closure, **lazy, **o)
        assert caught.value.proved
        found = None
    else:
        found = clear_path(q, start, closure=closure, **lazy, **o)
        index = found.path.index
        assert found.path.optimal
        assert found.path.cost == pytest.approx(want[0], rel=1e-10, abs=1e-12)
        assert np.isfinite(checks.price[start[:-1] + index]).all()
        assert all(
            m[a, b] for m, (a, b) in zip(checks.open, itertools.pairwise(index), strict=True)
        )
        assert closure == "free" or index[0] == index[-1]
        assert found.vertices_checked == checks.vertices_asked.sum()
        assert found.edges_checked == len(checks.edges_asked)
    assert checks.vertices_asked.max() <= 1
    assert max(checks.edges_asked.values(), default=0) <= 1
    return found


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
    found = [agree(rng, "periodic", share, layers=(3, 7), size=(1, 6)) for _ in range(300)]
    made = [f for f in found if f is not None]
    assert len(made) > 60
    assert sum(f.edges_closed > 1 for f in made) > 10


def test_a_price_per_vertex_is_added_and_paid_only_where_it_is_worth_it():
    rng = np.random.default_rng(33)
    found = [agree(rng, "free", 0.2, cost=2.0, layers=(2, 6), size=(2, 7)) for _ in range(300)]
    assert sum(f is not None for f in found) > 150


def test_nothing_closed_costs_one_search_and_one_check_of_each_vertex_and_edge_of_the_path():
    rng = np.random.default_rng(34)
    q, start = rng.uniform(-1, 1, (300, 3)), np.arange(0, 301, 10)
    o = {"dt": 1.0, "velocity": np.full(3, 3.0), "acceleration": np.full(3, 9.0)}
    free = {"price": lambda v: np.zeros(len(v)), "passable": lambda p, j: np.ones(len(p), bool)}
    found = clear_path(q, start, **free, **o)
    assert (found.searches, found.vertices_checked, found.edges_checked) == (1, 30, 29)
    np.testing.assert_array_equal(found.path.index, shortest_path(q, start, **o).index)


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
    found = clear_path(
        q, start, price=lambda v: np.where(closed[v], np.inf, 0.0),
        passable=lambda p, j: np.ones(len(p), bool), around=around, **o,
    )  # fmt: skip
    every = shortest_path(q[~closed], np.searchsorted(np.flatnonzero(~closed), start), **o)
    assert found.path.cost == pytest.approx(every.cost)
    assert found.vertices_checked < 5000 / 3
    assert found.searches < 20


def test_where_all_is_closed_the_answer_names_collision():
    q, start = np.zeros((6, 1)), [0, 2, 4, 6]
    o = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0]}

    def free(v):
        return np.zeros(len(v))

    with pytest.raises(NoFeasiblePath, match="clear; forbidden by collision at the node: 2") as no:
        clear_path(
            q, start, price=lambda v: np.where((v == 2) | (v == 3), np.inf, 0.0),
            passable=lambda p, j: np.ones(len(p), bool), **o,
        )  # fmt: skip
    assert no.value.proved
    assert no.value.node == 0
    assert no.value.counts == {"collision at the node": 2}
    with pytest.raises(NoFeasiblePath, match="clear; forbidden by collision on the way: 4") as no:
        clear_path(q, start, price=free, passable=lambda p, j: p > 2, **o)
    assert no.value.node == 0
    q[4:] = 5
    with pytest.raises(NoFeasiblePath, match=r"by velocity, joint 1: 4$"):
        clear_path(q, start, price=free, passable=lambda p, j: p > 0, **o)


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
        "dt": 1.0, "velocity": [1.0], "acceleration": [1.0],
    }  # fmt: skip
    with pytest.raises(InputError, match=message):
        clear_path(np.zeros((4, 1)), [0, 2, 4], **options | change)


def test_a_closed_path_of_three_nodes_is_refused_where_an_edge_is_closed():
    q = np.array([[0.0], [0.1], [0.0]])
    o = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0], "closure": "periodic"}
    with pytest.raises(InputError, match="needs 4 layers"):
        clear_path(
            q, [0, 1, 2, 3], price=lambda v: np.zeros(len(v)), passable=lambda p, j: p > 0, **o
        )
