"""Programs run on LinuxCNC, and records judged: whole, and with what a controller may do wrong."""

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath.job import read_job
from kerfpath.job.controller_run import judge
from kerfpath.job.program_file import in_language_of, program_on_disk
from kerfpath.post.linuxcnc import Record, Stretch, stretches_of

JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-45"
[part]
file = "points.csv"
xyz_mm = [1200, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "hole"
speed_m_min = 2
spacing_mm = 4
micro_joints = { count = 1, width_mm = 4 }
[[contour]]
pick = "slit"
speed_m_min = 2
spacing_mm = 4
[plan]
gamma_step_deg = 5
[program]
language = "linuxcnc"
pierce_time_s = 0.2
lead_time_s = 0
gas_lead_s = 0
wait_for = ["interlock"]
[program.linuxcnc]
laser_output = 0
gas_output = 1
interlock_input = 3
"""


def table():
    """A hole of 40 mm and a wavy slit of 80 mm, mm."""
    rows = ["contour,x_mm,y_mm,z_mm,nx,ny,nz"]
    for a in np.linspace(0, 2 * np.pi, 241):
        rows.append(f"hole,{20 * np.cos(a):.6f},{20 * np.sin(a):.6f},0,0,0,1")
    for x in np.linspace(-40, 40, 81):
        rows.append(f"slit,{x:.6f},{40 + 5 * np.sin(x / 15):.6f},0,0,0,1")
    return "\n".join([*rows, ""])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A job, its plan and its program."""
    path = tmp_path_factory.mktemp("run")
    (path / "points.csv").write_text(table())
    (path / "job.toml").write_text(JOB)
    done = run("plan", "job.toml", "--out", "out", cwd=path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture(scope="module")
def job(folder):
    return in_language_of(folder / "out/job.ngc", read_job(folder / "job.toml"))


@pytest.fixture(scope="module")
def read(folder, job):
    return program_on_disk(folder / "out/job.ngc", job)


@pytest.fixture(scope="module")
def steps(read, job):
    return list(stretches_of(read, job.robot, job.program.language_settings))


def recorded(read, steps):
    """The record of a controller that does what the model foresees."""
    period, start, q, line = 1e-3, 0.0, [], []
    for step in steps:
        took = step if isinstance(step, float) else step.time
        time = np.arange(0, took, period)
        if isinstance(step, Stretch) and step.moves:
            end = step.begin + step.knots[:, -1]
            middle = (step.begin[1:] + end[:-1]) / 2
            lines = np.array([move.line for move in step.moves])
            q.append(step.at(time))
            line.append(lines[np.searchsorted(middle, time, side="right")])
            here = step.q[-1]
        elif len(time):
            q.append(np.tile(here, (len(time), 1)))
            line.append(np.zeros(len(time), int))
        start += took
    q, line = np.vstack([*q, here]), np.append(np.concatenate(line), 0)
    laser, on, last = np.zeros(len(q), bool), False, 0
    switched = {
        move.line: s.on for move in read.moves for s in move.switches if s.signal == "laser"
    }
    for k, number in enumerate(line):
        if number != last and last in switched:
            on = switched[last]
        laser[k], last = on, number
    return Record(
        time=period * np.arange(len(q)), q=q, line=line, laser=laser, gas=np.zeros(len(q), bool)
    )


def judged(record, read, steps, job):
    return judge(record, read, [step for step in steps if isinstance(step, Stretch)], job)


def failed(done):
    return {check.code for check in done.checks if not check.ok}


def test_a_controller_that_does_what_the_model_foresees_passes(read, steps, job):
    done = judged(recorded(read, steps), read, steps, job)
    assert failed(done) == set()
    assert [contour.name for contour in done.contours] == ["hole", "slit"]
    for contour in done.contours:
        assert contour.time == pytest.approx(contour.foreseen, abs=2e-3)  # two samples
    assert [switch.on for switch in done.switches] == [True, False, True, False, True, False]
    assert done.time == pytest.approx(done.foreseen, abs=len(steps) * 1e-3)
    # Path and limits were planned with 0.1 mm and a share of 1.
    assert 0 < max(contour.off_path for contour in done.contours) < 1e-4
    assert done.acceleration.max() <= 1 + 1e-6


def test_what_a_controller_does_wrong_is_found(read, steps, job):
    good = recorded(read, steps)
    late = replace(good, laser=np.roll(good.laser, 10))
    # On for 10 ms while the tool backs off, too, where the tip leaves the line.
    assert failed(judged(late, read, steps, job)) == {"beam-late", "path"}
    never = replace(good, laser=np.zeros_like(good.laser))
    assert failed(judged(never, read, steps, job)) == {"beam"}
    twice = good.laser.copy()
    twice[np.flatnonzero(good.laser)[50]] = False
    assert "beam" in failed(judged(replace(good, laser=twice), read, steps, job))
    aside = good.q + np.radians([0.02, 0, 0, 0, 0, 0])  # 0.4 mm at 1.2 m
    assert failed(judged(replace(good, q=aside), read, steps, job)) == {"path"}
    slow = replace(good, time=1.1 * good.time)
    assert failed(judged(slow, read, steps, job)) == {"time"}
    jerked = good.q.copy()
    jerked[2000] += np.radians([0, 0, 0, 0, 0.01, 0])
    assert failed(judged(replace(good, q=jerked), read, steps, job)) == {"acceleration"}


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("linuxcnc") is None and "LINUXCNC" not in os.environ,
    reason="LinuxCNC is not installed (apt-get install linuxcnc-uspace)",
)
def test_linuxcnc_runs_a_whole_part_as_foreseen(folder):
    """A real controller, with simulated joints, beside our own model of it.

    Time: 3 %; whole B-pillars differ by 0.3 %, single cuts by 2 %. Path: 0.05 mm from the lines
    between targets, where corners are rounded by up to 0.013 mm here. Laser: 2 ms, two of the
    controller's periods; it switches in the middle of a corner. Limits: 2 % of the acceleration,
    for the six decimals of the record.
    """
    done = run("run", "out/job.ngc", "--on", "linuxcnc", "--out", "as-run", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["joints"] == "simulated"
    assert [check["code"] for check in found["checks"] if not check["ok"]] == []
    assert found["run_s"] == pytest.approx(found["foreseen_s"], rel=0.03)
    assert found["run_s"] == pytest.approx(found["planned_s"], rel=0.03)
    assert [contour["name"] for contour in found["contours"]] == ["hole", "slit"]
    for contour in found["contours"]:
        assert contour["run_s"] == pytest.approx(contour["foreseen_s"], rel=0.03)
        assert contour["off_path_mm"] < 0.05
    assert [switch["on"] for switch in found["laser"]] == [True, False, True, False, True, False]
    assert all(abs(switch["late_ms"]) <= 2 for switch in found["laser"])
    assert max(found["velocity_share"].values()) <= 1.001
    assert max(found["acceleration_share"].values()) <= 1.02
    rows = (folder / "as-run/record.csv").read_text().splitlines()
    assert rows[0].startswith("t_s,joint_1_deg,")
    assert len(rows) == pytest.approx(found["run_s"] * 1000, abs=2)
    assert "Run to its end as planned" in (folder / "as-run/run.html").read_text()


def stand_in(path, monkeypatch):
    """Commands that are there, so that other refusals come first."""
    for name in ("linuxcnc", "halsampler"):
        (path / name).write_text("#!/bin/sh\n")
        (path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(path))
    lock = path / "linuxcnc.lock"
    monkeypatch.setattr("kerfpath.post.linuxcnc.recorder.LOCK", lock)
    return lock


def test_without_linuxcnc_one_line_says_how_to_install_it(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    refused = run("run", "out/job.ngc", cwd=folder)
    assert_refused(refused, "linuxcnc, halsampler is needed", "apt-get install linuxcnc-uspace")


def test_what_cannot_be_run_is_refused(folder, tmp_path, monkeypatch):
    assert_refused(run("run", "out/job.ngc", "--on", "krc5", cwd=folder), "expected linuxcnc")
    lock = stand_in(tmp_path, monkeypatch)
    lock.touch()
    assert_refused(run("run", "out/job.ngc", cwd=folder), "LinuxCNC runs already, or was ended by")
    lock.unlink()
    assert_refused(run("run", "out/job.ngc", cwd=folder), "LinuxCNC did not start")
    shutil.copytree(folder / "out", tmp_path / "out")
    (tmp_path / "out/plan.json").unlink()
    assert_refused(run("run", "out/job.ngc", cwd=tmp_path), "give the job with --job JOB.toml")
    run("post", "out/plan.json", "--language", "csv", "-o", "job.csv", cwd=folder)
    refused = run("run", "job.csv", "--job", "job.toml", cwd=folder)
    assert_refused(refused, "expected a program in the language linuxcnc, got one in csv")
    ini = tmp_path / "out/job.ini"
    ini.write_text(ini.read_text().replace("MAX_VELOCITY = 175", "MAX_VELOCITY = 375"))
    refused = run("run", "out/job.ngc", "--job", folder / "job.toml", cwd=tmp_path)
    assert_refused(refused, "job.ini, line", "expected 'MAX_VELOCITY = 175.000000'")
