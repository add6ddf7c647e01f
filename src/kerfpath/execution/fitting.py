"""Fit the response of an arm to logs of its own runs: what they tell, what not, and how well.

Logged and executed paths are compared as curves in space, so that times that jitter, missing
samples and an unknown delay do not matter.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, lengths_along, short_repr, spread
from kerfpath.errors import InputError, about
from kerfpath.execution.executed import Executed, timing_of
from kerfpath.execution.path_error import STEP, Polyline, commanded
from kerfpath.execution.response import Response
from kerfpath.robots import Robot
from kerfpath.setting import settings

# -----------------------------------------------------------------------------
# Logs: tables of joints, or of a tracked tip, with named columns and units.

TIME = {"t_s": 1.0, "time_s": 1.0, "t_ms": 1e-3, "time_ms": 1e-3}
"""Names of the column of times, and their factors to s."""
ANGLE = re.compile(r"[qj]_?(\d+)_(deg|rad)")
LENGTHS = {"mm": 1e-3, "m": 1.0}
PLACES = ("x_", "y_", "z_")
"""Names of the columns of a tracked tip, and the units that follow them."""
EXPECTED = "a column for each joint (q1_deg, ...) or the tool tip (x_mm, y_mm, z_mm)"
BEYOND = np.radians(1.0)
"""rad: joints further outside their limits are of another robot."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Log:
    """A logged run.

    Parameters
    ----------
    name : str
    tip : (m, 3) m
        The tool tip in the robot base.
    tracked : bool
        Whether the tip was tracked, and not computed from joints: its frame may be off a little.
    """

    name: str
    tip: Array
    tracked: bool = False

    __repr__ = short_repr


def read_log(path: str | Path, robot: Robot, T_flange_tip: Array) -> Log:
    """Return the run that a CSV table has logged.

    It has a column of times (t_s or t_ms) and one for each joint (q1_deg or q1_rad, or j1_deg, and
    so on), or x_mm, y_mm and z_mm of the tool tip in the robot base; other columns are ignored.

    Raises
    ------
    InputError
        The file cannot be read, has no times or neither joints nor a tip, a value that is no
        number, times that go back, joints of another robot, or outside its limits.
    """
    path = Path(path)
    with about(path):
        return _log(path, robot, T_flange_tip)


def _log(path: Path, robot: Robot, T_flange_tip: Array) -> Log:
    """Return the run that a table has logged; messages do not name its file."""
    names, rows = _numbers(path)
    times = next((name for name in TIME if name in names), None)
    if times is None:
        raise InputError(f"expected a column of times, {' or '.join(TIME)}, got none")
    if (np.diff(rows[:, names.index(times)]) < 0).any():
        raise InputError(f"expected times that do not go back in column {times}, got some")
    found = {
        int(each[1]): (i, each[2]) for i, n in enumerate(names) if (each := ANGLE.fullmatch(n))
    }
    if not found:
        return Log(name=path.name, tip=_tracked(names, rows), tracked=True)
    if sorted(found) != list(range(1, robot.arm.joints + 1)):
        raise InputError(
            f"expected joints 1 to {robot.arm.joints} of {robot.id!r}, got "
            f"{', '.join(map(str, sorted(found)))}; is it the log of another robot?"
        )
    columns = [found[joint] for joint in sorted(found)]
    q = np.stack([rows[:, i] * (1.0 if u == "rad" else np.pi / 180) for i, u in columns], axis=1)
    limits, n = robot.joint_limits(), robot.arm.joints
    low, high = limits.lower[:n] - BEYOND, limits.upper[:n] + BEYOND
    outside = ((q < low) | (q > high)).any(axis=0) & ~limits.endless[:n].astype(bool)
    if outside.any():
        joint = int(np.argmax(outside))
        raise InputError(
            f"expected joints within the limits of {robot.id!r}, got joint {joint + 1} "
            f"from {np.degrees(q[:, joint].min()):.1f} to {np.degrees(q[:, joint].max()):.1f} deg"
        )
    return Log(name=path.name, tip=(robot.arm.forward(q) @ T_flange_tip)[:, :3, 3])


def _numbers(path: Path) -> tuple[list[str], Array]:
    """Return the names of the columns of a log, and its rows; NaN where a column is not used."""
    from kerfpath.cad.reading import content_of  # logs are read by one command
    from kerfpath.cad.table import cells_of

    table = cells_of(content_of(path, "a log"), EXPECTED)
    names = [name.lower() for name in table.rows[0]]
    table = table.without_header()
    table.require_width(len(names))
    if len(table.rows) < 2:
        raise InputError(f"expected a row of names and rows of numbers, got {len(table.rows)} rows")
    rows = np.full((len(table.rows), len(names)), np.nan)
    for i, name in enumerate(names):
        if name in TIME or ANGLE.fullmatch(name) or name.startswith(PLACES):
            rows[:, i] = [table.number(k, i, name) for k in range(len(rows))]
    return names, rows


def _tracked(names: list[str], rows: Array) -> Array:
    """Return the logged tips (m, 3) m."""
    for unit, factor in LENGTHS.items():
        wanted = [f"{axis}{unit}" for axis in PLACES]
        if all(name in names for name in wanted):
            return np.asarray(factor * rows[:, [names.index(name) for name in wanted]])
    raise InputError(f"expected {EXPECTED}, got {', '.join(names[:8])}")


# -----------------------------------------------------------------------------
# Stretches of logs along the runs of a program.

NEAR = 0.02
"""m: a log that is further from a run is not of it."""
COVERED = 0.8
"""Share of a run that a log must cover."""
MOST = 400
"""Number of points of a stretch that are compared."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """Where a log follows a run of the program.

    Parameters
    ----------
    log : Log
    run : int
        Number of the run.
    points : (k, 3) m
        Points of the log, evenly spread along it.
    part : slice
        The rows of the log.
    """

    log: Log
    run: int
    points: Array
    part: slice

    __repr__ = short_repr

    @property
    def s(self) -> Array:
        """Length of the way, m, up to each point, (k,)."""
        return lengths_along(self.points)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CommandedRun:
    """The joints that a program commands from stop to stop, every `STEP` s.

    Parameters
    ----------
    name : str
        Name of the section of the program.
    robot : Robot
    T_flange_tip : (4, 4) m
    q : (m, n) rad
    """

    name: str
    robot: Robot
    T_flange_tip: Array
    q: Array

    __repr__ = short_repr

    @classmethod
    def of(cls, run: Executed) -> CommandedRun:
        """Return the joints of a run.

        Raises
        ------
        InputError
            The posture does not reach some samples of the run.
        """
        q = commanded(run, timing_of(run))
        return cls(name=run.section, robot=run.robot, T_flange_tip=run.T_flange_tip, q=q)

    def tips(self, response: Response) -> Array:
        """Return the points (k, 3) m, in the robot base, that the tip passes by a response."""
        q = response.executed(response.standing_around(self.q, STEP), STEP, self.robot)
        return np.asarray((self.robot.arm.forward(q) @ self.T_flange_tip)[:, :3, 3])


def stretches(log: Log, runs: Sequence[CommandedRun]) -> list[Stretch]:
    """Return where a log follows the runs; where it follows several, only the nearest of them."""
    found: list[tuple[float, int, slice]] = []
    for number, run in enumerate(runs):
        path = run.tips(Response())
        start, along, off = Polyline.of(path).nearest(log.tip)
        length = lengths_along(path)
        s = length[start] + along * (length[start + 1] - length[start])
        found += [
            (float(off[part].mean()), number, part)
            for part in _pieces(off < NEAR)
            if np.ptp(s[part]) >= COVERED * length[-1]
        ]
    kept: list[Stretch] = []
    taken = np.zeros(len(log.tip), dtype=bool)
    for _, number, part in sorted(found, key=lambda each: each[0]):
        if taken[part].any():
            continue
        taken[part] = True
        points = log.tip[part]
        way = lengths_along(points)
        some = np.unique(np.searchsorted(way, np.linspace(0, way[-1], MOST)))
        some = some.clip(max=len(points) - 1)
        kept.append(Stretch(log=log, run=number, points=points[some], part=part))
    return kept


def _pieces(inside: Bools) -> Iterator[slice]:
    """Yield the unbroken stretches of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, inside, False].astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(first), int(last))


# -----------------------------------------------------------------------------
# The fit: candidates of rising number of parameters, judged by runs that they have not seen.

LEAST, LARGEST = 1e-3, 0.12
"""s: range of sigma."""
FIRST = 0.025
WORTH = 0.97
"""Share of the held-out error below which more parameters are worth it."""
SAME = 1e-6
"""m: distances that are the same, whatever their ratio."""
TOLD = 0.2
"""Share of the remaining error by which half of a sigma more must move the path to be told."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tried:
    """A form of the response that was tried.

    Parameters
    ----------
    form : str
        Its parameters in words.
    response : Response
        Fitted to all runs.
    own : tuple of float m
        Mean, 95 % and largest distance of the logs from the executed paths.
    held_out : tuple of float m
        The same on what was left out of the fit.
    """

    form: str
    response: Response
    own: tuple[float, float, float]
    held_out: tuple[float, float, float]

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A response that was fitted to logs.

    Parameters
    ----------
    response : Response
        Of the chosen form.
    tried : tuple of Tried
        All forms; the first one has no lag.
    chosen : int
        Which of them was taken: the simplest that is about as good as the best on what it has not
        seen.
    untold : tuple of int
        Joints, counted from 0, whose sigma the runs cannot tell; they have that of all joints.
    stretches : tuple of Stretch
        What was compared.
    without, left : tuple of (k,) m
        For each stretch, the distances of its points from the path without lag, and from the
        executed path.
    unused : tuple of str
        Names of logs that follow no run of the program.
    left_out : str
        What was left out in turn for the held-out error.
    """

    response: Response
    tried: tuple[Tried, ...]
    chosen: int
    untold: tuple[int, ...]
    stretches: tuple[Stretch, ...]
    without: tuple[Array, ...]
    left: tuple[Array, ...]
    unused: tuple[str, ...]
    left_out: str

    __repr__ = short_repr


def fit_response(runs: Sequence[CommandedRun], logs: Sequence[Log]) -> Fit:
    """Return the response with which the runs come closest to the logs.

    Parameters
    ----------
    runs : sequence of CommandedRun
        Of the program that was run.
    logs : sequence of Log
        One run of the program, or of a part of it, each.

    Raises
    ------
    InputError
        No log follows a run of the program, or the robot has external axes.
    """
    if runs and runs[0].robot.externals:
        raise InputError(
            f"expected a robot without external axes, got {runs[0].robot.externals[0].name}"
        )
    found = [stretches(log, runs) for log in logs]
    every = [each for each_log in found for each in each_log]
    if not every:
        raise InputError(
            f"expected logs of this program, got {len(logs)} that stay within "
            f"{NEAR * 1e3:g} mm of none of its {len(runs)} cuts; check tool, part and plan"
        )
    parts, left_out = _folds(every)
    tried = []
    for form, make, first in _forms(runs[0].robot):
        own = _fitted(runs, every, make, first)
        off = [
            np.concatenate([_off(runs, each, held) for each in part])
            for k, part in enumerate(parts)
            if (held := _fitted(runs, _others(parts, k), make, first)) is not None
        ]
        seen = np.concatenate([_off(runs, each, own) for each in every])
        tried.append(
            Tried(form=form, response=own, own=_three(seen), held_out=_three(np.concatenate(off)))
        )
    best = min(each.held_out[0] for each in tried)
    chosen = next(k for k, each in enumerate(tried) if WORTH * each.held_out[0] <= best + SAME)
    response, untold = _told(runs, every, tried, chosen)
    fastest = max(_fastest(runs[each.run]) for each in every)
    names = sorted({each.log.name for each in every})
    return Fit(
        response=replace(
            response,
            standing="measured",
            runs=len(names),
            fastest=fastest,
            reference=f"{', '.join(names)}"[:200],
        ),
        tried=tuple(tried),
        chosen=chosen,
        untold=untold,
        stretches=tuple(every),
        without=tuple(_off(runs, each, Response()) for each in every),
        left=tuple(_off(runs, each, response) for each in every),
        unused=tuple(log.name for log, own in zip(logs, found, strict=True) if not own),
        left_out=left_out,
    )


Make = Callable[[Array], Response]


def _forms(robot: Robot) -> Iterator[tuple[str, Make, Array]]:
    """Yield the forms to try: words, the response of parameters, and the first parameters."""
    n = robot.joints
    yield "no lag", lambda x: Response(), np.zeros(0)
    yield "one sigma", lambda x: Response(sigma=_sigma(x)), np.full(1, np.log(FIRST))
    yield "a sigma for each joint", lambda x: Response(sigma=_sigma(x)), np.full(n, np.log(FIRST))
    if robot.kinematics == "opw" and not robot.externals:
        yield (
            "a sigma for each joint, friction",
            lambda x: Response(sigma=_sigma(x[:n]), friction=abs(float(x[n])) * 1e-4),
            np.append(np.full(n, np.log(FIRST)), 0.5),
        )


def _folds(every: list[Stretch]) -> tuple[list[list[Stretch]], str]:
    """Return the stretches in parts that are left out in turn, and what the parts are."""
    by: dict[str, list[object]] = {
        "each cut in turn": [each.run for each in every],
        "each log in turn": [each.log.name for each in every],
    }
    for words, keys in by.items():
        names = list(dict.fromkeys(keys))
        if len(names) > 1:
            own = [[e for e, key in zip(every, keys, strict=True) if key == n] for n in names]
            return own, words
    halves = [np.array_split(each.points, 2) for each in every]
    return [
        [replace(each, points=half[k]) for each, half in zip(every, halves, strict=True)]
        for k in range(2)
    ], "each half of the cut in turn"


def _others(parts: list[list[Stretch]], k: int) -> list[Stretch]:
    return [each for i, part in enumerate(parts) if i != k for each in part]


def _fitted(
    runs: Sequence[CommandedRun], every: Sequence[Stretch], make: Make, first: Array
) -> Response:
    """Return the response of least squares of the distances of stretches from executed paths."""
    if not first.size:
        return make(first)

    def residuals(x: Array) -> Array:
        response = make(x)
        paths = {k: Polyline.of(runs[k].tips(response)) for k in {each.run for each in every}}
        return 1e3 * np.concatenate([_beside(paths[each.run], each).ravel() for each in every])

    found = least_squares(residuals, first, diff_step=[1e-3], max_nfev=20)
    return make(found.x)


def _sigma(x: Array) -> Array:
    return np.exp(np.clip(x, np.log(LEAST), np.log(LARGEST)))


def _beside(path: Polyline, stretch: Stretch) -> Array:
    """Return the vectors (k, 3) m from the path to the points of a stretch."""
    points = stretch.points
    if stretch.log.tracked:
        points = registered(path, points)
    start, along, _ = path.nearest(points)
    chord = path.points[start + 1] - path.points[start]
    return np.asarray(points - path.points[start] - along[:, None] * chord)


def registered(path: Polyline, points: Array, rounds: int = 3) -> Array:
    """Return points (k, 3) m turned and shifted as a whole to be closest to a path."""
    for _ in range(rounds):
        start, along, _ = path.nearest(points)
        near = path.points[start] + along[:, None] * (path.points[start + 1] - path.points[start])
        centre, other = points.mean(axis=0), near.mean(axis=0)
        turn, _ = Rotation.align_vectors(near - other, points - centre)
        points = turn.apply(points - centre) + other
    return np.asarray(points)


def _off(runs: Sequence[CommandedRun], stretch: Stretch, response: Response) -> Array:
    """Return the distances (k,) m of a stretch from the executed path of its run."""
    path = Polyline.of(runs[stretch.run].tips(response))
    return np.asarray(np.linalg.norm(_beside(path, stretch), axis=1))


def _three(off: Array) -> tuple[float, float, float]:
    return float(off.mean()), float(np.percentile(off, 95)), float(off.max())


def _told(
    runs: Sequence[CommandedRun], every: Sequence[Stretch], tried: Sequence[Tried], chosen: int
) -> tuple[Response, tuple[int, ...]]:
    """Return the chosen response, and the joints whose sigma the runs cannot tell.

    Half of such a sigma more moves the paths by less than `TOLD` of the error that is left.
    """
    response = tried[chosen].response
    if len(response.sigma) < 2:
        return response, ()
    common = next(each.response.sigma[0] for each in tried if each.form == "one sigma")
    left = tried[chosen].own[0]
    untold = []
    for joint in range(len(response.sigma)):
        sigma = response.sigma.copy()
        sigma[joint] *= 1.5
        moved = []
        for k in {each.run for each in every}:
            path = Polyline.of(runs[k].tips(response))
            some = runs[k].tips(replace(response, sigma=sigma))
            moved.append(path.nearest(some[spread(len(some), MOST)])[2])
        if np.concatenate(moved).mean() < TOLD * left:
            untold.append(joint)
    sigma = response.sigma.copy()
    sigma[untold] = common
    return replace(response, sigma=sigma), tuple(untold)


def _fastest(run: CommandedRun) -> float:
    """Return the largest speed, m/s, of the tip in a run."""
    return float(np.linalg.norm(np.diff(run.tips(Response()), axis=0), axis=1).max() / STEP)


# -----------------------------------------------------------------------------
# The file of a response.


def response_text(response: Response, notes: Sequence[str] = ()) -> str:
    """Return a response as the text of a TOML file, which `read_response` reads."""
    lines, usual = [f"# {note}" for note in notes], Response()
    for name, each in settings(Response).items():
        value = getattr(response, name)
        if np.array_equal(value, getattr(usual, name)):
            continue
        if not isinstance(value, str | int):
            value = np.round(np.asarray(value) / each.si(1.0), 4).tolist()
        lines.append(f"{each.key} = {json.dumps(value, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"
