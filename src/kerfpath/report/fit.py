"""The page of a response that was fitted to logs: how far they are from the paths, cut by cut."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from kerfpath.arrays import Array
from kerfpath.report.page import render_page
from kerfpath.report.style import CHOSEN, FAINT, axis, axis_title, base_layout, short

ROW = 170
"""Height of a panel, px."""
MOST = 24
"""Number of cuts that are shown: those with the largest distances that are left."""


class FittedCut(NamedTuple):
    """How far a log is from the paths of a cut, along it.

    `s` (k,) m is the length of the way up to each point of the log, `without` and `left` (k,) m are
    its distances from the path without lag and from the executed path.
    """

    name: str
    s: Array
    without: Array
    left: Array


def render_fit(
    title: str,
    cuts: Sequence[FittedCut],
    *,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[str]],
    caption: str,
    facts: Sequence[tuple[str, str]],
    notes: Sequence[str],
) -> str:
    """Return a self-contained HTML page of a fit; the same input gives the same text.

    Parameters
    ----------
    title : str
    cuts : sequence of FittedCut
    heads, rows, caption
        The table of the forms that were tried, as for `render_table`.
    facts : sequence of (what, value)
    notes : sequence of str
        What the logs cannot tell.
    """
    shown = sorted(cuts, key=lambda cut: -float(cut.left.max()))[:MOST]
    return render_page(
        "fit.html",
        title=title,
        kind="Response of the joints, fitted to logs",
        heads=heads,
        rows=rows,
        caption=caption,
        facts=facts,
        notes=notes,
        shown=f"{len(shown)} of {len(cuts)} logged runs" if len(shown) < len(cuts) else "",
        figure=_figure(shown),
    )


def _figure(cuts: Sequence[FittedCut]) -> go.Figure:
    """Return a panel for each cut: the distance of the log from both paths along it, mm."""
    figure = make_subplots(
        rows=len(cuts),
        cols=1,
        subplot_titles=[cut.name for cut in cuts],
        vertical_spacing=60 / (ROW * len(cuts) + 60),
    )
    figure.update_layout(
        base_layout(ROW * len(cuts) + 100, hovermode="x unified"),
        showlegend=True,
        legend={"orientation": "h", "x": 0, "y": 0.995, "yref": "container", "yanchor": "top"},
        margin={"l": 62, "r": 16, "t": 60, "b": 46},
    )
    most = 1.1e3 * max(float(max(cut.without.max(), cut.left.max())) for cut in cuts)
    for row, cut in enumerate(cuts, 1):
        for name, values, colour in (
            ("without lag", cut.without, FAINT),
            ("as fitted", cut.left, CHOSEN),
        ):
            figure.add_scatter(
                x=short(cut.s * 1e3), y=short(values * 1e3), name=name, legendgroup=name,
                showlegend=row == 1, line={"color": colour, "width": 1.4}, row=row, col=1,
                hovertemplate="%{y:.3f} mm",
            )  # fmt: skip
        figure.update_yaxes(axis(title=axis_title("mm"), range=[0, most]), row=row, col=1)
        figure.update_xaxes(axis(unifiedhovertitle={"text": "%{x:.1f} mm"}), row=row, col=1)
    figure.update_xaxes(title=axis_title("length, mm"), row=len(cuts), col=1)
    return figure
