"""IPOPT: the whole motion as one nonlinear program, built with CasADi, from many starts."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from benchmarks.public.check import Array, Instance
from benchmarks.public.outside._chain import followed, joints, least_bad, ranges, starts

__all__ = ["SETTINGS", "plan"]

STARTS, TRIED = 48, 24
ITERATIONS = 300
SETTINGS = (
    f"CasADi and IPOPT (MUMPS); joints of all nodes as unknowns, tip and beam as equations, limits "
    f"as linear inequalities, at most {ITERATIONS} iterations; {STARTS} motions by the shortest "
    f"steps from random starts, the {TRIED} best of them improved"
)


def plan(task: Instance, rng: np.random.Generator) -> tuple[Array | None, str]:
    """Return the best motion of all starts, and a remark."""
    first = starts(task, STARTS, rng)
    motions = list(followed(task, first))
    motions.sort(key=lambda q: _need(task, q))
    improve = _program(task)
    made = [improve(q) for q in motions[:TRIED]]
    return least_bad(task, made), f"{len(motions)} of {len(first)} starts come to the end"


def _need(task: Instance, q: Array) -> float:
    """Return the largest share of a limit that a motion needs."""
    step = np.diff(q, axis=0)
    v = np.abs(step) / (task.velocity * task.interval)
    a = np.abs(np.diff(step, axis=0)) / (task.acceleration * task.interval**2)
    return float(max(v.max(), a.max()))


def _program(task: Instance) -> Any:
    """Return the function that improves a motion (K, n)."""
    K, n = len(task.points), len(task.velocity)
    q = casadi.SX.sym("q", n)
    tip, across = _forward(task, q)
    p, a = casadi.SX.sym("p", 3), casadi.SX.sym("a", 3)
    # Tip at its point; the beam along its axis: both other axes of the tip are square to it.
    rest = casadi.vertcat(tip - p, across.T @ a)
    node = casadi.Function("node", [q, p, a], [rest]).map(K)

    Q, S = casadi.MX.sym("Q", n, K), casadi.MX.sym("S", n, K - 1)
    scale = 1 / (task.velocity * task.interval)
    step = Q[:, 1:] - Q[:, :-1]
    bend = step[:, 1:] - step[:, :-1]
    rest_of_all = node(Q, task.points.T, task.axes.T)
    g = [rest_of_all, S - step, S + step, bend]
    most_bend = np.tile(task.acceleration * task.interval**2, K - 2)
    lower = np.concatenate([np.zeros(5 * K), np.zeros(2 * n * (K - 1)), -most_bend])
    upper = np.concatenate([np.zeros(5 * K), np.full(2 * n * (K - 1), np.inf), most_bend])
    solver = casadi.nlpsol(
        "motion",
        "ipopt",
        {
            "x": casadi.vertcat(casadi.vec(Q), casadi.vec(S)),
            "f": casadi.sum1(casadi.sum2(casadi.diag(scale) @ S)),
            "g": casadi.vertcat(*(casadi.vec(each) for each in g)),
        },
        {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "max_iter": ITERATIONS,
                "tol": 1e-7,
                "constr_viol_tol": 1e-9,
                "bound_relax_factor": 0.0,
            },
        },
    )
    low, high = ranges(task)
    most = task.velocity * task.interval
    x_low = np.concatenate([np.tile(low, K), np.zeros(n * (K - 1))])
    x_high = np.concatenate([np.tile(high, K), np.tile(most, K - 1)])

    def improve(start: Array) -> Array:
        first = np.abs(np.diff(start, axis=0))
        x0 = np.concatenate([start.ravel(), np.minimum(first, most).ravel()])
        found = solver(x0=x0, lbx=x_low, ubx=x_high, lbg=lower, ubg=upper)
        return np.array(found["x"]).ravel()[: n * K].reshape(K, n)

    return improve


def _forward(task: Instance, q: Any) -> tuple[Any, Any]:
    """Return the tip, and its two axes across the beam (3, 2), relative to the part."""
    R, p = casadi.SX.eye(3), casadi.SX.zeros(3)
    for joint in joints(task):
        p, R = p + R @ joint.origin[:3, 3], R @ joint.origin[:3, :3]
        if joint.linear:
            p = p + R @ joint.axis * q[joint.column]
            continue
        cross = casadi.skew(joint.axis)
        x = q[joint.column]
        R = R @ (np.eye(3) + casadi.sin(x) * cross + (1 - casadi.cos(x)) * (cross @ cross))
    end = task.flange @ task.tool
    tip, R = p + R @ end[:3, 3], R @ end[:3, :3]
    return tip, R[:, :2]
