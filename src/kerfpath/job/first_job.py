"""The text of a first job for a drawing; all its values are guesses to be changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os.path import relpath
from pathlib import Path

import numpy as np

from kerfpath.arrays import Array, counted
from kerfpath.cad import EDGE_TURN, GAP, Loop, Machine, Part
from kerfpath.cad.drawing_frame import ASK
from kerfpath.contour import Contour, turned_about
from kerfpath.errors import InputError
from kerfpath.execution import ASSUMED
from kerfpath.job.format import Drawing, pose, toml_lines, toml_value
from kerfpath.job.format.tables.part import PickTable
from kerfpath.post import languages
from kerfpath.robots import Robot
from kerfpath.robots import robot as library_robot

PLACEHOLDER = "abb_irb4600_60_205"
"""The robot of a job that no robot was given for."""
REACH = 2.0
"""Reach of a robot for which the library has none, m."""
MOST_LOOPS = 250
"""Most loops that a first job looks at, the longest: so many are planned in some minutes."""
FEW = 3
"""Most loops alike that are named one by one; more share a table that picks them by their size."""
BELOW = np.radians(20.0)
"""Angle by which the beam may come from below the horizontal."""
NODES = 400
"""Most nodes of a loop; shorter loops are spaced by `SPACING`."""
SPACING = 2.0
"""Distance between nodes, mm, unless a curve needs less or a loop would have too many."""
SIZE_STEP = 1e-5
"""To which sizes of loops that are picked by them are rounded, m."""
CLOSEST, CLOSER = 0.25, 0.8
"""Distance between nodes, mm, that is not reduced again, and the factor that reduces it."""
CHORD = 5e-5
"""Largest distance of the drawn curve from the chords between nodes, m; half of what the audit
allows by default."""
SPEED, STEPS = 3.0, 10
"""Speed of the cuts, m/min, and number of speeds of circles in each m/min."""
OFF = 5.5e-5
"""Distance from the drawn circle that the lag of the joints may cause at these speeds, m: about
half of what the audit allows; rounded corners take the rest."""
BENT = np.radians(20.0)
"""Least angle of the tool axis from its mean along a loop at which the loop passes bends."""
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
{reading}xyz_mm = {xyz}   # guess: where the part's origin is in the robot base
rpy_deg = {rpy}              # guess: how the part is turned there; the beam comes from above

# {cut} at a guessed speed; `kerfpath contours {drawing}` lists them all.{more}
"""
MORE = """
# A table [contour.pick_all] with kind = "inner", instead of pick, takes all holes at once."""
ROUND = """\
# The beam goes all the way round {loop}. Where the arm alone cannot, a rotary axis that carries
# the part can (without the signs #):
# [[robot.external]]
# name = "table"
# kind = "rotary"
# carries = "part"
# axis = {axis}
# point_mm = {point}
# endless = true
# velocity_deg_s = 120         # guess
# acceleration_deg_s2 = 200    # guess
{unit}
"""
UNIT = """\
# [program.rapid]
# mechanical_units = ["STN1"]  # guess
"""
"""Lines for a loop all the way round, such as the end of a tube, and those that RAPID needs."""
SEQUENCE = """
[sequence]                  # one order with the moves between the contours, for the least time
"""
TAIL = """\
[plan]
gamma_step_deg = 2          # step of the free rotation about the beam
{feed:<28}# slow down where the joints need it, as in bends
{sequence}
# Without a [cell] nothing is checked for collisions. These lines check robot, head and part:
# [cell]
# near_miss_mm = 5

[program]
language = "{language}"
"""


def job_text(
    part: Part, job: Path, *, robot: str | None = None, drawing: Drawing | None = None
) -> str:
    """Return a job that cuts the loops of a part, placed in front of the robot.

    The loops are closed ones, or open lines if there are no others, and such as the beam need not
    come from below for, if there are any.

    Parameters
    ----------
    part : Part
    job : Path
        Where the job will be; it names the drawing relative to its folder.
    robot : str, optional
        Robot of the library; default: a placeholder, which the job calls that.
    drawing : Drawing, optional
        How the part was read, if not by default.

    Raises
    ------
    InputError
        Every loop has a gap, or the robot is unknown.
    """
    lines = [loop for loop in part.loops if loop.kind == "open"]
    closed = [loop for loop in part.loops if loop.closed and loop.kind != "open"]
    main = [loop for loop in closed if not loop.skin and loop.side in ("outer", "")] or closed
    main = main or lines
    if not main:
        raise InputError(
            f"{part.path}: every loop has a gap; `kerfpath contours {part.path}` shows how wide: "
            "give --gap-mm above it"
        )
    longest = sorted(main, key=lambda loop: loop.length)[-MOST_LOOPS:]
    along = {loop.name: part.contour(loop.name, closed=False) for loop in longest}
    rpy = _turn(along)
    level = [loop for loop in longest if _is_level(along[loop.name], rpy)]
    chosen = level or longest
    used = library_robot(robot or PLACEHOLDER)
    dense = [along[loop.name] for loop in chosen]
    axes = [contour.axes for contour in dense]
    xyz = _place(part, rpy, used.reach or REACH)
    file = Path(relpath(part.path, job.parent)).as_posix()
    placed = pose(xyz, rpy)
    spoken = (name for name, each in languages().items() if used.manufacturer in each.manufacturers)
    language = next(spoken, "csv")
    unit = UNIT if language == "rapid" else ""
    turning = (_turning(loop.name, along[loop.name], placed, unit) for loop in reversed(longest))
    head = HEAD.format(
        drawing=part.path.name,
        job=job.name,
        robot=used.id,
        chosen="" if robot else '   # guess, a placeholder: yours, see "kerfpath robots"',
        accelerations=_accelerations(used),
        name=toml_value(file),
        reading=("" if drawing is None else _reading(drawing)) + _frame(part),
        xyz=xyz,
        rpy=list(rpy),
        cut=_below([loop for loop in longest if level and loop not in level])
        + _cut(part, chosen, lines if main is not lines else ()),
        more=MORE if len(main) > len(longest) else "",
    )
    tail = TAIL.format(
        feed=f'{"" if any(map(_is_bent, axes)) else "# "}feed = "dip"',
        sequence=SEQUENCE if chosen[1:] else "",
        language=language,
    )
    contours = _contours(part, [along[loop.name] for loop in chosen])
    return head + next(filter(None, turning), "") + contours + tail


def _turning(loop: str, along: Contour, placed: Array, unit: str) -> str:
    """Return the lines of a rotary axis for a loop all the way round; "" for another."""
    about = turned_about(along.axes)
    if about is None:
        return ""
    axis = placed[:3, :3] @ about
    axis *= np.sign(axis[np.abs(axis).argmax()])
    points = along.points @ placed[:3, :3].T + placed[:3, 3]
    point = ((points.min(axis=0) + points.max(axis=0)) / 2 * 1e3).round(1) + 0.0
    direction = (axis.round(6) + 0.0).tolist()
    return ROUND.format(
        loop=loop, axis=toml_value(direction), point=toml_value(point.tolist()), unit=unit
    )


def _is_bent(axes: Array) -> bool:
    mean = axes.mean(axis=0)
    return bool((axes @ mean).min() < np.cos(BENT) * np.linalg.norm(mean))


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


def _reading(drawing: Drawing) -> str:
    """Return the lines of [part] that say how a drawing was read."""
    given: dict[str, object] = {
        "unit": drawing.unit,
        "gap_mm": None if drawing.gap == GAP else round(drawing.gap * 1e3, 9),
        "edge_turn_mm": None
        if drawing.edge_turn == EDGE_TURN
        else round(drawing.edge_turn * 1e3, 9),
        "outer_towards": drawing.outer_towards,
        "axis": drawing.axis,
        "columns": drawing.columns,
        "sort": drawing.sort,
        "beam": drawing.beam,
        "section": drawing.section,
        "section_mm": np.round(np.multiply(drawing.section_at, 1e3), 9)
        if drawing.section_at
        else None,
        "drawing_frame": drawing.drawing_frame,
        "machine": None if drawing.machine is None else _machine(drawing.machine),
    }
    return toml_lines({key: value for key, value in given.items() if value is not None})


def _frame(part: Part) -> str:
    """Return the line of [part] that leaves out what seems to be a drawing frame."""
    if not any(ASK in one.reason for one in part.left_out):
        return ""
    return 'drawing_frame = "leave_out"   # guess: the rectangle around all else is not cut\n'


def _machine(machine: Machine) -> dict[str, object]:
    given = {
        "head": machine.head or None,
        "table": machine.table or None,
        "tcp": machine.tcp,
        "rollover": machine.rollover,
        "reversed": machine.reversed or None,
        "pivot_mm": None if machine.pivot is None else round(machine.pivot * 1e3, 9),
        "centre_mm": np.round(np.multiply(machine.centre, 1e3), 9) if any(machine.centre) else None,
    }
    return {key: value for key, value in given.items() if value is not None}


def _cut(part: Part, chosen: Sequence[Loop], aside: Sequence[Loop]) -> str:
    """Return the words on the loops of a job, and on the open lines that are not among them."""
    words = f"{len(chosen)} of {counted(len(part.loops), 'loop')},"
    if not aside:
        return words
    of = f"{counted(len(aside), 'open line')} ({aside[0].name}{', ...' if aside[1:] else ''})"
    return (
        f"{of} not in it: to mark or slit along one, pick it by name;\n# if it should be closed, "
        f"set gap_mm in [part] above the gap that the notes name.\n# {words}"
    )


def _contours(part: Part, chosen: Sequence[Contour]) -> str:
    """Return the [[contour]] tables of loops; many alike share one that picks exactly these."""
    spacings: dict[object, float] = {}
    alike: dict[str, list[Loop]] = {}
    for along in chosen:
        loop = part.loop(along.name)
        size = loop.surface, loop.diameter and round(loop.diameter, 6), round(loop.length, 6)
        if size not in spacings:
            spacings[size] = _spacing(part, along)
        alike.setdefault(f"{_speed_lines(loop)}spacing_mm = {spacings[size]:g}\n", []).append(loop)
    tables = []
    for lines, loops in alike.items():
        picked = _picked(part, loops) if len(loops) > FEW else None
        if picked is not None:
            tables.append(f"[[contour]]\n{lines}[contour.pick_all]\n{picked}\n")
            continue
        tables += [f"[[contour]]\npick = {toml_value(loop.name)}\n{lines}\n" for loop in loops]
    return "".join(tables)


def _picked(part: Part, loops: Sequence[Loop]) -> str | None:
    """Return the lines of a [contour.pick_all] that picks these loops alone; None if none does."""
    kind, names = loops[0].kind, {loop.name for loop in loops}
    for name in ("diameter", "length"):
        sizes = [getattr(loop, name) for loop in loops]
        if None in sizes:
            continue
        low = np.floor(min(sizes) / SIZE_STEP) * SIZE_STEP
        high = np.ceil(max(sizes) / SIZE_STEP) * SIZE_STEP
        if low <= 0:
            continue
        keys = {"kind": kind, f"{name}_mm": [float(f"{end * 1e3:.6g}") for end in (low, high)]}
        if {loop.name for loop in PickTable.model_validate(keys).loops(part)} == names:
            return toml_lines(keys)
    return None


def _spacing(part: Part, along: Contour) -> float:
    """Return a distance between nodes, mm, whose chords are close to the curve."""
    spacing = max(SPACING, round(along.length * 1e3 / NODES, 1))
    while spacing > CLOSEST:
        nodes = along.resample(spacing=spacing / 1e3)
        if part.departure(along.name, nodes).chord_error <= CHORD:
            break
        spacing = float(f"{max(CLOSEST, CLOSER * spacing):.2g}")
    return spacing


def _speed_lines(loop: Loop) -> str:
    """Return the line of the speed along a loop: a guess, or the feed of its program."""
    speed = _speed(loop)
    slower = "" if speed == SPEED else "       # guess: slower, as the joints lag on a small circle"
    said = f"speed_m_min = {speed:g}{slower}"
    if loop.feeds:
        own = ", ".join(f"{feed * 60:.4g}" for feed in loop.feeds)
        said = f"# speed_m_min: by default the feed of the program, {own} m/min"
        if loop.feeds[1:]:
            said = f"speed_m_min = {max(loop.feeds) * 60:.4g}   # the program has feeds of {own}"
    return f"{said}\n"


def _speed(loop: Loop) -> float:
    """Return a speed, m/min, at which a lag of the joints as assumed leaves a circle its size.

    A low-pass of standard deviation sigma takes (sigma v)^2 / (2 r) off the radius r.
    """
    if loop.diameter is None:
        return SPEED
    highest = np.sqrt(OFF * loop.diameter) / ASSUMED.sigma.max() * 60
    return float(min(SPEED, max(1, np.floor(STEPS * highest)) / STEPS))


def _turned(rpy: tuple[int, ...]) -> Array:
    return np.asarray(pose((0.0, 0.0, 0.0), rpy)[:3, :3])


def _turn(along: Mapping[str, Contour]) -> tuple[int, ...]:
    """Return rpy in deg with which the beam comes mainly from above."""
    weighed = np.sum([each.axes.mean(axis=0) * each.length for each in along.values()], axis=0)
    return max(TURNS, key=lambda one: round(float(-(_turned(one) @ weighed)[2]), 9))


def _is_level(contour: Contour, rpy: tuple[int, ...]) -> bool:
    """Return whether the beam along a contour never comes from far below."""
    return bool((contour.axes @ _turned(rpy)[2]).max() <= np.sin(BELOW))


def _below(loops: Sequence[Loop]) -> str:
    """Return words on loops that are not in a job because the beam would come from below."""
    if not loops:
        return ""
    some = f"{loops[-1].name}{', ...' if loops[1:] else ''}"
    return (
        f"{counted(len(loops), 'loop')} ({some}) not in it: as the part lies, the beam would come "
        "from below;\n# for these turn the part, or add a rotary axis that carries it "
        "([[robot.external]]).\n# "
    )


def _place(part: Part, rpy: tuple[int, ...], reach: float) -> list[float]:
    """Return xyz in mm with which the part is in front of the robot."""
    corners = np.array(np.meshgrid(*part.bounding_box.T)).reshape(3, -1).T @ _turned(rpy).T * 1e3
    low, high = corners.min(axis=0), corners.max(axis=0)
    from_middle = np.array([*(low + high)[:2] / 2, low[2]])
    place = np.round(np.array(PLACE) * reach, 2) * 1e3
    return [float(value) for value in (place - from_middle).round(1)]
