"""Read descriptions (URDF, SRDF): the chain from base to tip, with limits, bodies and masses.

A description also gives the pairs of links that may touch, if its SRDF is there.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from kerfpath.arrays import Array, floats, freeze, positive, short_repr
from kerfpath.errors import InputError
from kerfpath.urdf.chain import (
    ExternalJoint,
    KinematicChain,
    Place,
    carriers_before,
    external_joints,
    places,
    under_part,
)
from kerfpath.urdf.tree import Joint, Tree, child, numbers, pose_of, read_root, read_tree

# -----------------------------------------------------------------------------
# Collision bodies of a description, each in the frame of the joint that moves it.

THINNEST = 1e-6
"""Least size of a body, m; thinner ones have no hull in the digits of a computer."""
SIZES = {"box": ("size", 3), "cylinder": ("radius length", 1), "sphere": ("radius", 1)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinkBody:
    """A collision body of a link, fixed to a joint of the arm or to what carries arm or part.

    Parameters
    ----------
    link : str
        Name of the link.
    joint : int
        Number of arm joints that move the body; 0 if none does.
    pose : (4, 4)
        Pose in the (turned) frame of that joint, m; for joint 0 in the base frame with all external
        axes at zero.
    kind : {"mesh", "box", "cylinder", "sphere"}
    size : (k,) m
        Edges of a box; radius and length of a cylinder; radius of a sphere; scale (3,) of a mesh.
    path : Path or None
        File of the mesh.
    on : str or None
        Name of the external joint that carries the body; "" for the ground; None for links of the
        arm and for what the arm stands on.
    """

    link: str
    joint: int
    pose: Array
    kind: str
    size: Array
    path: Path | None = None
    on: str | None = None

    __repr__ = short_repr


def bodies_of(tree: Tree, link: str, place: Place, packages: Mapping[str, Path]) -> list[LinkBody]:
    """Return the collision bodies of one link."""
    found = []
    for collision in tree.links[link].findall("collision"):
        where = f"{tree.path}: collision of link {link!r}"
        geometry = child(collision, "geometry", where)
        shapes = [] if geometry is None else list(geometry)
        if len(shapes) != 1 or shapes[0].tag not in ("mesh", *SIZES):
            tags = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
            raise InputError(f"{where}: expected one of mesh, {', '.join(SIZES)}, got {tags}")
        shape = shapes[0]
        path = _mesh_file(tree, shape, where, packages) if shape.tag == "mesh" else None
        found.append(
            LinkBody(
                link=link,
                joint=place.joint,
                on=place.on,
                pose=freeze(place.pose @ pose_of(collision, where)),
                kind=shape.tag,
                size=freeze(_size(shape, where)),
                path=path,
            )
        )
    return found


def _size(shape: ElementTree.Element, where: str) -> Array:
    if shape.tag == "mesh":
        return numbers(shape, "scale", where, (1.0, 1.0, 1.0))
    keys, count = SIZES[shape.tag]
    size = np.concatenate([numbers(shape, key, where, (0.0,) * count) for key in keys.split()])
    if not (size >= THINNEST).all():
        raise InputError(
            f"{where}: expected a {shape.tag} with positive {keys} of {THINNEST:g} m or more, got "
            f"{size.tolist()}"
        )
    return size


def _is_file(path: Path) -> bool:
    """Return whether a path leads to a file; no name is too long or too odd to ask."""
    with suppress(OSError, ValueError):
        return path.is_file()
    return False


def _mesh_file(
    tree: Tree, mesh: ElementTree.Element, where: str, packages: Mapping[str, Path]
) -> Path:
    name = mesh.get("filename", "")
    scheme, mark, rest = name.partition("://")
    here = tree.path.resolve().parent
    if not mark:
        file = here / name
    elif scheme == "file":
        file = Path(rest)
    elif scheme == "package":
        package, _, inside = rest.partition("/")
        places = [packages[package]] if package in packages else _places(here, package)
        file = next((p / inside for p in places if _is_file(p / inside)), Path(inside))
    else:
        raise InputError(f"{where}: the mesh {name!r} is not a local file")
    if not name or not _is_file(file):
        raise InputError(
            f"{where}: the mesh {name!r} was not found; give the folder of its package in "
            "packages, or read only the kinematics, without meshes",
            parameter="packages",
        )
    return file


def _places(here: Path, package: str) -> list[Path]:
    """Return where a package may be: `here` or a parent of its name, or a folder in these."""
    above = [here, *here.parents]
    return [folder for folder in above if folder.name == package] + [p / package for p in above]


# -----------------------------------------------------------------------------
# Masses of a description: the rigid body on each joint of the chain.

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


# -----------------------------------------------------------------------------
# Read semantic descriptions (SRDF): the pairs of links that may touch, and why.

LinkPair = tuple[str, str]

LONGEST = 200
"""Number of characters of a reason that are kept."""


def read_srdf(path: str | PathLike[str], urdf: str | PathLike[str]) -> dict[LinkPair, str]:
    """Return the pairs of links whose collisions an SRDF disables, with its reason for each.

    `kerfpath.cell.allowed_pairs` turns them into pairs of bodies. The rest of the file is unused.

    Parameters
    ----------
    path : str or Path
        The SRDF, as MoveIt's setup assistant writes it.
    urdf : str or Path
        The description that it belongs to.

    Raises
    ------
    InputError
        No such file, no SRDF, another robot name than in the description, a link that is not in the
        description, a pair of one link with itself, a pair that is both disabled and enabled, or
        <disable_default_collisions>.
    """
    return disabled_pairs(*read_semantic_root(path, urdf), Path(path))


def read_semantic_root(
    path: str | PathLike[str], urdf: str | PathLike[str]
) -> tuple[ElementTree.Element, Tree]:
    """Return the root of an SRDF and the tree of its description; raises as `read_srdf`."""
    path, urdf = Path(path), Path(urdf)
    root, tree = read_root(path, "semantic description (SRDF)"), read_tree(urdf, 0.0)
    if root.get("name") != tree.name:
        raise InputError(
            f"{path}: describes the robot {root.get('name', '')!r}, but {urdf.name} describes "
            f"{tree.name!r}; expected the same name"
        )
    return root, tree


def disabled_pairs(root: ElementTree.Element, tree: Tree, path: Path) -> dict[LinkPair, str]:
    """Return what `read_srdf` does, from what `read_semantic_root` returns."""
    if root.find("disable_default_collisions") is not None:
        raise InputError(
            f"{path}: <disable_default_collisions> disables every pair of a link; list the pairs "
            "that are meant as <disable_collisions>"
        )
    enabled = {frozenset(_links(each, tree.links, path)) for each in root.iter("enable_collisions")}
    found: dict[LinkPair, str] = {}
    for element in root.iter("disable_collisions"):
        one, two = _links(element, tree.links, path)
        if frozenset((one, two)) in enabled:
            raise InputError(
                f"{path}: {one!r} and {two!r} are both disabled and enabled; remove one of these"
            )
        if (two, one) not in found:
            found.setdefault((one, two), _reason(element))
    return found


def _links(element: ElementTree.Element, links: Container[str], path: Path) -> LinkPair:
    """Return the two links that an element names."""
    one, two = element.get("link1"), element.get("link2")
    if not one or not two:
        raise InputError(f"{path}: expected link1= and link2= in <{element.tag}>")
    for name in (one, two):
        if name not in links:
            raise InputError(
                f"{path}: <{element.tag}> names the link {name!r}, which is not in the description"
            )
    if one == two:
        raise InputError(f"{path}: <{element.tag}> names the link {one!r} twice")
    return one, two


def _reason(element: ElementTree.Element) -> str:
    said = " ".join((element.get("reason") or "").split())[:LONGEST]
    return f"SRDF: {said or 'no reason given'}"


# -----------------------------------------------------------------------------
# Read the chain of a description: joints from base to tip, with limits, bodies and masses.

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
            "have revolute joints only; choose base or tip on this side of it"
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
