"""The first-order search over continuous gamma: values between the samples, and paths by them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import continuous as kernel
from kerfpath.kernels.beam import Beam, advance
from kerfpath.kernels.continuous import Steps, Targets
from kerfpath.kernels.metric import increments_between
from kerfpath.search._problem import SearchProblem
from kerfpath.search._rotation import unroll

__all__ = ["ContinuousPath", "GammaSamples", "find_continuous"]

WIDEST, WIDEST_STEPS = 0.5, 6.0
"""rad, and steps of gamma: neighbouring samples are joined where no joint moves further."""
MOST_ENDS = 12
"""First vertices that are tried, one by one, where the way depends on which it is."""
_LAYERS_SAMPLED, _VERTICES_SAMPLED = 12, 16
"""Layers, and vertices of each, by which the joint that sorts the targets is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GammaSamples:
    """How the vertices of a problem lie on circles of gamma.

    Parameters
    ----------
    sample, variant, posture : (N,) int
        Sample of gamma, variant (tilt, external axis) and posture of each vertex; every layer is
        ordered by variant and sample.
    samples : int
        Number of samples on the circle.
    """

    sample: Ints
    variant: Ints
    posture: Ints
    samples: int

    __repr__ = short_repr

    def of(self, vertices: Ints) -> GammaSamples:
        """Return the samples of other vertices, each one of these."""
        return replace(
            self,
            sample=self.sample[vertices],
            variant=self.variant[vertices],
            posture=self.posture[vertices],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContinuousPath:
    """One point of each layer, at a vertex or between two of neighbouring samples.

    Parameters
    ----------
    one, other : (K,) int
        Rows of q that each point is between; the same at a vertex.
    share : (K,)
        Where between them, from 0 to 1.
    q : (K, n) rad
        Joints, interpolated.
    value : float
        What the value function says of the way from its first vertex.
    """

    one: Ints
    other: Ints
    share: Array
    q: Array
    value: float

    __repr__ = short_repr


def find_continuous(
    problem: SearchProblem, samples: GammaSamples, *, most: int
) -> list[ContinuousPath]:
    """Return good paths over continuous gamma, from different first vertices, the best one first.

    Each keeps (5) between the points of its layers, and (6) where the way forward lets it; closure
    and rotation limits too. Joints between two samples are interpolated.

    Parameters
    ----------
    problem : SearchProblem
        Without shut edges.
    samples : GammaSamples
    most : int
        Largest number of paths.

    Raises
    ------
    InputError
        Shut edges.
    """
    if len(problem.shut):
        raise InputError("shut: the search over continuous gamma knows closed vertices only")
    field = _Field(problem, samples)
    closed = problem.closure == "periodic"
    if not closed and not np.isfinite(problem.rotation).any():
        return field.paths(field.values(field.cost, field.open_end()), most)
    return field.tied_paths(most, closed=closed)


class _Field:
    """A problem with its targets, joints that may not turn on and on unrolled."""

    def __init__(self, problem: SearchProblem, samples: GammaSamples) -> None:
        layers, self._origin = problem.layers, np.arange(len(problem.q))
        velocity = problem.aim.velocity
        limited = np.isfinite(problem.rotation)
        if limited.any():
            layers, place = unroll(layers, problem.rotation)
            self._origin = place + np.repeat(problem.start[:-1], np.diff(layers.start))
            samples = samples.of(self._origin)
            velocity = np.where(limited, np.minimum(velocity, np.pi), velocity)
        self._problem, self.cost = problem, np.ascontiguousarray(layers.cost)
        self._steps = Steps(
            problem.aim.weight, problem.aim.metric, problem.aim.minimax, np.inf,
            np.ascontiguousarray(-velocity), np.ascontiguousarray(velocity),
        )  # fmt: skip
        self._targets = _targets(
            np.ascontiguousarray(layers.q), layers.start, layers.endless, samples, velocity
        )

    def open_end(self) -> Array:
        """Return what ends cost where a path may end anywhere, the last layer (m,)."""
        return self.cost[self._targets.start[-2] :]

    def values(self, cost: Array, ends: Array, steps: Steps | None = None) -> Array:
        """Return the value function (N,) where vertices cost (N,) and ends (m,)."""
        V = np.full(len(cost), np.inf)
        V[self._targets.start[-2] :] = ends
        kernel.values_to_go(self._targets, steps or self._steps, cost, V)
        return V

    def paths(self, V: Array, most: int) -> list[ContinuousPath]:
        """Return the paths from the best first vertices of different valleys of the values."""
        first = V[: self._targets.start[1]]
        if not np.isfinite(first).any():
            return []
        steps, W = self._least_sum(first.min()) if self._steps.minimax else (self._steps, V)
        found = (self._follow(p, W, steps) for p in self._valleys(W, most))
        return [path for path in found if path is not None]

    def _least_sum(self, cap: float) -> tuple[Steps, Array]:
        """Return steps by their sum that are dear beyond a cap, and their value function.

        Of all ways with the same maximum, they lead along the one with the least sum.
        """
        steps = self._steps._replace(minimax=False, cap=cap)
        over = np.maximum(self.cost - cap, 0.0)
        cost = self.cost + kernel.OVER_CAP * over
        return steps, self.values(cost, cost[self._targets.start[-2] :], steps)

    def tied_paths(self, most: int, *, closed: bool) -> list[ContinuousPath]:
        """Return paths where what is allowed depends on the first vertex, by growing bounds.

        A path must end where it began, or may not turn a joint too far from there.
        """
        start, q = self._targets.start, self._targets.q
        free = self.values(self.cost, self.open_end())[: start[1]]
        found: list[ContinuousPath] = []
        reach = self._problem.rotation + 1e-9
        for p in np.argsort(free, kind="stable")[:MOST_ENDS]:
            if not free[p] < min((path.value for path in found), default=np.inf):
                break
            near = (np.abs(q - q[p]) <= reach).all(axis=1)
            cost = np.where(near, self.cost, np.inf)
            ends = cost[start[-2] :].copy()
            if closed:
                same = self._origin[start[-2] :] - self._problem.start[-2] == self._origin[p]
                ends[~same] = np.inf
            V = self.values(cost, ends)
            if V[p] < np.inf:
                path = self._follow(int(p), V, self._steps)
                found += [] if path is None else [path]
        return sorted(found, key=lambda path: path.value)[:most]

    def beam(self, cost: Array, V: Array, steps: Steps, width: int, most: int) -> list[ContinuousPath]:
        targets = self._targets
        K = len(targets.start) - 1
        first = V[: targets.start[1]]
        order = np.argsort(first, kind="stable")
        order = order[np.isfinite(first[order])][:width]
        size = (K, width)
        beam = Beam(np.empty(size, np.int64), np.empty(size), np.empty(size, np.int64), np.empty(size), np.zeros(K, np.int64))
        if advance(targets, steps, cost, V, self._problem.aim.acceleration, order, beam) < K:
            return []
        found = []
        for b in np.argsort(beam.cost[-1, :beam.count[-1]])[:most]:
            at, share = np.empty(K, np.int64), np.empty(K)
            value = beam.cost[-1, b]
            for k in range(K - 1, -1, -1):
                at[k], share[k] = beam.at[k, b], beam.share[k, b]
                b = beam.parent[k, b]
            found.append(self._path(at, share, value))
        return found

    def _valleys(self, V: Array, most: int) -> Ints:
        """Return first vertices that none of their neighbours goes below, the best ones first."""
        targets, m = self._targets, int(self._targets.start[1])
        joined = slice(0, int(targets.begin[1]))
        one, other = targets.one[joined], targets.other[joined]
        low = V[:m] < np.inf
        low[one[V[one] > V[other]]] = False
        low[other[V[other] > V[one]]] = False
        every = np.flatnonzero(low)
        return every[np.argsort(V[every], kind="stable")][:most]

    def _follow(self, p: int, V: Array, steps: Steps) -> ContinuousPath | None:
        targets = self._targets
        K = len(targets.start) - 1
        at, share = np.empty(K, np.int64), np.empty(K)
        acceleration = self._problem.aim.acceleration
        if kernel.follow(targets, steps, V, acceleration, p, at, share) < K:
            return None
        return self._path(at, share, float(V[p]))

    def _path(self, at: Ints, share: Array, value: float) -> ContinuousPath:
        targets, p = self._targets, at[0]
        one = np.concatenate([[p], targets.one[at[1:]]])
        other = np.concatenate([[p], targets.other[at[1:]]])
        between = increments_between(targets.q[one], targets.q[other], targets.endless)
        return ContinuousPath(
            one=self._origin[one],
            other=self._origin[other],
            share=share,
            q=targets.q[one] + share[:, None] * between,
            value=value,
        )


def _targets(
    q: Array, start: Ints, endless: Array, samples: GammaSamples, velocity: Array
) -> Targets:
    """Return where steps may lead, sorted by the joint that leaves the fewest."""
    (N, n), K = q.shape, len(start) - 1
    one, other, begin = np.empty(N, np.int64), np.empty(N, np.int64), np.empty(K + 1, np.int64)
    widest = max(WIDEST, WIDEST_STEPS * 2 * np.pi / samples.samples)
    kernel.join_samples(
        q, start, samples.sample, samples.variant, samples.posture, samples.samples, endless,
        widest, one, other, begin,
    )  # fmt: skip
    T = int(begin[-1])
    targets = Targets(q, start, one[:T], other[:T], begin, np.empty(T), np.empty(K), 0, endless)
    pairs = np.zeros(n, np.int64)
    for k in np.unique(np.linspace(1, K - 1, _LAYERS_SAMPLED).astype(int)):
        here = q[start[k - 1] : start[k]]
        here = here[:: len(here) // _VERTICES_SAMPLED + 1]
        a, b = (q[ends[begin[k] : begin[k + 1]]] for ends in (one, other))
        across = increments_between(a, b, endless)
        away = increments_between(here[:, None], (a + across / 2)[None], endless)
        half = np.abs(across).max(axis=0, initial=0.0) / 2
        pairs += (np.abs(away) <= velocity + half).sum(axis=(0, 1))
    targets = targets._replace(joint=int(np.argmin(pairs)))
    kernel.sort_targets(targets)
    return targets
