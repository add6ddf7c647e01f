"""What is printed can be read in a narrow terminal, and progress is told where there is none."""

import io
import json
import shutil
import time
from contextlib import redirect_stderr, redirect_stdout

import numpy as np
import pytest

from commands import run
from jobs import DEMO, SMALL
from kerfpath import plan
from kerfpath.cli import show as show_module
from kerfpath.cli.show import merge_notes, progress_bars, sweep_bar, table

LONG = ["a hole whose name is quite long", "outer trim line, upper half", "slot/7"]


@pytest.fixture(params=[80, 120])
def width(request, monkeypatch):
    monkeypatch.setattr(show_module.out, "_width", request.param)
    return request.param


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("show")
    shutil.copy(DEMO / "b_pillar.step", folder)
    text = SMALL.replace('name = "hole 10"', f'name = "{LONG[0]}"')
    assert text != SMALL
    (folder / "job.toml").write_text(text)
    tight = text.replace("path_tolerance_mm = 0.1", "axis_tolerance_deg = 0.001")
    (folder / "tight.toml").write_text(tight)
    (folder / "coarse.toml").write_text(text.replace("spacing_mm = 1", "spacing_mm = 3"))
    assert run("plan", "job.toml", "--out", "out", cwd=folder).returncode == 0
    return folder


def shown(text):
    """The text without folds and spaces, as an eye puts it together."""
    return "".join(text.split())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plan", "tight", "audit", "speed", "check"])
def test_names_and_verdicts_are_there_at_any_width(folder, width, name):
    arguments = {
        "plan": ("plan", "job.toml", "--out", "out"),
        "tight": ("plan", "tight.toml", "--out", "tight"),
        "audit": ("audit", "out/plan.json"),
        "speed": ("speed", "coarse.toml"),
        "check": ("check", "job.toml"),
    }[name]
    result = run(*arguments, cwd=folder)
    assert result.returncode == (name == "tight"), result.stderr
    lines = result.stdout.splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith(LONG[0].split()[0]))
    row = lines[first]
    if name == "audit":
        rows = [line for line in lines if line.rstrip().endswith(" ok")]
        assert len(rows) > 8
        assert all(len(line) <= width for line in rows)
        return
    assert len(row) <= width
    folded = [line[: len(LONG[0]) + 1] for line in lines[first : first + 4]]
    words = shown(" ".join(part.split("  ")[0] for part in folded))
    assert words.startswith(shown(LONG[0])), folded
    if name in ("plan", "tight"):
        assert row.rstrip().endswith("passed" if name == "plan" else "FAILED")
    if name == "speed":
        assert "joint" in row


def test_a_table_leaves_columns_out_before_it_hides_what_matters(width):
    columns = ["contour", *(f"figure {i}" for i in range(9)), "audit"]
    rows = [[name, *(["1234.56"] * 9), "no feasible path"] for name in LONG]
    out = io.StringIO()
    with redirect_stdout(out):
        table(columns, rows, numbers=columns[1:-1], whole=["audit"], spare=columns[-2:2:-1])
    lines = out.getvalue().splitlines()
    kept = [line for line in lines if line.rstrip().endswith("no feasible path")]
    assert len(kept) == len(LONG)
    assert max(map(len, kept)) <= width
    assert kept[0].count("1234.56") >= 3
    assert ("no room for: figure 8" in lines[-1]) == (kept[0].count("1234.56") < 9)


def test_headings_are_folded_only_where_that_makes_room(monkeypatch):
    def heads(width):
        monkeypatch.setattr(show_module.out, "_width", width)
        out = io.StringIO()
        with redirect_stdout(out):
            table(columns, rows, numbers=columns[1:3])
        return out.getvalue().split("a.toml")[0].rstrip()

    columns = ["job", "cutting s", "time in all s", "program, or why there is none"]
    rows = [["a.toml", "1.25", "3.5", "word " * 60]]
    assert heads(200).split() == " ".join(columns).split()
    assert "\n" not in heads(200)
    folded = heads(60).splitlines()
    assert len(folded) == 4
    assert columns[3] in folded[-1]


def test_a_table_of_very_many_rows_reads_as_one_of_few(monkeypatch):
    def lines(count):
        out = io.StringIO()
        with redirect_stdout(out):
            table(["loop", "length mm", "ends"], rows[:count], numbers=["length mm"])
        return [line.rstrip() for line in out.getvalue().splitlines()]

    names = ["hole \\[1]", "[bold]trim[/bold]", "\u5b54", "a:smile:b"]
    rows = [[names[i % 4], f"{2.0**i:.1f}", "open"] for i in range(8)]
    monkeypatch.setattr(show_module.out, "_width", 200)
    few = lines(8)
    monkeypatch.setattr(show_module, "_MANY", 8)
    assert lines(8) == few
    monkeypatch.setattr(show_module.out, "_width", 8)  # nothing is cut off
    assert lines(8) == few


def test_equal_notes_are_merged():
    notes = [f"warning: at {i} of 33 targets it is too large (hole {i})" for i in range(30)]
    told = merge_notes(["something else", *notes, "more 1"], [f"hole {i}" for i in range(30)])
    assert told == ["something else", notes[0] + " (and 29 more like it; the report has all)",
                    "more 1"]  # fmt: skip


def test_notes_that_differ_in_signs_are_merged():
    notes = [f"hole_{i}: at x = {(-1) ** i * i}.5 mm" for i in range(3)]
    assert merge_notes(notes) == [notes[0] + " (and 2 more like it; the report has all)"]


def test_without_a_terminal_lines_tell_what_is_being_done(monkeypatch):
    monkeypatch.setattr(show_module, "LINE_SECONDS", 0.02)
    said = io.StringIO()
    with redirect_stderr(said), progress_bars() as progress:
        progress("trim", 3, 9)
        time.sleep(0.1)
        progress("trim: refinement", 0, 0)
        time.sleep(0.1)
    assert "kerfpath: trim, 3 of 9 nodes (0 s)\n" in said.getvalue()
    assert "kerfpath: trim: refinement (0 s)\n" in said.getvalue()
    monkeypatch.setattr(show_module.quiet, "is_set", lambda: True)
    said = io.StringIO()
    with redirect_stderr(said), progress_bars() as progress:
        progress("trim", 3, 9)
        time.sleep(0.1)
    assert said.getvalue() == ""


def test_an_estimate_that_was_too_low_is_not_repeated(monkeypatch):
    now = 0.0
    monkeypatch.setattr(show_module, "LINE_SECONDS", 0.02)
    monkeypatch.setattr(show_module, "monotonic", lambda: now)
    said = io.StringIO()
    with redirect_stderr(said), progress_bars() as progress:
        progress("trim", 0, 4)
        now = 10.0
        progress("trim", 1, 4)
        time.sleep(0.1)
        now = 25.0
        time.sleep(0.1)
        now = 60.0
        time.sleep(0.1)
    assert "kerfpath: trim, 1 of 4 nodes, about 30 s left (10 s)\n" in said.getvalue()
    assert "kerfpath: trim, 1 of 4 nodes, about 15 s left (25 s)\n" in said.getvalue()
    assert "kerfpath: trim, 1 of 4 nodes (60 s)\n" in said.getvalue()


def test_quiet_is_an_option_of_every_command(monkeypatch):
    assert run("--quiet", "robots", "--json").returncode == 0
    assert show_module.quiet.is_set()
    assert run("robots", "--json").returncode == 0
    assert not show_module.quiet.is_set()


def test_bars_have_their_phases(monkeypatch):
    terminal = io.StringIO()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(show_module.errors, "_force_terminal", True)
    monkeypatch.setattr(show_module.errors, "is_interactive", True)
    with redirect_stderr(terminal), progress_bars() as progress:
        progress("trim", 9, 9)
        progress("trim: search", 0, 0)
        time.sleep(0.3)
        progress("trim: refinement", 0, 0)
        time.sleep(0.3)
    for words in ("9/9 nodes", "trim: search", "trim: refinement"):
        assert words in terminal.getvalue()
    with redirect_stderr(terminal), sweep_bar("runs") as progress:
        progress("tasks", 2, 9)
        progress("tasks", 3, 9)
        time.sleep(0.3)
    for words in ("runs done", "3/9 runs", " left"):
        assert words in terminal.getvalue()


def test_a_plan_tells_its_phases(circle, arm, tool, placement):
    told = []
    options = {"tool": tool, "placement": placement, "speed": 0.1, "gamma_step": np.radians(6)}
    plan(circle, arm, method="exact", phase=told.append, **options)
    assert told == ["search"]
    plan(circle, arm, phase=told.append, **options)
    assert told == ["search", "search", "refinement"]


def test_nothing_is_said_of_compiling_where_nothing_is_compiled(folder):
    result = run("check", "job.toml", "--json", cwd=folder)
    assert json.loads(result.stdout)
    assert "compiling" not in result.stderr
