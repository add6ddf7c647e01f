"""read_job(): from a TOML file to a job in SI with everything in it resolved."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from kerfpath._arrays import Array, Bools
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job._keys import FAULT, LARGEST, MOST_NODES, SMALLEST, nearest
from kerfpath.job._lines import Places
from kerfpath.job._tables import TABLES, AuditTable, ContourTable, JobFile, PlanTable, ProgramTable
from kerfpath.robots import Robot, postures_named

__all__ = ["ContourTask", "Job", "ProgramOptions", "audit_options", "program_options", "read_job"]

_LONGEST = 60
"""Characters of a wrong value that a message shows."""
_NAME_LENGTH = 32
"""Characters that a robot controller takes in a name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourTask:
    """One contour to cut: which, how fast, and how it is sampled.

    Parameters
    ----------
    pick : str
        Name of the loop in the part.
    name : str
        What the contour is called in messages, reports and programs.
    speed : float m/s
        Speed along the path.
    spacing : float m, optional
        Largest distance between nodes; or
    count : int, optional
        number of nodes; or
    tolerance : float m, optional
        largest distance of the chords from the contour; exactly one of the three is given.
    axis_tolerance : float rad, optional
        Largest angle between the axis along a chord and the contour's, with `tolerance`.
    """

    pick: str
    name: str
    speed: float
    spacing: float | None = None
    count: int | None = None
    tolerance: float | None = None
    axis_tolerance: float | None = None

    def sample(self, contour: Contour) -> Contour:
        """Return the contour sampled as this task says, under the task's name.

        Raises
        ------
        InputError
            A spacing that would make too many nodes, a tolerance that cannot be kept.
        """
        if self.spacing is not None and contour.length / self.spacing > MOST_NODES:
            raise InputError(
                f"contour {self.name!r}: {self.spacing * 1e3:g} mm between nodes would make more "
                f"than {MOST_NODES} of them over {contour.length * 1e3:g} mm; raise spacing_mm"
            )
        return replace(contour, name=self.name).resample(
            spacing=self.spacing,
            count=self.count,
            tolerance=self.tolerance,
            axis_tolerance=self.axis_tolerance,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramOptions:
    """What the robot program needs beyond the plan.

    Parameters
    ----------
    language : {"rapid"}
        Robot language.
    name : str
        Name of the module: letters, digits and _, a letter first.
    retract : float m
        How far the head backs off along the tool axis between contours.
    zone : float m
        How far from a node the robot may begin to turn towards the next.
    laser_output : str
        Digital output that switches the laser.
    lead_time : float s
        How long before the robot reaches a point the laser is switched for it.
    work_object, tool_name : str
        Names of the part frame and the tool in the program.
    """

    language: Literal["rapid"]
    name: str
    retract: float
    zone: float
    laser_output: str
    lead_time: float
    work_object: str
    tool_name: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """A job file, read and resolved: all in SI, nothing left to look up but the part itself.

    Parameters
    ----------
    path : Path
        The job file.
    robot : Robot
        With limits, velocities and accelerations as the job says.
    tool : (4, 4) m
        T_flange_tip.
    placement : (4, 4) m
        T_base_part.
    part_file : Path
        The CAD file, there when the job was read.
    part_unit : {"mm", "cm", "m", "in"} or None
        Length unit that overrides the CAD file's own.
    contours : tuple of ContourTask
        In the order of cutting.
    plan_options : dict
        Keyword arguments of `kerfpath.planner.plan`, in SI.
    refine_parts : int
        Parts into which the refinement divides every interval between nodes.
    interruptions : {"none", "fewest"}
        Whether a contour that cannot be cut in one go is cut in pieces.
    audit_options : dict
        Keyword arguments of `kerfpath.auditor.checks`, in SI.
    program : ProgramOptions
        For the robot program.
    source : dict
        The whole file as read: tables, keys and values that JSON can hold.
    """

    path: Path
    robot: Robot
    tool: Array
    placement: Array
    part_file: Path
    part_unit: str | None
    contours: tuple[ContourTask, ...]
    plan_options: dict[str, Any]
    refine_parts: int
    interruptions: Literal["none", "fewest"]
    audit_options: dict[str, Any]
    program: ProgramOptions
    source: dict[str, Any]


def read_job(path: str | Path) -> Job:
    """Return the job of a TOML file.

    Raises
    ------
    InputError
        Anything wrong with the file, in one line: file, line, key, what was expected, what came
        and what to do; the first problem, and how many more there are.
    """
    path = Path(path)
    text = _text(path)
    source = _tables(path, text)
    try:
        file = JobFile.model_validate(source, context={"folder": path.parent})
    except ValidationError as error:
        raise _refusal(path, text, error) from None
    robot = file.robot.resolve()
    return Job(
        path=path,
        robot=robot,
        tool=file.tool.resolve(),
        placement=file.part.resolve(),
        part_file=path.parent / file.part.file,
        part_unit=file.part.unit,
        contours=tuple(_task(table) for table in file.contour),
        plan_options=_plan_options(file.plan, robot.endless) | {"comfort": file.comfort.resolve()},
        refine_parts=file.plan.refine_parts,
        interruptions=file.plan.interruptions,
        audit_options=audit_options(file.audit),
        program=program_options(file.program, path.stem),
        source=source,
    )


def _text(path: Path) -> str:
    try:
        raw = path.read_bytes()
    except IsADirectoryError:
        raise _error(path, None, "expected a job file, got a folder; name a file in it") from None
    except FileNotFoundError:
        raise _error(path, None, "no such file; give the path of a job file") from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise _error(path, None, f"cannot be read ({why}); give the path of a job file") from None
    try:
        return raw.decode("utf-8-sig")  # some editors begin a UTF-8 file with a byte order mark
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise _error(
            path,
            line,
            f"expected UTF-8 text, got the byte 0x{raw[error.start]:02x}; save the file as UTF-8",
        ) from None


def _tables(path: Path, text: str) -> dict[str, Any]:
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise _error(path, None, "arrays or tables are nested too deeply; flatten them") from None
    except tomllib.TOMLDecodeError as error:
        told = str(error)
        at = re.search(r" \(at line (\d+), column \d+\)$", told)
        line = int(at[1]) if at else text.rstrip("\n").count("\n") + 1
        raise _error(path, line, f"not valid TOML: {told}; correct it there") from None
    except ValueError:  # what Python's int() refuses
        raise _error(path, None, "not valid TOML: an integer is too long; shorten it") from None
    if not tables:
        raise _error(
            path, 1, "expected [robot], [tool], [part] and [[contour]], got an empty file; add them"
        )
    return tables


def _task(table: ContourTable) -> ContourTask:
    angle = table.axis_tolerance_deg
    return ContourTask(
        pick=table.pick,
        name=table.name or table.pick,
        speed=table.speed_m_min / 60,
        spacing=_metres(table.spacing_mm),
        count=table.count,
        tolerance=_metres(table.tolerance_mm),
        axis_tolerance=None if angle is None else float(np.radians(angle)),
    )


def _metres(mm: float | None) -> float | None:
    return None if mm is None else mm / 1000


def _rotation(degrees: float | None, endless: Bools) -> Array | None:
    return None if degrees is None else np.where(endless, np.radians(degrees), np.inf)


def _plan_options(table: PlanTable, endless: Bools) -> dict[str, Any]:
    return {
        "gamma_step": float(np.radians(table.gamma_step_deg)),
        "frames": table.frames,
        "postures": None if table.posture is None else postures_named(table.posture),
        "method": table.method,
        "objective": table.objective,
        "metric": table.metric,
        "weights": table.weights,
        "eta_v": table.eta_velocity,
        "eta_a": table.eta_acceleration,
        "closure": table.closure,
        "rotation": _rotation(table.rotation_deg, endless),
        "feed": table.feed,
        "refine": table.method == "exact" if table.refine is None else table.refine,
    }


def audit_options(table: AuditTable) -> dict[str, Any]:
    """Return what an [audit] table asks for, as `kerfpath.auditor.checks` takes it."""
    return {
        "path_tolerance": table.path_tolerance_mm / 1000,
        "axis_tolerance": float(np.radians(table.axis_tolerance_deg)),
    }


def program_options(table: ProgramTable, stem: str) -> ProgramOptions:
    """Return the options of a [program] table; `stem` names the program where it does not."""
    stem = re.sub(r"[^A-Za-z0-9_]", "_", stem)
    stem = stem if stem[:1].isascii() and stem[:1].isalpha() else f"job_{stem}"
    return ProgramOptions(
        language=table.language,
        name=table.name or stem[:_NAME_LENGTH],
        retract=table.retract_mm / 1000,
        zone=table.zone_mm / 1000,
        laser_output=table.laser_output,
        lead_time=table.lead_time_s,
        work_object=table.work_object,
        tool_name=table.tool_name,
    )


def _refusal(path: Path, text: str, error: ValidationError) -> InputError:
    """Return the first problem in the file, said in one line."""
    details = error.errors(include_url=False)
    locs, places = [d["loc"] for d in details], Places(text)
    problems = []
    for detail in details:
        loc = detail["loc"]
        # An array with a wrong element is also called too short: the element says it all.
        if detail["type"] == "too_short" and any(p[: len(loc)] == loc != p for p in locs):
            continue
        where = (*loc, *detail["ctx"]["where"]) if detail["type"] == FAULT else loc
        # What is missing comes last: a misspelt key is the better news of the two.
        order = detail["type"] == "missing", *places.locate(where)
        key = ".".join(part for part in where if isinstance(part, str))
        problems.append((order, f"{key}: {_problem(detail)}"))
    (_, *position), said = min(problems)
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return _error(path, position[0], said + more)


def _problem(detail: ErrorDetails) -> str:
    """Say what was expected, what came and what to do."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == FAULT:
        got = context["got"] or _shown(value)
        return f"expected {context['expected']}, got {got}; {context['remedy']}"
    table, *keys = (part for part in detail["loc"] if isinstance(part, str))
    header = f"[[{table}]]" if table == "contour" else f"[{table}]"
    if kind == "extra_forbidden":
        known = TABLES[table].model_fields if keys else TABLES
        holder = f"a key of {header}" if keys else "a known table"
        unknown = keys[0] if keys else table
        return f"expected {holder}, got an unknown name; {nearest(unknown, known)}"
    if not keys:
        if kind == "tuple_type" and isinstance(value, dict):
            return f"expected tables {header}, got a single one; write it as {header}"
        got = "none" if kind == "missing" else _shown(value)
        return f"expected a table {header}, got {got}; write its header and its keys"
    field = TABLES[table].model_fields[keys[0]]
    expected, example = field.description, f"{keys[0]} = {(field.examples or [''])[0]}"
    if kind == "missing":
        return f"expected {expected}, got nothing; add, for example, {example}"
    if kind == "literal_error":
        return f"expected {context['expected']}, got {_shown(value)}; write one of them"
    bound = context.get("le", context.get("ge"))
    if bound in (-LARGEST, LARGEST) or (bound == SMALLEST and value > 0):
        expected = f"{expected}, at {'most' if 'le' in context else 'least'} {bound:g}"
    last = detail["loc"][-1]
    number = f" as number {last + 1}" if isinstance(last, int) else ""
    return f"expected {expected}, got {_shown(value)}{number}; write, for example, {example}"


def _shown(value: object) -> str:
    """Return a value as TOML has it, cut short."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        inside = ("..." if isinstance(v, dict | list) else _shown(v) for v in value[:_LONGEST])
        text = f"[{', '.join(inside)}]"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, date | datetime | time):
        text = value.isoformat()
    elif isinstance(value, int) and abs(value) >= 1e20:
        return "a number of more than 20 digits"
    else:
        text = str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _error(path: Path, line: int | None, said: str) -> InputError:
    """Return the error with its place in front, all on one line whatever came from the file."""
    text = f"{path}: {said}" if line is None else f"{path}:{line}: {said}"
    return InputError("".join(c if c.isprintable() else repr(c)[1:-1] for c in text))
