"""Write joints as the XML of a description, which `read_tree` reads back."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array
from kerfpath.urdf._xml import Joint

__all__ = ["urdf_text"]


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
