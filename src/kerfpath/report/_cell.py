"""The cell in 3-D: fixed bodies, and robot and head at a choice of poses."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go

from kerfpath._arrays import Array
from kerfpath.cell import Cell, surface
from kerfpath.plans import Plan
from kerfpath.report._look import INK

__all__ = ["add_cell", "poses_shown"]

COLOURS = {"robot": "#c9a227", "head": "#5b6675", "fixture": "#8fa8c4"}
HEIGHT = 760
"""Height of the figure, px; a cell is larger than a part."""
FILL = 1.35
"""Factor on the size at which plotly would draw the scene."""
MOST = 12
"""Number of poses to choose from."""


def poses_shown(plans: Sequence[Plan]) -> list[tuple[str, Array]]:
    """Return poses as (label, joints (n,) rad or m): starts of plans, and middles if few."""
    nodes = [(plan, k) for plan in plans for k in (0, len(plan.q) // 2)]
    if len(nodes) > MOST:
        nodes = nodes[::2]
    return [(f"{plan.name}, node {k}", plan.q[k]) for plan, k in nodes[:MOST]]


def add_cell(
    figure: go.Figure, cell: Cell, T_base_part: Array, poses: Sequence[tuple[str, Array]]
) -> None:
    """Add a cell to a figure, in the part's frame and mm, with a slider over the poses.

    The part itself is not drawn; without poses, neither are robot and head. If external axes carry
    the part, it stays where it is drawn, and the bodies that they do not carry move around it.
    """
    T_part_base = np.asarray(np.linalg.inv(T_base_part), dtype=np.float64)
    before = len(figure.data)
    drawn_here = [body for body in cell.bodies if body.kind not in ("part", "floor")]
    still = [body for body in drawn_here if body.frame == 0]
    moving = [body for body in drawn_here if body.frame != 0]
    for body in still:
        _add_body(figure, body.name, body.kind, surface(body.shape), T_part_base, shown=True)
    drawn = {body.name: surface(body.shape) for body in moving}
    for i, (_, q) in enumerate(poses):
        frames = cell.frames(q[None])[0]
        for body in moving:
            T = T_part_base @ np.linalg.inv(frames[0]) @ frames[body.frame]
            _add_body(figure, body.name, body.kind, drawn[body.name], T, shown=i == 0)
    if not poses:
        return
    steps = []
    for i, (name, _) in enumerate(poses):
        shown = [True] * (before + len(still))
        for j in range(len(poses)):
            shown += [i == j] * len(moving)
        steps.append(
            {"label": f"robot at {escape(name)}", "method": "restyle", "args": ["visible", shown]}
        )
    steps.append(
        {
            "label": "part only",
            "method": "restyle",
            "args": ["visible", [True] * before + [False] * (len(figure.data) - before)],
        }
    )
    # Only the current step is named, above the slider; the names of all steps would overlap.
    look: dict[str, object] = {
        "currentvalue": {"prefix": "Shown: ", "font": {"size": 13, "color": INK}},
        "font": {"size": 1, "color": "white"},
        "ticklen": 0,
        "len": 0.5,
        "x": 0.25,
        "y": 0.0,
        "yanchor": "bottom",
    }
    figure.update_layout(
        height=HEIGHT, sliders=[{"steps": steps, **look}], scene={"aspectratio": _size(figure)}
    )


def _size(figure: go.Figure) -> dict[str, float]:
    """Return the sides of the box around the scene, to one scale, so that it fills the figure."""
    sides = {}
    for axis in "xyz":
        # Breaks in lines and the unset cursor are NaN.
        drawn = [np.array(t[axis], np.float64) for t in figure.data if t.visible is not False]
        points = np.concatenate(drawn)
        sides[axis] = float(np.ptp(points[np.isfinite(points)]))
    mean = float(np.prod(list(sides.values()))) ** (1 / 3)
    return {axis: FILL * side / mean for axis, side in sides.items()}


def _add_body(
    figure: go.Figure, name: str, kind: str, mesh: tuple[Array, Any], T: Array, *, shown: bool
) -> None:
    vertices = (mesh[0] @ T[:3, :3].T + T[:3, 3]) * 1e3
    figure.add_mesh3d(
        **dict(zip("xyz", vertices.T.astype(np.float32), strict=True)),
        **dict(zip("ijk", mesh[1].T.astype(np.uint32), strict=True)),
        color=COLOURS[kind],
        opacity=0.55 if kind == "robot" else 0.9,
        flatshading=True,
        name=escape(name),
        hovertemplate="%{fullData.name}<extra></extra>",
        visible=shown,
    )
