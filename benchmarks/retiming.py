"""The times of a path that cannot keep its speed everywhere, beside TOPP-RA."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks._figures import Figure, Report, in_turn
from kerfpath.arrays import Array
from kerfpath.limits import Limits
from kerfpath.retime import retime

__all__ = ["run"]

SPEED = 10 / 60
"""Commanded speed along the path, m/s."""
LENGTH = 2.0
"""Length of the path, m."""
BENDS = (0.5, 0.9, 1.4)
"""Where the path turns, m; each within `BEND` m."""
BEND = 0.006

HOW = """\
A path of six joints and 2 m with three bends within about 6 mm that 10 m/min cannot be kept in, in
intervals of one length, the same limits for both. kerfpath: `retime` of the increments from node to
node. TOPP-RA (toppra, Seidel solver): a spline through the same nodes, the length as a seventh
joint whose velocity limit is the commanded speed, a grid point at every node, entered and left at
speed; the time includes its spline and constraints. TOPP-RA bounds the derivatives of the spline
at the grid points (collocation with interpolation), kerfpath the finite differences that the audit
measures: the two agree as the intervals shrink. Share: the largest acceleration as the audit
measures it, over its limit."""

VELOCITY, ACCELERATION = np.full(6, 2.5), np.radians([320, 270, 420, 1300, 1400, 2000])


def run(*, quick: bool) -> list[Report]:
    """Measure the same path in coarse and in fine intervals."""
    return [_measured(count, quick=quick) for count in ((250,) if quick else (1000, 4000))]


def path(count: int) -> tuple[Array, Array]:
    """Return the nodes s (K,) m and joints q (K, 6) rad of the path in `count` intervals."""
    s = np.linspace(0, LENGTH, count + 1)
    rng = np.random.default_rng(7)
    slope = rng.uniform(-0.6, 0.6, 6)[None] * np.ones_like(s)[:, None]
    for at in BENDS:
        slope = slope + rng.uniform(-3, 3, 6) * np.tanh((s[:, None] - at) / BEND)
    q = np.cumsum((slope[1:] + slope[:-1]) / 2 * LENGTH / count, axis=0)
    return s, np.vstack([np.zeros(6), q])


def _measured(count: int, *, quick: bool) -> Report:
    s, q = path(count)
    dq, dt = np.diff(q, axis=0), LENGTH / count / SPEED
    found: dict[str, Array] = {}

    def ours() -> None:
        found["kerfpath"] = retime(dq, dt, Limits.of(VELOCITY, ACCELERATION))

    calls: dict[str, Callable[[], None]] = {"kerfpath": ours}
    missing = ""
    try:
        import toppra
    except ImportError as why:
        missing = str(why)
    else:
        toppra.setup_logging("ERROR")

        def theirs() -> None:
            found["TOPP-RA"] = _toppra(s, q)

        calls["TOPP-RA"] = theirs
    seconds = in_turn(calls, 3 if quick else 7)
    figures = [
        Figure(
            what=f"{name}, time to solve",
            values=taken,
            note=f"path time {found[name].sum():.5f} s, share {_share(found[name], dq):.4f}",
        )
        for name, taken in seconds.items()
    ]
    if missing:
        figures.append(Figure(what="TOPP-RA, time to solve", note=missing))
    commanded = LENGTH / SPEED
    findings = [f"at the commanded speed the path would take {commanded:.5f} s"]
    if not missing:
        lost = {name: tau.sum() - commanded for name, tau in found.items()}
        findings.append(
            f"time lost in the dips: kerfpath {lost['kerfpath']:.5f} s, TOPP-RA "
            f"{lost['TOPP-RA']:.5f} s; relative difference of the path times "
            f"{found['kerfpath'].sum() / found['TOPP-RA'].sum() - 1:+.1e}"
        )
    return Report(title=f"Retiming, {count} intervals", how=HOW, figures=figures, findings=findings)


def _share(tau: Array, dq: Array) -> float:
    change = np.diff(dq / tau[:, None], axis=0) / ((tau[1:] + tau[:-1]) / 2)[:, None]
    return float((np.abs(change) / ACCELERATION).max())


def _toppra(s: Array, q: Array) -> Array:
    """Return the times of the intervals that TOPP-RA chooses."""
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

    spline = SplineInterpolator(s, np.column_stack([q, s]))
    velocity, acceleration = np.append(VELOCITY, SPEED), np.append(ACCELERATION, 1e4)
    limits = [
        JointVelocityConstraint(np.column_stack([-velocity, velocity])),
        JointAccelerationConstraint(np.column_stack([-acceleration, acceleration])),
    ]
    solver = TOPPRA(limits, spline, gridpoints=s, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(SPEED, SPEED)
    return np.asarray(2 * np.diff(s) / (speed[1:] + speed[:-1]))
