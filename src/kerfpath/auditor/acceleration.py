"""The largest accelerations of the joints where they depend on joints 2 and 3.

The audit interpolates tables of accelerations by itself: it shares no code with what it judges.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.arrays import Array
from kerfpath.robots import Robot

ROUNDED = 1e-12
"""Allowance for rounding, as a share."""


def largest_accelerations(robot: Robot, q: Array) -> Array:
    """Return the largest accelerations (B, n) rad/s^2 at joints q (B, n) rad.

    The limit of a joint in a table is the sum of its values at all nodes, each weighted by a hat
    over joint 2 and one over joint 3. Outside the table it is the least of them.
    """
    _, constant = robot.speed_limits()
    found, table = np.tile(constant, (len(q), 1)), robot.limits.acceleration_table
    if table is None:
        return found
    two, three = _hats(q[:, 1], table.joint_2), _hats(q[:, 2], table.joint_3)
    inside = two.any(axis=1) & three.any(axis=1)
    for joint, nodes in table.limits.items():
        value = np.einsum("ba,ac,bc->b", two, nodes, three)
        found[:, joint - 1] = np.where(inside, value, nodes.min())
    return found


def _hats(x: Array, nodes: Array) -> Array:
    """Return the hat of each node (A,) at x (B,): 1 there, 0 at its neighbours and outside."""
    hats = np.stack([np.interp(x, nodes, row) for row in np.eye(len(nodes))], axis=1)
    return np.asarray(hats * ((x >= nodes[0]) & (x <= nodes[-1]))[:, None])


def scarcity(robot: Robot, low: Array, high: Array) -> Array:
    """Return by how much limits are above those that hold everywhere, at least, over boxes (B, n).

    Parameters
    ----------
    robot : Robot
    low, high : (B, 2) rad
        Ends of joints 2 and 3. NaN: nothing is known of them.

    Returns
    -------
    share : (B, n)
        The limit that holds everywhere, divided by the least limit in the box; 1 at most.
    """
    found, table = np.ones((len(low), robot.joints)), robot.limits.acceleration_table
    if table is None:
        return found
    nodes = table.joint_2, table.joint_3
    inside, whole, near = np.ones(len(low), bool), np.ones(len(low), bool), []
    for i, axis in enumerate(nodes):
        inside &= (low[:, i] >= axis[0]) & (high[:, i] <= axis[-1])  # false for NaN
        # A box within one cell has its least value at a corner; else take the nodes around it.
        between = (axis > low[:, i, None]) & (axis < high[:, i, None])
        whole &= ~between.any(axis=1)
        before = np.append(-np.inf, axis[:-1]) <= high[:, i, None]
        near.append(before & (np.append(axis[1:], np.inf) >= low[:, i, None]))
    corners = np.stack([largest_accelerations(robot, q) for q in _corners(robot, low, high)])
    around = near[0][:, :, None] & near[1][:, None, :]
    for joint, values in table.limits.items():
        cells = np.where(around, values, np.inf).min(axis=(1, 2))
        least = np.where(whole, corners[:, :, joint - 1].min(axis=0), cells)
        found[:, joint - 1] = np.where(inside, values.min() / least * (1 + ROUNDED), 1.0)
    return np.minimum(found, 1.0)


def _corners(robot: Robot, low: Array, high: Array) -> Iterator[Array]:
    """Yield joints (B, n) at the four corners of boxes of joints 2 and 3."""
    for x in (low[:, 0], high[:, 0]):
        for y in (low[:, 1], high[:, 1]):
            q = np.zeros((len(low), robot.joints))
            q[:, 1], q[:, 2] = x, y
            yield q


def most_accelerations(robot: Robot, low: Array, high: Array) -> Array:
    """Return the largest accelerations (B, n) rad/s^2 over boxes, or slightly more.

    A limit in a table is largest at a corner: of the box, or where lines of the table cross it.

    Parameters
    ----------
    robot : Robot
    low, high : (B, 2) rad
        Ends of joints 2 and 3; they may be infinite.
    """
    table = robot.limits.acceleration_table
    found = np.tile(least_accelerations(robot), (len(low), 1))
    if table is None:
        return found
    nodes = table.joint_2, table.joint_3
    at = [np.clip(axis[:, None], low[:, i], high[:, i]) for i, axis in enumerate(nodes)]
    new = [np.diff(x, axis=0, prepend=-np.inf) > 0 for x in at]
    inside = np.ones(len(low), bool)
    for i, axis in enumerate(nodes):
        inside &= (low[:, i] <= axis[-1]) & (high[:, i] >= axis[0])
    for x, other_x in zip(at[0], new[0], strict=True):
        for y, other_y in zip(at[1], new[1], strict=True):
            here = np.flatnonzero(inside & other_x & other_y)
            q = np.zeros((len(here), robot.joints))
            q[:, 1], q[:, 2] = x[here], y[here]
            found[here] = np.maximum(found[here], largest_accelerations(robot, q))
    return found * (1 + ROUNDED)


def least_accelerations(robot: Robot) -> Array:
    """Return the accelerations (n,) rad/s^2 that hold at every configuration."""
    _, constant = robot.speed_limits()
    found, table = constant.copy(), robot.limits.acceleration_table
    for joint, nodes in {} if table is None else table.limits.items():
        found[joint - 1] = nodes.min()
    return found
