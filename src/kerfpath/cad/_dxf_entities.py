"""Convert the entities of a DXF that are lines to cut to curves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from ezdxf.entities.arc import Arc as DxfArc
from ezdxf.entities.circle import Circle
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.ellipse import Ellipse
from ezdxf.entities.line import Line as DxfLine
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.polyline import Polyline
from ezdxf.entities.spline import Spline as DxfSpline
from scipy.interpolate import BSpline

from kerfpath._arrays import Array
from kerfpath.cad._curves import Arc, Curve, Line, Spline

__all__ = ["curves_of"]


def curves_of(entity: DXFGraphic, T: Array) -> Iterator[Curve]:
    """Yield the curves (mm) of an entity, or none if it is no line to cut.

    T (4, 4) maps its coordinates to mm. Blocks may have different scales in x and y; arcs, ellipses
    and splines stay exact under any such map, without division.
    """

    def point(at: Iterable[float]) -> Array:
        return np.asarray(T[:3, :3] @ np.array([*at], dtype=float) + T[:3, 3])

    def along(vector: Iterable[float]) -> Array:
        return np.asarray(T[:3, :3] @ np.array([*vector], dtype=float))

    if isinstance(entity, DxfLine):
        yield Line(point(entity.dxf.start), point(entity.dxf.end))
    elif isinstance(entity, Circle):  # ARC is a subclass
        first, last = 0.0, 360.0
        if isinstance(entity, DxfArc):
            first, last = float(entity.dxf.start_angle), float(entity.dxf.end_angle)
            last = first + ((last - first) % 360.0 or 360.0)
        ocs, radius = entity.ocs(), float(entity.dxf.radius)
        yield Arc(
            point(ocs.to_wcs(entity.dxf.center)),
            along(ocs.to_wcs((radius, 0, 0))),
            along(ocs.to_wcs((0, radius, 0))),
            *np.radians([first, last]).tolist(),
        )
    elif isinstance(entity, Ellipse):
        first, last = float(entity.dxf.start_param), float(entity.dxf.end_param)
        yield Arc(
            point(entity.dxf.center),
            along(entity.dxf.major_axis),
            along(entity.minor_axis),
            first,
            first + ((last - first) % (2 * np.pi) or 2 * np.pi),
        )
    elif isinstance(entity, LWPolyline) or (
        isinstance(entity, Polyline) and (entity.is_2d_polyline or entity.is_3d_polyline)
    ):
        for piece in entity.virtual_entities():
            yield from curves_of(piece, T)
    elif isinstance(entity, DxfSpline):
        tool = entity.construction_tool()
        weights = np.array(tool.weights() or np.ones(tool.count))
        points = np.array([point(p) for p in tool.control_points])
        net = np.column_stack([points * weights[:, None], weights])
        spline = BSpline(np.array(tool.knots()), net, tool.order - 1)
        low, high = spline.t[spline.k], spline.t[-spline.k - 1]
        yield Spline(spline, float(low), float(high))
