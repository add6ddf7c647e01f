"""The page of a layout: the best placement, its gain, and the other placements tried."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Literal, TypedDict

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from kerfpath.report.page import FAIL, PASS, WARN, number, render_page, with_minus
from kerfpath.report.style import (
    ACCENT,
    ALERT,
    FAINT,
    INK,
    QUIET,
    axis,
    axis_title,
    base_layout,
    say_why_empty,
)

# -----------------------------------------------------------------------------
# The data of layout.json: `kerfpath.study` writes them, the page and the command read them.
#
# Classes with ``total=False`` have optional keys. Offsets are in the unit at the end of each
# variable's name; values are in the `unit` of the goal.

Goal = Literal["speed", "margin", "motion"]


class _Reason(TypedDict, total=False):
    """The reason why a placement is infeasible, and where; `progress` is how far its test got."""

    reason: str
    contour: str
    node: int
    nodes: int
    progress: float


class _Shipped(_Reason):
    """The placement of the job itself."""

    status: str
    value: float | None


class _Best(TypedDict):
    """The best placement.

    `gain` over the job's placement is a share; `numbers` has keys of the job and their new values.
    """

    offsets: dict[str, float]
    value: float
    gain: float | None
    numbers: dict[str, object]


class TriedPlacement(_Reason):
    """A placement that was tried.

    `bound` is a value that it cannot beat, `estimate` its approximate value over continuous gamma.
    """

    offsets: dict[str, float]
    status: str
    stage: str
    bound: float | None
    value: float | None
    estimate: float | None


class ContourSide(TypedDict, total=False):
    """The value of one contour in one placement, and the limit that binds."""

    value: float
    at_least: float
    fastest_m_min: float
    joint: int
    limit: str
    node: int


class _Contour(TypedDict):
    """A contour in the job's placement and in the best one."""

    name: str
    before: ContourSide | None
    after: ContourSide | None


class _Tally(TypedDict):
    """Count of infeasible placements with the same status and contour; `node` is the commonest."""

    status: str
    contour: str | None
    count: int
    node: int | None
    reason: str


class MapSquare(_Reason):
    """One placement of the map."""

    status: str
    bound: float | None
    value: float | None
    estimate: float | None


class LayoutMap(TypedDict):
    """Placements over two variables; `y` is empty if there is only one variable."""

    variables: list[str]
    x: list[float]
    y: list[float]
    cells: list[MapSquare]


class LayoutEntry(TypedDict):
    """All of layout.json.

    With `off_grid`, values are those of plans over continuous gamma, for `exact_searches`
    placements. `open_bound` is then the best estimate of the placements that have only an estimate
    (`estimated`), and `estimate_error` the least and the largest ratio of a plan's value to its
    estimate.
    """

    schema: int
    kerfpath: str
    job: str
    goal: Goal
    off_grid: bool
    unit: str
    ranges: dict[str, tuple[float, float]]
    default_ranges: bool
    standing: list[str]
    tolerance: dict[str, float]
    seed: int
    evaluations: int
    feasible: bool
    shipped: _Shipped
    best: _Best | None
    contours: list[_Contour]
    proved: bool
    open_bound: float | None
    statuses: dict[str, int]
    stages: dict[str, int]
    exact_searches: int
    estimated: int
    estimate_error: list[float] | None
    reasons: list[_Tally]
    nearest: TriedPlacement | None
    evolved: int
    tried: list[TriedPlacement]
    map: LayoutMap | None


def promise(goal: Goal, placement: TriedPlacement | MapSquare) -> float | None:
    """Return the value of a placement, else the tighter one of bound and estimate, else None."""
    if placement["value"] is not None:
        return placement["value"]
    known = [v for v in (placement["bound"], placement["estimate"]) if v is not None]
    return (max if goal == "motion" else min)(known, default=None)


# -----------------------------------------------------------------------------
# The figures on the page of a layout: the map of placements, and the progress of the search.

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


def _say_no_value(figure: go.Figure, placements: Sequence[TriedPlacement | MapSquare]) -> None:
    """Say in a figure without values why none of its placements has one."""
    counts = Counter(placement["status"] for placement in placements)
    reasons = "; ".join(f"{words}: {counts[s]}" for s, words in STATUSES.items() if counts[s])
    say_why_empty(figure, f"No value to draw: no placement is feasible ({reasons})")


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
    if all(value is None for row in bound for value in row):
        _say_no_value(figure, drawn["cells"])
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
    if all(value is None for value in bounds):
        _say_no_value(figure, drawn["cells"])
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
    if not feasible:
        _say_no_value(figure, tried)
    figure.update_xaxes(**axis(title=axis_title("placement")))
    figure.update_yaxes(**axis(title=axis_title(WORDS[entry["goal"]])))
    return figure


# -----------------------------------------------------------------------------
# The page of a layout: the best placement, its gain, and the other placements tried.

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
    state, verdict = _verdict(entry)
    return render_page(
        "layout.html",
        kind="Placement",
        title=entry["job"],
        facts=_facts(entry),
        notes=_notes(entry),
        job_text=job_text,
        state=state,
        verdict=verdict,
        entry=entry,
        motion=entry["goal"] == "motion",
        offsets=_offsets(entry),
        contours=_contours(entry),
        placement_map=placement_map,
        convergence=convergence,
        tallies=[("Decided by", STAGES, entry["stages"]), ("Outcome", STATUSES, entry["statuses"])],
        statuses=STATUSES,
        longest=LONGEST,
    )


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


def _offsets(entry: LayoutEntry) -> Iterator[tuple[str, Markup, Markup, Markup, bool]]:
    """Yield each variable: its name, range, value, and whether that is at an end of the range."""
    at = entry["best"] or entry["nearest"]
    assert at is not None, "a layout has a best placement or a nearest one"
    for name, (low, high) in entry["ranges"].items():
        value = at["offsets"][name]
        shown = number(value, 2 if name.endswith("_mm") else 3)
        is_at_end = min(value - low, high - value) < 0.01 * (high - low)
        yield name, with_minus(f"{low:g}"), with_minus(f"{high:g}"), shown, is_at_end


def _contours(entry: LayoutEntry) -> list[tuple[str, list[str], list[ContourSide | None]]]:
    """Return each contour: its name, its values before and after and their change, both sides."""
    motion, rows = entry["goal"] == "motion", []
    for contour in entry["contours"]:
        sides = [contour["before"], contour["after"]]
        values = [
            None if s is None else s.get("value") if motion else s.get("fastest_m_min")
            for s in sides
        ]
        change = ""
        if values[0] is not None and values[1] is not None:
            change = with_minus(f"{(values[1] / values[0] - 1) * 100:+.1f}")
        shown = [number(v, 2 if motion else 3) if v is not None else "" for v in values]
        rows.append((contour["name"], [*shown, change], sides))
    return rows
