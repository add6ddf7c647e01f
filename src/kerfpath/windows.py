"""Windows of gamma: stretches of a contour on which gamma is kept inside an interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypedDict

import numpy as np

from kerfpath.arrays import Array, Bools, freeze, in_radians, scalar, short_repr
from kerfpath.errors import InputError

__all__ = [
    "GammaWindow",
    "WindowData",
    "inside",
    "nearest_inside",
    "nodes_of",
    "room_beside",
    "samples_inside",
    "with_window_ends",
]

SAME_ANGLE, SAME_PLACE = 1e-9, 1e-9
"""rad, m: an end of a window this close to a sample of gamma, or to a node, is taken to be there
(rounding)."""
LEAST_OUT = 1e-6
"""rad: least part of the circle that a window leaves out."""


class WindowData(TypedDict):
    """A `GammaWindow` as JSON data."""

    start_m: float
    end_m: float
    low_rad: float
    high_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GammaWindow:
    """A stretch of a contour, and the interval of angles that gamma is kept in there.

    The window holds at every node on the stretch, ends included; between nodes gamma goes from the
    value at one to that at the next. If several windows cover a node, all of them hold.

    Parameters
    ----------
    start, end : float m
        Arc length `Contour.s` at which the stretch begins and ends.
    low, high : float rad
        Gamma lies between low and high, counted upwards from low; if high is below low, the
        interval crosses pi.

    Raises
    ------
    InputError
        An end before the start, an angle beyond a full turn, or an interval of all angles.
    """

    start: float
    end: float
    low: float
    high: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for field, unit in zip(fields(self), ("m", "m", "rad", "rad"), strict=True):
            value = scalar(getattr(self, field.name), f"gamma_windows {field.name}", unit=unit)
            object.__setattr__(self, field.name, value)
        if self.end < self.start:
            raise InputError(
                f"gamma_windows end: expected at least the start, {self.start:g} m, got "
                f"{self.end:g} m; for a stretch across the start of a closed contour give two "
                "windows"
            )
        for name in ("low", "high"):
            if abs(getattr(self, name)) > 2 * np.pi:
                wanted = "an angle from -2 pi to 2 pi rad"
                raise in_radians(getattr(self, name), f"gamma_windows {name}", wanted)
        turned = abs(self.high - self.low)
        if max(turned, self.width) > 2 * np.pi - LEAST_OUT:
            raise InputError(
                f"gamma_windows: the interval from {self.low:g} to {self.high:g} rad leaves "
                "nothing of the circle out; give a narrower one, or none"
            )

    @property
    def width(self) -> float:
        """Width of the interval, rad; 0: gamma is fixed."""
        return (self.high - self.low) % (2 * np.pi)

    def to_data(self) -> WindowData:
        """Return the window as JSON data, which `from_data` reads."""
        return {
            "start_m": self.start,
            "end_m": self.end,
            "low_rad": self.low,
            "high_rad": self.high,
        }

    @classmethod
    def from_data(cls, data: WindowData) -> GammaWindow:
        """Return the window that `to_data` wrote."""
        return cls(
            start=data["start_m"],
            end=data["end_m"],
            low=data["low_rad"],
            high=data["high_rad"],
        )


def nodes_of(windows: Sequence[GammaWindow], s: Array) -> Bools:
    """Return which windows hold at the nodes, (W, K), from the arc lengths s (K,) m."""
    start, end = (np.array([getattr(w, name) for w in windows]) for name in ("start", "end"))
    return np.asarray((s >= start[:, None] - SAME_PLACE) & (s <= end[:, None] + SAME_PLACE))


def with_window_ends(gamma: Array, windows: Sequence[GammaWindow]) -> Array:
    """Return samples of gamma (m,) rad, ascending, with those added that windows need.

    These are both ends of each window, so that it is a whole number of steps between samples, and
    the middle of the angles that it leaves out, so that no step crosses them.
    """
    asked = [
        angle for w in windows for angle in (w.low, w.high, w.high + (2 * np.pi - w.width) / 2)
    ]
    for angle in np.pi - np.mod(np.pi - np.array(asked), 2 * np.pi):
        if np.abs(_off(gamma, angle)).min() > SAME_ANGLE:
            gamma = np.sort(np.append(gamma, angle))
    return freeze(gamma)


def samples_inside(windows: Sequence[GammaWindow], s: Array, gamma: Array) -> Bools:
    """Return which samples of gamma (m,) rad every window admits at nodes s (K,) m, (K, m)."""
    inside = np.ones((len(s), len(gamma)), np.bool_)
    for window, here in zip(windows, nodes_of(windows, s), strict=True):
        inside[here] &= _inside(window, gamma)
    return inside


def inside(windows: Sequence[GammaWindow], s: Array, gamma: Array) -> Bools:
    """Return which gamma (B,) rad every window admits, each at its arc length s (B,) m."""
    kept = np.ones(len(gamma), np.bool_)
    for window, here in zip(windows, nodes_of(windows, s), strict=True):
        kept &= ~here | _inside(window, gamma)
    return kept


def nearest_inside(windows: Sequence[GammaWindow], s: Array, gamma: Array) -> Array | None:
    """Return gamma (K,) rad at the nodes s (K,) m, moved into the windows by the least angle.

    Return None if two windows leave no gamma at a node.
    """
    held = nodes_of(windows, s)
    ends = [end for w in windows for end in (w.low, w.high)]
    shifts = np.stack([np.zeros(len(s)), *(-_off(gamma, end) for end in ends)])
    kept = np.all(
        [~here | _inside(w, gamma + shifts) for w, here in zip(windows, held, strict=True)], axis=0
    )
    shifts = np.where(kept, shifts, np.inf)
    if not kept.any(axis=0).all():
        return None
    least = np.argmin(np.abs(shifts), axis=0)
    return np.asarray(gamma + shifts[least, np.arange(len(s))])


def room_beside(windows: Sequence[GammaWindow], s: Array, gamma: Array) -> tuple[Array, Array]:
    """Return the least and the largest gamma (K,) rad that the windows admit at nodes s (K,) m.

    `gamma` (K,) rad, which lies inside them, says on which turn. Infinite where no window holds.
    """
    low, high = np.full(len(s), -np.inf), np.full(len(s), np.inf)
    for w, here in zip(windows, nodes_of(windows, s), strict=True):
        at = gamma[here]
        up = np.clip(np.mod(at - w.low + SAME_ANGLE, 2 * np.pi) - SAME_ANGLE, 0.0, w.width)
        low[here] = np.maximum(low[here], at - up)
        high[here] = np.minimum(high[here], at - up + w.width)
    return low, high


def _off(gamma: Array, angle: float) -> Array:
    """Return gamma minus an angle, in [-pi, pi)."""
    return np.asarray(np.mod(gamma - angle + np.pi, 2 * np.pi) - np.pi)


def _inside(window: GammaWindow, gamma: Array) -> Bools:
    """Return which angles are in the interval of a window."""
    up = np.mod(gamma - window.low + SAME_ANGLE, 2 * np.pi)
    return np.asarray(up <= window.width + 2 * SAME_ANGLE)
