"""Jobs that several tests start from, as text."""

import re
from importlib.resources import files
from pathlib import Path

from kerfpath.errors import NoFeasiblePath
from kerfpath.job import cell_of_job
from kerfpath.job.run.speeds import fastest_along

DEMO = Path(str(files("kerfpath") / "demo"))

_BEFORE, *_CONTOURS, _AFTER = re.split(
    r"(?=\[\[contour\]\]|\[plan\])",
    # 1 mm apart at 3 m/min, moves are shorter than what is assumed of ABB: some are merged.
    (DEMO / "b_pillar.toml").read_text().replace("spacing_mm = 1.25", "spacing_mm = 1"),
)
SMALL = "".join(
    [
        _BEFORE,
        _CONTOURS[4],
        _CONTOURS[2],
        _AFTER.replace("gamma_step_deg = 1", "gamma_step_deg = 3"),
    ]
)
"""Two small contours of the demo at a coarse step: everything that it does, in a second."""

ENDLESS_AND_HEAD = """\
[robot]
model = "abb_irb4600_60_205"
endless = [4, 6]
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-45"
"""
"""The first tables of a job with the robot of the demo, axes 4 and 6 endless."""

RAIL_AND_TABLE = """\
[[robot.external]]
name = "rail"
kind = "linear"
carries = "robot"
axis = [0, 1, 0]
lower_mm = -400
upper_mm = 400
velocity_mm_s = 1000
acceleration_mm_s2 = 1500

[[robot.external]]
name = "table"
kind = "rotary"
carries = "part"
axis = [0, 0, 1]
point_mm = [1200, 0, 500]
endless = true
velocity_deg_s = 90
acceleration_deg_s2 = 180

"""
"""A rail under the robot and a table under the part, of the demo."""
HEAD = f"""\
{ENDLESS_AND_HEAD}[part]
file = "b_pillar.step"
xyz_mm = [1200, -600, 500]
rpy_deg = [0, 0, 90]
"""
CONTOURS = """\
[[contour]]
pick = "skin/hole1"
name = "led in"
speed_m_min = 3
spacing_mm = 2
start = "best"
candidates = 2
overlap_mm = 2
kerf_mm = 0.2
[contour.lead_in]
length_mm = 4
shape = "arc"
angle_deg = 90
[contour.lead_out]
length_mm = 3
shape = "arc"
[[contour]]
pick = "skin/hole21"
name = "joined"
speed_m_min = 3
spacing_mm = 2
direction = "best"
[contour.micro_joints]
width_mm = 2
count = 2
[[contour]]
pick = "skin/hole13"
name = "cornered"
speed_m_min = 3
spacing_mm = 2
start_mm = 10
bevel_deg = 5
[contour.lead_in]
length_mm = 4
[contour.corners]
slow_share = 0.1
ramp_mm = 6
"""
PLAN = """\
[plan]
gamma_step_deg = 10
posture = "front/up"
"""
SEQUENCE = """\
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
[program]
name = "job"
pierce_time_s = 0.25
lead_time_s = 0.005
"""
WITHOUT_LAG = '[robot.response]\nsource = "ideal"\n\n[tool]'
"""What stands in place of [tool] where joints are to be where they are commanded to be."""
WHOLE = HEAD.replace("[tool]", WITHOUT_LAG) + CONTOURS + PLAN + SEQUENCE
"""A whole part: lead-ins, micro-joints, corners, a bevel, and transfer moves; without lag."""

ROBOT_AND_HEAD = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-45"
"""
"""The first tables of a small job, which goes on with its part."""

SLITS = """\
contour,x_mm,y_mm,z_mm,nx,ny,nz
a,0,0,0,0,0,1
a,30,0,0,0,0,1
b,0,20,0,0,0,1
b,30,20,0,0,0,1
"""
SLIT_JOB = f"""\
{ROBOT_AND_HEAD}[part]
file = "slits.csv"
xyz_mm = [1200, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "a"
speed_m_min = 2
count = 11
[[contour]]
pick = "b"
speed_m_min = 2
count = 11
[plan]
gamma_step_deg = 15
"""
"""The job of two slits in the air that `SLITS` are the table of."""


def write_slit_jobs(folder, jobs):
    """Write jobs by name beside the table of slits; return their files."""
    (folder / "slits.csv").write_text(SLITS)
    for name, text in jobs.items():
        (folder / f"{name}.toml").write_text(text)
    return [f"{name}.toml" for name in jobs]


def speeds_on_grid(job):
    """Return the fastest speed of each contour on the grid alone, or why there is none."""
    part = job.read_part()
    cell, found = cell_of_job(job, part), []
    for task in job.tasks(part):
        try:
            found.append(
                fastest_along(job, task.sample(task.candidates(part)[0]), cell, refine=False)
            )
        except NoFeasiblePath as broken:
            found.append(broken)
    return found
