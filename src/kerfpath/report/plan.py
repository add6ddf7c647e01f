"""The page of a job: its contours with plans, maps, figures and audits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import Unpack

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from kerfpath.arrays import SHOWN_UNITS
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES
from kerfpath.graph import LayeredGraph
from kerfpath.plans import Plan
from kerfpath.report import executed, maps, motion
from kerfpath.report.page import FAIL, PASS, WARN, PageKeywords, number, render_page
from kerfpath.report.scene import scene
from kerfpath.report.section import ContourSection
from kerfpath.report.style import joint_colours, reason_colours
from kerfpath.robots import posture_name

MOST_STEPS = 5
"""Failed contours named at the top; the others are listed below."""


def render(
    title: str,
    sections: Sequence[ContourSection],
    *,
    mesh: tuple[ArrayLike, ArrayLike] | None = None,
    cell: Cell | None = None,
    moves: Sequence[ArrayLike] = (),
    faults: Sequence[str] = (),
    process: Sequence[Sequence[str]] = (),
    spent: tuple[Sequence[tuple[str, str]], Sequence[Sequence[str]]] = ((), ()),
    **page: Unpack[PageKeywords],
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
    faults : sequence of str
        Reasons not to cut the job although its contours are planned, and what to do.
    process : sequence of (of, key, value, origin, who sets it)
        Values of the process; empty without a chart.
    spent : (sequence of (str, str), sequence of sequence of str)
        Columns, by name and unit, and rows of what each contour takes.
    **page
        As in `PageKeywords`; facts such as ("Robot", "ABB IRB 4600-60/2.05").
    """
    failed = [(i, section) for i, section in enumerate(sections, 1) if section.failed]
    state, verdict = _verdict(sections, faults)
    return render_page(
        "plan.html",
        kind="Cutting plan",
        title=title,
        state=state,
        verdict=verdict,
        first_steps=[(i, section, _remedy(section)) for i, section in failed[:MOST_STEPS]],
        other_failures=len(failed[MOST_STEPS:]),
        faults=faults,
        process=process,
        spent=spent,
        sections=sections,
        open_contour=failed[0][0] if failed else 1,
        scene=scene(sections, mesh, cell, moves),
        cell=cell,
        moves=moves,
        has_bounds=any(s.plan is not None and s.plan.proof.bound is not None for s in sections),
        origin=_origin(sections),
        measures=MEASURES,
        motion=motion,
        executed=executed,
        counts_of=_counts,
        hidden_postures=maps.hidden_postures,
        joints_of=_joints,
        legend_of=_legend,
        map_of=_map,
        margin_of=_margin,
        objective_of=_objective,
        postures_of=_postures,
        posture_words=_posture_words,
        proof_of=_proof,
        **page,
    )


def _proof(plan: Plan) -> str:
    if plan.proof.gap is not None and not plan.proof.optimal:
        return f"within {plan.proof.gap_shown} % of the best"
    if plan.proof.grid_cost is None:
        return "best on this graph" if plan.proof.optimal else "not proved"
    whole = "the best" if plan.proof.optimal else "a path"
    return f"refined from {whole} on the graph, {plan.proof.grid_cost:.5g}"


def _joints(plan: Plan) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Yield the colour and name of each joint, and its criteria and peaks."""
    robot, c = plan.robot, plan.criteria
    for i, name in enumerate(robot.joint_names):
        scale, unit = SHOWN_UNITS[robot.units[i]]
        values = (
            number(scale * c.displacement[i], 1),
            number(scale * c.largest_increment[i], 3),
            number(scale * c.range[i], 1),
            number(c.peak_velocity[i] * 100, 1),
            number(c.peak_acceleration[i] * 100, 1),
        )
        yield joint_colours(robot)[i], f"{name}, {unit}" if unit == "mm" else name, values


def _margin(plan: Plan, measure: str) -> float:
    """Return the margin that a plan keeps in a measure of comfort, 0 if none was asked for."""
    bands = {} if plan.settings.comfort is None else plan.settings.comfort.bands
    return bands[measure].margin if measure in bands else 0.0


def _counts(graph: LayeredGraph) -> Iterator[tuple[str, str, str, float]]:
    """Yield the colour and words of each reason, and its candidates: their number, per cent."""
    counts, colours = graph.counts(), reason_colours(graph.reasons)
    for words, count in counts.items():
        share = 100 * count / sum(counts.values())
        yield colours[graph.reasons.index(words)], words, f"{count:,}", share


def _legend(graph: LayeredGraph) -> Iterator[tuple[str, str]]:
    """Yield the colour and words of each reason that occurs in the feasibility map."""
    colours = reason_colours(graph.reasons)
    for code in np.unique(graph.reason_by_gamma[:, :, list(maps.shown_postures(graph))]):
        yield colours[code], graph.reasons[code]


def _map(section: ContourSection, graph: LayeredGraph) -> go.Figure:
    marks = [(mark.node, mark.words) for mark in section.marks]
    figure = maps.feasibility_map(graph, section.plan, s=section.path.s, marks=marks)
    # The page has its own legend, which wraps, and a hover text with the reason.
    figure.update_layout(showlegend=False)
    figure.update_traces(hovertemplate=None, hoverinfo="none", selector={"type": "heatmap"})
    return figure


def _remedy(section: ContourSection) -> str:
    if section.plan is None:
        if section.remedy:
            return f"cut slower, or relax a limit: {section.remedy}"
        return section.failure or "relax the limits that the map shows"
    worst = section.errors[0]
    return worst.advice or f"{worst.title} exceeds its limit; see the audit"


def _objective(plan: Plan) -> str:
    s = plan.settings
    claim = plan.proof.statement
    return (
        f"Objective: {s.objective} of {s.metric} distances, method “{s.method}”, "
        f"cost {plan.cost:.5g}. {claim[:1].upper()}{claim[1:]}.{_explored(plan)}"
    )


def _explored(plan: Plan) -> str:
    """Return a sentence on what the search followed and dropped; "" if there was none."""
    told = plan.proof.explored
    return "" if told is None else f" Search: {told.words}."


def _postures(plan: Plan) -> str:
    runs = motion.posture_runs(plan)
    if len(runs) == 1:
        return f"Posture {posture_name(runs[0][0])} throughout."
    stretches = [f"{posture_name(mu)} (nodes {a} to {b})" for mu, a, b in runs[:6]]
    more = f", and {len(runs) - 6} more" if len(runs) > 6 else ""
    return f"{len(runs) - 1} changes of posture, shaded: {', '.join(stretches)}{more}."


def _posture_words(plan: Plan) -> str:
    """Return the postures of a plan in the order in which they are taken, as text."""
    return ", ".join(posture_name(mu) for mu, _, _ in motion.posture_runs(plan)[:3])


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
    return " · ".join(lines)
