"""Entities of a drawing that are in no loop."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["LeftOut"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Entities of a drawing that are in no loop.

    Parameters
    ----------
    kind : str
        As the format calls it: SPLINE, TEXT, INSERT (a block), ...
    reason : str
    count : int
    may_cut : bool
        Whether it may have been a line to cut; texts, dimensions and the like are none.
    """

    kind: str
    reason: str
    count: int
    may_cut: bool

    def __str__(self) -> str:
        doubt = "; this may have been to cut" if self.may_cut else ""
        return f"left out: {self.count} {self.kind} ({self.reason}){doubt}"
