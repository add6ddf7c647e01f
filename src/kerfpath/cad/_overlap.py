"""Find loops that lie on each other, however each is drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array
from kerfpath.cad._sample import Trace, off_chord

__all__ = ["SAME", "same_lines"]

SAME = 1e-3
"""Lines whose extent, length and points differ by less (mm) are the same."""
CHORD = 1e-4
"""Deviation (mm) of chords from the curves that are compared."""
LOOKED_AT = 100
"""Largest number of points of a line that are compared with the other."""


def same_lines(traces: Sequence[Trace]) -> Iterator[tuple[int, int]]:
    """Yield pairs (i, j) of traces with i < j that lie on each other."""
    if len(traces) < 2:
        return
    facts = np.array(
        [[*trace.bounds().ravel().tolist(), float(trace.lengths.sum())] for trace in traces]
    )
    for i, j in sorted(cKDTree(facts).query_pairs(SAME, p=np.inf)):
        if _lies_on(traces[i].around, traces[j]) and _lies_on(traces[j].around, traces[i]):
            yield i, j


def _lies_on(points: Array, trace: Trace) -> bool:
    chords = trace.sample(CHORD, np.pi)[0]
    if trace.gaps.size == len(trace.lengths):
        chords = np.vstack([chords, chords[:1]])
    step = -(-len(points) // LOOKED_AT)
    return all(off_chord(chords[:-1], chords[1:], point).min() <= SAME for point in points[::step])
