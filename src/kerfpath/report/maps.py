"""The feasibility map: gamma over nodes, one panel per posture, coloured by reason of loss."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import product

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss
from kerfpath.plans import Plan
from kerfpath.report.style import (
    ALERT,
    INK,
    QUIET,
    axis,
    axis_id,
    axis_title,
    base_layout,
    label,
    reason_colours,
)
from kerfpath.robots import posture_name

ROW, GAP, TOP, BOTTOM = 150, 34, 48, 50
"""Height of a panel, of the gap between two, and of the margins (buttons at the top), px."""

HALF_TURN = 180.0
"""End of the map, deg; the map begins at -180 deg."""


def feasibility_map(
    graph: LayeredGraph,
    plan: Plan | None = None,
    *,
    s: Array | None = None,
    marks: Sequence[tuple[float, str]] = (),
) -> go.Figure:
    """Return the feasibility map of a layered graph, with the chosen gamma drawn on it.

    It has one panel for each posture with an admitted candidate, and in a panel one pixel for each
    node (horizontal) and gamma (vertical), coloured by the reason of that candidate. The panels
    share their axes: zooming one zooms all.

    Parameters
    ----------
    graph : LayeredGraph
        Its `reason_by_gamma` is drawn.
    plan : Plan, optional
        Its gamma is drawn as a line on the posture in use, interrupted where the posture changes.
        Where gamma passes 180 deg, the line leaves at one edge and enters at the other.
    s : (K,) m, optional
        Arc length of the nodes, for the hover text; default: that of the plan.
    marks : sequence of (float, str)
        Nodes to mark, such as the one where the path breaks, with a text; only the first text is
        shown.

    Returns
    -------
    plotly.graph_objects.Figure
        ``layout.meta`` holds `reasons`, `postures`, `s_mm` and `nodes` for hover handlers.
    """
    postures = shown_postures(graph)
    gamma = np.degrees(graph.gamma)
    step, nodes = 360.0 / len(gamma), len(graph.reason)
    parts = 1 if plan is None else (len(plan.q) - 1) // (nodes - 1)
    height = TOP + BOTTOM + len(postures) * ROW + (len(postures) - 1) * GAP
    if s is None and plan is not None:
        s = plan.contour.s
    used = set() if plan is None else {int(mu) for mu in plan.posture}
    axes: dict[str, object] = {}
    annotations = list[dict[str, object]]()
    for row, mu in enumerate(postures):
        axes |= _axes(row, len(postures), height, nodes)
        annotations.append(
            label(
                posture_name(mu) + (" (in use)" if mu in used else ""),
                ((0, "paper"), (1, f"{axis_id('y', row)} domain")),
                colour=INK if mu in used or plan is None else QUIET,
                xanchor="left",
                yanchor="bottom",
            )
        )
    meta = {
        "reasons": list(graph.reasons),
        "postures": [posture_name(mu) for mu in postures],
        "s_mm": [] if s is None else np.round((s - s[0]) * 1e3, 2).tolist(),
        "nodes": np.round(np.arange((nodes - 1) * parts + 1) / parts, 4).tolist(),
    }
    # The layout is set in one call, as each call takes plotly much longer than the heatmaps.
    layout = base_layout(
        height,
        hovermode="closest",
        margin={"l": 62, "r": 16, "t": TOP, "b": BOTTOM},
        annotations=[*annotations, *_words_of(marks[:1])],
        shapes=_lines_of(marks, len(postures)),
        meta=meta,
        **axes,
    )
    figure = go.Figure(layout=layout)
    for row, mu in enumerate(postures):
        figure.add_heatmap(
            z=np.ascontiguousarray(graph.reason_by_gamma[:, :, mu].T),
            x0=0,
            dx=1,
            y0=float(gamma[0]),
            dy=step,
            xaxis=axis_id("x", row),
            yaxis=axis_id("y", row),
            zmin=-0.5,
            zmax=len(graph.reasons) - 0.5,
            colorscale=_steps(reason_colours(graph.reasons)),
            showscale=False,
            name=posture_name(mu),
            meta={"posture": posture_name(mu)},
            hovertemplate="node %{x}<br>gamma %{y:.1f}°<extra>%{meta.posture}</extra>",
        )
        if plan is not None and mu in used:
            _add_choice(figure, plan, mu, row, parts)
    _add_legend(figure, graph, postures, has_plan=plan is not None)
    return figure


def shown_postures(graph: LayeredGraph) -> list[int]:
    """Return the postures with an admitted candidate; else those with several reasons; else all."""
    every = range(graph.reason.shape[-1])
    kept = (Loss.ADMITTED, Loss.SPARE)
    codes = [c for c, why in enumerate(graph.reasons) if why.loss in kept]
    admitted = [mu for mu in every if np.isin(graph.reason_by_gamma[:, :, mu], codes).any()]
    # A posture with the same reason everywhere needs no panel.
    mixed = [mu for mu in every if np.ptp(graph.reason_by_gamma[:, :, mu])]
    return admitted or mixed or list(every)


def hidden_postures(graph: LayeredGraph) -> list[str]:
    """Return a line for each posture without a panel, with the reasons of its candidates."""
    shown, left_out = shown_postures(graph), list[str]()
    for mu in range(graph.reason.shape[-1]):
        if mu in shown:
            continue
        codes = graph.reason_by_gamma[:, :, mu]
        number = np.bincount(codes.ravel(), minlength=len(graph.reasons))
        order = [int(c) for c in np.argsort(-number, kind="stable") if number[c]]
        if len(order) == 1:
            why = f"{graph.reasons[order[0]]} everywhere"
        else:
            shares = [f"{graph.reasons[c]} {_share(number[c] / codes.size)}" for c in order]
            why = "no admitted candidate (" + ", ".join(shares) + ")"
        left_out.append(f"{posture_name(mu)}: {why}")
    return left_out


def chosen_line(plan: Plan, posture: int, parts: int = 1) -> list[tuple[Array, Array]]:
    """Return the chosen gamma on one posture as unbroken pieces of (node, gamma in deg).

    A piece ends where the posture changes or gamma passes 180 deg. In the latter case it continues
    beyond the edge to the next node, and the next piece begins before the edge. A refined plan may
    divide the intervals between the nodes into `parts`.
    """
    gamma = np.degrees(np.unwrap(plan.gamma))
    turn = np.round((np.degrees(plan.gamma) - gamma) / 360)
    nodes = np.flatnonzero(plan.posture == posture)
    if not nodes.size:
        return []
    pieces = []
    for run in np.split(nodes, np.flatnonzero(np.diff(nodes) > 1) + 1):
        for piece in np.split(run, np.flatnonzero(np.diff(turn[run])) + 1):
            shown = np.arange(max(piece[0] - 1, run[0]), min(piece[-1] + 1, run[-1]) + 1)
            pieces.append((shown / parts, gamma[shown] + 360 * turn[piece[0]]))
    return pieces


def _axes(row: int, rows: int, height: int, nodes: int) -> dict[str, object]:
    """Return both axes of a panel, by their names in the layout."""
    inner = height - TOP - BOTTOM
    top = 1 - row * (ROW + GAP) / inner
    last = row == rows - 1
    return {
        axis_id("xaxis", row): axis(
            anchor=axis_id("y", row),
            matches=None if row == 0 else "x",
            range=[-0.5, nodes - 0.5],
            showticklabels=last,
            showgrid=False,
            title=axis_title("node along the contour") if last else None,
        ),
        axis_id("yaxis", row): axis(
            anchor=axis_id("x", row),
            matches=None if row == 0 else "y",
            domain=[max(0.0, top - ROW / inner), min(1.0, top)],
            range=[-180, 180],
            tickvals=[-180, -90, 0, 90, 180],
            ticktext=["\N{MINUS SIGN}180°", "\N{MINUS SIGN}90°", "0°", "90°", "180°"],
            showgrid=False,
            title=axis_title("gamma"),
        ),
    }


def _add_choice(figure: go.Figure, plan: Plan, posture: int, row: int, parts: int) -> None:
    pieces = chosen_line(plan, posture, parts)
    gap = np.array([np.nan])
    # plotly breaks a line at NaN.
    x = np.concatenate([part for piece in pieces for part in (piece[0], gap)])[:-1]
    y = np.concatenate([part for piece in pieces for part in (piece[1], gap)])[:-1]
    where = {"xaxis": axis_id("x", row), "yaxis": axis_id("y", row), "showlegend": False}
    template = "node %{x}<br>gamma %{y:.1f}°<extra>chosen</extra>"
    for colour, width in (("white", 4.5), (INK, 2)):
        figure.add_scatter(
            x=x,
            y=y,
            mode="lines",
            line={"color": colour, "width": width},
            name="chosen gamma",
            hoverinfo="skip" if colour == "white" else None,
            hovertemplate=None if colour == "white" else template,
            **where,
        )
    every = ((piece[0][i], piece[1][i]) for piece in pieces for i in (0, -1))
    ends = [end for end in every if abs(end[1]) <= HALF_TURN]
    figure.add_scatter(
        x=[end[0] for end in ends],
        y=[end[1] for end in ends],
        mode="markers",
        marker={"color": INK, "size": 6, "line": {"color": "white", "width": 1}},
        name="chosen gamma",
        hoverinfo="skip",
        cliponaxis=False,
        **where,
    )


def _lines_of(marks: Sequence[tuple[float, str]], rows: int) -> list[dict[str, object]]:
    """Return a dotted line in every panel for each mark, over a white one."""
    halo, dots = {"color": "white", "width": 4}, {"color": ALERT, "width": 2, "dash": "dot"}
    return [
        {
            "type": "line",
            "x0": node,
            "x1": node,
            "xref": axis_id("x", row),
            "y0": 0,
            "y1": 1,
            "yref": f"{axis_id('y', row)} domain",
            "line": line,
        }
        for (node, _), row, line in product(marks, range(rows), (halo, dots))
    ]


def _words_of(marks: Sequence[tuple[float, str]]) -> list[dict[str, object]]:
    """Return the texts of marks, above the first panel."""
    at = ((1, "paper"), (1, "y domain"))
    return [
        label(f"┊ {escape(words)}", at, colour=ALERT, xanchor="right", yanchor="bottom")
        for _, words in marks
    ]


def _add_legend(
    figure: go.Figure, graph: LayeredGraph, postures: list[int], *, has_plan: bool
) -> None:
    colours = reason_colours(graph.reasons)
    for code in np.unique(graph.reason_by_gamma[:, :, postures]):
        figure.add_scatter(
            x=[None],
            y=[None],
            mode="markers",
            marker={
                "symbol": "square",
                "size": 12,
                "color": colours[code],
                "line": {"color": QUIET, "width": 0.5},
            },
            name=graph.reasons[code],
            hoverinfo="skip",
        )
    if has_plan:
        figure.add_scatter(
            x=[None],
            y=[None],
            mode="lines",
            line={"color": INK, "width": 2},
            name="chosen gamma",
            hoverinfo="skip",
        )


def _steps(colours: tuple[str, ...]) -> list[tuple[float, str]]:
    """Return a colour scale of equal steps, one per reason code."""
    n = len(colours)
    return [(edge, c) for i, c in enumerate(colours) for edge in (i / n, (i + 1) / n)]


def _share(part: float) -> str:
    return f"{part * 100:.0f} %" if part >= 0.01 else "< 1 %"
