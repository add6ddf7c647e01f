"""Changes that may make a path where there is none, as edits of the job."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict

from kerfpath.job import CutResult

# -----------------------------------------------------------------------------
# The base class of all messages of the server, and the numbers in them.

Numbers = list[float | None]
"""Numbers in a message; None (null in JSON) means infinity."""


def flat(values: ArrayLike, digits: int = 9) -> Numbers:
    """Return values as a flat row-major list; None replaces values that are not finite.

    Values are rounded to `digits` decimal places (a nanometre or finer) to keep messages short.
    """
    row = np.round(np.asarray(values, dtype=np.float64).ravel(), digits)
    if np.isfinite(row).all():
        kept: Numbers = row.tolist()
        return kept
    return [value if np.isfinite(value) else None for value in row.tolist()]


class Message(BaseModel):
    """A message of the server, one line of JSON; README.md defines its keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


# -----------------------------------------------------------------------------
# Messages about distances in the cell; README.md in this folder defines their keys.


class ClearanceMessage(Message):
    """The nearest pair of bodies at each node of a plan."""

    type: Literal["clearance"] = "clearance"
    revision: int
    contour: str
    name: str
    distance: Numbers
    over: Numbers
    pair: list[int]
    pairs: list[list[str]]


# -----------------------------------------------------------------------------
# Messages about other placements of the part; README.md in this folder defines their keys.


class OutOfReach(Message):
    """The nodes of a contour that the robot cannot reach."""

    name: str
    nodes: int
    out: list[int]


class ReachMessage(Message):
    """The nodes of each contour that the robot cannot reach at a placement."""

    type: Literal["reach"] = "reach"
    revision: int
    number: int
    middle: Numbers
    contours: list[OutOfReach]


class TryEntry(Message):
    """A placement that the search has tried."""

    number: int
    offsets: dict[str, float]
    status: str
    stage: str
    value: float | None
    bound: float | None
    estimate: float | None
    reason: str | None
    part: Numbers
    rest: Numbers


class LayoutMessage(Message):
    """The state of the search for the best placement."""

    type: Literal["layout"] = "layout"
    revision: int
    goal: str
    grid: bool
    unit: str
    best: list[TryEntry]
    tried: int
    feasible: int
    label: str
    done: int
    total: int
    state: Literal["running", "done", "stopped"]
    said: str


# -----------------------------------------------------------------------------
# Messages about shades and techniques on maps; README.md in this folder defines their keys.


class ShadeName(Message):
    """A quantity that the admitted poses of a map can be shaded by."""

    by: str
    words: str
    unit: str


class ShadeLayer(Message):
    """The values of a quantity over the map of one posture."""

    posture: int
    values: str
    nearest: str | None = None


class ShadeMessage(Message):
    """A quantity at every admitted pose of a contour."""

    type: Literal["shade"] = "shade"
    revision: int
    contour: str
    graph: str
    by: str
    words: str
    unit: str
    low: float
    high: float
    beyond: bool
    layers: list[ShadeLayer]
    pairs: list[list[str]]


class TechniqueMessage(Message):
    """The course of another technique along a contour, with its cost and peak shares."""

    type: Literal["technique"] = "technique"
    revision: int
    contour: str
    method: Literal["paper", "known"]
    s: Numbers
    gamma: Numbers
    posture: list[int]
    cost: float | None
    peak_velocity: Numbers
    peak_acceleration: Numbers
    statement: str
    notes: list[str]


# -----------------------------------------------------------------------------
# Messages about the part that is cut; README.md in this folder defines their keys.


class LoopEntry(Message):
    """A loop of the part, whether or not it is cut."""

    name: str
    face: str
    kind: Literal["outer", "inner", "open"]
    side: Literal["outer", "inner", "edge", ""]
    closed: bool
    length: float
    diameter: float | None
    gap: float
    points: Numbers


class FaceEntry(Message):
    """A run of triangles of the part's mesh, and the face that they belong to."""

    name: str
    triangles: int


class PartMessage(Message):
    """The loops and faces of the drawing that can be picked."""

    type: Literal["part"] = "part"
    revision: int
    loops: list[LoopEntry]
    faces: list[FaceEntry]
    left_out: int


# -----------------------------------------------------------------------------
# Messages about the text of a program; README.md in this folder defines their keys.


class FileEntry(Message):
    """A file of the program, its text, and the times of its lines."""

    name: str
    text: str
    lines: list[int]
    begin: Numbers
    end: Numbers


class FindingEntry(Message):
    """A finding of the preflight of a program, and its place."""

    level: str
    message: str
    place: str
    file: str | None
    line: int | None


class ProgramTextMessage(Message):
    """The program in a robot's language."""

    type: Literal["program_text"] = "program_text"
    language: str
    revision: int
    files: list[FileEntry]
    findings: list[FindingEntry]
    notes: list[str]
    faults: list[str]


# -----------------------------------------------------------------------------
# Messages that the server sends to its pages; README.md in this folder defines their keys.


class ContourName(Message):
    """A contour of the job, and the index of its [[contour]] table."""

    name: str
    index: int


class Fault(Message):
    """An error in the job, and the key that it concerns."""

    key: list[str | int]
    message: str


class JobMessage(Message):
    """The current job."""

    type: Literal["job"] = "job"
    revision: int
    name: str
    text: str
    values: dict[str, object] | None
    given: list[str]
    contours: list[ContourName]
    undo: bool
    redo: bool
    saved: bool
    faults: list[Fault]
    choices: dict[str, list[str]]
    weights: Numbers


class JointEntry(Message):
    """One joint of the robot, or an external axis."""

    name: str
    unit: Literal["rad", "m"]
    carries: Literal["robot", "part"] | None
    T: Numbers
    axis: Numbers
    lower: float | None
    upper: float | None
    endless: bool
    velocity: float
    acceleration: float


class RobotEntry(Message):
    """The chain of the robot, to the tip of its tool."""

    id: str
    joints: list[JointEntry]
    T_flange: Numbers
    T_tool: Numbers


class SampleEntry(Message):
    """Sample joints, and the pose of the tip there."""

    q: Numbers
    T: Numbers


class BodyEntry(Message):
    """A body of the scene, and the frame that it moves with."""

    name: str
    kind: Literal["robot", "head", "part", "fixture", "floor"]
    frame: int
    mesh: str
    approximate: bool


class ContourEntry(Message):
    """A contour of the scene, as it is cut."""

    name: str
    index: int
    loop: str
    closed: bool
    points: Numbers
    axes: Numbers
    s: Numbers
    kind: list[str]
    speed_m_min: float


class SceneMessage(Message):
    """The robot, bodies and contours of the cell."""

    type: Literal["scene"] = "scene"
    revision: int
    robot: RobotEntry
    sample: SampleEntry
    bodies: list[BodyEntry]
    T_part: Numbers
    contours: list[ContourEntry]
    cell: bool


class ProgressMessage(Message):
    """The progress of the server's work."""

    type: Literal["progress"] = "progress"
    busy: bool
    label: str = ""
    done: int = 0
    total: int = 0


class NearestEntry(Message):
    """The least value of a measure of comfort along a plan, and its node."""

    name: str
    value: float
    unit: str
    node: int


class CriteriaEntry(Message):
    """The criteria of a plan, joint by joint."""

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


class PlanMessage(Message):
    """One motion along a contour, or along a piece of one."""

    type: Literal["plan"] = "plan"
    revision: int
    contour: str
    name: str
    pieces: int
    graph: str
    s: Numbers
    time: Numbers
    q: Numbers
    gamma: Numbers
    posture: list[int]
    points: Numbers
    kind: list[str]
    speed: Numbers
    cost: float
    bound: float | None
    gap: float | None
    settled: bool
    optimal: bool
    statement: str
    method: str
    weights: Numbers
    previous_cost: float | None
    criteria: CriteriaEntry
    velocity_share: Numbers
    acceleration_share: Numbers
    joint_load: Numbers
    checks: list[CheckEntry] | None
    passed: bool | None
    feed: str | None
    seconds: float


class LossEntry(Message):
    """A reason of loss, and its count."""

    name: str
    count: int


class EditEntry(Message):
    """One key of the job and its new value."""

    path: list[str | int]
    value: object


class Option(Message):
    """A change that would make a path, as edits of the job."""

    label: str
    edits: list[EditEntry]


class NoPathMessage(Message):
    """The reason why a contour has no plan, and changes that would make a path."""

    type: Literal["nopath"] = "nopath"
    revision: int
    contour: str
    node: int
    back: int | None
    s: float
    point: Numbers
    statement: str
    scope: str
    reasons: list[LossEntry]
    graph: str
    relaxations: list[Option] | None
    remedy: str


class Segment(Message):
    """A stretch of the program."""

    kind: Literal["move", "approach", "pierce", "cut", "retract"]
    begin: float
    end: float
    contour: str | None = None
    plan: str | None = None
    time: Numbers | None = None
    q: Numbers | None = None


class ProgramMessage(Message):
    """The segments of the program in its order, with their times."""

    type: Literal["program"] = "program"
    revision: int
    total: float
    segments: list[Segment]
    checked: bool
    notes: list[str]


class Export(Message):
    """A file that can be exported."""

    name: str
    href: str
    ready: bool
    why: str = ""


class Cycle(Message):
    """The shares of a program's time, s."""

    cutting: float
    air: float
    piercing: float
    total: float


class OutcomeMessage(Message):
    """The result of a run of the job."""

    type: Literal["outcome"] = "outcome"
    revision: int
    passed: bool
    exports: list[Export]
    cycle: Cycle | None
    notes: list[str]


class CodeLayer(Message):
    """The map of one posture."""

    posture: int
    name: str
    codes: str


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
    gamma: Numbers
    nodes: int
    reasons: list[str]
    kinds: list[str]
    colours: list[str]
    layers: list[CodeLayer]
    hidden: list[str]
    external: str
    shades: list[ShadeName]
    course: list[CourseEntry]


class PoseMessage(Message):
    """The joints at one place of the map, and the reason if they are lost."""

    type: Literal["pose"] = "pose"
    contour: str
    node: int
    gamma: float
    posture: int
    q: Numbers | None
    admitted: bool
    reason: str


class FastestMessage(Message):
    """The fastest constant speed of a contour."""

    type: Literal["fastest"] = "fastest"
    revision: int
    contour: str
    speed_m_min: float
    on_grid_m_min: float | None
    binds: str
    edits: list[EditEntry]


class ErrorMessage(Message):
    """An error in one line."""

    type: Literal["error"] = "error"
    message: str
    about: str | None = None


# -----------------------------------------------------------------------------
# Messages about kept plans and Pareto sets; README.md in this folder defines their keys.


class KeptEntry(Message):
    """A job that is kept for comparison."""

    id: int
    name: str
    revision: int
    metric: str
    objective: str
    contours: list[str]
    cycle: Cycle | None
    settled: bool


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
    """The criteria of a run of the planner, and the edits that make its plan the job's."""

    number: int
    values: list[float]
    best: bool
    edits: list[EditEntry] | None


class FrontMessage(Message):
    """The points of a contour's Pareto set that have been found so far."""

    type: Literal["front"] = "front"
    revision: int
    contour: str
    axes: list[AxisEntry]
    points: list[PointEntry]
    done: int
    total: int
    state: Literal["running", "done", "stopped"]


class CandidateMessage(Message):
    """The motion of a point of the Pareto set; it is not the plan of the job."""

    type: Literal["candidate"] = "candidate"
    contour: str
    number: int
    plan: PlanMessage


# -----------------------------------------------------------------------------
# Changes that may make a path where there is none, as edits of the job.


def ways_of(cut: CutResult, index: int) -> list[Option]:
    """Return possible changes for a cut without a plan, first those that gave one.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan, with its advice.
    index : int
        Index of its [[contour]] table in the job.
    """
    found, advice = list[Option](), cut.advice
    if advice is not None:
        if advice.without_windows:
            pins = EditEntry(path=["contour", index, "gamma_windows"], value=None)
            found.append(Option(label="remove the pinned windows of gamma", edits=[pins]))
        if advice.other_method:
            found.append(_plan('search the grid exactly: method = "exact"', "method", "exact"))
        for speed in (advice.refined, advice.speed):
            if speed is not None:
                found.append(
                    Option(
                        label=f"cut slower: {speed} m/min instead of "
                        f"{cut.request.task.speed * 60:g} m/min",
                        edits=[
                            EditEntry(path=["contour", index, "speed_m_min"], value=float(speed))
                        ],
                    )
                )
        for key, value in advice.shares.items():
            which = "velocity" if key == "eta_velocity" else "acceleration"
            words = f"use more of the {which} limits: {key} = {value}"
            found.append(_plan(words, key, float(value)))
    return found + _untried(cut)


def _untried(cut: CutResult) -> list[Option]:
    """Return changes that have not been tried and that the other options allow."""
    found, options = list[Option](), cut.request.options
    plain = options.closure == "free" and options.rotation is None and options.objective == "sum"
    grid = options.method in ("continuous", "exact")
    if plain and grid and options.feed == "constant" and options.interruptions == "none":
        found.append(_plan('not tried: slow down where needed: feed = "dip"', "feed", "dip"))
        words = 'not tried: cut in the fewest pieces: interruptions = "fewest"'
        found.append(_plan(words, "interruptions", "fewest"))
    if options.postures is not None:
        found.append(_plan("not tried: allow every posture", "posture", None))
    return found


def _plan(label: str, key: str, value: object) -> Option:
    return Option(label=label, edits=[EditEntry(path=["plan", key], value=value)])
