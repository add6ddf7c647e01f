"""Run the lessons of the tutorials, and write into the page what their commands print.

    python docs/_ext/lessons.py [pictures]

Lines of prose are wrapped, and what was shown before is left out. With `pictures` the pages that
the lessons make are photographed, too, in the installed Chromium.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import wrap

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "tutorials.md"
DRAWINGS = [ROOT / "examples" / "parts" / name for name in ("bracket.step", "beam.step")]
BLOCK = re.compile(r"^```(toml|console)\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.DOTALL | re.M)
"""A file or commands, and what the commands print."""
WIDTH, WIDEST = 118, 140
"""Most characters of a line of prose, and of a row of a table."""
SHOTS = {
    "lesson-report.png": ("hole/report.html", "Part and contours", 760),
    "lesson-executed.png": ("hole/report.html", "Executed path", 980),
    "lesson-pareto.png": ("front/pareto.html", "Criteria in pairs", 760),
}
"""The pictures: the page of each, the heading at its top, and its height, px."""
Run = Callable[[list[str], Path], tuple[int, str]]
"""Runs the words of a command in a folder; returns its exit code and what it prints."""


def played(page: str, folder: Path, run: Run) -> Iterator[tuple[re.Match[str], str]]:
    """Do all lessons in a folder; yield each block of commands, with what they print."""
    seen = set[str]()
    for drawing in DRAWINGS:
        shutil.copy(drawing, folder)
    for block in BLOCK.finditer(page):
        if block[1] == "toml":
            write_job(folder, block[2])
            continue
        printed = ""
        for line in block[2].splitlines():
            if "edited.mod" in line:
                edit_program(folder)
            command, _, code = line.partition("# exit ")
            got, said = run(command.split()[2:], folder)
            if got != int(code or 0):
                raise SystemExit(f"{line}: exit code {got}, expected {int(code or 0)}")
            printed += said.replace(f"{folder}/", "")
        yield block, shortened(printed, seen)


def write_job(folder: Path, text: str) -> None:
    """Write the file that a block names, after the one that it goes on from."""
    found = re.match(r"# (\S+\.toml)(?:, after (\S+\.toml))?\n", text)
    assert found is not None, text
    name, before = found.groups()
    whole = (folder / before).read_text() + "\n" + text if before else text
    (folder / name).write_text(whole)


def edit_program(folder: Path) -> None:
    """Lift the target of line 53 by 3 mm, as the last lesson says."""
    lines = (folder / "hole" / "hole.mod").read_text().splitlines(keepends=True)
    assert lines[52].count(",0.0000],[") == 1
    lines[52] = lines[52].replace(",0.0000],[", ",3.0000],[")
    (folder / "edited.mod").write_text("".join(lines))


def shortened(printed: str, seen: set[str]) -> str:
    """Return a text without checks that passed and prose that was `seen` before, both as "...".

    Long lines of prose are wrapped; rows of wide tables are drawn together.
    """
    lines = list[str]()
    for line in map(str.rstrip, printed.splitlines()):
        is_table = "  " in line.strip()
        if line.endswith("  ok") or (line in seen and not is_table):
            lines += [] if lines[-1:] == ["..."] else ["..."]
        elif is_table or not line.strip():
            lines.append(re.sub(" {4,}", "   ", line) if len(line) > WIDEST else line)
        else:
            lines += wrap(line, WIDTH, break_on_hyphens=False)
        seen.add(line)
    return "\n".join(lines).rstrip() + "\n"


def _run(words: list[str], folder: Path) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "kerfpath", *words], cwd=folder, capture_output=True, text=True
    )
    print(" ".join(words), done.returncode, done.stderr if done.returncode == 2 else "")
    return done.returncode, done.stdout


def _photograph(folder: Path) -> None:
    from playwright.sync_api import sync_playwright

    switches = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=switches)
        for name, (page, heading, height) in SHOTS.items():
            view = browser.new_page(
                viewport={"width": 1100, "height": height}, color_scheme="light"
            )
            view.goto((folder / page).as_uri())
            top = view.get_by_text(heading, exact=True).first
            top.evaluate("at => scrollTo(0, scrollY + at.getBoundingClientRect().top - 24)")
            view.wait_for_timeout(8000)
            view.screenshot(path=ROOT / "docs" / name)


def main() -> None:
    """Write the page again."""
    page, parts, end = PAGE.read_text(encoding="utf-8"), list[str](), 0
    with tempfile.TemporaryDirectory() as work:
        for block, printed in played(page, Path(work), _run):
            shown = f"```console\n{block[2]}```\n\n```text\n{printed}```\n"
            parts += [page[end : block.start()], shown]
            end = block.end()
        if "pictures" in sys.argv[1:]:
            _photograph(Path(work))
    PAGE.write_text("".join([*parts, page[end:]]), encoding="utf-8")


if __name__ == "__main__":
    main()
