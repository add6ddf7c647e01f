"""Collision checks: distances per second, and lazy checking beside checking everything."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks import _arm
from benchmarks._figures import Figure, Report, Sheet, in_turn
from kerfpath import Contour, Robot, plan, robot
from kerfpath._arrays import Array, Ints
from kerfpath.cad import read as read_drawing
from kerfpath.cell import Cell, CuttingHead, Mesh, Shape, box_between, cell_of, welded
from kerfpath.graph import LayeredGraph
from kerfpath.job import read_job
from kerfpath.planner import layered_graph

__all__ = ["run"]

HOW = """\
Cell: robot links as capsules, the generic head (nozzle, body, arm), the part as a closed mesh, a
table and, in the way of the plan without a cell, a post; near-miss distance 5 mm. A configuration
is one joint vector with all judged pairs: "all distances" finds each exactly, "clear or not" stops
where bounds tell. Lazy: `plan(cell=)` with the graph given, vertices and motions between them
checked. Every vertex: `Cell.clear` on a random sample of the graph, its time scaled up to all of
it; every edge: `Cell.clear_motion` on a random sample of edges between clear vertices that keep the
velocity limit, scaled up likewise. Wave: 200 nodes, 10 degrees, all postures, IRB 2400; a task of
this size takes Tesseract's Descartes 581 s with its edge checks on, in a scene of its own."""

COLUMNS = (
    "case", "vertices", "looked at", "measured", "closed", "motions", "searches", "lazy s",
    "search alone s", "every vertex s", "every edge s",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    """A task with its graph, and the cell it is planned in."""

    name: str
    contour: Contour
    robot: Robot
    speed: float
    tool: Array
    placement: Array
    gamma_step: float
    graph: LayeredGraph
    cell: Cell


def run(*, quick: bool) -> list[Report]:
    """Measure distances and plans."""
    cases = [_wave(quick), _demo(quick)]
    report = Report(title="Collision checks", how=HOW)
    for case in cases:
        rng = np.random.default_rng(1)
        q = case.graph.q[rng.integers(0, len(case.graph.q), 30 if quick else 300)]
        calls: dict[str, Callable[[], object]] = {
            f"{case.name}: all distances": partial(case.cell.distances, q),
            f"{case.name}: clear or not": partial(case.cell.clear, q),
        }
        for what, seconds in in_turn(calls, 2 if quick else 5).items():
            report.figures.append(
                Figure(what=what, values=[len(q) / s for s in seconds], unit="configurations/s")
            )
        report.findings.append(
            f"{case.name}: {len(case.cell.pairs)} judged pairs; without the cell "
            f"{_hits(case)} of {len(case.contour)} nodes of the best path collide"
        )
    rows = [
        _row(case, rng=np.random.default_rng(2), sample=50 if quick else 1000) for case in cases
    ]
    report.sheets.append(Sheet(columns=COLUMNS, rows=[row for row, _ in rows]))
    report.findings.extend(finding for _, finding in rows)
    return [report]


def _blind(case: _Case) -> tuple[float, Array]:
    start = perf_counter()
    made = plan(
        case.contour, case.robot, speed=case.speed, graph=case.graph,
        tool=case.tool, placement=case.placement, gamma_step=case.gamma_step,
    )  # fmt: skip
    return perf_counter() - start, made.q


def _hits(case: _Case) -> int:
    return int((~case.cell.clear(_blind(case)[1])).sum())


def _row(case: _Case, *, rng: np.random.Generator, sample: int) -> tuple[list[str], str]:
    alone, _ = _blind(case)
    start = perf_counter()
    made = plan(
        case.contour, case.robot, speed=case.speed, graph=case.graph, cell=case.cell,
        tool=case.tool, placement=case.placement, gamma_step=case.gamma_step,
    )  # fmt: skip
    lazy = perf_counter() - start
    assert case.cell.clear(made.q).all()
    words = made.proof.statement.replace(";", "").replace(",", "").split()
    numbers = [int(w) for w in words if w.isdigit()]
    looked, vertices, motions, searches, measured, _ = numbers
    free, every_vertex = _sampled_vertices(case, rng, sample)
    every_edge = _sampled_edges(case, rng, sample, made.dt)
    row = [
        case.name, str(vertices), str(looked), str(measured), f"{100 * (1 - free):.0f} %",
        str(motions), str(searches), f"{lazy:.3g}", f"{alone:.3g}", f"{every_vertex:.3g}",
        f"{every_edge:.3g}",
    ]  # fmt: skip
    return row, f"{case.name}: {vertices / measured:.0f} x fewer poses measured than there are"


def _sampled_vertices(case: _Case, rng: np.random.Generator, sample: int) -> tuple[float, float]:
    """Return the share of clear vertices, and the seconds that all of them would take."""
    q = case.graph.q[rng.integers(0, len(case.graph.q), sample)]
    start = perf_counter()
    clear = case.cell.clear(q)
    return float(clear.mean()), (perf_counter() - start) / sample * len(case.graph.q)


def _sampled_edges(case: _Case, rng: np.random.Generator, sample: int, dt: float) -> float:
    """Return the seconds that all edges within the velocity limit would take."""
    velocity, _ = case.robot.speed_limits()
    start = case.graph.start
    k = rng.integers(0, len(start) - 2, 400 * sample)
    p = rng.integers(start[k], start[k + 1])
    j = rng.integers(start[k + 1], start[k + 2])
    total = int((np.diff(start)[:-1] * np.diff(start)[1:]).sum())
    dq = np.abs(case.cell.increments(case.graph.q[p], case.graph.q[j]))
    near = (dq <= velocity * dt).all(axis=1)
    p, j = p[near][:sample], j[near][:sample]
    if not len(p):
        return float("nan")
    began = perf_counter()
    clear = case.cell.clear(case.graph.q[p]) & case.cell.clear(case.graph.q[j])
    case.cell.clear_motion(case.graph.q[p[clear]], case.graph.q[j[clear]])
    return (perf_counter() - began) / len(p) * float(near.mean()) * total


def _wave(quick: bool) -> _Case:
    arm, tool, placement = _arm.arm(), _arm.tool(), _arm.placement()
    contour = _arm.wave(40 if quick else 200)
    t = np.linspace(-0.9, 0.9, 61)
    skin = np.c_[0.449 * np.sin(t), 0 * t, 0.449 * np.cos(t)]
    rim = np.vstack([skin, 0.9 * skin[::-1]])
    side = np.array([0.0, 0.5, 0.0])
    ends = np.vstack([rim - side, rim + side])
    part = Mesh(vertices=ends, triangles=_prism(len(rim)), name="shell")
    post = box_between([1.03, -0.02, 0.8], [1.07, 0.02, 1.2])
    return _case("wave", contour, arm, 0.02, tool, placement, np.pi / 18, part, {"post": post})


def _prism(m: int) -> Ints:
    """Return the triangles of a prism over a strip of m corners, there and back again."""
    a = np.arange(m)
    b = np.roll(a, -1)
    sides = np.vstack([np.c_[a, b, b + m], np.c_[a, b + m, a + m]])
    i = np.arange(m // 2 - 1)
    lid = np.vstack([np.c_[i, m - 1 - i, i + 1], np.c_[i + 1, m - 1 - i, m - 2 - i]])
    return np.vstack([sides, lid, lid[:, ::-1] + m])


def _demo(quick: bool) -> _Case:
    job = read_job(Path(str(files("kerfpath.demo") / "b_pillar.toml")))
    arm = robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000]), endless=[0, 0, 0, 1, 0, 1]
    )
    drawn = read_drawing(Path(str(files("kerfpath.demo") / "b_pillar.step")))
    vertices, triangles = welded(*drawn.mesh(2e-4), 1e-6)
    part = Mesh(vertices=vertices, triangles=triangles, deviation=2e-4, name="b_pillar.step")
    contour = drawn.contour("skin/outer").resample(spacing=4e-3)
    fixtures = {
        "table": box_between([0.9, -0.8, -0.1], [1.8, 0.8, 0.3]),
        "post": box_between([0.75, -0.25, 0.0], [0.85, -0.15, 1.1]),
    }
    step = np.radians(4 if quick else 1)
    return _case("demo trim", contour, arm, 4 / 60, job.tool, job.placement, step, part, fixtures)


def _case(
    name: str, contour: Contour, arm: Robot, speed: float, tool: Array, placement: Array,
    step: float, part: Mesh, fixtures: Mapping[str, Shape],
) -> _Case:  # fmt: skip
    graph = layered_graph(contour, arm, tool=tool, placement=placement, gamma_step=step)
    cell = cell_of(
        arm, tool=tool, head=CuttingHead(stand_off=2e-3), part=part, placement=placement,
        fixtures=fixtures, near_miss=5e-3,
    )  # fmt: skip
    return _Case(
        name=name, contour=contour, robot=arm, speed=speed, tool=tool, placement=placement,
        gamma_step=step, graph=graph, cell=cell,
    )  # fmt: skip
