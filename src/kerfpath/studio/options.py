"""The form of options: the keys of a job that have a control, and what a control must know of them.

Unit, kind, choices, bounds, default and help of a key follow from its declaration in the tables of
a job; of a planning option its group and its label, too. Those of other keys are given here.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, get_args, get_origin

from pydantic.fields import FieldInfo

from kerfpath.cad import SUFFIXES, UNITS_MM
from kerfpath.front import CRITERIA
from kerfpath.job import SOLIDS, TABLES, VARIABLES, JobFile, heads
from kerfpath.options import PlanOptions
from kerfpath.post import languages
from kerfpath.report.layout import GOALS
from kerfpath.robots import Robot, robot_ids
from kerfpath.robots import robot as library_robot
from kerfpath.setting import settings
from kerfpath.studio.messages import (
    Companion,
    OptionField,
    OptionGroup,
    OptionsMessage,
    RobotChoice,
    Sampling,
    Variable,
)
from kerfpath.study.placing import DEFAULT_RANGES

UNITS = {
    "_mm_s2": "mm/s2", "_deg_s2": "deg/s2", "_mm_s": "mm/s", "_deg_s": "deg/s", "_m_min": "m/min",
    "_per_deg": "per deg", "_mm": "mm", "_deg": "deg", "_ms": "ms", "_m3": "m\u00b3",
    "_percent": "%", "seconds": "s",
}  # fmt: skip
"""Unit of a key by the end of its name."""


SEARCH = ("Search", "Feed reductions and pieces", "Tolerance of the tool axis")
"""Titles of groups of planning options that are shown one below the other."""
EXTERNAL = "External axes"
"""Title of the group of external axes; each axis has its own fields."""
POSTURE = "plan.posture"
"""Key whose choices depend on the robot."""
SAMPLINGS = {
    "spacing": ("spacing_mm",),
    "time step": ("time_step_ms",),
    "tolerance": ("tolerance_mm", "axis_tolerance_deg"),
    "count": ("count",),
}
"""Keys of the ways to place the nodes of a contour; the first one of each is required."""


@cache
def _groups() -> dict[str, tuple[OptionField, ...]]:
    """Return the fields that every job has, by the titles of their groups."""
    return {
        "Objective and limits": tuple(_planning("Objective and limits")),
        EXTERNAL: (),
        "Place of the part": (
            _field("part.xyz_mm", "x, y, z"),
            _field("part.rpy_deg", "Roll, pitch, yaw"),
        ),
        "Drawing": (_field("part.edge_turn_mm", "Turn at sharp edges, before and behind"),),
        **{title: tuple(_planning(title)) for title in SEARCH},
        "Margins": (
            *_band("limits", "Joint limits", "deg"),
            *_band("wrist", "Wrist singularity", "deg"),
            *_band("elbow", "Elbow singularity", "deg"),
            *_band("shoulder", "Shoulder singularity", "mm"),
            *_band("manipulability", "Manipulability", "m3"),
            *_band("clearance", "Clearance", "mm"),
            _field("comfort.reversals_cost", "Reversals, cost of each"),
            _field(
                "comfort.reversals_joints",
                "Joints whose reversals cost",
                needs="comfort.reversals_cost",
            ),
        ),
        "Bound": tuple(_planning("Bound")),
        "Order and transfer moves": (
            _field("sequence", "Plan transfer moves"),
            _field("sequence.order", "Order", needs="sequence"),
            _field("sequence.inner_first", "Inner contours first", needs="sequence"),
            _field("sequence.heat_spacing_mm", "Heat spacing", needs="sequence"),
            _field("sequence.heat_time_s", "Heat time", needs="sequence"),
            _field("sequence.seconds", "Time limit for the order", needs="sequence"),
            _field("sequence.home_deg", "Home", needs="sequence", kind="joints"),
        ),
        "The cut": (
            _field("contour.start", "Start"),
            _field("contour.start_mm", "Start at"),
            _field("contour.direction", "Direction"),
            _field("contour.candidates", "Number of starts to try"),
            _field("contour.scrap", "Scrap side"),
            _field("contour.kerf_mm", "Kerf"),
            _field("contour.bevel_deg", "Bevel"),
            _field("contour.overlap_mm", "Overlap"),
        ),
        "Leads": (*_lead("contour.lead_in", "Lead-in"), *_lead("contour.lead_out", "Lead-out")),
        "Micro joints and corners": (
            _field(
                "contour.micro_joints.count",
                "Micro joints",
                table="contour.micro_joints",
                companion=Companion(key="contour.micro_joints.width_mm", value=0.4),
            ),
            _field(
                "contour.micro_joints.width_mm",
                "Width of a micro joint",
                table="contour.micro_joints",
                needs="contour.micro_joints.count",
            ),
            _field("contour.corners.round_mm", "Corners rounded by"),
            _field("contour.corners.loop_mm", "Loop at corners, radius"),
            _field("contour.corners.slow_share", "Share of the speed at corners"),
        ),
    }


def _planning(group: str) -> Iterator[OptionField]:
    """Yield the fields of the planning options that are declared to be of a group."""
    for option in settings(PlanOptions).values():
        for key, each in option.keys.items():
            first = next(iter(option.keys))
            if each.group == group:
                needs = None if key == first else f"plan.{first}"
                yield _field(f"plan.{key}", each.label, help=each.help, needs=needs)


def _band(name: str, label: str, unit: str) -> Iterator[OptionField]:
    """Yield the fields of a band of [comfort]: its width and its cost are given together."""
    width, cost = f"comfort.{name}_band_{unit}", f"comfort.{name}_cost"
    if name != "clearance":  # its margin is the near-miss distance of the cell
        yield _field(f"comfort.{name}_margin_{unit}", f"{label}, margin")
    yield _field(width, f"{label}, band width", companion=Companion(key=cost, value=1))
    yield _field(cost, f"{label}, cost", needs=width, companion=Companion(key=width, value=None))


def _lead(table: str, label: str) -> Iterator[OptionField]:
    length = f"{table}.length_mm"
    yield _field(length, f"{label}, length", table=table)
    yield _field(f"{table}.shape", f"{label}, shape", needs=length)
    yield _field(f"{table}.angle_deg", f"{label}, angle", needs=length)
    yield _field(f"{table}.fan_mm", f"{label}, fan", needs=length)
    yield _field(f"{table}.speed_share", f"{label}, share of the speed", needs=length)


def options_message(robot: Robot | None, external: Sequence[str] = ()) -> OptionsMessage:
    """Return the form of options of a job.

    Parameters
    ----------
    robot : Robot or None
        The robot of the job; None if it is not known.
    external : sequence of str
        Names of the axes in its tables of `robot.external`.
    """
    groups = dict(_groups())
    if robot is not None:
        groups[EXTERNAL] = tuple(_external(robot, external))
        first, objective = next(iter(groups.items()))
        known = {"choices": _postures(robot)}
        groups[first] = tuple(
            field.model_copy(update=known) if field.key == POSTURE else field for field in objective
        )
    return OptionsMessage(
        groups=[
            OptionGroup(
                title=title,
                contour=any(field.key.startswith("contour.") for field in fields),
                fields=list(fields),
            )
            for title, fields in groups.items()
        ],
        samplings=[
            Sampling(
                label=label,
                field=_field(f"contour.{keys[0]}", "Nodes by", required=True),
                keys=[f"contour.{key}" for key in keys],
                usual=float((_declaration(f"contour.{keys[0]}").examples or ["1"])[0]),
            )
            for label, keys in SAMPLINGS.items()
        ],
        goals={goal: words.capitalize() for goal, words in GOALS.items()},
        variables=[_variable(key, label) for key, label in VARIABLES.items()],
        criteria=list(CRITERIA),
        languages=[*sorted(languages()), "none"],
        robots=_library(),
        heads=list(heads()),
        suffixes=sorted(SUFFIXES),
        units=sorted(UNITS_MM),
        solids=list(SOLIDS),
        solid_units=_words(_declaration("cell.fixture.unit").annotation),
    )


@cache
def _library() -> list[RobotChoice]:
    """Return the robots of the library, by maker."""
    found = sorted(map(library_robot, robot_ids()), key=lambda r: (r.manufacturer, r.model))
    return [
        RobotChoice(
            id=each.id,
            maker=each.manufacturer,
            model=each.model,
            joints=each.joints,
            kinematics=each.kinematics,
            reach=each.reach,
            payload=each.payload,
            ratio=each.acceleration_ratio if each.acceleration is None else None,
            missing=each.limits_missing,
            languages=[
                n for n, one in languages().items() if each.manufacturer in one.manufacturers
            ],
        )
        for each in found
    ]


def _external(robot: Robot, names: Sequence[str]) -> Iterator[OptionField]:
    """Yield the fields of external axes, with the keys of their kinds."""
    n = robot.arm.joints
    axes = {axis.name: (axis, robot.endless[n + i]) for i, axis in enumerate(robot.externals)}
    for i, name in enumerate(names):
        axis, endless = axes[name]
        unit = "deg" if axis.kind == "rotary" else "mm"
        keys = {"axis": "direction"}
        if axis.kind == "rotary":
            keys["point_mm"] = "point on the axis"
        if not endless:
            keys |= {f"lower_{unit}": "lower limit", f"upper_{unit}": "upper limit"}
        keys |= {
            f"velocity_{unit}_s": "speed",
            f"acceleration_{unit}_s2": "acceleration",
            f"home_{unit}": "home",
            f"step_{unit}": "grid step",
        }
        for key, label in keys.items():
            yield _field(f"robot.external.{i}.{key}", f"{name}, {label}")


def _variable(key: str, label: str) -> Variable:
    """Return a variable of the search for the best placement."""
    usual = json.loads((_declaration(f"layout.{key}").examples or [])[0])
    varies = key in DEFAULT_RANGES
    return Variable(key=key, label=label, unit=_unit(key), usual=usual, varies=varies)


def _field(key: str, label: str, **more: Any) -> OptionField:
    """Return the control of a key; what `more` does not say follows from its declaration."""
    declared = _declaration(key)
    low, high = _bounds(declared)
    default = declared.get_default(call_default_factory=True)
    return OptionField(
        **{
            "key": key,
            "label": label,
            "kind": _kind(key, declared.annotation),
            "unit": _unit(key),
            "choices": _words(declared.annotation),
            "default": default if isinstance(default, bool | int | float | str) else None,
            "low": low,
            "high": high,
            "help": declared.description or "",
        }
        | more
    )


def _declaration(key: str) -> FieldInfo:
    """Return the declaration of a dotted key in the tables of a job."""
    table, _, name = _named(key).rpartition(".")
    return (TABLES[table] if table else JobFile).model_fields[name]


def _named(key: str) -> str:
    """Return a dotted key without the numbers of repeated tables."""
    return ".".join(part for part in key.split(".") if not part.isdecimal())


def _words(annotation: Any) -> list[str]:
    """Return the words that a type allows."""
    if isinstance(annotation, str):
        return [annotation]
    return [word for part in get_args(annotation) for word in _words(part)]


def _kind(key: str, annotation: Any) -> str:
    """Return the kind of control for a key and its type."""
    if _named(key) in TABLES:
        return "table"
    if key == POSTURE or _words(annotation):
        return "choice"
    types = set(_types(annotation))
    if tuple in types or list in types:
        return "list"
    return "switch" if bool in types else "number"


def _types(annotation: Any) -> Iterator[object]:
    """Yield a type and the types in it, without what annotates them."""
    yield get_origin(annotation) or annotation
    for part in get_args(annotation):
        yield from _types(part)


def _bounds(field: FieldInfo) -> tuple[float | None, float | None]:
    """Return the least and the largest value of a key."""
    rules = [*field.metadata, *_rules(field.annotation)]
    low = [getattr(rule, name) for rule in rules for name in ("ge", "gt") if hasattr(rule, name)]
    high = [getattr(rule, name) for rule in rules for name in ("le", "lt") if hasattr(rule, name)]
    return max(low, default=None), min(high, default=None)


def _rules(annotation: Any) -> Iterator[object]:
    """Yield what annotates the numbers in a type."""
    for part in get_args(annotation):
        yield from part.metadata if isinstance(part, FieldInfo) else _rules(part)


def _unit(key: str) -> str:
    return next((unit for end, unit in UNITS.items() if key.endswith(end)), "")


def _postures(robot: Robot) -> list[str]:
    """Return the names by which postures may be requested, the least specific first."""
    names = [name.split("/") for name in robot.family.postures]
    return list(dict.fromkeys("/".join(name[:n]) for n in (1, 2, 3) for name in names))
