"""External axes in plan.json: their values are separate from the arm's, in their own units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.job.plan_file._layout import ExternalData
from kerfpath.robots import ExternalAxis, Robot

__all__ = ["add_externals", "apart", "external_entries", "joints"]


def apart(name: str, values: Array, robot: Robot) -> dict[str, object]:
    """Return values (..., n) of the joints; external axes are separate and in their own units."""
    n = robot.family.joints
    entry: dict[str, object] = {f"{name}_rad": values[..., :n].tolist()}
    if robot.externals:
        entry[f"external_{name}"] = values[..., n:].tolist()
    return entry


def joints(entry: Mapping[str, Any], name: str, robot: Robot) -> Array:
    """Return values (..., n) of the joints from an entry that `apart` has made.

    Raises
    ------
    InputError
        There are too few or too many values of external axes.
    """
    own = np.array(entry[f"{name}_rad"], dtype=float)
    if not robot.externals:
        return own
    others = np.array(entry.get(f"external_{name}", ()), dtype=float)
    if others.shape != (*own.shape[:-1], len(robot.externals)):
        raise InputError(
            f"external_{name}: expected {len(robot.externals)} numbers for each of {name}_rad, got "
            f"the shape {others.shape}"
        )
    return np.concatenate([own, others], axis=-1)


def external_entries(robot: Robot) -> list[ExternalData]:
    """Return the plan.json entries of the robot's external axes."""
    if not robot.externals:
        return []
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    return [
        ExternalData(
            name=axis.name,
            kind=axis.kind,
            carries=axis.carries,
            unit=axis.unit,
            axis=axis.axis.tolist(),
            point_m=axis.point.tolist(),
            step=axis.step,
            lower=float(limits.lower[i]),
            upper=float(limits.upper[i]),
            velocity=float(velocity[i]),
            acceleration=float(acceleration[i]),
            endless=bool(robot.endless[i]),
        )
        for i, axis in enumerate(robot.externals, robot.family.joints)
    ]


def add_externals(entries: list[ExternalData], robot: Robot) -> Robot:
    """Return the arm with the external axes of such entries."""
    for entry in entries:
        axis = ExternalAxis(
            name=entry["name"],
            kind=entry["kind"],
            carries=entry["carries"],
            axis=np.array(entry["axis"]),
            point=np.array(entry["point_m"]),
            step=entry["step"],
        )
        robot = robot.with_external(
            axis,
            lower=entry["lower"],
            upper=entry["upper"],
            velocity=entry["velocity"],
            acceleration=entry["acceleration"],
            endless=entry["endless"],
        )
    return robot
