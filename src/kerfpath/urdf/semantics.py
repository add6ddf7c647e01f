"""Read semantic descriptions (SRDF): groups, their states, end effectors and what stands where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from kerfpath.arrays import Array, floats, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.names import listed
from kerfpath.urdf.description import LinkPair, disabled_pairs, read_semantic_root
from kerfpath.urdf.tree import Joint, Tree

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """A group of joints, one after the other.

    Parameters
    ----------
    name : str
    base, tip : str
        The links that it begins and ends with.
    joints : tuple of str
        Its moving joints, from base to tip.
    states : mapping of str to (n,) rad
        Named states, such as "home", in the order of the joints.
    passive : tuple of str
        Those of its joints that nothing drives.
    carried : mapping of str to (4, 4) m
        Pose in the tip of each link that is fixed to it, and of the tip itself.
    """

    name: str
    base: str
    tip: str
    joints: tuple[str, ...]
    states: Mapping[str, Array]
    passive: tuple[str, ...]
    carried: Mapping[str, Array]

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class EndEffector:
    """An end effector: a group of links, on the link that carries it."""

    name: str
    group: str
    parent_link: str
    parent_group: str

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class Semantics:
    """What an SRDF says of a description.

    Parameters
    ----------
    groups : mapping of str to Group
        Those that are a chain of joints.
    others : tuple of str
        The other groups, such as those of grippers, which are no chain.
    end_effectors : tuple of EndEffector
    disabled : mapping of pairs of links to str
        As `read_srdf`.
    links : tuple of str
        All links of the description.
    frames : mapping of str to (4, 4) m
        Pose in the root link of each link that no joint moves, and of what the robot is fixed to.
    """

    groups: Mapping[str, Group]
    others: tuple[str, ...]
    end_effectors: tuple[EndEffector, ...]
    disabled: Mapping[LinkPair, str]
    links: tuple[str, ...]
    frames: Mapping[str, Array]

    __repr__ = short_repr

    def group(self, name: str = "") -> Group:
        """Return a group that can be planned for; "" stands for the only one.

        Raises
        ------
        InputError
            No such group, one that is no chain or has passive joints, or "" for one of several.
        """
        if not name and len(self.groups) == 1:
            name = next(iter(self.groups))
        if name not in self.groups:
            what = "is no chain of joints" if name in self.others else "is not in the SRDF"
            said = f"{name!r} {what}" if name else "a name is needed"
            known = listed(sorted(self.groups), 8) or "none"
            raise InputError(f"group: {said}; groups that are chains: {known}")
        found = self.groups[name]
        if found.passive:
            raise InputError(
                f"group {name!r}: nothing drives its joints {', '.join(found.passive)} "
                "(<passive_joint>); choose a group without"
            )
        return found


def read_semantics(path: str | PathLike[str], urdf: str | PathLike[str]) -> Semantics:
    """Return what an SRDF says of its description.

    Parameters
    ----------
    path : str or Path
        The SRDF, as MoveIt's setup assistant writes it.
    urdf : str or Path
        The description that it belongs to.

    Raises
    ------
    InputError
        As `read_srdf`; a chain, state or end effector of names that are not there; a state that
        lacks a joint of its group or gives it several values.
    """
    path = Path(path)
    root, tree = read_semantic_root(path, urdf)
    disabled = disabled_pairs(root, tree, path)
    elements = {_text(e, "name", path): e for e in root.findall("group")}
    joints = {joint.name: joint for joint in tree.joints}
    passive = {_text(e, "name", path) for e in root.findall("passive_joint")}
    groups = {}
    for name, element in elements.items():
        ends = _ends(element, tree, joints, f"{path}: group {name!r}")
        chain = None if ends is None else _chain(tree, *ends)
        if ends is None or chain is None:
            continue
        moving = tuple(joint.name for joint in chain if joint.kind in MOVING and not joint.mimics)
        groups[name] = Group(
            name=name,
            base=ends[0],
            tip=ends[1],
            joints=moving,
            states=_states(root, name, moving, path),
            passive=tuple(one for one in moving if one in passive),
            carried=_fixed_to(tree, ends[1]),
        )
    effectors = tuple(
        EndEffector(
            name=_text(e, "name", path),
            group=_text(e, "group", path),
            parent_link=_known(e, "parent_link", tree.links, path),
            parent_group=e.get("parent_group", ""),
        )
        for e in root.findall("end_effector")
    )
    return Semantics(
        groups=groups,
        others=tuple(name for name in elements if name not in groups),
        end_effectors=effectors,
        disabled=disabled,
        links=tuple(tree.links),
        frames=_frames(root, tree, path),
    )


def _text(element: ElementTree.Element, key: str, path: Path) -> str:
    if not (value := element.get(key)):
        raise InputError(f"{path}: expected {key}= in <{element.tag}>")
    return value


def _known(element: ElementTree.Element, key: str, known: Mapping[str, object], path: Path) -> str:
    if (value := _text(element, key, path)) not in known:
        raise InputError(f"{path}: <{element.tag}> names {value!r}, not in the description")
    return value


def _ends(
    element: ElementTree.Element, tree: Tree, joints: Mapping[str, Joint], where: str
) -> tuple[str, str] | None:
    """Return first and last link of a group; None for one that lists subgroups or several chains.

    A group is a chain, or a list of joints or of links, each after the one before it.
    """
    path = Path(where)
    chains = element.findall("chain")
    if len(chains) == 1:
        first, last = (_known(chains[0], k, tree.links, path) for k in ("base_link", "tip_link"))
        if _chain(tree, first, last) is None:
            raise InputError(f"{where}: no joints lead from link {first!r} to link {last!r}")
        return first, last
    listed_joints = [joints[_known(e, "name", joints, path)] for e in element.findall("joint")]
    links = [_known(e, "name", tree.links, path) for e in element.findall("link")]
    if element.find("group") is not None or chains:
        return None
    if listed_joints:
        first, last = listed_joints[0].parent, listed_joints[-1].child
        chain = _chain(tree, first, last)
        inside = {joint.name for joint in listed_joints}
        moving = {joint.name for joint in chain or () if joint.kind in MOVING}
        return (first, last) if chain is not None and moving <= inside else None
    return (links[0], links[-1]) if len(links) > 1 and _chain(tree, links[0], links[-1]) else None


def _chain(tree: Tree, base: str, tip: str) -> list[Joint] | None:
    """Return the joints from a link to another one that it carries; None if it does not."""
    found, link = list[Joint](), tip
    while link != base:
        if link not in tree.parent:
            return None
        found.append(tree.parent[link])
        link = found[-1].parent
    return found[::-1]


def _states(
    root: ElementTree.Element, group: str, joints: tuple[str, ...], path: Path
) -> dict[str, Array]:
    """Return the named states of a group."""
    found = {}
    for element in root.findall("group_state"):
        if element.get("group") != group:
            continue
        name = _text(element, "name", path)
        where = f"{path}: state {name!r} of group {group!r}"
        values = {_text(e, "name", path): e.get("value", "").split() for e in element}
        if missing := [joint for joint in joints if joint not in values]:
            raise InputError(f"{where}: expected a value of joint {missing[0]!r}, got none")
        try:
            found[name] = np.array([float(word) for j in joints for word in values[j]])
        except ValueError:
            found[name] = np.array([np.nan])
        if found[name].shape != (len(joints),) or not np.isfinite(found[name]).all():
            raise InputError(f"{where}: expected one finite number for each joint")
    return found


def _frames(root: ElementTree.Element, tree: Tree, path: Path) -> dict[str, Array]:
    """Return the pose in the root link of every link that no joint moves.

    A fixed virtual joint adds the frame that the root is fixed to.
    """
    frames = _fixed_to(tree, next(link for link in tree.links if link not in tree.parent))
    for element in root.findall("virtual_joint"):
        child = _known(element, "child_link", tree.links, path)
        if element.get("type") == "fixed" and child in frames:
            frames[_text(element, "parent_frame", path)] = frames[child]
    return frames


def _fixed_to(tree: Tree, link: str) -> dict[str, Array]:
    """Return the pose in a link of every link that is fixed to it, and of itself."""
    found, reached = {link: freeze(np.eye(4))}, [link]
    while reached:
        here = reached.pop()
        for joint in tree.joints:
            if joint.kind != "fixed" or here not in (joint.parent, joint.child):
                continue
            there, T = joint.child, joint.origin
            if there == here:
                there, T = joint.parent, floats(np.linalg.inv(joint.origin), joint.name, (4, 4))
            if there not in found:
                found[there] = freeze(found[here] @ T)
                reached.append(there)
    return found
