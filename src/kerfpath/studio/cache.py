"""Results that are used again: equal keys of their inputs mean equal results."""

from __future__ import annotations

import hashlib
import json
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any, Generic, TypeVar

from kerfpath.arrays import Array
from kerfpath.cad import Part
from kerfpath.contour import Contour
from kerfpath.graph import LayeredGraph
from kerfpath.job import (
    ContourTable,
    CutRequest,
    CutResult,
    Job,
    PreparedJob,
    course_of_plans,
    prepare,
)
from kerfpath.options import PlanOptions
from kerfpath.setting import keys
from kerfpath.studio.scene import tables_of

# -----------------------------------------------------------------------------
# Hash keys of the inputs of each step of planning: equal keys allow results to be used again.


def _concerning(*what: str) -> frozenset[str]:
    return frozenset(key for key, each in keys(PlanOptions).items() if each.concerns in what)


PROVING = _concerning("proof")
"""Keys of [plan] that only concern the proof for a motion that has been found."""
LIGHT = _concerning("proof", "search")
"""Keys of [plan] that change neither the nodes nor the layered graph."""
GRAPH = _concerning("graph")
"""Keys of [plan] that the layered graph depends on."""
OFF = "switched_off"
"""Key of [part] that only decides which contours are cut."""
PINS = "gamma_windows"
"""Key of [[contour]] that changes neither the nodes nor their speed."""


def part_key(job: Job) -> str:
    """Return the key of the content of a job's drawing."""
    read = _but(job.source["part"], ("xyz_mm", "rpy_deg", OFF))
    return _digest(read, _stamp(job.part_file))


def setup_key(job: Job) -> str:
    """Return the key of the inputs of a prepared job: everything except `LIGHT` keys and pins."""
    source = dict(job.source)
    source["plan"] = _but(source.get("plan", {}), LIGHT)
    source["contour"] = [_but(table, (PINS,)) for table in source["contour"]]
    return _digest(source, _stamps(job))


def motion_key(job: Job) -> str:
    """Return the key that a motion must share with the previous one to start from it."""
    source = dict(job.source)
    source["plan"] = _but(source.get("plan", {}), LIGHT)
    # If nodes are spaced by time, another speed gives other nodes.
    source["contour"] = [
        _but(table, (PINS,) if "time_step_ms" in table else (PINS, "speed_m_min"))
        for table in source["contour"]
    ]
    for name in ("sequence", "layout", "program", "audit"):
        source.pop(name, None)
    source["part"] = _but(source["part"], (OFF,))
    return _digest(source, _stamps(job))


def graph_key(job: Job, nodes: Contour, external: Array | None = None) -> str:
    """Return the key of the layered graph of `nodes`; `external` is as in `Job.graph`."""
    source, options = job.source, job.options
    plan = {k: v for k, v in source.get("plan", {}).items() if k in GRAPH}
    if job.robot.externals and external is None:  # the course of the axes depends on all of [plan]
        plan = _but(source.get("plan", {}), PROVING)
    tables = [source.get(name) for name in ("robot", "tool", "comfort")]
    arrays = [nodes.points, nodes.axes, nodes.s, job.placement]
    arrays += [array for array in (nodes.x, external) if array is not None]
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(array.tobytes())
    windows = [each.to_data() for each in options.gamma_windows]
    kept = [plan, tables, nodes.closed, options.retract, options.floor, windows]
    return _digest(kept, digest.hexdigest(), _stamps(job))


def cut_key(job: Job, request: CutRequest) -> str:
    """Return the key of the result of a contour, without the bound of its plan."""
    source = dict(job.source)
    for name in ("contour", "sequence", "layout", "program"):
        source.pop(name, None)
    source["plan"] = _but(source.get("plan", {}), PROVING)
    source["part"] = _but(source["part"], (OFF,))
    # A table that picks several loops makes one request for each of them, by its name.
    own = [request.task.name, request.task.pick, request.task.table.model_dump(mode="json")]
    return _digest(source, own, job.options.retract, _stamps(job))


def _stamps(job: Job) -> list[object]:
    """Return name, time and size of the files that a job names, to notice their changes."""
    folder, source = job.path.parent, job.source
    cell = source.get("cell", {})
    named = [source["robot"].get(key) for key in ("urdf", "srdf")]
    named += [source["part"].get("lines"), cell.get("head", {}).get("file")]
    named += [fixture.get("file") for fixture in cell.get("fixture", [])]
    return [_stamp(job.part_file), *(_stamp(folder / name) for name in named if name)]


def _stamp(path: Path) -> list[object]:
    try:
        found = path.stat()
    except OSError:
        return [str(path)]
    return [str(path), found.st_mtime_ns, found.st_size]


def _but(table: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    return {k: v for k, v in table.items() if k not in keys}


def _digest(*parts: object) -> str:
    text = json.dumps(parts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


# -----------------------------------------------------------------------------
# Results that are kept from one plan to the next: drawing, cell, nodes, graphs and cuts.

MOST_VERTICES = 1_000_000
"""Vertices of the graphs that each store keeps beyond those of the last two runs (about 70 MB)."""
_T = TypeVar("_T")


class _Used(Generic[_T]):
    """A kept object, and the round in which it was last used."""

    def __init__(self, thing: _T, last: int) -> None:
        self.thing, self.last = thing, last


class Cache(Generic[_T]):
    """A cache that drops the oldest objects once they are too large together.

    Objects used in the current or the previous round are never dropped: a run uses the same
    objects in the same order, and would find none of them if the oldest were dropped.

    Parameters
    ----------
    size : callable
        Returns the size of an object.
    most : int
        Total size beyond which the oldest objects are dropped.
    """

    def __init__(self, size: Callable[[_T], int], most: int) -> None:
        self._size, self._most, self._lock, self._round = size, most, Lock(), 0
        self._things: OrderedDict[str, _Used[_T]] = OrderedDict()

    def __len__(self) -> int:
        return len(self._things)

    def begin(self) -> None:
        """Begin a round."""
        with self._lock:
            self._round += 1

    def get(self, key: str) -> _T | None:
        """Return a kept object; None if there is none."""
        with self._lock:
            found = self._things.get(key)
            if found is None:
                return None
            found.last = self._round
            self._things.move_to_end(key)
            return found.thing

    def put(self, key: str, thing: _T) -> None:
        """Keep an object."""
        with self._lock:
            self._things[key] = _Used(thing, self._round)
            self._things.move_to_end(key)
            total = sum(self._size(used.thing) for used in self._things.values())
            while total > self._most:
                eldest = next(iter(self._things))
                if self._things[eldest].last >= self._round - 1:
                    break
                total -= self._size(self._things.pop(eldest).thing)


class ResultCache:
    """The intermediate results that successive plans of a job share."""

    def __init__(self) -> None:
        self._part: tuple[str, Part] | None = None
        self._prepared: tuple[str, PreparedJob] | None = None
        self._graphs: Cache[LayeredGraph] = Cache(lambda graph: len(graph.q), MOST_VERTICES)
        self.cuts: Cache[tuple[CutResult, ...]] = Cache(_vertices, MOST_VERTICES)
        """Results of contours, by `cut_key` and candidate."""
        self.proved: Cache[CutResult] = Cache(lambda cut: len(cut.graph.q), MOST_VERTICES)
        """Results with their bounds."""

    def begin(self) -> None:
        """Begin a run: objects that only runs before the last one used may be dropped."""
        for kept in (self._graphs, self.cuts, self.proved):
            kept.begin()

    def prepared(self, job: Job) -> PreparedJob:
        """Return a job with its drawing and cell read; unchanged parts are used again.

        Raises
        ------
        InputError
            As for `kerfpath.job.prepare`.
        """
        setup = setup_key(job)
        if self._prepared is not None and self._prepared[0] == setup:
            before = replace(self._prepared[1], job=job)
            tables = [job.contours[i].table for i in tables_of(before)]
            contours = zip(before.contours, tables, strict=True)
            return replace(before, contours=tuple(_pinned(each, job, t) for each, t in contours))
        made = prepare(job, self.part(job))
        self._prepared = setup, made
        return made

    def part(self, job: Job) -> Part:
        """Return the content of a job's drawing.

        Raises
        ------
        InputError
            The drawing cannot be read.
        """
        key = part_key(job)
        if self._part is None or self._part[0] != key:
            self._part = key, job.read_part()
        return self._part[1]

    def graph(
        self,
        job: Job,
        nodes: Contour,
        solved: Callable[[int], None] | None = None,
        external: Array | None = None,
    ) -> LayeredGraph:
        """Return the layered graph of a job's nodes; `external` is as in `Job.graph`."""
        key = graph_key(job, nodes, external)
        found = self._graphs.get(key)
        if found is None:
            found = job.graph(nodes, external=external, progress=solved)
            self._graphs.put(key, found)
        return found

    def whole(self, job: Job, cuts: Sequence[CutResult]) -> tuple[Contour, LayeredGraph]:
        """Return the nodes and the graph of a contour from its cut, or the cuts of its pieces."""
        one = cuts[0]
        if len(cuts) == 1:
            return one.candidate.nodes, one.graph
        nodes = one.request.candidates[0].nodes
        plans = [cut.plan for cut in cuts if cut.plan is not None]
        along = job.robot.externals and job.options.method == "continuous"
        x = course_of_plans(job, nodes, plans) if along else None
        return nodes, self.graph(job, nodes, external=x)


def _pinned(request: CutRequest, job: Job, table: ContourTable) -> CutRequest:
    """Return the request of a contour with the options and windows of gamma of another job."""
    own = request.task.table.model_copy(update={"gamma_windows": table.gamma_windows})
    task = replace(request.task, table=own)
    return replace(request, task=task, options=task.asked(job.options))


def _vertices(cuts: tuple[CutResult, ...]) -> int:
    return sum(len(cut.graph.q) for cut in cuts)
