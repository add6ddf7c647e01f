"""A program as read back from its text, in SI units: positions, speeds, events, flow of control."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol, get_args

import numpy as np

from kerfpath.arrays import Array, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.post.program import Handshake, Partner, Signal, Switch
from kerfpath.robots import ExternalAxis, Robot

MoveKind = Literal["joint", "linear", "circular"]
MOVE_KINDS: dict[str, MoveKind] = {word: word for word in get_args(MoveKind)}
"""Every kind of move by its name, for readers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _InFile:
    """Something on a line of a file."""

    file: str
    line: int

    __repr__ = short_repr

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.file}, line {self.line}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadMove(_InFile):
    """One move as read from its text.

    Parameters
    ----------
    kind : {"joint", "linear", "circular"}
    file, line
        Place of the move in the text.
    speed : float or None
        Speed of the tip, m/s; for a joint move the share of the full speed; None if not given.
    duration : float s or None
        Time of the move, if the text gives times.
    cruise : float s or None
        Time of a joint move at constant speed, without acceleration, if the text gives it.
    zone : float m or None
        Radius of the zone, 0 at a stop; None if the language has no length for it.
    q : (n,) rad or None
        Joints of the target in the robot's model, if the text gives them; m for linear axes.
    T_part_tip : (4, 4) m or None
        Tip pose in the part frame, if the text gives it.
    T_part_via : (4, 4) m or None
        Tip pose at the point on the way of a circular move.
    external : (E,) m, rad or None
        Values of the external axes at a target that is given by a pose; with joints, they are the
        last of q.
    posture : tuple
        Words of the text for posture and turns, as from `Language.posture`; empty without any.
    switches : tuple of Switch
    elsewhere : mapping of str to str
        File and line of what is not on the line of the move: "target", "speed", "zone",
        "switches".
    """

    kind: MoveKind
    speed: float | None
    duration: float | None = None
    cruise: float | None = None
    zone: float | None = 0.0
    q: Array | None = None
    T_part_tip: Array | None = None
    T_part_via: Array | None = None
    external: Array | None = None
    posture: tuple[int | str, ...] = ()
    switches: tuple[Switch, ...] = ()
    elsewhere: Mapping[str, str] = field(default_factory=dict)

    __repr__ = short_repr

    def external_of(self, axes: Sequence[ExternalAxis]) -> Array | None:
        """Return the values (E,) m and rad of the robot's external axes, or None if not given.

        If the move has joints, the values are the last of them.
        """
        if self.q is not None:
            return self.q[len(self.q) - len(axes) :]
        return self.external


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadWait(_InFile):
    """A wait of `time` (s) while the robot is stopped."""

    time: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadHandshake(_InFile):
    """A handshake with a partner while the robot is stopped.

    Parameters
    ----------
    what : Request or Await
    otherwise : str
        Where the program goes on without an answer: a label of the routine or an error exit of the
        program. Empty: it goes on with the next step.
    """

    what: Handshake
    otherwise: str = ""

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadPower(_InFile):
    """The power is set to a share of the full power while the robot is stopped.

    With `per_speed` (s/m), the controller sets that share for each m/s from the next move on, by
    `lead_time` (s) ahead of the speed.
    """

    share: float
    per_speed: float = 0.0
    lead_time: float = 0.0

    __repr__ = short_repr


ReadStep = ReadMove | ReadWait | ReadPower | ReadHandshake


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadLabel(_InFile):
    """A place in a routine to which jumps go, by its name."""

    name: str

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadJump(_InFile):
    """A jump to a label of the routine: always, or only while the input of `partner` is on."""

    label: str
    partner: Partner | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOff(_InFile):
    """Switch an output off, whatever it is: that of a signal or of the request to a partner."""

    output: Signal | Partner

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadPause(_InFile):
    """The program stops until the operator continues it."""

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadEnd(_InFile):
    """The end of the whole program, or only of the routine."""

    of_program: bool

    __repr__ = short_repr


FlowStep = ReadStep | ReadLabel | ReadJump | ReadOff | ReadPause | ReadEnd


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadSection:
    """One routine of the program.

    Parameters
    ----------
    name : str
    steps : tuple of ReadStep
        What it does if every partner answers at once.
    flow : tuple of FlowStep
        All its steps in the order of the text, with those of its flow of control, see
        `kerfpath.post.flow`; empty if the language has none.
    """

    name: str
    steps: tuple[ReadStep, ...]
    flow: tuple[FlowStep, ...] = ()

    __repr__ = short_repr

    @property
    def moves(self) -> tuple[ReadMove, ...]:
        """Its moves in order."""
        return tuple(step for step in self.steps if isinstance(step, ReadMove))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReadProgram:
    """A program as read from its text.

    Parameters
    ----------
    name : str
    sections : tuple of ReadSection
        In the order in which they run.
    T_flange_tip, T_base_part : (4, 4) m or None
        Tool and work object; None if the text only gives their numbers.
    externals : tuple of ExternalAxis
        External axes of the robot that it was read for.
    exits : mapping of str to tuple of FlowStep
        What is done at each error exit, to which a wait without an answer leads from any routine.
    marked : tuple of str
        Files with a byte order mark, which files of the language do not have.
    """

    name: str
    sections: tuple[ReadSection, ...]
    T_flange_tip: Array | None = None
    T_base_part: Array | None = None
    externals: tuple[ExternalAxis, ...] = ()
    exits: Mapping[str, tuple[FlowStep, ...]] = field(default_factory=dict)
    marked: tuple[str, ...] = ()

    __repr__ = short_repr

    @property
    def steps(self) -> tuple[ReadStep, ...]:
        """All steps in order, over all sections."""
        return tuple(step for section in self.sections for step in section.steps)

    @property
    def moves(self) -> tuple[ReadMove, ...]:
        """All moves in order, over all sections."""
        return tuple(move for section in self.sections for move in section.moves)


def with_tips(
    read: ReadProgram, robot: Robot, T_flange_tip: Array, T_base_part: Array
) -> ReadProgram:
    """Return the program with the tip poses of its path also where it gives joints alone.

    Parameters
    ----------
    read : ReadProgram
    robot : Robot
    T_flange_tip, T_base_part : (4, 4) m
        Tool and work object, if the program does not give them.

    Raises
    ------
    InputError
        A target has neither a pose nor joints.
    """
    tool = T_flange_tip if read.T_flange_tip is None else read.T_flange_tip
    part = T_base_part if read.T_base_part is None else read.T_base_part

    def filled(step: ReadStep) -> ReadStep:
        if not isinstance(step, ReadMove) or step.kind == "joint" or step.T_part_tip is not None:
            return step
        if step.q is None:
            raise InputError(f"{step.place}: the target has neither a pose nor joints")
        T = np.linalg.solve(part, robot.forward(step.q) @ tool)
        return replace(step, T_part_tip=freeze(np.asarray(T, dtype=np.float64)))

    sections = [
        replace(section, steps=tuple(filled(step) for step in section.steps))
        for section in read.sections
    ]
    return replace(read, sections=tuple(sections))


class Reader(Protocol):
    """Reader of what the formatter of the same language writes, and nothing else."""

    def __call__(
        self, main: str, files: Mapping[str, str], robot: Robot, settings: Any
    ) -> ReadProgram:
        """Return the program that starts with the file `main`.

        Parameters
        ----------
        main : str
            A name in `files`.
        files : mapping of str to str
            Text of each file by its name; files other than `main` are read when it calls them.
        robot : Robot
            Robot to whose joints the controller's axes are converted.
        settings : Settings
            Settings of the language.

        Raises
        ------
        InputError
            A line cannot come from the formatter or does not fit the others; with file and line.
        """
