"""Issues that only FANUC controllers have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath._arrays import Ints
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import (
    Await,
    JointMove,
    LinearMove,
    Program,
    Section,
    Switch,
    Wait,
)
from kerfpath.post._standing import warn_of_changed_postures
from kerfpath.post._times import TICK, not_whole
from kerfpath.post.fanuc._axes import posture, turns
from kerfpath.post.fanuc._settings import FanucSettings, unit
from kerfpath.post.fanuc._switching import split_switches
from kerfpath.post.fanuc._write import Fanuc

__all__ = ["check"]

ROUNDED_SPEED = 0.005
"""Share of a speed that the step of speeds may change without a warning."""
LARGEST_CORNER = 1.0
"""Largest corner region, m."""
CORNER_STEP = 1e-3
"""Corner regions are written in whole numbers of this (m)."""
CORNER_NOISE = 1e-6
"""Largest difference (m) of a zone from a whole number of them."""
FEWEST_TURNS, MOST_TURNS = -8, 7
"""Smallest and largest turn number that a configuration is assumed to hold."""


def check(program: Program, settings: FanucSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    lines, most = len(Fanuc(program, settings).main()), settings.lines_per_file
    if lines > most:
        message = (
            f"the main program would have {lines} lines, but lines_per_file allows {most}; raise it"
        )
        yield ProgramIssue("error", "file-length", message, "program")
    for section in program.sections:
        yield from _check_times(section)
        if settings.corner == "CR":
            yield from _check_corners(section)
        yield from _check_speeds(section, unit(settings))
        q = np.array([move.q for move in section.moves]).reshape(-1, program.robot.joints)
        yield from _check_turns(section, turns(program.robot, q, settings), settings)
        letters = [words[:3] for words in posture(program.robot, q, settings)]
        yield from warn_of_changed_postures(section, letters)


def _check_times(section: Section) -> Iterator[ProgramIssue]:
    stands = False
    for number, step in enumerate(section.steps):
        place = f"{section.name}, step {number}"
        times = [step.time] if isinstance(step, Wait) else []
        times += [step.timeout] if isinstance(step, Await) else []
        if isinstance(step, LinearMove):
            before, timed, _ = split_switches(step)
            times = [switch.lead_time for switch in timed]
            if before:
                yield from _check_early(before, stands, place)
        for time in times:
            if not_whole(time):
                message = f"expected times in steps of {TICK * 1e3:g} ms, got {time * 1e3:g} ms"
                yield ProgramIssue("error", "time-step", message, place)
        if isinstance(step, JointMove | LinearMove):
            stands = step.zone == 0


def _check_early(before: tuple[Switch, ...], stands: bool, place: str) -> Iterator[ProgramIssue]:
    """Check the switches before a motion, whose line has its one TB for another switch."""
    signals = " and ".join(switch.signal for switch in before)
    if not stands or any(switch.signal == "laser" for switch in before):
        message = (
            f"the {signals} cannot be switched here: the line of a motion has only one TB, and "
            "before it the robot does not stop, or the laser would be on"
        )
        yield ProgramIssue("error", "two-switches", message, place)
    else:
        message = (
            f"the {signals} is switched when the motion begins, earlier than planned, because the "
            "line of a motion has only one TB"
        )
        yield ProgramIssue("warning", "two-switches", message, place)


def _check_corners(section: Section) -> Iterator[ProgramIssue]:
    zones = [move.zone for move in section.moves if isinstance(move, LinearMove)]
    whole = [abs(z - CORNER_STEP * round(z / CORNER_STEP)) <= CORNER_NOISE for z in zones]
    wrong = [z for z, w in zip(zones, whole, strict=True) if not w or z > LARGEST_CORNER]
    if wrong:
        yield ProgramIssue(
            "error",
            "corner-region",
            f"expected corner regions in whole mm up to {LARGEST_CORNER * 1e3:g}, got "
            f"{wrong[0] * 1e3:g} mm; change the zone, or write corners as CNT",
            section.name,
        )


def _check_speeds(section: Section, step: float) -> Iterator[ProgramIssue]:
    speeds = np.array([move.speed for move in section.moves if isinstance(move, LinearMove)])
    off = np.abs(np.round(speeds / step) * step / speeds - 1)
    if (off > ROUNDED_SPEED).any():
        yield ProgramIssue(
            "warning",
            "speed-step",
            f"speeds are written in steps of {step * 1e3:.3g} mm/s, which changes "
            f"{speeds[off.argmax()] * 1e3:g} mm/s by {off.max():.1%}",
            section.name,
        )


def _check_turns(
    section: Section, counted: Ints, settings: FanucSettings
) -> Iterator[ProgramIssue]:
    """Check that the turns (K, 3) of targets can be written."""
    for k, move in enumerate(section.moves):
        beyond = counted[k].min() < FEWEST_TURNS or counted[k].max() > MOST_TURNS
        if beyond and isinstance(move, LinearMove):
            message = f"turns must lie between {FEWEST_TURNS} and {MOST_TURNS}, got "
            found = f"{', '.join(map(str, counted[k]))} of {settings.turns}"
            yield ProgramIssue("error", "turns", message + found, f"{section.name}, move {k}")
            return
