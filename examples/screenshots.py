"""Take screenshots of the pages in the documentation: report, studio, layout and Pareto set.

    python examples/screenshots.py [report] [studio] [layout] [pareto]

The command that users run makes each page from the shipped B-pillar, and the installed Chromium
opens it. Report and studio take a minute or two, the layout ten minutes, and the Pareto set, every
second plan of which is over continuous rotation, up to half an hour on two cores.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

DOCS = Path(__file__).resolve().parents[1] / "docs"
DEMO = Path(__file__).resolve().parents[1] / "src" / "kerfpath" / "demo"
CHROMIUM = "/usr/bin/chromium"
SWITCHES = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PLANNED = """() => {
    if (!window.studio) return false;
    const { job, plans, progress, outcome } = studio.store;
    if (!job || progress.busy || !studio.view.ready) return false;
    const found = [...plans.values()].flat();
    return found.length === job.contours.length && found.every((plan) => plan.passed);
}"""
"""Whether every contour of the studio's job has an audited plan."""


def run(*words: str, folder: Path) -> None:
    """Run a kerfpath command in a folder."""
    subprocess.run([sys.executable, "-m", "kerfpath", *words], cwd=folder, check=True)


def opened(browser: Browser, url: str, width: int, height: int) -> Page:
    """Return a light page of the given size, px, with its figures drawn."""
    page = browser.new_page(viewport={"width": width, "height": height}, color_scheme="light")
    page.goto(url)
    page.wait_for_timeout(4000)
    return page


def report(browser: Browser, folder: Path) -> None:
    """Show the top of the demo's report."""
    run("demo", "--out", ".", folder=folder)
    page = opened(browser, (folder / "report.html").as_uri(), 1280, 1200)
    page.screenshot(path=DOCS / "report.png")


def studio(browser: Browser, folder: Path) -> None:
    """Show the studio with the demo."""
    for name in ("b_pillar.toml", "b_pillar.step"):
        shutil.copy(DEMO / name, folder)
    words = ["studio", "b_pillar.toml", "--port", "0", "--no-browser"]
    server = subprocess.Popen(
        [sys.executable, "-m", "kerfpath", *words], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    try:
        assert server.stdout is not None
        (address,) = re.findall(r"http://\S+", server.stdout.readline())
        page = opened(browser, address, 1600, 900)
        page.wait_for_function(PLANNED, timeout=300_000)
        page.get_by_text("trim", exact=True).first.click()
        page.wait_for_timeout(8000)
        page.screenshot(path=DOCS / "studio.png")
    finally:
        server.terminate()
        server.wait()


def layout(browser: Browser, folder: Path) -> None:
    """Show the contours and the map of the demo's layout."""
    for name in ("b_pillar_layout.toml", "b_pillar.step"):
        shutil.copy(DEMO / name, folder)
    run("layout", "b_pillar_layout.toml", "--out", "placed", folder=folder)
    page = opened(browser, (folder / "placed" / "layout.html").as_uri(), 1280, 900)
    page.screenshot(path=DOCS / "layout.png", full_page=True)


def pareto(browser: Browser, folder: Path) -> None:
    """Show the Pareto set of the demo's trim line."""
    for name in ("b_pillar.toml", "b_pillar.step"):
        shutil.copy(DEMO / name, folder)
    run("pareto", "b_pillar.toml", "--contour", "trim", "--runs", "200", folder=folder)
    page = opened(browser, (folder / "b_pillar-pareto" / "pareto.html").as_uri(), 1100, 900)
    page.screenshot(path=DOCS / "pareto.png", full_page=True)


PICTURES: dict[str, Callable[[Browser, Path], None]] = {
    "report": report,
    "studio": studio,
    "layout": layout,
    "pareto": pareto,
}

if __name__ == "__main__":
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=list(SWITCHES))
        for name in sys.argv[1:] or PICTURES:
            with tempfile.TemporaryDirectory() as work:
                PICTURES[name](chromium, Path(work))
            print(f"docs/{name}.png")
