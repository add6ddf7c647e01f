"""A robot: an arm from the library or a description, alone or with external axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, floats
from kerfpath.dynamics import STANDARD_GRAVITY, Load
from kerfpath.errors import InputError
from kerfpath.names import identifiers
from kerfpath.robots.arm import Manipulator
from kerfpath.robots.chains import (
    ExternalProduct,
    Given,
    KnownAxis,
    arm_chain,
    chain_of,
    described_axes,
    require_known,
)
from kerfpath.robots.described import build_robot, read_description, read_robot
from kerfpath.robots.external_axes import (
    ExternalAxis,
    Travel,
    base_in_part,
    carried,
    require_distinct_axes,
)
from kerfpath.urdf import Joint, KinematicChain, urdf_text

# -----------------------------------------------------------------------------
# Write a robot as a description (URDF): its joints, limits and external axes.

GROUND, BASE, FLANGE, PART = "ground", "base_link", "tool0", "part"
"""Names of links: the base at zero of all external axes; the base; the flange; the part."""
REMARK = (
    "Lengths in m, angles in rad, from kerfpath. An effort of 0 means not known. tool0 is the "
    "flange."
)


def joint_identifiers(robot: Manipulator) -> list[str]:
    """Return the joint names in descriptions and ROS trajectories, in the order of q.

    They are joint_1 and so on; external axes have their own names, made into identifiers.
    """
    arm = [f"joint_{i}" for i in range(1, robot.family.joints + 1)]
    return [*arm, *identifiers((axis.name for axis in robot.externals), taken=arm)]


def urdf_of(robot: Manipulator) -> str:
    """Return the URDF of a robot, see `Robot.to_urdf`."""
    if robot.couplings:
        said = " and ".join(coupling.name for coupling in robot.couplings)
        raise InputError(
            f"robot {robot.id!r}: its limits include a bound on {said}, but a URDF has only limits "
            "of single joints; dataclasses.replace(robot, couplings=()).to_urdf() writes it "
            "without that bound"
        )
    chain = arm_chain(robot)
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


def _carriers(robot: Manipulator, what: Literal["robot", "part"]) -> tuple[list[Joint], str, Array]:
    """Return the axes that carry robot or part, the last link, and the place (3,) m of its frame.

    The frame of each axis has its origin on the axis and is parallel to the robot base.
    """
    joints: list[Joint] = []
    link, at = GROUND, np.zeros(3)
    for i, axis in enumerate(robot.externals, robot.family.joints):
        if axis.carries == what:
            joints.append(_moving(robot, i, link, _shift(axis.point - at), axis.axis))
            link, at = joints[-1].child, axis.point
    return joints, link, at


def _moving(robot: Manipulator, i: int, parent: str, origin: Array, axis: Array) -> Joint:
    """Return the joint of a column of q, with the limits that are known."""
    n, endless, limits = robot.family.joints, bool(robot.endless[i]), robot.joint_limits()
    name, kind = joint_identifiers(robot)[i], "continuous" if endless else "revolute"
    if robot.units[i] == "m":
        kind = "prismatic"
    burdens = [None if of is None or i >= n else float(of[i]) for of in (robot.jerk, robot.torque)]
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
# A robot: an arm from the library or a description, alone or with external axes.

NOTHING_GIVEN: Mapping[str, Given] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Robot(Manipulator):
    """An arm of one of the kinematic families, its limits and where they come from.

    Joint vectors have the order and zeros of the robot's own description (its URDF where `frames`
    says so). Poses are those of the flange in the robot base, with z along the last axis and out of
    the flange. A pose leaves joint 3 of a seven-axis arm free, like external axes; plans choose it.

    Parameters
    ----------
    id, manufacturer, model : str
    kinematics : {"opw", "ur", "five", "srs", "general"}
        The family, see `kerfpath.robots.FAMILIES`.
    geometry : mapping
        Lengths, m. "opw" and "five": a1, a2, b, c1, c2, c3, c4 (Brandstoetter, Angerer and Hofbaur
        2014; for a five-axis arm c4 runs along the forearm to the head's flange at q5 = 0). "ur":
        d1, a2, a3, d4, d5, d6 (Denavit-Hartenberg, as Universal Robots publishes them). "srs": c1,
        c2, c3, c4 from foot to shoulder, elbow, wrist and flange. "general": none, see `chain`.
    sign : (arm joints,)
        +1 or -1: q_model = sign * q - offset.
    offset : (arm joints,) rad
    T_base_foot, T_end_flange : (4, 4) m
        Pose of the model in the robot base, and of the flange in the model's own end frame.
    lower, upper : (n,) rad or None
        Joint limits; None when they are not known, and then nothing can be planned.
    velocity : (n,) rad/s or None
        Largest joint speeds.
    acceleration : (n,) rad/s^2 or None
        Largest joint accelerations; most makers publish none.
    jerk : (arm joints,) rad/s^3 or None
        Largest joint jerks; plans keep them where they are known.
    torque : (arm joints,) N m or None
        Largest joint torques; plans keep them where a load is given.
    endless : (n,) bool
        Joints that turn without end; their limits do not apply.
    couplings : tuple of Coupling
        Bounds on combinations of joints.
    axis_3 : {"", "serial", "horizontal"}
        What axis 3 of the controller measures: joint 3, or the upper arm from the horizontal; ""
        means not known, and then no program that contains axis 3 is written.
    chain : KinematicChain, optional
        The joint frames of the robot's description; the audit uses them as its kinematics.
    bodies : tuple of LinkBody
        Collision bodies of that description.
    inertia : ChainInertia, optional
        Masses and inertias that the joints of that description carry.
    inertia_missing : str
        Why the inertia is not known; empty where it is.
    load : Load, optional
        Load on the flange; with it torques are computed and limited, see `with_load`.
    gravity : (3,) m/s^2
        Gravity in the robot base; default: an upright robot.
    externals : tuple of ExternalAxis
        Rails and positioners; they are the last columns of q and of the limits. See `on_rail`.
    elbow_step : float rad, optional
        For a seven-axis arm: largest step between samples of joint 3 where the exact search takes
        it on a grid, see `with_elbow_step`.

    Raises
    ------
    InputError
        Limits are reversed, a speed is not positive, a length is missing, or the family is unknown.
    """

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        mount: str | None = None,
        part: str | None = None,
        externals: Mapping[str, Given] | None = NOTHING_GIVEN,
        packages: Mapping[str, str | Path] | None = None,
        meshes: bool = True,
        snap: float | None = None,
        manufacturer: str = "",
        axis_3: str = "",
        axis_3_limits: ArrayLike | None = None,
        **limits: ArrayLike | None,
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
        **limits : (n,) rad, rad/s, rad/s^2, rad/s^3, N m
            lower, upper, velocity, acceleration, jerk, torque, endless replace those of the
            description; few descriptions give accelerations and jerks. Continuous joints are
            endless.

        Raises
        ------
        InputError
            The description is faulty, its chain belongs to no family, or a limit is missing or zero
            and not given.
        """
        description = read_description(
            path,
            snap,
            base=base,
            tip=tip,
            mount=mount,
            part=part,
            packages=packages,
            meshes=meshes,
        )
        arm = build_robot(
            cls,
            description,
            as_written=snap == 0,
            manufacturer=manufacturer,
            axis_3=axis_3,
            axis_3_limits=axis_3_limits,
            **limits,
        )
        if externals is None:
            return arm
        return arm._with_known(described_axes(description), externals, f"{description.path}")

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
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        jerk: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        endless: ArrayLike | None = None,
    ) -> Robot:
        """Return this robot with some of its limits replaced (rad, s, N m)."""
        given = {
            "lower": lower,
            "upper": upper,
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": jerk,
            "torque": torque,
            "endless": endless,
        }
        changes = {name: value for name, value in given.items() if value is not None}
        if acceleration is not None:
            changes["acceleration_source"] = "given by the user"
        return replace(self, **changes)  # type: ignore[arg-type]  # cast by __post_init__

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
        loaded = replace(self, load=load, gravity=gravity)  # type: ignore[arg-type]  # is cast
        loaded.torque_limit()
        return loaded

    def with_elbow_step(self, step: float) -> Robot:
        """Return this robot with joint 3 sampled in steps of at most `step` rad on a grid.

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
        limits, (velocity, acceleration) = self.joint_limits(), self.speed_limits()
        return replace(
            self,
            externals=(*self.externals, axis),
            lower=np.append(limits.lower, travel["lower"]),
            upper=np.append(limits.upper, travel["upper"]),
            velocity=np.append(velocity, travel["velocity"]),
            acceleration=np.append(acceleration, travel["acceleration"]),
            endless=np.append(self.endless, endless),
            couplings=tuple(replace(c, row=np.append(c.row, 0.0)) for c in self.couplings),
        )

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
        n = self.family.joints
        return replace(
            self,
            externals=(),
            lower=_first(self.lower, n),
            upper=_first(self.upper, n),
            velocity=_first(self.velocity, n),
            acceleration=_first(self.acceleration, n),
            endless=self.endless[:n],
            couplings=tuple(replace(c, row=c.row[:n]) for c in self.couplings),
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
        T, chain = base_in_part(self.externals, at), self.chain
        if chain is not None:
            origins = np.concatenate([T @ chain.origins[:1], chain.origins[1:]])
            chain = replace(chain, origins=origins)
        # A family without lengths uses the chain as its model, which has been moved already.
        foot = T @ self.T_base_foot if self.family.lengths else self.T_base_foot
        # Gravity as seen from the part: only the axes that carry the part turn it.
        part = np.array([axis.carries == "part" for axis in self.externals])
        gravity = base_in_part(self.externals, np.where(part, at, 0.0))[:3, :3] @ self.gravity
        return replace(self.alone(), T_base_foot=foot, chain=chain, gravity=gravity)


def robot(name: str, *, acceleration_ratio: str | None = None) -> Robot:
    """Return a robot of the library by its id.

    Parameters
    ----------
    name : str
        One of `robot_ids()`.
    acceleration_ratio : str, optional
        Take the accelerations as this ratio (one of `acceleration_ratios()`) times the speeds.

    Raises
    ------
    InputError
        The robot or the ratio is unknown (the message names the nearest robots), the ratio is for
        another number of joints, or the robot's velocities are not known.
    """
    return read_robot(Robot, name, acceleration_ratio)


def _first(values: Array | None, n: int) -> Array | None:
    return None if values is None else values[:n]


# -----------------------------------------------------------------------------
# Check whether the tool can back off along its axis, as it does before and after a cut.


def can_back_off(
    robot: Robot, q: Array, posture: Ints, tool: Array, retract: float, margin: float = 0.0
) -> Bools:
    """Return from which joint vectors (B,) the tool can back off within the joint limits.

    The tool moves straight along its axis. The posture is kept, no joint moves more than half a
    turn, and external axes do not move.

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
    arm, q = robot.alone(), q[:, : robot.family.joints]
    T = arm.forward(q) @ tool
    T[:, :3, 3] -= retract * T[:, :3, 2]
    back = arm.follow(T @ np.linalg.inv(tool), q, posture)
    limits = arm.joint_limits()
    reached = np.asarray(np.isfinite(back).all(axis=1))
    back = np.where(reached[:, None], back, q)
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
    row = np.array(carried(robot.externals, q[:, robot.family.joints :], "robot")[:, 2])
    lowest = np.full(len(q), np.inf)
    for i, axis in enumerate(chain.axes):
        row = row @ chain.origins[i]
        up, s, c = row[:, :3], np.sin(q[:, i])[:, None], np.cos(q[:, i])[:, None]
        row[:, :3] = up * c + np.cross(up, axis) * s + (up @ axis)[:, None] * axis * (1 - c)
        if i + 1 >= FIRST:
            lowest = np.minimum(lowest, row[:, 3])
    return np.asarray(np.minimum(lowest, (row @ chain.end)[:, 3]))
