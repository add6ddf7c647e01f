"""Nests: flat sheets of many outlines with holes, planned end to end; processor time and memory.

``python -m benchmarks.nests OUTLINES...`` plans nests of so many outlines alone and prints their
rows.
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter, process_time

from ezdxf.filemanagement import new

from benchmarks._figures import Figure, Report, peak_megabytes
from kerfpath.job import read_job, run_job
from kerfpath.job.output.writing import write_result

__all__ = ["run", "write_nest"]

SIZES = (4, 20, 34, 86)
"""Numbers of outlines; with their holes the last three have 47, 80 and 201 contours."""
PITCH = 60.0, 50.0
"""Distances between the outlines along x and y, mm."""
COLUMNS = 20
JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-90"
[part]
file = "nest.dxf"
xyz_mm = [900, -600, 300]
rpy_deg = [0, 0, 0]
[[contour]]
speed_m_min = 3
spacing_mm = 2
[contour.lead_in]
length_mm = 2
[contour.pick_all]
layer = "0"
[plan]
gamma_step_deg = 5
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
[program]
name = "nest"
pierce_time_s = 0.3
"""
HOW = """\
Outlines of four or five corners, each with one hole and every third with two, in rows before an IRB
4600, without a cell, the kernels compiled before: drawing read, contours planned, ordered, audited
and certified, all files written. Processor seconds of this process and those beside it, since the
machine may be loaded; the shares of the others are given. Order: how far it may be from the best,
by its bound."""


def write_nest(path: Path, outlines: int, seed: int = 0) -> int:
    """Write a nest as DXF; return its number of contours."""
    size, drawing, count = random.Random(seed), new(units=4), 0
    space = drawing.modelspace()
    for k in range(outlines):
        x, y = k % COLUMNS * PITCH[0], k // COLUMNS * PITCH[1]
        w, h = size.uniform(36, 52), size.uniform(30, 42)
        top = [(x + w, y + 0.6 * h), (x + 0.7 * w, y + h)] if k % 2 else [(x + w, y + h)]
        space.add_lwpolyline([(x, y), (x + w, y), *top, (x, y + h)], close=True)
        space.add_circle((x + 0.3 * w, y + 0.35 * h), size.uniform(3, 6))
        if k % 3 == 0:
            space.add_circle((x + 0.62 * w, y + 0.4 * h), size.uniform(2.5, 4))
        count += 3 if k % 3 == 0 else 2
    drawing.saveas(path)
    return count


def run(*, quick: bool = False) -> Report:
    """Return processor time, memory and cycle of nests of several sizes."""
    report = Report(title="Nests", how=HOW)
    with tempfile.TemporaryDirectory() as folder:
        _planned(Path(folder), 2)  # compiled
        for outlines in SIZES[:1] if quick else SIZES:
            report.figures.append(_planned(Path(folder), outlines))
    return report


def _planned(folder: Path, outlines: int) -> Figure:
    count, said = write_nest(folder / "nest.dxf", outlines), list[str]()
    (folder / "nest.toml").write_text(JOB, encoding="ascii")

    def whole() -> None:
        outcome = run_job(read_job(folder / "nest.toml"))
        write_result(outcome, folder / "out")
        said.append("passed" if outcome.passed else "FAILED")
        if outcome.part is None:
            said.append("no order")
            return
        cycle, order = outcome.part.cycle_time, outcome.part.order
        apart = 100 * (1 - order.at_least / order.duration)
        gaps = [1.0 if plan.proof.gap is None else plan.proof.gap for plan in outcome.plans]
        said.append(f"cycle {cycle:.1f} s, order within {apart:.2f} %")
        said.append(f"motions within {100 * sum(gaps) / len(gaps):.0f} % on average")

    start, clock, others = process_time(), perf_counter(), _of_others()
    peak = peak_megabytes(whole)
    others = _of_others() - others
    took, clock = process_time() - start + others, perf_counter() - clock
    note = (
        f"{took / count:.2f} s for each, {others:.0f} s beside, {clock:.0f} s by the clock, "
        f"{peak / 1e3:.1f} GB, {', '.join(said)}"
    )
    return Figure(what=f"{count} contours", values=[took], note=note)


def _of_others() -> float:
    """Return the processor time of the processes that this one has started and that have ended."""
    used = getrusage(RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        _planned(Path(name), 2)  # compiled
        for given in sys.argv[1:]:
            row = _planned(Path(name), int(given))
            print(f"{row.what}: {row.values[0]:.1f} s, {row.note}", flush=True)
