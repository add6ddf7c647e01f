"""What is kept from one plan to the next: drawing, cell, nodes, layered graphs, what was cut."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from threading import Lock
from typing import Generic, TypeVar

from kerfpath.cad import Part
from kerfpath.contour import Contour
from kerfpath.graph import LayeredGraph
from kerfpath.job import CutResult, Job, PreparedJob, prepare
from kerfpath.studio._keys import graph_key, part_key, setup_key

__all__ = ["Bench", "Kept"]

MOST_VERTICES = 4_000_000
"""Vertices of all graphs that are kept together: some 300 MB of an arm with six joints."""
_T = TypeVar("_T")


class Kept(Generic[_T]):
    """Things by their keys, of which those not asked for longest are let go of.

    Parameters
    ----------
    size : callable
        Of one of them.
    most : int
        Of all together; the newest is kept whatever its size.
    """

    def __init__(self, size: Callable[[_T], int], most: int) -> None:
        self._size, self._most, self._lock = size, most, Lock()
        self._things: OrderedDict[str, _T] = OrderedDict()

    def __len__(self) -> int:
        return len(self._things)

    def get(self, key: str) -> _T | None:
        """Return a thing that is kept."""
        with self._lock:
            if key in self._things:
                self._things.move_to_end(key)
            return self._things.get(key)

    def put(self, key: str, thing: _T) -> None:
        """Keep a thing."""
        with self._lock:
            self._things[key] = thing
            self._things.move_to_end(key)
            total = sum(map(self._size, self._things.values()))
            while total > self._most and len(self._things) > 1:
                _, gone = self._things.popitem(last=False)
                total -= self._size(gone)


class Bench:
    """What the plans of one job after another are made on."""

    def __init__(self) -> None:
        self._part: tuple[str, Part] | None = None
        self._prepared: tuple[str, PreparedJob] | None = None
        self._graphs: Kept[LayeredGraph] = Kept(lambda graph: len(graph.q), MOST_VERTICES)
        self.cuts: Kept[tuple[CutResult, ...]] = Kept(_vertices, MOST_VERTICES)
        """What came of contours, by `cut_key` and candidate."""
        self.proved: Kept[CutResult] = Kept(lambda cut: len(cut.graph.q), MOST_VERTICES)
        """The same with their bounds."""

    def prepared(self, job: Job) -> PreparedJob:
        """Return a job with its drawing and cell read, of which what has not changed is kept.

        Raises
        ------
        InputError
            As `kerfpath.job.prepare`.
        """
        setup = setup_key(job)
        if self._prepared is not None and self._prepared[0] == setup:
            before = self._prepared[1]
            contours = tuple(replace(each, options=job.options) for each in before.contours)
            return replace(before, job=job, contours=contours)
        made = prepare(job, self.part(job))
        self._prepared = setup, made
        return made

    def part(self, job: Job) -> Part:
        """Return what the drawing of a job holds.

        Raises
        ------
        InputError
            It cannot be read.
        """
        key = part_key(job)
        if self._part is None or self._part[0] != key:
            self._part = key, job.read_part()
        return self._part[1]

    def graph(self, job: Job, nodes: Contour, solved: Callable[[int], None]) -> LayeredGraph:
        """Return the layered graph of a job's nodes."""
        key = graph_key(job, nodes)
        found = self._graphs.get(key)
        if found is None:
            found = job.graph(nodes, progress=solved)
            self._graphs.put(key, found)
        return found


def _vertices(cuts: tuple[CutResult, ...]) -> int:
    return sum(len(cut.graph.q) for cut in cuts)
