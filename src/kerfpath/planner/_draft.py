"""Drafts: a motion moved quickly towards new options, not yet the best one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.errors import InputError
from kerfpath.options import PlanOptions
from kerfpath.plans import Plan, Proof
from kerfpath.refiner import refine

__all__ = ["draft"]

FIRST = np.radians(2.0)
"""rad: first change of gamma; larger steps fail more often than they gain."""
PROGRAMS = 2
"""Most convex programs of a draft: a tenth of those to the best motion, for most of the gain after
a change of weights."""


def draft(made: Plan, options: PlanOptions, *, dt: float) -> Plan | None:
    """Return a motion near an existing one that keeps the limits of new options and costs less.

    It stays in the posture and near the gamma of the existing motion; `plan` searches everywhere.

    Parameters
    ----------
    made : Plan
        The existing motion, at constant speed, over continuous gamma.
    options : PlanOptions
        New options: other weights, eta, metric or objective; the rest as in `made`.
    dt : float s
        New time from node to node.

    Returns
    -------
    Plan or None
        None if no such motion is found, or if these options need a full plan.
    """
    constant = made.feed is None and options.feed == "constant" and made.contour.time is None
    free = made.robot.family.free_rotation and options.method == "continuous"
    if not (constant and free and options.closure == made.settings.closure):
        return None
    # The refinement computes the cost under the new options.
    start = replace(
        made,
        settings=replace(options.resolve(made.robot, dt), certify=None),
        time=dt * np.arange(len(made.q), dtype=float),
        proof=Proof(optimal=False, statement="a draft: the previous motion, moved"),
    )
    try:
        found = refine(start, first=FIRST, most=PROGRAMS)
    except InputError:
        return None
    return found.plan if found.done else None
