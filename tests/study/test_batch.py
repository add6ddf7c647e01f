"""Batches: a row for each job whatever comes of it, nothing planned twice, files as of a plan."""

import errno
import json
import os
import shutil
import sqlite3
from contextlib import closing

import pytest

from commands import assert_refused, run
from jobs import SLIT_JOB, write_slit_jobs
from kerfpath.errors import InputError
from kerfpath.post import MANIFEST
from kerfpath.study import batch
from kerfpath.sweep import workers as processes
from kerfpath.sweep.store import Store

# Paths of the grid, which turn as far as the comments say.
SLIT = SLIT_JOB.replace("[plan]", '[plan]\nmethod = "exact"\ncertify = false')
FAST = SLIT.replace("speed_m_min = 2", "speed_m_min = 900", 1)
# Axis 6 has room beyond 360 deg only, which Status and Turn of KRL cannot say.
RANGES = """[robot]
lower_deg = [-180, -90, -180, -400, -125, 365]
upper_deg = [180, 150, 75, 400, 120, 395]
"""
JOBS = {
    "good": SLIT,
    "fast": FAST,
    "misspelt": SLIT.replace("gamma_step", "gama_step"),
    "unknown": SLIT.replace('pick = "b"', 'pick = "c"'),
    "mute": SLIT.replace("[robot]\n", RANGES) + '[program]\nlanguage = "krl"\n',
    "foreign": SLIT + '[program]\nlanguage = "urscript"\n',
    "dry": SLIT + '[program]\nlanguage = "none"\n',
}
FILES = {"good.mod", "plan.json", "trajectory.csv", "report.html"}


@pytest.fixture
def idle(monkeypatch):
    """Let no worker process start."""

    def none(*_):
        raise AssertionError("a process was started")

    monkeypatch.setattr(processes, "get_context", none)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("batch")
    names = write_slit_jobs(folder, JOBS)
    command = ["batch", *names, "gone.toml", "--out", "out", "--processes", 1, "--json"]
    result = run(*command, cwd=folder)
    assert result.returncode == 1, result.stderr
    return folder, command, json.loads(result.stdout)


def rows_of(told):
    return {row["job"].removesuffix(".toml"): row for row in told["jobs"]}


def test_each_job_has_its_row_with_what_came_of_it(done):
    _, command, told = done
    assert [row["job"] for row in told["jobs"]] == command[1:9]
    assert not told["passed"]
    rows = rows_of(told)
    assert {name for name, row in rows.items() if row["passed"]} == {"good", "dry"}
    # 30 mm at 2 m/min, twice.
    assert rows["good"]["cutting_time_s"] == pytest.approx(1.8)
    assert rows["good"]["program"] == "good.mod"
    assert rows["good"]["reason"] is None
    assert rows["dry"]["program"] is None
    assert [rows["fast"][key] for key in ("contours", "contours_passed")] == [2, 1]
    assert rows["fast"]["cutting_time_s"] is None
    reasons = {
        "fast": "; contour 'a': on this grid of the rotation no admissible edge",
        "misspelt": "plan.gama_step_deg: expected a key of [plan]",
        "unknown": "'c'",
        "mute": "can express no angle of joint 6",
        "foreign": "program.language: ",
        "gone": "gone.toml: no such file",
    }
    assert all(said in rows[name]["reason"] for name, said in reasons.items())
    assert all("\n" not in rows[name]["reason"] for name in reasons)
    # What would help comes first.
    assert rows["fast"]["reason"].startswith("a: on this grid of the rotation a path exists up to ")


@pytest.mark.slow
def test_files_are_those_of_a_plan_in_a_folder_of_the_jobs_name(done):
    folder, _, told = done
    rows = rows_of(told)
    assert {path.name for path in (folder / "out").iterdir()} == {
        "batch.sqlite", "good", "fast", "dry"
    }  # fmt: skip
    for name, code in {"good": 0, "fast": 1, "dry": 0}.items():
        assert run("plan", f"{name}.toml", "--out", "alone", cwd=folder).returncode == code
        alone = {path.name: path.read_bytes() for path in (folder / "alone").iterdir()}
        there = folder / rows[name]["folder"]
        assert {path.name: path.read_bytes() for path in there.iterdir()} == alone
        shutil.rmtree(folder / "alone")
    assert {path.name for path in (folder / "out" / "good").iterdir()} == FILES | {MANIFEST}


def test_the_store_is_small_beside_the_files(done):
    folder, _, _ = done
    files = sum(path.stat().st_size for path in (folder / "out").glob("*/*"))
    with closing(sqlite3.connect(folder / "out" / "batch.sqlite")) as store:
        ((values,),) = store.execute("SELECT sum(length(value)) FROM result").fetchall()
    # Nearly all of a report is the library that draws, 4.8 MB of it.
    assert values < 0.02 * files


def written(folder):
    """The files of the jobs, but not the lists, which also have what was in their places."""
    paths = (folder / "out").glob("*/*")
    return {path: path.read_bytes() for path in paths if path.name != MANIFEST}


def test_again_writes_what_is_missing_and_plans_nothing(done, idle):
    folder, command, told = done
    good, fast = folder / "out" / "good", folder / "out" / "fast"
    before = written(folder)
    shutil.rmtree(fast)
    (good / "plan.json").unlink()
    (good / "good.mod").write_text("! half a progr")
    stamp = (good / "report.html").stat().st_mtime_ns
    result = run(*command, cwd=folder)
    assert result.returncode == 1, result.stderr
    assert json.loads(result.stdout) == told
    assert written(folder) == before
    assert (good / "report.html").stat().st_mtime_ns == stamp, "it was there already"


@pytest.mark.slow
def test_a_job_that_was_refused_is_tried_again_once_it_has_changed(tmp_path):
    names = write_slit_jobs(tmp_path, {n: JOBS[n] for n in ("dry", "misspelt", "unknown")})
    command = ["batch", *names, "--out", "out", "--processes", 1, "--json"]
    first = rows_of(json.loads(run(*command, cwd=tmp_path).stdout))
    (tmp_path / "unknown.toml").write_text(SLIT)
    (tmp_path / "misspelt.toml").write_text(SLIT)
    result = run(*command, cwd=tmp_path)
    assert result.returncode == 0
    again = rows_of(json.loads(result.stdout))
    assert again["dry"] == first["dry"]
    assert all(row["passed"] for row in again.values())


def test_a_program_of_an_earlier_run_is_told(done, idle):
    folder, command, _ = done
    stale = folder / "out" / "fast" / "fast.mod"
    stale.write_text("MODULE fast")
    told = rows_of(json.loads(run(*command, cwd=folder).stdout))
    stale.unlink()
    assert any("fast.mod is from an earlier run" in note for note in told["fast"]["notes"])


def test_a_table_for_people(done, idle):
    folder, command, _ = done
    result = run(*command[:-1], cwd=folder)
    assert result.returncode == 1
    lines = result.stdout.splitlines()
    assert lines[0].split()[:4] == ["job", "contours", "passed", "cutting"]
    # Long reasons go on in the next line.
    assert [line.split()[:3] for line in lines if ".toml " in line[:16]][:3] == [
        ["good.toml", "2/2", "yes"],
        ["fast.toml", "1/2", "NO"],
        ["misspelt.toml", "-", "NO"],
    ]
    assert lines[-1].startswith("2 of 8 jobs passed; their files are in out")
    passing = run("batch", "good.toml", "dry.toml", "--out", "out", cwd=folder)
    assert passing.returncode == 0


def test_bad_input_of_the_command_is_one_line(tmp_path, monkeypatch, idle):
    def said(*arguments):
        result = run("batch", *arguments, cwd=tmp_path)
        assert_refused(result)
        return result.stderr

    write_slit_jobs(tmp_path, {"good": SLIT})
    (tmp_path / "file").write_text("")
    (tmp_path / "other").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "good").write_text("")
    shutil.copy(tmp_path / "good.toml", tmp_path / "other" / "Good.toml")
    with pytest.raises(InputError, match="no jobs"):
        batch([], tmp_path / "none")
    assert "rename one" in said("good.toml", "other/Good.toml")
    assert "rename one" in said("good.toml", "good.toml")
    assert "expected a folder, but file is a file" in said("good.toml", "--out", "file")
    assert "expected a folder, but file is a file" in said("good.toml", "--out", "file/deep")
    assert "out/good: expected a folder" in said("good.toml", "--out", "out")
    assert "with a scheduler, got 0" in said("good.toml", "--processes", 0)
    both = ("--processes", 1, "--scheduler", "tcp://127.0.0.1:9")
    assert "none with a scheduler" in said("good.toml", *both)
    monkeypatch.setattr(processes, "PATIENCE", 0.5)
    assert "no answer within" in said("good.toml", "--scheduler", "tcp://127.0.0.1:9")
    with Store(tmp_path / "kerfpath-batch" / "batch.sqlite"):
        assert "another sweep uses this store" in said("good.toml")
    with closing(sqlite3.connect(tmp_path / "kerfpath-batch" / "batch.sqlite")) as store:
        store.execute("UPDATE package SET version = '0.0.9'")
        store.commit()
    assert "got one of 0.0.9" in said("good.toml")


def test_a_full_disk_under_the_files_is_one_line_and_the_same_command_goes_on(
    done, idle, monkeypatch
):
    folder, command, told = done
    plan = folder / "out" / "good" / "plan.json"
    plan.unlink()

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        result = run(*command, cwd=folder)
    assert_refused(result, "plan.json", "No space left on device")
    assert not plan.exists()
    assert json.loads(run(*command, cwd=folder).stdout) == told
    assert plan.exists()


def test_no_jobs_at_all_is_bad_input(tmp_path):
    result = run("batch", cwd=tmp_path)
    assert result.returncode == 2
    assert "Missing argument 'JOB.toml'" in result.stderr


@pytest.mark.slow
def test_a_job_that_changes_meanwhile_ends_the_batch(tmp_path):
    write_slit_jobs(tmp_path, {"good": SLIT})
    job, out = tmp_path / "good.toml", tmp_path / "out"

    def edit(what, done, total):
        job.write_text(SLIT + "\n# a remark\n")

    with pytest.raises(InputError, match=r"good\.toml: .*has changed.*start the study again"):
        batch([job], out, processes=1, progress=edit)
    assert not (out / "good").exists()


@pytest.mark.slow
def test_workers_of_a_cluster_need_the_job_folder_alone_and_that_they_need(
    workers, scheduler, tmp_path
):
    workers(1)
    shared, out = tmp_path / "shared", tmp_path / "out"
    shared.mkdir()
    write_slit_jobs(shared, {"good": SLIT})
    (row,) = batch([shared / "good.toml"], out, scheduler=scheduler)
    assert row.passed
    assert {path.name for path in row.folder.iterdir()} == FILES | {MANIFEST}
    (other,) = write_slit_jobs(shared, {"other": SLIT})

    def lost(what, done, total):
        (shared / other).unlink()

    with pytest.raises(InputError, match="needs the job and its files at the same path"):
        batch([shared / other], out, scheduler=scheduler, progress=lost)
    assert not (out / "other").exists()
