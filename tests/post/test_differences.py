"""Differences between programs: one change at a time, and one program in several languages."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import pose
from kerfpath import InputError, robot
from kerfpath.post import (
    ReadMove,
    ReadWait,
    build_program,
    differences,
    languages,
    not_compared,
    post,
    read_program,
    with_tips,
)
from programs import arc, frames, hand_plan

SETTINGS = {name: {"laser_output": 3} for name in ("fanuc", "inform", "krl")}
SETTINGS["val3"] = {"laser_output": "doLaser"}
"""What a language has no default for."""


@pytest.fixture(scope="module")
def program():
    arm = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    plans = [
        hand_plan(arc(f"hole {i}", radius=0.06 + 0.012 * i, count=12), arm, *frames())
        for i in range(3)
    ]
    return build_program(plans, name="parts", pierce_time=0.3, zone=3e-4)


def read_back(program, name):
    settings = languages()[name].settings(**SETTINGS.get(name, {}))
    read = read_program(post(program, name, settings), name, program.robot, settings)
    return with_tips(read, program.robot, program.T_flange_tip, program.T_base_part), settings


@pytest.fixture(scope="module")
def read(program):
    return read_back(program, "rapid")[0]


def found(a, b):
    """Differences by code; there and back they are as many."""
    there, back = ({each.code: each for each in differences(*pair)} for pair in ((a, b), (b, a)))
    other = {"added": "removed", "removed": "added"}
    assert {other.get(code, code): each.count for code, each in back.items()} == {
        code: each.count for code, each in there.items()
    }
    return there


def with_steps(read, change, section=0):
    """The program with the steps of a section changed by a function."""
    sections = list(read.sections)
    steps = change(list(sections[section].steps))
    sections[section] = replace(sections[section], steps=tuple(steps))
    return replace(read, sections=tuple(sections))


def with_moves(read, number, section=0, **changes):
    """The program with one move of a section changed."""

    def change(steps):
        k = steps.index(read.sections[section].moves[number])
        return [*steps[:k], replace(steps[k], **changes), *steps[k + 1 :]]

    return with_steps(read, change, section)


def test_a_program_is_the_same_as_itself_whatever_its_routines_are_called(read):
    assert differences(read, read) == []
    renamed = tuple(replace(each, name=f"x_{each.name}") for each in read.sections)
    assert differences(read, replace(read, sections=renamed)) == []
    assert not_compared(read, read) == []


def test_a_target_that_is_moved_or_turned_is_told_with_its_lines(read):
    move = read.sections[1].moves[6]
    T = move.T_part_tip @ pose([3e-4, 0, -4e-4])
    (one,) = found(read, with_moves(read, 6, section=1, T_part_tip=T, line=999)).values()
    assert (one.code, one.count) == ("targets", 1)
    assert one.message == "1 moved, by up to 0.5000 mm and 0.0000 deg"
    assert one.places == (move.place, f"{move.file}, line 999")
    assert str(one) == f"targets: {one.message}, at {move.place} / {move.file}, line 999"
    turned = move.T_part_tip @ pose([0, 0, 0], Rotation.from_rotvec([0, 2e-3, 0]).as_matrix())
    (one,) = found(read, with_moves(read, 6, section=1, T_part_tip=turned)).values()
    assert one.message == "1 moved, by up to 0.0000 mm and 0.1146 deg"


def test_all_targets_of_a_contour_moved_are_as_many(read):
    def shifted(steps):
        return [
            replace(step, T_part_tip=pose([0, 0, 3e-4]) @ step.T_part_tip)
            if isinstance(step, ReadMove) and step.kind != "joint" else step
            for step in steps
        ]  # fmt: skip

    (one,) = found(read, with_steps(read, shifted)).values()
    assert (one.code, one.count) == ("targets", 13)  # twelve nodes and the way back
    assert "0.3000 mm" in one.message


@pytest.mark.parametrize("number", [3, 7, 12])
def test_a_target_that_is_added_or_left_out_moves_no_other(read, number):
    move = read.sections[0].moves[number]
    (one,) = found(read, with_steps(read, lambda s: [x for x in s if x is not move])).values()
    assert (one.code, one.count, one.places) == ("removed", 1, (move.place,))
    half = replace(move, T_part_tip=pose([0.001, 0.002, 0]) @ move.T_part_tip)

    def add(steps):
        k = steps.index(move)
        return [*steps[:k], half, *steps[k:]]

    (one,) = found(read, with_steps(read, add)).values()
    assert (one.code, one.count) == ("added", 1)


@pytest.mark.parametrize(
    ("number", "changes", "code", "words"),
    [
        (5, {"speed": 0.2}, "speeds", "1 move, 100 mm/s in A and 200 mm/s in B"),
        (0, {"speed": 0.5}, "speeds", "1 move, 10.0% in A and 50.0% in B"),
        (5, {"zone": 0.0}, "zones", "1 move, 0.3 mm in A and a stop in B"),
        (1, {"switches": ()}, "switches", "laser on 0.02 s ahead in A and nothing in B"),
        (5, {"posture": (0, 0, 0, 9)}, "postures", "and 0 0 0 9 in B"),
        (5, {"kind": "circular"}, "kinds", "linear in A and circular in B"),
        (0, {"q": np.radians([0, 0, 0, 0, 3.0, 0])}, "joints", "1 moved, by up to"),
    ],
)
def test_what_else_a_move_says_is_compared(read, number, changes, code, words):
    (one,) = found(read, with_moves(read, number, **changes)).values()
    assert (one.code, one.count) == (code, 1)
    assert words in one.message
    assert one.places == (read.sections[0].moves[number].place,) * 2


def test_a_lead_time_and_a_wait_are_compared(read):
    move = read.sections[0].moves[1]
    later = tuple(replace(switch, lead_time=0.05) for switch in move.switches)
    assert list(found(read, with_moves(read, 1, switches=later))) == ["switches"]
    longer = [
        replace(s, time=0.5) if isinstance(s, ReadWait) else s for s in read.sections[0].steps
    ]
    (one,) = found(read, with_steps(read, lambda steps: longer)).values()
    assert (one.code, one.message) == ("waits", "1 move, 0.3 s in A and 0.5 s in B")
    none = [s for s in longer if not isinstance(s, ReadWait)]
    assert "0 s in B" in found(read, with_steps(read, lambda steps: none))["waits"].message


def test_contours_that_are_left_out_added_or_in_another_order_are_named(read):
    a, b, c = read.sections
    (one,) = found(read, replace(read, sections=(a, c))).values()
    assert (one.code, one.message) == ("removed", "1 contour left out in B: hole_1")
    twice = replace(read, sections=(a, b, c, replace(b, name="again")))
    (one,) = found(read, twice).values()
    assert (one.code, one.message) == ("added", "1 contour only in B: again")
    (one,) = found(read, replace(read, sections=(c, a, b))).values()
    assert one.code == "order"
    assert one.message.endswith("B has hole_2, hole_0, hole_1")


def test_a_contour_moved_far_is_the_same_by_its_name(read):
    def away(steps):
        return [
            replace(step, T_part_tip=pose([0, 0, 0.03]) @ step.T_part_tip)
            if isinstance(step, ReadMove) and step.kind != "joint" else step
            for step in steps
        ]  # fmt: skip

    (one,) = found(read, with_steps(read, away, section=2)).values()
    assert one.message.startswith("13 moved, by up to 30.0000 mm")


def test_frames_are_compared_where_both_say_them(read):
    moved = replace(read, T_base_part=pose([0, 0.012, 0]) @ read.T_base_part)
    (one,) = found(read, moved).values()
    assert one.message == "the part frame is 12.0000 mm and 0.0000 deg off"
    unsaid = replace(read, T_flange_tip=None)
    assert differences(read, unsaid) == []
    assert not_compared(read, unsaid) == ["the tool"]


def test_one_program_in_several_languages_is_the_same(program):
    # Not FANUC's: of an arm by another maker it does not know what moves axis 3.
    names = ("csv", "inform", "krl", "rapid", "ros", "val3")
    texts = {name: read_back(program, name) for name in names}
    for one, two in combinations(names, 2):
        (a, of_a), (b, of_b) = texts[one], texts[two]
        rules = [languages()[one].rules(of_a), languages()[two].rules(of_b)]
        codes = [each.code for each in differences(bare(a), bare(b), rules=rules)]
        without_lead = len({one, two} & {"inform", "val3"})
        assert codes == (["switches"] if without_lead == 1 else []), (one, two)


def test_a_path_in_joints_alone_needs_its_tips(program, read):
    joints = read_program(post(program, "ros"), "ros", program.robot)
    with pytest.raises(InputError, match="joints alone along its path; apply with_tips first"):
        differences(read, joints)
    bare = with_moves(read, 4, T_part_tip=None)
    with pytest.raises(InputError, match="neither a pose nor joints"):
        with_tips(bare, program.robot, program.T_flange_tip, program.T_base_part)


def bare(read):
    """Without the words of posture, which mean something else in another language."""
    for k in range(len(read.sections)):
        read = with_steps(read, lambda steps: [
            replace(s, posture=()) if isinstance(s, ReadMove) else s for s in steps
        ], section=k)  # fmt: skip
    return read
