"""The Pareto set by a genetic algorithm over weights and shares of the limits: NSGA-II of pymoo."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, get_args

import moocore
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.optimize import minimize

from kerfpath import Plan
from kerfpath.arrays import Array, freeze
from kerfpath.front import ParetoProblem, Subproblem
from kerfpath.search import Metric, ObjectiveKind

__all__ = ["by_nsga"]

POPULATION = 20
SPREAD = np.log(4.0)
"""Largest logarithm of the factor on a weight, as on the grid."""
OBJECTIVES, METRICS = get_args(ObjectiveKind), get_args(Metric)


class _Runs(Problem):  # type: ignore[misc]
    """Losses of runs over 6 weights, 2 shares of the limits, objective and metric."""

    def __init__(self, problem: ParetoProblem, first: Subproblem) -> None:
        self.problem, self.first = problem, first
        self.losses: list[Array] = []
        n, shares = len(first.weights), np.log([problem.options.eta_v, problem.options.eta_a])
        low = np.r_[np.full(n, -SPREAD), shares - np.log(10), 0, 0]
        high = np.r_[np.full(n, SPREAD), shares, 2, 3]
        super().__init__(
            n_var=n + 4, n_obj=len(problem.criteria), n_ieq_constr=1, xl=low, xu=high - 1e-9
        )

    def run(self, x: Array) -> Subproblem:
        """Return the run of genes x (n + 4,)."""
        n = len(self.first.weights)
        return replace(
            self.first,
            weights=freeze(self.first.weights * np.exp(x[:n])),
            eta_v=float(np.exp(x[n])),
            eta_a=float(np.exp(x[n + 1])),
            objective=OBJECTIVES[int(x[n + 2])],
            metric=METRICS[int(x[n + 3])],
        )

    def genes(self, run: Subproblem) -> Array:
        """Return the genes (n + 4,) of a run, clipped to their bounds."""
        which = [OBJECTIVES.index(run.objective) + 0.5, METRICS.index(run.metric) + 0.5]
        weights = np.log(run.weights / self.first.weights)
        found = np.r_[weights, np.log([run.eta_v, run.eta_a]), which]
        return np.asarray(np.clip(found, self.xl, self.xu))

    def _evaluate(self, x: Array, out: dict[str, Array], *_: Any, **__: Any) -> None:
        with ThreadPoolExecutor() as pool:
            found = list(pool.map(lambda genes: self.problem.solve(self.run(genes)), x))
        made = [
            self.problem.evaluate(each).losses if isinstance(each, Plan) else None for each in found
        ]
        self.losses += [losses for losses in made if losses is not None]
        worst = np.full(self.n_obj, 1e9)
        out["F"] = np.array([worst if losses is None else losses for losses in made])
        out["G"] = np.array([[1.0 if losses is None else -1.0] for losses in made])


def by_nsga(
    problem: ParetoProblem, runs: Sequence[Subproblem], *, budget: int, seed: int
) -> tuple[Array, int]:
    """Return the losses (P, C) of the front that `budget` runs find, and how many were feasible.

    It begins with `runs`, the first of which has the full limits, and random others.
    """
    search = _Runs(problem, runs[0])
    population = min(POPULATION, budget)
    first = np.random.default_rng(seed).uniform(search.xl, search.xu, (population, search.n_var))
    given = np.array([search.genes(run) for run in runs])[:population]
    first[: len(given)] = given
    minimize(
        search,
        NSGA2(pop_size=population, sampling=first),
        ("n_eval", budget),
        seed=seed,
    )
    found = np.array(search.losses)
    return np.asarray(found[moocore.is_nondominated(found)]), len(found)
