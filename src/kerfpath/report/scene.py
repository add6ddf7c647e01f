"""The 3-D scene of the part, its contours and the transfer moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
from kerfpath.report.style import (
    ACCENT,
    ALERT,
    CHOSEN,
    FAINT,
    GRID,
    INK,
    QUIET,
    base_layout,
    seen_by,
)

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
FILL = 0.9
"""Half the height that the scene has at most in the first view, in plotly's units."""
FAR = 1.85
"""Distance of the camera from the middle of a scene, in plotly's units."""
UNIT = 0.423
"""plotly's unit on the screen, as a share of the height of a figure, seen from so far."""
WIDE = 1.2
"""Width of the narrowest figure, in heights."""
FLAT = 0.1
"""Share of the longest side of a scene below which the ticks of a side have no room for numbers."""
UNSAID = {"showticklabels": False, "title": {"text": ""}}
"""The look of the axis along such a side."""
LETTER = 7.5, 20
"""Width and height of a letter of a label, px."""
START = 6
"""Half the size of the mark at a start, px."""
OFFSETS = [(x, y) for far in (34, 66, 98, 130) for x in (34, -34) for y in (-far, far)]
"""Where labels may lie from what they name, px right and down; the first with room is taken."""
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
    camera = _camera(sections, cell)
    if cell is not None and cell.T_base_part is not None:
        figure.layout.height = CELL_HEIGHT
        plans = [section.plan for section in sections if section.plan is not None]
        add_cell(figure, cell, cell.T_base_part, poses_shown(plans))
    sides, places = first_view(_ends(figure), camera, figure.layout.height)
    flat = FLAT * max(sides.values())
    figure.update_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        scene={
            "aspectmode": "manual",
            "aspectratio": sides,
            **seen_by(camera),
            "annotations": _labels(sections, places, numbered=bool(moves)),
            **{f"{a}axis": space_axis(a) for a in sides},
            **{f"{a}axis": space_axis(a) | UNSAID for a in sides if sides[a] < flat},
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
    figure.update_layout(sliders=[{"steps": steps, **look}])


def _ends(figure: go.Figure) -> Array:
    """Return the lowest and highest coordinates (2, 3) of what a figure shows at first."""
    ends = []
    for coordinate in "xyz":
        # Breaks in lines and the unset cursor are NaN.
        drawn = [np.array(t[coordinate], np.float64) for t in figure.data if t.visible is not False]
        points = np.concatenate(drawn)
        points = points[np.isfinite(points)]
        ends.append((points.min(), points.max()) if points.size else (0.0, 1.0))
    return np.array(ends).T


def first_view(
    ends: Array, camera: Mapping[str, Mapping[str, float]], height: float
) -> tuple[dict[str, float], Callable[[Array], Array]]:
    """Return how a scene is seen first: to one scale, and whole, however flat it is.

    Parameters
    ----------
    ends : (2, 3) mm
        Corners of the box around it, the lowest first.
    camera : mapping
        As of plotly; its eye is `FAR` from the middle.
    height : float px
        That of the figure.

    Returns
    -------
    dict of str to float
        Sides of the box, as plotly takes them.
    callable
        It maps points (P, 3) mm to places (P, 2) px from the middle of the figure, right and down.
    """
    low, high = ends
    towards, up = (np.array([camera[key][a] for a in "xyz"]) for key in ("eye", "up"))
    right = np.cross(up, towards)
    ways = np.array([right, np.cross(towards, right)])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    # Half the width and height of the box as the camera sees it.
    across, along = np.abs(ways) @ (high - low) / 2
    scale = FILL / max(across / WIDE, along)
    pixels = UNIT * scale * height * np.array([[1.0], [-1.0]]) * ways

    def places(points: Array) -> Array:
        return np.asarray((points - (low + high) / 2) @ pixels.T)

    return dict(zip("xyz", (scale * (high - low)).tolist(), strict=True)), places


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


def _labels(
    sections: Sequence[ContourSection], places: Callable[[Array], Array], *, numbered: bool
) -> list[dict[str, object]]:
    """Return the names of contours at their starts, and the first failure of each failed one.

    If they are `numbered`, names begin with the place of each in the order of cutting.
    """
    named = sections if len(sections) <= LABELS else ()
    labels = [
        (section.path.points[0], f"{k}. {section.name}" if numbered else section.name, INK)
        for k, section in enumerate(named, 1)
    ]
    failed = [section for section in sections if section.marks][:LABELS]
    labels += [(s.marks[0].point, f"{s.name}: {s.marks[0].words}", ALERT) for s in failed]
    return labels_apart(labels, places)


def labels_apart(
    labels: Sequence[tuple[Array, str, str]], places: Callable[[Array], Array]
) -> list[dict[str, object]]:
    """Return labels of places in a scene, beside each other where there is room in the first view.

    Parameters
    ----------
    labels : sequence of (place (3,) m, text, colour)
        Texts lie beside all places, too.
    places : callable
        As `first_view` returns it.
    """
    if not labels:
        return []
    at = places(np.array([point for point, _, _ in labels]) * 1e3)
    taken = [np.array([place - START, place + START]) for place in at]
    found = []
    for (point, text, colour), place in zip(labels, at, strict=True):
        boxes = [_text_box(place, text, *offset) for offset in OFFSETS]
        free = (k for k, box in enumerate(boxes) if not any(_overlap(box, b) for b in taken))
        chosen = next(free, 0)
        taken.append(boxes[chosen])
        ax, ay = OFFSETS[chosen]
        found.append(
            {
                **dict(zip("xyz", (point * 1e3).tolist(), strict=True)),
                "text": escape(text),
                "font": {"size": 13, "color": colour},
                "bgcolor": "rgba(255, 255, 255, 0.8)",
                "showarrow": True,
                "arrowhead": 0,
                "arrowwidth": 1,
                "arrowcolor": FAINT,
                "ax": ax,
                "ay": ay,
                "xanchor": "left" if ax > 0 else "right",
            }
        )
    return found


def _text_box(place: Array, text: str, ax: int, ay: int) -> Array:
    """Return the corners (2, 2) px of a label, its lower values first."""
    width, height = LETTER[0] * len(text), LETTER[1]
    left = place[0] + ax - (width if ax < 0 else 0)
    top = place[1] + ay - height / 2
    return np.array([[left, top], [left + width, top + height]])


def _overlap(a: Array, b: Array) -> bool:
    return bool((a[0] < b[1]).all() and (b[0] < a[1]).all())


def _camera(sections: Sequence[ContourSection], cell: Cell | None) -> dict[str, Any]:
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
    eye *= FAR / float(np.linalg.norm(eye))
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
