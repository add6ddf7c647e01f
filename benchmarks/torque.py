"""Torque limits on the grid: compared with every pair of edges, and their cost in time."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from benchmarks import _arm
from benchmarks._figures import Figure, Report, in_turn
from kerfpath import NoFeasiblePath, Robot, shortest_path
from kerfpath.arrays import Array, Bools, Ints
from kerfpath.auditor.dynamics import LagrangeArm
from kerfpath.dynamics import Load
from kerfpath.limits import TorqueLimit
from kerfpath.planner import layered_graph, node_interval
from kerfpath.urdf import ChainInertia

__all__ = ["run"]

MASSES = np.array([110.0, 70.0, 60.0, 15.0, 5.0, 1.0])
"""kg: assumed for an IRB 2400, whose maker states 380 kg in total."""
SIZE = 0.12
"""m: radius of gyration of every link, and distance of its mass from its joint."""
LOAD = Load(mass=15.0, centre=np.array([0.05, 0.0, 0.15]))
SPEED, STEPPING = 10 / 60, 3.0
"""m/s; and the multiple of the accelerations at which gamma may step, as in `benchmarks.search`."""
SHARES = (0.95, 1.001, 1.3, 1.6, 2.0)
"""Torque limits of small graphs, as shares of what the best path without them needs. 1 is left out:
two dynamics need not agree to the last digit of a limit."""
SAME = 1e-10
"""Relative difference up to which costs are equal: sums of the same numbers in another order."""
HOW_EXACT = """\
Small graphs at random, 3 to 7 layers of 2 to 8 vertices about a drifting pose of the IRB 2400, its
links of assumed masses, a load of 15 kg; limits on velocity, acceleration and torque of which many
bind. The yardstick tries every pair of edges, torques by the audit's dynamics (Lagrange's
equations, which share no code with the search). Time is that of `shortest_path` over all graphs,
with and without `torque`, on one core; calls with as little to do as these are mostly overhead."""
HOW_LARGE = """\
The closed wavy contour of the search benchmark, IRB 2400 with assumed masses, all postures, axes 4
and 6 endless, three times the assumed accelerations. Torque limits are multiples of what the best
path without them asks of each joint: above 1 they change nothing but the tests; below they shape
the path, and the search has more to look at, as with any limit that binds."""


class _Graph(NamedTuple):
    """A small layered graph, and the limits of its edges."""

    q: Array
    start: Ints
    dt: float
    velocity: Array
    acceleration: Array


def run(*, quick: bool) -> list[Report]:
    """Measure both."""
    robot = _arm_with_masses()
    return [_against_brute(robot, 60 if quick else 3000), _on_a_contour(robot, quick=quick)]


def _arm_with_masses() -> Robot:
    plain = _arm.arm()
    rng = np.random.default_rng(1)
    away = rng.normal(size=(6, 3))
    inertia = ChainInertia(
        mass=MASSES,
        centre=SIZE * away / np.linalg.norm(away, axis=1)[:, None],
        tensor=MASSES[:, None, None] * SIZE**2 * np.eye(3),
    )
    arm = replace(plain.arm, chain=plain.arm.model_chain())
    massive = replace(plain, arm=arm, dynamics=replace(plain.dynamics, inertia=inertia))
    return massive.with_limits(torque=np.full(6, 1e6)).with_load(LOAD)


def _against_brute(robot: Robot, count: int) -> Report:
    rng, seen, seconds = np.random.default_rng(19), Counter[str](), np.zeros(2)
    for limit in (None, robot.torque_limit()):  # compile what is measured
        _searched(_random_graph(rng), limit)
    for _ in range(count):
        graph = _random_graph(rng)
        free, took = _searched(graph, None)
        limit = _limit(robot, graph, free, rng)
        found, took_with = _searched(graph, limit)
        want = _brute(robot, graph, limit)
        if want == np.inf or found is None:
            assert found is None, "a path where no pair of edges leaves one"
            assert want == np.inf, "no path where there is one"
            seen["no path without torque limits" if free is None else "no path with them"] += 1
        else:
            assert abs(found[0] - want) <= SAME * want, f"{found[0]} and not {want}"
            assert free is not None
            seen["dearer with them" if want > free[0] * (1 + SAME) else "as without"] += 1
        seconds += took, took_with
    said = ", ".join(f"{name}: {number}" for name, number in sorted(seen.items()))
    return Report(
        title=f"Torque limits on the grid: {count} random graphs",
        how=HOW_EXACT,
        figures=[
            Figure(what="all graphs, without torque limits", values=[float(seconds[0])]),
            Figure(what="all graphs, with torque limits", values=[float(seconds[1])]),
        ],
        findings=[
            f"the cost, or that there is no path, agrees on all {count} graphs; {said}",
            f"with torque limits the search takes {seconds[1] / seconds[0]:.2f} times as long",
        ],
    )


def _random_graph(rng: np.random.Generator) -> _Graph:
    K = int(rng.integers(3, 8))
    sizes = rng.integers(2, 9, K)
    drift = rng.uniform(-1, 1, 6) + rng.normal(0, 0.1, (K, 6)).cumsum(axis=0)
    q = np.concatenate([drift[k] + rng.normal(0, 0.2, (m, 6)) for k, m in enumerate(sizes)])
    dt = float(rng.uniform(0.1, 0.3))
    step = np.abs(np.diff(q[rng.integers(0, len(q), (200, 2))], axis=1)[:, 0])
    return _Graph(
        q=q,
        start=np.append(0, np.cumsum(sizes)),
        dt=dt,
        velocity=np.quantile(step, 0.9, axis=0) / dt,
        acceleration=np.quantile(step, 0.95, axis=0) * 2 / dt**2,
    )


def _searched(
    graph: _Graph, torque: TorqueLimit | None
) -> tuple[tuple[float, Array] | None, float]:
    """Return cost and joints of the best path, if there is one, and the time it took, s."""
    q, start, dt, velocity, acceleration = graph
    begun = perf_counter()
    try:
        found = shortest_path(
            q, start, dt=dt, velocity=velocity, acceleration=acceleration, torque=torque
        )
    except NoFeasiblePath:
        return None, perf_counter() - begun
    took = perf_counter() - begun
    return (found.cost, q[start[:-1] + found.index]), took


def _limit(
    robot: Robot, graph: _Graph, free: tuple[float, Array] | None, rng: np.random.Generator
) -> TorqueLimit:
    limit = robot.torque_limit()
    assert limit is not None
    if free is None:
        return replace(limit, bound=np.full(6, 500.0))
    used = np.abs(limit.shares(free[1], np.full(len(free[1]) - 1, graph.dt))).max(axis=0)
    return replace(limit, bound=limit.bound * used * rng.choice(SHARES, 6))


def _brute(robot: Robot, graph: _Graph, limit: TorqueLimit) -> float:
    """Return the least cost of all paths under the limits, by trying every pair of edges."""
    arm = LagrangeArm.of(robot)
    assert arm is not None
    layers = [graph.q[a:b] for a, b in itertools.pairwise(graph.start)]
    D = [b[None] - a[:, None] for a, b in itertools.pairwise(layers)]
    weights = 1 / (graph.velocity * graph.dt)
    bound = graph.velocity * graph.dt + 1e-9
    step = [
        np.where((np.abs(d) <= bound).all(-1), (np.abs(d) * weights).sum(-1), np.inf) for d in D
    ]
    d = step[0]
    for k in range(1, len(D)):
        ok = _may_follow(arm, limit, graph, layers[k], D[k - 1], D[k])
        d = np.where(ok, d[:, :, None], np.inf).min(axis=0) + step[k]
    return float(d.min())


def _may_follow(
    arm: LagrangeArm, limit: TorqueLimit, graph: _Graph, q: Array, before: Array, after: Array
) -> Bools:
    """Return which increments (l, p, n) to vertices (p, n) and (p, j, n) from them may follow."""
    most = graph.acceleration * graph.dt**2 + 1e-9
    ok: Bools = np.asarray((np.abs(after[None] - before[:, :, None]) <= most).all(-1))
    i, p, j = np.nonzero(ok)
    one, two = before[i, p], after[p, j]
    if len(p):
        tau = arm.torque(q[p], (one + two) / (2 * graph.dt), (two - one) / graph.dt**2)
        ok[i, p, j] = (np.abs(tau) <= limit.bound * (1 + 1e-9)).all(axis=1)
    return ok


def _on_a_contour(robot: Robot, *, quick: bool) -> Report:
    nodes, samples = (100, 60) if quick else (1000, 360)
    contour = _arm.wave(nodes)
    graph = layered_graph(
        contour, robot, tool=_arm.tool(), placement=_arm.placement(), gamma_step=2 * np.pi / samples
    )
    velocity, acceleration = robot.speed_limits()
    dt, limit = node_interval(contour, SPEED), robot.torque_limit()
    assert limit is not None
    cost: dict[str, float] = {}

    def search(name: str, torque: TorqueLimit | None) -> Array | None:
        try:
            found = shortest_path(
                graph.q, graph.start, dt=dt, velocity=velocity, endless=robot.endless,
                acceleration=STEPPING * acceleration, torque=torque,
            )  # fmt: skip
        except NoFeasiblePath:
            cost[name] = np.inf
            return None
        cost[name] = found.cost
        return np.asarray(graph.q[graph.start[:-1] + found.index])

    path = search("without torque limits", None)
    assert path is not None
    turned = np.where(robot.endless, np.unwrap(path, axis=0), path)
    used = np.abs(limit.shares(turned, np.full(nodes - 1, dt))).max(axis=0)
    limits: dict[str, TorqueLimit | None] = {"without torque limits": None}
    for share in (10.0, 1.001, 0.99, 0.98):
        limits[f"{share:g} times what that needs"] = replace(
            limit, bound=limit.bound * used * share
        )
    calls = {name: lambda n=name, t=torque: search(n, t) for name, torque in limits.items()}
    seconds = in_turn(calls, 3 if quick else 7)
    notes = {
        name: "no path" if cost[name] == np.inf else f"cost {cost[name]:.6g}" for name in calls
    }
    plain = np.median(seconds["without torque limits"])
    return Report(
        title=f"Torque limits on the grid: {nodes} nodes, gamma in {samples} steps",
        how=HOW_LARGE,
        figures=[
            Figure(what=name, values=taken, note=notes[name]) for name, taken in seconds.items()
        ],
        findings=[
            f"{name}: {np.median(taken) / plain:.2f} times as long"
            for name, taken in list(seconds.items())[1:]
        ],
    )
