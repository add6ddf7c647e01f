"""Triangle meshes: loops around their open border, and around faces between sharp edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopoDS import TopoDS_Shape
from scipy.spatial import Delaunay
from tests.cad.sheets import PROFILES, sheet
from tests.cad.test_part import write_step

from kerfpath.cad import Part, read
from kerfpath.errors import InputError

Triangles = np.ndarray
"""Corners (F, 3, 3) mm."""


def stl(path: Path, triangles: Triangles) -> Path:
    rows = ["solid a"]
    for corners in triangles:
        rows += ["facet normal 0 0 0", "outer loop"]
        rows += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
        rows += ["endloop", "endfacet"]
    path.write_text("\n".join([*rows, "endsolid a"]))
    return path


def ring(radius: float, count: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def annulus(lift: float) -> Triangles:
    """Return a plate with a hole, of a paraboloid's height over each vertex."""
    flat = np.vstack([ring(50, 60), ring(35, 40), ring(20, 24)])
    found = flat[Delaunay(flat).simplices]
    found = found[np.linalg.norm(found.mean(axis=1), axis=1) > 20 * np.cos(np.pi / 24)]
    return np.concatenate([found, lift * (found**2).sum(axis=2, keepdims=True)], axis=2)


def box(x: float, y: float, z: float) -> Triangles:
    """Return a closed box, its triangles counter-clockwise from outside."""
    faces = []
    for axis in range(3):
        for end in (0, 1):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            square = np.zeros((4, 3))
            square[:, axis] = end
            square[:, u], square[:, v] = (0, 1, 1, 0), (0, 0, 1, 1)
            square = square if end else square[::-1]
            faces += [square[[0, 1, 2]], square[[0, 2, 3]]]
    return np.array(faces) * [x, y, z]


def turns(part: Part, name: str) -> float:
    """Return the vector area of a loop along the outward normal, mm^2."""
    contour = part.contour(name)
    points = contour.points[:-1] * 1e3
    area = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2
    return float(area @ -contour.axes.mean(axis=0) / np.linalg.norm(contour.axes.mean(axis=0)))


@pytest.mark.parametrize("lift", [0.0, 0.002])
def test_an_open_mesh_has_its_border_and_its_holes(tmp_path: Path, lift: float) -> None:
    part = read(stl(tmp_path / "a.stl", annulus(lift)), unit="mm")
    (outer, hole) = part.loops
    assert (outer.name, outer.kind, outer.edges) == ("mesh/outer", "outer", 60)
    assert (hole.name, hole.kind, hole.edges) == ("mesh/hole1", "inner", 24)
    assert outer.length == pytest.approx(2e-3 * 50 * 60 * np.sin(np.pi / 60), rel=1e-6)
    assert turns(part, outer.name) == pytest.approx(30 * 50**2 * np.sin(np.pi / 30), rel=1e-3)
    assert turns(part, hole.name) == pytest.approx(-12 * 20**2 * np.sin(np.pi / 12), rel=1e-3)
    for loop in (outer, hole):
        contour = part.contour(loop.name)
        x, y = 1e3 * contour.points[:, :2].T
        expected = np.stack([2 * lift * x, 2 * lift * y, np.full(len(x), -1.0)], axis=1)
        expected /= np.linalg.norm(expected, axis=1)[:, None]
        # Triangles beside the border are on its inside only.
        assert (contour.axes * expected).sum(axis=1).min() > np.cos(np.radians(2))


def test_a_closed_mesh_has_the_faces_between_its_sharp_edges(tmp_path: Path) -> None:
    part = read(stl(tmp_path / "box.STL", box(20, 30, 5)), unit="in")
    assert part.faces == 6
    sizes = sorted(round(loop.length / 0.0254, 6) for loop in part.pick(kind="outer"))
    assert sizes == [50, 50, 70, 70, 100, 100]
    for loop in part.loops:
        contour = part.contour(loop.name)
        middle = np.array([10, 15, 2.5]) * 0.0254
        assert ((middle - contour.points) * contour.axes).sum(axis=1).min() > 0
        assert turns(part, loop.name) > 0
    assert part.mesh()[1].shape == (12, 3)


def test_obj_and_ply_are_the_same(tmp_path: Path) -> None:
    corners = box(20, 30, 5)[:10].reshape(-1, 3)
    rows = [f"{x:g} {y:g} {z:g}" for x, y, z in corners]
    faces = np.arange(30).reshape(-1, 3)
    obj = tmp_path / "a.obj"
    obj.write_text(
        "".join(f"v {row}\n" for row in rows)
        + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces.tolist())
    )
    ply = tmp_path / "a.ply"
    ply.write_text(
        "ply\nformat ascii 1.0\nelement vertex 30\nproperty float x\nproperty float y\n"
        "property float z\nelement face 10\nproperty list uchar int vertex_indices\nend_header\n"
        + "\n".join([*rows, *(f"3 {a} {b} {c}" for a, b, c in faces.tolist())])
        + "\n"
    )
    for path in (obj, ply):
        part = read(path, unit="mm")
        (border,) = [loop for loop in part.loops if loop.is_main]
        assert (border.name, border.edges) == ("mesh/outer", 4)
        assert border.length == pytest.approx(0.1, abs=1e-8)


def test_what_is_no_cut_is_refused(tmp_path: Path) -> None:
    angle = np.linspace(0, np.pi, 40)[:, None]
    around = np.linspace(0, 2 * np.pi, 80)
    grid = np.stack(
        [
            np.sin(angle) * np.cos(around),
            np.sin(angle) * np.sin(around),
            np.cos(angle) + 0 * around,
        ],
        axis=2,
    )
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    ball = 30 * np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)
    path = stl(tmp_path / "ball.stl", ball)
    with pytest.raises(InputError, match="closed surface without sharp edges"):
        read(path, unit="mm")
    with pytest.raises(InputError, match="states no length unit"):
        read(path)
    with pytest.raises(InputError, match="axis: expected a drawing of lines, got a mesh"):
        read(path, unit="mm", axis=(0, 0, -1))


def tube(radius: float, length: float, around: int, along: int, taper: float = 0.0) -> Triangles:
    """Return an open tube about z; its radius grows by `taper` for each mm of height."""
    turn = 2 * np.pi * np.arange(around + 1) / around
    z = np.linspace(0, length, along + 1)[:, None]
    wide = radius + taper * z
    grid = np.stack([wide * np.cos(turn), wide * np.sin(turn), z + 0 * turn], axis=2)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)


@pytest.mark.parametrize("taper", [0.0, 0.2])
@pytest.mark.parametrize("up", [1, -1])
def test_a_section_of_a_tube_is_cut_at_right_angles_to_its_wall(
    tmp_path: Path, taper: float, up: int
) -> None:
    path = stl(tmp_path / "a.stl", tube(20, 60, 90, 7, taper))
    heights = [0.013, 0.031]
    part = read(path, unit="mm", section=(0, 0, 3 * up), section_at=[up * z for z in heights])
    assert [(loop.name, loop.kind) for loop in part.loops] == [
        ("section1/outer", "outer"),
        ("section2/outer", "outer"),
    ]
    for loop, z in zip(part.loops, heights, strict=True):
        contour = part.contour(loop.name)
        radius = 20e-3 + taper * z
        assert np.ptp(contour.points[:, 2]) < 1e-12
        assert contour.points[0, 2] == pytest.approx(z, abs=1e-12)
        out = contour.points * [1, 1, 0] / np.linalg.norm(contour.points[:, :2], axis=1)[:, None]
        # The tube has 90 sides: its chords leave the circle by 1 - cos(2 deg) of the radius.
        assert np.abs(np.linalg.norm(contour.points[:, :2], axis=1) / radius - 1).max() < 6.1e-4
        expected = -(out - [0, 0, taper]) / np.hypot(1, taper)
        # Normals at the ends of the mesh have triangles on one side only.
        assert (contour.axes * expected).sum(axis=1).min() > np.cos(np.radians(1))
        # What is above the plane is on the left, seen from outside.
        steps = np.diff(contour.points, axis=0)
        left = np.cross(-contour.axes[:-1], steps)
        assert (left[:, 2] * up).min() > 0


def test_a_section_of_a_box_turns_at_its_edges_alone(tmp_path: Path) -> None:
    path = stl(tmp_path / "a.stl", box(30, 40, 60))
    part = read(path, unit="mm", section=(0, 0, 1), section_at=[0.02])
    (loop,) = part.loops
    assert loop.length == pytest.approx(0.14, abs=1e-12)
    contour = part.contour(loop.name)
    near = np.abs(contour.axes[:, :2]).min(axis=1) > 1e-9
    corners = contour.points[near] * 1e3
    found = {(round(x), round(y)) for x, y, _ in corners.tolist()}
    assert found == {(0, 0), (30, 0), (30, 40), (0, 40)}
    flat = contour.points[~near][:, :2] * 1e3
    from_corner = np.linalg.norm(flat[:, None] - np.array(sorted(found))[None], axis=2).min(axis=1)
    assert from_corner.min() == pytest.approx(1.0, abs=1e-9)
    (note,) = part.notes
    assert "within 1 mm before and behind sharp edges: section1/outer by up to 90 deg at" in note
    assert len(loop.edge_turns) == 4


def test_a_plane_may_cut_a_hole_and_an_open_sheet(tmp_path: Path) -> None:
    solid = np.concatenate([box(30, 30, 30), box(10, 10, 50)[:, ::-1] + [10, 10, -10]])
    part = read(stl(tmp_path / "a.stl", solid), unit="mm", section=(0, 0, 1), section_at=[0.015])
    assert [loop.kind for loop in part.loops] == ["outer", "inner"]
    sheet = annulus(0.002)
    part = read(stl(tmp_path / "b.stl", sheet), unit="mm", section=(1, 0, 0), section_at=[0.005])
    assert [(loop.name, loop.kind) for loop in part.loops] == [
        ("section1/line1", "open"),
        ("section1/line2", "open"),
    ]


def test_planes_through_corners_and_bad_planes(tmp_path: Path) -> None:
    path = stl(tmp_path / "a.stl", tube(20, 60, 90, 6))
    part = read(path, unit="mm", section=(0, 0, 1), section_at=[0.02])  # through a ring of corners
    assert part.loops[0].edges == 90
    for options, message in (
        ({"section": (0, 0, 1), "section_at": [0.061]}, "reaches from 0 to 60 mm along the normal"),
        ({"section": (0, 0, 1), "section_at": [0.0]}, "expected a plane within the part"),
        ({"section": (0, 0, 1)}, "section and section_at: expected both"),
        ({"section_at": [0.02]}, "section and section_at: expected both"),
        ({"section": (0, 0, 0), "section_at": [0.02]}, "a vector of length 0"),
    ):
        with pytest.raises(InputError, match=message):
            read(path, unit="mm", **options)
    (tmp_path / "a.csv").write_text("x,y,z,nx,ny,nz\n0,0,0,0,0,1\n")
    with pytest.raises(InputError, match="section: expected a triangle mesh, got a table"):
        read(tmp_path / "a.csv", section=(0, 0, 1), section_at=[0.0])
    odd = tube(20, 60, 90, 6)
    odd[3] = odd[3][::-1]
    with pytest.raises(InputError, match="turned opposite ways; repair the mesh"):
        read(stl(tmp_path / "b.stl", odd), unit="mm", section=(0, 0, 1), section_at=[0.005])


# ----------------------------------------------------------------- sides of sheets in closed meshes


def square_tube(holes: int, outer: float = 40.0, wall: float = 2.0) -> TopoDS_Shape:
    """A square tube with sharp edges and round holes of 8 mm through its upper wall."""
    shape = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), 200.0, outer, outer).Shape()
    size = outer - 2 * wall
    bore = BRepPrimAPI_MakeBox(gp_Pnt(-1, wall, wall), 202.0, size, size).Shape()
    shape = BRepAlgoAPI_Cut(shape, bore).Shape()
    for k in range(holes):
        at = gp_Ax2(gp_Pnt(30 + 40 * k, outer / 2, outer / 2), gp_Dir(0, 0, 1))
        shape = BRepAlgoAPI_Cut(shape, BRepPrimAPI_MakeCylinder(at, 4.0, outer).Shape()).Shape()
    return shape


SHEETS = {
    "U profile": lambda: sheet(PROFILES["U"]),
    "hat": lambda: sheet(PROFILES["hat"]),
    "square tube": lambda: square_tube(4),
    "plate with a hole": lambda: BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeBox(90.0, 60.0, 3.0).Shape(),
        BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(30, 30, -1), gp_Dir(0, 0, 1)), 9.0, 9.0).Shape(),
    ).Shape(),
}


@pytest.mark.parametrize("name", SHEETS)
def test_a_closed_mesh_of_a_sheet_has_the_sides_of_the_sheet(tmp_path: Path, name: str) -> None:
    """Of a solid and of its mesh the same holes are on the outer side, and none twice."""
    write_step(tmp_path / "a.step", SHEETS[name]())
    solid = read(tmp_path / "a.step")
    vertices, triangles = solid.mesh(2e-5)
    part = read(stl(tmp_path / "a.stl", 1e3 * vertices[triangles]), unit="mm")
    for side in ("outer", "inner"):
        expected, found = (
            sorted(loop.length for loop in each.loops if loop.is_main and loop.side == side)
            for each in (solid, part)
        )
        assert found == pytest.approx(expected, rel=0.01)
    assert {loop.side for loop in part.loops} == {"outer", "inner", "edge"}


def test_the_end_of_a_square_tube_is_cut_at_right_angles_to_its_walls(tmp_path: Path) -> None:
    """The axis turns within 1 mm of the edges, not along the walls."""
    write_step(tmp_path / "tube.step", square_tube(0))
    vertices, triangles = read(tmp_path / "tube.step").mesh()
    part = read(stl(tmp_path / "tube.stl", 1e3 * vertices[triangles]), unit="mm")
    ends = [loop for loop in part.loops if loop.is_main and loop.side == "outer"]
    assert [round(1e3 * loop.length, 6) for loop in ends] == [160, 160]
    for loop in ends:
        nodes = part.contour(loop.name).resample(spacing=5e-4)
        square = np.abs(nodes.axes).max(axis=1) > 1 - 1e-9
        assert np.mean(square) > (40 - 2.5) / 40
        inward = np.array([0, 0.02, 0.02]) - nodes.points * [0, 1, 1]
        assert (inward * nodes.axes).sum(axis=1).min() > 0.019


def test_the_outer_side_of_a_mesh_can_be_told(tmp_path: Path) -> None:
    file = stl(tmp_path / "plate.stl", box(90, 60, 2))
    for towards, z in (((0, 0, 1), 2), ((0, 0, -1), 0)):
        part = read(file, unit="mm", outer_towards=towards)
        (outer,) = part.pick(side="outer")
        assert outer.bounding_box[:, 2] == pytest.approx(z * 1e-3)
    (outer,) = read(file, unit="mm").pick(side="outer")
    assert outer.bounding_box[:, 2] == pytest.approx(2e-3)
    with pytest.raises(InputError, match="outer_towards: expected a closed mesh, got an open one"):
        read(stl(tmp_path / "open.stl", annulus(0.0)), unit="mm", outer_towards=(0, 0, 1))
    with pytest.raises(InputError, match="outer_towards: expected a closed mesh, got sections"):
        read(file, unit="mm", outer_towards=(0, 0, 1), section=(1, 0, 0), section_at=[0.01])
