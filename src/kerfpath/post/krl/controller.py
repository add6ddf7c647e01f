"""A KUKA controller: its settings, axes and external axes, and the issues of KRL."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from kerfpath.arrays import Array, Ints, floats, freeze
from kerfpath.errors import InputError
from kerfpath.post.build import (
    AxisCount,
    axes_that_carry,
    axis_numbers,
    calibration_remarks,
    from_controller_units,
    setup_remarks,
    to_controller_units,
    wrist_in_plane,
)
from kerfpath.post.languages import (
    Controller,
    Inherited,
    LinesPerFile,
    OrientationSetting,
    OverrideSetting,
    PositionerFrame,
    PowerSettings,
    Rules,
    ShortestMove,
    number,
    numbered,
    plain,
    setting,
)
from kerfpath.post.program import JointMove, Program, ProgramIssue
from kerfpath.robots import MOST_EXTERNAL, Robot

# -----------------------------------------------------------------------------
# Axes of KUKA controllers, and Status and Turn of a pose.
#
# KUKA's axes 1, 4 and 6 turn positive against the right-hand rule, and all axes are zero with the
# arm stretched ahead: the candle pose is A2 = -90 deg, A3 = 0. Library robots by KUKA count their
# joints this way. From KUKA's manuals: bit 0 of the Status is set where the wrist centre lies
# behind axis 1 (x below zero in a frame that turns with it), bit 1 where A3 is not below the
# angle at which the arm is stretched (0 deg without an offset between axes 3 and 4), bit 2 where
# A5 is negative; bit n of the Turn where axis n + 1 is negative. Manuals differ on bit 2 at A5 =
# 0: here it is 0.

SIGN = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
COUNTED_FROM = (0.0, -90.0, 0.0, 0.0, 0.0, 0.0)
"""KUKA's axes (deg) where the angles of the model are 0, before the signs."""
COUNT = AxisCount(
    counted_from=COUNTED_FROM, matrix=np.diag(SIGN), shift=SIGN * np.radians(COUNTED_FROM)
)
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their sign: -1e-15 deg is zero."""


def status_and_turn(robot: Robot, q: ArrayLike) -> Ints:
    """Return Status and Turn, (K, 2), for joint vectors q (K, n) rad.

    An endless axis is taken modulo 360 deg, from -180 deg on.
    """
    q = floats(q, "q", (None, robot.joints))
    arm = robot.arm.model()
    ahead, _ = wrist_in_plane(robot, q)
    axes_deg = np.degrees(axes_from_joints(robot, q))
    stretched_deg = np.degrees(np.arctan2(-arm.a2, arm.c3))
    bent = np.round(axes_deg[:, 2] - stretched_deg, NOISE_DECIMALS) >= 0
    once = (axes_deg + 180.0) % 360.0 - 180.0
    negative = np.round(np.where(robot.endless[:6], once, axes_deg), NOISE_DECIMALS) < 0
    found = np.empty((len(q), 2), dtype=np.int64)
    found[:, 0] = (ahead < 0) + 2 * bent + 4 * negative[:, 4]
    found[:, 1] = negative @ (1 << np.arange(6))
    return freeze(found)


def posture(robot: Robot, q: Array, settings: object) -> list[tuple[int | str, ...]]:
    """Return `status_and_turn` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in status_and_turn(robot, q).tolist()]


# -----------------------------------------------------------------------------
# Settings of a KUKA controller, and rules of its programs.

AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
SHORTEST_MS = 12.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
LONGEST_NAME = 24
"""Characters of a name."""
SLOWEST = 1e-5
"""Lowest speed (m/s) that is written with an error of a tenth at most."""
POINT_STEP, ANGLE_STEP = 0.5e-7, float(np.radians(0.5e-6))
"""Rounding errors of four decimals of mm (m), and of six decimals of deg (rad)."""
SPEED_STEP = 1e-6
"""Speeds have six decimals of m/s."""
LONGEST_LEAD = 10.0
"""Longest lead (s) of a trigger; longer is a mistake in its unit (KUKA's bound is 10000 s)."""

KEYWORDS = (
    "and anin anout asyptp asycancel b_and b_exor b_not b_or bool brake c_dis c_ori c_ptp c_spl "
    "c_vel case cast_from cast_to char circ circ_rel confirm const continue decl def default "
    "defdat deffct delay distance do else end enddat endfct endfor endif endloop endspline "
    "endswitch endwhile enum exit exor ext extfct false for global goto halt if import in inout "
    "int interrupt is lin lin_rel loop maximum minimum not on onstart off or out path prio ptp "
    "ptp_rel ptp_spline public pulse real repeat resume return scirc scirc_rel sec signal slin "
    "slin_rel spl spl_rel spline sptp sptp_rel step struc switch then time_block to trigger true "
    "until wait when while with const_vel"
)
"""Keywords of the language."""
MEANINGS = (
    "abs acos atan2 cos sin sqrt tan axis e3axis e3pos e6axis e6pos frame load pos base_data "
    "tool_data load_data machine_def machine_tool_data bas bas_command cell home xhome sps "
    "ir_stopm p00 fdat pdat ldat fdat_act pdat_act ldat_act basis_sugg_t err_raise varstate cread "
    "on_error_proceed cwrite copen cclose sread swrite forward inverse strlen strclear stradd "
    "strcomp strcopy strfind strtofrm timer flag msgnotify msgquit msgdialog"
)
"""Types, functions, data and programs of a controller that a contour could have as its name."""
RESERVED = frozenset((KEYWORDS + " " + MEANINGS).split())

Output = Annotated[int | None, numbered("a digital output", 8192)]
Input = Annotated[int | None, numbered("a digital input", 8192)]

Analogue = Annotated[int | None, numbered("an analogue output", 32)]

Number = Annotated[int, Field(ge=1, le=6)]
Numbers = Annotated[
    Annotated[list[Number], Field(min_length=1, max_length=MOST_EXTERNAL)] | None,
    setting("a list of numbers from 1 to 6, one for each external axis", "[1, 2]"),
]


class KrlSettings(PowerSettings, output=Output, input=Input, analogue=Analogue):
    """Outputs, inputs, tool and base, and limits of the machine data."""

    lines_per_file: LinesPerFile = 1400
    tool_number: Annotated[
        int | None, setting("the number of a TOOL_DATA, 1 to 128", "1", ge=1, le=128)
    ] = None
    base_number: Annotated[
        int | None, setting("the number of a BASE_DATA, 1 to 128", "1", ge=1, le=128)
    ] = None
    largest_speed_m_s: Annotated[
        float, setting("a speed from 0.01 to 10, in m/s ($VEL_MA.CP)", "3.0", ge=0.01, le=10)
    ] = 3.0
    machine_number: Annotated[
        int, setting("the number of a MACHINE_DEF, 1 to 16", "2", ge=1, le=16)
    ] = 2
    external_numbers: Numbers = None
    positioner_frame: PositionerFrame = None
    turning_speed_deg_s: Annotated[
        float, setting("a speed from 1 to 1000, in deg/s ($VEL.ORI1)", "200.0", ge=1, le=1000)
    ] = 200.0
    orientation: OrientationSetting = "two-angle"
    shortest_move_ms: ShortestMove = None
    override: OverrideSetting = "full"


def inherited(settings: KrlSettings) -> tuple[Inherited, ...]:
    """Return the states that another program may have left; BAS comes first, as it sets many."""
    wrist, turning_deg_s = settings.orientation == "wrist", number(settings.turning_speed_deg_s, 1)
    return (
        Inherited(
            state="speed, acceleration, corners, frames",
            lines=("BAS(#INITMOV,0)",),
            why="they get the controller's defaults, and no tool and base",
        ),
        Inherited(
            state="speed",
            lines=("$OV_PRO=100",) if settings.override == "full" else (),
            why="override; the operator may lower it again, and slower is not as planned",
        ),
        Inherited(
            state="acceleration", lines=("BAS(#ACC_PTP,100)",), why="of joint moves, as planned"
        ),
        Inherited(state="look-ahead", lines=("$ADVANCE=5",), why="corners need the next moves"),
        Inherited(
            state="turning",
            lines=(
                "$IPO_MODE=#BASE",
                f"$ORI_TYPE=#{'JOINT' if wrist else 'VAR'}",
                "$CIRC_TYPE=#BASE",
                f"$VEL.ORI1={turning_deg_s}",
                f"$VEL.ORI2={turning_deg_s}",
            ),
            why="how, and how fast, the tool turns between targets",
        ),
        Inherited(state="tool and base", why="`$TOOL` and `$BASE`, after BAS, are checked"),
        Inherited(
            state="path correction, soft servos, asynchronous axes",
            why="left to the caller: their instructions are there only with an option",
        ),
    )


def rules(settings: KrlSettings) -> Rules:
    """Return the rules of KRL programs."""
    return Rules(
        longest_name=LONGEST_NAME,
        slowest=SLOWEST,
        fastest=settings.largest_speed_m_s,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(
            turning_speed=float(np.radians(settings.turning_speed_deg_s)),
            orientation=settings.orientation,
        ).with_shortest(settings.shortest_move_ms, SHORTEST_MS),
        longest_lead=LONGEST_LEAD,
    )


def is_reserved(name: str) -> bool:
    """Return whether KRL or every KUKA controller gives `name` another meaning."""
    return name.lower() in RESERVED


# -----------------------------------------------------------------------------
# External axes in KRL: their numbers, and the base that moves with the part.
#
# A target gives external axis n as En, in mm or deg. EK couples $BASE to an external kinematic
# system of the configuration (MACHINE_DEF, #EASYS and so on): its third argument is the part in
# the frame that moves with it. An axis that carries the robot moves $ROBROOT by its own machine
# data (#ERSYS); fixed bases are in $WORLD.

DECIMALS = 6
_FIELD = re.compile(r",E(\d) (-?\d+(?:\.\d+)?)", re.ASCII)


def coupled(robot: Robot) -> bool:
    """Return whether the base moves with the part."""
    return bool(axes_that_carry(robot, "part"))


def external_fields(robot: Robot, q: Array, settings: KrlSettings) -> list[str]:
    """Return the external axes in targets at joint vectors q (K, n), after the other fields."""
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    return [
        "".join(f",E{n} {number(x, DECIMALS)}" for n, x in zip(numbers, row, strict=False))
        for row in to_controller_units(robot, q).tolist()
    ]


def read_fields(robot: Robot, text: str, settings: KrlSettings) -> Array:
    """Return the values (E,) m and rad in a target.

    Raises
    ------
    InputError
        The external axes are not those of the robot; the message names one.
    """
    values = {int(n): float(value) for n, value in _FIELD.findall(text)}
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    names = {n: axis.name for n, axis in zip(numbers, robot.externals, strict=True)}
    for n in names:
        if n not in values:
            raise InputError(f"E{n} is missing: the target has no value for {names[n]}")
    for n in values:
        if n not in names:
            raise InputError(f"E{n} = {values[n]:g}: the robot has no such external axis")
    if len(_FIELD.findall(text)) > len(values):
        raise InputError("the target gives an external axis twice")
    return from_controller_units(robot, [values[n] for n in numbers]) if names else np.zeros(0)


def missing(robot: Robot, settings: KrlSettings) -> Iterator[str]:
    """Yield what is wrong in the settings for a robot's external axes."""
    numbers, count = settings.external_numbers, len(robot.externals)
    if numbers is not None and (len(numbers) != count or len(set(numbers)) < count):
        names = ", ".join(axis.name for axis in robot.externals)
        yield (
            f"expected a different number for each external axis ({names}), got {numbers}; give "
            "the number n of each En with external_numbers in [program.krl]"
        )
    if coupled(robot) and settings.base_number is not None:
        yield (
            "the base moves with the part and is written in the program; leave base_number out of "
            "[program.krl]"
        )


def remarks(robot: Robot, settings: KrlSettings) -> Iterator[str]:
    """Yield remarks on what must be set up at the controller."""
    yield from map(plain, setup_remarks(robot))
    numbers = axis_numbers(settings.external_numbers, len(robot.externals))
    for n, axis in zip(numbers, robot.externals, strict=True):
        machine = (
            f"MACHINE_DEF[{settings.machine_number}]" if axis.carries == "part" else "$ROBROOT"
        )
        yield f"{plain(axis.name)} is E{n}, and moves {machine}."
    if coupled(robot):
        what = f"MACHINE_DEF[{settings.machine_number}]"
        yield from calibration_remarks(robot, what, settings.positioner_frame)


# -----------------------------------------------------------------------------
# Issues that only KRL has: the controller's frames, turns beyond Turn, the short way.

HOME = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
"""Axes at which the lower arm is upright and the rest points ahead."""
FLANGE = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Orientation of the controller's flange there: z ahead, x down."""
FRAME = 1e-6
"""Largest difference (m and sine) of a description's frames from the controller's."""
TURN_DEG = 360.0
"""Largest axis value, either way, that Turn with its one bit for each axis can express."""
HALF_TURN_DEG = 180.0 - 1e-3
"""An endless axis that should turn farther in one motion turns the other way."""


def bounds(robot: Robot) -> tuple[Array, Array]:
    """Return the least and greatest joints (6,) rad that Turn can express."""
    return COUNT.bounds(robot, np.full(6, np.radians(TURN_DEG)))


def check(program: Program, settings: KrlSettings) -> Iterator[ProgramIssue]:
    """Yield what KRL cannot express of a program, or a KUKA controller cannot do."""
    yield from _check_frames(program.robot)
    moves = program.moves
    places = [
        f"{s.name}, move {number}" for s in program.sections for number in range(len(s.moves))
    ]
    q = np.array([move.q for move in moves])
    axes_deg = np.degrees(axes_from_joints(program.robot, q))
    beyond = (np.abs(axes_deg) > TURN_DEG) & ~program.robot.endless[:6]
    axes_deg = np.hstack([axes_deg, to_controller_units(program.robot, q)])
    for k, i in np.argwhere(beyond).tolist():
        message = f"A{i + 1} = {axes_deg[k, i]:.1f} deg cannot be expressed by Status and Turn"
        fix = "only an endless axis may pass 360 deg; set endless, or limit the axis"
        yield ProgramIssue("error", "turn", f"{message}; {fix}", places[k])
    for k, move in enumerate(moves):
        if isinstance(move, JointMove) and move.zone > 0:
            message = "a joint move cannot have a zone given as a length; give it no zone"
            yield ProgramIssue("error", "zone", message, places[k])
        if isinstance(move, JointMove) and k > 0:
            yield from _check_short_way(program, axes_deg[k] - axes_deg[k - 1], places[k])


def _check_frames(robot: Robot) -> Iterator[ProgramIssue]:
    """Check that the robot's base and flange are $ROBROOT and the controller's flange."""
    g = robot.geometry
    T = robot.alone().forward(joints_from_axes(robot, HOME))[0]
    point = np.array([g["a1"] + g["c3"] + g["c4"], g["b"], g["c1"] + g["c2"] - g["a2"]])
    off = max(np.abs(T[:3, 3] - point).max(), np.abs(T[:3, :3] - FLANGE).max())
    if off > FRAME:
        yield ProgramIssue(
            "error",
            "frames",
            f"base or flange of {robot.id!r} are not the controller's: at A1 to A6 = 0, -90, 90, "
            f"0, 0, 0 deg the flange must be at {np.round(point * 1e3, 3).tolist()} mm, with z "
            "ahead and x down; choose those links of the description",
            "program",
        )


def _check_short_way(program: Program, step_deg: Array, place: str) -> Iterator[ProgramIssue]:
    """Check the joint moves of endless axes, which turn by less than half a turn in a motion.

    Another way is an error if the transfer moves have been checked for collisions.
    """
    names = [*AXES, *(axis.name for axis in program.robot.externals)]
    for i in np.flatnonzero(program.robot.endless & (np.abs(step_deg) > HALF_TURN_DEG)).tolist():
        short = (step_deg[i] + 180.0) % 360.0 - 180.0
        yield ProgramIssue(
            "error" if program.air_checked else "warning",
            "short-way",
            f"{names[i]} is endless and would turn the short way, by {short:.1f} deg, not by "
            f"{step_deg[i]:.1f} deg as planned",
            place,
        )
