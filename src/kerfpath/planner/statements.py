"""Wording of results that hold on a grid only, and rounding that keeps printed figures true.

A search knows the rotations of its grid. A proof that a path is best, fastest or absent holds for
these rotations; those between them may allow more.
"""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

from kerfpath.errors import NoFeasiblePath
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.search import SearchProblem

ON_THIS_GRID = "on this grid of the rotation"
"""Prefix of statements that hold on a grid."""
FINER = "a finer gamma_step_deg or the refinement may do more"
"""Note that goes with such a statement."""
STOPPED = "stopped before the search ended"
"""Claim about the best motion found by then."""


def at_most(value: float, digits: int = 4) -> str:
    """Return a positive value with some digits, rounded down."""
    return _rounded(value, digits, ROUND_FLOOR)


def at_least(value: float, digits: int = 4) -> str:
    """Return a positive value with some digits, rounded up."""
    return _rounded(value, digits, ROUND_CEILING)


def limits_named(problem: SearchProblem) -> str:
    """Return the limits that a search of the grid keeps, as text."""
    held = ["velocity", "acceleration"] + ["torque"] * (problem.limits.torque is not None)
    return f"the {', '.join(held[:-1])} and {held[-1]} limits"


def add_window_note(broken: NoFeasiblePath, asked: PlanOptions) -> NoFeasiblePath:
    """Return an answer without a path that mentions windows of gamma if they may be the cause."""
    count = len(asked.gamma_windows)
    if not count or broken.closed is not None or broken.lost_by(Loss.PINNED):
        return broken
    hold = "1 window of gamma holds" if count == 1 else f"{count} windows of gamma hold"
    return broken.with_message(f"{broken}; {hold}, without which there may be a motion")


def _rounded(value: float, digits: int, how: str) -> str:
    exact = Decimal(repr(float(value)))  # the shortest decimal form, so that 0.1 is exactly 0.1
    last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return f"{exact.quantize(last, rounding=how).normalize():f}"
