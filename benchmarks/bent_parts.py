"""Random bent parts: the share of which every through hole is listed once, from outside."""

from __future__ import annotations

from collections import Counter

import numpy as np
from OCP.Message import Message

from benchmarks._bent_parts import FAMILIES, BentPart, Hole, bent_part
from benchmarks._figures import Report, Sheet
from kerfpath.cad import Part, read
from kerfpath.errors import InputError

__all__ = ["faults_of", "run"]

SEEDS = 715
"""Number of parts of each family: 5005 in all."""
BROKEN = 0.5e-3
"""Largest width (m) of broken edges, by which a hole may be listed wider than it is."""
THICK = 6e-3
"""Largest thickness (m): on which side a hole is listed is known where a part has no outer one."""

HOW = """\
{count} parts, {seeds} of each family: sheets with 1 to 3 bends to one side or to both, tubes of
rectangular, hexagonal and L-shaped section, drawn pans, I beams, plates with a rib, and sheets
with all edges rounded; inner radii of bends from 0, outer ones from 0. Holes go through, end
halfway, or have a countersink or counterbore outside, inside or on both sides. Right is a part of
which `pick(kind="inner", side="outer")` gives every hole that goes through once, with its tool axis
from outside and its countersink named, and nothing else."""


def run(*, quick: bool = False) -> Report:
    """Return how many parts of each family are read right."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    seeds = 10 if quick else SEEDS
    right, holes, faults = Counter[str](), Counter[str](), list[str]()
    for family in FAMILIES:
        for seed in range(seeds):
            made = bent_part(family, seed)
            fault = faults_of(made)
            right[family] += not fault
            holes[family] += len(made.holes)
            if fault:
                faults.append(f"{family} {seed}: {fault}")
    rows = [(family, str(right[family]), str(seeds), str(holes[family])) for family in FAMILIES]
    report = Report(
        title="Sides of bent parts",
        how=HOW.format(count=seeds * len(FAMILIES), seeds=seeds),
        sheets=[Sheet(columns=("family", "right", "of", "holes"), rows=rows, words=1)],
    )
    report.findings.append(f"{right.total()} of {seeds * len(FAMILIES)} are right")
    report.findings.extend(faults[:20])
    return report


def faults_of(made: BentPart) -> str:
    """Return how the holes that are picked differ from those of a part, "" if they do not."""
    part = read(made.shape)
    try:
        picked = part.pick(kind="inner", side="outer")
    except InputError:
        picked = ()
    left = list(picked)
    for hole in made.holes:
        found = [loop for loop in left if _is(part, loop.name, hole)]
        if len(found) != 1:
            return f"a hole at {hole.at.round(1).tolist()} mm is listed {len(found)} times"
        if bool(found[0].countersink) != hole.sunk:
            return f"{found[0].name}: its countersink is {found[0].countersink!r}"
        left.remove(found[0])
    if left:
        return f"{left[0].name} is no hole to cut"
    return ""


def _is(part: Part, name: str, hole: Hole) -> bool:
    contour = part.contour(name)
    points = contour.points[:-1]
    middle, radius = points.mean(axis=0), hole.radius * 1e-3
    way = contour.axes.mean(axis=0)
    off = middle - hole.at * 1e-3
    facing = float(way @ -hole.outward)
    if hole.either:
        is_there = np.linalg.norm(off - (off @ hole.outward) * hole.outward) < 1e-4
        is_there = is_there and abs(off @ hole.outward) < THICK + 1e-4
        is_facing = abs(facing) > 0.99
    else:
        is_there, is_facing = np.linalg.norm(off) < 1e-4, facing > 0.99
    own = float(np.linalg.norm(points - middle, axis=1).mean())
    return bool(is_there and is_facing and -1e-5 < own - radius < BROKEN)
