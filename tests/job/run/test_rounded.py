"""Rounded corners are judged against the drawing: by the plan, and by the audit of its file."""

import json

import ezdxf
import numpy as np
import pytest

from jobs import ROBOT_AND_HEAD
from kerfpath.job import audit_file, read_job, run_job, write_result

CORNERS = [(0, 0), (60, 0), (80, 35), (25, 50)]
JOB = f"""\
{ROBOT_AND_HEAD}[part]
file = "plate.dxf"
xyz_mm = [1200, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick_all.kind = "outer"
speed_m_min = 1
spacing_mm = 2
[contour.corners]
round_mm = 0.3
[plan]
gamma_step_deg = 15
certify = false
[audit]
path_tolerance_mm = 0.2
"""


def job(folder, text=JOB):
    document = ezdxf.new(units=4)
    document.modelspace().add_lwpolyline(CORNERS, close=True)
    document.saveas(folder / "plate.dxf")
    (folder / "job.toml").write_text(text)
    return read_job(folder / "job.toml")


@pytest.mark.parametrize("kerf", ["", "kerf_mm = 0.4\n"])
def test_the_drawing_is_kept_by_the_measure(tmp_path, kerf):
    asked = job(tmp_path, JOB.replace("spacing_mm = 2\n", f"spacing_mm = 2\n{kerf}"))
    result = run_job(asked)
    (cut,) = result.cuts
    row = next(row for row in cut.checks if row.code == "drawing")
    assert row.ok
    assert row.value == pytest.approx(0.3e-3, rel=1e-3)  # at the corner that has all its room
    assert cut.passed
    write_result(result, tmp_path / "out")
    report = audit_file(tmp_path / "out" / "plan.json", tmp_path / "job.toml")
    assert report.passed


def test_a_plan_that_leaves_the_drawing_by_more_is_refused(tmp_path):
    asked = job(tmp_path, JOB.replace("round_mm = 0.3", "round_mm = 0.6"))
    write_result(run_job(asked), tmp_path / "out")
    file = tmp_path / "out" / "plan.json"
    job(tmp_path)
    report = audit_file(file, tmp_path / "job.toml")
    assert not report.passed
    assert "0.6 mm" in json.dumps(json.loads(file.read_text())["contours"][0]["audit"])


def test_steps_of_the_axis_are_those_of_the_sharp_loop(tmp_path):
    """A rounded corner has a node in its middle, as a sharp one has one at its tip."""
    rounded = run_job(job(tmp_path)).cuts[0].plan.contour
    sharp = run_job(job(tmp_path, JOB.replace("round_mm = 0.3", "slow_share = 0.5"))).cuts[0]
    tips = sharp.plan.contour.points[sharp.plan.contour.corners]
    off = np.linalg.norm(rounded.points[:, None] - tips, axis=2).min(axis=0)
    assert len(off) >= 3
    assert (off <= 0.3e-3 + 1e-9).all()
