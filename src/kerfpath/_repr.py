"""One line that describes a data object, as a notebook prints it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, is_dataclass
from html import escape
from pathlib import PurePath
from typing import Any

import numpy as np

__all__ = ["counted", "html_table", "in_degrees", "short_repr"]

LONGEST = 240
"""Most characters of a line; fields that do not fit are left out."""
FEW = 6
"""Most numbers of an array, or items of a collection, that are all shown."""
SHORT = 40
"""Most characters of a text, or of a collection whose items are shown."""


def counted(number: int, noun: str) -> str:
    """Return a number with its noun in singular or plural: "1 face", "2 faces"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def short_repr(thing: Any) -> str:
    """Return the class of a dataclass and its fields in short; arrays by their shapes."""
    said, left = [f"{type(thing).__name__}("], LONGEST
    for field in fields(thing):
        value = getattr(thing, field.name)
        if value is None or not field.repr:
            continue
        part = f"{field.name}={_short(value)}"
        left -= len(part) + 2
        if left < 0:
            said.append("..., ")
            break
        said.append(f"{part}, ")
    return "".join(said).removesuffix(", ") + ")"


def html_table(caption: str, heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as HTML, for notebooks: text alone, everything escaped."""
    lines = [("th", heads), *(("td", row) for row in rows)]
    body = "".join(
        f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"
        for tag, cells in lines
    )
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"


def in_degrees(value: float, unit: str) -> str:
    """Return a value in rad or m, or per s or s^2, in deg or mm: "12.50 deg/s", "40.00 mm"."""
    of, slash, per = unit.partition("/")
    factor, word = (180 / np.pi, "deg") if of == "rad" else (1e3, "mm")
    return f"{factor * value:.2f} {word}{slash}{per}"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.ndim == 1 and value.size <= FEW and value.dtype != object:
            return "[" + ", ".join(_short(each) for each in value.tolist()) + "]"
        return f"array {' x '.join(map(str, value.shape))}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value if len(value) <= SHORT else f"{value[:SHORT]}...")
    if isinstance(value, PurePath):
        return repr(value.name)
    if isinstance(value, Mapping):
        return f"{len(value)} keys"
    if isinstance(value, Collection):
        return _several(value)
    if is_dataclass(value):
        name = getattr(value, "name", getattr(value, "id", None))
        return (
            f"{type(value).__name__}({name!r})" if isinstance(name, str) else type(value).__name__
        )
    plain = repr(value)
    return plain if len(plain) <= SHORT else type(value).__name__


def _several(values: Collection[Any]) -> str:
    if len(values) <= FEW:
        all_of_them = ", ".join(_short(value) for value in values)
        if len(all_of_them) <= SHORT:
            return f"({all_of_them})"
    return f"{len(values)} x {type(next(iter(values))).__name__}"
