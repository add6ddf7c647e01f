"""Read robot programs as paths: the cuts are the moves of the tip while the beam is on.

The readers of the languages say what each statement does; what a program does with it is here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, freeze
from kerfpath.cad.build import REPEATED
from kerfpath.cad.part import Part
from kerfpath.cad.toolpath import Arc, Move, ToolPath, lines_of, part_of_tool_path
from kerfpath.cad.units import LARGEST, MM, UNITS_MM
from kerfpath.errors import InputError
from kerfpath.names import listed
from kerfpath.text import NUMBER, number, upper

Beam = str | Sequence[str]
"""What is on while the tool cuts: an output; two statements that switch on and off; or a speed."""
BEAM = re.compile("LASER|BEAM")
"""Names of outputs of which one is the beam if several are switched."""
SPEED = re.compile(r"([-+.\d]+)\s*mm/s", re.ASCII)
MOST_STATEMENTS = 500_000
"""Most statements that are run: routines that call each other may be endless, or nearly."""
DEEPEST = 30
"""Most routines within each other."""
FIRST = re.compile("(FIRST_CONTOUR|FIRST|NFIRST)<=[0-9]+")
"""Conditions under which kerfpath's own programs begin at a contour."""
STRAIGHT = 1e-9
"""Sine of the angle at the via of an arc below which it is a line."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """A frame of positions, known by its name; T_base_frame (4, 4) if the program has it."""

    name: str
    T: Array | None = None


class Place(NamedTuple):
    """A pose (4, 4) of the tip, in the unit of the file, in a frame."""

    T: Array
    frame: Frame


class Statement(NamedTuple):
    """A statement of a program, and its line, with its file if it is not the main one."""

    line: int | str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """A move on a path or any way, to a place, or to joints (None); `speed` is in mm/s."""

    line: int | str
    on_path: bool
    place: Place | None
    via: Place | None
    speed: float | None
    routine: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Switched:
    """An output that is switched."""

    line: int | str
    output: str
    on: bool


@dataclass(slots=True)
class Ran:
    """What a program did: its moves and switches, what is said of it, and words not used."""

    steps: list[Moved | Switched] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unused: set[str] = field(default_factory=set)
    conditional: dict[str, int | str] = field(default_factory=dict)
    """Outputs that are switched on under a condition, and where."""

    @property
    def moves(self) -> list[Moved]:
        """Its moves."""
        return [step for step in self.steps if isinstance(step, Moved)]


class Language:
    """A reader of one language: it takes the statements of routines in the order in which they run.

    Parameters
    ----------
    path : Path
    text : (path) to sequence of str or None
        Returns the lines of a file, None if there is none.
    beam : Beam or None
        As in `kerfpath.cad.read`.
    """

    unit: ClassVar[str] = "mm"
    base: ClassVar[str]
    """The frame of the robot's base, as the language calls it."""
    opens: ClassVar[re.Pattern[str]]
    closes: ClassVar[re.Pattern[str]]
    endless: ClassVar[re.Pattern[str]]
    """The first line of a loop without an end."""
    harmless: ClassVar[re.Pattern[str]]
    """Statements that do not change the path."""
    state: ClassVar[tuple[str, ...]] = ("frame", "speed")
    """Attributes that the moves after them depend on."""

    def __init__(
        self, path: Path, text: Callable[[Path], Sequence[str] | None], beam: Beam | None
    ) -> None:
        self.path, self.text = path, text
        self.switching: dict[str, bool] = {}
        if beam is not None and not isinstance(beam, str):
            on, off = beam
            self.switching = {compact(on): True, compact(off): False}
        self.ran = Ran()
        self.routines: dict[str, list[Statement]] = {}
        self.inside: list[str] = []
        self.count = 0
        self.frame = Frame(name=self.base)
        self.speed: float | None = None

    def start(self) -> None:
        """Run the program; each language does it.

        Raises
        ------
        InputError
            A statement that is not known, or whose effect depends on more than the program.
        """
        raise NotImplementedError

    def take(self, line: int | str, text: str) -> None:
        """Take one statement that opens or closes nothing; each language does it."""
        raise NotImplementedError

    def run(self, name: str) -> None:
        """Run a routine by the key of its name."""
        if name in self.inside or len(self.inside) >= DEEPEST:
            raise InputError(f"{name}: calls itself, or routines are nested too deeply")
        self.inside.append(name)
        self.run_all(self.routines[name])
        self.inside.pop()

    def run_all(self, statements: Sequence[Statement]) -> None:
        """Run statements; of those under a condition, only what does nothing is passed over."""
        at = 0
        while at < len(statements):
            line, text = statements[at]
            self.count += 1
            if self.count > MOST_STATEMENTS:
                raise InputError(f"line {line}: runs more than {MOST_STATEMENTS} statements")
            if not self.opens.fullmatch(text):
                if self.leaves(text):
                    return
                said = compact(text)
                if said in self.switching:
                    self.switch(line, "beam", on=self.switching[said])
                elif self.harmless.fullmatch(text) and not self._is_call(text):
                    self.ran.unused.add(word_of(text))
                else:
                    self.take(line, text)
                at += 1
                continue
            end = self._end(statements, at)
            self.run_block(statements[at], statements[at + 1 : end])
            at = end + 1

    def _is_call(self, text: str) -> bool:
        name = re.split(r"\W", text, maxsplit=1)[0]
        return name in self.routines or upper(name) in self.routines

    def leaves(self, text: str) -> bool:
        """Return whether a statement ends its routine."""
        return False

    def run_block(self, head: Statement, body: Sequence[Statement]) -> None:
        """Run the statements of a loop without end once, and those that begin at a contour."""
        if FIRST.search(compact(head.text)):
            self.run_all(body)
            return
        if self.endless.fullmatch(head.text):
            self.ran.notes.append(f"line {head.line}: the loop without an end is taken once")
            self.run_all(body)
            return
        trial = copy(self)
        trial.ran = Ran()
        trial.run_all(
            [e for e in body if not (self.opens.fullmatch(e.text) or self.closes.fullmatch(e.text))]
        )
        self.count = trial.count
        changed = any(getattr(trial, name) is not getattr(self, name) for name in self.state)
        if trial.ran.moves or changed:
            raise InputError(
                f"line {head.line}: {shown(head.text)}: moves under a condition; write "
                "a program without conditions and loops"
            )
        for step in trial.ran.steps:
            if isinstance(step, Switched) and step.on:
                self.ran.conditional[compact(step.output)] = step.line
        self.ran.conditional |= trial.ran.conditional
        self.ran.unused.add(word_of(head.text))

    def _end(self, statements: Sequence[Statement], at: int) -> int:
        depth = 0
        for k in range(at, len(statements)):
            depth += bool(self.opens.fullmatch(statements[k].text))
            depth -= bool(self.closes.fullmatch(statements[k].text))
            if depth == 0:
                return k
        line, text = statements[at]
        raise InputError(f"line {line}: {shown(text)}: its end is missing")

    def move(
        self, line: int | str, place: Place | None, *, on_path: bool, speed: float | None = None,
        via: Place | None = None,
    ) -> None:  # fmt: skip
        """Add a move."""
        routine = self.inside[-1] if self.inside else ""
        self.ran.steps.append(
            Moved(
                line=line, on_path=on_path, place=place, via=via, speed=speed, routine=routine,
            )
        )  # fmt: skip

    def switch(self, line: int | str, output: str, *, on: bool) -> None:
        """Add a switch."""
        self.ran.steps.append(Switched(line=line, output=output, on=on))

    def early(self, line: int | str, what: str) -> None:
        """Say that a switch before or after a target is taken at it."""
        self.ran.notes.append(f"line {line}: {what} of the target is taken at it")

    def refusal(self, line: int | str, text: str) -> InputError:
        """Return the refusal of a statement that is not known."""
        return InputError(
            f"line {line}: {shown(text)}: it is not known, and may move the robot or switch the "
            "beam; name it in beam if it switches the beam, or remove it"
        )


def compact(text: str) -> str:
    """Return a statement without blanks, in capitals."""
    return upper(re.sub(r"[ \t]+", "", text)).removesuffix(";")


def shown(text: str) -> str:
    """Return a statement for messages."""
    return repr(text[:50])


def word_of(text: str) -> str:
    """Return the first word of a statement."""
    found = re.match(r"\W?\w+", text, re.ASCII)
    return upper(found[0]) if found else text[:10]


def split(text: str, mark: str = ",", *, nested: bool = True) -> list[str]:
    """Return the parts of a text between marks in no quotes, and in no brackets if `nested`."""
    parts, depth, quoted = [""], 0, False
    for letter in text:
        quoted ^= letter == '"'
        depth += nested and not quoted and letter in "([{"
        depth -= nested and not quoted and letter in ")]}"
        if letter == mark and depth == 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def value(text: str, line: int | str, what: str) -> float:
    """Return a number of a program.

    Raises
    ------
    InputError
        Something else.
    """
    text = text.strip()
    if not NUMBER.fullmatch(text) or not abs(found := number(text)) < 1e12:
        raise InputError(f"line {line}: {what}: expected a number, got {shown(text)}")
    return found


def pose_of(xyz: Sequence[float], turned: Rotation) -> Array:
    """Return the pose (4, 4) at a point."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turned.as_matrix(), xyz
    return freeze(T)


def read_program(
    path: Path, content: bytes, unit: str | None, gap: float, beam: Beam | None
) -> Part:
    """Return the cuts of a robot program: KRL, RAPID, a FANUC listing or URScript.

    Raises
    ------
    InputError
        A statement that is not known or that depends on more than the program (its line is named),
        no beam that is known, positions in frames whose relation is not known, no cut.
    """
    language = _language(path)(path, _texts(path, content), beam)
    language.start()
    moves, notes, first = _path(language, beam)
    if unit is not None and unit != language.unit:
        raise InputError(f"unit: a robot program is in {language.unit}, got {unit}")
    tool_path = ToolPath(
        moves=moves, unit=language.unit, notes=[*language.ran.notes, *notes],
        unused=language.ran.unused,
    )  # fmt: skip
    part = part_of_tool_path(path, tool_path, None, gap, None)
    if first.T is None:
        return part
    T = np.linalg.inv(first.T).astype(np.float64)
    T[:3, 3] *= UNITS_MM[language.unit] * MM
    return replace(part, frames={language.base: freeze(T)})


def _language(path: Path) -> type[Language]:
    suffix = path.suffix.lower()
    if suffix in (".src", ".dat"):
        from kerfpath.cad.krl import Krl

        return Krl
    if suffix in (".mod", ".modx"):
        from kerfpath.cad.rapid import Rapid

        return Rapid
    if suffix == ".ls":
        from kerfpath.cad.fanuc import Fanuc

        return Fanuc
    from kerfpath.cad.urscript import URScript

    return URScript


def _texts(path: Path, content: bytes) -> Callable[[Path], Sequence[str] | None]:
    """Return what reads the lines of the program, and of files beside it in any letters."""
    known: Mapping[str, Path] | None = None

    def lines(file: Path) -> Sequence[str] | None:
        nonlocal known
        if file == path:
            return lines_of(content)
        if known is None:
            try:
                known = {each.name.lower(): each for each in path.parent.iterdir()}
            except OSError:
                known = {}
        found = known.get(file.name.lower())
        if found is None or not found.is_file():
            return None
        try:
            return lines_of(found.read_bytes())
        except (OSError, InputError) as error:
            raise InputError(f"{found.name}, which it calls: {error}") from None

    return lines


# -----------------------------------------------------------------------------
# The cuts: which moves are made with the beam on, and where they are in the part.


def _path(language: Language, beam: Beam | None) -> tuple[list[Move], list[str], Frame]:
    """Return the moves of a path, notes, and the frame in which its points are."""
    notes = list[str]()
    moved, cuts = language.ran.moves, _cuts(language.ran, beam, notes)
    first = next((m.place.frame for m, c in zip(moved, cuts, strict=True) if c and m.place), None)
    if first is None:
        raise InputError("holds no cut; expected linear or circular moves with the beam on")
    moves: list[Move] = []
    point: Array | None = None
    was_cut = False
    for move, cut in zip(moved, cuts, strict=True):
        if cut and point is None:
            raise InputError(
                f"line {move.line}: the beam is on from a place that is given by joints, or not "
                "at all; move there on a line, with the beam off, first"
            )
        T = None if move.place is None else _in_frame(move, move.place, first, cut=cut)
        if T is None:
            if cut:
                raise InputError(
                    f"line {move.line}: a cut to a target given by joints, whose place depends on "
                    "the robot; write the target as a pose"
                )
            moves.append(Move(line=move.line, kind="away"))
            point, was_cut = None, False
            continue
        arc = None
        if cut and move.via is not None and point is not None:
            via = _in_frame(move, move.via, first, cut=True)
            assert via is not None  # a cut in a frame that is not known is refused
            arc = _arc(point, via[:3, 3], T[:3, 3])
        if cut and not was_cut and moves:  # the name of the routine that cuts
            moves[-1] = replace(moves[-1], operation=move.routine)
        x, y, z = T[:3, 3].tolist()
        i, j, k = (-T[:3, 2]).tolist()
        moves.append(
            Move(
                line=move.line, kind="feed" if cut else "rapid", point=(x, y, z), axis=(i, j, k),
                operation=move.routine, arc=arc,
            )
        )  # fmt: skip
        point, was_cut = T[:3, 3], cut
    where = f"positions are in {first.name}"
    if first.T is not None:
        x, y, z = (first.T[:3, 3] * UNITS_MM[language.unit]).tolist()
        where += (
            f", which is at {x:.6g}, {y:.6g}, {z:.6g} mm of {language.base}; frame = "
            f'"{language.base}" in [part] places {language.base} instead'
        )
    return moves, [*notes, f"{where}; the beam is along z of the tool"], first


def _cuts(ran: Ran, beam: Beam | None, notes: list[str]) -> list[bool]:
    """Return for each move whether the beam is on."""
    moves = ran.moves
    if isinstance(beam, str) and (said := SPEED.fullmatch(beam.strip())):
        speed = value(said[1], 0, "beam")
        cuts = [
            m.on_path and m.speed is not None and abs(m.speed - speed) <= 1e-3 * speed
            for m in moves
        ]
        if not any(cuts):
            raise InputError(f"beam: no linear move at {speed:g} mm/s{_speeds(moves)}")
        return cuts
    output = _output(ran.steps, beam, notes)
    if (line := ran.conditional.get(compact(output))) is not None:
        raise InputError(f"line {line}: {output} is switched on under a condition")
    if not output:
        speeds = {round(m.speed, 3) for m in moves if m.on_path and m.speed is not None}
        if len(speeds) > 1:
            raise InputError(
                f"no output is switched on, so it is not known what is cut{_speeds(moves)}; give "
                f'beam = "{max(speeds):g} mm/s" for the moves at this speed'
            )
        notes.append("no output is switched on: every run of linear moves is taken as a cut")
        return [m.on_path for m in moves]
    cuts, is_on = [], False
    for step in ran.steps:
        if isinstance(step, Moved):
            if is_on and not step.on_path:
                raise InputError(
                    f"line {step.line}: a move of the joints while {output} is on; only linear and "
                    "circular moves cut"
                )
            cuts.append(is_on)
        elif compact(step.output) == compact(output):
            is_on = step.on
    return cuts


def _speeds(moves: Sequence[Moved]) -> str:
    speeds = sorted({round(m.speed, 3) for m in moves if m.on_path and m.speed is not None})
    said = listed([f"{speed:g}" for speed in speeds], 5)
    return f" (linear moves are at {said} mm/s)" if speeds else ""


def _output(steps: Sequence[Moved | Switched], beam: Beam | None, notes: list[str]) -> str:
    """Return the output of the beam, "" if none is switched on."""
    switched = [s for s in steps if isinstance(s, Switched) and s.on]
    names = list({compact(step.output): step.output for step in switched}.values())
    if beam is not None:
        wanted = beam if isinstance(beam, str) else "beam"
        if compact(wanted) not in map(compact, names):
            said = listed(names, 8) if names else "none"
            what = repr(beam) if isinstance(beam, str) else f"the statement {beam[0]!r}"
            raise InputError(f"beam: {what} switches nothing on here; outputs that do: {said}")
        return wanted
    likely = names if len(names) < 2 else [name for name in names if BEAM.search(upper(name))]
    if len(names) > 1 and len(likely) != 1:
        raise InputError(
            f"switches {listed(names, 8)} on; say which of them is the beam, such as "
            f'beam = "{names[0]}"'
        )
    if likely:
        notes.append(f"the beam is on while {likely[0]} is (beam in [part] says otherwise)")
    return likely[0] if likely else ""


def _in_frame(move: Moved, place: Place, first: Frame, *, cut: bool) -> Array | None:
    """Return a pose (4, 4) in the frame of the first cut, None if it is not known there."""
    if (np.abs(place.T[:3, 3]) > LARGEST).any():
        raise InputError(f"line {move.line}: a point further than {LARGEST / 1e6:g} km away")
    if place.frame.name == first.name:
        return place.T
    if place.frame.T is None or first.T is None:
        if not cut:
            return None
        unknown = first.name if first.T is None else place.frame.name
        raise InputError(
            f"line {move.line}: a cut in {place.frame.name}, after one in {first.name}, but the "
            f"program does not say where {unknown} is; write all cuts in one frame"
        )
    return np.asarray(np.linalg.solve(first.T, place.frame.T @ place.T))


def _arc(start: Array, via: Array, end: Array) -> Arc | None:
    """Return the arc through three points, None if they are on a line."""
    one, other = via - start, end - start
    across = np.cross(one, other)
    sizes = np.linalg.norm(one) * np.linalg.norm(other)
    if sizes <= REPEATED**2 or np.linalg.norm(across) <= STRAIGHT * sizes:
        return None
    square = across @ across
    centre = start + (
        np.cross(across, one) * (other @ other) + np.cross(other, across) * (one @ one)
    ) / (2 * square)
    x, y, z = centre.tolist()
    i, j, k = (across / np.sqrt(square)).tolist()
    return Arc((x, y, z), (i, j, k))


def blocks(
    statements: Sequence[Statement], begins: re.Pattern[str], ends: re.Pattern[str]
) -> Iterator[tuple[re.Match[str], list[Statement]]]:
    """Yield each routine: the match of its first statement, and the statements in it.

    Raises
    ------
    InputError
        A routine without an end.
    """
    head: re.Match[str] | None = None
    line: int | str = 0
    body: list[Statement] = []
    for each in statements:
        if head is None:
            head, line, body = begins.fullmatch(each.text), each.line, []
        elif ends.fullmatch(each.text):
            yield head, body
            head = None
        else:
            body.append(each)
    if head is not None:
        raise InputError(f"line {line}: {shown(head[0])}: its end is missing")
