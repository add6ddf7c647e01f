"""The power along programs, by the speed that the tip really has in each move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from kerfpath.arrays import Array, Bools, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.execution.executed import run_along, timing_of
from kerfpath.post import (
    LinearMove,
    PowerBySpeed,
    Program,
    ProgramOptions,
    ReadMove,
    Section,
    SetPower,
    Step,
    Switch,
    Wait,
)
from kerfpath.robots import Robot

SHORTEST = 1e-9
"""Least time (s) of a move."""
EVERY = 2e-3
"""Time (s) between two samples of LinuxCNC's motion."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExecutedSpeeds:
    """The speed of the tip in m moves, as they are executed.

    Parameters
    ----------
    mean : (m,) m/s
        In each move.
    s : (k,) m
        Length of the way at samples, from 0 at the start.
    speed : (k,) m/s
        The speed there.
    """

    mean: Array
    s: Array
    speed: Array

    __repr__ = short_repr


def executed_speeds(
    moves: Sequence[LinearMove],
    robot: Robot,
    options: ProgramOptions,
    *,
    T_base_part: Array,
    T_flange_tip: Array,
) -> ExecutedSpeeds:
    """Return the speed of the tip in each of m moves, as they are executed.

    From stop to stop, the robot runs at the programmed speeds where the limits of the joints allow
    them, from rest and to rest, see `timing_of`; LinuxCNC as the model of its planner says. The lag
    of the joints is left out. In a table, moves take their planned times.

    Parameters
    ----------
    moves : sequence of LinearMove
        The move to where the robot stands, then the m moves.
    robot : Robot
    options : ProgramOptions
        With the language, whose controller runs the path.
    T_base_part, T_flange_tip : (4, 4) m

    Raises
    ------
    InputError
        The limits of the robot are not known, or the posture does not reach the path.
    """
    spoken, settings = options.robot_language, options.language_settings
    planned = np.array([move.duration for move in moves[1:]])
    programmed = np.array([move.speed for move in moves[1:]])
    ways, took = programmed * planned, planned.copy()
    at = np.append(0.0, np.cumsum(ways))
    samples: list[tuple[Array, Array]] = []
    stops = [0, *(k for k, move in enumerate(moves) if k > 0 and move.zone == 0)]
    stops += [] if stops[-1] == len(moves) - 1 else [len(moves) - 1]
    for first, last in pairwise(stops):
        begin, end = at[first], at[last]
        if spoken.motion is not None:
            q = np.array([move.q for move in moves[first : last + 1]])
            made = spoken.motion(robot, q, planned[first:last], settings, EVERY)
            took[first:last] = made.took
            tip = (robot.forward(made.q) @ T_flange_tip)[:, :3, 3]
            steps = np.linalg.norm(np.diff(tip, axis=0), axis=1)
            gone = np.append(0.0, np.cumsum(steps))
            speed = np.append(steps, 0.0) / EVERY
        elif spoken.zones and last - first > 1:
            run = run_along(
                moves[first : last + 1],
                robot,
                T_base_part=T_base_part,
                T_flange_tip=T_flange_tip,
                controller=options.rules.controller,
                bounded=False,
            )
            timing, ends = timing_of(run), run.tool_motion.time
            took[first:last] = np.diff(np.interp(ends, timing.time, timing.clock))
            k = np.clip(np.searchsorted(ends, timing.time, side="right") - 1, 0, last - first - 1)
            gone, speed = timing.length, timing.share * (ways[first:last] / np.diff(ends))[k]
        else:
            gone = np.repeat(at[first : last + 1], 2)[1:-1] - begin
            speed = np.repeat(programmed[first:last], 2)
        samples.append((begin + gone / max(float(gone[-1]), SHORTEST) * (end - begin), speed))
    s, speed = (np.concatenate(each) for each in zip(*samples, strict=True))
    mean = ways / np.maximum(took, SHORTEST)
    return ExecutedSpeeds(mean=freeze(mean), s=freeze(s), speed=freeze(speed))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerAlong:
    """The power along a cut of m moves.

    Parameters
    ----------
    s : (m+1,) m
        Length of the way up to the target of each move, from 0 at the start.
    speed : (m,)
        Executed speed in each move, as a share of the highest programmed one.
    asked : (m,)
        Share of the full power by that speed.
    set : (m,)
        Share of the full power that the program sets.
    lit : (m,) bool
        Whether the laser is on; it is off along micro joints.
    fine_s, fine_speed, fine_asked : (k,) m
        Length of the way at samples, and speed and power by it there, as shares.
    in_steps : bool
        Whether the program sets the power in steps, or the controller by the speed.
    """

    s: Array
    speed: Array
    asked: Array
    set: Array
    lit: Bools
    fine_s: Array
    fine_speed: Array
    fine_asked: Array
    in_steps: bool = True

    __repr__ = short_repr

    @property
    def switches(self) -> int:
        """How often the program changes the power within the cut."""
        if not self.in_steps:
            return 0
        return int((np.diff(self.set) != 0).sum())

    @property
    def difference(self) -> float:
        """Largest difference of the power from what is asked in a move with the laser on."""
        return float(np.abs(self.set - self.asked)[self.lit].max(initial=0.0))

    @property
    def mean_difference(self) -> float:
        """Mean difference from the power by the speed at every place, along the lit way."""
        steps, middle = np.diff(self.fine_s), (self.fine_s[1:] + self.fine_s[:-1]) / 2
        asked = (self.fine_asked[1:] + self.fine_asked[:-1]) / 2
        k = np.clip(np.searchsorted(self.s, middle, side="right") - 1, 0, len(self.set) - 1)
        off = np.abs(self.set[k] - asked) if self.in_steps else np.zeros(len(k))
        weight = steps * self.lit[k]
        return float((off * weight).sum() / max(float(weight.sum()), SHORTEST))


def power_along(program: Program, section: Section, options: ProgramOptions) -> PowerAlong | None:
    """Return the power along a cut of a program; None if the program does not set it.

    Raises
    ------
    InputError
        As `executed_speeds`.
    """
    law = options.of(section.contour).power
    if law is None:
        return None
    moves = [move for move in section.moves if isinstance(move, LinearMove)][:-1]
    speed = executed_speeds(
        moves,
        program.robot,
        options,
        T_base_part=program.T_base_part,
        T_flange_tip=program.T_flange_tip,
    )
    share, fine = shares_of(moves, speed.mean), shares_of(moves, speed.speed)
    ways = [move.speed * move.duration for move in moves[1:]]
    lit = lit_of(moves)
    in_steps = law.follows == "steps"
    given = _beside_switches(law.steps(share), lit) if in_steps else law.proportional * share
    return PowerAlong(
        s=freeze(np.append(0.0, np.cumsum(ways))),
        speed=freeze(share),
        asked=freeze(law.at(share)),
        set=freeze(given),
        lit=lit,
        fine_s=speed.s,
        fine_speed=freeze(fine),
        fine_asked=freeze(law.at(fine)),
        in_steps=in_steps,
    )


def lit_of(moves: Sequence[LinearMove | ReadMove]) -> Bools:
    """Return whether the laser is on in each of m moves, after the approach, the first of them."""
    on, found = False, []
    for move in moves:
        found.append(on)
        for switch in move.switches:
            on = switch.on if switch.signal == "laser" else on
    return np.array(found[1:], dtype=np.bool_)


def _beside_switches(power: Array, lit: Bools) -> Array:
    """Return the power in moves, changed inside micro joints and not where the laser is switched.

    Some controllers set one output at a target. The power is changed where it has no effect.
    """
    found = power.copy()
    for k in np.flatnonzero(~lit).tolist():
        after = np.flatnonzero(lit[k:])
        begins = k > 0 and lit[k - 1]
        found[k] = found[k - 1] if begins or not after.size else power[k + after[0]]
    return found


def shares_of(moves: Sequence[LinearMove], speed: Array) -> Array:
    """Return executed speeds (m,) m/s as shares of the speed that a cut of m moves is made at.

    Arguments are those and the result of `executed_speeds`. The highest programmed speed counts as
    full speed: where the program reduces it, the power falls, too.
    """
    full = max(move.speed for move in moves[1:])
    return np.asarray(np.clip(speed / full, 0.0, 1.0))


def with_power(program: Program, options: ProgramOptions) -> Program:
    """Return the program with the power by the executed speed, if its options ask for it.

    Before the approach, with the laser off, the power is set to that of the pierce; behind the
    pierce, and at targets, to the step of each move; and to 0 before the tool backs off.

    Parameters
    ----------
    program : Program
        As `build_program` returns it.
    options : ProgramOptions

    Raises
    ------
    InputError
        The language cannot set the power along the path; or as `executed_speeds`.
    """
    sections = []
    for section in program.sections:
        law = options.of(section.contour).power
        if law is None:
            return program
        if why := options.robot_language.power_refusal(law.follows) or law.refusal():
            raise InputError(why)
        sections.append(_with_power(program, section, law, options))
    return replace(program, sections=tuple(sections))


def _with_power(
    program: Program, section: Section, law: PowerBySpeed, options: ProgramOptions
) -> Section:
    along = power_along(program, section, options)
    assert along is not None
    approach, *cut, retract = (move for move in section.moves if isinstance(move, LinearMove))
    powers = dict(zip(cut, along.set.tolist(), strict=True))
    after = dict(pairwise([*cut, None]))
    stages = [share for share, _ in options.of(section.contour).pierce]
    by_controller = law.follows == "controller"
    lead = options.lead_time if options.robot_language.ahead else 0.0
    slope = law.proportional / max(move.speed for move in cut)
    now = (stages or [0.0 if by_controller else powers[cut[0]]])[0]
    later = iter(stages[1:])
    waits = 0
    steps: list[Step] = []
    for step in section.steps:
        if step is approach:
            steps.append(SetPower(share=now))
        elif isinstance(step, Wait):
            waits += 1
            share = next(later, now) if waits > 1 else now
            steps += [SetPower(share=share)] if share != now else []
            now = share
        elif step is cut[0] and by_controller:
            steps.append(SetPower(share=0.0, per_speed=slope, lead_time=lead))
        elif step is cut[0] and now != powers[cut[0]]:
            now = powers[cut[0]]
            steps.append(SetPower(share=now))
        elif step is retract:
            steps.append(SetPower(share=0.0))
        other = None if by_controller or not isinstance(step, LinearMove) else after.get(step)
        if isinstance(step, LinearMove) and other is not None and powers[other] != now:
            now = powers[other]
            change = Switch(signal="power", on=now > 0, lead_time=lead, share=now)
            step = replace(step, switches=(*step.switches, change))
        steps.append(step)
    return replace(section, steps=tuple(steps))
