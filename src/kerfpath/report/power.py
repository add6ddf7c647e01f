"""The power of the beam and the speed of the tip along a contour of a report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array, short_repr
from kerfpath.report.style import ACCENT, CHOSEN, FAINT, axis, axis_title, base_layout, short

HEIGHT = 240


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerPath:
    """The power along a cut of m moves, in shares of the full power and of the programmed speed.

    Parameters
    ----------
    s : (m+1,) m
        Length of the way up to each target.
    speed, asked, set : (m,)
        Executed speed in each move, the power by it, and the power that the program sets.
    facts : sequence of (what, value)
        Rows in words.
    """

    s: Array
    speed: Array
    asked: Array
    set: Array
    facts: tuple[tuple[str, str], ...] = ()

    __repr__ = short_repr


def power_along(path: PowerPath) -> go.Figure:
    """Return the power and the speed along the way, per cent, as steps from target to target."""
    figure = go.Figure(layout=base_layout(HEIGHT, hovermode="x unified"))
    figure.update_layout(
        margin={"l": 62, "r": 44, "t": 40, "b": 48},
        legend={"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "font": {"size": 12}},
    )
    for name, values, colour, width in (
        ("speed", path.speed, FAINT, 1.6),
        ("power by the speed", path.asked, ACCENT, 1.6),
        ("power", path.set, CHOSEN, 2.2),
    ):
        figure.add_scatter(
            x=short(path.s * 1e3),
            y=short(100 * np.append(values, values[-1:])),
            mode="lines",
            name=name,
            line={"color": colour, "width": width, "shape": "hv"},
            hovertemplate="%{y:.1f} %",
        )
    figure.update_layout(
        xaxis=axis(title=axis_title("length, mm"), unifiedhovertitle={"text": "%{x:.1f} mm"}),
        yaxis=axis(title=axis_title("share, %"), range=[0, 105]),
    )
    return figure
