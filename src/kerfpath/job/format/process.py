"""The process of a job: a chart fills in what its tables leave out; the rest is for the operator.

The values of the chart are in the tables of the job from here on, so whatever reads a job, or a
plan.json, has them as if they were written there. A key of the job is never changed.
"""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.job.format.charts import NoRow, choose
from kerfpath.job.format.tables import (
    TABLES,
    ContourTable,
    CostTable,
    JobRowTable,
    ProcessTable,
    RowTable,
    StageTable,
)
from kerfpath.job.format.tables.process import NORMAL, SMALL_HOLE
from kerfpath.job.format.toml_file import all_of, refusal, refusal_at
from kerfpath.post import GASES, ProgramKeywords, ProgramOptions

LEADS = {"lead_in": "lead_in_mm", "lead_out": "lead_out_mm"}
"""The key of a chart that has the length of each lead of a contour."""
SHEET_WIDTH = 30
"""Most characters of a line of the process sheet: as many as a remark of INFORM has."""
TITLE = "PROCESS SHEET, set by hand:"
"""First line of the process sheet."""
EXAMPLE = "EXAMPLE VALUES, NOT MEASURED"
"""Line of the process sheet under a row that is only an example."""
DIFFER = "ROWS DIFFER: stop in between"
"""Line of the process sheet if its rows differ in what no program switches."""
SHEET = {
    "stand_off_mm": "stand-off {:g} mm",
    "power_w": "power {:g} W",
    "power_by_speed": "power by speed {}",
    "frequency_hz": "frequency {:g} Hz",
    "duty_percent": "duty {:g} %",
    "pressure_bar": "gas pressure {:g} bar",
    "gas_lead_s": "gas ahead {:g} s",
    "nozzle_mm": "nozzle {:g} mm",
    "focus_mm": "focus {:g} mm",
    "current_a": "current {:g} A",
    "voltage_v": "voltage {:g} V",
    "pause_at_end_s": "pause at end {:g} s",
    "note": "{}",
}
"""Values of a row that the operator sets, and their words."""
CURVE = "power_by_speed"
"""The key of the power by the speed, in rows and in [program]."""
STAGE = {
    "time_s": "{:g} s",
    "power_w": "{:g} W",
    "frequency_hz": "{:g} Hz",
    "duty_percent": "{:g} %",
    "height_mm": "{:g} mm high",
    "gas": "{}",
    "pressure_bar": "{:g} bar",
    "focus_mm": "focus {:g} mm",
}
"""Values of a stage of the pierce, and their words."""

# -----------------------------------------------------------------------------
# Fill in the tables of a job.


class _OnlyProcess(BaseModel):
    process: ProcessTable


def with_process(path: Path, text: str, source: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a job with the values of its chart where the job has none.

    [process] then has the rows in use. What is wrong with other tables is left to their checks.

    Raises
    ------
    InputError
        [process] is not valid, there is no row for it or for a contour, or the rows of two
        contours differ in what a program has once.
    """
    if "process" not in source:
        return source
    try:
        process = _OnlyProcess.model_validate(source).process
    except ValidationError as error:
        raise refusal(path, text, error) from None
    for key in ("cut_by", "small_holes"):
        if getattr(process, key) is not None:
            said = f"expected technique in each [[contour]], got {key}, which plan.json files have"
            raise refusal_at(path, ("process", key), f"{said}; remove it")
    contours = source.get("contour")
    if not isinstance(contours, list) or not all(isinstance(one, dict) for one in contours):
        return source
    chosen: dict[str, JobRowTable] = {}
    faults: list[InputError] = []
    filled: list[dict[str, Any]] = []
    for number, contour in enumerate(contours):
        technique = contour.get("technique", process.technique)
        if not isinstance(technique, str):
            return source
        try:
            row = chosen.get(technique) or choose(process, technique, path.parent)
        except InputError as error:
            key = error.key if isinstance(error, NoRow) else "chart"
            own = "technique" in contour and key == "technique"
            at = ("contour", number, key) if own else ("process", key)
            fault = refusal_at(path, at, f"{error}")
            faults += [] if any(one.message == fault.message for one in faults) else [fault]
            continue
        chosen[technique] = row
        filled.append(_filled(contour, row))
    if faults:
        raise all_of(faults)
    return _with_rows(path, {**source, "contour": filled}, list(chosen.values()))


def _with_rows(
    path: Path, source: Mapping[str, Any], rows: Sequence[JobRowTable]
) -> dict[str, Any]:
    """Return the tables of a job with rows, and what these have alike in [program] and [cell]."""
    program, cell = _alike(path, source, rows), source.get("cell")
    if isinstance(cell, dict):
        cell = _once(path, source, "cell", {"stand_off_mm": [row.stand_off_mm for row in rows]})
    kept = [row.model_dump(mode="json", exclude_none=True, exclude_defaults=True) for row in rows]
    return {
        **source,
        "process": {**source["process"], "row": kept},
        **({"program": program} if program else {}),
        **({} if cell is None else {"cell": cell}),
    }


def require_prices(
    path: Path, cost: CostTable, process: ProcessTable, rows: Sequence[JobRowTable]
) -> None:
    """Raise InputError unless rows have all that the prices of a job need."""
    for row in rows:
        if (lacks := cost.lacks(row, row.gas or process.gas)) is not None:
            key, what = lacks
            said = f"expected {what} in {row.place}, got none; add it, or remove {key}"
            raise refusal_at(path, ("cost", key), said)


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallHoles:
    """How the holes up to a size are cut, where a job says nothing else.

    Parameters
    ----------
    size : float m
        Largest distance between two points of such a hole.
    row : JobRowTable
        The row of their technique.
    tables : tuple of dict or None
        The table of each contour with the values of this row; None for one with a technique.
    """

    size: float
    row: JobRowTable
    tables: tuple[dict[str, Any] | None, ...]

    __repr__ = short_repr


def small_holes_of(path: Path, text: str, source: Mapping[str, Any]) -> SmallHoles | None:
    """Return how a job cuts small holes; None if no contour may be one, or no size is known.

    `source` are its tables as `with_process` returns them, `text` is its file.

    Raises
    ------
    InputError
        The job gives a size, but there is no row for small holes.
    """
    if "process" not in source:
        return None
    process = ProcessTable.model_validate(source["process"])
    written = tomllib.loads(text)
    process = process.model_copy(
        update={"row": ProcessTable.model_validate(written["process"]).row}
    )
    own = ["technique" in contour for contour in written["contour"]]
    if process.technique != NORMAL or process.small_hole_mm == 0 or all(own):
        return None
    try:
        row = choose(process, SMALL_HOLE, path.parent)
    except NoRow as error:
        if process.small_hole_mm is None:
            return None
        raise refusal_at(path, ("process", "small_hole_mm"), f"{error}") from None
    size = process.small_hole_mm or row.small_hole_mm
    if not size:
        return None
    return SmallHoles(
        size=size / 1000,
        row=row,
        tables=tuple(
            None if said else {**_filled(contour, row), "technique": SMALL_HOLE}
            for said, contour in zip(own, written["contour"], strict=True)
        ),
    )


def with_small_holes(
    path: Path, text: str, source: Mapping[str, Any], small: SmallHoles,
    taken: Mapping[int, Sequence[str]],
) -> Mapping[str, Any]:  # fmt: skip
    """Return the tables of a job with the technique of its small holes.

    `taken` has the names of the small holes of each table with one.

    Raises
    ------
    InputError
        The rows of the techniques do not fit together.
    """
    written, process = tomllib.loads(text), ProcessTable.model_validate(source["process"])
    contours, several = list(source["contour"]), list[str]()
    for number, names in taken.items():
        if "pick_all" in contours[number]:
            several += names
        else:
            contours[number] = small.tables[number]
    by_technique = {row.technique: row for row in (*process.row, small.row)}
    used = [contour.get("technique", process.technique) for contour in contours]
    rows = [by_technique[technique] for technique in dict.fromkeys([*used, SMALL_HOLE])]
    own = {key: value for key, value in source.items() if key not in ("program", "cell")}
    own |= {key: written[key] for key in ("program", "cell") if key in written}
    found = _with_rows(path, {**own, "contour": contours}, rows)
    if several:
        found["process"] = {**found["process"], "small_holes": several}
    return found


def _filled(contour: Mapping[str, Any], row: RowTable) -> dict[str, Any]:
    """Return the table of a contour with what a row knows and the table does not say."""
    table = {"speed_m_min": row.speed_m_min, **contour}
    if row.kerf_mm:
        table.setdefault("kerf_mm", row.kerf_mm)
    for name, key in LEADS.items():
        lead = table.get(name, {})
        if (length := getattr(row, key)) and isinstance(lead, dict):
            table[name] = {"length_mm": length, **lead}
    joints = table.get("micro_joints")
    if row.micro_joint_mm and isinstance(joints, dict):
        table["micro_joints"] = {"width_mm": row.micro_joint_mm, **joints}
    return table


def _alike(path: Path, source: Mapping[str, Any], rows: Sequence[JobRowTable]) -> Any:
    """Return [program] with what it sets alike for all rows; other values are of contours."""
    program = source.get("program", {})
    if not isinstance(program, dict):
        return program
    second, gases = program.get("gas_2"), {_gas(source, row): None for row in rows}
    if isinstance(second, str) and len(gases) > 1 and second not in gases:
        named = ", ".join(gas for gas in gases if gas)
        said = f"expected a gas of the rows in use, {named}, got {second!r}; the others would all "
        raise refusal_at(path, ("program", "gas_2"), f"{said}be switched by gas_output")
    each, found, full = [*_by_program(source, rows).values()], {}, full_power(source, rows)
    for key in dict.fromkeys(key for values in each for key in values):
        values = [one.get(key) for one in each]
        if key == "gas":
            continue  # which no key of [program] says
        if all(value == values[0] for value in values) and (key != CURVE or full is None):
            found[key] = values[0]
        elif key == "gas_lead_s" and None in values:
            lacks = rows[values.index(None)].place
            said = f"expected gas_lead_s in every row in use, got none in {lacks}"
            said += "; add it there, or write gas_lead_s in [program]"
            raise refusal_at(path, ("process", "technique"), said)
    if full is not None and None in (powers := [row.power_w for row in rows]):
        lacks = rows[powers.index(None)].place
        said = "expected power_w in every row in use, as the program sets the power of each, got "
        said += f"none in {lacks}; add it there, or write power_by_speed in [program]"
        raise refusal_at(path, ("process", "technique"), said)
    return {**program, **found}


def _gas(source: Mapping[str, Any], row: RowTable) -> str | None:
    """Return the gas of a row, or else that of the job; None if neither says it."""
    return row.gas or source["process"].get("gas")


def full_power(source: Mapping[str, Any], rows: Sequence[RowTable]) -> float | None:
    """Return the power (W) of which a program sets shares that differ with the techniques.

    It is the largest of their rows. None if they have the same power, or the program sets none or
    that of the job.
    """
    powers = {row.power_w for row in rows}
    said = CURVE in source.get("program", {})
    if said or len(powers) < 2 or not _names(source, "power_output"):
        return None
    return max(power for power in powers if power is not None)


def _by_program(
    source: Mapping[str, Any], rows: Sequence[JobRowTable]
) -> dict[str, dict[str, Any]]:
    """Return what the program sets by the row of each technique, by keys of [program].

    Keys that [program] has are left out. The stages of pierces are set where the power follows the
    speed, the powers of all of them are known, and the job says nothing else of the pierce.
    """
    program, full = source.get("program", {}), full_power(source, rows)
    powered, second = _names(source, "power_output"), program.get("gas_2")
    gases = any(_names(source, f"{gas}_output") for gas in GASES)
    curves = full is not None or any(row.power_by_speed is not None for row in rows)
    follows = powered and (CURVE in program or curves)
    staged = follows and not {"pierce_time_s", "pierce_power", "pierce_stages"} & set(program)
    staged = staged and all(row.pierce_stages is not None for row in rows if row.pierce)
    found: dict[str, dict[str, Any]] = {}
    for row in rows:
        values = found[row.technique] = {}
        share = 1.0 if full is None or row.power_w is None else row.power_w / full
        if staged and row.pierce_stages is not None:
            stages = row.pierce_stages
            values["pierce_stages"] = [[round(share * power, 6), time] for power, time in stages]
        elif row.pierce and not {"pierce_time_s", "pierce_stages"} & set(program):
            values["pierce_time_s"] = row.pierce_time
        if gases and "gas_lead_s" not in program:
            values |= {} if row.gas_lead_s is None else {"gas_lead_s": row.gas_lead_s}
        if second is not None and _gas(source, row) == second:
            values["gas"] = "gas_2"
        if powered and curves and CURVE not in program:
            curve = row.power_by_speed or [[0.0, 1.0], [1.0, 1.0]]
            values[CURVE] = [[speed, round(share * power, 6)] for speed, power in curve]
    return found


def contours_of(source: Mapping[str, Any]) -> dict[str, ProgramKeywords]:
    """Return the options that each contour of a job has of its own in the program, by its name.

    They are those that differ with the techniques; empty if none does. Before the drawing is read,
    the loops of [contour.pick_all] are left out.
    """
    if "process" not in source:
        return {}
    process = ProcessTable.model_validate(source["process"])
    own = _by_program(source, process.row)
    if not any(own.values()):
        return {}
    cut_by = process.cut_by or {
        name: contour.get("technique", process.technique)
        for contour in source["contour"]
        if (name := contour.get("name") or contour.get("pick"))
    }
    return {
        name: ProgramKeywords(**{key.removesuffix("_s"): v for key, v in own[technique].items()})  # type: ignore[typeddict-item]  # of these keys
        for name, technique in cut_by.items()
    }


def with_cuts(source: Mapping[str, Any], cut_by: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the tables of a job with the technique of each contour, if there are several."""
    process = source.get("process", {})
    if len(process.get("row", ())) < 2:
        return source
    return {**source, "process": {**process, "cut_by": dict(cut_by)}}


def _names(source: Mapping[str, Any], output: str) -> bool:
    """Return whether the job names an output in the language of its program."""
    program = source.get("program")
    if not isinstance(program, dict):
        return False
    table = program.get(str(program.get("language", ProgramOptions().language)))
    return isinstance(table, dict) and output in table


def _once(
    path: Path, source: Mapping[str, Any], name: str, values: Mapping[str, Sequence[Any]]
) -> Any:
    """Return a table of the job with values that all rows in use have alike."""
    table = source.get(name, {})
    if not isinstance(table, dict):
        return table
    found = {}
    for key, each in values.items():
        if key in table or all(value is None for value in each):
            continue
        distinct = [value for k, value in enumerate(each) if value not in each[:k]]
        if len(distinct) > 1:
            number = isinstance(distinct[-1] or distinct[0], float)
            unit = f" {key.rpartition('_')[2]}" if number else ""
            words = (f"{value or 0:g}" if number else f"{value or 'none'}" for value in distinct)
            got = " and ".join(words) + unit
            said = (
                f"expected one {key} of [{name}] for all contours, got {got} from the rows of "
                f"their techniques; write {key} in [{name}]"
            )
            raise refusal_at(path, ("process", "technique"), said)
        found[key] = each[0]
    return {**table, **found}


# -----------------------------------------------------------------------------
# The process sheet: what the operator sets.


def sheet_of(source: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the lines of the process sheet of a job, from its tables as `with_process` fills them.

    Each line begins with a sign that no robot language gives a meaning, and fits one remark.
    """
    if "process" not in source:
        return ()
    process = ProcessTable.model_validate(source["process"])
    lines = [TITLE]
    several = len(process.row) > 1
    for row in process.row:
        if not (cut := _cut_by(source, process, row)):
            continue  # all of its contours are small holes
        words = (row.material, f"{row.thickness_mm:g} mm", row.gas, row.quality, row.technique)
        lines.append(" ".join(word for word in words if word))
        lines += [EXAMPLE] if row.example else []
        lines += [f"for {', '.join(cut)}"] if several else []
        lines += [f"machine: {row.machine}"] if row.machine else []
        lines += [words for _, _, words in by_hand(source, process, row)]
    if several and any(len(each) > 1 for each in _alone(source, process)):
        lines.append(DIFFER)
    return tuple(
        row
        for line in lines
        for row in textwrap.wrap(line, SHEET_WIDTH, initial_indent="- ", subsequent_indent="+ ")
    )


def by_hand(
    source: Mapping[str, Any], process: ProcessTable, row: JobRowTable
) -> Iterator[tuple[str, Any, str]]:
    """Yield key, value and words of what the operator sets for a row."""
    said = {"stand_off_mm": (source.get("cell") or {}).get("stand_off_mm", row.stand_off_mm)}
    program = {*source.get("program", {}), *_by_program(source, process.row)[row.technique]}
    if "gas_lead_s" in program:
        said["gas_lead_s"] = None  # the program switches the gas
    if CURVE in program:
        said[CURVE] = None  # the program sets the power
    if (full := full_power(source, process.row)) is not None:
        said["power_w"] = full
    for key, words in SHEET.items():
        value = said.get(key, getattr(row, key))
        if value is not None:
            yield key, value, words.format(value)
    joined = any(
        "micro_joints" in contour
        for contour in source["contour"]
        if contour.get("technique", process.technique) == row.technique
    )
    if row.micro_joint_mm and not joined:
        yield "micro_joint_mm", row.micro_joint_mm, f"micro joints {row.micro_joint_mm:g} mm"
    for number, stage in enumerate(row.pierce, 1):
        words = stage_words(stage, by_program="pierce_stages" in program)
        if words:
            yield f"pierce {number}", stage.time_s, f"pierce {number}: {words}"


def row_words(row: RowTable) -> str:
    """Return the values of a row beside speed and kerf in words."""
    more = {"lead_in_mm": "lead-in {:g} mm", "lead_out_mm": "lead-out {:g} mm"}
    more |= {"micro_joint_mm": "micro joints {:g} mm", "gas_flow_l_min": "gas {:g} l/min"} | SHEET
    said = [words.format(getattr(row, key)) for key, words in more.items() if getattr(row, key)]
    return ", ".join([*said, *(f"pierce {stage_words(stage)}" for stage in row.pierce)])


def stage_words(stage: StageTable, *, by_program: bool = False) -> str:
    """Return the values of a stage of the pierce in words; without those that a program sets."""
    left_out = ("time_s", "power_w") if by_program else ()
    given = {key: getattr(stage, key) for key in STAGE if key not in left_out}
    return " ".join(STAGE[key].format(each) for key, each in given.items() if each is not None)


def _alone(source: Mapping[str, Any], process: ProcessTable) -> list[set[str]]:
    """Return the words of each value to set by hand, over the rows."""
    rows = [{k: words for k, _, words in by_hand(source, process, row)} for row in process.row]
    keys = {key for row in rows for key in row if key not in ("note", "micro_joint_mm")}
    found = [{row.get(key, "") for row in rows} for key in sorted(keys)]
    second = source.get("program", {}).get("gas_2")
    return [*found, {row.gas or "" for row in process.row if row.gas != second or not row.gas}]


def _cut_by(source: Mapping[str, Any], process: ProcessTable, row: JobRowTable) -> list[str]:
    """Return the names of the contours that a row is for."""
    small = [*(process.small_holes or ())] if row.technique == SMALL_HOLE else []
    return small + [
        str(contour.get("name") or contour.get("pick") or "several loops")
        for contour in source["contour"]
        if contour.get("technique", process.technique) == row.technique
    ]


# -----------------------------------------------------------------------------
# Where each value comes from.


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """A value of the process, and where it comes from.

    Parameters
    ----------
    of : str
        The contour, "program" or "cell" that it is a value of; a technique if set by hand.
    key : str
    value : number or str
        None: nothing sets it.
    origin : str
        "job", "default", or the chart and its row.
    by_hand : bool
        Whether the operator sets it.
    """

    of: str
    key: str
    value: Any
    origin: str
    by_hand: bool = False

    __repr__ = short_repr

    @property
    def shown(self) -> str:
        """The value as text; "-" without one."""
        number = isinstance(self.value, int | float)
        return "-" if self.value is None else f"{self.value:g}" if number else f"{self.value}"


def origins_of(text: str, source: Mapping[str, Any]) -> tuple[Origin, ...]:
    """Return the values of the process of a job, with the text of its file and its tables."""
    if "process" not in source:
        return ()
    written, process = tomllib.loads(text), ProcessTable.model_validate(source["process"])
    rows = {row.technique: row for row in process.row}
    own_values = _by_program(source, process.row)
    of_contours = {key for values in own_values.values() for key in values}
    found = []
    for own, table in zip(written["contour"], source["contour"], strict=True):
        row = rows[table.get("technique", process.technique)]
        name = str(table.get("name") or table.get("pick") or "several loops")
        plain = {key: ContourTable.model_fields[key].default for key in ("speed_m_min", "kerf_mm")}
        for key, default in plain.items():
            found.append(_origin(name, key, own, table, row.place, default))
        for lead in LEADS:
            inner = (own.get(lead, {}), table.get(lead, {}))
            found.append(_origin(name, "length_mm", *inner, row.place, None, under=lead))
        if "micro_joints" in table:
            inner = (own["micro_joints"], table["micro_joints"])
            found.append(_origin(name, "width_mm", *inner, row.place, None, under="micro_joints"))
        for key, value in own_values[row.technique].items():
            found.append(Origin(of=name, key=key, value=value, origin=row.place))
    if process.small_holes:
        row, of = rows[SMALL_HOLE], f"{len(process.small_holes)} small holes of several loops"
        keys = ("speed_m_min", "kerf_mm", *LEADS.values())
        values = {key: getattr(row, key) for key in keys} | own_values[SMALL_HOLE]
        for key, value in values.items():
            found.append(Origin(of=of, key=key, value=value, origin=row.place))
    place = ", ".join(row.place for row in process.row)
    power = [key for key in ("power_by_speed", "pierce_stages") if key in source.get("program", {})]
    program_keys = ("pierce_time_s", "gas_lead_s", *power)
    for name, keys in (("program", program_keys), ("cell", ("stand_off_mm",))):
        if name == "cell" and name not in source:
            continue
        for key in keys:
            if key in of_contours:
                continue
            default = TABLES[name].model_fields[key].default
            inner = (written.get(name, {}), source.get(name, {}))
            found.append(_origin(name, key, *inner, place, default))
    for row in process.row:
        for key, value, words in by_hand(source, process, row):
            said = words.partition(": ")[2] if key.startswith("pierce") else value
            own = "cell" in source and key == "stand_off_mm" and key in written["cell"]
            origin = "job" if own else row.place
            found.append(Origin(of=row.technique, key=key, value=said, origin=origin, by_hand=True))
    return tuple(found)


def _origin(
    of: str, key: str, written: Mapping[str, Any], table: Mapping[str, Any], place: str,
    default: Any, *, under: str = "",
) -> Origin:  # fmt: skip
    name = f"{under}.{key}" if under else key
    if key in written:
        return Origin(of=of, key=name, value=written[key], origin="job")
    if key in table:
        return Origin(of=of, key=name, value=table[key], origin=place)
    return Origin(of=of, key=name, value=default, origin="default")
