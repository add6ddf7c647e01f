"""Joint motion over time: positions, and speeds and accelerations as shares of their limits.

``layout.meta["nodes"]`` of each figure has the position of every node on its horizontal axis, so
that the figures of a contour can share a cursor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go

from kerfpath.arrays import Array, require_one_of
from kerfpath.plans import Plan
from kerfpath.report.style import (
    FAINT,
    INK,
    QUIET,
    axis,
    axis_id,
    axis_title,
    band,
    base_layout,
    joint_colours,
    label,
    short,
)
from kerfpath.robots import posture_name

ROW, GAP, TOP, BOTTOM = 130, 36, 48, 48
SHARE_ROW, SHARE_TOP = 210, 74
SPEED_HEIGHT = 220
LEAST_SPAN = {"rad": 1.0, "m": 10.0}
"""Least height of a panel, deg or mm, so that small motions of a joint look small."""
SHOWN = {"rad": (180 / np.pi, "°"), "m": (1e3, " mm")}
"""Factor from the SI unit of a joint to the unit that is shown, and that unit."""


def posture_runs(plan: Plan) -> list[tuple[int, int, int]]:
    """Return the runs of one posture as (posture, first node, last node)."""
    change = np.flatnonzero(np.diff(plan.posture)) + 1
    firsts = [0, *change.tolist()]
    lasts = [*(change - 1).tolist(), len(plan.posture) - 1]
    return [(int(plan.posture[a]), a, b) for a, b in zip(firsts, lasts, strict=True)]


def joint_positions(plan: Plan) -> go.Figure:
    """Return a figure with a panel per joint: position over time, deg or mm, scaled to its motion.

    Endless joints are not wrapped. The title of a panel shows the distance to the joint limits.
    """
    robot = plan.robot
    rows = (robot.joints + 1) // 2
    height = TOP + BOTTOM + rows * ROW + (rows - 1) * GAP
    margin = {"l": 54, "r": 16, "t": TOP, "b": BOTTOM}
    look = base_layout(height, hovermode="x unified", showlegend=False, margin=margin)
    figure = go.Figure(layout=look)
    shapes, annotations = _posture_bands(plan, panels=robot.joints, labelled=range(2))
    axes: dict[str, object] = {}
    limits = robot.joint_limits()
    for joint, (name, unit) in enumerate(zip(robot.joint_names, robot.units, strict=True)):
        scale, suffix = SHOWN[unit]
        row, column = divmod(joint, 2)
        x, y = axis_id("x", joint), axis_id("y", joint)
        top = 1 - row * (ROW + GAP) / (height - TOP - BOTTOM)
        low, high = scale * limits.lower[joint], scale * limits.upper[joint]
        q, endless = scale * plan.unwrapped[:, joint], bool(limits.endless[joint])
        middle, half = (q.max() + q.min()) / 2, 0.58 * max(float(np.ptp(q)), LEAST_SPAN[unit])
        axes |= {
            axis_id("xaxis", joint): axis(
                anchor=y,
                domain=[0, 0.46] if column == 0 else [0.54, 1],
                matches=None if joint == 0 else "x",
                showticklabels=row == rows - 1,
                title=axis_title("time, s") if row == rows - 1 else None,
                unifiedhovertitle={"text": "%{x:.3f} s"},
            ),
            axis_id("yaxis", joint): axis(
                anchor=x,
                domain=[max(0.0, top - ROW / (height - TOP - BOTTOM)), min(1.0, top)],
                ticksuffix=suffix,
                range=[float(middle - half), float(middle + half)],
                nticks=6,
            ),
        }
        figure.add_scatter(
            x=short(plan.time),
            y=short(q),
            mode="lines",
            line={"color": joint_colours(robot)[joint], "width": 2},
            name=name,
            hovertemplate=f"%{{y:.2f}}{suffix}",
            xaxis=x,
            yaxis=y,
        )
        span = "endless"
        if not endless:
            spare = min(float(q.min()) - low, high - float(q.max()))
            ends, room = [_rounded(value, suffix) for value in (low, high)], _rounded(spare, suffix)
            span = f"limits {ends[0]} to {ends[1]}, {room} to spare"
        said = f"{name} <span style='color:{QUIET}'>· {span}</span>"
        at = ((0, f"{x} domain"), (1, f"{y} domain"))
        annotations.append(label(said, at, colour=INK, xanchor="left", yanchor="bottom"))
        if not endless:
            shapes += [_level(float(bound), x, y, QUIET, "solid") for bound in (low, high)]
    _lay_out(figure, plan.time, axes, shapes, annotations)
    return figure


def cutting_speed(plan: Plan) -> go.Figure:
    """Return the speed along the contour, m/min, as steps from node to node."""
    figure = go.Figure(layout=base_layout(SPEED_HEIGHT, hovermode="x unified", showlegend=False))
    figure.update_layout(margin={"l": 62, "r": 44, "t": 16, "b": BOTTOM})
    s = (plan.contour.s - plan.contour.s[0]) * 1e3
    figure.update_layout(meta={"nodes": np.round(s, 2).tolist()})
    speed = np.diff(plan.contour.s) / np.diff(plan.time) * 60
    figure.add_scatter(
        x=short(s),
        y=short(np.append(speed, speed[-1])),
        mode="lines",
        line={"color": INK, "width": 1.6, "shape": "hv"},
        hovertemplate="%{y:.2f} m/min",
    )
    figure.update_layout(
        xaxis=axis(title=axis_title("length, mm"), unifiedhovertitle={"text": "%{x:.1f} mm"}),
        yaxis=axis(title=axis_title("speed, m/min"), range=[0, 1.08 * float(speed.max())]),
    )
    return figure


def limit_shares(plan: Plan) -> go.Figure:
    """Return two panels: joint velocities and accelerations over time, in % of their limits."""
    height = SHARE_TOP + BOTTOM + 2 * SHARE_ROW + GAP
    look = base_layout(
        height,
        hovermode="x unified",
        margin={"l": 62, "r": 44, "t": SHARE_TOP, "b": BOTTOM},
        legend={"orientation": "h", "x": 0, "y": 1.03, "yanchor": "bottom", "font": {"size": 12}},
    )
    figure = go.Figure(layout=look)
    shapes, annotations = _posture_bands(plan, panels=2, labelled=())
    axes: dict[str, object] = {}
    middle = (plan.time[:-1] + plan.time[1:]) / 2
    panels = (
        ("velocity", middle, plan.velocity_share, plan.settings.eta_v),
        ("acceleration", plan.time[1:-1], plan.acceleration_share, plan.settings.eta_a),
    )
    for row, (what, time, share, eta) in enumerate(panels):
        x, y = axis_id("x", row), axis_id("y", row)
        bottom = 0.0 if row else (SHARE_ROW + GAP) / (2 * SHARE_ROW + GAP)
        axes |= {
            axis_id("xaxis", row): axis(
                anchor=y,
                matches=None if row == 0 else "x",
                showticklabels=row == 1,
                title=axis_title("time, s") if row else None,
                unifiedhovertitle={"text": "%{x:.3f} s"},
            ),
            axis_id("yaxis", row): axis(
                anchor=x,
                domain=[bottom, bottom + SHARE_ROW / (2 * SHARE_ROW + GAP)],
                ticksuffix=" %",
                title=axis_title(f"{what}, % of limit"),
                range=_share_range(share),
            ),
        }
        if not len(share):
            said = f"No {what} to draw: it takes 3 nodes, and the plan has {len(plan.q)}"
            annotations.append(label(said, ((0.5, f"{x} domain"), (0.5, f"{y} domain")), size=14))
        for joint, name in enumerate(plan.robot.joint_names):
            figure.add_scatter(
                x=short(time),
                y=short(share[:, joint] * 100),
                mode="lines",
                line={"color": joint_colours(plan.robot)[joint], "width": 1.6},
                name=name,
                legendgroup=name,
                showlegend=row == 0,
                hovertemplate="%{y:.1f} %",
                xaxis=x,
                yaxis=y,
            )
        for sign in (-1, 1):
            shapes.append(_level(100.0 * sign, x, y, INK, "solid"))
            if eta != 1:
                shapes.append(_level(100.0 * eta * sign, x, y, QUIET, "dash"))
        if eta != 1:
            at = ((1, f"{x} domain"), (100 * eta, y))
            annotations.append(label(f"η {eta * 100:g} %", at, size=11, xanchor="left"))
    _lay_out(figure, plan.time, axes, shapes, annotations)
    return figure


def _lay_out(
    figure: go.Figure,
    nodes: Array,
    axes: dict[str, object],
    shapes: list[dict[str, object]],
    annotations: list[dict[str, object]],
) -> None:
    """Set the layout of a figure in one call; in several calls plotly takes three times as long."""
    layout = {"meta": {"nodes": np.round(nodes, 4).tolist()}, **axes}
    figure.update_layout(layout | {"shapes": shapes, "annotations": annotations}, overwrite=True)


def _posture_bands(
    plan: Plan, *, panels: int, labelled: Any
) -> tuple[list[dict[str, object]], list[dict[str, object]]]:
    """Return shapes that shade every second run of one posture, and names of the wide runs.

    Other shapes come after them, because later ones are drawn on top.
    """
    shapes: list[dict[str, object]] = []
    annotations: list[dict[str, object]] = []
    runs = posture_runs(plan)
    if len(runs) == 1:
        return shapes, annotations
    whole = plan.time[-1] - plan.time[0]
    for number, (mu, first, last) in enumerate(runs):
        t0 = (plan.time[max(first - 1, 0)] + plan.time[first]) / 2
        t1 = (plan.time[last] + plan.time[min(last + 1, len(plan.time) - 1)]) / 2
        for panel in range(panels):
            x, y = axis_id("x", panel), axis_id("y", panel)
            if number % 2:
                shapes.append(band(t0, t1, xref=x, yref=f"{y} domain"))
            if panel in labelled and t1 - t0 > 0.18 * whole:
                at = (((t0 + t1) / 2, x), (0.1, f"{y} domain"))
                annotations.append(label(posture_name(mu), at, size=10, yanchor="bottom"))
    return shapes, annotations


def _share_range(share: Array) -> list[float]:
    """Return an axis range, %, that always shows the limit lines."""
    most = 100 * max(1.0, float(np.abs(share).max(initial=0.0)))
    return [-1.08 * most, 1.08 * most]


def _level(value: float, x: str, y: str, colour: str, dash: str) -> dict[str, object]:
    return {
        "type": "line",
        "x0": 0,
        "x1": 1,
        "xref": f"{x} domain",
        "y0": value,
        "y1": value,
        "yref": y,
        "line": {"color": colour if dash == "solid" else FAINT, "width": 1, "dash": dash},
        "layer": "below",
    }


def _rounded(value: float, unit: str) -> str:
    return f"{round(float(value), 2):.6g}{unit}".replace("-", "\N{MINUS SIGN}")


_FIGURES = {"joints": joint_positions, "limits": limit_shares, "speed": cutting_speed}


def plot(plan: Plan, what: str = "joints") -> go.Figure:
    """Return a figure of a plan as the report draws it, to show, change or save.

    Parameters
    ----------
    plan : Plan
    what : "joints", "limits" or "speed"
        "joints": each joint over time with its limits, deg or mm. "limits": joint speeds and
        accelerations over time, % of their limits. "speed": the speed along the contour, m/min.

    Raises
    ------
    InputError
        `what` is none of these.
    """
    require_one_of(what, "plot", _FIGURES)
    return _FIGURES[what](plan)
