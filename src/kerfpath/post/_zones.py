"""Widths of the zones of a path, in which a controller rounds the corner at a node.

Where the zones of neighbouring nodes meet half way, and the tool runs through each at constant
acceleration, the motion is a quadratic B-spline with the nodes as its control points: its velocity
and acceleration are the differences that (5) and (6) bound, between the nodes too. In narrower
zones the same turn takes less time, and the joints accelerate more than planned.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from kerfpath._arrays import Array

__all__ = ["ZONE_STEP", "Zone", "zones_at"]

Zone = float | Literal["auto"]
SHARE = 0.49
"""Zone as a share of the distance to the next node: zones that meet are too large for UR."""
STEPS = 64
"""Steps per octave: zones are rounded down by up to 1.1 %, so that a program has few of them."""
ZONE_STEP = 2 ** (1 / STEPS) - 1
"""This step as a share of a zone."""
DIGIT = 1e-6
"""Zones are also rounded down to this (m), as languages write them."""


def zones_at(points: Array, zone: Zone, error: float) -> list[float]:
    """Return the zone (m) at each node except the first; 0 at the last, where the robot stops.

    Parameters
    ----------
    points : (K, 3) m
        The nodes.
    zone : float m or "auto"
        Radius. It is halved where nodes are close, until zones do not overlap. "auto": just short
        of half way to the next node.
    error : float m
        Largest distance by which the tip may miss a node with "auto", on a parabola.
    """
    if zone == 0:
        return [0.0] * (len(points) - 1)
    steps = np.diff(points, axis=0)
    gaps = np.linalg.norm(steps, axis=1)
    room = np.minimum(gaps[:-1], gaps[1:])
    if zone != "auto":
        room /= 2
        halvings = np.ceil(np.maximum(np.log2(zone / room), 0.0))
        return [*(zone * 0.5**halvings).tolist(), 0.0]
    turn = np.linalg.norm(np.diff(steps / gaps[:, None], axis=0), axis=1)
    widest = np.minimum(SHARE * room, 4 * error / np.maximum(turn, 1e-12))
    largest = widest.max(initial=0.0)
    lower = np.ceil(STEPS * np.log2(largest / widest) - 1e-9)
    zones = np.minimum(largest * 2 ** (-lower / STEPS), widest)
    return [*np.maximum(np.floor(zones / DIGIT) * DIGIT, DIGIT).tolist(), 0.0]
