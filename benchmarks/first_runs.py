"""Jobs of drawings without any tuning: the share that becomes a program at the first run."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from OCP.Message import Message

from benchmarks._corpus import Known, corpus
from benchmarks._figures import Report, Sheet
from kerfpath.cad import Part, read
from kerfpath.errors import KerfpathError
from kerfpath.job import prepare, read_job, require_foreseen, result_texts, run_prepared

__all__ = ["run"]

JOBS = 30
LARGEST = 0.8
"""m: longer parts are left out, because an arm may not reach all of them."""
MOST_LOOPS, DOWN = 4, -0.7
"""Number of loops cut per drawing, the shortest; and the largest z of an axis that points down."""
TEMPLATE = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "cybertech_8_to_20kg"

[tool]
head = "laser-head-45"

[part]
file = "{file}"
placed_by = "centre"
xyz_mm = [1300, 0, 700]
rpy_deg = [0, 0, 0]
{options}
[program]
language = "rapid"

[plan]
certify = false
"""
CONTOUR = """
[[contour]]
pick = "{loop}"
speed_m_min = 3
spacing_mm = 2
"""
HOW = f"""\
{{count}} drawings of the corpus, of every family in turn, that a tool from above can cut. One
template: an arm of the library, a head, the middle of the part in front of the robot, the
{MOST_LOOPS} shortest loops that face up (of sheets those of the outer side) at 3 m/min and 2 mm, a
RAPID program, and what a drawing needs to be read: units, columns, axes. Everything else is as it
comes. A first run counts that passes every audit and writes its program."""


def run(*, quick: bool = False) -> Report:
    """Return how many jobs become programs, and why the others do not."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    count = 6 if quick else JOBS
    tried, written, reasons = Counter[str](), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory() as folder:
        for known, loops in islice(_in_turn(Path(folder)), count):
            tried[known.family] += 1
            reason = _reason(known, loops)
            written[known.family] += not reason
            if reason:
                reasons.append(f"{known.path.name}: {' '.join(reason.split())[:200]}")
    rows = [(family, str(written[family]), str(of)) for family, of in tried.items()]
    report = Report(
        title="Programs at the first run",
        how=HOW.format(count=count),
        sheets=[Sheet(columns=("family", "written", "of"), rows=rows, words=1)],
    )
    report.findings.append(f"{sum(written.values())} of {count} at the first run")
    report.findings.extend(reasons)
    return report


def _in_turn(folder: Path) -> Iterator[tuple[Known, list[str]]]:
    """Yield drawings that are within a robot's reach, and the loops to cut."""
    for known in corpus(folder, 8):
        part = read(known.path, **known.options)
        if np.ptp(part.bounding_box, axis=0).max() < LARGEST and (loops := _loops(part)):
            yield known, loops


def _reason(known: Known, loops: Sequence[str]) -> str:
    """Return why a job does not become a program at its first run, "" if it does."""
    path = known.path.with_suffix(".toml")
    options = "".join(f"{key} = {_toml(value)}\n" for key, value in known.options.items())
    path.write_text(
        TEMPLATE.format(file=known.path.name, options=options)
        + "".join(CONTOUR.format(loop=name) for name in loops)
    )
    try:
        prepared = prepare(read_job(path))
        require_foreseen(prepared)
        outcome = run_prepared(prepared)
        texts = result_texts(outcome)
    except KerfpathError as error:
        return str(error)
    if texts.program:
        return ""
    broken = [str(cut.broken) for cut in outcome.cuts if cut.broken is not None]
    failed = [f"{cut.name}: {c.issue()}" for cut in outcome.cuts for c in cut.checks if not c.ok]
    return next(iter([*broken, *failed, texts.refused, *texts.faults]))


def _loops(part: Part) -> list[str]:
    """Return the shortest loops that a tool from above can cut."""
    loops = [loop for loop in part.loops if loop.side != "inner" and loop.closed]
    loops = [loop for loop in loops if loop.kind != "open"] or list(part.loops)
    axes = [part.contour(loop.name, closed=False).axes.mean(axis=0) for loop in loops]
    down = [loop for loop, axis in zip(loops, axes, strict=True) if axis[2] < DOWN]
    return [loop.name for loop in sorted(down, key=lambda loop: loop.length)[:MOST_LOOPS]]


def _toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(each)}" for key, each in value.items()) + " }"
    return json.dumps(list(value) if isinstance(value, tuple) else value)
