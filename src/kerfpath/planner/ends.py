"""Where the robot comes from and goes to: the moves there, and the turns and posture for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, short_repr
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner.turned import in_other_postures, turned
from kerfpath.plans import Plan
from kerfpath.setup import Setup
from kerfpath.transfer import (
    PATIENCE,
    SECONDS,
    MoveTimes,
    can_back_off,
    on_nearest_turns,
    require_clear_ends,
)

CALLED = ("start_q", "end_q")
"""What the ends are called in messages."""
NEAREST = 32
"""Most turns on which each motion is offered."""
BEYOND = 1e-9
"""rad: rounding by which an end may be beyond a joint limit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ends:
    """Where the robot stands before a cut and after it.

    Parameters
    ----------
    setup : Setup
    start, end : (n,) rad, optional
        None: the cut begins, or ends, where it is best.
    """

    setup: Setup
    start: Array | None
    end: Array | None

    __repr__ = short_repr

    @classmethod
    def of(cls, setup: Setup, start_q: ArrayLike | None, end_q: ArrayLike | None) -> Ends:
        """Return the ends, checked.

        Raises
        ------
        InputError
            A wrong shape, a number that is not finite, or a joint beyond its limits.
        NoFeasiblePath
            The robot is not clear there (proved).
        """
        start, end = (
            None if q is None else _checked(setup, q, name)
            for q, name in zip((start_q, end_q), CALLED, strict=True)
        )
        return cls(setup=setup, start=start, end=end)

    @property
    def given(self) -> bool:
        """Whether the robot comes from, or goes to, a place that is given."""
        return self.start is not None or self.end is not None

    def alike(self, made: Plan) -> list[Plan]:
        """Return a plan, and motions that cost nearly the same: turned, and in other postures."""
        cell = self.setup.cell
        same = [made, *in_other_postures(made, cell)]
        near = [q for q in (self.start, self.end) if q is not None]
        more = [turned(one, near[0], near[-1], cell) for one in same]
        others = [one for one in (*same[1:], *more) if one is not None]
        said = "turned, or in another posture, for shorter moves to it and from it"
        return [made, *(replace(one, proof=one.proof.also(said)) for one in others)]

    def joined(self, plans: Sequence[Plan]) -> Plan:
        """Return one of some plans on turns of its joints, with the moves to it and from it.

        Of all that the robot can come to and leave, it is the one whose moves take the least time;
        each plan is offered on the `NEAREST` turns. Endless joints go the short way. Where no way
        around is found in `SECONDS`, the other turns of that posture are only reached straight;
        `PATIENCE` searches may fail.

        Raises
        ------
        NoFeasiblePath
            There is no way to or from any of them; the message names the first that was tried.
        """
        offered, broken = list[Plan](), None
        for made in plans:
            retract = made.settings.retract or 0.0
            try:
                require_clear_ends(made, self.setup.cell, retract)
            except NoFeasiblePath as error:
                broken = broken or error
                continue
            turns = on_nearest_turns(made, self.start, self.end, NEAREST)
            offered += [one for one in turns if can_back_off(one, retract)]
        if not offered:
            assert broken is not None, "a plan itself is among its turns"
            raise broken
        air = self._times(offered)
        while len(air.failed) < PATIENCE:
            took = air.first + air.last
            best = np.array([int(np.argmin(took))])
            if not np.isfinite(took[best[0]]):
                break
            failed = len(air.failed)
            changed = air.look_at(best)
            if len(air.failed) > failed:
                posture = int(offered[best[0]].posture[0])
                air.keep_straight(np.flatnonzero([one.posture[0] == posture for one in offered]))
            if not changed:
                (made,), moves, _ = air.unrolled(best)
                return replace(
                    made,
                    approach=None if self.start is None else moves[0],
                    retreat=None if self.end is None else moves[-1],
                )
        raise air.why_no_order(None)

    def _times(self, offered: list[Plan]) -> MoveTimes:
        retract = offered[0].settings.retract or 0.0
        one_contour = np.zeros(len(offered), np.int64)
        air = MoveTimes(offered, one_contour, self.setup.cell, retract, SECONDS, called=CALLED)
        if self.start is not None:
            air.come_from(self.start)
        if self.end is not None:
            air.go_to(self.end)
        return air


def _checked(setup: Setup, q: ArrayLike, name: str) -> Array:
    robot = setup.robot
    found = floats(q, name, (robot.joints,), hint="give the value of every joint, in rad")
    limits = robot.joint_limits()
    out = np.maximum(limits.lower - found, found - limits.upper) > BEYOND
    if (over := np.flatnonzero(out & ~limits.endless)).size:
        i = int(over[0])
        turn = robot.units[i] == "rad"
        low, value, high = (
            f"{np.degrees(x):.6g} deg" if turn else f"{x * 1e3:.6g} mm"
            for x in (limits.lower[i], found[i], limits.upper[i])
        )
        raise InputError(
            f"{name}: expected {robot.joint_names[i]} from {low} to {high}, got {value}; give "
            "joints within the limits of the robot"
        )
    sums = limits.rows @ found
    if ((sums < limits.row_lower - BEYOND) | (sums > limits.row_upper + BEYOND)).any():
        raise InputError(f"{name}: beyond the limits of coupled joints of {robot.id}")
    if setup.cell is not None:
        gap, pair = setup.cell.clearance(found[None])
        if gap[0] <= 0:
            one, two = setup.cell.pair_names[int(pair[0])]
            raise NoFeasiblePath(
                f"{name}: {one!r} and {two!r} come {-gap[0] * 1e3:.3g} mm nearer than allowed "
                "where the robot stands",
                proved=True,
                node=-1,
            )
    return found
