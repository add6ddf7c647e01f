"""Prove the bound of a certificate again, with the audit's own enclosures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor.acceleration import most_accelerations
from kerfpath.auditor.cover import (
    DEEPEST_CELL,
    HALF_TURN,
    TURN,
    Places,
    Reachable,
    covered,
    one_interval,
)
from kerfpath.auditor.enclosure import POSTURES, linear_minimum
from kerfpath.auditor.jets import UNIT
from kerfpath.auditor.steps import (
    Rates,
    candidates,
    least_step,
    least_value,
    linked,
    reduced_costs,
    steps_on,
)
from kerfpath.auditor.table import Check
from kerfpath.certificate import BASE, Branch, Certificate, Stage
from kerfpath.errors import CertificateRefused, InputError
from kerfpath.plans import Plan

BOUND = "bound"
"""Code of the check of a bound."""
LIMIT_TOLERANCE = 1e-9
"""rad: by how much a motion may exceed (5) and (6)."""
EVEN = 1e-6
"""Largest relative difference between the intervals of a plan at constant speed."""
MOST_HELD = 16_000_000
"""Number of steps whose costs are kept, 16 bytes each; other costs are computed twice."""
Costs = tuple[NDArray[np.int32], NDArray[np.int32], Array]
MOST_BRANCHES = 400
"""Most branches of a certificate."""
SURE = 1e-9
"""rad: by how much the other way round is at least too far."""
LARGEST = 1e12
"""Largest value or slope of a potential."""
COST_ROUNDING = 1e-9
"""Relative rounding error of a cost, a bound and the gap between them."""


def bound_checks(plan: Plan) -> list[Check]:
    """Return the checks of the bound that a plan states, if it has a certificate."""
    proof = plan.proof
    if proof.certificate is None:
        return []
    title = "certificate that does not hold"
    try:
        if proof.bound is None:
            raise CertificateRefused("the plan states no bound")
        proved = certified_bound(proof.certificate, plan)
    except CertificateRefused as error:
        return [_row(f"{title}: {error.why}", 1.0, 0.0)]
    except InputError as error:  # there are no enclosures of such a robot
        return [_row(f"{title}: {error}", 1.0, 0.0)]
    size = max(abs(plan.cost), abs(proof.bound))
    claims = (
        ("bound above what its certificate proves", proof.bound, proved),
        ("bound of the certificate above what it proves", proof.certificate.bound, proved),
        ("bound above the cost of the plan", proof.bound, plan.cost * (1 + COST_ROUNDING)),
    )
    rows = [_row(words, claim, true) for words, claim, true in claims]
    gap = (plan.cost - proof.bound) / plan.cost if plan.cost else 0.0
    most = COST_ROUNDING * max(1.0, size / abs(plan.cost or 1))
    if proof.gap is None or not abs(proof.gap - gap) <= most:
        rows.append(_row("gap that does not match cost and bound", 1.0, 0.0))
    # Only the worst row is returned; NaN counts as broken.
    broken = [row for row in rows if not row.ok]
    return [max(broken or rows, key=lambda row: row.value - row.limit)]


def _row(title: str, value: float, limit: float) -> Check:
    return Check(
        code=BOUND,
        title=title,
        value=float(value),
        limit=float(limit),
        unit="count",
        node=0,
        advice="plan again",
    )


def certified_bound(certificate: Certificate, plan: Plan) -> float:
    """Return the lower bound that a certificate proves for motions along a plan's contour.

    The bound holds for every motion that keeps (5), (6), the joint ranges and the couplings at the
    nodes, at any gamma, in any allowed posture and on any turn. It is never larger than the plan's
    cost.

    Parameters
    ----------
    certificate : Certificate
        Only its cells, potentials, multipliers and branches are used.
    plan : Plan

    Raises
    ------
    InputError
        The certificate does not fit the plan or does not cover all motions, or certificates do not
        apply to such a plan.
    """
    if not certificate.stages:
        raise CertificateRefused("it has no stage")
    task = _Task(*certificate_inputs(plan), plan)
    _require_branches(certificate.branches, *plan.q.shape)
    proved, left = _by_stages(task, certificate.stages, None)
    if certificate.branches and proved < plan.cost:
        assert left is not None, "there is a stage"
        under, _ = _by_branch(task, certificate.branches, 0, left, proved)
        proved = max(proved, under)
    return min(proved, plan.cost)


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """Where the motions of a plan's task may be, the bounds of their steps, and the plan."""

    where: Reachable
    every: Rates
    plan: Plan

    __repr__ = short_repr

    def prices(self, multipliers: Array | None, at: Places) -> Array:
        """Return the most (C,) that multipliers (K, n) of (6) add to the cost at places."""
        if multipliers is None:
            return np.zeros(len(at))
        return np.asarray((np.abs(multipliers)[at.node] * _changes(self.plan, at)).sum(axis=1))


def _by_stages(
    task: _Task, stages: Sequence[Stage], left: Places | None
) -> tuple[float, Places | None]:
    """Return the bound that stages prove for motions through places, and the places they leave."""
    proved, cost = -np.inf, task.plan.cost
    for stage in stages:
        _require_fit(stage, *task.plan.q.shape)
        rates = _rates(stage, task.every)
        at = covered(task.where, stage, left, partial(linked, rates))
        bounds = _through(rates, at, stage, task.prices(stage.multipliers, at))
        proved = max(proved, _over_layers(rates.nodes, at.node, bounds))
        if proved >= cost:
            break
        left = at.take(bounds <= cost)
    return proved, left


def _over_layers(nodes: Ints, node: Ints, bounds: Array) -> float:
    """Return the bound on a motion, which passes a place of each node, from bounds (C,)."""
    least = np.full(len(nodes), np.inf)
    np.minimum.at(least, np.searchsorted(nodes, node), bounds)
    return float(least.max())


def _by_branch(
    task: _Task, branches: Sequence[Branch], number: int, left: Places, known: float
) -> tuple[float, int]:
    """Return the bound that a branch proves for motions through places, at least `known`.

    Also return the number of the branch after it and its own branches.
    """
    branch, cost, after = branches[number], task.plan.cost, number + 1
    by_stages, rest = _by_stages(task, branch.stages, left)
    assert rest is not None, "there were places"
    known, left = max(known, by_stages), rest
    if known < cost and branch.y is not None and branch.multipliers is not None:
        known = max(known, _in_tube(task, left, branch.y, branch.multipliers))
    if branch.node < 0:
        return known, after
    here = left.node == branch.node
    if not here.any():
        raise CertificateRefused(f"branches: no cell at node {branch.node}, where one is divided")
    if branch.posture >= 0:
        first = left.posture == branch.posture
    else:
        off = left.middle - branch.gamma
        first = off - TURN * np.round(off / TURN) <= 0
    bounds = []
    for side in (first, ~first):
        # A side that is known to be dear has branches that need no proof.
        some = left.take(~here | side)
        under, after = (
            _by_branch(task, branches, after, some, known)
            if known < cost and (here & side).any()
            else (np.inf, _after(branches, after))
        )
        bounds.append(under)
    return max(known, min(bounds)), after


def _require_branches(branches: Sequence[Branch], K: int, n: int) -> None:
    """Raise CertificateRefused unless branches fit K nodes and n joints, and each other."""
    if not branches:
        return
    if len(branches) > MOST_BRANCHES:
        raise CertificateRefused(f"branches: expected up to {MOST_BRANCHES}, got {len(branches)}")
    if _after(branches, 0) != len(branches):
        raise CertificateRefused("branches: expected two for each that is divided, got more")
    for branch in branches:
        if not branch.node < K:
            raise CertificateRefused(f"branches: expected nodes below {K}, got {branch.node}")
        if branch.multipliers is not None:
            _tilt(branch.multipliers, K, n)
        y = branch.y
        if y is None:
            continue
        if y.shape != (K - 1, n) or y.dtype.kind != "f" or not (np.abs(y) <= LARGEST).all():
            shape = f"shape {(K - 1, n)} and numbers up to {LARGEST:g}"
            raise CertificateRefused(f"y: expected {shape}, got shape {y.shape}")


def _after(branches: Sequence[Branch], number: int) -> int:
    """Return the number of the branch after one and its own branches."""
    missing = 1
    while missing:
        if number >= len(branches):
            raise CertificateRefused("branches: expected two for each that is divided, got fewer")
        missing += 1 if branches[number].node >= 0 else -1
        number += 1
    return number


def _in_tube(task: _Task, left: Places, y: Array, nu: Array) -> float:
    """Return the bound by y and nu on motions through places, on one interval at each node.

    It is minus infinity if the places are in several postures or turns, too far apart, or not
    smooth.
    """
    K, n = task.plan.q.shape
    tilt = _tilt(nu, K, n)
    found = one_interval(task.where, left) if len(np.unique(left.node)) == K else None
    if found is None:
        return -np.inf
    whole, moved = found
    return _by_duals(replace(task.every, tilt=tilt), whole, moved, y, task.prices(nu, whole))


def _by_duals(rates: Rates, at: Places, moved: Array, y: Array, price: Array) -> float:
    """Return the bound on motions with one interval of gamma at each node.

    It is infinite if there is no such motion, and minus infinity if an increment of an endless
    joint may be another one by a turn.

    Parameters
    ----------
    rates : Rates
        Steps between all nodes, tilted by the multipliers of (6).
    at, moved : Places, (K-1, n) rad
        From `one_interval`.
    y : (K-1, n)
        Prices of the increments; with any, the bound holds.
    price : (K,)
        The most that the multipliers add at each node where (6) holds.
    """
    K, n = at.q.shape
    most = rates.velocity
    if (np.abs(moved) + at.reach[1:] + at.reach[:-1] + most > TURN - SURE)[:, rates.endless].any():
        return -np.inf
    # The middles of a motion without turns of endless joints between them.
    middle = at.q[0] + np.vstack([np.zeros(n), np.cumsum(moved, axis=0)])
    force = -np.diff(y, axis=0, prepend=0.0, append=0.0)
    curves = at.slope, at.low, at.high, at.radius, at.half
    each = (force * middle).sum(axis=1) + linear_minimum(*curves, force)
    sizes = np.abs(force) * (np.abs(middle) + at.reach)
    low, high = -most.T, most.T
    totals = []
    for weights in (rates.weights, np.zeros(n)):
        asked = replace(rates, weights=weights)
        steps = least_step(asked, (y - rates.tilt).T, low, high)
        size = float(sizes.sum() + np.abs(steps).sum() + price.sum())
        size += float((np.abs(y - rates.tilt) * most).sum())
        totals.append(float(each.sum() + steps.sum() - price.sum()) - 64 * UNIT * K * n * size)
    cost, none = totals
    return np.inf if none > 0 else cost


def certificate_inputs(plan: Plan) -> tuple[Reachable, Rates]:
    """Return where the motions of a plan's task may be, and the bounds of their steps."""
    settings, robot = plan.settings, plan.robot
    tau = np.diff(plan.time)
    dt = float(tau.max())
    for known, what in (
        (settings.objective == "sum", f"the objective {settings.objective!r}"),
        (settings.tilt is None and not plan.tilt.any(), "a tilt of the tool axis"),
        (not robot.externals, "an external axis"),
        (robot.family.free_rotation, "a robot without free rotation"),
        (plan.feed is None and dt - tau.min() <= EVEN * dt, "a feed that is not constant"),
    ):
        if not known:
            raise CertificateRefused(f"certificates do not apply to {what}")
    limits, (velocity, _) = robot.joint_limits(), robot.speed_limits()
    endless = np.asarray(robot.endless, dtype=bool)
    lower, upper = (np.where(endless, 0.0, end) for end in (limits.lower, limits.upper))
    if not (np.isfinite(lower) & np.isfinite(upper)).all():
        raise CertificateRefused(
            "certificates do not apply to joints that are neither endless nor limited"
        )
    # The value of an endless joint is known only up to full turns: its couplings are ignored.
    bound = ~np.asarray((limits.rows[:, endless] != 0).any(axis=1))
    where = Reachable(
        robot,
        plan.frames,
        plan.T_flange_tip,
        np.arange(POSTURES) if settings.postures is None else np.unique(settings.postures),
        lower,
        upper,
        endless,
        limits.rows[bound],
        limits.row_lower[bound],
        limits.row_upper[bound],
    )
    if not ((where.postures >= 0) & (where.postures < POSTURES)).all():
        raise CertificateRefused(
            f"the plan allows unknown postures; expected numbers from 0 to {POSTURES - 1}"
        )
    most = settings.eta_v * velocity * dt * (1 + 8 * UNIT) + LIMIT_TOLERANCE
    most = np.where(endless, np.minimum(most, np.pi + LIMIT_TOLERANCE), most)
    K, n = plan.q.shape
    most = np.tile(most, (K - 1, 1))
    weights = np.asarray(settings.weights)
    if not (weights >= 0).all():
        raise CertificateRefused("certificates do not apply to negative weights")
    return (
        where,
        Rates(np.arange(K), most, weights, settings.metric, endless, np.zeros((K - 1, n))),
    )


def _changes(plan: Plan, at: Places) -> Array:
    """Return A of (6) at places, the most that it allows on them, (C, n) rad."""
    known = at.reach < HALF_TURN  # else only up to full turns
    low, high = (np.where(known, at.q + side * at.reach, side * np.inf) for side in (-1, 1))
    acceleration = most_accelerations(plan.robot, low[:, 1:3], high[:, 1:3])
    dt = float(np.diff(plan.time).max())
    change = plan.settings.eta_a * acceleration * dt**2 * (1 + EVEN) ** 2
    return np.asarray(change + LIMIT_TOLERANCE)


def _require_fit(stage: Stage, K: int, n: int) -> None:
    """Raise CertificateRefused unless the arrays of a stage fit K nodes and n joints."""
    C = len(stage.node)
    shapes = {
        "node": (C,), "posture": (C,), "level": (C,), "index": (C,), "lift": (C, n),
        "value": (C, 2), "dual": (C, 2, n),
    }  # fmt: skip
    for name, shape in shapes.items():
        part = getattr(stage, name)
        if part.shape != shape:
            raise CertificateRefused(f"{name}: expected shape {shape}, got {part.shape}")
        if (part.dtype.kind in "iu") != (name not in ("value", "dual")):
            kind = "real numbers" if name in ("value", "dual") else "integers"
            raise CertificateRefused(f"{name}: expected {kind}, got {part.dtype}")
    level = stage.level.astype(np.int64)
    for name, most in (("node", K), ("posture", POSTURES), ("level", DEEPEST_CELL + 1)):
        part = getattr(stage, name)
        if not ((part >= 0) & (part < most)).all():
            raise CertificateRefused(f"{name}: expected numbers from 0 to {most - 1}")
    if not ((stage.index >= 0) & (stage.index < BASE << level)).all():
        raise CertificateRefused("index: a cell is not on the circle of gamma")
    if (np.diff(stage.node) < 0).any():
        raise CertificateRefused("node: expected cells in the order of nodes")
    for name in ("value", "dual"):
        if not (np.abs(getattr(stage, name)) <= LARGEST).all():
            raise CertificateRefused(f"{name}: expected numbers up to {LARGEST:g}")


def _rates(stage: Stage, every: Rates) -> Rates:
    """Return the steps between the nodes of a stage, from those between all nodes."""
    nodes = np.unique(stage.node).astype(np.int64)
    K, n = len(every.nodes), len(every.weights)
    if len(nodes) < 2 or nodes[0] != 0 or nodes[-1] != K - 1:
        raise CertificateRefused("its cells leave out motions at the first node or the last")
    # The bound of a step over several intervals is the sum of theirs.
    velocity = np.add.reduceat(every.velocity, nodes[:-1], axis=0) * (1 + K * UNIT)
    rates = replace(every, nodes=nodes, velocity=velocity, tilt=np.zeros(velocity.shape))
    nu = stage.multipliers
    if nu is None:
        return rates
    tilt = _tilt(nu, K, n)
    if len(nodes) < K:
        raise CertificateRefused("multipliers: expected cells at every node")
    return replace(rates, tilt=tilt)


def _tilt(nu: Array, K: int, n: int) -> Array:
    """Return what multipliers nu (K, n) of (6) add to the cost of each step (K-1, n), by joint."""
    if nu.shape != (K, n) or nu.dtype.kind != "f":
        raise CertificateRefused(f"multipliers: expected shape {(K, n)}, got {nu.shape}")
    if not (np.abs(nu) <= LARGEST).all():
        raise CertificateRefused(f"multipliers: expected numbers up to {LARGEST:g}")
    if nu[0].any() or nu[-1].any():
        raise CertificateRefused("multipliers: expected zeros at the first node and the last")
    return np.asarray(nu[:-1] - nu[1:])


def _through(rates: Rates, at: Places, stage: Stage, prices: Array) -> Array:
    """Return a lower bound (C,) on the cost of motions through each place; inf where none passes.

    At the last node no cost remains, so the potential is taken as zero there. ``prices`` (C,) are
    the most that the multipliers of the stage add at each place: the most of each node is taken
    off all motions, and what a place is below it is added to the steps from there.
    """
    layer, last = rates.layer(at), len(rates.nodes) - 1
    ends = (layer == last)[:, None]
    value = np.where(ends, 0.0, stage.value[at.cell])
    dual = np.where(ends[..., None], 0.0, stage.dual[at.cell].astype(float))
    begun = np.where(layer == 0, least_value(at, value, dual), np.inf)
    ended = np.where(layer == last, 0.0, np.inf)
    price = np.zeros(last + 1)
    np.maximum.at(price, layer, prices)
    spared = price[layer] - prices
    steps, held = list(steps_on(rates, at)), 0
    kept: list[list[Costs] | None] = []
    for both, places in steps:
        parts: list[Costs] | None = []
        for a, b, cost in _costs(rates, places, value[both], dual[both], spared[both]):
            np.minimum.at(begun[both], b, begun[both][a] + cost)
            held += len(a)
            if parts is not None:
                parts.append((a, b, cost))
            if held > MOST_HELD:  # the costs from here on are computed again
                parts = None
        kept.append(parts)
    for (both, places), known in zip(reversed(steps), reversed(kept), strict=True):
        for a, b, cost in known or _costs(rates, places, value[both], dual[both], spared[both]):
            np.minimum.at(ended[both], a, ended[both][b] + cost)
    whole, size = begun + ended, float(price.sum())
    if stage.multipliers is not None:
        nu, n = np.abs(stage.multipliers), len(rates.weights)
        rounded = 2 * float(nu.sum(axis=0) @ rates.velocity.max(axis=0)) + size
        size += 4 * UNIT * (len(nu) + n) * rounded
    return whole - _rounding(rates, at, value, dual, whole) - size


def _costs(rates: Rates, at: Places, value: Array, dual: Array, spared: Array) -> Iterator[Costs]:
    """Yield the steps between the places of two nodes, and lower bounds on their costs.

    They include what is `spared` (C,) of the prices of the places that they come from.
    """
    for a, b in candidates(rates, at):
        cost = reduced_costs(rates, at, value, dual, a, b) + spared[a]
        yield a.astype(np.int32), b.astype(np.int32), cost


def _rounding(rates: Rates, at: Places, value: Array, dual: Array, whole: Array) -> float:
    """Return a bound on the rounding error of all sums along a motion.

    A step is a sum of products, with an error of at most 64 units of their sizes; the sums of K
    steps have an error of K units of their size.
    """
    n = len(rates.weights)
    joint = 3 * (np.pi + rates.velocity.max() + 2 * at.reach.max(initial=0.0))
    slope = np.abs(dual).max(initial=0.0) + np.abs(rates.tilt).max() + rates.weights.max()
    step = 2 * np.abs(value).max(initial=0.0) + 2 * n * slope * joint
    sums = np.abs(whole[np.isfinite(whole)]).max(initial=0.0)
    return float(64 * UNIT * len(rates.nodes) * (step + sums))
