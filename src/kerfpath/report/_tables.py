"""The tables of the report as HTML; all texts from outside are escaped here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape

import numpy as np

from kerfpath.auditor import Check
from kerfpath.comfort import MEASURES
from kerfpath.graph import LayeredGraph
from kerfpath.plans import Plan
from kerfpath.report._look import joint_colours, reason_colours
from kerfpath.report._section import ContourSection

__all__ = [
    "FAIL",
    "PASS",
    "WARN",
    "audit_table",
    "counts_table",
    "criteria_table",
    "nearest_table",
    "number",
    "reason_legend",
    "shown_unit",
    "sign",
    "summary_table",
    "table",
    "td",
]

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
