"""Jobs whose programs have moved targets: what they execute, their audit, and what is refused."""

import json
import re
import shutil

import numpy as np
import pytest

from commands import assert_refused, run
from jobs import DEMO, SMALL
from kerfpath import InputError, Response
from kerfpath.execution import CommandedRun
from kerfpath.execution.path_error import STEP
from kerfpath.job import cell_of_job, programmed_plans, read_job, read_plan_file, runs_of

QUICK = SMALL.replace("[plan]", "[plan]\ncertify = false\npath_tolerance_mm = 0.06").replace(
    "spacing_mm = 1\n", "spacing_mm = 1.25\n"
)
MODEL = QUICK.replace("[program]\n", '[program]\ncompensate = "model"\n')


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compensated")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "plain.toml").write_text(QUICK)
    (folder / "job.toml").write_text(MODEL)
    return folder


@pytest.fixture(scope="module")
def planned(folder):
    result = run("plan", "job.toml", "--out", "out", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr + result.stdout
    return json.loads(result.stdout)


def audited(folder, file, job):
    result = run("audit", str(file), "--job", job, "--json", cwd=folder)
    assert result.returncode in (0, 1), result.stderr
    found = json.loads(result.stdout)
    failed = {
        check["code"]
        for checks in found["contours"].values()
        for check in checks
        if not check["ok"] and check["level"] == "error"
    }
    assert found["passed"] == (result.returncode == 0) == (not failed)
    return failed


def test_without_it_the_same_cuts_are_too_far_off(folder):
    result = run("plan", "plain.toml", "--out", "plain", "--json", cwd=folder)
    assert result.returncode == 1
    found = json.loads(result.stdout)
    assert all(any("[tip-as-run]" in issue for issue in c["issues"]) for c in found["contours"])


def test_the_executed_path_is_within_the_tolerance(planned):
    assert planned["passed"]
    for contour in planned["contours"]:
        about = contour["as_run"]["compensation"]
        assert about["rest_m"] <= 6e-5 < about["before_m"]
        assert contour["as_run"]["path_error"]["largest_m"] == pytest.approx(about["rest_m"])
        assert 0 < about["largest_displacement_m"] < 5e-4
        assert contour["as_run"]["path_error"]["standing"] == "assumed"
    (note,) = [each for each in planned["notes"] if each.startswith("Targets are moved")]
    assert "rests on an assumption" in note
    assert "With 15 ms it would be" in note


def test_plan_and_program_pass_their_audits(planned, folder):
    assert audited(folder, "out/plan.json", "job.toml") == set()
    assert audited(folder, "out/job.mod", "job.toml") == set()
    # The plan is as drawn: another job's program of it is not moved.
    assert "nodes" in audited(folder, "out/job.mod", "plain.toml")


def test_post_writes_the_same_program_and_needs_the_job(planned, folder):
    text = (folder / "out" / "job.mod").read_text()
    asked = ("post", "out/plan.json", "-o", "again.mod")
    assert_refused(run(*asked, cwd=folder), "give it with --job")
    result = run(*asked, "--job", "job.toml", cwd=folder)
    assert result.returncode == 0, result.stderr
    again = (folder / "again.mod").read_text()
    assert again.replace("MODULE again", "MODULE job") == text


def shifted(text, by, every=False):
    """The text with the points of one target, or of all, moved by so many mm."""
    moves = re.compile(r"(MoveL \[\[)([-\d.]+)(,)")
    found = list(moves.finditer(text))
    chosen = found if every else [found[len(found) // 4]]
    for each in reversed(chosen):
        x = float(each[2]) + by
        text = f"{text[: each.start(2)]}{x:.4f}{text[each.end(2) :]}"
    return text


def test_a_target_that_was_moved_by_hand_is_found_by_what_it_executes(planned, folder):
    text = (folder / "out" / "job.mod").read_text()
    (folder / "edited.mod").write_text(shifted(text, 0.5))
    assert audited(folder, "edited.mod", "job.toml")
    (folder / "off.mod").write_text(shifted(text, 0.15, every=True))
    assert "tip-as-run" in audited(folder, "off.mod", "job.toml")
    slow = re.sub(
        r"(\[)(\d+\.?\d*)(,500,5000,1000\])", lambda m: f"{m[1]}{float(m[2]) * 1.05:g}{m[3]}", text
    )
    assert slow != text
    (folder / "fast.mod").write_text(slow)
    assert {"speed", "asked-speeds"} & audited(folder, "fast.mod", "job.toml")


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (("[tool]", '[robot.response]\nsource = "ideal"\n\n[tool]'), "ideal response"),
        (('language = "rapid"', 'language = "none"'), "expected a program to compensate"),
        (('"model"', '"none.json"'), "none.json"),
        (('"model"', '"model"\ncompensate_most_mm = 9'), "compensate_most_mm"),
    ],
)
def test_what_cannot_be_compensated_is_refused_at_its_key(folder, edit, said):
    assert edit[0] in MODEL
    (folder / "wrong.toml").write_text(MODEL.replace(*edit))
    with pytest.raises(InputError, match=said) as caught:
        read_job(folder / "wrong.toml")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(f"{folder / 'wrong.toml'}")


def test_scripts_and_touch_ups_have_no_moved_targets(planned, folder):
    assert_refused(run("script", "job.toml", cwd=folder), "compensate")
    asked = ("touch-up", "out/job.mod", "--job", "job.toml", "--plan", "out/plan.json")
    assert_refused(run(*asked, cwd=folder), "compensate")


@pytest.mark.slow
def test_a_cut_that_is_too_fast_is_refused_with_a_speed_that_holds(folder):
    fast = MODEL.replace('"model"', '"model"\ncompensate_most_mm = 0.1')
    (folder / "fast.toml").write_text(fast)
    result = run("plan", "fast.toml", "--out", "fast", "--json", cwd=folder)
    assert result.returncode == 1
    first, _ = json.loads(result.stdout)["contours"]
    (issue,) = [each for each in first["issues"] if "[compensation]" in each]
    speed = float(re.search(r"can be compensated at ([\d.]+) m/min", issue)[1])
    assert 1 < speed < 3
    assert "compensate_most_mm" in issue
    (folder / "fast.toml").write_text(fast.replace("speed_m_min = 3", f"speed_m_min = {speed}", 1))
    result = run("plan", "fast.toml", "--out", "fast", "--json", cwd=folder)
    assert json.loads(result.stdout)["contours"][0]["passed"]


@pytest.mark.slow
def test_in_a_cell_the_moved_motion_keeps_its_distances_and_passes_its_audit(folder):
    table = 'name = "table"\nsize_mm = [800, 1500, 50]\nxyz_mm = [1250, 0, 275]\n'
    cell = f"\n[cell]\nnear_miss_mm = 10\nstand_off_mm = 1\n\n[[cell.fixture]]\n{table}"
    (folder / "cell.toml").write_text(MODEL + cell)
    result = run("plan", "cell.toml", "--out", "cell", "--json", cwd=folder)
    assert result.returncode == 0, result.stdout
    job = read_job(folder / "cell.toml")
    bodies = cell_of_job(job, job.read_part())
    drawn = read_plan_file(folder / "cell" / "plan.json")
    moved = programmed_plans(job, drawn)
    for each, as_drawn in zip(moved, drawn.plans, strict=True):
        assert np.abs(each.q - as_drawn.q).max() > 1e-5
        # The distances are computed to a micrometre.
        assert (bodies.distances(each.q) - bodies.required).min() > -1e-6
    assert audited(folder, "cell/cell.mod", "cell.toml") == set()
    text = (folder / "cell" / "cell.mod").read_text()
    (folder / "moved_in_cell.mod").write_text(shifted(text, 0.5))
    assert audited(folder, "moved_in_cell.mod", "cell.toml")


# -----------------------------------------------------------------------------
# By measured runs.


def logged(folder, name, job, plan, truth):
    """A log of a job's program, every 4 ms, of a robot with another lag."""
    job = read_job(folder / job)
    plans = programmed_plans(job, read_plan_file(folder / plan))
    rows = [
        truth.executed(truth.standing_around(each.q, STEP), STEP, job.robot)
        for each in map(CommandedRun.of, runs_of(job, plans, plan))
    ]
    q = np.degrees(np.concatenate(rows))[::2]
    head = ",".join(["t_s", *(f"q{i}_deg" for i in range(1, 7))])
    table = np.c_[2 * STEP * np.arange(len(q)), q]
    np.savetxt(folder / name, table, delimiter=",", header=head, comments="")


@pytest.mark.slow
def test_measured_runs_correct_the_program_round_by_round(planned, folder):
    truth = Response(sigma=[0.032, 0.03, 0.03, 0.028, 0.03, 0.03])
    job, rests = "job.toml", []
    by = MODEL.replace('"model"', '"correction.json"')
    (folder / "by.toml").write_text(by)
    for k in range(3):
        logged(folder, f"run{k}.csv", job, "out/plan.json", truth)
        asked = ("correct", f"run{k}.csv", "--job", job, "--plan", "out/plan.json", "--json")
        result = run(*asked, cwd=folder)
        assert result.returncode == 0, result.stderr
        found = {each["name"]: each for each in json.loads(result.stdout)["contours"]}
        assert set(found) == {"hole 10", "slot"}
        rests.append(max(each["rounds"][-1]["largest"] for each in found.values()))
        job = "by.toml"
    said = run(*asked[:-1], "-o", "other.json", cwd=folder).stdout
    assert 'write compensate = "other.json" in [program] for the next program' in said
    assert rests[1] < 0.6 * rests[0]
    assert rests[2] <= rests[1]
    result = run("plan", "by.toml", "--out", "by", "--json", cwd=folder)
    found = json.loads(result.stdout)
    assert found["passed"], result.stdout
    assert any("as correction.json has it" in note for note in found["notes"])
    assert audited(folder, "by/by.mod", "by.toml") == set()
    text = (folder / "by" / "by.mod").read_text()
    (folder / "moved.mod").write_text(shifted(text, 0.2))
    assert "nodes" in audited(folder, "moved.mod", "by.toml")


def test_logs_of_nothing_are_refused(planned, folder):
    (folder / "other.csv").write_text(
        "t_s,x_mm,y_mm,z_mm\n" + "\n".join(f"{k},{k},0,0" for k in range(20))
    )
    asked = ("--job", "job.toml", "--plan", "out/plan.json")
    assert_refused(run("correct", "other.csv", *asked, cwd=folder), "a log of this program")
    assert_refused(run("correct", "other.csv", *asked, "--gain", "2", cwd=folder), "--gain")
