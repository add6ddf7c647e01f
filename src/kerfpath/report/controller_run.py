"""The page of a program that was run on a controller: what the tip and the joints did over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from kerfpath.arrays import Array, Bools
from kerfpath.report.page import FAIL, PASS, WARN, render_page
from kerfpath.report.style import ACCENT, axis, axis_title, band, base_layout, joint_colours
from kerfpath.robots import Robot

ROW = 210
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
        figure=_figure(robot, time, off_path, shares, laser),
    )


def _figure(
    robot: Robot, time: Array, off_path: Array, shares: tuple[Array, Array], laser: Bools
) -> go.Figure:
    """Return three panels over time: path error, velocity and acceleration of the joints."""
    titles = ("distance from the path, mm", "velocity, share of limit", "acceleration, share")
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    figure.update_layout(base_layout(3 * ROW + 60, hovermode="x unified", showlegend=True))
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
