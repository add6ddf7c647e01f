"""Aggregates of RAPID, [1,[2,3]], as Python's lists and numbers."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.post._orientations import pose_of

__all__ = ["numbers", "parts_of", "pose"]


def parts_of(text: str, count: int, place: str) -> list[Any]:
    """Return the `count` parts of an aggregate; RAPID writes it almost as JSON does."""
    try:
        values = json.loads(text.replace("TRUE", "true").replace("FALSE", "false"))
    except json.JSONDecodeError as error:
        raise InputError(f"{place}: not an aggregate: {error}") from None
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{place}: expected {count} values, got {text[:60]!r}")
    return values


def numbers(values: Any, count: int, place: str) -> Array:
    """Return a list of `count` numbers."""
    is_list = isinstance(values, list) and len(values) == count
    if not is_list or any(type(value) not in (int, float) for value in values):
        raise InputError(f"{place}: expected {count} numbers, got {values!r}")
    return np.array(values, dtype=np.float64)


def pose(value: Any, place: str) -> Array:
    """Return a position in mm and a quaternion as a pose (4, 4), m."""
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{place}: expected a position and a quaternion, got {value!r}")
    T = pose_of(numbers(value[0], 3, place) * 1e-3, numbers(value[1], 4, place))
    if T is None:
        raise InputError(f"{place}: the quaternion {value[1]} must have length 1")
    return T
