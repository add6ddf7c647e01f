"""The studio for a long time: random gestures in a browser, and many pages that change one job."""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from websockets.sync.client import connect

from benchmarks._figures import Figure, Report

if TYPE_CHECKING:
    from playwright.sync_api import CDPSession, Page

__all__ = ["Gestures", "Served", "browser_page", "many_pages", "run", "two_holes"]

HOW = """\
`kerfpath studio` as a process of its own on two holes of the demo. Gestures: whatever is on the
page and can be used, chosen at random with a fixed seed: buttons, sliders, numbers, choices, folds,
points of the scene, the map and the Pareto set; the job goes back to its first text every 15 s. Not
used: what saves or exports. The heap of the page is measured after its garbage has been collected,
the server by its resident memory; medians of the second and of the last quarter. Pages: 20
connections to one server, each changes a share of the limits once a second and waits for no
answer."""

MINUTES, PAGES, PAGE_MINUTES = 10.0, 20, 5.0
WARM = 15
"""s: time limit for the first plans."""
SWITCHES = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
SWITCHES += ["--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
USED = """() => {
    const root = document.querySelector('dialog[open]') ?? document;
    const kinds = 'button, input, select, summary, canvas';
    const kept = '#save, #export, #export-menu *, #text-apply, [data-endless]';
    window.usable = [...root.querySelectorAll(kinds)].filter((each) =>
        !each.disabled && !each.matches(kept) && each.getClientRects().length > 0);
    return window.usable.map((each) => each.tagName === 'INPUT' ? each.type : each.tagName);
}"""
ACT = """([index, share]) => {
    const it = window.usable[index];
    const say = (kind) => it.dispatchEvent(new Event(kind, { bubbles: true }));
    if (it.tagName === 'SELECT') {
        it.selectedIndex = Math.floor(share * it.options.length);
        say('change');
    } else if (it.type === 'range') {
        it.value = String(Number(it.min) + share * (Number(it.max) - Number(it.min)));
        say('input');
        say('change');
    } else if (it.type === 'number') {
        it.value = String(Number(((Number(it.value) || 1) * (0.8 + 0.4 * share)).toPrecision(4)));
        say('change');
    } else if (it.type === 'search') {
        it.value = share < 0.5 ? '' : ['lead', 'gamma', 'margin'][Math.floor(6 * share) - 3];
        say('input');
    } else if (it.type !== 'text') it.click();
}"""
PLACE = """(index) => {
    const it = window.usable[index];
    it.scrollIntoView({ block: 'nearest' });
    const { left, top, width, height } = it.getBoundingClientRect();
    return [left, top, width, height];
}"""
KEYS = ("Space", "ArrowLeft", "ArrowRight", "Shift+ArrowRight", "f", "Escape", "Control+z")


class Served:
    """`kerfpath studio` in a separate process."""

    def __init__(self, job: Path) -> None:
        command = [sys.executable, "-m", "kerfpath", "studio", str(job), "--port", "0"]
        self.process = subprocess.Popen(
            [*command, "--no-browser"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        self.address = re.findall(r"http://(\S+)", line)[0]  # with its token
        self.socket = f"ws://{self.address.replace('/?', '/ws?')}"
        self.said: list[str] = []
        self._reading = Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.said.extend(self.process.stdout)

    @property
    def megabytes(self) -> float:
        """Resident memory, MB."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) / 1024

    def stop(self) -> None:
        """Stop the process."""
        self.process.terminate()
        self.process.wait(timeout=30)
        self._reading.join()
        assert self.process.stdout is not None
        self.process.stdout.close()


class Gestures:
    """Random gestures on a page of the studio, and their effects.

    Parameters
    ----------
    page : Page
        A page of Playwright, on the studio.
    seed : int
    """

    def __init__(self, page: Page, seed: int) -> None:
        self._page, self._random = page, random.Random(seed)
        self.wrong: list[str] = []
        self.count = 0
        self.heap: list[float] = []
        self.server: list[float] = []
        page.on("pageerror", lambda fault: self.wrong.append(str(fault)))
        page.on("console", lambda m: self.wrong.append(m.text) if m.type == "error" else None)

    def go_on(self, seconds: float, served: Served, text: str, *, samples: int) -> None:
        """Make gestures; measure memory and restore the job `samples` times.

        Parameters
        ----------
        seconds : float s
        served : Served
            The server.
        text : str
            Text of the job.
        samples : int
        """
        session = self._page.context.new_cdp_session(self._page)
        begun = monotonic()
        for sample in range(1, samples + 1):
            while monotonic() - begun < seconds * sample / samples:
                self.one()
            self._page.evaluate("() => document.querySelector('dialog[open]')?.close()")
            send = "(text) => studio.connection.send({ type: 'text', text })"
            self._page.evaluate(send, text)
            self._page.wait_for_timeout(1000)
            self.heap.append(_heap(session))
            self.server.append(served.megabytes)

    def one(self) -> None:
        """Make one gesture."""
        page, rng = self._page, self._random
        self.count += 1
        if rng.random() < 0.1:
            page.keyboard.press(rng.choice(KEYS))
            return
        kinds = page.evaluate(USED)
        if not kinds:
            return
        index = rng.randrange(len(kinds))
        if kinds[index] == "CANVAS":
            self._point(page.evaluate(PLACE, index))
        else:
            page.evaluate(ACT, [index, rng.random()])
        page.wait_for_timeout(rng.choice((5, 20, 60, 200)))

    def _point(self, box: list[float]) -> None:
        """Point, click, drag or turn the wheel on a canvas."""
        mouse, rng = self._page.mouse, self._random
        left, top, width, height = box
        places = [(left + rng.random() * width, top + rng.random() * height) for _ in range(2)]
        mouse.move(*places[0])
        what = rng.random()
        if what < 0.4:
            mouse.click(*places[0])
        elif what < 0.7:
            mouse.down()
            mouse.move(*places[1], steps=4)
            mouse.up()
        elif what < 0.8:
            mouse.wheel(0, rng.choice((-200, 200)))


def _heap(session: CDPSession) -> float:
    """Return the heap of the page after a garbage collection, MB."""
    session.send("HeapProfiler.collectGarbage")
    return float(session.send("Runtime.getHeapUsage")["usedSize"]) / 1e6


@contextmanager
def browser_page(address: str) -> Iterator[Page]:
    """Yield a page on the studio in a separate browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=SWITCHES)
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(f"http://{address}")
        yield page
        browser.close()


def many_pages(served: Served, *, pages: int, seconds: float, seed: int) -> list[str]:
    """Let many pages change a job; return what went wrong, also in the server."""
    wrong: list[str] = []
    end = monotonic() + seconds

    def work(number: int) -> None:
        rng = np.random.default_rng([seed, number])
        try:
            with connect(served.socket, max_size=None, open_timeout=60) as socket:
                while monotonic() < end:
                    share = float(rng.uniform(0.8, 1.0))
                    key = "eta_velocity" if rng.random() < 0.5 else "eta_acceleration"
                    edit: dict[str, Any] = {"type": "edit", "path": ["plan", key], "value": share}
                    socket.send(json.dumps(edit))
                    _hear(socket, wrong, min(end, monotonic() + rng.uniform(0.5, 1.5)))
        except Exception as error:  # a thread's error is the benchmark's finding
            wrong.append(f"page {number}: {type(error).__name__}: {error}")

    threads = [Thread(target=work, args=(number,)) for number in range(pages)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return wrong


def _hear(socket: Any, wrong: list[str], until: float) -> None:
    """Read the messages of the server for a while."""
    while (left := until - monotonic()) > 0:
        try:
            message = json.loads(socket.recv(timeout=left))
        except TimeoutError:
            return
        if message["type"] == "error":
            wrong.append(message["message"])


def _levels(values: list[float]) -> tuple[float, float]:
    """Return the medians of the second and of the last quarter; the first is for warming up."""
    quarter = max(1, len(values) // 4)
    return float(np.median(values[quarter : 2 * quarter])), float(np.median(values[-quarter:]))


def two_holes(folder: Path) -> Path:
    """Write a job of two holes of the demo, without certificates, and return its path."""
    demo, path = files("kerfpath") / "demo", folder / "job.toml"
    head, _, rest = (demo / "b_pillar.toml").read_text().partition("[plan]")
    first, *tables = head.split("[[contour]]")
    holes = "".join(f"[[contour]]{table}" for table in tables[3:5])
    rest = rest.replace("gamma_step_deg = 1", "gamma_step_deg = 3")
    path.write_text(f"{first}{holes}[plan]\ncertify = false{rest}")
    (folder / "b_pillar.step").write_bytes((demo / "b_pillar.step").read_bytes())
    return path


def run(*, quick: bool = False) -> Report:
    """Use a studio for a long time, and report the effects."""
    share = 0.1 if quick else 1.0
    with tempfile.TemporaryDirectory() as folder:
        job = two_holes(Path(folder))
        text = job.read_text()
        served = Served(job)
        try:
            with browser_page(served.address) as page:
                page.wait_for_timeout(WARM * 1000)
                gestures = Gestures(page, seed=0)
                gestures.go_on(60 * MINUTES * share, served, text, samples=int(40 * share))
            before = served.megabytes
            wrong = many_pages(served, pages=PAGES, seconds=60 * PAGE_MINUTES * share, seed=0)
            after = served.megabytes
        finally:
            served.stop()
    heap, server = _levels(gestures.heap), _levels(gestures.server)
    faults = [line.strip() for line in served.said if re.match(r"[\w.]+(Error|Exception)\b", line)]
    return Report(
        title="The studio, for a long time",
        how=HOW,
        figures=[
            Figure(what="heap of the page", values=gestures.heap, unit="MB"),
            Figure(what="resident memory of the server", values=gestures.server, unit="MB"),
        ],
        findings=[
            f"{gestures.count} gestures; {len(gestures.wrong)} exceptions in the page "
            f"{sorted(set(gestures.wrong))[:3]}",
            f"heap of the page {heap[0]:.1f} MB, later {heap[1]:.1f}; "
            f"server {server[0]:.0f} MB, later {server[1]:.0f}",
            f"{PAGES} pages: {len(wrong)} errors {sorted(set(wrong))[:3]}; server "
            f"{before:.0f} MB before, {after:.0f} after; {len(faults)} faults in its terminal "
            f"{sorted(set(faults))[:3]}",
        ],
    )
