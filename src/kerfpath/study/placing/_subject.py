"""The contours of a job as the study of its layout looks at them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from kerfpath._arrays import Array
from kerfpath._told import told
from kerfpath.contour import Contour, FrameKind
from kerfpath.job import Job
from kerfpath.planner import node_interval
from kerfpath.study._job import loaded

__all__ = ["Subject", "middle_of", "subjects_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subject:
    """A contour as it is looked at: its nodes, and its asked speed in m/s."""

    name: str
    nodes: Contour
    speed: float

    __repr__ = told

    @property
    def interval(self) -> float:
        """Time from node to node at the speed asked for, s."""
        return node_interval(self.nodes, self.speed if self.nodes.time is None else None)

    def stretch(self, first: int, last: int, frames: FrameKind, *, timed: bool) -> Subject:
        """Return some of its nodes, each step to take as long as a step of the contour does.

        With `timed` as long as one takes at the speed asked for; else its steps count as long as
        they are on the average, so that its speeds are those of the contour.
        """
        run = self.nodes.part(first, last, frames)
        run = replace(run, time=None, speed_share=np.ones(len(run)))
        if timed:
            return replace(self, nodes=run, speed=float(np.diff(run.s).max()) / self.interval)
        step = self.nodes.length / (len(self.nodes) - 1)
        return replace(self, nodes=replace(run, s=np.arange(len(run), dtype=float) * step))


@lru_cache(maxsize=2)
def subjects_of(job: str, digest: str, goal: str) -> tuple[Subject, ...]:
    """Return the contours of a job, sampled: at one speed each, or for "motion" as asked."""
    at = loaded(job, digest)
    tasks = at.job.tasks(at.part)
    motion = goal == "motion"
    return tuple(
        Subject(
            name=task.name,
            nodes=task.sample(task.candidates(at.part)[0]) if motion else task.evenly_fast(at.part),
            speed=task.speed,
        )
        for task in tasks
    )


def middle_of(job: Job, subjects: Sequence[Subject]) -> Array:
    """Return the middle (3,) m, in the base, of the box about all nodes in the part frame."""
    points = np.concatenate([subject.nodes.points for subject in subjects])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    return np.asarray(job.placement[:3, :3] @ middle + job.placement[:3, 3])
