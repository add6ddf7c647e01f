"""A JSON document: its values and their places, copies with one value changed, and its text."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Iterator
from typing import Any

__all__ = [
    "Path",
    "Raw",
    "containers",
    "drop",
    "is_number",
    "leaves",
    "put",
    "said",
    "value_at",
    "written",
]


class Raw(str):
    """A text written as it is, because JSON has no value for it: too large a number, NaN."""


Path = tuple[str | int, ...]


def leaves(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield every value of a document that is neither an object nor an array, and its place."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from leaves(value, (*path, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from leaves(value, (*path, i))
    else:
        yield path, data


def containers(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Yield every object and array of a document, and its place."""
    if isinstance(data, dict | list):
        yield path, data
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from containers(value, (*path, key))


def said(path: Path) -> str:
    """Return a place as one word."""
    return "/".join(str(step) for step in path)


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def put(data: Any, path: Path, value: Any) -> Any:
    """Return a copy of a document with another value at a place."""
    data = copy.deepcopy(data)
    holder = data
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    return data


def drop(data: Any, path: Path) -> Any:
    data = copy.deepcopy(data)
    holder = data
    for step in path[:-1]:
        holder = holder[step]
    del holder[path[-1]]
    return data


def value_at(data: Any, path: Path) -> Any:
    for step in path:
        data = data[step]
    return data


def written(data: Any) -> str:
    """Return a document as text, each `Raw` as it is."""
    raws: list[str] = []

    def known(value: Any) -> Any:
        if isinstance(value, Raw):
            raws.append(str(value))
            return f"@raw{len(raws) - 1}@"
        if isinstance(value, dict):
            return {key: known(each) for key, each in value.items()}
        return [known(each) for each in value] if isinstance(value, list) else value

    text = json.dumps(known(data), indent=1)
    return re.sub(r'"@raw(\d+)@"', lambda found: raws[int(found[1])], text)
