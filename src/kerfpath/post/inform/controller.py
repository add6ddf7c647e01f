"""A Yaskawa controller: its settings, axes and external axes, and the issues of INFORM."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, StringConstraints

from kerfpath.arrays import Array, Ints, floats, freeze
from kerfpath.errors import InputError
from kerfpath.post.arcs import TICK, not_whole
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
    PowerSettings,
    Rules,
    ShortestMove,
    numbered,
    setting,
)
from kerfpath.post.program import (
    Await,
    JointMove,
    LinearMove,
    Program,
    ProgramIssue,
    Section,
    Step,
    Wait,
    stop_to_switch,
    switches_of,
    warn_of_late_switches,
)
from kerfpath.robots import MOST_EXTERNAL, Robot

# -----------------------------------------------------------------------------
# Settings of a Yaskawa controller, and rules of its jobs.

SHORTEST_MS = 12.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
LEVEL_MM = 12.5
"""Distance from a corner at which a position level is assumed to round it, if not given."""
SPEED_STEP = 1e-4
"""Speeds (m/s) have one decimal of mm/s."""
POINT_STEP = 0.5e-6
"""Positions (m) have three decimals of mm."""
ANGLE_STEP_DEG = 0.5e-4
"""Angles have four decimals of deg."""


def _not_zero(values: list[float]) -> list[float]:
    if not all(np.isfinite(values)) or not all(values):
        raise ValueError("zero pulses")
    return values


Output = Annotated[int | None, numbered("an output", 4096)]
Input = Annotated[int | None, numbered("an input", 4096)]
Analogue = Annotated[int | None, numbered("an analogue output", 40)]


class InformSettings(PowerSettings, output=Output, input=Input, analogue=Analogue):
    """Frames, outputs, and the pulses of the individual robot."""

    lines_per_file: Annotated[
        int, setting("a whole number of lines from 100 to 9999", "9999", ge=100, le=9999)
    ] = 9999
    user_frame: Annotated[int, setting("a user frame, 1 to 63", "2", ge=1, le=63)] = 1
    tool_number: Annotated[int, setting("a tool, 0 to 63", "2", ge=0, le=63)] = 0
    pulses_per_deg: Annotated[
        Annotated[list[float], AfterValidator(_not_zero)] | None,
        setting(
            "six numbers, the pulses per deg of S, L, U, R, B and T",
            "[1341.4, 1341.4, 1000.0, 1000.0, 800.0, 500.0]",
            min_length=6,
            max_length=6,
        ),
    ] = None
    external_pulses: Annotated[
        Annotated[
            list[float], Field(min_length=1, max_length=MOST_EXTERNAL), AfterValidator(_not_zero)
        ]
        | None,
        setting(
            "a list of numbers, the pulses of each external axis per mm or per deg",
            "[100.0, -1019.7]",
        ),
    ] = None
    position_level: Annotated[
        int, setting("a position level for corners, 1 to 8", "1", ge=1, le=8)
    ] = 1
    position_level_mm: Annotated[
        float | None,
        setting("a length from 0.01 to 500, in mm, that the level has", "12.5", ge=0.01, le=500),
    ] = None
    fastest_mm_s: Annotated[
        float, setting("the largest speed of MOVL, in mm/s", "1500.0", ge=1, le=20_000)
    ] = 1500.0
    longest_name: Annotated[
        int, setting("the characters of a job's name, 8 to 32", "8", ge=8, le=32)
    ] = 32
    rconf_values: Annotated[
        Literal[6, 8, 24], setting("the values after RCONF: 6, 8 or 24", "6")
    ] = 24
    flip: Annotated[
        Literal["B", "R"], setting("the axis whose angle decides flip, B or R", '"R"')
    ] = "B"
    orientation: OrientationSetting = "slerp"
    shortest_move_ms: ShortestMove = None
    date: Annotated[
        Annotated[str, StringConstraints(pattern=r"^\d{4}/\d\d/\d\d \d\d:\d\d$")],
        setting("a date as YYYY/MM/DD HH:MM", '"2026/11/21 10:00"'),
    ] = "2000/01/01 00:00"


def inherited(settings: InformSettings) -> tuple[Inherited, ...]:
    """Return the states that another job may have left."""
    return (
        Inherited(state="displacement", lines=("SFTOF",), why="shifted positions, in every job"),
        Inherited(state="speed", why="each move has `V` or `VJ`"),
        Inherited(state="acceleration", why="no move has `ACC` or `DEC`: both are full"),
        Inherited(state="frames", why="`///TOOL`, `///USER` and `///FRAME` of each job"),
        Inherited(state="motion group", why="`///GROUP1` of each job is checked"),
        Inherited(
            state="shock detection, soft servos, speed override",
            why="left to the caller: they need an option, or are the operator's",
        ),
    )


def rules(settings: InformSettings) -> Rules:
    """Return the rules of jobs."""
    pulses = np.abs(settings.pulses_per_deg or [np.inf])
    external = np.abs(settings.external_pulses or [np.inf])
    return Rules(
        longest_name=settings.longest_name,
        name=r"[A-Z][A-Z0-9_]*",
        slowest=SPEED_STEP,
        fastest=settings.fastest_mm_s * 1e-3,
        speed_step=SPEED_STEP,
        point_step=max(POINT_STEP, 0.5e-3 / float(external.min())),
        angle_step=float(np.radians(max(ANGLE_STEP_DEG, 0.5 / min(pulses.min(), external.min())))),
        controller=_controller(settings),
    )


def _controller(settings: InformSettings) -> Controller:
    """Return the controller: the length of a position level is one of its parameters."""
    level, length = settings.position_level, settings.position_level_mm
    assumed = (
        f"PL={level} is assumed to round from {LEVEL_MM:g} mm before a corner; set "
        f"position_level_mm in [program.inform], the controller's parameter S1CxG{32 + level:03d}"
    )
    return Controller(
        orientation=settings.orientation,
        corner=(LEVEL_MM if length is None else length) * 1e-3,
        assumed=assumed if length is None else "",
    ).with_shortest(settings.shortest_move_ms, SHORTEST_MS)


def is_reserved(name: str) -> bool:
    """Return whether a job cannot be called `name`: only MASTER is the controller's own."""
    return name.upper() == "MASTER"


# -----------------------------------------------------------------------------
# Axes of Yaskawa controllers, and the manipulator type (RCONF) of a pose.
#
# Axes S, L, U, R, B, T are zero with the lower arm upright, the rest straight ahead and the
# flange's x up; S and L turn by the right-hand rule, U lifts the upper arm off the lower one. The
# joints of the library's arms count this way (their descriptions are those of the ROS drivers,
# which convert pulses to radians by a factor for each axis); other descriptions are converted by
# the arm's model.
#
# The type of a position has six bits: no-flip; lower arm; rear; and for each of R, T and S
# whether the angle lies beyond -180 to 180 deg. No-flip is where B is negative, as on a YRC1000:
# 20 positions of an AR2010, in pulses and in its robot frame, agree with this in all bits and to
# 0.02 mm (icors2/Yaskawa-Job-Helper, fixtures/calibration/CALIBRATION_STANDARD.JBI @
# 87495b7570f6ce15027710c068869f5a0ab0ac87 and CALIBRATION_RELATIVE.JBI @
# 549b81a697bf29b4d80f8966f80d891fa7b508e8). By the manuals of older controllers (NX100
# 149235-1CD, 3.9; DX100 156191-1CD, 4.1) it is where R lies beyond a quarter turn either way (at
# -90 deg, and from 90 to 270 deg); the setting `flip` selects it. Our reading of their figures:
# lower arm where the wrist centre lies behind the extended line of the lower arm; rear where it
# lies behind axis S. The world of the controller has its origin on axis S at the height of axis
# L.

COUNTED_FROM = (0.0, 0.0, -90.0, 0.0, 0.0, -180.0)
"""Offsets (deg) of the maker's own descriptions."""
COUNT = AxisCount(
    counted_from=COUNTED_FROM,
    matrix=np.diag([1.0, 1.0, -1.0, -1.0, -1.0, -1.0]),
    shift=np.array([0.0, 0.0, np.pi / 2, 0.0, 0.0, np.pi]),
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE = 1e-6
"""How far (rad) an axis may be beyond its limit because of rounding."""
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before they are compared."""


def manipulator_type(robot: Robot, q: ArrayLike, flip: Literal["B", "R"] = "B") -> Ints:
    """Return the six bits of RCONF, (K, 6), for joint vectors q (K, n) rad.

    Shoulder and elbow follow from `wrist_in_plane`; `flip` is the axis that decides the first bit.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    axes_deg = np.round(np.degrees(axes_from_joints(robot, q)), NOISE_DECIMALS)
    turned = axes_deg[:, 3] % 360.0
    far = (axes_deg > 180) | (axes_deg <= -180)
    no_flip = axes_deg[:, 4] < 0 if flip == "B" else (turned > 90) & (turned <= 270)
    bits = [no_flip, bend < 0, ahead < 0, far[:, 3], far[:, 5], far[:, 0]]
    return freeze(np.array(bits, dtype=np.int64).T)


def posture(robot: Robot, q: Array, settings: InformSettings) -> list[tuple[int | str, ...]]:
    """Return `manipulator_type` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in manipulator_type(robot, q, settings.flip).tolist()]


def joints_at(
    robot: Robot, T_base_flange: Array, bits: tuple[int, ...], flip: Literal["B", "R"]
) -> Array | None:
    """Return the joints (6,) rad at a flange pose (4, 4) m with a type of six bits.

    The type gives the turns of S, R and T within 360 deg either way; the turns of the other axes
    are within their limits. Return None if no joints or several joints have this pose and type.
    """
    solved = robot.inverse(T_base_flange, within_limits=False).q
    turns = 2 * np.pi * np.array(list(product((-1, 0, 1), repeat=6)))
    axes = axes_from_joints(robot, (solved[:, None] + turns).reshape(-1, 6))
    q = joints_from_axes(robot, axes[(np.abs(axes) <= 2 * np.pi + 1e-9).all(axis=1)])
    if not len(q):
        return None
    q = q[(manipulator_type(robot, q, flip) == bits).all(axis=1)]
    limits = robot.joint_limits()
    within = ((q >= limits.lower - NOISE) & (q <= limits.upper + NOISE))[:, [1, 2, 4]].all(axis=1)
    q = q[within]
    return freeze(q[0]) if len(q) == 1 else None


# -----------------------------------------------------------------------------
# External axes in jobs: base axes that carry the robot, stations that carry the part, in pulses.
#
# With external axes every position is in pulses: those of the arm (C), of the base axes (BC,
# control group BS1 beside RB1) and of the station (EC, group ST1). A path on a part that a
# station carries is SMOVL: the robot follows the station, which +MOVJ moves. Layout and groups
# are those of a DX200's own jobs (MQCIA/yaskawa-cadcam, reference cell with RECT-X and TURN-1).

_MOVE = re.compile(
    r"S?(MOVJ|MOVL) (C\d{5})(?: BC\d{5})? (VJ?=[\d.]+ PL=\d)"
    r"(?: \+MOVJ EC\d{5}(?: VJ=[\d.]+)?)?",
    re.ASCII,
)
_POSITION = re.compile(r"(BC|EC)(\d{5})=(-?\d+(?:,-?\d+)*)", re.ASCII)


class ExternalPulses:
    """The external axes of a robot in the lines of its jobs.

    Parameters
    ----------
    robot : Robot
    settings : InformSettings
        Settings with pulses for each axis; `missing` reports before if they are not given.
    """

    def __init__(self, robot: Robot, settings: InformSettings) -> None:
        self.robot = robot
        count = len(robot.externals)
        self.scales = np.array((settings.external_pulses or [np.nan] * count)[:count])
        self.numbers = {
            word: axes_that_carry(robot, what) for word, what in (("BC", "robot"), ("EC", "part"))
        }
        """The numbers, from 0, of the axes in positions of each kind."""

    def kinds(self) -> list[str]:
        """Return the kinds of positions beside those of the arm."""
        return [word for word, numbers in self.numbers.items() if numbers]

    def counts(self, count: int) -> str:
        """Return the numbers of ///NPOS for `count` positions."""
        each = [count, *(count if self.numbers[word] else 0 for word in ("BC", "EC")), 0, 0, 0]
        return ",".join(map(str, each))

    def groups(self) -> list[str]:
        """Return the control groups of a job."""
        base = ",BS1" if self.numbers["BC"] else ""
        return [f"///GROUP1 RB1{base}", *(["///GROUP2 ST1"] if self.numbers["EC"] else [])]

    def rows(self, q: Array) -> list[str]:
        """Return the positions of base axes and station, at joints q (K, n)."""
        pulses = np.round(to_controller_units(self.robot, q) * self.scales).astype(np.int64)
        return [
            f"{word}{k:05d}={','.join(map(str, row[self.numbers[word]].tolist()))}"
            for word in self.kinds()
            for k, row in enumerate(pulses)
        ]

    def read(self, row: str, word: str, k: int, pulses: Array) -> None:
        """Read position k of a kind from a row into the pulses (E,) of the external axes.

        Raises
        ------
        InputError
            The row is not a position that `rows` writes there.
        """
        match, numbers = _POSITION.fullmatch(row), self.numbers[word]
        if match is None or (match[1], int(match[2])) != (word, k):
            raise InputError(f"expected position {word}{k:05d}, got {row[:60]!r}")
        values = match[3].split(",")
        if len(values) != len(numbers):
            names = " and ".join(self.robot.externals[i].name for i in numbers)
            raise InputError(f"{word}{k:05d}: expected pulses of {names}, got {match[3]}")
        pulses[numbers] = [float(value) for value in values]

    def values(self, pulses: Array) -> Array:
        """Return values (K, E) m and rad of pulses."""
        return from_controller_units(self.robot, pulses / self.scales)

    def moved(self, line: str) -> str:
        """Return the line of a move with the positions of base axes and station."""
        word, target, *rest = line.split(" ")
        base = [f"B{target}"] if self.numbers["BC"] else []
        if not self.numbers["EC"]:
            return " ".join([word, target, *base, *rest])
        share = [rest[0]] if word == "MOVJ" else []
        word = "SMOVL" if word == "MOVL" else word
        return " ".join([word, target, *base, *rest, "+MOVJ", f"E{target}", *share])

    def plain(self, row: str) -> str:
        """Return the line of a move without base axes and station; any other line unchanged.

        Raises
        ------
        InputError
            The move does not have exactly the external axes of the robot.
        """
        match = _MOVE.fullmatch(row)
        if match is None:
            return row
        line = " ".join(match.groups())
        if (expected := self.moved(line)) != row:
            raise InputError(f"expected {expected!r}, got {row[:60]!r}")
        return line

    def remarks(self) -> Iterator[str]:
        """Yield remarks on what must be set up at the controller."""
        yield from setup_remarks(self.robot)
        for word, group in (("BC", "base axis"), ("EC", "axis of station ST1")):
            for number, i in enumerate(self.numbers[word], 1):
                yield f"{self.robot.externals[i].name} is {group} {number}."


def missing(robot: Robot, settings: InformSettings) -> Iterator[str]:
    """Yield what is missing in the settings for a robot's external axes."""
    names = ", ".join(axis.name for axis in robot.externals)
    if settings.pulses_per_deg is None:
        yield (
            f"with external axes ({names}) all positions are in pulses; give pulses_per_deg in "
            "[program.inform]"
        )
    given = settings.external_pulses or []
    if len(given) != len(robot.externals):
        yield (
            f"expected the pulses per mm or deg of each external axis ({names}), got {len(given)}; "
            "give external_pulses in [program.inform]"
        )


# -----------------------------------------------------------------------------
# Issues that only INFORM has.

TURNING = {3: "R", 5: "T", 0: "S"}
"""The axes whose turns a type gives, within 360 deg."""
WHOLE_TURN_DEG = 360.0


def bounds(robot: Robot) -> tuple[Array, Array]:
    """Return the least and greatest joints (6,) rad that a position can express.

    With external axes positions are in pulses, which can express all.
    """
    widest = np.full(6, np.inf)
    if not robot.externals:
        widest[list(TURNING)] = np.radians(WHOLE_TURN_DEG)
    return COUNT.bounds(robot, widest)


def sayable(program: Program, settings: InformSettings) -> Program:
    """Return the program with a stop at each switch, which depends on no other output."""
    sections = tuple(
        replace(section, steps=tuple(map(_without_needs, section.steps)))
        for section in stop_to_switch(program, settings).sections
    )
    return replace(program, sections=sections)


def _without_needs(step: Step) -> Step:
    switches = tuple(replace(switch, needs=()) for switch in switches_of(step))
    return replace(step, switches=switches) if isinstance(step, LinearMove) else step


def check(program: Program, settings: InformSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    pulses = program.robot.externals or settings.pulses_per_deg is not None
    if not pulses and any(isinstance(m, JointMove) for m in program.moves):
        yield ProgramIssue(
            "warning",
            "joint-targets",
            "joint moves go to positions with a manipulator type (RCONF), not to pulses; give "
            "pulses_per_deg from the robot's parameters, or check each start at low speed",
            "program",
        )
    for section in program.sections:
        yield from warn_of_late_switches(section, "INFORM")
        if any(switch.needs for step in section.steps for switch in switches_of(step)):
            yield ProgramIssue(
                "warning",
                "restart",
                "a DOUT cannot depend on other outputs: after a stop in the approach begin the "
                "contour again, or the laser comes on without what was asked for",
                section.name,
            )
        yield from _check_times(section)
        yield from _check_turns(program, section, settings)


def _check_times(section: Section) -> Iterator[ProgramIssue]:
    for number, step in enumerate(section.steps):
        times = [step.time] if isinstance(step, Wait) else []
        times += [step.timeout] if isinstance(step, Await) else []
        if any(not_whole(time) for time in times):
            yield ProgramIssue(
                "error",
                "time-step",
                f"expected waits in steps of {TICK * 1e3:g} ms, got {times[0] * 1e3:g} ms",
                f"{section.name}, step {number}",
            )


def _check_turns(
    program: Program, section: Section, settings: InformSettings
) -> Iterator[ProgramIssue]:
    """Check that the turns of R, T and S can be expressed where a position is not in pulses."""
    if not section.moves or program.robot.externals:
        return
    q = np.array([move.q for move in section.moves])
    axes_deg = np.degrees(axes_from_joints(program.robot, q))
    for k, move in enumerate(section.moves):
        if isinstance(move, JointMove) and settings.pulses_per_deg is not None:
            continue
        for i, name in TURNING.items():
            if abs(axes_deg[k, i]) > WHOLE_TURN_DEG:
                yield ProgramIssue(
                    "error",
                    "turns",
                    f"{name} = {axes_deg[k, i]:.1f} deg cannot be expressed by a position, only up "
                    f"to {WHOLE_TURN_DEG:g} deg either way; limit the axis",
                    f"{section.name}, move {k}",
                )
