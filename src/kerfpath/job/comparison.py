"""Compare what a job expects with what was found: the values of a plan.json, or a program."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from kerfpath.auditor import Check
from kerfpath.errors import printable
from kerfpath.job.audit_report import count
from kerfpath.job.expected import SAME_VALUE
from kerfpath.job.format import Job, JobFile
from kerfpath.post import ReadProgram, Rules, differences


def compare(
    expected: Any,
    found: Any,
    *,
    of: str,
    under: tuple[str | int, ...] = (),
    rules: tuple[Rules, ...] = (),
) -> list[Check]:
    """Return a row for each kind of difference; without any, a single row that passes.

    Programs are compared by the motions and switches that they mean, all else value by value. The
    title of a row has the first difference of its kind, or the largest.

    Parameters
    ----------
    expected, found : ReadProgram, or JSON values
    of : str
        What `expected` belongs to, in words.
    under : tuple
        Place of JSON values in their document.
    rules : tuple of Rules
        What the language of a program cannot say.
    """
    if isinstance(found, ReadProgram):
        rows = list(_in_programs(expected, found, of, rules))
        return rows or [count("asked", f"differences from {of}", 0)]
    rows = list(_in_values(expected, found, of, under))
    return rows or [count("agrees", f"values that differ from {of}", 0)]


# -----------------------------------------------------------------------------
# Programs, by what they mean.

FOLLOWED = ("postures",)
"""Codes of differences that follow from the path that was read, and are checked with it."""
WHAT = {
    "added": "moves",
    "removed": "moves",
    "targets": "targets beside the cut",
    "joints": "joint targets",
    "external": "external axes",
    "times": "times of moves",
    "zones": "corners and stops",
    "switches": "laser and gas",
    "kinds": "kinds of moves",
}
"""What differs, by the code of the difference."""


def _in_programs(
    expected: ReadProgram, found: ReadProgram, of: str, rules: tuple[Rules, ...]
) -> Iterator[Check]:
    """Yield a row for each kind of difference; its node is the step of the largest."""
    places = [step.place for step in found.steps]
    for each in differences(expected, found, rules=rules, names=(of, "the text"), strict=True):
        if each.code in FOLLOWED:
            continue
        title = f"different from {of}, {WHAT.get(each.code, each.code)}: {each.message}"
        title += f" (from {each.said_at})" if each.said_at else ""
        node = places.index(each.place) if each.place in places else 0
        yield count(f"asked-{each.code}", title, each.count, node)


# -----------------------------------------------------------------------------
# JSON values, one by one.

CLAIMS = {
    r"kerfpath$": "the version that wrote the file",
    r"(proof|optimal|grid_cost|bound|gap)$": "claims about motions that are not in the file",
    r"certificate(/|$)": "the proof of a bound, which the audit checks separately",
    r"explored(/|$)": "what the search followed and dropped",
    r"counts(/|$)": "poses that were dropped in planning",
    r"audit/checks/\d+/(title|advice|node)$": "words and places of the audit made in planning",
    r"sequence/(optimal|at_least_s)$": "claims about orders that are not in the file",
    r"job/process/row/\d+/(chart|number|source)$": "where the rows of charts are from",
}
"""Places that are not compared, and what they hold; none of them defines the motion."""
DISTANCE = 1e-6
"""Accuracy of distances between convex solids, m; those of a record may differ by it."""
SHOWN = 60
"""Most characters of a value that a message shows."""
PROGRAM = ("program", "audit", "layout", "process", "cost")
"""Tables of a job that do not define the motion."""


@dataclass(frozen=True, slots=True)
class _Difference:
    """One value that differs: where, and what both sides have."""

    path: tuple[str | int, ...]
    expected: Any
    found: Any

    @property
    def node(self) -> int:
        """The node that it belongs to; 0 where it belongs to all."""
        node = self.path[1 + (self.path[0] == "nodes")] if len(self.path) > 2 else 0
        return node if isinstance(node, int) and self.path[0] == "nodes" else 0

    def __str__(self) -> str:
        where = ".".join(str(step) for step in self.path)
        return f"{where}: expected {_shown(self.expected)}, found {_shown(self.found)}"


def _in_values(expected: Any, found: Any, of: str, under: tuple[str | int, ...]) -> Iterator[Check]:
    """Yield a row for each kind of place at which values differ."""
    groups: dict[tuple[str, ...], list[_Difference]] = {}
    for each in _differences(expected, found, under):
        kind = tuple(step for step in each.path if isinstance(step, str))
        groups.setdefault(kind, []).append(each)
    for first, *others in groups.values():
        many = f" (and {len(others)} more such)" if others else ""
        title = f"values that differ from {of}: {first}{many}"
        yield count("agrees", title, 1 + len(others), first.node)


def compare_jobs(job: Job, source: Mapping[str, Any]) -> list[Check]:
    """Return the checks of the job that a plan.json repeats, compared by the values it means.

    Tables that do not define the motion have a separate check.
    """
    title = "values of the job in the plan that differ from the job"
    if _same(job.source, source):
        return [count("job", title, 0)]
    context = {"folder": job.path.parent}
    try:
        then = JobFile.model_validate(source, context=context).model_dump(mode="json")
    except (ValidationError, ValueError, TypeError, OverflowError) as error:
        said = " ".join(str(error).split())[:SHOWN]
        return [count("job", f"{title}: it is not a valid job ({said}...)", 1)]
    now = JobFile.model_validate(job.source, context=context).model_dump(mode="json")
    found = list(_differences(now, then, ("job",)))
    rows = []
    for code, mine in (
        ("job", [each for each in found if each.path[1] not in PROGRAM]),
        ("job-program", [each for each in found if each.path[1] in PROGRAM]),
    ):
        many = f" (and {len(mine) - 1} more)" if len(mine) > 1 else ""
        rows.append(count(code, f"{title}: {mine[0]}{many}" if mine else title, len(mine)))
    return rows


def _differences(one: Any, two: Any, path: tuple[str | int, ...]) -> Iterator[_Difference]:
    where = "/".join(str(step) for step in path)
    if any(re.match(pattern, where) for pattern in CLAIMS):
        return
    if isinstance(one, dict) and isinstance(two, dict):
        for key in sorted(one.keys() | two.keys()):
            if key not in one or key not in two:
                a, b = (side.get(key, _Absent) for side in (one, two))
                yield _Difference((*path, key), a, b)
            else:
                yield from _differences(one[key], two[key], (*path, key))
    elif isinstance(one, list | tuple) and isinstance(two, list | tuple):
        if len(one) != len(two):
            yield _Difference((*path,), f"{len(one)} of them", f"{len(two)} of them")
            return
        numbers = _numbers(one), _numbers(two)
        if numbers[0] is not None and numbers[1] is not None:
            yield from _far(*numbers, path)
            return
        for i, (a, b) in enumerate(zip(one, two, strict=True)):
            yield from _differences(a, b, (*path, i))
    elif _is_number(one) and _is_number(two):
        if not abs(one - two) <= _allowed(path, one):
            yield _Difference(path, one, two)
    elif type(one) is not type(two) or one != two:
        yield _Difference(path, one, two)


def _far(
    one: NDArray[np.float64] | None, two: NDArray[np.float64] | None, path: tuple[str | int, ...]
) -> Iterator[_Difference]:
    """Yield the numbers of two arrays that differ, the largest difference first."""
    assert one is not None
    assert two is not None
    if one.shape != two.shape:
        yield _Difference(path, f"{one.shape} numbers", f"{two.shape} numbers")
        return
    off = np.abs(one - two) / np.maximum(1.0, np.abs(one))
    far = np.argwhere(~(off <= SAME_VALUE))
    for index in far[np.argsort([-off[tuple(i)] for i in far], kind="stable")]:
        at = tuple(int(i) for i in index)
        yield _Difference((*path, *at), float(one[at]), float(two[at]))


def _allowed(path: tuple[str | int, ...], value: float) -> float:
    """Return how far a number may be from `value`."""
    if path[:2] == ("audit", "checks") and path[-1] == "value":
        return DISTANCE
    return SAME_VALUE * max(1.0, abs(value))


def _numbers(values: Any) -> NDArray[np.float64] | None:
    """Return an array of numbers, of any depth; None if it holds anything else."""
    try:
        found = np.array(values)
    except ValueError:  # rows of unlike lengths
        return None
    return found.astype(np.float64) if found.dtype.kind in "iuf" and found.size else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _same(one: Any, two: Any) -> bool:
    """Return whether two documents are the same, types included."""
    if type(one) is not type(two):
        return False
    if isinstance(one, dict):
        return one.keys() == two.keys() and all(_same(one[key], two[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(two) and all(map(_same, one, two))
    return bool(one == two)


class _Absent:
    """Marks a value that one of the two documents lacks."""


def _shown(value: Any) -> str:
    text = "nothing" if value is _Absent else printable(str(value))
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
