"""Checks at few distances against checking each vertex and motion by itself."""

import numpy as np
import pytest
from tests.search.posed import clear_path

import naive
from kerfpath.cell import CollisionChecker, Mesh, box, box_between, cell_of
from kerfpath.errors import InputError
from kerfpath.planner import layered_graph
from kerfpath.search import CheckedEdges, shortest_path


@pytest.fixture(scope="module")
def dome(arm, tool, placement):
    """The circle's dome as a slab below it, a table, and a post that the head runs into."""
    slab = box_between([-0.3, -0.3, -0.06], [0.3, 0.3, -0.03])
    return cell_of(
        arm,
        tool=tool,
        part=Mesh(vertices=slab.points, triangles=slab.triangles),
        placement=placement,
        fixtures={
            "table": box_between([0.8, -0.5, 0.0], [1.6, 0.5, 0.3]),
            "post": box_between([0.85, -0.05, 0.3], [0.95, 0.05, 0.75]),
        },
        near_miss=5e-3,
    )


@pytest.fixture(scope="module")
def graph(circle, arm, tool, placement):
    return layered_graph(
        circle, arm, tool=tool, placement=placement, gamma_step=np.radians(5), postures=[0, 1]
    )


def test_certified_prices_are_those_of_checking_each_vertex(dome, graph):
    rng = np.random.default_rng(41)
    checker = CollisionChecker(dome, graph.q)
    for size in (40, 200, 400):
        vertices = rng.integers(0, len(graph.q), size)
        price = checker.price(vertices)
        np.testing.assert_array_equal(np.isfinite(price), dome.clear(graph.q[vertices]))
        np.testing.assert_array_equal(price, checker.price(vertices))
    assert 0.1 < np.isfinite(price).mean() < 0.9
    run = np.arange(0, 4000, 4)
    before = checker.measured
    price = checker.price(run)
    np.testing.assert_array_equal(np.isfinite(price), dome.clear(graph.q[run]))
    assert checker.measured - before < len(run) / 2, "neighbours clear and close each other"
    assert checker.asked < 640 + len(run) + 1


def test_certified_motions_are_those_of_checking_each(dome, graph):
    rng = np.random.default_rng(42)
    checker = CollisionChecker(dome, graph.q)
    k = rng.integers(0, len(graph.start) - 2, 400)
    p = rng.integers(graph.start[k], graph.start[k + 1])
    j = rng.integers(graph.start[k + 1], graph.start[k + 2])
    short = np.abs(dome.increments(graph.q[p], graph.q[j])).max(axis=1) < 1.2
    p, j = p[short], j[short]
    passable = checker.passable(p, j)
    np.testing.assert_array_equal(passable, dome.clear_motion(graph.q[p], graph.q[j]))
    assert 0.02 < passable.mean() < 0.98
    assert checker.motions_measured < checker.motions_asked
    seen = checker.blocked(p, j)
    assert not (seen & passable).any()
    ends = dome.clear(graph.q[p]) & dome.clear(graph.q[j])
    assert (seen & ends).any()


@pytest.mark.parametrize(("radius", "count"), [(0.27, 6), (0.255, 12)])
def test_the_lazy_optimum_in_a_cell_is_that_of_checking_every_vertex_and_edge(
    radius, count, circle, arm, tool, placement
):
    """Nodes 47 mm apart and thin pins: some motions hit between clear vertices."""
    nodes = circle.resample(count=21)
    turn = np.arange(count) * 2 * np.pi / count + 0.2
    places = np.c_[1.2 + radius * np.cos(turn), radius * np.sin(turn)]
    pins = {
        f"pin {i}": box_between([x, y, 0.45], [x + 0.01, y + 0.01, 0.8])
        for i, (x, y) in enumerate(places)
    }
    cell = cell_of(arm, tool=tool, fixtures=pins, near_miss=1e-3)
    whole = layered_graph(
        nodes, arm, tool=tool, placement=placement, gamma_step=np.radians(15), postures=[0]
    )
    graph = whole.part(7, 13)
    o = {
        "dt": 1.0, "velocity": 1.5 * np.ones(6), "acceleration": 2.0 * np.ones(6), "eta_v": 1.0,
        "endless": arm.endless, "weights": np.ones(6), "metric": "manhattan", "objective": "sum",
        "eta_a": 1.0,
    }  # fmt: skip
    clear = cell.clear(graph.q)
    passable = []
    for k in range(len(graph.start) - 2):
        p, j = np.mgrid[
            graph.start[k] : graph.start[k + 1], graph.start[k + 1] : graph.start[k + 2]
        ]
        near = np.abs(cell.increments(graph.q[p], graph.q[j])).max(axis=2) <= 1.5 + 1e-9
        near &= clear[p] & clear[j]
        near[near] = cell.clear_motion(graph.q[p[near]], graph.q[j[near]])
        passable.append(near)
    cost = np.where(clear, 0.0, np.inf)
    want = naive.second_order(graph.q, graph.start, "free", passable, vertex_cost=cost, **o)
    checker = CollisionChecker(cell, graph.q)
    known = CheckedEdges(graph.q, graph.start, price=checker.price, passable=checker.passable)
    found = clear_path(shortest_path, known, **o)
    assert found.cost == pytest.approx(want[0], rel=1e-12)
    blind = shortest_path(graph.q, graph.start, **o)
    assert blind.cost < found.cost
    assert known.vertices_closed
    assert known.edges_closed == (count == 6)
    assert known.edges_checked < sum(m.size for m in passable) / 50


def test_near_misses_can_cost_instead_of_being_forbidden(dome, graph):
    vertices = np.arange(0, len(graph.q), 97)
    checker = CollisionChecker(dome, graph.q, comfort=0.03, comfort_cost=2.0)
    price = checker.price(vertices)
    over = (dome.distances(graph.q[vertices]) - dome.required)[:, ~dome.own].min(axis=1)
    clear = dome.clear(graph.q[vertices])
    want = np.where(clear, 2 * np.clip(1 - over / 0.03, 0, 1), np.inf)
    # Distances are exact to 1e-6 m, hence costs to 2e-6 / 0.03.
    np.testing.assert_allclose(price, want, atol=1e-4)
    assert ((price > 0) & (price < np.inf)).any()
    with pytest.raises(InputError, match="comfort"):
        CollisionChecker(dome, graph.q, comfort=-1.0)


def test_a_body_that_overlaps_deeply_closes_its_neighbours_without_measuring(dome, graph, arm):
    inside = box([4, 4, 4])
    cell = cell_of(arm, tool=np.eye(4), fixtures={"block": inside}, may_touch=[("block", "base")])
    checker = CollisionChecker(cell, graph.q)
    assert np.isinf(checker.price(np.arange(2000))).all()
    assert checker.measured < 400
