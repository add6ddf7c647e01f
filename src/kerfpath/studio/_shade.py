"""Quantities that shade the admitted poses of a map: clearance, measures of comfort, turns."""

from __future__ import annotations

import base64
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath._arrays import Array, Ints
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES, measure
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.job import Job
from kerfpath.planner import clearance_map
from kerfpath.studio._map import map_id
from kerfpath.studio._map_messages import ShadeLayer, ShadeMessage, ShadeName
from kerfpath.studio._work import Stop

__all__ = ["shade_message", "shades_of"]

CLEARANCE = ShadeName(by="clearance", words="clearance", unit="m")
TURNS = ShadeName(by="turns", words="turns of the joints", unit="")
BAND, RESOLUTION = 0.1, 5e-3
"""Largest clearance that is sent, and its resolution, m."""
NODES_AT_ONCE = 32
"""Number of nodes whose clearance is computed between two checks for a stop."""
MOST, CLOSED, NONE = 253, 254, 255
"""Codes of the highest value, of a pose that is too close, and of one that is not admitted."""


class _Values(NamedTuple):
    """A quantity (N,) of the vertices of a graph, and the ends of its scale.

    `closed` (N,) is True where a body is too close; `pair` (N,) is the index into `pairs` of the
    nearest pair, -1 for none.
    """

    value: Array
    low: float
    high: float
    closed: NDArray[np.bool_] | None = None
    pair: Ints | None = None
    pairs: tuple[tuple[str, str], ...] = ()


def shades_of(job: Job, graph: LayeredGraph, cell: Cell | None) -> list[ShadeName]:
    """Return the quantities for a map: clearance in a cell, measures of the arm, turns.

    Turns are included if some pose is admitted on more than one turn.
    """
    measured = [
        ShadeName(by=name, words=each.words, unit=each.unit)
        for name, each in MEASURES.items()
        if each.has(job.robot)
    ]
    several = len(graph.q) > np.count_nonzero(graph.reason == 0)
    return [*([CLEARANCE] if cell is not None else []), *measured, *([TURNS] if several else [])]


def shade_message(
    contour: str,
    job: Job,
    graph: LayeredGraph,
    cell: Cell | None,
    by: str,
    *,
    revision: int,
    stop: Stop,
) -> ShadeMessage:
    """Return a quantity at every place of a map: the highest value of its vertices.

    Raises
    ------
    InputError
        The map has no such quantity.
    Superseded
        Something else has been requested meanwhile.
    """
    known = {each.by: each for each in shades_of(job, graph, cell)}
    if by not in known:
        raise InputError(f"shade: expected one of {', '.join(known)}, got {by!r:.60}")
    if by == CLEARANCE.by:
        assert cell is not None
        found = _clearance(graph, cell, stop)
    elif by == TURNS.by:
        found = _turns(graph)
    else:
        found = _measured(by, job, graph)
    stop.check()
    values, nearest = _on_the_map(graph, found)
    layers = [
        ShadeLayer(
            posture=mu,
            values=_text(values[:, :, mu]),
            nearest=None if found.pair is None else _text(nearest[:, :, mu]),
        )
        for mu in range(values.shape[2])
        if (values[:, :, mu] != NONE).any()
    ]
    return ShadeMessage(
        revision=revision,
        contour=contour,
        graph=map_id(graph),
        **known[by].model_dump(),
        low=found.low,
        high=found.high,
        beyond=by == CLEARANCE.by,
        layers=layers,
        pairs=[list(pair) for pair in found.pairs],
    )


def _clearance(graph: LayeredGraph, cell: Cell, stop: Stop) -> _Values:
    """Return a lower bound on the clearance of every vertex, computed in blocks of nodes."""
    lower, closed, pair = [], [], []
    for first in range(0, len(graph.start) - 1, NODES_AT_ONCE):
        stop.check()
        part = graph.part(first, min(first + NODES_AT_ONCE, len(graph.start) - 1) - 1)
        if len(part.q):
            made = clearance_map(part, cell, band=BAND, resolution=RESOLUTION)
            lower.append(np.clip(made.lower, 0.0, BAND))
            closed.append(~made.clear)
            pair.append(made.pair)
    whole = np.concatenate(pair) if pair else np.zeros(0, np.int64)
    used, place = np.unique(whole, return_inverse=True)
    names = tuple(cell.pair_names[k] for k in used.tolist() if k >= 0)
    # -1 (no pair) sorts first.
    place = place - int(used.size > 0 and used[0] < 0)
    return _Values(
        value=np.concatenate(lower) if lower else np.zeros(0),
        low=0.0,
        high=BAND,
        closed=np.concatenate(closed) if closed else np.zeros(0, np.bool_),
        pair=np.where(place < NONE, place, -1),
        pairs=names[:NONE],
    )


def _measured(name: str, job: Job, graph: LayeredGraph) -> _Values:
    value = measure(name, job.robot, graph.q, tool=job.tool)
    finite = value[np.isfinite(value)]
    return _Values(value=value, low=0.0, high=float(finite.max(initial=0.0)))


def _turns(graph: LayeredGraph) -> _Values:
    """Return the number of turns on which the pose of each vertex is admitted."""
    layer = np.repeat(np.arange(len(graph.start) - 1), np.diff(graph.start))
    at = layer, graph.candidate, graph.posture
    place = np.ravel_multi_index(at, graph.reason.shape)
    value = np.bincount(place, minlength=graph.reason.size)[place].astype(float)
    return _Values(value=value, low=1.0, high=float(value.max(initial=1.0)))


def _on_the_map(graph: LayeredGraph, found: _Values) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the codes (K, m, P) of the best vertex of each place, and of its nearest pair."""
    K, _, P = graph.reason.shape
    values = np.full((K, len(graph.gamma), P), NONE, np.uint8)
    nearest = values.copy()
    span = found.high - found.low
    share = (found.value - found.low) / span if span > 0 else np.ones(len(found.value))
    code = np.round(np.clip(share, 0.0, 1.0) * MOST).astype(np.uint8)
    if found.closed is not None:
        code[found.closed] = CLOSED
    # The best vertex comes last and overwrites the others.
    rank = np.where(code == CLOSED, -1.0, found.value)
    order = np.argsort(rank, kind="stable")
    layer = np.repeat(np.arange(K), np.diff(graph.start))[order]
    at = layer, graph.sample[order], graph.posture[order]
    values[at] = code[order]
    if found.pair is not None:
        nearest[at] = np.where(found.pair < 0, NONE, found.pair)[order].astype(np.uint8)
    return values, nearest


def _text(codes: NDArray[np.uint8]) -> str:
    return base64.b64encode(codes.tobytes()).decode()
