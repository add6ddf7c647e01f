"""The 3-D scene of the part, its contours and the transfer moves."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, integers
from kerfpath.cell import Cell, surface
from kerfpath.errors import InputError
from kerfpath.plans import Plan
from kerfpath.report.section import ContourSection
from kerfpath.report.style import ACCENT, ALERT, CHOSEN, FAINT, GRID, INK, QUIET, base_layout

HEIGHT = 560
AXES_DRAWN = 6, 48
"""Least and largest number of tool axes drawn per contour."""
APART = 0.02
"""Distance between drawn tool axes, as a share of the part's size."""
LARGE = 10.0
"""Ratio of part to contour size above which the marks of the contour shrink with it."""
LABELS = 12
"""Number of contours above which names only show on hover."""
BODY_COLOURS = {"robot": "#c9a227", "head": "#5b6675", "fixture": "#8fa8c4"}
CELL_HEIGHT = 760
"""Height of the figure, px; a cell is larger than a part."""
FILL = 1.35
"""Factor on the size at which plotly would draw the scene."""
MOST_POSES = 12
"""Number of poses to choose from."""


def scene(
    sections: Sequence[ContourSection],
    mesh: tuple[ArrayLike, ArrayLike] | None,
    cell: Cell | None = None,
    moves: Sequence[ArrayLike] = (),
) -> go.Figure:
    """Return a figure in mm, to one scale, of the part (mesh in m), contours, cell and moves."""
    figure = go.Figure(layout=base_layout(HEIGHT, showlegend=False))
    corners = [section.path.points * 1e3 for section in sections]
    if mesh is not None:
        vertices, triangles = checked(mesh)
        corners.append(vertices * 1e3)
        add_part(figure, vertices * 1e3, triangles)
    size = float(np.linalg.norm(np.ptp(np.vstack(corners), axis=0))) if corners else 1.0
    for number, section in enumerate(sections, 1):
        _add_contour(figure, section, number, size)
    for number, move in enumerate(moves, 1):
        _add_move(figure, floats(move, "move", (None, 3)) * 1e3, number)
    figure.add_scatter3d(
        x=[None],
        y=[None],
        z=[None],
        mode="markers",
        marker={"color": CHOSEN, "size": 7},
        hoverinfo="skip",
        name="cursor",
    )
    if cell is not None and cell.T_base_part is not None:
        plans = [section.plan for section in sections if section.plan is not None]
        add_cell(figure, cell, cell.T_base_part, poses_shown(plans))
    figure.update_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        scene={
            "aspectmode": "data" if cell is None else "manual",
            "dragmode": "turntable",
            "camera": _camera(sections, cell),
            "annotations": _labels(sections),
            **{f"{a}axis": space_axis(a) for a in "xyz"},
        },
    )
    return figure


def poses_shown(plans: Sequence[Plan]) -> list[tuple[str, Array]]:
    """Return poses as (label, joints (n,) rad or m): starts of plans, and middles if few."""
    nodes = [(plan, k) for plan in plans for k in (0, len(plan.q) // 2)]
    if len(nodes) > MOST_POSES:
        nodes = nodes[::2]
    return [(f"{plan.name}, node {k}", plan.q[k]) for plan, k in nodes[:MOST_POSES]]


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
        height=CELL_HEIGHT, sliders=[{"steps": steps, **look}], scene={"aspectratio": _size(figure)}
    )


def _size(figure: go.Figure) -> dict[str, float]:
    """Return the sides of the box around the scene, to one scale, so that it fills the figure."""
    sides = {}
    for coordinate in "xyz":
        # Breaks in lines and the unset cursor are NaN.
        drawn = [np.array(t[coordinate], np.float64) for t in figure.data if t.visible is not False]
        points = np.concatenate(drawn)
        sides[coordinate] = float(np.ptp(points[np.isfinite(points)]))
    mean = float(np.prod(list(sides.values()))) ** (1 / 3)
    return {axis: FILL * side / mean for axis, side in sides.items()}


def _add_body(
    figure: go.Figure, name: str, kind: str, mesh: tuple[Array, Any], T: Array, *, shown: bool
) -> None:
    vertices = (mesh[0] @ T[:3, :3].T + T[:3, 3]) * 1e3
    figure.add_mesh3d(
        **dict(zip("xyz", vertices.T.astype(np.float32), strict=True)),
        **dict(zip("ijk", mesh[1].T.astype(np.uint32), strict=True)),
        color=BODY_COLOURS[kind],
        opacity=0.55 if kind == "robot" else 0.9,
        flatshading=True,
        name=escape(name),
        hovertemplate="%{fullData.name}<extra></extra>",
        visible=shown,
    )


def add_part(figure: go.Figure, vertices: Array, triangles: Any) -> None:
    """Add the part (mm) to a figure."""
    figure.add_mesh3d(
        **dict(zip("xyz", vertices.T.astype(np.float32), strict=True)),
        **dict(zip("ijk", triangles.T.astype(np.uint32), strict=True)),
        color="#e4e7ec",
        flatshading=False,
        lighting={
            "ambient": 0.5,
            "diffuse": 0.52,
            "specular": 0.06,
            "roughness": 0.9,
            "fresnel": 0.05,
        },
        # In the orthographic view the light turns with the camera, and -z is towards the viewer:
        # a lamp over the left shoulder lights the part however it is turned.
        lightposition={"x": -2e4, "y": 6e4, "z": -1e5},
        hoverinfo="skip",
        name="part",
    )


def _add_contour(figure: go.Figure, section: ContourSection, number: int, size: float) -> None:
    path, name = section.path, escape(section.name)
    # Lift lines slightly towards the nozzle, or the part's surface would cover half of the line.
    points = path.points * 1e3 - path.axes * (0.002 * size)
    colour = ALERT if section.failed else ACCENT
    count = int(np.clip(path.length * 1e3 / (APART * size), *AXES_DRAWN))
    some = np.unique(np.linspace(0, len(path) - 1, min(count, len(path))).round().astype(int))
    mark = min(size, LARGE * float(np.linalg.norm(np.ptp(points, axis=0))))
    feet, tips = points[some], points[some] - path.axes[some] * (0.035 * mark)
    figure.add_scatter3d(
        **_lines(feet, tips),
        mode="lines",
        line={"color": QUIET, "width": 1.5},
        hoverinfo="skip",
        name=f"{name}: tool axes",
    )
    figure.add_scatter3d(
        **xyz(points),
        mode="lines",
        line={"color": colour, "width": 6},
        customdata=np.round((path.s - path.s[0]) * 1e3, 1).astype(np.float32),
        hovertemplate=(
            "node %{pointNumber}, %{customdata:.1f} mm<br>"
            "x %{x:.1f} y %{y:.1f} z %{z:.1f} mm<extra>" + name + "</extra>"
        ),
        name=name,
        meta={"contour": number},
    )
    along = points[min(3, len(points) - 1)] - points[0]
    along = along / np.linalg.norm(along)
    figure.add_cone(
        **xyz(points[:1]),
        **dict(zip("uvw", along[:, None], strict=True)),
        anchor="tail",
        sizemode="raw",
        sizeref=0.03 * mark,
        colorscale=[[0, INK], [1, INK]],
        showscale=False,
        hoverinfo="skip",
        name=f"{name}: direction",
    )
    figure.add_scatter3d(
        **xyz(points[:1]),
        mode="markers",
        marker={"color": INK, "size": 4},
        hovertemplate="start<extra>" + name + "</extra>",
        name=f"{name}: start",
    )
    for place in section.marks:
        figure.add_scatter3d(
            **xyz(place.point[None] * 1e3),
            mode="markers",
            marker={"color": ALERT, "size": 9, "symbol": "x"},
            hovertemplate=f"{escape(place.words)}<extra>{name}</extra>",
            name=f"{name}: fails here",
        )


def _add_move(figure: go.Figure, points: Array, number: int) -> None:
    figure.add_scatter3d(
        **xyz(points),
        mode="lines",
        line={"color": ALERT, "width": 1.5},
        hovertemplate=f"transfer move {number}<extra></extra>",
        name=f"transfer move {number}",
    )


def _labels(sections: Sequence[ContourSection]) -> list[dict[str, object]]:
    """Return the names of contours at their starts, and the first failure of each failed one.

    Alternate heights keep neighbouring names apart.
    """
    named = sections if len(sections) <= LABELS else ()
    labels = [(section.path.points[0], section.name, INK) for section in named]
    failed = [section for section in sections if section.marks][:LABELS]
    labels += [(s.marks[0].point, f"{s.name}: {s.marks[0].words}", ALERT) for s in failed]
    return [
        {
            **dict(zip("xyz", (point * 1e3).tolist(), strict=True)),
            "text": escape(text),
            "font": {"size": 13, "color": colour},
            "bgcolor": "rgba(255, 255, 255, 0.8)",
            "showarrow": True,
            "arrowhead": 0,
            "arrowwidth": 1,
            "arrowcolor": FAINT,
            "ax": 34,
            "ay": (-34, 34, -66, 66)[i % 4],
            "xanchor": "left",
        }
        for i, (point, text, colour) in enumerate(labels)
    ]


def _camera(sections: Sequence[ContourSection], cell: Cell | None) -> dict[str, object]:
    """Return a camera on the side of the nozzle, a little above and beside the part.

    Its up direction is that of the cell, or of the part without a cell.
    """
    placed = None if cell is None else cell.T_base_part
    turn = np.eye(3) if placed is None else placed[:3, :3].T
    axes = [section.path.axes.mean(axis=0) for section in sections]
    towards = -np.mean(axes, axis=0) if axes else np.zeros(3)
    if np.linalg.norm(towards) < 0.3:
        towards = np.zeros(3)
    eye = towards / max(1.0, float(np.linalg.norm(towards))) + turn @ np.array([0.55, -0.75, 0.45])
    eye *= 1.85 / float(np.linalg.norm(eye))
    return {
        "eye": dict(zip("xyz", np.round(eye, 4).tolist(), strict=True)),
        "up": dict(zip("xyz", np.round(turn[:, 2], 4).tolist(), strict=True)),
        "projection": {"type": "orthographic"},
    }


def space_axis(name: str) -> dict[str, object]:
    """Return the look of an axis of a 3-D scene."""
    return {
        "title": {"text": f"{name}, mm", "font": {"size": 12, "color": QUIET}},
        "tickfont": {"size": 10, "color": QUIET},
        "nticks": 6,
        "backgroundcolor": "white",
        "gridcolor": GRID,
        "zerolinecolor": GRID,
        "showspikes": False,
    }


def checked(mesh: tuple[ArrayLike, ArrayLike]) -> tuple[Array, Any]:
    """Return a mesh (vertices, triangles) after checking its indices.

    Raises
    ------
    InputError
        A triangle has the index of a vertex that does not exist.
    """
    vertices = floats(mesh[0], "mesh vertices", (None, 3))
    triangles = integers(mesh[1], "mesh triangles", (None, 3))
    if triangles.size and not (triangles.min() >= 0 and triangles.max() < len(vertices)):
        raise InputError(
            f"mesh triangles: expected indices from 0 to {len(vertices) - 1}, "
            f"got {triangles.min()} to {triangles.max()}"
        )
    return vertices, triangles


def xyz(points: Array) -> dict[str, object]:
    """Return points (K, 3) as plotly takes them."""
    return dict(zip("xyz", points.T.astype(np.float32), strict=True))


def _lines(starts: Array, ends: Array) -> dict[str, object]:
    """Return many separate lines as one trace; plotly breaks a line at NaN."""
    breaks = np.full_like(starts, np.nan)
    return xyz(np.stack([starts, ends, breaks], axis=1).reshape(-1, 3))
