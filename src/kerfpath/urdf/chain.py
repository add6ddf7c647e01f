"""The joints of a description that carry the arm or the part, and chains of revolute joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, floats, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.urdf.tree import Joint, Tree

# -----------------------------------------------------------------------------
# The joints of a description that carry the arm or the part, and the places of all links.

FEWEST = 6
"""Number of joints of the smallest arm that is read from a description."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExternalJoint:
    """A joint that carries the arm or the part.

    Parameters
    ----------
    joint : Joint
        The joint as the file has it.
    pose : (4, 4)
        Pose of the joint frame in the base with all such joints at zero, m.
    carries : {"robot", "part"}
    """

    joint: Joint
    pose: Array
    carries: Literal["robot", "part"]

    __repr__ = short_repr


class Place(NamedTuple):
    """What moves a link, and where it is."""

    joint: int
    """Number of arm joints that move it; 0 if none does."""
    on: str | None
    """Name of the external joint that carries it; "" for the ground; None for links of the arm and
    for what the arm stands on."""
    pose: Array
    """(4, 4) m: in the frame of the last arm joint that moves it, else in the base with all
    external joints at zero."""


def carriers_before(tree: Tree, written: Sequence[Joint], mount: str | None) -> int:
    """Return how many moving joints of a chain carry the arm.

    These are the joints above link `mount`; without it, all up to the last prismatic joint, if an
    arm follows.

    Raises
    ------
    InputError
        The link is not in the chain.
    """
    moving = [joint for joint in written if joint.kind != "fixed"]
    if mount is None:
        slides = [i for i, joint in enumerate(moving, 1) if joint.kind == "prismatic"]
        return slides[-1] if slides and len(moving) - slides[-1] >= FEWEST else 0
    links = [joint.parent for joint in written]
    if mount not in links:
        raise InputError(
            f"{tree.path}: mount: expected a link between base and tip, got {mount!r}; there are "
            f"{', '.join(links)}"
        )
    return sum(joint.kind != "fixed" for joint in written[: links.index(mount)])


def under_part(tree: Tree, base: str, part: str | None, chain: Sequence[Joint]) -> list[Joint]:
    """Return the joints from what the base stands on to the link that carries the part, in order.

    Raises
    ------
    InputError
        No such link; a link that the robot moves, that does not move, or that is not connected to
        what the base is fixed to.
    """
    if part is None:
        return []
    if part not in tree.links:
        raise InputError(
            f"{tree.path}: part: there is no link {part!r}; there are "
            f"{', '.join(list(tree.links)[:30])}"
        )
    ground = _fixed_above(tree, base)
    joints: list[Joint] = []
    link = part
    while link not in ground and link in tree.parent:
        joints.append(tree.parent[link])
        link = joints[-1].parent
    own = {joint.name for joint in chain if joint.kind != "fixed"}
    for joint in joints:
        if joint.name in own:
            raise InputError(
                f"{tree.path}: part: expected a link that the robot does not move, got {part!r}, "
                f"which moves with {joint.name!r}; choose the link of the positioner"
            )
    if link not in ground:
        raise InputError(
            f"{tree.path}: part: link {part!r} is not connected to what base {base!r} is fixed to; "
            "choose base above both of them"
        )
    if all(joint.kind == "fixed" for joint in joints):
        raise InputError(
            f"{tree.path}: part: no joint moves {part!r}; leave it out if the part does not move"
        )
    return joints[::-1]


def external_joints(
    tree: Tree, base: str, before: Sequence[Joint], under: Sequence[Joint]
) -> tuple[ExternalJoint, ...]:
    """Return the moving joints of two branches: before the arm, and under the part.

    Raises
    ------
    InputError
        A joint that floats, is planar, or mimics another.
    """
    found = []
    for joints, carries in ((before, "robot"), (under, "part")):
        # The first link of a branch is the base or fixed to it.
        T = _fixed_above(tree, base)[joints[0].parent] if joints else np.eye(4)
        for joint in joints:
            T = T @ joint.origin
            if joint.kind == "fixed":
                continue
            if joint.kind not in ("prismatic", "revolute", "continuous") or joint.mimics:
                how = f"mimics {joint.mimics!r}" if joint.mimics else f"is {joint.kind}"
                raise InputError(
                    f"{tree.path}: joint {joint.name!r} {how}; an external axis slides or turns on "
                    "its own"
                )
            found.append(ExternalJoint(joint=joint, pose=freeze(T), carries=carries))  # type: ignore[arg-type]  # a literal
    return tuple(found)


def places(
    tree: Tree, base: str, written: Sequence[Joint], externals: Sequence[ExternalJoint]
) -> dict[str, Place]:
    """Return the place of every link on the ground, on external joints and on the arm."""
    carried = {external.joint.name: external.carries for external in externals}
    mounts = [name for name, carries in carried.items() if carries == "robot"]
    in_chain = {joint.name for joint in written}
    below: dict[str, list[Joint]] = {}
    for joint in tree.joints:
        below.setdefault(joint.parent, []).append(joint)
    ground = "" if mounts else None
    found = {link: Place(0, ground, T) for link, T in _fixed_above(tree, base).items()}
    open_ = list(found)
    while open_:
        link = open_.pop()
        number, on, T = found[link]
        for joint in below.get(link, []):
            if joint.child in found:
                continue
            if joint.kind == "fixed":
                found[joint.child] = Place(number, on, freeze(T @ joint.origin))
            elif joint.name in carried:
                # What the last joint before the arm carries is what the arm stands on.
                here = None if mounts and joint.name == mounts[-1] else joint.name
                found[joint.child] = Place(0, here, freeze(T @ joint.origin))
            elif joint.name in in_chain:
                found[joint.child] = Place(number + 1, None, freeze(np.eye(4)))
            else:
                continue
            open_.append(joint.child)
    return found


def _fixed_above(tree: Tree, base: str) -> dict[str, Array]:
    """Return the poses (4, 4) m in the base of itself and of links above that it is fixed to."""
    found = {base: freeze(np.eye(4))}
    link = base
    while link in tree.parent and tree.parent[link].kind == "fixed":
        joint = tree.parent[link]
        above = found[link] @ np.linalg.inv(joint.origin)
        link = joint.parent
        found[link] = freeze(above)
    return found


# -----------------------------------------------------------------------------
# A chain of revolute joints: the frames of its links for many joint vectors, and its reach.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KinematicChain:
    """A serial chain of revolute joints; frame 0 is the base, frame i turns with joint i.

    Parameters
    ----------
    origins : (n, 4, 4)
        Pose of each joint frame at angle zero, in the frame of the joint before it, m.
    axes : (n, 3)
        Unit axis of each joint in its own frame.
    end : (4, 4)
        Flange or tip in the frame of the last joint, m.
    """

    origins: Array
    axes: Array
    end: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.origins)
        object.__setattr__(self, "origins", floats(self.origins, "chain origins", (n, 4, 4)))
        object.__setattr__(self, "axes", floats(self.axes, "chain axes", (n, 3)))
        object.__setattr__(self, "end", floats(self.end, "chain end", (4, 4)))

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.axes)

    @property
    def still(self) -> int:
        """Index of the fixed frame: the base."""
        return 0

    @property
    def base(self) -> int:
        """Index of the frame of the robot's base."""
        return 0

    @property
    def order(self) -> Ints:
        """The column of q of each joint of the chain, (n,)."""
        return np.arange(len(self.axes))

    @property
    def slides(self) -> Bools:
        """Whether each joint of the chain is linear, (n,): none is."""
        return np.zeros(len(self.axes), np.bool_)

    def say(self, place: int) -> str:
        """Return the name of a joint of the chain in messages."""
        return f"joint {place + 1}"

    def moves_with(self, frame: int) -> str:
        """Return the name of what a frame moves with."""
        return f"joint {frame}" if frame else "base"

    def spread(self, share: Array) -> Array:
        """Map shares (B, n) from 0 to 1 to joints (B, n) rad over a whole turn each."""
        return np.asarray(2 * np.pi * share - np.pi, dtype=np.float64)

    def bounded(self, q: Array) -> Bools:
        """Return at which of q (B, n) the bounds on motions hold, (B,): at all."""
        return np.ones(len(q), np.bool_)

    @property
    def length(self) -> float:
        """Sum of the lengths (m) from joint to joint and to the end, the reach of the arm."""
        steps = np.linalg.norm(self.origins[1:, :3, 3], axis=1)
        return float(steps.sum() + np.linalg.norm(self.end[:3, 3]))

    def lines(self) -> tuple[Array, Array, Array]:
        """Return a point (n, 3) m and the direction (n, 3) of each joint axis, all joints at zero.

        The third is the pose (4, 4) m of the end there. All are in the base.
        """
        T = self.frames(np.zeros((1, len(self.axes))))[0, 1:]
        along = np.einsum("nij,nj->ni", T[:, :3, :3], self.axes)
        return T[:, :3, 3].copy(), along, T[-1] @ self.end

    def frames(self, q: Array) -> Array:
        """Return the poses (B, n+1, 4, 4) in the base of all frames at q (B, n) rad."""
        B, n = q.shape
        T = np.zeros((B, n + 1, 4, 4))
        T[:, 0] = np.eye(4)
        for i in range(n):
            T[:, i + 1] = T[:, i] @ (self.origins[i] @ turns(self.axes[i], q[:, i]))
        return T

    def forward(self, q: Array) -> Array:
        """Return the poses (B, 4, 4) of the end in the base at q (B, n) rad."""
        return np.asarray(self.frames(q)[:, -1] @ self.end)

    def reach(self, frame: int, points: Array) -> Array:
        """Return bounds (n,) m on the distance of any of points (c, 3) m from each joint's axis.

        The points are in coordinates of `frame`. The bounds hold at every q, as they assume that
        the links between are stretched out; they are zero for joints that do not move the frame.
        """
        arms = np.zeros(len(self.axes))
        length = float(np.linalg.norm(points, axis=1).max())
        for i in range(frame - 1, -1, -1):
            arms[i] = length
            length += float(np.linalg.norm(self.origins[i][:3, 3]))
        return arms


def turns(axis: Array, angle: Array) -> Array:
    """Return the rotations (B, 4, 4) about a unit axis (3,) by angles (B,) rad (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    T = np.zeros((len(angle), 4, 4))
    T[:, :3, :3] = np.eye(3) + s * cross + (1 - c) * (cross @ cross)
    T[:, 3, 3] = 1.0
    return T
