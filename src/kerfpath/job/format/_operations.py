"""Apply the operations of a [[contour]] table to a drawn loop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kerfpath.contour import Contour
from kerfpath.job.format.tables import ContourTable
from kerfpath.job.format.tables._cut import LeadTable
from kerfpath.operations import (
    Side,
    Surface,
    bevel,
    lead_in,
    lead_out,
    loop_corners,
    micro_joints,
    offset,
    overlap,
    reverse,
    round_corners,
    slow_corners,
    smooth_axes,
    smoothest_start,
    start_at,
)

__all__ = ["keys_of_closed_loops", "shape_contour"]

MM = 1e-3
OTHER: dict[Side, Side] = {"left": "right", "right": "left"}


def keys_of_closed_loops(table: ContourTable) -> dict[str, str]:
    """Return the used keys that need a closed loop, each with what holds for an open line."""
    ends = 'begins at one of its ends (at the other with direction = "reversed")'
    asked = {
        "start": (table.start != "drawn", ends),
        "start_mm": (table.start_mm is not None, ends),
        "overlap_mm": (table.overlap_mm is not None, "does not return to its start"),
    }
    return {key: lacks for key, (used, lacks) in asked.items() if used}


def shape_contour(table: ContourTable, drawn: Contour, surface: Surface | None) -> list[Contour]:
    """Return the contours that may be cut for a loop: one, or one for each start and direction.

    The operations are applied in this order: direction, smoothed axes, kerf, corners, start, bevel,
    micro joints, overlap, leads, reduced speed at corners (also where a lead meets the cut at an
    angle). Corners and leads lie on `surface`.

    Raises
    ------
    InputError
        An operation cannot be applied to the loop.
    """
    ways = {"drawn": (False,), "reversed": (True,), "best": (False, True)}[table.direction]
    return [cut for way in ways for cut in _run(table, drawn, surface, backwards=way)]


def _run(
    table: ContourTable, contour: Contour, surface: Surface | None, *, backwards: bool
) -> list[Contour]:
    scrap: Side = OTHER[table.scrap] if backwards else table.scrap
    contour = reverse(contour) if backwards else contour
    if table.smooth_axes is not None:
        contour = smooth_axes(
            contour,
            table.smooth_axes.distance_mm * MM,
            limit=float(np.radians(table.smooth_axes.limit_deg)),
        )
    if table.kerf_mm is not None:
        sharp = table.corners is not None
        contour = offset(contour, table.kerf_mm * MM / 2, side=scrap, sharp=sharp)
    if table.corners is not None and table.corners.round_mm is not None:
        contour = round_corners(contour, table.corners.round_mm * MM, surface=surface)
    if table.corners is not None and table.corners.loop_mm is not None:
        contour = loop_corners(contour, table.corners.loop_mm * MM, side=scrap, surface=surface)
    return [_add_features(table, begun, surface, scrap) for begun in _start_contour(table, contour)]


def _start_contour(table: ContourTable, contour: Contour) -> list[Contour]:
    """Return the contour with the start, or with each of the starts, that the table asks for."""
    if table.start_mm is not None:
        return [start_at(contour, contour.s[0] + table.start_mm * MM)]
    if table.start == "smoothest":
        return [start_at(contour, smoothest_start(contour))]
    if table.start == "best":
        places = np.linspace(contour.s[0], contour.s[-1], table.candidates, endpoint=False)
        return [start_at(contour, s) for s in places]
    return [contour]


def _add_features(
    table: ContourTable, contour: Contour, surface: Surface | None, scrap: Side
) -> Contour:
    """Return the contour with its bevel, joints, slow corners, overlap and leads."""
    if table.bevel_deg:
        contour = bevel(contour, float(np.radians(table.bevel_deg)), side=scrap)
    if table.micro_joints is not None:
        joints = table.micro_joints
        contour = micro_joints(contour, joints.width_mm * MM, count=joints.count)
    if table.overlap_mm is not None:
        contour = overlap(contour, table.overlap_mm * MM)
    if table.lead_out is not None:
        contour = _with_lead(lead_out, contour, table.lead_out, scrap, surface)
    if table.lead_in is not None:
        contour = _with_lead(lead_in, contour, table.lead_in, scrap, surface)
    corners = table.corners
    if corners is not None and corners.slow_share is not None:
        contour = slow_corners(
            contour,
            corners.slow_share,
            distance=corners.slow_mm * MM,
            ramp=corners.ramp_mm * MM,
        )
    return contour


def _with_lead(
    lead: Callable[..., Contour], contour: Contour, table: LeadTable, scrap: Side,
    surface: Surface | None,
) -> Contour:  # fmt: skip
    return lead(
        contour,
        table.length_mm * MM,
        shape=table.shape,
        angle=float(np.radians(table.angle_deg)),
        side=scrap,
        surface=surface,
        fan=None if table.fan_mm is None else table.fan_mm * MM,
        speed_share=table.speed_share,
    )
