"""Messages that the server sends to its pages; README.md in this folder defines their keys."""

from __future__ import annotations

from typing import Literal

from kerfpath.studio._clearance_messages import ClearanceMessage
from kerfpath.studio._map_messages import ShadeMessage, ShadeName, TechniqueMessage
from kerfpath.studio._numbers import Message, Numbers
from kerfpath.studio._part_messages import FaceEntry, LoopEntry, PartMessage
from kerfpath.studio._program_messages import FileEntry, FindingEntry, ProgramTextMessage

__all__ = [
    "BodyEntry",
    "CheckEntry",
    "ClearanceMessage",
    "CodeLayer",
    "ContourEntry",
    "ContourName",
    "CourseEntry",
    "CriteriaEntry",
    "Cycle",
    "EditEntry",
    "ErrorMessage",
    "Export",
    "FaceEntry",
    "FastestMessage",
    "Fault",
    "FileEntry",
    "FindingEntry",
    "JobMessage",
    "JointEntry",
    "LoopEntry",
    "LossEntry",
    "MapMessage",
    "NearestEntry",
    "NoPathMessage",
    "Option",
    "OutcomeMessage",
    "PartMessage",
    "PlanMessage",
    "PoseMessage",
    "ProgramMessage",
    "ProgramTextMessage",
    "ProgressMessage",
    "RobotEntry",
    "SampleEntry",
    "SceneMessage",
    "Segment",
    "ShadeMessage",
    "TechniqueMessage",
]


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
