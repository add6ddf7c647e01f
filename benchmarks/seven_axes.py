"""Paths of full poses with seven-axis arms beside a dense recursion over the free joint."""

from __future__ import annotations

from time import process_time

import numpy as np

from benchmarks._figures import Report, Sheet
from benchmarks._seven_axis_arms import fetch, panda
from kerfpath import Contour, NoFeasiblePath, Robot, plan
from kerfpath.arrays import Array, Bools
from kerfpath.windows import GammaWindow

__all__ = ["run"]

STEP = np.radians(0.5)
"""Step of the free joint in the recursion."""
INTERVAL = 0.068
"""s between nodes: 20 s for the public circle."""
BAND = 6
"""Most steps of it from one node to the next there."""
TORM = 11.105
"""rad: travel of TORM on the circle of the Fetch arm, as CppFlow's repository gives it."""

HOW = f"""\
Every pose is fixed, and one joint of the arm is free. Circle: that of the public problem
`fetch_arm__circle` of CppFlow (a polygon of 49 corners, radius 250 mm, 295 poses), made from its
description, without its obstacles. Others: circles of the Panda at random places, the tool turning
about one axis, 100 poses. Travel: sum of the movements of all joints, which is what is minimised.
Recursion: numpy, every posture, the free joint in steps of {np.degrees(STEP):g} deg, at most {BAND}
of them from node to node, velocities as limits and no accelerations. s: processor time, of the plan
without the first one, which compiles."""


def run(*, quick: bool) -> list[Report]:
    """Plan the same paths by both."""
    tasks = [("Fetch, circle of CppFlow", fetch(), *_public_circle())]
    arm = panda()
    tasks += [(f"Panda, circle {seed}", arm, *_circle(seed)) for seed in range(1 if quick else 8)]
    rows = list[list[str]]()
    plan_path(*tasks[-1][1:])  # compile
    for name, robot, points, frames in tasks:
        begun = process_time()
        q = plan_path(robot, points, frames)
        took = process_time() - begun
        begun = process_time()
        dense = recursion(robot, points, frames)
        other = process_time() - begun
        ours = np.inf if q is None else float(np.abs(np.diff(q, axis=0)).sum())
        rows.append([name, *(f"{v:.4f}" for v in (ours, dense)), f"{took:.1f}", f"{other:.1f}"])
    findings = [
        f"TORM travels {TORM:g} rad on the circle of the Fetch arm, with its obstacles, and poses "
        "that may be off by 0.1 mm and 0.1 deg"
    ]
    heads = ("path", "plan rad", "recursion rad", "plan s", "recursion s")
    title = f"Seven axes: {len(tasks)} paths of full poses"
    return [
        Report(title=title, how=HOW, sheets=[Sheet(columns=heads, rows=rows)], findings=findings)
    ]


def _public_circle() -> tuple[Array, Array]:
    """Return points (295, 3) m in the torso, and frames (295, 3, 3)."""
    turn = 2 * np.pi * np.arange(50) / 49
    corners = np.c_[0 * turn, 0.25 * np.cos(turn) - 0.25, 0.25 * np.sin(turn)] + [0.9, 0.25, 0.46]
    at = np.arange(295) / 6
    points = np.stack([np.interp(at, np.arange(50), each) for each in corners.T], axis=1)
    return points, np.tile(np.eye(3), (len(points), 1, 1))


def _circle(seed: int) -> tuple[Array, Array]:
    """Return points (100, 3) m and frames (100, 3, 3) of a circle of the Panda."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 2 * np.pi, 100)
    radius, lean = rng.uniform(0.05, 0.15), rng.uniform(0, 0.4)
    ring = radius * np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    points = rng.uniform([0.4, -0.2, 0.2], [0.55, 0.2, 0.5]) + ring
    z = np.c_[lean * np.cos(turn), 0 * turn, -np.ones(100)]
    z /= np.linalg.norm(z, axis=1)[:, None]
    y = np.cross(z, [1.0, 0, 0])
    y /= np.linalg.norm(y, axis=1)[:, None]
    return points, np.stack([np.cross(y, z), y, z], axis=2)


def plan_path(robot: Robot, points: Array, frames: Array) -> Array | None:
    """Return the joints (K, 7) rad of a plan, unwrapped; None without one."""
    cut = Contour(points, frames[:, :, 2], x=frames[:, :, 0], closed=False, name="path")
    fixed = GammaWindow(start=0.0, end=float(cut.s[-1]), low=0.0, high=0.0)
    speed = float(np.linalg.norm(np.diff(points, axis=0), axis=1).max()) / INTERVAL
    try:
        made = plan(
            cut, robot, tool=np.eye(4), placement=np.eye(4), speed=speed, certify=None,
            gamma_windows=(fixed,), weights=np.ones(7), interpolation="joint",
        )  # fmt: skip
    except NoFeasiblePath:
        return None
    return made.unwrapped


def recursion(robot: Robot, points: Array, frames: Array) -> float:
    """Return the least travel, rad, over all postures and the free joint on a grid."""
    free = int(robot.free[0])
    lower, upper = np.asarray(robot.lower), np.asarray(robot.upper)
    grid, most = np.arange(lower[free], upper[free], STEP), robot.speed_limits()[0] * INTERVAL
    T, cost = np.tile(np.eye(4), (len(grid), 1, 1)), np.zeros((len(grid), 8))
    bound, before = ~robot.endless, list[Array]()
    for point, frame in zip(points, frames, strict=True):
        T[:, :3, :3], T[:, :3, 3] = frame, point
        q, reach = robot.arm.inverse_all(T, grid)
        outside = (q < lower) | (q > upper)
        q = np.where((reach & ~outside[..., bound].any(axis=2))[..., None], q, np.nan)
        if before:
            cost = _step(before.pop(), q, cost, most, robot.endless)
        else:
            cost = np.where(np.isnan(q[..., 0]), np.inf, 0.0)
        before.append(q)
    return float(cost.min())


def _step(before: Array, q: Array, cost: Array, most: Array, endless: Bools) -> Array:
    """Return the least costs (m, 8) of a layer from those of the one before it."""
    best = np.full_like(cost, np.inf)
    for d in range(-BAND, BAND + 1):
        first, to = slice(max(-d, 0), len(q) - max(d, 0)), slice(max(d, 0), len(q) - max(-d, 0))
        moved = q[to, None] - before[first, :, None]
        moved -= np.where(endless, 2 * np.pi * np.rint(moved / (2 * np.pi)), 0.0)
        moved = np.abs(moved)
        way = np.where((moved <= most).all(axis=3), moved.sum(axis=3), np.inf)
        best[to] = np.minimum(best[to], (cost[first, :, None] + way).min(axis=1))
    return best
