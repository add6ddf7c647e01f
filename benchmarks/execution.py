"""What joints need between the nodes where a controller rounds corners: narrow and wide zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks._certified import in_processes
from benchmarks._figures import Report, Sheet
from benchmarks._random_contours import ROBOTS, cut
from kerfpath import NoFeasiblePath, plan
from kerfpath.execution import executed
from kerfpath.post import Zone, build_program

__all__ = ["run", "zones_of_cut"]

COUNTS = (134, 133, 133)
"""Cuts of each robot."""
PROCESSES = 2
BEYOND = 0.2
"""rad: plans may end at a joint limit, where no tool backs off; the programs here may go beyond."""
ZONES: tuple[Zone, ...] = (0.0003, "auto")
COLUMNS = (
    "zones",
    "robot",
    "plans",
    "at nodes",
    "as run",
    "95 %",
    "worst",
    "velocity over",
    "over",
    "tip mm",
)
HOW = """\
The random contours of `continuum_random`, planned over continuous gamma, as programs with zones of
0.3 mm and with automatic ones. At nodes: the highest share of an acceleration limit that the plan
needs from node to node, median over plans. As run: the highest in the motion of
`kerfpath.execution`, where a controller rounds the corners at constant acceleration; median, 95 %
and worst. Over: plans that need more than the full limit of velocity or acceleration there, so that
a controller would slow down. Tip: by how much it passes a node at most."""


class Peaks(NamedTuple):
    """Of one plan with one kind of zones: shares of limits, and by how much nodes are passed, m."""

    robot: str
    zone: Zone
    nodes: float
    velocity: float
    acceleration: float
    missed: float


def run(*, quick: bool) -> list[Report]:
    """Measure them."""
    counts = (3, 3, 3) if quick else COUNTS
    keys = [(name, i) for name, count in zip(ROBOTS, counts, strict=True) for i in range(count)]
    made = in_processes(zones_of_cut, keys, 1 if quick else PROCESSES)
    return [_report([peaks for each in made for peaks in each], len(keys))]


def zones_of_cut(key: tuple[str, int]) -> list[Peaks]:
    """Plan a cut, and return what its program needs with each kind of zones."""
    drawn = cut(*key)
    try:
        made = plan(
            drawn.contour, drawn.robot, tool=drawn.tool, placement=np.eye(4), speed=drawn.speed,
            certify=None,
        )  # fmt: skip
    except NoFeasiblePath:
        return []
    limits = drawn.robot.joint_limits()
    wider = drawn.robot.with_limits(lower=limits.lower - BEYOND, upper=limits.upper + BEYOND)
    made, found = replace(made, robot=wider), []
    for zone in ZONES:
        (one,) = executed(build_program([made], zone=zone))
        found.append(
            Peaks(
                key[0],
                zone,
                float(made.criteria.peak_acceleration.max()),
                one.peak_velocity.share,
                one.peak_acceleration.share,
                one.missed,
            )
        )
    return found


def _report(made: Sequence[Peaks], cuts: int) -> Report:
    rows = [
        _row(
            zone, name, [each for each in made if each.zone == zone and name in (each.robot, "all")]
        )
        for zone in ZONES
        for name in (*ROBOTS, "all")
    ]
    return Report(
        title=f"Between the nodes: {cuts} random contours",
        how=HOW,
        sheets=[Sheet(columns=COLUMNS, rows=rows)],
        findings=[],
    )


def _row(zone: Zone, name: str, made: Sequence[Peaks]) -> tuple[str, ...]:
    said = zone if zone == "auto" else f"{zone * 1e3:g} mm"
    if not made:
        return (said, name, "0", *"-------")
    nodes, acceleration = (
        np.array([getattr(p, k) for p in made]) for k in ("nodes", "acceleration")
    )
    return (
        said,
        name,
        str(len(made)),
        f"{np.median(nodes):.2f}",
        f"{np.median(acceleration):.2f}",
        f"{np.quantile(acceleration, 0.95):.2f}",
        f"{acceleration.max():.2f}",
        str(sum(p.velocity > 1 for p in made)),
        str(sum(p.acceleration > 1 for p in made)),
        f"{max(p.missed for p in made) * 1e3:.3f}",
    )
