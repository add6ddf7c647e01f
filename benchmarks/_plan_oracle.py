"""An oracle, independent of the audit, of which edits of a plan.json are harmful.

It does not use the audit. An edit is harmless if the edited plan is still a plan of the job, within
differences that no robot shows, or differs only in words that do not describe the motion.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from benchmarks._document import Path, is_number, said

__all__ = ["HARMLESS", "is_harmless"]

WITHIN = 1e-6
"""A number changed by less than this (relative, or absolute below 1; m, rad, s) counts as the same:
a micrometre and a microradian are a hundredth of the repeatability of a robot."""
HARMLESS = {
    r"kerfpath$": "which version wrote the file",
    r"contours/\d+/(proof|optimal|grid_cost)$": "a claim about other motions: not repeated as fact",
    r"contours/\d+/explored(/|$)": "what the search followed: not repeated as fact",
    r"contours/\d+/counts(/|$)": "how many poses were dropped for what reason: a record",
    r"contours/\d+/audit/checks/\d+/(title|advice|node)$": "words, and a place, of an old audit",
    r"sequence/(optimal|at_least_s)$": "a claim about other orders: not repeated as fact",
    r"limits/acceleration_source$": "free text",
    r"limits/couplings/\d+/note$": "free text",
}
"""Places (from the top, separated by `/`) where another value of the same type is harmless,
and why."""
TURN = 2 * 3.141592653589793


def is_harmless(before: Any, after: Any) -> bool:
    """Return whether an edited document differs only where that is harmless."""
    return not any(True for _ in _harm(before, after, ()))


def _harm(one: Any, two: Any, path: Path) -> Iterator[str]:
    if isinstance(one, dict) and isinstance(two, dict):
        if one.keys() != two.keys() and not _is_free(path):
            yield said(path)
        for key in one.keys() & two.keys():
            yield from _harm(one[key], two[key], (*path, key))
    elif isinstance(one, list) and isinstance(two, list):
        if len(one) != len(two):
            yield said(path)
        for i, (a, b) in enumerate(zip(one, two, strict=False)):
            yield from _harm(a, b, (*path, i))
    elif is_number(one) and is_number(two):
        off = abs(two - one)
        if off and "gamma_rad" in path:
            off = min(off % TURN, TURN - off % TURN)
        # A number may become an integer of the same value, as JSON has only one kind of number.
        if off > WITHIN * max(1.0, abs(one)) and not _is_free(path):
            yield said(path)
    elif type(one) is not type(two):
        if not (all(each is None or is_number(each) for each in (one, two)) and _is_free(path)):
            yield said(path)
    elif one != two and not _is_free(path):
        yield said(path)


def _is_free(path: Path) -> bool:
    """Return whether any value is harmless at a place."""
    where = said(path)
    return any(re.match(pattern, where) for pattern in HARMLESS)
