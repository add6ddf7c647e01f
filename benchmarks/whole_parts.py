"""Whole parts: one free job against jobs restricted to one posture or to less of the ranges.

``python -m benchmarks.whole_parts [FIRST [COUNT]]`` plans random parts alone and prints their rows.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import pi, tan
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from ezdxf.filemanagement import new
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Message import Message
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

from benchmarks._figures import Report, Sheet
from kerfpath.errors import InputError
from kerfpath.job import JobResult, read_job, run_job

__all__ = ["PLATE", "TUBE", "random_part", "run", "write_plate", "write_tube"]

HOW = """\
Two parts, planned free and once more in each posture alone or within half a turn. Tube: a square
tube of 60 mm, lying along y, with three holes in its top and one in each side, on an IRB 4600.
Plate: ten contours in a flat sheet on a UR10, whose joints turn 360 deg either way. Cycle: cuts,
moves, approaches, retracts and piercing together. Seconds: `run_job` in one process, the kernels
compiled before, bounds included. A restricted job is never to be better than the free one."""
RANDOM = """\
Random plates and square tubes with three to six round holes, at a random place before an IRB 4600
with a head of 90 deg or a UR10 with a straight one, half of them from and to a home position. Each
is planned free, in every posture alone, and within half a turn of each joint, without bounds. Best
restricted: the least cycle of all these. Worse: how much longer the free cycle is than that, less
than 0 if it is shorter. Seconds: processor time of the free job."""

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


Hole = tuple[tuple[float, float, float], tuple[float, float, float], float]
"""Where a drill begins, mm, its direction and its radius, mm; it is 20 mm long."""
HOLES: tuple[Hole, ...] = (
    *(((30.0, y, 50.0), (0.0, 0.0, 1.0), 8.0) for y in (50.0, 150.0, 250.0)),
    ((-1.0, 100.0, 30.0), (1.0, 0.0, 0.0), 10.0),
    ((50.0, 200.0, 30.0), (1.0, 0.0, 0.0), 10.0),
)
"""Three holes in the top of the tube, one in each side."""


def write_tube(path: Path, holes: Sequence[Hole] = HOLES) -> None:
    """Write a square tube along y as STEP, with round holes."""
    shape = BRepPrimAPI_MakeBox(60.0, 300.0, 60.0).Shape()
    hollow = BRepPrimAPI_MakeBox(gp_Pnt(3, -1, 3), 54.0, 302.0, 54.0).Shape()
    shape = BRepAlgoAPI_Cut(shape, hollow).Shape()
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
    return [
        Report(title="Whole parts, free and restricted", how=HOW, sheets=[sheet]),
        _random(quick),
    ]


def _in_posture(text: str, posture: str) -> str:
    return text.replace("[plan]\n", f'[plan]\nposture = "{posture}"\n')


def _rows(
    folder: Path, part: str, free: str, restricted: dict[str, str]
) -> Iterator[tuple[str, ...]]:
    for name, text in {"-": free, **restricted}.items():
        start = perf_counter()
        found = _planned(folder, text)
        took = perf_counter() - start
        cycle, air = ("-", "-")
        if found.part is not None and found.passed:
            cycle, air = f"{found.part.cycle_time:.2f}", f"{found.part.air_time:.2f}"
        yield part, name, f"{took:.1f}", cycle, air


def _planned(folder: Path, text: str) -> JobResult:
    job = folder / "job.toml"
    job.write_text(text, encoding="utf-8")
    return run_job(read_job(job))


# -----------------------------------------------------------------------------
# Random parts.

COUNT = 20
"""Number of random parts."""
RANDOM_JOB = """\
[part]
file = "{file}"
xyz_mm = {at}
rpy_deg = [0, 0, 0]
[[contour]]
speed_m_min = 3
spacing_mm = 2
[contour.pick_all]
{pick}
[plan]
certify = false
gamma_step_deg = 10
[sequence]
{home}"""
COLUMNS = (
    "seed", "part", "robot", "cuts", "home", "computing s", "cycle s", "restricted jobs",
    "best restricted s", "restricted to", "worse %",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomPart:
    """A random part and its free job; `write` writes its drawing into a folder."""

    kind: str
    robot: str
    holes: int
    home: bool
    job: str
    write: Callable[[Path], None]


def random_part(seed: int) -> RandomPart:
    """Return a plate or, for an odd seed, a tube; two on a UR10 and two on an IRB 4600 in turn."""
    rng = np.random.default_rng(seed)
    is_tube, is_ur, count = bool(seed % 2), seed % 4 < 2, int(rng.integers(3, 7))
    arm, pose = (PLATE, "0, -90, -90, -90, 90, 0") if is_ur else (TUBE, "0, -20, 10, 0, 60, 0")
    least, most = ((400, -300, 0), (600, 0, 300)) if is_ur else ((1000, -300, 400), (1400, 0, 800))
    at, home = rng.uniform(least, most).round().tolist(), bool(rng.random() < 0.5)
    drawing = "tube.step" if is_tube else "plate.dxf"
    job = arm[: arm.index("[part]")] + RANDOM_JOB.format(
        file=drawing,
        at=at,
        pick='side = "outer"\nkind = "inner"' if is_tube else 'layer = "0"',
        home=f"home_deg = [{pose}]\n" if home else "",
    )
    job += arm[arm.index("[program]") :]
    radii = rng.uniform(6, 18 if is_tube else 30, count)
    spots = rng.permutation(count if is_tube else 9)[:count].tolist()
    sides = rng.integers(0, 3, count).tolist()

    def write(folder: Path) -> None:
        if is_tube:
            drills = [_drill(sides[k], 25 + 48 * spots[k], float(radii[k])) for k in range(count)]
            write_tube(folder / drawing, drills)
            return
        document = new("R2010", units=4)
        for spot, radius in zip(spots, radii.tolist(), strict=True):
            document.modelspace().add_circle((50 + 90 * (spot % 3), 50 + 90 * (spot // 3)), radius)
        document.saveas(folder / drawing)

    return RandomPart(
        kind="tube" if is_tube else "plate",
        robot="UR10" if is_ur else "IRB 4600",
        holes=count,
        home=home,
        job=job,
        write=write,
    )


def _drill(side: int, y: float, radius: float) -> Hole:
    """Return the drill of a hole in the top, the left or the right wall of the tube."""
    if side == 0:
        return (30.0, y, 50.0), (0.0, 0.0, 1.0), radius
    return (-1.0 if side == 1 else 50.0, y, 30.0), (1.0, 0.0, 0.0), radius


def _random(quick: bool) -> Report:
    rows = [_random_row(seed) for seed in range(2 if quick else COUNT)]
    sheet = Sheet(columns=COLUMNS, rows=rows, words=3)
    return Report(title="Random whole parts, free and restricted", how=RANDOM, sheets=[sheet])


def _random_row(seed: int) -> tuple[str, ...]:
    part = random_part(seed)
    narrowed = {"half a turn": part.job.replace("[robot]\n", "[robot]\n" + HALF_TURN)}
    narrowed |= {posture: _in_posture(part.job, posture) for posture in POSTURES}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        part.write(folder)
        start = process_time()
        free = _cycle(folder, part.job)
        took = process_time() - start
        cycles = {to: _cycle(folder, text) for to, text in narrowed.items()}
    best = min(cycles, key=cycles.__getitem__)
    feasible = sum(bool(np.isfinite(cycle)) for cycle in cycles.values())
    worse = f"{100 * (free / cycles[best] - 1):.2f}" if feasible else "-"
    return (
        f"{seed}", part.kind, part.robot, f"{part.holes}", "yes" if part.home else "no",
        f"{took:.1f}", f"{free:.2f}", f"{feasible}", f"{cycles[best]:.2f}",
        best if feasible else "-", worse,
    )  # fmt: skip


def _cycle(folder: Path, text: str) -> float:
    """Return the cycle time of a job, s; infinite if it is refused or does not pass."""
    try:
        found = _planned(folder, text)
    except InputError:  # known before planning, such as no room to back off in this posture
        return np.inf
    return found.part.cycle_time if found.part is not None and found.passed else np.inf


if __name__ == "__main__":
    first, count = (int(given) for given in (*sys.argv[1:], "0", str(COUNT))[:2])
    print("\t".join(COLUMNS), flush=True)
    for seed in range(first, first + count):
        print("\t".join(_random_row(seed)), flush=True)
