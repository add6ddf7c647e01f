"""Small jobs whose plan.json is edited; together they use every field of a plan.json."""

from __future__ import annotations

from pathlib import Path

from ezdxf.filemanagement import new

from benchmarks.program_edits import EXTERNAL
from kerfpath.job import plan_file_text, read_job, run_job

__all__ = ["JOBS", "planned"]

_HEAD = """\
[robot]
model = "abb_irb4600_60_205"
endless = [4, 6]
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-45"
[part]
file = "plate.dxf"
xyz_mm = [1200, -100, 500]
rpy_deg = [0, 0, 0]
"""
JOBS = {
    # Two contours in order with transfer moves: lead, kerf, starts, micro joints, slow corners.
    "part": _HEAD
    + """\
[[contour]]
pick = "0/hole1"
name = "hole"
speed_m_min = 3
spacing_mm = 2
kerf_mm = 0.2
start = "best"
candidates = 2
[contour.lead_in]
length_mm = 4
shape = "line"
angle_deg = 60
[[contour]]
pick = "0/outer"
name = "trim"
speed_m_min = 3
spacing_mm = 8
[contour.micro_joints]
width_mm = 4
count = 2
[contour.corners]
slow_share = 0.5
ramp_mm = 10
[plan]
gamma_step_deg = 6
posture = "front/up"
eta_velocity = 0.9
eta_acceleration = 0.9
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
[program]
language = "none"
pierce_time_s = 0.25
""",
    # A cell, a tolerance of the tool axis, comfort and a limit of rotation.
    "cell": _HEAD
    + """\
[[contour]]
pick = "0/hole1"
speed_m_min = 2
spacing_mm = 2.5
[comfort]
wrist_margin_deg = 2
wrist_band_deg = 20
wrist_cost = 0.1
[plan]
gamma_step_deg = 8
tilt_deg = 3
tilt_cost_per_deg = 0.01
rotation_deg = 300
method = "exact"
refine = false
[cell]
part = false
near_miss_mm = 5
[[cell.fixture]]
name = "table"
xyz_mm = [1250, 0, 300]
rpy_deg = [0, 0, 10]
size_mm = [300, 300, 50]
""",
    # A feed reduction.
    "dip": _HEAD
    + """\
[[contour]]
pick = "0/hole1"
speed_m_min = 20
spacing_mm = 2.5
[plan]
gamma_step_deg = 8
feed = "dip"
""",
    # A rail under the robot and a table under the part.
    "external": _HEAD.replace(
        "[tool]\n",
        EXTERNAL.format(reach=1200).removeprefix("floor = false\n") + "[tool]\n",
    )
    + """\
[[contour]]
pick = "0/hole1"
speed_m_min = 3
spacing_mm = 4
[[contour]]
pick = "0/outer"
name = "trim"
speed_m_min = 6
spacing_mm = 8
[plan]
gamma_step_deg = 10
[program]
language = "none"
""",
    # Four pieces on nodes that divide the intervals.
    "pieces": _HEAD.replace("[4, 6]", "[]")
    + """\
[[contour]]
pick = "0/outer"
speed_m_min = 20
spacing_mm = 8
[plan]
gamma_step_deg = 10
interruptions = "fewest"
refine_parts = 2
""",
}
"""Job files by name; their drawing is plate.dxf."""


def planned(folder: Path, name: str) -> tuple[Path, Path]:
    """Write the job `name` and its plan.json into a folder; return both paths."""
    drawing = new("R2010")
    drawing.header["$INSUNITS"] = 4
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0), (120, 0), (120, 80), (0, 80)], close=True)
    space.add_circle((40, 40), 12)
    drawing.saveas(folder / "plate.dxf")
    job, plan = folder / f"{name}.toml", folder / f"{name}.json"
    job.write_text(JOBS[name], encoding="utf-8")
    outcome = run_job(read_job(job))
    assert outcome.passed, f"{name}: the job has no plan that passes"
    plan.write_text(plan_file_text(outcome), encoding="utf-8")
    return job, plan
