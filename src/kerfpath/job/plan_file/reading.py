"""Read a plan.json: its plans and moves, with the type of every value checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import BaseModel, ValidationError

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import Check, Unit, format_value, transfer_checks, worst_of
from kerfpath.cell import Cell, caveats
from kerfpath.contour import KINDS, Contour
from kerfpath.errors import InputError
from kerfpath.job.format import PreparedJob
from kerfpath.job.plan_file.layout import LimitsData, PlanData, PlanDocument
from kerfpath.job.plan_file.schema import (
    add_externals,
    joints,
    read_certificate,
    read_document,
    read_moves,
    with_dynamics,
)
from kerfpath.options import PlanOptions
from kerfpath.plans import Feed, Plan, Proof
from kerfpath.robots import Coupling, Robot
from kerfpath.sequence import Order, PartPlan
from kerfpath.transfer import End, TransferMove, back_off, least_time
from kerfpath.urdf import KinematicChain

# -----------------------------------------------------------------------------
# Rows of an audit's table.


def check(code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0) -> Check:
    """Return a row, with plain Python numbers."""
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node
    )


def count(code: str, title: str, found: float, node: int = 0) -> Check:
    """Return a row that counts faults, of which none is allowed."""
    return check(code, title, found, 0, "count", node)


# -----------------------------------------------------------------------------
# The result of the audit of a file.

NOT_CHECKED = "Collisions are not checked: simulate the program in the cell before running it."
"""The note for a job without a [cell]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditReport:
    """The result of the audit of a plan.json or of a program.

    Parameters
    ----------
    tables : dict of str to list of Check
        The table of each contour that has a plan, or of each cut of a program.
    missing : tuple of str
        Names of the contours without one.
    note : str
        What was checked for collisions, and what was not.
    places : dict of str to tuple of str
        For a program: file and line of the target of each node.
    """

    tables: dict[str, list[Check]]
    missing: tuple[str, ...]
    note: str
    places: dict[str, tuple[str, ...]] = field(default_factory=dict)

    __repr__ = short_repr

    @property
    def passed(self) -> bool:
        """True if every contour has a plan and no check found an error."""
        return not self.missing and all(
            check.ok or check.level == "warning"
            for checks in self.tables.values()
            for check in checks
        )

    def place(self, name: str, check: Check) -> str:
        """Return where a check of a table failed: a node, or in a program the file and line."""
        lines = self.places.get(name, ())
        return f"{lines[check.node]}" if check.node < len(lines) else f"node {check.node}"

    def sentence(self, name: str, check: Check) -> str:
        """Return one sentence: where a check of a table failed, what was found, what is allowed."""
        if check.unit == "count" and check.limit == 0:
            found = f"{check.title}: {check.value:g}, expected none"
        else:
            value, limit = (format_value(x, check.unit) for x in (check.value, check.limit))
            found = f"{check.title}: {value}, allowed {limit}"
        advice = f"; {check.advice}" if check.advice else ""
        return f"{self.place(name, check)}: {found}{advice}"


def collision_note(cell: Cell | None, *, moves_too: bool = False) -> str:
    """Return the note on what was checked for collisions, and what was not."""
    if cell is None:
        return NOT_CHECKED
    about = f" (approximate: {', '.join(cell.approximate)})" if cell.approximate else ""
    checked = (
        f"Collisions are checked along the contours, among {len(cell.bodies)} bodies of the "
        f"cell{about}; the moves to and between contours are "
        f"{'checked, too' if moves_too else 'not checked'}."
    )
    return " ".join([checked, *caveats(cell)])


# -----------------------------------------------------------------------------
# Audit the transfer moves of a plan.json against the job.

SAME_CORNER = 1e-6
"""Rounding tolerance, rad, between an end of a move and the end of the retract."""
FARTHEST = 1e3
"""Joint value, rad, that no joint ever has."""
SHARES = np.linspace(0.0, 1.0, 9)
"""Shares of the retract at which approach and retract are checked for collisions."""


def check_moves(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove]
) -> list[Check]:
    """Return the worst of each check over all moves; its node is the number of the move.

    Each must lead from the retract of one cut to the approach of the next, or home, within the
    limits, not faster than the robot can, and free of collisions, as must approach and retract.
    """
    sequence, robot = prepared.job.sequence, prepared.job.robot
    if sequence is None:
        return [count("moves", "moves that the job does not ask for", len(moves))] if moves else []
    homes = 2 if prepared.job.home is not None else 0
    wanted = len(plans) - 1 + homes
    rows = [count("moves", "missing or surplus moves", abs(len(moves) - wanted))]
    odd = [m for m in moves if m.q.shape[1] != robot.joints or len(m.q) < 2]
    far = [m for m in moves if not np.abs(m.q).max(initial=0.0) < FARTHEST]
    rows.append(count("corners", "moves without two corners of the robot's joints", len(odd)))
    rows.append(count("air-limits", "moves with corners beyond any joint's range", len(far)))
    if len(moves) != wanted or odd or far:
        return rows
    try:
        ways = [(_approach(prepared, p, "start"), _approach(prepared, p, "end")) for p in plans]
    except InputError as error:
        return [*rows, count("retract", f"ends of cuts without a possible retract: {error}", 1)]
    o, cell = prepared.job.options, prepared.cell
    tables = [
        transfer_checks(robot, m.q, m.time, cell=cell, eta_v=o.eta_v, eta_a=o.eta_a) for m in moves
    ]
    for table, move, ends in zip(tables, moves, _ends(prepared, ways), strict=True):
        table += _fits(prepared, move, ends)
    rows += worst_of(tables)
    if cell is not None:
        ups = [
            [c for c in transfer_checks(robot, way, np.arange(len(way)) * 1e3, cell=cell)
             if c.code.startswith("collision")]
            for pair in ways for way in pair
        ]  # fmt: skip
        rows += [_way_row(row) for row in worst_of(ups)]
    return rows


def expect_sequence(
    prepared: PreparedJob, plans: Sequence[Plan], moves: Sequence[TransferMove], at_least: float
) -> PartPlan | None:
    """Return the plans and moves as the job asks for them, in the times that the moves need.

    The claim about other orders (`at_least` s) is not checked.
    """
    if prepared.job.sequence is None:
        return None
    program = prepared.job.program
    candidates = np.arange(len(plans))
    part = PartPlan(
        plans=tuple(plans),
        moves=tuple(
            TransferMove(q=m.q, time=_times(plans[0], m.q), clear=prepared.cell is not None)
            for m in moves
        ),
        order=Order(candidates=candidates, duration=0.0, at_least=at_least),
        chosen=(),
        retract=program.retract,
        approach_speed=program.approach_speed,
        pierce_time=program.pierce_time,
    )
    order = Order(candidates=candidates, duration=part.cycle_time, at_least=at_least)
    return replace(part, order=order)


def _times(first: Plan, q: Array) -> Array:
    """Return when the corners of a planned move are reached in the least time, s."""
    velocity, acceleration = first.robot.speed_limits()
    eta_v, eta_a = first.settings.eta_v, first.settings.eta_a
    took = least_time(np.diff(q, axis=0), eta_v * velocity, eta_a * acceleration)
    return np.concatenate([[0.0], np.cumsum(np.maximum(took, 1e-9))])


def _approach(prepared: PreparedJob, plan: Plan, end: End) -> Array:
    """Return joints (9, n) rad along the approach or the retract of a cut, from the cut on."""
    retract = prepared.job.program.retract
    return np.array([back_off(plan, end, float(share) * retract) for share in SHARES])


def _ends(prepared: PreparedJob, ways: Sequence[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    """Return where each move begins and ends, (n,) rad each."""
    home = prepared.job.home
    starts, ends = [way[0][-1] for way in ways], [way[1][-1] for way in ways]
    if home is not None:
        starts, ends = [*starts, home], [home, *ends]
        return list(zip(ends, starts, strict=True))
    return list(zip(ends[:-1], starts[1:], strict=True))


def _fits(prepared: PreparedJob, move: TransferMove, ends: tuple[Array, Array]) -> list[Check]:
    """Compare the ends of a move with those of the cuts and home, and its start time with zero.

    In the last move, endless joints may be at home on another turn.
    """
    first, last = np.abs(move.q[0] - ends[0]), np.abs(move.q[-1] - ends[1])
    home = prepared.job.home
    if home is not None and np.array_equal(ends[1], home):
        whole = 2 * np.pi * np.round(last / (2 * np.pi))
        last = np.where(prepared.job.robot.endless, np.abs(last - whole), last)
    off = max(float(first.max()), float(last.max()))
    begins = abs(float(move.time[0]))
    return [
        check(
            "air-ends", "distance of a move's ends from the cuts and home", off, SAME_CORNER, "rad"
        ),
        check("air-begins", "time at the start of a move", begins, 1e-9, "s"),
    ]


def _way_row(row: Check) -> Check:
    title = f"in approach and retract: {row.title}"
    return replace(row, code=f"approach-{row.code}", title=title, node=row.node // 2)


# -----------------------------------------------------------------------------
# Read a plan.json: its plans and moves, with the type of every value checked.

_M = TypeVar("_M", bound=BaseModel)
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanFile:
    """A plan.json that was read back.

    Parameters
    ----------
    path : Path
    job : dict
        The parsed job file; empty if the plan was not made from one.
    plans : tuple of Plan
        One for each contour, in the order of cutting.
    missing : tuple of str
        Names of the contours that have no plan.
    failed : tuple of str
        Names of the contours whose plan failed its audit when it was made.
    moves : tuple of TransferMove
        The transfer moves between them; empty if none were planned.
    contours : dict of str to str
        Name in the job of the contour of each plan; a plan may be that of a piece.
    in_cell : bool
        Whether the motions were planned and audited clear of collisions.
    picked : frozenset of str
        Names of the contours whose plan was picked from a Pareto set.
    data : dict
        The complete document.
    """

    path: Path
    job: Mapping[str, Any]
    plans: tuple[Plan, ...]
    missing: tuple[str, ...]
    failed: tuple[str, ...]
    contours: dict[str, str]
    moves: tuple[TransferMove, ...]
    in_cell: bool
    picked: frozenset[str]
    data: PlanDocument

    __repr__ = short_repr

    @property
    def entries(self) -> dict[str, PlanData]:
        """The entry of each contour, or piece, that has a plan, by its name."""
        return {entry["name"]: entry for entry in planned_entries(self.data)}


def read_plan_file(path: str | Path) -> PlanFile:
    """Return the plans of a plan.json.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    file : PlanFile
        Its `plans` in the order of cutting, and the rest of the file.

    Raises
    ------
    InputError
        The file does not exist, is not JSON or has another schema; a key is missing, unknown or
        twice in an object; or a value has the wrong type.
    """
    path = Path(path)
    data = read_document(path)
    try:
        arm = _read_robot(data["robot"], data["limits"])
        robot = add_externals(data["external_axes"], arm)
        entries = planned_entries(data)
        return PlanFile(
            path=path,
            job=data["job"],
            plans=tuple(
                _read_plan(e, robot, data["T_flange_tip"], data["T_base_part"]) for e in entries
            ),
            contours={e["name"]: e["contour"] for e in entries},
            missing=tuple(e["name"] for e in data["contours"] if not e["feasible"]),
            failed=tuple(e["name"] for e in entries if not e["audit"]["passed"]),
            moves=read_moves(data["sequence"], robot),
            in_cell=data["cell"] is not None,
            picked=frozenset(e["name"] for e in entries if e.get("picked", False)),
            data=data,
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except KeyError as error:
        raise InputError(f"{path}: the key {error} is missing; plan the job again") from None
    except (TypeError, ValueError) as error:  # rows of different lengths, which no schema forbids
        said = " ".join(str(error).split())
        raise InputError(
            f"{path}: a value has the wrong type ({said}); plan the job again"
        ) from None


def planned_entries(data: PlanDocument) -> list[PlanData]:
    """Return the entries of the contours that have a plan."""
    return [cast(PlanData, entry) for entry in data["contours"] if entry["feasible"]]


def table_of(
    file: PlanFile, name: str, model: type[_M], read: Callable[[_M], _R], **changes: str
) -> _R:
    """Return a table of the job that a plan was made from, read like that of a job file."""
    table: Any = file.job.get(name, {})
    try:
        return read(model.model_validate({**table, **changes}))
    except (ValidationError, TypeError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{file.path}: its [{name}] table is not valid ({said})") from None


def _read_robot(robot: Mapping[str, Any], limits: LimitsData) -> Robot:
    """Return the arm, which casts and checks its arrays itself."""
    said: Mapping[str, Any] = limits
    arm = Robot(
        id=robot["id"],
        manufacturer=robot["manufacturer"],
        model=robot["model"],
        kinematics=robot["kinematics"],
        geometry=robot["geometry_m"],
        sign=robot["sign"],
        offset=robot["offset_rad"],
        axis_3=robot["axis_3"],
        T_base_foot=robot["T_base_foot"],
        T_end_flange=robot["T_end_flange"],
        chain=KinematicChain(**robot["chain"]) if robot["chain"] else None,
        lower=said["lower_rad"],
        upper=said["upper_rad"],
        endless=said["endless"],
        velocity=said["velocity_rad_s"],
        acceleration=said["acceleration_rad_s2"],
        acceleration_source=said["acceleration_source"],
        couplings=tuple(
            Coupling(row=c["row"], lower=c["lower_rad"], upper=c["upper_rad"], note=c["note"])
            for c in said["couplings"]
        ),
    )
    return with_dynamics(limits, arm)


def _read_plan(entry: PlanData, robot: Robot, tool: Any, placement: Any) -> Plan:
    nodes: Mapping[str, Any] = entry["nodes"]
    certificate = entry.get("certificate")
    weights = {"weights_per_rad": joints(entry, "weights_per", robot).tolist()}
    return Plan(
        contour=Contour(
            nodes["points_m"],
            nodes["axes"],
            closed=entry["closed"],
            s=nodes["s_m"],
            kind=np.array([KINDS.index(word) for word in nodes["kind"]]),
            speed_share=nodes["speed_share"],
            x=nodes["x"],
            name=entry["name"],
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
        settings=PlanOptions.from_data(entry | weights),
        cost=entry["cost"],
        proof=Proof(
            optimal=entry["optimal"],
            statement=entry["proof"],
            grid_cost=entry["grid_cost"],
            bound=entry["bound"],
            gap=entry["gap"],
            certificate=None if certificate is None else read_certificate(certificate),
        ),
        counts=entry["counts"],
        feed=None if entry["feed"] is None else Feed(**entry["feed"]),
    )
