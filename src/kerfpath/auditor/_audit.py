"""The checks of a plan: tool against contour, joints against limits, at and between the nodes."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import Array, Ints, scalar
from kerfpath.auditor._between import BetweenNodes, bound_between_nodes
from kerfpath.auditor._certificate import bound_checks
from kerfpath.auditor._chain import chain_of
from kerfpath.auditor._collision import collisions
from kerfpath.auditor._margins import margins
from kerfpath.auditor._motion import Interpolation, Motion, joint_increments, motion_of
from kerfpath.auditor._nominal import axes_asked_for, tilt_turns
from kerfpath.auditor._rates import rate_checks
from kerfpath.auditor._room import retract_checks
from kerfpath.auditor._rounding import Rounding
from kerfpath.auditor._table import Check, Issue, Level, Unit
from kerfpath.auditor._windows import window_checks
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.robots import require_axes

__all__ = ["audit", "checks"]

TIP_AT_NODES = 1e-6
"""m: two kinematics in double precision agree far better; a wrong tool or frame is far worse."""
AXIS_AT_NODES = 1e-5
"""rad: as for the tip."""
LIMIT_SLACK = 1e-8
"""rad, or m on a rail: slack on joint positions, as for the tip."""
LENGTH_AGREES = 1e-6
"""Largest relative difference in length between a plan's contour and its reference."""

FINER = "sample the contour more finely"
"""Advice where the nodes are on the path and the motion between them is not."""
OFF_THE_PATH = "the target itself is off the path there: put it back, or plan the path meant"
"""Advice where a node was moved, for example by hand."""


def audit(
    plan: Plan,
    *,
    reference: Contour | None = None,
    interpolation: Interpolation = "linear",
    path_tolerance: float = 1e-4,
    axis_tolerance: float = np.pi / 180,
    parts: int = 8,
    cell: Cell | None = None,
) -> list[Issue]:
    """Return the issues of a plan; an empty list means that it passes.

    The arguments and exceptions are those of `checks`.
    """
    table = checks(
        plan,
        reference=reference,
        interpolation=interpolation,
        path_tolerance=path_tolerance,
        axis_tolerance=axis_tolerance,
        parts=parts,
        cell=cell,
    )
    return [check.issue() for check in table if not check.ok]


def checks(
    plan: Plan,
    *,
    reference: Contour | None = None,
    interpolation: Interpolation = "linear",
    path_tolerance: float = 1e-4,
    axis_tolerance: float = np.pi / 180,
    parts: int = 8,
    cell: Cell | None = None,
    rounding: Rounding | None = None,
) -> list[Check]:
    """Return the full table of checks.

    Parameters
    ----------
    plan : Plan
    reference : Contour, optional
        The path that the plan's contour was sampled from, in the part frame. With it, deviations
        between nodes are measured from the drawing instead of the polyline of the nodes.
    interpolation : {"linear", "joint"}
        How the controller moves between nodes.
    path_tolerance : float m
        Largest distance of the tool tip from the path between nodes.
    axis_tolerance : float rad
        Largest angle between the tool axis and that of the path between nodes.
    parts : int
        Number of parts into which the motion between two nodes is divided.
    cell : Cell, optional
        Cell whose near-miss distances the motion must keep.
    rounding : Rounding, optional
        For a plan that was read from a text: rounding errors of its joints and times. The limits
        at each node are wider by them, and the rows say by how much.

    Raises
    ------
    InputError
        The reference has another length, the interpolation is unknown, a tolerance or `parts` is
        not positive, limits are not known, or the cell has other external axes.
    """
    if interpolation not in ("linear", "joint"):
        raise InputError(f"interpolation: expected linear or joint, got {interpolation!r}")
    if not (isinstance(parts, int) and parts >= 1):
        raise InputError(f"parts: expected a whole number >= 1, got {parts!r}")
    path_tolerance = scalar(path_tolerance, "path_tolerance", unit="m", above=0.0)
    axis_tolerance = scalar(axis_tolerance, "axis_tolerance", unit="rad", above=0.0)
    if cell is not None:
        require_axes(cell.chain, plan.robot)
    chain = chain_of(plan.robot)
    motion = motion_of(plan, chain, interpolation, parts)
    path = plan.contour if reference is None else reference
    if abs(path.length - plan.contour.length) > LENGTH_AGREES * path.length:
        raise InputError(
            f"reference: expected a path of {plan.contour.length:.6f} m, as long as the plan's "
            f"contour, got one of {path.length:.6f} m"
        )
    reached = bound_between_nodes(plan, chain, motion, interpolation)
    tool = chain.forward(plan.q) @ plan.T_flange_tip
    return [
        *_at_nodes(plan, tool),
        *window_checks(plan, tool),
        *_between_nodes(plan, motion, reached, path, path_tolerance, axis_tolerance),
        *_positions(plan, motion, reached, rounding),
        *rate_checks(plan, reached, rounding),
        *margins(plan, chain, rounding),
        *retract_checks(plan, plan.settings.retract),
        *([] if cell is None else collisions(cell, motion, chain)),
        *bound_checks(plan),
    ]


def _at_nodes(plan: Plan, tool: Array) -> list[Check]:
    tip = np.linalg.norm(tool[:, :3, 3] - plan.points, axis=1)
    nominal, s = plan.contour.axes @ plan.T_base_part[:3, :3].T, plan.contour.s
    axis = _angle(tool[:, :3, 2], axes_asked_for(nominal, s, tilt_turns(plan), s))
    rows = [
        _worst("tip-at-nodes", "tool tip at the nodes", tip, TIP_AT_NODES, "m"),
        _worst("axis-at-nodes", "tool axis at the nodes", axis, AXIS_AT_NODES, "rad"),
    ]
    allowed = plan.settings.tilt
    if allowed is not None or plan.tilt.any():
        cone = (0.0 if allowed is None else allowed.cone) + AXIS_AT_NODES
        angle = _angle(tool[:, :3, 2], nominal)
        rows.append(_worst("tilt", "tilt of the tool axis at the nodes", angle, cone, "rad"))
    return rows


def _between_nodes(
    plan: Plan, motion: Motion, reached: BetweenNodes, path: Contour, path_tolerance: float,
    axis_tolerance: float,
) -> list[Check]:  # fmt: skip
    """Compare points of the path with the motion between the two nodes on either side."""
    s = plan.contour.s - plan.contour.s[0] + path.s[0]
    parts = motion.q.shape[1] - 1
    fine = np.interp(np.arange((len(s) - 1) * parts + 1) / parts, np.arange(len(s)), s)
    at = np.unique(np.concatenate([fine, path.s]))
    cell = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(s) - 2)
    points, axes = path.at(at)
    rotation, origin = plan.T_base_part[:3, :3], plan.T_base_part[:3, 3]
    points, axes = points @ rotation.T + origin, axes @ rotation.T
    axes = axes_asked_for(axes, s, tilt_turns(plan), at)
    tip, axis = motion.tip[cell], motion.axis[cell]
    chord = np.diff(tip, axis=1)
    along = ((points[:, None] - tip[:, :-1]) * chord).sum(-1) / np.maximum(
        (chord**2).sum(-1), 1e-24
    )
    along = np.clip(along, 0.0, 1.0)
    off = np.linalg.norm(tip[:, :-1] + along[..., None] * chord - points[:, None], axis=-1)
    near = np.argmin(off, axis=1)
    row = np.arange(len(at))
    part = along[row, near, None]
    there = (1 - part) * axis[row, near] + part * axis[row, near + 1]
    turned = _angle(there / np.linalg.norm(there, axis=1, keepdims=True), axes)
    worst = cell[int(np.argmax(off[row, near]))]
    ends, _ = path.at(s[worst : worst + 2])
    ends = np.linalg.norm(ends @ rotation.T + origin - motion.tip[worst, [0, -1]], axis=1)
    advice = FINER if ends.max() <= path_tolerance else OFF_THE_PATH
    return [
        _worst(
            "tip-between-nodes",
            "tool tip between the nodes",
            off[row, near],
            path_tolerance,
            "m",
            cell,
            advice=advice,
        ),
        _worst(
            "axis-between-nodes",
            "tool axis between the nodes",
            turned,
            axis_tolerance,
            "rad",
            cell,
            advice=FINER,
        ),
        _worst(
            "straight-move",
            "pose that the joints miss on a straight move",
            np.maximum(motion.residual.max(axis=1), reached.residual),
            1e-6,
            "m",
            advice="the robot cannot follow a straight move there: it passes a singularity or "
            "changes posture",
        ),
    ]


def _positions(
    plan: Plan, motion: Motion, reached: BetweenNodes, rounding: Rounding | None
) -> list[Check]:
    limits = plan.robot.joint_limits()
    left = np.zeros(plan.q.shape) if rounding is None else rounding.q
    left = np.maximum(left[:-1], left[1:])
    arm, bound = plan.robot.family.joints, ~plan.robot.endless
    rows, own = [], slice(arm)
    for i, axis in enumerate(plan.robot.externals, arm):
        if bound[i]:
            x = motion.q[..., i]
            over = np.maximum(limits.lower[i] - x, x - limits.upper[i]).max(axis=1)
            title = f"excess over the limits of {axis.name}"
            rows.append(_worst("external-limits", title, over, LIMIT_SLACK, axis.unit))
    bound[arm:] = False
    if bound.any():
        n = len(bound)
        beyond = np.maximum(limits.lower - reached.low[:, :n], reached.high[:, :n] - limits.upper)
        excess = (beyond - left)[:, bound]
        node, column = np.unravel_index(np.argmax(excess), excess.shape)
        joint = int(np.flatnonzero(bound)[column])
        rows.append(
            Check(
                code="joint-limits",
                title=f"excess over the joint limits (nearest: joint {joint + 1})",
                value=float(beyond[node, joint]),
                limit=LIMIT_SLACK + float(left[node, joint]),
                unit="rad",
                node=int(node),
            )
        )
    for c, coupling in enumerate(plan.robot.couplings, len(limits.lower)):
        over = np.maximum(coupling.lower - reached.low[:, c], reached.high[:, c] - coupling.upper)
        over = over - left @ np.abs(coupling.row)
        title = f"excess over the limits of {coupling.name}"
        rows.append(_worst("coupled-limits", title, over, LIMIT_SLACK, "rad"))
    if plan.settings.rotation is not None:
        turned = np.cumsum(joint_increments(plan), axis=0)
        over = (np.abs(turned) - plan.settings.rotation).max(axis=1)
        title = "excess over the limits of accumulated rotation"
        rows.append(_worst("rotation", title, over, LIMIT_SLACK, "rad"))
    hidden = reached.open.astype(float)
    rows.append(
        _worst(
            "unbounded",
            "intervals between nodes in which the joints may do more than their samples show",
            hidden * hidden.sum(),
            0.0,
            "count",
            level="warning",
            advice="the motion passes a singularity there, or near one: keep away with [comfort]",
        )
    )
    step = np.abs(joint_increments(plan)[:, own]).max(axis=1)
    rows.append(_worst("joint-step", "joint step between nodes", step, np.pi * (1 - 1e-9), "rad"))
    return rows


def _worst(
    code: str,
    title: str,
    values: Array,
    limit: float,
    unit: Unit,
    nodes: Ints | None = None,
    *,
    level: Level = "error",
    advice: str = "",
) -> Check:
    """Return the check of the largest of `values`; NaN counts as worst."""
    i = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
    return Check(
        code=code,
        title=title,
        value=float(values[i]),
        limit=limit,
        unit=unit,
        node=i if nodes is None else int(nodes[i]),
        level=level,
        advice=advice,
    )


def _angle(a: Array, b: Array) -> Array:
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(sine, (a * b).sum(-1)))
