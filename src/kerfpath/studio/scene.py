"""The scene of a job: robot, head, part and fixtures as meshes, and the contours to cut."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array
from kerfpath.cell import (
    Body,
    Capsule,
    CuttingHead,
    colours_of,
    drawn_links,
    link_bodies,
    surface,
)
from kerfpath.errors import InputError
from kerfpath.job import CutRequest, Job, PreparedJob
from kerfpath.robots import ExternalAxis, Robot, carried, chain_of
from kerfpath.studio.entries import job_file
from kerfpath.studio.messages import (
    BodyEntry,
    ContourEntry,
    JointEntry,
    RobotEntry,
    SampleEntry,
    SceneMessage,
    flat,
)

SAMPLE = 0.3
"""Offset of every joint of the sample pose from the middle of its range, rad or m; not zero."""


class Meshes(dict[str, bytes]):
    """Meshes by their ids, as `/mesh/ID` serves them; an id is the hash of its mesh."""

    def add(self, vertices: ArrayLike, triangles: ArrayLike) -> str:
        """Add a mesh of vertices (V, 3) m and triangles (F, 3), and return its id."""
        points = np.ascontiguousarray(vertices, dtype="<f4")
        corners = np.ascontiguousarray(triangles, dtype="<u4")
        counts = np.array([len(points), len(corners)], "<u4")
        data = counts.tobytes() + points.tobytes() + corners.tobytes()
        name = hashlib.sha256(data).hexdigest()[:24]
        self[name] = data
        return name


def scene_of(prepared: PreparedJob, revision: int) -> tuple[SceneMessage, Meshes]:
    """Return the scene of a job, and its meshes.

    Raises
    ------
    InputError
        The robot has no kinematic chain to draw, or has a free joint (an arm of seven axes).
    """
    job, meshes = prepared.job, Meshes()
    if prepared.cell is None:
        bodies = _own_bodies(job)
    else:  # the part is drawn from the drawing below
        bodies = [body for body in prepared.cell.bodies if body.kind != "part"]
    entries = list(_entries(job.robot, bodies, meshes))
    vertices, triangles = prepared.part.mesh()
    if len(triangles):
        mesh = meshes.add(_placed(vertices, job.placement), triangles)
        entries.append(BodyEntry(name="part", kind="part", frame=0, mesh=mesh, approximate=False))
    contours = [
        _contour(request, index, job.placement)
        for request, index in zip(prepared.contours, tables_of(prepared), strict=True)
    ]
    return _scene(job, revision, entries, contours), meshes


def scene_of_robot(job: Job, revision: int) -> tuple[SceneMessage, Meshes]:
    """Return the scene before the drawing has been read: the robot and its head.

    Raises
    ------
    InputError
        As for `scene_of`.
    """
    meshes = Meshes()
    entries = list(_entries(job.robot, _own_bodies(job), meshes))
    return _scene(job, revision, entries, []), meshes


def _scene(
    job: Job, revision: int, bodies: list[BodyEntry], contours: list[ContourEntry]
) -> SceneMessage:
    job.robot.require_no_free_joint(f"{job.path}: the studio")
    return SceneMessage(
        revision=revision,
        robot=_robot(job),
        sample=_sample(job),
        bodies=bodies,
        T_part=flat(job.placement),
        contours=contours,
        cell=job.cell is not None,
    )


def tables_of(prepared: PreparedJob) -> list[int]:
    """Return the index of the [[contour]] table that each contour comes from."""
    tables = [spec.table for spec in prepared.job.contours]
    found = []
    for request in prepared.contours:
        table = request.task.table
        # A table whose nodes had to be closer together is a copy of the one in the job.
        same = [i for i, one in enumerate(tables) if one is table]
        named = [i for i, one in enumerate(tables) if (one.name or one.pick) == request.task.name]
        found.append((same or named or _picking(tables, request))[0])
    return found


def _picking(tables: Sequence[object], request: CutRequest) -> list[int]:
    """Return the indices of tables with the same `pick_all` as the table of a request."""
    pick = request.task.table.pick_all
    return [i for i, one in enumerate(tables) if getattr(one, "pick_all", None) == pick]


def _own_bodies(job: Job) -> Sequence[Body]:
    """Return the links of the robot's description, or capsules, and a generic head.

    They are only displayed: collisions with them are not checked.
    """
    robot = job.robot
    if job.source["robot"].get("urdf") and not robot.bodies:
        with suppress(InputError):  # without its meshes the arm is drawn as any other
            robot = job_file(job).robot.resolve(job.path.parent, bodies=True)
    return [*link_bodies(robot), *CuttingHead().bodies(chain_of(job.robot), job.tool)]


def _entries(robot: Robot, bodies: Sequence[Body], meshes: Meshes) -> Iterator[BodyEntry]:
    """Yield bodies as they are drawn: castings and housings in place of capsules of links."""
    colours = dict(zip(("casting", "housing"), colours_of(robot), strict=True))
    capsules = [b for b in bodies if b.kind == "robot" and isinstance(b.shape, Capsule)]
    for body in bodies:
        if body not in capsules:
            yield BodyEntry(
                name=body.name,
                kind=body.kind,
                frame=body.frame,
                mesh=meshes.add(*surface(body.shape)),
                approximate=body.approximate,
                colour=colours["casting"] if body.kind == "robot" else "",
            )
    shaped = {body.frame for body in bodies if body.kind == "robot" and body not in capsules}
    before = len(robot.externals)
    for link in drawn_links(robot) if capsules else ():
        if before + link.frame not in shaped:
            yield BodyEntry(
                name=link.name,
                kind="robot",
                frame=before + link.frame,
                mesh=meshes.add(link.vertices, link.triangles),
                approximate=True,
                colour=colours[link.tone],
            )


def _placed(points: Array, T: Array) -> Array:
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def _contour(request: CutRequest, index: int, placement: Array) -> ContourEntry:
    nodes = request.candidates[0].nodes
    return ContourEntry(
        name=request.task.name,
        index=index,
        loop=request.task.pick,
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
    origins = [*chain.origins, *map(_through, robot.externals)]
    axes = [*chain.axes, *(axis.axis for axis in robot.externals)]
    carries = [None] * robot.family.joints + [axis.carries for axis in robot.externals]
    joints = []
    for i in range(robot.joints):
        endless = bool(robot.endless[i])
        joints.append(
            JointEntry(
                name=robot.joint_names[i],
                unit=robot.units[i],
                carries=carries[i],
                T=flat(origins[i], 15),
                axis=flat(axes[i], 15),
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


def _through(axis: ExternalAxis) -> Array:
    """Return a frame (4, 4) m on an axis, oriented like the robot base."""
    T = np.eye(4)
    T[:3, 3] = axis.point
    return T


def _sample(job: Job) -> SampleEntry:
    """Return a pose by the robot's kinematics, against which the page checks its own."""
    robot = job.robot
    limits = robot.joint_limits()
    middle = np.where(robot.endless, 0.0, (limits.lower + limits.upper) / 2)
    q = middle + SAMPLE
    # Poses refer to the part and the base with every external axis at zero.
    part = carried(robot.externals, q[robot.family.joints :], "part")
    return SampleEntry(q=flat(q, 15), T=flat(part @ robot.forward(q) @ job.tool, 15))
