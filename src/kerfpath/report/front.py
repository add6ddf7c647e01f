"""The page of a Pareto set: linked views for comparing its plans and picking one."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Unpack

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from kerfpath.arrays import Array, floats, short_repr
from kerfpath.errors import InputError
from kerfpath.report.page import PageKeywords, number, render_page, shown_unit
from kerfpath.report.style import (
    CHOSEN,
    DARK_SCALE,
    FAINT,
    INK,
    QUIET,
    SCALE,
    axis,
    axis_title,
    base_layout,
)

# -----------------------------------------------------------------------------
# The data on the page of a Pareto set: its criteria and its plans.


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontAxis:
    """One criterion of the set.

    Parameters
    ----------
    name : str
        Name of the criterion in the job.
    words : str
        Name of the criterion on the page.
    unit : str
        Unit of the values. Values in m, rad, m/s and share are shown in mm, deg, m/min and %, all
        others unchanged.
    sense : float
        1 if less is better, -1 if more is better.

    Raises
    ------
    InputError
        The sense is neither 1 nor -1.
    """

    name: str
    words: str
    unit: str
    sense: float

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Require a known sense."""
        if self.sense not in (1.0, -1.0):
            raise InputError(
                f"axis {self.name}: expected sense 1 (less is better) or -1 (more is better), "
                f"got {self.sense!r}"
            )

    @property
    def shown(self) -> tuple[float, str]:
        """The factor from the criterion's unit to the one that is shown, and that unit."""
        factor, unit = shown_unit(self.unit)
        return factor, unit.strip()

    @property
    def title(self) -> str:
        """The words and the unit of the criterion, as HTML."""
        unit = self.shown[1]
        return escape(f"{self.words} ({unit})" if unit else self.words)

    @property
    def unit_and_arrow(self) -> str:
        """The shown unit with an arrow in the better direction."""
        return f"{self.shown[1]} {'↓' if self.sense > 0 else '↑'}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class FrontPlan:
    """One plan of the set.

    Parameters
    ----------
    number : int
        Number by which it is picked.
    values : (C,) tuple of float
        Criteria of the plan, in the units of the axes.
    asked : tuple of (what, value)
        Settings of its run, in words.
    """

    number: int
    values: tuple[float, ...]
    asked: tuple[tuple[str, str], ...]

    __repr__ = short_repr


# -----------------------------------------------------------------------------
# The plots of a Pareto set; the script of the page fills and links them.

LABEL_LOOK = {"showarrow": True, "arrowhead": 0, "arrowwidth": 1, "standoff": 6}
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


# -----------------------------------------------------------------------------
# The page of a Pareto set: linked views for comparing its plans and picking one.

NUMBER = "{number}"
AXIS_WIDTH = 112
"""Least distance of parallel axes, px: the height of a line of a label."""


def render_front(
    title: str,
    *,
    axes: Sequence[FrontAxis],
    plans: Sequence[FrontPlan],
    dominated: Sequence[Sequence[float]],
    marks: Mapping[str, int],
    command: str,
    **page: Unpack[PageKeywords],
) -> str:
    """Return a Pareto set as one self-contained HTML page; the same input gives the same text.

    Parameters
    ----------
    title : str
        Heading of the page.
    axes : sequence of FrontAxis
        The criteria, at least one; the first two are plotted first, coloured by the third.
    plans : sequence of FrontPlan
        At least one plan, in the order of the table.
    dominated : (D, C)
        Criteria of feasible plans that others dominate.
    marks : mapping of str to int
        Numbers of remarkable plans by their labels, such as "least displacement".
    command : str
        Command that writes a plan, with "{number}" in place of its number.
    **page
        As in `PageKeywords`.

    Raises
    ------
    InputError
        There is no axis or plan, values do not match the axes or are not finite, a name or number
        occurs twice, a mark has the number of no plan, or the command lacks "{number}".
    """
    values, beaten = _shown_values(axes, plans, dominated, marks, command)
    labels = axis_labels(axes)
    return render_page(
        "front.html",
        kind="Pareto set",
        title=title,
        axes=axes,
        values=values,
        dominated=beaten,
        marks=marks,
        labels=labels,
        axis_width=AXIS_WIDTH,
        menus=_menus(axes),
        rows=_rows(axes, plans, values, marks),
        scatter=scatter,
        parallel=parallel,
        data=_data(axes, plans, values, beaten, marks, command),
        **page,
    )


def _shown_values(
    axes: Sequence[FrontAxis],
    plans: Sequence[FrontPlan],
    dominated: Sequence[Sequence[float]],
    marks: Mapping[str, int],
    command: str,
) -> tuple[Array, Array]:
    """Return the values of plans (P, C) and of dominated runs (D, C), in the shown units."""
    names, numbers = [a.name for a in axes], [plan.number for plan in plans]
    for what, found in (("axes", names), ("plans", numbers)):
        if not found or len(set(found)) != len(found):
            raise InputError(f"{what}: expected at least one and none twice, got {found}")
    for plan in plans:
        floats(plan.values, f"values of plan {plan.number}", (len(axes),))
    values = floats([plan.values for plan in plans], "plans", (None, len(axes)))
    beaten = floats(dominated, "dominated", (None, len(axes))) if len(dominated) else values[:0]
    for mark, chosen in marks.items():
        if chosen not in numbers:
            raise InputError(f"mark {mark!r}: expected the number of a plan, got {chosen}")
    if NUMBER not in command:
        raise InputError(f"command: expected {NUMBER} where the plan's number goes, got {command}")
    factor = np.array([a.shown[0] for a in axes])
    return values * factor, beaten * factor


def _decimals(column: Array) -> int:
    """Return the number of decimals that shows a thousandth of the spread of values."""
    size, largest = float(np.ptp(column)), float(np.abs(column).max())
    if size < 1e-9 * largest:  # only rounding errors differ
        size = largest
    return max(0, 2 - math.floor(math.log10(size or 1.0)))


def _menus(
    axes: Sequence[FrontAxis],
) -> list[tuple[str, str, list[tuple[int, str]], int]]:
    """Return the menus that choose the plotted criteria: key, words, options, chosen option.

    The values of the options are indices of criteria.
    """
    none = [(-1, "none")]
    every = [(i, criterion.words) for i, criterion in enumerate(axes)]
    return [
        ("x", "Horizontal", every, 0),
        ("y", "Vertical", every if len(axes) > 1 else none, min(1, len(axes) - 1) or -1),
        ("colour", "Colour", every + none, 2 if len(axes) > 2 else -1),
    ]


def _rows(
    axes: Sequence[FrontAxis], plans: Sequence[FrontPlan], values: Array, marks: Mapping[str, int]
) -> Iterator[tuple[FrontPlan, list[tuple[str, bool]], list[str]]]:
    """Yield each plan, its values and whether each is the best one, and its marks."""
    decimals = [_decimals(column) for column in values.T]
    best = values == (values * _sense(axes)).min(axis=0) * _sense(axes)
    for plan, own, is_best in zip(plans, values, best, strict=True):
        shown = [number(value, digits) for value, digits in zip(own, decimals, strict=True)]
        yield plan, list(zip(shown, is_best, strict=True)), _marks_of(plan, marks)


def _data(
    axes: Sequence[FrontAxis],
    plans: Sequence[FrontPlan],
    values: Array,
    beaten: Array,
    marks: Mapping[str, int],
    command: str,
) -> Markup:
    """Return the data of the script; titles and names of marks are HTML, as plotly reads them."""
    data = {
        "axes": [
            {"title": criterion.title, "unit": criterion.shown[1], "sense": criterion.sense}
            for criterion in axes
        ],
        "plans": [
            {
                "number": plan.number,
                "values": row.tolist(),
                "asked": plan.asked,
                "marks": [escape(mark) for mark in _marks_of(plan, marks)],
            }
            for plan, row in zip(plans, values, strict=True)
        ],
        "dominated": beaten.tolist(),
        "command": command,
        "look": {"scale": {"light": SCALE, "dark": DARK_SCALE}, "label": LABEL_LOOK},
    }
    # Nothing in a text may end the element.
    return Markup(json.dumps(data, ensure_ascii=False).replace("<", "\\u003c"))


def _marks_of(plan: FrontPlan, marks: Mapping[str, int]) -> list[str]:
    return [mark for mark, chosen in marks.items() if chosen == plan.number]


def _sense(axes: Sequence[FrontAxis]) -> Array:
    return np.array([criterion.sense for criterion in axes])
