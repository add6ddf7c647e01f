"""A corpus of drawings with known loops: the share that is read correctly."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from OCP.Message import Message

from benchmarks._corpus import Known, corpus
from benchmarks._figures import Report, Sheet
from kerfpath.cad import Part, read
from kerfpath.errors import InputError

__all__ = ["faults_of", "run"]

SEEDS = 8
"""Number of drawings of each family and format: 136 in all."""
LENGTH = 1e-6
"""Tolerance of a loop's length, as a share of it: files keep at least 7 digits of coordinates
hundreds of mm from the origin."""

HOW = """\
{count} drawings from a generator, {seeds} of each family: rectangles and circles within each
other, grids of touching rectangles, slots in rows of blocks, open lines (DXF); drilled plates,
tubes, plates that touch (STEP, and IGES as loose faces), lines in space (STEP, IGES, DXF);
tables with usual, odd and no headers. Lines come in any order and direction, bodies lie anyhow,
units are mm, cm, m and in. Read right is a drawing of which unit, the kind and the length of
every loop, and the loops on either side of sheets are as known, and of which nothing that may
have been to cut is left out."""


def run(*, quick: bool = False) -> Report:
    """Return how many drawings of each family and format are read correctly."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    all_of, right, faults = Counter[tuple[str, str]](), Counter[tuple[str, str]](), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        for known in corpus(Path(folder), 1 if quick else SEEDS):
            what = known.family, known.path.suffix[1:].upper()
            all_of[what] += 1
            fault = faults_of(known)
            right[what] += not fault
            if fault:
                faults.append(f"{known.path.name}: {fault}")
    rows = [(*what, str(right[what]), str(count)) for what, count in all_of.items()]
    total = sum(all_of.values())
    report = Report(
        title="Drawings read right",
        how=HOW.format(count=total, seeds=1 if quick else SEEDS),
        sheets=[Sheet(columns=("family", "format", "right", "of"), rows=rows, words=2)],
    )
    report.findings.append(f"{sum(right.values())} of {total} are read right")
    report.findings.extend(faults)
    return report


def faults_of(known: Known) -> str:
    """Return how a drawing as read differs from what is known of it, "" if it does not."""
    try:
        part = read(known.path, **known.options)
    except InputError as error:
        return str(error)
    if part.unit != known.unit:
        return f"unit {part.unit}, not {known.unit}"
    if any(each.may_cut for each in part.left_out):
        return str(part.left_out[0])
    found, wanted = _loops_of(part), sorted(known.loops)
    if [kind for kind, _ in found] != [kind for kind, _ in wanted]:
        return f"loops {Counter(k for k, _ in found)}, not {Counter(k for k, _ in wanted)}"
    lengths = np.array([[a, b] for (_, a), (_, b) in zip(found, wanted, strict=True)])
    if (np.abs(lengths[:, 0] - lengths[:, 1]) > LENGTH * lengths[:, 1]).any():
        return f"lengths {lengths[:, 0].round(4).tolist()}, not {lengths[:, 1].round(4).tolist()}"
    for side in ("outer", "inner"):
        count = sum(loop.side == side for loop in part.loops)
        if count != known.sides:
            return f"{count} loops on {side} sides, not {known.sides}"
    return ""


def _loops_of(part: Part) -> list[tuple[str, float]]:
    """Return kind and length (mm) of each loop, of single faces if there are any."""
    loops = [loop for loop in part.loops if loop.surface != "skin"]
    return sorted((str(loop.kind), loop.length * 1e3) for loop in loops)
