"""The joint motion along an arc that is to replace straight moves, and its limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.post._program import Program

__all__ = ["ArcLimits", "Stretch"]

MARGIN = 0.01
"""Share of a limit that arcs leave unused, for rounding in the text and other node times."""
NEAR = np.radians(5.0)
"""An arc farther than this (rad) from the planned joints is on another branch."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Moves of a path, with the moves that join them to the motion before and after.

    Parameters
    ----------
    before, after : (q (n,) rad, dt s) or None
        The node before the first with the time since it, and the node after the last with the time
        to it; None where the robot is stopped.
    q : (m + 1, n) rad
        Joints planned from the first node to the last.
    dt : (m,) s
    """

    before: tuple[Array, float] | None
    after: tuple[Array, float] | None
    q: Array
    dt: Array

    __repr__ = short_repr

    def joined(self, q: Array, dt: Array) -> tuple[Array, Array]:
        """Return joints and time steps from `before` to `after`, through q (m + 1, n) in dt."""
        if self.before is not None:
            q, dt = np.vstack([self.before[0], q]), np.append(self.before[1], dt)
        if self.after is not None:
            q, dt = np.vstack([q, self.after[0]]), np.append(dt, self.after[1])
        return q, dt


@dataclass(frozen=True, slots=True, eq=False)
class ArcLimits:
    """Limits of position, velocity and acceleration that the joints keep along an arc.

    A limit is kept if an arc stays `MARGIN` below it or uses no more of it than planned there.

    Parameters
    ----------
    program : Program
        Program with the robot and the frames.
    eta_v, eta_a : float
        Share of the velocity and acceleration limits that may be used.
    """

    program: Program
    eta_v: float = 1.0
    eta_a: float = 1.0

    def along(self, poses: Array, stretch: Stretch) -> Array | None:
        """Return the joints (m + 1, n) rad along an arc, or None if they exceed a limit.

        Parameters
        ----------
        poses : (m, 4, 4) m
            Tip poses in the part frame, at even times after the first node.
        stretch : Stretch
            The moves that the arc is to replace.
        """
        program, planned = self.program, stretch.q
        T = program.T_base_part @ poses @ np.linalg.inv(program.T_flange_tip)
        found = program.robot.nearest(T, planned[1:])
        if not np.abs(found - planned[1:]).max() < NEAR:  # also catches NaN
            return None
        q = np.vstack([planned[:1], found])
        even = np.full(len(poses), stretch.dt.sum() / len(poses))
        ours = self._shares(*stretch.joined(q, even))
        theirs = self._shares(*stretch.joined(planned, stretch.dt))
        for share, plan, eta in zip(ours, theirs, (self.eta_v, self.eta_a), strict=True):
            if (share > np.maximum(eta * (1 - MARGIN), plan)).any():
                return None
        limits = program.robot.joint_limits()
        beyond = np.maximum(limits.lower - q, q - limits.upper)[:, ~limits.endless]
        sums = q @ limits.rows.T
        beyond = np.hstack([beyond, np.maximum(limits.row_lower - sums, sums - limits.row_upper)])
        return None if (beyond > 0).any() else q

    def _shares(self, q: Array, dt: Array) -> tuple[Array, Array]:
        """Return shares of the velocity (m, n) and acceleration (m - 1, n) limits."""
        velocity, acceleration = self.program.robot.speed_limits()
        rate = np.diff(q, axis=0) / dt[:, None]
        change = np.diff(rate, axis=0) / ((dt[1:] + dt[:-1]) / 2)[:, None]
        return np.abs(rate) / velocity, np.abs(change) / acceleration
