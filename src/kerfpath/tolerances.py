"""Tolerances that several modules share, each named once."""

from __future__ import annotations

__all__ = ["LIMIT_MARGIN", "SAME_PLACE", "SAME_POINT"]

SAME_PLACE = 1e-6
"""m: places closer than this are the same, as far as files and CAD systems say where they are."""
SAME_POINT = 1e-9
"""m: points closer than this are the same, except for rounding."""
LIMIT_MARGIN = 1e-6
"""Share of a limit, or of an interval of time, that is left free, so that a motion keeps its limits
after rounding."""
