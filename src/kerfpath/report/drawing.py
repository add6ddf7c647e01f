"""The page of a drawing: the part with all loops and their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, floats, short_repr
from kerfpath.report.page import render_page
from kerfpath.report.scene import (
    FAR,
    UNSAID,
    add_part,
    checked,
    first_view,
    labels_apart,
    space_axis,
    xyz,
)
from kerfpath.report.style import ACCENT, ALERT, FAINT, JOINT_COLOURS, base_layout, seen_by

HEIGHT = 720
LABELS = 80
"""Number of names that are drawn; the others show on hover."""
COLOURS = {"outer": ACCENT, "inner": JOINT_COLOURS[0], "open": JOINT_COLOURS[4]}
CAPTIONS = {"outer": "trim line", "inner": "hole", "open": "open line"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DrawnLoop:
    """One loop of the picture.

    Parameters
    ----------
    name : str
    kind : "outer", "inner" or "open"
    points : (K, 3) m
        Points along the loop; a closed loop repeats the first one at the end.
    facts : str
        Hover text.
    fault : bool
        Whether it is drawn as a loop that cannot be cut.
    aside : bool
        Whether it is hidden at first: a piece of a skin, or around the thickness of a sheet.
    """

    name: str
    kind: str
    points: Array
    facts: str = ""
    fault: bool = False
    aside: bool = False

    __repr__ = short_repr


def render_drawing(
    title: str,
    loops: Sequence[DrawnLoop],
    *,
    mesh: tuple[ArrayLike, ArrayLike],
    facts: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
) -> str:
    """Return a self-contained HTML page of a part and its loops.

    Parameters
    ----------
    title : str
    loops : sequence of DrawnLoop
    mesh : (vertices (V, 3) m, triangles (F, 3))
        The part; without triangles only the loops are drawn.
    facts : sequence of (what, value)
    notes : sequence of str
    """
    return render_page(
        "drawing.html", kind="Drawing", title=title, facts=facts, notes=notes,
        picture=_figure(loops, mesh),
    )  # fmt: skip


def _figure(loops: Sequence[DrawnLoop], mesh: tuple[ArrayLike, ArrayLike]) -> go.Figure:
    legend = {"x": 0, "y": 1, "bgcolor": "rgba(255, 255, 255, 0.8)"}
    figure = go.Figure(layout=base_layout(HEIGHT, showlegend=True, legend=legend))
    vertices, triangles = checked(mesh)
    if len(triangles):
        add_part(figure, vertices * 1e3, triangles)
    for aside in (False, True):
        for kind, caption in CAPTIONS.items():
            for fault in (False, True):
                alike = [
                    loop
                    for loop in loops
                    if (loop.aside, loop.kind, loop.fault) == (aside, kind, fault)
                ]
                if alike:
                    colour = ALERT if fault else FAINT if aside else COLOURS[kind]
                    what = caption + ("s" if len(alike) > 1 else "")
                    what += " of single faces and cut edges" if aside else ""
                    _add(figure, alike, what + (" with faults" if fault else ""), colour, aside)
    points = [vertices, *(floats(loop.points, "points", (None, 3)) for loop in loops)]
    named = [loop for loop in loops if not loop.aside][:LABELS]
    labels = [
        (loop.points[0], loop.name, ALERT if loop.fault else COLOURS[loop.kind]) for loop in named
    ]
    figure.update_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0}, scene=_view(np.vstack(points), labels)
    )
    return figure


def _view(points: Array, labels: Sequence[tuple[Array, str, str]]) -> dict[str, object]:
    """Return a scene around `points` (m), to scale; a flat drawing is seen from above."""
    low, high = points.min(axis=0) * 1e3, points.max(axis=0) * 1e3
    size = float((high - low).max())
    # plotly has no scale for an axis of zero length.
    half = np.maximum((high - low) * 0.55, 0.05 * size)
    middle, is_flat = (low + high) / 2, bool(high[2] - low[2] < 1e-3 * size)
    eye = np.array([0.0, 0.0, 1.0] if is_flat else [0.9, -1.3, 1.0])
    camera = {
        "eye": dict(zip("xyz", (FAR * eye / np.linalg.norm(eye)).tolist(), strict=True)),
        "up": {"x": 0.0, "y": float(is_flat), "z": float(not is_flat)},
        "projection": {"type": "orthographic"},
    }
    ends = np.array([middle - half, middle + half])
    sides, places = first_view(ends, camera, HEIGHT)
    return {
        "aspectmode": "manual",
        "aspectratio": sides,
        **seen_by(camera),
        **({"dragmode": "pan"} if is_flat else {}),
        "annotations": labels_apart(labels, places),
        **{
            f"{a}axis": space_axis(a)
            | {"range": ends[:, i].tolist()}
            | (UNSAID if is_flat and a == "z" else {})
            for i, a in enumerate("xyz")
        },
    }


def _add(
    figure: go.Figure, loops: Sequence[DrawnLoop], caption: str, colour: str, aside: bool
) -> None:
    """Add loops as one line with breaks."""
    lines = [floats(loop.points, f"loop {loop.name}", (None, 3)) * 1e3 for loop in loops]
    broken = [np.vstack([line, np.full((1, 3), np.nan)]) for line in lines]
    texts = [f"<b>{escape(loop.name)}</b><br>{escape(loop.facts)}" for loop in loops]
    figure.add_scatter3d(
        **xyz(np.vstack(broken)),
        mode="lines",
        line={"color": colour, "width": 6},
        text=np.repeat(texts, [len(line) for line in broken]).tolist(),
        hovertemplate="%{text}<extra></extra>",
        name=f"{len(loops)} {caption}",
        visible="legendonly" if aside else True,
    )
