"""Check the order of cutting against the job."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from kerfpath.auditor import Check
from kerfpath.contour import Contour
from kerfpath.job.format import PreparedJob, SequenceTable
from kerfpath.job.plan_file._checks import count

__all__ = ["check_order", "check_sequence"]


def check_sequence(
    prepared: PreparedJob, done: Sequence[int], paths: Sequence[Contour]
) -> list[Check]:
    """Return the checks of an order of cutting; their node is the number of the cut.

    Parameters
    ----------
    prepared : PreparedJob
    done : sequence of int
        Number of the contour of each cut in the job, in the order of cutting; pieces of one
        contour follow each other with the same number.
    paths : sequence of Contour
        The nodes of each cut.
    """
    sequence = prepared.job.sequence
    rows = check_order(sequence, prepared.inner_first, done)
    rows.append(
        _count("pieces", "pieces cut after a later piece of their contour", _early(done, paths))
    )
    if sequence is not None and sequence.heat_spacing_mm > 0:
        warm = _too_warm(prepared, done, paths, sequence.heat_spacing_mm / 1000)
        rows.append(_count("heat-spacing", "contours cut right after one that is too near", warm))
    return rows


def check_order(
    sequence: SequenceTable | None, inner_first: Sequence[tuple[int, int]], done: Sequence[int]
) -> list[Check]:
    """Return the checks of which contour is cut before which; `done` as in `check_sequence`."""
    early = [k for k, i in enumerate(done) if any(a == i and j in done[:k] for a, j in inner_first)]
    given = sequence is None or sequence.order == "given"
    turned = [k + 1 for k, (a, b) in enumerate(pairwise(done)) if given and b < a]
    return [
        _count("inner-first", "contours cut after the contour around them", early),
        _count("order", "contours cut after one that comes later in the job", turned),
    ]


def _early(done: Sequence[int], paths: Sequence[Contour]) -> list[int]:
    """Return the pieces that are cut after one that lies farther along the same contour."""
    return [
        k
        for k, (i, path) in enumerate(zip(done, paths, strict=True))
        if any(j == i and other.s[0] > path.s[0] for j, other in zip(done[:k], paths, strict=False))
    ]


def _too_warm(
    prepared: PreparedJob, done: Sequence[int], paths: Sequence[Contour], spacing: float
) -> list[int]:
    """Return the cuts that follow one nearer than `spacing` (m), by the first candidate of each."""
    whole = {i for i in done if list(done).count(i) == 1}
    first = {i: prepared.contours[i].candidates[0].nodes for i in whole}
    shapes = [first.get(i, path) for i, path in zip(done, paths, strict=True)]
    found = []
    for k, (one, two) in enumerate(pairwise(shapes)):
        apart, _ = cKDTree(one.points).query(two.points)
        if np.asarray(apart).min() < spacing:
            found.append(k + 1)
    return found


def _count(code: str, title: str, found: Sequence[int]) -> Check:
    return count(code, title, len(found), found[0] if found else 0)
