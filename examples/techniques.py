"""Compare the fronts of four techniques: known, the paper's procedure, the exact search, and ours.

The paper's section 4 says that its technique "simplifies obtaining smooth solutions with the
balanced values of the partial criteria". `known_against_proposed` compares single plans of one
planar task; this example compares the fronts of three tasks: that sheet, and the trim lines of two
shipped parts as in their jobs, without a cell. Each is cut at shares of the fastest constant speed
at which its grid has a path, so that the limits are active and matter.

Every technique has the same number of runs. Known (one posture, limits untested), paper (the
procedure, greedy on acceleration) and exact (the optimum) have the same grid of objective, metric
and weights; paper and exact also have the same eta_v and eta_a: 1, or halfway to the least with a
path. Ours is `kerfpath.pareto`: also exact, but its runs are placed where the front is sparse, with
windows. All plans are on the grid of gamma. A plan is acceptable if its peak velocity and
acceleration shares are at most 1 and the audit finds nothing. README.md and the figure are made
from table.csv.

Run: python examples/techniques.py [--out DIR] [--quick]
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from importlib.resources import files
from itertools import cycle, product
from pathlib import Path
from statistics import median
from typing import Any, get_args

import moocore
import numpy as np

from kerfpath import Contour, NoFeasiblePath, Plan, audit, pareto, plan
from kerfpath.front import hypervolume
from kerfpath.job import read_job
from kerfpath.planner import fastest_speed, layered_graph, node_interval, relaxations
from kerfpath.search import Method, Metric, ObjectiveKind
from known_against_proposed import (
    MAIN,
    QUICK,
    Array,
    Eta,
    Row,
    options_of,
    reversals,
    setting,
    table_line,
    weight_factors,
    write_table,
)

Made = tuple[Contour, dict[str, Any]]
"""Nodes, and the arguments of their layered graph."""
Case = tuple[str, str]
"""Task, and the share of its fastest speed."""
Choice = tuple[ObjectiveKind, Metric, str]
"""Objective, metric, and the name of the weights."""
Wish = tuple[Choice, Eta]
"""What a run optimises, and its shares of the limits."""

HERE = Path(__file__).with_suffix("")
CASE = ("task", "share", "speed_m_min", "technique")
ASKED = ("objective", "metric", "weights", "eta_v", "eta_a")
SHARES = (0.95, 0.8)
CRITERIA = {
    "displacement": "displacement (7), s",
    "velocity": "largest increment (8), share of limit",
    "range": "range (9), s",
}
PAIRS = (("displacement", "velocity"), ("displacement", "range"))
MARGIN = 0.1
"""Margin of the reference box, as a share of the fronts' extent, so that their ends count."""
LESS = 0.9
"""A claim holds if its measure falls below this share of its earlier value."""
CLAIMS = {
    "simplifies: acceptable plans, under half before and over half after": ("acceptable", "d"),
    "smooth: unrest of the joints": ("unrest", ".2f"),
    "smooth: how often the head turns back": ("turns_back", ".3g"),
    "balanced joints: imbalance": ("imbalance", ".2f"),
    "balanced criteria: best compromise": ("compromise", ".2f"),
    "a better front: hypervolume": ("hypervolume", ".2f"),
}
LEFT, TOP, WIDE, HIGH, GAP = 62, 54, 300, 240, 32
"""px: margins left of and above the panels, pitches of columns and rows, and the gap between."""
SMALL = "font-size='11' fill='#5b6675'"
COLOURS = {"known": "#d95f02", "paper": "#1b6fb5", "exact": "#c02a9a", "ours": "#0a8a5f"}
TECHNIQUES = tuple(COLOURS)
RADII = {"known": 5.5, "paper": 4.4, "exact": 3.3, "ours": 2.2}
"""px: equal plans of several techniques are drawn on top of each other, and all remain visible."""


def of_job(file: Path, name: str) -> Made:
    """Return a contour of a job, shaped and sampled as in the job, without its cell."""
    job = read_job(file)
    part = job.read_part()
    task = next(task for task in job.tasks(part) if task.name == name)
    shaped = task.candidates(part)[0]
    nodes = task.sample(replace(shaped, speed_share=np.ones(len(shaped))))
    grid = {key: getattr(job.options, key) for key in ("gamma_step", "frames", "tilt", "postures")}
    return nodes, {"robot": job.robot, "tool": job.tool, "placement": job.placement, **grid}


TASKS: dict[str, Callable[[], Made]] = {
    "sheet": partial(setting, MAIN),
    "B-pillar trim": partial(of_job, Path(str(files("kerfpath.demo") / "b_pillar.toml")), "trim"),
    "bracket trim": partial(of_job, HERE.parent / "parts" / "bracket.toml", "trim"),
}


def runs_of(task: str, made: Made, factors: Mapping[str, Array]) -> Iterator[Row]:
    """Plan a task at every share of its fastest speed: as many runs with each technique."""
    contour, options = made
    graph = layered_graph(contour, **options)
    fastest = fastest_speed(contour, **options, graph=graph).speed
    choices = list(product(get_args(ObjectiveKind), get_args(Metric), factors))
    velocity = options["robot"].speed_limits()[0]

    def planned(method: Method, speed: float, wish: Wish) -> Plan | None:
        (objective, metric, name), (eta_v, eta_a) = wish
        ask = partial(plan, contour, **options, graph=graph, method=method, speed=speed)
        weights = factors[name] / (velocity * node_interval(contour, speed))
        ask = partial(ask, objective=objective, metric=metric, weights=weights)
        try:
            return ask(eta_v=eta_v, eta_a=eta_a)
        except NoFeasiblePath:
            return None

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        # The known technique sees no limits, so its paths are the same at any speed.
        plain: list[Wish] = [(choice, (1.0, 1.0)) for choice in choices]
        known = list(pool.map(partial(planned, "known", fastest), plain))
        for share in SHARES:
            speed = share * fastest
            least = relaxations(contour, options["robot"], graph, speed)
            v, a = ((1 + (eta or 1.0)) / 2 for eta in (least.eta_v, least.eta_a))
            grid = list(zip(choices, cycle([(1.0, 1.0), (1.0, a), (v, 1.0), (v, a)])))
            ours: list[Plan] = []
            pareto(
                contour,
                **options,
                speed=speed,
                graph=graph,
                method="exact",
                criteria=tuple(CRITERIA),
                runs=len(choices),
                audit=partial(_audited, ours),
            )
            settings = [p.settings for p in ours]
            took = [((s.objective, s.metric, ""), (s.eta_v, s.eta_a)) for s in settings]
            sides: dict[str, tuple[list[Wish], Iterable[Plan | None]]] = {
                "known": (plain, (p and replace(p, time=p.time / share) for p in known)),
                "paper": (grid, pool.map(partial(planned, "paper", speed), grid)),
                "exact": (grid, pool.map(partial(planned, "exact", speed), grid)),
                "ours": (took, ours),
            }
            for technique, (wishes, plans) in sides.items():
                told = zip(wishes, pool.map(measures, plans), strict=True)
                rows = [_asked(*wish) | row for wish, row in told]
                if technique == "ours":
                    rows.sort(key=lambda row: (*row.values(),))  # threads end in any order
                    rows += [measures(None)] * (len(choices) - len(rows))
                where = (task, f"{share:g}", f"{speed * 60:.3f}", technique)
                yield from (dict(zip(CASE, where, strict=True)) | row for row in rows)


def _asked(choice: Choice, eta: Eta) -> dict[str, str]:
    return dict(zip(ASKED, (*choice, f"{eta[0]:.4f}", f"{eta[1]:.4f}"), strict=True))


def _audited(found: list[Plan], made: Plan) -> Sequence[object]:
    """Keep every candidate plan of a Pareto set, and audit it."""
    found.append(made)
    return audit(made)


def measures(p: Plan | None) -> dict[str, str]:
    """Return the measures of a plan: numbers rounded once, here, for all outputs."""
    if p is None:
        return {"found": "no", "acceptable": "no"}
    c, limits = p.criteria, p.robot.speed_limits()[0]
    velocity, acceleration = float(c.peak_velocity.max()), float(c.peak_acceleration.max())
    within = max(velocity, acceleration) <= 1 + 1e-6 and not audit(p)
    turn = np.degrees(np.unwrap(p.gamma))
    numbers = {
        "displacement": (c.displacement / limits).sum(),
        "velocity": velocity,
        "range": (c.range / limits).sum(),
        "acceleration": acceleration,
        "imbalance": velocity / c.peak_velocity.mean(),
        "unrest": np.sqrt((p.acceleration_share**2).mean()),
    }
    row = {"found": "yes", "acceptable": "yes" if within else "no"}
    row |= {name: f"{value:.4f}" for name, value in numbers.items()}
    return row | {"turns_back": f"{reversals(turn)}"}


def cases_of(rows: Sequence[Row]) -> dict[Case, dict[str, list[Row]]]:
    """Return the rows of each technique, by task and share."""
    cases: dict[Case, dict[str, list[Row]]] = {}
    for row in rows:
        sides = cases.setdefault((row["task"], row["share"]), {name: [] for name in TECHNIQUES})
        sides[row["technique"]].append(row)
    return cases


def values(rows: Sequence[Row], *, acceptable: bool = True) -> Array:
    """Return the criteria (P, 3) of the plans that are acceptable, or of those that are not."""
    wanted = "yes" if acceptable else "no"
    some = [row for row in rows if row["found"] == "yes" and row["acceptable"] == wanted]
    return np.array([[float(row[name]) for name in CRITERIA] for row in some]).reshape(-1, 3)


def front(points: Array) -> Array:
    """Return the points (P, C) that no other dominates."""
    return points[moocore.is_nondominated(points)] if len(points) else points


def box(sides: Mapping[str, Sequence[Row]]) -> tuple[Array, Array]:
    """Return the ideal and the reference (3,) of a case: around the fronts of all techniques."""
    ends = np.vstack([front(values(rows)) for rows in sides.values()])
    low, high = ends.min(axis=0), ends.max(axis=0)
    return low, high + MARGIN * np.maximum(high - low, MARGIN * high)


def coverage(a: Array, b: Array) -> float:
    """Return the share of front b that plans of a weakly dominate: Zitzler and Thiele's C."""
    return float((a[:, None] <= b).all(axis=2).any(axis=0).mean()) if len(b) else np.nan


def judged(sides: Mapping[str, Sequence[Row]]) -> dict[str, dict[str, float]]:
    """Return the figures of each technique in one case; NaN where there is no plan."""
    low, high = box(sides)
    fronts = {name: front(values(rows)) for name, rows in sides.items()}
    told: dict[str, dict[str, float]] = {}
    for name, rows in sides.items():
        scaled = (fronts[name] - low) / (high - low)
        told[name] = {
            "runs": len(rows),
            "found": sum(row["found"] == "yes" for row in rows),
            "acceptable": sum(row["acceptable"] == "yes" for row in rows),
            "front": len(scaled),
            "hypervolume": hypervolume(scaled, np.ones(3)) if len(scaled) else 0.0,
            "compromise": scaled.max(axis=1).min() if len(scaled) else np.nan,
            **{f"covers {other}": coverage(fronts[name], fronts[other]) for other in TECHNIQUES},
            **{key: _median(rows, key) for key in ("imbalance", "unrest", "turns_back")},
        }
    return told


def _median(rows: Sequence[Row], key: str) -> float:
    some = [float(row[key]) for row in rows if row["found"] == "yes"]
    return median(some) if some else np.nan


def shows(key: str, before: Mapping[str, float], after: Mapping[str, float]) -> bool:
    """Return whether the claim on a figure holds between two techniques in one case."""
    if key == "acceptable":
        return before[key] < before["runs"] / 2 < after[key]
    if key == "hypervolume":
        return before[key] < LESS * after[key]
    none = np.isnan(before[key]) and not np.isnan(after[key])
    return bool(none or after[key] < LESS * before[key])


def picture(rows: Sequence[Row]) -> str:
    """Return the fronts as SVG: a row for each task, a column for each share and two criteria."""
    cases = cases_of(rows)
    tasks, shares = (list(dict.fromkeys(key[i] for key in cases)) for i in (0, 1))
    columns = [(share, pair) for share in shares for pair in PAIRS]
    width, height = LEFT + WIDE * len(columns), TOP + HIGH * len(tasks) + 30
    style = "font-family='sans-serif' font-size='13' fill='#1d2530'"
    out = [f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' {style}>"]
    out.append("<rect width='100%' height='100%' fill='white'/>")
    for j, (share, pair) in enumerate(columns):
        x = LEFT + j * WIDE
        if pair == PAIRS[0]:
            words = f"at {float(share) * 100:g} % of the fastest speed"
            out.append(f"<text x='{x}' y='22' font-size='16'>{words}</text>")
        out.append(f"<text x='{x}' y='44' fill='#5b6675'>up: {CRITERIA[pair[1]]}</text>")
        for i, task in enumerate(tasks):
            y = TOP + i * HIGH
            if j == 0:
                middle = y + (HIGH - GAP) / 2
                turned = f"transform='translate(16 {middle}) rotate(-90)' text-anchor='middle'"
                out.append(f"<text {turned} font-size='16'>{task}</text>")
            out.append(f"<g transform='translate({x} {y})'>")
            out += [*panel(cases[task, share], [list(CRITERIA).index(c) for c in pair]), "</g>"]
    out.append(f"<text x='{LEFT}' y='{height - 12}'>across: {CRITERIA['displacement']} ")
    out += [f"<tspan dx='16' fill='{c}'>● {name}</tspan>" for name, c in COLOURS.items()]
    words = "dot: acceptable, ring: not; line: front of the acceptable in these two criteria"
    out.append(f"<tspan dx='16'>{words}</tspan></text>")
    return "\n".join([*out, "</svg>\n"])


def panel(sides: Mapping[str, Sequence[Row]], axes: list[int]) -> Iterator[str]:
    """Yield one diagram of two criteria, framed around the fronts of all techniques."""
    size = np.array([WIDE - LEFT, HIGH - GAP])
    low, high = (end[axes] for end in box(sides))
    low = low - 0.06 * (high - low)

    def place(points: Array) -> Array:
        """Return the pixels of those points (P, 2) that are in the frame."""
        inside = points[((points >= low) & (points <= high)).all(axis=1)]
        return np.asarray((inside - low) / (high - low) * [1, -1] * size + [0, size[1]])

    yield f"<rect width='{size[0]}' height='{size[1]}' fill='none' stroke='#d5dae1'/>"
    for value, at in ticks(low[0], high[0]):
        yield f"<path d='M{at * size[0]:.1f} 0v{size[1]}' stroke='#eceff3'/>"
        yield f"<text x='{at * size[0]:.1f}' y='{size[1] + 15}' {SMALL} text-anchor='middle'>"
        yield f"{value}</text>"
    for value, at in ticks(low[1], high[1]):
        y = (1 - at) * size[1]
        yield f"<path d='M0 {y:.1f}h{size[0]}' stroke='#eceff3'/>"
        yield f"<text x='-5' y='{y + 4:.1f}' {SMALL} text-anchor='end'>{value}</text>"
    for name, colour in COLOURS.items():
        for x, y in place(values(sides[name], acceptable=False)[:, axes]):
            ring = f"fill='none' stroke='{colour}' stroke-opacity='0.45'"
            yield f"<circle cx='{x:.1f}' cy='{y:.1f}' r='3' {ring}/>"
    for name, colour in COLOURS.items():
        good = values(sides[name])[:, axes]
        best = front(good)
        steps = place(best[np.lexsort((-best[:, 1], best[:, 0]))])
        if len(steps):
            way = "".join(f"H{x:.1f}V{y:.1f}" for x, y in steps[1:])
            start = f"M{steps[0, 0]:.1f} 0V{steps[0, 1]:.1f}"
            yield f"<path d='{start}{way}H{size[0]}' fill='none' stroke='{colour}'/>"
        for x, y in place(good):
            yield f"<circle cx='{x:.1f}' cy='{y:.1f}' r='{RADII[name]}' fill='{colour}'/>"


def ticks(low: float, high: float) -> list[tuple[str, float]]:
    """Return about four round values between two ends, as text and as positions from 0 to 1."""
    raw = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= raw)
    digits = max(0, -int(np.floor(np.log10(step))))
    places = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    return [(f"{value:.{digits}f}", float((value - low) / (high - low))) for value in places]


def readme(rows: Sequence[Row]) -> str:
    """Return the account of the experiment; every number in it comes from the rows."""
    cases = {case: judged(sides) for case, sides in cases_of(rows).items()}
    speeds = {(row["task"], row["share"]): float(row["speed_m_min"]) for row in rows}
    names = {case: f"{case[0]} {float(case[1]) * 100:g} %" for case in cases}
    claims = [
        table_line("claim", "shows in", *names.values()),
        table_line(*["---"] * (2 + len(cases))),
    ]
    for claim, (key, form) in CLAIMS.items():
        cells, held = [], 0
        for told in cases.values():
            here = shows(key, told["known"], told["paper"])
            held += here
            numbers = " → ".join(_number(side[key], form) for side in told.values())
            cells.append(f"**{numbers}**" if here else numbers)
        claims.append(table_line(claim, f"{held} of {len(cases)}", *cells))
    fronts = []
    for case, told in cases.items():
        for name, side in told.items():
            cells = [f"{names[case]}, {speeds[case]:.2f} m/min", name]
            cells += [_number(side[key], "d") for key in ("found", "acceptable", "front")]
            cells += [_number(side[key], ".3f") for key in ("hypervolume", "compromise")]
            cells += [_number(side[f"covers {other}"], ".0%") for other in TECHNIQUES]
            fronts.append(table_line(*cells))
    text = (HERE / "template.md").read_text(encoding="utf-8")
    runs = max(side["runs"] for told in cases.values() for side in told.values())
    return text.format(claims="\n".join(claims), fronts="\n".join(fronts), runs=f"{runs:g}")


def _number(value: float, form: str) -> str:
    return "none" if np.isnan(value) else f"{value:{form}}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Plan everything and write table.csv, README.md and the figure."""
    options = options_of(arguments, str(__doc__), HERE)
    tasks, factors = TASKS, weight_factors()
    if options.quick:
        tasks = {"sheet": partial(setting, QUICK)}
        factors = {name: factors[name] for name in ("default", "arm x 100")}
    rows = [row for name, make in tasks.items() for row in runs_of(name, make(), factors)]
    options.out.mkdir(parents=True, exist_ok=True)
    write_table(options.out / "table.csv", rows)
    (options.out / "figure.svg").write_text(picture(rows), encoding="utf-8")
    (options.out / "README.md").write_text(readme(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
