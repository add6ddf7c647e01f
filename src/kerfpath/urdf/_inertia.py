"""Masses of a description: the rigid body on each joint of the chain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from kerfpath._arrays import Array, floats, freeze, positive
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.urdf._carriers import Place
from kerfpath.urdf._xml import Joint, Tree, child, numbers, pose_of

__all__ = ["ChainInertia", "inertia_of", "joined", "require_tensor"]

SOLID = ("visual", "collision")
"""Elements of a link with a shape; a link without any of them is a frame, which has no mass."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChainInertia:
    """The rigid bodies of a chain, one on each joint, in the turned frame of that joint.

    Parameters
    ----------
    mass : (n,) kg
    centre : (n, 3) m
        Centre of mass.
    tensor : (n, 3, 3) kg m^2
        Inertia about the centre of mass, along the axes of the joint frame.

    Raises
    ------
    InputError
        A mass that is not positive, an inertia that is not positive definite, different lengths.
    """

    mass: Array
    centre: Array
    tensor: Array

    __repr__ = short_repr

    def __post_init__(self) -> None:
        n = len(self.mass)
        object.__setattr__(self, "mass", positive(self.mass, "mass", (n,)))
        object.__setattr__(self, "centre", floats(self.centre, "centre", (n, 3)))
        object.__setattr__(self, "tensor", floats(self.tensor, "tensor", (n, 3, 3)))
        for i, tensor in enumerate(self.tensor):
            require_tensor((tensor + tensor.T) / 2, f"body {i + 1}")


def inertia_of(tree: Tree, stand: Mapping[str, Place], joints: list[Joint]) -> ChainInertia:
    """Return the rigid body on each joint of the arm; links that are fixed together are merged.

    Parameters
    ----------
    tree : Tree
    stand : mapping of str to Place
        What moves each link, and where it is.
    joints : list of Joint
        The joints of the arm.

    Raises
    ------
    InputError
        A moving link with a shape and no <inertial>, with a mass that is not positive or an inertia
        that is not positive definite; a joint that carries no mass; a link that hangs on the chain
        by a joint outside it. The message names the link.
    """
    found: list[list[tuple[float, Array, Array]]] = [[] for _ in joints]
    for link, (number, _, T) in stand.items():
        body = _body(tree, link) if number else None
        if body is not None:
            mass, centre, tensor = body
            R = T[:3, :3]
            found[number - 1].append((mass, T[:3, 3] + R @ centre, R @ tensor @ R.T))
    for link in _hanging(tree, stand):
        raise InputError(
            f"{tree.path}: link {link!r} is attached to the chain by a joint outside it, so the "
            f"place of its mass is not known; make joint {tree.parent[link].name!r} fixed"
        )
    for joint, bodies in zip(joints, found, strict=True):
        if not bodies:
            raise InputError(
                f"{tree.path}: link {joint.child!r} has no <inertial>, nor has any link fixed to it"
            )
    whole = [joined(bodies) for bodies in found]
    return ChainInertia(
        mass=np.array([mass for mass, _, _ in whole]),
        centre=np.array([centre for _, centre, _ in whole]),
        tensor=np.array([tensor for _, _, tensor in whole]),
    )


def joined(bodies: list[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Merge bodies, each given as mass (kg), centre (3,) m and tensor (3, 3) kg m^2, into one."""
    mass = sum(mass for mass, _, _ in bodies)
    centre = sum((mass * centre for mass, centre, _ in bodies), np.zeros(3)) / mass
    tensor = np.zeros((3, 3))
    for m, c, own in bodies:
        off = c - centre  # the theorem of Huygens and Steiner (parallel axes)
        tensor += own + m * (off @ off * np.eye(3) - np.outer(off, off))
    return mass, freeze(centre), freeze(tensor)


def require_tensor(tensor: Array, where: str) -> None:
    """Raise InputError unless an inertia (3, 3) kg m^2 is symmetric and positive definite."""
    if not (np.array_equal(tensor, tensor.T) and (np.linalg.eigvalsh(tensor) > 0).all()):
        least = np.linalg.eigvalsh((tensor + tensor.T) / 2)[0]
        raise InputError(
            f"{where}: its inertia is not positive definite (least principal moment "
            f"{least:.3g} kg m^2)"
        )


def _body(tree: Tree, link: str) -> tuple[float, Array, Array] | None:
    """Return mass, centre and tensor of a link in its own frame; None for a frame without any."""
    element, where = tree.links[link], f"{tree.path}: link {link!r}"
    inertial = child(element, "inertial", where)
    if inertial is None:
        if any(element.find(tag) is not None for tag in SOLID):
            raise InputError(f"{where} has a shape but no <inertial>")
        return None
    parts = [child(inertial, tag, where) for tag in ("mass", "inertia")]
    if parts[0] is None or parts[1] is None or parts[0].get("value") is None:
        raise InputError(f"{where}: its <inertial> lacks <mass value=...> or <inertia>")
    mass = float(numbers(parts[0], "value", where, (0.0,))[0])
    if not mass > 0:
        raise InputError(f"{where}: expected a positive mass, got {mass:g} kg")
    xx, xy, xz, yy, yz, zz = (
        float(numbers(parts[1], f"i{key}", where, (0.0,))[0])
        for key in ("xx", "xy", "xz", "yy", "yz", "zz")
    )
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    require_tensor(tensor, where)
    pose = pose_of(inertial, where)
    R = pose[:3, :3]
    return mass, pose[:3, 3], R @ tensor @ R.T


def _hanging(tree: Tree, stand: Mapping[str, Place]) -> Iterator[str]:
    """Yield the links that moving joints outside the chain attach to links that it moves."""
    for link, joint in tree.parent.items():
        if link not in stand and joint.parent in stand and stand[joint.parent].joint:
            yield link
