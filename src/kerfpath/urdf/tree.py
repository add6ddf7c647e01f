"""Read the XML of a description, safely, into links and joints; and write it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.text import NOT_TEXT, named

XACRO = ("{http://www.ros.org/wiki/xacro}", "{http://wiki.ros.org/xacro}")
FINE = np.pi / 12
"""rad: angles that a description rounds are taken as multiples of this, 15 deg."""
LARGEST = 1e6
"""Largest number allowed in a description (m, rad or a scale)."""
NO_AXIS = 1e-9
"""An axis whose components are all smaller than this has no direction."""
KINDS = ("revolute", "continuous", "fixed", "prismatic", "floating", "planar")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joint:
    """A joint as the file has it; limits that the file leaves out are None.

    Parameters
    ----------
    name, kind, parent, child : str
    origin : (4, 4)
        Pose of the joint at angle zero in the parent link, m.
    axis : (3,)
        Unit axis in the joint's own frame.
    lower, upper : float rad or None
    velocity : float rad/s or None
    acceleration : float rad/s^2 or None
        The smaller of the limits for acceleration and deceleration that the file has.
    jerk : float rad/s^3 or None
    effort : float N m or None
        None also if the value in the file is no limit: 0, or not a number.
    mimics : str
        Name of the joint that it follows, or "".
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    lower: float | None
    upper: float | None
    velocity: float | None
    acceleration: float | None
    jerk: float | None
    effort: float | None
    mimics: str

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tree:
    """All links and joints of a description."""

    path: Path
    name: str
    links: Mapping[str, ElementTree.Element]
    joints: tuple[Joint, ...]
    parent: Mapping[str, Joint]
    """The joint above each link that has one."""

    __repr__ = short_repr


class _NoDoctype(ElementTree.TreeBuilder):
    """Refuse document types: they may define entities of unlimited size, and are not needed."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise InputError("a document type (<!DOCTYPE ...>) is refused; remove that line")


def read_tree(path: Path, snap: float) -> Tree:
    """Return the links and joints of the file; `snap` (rad) as in `pose_of`.

    Raises
    ------
    InputError
        Not XML or not a description, duplicate or missing names, a link with two parents, a loop.
    """
    root = read_root(path, "robot description (URDF)")
    links: dict[str, ElementTree.Element] = {}
    for link in root.findall("link"):
        name = _attribute(link, "name", "a link", path)
        if name in links:
            raise InputError(f"{path}: two links are called {name!r}; rename one")
        links[name] = link
    joints = tuple(_joint(element, snap, path) for element in root.findall("joint"))
    names = [joint.name for joint in joints]
    for i, joint in enumerate(joints):
        if joint.name in names[:i]:
            raise InputError(f"{path}: two joints are called {joint.name!r}; rename one")
        for link_name in (joint.parent, joint.child):
            if link_name not in links:
                raise InputError(
                    f"{path}: joint {joint.name!r} names the link {link_name!r}, which is missing"
                )
    parent: dict[str, Joint] = {}
    for joint in joints:
        if joint.child in parent:
            raise InputError(
                f"{path}: link {joint.child!r} is the child of two joints, "
                f"{parent[joint.child].name!r} and {joint.name!r}: a closed loop; only trees are "
                "read, so remove one joint"
            )
        parent[joint.child] = joint
    _require_no_loop(path, parent)
    name = root.get("name", path.stem)
    _require_text(name, "the name of the robot", path)
    return Tree(path=path, name=name, links=links, joints=joints, parent=parent)


def read_root(path: Path, what: str) -> ElementTree.Element:
    """Return the <robot> element of a file; `what` is the expected kind of file, for messages.

    Raises
    ------
    InputError
        No file, no XML, a document type, xacro macros, another root element.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise InputError(f"is not a regular file; expected a {what}")
        root = ElementTree.fromstring(
            path.read_bytes(), parser=ElementTree.XMLParser(target=_NoDoctype())
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"{path}: expected an XML {what}, {error}") from None
    if any(element.tag.startswith(XACRO) for element in root.iter()):
        raise InputError(
            f"{path}: has xacro macros; expand them first with 'xacro {path.name} > robot.urdf'"
        )
    if root.tag != "robot":
        raise InputError(
            f"{path}: expected a {what}, whose first element is <robot>, got <{root.tag}>"
        )
    return root


def _require_no_loop(path: Path, parent: Mapping[str, Joint]) -> None:
    for link in parent:
        seen, above = [link], link
        while above in parent:
            above = parent[above].parent
            if above in seen:
                ring = " - ".join([*seen[seen.index(above) :], above])
                raise InputError(
                    f"{path}: the links {ring} form a closed loop; only trees are read"
                )
            seen.append(above)


def _joint(element: ElementTree.Element, snap: float, path: Path) -> Joint:
    name = _attribute(element, "name", "a joint", path)
    where = f"{path}: joint {name!r}"
    kind = _attribute(element, "type", f"joint {name!r}", path)
    if kind not in KINDS:
        raise InputError(f"{where}: expected a type of {', '.join(KINDS)}, got {kind!r}")
    ends = {}
    for end in ("parent", "child"):
        if (found := child(element, end, where)) is None:
            raise InputError(f"{where}: has no <{end} link=...>")
        ends[end] = _attribute(found, "link", f"<{end}> of joint {name!r}", path)
    axis = np.array([1.0, 0.0, 0.0])
    if kind not in ("fixed", "floating") and (found := child(element, "axis", where)) is not None:
        axis = numbers(found, "xyz", where, (1.0, 0.0, 0.0))
        if not np.abs(axis).max() > NO_AXIS:
            raise InputError(f"{where}: its axis is nearly 0 0 0 and has no direction")
    limit, mimic = child(element, "limit", where), child(element, "mimic", where)
    names = ("lower", "upper", "velocity", "acceleration", "deceleration", "jerk")
    written: dict[str, float | None] = dict.fromkeys(names)
    if limit is not None:
        for key in written:
            if limit.get(key) is not None:
                written[key] = float(numbers(limit, key, f"{where} <limit>", (0.0,))[0])
        if written["lower"] is not None or written["upper"] is not None:
            # A limit that is left out has the default of the format, 0.
            written = {
                **written,
                "lower": written["lower"] or 0.0,
                "upper": written["upper"] or 0.0,
            }
    rates = [written.pop(key) for key in ("acceleration", "deceleration")]
    return Joint(
        name=name,
        kind=kind,
        parent=ends["parent"],
        child=ends["child"],
        origin=pose_of(element, where, snap),
        axis=freeze(np.asarray(axis / np.linalg.norm(axis))),
        effort=None if limit is None else _effort(limit.get("effort")),
        mimics="" if mimic is None else mimic.get("joint", "another"),
        acceleration=min((rate for rate in rates if rate is not None), default=None),
        **written,
    )


def _effort(text: str | None) -> float | None:
    """Return an effort limit (N m), or None if there is none; many descriptions then write 0."""
    try:
        effort = float(text or 0.0)
    except ValueError:
        return None
    return effort if 0 < effort < np.inf else None


def pose_of(element: ElementTree.Element, where: str, snap: float = 0.0) -> Array:
    """Return the <origin> of an element as a pose (4, 4).

    Its angles are roll, pitch and yaw about the fixed x, y and z axes. Angles within `snap` (rad)
    of a multiple of 15 deg are rounded to it.
    """
    pose, origin = np.eye(4), child(element, "origin", where)
    if origin is not None:
        rpy = numbers(origin, "rpy", f"{where} <origin>", (0.0, 0.0, 0.0))
        whole = FINE * np.round(rpy / FINE)
        rpy = np.where(np.abs(rpy - whole) <= snap, whole, rpy)
        pose[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
        pose[:3, 3] = numbers(origin, "xyz", f"{where} <origin>", (0.0, 0.0, 0.0))
    return freeze(pose)


def numbers(
    element: ElementTree.Element, key: str, where: str, default: tuple[float, ...]
) -> Array:
    """Return the finite numbers of an attribute, as many as the default has."""
    text = element.get(key)
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if len(values) != len(default) or not (np.abs(values) <= LARGEST).all():
        want = "a finite number" if len(default) == 1 else f"{len(default)} finite numbers"
        raise InputError(f"{where}: expected {key}= as {want}, got {text!r} (at most {LARGEST:g})")
    return values


def child(element: ElementTree.Element, tag: str, where: str) -> ElementTree.Element | None:
    """Return the only child with this tag, or None."""
    found = element.findall(tag)
    if len(found) > 1:
        raise InputError(f"{where}: has <{tag}> {len(found)} times, expected it once")
    return found[0] if found else None


def _attribute(element: ElementTree.Element, key: str, what: str, path: Path) -> str:
    value = element.get(key)
    if not value:
        raise InputError(f"{path}: {what} has no {key}")
    _require_text(value, f"the {key} of {what}", path)
    return value


def _require_text(value: str, what: str, path: Path) -> None:
    if (odd := re.search(rf"{NOT_TEXT.pattern}|[\t\n]", value)) is not None:
        raise InputError(f"{path}: {what}: expected one line of text, got {named(odd[0])}")


# -----------------------------------------------------------------------------
# Write joints as the XML of a description, which `read_tree` reads back.


def urdf_text(name: str, joints: Sequence[Joint], remark: str) -> str:
    """Return the URDF of a tree of joints, with its links in the order of the joints.

    Parameters
    ----------
    name : str
        Name of the robot.
    joints : sequence of Joint
        Joints, parents before children. An unknown effort is written as 0, because the format
        requires a number.
    remark : str
        Comment at the head of the file.
    """
    robot = ElementTree.Element("robot", name=name)
    robot.append(ElementTree.Comment(f" {remark} "))
    links = dict.fromkeys(link for joint in joints for link in (joint.parent, joint.child))
    for link in links:
        ElementTree.SubElement(robot, "link", name=link)
    for joint in joints:
        _add_joint(robot, joint)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _add_joint(robot: ElementTree.Element, joint: Joint) -> None:
    element = ElementTree.SubElement(robot, "joint", name=joint.name, type=joint.kind)
    ElementTree.SubElement(element, "parent", link=joint.parent)
    ElementTree.SubElement(element, "child", link=joint.child)
    turned = Rotation.from_matrix(joint.origin[:3, :3])
    rpy = turned.as_euler("xyz", suppress_warnings=True)
    ElementTree.SubElement(
        element, "origin", xyz=_words(joint.origin[:3, 3]), rpy=_words(np.asarray(rpy))
    )
    if joint.kind == "fixed":
        return
    ElementTree.SubElement(element, "axis", xyz=_words(joint.axis))
    limit = {
        "lower": joint.lower,
        "upper": joint.upper,
        "velocity": joint.velocity,
        "effort": joint.effort or 0.0,
        "acceleration": joint.acceleration,
        "jerk": joint.jerk,
    }
    said = {key: repr(float(value)) for key, value in limit.items() if value is not None}
    ElementTree.SubElement(element, "limit", said)


def _words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values + 0.0)
