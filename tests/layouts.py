"""Jobs for `kerfpath layout`, and what placements of them are worth."""

import json

import numpy as np

from conftest import ROOT
from jobs import ENDLESS_AND_HEAD, ROBOT_AND_HEAD
from kerfpath.study import job_key
from kerfpath.study.placing.evaluators import PlacementValue
from kerfpath.study.placing.study import evaluate_placements

DEMO = ROOT / "src" / "kerfpath" / "demo"
HEAD = f"""
{ENDLESS_AND_HEAD}
[part]
file = '{DEMO / "b_pillar.step"}'
xyz_mm = [1200, -600, 500]     # where it lies now
rpy_deg = [0, 0, 90]
"""
CELL = """
[cell]
near_miss_mm = 10
part = false

[[cell.fixture]]
name = "nest"
size_mm = [120, 60, 200]
xyz_mm = [1210, -450, 300]

[[cell.fixture]]
name = "column"
size_mm = [60, 60, 600]
xyz_mm = [1390, -210, 600]
rpy_deg = [0, 0, 20]
"""
CONTOURS = """
[[contour]]
pick = "skin/hole11"
name = "slot"
speed_m_min = {speed}
spacing_mm = 2

[[contour]]
pick = "skin/hole13"
name = "hole 20"
speed_m_min = {speed}
spacing_mm = 2

[plan]
method = "{method}"
gamma_step_deg = {step}
posture = "front/up"
refine = false
"""


def contours(*, speed, step, method="exact"):
    return CONTOURS.format(speed=speed, step=step, method=method)


def job_file(folder, text, name="job.toml"):
    path = folder / name
    path.write_text(text)
    return path


TABLE = (
    ROBOT_AND_HEAD
    + """
[part]
file = "rings.csv"
xyz_mm = [{x}, 0, 500]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "small"
speed_m_min = 2
count = {small}
[[contour]]
pick = "large"
speed_m_min = 2
count = {large}
[plan]
method = "{method}"
gamma_step_deg = 10
posture = "front/up"
refine = false
"""
)


def rings(folder, x, method="exact", small=41, large=61):
    """A job of two rings from a table of points, which workers are quick to read."""
    rows = ["contour,x_mm,y_mm,z_mm,nx,ny,nz"]
    for name, radius, middle in (("small", 8, -40), ("large", 20, 40)):
        for angle in np.linspace(0, 2 * np.pi, 73)[:-1]:
            x_mm, y_mm = radius * np.cos(angle), middle + radius * np.sin(angle)
            rows.append(f"{name},{x_mm:.4f},{y_mm:.4f},0,0,0,1")
    job_file(folder, "\n".join(rows), "rings.csv")
    return job_file(folder, TABLE.format(x=x, method=method, small=small, large=large))


def worth(job, *places, goal="speed", stretches=(), **options):
    data = evaluate_placements(
        **job_key(job),
        goal=goal,
        places=list(places) or [{}],
        stretches=[list(s) for s in stretches],
        **options,
    )
    return PlacementValue.from_data(json.loads(json.dumps(data)))
