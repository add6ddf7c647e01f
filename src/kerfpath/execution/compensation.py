"""Targets moved so that the executed path meets the drawing, by a model or by measured runs.

Each round, every node is moved by what the executed path lacks there, smoothed along the path, as
in iterative learning control (Bristow, Tharayil and Alleyne 2006). A low-pass answers displacements
with less of the same sign, so the rounds converge; deflection may turn the sign of fast ones, which
the smoothing leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.execution.executed import Executed, timing_of
from kerfpath.execution.path_error import largest_share, on_chords, path_error
from kerfpath.execution.response import ASSUMED, Response
from kerfpath.plans import Plan, Proof
from kerfpath.robots import base_in_part

# -----------------------------------------------------------------------------
# What an executed path lacks at the nodes, and plans with moved nodes.

MOVED = "its targets are moved"
"""Claim of a plan with moved nodes: nothing else is proved about it."""


def in_order(points: Array, way: Array) -> Ints:
    """Return the sample of a way (m, 3) that is nearest to each of the points (K, 3), in order.

    Later points have no earlier samples, so that a way that passes a place twice is told apart; the
    sum of squared distances is the least.
    """
    total, ends = np.zeros(len(way)), []
    for point in points:
        cost = total + ((way - point) ** 2).sum(axis=1)
        total = np.minimum.accumulate(cost)
        ends.append(np.packbits(cost <= total))
    found, last = np.zeros(len(points), dtype=np.int64), len(way)
    for k in range(len(points) - 1, -1, -1):
        found[k] = np.flatnonzero(np.unpackbits(ends[k], count=len(way))[:last])[-1]
        last = found[k] + 1
    return found


def lacking(points: Array, way: Array) -> Array:
    """Return the vectors (K, 3) m from an executed way (m, 3) to points of the drawing (K, 3)."""
    near = in_order(points, way)
    starts = np.clip(near[:, None] + [-1, 0], 0, len(way) - 2)
    along, far = on_chords(points[:, None], way[starts], way[starts + 1])
    row, side = np.arange(len(points)), np.argmin(far, axis=1)
    start = starts[row, side]
    there = way[start] + along[row, side, None] * (way[start + 1] - way[start])
    return np.asarray(points - there)


def smoothed(values: Array, time: Array, width: float) -> Array:
    """Return values (K, 3) at times (K,) s, each the mean of its neighbours' by a Gauss function.

    They fade out towards both ends, where the robot stands and the nodes stay.

    Parameters
    ----------
    width : float s
        Standard deviation.
    """
    weight = np.exp(-(((time[:, None] - time) / width) ** 2) / 2)
    mean = weight @ values / weight.sum(axis=1)[:, None]
    near = np.minimum(time - time[0], time[-1] - time) / width
    return np.asarray(mean * (1 - np.exp(-(near**2) / 2))[:, None])


def lengths_of(drawn: Contour, points: Array) -> Array:
    """Return the arc lengths (K,) m of nodes of a drawing that are moved to points (K, 3) m."""
    chords = [np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (points, drawn.points)]
    steps = np.diff(drawn.s) * chords[0] / np.maximum(chords[1], 1e-12)
    return np.append(0.0, np.cumsum(steps))


def moved(plan: Plan, displacement: Array) -> Plan | None:
    """Return a plan with its nodes moved, the tool turned as before; None if one is out of reach.

    It may use the limits in full: shares of them leave room for what differs from the plan.

    Parameters
    ----------
    plan : Plan
    displacement : (K, 3) m
        In the part.
    """
    robot, n = plan.robot, plan.robot.arm.joints
    T = plan.T_part_tip.copy()
    T[:, :3, 3] += displacement
    seen = np.linalg.inv(base_in_part(robot.externals, plan.q[:, n:])) @ plan.T_base_part @ T
    q = robot.arm.nearest(seen @ np.linalg.inv(plan.T_flange_tip), plan.q[:, :n])
    if np.isnan(q).any():
        return None
    frames = np.asarray(np.linalg.solve(plan.T_base_part, plan.frames), dtype=np.float64)
    contour = Contour(
        T[:, :3, 3], T[:, :3, 2], s=lengths_of(plan.contour, T[:, :3, 3]), kind=plan.contour.kind,
        x=frames[:, :3, 0], name=plan.name,
    )  # fmt: skip
    return replace(
        plan,
        contour=contour,
        q=np.hstack([q, plan.q[:, n:]]),
        tilt=np.zeros((len(q), 2)),
        settings=replace(plan.settings, tilt=None, gamma_windows=(), eta_v=1.0, eta_a=1.0),
        proof=Proof(optimal=False, statement=MOVED),
    )


def shortfall(plan: Plan, drawn: Contour, way: Array, width: float) -> Array:
    """Return by what (K, 3) m an executed way misses the nodes of a plan, smoothed in time.

    It has no part along the path: where the tool is too late there, the cut is as drawn.

    Parameters
    ----------
    plan : Plan
    drawn : Contour
        With the nodes of the plan as drawn.
    way : (m, 3) m
        The tip in the part, in order.
    width : float s
        Standard deviation of the smoothing.
    """
    along = np.gradient(drawn.points, drawn.s, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    off = lacking(drawn.points, way)
    off -= (off * along).sum(axis=1)[:, None] * along
    return smoothed(off, plan.time, width)


# -----------------------------------------------------------------------------
# Compensation by the model of the response.

GAIN = 1.0
"""Share of what is lacking by which nodes are moved in a round."""
WIDTH = 0.5
"""Standard deviation of the smoothing, in largest sigmas: it leaves out what would only add
acceleration."""
ROUNDS = 12
AIM = 0.5
"""Share of the tolerance that is aimed at: digits of the text and zones take some of it."""
FALLS = 0.97
"""Factor on the rest below which a round is worth it."""
HOLDS = 0.4
"""m/s: speed up to which responses hold that name none. No model was good enough above."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compensation:
    """A plan whose targets are moved, and what that gives.

    Parameters
    ----------
    plan : Plan
        With moved nodes; as it was where nothing helps.
    before, rest : float m
        Largest distance of the executed tip from the drawn path, of both plans.
    largest : float m
        Largest displacement of a node.
    rounds : int
    run : Executed or None
        The run of the plan with moved nodes.
    failure : str
        Why the tolerance is not kept; empty if it is.
    """

    plan: Plan
    before: float
    rest: float
    largest: float
    rounds: int
    run: Executed | None = None
    failure: str = ""

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compensator:
    """Compensation of plans along one path by a model of the response.

    Parameters
    ----------
    path : Contour
        The contour as drawn, in the part.
    response : Response
    tolerance : float m
        Largest distance of the executed tip from the path.
    most : float m
        Largest displacement of a node.
    run : callable
        Returns the run of a plan as a controller executes its program, with proved bounds or not.
    broken : callable
        Returns which limit a plan and its run break, in words; empty if none.
    """

    path: Contour
    response: Response
    tolerance: float
    most: float
    run: Callable[[Plan, bool], Executed]
    broken: Callable[[Plan, Executed], str]

    __repr__ = short_repr

    @property
    def fastest(self) -> float:
        """Speed, m/s, up to which the response holds."""
        return HOLDS if self.response.fastest is None else self.response.fastest

    def of(self, plan: Plan) -> Compensation:
        """Return the plan with its nodes moved until the executed path is as drawn.

        The rest falls from round to round; they end where it is half the tolerance, or no longer
        falls. Of these rounds, that with the smallest rest is taken which breaks no limit. The
        first and the last node stay.

        Raises
        ------
        InputError
            The response is ideal, or as `kerfpath.execution.executed`.
        """
        if self.response.model == "ideal":
            raise InputError(
                "compensation: expected joints that lag, got an ideal response, with which there "
                "is nothing to compensate"
            )
        tried = [self._tried(plan, np.zeros((len(plan.q), 3)))]
        if (speed := speed_of(plan)) > self.fastest:
            share = np.floor(6e4 * self.fastest) / 1e3
            why = f"the response is not known above {share:g} m/min"
            return self._result(plan, tried, f"{why}, and the cut has {60 * speed:.4g} m/min")
        width, gain = smoothing(self.response), GAIN
        for _ in range(ROUNDS):
            best = tried[-1]
            if best.rest <= AIM * self.tolerance or gain < GAIN / 4:
                break
            step = shortfall(plan, plan.contour, best.way, width)
            made = moved(plan, best.displacement + gain * step)
            found = None if made is None else self._tried(made, best.displacement + gain * step)
            if found is None or found.rest > FALLS * best.rest:
                gain /= 2
            else:
                tried.append(found)
        return self._chosen(plan, tried)

    def by(self, plan: Plan, displacement: Array) -> Compensation:
        """Return the plan with its nodes moved by displacements, (K, 3) m, from measured runs.

        What it executes by the response is stated, and not judged.
        """
        tried = [self._tried(plan, np.zeros((len(plan.q), 3)))]
        made = moved(plan, displacement)
        if made is None:
            return self._result(plan, tried, "a moved target would be out of reach")
        best = self._tried(made, displacement)
        run = self.run(made, True)
        failure = self._too_far(best) or self.broken(made, run)
        return replace(self._result(made, tried, failure, best), run=run)

    def share(self, plan: Plan) -> float | None:
        """Return the largest share of its speed, to 3 %, at which a plan can be compensated.

        The joints keep their way; None if a tenth of the speed is too fast.
        """
        high = min(1.0, self.fastest / speed_of(plan))
        if self.keeps_at(plan, high):
            return high
        return largest_share(partial(self.keeps_at, plan), 0.8 * high, high)

    def keeps_at(self, plan: Plan, share: float) -> bool:
        """Return whether a plan can be compensated at a share of its speed."""
        return not self.of(replace(plan, time=plan.time / share)).failure

    def _tried(self, plan: Plan, displacement: Array) -> _Tried:
        run = self.run(plan, False)
        if not run.reached:
            return _Tried(plan, displacement, run.T[:, :3, 3], np.inf, 0.0)
        alone = replace(self.response, sigma_range=None)
        off = path_error(run, self.path, timing=timing_of(run), response=alone)
        return _Tried(plan, displacement, off.T[:, :3, 3], off.largest, float(off.s[off.worst]))

    def _chosen(self, plan: Plan, tried: Sequence[_Tried]) -> Compensation:
        """Return the best of the rounds that break nothing; or why there is none."""
        why = ""
        for best in reversed(tried):
            if best.rest > self.tolerance:
                why = why or (
                    f"with moved targets the executed path at s = {best.at * 1e3:.1f} mm is still "
                    f"{best.rest * 1e3:.2g} mm off the drawing, allowed {self.tolerance * 1e3:g} mm"
                )
                break
            run = self.run(best.plan, True)
            broken = self._too_far(best) or self.broken(best.plan, run)
            if not broken:
                return replace(self._result(best.plan, tried, "", best), run=run)
            why = why or broken
        return self._result(plan, tried, why)

    def _too_far(self, tried: _Tried) -> str:
        if tried.largest <= self.most:
            return ""
        return (
            f"a target would be moved by {tried.largest * 1e3:.2g} mm, allowed "
            f"{self.most * 1e3:g} mm (compensate_most_mm)"
        )

    def _result(
        self, plan: Plan, tried: Sequence[_Tried], failure: str, best: _Tried | None = None
    ) -> Compensation:
        chosen = tried[0] if best is None else best
        return Compensation(
            plan=plan,
            before=tried[0].rest,
            rest=chosen.rest,
            largest=chosen.largest,
            rounds=len(tried) - 1,
            failure=failure,
        )


class _Tried(NamedTuple):
    """A plan with moved nodes, the displacements (K, 3) m, and the executed way (m, 3) m.

    The rest is the largest distance of the way from the drawn path, m, and `at` the arc length of
    the path there, m.
    """

    plan: Plan
    displacement: Array
    way: Array
    rest: float
    at: float

    @property
    def largest(self) -> float:
        """The largest displacement, m."""
        return float(np.linalg.norm(self.displacement, axis=1).max())


def smoothing(response: Response) -> float:
    """Return the standard deviation, s, over which what is lacking is averaged."""
    return WIDTH * float(response.sigma.max() or ASSUMED.sigma.max())


def speed_of(plan: Plan) -> float:
    """Return the largest speed of a plan along its contour, m/s."""
    return float((np.diff(plan.contour.s) / np.diff(plan.time)).max())
