"""What plan.json says of an external axis: its values apart from the arm's, in their own unit."""

from __future__ import annotations

from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath.robots import Robot, Travel

__all__ = ["by_unit", "external_entry", "joints", "with_external"]


def by_unit(name: str, values: Array, robot: Robot) -> dict[str, Any]:
    """Return values (..., n) of the joints, those of an external axis apart and in its own unit."""
    if robot.external is None:
        return {f"{name}_rad": values.tolist()}
    own, last = values[..., :-1].tolist(), values[..., -1].tolist()
    return {f"{name}_rad": own, f"external_{name}_{robot.external.unit}": last}


def joints(entry: dict[str, Any], name: str, robot: Robot) -> Array:
    """Return values (..., n) of the joints as `by_unit` told them."""
    own = np.array(entry[f"{name}_rad"], dtype=float)
    if robot.external is None:
        return own
    last = np.array(entry[f"external_{name}_{robot.external.unit}"], dtype=float)
    return np.concatenate([own, last[..., None]], axis=-1)


def external_entry(robot: Robot) -> dict[str, Any] | None:
    """Return what there is to know of the robot's external axis; None where it has none."""
    axis = robot.external
    if axis is None:
        return None
    limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
    return {
        "kind": axis.kind,
        "axis": axis.axis.tolist(),
        "point_m": axis.point.tolist(),
        f"step_{axis.unit}": axis.step,
        f"lower_{axis.unit}": float(limits.lower[-1]),
        f"upper_{axis.unit}": float(limits.upper[-1]),
        f"velocity_{axis.unit}_s": float(velocity[-1]),
        f"acceleration_{axis.unit}_s2": float(acceleration[-1]),
    }


def with_external(entry: dict[str, Any] | None, robot: Robot) -> Robot:
    """Return the arm with the external axis that `external_entry` told."""
    if entry is None:
        return robot
    rail = entry["kind"] == "rail"
    unit = "m" if rail else "rad"
    travel: Travel = {
        "lower": entry[f"lower_{unit}"],
        "upper": entry[f"upper_{unit}"],
        "velocity": entry[f"velocity_{unit}_s"],
        "acceleration": entry[f"acceleration_{unit}_s2"],
        "step": entry[f"step_{unit}"],
    }
    if rail:
        return robot.on_rail(entry["axis"], **travel)
    return robot.with_positioner(entry["axis"], entry["point_m"], **travel)
