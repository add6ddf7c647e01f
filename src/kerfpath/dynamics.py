"""Joint torques of a motion.

The model has rigid links on rigid joints, with the inertias of a robot description, a load on the
flange, and gravity. Friction and the inertia of rotors and gears are in no description and are left
out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, freeze, not_negative, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels.dynamics import ArmBodies, torques
from kerfpath.urdf import ChainInertia, KinematicChain, joined, require_tensor

__all__ = ["STANDARD_GRAVITY", "ArmDynamics", "Load"]

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""m/s^2, in the base of a floor-mounted robot."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Load:
    """Load on the flange: the tool and everything fixed to it.

    Parameters
    ----------
    mass : float kg
        0 for no load.
    centre : (3,) m, optional
        Centre of mass in the flange frame; required if the mass is not 0.
    tensor : (3, 3) kg m^2, optional
        Inertia about the centre of mass, along the axes of the flange frame; default: zero, a point
        mass.

    Raises
    ------
    InputError
        A mass that is negative or without a centre, an inertia that is not positive definite.
    """

    mass: float
    centre: Array | None = None
    tensor: Array | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        _set = object.__setattr__
        _set(self, "mass", not_negative(self.mass, "load mass", unit="kg"))
        if self.centre is not None:
            _set(self, "centre", floats(self.centre, "load centre", (3,)))
        elif self.mass > 0:
            raise InputError(
                f"load centre: expected the centre of mass of {self.mass:g} kg in the flange frame "
                "(3 numbers, m), got none"
            )
        if self.tensor is not None:
            tensor = floats(self.tensor, "load tensor", (3, 3))
            require_tensor(tensor, "load tensor")
            _set(self, "tensor", tensor)

    def on(self, inertia: ChainInertia, T_joint_flange: Array) -> ChainInertia:
        """Return the bodies of an arm with this load added to the last one.

        Parameters
        ----------
        inertia : ChainInertia
            The bodies without the load.
        T_joint_flange : (4, 4) m
            Pose of the flange in the frame of the last joint.
        """
        if self.mass == 0:
            return inertia
        assert self.centre is not None
        R, tensor = T_joint_flange[:3, :3], self.tensor
        own = np.zeros((3, 3)) if tensor is None else R @ tensor @ R.T
        last = inertia.mass[-1], inertia.centre[-1], inertia.tensor[-1]
        load = self.mass, T_joint_flange[:3, 3] + R @ self.centre, own
        mass, centre, tensor = joined([last, load])
        return ChainInertia(
            mass=np.append(inertia.mass[:-1], mass),
            centre=np.vstack([inertia.centre[:-1], centre]),
            tensor=np.concatenate([inertia.tensor[:-1], tensor[None]]),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArmDynamics:
    """An arm as rigid bodies under gravity.

    Parameters
    ----------
    chain : KinematicChain
        The joints, up to the flange.
    inertia : ChainInertia
        The body that each joint moves, load included.
    gravity : (3,) m/s^2
        In the robot base.

    Raises
    ------
    InputError
        Another number of bodies than of joints, or a gravity that is not three numbers.
    """

    chain: KinematicChain
    inertia: ChainInertia
    gravity: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", floats(self.gravity, "gravity", (3,)))
        if len(self.inertia.mass) != len(self.chain.axes):
            raise InputError(
                f"inertia: expected {len(self.chain.axes)} bodies, one per joint, got "
                f"{len(self.inertia.mass)}"
            )

    @property
    def bodies(self) -> ArmBodies:
        """The arm as arrays for the kernels."""
        return ArmBodies(
            rotation=freeze(np.ascontiguousarray(self.chain.origins[:, :3, :3])),
            position=freeze(np.ascontiguousarray(self.chain.origins[:, :3, 3])),
            axis=self.chain.axes,
            mass=self.inertia.mass,
            centre=self.inertia.centre,
            tensor=self.inertia.tensor,
            gravity=self.gravity,
        )

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Return the joint torques (B, n) N m of a motion.

        Parameters
        ----------
        q, dq, ddq : (B, n) rad, rad/s, rad/s^2
            Joints, their velocities and their accelerations.

        Raises
        ------
        InputError
            Arrays of another shape, NaN.
        """
        n = len(self.chain.axes)
        rows = floats(q, "q", (None, n), copy=False)
        shape = rows.shape
        found = np.empty(shape)
        torques(
            self.bodies,
            rows,
            floats(dq, "dq", shape, copy=False),
            floats(ddq, "ddq", shape, copy=False),
            found,
        )
        return freeze(found)
