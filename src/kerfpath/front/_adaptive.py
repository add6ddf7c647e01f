"""The adaptive search: the next runs go where the front is sparse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath._told import told
from kerfpath.front._criteria import Criterion
from kerfpath.front._runs import Run, in_window, quicker
from kerfpath.graph import LayeredGraph
from kerfpath.plans import Plan
from kerfpath.robots import Robot
from kerfpath.search import Metric, ObjectiveKind

__all__ = ["Adaptive", "Made", "reach_of"]

BOUNDED = ("velocity", "acceleration", "speed", "range", "clearance")
"""Criteria that a run can be held to a value of."""
KNOWN = ("displacement", "increment", "velocity", "acceleration", "speed")
"""Criteria whose best value the first runs have found."""
RANDOM = 4
"""One run in so many is drawn at random."""
SPREAD = 0.7
"""Standard deviation of the logarithm by which weights are varied: factors of 2 are common."""
FINEST = 5
"""Steps by which what is asked for beyond the best of a range nears it, half by half."""
TRIES = 8
"""Windows that are looked at for a pose of every node before a run is spent on one."""
ROOM = 1e-9
"""rad, by which windows are wider than the motion that they are to hold: rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Made:
    """A run that has a plan.

    Parameters
    ----------
    number : int
        Its place among all runs.
    run : Run
    losses : (C,)
        Its criteria, with signs by which less is better.
    reach : (n, 2) rad
        Lowest and highest value of each joint, endless ones unrolled.
    """

    number: int
    run: Run
    losses: Array
    reach: Array

    __repr__ = told


def reach_of(plan: Plan) -> Array:
    """Return the lowest and highest value of each joint (n, 2), endless ones unrolled."""
    q = plan.q[0] + np.vstack([np.zeros(plan.q.shape[1]), np.cumsum(plan.increments, axis=0)])
    return freeze(np.stack([q.min(axis=0), q.max(axis=0)], axis=1))


class Adaptive:
    """Proposes runs between the neighbours on the front that are farthest apart.

    Neighbours are taken criterion by criterion. What lies between two of them is asked for by the
    epsilon constraint (Haimes, Lasdon, Wismer, IEEE Trans. SMC 1, 1971): the better one's value
    and some of the way to the other's is allowed, by eta, windows or clearance, and the rest
    is as one of the two was asked for, or minimises what one of the first runs did. Where there is
    no such bound, as on displacements, the weights go between. Each attempt at a gap halves
    its claim to the next.
    """

    def __init__(
        self,
        criteria: Sequence[Criterion],
        first: Sequence[Run],
        robot: Robot,
        graph: LayeredGraph,
        speed: float,
        rng: np.random.Generator,
    ) -> None:
        self._criteria, self._first, self._rng = criteria, first, rng
        self._graph, self._endless, self._speed = graph, robot.endless, speed
        self._velocity, _ = robot.speed_limits()
        self._attempts: Counter[tuple[int, int, int]] = Counter()
        self._proposed = 0

    def next(self, front: Sequence[Made], scale: Array) -> Run:
        """Return the next run, from the front (at least one plan) in criteria of a scale (C,)."""
        self._proposed += 1
        if self._proposed % RANDOM:
            width, c, a, b = max(self._gaps(front, scale), key=lambda gap: gap[0])
            if width > 0:
                return self._between(c, a, b)
        return self._varied(front[int(self._rng.integers(len(front)))].run)

    def _gaps(
        self, front: Sequence[Made], scale: Array
    ) -> Iterator[tuple[float, int, Made | None, Made]]:
        """Yield the claim, criterion, better and worse neighbour of every gap."""
        for c, criterion in enumerate(self._criteria):
            ordered = sorted(front, key=lambda made: (made.losses[c], made.number))
            before: list[Made | None] = [None, *ordered[:-1]]
            for a, b in zip(before, ordered, strict=True):
                if a is not None:
                    width = float(b.losses[c] - a.losses[c]) / scale[c]
                elif criterion.kind not in BOUNDED or criterion.kind in KNOWN:
                    width = 0.0
                else:
                    width = abs(float(b.losses[c])) / scale[c]
                yield width / 2.0 ** self._attempts[self._key(c, a, b)], c, a, b

    @staticmethod
    def _key(c: int, a: Made | None, b: Made) -> tuple[int, int, int]:
        return (c, -1, -1) if a is None else (c, a.number, b.number)

    def _between(self, c: int, a: Made | None, b: Made) -> Run:
        """Return a run whose plan is to lie between two neighbours in a criterion.

        Without a better one: beyond the best, by half of all there is, then a quarter, and so on,
        and from the half again.
        """
        key = self._key(c, a, b)
        attempt = self._attempts[key]
        self._attempts[key] += 1
        criterion, rng = self._criteria[c], self._rng
        run, share = b.run, 0.5
        if a is None:
            share = 1 - 0.5 ** (1 + attempt % FINEST)
        elif attempt:
            run, share = self._mixed(a.run, b.run), rng.uniform()
        if a is not None and criterion.kind not in BOUNDED:
            weights = a.run.weights ** (1 - share) * b.run.weights**share
            run = replace(run, weights=freeze(weights))
            return self._varied(run) if attempt else run
        if rng.integers(2):
            aim = self._first[int(rng.integers(len(self._first)))]
            run = replace(run, objective=aim.objective, metric=aim.metric, weights=aim.weights)
        low = float(b.losses[c] - abs(b.losses[c]) if a is None else a.losses[c])
        value = abs(low + share * (float(b.losses[c]) - low))
        match criterion.kind:
            case "velocity":
                return replace(run, eta_v=value)
            case "acceleration":
                return replace(run, eta_a=value)
            case "clearance":
                return replace(run, clearance=value)
            case "speed":
                return quicker(self._at_full(run), value / self._speed)
        return replace(run, window=self._window(criterion, value, a, b, run.window))

    def _window(
        self, criterion: Criterion, value: float, a: Made | None, b: Made, before: Array
    ) -> Array:
        """Return windows (n, 2) that hold a range to a value.

        Around the joints' reach in the better plan, inside that of the worse one or, for one joint,
        anywhere that leaves every node a pose.
        """
        widths = [np.ptp(made.reach, axis=1) for made in (a or b, b)]
        around = a is not None and bool(self._rng.integers(2))
        window = before.copy()
        if criterion.joint is None:
            joints = np.arange(len(window))
            if around and a is not None:
                low = np.minimum(a.reach[:, 0], b.reach[:, 0])
                more = np.maximum(a.reach[:, 1], b.reach[:, 1]) - low - widths[0]
                had, all_more = (float((w / self._velocity).sum()) for w in (widths[0], more))
                width = widths[0] + min(1.0, (value - had) / max(all_more, ROOM)) * more
            else:
                width = widths[1] * value / float((widths[1] / self._velocity).sum())
        else:
            joints = np.array([criterion.joint])
            width = np.full(len(window), value)
        place = self._rng.uniform(size=len(window))
        held = a.reach if around and a is not None else b.reach
        low = held[:, 0] + place * (np.ptp(held, axis=1) - width)
        if criterion.joint is not None and self._rng.integers(2):
            low[criterion.joint] = self._elsewhere(criterion.joint, value, low[criterion.joint])
        window[joints] = np.stack([low - ROOM, low + width + ROOM], axis=1)[joints]
        return freeze(window)

    def _elsewhere(self, joint: int, width: float, otherwise: float) -> float:
        """Return where a window of one joint begins that holds a pose of every node, if found.

        At a vertex: so does the reach of every path.
        """
        q, start = self._graph.q[:, joint], self._graph.start
        for _ in range(TRIES):
            low = q[self._rng.integers(len(q))]
            inside = in_window(q, low, width, endless=bool(self._endless[joint]))
            if np.logical_or.reduceat(inside, start[:-1]).all():
                return float(low)
        return otherwise

    def _at_full(self, run: Run) -> Run:
        """Return a run with all that the limits allow."""
        return replace(run, eta_v=self._first[0].eta_v, eta_a=self._first[0].eta_a)

    def _mixed(self, a: Run, b: Run) -> Run:
        """Return a run that takes what it minimises, its etas and each window from either."""
        aim, v, e, c, *windows = self._rng.integers(2, size=4 + len(a.window)).astype(bool)
        return replace(
            a if aim else b,
            eta_v=(a if v else b).eta_v,
            eta_a=(a if e else b).eta_a,
            clearance=(a if c else b).clearance,
            window=freeze(np.where(np.array(windows)[:, None], a.window, b.window)),
        )

    def _varied(self, run: Run) -> Run:
        """Return a run with other weights, and any objective and metric."""
        rng = self._rng
        return replace(
            run,
            objective=get_args(ObjectiveKind)[rng.integers(2)],
            metric=get_args(Metric)[rng.integers(3)],
            weights=freeze(run.weights * np.exp(rng.normal(0.0, SPREAD, len(run.weights)))),
        )
