"""The multi-objective problem: a contour on its graph, the criteria, and how runs are solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, freeze
from kerfpath._repr import short_repr
from kerfpath.auditor import audit as full_audit
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front._planned import follows_courses, plan_run
from kerfpath.front._subproblem import Subproblem
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.planner import node_interval, relaxations, require_rates_alone
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Relaxations

__all__ = ["Criterion", "Evaluation", "Gap", "ParetoProblem", "Solution"]

DIGITS = 12
"""Significant digits of a criterion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """A criterion for comparing plans; the subclasses are in `kerfpath.front._criteria`.

    Parameters
    ----------
    name : str
        Name in `pareto`.
    words : str
        Name in pages and tables.
    unit : str
    joint : int, optional
        The joint that it measures, from 0; None: all joints together.
    """

    name: str
    words: str
    unit: str
    joint: int | None = None

    more_is_better: ClassVar[bool] = False
    exact_anchor: ClassVar[bool] = False
    """Whether the best of the first runs in this criterion is the best on the graph."""
    bounded: ClassVar[bool] = False
    """Whether `bound` and `hold` can bound a run to a value of this criterion."""
    aimed: ClassVar[bool] = False
    """Whether its anchor minimises exactly this criterion; other terms only break ties."""

    __repr__ = short_repr

    @property
    def sense(self) -> float:
        """1 where less is better, -1 where more is."""
        return -1.0 if self.more_is_better else 1.0

    def require(self, options: PlanOptions, cell: Cell | None, home: ArrayLike | None) -> None:
        """Raise InputError where something that the criterion needs is missing."""

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        """Return the value of the criterion for a plan, in its unit."""
        raise NotImplementedError  # every quantity has its own

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        """Return the subproblem that should find its best value or come near it, or None."""
        return None

    def bound(
        self, run: Subproblem, value: float, gap: Gap, problem: ParetoProblem,
        rng: np.random.Generator,
    ) -> Subproblem:  # fmt: skip
        """Return a subproblem with the epsilon constraint that bounds the criterion to a value."""
        raise NotImplementedError  # asked of none that is not `bounded`

    def hold(
        self, run: Subproblem, value: float, spans: Array, problem: ParetoProblem
    ) -> Subproblem:
        """Return a subproblem bounded to be as good in this criterion as a plan.

        The plan has this value and joint spans (n, 2) rad, and keeps the bound itself. The
        subproblem is unchanged where the criterion cannot be bounded.
        """
        return run


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """The data of a plan that the search uses: losses (C,) and joint spans (n, 2).

    Losses are the criteria with signs such that less is better. Spans are the lowest and highest
    joint values in rad; endless joints are not wrapped.
    """

    losses: Array
    spans: Array

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(Evaluation):
    """The evaluation of a run that has a plan, its number among all runs and its subproblem."""

    number: int
    run: Subproblem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gap:
    """Two neighbours on the front in a criterion; `better` is None beyond the best solution."""

    criterion: int
    better: Solution | None
    worse: Solution

    __repr__ = short_repr

    @property
    def key(self) -> tuple[int, int, int]:
        """Key of the gap, which does not depend on the rest of the front."""
        better, worse = self.better, self.worse
        return (self.criterion, *((-1, -1) if better is None else (better.number, worse.number)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoProblem:
    """A contour to plan on one layered graph, and the criteria that compare its plans.

    Parameters
    ----------
    contour, robot, tool, placement, speed, options, graph, cell
        As in `kerfpath.plan`; the runs change some of the options.
    criteria : tuple of Criterion
    home : (n,) rad, optional
        Where the arm comes from and goes back to.
    audit : callable, optional
        Returns the faults of a plan; default: `kerfpath.audit`, with the cell.
    """

    contour: Contour
    robot: Robot
    tool: Array
    placement: Array
    speed: float | None
    options: PlanOptions
    graph: LayeredGraph
    criteria: tuple[Criterion, ...]
    cell: Cell | None = None
    home: Array | None = None
    audit: Callable[[Plan], Sequence[object]] | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_rates_alone(self.robot, "the Pareto set")

    @cached_property
    def dt(self) -> float:
        """Time from node to node (s)."""
        return node_interval(self.contour, self.speed)

    @cached_property
    def unbounded(self) -> Subproblem:
        """The first run: the full limits and no window."""
        velocity, _ = self.robot.speed_limits()
        weights = freeze(1 / (velocity * self.dt))
        return Subproblem.unbounded(weights, self.options.eta_v, self.options.eta_a)

    @cached_property
    def least(self) -> Relaxations:
        """The least shares of the limits and the least node interval for which there is a path."""
        eta_v, eta_a = self.options.eta_v, self.options.eta_a
        return relaxations(
            self.contour, self.robot, self.graph, self.speed, eta_v=eta_v, eta_a=eta_a
        )

    def first_runs(self) -> list[Subproblem]:
        """Return the unbounded run, and one for the best of each criterion that has an anchor."""
        anchors = [criterion.anchor(self) for criterion in self.criteria]
        return [self.unbounded, *(run for run in anchors if run is not None)]

    @property
    def continuous(self) -> bool:
        """Whether there are also runs over continuous gamma."""
        return self.options.method == "continuous" and self.robot.family.free_rotation

    @property
    def free_joints(self) -> int:
        """Number of leading joints that windows may narrow: those that follow no given course."""
        along = follows_courses(self.robot, self.options)
        return self.robot.family.joints if along else self.robot.joints

    def as_good(self, solution: Solution) -> Subproblem:
        """Return a run bounded to be as good as a plan in all criteria that can be bounded."""
        aim = self._aim or solution.run
        run = replace(
            self.unbounded, objective=aim.objective, metric=aim.metric, weights=aim.weights
        )
        for criterion, loss in zip(self.criteria, solution.losses, strict=True):
            run = criterion.hold(run, float(loss) * criterion.sense, solution.spans, self)
        return run

    @cached_property
    def _aim(self) -> Subproblem | None:
        """The run that minimises the only criterion that cannot be bounded, if there is just one.

        If there is none, the run for the first criterion that a run can minimise. None means that
        each solution keeps the objective of its own run.
        """
        free = [criterion for criterion in self.criteria if not criterion.bounded]
        if len(free) > 1:
            return None
        aimed = [each for each in free or self.criteria if each.aimed]
        return (aimed[0].anchor(self) or self.unbounded) if aimed else None

    def solve(self, run: Subproblem, *, first: bool = False) -> Plan | str:
        """Return the plan of a run, if it passes its audit; otherwise the reason in a few words.

        Raises
        ------
        NoFeasiblePath
            The `first` run, which has the full limits, has no path, so no other run can have one.
        """
        try:
            made = plan_run(
                run,
                self.contour,
                self.robot,
                tool=self.tool,
                placement=self.placement,
                speed=self.speed,
                options=self.options,
                graph=self.graph,
                cell=self.cell,
            )
        except NoFeasiblePath as broken:
            if first:
                said = (
                    f"{broken}; this run had the full limits, so no run can have a plan. Runs use "
                    "the grid of the rotation: if kerfpath plan finds a motion by refinement, "
                    "choose a finer gamma_step_deg or a lower speed here"
                )
                raise broken.with_message(said) from None
            counts = broken.counts
            if run.continuous and not counts:
                return "no motion found off the grid"
            if windows := broken.lost_by(Loss.WINDOW):
                return f"no pose in the {windows[0]}"
            return f"no edge within {max(counts, key=counts.__getitem__, default='the seam')}"
        wrong = full_audit(made, cell=self.cell) if self.audit is None else self.audit(made)
        return f"audit: {getattr(wrong[0], 'code', wrong[0])}" if wrong else made

    def evaluate(self, made: Plan) -> Evaluation:
        """Return the losses and joint spans of a plan.

        Criteria are rounded to `DIGITS` digits, so that a motion found twice with different
        rounding errors counts once.
        """
        values = [each.sense * each.value(made, self) for each in self.criteria]
        q = made.q[0] + np.vstack([np.zeros(made.q.shape[1]), np.cumsum(made.increments, axis=0)])
        return Evaluation(
            losses=freeze(np.array([float(f"{value:.{DIGITS}g}") for value in values])),
            spans=freeze(np.stack([q.min(axis=0), q.max(axis=0)], axis=1)),
        )
