"""INFORM, the language of Yaskawa controllers, as jobs (.JBI): this module only formats.

Units: mm, deg, mm/s, per cent of the joint speed, seconds. A job contains its positions, then its
instructions. The main job has no positions: it gives the frames to enter at the controller in
remarks, and calls the other jobs. Each of them is of one kind: joint positions in pulses, or a
relative job with positions in the user frame. Outputs are switched while the robot is stopped.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import count
from typing import Final

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.post.arcs import euler
from kerfpath.post.inform.controller import (
    ExternalPulses,
    InformSettings,
    axes_from_joints,
    inherited,
    manipulator_type,
)
from kerfpath.post.languages import ask_again_lines, handshakes, number, outputs, reset_lines
from kerfpath.post.places import CalledFormatter
from kerfpath.post.program import (
    Await,
    CircularMove,
    Handshake,
    JointMove,
    LinearMove,
    Move,
    Program,
    Request,
    Section,
    SetPower,
    Step,
    Wait,
    asked_in,
    still_asked,
    stop_to_switch,
)

ANGLES: Final = "xyz"
"""RX, RY, RZ turn about fixed x, y, z, one after the other."""
SUFFIX = ".JBI"
NEW_LINE = "\r\n"
REMARK = 30
"""Characters of a remark, which may have 32 with its mark."""
AROUND = 16
"""Lines of a job beside those of its steps."""
POSE = "%.3f,%.3f,%.3f,%.4f,%.4f,%.4f"
"""mm and deg."""
FRAME_WORDS = ("X", "Y", "Z", "RX", "RY", "RZ")


def head(name: str, counts: str) -> list[str]:
    """Return the first lines of a job with the `counts` of positions of each kind."""
    return ["/JOB", f"//NAME {name}", "//POS", f"///NPOS {counts}"]


def middle(
    kind: str, settings: InformSettings, external: ExternalPulses
) -> tuple[list[str], list[str]]:
    """Return the lines before and after the positions of a job: "pulse", "user" or "main"."""
    user, tool = f"///USER {settings.user_frame}", f"///TOOL {settings.tool_number}"
    before = {
        "main": [],
        "pulse": [tool, "///POSTYPE PULSE", "///PULSE"],
        "user": [user, tool, "///POSTYPE USER", "///RECTAN"],
    }[kind]
    relative = kind == "user"
    after = ["//INST", f"///DATE {settings.date}", f"///ATTR SC,RW{',RJ' if relative else ''}"]
    after += [f"////FRAME USER {settings.user_frame}"] if relative else []
    return before, [*after, *external.groups(), "NOP"]


def switch_off_lines(settings: InformSettings) -> list[str]:
    """Return the instructions that switch off everything that the settings name."""
    off = [f"DOUT OT#({output}) OFF" for output in outputs(settings)]
    if (power := settings.power_output) is not None:
        off += [f"ARATIOF AO#({power})", f"AOUT AO#({power}) 0.00"]
    return off


def wait_lines(
    label: int, awaited: Await, asked: Sequence[Handshake], settings: InformSettings
) -> list[str]:
    """Return the instructions that wait for an input, and what is done without an answer.

    Everything is switched off and the job pauses. When it is started again, what was `asked` for
    before is asked for again.
    """
    ports = handshakes(settings)
    number = ports[awaited.partner, "input"]
    return [
        f"*WAIT{label}",
        f"WAIT IN#({number})=ON T={awaited.timeout:.2f}",
        f"JUMP *GO{label} IF IN#({number})=ON",
        *switch_off_lines(settings),
        "PAUSE",
        *ask_again_lines(asked, ports, "DOUT OT#({}) ON", "WAIT IN#({})=ON"),
        f"JUMP *WAIT{label}",
        f"*GO{label}",
    ]


class Inform(CalledFormatter):
    """Formatter of a main job, and of jobs for the way to each contour and for its path."""

    settings: InformSettings
    too_long = "error"
    remark_width = REMARK
    angles = ANGLES
    frame_words = FRAME_WORDS
    frame_line = "'%s %s %s"

    def __init__(self, program: Program, settings: InformSettings) -> None:
        super().__init__(split_by_kind(stop_to_switch(program)), settings)
        self._targets: list[tuple[Array, Array | None]] = []
        self._labels = count(1)
        self._follows = False
        self._external = ExternalPulses(program.robot, settings)
        moves = self.program.moves
        self._before = dict(zip(moves[1:], moves, strict=False))

    def files(self) -> dict[str, str]:
        """Return the main job and those that it calls."""
        program, settings = self.program, self.settings
        main = list(self.main())
        if len(main) + AROUND > settings.lines_per_file:
            raise InputError(
                f"program {program.name!r}: its main job would have {len(main) + AROUND} lines, "
                f"but lines_per_file allows {settings.lines_per_file}; raise it"
            )
        texts = {f"{program.name}{SUFFIX}": self._job(program.name, "main", [], main)}
        texts |= {f"{s.name}{SUFFIX}": self._section(s) for s in program.sections}
        off = self.off_name
        texts[f"{off}{SUFFIX}"] = self._job(off, "main", [], switch_off_lines(settings))
        return texts

    def lengths(self) -> dict[str, int]:
        """Return how many lines each job of a contour has, by its name."""
        return {s.name: self._section(s).count(NEW_LINE) for s in self.program.sections}

    def _section(self, section: Section) -> str:
        lines = list(self.lines(section))
        kind = "pulse" if self._in_pulses(section) else "user"
        positions = self._pulses() if kind == "pulse" else self._poses()
        return self._job(section.name, kind, positions, lines)

    def main(self) -> Iterator[str]:
        """Yield the instructions of the main job."""
        program, settings = self.program, self.settings
        yield from self.heading(
            f"{self.off_name} switches off: run it after a stop.",
            "A stop does not switch the laser off: the cell's safety has to.",
            *self._external.remarks(),
            "Enter these frames (mm, deg). Robot frame: on S, as high as L.",
            frame=f"UFRAME {settings.user_frame}",
            tool=f"TOOL {settings.tool_number}",
        )
        yield from reset_lines(inherited(settings))
        yield f"CALL JOB:{self.off_name}"
        yield from (f"CALL JOB:{section.name}" for section in program.sections)

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the instructions of a section, its positions numbered from 0."""
        self._targets, self._labels, self._follows = [], count(1), False
        yield from reset_lines(inherited(self.settings))
        yield from super().lines(section)

    def asked_before(self, section: Section) -> Sequence[Handshake]:
        """Return the handshakes that hold where a job begins: jobs share those of a contour."""
        return self._asked[section.name]

    @cached_property
    def _asked(self) -> dict[str, list[Handshake]]:
        found: dict[str, list[Handshake]] = {}
        held: list[Handshake] = []
        for section in self.program.sections:
            found[section.name] = held
            held = still_asked([*held, *asked_in(section.steps)])
        return found

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a MOVJ."""
        T = None if self.settings.pulses_per_deg else self.program.tips([move])[0]
        share = f"VJ={number(move.speed * 100, 2)}"
        yield self._external.moved(f"MOVJ {self._position(move.q, T)} {share}{self._end(move)}")

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a MOVL and what is switched at its end."""
        target = self._position(move.q, move.T_part_tip)
        yield self._external.moved(f"MOVL {target} {_speed(move)}{self._end(move)}")
        yield from self._switched(move)

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield the three MOVC of an arc and what is switched at its end.

        A MOVL to its start, without a position level, separates it from an arc before it.
        """
        before = self._before.get(move)
        if before is None:
            raise InputError(f"program {self.program.name!r}: expected a move before an arc")
        start = self._position(before.q, self.program.tips([before])[0])
        if isinstance(before, CircularMove):
            yield f"MOVL {start} {_speed(move)}"
        yield f"MOVC {start} {_speed(move)}"
        yield f"MOVC {self._position(move.q_via, move.T_part_via)} {_speed(move)}"
        yield f"MOVC {self._position(move.q, move.T_part_tip)} {_speed(move)}{self._end(move)}"
        yield from self._switched(move)

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a TIMER."""
        yield f"TIMER T={number(wait.time, 2)}"

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield an AOUT; the robot is stopped.

        A power that follows the speed is set by the controller, from ARATION to ARATIOF.
        """
        port = f"AO#({self.output('power')})"
        if power.per_speed:
            full = float(self.settings.power_full or 0.0)
            speed = number(1e3 * full / self.power_per_speed(power), 1)
            yield f"ARATION {port} BV={number(full, 2)} V={speed} OFV=0.00"
            self._follows = True
            return
        if self._follows:
            yield f"ARATIOF {port}"
        self._follows = False
        yield f"AOUT {port} {self.power_value(power.share, 2)}"

    def request(self, request: Request) -> Iterator[str]:
        """Yield a DOUT; the robot is stopped."""
        state = "ON" if request.on else "OFF"
        yield f"DOUT OT#({self.port(request.partner, 'output')}) {state}"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield a WAIT with a time, and what is done without an answer."""
        yield from wait_lines(next(self._labels), awaited, self.asked, self.settings)

    def comment(self, text: str) -> Iterator[str]:
        """Yield remarks; remarks with frames have no space."""
        yield from (f"' {row}" for row in self.wrap(text))

    def _end(self, move: Move) -> str:
        return f" PL={0 if move.zone == 0 else self.settings.position_level}"

    def _switched(self, move: LinearMove) -> Iterator[str]:
        for switch in move.switches:
            yield f"DOUT OT#({self.output(switch.signal)}) {'ON' if switch.on else 'OFF'}"

    def _position(self, q: Array, T: Array | None) -> str:
        self._targets.append((q, T))
        return f"C{len(self._targets) - 1:05d}"

    def _in_pulses(self, section: Section) -> bool:
        joint = any(isinstance(move, JointMove) for move in section.moves)
        if self.program.robot.externals:
            return bool(section.moves)
        return joint and self.settings.pulses_per_deg is not None

    def _pulses(self) -> list[str]:
        """Return the lines of the positions so far, in pulses."""
        q = np.array([q for q, _ in self._targets])
        axes = axes_from_joints(self.program.robot, q)
        pulses = np.round(np.degrees(axes) * np.array(self.settings.pulses_per_deg))
        rows = pulses.astype(np.int64).tolist()
        arm = [f"C{k:05d}={','.join(map(str, row))}" for k, row in enumerate(rows)]
        return [*arm, *self._external.rows(q)]

    def _poses(self) -> list[str]:
        """Return the lines of the positions so far in the user frame, types where they change."""
        if not self._targets:
            return []
        types = manipulator_type(
            self.program.robot, [q for q, _ in self._targets], self.settings.flip
        ).tolist()
        poses = euler(np.array([T for _, T in self._targets]), ANGLES)
        poses = np.hstack([poses[:, :3].round(3), poses[:, 3:].round(4)]) + 0.0
        unused = [0] * (self.settings.rconf_values - 6)
        lines, said = [], None
        for k, (bits, pose) in enumerate(zip(types, poses.tolist(), strict=True)):
            if bits != said:
                lines.append(f"///RCONF {','.join(map(str, bits + unused))}")
                said = bits
            lines.append(f"C{k:05d}={POSE % tuple(pose)}")
        return lines

    def _job(self, name: str, kind: str, positions: Sequence[str], lines: Sequence[str]) -> str:
        before, after = middle(kind, self.settings, self._external)
        targets = sum(line.startswith("C") for line in positions)
        counts = self._external.counts(targets)
        rows = [*head(name, counts), *before, *positions, *after, *lines, "END", ""]
        return NEW_LINE.join(rows)


def split_by_kind(program: Program) -> Program:
    """Return the program with joint moves in sections of their own.

    Comments and waits stay with the move before them, or at the start with the move after them.
    """
    parts: list[Section] = []
    for section in program.sections:
        groups: list[tuple[bool, list[Step]]] = []
        for step in section.steps:
            joint = isinstance(step, JointMove)
            moves = joint or isinstance(step, LinearMove)
            first = len(groups) == 1 and not any(_moves(s) for s in groups[0][1])
            if groups and (not moves or first or groups[-1][0] == joint):
                groups[-1] = (joint if moves else groups[-1][0], [*groups[-1][1], step])
            else:
                groups.append((joint, [step]))
        parts += [
            Section(name=f"{section.name}{'_air' if joint else ''}", steps=tuple(steps))
            for joint, steps in groups
        ]
    return replace(program, sections=tuple(parts))


def _speed(move: LinearMove) -> str:
    return f"V={number(move.speed * 1e3, 1)}"


def _moves(step: Step) -> bool:
    return isinstance(step, JointMove | LinearMove)
