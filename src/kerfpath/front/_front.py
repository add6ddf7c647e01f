"""The Pareto front, measures of its quality, and its plans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import moocore
import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, floats, freeze, require_one_of
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.front._problem import Criterion
from kerfpath.front._subproblem import Subproblem
from kerfpath.plans import Plan

__all__ = ["Front", "ParetoSet", "hypervolume"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Front:
    """The Pareto front of one contour: the runs whose plans no other plan dominates.

    A plan dominates another if it is as good in all criteria and better in one.

    Parameters
    ----------
    axes : tuple of Criterion
        The criteria; `criteria` are their names.
    numbers : tuple of int
        Number of each run among all that were tried. Rows are sorted by the first criterion, the
        best first.
    runs : tuple of Subproblem
        The run of each plan.
    values : (P, C)
        Criteria of each plan, in their units; each plan has passed its audit.
    beaten : (B, C)
        Criteria of the plans that others dominate.
    on_grid : (G, C)
        Criteria of the plans on the grid of gamma that no other plan on the grid dominates.
    ideal, reference : (C,)
        Best values of the first runs, and a point beyond their worst values; criteria are scaled
        between the two.
    tried : int
        Number of runs.
    feasible : int
        Number of runs that had a plan.
    failures : mapping of str to int
        Number of runs without a plan, for each reason.
    """

    axes: tuple[Criterion, ...]
    numbers: tuple[int, ...]
    runs: tuple[Subproblem, ...]
    values: Array
    beaten: Array
    on_grid: Array
    ideal: Array
    reference: Array
    tried: int
    feasible: int
    failures: Mapping[str, int]

    __repr__ = short_repr

    @property
    def criteria(self) -> tuple[str, ...]:
        """Names of the criteria, as in `pareto`."""
        return tuple(axis.name for axis in self.axes)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the criteria."""
        return tuple(axis.unit for axis in self.axes)

    @property
    def sense(self) -> Array:
        """1 where less is better, -1 where more is, (C,)."""
        return np.array([axis.sense for axis in self.axes])

    @property
    def scaled(self) -> Array:
        """Criteria of each plan (P, C), scaled: 0 at the ideal, 1 at the reference."""
        return freeze((self.values - self.ideal) / (self.reference - self.ideal))

    @property
    def hypervolume(self) -> float:
        """Volume that the front dominates up to the reference, in scaled criteria.

        It never decreases as runs are added. To compare two fronts, use the function `hypervolume`.
        """
        return hypervolume(self.scaled, np.ones(len(self.criteria)))

    @property
    def gap(self) -> float:
        """Largest distance between neighbours in any one scaled criterion."""
        return float(np.diff(np.sort(self.scaled, axis=0), axis=0).max(initial=0.0))

    @property
    def left_behind(self) -> Bools:
        """Whether each plan of `on_grid` is dominated by a plan over continuous gamma, (G,)."""
        here, there = self.values * self.sense, self.on_grid * self.sense
        as_good = (here[:, None] <= there).all(axis=2)
        return np.asarray((as_good & (here[:, None] < there).any(axis=2)).any(axis=0))

    @property
    def beyond_the_grid(self) -> str:
        """How many plans of the grid are dominated off the grid, in words."""
        return (
            f"{int(self.left_behind.sum())} of the {len(self.on_grid)} plans of the front on the "
            "grid of gamma are beaten off the grid"
        )

    def coverage(self, other: Front) -> float:
        """Return the share of another front's plans that some plan here equals or dominates.

        This is the measure C of Zitzler and Thiele (PPSN V, 1998).

        Raises
        ------
        InputError
            The other front has other criteria.
        """
        if other.criteria != self.criteria:
            raise InputError(f"coverage: expected criteria {self.criteria}, got {other.criteria}")
        here, there = self.values * self.sense, other.values * self.sense
        return float((here[:, None] <= there).all(axis=2).any(axis=0).mean())

    def best_at(self, criterion: str) -> int:
        """Return the row of `values` that is best in a criterion.

        Raises
        ------
        InputError
            The name is not one of `criteria`.
        """
        require_one_of(criterion, "best", self.criteria)
        return int(self.scaled[:, self.criteria.index(criterion)].argmin())

    @property
    def balanced_at(self) -> int:
        """The row of `values` whose worst scaled criterion is the least."""
        return int(self.scaled.max(axis=1).argmin())

    def __str__(self) -> str:
        """Return a summary of the runs and criteria in a few lines."""
        lines = [
            f"{len(self.runs)} plans from {self.feasible} feasible runs out of {self.tried}; "
            f"hypervolume {self.hypervolume:.4f}, largest gap {self.gap:.3f}"
        ]
        if len(self.left_behind) and any(run.continuous for run in self.runs):
            lines[0] += f"; {self.beyond_the_grid}"
        for axis, values in zip(self.axes, self.values.T, strict=True):
            lines.append(f"  {axis.name}: {values.min():.4g} to {values.max():.4g} {axis.unit}")
        lines += [f"  no plan in {number} runs: {why}" for why, number in self.failures.items()]
        return "\n".join(lines)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ParetoSet(Front):
    """A Pareto front with its plans.

    Parameters
    ----------
    plans : tuple of Plan
        One for each run.
    """

    plans: tuple[Plan, ...]

    __repr__ = short_repr

    def best(self, criterion: str) -> Plan:
        """Return the plan that is best in a criterion.

        Raises
        ------
        InputError
            The name is not one of `criteria`.
        """
        return self.plans[self.best_at(criterion)]

    @property
    def balanced(self) -> Plan:
        """The plan whose worst scaled criterion is the least."""
        return self.plans[self.balanced_at]


def hypervolume(values: ArrayLike, reference: ArrayLike) -> float:
    """Return the volume that points (P, C) dominate up to a reference (C,), where less is better.

    It is exact, computed by moocore (Guerreiro, Fonseca, Paquete, ACM Comput. Surv. 54(6), 2021).
    Points that are not better than the reference in every coordinate count for nothing.

    Raises
    ------
    InputError
        The shapes do not fit, or a number is not finite.
    """
    reference = floats(reference, "reference", (None,))
    values = floats(values, "values", (None, len(reference)))
    inside = values[(values < reference).all(axis=1)]
    return float(moocore.hypervolume(inside, ref=reference)) if len(inside) else 0.0
