"""Targets left out where moves are shorter than the controller's cycle allows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.post.arcs import Zone, zones_at
from kerfpath.post.languages import STRETCHED, Controller
from kerfpath.post.program import LinearMove, Program, Section, Step

ANGLE = np.radians(0.2)
"""Largest angle (rad) by which joints and tool may differ from those at a target left out."""
LONGEST = 3.0
"""Longest move that replaces others, in shortest moves of the controller."""
MOST = 64
"""Largest number of moves that one replaces."""
REMOVED, BENT, UNEVEN = 1e-7, 1e-8, 1e-10
"""Cost (s) of each target left out, of the square of how far the moves that one replaces are from
straight, as a share of what is allowed, and of the square of their number. So there is one best
choice, which leaves out the targets where the path bends least: what may just be left out is not,
where something else may be, and a slightly different path keeps the same targets."""


def may_replace(controller: Controller, interval: float, count: int) -> bool:
    """Return whether one move may replace `count` moves that take an interval (s) each."""
    stretched = controller.stretch(np.array([interval]))[0] > STRETCHED
    return bool(stretched) and count <= MOST and count * interval <= _longest(controller, interval)


def _longest(controller: Controller, interval: float) -> float:
    """Return the longest time (s) of a move that replaces others, of which one takes `interval`."""
    return LONGEST * max(controller.shortest, controller.cycle) + interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Thinning:
    """How targets are left out of a program.

    Parameters
    ----------
    controller : Controller
    tolerance : float m
        Largest distance of a target left out from the straight move in its place; linear axes keep
        it, too.
    zone, zone_error
        Those of the program, see `zones_at`.
    """

    controller: Controller
    tolerance: float
    zone: Zone
    zone_error: float

    __repr__ = short_repr

    def of(self, program: Program) -> Program:
        """Return the program with straight moves merged where the controller would stretch them.

        A run of moves is left as it is unless one of them would take more than `STRETCHED` longer
        than planned. Otherwise targets are left out so that its moves take the least time, and as
        few as possible. Stops, switches and arcs keep their targets.
        """
        if self.tolerance <= 0 or _longest(self.controller, 0.0) <= 0:
            return program
        linear = np.array([unit == "m" for unit in program.robot.units])
        most = np.where(linear, self.tolerance, ANGLE)
        sections = tuple(self._section(section, most) for section in program.sections)
        return replace(program, sections=sections)

    def _section(self, section: Section, most: Array) -> Section:
        """Return a section; `most` (n,) is the largest difference of each joint."""
        steps: list[Step] = []
        k, before = 0, None
        while k < len(section.steps):
            run: Sequence[LinearMove] = () if before is None else _run(section.steps, k)
            if len(run) > 1 and before is not None:
                steps += self._merged(before, run, most)
                k += len(run)
            else:
                steps.append(section.steps[k])
                k += 1
            before = steps[-1] if isinstance(steps[-1], LinearMove) else None
        if len(steps) == len(section.steps):
            return section
        return replace(section, steps=self._with_zones(steps))

    def _merged(
        self, start: LinearMove, run: Sequence[LinearMove], most: Array
    ) -> Sequence[LinearMove]:
        """Return the moves of a run from the end of `start`, some of them merged."""
        took = np.array([move.duration for move in run])
        if not (self.controller.stretch(took) > STRETCHED).any():
            return run
        kept = self._kept([start, *run], took, most)
        moves = []
        for first, last in pairwise(kept):
            part, own = run[first:last], took[first:last]
            speed = np.array([move.speed for move in part])
            merged = replace(part[-1], speed=float(speed @ own / own.sum()), duration=own.sum())
            moves.append(part[-1] if len(part) == 1 else merged)
        return moves

    def _kept(self, moves: Sequence[LinearMove], took: Array, most: Array) -> list[int]:
        """Return the ends that are kept, from 0 on, by dynamic programming."""
        T = np.array([move.T_part_tip for move in moves])
        q, at = np.array([move.q for move in moves]), np.append(0.0, np.cumsum(took))
        m, longest = len(took), _longest(self.controller, float(took.max()))
        fits = int(np.searchsorted(np.cumsum(np.sort(took)), longest, side="right"))
        widest = int(np.clip(fits, 1, min(MOST, m)))
        cost = np.full((m + 1, widest), np.inf)  # of the move to an end, from 1 to `widest` before
        turns: list[Array] = []  # over 1, 2, ... moves
        for d in range(1, widest + 1):
            time = at[d:] - at[:-d]
            turns.append(_turns(T, d))
            good = time <= longest if d > 1 else np.ones(len(time), dtype=bool)
            bent = _bends(T, q, at, turns, self.tolerance, most)
            own = time * self.controller.stretch(time) + REMOVED * (d - 1) + UNEVEN * d**2
            cost[d:, d - 1] = np.where(good & (bent <= 1), own + BENT * bent**2, np.inf)
        best, before = np.zeros(m + 1), np.zeros(m + 1, dtype=int)
        for j in range(1, m + 1):
            reach = min(j, widest)
            sums = best[j - reach : j][::-1] + cost[j, :reach]
            before[j] = int(np.argmin(sums)) + 1
            best[j] = sums[before[j] - 1]
        return _traced(before)

    def _with_zones(self, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Return steps with the zones at the ends of straight moves that their lengths allow."""
        found, path = list(steps), [0]
        for k, step in enumerate(steps):
            if not isinstance(step, LinearMove):
                continue
            path.append(k)
            if step.zone > 0:
                continue
            moves = [steps[i] for i in path[1:]]
            points = np.array([m.T_part_tip[:3, 3] for m in moves if isinstance(m, LinearMove)])
            if len(points) > 2:
                zones = zones_at(points, self.zone, self.zone_error)
                for i, after, zone in zip(path[2:], path[3:], zones, strict=False):
                    own = found[i]
                    if type(own) is LinearMove and type(steps[after]) is LinearMove:
                        found[i] = replace(own, zone=zone)
            path = [0, k]
        return tuple(found)


def _run(steps: Sequence[Step], first: int) -> list[LinearMove]:
    """Return the straight moves from `first` on up to a switch or a stop."""
    run: list[LinearMove] = []
    for step in steps[first:]:
        if type(step) is not LinearMove:
            break
        run.append(step)
        if step.switches or step.zone == 0:
            break
    return run


def _traced(before: Ints) -> list[int]:
    """Return the ends along the best moves, each of which begins `before` (m + 1,) its end."""
    kept = [len(before) - 1]
    while kept[-1]:
        kept.append(kept[-1] - int(before[kept[-1]]))
    return kept[::-1]


def _turns(T: Array, d: int) -> Array:
    """Return the rotation vectors (m + 1 - d, 3) rad from poses (m + 1, 4, 4) to those d later."""
    R = T[:, :3, :3]
    turned = Rotation.from_matrix(np.swapaxes(R[:-d], 1, 2) @ R[d:])
    return np.asarray(turned.as_rotvec())


def _bends(
    T: Array, q: Array, at: Array, turns: Sequence[Array], tolerance: float, most: Array
) -> Array:
    """Return how far ends are from straight moves, each over d others, as a share, (m + 1 - d,).

    At the same share of the time, the tip is to be within `tolerance` (m) of each end
    T (m + 1, 4, 4) m, the tool within `ANGLE`, and each joint within `most` (n,) of q (m + 1, n).
    `turns` are those of `_turns` over 1 to d moves. The largest of these counts.
    """
    d = len(turns)
    bent = np.zeros(len(at) - d)
    for k in range(1, d):
        last = len(at) - d + k
        share = ((at[k:last] - at[:-d]) / (at[d:] - at[:-d]))[:, None]
        tip = T[:-d, :3, 3] + share * (T[d:, :3, 3] - T[:-d, :3, 3]) - T[k:last, :3, 3]
        turned = share * turns[-1] - turns[k - 1][: last - k]
        joints = q[:-d] + share * (q[d:] - q[:-d]) - q[k:last]
        for off in (
            np.linalg.norm(tip, axis=1) / tolerance,
            np.linalg.norm(turned, axis=1) / ANGLE,
            (np.abs(joints) / most).max(axis=1),
        ):
            bent = np.maximum(bent, off)
    return bent
