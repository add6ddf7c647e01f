"""A table of accelerations in a job, and in its plan.json, which the job judges."""

import json

import numpy as np
import pytest

from commands import assert_refused, run
from jobs import DEMO, HEAD
from kerfpath import read_plan_file

ROWS = "joint_2_deg,joint_3_deg,joint_1_deg_s2,joint_2_deg_s2\n" + "".join(
    f"{x},{y},{300 + x + y},{250 + x - y / 2}\n" for x in (-80, 0, 90) for y in (-170, 60)
)
CONTOUR = """
[[contour]]
pick = "skin/hole13"
name = "hole"
speed_m_min = 3
spacing_mm = 2
[plan]
gamma_step_deg = 10
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A planned job whose robot has a table of a CSV file."""
    folder = tmp_path_factory.mktemp("table")
    (folder / "table.csv").write_text(ROWS)
    head = HEAD.replace("b_pillar.step", str(DEMO / "b_pillar.step"))
    text = head.replace("[robot]\n", '[robot]\nacceleration_table = "table.csv"\n') + CONTOUR
    (folder / "job.toml").write_text(text)
    result = run("plan", folder / "job.toml", "--out", folder / "cut")
    assert result.returncode == 0, result.stderr
    return folder


def test_a_plan_file_brings_the_table(folder):
    (made,) = read_plan_file(folder / "cut" / "plan.json").plans
    table = made.robot.limits.acceleration_table
    np.testing.assert_allclose(np.degrees(table.limits[1]), [[50, 280], [130, 360], [220, 450]])
    assert made.robot.acceleration_source.startswith("joints 1, 2: table by configuration, file ta")
    assert np.abs(made.acceleration_share).max() <= 1 + 1e-6
    result = run("audit", folder / "cut" / "plan.json", "--job", folder / "job.toml")
    assert result.returncode == 0, result.stdout


def test_a_job_refuses_a_plan_file_with_another_table(folder, tmp_path):
    data = json.loads((folder / "cut" / "plan.json").read_text())
    data["limits"]["acceleration_table"]["limits_rad_s2"]["1"][1][0] *= 1.01
    (tmp_path / "plan.json").write_text(json.dumps(data))
    result = run("audit", tmp_path / "plan.json", "--job", folder / "job.toml")
    assert result.returncode == 1
    assert "acceleration_table" in result.stdout
    del data["limits"]["acceleration_table"]
    (tmp_path / "plan.json").write_text(json.dumps(data))
    result = run("audit", tmp_path / "plan.json", "--job", folder / "job.toml")
    assert result.returncode == 1


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("library", "no table of accelerations"),
        ("none.csv", "none.csv"),
        ("holes.csv", "a hole"),
        ("seven.csv", "joint 7, but the arm has 6"),
    ],
)
def test_tables_that_a_job_refuses(folder, tmp_path, value, words):
    (tmp_path / "holes.csv").write_text(ROWS.replace("0,60,360,220.0\n", ""))
    (tmp_path / "seven.csv").write_text(ROWS.replace("joint_1_deg_s2", "joint_7_deg_s2"))
    text = (folder / "job.toml").read_text().replace("table.csv", value)
    (tmp_path / "job.toml").write_text(text)
    assert_refused(run("plan", tmp_path / "job.toml", cwd=tmp_path), "acceleration_table", words)
