"""The messages about a plan, and about the reason why there is none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array
from kerfpath.auditor import Check
from kerfpath.comfort import MEASURES
from kerfpath.job import CutResult
from kerfpath.plans import Plan
from kerfpath.studio._messages import (
    CheckEntry,
    CriteriaEntry,
    LossEntry,
    NearestEntry,
    NoPathMessage,
    Option,
    PlanMessage,
)
from kerfpath.studio._numbers import flat

__all__ = ["check_entries", "no_path_message", "plan_message"]


def plan_message(
    cut: CutResult,
    made: Plan,
    *,
    revision: int,
    graph: str,
    pieces: int,
    settled: bool,
    audited: bool,
    seconds: float,
) -> PlanMessage:
    """Return the message about the motion of a cut.

    Parameters
    ----------
    cut : CutResult
    made : Plan
        Plan of the cut.
    revision : int
        Revision of the job that it was planned for.
    graph : str
        Id of its map.
    pieces : int
        Number of plans of its contour.
    settled : bool
        False while its bound is still to be computed.
    audited : bool
        Whether the audit of the cut is complete.
    seconds : float
        Time that the search took, s.
    """
    velocity, acceleration = made.velocity_share, made.acceleration_share
    s, proof = made.contour.s, made.proof
    first = float(cut.request.candidates[0].nodes.s[0])
    return PlanMessage(
        revision=revision,
        contour=cut.contour,
        name=made.name,
        pieces=pieces,
        graph=graph,
        s=flat(s - first),
        time=flat(made.time),
        q=flat(made.unwrapped),
        gamma=flat(made.gamma),
        posture=made.posture.tolist(),
        points=flat(made.points),
        kind=list(made.contour.kinds),
        speed=flat(np.diff(s) / np.diff(made.time)),
        cost=made.cost,
        bound=proof.bound,
        gap=proof.gap,
        settled=settled,
        optimal=proof.optimal,
        statement=proof.statement,
        method=made.settings.method,
        weights=flat(np.asarray(made.settings.weights)),
        previous_cost=None,
        criteria=_criteria(made),
        velocity_share=flat(velocity, 6),
        acceleration_share=flat(acceleration, 6),
        joint_load=flat(_load(velocity, acceleration), 6),
        checks=check_entries((*cut.checks, *cut.as_run.checks)) if audited else None,
        passed=cut.passed if audited else None,
        feed=None if made.feed is None else str(made.feed),
        seconds=seconds,
    )


def _load(velocity: Array, acceleration: Array) -> Array:
    """Return the largest share of any joint's limits at each node, (K,).

    Parameters
    ----------
    velocity : (K-1, n)
        Shares between nodes; a node takes the larger one of its two intervals.
    acceleration : (K-2, n)
        Shares at the inner nodes.
    """
    between = np.abs(velocity).max(axis=1)
    load = np.maximum(np.append(between, 0.0), np.append(0.0, between))
    load[1:-1] = np.maximum(load[1:-1], np.abs(acceleration).max(axis=1, initial=0.0))
    return np.asarray(load)


def _criteria(made: Plan) -> CriteriaEntry:
    found = made.criteria
    return CriteriaEntry(
        displacement=flat(found.displacement),
        largest_increment=flat(found.largest_increment),
        range=flat(found.range),
        peak_velocity=flat(found.peak_velocity),
        peak_acceleration=flat(found.peak_acceleration),
        nearest=[
            NearestEntry(name=name, value=value, unit=MEASURES[name].unit, node=node)
            for name, (value, node) in found.nearest.items()
        ],
    )


def check_entries(checks: Sequence[Check]) -> list[CheckEntry]:
    """Return the entries of an audit's checks."""
    return [
        CheckEntry(
            code=check.code,
            title=check.title,
            value=check.value if np.isfinite(check.value) else None,
            limit=check.limit if np.isfinite(check.limit) else None,
            unit=check.unit,
            level=check.level,
            ok=check.ok,
            node=check.node,
        )
        for check in checks
    ]


def no_path_message(
    cut: CutResult, placement: Array, *, revision: int, graph: str, ways: list[Option] | None
) -> NoPathMessage:
    """Return the message about the reason why a cut has no plan.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan.
    placement : (4, 4) m
        T_base_part.
    revision : int
        Revision of the job.
    graph : str
        Id of its map.
    ways : list of Option or None
        Changes that would make a path; None while they are being searched for.
    """
    broken, nodes = cut.broken, cut.candidate.nodes
    assert broken is not None
    at = min(max(broken.node, 0), len(nodes) - 1)
    return NoPathMessage(
        revision=revision,
        contour=cut.contour,
        node=broken.node,
        back=broken.back,
        s=float(nodes.s[at] - nodes.s[0]),
        point=flat(placement[:3, :3] @ nodes.points[at] + placement[:3, 3]),
        statement=str(broken),
        scope=broken.scope,
        reasons=[LossEntry(name=str(why), count=count) for why, count in broken.counts.items()],
        graph=graph,
        relaxations=ways,
        remedy=cut.remedy,
    )
