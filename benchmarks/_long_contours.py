"""Time and memory of long contours, from the poses to the plan and its certificate."""

from __future__ import annotations

import resource
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter, process_time
from typing import NamedTuple

import numpy as np

from benchmarks import _arm
from benchmarks._certified import Task
from benchmarks._figures import Figure, Report
from kerfpath import PlanOptions
from kerfpath.certifier import certify

__all__ = ["run"]

SPEED = 10 / 60
"""Cutting speed, m/s."""
STEPPING = 3.0
"""Multiple of the arm's accelerations at which they are active but still let gamma step."""
GAP = 0.01
"""Gap at which the certificate of the whole plan is finished."""
WAYS = ("continuous", "grid", "certified")
SHORT = 30.0
"""Seconds for the certificate of a long contour."""

HOW_WHOLE = f"""\
The wavy closed contour of the refinement's whole plan: IRB 2400, 10 m/min, all postures and turns
(every turn of a joint with more than one, or joints 4 and 6 endless), velocity limits of the maker,
three times the assumed accelerations. Continuous: `plan` without a certificate. Certified: the
same, and `certify` to a gap of {100 * GAP:g} %. Grid: method "exact" with `refine`, 1 deg. Each
from the contour on, frames, kinematics and graph included, in a process of its own whose kernels a
plan of 100 nodes has loaded; memory is the peak of the whole process, interpreter and libraries
with it."""

HOW_FAR = f"""\
The same contour with more nodes, joints 4 and 6 endless, the arm's own accelerations, as in "Long
contours" of the exact search; processes as above, the certificate in {SHORT:g} s at most. Time per
node is that of all cores together."""


class _Run(NamedTuple):
    wall: float
    cpu: float
    megabytes: float
    cost: float
    told: str


def run(*, quick: bool) -> list[Report]:
    """Measure both."""
    nodes, sizes = (100, (200, 400)) if quick else (1000, (1000, 5000, 20_000, 50_000))
    return [_whole(nodes, 1 if quick else 3), _far(sizes)]


def _task(nodes: int, *, turns: bool, stepping: bool) -> Task:
    arm = _arm.arm()
    if stepping:
        arm = arm.with_limits(acceleration=STEPPING * arm.speed_limits()[1])
    if turns:
        arm = arm.with_limits(endless=np.zeros(6, bool))
    return Task(
        contour=_arm.wave(nodes),
        robot=arm,
        tool=_arm.tool(),
        placement=_arm.placement(),
        speed=SPEED,
        options=PlanOptions(),
    )


def _measure(nodes: int, way: str, turns: bool, stepping: bool) -> _Run:
    """Plan in this process, which must be a fresh one."""
    seconds = None if stepping else SHORT
    _planned(_task(100, turns=turns, stepping=stepping), way, seconds)
    task = _task(nodes, turns=turns, stepping=stepping)
    wall, cpu = perf_counter(), process_time()
    cost, told = _planned(task, way, seconds)
    wall, cpu = perf_counter() - wall, process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return _Run(wall, cpu, peak, cost, told)


def _planned(task: Task, way: str, seconds: float | None) -> tuple[float, str]:
    task = task.on_grid() if way == "grid" else task
    found = task.planned()
    if found is None:
        return np.inf, "no plan"
    if way != "certified":
        return found.cost, f"cost {found.cost:.4f}"
    proved = certify(found, gap=GAP, seconds=seconds, checkable=False)
    gap = proved.plan.proof.gap
    assert gap is not None
    return found.cost, (
        f"cost {found.cost:.4f}, gap {100 * gap:.2f} %, {proved.stages} stages, "
        f"{proved.pairs} steps from cell to cell"
    )


def _alone(nodes: int, way: str, *, turns: bool, stepping: bool) -> _Run:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_measure, nodes, way, turns, stepping).result()


def _whole(nodes: int, runs: int) -> Report:
    figures = []
    for what, turns in (("every turn", True), ("joints 4 and 6 endless", False)):
        for way in WAYS:
            made = [_alone(nodes, way, turns=turns, stepping=True) for _ in range(runs)]
            note = f"{made[0].told}, process {max(m.megabytes for m in made):.0f} MB"
            figures.append(Figure(what=f"{way}, {what}", values=[m.wall for m in made], note=note))
    return Report(
        title=f"Continuous gamma: whole plan, {nodes} nodes", how=HOW_WHOLE, figures=figures
    )


def _far(sizes: tuple[int, ...]) -> Report:
    figures, findings = [], []
    for way in WAYS:
        per_node = []
        for nodes in sizes:
            made = _alone(nodes, way, turns=False, stepping=False)
            time, memory = made.cpu / nodes * 1e3, made.megabytes / nodes * 1e3
            per_node.append(f"{time:.2f} ms and {memory:.0f} kB at {nodes}")
            note = f"{made.told}, process {made.megabytes:.0f} MB"
            figures.append(Figure(what=f"{way}, {nodes} nodes", values=[made.wall], note=note))
        findings.append(f"{way}, a node: " + ", ".join(per_node))
    return Report(
        title="Continuous gamma: long contours", how=HOW_FAR, figures=figures, findings=findings
    )
