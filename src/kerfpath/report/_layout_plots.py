"""The figures on the page of a layout: the map of placements, and the progress of the search."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from kerfpath.report._layout_entry import LayoutEntry, LayoutMap, MapSquare, promise
from kerfpath.report._look import (
    ACCENT,
    ALERT,
    FAINT,
    INK,
    QUIET,
    axis,
    axis_title,
    base_layout,
)

__all__ = ["convergence", "placement_map"]

HEIGHT = 560
WHY = {"unreachable": "#b4bac4", "collision": "#f2b8b5", "speed": "#f8d9a0"}
"""Colours of infeasible placements, by status."""
SCALE = [[0.0, "#f3f8e6"], [0.35, "#bfe0c4"], [0.7, "#4fa897"], [1.0, "#0b5c58"]]
WORDS = {"speed": "m/min", "margin": "times requested speed", "motion": "displacement"}


def placement_map(entry: LayoutEntry, drawn: LayoutMap) -> go.Figure:
    """Return the map over the first two variables, or the only one, with the tried placements."""
    return _plane(entry, drawn) if drawn["y"] else _line(entry, drawn)


def _title(name: str) -> dict[str, object]:
    words, _, unit = name.rpartition("_")
    return axis_title(f"{words.replace('_', ' ')} ({unit})")


def _hover(entry: LayoutEntry, square: MapSquare) -> str:
    if square["status"] != "feasible":
        where = f"{square['contour']}, node {square['node']}: " if "contour" in square else ""
        return f"{square['status']}<br>{where}{square.get('reason', '')[:90]}"
    known = promise(entry["goal"], square)
    if known is None:
        return "feasible as far as known"
    how = "at least" if entry["goal"] == "motion" else "at most"
    if square["value"] is not None:
        how = "planned:" if entry["off_grid"] else "exactly"
    elif known == square["estimate"]:
        how = "estimated:"
    return f"{how} {known:.3f} {WORDS[entry['goal']]}"


def _shown(entry: LayoutEntry, square: MapSquare) -> float | None:
    return promise(entry["goal"], square) if square["status"] == "feasible" else None


def _plane(entry: LayoutEntry, drawn: LayoutMap) -> go.Figure:
    first, second = drawn["variables"]
    shape = len(drawn["y"]), len(drawn["x"])
    cells = np.array(drawn["cells"], dtype=object).reshape(shape)
    bound = [[_shown(entry, c) for c in row] for row in cells]
    figure = go.Figure(layout=base_layout(HEIGHT, legend={"orientation": "h", "y": 1.09}))
    grid = {"x": drawn["x"], "y": drawn["y"]}
    for status, colour in WHY.items():
        here = [[1 if c["status"] == status else None for c in row] for row in cells]
        if not any(any(row) for row in here):
            continue
        figure.add_heatmap(
            **grid, z=here, colorscale=[[0, colour], [1, colour]], showscale=False,
            text=[[_hover(entry, c) for c in row] for row in cells],
            hovertemplate="%{text}<extra></extra>",
        )  # fmt: skip
        _add_to_legend(figure, status)
    figure.add_heatmap(
        **grid, z=bound, colorscale=SCALE, reversescale=entry["goal"] == "motion",
        colorbar={
            "title": {"text": WORDS[entry["goal"]], "side": "right"},
            "thickness": 14, "outlinewidth": 0, "tickfont": {"color": QUIET, "size": 11},
        },
        text=[[_hover(entry, c) for c in row] for row in cells],
        hovertemplate="%{text}<extra></extra>",
    )  # fmt: skip
    tried = [t["offsets"] for t in entry["tried"][: entry["evolved"]]]
    dots = {"size": 4, "color": "rgba(29, 37, 48, 0.45)"}
    figure.add_scatter(
        x=[o[first] for o in tried], y=[o[second] for o in tried], mode="markers", marker=dots,
        name="tried", hoverinfo="skip",
    )  # fmt: skip
    _mark(figure, 0.0, 0.0, "placement of the job", "x", INK, 11)
    if entry["best"]:
        at = entry["best"]["offsets"]
        _mark(figure, at[first], at[second], "best", "star", "#ffb000", 19)
    figure.update_xaxes(**axis(title=_title(first), showgrid=False, range=_ends(drawn["x"])))
    figure.update_yaxes(**axis(title=_title(second), showgrid=False, range=_ends(drawn["y"])))
    return figure


def _half(values: list[float]) -> float:
    """Return half the step of evenly spaced values."""
    return (values[1] - values[0]) / 2 if len(values) > 1 else 1.0


def _ends(values: list[float]) -> list[float]:
    return [values[0] - _half(values), values[-1] + _half(values)]


def _add_to_legend(figure: go.Figure, status: str) -> None:
    mark = {"color": WHY[status], "symbol": "square", "size": 11}
    figure.add_scatter(x=[None], y=[None], mode="markers", marker=mark, name=status)


def _mark(
    figure: go.Figure, x: float, y: float, name: str, symbol: str, colour: str, size: int
) -> None:
    look = {"symbol": symbol, "size": size, "color": colour, "line": {"width": 1.5, "color": INK}}
    figure.add_scatter(x=[x], y=[y], mode="markers", marker=look, name=name)


def _line(entry: LayoutEntry, drawn: LayoutMap) -> go.Figure:
    name = drawn["variables"][0]
    figure = go.Figure(layout=base_layout(380, legend={"orientation": "h", "y": 1.12}))
    bounds = [_shown(entry, c) for c in drawn["cells"]]
    figure.add_scatter(
        x=drawn["x"], y=bounds, mode="lines+markers", line={"color": ACCENT}, name=_known(entry),
        text=[_hover(entry, c) for c in drawn["cells"]], hovertemplate="%{text}<extra></extra>",
    )  # fmt: skip
    half = _half(drawn["x"])
    for x, square in zip(drawn["x"], drawn["cells"], strict=True):
        if square["status"] != "feasible":
            figure.add_vrect(
                x0=x - half, x1=x + half, fillcolor=WHY[square["status"]], line_width=0,
                layer="below",
            )  # fmt: skip
    for status in WHY:
        if any(c["status"] == status for c in drawn["cells"]):
            _add_to_legend(figure, status)
    if entry["shipped"]["value"] is not None:
        _mark(figure, 0.0, entry["shipped"]["value"], "placement of the job", "x", INK, 11)
    if entry["best"]:
        best = entry["best"]
        _mark(figure, best["offsets"][name], best["value"], "best", "star", "#ffb000", 19)
    figure.update_xaxes(**axis(title=_title(name), range=_ends(drawn["x"])))
    figure.update_yaxes(**axis(title=axis_title(WORDS[entry["goal"]])))
    return figure


def _known(entry: LayoutEntry) -> str:
    return "estimate" if entry["off_grid"] else "bound"


def convergence(entry: LayoutEntry) -> go.Figure:
    """Return the bound or estimate of each placement tried, in order, and the best one so far."""
    tried, less = entry["tried"], entry["goal"] == "motion"
    worth = [promise(entry["goal"], placement) for placement in tried]
    figure = go.Figure(layout=base_layout(360, legend={"orientation": "h", "y": 1.12}))
    feasible = [i for i, t in enumerate(tried) if t["status"] == "feasible" and worth[i]]
    bounds = np.array([worth[i] for i in feasible], dtype=float)
    solved = [i for i in feasible if tried[i]["value"] is not None]
    open_ = {"size": 6, "color": "white", "line": {"width": 1.2, "color": ACCENT}}
    hover = "placement %{x}: %{y:.3f}<extra></extra>"
    figure.add_scatter(
        x=feasible, y=bounds.tolist(), mode="markers", marker=open_, name=_known(entry),
        hovertemplate=hover,
    )  # fmt: skip
    figure.add_scatter(
        x=solved, y=[tried[i]["value"] for i in solved], mode="markers",
        name="planned" if entry["off_grid"] else "solved exactly",
        marker={"size": 8, "color": ACCENT}, hovertemplate=hover,
    )  # fmt: skip
    if len(feasible):
        so_far = np.minimum.accumulate(bounds) if less else np.maximum.accumulate(bounds)
        figure.add_scatter(
            x=feasible, y=so_far.tolist(), mode="lines", name=f"best {_known(entry)} so far",
            line={"color": FAINT, "width": 1.5, "shape": "hv"}, hoverinfo="skip",
        )  # fmt: skip
    lost = [i for i, t in enumerate(tried) if t["status"] != "feasible"]
    foot = float(bounds.min()) if len(bounds) else 0.0
    if lost:
        span = float(np.ptp(bounds)) if len(bounds) else 1.0
        cross = {"size": 6, "symbol": "x-thin", "line": {"width": 1.2, "color": ALERT}}
        figure.add_scatter(
            x=lost, y=[foot - 0.06 * (span or 1.0)] * len(lost), mode="markers",
            name="infeasible", marker=cross,
            text=[t["status"] for t in (tried[i] for i in lost)],
            hovertemplate="placement %{x}: %{text}<extra></extra>",
        )  # fmt: skip
    figure.update_xaxes(**axis(title=axis_title("placement")))
    figure.update_yaxes(**axis(title=axis_title(WORDS[entry["goal"]])))
    return figure
