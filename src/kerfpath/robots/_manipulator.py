"""A manipulator: kinematics of many joint vectors or poses at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, floats, freeze
from kerfpath.errors import InputError
from kerfpath.kernels.enclosure import Curves
from kerfpath.robots._enclosure import Enclosure, ball_frames, require_cells
from kerfpath.robots._external import base_in_part
from kerfpath.robots._limited import Limited
from kerfpath.robots._solutions import Solutions, all_solutions, solutions_within

__all__ = ["Manipulator"]


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
