"""Torque limits as a test of a pair of edges, in addition to (6).

At the node between two edges the joints are q, and the increments before and after it give the
velocity, (dq + dq') / (2 dt), and the acceleration, (dq' - dq) / dt^2: central differences. The
torques of the arm in that state must be within their bounds. Without friction they are the same
with time reversed, so that a path keeps its limits if its reverse does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints, freeze
from kerfpath.kernels.dynamics import ArmBodies, Posed, fill_torque, pose_arm, room_for
from kerfpath.kernels.jit import jit, jit_inline, jit_part

__all__ = [
    "NO_TORQUE",
    "TorqueRoom",
    "TorqueTest",
    "exceeds_torque",
    "torque_excess",
    "torque_room",
]

TORQUE_TOLERANCE = 1e-9
"""Slack on torque limits, as a share of them: far above rounding, far below what is measurable."""


class TorqueTest(NamedTuple):
    """The bounds on torques, and the arm that they apply to."""

    arm: ArmBodies
    bound: Array
    """(n,) N m; (0,) if torques are not limited."""
    dt: float
    """s: time from node to node."""


def _nothing() -> TorqueTest:
    matrices, vectors = freeze(np.empty((0, 3, 3))), freeze(np.empty((0, 3)))
    numbers, gravity = freeze(np.empty(0)), freeze(np.zeros(3))
    arm = ArmBodies(matrices, vectors, vectors, numbers, vectors, matrices, gravity)
    return TorqueTest(arm, numbers, 1.0)


NO_TORQUE = _nothing()
"""A test without limits on torques."""


class TorqueRoom(NamedTuple):
    """Scratch arrays, with the vertex at which the arm was posed last."""

    at: Posed
    vertex: Ints
    """(1,): index of that vertex, -1 before the first."""
    q: Array
    """(n,): joints."""
    v: Array
    """(n,): velocities."""
    a: Array
    """(n,): accelerations."""
    tau: Array
    """(n,): torques."""


@jit_part
def torque_room(n: int) -> TorqueRoom:
    """Return scratch arrays for an arm of n joints."""
    vertex = np.full(1, -1)
    return TorqueRoom(room_for(n), vertex, np.empty(n), np.empty(n), np.empty(n), np.empty(n))


@jit_inline
def torque_excess(
    test: TorqueTest, given: Array, p: int, dq_before: Array, dq: Array, room: TorqueRoom
) -> int:
    """First joint whose torque at vertex p, q = given[:, p], exceeds its bound, or -1.

    dq_before, dq (n,) are the increments to and from p, rad.
    """
    n = len(test.bound)
    if n == 0:
        return -1
    if room.vertex[0] != p:
        for i in range(n):
            room.q[i] = given[i, p]
        pose_arm(test.arm, room.q, room.at)
        room.vertex[0] = p
    for i in range(n):
        room.v[i] = (dq_before[i] + dq[i]) / (2 * test.dt)
        room.a[i] = (dq[i] - dq_before[i]) / test.dt**2
    fill_torque(test.arm, room.at, room.v, room.a, room.tau)
    for i in range(n):
        if abs(room.tau[i]) > test.bound[i] * (1 + TORQUE_TOLERANCE):
            return i
    return -1


@jit
def exceeds_torque(test: TorqueTest, given: Array, p: int, dq_before: Array, dq: Array) -> bool:
    """Whether any torque at a vertex exceeds its bound; arguments as for `torque_excess`."""
    room = torque_room(len(test.bound))
    return torque_excess(test, given, p, dq_before, dq, room) >= 0
