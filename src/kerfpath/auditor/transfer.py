"""The checks of transfer moves, and of the retracts at both ends of a cut, by the joint chain."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Ints, floats
from kerfpath.auditor.acceleration import least_accelerations
from kerfpath.auditor.chain import JointChain, chain_of
from kerfpath.auditor.collision import collision_along
from kerfpath.auditor.motion import follow
from kerfpath.auditor.table import Check, check_worst
from kerfpath.cell import Cell
from kerfpath.plans import Plan, TransferMove
from kerfpath.robots import Robot, require_axes

# -----------------------------------------------------------------------------
# Check that the tool can back off at both ends of a plan, with the joint chain alone.

ROOM_SLACK = 1e-8
"""rad: as for the joints at the nodes."""
MISSED = 1e-6
"""m and rad: largest error of a pose that counts as reached; Newton's method ends far below."""
OUT_OF_REACH = 2 * np.pi
"""rad: excess that means that there is no way, or only one through a singularity."""
PARTS = 10
"""Number of parts in which the retract is followed."""


def retract_checks(plan: Plan, retract: float | None) -> list[Check]:
    """Return the check that a retract (m) is possible at both ends of a plan; None: no check."""
    if retract is None:
        return []
    chain = chain_of(plan.robot)
    ends = np.array([0, len(plan.q) - 1])
    q, over = plan.q[ends], np.full(2, -OUT_OF_REACH)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    start, side = chain.forward(q), _side(chain, q)
    limits, bound = plan.robot.joint_limits(), ~plan.robot.endless
    for part in np.arange(1, PARTS + 1) / PARTS:
        T = start.copy()
        T[:, :3, 3] -= part * retract * T[:, :3, 2]
        q, missed = follow(chain, T, q)
        beyond = np.maximum(limits.lower - q, q - limits.upper)[:, bound].max(
            axis=1, initial=-OUT_OF_REACH
        )
        for coupling in plan.robot.couplings:
            value = q @ coupling.row
            beyond = np.maximum(beyond, np.maximum(coupling.lower - value, value - coupling.upper))
        kept = (missed <= MISSED) & (_side(chain, q) == side)
        over = np.maximum(over, np.where(kept, beyond, OUT_OF_REACH))
        if (over >= OUT_OF_REACH).any():
            break
    worst = int(np.argmax(over))
    out = " (no way there in the posture)" if over[worst] >= OUT_OF_REACH else ""
    return [
        Check(
            code="retract",
            title=f"excess over the joint limits where the tool backs off by {retract * 1e3:g} mm"
            f"{out}",
            value=float(over[worst]),
            limit=ROOM_SLACK,
            unit="rad",
            node=int(ends[worst]),
            advice="lower retract_mm in [program] or gamma_step_deg in [plan], or move the part",
        )
    ]


def _side(chain: JointChain, q: Array) -> Array:
    """Return on which side (B,) of its singularities a six-axis arm is; 0 for other arms."""
    _, J = chain.jacobian(q)
    return np.sign(np.linalg.det(J)) if J.shape[1] == J.shape[2] else np.zeros(len(q))


# -----------------------------------------------------------------------------
# The checks of a transfer move: joint limits, duration and collisions.

STEP = np.radians(0.5)
"""rad, or m: largest joint step between two samples of a move."""
TRANSFER_SLACK = 1e-6
"""Slack for rounding: relative on the time, and rad or m on joint limits."""


def transfer_checks(
    robot: Robot,
    q: ArrayLike,
    time: ArrayLike,
    *,
    cell: Cell | None = None,
    eta_v: float = 1.0,
    eta_a: float = 1.0,
) -> list[Check]:
    """Return the checks of straight joint motions from corner to corner, with a stop at each.

    Parameters
    ----------
    robot : Robot
    q : (m, n) rad
        Corners; endless joints turn exactly from one value to the next.
    time : (m,) s
        Time at which each corner is reached.
    cell : Cell, optional
        Without a cell, collisions are not checked.
    eta_v, eta_a : float
        Shares of the limits that may be used.

    Returns
    -------
    list of Check
        The node of a check is the corner from which a motion starts.

    Raises
    ------
    InputError
        A shape is wrong, limits are not known, or the cell has other external axes.
    """
    if cell is not None:
        require_axes(cell.chain, robot)
    corners = floats(q, "q", (None, robot.joints))
    duration = np.diff(floats(time, "time", (len(corners),)))
    needed = _least_times(robot, np.abs(np.diff(corners, axis=0)), eta_v, eta_a)
    late = np.where(duration > 0, needed / np.where(duration > 0, duration, 1.0), np.inf)
    limits = robot.joint_limits()
    beyond = np.maximum(limits.lower - corners, corners - limits.upper)
    beyond[:, robot.endless] = -np.inf
    n = robot.arm.joints
    rows = [
        check_worst(
            "air-time", "time that a transfer move needs", late, 1 + TRANSFER_SLACK, "share"
        ),
        check_worst(
            "air-limits",
            "excess over the joint limits",
            beyond[:, :n].max(axis=1),
            TRANSFER_SLACK,
            "rad",
        ),
    ]
    for i, axis in enumerate(robot.externals, n):
        if not robot.endless[i]:
            title = f"excess over the limits of {axis.name}"
            rows.append(
                check_worst("air-external-limits", title, beyond[:, i], TRANSFER_SLACK, axis.unit)
            )
    if cell is not None and len(cell.pairs):
        samples, leg = _sample_motions(corners)
        steps = np.flatnonzero(leg[1:] == leg[:-1])
        rows += collision_along(
            cell, samples[steps], samples[steps + 1], leg[steps], chain_of(robot)
        )
    return rows


def _least_times(robot: Robot, step: Array, eta_v: float, eta_a: float) -> Array:
    """Return the least times (m-1,) s of straight motions by |dq| (m-1, n) rad, stop to stop."""
    velocity, acceleration = robot.speed_limits()[0], least_accelerations(robot)
    still = 1e-300
    v = (eta_v * velocity / np.maximum(step, still)).min(axis=1)
    a = (eta_a * acceleration / np.maximum(step, still)).min(axis=1)
    # Peak speed, as share of the way per second: v, or the speed at half way if v is not reached.
    peak = np.minimum(v, np.sqrt(a))
    return np.asarray(1 / peak + peak / a)


def _sample_motions(corners: Array) -> tuple[Array, Ints]:
    """Return joint vectors (S, n) along the motions, at most `STEP` apart, and their motions."""
    samples, legs = [], []
    for k, (one, two) in enumerate(pairwise(corners)):
        count = int(np.ceil(np.abs(two - one).max() / STEP)) + 1
        samples.append(one + np.linspace(0, 1, count + 1)[:, None] * (two - one))
        legs.append(np.full(count + 1, k))
    return np.vstack(samples), np.concatenate(legs)


# -----------------------------------------------------------------------------
# The checks of a plan's own moves: from where the robot stands, and to where it goes.

SAME_PLACE = 1e-6
"""rad, or m: rounding by which the end of a move may differ from the end of the cut."""


def approach_checks(plan: Plan, cell: Cell | None = None) -> list[Check]:
    """Return the checks of the approach and the retreat of a plan, none where it has neither.

    They are those of `transfer_checks`, and that each meets the cut, or where the tool has backed
    off from it by `settings.retract`; the way there, too, is clear. The node of a check is a
    corner.
    """
    rows: list[Check] = []
    for name, move, node in (("approach", plan.approach, 0), ("retreat", plan.retreat, -1)):
        if move is not None:
            own = _own_checks(plan, move, node, cell)
            rows += [
                replace(
                    row,
                    code=f"{name}-{row.code.removeprefix('air-')}",
                    title=f"{name}: {row.title}",
                )
                for row in own
            ]
    return rows


def _own_checks(plan: Plan, move: TransferMove, node: int, cell: Cell | None) -> list[Check]:
    s, robot = plan.settings, plan.robot
    chain = chain_of(robot)
    way, missed = _backed_off(plan, chain, node)
    meeting = 0 if node else -1
    off = np.abs(move.q[meeting] - way[-1])
    whole = 2 * np.pi * np.round(off / (2 * np.pi))
    off = np.where(robot.endless, np.abs(off - whole), off)
    at = meeting % len(move.q)
    rows = [
        *transfer_checks(robot, move.q, move.time, cell=cell, eta_v=s.eta_v, eta_a=s.eta_a),
        Check(
            code="air-ends", title="distance of the move from the cut", node=at, unit="rad",
            value=float(off.max()) if missed <= MISSED else OUT_OF_REACH, limit=SAME_PLACE,
        ),
        Check(
            code="air-begins", title="time at the start of the move", node=0, unit="s",
            value=abs(float(move.time[0])), limit=1e-9,
        ),
    ]  # fmt: skip
    if cell is not None and len(way) > 1 and len(cell.pairs):
        steps = np.full(len(way) - 1, at)
        found = collision_along(cell, way[:-1], way[1:], steps, chain)
        rows += [replace(row, code=f"straight-{row.code}") for row in found]
    return rows


def _backed_off(plan: Plan, chain: JointChain, node: int) -> tuple[Array, float]:
    """Return joints (m, n) from a node to where the tool has backed off, and the largest miss."""
    q = plan.q[node][None]
    way, worst = [q], 0.0
    if plan.settings.retract:
        chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
        start = chain.forward(q)
        for part in np.arange(1, PARTS + 1) / PARTS:
            T = start.copy()
            T[:, :3, 3] -= part * plan.settings.retract * T[:, :3, 2]
            q, missed = follow(chain, T, q)
            worst = max(worst, float(missed[0]))
            way.append(q)
    return np.vstack(way), worst
