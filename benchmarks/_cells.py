"""The cells that the collision benchmark plans in: an arm over a shell, and the demo's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks import _arm
from kerfpath import Contour, Plan, Robot, plan, robot
from kerfpath.arrays import Array, Ints
from kerfpath.cad import read as read_drawing
from kerfpath.cell import (
    Body,
    Capsule,
    Cell,
    CuttingHead,
    Hull,
    Mesh,
    Shape,
    box_between,
    cell_of,
    link_capsules,
    weld,
)
from kerfpath.graph import LayeredGraph
from kerfpath.job import read_job
from kerfpath.planner import layered_graph

__all__ = ["Case", "demo", "tessellated", "wave"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A task, its graph, and the cell in which it is planned."""

    name: str
    contour: Contour
    robot: Robot
    speed: float
    tool: Array
    placement: Array
    gamma_step: float
    graph: LayeredGraph
    cell: Cell

    def plan(self, *, cell: Cell | None, graph: LayeredGraph | None) -> Plan:
        """Return the plan, with or without a cell, on the given graph or on a new one."""
        return plan(
            self.contour, self.robot, speed=self.speed, graph=graph, cell=cell, tool=self.tool,
            placement=self.placement, gamma_step=self.gamma_step, method="exact",
        )  # fmt: skip


def wave(nodes: int, step: float, *, meshes: bool) -> Case:
    """Return the IRB 2400 cutting the wave into a shell, a table below and a post beside it.

    Its links are capsules, or closed meshes of about 2300 triangles each instead.
    """
    arm, tool, placement = _arm.arm(), _arm.tool(), _arm.placement()
    t = np.linspace(-0.9, 0.9, 61)
    skin = np.c_[0.449 * np.sin(t), 0 * t, 0.449 * np.cos(t)]
    rim = np.vstack([skin, 0.9 * skin[::-1]])
    side = np.array([0.0, 0.5, 0.0])
    ends = np.vstack([rim - side, rim + side])
    part = Mesh(vertices=ends, triangles=_prism(len(rim)), name="shell")
    fixtures = {
        "table": box_between([0.6, -0.6, -0.1], [1.5, 0.6, 0.35]),
        "post": box_between([1.03, -0.02, 0.8], [1.07, 0.02, 1.2]),
    }
    links = link_capsules(arm)
    if meshes:
        links = tuple(replace(link, shape=tessellated(link.shape)) for link in links)
    name = f"wave, {nodes} x {np.degrees(step):.0f} deg{', meshes' * meshes}"
    return _case(
        name, _arm.wave(nodes), arm, 0.02, tool, placement, step, part, fixtures, links
    )  # fmt: skip


def demo(spacing: float, step: float) -> Case:
    """Return the demo's outer trim, with a table and a post."""
    job = read_job(Path(str(files("kerfpath.demo") / "b_pillar.toml")))
    arm = robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians([320, 270, 420, 1300, 1400, 2000]), endless=[0, 0, 0, 1, 0, 1]
    )
    drawn = read_drawing(Path(str(files("kerfpath.demo") / "b_pillar.step")))
    vertices, triangles = weld(*drawn.mesh(2e-4), 1e-6)
    part = Mesh(vertices=vertices, triangles=triangles, deviation=2e-4, name="b_pillar.step")
    contour = drawn.contour("skin/outer").resample(spacing=spacing)
    fixtures = {
        "table": box_between([0.9, -0.8, -0.1], [1.8, 0.8, 0.3]),
        "post": box_between([0.75, -0.25, 0.0], [0.85, -0.15, 1.1]),
    }
    name = f"demo trim, {len(contour)} x {np.degrees(step):.0f} deg"
    return _case(name, contour, arm, 4 / 60, job.tool, job.placement, step, part, fixtures, None)


def tessellated(shape: Shape) -> Hull | Mesh:
    """Return a capsule as a closed mesh inside it, less than 0.5 % of its radius off."""
    if not isinstance(shape, Capsule):
        return shape
    around, over = 48, 12
    along = shape.end - shape.start
    z = along / np.linalg.norm(along)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    frame = np.array([x, np.cross(z, x), z])
    lift = np.pi / 2 * np.arange(over) / over
    turn = 2 * np.pi * np.arange(around) / around
    rings = [(shape.end, lift[::-1]), (shape.start, -lift)]
    points = [shape.end + shape.radius * z]
    for end, angles in rings:
        for up in angles:
            ring = np.c_[
                np.cos(up) * np.c_[np.cos(turn), np.sin(turn)], np.full(around, np.sin(up))
            ]
            points.extend(end + shape.radius * ring @ frame)
    points.append(shape.start - shape.radius * z)
    i, j = np.arange(around), np.roll(np.arange(around), -1)
    triangles = [np.c_[0 * i, 1 + i, 1 + j]]
    for ring in range(2 * over - 1):
        a = 1 + ring * around
        b = a + around
        triangles += [np.c_[a + i, b + i, b + j], np.c_[a + i, b + j, a + j]]
    last = 1 + (2 * over - 1) * around
    triangles.append(np.c_[last + i, 0 * i + len(points) - 1, last + j])
    return Mesh(vertices=np.array(points), triangles=np.vstack(triangles), name="capsule")


def _prism(m: int) -> Ints:
    """Return the triangles of a prism over a strip of m corners, out and back."""
    a = np.arange(m)
    b = np.roll(a, -1)
    sides = np.vstack([np.c_[a, b, b + m], np.c_[a, b + m, a + m]])
    i = np.arange(m // 2 - 1)
    lid = np.vstack([np.c_[i, m - 1 - i, i + 1], np.c_[i + 1, m - 1 - i, m - 2 - i]])
    return np.vstack([sides, lid, lid[:, ::-1] + m])


def _case(
    name: str, contour: Contour, arm: Robot, speed: float, tool: Array, placement: Array,
    step: float, part: Mesh, fixtures: Mapping[str, Shape], links: Sequence[Body] | None,
) -> Case:  # fmt: skip
    graph = layered_graph(contour, arm, tool=tool, placement=placement, gamma_step=step)
    cell = cell_of(
        arm, tool=tool, head=CuttingHead(stand_off=2e-3), part=part, placement=placement,
        fixtures=fixtures, links=links, near_miss=5e-3,
    )  # fmt: skip
    return Case(
        name=name, contour=contour, robot=arm, speed=speed, tool=tool, placement=placement,
        gamma_step=step, graph=graph, cell=cell,
    )  # fmt: skip
