"""Meshes of other packages as bodies of a cell."""

from types import SimpleNamespace

import numpy as np
import pytest

from conftest import pose
from kerfpath import InputError
from kerfpath.cell import box, cell_of, mesh_of


def given(size=(200.0, 100.0, 50.0)):
    """A box in mm, as a package of meshes has it: vertices may be there twice."""
    made = box(np.array(size))
    corners = made.points[made.triangles]
    return SimpleNamespace(
        vertices=corners.reshape(-1, 3), faces=np.arange(len(corners) * 3).reshape(-1, 3)
    )


def test_a_mesh_is_the_solid_that_its_triangles_enclose(arm, tool):
    solid = mesh_of(given(), "mm", "table")
    np.testing.assert_allclose(solid.bounds, [[-0.1, -0.05, -0.025], [0.1, 0.05, 0.025]])
    assert len(solid.vertices) == 8
    assert solid.contains(np.array([[0.09, 0.04, 0.0], [0.11, 0.0, 0.0]])).tolist() == [True, False]
    T = pose([1.4, 0.1, 1.0])
    cells = [
        cell_of(arm, tool=tool, fixtures={"table": shape.moved(T)})
        for shape in (solid, box([0.2, 0.1, 0.05]))
    ]
    q = np.radians([[0.0, 0.0, 0.0, 0.0, 45.0, 0.0], [2.0, -1.0, 0.0, 0.0, 45.0, 0.0]])
    of_table = ["table" in pair for pair in cells[0].pair_names]
    one, two = (cell.distances(q)[:, of_table] for cell in cells)
    assert cells[0].pair_names == cells[1].pair_names
    assert 0 < one.min() < 0.2
    np.testing.assert_allclose(one, two, atol=1e-6)  # as coal has triangles, and a convex solid


def test_trimesh_has_such_meshes(arm):
    trimesh = pytest.importorskip("trimesh", reason="a benchmark requirement")
    ball = trimesh.creation.icosphere(subdivisions=3, radius=4.0)
    solid = mesh_of(ball, "in")
    np.testing.assert_allclose(solid.bounds, [[-0.1016] * 3, [0.1016] * 3], rtol=1e-3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"faces": np.zeros((0, 3), int)}, "0; the mesh is empty"),
        ({"faces": np.zeros((4, 4), int)}, r"faces: expected .*3.*4"),
        ({"faces": np.full((4, 3), 999)}, "refers to a vertex that does not exist"),
        ({"vertices": np.full((36, 3), np.nan)}, "vertices: every number must be finite"),
        ({"vertices": 1e9 * np.ones((36, 3)) * np.arange(36)[:, None]}, "is its unit right"),
        ({"faces": np.arange(33).reshape(-1, 3)}, "the surface is not closed"),
    ],
)
def test_a_mesh_that_is_no_solid_is_refused(change, said):
    mesh = SimpleNamespace(**{**vars(given()), **change})
    with pytest.raises(InputError, match=said):
        mesh_of(mesh, "mm", "table")


def test_the_unit_must_be_said_and_the_thing_be_a_mesh(arm, tool):
    with pytest.raises(InputError, match="table: unit: expected one of mm, cm, m, in, got 'km'"):
        mesh_of(given(), "km", "table")
    with pytest.raises(InputError, match="table: expected a mesh with vertices and faces, got int"):
        mesh_of(3, "mm", "table")
    for bodies in ({"fixtures": {"table": given()}}, {"part": given(), "placement": np.eye(4)}):
        with pytest.raises(InputError, match=r"expected a solid of kerfpath.cell, .* mesh_of\("):
            cell_of(arm, tool=tool, **bodies)
