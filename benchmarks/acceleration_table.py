"""The fastest constant speed with constant accelerations and with those by configuration."""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np

from benchmarks._figures import Report, Sheet
from kerfpath import Contour, Plan, Robot, audit, fastest_speed, plan, robot
from kerfpath.arrays import Array
from kerfpath.planner import FastestSpeed

__all__ = ["curve", "run"]

ARM = "abb_irb6640_180_255"
LENGTH, DEG_PER_MM2 = 999.964, 0.54e-3
"""mm: the curve's extent along x; deg/mm^2: phase of its wave over x squared."""
HEIGHT, WIDTH, WAVE = 25.4, 50.8, 30.0
"""mm: of the parabolic surface, to where it is 0, and amplitude of the wave on it."""
POINTS = 20_001
TOOL = np.array(
    [
        [np.sqrt(0.75), 0.0, 0.5, 0.075],
        [0.0, 1.0, 0.0, 0.0],
        [-0.5, 0.0, np.sqrt(0.75), 0.49330127],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
PLACES = {
    "first": ([1086.51, -506.84, 968.91], [8.2698, 0.1608, 90.4745]),
    "searched": ([871.36, -411.12, 1159.33], [91.7817, 28.7519, -0.6407]),
}
"""Where the authors of the public runs had the part: xyz mm, and rpy deg about fixed axes."""
SPACINGS = (0.02, 0.01)
"""m: distance of the nodes."""
COLUMNS = (
    "placement",
    "spacing mm",
    "constant mm/s",
    "table mm/s",
    "gain %",
    "binds",
    "of table",
    "of constant",
    "s",
)
HOW = """\
Curve 1 of the public runs of an ABB IRB 6640-180/2.55 (rpiRobotics/ARM-21-02-F-19-Robot-Motion-
Program; arXiv 2301.02348): a wave y = 30 sin(0.54 deg x^2 / 1000) on a parabolic surface, 1 m long,
at the two placements of the authors, with their tool. The fastest constant speed at which a motion
is found (`fastest_speed`, `refine`, no exploration): with the constant accelerations of the library
(for joints 1 to 3 the 5th percentile of the measured ones), and with `acceleration_table =
"library"`. Binds: the limit and joint with the table. Of table, of constant: the largest share of
each limit of acceleration that a plan at 0.98 of that speed needs at its nodes; its audit by the
table passes. s: processor time of the search with the table, the first with compiling."""


def run(*, quick: bool) -> list[Report]:
    """Measure both placements at several spacings of the nodes."""
    plain, tabled = robot(ARM), robot(ARM, acceleration_table="library")
    rows = []
    for name, place in PLACES.items():
        for spacing in SPACINGS[:1] if quick else SPACINGS:
            nodes, T = curve().resample(spacing=spacing), _placement(*place)
            before, _ = _fastest(nodes, plain, T)
            after, took = _fastest(nodes, tabled, T)
            made = plan(nodes, tabled, tool=TOOL, placement=T, speed=0.98 * after.speed)
            if issues := [issue for issue in audit(made) if issue.code == "acceleration"]:
                raise AssertionError(f"{name}: {issues[0]}")
            speeds = [1e3 * each.speed for each in (before, after)]
            rows.append(
                (
                    name,
                    f"{1e3 * spacing:g}",
                    *(f"{speed:.0f}" for speed in speeds),
                    f"{100 * (speeds[1] / speeds[0] - 1):.0f}",
                    f"{after.limit}, joint {after.joint + 1}",
                    f"{_share(made, tabled):.2f}",
                    f"{_share(made, plain):.2f}",
                    f"{took:.1f}",
                )
            )
    title = "Fastest speed with accelerations by configuration"
    return [Report(title=title, how=HOW, sheets=[Sheet(columns=COLUMNS, rows=rows)])]


def curve() -> Contour:
    """Return curve 1, its tool axes into the surface."""
    x = np.linspace(0, LENGTH, POINTS)
    y = WAVE * np.sin(np.radians(DEG_PER_MM2 * x**2))
    z = (WIDTH**2 - y**2) * HEIGHT / WIDTH**2
    normal = np.stack([0 * x, 2 * y * HEIGHT / WIDTH**2, np.ones(POINTS)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Contour(np.stack([x, y, z], axis=1) / 1e3, -normal, closed=False)


def _placement(xyz: list[float], rpy: list[float]) -> Array:
    T = np.eye(4)
    for angle, (i, j) in zip(np.radians(rpy), ((1, 2), (2, 0), (0, 1)), strict=True):
        R = np.eye(4)
        R[i, i] = R[j, j] = np.cos(angle)
        R[j, i] = np.sin(angle)
        R[i, j] = -R[j, i]
        T = R @ T
    T[:3, 3] = np.array(xyz) / 1e3
    return T


def _fastest(nodes: Contour, arm: Robot, T: Array) -> tuple[FastestSpeed, float]:
    begun = process_time()
    found = fastest_speed(nodes, arm, tool=TOOL, placement=T, refine=True, explore=False)
    return found, process_time() - begun


def _share(made: Plan, arm: Robot) -> float:
    return float(np.abs(replace(made, robot=arm).acceleration_share).max())
