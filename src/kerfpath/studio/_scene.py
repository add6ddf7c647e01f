"""The scene of a job: robot, head, part and fixtures as meshes, and the contours to cut."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array
from kerfpath.cell import Body, CuttingHead, link_bodies, surface
from kerfpath.job import CutRequest, Job, PreparedJob
from kerfpath.robots import chain_of
from kerfpath.studio._messages import (
    BodyEntry,
    ContourEntry,
    JointEntry,
    RobotEntry,
    SampleEntry,
    SceneMessage,
)
from kerfpath.studio._numbers import flat

__all__ = ["Meshes", "scene_of"]

Kind = Literal["robot", "head", "part", "fixture", "floor"]
SAMPLE = 0.3
"""rad: every joint of the sample pose, from the middle of its range; anything but zero will do."""


class Meshes(dict[str, bytes]):
    """Meshes by their ids, as `/mesh/ID` serves them; an id says what is in it."""

    def add(self, vertices: ArrayLike, triangles: ArrayLike) -> str:
        """Keep vertices (V, 3) m and triangles (F, 3), and return their id."""
        points = np.ascontiguousarray(vertices, dtype="<f4")
        corners = np.ascontiguousarray(triangles, dtype="<u4")
        counts = np.array([len(points), len(corners)], "<u4")
        data = counts.tobytes() + points.tobytes() + corners.tobytes()
        name = hashlib.sha256(data).hexdigest()[:24]
        self[name] = data
        return name


def scene_of(prepared: PreparedJob, revision: int) -> tuple[SceneMessage, Meshes]:
    """Return what there is to see of a job, and its meshes.

    Without a [cell] the robot's links are those of its description, or capsules, and the head is
    a generic one: to look at, and nothing is kept clear of them.

    Raises
    ------
    InputError
        A robot whose joints nothing says the places of.
    """
    job, meshes = prepared.job, Meshes()
    bodies = [
        _entry(body.name, body.kind, body.frame, meshes.add(*surface(body.shape)), body.approximate)
        for body in _bodies(prepared)
    ]
    vertices, triangles = prepared.part.mesh()
    if len(triangles):
        placed = _placed(vertices, job.placement)
        bodies.append(_entry("part", "part", 0, meshes.add(placed, triangles), False))
    message = SceneMessage(
        revision=revision,
        robot=_robot(job),
        sample=_sample(job),
        bodies=bodies,
        T_part=flat(job.placement),
        contours=[
            _contour(request, index, job.placement)
            for request, index in zip(prepared.contours, tables_of(prepared), strict=True)
        ],
        cell=job.cell is not None,
    )
    return message, meshes


def tables_of(prepared: PreparedJob) -> list[int]:
    """Return the place in the job of the table that each contour comes from."""
    tables = [spec.table for spec in prepared.job.contours]
    found = []
    for request in prepared.contours:
        table = request.task.table
        # A table whose nodes had to be nearer is a copy of the one in the job.
        same = [i for i, one in enumerate(tables) if one is table]
        named = [i for i, one in enumerate(tables) if (one.name or one.pick) == request.task.name]
        found.append((same or named or _picking(tables, request))[0])
    return found


def _picking(tables: Sequence[object], request: CutRequest) -> list[int]:
    """Return the tables that pick what the table of a request picks."""
    pick = request.task.table.pick_all
    return [i for i, one in enumerate(tables) if getattr(one, "pick_all", None) == pick]


def _bodies(prepared: PreparedJob) -> Sequence[Body]:
    """Return what stands and moves beside the part, which is drawn as the drawing has it."""
    job = prepared.job
    if prepared.cell is not None:
        return [body for body in prepared.cell.bodies if body.kind != "part"]
    chain = chain_of(job.robot)
    return [*link_bodies(job.robot), *CuttingHead().bodies(chain, job.tool)]


def _entry(name: str, kind: Kind, frame: int, mesh: str, approximate: bool) -> BodyEntry:
    return BodyEntry(name=name, kind=kind, frame=frame, mesh=mesh, approximate=approximate)


def _placed(points: Array, T: Array) -> Array:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def _contour(request: CutRequest, index: int, placement: Array) -> ContourEntry:
    nodes = request.candidates[0].nodes
    return ContourEntry(
        name=request.task.name,
        index=index,
        closed=nodes.closed,
        points=flat(_placed(nodes.points, placement)),
        axes=flat(nodes.axes @ placement[:3, :3].T),
        s=flat(nodes.s - nodes.s[0]),
        kind=list(nodes.kinds),
        speed_m_min=request.task.speed * 60,
    )


def _robot(job: Job) -> RobotEntry:
    robot, chain = job.robot, chain_of(job.robot)
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    joints = []
    for i in range(robot.joints):
        endless = bool(robot.endless[i])
        joints.append(
            JointEntry(
                T=flat(chain.origins[i], 15),
                axis=flat(chain.axes[i], 15),
                lower=None if endless else float(limits.lower[i]),
                upper=None if endless else float(limits.upper[i]),
                endless=endless,
                velocity=float(velocity[i]),
                acceleration=float(acceleration[i]),
            )
        )
    return RobotEntry(
        id=robot.id, joints=joints, T_flange=flat(chain.end, 15), T_tool=flat(job.tool, 15)
    )


def _sample(job: Job) -> SampleEntry:
    """Return a pose by the robot's own kinematics, for the page to hold its own against."""
    robot = job.robot
    limits = robot.joint_limits()
    middle = np.where(robot.endless, 0.0, (limits.lower + limits.upper) / 2)
    q = middle + SAMPLE
    return SampleEntry(q=flat(q, 15), T=flat(robot.forward(q) @ job.tool, 15))
