"""Staubli VAL 3: the projects that are written, how they read back, and what is refused."""

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from conftest import rebuilt
from kerfpath import InputError, robot
from kerfpath.post import (
    build_program,
    post,
    preflight,
    read_program,
    write_files,
)
from kerfpath.post.arcs import world
from kerfpath.post.val3 import (
    Val3,
    Val3Settings,
    axes_from_joints,
    configurations,
    joints_from_axes,
    posture,
)
from kerfpath.robots import robot_ids
from programs import arc, arced, changed, hand_plan

NAME = "cut_skin_outer"
PARTS = (f"{NAME}.pjx", f"{NAME}.dtx", "start.pgx", "stop.pgx", "skin_outer.pgx")
CASE = CASES["val3"]
OUTPUTS, golden, found_codes = CASE.settings, CASE.golden, CASE.codes


def reads_back(program, options=OUTPUTS):
    """Write and read back, and look at the files alone."""
    files, read = CASE.reads_back(program, options)
    declares_what_it_uses(files)
    return files, read


ARMS = [name for name in robot_ids() if name.startswith("staubli")]
NAMESPACES = {suffix: f"http://www.staubli.com/robotics/VAL3/{space}" for suffix, space in (
    (".pjx", "Project/3"), (".dtx", "Data/2"), (".pgx", "Program/2"))}  # fmt: skip


def declares_what_it_uses(files):
    """Check by another parser: namespaces, files, sizes, and that every used datum is there."""
    roots = {name: ET.fromstring(text) for name, text in files.items()}
    for name, root in roots.items():
        space = NAMESPACES[Path(name).suffix]
        assert {element.tag.partition("}")[0] for element in root.iter()} == {"{" + space}
    for name in (name for name in files if name.endswith(".pjx")):
        folder = name.rpartition("/")[0]
        own = [row.get("file") for row in roots[name].iter() if row.get("file")]
        assert {f"{folder}/{file}" for file in own} | {name} == {
            file for file in files if file.rpartition("/")[0] == folder
        }
        (data,) = (roots[f"{folder}/{file}"] for file in own if file.endswith(".dtx"))
        sizes = {}
        for datum in data[0]:
            assert [value.get("key") for value in datum] == [str(k) for k in range(len(datum))]
            assert datum.get("size") == str(len(datum))
            sizes[datum.get("name")] = len(datum)
        used = set()
        for file in (file for file in own if file.endswith(".pgx")):
            (program,) = roots[f"{folder}/{file}"]
            assert program.get("name") + ".pgx" == file
            code = re.sub(r"//.*", "", program[0].text)
            for datum, key in re.findall(r"\b([jmpftd]\w+)\[(\d+)\]", code):
                assert int(key) < sizes[datum]
            used |= set(re.findall(r"\b(?:dio|t|f)[A-Z]\w+", code))
        assert used <= sizes.keys()


# The files.


def test_a_project_becomes_a_folder(program, tmp_path):
    files = post(program, "val3", OUTPUTS)
    write_files(tmp_path, files)
    assert sorted(path.name for path in (tmp_path / NAME).iterdir()) == sorted(PARTS)
    there = {f"x/y/{k}": (tmp_path / k).read_text() for k in files}
    read = read_program(there, "val3", program.robot, OUTPUTS)  # wherever it lies
    assert read.name == NAME
    assert read.moves[1].place == f"x/y/{NAME}/skin_outer.pgx, line 7"


def test_outputs_are_switched_and_waits_begin_only_where_the_robot_stands(program):
    code = golden[f"{NAME}/skin_outer.pgx"].splitlines()
    stands = False
    for line in (line.strip() for line in code):
        stands = line == "waitEndMove()" or (stands and not line.startswith("move"))
        assert stands or not line.startswith(("dio", "delay"))
    assert code[-5].strip() == "dioGas=false"


def test_stop_switches_everything_off():
    stop = golden[f"{NAME}/stop.pgx"]
    assert stop.index("dioLaser=false") < stop.index("dioGas=false") < stop.index("resetMotion()")


def test_positions_are_rx_about_x_then_ry_about_y_then_rz_about_z(program):
    """The orientation of a point, turned together by hand from its text."""
    text = golden[f"{NAME}/{NAME}.dtx"]
    found = re.search(r'type="pointRx".*?rx="(.*?)" ry="(.*?)" rz="(.*?)"', text, re.DOTALL)
    x, y, z = np.radians([float(field) for field in found.groups()])
    Rx = [[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]]
    Ry = [[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]]
    Rz = [[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]]
    expected = program.moves[1].T_part_tip[:3, :3]
    np.testing.assert_allclose(np.array(Rx) @ Ry @ Rz, expected, atol=1e-7)  # six decimals of deg


def test_motions_that_are_alike_share_a_descriptor(cell):
    plans = [hand_plan(arc(name, count=30), *cell) for name in ("one", "two")]
    data = post(build_program(plans, zone=3e-4), "val3", OUTPUTS)["cut_one/cut_one.dtx"]
    assert data.count('blend="Cartesian"') == 1
    assert 'name="mPath" access="private" xsi:type="array" type="mdesc" size="2"' in data
    assert 'name="mAir" access="private" xsi:type="array" type="mdesc" size="2"' in data


def test_arcs_are_written_as_movec(program):
    files, _ = reads_back(arced(program, [3]))
    assert "movec(pPath[2],pPath[3],tLaser,mPath[1])" in files[f"{NAME}/skin_outer.pgx"]


def test_joint_moves_may_round_their_corners(program):
    _, read = reads_back(changed(program, 1, zone=0.02))
    assert read.moves[0].zone == pytest.approx(0.02)


def test_points_may_keep_the_configuration(program):
    same = OUTPUTS.model_copy(update={"configurations": "same"})
    files, read = reads_back(program, same)
    assert 'shoulder="ssame" elbow="esame" wrist="wsame"' in files[f"{NAME}/{NAME}.dtx"]
    assert {move.posture for move in read.moves[1:]} == {("ssame", "esame", "wsame")}


def test_several_contours_become_routines_called_in_order(cell):
    names = ("skin/outer", "skin outer", "7. Bohrung ø12", "hole" * 5)
    program = build_program([hand_plan(arc(name), *cell) for name in names], name="B-pillar 4711")
    files, read = reads_back(program)
    calls = re.findall(r"call (\w+)\(\)", files["B_pillar_4711/start.pgx"])
    assert calls == [section.name for section in read.sections]


# What VAL 3 cannot say.


def test_a_lead_time_is_left_out_and_said(program):
    found = [i for i in preflight(program, "val3", OUTPUTS) if i.code == "lead-time"]
    assert [i.level for i in found] == ["warning"]
    assert "3 switches are planned up to 300 ms ahead" in found[0].message
    with pytest.raises(InputError, match="VAL 3 switches only after the tip has stopped"):
        post(program, "val3", OUTPUTS, strict=True)


def test_without_leads_nothing_is_left_out():
    program = build_program([CASE.small], lead_time=0.0)
    assert found_codes(program) == ["air-moves"]
    assert CASE.language.sayable(program, OUTPUTS).moves[1].switches == program.moves[1].switches


# Axes and configurations.


def test_a_public_project_for_a_tx90_has_these_axes_this_world_and_these_angles():
    """Joints, tool and point of AA_Chessie.dtx: source in kerfpath.post.val3.controller."""
    arm = robot("staubli_tx90")
    axes_deg = [-7.236149, 83.896154, 110.243942, 0.0, -14.140096, 172.763851]
    tool = np.eye(4)
    tool[:3, 3] = 2.67332365613152e-3, 0.0823457375943404e-3, 50.1043771229301e-3
    q = joints_from_axes(arm, np.radians([axes_deg]))
    T = np.linalg.inv(world(arm)) @ arm.forward(q)[0] @ tool
    np.testing.assert_allclose(T[:3, 3] * 1e3, [374.8, 3.07, -517.036829], atol=1e-5)
    down = Rotation.from_euler("XYZ", [-180, 0, 0], degrees=True)
    turned = Rotation.from_matrix(T[:3, :3]) * down.inv()
    assert np.degrees(turned.magnitude()) < 2e-6  # six printed decimals, three axes
    assert configurations(arm, q)[0][:2] == ("lefty", "epositive")


@pytest.mark.parametrize("name", ARMS)
def test_every_arm_of_the_library_counts_joints_as_the_controller_does(name):
    arm = robot(name)
    q = np.random.default_rng(3).uniform(-2, 2, (5, 6))
    np.testing.assert_allclose(axes_from_joints(arm, q), q, atol=1e-15)
    np.testing.assert_allclose(joints_from_axes(arm, q), q, atol=1e-15)
    T = np.linalg.inv(world(arm)) @ arm.forward(np.zeros(6))
    g = arm.geometry
    np.testing.assert_allclose(T[:3, :3], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], [g["a1"], g["b"], g["c2"] + g["c3"] + g["c4"]], atol=1e-12)
    if name != "staubli_tx2_160l":  # its description repeats that of a TX2-60
        origin = arm.frames["controller_base_xyz_m"]
        np.testing.assert_allclose(world(arm)[:3, 3], origin, atol=1e-12)


def test_an_arm_described_otherwise_reads_back(cell):
    arm = cell[0]
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("z", 40, degrees=True).as_matrix()
    other = rebuilt(arm, sign=-arm.sign, offset=arm.offset + 0.3, T_end_flange=turned)
    free = other.with_limits(lower=np.full(6, -7.0), upper=np.full(6, 7.0))
    reads_back(build_program([hand_plan(arc(), free, *cell[1:])], lead_time=0.0))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
def test_the_shoulder_agrees_with_a_construction_from_points(q):
    arm = robot("staubli_rx160")
    flange = arm.forward(np.array(q))
    wrist = flange[:3, 3] - arm.geometry["c4"] * flange[:3, 2]
    ahead = wrist @ [np.cos(q[0]), np.sin(q[0]), 0.0]
    if abs(ahead) < 1e-5:
        return
    assert configurations(arm, [q])[0][0] == ("righty" if ahead < 0 else "lefty")


def test_angles_that_are_zero_but_for_rounding_are_positive():
    arm = robot("staubli_tx2_60")
    q = np.tile([0, 0.1, 0, 0, 0, 0.0], (2, 1))
    q[0, [2, 4]] = -1e-15
    q[1, [2, 4]] = -1e-6
    expected = [("lefty", "epositive", "wpositive"), ("lefty", "enegative", "wnegative")]
    assert posture(arm, q, OUTPUTS) == expected


# Long programs.


@pytest.fixture(scope="module")
def long(cell):
    plans = [
        hand_plan(arc(name, count=count), *cell)
        for name, count in (("a contour with a long name", 300), ("hole", 20), ("Hole", 30))
    ]
    return build_program(plans, name="a program with a long name", lead_time=0.0)


def test_long_programs_become_libraries_that_the_project_calls(long):
    tight = OUTPUTS.model_copy(update={"lines_per_file": 100})
    files, read = reads_back(long, tight)
    projects = [name for name in files if name.endswith(".pjx")]
    assert [name.rpartition("/")[2] for name in files if name.endswith("start.pgx")] == [
        "start.pgx" for _ in projects
    ]
    assert len({name.lower() for name in files}) == len(files)
    names = [name for name, _ in Val3(long, tight).names()]
    assert max(len(name) for name in names) == 15
    main = next(iter(files))
    assert main == "a_program_with_/a_program_with_.pjx"
    assert 'path="Disk://a_program_wit_2/a_program_wit_2.pjx"' in files[main]
    # No contour is divided: longer than a file, it is the only one of its library.
    assert [s.name for s in read.sections] == [s.name for s in Val3(long, tight).program.sections]
    found = found_codes(long, "warning", tight)
    assert found.count("file-length") == sum(3 * len(s.steps) > 60 for s in long.sections) > 0


def test_a_program_that_fits_is_one_project(long):
    files, _ = reads_back(long)
    assert [name for name in files if name.endswith(".pjx")] == [next(iter(files))]


def test_more_libraries_than_a_project_can_list_are_refused(program):
    (section,) = program.sections
    endless = replace(program, sections=tuple(replace(section, name=f"c{k}") for k in range(60)))
    with pytest.raises(InputError, match="but lines_per_file allows 100; raise it"):
        Val3(endless, OUTPUTS.model_copy(update={"lines_per_file": 100})).files()


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (0, 'alias="long_2"', 'alias="other"', 'expected <Library alias=\'other\' path='),
        (0, '<Library alias="long_2" path="Disk://long_2/long_2.pjx" />', "", "routine of long_2"),
        ("start.pgx", "if nFirst<=1\n    call long_2:hole()\n  endIf\n", "", "not expected here"),
        ("long_2/start.pgx", "begin", "begin\n  dioLaser=true", "must not do anything"),
        ("long_2/stop.pgx", "dioLaser=false", "dioLaser=true", "in stop()"),
        ("start.pgx", "call long_2:hole()", "call hole()", "hole is not a routine of the project"),
        ("long_2.dtx", 'x="51.3000"', 'x="51.4000"', "with the tool and the frame of long"),
        ("long_2.pjx", "<Libraries>", '<Libraries><Library alias="long_2" path="Disk://long_2/'
         'long_2.pjx" />', "without libraries"),
    ],
)  # fmt: skip
def test_libraries_that_do_not_fit_are_refused(cell, file, old, new, message):
    plans = [hand_plan(arc(name), *cell) for name in ("hole", "slot", "rim")]
    program = build_program(plans, name="long", lead_time=0.0)
    tight = OUTPUTS.model_copy(update={"lines_per_file": 100})
    files = post(program, "val3", tight)
    names = list(files)
    (name,) = (
        [names[0]]
        if file == 0
        else [name for name in names if name == file or name.endswith(f"/{file}")][:1]
    )
    assert old in files[name]
    with pytest.raises(InputError, match=re.escape(message)):
        read_program(files | {name: files[name].replace(old, new)}, "val3", cell[0], tight)


# Settings and preflight.


@pytest.mark.parametrize("link", ['a"b', "a<b", "a b", "", "a\nb", "&amp;", "x" * 81])
def test_the_link_of_an_output_cannot_carry_anything_else(link):
    with pytest.raises(ValidationError):
        Val3Settings(laser_output=link)


def test_preflight_warns_of_changing_configurations(program):
    q = program.moves[4].q * [1, 1, 1, 1, -1, 1]
    flipped = changed(program, 5, q=q)
    assert found_codes(flipped, "warning").count("posture-change") == 2


# The reader.

CODE, DTX, PJX = f"{NAME}/skin_outer.pgx", f"{NAME}/{NAME}.dtx", f"{NAME}/{NAME}.pjx"
START, STOP = f"{NAME}/start.pgx", f"{NAME}/stop.pgx"


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (PJX, "Project/3", "Project/2", "line 2: <Project> is not expected"),
        (PJX, "<Project", "<!DOCTYPE Project []><Project", "pjx, line 2: a document type, a"),
        (PJX, "</Project>", "", "not XML"),
        (PJX, 's8.0"', 's8"', "line 3: expected <Parameters version='s8.0'"),
        (PJX, 'millimeterUnit="true"', 'millimeterUnit="false"', "expected <Parameters"),
        (PJX, '<Program file="stop.pgx" />', "", "stop.pgx is missing"),
        (PJX, '"stop.pgx"', '"start.pgx"', "line 6: expected the file of another routine"),
        (PJX, '"stop.pgx"', '"../stop.pgx"', "expected the file of another routine"),
        (PJX, f'"{NAME}.dtx"', '"other.dtx"', "line 10: expected <Data file="),
        (PJX, "<Libraries>", "<Types /><Libraries>", "expected Parameters and Programs"),
        (PJX, "<Libraries>", '<Libraries><Library alias="x" path="x.pjx" />', "line 12: expected"),
        (DTX, 'size="9"', 'size="8"', "expected <Data name='pPath'"),
        (DTX, 'key="1"', 'key="2"', "expected the value of key 1"),
        (DTX, '"fPart"', '"fOther"', "line 4: not expected here: <Data name='fOther'"),
        (DTX, '"fPart"', '"tLaser"', "expected <Data name='tLaser' access='private'"),
        (DTX, '"world[0]"', '"fRoom[0]"', "line 5: expected it in world[0], got 'fRoom[0]'"),
        (DTX, '"fPart[0]"', '"world[0]"', "expected it in fPart[0]"),
        (DTX, ' rx="-2.000000"', "", "expected a number as rx, got ''"),
        (DTX, 'j4="', 'j4="1e', "expected a number as j4"),
        (DTX, 'j4="', 'j7="', "expected a number as j4"),
        (DTX, ' j1="', ' name="x" j1="', "expected <Value j1="),
        (DTX, "lefty", "sfree", "expected shoulder lefty or righty or ssame, got 'sfree'"),
        (DTX, 'vel="100"', 'vel="50"', "expected <Value accel='100' vel='100'"),
        (DTX, 'rmax="99999"', 'rmax="10"', "expected <Value accel='100'"),
        (DTX, 'reach="0.3000"', 'reach="0.5000"', "expected <Value accel='100'"),
        (DTX, 'blend="Cartesian"', 'blend="joint"', "expected <Value accel='100'"),
        (DTX, "%Q0", "%Q7", r"expected the output BasicIO-1\%Q0 to be switched, got BasicIO-1\%Q7"),
        (DTX, ' link="BasicIO-1\\%Q0"', "", "to be switched, got "),
        (START, "dioLaser=false", "", "expected dioLaser=false before anything else"),
        (START, "waitEndMove()", "", "expected waitEndMove() and nFirst=1 at the end"),
        (START, "nFirst=1", "nFirst=2", "expected waitEndMove() and nFirst=1 at the end"),
        (START, "if nFirst<=1", "if nFirst<=2", "not expected here"),
        (DTX, 'value="1"', 'value="2"', "nFirst must be the number of a contour"),
        (DTX, 'value="1"', 'value="0"', "must be the number of a contour, got \'0\'"),
        (DTX, "valve1", "valve2", "expected ioLink \'valve1\' of a tool"),
        (START, "if nFirst<=1\n    call skin_outer()\n  endIf\n", "", "number of a contour"),
        (START, "call skin_outer()", "call hole()", "hole is not a routine"),
        (START, "call skin_outer()", "call start()", "start is not a routine"),
        (START, "waitEndMove()", "if nFirst<=2\n  call skin_outer()\n  endIf\n  waitEndMove()",
         "is called twice"),
        (START, "call skin_outer()", "movej(jAir[0],flange,mAir[0])", "line 14: not expected here"),
        (START, 'name="start"', 'name="begin"', "expected <Program name='start'"),
        (STOP, "dioLaser=false", "dioLaser=true", "expected dioLaser=false and dioGas=false and"),
        (CODE, "begin", "begin x", "expected code from begin to end"),
        (CODE, "end]]", "]]", "expected code from begin to end"),
        (CODE, "movel(pPath[0],tLaser,", "movel(pPath[0],flange,", "line 7: not expected here"),
        (CODE, "movel(pPath[0],", "movel(pPath[9],", "line 7: pPath[9] is not declared"),
        (CODE, "mAir[0]", "mAir[1]", "line 6: mAir[1] is not declared"),
        (CODE, "jAir[0]", "jAir[1]", "jAir[1] is not declared"),
        (CODE, "waitEndMove()\n", "\n", "line 9: a switch must follow a move of the path and"),
        (CODE, "mPath[0])\n  waitEndMove()", "mPath[1])\n  waitEndMove()", "robot must not wait"),
        (CODE, "  delay(0.400)\n  movel(pPath[1]", "  movel(pPath[1],tLaser,mPath[1])\n  delay(0.4)"
         "\n  movel(pPath[1]", "a wait must follow waitEndMove()"),
        (CODE, "delay(0.400)", "delay(0.400)\n  dioLaser=true", "a switch must follow a move"),
        (CODE, "delay(0.400)", "put(1)", "line 11: not expected here: 'put(1)'"),
        (CODE, "movel(pPath[3]", "//\n  dioLaser=false ; movel(pPath[3]", "not expected here"),
        (CODE, "<Code>", "<Locals /><Code>", "expected Code in <Program"),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(file, old, new, message):
    CASE.refuses(file, old, new, message)


@pytest.mark.parametrize(
    ("file", "old", "new"),
    [
        (DTX, "wpositive", "wnegative"),
        (DTX, 'tmax="120.000"', 'tmax="121.000"'),
        (DTX, 'vel="10.00"', 'vel="35.00"'),
        (DTX, 'j6="73.', 'j6="74.'),
        (DTX, 'y="17.3041"', 'y="17.4041"'),
        (DTX, 'leave="0.3000" reach="0.3000"', 'leave="0.4000" reach="0.4000"'),
        (DTX, 'x="51.3000"', 'x="51.4000"'),
        (CODE, "dioGas=true", "dioGas=false"),
        (CODE, "delay(0.400)", "delay(0.500)"),
        (CODE, "movel(pPath[1]", "movel(pPath[2]"),
    ],
)
def test_an_edited_project_is_read_as_edited(file, old, new):
    CASE.finds(file, old, new)
