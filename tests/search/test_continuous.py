"""The search over continuous gamma: its values by dense sampling, and what its paths keep."""

from dataclasses import replace

import numpy as np
import pytest

import naive
from kerfpath import InputError
from kerfpath.kernels import continuous as kernel
from kerfpath.kernels.continuous import Steps, Targets
from kerfpath.limits import Limits
from kerfpath.search import METRIC_CODES, BeamWidth, ContinuousSearch, GammaSamples, SearchProblem
from kerfpath.search.continuous import _targets

METRICS = ["manhattan", "chebychev", "euclid"]
M = 9  # samples on the circle
BEAM = BeamWidth(50, (0.1, 0.25))


def circles(rng, K=5, posts=2, gone=0.15):
    """Joints on closed curves over gamma, one for each node and posture; some samples missing.

    Joint 0 turns once with gamma and is endless, the others swing.
    """
    gamma = 2 * np.pi * np.arange(M) / M
    q, start, sample, posture = [], [0], [], []
    for k in range(K):
        phase = rng.uniform(0, 0.4, (posts, 2)) + 0.2 * k
        for i in range(M):
            for mu in range(posts):
                if rng.random() < gone:
                    continue
                swing = [0.3 * np.sin(gamma[i] + phase[mu, 0]) + 0.2 * mu]
                swing += [0.2 * np.cos(2 * gamma[i] + phase[mu, 1])]
                q.append([gamma[i] + 0.1 * k - np.pi, *swing])
                sample.append(i)
                posture.append(mu)
        start.append(len(q))
    q = np.array(q)
    q[:, 0] -= 2 * np.pi * np.ceil((q[:, 0] - np.pi) / (2 * np.pi))
    samples = GammaSamples(
        sample=np.array(sample),
        variant=np.zeros(len(q), np.int64),
        posture=np.array(posture),
        samples=M,
    )
    return q, np.array(start), samples


ENDLESS = np.array([True, False, False])


def segments(q, samples, a, b, widest):
    """Pairs of neighbouring samples of a layer a..b, straight from the definition."""
    found, alone = [], []
    for v in range(a, b):
        after = [
            w
            for w in range(a, b)
            if samples.sample[w] == (samples.sample[v] + 1) % M
            and samples.posture[w] == samples.posture[v]
            and np.abs(naive.difference(q[v], q[w], ENDLESS)).max() <= widest
        ]
        found += [(v, w) for w in after]
    joined = {v for pair in found for v in pair}
    alone = [(v, v) for v in range(a, b) if v not in joined]
    return found, alone


def by_sampling(q, start, samples, cost, weights, metric, objective, velocity, ends):
    """The value function with t tried at 4001 places of every segment."""
    join = np.add if objective == "sum" else np.maximum
    V = np.full(len(q), np.inf)
    V[start[-2] :] = np.where(ends, cost[start[-2] :], np.inf)
    for k in range(len(start) - 3, -1, -1):
        pairs, alone = segments(q, samples, start[k + 1], start[k + 2], 1.5)
        for p in range(start[k], start[k + 1]):
            best = np.inf
            for v, w in pairs + alone:
                t = np.linspace(0, 1, 4001) if v != w else np.zeros(1)
                d = naive.difference(q[v], q[w], ENDLESS)
                half = naive.difference(q[p], q[v] + d / 2, ENDLESS) - d / 2
                dq = half + t[:, None] * d
                part = np.abs(dq) * weights
                rho = {
                    "manhattan": part.sum(1),
                    "chebychev": part.max(1),
                    "euclid": np.sqrt((part**2).sum(1)),
                }[metric]
                with np.errstate(invalid="ignore"):
                    to_come = V[v] + t * (V[w] - V[v])
                # Between a value and infinity only the end with the value remains.
                to_come = np.where(t == 0, V[v], np.where(t == 1, V[w], to_come))
                to_come = np.where(np.isnan(to_come), np.inf, to_come)
                within = (np.abs(dq) <= velocity + naive.TOLERANCE).all(1)
                best = min(best, np.where(within, join(rho, to_come), np.inf).min())
            V[p] = join(cost[p], best)
    return V


@pytest.mark.slow
@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("metric", METRICS)
def test_the_values_are_those_of_dense_sampling(metric, objective):
    rng = np.random.default_rng(3)
    for trial in range(4):
        q, start, samples = circles(rng)
        cost = rng.uniform(0, 0.3, len(q)) * (rng.random(len(q)) < 0.3)
        cost[rng.random(len(q)) < 0.05] = np.inf
        weights, velocity = rng.uniform(0.5, 2, 3), np.array([0.8, 0.5, 0.5])
        ends = rng.random(start[-1] - start[-2]) < 0.7 if trial % 2 else np.bool_(True)
        targets = _targets(q, start, ENDLESS, samples, velocity)
        steps = Steps(
            weights, METRIC_CODES[metric], objective == "max", np.inf, -velocity, velocity
        )
        V = np.full(len(q), np.inf)
        V[start[-2] :] = np.where(ends, cost[start[-2] :], np.inf)
        kernel.values_to_go(targets, steps, cost, V)
        want = by_sampling(q, start, samples, cost, weights, metric, objective, velocity, ends)
        np.testing.assert_array_equal(np.isfinite(V), np.isfinite(want))
        alive = np.isfinite(want)
        assert alive.any()
        # Sampling misses the least by half a step of t at most, at slopes below 10 by layers; the
        # kernel stops where the bound by tangents is met to 1e-9.
        assert (V[alive] <= want[alive] + 1e-8).all()
        assert (want[alive] - V[alive]).max() < 5 * 10 / 8000


def test_neighbours_are_joined_and_the_rest_stands_alone():
    q, start, samples = circles(np.random.default_rng(4))
    targets = _targets(q, start, ENDLESS, samples, np.full(3, 0.5))
    for k in range(len(start) - 1):
        some = slice(targets.begin[k], targets.begin[k + 1])
        pairs, alone = segments(q, samples, start[k], start[k + 1], 1.5)
        made = sorted(zip(targets.one[some].tolist(), targets.other[some].tolist(), strict=True))
        assert made == sorted(pairs + alone)
        assert (np.diff(targets.key[some]) >= 0).all()
    assert isinstance(targets, Targets)


def problem(q, start, **changes):
    limits = Limits.of(np.array([0.8, 0.5, 0.5]), np.array([0.3, 0.3, 0.3]))
    return SearchProblem(q=q, start=start, dt=1.0, limits=limits, endless=ENDLESS, **changes)


def smooth(K=12):
    """Circles without gaps, that move on evenly."""
    return circles(np.random.default_rng(7), K=K, posts=1, gone=0.0)


@pytest.mark.parametrize("objective", ["sum", "max"])
@pytest.mark.parametrize("metric", METRICS)
def test_paths_keep_the_limits_between_their_points(metric, objective):
    q, start, samples = smooth()
    task = problem(q, start, metric=metric, objective=objective)
    search = ContinuousSearch(task, samples)
    (path,) = search.paths(BEAM)
    layer = np.searchsorted(start, np.stack([path.one, path.other]), side="right") - 1
    np.testing.assert_array_equal(layer, np.tile(np.arange(len(start) - 1), (2, 1)))
    assert ((path.share >= 0) & (path.share <= 1)).all()
    between = naive.difference(q[path.one], q[path.other], ENDLESS)
    np.testing.assert_allclose(path.q, q[path.one] + path.share[:, None] * between, atol=1e-12)
    dq = naive.difference(path.q[:-1], path.q[1:], ENDLESS)
    assert (np.abs(dq) <= task.aim.velocity + 2e-9).all()
    assert (np.abs(np.diff(dq, axis=0)) <= task.aim.acceleration + 3e-9).all()
    steps = np.array([naive.distance(d, task.weights, metric) for d in dq])
    total = steps.sum() if objective == "sum" else steps.max()
    # Nine samples smear the values, which only guide: a path is priced by its own steps. (6) is
    # loose here.
    assert 0 < total < 1.1 * search.value


def test_a_path_never_costs_more_than_the_best_on_its_samples():
    """A vertex is a point between samples, too: what the grid can do, a wide beam finds."""
    q, start, samples = smooth()
    limits = Limits.of(np.array([0.8, 0.5, 0.5]), np.full(3, 9.0))
    task = replace(problem(q, start), limits=limits)
    _, cost = naive.path_planning(
        q, start, dt=1.0, velocity=limits.velocity.bound, acceleration=limits.acceleration.bound,
        endless=ENDLESS, posture=None, vertex_cost=np.zeros(len(q)), weights=task.weights,
        metric="manhattan", objective="sum", method="exact", eta_v=1.0, eta_a=1.0,
    )  # fmt: skip
    (path,) = ContinuousSearch(task, samples).paths(BEAM)
    dq = naive.difference(path.q[:-1], path.q[1:], ENDLESS)
    assert (np.abs(dq) * task.weights).sum() < cost


def test_a_periodic_path_ends_beside_where_it_begins():
    q, start, samples = smooth()
    first = q[start[0] : start[1]]
    q[start[-2] :] = first  # the last layer repeats the first
    search = ContinuousSearch(problem(q, start, closure="periodic"), samples)
    paths = list(search.paths(BEAM._replace(ways=3)))
    assert paths
    for path in paths:
        began, ended = samples.sample[path.one[0]], samples.sample[path.one[-1]]
        off = (ended + path.share[-1] - began + M / 2) % M - M / 2
        assert abs(off) <= 1 + 1e-9
    assert search.value >= ContinuousSearch(problem(q, start), samples).value * (1 - 1e-12)


def test_a_joint_turns_no_further_than_it_may():
    q, start, samples = smooth(K=16)
    free = ContinuousSearch(problem(q, start), samples)
    (path,) = free.paths(BEAM)
    dq = naive.difference(path.q[:-1], path.q[1:], ENDLESS)
    turned = np.abs(np.cumsum(dq[:, 0])).max()
    held = ContinuousSearch(problem(q, start, rotation=[0.5 * turned, np.inf, np.inf]), samples)
    for path in held.paths(BEAM._replace(ways=3)):
        assert np.abs(path.q[:, 0] - path.q[0, 0]).max() <= 0.5 * turned + 1e-6
    assert held.value >= free.value * (1 - 1e-12)


def test_where_nothing_leads_on_there_is_no_path():
    q, start, samples = smooth()
    q = q.copy()
    q[start[5] : start[6], 1] += 10.0  # out of reach of all before and after
    search = ContinuousSearch(problem(q, start), samples)
    assert search.value == np.inf
    assert list(search.paths(BEAM)) == []
    closed = np.where(np.arange(len(q)) < start[1], np.inf, 0.0)
    assert (
        list(ContinuousSearch(problem(*smooth()[:2], vertex_cost=closed), samples).paths(BEAM))
        == []
    )


def test_shut_edges_are_refused():
    q, start, samples = smooth()
    with pytest.raises(InputError, match="closed vertices only"):
        ContinuousSearch(problem(q, start, shut=[[0, int(start[1])]]), samples)
