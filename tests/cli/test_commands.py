"""The command line as a user meets it: summaries, JSON, files, exit codes, bad input."""

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from commands import assert_refused, run
from jobs import DEMO, SMALL
from kerfpath import robot
from kerfpath.execution import CommandedRun, Response
from kerfpath.execution.path_error import STEP
from kerfpath.job import read_job, read_plan_file, runs_of
from kerfpath.planner import at_least, at_most
from kerfpath.post import MANIFEST
from programs import read_text

CUTS = r"([\d.]+) m/min cuts it in one piece; `kerfpath speed` finds the fastest"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "small.toml").write_text(SMALL)
    return folder


@pytest.fixture(scope="module")
def planned(folder):
    result = run("plan", "small.toml", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


@pytest.fixture(scope="module")
def fastest(folder):
    """What `speed` says of the first contour."""
    return json.loads(run("speed", "small.toml", "--json", cwd=folder).stdout)["contours"][0]


def test_a_lag_is_fitted_to_logs_and_taken_by_the_job(planned, folder):
    job = read_job(folder / "small.toml")
    plans = read_plan_file(folder / "small-plan" / "plan.json").plans
    truth = Response(sigma=[0.02])
    q = np.concatenate(
        [
            truth.executed(truth.standing_around(run.q, STEP), STEP, job.robot)
            for run in map(CommandedRun.of, runs_of(job, plans, "plan.json"))
        ]
    )
    rows = np.c_[STEP * np.arange(len(q)), np.degrees(q)][::3]
    names = ",".join(["t_s", *(f"q{i}_deg" for i in range(1, 7))])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header=names, comments="")
    asked = ("fit", "log.csv", "--job", "small.toml")
    result = run(*asked, "-o", "mine.toml", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["chosen"] == "one sigma"
    assert found["tried"][1]["sigma_ms"] == [pytest.approx(20, abs=0.2)]
    text = SMALL.replace("[tool]", '[robot.response]\nfile = "mine.toml"\n\n[tool]')
    (folder / "own.toml").write_text(text)
    assert read_job(folder / "own.toml").response.standing == "measured"
    assert_refused(run(*asked, "--plan", "none.json", cwd=folder), "none.json")


def test_the_demo_leaves_all_four_files(tmp_path):
    result = run("demo", "--out", tmp_path / "deep" / "demo")
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("passed") == 7
    assert "too short" not in result.stdout + result.stderr
    assert "Collisions are not checked" in result.stdout
    names = {p.name for p in (tmp_path / "deep" / "demo").iterdir()}
    ours = {"plan.json", "trajectory.csv", "report.html", "b_pillar.mod"}
    assert names == {*ours, ".kerfpath.json"}


def test_a_plan_says_what_it_did(planned, folder):
    assert planned["passed"]
    assert [c["name"] for c in planned["contours"]] == ["hole 10", "slot"]
    assert {Path(f).name for f in planned["files"]} == {
        "small.mod", "plan.json", "trajectory.csv", "report.html"
    }  # fmt: skip
    assert all((folder / f).exists() for f in planned["files"])
    for contour in planned["contours"]:
        assert 0 < contour["peak_velocity_share"] <= 0.95
        # 1 mm at 3 m/min is 20 ms, of 24 ms that are assumed; the lag of the joints is, too.
        issues = contour["issues"]
        assert all("[cycle-as-run]" in i or "[tip-as-run]" in i for i in issues)
        assert 0 < contour["bound"] <= contour["cost"]
        assert contour["gap"] <= 0.005  # what is asked for where the job says nothing
        assert "no motion within the limits costs less than" in contour["proof"]


def test_the_trajectory_is_the_plan_in_degrees_and_millimetres(planned, folder):
    text = (folder / "small-plan" / "trajectory.csv").read_text()
    rows = list(csv.DictReader(text.splitlines()))
    plans = {p.name: p for p in read_plan_file(folder / "small-plan" / "plan.json").plans}
    assert len(rows) == sum(len(p.q) for p in plans.values())
    header = "contour,node,kind,t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"
    header += ",axis_x,axis_y,axis_z,gamma_deg,posture"
    assert list(rows[0]) == header.split(",")
    for row in rows[:: len(rows) // 50]:
        plan, k = plans[row["contour"]], int(row["node"])
        q = np.radians([float(row[f"q{i}_deg"]) for i in range(1, 7)])
        np.testing.assert_allclose(q, plan.q[k], atol=1e-12)
        np.testing.assert_allclose(
            [float(row[c]) for c in ("x_mm", "y_mm", "z_mm")], plan.points[k] * 1000, atol=1e-9
        )
        assert row["kind"] == "cut"
        assert float(row["t_s"]) == pytest.approx(plan.time[k])


def test_plan_json_carries_everything_and_round_trips(planned, folder):
    data = json.loads((folder / "small-plan" / "plan.json").read_text())
    assert data["schema"] == 10
    assert data["robot"]["id"] == "abb_irb4600_60_205"
    assert data["job"]["tool"]["head"] == "laser-head-45"
    assert np.array(data["T_flange_tip"]).shape == (4, 4)
    assert data["limits"]["acceleration_source"] == "given by the user"
    for contour in data["contours"]:
        assert {"method", "objective", "metric", "eta_v", "eta_a", "dt", "cost"} <= set(contour)
        assert {"optimal", "criteria", "counts", "audit"} <= set(contour)
        assert contour["audit"]["passed"]
    plan = read_plan_file(folder / "small-plan" / "plan.json").plans[0]
    assert plan.q.tolist() == data["contours"][0]["nodes"]["q_rad"]
    np.testing.assert_array_equal(plan.robot.lower, robot("abb_irb4600_60_205").lower)


def test_post_takes_the_settings_of_a_language_from_the_job_as_it_is_now(planned, folder):
    post = ("post", "small-plan/plan.json", "--language", "krl")
    assert_refused(run(*post, "--strict", cwd=folder), "krl")
    (folder / "there").mkdir()
    guessed = run(*post, "-o", "there/guessed.src", cwd=folder)
    written = {path.name for path in (folder / "there").glob("[!.]*")}
    assert written == {"guessed.src", "guessed.dat"}
    assert "DEF guessed()" in (folder / "there" / "guessed.src").read_text()
    assert_refused(run(*post, "-o", "no name.src", cwd=folder), "letters, digits and _")
    assert "laser, so 1 is used; name it with laser_output in [program.krl]" in guessed.stdout
    text = (folder / "small.toml").read_text() + "\n[program.krl]\nlaser_output = 7\n"
    (folder / "krl.toml").write_text(text)
    done = run(*post, "-o", "krl", "--job", "krl.toml", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "$OUT[7]=TRUE" in (folder / "krl" / "krl.src").read_text()
    other = text.replace("xyz_mm = [1", "xyz_mm = [2", 1)
    assert other != text
    (folder / "other.toml").write_text(other)
    moved = run(*post, "--job", "other.toml", cwd=folder)
    assert moved.returncode == 1
    assert "job.part.xyz_mm" in moved.stderr


def test_the_same_job_gives_the_same_bytes(planned, folder):
    again = run("plan", "small.toml", "--out", "again", cwd=folder)
    assert again.returncode == 0
    for name in ("plan.json", "trajectory.csv", "report.html", "small.mod"):
        assert (folder / "again" / name).read_bytes() == (folder / "small-plan" / name).read_bytes()


def test_post_writes_the_program_that_plan_wrote(planned, folder):
    printed = run("post", "small-plan/plan.json", cwd=folder)
    assert printed.returncode == 0
    # Only the module's name differs: plan.json does not keep the file name of its job.
    written = (folder / "small-plan" / "small.mod").read_text()
    assert printed.stdout.replace("MODULE plan", "MODULE small") == written
    read_text(printed.stdout, robot("abb_irb4600_60_205"))
    to_file = run("post", "small-plan/plan.json", "-o", "again.mod", cwd=folder)
    assert to_file.returncode == 0
    named = printed.stdout.replace("MODULE plan", "MODULE again")
    assert (folder / "again.mod").read_text() == named


def test_audit_shows_the_table_and_passes(planned, folder):
    result = run("audit", "small-plan/plan.json", "--job", "small.toml", cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "audit passed" in result.stdout
    assert "tool axis between the nodes" in result.stdout
    table = json.loads(run("audit", "small-plan/plan.json", "--json", cwd=folder).stdout)
    assert table["passed"]
    assert set(table["contours"]) == {"hole 10", "slot"}


def test_a_plan_that_was_tampered_with_fails_and_gets_no_program(planned, folder):
    data = json.loads((folder / "small-plan" / "plan.json").read_text())
    data["contours"][1]["nodes"]["q_rad"][30][2] += 0.01
    (folder / "bent.json").write_text(json.dumps(data))
    result = run("audit", "bent.json", cwd=folder)
    assert result.returncode == 1
    assert "ERROR" in result.stdout
    assert "audit FAILED" in result.stdout
    refusal = run("post", "bent.json", "-o", "bent.mod", cwd=folder)
    assert refusal.returncode == 1
    assert "fails its audit" in refusal.stderr
    assert not (folder / "bent.mod").exists()


def test_a_part_out_of_reach_is_reported_without_a_program(folder):
    (folder / "far.toml").write_text(SMALL.replace("xyz_mm = [1200", "xyz_mm = [3200"))
    result = run("plan", "far.toml", cwd=folder)
    assert result.returncode == 1
    assert "no admissible pose at node 0" in result.stdout
    assert "unreachable" in result.stdout
    names = {p.name for p in (folder / "far-plan").iterdir()}
    assert names == {MANIFEST, "plan.json", "trajectory.csv", "report.html"}
    data = json.loads((folder / "far-plan" / "plan.json").read_text())
    assert not data["contours"][0]["feasible"]
    assert data["contours"][0]["proved"]
    assert data["contours"][0]["proved_for"] == "every gamma"
    assert data["contours"][0]["closed"] == {"node": -1, "joint": None, "limit": "pose"}
    assert data["contours"][0]["relaxation"] is None
    assert run("audit", "far-plan/plan.json", cwd=folder).returncode == 1
    assert run("post", "far-plan/plan.json", cwd=folder).returncode == 1


@pytest.mark.slow
def test_a_contour_that_is_too_fast_is_told_how_fast_it_could_be(folder, fastest):
    (folder / "fast.toml").write_text(SMALL.replace("speed_m_min = 3", "speed_m_min = 7", 1))
    result = run("plan", "fast.toml", cwd=folder)
    assert result.returncode == 1
    told = re.search(CUTS, result.stdout)
    # No more than `speed` finds with all its searches.
    assert 3 < float(told[1]) <= fastest["fastest_m_min"] < 7
    data = json.loads((folder / "fast-plan" / "plan.json").read_text())["contours"][0]
    assert data["relaxation"]["speed"] * 7 == pytest.approx(float(told[1]), rel=1e-3)
    assert data["proved"]
    assert "m/min cuts it in one piece" in (folder / "fast-plan" / "report.html").read_text()


def test_a_contour_that_is_far_too_fast_is_given_a_speed_at_once(folder):
    far = SMALL.replace("speed_m_min = 3", "speed_m_min = 30", 1)
    (folder / "far-too-fast.toml").write_text(far)
    result = run("plan", "far-too-fast.toml", cwd=folder)
    assert result.returncode == 1
    words = " ".join(result.stdout.split())
    speed = re.search(CUTS, words)
    slower = far.replace("speed_m_min = 30", f"speed_m_min = {speed[1]}", 1)
    (folder / "slower.toml").write_text(slower)
    assert run("plan", "slower.toml", cwd=folder).returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "share"),
    [
        ("", 1.0001),
        ('\nmethod = "paper"', 1.0001),
        ("\nrefine = true", 1.06),
        ("time step", 1.03),  # the nodes follow from the speed
        ('\nmethod = "continuous"', 1.02),
    ],
)
def test_what_a_message_advises_can_be_done(folder, fastest, change, share):
    """A little over the fastest speed: every remedy, as it is printed, is one."""
    method = "" if "method" in change else '\nmethod = "exact"'
    rest = method if "refine" in change else f"{method}\nrefine = false"
    grid = SMALL.replace("[plan]", f"[plan]\ncertify = false{rest}")
    if change == "time step":
        grid = grid.replace("spacing_mm = 1", "time_step_ms = 20", 1)
    else:
        grid = grid.replace("[plan]", f"[plan]{change}")
    off_grid = "refine" in change or "continuous" in change
    over = fastest["fastest_m_min" if off_grid else "on_grid_m_min"] * share
    asked = grid.replace("speed_m_min = 3", f"speed_m_min = {over!r}", 1)
    (folder / "over.toml").write_text(asked)
    result = run("plan", "over.toml", "--out", "advised", cwd=folder)
    assert result.returncode == 1
    message = result.stdout
    speeds = re.findall(CUTS if "continuous" in change else r"up to ([\d.]+) m/min", message)
    shares = re.findall(r"(eta_\w+) = ([\d.]+)", message)
    assert len(speeds) == (2 if "refine" in change else 1)
    assert all(float(speed) < over for speed in speeds)
    assert all(0.9 < float(value) <= 1 for _, value in shares)
    # Off the grid no share may be found that opens; then none is said.
    assert shares or off_grid or change == "time step"
    assert ('with method = "exact"' in message) == ("paper" in change)
    then = grid.replace('"paper"', '"exact"')
    remedies = [then.replace("speed_m_min = 3", f"speed_m_min = {speed}", 1) for speed in speeds]
    then = asked.replace('"paper"', '"exact"')
    remedies += [re.sub(rf"{key} = [\d.]+", f"{key} = {value}", then) for key, value in shares]
    for remedy in remedies:
        (folder / "advised.toml").write_text(remedy)
        assert run("plan", "advised.toml", "--out", "advised", cwd=folder).returncode == 0


def test_a_method_that_finds_no_path_where_there_is_one_is_told_of_the_other(folder, fastest):
    paper = SMALL.replace("[plan]", '[plan]\ncertify = false\nmethod = "paper"')
    under = f"speed_m_min = {0.9999 * fastest['on_grid_m_min']!r}"
    (folder / "paper.toml").write_text(paper.replace("speed_m_min = 3", under, 1))
    result = run("plan", "paper.toml", cwd=folder)
    assert result.returncode == 1
    assert 'a path exists at the speed asked for with method = "exact"' in result.stdout
    assert not re.search(r"up to [\d.]+ m/min|eta_\w+ =", result.stdout)
    exact = (folder / "paper.toml").read_text().replace('method = "paper"', "refine = false")
    (folder / "paper.toml").write_text(exact)
    assert run("plan", "paper.toml", cwd=folder).returncode == 0


@example(1e-5, 4)
@example(0.1, 4)
@given(st.floats(1e-6, 1e6), st.integers(1, 6))
def test_rounded_figures_keep_what_they_say(value, digits):
    step = 10.0 ** (1 - digits) + 1e-15  # the products are rounded themselves
    assert value * (1 - step) <= float(at_most(value, digits)) <= value
    assert value <= float(at_least(value, digits)) <= value * (1 + step)


def test_the_tolerance_between_nodes_is_the_jobs(folder):
    # Of the tip it is known before planning, of the axis it is not: the joints decide.
    tight = SMALL.replace("path_tolerance_mm = 0.1", "axis_tolerance_deg = 0.001")
    (folder / "tight.toml").write_text(tight)
    result = run("plan", "tight.toml", cwd=folder)
    assert result.returncode == 1
    assert "tool axis between the nodes" in result.stdout
    assert "sample the contour more finely" in result.stdout
    assert not (folder / "tight-plan" / "tight.mod").exists()
    again = run("audit", "tight-plan/plan.json", "--job", "tight.toml", cwd=folder)
    assert again.returncode == 1
    data = json.loads((folder / "tight-plan" / "plan.json").read_text())
    assert not data["contours"][0]["audit"]["passed"]
    # Without the drawing post could not see it again: it takes the plan's word.
    assert run("post", "tight-plan/plan.json", cwd=folder).returncode == 1


def test_an_older_program_in_the_folder_is_pointed_out(folder):
    (folder / "stale").mkdir()
    (folder / "stale" / "far.mod").write_text("MODULE old\nENDMODULE\n")
    (folder / "far.toml").write_text(SMALL.replace("xyz_mm = [1200", "xyz_mm = [3200"))
    result = run("plan", "far.toml", "--out", "stale", cwd=folder)
    assert result.returncode == 1
    assert "is from an earlier run and does not belong to this plan" in result.stderr


@pytest.mark.slow
def test_a_refusal_says_that_no_rotation_would_do(folder, fastest):
    asked = f"speed_m_min = {1.3 * fastest['impossible_from_m_min']}"
    (folder / "never.toml").write_text(SMALL.replace("speed_m_min = 3", asked, 1))
    result = run("plan", "never.toml", "--out", "never", "--json", cwd=folder)
    assert result.returncode == 1
    entry = json.loads(result.stdout)["contours"][0]
    assert entry["proved_for"] == "every gamma"
    assert set(entry["closed"]) == {"node", "joint", "limit"}
    assert 0 < entry["relaxation"]["speed"] < 1
    assert "no motion continues from node" in entry["reason"]


@pytest.mark.slow
def test_speed_names_the_fastest_and_what_binds(folder, fastest):
    result = run("speed", "small.toml", cwd=folder)
    assert result.returncode == 0, result.stderr
    number = r" +\d+\.\d+"
    row = rf"hole 10 +3{number}{number}{number}{number}{number} +\d+ +joint \d acceleration"
    assert re.search(row, result.stdout)
    assert fastest["impossible_from_m_min"] > fastest["fastest_m_min"]
    assert fastest["fastest_m_min"] > fastest["on_grid_m_min"] > fastest["asked_m_min"]
    assert fastest["fastest_m_min"] >= fastest["as_run_m_min"] > fastest["asked_m_min"]
    assert 0 < fastest["true_to_path_m_min"] < fastest["asked_m_min"]  # by the lag assumed
    assert fastest["asked_m_min"] == pytest.approx(3)
    # A job at that speed is feasible, one a little over it is not, unless gamma leaves its grid.
    for share, refine, code in ((0.999, "false", 0), (1.01, "false", 1), (1.01, "true", 0)):
        asked = f"speed_m_min = {fastest['on_grid_m_min'] * share}"
        edge = SMALL.replace("speed_m_min = 3", asked, 1)
        (folder / "edge.toml").write_text(
            edge.replace("[plan]", f'[plan]\ncertify = false\nmethod = "exact"\nrefine = {refine}')
        )
        assert run("plan", "edge.toml", "--out", "edge", cwd=folder).returncode == code
    (folder / "far.toml").write_text(SMALL.replace("xyz_mm = [1200", "xyz_mm = [3200"))
    far = run("speed", "far.toml", cwd=folder)
    assert far.returncode == 1
    assert "no admissible pose" in far.stdout


@pytest.mark.slow
def test_a_job_may_dip_or_be_interrupted_and_is_read_back(folder):
    """Over the fastest speed on the grid: slowed down in places, or cut in pieces."""
    # The cut stops where a pose is at the edge of what the arm can do: little room to back off.
    base = SMALL.replace("speed_m_min = 3", "speed_m_min = 3.7", 1).replace("= 50", "= 1", 1)
    assert "retract_mm = 1" in base
    for key, word in (
        ('feed = "dip"', "full speed on"),
        ('interruptions = "fewest"', "piece 1 of"),
    ):
        job = base.replace(
            "[plan]", f'[plan]\ncertify = false\nmethod = "exact"\nrefine = false\n{key}'
        )
        (folder / "over.toml").write_text(job)
        done = run("plan", "over.toml", "--out", "over", cwd=folder)
        assert done.returncode == 0, done.stdout + done.stderr
        assert word in done.stdout
        again = run("audit", "over/plan.json", "--job", "over.toml", cwd=folder)
        assert again.returncode == 0, again.stdout
        data = json.loads((folder / "over" / "plan.json").read_text())
        assert {c["contour"] for c in data["contours"]} == {"hole 10", "slot"}
        post = run("post", "over/plan.json", "-o", "over/again.mod", cwd=folder)
        assert post.returncode == 0, post.stderr
        again, first = ((folder / "over" / f).read_text() for f in ("again.mod", "over.mod"))
        assert again.replace("MODULE again", "MODULE over") == first


@pytest.mark.slow
def test_short_pieces_are_warned_of_and_a_job_may_ask_for_longer_ones(folder):
    base = SMALL.replace("speed_m_min = 3", "speed_m_min = 3.7", 1).replace("= 50", "= 1", 1)
    base = base.replace(
        "[plan]",
        '[plan]\ncertify = false\nmethod = "exact"\nrefine = false\ninterruptions = "fewest"\nKEY',
    )

    def cut(key):
        (folder / "pieces.toml").write_text(base.replace("KEY", key))
        done = run("plan", "pieces.toml", "--out", "pieces", cwd=folder)
        plans = read_plan_file(folder / "pieces" / "plan.json").plans if not done.returncode else ()
        return done, [np.ptp(p.contour.s) * 1e3 for p in plans if "piece" in p.name]

    done, free = cut("")
    assert (f"pieces is {min(free):.1f} mm" in done.stdout) == (min(free) < 20)
    done, longer = cut(f"least_piece_mm = {min(free) + 1:.3f}")
    assert done.returncode == 0, done.stdout + done.stderr
    assert min(longer) >= min(free) + 1
    assert "shortest of its" not in done.stdout
    done, _ = cut("least_piece_mm = 16.5")  # more than half of it
    assert done.returncode == 1
    assert "no division into pieces of 16.5 mm or more keeps the limits" in done.stdout


def test_contours_lists_the_loops_by_name():
    result = run("contours", DEMO / "b_pillar.step")
    assert result.returncode == 0
    assert "1200.0 x 325.2 x 116.8 mm" in result.stdout
    assert re.search(r"skin/outer +\S+ +2906\.13", result.stdout)
    data = json.loads(run("contours", DEMO / "b_pillar.step", "--json").stdout)
    outer = next(loop for loop in data["loops"] if loop["name"] == "skin/outer")
    assert outer["length_m"] == pytest.approx(2.906, abs=1e-3)
    scaled = json.loads(run("contours", DEMO / "b_pillar.step", "--unit", "in", "--json").stdout)
    size = np.ptp(scaled["bounding_box_m"], axis=0)
    np.testing.assert_allclose(size, 25.4 * np.ptp(data["bounding_box_m"], axis=0), rtol=1e-6)


@pytest.mark.parametrize("command", ["plan", "check"])
def test_a_drawing_is_shown_before_its_job_is_planned(folder, tmp_path, command):
    arguments = ["--out", tmp_path / "out"] if command == "plan" else []
    first = run(command, folder / "small.toml", *arguments).stdout.splitlines()[0]
    listed = run("contours", folder / "b_pillar.step").stdout.splitlines()[0]
    assert first == listed
    for words in ("mm (file in mm)", "122 loops of 16.9 to 2906.1 mm", "gap", "shortest edge"):
        assert words in first


def test_robots_lists_the_library_and_shows_sources():
    assert "69 robots" in run("robots").stdout
    shown = run("robots", "abb_irb2400_155").stdout
    assert "joint 2 + joint 3: -60 to 65 deg" in shown
    assert re.search(r"^acceleration deg/s\^2 +not known *$", shown, re.MULTILINE)
    assert "source of geometry limits velocity: ros-industrial/abb" in shown
    data = json.loads(run("robots", "kuka_kr120_r2500_pro", "--json").stdout)
    assert data["lower_deg"] is None
    assert "copy error" in data["limits_missing"]
    assert len(json.loads(run("robots", "--json").stdout)["robots"]) == 69


def test_robots_lists_rails_and_positioners_too():
    listed = run("robots").stdout
    row = next(line for line in listed.splitlines() if line.startswith("kuka_dkp400.tilt"))
    said = ["-90 to 90 deg", "94.5 deg/s", "set in job"]
    assert re.split(r"  +", row.strip())[1:] == ["KUKA DKP-400", "400", *said]
    assert "4 rails and positioners" in listed
    shown = run("robots", "kuka_dkp400").stdout
    assert "payload 400 kg" in shown
    assert "source of velocity: secondary: visose/Robots" in shown
    tilt, table = json.loads(run("robots", "kuka_dkp400", "--json").stdout)["axes"]
    assert (tilt["model"], tilt["upper_deg"], tilt["velocity_deg_s"]) == (
        "kuka_dkp400.tilt",
        90,
        94.5,
    )
    assert tilt["acceleration_deg_s2"] is None
    assert table["endless"]
    assert table["point_mm"] == [0, 0, 510]
    products = json.loads(run("robots", "--json").stdout)["externals"]
    assert [product["id"] for product in products][1:3] == ["kuka_kl1000_2", "kuka_kl4000"]
    assert products[1]["axes"][0]["velocity_mm_s"] == 1890


def test_help_teaches():
    for command in ("demo", "plan", "speed", "post", "audit", "script", "contours", "robots"):
        result = run(command, "--help")
        assert result.returncode == 0
        assert f"Example: kerfpath {command}" in result.stdout
    assert "kerfpath demo" in run("--help").stdout
    assert run("--version").stdout == "kerfpath 0.1.0\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("plan", "none.toml"), ["none.toml", "no such file"]),
        (("plan", "."), ["got a folder"]),
        (("post", "none.json"), ["none.json", "cannot be read"]),
        (("post", "small.toml"), ["not a plan.json"]),
        (("post", "list.json"), ['expected a plan.json with schema 10, got "list"']),
        (("post", "old.json"), ["schema 10, got 0", "plan the job again"]),
        (("post", "short.json"), ["the key kerfpath is missing", "plan the job again"]),
        (("audit", "none.json"), ["cannot be read"]),
        (("audit", "small-plan/plan.json", "--job", "none.toml"), ["no such file"]),
        (
            ("post", "small-plan/plan.json", "--language", "karel"),
            ["'karel' is not known", "rapid"],
        ),
        (("post", "small-plan/plan.json", "-o", "no/such/folder/x.mod"), ["cannot write"]),
        (
            ("post", "small-plan/plan.json", "-o", "/dev/null"),
            ["/dev/null: cannot write (it is a device"],
        ),
        (("contours", "none.step"), ["none.step"]),
        (("contours", "small.toml"), ["small.toml"]),
        (("contours", "b_pillar.step", "--unit", "ell"), ["ell"]),
        (("robots", "abb_irb9999"), ["not in the library"]),
        (("plan", "wrong-loop.toml", "--out", "wrong"), ["no loop 'skin/hole99'", "skin/hole1"]),
        (("plan", "slow.toml", "--out", "wrong"), ["slow.toml:", "speed_m_min"]),
        (("plan", "small.toml", "--out", "small.toml"), ["small.toml", "folder"]),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(planned, folder, arguments, words):
    (folder / "list.json").write_text("[]")
    (folder / "old.json").write_text('{"schema": 0}')
    (folder / "short.json").write_text('{"schema": 10}')
    (folder / "wrong-loop.toml").write_text(SMALL.replace("skin/hole16", "skin/hole99"))
    (folder / "slow.toml").write_text(SMALL.replace("speed_m_min = 3", "speed_m_min = -3", 1))
    before = sorted(folder.iterdir())
    assert_refused(run(*arguments, cwd=folder), *words)
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("arguments", [("nonsense",), ("plan",), ("robots", "--colour")])
def test_wrong_usage_has_exit_code_two_and_no_traceback(arguments):
    result = run(*arguments)
    assert result.returncode == 2
    assert "Traceback" not in result.stderr
    assert "--help" in result.stderr


@pytest.mark.slow
def test_a_reader_that_leaves_early_is_no_error():
    code = "from kerfpath.cli import main; main()"
    pipe = f"{sys.executable} -c '{code}' contours {DEMO / 'b_pillar.step'} --json | head -c 10"
    result = subprocess.run(pipe, shell=True, capture_output=True, text=True, check=False)
    assert "Traceback" not in result.stderr


@pytest.mark.slow
def test_a_program_with_a_folder_of_its_own_is_written_audited_and_removed(folder):
    text = SMALL.replace('model = "abb_irb4600_60_205"', 'model = "staubli_tx2_160l"')
    text = text.replace('"rapid"', '"val3"\nname = "a_very_long_program_name"')
    text = text.replace("lead_time_s = 0.01", "lead_time_s = 0")
    text = text.replace("[plan]", '[plan]\ncertify = false\nmethod = "exact"\nrefine = false')
    text += "\n[program.val3]\nlaser_output = 'BasicIO-1\\%Q0'\nlines_per_file = 100\n"
    (folder / "val3.toml").write_text(text)
    result = run("plan", "val3.toml", "--out", "val3", cwd=folder)
    assert result.returncode == 0, result.stderr
    main_file = folder / "val3" / "a_very_long_pro" / "a_very_long_pro.pjx"
    assert "<Library alias=" in main_file.read_text()
    result = run("audit", main_file, "--job", "val3.toml", cwd=folder)
    assert result.returncode == 0, result.stdout + result.stderr
    (folder / "val3.toml").write_text(text.replace("speed_m_min = ", "speed_m_min = 99"))
    result = run("plan", "val3.toml", "--out", "val3", cwd=folder)
    assert result.returncode == 1
    assert "a_very_long_pro.pjx, of an earlier run" in result.stdout.replace("\n", " ")
    assert not main_file.parent.exists()


def test_a_job_is_written_as_a_script_that_finds_its_drawing(folder, tmp_path):
    printed = run("script", "small.toml", cwd=folder)
    assert printed.returncode == 0, printed.stderr
    assert "cad.read(HERE / 'b_pillar.step'" in printed.stdout
    compile(printed.stdout, "small.py", "exec")
    (tmp_path / "deep").mkdir()
    result = run("script", "small.toml", "-o", tmp_path / "deep" / "small.py", cwd=folder)
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "deep" / "small.py").read_text()
    (named,) = re.findall(r"cad\.read\(HERE / '([^']+)'", text)
    assert (tmp_path / "deep" / named).samefile(folder / "b_pillar.step")
    beside = text.replace(named, "b_pillar.step")
    assert [x for x in beside.splitlines() if "Put it beside" not in x] == [
        x for x in printed.stdout.splitlines() if "Put it beside" not in x
    ]
    (folder / "ordered.toml").write_text(SMALL + "\n[sequence]\nhome_deg = [0, 0, 0, 0, 90, 0]\n")
    assert_refused(
        run("script", "ordered.toml", cwd=folder), "cannot express [sequence]", "run_job"
    )
    assert_refused(run("script", "small.toml", "-o", "no/where.py", cwd=folder), "cannot write")


def test_help_keeps_the_names_of_tables():
    """Rich would take words in brackets for its own marks."""
    assert "[sequence]" in run("pareto", "--help").stdout
    assert "[program.LANGUAGE]" in run("post", "--help").stdout
