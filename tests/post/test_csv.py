"""Programs as a table: written, read back, and for any robot."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from kerfpath import InputError
from kerfpath.post import (
    Comment,
    post,
)
from kerfpath.transfer import least_time
from programs import (
    arced,
    changed,
    codes,
    five_axis_program,
    text_of,
    with_steps,
)

CASE = CASES["csv"]
TABLE = "cut_skin_outer.csv"
GOLDEN = CASE.golden[TABLE]


def table(source):
    return text_of(post(source, "csv"))


def same(program):
    CASE.reads_back(program)


def test_another_reader_of_csv_finds_the_planned_targets(program):
    """Digits: 1e-9 deg, 1e-10 m; the pose from the robot, not from the table's writer."""
    rows = list(csv.DictReader(table(program).splitlines()))
    moves = [row for row in rows if row["kind"] != "wait"]
    q = np.radians([[float(row[f"q{i}_deg"]) for i in range(1, 7)] for row in moves])
    np.testing.assert_allclose(q, [move.q for move in program.moves], atol=1e-9)
    T = program.T_base_part @ np.array([pose(row) for row in moves])
    planned = program.robot.forward(q) @ program.T_flange_tip
    np.testing.assert_allclose(T, planned, atol=1e-9)
    assert [row["events"] for row in moves][
        1
    ] == "gas on 0.2000 s ahead and laser on 0.0200 s ahead"


def pose(row):
    T = np.eye(4)
    wxyz = [float(row[f"q{c}"]) for c in "wxyz"]
    T[:3, :3] = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
    T[:3, 3] = [float(row[f"{c}_mm"]) * 1e-3 for c in "xyz"]
    return T


def test_times_are_those_planned(program):
    """A joint move takes its least time by its share of the speed; the rest as planned."""
    twice = replace(program, sections=(program.sections[0], replace(program.sections[0], name="b")))
    rows = list(csv.DictReader(table(twice).splitlines()))
    took = dict(zip(range(1, len(rows)), np.diff([float(row["t_s"]) for row in rows]), strict=True))
    steps = [step for step in twice.steps if not isinstance(step, Comment)]
    again = len(program.moves) + 1
    dq = twice.moves[len(program.moves)].q - twice.moves[len(program.moves) - 1].q
    least = least_time(dq[None], *program.robot.speed_limits())[0]
    assert took.pop(again) == pytest.approx(least / 0.1, abs=2e-9)
    planned = [getattr(step, "duration", getattr(step, "time", None)) for step in steps]
    for k, time in took.items():
        assert time == pytest.approx(planned[k], abs=2e-9)
    same(twice)


def test_an_arm_of_five_axes_has_five_columns():
    five = five_axis_program()
    same(five)
    assert "q5_deg,x_mm" in table(five).splitlines()[0]


def test_arcs_have_a_row_for_the_point_on_the_way(program):
    made = arced(program, [3])
    text = table(made)
    kinds = [row.split(",")[1] for row in text.splitlines()]
    assert kinds.index("via") + 1 == kinds.index("circular")
    wrong = re.sub(r"(,via,,(?:[-\d.]+,){6})-?\d", r"\g<1>7", text)
    assert CASE.deviations(made, {TABLE: wrong})


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"name": "Trajectory"}, "name-reserved"),  # a run of a job writes trajectory.csv
        ({"sections": ()}, "empty"),
    ],
)
def test_what_concerns_the_whole_program_is_refused(program, change, code):
    assert code in codes(replace(program, **change), "error", "csv")


def test_a_table_without_times_is_refused(program):
    limits = replace(program.robot.limits, acceleration=None)
    unknown = replace(program, robot=replace(program.robot, limits=limits))
    assert codes(unknown, "error", "csv") == ["joint-speed"]
    headless = with_steps(program, program.sections[0].steps[2:])
    assert codes(headless, "error", "csv") == ["start"]
    assert codes(changed(program, 5, duration=0.0), "error", "csv") == ["duration"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("q6_deg", "q7_deg", "line 1: expected the columns section,kind,t_s,"),
        (",linear,", ",straight,", "line 3: kind: expected joint, linear"),
        (",linear,", ",circular,", "line 3: an arc must follow the point on its way"),
        (",linear,", ",joint,", "line 3: a row of kind joint must not have the value"),
        (",joint,", ",via,", "line 2: a row of kind via must not have the value"),
        (",wait,", ",linear,", "expected a number with decimals, got ''"),
        ("0.800000000", "0.400000000", "the time runs backwards"),
        (",0.0000,", ",1e3,", "expected a number with decimals, got '1e3'"),
        ("laser on", "laser up", "not an event: 'laser up"),
        ("ahead and", "ahead,and", "fields, got"),
    ],
)
def test_the_reader_refuses_what_it_does_not_know(old, new, message):
    CASE.refuses(TABLE, old, new, message)


def test_the_reader_refuses_a_quaternion_that_is_none_and_sections_apart(program):
    text = re.sub(r"0\.\d{11},((?:-?\d\.\d{11},){3},)", r"0.900000000,\1", table(program))
    with pytest.raises(InputError, match="must have length 1"):
        CASE.read({TABLE: text})
    lines = GOLDEN.splitlines()
    lines[4] = lines[4].replace("skin_outer", "other", 1)
    with pytest.raises(InputError, match="'skin_outer' are not consecutive"):
        CASE.read({TABLE: "\n".join(lines)})
    with pytest.raises(InputError, match="line 1: expected the columns"):
        CASE.read({TABLE: ""})


@pytest.mark.parametrize(
    ("column", "off"),
    [("t_s", 0.01), ("q3_deg", 0.01), ("x_mm", 0.01), ("speed_mm_s", 0.01), ("zone_mm", 0.01)],
)
def test_an_edited_table_is_read_as_edited(program, column, off):
    lines = GOLDEN.splitlines()
    fields, at = lines[6].split(","), lines[0].split(",").index(column)
    fields[at] = f"{float(fields[at]) + off:.9f}"
    text = "\n".join([*lines[:6], ",".join(fields), *lines[7:]])
    assert CASE.deviations(program, {TABLE: text})


def test_every_move_has_a_row_of_its_own(program):
    lines = table(with_steps(program, [Comment("a,b"), *program.sections[0].steps])).splitlines()
    assert len(lines) == 2 + len(program.moves)
    assert all(line.count(",") == lines[0].count(",") for line in lines)
