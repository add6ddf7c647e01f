"""Write plan.json, which has everything about the plans of a job for other programs."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, cast

import numpy as np

from kerfpath import __version__
from kerfpath.arrays import Array
from kerfpath.auditor import BOUND, Check
from kerfpath.cell import Cell, caveats
from kerfpath.comfort import MEASURES
from kerfpath.errors import NoFeasiblePath
from kerfpath.job.plan_file.layout import (
    BrokenData,
    ContourData,
    LimitsData,
    PlanData,
    PlanDocument,
    RobotData,
)
from kerfpath.job.plan_file.schema import (
    SCHEMA,
    apart,
    certificate_entry,
    dynamics_entry,
    external_entries,
    sequence_entry,
)
from kerfpath.planner import FastestSpeed
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.sequence import PartPlan

_NUMBERS = re.compile(r"\[\s+([-+.\deE,\s]+?)\s+\]")


def plan_text(document: PlanDocument) -> str:
    """Return the text of a plan.json; the same document gives the same bytes."""
    text = json.dumps(document, indent=1, allow_nan=False)
    # One row of numbers per line, so that people can read it and a diff shows a node.
    return _NUMBERS.sub(lambda m: "[" + re.sub(r"\s+", " ", m[1]) + "]", text) + "\n"


def plan_document(
    robot: Robot,
    tool: Array,
    placement: Array,
    contours: Sequence[ContourData],
    job: Mapping[str, Any],
    cell: Cell | None = None,
    part: PartPlan | None = None,
) -> PlanDocument:
    """Return the content of a plan.json.

    Parameters
    ----------
    robot : Robot
        The robot, with the limits used.
    tool, placement : (4, 4) m
        T_flange_tip and T_base_part.
    contours : sequence of dict
        From `plan_entry` and `broken_entry`.
    job : mapping
        The job file as read.
    cell : Cell, optional
        The cell in which the motions were planned and audited.
    part : PartPlan, optional
        The moves between the contours, and what is proved about their order.
    """
    return {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": dict(job),
        "robot": _robot_entry(robot),
        "external_axes": external_entries(robot),
        "T_flange_tip": tool.tolist(),
        "T_base_part": placement.tolist(),
        "limits": _limits_entry(robot),
        "cell": None if cell is None else _cell_entry(cell),
        "contours": list(contours),
        "sequence": None if part is None else sequence_entry(part),
    }


def plan_entry(
    plan: Plan,
    contour: str,
    checks: Sequence[Check],
    *,
    picked: bool = False,
    certificate: bool = False,
) -> PlanData:
    """Return the plan.json entry of a planned and audited contour, or of a piece of it.

    `picked` marks a plan of a Pareto set, which has its own objective, weights and eta. With
    `certificate` the entry has the certificate of the plan's bound, if there is one; without it,
    the audit has no row about the bound.
    """
    criteria, settings, proof = plan.criteria, plan.settings, plan.proof
    shown = proof.certificate if certificate else None
    checks = [c for c in checks if shown is not None or c.code != BOUND]
    entry = {
        "name": plan.name,
        "contour": contour,
        "feasible": True,
        **({"picked": True} if picked else {}),
        "closed": plan.contour.closed,
        **settings.to_data(),
        **apart("weights_per", settings.weights, plan.robot),
        "dt": plan.dt,
        "cost": plan.cost,
        "optimal": proof.optimal,
        "proof": proof.statement,
        "grid_cost": proof.grid_cost,
        "bound": proof.bound,
        "gap": proof.gap,
        **({} if shown is None else {"certificate": certificate_entry(shown)}),
        "criteria": {
            **apart("displacement", criteria.displacement, plan.robot),
            **apart("largest_increment", criteria.largest_increment, plan.robot),
            **apart("range", criteria.range, plan.robot),
            "peak_velocity_share": criteria.peak_velocity.tolist(),
            "peak_acceleration_share": criteria.peak_acceleration.tolist(),
            "nearest": {
                name: {"least": least if np.isfinite(least) else None, "unit": MEASURES[name].unit}
                | {"node": node}
                for name, (least, node) in criteria.nearest.items()
            },
        },
        "feed": None if plan.feed is None else asdict(plan.feed),
        "counts": dict(plan.counts),
        "audit": {
            "passed": all(c.ok or c.level == "warning" for c in checks),
            "checks": [asdict(c) | {"ok": c.ok} for c in checks],
        },
        "nodes": {
            "s_m": plan.contour.s.tolist(),
            "time_s": plan.time.tolist(),
            "points_m": plan.contour.points.tolist(),
            "axes": plan.contour.axes.tolist(),
            "kind": list(plan.contour.kinds),
            "speed_share": plan.contour.speed_share.tolist(),
            "x": None if plan.contour.x is None else plan.contour.x.tolist(),
            **apart("q", plan.q, plan.robot),
            "gamma_rad": plan.gamma.tolist(),
            "lead_lean_rad": plan.tilt.tolist() if plan.tilt.any() else None,
            "posture": plan.posture.tolist(),
            "turn": plan.turn.tolist(),
        },
    }
    return cast(PlanData, entry)


def broken_entry(name: str, broken: NoFeasiblePath, fastest: FastestSpeed | None) -> BrokenData:
    """Return the plan.json entry of a contour without a feasible path."""
    closed, needed = broken.closed, broken.relaxation
    return {
        "name": name,
        "feasible": False,
        "reason": str(broken),
        "proved": broken.proved,
        "proved_for": broken.scope,
        "closed": None
        if closed is None
        else {"node": closed.node, "joint": closed.joint, "limit": closed.limit},
        "relaxation": None
        if needed is None
        else {
            "speed": needed.speed,
            "velocity": needed.velocity,
            "acceleration": needed.acceleration,
        },
        "last_node_reached": broken.node,
        "counts": broken.counts,
        "fastest_speed_m_s": None if fastest is None else fastest.speed,
    }


def _robot_entry(robot: Robot) -> RobotData:
    return {
        "id": robot.id,
        "manufacturer": robot.manufacturer,
        "model": robot.model,
        "kinematics": robot.kinematics,
        "geometry_m": dict(robot.geometry),
        "sign": robot.sign.tolist(),
        "offset_rad": robot.offset.tolist(),
        "axis_3": robot.axis_3,
        "T_base_foot": robot.T_base_foot.tolist(),
        "T_end_flange": robot.T_end_flange.tolist(),
        "chain": None
        if (chain := robot.chain) is None
        else {
            "origins": chain.origins.tolist(),
            "axes": chain.axes.tolist(),
            "end": chain.end.tolist(),
        },
    }


def _limits_entry(robot: Robot) -> LimitsData:
    robot = robot.alone()
    limits = robot.joint_limits()
    velocity, acceleration = robot.speed_limits()
    return {
        "lower_rad": limits.lower.tolist(),
        "upper_rad": limits.upper.tolist(),
        "endless": robot.endless.tolist(),
        "velocity_rad_s": velocity.tolist(),
        "acceleration_rad_s2": acceleration.tolist(),
        "acceleration_source": robot.acceleration_source,
        "couplings": [
            {"row": c.row.tolist(), "lower_rad": c.lower, "upper_rad": c.upper, "note": c.note}
            for c in robot.couplings
        ],
        **dynamics_entry(robot),
    }


def _cell_entry(cell: Cell) -> dict[str, object]:
    """Return a record of the pairs kept apart and how far; the cell itself is that of the job."""
    return {
        "bodies": [
            {
                "name": b.name,
                "kind": b.kind,
                "frame": b.frame,
                "moves_with": cell.chain.moves_with(b.frame),
                "approximate": b.approximate,
                "holds_the_real_one": b.holds,
            }
            for b in cell.bodies
        ],
        "near_miss_m": [
            {
                "between": list(pair),
                "at_least": float(required),
                "asked": float(asked),
                "overlap_by_design": float(depth),
            }
            for pair, asked, required, depth in zip(
                cell.pair_names, cell.asked, cell.required, cell.depth, strict=True
            )
        ],
        "not_judged": [{"between": list(pair), "why": why} for pair, why in cell.unjudged.items()],
        "not_proved": list(caveats(cell)),
    }
