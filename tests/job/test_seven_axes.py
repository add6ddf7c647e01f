"""Jobs of a seven-axis arm: files with the joints in their own order, programs read back."""

import csv
import json

import numpy as np
import pytest

from commands import run
from jobs import SLITS
from kerfpath import InputError, audit, robot
from kerfpath.job import read_job, read_plan_file
from kerfpath.studio.scene import scene_of_robot
from kerfpath.study.robots import with_robot

JOB = """
[robot]
model = "kuka_lbr_iiwa14_r820"
acceleration_deg_s2 = [300, 300, 300, 300, 500, 500, 700]

[tool]
xyz_mm = [0, 0, 200]
rpy_deg = [0, 0, 0]

[part]
file = "slits.csv"
xyz_mm = [450, 100, 200]
rpy_deg = [0, 10, 0]

[[contour]]
pick = "a"
speed_m_min = 2
count = 11

[[contour]]
pick = "b"
speed_m_min = 2
count = 11

[plan]
gamma_step_deg = 10

[program]
language = "csv"
retract_mm = 20

[sequence]
home_deg = [0, 30, 0, -60, 0, 90, 0]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("seven")
    (made / "slits.csv").write_text(SLITS)
    (made / "job.toml").write_text(JOB)
    planned = run("plan", "job.toml", "--out", "out", cwd=made)
    assert planned.returncode == 0, planned.stderr
    return made


def test_the_files_have_the_seven_joints_in_their_own_order(folder):
    plans = read_plan_file(folder / "out" / "plan.json").plans
    rows = list(csv.DictReader((folder / "out" / "trajectory.csv").read_text().splitlines()))
    for made in plans:
        assert made.robot.kinematics == "srs"
        assert audit(made, path_tolerance=1e-3) == []
        own = [row for row in rows if row["contour"] == made.name]
        said = np.radians([[float(row[f"q{i}_deg"]) for i in range(1, 8)] for row in own])
        np.testing.assert_allclose(said, made.q, atol=1e-12)
    home = [float(rows[0][f"q{i}_deg"]) for i in range(1, 8)]
    np.testing.assert_allclose(home, [0, 30, 0, -60, 0, 90, 0], atol=1e-9)
    data = json.loads((folder / "out" / "plan.json").read_text())
    assert np.shape(data["contours"][0]["nodes"]["q_rad"]) == (11, 7)
    assert data["external_axes"] == []
    assert "joint 7" in (folder / "out" / "report.html").read_text().lower()


def test_the_plan_passes_the_audit_by_its_job(folder):
    result = run("audit", "out/plan.json", "--job", "job.toml", cwd=folder)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("language", ["csv", "ros"])
def test_programs_pass_the_audit_and_an_elbow_elsewhere_does_not(folder, language):
    suffix = {"csv": "csv", "ros": "yaml"}[language]
    name = f"written.{suffix}"
    job = folder / f"{language}.toml"
    job.write_text(JOB.replace('language = "csv"', f'language = "{language}"'))
    result = run("post", "out/plan.json", "--language", language, "-o", name, cwd=folder)
    assert result.returncode == 0, result.stderr
    assert run("audit", name, "--job", job.name, cwd=folder).returncode == 0
    if language == "csv":
        text = (folder / name).read_text().splitlines()
        at = text[0].split(",").index("q3_deg")
        k = len(text) // 2
        fields = text[k].split(",")
        fields[at] = f"{float(fields[at]) + 0.5:.9f}"
        text[k] = ",".join(fields)
        (folder / "elsewhere.csv").write_text("\n".join(text) + "\n")
        assert run("audit", "elsewhere.csv", "--job", job.name, cwd=folder).returncode != 0


@pytest.mark.parametrize("language", ["krl", "rapid", "urscript"])
def test_a_language_that_cannot_say_seven_axes_is_refused_before_planning(folder, language):
    (folder / "other.toml").write_text(JOB.replace('"csv"\nretract', f'"{language}"\nretract'))
    result = run("plan", "other.toml", "--out", "none", cwd=folder)
    assert result.returncode == 2
    assert "cannot yet express the axes of an arm like 'kuka_lbr_iiwa14_r820'" in result.stderr


def test_the_speed_is_found(folder):
    result = run("speed", "job.toml", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["contours"][0]["fastest_m_min"] > 2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[300, 300, 300, 300, 500, 500, 700]", "[300, 300, 300, 300, 500, 500]", "7 numbers"),
        ("[tool]", "elbow_step_deg = 0\n[tool]", "elbow_step_deg: expected a number above 0"),
        ("home_deg = [0, ", "home_deg = [", "sequence.home_deg: expected 7 numbers"),
        ("acceleration_deg_s2 =", "endless = [8]\nacceleration_deg_s2 =", "endless: expected axis"),
        (
            "acceleration_deg_s2 = [300, 300, 300, 300, 500, 500, 700]",
            "",
            r"add acceleration_deg_s2 = \[7 numbers\]$",
        ),
        (
            '"kuka_lbr_iiwa14_r820"\nacceleration_deg_s2 = [300, 300, 300, 300, 500, 500, 700]',
            '"kuka_kr10_r1100_2"\nelbow_step_deg = 5',
            "elbow_step_deg: expected elbow_step_deg only for an arm with seven axes, got 6 axes",
        ),
    ],
)
def test_a_fault_is_said_in_one_line(folder, old, new, message):
    assert JOB.count(old) == 1
    (folder / "wrong.toml").write_text(JOB.replace(old, new))
    with pytest.raises(InputError, match=message):
        read_job(folder / "wrong.toml")


def test_an_arm_by_its_lengths_and_the_step_of_its_elbow_are_read(folder):
    lengths = """kinematics = "srs"
geometry_mm = { c1 = 360, c2 = 420, c3 = 400, c4 = 152 }
sign = [1, 1, 1, -1, 1, 1, 1]
lower_deg = [-170, -120, -170, -120, -170, -120, -175]
upper_deg = [170, 120, 170, 120, 170, 120, 175]
velocity_deg_s = [85, 85, 100, 75, 130, 135, 135]
elbow_step_deg = 5
"""
    text = JOB.replace('model = "kuka_lbr_iiwa14_r820"\n', lengths)
    (folder / "lengths.toml").write_text(text)
    read = read_job(folder / "lengths.toml").robot
    q = np.random.default_rng(1).uniform(-2, 2, (10, 7))
    np.testing.assert_allclose(
        read.forward(q), robot("kuka_lbr_iiwa14_r820").forward(q), atol=1e-12
    )
    assert read.elbow_step == pytest.approx(np.radians(5))


def test_studio_and_lists_of_robots_say_that_they_do_not_know_it(folder):
    job = read_job(folder / "job.toml")
    with pytest.raises(InputError, match="the studio does not support seven-axis arms"):
        scene_of_robot(job, 1)
    six = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    with pytest.raises(InputError, match="a list of robots does not support seven-axis arms"):
        with_robot(job, six)
