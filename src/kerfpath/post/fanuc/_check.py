"""What only FANUC controllers cannot do, or do otherwise than planned."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kerfpath.post._divide import long_contours
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import (
    Await,
    JointMove,
    LinearMove,
    Move,
    Program,
    Section,
    Switch,
    Wait,
)
from kerfpath.post.fanuc._axes import posture, turns
from kerfpath.post.fanuc._settings import FanucSettings, unit
from kerfpath.post.fanuc._switching import switching
from kerfpath.post.fanuc._write import Fanuc

__all__ = ["check"]

ROUNDED_SPEED = 0.005
"""Share of a speed that the step of speeds may change without a warning."""
TICK = 0.01
"""Times are written in whole numbers of this (s)."""
TICK_NOISE = 1e-4
"""How far (s) a time may be from them."""
LARGEST_CORNER = 1.0
"""Largest corner region, m."""
CORNER_STEP = 1e-3
"""Corner regions are written in whole numbers of this (m)."""
CORNER_NOISE = 1e-6
"""How far (m) a zone may be from them."""
FEWEST_TURNS, MOST_TURNS = -8, 7
"""Turn numbers that a configuration is taken to hold."""


def check(program: Program, settings: FanucSettings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    if settings.laser_output is not None and settings.laser_output == settings.gas_output:
        said = f"laser and gas are both switched by DO[{settings.laser_output}]; name two outputs"
        yield ProgramIssue("error", "output", said, "program")
    written, most = Fanuc(program, settings), settings.lines_per_file
    yield from long_contours(written.lengths(), most, "error")
    lines = len(written.main())
    if lines > most:
        said = (
            f"the main program would have {lines} lines, {most} are allowed; raise lines_per_file"
        )
        yield ProgramIssue("error", "file-length", said, "program")
    for section in program.sections:
        moves = section.moves
        yield from _times(section)
        if settings.corner == "CR":
            yield from _corners(section)
        yield from _speeds(section, unit(settings))
        if moves:
            yield from _postures(program, section.name, moves, settings)


def _times(section: Section) -> Iterator[ProgramIssue]:
    stands = False
    for number, step in enumerate(section.steps):
        place = f"{section.name}, step {number}"
        times = [step.time] if isinstance(step, Wait) else []
        times += [step.timeout] if isinstance(step, Await) else []
        if isinstance(step, LinearMove):
            before, timed, _ = switching(step)
            times = [switch.lead_time for switch in timed]
            if before:
                yield from _early(before, stands, place)
        for time in times:
            if abs(time - TICK * round(time / TICK)) > TICK_NOISE:
                said = f"times are written in whole {TICK * 1e3:g} ms, got {time * 1e3:g} ms"
                yield ProgramIssue("error", "time-step", said, place)
        if isinstance(step, JointMove | LinearMove):
            stands = step.zone == 0


def _early(before: tuple[Switch, ...], stands: bool, place: str) -> Iterator[ProgramIssue]:
    """Tell of what is switched before a motion, as one TB on its line switches something else."""
    signals = " and ".join(switch.signal for switch in before)
    if not stands or any(switch.signal == "laser" for switch in before):
        said = (
            f"the {signals} cannot be switched here: one TB stands on the line of a motion, and "
            "before it the robot does not stand, or the laser would be on"
        )
        yield ProgramIssue("error", "two-switches", said, place)
    else:
        said = (
            f"the {signals} is switched as the motion begins, earlier than planned: one TB stands "
            "on the line of a motion"
        )
        yield ProgramIssue("warning", "two-switches", said, place)


def _corners(section: Section) -> Iterator[ProgramIssue]:
    zones = [move.zone for move in section.moves if isinstance(move, LinearMove)]
    whole = [abs(z - CORNER_STEP * round(z / CORNER_STEP)) <= CORNER_NOISE for z in zones]
    wrong = [z for z, w in zip(zones, whole, strict=True) if not w or z > LARGEST_CORNER]
    if wrong:
        yield ProgramIssue(
            "error",
            "corner-region",
            f"corner regions are written in whole mm up to {LARGEST_CORNER * 1e3:g}, got "
            f"{wrong[0] * 1e3:g} mm; change the zone, or write corners as CNT",
            section.name,
        )


def _speeds(section: Section, step: float) -> Iterator[ProgramIssue]:
    speeds = np.array([move.speed for move in section.moves if isinstance(move, LinearMove)])
    off = np.abs(np.round(speeds / step) * step / speeds - 1)
    if (off > ROUNDED_SPEED).any():
        yield ProgramIssue(
            "warning",
            "speed-step",
            f"speeds are written in whole {step * 1e3:.3g} mm/s, which changes "
            f"{speeds[off.argmax()] * 1e3:g} mm/s by {off.max():.1%}",
            section.name,
        )


def _postures(
    program: Program, name: str, moves: tuple[Move, ...], settings: FanucSettings
) -> Iterator[ProgramIssue]:
    """Check that the turns can be written, and that no straight move changes the letters."""
    q = np.array([move.q for move in moves])
    counted = turns(program.robot, q, settings)
    beyond = np.flatnonzero(((counted < FEWEST_TURNS) | (counted > MOST_TURNS)).any(axis=1))
    straight = np.array([not isinstance(move, JointMove) for move in moves])
    if len(posed := beyond[straight[beyond]]):
        yield ProgramIssue(
            "error",
            "turns",
            f"turns must lie between {FEWEST_TURNS} and {MOST_TURNS}, got "
            f"{', '.join(map(str, counted[posed[0]]))} of {settings.turns}",
            f"{name}, move {posed[0]}",
        )
    letters = np.array([words[:3] for words in posture(program.robot, q, settings)])
    changed = (letters[1:] != letters[:-1]).any(axis=1) & straight[1:]
    for k in (np.flatnonzero(changed) + 1).tolist():
        said = f"{' '.join(letters[k - 1])} to {' '.join(letters[k])}"
        yield ProgramIssue(
            "warning",
            "posture-change",
            f"the configuration changes from {said} in a straight move, which the controller may "
            "refuse",
            f"{name}, move {k}",
        )
