"""Courses of other techniques on a contour: the paper's procedure, and the known technique."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job import CutResult, PreparedJob
from kerfpath.options import PlanOptions
from kerfpath.planner import plan
from kerfpath.studio._map_messages import TechniqueMessage
from kerfpath.studio._numbers import flat

__all__ = ["technique_message"]


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
    robot = replace(job.robot, load=None, jerk=None)
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
        "peak_velocity": flat(criteria.peak_velocity),
        "peak_acceleration": flat(criteria.peak_acceleration),
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
        "limits on torque": prepared.job.robot.load is None,
        "limits on jerk": prepared.job.robot.jerk is None,
        "collisions in the cell": prepared.cell is None,
    }
    left = [words for words, none in kept.items() if not none]
    return asked, [f"It ignores {', '.join(left)}."] if left else []
