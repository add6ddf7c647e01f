"""Tesseract's Descartes with edge checks in the wave cell, beside our plans in the cell."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from benchmarks import _arm
from benchmarks._cells import Case, tessellated, wave
from benchmarks._descartes import NotRun, Solid, Task, solve
from benchmarks._figures import Figure, Report
from kerfpath.cell import Hull

__all__ = ["against_descartes"]

HOW = """\
The wave with fewer nodes, all bodies as closed meshes, to Tesseract's Descartes (its own ranges of
at most one turn, no velocity or acceleration limit, poses and motions between them checked for
contact by Bullet, its defaults, nozzle and part left out) and to `plan(cell=)` (all limits,
near-miss distances, nozzle included, graph built anew). Descartes runs in a process of its own,
given up after 2 minutes."""


def against_descartes(*, quick: bool) -> Report:
    """Measure plans with edge checks, theirs and ours."""
    report = Report(title="Plans in a cell beside Tesseract's Descartes", how=HOW)
    for nodes, degrees in ((20, 30),) if quick else ((20, 30), (40, 20)):
        case = wave(nodes, np.radians(degrees), meshes=True)
        case.plan(cell=case.cell, graph=None)
        seconds = []
        for _ in range(1 if quick else 3):
            start = perf_counter()
            made = case.plan(cell=case.cell, graph=None)
            seconds.append(perf_counter() - start)
        name = f"{nodes} nodes x {degrees} deg"
        report.figures.append(Figure(what=f"kerfpath, {name}", values=seconds))
        what = f"Tesseract Descartes, {name}"
        try:
            solved = solve(_task(case, runs=1, longest=120.0))
        except NotRun as reason:
            report.figures.append(Figure(what=what, note=str(reason)))
            continue
        note = f"+{solved.peak_megabytes:.0f} MB, {solved.cores_busy:.1f} cores busy"
        report.figures.append(Figure(what=what, values=solved.seconds, note=note))
        steps = case.cell.increments(solved.q[:-1], solved.q[1:])
        ours = case.cell.increments(made.q[:-1], made.q[1:])
        report.findings.append(
            f"{name}: {int(case.cell.clear(solved.q).sum())} of {nodes} nodes of Descartes' path "
            "keep the near-miss distances here; sum of squared joint steps "
            f"{float((steps**2).sum()):.4g}, kerfpath's {float((ours**2).sum()):.4g} rad^2"
        )
    return report


def _task(case: Case, *, runs: int, longest: float) -> Task:
    """Return the same task for the peer."""
    arm = _arm.arm_of_one_turn()
    frames = case.placement @ case.contour.frames("rotation-minimising")
    zero = case.cell.frames(np.zeros((1, 6)))[0]
    solids = []
    for body in case.cell.bodies:
        shape = tessellated(body.shape)
        vertices, triangles = (
            (shape.points, shape.triangles)
            if isinstance(shape, Hull)
            else (shape.vertices, shape.triangles)
        )
        T = zero[body.frame]
        solids.append(
            Solid(
                name=_name(body.name),
                frame=body.frame,
                vertices=vertices @ T[:3, :3].T + T[:3, 3],
                triangles=triangles.astype(np.int64),
            )
        )
    apart = [(_name(a), _name(b)) for a, b in case.cell.pair_names if {a, b} != {"nozzle", "part"}]
    return Task(
        robot=arm,
        tool=case.tool,
        frames=np.ascontiguousarray(frames),
        samples=len(case.graph.gamma),
        sizes=np.diff(case.graph.start).tolist(),
        runs=runs,
        solids=solids,
        apart=apart,
        longest=longest,
    )


def _name(body: str) -> str:
    """Return a name that differs from all frames of the arm."""
    return "body_" + body.replace(" ", "_")
