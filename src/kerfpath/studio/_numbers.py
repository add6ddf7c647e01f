"""The base class of all messages of the server, and the numbers in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

__all__ = ["Message", "Numbers", "flat"]

Numbers = list[float | None]
"""Numbers in a message; None (null in JSON) means infinity."""


def flat(values: ArrayLike, digits: int = 9) -> Numbers:
    """Return values as a flat row-major list; None replaces values that are not finite.

    Values are rounded to `digits` decimal places (a nanometre or finer) to keep messages short.
    """
    row = np.round(np.asarray(values, dtype=np.float64).ravel(), digits)
    if np.isfinite(row).all():
        kept: Numbers = row.tolist()
        return kept
    return [value if np.isfinite(value) else None for value in row.tolist()]


class Message(BaseModel):
    """A message of the server, one line of JSON; README.md defines its keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)
