"""A motion moved towards what else is asked of it: soon, and not yet the best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.errors import InputError
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import refine

__all__ = ["draft"]

FIRST = np.radians(2.0)
"""rad: what gamma changes by at first; larger steps fail more often than they gain."""
PROGRAMS = 2
"""Convex programs that a draft may take: a tenth of what the way to the best takes, for most of the
gain of a change of weights."""


def draft(made: Plan, options: PlanOptions, *, dt: float) -> Plan | None:
    """Return a motion near another one that keeps the limits of other options and costs less.

    It stays in the posture and near the gamma of the other one, where `plan` looks everywhere.

    Parameters
    ----------
    made : Plan
        At constant speed, over continuous gamma.
    options : PlanOptions
        Of another speed, other weights, eta, metric or objective; the rest as of the plan.
    dt : float s
        From node to node.

    Returns
    -------
    Plan or None
        None where none is found so, or where it takes more than this to find one.
    """
    constant = made.feed is None and options.feed == "constant" and made.contour.time is None
    free = made.robot.family.free_rotation and options.method == "continuous"
    if not (constant and free and options.closure == made.settings.closure):
        return None
    # What it costs by the other weights is known by the refinement.
    start = replace(
        made,
        settings=replace(options.resolve(made.robot, dt), certify=None),
        time=dt * np.arange(len(made.q), dtype=float),
        proof=Proof(optimal=False, statement="a draft: the motion before, moved"),
    )
    try:
        found = refine(start, first=FIRST, most=PROGRAMS)
    except InputError:
        return None
    return found.plan if found.done else None
