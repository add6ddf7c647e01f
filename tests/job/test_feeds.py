"""Feeds of the program of a machine as the speeds of a job."""

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath.cad import read
from kerfpath.errors import InputError
from kerfpath.job import job_text, prepare, read_job, read_plan_file

NC = """\
G21 G90 G94
G0 X0 Y0 Z5
G1 Z0 F200
X60 F1800
X90
G0 Z5
G0 X100 Y0
G1 Z0 F200
X160 F{first}
X190 F{second}
G0 Z5
M30
"""
JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-straight"
[part]
file = "cut.nc"
axis = [0, 0, -1]
xyz_mm = [1200, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "cut1"
count = 20
[[contour]]
pick = "cut2"
count = 20
[plan]
gamma_step_deg = 10
"""


def jobs(folder, text=JOB, first=3000, second=3000):
    (folder / "cut.nc").write_text(NC.format(first=first, second=second))
    job = folder / "cut.toml"
    job.write_text(text)
    return job


def test_contours_without_a_speed_are_cut_at_the_feeds_of_their_program(tmp_path):
    job = jobs(tmp_path)
    made = run("plan", job.name, "--out", "out", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    plans = read_plan_file(tmp_path / "out" / "plan.json").plans
    for plan, speed, length in zip(plans, (0.03, 0.05), (0.09, 0.09), strict=True):
        assert plan.time[-1] == pytest.approx(length / speed, rel=1e-9)
    program = next((tmp_path / "out").glob("*.mod"))
    for of in (tmp_path / "out" / "plan.json", program):
        audited = run("audit", of, "--job", job.name, cwd=tmp_path)
        assert audited.returncode == 0, audited.stdout + audited.stderr
    # With other feeds it is another job.
    jobs(tmp_path, first=2000, second=2000)
    assert run("audit", program, "--job", job.name, cwd=tmp_path).returncode == 1


def test_the_speed_of_the_job_wins(tmp_path):
    spoken = JOB.replace('"cut2"', '"cut2"\nspeed_m_min = 6')
    tasks = read_job(jobs(tmp_path, spoken)).tasks(read(tmp_path / "cut.nc", axis=(0, 0, -1)))
    assert [task.speed for task in tasks] == pytest.approx([0.03, 0.1])


def test_several_feeds_are_refused_until_the_job_names_one(tmp_path):
    job = jobs(tmp_path, second=1500)
    line = JOB.splitlines().index('pick = "cut2"')  # from 0: that of the header, from 1
    with pytest.raises(InputError, match=rf"cut.toml:{line}: contour.speed_m_min: .*3, 1.5 m/min"):
        prepare(read_job(job))
    job.write_text(JOB.replace('"cut2"', '"cut2"\nspeed_m_min = 3'))
    assert len(prepare(read_job(job)).contours) == 2


def test_feeds_that_are_no_speed_are_refused(tmp_path):
    job = jobs(tmp_path)
    (tmp_path / "cut.nc").write_text(NC.format(first=10, second=10).replace("G94", "G93"))
    with pytest.raises(
        InputError, match=r"contour\.speed_m_min: expected one speed, got none"
    ) as no:
        prepare(read_job(job))
    assert len(no.value.others) == 1  # one line for each contour


def test_a_drawing_without_feeds_needs_speeds(tmp_path):
    jobs(tmp_path)
    (tmp_path / "cut.dxf").write_text("")
    (tmp_path / "cut.toml").write_text(JOB.replace("cut.nc", "cut.dxf"))
    assert_refused(run("plan", "cut.toml", cwd=tmp_path), "speed_m_min: expected a number above 0")


def test_a_time_step_is_taken_at_the_feed(tmp_path):
    job = jobs(tmp_path, JOB.replace("count = 20", "time_step_ms = 20"))
    (first, second) = prepare(read_job(job)).contours
    for request, speed in ((first, 0.03), (second, 0.05)):
        (one,) = request.candidates
        assert np.diff(one.nodes.s).max() <= 0.02 * speed * (1 + 1e-9)


def test_a_first_job_leaves_the_speed_to_the_program(tmp_path):
    job = jobs(tmp_path, second=1500)
    text = job_text(read(tmp_path / "cut.nc", axis=(0, 0, -1)), job)
    job.write_text(text.replace("[part]\n", "[part]\naxis = [0, 0, -1]\n"))
    tasks = prepare(read_job(job)).contours
    assert {each.task.name: each.task.speed for each in tasks} == pytest.approx(
        {"cut1": 0.03, "cut2": 0.05}
    )
