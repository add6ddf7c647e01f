"""Starts, directions, overlaps and micro joints of cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kerfpath._arrays import Array, floats, scalar
from kerfpath.contour import KINDS, Contour, angle_between, unit
from kerfpath.errors import InputError

__all__ = [
    "micro_joints",
    "overlap",
    "reverse",
    "smoothest_start",
    "start_at",
    "with_nodes",
]

SAME_PLACE = 1e-7
"""m: nodes closer than this are the same."""
ALIKE = 1e-6
"""rad: windows whose turns differ by less are equally smooth."""
MICRO_JOINT, OVERLAP = (KINDS.index(word) for word in ("micro joint", "overlap"))


def reverse(contour: Contour) -> Contour:
    """Return the contour in the opposite direction, with the scrap on its other side.

    Raises
    ------
    InputError
        A contour that has a pierce; reverse it before adding the lead-in.
    """
    if contour.kind[0] == KINDS.index("pierce"):
        raise InputError(
            f"reverse: contour {contour.name!r} has a pierce; reverse it before adding the lead-in"
        )
    return replace(
        contour,
        points=contour.points[::-1],
        axes=contour.axes[::-1],
        s=contour.s[-1] - contour.s[::-1],
        time=None if contour.time is None else contour.time[-1] - contour.time[::-1],
        kind=np.append(contour.kind[-2::-1], contour.kind[0]),
        speed_share=contour.speed_share[::-1],
        x=None if contour.x is None else contour.x[::-1],
    )


def start_at(contour: Contour, s: float) -> Contour:
    """Return a closed contour that begins at arc length s (m) of this one.

    Raises
    ------
    InputError
        An open contour, or an arc length outside it.
    """
    _require_closed(contour, "start_at")
    s = scalar(s, "s", unit="m")
    if not contour.s[0] <= s <= contour.s[-1]:
        raise InputError(
            f"start_at: expected 0 to {contour.length * 1e3:g} mm along {contour.name!r}, got "
            f"{s * 1e3:g} mm"
        )
    opened = with_nodes(contour, np.array([s]))
    k = int(np.argmin(np.abs(opened.s - s))) % (len(opened) - 1)
    order = np.append(np.roll(np.arange(len(opened) - 1), -k), k)
    kind = opened.kind[order]
    kind[-1] = kind[-2]
    return replace(
        opened,
        points=opened.points[order],
        axes=opened.axes[order],
        s=None,  # type: ignore[arg-type]  # filled in along the polyline
        time=None,
        kind=kind,
        speed_share=opened.speed_share[order],
        x=None,
    )


def smoothest_start(contour: Contour, *, window: float = 5e-3) -> float:
    """Return the arc length (m) around which path and tool axis turn least, for `start_at`.

    Parameters
    ----------
    contour : closed Contour
    window : float m
        Length of path over which the turn around each node is summed.

    Raises
    ------
    InputError
        An open contour, or a window that is not positive.
    """
    _require_closed(contour, "smoothest_start")
    half = scalar(window, "window", unit="m", above=0.0) / 2
    axes, along = contour.axes[:-1], unit(np.diff(contour.points, axis=0))
    turn = angle_between(np.roll(along, 1, axis=0), along)
    turn += angle_between(axes, np.roll(axes, 1, axis=0)) / 2
    turn += angle_between(axes, np.roll(axes, -1, axis=0)) / 2
    s, length = contour.s[:-1] - contour.s[0], contour.length
    half = min(half, length / 2)
    around = np.concatenate([s - length, s, s + length])
    sums = np.concatenate([[0.0], np.cumsum(np.tile(turn, 3))])
    total = (
        sums[np.searchsorted(around, s + half, side="right")]
        - sums[np.searchsorted(around, s - half, side="left")]
    )
    smooth = total <= total.min() + ALIKE
    if smooth.all():
        return float(contour.s[0])
    # Take the middle of the longest stretch of equally smooth places.
    rough = np.flatnonzero(~smooth)
    gap = np.diff(np.append(s[rough], s[rough[0]] + length))
    k = int(np.argmax(gap))
    middle = s[rough[k]] + gap[k] / 2
    return float(contour.s[0] + s[int(np.argmin(np.abs(s - middle % length)))])


def overlap(contour: Contour, length: float) -> Contour:
    """Return a closed contour as an open one that continues past its start by `length` (m).

    Raises
    ------
    InputError
        An open contour, an overlap as long as the contour or longer, or one that would cut a micro
        joint.
    """
    _require_closed(contour, "overlap")
    length = scalar(length, "overlap", unit="m", above=0.0)
    if length >= contour.length:
        raise InputError(
            f"overlap: expected less than the contour's {contour.length * 1e3:g} mm, got "
            f"{length * 1e3:g} mm"
        )
    again = contour.between(contour.s[0], contour.s[0] + length)
    if (again.kind == MICRO_JOINT).any():
        raise InputError(
            f"overlap: the first {length * 1e3:g} mm of {contour.name!r} hold a micro joint, which "
            "would be cut through"
        )
    kind = np.concatenate([contour.kind[:-1], np.full(len(again), OVERLAP)])
    return Contour(
        np.vstack([contour.points, again.points[1:]]),
        np.vstack([contour.axes, again.axes[1:]]),
        kind=kind,
        speed_share=np.append(contour.speed_share, again.speed_share[1:]),
        name=contour.name,
    )


def micro_joints(
    contour: Contour, width: float, *, count: int | None = None, at: Sequence[float] | None = None
) -> Contour:
    """Return the contour with stretches that are not cut through, so that the part stays in place.

    Parameters
    ----------
    contour : Contour
    width : float m
        Width of each joint.
    count : int
        Number of joints, evenly spaced; the first is half a spacing after the start.
    at : sequence of float m
        Arc lengths of the middles of the joints, instead of `count`.

    Raises
    ------
    InputError
        Both or neither of `count` and `at`; joints that overlap, pass the ends, or lie in a lead.
    """
    if (count is None) == (at is None):
        raise InputError("micro_joints: give either count= or at=")
    width = scalar(width, "micro joint width", unit="m", above=0.0)
    if at is not None:
        middles = np.sort(floats(at, "at", (None,)))
        if not middles.size:
            raise InputError("micro_joints: expected at least one place, got at=[]")
    else:
        if not count or count < 1:
            raise InputError(f"micro_joints: expected a count of at least 1, got {count}")
        middles = contour.s[0] + (np.arange(count) + 0.5) * contour.length / count
    ends = np.c_[middles - width / 2, middles + width / 2].ravel()
    if (np.diff(ends) <= 0).any() or ends[0] <= contour.s[0] or ends[-1] >= contour.s[-1]:
        raise InputError(
            f"micro_joints: {len(middles)} joints of {width * 1e3:g} mm do not fit into "
            f"{contour.length * 1e3:g} mm of {contour.name!r} without overlap"
        )
    marked = with_nodes(contour, ends)
    place = np.searchsorted(ends, marked.s + SAME_PLACE, side="right")
    joint = place % 2 == 1
    if marked.kind[joint].any():
        raise InputError(
            f"micro_joints: a joint of {contour.name!r} lies in a lead, loop or overlap; add "
            "micro joints before those, or elsewhere"
        )
    kind = np.where(joint, MICRO_JOINT, marked.kind)
    return replace(marked, kind=kind)


def with_nodes(contour: Contour, s: Array) -> Contour:
    """Return the contour with nodes added at arc lengths s (m) where it has none."""
    known = np.abs(contour.s - s[:, None]).min(axis=1) <= SAME_PLACE
    every = np.sort(np.concatenate([contour.s, s[~known]]))
    return replace(contour, x=None, time=None).at_nodes(every)


def _require_closed(contour: Contour, what: str) -> None:
    if not contour.closed:
        raise InputError(f"{what}: expected a closed contour, but {contour.name!r} is open")
