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
    """Return the fastest constant speed of a contour, and the limit that binds.

    Parameters
    ----------
    prepared : PreparedJob
    contour : str
        Name of the contour.
    index : int
        Index of its [[contour]] table in the job.
    revision : int
        Revision of the job.

    Raises
    ------
    NoFeasiblePath
        The contour cannot be cut at any speed.
    """
    job = prepared.job
    request = next(each for each in prepared.contours if each.task.name == contour)
    nodes = request.task.evenly_fast(prepared.part)
    leaves = job.options.refine or job.options.method == "continuous"
    try:
        own = replace(job, options=request.options)
        found = fastest_along(own, nodes, prepared.cell, refine=leaves)
    except NoFeasiblePath as broken:
        raise broken.with_message(f"{contour}: no speed is feasible: {broken}") from None
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
