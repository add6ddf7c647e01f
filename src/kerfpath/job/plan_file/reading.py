"""Read a plan.json: its plans and moves, with the type of every value checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from pydantic import BaseModel, ValidationError

from kerfpath.arrays import short_repr
from kerfpath.contour import KINDS, Contour
from kerfpath.errors import InputError
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
from kerfpath.transfer import TransferMove
from kerfpath.urdf import KinematicChain

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
