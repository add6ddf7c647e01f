"""Responses fitted to logs: known ones are found again, and logs of something else are refused."""

import csv
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kerfpath
from commands import run
from jobs import DEMO, SMALL
from kerfpath import InputError, Response, Target, simulate
from kerfpath.execution import (
    CommandedRun,
    fit_response,
    read_log,
    read_response,
    response_text,
)
from kerfpath.execution.path_error import STEP
from kerfpath.job import read_job, read_plan_file, runs_of

TOOL = np.eye(4)
TOOL[:3, 3] = [0.1, 0.0, 0.4]
START = np.array([0.1, 0.2, 0.1, 0.3, 0.9, 0.2])
SIGMA = 0.022


@pytest.fixture(scope="module")
def robot():
    return kerfpath.robot("abb_irb6640_180_255")


def wave(robot, phase):
    """Targets along a wave of which every joint has its share."""
    first = robot.forward(START) @ TOOL
    targets = [Target(kind="start", pose=first)]
    for a in np.linspace(0, 1, 61)[1:]:
        pose = first.copy()
        pose[:3, 3] += [0.25 * a, 0.02 * np.sin(25 * a + phase) - 0.02 * np.sin(phase), 0.03 * a]
        pose[:3, :3] = first[:3, :3] @ Rotation.from_rotvec([0, 0.2 * np.sin(9 * a), a]).as_matrix()
        targets.append(Target(kind="linear", pose=pose, speed=0.12, zone=0.002))
    return targets


def simulated(robot, phase, response):
    return simulate(
        wave(robot, phase), robot, tool=TOOL, language="rapid", start=START, response=response
    )


@pytest.fixture(scope="module")
def runs(robot):
    return [
        CommandedRun(
            name=f"cut {phase:g}", robot=robot, T_flange_tip=TOOL,
            q=simulated(robot, phase, Response()).commanded,
        )
        for phase in (0.0, 1.5)
    ]  # fmt: skip


def logged(robot, truth, seed, phase=0.0):
    """Times and joints of a run as a logger has them: late, with jitter, some samples missing."""
    rng = np.random.default_rng(seed)
    motion = simulated(robot, phase, truth)
    kept = np.sort(rng.choice(len(motion.time), len(motion.time) // 5, replace=False))
    time = 3.7 + motion.time[kept] + rng.uniform(0, 0.002, len(kept))
    return time, motion.q[kept] + rng.normal(0, 2e-6, (len(kept), robot.joints))


def table_of(path, names, *columns):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(np.column_stack(columns).tolist())
    return path


JOINTS = [f"q{i}_deg" for i in range(1, 7)]


def joint_log(folder, robot, truth, seed, phase=0.0):
    time, q = logged(robot, truth, seed, phase)
    path = folder / f"run{seed}.csv"
    return table_of(path, ["t_s", *JOINTS], time, np.degrees(q))


def test_one_lag_of_all_joints_is_found_and_no_more_than_that(tmp_path, robot, runs):
    truth = Response(sigma=[SIGMA])
    logs = [
        read_log(joint_log(tmp_path, robot, truth, seed, phase), robot, TOOL)
        for seed, phase in ((1, 0.0), (2, 1.5))
    ]
    fit = fit_response(runs, logs)
    assert fit.left_out == "each cut in turn"
    assert [each.form for each in fit.tried][fit.chosen] == "one sigma"
    # Noise of 2 urad at 2 m is 4 um; half a millisecond moves these waves by as much.
    assert fit.response.sigma[0] == pytest.approx(SIGMA, abs=5e-4)
    assert (fit.response.standing, fit.response.runs, fit.unused) == ("measured", 2, ())
    none, one = fit.tried[0], fit.tried[fit.chosen]
    assert one.held_out[0] < 0.1 * none.held_out[0]
    assert fit.response.fastest == pytest.approx(0.12, rel=0.1)


@pytest.mark.slow
def test_a_lag_of_each_joint_is_found_where_the_runs_tell_it(tmp_path, robot, runs):
    truth = Response(sigma=[0.030, 0.029, 0.021, 0.017, 0.020, 0.026])
    logs = [
        read_log(joint_log(tmp_path, robot, truth, seed, phase), robot, TOOL)
        for seed, phase in ((1, 0.0), (2, 1.5))
    ]
    fit = fit_response(runs, logs)
    assert fit.tried[fit.chosen].form.startswith("a sigma for each joint")
    told = [joint for joint in range(6) if joint not in fit.untold]
    assert {0, 1, 2} <= set(told)
    np.testing.assert_allclose(fit.response.sigma[told], truth.sigma[told], rtol=0, atol=2e-3)


def test_a_tracked_tip_may_be_off_as_a_whole(tmp_path, robot, runs):
    truth = Response(sigma=[SIGMA])
    time, q = logged(robot, truth, 3)
    tip = (robot.forward(q) @ TOOL)[:, :3, 3]
    tip = Rotation.from_rotvec([0, 0, 1e-3]).apply(tip) + np.array([0.002, -0.001, 0.001])
    path = table_of(tmp_path / "tip.csv", ["t_ms", "x_mm", "y_mm", "z_mm"], time * 1e3, tip * 1e3)
    log = read_log(path, robot, TOOL)
    assert log.tracked
    fit = fit_response(runs[:1], [log])
    assert fit.left_out == "each half of the cut in turn"
    assert fit.tried[1].response.sigma[0] == pytest.approx(SIGMA, abs=2e-3)


def test_logs_of_another_program_are_not_used(tmp_path, robot, runs):
    time, q = logged(robot, Response(), 4)
    q[:, 0] += 0.2  # 0.4 m away
    path = table_of(tmp_path / "far.csv", ["t_s", *JOINTS], time, np.degrees(q))
    far = read_log(path, robot, TOOL)
    with pytest.raises(InputError, match="logs of this program"):
        fit_response(runs, [far])
    near = read_log(joint_log(tmp_path, robot, Response(sigma=[SIGMA]), 5), robot, TOOL)
    assert fit_response(runs, [far, near]).unused == ("far.csv",)


def test_a_fitted_response_is_read_back_from_its_file(tmp_path):
    made = Response(
        sigma=[0.0301, 0.029], friction=129e-6, standing="measured", runs=3, fastest=0.403,
        reference='run "1".csv',
    )  # fmt: skip
    file = tmp_path / "mine.toml"
    file.write_text(response_text(made, ["one note"]))
    found = read_response(file)
    np.testing.assert_allclose(found.sigma, made.sigma, rtol=1e-6)
    for name in ("friction", "standing", "runs", "fastest", "reference"):
        assert getattr(found, name) == pytest.approx(getattr(made, name))


def test_what_is_no_log_of_the_robot_is_refused_in_one_line(tmp_path, robot):
    head, row = ",".join(["t_s", *JOINTS]), "1,2,3,4,5,6"
    for text, said in (
        ("", "holds no rows"),
        (f"{','.join(JOINTS)}\n{row}\n{row}\n", "column of times"),
        ("t_s,a\n1,2\n2,3\n", "a column for each joint"),
        ("t_s,q1_deg,q2_deg\n1,2,3\n2,3,4\n", "another robot"),
        (f"{head}\n2,{row}\n1,{row}\n", "go back"),
        (
            f"{head}\n1,{row}\n2,1,2,3,4,5,x\n",
            "line 3, column q6_deg: expected a number",
        ),
        (f"{head}\n1,{row}\n2,1,2,3\n", "line 3: expected 7 columns, got 4"),
        (f"{head}\n1,900,2,3,4,5,6\n2,{row}\n", "within the limits"),
        (
            f"{head}\n1,nan,2,3,4,5,6\n2,{row}\n",
            "line 2, column q1_deg: expected a number, got 'nan'",
        ),
    ):
        file = tmp_path / "log.csv"
        file.write_text(text)
        with pytest.raises(InputError, match=said) as caught:
            read_log(file, robot, TOOL)
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith(str(file))
    with pytest.raises(InputError, match="no such file"):
        read_log(tmp_path / "none.csv", robot, TOOL)


@pytest.mark.slow
def test_logs_of_a_job_are_fitted_by_the_command_and_shown_on_a_page(tmp_path):
    shutil.copy(DEMO / "b_pillar.step", tmp_path)
    path, plan = tmp_path / "small.toml", tmp_path / "out" / "plan.json"
    path.write_text(SMALL.replace("[plan]", "[plan]\ncertify = false"))
    assert run("plan", path, "--out", plan.parent).returncode == 0
    job, truth = read_job(path), Response(sigma=np.array([0.03]))
    logs = []
    for of in runs_of(job, read_plan_file(plan).plans, "plan"):
        commanded = CommandedRun.of(of)
        q = truth.executed(truth.standing_around(commanded.q, STEP), STEP, job.robot)
        name = f"log{len(logs)}.csv"
        logs.append(
            table_of(tmp_path / name, ["t_s", *JOINTS], STEP * np.arange(len(q)), np.degrees(q))
        )
    stray = table_of(tmp_path / "stray.csv", ["t_s", *JOINTS], [0, 1], np.eye(2, 6))
    asked = ("fit", *logs, stray, "--job", path, "--plan", plan, "-o")
    done = run(*asked, tmp_path / "own.toml")
    assert done.returncode == 0, done.stderr
    found = read_response(tmp_path / "own.toml")
    assert found.sigma == pytest.approx(0.03, abs=1e-3)
    page = (tmp_path / "own.html").read_text()
    for words in ("one sigma *", "stray.csv follows no cut", "Held out"):
        assert words in page
    assert page.count('type="application/octet-stream"') == 1
    refused = run(*asked, tmp_path / "own.html")
    assert refused.returncode == 2
    assert "expected the name of a TOML file" in refused.stderr
