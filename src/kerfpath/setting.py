"""A setting is declared once, where it is a field of a dataclass; whatever else knows it asks here.

The declaration has what people read and write: unit, bounds, an example and the meaning, with
numbers in that unit. The object itself holds SI. From the declaration follow the key in a job and
in plan.json, the checks of both and of the object, the words of messages, and the documentation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cache
from inspect import cleandoc
from textwrap import wrap
from types import NoneType
from typing import (
    Any,
    Literal,
    Self,
    TypedDict,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from kerfpath.arrays import Array, not_negative, require_one_of, scalar, short_repr
from kerfpath.errors import InputError

__all__ = ["Setting", "Settings", "check", "documented", "keys", "setting", "settings"]

T = TypeVar("T")
UNITS: Mapping[str, tuple[str, Callable[[Any], Any]]] = {
    "deg": ("rad", np.radians),
    "mm": ("m", lambda value: value / 1000),
    "mm/s": ("m/s", lambda value: value / 1000),
    "%": ("", lambda value: value / 100),
    "1/deg": ("1/rad", np.degrees),
    "urad": ("rad", lambda value: value / 1e6),
    "ms": ("s", lambda value: value / 1e3),
    "ms^2": ("s^2", lambda value: value / 1e6),
    "ms^2/m^2": ("s^2/m^2", lambda value: value / 1e6),
}
"""The SI unit of each unit that differs from it, and the conversion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The declaration of a setting; `settings` adds what its field says.

    Parameters
    ----------
    help : str
        Its meaning.
    default : object
        In `unit`; or a function that makes it.
    unit : str
        Unit of the numbers in a job, and of those below.
    above, least, below, most : float, optional
        Bounds. Objects keep only the lower ones: a job is written by hand, and beyond the upper
        ones is more likely a typing error.
    example : str
        A value as a job has it.
    takes : type
        What a job gives, where that is not the type of the field; None: no job has a key for it.
    what : str
        What is expected, where neither the type nor the bounds say so.
    key, data : str
        Key in a job and in plan.json, where it is not the name with the unit.
    in_jobs : object
        The default in a job, where it is another one.
    group, label : str
        Title of its group in the studio, and its words there; without them it has no control.
    concerns : {"graph", "search", "proof", "all"}
        What a change affects: the layered graph, only the search in it, only the proof, or more.
    name, kind, optional
        Of the field: its name, its type without None, and whether it may be None.
    """

    help: str
    default: Any
    unit: str = ""
    above: float | None = None
    least: float | None = None
    below: float | None = None
    most: float | None = None
    example: str = ""
    takes: Any = ...
    what: str = ""
    key: str = ""
    data: str = ""
    in_jobs: Any = ...
    group: str = ""
    label: str = ""
    concerns: Literal["graph", "search", "proof", "all"] = "all"
    name: str = ""
    kind: Any = None
    optional: bool = False

    __repr__ = short_repr

    @property
    def si_unit(self) -> str:
        """The unit in the object."""
        return UNITS.get(self.unit, (self.unit,))[0]

    def si(self, value: Any) -> Any:
        """Return a value of a job in SI."""
        if self.unit not in UNITS or not isinstance(value, int | float):
            return value
        return float(UNITS[self.unit][1](value))

    @property
    def keys(self) -> dict[str, Setting]:
        """What a job gives for it, by key: itself, and the settings inside its value."""
        return ({} if self.takes is None else {self.key: self}) | keys(self.kind)

    @property
    def json(self) -> Any:
        """The type of the value as JSON data."""
        return _json_type(self.kind) | None if self.optional else _json_type(self.kind)

    def expected(self) -> str:
        """Return what a job may give, in words."""
        if self.takes is bool:
            return "true or false"
        if self.takes is int:
            return f"a whole number from {self.least} to {self.most}"
        bounds = {"above": self.above, "not below": self.least}
        bounds |= {"at most": self.most, "below": self.below}
        found = [f"{word} {bound}" for word, bound in bounds.items() if bound is not None]
        every = " for every joint" if get_origin(self.takes) is tuple else ""
        said = self.what or f"a number {', '.join(found)}{every}"
        return f"{said}, in {self.unit.replace('%', 'per cent')}" if self.unit else said

    def checked(self, value: Any) -> Any:
        """Return a value of the field, numbers as floats.

        Raises
        ------
        InputError
            A number below the bounds, an unknown word, or another object than the field's.
        """
        kind = self.kind
        if value is None and self.optional:
            return None
        if get_origin(kind) is Literal:
            require_one_of(value, self.name, get_args(kind))
        elif kind is float:
            if self.least == 0:
                return not_negative(value, self.name, unit=self.si_unit)
            above = None if self.above is None else self.si(self.above)
            return scalar(value, self.name, unit=self.si_unit, above=above)
        elif kind is str and not isinstance(value, str):
            raise InputError(f"{self.name}: expected {self.what or 'text'}, got {value!r}")
        elif kind is int and not (isinstance(value, int) and value >= (self.least or 0)):
            raise InputError(f"{self.name}: expected a whole number >= {self.least}, got {value!r}")
        elif isinstance(kind, type) and is_dataclass(kind) and not isinstance(value, kind):
            expected = f"kerfpath.{kind.__name__}{' or None' if self.optional else ''}"
            raise InputError(f"{self.name}: expected {expected}, got {value!r}")
        return value


def setting(default: Any, help: str, **about: Any) -> Any:
    """Return a dataclass field that is a setting: its default in its unit, its meaning and more."""
    said = Setting(help=help, default=default, **about)
    if callable(default):
        return field(default_factory=default, metadata={"setting": said})
    return field(default=said.si(default), metadata={"setting": said})


def settings(kind: Any) -> dict[str, Setting]:
    """Return the settings of a dataclass by their names; none of any other type."""
    return _settings(kind)


@cache
def _settings(kind: Any) -> dict[str, Setting]:
    if not is_dataclass(kind):
        return {}
    hints, found = get_type_hints(kind), {}
    for each in fields(kind):
        if (said := each.metadata.get("setting")) is None:
            continue
        hint = hints[each.name]
        optional = NoneType in get_args(hint)
        own = next(part for part in get_args(hint) if part is not NoneType) if optional else hint
        found[each.name] = replace(
            said,
            name=each.name,
            kind=own,
            optional=optional,
            takes=own if said.takes is ... else said.takes,
            in_jobs=said.default if said.in_jobs is ... else said.in_jobs,
            key=said.key or each.name + _suffix(said.unit),
            data=said.data or each.name + _suffix(said.si_unit),
        )
    return found


@cache
def keys(kind: Any) -> dict[str, Setting]:
    """Return what a job gives for the settings of a dataclass, by key."""
    return {key: one for each in settings(kind).values() for key, one in each.keys.items()}


def check(made: Any) -> None:
    """Check the settings of an object being made, and keep its numbers as floats.

    Raises
    ------
    InputError
        As `Setting.checked`.
    """
    for name, each in settings(type(made)).items():
        object.__setattr__(made, name, each.checked(getattr(made, name)))


def _suffix(unit: str) -> str:
    said = unit.replace("1/", "per_").replace("/", "_").replace("%", "percent")
    return f"_{said}" if unit else ""


def documented(kind: type[T]) -> type[T]:
    """Add the settings of a class to its docstring, as parameters."""
    lines = ["Parameters", "----------"]
    for name, each in settings(kind).items():
        what = " ".join([_type_in_words(each.kind), each.si_unit]).strip()
        what += ", optional" * each.optional
        lines += [
            f"{name} : {what}",
            *wrap(each.help, 92, initial_indent="    ", subsequent_indent="    "),
        ]
    head, mark, tail = cleandoc(kind.__doc__ or "").partition("\nRaises\n")
    kind.__doc__ = "\n".join([head.rstrip(), "", *lines, "", mark.strip(), tail]).strip()
    return kind


def _type_in_words(kind: Any) -> str:
    if get_origin(kind) is Literal:
        return "{" + ", ".join(map(repr, get_args(kind))) + "}"
    if get_origin(kind) is Union:
        return " or ".join(map(_type_in_words, get_args(kind)))
    return getattr(kind, "__name__", "")


# -----------------------------------------------------------------------------
# Settings as JSON data: SI units, null for infinity.


class Settings:
    """The base of dataclasses of settings, which can be kept as JSON data."""

    __slots__ = ()

    def to_data(self) -> dict[str, Any]:
        """Return the settings as JSON data, which `from_data` reads."""
        known = settings(type(self)).items()
        return {each.data: _to_json(getattr(self, name)) for name, each in known}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Return the settings that `to_data` wrote; other keys of `data` are ignored.

        Raises
        ------
        InputError
            As the class.
        KeyError
            A key is missing.
        """
        known = settings(cls).items()
        return cls(**{name: _from_json(data[each.data], each.kind) for name, each in known})


def _json_type(kind: Any) -> Any:
    if declared := settings(kind):
        return TypedDict(kind.__name__, {each.data: each.json for each in declared.values()})  # type: ignore[operator]
    if hasattr(kind, "to_data"):
        return get_type_hints(kind.to_data)["return"]
    if kind == Array:
        return list[float | None]
    return list[_json_type(get_args(kind)[0])] if get_origin(kind) is tuple else kind  # type: ignore[misc]  # made here


def _to_json(value: Any) -> Any:
    if hasattr(value, "to_data"):
        return value.to_data()
    if isinstance(value, np.ndarray):
        return [number if np.isfinite(number) else None for number in value.tolist()]
    return [_to_json(each) for each in value] if isinstance(value, tuple) else value


def _from_json(data: Any, kind: Any) -> Any:
    if data is None:
        return None
    if hasattr(kind, "from_data"):
        return kind.from_data(data)
    if kind == Array:
        return [np.inf if number is None else number for number in data]
    if get_origin(kind) is tuple:
        return tuple(_from_json(each, get_args(kind)[0]) for each in data)
    return data
