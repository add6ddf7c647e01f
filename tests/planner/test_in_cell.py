"""Plans in a cell: clear, the best of all clear ones, audited again, and refused where they hit."""

import re
from functools import partial

import numpy as np
import pytest

from kerfpath import Contour, InputError, NoFeasiblePath, audit, fastest_speed, plan
from kerfpath.auditor import checks
from kerfpath.cell import Mesh, box_between, cell_of
from kerfpath.planner import layered_graph, plan_in_pieces
from kerfpath.search import CheckedEdges

STEP = np.radians(5)

on_grid = partial(plan, method="exact")


def cell(arm, tool, placement, fixtures, **options):
    slab = box_between([-0.3, -0.3, -0.06], [0.3, 0.3, -0.03])
    return cell_of(
        arm,
        tool=tool,
        part=Mesh(vertices=slab.points, triangles=slab.triangles),
        placement=placement,
        fixtures=fixtures,
        near_miss=2e-3,
        **options,
    )


@pytest.fixture(scope="module")
def task(circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    graph = layered_graph(circle, arm, **options)
    return (circle, arm), options | {"speed": 0.1, "graph": graph}


@pytest.fixture(scope="module")
def half(circle, arm, tool, placement):
    """Half of the circle, for what takes many searches."""
    nodes = Contour(circle.points[:61], circle.axes[:61], name="circle")
    options = {"tool": tool, "placement": placement, "gamma_step": STEP}
    return (nodes, arm), options | {"speed": 0.1, "graph": layered_graph(nodes, arm, **options)}


@pytest.fixture(scope="module")
def blind(task):
    return on_grid(*task[0], **task[1])


@pytest.fixture(scope="module")
def posts():
    """Posts around the circle, one of them where the head would like to be."""
    turn = np.arange(6) * np.pi / 3 + 0.2
    places = np.c_[1.2 + 0.27 * np.cos(turn), 0.27 * np.sin(turn)]
    return {
        f"post {i}": box_between([x, y, 0.45], [x + 0.01, y + 0.01, 0.9])
        for i, (x, y) in enumerate(places)
    }


def test_where_nothing_is_in_the_way_the_plan_is_the_same(task, blind, arm, tool, placement):
    # The thick capsules of forearm and head meet where the wrist is bent that far.
    there = cell(arm, tool, placement, {}, may_touch=[("link 3", "arm")])
    made = on_grid(*task[0], **task[1], cell=there)
    np.testing.assert_array_equal(made.q, blind.q)
    assert made.proof.optimal
    assert "clear in the cell" in made.proof.statement
    assert "need not hold the real ones): 121 of " in made.proof.statement
    assert "in 1 search," in made.proof.statement


@pytest.mark.slow
def test_where_something_is_the_plan_goes_around_it(task, blind, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    assert not there.clear(blind.q).all()
    made = on_grid(*task[0], **task[1], cell=there)
    assert made.cost > blind.cost
    assert made.proof.optimal
    assert there.clear(made.q).all()
    assert there.clear_motion(made.q[:-1], made.q[1:]).all()
    assert audit(made, cell=there) == []
    hits = [issue for issue in audit(blind, cell=there) if issue.code == "collision"]
    assert len(hits) == 1
    assert "shortfall of near-miss distances (nearest: post " in hits[0].message
    free = there.clear(task[1]["graph"].q)
    assert free.mean() < 0.9


def test_the_audit_s_least_distance_is_the_cell_s(task, blind, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    check = next(c for c in checks(blind, cell=there, parts=1) if c.code == "collision")
    # Convex overlaps are exact to 1e-6 m.
    assert check.value == pytest.approx(-there.clearance(blind.q)[0].min(), abs=2e-6)
    assert not check.ok


@pytest.mark.slow
def test_a_refined_plan_is_clear_or_stays_on_the_grid(task, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    made = on_grid(*task[0], **task[1], cell=there, refine=True)
    assert there.clear(made.q).all()
    assert there.clear_motion(made.q[:-1], made.q[1:]).all()


def is_clear(there, q):
    return there.clear(q).all() and there.clear_motion(q[:-1], q[1:]).all()


@pytest.mark.slow
def test_closed_and_turning_little_the_plan_is_clear_too(task, blind, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    closed = on_grid(*task[0], **task[1], cell=there, closure="periodic")
    assert is_clear(there, closed.q)
    assert closed.proof.optimal
    assert closed.cost >= on_grid(*task[0], **task[1], closure="periodic").cost
    rotation = [np.inf, np.inf, np.inf, 1.0, np.inf, 6.5]
    little = on_grid(*task[0], **task[1], cell=there, rotation=rotation)
    assert is_clear(there, little.q)
    assert little.cost >= on_grid(*task[0], **task[1], cell=there).cost


@pytest.mark.slow
def test_where_the_speed_must_dip_the_plan_is_clear_too(half, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    fast = half[1] | {"speed": 1.0}
    with pytest.raises(NoFeasiblePath):
        on_grid(*half[0], **fast)
    for how in ({}, {"method": "exact"}, {"method": "exact", "refine": True}):
        made = plan(*half[0], **fast, cell=there, feed="dip", **how)
        assert is_clear(there, made.q)
        assert audit(made, cell=there) == []


@pytest.mark.slow
def test_pieces_and_the_fastest_speed_are_clear_too(half, arm, tool, placement, posts):
    there = cell(arm, tool, placement, posts)
    pieces = plan_in_pieces(*half[0], **half[1] | {"speed": 0.3}, cell=there)
    assert all(is_clear(there, piece.q) for piece in pieces)
    options = {name: half[1][name] for name in ("tool", "placement", "gamma_step", "graph")}
    free, around = (fastest_speed(*half[0], **options, cell=c) for c in (None, there))
    assert around.speed < free.speed
    made = on_grid(*half[0], **half[1] | {"speed": around.speed * (1 - 1e-9)}, cell=there)
    assert is_clear(there, made.q)
    with pytest.raises(NoFeasiblePath):
        on_grid(*half[0], **half[1] | {"speed": around.speed * (1 + 1e-6)}, cell=there)


@pytest.mark.slow
def test_behind_a_cage_no_speed_and_no_interruption_helps(half, arm, tool, placement):
    lid = {"lid": box_between([0.9, -0.3, 0.5], [1.5, 0.3, 0.52])}
    caged = cell(arm, tool, placement, lid)
    options = {name: half[1][name] for name in ("tool", "placement", "gamma_step", "graph")}
    with pytest.raises(
        NoFeasiblePath, match=r"contour .circle.: on this grid .* no pose at node 0"
    ) as no:
        on_grid(*half[0], **half[1], cell=caged, feed="dip")
    assert no.value.counts["collision at the node"] > 0
    with pytest.raises(NoFeasiblePath, match="no number of interruptions helps: no pose at node"):
        plan_in_pieces(*half[0], **half[1], cell=caged)
    with pytest.raises(NoFeasiblePath, match="collision at the node"):
        fastest_speed(*half[0], **options, cell=caged)


@pytest.mark.slow
def test_a_cage_is_no_way_and_says_so(task, arm, tool, placement):
    lid = {"lid": box_between([0.9, -0.3, 0.5], [1.5, 0.3, 0.52])}
    with pytest.raises(
        NoFeasiblePath, match=r"contour .circle.: on this grid .* no pose at node 0"
    ) as no:
        on_grid(*task[0], **task[1], cell=cell(arm, tool, placement, lid))
    # The lid lies between the part and all that is above it: at every node, and by its thickness
    # and more, wherever the search broke.
    said = str(no.value)
    assert "(121 such nodes: 0 to 120)" in said
    assert re.search(r"lid and head.* at (\d+) of \1 poses, [\d.]+ to [\d.]+ mm nearer", said)
    assert re.search(r"the best pose is [\d.]+ mm too near \(lid and head", said)
    assert no.value.node == -1
    assert no.value.proved
    assert no.value.counts["collision at the node"] > 0


def test_a_cell_of_another_task_is_refused(task, arm, tool, placement):
    moved = placement.copy()
    moved[0, 3] += 0.1
    with pytest.raises(InputError, match="cell: it was built with another placement"):
        on_grid(*task[0], **task[1], cell=cell(arm, tool, moved, {}))
    other = tool.copy()
    other[2, 3] += 0.1
    with pytest.raises(InputError, match="cell: it was built with another tool"):
        on_grid(*task[0], **task[1], cell=cell(arm, other, placement, {}))
    plain = arm.with_limits(endless=np.zeros(6, bool))
    with pytest.raises(InputError, match="cell: it was built with other endless joints"):
        on_grid(*task[0], **task[1], cell=cell(plain, tool, placement, {}))
    with pytest.raises(InputError, match='method: only "exact"'):
        plan(*task[0], **task[1], method="paper", cell=cell(arm, tool, placement, {}))


@pytest.mark.slow
def test_the_first_node_without_a_clear_pose_is_told_wherever_the_search_breaks(
    task, arm, tool, placement
):
    """A lid over half of the contour: the nodes told are those that checking all poses finds."""
    half = {"lid": box_between([0.9, 0.05, 0.5], [1.5, 0.3, 0.52])}
    there = cell(arm, tool, placement, half)
    with pytest.raises(NoFeasiblePath) as no:
        on_grid(*task[0], **task[1], cell=there)
    graph = task[1]["graph"]
    clear = there.clear(graph.q)
    none = [k for k in range(121) if not clear[graph.start[k] : graph.start[k + 1]].any()]
    assert 0 < len(none) < 121
    said = str(no.value)
    assert f"no pose at node {none[0]} of 121 is clear ({len(none)} such nodes: " in said
    assert no.value.node == none[0] - 1
    here = slice(graph.start[none[0]], graph.start[none[0] + 1])
    assert no.value.counts["collision at the node"] == here.stop - here.start


def test_how_many_poses_are_looked_at_to_find_closed_nodes_is_bounded():
    asked = []

    def price(vertices):
        asked.append(len(vertices))
        return np.where(vertices % 50 < 40, np.inf, 0.0)

    q, start = np.zeros((500, 1)), np.arange(0, 501, 40)
    known = CheckedEdges(q, [*start, 500], price=price, passable=lambda p, j: np.ones(len(p), bool))
    closed, settled = known.closed_layers(10_000)
    every = [k for k in range(13) if (np.arange(40 * k, min(40 * k + 40, 500)) % 50 < 40).all()]
    assert (closed, settled) == (every, 13)
    fresh = CheckedEdges(q, [*start, 500], price=price, passable=lambda p, j: np.ones(len(p), bool))
    asked.clear()
    closed, settled = fresh.closed_layers(100)
    assert sum(asked) <= 100
    assert closed == [k for k in every if k < settled]
    assert settled < 13
