"""The first triangle that each ray meets, by a hierarchy of boxes (Moeller and Trumbore 1997)."""

from __future__ import annotations

import math

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.kernels.jit import jit, jit_inline

LEAF = 4
"""Number of triangles in the smallest boxes."""
DEPTH = 64
"""Most boxes that wait at once: one for each level of the tree."""
START = 1e-6
"""Distance from the start of a ray up to which it meets nothing."""
FLAT = 1e-12
"""Ray and triangle are parallel below this share of the product of two of its edges."""
EDGE = 1e-9
"""Share of a triangle by which a ray may miss it, so that none passes between two."""


@jit_inline
def _may_meet(o: Array, d: Array, box: Array, nearest: float) -> bool:
    """Return whether a ray meets a box (2, 3) nearer than that."""
    enter, leave = 0.0, nearest
    for i in range(3):
        if d[i] == 0:
            if o[i] < box[0, i] or o[i] > box[1, i]:
                return False
            continue
        a, b = (box[0, i] - o[i]) / d[i], (box[1, i] - o[i]) / d[i]
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter <= leave + START


@jit_inline
def _distance(o: Array, d: Array, corners: Array) -> float:
    """Return how far a ray goes to a triangle (3, 3), inf if it misses."""
    ax, ay, az = corners[0, 0], corners[0, 1], corners[0, 2]
    ux, uy, uz = corners[1, 0] - ax, corners[1, 1] - ay, corners[1, 2] - az
    vx, vy, vz = corners[2, 0] - ax, corners[2, 1] - ay, corners[2, 2] - az
    hx, hy, hz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    volume = ux * hx + uy * hy + uz * hz
    edges = math.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz))
    if abs(volume) <= FLAT * edges:
        return np.inf
    sx, sy, sz = o[0] - ax, o[1] - ay, o[2] - az
    u = (sx * hx + sy * hy + sz * hz) / volume
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / volume
    t = (vx * qx + vy * qy + vz * qz) / volume
    met = u >= -EDGE and v >= -EDGE and u + v <= 1 + EDGE and t > START
    return t if met else np.inf


@jit
def first_met(
    origins: Array, directions: Array, own: Ints, corners: Array, body: Ints, boxes: Array
) -> tuple[Array, Ints]:
    """Return distance (K,) and triangle (K,) that rays (K, 3) meet first; inf and -1 for none.

    A ray meets the triangles (M, 3, 3) of its own body only. `boxes` (2 * L, 2, 3) is a complete
    tree of L leaves with box 1 as its root and boxes 2 i and 2 i + 1 in box i; the triangles lie in
    the leaves in their order, LEAF in each until there are no more.
    """
    leaves = len(boxes) // 2
    distance, index = np.full(len(origins), np.inf), np.full(len(origins), -1)
    waiting = np.empty(DEPTH, dtype=np.int64)
    for k in range(len(origins)):
        o, d = origins[k], directions[k]
        waiting[0], count = 1, 1
        while count:
            count -= 1
            node = waiting[count]
            if not _may_meet(o, d, boxes[node], distance[k]):
                continue
            if node < leaves:
                waiting[count], waiting[count + 1] = 2 * node + 1, 2 * node
                count += 2
                continue
            first = LEAF * (node - leaves)
            for i in range(first, min(first + LEAF, len(corners))):
                if body[i] == own[k]:
                    t = _distance(o, d, corners[i])
                    if t < distance[k]:
                        distance[k], index[k] = t, i
    return distance, index
