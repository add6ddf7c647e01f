"""Collision checks: distances per second, lazy checking beside checking everything, whole maps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise, product
from time import perf_counter, process_time
from typing import TypeVar

import numpy as np

from benchmarks._boxes import with_collimator
from benchmarks._cells import Case, demo, wave
from benchmarks._dense import second_order_cost
from benchmarks._figures import Figure, Report, Sheet, in_turn
from benchmarks._scene import against_descartes
from kerfpath import Plan, robot
from kerfpath.arrays import Array, Bools, Ints
from kerfpath.auditor import checks
from kerfpath.cell import Cell
from kerfpath.planner import clearance_map

__all__ = ["run"]

T = TypeVar("T")

HOW = """\
Cells: robot links (wave: closed meshes of 2304 triangles each, made from capsules of the arm's
lengths; demo: capsules), the generic head (nozzle, body, arm), the part as a closed mesh, a table
and, in the way of the plan without a cell, a post; near-miss distance 5 mm. A configuration is one
joint vector with all judged pairs: "all distances" finds each exactly, "clear or not" stops where
bounds tell."""

LAZY = """\
`plan(cell=)` by method "exact", vertices and motions between them checked, second-order limits on;
with the layered graph given, and building it. Looked at: vertices that the search asked about;
measured: those at which any distance was computed. Every vertex: `Cell.clear` on a random sample of
the graph, its time scaled up to all of it; every edge: `Cell.clear_motion` on a random sample of
edges between clear vertices that keep the velocity limit, scaled up likewise. A task of 200 nodes x
10 degrees has taken Tesseract's Descartes 581 s with its edge checks on (one run, in a scene of its
own). Exhaustive: a smaller wave with every vertex and every edge checked and the brute second-order
recursion over what is clear. One run each."""

MAPS = """\
`planner.clearance_map`: each vertex clear or not, its clearance within 20 mm known to 2 mm, beside
`Cell.clear` on every pose: its distances and seconds on a random sample, scaled up to all poses.
The verdicts on the sample are compared."""

TOLD = """\
Arms of the library and a head made of boxes, one of which reaches behind the flange, at random
joint vectors within the limits. Link 5 ends 12 mm before the flange, at it, or 4 mm beyond; links
as meshes and as their hulls; near-miss distance 0. Whether boxes overlap, a formula says (fifteen
separating axes), beyond what a pair overlaps by design. Wrong: called clear, and overlaps. Lost:
refused, and no judged pair overlaps."""

AUDITS = """\
`auditor.checks(cell=)` of plans in a cell, eight samples and more of every interval: distances that
it asks the collision library for, and processor time. Every distance: judged pairs at the eight
samples of all intervals."""

VERDICTS = ("arm", "link 5 ends", "links", "poses", "called clear", "wrong", "lost")
ARMS = (
    "abb_irb2600_12_165", "abb_irb4600_60_205", "kuka_kr16_2", "fanuc_m710ic_50",
    "staubli_tx2_90", "yaskawa_gp25_12", "abb_irb1200_5_90", "kuka_kr60_ha",
)  # fmt: skip
ASKED = ("case", "nodes", "pairs", "every distance", "distances asked", "audit, CPU s")
COUNTS = ("case", "vertices", "closed", "looked at", "measured", "motions", "searches", "distances")
SECONDS = ("case, s", "lazy", "with graph", "search alone", "every vertex", "every edge")
MAPS_OF = (
    "case", "poses", "closed", "map: distances", "map s", "one by one: distances", "one by one s",
    "fewer", "faster",
)  # fmt: skip


def run(*, quick: bool) -> list[Report]:
    """Measure distances, plans and maps."""
    degrees, sample = np.radians, 30 if quick else 1000
    cases = [
        wave(40 if quick else 200, degrees(10), meshes=True),
        demo(4e-3, degrees(4 if quick else 1)),
    ]
    small = None if quick else wave(24, degrees(30), meshes=True)
    whole = [wave(24, degrees(10), meshes=True)] if quick else [
        wave(400, degrees(2), meshes=True), demo(7.3e-3, degrees(2))
    ]  # fmt: skip
    return [
        _distances(cases, runs=2 if quick else 5),
        _lazy(cases, sample, small),
        _audits(cases),
        _maps(whole, 2 * sample),
        _verdicts(ARMS[:1] if quick else ARMS, 100 if quick else 1000),
        against_descartes(quick=quick),
    ]


def _distances(cases: list[Case], runs: int) -> Report:
    report = Report(title="Collision checks", how=HOW)
    for case in cases:
        rng = np.random.default_rng(1)
        q = case.graph.q[rng.integers(0, len(case.graph.q), 100)]
        calls: dict[str, Callable[[], object]] = {
            f"{case.name}: all distances": partial(case.cell.distances, q),
            f"{case.name}: clear or not": partial(case.cell.clear, q),
        }
        for what, seconds in in_turn(calls, runs).items():
            report.figures.append(
                Figure(what=what, values=[len(q) / s for s in seconds], unit="configurations/s")
            )
        report.findings.append(f"{case.name}: {len(case.cell.pairs)} judged pairs")
    return report


def _lazy(cases: list[Case], sample: int, small: Case | None) -> Report:
    report = Report(title="Plans in a cell: lazy checks beside all checks", how=LAZY)
    counts, seconds = [], []
    for case in cases:
        rng = np.random.default_rng(2)
        for cell in (None, case.cell):  # compile and load before the clock starts
            case.plan(cell=cell, graph=case.graph)
        blind_s, blind = _timed(partial(case.plan, cell=None, graph=case.graph))
        before = case.cell.queries
        lazy_s, made = _timed(partial(case.plan, cell=case.cell, graph=case.graph))
        distances = case.cell.queries - before
        cold_s, _ = _timed(partial(case.plan, cell=case.cell, graph=None))
        assert case.cell.clear(made.q).all()
        looked, vertices, motions, searches, measured = _told(made)
        free, every_vertex = _sampled_vertices(case, rng, sample)
        every_edge, edges = _sampled_edges(case, rng, sample // 5, made.dt)
        numbers = (looked, measured, motions, searches, distances)
        counts.append([case.name, str(vertices), f"{1 - free:.0%}", *map(str, numbers)])
        times = (lazy_s, cold_s, blind_s, every_vertex, every_edge)
        seconds.append([case.name, *(f"{t:.3g}" for t in times)])
        report.findings.append(
            f"{case.name}: {int((~case.cell.clear(blind.q)).sum())} nodes of the best path without "
            f"the cell collide; {vertices / looked:.0f} x fewer vertices looked at and "
            f"{vertices / measured:.0f} x fewer measured than there are; about {edges:.2g} edges "
            "within the velocity limit"
        )
    report.sheets.append(Sheet(columns=COUNTS, rows=counts))
    report.sheets.append(Sheet(columns=SECONDS, rows=seconds))
    if small is not None:
        report.findings.append(_exhaustive(small))
    return report


def _audits(cases: Sequence[Case]) -> Report:
    """Count the collision checks of the audit of a plan in a cell."""
    report, rows = Report(title="Audits in a cell", how=AUDITS), []
    for case in cases:
        made = case.plan(cell=case.cell, graph=case.graph)
        before, began = case.cell.queries, process_time()
        table = checks(made, cell=case.cell)
        seconds, asked = process_time() - began, case.cell.queries - before
        every = len(case.cell.pairs) * 8 * (len(made.q) - 1)
        rows.append([case.name, *map(str, (len(made.q), len(case.cell.pairs), every, asked)),
                     f"{seconds:.3g}"])  # fmt: skip
        near = next(check for check in table if check.code == "collision")
        report.findings.append(f"{case.name}: {near.title}")
    report.sheets.append(Sheet(columns=ASKED, rows=rows))
    return report


def _exhaustive(case: Case) -> str:
    """Compare the optimum of lazy checks with that of checking every vertex and edge."""
    lazy_s, made = _timed(partial(case.plan, cell=case.cell, graph=case.graph))
    velocity, acceleration = case.robot.speed_limits()
    q, start, began = case.graph.q, case.graph.start, perf_counter()
    clear, edges = case.cell.clear(q), 0
    passable = []
    for (a, b), (_, c) in pairwise(pairwise(start)):
        p, j = np.mgrid[a:b, b:c]
        dq = np.abs(case.cell.increments(q[p], q[j]))
        open_ = clear[p] & clear[j] & (dq <= velocity * made.dt + 1e-9).all(axis=2)
        edges += int(open_.sum())
        open_[open_] = case.cell.clear_motion(q[p[open_]], q[j[open_]])
        passable.append(open_)
    cost = second_order_cost(
        q, start, dt=made.dt, velocity=velocity, acceleration=acceleration,
        endless=case.robot.endless, weights=made.settings.weights, passable=passable,
    )  # fmt: skip
    seconds = perf_counter() - began
    return (
        f"{case.name}: all {len(q)} vertices and {edges} edges checked in {seconds:.3g} s, optimum "
        f"{cost:.12g}; lazily {lazy_s:.3g} s, {made.cost:.12g}"
    )


def _maps(cases: list[Case], sample: int) -> Report:
    report = Report(title="The whole collision map", how=MAPS)
    rows = []
    for case in cases:
        cell, q = case.cell, case.graph.q
        seconds, found = _timed(partial(clearance_map, case.graph, cell))
        some = np.random.default_rng(3).integers(0, len(q), sample)
        before = cell.queries
        each_s, clear = _timed(partial(cell.clear, q[some]))
        scale = found.poses / sample
        distances, each_s = (cell.queries - before) * scale, each_s * scale
        rows.append([
            case.name, str(found.poses), f"{(~found.clear).mean():.0%}",
            str(found.queries), f"{seconds:.3g}", f"{distances:.0f}", f"{each_s:.3g}",
            f"{distances / found.queries:.0f} x", f"{each_s / seconds:.0f} x",
        ])  # fmt: skip
        report.findings.append(
            f"{case.name}: {int((clear != found.clear[some]).sum())} of {sample} verdicts differ"
        )
    report.sheets.append(Sheet(columns=MAPS_OF, rows=rows))
    return report


def _verdicts(arms: Sequence[str], poses: int) -> Report:
    """Compare verdicts with a formula for boxes."""
    report, rows, wrong = Report(title="Verdicts beside a formula", how=TOLD), [], 0
    rng = np.random.default_rng(4)
    for name, gap, meshes in product(arms, (0.012, 0.0, -0.004), (False, True)):
        arm = robot(name)
        world = with_collimator(arm, gap=gap, behind=0.12)
        cell = Cell(
            chain=world.chain, bodies=tuple(world.bodies(meshes=meshes)), endless=arm.endless
        )
        limits = arm.joint_limits()
        found = world.verdicts(cell, rng.uniform(limits.lower, limits.upper, (poses, arm.joints)))
        wrong += found.wrong
        rows.append([
            name, f"{-gap * 1e3:g} mm", "meshes" if meshes else "hulls", str(poses),
            str(found.clear), str(found.wrong), str(found.lost),
        ])  # fmt: skip
    report.sheets.append(Sheet(columns=VERDICTS, rows=rows))
    report.findings.append(f"{wrong} of {len(rows) * poses} poses are wrongly called clear")
    return report


def _timed(call: Callable[[], T]) -> tuple[float, T]:
    start = perf_counter()
    answer = call()
    return perf_counter() - start, answer


def _told(made: Plan) -> tuple[int, int, int, int, int]:
    """Return the counts in the plan's proof."""
    words = made.proof.statement.replace(";", "").replace(",", "").split()
    looked, vertices, motions, searches, measured, *_ = (int(w) for w in words if w.isdigit())
    return looked, vertices, motions, searches, measured


def _sampled_vertices(case: Case, rng: np.random.Generator, sample: int) -> tuple[float, float]:
    """Return the share of clear vertices, and the seconds that all of them would take."""
    q = case.graph.q[rng.integers(0, len(case.graph.q), sample)]
    seconds, clear = _timed(partial(case.cell.clear, q))
    return float(clear.mean()), seconds / sample * len(case.graph.q)


def _sampled_edges(
    case: Case, rng: np.random.Generator, sample: int, dt: float
) -> tuple[float, float]:
    """Return the seconds that all edges within the velocity limit would take, and their number."""
    velocity, _ = case.robot.speed_limits()
    start = case.graph.start
    k = rng.integers(0, len(start) - 2, 400 * sample)
    p = rng.integers(start[k], start[k + 1])
    j = rng.integers(start[k + 1], start[k + 2])
    total = int((np.diff(start)[:-1] * np.diff(start)[1:]).sum())
    near = _within(case, p, j, velocity * dt)
    share = float(near.mean())
    p, j = p[near][:sample], j[near][:sample]
    if not len(p):
        return float("nan"), 0.0

    def check() -> None:
        clear = case.cell.clear(case.graph.q[p]) & case.cell.clear(case.graph.q[j])
        case.cell.clear_motion(case.graph.q[p[clear]], case.graph.q[j[clear]])

    return _timed(check)[0] / len(p) * share * total, share * total


def _within(case: Case, p: Ints, j: Ints, most: Array) -> Bools:
    dq = np.abs(case.cell.increments(case.graph.q[p], case.graph.q[j]))
    return np.asarray((dq <= most).all(axis=1))
