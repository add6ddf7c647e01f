"""A run that is stopped at any moment keeps the plans that it has, whole and audited."""

from contextlib import contextmanager

import pytest

from jobs import DEMO, SMALL
from kerfpath.errors import AuditFailed
from kerfpath.job import prepare, program_from_file, read_job, run_prepared, write_result
from kerfpath.progress import StopEarly, stopped_by

REDUCED = SMALL.replace("[plan]", '[plan]\nfeed = "dip"').replace(
    "speed_m_min = 3", "speed_m_min = 30"
)


JOBS = [
    pytest.param(SMALL, id="constant"),
    pytest.param(REDUCED, id="reduced feed", marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=JOBS)
def prepared(request, tmp_path_factory):
    file = tmp_path_factory.mktemp("stopped") / "small.toml"
    file.write_text(request.param.replace("b_pillar.step", str(DEMO / "b_pillar.step")))
    return prepare(read_job(file))


@contextmanager
def stopping(at):
    """Stop the work when it may be stopped for the at-th time, and from then on."""
    asked = []

    def check():
        asked.append(None)
        if len(asked) > at:
            raise StopEarly

    with stopped_by(check):
        yield asked


def test_plans_are_kept_whatever_the_moment(prepared):
    with stopping(10**9) as asked:
        whole = run_prepared(prepared)
    assert whole.passed
    assert not whole.not_planned
    names, seen = [each.task.name for each in prepared.contours], set()
    for share in (0.0, 0.1, 0.3, 0.45, 0.6, 0.8, 0.95):
        with stopping(round(share * len(asked))):
            found = run_prepared(prepared)
        assert [cut.contour for cut in found.cuts] + list(found.not_planned) == names
        assert all(cut.passed for cut in found.cuts)
        assert found.may_be_written == (not found.not_planned)
        for cut, best in zip(found.cuts, whole.cuts, strict=False):
            if best.plan.feed is None and cut.plan.feed is None:
                # A search that went on could only find better ones; equal up to rounding.
                assert cut.plan.cost >= best.plan.cost * (1 - 1e-9)
        seen.add(len(found.cuts))
    assert seen == {0, 1, 2}


def test_what_is_not_planned_is_named_and_no_program_is_written(prepared, tmp_path):
    with stopping(10**9) as asked:
        run_prepared(prepared)
    for at in range(1, len(asked)):  # until the first contour is planned
        with stopping(at):
            found = run_prepared(prepared)
        if len(found.cuts) == 1:
            break
    left = prepared.contours[1].task.name
    assert found.not_planned == (left,)
    written = write_result(found, tmp_path)
    assert {file.name for file in written.files} == {"plan.json", "trajectory.csv", "report.html"}
    assert any(f"stopped before {left} was planned" in note for note in written.notes)
    with pytest.raises(AuditFailed, match=f"{left} has no plan"):
        program_from_file(tmp_path / "plan.json")
