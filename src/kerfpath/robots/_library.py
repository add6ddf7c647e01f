"""The library of robots, one TOML file each, with their sources and notes."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from typing import TypeVar

import numpy as np

from kerfpath._arrays import Array
from kerfpath.errors import InputError
from kerfpath.robots._coupling import Coupling
from kerfpath.robots._manipulator import Manipulator

__all__ = ["acceleration_ratios", "nearest", "read_robot", "robot_ids"]

A = TypeVar("A", bound=Manipulator)

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


def read_robot(kind: type[A], name: str, acceleration_ratio: str | None = None) -> A:
    """Return a robot of the library by its id, as an instance of `kind`.

    Parameters
    ----------
    kind : type
        `Robot`, or a base of it.
    name, acceleration_ratio
        As in `kerfpath.robots.robot`.

    Raises
    ------
    InputError
        As `kerfpath.robots.robot`.
    """
    if name not in robot_ids():
        raise InputError(
            f"robot {name!r} is not in the library of {len(robot_ids())} robots; "
            f"{nearest(name, robot_ids())}; 'kerfpath robots' lists all"
        )
    data = tomllib.loads((_HERE / "library" / f"{name}.toml").read_text(encoding="utf-8"))
    joints = data["joints"]
    found = kind(
        id=data["id"],
        manufacturer=data["manufacturer"],
        model=data["model"],
        kinematics=data["kinematics"],
        geometry=data["geometry_m"],
        sign=np.array(joints["sign"], dtype=float),
        offset=np.radians(joints["offset_deg"]),
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
        axis_3=joints["axis_3"],
        payload=data["payload_kg"],
        reach=data["reach_m"],
        acceleration_source=joints.get("acceleration_source", ""),
        acceleration_ratio=joints["acceleration_ratio"],
        limits_missing=data.get("limits_missing", ""),
        notes=tuple(data.get("notes", ())),
        frames=data["frames"],
        sources=data["source"],
    )
    if acceleration_ratio is None:
        return found
    ratios = acceleration_ratios()
    if acceleration_ratio not in ratios:
        raise InputError(
            f"acceleration_ratio: expected one of {', '.join(ratios)}, got {acceleration_ratio!r}"
        )
    if (n := len(ratios[acceleration_ratio])) != found.joints:
        raise InputError(
            f"acceleration_ratio: {acceleration_ratio!r} is for {n} joints, but robot {name!r} has "
            f"{found.joints}; give its accelerations with robot.with_limits(acceleration=...)"
        )
    if found.velocity is None:
        raise InputError(
            f"robot {name!r}: its joint velocities are not known, so acceleration_ratio cannot be "
            "applied"
        )
    return replace(
        found,
        acceleration=np.multiply(ratios[acceleration_ratio], found.velocity),
        acceleration_source=f"assumed: ratio {acceleration_ratio} times the speeds",
    )


def _radians(values: list[float] | None) -> Array | None:
    return None if values is None else np.radians(values)


def nearest(name: str, known: tuple[str, ...]) -> str:
    """Return the known names most similar to `name`, in words for messages."""
    near = get_close_matches(name, known, n=3, cutoff=0.4)
    return f"nearest: {', '.join(near)}" if near else "no id there is similar"
