"""plan.json: everything about the plans of a job, so that other programs can rely on it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath import __version__
from kerfpath._arrays import Array
from kerfpath.air import AirMove
from kerfpath.auditor import Check
from kerfpath.cell import Cell, caveats
from kerfpath.comfort import MEASURES, Band, Comfort
from kerfpath.contour import KINDS, Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.job._external import by_unit, external_entry, joints, with_external
from kerfpath.job._sequencefile import read_moves, sequence_entry
from kerfpath.planner import FastestSpeed
from kerfpath.plans import Feed, Plan, Proof, Settings
from kerfpath.robots import Coupling, Robot
from kerfpath.sequence import PartPlan
from kerfpath.tilt import Tilt
from kerfpath.urdf import Chain

__all__ = ["SCHEMA", "PlanFile", "broken_entry", "plan_entry", "plan_text", "read_plan_file"]

SCHEMA = 3
"""Version of the layout of plan.json; it grows when a reader of the old one would go wrong."""

_NUMBERS = re.compile(r"\[\s+([-+.\deE,\s]+?)\s+\]")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanFile:
    """A plan.json, read back.

    Parameters
    ----------
    path : Path
    job : dict
        The job file as it was read; empty when the plan was not made from one.
    plans : tuple of Plan
        One for each contour, in the order of cutting.
    missing : tuple of str
        Names of the contours that have no plan.
    failed : tuple of str
        Names of the contours whose plan failed its audit when it was made.
    moves : tuple of AirMove
        Through the air between them; empty when none were planned.
    contours : dict of str to str
        What the job calls the contour of each plan: a plan may be that of a piece.
    in_cell : bool
        Whether the motions were planned and audited clear of collisions.
    """

    path: Path
    job: dict[str, Any]
    plans: tuple[Plan, ...]
    missing: tuple[str, ...]
    failed: tuple[str, ...]
    contours: dict[str, str]
    moves: tuple[AirMove, ...]
    in_cell: bool


def plan_text(
    robot: Robot,
    T_flange_tip: np.ndarray[Any, Any],
    T_base_part: np.ndarray[Any, Any],
    contours: Sequence[dict[str, Any]],
    job: dict[str, Any],
    cell: Cell | None = None,
    part: PartPlan | None = None,
) -> str:
    """Return the text of a plan.json; the same input gives the same bytes.

    Parameters
    ----------
    robot : Robot
        With the limits used.
    T_flange_tip, T_base_part : (4, 4) m
    contours : sequence of dict
        From `plan_entry` and `broken_entry`.
    job : dict
        The job file as read.
    cell : Cell, optional
        What the motions were planned and audited clear of.
    part : PartPlan, optional
        The moves between the contours, and what is proved about their order.
    """
    data = {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": job,
        "robot": _robot_entry(robot),
        "external_axis": external_entry(robot),
        "T_flange_tip": T_flange_tip.tolist(),
        "T_base_part": T_base_part.tolist(),
        "limits": _limits_entry(robot),
        "cell": None if cell is None else _cell_entry(cell),
        "contours": list(contours),
        "sequence": None if part is None else sequence_entry(part),
    }
    text = json.dumps(data, indent=1, allow_nan=False)
    # One row of numbers to a line: a person can still read it, and a diff shows a node.
    return _NUMBERS.sub(lambda m: "[" + re.sub(r"\s+", " ", m[1]) + "]", text) + "\n"


def plan_entry(plan: Plan, contour: str, checks: Sequence[Check]) -> dict[str, Any]:
    """Return what plan.json says of a planned and audited contour, or of a piece of it."""
    criteria, settings = plan.criteria, plan.settings
    return {
        "name": plan.name,
        "contour": contour,
        "feasible": True,
        "closed": plan.contour.closed,
        "method": settings.method,
        "objective": settings.objective,
        "metric": settings.metric,
        **by_unit("weights_per", settings.weights, plan.robot),
        "eta_v": settings.eta_v,
        "eta_a": settings.eta_a,
        "closure": settings.closure,
        "rotation_rad": _finite(settings.rotation),
        "comfort": _bands(settings.comfort),
        "gamma_step_rad": settings.gamma_step,
        "tilt": None
        if settings.tilt is None
        else {
            "cone_rad": settings.tilt.cone,
            "steps": settings.tilt.steps,
            "cost_per_rad": settings.tilt.cost,
        },
        "frames": settings.frames,
        "dt": plan.dt,
        "cost": plan.cost,
        "optimal": plan.proof.optimal,
        "proof": plan.proof.statement,
        "grid_cost": plan.proof.grid_cost,
        "criteria": {
            **by_unit("displacement", criteria.displacement, plan.robot),
            **by_unit("largest_increment", criteria.largest_increment, plan.robot),
            **by_unit("range", criteria.range, plan.robot),
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
            **by_unit("q", plan.q, plan.robot),
            "gamma_rad": plan.gamma.tolist(),
            "lead_lean_rad": plan.tilt.tolist() if plan.tilt.any() else None,
            "posture": plan.posture.tolist(),
            "turn": plan.turn.tolist(),
        },
    }


def broken_entry(name: str, broken: NoFeasiblePath, fastest: FastestSpeed | None) -> dict[str, Any]:
    """Return what plan.json says of a contour without a feasible path."""
    return {
        "name": name,
        "feasible": False,
        "reason": str(broken),
        "proved": broken.proved,
        "last_node_reached": broken.node,
        "counts": broken.counts,
        "fastest_speed_m_s": None if fastest is None else fastest.speed,
    }


def read_plan_file(path: str | Path) -> PlanFile:
    """Return the plans of a plan.json.

    Raises
    ------
    InputError
        No such file, not JSON, another schema, or something missing or of the wrong kind.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a plan.json") from None
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not a plan.json: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        got = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise InputError(
            f"{path}: expected a plan.json with schema {SCHEMA}, got {got!r}; plan the job again"
        )
    try:
        arm = _read_robot(data["robot"], data["limits"])
        robot = with_external(data["external_axis"], arm)
        tool, placement = data["T_flange_tip"], data["T_base_part"]
        entries = data["contours"]
        return PlanFile(
            path=path,
            job=dict(data["job"]),
            plans=tuple(_read_plan(e, robot, tool, placement) for e in entries if e["feasible"]),
            contours={str(e["name"]): str(e["contour"]) for e in entries if e["feasible"]},
            missing=tuple(str(e["name"]) for e in entries if not e["feasible"]),
            failed=tuple(
                str(e["name"])
                for e in entries
                if e["feasible"] and e["audit"]["passed"] is not True
            ),
            moves=read_moves(data["sequence"]),
            in_cell=data.get("cell") is not None,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except KeyError as error:
        raise InputError(f"{path}: the key {error} is missing; plan the job again") from None
    except (TypeError, ValueError, AttributeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{path}: something in it is of the wrong kind ({said})") from None


def _finite(rotation: Array | None) -> list[float | None] | None:
    """Return limits with null, which JSON knows, for infinity, which it does not."""
    return None if rotation is None else [v if np.isfinite(v) else None for v in rotation.tolist()]


def _infinite(rotation: list[float | None] | None) -> Array | None:
    return None if rotation is None else np.array([np.inf if v is None else v for v in rotation])


def _bands(comfort: Comfort | None) -> dict[str, Any] | None:
    """Return the bands that are asked for, margins and widths in rad, m and m^3."""
    if comfort is None:
        return None
    return {name: band for name, band in asdict(comfort).items() if band is not None}


def _robot_entry(robot: Robot) -> dict[str, Any]:
    return {
        "id": robot.id,
        "manufacturer": robot.manufacturer,
        "model": robot.model,
        "kinematics": robot.kinematics,
        "geometry_m": dict(robot.geometry),
        "sign": robot.sign.tolist(),
        "offset_rad": robot.offset.tolist(),
        "T_base_foot": robot.T_base_foot.tolist(),
        "T_end_flange": robot.T_end_flange.tolist(),
        "chain": None
        if robot.chain is None
        else {name: getattr(robot.chain, name).tolist() for name in ("origins", "axes", "end")},
    }


def _limits_entry(robot: Robot) -> dict[str, Any]:
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
    }


def _cell_entry(cell: Cell) -> dict[str, Any]:
    """Return what kept apart and how far: a record, as the cell itself is that of the job."""
    return {
        "bodies": [
            {
                "name": b.name,
                "kind": b.kind,
                "frame": b.frame,
                "approximate": b.approximate,
                "holds_the_real_one": b.holds,
            }
            for b in cell.bodies
        ],
        "near_miss_m": pair_entries(cell),
        "not_judged": [{"between": list(pair), "why": why} for pair, why in cell.unjudged.items()],
        "not_proved": list(caveats(cell)),
    }


def pair_entries(cell: Cell) -> list[dict[str, Any]]:
    """Return what every judged pair keeps, what it is asked, and the overlap that is left out."""
    rules = zip(cell.pair_names, cell.asked, cell.required, cell.depth, strict=True)
    return [
        {
            "between": list(pair),
            "at_least": float(required),
            "asked": float(asked),
            "overlap_by_design": float(depth),
        }
        for pair, asked, required, depth in rules
    ]


def _read_robot(robot: dict[str, Any], limits: dict[str, Any]) -> Robot:
    return Robot(
        id=str(robot["id"]),
        manufacturer=str(robot["manufacturer"]),
        model=str(robot["model"]),
        kinematics=str(robot.get("kinematics", "opw")),
        geometry={k: float(v) for k, v in robot["geometry_m"].items()},
        sign=robot["sign"],
        offset=robot["offset_rad"],
        T_base_foot=robot.get("T_base_foot", np.eye(4)),
        T_end_flange=robot.get("T_end_flange", np.eye(4)),
        chain=Chain(**robot["chain"]) if robot.get("chain") else None,
        lower=limits["lower_rad"],
        upper=limits["upper_rad"],
        endless=limits["endless"],
        velocity=limits["velocity_rad_s"],
        acceleration=limits["acceleration_rad_s2"],
        acceleration_source=str(limits["acceleration_source"]),
        couplings=tuple(
            Coupling(row=c["row"], lower=c["lower_rad"], upper=c["upper_rad"], note=c["note"])
            for c in limits["couplings"]
        ),
    )


def _read_tilt(entry: dict[str, Any] | None) -> Tilt | None:
    if entry is None:
        return None
    return Tilt(cone=entry["cone_rad"], steps=entry["steps"], cost=entry["cost_per_rad"])


def _read_plan(entry: dict[str, Any], robot: Robot, tool: Any, placement: Any) -> Plan:
    nodes = entry["nodes"]
    return Plan(
        contour=Contour(
            nodes["points_m"],
            nodes["axes"],
            closed=entry["closed"],
            s=nodes["s_m"],
            kind=np.array([KINDS.index(word) for word in nodes["kind"]]),
            speed_share=nodes["speed_share"],
            x=nodes["x"],
            name=str(entry["name"]),
        ),
        robot=robot,
        T_flange_tip=tool,
        T_base_part=placement,
        q=joints(nodes, "q", robot),
        gamma=nodes["gamma_rad"],
        tilt=nodes["lead_lean_rad"],
        posture=nodes["posture"],
        turn=nodes["turn"],
        time=nodes["time_s"],
        settings=Settings(
            gamma_step=float(entry["gamma_step_rad"]),
            frames=entry["frames"],
            method=entry["method"],
            objective=entry["objective"],
            metric=entry["metric"],
            weights=joints(entry, "weights_per", robot),
            eta_v=float(entry["eta_v"]),
            eta_a=float(entry["eta_a"]),
            closure=entry["closure"],
            rotation=_infinite(entry["rotation_rad"]),
            comfort=_read_comfort(entry.get("comfort")),
            tilt=_read_tilt(entry["tilt"]),
        ),
        cost=entry["cost"],
        proof=Proof(
            optimal=bool(entry["optimal"]),
            statement=str(entry["proof"]),
            grid_cost=entry["grid_cost"],
        ),
        counts=dict(entry["counts"]),
        feed=None if entry["feed"] is None else Feed(**entry["feed"]),
    )


def _read_comfort(bands: dict[str, Any] | None) -> Comfort | None:
    return None if bands is None else Comfort(**{k: Band(**band) for k, band in bands.items()})
