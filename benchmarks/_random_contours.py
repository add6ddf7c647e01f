"""Random smooth 3-D contours in front of a robot, each with its cutting speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from kerfpath import Contour, Robot, robot
from kerfpath.arrays import Array
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.planner import fastest_speed, layered_graph, node_interval

__all__ = ["COARSE", "GAMMA_STEP", "ROBOTS", "Cut", "arm", "contour", "cut", "head", "posed"]

ROBOTS = {
    "abb_irb2400_155": "cybertech_8_to_20kg",
    "kuka_kr16_r1610_2": None,
    "staubli_tx2_90xl": "payload_up_to_20kg_agilus",
}
"""Robots by id, with the ratio that replaces accelerations that their maker does not publish."""

GAMMA_STEP = np.radians(1.0)
"""Step of gamma on the graphs that are searched."""
COARSE = np.radians(3.0)
"""Step of gamma on the graphs for the speeds; they have every third sample of the others."""
SHARES = (0.75, 1.35)
"""Range of the speed, as a share of the fastest on the coarse graph; some cuts are infeasible."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cut:
    """A contour in the robot base, its layered graph, and its cutting speed.

    Parameters
    ----------
    contour : Contour
        Points and axes in the robot base, m.
    robot : Robot
        Joints 4 and 6 endless.
    tool : (4, 4)
        T_flange_tip.
    graph : LayeredGraph
    speed : float m/s
    """

    contour: Contour
    robot: Robot
    tool: Array
    graph: LayeredGraph
    speed: float

    @property
    def dt(self) -> float:
        """Time from node to node, s."""
        return node_interval(self.contour, self.speed)

    @property
    def options(self) -> dict[str, Any]:
        """The options of `plan` and `layered_graph` besides contour, robot and speed."""
        return {"tool": self.tool, "placement": np.eye(4), "gamma_step": GAMMA_STEP}

    @property
    def frames(self) -> Array:
        """Task frames in the robot base, (K, 4, 4)."""
        return self.contour.frames("rotation-minimising")


def head() -> Array:
    """Return T_flange_tip of a head whose beam is at 45 deg to the flange axis."""
    c = np.sqrt(0.5)
    T = np.eye(4)
    T[:3, :3] = [[c, 0, c], [0, 1, 0], [-c, 0, c]]
    T[:3, 3] = [0.15, 0.0, 0.30]
    return T


def arm(name: str) -> Robot:
    """Return a robot of the library with full limits, joints 4 and 6 endless."""
    return robot(name, acceleration_ratio=ROBOTS[name]).with_limits(endless=[0, 0, 0, 1, 0, 1])


def contour(rng: np.random.Generator, reach: float) -> Contour:
    """Return one random contour, closed or open, in front of a robot of this reach, m."""
    closed = bool(rng.random() < 0.5)
    t = np.linspace(0.0, 2 * np.pi * (1.0 if closed else rng.uniform(0.4, 0.8)), 4001)
    half = rng.uniform(0.05, 0.15)
    swell = 1 + rng.uniform(0, 0.25) * np.cos(rng.integers(2, 5) * t + _phase(rng))
    x = half * swell * np.cos(t)
    y = half * swell * rng.uniform(0.5, 1.0) * np.sin(t)
    z = half * rng.uniform(0, 0.3) * np.sin(rng.integers(1, 4) * t + _phase(rng))
    lean = [_field(rng, t, np.radians(15)) for _ in range(2)]
    normal = np.stack([lean[0], lean[1], np.ones_like(t)], axis=1)
    T = posed(rng, reach)
    points = np.stack([x, y, z], axis=1) @ T[:3, :3].T + T[:3, 3]
    dense = Contour(points, -normal @ T[:3, :3].T, closed=closed)
    return dense.resample(count=int(rng.integers(60, 81)))


def cut(name: str, index: int, *, seed: int = 1) -> Cut:
    """Return a cut for a robot that can reach all its nodes; name, index and seed decide it.

    The speed is a random share (`SHARES`) of the fastest on a coarse graph (`COARSE`).
    """
    rng = np.random.default_rng([seed, index, *name.encode()])
    machine = arm(name)
    assert machine.reach is not None
    task: dict[str, Any] = {"robot": machine, "tool": head(), "placement": np.eye(4)}
    while True:
        drawn, share = contour(rng, machine.reach), rng.uniform(*SHARES)
        try:
            fastest = fastest_speed(drawn, gamma_step=COARSE, **task)
        except NoFeasiblePath:
            continue
        return Cut(
            contour=drawn,
            robot=machine,
            tool=task["tool"],
            graph=layered_graph(drawn, gamma_step=GAMMA_STEP, **task),
            speed=share * fastest.speed,
        )


def _phase(rng: np.random.Generator) -> float:
    return float(rng.uniform(0, 2 * np.pi))


def _field(rng: np.random.Generator, t: Array, size: float) -> Array:
    """Return a smooth periodic random function whose largest value is at most tan `size`."""
    waves = sum(rng.uniform(-1, 1) / m * np.cos(m * t + _phase(rng)) for m in (1, 2, 3))
    return np.asarray(np.tan(size) * rng.uniform(0, 1) * waves / np.abs(waves).max())


def posed(rng: np.random.Generator, reach: float) -> Array:
    """Return the pose of a part in front of the robot, tilted by up to 30 deg in any direction."""
    around, tilt, towards, spin = rng.uniform([-0.8, 0, 0, 0], [0.8, np.pi / 6, 6.28, 6.28])
    axis = np.array([np.cos(towards), np.sin(towards), 0.0])
    out = reach * rng.uniform(0.45, 0.7)
    T = np.eye(4)
    T[:3, :3] = _turn(axis, tilt) @ _turn(np.array([0.0, 0.0, 1.0]), spin)
    T[:3, 3] = [out * np.cos(around), out * np.sin(around), reach * rng.uniform(-0.05, 0.35)]
    return T


def _turn(axis: Array, angle: float) -> Array:
    cross = np.cross(np.eye(3), axis)
    return np.asarray(np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
