"""feed="dip": the path to slow down, the least time it takes, and where the speed dips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath import refiner
from kerfpath._arrays import Array
from kerfpath.planner._refined import first_order
from kerfpath.planner._task import Task
from kerfpath.plans import Feed, Plan, Proof
from kerfpath.retime import feed, retime
from kerfpath.search import slowed_path

__all__ = ["slowed"]


def slowed(task: Task, *, refine: bool) -> Plan:
    """Return a plan that keeps the speed asked for wherever its path lets it, and dips elsewhere.

    On the grid the path is the one that loses the least time, priced above all distances, if each
    step had to be slow on its own. With `refine` gamma moves off the grid to ask for little beyond
    the limits, from the best path without acceleration limits, where there is one. The times along
    the path are then the least under all limits; the refinement keeps them, and they are set anew.
    """
    start = first_order(task) if refine else None
    start = _least_lost(task) if start is None else start
    if not refine:
        return _timed(task, start)
    eased = refiner.ease(start)
    claim = f"{start.proof.statement}; gamma moved off the grid to lose little time"
    made = _timed(task, replace(eased, proof=Proof(optimal=False, statement=claim)))
    better = refiner.refine(made)
    again = _timed(task, better.plan)
    return again if again.time[-1] <= made.time[-1] else made


def _least_lost(task: Task) -> Plan:
    s = task.settings
    found = slowed_path(**task.limits, dt=task.dt, weights=s.weights, metric=s.metric)
    claim = (
        "at constant speed the graph has no path; of all its paths this one loses the least time "
        "step by step"
    )
    return task.plan(found.index, task.cost(found.index), Proof(optimal=False, statement=claim))


def _timed(task: Task, made: Plan) -> Plan:
    """Return the plan with the least times, and where they dip."""
    tau = retime(made.increments, task.dt, *_limits(task))
    time = np.concatenate([[0.0], np.cumsum(tau)])
    return replace(made, time=time, feed=_feed(task, made, tau))


def _feed(task: Task, made: Plan, tau: Array) -> Feed:
    length = np.diff(made.contour.s)
    return feed(tau, task.dt, made.increments, *_limits(task), length)


def _limits(task: Task) -> tuple[Array, Array]:
    velocity, acceleration = task.robot.speed_limits()
    return task.settings.eta_v * velocity, task.settings.eta_a * acceleration
