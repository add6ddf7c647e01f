"""No harmful edit of a plan.json, or of its job, passes the audit with the job."""

import json
import shutil
from functools import lru_cache, partial

import numpy as np
import pytest
from benchmarks import _plan_jobs, plan_edits
from tests.arms import job_of_arm

import kerfpath
from commands import run
from jobs import DEMO, SMALL
from kerfpath.errors import InputError
from kerfpath.job import (
    Audit,
    audit_file,
    plan_file_text,
    prepare,
    read_job,
    read_plan_file,
    run_job,
)

DEFAULTS = ("metric", "retract_mm", "path_tolerance_mm")
EDITS = 25
"""Of each of the jobs: what a few seconds allow. `python -m benchmarks plan_edits` does 3000."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("edits")


@pytest.fixture(scope="module")
def made(folder):
    """Give job file and plan of a name, planned when first asked for: workers share the tests."""
    return lru_cache(partial(_plan_jobs.planned, folder))


@pytest.mark.slow
def test_no_harmful_edit_of_a_plan_passes(made):
    tally = plan_edits.Tally()
    for job, plan in map(made, _plan_jobs.JOBS):
        audit = Audit.of(job)
        plan_edits.edited_plans(tally, lambda p, a=audit: a.audited(p).passed, plan, EDITS, seed=1)
    assert tally.passed == []
    assert tally.broke == []
    assert tally.total("caught") > EDITS  # the edits do get as far as the audit
    # What is harmless need not be passed, but a plan as it is, and words alone, are.
    assert len(tally.alarms) < EDITS / 10


@pytest.mark.slow
def test_no_harmful_edit_of_a_plan_with_torques_passes(tmp_path):
    shutil.copy(DEMO / "b_pillar.step", tmp_path)
    hole, rest = SMALL.rsplit("[[contour]]", 1)
    # Without the values that are the defaults, whose removal from the plan's copy does no harm.
    text = hole + rest[rest.index("[plan]") :]
    text = "".join(row for row in text.splitlines(True) if row.split(" = ")[0] not in DEFAULTS)
    job, plan = tmp_path / "job.toml", tmp_path / "plan.json"
    job.write_text(job_of_arm(tmp_path, text))
    outcome = run_job(read_job(job))
    assert outcome.passed
    plan.write_text(plan_file_text(outcome))
    tally = plan_edits.Tally()
    audit = Audit.of(job)
    plan_edits.edited_plans(tally, lambda p: audit.audited(p).passed, plan, 2 * EDITS, seed=5)
    assert tally.passed == []
    assert tally.broke == []
    assert tally.total("caught") > EDITS / 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["part", "cell", "dip", "external", "pieces"])
def test_no_job_edited_since_passes(made, name):
    job, plan = made(name)
    assert audit_file(plan, job).passed
    found = [
        (what, plan_edits.judged(lambda p, o=other: audit_file(p, o).passed, plan))
        for what, other in plan_edits.edited_jobs(job)
    ]
    assert len(found) >= 5
    assert [what for what, verdict in found if verdict == "passed"] == []
    assert [verdict for _, verdict in found if verdict.startswith("broke")] == []


def test_without_its_job_a_plan_says_what_was_taken_from_it(made, folder):
    _, plan = made("part")
    found = audit_file(plan)
    assert found.passed
    assert "Limits, tool, placement and speed were taken from the plan itself" in found.note
    data = json.loads(plan.read_text())
    data["contours"][0]["nodes"]["gamma_rad"][3] += 0.01
    (folder / "turned.json").write_text(json.dumps(data))
    (said,) = (c for c in audit_file(folder / "turned.json").tables["hole"] if not c.ok)
    assert said.node == 3
    assert "nodes.gamma_rad" in said.title


def test_a_finding_says_contour_node_what_was_expected_and_what_was_found(made, folder):
    job, plan = made("part")
    data = json.loads(plan.read_text())
    trim = next(entry for entry in data["contours"] if entry["name"] == "trim")
    trim["nodes"]["kind"][7] = "micro joint"
    (folder / "bridged.json").write_text(json.dumps(data))
    result = run("audit", str(folder / "bridged.json"), "--job", str(job), "--json")
    assert result.returncode == 1
    (said,) = (c for c in json.loads(result.stdout)["contours"]["trim"] if not c["ok"])
    assert said["node"] == 7
    assert "expected cut, found micro joint" in said["title"]


def test_what_is_only_claimed_is_said_to_be(made):
    job, plan = made("part")
    note = audit_file(plan, job).note
    assert "Claimed, not verified: the bound of hole, trim and that no order" in note


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"schema": ', '"schema": 3, "schema": ', 'the key "schema" is twice'),
        ('"dt": ', '"dt": true, "was": ', "contours.0.dt: expected a valid number, got true"),
        ('"dt": ', '"dt": "1.0", "was": ', 'contours.0.dt: expected a valid number, got "1.0"'),
        ('"dt": ', '"dt": NaN, "was": ', "expected a number, got NaN"),
        ('"dt": ', '"dt": 1e400, "was": ', "contours.0.dt: expected less than or equal to"),
        ('"dt": ', '"extra": 1, "dt": ', "the key contours.0.extra is not known"),
        ('"dt": ', '"d_t": ', "the key contours.0.dt is missing"),
    ],
)
def test_a_plan_is_read_strictly(made, folder, old, new, said):
    _, plan = made("dip")
    bad = folder / "bad.json"
    bad.write_text(plan.read_text().replace(old, new, 1))
    with pytest.raises(InputError) as error:
        read_plan_file(bad)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_the_plans_of_a_file_are_public(made):
    _, plan = made("part")
    plans = kerfpath.read_plan_file(plan).plans
    assert [p.name for p in plans] == ["hole", "trim"]
    assert np.isfinite(plans[0].q).all()


def test_a_move_through_a_fixture_is_found(made, folder, tmp_path):
    job, plan = made("part")
    shutil.copy(job.with_name("plate.dxf"), tmp_path)
    moves = kerfpath.read_plan_file(plan).moves
    robot = kerfpath.read_plan_file(plan).plans[0].robot
    flange = robot.forward((moves[0].q[0] + moves[0].q[-1]) / 2)[:3, 3] * 1000
    xyz = ", ".join(f"{v:.1f}" for v in flange)
    cell = "[cell]\npart = false\nnear_miss_mm = 5\n"
    cell += f'[[cell.fixture]]\nname = "bar"\nxyz_mm = [{xyz}]\n'
    cell += "rpy_deg = [0, 0, 0]\nsize_mm = [40, 40, 40]\n"
    other = tmp_path / "barred.toml"
    other.write_text(job.read_text() + cell)
    found = audit_file(plan, other)
    assert any(c.code.startswith("collision") and not c.ok for c in found.tables["air"])


def test_contours_in_another_order_know_which_of_them_lie_in_which(made):
    prepared = prepare(read_job(made("part")[0]))
    assert prepared.names == ["hole", "trim"]
    assert prepared.inner_first == ((0, 1),)
    turned = prepared.with_contours(prepared.contours[::-1])
    assert turned.names == ["trim", "hole"]
    assert turned.inner_first == ((1, 0),)
