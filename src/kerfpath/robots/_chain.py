"""The joint chain of a robot, from its description or from the model of its family."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from kerfpath.errors import InputError
from kerfpath.robots._carried import CarriedChain
from kerfpath.robots._manipulator import Manipulator
from kerfpath.urdf import KinematicChain, turns

__all__ = ["arm_chain", "chain_of", "model_chain", "require_axes"]

X, Y, Z = np.eye(3)


def chain_of(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of a robot, which ends at its flange.

    With external axes it is a `CarriedChain`, which begins at the part.

    Raises
    ------
    InputError
        The robot has no description and its family has no model with joint frames; or it has
        external axes and its joint limits are not known.
    """
    arm = arm_chain(robot)
    if not robot.externals:
        return arm
    limits = robot.joint_limits()
    return CarriedChain(
        origins=arm.origins,
        axes=arm.axes,
        end=arm.end,
        externals=robot.externals,
        travel=np.column_stack([limits.lower, limits.upper])[len(arm.axes) :],
    )


def arm_chain(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of the arm alone; raises as `chain_of`."""
    return model_chain(robot) if robot.chain is None else robot.chain


def require_axes(chain: KinematicChain, robot: Manipulator) -> None:
    """Require that the chain of a cell has the external axes of a robot and all their travel.

    Raises
    ------
    InputError
        The external axes differ, or the chain covers less travel: bounds on motions hold within
        its travel only.
    """
    own = chain if isinstance(chain, CarriedChain) else None
    axes = () if own is None else own.externals
    one, two = (
        [(a.name, a.kind, a.carries, *a.axis, *a.point) for a in some]
        for some in (axes, robot.externals)
    )
    if one != two:
        here, there = (
            ", ".join(axis.name for axis in some) or "none" for some in (axes, robot.externals)
        )
        raise InputError(
            f"cell: it was built with other external axes ({here}) than the robot has ({there})"
        )
    if own is not None:
        limits, arm = robot.joint_limits(), len(own.axes)
        beyond = (limits.lower[arm:] < own.travel[:, 0]) | (limits.upper[arm:] > own.travel[:, 1])
        if (beyond & ~robot.endless[arm:]).any():
            raise InputError(
                "cell: it was built with less travel of the external axes than the robot has; "
                "build it again for this robot"
            )


def model_chain(robot: Manipulator) -> KinematicChain:
    """Return the joint chain of the family's model, ignoring the robot's description.

    Raises
    ------
    InputError
        The family has no model with joint frames.
    """
    if robot.kinematics not in _MODELS:
        raise InputError(
            f"robot {robot.id!r}: the joint frames of its family ({robot.family.words}) are known "
            "only from a robot description (URDF); read it with Robot.from_urdf"
        )
    model = _MODELS[robot.kinematics](robot.geometry)
    # q_model = sign q - offset: a frame at angle zero is turned back by the offset.
    back = [turns(axis, -robot.offset[i : i + 1])[0] for i, axis in enumerate(model.axes)]
    origins = model.origins @ np.array(back)
    origins[0] = robot.T_base_foot @ origins[0]
    return KinematicChain(
        origins=origins,
        axes=robot.sign[:, None] * model.axes,
        end=model.end @ robot.T_end_flange,
    )


def _opw(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm (Brandstoetter, Angerer and Hofbaur 2014, figure 1).

    The shoulder is at (a1, b, c1), the elbow c2 above it, the wrist centre at (a2, 0, c3) from the
    elbow, and the flange c4 further along.
    """
    origins, end = np.tile(np.eye(4), (6, 1, 1)), np.eye(4)
    origins[1, :3, 3] = g["a1"], g["b"], g["c1"]
    origins[2, 2, 3] = g["c2"]
    origins[3, :3, 3] = g["a2"], 0.0, g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Y, Z, Y, Z]), end=end)


def _five(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm without axis 6."""
    whole = _opw(g)
    return replace(whole, origins=whole.origins[:5], axes=whole.axes[:5])


def _ur(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of a UR arm in DH frames, alpha = 90, 0, 0, 90, -90, 0 deg."""
    d = (g["d1"], 0.0, 0.0, g["d4"], g["d5"], g["d6"])
    a = (0.0, g["a2"], g["a3"], 0.0, 0.0, 0.0)
    after = turns(X, np.radians([90.0, 0.0, 0.0, 90.0, -90.0, 0.0]))
    after[:, 0, 3], after[:, 2, 3] = a, d
    return KinematicChain(
        origins=np.array([np.eye(4), *after[:5]]), axes=np.tile(Z, (6, 1)), end=after[5]
    )


def _srs(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an S-R-S arm, upright at zero, with axes z, y, z, y, z, y, z."""
    origins, end = np.tile(np.eye(4), (7, 1, 1)), np.eye(4)
    origins[[1, 3, 5], 2, 3] = g["c1"], g["c2"], g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Z, Y, Z, Y, Z]), end=end)


_MODELS = {"opw": _opw, "ur": _ur, "five": _five, "srs": _srs}
