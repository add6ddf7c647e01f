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
        Name of the criterion in the job.
    words : str
        Name of the criterion on the page.
    unit : str
        Unit of the values. Values in m, rad, m/s and share are shown in mm, deg, m/min and %, all
        others unchanged.
    sense : float
        1 if less is better, -1 if more is better.

    Raises
    ------
    InputError
        The sense is neither 1 nor -1.
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
                f"axis {self.name}: expected sense 1 (less is better) or -1 (more is better), "
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
        """The shown unit with an arrow in the better direction."""
        return f"{self.shown[1]} {'↓' if self.sense > 0 else '↑'}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPlan:
    """One plan of the set.

    Parameters
    ----------
    number : int
        Number by which it is picked.
    values : (C,) tuple of float
        Criteria of the plan, in the units of the axes.
    asked : tuple of (what, value)
        Settings of its run, in words.
    """

    number: int
    values: tuple[float, ...]
    asked: tuple[tuple[str, str], ...]

    __repr__ = short_repr
