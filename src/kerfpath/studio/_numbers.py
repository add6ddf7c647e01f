"""What all messages of the server share, and the numbers in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

__all__ = ["Message", "Numbers", "flat"]

Numbers = list[float | None]
"""Numbers in a message; null for infinity."""


def flat(values: ArrayLike, digits: int = 9) -> Numbers:
    """Return numbers in one row, row-major; None for what is not finite.

    They are rounded to `digits` places, a nanometre or less, so that they are short.
    """
    row = np.round(np.asarray(values, dtype=np.float64).ravel(), digits)
    if np.isfinite(row).all():
        kept: Numbers = row.tolist()
        return kept
    return [value if np.isfinite(value) else None for value in row.tolist()]


class Message(BaseModel):
    """What the server says, one line of JSON each; README.md has what the keys mean."""

    model_config = ConfigDict(extra="forbid", frozen=True)
