"""Handshakes, what an interruption switches off, and where a program begins again."""

import re

import numpy as np
import pytest
from tests.post.cases import ASKING, refusal

from kerfpath import InputError, robot
from kerfpath.post import (
    Await,
    Comment,
    ReadHandshake,
    Request,
    Wait,
    build_program,
    deviations,
    differences,
    dry_run,
    language,
    post,
    preflight,
    read_program,
    with_tips,
)
from programs import arc, codes, frames, hand_plan, with_steps

ASKED = (
    Request(partner="shutter", on=True),
    Request(partner="height", on=True),
    Await(partner="ready", timeout=4.0),
    Await(partner="interlock", timeout=0.5),
)
PORTS = {
    "laser_output": 1, "gas_output": 2, "shutter_output": 3, "height_output": 4,
    "ready_input": 5, "interlock_input": 6,
}  # fmt: skip


def program(name="rapid", contours=("one",), **options):
    arm, place = ASKING[name]
    tool, placement = frames()
    placement[:3, 3] = place
    limits = {"acceleration": np.radians([500] * 6)} if name == "linuxcnc" else {}  # it says times
    arm = robot(arm).with_limits(**limits)
    plans = [hand_plan(arc(each), arm, tool, placement) for each in contours]
    return build_program(plans, gas_lead=0.2, pierce_time=0.1, lead_time=0.0, **options)


def settings(name, ports=PORTS):
    words = {"rapid": "x{}", "val3": "x{}"}
    own = {k: words[name].format(v) if name in words else v for k, v in ports.items()}
    return language(name).settings(**own)


def test_partners_are_asked_before_the_way_down_and_released_after_the_way_back():
    made = program(handshakes=ASKED)
    kinds = [type(step).__name__ for step in made.steps]
    first = kinds.index("LinearMove")
    assert made.steps[first - 4 : first] == ASKED
    released = [Request(partner=partner, on=False) for partner in ("height", "shutter")]
    assert list(made.steps[-2:]) == released
    assert len(made.steps) == len(program().steps) + 6


@pytest.mark.parametrize("name", ASKING)
def test_every_language_reads_its_handshakes_back(name):
    made, options = program(name, handshakes=ASKED), settings(name)
    files = post(made, name, options)
    read = read_program(files, name, made.robot, options)
    assert deviations(made, read, language(name), options) == []
    found = [step.what for step in read.steps if isinstance(step, ReadHandshake)]
    assert found == [step for step in made.steps if isinstance(step, Request | Await)]
    without = post(program(name), name, options)
    other = read_program(without, name, made.robot, options)
    frames = made.robot, made.T_flange_tip, made.T_base_part
    found = {each.code for each in differences(*(with_tips(one, *frames) for one in (read, other)))}
    assert found == ({"handshakes"} if name == "inform" else {"handshakes", "switches"})


NEEDS = {
    "rapid": (
        "IF DOutput(x2)=1 AND DOutput(x3)=1 AND DOutput(x4)=1 SetDO x1,1;",
        " AND DOutput(x{})=1",
    ),
    "krl": ("$OUT[1]=$OUT[2] AND $OUT[3] AND $OUT[4]", " AND $OUT[{}]"),
    "fanuc": ("IF (DO[2] AND DO[3] AND DO[4]),DO[1]=(ON) ;", " AND DO[{}]"),
    "val3": ("dioLaser=dioGas and doShutter and doHeight", " and do{}"),
    "linuxcnc": ("o<laser_with> call [18] [19] [20] [20]", " [{}]"),
    "urscript": (
        "laser_set(get_standard_digital_out(2) and get_standard_digital_out(3) and "
        "get_standard_digital_out(4))",
        " and get_standard_digital_out({})",
    ),
}
"""The line that switches the laser on, and one of the outputs that it needs."""


@pytest.mark.parametrize("name", NEEDS)
def test_the_laser_goes_on_only_with_gas_and_requests(name):
    made, options = program(name, handshakes=ASKED), settings(name)
    files = post(made, name, options)
    line, needed = NEEDS[name]
    (file,) = [f for f, text in files.items() if line in text]
    ports = {"val3": ("Shutter", "Height"), "linuxcnc": (19, 20)}.get(name, (3, 4))
    edits = [line.replace(needed.format(port), "") for port in ports]
    edits += [line.replace(needed.format(ports[1]), needed.format(ports[0]))]
    edits += [line.replace("x4" if name == "rapid" else "4", "x1" if name == "rapid" else "1")]
    for edited in edits:
        if edited != line:
            assert refusal(files | {file: files[file].replace(line, edited)}, name, made, options)


def test_a_laser_with_a_lead_time_needs_them_too_and_the_robot_waits_for_it():
    made = program("krl", handshakes=ASKED)
    plans = [hand_plan(arc("one"), made.robot, *frames())]
    led = build_program(plans, lead_time=0.05, gas_lead=0.2, pierce_time=0.1, handshakes=ASKED)
    switches = [s for move in led.moves for s in getattr(move, "switches", ())]
    assert [(s.signal, s.on, s.lead_time, s.needs) for s in switches] == [
        ("gas", True, 0.2, ()),
        ("laser", True, 0.0, ("gas", "shutter", "height")),
        ("laser", False, 0.05, ()),
        ("gas", False, 0.0, ()),
    ]
    assert [step.time for step in led.steps if isinstance(step, Wait)] == [pytest.approx(0.15)]


EDITS = {
    "rapid": [(r"x5,1\\MaxTime:=4.000", r"x5,1\MaxTime:=9.000"), ("SetDO x3,1", "SetDO x3,0")],
    "krl": [("$TIMER[20]=-4000", "$TIMER[20]=-9000"), ("$OUT[3]=TRUE", "$OUT[3]=FALSE")],
    "fanuc": [("$WAITTMOUT=400", "$WAITTMOUT=900"), ("DO[3]=ON", "DO[3]=OFF")],
    "val3": [("diReady==true,4.000", "diReady==true,9.000"), ("doShutter=true", "doShutter=false")],
    "linuxcnc": [("[5] [4.000]", "[5] [9.000]"), ("  M64 P3", "  M65 P3")],
    "inform": [("IN#(5)=ON T=4.00", "IN#(5)=ON T=9.00"), ("OT#(3) ON", "OT#(3) OFF")],
    "urscript": [
        ("await_input(5, 4.000)", "await_input(5, 9.000)"),
        ("_out(3, True)", "_out(3, False)"),
    ],
}


ASK_AGAIN = ("krl", "val3", "inform")
"""Languages whose programs make their requests again after a pause, so that they must be the same
there."""


@pytest.mark.parametrize(("name", "number"), [(name, k) for name in ASKING for k in (0, 1)])
def test_an_edited_handshake_is_found(name, number):
    made, options = program(name, handshakes=ASKED), settings(name)
    old, new = EDITS[name][number]
    old = old.replace("\\\\", "\\")
    files = post(made, name, options)
    (file,) = [f for f, text in files.items() if old in text]
    edited = files | {file: files[file].replace(old, new, 1)}
    if number == 1 and name in ASK_AGAIN:
        with pytest.raises(InputError, match="expected"):
            read_program(edited, name, made.robot, options)
        return
    read = read_program(edited, name, made.robot, options)
    assert len(deviations(made, read, language(name), options)) == 1


NO_ANSWER = {
    "rapid": ("    switchOff;\n    StopMove;\n", "    StopMove;\n"),
    "krl": ("$OUT[1]=FALSE\r\n$OUT[2]=FALSE\r\n$OUT[3]=FALSE\r\n$OUT[4]=FALSE\r\nHALT", "HALT"),
    "fanuc": ("DO[1]=OFF ;\r\n", "DO[2]=OFF ;\r\n"),
    "val3": (
        "  dioLaser=false\n  dioGas=false\n  doShutter=false",
        "  dioGas=false\n  doShutter=false",
    ),
    "inform": ("DOUT OT#(1) OFF\r\nDOUT OT#(2) OFF\r\nDOUT OT#(3)", "DOUT OT#(3)"),
    "urscript": ("    set_standard_digital_out(1, False)\n", ""),
    "linuxcnc": ("  M65 P1\n  M65 P2\n", "  M65 P2\n"),
}


@pytest.mark.parametrize("name", ASKING)
def test_without_an_answer_everything_is_switched_off_which_the_reader_requires(name):
    made, options = program(name, handshakes=ASKED), settings(name)
    files = post(made, name, options)
    old, new = NO_ANSWER[name]
    changed = [file for file, text in files.items() if old in text]
    assert changed
    for file in changed:
        with pytest.raises(InputError, match=r"line \d+: (expected|the settings|.* is missing)"):
            read_program(files | {file: files[file].replace(old, new)}, name, made.robot, options)


@pytest.mark.parametrize("name", ASKING)
def test_a_partner_needs_an_input_of_its_own(name):
    made = program(name, handshakes=ASKED)
    unnamed = settings(name, {"laser_output": 1, "gas_output": 2})
    assert codes(made, "error", name, unnamed).count("handshake") == 4
    assert "handshake" not in codes(made, "error", name, settings(name))
    twice = settings(name, PORTS | {"shutter_output": 1, "interlock_input": 5})
    assert codes(made, "error", name, twice).count("handshake") == 2


@pytest.mark.parametrize("name", ["csv", "ros"])
def test_a_trajectory_cannot_wait(name):
    found = preflight(program(handshakes=ASKED), name)
    said = [issue.message for issue in found if issue.code == "handshake"]
    assert len(said) == 4
    assert all("leave it out" in text for text in said)


def test_handshakes_belong_where_the_robot_stands_with_the_laser_off():
    made = program(handshakes=ASKED[2:])
    steps = list(made.steps)
    for place in (5, 7):  # behind the start, where the laser is on, and on the way
        moved = with_steps(made, [*steps[:place], ASKED[2], *steps[place:]])
        assert "handshake" in codes(moved, "error", "rapid", settings("rapid"))
    endless = with_steps(made, [*steps[:3], Await(partner="ready", timeout=0.0), *steps[3:]])
    assert "handshake" in codes(endless, "error", "rapid", settings("rapid"))


def test_a_number_in_a_remark_is_no_number_of_the_program():
    made = program("urscript")
    remarked = with_steps(made, [Comment("1E100"), *made.steps])
    post(remarked, "urscript", settings("urscript"))
    text = post(made, "urscript", settings("urscript"))["cut_one.script"]
    large = {"cut_one.script": text.replace("sleep(0.100)", "sleep(1E100)")}
    with pytest.raises(InputError, match="larger than any number of a program"):
        read_program(large, "urscript", made.robot, settings("urscript"))


def test_a_dry_run_asks_nobody():
    slow = dry_run(program(handshakes=ASKED), 0.5)
    assert not any(isinstance(step, Request | Await) for step in slow.steps)


OFF = {
    "rapid": (r"PROC switchOff\(\)\n(.*?)\n  ENDPROC", r"SetDO (x\d),0;"),
    "krl": (r"DEF switch_off\(\)\r\n(.*?)END", r"\$OUT\[(\d)\]=FALSE"),
    "fanuc": (r"BG logic \(SETUP\) ;\r\n(.*?)/POS", r"IF \(!UO\[3\]\),DO\[(\d)\]=\(OFF\)"),
    "val3": (r'"stop".*?begin\n(.*?)end', r"(do?io?\w+|do\w+)=false"),
    "inform": (r"NAME CUT_ONE_OFF\r\n.*?NOP\r\n(.*?)END", r"DOUT OT#\((\d)\) OFF"),
    "linuxcnc": (r"G93\n(.*?)\no<", r"M65 P(\d)"),
    "urscript": (r"first_contour = 1\n(.*?)\n  global", r"digital_output_to_value\((\d), 1\)"),
}


@pytest.mark.parametrize("name", ASKING)
def test_what_runs_at_a_stop_switches_off_all_that_the_program_switches_on(name):
    files = post(program(name, handshakes=ASKED), name, settings(name))
    block, line = OFF[name]
    (found,) = [m for text in files.values() for m in re.findall(block, text, re.DOTALL)][:1]
    off = set(re.findall(line, found))
    assert len(off) == 4, "laser, gas, shutter, height"


BEGIN = {
    "rapid": "nFirst:=1;\n\n",
    "krl": "first_contour=1",
    "val3": '<Value key="0" value="1" />',
    "urscript": "global first_contour = 1",
}


@pytest.mark.parametrize("name", BEGIN)
def test_a_program_begins_at_the_contour_that_it_names(name):
    made, options = program(name, ("one", "two", "three")), settings(name)
    files = post(made, name, options)
    old = BEGIN[name]
    (file, *_) = [f for f, text in reversed(files.items()) if old in text]
    for number, names in (("2", ["two", "three"]), ("3", ["three"])):
        new = (
            old.replace("1", number)
            if name != "val3"
            else old.replace('value="1"', f'value="{number}"')
        )
        edited = files | {file: files[file].replace(old, new, 1)}
        read = read_program(edited, name, made.robot, options)
        assert [section.name for section in read.sections] == names
    wrong = files | {file: files[file].replace(old, old.replace("1", "4"), 1)}
    with pytest.raises(InputError):
        read_program(wrong, name, made.robot, options)


@pytest.mark.parametrize("name", ["fanuc", "inform"])
def test_each_contour_is_a_program_that_can_be_started_alone(name):
    """It selects its frames itself, and its first motion is to joints or a position with a type."""
    files = post(program(name, ("one", "two")), name, settings(name))
    for contour in ("ONE", "TWO"):
        if name == "fanuc":
            text = files[f"{contour}.ls"]
            assert text.index("UFRAME_NUM=1") < text.index("UTOOL_NUM=1") < text.index("J P[1]")
        else:
            text = files[f"{contour}_AIR.JBI"]
            assert "///USER 1" in text
            assert "///RCONF" in text


@pytest.mark.parametrize("name", ASKING)
def test_the_move_at_which_a_contour_may_be_begun_is_slow(name):
    """It goes nowhere if the robot comes from the contour before."""
    made = program(name, ("one", "two", "three"))
    here = None
    for section in made.sections:
        first, *_, last = section.moves
        assert (first.speed, first.duration) == (0.1, None)
        assert here is None or (first.q == here).all()
        here = last.q
    assert {section.moves[1].speed == 0.1 for section in made.sections[1:]} == {False}
    read = read_program(post(made, name, settings(name)), name, made.robot, settings(name))
    assert [s.moves[0].speed for s in read.sections if s.moves[0].kind == "joint"] == (
        pytest.approx([0.1] * 3, abs=1e-4)
    )
    slower = program(name, ("one", "two"), start_speed=0.02, air_speed=0.5)
    assert [s.moves[0].speed for s in slower.sections] == [0.02] * 2
    assert slower.sections[1].moves[1].duration is None or slower.sections[1].moves[1].speed > 0.02
    slow = program(name, ("one", "two"), air_speed=0.05)
    assert [s.moves[0].speed for s in slow.sections] == [0.05] * 2


FASTER = {
    "rapid": (".mod", "vAir1,", "vAir2,"),
    "krl": (".src", "BAS(#VEL_PTP,10)", "BAS(#VEL_PTP,100)"),
    "fanuc": ("TWO.ls", "J P[1] 10%", "J P[1] 100%"),
    "val3": ("two.pgx", "mAir[0]", "mAir[1]"),
    "inform": ("TWO_AIR.JBI", "C00000 VJ=10.00", "C00000 VJ=100.00"),
    "urscript": (".script", "v=0.209440", "v=2.094395"),
}


@pytest.mark.parametrize("name", FASTER)
def test_a_contour_that_would_be_begun_fast_is_found(name):
    made, (end, old, new) = program(name, ("one", "two")), FASTER[name]
    files = post(made, name, settings(name))
    (file,) = [file for file in files if file.endswith(end)]
    text, _, after = files[file].rpartition(old)
    found = refusal(files | {file: f"{text}{new}{after}"}, name, made, settings(name))
    assert "the speed is" in found
    assert "expected 10.0%" in found
