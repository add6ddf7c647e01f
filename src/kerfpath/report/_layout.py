"""The page of a layout: the best placement, its gain, and the other placements tried."""

from __future__ import annotations

from html import escape

from kerfpath.report._html import Figures, header, job_part, page
from kerfpath.report._layout_entry import ContourSide, LayoutEntry
from kerfpath.report._layout_plots import convergence, placement_map
from kerfpath.report._tables import FAIL, PASS, WARN, number, sign, table, td

__all__ = ["render_layout"]

GOALS = {
    "speed": "fastest speed of the slowest contour",
    "margin": "least ratio of fastest to requested speed",
    "motion": "least total displacement of the joints",
}
STATUSES = {
    "feasible": "feasible",
    "speed": "a requested speed is not feasible",
    "collision": "a collision that no path avoids",
    "unreachable": "a node that no admissible pose reaches",
}
STAGES = {
    "reach": "test of reach at every eighth node",
    "stretch": "critical stretches, solved exactly",
    "exact": "all contours, solved exactly",
    "estimate": "an estimate alone",
    "proved": "a proof that no motion is faster than in the best placement",
    "planned": "planned over continuous gamma",
}

DOTS = " Small dots are the placements that were tried, at any value of the other variables."
LONGEST = 160
"""Largest number of characters of a reason that are shown."""


def render_layout(entry: LayoutEntry, *, job_text: str = "") -> str:
    """Return the page of a layout as one self-contained HTML page.

    Parameters
    ----------
    entry : LayoutEntry
        The data of layout.json.
    job_text : str
        The job file as read.
    """
    figures = Figures()
    verdict = f'<p class="verdict {(state := _verdict(entry))[0]}">{sign(*state)}</p>'
    body = [
        header(
            "Placement", entry["job"], facts=_facts(entry), notes=_notes(entry), verdict=verdict
        ),
        *_placement(entry),
        *_contours(entry),
        *_map(entry, figures),
        "<section><h2>Search</h2>",
        f'<p class="caption">Each dot is a placement, in the order in which they were tried: '
        f"{_dots(entry)}; the line is the best so far. {_foot(entry)}</p>",
        figures.place(convergence(entry), "convergence"),
        _tallies(entry),
        "</section>",
        job_part(job_text),
        f"<footer>kerfpath {escape(entry['kerfpath'])} · seed {entry['seed']}</footer>",
    ]
    return page(f"{entry['job']}: placement", body, figures)


def _dots(entry: LayoutEntry) -> str:
    if entry["off_grid"]:
        return "its height is the estimated value. Filled ones were planned"
    return "its height is the bound on its value. Filled ones were solved exactly"


def _foot(entry: LayoutEntry) -> str:
    lost = "Infeasible placements are at the bottom. " if entry["reasons"] else ""
    of_map = f"Placements from {entry['evolved']} on belong to the map." if entry["map"] else ""
    return lost + of_map


def _value(entry: LayoutEntry, value: float | None) -> str:
    """Return a value of the goal in words."""
    if value is None:
        return "none"
    if entry["goal"] == "motion":
        return f"{value:.2f}"
    return f"{value:.3f} {'m/min' if entry['goal'] == 'speed' else 'times'}"


def _verdict(entry: LayoutEntry) -> tuple[str, str]:
    best, shipped = entry["best"], entry["shipped"]
    if best is None:
        return FAIL, f"None of {len(entry['tried'])} placements is feasible"
    result = f"{GOALS[entry['goal']].capitalize()}: {_value(entry, best['value'])}"
    if best["gain"] is None:
        return PASS, f"{result}; the placement of the job is infeasible ({shipped['status']})"
    if best["gain"] <= 0:
        return WARN, f"{result}, in the placement of the job: no other that was tried is better"
    return PASS, f"{result}, {best['gain'] * 100:.1f} % better than in the placement of the job"


def _facts(entry: LayoutEntry) -> list[tuple[str, str]]:
    tried, exact = len(entry["tried"]), entry["exact_searches"]
    facts = [
        ("Goal", GOALS[entry["goal"]]),
        ("Placements tried", f"{tried}, {entry['statuses'].get('feasible', 0)} of them feasible"),
        ("Planned" if entry["off_grid"] else "Solved exactly", f"{exact} of {tried}"),
    ]
    if entry["best"] is not None:
        facts.append(("Placement of the job", _value(entry, entry["shipped"]["value"])))
        facts.append(("Claim", _claim(entry)))
    if entry["tolerance"]:
        spans = ", ".join(f"{name} ±{size:g}" for name, size in entry["tolerance"].items())
        facts.append(("Worst case within", f"{spans}, one at a time"))
    if entry["standing"]:
        facts.append(("Fixtures that do not move", ", ".join(entry["standing"])))
    return facts


def _claim(entry: LayoutEntry) -> str:
    if entry["proved"]:
        return "proved: the best of the placements that were tried"
    others = _value(entry, entry["open_bound"])
    if not entry["off_grid"]:
        return f"others may reach {others}"
    return (
        f"the best of those planned; {entry['estimated']} others are judged by an estimate alone, "
        f"at best {others}, which proves nothing"
    )


def _notes(entry: LayoutEntry) -> list[str]:
    notes = []
    if entry["default_ranges"]:
        notes.append("The job has no ranges in [layout]: these are the default ranges.")
    best = entry["best"]
    if entry["goal"] == "margin" and best is not None and best["value"] < 1:
        notes.append("Even in the best placement, a contour cannot be cut at its requested speed.")
    if best is None and entry["reasons"]:
        why = entry["reasons"][0]
        where = f" {why['contour']}, node {why['node']}:" if why["contour"] else ""
        notes.append(f"Most common:{where} {why['reason']} ({why['count']} placements).")
    return notes


def _placement(entry: LayoutEntry) -> list[str]:
    best = entry["best"]
    at = best or entry["nearest"]
    assert at is not None, "a layout has a best placement or a nearest one"
    what = "Best" if best else "Nearest to feasible"
    rows = []
    for name, (low, high) in entry["ranges"].items():
        value, unit = at["offsets"][name], name.rpartition("_")[2]
        at_end = min(value - low, high - value) < 0.01 * (high - low)
        shown = number(value, 2 if unit == "mm" else 3)
        shown += " <small>at the end</small>" if at_end else ""
        rows.append(
            f'<tr><th scope="row">{escape(name)}</th>{td(f"{low:g}".replace("-", "&minus;"))}'
            f"{td(f'{high:g}'.replace('-', '&minus;'))}{td(shown)}</tr>"
        )
    parts = [
        "<section><h2>The placement</h2>",
        '<p class="caption">Offsets from the placement of the job, along the axes of the robot '
        "base. The part turns about the middle of its contours. Fixtures move with it, except any "
        "that are listed above. If the best value is at the end of a range, a wider range may "
        "contain a better one.</p>",
        table((("Variable", ""), ("From", ""), ("To", ""), (what, "")), rows),
    ]
    if best:
        numbers = "".join(
            f"<li><b>{escape(key)}</b> = {escape(str(value))}</li>"
            for key, value in best["numbers"].items()
        )
        parts.append(
            f'<ul class="others">{numbers or "<li>The job stays as it is.</li>"}</ul>'
            '<p class="caption"><b>placed.toml</b> is the job with these numbers.</p>'
        )
    return [*parts, "</section>"]


def _contours(entry: LayoutEntry) -> list[str]:
    if not entry["contours"]:
        return []
    motion = entry["goal"] == "motion"
    unit = "displacement" if motion else "m/min"
    heads = [("Contour", ""), ("As the job has it", unit), ("Best", unit), ("Change", "%")]
    heads += [] if motion else [("Binding limit, before", ""), ("after", "")]
    rows = []
    for contour in entry["contours"]:
        sides = [contour["before"], contour["after"]]
        values = [
            None if s is None else s.get("value") if motion else s.get("fastest_m_min")
            for s in sides
        ]
        change = ""
        if values[0] is not None and values[1] is not None:
            change = f"{(values[1] / values[0] - 1) * 100:+.1f}".replace("-", "&minus;")
        shown = [number(v, 2 if motion else 3) if v is not None else "" for v in values]
        cells = "".join(td(text) for text in [*shown, change])
        binds = "" if motion else "".join(f"<td>{_binds(side)}</td>" for side in sides)
        rows.append(f'<tr><th scope="row">{escape(contour["name"])}</th>{cells}{binds}</tr>')
    return [
        "<section><h2>Contours</h2>",
        f'<p class="caption">{_how(entry)}{"" if motion else ": the fastest constant speed"}.</p>',
        table(heads, rows, text_columns=(0, 4, 5)),
        "</section>",
    ]


def _how(entry: LayoutEntry) -> str:
    if entry["off_grid"]:
        return "Best motion found over continuous gamma"
    return "Optimum of each contour on the grid of the job"


def _binds(side: ContourSide | None) -> str:
    if side is None or "joint" not in side:
        return ""
    return f"joint {side['joint']} {side['limit']} <small>node {side['node']}</small>"


def _map(entry: LayoutEntry, figures: Figures) -> list[str]:
    drawn = entry["map"]
    if drawn is None:
        return []
    others = [name for name in entry["ranges"] if name not in drawn["variables"]]
    held = f", {' and '.join(others)} as in the best placement" if others else ""
    over = f"{' and '.join(drawn['variables'])}{held}"
    known = "Value of the goal, mostly estimated," if entry["off_grid"] else "Bound on the goal"
    return [
        "<section><h2>Map</h2>",
        f'<p class="caption">{known} over {over}; infeasible placements show the reason.'
        f"{DOTS if drawn['y'] else ''}</p>",
        figures.place(placement_map(entry, drawn), "placements"),
        "</section>",
    ]


def _tallies(entry: LayoutEntry) -> str:
    parts, total = [], len(entry["tried"])
    for title, words, counts in (
        ("Decided by", STAGES, entry["stages"]),
        ("Outcome", STATUSES, entry["statuses"]),
    ):
        tally = {name: count for name in words if (count := counts.get(name))}
        rows = [
            f'<tr><th scope="row">{words[name]}</th>{td(str(count))}'
            f"{td(f'{100 * count / total:.0f}')}</tr>"
            for name, count in tally.items()
        ]
        heads = [("", ""), ("Placements", ""), ("", "%")]
        parts += [f"<h4>{title}</h4>", table(heads, rows)]
    reasons = [
        f'<tr><th scope="row">{STATUSES[why["status"]]}</th>'
        f"<td>{escape(why['contour'] or '')}</td>"
        f"{td('' if why['node'] is None else str(why['node']))}{td(str(why['count']))}"
        f"<td>{escape(why['reason'][:LONGEST])}</td></tr>"
        for why in entry["reasons"]
    ]
    if reasons:
        heads = [("", ""), ("Contour", ""), ("Node, most often", ""), ("Placements", "")]
        why_not = table([*heads, ("Example", "")], reasons, text_columns=(0, 1, 4))
        parts += ["<h4>Reasons of infeasible placements</h4>", why_not]
    return "\n".join(parts)
