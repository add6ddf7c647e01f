"""Run the planners of this package on the public set, and return their answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.public.check import Instance, forward, instance
from kerfpath import Contour, NoFeasiblePath, PlanOptions, Robot, plan, robot
from kerfpath.certificate import Certify
from kerfpath.robots import ExternalAxis

__all__ = ["PLANNERS", "Task", "answer", "task_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """An instance in the types of this package: a timed contour, placed by the identity."""

    contour: Contour
    robot: Robot
    tool: np.ndarray[Any, np.dtype[np.float64]]


PLANNERS: Mapping[str, tuple[str, PlanOptions]] = {
    "kerfpath": (
        "as by default, gamma from samples every 2 deg, certified for at most 60 s",
        PlanOptions(certify=Certify(seconds=60.0)),
    ),
    "grid": (
        "the best path on the grid, gamma every 2 deg, not refined: what a dense search finds",
        PlanOptions(method="exact", certify=None),
    ),
    "paper": (
        "the paper's procedure: first-order recursion, acceleration by trial, gamma every 2 deg",
        PlanOptions(method="paper", certify=None),
    ),
}
"""Options of each planner, and their description."""


def task_of(given: Instance) -> Task:
    """Return an instance in the types of this package; AssertionError if the two robots differ."""
    arm = len(given.turns)
    plain, endless = robot(given.model), given.endless[:arm]
    assert plain.lower is not None
    assert plain.upper is not None
    made = plain.with_limits(
        lower=np.where(endless, plain.lower, given.lower[:arm]),
        upper=np.where(endless, plain.upper, given.upper[:arm]),
        velocity=given.velocity[:arm],
        acceleration=given.acceleration[:arm],
        endless=endless,
    )
    for i, axis in enumerate(given.external, start=arm):
        made = made.with_external(
            ExternalAxis(**{key: axis[key] for key in _AXIS}),
            lower=axis["lower"],
            upper=axis["upper"],
            velocity=float(given.velocity[i]),
            acceleration=float(given.acceleration[i]),
            endless=axis["endless"],
        )
    some = np.random.default_rng(0).uniform(-1, 1, (5, arm))
    at_zero = np.column_stack([some, np.zeros((5, len(given.external)))])
    assert np.allclose(made.forward(at_zero) @ given.tool, forward(given, at_zero), atol=1e-12)
    contour = Contour(
        given.points,
        given.axes,
        closed=given.closed,
        name=given.name,
        time=given.interval * np.arange(len(given.points), dtype=np.float64),
    )
    return Task(contour=contour, robot=made, tool=given.tool)


_AXIS = ("name", "kind", "carries", "axis", "point")


def answer(planner: str, name: str) -> dict[str, Any]:
    """Return the answer of a planner of this package to an instance."""
    words, options = PLANNERS[planner]
    given = instance(name)
    task = task_of(given)
    said: dict[str, Any] = {"instance": name, "planner": planner, "settings": words}
    if given.external and options.method != "continuous":
        why = "not run: external axes would want a grid of their own"
        return said | {"seconds": 0.0, "q": None, "says": why}
    begin = perf_counter()
    try:
        made = plan(
            task.contour,
            task.robot,
            tool=task.tool,
            placement=np.eye(4),
            options=options,
        )
    except NoFeasiblePath as refusal:
        found: dict[str, Any] = {
            "q": None,
            "bound": None,
            "scope": refusal.scope,
            "says": str(refusal),
        }
        if refusal.closed is not None:
            found["where"] = {
                "node": refusal.closed.node,
                "joint": refusal.closed.joint,
                "limit": refusal.closed.limit,
                "words": str(refusal.closed),
            }
    else:
        found = {"q": made.q.tolist(), "bound": made.proof.bound, "says": made.proof.statement}
    return said | {"seconds": round(perf_counter() - begin, 3)} | found
