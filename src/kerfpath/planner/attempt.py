"""An attempt to plan a task: strategies are tried one after the other until one has a plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from kerfpath.arrays import short_repr
from kerfpath.errors import NoFeasiblePath
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.starts import Starts
from kerfpath.planner.task import Task
from kerfpath.plans import Plan


def unheard(what: str) -> None:
    """Do nothing with the name of a phase: nobody listens."""


@dataclass(slots=True, kw_only=True, eq=False)
class Attempt:
    """A task, what strategies need to plan it, and why none has found a plan so far.

    Parameters
    ----------
    task : Task
    finder : CollisionFreeSearch
        The searches of the task.
    begin : callable
        Called with the name of each phase that begins.
    refine : bool
        Whether a plan may leave the grid of gamma.
    starts : Starts, optional
        The motions found over continuous gamma.
    failure : NoFeasiblePath, optional
        Why the strategies that were tried have no plan.
    """

    task: Task
    finder: CollisionFreeSearch
    begin: Callable[[str], None]
    refine: bool = False
    starts: Starts | None = None
    failure: NoFeasiblePath | None = None

    __repr__ = short_repr


Strategy = Callable[[Attempt], Plan | None]
"""Returns the plan of an attempt; None if it has none or does not apply, so that the next is tried.

It raises NoFeasiblePath if no later strategy can have a plan either."""


def first_plan(attempt: Attempt, strategies: tuple[Strategy, ...]) -> Plan:
    """Return the plan of the first strategy that has one.

    Raises
    ------
    NoFeasiblePath
        The failure of the attempt, if no strategy has a plan.
    """
    for strategy in strategies:
        made = strategy(attempt)
        if made is not None:
            return made
    assert attempt.failure is not None, "a strategy without a plan says why"
    raise attempt.failure from None
