"""Certificates of many kinds of plans, checked again by the audit."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks import _random_contours
from benchmarks._certified import in_processes
from benchmarks._figures import Report, Sheet
from kerfpath import (
    Band,
    Comfort,
    Contour,
    InputError,
    NoFeasiblePath,
    PlanOptions,
    Robot,
    fastest_speed,
    plan,
    robot,
)
from kerfpath.arrays import Array
from kerfpath.auditor import certified_bound
from kerfpath.cell import Mesh, box_between, cell_of
from kerfpath.certifier import certify
from kerfpath.search import Metric

__all__ = ["run"]

PLANS, FEW = 50, 5
PROCESSES = 2
STEP = np.radians(4.0)
"""Step of gamma; the plans are refined off it."""
SHARES = (0.2, 0.97)
"""Shares of the fastest speed: wide windows of (5) and narrow ones."""
METRICS: tuple[Metric, ...] = ("manhattan", "manhattan", "euclid", "manhattan", "chebychev")
KINDS = ("arc", "arc", "random", "random", "cobot")
COLUMNS = (
    "plans",
    "with",
    "certified",
    "refused",
    "gap median %",
    "gap worst %",
    "certificate s",
    "audit s",
    "audit worst s",
)
HOW = f"""\
Arcs on a dome (IRB 4600), the random contours of the comparison of methods (three robots), and arcs
of a cobot without endless joints, 15 to 60 nodes, at {SHARES[0]:g} to {SHARES[1]:g} of the fastest
speed; three metrics; a fourth each as they are, with what comfort costs, periodic where closed, and
in a cell. Every plan is certified for others to check, asked for 0.5 %, and its certificate is
proved again by the audit. Refused: the audit proves less than is stated, or nothing. Seconds:
medians but for the last, processes of one thread, two at a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Audited:
    """The result for one plan; no gap if there is no plan."""

    index: int
    kind: str
    extra: str
    gap: float | None = None
    why: str = ""
    certificate_seconds: float = 0.0
    audit_seconds: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Task:
    """A contour in front of a robot."""

    contour: Contour
    robot: Robot
    tool: Array
    placement: Array


def run(*, quick: bool) -> list[Report]:
    """Measure them."""
    keys = list(range(FEW if quick else PLANS))
    made = in_processes(_audited, keys, 1 if quick else PROCESSES)
    certified = [each for each in made if each.gap is not None]
    rows = [
        _row(kind, extra, [e for e in made if (e.kind, e.extra) == (kind, extra)])
        for kind, extra in sorted({(e.kind, e.extra) for e in made})
    ]
    return [
        Report(
            title=f"Certificates proved again: {len(keys)} plans",
            how=HOW,
            sheets=[Sheet(columns=COLUMNS, rows=[*rows, _row("all", "", made)], words=2)],
            findings=[f"refused: {sum(bool(each.why) for each in certified)} of {len(certified)}"]
            + [f"plan {each.index} ({each.kind}): {each.why}" for each in certified if each.why],
        )
    ]


def _row(kind: str, extra: str, made: Sequence[_Audited]) -> tuple[str, ...]:
    gaps = [100 * each.gap for each in made if each.gap is not None]
    audits = [each.audit_seconds for each in made if each.gap is not None]
    if not gaps:
        return (kind, extra, "0", *["-"] * (len(COLUMNS) - 3))
    return (
        kind,
        extra,
        str(len(gaps)),
        str(sum(bool(each.why) for each in made)),
        f"{median(gaps):.2f}",
        f"{max(gaps):.2f}",
        f"{median(e.certificate_seconds for e in made if e.gap is not None):.3g}",
        f"{median(audits):.3g}",
        f"{max(audits):.3g}",
    )


def _audited(index: int) -> _Audited:
    """Plan, certify and audit one task."""
    rng = np.random.default_rng([7, index])
    kind = KINDS[index % len(KINDS)]
    metric = METRICS[(index // len(KINDS) + index) % len(METRICS)]
    task, share = _drawn(kind, rng), rng.uniform(*SHARES)
    extra, more, there = "", dict[str, Any](), None
    wanted = (index // len(KINDS)) % 4
    if wanted == 1:
        extra, band = "comfort", Band(margin=np.radians(2), width=np.radians(20), cost=0.3)
        more = {"comfort": Comfort(wrist=band)}
    elif wanted == 2 and task.contour.closed:
        extra, more = "periodic", {"closure": "periodic"}
    elif wanted == 3 and kind == "arc":
        extra = "cell"
        slab = box_between([-0.3, -0.3, -0.08], [0.3, 0.3, -0.05])
        there = cell_of(
            task.robot,
            tool=task.tool,
            part=Mesh(vertices=slab.points, triangles=slab.triangles),
            placement=task.placement,
            fixtures={},
            near_miss=2e-3,
            may_touch=[("link 3", "arm")],
        )
    space: dict[str, Any] = {"tool": task.tool, "placement": task.placement}
    made = None
    with suppress(NoFeasiblePath):
        fastest = fastest_speed(task.contour, task.robot, gamma_step=STEP, **space)
        options = PlanOptions(gamma_step=STEP, metric=metric, certify=None, **more)
        made = plan(
            task.contour, task.robot, speed=share * fastest.speed, options=options, cell=there,
            **space,
        )  # fmt: skip
    if made is None:
        return _Audited(index=index, kind=kind, extra=extra)
    start = perf_counter()
    proof = certify(made, gap=0.005, checkable=True).plan.proof
    certified, why = perf_counter(), ""
    assert proof.certificate is not None
    assert proof.bound is not None
    try:
        proved = certified_bound(proof.certificate, made)
        if proved < proof.bound:
            why = f"proves {proved:.6g} of {proof.bound:.6g}"
    except InputError as error:
        why = str(error)
    return _Audited(
        index=index,
        kind=kind,
        extra=extra,
        gap=proof.gap,
        why=why,
        certificate_seconds=certified - start,
        audit_seconds=perf_counter() - certified,
    )


def _drawn(kind: str, rng: np.random.Generator) -> _Task:
    if kind == "random":
        machine = _random_contours.arm(list(_random_contours.ROBOTS)[int(rng.integers(3))])
        assert machine.reach is not None
        drawn = _random_contours.contour(rng, machine.reach)
        nodes = drawn.resample(count=int(rng.integers(30, 60)))
        return _Task(
            contour=nodes, robot=machine, tool=_random_contours.head(), placement=np.eye(4)
        )
    tool, placement = np.eye(4), np.eye(4)
    if kind == "cobot":
        machine = robot("ur_ur10e").with_limits(
            lower=np.radians([-170] * 5 + [-360]),
            upper=np.radians([170] * 5 + [360]),
            acceleration=np.full(6, 15.0),
        )
        tool[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.8, 0.6], [0.0, -0.6, 0.8]]
        tool[:3, 3] = [0, 0.05, 0.1]
        placement[:3, 3] = [0.6, 0.2, 0.2]
        nodes = _arc(rng, rng.uniform(1.0, 3.0), (0.05, 0.12), 0.0, (15, 30))
        return _Task(contour=nodes, robot=machine, tool=tool, placement=placement)
    machine = robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000]), endless=[0, 0, 0, 1, 0, 1]
    )
    nodes = _arc(rng, rng.uniform(1.0, 3.8), (0.05, 0.2), 0.4, (20, 50))
    placement[:3, 3] = [1.2 + rng.uniform(-0.2, 0.2), rng.uniform(-0.4, 0.4), 0.4]
    return _Task(contour=nodes, robot=machine, tool=_random_contours.head(), placement=placement)


def _arc(
    rng: np.random.Generator,
    end: float,
    radii: tuple[float, float],
    lean: float,
    nodes: tuple[int, int],
) -> Contour:
    """Return part of a circle on a dome, up to `end` rad; `lean` bounds the tangent of the lean."""
    t, r, leant = np.linspace(0, end, 2001), rng.uniform(*radii), rng.uniform(0, lean)
    points = np.c_[r * np.cos(t), r * np.sin(t), 0.02 * rng.uniform() * np.cos(2 * t)]
    axes = np.c_[-leant * np.cos(t), -leant * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, name="arc").resample(count=int(rng.integers(*nodes)))
