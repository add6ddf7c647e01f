"""A FANUC controller: its settings, axes, frames and external axes, and when it switches."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import StringConstraints

from kerfpath.arrays import Array, Ints, floats, freeze
from kerfpath.errors import InputError
from kerfpath.post.build import (
    AxisCount,
    axes_that_carry,
    from_controller_units,
    setup_remarks,
    to_controller_units,
    wrist_in_plane,
)
from kerfpath.post.languages import (
    Controller,
    Inherited,
    OrientationSetting,
    OverrideSetting,
    PowerSettings,
    Rules,
    ShortestMove,
    number,
    numbered,
    setting,
)
from kerfpath.post.program import JointMove, LinearMove, Move, Program, Section, Step, Switch
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Settings of a FANUC controller, and rules of its programs.

UNITS = {"cm/min": 0.01 / 60, "mm/sec": 1e-3}
"""Units of speeds in m/s; controllers count both in whole numbers."""
CORNER_MS = 120.0
"""Time before and after a corner in which CNT100 is assumed to round it, if not given. In three
published runs of FANUC's simulator, targets 117 and 234 ms apart are the control points of a cubic
B-spline (rpiRobotics/ARM-21-02-F-19-Robot-Motion-Program, M-10iA); longer moves are not on
record."""
SHORTEST_MS = 16.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
LONGEST_LEAD = 30.0
"""Longest time (s) of TB."""
SPECIAL = re.compile(r"(RSR|PNS|STYLE)\d*|CON|PRN|AUX|NUL|(COM|LPT)\d", re.IGNORECASE)
"""Names of programs that signals start, and names of devices on file systems."""
WORDS = (
    "abort call do else end endfor endif for gi go if ir jmp lbl macro message monitor override "
    "p pause payload pl pr r resume_prog return ro rs run select skip sr stop then timer ualm "
    "uframe uframe_num utool utool_num wait"
)
"""Words of the language that a contour could have as its name."""

Output = Annotated[int | None, numbered("a digital output", 4096)]
Input = Annotated[int | None, numbered("a digital input", 4096)]
Analogue = Annotated[int | None, numbered("an analogue output", 4096)]


class FanucSettings(PowerSettings, output=Output, input=Input, analogue=Analogue):
    """Frames, outputs and options of the controller."""

    lines_per_file: Annotated[
        int, setting("a whole number of lines from 100 to 9999", "9999", ge=100, le=9999)
    ] = 9999
    date: Annotated[
        Annotated[str, StringConstraints(pattern=r"^\d\d-\d\d-\d\d \d\d:\d\d:\d\d$")],
        setting("a date as YY-MM-DD hh:mm:ss", '"26-11-21 10:00:00"'),
    ] = "00-01-01 00:00:00"
    user_frame: Annotated[int, setting("a user frame, 1 to 61", "2", ge=1, le=61)] = 1
    tool_frame: Annotated[int, setting("a tool frame, 1 to 29", "2", ge=1, le=29)] = 1
    longest_name: Annotated[
        int, setting("the characters of a program's name, 8 to 36", "8", ge=8, le=36)
    ] = 36
    speed_unit: Annotated[Literal["cm/min", "mm/sec"], setting("cm/min or mm/sec", '"mm/sec"')] = (
        "cm/min"
    )
    fastest_mm_s: Annotated[
        float, setting("the largest speed of linear moves, in mm/s", "4000.0", ge=1, le=20_000)
    ] = 2000.0
    payload_schedule: Annotated[
        int | None,
        setting("a payload schedule, 1 to 10, that holds the load on the flange", "1", ge=1, le=10),
    ] = None
    corner: Annotated[
        Literal["CNT", "CR"], setting("CNT, or CR where the controller has it", '"CR"')
    ] = "CNT"
    cnt_percent: Annotated[int, setting("a CNT value, 0 to 100", "50", ge=0, le=100)] = 100
    corner_ms: Annotated[
        float | None,
        setting("a time from 1 to 1000, in ms, in which CNT100 rounds", "100.0", ge=1, le=1000),
    ] = None
    turns: Annotated[
        Literal["J1 J4 J6", "J4 J5 J6"],
        setting("the axes whose turns are counted, J1 J4 J6 or J4 J5 J6", '"J4 J5 J6"'),
    ] = "J1 J4 J6"
    decimals: Annotated[
        int, setting("the decimals of mm and deg in positions, 3 to 6", "3", ge=3, le=6)
    ] = 4
    orientation: OrientationSetting = "two-angle"
    shortest_move_ms: ShortestMove = None
    interpolation_ms: Annotated[
        float, setting("the controller's interpolation cycle, 0 to 100, in ms", "8.0", ge=0, le=100)
    ] = 8.0
    override: OverrideSetting = "full"


def unit(settings: FanucSettings) -> float:
    """Return the step of speeds, m/s."""
    return UNITS[settings.speed_unit]


def inherited(settings: FanucSettings) -> tuple[Inherited, ...]:
    """Return the states that another program may have left."""
    return (
        Inherited(
            state="speed",
            lines=("OVERRIDE=100%",) if settings.override == "full" else (),
            why="override; the operator may lower it again, and slower is not as planned",
        ),
        Inherited(state="frames", why="each program selects `UFRAME_NUM` and `UTOOL_NUM`"),
        Inherited(state="displacement", why="no move has `Offset` or `Tool_Offset`"),
        Inherited(state="acceleration", why="no move has `ACC` but `ACC100`, which is the default"),
        Inherited(state="motion group", why="`DEFAULT_GROUP` of each program is checked"),
        Inherited(
            state="collision detection, soft float, line tracking",
            why="left to the caller: their instructions are there only with an option",
        ),
    )


def rules(settings: FanucSettings) -> Rules:
    """Return the rules of TP programs."""
    half_digit = 0.5 * 10.0**-settings.decimals
    return Rules(
        longest_name=settings.longest_name,
        name=r"[A-Z][A-Z0-9_]*",
        slowest=unit(settings),
        fastest=settings.fastest_mm_s * 1e-3,
        speed_step=unit(settings),
        longest_lead=LONGEST_LEAD,
        point_step=half_digit * 1e-3,
        angle_step=float(np.radians(half_digit)),
        controller=_controller(settings),
    )


def _controller(settings: FanucSettings) -> Controller:
    """Return the controller: CNT rounds within a time, whatever zone a program has."""
    plain = Controller(
        orientation=settings.orientation, cycle=settings.interpolation_ms * 1e-3
    ).with_shortest(settings.shortest_move_ms, SHORTEST_MS)
    if settings.corner == "CR":
        return plain
    full = CORNER_MS if settings.corner_ms is None else settings.corner_ms
    assumed = (
        f"CNT100 is assumed to round from {CORNER_MS:g} ms before a corner to {CORNER_MS:g} ms "
        "after it, like a cubic B-spline; set corner_ms in [program.fanuc]"
    )
    return replace(
        plain,
        corner_time=full * 1e-3 * max(settings.cnt_percent, 1) / 100,  # CNT0 rounds, but hardly
        rounds_twice=True,
        assumed=assumed if settings.corner_ms is None else "",
    )


def is_reserved(name: str) -> bool:
    """Return whether a controller gives programs called `name` another meaning."""
    return name.lower() in WORDS.split() or SPECIAL.fullmatch(name) is not None


# -----------------------------------------------------------------------------
# Axes of FANUC controllers, the configuration of a pose, and the frames.
#
# Axes: J2 is 0 with the lower arm upright and grows forwards; J3 is the angle of the upper arm
# above the horizontal, whatever J2 is; J4, J5 and J6 are 0 with the tool straight ahead. All of
# them follow from the geometry of the arm, so that joints of any description can be converted.
#
# Configuration: F where J5 is above 0 (beyond half a turn, its sine), else N; D where the wrist
# centre lies behind the extended line of the lower arm, else U; B where it lies behind axis 1,
# else T; then the turns of three axes, 0 within 180 deg, 1 from 180 to 540 deg, -1 from -180 to
# -540 deg.
#
# The frames of the controller: its world has its origin on axis 1 at the height of axis 2; its
# faceplate has z out of the flange and, with all axes at 0, x upwards.
#
# Measured by others on FANUC's simulated controller for an M-20iD/25: LeroyDu56/robconv,
# tests/fixtures/probes/results/CFGPROBE_roboguide.LS @ d0efb3210bd6c3692a3bba8adad6fefa8af5c146.

COUNTED_FROM = (0.0, 0.0, -90.0, 0.0, 0.0, -180.0)
"""Offsets (deg) of the maker's own descriptions."""
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their turns are counted."""
NOISE = 1e-8
"""Sine that counts as zero."""
MATRIX = np.diag([1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
MATRIX[2, 1] = -1.0
COUNT = AxisCount(
    counted_from=COUNTED_FROM, matrix=MATRIX, shift=np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi])
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
TURNING = {"J1 J4 J6": [0, 3, 5], "J4 J5 J6": [3, 4, 5]}
FEWEST_TURNS, MOST_TURNS = -8, 7
"""Smallest and largest turn number that a configuration is assumed to hold."""
FARTHEST_DEG = 360.0 * MOST_TURNS + 180 - 1e-3
"""Angle, either way, within which every axis has such a turn number."""

WIDEST = np.radians([FARTHEST_DEG, np.inf, np.inf, FARTHEST_DEG, FARTHEST_DEG, FARTHEST_DEG])
"""The same (6,), rad, of the axes whose turns may be counted."""


def bounds(robot: Robot) -> tuple[Array, Array]:
    """Return the least and greatest joints (6,) rad whose turns a configuration can hold."""
    return COUNT.bounds(robot, WIDEST)


def endless_bounds(robot: Robot) -> tuple[Array, Array]:
    """Return the same joints (6,) rad of endless joints alone."""
    return COUNT.bounds(robot, WIDEST, endless=True)


def turns(robot: Robot, q: ArrayLike, settings: FanucSettings) -> Ints:
    """Return the turns (K, 3) of the axes in the settings, for joint vectors q (K, n) rad."""
    axes_deg = np.degrees(axes_from_joints(robot, q))[:, TURNING[settings.turns]]
    axes_deg = np.round(axes_deg, NOISE_DECIMALS)
    return freeze((np.sign(axes_deg) * np.floor((np.abs(axes_deg) + 180) / 360)).astype(np.int64))


def posture(robot: Robot, q: Array, settings: FanucSettings) -> list[tuple[int | str, ...]]:
    """Return the configurations of joint vectors q (K, n) rad: three letters and three turns.

    Shoulder and elbow follow from `wrist_in_plane`.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    flipped = np.sin(axes_from_joints(robot, q)[:, 4]) > NOISE
    letters = zip(
        np.where(flipped, "F", "N").tolist(),
        np.where(bend < 0, "D", "U").tolist(),
        np.where(ahead < 0, "B", "T").tolist(),
        strict=True,
    )
    numbers = turns(robot, q, settings).tolist()
    return [(*words, *three) for words, three in zip(letters, numbers, strict=True)]


# -----------------------------------------------------------------------------
# External axes in FANUC listings: extended axes of group 1, and group 2 that carries the part.
#
# Axes that carry the robot are integrated extended axes of its group, E1 and on: X to Z are those
# of the tip in the world, wherever the robot is. Axes that carry the part are the joints of group
# 2, the leader, and COORD on a motion moves the tip straight relative to the part. Positions are
# in the user frame, which is fixed: the part frame with all axes at 0. They therefore give the
# tip after the part has been moved, and each belongs to the values of group 2 beside it. The
# layout is that of controllers' own listings with extended axes and a second group.

DECIMALS = 6
_VALUE = r"= *-?\d*\.\d+ +(?:mm|deg)"
EXTENDED = rf"((?:,\s*E\d{_VALUE})*)"
"""Regular expression of the extended axes of a position, after its last value."""
GROUP_2 = rf"(?:\n\s*GP2:\n\s*UF : (\d+), UT : (\d+),\s*(J\d{_VALUE}(?:,\s*J\d{_VALUE})*))?"
"""Regular expression of group 2 of a position: user frame, tool frame, values."""
_SAID = re.compile(r"([EJ]\d)= *(-?\d*\.\d+) +(mm|deg)", re.ASCII)


def leads(robot: Robot) -> bool:
    """Return whether group 2 carries the part."""
    return bool(axes_that_carry(robot, "part"))


def groups(robot: Robot) -> str:
    """Return the motion groups, of five, in programs that move a robot."""
    return "1,1,*,*,*" if leads(robot) else "1,*,*,*,*"


def _words(robot: Robot) -> dict[int, str]:
    """Return the name of each external axis in positions, by its number from 0."""
    names = {i: f"E{k}" for k, i in enumerate(axes_that_carry(robot, "robot"), 1)}
    return names | {i: f"J{k}" for k, i in enumerate(axes_that_carry(robot, "part"), 1)}


def _rows(robot: Robot, q: Array, letter: str) -> str:
    """Return the values of the axes whose names begin with a letter, at joints q (n,)."""
    words, texts = _words(robot), []
    for i, value in enumerate(to_controller_units(robot, q[None])[0]):
        if words[i][0] == letter:
            measure = " mm" if robot.externals[i].kind == "linear" else "deg"
            texts.append(f"{words[i]}={number(value, DECIMALS):>13} {measure}")
    return ",\t".join(texts)


def extended_rows(robot: Robot, q: Array) -> list[str]:
    """Return the row of extended axes at joints q (n,), if there is any."""
    return [f"\t{text}"] if (text := _rows(robot, q, "E")) else []


def group_2_rows(robot: Robot, q: Array, frames: str) -> list[str]:
    """Return the rows of group 2 at joints q (n,), if there is one."""
    return ["   GP2:", frames, f"\t{text}"] if (text := _rows(robot, q, "J")) else []


def read_values(robot: Robot, extended: str, leading: str) -> Array:
    """Return the values (E,) m and rad in a position.

    Raises
    ------
    InputError
        The axes are not those of the robot, or have another unit; the message names one.
    """
    found = [*_SAID.findall(extended), *_SAID.findall(leading)]
    values = {word: (float(value), unit) for word, value, unit in found}
    words, axes = _words(robot), robot.externals
    if unknown := [word for word in values if word not in words.values()]:
        raise InputError(f"{unknown[0]}: the robot has no such external axis")
    if len(found) > len(values):
        raise InputError("the position gives an external axis twice")
    rows = []
    for i, word in sorted(words.items()):
        unit = "mm" if axes[i].kind == "linear" else "deg"
        if word not in values:
            raise InputError(f"{word} is missing: the position has no value for {axes[i].name}")
        if values[word][1] != unit:
            raise InputError(f"{word}: expected {unit}, got {values[word][1]}")
        rows.append(values[word][0])
    return from_controller_units(robot, rows) if rows else np.zeros(0)


def remarks(robot: Robot) -> Iterator[str]:
    """Yield remarks on what must be set up at the controller."""
    yield from setup_remarks(robot)
    for i, word in sorted(_words(robot).items()):
        where = "GP1, integrated" if word[0] == "E" else "GP2, the leader of GP1"
        yield f"{robot.externals[i].name} is {word} of {where}."


# -----------------------------------------------------------------------------
# Switches before a motion, on the way to its end, and after the tip has stopped there.
#
# The line of a motion has one TB; controllers accept no second one. Other switches ahead of its end
# come before the motion, while the robot is stopped: for example gas, when the tool leaves for the
# start of a contour.


class Switching(NamedTuple):
    """The switches of a move by their line: before it, on it with TB, after it."""

    before: tuple[Switch, ...]
    timed: tuple[Switch, ...]
    after: tuple[Switch, ...]


def split_switches(move: LinearMove) -> Switching:
    """Return the switches of a move by their line; of those ahead, the last has the TB."""
    switches = move.switches
    after = 0
    while move.zone == 0 and after < len(switches) and switches[-1 - after].lead_time == 0:
        after += 1
    ahead = switches[: len(switches) - after]
    by_lead = sorted(ahead, key=lambda switch: -switch.lead_time)
    return Switching(tuple(by_lead[:-1]), tuple(by_lead[-1:]), switches[len(switches) - after :])


def time_before(start: Array, end: Array, speed: float) -> float:
    """Return how long (s) the tip moves between two poses (4, 4) m at a speed (m/s)."""
    return float(np.linalg.norm(end[:3, 3] - start[:3, 3])) / speed


def sayable(program: Program, settings: FanucSettings) -> Program:
    """Return the program; switches before a motion get its duration as their lead time."""
    sections = tuple(
        replace(s, steps=tuple(_with_early_switches(program, s, settings)))
        for s in program.sections
    )
    return replace(program, sections=sections)


def _with_early_switches(
    program: Program, section: Section, settings: FanucSettings
) -> Sequence[Step]:
    steps: list[Step] = []
    before: Move | None = None
    for step in section.steps:
        if isinstance(step, LinearMove) and before is not None and split_switches(step).before:
            (start,) = program.tips([before])
            speed = round(step.speed / unit(settings)) * unit(settings)
            early = time_before(start, step.T_part_tip, speed)
            first, timed, after = split_switches(step)
            moved = (replace(switch, lead_time=early) for switch in first)
            steps.append(replace(step, switches=(*moved, *timed, *after)))
        else:
            steps.append(step)
        if isinstance(step, JointMove | LinearMove):
            before = step
    return steps
