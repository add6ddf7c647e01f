"""Collision map: the clearance of each vertex of a layered graph in a cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, Bools, Ints, freeze, not_negative, scalar
from kerfpath._repr import short_repr
from kerfpath.cell import Cell, clearances
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph

__all__ = ["ClearanceMap", "clearance_map"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClearanceMap:
    """Clearance of each vertex of a layered graph in a cell.

    Clearance is the least distance of any judged pair of bodies beyond its near-miss distance.
    Pairs with a near-miss distance of their own, such as nozzle and part, work close together by
    design: they close vertices but do not count as clearance.

    Parameters
    ----------
    clear : (N,) bool
        The vertex keeps all near-miss distances.
    lower, upper : (N,) m
        Bounds on the clearance, at most `resolution` apart where `lower` is below `band`. Above,
        `upper` may be infinite; where a vertex is not clear, `lower` is minus infinity and `upper`
        is 0 or less.
    pair : (N,) int
        Index into `pairs` of the pair that is too near, or else the nearest known; -1 for none.
    pairs : tuple of (name, name)
        The judged pairs.
    band, resolution : float m
        The arguments of `clearance_map`.
    poses : int
        Number of different poses among the vertices; vertices that differ only in turns share one.
    queries : int
        Number of distances between two bodies that were computed.
    """

    clear: Bools
    lower: Array
    upper: Array
    pair: Ints
    pairs: tuple[tuple[str, str], ...]
    band: float
    resolution: float
    poses: int
    queries: int

    __repr__ = short_repr


def clearance_map(
    graph: LayeredGraph,
    cell: Cell,
    *,
    band: float = 20e-3,
    resolution: float = 2e-3,
    progress: Callable[[int], None] | None = None,
) -> ClearanceMap:
    """Return the collision map of all vertices, from far fewer distances than vertices.

    `ClearanceMap.clear` equals `Cell.clear` for each vertex, unless a pair is within a micrometre
    of its near-miss distance, the precision of distances.

    Parameters
    ----------
    graph : LayeredGraph
        Graph of a task with the tool and placement that the cell was built with.
    cell : Cell
    band : float m
        Clearance above this need not be known more closely.
    resolution : float m
        Precision of clearance within the band.
    progress : callable, optional
        Called with the number of poses done since the last call.

    Raises
    ------
    InputError
        A cell of another robot, a negative band, or a resolution that is not positive.
    """
    band = not_negative(band, "band", unit="m")
    resolution = scalar(resolution, "resolution", unit="m", above=0.0)
    if graph.q.shape[1] != cell.chain.joints:
        raise InputError(
            f"graph: its vertices have {graph.q.shape[1]} joints, but the cell's robot has "
            f"{cell.chain.joints}"
        )
    first, pose = _poses(graph)
    before = cell.queries
    found = clearances(cell, graph.q[first], band=band, resolution=resolution, progress=progress)
    return ClearanceMap(
        clear=freeze(found.upper[pose] > 0),
        lower=freeze(found.lower[pose]),
        upper=freeze(found.upper[pose]),
        pair=freeze(found.pair[pose]),
        pairs=cell.pair_names,
        band=band,
        resolution=resolution,
        poses=len(first),
        queries=cell.queries - before,
    )


def _poses(graph: LayeredGraph) -> tuple[Ints, Ints]:
    """Return one vertex of each pose, node after node, and the index of each vertex's pose."""
    layer = np.repeat(np.arange(len(graph.start) - 1), np.diff(graph.start))
    _, samples, postures = graph.reason.shape
    key = (layer * samples + graph.candidate) * postures + graph.posture
    _, first, pose = np.unique(key, return_index=True, return_inverse=True)
    return first, pose
