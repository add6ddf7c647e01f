"""States that another program may have left are set at the start, and by nothing else."""

import re
from functools import cache

import pytest
from tests.post.cases import ASKING, CASES, refusal, renumbered
from tests.post.test_handshakes import ASKED, program, settings

from kerfpath.post import language, post

FOREIGN = {
    "rapid": (
        "VelSet 50,5000;", "AccSet 20,20;", "AccSet 100,20;", "PathAccLim TRUE\\AccMax:=1,FALSE;",
        "WorldAccLim \\On:=3;", "PDispOn *,tLaser;", "PDispSet pose1;", "EOffsOn *;", "ConfL\\On;",
        "ConfJ\\On;", "SingArea\\LockAxis4;", "SoftAct 1,50;", "SpeedRefresh 50;", "CorrClear;",
        "MotionSup\\Off;", "TuneServo ROB_1,1,50;", "GripLoad load1;",
    ),
    "krl": (
        "$OV_PRO=50", "$OV_PRO=0", "BAS(#ACC_PTP,20)", "BAS(#INITMOV,0)", "BAS(#ACC_CP,1)",
        "$ACC.CP=1", "$ADVANCE=0", "$IPO_MODE=#TCP", "$ORI_TYPE=#CONSTANT", "$CIRC_TYPE=#PATH",
        "$VEL.ORI1=1.0", "$APO.CPTP=0", "$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", "BAS(#TOOL,2)",
        "BAS(#BASE,2)", "$VEL_AXIS[1]=5", "$ACC_AXIS[1]=5", "$RED_VEL=10",
    ),
    "fanuc": (
        "OVERRIDE=50%", "OVERRIDE=R[1]", "UFRAME_NUM=2", "UTOOL_NUM=2", "OFFSET CONDITION PR[1]",
        "TOOL_OFFSET CONDITION PR[2]", "COL DETECT OFF", "SOFTFLOAT[1]", "LINEAR_MAX_SPEED=100",
        "JOINT_MAX_SPEED=10", "PAYLOAD[2]", "UFRAME[1]=PR[1]", "UTOOL[1]=PR[1]",
        "$MCR.$GENOVERRIDE=50",
    ),
    "inform": (
        "SFTON P001", "SFTON C00001 UF#(1)", "SPEED VJ=10.00", "SPEED V=10.0", "SFTON P001 BF",
        "SHCKSET R1 200", "FLOATON", "CNVRT", "SETTOOL TL#(1) P001", "MFRAME UF#(1)",
    ),
    "val3": (
        "setMonitorSpeed(50)", "setMonitorSpeed(0)", "setFrame(pPath[0],pPath[1],pPath[2],fPart)",
        "fPart.trsf.x=1", "tLaser.trsf.z=1", "mPath[0].vel=10", "mAir[0].accel=10",
        "autoConnectMove(true)", "setPayload(tLaser,5)", "setVelCmd(10)",
    ),
    "urscript": (
        "force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,5,0,0,0], 2, [0,0,0,0,0,0])",
        "freedrive_mode()", "set_tcp(p[0, 0, 0, 0, 0, 0])", "global part_frame = p[0,0,0,0,0,0]",
        "set_gravity([0, 0, 9.82])", "path_offset_enable()", "track_conveyor_linear(p[1,0,0], 500)",
        "set_standard_analog_out(0, 0.5)",
    ),
    "linuxcnc": (
        "G20", "G91", "G94", "G95", "G18", "G7", "G41 D1", "G43 H1", "G43.1 Z1", "G54", "G52 X1",
        "G92 X1", "G10 L2 P9 X1", "#5381=1", "M50 P1", "M48", "M51 P0", "M52 P1", "G10 L1 P1 Z1",
        "G28.1", "G61", "G64", "G64 P1", "M68 E0 Q1", "F100", "T1 M6",
    ),
}  # fmt: skip
"""Statements that leave another state, by language."""
REMARKED = {
    "rapid": ("! {}",), "krl": ("; {}", ";FOLD {}"), "fanuc": ("//{}", "! {}"),
    "inform": ("'{}", "COMM {}"), "val3": ("// {}",), "urscript": ("# {}", "$ 1 # {}"),
    "linuxcnc": ("; {}", "({})"),
}  # fmt: skip
MOTION = {
    "rapid": r"\s*(?:Move|Trigg)[A-Z]", "krl": r"\s*(?:PTP|LIN|CIRC) ", "fanuc": r"\s*\d+:[JLC] P",
    "inform": r"MOV[JLC]", "val3": r"\s*mov[ejlc]+\(", "urscript": r"\s*mov[ejlc]+\(",
    "linuxcnc": r"\s*(?:G53 )?G1 ",
}  # fmt: skip
CALL = {
    "rapid": r"\s*IF nFirst", "krl": r"\s*IF first_contour", "fanuc": r"\s*\d+:  CALL",
    "inform": "CALL JOB:", "val3": r"\s*if nFirst", "urscript": r"\s*if first_contour",
    "linuxcnc": r"o<(?:one|two)> call",
}  # fmt: skip
SWAPPED = {
    r"\Off": (r"\On",), "FALSE": ("TRUE",), "#BASE": ("#TCP",), "#VAR": ("#CONSTANT", "#JOINT"),
    "Off;": ("On;",), "SFTOF": ("SFTOFF", "SFTOF3D", "SFTON P001"), "Soft": ("Hard",),
    "vmax": ("v100",), "end_": ("", "start_"), "INITMOV": ("EX_INI",), "ORI1": ("ORI2",),
}  # fmt: skip
"""Words of reset lines, and what may stand in their place."""


@cache
def case(name):
    """The program of two contours that wait for partners, its files, and its settings."""
    made, chosen = program(name, ("one", "two"), handshakes=ASKED), settings(name)
    return made, post(made, name, chosen), chosen


def resets(name):
    return [line for state in language(name).inherited(case(name)[2]) for line in state.lines]


def changed(line):
    """The line with every other value that each of its numbers and words may have."""
    for number in re.finditer(r"\d+(?:\.\d+)?", line):
        for value in {"0", "1", "20", "50", "99", "101"} - {number[0]}:
            yield line[: number.start()] + value + line[number.end() :]
    for word, others in SWAPPED.items():
        for other in others:
            if word in line:
                yield line.replace(word, other, 1)
    yield line + line[-1]


def edits(name):
    """Each edit of the program in a language, as what it is and the files."""
    _, files, _ = case(name)
    for file, text in files.items():
        rows = text.split("\n")
        statements = [_bare(name, row) for row in rows]
        at = {line: statements.index(line) for line in resets(name) if line in statements}
        motion = [k for k, row in enumerate(rows) if re.match(MOTION[name], row)]
        called = [k for k, row in enumerate(rows) if re.match(CALL[name], row)]
        after = [*called[1:], *(k + 1 for k in motion)]
        later = [*called[:1], *motion, *after]
        for line, k in at.items():
            rest = [*rows[:k], *rows[k + 1 :]]
            yield f"{file}: {line} removed", _with(files, file, rest)
            for other in changed(line):
                edited = [*rows[:k], rows[k].replace(line, other), *rows[k + 1 :]]
                yield f"{file}: {other}", _with(files, file, edited)
            for mark in REMARKED[name]:
                edited = [*rows[:k], _row(name, rows[k], mark.format(line)), *rows[k + 1 :]]
                yield f"{file}: {mark.format(line)}", _with(files, file, edited)
            for place in after:
                moved = [*rest[: place - 1], rows[k], *rest[place - 1 :]]
                yield f"{file}: {line} moved to {place}", _with(files, file, moved)
            for place in later:
                for other in list(changed(line))[:3]:
                    more = [*rows[:place], _row(name, rows[k], other), *rows[place:]]
                    yield f"{file}: {other} at {place}", _with(files, file, more)
        for line in FOREIGN[name]:
            for place in [*(k + 1 for k in at.values()), *later]:
                more = [*rows[:place], _row(name, rows[place - 1], line), *rows[place:]]
                yield f"{file}: {line} at {place}", _with(files, file, more)


def _bare(name, row):
    row = re.sub(r"^ *\d+:", "", row) if name == "fanuc" else row
    return row.rstrip("\r").removesuffix(" ;").strip()


def _row(name, like, statement):
    """A row with a statement, that ends as another row does."""
    end = "\r" if like.endswith("\r") else ""
    return (
        f"   1:  {statement} ;{end}"
        if name == "fanuc"
        else f"  {statement}{end}".lstrip(" " if name in ("inform",) else "")
    )


def _with(files, file, rows):
    text = "\n".join(rows)
    return {**files, file: renumbered(text) if file.endswith(".ls") else text}


def passing(name, every=1):
    """How many edits were tried, and those that are accepted."""
    made, files, chosen = case(name)
    tried, found = 0, []
    for what, edited in edits(name):
        tried += 1
        if tried % every == 0 and edited != files and not refusal(edited, name, made, chosen):
            found.append(what)
    return tried, found


@pytest.mark.parametrize("name", ASKING)
def test_the_program_as_written_sets_every_state(name):
    made, files, chosen = case(name)
    assert refusal(files, name, made, chosen) == ""
    for line in resets(name):
        assert any(_bare(name, row) == line for text in files.values() for row in text.split("\n"))


@pytest.mark.parametrize("name", ASKING)
def test_an_edit_of_an_inherited_state_is_refused(name):
    tried, found = passing(name, every=11)
    assert tried > 30
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ASKING)
def test_every_edit_of_an_inherited_state_is_refused(name):
    assert passing(name)[1] == []


@pytest.mark.parametrize("name", [n for n in ASKING if "override" in dict(CASES[n].settings)])
def test_the_override_of_the_operator_is_kept_if_asked_for(name):
    made, _, chosen = case(name)
    kept = chosen.model_copy(update={"override": "operator"})
    files = post(made, name, kept)
    assert refusal(files, name, made, kept) == ""
    assert refusal(files, name, made, chosen)
    assert not re.search(r"OVERRIDE=|OV_PRO|setMonitorSpeed", "".join(files.values()))
