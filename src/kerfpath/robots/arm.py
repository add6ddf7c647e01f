"""A manipulator: kinematics of many joint vectors or poses at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    as_pose,
    bools,
    floats,
    freeze,
    html_table,
    in_degrees,
    positive,
    scalar,
    short_repr,
)
from kerfpath.dynamics import STANDARD_GRAVITY, ArmDynamics, Load
from kerfpath.errors import InputError
from kerfpath.kernels import enclosure, turns
from kerfpath.kernels.enclosure import Curves
from kerfpath.limits import JerkLimit, TorqueLimit
from kerfpath.losses import Loss, Reason
from kerfpath.robots.external_axes import ExternalAxis, base_in_part, require_distinct_axes
from kerfpath.robots.families import FAMILIES, Family
from kerfpath.robots.general import AXIS_3, Coupling
from kerfpath.urdf import ChainInertia, KinematicChain, LinkBody

# -----------------------------------------------------------------------------
# Jerk and torque limits of an arm, its inertia and its load.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Burden:
    """The jerk, torque and mass data of a `Robot`, for the joints of the arm only."""

    jerk: Array | None = None
    torque: Array | None = None
    inertia: ChainInertia | None = None
    inertia_missing: str = ""
    load: Load | None = None
    gravity: Array = field(default_factory=lambda: np.array(STANDARD_GRAVITY))

    __repr__ = short_repr

    def cast_burden(self, joints: int) -> None:
        """Cast and check the fields for an arm with this number of joints; for `__post_init__`."""
        _set = object.__setattr__
        if self.jerk is not None:
            jerk = floats(self.jerk, "jerk", (joints,), infinite=True)
            _set(self, "jerk", JerkLimit(bound=jerk).bound)
        if self.torque is not None:
            _set(self, "torque", positive(self.torque, "torque", (joints,)))
        _set(self, "gravity", floats(self.gravity, "gravity", (3,)))


# -----------------------------------------------------------------------------
# Proven bounds on the joints over a cell of gamma, and the frames that they are computed from.

ROUNDING = 4.0 * 2.0**-52
"""Error of a sum of four products as a share of the sum of their sizes; twice the true bound."""
MORE = 1.0 + 1e-12
"""Factor on a radius that covers its own rounding."""
GRAM = 2e-15
"""Rounding error of the norm of R^T R - 1, 3 x 3: 9 entries of 3 products of numbers up to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Enclosure:
    """Proven bounds on the joints of each posture over cells of gamma, rounding included.

    On cell c, where gamma = m + t and |t| <= h, joint i of every solution of posture p lies, modulo
    full turns, within `radius` of center + slope t + [low, high] t^2 / 2. A solution is a joint
    vector whose flange pose is that of the task. Where the given rotation matrices are not exactly
    orthogonal, the bounds hold for every rotation within that error. Limits are ignored.

    Parameters
    ----------
    status : (C, P) uint8
        `NONE` (0): the posture has no solution anywhere on the cell. `SMOOTH` (1): it has one
        solution for each t, which moves continuously. `BOX` (2): slopes and curvatures are zero,
        and the radius covers all solutions that exist; it is pi where an angle is free.
    center : (C, P, n) rad
        Value at t = 0, in (-pi, pi].
    slope : (C, P, n) rad/rad
    low, high : (C, P, n) rad/rad^2
    radius : (C, P, n) rad
    """

    status: NDArray[np.uint8]
    center: Array
    slope: Array
    low: Array
    high: Array
    radius: Array

    __repr__ = short_repr


def require_cells(frames: int, node: Ints, gamma: Array, half: Array) -> None:
    """Raise InputError unless each cell has a valid frame, middle and half-width (0 to 1 rad)."""
    if not node.shape == gamma.shape == half.shape == (len(node),):
        raise InputError(
            "enclose: expected node, gamma and half of the same length, got shapes "
            f"{node.shape}, {gamma.shape}, {half.shape}"
        )
    bad = np.flatnonzero(~((node >= 0) & (node < frames)))
    if bad.size:
        raise InputError(
            f"enclose: expected frames from 0 to {frames - 1}, got frame {node[bad[0]]} for cell "
            f"{bad[0]}"
        )
    bad = np.flatnonzero(~(np.isfinite(gamma) & (half >= 0.0) & (half <= 1.0)))
    if bad.size:
        i = int(bad[0])
        raise InputError(
            f"enclose: expected cells with a half-width from 0 to 1 rad, got {gamma[i]:g} +- "
            f"{half[i]:g} rad for cell {i}"
        )


def ball_frames(
    H: Array, T_flange_tip: Array, T_base_foot: Array, T_end_flange: Array, wrist: float
) -> enclosure.Frames:
    """Return task frames H (K, 4, 4) and the tool in the form of the kernels, with error radii.

    `wrist` is the distance (m) of the wrist centre behind the end of the model.
    """
    base = _rigid(H)
    if not np.array_equal(T_base_foot, np.eye(4)):
        base = _product(_inverse(_rigid(T_base_foot)), base)
    end = _inverse(_rigid(T_flange_tip))
    if not np.array_equal(T_end_flange, np.eye(4)):
        end = _product(end, _inverse(_rigid(T_end_flange)))
    to_wrist = np.eye(4)
    to_wrist[2, 3] = -wrist
    end = _product(end, (to_wrist, np.zeros((4, 4))))
    (B, rB), (E, rE) = base, end
    return enclosure.Frames(
        np.ascontiguousarray(B[:, :3]),
        np.ascontiguousarray(rB[:, :3]),
        np.ascontiguousarray(E[:3]),
        np.ascontiguousarray(rE[:3]),
    )


def _rigid(T: Array) -> tuple[Array, Array]:
    """Return poses (..., 4, 4) and radii that enclose the poses with the nearest rotation.

    A singular value s of R has |s - 1| <= |s^2 - 1|, which the norm of R^T R - 1 bounds; the same
    holds for the inverse, down to s = 0.62.
    """
    R = T[..., :3, :3]
    gram = np.swapaxes(R, -1, -2) @ R - np.eye(3)
    radius = np.zeros(T.shape)
    norm = np.linalg.norm(gram, axis=(-2, -1))
    radius[..., :3, :3] = ((norm + GRAM) * MORE)[..., None, None]
    return T, radius


def _inverse(T: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the inverse of rigid motions, the rotation transposed."""
    m, r = (np.swapaxes(a, -1, -2).copy() for a in T)
    m[..., 3, :3] = r[..., 3, :3] = 0.0
    place, around = T[0][..., :3, 3:], T[1][..., :3, 3:]
    p, rp = _product((m[..., :3, :3], r[..., :3, :3]), (place, around))
    m[..., :3, 3:], r[..., :3, 3:] = -p, rp
    return m, r


def _product(a: tuple[Array, Array], b: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the product of two matrices and its radius; each is given as (matrix, radius)."""
    (A, rA), (B, rB) = a, b
    size = np.abs(A) @ np.abs(B)
    radius = np.abs(A) @ rB + rA @ (np.abs(B) + rB) + ROUNDING * size
    return A @ B, radius * MORE


# -----------------------------------------------------------------------------
# Solutions of the inverse kinematics: postures and turns of many poses in one table.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """Inverse kinematics of B poses: one row per solution.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors.
    pose : (N,) int
        Index of the pose that each row solves, in increasing order.
    posture : (N,) int
        Posture mu of each row; see `Family.postures`.
    turn : (N, n) int
        Number of turns of 2 pi that each joint is away from (-pi, pi].
    """

    q: Array
    pose: Ints
    posture: Ints
    turn: Ints

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.q)


def all_solutions(q: Array, reach: Bools) -> Solutions:
    """Return the rows of q (B, P, n) that `reach` (B, P) marks as solutions, limits ignored."""
    pose, posture = np.nonzero(reach)
    found = q[reach]
    turn = np.zeros(found.shape, dtype=np.int64)
    return Solutions(q=freeze(found), pose=freeze(pose), posture=freeze(posture), turn=freeze(turn))


def solutions_within(q: Array, reach: Bools, limits: turns.JointLimits) -> Solutions:
    """Return all turns within the limits of the rows of q (B, P, n) that `reach` (B, P) marks."""
    B, P, n = q.shape
    q, reach = q[:, None], reach[:, None]  # one node a pose, one sample of gamma
    count, reason = np.empty(B, np.int64), np.empty(reach.shape, np.uint8)
    turns.count_admissible(q, reach, freeze(np.ones(P, np.bool_)), limits, count, reason)
    total = int(count.sum())
    found, small = np.empty((total, n)), np.empty((total, n), np.int8)
    sample, posture = np.empty(total, np.int32), np.empty(total, np.int8)
    turns.fill_admissible(q, reason, limits, found, sample, posture, small)
    # One joint alone may have more turns than the small integers of a graph can count.
    pose = np.repeat(np.arange(B), count)
    turn = np.rint((found - q[pose, 0, posture]) / (2 * np.pi))
    return Solutions(
        q=freeze(found),
        pose=freeze(pose),
        posture=freeze(posture.astype(np.int64)),
        turn=freeze(turn.astype(np.int64)),
    )


# -----------------------------------------------------------------------------
# The data of a manipulator: geometry, joint convention, and the limits of its joints.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Limited(Burden):
    """The data of a manipulator and its limits; see `Robot` for the fields."""

    id: str
    geometry: dict[str, float]
    kinematics: str = "opw"
    sign: Array = field(default_factory=lambda: np.ones(()))
    offset: Array = field(default_factory=lambda: np.zeros(()))
    T_base_foot: Array = field(default_factory=lambda: np.eye(4))
    T_end_flange: Array = field(default_factory=lambda: np.eye(4))
    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    endless: Bools = field(default_factory=lambda: np.zeros((), bool))
    couplings: tuple[Coupling, ...] = ()
    axis_3: str = ""
    chain: KinematicChain | None = None
    bodies: tuple[LinkBody, ...] = ()
    externals: tuple[ExternalAxis, ...] = ()
    elbow_step: float | None = None
    manufacturer: str = ""
    model: str = ""
    payload: float | None = None
    reach: float | None = None
    acceleration_source: str = ""
    acceleration_ratio: str = ""
    limits_missing: str = ""
    notes: tuple[str, ...] = ()
    frames: dict[str, object] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        known = f"accelerations {'not ' if self.acceleration is None else ''}known"
        words = f"{self.manufacturer} {self.model}, {self.joints} joints, {self.kinematics}"
        return f"Robot({self.id!r}, {words}, {known})"

    def _repr_html_(self) -> str:
        """Return a small table for notebooks: the joints and their limits."""
        limits = {"lower": "", "upper": "", "velocity": "/s", "acceleration": "/s^2"}
        rows = []
        for i, (name, unit) in enumerate(zip(self.joint_names, self.units, strict=True)):
            row = [name]
            for limit, per in limits.items():
                values = getattr(self, limit)
                said = "not known" if values is None else in_degrees(values[i], unit + per)
                row.append("endless" if self.endless[i] and not per else said)
            rows.append(row)
        return html_table(repr(self), ["joint", *limits], rows)

    def __post_init__(self) -> None:
        _set = object.__setattr__
        if self.kinematics not in FAMILIES:
            raise InputError(
                f"robot {self.id!r}: kinematics: expected one of {', '.join(FAMILIES)}, got "
                f"{self.kinematics!r}"
            )
        n, arm, lengths = self.joints, self.family.joints, self.family.lengths
        if self.axis_3 not in AXIS_3:
            raise InputError(f"axis_3: expected one of {AXIS_3}, got {self.axis_3!r}")
        missing = [k for k in lengths if k not in self.geometry]
        if missing:
            raise InputError(f"robot {self.id!r}: geometry lacks {', '.join(missing)} (m)")
        for name in ("sign", "offset"):
            _set(self, name, floats(_for_each(getattr(self, name), arm), name, (arm,)))
        if not (np.abs(self.sign) == 1).all():
            raise InputError(f"robot {self.id!r}: sign must be +1 or -1, got {self.sign.tolist()}")
        for name in ("T_base_foot", "T_end_flange"):
            _set(self, name, as_pose(getattr(self, name), name))
        _set(self, "endless", bools(_for_each(self.endless, n), "endless", (n,)))
        require_distinct_axes(self.id, self.externals, self.family.given is not None)
        if self.elbow_step is not None:
            if self.family.given is None:
                raise InputError(
                    f"robot {self.id!r}: poses leave no joint of this arm free; remove elbow_step"
                )
            _set(self, "elbow_step", scalar(self.elbow_step, "elbow_step", unit="rad", above=0.0))
        for coupling in self.couplings:
            floats(coupling.row, "coupling row", (n,))
        for name in ("lower", "upper"):
            if getattr(self, name) is not None:
                _set(self, name, floats(getattr(self, name), name, (n,)))
        for name in ("velocity", "acceleration"):
            if getattr(self, name) is not None:
                _set(self, name, positive(getattr(self, name), name, (n,)))
        self.cast_burden(arm)
        self._require_order()

    @property
    def family(self) -> Family:
        """The kinematic family of the arm."""
        return FAMILIES[self.kinematics]

    @property
    def joints(self) -> int:
        """Number of joints n, external axes included."""
        return self.family.joints + len(self.externals)

    @property
    def free(self) -> Ints:
        """Columns of q that a pose leaves free: the family's `given` joint and external axes."""
        n, given = self.family.joints, self.family.given
        return np.array([*(() if given is None else (given,)), *range(n, self.joints)], np.int64)

    @property
    def free_names(self) -> str:
        """Names of the columns of `free` in messages."""
        return ", ".join(self.joint_names[i] for i in self.free)

    def require_no_free_joint(self, what: str) -> None:
        """Raise InputError where poses leave a joint of the arm free, which `what` cannot handle.

        `what` is the name of the feature in the message.
        """
        if self.family.given is not None:
            name = self.joint_names[self.family.given]
            raise InputError(
                f"{what} does not support seven-axis arms: poses leave {name} of robot "
                f"{self.id!r} free"
            )

    @property
    def solved(self) -> Ints:
        """Columns of q that follow from the pose and the columns of `free`."""
        return np.setdiff1d(np.arange(self.joints), self.free)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint: rad, or m for a linear external axis."""
        return ("rad",) * self.family.joints + tuple(axis.unit for axis in self.externals)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Name of each joint in messages: "joint 1" and so on, or the external axis's name."""
        arm = tuple(f"joint {i + 1}" for i in range(self.family.joints))
        return arm + tuple(axis.name for axis in self.externals)

    @property
    def postures(self) -> int:
        """Number of postures P: mu runs from 0 to P - 1."""
        return len(self.family.postures)

    def joint_limits(self) -> turns.JointLimits:
        """Return the position limits (rad, or m for a linear axis) in the form of the kernels.

        Raises
        ------
        InputError
            The limits are not known.
        """
        if self.lower is None or self.upper is None:
            raise self._lacks("joint limits", "lower= and upper=")
        rows = [c.row for c in self.couplings]
        return turns.JointLimits(
            lower=self.lower,
            upper=self.upper,
            endless=self.endless,
            rows=np.array(rows).reshape(-1, self.joints),
            row_lower=np.array([c.lower for c in self.couplings]),
            row_upper=np.array([c.upper for c in self.couplings]),
        )

    def turn_limits(self) -> turns.JointLimits:
        """Return the limits that select the turns of solutions; columns of `free` count as endless.

        Raises
        ------
        InputError
            As `joint_limits`.
        """
        limits, endless = self.joint_limits(), self.endless.copy()
        endless[self.free] = True
        return limits._replace(endless=endless)

    def speed_limits(self) -> tuple[Array, Array]:
        """Return the joint velocities (n,) rad/s and accelerations (n,) rad/s^2.

        Those of a linear external axis are in m/s and m/s^2.

        Raises
        ------
        InputError
            One of them is not known; the message says how to give it.
        """
        velocity = self.velocity_limits()
        if self.acceleration is None:
            ratio = self.acceleration_ratio
            hint = f", or robot({self.id!r}, acceleration_ratio={ratio!r})" if ratio else ""
            raise self._lacks("joint accelerations", "acceleration=", hint)
        return velocity, self.acceleration

    def velocity_limits(self) -> Array:
        """Return the joint velocities (n,) rad/s, or m/s for a linear external axis.

        Raises
        ------
        InputError
            They are not known.
        """
        if self.velocity is None:
            raise self._lacks("joint velocities", "velocity=")
        return self.velocity

    def torque_limit(self) -> TorqueLimit | None:
        """Return the torque limit; None where no load is given.

        Raises
        ------
        InputError
            A load is given, but no robot description with a positive definite inertia of every
            link, or no torque limits; or the robot has an external axis or seven axes.
        """
        if self.load is None:
            return None
        why = self.inertia_missing or "the masses of its links come only from a description (URDF)"
        if self.externals:
            names = " and ".join(axis.name for axis in self.externals)
            why = f"the effect of {names} on them is not known"
        elif self.free.size:
            why = f"torque limits of an arm whose {self.free_names} is free are not supported yet"
        if self.chain is None or self.inertia is None or self.free.size:
            raise InputError(f"robot {self.id!r}: its torques cannot be computed: {why}")
        if self.torque is None:
            raise self._lacks("joint torques", "torque=")
        inertia = self.load.on(self.inertia, self.chain.end)
        dynamics = ArmDynamics(chain=self.chain, inertia=inertia, gravity=self.gravity)
        return TorqueLimit(bound=self.torque, dynamics=dynamics)

    def jerk_limit(self) -> JerkLimit | None:
        """Return the jerk limit, infinite for external axes; None where no jerks are known."""
        if self.jerk is None:
            return None
        free = np.full(self.joints - len(self.jerk), np.inf)
        return JerkLimit(bound=np.append(self.jerk, free))

    def bounds(self) -> tuple[Reason, ...]:
        """Return the loss reasons for limits: low and high of each arm joint and coupling."""
        names = [*self.joint_names[: self.family.joints], *(c.name for c in self.couplings)]
        return tuple(Reason(end, name) for name in names for end in (Loss.LOW, Loss.HIGH))

    def reasons(self) -> tuple[Reason, ...]:
        """Return the meaning of each reason code of a dropped pose; the code is the index."""
        first = Reason(Loss.ADMITTED), Reason(Loss.UNREACHABLE)
        return (*first, *self.bounds(), Reason(Loss.UNWANTED))

    def require_few_turns(self) -> None:
        """Require that the limits allow no more combinations of turns than the kernels can hold.

        Raises
        ------
        InputError
            The limits are not known, or they allow more combinations, of which some would be lost.
        """
        n, limits = self.family.joints, self.turn_limits()
        span = (limits.upper - limits.lower)[:n] / (2 * np.pi)
        number = np.where(limits.endless[:n], 1.0, np.floor(span) + 1).prod()
        if number > turns.MOST_TURNS:
            raise InputError(
                f"robot {self.id!r}: expected limits that allow at most {turns.MOST_TURNS} "
                f"combinations of turns, got {number:g}; mark joints that turn without end as "
                "endless, or narrow their limits"
            )

    def _require_order(self) -> None:
        """Raise InputError where position limits are reversed."""
        if self.lower is None or self.upper is None:
            return
        n = self.family.joints
        for axis, lower, upper in zip(self.externals, self.lower[n:], self.upper[n:], strict=True):
            axis.require_range(float(lower), float(upper))
        reversed_ = np.flatnonzero(~(self.lower[:n] < self.upper[:n]))
        if reversed_.size:
            i = int(reversed_[0])
            raise InputError(
                f"robot {self.id!r}: the limits of joint {i + 1} are reversed: lower "
                f"{np.degrees(self.lower[i]):g} deg is not below upper "
                f"{np.degrees(self.upper[i]):g} deg"
            )

    def _lacks(self, what: str, keys: str, hint: str = "") -> InputError:
        why = f" ({self.limits_missing})" if self.limits_missing else ""
        return InputError(
            f"robot {self.id!r}: {what} are not known{why}; "
            f"give them with robot.with_limits({keys}...){hint}"
        )


def _for_each(value: ArrayLike, joints: int) -> ArrayLike:
    """Return a scalar repeated for each joint; any other array as it is."""
    return np.full(joints, value) if np.ndim(value) == 0 else value


# -----------------------------------------------------------------------------
# A manipulator: kinematics of many joint vectors or poses at once.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Manipulator(Limited):
    """The kinematics of a `Robot`, without the methods that read or change one."""

    def forward(self, q: ArrayLike) -> Array:
        """Return the flange poses (..., 4, 4) m in the robot base at joint vectors q (..., n) rad.

        With external axes, poses are relative to the part: expressed in the robot base with all
        external axes at zero, as if the part did not move.

        Raises
        ------
        InputError
            q has a wrong shape, or is not finite.
        """
        q = np.asarray(q, dtype=float)
        rows = floats(q.reshape(-1, q.shape[-1]) if q.ndim else q, "q", (None, self.joints))
        T = np.empty((len(rows), 4, 4))
        n = self.family.joints
        self.family.forward_all(self.arm(), np.array(rows[:, :n], order="C"), T)
        if self._placed:
            T = self.T_base_foot @ T @ self.T_end_flange
        if self.externals:
            T = base_in_part(self.externals, rows[:, n:]) @ T
        return freeze(T.reshape(*q.shape[:-1], 4, 4))

    def inverse(
        self, T: ArrayLike, *, given: ArrayLike | None = None, within_limits: bool = True
    ) -> Solutions:
        """Return every joint vector that brings the flange to T (4, 4) or (B, 4, 4), base frame.

        Parameters
        ----------
        T : (4, 4) or (B, 4, 4)
            Flange poses, m.
        given : float or (B,) rad, optional
            Value of joint 3 of a seven-axis arm; not allowed for other arms.
        within_limits : bool
            True: all postures, all turns inside the joint limits. False: all postures, joints in
            (-pi, pi], limits ignored.

        Raises
        ------
        InputError
            A wrong shape; `given` missing or not allowed; limits that are not known or leave too
            many turns; a robot with external axes (use `held`).
        """
        poses = np.asarray(T, dtype=float)
        poses = floats(poses[None] if poses.ndim == 2 else poses, "T", (None, 4, 4))
        if given is not None:
            given = floats(np.broadcast_to(given, len(poses)), "given", (len(poses),))
        q, reach = self.inverse_all(poses, given)
        if not within_limits:
            return all_solutions(q, reach)
        self.require_few_turns()
        if given is not None:
            limits, i = self.joint_limits(), self.free[0]
            inside = (given >= limits.lower[i]) & (given <= limits.upper[i]) | limits.endless[i]
            reach = reach & inside[:, None]
        return solutions_within(q, reach, self.turn_limits())

    def inverse_all(self, T: Array, given: Array | None = None) -> tuple[Array, Bools]:
        """Return the solutions of every posture for flange poses T (B, 4, 4) m, limits ignored.

        Returns q (B, P, n) in (-pi, pi] and reach (B, P), which says which rows are solutions. A
        family without free rotation matches only the flange's origin and z-axis; one with a `given`
        joint needs its angles (B,) rad.

        Raises
        ------
        InputError
            `given` is missing or not allowed, or the robot has external axes.
        """
        self._require_given(given)
        if not self.family.free_rotation:
            q, reach = self.inverse_nodes(T, np.zeros(1), np.eye(4))
            return q[:, 0], reach[:, 0]
        q = np.empty((len(T), self.postures, self.joints))
        reach = np.empty(q.shape[:2], dtype=np.bool_)
        more = () if given is None else (given,)
        self.family.inverse_all(self.arm(), self._model_poses(T), *more, q, reach)
        return q, reach

    def follow(self, T: Array, q: Array, posture: Ints) -> Array:
        """Return the joints (B, n) that bring the flange to T (B, 4, 4) on the branch of each q.

        Each joint is on the turn nearest to q (B, n), whose postures (B,) are given; rows are NaN
        where the branch does not reach the pose. A `given` joint keeps its value.
        """
        if self.family.follow_all is None:
            solved, reach = self.inverse_all(T, self.given_of(q))
            b = np.arange(len(q))
            found = np.where(reach[b, posture, None], solved[b, posture], np.nan)
            return np.asarray(found + 2 * np.pi * np.round((q - found) / (2 * np.pi)))
        found = np.array(q)
        self.family.follow_all(self.arm(), self._model_poses(T), found)
        return found

    def nearest(self, T: Array, q: Array) -> Array:
        """Return the joints (B, n) rad nearest to q (B, n) that bring the flange to T (B, 4, 4).

        They may be of any posture, with each joint on the turn nearest to q; rows are NaN where
        there is no solution.
        """
        if self.family.follow_all is not None:
            return self.follow(T, q, np.zeros(len(T), dtype=np.int64))
        solved, reach = self.inverse_all(T, self.given_of(q))
        turned = solved + 2 * np.pi * np.round((q[:, None] - solved) / (2 * np.pi))
        apart = np.where(reach, np.abs(turned - q[:, None]).max(axis=2), np.inf)
        b, best = np.arange(len(q)), np.argmin(apart, axis=1)
        return np.where(reach[b, best, None], turned[b, best], np.nan)

    def inverse_nodes(
        self, H: Array, gamma: Array, T_flange_tip: Array, given: Array | None = None
    ) -> tuple[Array, Bools]:
        """Return the solutions of every posture for task frames H (K, 4, 4) m at each gamma (m,).

        Returns q (K, m, P, n) in (-pi, pi] and reach (K, m, P). Frames are in the robot base, gamma
        is in rad, and limits are ignored. A family with a `given` joint needs its angles (K,) rad.

        Raises
        ------
        InputError
            `given` is missing or not allowed, or the robot has external axes.
        """
        self._require_alone()
        T_tip_flange = np.linalg.inv(T_flange_tip)
        if self.family.inverse_nodes is None:
            spin = np.tile(np.eye(4), (len(gamma), 1, 1))
            spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
            spin[:, 1, 0], spin[:, 0, 1] = np.sin(gamma), -np.sin(gamma)
            each = None if given is None else np.repeat(given, len(gamma))
            T = (H[:, None] @ (spin @ T_tip_flange)).reshape(-1, 4, 4)
            q, reach = self.inverse_all(T, each)
            size = (len(H), len(gamma), self.postures)
            return q.reshape(*size, self.joints), reach.reshape(size)
        if self._placed:
            H = np.linalg.inv(self.T_base_foot) @ H
            T_tip_flange = T_tip_flange @ np.linalg.inv(self.T_end_flange)
        q = np.empty((len(H), len(gamma), self.postures, self.joints))
        reach = np.empty(q.shape[:3], np.bool_)
        self.family.inverse_nodes(self.arm(), H, gamma, T_tip_flange, q, reach)
        return q, reach

    @property
    def flip(self) -> tuple[int, float] | None:
        """The joint (from 0) that a wrist flip mirrors, and the angle (rad) about which it does.

        The posture changes from 2 i to 2 i + 1 or back, and every other joint changes by a
        constant, so a motion and its flipped copy have increments of the same size. None where the
        wrist is not spherical.
        """
        joint = self.family.flips
        if joint is None:
            return None
        arm = self.arm()
        return joint, float(arm.sign[joint] * arm.offset[joint])

    @property
    def encloses(self) -> bool:
        """Whether `enclose` works: the family has proven bounds and there is no external axis."""
        return self.family.enclose_all is not None and not self.externals

    def enclose(
        self, frames: Array, node: Ints, gamma: Array, half: Array, T_flange_tip: Array
    ) -> Enclosure:
        """Return proven bounds on the joints of every posture over cells of gamma.

        Parameters
        ----------
        frames : (K, 4, 4) m
            Task frames in the robot base.
        node : (C,) int
            Index of the frame of each cell.
        gamma, half : (C,) rad
            Middle and half-width of each cell; half-widths are at most 1.
        T_flange_tip : (4, 4) m
            The tool.

        Raises
        ------
        InputError
            The family has no proven bounds or there is an external axis, see `encloses`; an index
            of a frame is out of range, or a half-width is not a number from 0 to 1.
        """
        self._require_alone()
        if self.family.enclose_all is None:
            raise InputError(
                f"robot {self.id!r}: its family ({self.family.words}) has no proven bounds"
            )
        require_cells(len(frames), node, gamma, half)
        if len(node) < len(frames):
            frames, node = frames[node], np.arange(len(node))
        foot, end = self.T_base_foot, self.T_end_flange
        wrist = float(self.geometry[self.family.wrist])
        size = (len(node), self.postures)
        curves = Curves(np.zeros(size, np.uint8), *np.zeros((5, *size, self.joints)))
        balls = ball_frames(frames, T_flange_tip, foot, end, wrist)
        self.family.enclose_all(self.arm(), balls, node, np.array(gamma), half, curves)
        return Enclosure(**{k: freeze(a) for k, a in curves._asdict().items()})

    def arm(self) -> Any:
        """Return the geometry in the form of the family's kernels."""
        lengths = {k: float(self.geometry[k]) for k in self.family.lengths}
        if not lengths:
            return self.family.model(chain=self.chain, sign=self.sign, offset=self.offset)
        return self.family.model(**lengths, sign=self.sign, offset=self.offset)

    def _model_poses(self, T: Array) -> Array:
        """Return flange poses (B, 4, 4) as poses of the model's end in the model's base."""
        self._require_alone()
        if self._placed:
            T = np.linalg.inv(self.T_base_foot) @ T @ np.linalg.inv(self.T_end_flange)
        return np.array(T, order="C")

    def given_of(self, q: Array) -> Array | None:
        """Return the `given` angles (B,) rad in q (B, n); None where no joint is `given`."""
        i = self.family.given
        return None if i is None else np.ascontiguousarray(q[:, i])

    @property
    def _placed(self) -> bool:
        """Whether base or flange differ from the model's own."""
        return not all(np.array_equal(T, np.eye(4)) for T in (self.T_base_foot, self.T_end_flange))

    def _require_alone(self) -> None:
        if self.externals:
            names = ", ".join(axis.name for axis in self.externals)
            raise InputError(
                f"inverse: with {names} a pose has infinitely many solutions; use "
                "robot.held(x).inverse(T), where x are the values of the external axes"
            )

    def _require_given(self, given: Array | None) -> None:
        """Raise InputError unless an angle is given where the family takes one, and only there."""
        i = self.family.given
        if i is not None and given is None:
            raise InputError(
                f"inverse: a pose has infinitely many solutions ({self.family.words}); give the "
                f"value of joint {i + 1} (rad), as in robot.inverse(T, given=0.0)"
            )
        if i is None and given is not None:
            raise InputError(
                f"inverse: given=: poses leave no joint free ({self.family.words}); remove it"
            )
