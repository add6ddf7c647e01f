"""LinuxCNC with a robot's joints as its axes: settings, limits in INI and HAL, issues."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np

from kerfpath.arrays import Array
from kerfpath.post.build import arm_joints, to_controller_units
from kerfpath.post.languages import (
    Inherited,
    LinesPerFile,
    OverrideSetting,
    PowerSettings,
    Rules,
    handshakes,
    setting,
)
from kerfpath.post.program import SIGNALS
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Settings of the controller, and rules of its programs.

WORDS = "XYZABCUVW"
"""The words of joints 1, 2, ... and then of external axes, in deg and mm: no robot has more."""
DECIMALS = 8
"""Decimals of deg and mm."""
OFFSETS = range(5381, 5391)
"""Parameters that hold the offsets and the rotation of the ninth coordinate system."""
PORTS = 16
"""Number of outputs, and of inputs; output n is read back at input `PORTS` + n."""

ANALOGUE = 4
"""Number of analogue outputs."""

Output = Annotated[int | None, setting("a digital output from 0 to 15", "0", ge=0, le=PORTS - 1)]
Input = Annotated[int | None, setting("a digital input from 0 to 15", "0", ge=0, le=PORTS - 1)]


Analogue = Annotated[
    int | None, setting("an analogue output from 0 to 3", "2", ge=0, le=ANALOGUE - 1)
]


class LinuxcncSettings(PowerSettings, output=Output, input=Input, analogue=Analogue):
    """Inputs and outputs of the controller, the tolerance of its corners, and the override."""

    lines_per_file: LinesPerFile = 1_000_000
    tolerance_deg: Annotated[
        float, setting("a number from 0.0001 to 1, in deg", "0.01", ge=1e-4, le=1)
    ] = 0.01
    override: OverrideSetting = "full"


def inherited(settings: LinuxcncSettings) -> tuple[Inherited, ...]:
    """Return the states that another program may have left."""
    return (
        Inherited(
            state="units, plane, distance mode",
            lines=("G21 G17 G90",),
            why="words are mm or deg, and positions",
        ),
        Inherited(
            state="cutter and tool compensation, lathe mode",
            lines=("G40 G49 G8",),
            why="words are positions of joints",
        ),
        Inherited(
            state="offsets",
            lines=(" ".join(f"#{number}=0" for number in OFFSETS), "G59.3", "G92.1"),
            why="the ninth coordinate system is made that of the joints; the others stay",
        ),
        Inherited(
            state="speed",
            lines=(f"M50 P{int(settings.override == 'operator')}",),
            why="M50 P0 ignores the feed override, which would slow the cut",
        ),
        Inherited(
            state="feed mode",
            lines=("G93",),
            why="F is the inverse of the time of a move, per minute",
        ),
    )


def rules(settings: LinuxcncSettings) -> Rules:
    """Return the rules of programs: the digits of joints."""
    step = 0.5 * 10.0**-DECIMALS
    return Rules(slowest=1e-6, point_step=step * 1e-3, angle_step=float(np.radians(step)))


def in_words(robot: Robot, q: Array) -> Array:
    """Return joints (K, n) rad and m as the words have them, in deg and mm."""
    return np.hstack([np.degrees(arm_joints(robot, q)), to_controller_units(robot, q)])


# -----------------------------------------------------------------------------
# Times of joint moves: a trapezoid of speed from stop to stop.


def cruise_time(took: float, ramp: float) -> float:
    """Return the time (s) of a move at constant speed that takes `took` (s) from stop to stop.

    Parameters
    ----------
    took : float s
    ramp : float s^2
        Largest way of a joint by its acceleration: the square of half the least time.
    """
    return float(took + np.sqrt(max(took**2 - 4 * ramp, 0.0))) / 2


def time_from(cruise: float, ramp: float) -> float:
    """Return the inverse of `cruise_time`, s."""
    return cruise + ramp / cruise


def ramp_of(robot: Robot, way: Array) -> float:
    """Return the largest way of a joint (n,) by its acceleration, s^2."""
    _, acceleration = robot.speed_limits()
    return float((np.abs(way) / acceleration).max())


STANDS = np.radians(1e-6)
"""Way (rad or m) of all joints below which a move goes nowhere, as to where a contour begins."""


def goes_nowhere(way: Array) -> bool:
    """Return whether a way (n,) of the joints is none, but for digits."""
    return bool(np.abs(way).max() < STANDS)


def longest_way(robot: Robot) -> float:
    """Return how long (s) joints take over their whole ranges at full speed: the slowest one.

    The range of an endless joint is one turn.
    """
    limits, (velocity, _) = robot.joint_limits(), robot.speed_limits()
    ranges = np.where(robot.endless, 2 * np.pi, limits.upper - limits.lower)
    return float((ranges / velocity).max())


# -----------------------------------------------------------------------------
# The configuration of LinuxCNC: limits of the joints, and what they are connected to.

ENDLESS = 1e9
"""Limit (deg) of a joint that turns without end."""


def ini_lines(name: str, robot: Robot, first: Array) -> Iterator[str]:
    """Yield the INI file: the kinematics are trivial, so that axes are joints.

    Parameters
    ----------
    name : str
        Name of the program, and of the files.
    robot : Robot
    first : (n,) rad
        Joints at which the robot stands when it is homed: those of the first target.
    """
    words = WORDS[: robot.joints]
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    lower = np.where(robot.endless, -np.radians(ENDLESS), limits.lower)
    upper = np.where(robot.endless, np.radians(ENDLESS), limits.upper)
    low, high, fast, sharp, home = in_words(
        robot, np.array([lower, upper, velocity, acceleration, first])
    )
    most = [float(np.ceil(np.linalg.norm(each))) for each in (fast, sharp)]
    yield from (
        "[EMC]",
        "VERSION = 1.1",
        f"MACHINE = {name}",
        "[DISPLAY]",
        "DISPLAY = axis",
        "PROGRAM_PREFIX = .",
        "[RS274NGC]",
        "PARAMETER_FILE = linuxcnc.var",
        "[EMCMOT]",
        "EMCMOT = motmod",
        "COMM_TIMEOUT = 4.0",
        "SERVO_PERIOD = 1000000",
        "[TASK]",
        "TASK = milltask",
        "CYCLE_TIME = 0.001",
        "[HAL]",
        f"HALFILE = {name}.hal",
        "HALUI = halui",
        "[EMCIO]",
        "EMCIO = io",
        "CYCLE_TIME = 0.1",
        "TOOL_TABLE = tool.tbl",
        "[TRAJ]",
        f"COORDINATES = {words}",
        "LINEAR_UNITS = mm",
        "ANGULAR_UNITS = degree",
        f"MAX_LINEAR_VELOCITY = {most[0]:.0f}",
        f"MAX_LINEAR_ACCELERATION = {most[1]:.0f}",
        f"MAX_ANGULAR_VELOCITY = {most[0]:.0f}",
        f"MAX_ANGULAR_ACCELERATION = {most[1]:.0f}",
        "[KINS]",
        f"KINEMATICS = trivkins coordinates={words}",
        f"JOINTS = {robot.joints}",
    )
    for k, word in enumerate(words):
        bounds = (
            f"MIN_LIMIT = {low[k]:.6f}",
            f"MAX_LIMIT = {high[k]:.6f}",
            f"MAX_VELOCITY = {fast[k]:.6f}",
            f"MAX_ACCELERATION = {sharp[k]:.6f}",
        )
        yield from (f"[AXIS_{word}]", *bounds)
        yield from (
            f"[JOINT_{k}]",
            f"TYPE = {'ANGULAR' if word in 'ABC' else 'LINEAR'}",
            *bounds,
            f"HOME = {home[k]:.6f}",
            f"HOME_OFFSET = {home[k]:.6f}",
            "HOME_SEQUENCE = 0",
            "HOME_SEARCH_VEL = 0",
            "HOME_LATCH_VEL = 0",
            "FERROR = 10",
            "MIN_FERROR = 10",
        )


def hal_lines(robot: Robot, settings: LinuxcncSettings) -> Iterator[str]:
    """Yield the HAL file: simulated joints, outputs that are gated and read back.

    An output that the settings name is on only while a program runs.
    """
    named = {name: getattr(settings, f"{name}_output") for name in SIGNALS if name != "power"}
    named |= {p: port for (p, way), port in handshakes(settings).items() if way == "output"}
    gates = {port: name for name, port in named.items() if port is not None}
    power = settings.power_output
    analogue = (
        "setp power-gate.in0 0",
        f"net power-asked motion.analog-out-{power or 0:02d} => power-gate.in1",
        "net power power-gate.out",
    )
    yield from (
        "loadrt [KINS]KINEMATICS",
        "loadrt [EMCMOT]EMCMOT servo_period_nsec=[EMCMOT]SERVO_PERIOD "
        f"num_joints=[KINS]JOINTS num_dio={2 * PORTS} num_aio={ANALOGUE}",
        f"loadrt and2 names={','.join(f'{name}-gate' for name in gates.values())}",
        *(["loadrt mux2 names=power-gate"] if power is not None else []),
        "addf motion-command-handler servo-thread",
        "addf motion-controller servo-thread",
        *(f"addf {name}-gate servo-thread" for name in gates.values()),
        *(["addf power-gate servo-thread"] if power is not None else []),
    )
    for k in range(robot.joints):
        yield f"net joint-{k} joint.{k}.motor-pos-cmd => joint.{k}.motor-pos-fb"
    for port in range(PORTS):
        back = f"motion.digital-in-{PORTS + port:02d}"
        gate = f" {gates[port]}-gate.in0" if port in gates else ""
        yield f"net output-{port} motion.digital-out-{port:02d} => {back}{gate}"
    yield from (
        "net running halui.program.is-running => "
        + " ".join(f"{name}-gate.in1" for name in gates.values())
        + (" power-gate.sel" if power is not None else ""),
        *(f"net {name} {name}-gate.out" for name in gates.values()),
        *(analogue if power is not None else ()),
        "net enable iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in",
        "net tool-prepare iocontrol.0.tool-prepare => iocontrol.0.tool-prepared",
        "net tool-change iocontrol.0.tool-change => iocontrol.0.tool-changed",
    )
