"""Whole parts: one free job against jobs restricted to one posture or to less of the ranges."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from math import pi, tan
from pathlib import Path
from time import perf_counter

from ezdxf.filemanagement import new
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Message import Message
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

from benchmarks._figures import Report, Sheet
from kerfpath.job import JobResult, read_job, run_job

__all__ = ["PLATE", "TUBE", "run", "write_plate", "write_tube"]

HOW = """\
Two parts, planned free and once more in each posture alone or within half a turn. Tube: a square
tube of 60 mm, lying along y, with three holes in its top and one in each side, on an IRB 4600.
Plate: ten contours in a flat sheet on a UR10, whose joints turn 360 deg either way. Cycle: cuts,
moves, approaches, retracts and piercing together. Seconds: `run_job` in one process, the kernels
compiled before, bounds included. A restricted job is never to be better than the free one."""

TUBE = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-90"
[part]
file = "tube.step"
xyz_mm = [1250, -100, 700]
rpy_deg = [0, 0, 0]
[[contour]]
speed_m_min = 3
spacing_mm = 1
[contour.pick_all]
side = "outer"
kind = "inner"
[plan]
gamma_step_deg = 5
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
[program]
pierce_time_s = 0.3
"""
PLATE = """\
[robot]
model = "ur_ur10"
acceleration_ratio = "cybertech_8_to_20kg"
[tool]
xyz_mm = [0, 0, 150]
rpy_deg = [0, 0, 0]
[part]
file = "plate.dxf"
xyz_mm = [500, -150, 100]
rpy_deg = [0, 0, 0]
[[contour]]
speed_m_min = 3
spacing_mm = 1
[contour.pick_all]
layer = "0"
[plan]
gamma_step_deg = 5
[sequence]
[program]
language = "urscript"
pierce_time_s = 0.3
"""
HALF_TURN = (
    "lower_deg = [-180, -180, -180, -180, -180, -180]\nupper_deg = [180, 180, 180, 180, 180, 180]\n"
)
POSTURES = tuple(
    f"{a}/{b}/{c}" for a in ("front", "rear") for b in ("up", "down") for c in ("plus", "minus")
)


def write_tube(path: Path) -> None:
    """Write a square tube along y as STEP: three holes in its top, one in each side."""
    shape = BRepPrimAPI_MakeBox(60.0, 300.0, 60.0).Shape()
    hollow = BRepPrimAPI_MakeBox(gp_Pnt(3, -1, 3), 54.0, 302.0, 54.0).Shape()
    shape = BRepAlgoAPI_Cut(shape, hollow).Shape()
    holes = [((30, y, 50), (0, 0, 1), 8.0) for y in (50, 150, 250)]
    holes += [((-1, 100, 30), (1, 0, 0), 10.0), ((50, 200, 30), (1, 0, 0), 10.0)]
    for start, along, radius in holes:
        axis = gp_Ax2(gp_Pnt(*start), gp_Dir(*along))
        drill = BRepPrimAPI_MakeCylinder(axis, radius, 20.0).Shape()
        shape = BRepAlgoAPI_Cut(shape, drill).Shape()
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))


def write_plate(path: Path) -> None:
    """Write a sheet of 300 x 300 mm with round corners as DXF: nine round holes and its trim."""
    document = new("R2010", units=4)
    space = document.modelspace()
    ends = [(20, 0), (280, 0), (300, 20), (300, 280), (280, 300), (20, 300), (0, 280), (0, 20)]
    quarter = tan(pi / 8)  # the bulge of an arc of 90 deg
    trim = [(*end, quarter * (i % 2)) for i, end in enumerate(ends)]
    space.add_lwpolyline(trim, format="xyb", close=True)
    for k in range(9):
        space.add_circle((60 + 90 * (k % 3), 60 + 90 * (k // 3)), 10 + 2 * (k % 4))
    document.saveas(path)


def run(*, quick: bool) -> list[Report]:
    """Plan both parts free and restricted."""
    postures = ("front/up/plus", "front/up/minus") if quick else POSTURES
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_tube(folder / "tube.step")
        write_plate(folder / "plate.dxf")
        rows = list(_rows(folder, "tube", TUBE, {p: _in_posture(TUBE, p) for p in postures}))
        if not quick:
            narrow = {"half a turn": PLATE.replace("[robot]\n", "[robot]\n" + HALF_TURN)}
            rows += _rows(folder, "plate", PLATE, narrow)
    columns = ("part", "restricted to", "computing s", "cycle s", "air s")
    sheet = Sheet(columns=columns, rows=rows, words=2)
    return [Report(title="Whole parts, free and restricted", how=HOW, sheets=[sheet])]


def _in_posture(text: str, posture: str) -> str:
    return text.replace("[plan]\n", f'[plan]\nposture = "{posture}"\n')


def _rows(
    folder: Path, part: str, free: str, restricted: dict[str, str]
) -> Iterator[tuple[str, ...]]:
    for name, text in {"-": free, **restricted}.items():
        job = folder / "job.toml"
        job.write_text(text, encoding="utf-8")
        start = perf_counter()
        found: JobResult = run_job(read_job(job))
        took = perf_counter() - start
        cycle, air = ("-", "-")
        if found.part is not None and found.passed:
            cycle, air = f"{found.part.cycle_time:.2f}", f"{found.part.air_time:.2f}"
        yield part, name, f"{took:.1f}", cycle, air
