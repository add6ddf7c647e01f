"""Triangulate a shape for pictures."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape

from kerfpath._arrays import Array, Ints
from kerfpath.cad._shape import list_shapes

__all__ = ["triangulate"]

ANGLE = 0.35
"""Largest angle (rad) between neighbouring triangles: small holes still look round."""


def triangulate(shape: TopoDS_Shape, deflection: float) -> tuple[Array, Ints, Ints]:
    """Return vertices (V, 3) mm and outward triangles (F, 3), within `deflection` mm.

    The third array (f,) has the number of triangles of each face, in their order.
    """
    # OCCT keeps the finest mesh so far on the shape; the result must not depend on it.
    BRepTools.Clean_s(shape)
    BRepMesh_IncrementalMesh(shape, deflection, False, ANGLE, False)
    vertices, triangles, count = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    sizes: list[int] = []
    for found in list_shapes(shape, TopAbs_ShapeEnum.TopAbs_FACE):
        face, location = TopoDS.Face(found), TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        sizes.append(0 if mesh is None else mesh.NbTriangles())
        if mesh is None:
            continue
        placed = location.Transformation()
        nodes = [mesh.Node(k).Transformed(placed) for k in range(1, mesh.NbNodes() + 1)]
        corners = np.array([mesh.Triangle(k).Get() for k in range(1, mesh.NbTriangles() + 1)])
        if face.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
            corners = corners[:, ::-1]
        vertices.append(np.array([[p.X(), p.Y(), p.Z()] for p in nodes]))
        triangles.append(corners.astype(np.int64) - 1 + count)
        count += len(nodes)
    return (
        np.vstack(vertices),
        np.ascontiguousarray(np.vstack(triangles)),
        np.array(sizes, dtype=np.int64),
    )
