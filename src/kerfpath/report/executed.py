"""How a contour of a report is executed: its path beside the one that is drawn, and its power."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array, short_repr, spread
from kerfpath.report.style import (
    ACCENT,
    CHOSEN,
    FAINT,
    INK,
    axis,
    axis_title,
    base_layout,
    seen_by,
    short,
)

# -----------------------------------------------------------------------------
# The path as it is executed beside the one that is drawn.

HEIGHT, SCENE_HEIGHT = 220, 420
MOST_POINTS = 1500
"""Number of points of a line; more are not seen."""
SHOWN = 0.04
"""Share of the contour's size as which its largest error is drawn, about."""
FACTORS = np.outer(10.0 ** np.arange(0, 6), [1, 2, 5]).ravel()
"""Factors by which errors may be enlarged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExecutedPath:
    """How far the executed tool tip is from the path, sample by sample.

    Parameters
    ----------
    s : (m,) m
        Arc length of the point of the path nearest to the tip.
    nearest, tip : (m, 3) m
        That point, and the tip, in the part.
    off, rounding : (m,) m
        Distance of the tip from the path, and without the lag of the joints.
    allowed : float m
        Largest distance that is allowed.
    facts : sequence of (what, value)
        Rows in words, such as ("Largest distance", "0.2 mm at 35 mm").
    """

    s: Array
    nearest: Array
    tip: Array
    off: Array
    rounding: Array
    allowed: float
    facts: tuple[tuple[str, str], ...] = ()

    __repr__ = short_repr

    @property
    def factor(self) -> float:
        """The factor by which errors are enlarged in the picture."""
        size = float(np.linalg.norm(np.ptp(self.nearest, axis=0)))
        largest = max(float(self.off.max()), 1e-9)
        return float(FACTORS[np.argmin(np.abs(np.log(FACTORS * largest / (SHOWN * size))))])


def error_along(path: ExecutedPath) -> go.Figure:
    """Return the distance from the path along it, mm, with and without the lag of the joints."""
    figure = _along(HEIGHT)
    order = np.argsort(path.s, kind="stable")
    some = order[spread(len(order), MOST_POINTS)]
    for name, values, colour in (
        ("corners alone", path.rounding, FAINT),
        ("as executed", path.off, CHOSEN),
    ):
        figure.add_scatter(
            x=short(path.s[some] * 1e3),
            y=short(values[some] * 1e3),
            mode="lines",
            name=name,
            line={"color": colour, "width": 1.6},
            hovertemplate="%{y:.3f} mm",
        )
    figure.add_hline(y=path.allowed * 1e3, line={"color": INK, "width": 1, "dash": "dash"})
    top = 1.15e3 * max(float(path.off.max()), path.allowed)
    figure.update_layout(yaxis=axis(title=axis_title("distance, mm"), range=[0, top]))
    return figure


def _along(height: int) -> go.Figure:
    """Return an empty figure of what changes along a contour."""
    figure = go.Figure(layout=base_layout(height, hovermode="x unified"))
    figure.update_layout(
        margin={"l": 62, "r": 44, "t": 40, "b": 48},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12}},
        xaxis=axis(title=axis_title("length, mm"), unifiedhovertitle={"text": "%{x:.1f} mm"}),
    )
    return figure


def enlarged(path: ExecutedPath) -> go.Figure:
    """Return the drawn path in the part and the executed one, its errors enlarged."""
    figure = go.Figure(layout=base_layout(SCENE_HEIGHT))
    some = spread(len(path.s), MOST_POINTS)
    moved = path.nearest + path.factor * (path.tip - path.nearest)
    for name, points, colour, width in (
        ("drawn", path.nearest, ACCENT, 3),
        (f"executed, errors x {path.factor:g}", moved, CHOSEN, 4),
    ):
        x, y, z = short(points[some].T * 1e3)
        figure.add_scatter3d(
            x=x, y=y, z=z, mode="lines", name=name, hoverinfo="skip",
            line={"color": colour, "width": width},
        )  # fmt: skip
    hidden: dict[str, Any] = {"visible": False}
    # To one scale; not by "data", which enlarges what is flat beyond the picture.
    sizes = np.ptp(np.vstack([path.nearest, moved]), axis=0)
    shares = np.maximum(sizes / sizes.max(), 1e-3)
    figure.update_layout(
        margin={"l": 0, "r": 0, "t": 0, "b": 0},
        legend={"orientation": "h", "x": 0, "y": 1, "yanchor": "top", "font": {"size": 12}},
        scene={
            "aspectmode": "manual",
            "aspectratio": {
                name: float(f"{share:.3g}") for name, share in zip("xyz", shares, strict=True)
            },
            "xaxis": hidden,
            "yaxis": hidden,
            "zaxis": hidden,
            **seen_by(_camera(path.nearest)),
        },
    )
    return figure


def _camera(points: Array) -> dict[str, Any]:
    """Return a camera that looks across the plane in which the points (m, 3) mostly lie."""
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    eye = 1.5 * (normal if normal[2] >= 0 else -normal)
    up = {"x": 0, "y": 1, "z": 0} if abs(normal[2]) > 0.9 else {"x": 0, "y": 0, "z": 1}
    x, y, z = (float(f"{value:.3g}") for value in eye)
    return {"eye": {"x": x, "y": y, "z": z}, "up": up}


# -----------------------------------------------------------------------------
# The power of the beam and the speed of the tip along the way.

POWER_HEIGHT = 240


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerPath:
    """The power along a cut of m moves, in shares of the full power and of the programmed speed.

    Parameters
    ----------
    s : (m+1,) m
        Length of the way up to each target.
    set : (m,)
        The power that the program sets in each move.
    fine_s : (k,) m
        Length of the way at samples.
    speed, asked : (k,)
        Executed speed there, and the power by it.
    facts : sequence of (what, value)
        Rows in words.
    """

    s: Array
    set: Array
    fine_s: Array
    speed: Array
    asked: Array
    facts: tuple[tuple[str, str], ...] = ()

    __repr__ = short_repr


def power_along(path: PowerPath) -> go.Figure:
    """Return the power and the speed along the way, per cent; the power is set at targets."""
    figure = _along(POWER_HEIGHT)
    some = spread(len(path.fine_s), MOST_POINTS)
    steps = np.append(path.set, path.set[-1:])
    for name, s, values, colour, shape in (
        ("speed", path.fine_s[some], path.speed[some], FAINT, "linear"),
        ("power by the speed", path.fine_s[some], path.asked[some], ACCENT, "linear"),
        ("power", path.s, steps, CHOSEN, "hv"),
    ):
        figure.add_scatter(
            x=short(s * 1e3),
            y=short(100 * values),
            mode="lines",
            name=name,
            line={"color": colour, "width": 1.8, "shape": shape},
            hovertemplate="%{y:.1f} %",
        )
    figure.update_layout(yaxis=axis(title=axis_title("share, %"), range=[0, 105]))
    return figure
