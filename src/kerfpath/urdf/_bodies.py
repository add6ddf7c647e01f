"""Collision bodies of a description, each in the frame of the joint that moves it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from kerfpath._arrays import Array, freeze
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.urdf._carriers import Place
from kerfpath.urdf._xml import Tree, child, numbers, pose_of

__all__ = ["LinkBody", "bodies_of"]

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
    if not (size > 0).all():
        raise InputError(
            f"{where}: expected a {shape.tag} with positive {keys}, got {size.tolist()}"
        )
    return size


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
        file = next((p / inside for p in places if (p / inside).is_file()), Path(inside))
    else:
        raise InputError(f"{where}: the mesh {name!r} is not a local file")
    if not name or not file.is_file():
        raise InputError(
            f"{where}: the mesh {name!r} was not found; give the folder of its package with "
            'packages={"NAME": "FOLDER"}, or read only the kinematics with meshes=False'
        )
    return file


def _places(here: Path, package: str) -> list[Path]:
    """Return where a package may be: `here` or a parent of its name, or a folder in these."""
    above = [here, *here.parents]
    return [folder for folder in above if folder.name == package] + [p / package for p in above]
