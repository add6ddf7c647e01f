"""Corners whose size no maker publishes: judged as assumed, guaranteed as stated."""

import numpy as np
import pytest

from kerfpath.job import audit_file, read_job, run_job, write_result

JOB = """\
[robot]
model = "{robot}"
acceleration_deg_s2 = [215, 175, 260, 760, 860, 1190]
[robot.response]
source = "ideal"
[tool]
head = "laser-head-45"
[part]
file = "part.csv"
xyz_mm = [1000, -150, 300]
rpy_deg = [0, 0, 30]
[[contour]]
pick = "hole"
speed_m_min = 4
spacing_mm = 1
[plan]
gamma_step_deg = 10
certify = false
between_nodes = "{between}"
[program]
language = "{language}"
[program.{language}]
laser_output = 5
{settings}
"""
ROBOTS = {"fanuc": "fanuc_m20id_25", "inform": "yaskawa_gp25"}
PULSES = "pulses_per_deg = [1341.4, 1341.4, 1000.0, 1000.0, 800.0, 500.0]\n"
STATED = {"fanuc": "corner_ms = 60.0", "inform": f"{PULSES}position_level_mm = 5.0"}
PLAIN = {"fanuc": "", "inform": PULSES}
KEY = {"fanuc": "corner_ms", "inform": "position_level_mm"}


def done(folder, language, settings, between="kept"):
    t = np.linspace(0, 2 * np.pi, 241)
    rows = [f"hole,{8 * np.cos(a):.6f},{8 * np.sin(a):.6f},0,0,0,-1" for a in t]
    head = "contour,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"
    (folder / "part.csv").write_text("\n".join([head, *rows, ""]))
    path = folder / "job.toml"
    path.write_text(
        JOB.format(robot=ROBOTS[language], language=language, settings=settings, between=between)
    )
    return run_job(read_job(path))


def rows_of(result):
    (cut,) = result.cuts
    return {row.code: row for row in cut.as_run.checks}


@pytest.mark.parametrize("language", ROBOTS)
def test_what_is_assumed_is_judged_by_and_said(tmp_path, language):
    result = done(tmp_path, language, PLAIN[language])
    rows = rows_of(result)
    assert result.passed
    for kind in ("velocity", "acceleration"):
        row = rows[f"{kind}-as-run"]
        assert row.title.endswith("at every instant, corners assumed")
        assert KEY[language] in row.advice
    assert 0 < rows["tip-as-run"].value < 1e-4
    write_result(result, tmp_path / "out")
    (program,) = (tmp_path / "out").glob("[jJ][oO][bB].[lLjJ]*")
    audited = audit_file(program, tmp_path / "job.toml")
    own = {row.code: row for table in audited.tables.values() for row in table}
    # Targets have their digits.
    for code in ("velocity-as-run", "acceleration-as-run", "tip-as-run"):
        assert own[code].title == rows[code].title
        assert own[code].value == pytest.approx(rows[code].value, rel=0.1, abs=1e-6)


@pytest.mark.parametrize("language", ROBOTS)
def test_a_guarantee_asks_for_what_is_stated(tmp_path, language):
    refused = rows_of(done(tmp_path, language, PLAIN[language], "guaranteed"))["between-nodes"]
    assert (refused.ok, refused.level) == (False, "error")
    assert KEY[language] in refused.advice
    result = done(tmp_path, language, STATED[language], "guaranteed")
    assert result.passed
    rows = rows_of(result)
    assert "between-nodes" not in rows
    assert rows["acceleration-as-run"].title.endswith("at every instant")


NO_CYCLE = "shortest_move_ms = 0\ninterpolation_ms = 0"


def test_a_controller_that_hardly_rounds_is_warned_of(tmp_path):
    result = done(tmp_path, "fanuc", f"corner_ms = 60.0\ncnt_percent = 1\n{NO_CYCLE}")
    row = rows_of(result)["acceleration-as-run"]
    assert not row.ok
    assert row.level == "warning"
    assert row.value > 2
    assert rows_of(done(tmp_path, "fanuc", "corner_ms = 60.0"))["acceleration-as-run"].value < 1
