"""URScript, the language of Universal Robots' controllers: this module only formats.

Units of URScript: m, rad, s. A pose is a position and a rotation vector in the robot's base. The
part frame is written once, and targets are relative to it by ``pose_trans``. A pose contains
neither posture nor turns: the joint move before a contour fixes them, and ``movel`` keeps them.
``movel`` is used instead of ``movep``, because each move of a plan has its own speed, and ``movep``
does not let the program wait on the way. ``movec`` with mode 0 turns the tool evenly from start to
end.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import sqrt
from typing import Annotated

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.post.arcs import rotation_vectors
from kerfpath.post.build import offset_near
from kerfpath.post.languages import (
    Controller,
    Formatter,
    Inherited,
    OrientationSetting,
    PowerSettings,
    Rules,
    ShortestMove,
    number,
    outputs,
    require_one_file,
    reset_lines,
    setting,
)
from kerfpath.post.program import (
    SIGNALS,
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
    ProgramIssue,
    Request,
    SetPower,
    Signal,
    Switch,
    Wait,
    targets_of,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# How a program in URScript switches an output ahead of a target, and at what distance.
#
# No instruction of URScript switches an output along a path. An instruction after a move acts
# when the tip enters the blend at its end, or when it stops there. To switch earlier, a thread
# checks in every control cycle how far the tip is from the target, and switches once it is close
# enough; the instruction after the move repeats this, so that an output is never switched later.

LOCAL = ("due", "gap", "most", "near", "on", "port", "target", "value", "waited")
"""Names inside the thread and the functions of `switch_lines`; contours must not have them."""


OFF: dict[Signal, str] = {
    "laser": "False",
    "gas": "False",
    "gas_2": "False",
    "power": "0.0",
}
"""Value of each signal that is off."""


def distance_ahead(lead_time: float, speed: float, acceleration: float, *, stops: bool) -> float:
    """Return how far (m) from a target the tip is `lead_time` (s) before it arrives.

    Its speed (m/s) is constant; if it `stops`, it brakes with the acceleration (m/s^2).
    """
    braking = speed / acceleration if stops else 0.0
    if lead_time <= braking:
        return acceleration * lead_time**2 / 2
    return speed * (lead_time - braking / 2)


def time_ahead(distance: float, speed: float, acceleration: float, *, stops: bool) -> float:
    """Return the inverse of `distance_ahead`, s."""
    braking = speed / acceleration if stops else 0.0
    if distance <= speed * braking / 2:
        return sqrt(2 * distance / acceleration)
    return distance / speed + braking / 2


def names(signal: Signal) -> list[str]:
    """Return every name that the lines of `switch_lines` define."""
    parts = ("waits", "point", "distance", "value", "thread", "ahead", "set", "run")
    return [f"{signal}_{part}" for part in parts]


def stop_lines(settings: URScriptSettings) -> list[str]:
    """Return the lines by which the controller sets outputs low whenever no program runs.

    The analogue output of the power gives a voltage.
    """
    run = "set_runstate_standard"
    lines = [f"{run}_digital_output_to_value({output}, 1)" for output in outputs(settings)]
    if (power := settings.power_output) is not None:
        lines += [f"set_analog_outputdomain({power}, 1)"]
        lines += [f"{run}_analog_output_to_value({power}, 1)"]
    return lines


def wait_lines(settings: URScriptSettings) -> list[str]:
    """Return the lines that define the wait for an input.

    Without an answer everything is switched off and the program ends.
    """
    power = settings.power_output
    off = [] if power is None else [f"    set_standard_analog_out({power}, 0.0)"]
    return [
        "def await_input(port, most):",
        "  waited = 0.0",
        "  while (get_standard_digital_in(port) == False) and (waited < most):",
        "    sync()",
        "    waited = waited + get_steptime()",
        "  end",
        "  if get_standard_digital_in(port) == False:",
        *(f"    set_standard_digital_out({output}, False)" for output in outputs(settings)),
        *off,
        '    popup("no answer at an input", title="kerfpath", error=True)',
        "    halt",
        "  end",
        "end",
    ]


def switch_lines(signal: Signal, output: int) -> list[str]:
    """Return the lines that define how a signal is switched, by which output."""
    put = f"set_standard_{'analog' if signal == 'power' else 'digital'}_out({output}, "
    return [
        f"global {signal}_waits = False",
        f"global {signal}_point = p[0, 0, 0, 0, 0, 0]",
        f"global {signal}_distance = 0.0",
        f"global {signal}_value = {OFF[signal]}",
        f"thread {signal}_thread():",
        "  while True:",
        "    enter_critical",
        f"    gap = point_dist(get_actual_tcp_pose(), {signal}_point)",
        f"    value = {signal}_value",
        f"    due = {signal}_waits and (gap <= {signal}_distance)",
        "    if due:",
        f"      {signal}_waits = False",
        "    end",
        "    exit_critical",
        "    if due:",
        f"      {put}value)",
        "    end",
        "    sync()",
        "  end",
        "end",
        f"def {signal}_ahead(target, near, on):",
        "  enter_critical",
        f"  {signal}_point = pose_trans(part_frame, target)",
        f"  {signal}_distance = near",
        f"  {signal}_value = on",
        f"  {signal}_waits = True",
        "  exit_critical",
        "end",
        f"def {signal}_set(on):",
        f"  {signal}_waits = False",
        f"  {put}on)",
        "end",
    ]


# -----------------------------------------------------------------------------
# URScript, the language of Universal Robots' controllers: this module only formats.

SPEED_STEP = 1e-6
"""Speeds (m/s) have six decimals."""
SHORTEST_MS = 8.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
FIRST = "first_contour"
"""Number of the contour at which the program begins, for a restart."""
POINT_STEP, ANGLE_STEP = 0.5e-7, 0.5e-9
"""Rounding errors of seven decimals of m (m), and of nine decimals of rad (rad)."""

Output = Annotated[int | None, setting("a standard digital output from 0 to 7", "0", ge=0, le=7)]
Input = Annotated[int | None, setting("a standard digital input from 0 to 7", "0", ge=0, le=7)]


Analogue = Annotated[int | None, setting("a standard analogue output, 0 or 1", "0", ge=0, le=1)]
Full = Annotated[
    float | None,
    setting("the share of 10 V at full power, above 0, at most 1", "1.0", gt=0, le=1),
]


class URScriptSettings(PowerSettings, output=Output, input=Input, analogue=Analogue):
    """Inputs and outputs of the controller, and accelerations."""

    power_full: Full = None
    acceleration_mm_s2: Annotated[
        float, setting("a number from 1 to 50000, in mm/s^2", "1200", ge=1, le=50_000)
    ] = 1200.0
    joint_acceleration_deg_s2: Annotated[
        float, setting("a number from 1 to 5000, in deg/s^2", "80", ge=1, le=5000)
    ] = 80.0
    orientation: OrientationSetting = "slerp"
    shortest_move_ms: ShortestMove = None

    @property
    def acceleration(self) -> float:
        """Acceleration of the tip, m/s^2."""
        return self.acceleration_mm_s2 * 1e-3


def inherited(settings: URScriptSettings) -> tuple[Inherited, ...]:
    """Return the states that another program may have left."""
    return (
        Inherited(
            state="softness, contact",
            lines=("end_force_mode()", "end_freedrive_mode()"),
            why="the robot follows the path alone",
        ),
        Inherited(state="tool", why="`set_tcp` is checked"),
        Inherited(state="displacement", why="targets name the frame of the part"),
        Inherited(state="speed, acceleration, corners", why="each move names them"),
        Inherited(
            state="payload, gravity, speed slider",
            why="left to the caller: they are of the installation and the operator",
        ),
    )


def rules(settings: URScriptSettings) -> Rules:
    """Return the rules of programs in URScript."""
    return Rules(
        slowest=SPEED_STEP,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(orientation=settings.orientation).with_shortest(
            settings.shortest_move_ms, SHORTEST_MS
        ),
    )


def full_joint_speed(robot: Robot) -> float:
    """Return the full speed (rad/s) of the leading joint: that of the slowest joint.

    Raises
    ------
    InputError
        The joint speeds are not known.
    """
    if robot.velocity is None:
        raise InputError(f"robot {robot.id!r}: its joint velocities are not known; give velocity=")
    return float(robot.velocity.min())


class URScript(Formatter):
    """Formatter of one program: frames, switching, a function for each section, their calls."""

    settings: URScriptSettings

    def files(self) -> dict[str, str]:
        """Return the one file."""
        self.target = self._target_texts()
        lines = [*self._program()]
        return require_one_file(f"{self.program.name}.script", lines, self.settings.lines_per_file)

    def _program(self) -> Iterator[str]:
        program, robot = self.program, self.program.robot
        yield from (f"# {remark}" for remark in self.head())
        yield "# Payload and centre of gravity are those of the installation."
        yield "# The controller sets the outputs low while no program runs; the safety circuit of"
        yield "# the cell has to switch the laser off, too."
        yield f"# To begin at a contour, write its number for {FIRST}."
        yield f"def {program.name}():"
        # The controller's flange and base are those of Denavit and Hartenberg's model.
        tool = robot.T_end_flange @ program.T_flange_tip
        part = np.linalg.inv(robot.T_base_foot) @ program.T_base_part
        yield f"  set_tcp({_pose(tool)})"
        yield f"  global part_frame = {_pose(part)}"
        yield f"  global {FIRST} = 1"
        yield from (f"  {line}" for line in reset_lines(inherited(self.settings)))
        yield from (f"  {line}" for line in stop_lines(self.settings))
        if any(isinstance(step, Await) for step in program.steps):
            yield from (f"  {line}" for line in wait_lines(self.settings))
        for signal in self.signals:
            yield from (f"  {line}" for line in switch_lines(signal, self.output(signal)))
        for section in program.sections:
            yield f"  def {section.name}():"
            yield from (f"    {line}" for line in self.lines(section))
            yield "  end"
        for signal in self.signals:
            yield f"  {signal}_set({OFF[signal]})"
            yield f"  {signal}_run = run {signal}_thread()"
        for n, section in enumerate(program.sections, 1):
            yield from (f"  if {FIRST} <= {n}:", f"    {section.name}()", "  end")
        yield from (f"  kill {signal}_run" for signal in self.signals)
        yield "end"

    @property
    def signals(self) -> list[Signal]:
        """Signals that the program can switch."""
        found: list[Signal] = [] if self.settings.laser_output is None else ["laser"]
        return [*found, *(each for each in SIGNALS.values() if self._switches(each))]

    def _switches(self, signal: Signal) -> bool:
        return signal != "laser" and signal in self.program.signals

    def names(self) -> list[tuple[str, str]]:
        """Return every name in the program, with what it names."""
        return [
            (self.program.name, "the program"),
            ("part_frame", "the part's frame"),
            (FIRST, "the number of the first contour"),
            ("await_input", "the handshakes"),
            *((name, "the switching") for name in LOCAL),
            *((name, "the switching") for signal in self.signals for name in names(signal)),
            *((section.name, "a contour") for section in self.program.sections),
        ]

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a movej; its speed is that of the joint with the longest way."""
        robot = self.program.robot
        q = ", ".join(number(angle, 8) for angle in robot.sign * move.q - offset_near(robot, 0.0))
        a = number(np.radians(self.settings.joint_acceleration_deg_s2), 6)
        v = number(move.speed * full_joint_speed(robot), 6)
        timed = "" if move.duration is None else f"t={number(move.duration, 4)}, "
        yield f"movej([{q}], a={a}, v={v}, {timed}r={number(move.zone, 7)})"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a movel, and what is switched at its end."""
        yield from self._switched(move, f"movel({self._targets(move)}, {self._motion(move)})")

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a movec, and what is switched at its end."""
        targets, motion = self._targets(move), self._motion(move)
        yield from self._switched(move, f"movec({targets}, {motion}, mode=0)")

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a sleep."""
        yield f"sleep({number(wait.time, 3)})"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield the call that sets the power; the robot is stopped."""
        yield f"power_set({self.power_value(power.share, 5)})"

    def request(self, request: Request) -> Iterator[str]:
        """Yield an output; the robot is stopped."""
        yield f"set_standard_digital_out({self.port(request.partner, 'output')}, {request.on})"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield a wait for an input; without an answer the program ends with all off."""
        port = self.port(awaited.partner, "input")
        yield f"await_input({port}, {number(awaited.timeout, 3)})"

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment."""
        yield f"# {text}"

    def _switched(self, move: LinearMove, line: str) -> Iterator[str]:
        """Yield the switches ahead of the end of a move, the move, and the switches at its end."""
        for switch in move.switches:
            stops, acceleration = move.zone == 0, self.settings.acceleration
            near = distance_ahead(switch.lead_time, move.speed, acceleration, stops=stops)
            if near > 0:
                target = self.target[move][-1]
                value = self._value(switch)
                yield f"{switch.signal}_ahead({target}, {number(near, 9)}, {value})"
        yield line
        for switch in move.switches:
            needed = (f"get_standard_digital_out({port})" for port in self.needed(switch))
            yield f"{switch.signal}_set({' and '.join(needed) or self._value(switch)})"

    def _value(self, switch: Switch) -> str:
        return f"{switch.on}" if switch.share is None else self.power_value(switch.share, 5)

    def _targets(self, move: LinearMove) -> str:
        return ", ".join(f"pose_trans(part_frame, {target})" for target in self.target[move])

    def _motion(self, move: LinearMove) -> str:
        a, v = number(self.settings.acceleration, 6), number(move.speed, 6)
        return f"a={a}, v={v}, r={number(move.zone, 7)}"

    def _target_texts(self) -> dict[Move, list[str]]:
        """Return the poses of each move in the part frame, those on the way first."""
        moves = dict.fromkeys(self.program.moves)
        points = targets_of(move for move in moves if isinstance(move, LinearMove))
        T = np.array([T for _, _, T in points]).reshape(-1, 4, 4)
        texts: dict[Move, list[str]] = {move: [] for move, _, _ in points}
        for (move, _, _), point, turn in zip(points, T[:, :3, 3], rotation_vectors(T), strict=True):
            texts[move].append(_pose_text(point, turn, 7))
        return texts


def _pose(T: Array) -> str:
    return _pose_text(T[:3, 3], rotation_vectors(T[None])[0], 9)


def _pose_text(point: Array, turn: Array, decimals: int) -> str:
    xyz = ", ".join(number(value, decimals) for value in point)
    return f"p[{xyz}, {', '.join(number(value, 9) for value in turn)}]"


# -----------------------------------------------------------------------------
# Issues that only URScript has: blends that meet, and reserved names.

BLEND_ROOM = 1e-6
"""Smallest distance (m) between two blends, for the digits of targets."""
FULL_TURN = 2 * np.pi

KEYWORDS = re.compile(
    "and|break|continue|def|elif|else|end|enter_critical|exit_critical|false|global|goto|halt|if|"
    "in|join|kill|local|not|or|return|run|sec|sync|thread|true|while|xor"
)
"""Keywords, and statements of one word."""
BUILT_IN = re.compile(
    r"(get|set|is|read|write|str|modbus|rpc|rtde|socket|encoder|path_offset|force_mode|"
    r"freedrive_mode|end_\w+_mode|tool_contact|twist|wrench|screw_driving|jog)_\w+|"
    r"(pose|point)_(add|dist|inv|sub|trans)|(move|servo|speed|stop)[cjlp]|"
    r"(enable|disable|reset|request|unlock|start|stop|zero|conveyor|collision|teach)_\w+|"
    r"a?cos|a?sin|a?tan|atan2|binary_list_to_integer|ceil|d2r|eoat_\w+|floor|force|force_mode|"
    r"freedrive_mode|integer_to_binary_list|interpolate_pose|inv|length|log|norm|p|popup|pow|"
    r"powerdown|r2d|random|rotvec2rpy|rpc_factory|rpy2rotvec|size|sleep|sqrt|textmsg|time|"
    r"to_num|to_str|transpose|tcp"
)
"""Names of the controller's own functions, including likely ones of later versions."""


def is_reserved(name: str) -> bool:
    """Return whether URScript or the controller gives `name` another meaning."""
    return any(words.fullmatch(name.lower()) for words in (KEYWORDS, BUILT_IN))


def check(program: Program, settings: URScriptSettings) -> Iterator[ProgramIssue]:
    """Yield issues only of URScript: unknown joint speeds, blends that meet, a signal twice."""
    try:
        full_joint_speed(program.robot)
    except InputError as error:
        yield ProgramIssue("error", "joint-speed", str(error), "program")
    yield from _check_blends(program)
    beyond = max((float(np.abs(move.q).max()) for move in program.moves), default=0.0)
    if beyond > FULL_TURN:
        yield ProgramIssue(
            "warning",
            "turns",
            f"a joint turns to {np.degrees(beyond):.0f} deg; the controller must allow it to turn "
            "beyond 360 deg",
            "program",
        )
    for section in program.sections:
        for k, move in enumerate(section.moves):
            signals = [s.signal for s in getattr(move, "switches", ())]
            if len(signals) > len(set(signals)):
                message = "a signal is switched twice at the end of one move, expected once"
                yield ProgramIssue("error", "switches", message, f"{section.name}, move {k}")


def _check_blends(program: Program) -> Iterator[ProgramIssue]:
    """Check that blends do not meet: the controller skips a move whose blend meets another."""
    moves = program.moves
    if not moves:
        return
    points = program.tips(moves)[:, :3, 3]
    zone = np.array([move.zone for move in moves])
    room = np.linalg.norm(np.diff(points, axis=0), axis=1) - zone[:-1] - zone[1:]
    blended = (zone[:-1] > 0) | (zone[1:] > 0)
    met = np.flatnonzero(blended & (room < BLEND_ROOM))
    if met.size:
        k = int(met[0])
        kind = "a linear" if isinstance(moves[k + 1], LinearMove) else "a joint"
        yield ProgramIssue(
            "error",
            "blend-overlap",
            f"{met.size} moves are no longer than the blends at their ends, the first {kind} move "
            f"of {np.linalg.norm(points[k + 1] - points[k]) * 1e3:.3f} mm between blends of "
            f"{zone[k] * 1e3:g} and {zone[k + 1] * 1e3:g} mm; the controller would skip moves; "
            "lower zone_mm or use fewer nodes",
            "program",
        )
