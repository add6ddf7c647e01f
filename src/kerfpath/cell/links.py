"""Links of a robot as bodies: those of its description, or capsules along its joint chain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from kerfpath.arrays import Array
from kerfpath.cell.mesh import Mesh, close_surface, read_surface, size_of
from kerfpath.cell.scene import Body
from kerfpath.cell.shapes import Capsule, Hull, Shape, box, frustum
from kerfpath.errors import InputError
from kerfpath.robots import CarriedChain, Robot, chain_of
from kerfpath.urdf import LinkBody as Described

# -----------------------------------------------------------------------------
# Shave solids: remove material from their surface to a depth.

DEEPEST = 8e-3
"""m: a mesh is not shaved deeper, as its walls may be thin."""
EVEN = 3e-3
"""Regularisation: it keeps a vertex from sliding if its triangles hardly differ in direction."""
FARTHEST = 2.0
"""Largest motion of a vertex at a sharp corner, in multiples of the depth."""
CORE = 1e-4
"""m: radius of the ball that must be left of a convex solid."""


def shave(shape: Shape, depth: float) -> Shape | None:
    """Return what is left of a solid when its faces are moved inwards by `depth` (m).

    This is exact for capsules and convex solids: every point deeper behind all faces stays. The
    triangles of a mesh move as well as its vertices allow, no vertex by more than twice the depth.
    None if nothing would be left, or if the depth is too large for a mesh.
    """
    if isinstance(shape, Capsule):
        left = shape.radius - depth
        return Capsule(start=shape.start, end=shape.end, radius=left) if left > CORE else None
    if isinstance(shape, Hull):
        return _core(shape, depth)
    if depth > DEEPEST:
        return None
    return Mesh(
        vertices=shape.vertices + depth * _inward(shape),
        triangles=shape.triangles,
        deviation=shape.deviation,
        name=shape.name,
    )


def _inward(mesh: Mesh) -> Array:
    """Return vertex motions (V, 3) that move the triangles about each vertex inwards by about 1."""
    corners = mesh.vertices[mesh.triangles]
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    if (a * normal).sum() > 0:  # six times the volume: positive where they point outwards
        normal = -normal
    area = np.linalg.norm(normal, axis=1)
    held = area > 0
    unit = normal[held] / area[held, None]
    # At each vertex, solve n . x = 1 by least squares, each triangle weighted by its angle there.
    planes, pull = np.zeros((len(mesh.vertices), 3, 3)), np.zeros((len(mesh.vertices), 3))
    for i in range(3):
        one, two = (corners[held, (i + k) % 3] - corners[held, i] for k in (1, 2))
        angle = np.arctan2(area[held], (one * two).sum(axis=1))
        at = mesh.triangles[held, i]
        np.add.at(planes, at, angle[:, None, None] * unit[:, :, None] * unit[:, None, :])
        np.add.at(pull, at, angle[:, None] * unit)
    planes += (EVEN * np.trace(planes, axis1=1, axis2=2) + 1e-12)[:, None, None] * np.eye(3)
    move = np.linalg.solve(planes, pull[..., None])[..., 0]
    length = np.linalg.norm(move, axis=1, keepdims=True)
    return np.asarray(move * np.minimum(1.0, FARTHEST / np.maximum(length, 1e-12)))


def _core(hull: Hull, depth: float) -> Hull | None:
    """Return the points of a convex solid that are `depth` (m) or more behind each of its faces."""
    planes, heart, radius = _centre_and_planes(hull)
    if radius - depth <= CORE:
        return None
    try:
        return Hull(
            HalfspaceIntersection(planes + np.array([0.0, 0.0, 0.0, depth]), heart).intersections
        )
    except (QhullError, InputError):
        return None


@lru_cache(maxsize=64)
def _centre_and_planes(hull: Hull) -> tuple[Array, Array, float]:
    """Return the planes (F, 4) of a convex solid, and centre (3,) m and radius (m) of a ball in it.

    It is the largest such ball: its centre stays the deepest point at any depth of shaving.
    """
    planes = np.unique(ConvexHull(hull.points).equations, axis=0)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.c_[planes[:, :3], np.ones(len(planes))],
        b_ub=-planes[:, 3],
        bounds=[(None, None)] * 4,
    )
    if found.x is None:
        return planes, hull.points.mean(axis=0), 0.0
    return planes, found.x[:3], float(found.x[3])


# -----------------------------------------------------------------------------
# The bodies of links.

Pair = tuple[str, str]
Line = tuple[str, int, tuple[float, ...], tuple[float, ...], float]
"""Name, frame of the model, start and end in it (m), radius (m)."""

FRACTIONS = (0.10, 0.09, 0.07, 0.055, 0.055, 0.04, 0.04)
"""Radius of each link's capsule, as a share of the length of the arm's two long links: typical of
heavy arms, and rather too thick than too thin. Real links still project from them: by makers'
meshes, up to half of the poses that are clear by capsules collide."""
POINT = 1e-9
"""m: there is no link to draw between joints closer than this."""


def link_bodies(robot: Robot, *, hulls: bool = True) -> tuple[Body, ...]:
    """Return the links: bodies of the description, and capsules for links that have none there.

    Parameters
    ----------
    robot : Robot
    hulls : bool
        Use the convex hull of each link's mesh, which encloses the link, and mark it approximate.
        False: use the meshes themselves, which must be closed.

    Raises
    ------
    InputError
        A mesh that cannot be read, is empty, too large or too small, or is not closed although it
        must be; an arm without length.
    """
    found = [
        Body(
            name=name,
            shape=_shape(described, hulls),
            frame=_frame(robot, described),
            kind="robot",
            approximate=described.kind == "mesh" and hulls,
        )
        for name, described in _named(robot)
    ]
    held = {body.frame for body in found}
    return (*found, *(body for body in link_capsules(robot) if body.frame not in held))


def allowed_pairs(robot: Robot, links: Mapping[Pair, str]) -> dict[Pair, str]:
    """Turn pairs of links into pairs of bodies of `link_bodies(robot)`, for `may_touch`.

    A link without a body in the description has no pair, even if a capsule replaces it.

    Parameters
    ----------
    robot : Robot
    links : mapping of (link, link) to str
        Names of the links in the description, and why they may touch; see
        `kerfpath.urdf.read_srdf`.
    """
    bodies: dict[str, list[str]] = {}
    for name, described in _named(robot):
        bodies.setdefault(described.link, []).append(name)
    return {
        (a, b): why
        for (one, two), why in links.items()
        for a in bodies.get(one, [])
        for b in bodies.get(two, [])
    }


def _named(robot: Robot) -> Iterator[tuple[str, Described]]:
    """Yield the bodies of a description with the names of their links, numbered from the second."""
    count: Counter[str] = Counter()
    for described in robot.bodies:
        count[described.link] += 1
        number = count[described.link]
        yield described.link if number == 1 else f"{described.link} {number}", described


def link_capsules(robot: Robot) -> tuple[Body, ...]:
    """Return the links as capsules along the joint chain, marked as not enclosing the real ones.

    Radii are typical for the arm's lengths; for reliable results, use the meshes of the robot's
    description.

    Raises
    ------
    InputError
        An arm without length.
    """
    arm, base = robot.arm, len(robot.externals)
    chain, zero = arm.joint_chain(), np.zeros((1, arm.joints))
    places = np.tile(np.eye(4), (arm.joints + 1, 1, 1))
    if robot.kinematics in _LINES:
        lines = _LINES[robot.kinematics](robot.geometry)
        # Model and description have frames of different pose for the same links.
        model = arm.model_chain().frames(zero)[0]
        places = np.linalg.inv(chain.frames(zero)[0]) @ model
        places[0] = robot.T_base_foot
    else:
        lines = _along(chain.origins[:, :3, 3], chain.end[:3, 3])
    if not all(radius > 0 for *_, radius in lines):
        raise InputError(
            f"robot {robot.id!r}: its links have no length, so none can be drawn; pass links="
        )
    return tuple(
        Body(
            name=name,
            shape=Capsule(start=np.array(a), end=np.array(b), radius=radius).moved(places[frame]),
            frame=base + frame,
            kind="robot",
            approximate=True,
            holds=False,
        )
        for name, frame, a, b, radius in lines
    )


def _along(steps: Array, end: Array) -> list[Line]:
    """Return a line from each joint to the next, given by `steps` (n, 3) m and `end` (3,) m."""
    lengths = np.linalg.norm([*steps, end], axis=1)
    arm = float(np.sort(lengths[1:-1])[-2:].sum())
    return [
        (f"link {i}" if i else "base", i, (0.0, 0.0, 0.0), tuple(to), FRACTIONS[min(i, 6)] * arm)
        for i, (to, length) in enumerate(zip([*steps, end / 2], lengths, strict=True))
        if i == 0 or length > POINT
    ]


def _opw(g: Mapping[str, float]) -> list[Line]:
    arm = g["c2"] + g["c3"]
    base, shoulder, upper, fore, _, wrist, _ = (fraction * arm for fraction in FRACTIONS)
    here, elbow = (0.0, 0.0, 0.0), (g["a2"], 0.0, 0.0)
    return [
        ("base", 0, here, (0.0, 0.0, g["c1"] / 2), base),
        ("link 1", 1, (0.0, 0.0, g["c1"]), (g["a1"], g["b"], g["c1"]), shoulder),
        ("link 2", 2, here, (0.0, 0.0, g["c2"]), upper),
        ("link 3 elbow", 3, here, elbow, fore),
        ("link 3", 3, elbow, (g["a2"], 0.0, g["c3"]), fore),
        ("link 5", 5, here, (0.0, 0.0, g["c4"] / 2), wrist),
    ]


def _srs(g: Mapping[str, float]) -> list[Line]:
    """Return lines from joint to joint; the outer halves of the long links turn with axes 3, 5."""
    arm = g["c2"] + g["c3"]
    base, shoulder, upper, fore, _, wrist, _ = (fraction * arm for fraction in FRACTIONS)
    here = (0.0, 0.0, 0.0)
    return [
        ("base", 0, here, (0.0, 0.0, g["c1"] / 2), base),
        ("link 1", 1, (0.0, 0.0, g["c1"] / 2), (0.0, 0.0, g["c1"]), shoulder),
        ("link 2", 2, here, (0.0, 0.0, g["c2"] / 2), upper),
        ("link 3", 3, (0.0, 0.0, g["c2"] / 2), (0.0, 0.0, g["c2"]), upper),
        ("link 4", 4, here, (0.0, 0.0, g["c3"] / 2), fore),
        ("link 5", 5, (0.0, 0.0, g["c3"] / 2), (0.0, 0.0, g["c3"]), fore),
        ("link 6", 6, here, (0.0, 0.0, g["c4"] / 2), wrist),
    ]


def _ur(g: Mapping[str, float]) -> list[Line]:
    """Return lines beside the Denavit-Hartenberg ones: the links lie next to each other along d4.

    Sizes follow the maker's meshes of UR3, UR5 and UR10. Corners of the joint housings project,
    because capsules that enclosed them would overlap at many clear poses.
    """
    d, upper, fore = g["d4"], 1.15 * g["d4"], 0.08 * g["d4"]
    return [
        ("base", 0, (0.0, 0.0, 0.0), (0.0, 0.0, g["d1"] / 4), 0.55 * d),
        ("link 1", 1, (0.0, 0.0, g["d1"] - d / 4), (0.0, 0.0, g["d1"] + d / 4), 0.55 * d),
        ("link 2", 2, (0.0, 0.0, upper), (g["a2"], 0.0, upper), 0.7 * d),
        ("link 3", 3, (0.0, 0.0, fore), (g["a3"], 0.0, fore), 0.47 * d),
        ("link 4", 4, (0.0, 0.0, 0.75 * d), (0.0, 0.0, 1.15 * d), 0.35 * d),
        ("link 5", 5, (0.0, 0.0, g["d5"] - d / 4), (0.0, 0.0, g["d5"] + d / 6), 0.36 * d),
        ("link 6", 6, (0.0, 0.0, g["d6"] / 2), (0.0, 0.0, g["d6"] - d / 5), 0.27 * d),
    ]


_LINES: dict[str, Callable[[Mapping[str, float]], list[Line]]] = {
    "opw": _opw,
    "five": _opw,
    "ur": _ur,
    "srs": _srs,
}


def _frame(robot: Robot, body: Described) -> int:
    """Return the frame of a body of a description: the arm's, an external axis's or the ground."""
    if body.on is None:
        return len(robot.externals) + body.joint
    chain = chain_of(robot)
    if not body.on:
        return chain.still
    for axis in robot.externals:
        if axis.joint == body.on and isinstance(chain, CarriedChain):
            return chain.frame_on(axis.name)
    raise InputError(
        f"robot {robot.id!r}: link {body.link!r} moves with joint {body.on!r}, which is not one of "
        "its external axes; read the description with that axis, or use Robot.alone()"
    )


def _shape(body: Described, hulls: bool) -> Shape:
    """Return a collision body of a description as a solid in the frame of its joint."""
    if body.kind == "box":
        return box(body.size, body.pose)
    if body.kind == "sphere":
        return Capsule(start=body.pose[:3, 3], end=body.pose[:3, 3], radius=float(body.size[0]))
    if body.kind == "cylinder":
        radius, length = body.size.tolist()
        half = length / 2 * body.pose[:3, 2]
        return frustum(body.pose[:3, 3] - half, body.pose[:3, 3] + half, (radius, radius))
    if body.path is None:
        raise InputError(f"link {body.link!r}: expected the file of its mesh, got none")
    name = f"link {body.link!r}, {body.path.name}"
    vertices, triangles = read_surface(body.path, name)
    if not hulls:
        return close_surface(vertices, triangles, body.size, name).moved(body.pose)
    with np.errstate(over="ignore"):  # what becomes infinite is refused for its size
        vertices = vertices * body.size
    size_of(vertices, triangles, name)
    try:
        return Hull(vertices[np.unique(triangles)]).moved(body.pose)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
