"""A second dynamics: Lagrange's equations of the joint chain, by its Jacobians.

With the kinetic energy v' M(q) v / 2 of all bodies, where M is the sum of m Jv' Jv + Jw' I Jw, and
their potential energy, the torques are M a + (dM/dt) v - d/dq (v' M v / 2) + g. No code is shared
with the recursion used for planning.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor.chain import JointChain, chain_of
from kerfpath.robots import Robot

STEP = 1e-5
"""rad: central differences of M are good to 1e-10 of its third derivative, rounding to 1e-11."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LagrangeArm:
    """The bodies of an arm and its load, each on one of its joint frames.

    Parameters
    ----------
    chain : JointChain
    frame : (m,) int
        The joint (from 0) that carries each body.
    mass : (m,) kg
    centre : (m, 3) m
        Centres of mass in the turned joint frames.
    tensor : (m, 3, 3) kg m^2
        Inertias about the centres of mass.
    gravity : (3,) m/s^2
    """

    chain: JointChain
    frame: Ints
    mass: Array
    centre: Array
    tensor: Array
    gravity: Array

    __repr__ = short_repr

    @classmethod
    def of(cls, robot: Robot) -> LagrangeArm | None:
        """Return the arm of a robot with its load; None where the robot has none.

        Raises
        ------
        InputError
            The torques of the robot cannot be computed.
        """
        if robot.torque_limit() is None:
            return None
        chain, own, load = chain_of(robot), robot.dynamics.inertia, robot.dynamics.load
        assert own is not None
        assert load is not None
        n, T = len(own.mass), chain.tip
        centre = np.zeros(3) if load.centre is None else load.centre
        tensor = np.zeros((3, 3)) if load.tensor is None else load.tensor
        return cls(
            chain=chain,
            frame=np.append(np.arange(n), n - 1),
            mass=np.append(own.mass, load.mass),
            centre=np.vstack([own.centre, T[:3, :3] @ centre + T[:3, 3]]),
            tensor=np.concatenate([own.tensor, [T[:3, :3] @ tensor @ T[:3, :3].T]]),
            gravity=robot.dynamics.gravity,
        )

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Return the torques (B, n) N m at joints, velocities and accelerations, (B, n) each."""
        M, g = self.inertia(q)
        ahead, behind = (self.inertia(q + sign * STEP * v)[0] for sign in (1, -1))
        turning = np.einsum("bij,bj->bi", (ahead - behind) / (2 * STEP), v)
        for i, along in enumerate(np.eye(q.shape[1])):
            ahead, behind = (self.inertia(q + sign * STEP * along)[0] for sign in (1, -1))
            turning[:, i] -= np.einsum("bi,bij,bj->b", v, (ahead - behind) / (4 * STEP), v)
        return np.asarray(np.einsum("bij,bj->bi", M, a) + turning + g)

    def inertia(self, q: Array) -> tuple[Array, Array]:
        """Return M (B, n, n) kg m^2 and the torques of gravity (B, n) N m at joints q (B, n)."""
        frames, n = self.chain.joints(q), q.shape[1]
        axis = np.stack([T[:, :3, :3] @ u for T, u in zip(frames, self.chain.axes, strict=True)], 2)
        place = np.stack([T[:, :3, 3] for T in frames], 2)
        M, g = np.zeros((len(q), n, n)), np.zeros(q.shape)
        for i, mass, centre, tensor in zip(
            self.frame, self.mass, self.centre, self.tensor, strict=True
        ):
            R = frames[i][:, :3, :3]
            lever = (R @ centre + frames[i][:, :3, 3])[:, :, None] - place
            moves = np.arange(n) <= i
            linear = np.where(moves, np.cross(axis, lever, axis=1), 0.0)
            turning = np.where(moves, axis, 0.0)
            spin = R @ tensor @ R.transpose(0, 2, 1)
            M += mass * linear.transpose(0, 2, 1) @ linear
            M += turning.transpose(0, 2, 1) @ spin @ turning
            g -= mass * np.einsum("x,bxi->bi", self.gravity, linear)
        return M, g
