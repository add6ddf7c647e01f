"""The data on the page of a Pareto set: its criteria and its plans."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.report._tables import shown_unit

__all__ = ["FrontAxis", "FrontPlan"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontAxis:
    """One criterion of the set.

    Parameters
    ----------
    name : str
        As the job calls it.
    words : str
        As a reader does.
    unit : str
        Of the values. Those in m, rad, m/s and share are shown in mm, deg, m/min and %, others as
        they are.
    sense : float
        1 where less is better, -1 where more is.

    Raises
    ------
    InputError
        Another sense.
    """

    name: str
    words: str
    unit: str
    sense: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Require a known sense."""
        if self.sense not in (1.0, -1.0):
            raise InputError(
                f"axis {self.name}: expected sense 1 (less is better) or -1 (more is), "
                f"got {self.sense!r}"
            )

    @property
    def shown(self) -> tuple[float, str]:
        """The factor from the criterion's unit to the one that is shown, and that unit."""
        factor, unit = shown_unit(self.unit)
        return factor, unit.strip()

    @property
    def title(self) -> str:
        """The words and the unit of the criterion, as HTML."""
        unit = self.shown[1]
        return escape(f"{self.words} ({unit})" if unit else self.words)

    @property
    def unit_and_arrow(self) -> str:
        """The unit, and an arrow to the better end."""
        return f"{self.shown[1]} {'↓' if self.sense > 0 else '↑'}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPlan:
    """One plan of the set.

    Parameters
    ----------
    number : int
        What it is picked by.
    values : (C,) tuple of float
        Its criteria, in the units of the axes.
    asked : tuple of (what, value)
        What its run was asked for, in words.
    """

    number: int
    values: tuple[float, ...]
    asked: tuple[tuple[str, str], ...]

    __repr__ = short_repr
