"""A grammar of edits of plan.json: every value can be edited by every rule that fits it."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks._document import written
from benchmarks._motion_edits import (
    column_edit,
    contour_edit,
    faster_edit,
    job_copy_edit,
    kind_edit,
    limit_edit,
    move_edit,
    time_edit,
)
from benchmarks._plan_oracle import is_harmless
from benchmarks._value_edits import array_edit, key_edit, leaf_edit

__all__ = ["GROUPS", "Edit", "edits"]


@dataclass(frozen=True)
class Edit:
    """One edited plan.json: kind and place of the edit, the text, and whether it is harmless."""

    kind: str
    where: str
    text: str
    harmless: bool


GROUPS: dict[str, Callable[[Any, random.Random], tuple[str, str, Any] | None]] = {
    "value": leaf_edit,
    "array": array_edit,
    "key": key_edit,
    "contours": contour_edit,
    "times": time_edit,
    "kinds": kind_edit,
    "columns": column_edit,
    "limits": limit_edit,
    "faster": faster_edit,
    "job's copy": job_copy_edit,
    "moves": move_edit,
    "text": lambda data, rng: ("key twice", "", data),
}
"""The rules of the grammar by name."""
SHARE = {"value": 8, "array": 3, "key": 2}
"""Relative frequency of each rule."""


def edits(text: str, count: int, seed: int) -> Iterator[Edit]:
    """Yield `count` edits of the text of a plan.json; the same seed gives the same ones."""
    data, rng = json.loads(text), random.Random(seed)
    names = [name for name in GROUPS for _ in range(SHARE.get(name, 1))]
    while count:
        found = GROUPS[rng.choice(names)](data, rng)
        if found is None:
            continue
        kind, where, after = found
        harmless = is_harmless(data, after)
        text_after = written(after)
        if kind == "key twice":
            keys = list(re.finditer(r'\n *"(\w+)":', text))
            at = rng.choice(keys)
            where, harmless = at[1], False
            text_after = f'{text[: at.start()]}\n "{at[1]}": 0.5,{text[at.start() :]}'
        elif after == data and not kind.startswith("typed"):
            continue
        count -= 1
        yield Edit(kind, where, text_after, harmless)
