"""Switches before a motion, on the way to its end, and after the tip has stopped there.

The line of a motion has one TB; controllers accept no second one. Other switches ahead of its end
come before the motion, while the robot is stopped: for example gas, when the tool leaves for the
start of a contour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array
from kerfpath.post._program import JointMove, LinearMove, Move, Program, Section, Step, Switch
from kerfpath.post.fanuc._settings import FanucSettings, unit

__all__ = ["Switching", "sayable", "split_switches", "time_before"]


class Switching(NamedTuple):
    """The switches of a move by their line: before it, on it with TB, after it."""

    before: tuple[Switch, ...]
    timed: tuple[Switch, ...]
    after: tuple[Switch, ...]


def split_switches(move: LinearMove) -> Switching:
    """Return the switches of a move by their line; of those ahead, the last has the TB."""
    switches = move.switches
    after = 0
    while move.zone == 0 and after < len(switches) and switches[-1 - after].lead_time == 0:
        after += 1
    ahead = switches[: len(switches) - after]
    by_lead = sorted(ahead, key=lambda switch: -switch.lead_time)
    return Switching(tuple(by_lead[:-1]), tuple(by_lead[-1:]), switches[len(switches) - after :])


def time_before(start: Array, end: Array, speed: float) -> float:
    """Return how long (s) the tip moves between two poses (4, 4) m at a speed (m/s)."""
    return float(np.linalg.norm(end[:3, 3] - start[:3, 3])) / speed


def sayable(program: Program, settings: FanucSettings) -> Program:
    """Return the program; switches before a motion get its duration as their lead time."""
    sections = tuple(
        replace(s, steps=tuple(_with_early_switches(program, s, settings)))
        for s in program.sections
    )
    return replace(program, sections=sections)


def _with_early_switches(
    program: Program, section: Section, settings: FanucSettings
) -> Sequence[Step]:
    steps: list[Step] = []
    before: Move | None = None
    for step in section.steps:
        if isinstance(step, LinearMove) and before is not None and split_switches(step).before:
            (start,) = program.tips([before])
            speed = round(step.speed / unit(settings)) * unit(settings)
            early = time_before(start, step.T_part_tip, speed)
            first, timed, after = split_switches(step)
            moved = (replace(switch, lead_time=early) for switch in first)
            steps.append(replace(step, switches=(*moved, *timed, *after)))
        else:
            steps.append(step)
        if isinstance(step, JointMove | LinearMove):
            before = step
    return steps
