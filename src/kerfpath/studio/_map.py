"""The map of a contour: the reason of loss of every pose, and one pose in detail."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence

import numpy as np

from kerfpath._arrays import Array
from kerfpath.contour import Contour
from kerfpath.graph import LayeredGraph
from kerfpath.job import CutResult, Job
from kerfpath.losses import Loss, Reason
from kerfpath.robots import Robot, posture_name
from kerfpath.studio._map_messages import ShadeName
from kerfpath.studio._messages import CodeLayer, CourseEntry, MapMessage, PoseMessage
from kerfpath.studio._numbers import flat

__all__ = ["map_id", "map_message", "pose_message", "with_collisions"]

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

UNITS = {"rad": (180 / np.pi, "deg"), "m": (1e3, "mm")}
"""Factor from the SI unit to the unit that is shown, and that unit."""


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
        held = (UNITS[axis.unit] for axis in robot.externals)
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
    arm = job.robot if x is None else job.robot.held(x)
    H = job.placement @ nodes.frames(job.options.frames)[node : node + 1]
    solved, reach = arm.inverse_nodes(
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
