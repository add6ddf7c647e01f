"""Read RAPID aggregates: values in brackets."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath.post._line_reader import LineReader
from kerfpath.post._orientations import pose_of

__all__ = ["Aggregates"]


class Aggregates(LineReader):
    """Reader of aggregates on the lines of a file."""

    def values(self, text: str, count: int) -> list[Any]:
        """Return the `count` parts of an aggregate; RAPID writes it almost as JSON does."""
        try:
            values = json.loads(text.replace("TRUE", "true").replace("FALSE", "false"))
        except json.JSONDecodeError as error:
            raise self.fault(f"not an aggregate: {error}") from None
        if not isinstance(values, list) or len(values) != count:
            raise self.fault(f"expected {count} values, got {text[:60]!r}")
        return values

    def numbers(self, values: Any, count: int) -> Array:
        """Return a list of `count` numbers as an array."""
        is_list = isinstance(values, list) and len(values) == count
        if not is_list or any(type(value) not in (int, float) for value in values):
            raise self.fault(f"expected {count} numbers, got {values!r}")
        return np.array(values, dtype=np.float64)

    def pose(self, value: Any) -> Array:
        """Return a pose (4, 4) m, written as a position and a quaternion."""
        if not isinstance(value, list) or len(value) != 2:
            raise self.fault(f"expected a position and a quaternion, got {value!r}")
        point_mm, wxyz = self.numbers(value[0], 3), self.numbers(value[1], 4)
        T = pose_of(point_mm * 1e-3, wxyz)
        if T is None:
            raise self.fault(f"the quaternion {value[1]} must have length 1")
        return T
