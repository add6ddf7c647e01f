"""The page of a Pareto set: linked views for comparing its plans and picking one."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version

import numpy as np

from kerfpath._arrays import Array, floats
from kerfpath.errors import InputError
from kerfpath.report._front import FrontAxis, FrontPlan
from kerfpath.report._front_plots import LABEL_LOOK, axis_labels, parallel, scatter
from kerfpath.report._html import Figures, header, job_part, page
from kerfpath.report._look import ACCENT, CHOSEN, SCALE
from kerfpath.report._tables import number, table, td

__all__ = ["render_front"]

NUMBER = "{number}"
_BEATEN = " Grey points are dominated: some plan is as good in every criterion and better in one."
AXIS_WIDTH = 112
"""Least distance of parallel axes, px: the height of a line of a label."""


def render_front(
    title: str,
    *,
    axes: Sequence[FrontAxis],
    plans: Sequence[FrontPlan],
    dominated: Sequence[Sequence[float]],
    marks: Mapping[str, int],
    facts: Sequence[tuple[str, str]],
    notes: Sequence[str],
    command: str,
    job_text: str = "",
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
    facts : sequence of (what, value)
    notes : sequence of str
    command : str
        Command that writes a plan, with "{number}" in place of its number.
    job_text : str
        The job file as read.

    Raises
    ------
    InputError
        There is no axis or plan, values do not match the axes or are not finite, a name or number
        occurs twice, a mark has the number of no plan, or the command lacks "{number}".
    """
    values, beaten = _shown_values(axes, plans, dominated, marks, command)
    figures = Figures()
    views = [
        f"<section><h2>{'Criteria in pairs' if len(axes) > 1 else 'The criterion'}</h2>",
        '<p class="caption">Each point is a plan; click a point to pick its plan. Darker colours '
        f"are better.{_BEATEN if len(beaten) else ''}</p>",
        _choices(axes),
        figures.place(scatter(axes), "front-scatter"),
        "</section>",
        *(_parallel_part(axes, values, figures) if len(axes) > 1 else ()),
        "<section><h2>Plans</h2>",
        '<p class="caption">Click a heading to sort; ↓ less is better, ↑ more is better, the best '
        "value of each criterion is bold. Click a row, or press Enter on it, to pick its plan.</p>",
        _plan_table(axes, plans, values, marks),
        "</section>",
    ]
    body = [
        header("Pareto set", title, facts=facts, notes=notes),
        '<div class="front"><div class="views">',
        *views,
        "</div>",
        _panel(axes, marks),
        "</div>",
        job_part(job_text),
        f"<footer>kerfpath {escape(version('kerfpath'))}</footer>",
        _data(axes, plans, values, beaten, marks, command),
    ]
    return page(title, body, figures, also="front")


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


def _parallel_part(axes: Sequence[FrontAxis], values: Array, figures: Figures) -> list[str]:
    labels = axis_labels(axes)
    lines = len(labels[0])
    width = AXIS_WIDTH * len(axes) + 40
    return [
        "<section><h2>All criteria at once</h2>",
        '<p class="caption">Each line is a plan. On every axis better is at the bottom: if more is '
        "better (↑), the axis points down. Drag along an axis to show only plans in a range, "
        "click on the axis to remove the range; drag a name to move its axis.</p>",
        '<p class="kept"><span role="status"></span>'
        '<button type="button" hidden>Show all</button></p>',
        # plotly places labels as if they had two lines.
        f'<div class="wide"><div style="min-width:{width}px;--lift:{1.3 * (2 - lines):.1f}em">',
        figures.place(parallel(axes, values, labels), "front-parallel"),
        "</div></div>",
        "</section>",
    ]


def _choices(axes: Sequence[FrontAxis]) -> str:
    """Return the menus that choose the plotted criteria; their values are indices of criteria."""
    none = [(-1, "none")]
    every = [(i, criterion.words) for i, criterion in enumerate(axes)]
    boxes = (
        ("x", "Horizontal", every, 0),
        ("y", "Vertical", every if len(axes) > 1 else none, min(1, len(axes) - 1) or -1),
        ("colour", "Colour", every + none, 2 if len(axes) > 2 else -1),
    )
    parts = []
    for key, words, options, first in boxes:
        inner = "".join(
            f'<option value="{i}"{" selected" if i == first else ""}>{escape(text)}</option>'
            for i, text in options
        )
        parts.append(f'<label>{words} <select data-choice="{key}">{inner}</select></label>')
    return f'<p class="choices">{"".join(parts)}</p>'


def _plan_table(
    axes: Sequence[FrontAxis], plans: Sequence[FrontPlan], values: Array, marks: Mapping[str, int]
) -> str:
    """Return the table of the plans; the script sorts it by the column that a head names."""
    heads = [('<button type="button" data-sort="-1">Plan</button>', "")]
    for i, criterion in enumerate(axes):
        button = (
            f'<button type="button" data-sort="{i}" title="{escape(criterion.name)}">'
            f"{escape(criterion.words)}</button>"
        )
        heads.append((button, escape(criterion.unit_and_arrow)))
    heads.append(("Remarks", ""))
    decimals = [_decimals(column) for column in values.T]
    best = values == (values * _sense(axes)).min(axis=0) * _sense(axes)
    rows = []
    for i, plan in enumerate(plans):
        cells = []
        for value, digits, is_best in zip(values[i], decimals, best[i], strict=True):
            text = number(float(value), digits)
            cells.append(td(f"<b>{text}</b>" if is_best else text))
        chips = "".join(f"<span>{escape(mark)}</span>" for mark in _marks_of(plan, marks))
        rows.append(
            f'<tr data-plan="{plan.number}" tabindex="{0 if i == 0 else -1}">'
            f'<th scope="row">{plan.number}</th>{"".join(cells)}<td class="chips">{chips}</td></tr>'
        )
    return f'<div class="plans">{table(heads, rows, text_columns=(0, len(heads) - 1))}</div>'


def _panel(axes: Sequence[FrontAxis], marks: Mapping[str, int]) -> str:
    """Return the empty panel of the picked plan, which the script fills."""
    buttons = "".join(
        f'<li><button type="button" data-plan="{chosen}">{escape(mark)} '
        f"<small>plan {chosen}</small></button></li>"
        for mark, chosen in marks.items()
    )
    rows = "".join(
        f'<tr><th scope="row">{escape(criterion.words)}</th><td class="n"></td></tr>'
        '<tr class="place"><td colspan="2"><i><i></i></i></td></tr>'
        for criterion in axes
    )
    return "\n".join(
        [
            '<aside class="picked" aria-label="Picked plan">',
            f'<ul class="marks">{buttons}</ul>' if buttons else "",
            '<p class="hint quiet">No plan is picked: click a point or a row.</p>',
            '<div class="plan" hidden>',
            '<h2 aria-live="polite"></h2>',
            f'<table class="values">{rows}</table>',
            '<p class="ends"><span>best</span><span>worst of the set</span></p>',
            '<div class="asked"><h4>Settings of its run</h4><dl></dl></div>',
            "<h4>Command that writes it</h4><pre></pre>",
            '<button type="button" class="copy">Copy the command</button>',
            "</div></aside>",
        ]
    )


def _data(
    axes: Sequence[FrontAxis],
    plans: Sequence[FrontPlan],
    values: Array,
    beaten: Array,
    marks: Mapping[str, int],
    command: str,
) -> str:
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
        "look": {"accent": ACCENT, "chosen": CHOSEN, "scale": SCALE, "label": LABEL_LOOK},
    }
    # Nothing in a text may end the element.
    packed = json.dumps(data, ensure_ascii=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="front">{packed}</script>'


def _marks_of(plan: FrontPlan, marks: Mapping[str, int]) -> list[str]:
    return [mark for mark, chosen in marks.items() if chosen == plan.number]


def _sense(axes: Sequence[FrontAxis]) -> Array:
    return np.array([criterion.sense for criterion in axes])
