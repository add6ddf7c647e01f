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
from kerfpath.job import audit_file, read_job, read_plan_file, run_job, write_result
from kerfpath.limits import jerks_of, rates_of
from kerfpath.post import build_program

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
    course = longest_run(
        build_program([cut.plan], job.program), job.program.rules.controller
    ).tool_motion
    h, time = 1e-4, np.linspace(2e-4, course.time[-1] - 2e-4, 4000)
    nominal = np.stack([np.interp(time, course.time, q) for q in cut.plan.unwrapped.T], axis=1)
    q = [
        job.robot.arm.nearest(
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


@pytest.mark.slow
def test_they_are_in_json_and_above_1_they_are_warned_of(folder, planned):
    job, result = planned
    (peak,) = (r.value for r in result.cuts[0].as_run.checks if r.code == "torque-as-run")
    # The plan keeps them at its nodes; corners that are sharper than they need more.
    torque = (job.robot.limits.torque * peak * 1.02).round(3).tolist()
    sharp = QUICK.replace("[program]\n", "[program]\nzone_mm = 0.05\n")
    path = job_at(folder, sharp, robot_keys=f"torque_nm = {torque}")
    found = run("plan", path, "--out", folder / "other", "--json")
    (entry,) = json.loads(found.stdout)["contours"]
    assert entry["as_run"]["torque"] > 1.05
    assert any("go more slowly, or carry less" in issue for issue in entry["issues"])


def test_without_a_load_there_is_no_such_row(folder):
    (cut,) = run_job(read_job(job_at(folder, QUICK, load=""))).cuts
    assert not any("torque" in row.code for row in cut.as_run.checks)


@pytest.mark.parametrize(
    ("load", "keys", "said"),
    [
        ("mass_kg = 25", "", "tool.centre_mm: expected the centre of mass of 25 kg in the flange"),
        ("centre_mm = [0, 0, 1]", "", "tool.mass_kg: expected mass_kg with centre_mm, got none"),
        ("mass_kg = -1\ncentre_mm = [0, 0, 1]", "", "tool.mass_kg: expected a number not below 0"),
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
            "tool.mass_kg: expected mass_kg and centre_mm of the load on the flange, as "
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
        run("check", path),
        "the masses of its links come only from a description (URDF); give urdf with",
    )
    path = job_at(folder, QUICK)
    text = (folder / "arm.urdf").read_text()
    (folder / "arm.urdf").write_text(re.sub(r' effort="[^"]*"', "", text))
    assert_refused(
        run("check", path), "robot.torque_nm: expected torque limits, as arm.urdf does not state"
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


@pytest.mark.slow
def test_jobs_hold_torque_and_jerk_limits_at_the_nodes(folder, planned):
    """The audit judges by both, the run, plan.json with its job and without."""
    job, result = planned
    (cut,) = result.cuts
    tau, q = np.diff(cut.plan.time), cut.plan.unwrapped
    torque = np.abs(job.robot.torque_limit().shares(q, tau)).max(axis=0) * job.robot.limits.torque
    torque = 1.2 * torque + 1.0
    _, a = rates_of(np.diff(q, axis=0), tau)
    jerk = np.degrees(np.abs(jerks_of(a, tau)).max(axis=0)) * 1.02 + 100.0
    keys = f"torque_nm = {torque.round(3).tolist()}\njerk_deg_s3 = {jerk.round(3).tolist()}"
    limited = run_job(read_job(job_at(folder, QUICK, robot_keys=keys)))
    (kept,) = limited.cuts
    rows = {row.code: row for row in kept.checks}
    for code in ("torque", "jerk"):
        assert rows[code].ok
        assert 0.1 < rows[code].value <= 1 + 1e-6
    out = folder / "limited"
    write_result(limited, out)
    page = (out / "report.html").read_text()
    assert "Joint jerk limits" in page
    assert "load 25 kg, without friction and rotors" in page
    # plan.json carries them, to the bit, and is judged by them with the job and without.
    (again,) = read_plan_file(out / "plan.json").plans
    assert again.robot.dynamics.load.mass == 25.0
    np.testing.assert_array_equal(again.robot.limits.jerk, kept.plan.robot.limits.jerk)
    for job_file in (None, folder / "job.toml"):
        table = audit_file(out / "plan.json", job_file).tables[kept.name]
        assert {row.code for row in table if not row.ok} <= {"cycle-as-run", "tip-as-run"}
        codes = {row.code: row for row in table}
        assert codes["torque"].value == pytest.approx(rows["torque"].value, rel=1e-9)
        assert codes["jerk"].value == pytest.approx(rows["jerk"].value, rel=1e-6)
    # So does the program, its digits allowed for.
    (program,) = out.glob("*.mod")
    tables = audit_file(program, folder / "job.toml").tables
    (table,) = (t for t in tables.values() if any(row.code == "torque" for row in t))
    codes = {row.code: row for row in table}
    assert codes["torque"].value == pytest.approx(rows["torque"].value, rel=0.02)
    assert "for digits" in codes["torque"].title
    assert codes["jerk"].value == pytest.approx(rows["jerk"].value, rel=0.5)
    assert all(row.ok or row.level == "warning" for row in table)
    # A job that asks for less refuses the plan.
    less = keys.replace(f"{torque.round(3).tolist()}", f"{(torque / 2).round(3).tolist()}")
    stricter = folder / "stricter.toml"
    stricter.write_text(job_of_arm(folder, QUICK, robot_keys=less))
    found = run("audit", out / "plan.json", "--job", stricter)
    assert found.returncode == 1
    assert "joint torque at the nodes" in found.stdout


@pytest.mark.slow
def test_jobs_that_no_motion_keeps_say_so(folder):
    text = job_of_arm(folder, QUICK, robot_keys=f"jerk_deg_s3 = {[0.01] * 6}")
    path = folder / "job.toml"
    path.write_text(text)
    found = run("plan", path, "--out", folder / "none")
    assert found.returncode == 1
    assert "no feasible path" in found.stdout
    assert "jerk" in found.stdout
    for command in ("speed", "pareto", "layout"):
        assert_refused(
            run(command, path, cwd=folder), "takes limits on velocity and acceleration only"
        )
