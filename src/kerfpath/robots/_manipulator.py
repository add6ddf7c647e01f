"""A manipulator: geometry, joint convention, limits, and closed-form kinematics in bulk."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, as_pose, bools, floats, freeze, positive
from kerfpath.errors import InputError
from kerfpath.kernels import turns
from kerfpath.kernels.enclosure import Curves
from kerfpath.losses import Loss, Reason
from kerfpath.robots._burden import Burden
from kerfpath.robots._coupling import AXIS_3, Coupling
from kerfpath.robots._enclosure import Enclosure, ball_frames, require_cells
from kerfpath.robots._external import ExternalAxis, base_in_part, require_distinct_axes
from kerfpath.robots._families import FAMILIES, Family
from kerfpath.robots._solutions import Solutions, all_solutions, solutions_within
from kerfpath.urdf import KinematicChain, LinkBody

__all__ = ["Manipulator"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Manipulator(Burden):
    """A manipulator as `Robot` describes it, without the ways to read or change one."""

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

    def __post_init__(self) -> None:
        _set = object.__setattr__
        if self.kinematics not in FAMILIES:
            raise InputError(
                f"robot {self.id!r}: kinematics {self.kinematics!r} is none of "
                f"{', '.join(FAMILIES)}"
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
        require_distinct_axes(self.id, self.externals)
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
        """The kind of arm."""
        return FAMILIES[self.kinematics]

    @property
    def joints(self) -> int:
        """Number of joints, n, with the external axes."""
        return self.family.joints + len(self.externals)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint: rad, m of a linear external axis."""
        return ("rad",) * self.family.joints + tuple(axis.unit for axis in self.externals)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """What messages call each joint: "joint 1" and so on, an external axis by its name."""
        arm = tuple(f"joint {i + 1}" for i in range(self.family.joints))
        return arm + tuple(axis.name for axis in self.externals)

    @property
    def postures(self) -> int:
        """Number of postures, P: mu runs from 0 to P - 1."""
        return len(self.family.postures)

    def forward(self, q: ArrayLike) -> Array:
        """Return the flange poses (..., 4, 4) in the robot base of joint vectors q (..., n) rad.

        The base is that at zero of the external axes, and the part's place at zero, too.
        """
        q = np.asarray(q, dtype=float)
        rows = floats(q.reshape(-1, q.shape[-1]) if q.ndim else q, "q", (None, self.joints))
        T = np.empty((len(rows), 4, 4))
        n = self.family.joints
        self.family.forward_all(self.arm(), np.ascontiguousarray(rows[:, :n]), T)
        if self._placed:
            T = self.T_base_foot @ T @ self.T_end_flange
        if self.externals:
            T = base_in_part(self.externals, rows[:, n:]) @ T
        return freeze(T.reshape(*q.shape[:-1], 4, 4))

    def inverse(self, T: ArrayLike, *, within_limits: bool = True) -> Solutions:
        """Return every joint vector that brings the flange to T (4, 4) or (B, 4, 4), base frame.

        Parameters
        ----------
        T : (4, 4) or (B, 4, 4)
            Flange poses, m.
        within_limits : bool
            True: all postures, all turns inside the joint limits. False: all postures, joints in
            (-pi, pi], limits ignored.

        Raises
        ------
        InputError
            A wrong shape, or limits that are not known.
        """
        poses = np.asarray(T, dtype=float)
        poses = floats(poses[None] if poses.ndim == 2 else poses, "T", (None, 4, 4))
        q, reach = self.inverse_all(poses)
        if not within_limits:
            return all_solutions(q, reach)
        self.require_few_turns()
        return solutions_within(q, reach, self.joint_limits())

    def inverse_all(self, T: Array) -> tuple[Array, Bools]:
        """Return every posture of flange poses T (B, 4, 4), limits ignored, as bare arrays.

        q (B, P, n) in (-pi, pi], and reach (B, P): which of its rows are solutions. A family
        without free rotation brings the flange's origin and z-axis there.
        """
        if not self.family.free_rotation:
            q, reach = self.inverse_nodes(T, np.zeros(1), np.eye(4))
            return q[:, 0], reach[:, 0]
        q = np.empty((len(T), self.postures, self.joints))
        reach = np.empty(q.shape[:2], dtype=np.bool_)
        self.family.inverse_all(self.arm(), self._model_poses(T), q, reach)
        return q, reach

    def follow(self, T: Array, q: Array, posture: Ints) -> Array:
        """Return the joints (B, n) that bring the flange to T (B, 4, 4) on the branch of each q.

        Each on the turn nearest to its q (B, n), whose postures (B,) are given; NaN where the
        branch does not reach.
        """
        if self.family.follow_all is None:
            solved, reach = self.inverse_all(T)
            b = np.arange(len(q))
            found = np.where(reach[b, posture, None], solved[b, posture], np.nan)
            return np.asarray(found + 2 * np.pi * np.round((q - found) / (2 * np.pi)))
        found = np.array(q)
        self.family.follow_all(self.arm(), self._model_poses(T), found)
        return found

    def nearest(self, T: Array, q: Array) -> Array:
        """Return the joints (B, n) that bring the flange to T (B, 4, 4), next to each of q (B, n).

        Of any posture, each joint on the turn nearest to its q; NaN where there are none.
        """
        if self.family.follow_all is not None:
            return self.follow(T, q, np.zeros(len(T), dtype=np.int64))
        solved, reach = self.inverse_all(T)
        turned = solved + 2 * np.pi * np.round((q[:, None] - solved) / (2 * np.pi))
        apart = np.where(reach, np.abs(turned - q[:, None]).max(axis=2), np.inf)
        b, best = np.arange(len(q)), np.argmin(apart, axis=1)
        return np.where(reach[b, best, None], turned[b, best], np.nan)

    def inverse_nodes(self, H: Array, gamma: Array, T_flange_tip: Array) -> tuple[Array, Bools]:
        """Return every posture of task frames H (K, 4, 4) turned by each gamma (m,), with tool.

        q (K, m, P, n) in (-pi, pi] and reach (K, m, P); frames in the robot base, limits ignored.
        """
        self._require_alone()
        T_tip_flange = np.linalg.inv(T_flange_tip)
        if self.family.inverse_nodes is None:
            spin = np.tile(np.eye(4), (len(gamma), 1, 1))
            spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
            spin[:, 1, 0], spin[:, 0, 1] = np.sin(gamma), -np.sin(gamma)
            q, reach = self.inverse_all((H[:, None] @ (spin @ T_tip_flange)).reshape(-1, 4, 4))
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
        """The joint, 0-based, and the angle, rad, about which turning the wrist over mirrors it.

        The posture changes from 2 i to 2 i + 1 or back, and every other joint by a constant: a
        motion and the one with the wrist turned over have increments of the same size. None where
        a wrist is not spherical.
        """
        joint = self.family.flips
        if joint is None:
            return None
        arm = self.arm()
        return joint, float(arm.sign[joint] * arm.offset[joint])

    @property
    def encloses(self) -> bool:
        """Whether `enclose` proves where its joints are: a closed form, no external axis."""
        return self.family.enclose_all is not None and not self.externals

    def enclose(
        self, frames: Array, node: Ints, gamma: Array, half: Array, T_flange_tip: Array
    ) -> Enclosure:
        """Return where the joints of every posture may be on cells of gamma, proved.

        Parameters
        ----------
        frames : (K, 4, 4) m
            Task frames in the robot base.
        node : (C,) int
            Which of them each cell is of.
        gamma, half : (C,) rad
            Middle and half-width of each cell, the latter at most 1.
        T_flange_tip : (4, 4) m
            The tool.

        Raises
        ------
        InputError
            A family without proven bounds, or an external axis, see `encloses`; cells of frames
            that are not there, or with a half-width that is not a number from 0 to 1.
        """
        self._require_alone()
        if self.family.enclose_all is None:
            raise InputError(
                f"robot {self.id!r}: no proven bounds are known for {self.family.words}"
            )
        require_cells(len(frames), node, gamma, half)
        if len(node) < len(frames):
            frames, node = frames[node], np.arange(len(node))
        foot, end = self.T_base_foot, self.T_end_flange
        wrist = float(self.geometry[self.family.wrist])
        size = (len(node), self.postures)
        curves = Curves(np.zeros(size, np.uint8), *np.zeros((5, *size, self.joints)))
        balls = ball_frames(frames, T_flange_tip, foot, end, wrist)
        self.family.enclose_all(self.arm(), balls, node, gamma, half, curves)
        return Enclosure(**{k: freeze(a) for k, a in curves._asdict().items()})

    def arm(self) -> Any:
        """Return the geometry as the family's kernels take it."""
        lengths = {k: float(self.geometry[k]) for k in self.family.lengths}
        if not lengths:
            return self.family.model(chain=self.chain, sign=self.sign, offset=self.offset)
        return self.family.model(**lengths, sign=self.sign, offset=self.offset)

    def _model_poses(self, T: Array) -> Array:
        """Return flange poses (B, 4, 4) as poses of the model's end in its own base."""
        self._require_alone()
        if self._placed:
            T = np.linalg.inv(self.T_base_foot) @ T @ np.linalg.inv(self.T_end_flange)
        return np.ascontiguousarray(T)

    @property
    def _placed(self) -> bool:
        """Whether base or flange differ from the model's own."""
        return not all(np.array_equal(T, np.eye(4)) for T in (self.T_base_foot, self.T_end_flange))

    def joint_limits(self) -> turns.JointLimits:
        """Return the position limits as the kernels take them.

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

    def speed_limits(self) -> tuple[Array, Array]:
        """Return joint velocity (6,) rad/s and acceleration (6,) rad/s^2.

        Raises
        ------
        InputError
            One of them is not known; says how to give it.
        """
        if self.velocity is None:
            raise self._lacks("joint velocities", "velocity=")
        if self.acceleration is None:
            ratio = self.acceleration_ratio
            hint = f", or robot({self.id!r}, acceleration_ratio={ratio!r})" if ratio else ""
            raise self._lacks("joint accelerations", "acceleration=", hint)
        return self.velocity, self.acceleration

    def bounds(self) -> tuple[Reason, ...]:
        """Return the reasons for poses beyond a limit: low and high of each joint and coupling."""
        names = [*self.joint_names[: self.family.joints], *(c.name for c in self.couplings)]
        return tuple(Reason(end, name) for name in names for end in (Loss.LOW, Loss.HIGH))

    def reasons(self) -> tuple[Reason, ...]:
        """Return what each reason code of a dropped pose means, by code."""
        first = Reason(Loss.ADMITTED), Reason(Loss.UNREACHABLE)
        return (*first, *self.bounds(), Reason(Loss.UNWANTED))

    def require_few_turns(self) -> None:
        """Raise InputError where the limits leave more turns than the kernels have room for.

        Raises
        ------
        InputError
            Limits that are not known, or that leave more: some would be lost.
        """
        n, limits = self.family.joints, self.joint_limits()
        span = (limits.upper - limits.lower)[:n] / (2 * np.pi)
        number = np.where(limits.endless[:n], 1.0, np.floor(span) + 1).prod()
        if number > turns.MOST_TURNS:
            raise InputError(
                f"robot {self.id!r}: its limits leave {number:g} combinations of turns, at most "
                f"{turns.MOST_TURNS} are told apart; call joints that turn without end endless, or "
                "narrow their limits"
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
                f"robot {self.id!r}: limits of joint {i + 1} are reversed, lower "
                f"{np.degrees(self.lower[i]):g} deg is not below upper "
                f"{np.degrees(self.upper[i]):g} deg"
            )

    def _require_alone(self) -> None:
        if self.externals:
            names = ", ".join(axis.name for axis in self.externals)
            raise InputError(
                f"inverse: with {names} a pose has solutions without end; ask "
                "robot.held(x).inverse(T), x the values of the external axes"
            )

    def _lacks(self, what: str, keys: str, hint: str = "") -> InputError:
        why = f" ({self.limits_missing})" if self.limits_missing else ""
        return InputError(
            f"robot {self.id!r}: {what} are not known{why}; "
            f"give them with robot.with_limits({keys}...){hint}"
        )


def _for_each(value: ArrayLike, joints: int) -> ArrayLike:
    """Return one number as that number for each joint; anything longer as it is."""
    return np.full(joints, value) if np.ndim(value) == 0 else value
