"""Planning options: one object with every option, and the rules for combining them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, in_radians, require_keywords, short_repr
from kerfpath.certificate import USUAL, Certify
from kerfpath.comfort import Comfort
from kerfpath.contour import FrameKind
from kerfpath.effort import current_effort
from kerfpath.errors import InputError, OptionConflict
from kerfpath.limits import Limits
from kerfpath.robots import Robot, postures_named
from kerfpath.search import Closure, Method, Metric, ObjectiveKind, rotation_limits
from kerfpath.setting import Settings, check, documented, setting
from kerfpath.tilt import Tilt
from kerfpath.windows import GammaWindow

__all__ = [
    "EXACT_OR_BETTER",
    "BetweenNodes",
    "FeedKind",
    "GraphKeywords",
    "Interpolation",
    "Interruptions",
    "OptionConflict",
    "PlanKeywords",
    "PlanMethod",
    "PlanOptions",
    "with_keywords",
]

MOST_TURNS = 10
"""Most turns that the rotation of a hose may be limited to; more was meant in deg."""
PlanMethod = Literal["continuous", Method]
FeedKind = Literal["constant", "dip"]
Interruptions = Literal["none", "fewest"]
BetweenNodes = Literal["reported", "kept", "guaranteed"]
Interpolation = Literal["linear", "joint"]


class GraphKeywords(TypedDict, total=False):
    """The options that the layered graph depends on."""

    gamma_step: float
    frames: FrameKind
    tilt: Tilt | None
    postures: Sequence[int | str] | str | None
    comfort: Comfort | None
    gamma_windows: Sequence[GammaWindow]


class PlanKeywords(GraphKeywords, total=False):
    """The options that `kerfpath.plan` takes as keywords."""

    method: PlanMethod
    objective: ObjectiveKind
    metric: Metric
    weights: ArrayLike | None
    eta_v: float
    eta_a: float
    closure: Closure
    rotation: ArrayLike | None
    feed: FeedKind
    interpolation: Interpolation
    refine: bool
    restarts: int
    certify: Certify | None


def _usual_certify() -> Certify | None:
    return USUAL if current_effort().certified else None


@documented
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanOptions(Settings):
    """Options of a plan: the search space, the objective, and the limits to keep.

    Raises
    ------
    InputError
        A value out of range or of the wrong type; `OptionConflict` if two do not go together.
    """

    method: PlanMethod = setting(
        "continuous",
        "continuous: the best motion found over continuous gamma; exact: the best path of the "
        "grid, proved; paper and known, for comparison, see `kerfpath.shortest_path`",
        group="Search",
        label="Method",
        concerns="search",
    )
    objective: ObjectiveKind = setting(
        "sum",
        "sum (14) or maximum (15) of the distances that is minimised",
        group="Objective and limits",
        label="Objective",
        concerns="search",
    )
    metric: Metric = setting(
        "manhattan",
        "distance in joint space (13)",
        group="Objective and limits",
        label="Metric",
        concerns="search",
    )
    weights: Array = setting(
        None,
        "weight of each joint in the distance (1/m for a rail); "
        "none: 1 / (velocity limit * time between nodes)",
        takes=tuple[float, ...],
        unit="1/rad",
        least=0,
        example="[1, 1, 1, 1, 1, 1]",
        key="weights",
        concerns="search",
    )
    eta_v: float = setting(
        1.0,
        "share of the velocity limits (5) that may be used",
        above=0,
        most=1,
        example="0.95",
        key="eta_velocity",
        group="Objective and limits",
        label="Speed limits used",
        concerns="search",
    )
    eta_a: float = setting(
        1.0,
        "share of the acceleration limits (6) that may be used",
        above=0,
        most=1,
        example="0.9",
        key="eta_acceleration",
        group="Objective and limits",
        label="Acceleration limits used",
        concerns="search",
    )
    closure: Closure = setting(
        "free",
        "periodic: the motion ends in the pose and at the speed it began with",
        group="Search",
        label="Closed contours",
    )
    rotation: Array | None = setting(
        None,
        "largest angle that an endless joint may turn away from where it begins, in either "
        "direction; infinite for no limit",
        takes=float,
        unit="deg",
        least=0,
        example="360",
        group="Search",
        label="Rotation of endless joints, at most",
    )
    comfort: Comfort | None = setting(
        None,
        "margins that the nodes keep from singularities, limits and bodies, and penalties beyond "
        "them; in a job the table [comfort]",
        takes=None,
    )
    gamma_step: float = setting(
        2.0,
        "step of the free rotation gamma about the beam; with the method continuous it affects "
        "the time, but hardly the result",
        unit="deg",
        above=0,
        most=360,
        example="1",
        group="Search",
        label="Step of gamma",
        concerns="graph",
    )
    tilt: Tilt | None = setting(
        None,
        "tolerance of the tool axis, which is then searched, too; none: only the nominal axis",
        takes=None,
    )
    frames: FrameKind = setting(
        "rotation-minimising",
        "task frames in which gamma is measured",
        group="Search",
        label="Frames",
        concerns="graph",
    )
    postures: tuple[int, ...] | None = setting(
        None,
        'postures (configurations) that may be used, by numbers or words: "front/up" are all '
        "postures with these words, see `kerfpath.robots.postures_named`; none: all",
        takes=str,
        what="a posture in words",
        example='"front/up"',
        key="posture",
        group="Objective and limits",
        label="Posture",
        concerns="graph",
    )
    feed: FeedKind = setting(
        "constant",
        "if the limits do not allow the speed everywhere: constant refuses, dip reduces the feed "
        "there and keeps the speed elsewhere, in the least time",
        data="feed_kind",
        group="Feed reductions and pieces",
        label="Feed",
        concerns="search",
    )
    interpolation: Interpolation = setting(
        "joint",
        "how the controller moves between the nodes. joint: all joints evenly, so that a motion "
        "at constant feed may pass a singularity and change its posture there. linear: the tip "
        "straight, so that no motion that is explored changes its posture; in jobs always. Give "
        "`kerfpath.audit` the same",
        takes=None,
    )
    refine: bool = setting(
        False,
        "whether gamma moves off its grid after a search of the grid, see `kerfpath.refine`; with "
        "the method continuous it always does. In jobs true for the methods continuous and exact",
        example="true",
        in_jobs=None,
        group="Search",
        label="Refined off the grid",
        concerns="search",
    )
    restarts: int = setting(
        4,
        "random changes of each kind and size from which the best motions over continuous gamma "
        "are refined again, unless they cost hardly more than the least under the velocities; more "
        "take longer and may find a better one",
        least=0,
        most=1000,
        example="40",
        group="Search",
        label="Random changes",
        concerns="search",
    )
    refine_parts: int = setting(
        1,
        "parts into which the refinement divides every interval between nodes; jobs only: `plan` "
        "keeps the nodes of its contour",
        least=1,
        most=100,
        example="4",
        group="Search",
        label="Parts of the refinement",
    )
    between_nodes: BetweenNodes = setting(
        "reported",
        "reported: the limits hold at the nodes, and the audit reports what the program needs "
        "between them. kept: if that is more, the plan is made again with lower limits at the "
        "nodes if this keeps them at every instant. guaranteed: the audit fails unless that is "
        "proved. Jobs only; for a plan use `kerfpath.keep_limits`",
        in_jobs="kept",
        group="Search",
        label="Limits between the nodes",
    )
    interruptions: Interruptions = setting(
        "none",
        "fewest: a contour that cannot be cut in one go is cut in pieces; jobs and "
        "`plan_in_pieces`",
        group="Feed reductions and pieces",
        label="Interruptions",
        concerns="search",
    )
    least_piece: float | None = setting(
        None,
        "least length of every such piece, along its nodes; default 10 mm",
        unit="mm",
        above=0,
        example="20",
        group="Feed reductions and pieces",
        label="Shortest piece",
        concerns="search",
    )
    retract: float | None = setting(
        None,
        "distance by which the tool can back off along its axis at both ends, within the joint "
        "limits and their margin, if some sample of gamma allows it; else the audit reports it. "
        "In jobs with a program or [sequence] the retract of [program]",
        takes=None,
        unit="mm",
        above=0,
    )
    floor: float | None = setting(
        None,
        "height in the robot base below which no node has the elbow, the wrist or the flange; "
        "none: no floor. In jobs from the keys of [robot]",
        takes=None,
        unit="mm",
    )
    gamma_windows: tuple[GammaWindow, ...] = setting(
        (),
        "stretches of the contour on which gamma is kept inside an interval; in a job of a "
        "[[contour]]",
        takes=None,
    )
    certify: Certify | None = setting(
        _usual_certify,
        "lower bound on the cost of every motion: the gap to reach, and the time for it; none, in "
        "a job false: no bound is proved",
        takes=bool,
        example="true",
        in_jobs=True,
        group="Bound",
        label="Bound of the cost",
        concerns="proof",
    )

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check(self)
        cast: dict[str, object] = {}
        if self.gamma_step >= 1 and (2 * self.gamma_step) % 1 == 0:  # no part of a turn in rad
            raise in_radians(self.gamma_step, "gamma_step", "the step of gamma in rad")
        if self.postures is not None:
            asked = (self.postures,) if isinstance(self.postures, str) else self.postures
            cast["postures"] = tuple(mu if isinstance(mu, str) else int(mu) for mu in asked)
        if self.weights is not None:
            cast["weights"] = floats(self.weights, "weights", (None,))
        if self.rotation is not None:
            each = "give the largest angle of every joint in rad, np.inf for no limit"
            turns = floats(self.rotation, "rotation", (None,), infinite=True, hint=each)
            if (finite := turns[np.isfinite(turns)]).size and finite.max() > MOST_TURNS * 2 * np.pi:
                raise in_radians(float(finite.max()), "rotation", "angles in rad")
            cast["rotation"] = turns
        cast["gamma_windows"] = tuple(self.gamma_windows)
        for window in self.gamma_windows:
            if not isinstance(window, GammaWindow):
                raise InputError(f"gamma_windows: expected kerfpath.GammaWindow, got {window!r}")
        for name, value in cast.items():
            object.__setattr__(self, name, value)
        _require_no_conflict(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PlanOptions) and self.to_data() == other.to_data()

    __hash__ = None  # type: ignore[assignment]  # arrays have none

    def on(self, robot: Robot) -> PlanOptions:
        """Return the options with the numbers of postures that were given in words.

        Raises
        ------
        InputError
            No posture of the robot has these words.
        """
        if not any(isinstance(mu, str) for mu in self.postures or ()):
            return self
        try:
            found = [
                postures_named(mu, robot.kinematics) if isinstance(mu, str) else (mu,)
                for mu in self.postures or ()
            ]
        except InputError as error:
            raise InputError(f"postures: {error}") from None
        return replace(self, postures=tuple(sorted({mu for each in found for mu in each})))

    def resolve(self, robot: Robot, dt: float) -> PlanOptions:
        """Return the options with weights and rotation limits filled in, for nodes `dt` s apart.

        Raises
        ------
        InputError
            Weights or a rotation limit that do not fit the robot's joints.
        """
        self = self.on(robot)
        velocity, _ = robot.speed_limits()
        weights = 1 / (velocity * dt) if self.weights is None else self.weights
        rotation = self.rotation
        return replace(
            self,
            weights=floats(weights, "weights", velocity.shape),
            rotation=None if rotation is None else rotation_limits(rotation, robot.endless),
        )

    def limits(self, robot: Robot) -> Limits:
        """Return the limits on a robot's motion, with the shares of them that may be used."""
        return Limits.of(
            *robot.speed_limits(),
            eta_v=self.eta_v,
            eta_a=self.eta_a,
            torque=robot.torque_limit(),
            jerk=robot.jerk_limit(),
            table=robot.limits.acceleration_table,
        )

    @property
    def without_penalties(self) -> PlanOptions:
        """The options without penalties: margins of comfort and the cone of tilt stay."""
        return replace(
            self,
            tilt=None if self.tilt is None else replace(self.tilt, cost=0.0),
            comfort=None if self.comfort is None else self.comfort.hard,
        )

    @property
    def without_reversals(self) -> PlanOptions:
        """The options without the cost of reversals; themselves if there is none."""
        if self.comfort is None or not self.comfort.prices_reversals:
            return self
        return replace(self, comfort=replace(self.comfort, reversals=None))


def with_keywords(
    options: PlanOptions | None, keywords: Mapping[str, Any], allowed: type, **more: Any
) -> PlanOptions:
    """Return `options`, or the defaults, with some of them replaced by keywords.

    Parameters
    ----------
    options : PlanOptions or None
    keywords : mapping of str to value
        Options that a user gave to a function as keywords.
    allowed : type of TypedDict
        The keywords that the function accepts.
    more : value
        Options that the function sets itself.

    Raises
    ------
    TypeError
        A keyword that the function does not accept.
    InputError
        As `PlanOptions`.
    """
    require_keywords(keywords, allowed, between_nodes=KEEPS)
    return replace(options or PlanOptions(), **keywords, **more)


KEEPS = "kerfpath.keep_limits(plan) makes a plan keep its limits between the nodes, too"
EXACT_OR_BETTER = ("continuous", "exact")
"""Methods whose paths keep (5) and (6)."""
GIVEN = object()
"""In a rule: any value except None."""
CLEARANCE, PENALTIES, REVERSALS = "comfort clearance", "comfort costs", "comfort reversals"
"""Names under which the rules test facts of comfort, beside the options themselves."""
_ONE_WAY: dict[str, object] = {"method": EXACT_OR_BETTER, "closure": "free", "rotation": None}
_RULES: tuple[tuple[dict[str, object], dict[str, object]], ...] = (
    (
        {"feed": "dip"},
        _ONE_WAY | {"objective": "sum", "interruptions": "none", "refine_parts": 1},
    ),
    ({"interruptions": "fewest"}, _ONE_WAY | {"tilt": None}),
    ({"closure": "periodic"}, {"method": EXACT_OR_BETTER}),
    ({"rotation": GIVEN}, {"method": EXACT_OR_BETTER}),
    ({"tilt": GIVEN}, {"refine_parts": 1}),
    (
        {"between_nodes": "guaranteed"},
        {"method": EXACT_OR_BETTER, "feed": "constant", "tilt": None},
    ),
    ({"between_nodes": "guaranteed", "method": "exact"}, {"refine": True}),
    ({"least_piece": GIVEN}, {"interruptions": "fewest"}),
    ({CLEARANCE: GIVEN}, {"feed": "constant", "interruptions": "none"}),
    (
        {REVERSALS: True},
        {
            "method": EXACT_OR_BETTER,
            "objective": "sum",
            "feed": "constant",
            "interruptions": "none",
        },
    ),
    ({"feed": "dip", PENALTIES: True}, {"refine": False}),
)
"""Pairs of options and values: if all of the first hold, those of the second must hold."""


def _require_no_conflict(options: PlanOptions) -> None:
    comfort = options.comfort
    facts = {field.name: getattr(options, field.name) for field in fields(options)}
    facts[CLEARANCE] = None if comfort is None else comfort.clearance
    facts[PENALTIES] = comfort is not None and comfort.costs
    facts[REVERSALS] = comfort is not None and comfort.prices_reversals
    if options.rotation is not None and not np.isfinite(options.rotation).any():
        facts["rotation"] = None
    for beside, needed in _RULES:
        if not all(_is(facts[name], value) for name, value in beside.items()):
            continue
        for name, value in needed.items():
            if not _is(facts[name], value):
                raise OptionConflict(name, value, facts[name], {one: facts[one] for one in beside})


def _is(fact: object, value: object) -> bool:
    if value is GIVEN or value is None:
        return (fact is None) != (value is GIVEN)
    if isinstance(value, tuple):
        return fact in value
    return fact == value
