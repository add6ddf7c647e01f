"""The paper's comparison (its figures 1 and 2): the known technique against the proposed one.

Section 4 of the paper plans a planar cutting task twice: with the known technique of 2004 (one
posture, no test of velocity or acceleration) and with the proposed one, over many weights w_i and
shares eta_v and eta_a. It claims that tuning the weights of the known technique "can barely
produce acceptable results", that most of its solutions tend to "undesirable oscillations in the
orientation axis", and that the proposed one gives "smooth solutions with the balanced values of
the partial criteria". The papers that we have do not contain the task of 2004, so the task is ours:
a flat sheet whose outline has round corners and a notch, cut at constant speed by an IRB 4600 with
a head at 45 degrees to the flange. The accelerations are assumed (ABB publishes none).

Every weight vector is planned by both techniques on the same layered graph. A plan is acceptable
when the peak velocity and acceleration shares are at most 1 and the audit finds nothing. The head's
heading is its direction in the plane of the sheet, free of the task frames; it oscillates when it
turns back by `TURN_BACK` or more, and its shake is the sum of all changes of its node-to-node step.

With full shares every choice is planned a third time, over continuous gamma, with a proved bound:
it shows what both techniques leave to gain, and how near to the best motion that plan is.

Run: python examples/known_against_proposed.py [--out DIR] [--html] [--quick]
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath import Certify, Contour, NoFeasiblePath, Plan, audit, plan, robot
from kerfpath.contour import FrameKind
from kerfpath.options import PlanMethod
from kerfpath.planner import layered_graph, node_interval
from kerfpath.robots import postures_named
from kerfpath.search import ObjectiveKind

Array = NDArray[np.float64]
Eta = tuple[float, float]
Panel = tuple[str, float, list[list[tuple[Array, Array, str]]]]
"""Title, limit (0: none), and for each plan its curves: time, value, colour."""

HERE = Path(__file__).with_suffix("")
ASSUMED_ACCELERATION_DEG_S2 = (320, 270, 420, 1300, 1400, 2000)
CORNER_RADIUS = 0.025
TURN_BACK = 2.0
"""deg: the heading turns back if it returns by this much; more than one or two grid steps."""
TECHNIQUES = ("known", "proposed")
CONTINUOUS = "continuous"
METHODS: dict[str, PlanMethod] = {"known": "known", "proposed": "paper", CONTINUOUS: "continuous"}
CERTIFY = Certify(gap=0.01, seconds=10.0)
"""How closely plans over continuous gamma are certified."""
OBJECTIVES: tuple[ObjectiveKind, ...] = ("sum", "max")
ETAS: tuple[Eta, ...] = tuple((v, a) for v in (1.0, 0.3) for a in (1.0, 0.9, 0.8, 0.7))
COLOURS = ("#0061cc", "#f4a918", "#0ea069", "#df5ac2", "#f05d16", "#55bdff", "#1d2530")
SHAKE = "heading_shake_deg"
KEYS = ("task", "technique", "objective", "weights", "eta_v", "eta_a")
PER_JOINT = ["displacement_{}_deg", "largest_increment_{}_deg", "range_{}_deg"]
PER_JOINT += ["velocity_share_{}", "acceleration_share_{}"]
PAIR = """## {why}

![{titles}]({file}.svg)

| technique | joint | total displacement (7), deg | largest increment (8), deg | range (9), deg | \
velocity share | acceleration share |
| --- | --- | --- | --- | --- | --- | --- |
{lines}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One variant of the cutting task: speed m/s, spacing m, angles deg, height of the sheet m."""

    name: str = "main"
    speed: float = 0.3
    spacing: float = 0.008
    gamma_step_deg: float = 1.0
    frames: FrameKind = "rotation-minimising"
    tilt_deg: float = 0.0
    height: float = 0.5

    def __str__(self) -> str:
        return (
            f"{self.speed:g} m/s, nodes every {self.spacing * 1e3:g} mm, gamma by "
            f"{self.gamma_step_deg:g}°, {self.frames}, sheet at {self.tilt_deg:g}°"
        )


MAIN = Task()
TANGENT = replace(MAIN, name="tangent", frames="tangent")
TASKS: tuple[Task, ...] = (
    MAIN,
    replace(MAIN, name="slow", speed=0.1),
    replace(MAIN, name="fast", speed=0.33),
    replace(MAIN, name="fine nodes", spacing=0.004),
    replace(MAIN, name="tilted", tilt_deg=45, height=0.9),
    TANGENT,
    replace(TANGENT, name="coarse", speed=0.2, gamma_step_deg=5),
    replace(TANGENT, name="coarse fast", gamma_step_deg=5),
)
QUICK = replace(MAIN, spacing=0.02, gamma_step_deg=4)


Row = Mapping[str, str]


class Pair(NamedTuple):
    """Two runs (places in the table) with the same task, objective and weights, and why these."""

    file: str
    why: str
    runs: tuple[int, int]


def weight_factors() -> dict[str, Array]:
    """Return the factors on the default weights 1 / (q'max dt): arm, and each joint in turn."""
    factors = {"default": np.ones(6)}
    groups = [("arm", [0, 1, 2], [0.01, 0.1, 10, 100])]
    groups += [(f"joint {i + 1}", [i], [0.1, 10]) for i in range(6)]
    for name, group, values in groups:
        factors |= {f"{name} x {v:g}": np.where(np.isin(range(6), group), v, 1) for v in values}
    return factors


def sheet(spacing: float) -> Contour:
    """Return the outline of the sheet: 0.5 x 0.3 m with a notch, all corners rounded."""
    x = 0.25, 0.25, 0.08, 0.05, -0.05, -0.08, -0.25, -0.25
    p = np.array([x, (-0.15, 0.15, 0.15, 0.03, 0.03, 0.15, 0.15, -0.15)]).T
    pieces = [np.array([[0.0, -0.15]])]
    for before, corner, after in zip(np.roll(p, 1, 0), p, np.roll(p, -1, 0), strict=True):
        u, v = (side / np.linalg.norm(side) for side in (before - corner, after - corner))
        half = np.arccos(u @ v) / 2
        centre = corner + (u + v) / np.linalg.norm(u + v) * CORNER_RADIUS / np.sin(half)
        ends = [corner + side * CORNER_RADIUS / np.tan(half) - centre for side in (u, v)]
        first, last = (np.arctan2(y, x) for x, y in ends)
        angle = first + ((last - first + np.pi) % (2 * np.pi) - np.pi) * np.linspace(0, 1, 61)
        pieces.append(centre + CORNER_RADIUS * np.c_[np.cos(angle), np.sin(angle)])
    flat = np.pad(np.vstack([*pieces, pieces[0]]), ((0, 0), (0, 1)))
    down = np.tile([0.0, 0, -1], (len(flat), 1))
    return Contour(flat, down, closed=True, name="sheet").resample(spacing=spacing)


def pose(x: float, z: float, about_y_deg: float) -> Array:
    """Return the pose at (x, 0, z) m, turned about y."""
    c, s = np.cos(np.radians(about_y_deg)), np.sin(np.radians(about_y_deg))
    return np.array([[c, 0, s, x], [0, 1, 0, 0], [-s, 0, c, z], [0, 0, 0, 1]])


def setting(task: Task) -> tuple[Contour, dict[str, Any]]:
    """Return the nodes of a task, and the arguments of their layered graph."""
    arm = robot("abb_irb4600_60_205").with_limits(
        acceleration=np.radians(ASSUMED_ACCELERATION_DEG_S2), endless=[0, 0, 0, 1, 0, 1]
    )
    return sheet(task.spacing), {
        "robot": arm,
        "tool": pose(0.15, 0.30, 45),
        "placement": pose(1.2, task.height, -task.tilt_deg),
        "frames": task.frames,
        "gamma_step": np.radians(task.gamma_step_deg),
        "postures": postures_named("front/up", arm.kinematics),
    }


def runs_of(
    task: Task, factors: Mapping[str, Array], etas: Sequence[Eta]
) -> Iterator[tuple[Row, Plan | None]]:
    """Plan a task with every weight vector: known and continuous once, proposed with every eta."""
    contour, options = setting(task)
    graph = layered_graph(contour, **options)
    velocity, dt = options["robot"].speed_limits()[0], node_interval(contour, task.speed)
    ask = partial(plan, contour, **options, speed=task.speed, graph=graph)
    runs = [("known", (1.0, 1.0)), *(("proposed", eta) for eta in etas), (CONTINUOUS, (1.0, 1.0))]
    for objective, (name, factor), (technique, eta) in product(OBJECTIVES, factors.items(), runs):
        weights, (eta_v, eta_a) = factor / (velocity * dt), eta
        choice = partial(ask, method=METHODS[technique], objective=objective, weights=weights)
        certify = CERTIFY if technique == CONTINUOUS else None
        try:
            found = choice(eta_v=eta_v, eta_a=eta_a, certify=certify)
        except NoFeasiblePath:
            found = None
        words = task.name, technique, objective, name, f"{eta_v:g}", f"{eta_a:g}"
        yield dict(zip(KEYS, words, strict=True)) | measures(found), found


def heading(p: Plan) -> Array:
    """Return the direction (K,) deg of the head in the plane of the sheet, without wraps."""
    x = (p.robot.forward(p.q) @ p.T_flange_tip)[:, :3, 0] @ p.T_base_part[:3, :3]
    return np.asarray(np.degrees(np.unwrap(np.arctan2(x[:, 1], x[:, 0]))))


def joints(p: Plan) -> Array:
    """Return the joints (K, 6) deg, endless ones without wraps."""
    return np.asarray(np.degrees(p.q[0] + np.cumsum(np.pad(p.increments, ((1, 0), (0, 0))), 0)))


def reversals(x: Array, least: float = TURN_BACK) -> int:
    """Count how often x turns back by `least` or more."""
    count, direction, low, high = 0, 0, x[0], x[0]
    for value in x:
        low, high = min(low, value), max(high, value)
        if direction <= 0 and value >= low + least:
            count, direction, high = count + (direction < 0), 1, value
        elif direction >= 0 and value <= high - least:
            count, direction, low = count + (direction > 0), -1, value
    return count


def measures(p: Plan | None) -> dict[str, str]:
    """Return the measures of a plan: numbers rounded once, here, for all outputs."""
    if p is None:
        return {"found": "no", "acceptable": "no"}
    c, turn = p.criteria, heading(p)
    velocity, acceleration = float(c.peak_velocity.max()), float(c.peak_acceleration.max())
    within = max(velocity, acceleration) <= 1 + 1e-6 and not audit(p)
    row = {
        "found": "yes",
        "acceptable": "yes" if within else "no",
        "peak_velocity": f"{velocity:.3f}",
        "peak_acceleration": f"{acceleration:.3f}",
        "acceleration_joint": f"{int(c.peak_acceleration.argmax()) + 1}",
        "heading_reversals": f"{reversals(turn)}",
        "joint_6_reversals": f"{reversals(joints(p)[:, 5])}",
        "heading_travel_deg": f"{np.abs(np.diff(turn)).sum():.1f}",
        "heading_shake_deg": f"{np.abs(np.diff(turn, 2)).sum():.1f}",
        "imbalance": f"{c.peak_velocity.max() / c.peak_velocity.mean():.2f}",
        "cost": f"{p.cost:.4f}",
    }
    angles = np.degrees([c.displacement, c.largest_increment, c.range])
    table = [*angles, c.peak_velocity, c.peak_acceleration]
    for name, values in zip(PER_JOINT, table, strict=True):
        row |= {name.format(i): f"{value:.3f}" for i, value in enumerate(values, 1)}
    if p.proof.bound is not None:
        row |= {"bound": f"{p.proof.bound:.4f}", "gap_percent": p.proof.gap_shown}
    return row


def pairs_of(rows: Sequence[Row]) -> list[Pair]:
    """Choose the runs to show, by rule: typical and worst of the main task, and the coarse task."""
    place = {
        tuple(row[key] for key in KEYS): i for i, row in enumerate(rows) if row["found"] == "yes"
    }
    both = []
    for (task, technique, *choice, _, _), i in place.items():
        if technique == "known" and (other := (task, "proposed", *choice, "1", "1")) in place:
            both.append((i, place[other]))
    pairs = []
    for file, task, column, middle, why in (
        ("figure", "main", "peak_acceleration", True, "the median peak acceleration share"),
        ("figure-worst", "main", "peak_acceleration", False, "the largest peak acceleration share"),
        ("figure-coarse", "coarse", SHAKE, True, "the median shake of the heading"),
    ):
        here = [pair for pair in both if rows[pair[0]]["task"] == task]
        if here:
            here.sort(key=lambda pair: float(rows[pair[0]][column]))
            why = f"Task {task}, the weights whose known plan has {why}"
            pairs.append(Pair(file, why, here[(len(here) - 1) // 2 if middle else -1]))
    return pairs


def panels(plans: Sequence[Plan]) -> list[Panel]:
    """Return the rows of a figure: six joints, the heading, and the shares of the limits."""
    angles = [np.c_[joints(p), heading(p)] for p in plans]
    rows: list[Panel] = []
    for i, title in enumerate([*(f"joint {i}, deg" for i in range(1, 7)), "heading, deg"]):
        sides = [[(p.time, a[:, i], COLOURS[i])] for p, a in zip(plans, angles, strict=True)]
        rows.append((title, 0.0, sides))
    for title in ("velocity, share of limit", "acceleration, share of limit"):
        shares = [p.velocity_share if title[0] == "v" else p.acceleration_share for p in plans]
        sides = [
            [(p.time[1 : 1 + len(share)], share[:, i], COLOURS[i]) for i in range(6)]
            for p, share in zip(plans, shares, strict=True)
        ]
        rows.append((title, 1.0, sides))
    return rows


def svg(heads: Sequence[str], plans: Sequence[Plan]) -> str:
    """Return a static picture: the plans side by side, on the same scales (angles may shift)."""
    width, height, left, gap, top = 470, 84, 46, 22, 44
    rows = panels(plans)
    total = top + len(rows) * (height + gap) + 14
    style = "font-family='sans-serif' font-size='11' fill='#1d2530'"
    out = [f"<svg xmlns='http://www.w3.org/2000/svg' width='1060' height='{total}' {style}>"]
    out.append("<rect width='100%' height='100%' fill='white'/>")
    for row, (name, limit, sides) in enumerate(rows):
        ends = [(min(v.min() for _, v, _ in c), max(v.max() for _, v, _ in c)) for c in sides]
        if limit:
            far = max(limit, *np.abs(ends).ravel())
            ends = [(-far, far)] * len(ends)
        # Angles have one scale on both sides, but each its own middle; never less than 10 deg.
        half = max(max(b - a for a, b in ends) * 0.53, 0 if limit else 5)
        for column, side in enumerate(sides):
            low, high = (sum(ends[column]) / 2 + sign * half for sign in (-1, 1))
            x0, y0 = left + column * (width + left + 8), top + row * (height + gap)
            t1 = float(side[0][0][-1])
            if row == 0:
                out.append(f"<text x='{x0}' y='16' font-size='14'>{heads[column]}</text>")
            out.append(f"<text x='{x0}' y='{y0 - 5}' fill='#5b6675'>{name}</text>")
            frame = f"<rect x='{x0}' y='{y0}' width='{width}' height='{height}'"
            out.append(f"{frame} fill='none' stroke='#d5dae1'/>")
            for value in (-limit, limit) if limit else ():
                y = y0 + height * (high - value) / (high - low)
                out.append(f"<path d='M{x0} {y:.1f}h{width}' stroke='#b3261e'/>")
            for value, y in ((low, y0 + height), (high, y0 + 9)):
                tick = f"{value:.1f}" if limit else f"{round(value)}"
                out.append(f"<text x='{x0 - 4}' y='{y}' text-anchor='end'>{tick}</text>")
            for t, v, colour in side:
                x, y = x0 + width * t / t1, y0 + height * (high - v) / (high - low)
                line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
                out.append(f"<polyline points='{line}' fill='none' stroke='{colour}'/>")
            if row == len(rows) - 1:
                out.append(f"<text x='{x0}' y='{total - 8}'>0 to {t1:.2f} s; joints 1 to 6:")
                out += [f"<tspan fill='{c}'> ■ {i}</tspan>" for i, c in enumerate(COLOURS[:6], 1)]
                out.append("; red: the limits, share 1</text>")
    return "\n".join([*out, "</svg>\n"])


def verdict(rows: Sequence[Row], task: Task) -> Iterator[str]:
    """Yield, for each of the paper's claims, whether the medians show it by more than a tenth."""
    known, new = (_some(rows, task.name, technique) for technique in TECHNIQUES)
    counts = [_count(side, "acceptable") for side in (known, new)]
    yield f"\n**Task {task.name} ({task}), {len(known)} choices of weights and objective:**\n"
    shows = "shows" if counts[0] < len(known) / 2 < counts[1] else "does not show"
    plain = [
        f"{r['peak_acceleration']} ({r['objective']})" for r in known if r["weights"] == "default"
    ]
    yield (
        f"- Few acceptable plans before, most after: **{shows}**. Known {counts[0]} of "
        f"{len(known)}, proposed {counts[1]}. What is wrong with the known plans: the velocity "
        f"share reaches {_spread(known, 'peak_velocity')}, the acceleration share "
        f"{_spread(known, 'peak_acceleration')} (median to largest); with the default weights the "
        f"acceleration share is {', '.join(plain)}."
    )
    for claim, column in (
        ("Heading turns back less often", "heading_reversals"),
        ("Joint 6 turns back less often", "joint_6_reversals"),
        ("Heading shakes less, deg", SHAKE),
        ("Joints are better balanced (largest over mean velocity share)", "imbalance"),
    ):
        middle = [float(_spread(side, column).split()[0]) for side in (known, new)]
        shows = "shows" if middle[1] < 0.9 * middle[0] else "does not show"
        spread = [_spread(side, column) for side in (known, new)]
        yield f"- {claim}: **{shows}**. Known {spread[0]}, proposed {spread[1]}."


def readme(tasks: Sequence[Task], rows: Sequence[Row]) -> str:
    """Return the account of the experiment; every number in it comes from the rows."""
    verdicts = [line for t in tasks if t.name in ("main", "coarse") for line in verdict(rows, t)]
    compared, best, etas, pairs = [], [], [], []
    for task in tasks:
        sides = [_some(rows, task.name, technique) for technique in TECHNIQUES]
        cells = [f"{_count(side, 'acceptable')} of {len(side)}" for side in sides]
        for column in ("peak_acceleration", "heading_reversals", SHAKE, "imbalance"):
            cells.append(" / ".join(_spread(side, column) for side in sides))
        both = [(k, n) for k, n in zip(*sides, strict=True) if n["found"] == "yes"]
        shake = [np.sign(float(n[SHAKE]) - float(k[SHAKE])) for k, n in both]
        cells.append(" / ".join(str(shake.count(sign)) for sign in (-1, 0, 1)))
        compared.append(table_line(f"{task.name} ({task})", *cells))
        best.append(beyond_the_grid(task, sides[1], _some(rows, task.name, CONTINUOUS)))
    for eta in dict.fromkeys((r["eta_v"], r["eta_a"]) for r in rows):
        new = _some(rows, "main", "proposed", *eta)
        counts = (f"{_count(new, column)} of {len(new)}" for column in ("found", "acceptable"))
        spreads = (_spread(new, c) for c in ("peak_velocity", "peak_acceleration", SHAKE))
        etas.append(table_line(*eta, *counts, *spreads))
    for file, why, places in pairs_of(rows):
        lines = [
            table_line(
                rows[k]["technique"], str(i), *(rows[k][column.format(i)] for column in PER_JOINT)
            )
            for k, i in product(places, range(1, 7))
        ]
        titles = "; ".join(title(rows[k]) for k in places)
        pairs.append(PAIR.format(why=why, titles=titles, file=file, lines="\n".join(lines)))
    parts = {"verdicts": verdicts, "tasks": compared, "best": best, "etas": etas}
    parts["pairs"] = pairs
    text = (HERE / "template.md").read_text(encoding="utf-8")
    return text.format(**{name: "\n".join(lines).strip() for name, lines in parts.items()})


def beyond_the_grid(task: Task, proposed: Sequence[Row], best: Sequence[Row]) -> str:
    """Return the line of a task on the savings of continuous gamma, and its gap to the bound."""
    cells = [task.name, f"{_count(best, 'acceptable')} of {len(best)}"]
    for objective in OBJECTIVES:
        more = [
            100 * (float(p["cost"]) / float(c["cost"]) - 1)
            for p, c in zip(proposed, best, strict=True)
            if p["objective"] == objective and p["found"] == c["found"] == "yes"
        ]
        spread = (min(more), median(more), max(more)) if more else ()
        cells.append(" / ".join(f"{value:.1f}" for value in spread) or "no path")
    gaps = [float(row["gap_percent"]) for row in best if row.get("gap_percent")]
    cells.append(f"{median(gaps):.2f} to {max(gaps):.2f}" if gaps else "none")
    return table_line(*cells, _spread(best, SHAKE), _spread(best, "imbalance"))


def title(row: Row) -> str:
    """Return what was planned, as a title."""
    return "{technique} technique: {objective}, weights {weights}".format(**row)


def _some(rows: Sequence[Row], task: str, technique: str, *eta: str) -> list[Row]:
    wanted = (task, technique, *(eta or ("1", "1")))
    keys = ("task", "technique", "eta_v", "eta_a")
    return [row for row in rows if tuple(row[key] for key in keys) == wanted]


def _count(rows: Sequence[Row], column: str) -> int:
    return sum(row[column] == "yes" for row in rows)


def _spread(rows: Sequence[Row], column: str) -> str:
    values = [float(row[column]) for row in rows if row["found"] == "yes"]
    return f"{median(values):.3g} to {max(values):.3g}" if values else "no path"


def table_line(*cells: str) -> str:
    """Return a line of a table in Markdown."""
    return "| " + " | ".join(cells) + " |"


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write every row, those of runs without a plan with empty cells."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, max(rows, key=len), restval="", lineterminator="\n")
        table.writeheader()
        table.writerows(rows)


def options_of(arguments: Sequence[str] | None, doc: str, here: Path) -> argparse.Namespace:
    """Return the options of an example: the folder to write to, and whether the run is quick."""
    parser = argparse.ArgumentParser(description=doc.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=here, help="folder to write to")
    parser.add_argument("--quick", action="store_true", help="one coarse task, few weights")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> None:
    """Plan everything and write table.csv, README.md and the figures."""
    options = options_of(arguments, str(__doc__), HERE)
    tasks, factors = TASKS, weight_factors()
    if options.quick:
        tasks, factors = (QUICK,), {name: factors[name] for name in ("default", "arm x 100")}
    rows, plans = [], []
    for task in tasks:
        for row, found in runs_of(task, factors, ETAS if task.name == MAIN.name else ETAS[:1]):
            rows.append(row)
            plans.append(found)
    options.out.mkdir(parents=True, exist_ok=True)
    write_table(options.out / "table.csv", rows)
    for pair in pairs_of(rows):
        picture = svg(
            [title(rows[i]) for i in pair.runs], [p for i in pair.runs if (p := plans[i])]
        )
        (options.out / f"{pair.file}.svg").write_text(picture, encoding="utf-8")
    (options.out / "README.md").write_text(readme(tasks, rows), encoding="utf-8")


if __name__ == "__main__":
    main()
