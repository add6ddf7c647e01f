"""What a run says of its program's corners: figures, and a warning where they are too sharp."""

import re

import numpy as np
import pytest

from jobs import DEMO, SMALL, WITHOUT_LAG
from kerfpath.errors import InputError
from kerfpath.job import AsRun, audit_file, read_job, run_job, write_result

QUICK = (
    SMALL.replace("[plan]", "[plan]\ncertify = false")
    + "\n[program.rapid]\nshortest_move_ms = 12\n"
).replace("[tool]", WITHOUT_LAG)


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
        velocity, acceleration, tip, axis, cycle, speed = cut.as_run.checks
        assert (velocity.code, acceleration.code) == ("velocity-as-run", "acceleration-as-run")
        criteria = cut.plan.criteria
        # Zones end at 0.49 of the way, and straight moves of the tool bend the joints' way.
        assert velocity.value == pytest.approx(criteria.peak_velocity.max(), rel=0.02)
        assert acceleration.value == pytest.approx(criteria.peak_acceleration.max(), rel=0.1)
        assert all(row.ok for row in cut.as_run.checks)
        codes = ("tip-as-run", "axis-as-run", "cycle-as-run", "speed-as-run")
        assert (tip.code, axis.code, cycle.code, speed.code) == codes
        assert 0 < tip.value < 1e-4
        assert 0 < axis.value < 5e-3
        timing = cut.as_run.timing
        assert timing.held == 1.0
        # Ramps up and down; between them as programmed.
        assert cut.plan.time[-1] < timing.seconds < cut.plan.time[-1] + 0.5
    write_result(result, tmp_path / "out")
    assert "share as run, at every instant" in (tmp_path / "out" / "report.html").read_text()


def test_sharp_corners_are_warned_of_with_what_to_write(tmp_path):
    result = cuts_of(tmp_path, with_program("zone_mm = 0.05"))
    wrong = [row for cut in result.cuts for row in cut.as_run.checks if not row.ok]
    codes = {row.code for row in wrong}
    assert codes == {"acceleration-as-run", "speed-as-run"}
    for row in wrong:
        assert row.level == "warning"
        if row.code != "speed-as-run":
            assert 'zone_mm = "auto"' in row.issue().message
    assert result.passed


@pytest.mark.parametrize("program", ["zone_mm = 0", 'language = "csv"', 'language = "none"'])
def test_where_nothing_is_rounded_nothing_is_said(tmp_path, program):
    text = with_program(program)
    if "language" in program:
        text = text.replace('language = "rapid"\n', "")
    assert [cut.as_run for cut in cuts_of(tmp_path, text).cuts] == [AsRun(), AsRun()]


@pytest.mark.slow
def test_limits_that_hold_at_the_nodes_alone_are_brought_in_between_them(tmp_path):
    fast = QUICK.replace("[plan]", '[plan]\nbetween_nodes = "reported"')
    fast = re.sub("eta_acceleration = .*", "eta_acceleration = 1", fast)
    before = cuts_of(tmp_path, at_its_limits(tmp_path, fast)).cuts
    over = [cut.name for cut in before for row in cut.as_run.checks if not row.ok]
    assert over
    after = cuts_of(tmp_path, at_its_limits(tmp_path, fast).replace("reported", "guaranteed"))
    assert after.passed
    for old, cut in zip(before, after.cuts, strict=True):
        assert all(row.ok for row in cut.as_run.checks)
        assert [row.level for row in cut.as_run.checks[:2]] == ["error", "error"]
        # Held to less, a motion can only be dearer; refined again, a start may end a little lower.
        assert old.plan.cost * (1 - 1e-3) <= cut.plan.cost <= old.plan.cost * 1.02


def at_its_limits(folder, text):
    """The job with accelerations of the robot that its plans just keep at their nodes."""
    peaks = [cut.plan.criteria.peak_acceleration for cut in cuts_of(folder, text).cuts]
    limit = np.degrees(read_job(folder / "job.toml").robot.acceleration)
    most = (np.max(peaks, axis=0).max() * limit * 1.0001).tolist()
    lines = [line for line in text.splitlines() if not line.startswith("acceleration")]
    return "\n".join(lines).replace("[robot]", f"[robot]\nacceleration_deg_s2 = {most}", 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("zone_mm = 0", "stops at every node"),
        ('language = "csv"', "csv has no zones"),
        ('language = "none"', "there is no program"),
        ("zone_mm = 0.05", "as run"),
    ],
)
def test_without_a_proof_a_guarantee_fails_the_audit(tmp_path, program, why):
    text = with_program(program).replace("[plan]", '[plan]\nbetween_nodes = "guaranteed"')
    if "language" in program:
        text = text.replace('language = "rapid"\n', "")
    result = cuts_of(tmp_path, text)
    assert not result.passed
    for cut in result.cuts:
        wrong = [row for row in cut.as_run.checks if not row.ok]
        assert wrong
        assert wrong[0].level == "error"
        assert why in wrong[0].issue().message
    written = write_result(result, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.mod")), written


@pytest.mark.slow
def test_a_program_is_judged_by_the_zones_of_its_text(tmp_path):
    text = QUICK.replace("[plan]", '[plan]\nbetween_nodes = "guaranteed"')
    result = cuts_of(tmp_path, text)
    write_result(result, tmp_path / "out")
    (program,) = (tmp_path / "out").glob("*.mod")

    def rows():
        tables = audit_file(program, tmp_path / "job.toml").tables
        return [row for table in tables.values() for row in table if row.code.endswith("as-run")]

    planned = [row for cut in result.cuts for row in cut.as_run.checks]
    assert all(row.ok for row in rows())
    for row in rows():
        assert any(row.code == own.code and abs(row.value - own.value) < 0.02 for own in planned)
    narrow = "0.020,0.020,0.020,0.002,0.020,0.002"
    sharp = re.sub(r"(zCorner\d*:=\[FALSE),[\d.,]+\]", rf"\1,{narrow}]", program.read_text())
    assert sharp != program.read_text()
    program.write_text(sharp)
    wrong = [row for row in rows() if not row.ok]
    assert {row.code: row.level for row in wrong} == {
        "acceleration-as-run": "error",
        "speed-as-run": "warning",
    }


WRIST = 'orientation = "wrist"\n'


@pytest.mark.slow
def test_where_the_wrist_goes_by_its_joints_samples_are_said_to_be_samples(tmp_path):
    plain, wrist = cuts_of(tmp_path, QUICK), cuts_of(tmp_path, QUICK + WRIST)
    assert wrist.passed
    for one, other in zip(plain.cuts, wrist.cuts, strict=True):
        for old, row in zip(one.as_run.checks[:2], other.as_run.checks[:2], strict=True):
            assert row.title == old.title.replace("at every instant", "sampled")
            # Nodes are 1 mm apart, between which the laws of orientation are close.
            assert row.value == pytest.approx(old.value, rel=0.02)
    write_result(wrist, tmp_path / "out")
    (program,) = (tmp_path / "out").glob("*.mod")
    assert r"SingArea\Wrist;" in program.read_text()
    audited = audit_file(program, tmp_path / "job.toml")
    assert audited.passed
    titles = [row.title for table in audited.tables.values() for row in table]
    assert "joint acceleration share as run, sampled" in titles


def test_samples_alone_are_no_guarantee(tmp_path):
    text = QUICK.replace("[plan]", '[plan]\nbetween_nodes = "guaranteed"') + WRIST
    result = cuts_of(tmp_path, text)
    assert not result.passed
    for cut in result.cuts:
        (row,) = [row for row in cut.as_run.checks if not row.ok]
        assert (row.code, row.level) == ("between-nodes", "error")
        said = row.issue().message
        assert "nothing is proved if the controller moves the wrist by its joints" in said


def with_tolerance(mm, program=""):
    text = with_program(program)
    assert "path_tolerance_mm = 0.1 " in text
    return text.replace("path_tolerance_mm = 0.1 ", f"path_tolerance_mm = {mm} ")


@pytest.mark.parametrize("mm", [0.02, 0.3])
def test_automatic_zones_follow_the_tolerance_of_the_path(tmp_path, mm):
    result = cuts_of(tmp_path, with_tolerance(mm))
    assert result.job.program.zone_error == pytest.approx(mm * 1e-3)
    for cut in result.cuts:
        rows = {row.code: row for row in cut.as_run.checks}
        assert 0 < rows["tip-as-run"].value <= rows["tip-as-run"].limit == pytest.approx(mm * 1e-3)
        assert rows["speed-as-run"].ok
        assert cut.as_run.timing.held == 1.0


def test_a_zone_error_that_is_stated_is_kept(tmp_path):
    job = tmp_path / "job.toml"
    (tmp_path / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    job.write_text(with_tolerance(0.3, "zone_error_mm = 0.05"))
    assert read_job(job).program.zone_error == pytest.approx(5e-5)


# -----------------------------------------------------------------------------
# The tip as the joints execute the run.

LAGGING = QUICK.replace(WITHOUT_LAG, "[tool]")


def tip_of(cut):
    (row,) = [row for row in cut.as_run.checks if row.code == "tip-as-run"]
    return row


def test_a_lag_that_is_assumed_warns_of_small_holes_and_says_what_keeps_the_path(tmp_path):
    result = cuts_of(tmp_path, LAGGING)
    hole, _ = result.cuts
    row, off = tip_of(hole), hole.as_run.path_error
    assert (row.ok, row.level, result.passed) == (False, "warning", True)
    assert row.value == off.largest
    assert "assumed" in row.advice
    assert "15 to 35 ms" in row.advice
    slower = float(re.search(r"keeps it at ([\d.]+) m/min", row.advice)[1])
    assert 1 < slower < 3
    again = LAGGING.replace("speed_m_min = 3", f"speed_m_min = {slower}")
    # Planned anew, the joints move a little differently.
    assert tip_of(cuts_of(tmp_path, again).cuts[0]).value < 1.02 * row.limit
    size = hole.as_run.hole
    assert size.drawn == pytest.approx(0.01, abs=1e-5)
    assert size.executed < size.drawn
    write_result(result, tmp_path / "out")
    assert "Executed path" in (tmp_path / "out" / "report.html").read_text()


def test_a_path_tolerance_is_kept_or_refuses_the_program(tmp_path):
    tight = LAGGING.replace("[plan]\n", "[plan]\npath_tolerance_mm = 0.12\n")
    result = cuts_of(tmp_path, tight)
    row = tip_of(result.cuts[0])
    assert (row.ok, row.level, result.passed) == (False, "error", False)
    assert row.limit == pytest.approx(0.00012)
    write_result(result, tmp_path / "out")
    assert not list((tmp_path / "out").glob("*.mod"))
    wide = LAGGING.replace("[plan]\n", "[plan]\npath_tolerance_mm = 0.5\n")
    result = cuts_of(tmp_path, wide)
    assert result.passed
    assert tip_of(result.cuts[0]).ok


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("sigma_ms = [0]", "above 0"),
        ("sigma_ms = [20, 30]", "expected sigma for the 6 joints"),
        ('source = "real"', "expected one of assumed, ideal"),
        ('file = "none.toml"', "none.toml"),
        ('source = "ideal"\nsigma_ms = [20]', "one of source, file and sigma_ms"),
        ('source = "ideal"\nsigma_range_ms = [1, 2]', "sigma_range_ms only with sigma_ms"),
        ("sigma_ms = [20]\nsigma_range_ms = [30, 40]", "sigma_range"),
    ],
)
def test_a_response_that_is_none_is_refused_at_its_key(tmp_path, table, said):
    (tmp_path / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (tmp_path / "job.toml").write_text(f"{LAGGING}\n[robot.response]\n{table}\n")
    with pytest.raises(InputError, match=re.escape(said)) as caught:
        read_job(tmp_path / "job.toml")
    assert "\n" not in str(caught.value)
    assert "job.toml" in str(caught.value)


def test_a_file_of_a_response_is_taken(tmp_path):
    (tmp_path / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (tmp_path / "mine.toml").write_text('standing = "measured"\nruns = 2\nsigma_ms = [9]\n')
    text = f'{LAGGING}\n[robot.response]\nfile = "mine.toml"\n'
    (tmp_path / "job.toml").write_text(text)
    response = read_job(tmp_path / "job.toml").response
    assert (response.standing, response.runs, response.sigma[0]) == ("measured", 2, 0.009)
