"""A contour planned over continuous gamma and certified, and by the grid with refinement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing import get_context
from os import environ
from time import perf_counter
from typing import TypeVar
from unittest.mock import patch

import numpy as np

from kerfpath import Contour, NoFeasiblePath, PlanOptions, Robot, plan
from kerfpath.arrays import Array
from kerfpath.certifier import certify
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph
from kerfpath.plans import Plan

__all__ = ["GAP", "GRID", "Made", "Task", "Weighed", "in_processes", "weigh"]

GAP = 0.005
"""Gap, (cost - bound) / cost, at which a certificate is finished."""
GRID = {"method": "exact", "refine": True, "gamma_step": np.radians(1.0)}
"""Options of the plan on the grid, the yardstick of the continuous search."""
AT_LIMIT = 0.999
"""Share of its limit above which an acceleration counts as at its limit."""

_K = TypeVar("_K")
_R = TypeVar("_R")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Made:
    """The result of one method for a task; without a plan if it found none."""

    plan: Plan | None
    graph_seconds: float
    seconds: float

    @property
    def cost(self) -> float | None:
        """The cost of the plan."""
        return None if self.plan is None else self.plan.cost


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Task:
    """A contour to plan; `options` are those of the continuous search.

    Parameters
    ----------
    contour : Contour
    robot : Robot
    tool, placement : (4, 4) m
        T_flange_tip, T_base_part.
    speed : float m/s
    options : PlanOptions
    """

    contour: Contour
    robot: Robot
    tool: Array
    placement: Array
    speed: float
    options: PlanOptions

    def on_grid(self, **changes: object) -> Task:
        """Return the task on the grid, by the method used before the continuous one."""
        return replace(self, options=replace(self.options, **(GRID | changes)))

    def made(self) -> Made:
        """Plan the task, timing the graph separately."""
        start = perf_counter()
        graph = self.graph()
        built = perf_counter()
        found = self.planned(graph)
        return Made(plan=found, graph_seconds=built - start, seconds=perf_counter() - built)

    def graph(self) -> LayeredGraph:
        """Return its layered graph."""
        return layered_graph(
            self.contour,
            self.robot,
            tool=self.tool,
            placement=self.placement,
            options=self.options,
        )

    def planned(self, graph: LayeredGraph | None = None) -> Plan | None:
        """Return the plan, not certified, on a graph if given; None if none is found."""
        with suppress(NoFeasiblePath):
            return plan(
                self.contour,
                self.robot,
                tool=self.tool,
                placement=self.placement,
                speed=self.speed,
                options=replace(self.options, certify=None),
                graph=graph,
            )
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighed:
    """The results of both methods for one task, and what is proved of the continuous plan.

    Parameters
    ----------
    name : str
    index : int
    nodes : int
    cost, grid_cost : float or None
        Of the continuous plan and of the grid's refined one; None if there is none.
    bound, gap : float or None
        None if nothing is proved.
    seconds, graph_seconds : float s
        Of the continuous search with its refinement, and of its graph.
    grid_seconds, grid_graph_seconds : float s
    certificate_seconds : float s
    pairs, stages : int
        Work of the certificate.
    at_limit : float
        Share of the nodes at which the acceleration of a joint is at its limit.
    """

    name: str
    index: int
    nodes: int
    cost: float | None
    grid_cost: float | None
    bound: float | None = None
    gap: float | None = None
    seconds: float
    graph_seconds: float
    grid_seconds: float
    grid_graph_seconds: float
    certificate_seconds: float = 0.0
    pairs: int = 0
    stages: int = 0
    at_limit: float = 0.0

    @property
    def excess(self) -> float | None:
        """Relative cost beyond the grid's refined plan; None unless both have a plan."""
        if self.cost is None or self.grid_cost is None:
            return None
        return self.cost / self.grid_cost - 1

    def __str__(self) -> str:
        """Return the name of the task, and what is remarkable about it."""
        parts = [f"{self.name} {self.index}"]
        if self.excess is not None:
            parts.append(f"{100 * self.excess:+.2f} % of the grid's")
        if self.gap is not None:
            parts.append(f"gap {100 * self.gap:.2f} %")
        parts.append(f"{100 * self.at_limit:.0f} % of the nodes at an acceleration limit")
        return (
            ", ".join(parts) + f"; certificate {self.certificate_seconds:.1f} s, {self.pairs} steps"
        )


def weigh(
    name: str, index: int, task: Task, *, gap: float = GAP, seconds: float | None = None
) -> Weighed:
    """Plan a task by both methods, and certify the continuous plan (arguments as `certify`)."""
    here, there = task.made(), task.on_grid().made()
    weighed = Weighed(
        name=name,
        index=index,
        nodes=len(task.contour),
        cost=here.cost,
        grid_cost=there.cost,
        seconds=here.seconds,
        graph_seconds=here.graph_seconds,
        grid_seconds=there.seconds,
        grid_graph_seconds=there.graph_seconds,
    )
    if here.plan is None:
        return weighed
    start = perf_counter()
    proved = certify(here.plan, gap=gap, seconds=seconds, checkable=False)
    taken = perf_counter() - start
    proof, share = proved.plan.proof, np.abs(here.plan.acceleration_share)
    limit = AT_LIMIT * task.options.eta_a
    return replace(
        weighed,
        bound=proof.bound,
        gap=proof.gap,
        certificate_seconds=taken,
        pairs=proved.pairs,
        stages=proved.stages,
        at_limit=float((share > limit).any(axis=1).mean()) if len(share) else 0.0,
    )


def in_processes(call: Callable[[_K], _R], keys: Sequence[_K], processes: int) -> list[_R]:
    """Return the result of a call for each key, from single-thread processes with kernels ready."""
    with (
        patch.dict(environ, NUMBA_NUM_THREADS="1"),
        ProcessPoolExecutor(
            processes,
            mp_context=get_context("spawn"),
            initializer=_begin,
            initargs=(call, keys[0]),
        ) as pool,
    ):
        return list(pool.map(call, keys))


def _begin(call: Callable[[_K], object], key: _K) -> None:
    """Compile what a call needs."""
    call(key)
