"""One chain from the part to the tip, for planners that do not know external axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.public.check import Array, Instance, check, turned

__all__ = ["Joint", "followed", "joints", "least_bad", "put_right", "ranges", "starts", "urdf"]

ENDLESS = 3 * np.pi
"""rad: range of an endless joint either way, for planners that do not know endless joints."""
MOST_ERROR = 1e-12
"""m and rad: error below which Newton's method stops."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of the chain: its frame at zero in the one before, its axis, its column of q."""

    origin: Array
    axis: Array
    linear: bool
    column: int


@cache
def joints(task: Instance) -> list[Joint]:
    """Return the joints from the part to the tip; axes that carry the part are reversed."""
    arm, places = len(task.turns), list(enumerate(task.external))
    part = [(i, axis) for i, axis in places if axis["carries"] == "part"][::-1]
    chain, at = [], np.zeros(3)
    for i, axis in part + [(i, axis) for i, axis in places if axis["carries"] == "robot"]:
        origin, point = np.eye(4), np.array(axis["point"], dtype=float)
        origin[:3, 3], at = point - at, point
        along = np.array(axis["axis"], dtype=float)
        along = -along if axis["carries"] == "part" else along
        chain.append(Joint(origin, along, axis["kind"] == "linear", arm + i))
    for i, (origin, axis) in enumerate(zip(task.origins, task.turns, strict=True)):
        origin = origin.copy()
        if i == 0:
            origin[:3, 3] -= at
        chain.append(Joint(origin, axis, False, i))
    return chain


def urdf(task: Instance) -> str:
    """Return the chain as a URDF with links part, l0, l1, ... and tip, and joints j0, j1, ..."""
    lower, upper = ranges(task)
    rows, parent = ['<link name="part"/>'], "part"
    for i, joint in enumerate(joints(task)):
        c = joint.column
        kind = "prismatic" if joint.linear else "revolute"
        rows.append(
            f'<link name="l{i}"/><joint name="j{i}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="l{i}"/>{_placed(joint.origin)}<axis xyz="{_row(joint.axis)}"/>'
            f'<limit lower="{float(lower[c])!r}" upper="{float(upper[c])!r}" effort="0" '
            f'velocity="{float(task.velocity[c])!r}"/></joint>'
        )
        parent = f"l{i}"
    for name, T in (("flange", task.flange), ("tip", task.tool)):
        rows.append(
            f'<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="{parent}"/>'
            f'<child link="{name}"/>{_placed(T)}</joint>'
        )
        parent = name
    return f'<robot name="{task.name}">{"".join(rows)}</robot>'


def ranges(task: Instance) -> tuple[Array, Array]:
    """Return the ranges, (n,) each, those of endless joints by `ENDLESS`."""
    lower = np.where(task.endless, -ENDLESS, task.lower)
    return lower, np.where(task.endless, ENDLESS, task.upper)


def starts(task: Instance, count: int, rng: np.random.Generator) -> Array:
    """Return joints (count, n) at the first node, from random ones within half a turn of zero."""
    lower, upper = ranges(task)
    lower, upper = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    some = rng.uniform(lower, upper, (20 * count, len(lower)))
    found, there = _newton(task, some, task.points[:1], task.axes[:1])
    return found[there][:count]


def followed(task: Instance, q: Array) -> Array:
    """Return motions (B, K, n) from joints (B, n) at node 0, each step the shortest.

    Motions that Newton's method cannot follow to the end are left out.
    """
    rows, kept = [q], np.ones(len(q), np.bool_)
    for point, axis in zip(task.points[1:], task.axes[1:], strict=True):
        after, there = _newton(task, rows[-1], point[None], axis[None])
        rows.append(after)
        kept &= there
    return np.stack(rows, axis=1)[kept]


def put_right(task: Instance, q: Array) -> Array:
    """Return a motion (K, n) whose nodes are moved onto their points, if that converges."""
    moved, there = _newton(task, q, task.points, task.axes)
    return np.where(there[:, None], moved, q)


def least_bad(task: Instance, motions: Sequence[Array]) -> Array | None:
    """Return the cheapest valid motion; if none is valid, the one that breaks limits least."""

    def badness(q: Array) -> tuple[bool, float]:
        verdict = check(task, q)
        worst = max(verdict.velocity, verdict.acceleration) + 1e3 * (verdict.range + verdict.tip)
        return bool(verdict.faults), worst if verdict.faults else verdict.cost

    return min(motions, key=badness, default=None)


def _newton(
    task: Instance, q: Array, points: Array, axes: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return joints near q (B, n) with the tip at points and axes, (B, 3) or (1, 3).

    Also returns which of them converged within the ranges, (B,).
    """
    lower, upper = ranges(task)
    for _ in range(30):
        error, J, _beam = _error(task, q, points, axes)
        if np.abs(error).max() < MOST_ERROR:
            break
        step = -(np.linalg.pinv(J, rcond=1e-9) @ error[..., None])[..., 0]
        longest = np.abs(step).max(axis=1, keepdims=True)
        q = q + step * np.minimum(1.0, 0.5 / np.maximum(longest, 1e-9))
    error, _, beam = _error(task, q, points, axes)
    inside = ((q >= lower) & (q <= upper)).all(axis=1)
    there = (np.abs(error).max(axis=1) < 1e-9) & ((beam * axes).sum(axis=1) > 0)
    return q, inside & there


def _error(task: Instance, q: Array, points: Array, axes: Array) -> tuple[Array, Array, Array]:
    """Return the error of tip (3) and beam (3), (B, 6); its Jacobian; and the beam.

    The Jacobian (B, 6, n) is by the joints q (B, n).
    """
    R, p = np.tile(np.eye(3), (len(q), 1, 1)), np.zeros((len(q), 3))
    passed = []
    for joint in joints(task):
        p, R = p + R @ joint.origin[:3, 3], R @ joint.origin[:3, :3]
        along, x = R @ joint.axis, q[:, joint.column, None]
        passed.append((joint, along, p))
        if joint.linear:
            p = p + x * along
            continue
        R = R @ turned(joint.axis, x[:, 0])
    end = task.flange @ task.tool
    tip, z = p + R @ end[:3, 3], R @ end[:3, 2]
    J = np.zeros((len(q), 6, q.shape[1]))
    for joint, along, point in passed:
        if joint.linear:
            J[:, :3, joint.column] = along
            continue
        J[:, :3, joint.column] = np.cross(along, tip - point)
        J[:, 3:, joint.column] = np.cross(np.cross(along, z), axes)
    return np.concatenate([tip - points, np.cross(z, axes)], axis=1), J, z


def _placed(T: Array) -> str:
    angles = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", suppress_warnings=True)
    return f'<origin xyz="{_row(T[:3, 3])}" rpy="{_row(angles)}"/>'


def _row(values: Array) -> str:
    return " ".join(repr(float(v)) for v in values)
