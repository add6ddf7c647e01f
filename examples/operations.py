"""Draw every operation on contours: the pictures of docs/operations.md.

Run it with `python examples/operations.py`; it writes docs/operations/*.svg.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerfpath import Contour
from kerfpath.contour import KINDS
from kerfpath.operations import (
    bevel,
    lead_in,
    lead_out,
    loop_corners,
    micro_joints,
    offset,
    overlap,
    reverse,
    round_corners,
    slow_corners,
    smooth_axes,
    smoothest_start,
    start_at,
)

FOLDER = Path(__file__).parent.parent / "docs" / "operations"
COLOURS = {
    "cut": "#2060a0", "pierce": "#b03060", "lead-in": "#b03060", "micro joint": "#e0a000",
    "overlap": "#7040a0", "lead-out": "#208050", "loop": "#d06010",
}  # fmt: skip
MATERIAL, DRAWN = "#d9dde2", "#808890"
TOP = np.array([[1.0, 0, 0], [0, 1, 0]])
"""The sheet as the nozzle sees it."""
SIDE = np.array([[1.0, 0, 0], [0, 0, 1]])
OBLIQUE = np.array([[1.0, 0.4, 0], [0, 0.5, 0.8]])
SCALE = 8.0
"""Pixels per mm."""
Array = NDArray[np.float64]


@dataclass
class Picture:
    """SVG elements in mm, y upwards, and the room they take."""

    view: Array = field(default_factory=lambda: TOP)
    shapes: list[str] = field(default_factory=list)
    seen: list[Array] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)

    def flat(self, points: ArrayLike) -> Array:
        """Return pixels (B, 2) of points (B, 3) m, y downwards."""
        pixels = np.atleast_2d(points) @ self.view.T * [1e3 * SCALE, -1e3 * SCALE]
        self.seen.append(pixels)
        return np.asarray(pixels)

    def material(self, *rings: ArrayLike) -> None:
        """Shade what lies inside an odd number of rings (B, 3) m."""
        d = " ".join(f"M{_text(self.flat(ring))}Z" for ring in rings)
        self.shapes.append(f"<path d='{d}' fill='{MATERIAL}' fill-rule='evenodd'/>")

    def line(self, points: ArrayLike, colour: str, width: float = 2, more: str = "") -> None:
        """Draw a line through points (B, 3) m."""
        self.shapes.append(
            f"<polyline points='{_text(self.flat(points))}' fill='none' stroke='{colour}' "
            f"stroke-width='{width:g}' {more}/>"
        )

    def dot(self, point: ArrayLike, colour: str, radius: float = 5, more: str = "") -> None:
        """Mark a point (3,) m."""
        x, y = self.flat(point)[0]
        self.shapes.append(
            f"<circle cx='{x + 0:.1f}' cy='{y + 0:.1f}' r='{radius:g}' fill='{colour}' {more}/>"
        )

    def drawn(self, contour: Contour) -> None:
        """Draw the contour as it was before."""
        self.line(contour.points, DRAWN, 1.5, "stroke-dasharray='5 4'")

    def cut(self, contour: Contour, *, arrow: float = 0.5) -> None:
        """Draw the stretches of a contour by their kinds, its start, and its direction."""
        code = contour.kind[:-1].copy()
        if contour.kind[0] == KINDS.index("pierce"):
            code[0] = contour.kind[1]
        code[code == KINDS.index("corner")] = KINDS.index("cut")
        ends = [0, *(np.flatnonzero(np.diff(code)) + 1).tolist(), len(code)]
        for a, b in pairwise(ends):
            word = KINDS[code[a]]
            self.kinds.append(word)
            width = 5 if word == "micro joint" else 2.5
            self.line(contour.points[a : b + 1], COLOURS[word], width)
        self.arrow(contour, arrow)
        start = contour.points[0]
        if contour.kind[0] == KINDS.index("pierce"):
            self.kinds.append("pierce")
            self.dot(start, "white", 6, f"stroke='{COLOURS['pierce']}' stroke-width='2.5'")
            self.dot(start, COLOURS["pierce"], 2)
        else:
            self.dot(start, COLOURS["cut"])

    def arrow(self, contour: Contour, part: float) -> None:
        """Draw the direction of travel at a share of the length."""
        ends, _ = contour.at(contour.s[0] + contour.length * part + np.array([0, 1e-5]))
        tip, ahead = self.flat(ends)
        t = (ahead - tip) / np.linalg.norm(ahead - tip)
        head = np.array([tip + 8 * t, tip - 4 * t + 6 * t[::-1] * [-1, 1]])
        head = np.vstack([head, tip - 4 * t - 6 * t[::-1] * [-1, 1]])
        self.shapes.append(f"<polygon points='{_text(head)}' fill='{COLOURS['cut']}'/>")

    def needles(self, contour: Contour, colour: str, length: float, every: int) -> None:
        """Draw the tool axes as needles (length in m) that stand on the contour."""
        for p, n in zip(contour.points[::every], contour.axes[::every], strict=True):
            self.line([p, p - length * n], colour, 1.5)

    def svg(self) -> str:
        """Return the whole picture."""
        low, high = (f(np.vstack(self.seen), axis=0) for f in (np.min, np.max))
        words = [word for word in KINDS if word in self.kinds]
        width = max(high[0] - low[0] + 40, 110 * len(words))
        height = high[1] - low[1] + 40 + 24
        legend = [
            f"<rect x='{20 + 110 * i}' y='{height - 20:.0f}' width='12' height='12' "
            f"fill='{COLOURS[word]}'/><text x='{37 + 110 * i}' y='{height - 10:.0f}'>{word}</text>"
            for i, word in enumerate(words)
        ]
        return "\n".join(
            [
                f"<svg xmlns='http://www.w3.org/2000/svg' width='{width:.0f}' "
                f"height='{height:.0f}' font-family='sans-serif' font-size='13'>",
                "<rect width='100%' height='100%' fill='white'/>",
                f"<g transform='translate({20 - low[0]:.1f} {20 - low[1]:.1f})' "
                "stroke-linejoin='round' stroke-linecap='round'>",
                *self.shapes,
                "</g>",
                *legend,
                "</svg>\n",
            ]
        )


def _text(pixels: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in np.round(pixels, 1) + 0.0)


def plate() -> Contour:
    """Return the outline of an L-shaped plate as CAD has it: scrap on the right, outside."""
    corners = 1e-3 * np.array([[20, 0], [60, 0], [60, 22], [34, 22], [34, 40], [0, 40], [0, 0]])
    points = np.c_[corners, np.zeros(len(corners))]
    return Contour(points, np.tile([0, 0, -1.0], (len(points), 1)), closed=True, name="plate")


def hole(x: float = 0.0) -> Contour:
    """Return a round hole of 12 mm radius as CAD has it: scrap on the right, inside."""
    t = -np.linspace(0, 2 * np.pi, 181)[:-1]
    points = np.c_[x + 0.012 * np.cos(t), 0.012 * np.sin(t), 0 * t]
    return Contour(points, np.tile([0, 0, -1.0], (180, 1)), closed=True, name="hole")


def around(*holes: Contour) -> Array:
    """Return the sheet (4, 3) m around holes."""
    points = np.vstack([h.points for h in holes])
    (x0, y0, _), (x1, y1, _) = points.min(axis=0) - 0.006, points.max(axis=0) + 0.006
    return np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]])


def on_plate(made: Contour, *, arrow: float = 0.05) -> Picture:
    """Return a picture of a cut around the plate."""
    picture = Picture()
    picture.material(plate().points)
    picture.drawn(plate())
    picture.cut(made, arrow=arrow)
    return picture


def in_holes(*made: tuple[Contour, Contour]) -> Picture:
    """Return a picture of holes and their cuts."""
    picture = Picture()
    picture.material(around(*(h for h, _ in made)), *(h.points for h, _ in made))
    for h, cut in made:
        picture.drawn(h)
        picture.cut(cut)
    return picture


def start() -> Picture:
    """Start in a corner, moved to the middle of the longest smooth stretch."""
    begun = start_at(plate(), 0.04)
    picture = on_plate(start_at(begun, smoothest_start(begun)), arrow=0.1)
    picture.dot(begun.points[0], "white", 5, f"stroke='{DRAWN}' stroke-width='2'")
    return picture


def leads() -> Picture:
    """Lead in by a line, and by an arc."""
    right = hole(0.034)
    return in_holes(
        (hole(), lead_in(hole(), 0.006)),
        (right, lead_in(right, 0.01, shape="arc", angle=np.pi / 2)),
    )


def slow() -> Picture:
    """Where the tool is every 30 ms at 6 m/min."""
    made = slow_corners(plate(), 0.2, distance=0.001, ramp=0.004)
    picture = on_plate(made)
    for p in made.resample(dt=0.03, speed=0.1).points:
        picture.dot(p, "#b03060", 2.5)
    return picture


def bend() -> Picture:
    """Smooth the axes of a cut over a bend of the sheet, seen from the side."""
    up = np.radians(40)
    s = np.linspace(-0.03, 0.03, 61)
    points = np.c_[np.where(s < 0, s, s * np.cos(up)), 0 * s, np.where(s < 0, 0, s * np.sin(up))]
    tilt = np.where(s < 0, 0, up)
    drawn = Contour(points, np.c_[np.sin(tilt), 0 * s, -np.cos(tilt)])
    made = smooth_axes(drawn, 0.008, limit=np.radians(25))
    picture = Picture(view=SIDE)
    sheet = points[[0, 30, 60]]
    below = sheet + 0.0015 * np.array([[0, 0, -1], [np.tan(up / 2), 0, -1], drawn.axes[-1]])
    picture.material(np.vstack([sheet, below[::-1]]))
    picture.needles(drawn, "#c08040", 0.012, 2)
    picture.needles(made, COLOURS["cut"], 0.012, 2)
    picture.cut(made)
    return picture


def tilted() -> Picture:
    """Cut a hole for a weld: the head leans 30 degrees over the scrap."""
    made = bevel(hole(), np.radians(30))
    picture = Picture(view=OBLIQUE)
    picture.material(around(hole()), hole().points)
    picture.needles(made, "#90a8c8", 0.009, 6)
    picture.cut(made, arrow=0.6)
    return picture


def pictures() -> dict[str, str]:
    """Return every picture by its name, as SVG."""
    made = {
        "start": start(),
        "reverse": on_plate(reverse(plate()), arrow=0.9),
        "offset": on_plate(offset(plate(), 0.002)),
        "lead-in": leads(),
        "lead-out": in_holes((hole(), lead_out(hole(), 0.006, shape="arc", angle=np.pi / 2))),
        "overlap": in_holes((hole(), overlap(hole(), 0.006))),
        "micro-joints": on_plate(micro_joints(plate(), 0.0015, count=4)),
        "round-corners": on_plate(round_corners(plate(), 0.0015)),
        "loop-corners": on_plate(loop_corners(plate(), 0.003)),
        "slow-corners": slow(),
        "smooth-axes": bend(),
        "bevel": tilted(),
    }
    return {name: picture.svg() for name, picture in made.items()}


def main() -> None:
    """Write the pictures."""
    FOLDER.mkdir(exist_ok=True)
    for name, svg in pictures().items():
        (FOLDER / f"{name}.svg").write_text(svg, encoding="utf-8")


if __name__ == "__main__":
    main()
