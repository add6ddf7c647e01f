"""A robot: an arm as the library or a description has it, alone or with external axes."""

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
    """An arm of one of the families, its limits and where they come from.

    Joint vectors follow the robot's own description (its URDF where `frames` says so), in its
    order; poses are of the flange in the robot base, z along the last axis and out of the flange.
    Of a seven-axis arm a pose leaves joint 3 free, as it does external axes; plans choose it.

    Parameters
    ----------
    id, manufacturer, model : str
    kinematics : {"opw", "ur", "five", "srs", "general"}
        The family, see `kerfpath.robots.FAMILIES`.
    geometry : mapping
        Its lengths, m: a1, a2, b, c1, c2, c3, c4 (Brandstoetter, Angerer and Hofbaur 2014; of a
        five-axis arm c4 is that of the head's flange at q5 = 0, along the forearm), or
        d1, a2, a3, d4, d5, d6 (Denavit and Hartenberg's, as Universal Robots publishes them);
        c1, c2, c3, c4 from foot to shoulder, elbow, wrist and flange of a seven-axis arm; of a
        general arm none, its `chain` says all.
    sign : (n,)
        +1 or -1, and
    offset : (n,) rad
        with q_model = sign * q - offset.
    T_base_foot, T_end_flange : (4, 4) m
        Where the model stands in the robot base, and the flange in the model's own end frame.
    lower, upper : (n,) rad or None
        Joint limits; None when they are not known, and then nothing is planned.
    velocity : (n,) rad/s or None
        Largest joint speeds.
    acceleration : (n,) rad/s^2 or None
        Largest joint accelerations; most makers publish none.
    jerk : (arm joints,) rad/s^3 or None
        Largest joint jerks; plans keep them where they are known.
    torque : (arm joints,) N m or None
        Largest joint torques; plans keep them where there is a load.
    endless : (n,) bool
        Joints that turn without end; their limits do not apply.
    couplings : tuple of Coupling
        Bounds on combinations of joints.
    axis_3 : {"", "serial", "horizontal"}
        What axis 3 of the controller measures: joint 3, or the upper arm from the horizontal; ""
        where it is not known, and then no program that says axis 3 is written.
    chain : Chain, optional
        The joint frames of the description that the robot comes from: the audit's kinematics.
    bodies : tuple of Body
        Collision bodies of that description.
    inertia : ChainInertia, optional
        What the joints of that description carry, and
    inertia_missing : str
        why it is not known.
    load : Load, optional
        What the flange carries; with it torques are known and limited, see `with_load`.
    gravity : (3,) m/s^2
        In the robot base; default: that of a robot that stands upright.
    externals : tuple of ExternalAxis
        Rails and positioners: joints more, the last of q and of the limits. See `on_rail`.
    elbow_step : float rad, optional
        Of a seven-axis arm: the largest step of the samples of joint 3 where the exact search takes
        it on a grid, see `with_elbow_step`.

    Raises
    ------
    InputError
        Limits reversed, a speed that is not positive, a length missing, an unknown family.
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

        The model that is derived has been compared with the description: 1e-9 m and rad.

        Parameters
        ----------
        path, base, tip, mount, part, packages, meshes, snap
            As in `kerfpath.urdf.read_urdf`. Poses of the robot are of link `tip` in link `base`,
            with all external axes at zero, those before `mount` and under `part`. Without snap, an
            arm that has a family by its angles rounded is refused; 0 keeps it.
        externals : mapping of joint to Given
            Of external axes: lower, upper, velocity, acceleration (m, rad, s), endless, instead of
            what is written there, name instead of the joint's, and step. None: the arm alone.
        manufacturer, axis_3, axis_3_limits : str, str, (2,) rad
            Whose controller moves it; what its axis 3 measures and, if "horizontal", its limits as
            shown there; default: as a robot of the library with the same lengths has it.
        **limits : (n,) rad, rad/s, rad/s^2, rad/s^3, N m
            lower, upper, velocity, acceleration, jerk, torque, endless: instead of what is written
            there; few descriptions state accelerations and jerks. Continuous joints are endless.

        Raises
        ------
        InputError
            A bad description; a chain of no family; limits that are missing or zero, and not given.
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
        """Return a description (URDF) of its joints, limits and external axes, without bodies.

        Links are base_link, link_1 and so on, and tool0, the flange; with external axes ground, on
        which base_link stands, each axis's carriage, and part: `from_urdf` reads it with tip
        "tool0", mount "base_link" and, where an axis carries the part, part "part".

        Raises
        ------
        InputError
            Couplings, which a URDF cannot say; limits or velocities that are not known.
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
        """Return this robot with a load on its flange, so that its torques are known and limited.

        Parameters
        ----------
        load : Load
        gravity : (3,) m/s^2
            In the robot base.

        Raises
        ------
        InputError
            What the links weigh or what torques the joints bear is not known, see `torque_limit`.
        """
        loaded = replace(self, load=load, gravity=gravity)  # type: ignore[arg-type]  # is cast
        loaded.torque_limit()
        return loaded

    def with_elbow_step(self, step: float) -> Robot:
        """Return this robot with joint 3 sampled in steps of at most `step` rad on a grid.

        Methods "exact", "paper" and "known" need it of a seven-axis arm.

        Raises
        ------
        InputError
            An arm whose poses leave no joint free; a step that is not positive.
        """
        return replace(self, elbow_step=step)

    def on_rail(self, direction: ArrayLike, **travel: Unpack[Travel]) -> Robot:
        """Return this robot with its base on a rail along `direction` (3,).

        Keywords lower, upper, velocity, acceleration (m, m/s, m/s^2), step, name ("rail").
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

        Keywords lower, upper, velocity, acceleration (rad, rad/s, rad/s^2), endless, step, name
        ("positioner"). Of a turn-tilt positioner the tilt comes first.
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
        """Return this robot with one more external axis, carried by those of its side before it.

        Raises
        ------
        InputError
            Limits of the arm that are not known; more than three such axes, or two of one name; an
            endless axis that is linear.
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
            As `kerfpath.external` has it.
        place : (4, 4) m
            Where it stands in the robot base, with all external axes at zero.
        given : mapping of axis to Given
            What the library does not know, or knows otherwise: lower, upper, velocity, acceleration
            (m, rad, s), endless; name, step.

        Raises
        ------
        InputError
            A limit that is neither known nor given; an axis that it does not have; as
            `with_external`.
        """
        placed = [known.placed(np.asarray(place)) for known in product.axes]
        return self._with_known(placed, given, product.id)

    def _with_known(
        self, known: Sequence[KnownAxis], given: Mapping[str, Given], what: str
    ) -> Robot:
        """Return this robot with external axes of which something is known, and more is given."""
        require_known(given, known, what)
        more = [each.completed(**given.get(each.axis.name, {})) for each in known]
        require_distinct_axes(self.id, [*self.externals, *(axis for axis, _ in more)])
        robot = self
        for axis, travel in more:
            robot = robot.with_external(axis, **travel)
        return robot

    def alone(self) -> Robot:
        """Return the arm without its external axes, standing where it does at zero."""
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
        """Return the arm alone, standing against the part as with its external axes at x (E,).

        Parameters
        ----------
        x : (E,) rad; m of a linear axis
            One number will do where there is one axis.

        Raises
        ------
        InputError
            It has no external axis, or another number of them.
        """
        if not self.externals:
            raise InputError(f"robot {self.id!r}: it has no external axis to be held")
        at = floats(np.atleast_1d(np.asarray(x, dtype=float)), "held", (len(self.externals),))
        T, chain = base_in_part(self.externals, at), self.chain
        if chain is not None:
            origins = np.concatenate([T @ chain.origins[:1], chain.origins[1:]])
            chain = replace(chain, origins=origins)
        # A family without lengths has the chain for its model: that has been moved already.
        foot = T @ self.T_base_foot if self.family.lengths else self.T_base_foot
        # Seen from the part; what carries the robot turns the arm in gravity as it does.
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
        An unknown robot or ratio; the message names the nearest ones.
    """
    return read_robot(Robot, name, acceleration_ratio)


def _first(values: Array | None, n: int) -> Array | None:
    return None if values is None else values[:n]
