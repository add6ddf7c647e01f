"""What a run says of its program's corners: figures, and a warning where they are too sharp."""

import pytest

from jobs import DEMO, SMALL
from kerfpath.job import read_job, run_job, write_result

QUICK = SMALL.replace("[plan]", "[plan]\ncertify = false")


def cuts_of(folder, text):
    (folder / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (folder / "job.toml").write_text(text)
    return run_job(read_job(folder / "job.toml"))


def with_program(text):
    assert "[program]\n" in QUICK
    return QUICK.replace("[program]\n", f"[program]\n{text}\n")


def test_the_corners_of_the_program_are_looked_at(tmp_path):
    result = cuts_of(tmp_path, QUICK)
    for cut in result.cuts:
        velocity, acceleration = cut.as_run
        assert (velocity.code, acceleration.code) == ("velocity-as-run", "acceleration-as-run")
        criteria = cut.plan.criteria
        # Zones end at 0.49 of the way, and straight moves of the tool bend the joints' way.
        assert velocity.value == pytest.approx(criteria.peak_velocity.max(), rel=0.02)
        assert acceleration.value == pytest.approx(criteria.peak_acceleration.max(), rel=0.1)
        assert velocity.ok
        assert acceleration.ok
    write_result(result, tmp_path / "out")
    assert "corners rounded in zones" in (tmp_path / "out" / "report.html").read_text()


def test_sharp_corners_are_warned_of_with_what_to_write(tmp_path):
    result = cuts_of(tmp_path, with_program("zone_mm = 0.05"))
    wrong = [row for cut in result.cuts for row in cut.as_run if not row.ok]
    assert {row.code for row in wrong} == {"acceleration-as-run"}
    for row in wrong:
        assert row.level == "warning"
        assert 'zone_mm = "auto"' in row.issue().message
    assert result.passed


@pytest.mark.parametrize("program", ["zone_mm = 0", 'language = "csv"', 'language = "none"'])
def test_where_nothing_is_rounded_nothing_is_said(tmp_path, program):
    text = with_program(program)
    if "language" in program:
        text = text.replace('language = "rapid"\n', "")
    assert [cut.as_run for cut in cuts_of(tmp_path, text).cuts] == [(), ()]
