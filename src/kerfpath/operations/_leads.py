"""Lead-in and lead-out on the scrap side, laid on the healed surface."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np

from kerfpath._arrays import Array, scalar
from kerfpath.contour import KINDS, Contour, join, slerp, unit
from kerfpath.errors import InputError
from kerfpath.operations._start import reverse
from kerfpath.operations._surface import (
    TOUCH,
    Ribbon,
    Side,
    Surface,
    edge,
    lateral,
    lay_on,
    lean_axes,
    nearest,
    require_in_scrap,
)

__all__ = ["LeadShape", "lead_in", "lead_out"]

LeadShape = Literal["line", "arc"]

STEP = 2e-4
"""Distance (m) between the nodes of a lead."""


def lead_in(
    contour: Contour,
    length: float,
    *,
    shape: LeadShape = "line",
    angle: float = np.pi / 4,
    side: Side = "right",
    surface: Surface | None = None,
    fan: float | None = None,
    speed_share: float = 1.0,
    clearance: float = 2e-4,
) -> Contour:
    """Return the contour with a lead-in from a pierce in the scrap to its first node.

    The tool axis is normal to the surface at the pierce and fans to the axis of the cut. A closed
    contour becomes an open one that ends where its cut began.

    Parameters
    ----------
    contour : Contour
    length : float m
        Length of the lead.
    shape : {"line", "arc"}
        A line at `angle` to the first step, or an arc that turns by `angle` and joins it
        tangentially.
    angle : float rad
        At most pi / 2 for a line, pi for an arc; 0 is a tangent lead, for outer corners.
    side : {"left", "right"}
        Where the scrap is, seen from the nozzle along the travel.
    surface : Surface, optional
        Surface that the lead is laid on; default: the planes across the contour's own axes.
    fan : float m, optional
        Length over which the axis fans; default: the length of the lead.
    speed_share : float
        Share of the speed at the outer end of the lead; it changes evenly along the lead.
    clearance : float m
        Distance that the pierce must keep from the contour.

    Raises
    ------
    InputError
        A lead that touches the part, leaves the surface or ends too close to the part; a contour
        that already has a pierce; values out of range.
    """
    if contour.kind[0] == KINDS.index("pierce"):
        raise InputError(f"lead_in: contour {contour.name!r} already has a pierce")
    points, axes = _lay_lead(
        contour, length, shape, angle, side, surface or Ribbon(contour), fan, clearance, "lead-in"
    )
    kind = np.full(len(points), KINDS.index("lead-in"))
    kind[0] = KINDS.index("pierce")
    share = _share(points, speed_share, float(contour.speed_share[0]))
    lead = Contour(points, axes, kind=kind, speed_share=share, name=contour.name)
    return join([lead, replace(contour, closed=False, x=None, time=None)], name=contour.name)


def lead_out(
    contour: Contour,
    length: float,
    *,
    shape: LeadShape = "line",
    angle: float = np.pi / 4,
    side: Side = "right",
    surface: Surface | None = None,
    fan: float | None = None,
    speed_share: float = 1.0,
    clearance: float = 0.0,
) -> Contour:
    """Return the contour with a lead-out from its last node into the scrap.

    Parameters and exceptions are those of `lead_in`, except that the contour may have a pierce.
    """
    pierced = contour.kind == KINDS.index("pierce")
    kinds = np.where(pierced, KINDS.index("lead-in"), contour.kind)  # for `reverse`
    plain = replace(contour, closed=False, kind=kinds, x=None, time=None)
    backwards: Side = "left" if side == "right" else "right"
    points, axes = _lay_lead(
        reverse(plain), length, shape, angle, backwards, surface or Ribbon(contour), fan,
        clearance, "lead-out",
    )  # fmt: skip
    kind = np.full(len(points), KINDS.index("lead-out"))
    share = _share(points, speed_share, float(contour.speed_share[-1]))[::-1]
    lead = Contour(points[::-1], axes[::-1], kind=kind, speed_share=share, name=contour.name)
    return join([replace(contour, closed=False, x=None, time=None), lead], name=contour.name)


def _share(points: Array, far: float, near: float) -> Array:
    """Return speed shares (m,) from the outer end of a lead to the contour."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.asarray(far + (near - far) * s / s[-1])


def _lay_lead(
    contour: Contour, length: float, shape: LeadShape, angle: float, side: Side, surface: Surface,
    fan: float | None, clearance: float, what: str,
) -> tuple[Array, Array]:  # fmt: skip
    """Return points (m, 3) m and axes (m, 3) of a lead that ends in the contour's first node."""
    length = scalar(length, f"{what} length", unit="m", above=0.0)
    fan = length if fan is None else min(scalar(fan, "fan", unit="m", above=0.0), length)
    if shape not in get_args(LeadShape):
        raise InputError(f"{what} shape: expected line or arc, got {shape!r}")
    most = np.pi / 2 if shape == "line" else np.pi
    if not 0 <= angle <= most:
        raise InputError(
            f"{what} angle: expected 0 to {np.degrees(most):g} deg for a {shape}, got "
            f"{np.degrees(angle):g} deg"
        )
    back = np.linspace(length, 0.0, max(2, int(np.ceil(length / STEP))) + 1)
    start = contour.points[0]
    _, normal = surface.project(start[None])
    travel = (contour.points[1] - start)[None]
    along = unit(travel - (travel * normal).sum() * normal, "travel")
    aside = lateral(-normal, along, side)
    if shape == "line" or angle == 0:
        flat = start - back[:, None] * (np.cos(angle) * along - np.sin(angle) * aside)
    else:
        radius, turn = length / angle, back[:, None] / length * angle
        flat = start - radius * (np.sin(turn) * along - (1 - np.cos(turn)) * aside)
    points, normals = lay_on(surface, flat, contour, what)
    # The cut may lie beside the surface by rounding or kerf: close that gap along the lead.
    points = points + (1 - back / length)[:, None] * (start - points[-1])
    # The tilt of the cut's axis from the surface normal increases along the lead.
    leaning = lean_axes(normals, normal[0], contour.axes[0])
    axes = slerp(-normals, leaning, 1 - np.minimum(back / fan, 1)[:, None])
    _require_clearance(contour, points, side, clearance, what)
    return points, axes


def _require_clearance(
    contour: Contour, points: Array, side: Side, clearance: float, what: str
) -> None:
    """Raise InputError if a lead is on the part's side, or its outer end too close to the part."""
    part = edge(contour)
    require_in_scrap(part, points[:-1], side, what)
    apart = float(np.linalg.norm(points[0] - nearest(part, points[:1])[0]))
    if apart <= max(clearance, TOUCH):
        raise InputError(
            f"{what} of {contour.name!r} ends {apart * 1e3:.3g} mm from the part, expected more "
            f"than {clearance * 1e3:g} mm; make it shorter or change its angle"
        )
