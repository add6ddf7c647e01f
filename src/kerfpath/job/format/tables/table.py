"""What all tables of a job file share: values and their types, messages, base class and rules."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Sequence
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, freeze
from kerfpath.robots import acceleration_ratios
from kerfpath.setting import Setting, keys, settings

# -----------------------------------------------------------------------------
# x


class HeadPose(NamedTuple):
    """Pose of the tip of a cutting head in the flange.

    Parameters
    ----------
    xyz_mm : (3,) mm
        Position of the tip.
    rpy_deg : (3,) deg
        Its orientation as in `pose`; z points along the beam, out of the nozzle into the part.
    """

    xyz_mm: tuple[float, ...]
    rpy_deg: tuple[float, ...]


@cache
def heads() -> dict[str, HeadPose]:
    """Return the shipped cutting heads by name; their dimensions are generic."""
    text = (files("kerfpath.job") / "heads.toml").read_text(encoding="utf-8")
    return {
        name: HeadPose(tuple(values["xyz_mm"]), tuple(values["rpy_deg"]))
        for name, values in tomllib.loads(text).items()
    }


def pose(xyz_mm: Sequence[float], rpy_deg: Sequence[float]) -> Array:
    """Return the pose (4, 4), in m, of a position and three angles, as in a URDF origin.

    Parameters
    ----------
    xyz_mm : (3,) mm
        Position.
    rpy_deg : (3,) deg
        Roll, pitch and yaw about the fixed axes x, y and z, applied in this order:
        R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix()
    T[:3, 3] = np.multiply(xyz_mm, 1e-3)
    return freeze(T)


# -----------------------------------------------------------------------------
# Types of the values in a job file, and the messages about wrong values.

LARGEST = 1e6
"""Largest number in a job, in the unit of its key; a kilometre in mm is a typing error."""
SMALLEST = 1e-9
"""Least positive number in a job: smaller numbers vanish when units are converted."""
MOST_NODES = 1_000_000
"""Most nodes of a contour: more than any contour needs, few enough to fit into memory."""
FAULT = "kerfpath"
"""Error type of the rules below that pydantic cannot state itself."""
_LISTED = 12
"""Most known names that a message lists."""


def nearest(name: str, known: Collection[str]) -> str:
    """Return words with the `known` names that are most similar to `name`, or with all of them."""
    within = [k for k in known if name and name.lower() in k.lower()]
    if near := within[:3] or get_close_matches(name, known, n=3, cutoff=0.5):
        return f"nearest: {', '.join(near)}"
    return f"known: {', '.join(known)}" if len(known) <= _LISTED else "no known name is similar"


def key(expected: str, example: str, **bounds: Any) -> Any:
    """Return a field with its bounds, and with the expected value and an example for messages."""
    return Field(description=expected, examples=[example], **bounds)


def fault(
    expected: str, got: str | None, remedy: str, where: tuple[str | int, ...] = ()
) -> PydanticCustomError:
    """Return an error at the key `where`, relative to here; `got` None shows the value itself."""
    said = {"expected": expected, "got": got, "remedy": remedy, "where": where}
    return PydanticCustomError(FAULT, "expected {expected}, got {got}; {remedy}", said)


def fault_in_words(said: str, where: tuple[str | int, ...] = ()) -> PydanticCustomError:
    """Return an error with the complete message `said` at the key `where`, relative to here."""
    return PydanticCustomError(FAULT, "{said}", {"said": said, "where": where})


def folder_of(info: ValidationInfo) -> Path:
    """Return the folder of the job file."""
    return info.context["folder"] if info.context else Path()


def existing(what: str) -> Callable[[str, ValidationInfo], str]:
    """Return a validator that requires a file, its path relative to the job's folder."""

    def check(value: str, info: ValidationInfo) -> str:
        folder = folder_of(info)
        try:
            is_file, is_there = (folder / value).is_file(), (folder / value).exists()
        except (OSError, ValueError):  # a name that the file system cannot hold
            is_file = is_there = False
        if not is_file:
            why = "it is not a file" if is_there else f"it is not in {folder}"
            raise fault(what, None, f"{why}; give its path relative to the job file")
        return value

    return check


def one_of(what: str, names: Callable[[], Collection[str]], hint: str = "") -> AfterValidator:
    """Return a validator that admits only one of `names`."""

    def check(value: str) -> str:
        if value not in names():
            raise fault(what, None, f"{nearest(value, names())}{hint}")
        return value

    return AfterValidator(check)


Number = Annotated[float, Field(allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(allow_inf_nan=False, ge=SMALLEST, le=LARGEST)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0, le=LARGEST)]
Axis = Annotated[int, Field(ge=1, le=7)]
# TOML arrays arrive as lists, so these tuples are not strict; their elements are.
Three = Annotated[tuple[Number, ...], Field(strict=False, min_length=3, max_length=3)]
# One number for every joint; the length is checked once the robot is known.
Joints = Annotated[tuple[Number, ...], Field(strict=False, min_length=1)]
JointsPositive = Annotated[tuple[Positive, ...], Field(strict=False, min_length=1)]
JointsNotNegative = Annotated[tuple[NotNegative, ...], Field(strict=False, min_length=1)]
Signs = Annotated[tuple[Literal[-1, 1], ...], Field(strict=False, min_length=1)]
Lengths = dict[str, Number]
# One printable line that is not blank.
Text = Annotated[str, Field(pattern=r"^[^\p{C}\p{Zl}\p{Zp}]*\S[^\p{C}\p{Zl}\p{Zp}]*$")]
Identifier = Annotated[
    str | None,
    key(
        "a name of letters, digits and _, a letter first, at most 32 characters",
        '"trim_1"',
        pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$",
    ),
]
Head = Annotated[str, one_of("a cutting head", heads)]
Ratio = Annotated[str, one_of("a known ratio", acceleration_ratios)]


# -----------------------------------------------------------------------------
# The base class of all tables, and the rules that they share.


class Table(BaseModel):
    """A table: frozen, strict about the types of its values, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def si(self, kind: type) -> dict[str, Any]:
        """Return the settings of a class by their names, in SI; the table was made from them."""
        known = settings(kind).items()
        return {
            name: each.si(getattr(self, each.key)) for name, each in known if each.takes is not None
        }


def fields_of(kind: type) -> dict[str, Any]:
    """Return the keys of a table for the settings of a class: types with bounds, and defaults."""
    return {name: _field(each) for name, each in keys(kind).items()}


NOT_NEGATIVE: dict[Any, Any] = {
    float: NotNegative,
    tuple[float, ...]: JointsNotNegative,
    float | Literal["auto"]: NotNegative | Literal["auto"],
}
"""What a key takes, if that is not negative; no number of a setting is."""


def _field(setting: Setting) -> tuple[Any, Any]:
    """Return the type of a key, with its bounds and the words of its messages, and its default."""
    kind = NOT_NEGATIVE.get(setting.takes, setting.takes)
    if setting.above == 0:
        kind = Positive
    if setting.in_jobs is None:
        kind = kind | None
    if setting.example:
        limits = {"ge": setting.least, "le": setting.most, "lt": setting.below}
        numbers = setting.takes in (float, int)
        bounds = {name: limit for name, limit in limits.items() if numbers and limit is not None}
        kind = Annotated[kind, key(setting.expected(), setting.example, **bounds)]
    return kind, setting.in_jobs


def given(table: Table, *keys: str) -> list[str]:
    """Return the optional keys that the table has."""
    return [key for key in keys if getattr(table, key) is not None]


def example(table: type[BaseModel], name: str) -> str:
    """Return a line of a table: a key, and its example as the value."""
    return f"{name} = {(table.model_fields[name].examples or [''])[0]}"


def require_one(table: Table, keys: Sequence[str], expected: str) -> None:
    """Require one of several optional keys.

    Raises
    ------
    PydanticCustomError
        At the first of them, if none or several are given.
    """
    found = given(table, *keys)
    if len(found) != 1:
        added = f"add, for example, {example(type(table), keys[0])}"
        got, remedy = ("both", "remove one") if found else ("none", added)
        raise fault(expected, got, remedy, (keys[0],))


def require_distinct(
    names: Sequence[str | None], what: str, table: str, keys: Sequence[str]
) -> None:
    """Require that no two tables have the same name; None is no name.

    Raises
    ------
    PydanticCustomError
        At the key of the second table of that name.
    """
    for i, name in enumerate(names):
        if name is not None and name in names[:i]:
            expected, got = f"a name that no other {what} has", f'"{name}" again'
            raise fault(expected, got, "give one of them another name", (table, i, keys[i]))
