"""The neutral program: the steps of the robot in order, before a language formats them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from kerfpath.arrays import Array, as_pose, floats, short_repr
from kerfpath.auditor import Level
from kerfpath.errors import InputError
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# An issue that the checks find in a program.


@dataclass(frozen=True, slots=True)
class ProgramIssue:
    """An error in a program, or a warning to its user.

    Parameters
    ----------
    level : {"error", "warning"}
        An error forbids writing the program.
    code : str
        Kind of the issue.
    message : str
        What was expected, what came, and what to do.
    place : str
        Place in the program.
    """

    level: Level
    code: str
    message: str
    place: str

    __repr__ = short_repr

    def __str__(self) -> str:
        return f"{self.place}: {self.message}"


# -----------------------------------------------------------------------------
# The neutral program: the steps of the robot in order, before a language formats them.

Signal = Literal["laser", "gas", "gas_2", "power"]
Gas = Literal["gas", "gas_2"]
GASES: tuple[Gas, ...] = get_args(Gas)
"""The signals of gases: a program has one of them in each contour."""
SIGNALS: dict[str, Signal] = {word: word for word in get_args(Signal)}
"""Every signal by its name, for readers."""
Partner = Literal["ready", "shutter", "gas_pressure", "height", "interlock"]
PARTNERS: dict[str, Partner] = {word: word for word in get_args(Partner)}
"""Every partner of a handshake by its name: source, shutter, gas, height control, cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """Set or reset an output on the path, at the end of the move that it belongs to.

    Parameters
    ----------
    signal : {"laser", "gas", "gas_2", "power"}
        What is switched; the settings of a language name its output. That of the power is analogue.
    on : bool
    lead_time : float s
        Time before the tip arrives there; it compensates for the delay of output and source.
    needs : tuple of {"gas", "gas_2", "ready", "shutter", "height"}
        Outputs, of the gas or of requests to partners, without which it stays off. After a stop
        they may be off. Only where the robot stops, without a lead time.
    share : float or None
        Of the power alone: its share of the full power from there on.
    """

    signal: Signal
    on: bool
    lead_time: float = 0.0
    needs: tuple[Signal | Partner, ...] = ()
    share: float | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointMove:
    """Move all joints at once to a joint vector; the tip does not move in a straight line.

    Parameters
    ----------
    q : (n,) rad
        Joints of the target.
    speed : float
        Share of the full speed, from 0.01 to 1; the acceleration is the full one.
    duration : float s or None
        Planned time of the move, from stop to stop; None if its start is not known.
    zone : float m
        Radius within which the corner may be rounded; 0 = stop at the target.
    """

    q: Array
    speed: float
    duration: float | None = None
    zone: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", floats(self.q, "q", (None,)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearMove:
    """Move the tool tip in a straight line; the tool turns evenly, the posture stays.

    Parameters
    ----------
    T_part_tip : (4, 4)
        Tip pose in the part frame, m.
    q : (n,) rad
        Joints of the robot on arrival; endless joints are not wrapped along the contour.
    speed : float m/s
        Speed of the tip.
    duration : float s
        Planned time of the move.
    zone : float m
        Radius within which the corner may be rounded; 0 = stop at the target.
    switches : tuple of Switch
        Switches at the end of the move.
    """

    T_part_tip: Array
    q: Array
    speed: float
    duration: float
    zone: float = 0.0
    switches: tuple[Switch, ...] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_part_tip", as_pose(self.T_part_tip, "T_part_tip"))
        object.__setattr__(self, "q", floats(self.q, "q", (None,)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CircularMove(LinearMove):
    """Move the tool tip along the arc through a point on the way; the tool turns evenly.

    Parameters
    ----------
    T_part_via : (4, 4)
        Tip pose at the point on the way, in the part frame, m.
    q_via : (n,) rad
        Joints of the robot there.
    """

    T_part_via: Array
    q_via: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        super(CircularMove, self).__post_init__()
        object.__setattr__(self, "T_part_via", as_pose(self.T_part_via, "T_part_via"))
        object.__setattr__(self, "q_via", floats(self.q_via, "q_via", (None,)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """Wait where the last move stopped, for example while the beam pierces.

    Parameters
    ----------
    time : float s
    """

    time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPower:
    """Set the power where the robot stands.

    Parameters
    ----------
    share : float
        Share of the full power, from 0 to 1.
    per_speed : float s/m
        Share of the full power for each m/s of the tip, by which the controller itself sets it from
        the next move on; `share` is 0 then. 0: the power stays.
    lead_time : float s
        How far ahead of the speed the controller sets it then.
    """

    share: float
    per_speed: float = 0.0
    lead_time: float = 0.0

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Set or reset the output that asks a partner for something; the robot is stopped.

    Parameters
    ----------
    partner : Partner
        Partner that is asked; the settings of a language name its output, as `shutter_output`.
    on : bool
    """

    partner: Partner
    on: bool

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Await:
    """Wait, stopped and with the beam off, until an input is on; else end the program safely.

    Parameters
    ----------
    partner : Partner
        Partner that answers; the settings of a language name its input, as `shutter_input`.
    timeout : float s
        Time after which the program switches everything off and ends.
    """

    partner: Partner
    timeout: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True)
class Comment:
    """A remark for the person who reads the program."""

    text: str

    __repr__ = short_repr


class Target(NamedTuple):
    """A target or point on the way: joints (n,) rad and, for a path move, tip pose (4, 4) m."""

    move: Move
    q: Array
    T_part_tip: Array | None


def targets_of(moves: Iterable[Move]) -> list[Target]:
    """Return the targets of moves in order, each after the point on the way to it."""
    found: list[Target] = []
    for move in moves:
        if isinstance(move, CircularMove):
            found.append(Target(move, move.q_via, move.T_part_via))
        found.append(Target(move, move.q, getattr(move, "T_part_tip", None)))
    return found


def switches_of(step: Step) -> tuple[Switch, ...]:
    """Return the switches at the end of a step; only moves of the path have any."""
    return step.switches if isinstance(step, LinearMove) else ()


def still_asked(handshakes: Iterable[Handshake | None]) -> list[Handshake]:
    """Return the requests and waits that hold after `handshakes`; None stands for a joint move.

    A request that is taken back ends the answers, too: partners give them for all requests. So does
    a joint move: it leads to another contour.
    """
    held: list[Handshake] = []
    for step in handshakes:
        if step is None:
            held = [s for s in held if isinstance(s, Request)]
        elif isinstance(step, Await) or step.on:
            held.append(step)
        else:
            held = [s for s in held if isinstance(s, Request) and s.partner != step.partner]
    return held


def asked_in(steps: Iterable[Step]) -> Iterator[Handshake | None]:
    """Yield the handshakes among steps, and None for each joint move, as for `still_asked`."""
    for step in steps:
        if isinstance(step, Request | Await):
            yield step
        elif isinstance(step, JointMove):
            yield None


PathMove = LinearMove | CircularMove
Move = JointMove | LinearMove | CircularMove
Handshake = Request | Await
Step = Move | Wait | SetPower | Handshake | Comment


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The steps of one contour, or of a part of one, with an identifier and the contour's name."""

    name: str
    steps: tuple[Step, ...]
    contour: str = ""

    __repr__ = short_repr

    @property
    def moves(self) -> tuple[Move, ...]:
        """Its moves in order."""
        return tuple(step for step in self.steps if isinstance(step, JointMove | LinearMove))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Program:
    """The steps of one robot with one tool on one part, contour by contour.

    Parameters
    ----------
    name : str
        Identifier of the program.
    robot : Robot
    T_flange_tip, T_base_part : (4, 4)
        Tool and placement of the part (the work object), m.
    sections : tuple of Section
        One for each contour, in order.
    air_checked : bool
        Whether the transfer moves have been proved clear.
    caveats : tuple of str
        Sentences on what the plans do not prove, for the comment at the head.
    """

    name: str
    robot: Robot
    T_flange_tip: Array
    T_base_part: Array
    sections: tuple[Section, ...]
    air_checked: bool = False
    caveats: tuple[str, ...] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_flange_tip", as_pose(self.T_flange_tip, "T_flange_tip"))
        object.__setattr__(self, "T_base_part", as_pose(self.T_base_part, "T_base_part"))
        for move in self.moves:
            if len(move.q) != self.robot.joints:
                raise InputError(
                    f"program {self.name!r}: expected {self.robot.joints} joints at each target, "
                    f"got {len(move.q)}"
                )

    @property
    def steps(self) -> tuple[Step, ...]:
        """All steps in order, over all sections."""
        return tuple(step for section in self.sections for step in section.steps)

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Signals that are switched or set anywhere in the program."""
        found = {switch.signal for move in self.moves for switch in switches_of(move)}
        found |= {SIGNALS["power"] for step in self.steps if isinstance(step, SetPower)}
        return tuple(sorted(found))

    @property
    def moves(self) -> tuple[Move, ...]:
        """All moves in order, over all sections."""
        return tuple(move for section in self.sections for move in section.moves)

    def tips(self, moves: Sequence[Move]) -> Array:
        """Return the tip poses of targets in the part frame, (K, 4, 4) m."""
        T = np.array([getattr(move, "T_part_tip", np.eye(4)) for move in moves]).reshape(-1, 4, 4)
        joint = [k for k, move in enumerate(moves) if isinstance(move, JointMove)]
        if joint:
            T_base_tip = self.robot.forward([moves[k].q for k in joint]) @ self.T_flange_tip
            T[joint] = np.linalg.solve(self.T_base_part, T_base_tip)
        return T


# -----------------------------------------------------------------------------
# Differences of controllers from the plan: switches only at stops, other postures.


def stop_to_switch(program: Program, settings: object = None) -> Program:
    """Return the program with a stop at each switch, and without lead times."""

    def stop(move: LinearMove) -> LinearMove:
        switches = tuple(replace(switch, lead_time=0.0) for switch in move.switches)
        return replace(move, switches=switches, zone=0.0)

    sections = tuple(
        replace(
            section,
            steps=tuple(
                stop(s) if isinstance(s, LinearMove) and s.switches else s for s in section.steps
            ),
        )
        for section in program.sections
    )
    return replace(program, sections=sections)


def warn_of_changed_postures(
    section: Section, words: Sequence[tuple[int | str, ...]]
) -> Iterator[ProgramIssue]:
    """Warn of straight moves that change the configuration; `words` has that of each target."""
    for k, move in enumerate(section.moves):
        if k > 0 and isinstance(move, LinearMove) and words[k] != words[k - 1]:
            before, after = (" ".join(map(str, words[i])) for i in (k - 1, k))
            message = f"the configuration changes from {before} to {after} in a straight move"
            place = f"{section.name}, move {k}"
            yield ProgramIssue(
                "warning", "posture-change", f"{message}, which the controller may refuse", place
            )


def warn_of_late_switches(section: Section, title: str) -> Iterator[ProgramIssue]:
    """Warn of switches that come later than planned, and of stops that they need."""
    moves = [m for m in section.moves if isinstance(m, LinearMove) and m.switches]
    leads = [switch.lead_time for m in moves for switch in m.switches if switch.lead_time > 0]
    if leads:
        yield ProgramIssue(
            "warning",
            "lead-time",
            f"{len(leads)} switches are planned up to {max(leads) * 1e3:g} ms ahead, but {title} "
            "switches only after the tip has stopped; measure the delay, and set no lead time",
            section.name,
        )
    if flying := sum(move.zone > 0 for move in moves):
        yield ProgramIssue(
            "warning",
            "stop-to-switch",
            f"the robot will stop at {flying} places to switch there, as at each micro joint, "
            f"because {title} switches only while it is stopped",
            section.name,
        )
