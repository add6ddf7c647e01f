"""The arm, tool and contour that the benchmarks share: an ABB IRB 2400 and a wavy closed cut."""

from __future__ import annotations

import numpy as np

from kerfpath import Contour, Robot, robot
from kerfpath.arrays import Array

__all__ = ["arm", "arm_of_one_turn", "chain", "placement", "tool", "wave"]


def arm() -> Robot:
    """Return the IRB 2400, axes 4 and 6 endless, with assumed accelerations."""
    return robot("abb_irb2400_155").with_limits(
        acceleration=np.radians([600, 600, 700, 2000, 2200, 3000]), endless=[0, 0, 0, 1, 0, 1]
    )


def arm_of_one_turn() -> Robot:
    """Return the IRB 2400 with plain ranges of at most one turn per joint, as in a URDF."""
    plain = robot("abb_irb2400_155")
    assert plain.lower is not None
    assert plain.upper is not None
    return plain.with_limits(
        lower=np.maximum(plain.lower, -np.pi),
        upper=np.minimum(plain.upper, np.pi),
        couplings=(),
    )


def chain(of: Robot) -> tuple[Array, Array]:
    """Return the joint axes (6, 3) and origins (7, 3) m, each in the one before, at q = 0.

    The forearm lies along x at q = 0 (third offset -90 deg), and all frames are parallel to the
    base; the seventh origin is the flange.
    """
    assert np.allclose(of.offset, [0, 0, -np.pi / 2, 0, 0, 0])
    assert np.allclose(of.sign, 1)
    x, y, z = np.eye(3)
    g = of.geometry
    origins = [0 * x, g["a1"] * x + g["b"] * y + g["c1"] * z, g["c2"] * z, -g["a2"] * z]
    origins += [g["c3"] * x, 0 * x, g["c4"] * x]
    return np.array([z, y, y, x, y, x]), np.array(origins)


def tool() -> Array:
    """Return T_flange_tip of a head whose beam is at 45 deg to the flange axis."""
    c = np.sqrt(0.5)
    T = np.eye(4)
    T[:3, :3] = [[c, 0, c], [0, 1, 0], [-c, 0, c]]
    T[:3, 3] = [0.15, 0.0, 0.30]
    return T


def placement() -> Array:
    """Return T_base_part of the cylinder of `wave`."""
    T = np.eye(4)
    T[:3, 3] = [1.05, 0.0, 0.35]
    return T


def wave(nodes: int) -> Contour:
    """Return a closed contour with four waves on a cylinder of radius 0.45 m, normal to it."""
    t = np.linspace(0, 2 * np.pi, 20_001)
    swell = 1 + 0.12 * np.cos(4 * t)
    angle, along = 0.22 * swell * np.cos(t) / 0.45, 0.30 * swell * np.sin(t)
    normals = np.c_[np.sin(angle), np.zeros_like(t), np.cos(angle)]
    points = 0.45 * normals + np.c_[np.zeros_like(t), along, np.zeros_like(t)]
    return Contour(points, -normals, closed=True, name="wave").resample(count=nodes)
