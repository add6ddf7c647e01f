"""Where a part may move so that the robot has poses all along its contours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, Bools, short_repr, spread
from kerfpath.cell import Capsule, link_capsules
from kerfpath.contour import Contour
from kerfpath.job.format import Job
from kerfpath.options import PlanOptions
from kerfpath.progress import may_stop
from kerfpath.robots import Robot

STEP, FARTHEST = 0.02, 3.0
"""Step and largest length of the moves that are tried, m."""
COARSE = np.radians(10.0)
"""Least step of gamma, rad, with which places are looked at first."""
PLACES = 12
"""Nodes of each contour that are looked at first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Move:
    """A move of the part after which every node has poses.

    Parameters
    ----------
    by : (3,) m
        In the robot base, whole mm.
    where : str
        Where it leads, such as "up".
    """

    by: Array
    where: str

    __repr__ = short_repr

    @property
    def words(self) -> str:
        """How far it leads, and where."""
        return f"{np.linalg.norm(self.by) * 1e3:.0f} mm {self.where}"

    def __str__(self) -> str:
        """Return what the move is and what comes of it."""
        by = " ".join(f"{v:g}" for v in self.by * 1e3 + 0.0)
        return (
            f"with the part moved {self.words} (by {by} mm in the robot base, see xyz_mm in "
            "[part]) every node has poses"
        )


def move_into_reach(job: Job, contours: Sequence[tuple[Contour, PlanOptions]]) -> Move | None:
    """Return the shortest move of the part after which every node has poses, if one is known.

    It leads towards axis 1 of the robot or away from it, up or down. It is tried at every node of
    the contours, with all that their options ask of a pose; it is quickest if those without poses
    come first. No node comes to where the robot's base and link 1 are; otherwise it says nothing
    about motions and collisions. None is known with external axes.
    """
    if job.robot.free.size:
        return None
    for where, by in _moves(job, contours):
        may_stop()
        moved = replace(job, placement=_shifted(job.placement, by))
        if all(_reaches(moved, *each, PLACES) for each in contours) and all(
            _reaches(moved, *each) for each in contours
        ):
            return Move(by=by, where=where)
    return None


def _reaches(job: Job, nodes: Contour, options: PlanOptions, places: int = 0) -> bool:
    """Return whether every node has poses; with `places`, only so many, at a coarse gamma."""
    some = None
    if places:
        some = spread(len(nodes), places)
        options = replace(options, gamma_step=max(COARSE, options.gamma_step))
    return job.graph(nodes, options, only=some).has_poses_throughout


def _moves(
    job: Job, contours: Sequence[tuple[Contour, PlanOptions]]
) -> Iterator[tuple[str, Array]]:
    """Yield moves (3,) m in whole mm, the shortest first, and where they lead."""
    points = np.concatenate([nodes.points for nodes, _ in contours])
    points = points @ job.placement[:3, :3].T + job.placement[:3, 3]
    x, y, _ = points.mean(axis=0)
    column = _Column.of(job.robot)
    towards = -np.array([x, y, 0.0]) / max(np.hypot(x, y), STEP)
    up = np.array([0.0, 0.0, 1.0])
    ways = {
        "towards the robot": towards,
        "away from the robot": -towards,
        "up": up,
        "down": -up,
    }
    for far in STEP * np.arange(1, round(FARTHEST / STEP) + 1):
        for where, way in ways.items():
            by = np.round(far * way, 3)
            beyond = where == "towards the robot" and far >= np.hypot(x, y)
            if not beyond and not column.holds(points + by).any():
                yield where, by


@dataclass(frozen=True, slots=True)
class _Column:
    """The upright cylinder about the base's z that holds base and link 1, of typical sizes, m."""

    radius: float
    low: float
    high: float

    @classmethod
    def of(cls, robot: Robot) -> _Column:
        frames = robot.arm.joint_chain().frames(np.zeros((1, robot.arm.joints)))[0]
        ends, radii = np.empty((0, 3)), list[float]()
        for body in link_capsules(robot):
            frame = body.frame - len(robot.externals)
            if frame <= 1 and isinstance(body.shape, Capsule):
                placed = body.shape.moved(frames[frame])
                ends = np.vstack([ends, placed.start, placed.end])
                radii += [placed.radius, placed.radius]
        return cls(
            float((np.hypot(ends[:, 0], ends[:, 1]) + radii).max()),
            float((ends[:, 2] - radii).min()),
            float((ends[:, 2] + radii).max()),
        )

    def holds(self, points: Array) -> Bools:
        """Return which of the points (m, 3) m it holds."""
        level = (self.low < points[:, 2]) & (points[:, 2] < self.high)
        return np.asarray(level & (np.hypot(points[:, 0], points[:, 1]) < self.radius))


def _shifted(placement: Array, move: Array) -> Array:
    T = placement.copy()
    T[:3, 3] += move
    return T
