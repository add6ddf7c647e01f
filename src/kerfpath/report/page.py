"""The page of a job: its contours with plans, maps, figures and audits."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Collection, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike
from plotly.offline import get_plotlyjs

from kerfpath.auditor import Check
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES
from kerfpath.graph import LayeredGraph
from kerfpath.plans import Plan
from kerfpath.report import maps, motion
from kerfpath.report.maps import ContourSection, joint_colours, reason_colours
from kerfpath.report.scene import scene
from kerfpath.robots import posture_name

# -----------------------------------------------------------------------------
# The skeleton of an HTML page, and the figures packed into it.

_SKELETON = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="kerfpath">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
</main>
{data}
{library}
<script>
{script}</script>
</body>
</html>
"""

_LEAN = '<script src="plotly.js"></script>'
"""Stands in place of the library; text from outside is escaped and cannot look like it."""


class Figures:
    """The figures of a page: each is packed once, and drawn when its section is first opened."""

    def __init__(self) -> None:
        self.data: list[str] = []

    def place(self, figure: go.Figure, kind: str) -> str:
        """Pack `figure` and return the element that it is drawn into."""
        number = len(self.data) + 1
        # A map of 1500 x 360 x 8 codes has long runs: compression keeps a report with many small.
        packed = base64.b64encode(zlib.compress(figure.to_json().encode(), 9)).decode()
        self.data.append(
            f'<script type="application/octet-stream" id="figure-{number}">{packed}</script>'
        )
        return (
            f'<div class="figure {kind}" data-figure="figure-{number}" '
            f'style="min-height:{figure.layout.height}px"></div>'
        )


def header(
    kind: str,
    title: str,
    *,
    facts: Sequence[tuple[str, str]],
    notes: Sequence[str],
    verdict: str = "",
    tools: str = "",
) -> str:
    """Return the head of a page: its kind, title, verdict (HTML), facts and notes.

    `tools` (HTML) is placed beside the title.
    """
    parts = [
        "<header>",
        tools,
        f'<p class="kind">{escape(kind)}</p>',
        f"<h1>{escape(title)}</h1>",
        verdict,
        facts_list(facts),
        "".join(f'<p class="note"><b>Note</b> {escape(note)}</p>' for note in notes),
        "</header>",
    ]
    return "\n".join(part for part in parts if part)


def facts_list(facts: Sequence[tuple[str, str]]) -> str:
    """Return the facts as a definition list."""
    rows = "".join(
        f"<div><dt>{escape(what)}</dt><dd>{escape(value)}</dd></div>" for what, value in facts
    )
    return f'<dl class="facts">{rows}</dl>' if rows else ""


def job_part(text: str) -> str:
    """Return the job file in a collapsible element; empty without a text."""
    if not text:
        return ""
    return (
        "<section><h2>Job</h2><details><summary><h3>Job file as read</h3></summary>"
        f"<pre>{escape(text)}</pre></details></section>"
    )


def page(title: str, body: Sequence[str], figures: Figures, *, also: str = "") -> str:
    """Return a self-contained page: its body in pieces of HTML, and the figures in it.

    `also` names a style sheet and a script that are added to those of every page.
    """
    names = ("page", also) if also else ("page",)
    return _SKELETON.format(
        title=escape(title),
        style="".join(_resource(f"{name}.css") for name in names),
        body="\n".join(part for part in body if part),
        data="\n".join(figures.data),
        library=_library() if figures.data else "",
        script="\n".join(_resource(f"{name}.js") for name in names),
    )


def without_library(text: str) -> str:
    """Return a page without the drawing library, which is most of its size, for storage."""
    return text.replace(_library(), _LEAN)


def with_library(text: str) -> str:
    """Return a page shortened by `without_library` with the library restored."""
    return text.replace(_LEAN, _library())


def _library() -> str:
    return f"<script>{get_plotlyjs()}</script>"


def _resource(name: str) -> str:
    return (files("kerfpath.report") / name).read_text(encoding="utf-8")


# -----------------------------------------------------------------------------
# The tables of the report as HTML; all texts from outside are escaped here.

PASS, FAIL, WARN = "pass", "fail", "warn"
_SIGNS = {PASS: "✓", FAIL: "✗", WARN: "!"}
_UNITS = {
    "m": (1e3, " mm"),
    "rad": (180.0 / math.pi, "°"),
    "m^3": (1.0, " m³"),
    "m/s": (60.0, " m/min"),
    "share": (100.0, " %"),
    "count": (1.0, ""),
}


def summary_table(sections: Sequence[ContourSection]) -> str:
    """Return one row per contour: size, cost, and largest shares of the limits."""
    heads = (
        ("Contour", ""),
        ("Length", "mm"),
        ("Nodes", ""),
        ("Speed", "m/min"),
        ("Time", "s"),
        ("Cost", ""),
        ("Bound", ""),
        ("Gap", "% of cost"),
        ("Proof", ""),
        ("Peak velocity", "% of limit"),
        ("Peak accel.", "% of limit"),
        ("Audit", ""),
    )
    rows = []
    for i, section in enumerate(sections):
        plan, length = section.plan, section.path.length
        cells = [
            f'<th scope="row"><a href="#contour-{i + 1}">{escape(section.name)}</a></th>',
            td(number(length * 1e3, 1)),
            td(str(len(section.path))),
        ]
        if plan is None:
            cells.append(f'<td colspan="9">{sign(FAIL, "no feasible path")}</td>')
        else:
            duration, criteria = float(plan.time[-1] - plan.time[0]), plan.criteria
            cells += [
                td(number(length / duration * 60, 2)),
                td(number(duration, 2)),
                td(f"{plan.cost:.5g}"),
                td(plan.proof.bound_shown),
                td(plan.proof.gap_shown),
                f"<td>{_proof(plan)}</td>",
                td(_peak(criteria.peak_velocity)),
                td(_peak(criteria.peak_acceleration)),
                f"<td>{audit_sign(section)}</td>",
            ]
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return table(heads, rows, text_columns=(0, 8, 11))


def _proof(plan: Plan) -> str:
    if plan.proof.gap is not None and not plan.proof.optimal:
        return f"within {plan.proof.gap_shown} % of the best"
    if plan.proof.grid_cost is None:
        return "best on this graph" if plan.proof.optimal else "not proved"
    whole = "the best" if plan.proof.optimal else "a path"
    return f"refined from {whole} on the graph, {plan.proof.grid_cost:.5g}"


def criteria_table(plan: Plan) -> str:
    """Return the criteria (7) to (9) and the peak shares, joint by joint."""
    robot = plan.robot
    unit = "deg or mm" if "m" in robot.units else "deg"
    heads = (
        ("Joint", ""),
        ("Displacement", unit),
        ("Largest increment", f"{unit} per node"),
        ("Range", unit),
        ("Peak velocity", "% of limit"),
        ("Peak acceleration", "% of limit"),
    )
    c, rows = plan.criteria, []
    for i, name in enumerate(robot.joint_names):
        linear = robot.units[i] == "m"
        scale = 1e3 if linear else 180 / math.pi
        values = (
            number(scale * c.displacement[i], 1),
            number(scale * c.largest_increment[i], 3),
            number(scale * c.range[i], 1),
            number(c.peak_velocity[i] * 100, 1),
            number(c.peak_acceleration[i] * 100, 1),
        )
        said = f"{escape(name)}, mm" if linear else escape(name)
        head = f'<th scope="row">{_chip(joint_colours(robot)[i])}{said}</th>'
        rows.append(f"<tr>{head}{''.join(map(td, values))}</tr>")
    return table(heads, rows)


def nearest_table(plan: Plan) -> str:
    """Return the least distances of nodes from singularities and limits, and their margins."""
    heads = (("Nearest to", ""), ("Least", ""), ("At node", ""), ("Margin", ""))
    bands = {} if plan.settings.comfort is None else plan.settings.comfort.bands
    rows = []
    for name, (least, node) in plan.criteria.nearest.items():
        unit = MEASURES[name].unit
        margin = bands[name].margin if name in bands else 0.0
        rows.append(
            f'<tr><th scope="row">{escape(MEASURES[name].words)}</th>'
            + td(_with_unit(least, unit))
            + td(str(node))
            + td(_with_unit(margin, unit) if margin else "&ndash;")
            + "</tr>"
        )
    return table(heads, rows)


def audit_table(checks: Sequence[Check]) -> str:
    """Return the audit: each check, its worst value, the allowed value, the node, the verdict."""
    if not checks:
        return '<p class="quiet">The audit was not run.</p>'
    heads = (("Check", ""), ("Worst", ""), ("Allowed", ""), ("At node", ""), ("Result", ""))
    rows = []
    for check in checks:
        state = PASS if check.ok else FAIL if check.level == "error" else WARN
        # Advice is shown only for a failed check.
        wanted = check.advice and not check.ok
        advice = f" <small>{escape(check.advice)}</small>" if wanted else ""
        words = {PASS: "passed", FAIL: "failed", WARN: "warning"}
        rows.append(
            f'<tr class="{state}"><th scope="row">{escape(check.title)}{advice}</th>'
            + td(_with_unit(check.value, check.unit))
            + td("≤ " + _with_unit(check.limit, check.unit))
            + td(str(check.node) if check.node >= 0 else "&ndash;")
            + f"<td>{sign(state, words[state])}</td></tr>"
        )
    return table(heads, rows, text_columns=(0, 4))


def counts_table(graph: LayeredGraph) -> str:
    """Return the counts of admitted candidates and of each reason, in per cent and as bars."""
    counts, colours = graph.counts(), reason_colours(graph.reasons)
    whole, rows = sum(counts.values()), []
    for word, count in counts.items():
        share = 100 * count / whole
        colour = colours[graph.reasons.index(word)]
        rows.append(
            f'<tr><th scope="row">{_chip(colour)}{escape(word)}</th>'
            + td(f"{count:,}".replace(",", "\N{THIN SPACE}"))
            + td(f"{share:.1f} %")
            + f'<td class="bar"><i style="width:{share:.2f}%;background:{colour}"></i></td></tr>'
        )
    return table((("Candidate", ""), ("Number", ""), ("Share", ""), ("", "")), rows)


def reason_legend(graph: LayeredGraph, postures: Sequence[int], *, has_plan: bool) -> str:
    """Return the legend of the feasibility map: only the reasons that occur in it."""
    colours = reason_colours(graph.reasons)
    items = [
        f"<li>{_chip(colours[code])}{escape(graph.reasons[code])}</li>"
        for code in np.unique(graph.reason_by_gamma[:, :, list(postures)])
    ]
    if has_plan:
        items.append('<li><i class="line"></i>chosen gamma</li>')
    return f'<ul class="legend">{"".join(items)}</ul>'


def audit_sign(section: ContourSection) -> str:
    """Return the verdict of the audit on a section, with its sign."""
    if not section.checks:
        return sign(WARN, "not audited")
    if section.errors:
        return sign(FAIL, f"{len(section.errors)} of {len(section.checks)} failed")
    if section.warnings:
        return sign(WARN, f"passed, {len(section.warnings)} to note")
    return sign(PASS, "passed")


def sign(state: str, words: str) -> str:
    """Return `words` with the sign and colour of `state` (pass, fail or warn)."""
    return f'<span class="sign {state}"><b>{_SIGNS[state]}</b> {escape(words)}</span>'


def number(value: float, digits: int) -> str:
    """Return `value` with `digits` decimals, or a word where it is not finite."""
    if math.isnan(value):
        return "not a number"
    if math.isinf(value):
        return "∞" if value > 0 else "&minus;∞"
    return f"{value:.{digits}f}".replace("-", "&minus;")


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor from `unit` to the unit that is shown, and that unit."""
    return _UNITS.get(unit, (1.0, f" {unit}" if unit else ""))


def _with_unit(value: float, unit: str) -> str:
    factor, suffix = _UNITS[unit]
    scaled = value * factor
    if not math.isfinite(scaled) or unit == "count":
        return number(scaled, 0) + suffix
    if scaled and abs(scaled) < 1e-3:
        return f"{scaled:.1e}".replace("-", "&minus;") + suffix
    return f"{scaled:.4g}".replace("-", "&minus;") + suffix


def _peak(shares: np.ndarray) -> str:
    return f"{number(float(shares.max()) * 100, 1)} <small>J{int(shares.argmax()) + 1}</small>"


def td(text: str) -> str:
    """Return a cell with a number."""
    return f'<td class="n">{text}</td>'


def _chip(colour: str) -> str:
    return f'<i class="chip" style="background:{colour}"></i>'


def table(
    heads: Sequence[tuple[str, str]], rows: Sequence[str], text_columns: Sequence[int] = (0,)
) -> str:
    """Return a table; `heads` are (title, unit), columns except `text_columns` align right."""
    head = ""
    for i, (title, unit) in enumerate(heads):
        side = "" if i in text_columns else ' class="n"'
        small = f" <small>{unit}</small>" if unit else ""
        head += f'<th{side} scope="col">{title}{small}</th>'
    inner = f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="table"><table>{inner}</table></div>'


# -----------------------------------------------------------------------------
# A page with one table: the results of a study, row by row.


def render_table(
    title: str,
    *,
    kind: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[str]],
    text_columns: Collection[int] = (0,),
    caption: str = "",
    facts: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
    job_text: str = "",
) -> str:
    """Return a self-contained HTML page with a table; the same input gives the same text.

    Parameters
    ----------
    title, kind : str
        Heading of the page, and the kind of page above it.
    heads : sequence of (title, unit)
    rows : sequence of sequence of str
        A text for each head.
    text_columns : collection of int
        Columns that are aligned left; the others are aligned right.
    caption : str
        Text above the table.
    facts : sequence of (what, value)
    notes : sequence of str
    job_text : str
        The job file as read.
    """
    lines = [
        "<tr>"
        + "".join(
            f"<td>{escape(text)}</td>" if i in text_columns else td(escape(text))
            for i, text in enumerate(row)
        )
        + "</tr>"
        for row in rows
    ]
    body = [
        header(kind, title, facts=facts, notes=notes),
        f'<section><p class="caption">{escape(caption)}</p>' if caption else "<section>",
        table(heads, lines, text_columns=tuple(text_columns)),
        "</section>",
        job_part(job_text),
        f"<footer>kerfpath {escape(version('kerfpath'))}</footer>",
    ]
    return page(title, body, Figures())


# -----------------------------------------------------------------------------
# The page of a job: its contours with plans, maps, figures and audits.


def render(
    title: str,
    sections: Sequence[ContourSection],
    *,
    mesh: tuple[ArrayLike, ArrayLike] | None = None,
    cell: Cell | None = None,
    moves: Sequence[ArrayLike] = (),
    facts: Sequence[tuple[str, str]] = (),
    faults: Sequence[str] = (),
    notes: Sequence[str] = (),
    job_text: str = "",
) -> str:
    """Return the report as one self-contained HTML page; the same input gives the same text.

    Parameters
    ----------
    title : str
        Heading of the page.
    sections : sequence of ContourSection
        The contours, in cutting order.
    mesh : (vertices (V, 3) m, triangles (F, 3)), optional
        The part, in the part frame.
    cell : Cell, optional
        Fixtures, robot and head; robot and head are drawn at a few poses.
    moves : sequence of (m, 3) m
        Paths of the tool tip on the transfer moves, in the part frame.
    facts : sequence of (what, value)
        Rows such as ("Robot", "ABB IRB 4600-60/2.05").
    faults : sequence of str
        Reasons not to cut the job although its contours are planned, and what to do.
    notes : sequence of str
        Warnings, shown at the top.
    job_text : str
        The job file as read.
    """
    figures = Figures()
    shown = next((i for i, section in enumerate(sections) if section.failed), 0)
    state, verdict = _verdict(sections, faults)
    body = [
        header(
            "Cutting plan",
            title,
            facts=facts,
            notes=notes,
            verdict=f'<p class="verdict {state}">{sign(state, verdict)}</p>'
            + _first_steps(sections, faults),
            tools='<button class="whole" type="button">Print every contour</button>',
        ),
        "<section><h2>Part and contours</h2>",
        '<p class="caption">Part frame, all axes to the same scale. Dot and cone mark start and '
        "direction; short lines are tool axes, on the side of the nozzle. Drag to turn, scroll to "
        f"zoom.{_AIR if moves else ''}{'' if cell is None else _CELL}</p>",
        figures.place(scene(sections, mesh, cell, moves), "scene"),
        "</section>",
        "<section><h2>Contours</h2>",
        _bound_caption(sections),
        summary_table(sections),
        "</section>",
        '<section class="contours"><h2>Contour by contour</h2>',
        *(_contour(i, section, i == shown, figures) for i, section in enumerate(sections)),
        "</section>",
        job_part(job_text),
        f"<footer>{_origin(sections)}</footer>",
    ]
    return page(title, body, figures, also="plan")


MOST_STEPS = 5
"""Failed contours named at the top; the others are listed below."""
_SPARE = (
    " Where no limit is broken, the colour shows the clearance beyond the near-miss distance; pairs"
    " with a distance of their own, such as nozzle and part, are only tested for collision."
)
_BOUND = (
    "Bound: no motion that keeps the velocity and acceleration limits at the nodes costs less, at "
    "any gamma, in any posture and turn; this is proved. Gap: largest share of the cost by which "
    "the plan may exceed the best motion. Collisions, margins and closure can only raise the cost "
    "of the best motion."
)
_AIR = " Thin red lines are transfer moves; the table is in the order of cutting."
_CELL = " The slider moves robot and head to a few poses; capsules represent links."


def _bound_caption(sections: Sequence[ContourSection]) -> str:
    """Return the explanation of the bounds in the table; empty if it has none."""
    if all(section.plan is None or section.plan.proof.bound is None for section in sections):
        return ""
    return f'<p class="caption">{_BOUND}</p>'


def _contour(index: int, section: ContourSection, is_open: bool, figures: Figures) -> str:
    plan = section.plan
    result = audit_sign(section) if plan else sign(FAIL, "no feasible path")
    size = f"{number(section.path.length * 1e3, 1)} mm, {len(section.path)} nodes"
    parts = [
        f'<details id="contour-{index + 1}"{" open" if is_open else ""}>',
        f'<summary><h3>{escape(section.name)}</h3><span class="quiet">{size}</span>'
        f"{result}</summary>",
    ]
    if plan is None:
        parts.append(_failure(section))
    else:
        parts.append(f'<p class="caption">{escape(_objective_line(plan))}</p>')
    if section.sampling:
        parts += ["<h4>Sampling</h4>", facts_list(section.sampling)]
    parts += _map_part(section, figures)
    if plan is not None and plan.feed is not None:
        parts += [
            "<h4>Cutting speed</h4>",
            f'<p class="caption">{escape(str(plan.feed).capitalize())}.</p>',
            figures.place(motion.cutting_speed(plan), "speed"),
        ]
    if plan is not None:
        parts += [
            "<h4>Joint positions</h4>",
            f'<p class="caption">{escape(_posture_line(plan))}</p>',
            figures.place(motion.joint_positions(plan), "positions"),
            "<h4>Joint velocity and acceleration</h4>",
            '<p class="caption">As shares of the limits of the joints, from differences of nodes. '
            f"Solid lines: the limits; dashed: the share η that planning may use "
            f"(velocity {plan.settings.eta_v * 100:g} %, acceleration "
            f"{plan.settings.eta_a * 100:g} %).</p>",
            figures.place(motion.limit_shares(plan), "shares"),
            "<h4>Criteria by joint</h4>",
            criteria_table(plan),
            nearest_table(plan),
            "<h4>Audit</h4>",
            '<p class="caption">An independent re-check of the plan, with its own kinematics.</p>',
            audit_table(section.checks),
        ]
    parts += [
        "<h4>Candidates</h4>",
        '<p class="caption">Number of candidates that were admitted, or dropped for each reason. A '
        "candidate is one gamma in one posture at one node.</p>",
        counts_table(section.mapped),
        "</details>",
    ]
    return "\n".join(parts)


def _map_part(section: ContourSection, figures: Figures) -> list[str]:
    graph, plan = section.mapped, section.plan
    marks = [(mark.node, mark.words) for mark in section.marks]
    figure = maps.feasibility_map(graph, plan, s=section.path.s, marks=marks)
    # The page has its own legend, which wraps, and a hover text with the reason.
    figure.update_layout(showlegend=False)
    figure.update_traces(hovertemplate=None, hoverinfo="none", selector={"type": "heatmap"})
    hidden = maps.hidden_postures(graph)
    others = "".join(f"<li>{escape(text)}</li>" for text in hidden)
    return [
        f"<h4>{'Feasibility' if section.clearance is None else 'Collision'} map</h4>",
        '<p class="caption">Rotations gamma about the beam that the robot can take at each node, '
        "one panel per posture (shoulder / elbow / wrist); elsewhere the colour shows the limit "
        f"that forbids them.{'' if section.clearance is None else _SPARE}</p>",
        reason_legend(graph, maps.shown_postures(graph), has_plan=plan is not None),
        figures.place(figure, "map"),
        f'<ul class="others">{others}</ul>' if others else "",
    ]


def _failure(section: ContourSection) -> str:
    where = "" if section.broken_at is None else f" The path breaks at node {section.broken_at}."
    reason = section.failure or "The search found no admissible path."
    remedy = f"<p>What would help: {escape(section.remedy)}.</p>" if section.remedy else ""
    return (
        f'<div class="failure">{sign(FAIL, "No feasible path")}<p>{escape(reason)}</p>'
        f"<p>{escape(where.strip())}</p>{remedy}</div>"
    )


def _first_steps(sections: Sequence[ContourSection], faults: Sequence[str]) -> str:
    """Return a list of what to do first: the first failed contours, and faults; or ""."""
    failed = [(i, section) for i, section in enumerate(sections) if section.failed]
    items = []
    for i, section in failed[:MOST_STEPS]:
        place = f" ({escape(section.marks[0].words)})" if section.marks else ""
        link = f'<a href="#contour-{i + 1}">{escape(section.name)}</a>{place}'
        items.append(f"<li>{link}: {escape(_remedy(section))}</li>")
    if len(failed) > MOST_STEPS:
        items.append(f"<li>and {len(failed) - MOST_STEPS} more contours, listed below</li>")
    items += [f"<li>{escape(fault)}</li>" for fault in faults]
    if not items:
        return ""
    return f'<div class="failure first"><b>What to do first</b><ul>{"".join(items)}</ul></div>'


def _remedy(section: ContourSection) -> str:
    if section.plan is None:
        if section.remedy:
            return f"cut slower, or relax a limit: {section.remedy}"
        return section.failure or "relax the limits that the map shows"
    worst = section.errors[0]
    return worst.advice or f"{worst.title} exceeds its limit; see the audit"


def _objective_line(plan: Plan) -> str:
    s = plan.settings
    claim = plan.proof.statement
    return (
        f"Objective: {s.objective} of {s.metric} distances, method “{s.method}”, "
        f"cost {plan.cost:.5g}. {claim[:1].upper()}{claim[1:]}."
    )


def _posture_line(plan: Plan) -> str:
    runs = motion.posture_runs(plan)
    if len(runs) == 1:
        return f"Posture {posture_name(runs[0][0])} throughout."
    stretches = [f"{posture_name(mu)} (nodes {a} to {b})" for mu, a, b in runs[:6]]
    more = f", and {len(runs) - 6} more" if len(runs) > 6 else ""
    return f"{len(runs) - 1} changes of posture, shaded: {', '.join(stretches)}{more}."


def _verdict(sections: Sequence[ContourSection], faults: Sequence[str]) -> tuple[str, str]:
    count = len(sections)
    contours = "1 contour" if count == 1 else f"{count} contours"
    unplanned = sum(section.plan is None for section in sections)
    failed = sum(bool(section.errors) for section in sections)
    unchecked = sum(not section.checks for section in sections)
    noted = sum(len(section.warnings) for section in sections)
    if not count:
        return WARN, "Nothing was planned"
    if unplanned:
        audit = f"; the audit failed for {failed}" if failed else ""
        return FAIL, f"No feasible path for {unplanned} of {contours}{audit}"
    if failed:
        return FAIL, f"Planned, but the audit failed for {failed} of {contours}"
    if faults:
        return FAIL, "Planned, but not ready to be cut"
    whole = "The contour is planned" if count == 1 else f"All {contours} are planned"
    if unchecked:
        return WARN, f"{whole}; {unchecked} not audited"
    if noted:
        return PASS, f"{whole} and the audit passed, with {noted} to note"
    return PASS, f"{whole} and the audit passed"


def _origin(sections: Sequence[ContourSection]) -> str:
    lines = [f"kerfpath {version('kerfpath')}"]
    plan = next((section.plan for section in sections if section.plan is not None), None)
    if plan is not None:
        lines.append(f"robot {plan.robot.id}")
        source = plan.robot.acceleration_source or "source not stated"
        lines.append(f"joint acceleration limits: {source}")
        if "geometry_limits_velocity" in plan.robot.sources:
            limits = plan.robot.sources["geometry_limits_velocity"]
            lines.append(f"geometry, joint and velocity limits: {limits}")
    return escape(" · ".join(lines))
