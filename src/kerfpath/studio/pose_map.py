"""The map of a contour: the reason of loss of every pose, and one pose in detail."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import SHOWN_UNITS, Array, Ints
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES, measure
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import CutResult, Job, PreparedJob
from kerfpath.losses import Loss, Reason
from kerfpath.options import PlanOptions
from kerfpath.planner import clearance_map, plan
from kerfpath.robots import Robot, posture_name
from kerfpath.studio.messages import (
    CodeLayer,
    CourseEntry,
    MapMessage,
    PoseMessage,
    ShadeLayer,
    ShadeMessage,
    ShadeName,
    TechniqueMessage,
    flat,
    flat_or_none,
)
from kerfpath.studio.work import Stop

KINDS = {
    Loss.ADMITTED: "admitted",
    Loss.UNREACHABLE: "reach",
    Loss.LOW: "joint",
    Loss.HIGH: "joint",
    Loss.UNWANTED: "unwanted",
    Loss.MARGIN: "margin",
    Loss.SPARE: "admitted",
    Loss.COLLISION: "cell",
    Loss.NO_ROOM: "margin",
    Loss.FLOOR: "cell",
    Loss.PINNED: "pinned",
}
"""The kind that decides the colour of each loss; losses that are not listed are "other"."""


def map_id(graph: LayeredGraph) -> str:
    """Return the id of a graph's map; equal maps have the same id."""
    digest = hashlib.sha256("\n".join(graph.reasons).encode())
    digest.update(np.array(graph.reason.shape).tobytes() + graph.gamma.tobytes())
    digest.update(graph.reason.tobytes())
    return digest.hexdigest()[:16]


def with_collisions(cut: CutResult, graph: LayeredGraph) -> LayeredGraph:
    """Return the graph with collisions among its reasons, if the clearance map is known."""
    from kerfpath.report import add_clearance

    known = cut.clearance
    fits = known is not None and len(known.clear) == len(graph.q)
    return add_clearance(graph, known) if fits and known is not None else graph


def map_message(
    cuts: Sequence[CutResult],
    nodes: Contour,
    graph: LayeredGraph,
    *,
    robot: Robot,
    shades: Sequence[ShadeName],
    revision: int,
) -> MapMessage:
    """Return the map of a contour with the course of its plans, as the report draws it.

    Parameters
    ----------
    cuts : sequence of CutResult
        Result of the contour, or of each of its pieces.
    nodes : Contour
        Nodes of the complete contour.
    graph : LayeredGraph
        Layered graph of the complete contour.
    robot : Robot
    shades : sequence of ShadeName
        Quantities that the map can be shaded by.
    revision : int
        Revision of the job.
    """
    from kerfpath.report import hidden_postures, reason_colours, shown_postures

    name, first = map_id(graph), float(nodes.s[0])
    graph = with_collisions(cuts[0], graph)
    codes = graph.reason_by_gamma
    return MapMessage(
        revision=revision,
        contour=cuts[0].contour,
        graph=name,
        s=flat(nodes.s - first),
        gamma=flat(graph.gamma),
        nodes=len(nodes),
        reasons=list(map(str, graph.reasons)),
        kinds=[KINDS.get(why.loss, "other") for why in graph.reasons],
        colours=list(reason_colours(graph.reasons)),
        layers=[
            CodeLayer(
                posture=mu,
                name=posture_name(mu),
                codes=base64.b64encode(codes[:, :, mu].tobytes()).decode(),
            )
            for mu in shown_postures(graph)
        ],
        hidden=hidden_postures(graph),
        external=_along(robot, graph, cuts),
        shades=list(shades),
        course=[
            CourseEntry(
                name=cut.plan.name,
                s=flat(cut.plan.contour.s - first),
                gamma=flat(cut.plan.gamma),
                posture=cut.plan.posture.tolist(),
            )
            for cut in cuts
            if cut.plan is not None
        ],
    )


def _along(robot: Robot, graph: LayeredGraph, cuts: Sequence[CutResult]) -> str:
    """Return a sentence on the external axes at the poses of a map, or "" without any."""
    x = graph.external
    if x is None:
        return ""
    names = " and ".join(axis.name for axis in robot.externals)
    if x.shape[1] > 1:
        return f"The map shows the best place of {names} on the grid of the search."
    if all(cut.plan is not None for cut in cuts):
        return f"The map has {names} where the plan has them."
    if (x == x[0]).all():
        held = (SHOWN_UNITS[axis.unit] for axis in robot.externals)
        at = (f"{by * value:g} {unit}" for (by, unit), value in zip(held, x[0, 0], strict=True))
        return f"No plan: the map has {names} at rest, at {' and '.join(at)}."
    return f"No plan: the map follows the most promising course of {names}."


def pose_message(
    contour: str,
    job: Job,
    cuts: Sequence[CutResult],
    nodes: Contour,
    graph: LayeredGraph,
    *,
    node: int,
    gamma: float,
    posture: int,
) -> PoseMessage:
    """Return the joints of the robot at a place of the map, and the reason if they are lost.

    Gamma is rounded to the nearest sample of the map. With a tolerance of the tool axis, the joints
    are those of the nominal axis. External axes are where the map has them; on a grid, at the point
    whose reason the map shows, the one nearest to the plan if there are several.

    Raises
    ------
    IndexError
        The map has no such node or posture.
    """
    codes = graph.reason_by_gamma
    off = np.angle(np.exp(1j * (graph.gamma - gamma)))
    sample = int(np.argmin(np.abs(off)))
    why = graph.reasons[int(codes[node, sample, posture])]
    x = _external(graph, cuts, nodes, node, sample, posture)
    robot = job.robot if x is None else job.robot.held(x)
    H = job.placement @ nodes.frames(job.options.frames)[node : node + 1]
    solved, reach = robot.arm.inverse_nodes(
        np.ascontiguousarray(H), np.ascontiguousarray(graph.gamma[[sample]]), job.tool
    )
    q = solved[0, 0, posture] if reach[0, 0, posture] else None
    if q is not None and x is not None:
        q = np.append(q, x)
    admitted = KINDS.get(why.loss) == "admitted"
    reason = _turns(graph, why, node, sample, posture) if admitted else _in_numbers(job, why, q)
    return PoseMessage(
        contour=contour,
        node=node,
        gamma=float(graph.gamma[sample]),
        posture=posture,
        q=None if q is None else flat(q),
        admitted=admitted,
        reason=reason,
    )


def _external(
    graph: LayeredGraph,
    cuts: Sequence[CutResult],
    nodes: Contour,
    node: int,
    sample: int,
    posture: int,
) -> Array | None:
    """Return the external axes (E,) rad or m at a place of the map; None without any."""
    if graph.external is None:
        return None
    codes = graph.reason[node, sample :: len(graph.gamma), posture]
    places = graph.external[node]
    best = np.tile(places, (len(codes) // len(places), 1))[codes == codes.min()]
    plans = [cut.plan for cut in cuts if cut.plan is not None]
    if len(best) == 1 or not plans:
        return np.asarray(best[0])
    s = np.concatenate([made.contour.s for made in plans])
    x = np.concatenate([made.q for made in plans])[:, -best.shape[1] :]
    own = x[np.argmin(np.abs(s - nodes.s[node]))]
    return np.asarray(best[np.argmin(np.abs(best - own).max(axis=1))])


def _turns(graph: LayeredGraph, why: Reason, node: int, sample: int, posture: int) -> str:
    """Return the reason of an admitted place, with its joints if several turns are admitted."""
    layer = slice(*graph.start[node : node + 2])
    here = (graph.sample[layer] == sample) & (graph.posture[layer] == posture)
    variant = graph.variant[layer][here]
    q = graph.q[layer][here][variant == variant.min(initial=len(graph.tilt))]
    if len(q) < 2:
        return str(why)
    places = [sorted({f"{x:.0f}" for x in column}, key=float) for column in np.degrees(q).T]
    several = [f"joint {i + 1} at {' or '.join(at)} deg" for i, at in enumerate(places) if at[1:]]
    return f"{why}{', ' if ': ' in why else ': '}on {len(q)} turns, {', '.join(several)}"


def _in_numbers(job: Job, why: Reason, q: Array | None) -> str:
    """Return the reason of a lost pose, with joint and limit if a joint limit is the reason."""
    if q is None or why.loss not in (Loss.LOW, Loss.HIGH):
        return str(why)
    name = str(why.which)
    if not name.startswith("joint "):
        return str(why)
    i, limits = int(name.removeprefix("joint ")) - 1, job.robot.joint_limits()
    return (
        f"{why}: at {np.degrees(q[i]):.1f} deg, its limits are {np.degrees(limits.lower[i]):g} to "
        f"{np.degrees(limits.upper[i]):g} deg"
    )


# -----------------------------------------------------------------------------
# Quantities that shade the admitted poses of a map: clearance, measures of comfort, turns.

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
        found = _turn_counts(graph)
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


def _turn_counts(graph: LayeredGraph) -> _Values:
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


# -----------------------------------------------------------------------------
# Courses of other techniques on a contour: the paper's procedure, and the known technique.


def technique_message(
    prepared: PreparedJob,
    cut: CutResult,
    nodes: Contour,
    graph: LayeredGraph,
    method: Literal["paper", "known"],
    *,
    revision: int,
) -> TechniqueMessage:
    """Return the course of a technique along a contour, on the layered graph of its plan."""
    asked, notes = _without(cut.request.options, prepared, method)
    job, first = prepared.job, float(nodes.s[0])
    plain, own = job.robot, job.robot.dynamics
    limits = replace(plain.limits, jerk=None)
    robot = replace(plain, limits=limits, dynamics=replace(own, load=None))
    base = TechniqueMessage(
        revision=revision, contour=cut.contour, method=method, s=[], gamma=[], posture=[],
        cost=None, peak_velocity=[], peak_acceleration=[], statement="", notes=notes,
    )  # fmt: skip
    try:
        made = plan(
            nodes, robot, tool=job.tool, placement=job.placement, speed=cut.candidate.speed,
            options=asked, graph=graph,
        )  # fmt: skip
    except NoFeasiblePath as broken:
        return base.model_copy(update={"statement": str(broken)})
    criteria = made.criteria
    found = {
        "s": flat(made.contour.s - first),
        "gamma": flat(made.gamma),
        "posture": made.posture.tolist(),
        "cost": made.cost,
        "peak_velocity": flat_or_none(criteria.peak_velocity),
        "peak_acceleration": flat_or_none(criteria.peak_acceleration),
        "statement": made.proof.statement,
    }
    return base.model_copy(update=found)


def _without(
    options: PlanOptions, prepared: PreparedJob, method: Literal["paper", "known"]
) -> tuple[PlanOptions, list[str]]:
    """Return the options that the technique can use, and a note on those that it ignores."""
    comfort = options.comfort
    asked = replace(
        options, method=method, refine=False, refine_parts=1, certify=None,
        closure="free", rotation=None, feed="constant", interruptions="none", least_piece=None,
        between_nodes="reported",
        comfort=None if comfort is None else replace(comfort, clearance=None),
    )  # fmt: skip
    kept = {
        "the closure of the motion": options.closure == "free",
        "limits on the rotation of endless joints": options.rotation is None,
        "feed reductions": options.feed == "constant",
        "interruptions": options.interruptions == "none",
        "limits between the nodes": options.between_nodes != "guaranteed",
        "limits on torque": prepared.job.robot.dynamics.load is None,
        "limits on jerk": prepared.job.robot.limits.jerk is None,
        "collisions in the cell": prepared.cell is None,
    }
    left = [words for words, none in kept.items() if not none]
    return asked, [f"It ignores {', '.join(left)}."] if left else []
