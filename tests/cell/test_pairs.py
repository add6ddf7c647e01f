"""Which pairs are judged, and that asking for more never checks less; boxes are the oracle."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from benchmarks._boxes import with_collimator
from scipy.spatial import ConvexHull
from tests.cell.test_cell import at, mesh_of

from kerfpath import robot
from kerfpath.cell import (
    Body,
    Capsule,
    Cell,
    Hull,
    Mesh,
    box,
    box_between,
    cell_of,
    frustum,
    unlikely_sizes,
)
from kerfpath.cell.links import shave
from kerfpath.cell.pairs import BY_DESIGN
from kerfpath.urdf import KinematicChain

ARM = robot("abb_irb2600_12_165")
LADDER = [0.0, 2e-3, 0.01, 0.02, 0.2]
"""m: near-miss distances, each asking for more than the one before."""


def union(boxes, name="head"):
    """A mesh of boxes, each a closed piece, that may overlap."""
    hulls = [box_between(low, high) for low, high in boxes]
    start = np.cumsum([0, *(len(h.points) for h in hulls)])
    return Mesh(
        vertices=np.vstack([h.points for h in hulls]),
        triangles=np.vstack([h.triangles + s for h, s in zip(hulls, start, strict=False)]),
        name=name,
    )


@pytest.mark.parametrize("meshes", [False, True])
@pytest.mark.parametrize("gap", [0.012, 0.0, -4e-3])
def test_a_head_that_reaches_behind_the_flange_is_never_called_clear_inside_a_link(gap, meshes):
    """Against boxes by formula: no pose called clear overlaps, but for what does so by design."""
    world = with_collimator(ARM, gap=gap, behind=0.12)
    cell = Cell(chain=world.chain, bodies=world.bodies(meshes=meshes), endless=ARM.endless)
    judged = dict(zip(cell.pair_names, cell.depth, strict=True))
    assert not [pair for pair in cell.unjudged if "head" in pair]
    # The face by which the head is mounted overlaps by design, to no more than its depth.
    assert judged["link 5", "head"] <= max(0, -gap) * 1.5 + 5e-4 + 1e-9
    assert (judged["link 5", "head"] > 0) == (gap <= 0)
    rng = np.random.default_rng(11)
    limits = ARM.joint_limits()
    q = rng.uniform(limits.lower, limits.upper, (1500, 6))
    clear, hit, beside = cell.clear(q), np.zeros(len(q), bool), np.zeros(len(q), bool)
    for one, two in combinations(world.solids, 2):
        pair = (one, two) if (one, two) in judged else (two, one)
        if pair in judged:
            there = world.overlap(*pair, q, judged[pair])
            hit |= there
            beside |= there & (set(pair) == {"link 5", "head"})
    assert not (clear & hit).any()
    assert beside.sum() > 100, "the collimator hits link 5 at many of them"
    assert clear.sum() > 100
    assert beside[~clear].sum() == beside.sum()


def some_cell(rng, **asked):
    """Arms of random chains and bodies: long and short, thick and thin, of every shape."""
    n = 6
    origins = np.tile(np.eye(4), (n, 1, 1))
    origins[:, :3, 3] = rng.uniform(-0.4, 0.4, (n, 3)) * rng.choice([0.1, 1], (n, 1))
    axes = rng.normal(size=(n, 3))
    chain = KinematicChain(
        origins=origins, axes=axes / np.linalg.norm(axes, axis=1, keepdims=True), end=np.eye(4)
    )
    bodies = [
        Body(
            name="post",
            shape=box([0.1, 0.1, 0.3], at(rng.uniform(-1, 1, 3))),
            frame=0,
            kind="fixture",
        )
    ]
    for frame in range(n + 1):
        size = rng.uniform(0.02, 0.25, 3)
        centre = rng.uniform(-0.2, 0.2, 3) * rng.integers(0, 2)
        kind = rng.integers(3)
        shape = box(size, at(centre))
        if kind == 1:
            shape = Capsule(
                start=centre, end=centre + rng.uniform(-0.2, 0.2, 3), radius=size[0] / 2
            )
        elif kind == 2:
            shape = mesh_of(shape)
        bodies.append(
            Body(
                name=f"body {frame}",
                shape=shape,
                frame=frame,
                kind="head" if frame > 4 else "robot",
            )
        )
    return Cell(chain=chain, bodies=bodies, endless=np.zeros(n, bool), **asked)


def refuses_as_much(cells, q, rng):
    """Require of cells, each asking for more, that none judges less or clears what one refused."""
    ends = q[:8] + rng.normal(0, 0.05, (8, 6))
    before = cells[0]
    clear, passes = before.clear(q), before.clear_motion(q[:8], ends)
    for cell in cells[1:]:
        # What is proved to keep one distance at every angle need not keep another.
        assert set(cell.pair_names) >= set(before.pair_names)
        same = [cell.pair_names.index(pair) for pair in before.pair_names]
        np.testing.assert_array_equal(cell.depth[same], before.depth)
        assert (cell.required[same] >= before.required).all()
        assert (cell.required <= cell.asked).all()
        now, then = cell.clear(q), cell.clear_motion(q[:8], ends)
        assert not (now & ~clear).any()
        assert not (then & ~passes).any()
        assert (cell.clearance(q)[0] <= before.clearance(q)[0] + 1e-5).all()
        before, clear, passes = cell, now, then


@pytest.mark.parametrize("seed", range(6))
def test_asking_for_more_never_checks_less(seed):
    rng = np.random.default_rng(seed)
    q = rng.uniform(-np.pi, np.pi, (120, 6))
    state = rng.bit_generator.state

    def again(**asked):
        rng.bit_generator.state = state
        return some_cell(rng, **asked)

    cells = [again(near_miss=near) for near in LADDER]
    refuses_as_much(cells, q, rng)
    # One pair's own distance, whichever.
    pair = cells[0].pair_names[rng.integers(len(cells[0].pairs))]
    refuses_as_much([again(near_miss_of={pair: near}) for near in LADDER[1::2]], q, rng)


@pytest.mark.parametrize("arm", ["abb_irb1200_5_90", "kuka_kr16_2", "staubli_tx2_90", "ur_ur10e"])
def test_a_library_robot_loses_no_pair_for_its_distance(arm):
    tool = at([0.15, 0, 0.3])
    cells = [cell_of(robot(arm), tool=tool, near_miss=near) for near in LADDER]
    rng = np.random.default_rng(3)
    refuses_as_much(cells, rng.uniform(-2, 2, (100, 6)), rng)
    # The arm of the head is never 200 mm from the forearm; it keeps what the wrist leaves it.
    fallen = dict(zip(cells[-1].pair_names, cells[-1].required, strict=True))
    assert fallen["link 3", "arm"] < 0.2
    links = [{pair for pair, why in cell.unjudged.items() if why == BY_DESIGN} for cell in cells]
    assert links[0] == links[-1]


def wristed(gap, size=0.08):
    """A forearm and, two joints on, a head that stands `gap` before it at zero."""
    origins = np.tile(np.eye(4), (3, 1, 1))
    origins[1:, 2, 3] = 0.1, 0.04
    chain = KinematicChain(
        origins=origins, axes=np.array([[0, 0, 1.0], [0, 0, 1], [0, 1, 0]]), end=np.eye(4)
    )
    bodies = [
        Body(
            name="forearm",
            shape=box_between([-0.04, -0.04, -0.5], [0.04, 0.04, 0.1]),
            frame=1,
            kind="robot",
        ),
        Body(
            name="head",
            shape=box_between([-size / 2, -size / 2, gap], [size / 2, size / 2, 0.25]),
            frame=3,
            kind="head",
        ),
    ]
    return chain, bodies


def test_a_distance_that_cannot_be_had_falls_to_what_the_design_leaves():
    """The head folds back into the forearm; straight it is 15 mm away, so 20 cannot be kept."""
    chain, bodies = wristed(gap=-0.025)
    q = np.zeros((40, 3))
    q[:, 2] = np.linspace(0, np.pi, 40)
    for asked, kept in ((0.01, 0.01), (0.02, 0.0135), (0.5, 0.0135)):
        cell = Cell(chain=chain, bodies=bodies, endless=[0, 0, 0], near_miss=asked)
        assert cell.pair_names == (("forearm", "head"),)
        assert cell.asked == [asked]
        assert cell.required == pytest.approx([kept], abs=1e-5)
        assert cell.clear(q[:1])[0]
        assert not cell.clear(q[-1:])[0]


def test_what_touches_by_design_is_told_apart_from_what_hits():
    """A face that turns on another is judged but for a skin; a spur of it hits at times."""
    chain, bodies = swivel_pair(gap=0.0)
    cell = Cell(chain=chain, bodies=bodies, endless=[0])
    assert cell.depth == [5e-4]
    assert cell.clear([[0.0]])[0]
    turned = np.linspace(-np.pi, np.pi, 400)[:, None]
    hits = ~cell.clear(turned)
    spur = np.abs(np.abs(turned[:, 0]) - np.pi) < 0.3  # where the spur passes the boss
    assert hits[np.abs(np.abs(turned[:, 0]) - np.pi) < 0.2].all()
    assert not hits[~spur & (np.abs(turned[:, 0]) < 2.0)].any()
    # Links of the robot that touch all round do so by their maker's design.
    links = [replace(body, kind="robot") for body in bodies]
    assert Cell(chain=chain, bodies=links, endless=[0]).unjudged == {
        ("boss", "face"): "they touch at every pose tried, by design"
    }


def swivel_pair(gap):
    """A round face that turns on another which has a boss; a spur of it reaches over the edge."""
    chain = KinematicChain(origins=np.eye(4)[None], axes=np.array([[0, 0, 1.0]]), end=np.eye(4))
    still = union(
        [([-0.05, -0.05, -0.2], [0.05, 0.05, 0]), ([-0.1, -0.01, -0.1], [-0.05, 0.01, -0.05])]
    )
    turning = union(
        [
            ([-0.05, -0.05, gap], [0.05, 0.05, 0.1]),
            ([0.075, -0.01, -0.08], [0.09, 0.01, 0.05]),
            ([0.04, -0.01, 0.02], [0.09, 0.01, 0.05]),
        ]
    )
    return chain, [
        Body(name="boss", shape=still, frame=0, kind="robot"),
        Body(name="face", shape=turning, frame=1, kind="head"),
    ]


def test_a_body_of_a_wrong_unit_is_warned_of():
    tool = at([0, 0, 0.3])
    assert unlikely_sizes(cell_of(ARM, tool=tool)) == ()
    for scale, odd in ((1.0, False), (1e-3, True), (100.0, True)):
        bench = box(scale * np.array([0.8, 0.5, 0.3]), at([60, 0, 0]))
        cell = cell_of(ARM, tool=tool, fixtures={"bench": bench})
        found = unlikely_sizes(cell)
        assert bool(found) == odd
        assert all("'bench' is " in said and "is its unit right?" in said for said in found)
    links = [Body(name="forearm", shape=box([30, 20, 20], at([0, 0, 100])), frame=3, kind="robot")]
    (said,) = unlikely_sizes(cell_of(ARM, tool=tool, links=links))
    assert "'forearm' is 3e+04 mm long, and the arm" in said


def test_what_is_shaved_lies_inside_and_no_deeper_than_asked():
    rng = np.random.default_rng(8)
    for shape in (
        Hull(rng.normal(0, 0.1, (40, 3))),
        frustum([0, 0, 0], [0.1, 0.2, 0.3], (0.05, 0.08)),
        Capsule(start=[0, 0, 0], end=[0, 0, 0.2], radius=0.05),
        box([0.2, 0.1, 0.3]),
    ):
        for depth in (5e-4, 4e-3, 0.02):
            left = shave(shape, depth)
            if isinstance(shape, Capsule):
                assert left.radius == shape.radius - depth
                continue
            planes = ConvexHull(shape.points).equations
            behind = -(left.points @ planes[:, :3].T + planes[:, 3])
            # Every corner lies on three faces that have gone in by the depth, behind all others.
            assert behind.min() == pytest.approx(depth, abs=1e-9)
            assert (np.sort(behind, axis=1)[:, 2] < depth + 1e-9).all()
        assert shave(shape, 0.5) is None
    solid = union([([0, 0, 0], [0.1, 0.2, 0.3]), ([0.5, 0, 0], [0.6, 0.1, 0.1])])
    left = shave(solid, 2e-3)
    np.testing.assert_allclose(left.bounds, solid.bounds + 2e-3 * np.array([[1], [-1]]), atol=2e-5)
    moved = np.linalg.norm(left.vertices - solid.vertices, axis=1)
    assert (moved <= 2 * 2e-3).all()
    assert shave(solid, 0.05) is None


def test_links_that_touch_at_most_poses_by_a_skin_are_judged_but_for_it():
    """A foot slides on a plate at zero over two thirds of a turn; what stands on the plate hits."""
    chain = KinematicChain(origins=np.eye(4)[None], axes=np.array([[0, 0, 1.0]]), end=np.eye(4))
    plate = ([-0.3, -0.3, -0.05], [0.07, 0.3, 0])
    foot = Body(
        name="foot", frame=1, kind="robot", shape=box_between([0.1, -0.01, 0], [0.12, 0.01, 0.05])
    )

    def turned(*pieces):
        still = Body(name="plate", shape=union(pieces), frame=0, kind="robot")
        cell = Cell(chain=chain, bodies=[still, foot], endless=[1], near_miss=0.01)
        q = np.linspace(-np.pi, np.pi, 181)[:, None]
        return cell, cell.clear(q), np.abs(np.abs(q[:, 0]) - np.pi)

    sliding, clear, _ = turned(plate)
    assert "except for 0.5 mm that they overlap by design" in sliding.unjudged["plate", "foot"]
    assert clear.all()
    cell, clear, off = turned(plate, ([-0.13, -0.02, 0], [-0.09, 0.02, 0.03]))
    assert cell.depth == [5e-4]
    assert not clear[off < 0.2].any()
    assert clear[off > 0.4].all()
    assert cell.own.all(), "it is asked for no distance besides, which is told as its own"
