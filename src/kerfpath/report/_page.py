"""The page of a job: its contours with plans, maps, figures and audits."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.metadata import version

from numpy.typing import ArrayLike

from kerfpath.cell import Cell
from kerfpath.plans import Plan
from kerfpath.report import _map, _motion, _tables
from kerfpath.report._html import Figures, facts_list, header, job_part, page
from kerfpath.report._scene import scene
from kerfpath.report._section import ContourSection
from kerfpath.report._tables import FAIL, PASS, WARN, sign
from kerfpath.robots import posture_name

__all__ = ["render"]


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
        _tables.summary_table(sections),
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


def _contour(number: int, section: ContourSection, is_open: bool, figures: Figures) -> str:
    plan = section.plan
    result = _tables.audit_sign(section) if plan else sign(FAIL, "no feasible path")
    size = f"{_tables.number(section.path.length * 1e3, 1)} mm, {len(section.path)} nodes"
    parts = [
        f'<details id="contour-{number + 1}"{" open" if is_open else ""}>',
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
            figures.place(_motion.cutting_speed(plan), "speed"),
        ]
    if plan is not None:
        parts += [
            "<h4>Joint positions</h4>",
            f'<p class="caption">{escape(_posture_line(plan))}</p>',
            figures.place(_motion.joint_positions(plan), "positions"),
            "<h4>Joint velocity and acceleration</h4>",
            '<p class="caption">As shares of the limits of the joints, from differences of nodes. '
            f"Solid lines: the limits; dashed: the share η that planning may use "
            f"(velocity {plan.settings.eta_v * 100:g} %, acceleration "
            f"{plan.settings.eta_a * 100:g} %).</p>",
            figures.place(_motion.limit_shares(plan), "shares"),
            "<h4>Criteria by joint</h4>",
            _tables.criteria_table(plan),
            _tables.nearest_table(plan),
            "<h4>Audit</h4>",
            '<p class="caption">An independent re-check of the plan, with its own kinematics.</p>',
            _tables.audit_table(section.checks),
        ]
    parts += [
        "<h4>Candidates</h4>",
        '<p class="caption">Number of candidates that were admitted, or dropped for each reason. A '
        "candidate is one gamma in one posture at one node.</p>",
        _tables.counts_table(section.mapped),
        "</details>",
    ]
    return "\n".join(parts)


def _map_part(section: ContourSection, figures: Figures) -> list[str]:
    graph, plan = section.mapped, section.plan
    marks = [(mark.node, mark.words) for mark in section.marks]
    figure = _map.feasibility_map(graph, plan, s=section.path.s, marks=marks)
    # The page has its own legend, which wraps, and a hover text with the reason.
    figure.update_layout(showlegend=False)
    figure.update_traces(hovertemplate=None, hoverinfo="none", selector={"type": "heatmap"})
    hidden = _map.hidden_postures(graph)
    others = "".join(f"<li>{escape(text)}</li>" for text in hidden)
    return [
        f"<h4>{'Feasibility' if section.clearance is None else 'Collision'} map</h4>",
        '<p class="caption">Rotations gamma about the beam that the robot can take at each node, '
        "one panel per posture (shoulder / elbow / wrist); elsewhere the colour shows the limit "
        f"that forbids them.{'' if section.clearance is None else _SPARE}</p>",
        _tables.reason_legend(graph, _map.shown_postures(graph), has_plan=plan is not None),
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
    runs = _motion.posture_runs(plan)
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
