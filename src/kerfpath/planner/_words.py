"""How what holds on a grid alone is said: as that and no more, in figures that keep what they say.

A search knows the rotations of its grid. That a path is best, fastest or not there is proved for
those; between them there may be more.
"""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Decimal

from kerfpath.errors import NoFeasiblePath
from kerfpath.losses import Loss
from kerfpath.options import PlanOptions
from kerfpath.search import SearchProblem

__all__ = ["FINER", "ON_THIS_GRID", "at_least", "at_most", "limits_named", "with_windows_said"]

ON_THIS_GRID = "on this grid of the rotation"
"""Where a statement holds."""
FINER = "a finer gamma_step_deg or the refinement may do more"
"""What is to be said with it."""


def at_most(value: float, digits: int = 4) -> str:
    """Return a positive value in so many digits, never more than it is."""
    return _rounded(value, digits, ROUND_FLOOR)


def at_least(value: float, digits: int = 4) -> str:
    """Return a positive value in so many digits, never less than it is."""
    return _rounded(value, digits, ROUND_CEILING)


def limits_named(problem: SearchProblem) -> str:
    """Return the limits that a search of the grid keeps."""
    held = ["velocity", "acceleration"] + ["torque"] * (problem.limits.torque is not None)
    return f"the {', '.join(held[:-1])} and {held[-1]} limits"


def with_windows_said(broken: NoFeasiblePath, asked: PlanOptions) -> NoFeasiblePath:
    """Return a refusal that says that windows of gamma hold, where they may be why."""
    count = len(asked.gamma_windows)
    if not count or broken.closed is not None or broken.lost_by(Loss.PINNED):
        return broken
    hold = "1 window of gamma holds" if count == 1 else f"{count} windows of gamma hold"
    return broken.with_message(f"{broken}; {hold}, without which there may be a motion")


def _rounded(value: float, digits: int, how: str) -> str:
    exact = Decimal(repr(float(value)))  # as it is written: 0.1 is no more than that
    last = Decimal(1).scaleb(exact.adjusted() - digits + 1)
    return f"{exact.quantize(last, rounding=how).normalize():f}"
