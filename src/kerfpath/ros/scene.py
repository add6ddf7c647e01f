"""A moveit_msgs/PlanningScene as what is around a robot, in the form of `kerfpath.pipe`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, floats, integers, positive
from kerfpath.cell import Hull, Shape, box, box_between, cylinder, frustum, surface
from kerfpath.errors import InputError
from kerfpath.names import listed
from kerfpath.urdf import Group, Semantics

ADD = 0
"""The operation of an object that is there."""
PLATE, HALF = 1e-3, 10.0
"""m: thickness of the plate that stands for a plane, and how far it extends from the root."""
TIP = 1e-3
"""Radius at the tip of a cone, as a share of that of its base."""
BALL = 240
"""Number of corners of the body that holds a sphere."""


def around_robot(scene: Any, semantics: Semantics, group: Group) -> dict[str, Any]:
    """Return "bodies" and "disabled" pairs of a planning scene for `kerfpath.pipe.answer`.

    Boxes, spheres, cylinders, cones, meshes and planes are bodies; those of round shapes hold them.
    A plane is a plate below it. What the allowed collision matrix or the SRDF allows may touch.

    Parameters
    ----------
    scene : moveit_msgs/PlanningScene
        A whole scene, such as the service get_planning_scene returns it.
    semantics : Semantics
    group : Group
        The joints that will move.

    Raises
    ------
    InputError
        A part of a scene, an octomap, padding or scaling of links; an object of another shape, in
        an unknown frame, attached to a link that moves and is not fixed to the tip, or with an
        operation; two of one name.
    """
    if scene.is_diff:
        raise InputError("planning scene: expected a whole scene, got a difference (is_diff)")
    if len(scene.world.octomap.octomap.data):
        raise InputError("planning scene: an octomap is not supported; give its objects as shapes")
    if any(one.padding for one in scene.link_padding) or any(
        one.scale != 1 for one in scene.link_scale
    ):
        raise InputError("planning scene: padding and scaling of links are not supported")
    frames = _frames(scene, semantics)
    attached = list(scene.robot_state.attached_collision_objects)
    names = [one.id for one in scene.world.collision_objects] + [one.object.id for one in attached]
    if twice := {name for name in names if names.count(name) > 1 or name in semantics.links}:
        raise InputError(f"planning scene: two bodies are called {min(twice)!r}")
    allowed = {frozenset(pair) for pair in _allowed(scene, [*semantics.links, *names])}
    allowed |= {frozenset(pair) for pair in semantics.disabled}
    bodies = list[dict[str, Any]]()
    for one in scene.world.collision_objects:
        T = _in(one.header.frame_id, frames, one.id)
        bodies += _bodies(one, T, held=False)
    for one in attached:
        held = one.link_name in group.carried
        known = group.carried if held else frames
        if one.link_name not in known:
            raise InputError(
                f"object {one.object.id!r} is attached to {one.link_name!r}: expected a link that "
                f"is fixed to {group.tip!r}, or one that does not move"
            )
        T = _in(one.object.header.frame_id or one.link_name, known, one.object.id)
        bodies += _bodies(one.object, T, held=held)
        touched = [*one.touch_links, one.link_name]
        allowed |= {frozenset((one.object.id, link)) for link in touched}
    for body in bodies:
        pairs = (pair for pair in allowed if body["of"] in pair)
        body["touch"] = sorted(name for pair in pairs for name in pair - {body["of"]})
    between = [sorted(pair) for pair in allowed if pair <= set(semantics.links)]
    disabled = sorted(pair for pair in between if len(pair) == 2)
    return {"bodies": bodies, "disabled": disabled}


def pose(message: Any, what: str) -> Array:
    """Return a geometry_msgs/Pose as (4, 4) m.

    Raises
    ------
    InputError
        A number that is not finite, or a rotation that is no unit quaternion; all zeros stand for
        no rotation, as in a message that is not filled.
    """
    p, r = message.position, message.orientation
    return _pose((p.x, p.y, p.z), (r.x, r.y, r.z, r.w), what)


def _pose(xyz: Sequence[float], xyzw: Sequence[float], what: str) -> Array:
    T = np.eye(4)
    T[:3, 3] = floats(xyz, f"{what}: position", (3,))
    turn = floats(xyzw, f"{what}: orientation", (4,))
    length = float(np.linalg.norm(turn))
    if length and abs(length - 1) > 1e-3:
        raise InputError(f"{what}: expected a unit quaternion, got one of length {length:g}")
    if length:
        T[:3, :3] = Rotation.from_quat(turn).as_matrix()
    return T


def _frames(scene: Any, semantics: Semantics) -> dict[str, Array]:
    """Return the pose in the root of every frame that does not move; "" is the root."""
    frames = {"": np.eye(4), **semantics.frames}
    waiting = list(scene.fixed_frame_transforms)
    while ready := [one for one in waiting if one.header.frame_id in frames]:
        for one in ready:
            t, r = one.transform.translation, one.transform.rotation
            T = _pose((t.x, t.y, t.z), (r.x, r.y, r.z, r.w), f"frame {one.child_frame_id!r}")
            frames.setdefault(one.child_frame_id, frames[one.header.frame_id] @ T)
        waiting = [one for one in waiting if one.child_frame_id not in frames]
    return frames


def _in(frame: str, frames: Mapping[str, Array], name: str) -> Array:
    if frame not in frames:
        known = listed(sorted(filter(None, frames)), 8)
        raise InputError(f"object {name!r}: expected its frame as one of {known}, got {frame!r}")
    return frames[frame]


def _allowed(scene: Any, names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the pairs that the allowed collision matrix allows to touch."""
    matrix = scene.allowed_collision_matrix
    entries = list(matrix.entry_names)
    rows = [list(entry.enabled) for entry in matrix.entry_values]
    usual = list(zip(matrix.default_entry_names, matrix.default_entry_values, strict=False))
    if {len(entries)} != {len(rows), *map(len, rows)} and (entries or rows):
        raise InputError("allowed collision matrix: expected a row and a column for each name")
    if len(matrix.default_entry_names) != len(matrix.default_entry_values):
        raise InputError("allowed collision matrix: expected a value for each default name")
    number = {name: k for k, name in enumerate(entries)}
    default = {name: bool(value) for name, value in usual}
    for one, two in combinations(dict.fromkeys([*names, *entries]), 2):
        if one in number and two in number:
            i, j = number[one], number[two]
            if rows[i][j] and rows[j][i]:
                yield one, two
        else:  # of two defaults both must allow it, as the message says
            said = [default[name] for name in (one, two) if name in default]
            if said and all(said):
                yield one, two


# -----------------------------------------------------------------------------
# The shapes of an object.


def _bodies(message: Any, T: Array, *, held: bool) -> Iterator[dict[str, Any]]:
    """Yield a body for each shape of a moveit_msgs/CollisionObject in frame T."""
    what = f"object {message.id!r}"
    operation = message.operation
    if (operation[0] if isinstance(operation, bytes) else operation) != ADD:
        raise InputError(f"{what}: expected an object that is there (ADD), got another operation")
    T = T @ pose(message.pose, what)
    shapes = list[tuple[Any, Any, Callable[[Any, str], Shape | dict[str, Any]]]]()
    kinds: tuple[tuple[Any, Any, Callable[[Any, str], Shape | dict[str, Any]]], ...] = (
        (message.primitives, message.primitive_poses, _primitive),
        (message.meshes, message.mesh_poses, _mesh),
        (message.planes, message.plane_poses, _plane),
    )
    for kind, places, made in kinds:
        # One shape without a place is at the pose of the object, as MoveIt has it.
        given = list(places) or ([None] if len(kind) == 1 else [])
        if len(given) != len(kind):
            raise InputError(f"{what}: expected a pose for each of its {len(kind)} shapes")
        shapes += [(one, place, made) for one, place in zip(kind, given, strict=True)]
    if not shapes:
        raise InputError(f"{what} has no shape")
    for k, (one, place, made) in enumerate(shapes):
        shape = made(one, what)
        if not isinstance(shape, dict):
            vertices, triangles = surface(shape)
            shape = {"vertices": vertices.tolist(), "triangles": triangles.tolist()}
        own = T if place is None else T @ pose(place, what)
        yield {
            "name": message.id if k == 0 else f"{message.id} {k + 1}",
            "of": message.id,
            "mesh": shape,
            "T": own.tolist(),
            "held": held,
        }


def _primitive(message: Any, what: str) -> Shape:
    """Return the body that holds a shape_msgs/SolidPrimitive."""
    sizes = {1: 3, 2: 1, 3: 2, 4: 2}  # BOX, SPHERE, CYLINDER, CONE
    if message.type not in sizes:
        raise InputError(
            f"{what}: expected a box, sphere, cylinder or cone (1 to 4), got shape {message.type}; "
            "give it as a mesh"
        )
    size = positive(message.dimensions, f"{what}: dimensions", (sizes[message.type],))
    if message.type == 1:
        return box(size)
    if message.type == 2:
        return _ball(float(size[0]))
    height, radius = map(float, size)
    if message.type == 3:
        return cylinder([2 * radius, height])
    end = np.array([0.0, 0.0, height / 2])
    return frustum(-end, end, (radius, TIP * radius))


def _ball(radius: float) -> Hull:
    """Return a body that holds a sphere: evenly spread corners, so far out that no face cuts it."""
    k = np.arange(BALL) + 0.5
    z, turn = 1 - 2 * k / BALL, np.pi * (1 + np.sqrt(5)) * k
    ring = np.sqrt(1 - z**2)
    corners = np.c_[ring * np.cos(turn), ring * np.sin(turn), z]
    hull = Hull(corners)
    a, b, c = (hull.points[hull.triangles[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    near = np.abs((across * a).sum(axis=1)) / np.linalg.norm(across, axis=1)
    return Hull(corners * radius / near.min())


def _mesh(message: Any, what: str) -> dict[str, Any]:
    """Return the surface of a shape_msgs/Mesh; where it is open, its hull is taken for it."""
    vertices = floats([(p.x, p.y, p.z) for p in message.vertices], f"{what}: vertices", (None, 3))
    corners = [list(one.vertex_indices) for one in message.triangles]
    triangles = integers(corners, f"{what}: triangles", (None, 3))
    return {"vertices": vertices.tolist(), "triangles": triangles.tolist()}


def _plane(message: Any, what: str) -> Shape:
    """Return a plate below a shape_msgs/Plane: n * x + d = 0, with its normal n upwards."""
    *normal, d = floats(message.coef, f"{what}: plane", (4,))
    length = float(np.linalg.norm(normal))
    if length < 1e-9:
        raise InputError(f"{what}: the normal of its plane has no length")
    z = np.array(normal) / length
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = np.stack([x, np.cross(z, x), z], axis=1), -d / length * z
    return box_between([-HALF, -HALF, -PLATE], [HALF, HALF, 0.0]).moved(T)
