"""VAL 3, the language of Staubli controllers: this module only formats.

Units of VAL 3: mm, deg, mm/s, seconds; rx, ry, rz turn about x, the new y, the new z. A program is
a project, a folder of XML files: a list of its files, its data, and one file for each routine.
Targets, speeds and frames are data. Motions are queued while the routine runs on: to switch an
output after the tip has stopped, the routine waits for the end of the motion; see `stop_to_switch`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.errors import InputError
from kerfpath.post.arcs import controller_frames, euler
from kerfpath.post.languages import (
    Formatter,
    ask_again_lines,
    divide_program,
    handshakes,
    number,
    rename_sections,
    reset_lines,
)
from kerfpath.post.program import (
    PARTNERS,
    SIGNALS,
    Await,
    CircularMove,
    Handshake,
    JointMove,
    LinearMove,
    Move,
    Program,
    Request,
    Section,
    Switch,
    Wait,
    stop_to_switch,
    targets_of,
)
from kerfpath.post.val3.controller import (
    LONGEST_NAME,
    VERSIONS,
    Val3Settings,
    axes_from_joints,
    inherited,
    posture,
)

# -----------------------------------------------------------------------------
# XML read with the line of every element; a document type is refused.

SPACE = " \t\r\n"
"""White space of XML."""
SCHEMA = "http://www.w3.org/2001/XMLSchema-instance"
"""Namespace of the attributes with the prefix xsi: here."""


@dataclass(slots=True, kw_only=True)
class Element:
    """One element: its place, tag, attributes and content; `quoted` has its CDATA sections."""

    file: str
    line: int
    tag: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    text: str = ""
    quoted: list[str] = field(default_factory=list)

    __repr__ = short_repr

    def fault(self, message: str, line: int | None = None) -> InputError:
        """Return an error with the place of this element, or of a line of its text."""
        return InputError(f"{self.file}, line {self.line if line is None else line}: {message}")

    def take(self, **expected: str) -> None:
        """Check that the attributes are these and no others."""
        if self.attributes != expected:
            raise self.fault(f"expected {_show(self.tag, expected)}, got {self.shown()}")

    def only(self, *tags: str) -> list[Element]:
        """Return the children, which must have these tags in this order."""
        if [child.tag for child in self.children] != list(tags) or self.text.strip(SPACE):
            raise self.fault(f"expected {' and '.join(tags) or 'nothing'} in {self.shown()}")
        return self.children

    def each(self, tag: str) -> list[Element]:
        """Return the children, which must all have this tag."""
        for child in self.children:
            if child.tag != tag:
                raise child.fault(f"expected <{tag}>, got {child.shown()}")
        if self.text.strip(SPACE):
            raise self.fault(f"text is not expected in {self.shown()}")
        return self.children

    def shown(self) -> str:
        """Return the beginning of the element, on one line."""
        return _show(self.tag, self.attributes)


def parse(file: str, text: str, tag: str, namespace: str) -> Element:
    """Return the root of a document; it must have the tag `tag` in `namespace`.

    Raises
    ------
    InputError
        The text is not XML, has a document type, a processing instruction, or another root.
    """
    top = Element(file=file, line=1, tag="", attributes={})
    stack, inside = [top], False
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    data = text.encode("utf-8", "surrogatepass")

    def start(name: str, attributes: dict[str, str]) -> None:
        space, _, local = name.rpartition(" ")
        if space != namespace:
            raise InputError(f"{file}, line {parser.CurrentLineNumber}: <{local}> is not expected")
        at = parser.CurrentByteIndex
        if b"&#" in data[at : data.find(b"<", at + 1)]:
            refuse()
        plain = {key.replace(f"{SCHEMA} ", "xsi:"): value for key, value in attributes.items()}
        made = Element(file=file, line=parser.CurrentLineNumber, tag=local, attributes=plain)
        stack[-1].children.append(made)
        stack.append(made)

    def end(name: str) -> None:
        stack.pop()

    def characters(data: str) -> None:
        if inside:
            stack[-1].quoted[-1] += data
        else:
            stack[-1].text += data

    def quote() -> None:
        nonlocal inside
        inside = True
        stack[-1].quoted.append("")

    def unquote() -> None:
        nonlocal inside
        inside = False

    def refuse(*_: object) -> None:
        raise InputError(
            f"{file}, line {parser.CurrentLineNumber}: a document type, a processing instruction "
            "or a character by its number is not expected in a project"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = characters
    parser.StartCdataSectionHandler, parser.EndCdataSectionHandler = quote, unquote
    parser.StartDoctypeDeclHandler = parser.ProcessingInstructionHandler = refuse
    try:
        parser.Parse(data, True)
    except InputError:
        raise
    except expat.ExpatError as error:
        raise InputError(f"{file}, line {error.lineno}: not XML ({error})") from None
    except (ValueError, LookupError) as error:  # an encoding that the parser does not have
        raise InputError(f"{file}, line {parser.CurrentLineNumber}: not XML ({error})") from None
    root = top.children[0]
    if root.tag != tag:
        raise root.fault(f"expected <{tag}>, got {root.shown()}")
    return root


def _show(tag: str, attributes: dict[str, str]) -> str:
    said = "".join(f" {key}={value!r}" for key, value in attributes.items())
    return f"<{tag}{said[:60]}>"


# -----------------------------------------------------------------------------
# VAL 3, the language of Staubli controllers: this module only formats.

ANGLES: Final = "XYZ"
"""rx, ry, rz turn about x, the new y, the new z."""
PROJECT = "http://www.staubli.com/robotics/VAL3/Project/3"
PROGRAM = "http://www.staubli.com/robotics/VAL3/Program/2"
DATA = "http://www.staubli.com/robotics/VAL3/Data/2"
HEAD = '<?xml version="1.0" encoding="utf-8"?>'
TYPES = {"jAir": "jointRx", "mAir": "mdesc", "pPath": "pointRx", "mPath": "mdesc"}
"""Types of the data that moves refer to."""
OUTPUTS = {"laser": "dioLaser", "gas": "dioGas", "gas_2": "dioGas2"}
PORTS = {
    ("ready", "input"): "diReady",
    ("shutter", "input"): "diShutter",
    ("gas_pressure", "input"): "diGasPressure",
    ("height", "input"): "diHeight",
    ("interlock", "input"): "diInterlock",
    ("ready", "output"): "doReady",
    ("shutter", "output"): "doShutter",
    ("height", "output"): "doHeight",
}
"""Names of the data of handshakes."""
FIRST = "nFirst"
"""Number of the contour at which the project begins, for a restart."""
UNBOUNDED = 'tmax="99999" rmax="99999"'
"""Speeds of tip and tool that limit nothing, the controller's own."""
AIR_SPEED = 'accel="100" vel="%s" decel="100" ' + UNBOUNDED
PATH_SPEED = 'accel="100" vel="100" decel="100" tmax="%s" rmax="99999"'
JOINTS = " ".join(f'j{i}="%.6f"' for i in range(1, 7))
POSE = 'x="%.4f" y="%.4f" z="%.4f" rx="%.6f" ry="%.6f" rz="%.6f"'
CONFIGURATION = 'shoulder="%s" elbow="%s" wrist="%s"'
AROUND = 40
"""Lines of a file beside those of its steps and their data."""
DATA_OF_A_STEP = 3
"""Largest number of data of a step: two points and a speed of a circular move."""


STACK_SIZE = 5000
"""Bytes that a project reserves; more do no harm."""


def parameters(settings: Val3Settings) -> dict[str, str]:
    """Return the parameters of a project."""
    version = settings.version or VERSIONS[settings.controller]
    return {"version": version, "stackSize": str(STACK_SIZE), "millimeterUnit": "true"}


def links(settings: Val3Settings) -> dict[str, str]:
    """Return the links of all inputs and outputs that the settings name, by their data."""
    named = {name: getattr(settings, f"{signal}_output") for signal, name in OUTPUTS.items()}
    named |= {PORTS[key]: link for key, link in handshakes(settings).items()}
    return {name: link for name, link in named.items() if link is not None}


def opening_lines(settings: Val3Settings) -> list[str]:
    """Return the statements of start() before it calls others."""
    return [*switch_off_lines(settings), *reset_lines(inherited(settings))]


def switch_off_lines(settings: Val3Settings) -> list[str]:
    """Return the statements that switch everything off."""
    inputs = [name for (_, way), name in PORTS.items() if way == "input"]
    return [f"{name}=false" for name in links(settings) if name not in inputs]


def wait_lines(awaited: Await, asked: Sequence[Handshake], settings: Val3Settings) -> list[str]:
    """Return the statements that wait for an input, and what is done without an answer.

    Everything is switched off, including the arm's power. Once the operator has switched that on
    again, what was `asked` for before is asked for again.
    """
    name = PORTS[awaited.partner, "input"]
    return [
        f"while watch({name}==true,{number(awaited.timeout, 3)})==false",
        *switch_off_lines(settings),
        "disablePower()",
        f'logMsg("{awaited.partner}: no answer")',
        "wait(isPowered())",
        *ask_again_lines(asked, PORTS, "{}=true", "wait({}==true)"),
        "endWhile",
    ]


def closing_lines() -> list[str]:
    """Return the last statements of start(), so that it begins with the first contour next time."""
    return ["waitEndMove()", f"{FIRST}=1"]


def stop_lines(settings: Val3Settings) -> list[str]:
    """Return the statements of stop(), which the controller calls when the project is stopped."""
    return [*switch_off_lines(settings), "resetMotion()"]


@dataclass(slots=True)
class _Database:
    """The data of one project that its moves refer to."""

    values: dict[str, list[str]] = field(default_factory=lambda: {name: [] for name in TYPES})
    places: dict[tuple[str, str], str] = field(default_factory=dict)

    def add(self, name: str, value: str) -> str:
        """Add a value, and return how routines name it."""
        self.values[name].append(value)
        return f"{name}[{len(self.values[name]) - 1}]"

    def shared(self, name: str, value: str) -> str:
        """Return how routines name a value; add the value if it is new."""
        if (name, value) not in self.places:
            self.places[name, value] = self.add(name, value)
        return self.places[name, value]


class Val3(Formatter):
    """Formatter of a project with a routine for each section, and of libraries if too long."""

    settings: Val3Settings
    too_long = "warning"

    def __init__(self, program: Program, settings: Val3Settings) -> None:
        short = replace(stop_to_switch(program), name=program.name[:LONGEST_NAME])
        super().__init__(rename_sections(short, (FIRST,), longest_name=LONGEST_NAME), settings)
        self._target = self._target_texts()
        self._database = _Database()
        self._moving = True
        counts = list(self.lengths().values())
        self._parts: dict[str, list[Section]] = {}
        if sum(counts) > self.room():
            self._parts = divide_program(self.program, counts, self.room(), LONGEST_NAME)

    def lengths(self) -> dict[str, int]:
        """Return how many lines of data each contour takes at most, by its name."""
        return {s.name: DATA_OF_A_STEP * len(s.steps) for s in self.program.sections}

    def room(self) -> int:
        """Return how many lines of contours a file has room for."""
        return super().room() - AROUND

    def files(self) -> dict[str, str]:
        """Return the files of the project, and those of the libraries that it calls."""
        name, sections = self.program.name, self.program.sections
        if not self._parts:
            return self._project(name, sections, [section.name for section in sections])
        calls = [f"{part}:{s.name}" for part, own in self._parts.items() for s in own]
        texts = self._project(name, (), calls)
        most, longest = self.settings.lines_per_file, max(t.count("\n") for t in texts.values())
        if longest > most:
            raise InputError(
                f"program {name!r}: {len(self._parts)} libraries need files of {longest} lines, "
                f"but lines_per_file allows {most}; raise it"
            )
        for part, own in self._parts.items():
            texts |= self._project(part, own, None)
        return texts

    def names(self) -> list[tuple[str, str]]:
        """Return every name of a project, routine or datum, with what it names."""
        return [
            (self.program.name, "the program"),
            *((part, "a library") for part in self._parts),
            *((section.name, "a contour") for section in self.program.sections),
            ("fPart", "the part's frame"),
            ("tLaser", "the tool"),
            *((name, f"the output of the {signal}") for signal, name in OUTPUTS.items()),
            *((name, f"the {way} of {who}") for (who, way), name in PORTS.items()),
            (FIRST, "the number of the first contour"),
            *((name, "the data of moves") for name in TYPES),
        ]

    def lines(self, section: Section) -> Iterator[str]:
        """Yield the lines of a section, at whose start the robot may be moving."""
        self._moving = True
        yield from super().lines(section)

    def joint_move(self, move: JointMove) -> Iterator[str]:
        """Yield a movej to joints."""
        value = AIR_SPEED % number(move.speed * 100, 2)
        speed = self._database.shared("mAir", f"{value} {_blend('joint', move)}")
        yield f"movej({self._database.add('jAir', self._target[move][0])},tLaser,{speed})"
        self._moving = True

    def linear_move(self, move: LinearMove) -> Iterator[str]:
        """Yield a movel and what is switched at its end."""
        yield from self._path_move("movel", move)

    def circular_move(self, move: CircularMove) -> Iterator[str]:
        """Yield a movec and what is switched at its end."""
        yield from self._path_move("movec", move)

    def wait(self, wait: Wait) -> Iterator[str]:
        """Yield a delay, once the robot has stopped."""
        yield from self.standing()
        yield f"delay({number(wait.time, 3)})"

    def request(self, request: Request) -> Iterator[str]:
        """Yield an output, once the robot has stopped."""
        yield from self.standing()
        yield f"{PORTS[request.partner, 'output']}={'true' if request.on else 'false'}"

    def wait_for(self, awaited: Await) -> Iterator[str]:
        """Yield a wait for an input, once the robot has stopped."""
        yield from self.standing()
        yield from wait_lines(awaited, self.asked, self.settings)

    def comment(self, text: str) -> Iterator[str]:
        """Yield a comment, which must not end the CDATA section that contains it."""
        yield f"// {text.replace(']]>', ']] >')}"

    def standing(self) -> Iterator[str]:
        """Yield the line that waits until the robot has stopped, if it may be moving."""
        if self._moving:
            yield "waitEndMove()"
        self._moving = False

    def _path_move(self, word: str, move: LinearMove) -> Iterator[str]:
        value = PATH_SPEED % number(move.speed * 1e3, 3)
        speed = self._database.shared("mPath", f"{value} {_blend('Cartesian', move)}")
        points = ",".join(self._database.add("pPath", text) for text in self._target[move])
        yield f"{word}({points},tLaser,{speed})"
        self._moving = True
        for switch in move.switches:
            yield from self.standing()
            self.output(switch.signal)
            state = " and ".join(self.needed(switch)) or ("true" if switch.on else "false")
            yield f"{OUTPUTS[switch.signal]}={state}"

    def needed(self, switch: Switch) -> list[str]:
        """Return the variables of the outputs that must be on for a switch to act."""
        return [
            OUTPUTS[SIGNALS[name]] if name in SIGNALS else PORTS[PARTNERS[name], "output"]
            for name in switch.needs
        ]

    def _project(
        self, name: str, sections: Sequence[Section], calls: Sequence[str] | None
    ) -> dict[str, str]:
        """Return the files of one project; without calls it is a library that is not started."""
        self._database = _Database()
        routines = {section.name: list(self.lines(section)) for section in sections}
        start = ["// A library: its routines are called."]
        if calls is not None:
            start = [*self._remarks(), *opening_lines(self.settings)]
            for n, call in enumerate(calls, 1):
                start += [f"if {FIRST}<={n}", f"  call {call}()", "endIf"]
            start += closing_lines()
        routines = {"start": start, "stop": stop_lines(self.settings), **routines}
        texts = {
            f"{name}.pjx": self._contents(name, routines, () if calls is None else self._parts)
        }
        texts[f"{name}.dtx"] = self._data(is_main=calls is not None)
        texts |= {f"{routine}.pgx": _routine(routine, code) for routine, code in routines.items()}
        return {f"{name}/{file}": text for file, text in texts.items()}

    def _contents(self, name: str, routines: Iterable[str], parts: Iterable[str]) -> str:
        folder = self.settings.folder
        rows = [f'<Project xmlns="{PROJECT}">']
        rows += [f"  {_tag('Parameters', **parameters(self.settings))}", "  <Programs>"]
        rows += [f"    {_tag('Program', file=f'{routine}.pgx')}" for routine in routines]
        rows += ["  </Programs>", "  <Database>", f"    {_tag('Data', file=f'{name}.dtx')}"]
        rows += ["  </Database>", "  <Libraries>"]
        paths = {part: f"{folder}{part}/{part}.pjx" for part in parts}
        rows += [f"    {_tag('Library', alias=part, path=path)}" for part, path in paths.items()]
        return _text([*rows, "  </Libraries>", "</Project>"])

    def _data(self, *, is_main: bool) -> str:
        settings = self.settings
        frame, tool = controller_frames(self.program)
        rows = [f'<Database xmlns:xsi="{SCHEMA}" xmlns="{DATA}">', "  <Datas>"]
        rows += _array("fPart", "frame", [f'{POSE % _poses(frame)[0]} fatherId="world[0]"'])
        own = f"ioLink={quoteattr(settings.tool_link)}"
        rows += _array("tLaser", "tool", [f'{POSE % _poses(tool)[0]} fatherId="flange[0]" {own}'])
        for name, link in links(settings).items():
            rows += _array(name, "dio", [f"link={quoteattr(link)}"])
        rows += _array(FIRST, "num", ['value="1"']) if is_main else []
        for name, values in self._database.values.items():
            rows += _array(name, TYPES[name], values)
        return _text([*rows, "  </Datas>", "</Database>"])

    def _remarks(self) -> Iterator[str]:
        head = self.head("fPart is the part in the world, which starts at axis 2.")
        stop = "stop() switches the laser off; the safety circuit of the cell has to, too."
        for remark in (*head, stop, f"To begin at a contour, set {FIRST} to its number."):
            yield from self.comment(remark)

    def _target_texts(self) -> dict[Move, list[str]]:
        """Return the targets of each move as texts for the data."""
        robot, moves = self.program.robot, self.program.moves
        joint = [move for move in moves if isinstance(move, JointMove)]
        texts: dict[Move, list[str]] = {move: [] for move in moves}
        if joint:
            axes_deg = np.degrees(axes_from_joints(robot, [m.q for m in joint])).round(6) + 0.0
            for target, row in zip(joint, axes_deg.tolist(), strict=True):
                texts[target].append(JOINTS % tuple(row))
        if points := targets_of(move for move in moves if isinstance(move, LinearMove)):
            words = posture(robot, np.array([q for _, q, _ in points]), self.settings)
            poses = _poses(np.array([T for _, _, T in points]))
            for (end, _, _), pose, three in zip(points, poses, words, strict=True):
                texts[end].append(f'{POSE % pose} {CONFIGURATION % three} fatherId="fPart[0]"')
        return texts


def _poses(T: Array | Sequence[Array]) -> list[tuple[float, ...]]:
    """Return poses (K, 4, 4) m as x, y, z in mm and rx, ry, rz in deg."""
    values = euler(T, ANGLES)
    rows = np.hstack([values[:, :3].round(4), values[:, 3:].round(6)]) + 0.0
    return [tuple(row) for row in rows.tolist()]


def _blend(kind: str, move: Move) -> str:
    if move.zone == 0:
        return 'blend="off"'
    zone = number(move.zone * 1e3, 4)
    return f'blend="{kind}" leave="{zone}" reach="{zone}"'


def _tag(tag: str, **attributes: str) -> str:
    return f"<{tag}{''.join(f' {k}={quoteattr(v)}' for k, v in attributes.items())} />"


def _array(name: str, kind: str, values: Sequence[str]) -> list[str]:
    """Return the lines of a datum; none if it would be empty."""
    if not values:
        return []
    size = len(values)
    head = f'    <Data name="{name}" access="private" xsi:type="array" type="{kind}" size="{size}">'
    rows = (f'      <Value key="{k}" {value} />' for k, value in enumerate(values))
    return [head, *rows, "    </Data>"]


def _routine(name: str, code: Sequence[str]) -> str:
    return _text(
        [
            f'<Programs xmlns:xsi="{SCHEMA}" xmlns="{PROGRAM}">',
            f'  <Program name="{name}" access="public">',
            "    <Code><![CDATA[begin",
            *(f"  {line}" for line in code),
            "end]]></Code>",
            "  </Program>",
            "</Programs>",
        ]
    )


def _text(rows: Iterable[str]) -> str:
    return "\n".join([HEAD, *rows, ""])
