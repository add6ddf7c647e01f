"""The library of robots, one TOML file each, with their sources and notes."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from kerfpath.acceleration_table import LIMIT, AccelerationTable
from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.names import nearest, squeezed
from kerfpath.robots.arm import Arm
from kerfpath.robots.limits import Coupling, RobotLimits

_HERE = files("kerfpath.robots")


@cache
def robot_ids() -> tuple[str, ...]:
    """Return the ids of all robots in the library, sorted."""
    names = (f.name for f in (_HERE / "library").iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in names if n.endswith(".toml")))


@cache
def acceleration_ratios() -> dict[str, tuple[float, ...]]:
    """Return the named ratios of acceleration to velocity, 1/s, for joints 1 to 6.

    They serve for robots whose maker publishes no accelerations; the file gives their source.
    """
    text = (_HERE / "acceleration_ratios.toml").read_text(encoding="utf-8")
    return {name: tuple(values) for name, values in tomllib.loads(text).items()}


@cache
def entry(name: str) -> dict[str, Any]:
    """Return the data of a robot of the library by its id, in any spelling, or without the maker.

    Raises
    ------
    InputError
        The robot is unknown; the message names the nearest ones.
    """
    if not isinstance(name, str):
        raise InputError(
            f"robot: expected the id of a robot, such as {robot_ids()[0]!r}, got "
            f"{type(name).__name__}; 'kerfpath robots' lists all"
        )
    spelled = [(one, squeezed(one), squeezed(one.partition("_")[2])) for one in robot_ids()]
    same = [one for one, *spellings in spelled if squeezed(name) in spellings]
    if len(same) != 1:
        raise InputError(
            f"robot {name!r} is not in the library of {len(robot_ids())} robots; "
            f"{nearest(name, robot_ids())}; 'kerfpath robots' lists all"
        )
    return tomllib.loads((_HERE / "library" / f"{same[0]}.toml").read_text(encoding="utf-8"))


def responses_of(name: str) -> dict[str, dict[str, Any]]:
    """Return the responses of a robot of the library by name, see `kerfpath.execution.Response`.

    Raises
    ------
    InputError
        The robot is unknown.
    """
    return dict(entry(name).get("response", {}))


@cache
def robots_with_tables() -> tuple[str, ...]:
    """Return the ids of the robots whose accelerations the library has by configuration."""
    return tuple(one for one in robot_ids() if "acceleration_table" in entry(one))


def acceleration_table_of(name: str) -> AccelerationTable:
    """Return the accelerations of a robot of the library by configuration.

    Raises
    ------
    InputError
        The robot is unknown, or the library has no table of it.
    """
    if (table := entry(name).get("acceleration_table")) is None:
        raise InputError(
            f"robot {name!r}: the library has no table of accelerations for it, only for "
            f"{' and '.join(robots_with_tables())}; give one"
        )
    return AccelerationTable.from_degrees(
        table["joint_2_deg"],
        table["joint_3_deg"],
        {joint: table[key] for joint in range(1, 8) if (key := LIMIT.format(joint)) in table},
        source=table["source"],
    )


def arm_of(data: Mapping[str, Any]) -> Arm:
    """Return the arm of an entry of the library."""
    return Arm(
        kinematics=data["kinematics"],
        geometry=dict(data["geometry_m"]),
        sign=np.array(data["joints"]["sign"], dtype=float),
        offset=np.radians(data["joints"]["offset_deg"]),
    )


def limits_of(data: Mapping[str, Any]) -> RobotLimits:
    """Return the limits of an entry of the library."""
    joints = data["joints"]
    return RobotLimits(
        lower=_radians(joints.get("lower_deg")),
        upper=_radians(joints.get("upper_deg")),
        velocity=_radians(joints.get("velocity_deg_s")),
        acceleration=_radians(joints.get("acceleration_deg_s2")),
        endless=np.isin(np.arange(1, len(joints["sign"]) + 1), joints["endless"]),
        couplings=tuple(
            Coupling(
                row=np.array(c["row"], dtype=float),
                lower=float(np.radians(c["lower_deg"])),
                upper=float(np.radians(c["upper_deg"])),
                note=c["note"],
            )
            for c in data.get("coupling", ())
        ),
    )


def _radians(values: list[float] | None) -> Array | None:
    return None if values is None else np.radians(values)
