"""The bound of a plan: how far it is at most from the best motion that there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from kerfpath.certificate import Certify
from kerfpath.certifier import certify
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
    """Return the plan with the bound that is proved for it, or with why there is none.

    What proves it is large: the plan keeps it only where that is asked for.

    Parameters
    ----------
    made : Plan
    asked : Certify or None
        How far it is to be certified, which its settings then say; None: it stays without a bound.
    phase : callable, optional
        Called with "certificate" where that begins.
    progress : callable
        As `kerfpath.certifier.certify` calls it.
    """
    settings = replace(made.settings, certify=asked)
    if asked is None:
        return replace(made, settings=settings)
    if phase is not None:
        phase("certificate")
    found = certify(
        made, gap=asked.gap, seconds=asked.seconds, checkable=asked.keep, progress=progress
    )
    proof = replace(
        found.plan.proof,
        statement=f"{made.proof.without_bound().statement}; {found.statement}",
        certificate=found.plan.proof.certificate if asked.keep else None,
    )
    return replace(found.plan, settings=settings, proof=proof)
