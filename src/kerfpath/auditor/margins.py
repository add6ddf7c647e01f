"""The comfort margins at the nodes, computed only from the joint axes as lines.

The arm's lengths and model angles are not used. The elbow measure is the angle, seen along axis 2,
between points on axes 2 and 3 and the wrist; for a seven-axis arm it is the angle between axes 3
and 5. The shoulder measure is the distance of the wrist from a plane.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kerfpath.arrays import Array
from kerfpath.auditor.chain import JointChain
from kerfpath.auditor.rounding import Rounding
from kerfpath.auditor.table import Check, Unit, check_worst
from kerfpath.plans import Plan

ELBOW = 2
"""The elbow joint, from 0."""
MARGIN_SLACK = 1e-8
"""rad, m or m^3: rounding of two kinematics in double precision."""


def margins(plan: Plan, chain: JointChain, rounding: Rounding | None = None) -> list[Check]:
    """Return the check of every hard margin that the plan must keep at its nodes.

    For a plan that was read from a text, an angle may fall short by the rounding errors of the
    joints, since no joint changes the angle by more than it turns itself.
    """
    left = np.zeros(len(plan.q)) if rounding is None else rounding.q.sum(axis=1)
    comfort = plan.settings.comfort
    checks = []
    for name, band in ({} if comfort is None else comfort.bands).items():
        if not band.margin:
            continue
        words, unit, measured = _MEASURES[name]
        short = band.margin - measured(plan, chain)
        slack = MARGIN_SLACK + (left if unit == "rad" else np.zeros(len(left)))
        node = int(np.argmax(short - slack))
        checks.append(
            Check(
                code=f"{name}-margin",
                title=f"shortfall of the {words} margin at the nodes",
                value=float(short[node]),
                limit=float(slack[node]),
                unit=unit,
                node=node,
            )
        )
    return [*checks, *_above_floor(plan, chain)]


def _above_floor(plan: Plan, chain: JointChain) -> list[Check]:
    """Return the check of the floor that the plan must stay above, if there is one."""
    floor = plan.settings.floor
    if floor is None:
        return []
    links = chain.links(plan.q)
    heights = np.concatenate(
        [links[:, len(chain.externals) + 1 + ELBOW :], links[:, -1:] @ chain.tip], axis=1
    )[:, :, 2, 3]
    deep = floor - heights.min(axis=1)
    title = "depth of elbow, wrist or flange below the floor at the nodes"
    advice = "write floor_mm in [robot] where the floor is lower, or none"
    return [check_worst("floor", title, deep, MARGIN_SLACK, "m", advice=advice)]


def _lines(plan: Plan, chain: JointChain) -> tuple[list[Array], list[Array]]:
    """Return a point (K, 3) m on the axis of every joint, and its direction (K, 3)."""
    frames = chain.joints(plan.q)
    along = [T[:, :3, :3] @ axis for T, axis in zip(frames, chain.axes, strict=True)]
    return [T[:, :3, 3] for T in frames], along


def _meet(points: list[Array], along: list[Array], i: int, j: int) -> Array:
    """Return the points (K, 3) of axis i nearest to axis j."""
    normal = np.cross(along[j], np.cross(along[i], along[j]))
    share = _dot(points[j] - points[i], normal) / _dot(along[i], normal)
    return np.asarray(points[i] + along[i] * share[:, None])


def _wrist(plan: Plan, chain: JointChain) -> Array:
    _, along = _lines(plan, chain)
    return _off_line(along[-1], along[-3])


def _elbow(plan: Plan, chain: JointChain) -> Array:
    points, along = _lines(plan, chain)
    if len(along) > 6:
        return _off_line(along[2], along[4])
    outer = _meet(points, along, 4, 3)
    upper, fore = (_across(v, along[1]) for v in (points[2] - points[1], outer - points[2]))
    return _off_line(upper, fore)


def _shoulder(plan: Plan, chain: JointChain) -> Array:
    points, along = _lines(plan, chain)
    wrist = _meet(points, along, 4, 5 if len(along) > 5 else 3)
    return np.abs(_dot(wrist - points[0], np.cross(along[0], along[1])))


def _limits(plan: Plan, chain: JointChain) -> Array:
    robot, q = plan.robot, plan.q
    limits = robot.joint_limits()
    bound = ~robot.endless & (np.arange(robot.joints) < robot.family.joints)
    room = np.minimum(q - limits.lower, limits.upper - q)[:, bound]
    least = room.min(axis=1, initial=np.inf)
    for coupling in robot.couplings:
        value = q @ coupling.row
        least = np.minimum(least, np.minimum(value - coupling.lower, coupling.upper - value))
    return np.asarray(least)


def _manipulability(plan: Plan, chain: JointChain) -> Array:
    """Return the product of the singular values (K,) m^3."""
    flange, J = chain.jacobian(plan.q)
    if plan.robot.family.free_rotation:
        return np.asarray(np.linalg.svd(J, compute_uv=False).prod(axis=1))
    # Only tip and tool axis count: rotation about the axis does not.
    reach = flange[:, :3, :3] @ plan.T_flange_tip[:3, 3]
    linear = J[:, :3] + np.cross(J[:, 3:], reach[:, :, None], axis=1)
    turns = (flange @ plan.T_flange_tip)[:, :3, :2].transpose(0, 2, 1) @ J[:, 3:]
    both = np.concatenate([linear, turns], axis=1)
    return np.asarray(np.linalg.svd(both, compute_uv=False).prod(axis=1))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def _across(v: Array, axis: Array) -> Array:
    return np.asarray(v - axis * _dot(v, axis)[:, None])


def _off_line(a: Array, b: Array) -> Array:
    """Return the angles (K,) between the lines along a and b, from 0 to pi / 2."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.abs(_dot(a, b))))


_MEASURES: dict[str, tuple[str, Unit, Callable[[Plan, JointChain], Array]]] = {
    "wrist": ("wrist singularity", "rad", _wrist),
    "elbow": ("elbow singularity", "rad", _elbow),
    "shoulder": ("shoulder singularity", "m", _shoulder),
    "limits": ("joint limit", "rad", _limits),
    "manipulability": ("manipulability", "m^3", _manipulability),
}
