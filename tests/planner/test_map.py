"""The collision map against measuring every vertex by itself."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Contour, Tilt
from kerfpath.cell import (
    Body,
    Capsule,
    Cell,
    CuttingHead,
    Hull,
    Mesh,
    box,
    box_between,
    cell_of,
    clearances,
    frustum,
)
from kerfpath.errors import InputError
from kerfpath.planner import clearance_map, layered_graph
from kerfpath.robots import chain_of

EXACT = 2e-6
"""m: coal refines distances to 1e-6, here as in the map."""


def solid(hull, **options):
    return Mesh(vertices=hull.points, triangles=hull.triangles, **options)


@pytest.fixture(scope="module")
def dome(arm, tool, placement):
    """A slab below the circle that the nozzle nearly touches, a table, and a post in the way."""
    return cell_of(
        arm,
        tool=tool,
        head=CuttingHead(stand_off=10e-3),
        part=solid(box_between([-0.3, -0.3, -0.06], [0.3, 0.3, -0.025]), deviation=2e-4),
        placement=placement,
        fixtures={
            "table": box_between([0.8, -0.5, 0.0], [1.6, 0.5, 0.3]),
            "post": box_between([0.85, -0.05, 0.3], [0.95, 0.05, 0.75]),
        },
        near_miss=5e-3,
        near_miss_of={("nozzle", "part"): 16e-3},
    )


def check(cell, q, lower, upper, pair, band, resolution):
    """Hold bounds against measured distances, pair by pair."""
    over = cell.distances(q, enough=cell.required + band + EXACT) - cell.required
    clear = (over > 0).all(axis=1)
    np.testing.assert_array_equal(clear, cell.clear(q))
    np.testing.assert_array_equal(upper > 0, clear)
    counts = over[:, ~cell.own].min(axis=1, initial=np.inf)
    assert (np.minimum(lower, band) <= counts + EXACT).all()
    assert (counts <= upper + EXACT)[clear].all()
    assert np.isneginf(lower[~clear]).all()
    near = clear & (lower < band)
    assert (upper - lower)[near].max(initial=0.0) <= resolution
    # The pair named is one that is as near as that: meshes that overlap have no depth.
    named = over[np.arange(len(q)), pair]
    assert (named <= np.maximum(upper, 0) + EXACT)[pair >= 0].all()
    assert (pair >= 0)[near | ~clear].all()
    return clear, near


def test_tilts_of_one_gamma_are_poses_of_their_own(dome, circle, arm, tool, placement):
    graph = layered_graph(
        Contour(circle.points[:5], circle.axes[:5]), arm, tool=tool, placement=placement,
        gamma_step=np.radians(30), tilt=Tilt(cone=0.3),
    )  # fmt: skip
    found = clearance_map(graph, dome)
    clear = dome.clear(graph.q)
    np.testing.assert_array_equal(found.clear, clear)
    assert found.poses == graph.counts()["admitted"]
    # The tilt decides: the same gamma and posture of a node are clear and not.
    layer = np.repeat(np.arange(5), np.diff(graph.start))
    _, one = np.unique([layer, graph.sample, graph.posture], axis=1, return_inverse=True)
    every = np.bincount(one.ravel(), clear) / np.bincount(one.ravel())
    assert ((every > 0) & (every < 1)).any()


def test_the_map_is_that_of_measuring_each_vertex(dome, circle, arm, tool, placement):
    turning = arm.with_limits(endless=np.zeros(6, bool))
    graph = layered_graph(
        circle.resample(count=21), turning, tool=tool, placement=placement,
        gamma_step=np.radians(5),
    )  # fmt: skip
    done = []
    found = clearance_map(graph, dome, band=0.03, resolution=1e-3, progress=done.append)
    first = np.flatnonzero(np.abs(graph.q[:, [3, 5]]).max(axis=1) <= np.pi)
    before = dome.queries
    dome.clear(graph.q[first])
    assert found.queries < (dome.queries - before) / 5
    assert found.poses == sum(done) == len(first) < len(graph.q) / 2
    clear, near = check(
        dome, graph.q[first], found.lower[first], found.upper[first], found.pair[first], 0.03, 1e-3
    )
    assert 0.1 < clear.mean() < 0.95
    assert near.mean() > 0.02
    assert {found.pairs[p] for p in found.pair if p >= 0} > {("part", "nozzle")}
    np.testing.assert_array_equal(found.clear, found.upper > 0)
    layer = np.repeat(np.arange(21), np.diff(graph.start))
    principal = np.c_[layer, np.round(graph.q - 2 * np.pi * graph.turn, 9)]
    _, first, place = np.unique(principal, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(found.lower[first[place]], found.lower)
    np.testing.assert_array_equal(found.upper[first[place]], found.upper)


@pytest.mark.parametrize("seed", range(8))
def test_bounds_hold_for_bodies_and_joint_vectors_of_all_kinds(arm, seed):
    rng = np.random.default_rng(seed)
    chain = chain_of(arm)

    def at(low, high):
        return rng.uniform(low, high, 3)

    def some(i, size, low, high):
        a = at(low, high)
        b = a + size * at(-1, 1)
        if i == 0:
            return Capsule(start=a, end=b, radius=0.3 * size)
        if i == 1:
            return frustum(a, b, tuple(rng.uniform(0.1, 0.5, 2) * size))
        block = box_between(np.minimum(a, b) - 0.1 * size, np.maximum(a, b) + 0.1 * size)
        return block if i == 2 else solid(block, deviation=1e-3)

    bodies = [
        *(Body(name=f"still {i}", shape=some(i, 0.6, -1.5, 1.5), frame=0, kind="fixture")
          for i in range(4)),
        *(Body(name=f"moving {i}", shape=some(i, 0.3, 0.0, 0.3), frame=int(frame), kind="head")
          for i, frame in enumerate(rng.integers(1, 7, 4))),
    ]  # fmt: skip
    own = {("still 3", "moving 1"): 0.0}
    cell = Cell(chain=chain, bodies=bodies, near_miss=0.02, near_miss_of=own, endless=arm.endless)
    steps = np.cumsum(rng.normal(0, 0.01, (2000, 6)), axis=0)
    q = np.vstack([rng.uniform(-1, 1, 6) + steps, rng.uniform(-3, 3, (100, 6))])
    found = clearances(cell, q, band=0.05, resolution=5e-3)
    clear, _ = check(cell, q, found.lower, found.upper, found.pair, 0.05, 5e-3)
    assert 0 < clear.mean() < 1


def test_a_round_body_that_turns_about_itself_is_measured_once(arm):
    chain = chain_of(arm)
    axis = np.array([chain.end[:3, 3], chain.end[:3, 3] + [0, 0, 0.2]])
    cone = Body(name="cone", shape=frustum(*axis, (0.002, 0.02)), frame=6, kind="head")
    q = np.tile([0.1, 0.2, 0.1, 0.3, 0.5, 0.0], (360, 1))
    q[:, 5] = np.radians(np.arange(360))
    lowest = cone.shape.moved(chain.frames(q[:1])[0, 6]).points[:, 2].min()
    for below, near_miss in ((-0.05, 5e-3), (0.02, 0.01)):
        top = lowest - below
        plate = Body(
            name="plate", frame=0, kind="fixture", shape=box_between([-3, -3, -1], [3, 3, top])
        )
        cell = Cell(chain=chain, bodies=(cone, plate), near_miss=near_miss, endless=arm.endless)
        before = cell.queries
        found = clearances(cell, q, band=0.02, resolution=2e-3)
        assert cell.queries - before == 1
        check(cell, q, found.lower, found.upper, found.pair, 0.02, 2e-3)
    # Too close to the near-miss distance for that: corners pass by, and each is looked at.
    gap = np.median(cell.distances(q))
    cell = Cell(chain=chain, bodies=(cone, plate), near_miss=gap, endless=arm.endless)
    found = clearances(cell, q, band=0.02, resolution=2e-3)
    clear, _ = check(cell, q, found.lower, found.upper, found.pair, 0.02, 2e-3)
    assert 0.2 < clear.mean() < 0.8


def test_only_rings_about_a_line_are_round():
    cone = frustum([0.0, 0, 0], [0.0, 0.1, 0.2], (0.01, 0.02))
    assert Hull(cone.points, axis=cone.axis[::-1]).axis is not None
    for axis in ([[0.0, 0, 0], [0.0, 0.1, 0.201]], [[0.0, 1e-6, 0], [0.0, 0.1, 0.2]]):
        with pytest.raises(InputError, match="hull axis: the points are not rings of 24"):
            Hull(cone.points, axis=axis)
    with pytest.raises(InputError, match="hull axis"):
        Hull(box([1, 1, 1]).points, axis=[[0.0, 0, 0], [0.0, 0, 1]])


def test_inside_of_a_mesh_is_not_free(dome, circle, arm, tool, placement):
    cell = cell_of(
        arm, tool=tool, part=solid(box([4, 4, 0.6])), placement=placement,
        links=[],
    )  # fmt: skip
    graph = layered_graph(
        circle.resample(count=13), arm, tool=tool, placement=placement, gamma_step=np.radians(30)
    )
    found = clearance_map(graph, cell)
    assert not found.clear.any()
    assert not cell.clear(graph.q).any()


def test_nothing_to_judge_is_clear_and_nonsense_is_refused(dome, circle, arm, tool, placement):
    graph = layered_graph(
        circle.resample(count=13), arm, tool=tool, placement=placement, gamma_step=np.radians(60)
    )
    empty = cell_of(arm, tool=tool, links=[])
    found = clearance_map(graph, empty)
    assert found.clear.all()
    assert found.queries == 0
    assert np.isposinf(found.lower).all()
    with pytest.raises(InputError, match="resolution: expected a number above 0 m, got 0 m"):
        clearance_map(graph, dome, resolution=0.0)
    with pytest.raises(InputError, match="band: must not be negative"):
        clearance_map(graph, dome, band=-1e-3)
    with pytest.raises(InputError, match="graph: its vertices have 5 joints, but the cell's robot"):
        clearance_map(replace(graph, q=graph.q[:, :5]), dome)
