"""What of the contours the robot can reach at a placement: quick enough to follow a hand."""

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
    """Other places of a job's part, robot base and head, and what is in reach there.

    Parameters
    ----------
    job : Job
    requests : tuple of CutRequest
        Its contours.
    middle : (3,) m
        Through which the part turns, in the robot base.
    """

    job: Job
    requests: tuple[CutRequest, ...]
    middle: Array

    __repr__ = short_repr

    def numbers(self, offsets: Mapping[str, float]) -> Numbers:
        """Return what a job file has to say, as `numbers_of`."""
        return numbers_of(self.job, offsets, self.middle)

    def motions(self, offsets: Mapping[str, float]) -> tuple[Array, Array]:
        """Return how the part and the rest move in the robot base, as `motions_of`."""
        return motions_of(offsets, self.middle)

    def out_of_reach(self, offsets: Mapping[str, float]) -> list[Ints]:
        """Return of each contour the nodes that the robot reaches at no gamma and posture.

        Gamma is sampled as the job has it, within its windows, external axes on a coarse grid;
        margins of joints and postures of the job are kept. The cell is not looked at.
        """
        moved = move_job(self.job, self.numbers(offsets))
        return [
            out_of_reach(moved, request.candidates[0].nodes, request.options.without_penalties)
            for request in self.requests
        ]


def placement_of(prepared: PreparedJob) -> Placement:
    """Return the place of a job whose drawing has been read."""
    nodes = [request.candidates[0].nodes for request in prepared.contours]
    return Placement(
        job=prepared.job,
        requests=tuple(prepared.contours),
        middle=middle_of(prepared.job, nodes),
    )
