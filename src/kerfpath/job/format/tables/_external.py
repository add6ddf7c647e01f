"""The [[robot.external]] tables: rails, turntables and tilts that move with the robot.

A table describes its axis completely, or adds what is not known of an axis of the library or of
a description.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.job.format._poses import pose
from kerfpath.job.format._values import (
    FAULT,
    Number,
    Positive,
    Text,
    Three,
    fault,
    fault_in_words,
    key,
    one_of,
)
from kerfpath.job.format.tables._in_keys import in_keys
from kerfpath.job.format.tables._table import Table, given
from kerfpath.robots import ExternalAxis, KnownAxis, Travel, external_axes

__all__ = ["External", "ExternalTable", "axes_of", "require_in_order"]

KEYS = {
    "linear": ("lower_mm", "upper_mm", "velocity_mm_s", "acceleration_mm_s2", "step_mm", "home_mm"),
    "rotary": (
        "lower_deg", "upper_deg", "velocity_deg_s", "acceleration_deg_s2", "step_deg", "home_deg",
    ),
}  # fmt: skip
"""Keys of each kind: range, speed, acceleration, step of a grid, home."""
FACTORS = {"linear": 1e-3, "rotary": float(np.pi / 180)}
"""Factor from the unit of these keys to m or rad."""
WORDS = ("lower=", "upper=", "velocity=", "acceleration=")
"""The Python arguments that messages name in place of the first of these keys."""
NAME = r"^[A-Za-z][A-Za-z0-9_]{0,15}$"
WHOLE = ("kind", "carries", "axis", "point_mm", "xyz_mm", "rpy_deg")
"""Keys that define an axis and its place; a joint of a description has all of them."""
EXAMPLES = {
    "lower_mm": "-2000", "upper_mm": "2000", "velocity_mm_s": "1000", "acceleration_mm_s2": "1500",
    "lower_deg": "-180", "upper_deg": "180", "velocity_deg_s": "120", "acceleration_deg_s2": "200",
}  # fmt: skip


class ExternalTable(Table):
    """[[robot.external]]: one external axis; of those on one side, each carries the next."""

    model: Annotated[
        str | None,
        one_of("an axis of the library", external_axes, "; 'kerfpath robots' lists all"),
        key("an axis of the library", '"kuka_dkp400.tilt"'),
    ] = None
    joint: Annotated[Text | None, key("a joint of the description", '"rail_joint"')] = None
    name: Annotated[
        str | None,
        key(
            "a name of letters, digits and _, a letter first, at most 16 characters",
            '"rail"',
            pattern=NAME,
        ),
    ] = None
    kind: Annotated[Literal["linear", "rotary"] | None, key("a kind of axis", '"linear"')] = None
    carries: Annotated[Literal["robot", "part"] | None, key("what it moves", '"robot"')] = None
    axis: Annotated[
        Three | None, key("3 numbers, its direction in the robot base", "[0, 1, 0]")
    ] = None
    point_mm: Annotated[
        Three | None,
        key("3 numbers, a point of its axis in the robot base in mm", "[1200, 0, 500]"),
    ] = None
    xyz_mm: Annotated[
        Three | None,
        key("3 numbers, the position of the product in the robot base in mm", "[1600, 0, 0]"),
    ] = None
    rpy_deg: Annotated[
        Three | None,
        key("3 numbers, roll, pitch and yaw of the product in the robot base in deg", "[0, 0, 90]"),
    ] = None
    endless: Annotated[bool | None, key("true or false", "true")] = None
    lower_mm: Annotated[Number | None, key("a number, in mm", "-2000")] = None
    upper_mm: Annotated[Number | None, key("a number, in mm", "2000")] = None
    lower_deg: Annotated[Number | None, key("a number, in deg", "-180")] = None
    upper_deg: Annotated[Number | None, key("a number, in deg", "180")] = None
    velocity_mm_s: Annotated[Positive | None, key("a number above 0, in mm/s", "1000")] = None
    velocity_deg_s: Annotated[Positive | None, key("a number above 0, in deg/s", "120")] = None
    acceleration_mm_s2: Annotated[Positive | None, key("a number above 0, in mm/s^2", "1500")] = (
        None
    )
    acceleration_deg_s2: Annotated[Positive | None, key("a number above 0, in deg/s^2", "200")] = (
        None
    )
    step_mm: Annotated[Positive | None, key("a number above 0, in mm", "100")] = None
    step_deg: Annotated[Positive | None, key("a number above 0, in deg", "10")] = None
    home_mm: Annotated[Number | None, key("a number, in mm", "0")] = None
    home_deg: Annotated[Number | None, key("a number, in deg", "0")] = None

    @model_validator(mode="after")
    def _whole(self) -> ExternalTable:
        """Require all that is not known of the axis; joints of a description are checked later."""
        if self.joint is None:
            self.resolve()
            return self
        for name in given(self, "model", *WHOLE):
            expected = f"no {name} with joint"
            raise fault(expected, "both", f"remove {name} or joint", (name,))
        return self

    @property
    def called(self) -> str | None:
        """Its name: the given one, or the one in the library or the description."""
        if self.name is None and self.model is not None:
            return external_axes()[self.model].axis.name
        return self.name or self.joint

    @property
    def home(self) -> float | None:
        """Its value when the robot is at home, m or rad; None if it is not given."""
        if self.home_mm is not None:
            return FACTORS["linear"] * self.home_mm
        return None if self.home_deg is None else FACTORS["rotary"] * self.home_deg

    def resolve(self, described: KnownAxis | None = None) -> tuple[ExternalAxis, Travel]:
        """Return the axis and its travel, m and rad; `described` is its joint in the description.

        Raises
        ------
        PydanticCustomError
            At the key: it is missing, does not fit such an axis, or its range is reversed.
        """
        known = described or (self._own() if self.model is None else self._placed())
        kind, free = known.axis.kind, known.endless if self.endless is None else self.endless
        self._require_kind(kind, free)
        factor, (lower, upper, *_) = FACTORS[kind], KEYS[kind]
        limits = (known.lower, known.upper, known.velocity, known.acceleration)
        values: list[float | None] = [getattr(self, name) for name in KEYS[kind][:5]]
        for name, value, there in zip(KEYS[kind], values, limits, strict=False):
            if value is None and there is None and not (free and name in (lower, upper)):
                hint = f"add, for example, {name} = {EXAMPLES[name]}"
                raise fault("every limit of the axis", f"no {name}", hint, (name,))
        low, high, velocity, acceleration, step = (
            None if value is None else factor * value for value in values
        )
        if not re.match(NAME, str(self.called)):
            expected = "a name of letters, digits and _, a letter first, at most 16 characters"
            raise fault(expected, f'"{self.called}"', 'add, for example, name = "rail"', ("joint",))
        try:
            axis, travel = known.completed(
                name=self.name,
                lower=low,
                upper=high,
                velocity=velocity,
                acceleration=acceleration,
                endless=self.endless,
                step=step,
            )
        except InputError as error:
            words = dict(zip(WORDS, KEYS[kind], strict=False))
            said = re.sub(r" \(\S+\)$", "", in_keys(f"{error}", words))  # the unit is in the key
            raise fault_in_words(said, ("joint",)) from None
        ends, home = (travel["lower"], travel["upper"]), self.home
        least, most = (f"{end / factor:g}" for end in ends)
        if not ends[0] <= ends[1]:
            raise fault(
                f"{upper} not below {lower}", f"{most} below {least}", "swap them", (upper,)
            )
        if home is not None and not free and not ends[0] <= home <= ends[1]:
            said = f"a home from {least} to {most}"
            raise fault(said, f"{home / factor:g}", "move it", (KEYS[kind][5],))
        return axis, travel

    def _own(self) -> KnownAxis:
        """Return the axis that the table describes completely, without its limits."""
        for name in ("name", "kind", "carries", "axis"):
            if getattr(self, name) is None:
                field = type(self).model_fields[name]
                example = f"add, for example, {name} = {(field.examples or [''])[0]}"
                raise fault(f"{field.description}", "nothing", example, (name,))
        for name in given(self, "xyz_mm", "rpy_deg"):
            raise fault(f"{name} only with model", "it without model", f"remove {name}", (name,))
        assert self.name is not None
        assert self.kind is not None
        assert self.carries is not None
        axis = ExternalAxis(
            name=self.name,
            kind=self.kind,
            carries=self.carries,
            axis=self._direction(),
            point=self._point(self.kind),
        )
        return KnownAxis(axis=axis, source="the job")

    def _placed(self) -> KnownAxis:
        """Return the axis of the library at the place of its product, or as it was measured."""
        known = external_axes()[self.model or ""]
        kind = known.axis.kind
        for name in given(self, "kind", "carries"):
            raise fault(f"no {name} with model", "both", f"remove {name}", (name,))
        measured, placed = given(self, "axis", "point_mm"), given(self, "xyz_mm", "rpy_deg")
        if kind == "linear" and self.xyz_mm is not None:
            expected, got = "xyz_mm only for a rotary axis", "it for a linear axis"
            raise fault(expected, got, "remove xyz_mm", ("xyz_mm",))
        if measured and placed:
            ways = "axis and point_mm, or xyz_mm and rpy_deg"
            raise fault(ways, "both", "remove one pair", (placed[0],))
        if measured:
            axis = replace(known.axis, axis=self._direction(), point=self._point(kind))
            return replace(known, axis=axis)
        for name, example in (("xyz_mm", "[1600, 0, 0]"), ("rpy_deg", "[0, 0, 90]")):
            if getattr(self, name) is None and not (kind == "linear" and name == "xyz_mm"):
                expected = "the place of the product, or its axis as measured"
                raise fault(expected, "neither", f"add, for example, {name} = {example}", (name,))
        return known.placed(pose(self.xyz_mm or (0, 0, 0), self.rpy_deg or (0, 0, 0)))

    def _direction(self) -> Array:
        if self.axis is None or not any(self.axis):
            got = "none" if self.axis is None else "[0, 0, 0]"
            raise fault(
                "the direction of the axis", got, "add, for example, axis = [0, 1, 0]", ("axis",)
            )
        return np.array(self.axis)

    def _point(self, kind: str) -> Array:
        if kind == "rotary" and self.point_mm is None:
            said = "a point of its axis in the robot base"
            raise fault(said, "none", "add, for example, point_mm = [1200, 0, 500]", ("point_mm",))
        return np.array(self.point_mm or (0, 0, 0)) / 1000

    def _require_kind(self, kind: str, free: bool) -> None:
        """Require no key of the other kind, and no range of an axis that has none."""
        other = "rotary" if kind == "linear" else "linear"
        for name in given(self, *KEYS[other]):
            own = KEYS[kind][KEYS[other].index(name)]
            raise fault(f"{own} for a {kind} axis", name, f"write {own}", (name,))
        if kind == "linear" and self.point_mm is not None:
            expected, got = "point_mm only for a rotary axis", "it for a linear axis"
            raise fault(expected, got, "remove point_mm", ("point_mm",))
        if kind == "linear" and self.endless:
            raise fault("false for a linear axis", "true", "remove endless", ("endless",))
        for name in given(self, *KEYS[kind][:2]) if free else ():
            remedy = f"remove {name} or endless" if self.endless else "write endless = false, too"
            raise fault(f"no {name} for an endless axis", "one", remedy, (name,))


def axes_of(
    tables: Sequence[ExternalTable], described: Sequence[KnownAxis]
) -> list[tuple[ExternalAxis, Travel]]:
    """Return all axes of a job and their travel: those of its description first, in their order.

    Raises
    ------
    PydanticCustomError
        A joint is not in the description or is named twice; or as `ExternalTable.resolve`.
    """
    rows = {table.joint: i for i, table in enumerate(tables) if table.joint is not None}
    joints = [known.axis.name for known in described]
    for i, table in enumerate(tables):
        if table.joint is not None and (table.joint not in joints or rows[table.joint] != i):
            there = f"there are {', '.join(joints)}" if joints else "it has none"
            expected = "a joint of the description that carries robot or part, named once"
            raise fault(expected, f'"{table.joint}"', there, ("external", i, "joint"))
    found = []
    for known in described:
        at = rows.get(known.axis.name)
        table = ExternalTable(joint=known.axis.name) if at is None else tables[at]
        try:
            found.append(table.resolve(known))
        except PydanticCustomError as error:
            raise _inside(error, known.axis.name, at) from None
    return found + [table.resolve() for table in tables if table.joint is None]


def require_in_order(tables: Sequence[ExternalTable]) -> None:
    """Require that the axes of one product are in its order and at one place.

    Raises
    ------
    PydanticCustomError
        At the second of two axes that are not.
    """
    order = list(external_axes())
    for i, table in enumerate(tables):
        for first in tables[:i]:
            if table.model is None or first.model is None:
                continue
            one, two = (each.model.split(".")[0] for each in (first, table) if each.model)
            if one != two or first.model == table.model:  # the same axis again is another product
                continue
            if order.index(first.model) > order.index(table.model):
                expected = f'"{table.model}" before "{first.model}", which it carries'
                got = "the reverse order"
                raise fault(expected, got, "swap the tables", ("external", i, "model"))
            for name in ("xyz_mm", "rpy_deg"):
                there, here = getattr(first, name), getattr(table, name)
                if None not in (there, here) and there != here:
                    expected = f'{list(there)}, as for "{first.model}" of the same product'
                    raise fault(expected, f"{list(here)}", "correct one", ("external", i, name))


def _inside(error: PydanticCustomError, joint: str, i: int | None) -> PydanticCustomError:
    """Return the error with the place of the joint's table, or that the joint needs a table."""
    if i is None:
        said = f'joint "{joint}": {error.message()}, in [[robot.external]] with joint = "{joint}"'
        return fault_in_words(said, ("urdf",))
    context = error.context or {}
    where = ("external", i, *context["where"])
    return PydanticCustomError(FAULT, error.message_template, {**context, "where": where})


External = Annotated[tuple[ExternalTable, ...], Field(strict=False, max_length=3)]
