"""Optimise gamma by a genetic algorithm (Shibata et al. 1997), with pymoo."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymoo.algorithms.soo.nonconvex.ga import GA
from pymoo.core.problem import Problem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.optimize import minimize
from scipy.interpolate import BSpline

from benchmarks._following import Follower
from kerfpath.arrays import Array

__all__ = ["GENERATIONS", "POPULATION", "genetic"]

GENERATIONS, POPULATION = 200, 100
CONTROL_POINTS = 12
SPREAD = np.radians(90.0)
"""Largest distance of a control point from the level of the course."""


class _Course(Problem):  # type: ignore[misc]
    """Least cost (14) over the level of gamma and the control points about it."""

    def __init__(self, follower: Follower, basis: Array) -> None:
        self.follower, self.basis = follower, basis
        bound = np.r_[np.pi, np.full(basis.shape[1], SPREAD)]
        super().__init__(n_var=len(bound), n_obj=1, n_ieq_constr=1, xl=-bound, xu=bound)

    def _evaluate(self, x: Array, out: dict[str, Array], *_: Any, **__: Any) -> None:
        found = self.follower.follow(self.course(x))
        out["F"] = np.where(np.isfinite(found.cost), found.cost, 1e9)
        out["G"] = np.where(np.isfinite(found.excess), found.excess, 1e9)

    def course(self, x: Array) -> Array:
        """Return gamma (P, K) of genes x (P, 1 + C)."""
        return np.asarray(x[:, :1] + x[:, 1:] @ self.basis.T)


def genetic(follower: Follower, *, seed: int, generations: int = GENERATIONS) -> Array:
    """Return the best course of gamma (K,) found; the seed decides it."""
    basis = spline_basis(len(follower.task.H), CONTROL_POINTS)
    problem, rng = _Course(follower, basis), np.random.default_rng(seed)
    first = rng.uniform(problem.xl, problem.xu, (POPULATION, problem.n_var))
    first[:, 1:] *= rng.uniform(0, 1, (POPULATION, 1)) ** 2
    algorithm = GA(
        pop_size=POPULATION,
        sampling=first,
        crossover=SBX(prob=0.9, eta=15),
        mutation=PM(eta=20),
        eliminate_duplicates=True,
    )
    found = minimize(
        problem, algorithm, ("n_gen", generations), seed=seed, return_least_infeasible=True
    )
    return np.asarray(problem.course(np.atleast_2d(found.X))[0])


def spline_basis(nodes: int, count: int) -> Array:
    """Return the uniform cubic B-splines (K, count) at evenly spaced nodes; each row sums to 1."""
    step = 1 / (count - 3)
    knots = step * np.arange(-3, count + 1)
    at = np.linspace(0, 1, nodes)
    return np.asarray(BSpline.design_matrix(np.clip(at, 0, 1 - 1e-12), knots, 3).toarray())
