"""The protocol of the studio: the messages of its server and of its pages.

The models are the whole definition: the types of the page (client/messages.d.ts) and the table of
messages in the documentation are made from them, by docs/_ext/reference/studio_messages.py.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, TypeAdapter

from kerfpath.job import VARIABLES, Goal

_T = TypeVar("_T")
Numbers = list[float]
"""Numbers in a message."""
OpenNumbers = list[float | None]
"""Numbers in a message; None (null in JSON) means infinity."""


def flat(values: ArrayLike, digits: int = 9) -> Numbers:
    """Return values as a flat row-major list.

    Values are rounded to `digits` decimal places (a nanometre or finer) to keep messages short.
    """
    row: Numbers = np.round(np.asarray(values, dtype=np.float64).ravel(), digits).tolist()
    return row


def flat_or_none(values: ArrayLike, digits: int = 9) -> OpenNumbers:
    """Return values as `flat` does; None replaces values that are not finite."""
    return [value if np.isfinite(value) else None for value in flat(values, digits)]


class Message(BaseModel):
    """A message of the server, one line of JSON, or an entry of one."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ContourName(Message):
    """A contour of the job."""

    name: str
    index: int
    """Index of its table in `contour`; contours of a `pick_all` share it."""


class Fault(Message):
    """An error in the job."""

    key: list[str | int]
    """The key that it concerns, as a path; possibly empty."""
    line: int | None
    """The line of the text, from 1 on; null if it concerns none."""
    message: str


class JobMessage(Message):
    """The current job."""

    type: Literal["job"] = "job"
    revision: int
    name: str
    """Name of the file."""
    text: str
    values: dict[str, Any] | None
    """Its tables with every key and its default, in the units of their names; null if the text is
    not a valid job."""
    given: list[str]
    """The dotted keys that are in the text, such as `contour.0.speed_m_min`."""
    contours: list[ContourName]
    undo: bool
    """Whether there is a step back; `redo`: a step forward."""
    redo: bool
    saved: bool
    """Whether the file has this text."""
    faults: list[Fault]
    weights: Numbers
    """The weights (n, 1/rad or 1/m) that apply if the job has none."""


class Companion(Message):
    """A key that is set and removed together with another one."""

    key: str
    value: Any
    """The value that it gets if it has none; null: it is only removed."""


class OptionField(Message):
    """A key of the job that has a control."""

    key: str
    """Its dotted path; `contour.x` is x of the chosen contour's table."""
    label: str
    kind: Literal["number", "choice", "switch", "table", "list", "joints"]
    unit: str = ""
    choices: list[str] = []
    default: Any = None
    low: float | None = None
    """The least value, if there is one."""
    high: float | None = None
    """The largest value, if there is one."""
    help: str = ""
    """What it takes, in words."""
    needs: str | None = None
    """A key without which this one has no meaning."""
    required: bool = False
    """Whether a job cannot be without it."""
    table: str | None = None
    """A table that requires this key and is removed with it."""
    companion: Companion | None = None


class OptionGroup(Message):
    """Fields under one title."""

    title: str
    contour: bool
    """Whether they are keys of the chosen contour."""
    fields: list[OptionField]


class Sampling(Message):
    """One of the ways to place the nodes of a contour."""

    label: str
    field: OptionField
    """Its required key, the first one of all."""
    keys: list[str]
    usual: float


class Variable(Message):
    """An offset of part, robot base or head that a search for the best placement may vary."""

    key: str
    """Its name in `[layout]`, in requests and in offsets."""
    label: str
    unit: str
    usual: Numbers
    """The least and the largest value of its usual range."""
    varies: bool
    """Whether it varies if the job has no range at all."""


class RobotChoice(Message):
    """A robot of the library; `/robot/ID.svg` is its picture."""

    id: str
    maker: str
    model: str
    joints: int
    kinematics: str
    reach: float | None
    """m"""
    payload: float | None
    """kg"""
    ratio: str | None
    """The nearest ratio of acceleration to velocity, if its accelerations are not known."""
    missing: str
    """What a job must give, as it is not known."""
    languages: list[str]
    """Those of its controllers."""


class OptionsMessage(Message):
    """The form of options of the job: which keys have a control, and what it must know of them."""

    type: Literal["options"] = "options"
    groups: list[OptionGroup]
    samplings: list[Sampling]
    goals: dict[str, str]
    """The goals of a search for the best placement, in words."""
    variables: list[Variable]
    criteria: list[str]
    """The criteria of a Pareto set."""
    languages: list[str]
    """The languages of a program."""
    robots: list[RobotChoice] = []
    """The library."""
    heads: list[str] = []
    """The shipped heads."""
    suffixes: list[str] = []
    """Ends of the names of drawings that can be read, with their dots."""
    units: list[str] = []
    """Units of a drawing."""
    solids: list[str] = []
    """Ends of the names of files with a solid, as of a fixture, with their dots."""
    solid_units: list[str] = []
    """Units of a mesh in such a file."""


class JointEntry(Message):
    """A joint of the robot, or an external axis."""

    name: str
    unit: Literal["rad", "m"]
    """Of its values."""
    carries: Literal["robot", "part"] | None
    """What an external axis moves; null for a joint of the arm."""
    T: Numbers
    """Its frame at angle 0 in the frame of the previous joint; for the first joint and for external
    axes: in the base."""
    axis: Numbers
    """A unit vector (3) in its own frame."""
    lower: float | None
    """Null for endless joints, as `upper`."""
    upper: float | None
    endless: bool
    velocity: float
    acceleration: float


class RobotEntry(Message):
    """The chain of the robot, to the tip of its tool."""

    id: str
    joints: list[JointEntry]
    """Those of the arm, then the external axes."""
    T_flange: Numbers
    """In the last frame."""
    T_tool: Numbers
    """The tip in the flange."""


class SampleEntry(Message):
    """Joints, and the pose of the tip there in the room, to check the page's kinematics."""

    q: Numbers
    T: Numbers


class BodyEntry(Message):
    """A body of the scene."""

    name: str
    kind: Literal["robot", "head", "part", "fixture", "floor"]
    frame: int
    """Number of the frame that it moves with."""
    mesh: str
    """An id for `/mesh/ID`, in coordinates of that frame."""
    approximate: bool
    """Whether the shape replaces one that is not known."""
    colour: str = ""
    """In CSS notation; "": that of its kind."""


class ContourEntry(Message):
    """A contour of the scene, as it is cut."""

    name: str
    index: int
    """As in `job`."""
    loop: str
    """The name of its loop of the part."""
    closed: bool
    points: Numbers
    """(K 3)"""
    axes: Numbers
    """(K 3)"""
    s: Numbers
    """(K) m from its start."""
    kind: list[str]
    """(K), as in trajectory.csv: `"cut"`, `"lead-in"`, ..."""
    speed_m_min: float


class SceneMessage(Message):
    """The robot, bodies and contours of the cell; only robot and head until the drawing is read."""

    type: Literal["scene"] = "scene"
    revision: int
    robot: RobotEntry
    sample: SampleEntry
    bodies: list[BodyEntry]
    T_part: Numbers
    """Pose of the part in the base."""
    contours: list[ContourEntry]
    cell: bool
    """Whether the job has a `[cell]`, so that plans keep clear of these bodies."""


class LoopEntry(Message):
    """A loop of the part, whether or not it is cut."""

    name: str
    face: str
    kind: Literal["outer", "inner", "open"]
    """`inner`: a hole."""
    side: Literal["outer", "inner", "edge", "blind", "sunk", ""]
    """Of a sheet."""
    closed: bool
    """False for a loop that cannot be cut because of its gap."""
    length: float
    """m"""
    diameter: float | None
    """m; null if it is not round."""
    gap: float
    """m, the largest between two of its edges."""
    points: Numbers
    """(m 3), which repeat the first one at the end if it is drawn closed."""


class FaceEntry(Message):
    """A run of triangles of the part's mesh."""

    name: str
    """The face or skin that they belong to."""
    triangles: int


class PartMessage(Message):
    """The loops and faces of the drawing that can be picked."""

    type: Literal["part"] = "part"
    revision: int
    T: Numbers
    """Pose of the part in the base, in which the loops are given."""
    loops: list[LoopEntry]
    faces: list[FaceEntry]
    """In the order of the mesh."""
    left_out: int
    """The number of loops that are not sent: those of the pieces of skins, those around the
    thickness of a sheet, and those beyond the 3000 longest."""


class ProgressMessage(Message):
    """The progress of the server's work."""

    type: Literal["progress"] = "progress"
    busy: bool
    """Whether anything is being computed."""
    label: str = ""
    """The step."""
    done: int = 0
    total: int = 0
    """0 if the total is not known."""


class NearestEntry(Message):
    """The least value of a measure of comfort along a plan."""

    name: str
    value: float | None
    unit: str
    node: int


class CriteriaEntry(Message):
    """The criteria of a plan: one number for each joint."""

    displacement: Numbers
    largest_increment: Numbers
    range: Numbers
    peak_velocity: Numbers
    peak_acceleration: Numbers
    nearest: list[NearestEntry]


class CheckEntry(Message):
    """One line of the audit."""

    code: str
    title: str
    value: float | None
    limit: float | None
    unit: str
    level: str
    ok: bool
    node: int | None


class ExecutedEntry(Message):
    """The tool tip as the joints execute a plan, beside the path as drawn."""

    drawn: Numbers
    """(M 3) m, the points of the path that are nearest to the tip."""
    tip: Numbers
    """(M 3) m, at instants that are evenly spread."""
    largest: float
    """m, the largest distance of the two."""
    joints: str
    """How the joints follow what is commanded, and whether that is assumed, fitted or measured."""


class PlanMessage(Message):
    """One motion along a contour, or along a piece of one."""

    type: Literal["plan"] = "plan"
    revision: int
    contour: str
    name: str
    """Of the plan, with a number for a piece of an interrupted cut."""
    pieces: int
    """The number of plans of the contour."""
    graph: str
    """The id of its map."""
    s: Numbers
    """(K) m from the start of the contour."""
    time: Numbers
    """(K)"""
    q: Numbers
    """(K n), endless joints not wrapped."""
    gamma: Numbers
    """(K)"""
    posture: list[int]
    """(K)"""
    points: Numbers
    """(K 3)"""
    kind: list[str]
    """(K), as in `scene`."""
    speed: Numbers
    """(K-1) m/s between nodes."""
    cost: float
    bound: float | None
    """Null while not known, as `gap`."""
    gap: float | None
    """A fraction."""
    settled: bool
    """False while a bound is being computed."""
    optimal: bool
    statement: str
    method: str
    """Of the search."""
    weights: Numbers
    """(n) 1/rad or 1/m that were used."""
    previous_cost: float | None
    criteria: CriteriaEntry
    velocity_share: Numbers
    """((K-1) n), signed, of the limit of each joint."""
    acceleration_share: Numbers
    """((K-2) n), signed, of the limit of each joint."""
    joint_load: Numbers
    """(K), the largest share at each node."""
    checks: list[CheckEntry] | None
    """The audit, null until it is complete."""
    passed: bool | None
    """Whether it passes; null until it is complete."""
    executed: ExecutedEntry | None
    """Null until the audit is complete, and if the robot stops at every node."""
    feed: str | None
    """In words."""
    seconds: float
    """The time of the search."""


class ClearanceMessage(Message):
    """The distances of bodies in the `[cell]` along a plan, sent once all plans are found.

    Pairs with a near-miss distance of their own, such as the nozzle and the part, are left out:
    they are always near.
    """

    type: Literal["clearance"] = "clearance"
    revision: int
    contour: str
    name: str
    """Of the plan."""
    distance: OpenNumbers
    """(K) m of the nearest pair, negative if they overlap."""
    over: OpenNumbers
    """(K) m, the distance beyond the near-miss distance of that pair."""
    pair: list[int]
    """(K), the index of that pair in `pairs`."""
    pairs: list[list[str]]
    """Two names of bodies each."""


class LossEntry(Message):
    """A reason of loss."""

    name: str
    count: int


class EditEntry(Message):
    """One key of the job and its new value."""

    path: list[str | int]
    value: Any


class Relaxation(Message):
    """A change that would make a path."""

    label: str
    edits: list[EditEntry]


class NoPathMessage(Message):
    """Why a contour has no plan, and changes that would make a path."""

    type: Literal["nopath"] = "nopath"
    revision: int
    contour: str
    node: int
    """The last one that is reached; -1: none."""
    back: int | None
    """The first node from which the end is reached."""
    s: float
    """Of `node`."""
    point: Numbers
    """(3)"""
    statement: str
    """One line."""
    scope: Literal["every gamma", "grid", "undecided"]
    """Of the proof."""
    reasons: list[LossEntry]
    """The reasons of loss there."""
    graph: str
    relaxations: list[Relaxation] | None
    """Null while they are being searched for."""
    remedy: str
    """The same in words."""


class Segment(Message):
    """A stretch of the program."""

    kind: Literal["move", "approach", "pierce", "cut", "retract"]
    """`move`: a transfer move."""
    begin: float
    end: float
    contour: str | None = None
    """Null for moves."""
    plan: str | None = None
    """For a cut, the name of its plan, whose `time` and `q` apply from `begin` on."""
    time: Numbers | None = None
    """(m), from `begin` on; null for a cut."""
    q: Numbers | None = None
    """(m n), linear in between; null for a cut."""


class ProgramMessage(Message):
    """The segments of the program in its order, on its clock."""

    type: Literal["program"] = "program"
    revision: int
    total: float
    """s"""
    segments: list[Segment]
    """Empty without a program; then `notes` has the reason."""
    checked: bool
    """Whether the moves are proved clear."""
    notes: list[str]
    """Sentences."""


class Export(Message):
    """A file that can be exported, or why it cannot."""

    name: str
    about: str
    href: str
    ready: bool
    why: str = ""
    remedy: str = ""
    """What `edits` do, in words."""
    edits: list[EditEntry] = []
    """Changes of the job that make it ready, as far as is known."""


class Cycle(Message):
    """The shares of a program's time, s."""

    cutting: float
    air: float
    piercing: float
    total: float


class OutcomeMessage(Message):
    """The result of a run of the job, once it is complete."""

    type: Literal["outcome"] = "outcome"
    revision: int
    passed: bool
    exports: list[Export]
    cycle: Cycle | None
    notes: list[str]
    """Sentences."""


class ShadeName(Message):
    """A quantity that the admitted poses of a map can be shaded by."""

    by: str
    """`clearance` (with a `[cell]`: the least distance of a pair beyond its near-miss distance,
    without pairs that have a distance of their own), a measure of `kerfpath.comfort`, or `turns`,
    the number of turns on which a pose is admitted."""
    words: str
    unit: str
    """`""`: a number."""


class CodeLayer(Message):
    """The map of one posture."""

    posture: int
    name: str
    codes: str
    """Base64 of K m bytes, all gamma of a node in a row."""


class CourseEntry(Message):
    """Gamma and posture of a plan along the map."""

    name: str
    s: Numbers
    gamma: Numbers
    posture: list[int]


class MapMessage(Message):
    """The map of a contour: the reason of loss of every pose."""

    type: Literal["map"] = "map"
    revision: int
    contour: str
    graph: str
    s: Numbers
    """(K)"""
    gamma: Numbers
    """(m) ascending in (-pi, pi], evenly spaced except at the ends of windows."""
    nodes: int
    """K"""
    reasons: list[str]
    """The words of the codes."""
    kinds: list[str]
    """For each code a word that decides its colour: `admitted`, `reach`, `joint`, `margin`, `cell`,
    `pinned`, `unwanted`, `other`."""
    colours: list[str]
    """For each code its colour in the report, distinct for every type of colour vision."""
    layers: list[CodeLayer]
    hidden: list[str]
    """Sentences about the postures without a layer."""
    external: str
    """A sentence on the external axes at its poses, `""` without any."""
    shades: list[ShadeName]
    course: list[CourseEntry]
    """Of the plans."""


class ShadeLayer(Message):
    """The values of a quantity over the map of one posture."""

    posture: int
    values: str
    """Base64 of K m bytes like `codes`, from 0 for `low` to 253 for `high`; 254: bodies are closer
    than allowed, 255: no pose is admitted. Of several poses, on several turns or with several
    tilts, the highest value counts."""
    nearest: str | None = None
    """As many bytes, the index of the nearest pair in `pairs`, 255: none."""


class ShadeMessage(Message):
    """A quantity at every admitted pose of a map."""

    type: Literal["shade"] = "shade"
    revision: int
    contour: str
    graph: str
    """Of that map."""
    by: str
    """As in its `shades`."""
    words: str
    unit: str
    low: float
    """The end of the scale, in the unit."""
    high: float
    """The other end."""
    beyond: bool
    """Whether values are lower bounds, sent up to `high` only."""
    layers: list[ShadeLayer]
    pairs: list[list[str]]
    """Two names of bodies each."""


class TechniqueMessage(Message):
    """The course of another technique on the same layered graph.

    It has the metric, weights and limits of the job that the technique has.
    """

    type: Literal["technique"] = "technique"
    revision: int
    """Of the plan that it is compared with."""
    contour: str
    method: Literal["paper", "known"]
    s: Numbers
    """As in `course`, with `gamma` and `posture`; empty if it finds no path."""
    gamma: Numbers
    posture: list[int]
    cost: float | None
    peak_velocity: OpenNumbers
    """(n), shares of the limit of each joint."""
    peak_acceleration: OpenNumbers
    """(n)"""
    statement: str
    """Its claim, or why there is no path."""
    notes: list[str]
    """Sentences on the options of the job that it ignores."""


class PoseMessage(Message):
    """The joints at one place of the map."""

    type: Literal["pose"] = "pose"
    contour: str
    node: int
    gamma: float
    posture: int
    q: Numbers | None
    """(n); null if the robot cannot reach the pose."""
    admitted: bool
    reason: str
    """One line with numbers, and with the joints on each turn if there are several."""


class FastestMessage(Message):
    """The fastest constant speed of a contour."""

    type: Literal["fastest"] = "fastest"
    revision: int
    contour: str
    speed_m_min: float
    on_grid_m_min: float | None
    binds: str
    """One line."""
    edits: list[EditEntry]


class FileEntry(Message):
    """A file of the program."""

    name: str
    text: str
    lines: list[int]
    """The numbers, from 1 on, of its lines that move or wait; empty if the language is not read
    back."""
    begin: Numbers
    """Their times, s, on the clock of `program`."""
    end: Numbers


class FindingEntry(Message):
    """A finding of the preflight of a program."""

    level: str
    """`error` or `warning`."""
    message: str
    place: str
    file: str | None
    """Null if it concerns no line, as `line`."""
    line: int | None


class ProgramTextMessage(Message):
    """The program in a robot's language."""

    type: Literal["program_text"] = "program_text"
    language: str
    revision: int
    files: list[FileEntry]
    findings: list[FindingEntry]
    notes: list[str]
    """Sentences, as `faults`."""
    faults: list[str]


class KeptEntry(Message):
    """A job that is kept for comparison; its plans are at `/kept/ID`."""

    id: int
    name: str
    revision: int
    metric: str
    objective: str
    contours: list[str]
    """The names of those that have plans."""
    cycle: Cycle | None
    settled: bool
    """False while a bound of its plans is being computed."""


class KeptMessage(Message):
    """The jobs that are kept for comparison."""

    type: Literal["kept"] = "kept"
    plans: list[KeptEntry]


class AxisEntry(Message):
    """A criterion of a Pareto set."""

    name: str
    words: str
    unit: str
    better: Literal["more", "less"]


class PointEntry(Message):
    """A run of the planner."""

    number: int
    values: Numbers
    """Of the axes, in their units."""
    best: bool
    """Whether no other point is as good in all criteria and better in one."""
    edits: list[EditEntry] | None
    """They make its plan the job's; null if a job has no keys for its settings."""


class FrontMessage(Message):
    """The points of a contour's Pareto set that have been found so far."""

    type: Literal["front"] = "front"
    revision: int
    contour: str
    axes: list[AxisEntry]
    points: list[PointEntry]
    done: int
    """Runs."""
    total: int
    state: Literal["running", "done", "stopped"]


class CandidateMessage(Message):
    """The motion of a point of the Pareto set; it is not the plan of the job."""

    type: Literal["candidate"] = "candidate"
    contour: str
    number: int
    plan: PlanMessage
    """Its `checks` are null."""


class OutOfReach(Message):
    """The nodes of a contour that the robot reaches at no gamma and in no posture of the job."""

    name: str
    nodes: int
    """The number of nodes."""
    out: list[int]


class ReachMessage(Message):
    """The nodes of each contour that the robot cannot reach at a placement.

    The cell is not checked.
    """

    type: Literal["reach"] = "reach"
    revision: int
    """Of the scene that it refers to."""
    number: int
    """Of the question."""
    middle: Numbers
    """(3) m, the point about which the part turns."""
    contours: list[OutOfReach]


class TryEntry(Message):
    """A placement that the search has tried."""

    number: int
    offsets: dict[str, float]
    status: Literal["feasible", "speed", "collision", "unreachable"]
    stage: str
    """The test that decided."""
    value: float | None
    bound: float | None
    """What it cannot beat."""
    estimate: float | None
    reason: str | None
    """Why it is infeasible."""
    part: Numbers
    """The pose that moves the part in the robot's base."""
    rest: Numbers
    """The same for everything else except the robot."""


class LayoutMessage(Message):
    """The search for the best placement."""

    type: Literal["layout"] = "layout"
    revision: int
    goal: Literal["speed", "margin", "motion"]
    grid: bool
    """As requested."""
    unit: str
    """Of its values."""
    best: list[TryEntry]
    """The best 20 of the placements that were tried: first those with a value, then estimates, then
    infeasible ones."""
    tried: int
    """The number of placements; `feasible`: of those that are."""
    feasible: int
    label: str
    """The progress, with `done` and `total`."""
    done: int
    total: int
    state: Literal["running", "done", "stopped"]
    said: str
    """A final sentence on what is known of the other placements."""


class ErrorMessage(Message):
    """An error."""

    type: Literal["error"] = "error"
    message: str
    """One line."""
    about: str | None = None
    """The type of the message that it answers."""


Said = (
    JobMessage
    | OptionsMessage
    | SceneMessage
    | PartMessage
    | ProgressMessage
    | PlanMessage
    | ClearanceMessage
    | NoPathMessage
    | ProgramMessage
    | OutcomeMessage
    | MapMessage
    | ShadeMessage
    | TechniqueMessage
    | PoseMessage
    | FastestMessage
    | ProgramTextMessage
    | KeptMessage
    | FrontMessage
    | CandidateMessage
    | ReachMessage
    | LayoutMessage
    | ErrorMessage
)
"""A message of the server."""


MOST_KEYS = 6
"""Largest number of parts in the path of a key: no job nests deeper."""
MOST_EDITS = 50
"""Largest number of keys that change in one step: no table of a job has more."""
MOST_WORDS = 200
"""Largest number of characters in a name: no contour has a longer one."""
MOST_LOOPS = 500
"""Largest number of loops that are added at once."""
MOST_TEXT = 10_000_000
"""Largest number of characters of a job, the limit of its reader."""


FARTHEST = 1e5
"""Largest offset of a placement, mm or deg."""


def _of_variables(table: dict[str, _T]) -> dict[str, _T]:
    """Return a table whose keys are variables of a layout."""
    if not table.keys() <= set(VARIABLES):
        raise ValueError(f"expected variables out of {', '.join(VARIABLES)}")
    return table


def _rising(span: tuple[float, float]) -> tuple[float, float]:
    if not span[0] < span[1]:
        raise ValueError("expected a range from a smaller to a larger value")
    return span


Words = Annotated[str, Field(max_length=MOST_WORDS)]
Index = Annotated[int, Field(ge=0, lt=1_000_000)]
Offset = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Offsets = Annotated[dict[str, Offset], AfterValidator(_of_variables)]
Span = Annotated[tuple[Offset, Offset], Field(strict=False), AfterValidator(_rising)]
Ranges = Annotated[dict[str, Span], Field(min_length=1), AfterValidator(_of_variables)]
Path = Annotated[tuple[Words | Index, ...], Field(min_length=1, max_length=MOST_KEYS, strict=False)]


class Strict(BaseModel):
    """A message of a page, or an entry of one; it refuses unknown keys and cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Edit(Strict):
    """Sets one key of the job; null removes it."""

    type: Literal["edit"]
    path: Path
    """As `["plan", "weights"]` or `["contour", 0, "speed_m_min"]`."""
    value: JsonValue
    gesture: Words | None = None
    """Any text, one for each drag of a slider: edits of the same `path` with the same gesture are
    one step of undo."""


class Change(Strict):
    """One key of the job and its new value; null removes it."""

    path: Path
    value: JsonValue


class Edits(Strict):
    """Sets several keys of the job, in one step of undo."""

    type: Literal["edits"]
    edits: Annotated[tuple[Change, ...], Field(min_length=1, max_length=MOST_EDITS, strict=False)]


class ReplaceText(Strict):
    """Replaces the text of the job."""

    type: Literal["text"]
    text: Annotated[str, Field(max_length=MOST_TEXT)]


class Command(Strict):
    """Goes one step back or forward, plans again, for example after `cancel`, or stops all work."""

    type: Literal["undo", "redo", "plan", "cancel"]


class Save(Strict):
    """Writes the job file.

    If the file has changed since it was read, this is refused, unless `over` is true.
    """

    type: Literal["save"]
    over: bool = False


class ContourRequest(Strict):
    """Plans a contour first from now on, asks for its `map`, or searches for its fastest speed."""

    type: Literal["focus", "map", "fastest"]
    contour: Words


class PoseRequest(Strict):
    """Asks for `pose`: the joints there, and the reason if they are lost."""

    type: Literal["reason"]
    contour: Words
    node: Index
    gamma: float
    posture: Annotated[int, Field(ge=0, lt=64)]


class ShadeRequest(Strict):
    """Asks for `shade`; a newer request of a page replaces the one before."""

    type: Literal["shade"]
    contour: Words
    by: Words | None
    """Null stops the computation."""


class TechniqueRequest(Strict):
    """Asks for `technique`."""

    type: Literal["technique"]
    contour: Words
    method: Literal["paper", "known"] | None
    """Null stops the computation."""


class Relax(Strict):
    """Makes the edits of one of the relaxations of `nopath`, as one step of undo."""

    type: Literal["relax"]
    contour: Words
    index: Index


class CutLoops(Strict):
    """Makes loops of the part contours of the job, as one step of undo.

    Each is cut like the most similar contour.
    """

    type: Literal["cut"]
    loops: Annotated[tuple[Words, ...], Field(min_length=1, max_length=MOST_LOOPS, strict=False)]
    """Their names."""
    alone: bool = False
    """Whether the job then cuts these loops alone: those that it cuts already stay, all others
    go."""


class RemoveContour(Strict):
    """Removes this table of `contour` from the job."""

    type: Literal["leave"]
    index: Index


class Keep(Strict):
    """Keeps the current job with its plans for comparison."""

    type: Literal["keep"]
    name: Words | None = None
    """By default the next letter."""


class Rename(Strict):
    """Renames a kept job."""

    type: Literal["rename"]
    id: Index
    name: Words


class KeptCommand(Strict):
    """Makes the text of a kept job that of the job, as one step of undo, or drops a kept job."""

    type: Literal["restore", "forget"]
    id: Index


class FrontRequest(Strict):
    """Searches for the Pareto set of a contour; answered by `front`."""

    type: Literal["front"]
    contour: Words
    criteria: Annotated[tuple[Words, ...], Field(min_length=2, max_length=5, strict=False)]
    """Words of the `criteria` of `options`."""
    runs: Annotated[int, Field(ge=10, le=1000)]


class CandidateRequest(Strict):
    """Asks for `candidate`, the motion of a point of that set."""

    type: Literal["point"]
    contour: Words
    number: Index


class ReachRequest(Strict):
    """Asks for `reach`.

    If several questions wait, only the newest is answered.
    """

    type: Literal["reach"]
    offsets: Offsets
    """Moves of part, robot base and head from their places in `scene`, mm or deg, by the variables
    of `[layout]`."""
    number: Index


class Place(Strict):
    """Applies offsets, as in `reach`, to the job, as one step of undo."""

    type: Literal["place"]
    scene: Index
    """The `revision` of the scene that they refer to; if there is a newer one, this is refused."""
    offsets: Offsets


class LayoutRequest(Strict):
    """Searches for the best placement, as `kerfpath layout` does; answered by `layout`."""

    type: Literal["layout"]
    goal: Goal
    ranges: Ranges
    """Of offsets, by variable: `[least, most]`."""
    evaluations: Annotated[int, Field(ge=8, le=100_000)]
    grid: bool
    """Whether placements are judged as with `method = "exact"`, whatever the job has."""


class Take(Strict):
    """Applies a placement of that search to the job, as one step of undo."""

    type: Literal["take"]
    number: Index


class ProgramRequest(Strict):
    """Asks for `program_text`."""

    type: Literal["program"]
    language: Words | None = None
    """By default that of the job."""


Request = (
    Edit
    | Edits
    | ReplaceText
    | Command
    | Save
    | ContourRequest
    | PoseRequest
    | ShadeRequest
    | TechniqueRequest
    | Relax
    | CutLoops
    | RemoveContour
    | Keep
    | Rename
    | KeptCommand
    | FrontRequest
    | CandidateRequest
    | ReachRequest
    | Place
    | LayoutRequest
    | Take
    | ProgramRequest
)
"""A message of a page."""

_REQUEST: TypeAdapter[Request] = TypeAdapter(Annotated[Request, Field(discriminator="type")])


def parse(text: str) -> Request:
    """Return the message in a JSON text of a page.

    Raises
    ------
    pydantic.ValidationError
        The text is not one of the messages.
    """
    return _REQUEST.validate_json(text)
