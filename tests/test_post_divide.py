"""Long programs in parts."""

from dataclasses import replace

import numpy as np

from kerfpath import robot
from kerfpath.post import JointMove, Program, Section, divided, in_files


def program(*lengths):
    arm = robot("abb_irb4600_60_205")
    sections = [
        Section(
            name=f"a_long_name_of_a_contour_{number}",
            steps=tuple(JointMove(q=np.full(6, k * 0.01), speed=1.0) for k in range(length)),
        )
        for number, length in enumerate(lengths)
    ]
    frames = {"T_flange_tip": np.eye(4), "T_base_part": np.eye(4)}
    return Program(name="whole", robot=arm, sections=tuple(sections), **frames)


def test_sections_are_divided_in_order_without_loss():
    whole = program(7, 0, 3, 10)
    parts = divided(whole, 3)
    assert [len(section.steps) for section in parts.sections] == [3, 3, 1, 0, 3, 3, 3, 3, 1]
    assert parts.steps == whole.steps
    assert divided(whole, 100).sections == whole.sections


def test_parts_have_names_of_their_own_within_the_longest():
    whole = program(5, 5)
    names = [section.name for section in divided(whole, 2, longest_name=8).sections]
    assert names == ["a_long_n", "a_long_2", "a_long_3", "a_long_4", "a_long_5", "a_long_6"]
    clash = replace(whole, name="a_long_n")
    assert divided(clash, 9, longest_name=8).sections[0].name == "a_long_2"


def test_files_hold_as_many_sections_as_fit():
    sections = program(1, 1, 1, 1, 1).sections
    files = in_files(sections, [40, 50, 20, 200, 10], 100)
    assert [[s.name[-1] for s in file] for file in files] == [["0", "1"], ["2"], ["3"], ["4"]]
    assert in_files((), [], 10) == []
