"""Read the chain of a description: joints from base to tip, with limits, bodies and masses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.urdf._bodies import LinkBody, bodies_of
from kerfpath.urdf._carriers import (
    ExternalJoint,
    Place,
    carriers_before,
    external_joints,
    places,
    under_part,
)
from kerfpath.urdf._chain import KinematicChain
from kerfpath.urdf._inertia import ChainInertia, inertia_of
from kerfpath.urdf._xml import Joint, Tree, read_tree

__all__ = ["Description", "read_urdf"]

SAME_LINE = 1e-9
"""m, and sine of an angle: neighbouring axes that differ by less turn about the same line."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Description:
    """The arm between `base` and `tip` of a description, and what carries it and the part.

    Parameters
    ----------
    path : Path
    name : str
        Name of the robot.
    base, tip : str
        Names of the links.
    joints : tuple of Joint
        The moving joints of the arm, in order, as the file has them.
    chain : KinematicChain
        Frames of these joints, with fixed joints merged and all external joints at zero.
    externals : tuple of ExternalJoint
        The joints that carry the arm, then those that carry the part; within each group, each
        joint is carried by those before it.
    bodies : tuple of LinkBody
        Collision bodies of every link on the ground, on external joints and on the arm.
    left_out : tuple of str
        Links on other moving joints, whose place is not known; `bodies` has none of their bodies.
    inertia : ChainInertia or None
        Masses that the joints carry; None if they are not known.
    inertia_missing : str
        Why `inertia` is not known.
    """

    path: Path
    name: str
    base: str
    tip: str
    joints: tuple[Joint, ...]
    chain: KinematicChain
    externals: tuple[ExternalJoint, ...]
    bodies: tuple[LinkBody, ...]
    left_out: tuple[str, ...]
    inertia: ChainInertia | None = None
    inertia_missing: str = ""

    __repr__ = short_repr


def read_urdf(
    path: str | Path,
    *,
    base: str | None = None,
    tip: str | None = None,
    mount: str | None = None,
    part: str | None = None,
    packages: Mapping[str, str | Path] | None = None,
    meshes: bool = True,
    snap: float = 0.0,
) -> Description:
    """Read the chain from link `base` (default: the root) to `tip` (default: the only leaf).

    Moving joints of this chain before the arm are external axes that carry the arm. Moving joints
    between what the base is fixed to and the link `part` are external axes that carry the part.

    Parameters
    ----------
    path : path
        A URDF file.
    base, tip : str, optional
        Names of the links.
    mount : str, optional
        The link that the arm stands on; joints between the base and this link are external axes.
        Default: the link below the last prismatic joint, if at least six joints follow it, else the
        base.
    part : str, optional
        The link that carries the part; default: the part does not move.
    packages : mapping, optional
        Folder of each package that mesh names begin with; other packages are searched for in the
        folders above the file.
    meshes : bool
        Read the collision bodies too; a missing mesh file is then an error.
    snap : float rad
        Angles within this of a multiple of 15 deg are rounded to it, because many descriptions
        print right angles as 1.5708.

    Raises
    ------
    InputError
        Not a description; no such link; no chain from base to tip; an arm joint that slides, floats
        or mimics another, or two neighbours about the same line; an external joint that floats or
        mimics another; a part that no external joint moves; a missing mesh.
    """
    tree = read_tree(Path(path), snap)
    base, tip = _ends(tree, base, tip)
    written = _between(tree, base, tip)
    before = carriers_before(tree, written, mount)
    driven = [joint for joint in written if joint.kind != "fixed"]
    moving = driven[before:]
    for joint in moving:
        _require_revolute(tree, joint)
    if not moving:
        raise InputError(f"{tree.path}: no joint moves between {mount or base!r} and {tip!r}")
    externals = external_joints(
        tree, base, written[: written.index(moving[0])], under_part(tree, base, part, written)
    )
    origins, T = [], np.eye(4)
    for joint in written:
        T = T @ joint.origin
        if joint in moving:
            origins.append(T)
            T = np.eye(4)
    chain = KinematicChain(
        origins=np.array(origins), axes=np.array([j.axis for j in moving]), end=T
    )
    _require_lengths(tree, chain, moving)
    stand = places(tree, base, written, externals)
    folders = {name: Path(folder) for name, folder in (packages or {}).items()}
    bodies = (
        [b for link, place in stand.items() for b in bodies_of(tree, link, place, folders)]
        if meshes
        else []
    )
    inertia, inertia_missing = _inertia(tree, stand, moving)
    return Description(
        path=tree.path,
        name=tree.name,
        base=base,
        tip=tip,
        joints=tuple(moving),
        chain=chain,
        externals=externals,
        bodies=tuple(bodies),
        left_out=tuple(link for link in tree.links if link not in stand),
        inertia=inertia,
        inertia_missing=inertia_missing,
    )


def _inertia(
    tree: Tree, stand: dict[str, Place], joints: list[Joint]
) -> tuple[ChainInertia | None, str]:
    """Return what the joints carry, or why that is not known; only torques need it."""
    try:
        return inertia_of(tree, stand, joints), ""
    except InputError as fault:
        return None, str(fault)


def _ends(tree: Tree, base: str | None, tip: str | None) -> tuple[str, str]:
    roots = [link for link in tree.links if link not in tree.parent]
    holding = {joint.parent for joint in tree.joints}
    leaves = [link for link in tree.links if link not in holding]
    ends = []
    for key, given, candidates in (("base", base, roots), ("tip", tip, leaves)):
        if given is None and len(candidates) != 1:
            some = ", ".join(candidates[:8]) + (", ..." if len(candidates) > 8 else "")
            raise InputError(
                f"{tree.path}: {len(candidates)} links can be the {key} ({some}); "
                f'say which with {key}="..."'
            )
        link = candidates[0] if given is None else given
        if link not in tree.links:
            raise InputError(
                f"{tree.path}: {key}: there is no link {link!r}; "
                f"there are {', '.join(list(tree.links)[:30])}"
            )
        ends.append(link)
    return ends[0], ends[1]


def _between(tree: Tree, base: str, tip: str) -> list[Joint]:
    joints: list[Joint] = []
    link = tip
    while link != base:
        if link not in tree.parent:
            above = ", ".join(joint.parent for joint in joints) or "no links"
            raise InputError(
                f"{tree.path}: no chain of joints leads from base {base!r} to tip {tip!r}; "
                f"above {tip!r} there are only {above}"
            )
        joints.append(tree.parent[link])
        link = joints[-1].parent
    return joints[::-1]


def _require_revolute(tree: Tree, joint: Joint) -> None:
    if joint.kind not in ("revolute", "continuous"):
        raise InputError(
            f"{tree.path}: joint {joint.name!r} between base and tip is {joint.kind}; an arm must "
            "have revolute joints only; choose base= or tip= on this side of it"
        )
    if joint.mimics:
        raise InputError(
            f"{tree.path}: joint {joint.name!r} between base and tip mimics {joint.mimics!r}; "
            "every joint of an arm must move on its own"
        )


def _require_lengths(tree: Tree, chain: KinematicChain, joints: list[Joint]) -> None:
    """Raise InputError if a link between two joints has no length and no bend."""
    for i in range(1, len(joints)):
        T = chain.origins[i]
        first, second = chain.axes[i - 1], T[:3, :3] @ chain.axes[i]
        apart = np.linalg.norm(np.cross(first, T[:3, 3]))
        if np.linalg.norm(np.cross(first, second)) < SAME_LINE and apart < SAME_LINE:
            raise InputError(
                f"{tree.path}: joints {joints[i - 1].name!r} and {joints[i].name!r} turn about "
                f"the same line: link {joints[i].parent!r} between them has no length"
            )
