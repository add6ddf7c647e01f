"""Kerf compensation on many random closed curves, beside GEOS."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from benchmarks._closed_curves import EXACT, KINDS, SURE, Curve, Verdict, curve, judge
from benchmarks._figures import Report, Sheet

__all__ = ["run"]

COUNT = 10_000
NAMED = 12
"""Most wrong answers listed."""
HOW = f"""\
`offset` of random closed curves that lie anyhow in space, 0.01 to 1 mm to the scrap side: polygons,
regular polygons, stairs, rectangles with rounded corners, splines, slots, 2 to 100 mm, with nodes
at corners only or along the sides, too. What should come is said by GEOS (shapely) in the plane: an
offset where the moved line is one polygon, and nothing deeper than 2 % of the distance is lost but
at corners; a refusal where the line falls apart or vanishes, or a curve is too tight; either where
a beam {100 * SURE:g} % wider or narrower changes that, or a step is lower than the beam is wide. An
offset is right within {100 * EXACT:g} % of the distance, which chords of arcs take."""


def run(*, quick: bool) -> Report:
    """Compare them."""
    rng = np.random.default_rng(2026)
    judged: list[tuple[Curve, Verdict]] = []
    while len(judged) < (100 if quick else COUNT):
        drawn = curve(rng)
        if Polygon(drawn.points).is_valid:  # random polygons may cross themselves
            judged.append((drawn, judge(drawn, rng)))
    wrong = [(drawn, verdict) for drawn, verdict in judged if not verdict.right]
    rows = []
    for kind in (*KINDS, "all"):
        of = [v for drawn, v in judged if kind in (drawn.kind, "all")]
        made = [v.off for v in of if v.came == "offset"]
        rows.append(
            (
                kind,
                str(len(of)),
                str(len(made)),
                str(sum(v.came == "refused" for v in of)),
                f"{100 * max(made, default=0.0):.2g}",
                str(sum(v.expected == "offset" and v.came == "refused" for v in of)),
                str(sum(v.expected == "refused" and v.came == "offset" for v in of)),
            )
        )
    columns = ("curves", "count", "offset", "refused", "off %", "refused wrongly", "made wrongly")
    findings = [f"{len(wrong)} of {len(judged)} answers are wrong"]
    findings += [
        f"{drawn.kind}, {len(drawn.points)} nodes, {drawn.distance * 1e3:g} mm: expected "
        f"{verdict.expected}, {verdict.came}; {verdict.why[-120:]}"
        for drawn, verdict in wrong[:NAMED]
    ]
    return Report(
        title=f"Kerf: {len(judged)} random closed curves",
        how=HOW,
        sheets=[Sheet(columns=columns, rows=rows)],
        findings=findings,
    )
