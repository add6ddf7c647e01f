"""Read semantic descriptions (SRDF): the pairs of links that may touch, and why."""

from __future__ import annotations

from collections.abc import Container
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

from kerfpath.errors import InputError
from kerfpath.urdf._xml import read_root, read_tree

__all__ = ["read_srdf"]

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
    path, urdf = Path(path), Path(urdf)
    root = read_root(path, "semantic description (SRDF)")
    tree = read_tree(urdf, 0.0)
    if root.get("name") != tree.name:
        raise InputError(
            f"{path}: describes the robot {root.get('name', '')!r}, but {urdf.name} describes "
            f"{tree.name!r}; expected the same name"
        )
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
