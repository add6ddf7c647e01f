"""The cell: shapes, STL files, link frames, distances against formulas, swept motions."""

import struct
from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest

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
    frustum,
    read_mesh,
    weld,
)
from kerfpath.cell.scene import Scene
from kerfpath.errors import InputError
from kerfpath.robots import chain_of, robot, robot_ids
from kerfpath.urdf import KinematicChain

EXACT = 2e-6
"""m: coal refines distances to 1e-6."""


def at(xyz):
    T = np.eye(4)
    T[:3, 3] = xyz
    return T


def mesh_of(hull, **options):
    return Mesh(vertices=hull.points, triangles=hull.triangles, **options)


def ball(xyz, radius):
    return Capsule(start=xyz, end=xyz, radius=radius)


def swivel(joints=1):
    """A chain whose only joint turns about the base's z axis, or several in one place."""
    return KinematicChain(
        origins=np.tile(np.eye(4), (joints, 1, 1)),
        axes=np.tile([0.0, 0, 1], (joints, 1)),
        end=np.eye(4),
    )


def two(still, moving, **options):
    """A cell of one body that stands and one that swivels about z."""
    bodies = (
        Body(name="still", shape=still, frame=0, kind="fixture"),
        Body(name="moving", shape=moving, frame=1, kind="head"),
    )
    return Cell(chain=swivel(), bodies=bodies, endless=[True], **options)


def distance(still, moving, angle=0.0):
    return two(still, moving).distances([[angle]])[0, 0]


OPW = [name for name in robot_ids() if robot(name).kinematics == "opw"]


@pytest.mark.parametrize("name", [*OPW[::9], "staubli_tx2_90"])
def test_link_frames_are_those_of_pinocchio(name):
    arm = robot(name)
    g = arm.geometry
    model = pin.Model()
    z, y = pin.JointModelRZ, pin.JointModelRY
    places = [
        (z, [0, 0, 0]), (y, [g["a1"], g["b"], g["c1"]]), (y, [0, 0, g["c2"]]),
        (z, [g["a2"], 0, g["c3"]]), (y, [0, 0, 0]), (z, [0, 0, 0]),
    ]  # fmt: skip
    parent = 0
    for i, (joint, place) in enumerate(places):
        where = pin.SE3(np.eye(3), np.array(place, float))
        parent = model.addJoint(parent, joint(), where, f"joint {i}")
    data = model.createData()
    chain = chain_of(arm)
    q = np.random.default_rng(1).uniform(-3, 3, (20, 6))
    frames = chain.frames(q)
    for row, angles in zip(frames, arm.sign * q - arm.offset, strict=True):
        pin.forwardKinematics(model, data, angles)
        for i in range(1, 7):
            # Rounding of six products of matrices with entries near one.
            np.testing.assert_allclose(row[i], data.oMi[i].homogeneous, atol=1e-13)
    np.testing.assert_allclose(frames[:, 6] @ chain.end, arm.forward(q), atol=1e-13)


def test_distances_of_balls_capsules_and_boxes_are_those_of_the_formulas():
    rng = np.random.default_rng(2)
    for _ in range(50):
        c, angle = rng.uniform(-2, 2, 3), rng.uniform(-3, 3)
        x = np.array([np.cos(angle), np.sin(angle), 0.0])  # where the moving ball's centre goes
        assert distance(ball(c, 0.1), ball([1, 0, 0], 0.2), angle) == pytest.approx(
            np.linalg.norm(c - x) - 0.3, abs=EXACT
        )
        low, high = -rng.uniform(0.1, 0.5, 3), rng.uniform(0.1, 0.5, 3)
        outside = np.linalg.norm(x - np.clip(x, low, high))
        assert distance(box_between(low, high), ball([1, 0, 0], 0.1), angle) == pytest.approx(
            outside - 0.1, abs=EXACT
        )
        line = Capsule(start=[0, 0, -1], end=[0, 0, 1], radius=0.1)
        assert distance(line, ball([1, 0, 0], 0.2), angle) == pytest.approx(0.7, abs=EXACT)
    assert distance(box([1, 1, 1]), box([1, 1, 1], at([1.5, 0, 0]))) == pytest.approx(0.5)
    assert distance(box([1, 1, 1]), box([1, 1, 1], at([0.9, 0, 0]))) == pytest.approx(-0.1)


def test_a_mesh_is_as_far_as_the_solid_it_bounds():
    solid = box_between([-0.3, -0.2, -0.1], [0.2, 0.3, 0.4])
    for angle in np.linspace(-3, 3, 13):
        for moving in (ball([1, 0.2, 0], 0.1), box([0.2, 0.3, 0.4], at([1, 0, 0.3]))):
            assert distance(mesh_of(solid), moving, angle) == pytest.approx(
                distance(solid, moving, angle), abs=EXACT
            )


def test_touching_is_not_clear():
    cell = two(box([1, 1, 1]), box([1, 1, 1], at([1.0, 0, 0])))
    assert cell.distances([[0.0]])[0, 0] == pytest.approx(0, abs=1e-12)
    assert not cell.clear([[0.0]])[0]
    assert not two(box([1, 1, 1]), ball([0.7, 0, 0], 0.1), near_miss=0.2).clear([[0.0]])[0]
    assert two(box([1, 1, 1]), ball([0.7, 0, 0], 0.1), near_miss=0.09).clear([[0.0]])[0]


@pytest.mark.parametrize("moving", [ball([0.1, 0, 0], 0.05), box([0.1, 0.2, 0.1], at([0.1, 0, 0]))])
def test_a_body_fully_inside_a_closed_mesh_collides(moving):
    room = mesh_of(box([2, 2, 2]))
    assert distance(room, moving) < -0.5
    assert distance(mesh_of(box([0.5, 0.5, 0.5])), ball([0, 0, 0], 2.0)) < 0
    inner = mesh_of(box([0.1, 0.1, 0.1], at([0.2, 0, 0])))
    assert distance(room, inner) < 0
    assert distance(inner, room) < 0
    assert not two(room, moving).clear([[0.0]])[0]


def test_a_cavity_is_outside_and_a_second_piece_inside_is_found():
    outer, hole = box([2, 2, 2]), box([1, 1, 1])
    shell = Mesh(
        vertices=np.vstack([outer.points, hole.points]),
        triangles=np.vstack([outer.triangles, hole.triangles[:, ::-1] + len(outer.points)]),
    )
    assert distance(shell, ball([0.1, 0, 0], 0.1)) == pytest.approx(0.3, abs=EXACT)
    assert distance(shell, ball([0.75, 0, 0], 0.05)) < 0
    far, near = box([0.1] * 3, at([5, 0, 0])), box([0.1] * 3, at([0.75, 0, 0]))
    pieces = Mesh(
        vertices=np.vstack([far.points, near.points]),
        triangles=np.vstack([far.triangles, near.triangles + len(far.points)]),
    )
    assert len(pieces.seeds) == 2
    assert distance(shell, pieces) < 0


def test_points_inside_are_those_of_the_formula():
    rng = np.random.default_rng(3)
    solid = Hull(rng.normal(size=(60, 3)))
    points = rng.normal(size=(300, 3))
    a, b, c = (solid.points[solid.triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    inside = ((points[:, None] - a) * normal).sum(-1).max(axis=1) < 0
    assert 50 < inside.sum() < 250
    np.testing.assert_array_equal(mesh_of(solid).contains(points), inside)
    # On lines through corners and edges of a box, where crossings cannot be counted.
    block = mesh_of(box([2, 2, 2]))
    grid = np.array(np.meshgrid([-1.5, -0.5, 0, 0.5, 1.5], [-1, 0, 0.5], [-2, -0.3, 0, 2])).T
    there = grid.reshape(-1, 3)
    there = there[np.abs(np.abs(there).max(axis=1) - 1) > 0.1]
    np.testing.assert_array_equal(block.contains(there), np.abs(there).max(axis=1) < 1)


def test_a_deviation_lessens_distances():
    solid = box([1, 1, 1])
    moving = ball([1, 0, 0], 0.1)
    assert distance(mesh_of(solid, deviation=0.05), moving) == pytest.approx(0.35, abs=EXACT)
    inside = ball([0, 0, 0], 0.1)
    assert distance(mesh_of(solid, deviation=0.05), inside) < distance(mesh_of(solid), inside)


def test_bounds_never_exceed_the_distance_and_wanted_pairs_alone_are_found():
    cell = a_cell()
    q = np.random.default_rng(4).uniform(-1.5, 1.5, (20, 6))
    full = cell.distances(q)
    for enough in (0.0, 0.05, 0.3):
        some = cell.distances(q, enough=enough)
        near = full < enough
        np.testing.assert_array_equal(some[near], full[near])
        assert (some <= full + EXACT).all()
        assert (some[~near] >= enough - EXACT).all()
    wanted = np.zeros(full.shape, bool)
    wanted[:, 3] = True
    some = cell.distances(q, wanted=wanted)
    assert np.isnan(some).sum() == full.size - len(q)
    np.testing.assert_array_equal(some[:, 3], full[:, 3])
    np.testing.assert_array_equal(cell.clear(q), (full > cell.required).all(axis=1))
    clearance, pair = cell.clearance(q)
    np.testing.assert_array_equal(clearance, (full - cell.required).min(axis=1))
    assert (cell.required[pair] >= 0).all()


def a_cell(**options):
    arm = robot("abb_irb4600_60_205")
    c = np.sqrt(0.5)
    tool = at([0.15, 0, 0.3])
    tool[:3, :3] = [[c, 0, c], [0, 1, 0], [-c, 0, c]]
    part = mesh_of(box_between([-0.3, -0.3, -0.01], [0.3, 0.3, 0.0]), name="plate")
    return cell_of(
        arm, tool=tool, part=part, placement=at([1.3, 0, 0.5]),
        fixtures={"table": box_between([0.9, -0.5, 0.0], [1.7, 0.5, 0.4])}, **options,
    )  # fmt: skip


def test_the_nozzle_works_at_stand_off_and_is_judged_by_it():
    """Over a flat plate the nozzle is one stand-off away: clear; half of it, or a wall: not."""
    arm, tool, place = robot("abb_irb4600_60_205"), at([0, 0, 0.35]), at([1.3, 0, 0.5])
    plate = box_between([-0.3, -0.3, -0.01], [0.3, 0.3, 0.0])

    def judged(height, part, **options):
        cell = cell_of(arm, tool=tool, part=part, placement=place, near_miss=5e-3, **options)
        down = np.diag([1.0, -1, -1, 1])
        down[:3, 3] = place[:3, 3] + [0, 0, height]
        q = arm.inverse(down @ np.linalg.inv(tool)).q[:1]
        of = dict(zip(cell.pair_names, cell.distances(q)[0], strict=True))
        pair = cell.pair_names[cell.clearance(q)[1][0]]
        return of.get(("part", "nozzle")), bool(cell.clear(q)[0]), pair

    head = CuttingHead(stand_off=1e-3)
    assert head.keeps == 0.5e-3
    gap, clear, _ = judged(0.0, mesh_of(plate), head=head)
    assert gap == pytest.approx(1e-3, abs=EXACT)
    assert clear
    gap, clear, pair = judged(-0.6e-3, mesh_of(plate), head=head)
    assert gap == pytest.approx(0.4e-3, abs=EXACT)
    assert not clear
    assert pair == ("part", "nozzle")
    assert judged(-0.45e-3, mesh_of(plate), head=head)[1]
    # A wall beside the cut: the nozzle's cone would run into it.
    wall = box_between([0.004, -0.3, 0.0], [0.01, 0.3, 0.1])
    walled = Mesh(
        vertices=np.vstack([plate.points, wall.points]),
        triangles=np.vstack([plate.triangles, wall.triangles + len(plate.points)]),
    )
    assert not judged(0.0, walled, head=head)[1]
    # The rest of the head keeps the near-miss distance, and a pair may have its own.
    assert not judged(0.0, mesh_of(plate), head=CuttingHead(nozzle_length=4e-3))[1]
    own = {("nozzle", "part"): 2e-3}
    assert not judged(0.0, mesh_of(plate), head=head, near_miss_of=own)[1]
    assert judged(-1e-3, mesh_of(plate), head=head, may_touch=[("part", "nozzle")])[1]


def test_what_may_touch_is_not_judged_and_what_stands_still_is_not_either():
    pairs = a_cell().pair_names
    assert ("part", "table") not in pairs
    assert not any({"nozzle", "head"} == set(pair) for pair in pairs)
    assert ("link 3", "head") in pairs  # self-collision
    assert ("link 1", "link 5") in pairs
    fewer = a_cell(may_touch=[("head", "link 3")]).pair_names
    assert set(pairs) - set(fewer) == {("link 3", "head")}
    near = a_cell(near_miss=0.02, near_miss_of={("table", "head"): 0.05})
    own = dict(zip(near.pair_names, near.required, strict=True))
    assert own["table", "head"] == 0.05
    assert own["part", "head"] == 0.02
    assert own["part", "nozzle"] == 0.5e-3
    assert near.approximate[0] == "base"


def test_every_pair_is_judged_or_left_out_for_a_reason():
    cell = a_cell(may_touch=[("head", "table")])
    left_out = cell.unjudged
    both = [*cell.pair_names, *left_out]
    assert {frozenset(pair) for pair in both} == {
        frozenset(pair) for pair in combinations(cell.names, 2)
    }
    assert len(both) == len(set(both))
    assert left_out["table", "head"] == "they may touch"
    assert left_out["nozzle", "head"] == "they do not move against each other"
    assert "at every pose" in left_out["link 1", "link 2"]
    assert "at every pose" in left_out["link 3", "link 5"]
    # Looked at pose by pose: what overlaps always is left out, what overlaps at times is judged.
    q = np.random.default_rng(9).uniform(-np.pi, np.pi, (300, 6))
    arm = [i for i, body in enumerate(cell.bodies) if body.kind in ("robot", "head")]
    pairs = [(a, b) for a, b in combinations(arm, 2) if cell.bodies[a].frame < cell.bodies[b].frame]
    near = Scene(cell.bodies, np.array(pairs), 0).distances(cell.frames(q), np.inf) <= 0
    depth = dict(zip(cell.pair_names, cell.depth, strict=True))
    for (a, b), touch in zip(pairs, near.T, strict=True):
        pair = cell.names[a], cell.names[b]
        if pair in depth:
            assert touch.all() == (depth[pair] > 0), pair
        elif "at every pose" in left_out[pair]:
            assert touch.all(), pair
            assert {cell.bodies[a].kind, cell.bodies[b].kind} == {"robot"}
        else:
            assert left_out[pair].startswith("they keep "), pair
            assert touch.all() if "overlap by design" in left_out[pair] else not touch.any()
    # A pair that stays nearer than it is asked to keep is judged by what there is.
    near = a_cell(near_miss=3.0, may_touch={("head", "table"): "the head rests on it"})
    assert near.unjudged["table", "head"] == "the head rests on it"
    assert near.pair_names == cell.pair_names
    assert 0.1 < near.required[near.pair_names.index(("link 1", "link 3"))] < 3


def dense(cell, q0, q1, parts):
    """Least distance over the near-miss one, up to 0.1 m, at evenly spread points of a motion."""
    along = np.linspace(0, 1, parts)[:, None]
    there = cell.distances(q0 + along * cell.increments(q0, q1), enough=0.1)
    return (there - cell.required).min()


def test_a_motion_proved_clear_is_clear_wherever_it_is_looked_at():
    cell = a_cell(near_miss=2e-3)
    rng = np.random.default_rng(5)
    q0 = rng.uniform([-0.5, 0.2, -0.6, -1, -0.5, -1], [0.5, 0.9, 0.6, 1, 1.5, 1], (60, 6))
    q1 = q0 + rng.normal(0, 1, (60, 6)) * [0.15, 0.15, 0.15, 0.6, 0.6, 0.6]
    clear = cell.clear_motion(q0, q1)
    least = np.array([dense(cell, a[None], b[None], 101) for a, b in zip(q0, q1, strict=True)])
    assert 10 < clear.sum() < 50
    assert (least[clear] > 0).all()
    # Refused is what hits, or passes by less than the tolerance (and what 101 points overlook).
    assert (least[~clear] < 1e-4 + 2e-3).all()
    between = (cell.clear(q0) & cell.clear(q1)) & ~clear
    assert between.any(), "some motions hit only between their ends"


def test_the_bound_along_a_motion_holds_and_is_far_below_the_lever_arms():
    cell = a_cell()
    rng = np.random.default_rng(6)
    q0 = rng.uniform(-1, 1, (40, 6))
    q1 = q0 + rng.normal(0, 0.05, (40, 6))
    T0, T1 = cell.frames(q0), cell.frames(q1)
    d0, d1 = cell.distances(q0), cell.distances(q1)
    least, _ = cell.sweep.least(d0, d1, T0, T1, q1 - q0)
    for s in np.linspace(0, 1, 11):
        there = cell.distances(q0 + s * (q1 - q0))
        apart = (d0 > 0) & (d1 > 0)
        assert (there >= least)[apart].all()
        assert (
            np.abs(there - d0) <= cell.sweep.shift(T0, cell.frames(q0 + s * (q1 - q0))) + EXACT
        )[apart & (there > 0)].all()


def test_a_motion_through_a_wall_is_refused_though_both_ends_are_free():
    wall = box_between([-0.01, 0.5, -1], [0.01, 1.5, 1])
    cell = two(wall, ball([1, 0, 0], 0.05))
    ends = [[np.pi / 2 - 0.5]], [[np.pi / 2 + 0.5]]
    assert cell.clear(ends[0])[0]
    assert cell.clear(ends[1])[0]
    assert not cell.clear_motion(*ends)[0]
    # An endless joint goes the short way round: here away from the wall.
    assert cell.clear_motion([[np.pi / 2 + 2]], [[np.pi / 2 - 2]])[0]


def test_a_gap_wider_than_the_tolerance_is_passed():
    """A ball swings past a block that comes within 0.3 mm of its way."""
    for gap, passes in ((3e-4, True), (-1e-5, False)):
        block = box_between([-0.02, 1.1 + gap, -1], [0.02, 2, 1])
        cell = two(block, ball([1, 0, 0], 0.1))
        assert cell.clear_motion([[0.7]], [[2.4]])[0] == passes


def test_no_judged_pair_is_always_clear():
    cell = two(box([1, 1, 1]), box([1, 1, 1]), may_touch=[("still", "moving")])
    assert cell.clear([[0.0], [1.0]]).all()
    assert cell.clear_motion([[0.0]], [[1.0]]).all()
    assert cell.clearance([[0.0]])[0][0] == np.inf


def test_frustum_holds_its_cone():
    cone = frustum([0, 0, 0], [0.1, 0.2, 0.3], (0.01, 0.05))
    assert len(cone.points) == 48
    axis = np.array([0.1, 0.2, 0.3]) / np.linalg.norm([0.1, 0.2, 0.3])
    off = np.linalg.norm(np.cross(cone.points, axis), axis=1)
    np.testing.assert_allclose(np.sort(off)[::24], np.array([0.01, 0.05]) / np.cos(np.pi / 24))


def stl_bytes(hull):
    records = b"".join(
        struct.pack("<12fH", *np.zeros(3), *hull.points[t].ravel(), 0) for t in hull.triangles
    )
    return bytes(80) + struct.pack("<I", len(hull.triangles)) + records


def stl_text(hull):
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join("  vertex {} {} {}\n".format(*p) for p in hull.points[t])
        + " endloop\nendfacet\n"
        for t in hull.triangles
    )
    return f"solid box\n{facets}endsolid box\n".encode()


@pytest.mark.parametrize("data", [stl_bytes, stl_text])
def test_an_stl_is_read_in_the_unit_that_is_given(tmp_path, data):
    file = tmp_path / "block.stl"
    file.write_bytes(data(box([100, 200, 300])))
    for unit, scale in (("mm", 1e-3), ("cm", 1e-2)):
        mesh = read_mesh(file, unit)
        assert len(mesh.vertices) == 8
        np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), np.array([100, 200, 300]) * scale)


def test_meshes_of_other_formats_are_read_alike(tmp_path):
    shape = box([100, 200, 300])
    corners, faces = shape.points, shape.triangles
    lines = ["v " + " ".join(map(str, corner)) for corner in corners]
    obj = lines + ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    ply = [
        *("ply", "format ascii 1.0", f"element vertex {len(corners)}"),
        *(f"property float {axis}" for axis in "xyz"),
        *(f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"),
        *(line[2:] for line in lines),
        *("3 " + " ".join(map(str, face)) for face in faces),
    ]
    for name, text in {"block.obj": obj, "block.PLY": ply}.items():
        (tmp_path / name).write_text("\n".join(text) + "\n")
        mesh = read_mesh(tmp_path / name, "mm")
        np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), [0.1, 0.2, 0.3], atol=1e-9)
    (tmp_path / "block.off").write_text("OFF")
    with pytest.raises(InputError, match=r"block.off: expected a mesh as .stl, .obj, .ply"):
        read_mesh(tmp_path / "block.off", "mm")


@pytest.mark.parametrize(
    ("data", "unit", "message"),
    [
        (stl_bytes(box([1, 1, 1])), "", "does not state its unit; expected one of mm, cm, m, in"),
        (stl_bytes(box([1, 1, 1])), "furlong", "does not state its unit"),
        (b"", "m", "neither a text STL nor a complete binary"),
        (stl_bytes(box([1, 1, 1]))[:-7], "m", "neither a text STL nor a complete binary"),
        (bytes(84), "m", "the mesh is empty"),
        (b"solid x\nendsolid x\n", "m", "the mesh is empty"),
        (b"solid x\nfacet", "m", "cut short"),
        (b"solid x\n vertex 0 0 nonsense\nendsolid", "m", "not three numbers"),
        (b"solid x\n vertex 0 0 1\nendsolid", "m", "do not make whole triangles"),
        (stl_bytes(box([1, 1, 1])).replace(struct.pack("<f", 0.5), struct.pack("<f", np.nan)), "m",
         "not a finite number"),
        (stl_bytes(box([1500, 900, 10])), "m", "1500 m across, expected .* is its unit right"),
        (stl_bytes(box([0.01, 0.01, 0.01])), "mm", "is its unit right"),
    ],
)  # fmt: skip
def test_bad_stl_files_are_refused(tmp_path, data, unit, message):
    file = tmp_path / "block.stl"
    file.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_mesh(file, unit)
    with pytest.raises(InputError, match="cannot be read"):
        read_mesh(tmp_path / "none.stl", "mm")


def test_a_mesh_that_is_no_solid_is_refused():
    whole = box([1, 1, 1])
    with pytest.raises(InputError, match="lid: the surface is not closed, 3 of its 18 edges"):
        Mesh(vertices=whole.points, triangles=whole.triangles[1:], name="lid")
    flipped = np.array(whole.triangles)
    flipped[0] = flipped[0, ::-1]
    with pytest.raises(InputError, match="not closed"):
        Mesh(vertices=whole.points, triangles=flipped)
    with pytest.raises(InputError, match="the mesh is empty"):
        Mesh(vertices=np.empty((0, 3)), triangles=np.empty((0, 3)))
    with pytest.raises(InputError, match="a triangle refers to a vertex that does not exist"):
        Mesh(vertices=whole.points, triangles=whole.triangles + 1)
    with pytest.raises(InputError, match="must be finite"):
        Mesh(vertices=whole.points * np.nan, triangles=whole.triangles)
    with pytest.raises(InputError, match="deviation: must not be negative"):
        mesh_of(whole, deviation=-1.0)


def test_welding_closes_what_shares_corners():
    solid = box([1, 1, 1])
    soup = solid.points[solid.triangles].reshape(-1, 3)
    soup = soup + np.random.default_rng(7).uniform(-1e-9, 1e-9, soup.shape)
    corners = np.arange(36).reshape(-1, 3)
    with pytest.raises(InputError, match="not closed"):
        Mesh(vertices=soup, triangles=corners)
    vertices, triangles = weld(soup, corners, 1e-6)
    assert len(Mesh(vertices=vertices, triangles=triangles).vertices) == 8


def test_the_part_on_the_robot_base_is_said_at_once():
    arm = robot("abb_irb4600_60_205")
    part = mesh_of(box([0.5, 0.5, 0.5]))
    with pytest.raises(InputError, match=r"'part' overlaps the robot's 'base' .*approximate"):
        cell_of(arm, tool=np.eye(4), part=part, placement=np.eye(4))
    with pytest.raises(InputError, match="a part needs its placement"):
        cell_of(arm, tool=np.eye(4), part=part)


def test_a_fixture_on_the_robot_base_is_said_at_once_and_may_be_meant():
    arm, plinth = robot("abb_irb4600_60_205"), box_between([-0.5, -0.5, -1], [0.5, 0.5, 0])
    with pytest.raises(InputError, match=r"'plinth' overlaps the robot's 'base' .*may_touch"):
        cell_of(arm, tool=np.eye(4), fixtures={"plinth": plinth})
    touch = [("plinth", "base")]
    meant = cell_of(arm, tool=np.eye(4), fixtures={"plinth": plinth}, may_touch=touch)
    assert meant.unjudged["base", "plinth"] == "they may touch"
    assert {"plinth", "link 3"} in [set(pair) for pair in meant.pair_names]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"may_touch": [("head", "lamp")]}, "may_touch: no body is called 'lamp'; there are base"),
        ({"near_miss_of": {("head", "lamp"): 1}}, "near_miss_of: no body is called 'lamp'"),
        ({"near_miss_of": {("head", "nozzle"): 1}}, "not judged: they do not move against each"),
        ({"near_miss": -1}, "near-miss distance of .* must not be negative"),
        ({"near_miss": np.nan}, "near-miss distance of .* expected a finite number"),
        ({"head": CuttingHead(), "links": [Body(name="part", shape=ball([0, 0, 0], 0.1), frame=2,
                                                kind="robot")]}, "two bodies are called 'part'"),
        ({"links": [Body(name="tail", shape=ball([0, 0, 0], 0.1), frame=9, kind="robot")]},
         "expected frames 0 to 6"),
    ],
)  # fmt: skip
def test_a_bad_cell_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        a_cell(**change)


def test_bad_numbers_are_refused_and_never_free(monkeypatch):
    cell = a_cell()
    with pytest.raises(InputError, match="q: every number must be finite"):
        cell.clear([[0, 0, 0, 0, 0, np.nan]])
    with pytest.raises(InputError, match="q: expected shape"):
        cell.clear([[0, 0]])
    with pytest.raises(InputError, match="equal lengths"):
        cell.clear_motion(np.zeros((2, 6)), np.zeros((1, 6)))
    monkeypatch.setattr("coal.distance", lambda *_: float("nan"))
    with pytest.raises(InputError, match="came out as nan, which proves nothing clear"):
        cell.distances(np.zeros((1, 6)))


@pytest.mark.parametrize(
    "make",
    [
        lambda: box([1, 0, 1]),
        lambda: box_between([0, 0, 0], [1, -1, 1]),
        lambda: Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]),
        lambda: Hull(np.zeros((0, 3))),
        lambda: ball([0, 0, 0], 0.0),
        lambda: frustum([0, 0, 0], [0, 0, 0], (1, 1)),
        lambda: CuttingHead(stand_off=0),
        lambda: CuttingHead(share=1.0),
    ],
)
def test_shapes_without_volume_are_refused(make):
    with pytest.raises(InputError):
        make()


def cone(sides, T):
    """A cone, its tip at the origin of T; every corner of its rim is a neighbour of the tip."""
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rim = np.c_[0.2 * np.cos(turn), 0.2 * np.sin(turn), np.full(sides, 0.3)]
    return Hull(np.vstack([[[0.0, 0, 0]], rim])).moved(T)


@pytest.mark.parametrize("sides", [60, 254, 255, 3000])
def test_a_convex_solid_of_any_corners_is_judged(sides):
    """Beyond 254 neighbours of a corner coal has no convex solid; the surface stands for it."""
    tip = cone(sides, at([0.5, 0, 0]))
    assert tip.crowded == (sides > 254)
    for gap in (0.1, 0.02):
        wall = box_between([-0.1, -1, -1], [0.5 - 0.2 - gap, 1, 1])
        # Of 255 corners none faces it: the rim is 0.2 (1 - cos(pi / 255)) m farther.
        assert distance(wall, tip) == pytest.approx(gap, abs=2e-5)
    assert distance(box([0.01, 0.01, 0.01], at([0.5, 0, 0.2])), tip) < 0, "inside, off the surface"
    assert distance(box([2, 2, 2]), tip) < 0, "holds it"
    assert distance(box_between([0.45, -1, -1], [0.55, 1, 0.1]), tip) <= 0
