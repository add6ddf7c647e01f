"""The text of a first job for a drawing; all its values are guesses to be changed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from os.path import relpath
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, counted
from kerfpath.cad import Loop, Part
from kerfpath.errors import InputError
from kerfpath.job.format import pose
from kerfpath.post import languages
from kerfpath.robots import Robot
from kerfpath.robots import robot as library_robot

PLACEHOLDER = "abb_irb4600_60_205"
"""The robot of a job that no robot was given for."""
REACH = 2.0
"""Reach of a robot for which the library has none, m."""
MOST_LOOPS = 8
"""Most loops in a first job; the longest are taken."""
NODES = 400
"""Most nodes of a loop; shorter loops are spaced by `SPACING`."""
SPACING = 2.0
"""Least distance between nodes, mm."""
TURNS = ((0, 0, 0), (180, 0, 0), (90, 0, 0), (-90, 0, 0), (0, 90, 0), (0, -90, 0))
"""Roll, pitch and yaw in deg of the ways to lay a part down; the first of the best is taken."""
PLACE = (0.634, 0.0, 0.244)
"""x and y of the middle of the part and z of its lowest point, as shares of the robot's reach."""
HEAD = """\
# A first job for {drawing}, written by kerfpath. What is marked "guess" must be changed to what
# you have. `kerfpath check {job}` says what is wrong or missing; `kerfpath plan {job}` plans.
# The page "The job file" describes every key; values are in the units that the keys name.

[robot]
model = "{robot}"{chosen}
{accelerations}

[tool]
head = "laser-head-45"      # guess: or xyz_mm and rpy_deg of the tip (TCP) in the flange

[part]
file = {name}
{unit}xyz_mm = {xyz}   # guess: where the part's origin is in the robot base
rpy_deg = {rpy}              # guess: how the part is turned there; the beam comes from above

# {count} of {total}, at a guessed speed; `kerfpath contours {drawing}` lists them all.
"""
TAIL = """\
[plan]
gamma_step_deg = 2          # step of the free rotation about the beam

# Without a [cell] nothing is checked for collisions. These lines check robot, head and part:
# [cell]
# near_miss_mm = 5

[program]
language = "{language}"
"""


def job_text(part: Part, job: Path, *, robot: str | None = None, unit: str | None = None) -> str:
    """Return a job that cuts the longest closed loops of a part, placed in front of the robot.

    Parameters
    ----------
    part : Part
    job : Path
        Where the job will be; it names the drawing relative to its folder.
    robot : str, optional
        Robot of the library; default: a placeholder, which the job calls that.
    unit : str, optional
        Unit of the drawing, if it was read with another one than it states.

    Raises
    ------
    InputError
        The part has no closed loop, or the robot is unknown.
    """
    closed = [loop for loop in part.loops if loop.closed and loop.kind != "open"]
    main = [loop for loop in closed if not loop.skin and loop.side in ("outer", "")] or closed
    if not main:
        raise InputError(
            f"{part.path}: expected a closed loop, got none; write a job that picks its open lines"
        )
    chosen = sorted(main, key=lambda loop: loop.length)[-MOST_LOOPS:]
    used = library_robot(robot or PLACEHOLDER)
    xyz, rpy = _place(part, chosen, used.reach or REACH)
    file = Path(relpath(part.path, job.parent)).as_posix()
    head = HEAD.format(
        drawing=part.path.name,
        job=job.name,
        robot=used.id,
        chosen="" if robot else '   # guess, a placeholder: yours, see "kerfpath robots"',
        accelerations=_accelerations(used),
        name=json.dumps(file, ensure_ascii=False),
        unit="" if unit is None else f'unit = "{unit}"\n',
        xyz=xyz,
        rpy=list(rpy),
        count=len(chosen),
        total=counted(len(part.loops), "loop"),
    )
    spoken = (name for name, each in languages().items() if used.manufacturer in each.manufacturers)
    return head + "".join(map(_contour, chosen)) + TAIL.format(language=next(spoken, "csv"))


def _accelerations(robot: Robot) -> str:
    """Return the lines of the accelerations: a typical ratio, or what is to be filled in."""
    if robot.acceleration is not None and robot.velocity is not None:
        return "# acceleration_deg_s2 = [...]: by default those of the library"
    names = ["acceleration_deg_s2"]
    if robot.velocity is None:
        names = ["lower_deg", "upper_deg", "velocity_deg_s", *names]
    own = "\n".join(f"# {name} = [{', '.join(['0'] * robot.joints)}]" for name in names)
    ratio = robot.acceleration_ratio
    if robot.velocity is None or not ratio:
        return f"# To be filled in, as no library knows them: those of your controller.\n{own}"
    return (
        f'acceleration_ratio = "{ratio}"   # guess: the maker publishes none\n'
        f"{own}   # better: those of your controller"
    )


def _contour(loop: Loop) -> str:
    spacing = max(SPACING, round(loop.length * 1e3 / NODES, 1))
    name = json.dumps(loop.name, ensure_ascii=False)
    return f"[[contour]]\npick = {name}\nspeed_m_min = 3\nspacing_mm = {spacing:g}\n\n"


def _place(part: Part, loops: Sequence[Loop], reach: float) -> tuple[list[float], tuple[int, ...]]:
    """Return xyz in mm and rpy in deg with which the beam comes mainly from above."""
    axes = np.vstack([part.contour(loop.name).axes.mean(axis=0) for loop in loops])
    weighed = (axes * np.array([[loop.length] for loop in loops])).sum(axis=0)

    def turned(rpy: tuple[int, ...]) -> Array:
        return np.asarray(pose((0.0, 0.0, 0.0), rpy)[:3, :3])

    rpy = max(TURNS, key=lambda one: round(float(-(turned(one) @ weighed)[2]), 9))
    corners = np.array(np.meshgrid(*part.bounding_box.T)).reshape(3, -1).T @ turned(rpy).T * 1e3
    low, high = corners.min(axis=0), corners.max(axis=0)
    from_middle = np.array([*(low + high)[:2] / 2, low[2]])
    place = np.round(np.array(PLACE) * reach, 2) * 1e3
    return (place - from_middle).round(1).tolist(), rpy
