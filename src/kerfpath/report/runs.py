"""Pages of runs on a robot or a controller: logs that a response was fitted to, and a record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from kerfpath.arrays import Array, Bools
from kerfpath.report.page import FAIL, PASS, WARN, render_page
from kerfpath.report.style import (
    ACCENT,
    CHOSEN,
    FAINT,
    axis,
    axis_title,
    band,
    base_layout,
    joint_colours,
    short,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# The page of a response that was fitted to logs: how far they are from the paths, cut by cut.

FIT_ROW = 170
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
        figure=_fit_figure(shown),
    )


def _fit_figure(cuts: Sequence[FittedCut]) -> go.Figure:
    """Return a panel for each cut: the distance of the log from both paths along it, mm."""
    figure = make_subplots(
        rows=len(cuts),
        cols=1,
        subplot_titles=[cut.name for cut in cuts],
        vertical_spacing=60 / (FIT_ROW * len(cuts) + 60),
    )
    figure.update_layout(
        base_layout(FIT_ROW * len(cuts) + 100, hovermode="x unified"),
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


# -----------------------------------------------------------------------------
# The page of a program that was run on a controller: what the tip and the joints did over time.

RUN_ROW = 210
"""Height of a panel, px."""
MOST_POINTS = 4000
"""Points of a line that are drawn: of each interval, the largest."""


def render_controller_run(
    title: str,
    robot: Robot,
    *,
    time: Array,
    off_path: Array,
    shares: tuple[Array, Array],
    laser: Bools,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[str]],
    checks: Sequence[tuple[str, str, str, bool, bool]],
    facts: Sequence[tuple[str, str]],
) -> str:
    """Return a self-contained HTML page of a run; the same input gives the same text.

    Parameters
    ----------
    title : str
        Name of the program.
    robot : Robot
    time : (M,) s
    off_path : (M,) m
        Distance of the tip from the lines between targets; NaN where there are none.
    shares : pair of (M, n)
        Velocity and acceleration of each joint as shares of their limits.
    laser : (M,) bool
    heads, rows
        Columns and rows of the table of contours, as for `render_table`.
    checks : sequence of (title, value, limit, ok, is_error)
    facts : sequence of (what, value)
    """
    failed = [(title, error) for title, _, _, ok, error in checks if not ok]
    state = FAIL if any(error for _, error in failed) else WARN if failed else PASS
    words = ", ".join(title for title, _ in failed)
    verdict = f"Run to its end; to note: {words}" if failed else "Run to its end as planned"
    return render_page(
        "controller_run.html",
        title=title,
        kind="Program as run by LinuxCNC",
        state=state,
        verdict=verdict,
        facts=facts,
        checks=checks,
        heads=heads,
        rows=rows,
        figure=_run_figure(robot, time, off_path, shares, laser),
    )


def _run_figure(
    robot: Robot, time: Array, off_path: Array, shares: tuple[Array, Array], laser: Bools
) -> go.Figure:
    """Return three panels over time: path error, velocity and acceleration of the joints."""
    titles = ("distance from the path, mm", "velocity, share of limit", "acceleration, share")
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    figure.update_layout(base_layout(3 * RUN_ROW + 60, hovermode="x unified", showlegend=True))
    at, off = _thinned(time, np.nan_to_num(off_path * 1e3)[:, None])
    figure.add_scatter(
        x=at, y=off[:, 0].round(4), name="tip", line={"color": ACCENT, "width": 1.2}, row=1, col=1
    )
    for row, values in enumerate(shares, 2):
        at, most = _thinned(time, values)
        for k, colour in enumerate(joint_colours(robot)):
            figure.add_scatter(
                x=at, y=most[:, k].round(4), name=robot.joint_names[k], showlegend=row == 2,
                legendgroup=f"joint {k}", line={"color": colour, "width": 1.1}, row=row, col=1,
            )  # fmt: skip
    for row, title in enumerate(titles, 1):
        figure.update_yaxes(axis(title=axis_title(title), rangemode="tozero"), row=row, col=1)
        figure.update_xaxes(axis(), row=row, col=1)
    figure.update_xaxes(title=axis_title("time, s; shaded: laser on"), row=3, col=1)
    edges = np.flatnonzero(np.diff(laser.astype(int), prepend=0, append=0)).tolist()
    last = len(time) - 1
    bands = [
        band(float(time[a]), float(time[min(b, last)]), xref="x", yref="paper")
        for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    figure.update_layout(shapes=bands)
    return figure


def _thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """Return at most `MOST_POINTS` times (s) and the largest values (K, n) of their intervals."""
    step = -(-len(time) // MOST_POINTS)
    starts = np.arange(0, len(time), step)
    return time[starts].round(4), np.maximum.reduceat(values, starts, axis=0)
