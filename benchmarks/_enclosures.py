"""Proven bounds of the joints on cells of gamma: their computing time and tightness."""

from __future__ import annotations

import numpy as np

from benchmarks._arm import tool
from benchmarks._figures import Figure, Report, in_turn
from kerfpath import robot
from kerfpath.kernels.enclosure import BOX, NONE, SMOOTH

__all__ = ["run"]

HOW = """\
`Arm.enclose` on one core, on cells of uniformly random flange poses turned by uniformly random
gamma, joint limits ignored. Time is per cell and posture, those without a solution included. How
tight: per smooth posture and joint, the width of the proven curvature as a share of its largest
absolute value, or of 1 rad/rad^2 where that is more: median and 90th percentile, which the
observations give with the shares of postures that are smooth, boxed, and proved to have none."""

ROBOTS = ("abb_irb2400_155", "staubli_tx2_90", "ur_ur10e")
HALVES = (5.0, 0.5, 0.05)
"""deg"""


def run(*, quick: bool) -> Report:
    """Measure both families, and an arm whose shoulder has an offset."""
    cells, runs = (2_000, 3) if quick else (40_000, 7)
    rng, T_tool = np.random.default_rng(2026), tool()
    figures, findings = [], []
    node, gamma = rng.integers(0, 500, cells), rng.uniform(-np.pi, np.pi, cells)
    for name in ROBOTS:
        r = robot(name)
        frames = r.forward(rng.uniform(-np.pi, np.pi, (500, 6))) @ T_tool
        for degrees in HALVES:
            half = np.full(cells, np.radians(degrees))
            label = f"{r.id}, cells +- {degrees:g} deg"
            call = {label: lambda r=r, f=frames, h=half: r.arm.enclose(f, node, gamma, h, T_tool)}
            for what, taken in in_turn(call, runs).items():
                each = [s / (cells * r.postures) * 1e6 for s in taken]
                figures.append(Figure(what=what, values=each, unit="us"))
            e = r.arm.enclose(frames, node, gamma, half, T_tool)
            smooth = e.status == SMOOTH
            size = np.maximum(1.0, np.maximum(np.abs(e.low), np.abs(e.high)))[smooth]
            tight = np.quantile((e.high - e.low)[smooth] / size, [0.5, 0.9])
            findings.append(
                f"{label}: curvature open by {tight[0]:.1%} (median), {tight[1]:.1%} (90th "
                f"percentile); smooth {smooth.mean():.1%}, boxed {(e.status == BOX).mean():.2%}, "
                f"none {(e.status == NONE).mean():.1%}; radius {np.median(e.radius[smooth]):.1e} "
                "rad (median)"
            )
    return Report(title="Proven bounds of the joints", how=HOW, figures=figures, findings=findings)
