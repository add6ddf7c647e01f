"""Bound of a plan: its largest possible distance from the best motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kerfpath.certificate import Certify
from kerfpath.certifier import certify
from kerfpath.compiling import finish_compiling
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress

__all__ = ["with_bound"]


def with_bound(
    made: Plan,
    asked: Certify | None,
    *,
    phase: Callable[[str], None] | None = None,
    progress: Progress = no_progress,
) -> Plan:
    """Return the plan with a proved bound, or with the reason why there is none.

    The plan keeps the certificate, which is large, only if `asked.keep`.

    Parameters
    ----------
    made : Plan
    asked : Certify or None
        How to certify it; becomes part of its settings. None: the plan stays without a bound.
    phase : callable, optional
        Called with "certificate" when this begins.
    progress : callable
        As `kerfpath.certifier.certify` calls it.
    """
    settings = replace(made.settings, certify=asked)
    if asked is None:
        return replace(made, settings=settings)
    if phase is not None:
        phase("certificate")
    finish_compiling()
    found = certify(
        made, gap=asked.gap, seconds=asked.seconds, checkable=asked.keep, progress=progress
    )
    proof = replace(
        found.plan.proof,
        statement=f"{made.proof.without_bound().statement}; {found.statement}",
        certificate=found.plan.proof.certificate if asked.keep else None,
    )
    return replace(found.plan, settings=settings, proof=proof)
