"""The files of a run belong together; commands say so in one line where they do not."""

import os
import shutil

import pytest

from commands import assert_refused, run
from jobs import DEMO, SMALL


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory):
    """Files of a run, and those of the run of the same job at another speed that replaced them."""
    folder = tmp_path_factory.mktemp("runs")
    shutil.copy(DEMO / "b_pillar.step", folder)
    kept = {}
    for name, speed in (("before", "2"), ("after", "3")):
        text = SMALL.replace("[plan]", "[plan]\ncertify = false")
        (folder / "small.toml").write_text(
            text.replace("speed_m_min = 3", f"speed_m_min = {speed}")
        )
        result = run("plan", "small.toml", "--out", "out", cwd=folder)
        assert result.returncode == 0, result.stderr
        kept[name] = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
    return folder, kept


@pytest.fixture
def folder(two_runs):
    """The folder of the job, with the files of its last run."""
    folder, kept = two_runs
    shutil.rmtree(folder / "out")
    (folder / "out").mkdir()
    for name, content in kept["after"].items():
        (folder / "out" / name).write_bytes(content)
    return folder


READERS = {
    "audit of the plan": "audit out/plan.json --job small.toml",
    "audit of the plan alone": "audit out/plan.json",
    "audit of the program": "audit out/small.mod --job small.toml",
    "post": "post out/plan.json -o posted.mod",
    "compare": "compare out/small.mod out/small.mod --job small.toml",
    "touch-up": "touch-up out/small.mod --job small.toml --plan out/plan.json --out touched",
}


@pytest.mark.slow
@pytest.mark.parametrize("stale", ["small.mod", "plan.json", "report.html", "trajectory.csv"])
def test_who_reads_a_folder_says_which_file_is_left_of_an_earlier_run(stale, folder, two_runs):
    (folder / "out" / stale).write_bytes(two_runs[1]["before"][stale])
    for words in READERS.values():
        assert_refused(run(*words.split(), cwd=folder), f"out/{stale} is left of an earlier run")
    assert run("plan", "small.toml", "--out", "out", cwd=folder).returncode == 0
    assert run(*READERS["audit of the program"].split(), cwd=folder).returncode == 0


@pytest.mark.slow
def test_an_edited_program_is_audited_and_an_old_one_elsewhere_too(folder, two_runs):
    program = folder / "out" / "small.mod"
    text = program.read_text()
    program.write_text(text.replace("ENDMODULE", "! checked by the night shift\nENDMODULE"))
    assert run(*READERS["audit of the program"].split(), cwd=folder).returncode == 0
    assert run(*READERS["audit of the plan"].split(), cwd=folder).returncode == 0
    lines = text.splitlines(keepends=True)
    moves = [line for line in lines if "MoveL" in line]
    program.write_text("".join(line for line in lines if line not in moves[8:16]))
    assert run(*READERS["audit of the program"].split(), cwd=folder).returncode == 1
    (folder / "elsewhere").mkdir(exist_ok=True)
    old = folder / "elsewhere" / "small.mod"
    old.write_bytes(two_runs[1]["before"]["small.mod"])
    result = run("audit", old, "--job", "small.toml", cwd=folder)
    assert result.returncode == 1, result.stderr  # of another speed


WRITERS = {
    "plan": ["plan.json", "trajectory.csv", "report.html", "small.mod", ".kerfpath.json"],
    "pareto": ["pareto.json", "pareto.html"],
    "layout": ["layout.json", "layout.html", "placed.toml"],
    "layout --robots": ["robots.json", "robots.html"],
}


@pytest.mark.parametrize(
    ("command", "name"), [(command, name) for command in WRITERS for name in WRITERS[command]]
)
def test_what_is_no_file_is_not_replaced(command, name, tmp_path, monkeypatch):
    """It is refused before any work is done."""

    def begun(*arguments, **options):
        pytest.fail("the work has begun")

    monkeypatch.setattr("kerfpath.cli.plan_output.prepare", begun)
    monkeypatch.setattr("kerfpath.cli.study_output.compile_kernels", begun)
    shutil.copy(DEMO / "b_pillar.step", tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    (tmp_path / "out").mkdir()
    path, precious = tmp_path / "out" / name, tmp_path / "precious"
    precious.write_text("precious")
    for put in (os.mkfifo, lambda path: path.symlink_to(precious), os.mkdir):
        path.unlink(missing_ok=True)
        put(path)
        words = command.split()
        result = run(words[0], "small.toml", *words[1:], "--out", "out", cwd=tmp_path)
        assert_refused(result, f"out/{name}: it is a")
        assert [each.name for each in (tmp_path / "out").iterdir()] == [name]
        assert precious.read_text() == "precious"
