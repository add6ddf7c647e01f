"""What plan.json says of an external axis: its values apart from the arm's, in their own unit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from kerfpath._arrays import Array
from kerfpath.job.plan_file._layout import ExternalData
from kerfpath.robots import Robot, Travel

__all__ = ["add_external", "by_unit", "external_entry", "joints"]


def by_unit(name: str, values: Array, robot: Robot) -> dict[str, object]:
    """Return values (..., n) of the joints, those of an external axis apart and in its own unit."""
    if robot.external is None:
        return {f"{name}_rad": values.tolist()}
    own, last = values[..., :-1].tolist(), values[..., -1].tolist()
    return {f"{name}_rad": own, f"external_{name}_{robot.external.unit}": last}


def joints(entry: Mapping[str, Any], name: str, robot: Robot) -> Array:
    """Return values (..., n) of the joints as `by_unit` has them."""
    own = np.array(entry[f"{name}_rad"], dtype=float)
    if robot.external is None:
        return own
    last = np.array(entry[f"external_{name}_{robot.external.unit}"], dtype=float)
    return np.concatenate([own, last[..., None]], axis=-1)


def external_entry(robot: Robot) -> ExternalData | None:
    """Return what there is to know of the robot's external axis; None where it has none."""
    axis = robot.external
    if axis is None:
        return None
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    entry = {
        "kind": axis.kind,
        "axis": axis.axis.tolist(),
        "point_m": axis.point.tolist(),
        f"step_{axis.unit}": axis.step,
        f"lower_{axis.unit}": float(limits.lower[-1]),
        f"upper_{axis.unit}": float(limits.upper[-1]),
        f"velocity_{axis.unit}_s": float(velocity[-1]),
        f"acceleration_{axis.unit}_s2": float(acceleration[-1]),
    }
    return cast(ExternalData, entry)


def add_external(entry: ExternalData | None, robot: Robot) -> Robot:
    """Return the arm with the external axis of such an entry."""
    if entry is None:
        return robot
    values: Mapping[str, Any] = entry
    rail = entry["kind"] == "rail"
    unit = "m" if rail else "rad"
    travel: Travel = {
        "lower": values[f"lower_{unit}"],
        "upper": values[f"upper_{unit}"],
        "velocity": values[f"velocity_{unit}_s"],
        "acceleration": values[f"acceleration_{unit}_s2"],
        "step": values[f"step_{unit}"],
    }
    if rail:
        return robot.on_rail(entry["axis"], **travel)
    return robot.with_positioner(entry["axis"], entry["point_m"], **travel)
