"""Compute the nodes in reach at a placement, fast enough for interactive dragging."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from kerfpath._arrays import Array, Ints
from kerfpath._repr import short_repr
from kerfpath.job import CutRequest, Job, PreparedJob
from kerfpath.study._evaluator import out_of_reach
from kerfpath.study.placing._place import (
    Numbers,
    middle_of,
    motions_of,
    move_job,
    numbers_of,
)

__all__ = ["Placement", "placement_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placement:
    """Placements of a job's part, robot base and head, and the reach at them.

    Parameters
    ----------
    job : Job
    requests : tuple of CutRequest
        The contours of the job.
    middle : (3,) m
        Centre of the rotations of the part, in the robot base.
    """

    job: Job
    requests: tuple[CutRequest, ...]
    middle: Array

    __repr__ = short_repr

    def numbers(self, offsets: Mapping[str, float]) -> Numbers:
        """Return the changes of the job file, as `numbers_of`."""
        return numbers_of(self.job, offsets, self.middle)

    def motions(self, offsets: Mapping[str, float]) -> tuple[Array, Array]:
        """Return the motions of the part and of the rest, as `motions_of`."""
        return motions_of(offsets, self.middle)

    def out_of_reach(self, offsets: Mapping[str, float]) -> list[Ints]:
        """Return, for each contour, the nodes that the robot reaches at no gamma and posture.

        Gamma is sampled as in the job, within its windows, and external axes on a coarse grid. The
        job's postures and joint margins are kept. Collisions are not checked.
        """
        moved = move_job(self.job, self.numbers(offsets))
        return [
            out_of_reach(moved, request.candidates[0].nodes, request.options.without_penalties)
            for request in self.requests
        ]


def placement_of(prepared: PreparedJob) -> Placement:
    """Return the `Placement` object of a prepared job."""
    nodes = [request.candidates[0].nodes for request in prepared.contours]
    return Placement(
        job=prepared.job,
        requests=tuple(prepared.contours),
        middle=middle_of(prepared.job, nodes),
    )
