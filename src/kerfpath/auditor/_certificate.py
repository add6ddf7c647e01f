"""The bound of a certificate, proved again by enclosures of the audit's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kerfpath._arrays import Array
from kerfpath.auditor._cover import DEEPEST, Places, Reachable, covered
from kerfpath.auditor._enclosure import POSTURES
from kerfpath.auditor._intervals import UNIT
from kerfpath.auditor._steps import (
    Rates,
    candidates,
    least_value,
    linked,
    reduced_costs,
    steps_on,
)
from kerfpath.auditor._table import Check
from kerfpath.certificate import BASE, Certificate, Stage
from kerfpath.errors import CertificateRefused, InputError
from kerfpath.plans import Plan

__all__ = ["BOUND", "bound_checks", "certified_bound"]

BOUND = "bound"
"""Code of the check of a bound."""
LIMIT_TOLERANCE = 1e-9
"""rad: what a motion may exceed (5) and (6) by."""
EVEN = 1e-6
"""Relative difference of the intervals of a plan at one speed."""
MOST_HELD = 16_000_000
"""Steps whose costs are held, 16 bytes each; of others they are worked out twice."""
Costs = tuple[NDArray[np.int32], NDArray[np.int32], Array]
LARGEST = 1e12
"""No level or slope of a potential is larger."""
SAME = 1e-9
"""Relative: rounding of a cost, a bound and the gap between them."""


def bound_checks(plan: Plan) -> list[Check]:
    """Return the checks of the bound that a plan states, where it has a certificate."""
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
        ("bound above the cost of the plan", proof.bound, plan.cost * (1 + SAME)),
    )
    rows = [_row(words, claim, true) for words, claim, true in claims]
    gap = (plan.cost - proof.bound) / plan.cost if plan.cost else 0.0
    if proof.gap is None or not abs(proof.gap - gap) <= SAME * max(1.0, size / abs(plan.cost or 1)):
        rows.append(_row("gap that is not that of cost and bound", 1.0, 0.0))
    # The row of the worst stands for all; what is no number is none that is kept.
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
    """Return what a certificate proves that every motion along a plan's contour costs at least.

    Any motion is meant that keeps (5), (6), the ranges and the couplings at the nodes, at any
    gamma, in any posture that is allowed and on any turn; a motion that costs more than the plan
    is known to, so that no more than the plan's cost is returned.

    Parameters
    ----------
    certificate : Certificate
        Of which only cells, potentials and multipliers are used.
    plan : Plan

    Raises
    ------
    InputError
        The certificate does not fit the plan or leaves motions out; no certificate speaks of such
        a plan.
    """
    where, every, change = _asked(plan)
    if not certificate.stages:
        raise CertificateRefused("it has no stage")
    K, n = plan.q.shape
    proved = -np.inf
    left: Places | None = None
    for stage in certificate.stages:
        _require_fit(stage, K, n)
        rates, constant = _rates(stage, every, change)
        at = covered(where, stage, left, partial(linked, rates))
        bounds = _through(rates, at, stage) + constant
        proved = max(proved, float(bounds.min(initial=np.inf)))
        if proved >= plan.cost:
            return plan.cost
        left = at.take(bounds <= plan.cost)
    return proved


def _asked(plan: Plan) -> tuple[Reachable, Rates, Array]:
    """Return where the motions of a plan's task may be, what bounds their steps, and A of (6)."""
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
            raise CertificateRefused(f"nothing is proved with {what}")
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    endless = np.asarray(robot.endless, dtype=bool)
    lower, upper = (np.where(endless, 0.0, end) for end in (limits.lower, limits.upper))
    if not (np.isfinite(lower) & np.isfinite(upper)).all():
        raise CertificateRefused(
            "nothing is proved with joints without ranges that are not endless"
        )
    # The place of an endless joint is known up to whole turns only: its couplings are left out.
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
        raise CertificateRefused("the plan allows postures that are not known")
    most = settings.eta_v * velocity * dt * (1 + 8 * UNIT) + LIMIT_TOLERANCE
    most = np.where(endless, np.minimum(most, np.pi + LIMIT_TOLERANCE), most)
    change = settings.eta_a * acceleration * dt**2 * (1 + EVEN) ** 2 + LIMIT_TOLERANCE
    K, n = plan.q.shape
    most = np.tile(most, (K - 1, 1))
    weights = np.asarray(settings.weights)
    if not (weights >= 0).all():
        raise CertificateRefused("nothing is proved with weights below zero")
    return (
        where,
        Rates(np.arange(K), most, weights, settings.metric, endless, np.zeros((K - 1, n))),
        change,
    )


def _require_fit(stage: Stage, K: int, n: int) -> None:
    """Raise CertificateRefused unless a stage's arrays are of K nodes and n joints."""
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
            raise CertificateRefused(f"{name}: numbers of another kind ({part.dtype})")
    level = stage.level.astype(np.int64)
    for name, most in (("node", K), ("posture", POSTURES), ("level", DEEPEST + 1)):
        part = getattr(stage, name)
        if not ((part >= 0) & (part < most)).all():
            raise CertificateRefused(f"{name}: expected numbers from 0 to {most - 1}")
    if not ((stage.index >= 0) & (stage.index < BASE << level)).all():
        raise CertificateRefused("index: a cell that is not on the circle")
    if (np.diff(stage.node) < 0).any():
        raise CertificateRefused("node: expected cells in the order of nodes")
    for name in ("value", "dual"):
        if not (np.abs(getattr(stage, name)) <= LARGEST).all():
            raise CertificateRefused(f"{name}: expected numbers up to {LARGEST:g}")


def _rates(stage: Stage, every: Rates, change: Array) -> tuple[Rates, float]:
    """Return the steps between the nodes of a stage, and what it adds to a whole motion.

    Parameters
    ----------
    stage : Stage
    every : Rates
        Of the steps between all nodes.
    change : (n,) rad
        Bound of (6).
    """
    nodes = np.unique(stage.node).astype(np.int64)
    K, n = len(every.nodes), len(every.weights)
    if len(nodes) < 2 or nodes[0] != 0 or nodes[-1] != K - 1:
        raise CertificateRefused("its cells leave out motions at the first node or the last")
    # Each interval once: the bounds of a step over several are summed.
    velocity = np.add.reduceat(every.velocity, nodes[:-1], axis=0) * (1 + K * UNIT)
    rates = replace(every, nodes=nodes, velocity=velocity, tilt=np.zeros(velocity.shape))
    nu = stage.multipliers
    if nu is None:
        return rates, 0.0
    if nu.shape != (K, n) or nu.dtype.kind != "f":
        raise CertificateRefused(f"multipliers: expected shape {(K, n)}, got {nu.shape}")
    if not (np.abs(nu) <= LARGEST).all():
        raise CertificateRefused(f"multipliers: expected numbers up to {LARGEST:g}")
    if nu[0].any() or nu[-1].any():
        raise CertificateRefused("multipliers: expected zeros at the first node and the last")
    if len(nodes) < K:
        raise CertificateRefused("multipliers: expected cells at every node")
    size = float((np.abs(nu) @ change).sum())
    rounded = 2 * float(np.abs(nu).sum(axis=0) @ velocity.max(axis=0)) + size
    return replace(rates, tilt=nu[:-1] - nu[1:]), -size - 4 * UNIT * (K + n) * rounded


def _through(rates: Rates, at: Places, stage: Stage) -> Array:
    """Return what every motion through each place costs at least, (C,); inf where there is none.

    Nothing is left to pay at the last node, so that the potential there is taken as zero.
    """
    layer, last = rates.layer(at), len(rates.nodes) - 1
    ends = (layer == last)[:, None]
    value = np.where(ends, 0.0, stage.value[at.cell])
    dual = np.where(ends[..., None], 0.0, stage.dual[at.cell].astype(float))
    begun = np.where(layer == 0, least_value(at, value, dual), np.inf)
    ended = np.where(layer == last, 0.0, np.inf)
    steps, held = list(steps_on(rates, at)), 0
    kept: list[list[Costs] | None] = []
    for both, places in steps:
        parts: list[Costs] | None = []
        for a, b, cost in _costs(rates, places, value[both], dual[both]):
            np.minimum.at(begun[both], b, begun[both][a] + cost)
            held += len(a)
            if parts is not None:
                parts.append((a, b, cost))
            if held > MOST_HELD:  # this and what follows is worked out again
                parts = None
        kept.append(parts)
    for (both, places), known in zip(reversed(steps), reversed(kept), strict=True):
        for a, b, cost in known or _costs(rates, places, value[both], dual[both]):
            np.minimum.at(ended[both], a, ended[both][b] + cost)
    whole = begun + ended
    return whole - _rounding(rates, at, value, dual, whole)


def _costs(rates: Rates, at: Places, value: Array, dual: Array) -> Iterator[Costs]:
    """Yield the steps between the places of two nodes, and what each costs at least."""
    for a, b in candidates(rates, at):
        cost = reduced_costs(rates, at, value, dual, a, b)
        yield a.astype(np.int32), b.astype(np.int32), cost


def _rounding(rates: Rates, at: Places, value: Array, dual: Array, whole: Array) -> float:
    """Return what all sums along a motion may be off by.

    A step is a sum of products, by 64 units of all their sizes at most; the sums of K steps are off
    by K units of theirs.
    """
    n = len(rates.weights)
    joint = 3 * (np.pi + rates.velocity.max() + 2 * at.reach.max(initial=0.0))
    slope = np.abs(dual).max(initial=0.0) + np.abs(rates.tilt).max() + rates.weights.max()
    step = 2 * np.abs(value).max(initial=0.0) + 2 * n * slope * joint
    sums = np.abs(whole[np.isfinite(whole)]).max(initial=0.0)
    return float(64 * UNIT * len(rates.nodes) * (step + sums))
