"""The plots of a Pareto set; the script of the page fills and links them."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from html import escape

import numpy as np
import plotly.graph_objects as go

from kerfpath._arrays import Array
from kerfpath.report._front import FrontAxis
from kerfpath.report._look import (
    CHOSEN,
    FAINT,
    INK,
    QUIET,
    SCALE,
    axis,
    axis_title,
    base_layout,
)

__all__ = ["LABEL_LOOK", "axis_labels", "parallel", "scatter"]

LABEL_LOOK = {
    "showarrow": True,
    "arrowhead": 0,
    "arrowwidth": 1,
    "arrowcolor": QUIET,
    "standoff": 6,
    "font": {"size": 12, "color": INK},
    "bgcolor": "rgba(255, 255, 255, 0.85)",
}
"""Style of the labels of marked plans."""
LABEL = 16
"""Number of characters in a line of an axis label."""


def scatter(axes: Sequence[FrontAxis]) -> go.Figure:
    """Return the scatter plot without its points: the script shows those of the chosen criteria."""
    figure = go.Figure(layout=base_layout(520, showlegend=False, hovermode="closest"))
    figure.update_layout(
        margin={"l": 72, "r": 20, "t": 16, "b": 56},
        xaxis=axis(automargin=True, title=axis_title("")),
        yaxis=axis(automargin=True, title=axis_title(""), visible=len(axes) > 1),
    )
    figure.add_scatter(mode="markers", marker={"size": 6, "color": "#d3d8df"}, hoverinfo="skip")
    figure.add_scatter(
        mode="markers",
        marker={
            "size": 10,
            "line": {"width": 1, "color": "white"},
            "colorscale": SCALE,
            "colorbar": {
                "thickness": 12,
                "outlinewidth": 0,
                "tickfont": {"size": 11, "color": QUIET},
                "title": {"side": "right", "font": {"size": 12, "color": QUIET}},
            },
        },
        hovertemplate="%{text}<extra></extra>",
        unselected={"marker": {"opacity": 0.12}},
    )
    ring = {"size": 19, "symbol": "circle-open", "color": CHOSEN, "line": {"width": 3}}
    figure.add_scatter(mode="markers", marker=ring, hoverinfo="skip")
    return figure


def axis_labels(axes: Sequence[FrontAxis]) -> list[list[str]]:
    """Return the lines of each axis label, padded with empty lines at the top to equal counts."""
    labels = [
        [
            *textwrap.wrap(criterion.words, LABEL, max_lines=3, placeholder=" …"),
            criterion.unit_and_arrow,
        ]
        for criterion in axes
    ]
    lines = max(len(label) for label in labels)
    return [[""] * (lines - len(label)) + label for label in labels]


def parallel(
    axes: Sequence[FrontAxis], values: Array, labels: Sequence[Sequence[str]]
) -> go.Figure:
    """Return parallel axes of the plans' values (P, C), with the better end at the bottom."""
    top = 24 + 17 * len(labels[0])
    figure = go.Figure(layout=base_layout(350 + top))
    dimensions = []
    for criterion, label, column in zip(axes, labels, values.T, strict=True):
        low, high = float(column.min()), float(column.max())
        if low == high:
            spare = abs(low) or 1.0
            low, high = low - spare, high + spare
        dimensions.append(
            {
                "label": "<br>".join(escape(line) or " " for line in label),
                "values": column.tolist(),
                "range": [low, high] if criterion.sense > 0 else [high, low],
            }
        )
    figure.add_parcoords(
        dimensions=dimensions,
        line={"color": np.zeros(len(values)).tolist(), "cmin": 0, "cmax": 1},
        labelfont={"size": 12, "color": INK},
        tickfont={"size": 11, "color": INK},
        rangefont={"size": 1, "color": "rgba(0, 0, 0, 0)"},
        unselected={"line": {"color": FAINT, "opacity": 0.12}},
    )
    figure.update_layout(
        margin={"l": 64, "r": 64, "t": top, "b": 40},
        annotations=[
            {
                "text": "▼ better",
                "font": {"color": QUIET},
                "xref": "paper",
                "yref": "paper",
                "x": 0.5,
                "y": 0,
                "yshift": -28,
                "showarrow": False,
            }
        ],
    )
    return figure
