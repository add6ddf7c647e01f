"""Jobs that say what the flange carries: torques of the motion as run, and bad input."""

import json
import re

import numpy as np
import pytest
from tests.arms import job_of_arm

from commands import assert_refused, run
from jobs import DEMO, SMALL
from kerfpath import InputError
from kerfpath.execution import longest_run
from kerfpath.job import read_job, run_job, write_result

BEFORE, HOLE, _, AFTER = re.split(r"(?=\[\[contour\]\]|\[plan\])", SMALL)
QUICK = BEFORE + HOLE + AFTER.replace("[plan]", "[plan]\ncertify = false")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("torque")
    (folder / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    return folder


def job_at(folder, text, **keys):
    path = folder / "job.toml"
    path.write_text(job_of_arm(folder, text, **keys))
    return path


@pytest.fixture(scope="module")
def planned(folder):
    job = read_job(job_at(folder, QUICK))
    return job, run_job(job)


def test_torques_of_the_motion_as_run_are_in_the_checks(planned, folder):
    job, result = planned
    (cut,) = result.cuts
    (row,) = (row for row in cut.as_run.checks if row.code == "torque-as-run")
    assert row.ok
    assert "sampled, without friction and rotors" in row.title
    # By hand: central differences of the joints over the whole run, twenty times as dense.
    course = longest_run(job.program.program([cut.plan])).course
    h, time = 1e-4, np.linspace(2e-4, course.time[-1] - 2e-4, 4000)
    nominal = np.stack([np.interp(time, course.time, q) for q in cut.plan.unwrapped.T], axis=1)
    q = [
        job.robot.nearest(
            job.placement @ course.poses(time + sign * h) @ np.linalg.inv(job.tool), nominal
        )
        for sign in (-1, 0, 1)
    ]
    limit = job.robot.torque_limit()
    v, a = (q[2] - q[0]) / (2 * h), (q[2] - 2 * q[1] + q[0]) / h**2
    dense = np.abs(limit.dynamics.torque(q[1], v, a) / limit.bound).max()
    # Between samples, and where differences meet the borders of zones, a percent may lie.
    assert row.value == pytest.approx(dense, rel=0.01)
    write_result(result, folder / "out")
    assert row.title in (folder / "out" / "report.html").read_text()


def test_they_are_in_json_and_above_1_they_are_warned_of(folder, planned):
    job, result = planned
    (peak,) = (r.value for r in result.cuts[0].as_run.checks if r.code == "torque-as-run")
    torque = (job.robot.torque * peak * 0.9).round(3).tolist()
    path = job_at(folder, QUICK, robot_keys=f"torque_nm = {torque}")
    found = run("plan", path, "--out", folder / "other", "--json")
    (entry,) = json.loads(found.stdout)["contours"]
    assert entry["as_run"]["torque"] == pytest.approx(peak / (peak * 0.9), rel=1e-3)
    assert any("go more slowly, or carry less" in issue for issue in entry["issues"])


def test_without_a_load_there_is_no_such_row(folder):
    (cut,) = run_job(read_job(job_at(folder, QUICK, load=""))).cuts
    assert not any("torque" in row.code for row in cut.as_run.checks)


@pytest.mark.parametrize(
    ("load", "keys", "said"),
    [
        ("mass_kg = 25", "", "tool.centre_mm: expected the centre of mass of 25 kg in the flange"),
        ("centre_mm = [0, 0, 1]", "", "tool.mass_kg: expected mass_kg, too, got none; add it"),
        ("mass_kg = -1\ncentre_mm = [0, 0, 1]", "", "tool.mass_kg: expected 0 or a number above"),
        ("mass_kg = 25\ncentre_mm = [0, 1]", "", "tool.centre_mm: expected 3 numbers"),
        (
            "mass_kg = 25\ncentre_mm = [0, 0, 1]\ninertia_kg_m2 = [1, 1, -1, 0, 0, 0]", "",
            "tool.inertia_kg_m2: its inertia is not positive definite",
        ),
        (
            "mass_kg = 25\ncentre_mm = [0, 0, 1]\ninertia_kg_m2 = [1, 1, 1]", "",
            "tool.inertia_kg_m2: expected 6 numbers",
        ),
        (
            "", "torque_nm = [1, 1, 1, 1, 1, 1]",
            "tool.mass_kg: expected mass_kg and centre_mm of what the flange carries, as "
            "torque_nm is given",
        ),
        ("", "gravity_m_s2 = [0, 0, 9.81]", "as gravity_m_s2 is given"),
        ("mass_kg = 0", "torque_nm = [1, 1, 1, 1, 1]", "torque_nm: expected 6 numbers, one for"),
        ("mass_kg = 0", "torque_nm = [1, 1, 1, 1, 1, 0]", "torque_nm: expected numbers above 0"),
    ],
)  # fmt: skip
def test_loads_and_torques_that_cannot_be_are_refused_in_one_line(folder, load, keys, said):
    path = job_at(folder, QUICK, load=load, robot_keys=keys)
    with pytest.raises(InputError) as fault:
        read_job(path)
    assert said in str(fault.value)
    assert "\n" not in str(fault.value)


def test_robots_without_masses_are_refused_with_what_to_give(folder):
    path = folder / "job.toml"
    path.write_text(QUICK.replace("[tool]\n", "[tool]\nmass_kg = 0\n"))
    assert_refused(
        run("check", path), "only a description (URDF) says what its links weigh; give urdf with"
    )
    path = job_at(folder, QUICK)
    text = (folder / "arm.urdf").read_text()
    (folder / "arm.urdf").write_text(re.sub(r' effort="[^"]*"', "", text))
    assert_refused(
        run("check", path), "robot.torque_nm: expected joint torques, as arm.urdf does not state"
    )
    (folder / "arm.urdf").write_text(re.sub(r"<inertial>.*?</inertial>", "", text))
    assert_refused(
        run("check", path), "link 'link_1' has no <inertial>, nor has any link fixed to it"
    )


def test_a_robot_that_hangs_is_said_by_gravity(folder):
    up = read_job(job_at(folder, QUICK)).robot
    down = read_job(job_at(folder, QUICK, robot_keys="gravity_m_s2 = [0, 0, 9.81]")).robot
    q, still = np.full((1, 6), 0.3), np.zeros((1, 6))
    one, other = (r.torque_limit().dynamics.torque(q, still, still) for r in (up, down))
    np.testing.assert_allclose(one, -other, rtol=0, atol=1e-9)
