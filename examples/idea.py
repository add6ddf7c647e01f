"""The idea in five pictures: one cut, every pose, the limits, the best motion, and the proof.

Run it with `python examples/idea.py`; it plans one cut and writes docs/idea/1.svg to 5.svg. Every
line of every picture is computed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kerfpath
from kerfpath import Certify, PlanOptions
from kerfpath.planner import layered_graph, node_interval
from kerfpath.robots import chain_of, postures_named

PICTURES = Path(__file__).parent.parent / "docs" / "idea"
INK, QUIET, FAINT, GOOD, BAD, WARM = "#222", "#777", "#ddd", "#0b6b66", "#b03060", "#d08000"
SPEED, STEP = 0.25, np.radians(2.0)

LEGEND = "text-anchor='middle' stroke='white' stroke-width='5' paint-order='stroke'"

Array = NDArray[np.float64]


@dataclass
class Drawing:
    """An SVG picture: a box of data coordinates inside a frame of pixels, y upwards."""

    x: tuple[float, float]
    y: tuple[float, float]
    width: int = 720
    height: int = 360
    margins: tuple[int, int, int, int] = (64, 20, 20, 44)  # left, right, top, bottom
    body: list[str] = field(default_factory=list)

    def at(self, points: Array) -> Array:
        """Return pixels (n, 2) of data points (n, 2)."""
        left, right, top, bottom = self.margins
        share = (points - [self.x[0], self.y[0]]) / [np.ptp(self.x), np.ptp(self.y)]
        size = np.array([self.width - left - right, self.height - top - bottom])
        return np.asarray([left, self.height - bottom] + share * size * [1, -1])

    def line(self, points: Array, colour: str, width: float = 2, more: str = "") -> None:
        """Draw a line through points (n, 2), if there are any."""
        if len(points) < 2:
            return
        pixels = " ".join(f"{a:.1f},{b:.1f}" for a, b in self.at(np.asarray(points, dtype=float)))
        self.body.append(
            f"<polyline points='{pixels}' fill='none' stroke='{colour}' stroke-width='{width}' "
            f"stroke-linejoin='round' {more}/>"
        )

    def dots(self, points: Array, colour: str, radius: float = 2.5) -> None:
        """Draw dots at points (n, 2)."""
        marks = "".join(
            f"<circle cx='{a:.1f}' cy='{b:.1f}' r='{radius}'/>"
            for a, b in self.at(np.asarray(points, dtype=float))
        )
        self.body.append(f"<g fill='{colour}'>{marks}</g>")

    def columns(self, y: Array, where: NDArray[np.bool_], colour: str) -> None:
        """Draw a bar of each run of samples y (m,) in the column of each node, where (K, m)."""
        half, bars = float(y[1] - y[0]) / 2, ""
        for k, column in enumerate(where):
            ends = np.flatnonzero(np.diff(np.r_[0, column.astype(int), 0]))
            for begin, end in ends.reshape(-1, 2):
                run = np.array([[k, y[begin] - half], [k, y[end - 1] + half]])
                (a, low), (_, high) = self.at(run)
                bars += f"M{a:.1f} {low:.1f}V{high:.1f}"
        self.body.append(f"<path d='{bars}' stroke='{colour}' stroke-width='6.5'/>")

    def text(self, x: float, y: float, words: str, colour: str = INK, more: str = "") -> None:
        """Write at a data point."""
        a, b = self.at(np.array([[x, y]]))[0]
        self.body.append(
            f"<text x='{a:.1f}' y='{b:.1f}' fill='{colour}' {more}>{escape(words)}</text>"
        )

    def axes(self, across: str, up: str, ticks: dict[float, str], nodes: dict[float, str]) -> None:
        """Draw names and ticks of both axes."""
        left, right, top, bottom = self.margins
        for value, words in ticks.items():
            _, level = self.at(np.array([[self.x[0], value]]))[0]
            self.body.append(
                f"<path d='M{left} {level:.1f}H{self.width - right}' stroke='{FAINT}'/>"
            )
            self.body.append(
                f"<text x='{left - 8}' y='{level + 4:.1f}' text-anchor='end'>{words}</text>"
            )
        for value, words in nodes.items():
            place, low = self.at(np.array([[value, self.y[0]]]))[0]
            self.body.append(
                f"<text x='{place:.1f}' y='{low + 18:.1f}' text-anchor='middle'>{words}</text>"
            )
        middle = (left + self.width - right) / 2
        self.body.append(
            f"<text x='{middle:.0f}' y='{self.height - 8}' text-anchor='middle'>{across}</text>"
        )
        high = (top + self.height - bottom) / 2
        self.body.append(
            f"<text x='16' y='{high:.0f}' text-anchor='middle' "
            f"transform='rotate(-90 16 {high:.0f})'>{up}</text>"
        )

    def write(self, name: str, title: str) -> None:
        """Write the file."""
        head = (
            f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {self.width} {self.height}' "
            f"width='{self.width}' height='{self.height}' role='img' font-family='sans-serif' "
            f"font-size='13' fill='{INK}'><title>{escape(title)}</title>"
            "<rect width='100%' height='100%' fill='white'/>"
        )
        PICTURES.mkdir(exist_ok=True)
        text = "\n".join([head, *self.body, "</svg>\n"])
        (PICTURES / name).write_text(text, encoding="utf-8")


def cut() -> dict[str, Any]:
    """Return the cut of all pictures: a wavy circle of 280 mm in front of an IRB 4600."""
    t = np.linspace(0, 2 * np.pi, 801)
    r = 0.14 * (1 + 0.12 * np.cos(3 * t))
    points = np.c_[r * np.cos(t), r * np.sin(t), 0.03 * np.sin(2 * t)]
    axes = np.c_[0.5 * np.cos(t), 0.5 * np.sin(t), -np.ones_like(t)]
    contour = kerfpath.Contour(points, axes, closed=True, name="circle").resample(count=73)
    robot = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    tool, placement = np.eye(4), np.eye(4)
    tool[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    tool[:3, 3] = 0.15, 0.0, 0.30
    placement[:3, 3] = 1.75, 0.6, 0.3
    return {"contour": contour, "robot": robot, "tool": tool, "placement": placement}


def poses(task: dict[str, Any], posture: int) -> None:
    """Picture 1: at one node the arm can be in a circle of poses."""
    graph = layered_graph(**task, gamma_step=np.radians(15))
    k = 20
    here = slice(graph.start[k], graph.start[k + 1])
    front = graph.posture[here] == posture
    _, first = np.unique(graph.sample[here][front], return_index=True)  # one turn of each
    q = graph.q[here][front][first]
    chain = chain_of(task["robot"])
    frames = chain.frames(q)
    flange = frames[:, -1] @ chain.end
    tip = flange @ task["tool"]
    elbow = frames[:, :, :3, 3]
    part = task["contour"].points @ task["placement"][:3, :3].T + task["placement"][:3, 3]
    picture = Drawing(x=(-0.6, 2.2), y=(-0.3, 1.3), height=420, margins=(20, 20, 20, 20))
    picture.line(_seen(np.array([[-0.3, -0.5, 0], [-0.3, 0.5, 0], [0.3, 0.5, 0], [0.3, -0.5, 0],
                                 [-0.3, -0.5, 0]])), QUIET, 1)  # fmt: skip
    for i in range(len(q)):
        arm = np.vstack([[[0, 0, 0]], elbow[i], flange[i : i + 1, :3, 3], tip[i : i + 1, :3, 3]])
        chosen = i == len(q) // 2
        picture.line(_seen(arm), GOOD if chosen else QUIET, 5 if chosen else 1.5,
                     "" if chosen else "opacity='.55'")  # fmt: skip
    picture.line(_seen(part), BAD, 2.5)
    picture.dots(_seen(tip[:1, :3, 3]), BAD, 5)
    picture.write("1.svg", "An arm in many poses that hold the beam on the same point")


def graph_of_all(task: dict[str, Any], posture: int) -> None:
    """Picture 2: all poses of all nodes."""
    graph = layered_graph(**task, gamma_step=STEP)
    K = len(graph.start) - 1
    admitted = graph.reason_by_gamma[:, :, posture] == 0
    picture = _map(K)
    picture.columns(np.degrees(graph.gamma), ~admitted, "#eee")
    picture.columns(np.degrees(graph.gamma), admitted, GOOD)
    picture.write(
        "2.svg",
        "Samples of the rotation about the beam at every node, by whether they can be reached",
    )


def windows(task: dict[str, Any], plan: kerfpath.Plan) -> None:
    """Picture 3: the part of the next node that velocity and acceleration limits allow."""
    graph = layered_graph(**task, gamma_step=np.radians(1))
    dt = node_interval(task["contour"], SPEED)
    velocity, acceleration = task["robot"].speed_limits()

    def left(k: int) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        here = slice(graph.start[k + 1], graph.start[k + 2])
        same = graph.posture[here] == plan.posture[k]
        q, gamma = graph.q[here][same], graph.gamma[graph.sample[here][same]]
        step, before = q - plan.q[k], plan.q[k] - plan.q[k - 1]
        near = (np.abs(step) <= velocity * dt).all(axis=1)
        return gamma, near, near & (np.abs(step - before) <= acceleration * dt**2).all(axis=1)

    # The node where the limits leave least, but more than the plan's own step.
    counts = [(int(left(k)[2].sum()), k) for k in range(1, len(plan.q) - 1)]
    k = min((count, k) for count, k in counts if count >= 3)[1]
    gamma, fast, kept = left(k)
    g0, g1 = (float(np.degrees(g)) for g in plan.gamma[k - 1 : k + 1])
    g = g1 + (np.degrees(gamma) - g1 + 180) % 360 - 180
    reach = max(40.0, 1.3 * float(np.abs(g[fast] - g1).max()))
    picture = Drawing(x=(-0.2, 3.0), y=(g1 - reach, g1 + reach))
    first = float(np.ceil((g1 - reach) / 20) * 20)
    ticks = {float(v): f"{v:.0f}" for v in np.arange(first, g1 + reach, 20)}
    names = {0.0: f"node {k - 1}", 1.0: f"node {k}", 2.0: f"node {k + 1}"}
    picture.axes("", "rotation about the beam, deg", ticks, names)
    shown = np.abs(g - g1) < reach
    for to in g[fast]:
        picture.line(np.array([[1, g1], [2, to]]), WARM, 0.8, "opacity='.5'")
    for to in g[kept]:
        picture.line(np.array([[1, g1], [2, to]]), GOOD, 1.5)
    picture.line(np.array([[0, g0], [1, g1]]), GOOD, 3)
    for chosen, colour in ((shown & ~fast, FAINT), (shown & fast & ~kept, WARM), (kept, GOOD)):
        picture.dots(np.c_[np.full(chosen.sum(), 2.0), g[chosen]], colour, 3.5)
    picture.dots(np.array([[0, g0], [1, g1]]), GOOD, 5)
    legend = (
        (f"within both limits: {kept.sum()}", GOOD),
        (f"within the velocity alone: {(fast & ~kept).sum()}", WARM),
        ("too far for the velocity", QUIET),
    )
    for i, (words, colour) in enumerate(legend):
        picture.text(2.1, g1 + reach * (0.85 - 0.13 * i), words, colour)
    picture.write("3.svg", "Poses of the next node that the velocity and the acceleration allow")


def courses(task: dict[str, Any], posture: int, made: dict[str, kerfpath.Plan]) -> None:
    """Picture 4: the best path on the grid, and the best motion off it."""
    graph = layered_graph(**task, gamma_step=STEP)
    K = len(graph.start) - 1
    admitted = graph.reason_by_gamma[:, :, posture] == 0
    picture = _map(K)
    picture.columns(np.degrees(graph.gamma), admitted, FAINT)
    for i, (words, plan) in enumerate(made.items()):
        colour = (WARM, GOOD)[i]
        gamma = np.degrees(np.unwrap(plan.gamma))
        for turn in (-360, 0, 360):
            shown = np.where(np.abs(gamma + turn) <= 181, gamma + turn, np.nan)
            for run in np.split(np.arange(K), np.flatnonzero(np.isnan(shown))):
                inside = run[~np.isnan(shown[run])]
                picture.line(np.c_[inside, shown[inside]], colour, 2.5)
        place = K * 0.5, -100 - 30 * i
        picture.text(*place, f"{words}: cost {plan.cost:.2f}", colour, LEGEND)
    picture.write(
        "4.svg", "The rotation along the cut: best path of the grid and best motion found"
    )


def proof(made: dict[str, kerfpath.Plan], bound: float) -> None:
    """Picture 5: costs of plans, and the cost below which there is no motion."""
    most = 1.5 * max(plan.cost for plan in made.values())
    picture = Drawing(x=(0, most), y=(0, len(made)), height=210, margins=(20, 20, 20, 44))
    ticks = {float(v): f"{v:g}" for v in np.arange(0, most, 5)}
    picture.axes(
        "cost: all joints' shares of their speed limits, summed over the cut", "", {}, ticks
    )
    a, b = picture.at(np.array([[0.0, len(made)], [bound, 0.0]]))
    picture.body.append(
        f"<rect x='{a[0]:.1f}' y='{a[1]:.1f}' width='{b[0] - a[0]:.1f}' "
        f"height='{b[1] - a[1]:.1f}' fill='#eee'/>"
    )
    words = f"no motion: proved up to {bound:.2f}"
    picture.text(bound / 2, len(made) / 2, words, QUIET, "text-anchor='middle'")
    for i, (name, plan) in enumerate(made.items()):
        y, colour = len(made) - 0.5 - i, GOOD if i == len(made) - 1 else WARM
        picture.line(np.array([[plan.cost, y - 0.35], [plan.cost, y + 0.35]]), colour, 4)
        picture.text(plan.cost + most / 80, y - 0.1, f"{name}, {plan.cost:.2f}", colour)
    picture.write("5.svg", "Costs of three plans, and the range of costs that no motion has")


def _map(K: int) -> Drawing:
    picture = Drawing(x=(-1, K), y=(-185, 185))
    ticks = {float(v): str(v) for v in range(-180, 181, 90)}
    nodes = {float(v): str(v) for v in range(0, K, 12)}
    picture.axes("node along the cut", "rotation about the beam, deg", ticks, nodes)
    return picture


def _seen(points: Array) -> Array:
    """Return the view (n, 2) of points (n, 3) from the side, a little from above."""
    return np.asarray(points @ np.array([[0.85, -0.12], [0.45, 0.22], [0.0, 0.95]]))


def main() -> None:
    """Plan and draw."""
    task = cut()
    up = postures_named("front/up", task["robot"].kinematics)
    asked = PlanOptions(gamma_step=STEP, postures=up)
    paper, grid = (
        kerfpath.plan(**task, speed=SPEED, options=replace(asked, method=method, certify=None))
        for method in ("paper", "exact")
    )
    best = kerfpath.plan(**task, speed=SPEED, options=replace(asked, certify=Certify()))
    assert best.proof.bound is not None
    assert kerfpath.audit(best) == []
    posture = int(best.posture[0])
    assert (best.posture == posture).all()
    poses(task, posture)
    graph_of_all(task, posture)
    windows(task, best)
    courses(task, posture, {"best on this grid": grid, "best motion": best})
    proof(
        {"paper's procedure": paper, "best on the grid": grid, "best motion": best},
        best.proof.bound,
    )
    print(f"costs {paper.cost:.2f}, {grid.cost:.2f}, {best.cost:.2f}; bound {best.proof.bound:.2f}")


if __name__ == "__main__":
    main()
