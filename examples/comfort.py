"""A cut in a wall near the wrist singularity: how near a plan comes, and the cost of more distance.

Run it with `python examples/comfort.py`; it prints a table and writes docs/comfort.svg.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import kerfpath
from kerfpath import Band, Comfort
from kerfpath.comfort import measure

PICTURE = Path(__file__).parent.parent / "docs" / "comfort.svg"
COLOURS = ("#b03060", "#d08000", "#2060a0")
WISHES = {
    "none": None,
    "margin 12 deg": Comfort(wrist=Band(margin=np.radians(12))),
    "margin 5, band 15 deg, cost 0.3": Comfort(
        wrist=Band(margin=np.radians(5), width=np.radians(15), cost=0.3)
    ),
}


def plans() -> dict[str, kerfpath.Plan]:
    """Return the plans of a straight cut in a wall in front of the robot, one per setting."""
    t = np.linspace(0, 1, 501)
    points = np.c_[0 * t, 0.5 * t - 0.25, 0.3 * t - 0.15]
    axes = np.tile([1.0, 0.0, -0.2], (501, 1))
    cut = kerfpath.Contour(points, axes, name="slit").resample(count=121)
    robot = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    robot = robot.with_limits(endless=np.isin(np.arange(1, 7), (4, 6)))
    tool, placement, tilt = np.eye(4), np.eye(4), np.radians(20)
    tool[[0, 2], [2, 0]] = np.sin(tilt), -np.sin(tilt)
    tool[[0, 2], [0, 2]] = np.cos(tilt)
    tool[:3, 3], placement[:3, 3] = [0.1, 0, 0.3], [1.6, 0, 0.8]
    return {
        words: kerfpath.plan(
            cut,
            robot,
            tool=tool,
            placement=placement,
            speed=0.1,
            gamma_step=np.radians(4),
            comfort=comfort,
        )
        for words, comfort in WISHES.items()
    }


def picture(made: dict[str, kerfpath.Plan]) -> str:
    """Return the angle of the wrist from its singularity along the cut, as SVG."""
    width, height, left, base = 640, 300, 60, 250
    most, length = 50.0, next(iter(made.values())).contour.length
    out = [
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' "
        "font-family='sans-serif' font-size='13'><rect width='100%' height='100%' fill='white'/>"
    ]
    for angle in range(0, 51, 10):
        level = base - angle / most * 220
        out.append(f"<path d='M{left} {level:.1f}H{width - 20}' stroke='#ddd'/>")
        out.append(f"<text x='{left - 8}' y='{level + 4:.1f}' text-anchor='end'>{angle}</text>")
    for i, (words, plan) in enumerate(made.items()):
        x = left + plan.contour.s / length * (width - 20 - left)
        y = base - np.degrees(measure("wrist", plan.robot, plan.q)) / most * 220
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b in np.c_[x, y])
        colour = COLOURS[i]
        out.append(f"<polyline points='{line}' fill='none' stroke='{colour}' stroke-width='2'/>")
        place = f"x='{width - 24}' y='{44 + 17 * i}' text-anchor='end'"
        out.append(f"<text {place} fill='{colour}'>{words}</text>")
    out.append(
        f"<text x='{width / 2}' y='{height - 14}' text-anchor='middle'>along the cut, 0 to "
        f"{length * 1e3:.0f} mm; wrist from its singularity in deg</text></svg>"
    )
    return "\n".join(out) + "\n"


def main() -> None:
    """Plan, print and draw."""
    made = plans()
    print(f"{'comfort':34}{'cost':>8}{'path':>8}{'wrist, deg':>12}{'at node':>9}")
    for words, plan in made.items():
        least, node = plan.criteria.nearest["wrist"]
        path = float((np.abs(plan.increments) * plan.settings.weights).sum())
        print(f"{words:34}{plan.cost:8.2f}{path:8.2f}{np.degrees(least):12.1f}{node:9}")
        assert kerfpath.audit(plan) == []
    PICTURE.write_text(picture(made), encoding="utf-8")


if __name__ == "__main__":
    main()
