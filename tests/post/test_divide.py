"""Long programs in several files: divided between contours, never inside one."""

import re

import numpy as np
import pytest
from tests.post.cases import ARMS

from kerfpath import InputError, robot
from kerfpath.post import (
    JointMove,
    LinearMove,
    Program,
    Section,
    Switch,
    Wait,
    divide_sections,
    language,
    post,
    preflight,
    rename_sections,
)


def program(*lengths, arm="abb_irb4600_60_205"):
    """Contours of so many nodes each, along a line, with gas, a pierce and the way back."""
    arm = robot(arm)
    tool = np.eye(4)
    tool[2, 3] = 0.3
    bent = {"Universal Robots": [0, -100, 100, -90, -90, 0], "KUKA": [0, -90, 90, 0, 60, 0]}
    bent |= {"Staubli": [0, 30, 90, 0, 60, 0]}
    start = np.radians(bent.get(arm.manufacturer, [0.0, 0.0, 0.0, 0.0, 60.0, 0.0]))
    tip = arm.forward(start) @ tool
    on, off = (
        (
            Switch(signal="gas", on=state, lead_time=0.1 if state else 0.0),
            Switch(signal="laser", on=state, lead_time=0.02),
        )
        for state in (True, False)
    )

    def move(x, zone=0.0, switches=()):
        T = tip.copy()
        T[:3, 3] += [0.0, x, 0.0]
        q = arm.arm.follow(T[None] @ np.linalg.inv(tool), start[None], branch(arm, start))[0]
        return LinearMove(T_part_tip=T, q=q, speed=0.1, duration=0.01, zone=zone, switches=switches)

    def contour(number, nodes):
        inner = [move(1e-3 * (k + 11), zone=1e-4) for k in range(nodes)]
        return Section(
            name=f"a_long_name_of_contour_{number}",
            steps=(
                JointMove(q=start, speed=0.5),
                move(0.01, switches=on),
                Wait(time=0.3),
                *inner,
                move(1e-3 * (nodes + 11), switches=tuple(reversed(off))),
                move(1e-3 * (nodes + 21)),
            ),
        )

    sections = [contour(number, nodes) for number, nodes in enumerate(lengths)]
    frames = {"T_flange_tip": tool, "T_base_part": np.eye(4)}
    return Program(name="whole", robot=arm, sections=tuple(sections), **frames)


def branch(arm, q):
    """The posture of a joint vector, as `follow` wants it."""
    solved, _ = arm.arm.inverse_all(arm.forward(q)[None])
    apart = np.abs((solved[0] - q + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    return np.array([int(np.nanargmin(apart))])


BEAM = {
    "rapid": (r"Trigg[LC].*trOn", r"Trigg[LC].*trOff"),
    "krl": (r"TRIGGER.*OUT\[1\]=TRUE", r"TRIGGER.*OUT\[1\]=FALSE"),
    "fanuc": (r"[LC] P.*DO\[1\]=ON", r"[LC] P.*DO\[1\]=OFF"),
    "val3": (r" dioLaser=true", r" dioLaser=false"),
    "inform": (r"DOUT OT#\(1\) ON", r"DOUT OT#\(1\) OFF"),
    "urscript": (r" laser_set\(True\)", r" laser_set\(False\)"),
}
"""Lines that switch the beam on and off, by what a person looks for in the text."""
BORDER = re.compile(
    r"\b(Load|UnLoad|ENDPROC|PROC|MODULE|WaitDI|SetDO|StopMove|DEF|END|WAIT FOR|CALL|call|begin|"
    r"end\]\]|def|halt|NOP|PAUSE|RETURN|return|movej|MOVJ|MoveAbsJ|PTP)\b|:J P"
)
"""Where a file or routine begins or ends, or the motion may stop, in any of the languages."""
SETTINGS = {
    "rapid": {"gas_output": "doGas"},
    "val3": {"laser_output": "a", "gas_output": "b"},
    "urscript": {"laser_output": 0, "gas_output": 2},
}


def settings(name, lines):
    known = SETTINGS.get(name, {"laser_output": 1, "gas_output": 2})
    return language(name).settings(lines_per_file=lines, **known)


def cuts_with_borders(name, files):
    """How often the beam is switched on, and lines of borders that come while it is on."""
    on, off = BEAM[name]
    cuts, borders = 0, []
    for file, text in files.items():
        beam = False
        for number, line in enumerate(text.splitlines(), 1):
            if beam and re.search(off, line):
                beam = False
            elif beam and BORDER.search(line):
                borders.append((file, number, line))
            elif re.search(on, line):
                cuts, beam = cuts + 1, True
        if beam:
            borders.append((file, number, "the end of the file"))
    return cuts, borders


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("lengths", [(3, 3), (40, 45, 50), (10, 300, 10), (95, 96, 97, 98), (500,)])
@pytest.mark.parametrize("lines", [100, 137, 250, 9999])
def test_no_border_of_a_file_or_routine_lies_inside_a_contour(name, lengths, lines):
    """The beam is off wherever a routine or file begins or ends; or the program is refused."""
    made, options = program(*lengths, arm=ARMS[name][0]), settings(name, lines)
    too_long = max(lengths) + 5 > lines or (name == "inform" and 2 * max(lengths) + 30 > lines)
    if name in ("fanuc", "inform") and too_long:
        with pytest.raises(InputError, match=r"not divided.*lines_per_file"):
            post(made, name, options)
        return
    whole = post(made, name, settings(name, 9999))
    if name == "urscript" and whole["whole.script"].count("\n") > lines:
        with pytest.raises(InputError, match=r"lines_per_file allows"):
            post(made, name, options)
        return
    files = post(made, name, options)
    cuts, borders = cuts_with_borders(name, files)
    assert cuts == len(lengths)
    assert borders == []


@pytest.mark.parametrize("name", ARMS)
def test_the_law_finds_a_border_that_is_put_into_a_contour(name):
    """What it looks for is there to be found: each kind of call, in the middle of a cut."""
    files = post(program(20, arm=ARMS[name][0]), name, settings(name, 9999))
    (file,) = [f for f, text in files.items() if re.search(BEAM[name][0], text)]
    lines = files[file].splitlines()
    first = next(k for k, line in enumerate(lines) if re.search(BEAM[name][0], line))
    call = {"rapid": 'UnLoad "x";', "krl": "END", "val3": "call x()"}.get(name, "CALL JOB:X")
    call = "  def x():" if name == "urscript" else call
    broken = {**files, file: "\n".join([*lines[: first + 5], call, *lines[first + 5 :]])}
    assert len(cuts_with_borders(name, broken)[1]) == 1


@pytest.mark.parametrize("name", ["rapid", "krl", "val3"])
def test_a_contour_longer_than_a_file_has_its_own_and_is_warned_of(name):
    made, options = program(10, 300, 10, arm=ARMS[name][0]), settings(name, 100)
    found = [issue for issue in preflight(made, name, options) if issue.code == "file-length"]
    assert [issue.level for issue in found] == ["warning"]
    assert "lines_per_file" in found[0].message


def test_names_are_cut_and_stay_different():
    whole = program(5, 5)
    names = [section.name for section in rename_sections(whole, longest_name=8).sections]
    assert names == ["a_long_n", "a_long_2"]
    taken = rename_sections(whole, ("A_Long_N",), longest_name=8)
    assert taken.sections[0].name == "a_long_2"
    assert taken.steps == whole.steps


def test_files_hold_as_many_sections_as_fit():
    sections = program(1, 1, 1, 1, 1).sections
    files = divide_sections(sections, [40, 50, 20, 200, 10], 100)
    assert [[s.name[-1] for s in file] for file in files] == [["0", "1"], ["2"], ["3"], ["4"]]
    assert divide_sections((), [], 10) == []
