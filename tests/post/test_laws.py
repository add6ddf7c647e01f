"""Laws that hold in every language: what is read back is what was planned, and nothing else."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES, kinds_of

from conftest import rebuilt
from kerfpath import InputError, robot
from kerfpath.post import Comment, JointMove, ReadMove, ReadWait, build_program, post
from programs import arc, arced, hand_plan, with_steps


def cases(*names, without=()):
    """Run a test in some languages; default: in all but some."""
    chosen = [CASES[name] for name in names or CASES if name not in without]
    return pytest.mark.parametrize("case", chosen, ids=str)


ARMS_WITH_AXES = ("rapid", "krl", "fanuc", "inform", "val3")
"""Languages that say the axes of a controller."""
OUTPUTS = ("rapid", "krl", "fanuc", "inform", "val3", "urscript", "linuxcnc")
"""Languages that name outputs."""


# The text.


@cases()
def test_the_golden_program_is_written_byte_for_byte(case):
    files = case.post(case.program)
    assert files == case.golden
    assert list(files) == list(case.golden)
    assert case.codes(case.program, "error") == []


@cases()
def test_the_golden_program_is_plain_text_in_short_lines(case):
    for text in case.golden.values():
        assert text.count("\n") == text.count(case.new_line)
        rows = text.split(case.new_line)
        assert all(re.fullmatch(rf"[\t -~]{{0,{case.width}}}", row) for row in rows)
        assert not any(row.endswith(" ") for row in rows if case.name != "fanuc")


@cases()
def test_the_same_plans_give_the_same_bytes(case):
    again = hand_plan(case.small.contour, *case.cell, speed=0.12)
    assert case.post(case.built([again])) == case.post(case.program)


# The law: what is read back is what was planned.


@cases()
def test_the_golden_program_reads_back_as_planned(case):
    program = case.program
    _, read = case.reads_back(program)
    assert read.name.lower() == program.name
    for what in ("T_flange_tip", "T_base_part"):
        if (T := getattr(read, what)) is not None:
            np.testing.assert_allclose(T, getattr(program, what), atol=1e-7)
    ahead = case.language.sayable or (lambda program, settings: program)
    for ours, move in zip(ahead(program, case.settings).moves, read.moves, strict=True):
        assert move.kind == ("joint" if isinstance(ours, JointMove) else "linear")
        assert move.speed is None or move.speed == pytest.approx(ours.speed, abs=1e-5)
        assert move.zone == (None if move.zone is None else pytest.approx(ours.zone, abs=1e-9))
        assert ours.zone > 0 or move.zone == 0, "a stop is one in every language"
        leads = [s.lead_time for s in getattr(ours, "switches", ())]
        assert [s.lead_time for s in move.switches] == pytest.approx(leads, abs=6e-4)
    waits = [step.time for step in read.steps if isinstance(step, ReadWait)]
    assert waits == pytest.approx([time for time in [case.build.get("pierce_time")] if time])


@cases()
def test_the_golden_program_has_what_it_is_compared_by(case):
    """One joint move to the start, the path, and a switch on and off."""
    _, read = case.reads_back(case.program)
    assert [move.kind for move in read.moves] == ["joint"] + ["linear"] * 9
    switched = [s.on for move in read.moves for s in move.switches if s.signal == "laser"]
    assert switched == ([True, False, True, False] if case.kinds else [True, False])


@cases()
def test_the_laser_is_off_along_micro_joints(case):
    """Switched on the fly where the language can, else where the robot stands."""
    contour = replace(arc(), kind=kinds_of("iccmmcoo"))
    lead_time = 0.01 if case.language.ahead else 0.0
    plan = hand_plan(contour, *case.cell, speed=0.12)
    program = build_program([plan], lead_time=lead_time)
    flying = case.language.ahead or case.flying
    if not flying:
        assert case.codes(program) == ["stop-to-switch", "air-moves"]
    _, read = case.reads_back(program)
    on, switched, moving = False, [], []
    for move in read.moves:
        switched.append(on)
        moving += [move.zone != 0] * len(move.switches)
        on = move.switches[-1].on if move.switches else on
    assert switched == [False, False, True, True, True, False, False, True, True, False]
    assert moving == [False, flying, flying, False]


@cases(without=["ros", "linuxcnc"])
@pytest.mark.parametrize("numbers", [[3], [3, 5], [1]])
def test_arcs_read_back_alone_one_after_the_other_and_first(case, numbers):
    program = arced(case.program, numbers)
    _, read = case.reads_back(program)
    arcs = [k for k, move in enumerate(read.moves) if move.kind == "circular"]
    assert len(arcs) == len(numbers)
    for k in arcs:
        expected = program.moves[k].T_part_via
        np.testing.assert_allclose(read.moves[k].T_part_via, expected, atol=2e-6)


@cases()
@pytest.mark.parametrize("number", range(8))
def test_words_follow_the_posture_in_all_eight_postures(case, number):
    """The kernels' postures are an independent account of front/rear, elbow and wrist.

    Behind axis 1 the elbow of the kernels changes its sense, the side of the lower arm does not.
    """
    planned = case.in_posture(number)
    rear, down, minus = number // 4, number // 2 % 2, number % 2
    for turns in case.windings:
        made = replace(planned, q=planned.q + 2 * np.pi * turns * np.eye(6)[5])
        _, read = case.reads_back(build_program([made], lead_time=0.0))
        path = [move.posture for move in read.moves if move.kind == "linear"]
        assert {words[slice(*case.said)] for words in path[:-1]} == {case.words(rear, down, minus)}
        if (start := read.moves[0].q) is not None:
            solved = made.robot.inverse(made.robot.forward(start), within_limits=False)
            nearest = np.abs(np.sin((solved.q - start) / 2)).max(axis=1).argmin()
            assert solved.posture[nearest] == number


@cases(without=["krl", "inform"])
@pytest.mark.parametrize("turns", [-2, -1, 1, 2])
def test_turns_of_the_last_joint_are_written_and_read(case, turns):
    far = np.array([6.0, 6.0, 6.0, 6.0, 6.0, 99.0])
    program = replace(case.program, robot=case.cell[0].with_limits(lower=-far, upper=far))
    by = 2 * np.pi * turns * np.eye(6)[5]
    steps = [replace(s, q=s.q + by) if hasattr(s, "q") else s for s in program.sections[0].steps]
    _, read = case.reads_back(with_steps(program, steps))
    np.testing.assert_allclose(read.moves[0].q, case.program.moves[0].q + by, atol=1e-6)


@cases()
def test_several_contours_are_called_in_order(case):
    names = ("skin/outer", "skin outer", "7. Bohrung ø12", "hole" * 12)
    plans = [hand_plan(arc(name), *case.cell) for name in names]
    program = build_program(plans, name="B-pillar 4711")
    assert program.name == "B_pillar_4711"
    _, read = case.reads_back(program)
    found = [section.name.lower() for section in read.sections]
    expected = ["skin_outer", "skin_outer_2", "c_7_bohrung_12", "hole" * 12]
    if case.name == "inform":
        expected = [name for own in expected for name in (f"{own}_air", own)]
        assert found[:-2] == expected[:-2]
        assert len(found) == len(expected)
        return
    longest = case.language.rules(case.settings).longest_name
    assert found == [name[: min(longest, 32)] for name in expected]


# Axes.


@cases(*ARMS_WITH_AXES)
def test_an_arm_described_otherwise_has_the_same_axes(case):
    """Signs, zeros and flange of a description change; what the controller shows does not."""
    arm, module = case.cell[0], case.module
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("z", 40, degrees=True).as_matrix()
    zeros = arm.offset + np.radians([10, 20, 30, 40, 50, 60])
    other = rebuilt(arm, sign=-arm.sign, offset=zeros, T_end_flange=arm.T_end_flange @ turned)
    q = np.random.default_rng(5).uniform(-1, 1, (20, 6))
    axes = module.axes_from_joints(arm, q)
    same = module.joints_from_axes(other, axes)
    np.testing.assert_allclose(module.axes_from_joints(other, same), axes, atol=1e-14)
    np.testing.assert_allclose(module.joints_from_axes(arm, axes), q, atol=1e-14)
    np.testing.assert_allclose(other.forward(same), arm.forward(q) @ turned, atol=1e-12)
    words = [case.language.posture(each, joints, case.settings) for each, joints in
             ((other, same), (arm, q))]  # fmt: skip
    assert words[0] == words[1]


# Settings and preflight.


@cases()
def test_every_setting_says_what_it_expects(case):
    kind = case.language.settings
    for name, setting in kind.model_fields.items():
        assert setting.description, name
        assert setting.examples, name
        with pytest.raises(ValidationError):
            kind(**{name: -1})


@cases(*OUTPUTS)
def test_settings_of_a_dialect_inherit_the_ports(case):
    kind = case.language.settings
    own = type("Own", (kind,), {"__annotations__": {"macro": str}, "macro": "x"})
    assert list(own.model_fields) == [*kind.model_fields, "macro"]
    assert own(**case.options).model_dump() == {**case.settings.model_dump(), "macro": "x"}


@cases(*OUTPUTS)
def test_what_is_switched_has_an_output_of_its_own(case):
    program = build_program([case.small], gas_lead=0.3, lead_time=0.0)
    laser = case.settings.laser_output
    for gas in (None, laser):
        wired = case.settings.model_copy(update={"gas_output": gas})
        assert case.codes(program, "error", wired) == ["output"]
    assumed = case.language.assumed.get("laser_output", laser)
    unnamed = {"laser_output": None} if case.language.assumed else {}
    wired = case.settings.model_copy(update={"gas_output": assumed, **unnamed})
    assert case.codes(program, "error", wired) == ["output"], "nor is it the one assumed"


@cases(*OUTPUTS[:-1])
def test_robots_of_another_kind_or_maker(case):
    program = case.program
    other = replace(program, robot=replace(program.robot, manufacturer="another"))
    assert "wrong-robot" in case.codes(other, "warning")
    case.post(other)
    with pytest.raises(InputError, match=r"is by another"):
        post(other, case.name, case.settings, strict=True)
    strange = robot("abb_irb4600_60_205" if case.name == "urscript" else "ur_ur10e")
    assert "wrong-arm" in case.codes(replace(program, robot=strange), "error")


RESERVED = {
    "krl": ["Loop"],
    "fanuc": ["PNS0001", "rsr12", "con", "End"],
    "inform": ["master"],
    "val3": ["start", "stop", "pPath"],
    "urscript": ["movel", "Thread", "get_inverse_kin", "sin", "p", "laser_set"],
    "rapid": ["Reset", "v100"],
}
OUR_OWN = ("pPath", "laser_set")


@pytest.mark.parametrize(("case", "name"), [(c, n) for c, names in RESERVED.items() for n in names])
def test_preflight_refuses_names_of_the_controller_and_of_our_own_data(case, name):
    section = replace(CASES[case].program.sections[0], name=name)
    code = "name-collision" if name in OUR_OWN else "name-reserved"
    named = replace(CASES[case].program, sections=(section,))
    assert CASES[case].codes(named, "error") == [code]


# The reader.


@pytest.mark.parametrize(
    ("case", "file"), [(case, file) for case in CASES.values() for file in [*case.golden][1:]],
    ids=str,
)  # fmt: skip
def test_a_missing_file_is_said(case, file):
    files = {name: text for name, text in case.golden.items() if name != file}
    with pytest.raises(InputError, match=re.escape(f"the file '{file}' is missing")):
        case.read(files)


NASTY = st.text(max_size=60) | st.sampled_from(
    [
        'a";StopMove;!', "x\nENDPROC\nPROC y()", "\u2028ENDMODULE", "\r\nSetDO doLaser,1;",
        "%main%", "a;b", "!UFRAME 1 X 5.0000", "x" * 31 + " UTOOL 1 X 5.0000 ;", '"', "'",
        "\r\n/END\r\n", "]", "x\nEND", "'UFRAME 1 X 0.0000", "a 'UFRAME 1 X 0.0000 b" * 3,
        "\r\nDOUT OT#(1) ON", "/JOB", "]]></Code>", "x\nend\nbegin", "<!-- -->", "&lt;",
        '"/><Data', "\r\n dioLaser=true", "FOLD", "# x\nend",
    ]
)  # fmt: skip


@cases()
@settings(max_examples=60)
@given(name=NASTY, model=NASTY, remark=NASTY)
def test_no_text_of_a_person_becomes_a_line_of_the_program(case, name, model, remark):
    """Names of contours and robots are identifiers and comments, whatever they hold."""
    made = replace(
        case.small,
        contour=replace(case.small.contour, name=name),
        robot=replace(case.small.robot, model=model, id=model),
    )
    odd = case.built([made])
    odd = with_steps(odd, [Comment(remark), *odd.sections[0].steps])
    if refused := case.codes(odd, "error"):
        assert set(refused) <= {"name-reserved", "name-collision"}
        return
    files = case.post(odd)
    assert len(files) == len(case.golden)
    for text, expected in zip(files.values(), case.golden.values(), strict=True):
        assert all(re.fullmatch(r"[\t -~]*", line) for line in text.splitlines())
        ours, theirs = (
            [case.bare(line) for line in part.splitlines() if not re.match(case.comment, line)]
            for part in (text, expected)
        )
        assert len(ours) == len(theirs)
        differing = [a for a, b in zip(ours, theirs, strict=True) if a != b]
        assert all(re.fullmatch(case.naming, line) for line in differing), differing
    read = case.read(files, odd.robot)
    assert [step for step in read.steps if not isinstance(step, ReadMove | ReadWait)] == []
    assert len(read.moves) == len(odd.moves)
