"""Points and normals along curves on planes, cylinders and cones, many at once.

Most edges of parts lie on these surfaces, and OCCT evaluates only one point at a time.
"""

from __future__ import annotations

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_CurveType, GeomAbs_SurfaceType
from OCP.gp import gp_Ax3, gp_XYZ

from kerfpath._arrays import Array

__all__ = ["ElementarySurface", "parameters_on"]

LINE, CIRCLE = GeomAbs_CurveType.GeomAbs_Line, GeomAbs_CurveType.GeomAbs_Circle
PLANE = GeomAbs_SurfaceType.GeomAbs_Plane
CYLINDER, CONE = GeomAbs_SurfaceType.GeomAbs_Cylinder, GeomAbs_SurfaceType.GeomAbs_Cone


def parameters_on(curve: Geom2d_Curve, t: Array) -> Array:
    """Return the surface parameters (K, 2) at the parameters t (K,) of a curve on the surface."""
    adaptor = Geom2dAdaptor_Curve(curve)
    if adaptor.GetType() == LINE:
        line = adaptor.Line()
        at, way = line.Location(), line.Direction()
        return np.asarray(np.array([at.X(), at.Y()]) + t[:, None] * (way.X(), way.Y()))
    if adaptor.GetType() == CIRCLE:
        circle = adaptor.Circle()
        at, x, y = circle.Location(), circle.XAxis().Direction(), circle.YAxis().Direction()
        around = np.cos(t)[:, None] * (x.X(), x.Y()) + np.sin(t)[:, None] * (y.X(), y.Y())
        return np.asarray(np.array([at.X(), at.Y()]) + circle.Radius() * around)
    found = [curve.Value(one) for one in t.tolist()]
    return np.array([[p.X(), p.Y()] for p in found])


class ElementarySurface:
    """A plane, a cylinder or a cone: origin + (radius + slope v) e(u) + rise v z, or u x + v y.

    Parameters
    ----------
    position : gp_Ax3
    radius, slope, rise : float
        Radius (mm), and slope and rise (no unit) of a cylinder or cone; all 0 for a plane.
    """

    def __init__(self, position: gp_Ax3, radius: float, slope: float, rise: float) -> None:
        x, y, z = position.XDirection(), position.YDirection(), position.Direction()
        self._origin = _vector(position.Location().XYZ())
        self._x, self._y, self._z = (_vector(axis.XYZ()) for axis in (x, y, z))
        self._xy, self._yz, self._xz = (
            _vector(a.XYZ().Crossed(b.XYZ())) for a, b in ((x, y), (y, z), (x, z))
        )
        self._radius, self._slope, self._rise = radius, slope, rise

    @classmethod
    def of(cls, surface: BRepAdaptor_Surface) -> ElementarySurface | None:
        """Return the surface if it is one of these, else None."""
        kind = surface.GetType()
        if kind == PLANE:
            return cls(surface.Plane().Position(), 0.0, 0.0, 0.0)
        if kind == CYLINDER:
            cylinder = surface.Cylinder()
            return cls(cylinder.Position(), cylinder.Radius(), 0.0, 1.0)
        if kind == CONE:
            cone = surface.Cone()
            half = cone.SemiAngle()
            return cls(cone.Position(), cone.RefRadius(), float(np.sin(half)), float(np.cos(half)))
        return None

    def at(self, uv: Array) -> tuple[Array, Array]:
        """Return points (K, 3) mm and normals du x dv (K, 3), of any length, at uv (K, 2)."""
        u, v = uv[:, :1], uv[:, 1:]
        if not self._rise:
            normals = np.empty((len(uv), 3))
            normals[:] = self._xy
            return self._origin + u * self._x + v * self._y, normals
        cos, sin = np.cos(u), np.sin(u)
        reach = self._radius + self._slope * v
        points = self._origin + reach * (cos * self._x + sin * self._y) + self._rise * v * self._z
        across = self._rise * (cos * self._yz - sin * self._xz) - self._slope * self._xy
        return points, reach * across


def _vector(at: gp_XYZ) -> Array:
    return np.array([at.X(), at.Y(), at.Z()])
