"""The Pareto set of a job: the same as the planner's own, kept through death, and plans picked."""

import json
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from commands import run
from jobs import HEAD
from kerfpath import InputError, NoFeasiblePath, pareto
from kerfpath.cad import read as read_drawing
from kerfpath.job import read_job, read_plan_file
from kerfpath.study import pareto_of_job, plan_picked, read_pick, write_pareto

CRITERIA = ("displacement", "velocity", "range_6")
RUNS = 16
TABLES = (
    HEAD
    + """\
[[contour]]
pick = "skin/hole16"
name = "small"
speed_m_min = 3
spacing_mm = 2
[[contour]]
pick = "skin/hole13"
name = "large"
speed_m_min = 3
spacing_mm = 2
[plan]
gamma_step_deg = 4
posture = "front/up"
eta_velocity = 0.9
eta_acceleration = 0.8
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
"""
)


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("job")
    shutil.copy(str(files("kerfpath.demo") / "b_pillar.step"), folder)
    (folder / "job.toml").write_text(TABLES)
    return folder / "job.toml"


@pytest.fixture(scope="module")
def studied(job, tmp_path_factory):
    store = tmp_path_factory.mktemp("store") / "pareto.sqlite"
    return pareto_of_job(job, store=store, criteria=CRITERIA, runs=RUNS, processes=2)


def rows(store):
    with closing(sqlite3.connect(store)) as base:
        return base.execute("SELECT count(*), count(value) FROM result").fetchone()


@pytest.mark.slow
def test_the_front_is_that_of_the_planner_itself(job, studied):
    read = read_job(job)
    part = read_drawing(read.part_file)
    (task,) = [task for task in read.tasks(part) if task.name == "large"]
    own = pareto(
        task.sample(task.candidates(part)[0]),
        read.robot,
        tool=read.tool,
        placement=read.placement,
        speed=task.speed,
        options=read.options,
        criteria=CRITERIA,
        runs=RUNS,
    )
    assert studied.contour == "large", "the longest"
    assert studied.others == ("small",)
    assert len(own.plans) > 3
    np.testing.assert_array_equal(studied.front.values, own.values)
    assert studied.front.numbers == own.numbers
    assert studied.front.failures == own.failures


@pytest.mark.slow
def test_a_study_that_is_killed_goes_on_and_comes_to_the_same(job, studied, tmp_path):
    store = tmp_path / "s"
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nfrom kerfpath.study import pareto_of_job\n"
        f"if __name__ == '__main__':\n    pareto_of_job(Path({str(job)!r}), store=Path("
        f"{str(store)!r}), criteria={CRITERIA!r}, runs={RUNS}, processes=2)\n"
    )
    process = subprocess.Popen([sys.executable, str(script)])
    deadline = time.monotonic() + 60
    while not (store.exists() and _done(store) >= 5):
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = rows(store)[0]
    told = []
    again = pareto_of_job(
        job,
        store=store,
        criteria=CRITERIA,
        runs=RUNS,
        processes=1,
        progress=lambda what, done, total: told.append((done, total)),
    )
    tried = studied.front.tried  # refinements after the last run count, too
    assert told[-1] == (tried, tried)
    assert all(done <= total for done, total in told)
    assert before <= rows(store)[0] == tried >= RUNS, "nothing was done twice"
    np.testing.assert_array_equal(again.front.values, studied.front.values)


def _done(store):
    """Look at a store that a sweep holds: its log tells how far it is."""
    log = Path(f"{store}-wal")
    return log.stat().st_size // 4096 if log.exists() else 0


@pytest.mark.slow
def test_a_cluster_comes_to_the_same_though_a_worker_is_killed(
    job, studied, scheduler, workers, tmp_path
):
    first, _ = workers(2)

    def kill(what, done, total):
        if done >= 4:
            first.kill()

    found = pareto_of_job(
        job,
        store=tmp_path / "s",
        criteria=CRITERIA,
        runs=RUNS,
        scheduler=scheduler,
        progress=kill,
    )
    assert first.wait() == -signal.SIGKILL
    assert rows(tmp_path / "s") == (studied.front.tried, studied.front.tried)
    np.testing.assert_array_equal(found.front.values, studied.front.values)


@pytest.mark.slow
def test_a_plan_that_is_picked_has_the_criteria_of_the_front(job, studied, tmp_path):
    write_pareto(studied, tmp_path)
    entry = json.loads((tmp_path / "pareto.json").read_text())
    assert [plan["number"] for plan in entry["plans"]] == list(studied.front.numbers)
    for which in ("balanced", "range_6", str(studied.front.numbers[0])):
        pick = read_pick(tmp_path, job, which)
        row = studied.front.numbers.index(pick.number)
        _, outcome = plan_picked(job, pick, refine=False)
        assert outcome.passed
        (cut,) = [cut for cut in outcome.cuts if cut.name == "large"]
        (other,) = [cut for cut in outcome.cuts if cut.name == "small"]
        criteria = cut.plan.criteria
        speed, _ = cut.plan.robot.speed_limits()
        assert [
            (criteria.displacement / speed).sum(),
            criteria.peak_velocity.max(),
            criteria.range[5],
        ] == pytest.approx(studied.front.values[row], rel=1e-12)
        run = studied.front.runs[row]
        assert cut.plan.settings.method == ("continuous" if run.continuous else "exact")
        assert cut.plan.proof.optimal == (not run.continuous)
        said = other.plan.proof.statement
        assert "continuous rotation" in said, "the others are planned as the job says"


@pytest.mark.slow
def test_on_the_grid_where_that_is_asked_for_and_refined_from_there(job, tmp_path):
    exact = tmp_path / "exact.toml"
    shutil.copy(job.parent / "b_pillar.step", tmp_path)
    exact.write_text(TABLES.replace("gamma_step_deg", 'method = "exact"\ngamma_step_deg'))
    store = tmp_path / "s"
    studied = pareto_of_job(exact, store=store, criteria=CRITERIA, runs=8, processes=1)
    assert not any(run.continuous for run in studied.front.runs)
    write_pareto(studied, tmp_path)
    pick = read_pick(tmp_path, exact, "displacement")
    _, outcome = plan_picked(exact, pick, refine=True)
    (cut,) = [cut for cut in outcome.cuts if cut.name == "large"]
    assert outcome.passed
    assert cut.plan.cost < cut.plan.proof.grid_cost


@pytest.mark.slow
def test_speed_and_time_of_a_job(job, tmp_path):
    options = {"store": tmp_path / "s", "contour": "small", "runs": 8, "processes": 1}
    studied = pareto_of_job(job, criteria=["time", "speed"], **options)
    assert studied.front.units == ("s", "m/s")
    assert (studied.front.values > 0).all()


def test_what_is_refused(job, studied, tmp_path):
    def refused(match, **given):
        with pytest.raises(InputError, match=match) as caught:
            pareto_of_job(job, **{"store": tmp_path / "s", "processes": 1} | given)
        assert "\n" not in str(caught.value)

    refused("got 'trim'; its contours: small, large", contour="trim")
    refused("got 'elegance'", criteria=["elegance"])
    refused("'clearance' needs a cell", criteria=["clearance"])
    refused("runs: expected a whole number", runs=0)
    refused("ahead: expected a whole number", ahead=0)
    (tmp_path / "s").write_text("no store")
    refused("not the store of a sweep", runs=1)


@pytest.mark.slow
def test_where_no_run_can_have_a_plan_it_says_why(job, tmp_path):
    fast = tmp_path / "fast.toml"
    shutil.copy(job.parent / "b_pillar.step", tmp_path)
    fast.write_text(TABLES.replace("speed_m_min = 3", "speed_m_min = 900"))
    with pytest.raises(NoFeasiblePath, match="no edge within velocity, joint 1") as broken:
        pareto_of_job(fast, store=tmp_path / "s", runs=50, processes=1)
    assert "no motion found off the grid" in str(broken.value)
    assert rows(tmp_path / "s")[0] == 2, "one run on the grid and one off it, and no more"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda path, entry: path.unlink(), "run kerfpath pareto .* first"),
        (lambda path, entry: path.write_text("{"), "expected a front written by kerfpath"),
        (lambda path, entry: path.write_text("[]"), "expected a front written by kerfpath"),
        (
            lambda path, entry: path.write_text(json.dumps(entry | {"kerfpath": "0.0.1"})),
            "written by kerfpath 0.0.1",
        ),
        (
            lambda path, entry: path.write_text(json.dumps(entry | {"digest": "0"})),
            "has changed since",
        ),
    ],
)
def test_a_front_that_is_not_of_this_job_is_refused(job, studied, tmp_path, spoil, said):
    write_pareto(studied, tmp_path)
    path = tmp_path / "pareto.json"
    spoil(path, json.loads(path.read_text()))
    with pytest.raises(InputError, match=said) as caught:
        read_pick(tmp_path, job, "balanced")
    assert "\n" not in str(caught.value)


def test_a_plan_that_is_not_on_the_front_is_refused(job, studied, tmp_path):
    write_pareto(studied, tmp_path)
    beaten = next(n for n in range(RUNS) if n not in studied.front.numbers)
    for which in (str(beaten), "best", "²"):
        with pytest.raises(InputError, match="or a plan of the front: "):
            read_pick(tmp_path, job, which)


@pytest.mark.slow
def test_the_command_finds_a_front_and_writes_a_plan_of_it(job, tmp_path):
    asked = ("--contour", "small", "--criteria", "displacement, velocity", "--runs", "10")
    command = ("pareto", job, "--processes", "1")
    found = run(*command, *asked, cwd=tmp_path)
    assert found.returncode == 0, found.stderr
    assert "displacement s ↓" in found.stdout
    assert (tmp_path / "job-pareto" / "pareto.html").stat().st_size > 1e6
    again = json.loads(run(*command, *asked, "--json", cwd=tmp_path).stdout)
    assert again["contour"] == "small"
    assert again["tried"] >= 10  # refinements follow the last run
    made = json.loads(
        run("pareto", job, "--pick", again["balanced"], "--json", cwd=tmp_path).stdout
    )
    assert made["passed"]
    assert made["picked"]["number"] == again["balanced"]
    folder = tmp_path / "job-pareto" / f"plan-{again['balanced']}"
    assert {path.suffix for path in folder.iterdir()} == {".json", ".csv", ".html", ".mod"}
    assert len(read_plan_file(folder / "plan.json").plans) == 2
    refused = run("pareto", job, "--refine", cwd=tmp_path)
    assert refused.returncode == 2
    assert "only with --pick" in refused.stderr
