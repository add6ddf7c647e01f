"""Lines of programs against the motion: each move and wait stands where its text says it."""

from dataclasses import replace

import numpy as np
import pytest
from tests.post.cases import CASES

from kerfpath.post import (
    JointMove,
    LinearMove,
    ProgramIssue,
    issue_lines,
    post_and_read,
    timed_lines,
    timetable,
)

READ = [case for case in CASES.values() if case.language.read is not None]
cases = pytest.mark.parametrize("case", READ, ids=str)


def written(case):
    """The golden program with limits, as times need them, and its text."""
    arm = case.program.robot
    program = replace(case.program, robot=arm.with_limits(acceleration=np.full(arm.joints, 9.0)))
    return program, post_and_read(program, case.name, case.settings)


@cases
def test_every_move_has_its_line_and_its_time(case):
    program, text = written(case)
    found = timed_lines(program, text.read)
    clock = timetable(program)
    moves = sum(isinstance(step, JointMove | LinearMove) for step, _ in clock)
    assert len(clock) >= len(found) >= moves
    for each in found:
        line = text.files[each.line.file].splitlines()[each.line.number - 1]
        assert line.strip()
        assert 0 <= each.begin <= each.end <= clock[-1][1]
    assert found[-1].end == clock[-1][1]
    assert (np.diff([each.end for each in found]) >= 0).all()


@cases
def test_moves_of_a_line_are_those_that_were_read_there(case):
    program, text = written(case)
    ends = {(e.line.file, e.line.number): e.end for e in timed_lines(program, text.read)}
    mine = dict(zip(map(id, program.moves), text.read.moves, strict=True))
    for step, end in timetable(program):
        if isinstance(step, JointMove | LinearMove):
            read = mine[id(step)]
            # Several moves may stand on one line, of which the last one counts.
            assert ends[read.file, read.line] >= end


@cases
def test_an_issue_stands_at_its_move_and_one_of_the_program_at_no_line(case):
    program, text = written(case)
    section = program.sections[0]
    places = [f"{section.name}, move 1", section.name, "program", f"{section.name}, step 0"]
    issues = [ProgramIssue("warning", "code", "message", place) for place in places]
    move, whole, none, step = issue_lines(issues, program, text.read)
    read = text.read.moves
    assert move == (read[1].file, read[1].line)
    assert none is None
    assert whole == step
    assert whole is not None


def test_a_line_of_rapid_is_the_move_that_it_says():
    case = CASES["rapid"]
    program, text = written(case)
    for each in timed_lines(program, text.read):
        line = text.files[each.line.file].splitlines()[each.line.number - 1].strip()
        assert line.startswith(("Move", "Trigg", "WaitTime"))
