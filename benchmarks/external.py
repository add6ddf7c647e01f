"""Rails and tables: what they gain, planning times, and distance from a dense search."""

from __future__ import annotations

from resource import RUSAGE_SELF, getrusage
from time import perf_counter

import numpy as np

from benchmarks._figures import Report, Sheet
from kerfpath import Contour, NoFeasiblePath, PlanOptions, fastest_speed, plan, robot
from kerfpath.arrays import Array
from kerfpath.robots import Robot

__all__ = ["run"]

POINT = np.array([1.3, 0.0, 0.6])
"""m: a point of the chuck's axis, in the robot base."""
SPEED = 0.1
"""Cutting speed of the tube, m/s."""
STEP = np.radians(3)
"""Step of gamma."""
WIDE_STEP = np.radians(10)
"""Step of gamma in the search for the fastest speed, on a grid first."""

HOW = """\
Tube: once around a tube of 80 mm radius that lies along y, a wave of 30 mm along it, 400 nodes, at
0.1 m/s; ABB IRB 4600-60/2.05, beam 37 deg off axis 6. Fixed: the arm alone. Rule: the chuck turns
evenly, so that the cut is always on top, and is not refined. Found: `plan` and `fastest_speed` with
the chuck's axis, and with a rail under the robot, too; the fastest speed from samples every 10 deg,
refined but for the rule. Cost: joints and axes by their default
weights. Random cases: nine nodes of a wavy line, a rail of 0.8 m, a table of 0.8 rad, or both, each
beside the exact search of a grid of 0.05 m, 0.1 rad (of both: 0.1 m, 0.2 rad) and 10 deg of
gamma. Each once."""


def run(*, quick: bool) -> list[Report]:
    """Measure the tube, and random cases beside a dense search."""
    return [
        Report(title="External axes", how=HOW, sheets=[_tube(quick=quick), _random(quick=quick)])
    ]


def _tool() -> Array:
    T = np.eye(4)
    T[:3, :3] = np.array([[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]])
    T[:3, 3] = 0.15, 0.0, 0.30
    return T


def _placement() -> Array:
    T = np.eye(4)
    T[:3, 3] = POINT
    return T


def _arm() -> Robot:
    return robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")


def _ring(count: int) -> Contour:
    t = np.linspace(0, 2 * np.pi, 8 * count)
    points = np.c_[0.08 * np.cos(t), 0.03 * np.sin(2 * t), 0.08 * np.sin(t)]
    return Contour(points, np.c_[-np.cos(t), 0 * t, -np.sin(t)], name="ring").resample(count=count)


def _chucked(arm: Robot) -> Robot:
    return arm.with_positioner(
        [0, 1, 0], POINT, name="chuck", lower=-np.pi, upper=np.pi, endless=True,
        velocity=3.0, acceleration=6.0,
    )  # fmt: skip


def _railed(arm: Robot) -> Robot:
    return arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, velocity=1.5, acceleration=3.0)


def _tube(*, quick: bool) -> Sheet:
    contour = _ring(60 if quick else 400)
    arm, along = _arm(), contour.points
    rule = np.unwrap(np.arctan2(along[:, 0], along[:, 2]))[:, None] * -1.0
    rows = []
    for name, each, external in (
        ("fixed", arm, None),
        ("chuck by the rule", _chucked(arm), rule),
        ("chuck", _chucked(arm), None),
        ("rail and chuck", _chucked(_railed(arm)), None),
    ):
        speed, took = _fastest(contour, each, external)
        # To refuse a speed that is much too fast for the arm alone takes many minutes.
        possible = speed >= SPEED
        cost, seconds = _planned(contour, each, external) if possible else ("none", "-")
        peak = f"{getrusage(RUSAGE_SELF).ru_maxrss / 1e6:.2f}"
        rows.append((name, cost, seconds, peak, f"{speed:.4f}", took))
    columns = ("tube", "cost", "plan, s", "peak memory so far, GB", "fastest, m/s", "seconds")
    return Sheet(columns=columns, rows=rows)


def _planned(contour: Contour, each: Robot, external: Array | None) -> tuple[str, str]:
    begin = perf_counter()
    try:
        made = plan(
            contour, each, tool=_tool(), placement=_placement(), speed=SPEED, external=external,
            gamma_step=STEP, certify=None,
        )  # fmt: skip
        cost = f"{made.cost:.4g}"
    except NoFeasiblePath:
        cost = "none"
    return cost, f"{perf_counter() - begin:.1f}"


def _fastest(contour: Contour, each: Robot, external: Array | None) -> tuple[float, str]:
    """Return the fastest speed, m/s, 0 if there is none, and the seconds it took."""
    begin = perf_counter()
    try:
        found = fastest_speed(
            contour, each, tool=_tool(), placement=_placement(), external=external,
            gamma_step=WIDE_STEP, refine=external is None,
        )  # fmt: skip
        speed = found.speed
    except NoFeasiblePath:
        speed = 0.0
    return speed, f"{perf_counter() - begin:.1f}"


def _random(*, quick: bool) -> Sheet:
    rows = []
    for case in ("rail", "table", "both"):
        ratios, missed, extra, none = [], 0, 0, 0
        for seed in range(3 if quick else 40):
            contour, each = _case(case, seed)
            dense = _cost(contour, each, PlanOptions(method="exact", gamma_step=np.radians(10)))
            found = _cost(contour, each, PlanOptions(gamma_step=STEP, certify=None))
            missed += np.isnan(found) and not np.isnan(dense)
            extra += np.isnan(dense) and not np.isnan(found)
            none += np.isnan(dense) and np.isnan(found)
            if not np.isnan(dense + found):
                ratios.append(found / dense)
        shown = [f"{np.median(ratios):.4f}", f"{np.max(ratios):.4f}"] if ratios else ["-", "-"]
        over = int((np.array(ratios) > 1.01).sum())
        rows.append((case, str(len(ratios)), *shown, str(over), str(missed), str(extra), str(none)))
    columns = (
        "random cases", "both planned", "cost over dense, median", "most", "over by 1 %",
        "only dense planned", "only found planned", "neither",
    )  # fmt: skip
    return Sheet(columns=columns, rows=rows)


def _cost(contour: Contour, each: Robot, options: PlanOptions) -> float:
    """Return the cost of a plan, NaN if there is none."""
    try:
        made = plan(contour, each, tool=_tool(), placement=_placement(), speed=0.2, options=options)
    except NoFeasiblePath:
        return np.nan
    return made.cost


def _case(case: str, seed: int) -> tuple[Contour, Robot]:
    rng = np.random.default_rng(seed)
    y, wave = np.linspace(-0.3, 0.3, 129), rng.uniform(0.02, 0.15)
    points = np.c_[wave * np.sin(rng.uniform(4, 12) * y), y, 0 * y]
    lean = rng.uniform(0.1, 0.6)
    axes = np.c_[lean * np.sin(rng.uniform(3, 9) * y), 0 * y, -np.ones(len(y))]
    each, wide = _arm(), 1 + (case == "both")
    if case != "table":
        low = float(rng.uniform(-0.6, 0.0))
        each = each.on_rail(
            [0, 1, 0], lower=low, upper=low + 0.8, velocity=1.0, acceleration=2.0, step=0.05 * wide
        )
    if case != "rail":
        each = each.with_positioner(
            [0, 0, 1], POINT, lower=-0.4, upper=0.4, velocity=1.0, acceleration=2.0, step=0.1 * wide
        )
    return Contour(points, axes, name=f"{case} {seed}").resample(count=9), each
