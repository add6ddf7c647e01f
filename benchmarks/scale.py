"""How the exact search scales: beside a brute second-order recursion, repeated, on long paths."""

from __future__ import annotations

import resource
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from time import perf_counter, process_time

import numpy as np

from benchmarks import _arm
from benchmarks._dense import second_order_cost
from benchmarks._figures import Figure, Report, in_turn
from kerfpath import plan, shortest_path
from kerfpath.graph import LayeredGraph
from kerfpath.planner import layered_graph, node_interval

__all__ = ["run"]

SPEED = 10 / 60
"""Cutting speed, m/s."""

SHARES = (3.0, 1.0, 0.3, 0.1)
"""Shares of the acceleration limits, from one that lets gamma step to one that seldom does."""

HOW_BRUTE = """\
The closed wavy contour of the other searches, all postures, axes 4 and 6 endless, 10 m/min, with
fewer nodes so that the brute recursion can run. It keeps every admissible edge as a state and
tries, for each pair of vertices of neighbouring layers, every state before it
(`second_order_cost` in `benchmarks/_dense.py`); one core, all in turn, both limits on. kerfpath's
times include the preparation of the arrays, and its search yields the path. The less acceleration
there is, the fewer edges the brute recursion has to keep."""

HOW_AGAIN = """\
`plan(method="exact")` on a graph that is kept, after a change of weights, eta_v or eta_a: what a
slider of the studio or a task of a sweep asks for."""

HOW_FAR = """\
`plan(method="exact")` end to end, from the contour to the plan, gamma every 2 degrees, in a fresh
process whose kernels a plan of 100 nodes has loaded. The same contour with more nodes. Time per
node is that of all cores together; memory is the peak of the whole process, interpreter and
libraries with it."""


def run(*, quick: bool) -> list[Report]:
    """Measure all three."""
    runs = 3 if quick else 5
    return [
        _beside_brute(40 if quick else 200, 40 if quick else 371, runs),
        _again(100 if quick else 400, 40 if quick else 371, runs),
        _far((200, 400) if quick else (1000, 10_000, 50_000)),
    ]


def _graph(nodes: int, samples: int) -> LayeredGraph:
    return layered_graph(
        _arm.wave(nodes),
        _arm.arm(),
        tool=_arm.tool(),
        placement=_arm.placement(),
        gamma_step=2 * np.pi / samples,
    )


def _beside_brute(nodes: int, samples: int, runs: int) -> Report:
    robot, graph = _arm.arm(), _graph(nodes, samples)
    velocity, acceleration = robot.speed_limits()
    dt = node_interval(_arm.wave(nodes), SPEED)
    cost: dict[str, float] = {}

    def exact(name: str, eta_a: float) -> None:
        cost[name] = shortest_path(
            graph.q,
            graph.start,
            dt=dt,
            velocity=velocity,
            acceleration=eta_a * acceleration,
            endless=robot.endless,
        ).cost

    def brute(name: str, eta_a: float) -> None:
        cost[name] = second_order_cost(
            graph.q,
            graph.start,
            dt=dt,
            velocity=velocity,
            acceleration=eta_a * acceleration,
            endless=robot.endless,
            weights=1 / (velocity * dt),
        )

    calls: dict[str, Callable[[], None]] = {}
    for eta_a in SHARES:
        for who, call in (("kerfpath", exact), ("brute recursion", brute)):
            name = f"{who}, eta_a {eta_a:g}"
            calls[name] = partial(call, name, eta_a)
    seconds = in_turn(calls, runs)
    findings = [f"{len(graph.q)} vertices in {nodes} layers"]
    for eta_a in SHARES:
        ours, theirs = f"kerfpath, eta_a {eta_a:g}", f"brute recursion, eta_a {eta_a:g}"
        ratio = float(np.median(seconds[theirs]) / np.median(seconds[ours]))
        findings.append(
            f"eta_a {eta_a:g}: the brute recursion takes {ratio:.0f} times as long; relative "
            f"difference of the optima {abs(cost[ours] / cost[theirs] - 1):.0e}"
        )
    return Report(
        title=f"Exact search beside the brute recursion, {nodes} nodes x "
        f"{np.diff(graph.start).mean():.0f} vertices",
        how=HOW_BRUTE,
        figures=[
            Figure(what=name, values=taken, note=f"cost {cost[name]:.4f}")
            for name, taken in seconds.items()
        ],
        findings=findings,
    )


def _again(nodes: int, samples: int, runs: int) -> Report:
    robot, graph, contour = _arm.arm(), _graph(nodes, samples), _arm.wave(nodes)
    velocity, _ = robot.speed_limits()
    dt = node_interval(contour, SPEED)
    cost: dict[str, float] = {}

    def planned(name: str, scale: float, eta_v: float, eta_a: float) -> None:
        cost[name] = plan(
            contour,
            robot,
            tool=_arm.tool(),
            placement=_arm.placement(),
            speed=SPEED,
            gamma_step=2 * np.pi / samples,
            weights=np.array([1, 1, 1, scale, scale, scale]) / (velocity * dt),
            eta_v=eta_v,
            eta_a=eta_a,
            method="exact",
            graph=graph,
        ).cost

    changes = {
        "as it was": (1.0, 1.0, 1.0),
        "wrist weighs half": (0.5, 1.0, 1.0),
        "eta_v 0.8": (1.0, 0.8, 1.0),
        "eta_a 0.5": (1.0, 1.0, 0.5),
        "eta_a 0.3, which binds": (1.0, 1.0, 0.3),
    }
    seconds = in_turn({n: partial(planned, n, *change) for n, change in changes.items()}, runs)
    return Report(
        title=f"Plan again on a kept graph, {nodes} nodes x "
        f"{np.diff(graph.start).mean():.0f} vertices",
        how=HOW_AGAIN,
        figures=[
            Figure(what=name, values=taken, note=f"cost {cost[name]:.4f}")
            for name, taken in seconds.items()
        ],
    )


def _far(sizes: tuple[int, ...]) -> Report:
    figures, per_node = [], []
    for nodes in sizes:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            wall, cpu, megabytes, vertices = pool.submit(_whole_plan, nodes).result()
        per_node.append(f"{cpu / nodes * 1e3:.2f} ms at {nodes}")
        note = f"{vertices} vertices, process {megabytes:.0f} MB"
        figures.append(Figure(what=f"plan of {nodes} nodes", values=[wall], note=note))
    return Report(
        title="Long contours, gamma every 2 degrees",
        how=HOW_FAR,
        figures=figures,
        findings=["time per node: " + ", ".join(per_node)],
    )


def _whole_plan(nodes: int) -> tuple[float, float, float, int]:
    """Return wall time and processor time (s) of a plan, peak memory, and number of vertices."""
    task = partial(
        plan,
        robot=_arm.arm(),
        tool=_arm.tool(),
        placement=_arm.placement(),
        speed=SPEED,
        gamma_step=np.radians(2),
        method="exact",
    )
    task(_arm.wave(100))
    contour = _arm.wave(nodes)
    wall, cpu = perf_counter(), process_time()
    made = task(contour)
    wall, cpu = perf_counter() - wall, process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return wall, cpu, peak, made.counts["admitted"]
