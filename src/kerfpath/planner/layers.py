"""The layers of a task: graph of poses, time between nodes, and clearance of the poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import (
    Array,
    Bools,
    Ints,
    as_pose,
    floats,
    freeze,
    not_negative,
    require_instance,
    require_metres,
    scalar,
    short_repr,
)
from kerfpath.cell import Cell, clearances
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph, build, gamma_grid
from kerfpath.losses import Loss, Reason
from kerfpath.options import EXACT_OR_BETTER, GraphKeywords, PlanOptions, with_keywords
from kerfpath.plans import has_room
from kerfpath.robots import Robot, lowest_joint
from kerfpath.search import GammaSamples
from kerfpath.tilt import tilt_frames
from kerfpath.windows import nodes_of, samples_inside, with_window_ends

# -----------------------------------------------------------------------------
# The first steps of every planning task: the layered graph, and the time between nodes.

UNEVEN = 0.21
"""Largest relative difference of node distances that counts as evenly spaced: a fifth, which
sampling needs to place nodes at corners and feature ends, plus rounding."""


def layered_graph(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    options: PlanOptions | None = None,
    nodes: ArrayLike | None = None,
    external: ArrayLike | None = None,
    fold: Bools | None = None,
    progress: Callable[[int], None] | None = None,
    **keywords: Unpack[GraphKeywords],
) -> LayeredGraph:
    """Return the layered graph that `plan` searches.

    Parameters
    ----------
    contour, robot, tool, placement, options, progress
        As in `plan`.
    nodes : (M,) int, optional
        Only the layers of these nodes, which equal those of the whole graph; default: all.
    external : (K, E) or (K, X, E) rad or m, optional
        Values of the joints that a pose leaves free at every node, in X variants; default: a grid.
    fold : (n,) bool, optional
        Joints of which poses are on one turn only; default none. See `kerfpath.planner.folds`.

    Raises
    ------
    InputError
        Joint limits that are not known, or values out of range.
    """
    asked = with_keywords(options, keywords, GraphKeywords)
    require_windows_fit(contour, robot, asked)
    robot = robot if fold is None else robot.folded(fold)
    H, s = contour.frames(asked.frames), contour.s
    samples = None if asked.tilt is None else asked.tilt.samples()
    if samples is not None and samples.any():
        H = tilt_frames(H[:, None], contour.along[:, None], samples)
    course = None if external is None else course_of(external, contour, robot)
    if nodes is not None:
        H, s = H[np.asarray(nodes)], s[np.asarray(nodes)]
        course = None if course is None else course[np.asarray(nodes)]
    T_flange_tip = as_pose(tool, "tool")
    H = np.ascontiguousarray(as_pose(placement, "placement") @ H)
    graph = build(
        H,
        robot,
        T_flange_tip=T_flange_tip,
        gamma=with_window_ends(gamma_grid(asked.gamma_step), asked.gamma_windows),
        tilt=samples,
        postures=asked.postures,
        external=course,
        progress=progress,
    )
    if nodes is not None:
        asked = replace(asked, retract=None)  # its first and last layer need not be the ends
    periodic = asked.closure == "periodic" and nodes is None
    graph = replace(graph, folded=fold)
    return within_margins(graph, robot, asked, T_flange_tip, s, periodic=periodic)


def course_of(external: ArrayLike, contour: Contour, robot: Robot) -> Array:
    """Return checked values of the free joints at every node, (K, E) or (K, X, E), as (K, X, E).

    Raises
    ------
    InputError
        Another number of nodes or axes, or a value outside the range of its axis.
    """
    free, limits = robot.free, robot.joint_limits()
    x = np.asarray(external, dtype=float)
    x = x[:, None] if x.ndim == 2 else x
    x = floats(x, "external", (len(contour), None, len(free)), copy=False)
    low, high = limits.lower[free], limits.upper[free]
    out = ((x < low) | (x > high)) & ~robot.endless[free]
    if out.any():
        node, place, i = np.argwhere(out)[0]
        name, unit = robot.joint_names[free[i]], robot.units[free[i]]
        raise InputError(
            f"external: {name} is at {x[node, place, i]:.6g} {unit} at node {node}, "
            f"outside its range {low[i]:g} to {high[i]:g} {unit}"
        )
    return x


def within_margins(
    graph: LayeredGraph,
    robot: Robot,
    options: PlanOptions,
    tool: Array,
    s: Array,
    *,
    periodic: bool = False,
) -> LayeredGraph:
    """Return the graph without vertices that break a hard margin, the floor or a window of gamma.

    At both ends it also drops vertices from which the tool cannot back off, if it can from others.
    With a `periodic` closure, the first and the last layer are equal up to rounding and lose the
    same vertices. A graph that was thinned with the same arguments is returned unchanged. The
    losses are counted in the graph; s (K,) m are the arc lengths of its nodes.
    """
    comfort, retract = options.comfort, options.retract
    hard, limits = None if comfort is None else comfort.hard, robot.joint_limits()
    arrays = limits.lower, limits.upper, limits.endless, tool
    windows = options.gamma_windows
    asked = robot.id, [a.tobytes() for a in arrays], hard, retract, options.floor, periodic, windows
    if graph.kept == asked:
        return graph
    near = dict[Reason, Bools]()
    if windows:
        layer = np.repeat(np.arange(len(s)), np.diff(graph.start))
        near[Reason(Loss.PINNED)] = ~samples_inside(windows, s, graph.gamma)[layer, graph.sample]
    if comfort is not None:
        near |= comfort.too_near(robot, graph.q, tool)
    if options.floor is not None:
        near[Reason(Loss.FLOOR)] = lowest_joint(robot, graph.q) < options.floor
    first, last = slice(0, graph.start[1]), slice(graph.start[-2], graph.start[-1])
    if retract is not None:
        broken = np.any([*near.values()], axis=0) if near else np.zeros(len(graph.q), bool)
        here = near[Reason(Loss.NO_ROOM, f"{retract * 1e3:g} mm")] = np.zeros(len(graph.q), bool)
        for end in (first, last):
            at = graph.q[end], graph.posture[end].astype(np.int64)
            room = has_room(options, robot, *at, tool)
            # If no sample has room, a gamma between two may: the motion found is audited.
            here[end] = ~room & (room & ~broken[end]).any()
    for here in near.values():
        if periodic and len(here[first]) == len(here[last]):
            here[first] |= here[last]
            here[last] = here[first]
    return replace(graph.without(near) if near else graph, kept=asked)


def require_windows_fit(contour: Contour, robot: Robot, options: PlanOptions) -> None:
    """Raise InputError if a window of gamma holds at no node, or gamma is not free."""
    windows = options.gamma_windows
    if windows and not robot.family.free_rotation:
        raise InputError("gamma_windows: the robot leaves no rotation free; remove them")
    for number, window in enumerate(windows, 1):
        if not nodes_of([window], contour.s).any():
            raise InputError(
                f"gamma_windows: window {number}, from {window.start * 1e3:g} to "
                f"{window.end * 1e3:g} mm, holds at no node of contour {contour.name!r}, whose "
                f"nodes are from {contour.s[0] * 1e3:g} to {contour.s[-1] * 1e3:g} mm, up to "
                f"{longest_step(contour) * 1e3:.4g} mm apart; make it longer, or remove it"
            )


def samples_of(graph: LayeredGraph) -> GammaSamples:
    """Return the positions of the vertices of a graph on circles of gamma."""
    return GammaSamples(
        sample=graph.sample.astype(np.int64),
        variant=graph.variant.astype(np.int64),
        posture=graph.posture.astype(np.int64),
        samples=len(graph.gamma),
    )


def node_interval(contour: Contour, speed: float | None) -> float:
    """Return the time between neighbouring nodes, s, from the speed (m/s) or the contour's times.

    If nodes are not quite evenly spaced, the speed is that of the longest step.

    Raises
    ------
    InputError
        No contour, or one larger than any cell; no speed, or a speed besides the contour's own
        times; a speed that is not positive; nodes unevenly spaced.
    """
    require_instance(contour, Contour, "contour", "make one with kerfpath.Contour(points, axes)")
    require_metres(float(np.ptp(contour.points, axis=0).max()), f"contour {contour.name!r}")
    if contour.time is not None:
        if speed is not None:
            raise InputError(
                f"speed: contour {contour.name!r} carries its own times; give no speed, or "
                "resample it by spacing"
            )
        require_even(contour, np.diff(contour.time), "s")
        return float(contour.time[-1] - contour.time[0]) / (len(contour) - 1)
    if speed is None:
        raise InputError(f"speed: contour {contour.name!r} carries no times; give a speed in m/s")
    speed = scalar(speed, "speed", unit="m/s", above=0.0)
    if (contour.speed_share < 1).any():
        raise InputError(
            f"speed: contour {contour.name!r} has nodes with a share of the speed; apply it "
            f"with contour.resample(dt=..., speed={speed:g}) and give no speed"
        )
    require_even(contour, np.diff(contour.s), "m")
    return longest_step(contour) / speed


def longest_step(contour: Contour) -> float:
    """Return the longest step between neighbouring nodes, m; at the speed it takes one interval."""
    return float(np.diff(contour.s).max())


def require_even(contour: Contour, steps: Array, unit: str) -> None:
    """Raise InputError unless the steps (K-1,) between the nodes of a contour are nearly equal."""
    low, high = float(steps.min()), float(steps.max())
    if high - low > UNEVEN * high:
        raise InputError(
            f"contour {contour.name!r}: nodes must be evenly spaced, but their steps run from "
            f"{low:.6g} to {high:.6g} {unit}; resample it first, for example with "
            f"contour.resample(count={len(contour)})"
        )


def require_no_empty_layer(contour: Contour, graph: LayeredGraph) -> None:
    """Raise NoFeasiblePath if a node has no admissible pose, with the reasons and their counts."""
    empty = np.flatnonzero(np.diff(graph.start) == 0)
    if empty.size:
        k = int(empty[0])
        counts = graph.counts(k)
        reasons = ", ".join(f"{word}: {number}" for word, number in counts.items())
        raise NoFeasiblePath(
            f"contour {contour.name!r}: no admissible pose at node {k} of {len(contour)} "
            f"({empty.size} such nodes); of {sum(counts.values())} candidates there, {reasons}",
            proved=True,
            node=k - 1,
            back=int(empty[-1]) + 1,
            counts=counts,
        )


def require_held(robot: Robot, options: PlanOptions) -> None:
    """Raise InputError if the planning method does not keep a torque or jerk limit of the robot."""
    limits, comfort = options.limits(robot), options.comfort
    refined = options.method == "continuous" or (options.method == "exact" and options.refine)
    priced = comfort is not None and comfort.prices_clearance
    for what, held in (("torque", limits.torque), ("jerk", limits.jerk)):
        if held is None:
            continue
        if options.method not in EXACT_OR_BETTER:
            raise InputError(
                f'{what}: a limit needs method "continuous" or "exact", got "{options.method}"'
            )
        if options.feed != "constant":
            raise InputError(f'{what}: a limit needs feed "constant", got "{options.feed}"')
    if limits.jerk is not None and not (refined and robot.family.free_rotation and not priced):
        raise InputError(
            "jerk: only the refinement keeps a limit: it must be on, the robot must leave a "
            "rotation free, and clearance must have no cost"
        )


# -----------------------------------------------------------------------------
# Collision map: the clearance of each vertex of a layered graph in a cell.


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
