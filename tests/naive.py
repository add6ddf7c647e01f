"""Slow and obvious versions of what the kernels do, written from the paper alone."""

import itertools

import numpy as np

TOLERANCE = 1e-9


def difference(a, b, endless):
    """Joint increment from a to b, the short way round for endless joints (13)."""
    d = b - a
    return np.where(endless, d - 2 * np.pi * np.round(d / (2 * np.pi)), d)


def distance(d, weights, metric):
    part = np.abs(d) * weights
    return {"manhattan": part.sum(), "chebychev": part.max(), "euclid": np.sqrt((part**2).sum())}[
        metric
    ]


def path_planning(
    q, start, *, dt, velocity, acceleration, endless, posture, vertex_cost, weights, metric,
    objective, method, eta_v, eta_a, passable=None,
):  # fmt: skip
    """The procedure of section 3.2, line by line; returns (index, cost) or None."""
    layers = [list(range(start[k], start[k + 1])) for k in range(len(start) - 1)]
    join = (lambda a, b: a + b) if objective == "sum" else max
    known = method == "known"
    bound_v = eta_v * velocity * dt + TOLERANCE
    bound_a = eta_a * acceleration * dt**2 + TOLERANCE
    M_dist = {j: vertex_cost[j] for j in layers[0]}
    M_ind = {}
    for k in range(1, len(layers)):
        for j in layers[k]:
            d_min, j_opt = np.inf, None
            for p in layers[k - 1]:
                if M_dist[p] == np.inf:
                    continue
                dq = difference(q[p], q[j], endless)
                d_cur = join(M_dist[p], distance(dq, weights, metric))
                if passable is not None and not passable[k - 1][p - start[k - 1], j - start[k]]:
                    d_cur = np.inf
                if known:
                    if posture[p] != posture[j]:
                        d_cur = np.inf
                else:
                    if (np.abs(dq) > bound_v).any():
                        d_cur = np.inf
                    if k > 1:
                        before = difference(q[M_ind[p]], q[p], endless)
                        if (np.abs(dq - before) > bound_a).any():
                            d_cur = np.inf
                if d_cur < d_min:
                    d_min, j_opt = d_cur, p
            M_dist[j] = join(d_min, vertex_cost[j])
            M_ind[j] = j_opt
    if not layers[-1] or min(M_dist[j] for j in layers[-1]) == np.inf:
        return None
    j = min(layers[-1], key=lambda j: (M_dist[j], j))
    cost, path = M_dist[j], []
    for k in range(len(layers) - 1, -1, -1):
        path.append(j - start[k])
        j = M_ind.get(j)
    return np.array(path[::-1]), cost


def second_order(q, start, closure, passable=None, kept=None, **o):
    """Optimal (cost, tie-breaking sum) under (5) and (6), or None: every pair of edges is tried.

    passable, one matrix for each pair of layers, leaves out edges that are closed; kept(q, before,
    after), each (B, n), says which pairs of increments may follow each other at joints q.
    """
    layers = [q[a:b] for a, b in itertools.pairwise(start)]
    vertex = [o["vertex_cost"][a:b] for a, b in itertools.pairwise(start)]
    if len(layers) == 1:
        return (vertex[0].min(), vertex[0].min()) if len(vertex[0]) else None
    D, bound_a, steps = _edges(layers, vertex, o, passable)

    def may_follow(middle, before, after):
        """Of increments (l, p, n) to vertices (p, n) and (p, j, n) from them: (l, p, j)."""
        ok = (np.abs(after[None] - before[:, :, None]) <= bound_a).all(-1)
        if kept is not None:
            i, p, j = np.nonzero(ok)
            ok[i, p, j] = kept(middle[p], before[i, p], after[p, j])
        return ok

    follows = [None, *(may_follow(layers[k], D[k - 1], D[k]) for k in range(1, len(D)))]

    def best(objective, cap):
        join = np.add if objective == "sum" else np.maximum
        enter, step = steps(join, cap)

        def run(first):
            d = first
            for k in range(1, len(D)):
                ok = follows[k]
                d = join(np.where(ok, d[:, :, None], np.inf).min(axis=0, initial=np.inf), step[k])
            return d

        first = join(enter, step[0])
        if closure == "free":
            return run(first).min(initial=np.inf)
        least = np.inf
        for i, j in zip(*np.nonzero(np.isfinite(first)), strict=True):
            only = np.full_like(first, np.inf)
            only[i, j] = first[i, j]
            last, seen = D[-1][:, i : i + 1], D[0][i, j][None, None]
            seam = may_follow(layers[0][i : i + 1], last, seen)[:, 0, 0]
            least = min(least, run(only)[seam, i].min(initial=np.inf))
        return least

    cost = best(o["objective"], np.inf)
    if cost == np.inf:
        return None
    return cost, best("sum", np.inf if o["objective"] == "sum" else cost * (1 + 1e-12))


def interrupted(q, start, passable=None, s=None, least_piece=0.0, **o):
    """Fewest interruptions, and of plans with that many the optimal (cost, tie-breaking sum)."""
    layers = [q[a:b] for a, b in itertools.pairwise(start)]
    vertex = [o["vertex_cost"][a:b] for a, b in itertools.pairwise(start)]
    s = np.arange(len(layers)) if s is None else s
    if len(layers) == 1:
        return (0, vertex[0].min(), vertex[0].min()) if len(vertex[0]) else None
    D, bound_a, steps = _edges(layers, vertex, o, passable)

    def best(objective, cap):
        """By the number of interruptions: the least cost."""
        join = np.add if objective == "sum" else np.maximum
        enter, step = steps(join, cap)
        # d[i, a][p, j]: least cost with i interruptions, the last at node a, and last edge p, j.
        d = {(0, 0): join(enter, step[0])}
        for k in range(1, len(D)):
            ok = (np.abs(D[k][None] - D[k - 1][:, :, None]) <= bound_a).all(-1)
            there = np.where(vertex[k] <= cap, vertex[k], np.inf)[:, None]
            on = {
                key: join(np.where(ok, e[:, :, None], np.inf).min(axis=0, initial=np.inf), step[k])
                for key, e in d.items()
            }
            for (i, a), e in d.items():
                if s[k] - s[a] >= least_piece:
                    anew = join(join(e.min(initial=np.inf), there), step[k])
                    on[i + 1, k] = np.minimum(on.get((i + 1, k), np.inf), anew)
            d = on
        cost = np.full(len(layers), np.inf)
        for (i, a), e in d.items():
            if i == 0 or s[-1] - s[a] >= least_piece:
                cost[i] = min(cost[i], e.min(initial=np.inf))
        return cost

    cost = best(o["objective"], np.inf)
    if not np.isfinite(cost).any():
        return None
    fewest = int(np.argmax(np.isfinite(cost)))
    cap = np.inf if o["objective"] == "sum" else cost[fewest] * (1 + 1e-12)
    return fewest, cost[fewest], best("sum", cap)[fewest]


def rotated(q, start, closure, rotation, passable=None, **o):
    """Optimal (cost, tie-breaking sum) that keeps `rotation` too, or None: every path is tried."""
    ranges = [np.arange(a, b) for a, b in itertools.pairwise(start)]
    paths = np.array(list(itertools.product(*ranges)), dtype=int).reshape(-1, len(ranges))
    if closure == "periodic":
        paths = paths[paths[:, 0] == paths[:, -1] - start[-2]]
    d = difference(q[paths[:, :-1]], q[paths[:, 1:]], o["endless"])
    changes = np.diff(d, axis=1)
    if closure == "periodic":
        changes = np.concatenate([changes, d[:, :1] - d[:, -1:]], axis=1)
    ok = (np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + TOLERANCE).all((1, 2))
    ok &= (np.abs(changes) <= o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + TOLERANCE).all((1, 2))
    ok &= (np.abs(np.cumsum(d, axis=1)) <= rotation + TOLERANCE).all((1, 2))
    ok &= np.isfinite(o["vertex_cost"][paths]).all(axis=1)
    for k, there in enumerate(passable or []):
        ok &= there[paths[:, k] - start[k], paths[:, k + 1] - start[k + 1]]
    if not ok.any():
        return None
    parts = np.hstack([_distances(d, o["weights"], o["metric"]), o["vertex_cost"][paths]])[ok]
    total, largest = parts.sum(axis=1), parts.max(axis=1)
    if o["objective"] == "sum":
        return total.min(), total.min()
    return largest.min(), total[largest <= largest.min() * (1 + 1e-12)].min()


def _edges(layers, vertex, o, passable=None):
    """Increments of all edges, the bound of (6), and what it costs to enter and to step."""
    D = [difference(a[:, None], b[None], o["endless"]) for a, b in itertools.pairwise(layers)]
    slow = [(np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + TOLERANCE).all(-1) for d in D]
    if passable is not None:
        slow = [s & ok for s, ok in zip(slow, passable, strict=True)]
    bound_a = o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + TOLERANCE
    R = [_distances(d, o["weights"], o["metric"]) for d in D]

    def steps(join, cap):
        step = [
            np.where(s & (r <= cap), join(r, v[None]), np.inf)
            for s, r, v in zip(slow, R, vertex[1:], strict=True)
        ]
        step = [np.where(v[None] <= cap, s, np.inf) for s, v in zip(step, vertex[1:], strict=True)]
        return np.where(vertex[0] <= cap, vertex[0], np.inf)[:, None], step

    return D, bound_a, steps


def _distances(d, weights, metric):
    part = np.abs(d) * weights
    if metric == "euclid":
        return np.sqrt((part**2).sum(-1))
    return part.sum(-1) if metric == "manhattan" else part.max(-1)


def random_instance(rng, *, layers=(1, 9), size=(1, 9)):
    """A ragged graph whose limits bind: set from quantiles of its own increments."""
    n, K = int(rng.integers(1, 7)), int(rng.integers(*layers))
    sizes = rng.integers(*size, K)
    drift = rng.normal(0, 0.15, (K, n)).cumsum(axis=0)
    q = np.concatenate([drift[k] + rng.normal(0, 0.5, (s, n)) for k, s in enumerate(sizes)])
    endless = rng.random(n) < 0.4
    q = np.where(endless, q + 2 * np.pi * rng.integers(-1, 2, q.shape), q)
    start = np.concatenate([[0], np.cumsum(sizes)])
    dt = float(rng.uniform(0.01, 0.1))
    pairs = rng.integers(0, len(q), (200, 2))
    step = np.abs([difference(q[a], q[b], endless) for a, b in pairs]) + 1e-3
    # One joint in four, also one that is endless, gets a limit that never binds.
    loose = np.where(rng.random(n) < 0.25, 100.0, 1.0)
    options = {
        "dt": dt,
        "velocity": loose * np.quantile(step, rng.uniform(0.6, 1), axis=0) / dt,
        "acceleration": np.quantile(step, rng.uniform(0.4, 1), axis=0) * 1.5 / dt**2,
        "endless": endless,
        "posture": rng.integers(0, 3, len(q)),
        "vertex_cost": rng.choice([0.0, 1.0]) * rng.random(len(q)),
        "weights": rng.uniform(0.2, 3, n),
        "metric": str(rng.choice(["manhattan", "chebychev", "euclid"])),
        "objective": str(rng.choice(["sum", "max"])),
        "method": str(rng.choice(["paper", "paper", "known"])),
        "eta_v": float(rng.uniform(0.5, 1.2)),
        "eta_a": float(rng.uniform(0.5, 1.2)),
    }
    return q, start, options


def lattice_instance(rng, *, layers=(2, 6), size=(1, 5)):
    """A graph on a lattice of angles, so that endless joints take many steps of half a turn."""
    q, start, options = random_instance(rng, layers=layers, size=size)
    step = np.pi / rng.integers(1, 5)
    endless = rng.random(q.shape[1]) < 0.7
    options |= {
        "endless": endless,
        "velocity": rng.uniform(1, 2, q.shape[1]) * np.pi / options["dt"] / options["eta_v"],
        "acceleration": rng.integers(0, 9, q.shape[1]) * np.pi / 4 + 1e-3,
    }
    options["acceleration"] /= options["eta_a"] * options["dt"] ** 2
    return step * rng.integers(-6, 7, q.shape), start, options


def slowed(q, start, *, dt, velocity, acceleration, endless, vertex_cost, weights, metric, penalty,
           eta_v, eta_a, passable=None):  # fmt: skip
    """Least cost when time lost has a price: every pair of edges is tried; infinity: no path."""
    layers = [q[a:b] for a, b in itertools.pairwise(start)]
    vertex = [vertex_cost[a:b] for a, b in itertools.pairwise(start)]
    if len(layers) == 1:
        return vertex[0].min()
    D = [difference(a[:, None], b[None], endless) for a, b in itertools.pairwise(layers)]
    alone = [(np.abs(d) / (eta_v * velocity * dt)).max(-1) for d in D]
    R = [_distances(d, weights, metric) + v for d, v in zip(D, vertex[1:], strict=True)]
    if passable is not None:
        R = [np.where(ok, r, np.inf) for ok, r in zip(passable, R, strict=True)]
    d = vertex[0][:, None] + R[0] + penalty * np.maximum(0, alone[0] - 1)
    for k in range(1, len(D)):
        change = np.abs(D[k][None] - D[k - 1][:, :, None])
        asked = np.sqrt((change / (eta_a * acceleration * dt**2)).max(-1))
        lost = np.maximum(0, np.maximum(asked, alone[k][None]) - 1)
        d = (d[:, :, None] + R[k][None] + penalty * lost).min(axis=0)
    return d.min()


def quickest(q, start, *, velocity, acceleration, endless, eta_v, eta_a, vertex_cost, passable):
    """Least node interval by every pair of edges, infinity if there is no path."""
    layers = [q[a:b] for a, b in itertools.pairwise(start)]
    vertex = [vertex_cost[a:b] for a, b in itertools.pairwise(start)]
    D = [difference(a[:, None], b[None], endless) for a, b in itertools.pairwise(layers)]
    step = [
        (np.abs(d) / (eta_v * velocity)).max(-1) + v for d, v in zip(D, vertex[1:], strict=True)
    ]
    step = [np.where(ok, s, np.inf) for ok, s in zip(passable, step, strict=True)]
    d = vertex[0][:, None] + step[0]
    for k in range(1, len(D)):
        change = np.abs(D[k][None] - D[k - 1][:, :, None])
        sharp = np.sqrt((change / (eta_a * acceleration)).max(-1))
        d = np.maximum(np.maximum(d[:, :, None], sharp).min(axis=0, initial=np.inf), step[k])
    return d.min(initial=np.inf)


def random_closures(rng, start, share, closure="free"):
    """Vertex costs (N,) of 0 or infinity, shut edges (E, 2), and these as passable matrices."""
    closed = np.where(rng.random(start[-1]) < share * rng.random(), np.inf, 0.0)
    if closure == "periodic":
        closed[start[-2] :] = closed[: start[1]]
    sizes = np.diff(start)
    there = share * rng.random()
    passable = [rng.random(shape) >= there for shape in itertools.pairwise(sizes)]
    edges = [np.argwhere(~ok) + start[k : k + 2] for k, ok in enumerate(passable)]
    return closed, np.concatenate([np.empty((0, 2), int), *edges]), passable
