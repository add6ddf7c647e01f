"""A robot: an arm with its limits and external axes, from the library or a description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.acceleration_table import AccelerationTable
from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    floats,
    freeze,
    html_table,
    in_degrees,
    in_radians,
    require_instance,
    require_keywords,
    scalar,
    short_repr,
)
from kerfpath.dynamics import STANDARD_GRAVITY, ArmDynamics, Load
from kerfpath.errors import InputError
from kerfpath.kernels import turns
from kerfpath.limits import AccelerationLimit, JerkLimit, TorqueLimit
from kerfpath.losses import Loss, Reason
from kerfpath.names import identifiers
from kerfpath.robots.arm import Arm, Solutions, all_solutions, solutions_within
from kerfpath.robots.axis_3 import AXIS_3, axis_3_of
from kerfpath.robots.catalogue import (
    acceleration_ratios,
    acceleration_table_of,
    arm_of,
    entry,
    limits_of,
)
from kerfpath.robots.described import ChainKeywords, described_limits, read_description
from kerfpath.robots.external_axes import (
    CarriedChain,
    ExternalAxis,
    Travel,
    base_in_part,
    carried,
    require_distinct_axes,
)
from kerfpath.robots.external_products import (
    ExternalProduct,
    Given,
    KnownAxis,
    described_axes,
    require_known,
)
from kerfpath.robots.families import Family
from kerfpath.robots.limits import Coupling, LimitKeywords, RobotLimits
from kerfpath.robots.recognition import recognise
from kerfpath.urdf import ChainInertia, Joint, KinematicChain, LinkBody, urdf_text

NOTHING_GIVEN: Mapping[str, Given] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotDynamics:
    """The masses that the joints of an arm move, and gravity.

    Parameters
    ----------
    inertia : ChainInertia, optional
        Masses and inertias that the joints of the robot's description carry.
    inertia_missing : str
        Why the inertia is not known; empty where it is.
    load : Load, optional
        Load on the flange; with it torques are computed and limited, see `Robot.with_load`.
    gravity : (3,) m/s^2
        Gravity in the robot base; default: an upright robot.
    """

    inertia: ChainInertia | None = None
    inertia_missing: str = ""
    load: Load | None = None
    gravity: Array = field(default_factory=lambda: np.array(STANDARD_GRAVITY))

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", floats(self.gravity, "gravity", (3,)))


class DescriptionKeywords(ChainKeywords, LimitKeywords, total=False):
    """How a description is read, and limits that replace those written there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Robot:
    """An arm of one of the kinematic families, its limits and where they come from.

    Joint vectors have the order and zeros of the robot's own description (its URDF where `frames`
    says so). Poses are those of the flange in the robot base, with z along the last axis and out of
    the flange. A pose leaves one joint of a seven-axis arm free, like external axes; plans choose
    it: joint 3, with an offset shoulder joint 1, with an offset wrist joint 7.

    Parameters
    ----------
    id, manufacturer, model : str
    arm : Arm
        Geometry and kinematics.
    limits : RobotLimits
        Limits of the joints; default: none are known.
    dynamics : RobotDynamics
        Masses of the links, load and gravity.
    externals : tuple of ExternalAxis
        Rails and positioners; they are the last columns of q and of the limits. See `on_rail`.
    elbow_step : float rad, optional
        For a seven-axis arm: largest step between samples of its free joint where the exact search
        takes it on a grid, see `with_elbow_step`.
    axis_3 : {"", "serial", "horizontal"}
        What axis 3 of the controller measures: joint 3, or the upper arm from the horizontal; ""
        means not known, and then no program that contains axis 3 is written.
    bodies : tuple of LinkBody
        Collision bodies of the robot's description.

    Raises
    ------
    InputError
        Limits are reversed, a speed is not positive, or the external axes do not fit.
    """

    id: str
    arm: Arm
    limits: RobotLimits = field(default_factory=RobotLimits)
    dynamics: RobotDynamics = field(default_factory=RobotDynamics)
    externals: tuple[ExternalAxis, ...] = ()
    elbow_step: float | None = None
    axis_3: str = ""
    bodies: tuple[LinkBody, ...] = ()
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

    def __post_init__(self) -> None:
        _set = object.__setattr__
        if self.axis_3 not in AXIS_3:
            raise InputError(f"axis_3: expected one of {AXIS_3}, got {self.axis_3!r}")
        redundant = self.family.given is not None
        require_distinct_axes(self.id, self.externals, redundant)
        if self.elbow_step is not None:
            if not redundant:
                raise InputError(
                    f"robot {self.id!r}: poses leave no joint of this arm free; remove elbow_step"
                )
            _set(self, "elbow_step", scalar(self.elbow_step, "elbow_step", unit="rad", above=0.0))
        _set(self, "limits", self.limits.cast(self.joints, self.arm.joints))
        self._require_order()

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

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        *,
        externals: Mapping[str, Given] | None = NOTHING_GIVEN,
        snap: float | None = None,
        manufacturer: str = "",
        axis_3: str = "",
        axis_3_limits: ArrayLike | None = None,
        **keywords: Unpack[DescriptionKeywords],
    ) -> Robot:
        """Return the robot of a description, its family recognised from the joint axes.

        The derived model agrees with the description to 1e-9 m and rad.

        Parameters
        ----------
        path, base, tip, mount, part, packages, meshes, snap
            As in `kerfpath.urdf.read_urdf`. Poses of the robot are those of link `tip` in link
            `base` with all external axes, before `mount` and under `part`, at zero. Without snap,
            an arm that fits a family only with rounded angles is refused; 0 keeps its angles.
        externals : mapping of joint to Given
            Values of external axes that replace those of the description: lower, upper, velocity,
            acceleration (m, rad, s), endless, name; and step. None: read the arm alone.
        manufacturer, axis_3, axis_3_limits : str, str, (2,) rad
            Maker of the controller; what its axis 3 measures; and, if "horizontal", the limits that
            it shows. Default: as a robot of the library with the same lengths.
        **keywords : (n,) rad, rad/s, rad/s^2, rad/s^3, N m
            lower, upper, velocity, acceleration, jerk, torque, endless replace those of the
            description; few descriptions give accelerations and jerks. Continuous joints are
            endless.

        Raises
        ------
        InputError
            The description is faulty, its chain belongs to no family, or a limit is missing or zero
            and not given.
        """
        require_keywords(keywords, DescriptionKeywords)
        description = read_description(path, snap, keywords)
        where = f"{description.path} ({description.base} to {description.tip})"
        try:
            arm, notes = recognise(description.chain, as_written=snap == 0)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        if description.left_out:
            left_out = ", ".join(description.left_out)
            notes = (*notes, f"Links on joints outside the chain are ignored: {left_out}.")
        limits, source = described_limits(description, keywords)
        robot = cls(
            id=description.name,
            manufacturer=manufacturer,
            notes=notes,
            arm=replace(arm, chain=description.chain),
            limits=limits,
            acceleration_source=source,
            dynamics=RobotDynamics(
                inertia=description.inertia, inertia_missing=description.inertia_missing
            ),
            bodies=description.bodies,
            frames={"base": description.base, "tip": description.tip},
            sources={"geometry_limits_velocity": f"URDF {Path(description.path).name}"},
        ).with_axis_3(axis_3, axis_3_limits)
        if externals is None:
            return robot
        return robot._with_known(described_axes(description), externals, f"{description.path}")

    @property
    def kinematics(self) -> str:
        """The name of the kinematic family of the arm."""
        return self.arm.kinematics

    @property
    def family(self) -> Family:
        """The kinematic family of the arm."""
        return self.arm.family

    @property
    def geometry(self) -> dict[str, float]:
        """Lengths of the arm, m, by name."""
        return self.arm.geometry

    @property
    def sign(self) -> Array:
        """+1 or -1 for each joint of the arm: q_model = sign * q - offset."""
        return self.arm.sign

    @property
    def offset(self) -> Array:
        """Offset of each joint of the arm, rad: q_model = sign * q - offset."""
        return self.arm.offset

    @property
    def T_base_foot(self) -> Array:
        """Pose (4, 4) m of the model's foot in the robot base."""
        return self.arm.T_base_foot

    @property
    def T_end_flange(self) -> Array:
        """Pose (4, 4) m of the flange in the model's own end frame."""
        return self.arm.T_end_flange

    @property
    def chain(self) -> KinematicChain | None:
        """The joint frames of the robot's description, if there is one."""
        return self.arm.chain

    @property
    def lower(self) -> Array | None:
        """Lower limits (n,) of the joints, rad or m; None if they are not known."""
        return self.limits.lower

    @property
    def upper(self) -> Array | None:
        """Upper limits (n,) of the joints, rad or m; None if they are not known."""
        return self.limits.upper

    @property
    def velocity(self) -> Array | None:
        """Largest speeds (n,) of the joints, rad/s or m/s; None if they are not known."""
        return self.limits.velocity

    @property
    def acceleration(self) -> Array | None:
        """Largest accelerations (n,) of the joints, per s^2; None if they are not known."""
        return self.limits.acceleration

    def acceleration_at(self, q: Array) -> Array:
        """Return the largest accelerations at joints q (..., n) rad, per s^2.

        Their shape is (..., n) where the robot has an acceleration table, else (n,).

        Raises
        ------
        InputError
            As `speed_limits`.
        """
        _, bound = self.speed_limits()
        return AccelerationLimit(bound=bound, table=self.limits.acceleration_table).at(q)

    @property
    def endless(self) -> Bools:
        """Which joints (n,) turn without end."""
        return self.limits.endless

    @property
    def couplings(self) -> tuple[Coupling, ...]:
        """Bounds on combinations of joints."""
        return self.limits.couplings

    @property
    def joints(self) -> int:
        """Number of joints n, external axes included."""
        return self.arm.joints + len(self.externals)

    @property
    def free(self) -> Ints:
        """Columns of q that a pose leaves free: the family's `given` joint and external axes."""
        n, given = self.arm.joints, self.family.given
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
        return ("rad",) * self.arm.joints + tuple(axis.unit for axis in self.externals)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Name of each joint in messages: "joint 1" and so on, or the external axis's name."""
        arm = tuple(f"joint {i + 1}" for i in range(self.arm.joints))
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
        if self.limits.lower is None or self.limits.upper is None:
            raise self._lacks("joint limits", "lower= and upper=")
        rows = [c.row for c in self.limits.couplings]
        return turns.JointLimits(
            lower=self.limits.lower,
            upper=self.limits.upper,
            endless=self.endless,
            rows=np.array(rows).reshape(-1, self.joints),
            row_lower=np.array([c.lower for c in self.limits.couplings]),
            row_upper=np.array([c.upper for c in self.limits.couplings]),
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

        Those of a linear external axis are in m/s and m/s^2. Where accelerations depend on the
        configuration, they are what holds at any; see `acceleration_at`.

        Raises
        ------
        InputError
            One of them is not known; the message says how to give it.
        """
        velocity = self.velocity_limits()
        if self.limits.acceleration is None:
            ratio = self.acceleration_ratio
            hint = f", or robot({self.id!r}, acceleration_ratio={ratio!r})" if ratio else ""
            raise self._lacks("joint accelerations", "acceleration=", hint)
        return velocity, self.limits.acceleration

    def velocity_limits(self) -> Array:
        """Return the joint velocities (n,) rad/s, or m/s for a linear external axis.

        Raises
        ------
        InputError
            They are not known.
        """
        if self.limits.velocity is None:
            raise self._lacks("joint velocities", "velocity=")
        return self.limits.velocity

    def torque_limit(self) -> TorqueLimit | None:
        """Return the torque limit; None where no load is given.

        Raises
        ------
        InputError
            A load is given, but no robot description with a positive definite inertia of every
            link, or no torque limits; or the robot has an external axis or seven axes.
        """
        if self.dynamics.load is None:
            return None
        why = (
            self.dynamics.inertia_missing
            or "the masses of its links come only from a description (URDF)"
        )
        if self.externals:
            names = " and ".join(axis.name for axis in self.externals)
            why = f"the effect of {names} on them is not known"
        elif self.free.size:
            why = f"torque limits of an arm whose {self.free_names} is free are not supported yet"
        if self.arm.chain is None or self.dynamics.inertia is None or self.free.size:
            raise InputError(f"robot {self.id!r}: its torques cannot be computed: {why}")
        if self.limits.torque is None:
            raise self._lacks("joint torques", "torque=")
        inertia = self.dynamics.load.on(self.dynamics.inertia, self.arm.chain.end)
        dynamics = ArmDynamics(chain=self.arm.chain, inertia=inertia, gravity=self.dynamics.gravity)
        return TorqueLimit(bound=self.limits.torque, dynamics=dynamics)

    def jerk_limit(self) -> JerkLimit | None:
        """Return the jerk limit, infinite for external axes; None where no jerks are known."""
        if self.limits.jerk is None:
            return None
        free = np.full(self.joints - len(self.limits.jerk), np.inf)
        return JerkLimit(bound=np.append(self.limits.jerk, free))

    def bounds(self) -> tuple[Reason, ...]:
        """Return the loss reasons for limits: low and high of each arm joint and coupling."""
        names = [*self.joint_names[: self.arm.joints], *(c.name for c in self.limits.couplings)]
        return tuple(Reason(end, name) for name in names for end in (Loss.LOW, Loss.HIGH))

    def reasons(self) -> tuple[Reason, ...]:
        """Return the meaning of each reason code of a dropped pose; the code is the index."""
        first = Reason(Loss.ADMITTED), Reason(Loss.UNREACHABLE)
        return (*first, *self.bounds(), Reason(Loss.UNWANTED))

    def folded(self, joints: Bools) -> Robot:
        """Return this robot with some joints (n,) endless, each pose on one of their turns only."""
        if not joints.any():
            return self
        return replace(self, limits=replace(self.limits, endless=self.endless | joints))

    def require_few_turns(self) -> None:
        """Require that the limits allow no more combinations of turns than the kernels can hold.

        Raises
        ------
        InputError
            The limits are not known, or they allow more combinations, of which some would be lost.
        """
        n, limits = self.arm.joints, self.turn_limits()
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
        if self.limits.lower is None or self.limits.upper is None:
            return
        n = self.arm.joints
        for axis, lower, upper in zip(
            self.externals, self.limits.lower[n:], self.limits.upper[n:], strict=True
        ):
            axis.require_range(float(lower), float(upper))
        reversed_ = np.flatnonzero(~(self.limits.lower[:n] < self.limits.upper[:n]))
        if reversed_.size:
            i = int(reversed_[0])
            raise InputError(
                f"robot {self.id!r}: the limits of joint {i + 1} are reversed: lower "
                f"{np.degrees(self.limits.lower[i]):g} deg is not below upper "
                f"{np.degrees(self.limits.upper[i]):g} deg"
            )

    def _lacks(self, what: str, keys: str, hint: str = "") -> InputError:
        why = f" ({self.limits_missing})" if self.limits_missing else ""
        return InputError(
            f"robot {self.id!r}: {what} are not known{why}; "
            f"give them with robot.with_limits({keys}...){hint}"
        )

    def forward(self, q: ArrayLike) -> Array:
        """Return the flange poses (..., 4, 4) m in the robot base at joint vectors q (..., n) rad.

        With external axes, poses are relative to the part: expressed in the robot base with all
        external axes at zero, as if the part did not move.

        Raises
        ------
        InputError
            q has a wrong shape, or is not finite.
        """
        if not self.externals:
            return self.arm.forward(q)
        q = np.asarray(q, dtype=float)
        rows = floats(q.reshape(-1, q.shape[-1]) if q.ndim else q, "q", (None, self.joints))
        n = self.arm.joints
        T = base_in_part(self.externals, rows[:, n:]) @ self.arm.forward(rows[:, :n])
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
            Value of the free joint of a seven-axis arm (`free`); not allowed for other arms.
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
        self._require_alone()
        q, reach = self.arm.inverse_all(poses, given)
        if not within_limits:
            return all_solutions(q, reach)
        self.require_few_turns()
        if given is not None:
            limits, i = self.joint_limits(), self.free[0]
            inside = (given >= limits.lower[i]) & (given <= limits.upper[i]) | limits.endless[i]
            reach = reach & inside[:, None]
        return solutions_within(q, reach, self.turn_limits())

    @property
    def encloses(self) -> bool:
        """Whether `Arm.enclose` works: the family has proven bounds; and no axis is external."""
        return self.family.enclose_all is not None and not self.externals

    def _require_alone(self) -> None:
        if self.externals:
            names = ", ".join(axis.name for axis in self.externals)
            raise InputError(
                f"inverse: with {names} a pose has infinitely many solutions; use "
                "robot.held(x).inverse(T), where x are the values of the external axes"
            )

    def to_urdf(self) -> str:
        """Return a description (URDF) of the joints, limits and external axes, without bodies.

        Links are base_link, link_1 and so on, and tool0, the flange. With external axes there are
        also ground, the root link, a carriage for each axis, and part. `from_urdf` reads
        it with tip "tool0", mount "base_link" and, where an axis carries the part, part "part".

        Raises
        ------
        InputError
            The robot has couplings, which a URDF cannot express, or its limits or velocities are
            not known.
        """
        return urdf_of(self)

    def with_limits(
        self,
        *,
        couplings: Sequence[Coupling] | None = None,
        acceleration_table: AccelerationTable | None = None,
        **given: Unpack[LimitKeywords],
    ) -> Robot:
        """Return this robot with some of its limits replaced (rad, s, N m).

        Accelerations also replace a table of them, and a table those of its joints.

        Raises
        ------
        InputError
            Limits of the wrong shape or sign, velocities or accelerations in deg, or a table for
            joints that the arm does not have.
        """
        changes: dict[str, Any] = {k: value for k, value in given.items() if value is not None}
        for name in ("velocity", "acceleration"):
            _require_radians(changes.get(name), name)
        if couplings is not None:
            changes["couplings"] = tuple(couplings)
        source = self.acceleration_source
        if "acceleration" in changes:
            changes["acceleration_table"], source = None, "given by the user"
        if acceleration_table is not None:
            require_instance(
                acceleration_table, AccelerationTable, "acceleration_table",
                "make one, or read one with its from_csv",
            )  # fmt: skip
            for joint, values in acceleration_table.limits.items():
                _require_radians(values.ravel(), f"acceleration table of joint {joint}")
            changes["acceleration_table"] = acceleration_table
            numbers = ", ".join(str(joint) for joint in acceleration_table.limits)
            source = f"joints {numbers}: table by configuration, {acceleration_table.source}" + (
                f"; others: {source}" if source else ""
            )
        return replace(self, limits=replace(self.limits, **changes), acceleration_source=source)

    def with_acceleration_ratio(self, ratio: str) -> Robot:
        """Return this robot with accelerations of a named ratio times the speeds."""
        acceleration = np.multiply(acceleration_ratios()[ratio], self.velocity_limits())
        source = f"assumed: ratio {ratio} times the speeds"
        return replace(self.with_limits(acceleration=acceleration), acceleration_source=source)

    def with_axis_3(self, axis_3: str = "", limits: ArrayLike | None = None) -> Robot:
        """Return this robot with axis 3 of its controller as given, or otherwise as in the library.

        Parameters
        ----------
        axis_3 : {"", "serial", "horizontal"}
            What axis 3 measures; "" looks for arms of the same maker and lengths in the library.
        limits : (2,) rad, optional
            Limits of a "horizontal" axis 3, as the controller shows them.

        Raises
        ------
        InputError
            The limits are missing, not needed, or outside the range of joints 2 and 3; or `axis_3`
            contradicts the maker's controllers or a library robot with the same lengths.
        """
        found = axis_3_of(self.arm, self.manufacturer, self.limits, axis_3, limits)
        if not found.counted:
            return self
        return replace(
            self.with_limits(couplings=found.couplings),
            axis_3=found.counted,
            notes=(*self.notes, *found.notes),
        )

    def with_load(self, load: Load, *, gravity: ArrayLike = STANDARD_GRAVITY) -> Robot:
        """Return this robot with a load on its flange, so that its torques are limited.

        Parameters
        ----------
        load : Load
        gravity : (3,) m/s^2
            Gravity in the robot base.

        Raises
        ------
        InputError
            The inertia of the links or the torque limits are not known, see `torque_limit`.
        """
        dynamics = replace(self.dynamics, load=load, gravity=gravity)  # type: ignore[arg-type]  # is cast
        loaded = replace(self, dynamics=dynamics)
        loaded.torque_limit()
        return loaded

    def with_elbow_step(self, step: float) -> Robot:
        """Return this robot with its free joint sampled in steps of at most `step` rad on a grid.

        Methods "exact", "paper" and "known" need it for a seven-axis arm.

        Raises
        ------
        InputError
            Poses leave no joint of the arm free, or the step is not positive.
        """
        return replace(self, elbow_step=step)

    def on_rail(self, direction: ArrayLike, **travel: Unpack[Travel]) -> Robot:
        """Return this robot with its base on a rail along `direction` (3,).

        Keywords: lower, upper, velocity, acceleration (m, m/s, m/s^2), step (m), name ("rail").
        Raises as `with_external`.
        """
        axis = ExternalAxis(
            name=travel.get("name", "rail"),
            kind="linear",
            carries="robot",
            axis=direction,  # type: ignore[arg-type]  # cast by __post_init__
            step=travel.get("step"),
        )
        return self.with_external(axis, **travel)

    def with_positioner(self, axis: ArrayLike, point: ArrayLike, **travel: Unpack[Travel]) -> Robot:
        """Return this robot with a part that turns about `axis` (3,) through `point` (3,) m.

        Keywords: lower, upper, velocity, acceleration (rad, rad/s, rad/s^2), endless, step (rad),
        name ("positioner"). Add the tilt axis of a turn-tilt positioner first. Raises as
        `with_external`.
        """
        turned = ExternalAxis(
            name=travel.get("name", "positioner"),
            kind="rotary",
            carries="part",
            axis=axis,  # type: ignore[arg-type]  # cast by __post_init__
            point=point,  # type: ignore[arg-type]  # cast by __post_init__
            step=travel.get("step"),
        )
        return self.with_external(turned, **travel)

    def with_external(self, axis: ExternalAxis, **travel: Unpack[Travel]) -> Robot:
        """Return this robot with one more external axis; `travel` gives its range and limits.

        The axis is carried by those added before it that carry the same thing, robot or part.

        Raises
        ------
        InputError
            Limits of the arm are not known; the robot would have more than three external axes, or
            two of the same name; or a linear axis is endless.
        """
        endless = travel.get("endless", False)
        if endless and axis.kind == "linear":
            raise InputError(f"{axis.name}: a linear axis cannot be endless")
        known, (velocity, acceleration) = self.joint_limits(), self.speed_limits()
        limits = replace(
            self.limits,
            lower=np.append(known.lower, travel["lower"]),
            upper=np.append(known.upper, travel["upper"]),
            velocity=np.append(velocity, travel["velocity"]),
            acceleration=np.append(acceleration, travel["acceleration"]),
            endless=np.append(self.endless, endless),
            couplings=tuple(replace(c, row=np.append(c.row, 0.0)) for c in self.couplings),
        )
        return replace(self, externals=(*self.externals, axis), limits=limits)

    def with_product(
        self, product: ExternalProduct, place: ArrayLike, given: Mapping[str, Given] = NOTHING_GIVEN
    ) -> Robot:
        """Return this robot with all axes of a rail or positioner of the library.

        Parameters
        ----------
        product : ExternalProduct
            From `kerfpath.external`.
        place : (4, 4) m
            Pose of the product in the robot base, with all external axes at zero.
        given : mapping of axis to Given
            Values that complete or replace those of the library: lower, upper, velocity,
            acceleration (m, rad, s), endless, name, step.

        Raises
        ------
        InputError
            A limit is neither known nor given; the product does not have a named axis; and as
            `with_external`.
        """
        placed = [known.placed(np.asarray(place)) for known in product.axes]
        return self._with_known(placed, given, product.id)

    def _with_known(
        self, known: Sequence[KnownAxis], given: Mapping[str, Given], what: str
    ) -> Robot:
        """Return this robot with known external axes, completed by the given values."""
        require_known(given, known, what)
        more = [each.completed(**given.get(each.axis.name, {})) for each in known]
        require_distinct_axes(self.id, [*self.externals, *(axis for axis, _ in more)])
        robot = self
        for axis, travel in more:
            robot = robot.with_external(axis, **travel)
        return robot

    def alone(self) -> Robot:
        """Return the arm without its external axes, placed as with all of them at zero."""
        if not self.externals:
            return self
        return replace(
            self,
            externals=(),
            limits=self.limits.of_arm(self.arm.joints),
            bodies=tuple(replace(body, on=None) for body in self.bodies),
        )

    def held(self, x: ArrayLike) -> Robot:
        """Return the arm alone, placed relative to the part as with its external axes at x.

        Parameters
        ----------
        x : (E,) rad, or m for a linear axis
            Values of the external axes; a single number where there is one axis.

        Raises
        ------
        InputError
            The robot has no external axis, or another number of them.
        """
        if not self.externals:
            raise InputError(f"robot {self.id!r}: it has no external axis to be held")
        at = floats(np.atleast_1d(np.asarray(x, dtype=float)), "held", (len(self.externals),))
        # Gravity as seen from the part: only the axes that carry the part turn it.
        part = np.array([axis.carries == "part" for axis in self.externals])
        R = base_in_part(self.externals, np.where(part, at, 0.0))[:3, :3]
        dynamics = replace(self.dynamics, gravity=R @ self.dynamics.gravity)
        arm = self.arm.moved(base_in_part(self.externals, at))
        return replace(self.alone(), arm=arm, dynamics=dynamics)


def robot(
    name: str,
    *,
    acceleration_ratio: str | None = None,
    acceleration_table: AccelerationTable | Literal["library"] | None = None,
) -> Robot:
    """Return a robot of the library by its id.

    Parameters
    ----------
    name : str
        One of `robot_ids()`.
    acceleration_ratio : str, optional
        Take the accelerations as this ratio (one of `acceleration_ratios()`) times the speeds.
    acceleration_table : AccelerationTable or "library", optional
        Accelerations of some joints by configuration, or those that the library has.

    Raises
    ------
    InputError
        The robot or the ratio is unknown (the message names the nearest robots), the ratio is for
        another number of joints, the robot's velocities are not known, or the table is not in the
        library or not for the joints of the arm.
    """
    data = entry(name)
    found = Robot(
        id=data["id"],
        manufacturer=data["manufacturer"],
        model=data["model"],
        arm=arm_of(data),
        limits=limits_of(data),
        axis_3=data["joints"]["axis_3"],
        payload=data["payload_kg"],
        reach=data["reach_m"],
        acceleration_source=data["joints"].get("acceleration_source", ""),
        acceleration_ratio=data["joints"]["acceleration_ratio"],
        limits_missing=data.get("limits_missing", ""),
        notes=tuple(data.get("notes", ())),
        frames=dict(data["frames"]),
        sources=dict(data["source"]),
    )
    if acceleration_ratio is not None:
        found = _with_ratio(found, acceleration_ratio)
    if acceleration_table == "library":
        acceleration_table = acceleration_table_of(name)
    if acceleration_table is None:
        return found
    return found.with_limits(acceleration_table=acceleration_table)


def _with_ratio(found: Robot, acceleration_ratio: str) -> Robot:
    """Return a robot of the library with accelerations of a ratio; errors as `robot`."""
    ratios = acceleration_ratios()
    if acceleration_ratio not in ratios:
        raise InputError(
            f"acceleration_ratio: expected one of {', '.join(ratios)}, got {acceleration_ratio!r}"
        )
    if (n := len(ratios[acceleration_ratio])) != found.joints:
        raise InputError(
            f"acceleration_ratio: {acceleration_ratio!r} is for {n} joints, but robot {found.id!r} "
            f"has {found.joints}; give its accelerations with robot.with_limits(acceleration=...)"
        )
    if found.velocity is None:
        raise InputError(
            f"robot {found.id!r}: its joint velocities are not known, so acceleration_ratio cannot "
            "be applied"
        )
    return found.with_acceleration_ratio(acceleration_ratio)


IN_DEGREES = 51, 10_000
"""Whole numbers between these for every joint are rates in deg: 51 rad/s are 2900 deg/s."""


def _require_radians(rates: ArrayLike | None, name: str) -> None:
    """Raise InputError for rates of joints that are surely in deg."""
    if rates is None:
        return
    values = floats(rates, name, (None,))
    whole = values == np.round(values)
    if values.size and (whole & (values >= IN_DEGREES[0]) & (values <= IN_DEGREES[1])).all():
        raise in_radians(float(values.min()), name, "the limits of the joints in rad and s")


# -----------------------------------------------------------------------------
# The joint chain of a robot with its external axes.


def chain_of(robot: Robot) -> KinematicChain:
    """Return the joint chain of a robot, which ends at its flange.

    With external axes it is a `CarriedChain`, which begins at the part.

    Raises
    ------
    InputError
        The robot has no description and its family has no model with joint frames; or it has
        external axes and its joint limits are not known.
    """
    chain = robot.arm.joint_chain()
    if not robot.externals:
        return chain
    limits = robot.joint_limits()
    return CarriedChain(
        origins=chain.origins,
        axes=chain.axes,
        end=chain.end,
        externals=robot.externals,
        travel=np.column_stack([limits.lower, limits.upper])[len(chain.axes) :],
    )


def require_axes(chain: KinematicChain, robot: Robot) -> None:
    """Require that the chain of a cell has the external axes of a robot and all their travel.

    Raises
    ------
    InputError
        The external axes differ, or the chain covers less travel: bounds on motions hold within
        its travel only.
    """
    own = chain if isinstance(chain, CarriedChain) else None
    axes = () if own is None else own.externals
    one, two = (
        [(a.name, a.kind, a.carries, *a.axis, *a.point) for a in some]
        for some in (axes, robot.externals)
    )
    if one != two:
        here, there = (
            ", ".join(axis.name for axis in some) or "none" for some in (axes, robot.externals)
        )
        raise InputError(
            f"cell: it was built with other external axes ({here}) than the robot has ({there})"
        )
    if own is not None:
        limits, n = robot.joint_limits(), len(own.axes)
        beyond = (limits.lower[n:] < own.travel[:, 0]) | (limits.upper[n:] > own.travel[:, 1])
        if (beyond & ~robot.endless[n:]).any():
            raise InputError(
                "cell: it was built with less travel of the external axes than the robot has; "
                "build it again for this robot"
            )


# -----------------------------------------------------------------------------
# Write a robot as a description (URDF): its joints, limits and external axes.

GROUND, BASE, FLANGE, PART = "ground", "base_link", "tool0", "part"
"""Names of links: the base at zero of all external axes; the base; the flange; the part."""
REMARK = (
    "Lengths in m, angles in rad, from kerfpath. An effort of 0 means not known. tool0 is the "
    "flange."
)


def joint_identifiers(robot: Robot) -> list[str]:
    """Return the joint names in descriptions and ROS trajectories, in the order of q.

    They are joint_1 and so on; external axes have their own names, made into identifiers.
    """
    arm = [f"joint_{i}" for i in range(1, robot.arm.joints + 1)]
    return [*arm, *identifiers((axis.name for axis in robot.externals), taken=arm)]


def urdf_of(robot: Robot) -> str:
    """Return the URDF of a robot, see `Robot.to_urdf`."""
    if robot.couplings:
        said = " and ".join(coupling.name for coupling in robot.couplings)
        raise InputError(
            f"robot {robot.id!r}: its limits include a bound on {said}, but a URDF has only limits "
            "of single joints; robot.with_limits(couplings=()).to_urdf() writes it "
            "without that bound"
        )
    chain = robot.arm.joint_chain()
    joints, foot, at = _carriers(robot, "robot")
    if robot.externals:
        joints.append(_fixed(foot, BASE, _shift(-at)))
    link = BASE
    for i, (origin, axis) in enumerate(zip(chain.origins, chain.axes, strict=True)):
        joints.append(_moving(robot, i, link, origin, axis))
        link = joints[-1].child
    joints.append(_fixed(link, FLANGE, chain.end))
    under, table, at = _carriers(robot, "part")
    if under:
        joints += [*under, _fixed(table, PART, _shift(-at))]
    return urdf_text(robot.id, joints, REMARK)


def _carriers(robot: Robot, what: Literal["robot", "part"]) -> tuple[list[Joint], str, Array]:
    """Return the axes that carry robot or part, the last link, and the place (3,) m of its frame.

    The frame of each axis has its origin on the axis and is parallel to the robot base.
    """
    joints: list[Joint] = []
    link, at = GROUND, np.zeros(3)
    for i, axis in enumerate(robot.externals, robot.arm.joints):
        if axis.carries == what:
            joints.append(_moving(robot, i, link, _shift(axis.point - at), axis.axis))
            link, at = joints[-1].child, axis.point
    return joints, link, at


def _moving(robot: Robot, i: int, parent: str, origin: Array, axis: Array) -> Joint:
    """Return the joint of a column of q, with the limits that are known."""
    n, endless, limits = robot.arm.joints, bool(robot.endless[i]), robot.joint_limits()
    name, kind = joint_identifiers(robot)[i], "continuous" if endless else "revolute"
    if robot.units[i] == "m":
        kind = "prismatic"
    burdens = [
        None if of is None or i >= n else float(of[i])
        for of in (robot.limits.jerk, robot.limits.torque)
    ]
    jerk, torque = (of if of is not None and np.isfinite(of) else None for of in burdens)
    return Joint(
        name=name,
        kind=kind,
        parent=parent,
        child=f"link_{i + 1}" if i < n else f"{name}_carriage",
        origin=origin,
        axis=axis,
        lower=None if endless else float(limits.lower[i]),
        upper=None if endless else float(limits.upper[i]),
        velocity=float(robot.velocity_limits()[i]),
        acceleration=None if robot.acceleration is None else float(robot.acceleration[i]),
        jerk=jerk,
        effort=torque,
        mimics="",
    )


def _fixed(parent: str, child: str, origin: Array) -> Joint:
    """Return a fixed joint; its name contains a character that no axis name has."""
    limits = dict.fromkeys(("lower", "upper", "velocity", "acceleration", "jerk", "effort"))
    return Joint(
        name=f"{parent}-{child}",
        kind="fixed",
        parent=parent,
        child=child,
        origin=origin,
        axis=np.zeros(3),
        mimics="",
        **limits,
    )


def _shift(by: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = by
    return T


# -----------------------------------------------------------------------------
# Check whether the tool can back off along its axis, as it does before and after a cut.


RETRACT_PARTS = 10
"""Number of parts in which the way back is followed."""
JUMP = 1.0
"""rad: largest movement of a joint in one part; a wrist that flips turns by half a turn."""


def can_back_off(
    robot: Robot, q: Array, posture: Ints, tool: Array, retract: float, margin: float = 0.0
) -> Bools:
    """Return from which joint vectors (B,) the tool can back off within the joint limits.

    The tool moves straight along its axis. The posture is kept on the whole way, which no joint
    passes in a jump, as it would at a singularity, and external axes do not move.

    Parameters
    ----------
    robot : Robot
    q : (B, n) rad
    posture : (B,) int
    tool : (4, 4) m
        T_flange_tip.
    retract : float m
        How far the tool backs off.
    margin : float rad
        Distance kept from every joint limit in the backed-off pose.
    """
    arm, q = robot.arm, q[:, : robot.arm.joints]
    flange, back = arm.forward(q).copy(), q
    step = retract / RETRACT_PARTS * (flange @ tool)[:, :3, 2]
    reached = np.ones(len(q), np.bool_)
    for _ in range(RETRACT_PARTS):
        flange[:, :3, 3] -= step
        there = arm.follow(flange, back, posture)
        reached &= (np.abs(there - back) <= JUMP).all(axis=1)  # false out of reach, at NaN
        back = np.where(reached[:, None], there, back)
    limits = robot.alone().joint_limits()
    room = np.minimum(back - limits.lower, limits.upper - back)
    sums = back @ limits.rows.T
    coupled = np.minimum(sums - limits.row_lower, limits.row_upper - sums)
    held = ((room >= margin) | limits.endless).all(axis=1) & (coupled >= margin).all(axis=1)
    return np.asarray(reached & held)


# -----------------------------------------------------------------------------
# Height of the lowest joint of an arm.

FIRST = 3
"""The first axis that counts, the elbow; the height of axes 1 and 2 does not depend on q."""
AT_ONCE = 10_000
"""Number of joint vectors processed at once, so that their data stay in the cache."""


def lowest_joint(robot: Robot, q: Array) -> Array:
    """Return the height (B,) m of the lowest of elbow, wrist and flange at q (B, n) rad.

    Heights are those of the origins of the joints from axis 3 on and of the flange, in the robot
    base with every external axis at zero.

    Raises
    ------
    InputError
        As `chain_of`.
    """
    chain, found = chain_of(robot), np.empty(len(q))
    for first in range(0, len(q), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        found[some] = _lowest(chain, robot, q[some])
    return found


def _lowest(chain: KinematicChain, robot: Robot, q: Array) -> Array:
    # Third row of the pose of one frame after the other; its last entry is the height.
    row = np.array(carried(robot.externals, q[:, robot.arm.joints :], "robot")[:, 2])
    lowest = np.full(len(q), np.inf)
    for i, axis in enumerate(chain.axes):
        row = row @ chain.origins[i]
        up, s, c = row[:, :3], np.sin(q[:, i])[:, None], np.cos(q[:, i])[:, None]
        row[:, :3] = up * c + np.cross(up, axis) * s + (up @ axis)[:, None] * axis * (1 - c)
        if i + 1 >= FIRST:
            lowest = np.minimum(lowest, row[:, 3])
    return np.asarray(np.minimum(lowest, (row @ chain.end)[:, 3]))
