"""G code of LinuxCNC with joints as words: this module only formats.

Every move of G code is even in its words, so that all joints move evenly from target to target. F
is the inverse of the time of a move (G93). A move that ends with a stop has G61.1, others G64.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array
from kerfpath.post.arcs import air_times
from kerfpath.post.build import setup_remarks
from kerfpath.post.languages import (
    Formatter,
    number,
    outputs,
    plain,
    require_one_file,
    reset_lines,
)
from kerfpath.post.linuxcnc.controller import (
    DECIMALS,
    PORTS,
    WORDS,
    LinuxcncSettings,
    cruise_time,
    goes_nowhere,
    hal_lines,
    in_words,
    inherited,
    ini_lines,
    longest_way,
    ramp_of,
)
from kerfpath.post.program import (
    Await,
    Comment,
    JointMove,
    LinearMove,
    Move,
    Request,
    Section,
    SetPower,
    Switch,
    Wait,
    switches_of,
)

STOP = "G61.1"
"""The move ends with a stop."""
MINUTE = 60.0
"""s; F is per minute."""
AWAIT, GUARD = "await_input", "laser_with"
"""Names of the routines that wait for an input, and that switch the laser on."""
MOST_NEEDS = 4
"""Largest number of outputs that the laser needs."""


def blend_line(settings: LinuxcncSettings) -> str:
    """Return the line after which moves end with a rounded corner, of a stated tolerance."""
    return f"G64 P{settings.tolerance_deg:g} Q0"


def off_lines(settings: LinuxcncSettings) -> list[str]:
    """Return the lines that switch everything off that the settings name."""
    power = [] if settings.power_output is None else [f"M68 E{settings.power_output} Q0"]
    return [*(f"M65 P{output}" for output in outputs(settings)), *power]


def wait_lines(settings: LinuxcncSettings) -> list[str]:
    """Return the lines of the routine that waits for an input.

    Without an answer everything is switched off and the program ends.
    """
    return [
        f"o<{AWAIT}> sub",
        "M66 P#1 L3 Q#2",
        "o<late> if [#5399 LT 0]",
        *(f"  {line}" for line in off_lines(settings)),
        "  (MSG,no answer at an input)",
        "  M2",
        "o<late> endif",
        f"o<{AWAIT}> endsub",
    ]


def guard_lines(laser: int) -> list[str]:
    """Return the lines of the routine that switches the laser on, if four inputs are on."""
    each = (f"M66 P#{k} L0\n#5 = [#5 * #5399]".split("\n") for k in range(1, MOST_NEEDS + 1))
    return [
        f"o<{GUARD}> sub",
        "#5 = 1",
        *(line for lines in each for line in lines),
        "o<on> if [#5 EQ 1]",
        f"  M64 P{laser}",
        "o<on> endif",
        f"o<{GUARD}> endsub",
    ]


class Linuxcnc(Formatter):
    """Formatter of the program, and of the INI and HAL of its joints."""

    settings: LinuxcncSettings

    def files(self) -> dict[str, str]:
        """Return the program, the INI and the HAL."""
        program, robot, most = self.program, self.program.robot, self.settings.lines_per_file
        name = program.name
        about = f"# Written by kerfpath for {plain(robot.model)} ({plain(robot.id)})."
        first = program.moves[0].q
        texts = {
            f"{name}.ngc": [*self._program()],
            f"{name}.ini": [about, *ini_lines(name, robot, first)],
            f"{name}.hal": [
                about,
                "# Simulated joints: connect your drives in place of motor-pos-fb.",
                *hal_lines(robot, self.settings),
            ],
        }
        return {
            file: text
            for one, lines in texts.items()
            for file, text in require_one_file(one, lines, most).items()
        }

    def _program(self) -> Iterator[str]:
        program, robot = self.program, self.program.robot
        axes = ", ".join(
            f"{word} {plain(axis)}" for word, axis in zip(WORDS, robot.joint_names, strict=False)
        )
        yield from (f"; {remark}" for remark in self.head(f"Words: {axes}."))
        yield from (f"; {plain(remark)}" for remark in setup_remarks(robot))
        yield "; The HAL switches outputs off while no program runs; the safety circuit of the cell"
        yield "; has to switch the laser off, too."
        yield from reset_lines(inherited(self.settings))
        yield from off_lines(self.settings)
        if any(isinstance(step, Await) for step in program.steps):
            yield from wait_lines(self.settings)
        if any(switch.needs for move in program.moves for switch in switches_of(move)):
            yield from guard_lines(self.output("laser"))
        for section in program.sections:
            yield f"o<{section.name}> sub"
            yield from (f"  {line}" for line in self.lines(section))
            yield f"o<{section.name}> endsub"
        yield from (f"o<{section.name}> call" for section in program.sections)
        yield "M2"

    def names(self) -> list[tuple[str, str]]:
        """Return every name in the program, with what it names."""
        return [
            (self.program.name, "the program"),
            (AWAIT, "the handshakes"),
            (GUARD, "the switching"),
            *((section.name, "a contour") for section in self.program.sections),
        ]

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of all steps of a section."""
        self.mode = ""
        steps = [step for step in section.steps if not isinstance(step, Comment)]
        # M62 acts as the next move begins: there must be one.
        self.moving = {
            step
            for step, after in pairwise(steps)
            if isinstance(step, LinearMove)
            and isinstance(after, LinearMove | JointMove)
            and self._words[step] != self._words[after]
        }
        yield from super().lines(section)

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a joint move; G53 marks it."""
        yield from self._path_mode(move)
        yield f"G53 G1 {self._words[move]} F{number(MINUTE / self._cruise(move), 9)}"

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a move of the path, and what is switched at its end."""
        yield from self._path_mode(move)
        yield f"G1 {self._words[move]} F{number(MINUTE / move.duration, 9)}"
        for switch in move.switches:
            yield self._switch(switch, now=move not in self.moving)

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a dwell."""
        yield f"G4 P{number(wait.time, 4)}"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield an analogue output; the robot is stopped."""
        yield f"M68 {self._power(power.share)}"

    def _power(self, share: float | None) -> str:
        return f"E{self.output('power')} Q{self.power_value(share)}"

    def request(self, request: Request) -> Iterator[str]:
        """Yield an output; the robot is stopped."""
        yield f"M{64 if request.on else 65} P{self.port(request.partner, 'output')}"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield the call that waits for an input."""
        port = self.port(awaited.partner, "input")
        yield f"o<{AWAIT}> call [{port}] [{number(awaited.timeout, 3)}]"

    def comment(self, text: str) -> Iterator[str]:
        """Yield a remark."""
        yield f"; {text}"

    def _switch(self, switch: Switch, *, now: bool) -> str:
        """Return the line of a switch: at once, or as the next move begins."""
        if needed := [PORTS + port for port in self.needed(switch)]:
            ports = [*needed, *needed[-1:] * MOST_NEEDS][:MOST_NEEDS]
            return f"o<{GUARD}> call {' '.join(f'[{port}]' for port in ports)}"
        if switch.signal == "power":
            return f"M{68 if now else 67} {self._power(switch.share)}"
        return f"M{(64 if now else 62) + (not switch.on)} P{self.output(switch.signal)}"

    def _path_mode(self, move: Move) -> Iterator[str]:
        """Yield the line of how the move ends, if the one before ended otherwise."""
        mode = STOP if move.zone == 0 else blend_line(self.settings)
        if mode != self.mode:
            yield mode
        self.mode = mode

    def _cruise(self, move: JointMove) -> float:
        """Return the time (s) of a joint move at constant speed."""
        way, took = self._air[move]
        if took is None or goes_nowhere(way):
            return longest_way(self.program.robot) / move.speed
        return cruise_time(took, ramp_of(self.program.robot, way))

    @cached_property
    def _words(self) -> dict[Move, str]:
        """Words of the target of each move."""
        moves, robot = list(dict.fromkeys(self.program.moves)), self.program.robot
        values = in_words(robot, np.array([move.q for move in moves])).round(DECIMALS) + 0.0
        text = " ".join(f"{word}%.{DECIMALS}f" for word in WORDS[: robot.joints])
        return {move: text % tuple(row) for move, row in zip(moves, values.tolist(), strict=True)}

    @cached_property
    def _air(self) -> dict[Move, tuple[Array, float | None]]:
        """Way (n,) rad and time (s) of each joint move."""
        moves = self.program.moves
        q = np.array([move.q for move in moves])
        ways, took = np.diff(q, axis=0, prepend=q[:1]), air_times(self.program)
        return dict(zip(moves, zip(ways, took, strict=True), strict=True))
