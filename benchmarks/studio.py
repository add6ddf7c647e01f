"""The studio: time from start to the first picture and from a slider to a new course, memory."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from websockets.sync.client import ClientConnection, connect

from benchmarks._figures import Figure, Report

__all__ = ["run"]

HOW = """\
`kerfpath studio` as a process of its own, the page's side in this one, over its WebSocket; a
browser draws beside it. Start: of the demo job, from the command to the first scene (robot and
head), to the scene with the part, and to the first plan; kernels compiled before. Slider: the trim
line of the demo in 400 nodes, gamma every degree, on a kept graph; a weight is moved by 4 % a step,
the next step once the course of the last one has come, as JSON that has been read. Draft: what
comes at once. Plan: what a run finds once the slider rests, less the 0.3 s that it waits. Processor
time: of the server and its children; on a machine that others use, too, it says more than the
clock. Random edits: of the step of gamma and of a share of the limits, every tenth left to rest."""

STARTS, STEPS, RESTS, EDITS = 3, 60, 6, 150
PATIENCE = 0.3
"""s: waiting time of a run after the last change."""
TICKS = os.sysconf("SC_CLK_TCK")


class _Page:
    """A server and the client end of its WebSocket."""

    def __init__(self, process: subprocess.Popen[str], socket: ClientConnection) -> None:
        self.process, self._socket, self.revision = process, socket, 1

    def edit(self, path: list[str | int], value: object) -> None:
        """Change one key of the job."""
        self.revision += 1
        message = {"type": "edit", "path": path, "value": value, "gesture": "benchmark"}
        self._socket.send(json.dumps(message))

    def until(self, fits: Callable[[Any], bool]) -> Any:
        """Return the next message that fits."""
        while True:
            message = json.loads(self._socket.recv())
            if fits(message):
                return message

    def rests(self) -> None:
        """Wait until nothing is being computed."""
        self.until(lambda m: m["type"] == "outcome" and m["revision"] == self.revision)
        self.until(lambda m: m["type"] == "progress" and not m["busy"])

    @property
    def processor(self) -> float:
        """Processor time of the server and its children so far, s."""
        own = _fields(self.process.pid)
        children = [
            fields
            for place in Path("/proc").iterdir()
            if place.name.isdigit()
            and (fields := _fields(int(place.name)))
            and int(fields[1]) == self.process.pid
        ]
        return sum(int(f[11]) + int(f[12]) for f in [own, *children]) / TICKS

    @property
    def megabytes(self) -> float:
        """Resident memory of the server, MB."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) / 1024


def _fields(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:  # it has ended
        return []


@contextmanager
def _studio(job: Path) -> Iterator[_Page]:
    command = [sys.executable, "-m", "kerfpath", "studio", str(job), "--port", "0", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.findall(r"http://(\S+)", process.stdout.readline())[0]
        with connect(
            f"ws://{address.replace('/?', '/ws?')}", max_size=None, open_timeout=60
        ) as socket:
            yield _Page(process, socket)
        process.kill()


def _start(job: Path) -> tuple[list[float], list[float]]:
    """Return the seconds, and the processor time, until the scenes and the first plan."""
    seconds, processor, begun = [], [], perf_counter()
    with _studio(job) as page:
        for fits in (
            lambda m: m["type"] == "scene",
            lambda m: m["type"] == "scene" and m["contours"],
            lambda m: m["type"] == "plan",
        ):
            page.until(fits)
            seconds.append(perf_counter() - begun)
            processor.append(page.processor)
    return seconds, processor


def _slide(page: _Page, weights: list[float], steps: int) -> tuple[Figure, Figure, str]:
    """Move a weight, and return the time until its course arrived."""
    seconds, processor, drafts = [], [], 0
    for step in range(steps):
        up = 1 if step // 15 % 2 == 0 else -1
        weights[0] *= 1.04**up
        before, begun = page.processor, perf_counter()
        page.edit(["plan", "weights"], weights)
        made = page.until(lambda m: m["type"] == "plan" and m["revision"] == page.revision)
        seconds.append(perf_counter() - begun)
        processor.append(page.processor - before)
        drafts += made["checks"] is None
    late = float(np.quantile(seconds, 0.95))
    said = f"{drafts} of {steps} courses were drafts; 95 % came within {late:.2f} s"
    return (
        Figure(what="slider to new course, 400 nodes", values=seconds),
        Figure(what="the same, processor time", values=processor),
        said,
    )


def _rest(page: _Page, weights: list[float], rests: int) -> tuple[Figure, str]:
    """Return the time of plans once the slider rests, and the distance of drafts from them."""
    seconds, above = [], []
    for step in range(rests):
        page.rests()
        weights[step % 6] *= 1.5
        begun = perf_counter()
        page.edit(["plan", "weights"], weights)
        draft = page.until(lambda m: m["type"] == "plan" and m["revision"] == page.revision)
        made = draft
        while made["checks"] is None:
            made = page.until(lambda m: m["type"] == "plan" and m["revision"] == page.revision)
        seconds.append(perf_counter() - begun - PATIENCE)
        above.append(100 * (draft["cost"] / made["cost"] - 1))
    page.rests()
    said = f"after a weight is half as much again, drafts cost {max(above):.1f} % more at most"
    return Figure(what="plan once it rests", values=seconds), said


def _memory(page: _Page, edits: int) -> str:
    """Report the effect of random edits on the memory of the server."""
    rng, levels, step = np.random.default_rng(0), [], 1
    for k in range(edits):
        if rng.random() < 0.3:
            step = step % 6 + 1  # a different step: an edit without a change makes no revision
            page.edit(["plan", "gamma_step_deg"], float(step))
        else:
            page.edit(["plan", "eta_velocity"], float(rng.uniform(0.8, 1.0)))
        if k % 10 == 9:
            page.rests()
            levels.append(page.megabytes)
    half = len(levels) // 2
    first, second = (float(np.median(part)) for part in (levels[:half], levels[half:]))
    return (
        f"{edits} random edits: resident memory {first:.0f} MB in the first half, {second:.0f} MB "
        "in the second"
    )


def run(*, quick: bool = False) -> Report:
    """Start studios, move their sliders and measure the response."""
    share = 10 if quick else 1
    with tempfile.TemporaryDirectory() as folder:
        for name in ("b_pillar.toml", "b_pillar.step"):
            shutil.copy(str(files("kerfpath") / "demo" / name), folder)
        demo = Path(folder) / "b_pillar.toml"
        starts = [_start(demo) for _ in range(1 if quick else STARTS)]
        text = demo.read_text()
        head, plan = text[: text.index("# Inner")], text[text.index("[plan]") :]
        trim = '[[contour]]\npick = "skin/outer"\nname = "trim"\nspeed_m_min = 9\ncount = 400\n\n'
        plan = plan.replace("path_tolerance_mm = 0.1 ", "path_tolerance_mm = 5 ")
        job = Path(folder) / "trim.toml"
        job.write_text(head + trim + plan.replace("[plan]", "[plan]\ncertify = false"))
        with _studio(job) as page:
            said = page.until(lambda m: m["type"] == "job" and m["contours"])
            weights = list(said["weights"])
            page.rests()
            slid, processor, courses = _slide(page, weights, STEPS // share)
            rested, above = _rest(page, weights, 2 if quick else RESTS)
            memory = _memory(page, 20 if quick else EDITS)
    seconds, processors = zip(*starts, strict=True)
    what = ["start to first scene", "start to the scene with the part", "start to the first plan"]
    figures = [
        Figure(what=words + how, values=[times[i] for times in taken])
        for how, taken in (("", seconds), (", processor time", processors))
        for i, words in enumerate(what)
    ]
    return Report(
        title="The studio",
        how=HOW,
        figures=[*figures, slid, processor, rested],
        findings=[courses, above, memory],
    )
