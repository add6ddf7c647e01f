"""The checks of a plan: tool against contour, joints against limits, at and between the nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, require_instance, scalar
from kerfpath.auditor.acceleration import largest_accelerations
from kerfpath.auditor.between import BetweenNodes, bound_between_nodes
from kerfpath.auditor.certificate import bound_checks
from kerfpath.auditor.chain import chain_of
from kerfpath.auditor.collision import collisions
from kerfpath.auditor.dynamics import LagrangeArm
from kerfpath.auditor.margins import margins
from kerfpath.auditor.motion import Motion, joint_increments, motion_of
from kerfpath.auditor.rounding import MOST_ROUNDED, Rounding
from kerfpath.auditor.table import Check, Issues, check_worst
from kerfpath.auditor.transfer import approach_checks, retract_checks
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.options import Interpolation
from kerfpath.plans import Plan
from kerfpath.robots import require_axes

# -----------------------------------------------------------------------------
# The tool axes required by a plan, including its tilts, by the audit's own calculation.


def tilt_turns(plan: Plan) -> Array:
    """Return the rotations from the nominal axes to the tilted ones at the nodes, (K, 3) rad.

    They are rotation vectors in the robot base, from lead and lean as defined in `kerfpath.Tilt`;
    NaN where the path has no direction across the axis.
    """
    if not plan.tilt.any():
        return np.zeros((len(plan.q), 3))
    step = np.diff(plan.contour.points, axis=0)
    ahead = np.vstack([step, step[:1] if plan.contour.closed else step[-1:]])
    z = plan.contour.axes
    y = np.cross(z, ahead)
    with np.errstate(invalid="ignore"):
        y /= np.linalg.norm(y, axis=1, keepdims=True)
    turn = plan.tilt[:, :1] * y + plan.tilt[:, 1:] * np.cross(y, z)
    return np.asarray(turn @ plan.T_base_part[:3, :3].T)


def axes_asked_for(nominal: Array, s_nodes: Array, turn_nodes: Array, s: Array) -> Array:
    """Return the tilted axes (B, 3) at arc lengths s (B,) m, given the nominal axes (B, 3).

    Between the nodes, at s_nodes (K,) m, the rotations turn_nodes (K, 3) rad are interpolated
    linearly.
    """
    turn = np.stack([np.interp(s, s_nodes, part) for part in turn_nodes.T], axis=1)
    return np.asarray(Rotation.from_rotvec(turn).apply(nominal))


# -----------------------------------------------------------------------------
# The checks of joint velocities, accelerations, torques and jerks, node by node.

SHARE_SLACK = 1e-6
"""Relative slack on limits that the planner may use up to the last digit."""


def rate_checks(plan: Plan, reached: BetweenNodes, rounding: Rounding | None) -> list[Check]:
    """Return the checks of joint velocities, accelerations, torques and jerks."""
    velocity, _ = plan.robot.speed_limits()
    acceleration = largest_accelerations(plan.robot, plan.q[1:-1])
    eta_v, eta_a = plan.settings.eta_v, plan.settings.eta_a
    dt = np.diff(plan.time)
    dq = joint_increments(plan)
    speed = np.abs(dq / dt[:, None]) / velocity
    fine = reached.speed / dt[:, None] / velocity
    left = None if rounding is None else rounding.of_velocity(dq, dt) / velocity
    rows = [
        _per_joint(plan, "velocity", "joint velocity from node to node", speed, eta_v, left),
        _per_joint(plan, "velocity-between", "joint velocity between the nodes", fine, 1.0, left),
    ]
    if len(dq) > 1:
        change = np.diff(dq / dt[:, None], axis=0) / ((dt[1:] + dt[:-1]) / 2)[:, None]
        share = np.abs(change) / acceleration
        left = None if rounding is None else rounding.of_acceleration(dq, dt) / acceleration
        rows.append(
            _per_joint(plan, "acceleration", "joint acceleration at the nodes", share, eta_a, left)
        )
        rows += _torques(plan, dq, dt, change, rounding)
        rows += _jerks(plan, dq, dt, change, rounding)
    return rows


def _torques(
    plan: Plan, dq: Array, dt: Array, change: Array, rounding: Rounding | None
) -> Iterator[Check]:
    """Yield the check of the torques for accelerations `change` (K-2, n) rad/s^2."""
    arm = LagrangeArm.of(plan.robot)
    if arm is None:
        return
    velocity, q = dq / dt[:, None], plan.q[1:-1]
    share = (
        np.abs(arm.torque(q, (velocity[1:] + velocity[:-1]) / 2, change)) / plan.robot.limits.torque
    )
    left = None
    if rounding is not None:
        M, _ = arm.inertia(q)
        left = np.einsum("bij,bj->bi", np.abs(M), rounding.of_acceleration(dq, dt))
        left = left / plan.robot.limits.torque
    title = "joint torque at the nodes, without friction and rotors"
    yield _per_joint(plan, "torque", title, share, 1.0, left)


def _jerks(
    plan: Plan, dq: Array, dt: Array, change: Array, rounding: Rounding | None
) -> Iterator[Check]:
    """Yield the check of the jerks between accelerations `change` (K-2, n) rad/s^2.

    In a text with short intervals, rounding appears as jerk; where it explains much of the jerk,
    the check is only a warning.
    """
    limit = plan.robot.jerk_limit()
    if limit is None or len(change) < 2:
        return
    inside = dt[1:-1, None]
    share = np.abs(np.diff(change, axis=0) / inside) / limit.bound
    left = None
    if rounding is not None:
        off = rounding.of_acceleration(dq, dt)
        left = (off[1:] + off[:-1]) / inside / limit.bound
    row = _per_joint(plan, "jerk", "joint jerk between the nodes", share, 1.0, left, 1)
    coarse = left is not None and bool((left > MOST_ROUNDED).any())
    yield replace(row, level="warning") if coarse else row


def _per_joint(
    plan: Plan,
    code: str,
    title: str,
    share: Array,
    limit: float,
    left: Array | None,
    first: int | None = None,
) -> Check:
    """Check shares (rows, joints) of a limit, which is widened by rounding errors `left` at each.

    Row 0 belongs to node `first`; default: 0 for K - 1 rows, 1 for the accelerations.
    """
    first = len(plan.q) - 1 - len(share) if first is None else first
    wider = np.zeros(share.shape) if left is None else np.minimum(left, MOST_ROUNDED)
    over = np.where(np.isnan(share), np.inf, share - wider)
    row, joint = (int(i) for i in np.unravel_index(np.argmax(over), over.shape))
    digits = f"; {wider[row, joint] * 100:.2g} % of it for digits" if left is not None else ""
    return Check(
        code=code,
        title=f"{title} (highest: {plan.robot.joint_names[joint]}{digits})",
        value=float(share[row, joint]),
        limit=limit * (1 + SHARE_SLACK) + float(wider[row, joint]),
        unit="share",
        node=first + row,
        advice="lower the speed or eta, or move the part",
    )


# -----------------------------------------------------------------------------
# Check that gamma keeps its windows, from the joints and the path alone.

WINDOW_SLACK = 1e-6
"""rad: allowance for two kinematics and for the digits of a window's ends, far below a degree."""
ON_IT = 1e-9
"""m: a node this close to the end of a stretch is on it."""


def window_checks(plan: Plan, tool: Array, *, slack: float = WINDOW_SLACK) -> list[Check]:
    """Return the check of the windows of gamma; no check if there are none.

    Parameters
    ----------
    plan : Plan
    tool : (K, 4, 4) m
        Poses of the tool in the robot base.
    slack : float rad
        By how much gamma may be outside, for rounding.
    """
    windows = plan.settings.gamma_windows
    if not windows:
        return []
    nominal = _reference(plan.contour, plan.settings.frames) @ plan.T_base_part[:3, :3].T
    x = Rotation.from_rotvec(tilt_turns(plan)).apply(nominal)
    y = np.cross(tool[:, :3, 2], x)
    gamma = np.arctan2((tool[:, :3, 0] * y).sum(axis=1), (tool[:, :3, 0] * x).sum(axis=1))
    out, s = np.zeros(len(gamma)), plan.contour.s
    for w in windows:
        half = np.mod(w.high - w.low, 2 * np.pi) / 2
        off = np.abs(np.angle(np.exp(1j * (gamma - w.low - half))))
        held = (s >= w.start - ON_IT) & (s <= w.end + ON_IT)
        out = np.where(held, np.maximum(out, off - half), out)
    title = "gamma outside its pinned windows at the nodes"
    return [check_worst("gamma-window", title, out, slack, "rad")]


def _reference(contour: Contour, kind: str) -> Array:
    """Return the directions (K, 3) of gamma = 0, in the part."""
    n, step = contour.axes, np.diff(contour.points, axis=0)
    if contour.x is not None:
        return _across(contour.x, n)
    ahead = np.vstack([step, step[:1] if contour.closed else step[-1:]])
    if kind == "tangent":
        return _across(ahead, n)
    x = np.empty_like(n)
    x[0] = _across(ahead[:1], n[:1])[0]
    for k in range(len(n) - 1):  # the least rotation that takes one axis to the next
        turn, cosine = np.cross(n[k], n[k + 1]), n[k] @ n[k + 1]
        once = np.cross(turn, x[k])
        x[k + 1] = _across((x[k] + once + np.cross(turn, once) / (1 + cosine))[None], n[k + 1])[0]
    if not contour.closed:
        return x
    missing = np.arctan2(n[-1] @ np.cross(x[-1], x[0]), x[-1] @ x[0])
    share = (contour.s - contour.s[0]) / (contour.s[-1] - contour.s[0])
    return np.asarray(Rotation.from_rotvec((missing * share)[:, None] * n).apply(x))


def _across(v: Array, n: Array) -> Array:
    """Return the components of v (K, 3) perpendicular to n, scaled to length one."""
    across = v - (v * n).sum(axis=-1, keepdims=True) * n
    return np.asarray(across / np.linalg.norm(across, axis=-1, keepdims=True))


# -----------------------------------------------------------------------------
# The checks of a plan: tool against contour, joints against limits, at and between the nodes.

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
) -> Issues:
    """Return the issues of a plan; an empty list means that it passes, and prints as passed.

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
    return Issues(check.issue() for check in table if not check.ok)


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
    require_instance(plan, Plan, "plan", "kerfpath.read_plan_file(path).plans has those of a file")
    if reference is not None:
        require_instance(reference, Contour, "reference", "give the path before it was resampled")
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
        *approach_checks(plan, cell),
        *([] if cell is None else collisions(cell, motion, chain)),
        *bound_checks(plan),
    ]


def _at_nodes(plan: Plan, tool: Array) -> list[Check]:
    tip = np.linalg.norm(tool[:, :3, 3] - plan.points, axis=1)
    nominal, s = plan.contour.axes @ plan.T_base_part[:3, :3].T, plan.contour.s
    axis = _angle(tool[:, :3, 2], axes_asked_for(nominal, s, tilt_turns(plan), s))
    rows = [
        check_worst("tip-at-nodes", "tool tip at the nodes", tip, TIP_AT_NODES, "m"),
        check_worst("axis-at-nodes", "tool axis at the nodes", axis, AXIS_AT_NODES, "rad"),
    ]
    allowed = plan.settings.tilt
    if allowed is not None or plan.tilt.any():
        cone = (0.0 if allowed is None else allowed.cone) + AXIS_AT_NODES
        angle = _angle(tool[:, :3, 2], nominal)
        rows.append(check_worst("tilt", "tilt of the tool axis at the nodes", angle, cone, "rad"))
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
        check_worst(
            "tip-between-nodes",
            "tool tip between the nodes",
            off[row, near],
            path_tolerance,
            "m",
            cell,
            advice=advice,
        ),
        check_worst(
            "axis-between-nodes",
            "tool axis between the nodes",
            turned,
            axis_tolerance,
            "rad",
            cell,
            advice=FINER,
        ),
        check_worst(
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
    first, bound = plan.robot.arm.joints, ~plan.robot.endless  # the first external axis
    rows, own = [], slice(first)
    for i, axis in enumerate(plan.robot.externals, first):
        if bound[i]:
            x = motion.q[..., i]
            over = np.maximum(limits.lower[i] - x, x - limits.upper[i]).max(axis=1)
            title = f"excess over the limits of {axis.name}"
            rows.append(check_worst("external-limits", title, over, LIMIT_SLACK, axis.unit))
    bound[first:] = False
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
        rows.append(check_worst("coupled-limits", title, over, LIMIT_SLACK, "rad"))
    if plan.settings.rotation is not None:
        turned = np.cumsum(joint_increments(plan), axis=0)
        over = (np.abs(turned) - plan.settings.rotation).max(axis=1)
        title = "excess over the limits of accumulated rotation"
        rows.append(check_worst("rotation", title, over, LIMIT_SLACK, "rad"))
    hidden = reached.open.astype(float)
    rows.append(
        check_worst(
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
    rows.append(
        check_worst("joint-step", "joint step between nodes", step, np.pi * (1 - 1e-9), "rad")
    )
    return rows


def _angle(a: Array, b: Array) -> Array:
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.asarray(np.arctan2(sine, (a * b).sum(-1)))
