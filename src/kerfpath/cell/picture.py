"""Small pictures of arms as SVG, with their reach along the floor."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from kerfpath.arrays import Array
from kerfpath.cell.drawn import colours_of, drawn_links
from kerfpath.robots import Robot

WIDTH, HEIGHT, RIM = 200, 170, 10
"""Size of a picture and its rim, px."""
VIEW = np.array([0.32, -1.0, 0.22])
"""Direction from the arm to the eye."""
POSES = {
    "opw": (0, -20, 105, 0, 60, 0),
    "five": (0, -20, 105, 0, 60),
    "srs": (0, 20, 0, 85, 0, 60, 0),
    "ur": (180, -115, 95, -70, -90, 0),
}
"""Joints of the models at which arms are shown, deg."""


def picture_of(robot: Robot) -> str:
    """Return a picture of a robot as SVG; a line along the floor is as long as its reach."""
    right = np.cross([0.0, 0.0, 1.0], VIEW)
    right /= np.linalg.norm(right)
    eye = VIEW / np.linalg.norm(VIEW)
    screen = np.array([right, -np.cross(eye, right)])

    arm = robot.arm
    asked = np.radians(POSES.get(robot.kinematics, np.zeros(arm.joints)))
    frames = arm.joint_chain().frames((arm.sign * (asked + arm.offset))[None])[0]
    solids = []
    for link in drawn_links(robot):
        T = frames[link.frame]
        points = link.vertices @ T[:3, :3].T + T[:3, 3]
        # The nearest part of a solid decides which of two lies before the other.
        solids.append((float((points @ eye).max()), link.tone, points @ screen.T))
    solids.sort(key=lambda solid: solid[0])
    reach = robot.reach or 0.0
    ruler = np.array([[0.0, 0.0, 0.0], [reach, 0.0, 0.0]]) @ screen.T
    everything = np.vstack([*(points for *_, points in solids), ruler])
    low, size = everything.min(axis=0), np.ptp(everything, axis=0)
    below = 26 if reach else 0
    scale = float(min((WIDTH - 2 * RIM) / size[0], (HEIGHT - 2 * RIM - below) / size[1]))
    shift = np.array([
        (WIDTH - scale * size[0]) / 2, HEIGHT - RIM - below - scale * size[1]
    ]) - scale * low  # fmt: skip

    fills = dict(zip(("casting", "housing"), colours_of(robot), strict=True))
    shapes = [
        f'<polygon points="{_said(_outline(points * scale + shift))}" fill="{fills[tone]}"/>'
        for _, tone, points in solids
    ]
    name = f"{robot.manufacturer} {robot.model}"
    said = f"{name}, reach {reach:g} m" if reach else name
    if reach:
        (x0, y0), (x1, y1) = ruler * scale + shift
        y0, y1 = y0 + 12, y1 + 12
        shapes.append(
            f'<path d="M{x0:.1f} {y0 - 4:.1f}v8M{x0:.1f} {y0:.1f}L{x1:.1f} {y1:.1f}m0-4v8" '
            'fill="none" stroke="#7b8794"/>'
            f'<text x="{(x0 + x1) / 2:.1f}" y="{HEIGHT - 6}" text-anchor="middle" '
            f'font-family="sans-serif" font-size="12" fill="#7b8794">{reach:g} m</text>'
        )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{said}"><g stroke="#3b424b" stroke-width="0.8" stroke-linejoin="round">'
        f"{''.join(shapes[: len(solids)])}</g>{''.join(shapes[len(solids) :])}</svg>\n"
    )


def _outline(points: Array) -> Array:
    """Return the corners (P, 2) of the outline of a convex solid's picture."""
    return np.asarray(points[ConvexHull(points).vertices])


def _said(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points.tolist())
