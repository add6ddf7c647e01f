"""Arms as pictures show them: castings between joint housings, for robots without meshes.

They are for the eye alone: collisions are checked with the bodies of `kerfpath.cell.links`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.cell.shapes import RING, Hull
from kerfpath.robots import Robot

Tone = Literal["casting", "housing"]
COLOURS = {
    "ABB": ("#e8e3da", "#85888c"),
    "FANUC": ("#f2c417", "#4b4e52"),
    "KUKA": ("#ee7226", "#3b3e42"),
    "Staubli": ("#ddd6b8", "#63676c"),
    "Universal Robots": ("#c6cdd4", "#5b9bc8"),
    "Yaskawa": ("#2f6cb3", "#d9dde1"),
}
"""Colours of castings and housings by the names of makers, near those of their arms."""
OTHER = ("#d5dbe2", "#7b8794")
"""Colours of the arms of other makers."""
CHAMFER = 0.86
"""Share of radius and of width at which the edge of a disc is broken."""
MOTOR = 0.16
"""Length of the motors behind the forearm, as a share of the arm's two long links."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrawnLink:
    """A part of a link as it is drawn.

    Parameters
    ----------
    name : str
        "base", "link 1", ...
    frame : int
        Number of the arm's joint that it follows; 0: the base.
    tone : {"casting", "housing"}
    vertices : (V, 3) m
        In the frame of the joint.
    triangles : (F, 3)
    """

    name: str
    frame: int
    tone: Tone
    vertices: Array
    triangles: Ints

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class _Joint:
    """A joint at the ends of its links: in the frame of the model after it, m."""

    parent: tuple[float, float, float] = (0.0, 0.0, 0.0)
    child: tuple[float, float, float] | None = None
    """None: where the parent ends."""
    radius: float
    half: float
    """Half of its width along the axis."""


def colours_of(robot: Robot) -> tuple[str, str]:
    """Return the colours of a robot's castings and housings."""
    return COLOURS.get(robot.manufacturer, OTHER)


def drawn_links(robot: Robot) -> tuple[DrawnLink, ...]:
    """Return castings from joint to joint, and a housing at each joint; sizes are typical ones.

    Each casting is the hull of a disc about the joint before it and one about the joint after it.
    """
    arm = robot.arm
    known = robot.kinematics in _JOINTS
    # All joints of the model are at zero there.
    q = (arm.offset * arm.sign)[None] if known else np.zeros((1, arm.joints))
    own = arm.joint_chain()
    model = arm.model_chain() if known else own
    into = np.linalg.inv(own.frames(q)[0])
    frames, axes = model.frames(q)[0], model.axes
    foot = arm.T_base_foot if known else np.eye(4)
    joints = _JOINTS[robot.kinematics](robot.geometry) if known else _plain(frames)

    def disc(i: int, at: Array, radius: float, half: float) -> Array:
        return _disc(at, frames[i, :3, :3] @ axes[i - 1], radius, half)

    def made(frame: int, tone: Tone, points: Array) -> DrawnLink:
        hull = Hull(points @ into[frame, :3, :3].T + into[frame, :3, 3])
        name = f"link {frame}" if frame else "base"
        return DrawnLink(
            name=name, frame=frame, tone=tone, vertices=hull.points, triangles=hull.triangles
        )

    def ends(i: int) -> tuple[Array, Array]:
        joint = joints[i - 1]
        return _at(frames[i], joint.parent), _at(frames[i], joint.child or joint.parent)

    def links() -> Iterator[DrawnLink]:
        first, up = joints[0], foot[:3, 2]
        start, wide = foot[:3, 3], 1.25 * first.radius
        plate = 0.35 * first.half
        yield made(0, "housing", _disc(start + plate * up, up, 1.12 * wide, plate))
        yield made(0, "casting", np.vstack([
            _disc(start + 2 * plate * up, up, wide, plate),
            disc(1, ends(1)[0], first.radius, first.half),
        ]))  # fmt: skip
        for i, joint in enumerate(joints, 1):
            parent, child = ends(i)
            axis = frames[i, :3, :3] @ axes[i - 1]
            wide, thin = 1.3 * joint.half, 0.84 * joint.radius
            housing = np.vstack([_disc(at, axis, thin, wide) for at in (parent, child)])
            yield made(i, "housing", housing)
            near = disc(i, child, joint.radius, joint.half)
            if i < len(joints):
                after = joints[i]
                far = disc(i + 1, ends(i + 1)[0], after.radius, after.half)
            else:
                tip = (own.frames(q)[0, -1] @ own.end)[:3]
                far = _disc(tip[:, 3], tip[:, 2], 0.9 * joint.radius, 1e-3)
            yield made(i, "casting" if i < len(joints) else "housing", np.vstack([near, far]))
        if robot.kinematics in ("opw", "five"):
            long = MOTOR * (robot.geometry["c2"] + robot.geometry["c3"])
            at, axis, joint = ends(4)[0], frames[4, :3, 2], joints[3]
            ring = np.vstack([
                _disc(at - along * axis, axis, share * joint.radius, joint.half / 2)
                for along, share in ((0.0, 0.9), (long, 0.7))
            ])  # fmt: skip
            yield made(3, "housing", ring)

    return tuple(links())


def _at(frame: Array, point: tuple[float, float, float]) -> Array:
    return np.asarray(frame[:3, :3] @ np.array(point) + frame[:3, 3])


def _disc(at: Array, axis: Array, radius: float, half: float) -> Array:
    """Return the corners (P, 3) of a disc with broken edges; `half` is half of its thickness."""
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    turn = np.arange(RING) * 2 * np.pi / RING
    ring = np.cos(turn)[:, None] * u + np.sin(turn)[:, None] * np.cross(axis, u)
    rims = ((1.0, CHAMFER), (CHAMFER, 1.0))
    return np.vstack([
        at + sign * high * half * axis + share * radius * ring
        for share, high in rims for sign in (-1, 1)
    ])  # fmt: skip


# -----------------------------------------------------------------------------
# The joints of the families, with sizes as shares of the arm's two long links.


def _sized(arm: float, *rows: tuple[tuple[float, float, float], float, float]) -> list[_Joint]:
    return [_Joint(parent=at, radius=radius * arm, half=half * arm) for at, radius, half in rows]


def _opw(g: Mapping[str, float]) -> list[_Joint]:
    return _sized(
        g["c2"] + g["c3"],
        ((0.0, 0.0, 0.5 * g["c1"]), 0.105, 0.05),
        ((0.0, 0.0, 0.0), 0.085, 0.068),
        ((0.0, 0.0, 0.0), 0.066, 0.056),
        ((0.0, 0.0, -0.78 * g["c3"]), 0.058, 0.045),
        ((0.0, 0.0, 0.0), 0.04, 0.038),
        ((0.0, 0.0, 0.6 * g["c4"]), 0.03, 0.012),
    )


def _five(g: Mapping[str, float]) -> list[_Joint]:
    return _opw(g)[:5]


def _srs(g: Mapping[str, float]) -> list[_Joint]:
    return _sized(
        g["c2"] + g["c3"],
        ((0.0, 0.0, 0.5 * g["c1"]), 0.092, 0.05),
        ((0.0, 0.0, 0.0), 0.088, 0.09),
        ((0.0, 0.0, 0.5 * g["c2"]), 0.078, 0.04),
        ((0.0, 0.0, 0.0), 0.078, 0.08),
        ((0.0, 0.0, 0.5 * g["c3"]), 0.068, 0.04),
        ((0.0, 0.0, 0.0), 0.062, 0.066),
        ((0.0, 0.0, 0.7 * g["c4"]), 0.05, 0.02),
    )


def _ur(g: Mapping[str, float]) -> list[_Joint]:
    """Return joints whose links lie beside each other along their axes, as d4 has them."""
    d, upper, fore = g["d4"], 1.15 * g["d4"], 0.08 * g["d4"]

    def joint(radius: float, half: float, parent: float, child: float) -> _Joint:
        ends = ((0.0, 0.0, parent), (0.0, 0.0, child))
        return _Joint(parent=ends[0], child=ends[1], radius=radius * d, half=half * d)

    return [
        joint(0.5, 0.3, 0.55 * g["d1"], 0.55 * g["d1"]),
        joint(0.5, 0.42, 0.1 * d, upper),
        joint(0.42, 0.36, upper, fore),
        joint(0.32, 0.3, fore, 0.95 * d),
        joint(0.32, 0.3, 0.0, g["d5"]),
        joint(0.28, 0.12, 0.6 * g["d6"], 0.6 * g["d6"]),
    ]


def _plain(frames: Array) -> list[_Joint]:
    """Return joints at the origins of their frames, for arms of no family with lengths."""
    steps = np.linalg.norm(np.diff(frames[:, :3, 3], axis=0), axis=1)
    arm = float(np.sort(steps)[-2:].sum())
    shares = np.interp(np.arange(len(steps)), [0, len(steps) - 1], [0.1, 0.04])
    return [_Joint(radius=s * arm, half=0.8 * s * arm) for s in shares.tolist()]


_JOINTS: dict[str, Callable[[Mapping[str, float]], list[_Joint]]] = {
    "opw": _opw,
    "five": _five,
    "srs": _srs,
    "ur": _ur,
}
