"""The data of a manipulator: geometry, joint convention, and the limits of its joints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, as_pose, bools, floats, positive, scalar
from kerfpath._repr import html_table, in_degrees
from kerfpath.dynamics import ArmDynamics
from kerfpath.errors import InputError
from kerfpath.kernels import turns
from kerfpath.limits import JerkLimit, TorqueLimit
from kerfpath.losses import Loss, Reason
from kerfpath.robots._burden import Burden
from kerfpath.robots._coupling import AXIS_3, Coupling
from kerfpath.robots._external import ExternalAxis, require_distinct_axes
from kerfpath.robots._families import FAMILIES, Family
from kerfpath.urdf import KinematicChain, LinkBody

__all__ = ["Limited"]


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
