"""Jobs that say how a contour is cut, in which order, and how the robot gets there."""

import csv
import json
import shutil

import numpy as np
import pytest

from commands import assert_refused, run
from jobs import CONTOURS, DEMO, HEAD, PLAN, SEQUENCE, SLIT_JOB, WHOLE, write_slit_jobs
from kerfpath import audit, robot
from kerfpath.cad import read
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.job import audit_file, program_from_file, read_job, read_plan_file, run_job
from kerfpath.job.output.writing import write_result
from programs import read_text


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("part")
    shutil.copy(DEMO / "b_pillar.step", folder)
    (folder / "job.toml").write_text(WHOLE)
    return folder


@pytest.fixture(scope="module")
def done(folder):
    result = run("plan", str(folder / "job.toml"), "--out", str(folder / "out"), "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout), folder / "out"


def test_every_cut_says_how_far_its_nodes_leave_the_drawing(done, folder):
    said, out = done
    part = read(folder / "b_pillar.step")
    found = {entry["name"]: entry["departure"] for entry in said["contours"]}
    plans = {p.name: p.contour for p in read_plan_file(out / "plan.json").plans}
    assert found["joined"]["against"] == "CAD curve"
    again = part.departure("skin/hole21", plans["joined"])
    assert found["joined"]["chord_error"] == pytest.approx(again.chord_error, rel=1e-9)
    # Kerf makes another path of the loop, and so does a bevel of the axes.
    for name, pick in (("led in", "skin/hole1"), ("cornered", "skin/hole13")):
        assert found[name]["against"] == "path as cut"
        loop = part.departure(pick, part.contour(pick))
        assert found[name]["path"]["against"] == "CAD curve"
        assert found[name]["path"]["chord_error"] == loop.chord_error
    page = (out / "report.html").read_text()
    assert page.count("Largest chord error") == 3
    assert f"{again.chord_error * 1e3:.4f} mm, after node" in page


def test_a_part_is_planned_audited_and_written_as_one_program(done):
    said, out = done
    assert said["passed"]
    assert {entry["name"] for entry in said["contours"]} == {"led in", "joined", "cornered"}
    times = said["sequence"]
    assert times["cycle_s"] == pytest.approx(
        times["cutting_s"] + times["air_s"] + times["piercing_s"]
    )
    assert times["piercing_s"] == pytest.approx(0.75)
    assert len(times["moves"]) == 4
    program = read_text((out / "job.mod").read_text(), robot("abb_irb4600_60_205"))
    assert len(program.sections) == 3


def test_kinds_and_air_moves_are_in_the_trajectory(done):
    _, out = done
    rows = list(csv.DictReader((out / "trajectory.csv").read_text().splitlines()))
    by_contour = {}
    for row in rows:
        by_contour.setdefault(row["contour"], []).append(row)
    assert {row["kind"] for row in by_contour["led in"]} == {
        "pierce", "lead-in", "cut", "overlap", "lead-out",
    }  # fmt: skip
    assert {row["kind"] for row in by_contour["joined"]} == {"cut", "micro joint"}
    assert {row["kind"] for row in by_contour["air"]} == {"air"}
    # From home and back to it.
    home = [0, -20, 10, 0, 60, 0]
    for row in (rows[0], rows[-1]):
        q = [float(row[f"q{i}_deg"]) for i in range(1, 7)]
        turns = np.array([0, 0, 0, 1, 0, 1]) * 360
        off = np.abs(np.array(q) - home)
        np.testing.assert_allclose(
            np.where(turns > 0, np.minimum(off % 360, 360 - off % 360), off), 0, atol=1e-9
        )


def test_a_plan_read_back_gives_the_same_program(done):
    _, out = done
    file = read_plan_file(out / "plan.json")
    assert len(file.moves) == 4
    kinds = {plan.name: set(plan.contour.kinds) for plan in file.plans}
    assert "micro joint" in kinds["joined"]
    written, _ = program_from_file(out / "plan.json", "rapid")
    assert written == {"job.mod": (out / "job.mod").read_text()}


def test_the_slowed_corner_is_slow_and_the_rest_is_not(done):
    _, out = done
    plans = {plan.name: plan for plan in read_plan_file(out / "plan.json").plans}
    plan = plans["cornered"]
    speed = np.diff(plan.contour.s) / np.diff(plan.time)
    assert speed.max() == pytest.approx(0.05, rel=0.21)  # steps may be a fifth shorter
    assert speed.min() < 0.3 * speed.max()


def test_the_audit_against_the_drawing_knows_what_was_made_of_it(folder, done):
    _, out = done
    result = run("audit", str(out / "plan.json"), "--job", str(folder / "job.toml"))
    assert result.returncode == 0, result.stdout + result.stderr
    # Another kerf is another path.
    other = folder / "other.toml"
    other.write_text(WHOLE.replace("kerf_mm = 0.2", "kerf_mm = 1.2"))
    result = run("audit", str(out / "plan.json"), "--job", str(other), "--json")
    assert result.returncode == 1, result.stderr
    found = json.loads(result.stdout)["contours"]
    assert any("kerf_mm" in c["title"] for c in found["plan.json"])
    assert not all(c["ok"] for c in found["led in"])


ALL = """\
[[contour]]
speed_m_min = 3
spacing_mm = 4
[contour.pick_all]
kind = "inner"
face = "skin"
diameter_mm = [15, 26]
"""


def test_loops_are_picked_by_what_they_are(folder):
    job = read_job(with_text(folder / "all.toml", HEAD + ALL + PLAN))
    names = [task.name for task in job.tasks(read(job.part_file))]
    assert names == ["skin/hole3", "skin/hole13", "skin/hole21", "skin/hole24"]
    twice = read_job(with_text(folder / "all.toml", HEAD + ALL + ALL + PLAN))
    with pytest.raises(InputError, match="'skin/hole3' is picked twice"):
        twice.tasks(read(twice.part_file))
    none = ALL.replace("[15, 26]", "[900, 901]")
    nothing = read_job(with_text(folder / "all.toml", HEAD + none + PLAN))
    with pytest.raises(InputError, match="no loop among"):
        nothing.tasks(read(nothing.part_file))
    for old, new, message in (
        ("[contour.pick_all]", 'pick = "x"\n[contour.pick_all]', "expected pick .* got both"),
        ("speed", 'name = "n"\nspeed', "expected name only with pick"),
        ("[15, 26]", "[14]", "expected 2 numbers"),
        ('"inner"', '"iner"', "kind"),
    ):
        with pytest.raises(InputError, match=message):
            read_job(with_text(folder / "all.toml", HEAD + ALL.replace(old, new, 1) + PLAN))


def with_text(path, text):
    path.write_text(text)
    return path


@pytest.mark.slow
def test_the_given_order_is_kept_on_request(folder):
    job = folder / "given.toml"
    job.write_text(WHOLE.replace("[sequence]", '[sequence]\norder = "given"'))
    result = run("plan", str(job), "--out", str(folder / "given"), "--json")
    assert result.returncode == 0, result.stderr
    names = [entry["name"] for entry in json.loads(result.stdout)["contours"]]
    assert names == ["led in", "joined", "cornered"]


BAD = [
    ("count = 2\n[[contour]]", "count = 0\n[[contour]]", "count: expected a whole number from 1"),
    ('shape = "arc"\nangle_deg = 90', "angle_deg = 100", 'angle_deg up to 90 with shape = "line"'),
    ("length_mm = 3\n", "length_mm = -3\n", "lead_out.length_mm: expected a number not below 0"),
    ("start_mm = 10", 'start_mm = 10\nstart = "smoothest"', "start or start_mm, got both"),
    ("[sequence]", "[sequences]", "nearest: sequence"),
    ("home_deg = [0, -20, 10, 0, 60, 0]", "home_deg = [0, 0]", "6 numbers, one for every joint"),
    ("slow_share = 0.1", "round_mm = 0.1\nloop_mm = 1", "round_mm or loop_mm, got both"),
    ("ramp_mm = 6", "ramps_mm = 6", "expected a key of [contour.corners]"),
    ("spacing_mm = 2\nstart =", "count = 40\nstart =", "expected spacing_mm or time_step_ms with"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD)
def test_bad_keys_are_refused_with_their_place(folder, old, new, message):
    assert old in WHOLE
    bad = folder / "bad.toml"
    bad.write_text(WHOLE.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        read_job(bad)
    assert message in str(error.value)
    assert "bad.toml:" in str(error.value)


def test_what_is_best_needs_a_sequence(folder):
    bad = folder / "bad.toml"
    bad.write_text(HEAD + CONTOURS + PLAN)
    with pytest.raises(InputError, match=r"contour.start: expected \[sequence\]"):
        read_job(bad)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("length_mm = 4\nshape", "length_mm = 60\nshape", "leaves the surface"),
        ("kerf_mm = 0.2", "kerf_mm = 40", "the beam does not fit"),
        ("width_mm = 2", "width_mm = 200", "do not fit into"),
        ("overlap_mm = 2", "overlap_mm = 2000", "expected less than the contour's"),
    ],
)
def test_operations_that_cannot_be_are_one_line_and_code_2(folder, old, new, message):
    bad = folder / "bad.toml"
    bad.write_text(WHOLE.replace(old, new, 1))
    assert_refused(run("plan", str(bad), "--out", str(folder / "bad")), message)


@pytest.mark.slow
def test_every_cut_of_the_shipped_part_can_be_made():
    job = read_job(DEMO / "b_pillar_part.toml")
    part = read(job.part_file)
    tasks = job.tasks(part)
    assert len(tasks) == 25
    for task in tasks:
        shaped = task.candidates(part)
        assert len(shaped) == (1 if task.name == "trim" else 2)
        for cut in shaped:
            assert {"pierce", "lead-in", "cut"} <= set(task.sample(cut).kinds)


def test_a_contour_that_no_way_leads_to_is_planned_in_its_other_postures(folder, monkeypatch):
    path = folder / "one.toml"
    path.write_text(HEAD + CONTOURS.split('[[contour]]\npick = "skin/hole21"')[0] + PLAN + SEQUENCE)
    done, plans = [], []

    def order_plans(candidates, *, more, **order):
        plans.extend([*candidates[0], *more(0)])
        raise NoFeasiblePath("no way", proved=False, node=-1)

    monkeypatch.setattr("kerfpath.sequence.part.order_plans", order_plans)
    result = run_job(read_job(path), progress=lambda *words: done.append(words))
    assert str(result.stuck) == "no way"
    # The job allows two postures, front/up with either wrist; it has two candidates, planned in the
    # same one. Others are in the other posture, or turned about the beam.
    found = [{int(p) for p in plan.posture} for plan in plans]
    assert found[0] == found[1]
    assert {0} in found
    assert {1} in found
    assert all(each in ({0}, {1}) for each in found)
    assert not any(issue.level == "error" for plan in plans for issue in audit(plan))
    assert ("led in: other postures", 0, 1) in done


def test_slow_transfer_moves_are_those_that_the_job_asks_for(tmp_path):
    slow = SLIT_JOB + "[sequence]\n[program]\nair_speed = 0.5\n"
    write_slit_jobs(tmp_path, {"full": SLIT_JOB + "[sequence]\n", "half": slow})
    write_result(run_job(read_job(tmp_path / "half.toml")), tmp_path / "out")
    plan = tmp_path / "out/plan.json"
    assert audit_file(plan, tmp_path / "half.toml").passed
    assert not audit_file(plan, tmp_path / "full.toml").passed
