"""Targets corrected by measured runs: iterative learning, round by round, kept in a file.

In each round the nodes are moved by a share of what the measured path misses. A round that does not
reduce the rest is taken back, and the correction is settled: what is left is noise, or needs more
than moved targets.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kerfpath.arrays import Array, counted, floats, short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError, about
from kerfpath.execution.compensation import FALLS, lacking, shortfall
from kerfpath.execution.fitting import CommandedRun, Log, Stretch, registered, stretches
from kerfpath.execution.path_error import LEADS, Polyline
from kerfpath.plans import Plan

SAME_PATH = 1e-4
"""m: distance up to which a contour is that of a correction."""
ENDS = 1e-3
"""m: a log that is further from the start or the end of a contour is not of all of it."""
FINER = 8
"""Points of a measured path for each row of its log."""
REPEATED = 1e-6
"""m: rows of a log that are closer together are one place."""
SIGMAS = 3.0
"""Noise is so many standard deviations of the mean of the logs."""


class Round(NamedTuple):
    """A measured run: its logs, the largest and mean distance of nodes, and the noise, m.

    Nodes where the beam leads in or out, in the waste, are left out.
    """

    logs: str
    largest: float
    mean: float
    noise: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CorrectedContour:
    """What measured runs have shown about one contour.

    Parameters
    ----------
    name : str
    s : (K,) m
        Arc lengths of its nodes.
    points : (K, 3) m
        The nodes as drawn, in the part.
    displacement : (K, 3) m
        By what the next program moves them.
    best : (K, 3) m
        By what they were moved in the run with the smallest rest.
    rounds : tuple of Round
        The measured runs, the first one first.
    settled : bool
        Whether further rounds are not worth it.
    """

    name: str
    s: Array
    points: Array
    displacement: Array
    best: Array
    rounds: tuple[Round, ...] = ()
    settled: bool = False

    __repr__ = short_repr

    @property
    def rest(self) -> float:
        """The smallest distance, m, that was largest in a run."""
        return min(each.largest for each in self.rounds)

    @property
    def largest(self) -> float:
        """The largest displacement of a node in the next program, m."""
        return float(np.linalg.norm(self.displacement, axis=1).max())

    @property
    def words(self) -> str:
        """What the last round has shown."""
        if not self.settled:
            return "corrected for the next run"
        last = self.rounds[-1]
        if last.largest <= last.noise:
            return "what is left is noise: nothing to correct"
        return "no longer falls: the best run is kept"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Correction:
    """By what measured runs move the nodes of contours.

    Parameters
    ----------
    contours : mapping of str to CorrectedContour
    name : str
        Of its file.
    """

    contours: Mapping[str, CorrectedContour] = field(default_factory=dict)
    name: str = ""

    __repr__ = short_repr

    def displacement_at(self, nodes: Contour) -> Array:
        """Return by what nodes are moved, (K, 3) m; zero for a contour that was not measured.

        Raises
        ------
        InputError
            The contour of this name was another one when it was measured.
        """
        known = self.contours.get(nodes.name)
        if known is None:
            return np.zeros((len(nodes), 3))

        def at(values: Array) -> Array:
            return np.stack([np.interp(nodes.s, known.s, each) for each in values.T], axis=1)

        off = float(np.linalg.norm(at(known.points) - nodes.points, axis=1).max())
        if off > SAME_PATH + chord_sag(known.points):
            raise InputError(
                f"{self.name}: expected the correction of contour {nodes.name!r}, got one of a "
                f"path that is {off * 1e3:.2g} mm away; measure the program of this job again, or "
                "remove compensate"
            )
        return at(known.displacement)


def chord_sag(points: Array) -> float:
    """Return about how far chords between points (K, 3) m are from the curve through them."""
    return float(np.linalg.norm(np.diff(points, 2, axis=0), axis=1).max(initial=0.0)) / 8


def correct(
    plans: Sequence[tuple[Plan, Array]],
    runs: Sequence[CommandedRun],
    logs: Sequence[Log],
    before: Correction,
    *,
    gain: float,
    width: float,
) -> Correction:
    """Return the correction with one more round, by logs of the program's last run.

    Parameters
    ----------
    plans : sequence of (Plan, (K, 3) m)
        The plans as drawn, and by what the nodes were moved in that run.
    runs : sequence of CommandedRun
        The run of each.
    logs : sequence of Log
        Several of the same run are averaged, and show its noise.
    before : Correction
        After the earlier rounds.
    gain : float
        Share of what is missing by which nodes are moved.
    width : float s
        Standard deviation in time over which what is missing is averaged.

    Raises
    ------
    InputError
        The logs are not of this program, or not of a whole contour.
    """
    found = [each for log in logs for each in stretches(log, runs)]
    if not found:
        raise InputError(
            f"expected a log of this program, got {counted(len(logs), 'log')} near none of its "
            f"{counted(len(runs), 'cut')}; check tool, part, plan and compensate"
        )
    contours = dict(before.contours)
    for number, (plan, moved) in enumerate(plans):
        own = [each for each in found if each.run == number]
        if own:
            old = before.contours.get(plan.name)
            contours[plan.name] = _learnt(plan, moved, own, old, gain, width)
    return Correction(contours=contours)


def _learnt(
    plan: Plan, moved: Array, own: Sequence[Stretch], old: CorrectedContour | None,
    gain: float, width: float,
) -> CorrectedContour:  # fmt: skip
    """Return what is known of a contour after runs in which its nodes were moved."""
    ways = [_way(plan, each) for each in own]
    raw = np.array([lacking(plan.contour.points, way) for way in ways])
    step = np.mean([shortfall(plan, plan.contour, way, width) for way in ways], axis=0)
    scatter = raw - (raw.mean(axis=0) if len(ways) > 1 else step)
    noise = SIGMAS * float(np.sqrt((scatter**2).sum(axis=2).mean()) / len(ways) ** 0.5)
    off = np.linalg.norm(step, axis=1)
    cut = ~np.isin(plan.contour.kind, LEADS)
    off = off[cut] if cut.any() else off
    logs = ", ".join(each.log.name for each in own)
    last = Round(logs, float(off.max()), float(off.mean()), noise)
    rounds = (last,) if old is None else (*old.rounds, last)
    settled, there, best = last.largest <= noise, moved + gain * step, moved
    if old is not None and last.largest > FALLS * old.rest:
        settled, there, best = True, old.best, old.best
    return CorrectedContour(
        name=plan.name, s=plan.contour.s, points=plan.contour.points,
        displacement=best if settled else there, best=best, rounds=rounds, settled=settled,
    )  # fmt: skip


def _way(plan: Plan, stretch: Stretch) -> Array:
    """Return the measured way (m, 3) m of a tip in the part, curved between the rows of its log."""
    tip = stretch.log.tip[stretch.part]
    if stretch.log.tracked:
        tip = registered(Polyline.of(plan.points), tip)
    tip = (tip - plan.T_base_part[:3, 3]) @ plan.T_base_part[:3, :3]
    steps = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    kept = np.append(True, steps > REPEATED)
    tip, at = tip[kept], np.append(0.0, np.cumsum(steps[steps > REPEATED]))
    gap = float(steps.max())
    if len(tip) < 4 or chord_sag(tip) > SAME_PATH:
        raise InputError(
            f"{stretch.log.name}: expected rows close enough to show contour {plan.name!r}, got up "
            f"to {gap * 1e3:.2g} mm between two; log more often"
        )
    fine = np.interp(np.arange(FINER * (len(at) - 1) + 1) / FINER, np.arange(len(at)), at)
    way = np.asarray(CubicSpline(at, tip)(fine))
    beyond = np.linalg.norm(lacking(plan.contour.points, way)[[0, -1]], axis=1).max()
    if beyond > ENDS:
        raise InputError(
            f"{stretch.log.name}: expected a log of all of contour {plan.name!r}, got one that is "
            f"{beyond * 1e3:.2g} mm away from its start or end; log from before the cut to after it"
        )
    return way


# -----------------------------------------------------------------------------
# The file of a correction.

SCHEMA = 1
MM = 1e3


def correction_text(correction: Correction) -> str:
    """Return a correction as the text of a JSON file, which `read_correction` reads."""
    contours = [
        {
            "name": each.name,
            "settled": each.settled,
            "rounds": [
                {
                    "logs": one.logs,
                    "largest_mm": round(one.largest * MM, 6),
                    "mean_mm": round(one.mean * MM, 6),
                    "noise_mm": round(one.noise * MM, 6),
                }
                for one in each.rounds
            ],
            **{
                f"{name}_mm": (getattr(each, name) * MM).round(6).tolist()
                for name in ("s", "points", "displacement", "best")
            },
        }
        for each in correction.contours.values()
    ]
    return json.dumps({"correction": SCHEMA, "contours": contours}, indent=1) + "\n"


def read_correction(path: str | Path) -> Correction:
    """Return the correction that a file holds, as `kerfpath correct` writes it.

    Raises
    ------
    InputError
        The file cannot be read, or is no correction.
    """
    path = Path(path)
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(data, dict) or data.get("correction") != SCHEMA:
            raise ValueError(f"its schema is not {SCHEMA}")
        with about(path):
            contours = [_contour(each) for each in data["contours"]]
    except (OSError, ValueError, KeyError, TypeError) as fault:
        said = f"no key {fault}" if isinstance(fault, KeyError) else f"{fault}"
        raise InputError(
            f"{path}: expected a correction that kerfpath correct wrote, got none ({said})"
        ) from None
    return Correction(contours={each.name: each for each in contours}, name=path.name)


def _contour(data: Mapping[str, Any]) -> CorrectedContour:
    """Return one contour of a file."""
    s = floats(data["s_mm"], "s_mm", (None,)) / MM
    placed = {
        name: floats(data[f"{name}_mm"], f"{name}_mm", (len(s), 3)) / MM
        for name in ("points", "displacement", "best")
    }
    if (np.diff(s) <= 0).any():
        raise InputError("s_mm: expected lengths that increase from node to node")
    rounds = [
        Round(
            str(one["logs"]), *(float(one[f"{of}_mm"]) / MM for of in ("largest", "mean", "noise"))
        )
        for one in data["rounds"]
    ]
    return CorrectedContour(
        name=str(data["name"]), s=s, **placed, rounds=tuple(rounds), settled=bool(data["settled"])
    )
