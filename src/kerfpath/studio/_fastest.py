"""The fastest constant speed of a contour, as an edit of the job."""

from __future__ import annotations

from dataclasses import replace

from kerfpath.errors import NoFeasiblePath
from kerfpath.job import PreparedJob, fastest_along
from kerfpath.planner import at_most
from kerfpath.studio._messages import EditEntry, FastestMessage

__all__ = ["fastest_message"]


def fastest_message(
    prepared: PreparedJob, contour: str, index: int, revision: int
) -> FastestMessage:
    """Return how fast a contour can be cut at a constant speed, and what binds.

    Raises
    ------
    NoFeasiblePath
        At no speed.
    """
    job = prepared.job
    request = next(each for each in prepared.contours if each.task.name == contour)
    nodes = request.task.evenly_fast(prepared.part)
    leaves = job.options.refine or job.options.method == "continuous"
    try:
        own = replace(job, options=request.options)
        found = fastest_along(own, nodes, prepared.cell, refine=leaves)
    except NoFeasiblePath as broken:
        raise broken.with_message(f"{contour}: no speed: {broken}") from None
    speed = float(at_most(found.speed * 60))
    place = " ".join(f"{mm:.1f}" for mm in (nodes.points[found.node] * 1e3).tolist())
    return FastestMessage(
        revision=revision,
        contour=contour,
        speed_m_min=speed,
        on_grid_m_min=None if found.on_grid is None else float(at_most(found.on_grid * 60)),
        binds=f"the {found.limit} of {job.robot.joint_names[found.joint]} at node {found.node}, "
        f"{place} mm",
        edits=[EditEntry(path=["contour", index, "speed_m_min"], value=speed)],
    )
