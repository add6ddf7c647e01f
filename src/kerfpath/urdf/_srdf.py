"""Semantic descriptions (SRDF): which links of a description may touch, and why."""

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
"""Characters of a reason that are kept."""


def read_srdf(path: str | PathLike[str], urdf: str | PathLike[str]) -> dict[LinkPair, str]:
    """Return the pairs of links that an SRDF disables collisions of, and its reason for each.

    `kerfpath.cell.allowed_pairs` makes pairs of bodies of them. Nothing else of the file is used.

    Parameters
    ----------
    path : str or Path
        The SRDF, as MoveIt's setup assistant writes it.
    urdf : str or Path
        The description that it belongs to.

    Raises
    ------
    InputError
        No such file, no SRDF, one of a robot of another name, a link that the description has not,
        a pair of one link, a pair that is enabled as well, or a link whose every pair is disabled.
    """
    path, urdf = Path(path), Path(urdf)
    root = read_root(path, "semantic description (SRDF)")
    tree = read_tree(urdf, 0.0)
    if root.get("name") != tree.name:
        raise InputError(
            f"{path}: describes the robot {root.get('name', '')!r}, and {urdf.name} the robot "
            f"{tree.name!r}; expected one name"
        )
    if root.find("disable_default_collisions") is not None:
        raise InputError(
            f"{path}: <disable_default_collisions> disables every pair of a link; write those that "
            "are meant as <disable_collisions>"
        )
    enabled = {frozenset(_links(each, tree.links, path)) for each in root.iter("enable_collisions")}
    found: dict[LinkPair, str] = {}
    for element in root.iter("disable_collisions"):
        one, two = _links(element, tree.links, path)
        if frozenset((one, two)) in enabled:
            raise InputError(f"{path}: {one!r} and {two!r} are disabled and enabled; remove one")
        if (two, one) not in found:
            found.setdefault((one, two), _reason(element))
    return found


def _links(element: ElementTree.Element, links: Container[str], path: Path) -> LinkPair:
    """Return the two links that an element names."""
    one, two = element.get("link1"), element.get("link2")
    if not one or not two:
        raise InputError(f"{path}: <{element.tag}> without link1 and link2")
    for name in (one, two):
        if name not in links:
            raise InputError(
                f"{path}: <{element.tag}> names the link {name!r}, which the description has not"
            )
    if one == two:
        raise InputError(f"{path}: <{element.tag}> names the link {one!r} twice")
    return one, two


def _reason(element: ElementTree.Element) -> str:
    said = " ".join((element.get("reason") or "").split())[:LONGEST]
    return f"SRDF: {said or 'no reason given'}"
