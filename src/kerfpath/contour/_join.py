"""Join contours end to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from kerfpath.contour._contour import Contour
from kerfpath.errors import InputError

__all__ = ["join"]


def join(
    contours: Sequence[Contour],
    *,
    gap_tolerance: float = 1e-5,
    spacing: float | None = None,
    closed: bool = False,
    name: str | None = None,
) -> Contour:
    """Return one contour that runs through `contours` in order.

    Parameters
    ----------
    contours : sequence of open Contour
        Each begins where the one before it ends.
    gap_tolerance : float m
        Largest gap between an end and the next start that is bridged; the two become one node.
    spacing : float m, optional
        Resample the joined contour evenly; the nodes of the segments are not kept.
    closed : bool
        Whether the last segment returns to the first.
    name : str, optional
        Default: the names of the contours, joined by "+".

    Raises
    ------
    InputError
        No contour, a closed contour among several, or a gap above the tolerance.
    """
    if not contours:
        raise InputError("join: expected at least one contour, got none")
    for c in contours:
        if c.closed and len(contours) > 1:
            raise InputError(f"join: expected open contours, but {c.name!r} is closed")
    for before, after in pairwise(contours):
        gap = float(np.linalg.norm(before.points[-1] - after.points[0]))
        if gap > gap_tolerance:
            raise InputError(
                f"join: {before.name!r} ends {gap * 1e3:.4f} mm from the start of {after.name!r} "
                f"(allowed {gap_tolerance * 1e3:g} mm); check order and direction"
            )
    first = contours[0]
    whole = np.vstack([first.points, *(c.points[1:] for c in contours[1:])])
    if closed and np.linalg.norm(whole[0] - whole[-1]) <= gap_tolerance:
        whole[-1] = whole[0]
    # A node between two segments begins the later one.
    kind = np.concatenate([*(c.kind[:-1] for c in contours), contours[-1].kind[-1:]])
    share = np.concatenate([*(c.speed_share[:-1] for c in contours), contours[-1].speed_share[-1:]])
    joined = Contour(
        whole,
        np.vstack([first.axes, *(c.axes[1:] for c in contours[1:])]),
        closed=closed or first.closed,
        kind=kind,
        speed_share=share,
    )
    joined = replace(joined, name=name or "+".join(c.name for c in contours))
    return joined if spacing is None else joined.resample(spacing=spacing)
