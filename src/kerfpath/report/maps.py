"""The feasibility map: gamma over nodes, one panel per posture, coloured by reason of loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import cycle, pairwise, product
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array, short_repr
from kerfpath.auditor import Check
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss, Reason
from kerfpath.planner import ClearanceMap
from kerfpath.plans import Plan
from kerfpath.robots import Robot, posture_name

# -----------------------------------------------------------------------------
# Colours and the common layout of all figures.

INK, QUIET, FAINT, GRID = "#1d2530", "#5b6675", "#98a1ad", "#e6e9ee"
ACCENT, ALERT, CHOSEN = "#0b6b66", "#b3261e", "#e8590c"
SCALE = ("#440154", "#414487", "#2a788e", "#22a884", "#7ad151")
"""Viridis up to four fifths; lighter colours do not show on white."""

# Six hues with a light and a dark shade each, from a search in which all pairs differ by a CIELAB
# distance of 12 for normal, protan and deutan sight (Machado, Oliveira, Fernandes 2009).
JOINT_COLOURS = ("#0061cc", "#f4a918", "#0ea069", "#df5ac2", "#f05d16", "#55bdff")
SEVENTH_COLOUR = "#8a8d00"
EXTERNAL_COLOURS = ("#6b4fbb", "#7a5c3e", "#5b6675")
"""Colours of external axes, whose lines also have names."""
_LOW = ("#4089d9", "#fce3b4", "#6bc5a3", "#f6ceed", "#f6a076", "#86d0ff")
_HIGH = ("#003875", "#be8313", "#09603f", "#c34fa9", "#742d0b", "#2f688d")
_REASONS = {
    Reason(Loss.ADMITTED): "#eef7ee",
    Reason(Loss.UNREACHABLE): "#b4bac4",
    Reason(Loss.UNWANTED): "#d9d4e2",
    Reason(Loss.COLLISION): "#d7263d",
    Reason(Loss.PINNED): "#c9d3dc",
    **{Reason(Loss.LOW, f"joint {i + 1}"): colour for i, colour in enumerate(_LOW)},
    **{Reason(Loss.HIGH, f"joint {i + 1}"): colour for i, colour in enumerate(_HIGH)},
}
_SPARE = ("#d3e7a4", "#f7c46c", "#f08a4b")
_OTHER_REASONS = ("#7a7f88", "#33373e")

FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'


def reason_colours(reasons: Sequence[Reason]) -> tuple[str, ...]:
    """Return one colour per reason: the joint's light shade below its limits, dark above them.

    Clearances run from green to orange. Reasons without their own colour (couplings, low and
    high) alternate between two greys.
    """
    greys, spare = cycle(_OTHER_REASONS), cycle(_SPARE)
    return tuple(
        _REASONS[why] if why in _REASONS else next(spare if why.loss is Loss.SPARE else greys)
        for why in reasons
    )


def joint_colours(robot: Robot) -> tuple[str, ...]:
    """Return a colour for each joint of a robot, external axes last."""
    arm = (*JOINT_COLOURS, SEVENTH_COLOUR)[: robot.family.joints]
    return arm + EXTERNAL_COLOURS[: len(robot.externals)]


def base_layout(height: int, **more: Any) -> go.Layout:
    """Return a plain white layout of `height` px, without plotly's default template."""
    look: dict[str, object] = {
        "template": go.layout.Template(),
        "height": height,
        "font": {"family": FONT, "size": 12, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "margin": {"l": 62, "r": 16, "t": 24, "b": 46},
        "hoverlabel": {
            "bgcolor": "white",
            "bordercolor": FAINT,
            "font": {"family": FONT, "size": 12, "color": INK},
        },
    }
    return go.Layout(**(look | more))


def axis(**more: Any) -> dict[str, object]:
    """Return the look of a plot axis."""
    return {
        "showgrid": True,
        "gridcolor": GRID,
        "zeroline": False,
        "showline": True,
        "linecolor": FAINT,
        "ticks": "outside",
        "ticklen": 4,
        "tickcolor": FAINT,
        "tickfont": {"size": 11, "color": QUIET},
        "title": {"font": {"size": 12, "color": QUIET}},
    } | more


def axis_title(text: str) -> dict[str, object]:
    """Return an axis title."""
    return {"text": text, "font": {"size": 12, "color": QUIET}, "standoff": 8}


def band(x0: float, x1: float, **where: Any) -> dict[str, object]:
    """Return a pale vertical band from x0 to x1, below the lines."""
    return {
        "type": "rect",
        "x0": x0,
        "x1": x1,
        "y0": 0,
        "y1": 1,
        "fillcolor": "#eef2f6",
        "line": {"width": 0},
        "layer": "below",
    } | where


# -----------------------------------------------------------------------------
# The data of one contour on the page of a job.

SPARE = (0.25, 0.5, 1.0)
"""Upper ends of the ranges of clearance that have colours, as shares of the map's band."""


def add_clearance(graph: LayeredGraph, found: ClearanceMap) -> LayeredGraph:
    """Return the graph with the clearances of its candidates among the reasons.

    A candidate that is not clear gets the reason collision; one whose clearance is less than the
    band of the map gets a range of clearances. All turns of a candidate have the same pose, so one
    of them is enough.
    """
    steps = [1e3 * share * found.band for share in (0.0, *SPARE)]
    spare = [Reason(Loss.SPARE, f"{a:g} to {b:g} mm") for a, b in pairwise(steps)][::-1]
    reasons = (graph.reasons[0], *spare, Reason(Loss.COLLISION), *graph.reasons[1:])
    added = len(spare) + 1
    above = np.searchsorted(np.array(SPARE) * found.band, found.lower, side="right")
    layer = np.repeat(np.arange(len(graph.reason)), np.diff(graph.start))
    # The codes are ordered so that the least one is the best of a gamma's variants.
    reason = np.where(graph.reason == 0, 0, graph.reason + added).astype(np.uint8)
    reason[layer, graph.candidate, graph.posture] = np.where(found.clear, len(SPARE) - above, added)
    return replace(graph, reason=reason, reasons=reasons)


class Mark(NamedTuple):
    """A place where a contour fails: node of its map, point in the part (m), and reason."""

    node: float
    point: Array
    words: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContourSection:
    """One contour of a report: the search, its plan or failure, and its audit.

    Parameters
    ----------
    name : str
        Name of the contour in the report.
    graph : LayeredGraph
        The layered graph that was searched.
    path : Contour
        The nodes, in the part frame.
    plan : Plan or None
        None when no feasible path was found.
    checks : sequence of Check
        The audit's table; empty when the audit was not run.
    failure : str
        Reason why there is no plan.
    remedy : str
        Changes that would help.
    clearance : ClearanceMap, optional
        Clearance of each vertex of the graph in the cell.
    broken_at : int, optional
        First node that no admissible path reaches (one after `NoFeasiblePath.node`), 0-based.
    sampling : sequence of (what, value)
        Sampling errors of the nodes, in rows such as ("Chord error", "0.01 mm").

    Raises
    ------
    InputError
        Graph and path differ in their number of nodes, or the plan does not divide their intervals
        into equal numbers of parts.
    """

    name: str
    graph: LayeredGraph
    path: Contour
    plan: Plan | None = None
    checks: Sequence[Check] = ()
    failure: str = ""
    remedy: str = ""
    broken_at: int | None = None
    clearance: ClearanceMap | None = None
    sampling: Sequence[tuple[str, str]] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        nodes = {"graph": len(self.graph.reason), "path": len(self.path)}
        if self.plan is not None:
            nodes["plan"] = len(self.plan.q)
        intervals = {count - 1 for count in nodes.values()}
        if any(count % min(intervals) for count in intervals) or len(self.path) != nodes["graph"]:
            counts = ", ".join(f"{name} {count}" for name, count in nodes.items())
            raise InputError(
                f"section {self.name!r}: expected the same nodes throughout, got {counts}"
            )

    @property
    def mapped(self) -> LayeredGraph:
        """The graph, with the clearance of its vertices among the reasons if it is known."""
        return self.graph if self.clearance is None else add_clearance(self.graph, self.clearance)

    @property
    def failed(self) -> bool:
        """True without a plan, or with one that fails its audit."""
        return self.plan is None or bool(self.errors)

    @property
    def parts(self) -> int:
        """Number of parts into which the plan divides each interval."""
        return 1 if self.plan is None else (len(self.plan.q) - 1) // (len(self.path) - 1)

    @property
    def marks(self) -> list[Mark]:
        """Places of failure: the node of the break, or the worst node of each failed check."""
        if self.plan is None:
            if self.broken_at is None or not 0 <= self.broken_at < len(self.path):
                return []
            words = f"path breaks at node {self.broken_at}"
            return [Mark(self.broken_at, self.path.points[self.broken_at], words)]
        points = self.plan.contour.points
        return [
            Mark(check.node / self.parts, points[check.node], f"{check.title}, node {check.node}")
            for check in self.errors
            if 0 <= check.node < len(points)
        ]

    @property
    def errors(self) -> list[Check]:
        """Failed checks that forbid the program."""
        return [c for c in self.checks if not c.ok and c.level == "error"]

    @property
    def warnings(self) -> list[Check]:
        """Failed checks that do not forbid the program."""
        return [c for c in self.checks if not c.ok and c.level != "error"]


# -----------------------------------------------------------------------------
# The feasibility map: gamma over nodes, one panel per posture, coloured by reason of loss.

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
    figure = go.Figure(layout=base_layout(height, hovermode="closest"))
    figure.update_layout(margin={"l": 62, "r": 16, "t": TOP, "b": BOTTOM})
    used = set() if plan is None else {int(mu) for mu in plan.posture}
    for row, mu in enumerate(postures):
        _add_axes(figure, row, len(postures), height, nodes)
        name = posture_name(mu) + (" (in use)" if mu in used else "")
        figure.add_annotation(
            text=name,
            font={"size": 12, "color": INK if mu in used or plan is None else QUIET},
            x=0,
            xref="paper",
            xanchor="left",
            y=1,
            yref=f"{_axis('y', row)} domain",
            yanchor="bottom",
            showarrow=False,
        )
        figure.add_heatmap(
            z=np.ascontiguousarray(graph.reason_by_gamma[:, :, mu].T),
            x0=0,
            dx=1,
            y0=float(gamma[0]),
            dy=step,
            xaxis=_axis("x", row),
            yaxis=_axis("y", row),
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
    _add_marks(figure, marks, len(postures))
    _add_legend(figure, graph, postures, has_plan=plan is not None)
    if s is None and plan is not None:
        s = plan.contour.s
    figure.update_layout(
        meta={
            "reasons": list(graph.reasons),
            "postures": [posture_name(mu) for mu in postures],
            "s_mm": [] if s is None else np.round((s - s[0]) * 1e3, 2).tolist(),
            "nodes": np.round(np.arange((nodes - 1) * parts + 1) / parts, 4).tolist(),
        }
    )
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


def _add_axes(figure: go.Figure, row: int, rows: int, height: int, nodes: int) -> None:
    inner = height - TOP - BOTTOM
    top = 1 - row * (ROW + GAP) / inner
    last = row == rows - 1
    figure.update_layout(
        {
            _axis("xaxis", row): axis(
                anchor=_axis("y", row),
                matches=None if row == 0 else "x",
                range=[-0.5, nodes - 0.5],
                showticklabels=last,
                showgrid=False,
                title=axis_title("node along the contour") if last else None,
            ),
            _axis("yaxis", row): axis(
                anchor=_axis("x", row),
                matches=None if row == 0 else "y",
                domain=[max(0.0, top - ROW / inner), min(1.0, top)],
                range=[-180, 180],
                tickvals=[-180, -90, 0, 90, 180],
                ticktext=["\N{MINUS SIGN}180°", "\N{MINUS SIGN}90°", "0°", "90°", "180°"],
                showgrid=False,
                title=axis_title("gamma"),
            ),
        }
    )


def _add_choice(figure: go.Figure, plan: Plan, posture: int, row: int, parts: int) -> None:
    pieces = chosen_line(plan, posture, parts)
    gap = np.array([np.nan])
    # plotly breaks a line at NaN.
    x = np.concatenate([part for piece in pieces for part in (piece[0], gap)])[:-1]
    y = np.concatenate([part for piece in pieces for part in (piece[1], gap)])[:-1]
    where = {"xaxis": _axis("x", row), "yaxis": _axis("y", row), "showlegend": False}
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


def _add_marks(figure: go.Figure, marks: Sequence[tuple[float, str]], rows: int) -> None:
    halo, dots = {"color": "white", "width": 4}, {"color": ALERT, "width": 2, "dash": "dot"}
    for (node, _), row, line in product(marks, range(rows), (halo, dots)):
        figure.add_shape(
            type="line",
            x0=node,
            x1=node,
            xref=_axis("x", row),
            y0=0,
            y1=1,
            yref=f"{_axis('y', row)} domain",
            line=line,
        )
    if marks:
        figure.add_annotation(
            text=f"┊ {escape(marks[0][1])}",
            font={"size": 12, "color": ALERT},
            x=1,
            xref="paper",
            xanchor="right",
            y=1,
            yref="y domain",
            yanchor="bottom",
            showarrow=False,
        )


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


def _axis(kind: str, row: int) -> str:
    return kind if row == 0 else f"{kind}{row + 1}"


def _share(part: float) -> str:
    return f"{part * 100:.0f} %" if part >= 0.01 else "< 1 %"
