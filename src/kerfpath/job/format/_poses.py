"""Shipped cutting heads, and poses from the position and angles in a job."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath._arrays import Array, freeze

__all__ = ["HeadPose", "heads", "pose"]


class HeadPose(NamedTuple):
    """Pose of the tip of a cutting head in the flange.

    Parameters
    ----------
    xyz_mm : (3,) mm
        Position of the tip.
    rpy_deg : (3,) deg
        Its orientation as in `pose`; z points along the beam, out of the nozzle into the part.
    """

    xyz_mm: tuple[float, ...]
    rpy_deg: tuple[float, ...]


@cache
def heads() -> dict[str, HeadPose]:
    """Return the shipped cutting heads by name; their dimensions are generic."""
    text = (files("kerfpath.job") / "heads.toml").read_text(encoding="utf-8")
    return {
        name: HeadPose(tuple(values["xyz_mm"]), tuple(values["rpy_deg"]))
        for name, values in tomllib.loads(text).items()
    }


def pose(xyz_mm: Sequence[float], rpy_deg: Sequence[float]) -> Array:
    """Return the pose (4, 4), in m, of a position and three angles, as in a URDF origin.

    Parameters
    ----------
    xyz_mm : (3,) mm
        Position.
    rpy_deg : (3,) deg
        Roll, pitch and yaw about the fixed axes x, y and z, applied in this order:
        R = Rz(yaw) Ry(pitch) Rx(roll).
    """
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", rpy_deg, degrees=True).as_matrix()
    T[:3, 3] = np.multiply(xyz_mm, 1e-3)
    return freeze(T)
