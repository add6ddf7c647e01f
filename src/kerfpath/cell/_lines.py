"""Distances between many line segments, such as the axes of capsules, by a formula."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cell._shapes import Capsule

__all__ = ["CapsuleLines", "lines_apart"]

PARALLEL = 1e-12
"""Squared sine of the angle below which two segments are parallel, and nearest at an end."""


class CapsuleLines:
    """The axes of capsules, each in a frame of an arm.

    Parameters
    ----------
    frames : (R,) int
        Frame of each capsule.
    capsules : sequence of Capsule

    Attributes
    ----------
    thick : (R,) m
        Radii of the capsules.
    """

    def __init__(self, frames: Sequence[int], capsules: Sequence[Capsule]) -> None:
        self._frames = np.array(frames, dtype=np.int64)
        self._start = np.array([c.start for c in capsules])
        self._along = np.array([c.end - c.start for c in capsules])
        self.thick = np.array([c.radius for c in capsules])

    def at(self, frames: Array) -> tuple[Array, Array]:
        """Return starts and vectors to the ends, (B, R, 3) m, at link poses (B, n+1, 4, 4)."""
        T = frames[:, self._frames]
        turned = T[..., :3, :3]
        start = (turned @ self._start[:, :, None])[..., 0] + T[..., :3, 3]
        return start, (turned @ self._along[:, :, None])[..., 0]


def lines_apart(p: Array, u: Array, q: Array, v: Array) -> Array:
    """Return distances (...) m between segments from p to p + u and from q to q + v, (..., 3) m."""
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    ends = [
        _to_line(p - q, v, vv), _to_line(p + u - q, v, vv),
        _to_line(q - p, u, uu), _to_line(q + v - p, u, uu),
    ]  # fmt: skip
    # If the nearest points lie between the ends of both segments, their distance is smaller.
    w = p - q
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    sine = uu * vv - uv**2
    skew = sine > PARALLEL * uu * vv
    whole = np.where(skew, sine, 1.0)
    s, t = (uv * vw - vv * uw) / whole, (uu * vw - uv * uw) / whole
    inside = skew & (s > 0) & (s < 1) & (t > 0) & (t < 1)
    between = w + s[..., None] * u - t[..., None] * v
    square = np.where(inside, (between**2).sum(-1), np.inf)
    return np.asarray(np.sqrt(np.minimum(np.min(ends, axis=0), square)))


def _to_line(w: Array, v: Array, vv: Array) -> Array:
    """Return squared distances of points w from segments from the origin to v; vv is v . v."""
    t = np.clip((w * v).sum(-1) / np.where(vv > 0, vv, 1.0), 0.0, 1.0)
    return np.asarray(((w - t[..., None] * v) ** 2).sum(-1))
