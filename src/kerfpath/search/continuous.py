"""Search over continuous gamma: a first-order value function, and paths guided by it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import continuous as kernel
from kerfpath.kernels.beam import Alike, Beam, advance
from kerfpath.kernels.continuous import Steps, Targets
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import increments_between
from kerfpath.progress import may_stop
from kerfpath.search.problem import SearchProblem, example_problem, unroll

WIDEST, WIDEST_STEPS, WIDEST_OF_ALL = 0.5, 6.0, 1.5
"""rad, steps of gamma, and rad: neighbouring samples are joined if no joint moves further between
them than the larger of the first two, and than the last one."""
MOST_ENDS = 12
"""Most first vertices that are tried one by one, if the constraints depend on the first vertex."""
SAME_COST, MOST_TURNS = 1e-9, 16
"""Relative difference of paths that count as equally costly, and most of them that are compared."""
APART = 0.15
"""rad: some joint of two first vertices that are both tried differs by more; the refinement can
move a path by less."""
_LAYERS_SAMPLED, _VERTICES_SAMPLED = 12, 16
"""Layers, and vertices of each, that are sampled to choose the joint that sorts the targets."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GammaSamples:
    """Positions of the vertices of a problem on circles of gamma.

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
        """Return the positions of other vertices (M,), given as indices of these."""
        return replace(
            self,
            sample=self.sample[vertices],
            variant=self.variant[vertices],
            posture=self.posture[vertices],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContinuousPath:
    """One point of each layer, at a vertex or between the vertices of two neighbouring samples.

    Parameters
    ----------
    one, other : (K,) int
        Rows of q between which each point lies; equal if it is at a vertex.
    share : (K,)
        Position between them, from 0 to 1.
    q : (K, n) rad
        Joints, interpolated.
    """

    one: Ints
    other: Ints
    share: Array
    q: Array

    __repr__ = short_repr


class BeamWidth(NamedTuple):
    """Width of a beam search."""

    width: int
    """States that are kept in each layer."""
    alike: tuple[float, float]
    """States count as alike up to these distances: in shares of a target, and of the change of an
    increment that (6) allows."""
    ways: int = 1
    """Ways that are followed, if the constraints depend on the first vertex."""


class _Way(NamedTuple):
    """Value function and costs that guide paths from some first vertices."""

    value: float
    first: Ints
    steps: Steps
    cost: Array
    V: Array


class ContinuousSearch:
    """Paths over continuous gamma of a problem, guided by its value function.

    Each path keeps (5) between the points of its layers, the rotation limits of the problem, and
    (6) where the search finds a way to. With a periodic closure it ends less than a sample from
    where it begins. Joints between two samples are interpolated.

    Parameters
    ----------
    problem : SearchProblem
        A problem without shut edges.
    samples : GammaSamples
        Positions of its vertices on circles of gamma.

    Raises
    ------
    InputError
        The problem has shut edges.
    """

    def __init__(self, problem: SearchProblem, samples: GammaSamples) -> None:
        if len(problem.shut):
            raise InputError(
                "shut: expected no shut edges, because the search over continuous gamma supports "
                f"closed vertices only, got {len(problem.shut)}"
            )
        layers, self._origin = problem.layers, np.arange(len(problem.q))
        velocity, limited = problem.aim.velocity, np.isfinite(problem.rotation)
        if limited.any():
            layers, place = unroll(
                layers, problem.rotation, problem.limits.velocity.per_interval(problem.dt)
            )
            self._origin = place + np.repeat(problem.start[:-1], np.diff(layers.start))
            samples = samples.of(self._origin)
            velocity = np.where(limited, np.minimum(velocity, np.pi), velocity)
        self._problem, self._cost = problem, np.ascontiguousarray(layers.cost)
        self._steps = Steps(
            problem.aim.weight, problem.aim.metric, problem.aim.minimax, np.inf,
            -velocity, np.array(velocity),
        )  # fmt: skip
        self._targets = _targets(
            np.ascontiguousarray(layers.q), layers.start, layers.endless, samples, velocity
        )
        closed = problem.closure == "periodic"
        tied = closed or limited.any()
        self._ways = self._tied_ways(closed=closed) if tied else self._one_way()

    @property
    def value(self) -> float:
        """Cost of the best path under (5) alone by the value function; infinite if there is none.

        It is interpolated and no bound.
        """
        return min((way.value for way in self._ways), default=np.inf)

    def paths(self, beam: BeamWidth) -> Iterator[ContinuousPath]:
        """Yield the best paths found with a beam; there may be none."""
        for way in self._ways[: beam.ways]:
            path = self._beam(way, beam)
            if path is not None:
                yield path

    def _path(self, one: Ints, other: Ints, share: Array) -> ContinuousPath:
        targets = self._targets
        between = increments_between(targets.q[one], targets.q[other], targets.endless)
        return ContinuousPath(
            one=self._origin[one],
            other=self._origin[other],
            share=share,
            q=targets.q[one] + share[:, None] * between,
        )

    def _values(self, steps: Steps, cost: Array, last: Bools | None = None) -> Array:
        """Return the value function (N,) for vertex costs (N,) and allowed last vertices (m,)."""
        may_stop()
        return values_to(self._targets, steps, cost, last)

    def _one_way(self) -> list[_Way]:
        """Return the way from any first vertex to any last one, or an empty list."""
        way = self._way(np.arange(self._targets.start[1]), self._cost)
        return [] if way is None else [way]

    def _way(self, first: Ints, cost: Array, last: Bools | None = None) -> _Way | None:
        """Return the way from some first vertices; None if (5) leaves no path.

        Of paths with the same maximum it prefers the least sum: distances and costs beyond the
        least maximum get a high price.
        """
        V, steps = self._values(self._steps, cost, last), self._steps
        best = float(V[first].min())
        if best == np.inf:
            return None
        if steps.minimax:
            steps = steps._replace(minimax=False, cap=best)
            cost = cost + kernel.OVER_CAP * np.maximum(cost - best, 0.0)
            V = self._values(steps, cost, last)
        return _Way(best, self._by_valleys(first, V), steps, cost, V)

    def _by_valleys(self, first: Ints, V: Array) -> Ints:
        """Return first vertices that have a path, those at local minima of the value first."""
        begin = self._targets.begin[:2]
        bottom = are_bottoms(self._targets._replace(begin=begin), V)
        first = first[V[first] < np.inf]
        return first[np.lexsort((V[first], ~bottom[first]))]

    def _tied_ways(self, *, closed: bool) -> list[_Way]:
        """Return the ways if the constraints depend on the first vertex, the best ones first.

        A path must end where it began, or a joint may turn only so far from there. There is one way
        for each first vertex that may give a better path than all before.
        """
        start, q = self._targets.start, self._targets.q
        free = self._values(self._steps, self._cost)[: start[1]]
        reach = self._problem.rotation + LIMIT_TOLERANCE
        ways: list[_Way] = []
        tried: list[int] = []
        for p in np.argsort(free, kind="stable"):
            if not free[p] < min((way.value for way in ways), default=np.inf):
                break
            away = increments_between(q[tried], q[p], self._targets.endless)
            if (np.abs(away).max(axis=1) < APART).any():
                continue
            if len(tried) == MOST_ENDS:
                break
            tried.append(int(p))
            cost = np.where((np.abs(q - q[p]) <= reach).all(axis=1), self._cost, np.inf)
            way = self._way(np.array([p]), cost, self._near_end(p) if closed else None)
            ways += [] if way is None else [way]
        return sorted(ways, key=lambda way: way.value)

    def _near_end(self, p: int) -> Bools:
        """Return which vertices of the last layer (m,) repeat vertex `p` or its neighbours."""
        targets = self._targets
        joined = slice(int(targets.begin[0]), int(targets.begin[1]))
        one, other = targets.one[joined], targets.other[joined]
        beside = np.concatenate([[p], other[one == p], one[other == p]])
        place = self._origin[targets.start[-2] :] - self._problem.start[-2]
        return np.isin(place, self._origin[beside])

    def _beam(self, way: _Way, wide: BeamWidth) -> ContinuousPath | None:
        """Return the best path of a beam search along a way; None if it does not reach the end."""
        may_stop()
        targets = self._targets
        first = way.first[: wide.width]
        K = len(targets.start) - 1
        size = K, wide.width
        beam = Beam(
            np.empty(size, np.int64), np.empty(size), np.empty(size, np.int64), np.empty(size),
            np.zeros(K, np.int64),
        )  # fmt: skip
        change, table = self._problem.aim.acceleration, self._problem.aim.table
        alike = Alike(*wide.alike)
        if advance(targets, way.steps, way.cost, way.V, change, table, first, alike, beam) < K:
            return None
        cost = beam.cost[-1, : beam.size[-1]]
        ends = np.flatnonzero(cost <= cost.min() + SAME_COST * abs(cost.min()))
        # Paths on other turns cost the same: take the one whose joints stay closest to zero.
        ways = [self._traced(beam, int(b)) for b in ends[np.argsort(cost[ends])][:MOST_TURNS]]
        return min(ways, key=lambda path: float(np.abs(path.q).max()))

    def _traced(self, beam: Beam, b: int) -> ContinuousPath:
        """Return the path that ends in state b of a beam."""
        targets, K = self._targets, len(beam.at)
        at, share = np.empty(K, np.int64), np.empty(K)
        for k in range(K - 1, -1, -1):
            at[k], share[k], b = beam.at[k, b], beam.share[k, b], beam.parent[k, b]
        one = np.concatenate([at[:1], targets.one[at[1:]]])
        other = np.concatenate([at[:1], targets.other[at[1:]]])
        return self._path(one, other, share)


def values_to(targets: Targets, steps: Steps, cost: Array, last: Bools | None = None) -> Array:
    """Return the value function (N,) for vertex costs (N,) and allowed last vertices (m,)."""
    a, V = targets.start[-2], np.full(len(cost), np.inf)
    V[a:] = cost[a:] if last is None else np.where(last, cost[a:], np.inf)
    kernel.values_to_go(targets, steps, cost, V)
    return V


def are_bottoms(targets: Targets, values: Array) -> Bools:
    """Return which vertices (N,) have no neighbour in gamma with a lower value."""
    joined = slice(int(targets.begin[0]), int(targets.begin[-1]))
    one, other = targets.one[joined], targets.other[joined]
    bottom = np.ones(len(values), np.bool_)
    bottom[one[values[one] > values[other]]] = False
    bottom[other[values[other] > values[one]]] = False
    return bottom


def _targets(
    q: Array, start: Ints, endless: Bools, samples: GammaSamples, velocity: Array
) -> Targets:
    """Return the targets of steps between neighbouring samples of gamma."""
    N, K = len(q), len(start) - 1
    one, other, begin = np.empty(N, np.int64), np.empty(N, np.int64), np.empty(K + 1, np.int64)
    widest = max(WIDEST, WIDEST_STEPS * 2 * np.pi / samples.samples)
    widest = min(widest, WIDEST_OF_ALL)
    kernel.join_samples(
        q, start, samples.sample, samples.variant, samples.posture, samples.samples, endless,
        widest, one, other, begin,
    )  # fmt: skip
    T = int(begin[-1])
    return targets_of(q, start, one[:T], other[:T], begin, endless, velocity)


def targets_of(
    q: Array, start: Ints, one: Ints, other: Ints, begin: Ints, endless: Bools, velocity: Array
) -> Targets:
    """Return targets, given by their ends, sorted by the joint that leaves the fewest within (5).

    Parameters
    ----------
    q, start, one, other, begin, endless
        As in `Targets`.
    velocity : (n,) rad
        Largest increment by (5).
    """
    K, n, T = len(start) - 1, q.shape[1], len(one)
    targets = Targets(q, start, one, other, begin, np.empty(T), np.empty(K), 0, endless)
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
    kernel.fill_keys(targets)
    layer = np.repeat(np.arange(K), np.diff(begin))
    order = np.lexsort((targets.key, layer))
    return targets._replace(
        key=targets.key[order], one=targets.one[order], other=targets.other[order]
    )


# -----------------------------------------------------------------------------
# Compile the kernels of the search over continuous gamma by a small search.


def compile_search() -> None:
    """Compile the kernels of `ContinuousSearch` by a search of three nodes with 4 samples each."""
    problem = example_problem()
    samples = int(problem.start[1])
    sample = np.tile(np.arange(samples), len(problem.start) - 1)
    on_grid = GammaSamples(
        sample=sample,
        variant=np.zeros_like(sample),
        posture=np.zeros_like(sample),
        samples=samples,
    )
    for _ in ContinuousSearch(problem, on_grid).paths(BeamWidth(4, (0.1, 0.1))):
        pass
