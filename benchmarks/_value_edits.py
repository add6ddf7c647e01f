"""Edits of any JSON document: of one value, of an array, of the keys of a table."""

from __future__ import annotations

import copy
import random
from typing import Any

from benchmarks._document import Path, Raw, containers, drop, is_number, put, said, value_at

__all__ = ["array_edit", "key_edit", "leaf_edit"]


def number(value: Any, rng: random.Random) -> tuple[str, Any]:
    """Return a number scaled, shifted, with its sign changed, or replaced by an odd one."""
    way = rng.choice(["scaled", "scaled", "shifted", "shifted", "sign", "zero", "nudged"])
    if way == "scaled":
        return "number scaled", value * rng.choice([0.1, 0.5, 0.99, 1.001, 1.01, 1.1, 2, 10, 100])
    if way == "shifted":
        return "number shifted", value + rng.choice([-1, 1]) * rng.choice([1e-4, 1e-3, 0.1, 1, 5])
    if way == "sign":
        return "number's sign", -value
    if way == "zero":
        return "number zero", type(value)(0)
    return "number nudged", value * (1 + 1e-5) + 1e-5


ODD: list[Any] = [
    True, False, None, "1.0", "nan", [], {}, [1.0], Raw("NaN"), Raw("Infinity"), Raw("-Infinity"),
    Raw("1e400"), Raw("1e300"), Raw("-1e18"), Raw("1" + "0" * 400), Raw("1" + "0" * 5000),
]  # fmt: skip


def typed(value: Any, rng: random.Random) -> tuple[str, Any]:
    """Return a value of another type."""
    if is_number(value) and rng.random() < 0.3:
        return "typed otherwise", rng.choice([str(value), bool(value), [value]])
    return "typed otherwise", rng.choice(ODD)


def word(value: str, rng: random.Random) -> tuple[str, Any]:
    """Return another text."""
    return "text", rng.choice(
        [value + "x", "", value[1:], "cut", "micro joint", "lead-out", "exact"]
    )


def leaf_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Edit one value anywhere; all places of a kind are equally likely."""
    path, value = _anywhere(data, rng)
    if not path:
        return None
    if rng.random() < 0.12:
        holder = value_at(data, path[:-1])
        if isinstance(holder, list) and rng.random() < 0.5:
            return "element removed", said(path), drop(data, path)
        if isinstance(holder, dict):
            return "key removed", said(path), drop(data, path)
    if rng.random() < 0.15:
        kind, new = typed(value, rng)
    elif isinstance(value, bool):
        kind, new = "flag", not value
    elif is_number(value):
        kind, new = number(value, rng)
    elif isinstance(value, str):
        kind, new = word(value, rng)
    else:
        kind, new = "null filled", rng.choice([0.5, 1, "x", [0.1, 0.2], {"a": 1}])
    return kind, said(path), put(data, path, new)


def _anywhere(data: Any, rng: random.Random) -> tuple[Path, Any]:
    """Return a random place: go down from the top, all branches equally likely."""
    path: Path = ()
    while isinstance(data, dict | list) and data:
        step = rng.choice(list(data) if isinstance(data, dict) else range(len(data)))
        path, data = (*path, step), data[step]
    return path, data


def array_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Shorten, reverse, rotate or empty an array, or double or swap its elements."""
    arrays = [(path, array) for path, array in containers(data) if isinstance(array, list)]
    columns = [
        (path, array) for path, array in arrays
        if (len(path) < 6 and (not array or not isinstance(array[0], float)))
        or "nodes" in path or "moves" in path
    ]  # fmt: skip
    path, array = rng.choice(rng.choice([arrays, columns]))
    if len(array) < 2:
        return None
    array = copy.deepcopy(array)
    way = rng.randrange(6)
    i, j = rng.sample(range(len(array)), 2)
    if way == 0:
        kind, array = "array shortened", array[:-1] if rng.random() < 0.5 else array[1:]
    elif way == 1:
        kind, array = "array rotated", array[1:] + array[:1]
    elif way == 2:
        kind, array = "array reversed", array[::-1]
    elif way == 3:
        kind = "element doubled"
        array.insert(i, copy.deepcopy(array[i]))
    elif way == 4:
        kind = "elements swapped"
        array[i], array[j] = array[j], array[i]
    else:
        kind, array = "array emptied", []
    return kind, said(path), put(data, path, array)


def key_edit(data: Any, rng: random.Random) -> tuple[str, str, Any] | None:
    """Add an unknown key, remove one with everything below it, or exchange two values."""
    path, table = rng.choice([(p, c) for p, c in containers(data) if isinstance(c, dict) and c])
    way = rng.randrange(3)
    if way == 0:
        return "key unknown", said(path), put(data, (*path, "extra"), 1)
    key = rng.choice(list(table))
    if way == 1:
        return "key removed", said((*path, key)), drop(data, (*path, key))
    other = rng.choice(list(table))
    if table[key] == table[other]:
        return None
    data = put(data, (*path, key), table[other])
    return "values swapped", said((*path, key)), put(data, (*path, other), table[key])
