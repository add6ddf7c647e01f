"""Cells of every kind of robot: joint chains, links as capsules and as meshes, heads as meshes."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.cell.test_cell import at, mesh_of, stl_bytes
from tests.robots.test_five_axes import ARM as FIVE
from tests.robots.test_general import random_arm
from tests.urdf.test_urdf import described

from conftest import ROOT, rebuilt
from kerfpath import InputError, Robot, auditor, robot
from kerfpath.cell import (
    Capsule,
    CuttingHead,
    Hull,
    Mesh,
    MeshHead,
    box,
    box_between,
    cell_of,
    frustum,
    link_bodies,
    link_capsules,
)
from kerfpath.cell import links as links_module
from kerfpath.robots import arm as arm_module
from kerfpath.robots import chain_of, robot_ids
from kerfpath.urdf import LinkBody as Described

LIBRARY = [robot(name) for name in robot_ids()]
PLAIN = [robot("abb_irb4600_60_205"), robot("ur_ur10e"), FIVE]


def placed(arm, rng):
    """The arm on another foot, with another flange, other signs and offsets."""
    n = arm.joints
    foot, end = np.eye(4), np.eye(4)
    foot[:3, :3], end[:3, :3] = Rotation.random(2, rng=rng).as_matrix()
    foot[:3, 3], end[:3, 3] = rng.uniform(-1, 1, (2, 3))
    return rebuilt(
        arm, T_base_foot=foot, T_end_flange=end,
        sign=rng.choice([-1.0, 1.0], n), offset=rng.uniform(-3, 3, n),
    )  # fmt: skip


@pytest.mark.parametrize("arm", [*LIBRARY, *PLAIN], ids=lambda arm: arm.id)
def test_the_chain_ends_where_the_closed_form_does_and_its_frames_are_the_audits(arm):
    rng = np.random.default_rng(50)
    for r in (arm, placed(arm, rng)):
        q = rng.uniform(-np.pi, np.pi, (40, r.joints))
        chain = chain_of(r)
        # Entries up to a few metres, products of seven matrices.
        np.testing.assert_allclose(chain.forward(q), r.forward(q), atol=1e-12)
        frames = np.stack(auditor.chain_of(r).joints(q), axis=1)
        np.testing.assert_allclose(chain.frames(q)[:, 1:], frames, atol=1e-12)


@pytest.mark.parametrize("name", ["staubli_tx60", "ur_ur5e"])
def test_links_are_the_same_bodies_in_whatever_frames_they_are_described(tmp_path, name):
    """Capsules of a described robot move as those of the library's: to what a model may be off."""
    rng = np.random.default_rng(51)
    own = robot(name)
    there = Robot.from_urdf(described(tmp_path, own, gauge=rng), acceleration=np.ones(6))
    assert chain_of(there) is there.chain
    q = rng.uniform(-np.pi, np.pi, (40, 6))
    one, two = (cell_of(arm, tool=np.eye(4), links=link_capsules(arm)[1:]) for arm in (own, there))
    # How the base stands and where the wrist ends is not told by the axes, hence the links between;
    # coal finds distances to 1e-6 m.
    of = dict(zip(two.pair_names, two.distances(q).T, strict=True))
    known = {"link 1", "link 2", "link 3 elbow", "link 3", "link 4"}
    links = [pair for pair in one.pair_names if set(pair) <= known]
    assert len(links) > 1
    for pair in links:
        apart = one.distances(q)[:, one.pair_names.index(pair)]
        np.testing.assert_allclose(of[pair], apart, atol=5e-6)


def test_every_robot_of_the_library_has_a_cell_and_room_at_mid_range():
    tool = at([0, 0, 0.3])
    for arm in (*LIBRARY, FIVE):
        cell = cell_of(arm, tool=tool)
        middle = np.zeros(arm.joints) if arm.lower is None else (arm.lower + arm.upper) / 2
        clearance, pair = cell.clearance([np.zeros(arm.joints), middle])
        assert (clearance > 0).all(), (arm.id, cell.pair_names[pair[0]])
        assert cell.names[0] == "base"
        assert "head" in cell.names
        assert {"link 1", "link 2", "link 3"} <= set(cell.approximate)
    assert cell.frames(np.zeros((1, 5))).shape == (1, 6, 4, 4)


def test_a_ur_folded_onto_itself_is_not_clear():
    cell = cell_of(robot("ur_ur10e"), tool=at([0, 0, 0.3]))
    folded = np.radians([0, -90, 178, 0, 90, 0])
    of = dict(zip(cell.pair_names, cell.distances([folded])[0], strict=True))
    assert of["link 2", "link 4"] < 0
    assert not cell.clear([folded])[0]


def test_an_arm_of_no_known_family_is_drawn_along_its_chain(monkeypatch):
    """Lines from joint to joint, at any pose, for whatever the description calls its frames."""
    arm = robot("ur_ur10e")
    monkeypatch.delitem(links_module._LINES, "ur")
    capsules = {body.frame: body.shape for body in link_capsules(arm)}
    q = np.random.default_rng(52).uniform(-3, 3, (5, 6))
    for frames in chain_of(arm).frames(q):
        for i, shape in capsules.items():
            ends = shape.moved(frames[i]).corners
            np.testing.assert_allclose(ends[0], frames[i, :3, 3], atol=1e-12)
            if i < 6:
                np.testing.assert_allclose(ends[1], frames[i + 1, :3, 3], atol=1e-12)
    # Link 6 ends half way to the flange; the base, where joint 1 is.
    assert sorted(capsules) == [0, 1, 2, 3, 4, 5, 6]
    monkeypatch.delitem(links_module._LINES, "opw")
    wrist = [body.frame for body in link_capsules(robot("abb_irb4600_60_205"))]
    assert wrist == [0, 1, 2, 3, 6]  # joints 4 to 6 are in one place
    monkeypatch.delitem(arm_module._MODELS, "ur")
    with pytest.raises(InputError, match="are known only from a robot description"):
        chain_of(arm)


def test_an_arm_without_length_is_refused():
    arm = robot("abb_irb4600_60_205")
    with pytest.raises(InputError, match="its links have no length"):
        link_capsules(rebuilt(arm, geometry=arm.geometry | {"c2": 0.0, "c3": 0.0}))


def bracket():
    """A closed solid that is not convex: an L of two boxes in one surface, legs along x and z."""
    outline = np.array([[0, 0], [0.3, 0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0, 0.3]])
    fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]
    low = np.c_[outline[:, 0], np.full(6, -0.05), outline[:, 1]]
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6] for i in range(6)]
    sides += [[i, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    triangles = [*fan, *(np.array(fan)[:, ::-1] + 6).tolist(), *np.array(sides)[:, ::-1].tolist()]
    return Mesh(
        vertices=np.vstack([low, low + at([0, 0.1, 0])[:3, 3]]), triangles=triangles, name="bracket"
    )


DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="inch" meter="{unit}"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{many}">{numbers}</float_array><technique_common>
<accessor source="#a" count="{count}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{faces}"><input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p>
</triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def dae_text(mesh, unit):
    return DAE.format(
        unit=unit, many=mesh.vertices.size, count=len(mesh.vertices), faces=len(mesh.triangles),
        numbers=" ".join(repr(float(v)) for v in (mesh.vertices / unit).ravel()),
        corners=" ".join(map(str, mesh.triangles.ravel())),
    )  # fmt: skip


def obj_text(mesh):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    return "\n".join([*lines, *("f {} {} {}".format(*t + 1) for t in mesh.triangles)]) + "\n"


class _Soup:
    """What `stl_bytes` takes: the triangles of a mesh in another unit."""

    def __init__(self, mesh, scale=1.0):
        self.points, self.triangles = mesh.vertices * scale, mesh.triangles


def with_mesh(arm, path, scale=1.0, pose=None, joint=3):
    body = Described(
        link="forearm", joint=joint, pose=np.eye(4) if pose is None else pose, kind="mesh",
        size=np.full(3, scale), path=path,
    )  # fmt: skip
    return replace(arm, bodies=(body,))


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
def test_a_mesh_of_a_description_is_the_link(tmp_path, kind):
    mesh, file = bracket(), tmp_path / f"forearm.{kind}"
    scale = 1.0
    if kind == "stl":
        scale = 1e-3
        file.write_bytes(stl_bytes(_Soup(mesh, 1000.0)))
    else:
        file.write_text(dae_text(mesh, 0.0254) if kind == "dae" else obj_text(mesh))
    pose = at([0.1, -0.2, 0.3])
    pose[:3, :3] = Rotation.random(rng=np.random.default_rng(53)).as_matrix()
    arm = with_mesh(robot("staubli_tx60"), file, scale, pose)
    hull, solid = (link_bodies(arm, hulls=hulls)[0] for hulls in (True, False))
    assert (hull.name, hull.frame, hull.approximate) == ("forearm", 3, True)
    assert (solid.name, solid.frame, solid.approximate) == ("forearm", 3, False)
    want = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
    # Single precision in the files.
    for point in want:
        assert np.abs(solid.shape.vertices - point).max(axis=1).min() < 1e-6
    assert isinstance(hull.shape, Hull)
    assert len(hull.shape.points) == 10  # the inner corner is no corner of the hull
    inside = np.array([[0.05, 0, 0.05], [0.25, 0, 0.05], [0.18, 0, 0.18], [0.4, 0, 0]])
    there = inside @ pose[:3, :3].T + pose[:3, 3]
    assert solid.shape.contains(there).tolist() == [True, True, False, False]
    # Links without a body in the description are drawn.
    names = [body.name for body in link_bodies(arm)]
    assert names == ["forearm", "base", "link 1", "link 2", "link 5"]


def test_boxes_cylinders_and_balls_of_a_description_are_the_links():
    pose = at([0.1, 0.2, 0.3])
    pose[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()  # z becomes -y
    kinds = {"box": [0.1, 0.2, 0.4], "cylinder": [0.05, 0.6], "sphere": [0.07]}
    bodies = tuple(
        Described(link="arm", joint=2, pose=pose, kind=kind, size=np.array(size))
        for kind, size in kinds.items()
    )
    arm = replace(robot("staubli_tx60"), bodies=bodies)
    cuboid, tube, ball, *_ = link_bodies(arm)
    assert [cuboid.name, tube.name, ball.name] == ["arm", "arm 2", "arm 3"]
    assert not any(body.approximate for body in (cuboid, tube, ball))
    span = np.ptp(cuboid.shape.points, axis=0)
    np.testing.assert_allclose(span, [0.1, 0.4, 0.2], atol=1e-12)
    along = tube.shape.points[:, 1] - 0.2
    np.testing.assert_allclose(np.abs(along), 0.3, atol=1e-12)
    off = np.linalg.norm(tube.shape.points[:, [0, 2]] - [0.1, 0.3], axis=1)
    assert ((off >= 0.05) & (off < 0.0505)).all()  # a polygon around the circle
    assert isinstance(ball.shape, Capsule)
    np.testing.assert_allclose(ball.shape.corners, np.tile([0.1, 0.2, 0.3], (2, 1)), atol=1e-12)


def test_a_described_robot_with_bodies_is_judged_by_them(tmp_path):
    arm = robot("staubli_tx60")
    path = described(tmp_path, arm)
    (tmp_path / "fore.stl").write_bytes(stl_bytes(box([100, 100, 300])))
    held = (
        '<collision><origin xyz="0 0 0.1"/><geometry><mesh filename="fore.stl" '
        'scale="0.001 0.001 0.001"/></geometry></collision>'
    )
    text = path.read_text().replace('<link name="link_3"/>', f'<link name="link_3">{held}</link>')
    path.write_text(text)
    there = Robot.from_urdf(path, acceleration=np.ones(6))
    q = np.random.default_rng(54).uniform(-1, 1, (6, 6))
    post = at([0, 0, 2.5])
    cell = cell_of(there, tool=at([0, 0, 0.2]), fixtures={"post": box([0.1] * 3, post)})
    assert "link_3" in cell.approximate
    apart = dict(zip(cell.pair_names, cell.distances(q).T, strict=True))["post", "link_3"]
    # A second way: the least distance of many points of the link to the post.
    grid = np.linspace(-0.5, 0.5, 41)
    points = np.array(np.meshgrid(grid, grid, grid)).reshape(3, -1).T * [0.1, 0.1, 0.3]
    for T, found in zip(chain_of(arm).frames(q)[:, 3], apart, strict=True):
        away = (points + np.array([0, 0, 0.1])) @ T[:3, :3].T + T[:3, 3] - post[:3, 3]
        least = np.linalg.norm(np.clip(np.abs(away) - 0.05, 0, None), axis=1).min()
        assert least - 0.01 < found <= least + 2e-6


@pytest.mark.parametrize(
    ("write", "hulls", "scale", "message"),
    [
        (
            lambda f: f.write_bytes(bytes(84)),
            True,
            1.0,
            "'forearm', link.stl: the mesh is empty",
        ),
        (lambda f: f.write_bytes(stl_bytes(box([1, 1, 1]))), True, 1e3, "1000 m across, .* unit"),
        (lambda f: f.write_bytes(stl_bytes(box([1, 1, 1]))), True, 1e-6, "is its unit right"),
        (lambda f: f.write_bytes(b"ply"), True, 1.0, "neither a text STL nor a complete binary"),
        (lambda f: f.write_bytes(stl_bytes(opened(box([1, 1, 1])))), False, 1.0, "is not closed"),
        (lambda f: f.write_bytes(stl_bytes(opened(box([1, 1, 1]), 2))), True, 1.0, "in one plane"),
        (lambda f: f.unlink(missing_ok=True), True, 1.0, "cannot be read"),
    ],
)
def test_a_bad_link_mesh_is_refused_by_name(tmp_path, write, hulls, scale, message):
    file = tmp_path / "link.stl"
    write(file)
    with pytest.raises(InputError, match=message):
        link_bodies(with_mesh(robot("staubli_tx60"), file, scale), hulls=hulls)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("link.wrl", "vrml", "expected a mesh as .stl, .dae, .obj or .ply, got '.wrl'"),
        ("link.obj", "nothing", "the mesh cannot be read as .obj"),
        ("link.dae", "<COLLADA/>", "the mesh cannot be read as .dae"),
        ("link.dae", None, "cannot be read"),
    ],
)
def test_a_mesh_file_of_another_kind_is_refused(tmp_path, name, text, message):
    file = tmp_path / name
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=message):
        link_bodies(with_mesh(robot("staubli_tx60"), file))


def opened(hull, count=None):
    """A hull without its first triangle, or with some alone."""
    soup = _Soup(mesh_of(hull))
    soup.triangles = soup.triangles[1:] if count is None else coplanar(hull)[:count]
    return soup


def coplanar(hull):
    low = hull.points[hull.triangles][:, :, 2].max(axis=1)
    return hull.triangles[low == low.min()]


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    return (a * np.cross(b, c)).sum() / 6


@pytest.mark.parametrize("seed", range(4))
def test_a_cut_solid_is_two_closed_ones_that_make_up_the_whole(seed):
    rng = np.random.default_rng(seed)
    whole = bracket().moved(at([0.01, 0.02, 0.03]))
    point = whole.vertices.mean(axis=0) + rng.uniform(-0.05, 0.05, 3)
    normal = Rotation.random(rng=rng).as_matrix()[0]
    if seed == 0:
        point, normal = whole.vertices[3], np.array([0.0, 0, 1.0])  # through four of its corners
    before, behind = whole.cut(point, normal)
    assert volume(before) + volume(behind) == pytest.approx(volume(whole), rel=1e-9)
    assert ((before.vertices - point) @ normal).min() > -1e-12
    assert ((behind.vertices - point) @ normal).max() < 1e-12
    points = rng.uniform(-0.1, 0.4, (400, 3))
    side = (points - point) @ normal > 0
    np.testing.assert_array_equal(before.contains(points), whole.contains(points) & side)
    np.testing.assert_array_equal(behind.contains(points), whole.contains(points) & ~side)
    nothing, all_ = whole.cut(point + 2 * normal, normal)
    assert nothing is None
    assert all_ is whole


def generic_as_mesh(tip, head):
    """The generic head's nozzle and body as one closed mesh in the flange frame."""
    beam, end = tip[:3, 2], tip[:3, 3] - head.stand_off * tip[:3, 2]
    neck = end - head.nozzle_length * beam
    lower = frustum(end, neck, head.nozzle_radii)
    upper = frustum(neck, neck - head.body_length * beam, (head.body_radius,) * 2)
    return Mesh(
        vertices=np.vstack([lower.points, upper.points]),
        triangles=np.vstack([lower.triangles, upper.triangles + len(lower.points)]),
        name="head.stl",
    )


def test_a_head_as_a_mesh_is_judged_as_the_generic_one_of_its_shape():
    arm, tip, place = robot("abb_irb4600_60_205"), at([0, 0, 0.35]), at([1.3, 0, 0.5])
    tip[:3, :3] = Rotation.from_euler("y", 0.3).as_matrix()
    plate = mesh_of(box_between([-0.3, -0.3, -0.01], [0.3, 0.3, 0.0]))
    generic = CuttingHead(stand_off=2e-3, share=0.4)
    head = MeshHead(mesh=generic_as_mesh(tip, generic), stand_off=2e-3, share=0.4)
    assert head.keeps == generic.keeps
    cells = [
        cell_of(arm, tool=tip, head=h, part=plate, placement=place, near_miss=5e-3)
        for h in (generic, head)
    ]
    down = np.diag([1.0, -1, -1, 1])
    clear = []
    for height in (0.0, -1.1e-3, -1.3e-3, 0.1):
        down[:3, 3] = place[:3, 3] + [0, 0, height]
        q = arm.inverse(down @ np.linalg.inv(tip)).q
        ways = [dict(zip(c.pair_names, c.distances(q).T, strict=True)) for c in cells]
        for pair in (("part", "nozzle"), ("part", "head"), ("link 2", "head")):
            # Coal finds either to 1e-6 m; overlapping meshes have no depth to compare.
            one, two = (np.clip(way[pair], 0, None) for way in ways)
            np.testing.assert_allclose(one, np.clip(two, 0, None), atol=5e-6)
        clear.append([bool(c.clear(q[:1])[0]) for c in cells])
    # 0.4 of 2 mm are kept down to 1.2 mm below.
    assert clear == [[True] * 2, [True] * 2, [False] * 2, [True] * 2]


def test_a_mesh_head_that_is_not_where_the_tip_says_is_refused():
    arm, tip = robot("abb_irb4600_60_205"), at([0, 0, 0.35])
    mesh = generic_as_mesh(tip, CuttingHead())
    with pytest.raises(InputError, match=r"head head.stl: reaches 0.5 mm past the stand-off point"):
        cell_of(arm, tool=at([0, 0, 0.3495]), head=MeshHead(mesh=mesh))
    with pytest.raises(InputError, match=r"ends 150 mm before the stand-off point, .* 60 mm above"):
        cell_of(arm, tool=at([0, 0, 0.5]), head=MeshHead(mesh=mesh))
    for change in ({"share": 1.0}, {"stand_off": 0.0}, {"nozzle_length": -1.0}):
        with pytest.raises(InputError, match="head "):
            MeshHead(mesh=mesh, **change)
    # A nozzle alone: nothing above it to judge.
    short = MeshHead(mesh=mesh, nozzle_length=1.0)
    assert [body.name for body in short.bodies(chain_of(arm), tip)] == ["nozzle"]


def test_the_page_about_cells_runs_as_written(capsys):
    text = (ROOT / "docs" / "cells.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(compile(code, "cells.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith("audit passed")


def test_a_general_arm_has_a_cell_along_its_own_chain():
    arm = random_arm("a spherical wrist", 3)
    q = np.random.default_rng(55).uniform(-2, 2, (20, 6))
    np.testing.assert_allclose(chain_of(arm).forward(q), arm.forward(q), atol=1e-12)
    cell = cell_of(arm, tool=at([0, 0, 0.2]))
    assert {"base", "link 1", "link 2"} <= set(cell.approximate)
    assert np.isfinite(cell.distances(q)).all()
