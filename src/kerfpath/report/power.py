"""The power of the beam and the speed of the tip along a contour of a report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array, short_repr, spread
from kerfpath.report.style import ACCENT, CHOSEN, FAINT, axis, axis_title, base_layout, short

HEIGHT = 240
MOST_POINTS = 1500
"""Number of points of a line; more are not seen."""


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
    figure = go.Figure(layout=base_layout(HEIGHT, hovermode="x unified"))
    figure.update_layout(
        margin={"l": 62, "r": 44, "t": 40, "b": 48},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12}},
    )
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
    figure.update_layout(
        xaxis=axis(title=axis_title("length, mm"), unifiedhovertitle={"text": "%{x:.1f} mm"}),
        yaxis=axis(title=axis_title("share, %"), range=[0, 105]),
    )
    return figure
