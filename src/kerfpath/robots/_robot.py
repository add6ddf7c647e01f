"""A robot: an arm from the library or a description, alone or with external axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, floats
from kerfpath.dynamics import STANDARD_GRAVITY, Load
from kerfpath.errors import InputError
from kerfpath.robots._described import build_robot, read_description
from kerfpath.robots._external import (
    ExternalAxis,
    Travel,
    base_in_part,
    require_distinct_axes,
)
from kerfpath.robots._known_axis import Given, KnownAxis, described_axes, require_known
from kerfpath.robots._library import read_robot
from kerfpath.robots._manipulator import Manipulator
from kerfpath.robots._products import ExternalProduct
from kerfpath.robots._written import urdf_of

__all__ = ["Robot", "robot"]

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
