"""Windows of gamma in a job: kept, audited by the job, and named where they close the way."""

import json

import numpy as np
import pytest

from jobs import DEMO, SMALL
from kerfpath import InputError
from kerfpath.job import Audit, advised, prepare, read_job, run_job
from kerfpath.job.output.writing import plan_file_text
from kerfpath.progress import no_progress


@pytest.fixture
def job(tmp_path):
    """Give a job whose first contour has windows, or other keys."""

    def of(windows, more=""):
        (tmp_path / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
        keys = f"[[contour]]\ngamma_windows = {windows}\n{more}"
        path = tmp_path / "job.toml"
        path.write_text(SMALL.replace("[[contour]]\n", keys, 1))
        return path

    return of


@pytest.mark.slow
def test_a_job_keeps_its_windows_and_another_job_does_not_pass_its_audit(job, tmp_path):
    path = job("[[0, 10, 20, 20.5]]")
    result = run_job(read_job(path))
    made = result.cuts[0].plan
    held = made.contour.s <= 0.01 + 1e-9
    assert held.any()
    assert (np.abs(np.degrees(made.gamma[held]) - 20.25) <= 0.25 + 1e-6).all()
    assert not result.cuts[1].plan.settings.gamma_windows
    assert result.passed
    plan = tmp_path / "plan.json"
    plan.write_text(plan_file_text(result))
    assert Audit.of(path).audited(plan).passed
    # The same plan by a job that pins gamma elsewhere.
    job("[[0, 10, 40, 60]]")
    found = Audit.of(path).audited(plan)
    assert not found.passed
    broken = {c.code for table in found.tables.values() for c in table if not c.ok}
    assert "gamma-window" in broken
    # A file that says it was pinned elsewhere.
    data = json.loads(plan.read_text())
    data["contours"][0]["gamma_windows"][0] |= {"low_rad": 1.0, "high_rad": 1.2}
    plan.write_text(json.dumps(data))
    job("[[0, 10, 20, 20.5]]")
    assert not Audit.of(path).audited(plan).passed


def test_a_way_that_a_window_closes_is_said_to_be_open_without(job):
    path = job("[[0, 10, 0, 10], [5, 10, 90, 100]]")
    prepared = prepare(read_job(path))
    result = run_job(read_job(path))
    cut = advised(prepared, result.cuts[0], no_progress)
    assert "outside the pinned window of gamma" in str(cut.broken)
    assert str(cut.advice) == "without gamma_windows there is a plan as asked for"


@pytest.mark.parametrize(
    ("windows", "more", "said"),
    [
        ("[[10, 0, 20, 30]]", "", "contour.gamma_windows: expected from_mm not above"),
        ("[[0, 10, 20, 400]]", "", "expected low_deg and high_deg from -360 to 360"),
        ("[[0, 10, -180, 180]]", "", "expected an interval of gamma of less than"),
        ("[[0, 10, 20]]", "", "got .0, 10, 20. as number 1"),
        ("[[0, 10, 20, 30]]", 'start = "best"\n', 'expected start other than "best"'),
    ],
)
def test_bad_windows_are_refused_by_their_key(job, windows, more, said):
    with pytest.raises(InputError, match=said):
        read_job(job(windows, more))
