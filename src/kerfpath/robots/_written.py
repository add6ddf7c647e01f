"""Write a robot as a description (URDF): its joints, limits and external axes."""

from __future__ import annotations

from typing import Literal

import numpy as np

from kerfpath._arrays import Array
from kerfpath._names import identifiers
from kerfpath.errors import InputError
from kerfpath.robots._chain import arm_chain
from kerfpath.robots._manipulator import Manipulator
from kerfpath.urdf import Joint, urdf_text

__all__ = ["joint_identifiers", "urdf_of"]

GROUND, BASE, FLANGE, PART = "ground", "base_link", "tool0", "part"
"""Names of links: the base at zero of all external axes; the base; the flange; the part."""
REMARK = (
    "Lengths in m, angles in rad, from kerfpath. An effort of 0 means not known. tool0 is the "
    "flange."
)


def joint_identifiers(robot: Manipulator) -> list[str]:
    """Return the joint names in descriptions and ROS trajectories, in the order of q.

    They are joint_1 and so on; external axes have their own names, made into identifiers.
    """
    arm = [f"joint_{i}" for i in range(1, robot.family.joints + 1)]
    return [*arm, *identifiers((axis.name for axis in robot.externals), taken=arm)]


def urdf_of(robot: Manipulator) -> str:
    """Return the URDF of a robot, see `Robot.to_urdf`."""
    if robot.couplings:
        said = " and ".join(coupling.name for coupling in robot.couplings)
        raise InputError(
            f"robot {robot.id!r}: its limits include a bound on {said}, but a URDF has only limits "
            "of single joints; dataclasses.replace(robot, couplings=()).to_urdf() writes it "
            "without that bound"
        )
    chain = arm_chain(robot)
    joints, foot, at = _carriers(robot, "robot")
    if robot.externals:
        joints.append(_fixed(foot, BASE, _shift(-at)))
    link = BASE
    for i, (origin, axis) in enumerate(zip(chain.origins, chain.axes, strict=True)):
        joints.append(_moving(robot, i, link, origin, axis))
        link = joints[-1].child
    joints.append(_fixed(link, FLANGE, chain.end))
    under, table, at = _carriers(robot, "part")
    if under:
        joints += [*under, _fixed(table, PART, _shift(-at))]
    return urdf_text(robot.id, joints, REMARK)


def _carriers(robot: Manipulator, what: Literal["robot", "part"]) -> tuple[list[Joint], str, Array]:
    """Return the axes that carry robot or part, the last link, and the place (3,) m of its frame.

    The frame of each axis has its origin on the axis and is parallel to the robot base.
    """
    joints: list[Joint] = []
    link, at = GROUND, np.zeros(3)
    for i, axis in enumerate(robot.externals, robot.family.joints):
        if axis.carries == what:
            joints.append(_moving(robot, i, link, _shift(axis.point - at), axis.axis))
            link, at = joints[-1].child, axis.point
    return joints, link, at


def _moving(robot: Manipulator, i: int, parent: str, origin: Array, axis: Array) -> Joint:
    """Return the joint of a column of q, with the limits that are known."""
    n, endless, limits = robot.family.joints, bool(robot.endless[i]), robot.joint_limits()
    name, kind = joint_identifiers(robot)[i], "continuous" if endless else "revolute"
    if robot.units[i] == "m":
        kind = "prismatic"
    burdens = [None if of is None or i >= n else float(of[i]) for of in (robot.jerk, robot.torque)]
    jerk, torque = (of if of is not None and np.isfinite(of) else None for of in burdens)
    return Joint(
        name=name,
        kind=kind,
        parent=parent,
        child=f"link_{i + 1}" if i < n else f"{name}_carriage",
        origin=origin,
        axis=axis,
        lower=None if endless else float(limits.lower[i]),
        upper=None if endless else float(limits.upper[i]),
        velocity=float(robot.velocity_limits()[i]),
        acceleration=None if robot.acceleration is None else float(robot.acceleration[i]),
        jerk=jerk,
        effort=torque,
        mimics="",
    )


def _fixed(parent: str, child: str, origin: Array) -> Joint:
    """Return a fixed joint; its name contains a character that no axis name has."""
    limits = dict.fromkeys(("lower", "upper", "velocity", "acceleration", "jerk", "effort"))
    return Joint(
        name=f"{parent}-{child}",
        kind="fixed",
        parent=parent,
        child=child,
        origin=origin,
        axis=np.zeros(3),
        mimics="",
        **limits,
    )


def _shift(by: Array) -> Array:
    T = np.eye(4)
    T[:3, 3] = by
    return T
