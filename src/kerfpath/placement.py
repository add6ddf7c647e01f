"""Placement of the real part: its frame from measured points, and plans moved to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, as_pose, floats, freeze, scalar, short_repr
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.kernels.metric import turns_of
from kerfpath.planner import plan as plan_contour
from kerfpath.plans import Plan, Proof, TransferMove, path_cost
from kerfpath.refiner import refine
from kerfpath.robots import base_in_part, posture_name
from kerfpath.transfer import back_off, transfer_move

__all__ = [
    "MeasuredFrame",
    "place_moves",
    "placed",
    "placement_from_points",
    "planned_again",
    "xyz_rpy",
]

ON_A_LINE = 0.05
"""Points define no frame if their spread across the best line is a smaller share of its length."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredFrame:
    """A placement of the part, fitted to measured points.

    Parameters
    ----------
    T_base_part : (4, 4) m
    residuals : (K,) m
        Distance of each measured point from its nominal point at this placement.
    """

    T_base_part: Array
    residuals: Array

    __repr__ = short_repr

    @property
    def xyz_mm(self) -> list[float]:
        """Position of the part as in a job file, mm, rounded to 0.1 um."""
        return xyz_rpy(self.T_base_part)[0]

    @property
    def rpy_deg(self) -> list[float]:
        """Roll, pitch and yaw of the part as in a job file, deg, rounded to 1e-6 deg."""
        return xyz_rpy(self.T_base_part)[1]

    def moved_from(self, T_base_part: ArrayLike) -> tuple[float, float]:
        """Return distance (m) and rotation (rad) of the part from another placement (4, 4)."""
        other = as_pose(T_base_part, "T_base_part")
        turned = Rotation.from_matrix(other[:3, :3].T @ self.T_base_part[:3, :3]).magnitude()
        return float(np.linalg.norm(self.T_base_part[:3, 3] - other[:3, 3])), float(turned)


def xyz_rpy(T: Array) -> tuple[list[float], list[float]]:
    """Return position (mm, to 0.1 um) and roll, pitch, yaw (deg, to 1e-6) of a pose (4, 4) m."""
    angles = Rotation.from_matrix(T[:3, :3]).as_euler("xyz", degrees=True, suppress_warnings=True)
    xyz = [round(float(v), 4) + 0.0 for v in T[:3, 3] * 1e3]
    return xyz, [round(float(v), 6) + 0.0 for v in angles]


def placement_from_points(
    nominal: ArrayLike, measured: ArrayLike, *, most_residual: float = 5e-4
) -> MeasuredFrame:
    """Return the rigid placement that fits points of the part to their measured positions best.

    Least squares by singular value decomposition (Kabsch, Acta Cryst. A32, 1976).

    Parameters
    ----------
    nominal : (K, 3) m
        Points in the part frame, at least three and not on a line.
    measured : (K, 3) m
        The same points in the robot base.
    most_residual : float m
        Largest residual allowed at a point.

    Raises
    ------
    InputError
        Fewer points, points on a line, or a larger residual.
    """
    nominal = floats(nominal, "nominal", (None, 3))
    measured = floats(measured, "measured", (len(nominal), 3))
    most_residual = scalar(most_residual, "most_residual", unit="m", above=0.0)
    if len(nominal) < 3:
        raise InputError(f"measured frame: expected at least 3 points, got {len(nominal)}")
    centre, middle = nominal.mean(axis=0), measured.mean(axis=0)
    for spread in (
        np.linalg.svd(p, compute_uv=False) for p in (nominal - centre, measured - middle)
    ):
        if spread[1] <= ON_A_LINE * spread[0]:
            raise InputError(
                "measured frame: the points lie on one line, or nearly, so the part's rotation "
                "about it is unknown; measure a point away from the line"
            )
    turned, _ = Rotation.align_vectors(measured - middle, nominal - centre)
    T = np.eye(4)
    T[:3, :3] = turned.as_matrix()
    T[:3, 3] = middle - T[:3, :3] @ centre
    residuals = np.linalg.norm(nominal @ T[:3, :3].T + T[:3, 3] - measured, axis=1)
    fitted = MeasuredFrame(T_base_part=freeze(T), residuals=freeze(residuals))
    worst = int(residuals.argmax())
    if residuals[worst] > most_residual:
        raise InputError(
            f"measured frame: point {worst + 1} of {len(nominal)} is off by "
            f"{residuals[worst] * 1e3:.3f} mm, allowed are {most_residual * 1e3:g} mm; check "
            "its coordinates and the order of the points, or measure it again (fitted: xyz_mm = "
            f"{fitted.xyz_mm}, rpy_deg = {fitted.rpy_deg})"
        )
    return fitted


def placed(plan: Plan, T_base_part: ArrayLike) -> Plan:
    """Return the plan with the part at another placement: same tool path on it, other joints.

    At every node the tool keeps its pose in the part and thus gamma, the joints keep their posture,
    and external axes their values. Times stay. Audit the result: the limits may not be kept there.

    Parameters
    ----------
    plan : Plan
    T_base_part : (4, 4) m
        Placement with external axes at zero.

    Raises
    ------
    NoFeasiblePath
        A node out of reach in its posture.
    InputError
        `T_base_part` is no pose.
    """
    T_base_part = as_pose(T_base_part, "T_base_part")
    T_base_flange = T_base_part @ plan.T_part_tip @ np.linalg.inv(plan.T_flange_tip)
    n, axes = plan.robot.arm.joints, plan.robot.externals
    x = plan.q[:, n:]
    T_arm_flange = np.asarray(np.linalg.inv(base_in_part(axes, x)) @ T_base_flange, np.float64)
    q = plan.robot.arm.follow(T_arm_flange, plan.q[:, :n], plan.posture)
    q = np.column_stack([q, x])
    lost = np.flatnonzero(np.isnan(q).any(axis=1))
    if lost.size:
        k = int(lost[0])
        raise NoFeasiblePath(
            f"contour {plan.name!r}, node {k}: out of the robot's reach at this placement in "
            f"posture {posture_name(int(plan.posture[k]))}; plan the job again with this placement",
            proved=False,
            node=k,
        )
    # At the first node the turn nearest to the old joints; after it no jump by whole turns.
    q = plan.q + np.unwrap(q - plan.q, axis=0)
    turn = turns_of(q).astype(np.int64)
    turn[:, n:] = 0
    before = plan.proof.without_bound().statement
    there = replace(
        plan,
        T_base_part=T_base_part,
        q=q,
        turn=turn,
        proof=Proof(optimal=False, statement=f"{before}; moved to another placement"),
    )
    s = plan.settings
    cost = path_cost(there.increments, s.weights, s.metric, s.objective, there.node_cost)
    return replace(there, cost=cost)


def planned_again(plan: Plan, T_base_part: ArrayLike) -> Plan:
    """Return a plan at another placement if the plan that `placed` returns breaks limits there.

    Gamma is moved so that the limits are kept there. If that fails, the contour is planned again
    with the settings of the plan and in its postures, and refined; costs of clearance are left out,
    as the cell is not known there.

    Parameters
    ----------
    plan : Plan
        At the old placement.
    T_base_part : (4, 4) m

    Raises
    ------
    NoFeasiblePath
        The limits cannot be kept there in the postures of the plan.
    InputError
        As `placed`.
    """
    try:
        found = refine(placed(plan, T_base_part))
    except NoFeasiblePath:  # out of reach with the old gamma, perhaps not with another
        found = None
    if found is not None and found.done:
        return found.plan
    slowest, comfort = plan.feed, plan.settings.comfort
    dt = plan.dt  # from node to node at the speed asked for
    if slowest is not None and slowest.node >= 0:
        dt = float(np.diff(plan.time)[slowest.node]) * slowest.slowest
    if comfort is not None:
        comfort = replace(comfort, clearance=None)
    made = plan_contour(
        replace(plan.contour, time=dt * np.arange(len(plan.time), dtype=np.float64)),
        plan.robot,
        tool=plan.T_flange_tip,
        placement=T_base_part,
        options=replace(
            plan.settings,
            postures=tuple(sorted(set(plan.posture.tolist()))),
            feed="constant" if plan.feed is None else "dip",
            refine=plan.settings.refine or plan.proof.grid_cost is not None,
            comfort=comfort,
            between_nodes="reported",
        ),
    )
    kept = replace(made.settings, between_nodes=plan.settings.between_nodes)
    return replace(made, contour=plan.contour, settings=kept)


def place_moves(
    moves: Sequence[TransferMove], plans: Sequence[Plan], retract: float
) -> tuple[TransferMove, ...]:
    """Return the straight moves between plans that were moved to another placement, not `clear`.

    A move that begins or ends at a home position still does.

    Parameters
    ----------
    moves : sequence of TransferMove
        Those of the old placement.
    plans : sequence of Plan
        At the new one, in the order of cutting.
    retract : float m
        How far the tool backs off before and after each contour.

    Raises
    ------
    InputError
        A move that goes around obstacles, or a move whose end is beyond the limits.
    """
    first = 0 if len(moves) < len(plans) else -1
    moved = []
    for before, move in enumerate(moves, first):
        if len(move.q) > 2:
            raise InputError(
                f"move {before - first + 1} of {len(moves)} between contours goes around obstacles,"
                " and its way at another placement is unknown; plan the job again with that "
                "placement"
            )
        after = before + 1
        q0 = move.q[0] if before < 0 else back_off(plans[before], "end", retract)
        if after < len(plans):
            q1 = back_off(plans[after], "start", retract)
        else:  # home, the short way for endless joints
            turns = np.round((q0 - move.q[-1]) / (2 * np.pi)) * plans[0].robot.endless
            q1 = move.q[-1] + 2 * np.pi * turns
        moved.append(transfer_move(plans[0].robot, q0, q1))
    return tuple(moved)
