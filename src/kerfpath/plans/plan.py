"""Plan: the motion of the robot at every node."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    as_pose,
    floats,
    freeze,
    html_table,
    in_degrees,
    integers,
    scalar,
    short_repr,
)
from kerfpath.certificate import Certificate
from kerfpath.comfort import measures
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.kernels import metric
from kerfpath.limits import rates_of
from kerfpath.options import PlanOptions
from kerfpath.robots import Robot, can_back_off, joint_identifiers
from kerfpath.search import METRIC_CODES, Metric, ObjectiveKind
from kerfpath.tilt import tilt_frames

# -----------------------------------------------------------------------------
# Names of the joints in the table of a plan.

TAKEN = frozenset({"s", "x", "y", "z", "gamma", "lead", "lean"})
"""Names of the other columns in lengths and angles."""


def joint_columns(robot: Robot) -> tuple[str, ...]:
    """Return the names of the joints in tables, without a unit: q1, q2, ..., then external axes.

    "_axis" is appended to the name of an external axis if another column has that name.
    """
    names = [f"q{i + 1}" for i in range(robot.family.joints)]
    for axis in robot.externals:
        name = axis.name
        while name in TAKEN or name in names:
            name += "_axis"
        names.append(name)
    return tuple(names)


# -----------------------------------------------------------------------------
# Joint motion with velocities and accelerations, also in the coordinates of pinocchio.


class JointMotion(NamedTuple):
    """Joints, velocities and accelerations at the nodes of a motion."""

    time: Array
    """(K,) s."""
    q: Array
    """(K, n) rad; a linear axis: m."""
    v: Array
    """(K, n) rad/s; a linear axis: m/s."""
    a: Array
    """(K, n) rad/s^2; a linear axis: m/s^2."""


def node_rates(time: Array, q: Array) -> tuple[Array, Array]:
    """Return velocities and accelerations (K, n), rad/s and rad/s^2, of joints q (K, n) rad.

    They are those of the parabola through a node and its two neighbours; the first and the last
    node use the parabola of the node beside them. With only two nodes they are those of a straight
    line. `time` (K,) is in seconds.
    """
    step = np.diff(time)[:, None]
    slope = np.diff(q, axis=0) / step
    if len(time) < 3:
        return np.tile(slope.sum(axis=0), (len(time), 1)), np.zeros_like(q)
    before, after = step[:-1], step[1:]
    inner = (after * slope[:-1] + before * slope[1:]) / (before + after)
    bend = 2 * np.diff(slope, axis=0) / (before + after)
    first, last = slope[:1] - bend[:1] * step[0] / 2, slope[-1:] + bend[-1:] * step[-1] / 2
    return np.vstack([first, inner, last]), np.vstack([bend[:1], bend, bend[-1:]])


def in_model(motion: JointMotion, names: Sequence[str], model: Any) -> JointMotion:
    """Return a motion of joints with the given names in the coordinates of a pinocchio model.

    Parameters
    ----------
    motion : JointMotion
    names : sequence of str
    model : pinocchio.Model
        With these joints and no others, in any order.

    Raises
    ------
    InputError
        `model` is no pinocchio model, lacks one of the joints, or has others.
    """
    if not hasattr(model, "existJointName"):
        raise InputError(f"model: expected a pinocchio.Model, got {type(model).__name__}")
    missing = [name for name in names if not model.existJointName(name)]
    if missing or model.nv != len(names):
        what = f"no {', '.join(missing)}" if missing else f"{model.nv} degrees of freedom"
        raise InputError(
            f"model: expected exactly the joints {', '.join(names)}, got one with {what}; "
            "use pinocchio.buildModelFromXML(plan.robot.to_urdf())"
        )
    q = np.zeros((len(motion.time), model.nq))
    v, a = np.zeros((2, len(q), model.nv))
    for i, name in enumerate(names):
        joint = model.joints[model.getJointId(name)]
        # Pinocchio stores a joint that turns without end as a point on the unit circle.
        turns = joint.nq == 2
        value = motion.q[:, i]
        q[:, joint.idx_q] = np.cos(value) if turns else value
        if turns:
            q[:, joint.idx_q + 1] = np.sin(value)
        v[:, joint.idx_v], a[:, joint.idx_v] = motion.v[:, i], motion.a[:, i]
    return JointMotion(motion.time, freeze(q), freeze(v), freeze(a))


# -----------------------------------------------------------------------------
# Results about a plan: its proof, its feed reduction, and its criteria.


@dataclass(frozen=True, slots=True, kw_only=True)
class Explored:
    """What a search over continuous gamma followed, and what it dropped.

    The bottom of a valley is a sample that the best course through it by (5) alone costs less than
    through its neighbours in gamma. Courses through valleys are refined, or screened before: many
    are brought near the limits at once, and the best are refined.

    Parameters
    ----------
    valleys : mapping of str to int
        Number of valleys followed in each posture, by its number, or "several" for those that
        change posture.
    all_valleys : bool
        Whether all valleys were followed; otherwise only the cheapest were: for want of work, as
        the best motion costs hardly more than the cheapest course by (5) alone, or as such tasks
        are searched by beams.
    screened : int
        Number of courses screened, once for each of two ways: through valleys, smoothed, of
        constant gamma, and changed ones.
    refined : int
        Number of motions refined, from a screening or from elsewhere.
    dearer : int
        Number of motions that were not refined because they are expected to cost more than the best
        one by more than refinements gain: that is no bound.
    alike : int
        Number of those that were not refined because a refined one is nearly the same.
    left : int
        Number of those that were not refined for want of work.
    dropped : int
        Number of courses that the screening dropped: out of reach, nearly the same as a better one,
        or with a worse score than those that it keeps.
    unfollowed : int
        Number of valleys known to be left that were not followed for want of work.
    """

    valleys: Mapping[str, int]
    all_valleys: bool
    screened: int
    refined: int
    dearer: int
    alike: int
    left: int
    dropped: int = 0
    unfollowed: int = 0

    __repr__ = short_repr

    @property
    def words(self) -> str:
        """The numbers in a sentence."""
        places = ", ".join(
            f"{count} in {'several postures' if where == 'several' else f'posture {where}'}"
            for where, count in self.valleys.items()
        )
        which = "all valleys" if self.all_valleys else "the cheapest valleys"
        begun = f"{which} followed ({places})" if places else "no valley followed"
        if self.unfollowed:
            begun += f", at least {self.unfollowed} not for want of work"
        return (
            f"{begun}; {self.screened} courses screened and {self.dropped} of them dropped, "
            f"{self.refined} motions refined; not refined: {self.dearer} expected to cost more "
            f"than the best, {self.alike} like a refined one, {self.left} for want of work"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """What is proved about a plan.

    Parameters
    ----------
    optimal : bool
        Whether it is proved that no path on its graph is better.
    statement : str
        The claim in words.
    grid_cost : float or None
        Of a refined plan: the cost of the path on the graph that it was refined from, if that path
        keeps all limits.
    bound : float or None
        No motion that keeps (5) and (6) at the nodes costs less, at any gamma, posture and turn;
        None if no such bound is proved.
    gap : float or None
        Largest possible distance of the plan from the best motion: (cost - bound) / cost.
    certificate : Certificate or None
        Proof of the bound, see `kerfpath.certificate`.
    explored : Explored or None
        What the search over continuous gamma followed and dropped; None if there was none.
    """

    optimal: bool
    statement: str
    grid_cost: float | None = None
    bound: float | None = None
    gap: float | None = None
    certificate: Certificate | None = None
    explored: Explored | None = None

    __repr__ = short_repr

    @property
    def bound_claim(self) -> str:
        """The bound in words, as in `statement`; "" if there is none."""
        if self.bound is None:
            return ""
        return (
            f"no motion within the limits costs less than {self.bound_shown}, {self.gap_shown} % "
            "below this plan, at any gamma, posture and turn"
        )

    def also(self, claim: str) -> Proof:
        """Return the proof with a claim added to its statement."""
        return replace(self, statement=f"{self.statement}; {claim}")

    def without_bound(self) -> Proof:
        """Return the proof without bound, gap and certificate, which hold for this motion only."""
        parts = self.statement.split("; ")
        rest = [p for p in parts if p != self.bound_claim and not p.startswith(OF_BOUND)]
        return replace(self, statement="; ".join(rest), bound=None, gap=None, certificate=None)

    @property
    def bound_shown(self) -> str:
        """The bound with two decimals, rounded down; "-" if there is none."""
        return "-" if self.bound is None else f"{math.floor(self.bound * 100) / 100:.2f}"

    @property
    def gap_shown(self) -> str:
        """The gap in per cent with two decimals, rounded up; "-" if there is none."""
        return "-" if self.gap is None else f"{max(math.ceil(self.gap * 1e4), 0) / 100:.2f}"


OF_BOUND = "the bound "
"""How parts of a statement begin that say more about a bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Feed:
    """Feed reduction of a retimed path: its extent, its slowest interval, and the limit there.

    Parameters
    ----------
    full : float
        Share of the path length at the commanded speed.
    slowest : float
        Speed of the slowest interval as a share of the commanded speed; 1 if none is slowed.
    node : int
        Node from which the slowest interval starts; -1 if none is slowed.
    joint : int
        Joint that is nearest to its limit in that interval or at its ends, 0-based; -1 for none.
    limit : {"velocity", "acceleration"} or None
        That limit; None if no interval is slowed.
    """

    full: float
    slowest: float
    node: int
    joint: int
    limit: Literal["velocity", "acceleration"] | None

    def __str__(self) -> str:
        """Return it as one line of text."""
        if self.limit is None:
            return "full speed throughout"
        return (
            f"full speed on {self.full:.1%} of the length; lowest speed {self.slowest:.1%} of it "
            f"from node {self.node} on, where the {self.limit} of joint {self.joint + 1} binds"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Criteria:
    """Smoothness criteria of a plan, joint by joint, and its least measures of comfort.

    Parameters
    ----------
    displacement : (n,) rad, a rail: m
        Total displacement (7).
    largest_increment : (n,) rad, a rail: m
        Largest increment between nodes (8).
    range : (n,) rad, a rail: m
        Coordinate range (9).
    peak_velocity, peak_acceleration : (n,) share of the limit
        Largest finite difference over the joint's limit, before eta.
    reversals : (n,) of int
        How often each joint turns back; only joints 1 to 3 are counted, the others have 0.
    nearest : mapping of str to (float, int)
        The least value of each measure of `kerfpath.comfort`, in its unit, and its node.
    """

    displacement: Array
    largest_increment: Array
    range: Array
    peak_velocity: Array
    peak_acceleration: Array
    reversals: Ints
    nearest: Mapping[str, tuple[float, int]]

    __repr__ = short_repr


PLACING = 3
"""Joints that place the wrist centre: they carry most, and stick where they turn back."""
STILL = 1e-4
"""rad/s: a joint that moves more slowly has no direction; its last one holds."""


def directions(rate: Array) -> Array:
    """Return in which direction each joint moves (m, n): 1 or -1, or 0 if it stands throughout.

    ``rate`` is (m, n) rad/s, joint velocities one after another. A joint that is still keeps its
    last direction, or has the first one if it has not moved yet.
    """
    moves = np.abs(rate) > STILL
    last = np.maximum.accumulate(np.where(moves, np.arange(len(rate))[:, None], 0), axis=0)
    last = np.maximum(last, moves.argmax(axis=0))
    return np.asarray(np.sign(rate * moves)[last, np.arange(rate.shape[1])])


def reversals(rate: Array, joints: Sequence[int] = range(PLACING)) -> list[tuple[int, int]]:
    """Return where joints turn back: joint, from 0, and the row from which it moves back.

    ``rate`` is (m, n) rad/s, joint velocities one after another; by default joints 1 to 3 count.
    """
    turned = np.diff(directions(rate), axis=0) != 0
    return [(joint, int(k) + 1) for joint in joints for k in np.flatnonzero(turned[:, joint])]


def path_cost(
    dq: Array,
    weights: Array,
    metric_name: Metric,
    objective: ObjectiveKind,
    node_cost: Array | None = None,
) -> float:
    """Return the objective (14) or (15), node costs included.

    Parameters
    ----------
    dq : (K-1, n) rad
        Joint increments.
    weights : (n,) 1/rad
    metric_name : {"manhattan", "chebychev", "euclid"}
    objective : {"sum", "max"}
    node_cost : (K,), optional
        Cost of each node.
    """
    total = metric.total_distance if objective == "sum" else metric.maximum_distance
    cost = float(total(np.ascontiguousarray(dq), weights, METRIC_CODES[metric_name]))
    if node_cost is None:
        return cost
    return cost + float(node_cost.sum()) if objective == "sum" else max(cost, *node_cost.tolist())


# -----------------------------------------------------------------------------
# A move through the air, to a cut or from it.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransferMove:
    """Straight joint motions from corner to corner, with a stop at each.

    Parameters
    ----------
    q : (m, n) rad
        Corners, including both ends.
    time : (m,) s
        Time at which each corner is reached, from 0.
    clear : bool
        Whether the move is proved clear in a cell; False where no cell was given.
    """

    q: Array
    time: Array
    clear: bool

    __repr__ = short_repr

    @property
    def duration(self) -> float:
        """Duration of the move (s)."""
        return float(self.time[-1])


# -----------------------------------------------------------------------------
# Plan: the motion of the robot at every node.

if TYPE_CHECKING:
    import pandas


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Joint motion along one contour.

    Parameters
    ----------
    contour : Contour
        The nodes, in the part frame.
    robot : Robot
        With the limits that the plan keeps.
    T_flange_tip, T_base_part : (4, 4) m
        Tool and placement of the part.
    q : (K, n) rad
        Joints at the nodes; external axes are the last columns (a rail: m).
    gamma : (K,) rad
        Free rotation about the tool axis at the nodes.
    tilt : (K, 2) rad, optional
        Lead and lean of the tool axis at the nodes, see `kerfpath.Tilt`; default: zero.
    posture : (K,) int
        Posture mu; see `kerfpath.robots.posture_name`.
    turn : (K, n) int
        Number of turns of 2 pi by which each joint is away from (-pi, pi].
    time : (K,) s
        Time of each node, from 0.
    settings : PlanOptions
        The options of the plan, with the weights that were used.
    cost : float
        Objective (14) or (15), with the costs of tilt and comfort.
    proof : Proof
    feed : Feed or None
        Feed reduction; None at constant speed.
    approach, retreat : TransferMove, optional
        The move from where the robot stands to the first node, and from the last node to where it
        goes, with stops at the nodes; with `settings.retract`, to and from where the tool has
        backed off by it. None: not planned.
    counts : mapping of str to int
        Number of candidates (node, tilt, gamma, posture) of the searched layered graph, by reason.
        With very many nodes the graph may have only some of them.
    """

    contour: Contour
    robot: Robot
    T_flange_tip: Array
    T_base_part: Array
    q: Array
    gamma: Array
    posture: Ints
    turn: Ints
    time: Array
    settings: PlanOptions
    cost: float
    proof: Proof
    counts: Mapping[str, int]
    feed: Feed | None = None
    tilt: Array = None  # type: ignore[assignment]  # filled in by __post_init__
    approach: TransferMove | None = None
    retreat: TransferMove | None = None

    def __repr__(self) -> str:
        best = ", best of its grid" if self.proof.optimal else ""
        if self.proof.gap is not None:
            best += f", gap {self.proof.gap_shown} %"
        return (
            f"Plan({self.name!r}, {len(self.q)} nodes, {self.time[-1] - self.time[0]:.2f} s, cost "
            f"{self.cost:.6g}{best}, {self.robot.id})"
        )

    def __post_init__(self) -> None:
        K, n = len(self.contour), self.robot.joints
        cast: dict[str, Any] = {
            "T_flange_tip": as_pose(self.T_flange_tip, "T_flange_tip"),
            "T_base_part": as_pose(self.T_base_part, "T_base_part"),
            "q": floats(self.q, "q", (K, n)),
            "gamma": floats(self.gamma, "gamma", (K,)),
            "posture": integers(self.posture, "posture", (K,)),
            "turn": integers(self.turn, "turn", (K, n)),
            "time": floats(self.time, "time", (K,)),
            "tilt": floats(np.zeros((K, 2)) if self.tilt is None else self.tilt, "tilt", (K, 2)),
            "cost": scalar(self.cost, "cost"),
        }
        if (np.diff(cast["time"]) <= 0).any():
            raise InputError("time: must increase from node to node")
        for name in ("approach", "retreat"):
            move: TransferMove | None = getattr(self, name)
            if move is not None:
                floats(move.time, f"{name}.time", (len(floats(move.q, f"{name}.q", (None, n))),))
                if len(move.q) < 2:
                    raise InputError(f"{name}: expected a move with two corners or more, got one")
        if self.settings.weights is None:
            cast["settings"] = self.settings.resolve(self.robot, _mean_step(cast["time"]))
        for name, value in cast.items():
            object.__setattr__(self, name, value)

    @property
    def name(self) -> str:
        """Name of the contour."""
        return self.contour.name

    @property
    def dt(self) -> float:
        """Mean time from node to node, s."""
        return _mean_step(self.time)

    @property
    def points(self) -> Array:
        """Required tool-tip positions at the nodes, robot base frame, (K, 3) m."""
        rotation, origin = self.T_base_part[:3, :3], self.T_base_part[:3, 3]
        return freeze(self.contour.points @ rotation.T + origin)

    @property
    def axes(self) -> Array:
        """Required tool axes at the nodes, tilt included, robot base frame, (K, 3)."""
        if not self.tilt.any():
            return freeze(self.contour.axes @ self.T_base_part[:3, :3].T)
        return freeze(self.frames[:, :3, 2])

    @property
    def nominal_frames(self) -> Array:
        """Task frames without tilt, robot base frame at zero of external axes, (K, 4, 4) m."""
        return freeze(self.T_base_part @ self.contour.frames(self.settings.frames))

    @property
    def frames(self) -> Array:
        """Task frames in which gamma is measured, tilt included, robot base frame, (K, 4, 4) m."""
        H = self.contour.frames(self.settings.frames)
        if self.tilt.any():
            H = tilt_frames(H, self.contour.along, self.tilt)
        return freeze(self.T_base_part @ H)

    @property
    def T_part_tip(self) -> Array:
        """Tip poses in the part frame, (K, 4, 4) m: points of the contour, orientation of FK(q).

        These are exact rotations, even if the placement, given with few decimals, is not quite one.
        """
        T_base_tip = self.robot.forward(self.q) @ self.T_flange_tip
        T = np.asarray(np.linalg.solve(self.T_base_part, T_base_tip), dtype=np.float64)
        T[:, :3, :3] = Rotation.from_matrix(T[:, :3, :3]).as_matrix()
        T[:, :3, 3], T[:, 3] = self.contour.points, (0.0, 0.0, 0.0, 1.0)
        return freeze(T)

    @property
    def node_cost(self) -> Array | None:
        """Cost of tilt and comfort at each node, (K,); None if they have no cost.

        A reversal costs at the node from which the joint moves back. The cost of clearance is not
        included, as only a cell knows it.
        """
        tilt, comfort, costs = self.settings.tilt, self.settings.comfort, []
        if tilt is not None and tilt.cost:
            costs.append(tilt.price(self.tilt))
        if comfort is not None and any(band.cost for band in comfort.bands.values()):
            costs.append(comfort.price(self.robot, self.q, self.T_flange_tip))
        if comfort is not None and comfort.prices_reversals:
            price, cost = comfort.price_of_reversals(self.robot), np.zeros(len(self.q))
            for joint, k in self.turned_back(np.flatnonzero(price).tolist()):
                cost[k] += price[joint]
            costs.append(cost)
        return freeze(np.sum(costs, axis=0)) if costs else None

    @property
    def increments(self) -> Array:
        """Joint increments between nodes, (K-1, n) rad; endless joints go the short way (13)."""
        return freeze(metric.increments(self.q, self.robot.endless))

    @property
    def external(self) -> Array | None:
        """Values (K, E) of the external axes, rad or m; None if the robot has none."""
        return freeze(self.q[:, self.robot.family.joints :]) if self.robot.externals else None

    @property
    def course(self) -> Array:
        """Values (K, E) rad or m of the joints that poses leave free, see `Robot.free`."""
        return freeze(self.q[:, self.robot.free])

    @property
    def unwrapped(self) -> Array:
        """The joints (K, n) rad, with endless joints not wrapped."""
        return np.vstack([self.q[:1], self.q[:1] + np.cumsum(self.increments, axis=0)])

    @property
    def _rates(self) -> tuple[Array, Array]:
        return rates_of(self.increments, np.diff(self.time))

    @property
    def velocity_share(self) -> Array:
        """Joint speed between nodes over its limit, (K-1, n), signed."""
        return freeze(self._rates[0] / self.robot.speed_limits()[0])

    @property
    def acceleration_share(self) -> Array:
        """Second difference at the inner nodes over the acceleration limit, (K-2, n), signed."""
        return freeze(self._rates[1] / self.robot.acceleration_at(self.q[1:-1]))

    def turned_back(self, joints: Sequence[int] = range(PLACING)) -> list[tuple[int, int]]:
        """Return where joints, from 0, turn back: the joint and the node from which it does."""
        return reversals(self._rates[0], joints)

    @property
    def criteria(self) -> Criteria:
        """The criteria (7) to (9), peak shares of the limits, and least measures of comfort."""
        dq = self.increments
        turned = [joint for joint, _ in self.turned_back()]
        measured = measures(self.robot, self.q, tool=self.T_flange_tip)
        return Criteria(
            displacement=metric.total_displacement(dq),
            largest_increment=metric.largest_increment(dq),
            range=metric.coordinate_range(dq),
            peak_velocity=np.abs(self.velocity_share).max(axis=0),
            peak_acceleration=np.abs(self.acceleration_share).max(axis=0, initial=0.0),
            reversals=np.bincount(turned, minlength=dq.shape[1]),
            nearest={name: (float(of.min()), int(of.argmin())) for name, of in measured.items()},
        )

    @property
    def columns(self) -> dict[str, Array | Ints | list[str]]:
        """Table of the nodes: K values for each column name, which ends in the unit.

        Columns are named as in trajectory.csv, in SI: contour, node, kind, t_s; s_m, the arc length
        along the contour; the joints q1_rad, q2_rad, ..., then external axes by their names
        (`rail_m`, `table_rad`); x_m, y_m, z_m, axis_x, axis_y, axis_z, as `points` and `axes`;
        gamma_rad; lead_rad and lean_rad, if a tilt is allowed; posture; speed_m_s, the speed of the
        tip to the next node (NaN at the last).
        """
        units = zip(joint_columns(self.robot), self.robot.units, strict=True)
        joints = [f"{name}_{unit}" for name, unit in units]
        s, tilted = self.contour.s, self.settings.tilt is not None
        return {
            "contour": [self.name] * len(s),
            "node": np.arange(len(s)),
            "kind": list(self.contour.kinds),
            "t_s": self.time,
            "s_m": freeze(s - s[0]),
            **dict(zip(joints, self.q.T, strict=True)),
            **dict(zip(("x_m", "y_m", "z_m"), self.points.T, strict=True)),
            **dict(zip(("axis_x", "axis_y", "axis_z"), self.axes.T, strict=True)),
            "gamma_rad": self.gamma,
            **(dict(zip(("lead_rad", "lean_rad"), self.tilt.T, strict=True)) if tilted else {}),
            "posture": self.posture,
            "speed_m_s": freeze(np.append(np.diff(s) / np.diff(self.time), np.nan)),
        }

    def to_pandas(self) -> pandas.DataFrame:
        """Return the nodes as a DataFrame, one row per node, with the columns of `columns`.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        require_extra("tables", "Plan.to_pandas")
        import pandas

        return pandas.DataFrame(self.columns)

    @property
    def motion(self) -> JointMotion:
        """Time (K,), joints, velocities and accelerations (K, n) at the nodes, SI.

        Endless joints are not wrapped. Rates are those of the parabola through a node and its
        neighbours. The robot moves at both ends: stops there belong to the program.
        """
        q = self.unwrapped
        v, a = node_rates(self.time, q)
        return JointMotion(self.time, freeze(q), freeze(v), freeze(a))

    def to_pinocchio(self, model: Any) -> JointMotion:
        """Return `motion` in the coordinates of a pinocchio model: q (K, nq), v and a (K, nv).

        Parameters
        ----------
        model : pinocchio.Model
            Built from `Robot.to_urdf`, or another one with exactly the joints of these names.

        Raises
        ------
        InputError
            No pinocchio model, or one with other joints.
        """
        return in_model(self.motion, joint_identifiers(self.robot), model)

    def _repr_html_(self) -> str:
        """Return a small table for notebooks: displacement, range and limit shares by joint."""
        of, robot = self.criteria, self.robot
        rows = [
            [
                name,
                in_degrees(way, unit),
                in_degrees(span, unit),
                f"{100 * velocity:.0f} %",
                f"{100 * acceleration:.0f} %",
            ]
            for name, unit, way, span, velocity, acceleration in zip(
                robot.joint_names,
                robot.units,
                of.displacement,
                of.range,
                of.peak_velocity,
                of.peak_acceleration,
                strict=True,
            )
        ]
        heads = ["joint", "displacement", "range", "peak velocity", "peak acceleration"]
        proved = f"<p>{escape(self.proof.statement)}</p>" if self.proof.statement else ""
        return html_table(repr(self), heads, rows) + proved


def on_turns(robot: Robot, q: Array) -> tuple[Array, Ints]:
    """Return joints q (K, n) rad with endless joints wrapped, and the turns (K, n) of all joints.

    The turns of endless joints, and of joints that a pose leaves free, are 0.
    """
    turning = ~robot.endless
    turning[robot.free] = False
    turn = np.where(turning, metric.turns_of(q), 0).astype(np.int64)
    return np.where(robot.endless, metric.wrap(q), q), turn


def _mean_step(time: Array) -> float:
    return float(time[-1] - time[0]) / (len(time) - 1)


def has_room(options: PlanOptions, robot: Robot, q: Array, posture: Ints, tool: Array) -> Bools:
    """Return whether the tool can back off by `options.retract` from joints at an end, (B,) bool.

    The margin of the joint limits is also kept where it has backed off to.

    Parameters
    ----------
    options : PlanOptions
    robot : Robot
    q : (B, n) rad
    posture : (B,) int
    tool : (4, 4) m
        T_flange_tip.
    """
    limits = None if options.comfort is None else options.comfort.limits
    margin = 0.0 if limits is None else limits.margin
    return can_back_off(robot, q, posture, tool, options.retract or 0.0, margin)
