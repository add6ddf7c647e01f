"""Entities of a drawing that are in no loop."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from kerfpath.cad.units import GIVE_AXIS
from kerfpath.errors import InputError

LOST = "no face could be made from it"
"""Reason for a face of a file that OCCT cannot convert."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Entities of a drawing that are in no loop.

    Parameters
    ----------
    kind : str
        Name of the kind in the format: SPLINE, TEXT, INSERT (a block), ...
    reason : str
        Why they are left out.
    count : int
        Number of them.
    may_cut : bool
        Whether they may have been lines to cut, unlike texts, dimensions and the like.
    """

    kind: str
    reason: str
    count: int
    may_cut: bool

    def __str__(self) -> str:
        doubt = "; this may have been a line to cut" if self.may_cut else ""
        return f"left out: {self.count} {self.kind} ({self.reason}){doubt}"


def counted(found: Counter[tuple[str, str, bool]]) -> list[LeftOut]:
    """Return what is left out, from the counts by kind, reason and `may_cut`."""
    return [
        LeftOut(kind=kind, reason=reason, count=count, may_cut=may_cut)
        for (kind, reason, may_cut), count in found.items()
    ]


def kind_of(entity: object) -> str:
    """Return OCCT's name for the kind of an entity, without its package."""
    return type(entity).__name__.partition("_")[2]


def nothing_drawn(left_out: Sequence[LeftOut]) -> InputError:
    """Return the error for a file without faces, with what was left out of it."""
    why = f" ({'; '.join(map(str, left_out[:2]))})" if left_out else ""
    return InputError(
        f"the file holds no face{why}; export the part as a solid or a "
        f"surface, or, if it is drawn with lines, {GIVE_AXIS}"
    )
