"""The robot languages that programs can be written in, and their properties."""

from __future__ import annotations

import re
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import Level
from kerfpath.errors import InputError
from kerfpath.names import LONGEST_NAME, identifiers
from kerfpath.post.power import PowerFollows
from kerfpath.post.program import (
    GASES,
    PARTNERS,
    SIGNALS,
    Await,
    CircularMove,
    Comment,
    Gas,
    Handshake,
    JointMove,
    LinearMove,
    Partner,
    Program,
    ProgramIssue,
    Request,
    Section,
    SetPower,
    Signal,
    Step,
    Switch,
    Wait,
    asked_in,
    still_asked,
)
from kerfpath.post.read_program import Reader
from kerfpath.robots import AXIS_3, Robot

# -----------------------------------------------------------------------------
# How a controller runs straight moves and arcs, from its maker's documents or assumed.

Orientation = Literal["slerp", "two-angle", "wrist"]
"""How the tool turns between two targets.

"slerp": it turns evenly about one fixed axis. "two-angle": its z axis swings evenly in the plane of
its directions at both targets, and the tool turns evenly about it. "wrist": the last three of six
joints move evenly from one target to the other, and the first three keep the tip on its path.
"""


STRETCHED = 0.1
"""Share by which moves may take longer than planned before that is reported."""
CYCLE_NOISE = 1e-6
"""Share by which a time may exceed whole cycles because of rounding."""


class ShortMoves(NamedTuple):
    """What a controller's cycle does to the moves of a path.

    Parameters
    ----------
    worst : int
        Number, from 0, of the move that it stretches most.
    share : float
        Share by which that move takes longer than planned.
    words : str
        How many moves are too short, and what follows.
    level : {"error", "warning"}
        An error if the shortest time is given, not assumed.
    """

    worst: int
    share: float
    words: str
    level: Level


REMEDY_SHORT = "raise spacing_mm or thin_mm, or lower the speed"
"""What helps against moves that are too short."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """Properties of a controller that decide how it runs the path of a program.

    Parameters
    ----------
    turning_speed : float rad/s
        Largest turning speed of the tool; beyond it the tip slows down. For "two-angle", the limit
        of each angle.
    orientation : {"slerp", "two-angle", "wrist"}
        How the tool turns between two targets, see `Orientation`.
    corner : float m, optional
        Distance from every corner at which the tip begins and ends to round it, whatever the
        program contains.
    corner_time : float s, optional
        The same as a time at the programmed speed.
    rounds_twice : bool
        Whether the rounded path is rounded once more, over the time of a corner. With moves of one
        duration it is then the cubic B-spline over the targets instead of the quadratic one.
    assumed : str
        What is assumed of its corners, because the settings do not give it; empty if nothing is.
    shortest : float s
        Shortest time of a move of the path: a shorter one takes as long.
    cycle : float s
        Moves of the path take whole multiples of it; 0: any time.
    shortest_given : bool
        Whether the settings give the shortest time, or it is assumed.
    """

    turning_speed: float = np.inf
    orientation: Orientation = "slerp"
    corner: float | None = None
    corner_time: float | None = None
    rounds_twice: bool = False
    assumed: str = ""
    shortest: float = 0.0
    cycle: float = 0.0
    shortest_given: bool = False

    __repr__ = short_repr

    def stretch(self, time: Array) -> Array:
        """Return the share by which moves take longer than the times (m,) s that are asked for."""
        longer = np.maximum(time, self.shortest)
        if self.cycle > 0:
            longer = self.cycle * np.ceil(longer / self.cycle * (1 - CYCLE_NOISE))
        return np.asarray(np.maximum(longer, time) / time - 1)

    def short_moves(self, time: Array) -> ShortMoves:
        """Return what the cycle does to moves of a path of planned times (m,) s, m > 0."""
        stretch = self.stretch(time)
        many = stretch > STRETCHED
        extra = float((time * stretch)[many].sum())
        assumed = "" if self.shortest_given else ", assumed; set shortest_move_ms"
        return ShortMoves(
            worst=int(np.argmax(stretch)),
            share=float(stretch.max()),
            words=f"{int(many.sum())} of {len(time)} moves of the path are too short for the "
            f"controller (shortest move {self.shortest * 1e3:g} ms{assumed}): it takes {extra:.3g} "
            "s longer than planned, and may stop with the beam on",
            level="error" if self.shortest_given else "warning",
        )

    def with_shortest(self, said_ms: float | None, assumed_ms: float) -> Controller:
        """Return the controller with the shortest move of a setting, or what is assumed without."""
        shortest_ms = assumed_ms if said_ms is None else said_ms
        return replace(self, shortest=shortest_ms * 1e-3, shortest_given=said_ms is not None)

    @property
    def rounds_by_itself(self) -> bool:
        """Whether it rounds corners by its own measure, not by that of the program."""
        return self.corner is not None or self.corner_time is not None

    def zone(self, said: float, speed: float) -> float:
        """Return the distance (m) from a corner at which the controller begins to round it.

        Parameters
        ----------
        said : float m
            Zone in the program; nothing is rounded at 0, which is a stop.
        speed : float m/s
            Programmed speed.
        """
        if said == 0 or not self.rounds_by_itself:
            return said
        return speed * self.corner_time if self.corner_time is not None else self.corner or 0.0


PLAIN = Controller()
"""A controller without a limit of the turning speed, which turns the tool about one axis."""


# -----------------------------------------------------------------------------
# Settings of a language: what users state about a controller, and rules of its programs.


def setting(expected: str, example: str, **bounds: Any) -> Any:
    """Return a setting with its bounds, and what is expected and an example for messages."""
    return Field(description=expected, examples=[example], **bounds)


def numbered(port: str, most: int, least: int = 1) -> Any:
    """Return a setting that is the number of a port, with its bounds."""
    return setting(f"the number of {port}, {least} to {most}", "5", ge=least, le=most)


LinesPerFile = Annotated[
    int, setting("a whole number of lines from 100 to 1000000", "5000", ge=100, le=1_000_000)
]


ShortestMove = Annotated[
    float | None,
    setting("the shortest time of a move of the path, 0 to 1000, in ms", "12.0", ge=0, le=1000),
]
"""The controller's own; without it a value is assumed, and moves below it are warned of."""


OrientationSetting = Annotated[
    Orientation,
    setting("how the tool turns between targets: slerp, two-angle or wrist", '"slerp"'),
]

PowerFull = Annotated[
    float | None,
    setting("the value of power_output at full power, above 0, at most 100000", "10", gt=0, le=1e5),
]
"""In the units of the output; none is assumed."""

PositionerFrame = Annotated[
    Annotated[list[float], Field(min_length=6, max_length=6)] | None,
    setting(
        "six numbers: the frame that moves with the part, in the robot base with all external axes "
        "at 0, as x, y, z in mm and rotations about fixed x, y, z in deg",
        "[1200.0, 0.0, 300.0, 0.0, 0.0, 90.0]",
    ),
]
"""For languages that couple the part frame to the axes that carry it; see `carrier_frame`."""


class LanguageSettings(BaseModel):
    """The settings of one language; in jobs the table [program.LANGUAGE]."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    lines_per_file: LinesPerFile = 5000


class PortSettings(LanguageSettings):
    """Settings that name inputs and outputs: of laser and gas, and of handshakes.

    A subclass gives, as keywords, the annotations of an output and an input in its language, with
    bounds and texts for messages. They apply to all fields here that it does not annotate itself.
    """

    laser_output: Any = None
    gas_output: Any = None
    gas_2_output: Any = None
    ready_input: Any = None
    shutter_input: Any = None
    gas_pressure_input: Any = None
    height_input: Any = None
    interlock_input: Any = None
    ready_output: Any = None
    shutter_output: Any = None
    height_output: Any = None

    def __init_subclass__(cls, *, output: Any = None, input: Any = None, **others: Any) -> None:
        super().__init_subclass__(**others)
        if output is None:
            return
        own = cls.__annotations__
        ports = [name for name in PortSettings.__annotations__ if name not in own]
        for name in ports:
            setattr(cls, name, None)
        ways = {name: output if name.endswith("_output") else input for name in ports}
        cls.__annotations__ = ways | own


class PowerSettings(PortSettings):
    """Settings that name the analogue output of the power, too, and its value at full power.

    A subclass gives, as a keyword, the annotation of an analogue output in its language.
    """

    power_output: Any = None
    power_full: PowerFull = None

    def __init_subclass__(cls, *, analogue: Any = None, **others: Any) -> None:
        super().__init_subclass__(**others)
        cls.power_output = None
        cls.__annotations__ = {"power_output": analogue, **cls.__annotations__}


def handshakes(settings: LanguageSettings) -> dict[tuple[Partner, str], Any]:
    """Return the inputs and outputs of handshakes that settings can name, by partner and way."""
    fields = (name.rpartition("_") for name in type(settings).model_fields)
    return {
        (PARTNERS[partner], way): getattr(settings, f"{partner}_{way}")
        for partner, _, way in fields
        if partner in PARTNERS and way in ("input", "output")
    }


def ask_again_lines(
    asked: Iterable[Handshake], ports: Mapping[tuple[Any, Any], Any], request: str, wait: str
) -> list[str]:
    """Return the lines that make requests again after a pause, and wait for answers without limit.

    Parameters
    ----------
    asked : iterable of Handshake
        What holds before the pause, see `still_asked`.
    ports : mapping
        Name or number of each port by partner and way, as `handshakes` returns it.
    request, wait : str
        Lines of the language, with {} for the output and the input.
    """
    return [
        wait.format(ports[step.partner, "input"])
        if isinstance(step, Await)
        else request.format(ports[step.partner, "output"])
        for step in asked
    ]


def gas_outputs(settings: Any) -> dict[Any, Gas]:
    """Return the signals of gases by their outputs, of those that settings name."""
    named = {getattr(settings, f"{gas}_output"): gas for gas in GASES}
    return {output: gas for output, gas in named.items() if output is not None}


def outputs(settings: Any) -> list[Any]:
    """Return all outputs that settings name: laser, gases, and those of requests."""
    requests = (port for (_, way), port in handshakes(settings).items() if way == "output")
    named = (settings.laser_output, *gas_outputs(settings), *requests)
    return [output for output in named if output is not None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Rules that programs in a language must keep, with given settings.

    Parameters
    ----------
    longest_name : int
        Largest number of characters of a name.
    name : str
        Regular expression that every name matches.
    slowest, fastest : float m/s
        Range of tip speeds that can be written.
    speed_step : float m/s
        Speeds are written as multiples of this.
    controller : Controller
        How the controller runs the path.
    longest_lead : float s
        The longest lead time of a switch on the path.
    point_step, angle_step : float m, rad
        Rounding errors of positions and angles in the digits of targets.
    """

    longest_name: int = 32
    name: str = r"[A-Za-z][A-Za-z0-9_]*"
    slowest: float = 1e-5
    fastest: float = np.inf
    speed_step: float = 0.0
    controller: Controller = PLAIN
    longest_lead: float = np.inf
    point_step: float = 0.0
    angle_step: float = 0.0

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Inherited:
    """A state of the controller that another program may have left.

    Parameters
    ----------
    state : str
    lines : tuple of str
        Lines that set it when a program begins, exactly; none if nothing does.
    why : str
        What the lines do, or why there are none.
    """

    state: str
    why: str
    lines: tuple[str, ...] = ()

    __repr__ = short_repr


def reset_lines(states: Iterable[Inherited]) -> list[str]:
    """Return the lines that set inherited states, in their order."""
    return [line for state in states for line in state.lines]


OverrideSetting = Annotated[
    Literal["full", "operator"],
    setting("full, or operator to keep the speed override of the operator", '"operator"'),
]


def _nothing_inherited(settings: object) -> tuple[Inherited, ...]:
    return ()


# -----------------------------------------------------------------------------
# The base of all formatters, which turn the steps of a program into lines.


class Formatter(ABC):
    """Formatter of one program in one language; each kind of step has its own method.

    A dialect is a subclass that overrides some of them. The program must have passed `preflight`.

    Parameters
    ----------
    program : Program
    settings : LanguageSettings
        Settings of the language.
    """

    program: Program
    settings: Any
    around = 0
    """Number of lines of a contour's routine, or of its file, beside those of its steps."""
    too_long: Level | None = None
    """Level of the issue that a contour is longer than a file may be; None: not checked."""

    def __init__(self, program: Program, settings: LanguageSettings) -> None:
        self.program, self.settings = program, settings
        self.asked: list[Handshake] = []
        """Handshakes that hold at the step that is being written."""

    @abstractmethod
    def files(self) -> dict[str, str]:
        """Return the text of every file by its name, the one to start first."""

    @abstractmethod
    def names(self) -> list[tuple[str, str]]:
        """Return every name that the text defines or uses, with what it names."""

    @abstractmethod
    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield the lines of a joint move."""

    @abstractmethod
    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield the lines of a linear move and of what is switched at its end."""

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield the lines of a circular move and of what is switched at its end.

        Raises
        ------
        InputError
            The language has no arcs; its `check` reports that before.
        """
        raise InputError("the language has no arcs; leave arcs_mm out of the job")

    @abstractmethod
    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield the lines of a wait."""

    def power(self, power: SetPower) -> Iterator[str]:
        """Yield the lines that set the power where the robot stands.

        Raises
        ------
        InputError
            The language cannot set a power; the preflight reports that before.
        """
        raise InputError("the language cannot set a power; leave power_by_speed out of the job")

    def request(self, request: Request) -> Iterator[str]:
        """Yield the lines that set or reset the output of a partner.

        Raises
        ------
        InputError
            The language has no such outputs; the preflight reports that before.
        """
        raise InputError("the language cannot request anything; leave request out of the job")

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield the lines that wait for an input, and end the program safely if it stays off.

        Raises
        ------
        InputError
            The language has no inputs; the preflight reports that before.
        """
        raise InputError("the language cannot wait for inputs; leave wait_for out of the job")

    @abstractmethod
    def comment(self, text: str) -> Iterator[str]:
        """Yield the lines of a comment; `text` is on one line, in plain characters."""

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of all steps of a section."""
        self.asked = list(self.asked_before(section))
        for step in section.steps:
            yield from self.step(step)
            if changes := list(asked_in([step])):
                self.asked = still_asked([*self.asked, *changes])

    def asked_before(self, section: Section) -> Sequence[Handshake]:
        """Return the handshakes that hold where a section begins."""
        return ()

    def lengths(self) -> dict[str, int]:
        """Return how many lines each contour takes, by its name."""
        return {s.name: sum(1 for _ in self.lines(s)) + self.around for s in self.program.sections}

    def room(self) -> int:
        """Return how many lines of contours a file has room for."""
        return int(self.settings.lines_per_file)

    def step(self, step: Step) -> Iterator[str]:
        """Yield the lines of one step."""
        if isinstance(step, JointMove):
            yield from self.joint_move(step)
        elif isinstance(step, CircularMove):
            yield from self.circular_move(step)
        elif isinstance(step, LinearMove):
            yield from self.linear_move(step)
        elif isinstance(step, Wait):
            yield from self.wait(step)
        elif isinstance(step, SetPower):
            yield from self.power(step)
        elif isinstance(step, Request):
            yield from self.request(step)
        elif isinstance(step, Await):
            yield from self.wait_for(step)
        elif isinstance(step, Comment):
            yield from self.comment(plain(step.text))

    def head(self, *about: str) -> list[str]:
        """Return the remarks at the head: the robot, `about`, and what is and is not proved."""
        robot = self.program.robot
        clear = "been proved clear in the planned cell"
        checked = clear if self.program.air_checked else "not been checked for collisions"
        return [
            f"Written by kerfpath for {plain(robot.model)} ({plain(robot.id)}).",
            *about,
            f"Transfer moves have {checked}.",
            *self.program.caveats,
        ]

    def output(self, signal: Signal) -> Any:
        """Return the output of a signal, from the settings `laser_output`, `gas_output` and others.

        Raises
        ------
        InputError
            The settings name no output for the signal.
        """
        name = getattr(self.settings, f"{signal}_output")
        if name is None:
            raise InputError(
                f"the program switches the {signal}, but no output is named for it; name it "
                f"with {signal}_output"
            )
        return name

    def power_per_speed(self, power: SetPower) -> float:
        """Return the value of the power output for each m/s of the tip."""
        return float(power.per_speed * self.settings.power_full)

    def power_value(self, share: float | None, decimals: int = 4) -> str:
        """Return the value of the power output at a share of the full power."""
        return number((share or 0.0) * self.settings.power_full, decimals)

    def needed(self, switch: Switch) -> list[Any]:
        """Return the outputs that must be on for a switch to act."""
        return [
            self.output(SIGNALS[name]) if name in SIGNALS else self.port(PARTNERS[name], "output")
            for name in switch.needs
        ]

    def port(self, partner: Partner, way: Literal["input", "output"]) -> Any:
        """Return the input by which a partner answers, or the output by which it is asked."""
        return getattr(self.settings, f"{partner}_{way}")


def number(value: float, decimals: int) -> str:
    """Return a number with `decimals` decimals, and no minus before zero."""
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"


LONGEST_TEXT = 200
"""Characters of a remark; lines of programs are short enough for every controller."""


def plain(text: str) -> str:
    """Return `text` on one line, cut if long, in the characters that every controller reads."""
    text = re.sub(r"[^ -~]", "?", text)
    return text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 3]}..."


# -----------------------------------------------------------------------------
# Divide programs that are too long for one file between contours, where the beam is off.


def rename_sections(
    program: Program, taken: Iterable[str] = (), *, longest_name: int = LONGEST_NAME
) -> Program:
    """Return the program with unique section names of at most `longest_name` characters.

    None of them is the name of the program or in `taken`.
    """
    texts = (section.name for section in program.sections)
    names = identifiers(texts, taken=(program.name, *taken), longest=longest_name)
    sections = (replace(s, name=name) for s, name in zip(program.sections, names, strict=True))
    return replace(program, sections=tuple(sections))


def divide_sections(
    sections: Sequence[Section], lines: Sequence[int], most_lines: int
) -> list[list[Section]]:
    """Return the sections, with their numbers of `lines`, in files of at most `most_lines` lines.

    Their order stays. A longer section gets its own file: a file may only end between two sections,
    where the robot is stopped with the beam off.
    """
    files: list[list[Section]] = []
    room = 0
    for section, count in zip(sections, lines, strict=True):
        if not files or count > room:
            files.append([])
            room = most_lines
        files[-1].append(section)
        room -= count
    return files


def find_long_contours(written: Formatter) -> Iterator[ProgramIssue]:
    """Yield an issue for each contour with more lines than a file may have: none is divided.

    It is a warning if the language gives the contour its own file.
    """
    if written.too_long is None:
        return
    remedy = "raise lines_per_file, or use fewer nodes (spacing_mm) or arcs (arcs_mm)"
    kept = "" if written.too_long == "error" else ", and gets its own file"
    most = written.room()
    for name, count in written.lengths().items():
        if count > most:
            message = (
                f"the contour has {count} lines, but lines_per_file allows {most}; it is not "
                f"divided, because the robot could stop there with the beam on{kept}; {remedy}"
            )
            yield ProgramIssue(written.too_long, "file-length", message, name)


def divide_program(
    program: Program, lines: Sequence[int], room: int, longest_name: int
) -> dict[str, list[Section]]:
    """Return the sections of each file by its name; `lines` has the length of each section."""
    groups = divide_sections(program.sections, lines, room)
    taken = [program.name, *(section.name for section in program.sections)]
    names = identifiers([program.name] * len(groups), taken=taken, longest=longest_name)
    return dict(zip(names, groups, strict=True))


def require_one_file(name: str, lines: Sequence[str], most_lines: int) -> dict[str, str]:
    """Return the text of a program that cannot be divided, by the name of its file.

    Raises
    ------
    InputError
        The program has more than `most_lines` lines.
    """
    if len(lines) > most_lines:
        raise InputError(
            f"{name}: the program has {len(lines)} lines, but lines_per_file allows {most_lines} "
            "and this language cannot divide it; cut fewer contours in one program, or raise "
            "lines_per_file"
        )
    return {name: "\n".join([*lines, ""])}


# -----------------------------------------------------------------------------
# The robot languages that programs can be written in, and their properties.

ENTRY_POINTS = "kerfpath.languages"
"""Group of entry points whose objects are languages."""
SHIPPED = {
    "csv": "kerfpath.post.csv:CSV",
    "fanuc": "kerfpath.post.fanuc:FANUC",
    "inform": "kerfpath.post.inform:INFORM",
    "krl": "kerfpath.post.krl:KRL",
    "linuxcnc": "kerfpath.post.linuxcnc:LINUXCNC",
    "rapid": "kerfpath.post.rapid:RAPID",
    "ros": "kerfpath.post.ros:ROS",
    "urscript": "kerfpath.post.urscript:URSCRIPT",
    "val3": "kerfpath.post.val3:VAL3",
}
"""Modules and names of the languages that come with the package."""
BROKEN = (ImportError, AttributeError, NameError, SyntaxError, TypeError, ValueError)
"""Exceptions that a module written for another version may raise when it is imported."""


class MotionFromStop(NamedTuple):
    """How long each of m moves takes, (m,) s, and the joints (k, n) rad every `step` s."""

    took: Array
    q: Array


def _none_is_reserved(name: str) -> bool:
    return False


def no_settings_needed(robot: Robot, settings: object) -> Iterator[str]:
    """Yield nothing: external axes have their own names and units in programs."""
    yield from ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """One robot language, or a dialect of one.

    Parameters
    ----------
    name : str
        Name in jobs and on the command line.
    title : str
        Name in messages.
    manufacturers : tuple of str
        Manufacturers of the robots that it moves; empty: all.
    families : tuple of str
        The arms that it can express, by `Robot.kinematics`; empty: all.
    axis_3 : tuple of str
        The arms that it can express, by `Robot.axis_3`. Without "", it must be known what axis 3
        of the controller measures.
    suffix : str
        Suffix of the file to start, with its dot.
    settings : type of LanguageSettings
    rules : callable
        (settings) -> the Rules of programs.
    formatter : type of Formatter
    is_reserved : callable, optional
        Whether a name means something else in the language; default: none does.
    posture : callable, optional
        (robot, q (K, n) rad, settings) -> posture and turns at each target, in the words of its
        reader. None: targets do not contain them.
    check : callable, optional
        (program, settings) -> the issues that only this language has.
    bounds : callable, optional
        (robot) -> the least and greatest joints (6,) rad that its targets can express; jobs plan
        within them. None: it can express all.
    endless_bounds : callable, optional
        (robot) -> the same (6,) rad of endless joints, infinite of others. They turn back between
        contours to stay within. None: it can express every turn of them.
    sayable : callable, optional
        (program, settings) -> the program as far as the language can express it; `check` warns of
        all that is left out. None: it can express all.
    ahead : bool
        Whether outputs are switched on the path, ahead of a target; else the robot stops first.
    zones : bool
        Whether its moves are straight lines and arcs whose corners the controller rounds.
    assumed : mapping of str to value
        Values of settings that are None; the preflight warns of assumed outputs.
    motion : callable, optional
        (robot, q (m+1, n) rad, planned (m,) s, settings, step s) -> how moves run from stop to
        stop. None: as `kerfpath.execution` models it.
    no_power : str
        Why programs cannot set the power along the path; empty if they can.
    follows_speed : bool
        Whether it has a statement by which the controller sets the power by the speed.
    externals : callable, optional
        (robot, settings) -> what is missing or wrong in the settings for the robot's external axes
        and coordinated motion, as sentences. None: the language has no external axes.
    encodings : tuple of str
        Encodings of its texts, in the order in which they are tried. Only remarks differ.
    byte_order_mark : bool
        Whether its files begin with one, in UTF-8.
    longest_line : int
        Characters of the longest line that is read.
    inherited : callable, optional
        (settings) -> the states that another program may have left, and the lines that set them.
    read : Reader, optional
        Reader of the text; without one a program cannot be audited.
    """

    name: str
    title: str
    manufacturers: tuple[str, ...]
    families: tuple[str, ...]
    suffix: str
    settings: type[LanguageSettings]
    rules: Callable[[Any], Rules]
    formatter: type[Formatter]
    is_reserved: Callable[[str], bool] = _none_is_reserved
    posture: Callable[[Robot, Array, Any], list[tuple[int | str, ...]]] | None = None
    check: Callable[[Program, Any], Iterator[ProgramIssue]] | None = None
    bounds: Callable[[Robot], tuple[Array, Array]] | None = None
    endless_bounds: Callable[[Robot], tuple[Array, Array]] | None = None
    sayable: Callable[[Program, Any], Program] | None = None
    ahead: bool = True
    zones: bool = True
    assumed: Mapping[str, Any] = field(default_factory=dict)
    no_power: str = ""
    follows_speed: bool = False
    motion: Callable[[Robot, Array, Array, Any, float], MotionFromStop] | None = None
    externals: Callable[[Robot, Any], Iterator[str]] | None = None
    encodings: tuple[str, ...] = ("utf-8-sig",)
    byte_order_mark: bool = False
    longest_line: int = 2000
    inherited: Callable[[Any], tuple[Inherited, ...]] = _nothing_inherited
    read: Reader | None = None
    axis_3: tuple[str, ...] = AXIS_3

    __repr__ = short_repr

    def completed(self, settings: LanguageSettings | None) -> LanguageSettings:
        """Return settings, by default those of the language, with `assumed` values where None."""
        settings = self.settings() if settings is None else settings
        lacks = {k: v for k, v in self.assumed.items() if getattr(settings, k, v) is None}
        return settings.model_copy(update=lacks) if lacks else settings

    def controller(self, settings: LanguageSettings | None = None) -> Controller:
        """Return the controller that settings describe, by default the language's defaults."""
        return self.rules(self.completed(settings)).controller

    def expressible(self, robot: Robot, lower: ArrayLike, upper: ArrayLike) -> tuple[Array, Array]:
        """Return limits (n,) of a robot's joints, narrowed to what targets can express.

        External axes, last, keep theirs, and all joints do if the language cannot move the robot.
        """
        least, most = np.array(lower, dtype=float), np.array(upper, dtype=float)
        if self.bounds is not None and not self.refusal(robot):
            arm, (low, high) = slice(robot.family.joints), self.bounds(robot)
            least[arm], most[arm] = np.maximum(least[arm], low), np.minimum(most[arm], high)
        return least, most

    def turns_within(self, robot: Robot) -> tuple[Array, Array] | None:
        """Return least and greatest angles (n,) rad of endless joints; None without bounds."""
        if self.endless_bounds is None or not robot.endless.any() or self.refusal(robot):
            return None
        ends = np.array([np.full(robot.joints, -np.inf), np.full(robot.joints, np.inf)])
        ends[:, : robot.family.joints] = self.endless_bounds(robot)
        return ends[0], ends[1]

    def refusal(self, robot: Robot) -> str:
        """Return why no program in this language can move a robot; empty if one can."""
        if self.families and robot.kinematics not in self.families:
            return f"language {self.name!r} cannot yet express the axes of an arm like {robot.id!r}"
        if robot.externals and self.externals is None:
            names = ", ".join(axis.name for axis in robot.externals)
            return (
                f"language {self.name!r} is written here without external axes and cannot move "
                f"{names}; use another language, or plan the arm alone"
            )
        if robot.axis_3 in self.axis_3:
            return ""
        if robot.axis_3:
            return (
                f"language {self.name!r} cannot express a {robot.axis_3} axis 3 like that of "
                f"{robot.id!r}"
            )
        ways = {
            "serial": 'axis_3 = "serial" if it is joint 3 alone',
            "horizontal": (
                'axis_3 = "horizontal", with axis_3_deg = [LOWER, UPPER] from its data sheet, '
                "if it measures the upper arm from the horizontal, as with a parallel rod"
            ),
        }
        return (
            f"language {self.name!r} writes axis 3 of the controller, but it is not known what "
            f"axis 3 of {robot.id!r} measures (no arm of the library has its lengths); add to "
            "[robot] " + ", or ".join(ways[way] for way in self.axis_3 if way)
        )

    def power_refusal(self, follows: PowerFollows) -> str:
        """Return why no program in this language can set the power so; empty if one can."""
        if follows == "controller" and not self.follows_speed:
            other = "leave power_by_speed out" if self.no_power else 'write power_follows = "steps"'
            return f"{self.title} has no statement by which the power follows the speed; {other}"
        if follows == "steps" and self.no_power:
            other = 'write power_follows = "controller"' if self.follows_speed else "leave it out"
            return f"power_by_speed: {self.no_power}; {other}, or use another language"
        return ""

    def doubt(self, robot: Robot) -> str:
        """Return why a robot may not understand this language; empty if it does."""
        if not self.manufacturers or robot.manufacturer in self.manufacturers:
            return ""
        return (
            f"language {self.name!r} is for robots by {' or '.join(self.manufacturers)}, but "
            f"{robot.id!r} is by {robot.manufacturer or 'an unknown maker'}"
        )


@cache
def languages() -> dict[str, Language]:
    """Return all languages by name: those shipped, and those that entry points add.

    An entry point that cannot be loaded, is not a language, or has the name of a shipped language
    is left out with a warning.
    """
    found = {name: _shipped_languages(name) for name in SHIPPED}
    for point in sorted(entry_points(group=ENTRY_POINTS), key=lambda point: point.name):
        try:
            loaded, fault = point.load(), ""
        except BROKEN as error:
            loaded, fault = None, f"cannot be loaded: {' '.join(str(error).split())}"
        if not fault and not isinstance(loaded, Language):
            fault = f"is a {type(loaded).__name__}, expected a kerfpath.post.Language"
        if not fault and loaded.name in found:
            fault = f"has the name {loaded.name!r} of another language; rename it"
        if fault:
            warnings.warn(f"language {point.name!r} ({point.value}) {fault}", stacklevel=2)
        else:
            found[loaded.name] = loaded
    return found


def _shipped_languages(name: str) -> Language:
    loaded = EntryPoint(name, SHIPPED[name], ENTRY_POINTS).load()
    assert isinstance(loaded, Language)
    return loaded


def language(name: str) -> Language:
    """Return a language by its name.

    Raises
    ------
    InputError
        An unknown language; the message lists those known.
    """
    known = languages()
    if name not in known:
        raise InputError(f"language {name!r} is not known; expected {', '.join(sorted(known))}")
    return known[name]
