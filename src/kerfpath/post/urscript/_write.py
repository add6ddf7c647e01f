"""URScript, the language of Universal Robots' controllers: this module only formats.

Units of URScript: m, rad, s. A pose is a position and a rotation vector in the robot's base. The
part frame is written once, and targets are relative to it by ``pose_trans``. A pose contains
neither posture nor turns: the joint move before a contour fixes them, and ``movel`` keeps them.
``movel`` is used instead of ``movep``, because each move of a plan has its own speed, and ``movep``
does not let the program wait on the way. ``movec`` with mode 0 turns the tool evenly from start to
end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.post._axes import offset_near
from kerfpath.post._controller import Controller
from kerfpath.post._divide import require_one_file
from kerfpath.post._formatter import Formatter, number
from kerfpath.post._orientations import rotation_vectors
from kerfpath.post._program import (
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Request,
    Signal,
    Wait,
    targets_of,
)
from kerfpath.post._settings import OrientationSetting, PortSettings, Rules, outputs, setting
from kerfpath.post.urscript._switching import (
    LOCAL,
    distance_ahead,
    names,
    stop_lines,
    switch_lines,
    wait_lines,
)
from kerfpath.robots import Robot

__all__ = ["FIRST", "URScript", "URScriptSettings", "full_joint_speed", "rules"]

SPEED_STEP = 1e-6
"""Speeds (m/s) have six decimals."""
FIRST = "first_contour"
"""Number of the contour at which the program begins, for a restart."""
POINT_STEP, ANGLE_STEP = 0.5e-7, 0.5e-9
"""Rounding errors of seven decimals of m (m), and of nine decimals of rad (rad)."""

Output = Annotated[int | None, setting("a standard digital output from 0 to 7", "0", ge=0, le=7)]
Input = Annotated[int | None, setting("a standard digital input from 0 to 7", "0", ge=0, le=7)]


class URScriptSettings(PortSettings, output=Output, input=Input):
    """Inputs and outputs of the controller, and accelerations."""

    acceleration_mm_s2: Annotated[
        float, setting("a number from 1 to 50000, in mm/s^2", "1200", ge=1, le=50_000)
    ] = 1200.0
    joint_acceleration_deg_s2: Annotated[
        float, setting("a number from 1 to 5000, in deg/s^2", "80", ge=1, le=5000)
    ] = 80.0
    orientation: OrientationSetting = "slerp"

    @property
    def acceleration(self) -> float:
        """Acceleration of the tip, m/s^2."""
        return self.acceleration_mm_s2 * 1e-3


def rules(settings: URScriptSettings) -> Rules:
    """Return the rules of programs in URScript."""
    return Rules(
        slowest=SPEED_STEP,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(orientation=settings.orientation),
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
        yield from (f"  {line}" for line in stop_lines(outputs(self.settings)))
        if any(isinstance(step, Await) for step in program.steps):
            yield from (f"  {line}" for line in wait_lines(outputs(self.settings)))
        for signal in self.signals:
            yield from (f"  {line}" for line in switch_lines(signal, self.output(signal)))
        for section in program.sections:
            yield f"  def {section.name}():"
            yield from (f"    {line}" for line in self.lines(section))
            yield "  end"
        for signal in self.signals:
            yield f"  {signal}_set(False)"
            yield f"  {signal}_run = run {signal}_thread()"
        for n, section in enumerate(program.sections, 1):
            yield from (f"  if {FIRST} <= {n}:", f"    {section.name}()", "  end")
        yield from (f"  kill {signal}_run" for signal in self.signals)
        yield "end"

    @property
    def signals(self) -> list[Signal]:
        """Signals that the program can switch."""
        found: list[Signal] = [] if self.settings.laser_output is None else ["laser"]
        return [*found, "gas"] if "gas" in self.program.signals else found

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
                yield f"{switch.signal}_ahead({target}, {number(near, 9)}, {switch.on})"
        yield line
        for switch in move.switches:
            yield f"{switch.signal}_set({switch.on})"

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
