"""How wide the zones of a path are, in which a controller rounds the corner at a node.

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
"""Of the distance to the next node: zones that meet are too large for some controllers (UR)."""
STEPS = 64
"""To the octave: zones are rounded down to steps of 1.1 %, so that a program has few of them."""
ZONE_STEP = 2 ** (1 / STEPS) - 1
"""Such a step as a share of a zone."""
DIGIT = 1e-6
"""m: and to what languages say of them."""


def zones_at(points: Array, zone: Zone, error: float) -> list[float]:
    """Return the zone (m) at each node but the first; 0 at the last, where the robot stops.

    Parameters
    ----------
    points : (K, 3) m
        The nodes.
    zone : float m or "auto"
        Radius; halved, where nodes are nearer to each other, until zones do not overlap. "auto":
        just short of half way to the next node.
    error : float m
        Of "auto": the largest distance by which the tip may pass a node, on a parabola.
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
