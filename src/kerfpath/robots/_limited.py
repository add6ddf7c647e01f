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
    """The data of a manipulator as `Robot` describes them, and what limits it."""

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
        require_distinct_axes(self.id, self.externals, self.family.given is not None)
        if self.elbow_step is not None:
            if self.family.given is None:
                raise InputError(f"robot {self.id!r}: no joint of it is free; remove elbow_step")
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
        """The kind of arm."""
        return FAMILIES[self.kinematics]

    @property
    def joints(self) -> int:
        """Number of joints, n, with the external axes."""
        return self.family.joints + len(self.externals)

    @property
    def free(self) -> Ints:
        """Columns of q that a pose leaves free: the family's `given` joint, the external axes."""
        n, given = self.family.joints, self.family.given
        return np.array([*(() if given is None else (given,)), *range(n, self.joints)], np.int64)

    @property
    def free_names(self) -> str:
        """What messages call the columns of `free`."""
        return ", ".join(self.joint_names[i] for i in self.free)

    def require_no_free_joint(self, what: str) -> None:
        """Raise InputError where poses leave a joint of the arm free, of what does not know it."""
        if self.family.given is not None:
            name = self.joint_names[self.family.given]
            raise InputError(
                f"{what} does not know arms of seven axes: poses leave {name} of robot "
                f"{self.id!r} free"
            )

    @property
    def solved(self) -> Ints:
        """Columns of q that follow from the pose, where those of `free` are known."""
        return np.setdiff1d(np.arange(self.joints), self.free)

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

    def turn_limits(self) -> turns.JointLimits:
        """Return the limits that distinguish turns of solutions: a `given` joint is on its own.

        Raises
        ------
        InputError
            As `joint_limits`.
        """
        limits, endless = self.joint_limits(), self.endless.copy()
        endless[self.free] = True
        return limits._replace(endless=endless)

    def speed_limits(self) -> tuple[Array, Array]:
        """Return joint velocity (6,) rad/s and acceleration (6,) rad/s^2.

        Raises
        ------
        InputError
            One of them is not known; says how to give it.
        """
        velocity = self.velocity_limits()
        if self.acceleration is None:
            ratio = self.acceleration_ratio
            hint = f", or robot({self.id!r}, acceleration_ratio={ratio!r})" if ratio else ""
            raise self._lacks("joint accelerations", "acceleration=", hint)
        return velocity, self.acceleration

    def velocity_limits(self) -> Array:
        """Return the joint velocities (n,) rad/s.

        Raises
        ------
        InputError
            They are not known.
        """
        if self.velocity is None:
            raise self._lacks("joint velocities", "velocity=")
        return self.velocity

    def torque_limit(self) -> TorqueLimit | None:
        """Return what limits the torques; None where no load is given.

        Raises
        ------
        InputError
            A load is given, but no robot description with a positive definite inertia of every
            link, or no torque limits; or there is an external axis, or a seventh one.
        """
        if self.load is None:
            return None
        why = self.inertia_missing or "only a description (URDF) says what its links weigh"
        if self.externals:
            names = " and ".join(axis.name for axis in self.externals)
            why = f"what {names} does to them is not known"
        elif self.free.size:
            why = f"of an arm whose {self.free_names} is free limits on them are not kept yet"
        if self.chain is None or self.inertia is None or self.free.size:
            raise InputError(f"robot {self.id!r}: its torques are not known: {why}")
        if self.torque is None:
            raise self._lacks("joint torques", "torque=")
        inertia = self.load.on(self.inertia, self.chain.end)
        dynamics = ArmDynamics(chain=self.chain, inertia=inertia, gravity=self.gravity)
        return TorqueLimit(bound=self.torque, dynamics=dynamics)

    def jerk_limit(self) -> JerkLimit | None:
        """Return what limits the jerks, nothing that of an external axis; None where none does."""
        if self.jerk is None:
            return None
        free = np.full(self.joints - len(self.jerk), np.inf)
        return JerkLimit(bound=np.append(self.jerk, free))

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
        n, limits = self.family.joints, self.turn_limits()
        span = (limits.upper - limits.lower)[:n] / (2 * np.pi)
        number = np.where(limits.endless[:n], 1.0, np.floor(span) + 1).prod()
        if number > turns.MOST_TURNS:
            raise InputError(
                f"robot {self.id!r}: its limits leave {number:g} combinations of turns, at most "
                f"{turns.MOST_TURNS} are distinguished; call joints that turn without end endless, "
                "or narrow their limits"
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

    def _lacks(self, what: str, keys: str, hint: str = "") -> InputError:
        why = f" ({self.limits_missing})" if self.limits_missing else ""
        return InputError(
            f"robot {self.id!r}: {what} are not known{why}; "
            f"give them with robot.with_limits({keys}...){hint}"
        )


def _for_each(value: ArrayLike, joints: int) -> ArrayLike:
    """Return one number as that number for each joint; anything longer as it is."""
    return np.full(joints, value) if np.ndim(value) == 0 else value
