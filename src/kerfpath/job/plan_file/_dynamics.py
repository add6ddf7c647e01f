"""Limits on torque and jerk in plan.json."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.dynamics import Load
from kerfpath.job.plan_file._layout import DynamicsData, LimitsData
from kerfpath.robots import Robot
from kerfpath.urdf import ChainInertia

__all__ = ["dynamics_entry", "with_dynamics"]


def dynamics_entry(robot: Robot) -> LimitsData:
    """Return the keys that limits on torque and jerk add to those of the arm's joints."""
    entry: LimitsData = {}  # type: ignore[typeddict-item]  # some keys of it, to be added
    if robot.jerk is not None:
        entry["jerk_rad_s3"] = [float(x) if np.isfinite(x) else None for x in robot.jerk]
    load, own = robot.load, robot.inertia
    if load is None or own is None or robot.torque is None:
        return entry
    entry["dynamics"] = {
        "torque_nm": robot.torque.tolist(),
        "gravity_m_s2": robot.gravity.tolist(),
        "mass_kg": own.mass.tolist(),
        "centre_m": own.centre.tolist(),
        "inertia_kg_m2": own.tensor.tolist(),
        "load_mass_kg": load.mass,
        "load_centre_m": None if load.centre is None else load.centre.tolist(),
        "load_inertia_kg_m2": None if load.tensor is None else load.tensor.tolist(),
    }
    return entry


def with_dynamics(entry: LimitsData, robot: Robot) -> Robot:
    """Return the arm with the limits on torque and jerk of such an entry.

    Raises
    ------
    InputError
        The load or the masses are not possible.
    """
    jerk = entry.get("jerk_rad_s3")
    if jerk is not None:
        robot = robot.with_limits(jerk=[np.inf if value is None else value for value in jerk])
    said: DynamicsData | None = entry.get("dynamics")
    if said is None:
        return robot
    own = ChainInertia(
        mass=np.array(said["mass_kg"]),
        centre=np.array(said["centre_m"]),
        tensor=np.array(said["inertia_kg_m2"]),
    )
    load = Load(
        mass=said["load_mass_kg"],
        centre=said["load_centre_m"],  # type: ignore[arg-type]  # cast by __post_init__
        tensor=said["load_inertia_kg_m2"],  # type: ignore[arg-type]  # cast by __post_init__
    )
    limited = replace(robot, inertia=own).with_limits(torque=said["torque_nm"])
    return limited.with_load(load, gravity=said["gravity_m_s2"])
