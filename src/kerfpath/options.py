"""Planning options: one object with every option, and the rules for combining them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Literal, TypedDict, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, require_one_of, scalar, short_repr
from kerfpath.certificate import USUAL, Certify, CertifyData
from kerfpath.comfort import Band, BandData, Comfort
from kerfpath.contour import FrameKind
from kerfpath.effort import current_effort
from kerfpath.errors import InputError, OptionConflict
from kerfpath.limits import Limits
from kerfpath.robots import Robot
from kerfpath.search import Closure, Method, Metric, ObjectiveKind, rotation_limits
from kerfpath.tilt import Tilt, TiltData
from kerfpath.windows import GammaWindow, WindowData

__all__ = [
    "EXACT_OR_BETTER",
    "BetweenNodes",
    "FeedKind",
    "GraphKeywords",
    "Interruptions",
    "OptionConflict",
    "OptionData",
    "PlanKeywords",
    "PlanMethod",
    "PlanOptions",
    "with_keywords",
]

PlanMethod = Literal["continuous", Method]
FeedKind = Literal["constant", "dip"]
Interruptions = Literal["none", "fewest"]
BetweenNodes = Literal["reported", "kept", "guaranteed"]


class GraphKeywords(TypedDict, total=False):
    """The options that the layered graph depends on."""

    gamma_step: float
    frames: FrameKind
    tilt: Tilt | None
    postures: Sequence[int] | None
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
    refine: bool
    certify: Certify | None


class OptionData(TypedDict):
    """Options as JSON data: SI units, unit in the key, null for infinity."""

    method: PlanMethod
    objective: ObjectiveKind
    metric: Metric
    weights_per_rad: list[float] | None
    eta_v: float
    eta_a: float
    closure: Closure
    rotation_rad: list[float | None] | None
    comfort: dict[str, BandData] | None
    gamma_step_rad: float
    tilt: TiltData | None
    frames: FrameKind
    postures: list[int] | None
    feed_kind: FeedKind
    refine: bool
    refine_parts: int
    between_nodes: BetweenNodes
    interruptions: Interruptions
    least_piece_m: float | None
    retract_m: float | None
    floor_m: float | None
    gamma_windows: list[WindowData]
    certify: CertifyData | None


def _usual_certify() -> Certify | None:
    return USUAL if current_effort().certified else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanOptions:
    """Options of a plan: the search space, the objective, and the limits to keep.

    Parameters
    ----------
    gamma_step : float rad
        Step of the free rotation about the beam.
    frames : {"rotation-minimising", "tangent"}
        Task frames that gamma is measured in.
    tilt : Tilt, optional
        Tolerance of the tool axis, which is then searched too; None: only the nominal axis.
    postures : tuple of int, optional
        The postures that may be used; None: all. See `kerfpath.robots.postures_named`.
    method : {"continuous", "exact", "paper", "known"}
        "continuous": the best motion found over continuous gamma; the others search the grid, as
        `kerfpath.shortest_path` does.
    objective, metric, closure
        As in `kerfpath.shortest_path`.
    weights : (n,) 1/rad, optional
        Weights of the joint-space distance (1/m for a rail); None: 1 / (velocity limit * dt).
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.
    rotation : (n,) rad, optional
        Largest angle that an endless joint may turn away from where it begins, in either
        direction; infinite for no limit.
    feed : {"constant", "dip"}
        If the limits do not allow the speed everywhere: "constant" refuses, "dip" reduces the feed
        there and keeps the speed elsewhere, in the least time.
    refine : bool
        Whether gamma moves off its grid after a search of the grid, see `kerfpath.refine`; with
        the method "continuous" it always does.
    refine_parts : int
        Parts into which the refinement divides every interval between nodes. Jobs do so; `plan`
        keeps the nodes of its contour.
    between_nodes : {"reported", "kept", "guaranteed"}
        The limits hold at the nodes, and the audit reports what the program needs between them.
        "kept": if that is more, the nodes keep lower limits if this keeps the limits at every
        instant. "guaranteed": the audit fails unless that is proved. Jobs do so; `plan` holds the
        limits at the nodes, and `kerfpath.keep_limits` those between them.
    interruptions : {"none", "fewest"}
        Whether a contour that cannot be cut in one go is cut in pieces, see `plan_in_pieces`.
    least_piece : float m, optional
        Least length of such a piece.
    comfort : Comfort, optional
        Margins that the nodes keep from singularities and limits, and penalties beyond them.
    retract : float m, optional
        Distance by which the tool can back off along its axis at both ends, within the joint limits
        and their margin, if some sample of gamma allows it; else the audit reports it.
    floor : float m, optional
        Least height of elbow, wrist and flange in the robot base, at every node; None: no floor.
    gamma_windows : tuple of GammaWindow
        Stretches of the contour on which gamma is kept inside an interval.
    certify : Certify, optional
        The gap to the best motion to prove, and the time for it; None: no bound is proved.

    Raises
    ------
    InputError
        A value out of range or of the wrong type; `OptionConflict` if two do not go together.
    """

    gamma_step: float = np.pi / 90
    frames: FrameKind = "rotation-minimising"
    tilt: Tilt | None = None
    postures: tuple[int, ...] | None = None
    method: PlanMethod = "continuous"
    objective: ObjectiveKind = "sum"
    metric: Metric = "manhattan"
    weights: Array = None  # type: ignore[assignment]  # `resolve` fills in the default
    eta_v: float = 1.0
    eta_a: float = 1.0
    closure: Closure = "free"
    rotation: Array | None = None
    feed: FeedKind = "constant"
    refine: bool = False
    refine_parts: int = 1
    between_nodes: BetweenNodes = "reported"
    interruptions: Interruptions = "none"
    least_piece: float | None = None
    comfort: Comfort | None = None
    retract: float | None = None
    floor: float | None = None
    gamma_windows: tuple[GammaWindow, ...] = ()
    certify: Certify | None = field(default_factory=_usual_certify)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for name, known in _KNOWN.items():
            require_one_of(getattr(self, name), name, known)
        cast: dict[str, object] = {
            "gamma_step": scalar(self.gamma_step, "gamma_step", unit="rad", above=0.0),
            "eta_v": scalar(self.eta_v, "eta_v", above=0.0),
            "eta_a": scalar(self.eta_a, "eta_a", above=0.0),
        }
        if self.postures is not None:
            cast["postures"] = tuple(int(posture) for posture in self.postures)
        if self.weights is not None:
            cast["weights"] = floats(self.weights, "weights", (None,))
        if self.rotation is not None:
            cast["rotation"] = floats(self.rotation, "rotation", (None,), infinite=True)
        for name in ("least_piece", "retract"):
            if (length := getattr(self, name)) is not None:
                cast[name] = scalar(length, name, unit="m", above=0.0)
        if self.floor is not None:
            cast["floor"] = scalar(self.floor, "floor", unit="m")
        if not (isinstance(self.refine_parts, int) and self.refine_parts >= 1):
            raise InputError(
                f"refine_parts: expected a whole number >= 1, got {self.refine_parts!r}"
            )
        if not isinstance(self.certify, Certify | None):
            raise InputError(f"certify: expected kerfpath.Certify or None, got {self.certify!r}")
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

    def resolve(self, robot: Robot, dt: float) -> PlanOptions:
        """Return the options with weights and rotation limits filled in, for nodes `dt` s apart.

        Raises
        ------
        InputError
            Weights or a rotation limit that do not fit the robot's joints.
        """
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
        rates = Limits.of(*robot.speed_limits(), eta_v=self.eta_v, eta_a=self.eta_a)
        return replace(rates, torque=robot.torque_limit(), jerk=robot.jerk_limit())

    @property
    def without_penalties(self) -> PlanOptions:
        """The options without penalties: margins of comfort and the cone of tilt stay."""
        return replace(
            self,
            tilt=None if self.tilt is None else replace(self.tilt, cost=0.0),
            comfort=None if self.comfort is None else self.comfort.hard,
        )

    def to_data(self) -> OptionData:
        """Return the options as JSON data, which `from_data` reads."""
        names = {key: _NAMES.get(key, key) for key in OptionData.__annotations__}
        return cast(OptionData, {key: _to_json(getattr(self, name)) for key, name in names.items()})

    @classmethod
    def from_data(cls, data: OptionData) -> PlanOptions:
        """Return the options that `to_data` wrote; other keys of `data` are ignored.

        Raises
        ------
        InputError
            As `PlanOptions`.
        KeyError
            A key is missing.
        """
        every: Mapping[str, Any] = data
        values = {_NAMES.get(key, key): every[key] for key in OptionData.__annotations__}
        if (tilt := data["tilt"]) is not None:
            values["tilt"] = Tilt.from_data(tilt)
        if (certify := data["certify"]) is not None:
            values["certify"] = Certify(**certify)
        values["gamma_windows"] = [GammaWindow.from_data(each) for each in data["gamma_windows"]]
        if (comfort := data["comfort"]) is not None:
            values["comfort"] = Comfort(**{name: Band(**band) for name, band in comfort.items()})
        if (rotation := data["rotation_rad"]) is not None:
            values["rotation"] = [np.inf if angle is None else angle for angle in rotation]
        return cls(**values)


_NAMES = {
    "weights_per_rad": "weights",
    "rotation_rad": "rotation",
    "gamma_step_rad": "gamma_step",
    "feed_kind": "feed",
    "least_piece_m": "least_piece",
    "retract_m": "retract",
    "floor_m": "floor",
}
"""Names of options whose JSON key differs, by that key."""


def _to_json(value: object) -> object:
    """Return the value of an option as JSON data, null for infinity."""
    if isinstance(value, Tilt | Certify | GammaWindow):
        return value.to_data()
    if isinstance(value, Comfort):
        return {name: band for name, band in asdict(value).items() if band is not None}
    if isinstance(value, np.ndarray):
        return [number if np.isfinite(number) else None for number in value.tolist()]
    return [_to_json(each) for each in value] if isinstance(value, tuple) else value


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
    known = allowed.__annotations__
    for name in keywords:
        if name not in known:
            said = f"the options are {', '.join(sorted(known))}"
            said = KEEPS if name == "between_nodes" else said
            raise TypeError(f"unexpected keyword argument {name!r}; {said}")
    return replace(options or PlanOptions(), **keywords, **more)


_KNOWN: dict[str, tuple[str, ...]] = {
    "frames": get_args(FrameKind),
    "method": get_args(PlanMethod),
    "objective": get_args(ObjectiveKind),
    "metric": get_args(Metric),
    "closure": get_args(Closure),
    "feed": get_args(FeedKind),
    "between_nodes": get_args(BetweenNodes),
    "interruptions": get_args(Interruptions),
}

KEEPS = "kerfpath.keep_limits(plan) makes a plan keep its limits between the nodes, too"
EXACT_OR_BETTER = ("continuous", "exact")
"""Methods whose paths keep (5) and (6)."""
GIVEN = object()
"""In a rule: any value except None."""
CLEARANCE, PENALTIES = "comfort clearance", "comfort costs"
"""Names under which the rules test two facts of comfort, beside the options themselves."""
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
    ({"feed": "dip", PENALTIES: True}, {"refine": False}),
)
"""Pairs of options and values: if all of the first hold, those of the second must hold."""


def _require_no_conflict(options: PlanOptions) -> None:
    comfort = options.comfort
    facts = {field.name: getattr(options, field.name) for field in fields(options)}
    facts[CLEARANCE] = None if comfort is None else comfort.clearance
    facts[PENALTIES] = comfort is not None and comfort.costs
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
