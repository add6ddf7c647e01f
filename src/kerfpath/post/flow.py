"""The flow of control of a program, and what must hold on every path through it.

Readers turn the texts of all languages into the same few steps, so that the rules stand here once.
A path leaves the planned one where a partner does not answer in time, and may come back to it after
a pause, when the operator continues. Every path is followed, with the outputs that are on and the
answers that were given at each of its steps. The operator may also begin at another line, or go on
after everything went off.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from kerfpath.errors import InputError
from kerfpath.post.program import SIGNALS, Await, ProgramIssue, Request
from kerfpath.post.read_program import (
    FlowStep,
    ReadEnd,
    ReadHandshake,
    ReadJump,
    ReadLabel,
    ReadMove,
    ReadOff,
    ReadPause,
    ReadPower,
    ReadProgram,
    ReadSection,
    ReadStep,
    ReadWait,
)

# -----------------------------------------------------------------------------
# One routine: from each step to those that may follow.

State = frozenset[str]
"""The outputs that are on and the answers that were given."""
ALL_OFF = State()
LASER, POWER, ANSWER = "the laser", "the power", "the answer of "


def _output(name: str) -> str:
    return {"laser": LASER, "power": POWER}.get(name, f"the output of {name}")


class _Routine:
    """The steps of a routine or an error exit, and the ways between them."""

    def __init__(self, flow: Sequence[FlowStep]) -> None:
        self.flow = flow
        self.labels: dict[str, int] = {}
        for index, step in enumerate(flow):
            if isinstance(step, ReadLabel) and self.labels.setdefault(step.name, index) != index:
                raise InputError(f"{step.place}: the label {step.name} is given twice")
        for step in flow:
            if isinstance(step, ReadJump) and step.label not in self.labels:
                raise InputError(f"{step.place}: the label {step.label} is missing")

    def following(self, at: int, state: State) -> Iterator[tuple[int | str, State]]:
        """Yield the steps that may follow one, the planned one first, with the state there.

        A step is an index, or the name of an error exit of the program. Nothing follows an end.
        """
        match self.flow[at]:
            case ReadMove(kind="joint"):  # the way to another contour, which asks anew
                yield at + 1, _without_answers(state)
            case ReadMove(switches=switches):
                for switch in switches:
                    name = _output(switch.signal)
                    acts = all(_output(each) in state for each in switch.needs)
                    state = state | {name} if switch.on and acts else state - {name}
                yield at + 1, state
            case ReadEnd():
                return
            case ReadJump(label=label, partner=None):
                yield self.labels[label], state
            case ReadJump(label=label, partner=str(partner)):
                answered = ANSWER + partner in state
                yield self.labels[label] if answered else at + 1, state
            case ReadHandshake(what=Await(partner=partner, timeout=timeout), otherwise=otherwise):
                yield at + 1, state | {ANSWER + partner}
                if timeout < math.inf:
                    late = self.labels.get(otherwise, otherwise) if otherwise else at + 1
                    yield late, state - {ANSWER + partner}
            case ReadHandshake(what=Request(partner=partner, on=True)):
                yield at + 1, state | {_output(partner)}
            case ReadPower(share=share, per_speed=slope):
                yield at + 1, state | {POWER} if max(share, slope) > 0 else state - {POWER}
            case ReadHandshake(what=Request(partner=output)) | ReadOff(output=output):
                yield at + 1, _switched_off(state, output)
            case _:
                yield at + 1, state


def _switched_off(state: State, output: str) -> State:
    """Return the state without an output; what partners answered to a request holds no longer."""
    state -= {_output(output)}
    return state if output in SIGNALS else _without_answers(state)


def _without_answers(state: State) -> State:
    return frozenset(name for name in state if not name.startswith(ANSWER))


def section_of(name: str, flow: Sequence[FlowStep]) -> ReadSection:
    """Return a routine with its flow of control.

    Parameters
    ----------
    name : str
    flow : sequence of FlowStep
        All steps of the routine in the order of its text.

    Raises
    ------
    InputError
        A label is missing or given twice, or the routine does not end though every partner answers.
    """
    routine, steps, passed = _Routine(flow), list[ReadStep](), set[int]()
    ways: list[tuple[int | str, State]] = [(0, ALL_OFF)]
    while ways:
        at, state = ways[0]
        if at == len(flow) or not isinstance(at, int):
            break
        step = flow[at]
        if at in passed:
            raise InputError(f"{step.place}: the routine comes back to this line for ever")
        passed.add(at)
        if isinstance(step, ReadStep):
            steps.append(step)
        ways = list(routine.following(at, state))
    return ReadSection(name=name, steps=tuple(steps), flow=tuple(flow))


# -----------------------------------------------------------------------------
# The program: every path is followed.


@dataclass(frozen=True, slots=True)
class _Visit:
    """A step on a path: the routine by its number or the error exit by its name, and the index."""

    routine: int | str
    at: int
    state: State = ALL_OFF
    unanswered: tuple[str, ...] = ()
    """Places of the waits that ended without an answer."""


def unsafe_paths(program: ReadProgram) -> list[ProgramIssue]:
    """Return where a program is not safe on some path through it; empty if it is.

    The laser is off wherever the robot waits for a partner, moves by its joints, pauses or ends.
    Everything is off at a pause, and where the program ends for want of an answer. A path that
    comes back to the planned one finds the same outputs on and the same answers given: what was
    asked for before a pause is asked for again. Every motion belongs to the planned path. A contour
    that is begun at its first line has all that it needs, see `unsafe_restarts`.

    Parameters
    ----------
    program : ReadProgram
        Sections without flow of control are taken as their steps in order.

    Raises
    ------
    InputError
        A wait leads to a label that is missing.
    """
    machine = _Machine(program)
    issues = [*machine.issues, *machine.never_reached(), *machine.unsafe_beginnings()]
    queue, seen = deque(machine.branches), set[_Visit]()
    while queue:
        visit = queue.popleft()
        if (alike := replace(visit, unanswered=())) in seen:
            continue
        seen.add(alike)
        if found := list(machine.check(visit)):
            issues += found
        elif machine.planned.get((visit.routine, visit.at)) != visit.state:
            queue.extend(machine.following(visit))
    return issues


def unsafe_restarts(program: ReadProgram) -> list[ProgramIssue]:
    """Return where a program must not be begun or continued while everything is off.

    From there, the laser would come on without an output or an answer that it has on the planned
    path. Each issue has a stretch of lines, by the place of its first one.

    Parameters
    ----------
    program : ReadProgram
        As in `unsafe_paths`.

    Raises
    ------
    InputError
        A wait leads to a label that is missing.
    """
    return [
        ProgramIssue("warning", "restart", stretch.message, stretch.first)
        for stretch in _Machine(program).unsafe_stretches()
    ]


class _Stretch(NamedTuple):
    """Steps of the planned path from which the laser comes on without what it needs."""

    steps: tuple[tuple[int | str, int], ...]
    """Routine and index of each; the last one switches the laser on."""
    first: str
    last: str
    """File and line of both ends."""
    missing: State

    @property
    def message(self) -> str:
        """What happens if the program is begun there."""
        until = f" or later, up to {self.last}," if self.last != self.first else ""
        return (
            f"begun here{until} with everything off, the laser comes on without "
            f"{_listed(self.missing)}"
        )


def _switched_at(move: ReadMove) -> str:
    """Return the line that switches at the end of a move: its own, or one after it."""
    said = move.elsewhere.get("switches", move.place)
    return said if int(said.rpartition(" ")[2]) > move.line else move.place


class _Machine:
    """A program, the state at each step of its planned path, and the branches from it."""

    def __init__(self, program: ReadProgram) -> None:
        self.routines: dict[int | str, _Routine] = {
            number: _Routine(section.flow or section.steps)
            for number, section in enumerate(program.sections)
        }
        self.routines |= {name: _Routine(flow) for name, flow in program.exits.items()}
        self.planned: dict[tuple[int | str, int], State] = {}
        self.branches: list[_Visit] = []
        self.issues: list[ProgramIssue] = []
        ways = [_Visit(0, 0)] if program.sections else []
        while ways:
            visit, *others = ways
            self.branches += others
            self.planned[visit.routine, visit.at] = visit.state
            self.issues += self.check(visit)
            ways = list(self.following(visit))

    def step(self, visit: _Visit) -> FlowStep | None:
        """Return the step of a visit, None at the end of a routine."""
        flow = self.routines[visit.routine].flow
        return flow[visit.at] if visit.at < len(flow) else None

    def following(self, visit: _Visit) -> Iterator[_Visit]:
        """Yield the visits that may follow one, the planned one first."""
        step = self.step(visit)
        if step is None or isinstance(step, ReadEnd):
            ends = step is not None and step.of_program
            if not ends and isinstance(visit.routine, int) and visit.routine + 1 in self.routines:
                yield replace(visit, routine=visit.routine + 1, at=0)
            return
        ways = self.routines[visit.routine].following(visit.at, visit.state)
        for number, (at, state) in enumerate(ways):
            left = visit.unanswered if number == 0 else (*visit.unanswered, step.place)
            if isinstance(at, int):
                yield _Visit(visit.routine, at, state, left)
            elif at in self.routines:
                yield _Visit(at, 0, state, left)
            else:
                raise InputError(f"{step.place}: the label {at} is missing")

    def never_reached(self) -> Iterator[ProgramIssue]:
        """Yield an issue for the first motion of each routine that is not on the planned path."""
        for name, routine in self.routines.items():
            for at, step in enumerate(routine.flow):
                if isinstance(step, ReadMove) and (name, at) not in self.planned:
                    message = "the program never comes to this motion"
                    yield ProgramIssue("error", "flow", message, step.place)
                    break

    def unsafe_stretches(self) -> list[_Stretch]:
        """Return the steps after the one that gives what the laser needs, up to the laser itself.

        Stretches that begin with the same step are one.
        """
        path = [at for at in self.planned if self.step(_Visit(*at)) is not None]
        given: dict[str, int] = {}  # the step that gave what is on
        found: dict[int, tuple[int, State]] = {}
        for number, (routine, at) in enumerate(path):
            flow = self.routines[routine]
            before, step = self.planned[routine, at], flow.flow[at]
            _, after = next(flow.following(at, before), (0, ALL_OFF))
            _, gives = next(flow.following(at, ALL_OFF), (0, ALL_OFF))
            given = {name: given.get(name, number) for name in after}
            given |= dict.fromkeys(gives & after, number)
            if isinstance(step, ReadMove) and LASER in gives:
                earlier = {name: at for name, at in given.items() if at < number}
                if earlier:
                    begin = min(earlier.values()) + 1
                    missing = found.get(begin, (0, ALL_OFF))[1] | earlier.keys()
                    found[begin] = number, missing
        stretches = []
        for begin, (end, missing) in found.items():
            steps = tuple(path[begin : end + 1])
            first, laser = (self.routines[r].flow[at] for r, at in (steps[0], steps[-1]))
            assert isinstance(laser, ReadMove)
            stretches.append(_Stretch(steps, first.place, _switched_at(laser), missing))
        return stretches

    def unsafe_beginnings(self) -> Iterator[ProgramIssue]:
        """Yield an issue for each contour that must not even be begun at its first line."""
        for stretch in self.unsafe_stretches():
            for routine in (routine for routine, at in stretch.steps if at == 0):
                flow = self.routines[routine].flow
                move = next((step for step in flow if isinstance(step, ReadMove)), None)
                if move is not None and move.kind == "joint":
                    yield ProgramIssue("error", "flow", stretch.message, flow[0].place)

    def check(self, visit: _Visit) -> Iterator[ProgramIssue]:
        """Yield an issue for each rule that a step breaks in this state."""
        planned = self.planned.get((visit.routine, visit.at), visit.state)
        for wrong in _wrongs(self.step(visit), visit.state, planned):
            flow = self.routines[visit.routine].flow
            place = flow[min(visit.at, len(flow) - 1)].place if flow else "program"
            message = f"the program {wrong}"
            if visit.unanswered:
                message += f" after no answer at {' and '.join(visit.unanswered)}"
            yield ProgramIssue("error", "flow", message, place)


def _wrongs(step: FlowStep | None, state: State, planned: State) -> Iterator[str]:
    """Yield in words what is wrong with a step in a state; None is the end of a routine."""
    if POWER in state and isinstance(step, ReadMove) and step.kind == "joint":
        yield f"comes here with {POWER} on"
    on_path = isinstance(step, ReadMove) and step.kind != "joint"
    if LASER in state and not (
        on_path or isinstance(step, ReadWait | ReadPower | ReadLabel | ReadJump | ReadOff)
    ):
        yield f"comes here with {LASER} on"
    elif isinstance(step, ReadPause) or (isinstance(step, ReadEnd) and step.of_program):
        if outputs := [name for name in state if not name.startswith(ANSWER)]:
            yield f"stops here with {_listed(outputs)} on"
    elif state != planned and (step is None or isinstance(step, ReadStep)):
        if lacks := planned - state:
            yield f"goes on here without {_listed(lacks)}"
        if beyond := state - planned:
            yield f"goes on here with {_listed(beyond)}"


def _listed(names: Iterable[str]) -> str:
    return " and ".join(sorted(names))
