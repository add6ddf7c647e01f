"""The job file: what it means, and one clear line for everything that can be wrong with it."""

import json
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from kerfpath.certificate import Certify
from kerfpath.comfort import Band, Comfort
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job import read_job
from kerfpath.job.format.tables.table import heads, pose
from kerfpath.job.format.toml_file import TomlPlaces
from kerfpath.operations import micro_joints, slow_corners
from kerfpath.options import PlanOptions
from kerfpath.post.rapid import RapidSettings
from kerfpath.robots import acceleration_ratios, robot
from kerfpath.tilt import Tilt

# Every test of a line number counts from the first line here.
JOB = """\
[robot]
model = "abb_irb4600_60_205"
endless = [4, 6]
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-straight"
[part]
file = "b_pillar.step"
xyz_mm = [1450, -600, 450]
rpy_deg = [0, 0, 90]
[[contour]]
pick = "trim"
speed_m_min = 9
spacing_mm = 2
[plan]
gamma_step_deg = 1
objective = "sum"
metric = "manhattan"
eta_velocity = 0.95
eta_acceleration = 0.9
[program]
language = "rapid"
"""
ACCELERATION = "acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]"
HEAD = 'head = "laser-head-straight"'
FOR_PROGRAMS = {"comfort": Comfort(limits=Band(margin=0.1 * np.radians(1))), "retract": 0.05}
FOR_PROGRAMS |= {"floor": 0.0, "between_nodes": "kept", "interpolation": "linear"}
"""What every job asks for, so that its plans can be run as programs."""


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("jobs")
    (folder / "b_pillar.step").write_text("a made-up part")
    return folder


@pytest.fixture
def read(folder):
    def read(text, name="job.toml"):
        path = folder / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_job(path)

    return read


def changed(old, new):
    assert JOB.count(old) >= 1
    return JOB.replace(old, new, 1)


@pytest.mark.usefixtures("certified_by_default")
def test_the_example_is_read_into_si(read, folder):
    job = read(JOB)
    assert job.path == folder / "job.toml"
    assert job.part_file == folder / "b_pillar.step"
    assert job.drawing.unit is None
    assert job.robot.id == "abb_irb4600_60_205"
    assert job.robot.endless.tolist() == [False, False, False, True, False, True]
    np.testing.assert_allclose(
        np.degrees(job.robot.acceleration), [320, 270, 420, 1300, 1400, 2000], rtol=1e-14
    )
    np.testing.assert_allclose(job.tool, pose([0, 0, 350], [0, 0, 0]))
    expected = [[0, -1, 0, 1.45], [1, 0, 0, -0.6], [0, 0, 1, 0.45], [0, 0, 0, 1]]
    np.testing.assert_allclose(job.placement, expected, atol=1e-15)
    (task,) = job.contours
    assert (task.pick, task.name, task.speed, task.spacing) == ("trim", "trim", 0.15, 0.002)
    assert (task.count, task.tolerance, task.axis_tolerance) == (None, None, None)
    step = float(np.radians(1))
    assert job.options == PlanOptions(
        gamma_step=step, eta_v=0.95, eta_a=0.9, refine=True, **FOR_PROGRAMS
    )
    assert json.loads(json.dumps(job.source)) == job.source
    assert job.source["contour"][0] == {"pick": "trim", "speed_m_min": 9, "spacing_mm": 2}


def test_the_margin_of_the_limits_and_the_retract_are_as_the_job_says(read):
    own = "[comfort]\nlimits_margin_deg = {}\n[program]\nretract_mm = 20"
    assert read(changed("[program]", own.format(2))).options.comfort.limits.margin == np.radians(2)
    assert read(changed("[program]", own.format(0))).options.comfort is None
    assert read(changed("[program]", own.format(0))).options.retract == 0.02
    # Without a program and without moves between contours nothing backs off.
    assert read(changed('language = "rapid"', 'language = "none"')).options.retract is None


def test_the_floor_is_where_the_job_says(read):
    model = 'model = "abb_irb4600_60_205"'
    assert read(changed(model, f"{model}\nfloor_mm = -600")).options.floor == -0.6
    assert read(changed(model, f"{model}\nfloor = false")).options.floor is None
    with pytest.raises(InputError, match=r"job\.toml:4: .*floor_mm only with a floor"):
        read(changed(model, f"{model}\nfloor = false\nfloor_mm = 3"))


def test_a_range_without_room_for_the_margin_is_used_up_to_its_limits(read):
    held = ACCELERATION + "\nlower_deg = [-180, -90, -180, -400, -0.1, -400]"
    held += "\nupper_deg = [180, 150, 75, 400, 0.1, 400]"
    assert read(changed(ACCELERATION, held)).options.comfort is None


@pytest.mark.usefixtures("certified_by_default")
def test_plan_and_program_may_be_left_out(read):
    job = read(JOB[: JOB.index("[plan]")], "9 side-panel.toml")
    assert job.options == PlanOptions(refine=True, **FOR_PROGRAMS)
    program = job.program
    assert (program.language, program.name) == ("rapid", "job_9_side_panel")
    assert (program.retract, program.zone, program.lead_time) == (0.05, "auto", 0.02)
    assert program.settings == RapidSettings()


def test_limits_of_the_job_replace_those_of_the_library(read):
    job = read(changed("endless = [4, 6]", "endless = []\nvelocity_deg_s = [1, 2, 3, 4, 5, 6]"))
    assert not job.robot.endless.any()
    np.testing.assert_allclose(np.degrees(job.robot.velocity), [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(job.robot.lower, robot(job.robot.id).lower)


def test_a_ratio_gives_accelerations_from_the_speeds_of_the_job(read):
    name = "iontec_20_to_70kg"
    job = read(changed(ACCELERATION, f'acceleration_ratio = "{name}"'))
    np.testing.assert_allclose(
        job.robot.acceleration, job.robot.velocity * acceleration_ratios()[name]
    )
    assert name in job.robot.acceleration_source


def test_a_robot_without_limits_can_be_given_them(read):
    bare = changed("abb_irb4600_60_205", "kuka_kr120_r2500_pro")
    with pytest.raises(InputError, match=r"robot\.lower_deg: .*data sheet"):
        read(bare)
    limits = (
        "lower_deg = [-185, -140, -120, -350, -125, -350]\n"
        "upper_deg = [185, -5, 155, 350, 125, 350]\n"
        "velocity_deg_s = [136, 130, 120, 292, 258, 284]\n[tool]"
    )
    assert read(bare.replace("[tool]", limits)).robot.joint_limits().upper[1] < 0


def test_angles_turn_about_fixed_axes_as_in_urdf():
    def turn(axis, angle):
        R, i, j = np.eye(3), (axis + 1) % 3, (axis + 2) % 3
        R[i, i] = R[j, j] = np.cos(angle)
        R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
        return R

    roll, pitch, yaw = np.radians([10, 20, 30])
    T = pose([1, 2, 3], [10, 20, 30])
    np.testing.assert_allclose(T[:3, :3], turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], [0.001, 0.002, 0.003])


def test_the_heads_point_their_beam_where_their_names_say():
    beams = {name: pose(*head)[:3, 2] for name, head in heads().items()}
    half = np.sqrt(0.5)
    np.testing.assert_allclose(beams["laser-head-straight"], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(beams["laser-head-45"], [half, 0, half], atol=1e-15)
    np.testing.assert_allclose(beams["laser-head-90"], [1, 0, 0], atol=1e-15)


def test_a_tool_can_be_given_by_its_tip(read):
    tip = "xyz_mm = [10, 20, 30]\nrpy_deg = [0, 90, 0]"
    T = read(changed(HEAD, tip)).tool
    np.testing.assert_allclose(T[:3, 2:], [[1, 0.01], [0, 0.02], [0, 0.03]], atol=1e-15)


def test_a_task_samples_and_names_its_contour(read, circle):
    lines = {
        "spacing_mm = 2": None,
        "time_step_ms = 20": None,
        "count = 50": 50,
        "tolerance_mm = 0.05": None,
        "tolerance_mm = 1\naxis_tolerance_deg = 1": None,
    }
    for line, count in lines.items():
        (task,) = read(changed("spacing_mm = 2", f'name = "rim"\n{line}')).contours
        sampled = task.sample(circle)
        assert isinstance(sampled, Contour)
        assert (sampled.name, sampled.closed) == ("rim", True)
        assert count in (None, len(sampled))
        if task.spacing:
            assert np.diff(sampled.s).max() <= 0.002
        if task.time_step:
            assert np.diff(sampled.s).max() <= 0.02 * task.speed * (1 + 1e-12)


def test_a_time_step_keeps_what_a_spacing_keeps(read):
    # A square with a micro joint, 9 m/min: steps of 2 mm are steps of 13.3 ms.
    side = np.linspace(0, 0.1, 101)[:-1]
    flat = np.r_[np.c_[side, 0 * side], np.c_[0.1 + 0 * side, side],
                 np.c_[0.1 - side, 0.1 + 0 * side], np.c_[0 * side, 0.1 - side]]  # fmt: skip
    square = Contour(np.c_[flat, 0 * flat[:, 0]], np.tile([0, 0, -1], (400, 1)), closed=True)
    joined = micro_joints(square, 0.003, count=3)
    by_spacing, by_time = (
        read(changed("spacing_mm = 2", line)).contours[0].sample(joined)
        for line in ("spacing_mm = 2", f"time_step_ms = {2 / 9 * 60!r}")
    )
    assert by_time.time is None  # one speed throughout: the plan lays it on
    # Lengths through times and back: rounding.
    np.testing.assert_allclose(by_time.points, by_spacing.points, rtol=0, atol=1e-12)
    assert by_time.kinds == by_spacing.kinds
    # At half the speed around the corners nodes lie half as far apart, 13.3 ms all the same.
    slowed = slow_corners(square, 0.5, distance=0.01, ramp=0.02)
    (task,) = read(changed("spacing_mm = 2", f"time_step_ms = {2 / 9 * 60!r}")).contours
    timed = task.sample(slowed)
    assert np.ptp(np.diff(timed.time)) < 1e-12
    assert 0.8 * 2 / 150 <= np.diff(timed.time)[0] <= 2 / 150 + 1e-12
    steps = np.diff(timed.s)
    assert steps.min() == pytest.approx(steps.max() / 2, rel=0.2)  # stretches are divided evenly
    corners = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]]
    assert all(np.linalg.norm(timed.points - c, axis=1).min() < 1e-9 for c in corners)


@pytest.mark.parametrize("key", ["spacing_mm", "time_step_ms"])
def test_a_sampling_that_no_memory_holds_is_refused(read, circle, key):
    (task,) = read(changed("spacing_mm = 2", f"{key} = 1e-9")).contours
    with pytest.raises(InputError, match=f"raise {key}"):
        task.sample(circle)


# What is changed, into what, the line, and what the message says.
FAULTS = [
    # keys
    ("model =", "modle =", 2, "robot.modle: expected a key of .robot., .*nearest: model"),
    ("[tool]", "[tol]", 5, "tol: expected a known table, .*nearest: tool .and 1 more"),
    ("speed_m_min", "speed_mm_min", 13, "contour.speed_mm_min: .*nearest: speed_m_min"),
    ('model = "abb_irb4600_60_205"', "", 1, "robot.model: .*got nothing; add, .*model = "),
    ("speed_m_min = 9", "", 11, "contour.speed_m_min: .*got nothing"),
    ("rpy_deg = [0, 0, 90]", "", 7, "part.rpy_deg: .*got nothing"),
    ("[tool]\n" + HEAD, "", 1, r"tool: expected a table \[tool\], got none"),
    ("[[contour]]", "[contour]", 11, r"contour: .*write it as \[\[contour\]\]"),
    ("[plan]", "[other.plan]", 15, "other: expected a known table"),
    # robot
    ("abb_irb4600_60_205", "abb_irb4600", 2, "robot.model: .*nearest: abb_irb4600_20_250"),
    ("[4, 6]", "[4, 7]", 3, "robot.endless: .* from 1 to 6.* got 7;"),
    ("[4, 6]", "[4, 4]", 3, "robot.endless: expected each axis once"),
    ("[4, 6]", "4", 3, "robot.endless: .*got 4;"),
    (ACCELERATION, "", 1, "robot.acceleration_deg_s2: .*ratio = .iontec_20_to_70kg"),
    ("1300, ", "", 4, "robot.acceleration_deg_s2: expected 6 numbers"),
    ("1300", "true", 4, "got true as number 4"),
    ("1300", '"1300"', 4, 'got "1300" as number 4'),
    ("1300", "nan", 4, "got nan as number 4"),
    ("1300", "-inf", 4, "got -inf as number 4"),
    ("1300", "0", 4, "above 0.*got 0 as number 4"),
    ("1300", "1e9", 4, r"at most 1e\+06, got 1000000000.0"),
    ("1300,", "\n\n-1300,\n", 6, "got -1300 as number 4"),
    ("endless", 'acceleration_ratio = "iontec_20_to_70kg"\nendless', 3, "got both; remove one"),
    (ACCELERATION, 'acceleration_ratio = "iontec"', 4, "nearest: iontec_20_to_70kg"),
    ("endless", "lower_deg = [0, 0, 0, 0, 200, 0]\nendless", 3, "lower_deg: .*joint 5"),
    ("endless", "upper_deg = [0, -90, 1, 1, 1, 1]\nendless", 3, "upper_deg: .*joint 2"),
    # tool
    ("laser-head-straight", "laser-head-30", 6, "tool.head: .*nearest: laser-head"),
    (HEAD, "", 5, "tool.head: expected a cutting head, got none; add head .laser-head-"),
    (HEAD, HEAD + "\nrpy_deg = [0, 0, 0]", 7, "tool.rpy_deg: expected head alone, got it with"),
    (HEAD, "xyz_mm = [0, 0, 1]", 5, "tool.rpy_deg: expected rpy_deg together with xyz_mm"),
    (HEAD, "xyz_mm = [0, 1]\nrpy_deg = [0, 0, 0]", 6, r"tool.xyz_mm: .* got \[0, 1\]"),
    # part
    ("b_pillar.step", "c_pillar.step", 8, 'part.file: .* got "c_pillar.step"; it is not in'),
    ("b_pillar.step", ".", 8, "part.file: .*it is not a file"),
    ("b_pillar.step", "a\\u0000b", 8, r"part.file: expected one line of text, got U\+0000"),
    ("b_pillar.step", "x" * 5000, 8, "part.file: .*it is not in"),
    ("b_pillar.step", "", 8, "part.file: .*the path of the part's CAD file"),
    ("xyz_mm", 'unit = "foot"\nxyz_mm', 9, "part.unit: expected a length unit .um, mm, cm"),
    ("[0, 0, 90]", "{ yaw = 90 }", 10, "part.rpy_deg: .*got a table"),
    # contour
    ('"trim"', "3", 12, "contour.pick: .*got 3"),
    ('"trim"', '""', 12, "contour.pick: "),
    ('"trim"', '"a\\nb"', 12, "contour.pick: "),
    ("= 9", "= -9", 13, "contour.speed_m_min: .*above 0.*got -9"),
    ("= 9", "= 1e-30", 13, "contour.speed_m_min: .*at least 1e-09"),
    ("= 9", "= 2026-09-01", 13, "got 2026-09-01"),
    ("= 9", "= 0x" + "f" * 6000, 13, "more than 20 digits"),
    (
        "spacing_mm = 2",
        "",
        11,
        "one of spacing_mm, time_step_ms, count and tolerance_mm, got none",
    ),
    ("spacing_mm = 2", "spacing_mm = 2\ncount = 9", 15, "got spacing_mm and count; keep one"),
    ("spacing_mm = 2", "spacing_mm = 2\ntime_step_ms = 9", 15, "got spacing_mm and time_step_ms"),
    ("spacing_mm = 2", "time_step_ms = 0", 14, "contour.time_step_ms: expected a number above 0"),
    ("spacing_mm = 2", "count = 1", 14, "contour.count: expected a whole number"),
    ("spacing_mm = 2", "count = 20.0", 14, "contour.count: expected a whole number"),
    ("spacing_mm = 2", "count = 9\naxis_tolerance_deg = 1", 15, "only with tolerance_mm"),
    (
        "[plan]",
        '[[contour]]\npick = "trim"\nspeed_m_min = 1\ncount = 3\n[plan]',
        16,
        "contour.pick: expected a name that no other contour has",
    ),
    (
        "[plan]",
        '[[contour]]\npick = "a"\nname = "trim"\nspeed_m_min = 1\ncount = 3\n[plan]',
        17,
        "contour.name: expected a name that no other contour has",
    ),
    ("[plan]", '[[contour]]\npick = "b"\nspeed_m_min = 0\ncount = 3\n[plan]', 17, "got 0;"),
    # plan and program
    ("gamma_step_deg = 1", "gamma_step_deg = 361", 16, "at most 360"),
    ("gamma_step_deg = 1", "gamma_step_deg = 0", 16, "above 0"),
    ('"sum"', '"mean"', 17, "plan.objective: expected 'sum' or 'max', got \"mean\""),
    ("0.95", "1.5", 19, "plan.eta_velocity: .*at most 1"),
    ("[program]", "weights = [1, 1, 1, 1, 1, -1]\n[program]", 21, "got -1 as number 6"),
    # comfort
    ("[program]", "[comfort]\nwrist_margin_deg = 90\n[program]", 22, "below 90, in deg, got 90"),
    ("[program]", "[comfort]\nelbow_cost = 1\n[program]", 22, "elbow_band_deg with elbow_cost"),
    ("[program]", "[comfort]\nlimits_band_deg = 9\n[program]", 22, "limits_cost with limits_band"),
    ("[program]", "[comfort]\nshoulder_deg = 9\n[program]", 22, "nearest: shoulder_"),
    (
        "[program]",
        "[comfort]\nreversals_joints = [1]\n[program]",
        22,
        "reversals_cost with reversals_joints",
    ),
    (
        "[program]",
        "[comfort]\nreversals_cost = 1\nreversals_joints = [7]\n[program]",
        23,
        "comfort.reversals_joints: expected joints from 1 to 6, got 7",
    ),
    (
        "[program]",
        "[comfort]\nreversals_cost = 1\nreversals_joints = [2, 2]\n[program]",
        23,
        "comfort.reversals_joints: expected different numbers of joints",
    ),
    (
        "[program]",
        'feed = "dip"\n[comfort]\nreversals_cost = 1\n[program]',
        23,
        "reversals_cost: expected feed = .constant. with reversals_cost, got .dip.",
    ),
    (
        "[program]",
        "[comfort]\nclearance_band_mm = 9\nclearance_cost = 1\n[program]",
        22,
        "comfort.clearance_band_mm: expected .cell. with .*got none",
    ),
    ("[program]", "[comfort]\nclearance_margin_mm = 9\n[program]", 22, "nearest: clearance_"),
    (
        "[program]",
        'feed = "dip"\n[comfort]\nwrist_band_deg = 9\nwrist_cost = 1\n[program]',
        21,
        "plan.feed: expected refine = false with feed = .dip. and costs in .comfort.",
    ),
    ('"rapid"', '"cobol"', 22, "program.language: expected a robot language, or none, got .cobol."),
    ("language", 'work_object = "w"\nlanguage', 22, "program.work_object: expected a key of"),
    ('"rapid"', '"rapid"\n[program.rapid]\ntool = 1', 24, "program.rapid.tool: expected a key of"),
    ('"rapid"', '"rapid"\n[program.rapid]\ntool_name = 1', 24, r"tool_name: expected a name .* 1;"),
    ('"rapid"', '"rapid"\n[program.cobol]\nx = 1', 23, "program.cobol: expected a key of"),
    ("language", "retract_mm = 0\nlanguage", 22, "program.retract_mm: expected a number above 0"),
    # not TOML
    ("= 9", "= nine", 13, r"not valid TOML: Invalid value \(at line 13, column 15\)"),
    ("spacing_mm = 2", "speed_m_min = 2", 14, "not valid TOML: Cannot overwrite a value"),
    ('"rapid"\n', '"""rapid\n', 22, "not valid TOML: .*end of document"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), FAULTS)
def test_a_fault_is_told_with_its_line(read, folder, old, new, line, message):
    with pytest.raises(InputError, match=message) as told:
        read(changed(old, new))
    text = str(told.value)
    assert text.startswith(f"{folder / 'job.toml'}:{line}: ")
    assert one_line(text)


def one_line(text):
    return text.isprintable() and len(text) < 1000


def test_line_numbers_hold_with_windows_line_ends_and_byte_order_mark(read):
    text = "\ufeff" + changed("= 9", "= -9").replace("\n", "\r\n")
    with pytest.raises(InputError, match=r"job\.toml:13: contour\.speed_m_min"):
        read(text)
    assert read("\ufeff" + JOB.replace("\n", "\r\n")).contours[0].speed == 0.15


def test_a_nested_fault_is_found_in_inline_and_dotted_tables(read):
    text = """\
contour = [
  { pick = "a", speed_m_min = 1, count = 9 },
  { pick = "b", speed_m_min = 1, count = 9.5 },
]
tool.head = "laser-head-90"
part.file = "b_pillar.step"
part . xyz_mm = [
  0,
  0,
  nan ]
part.'rpy_deg' = [0, 0, 0]
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
"""
    with pytest.raises(InputError, match=r":3: contour\.count: .* \(and 1 more\)$"):
        read(text)
    with pytest.raises(InputError, match=r":10: part\.xyz_mm: .* got nan as number 3; [^(]*$"):
        read(text.replace("9.5", "9"))
    assert len(read(text.replace("9.5", "9").replace("nan", "1")).contours) == 2


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"", r":1: expected \[robot\], .* got an empty file"),
        (b"# only this\n\n", r":1: expected \[robot\], .* got an empty file"),
        (b"[robot]\nmodel = '\xff'\n", ":2: expected UTF-8 text, got the byte 0xff"),
        (JOB.encode("utf-16"), ":1: expected UTF-8 text"),
        (b"a = " + b"9" * 6000, "an integer is too long"),
        (b"a = " + b"[" * 3000 + b"]" * 3000, "nested too deeply"),
    ],
)
def test_a_file_that_is_no_job_at_all_is_refused(read, raw, message):
    with pytest.raises(InputError, match=message) as told:
        read(raw)
    assert one_line(str(told.value))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "got a folder"),
        ("missing.toml", "no such file"),
        ("b_pillar.step/job.toml", "cannot be read"),
        ("x" * 300, "cannot be read"),
        ("a\0b\n", "cannot be read"),
    ],
)
def test_a_path_without_a_job_is_refused(folder, name, message):
    with pytest.raises(InputError, match=message) as told:
        read_job(folder / name)
    assert one_line(str(told.value))


def test_places_are_found_however_the_document_is_written():
    text = """\
top."x y".'z' = [1, [2, 3], # note
  4]
[a.b]
c = 1
[a]
d = {e.f = 1, g = [{h=1}]}
[[t]]
k = 1
[t.sub]
m = 1
[[t]]
  k = 1
[[t.inner]]
[[t.inner]]
"\\u00e9" = {"é1" = 0, n = 0}
"""
    places = TomlPlaces(text)
    found = {
        (): (1, 1),
        ("top", "x y", "z", 1, 1): (1, 25),
        ("top", "x y", "z", 2): (2, 3),
        ("a",): (5, 1),
        ("a", "b", "c"): (4, 1),
        ("a", "d", "e", "f"): (6, 6),
        ("a", "d", "g", 0, "h"): (6, 21),
        ("t", 0, "k"): (8, 1),
        ("t", 0, "sub", "m"): (10, 1),
        ("t", 1, "k"): (12, 3),
        ("t", 1, "inner", 1): (14, 1),
        ("t", 1, "inner", 1, "é", "é1"): (15, 13),
        ("t", 1, "inner", 1, "é", "n"): (15, 23),
        # what is missing is where it should be
        ("a", "b", "nothing"): (3, 1),
        ("t", 0, "nothing"): (7, 1),
        ("t", 7): (7, 1),
        ("nothing", "at all"): (1, 1),
    }
    for where, position in found.items():
        assert tuple(places.locate(where)) == position, where


MODEST = settings(
    derandomize=True,
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
LINES = JOB.splitlines()
KEYS = sorted({line.split(" = ")[0] for line in LINES if " = " in line})
SCALARS = st.one_of(
    st.integers(),
    st.integers(1, 9).map(lambda n: n * 1e-320),
    st.floats().map(repr),
    st.booleans().map(lambda b: str(b).lower()),
    st.text().map(lambda s: json.dumps(s, ensure_ascii=True)),
    st.sampled_from(["2026-01-01", "07:32:00", "1979-05-27T07:32:00Z", "0xff", "'''\n'''", "{}"]),
).map(str)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=7).map(lambda v: f"[{', '.join(v)}]"),
        inner.map(lambda v: f"{{ a = {v} }}"),
    ),
    max_leaves=8,
)


def is_a_job_or_one_clear_line(folder, raw):
    path = folder / "mutated.toml"
    path.write_bytes(raw)
    try:
        read_job(path)
    except InputError as error:
        text = str(error)
        assert one_line(text), text
        at = re.match(rf"{re.escape(str(path))}(?::(\d+))?: ", text)
        assert at, text
        assert 1 <= int(at[1] or 1) <= raw.count(b"\n") + 1


@MODEST
@given(gone=st.sets(st.integers(0, len(LINES) - 1), min_size=1, max_size=12))
def test_deleted_lines_are_survived(folder, gone):
    kept = [line for i, line in enumerate(LINES) if i not in gone]
    is_a_job_or_one_clear_line(folder, "\n".join(kept).encode())


@MODEST
@given(order=st.permutations(LINES))
def test_shuffled_lines_are_survived(folder, order):
    is_a_job_or_one_clear_line(folder, "\n".join(order).encode())


@MODEST
@given(i=st.integers(0, len(LINES) - 1), j=st.integers(0, len(LINES) - 1))
def test_swapped_values_are_survived(folder, i, j):
    lines = [line.partition("=") for line in LINES]
    (a, is_a, x), (b, is_b, y) = lines[i], lines[j]
    lines[i], lines[j] = (a, is_a, y), (b, is_b, x)
    is_a_job_or_one_clear_line(folder, "\n".join("".join(line) for line in lines).encode())


@MODEST
@given(changes=st.dictionaries(st.integers(0, len(LINES) - 1), VALUES, min_size=1, max_size=3))
def test_random_values_are_survived(folder, changes):
    lines = list(LINES)
    for i, value in changes.items():
        lines[i] = f"{lines[i].partition('=')[0]}= {value}" if "=" in lines[i] else lines[i]
    is_a_job_or_one_clear_line(folder, "\n".join(lines).encode())


@MODEST
@given(i=st.integers(0, len(LINES)), key=st.sampled_from(KEYS) | st.text(), value=VALUES)
def test_random_keys_are_survived(folder, i, key, value):
    line = f"{json.dumps(key)} = {value}"
    is_a_job_or_one_clear_line(folder, "\n".join([*LINES[:i], line, *LINES[i:]]).encode())


@MODEST
@given(at=st.integers(0, len(JOB)), inserted=st.binary(max_size=20), cut=st.integers(0, 20))
def test_random_bytes_are_survived(folder, at, inserted, cut):
    raw = JOB.encode()
    is_a_job_or_one_clear_line(folder, raw[:at] + inserted + raw[at + cut :])
    is_a_job_or_one_clear_line(folder, inserted)


def test_a_posture_in_words_becomes_those_it_fits(read):
    job = read(JOB.replace("gamma_step_deg = 1", 'posture = "front/up"\ngamma_step_deg = 1'))
    assert job.options.postures == (0, 1)


@pytest.mark.parametrize("words", ["front/rear", "sideways", "front up"])
def test_a_posture_that_does_not_exist_is_refused_at_its_line(read, words):
    with pytest.raises(InputError, match=r"job.toml:16: plan.posture: expected a posture in words"):
        read(JOB.replace("gamma_step_deg = 1", f'posture = "{words}"\ngamma_step_deg = 1'))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('feed = "dip"\nclosure = "periodic"', 'plan.closure: expected closure = "free"'),
        ('feed = "dip"\nrefine_parts = 3', 'expected refine_parts = 1 with feed = "dip", got 3'),
        ('feed = "dip"\nrotation_deg = 90', 'expected no rotation_deg with feed = "dip", got 90'),
        (
            'interruptions = "fewest"\nmethod = "paper"',
            'plan.method: expected method = "continuous" or "exact"',
        ),
        ("least_piece_mm = 5", 'expected interruptions = "fewest" with least_piece_mm, got "none"'),
        ("least_piece_mm = 0", "plan.least_piece_mm: expected a number above 0, in mm, got 0"),
        ('rotation_deg = 90\nmethod = "known"', '"continuous" or "exact" with rotation_deg, got'),
        (
            'tilt_deg = 3\ninterruptions = "fewest"',
            'plan.tilt_deg: expected no tilt_deg with interruptions = "fewest", got 3',
        ),
        ("tilt_deg = 3\nrefine_parts = 2", "expected refine_parts = 1 with tilt_deg, got 2"),
        ("tilt_steps = 2", "plan.tilt_steps: expected tilt_deg with tilt_steps, got none"),
        ("tilt_cost_per_deg = 0", "expected tilt_deg with tilt_cost_per_deg, got none"),
        ("tilt_deg = 90", "plan.tilt_deg: expected a number above 0, below 90, in deg, got 90"),
        ("tilt_deg = 3\ntilt_steps = 0", "tilt_steps: expected a whole number from 1 to 10, got 0"),
        (
            'closure = "periodic"\nmethod = "known"',
            '"continuous" or "exact" with closure = "periodic"',
        ),
        ("refine_parts = 0", "refine_parts: expected a whole number from 1 to 100, got 0"),
        ("rotation_deg = -1", "rotation_deg: expected a number not below 0, in deg, got -1"),
        ("certify = 1", "plan.certify: expected true or false, got 1"),
        (
            "certify_gap_percent = -1",
            "expected a number not below 0, at most 100, in per cent, got -1",
        ),
        ("certify_gap_percent = 101", "at most 100, in per cent, got 101"),
        ("certify_gap_percent = nan", "plan.certify_gap_percent: expected a number not below 0"),
        ("certify_seconds = -1", "plan.certify_seconds: expected a number above 0, in s, got -1"),
        ("certify_seconds = inf", "plan.certify_seconds: expected a number above 0, in s, got inf"),
        (
            "certify = false\ncertify_seconds = 3",
            "plan.certify_seconds: expected no certify_seconds with certify = false, got 3",
        ),
        ("certify = false\ncertificate = true", "no certificate with certify = false, got true"),
    ],
)
def test_keys_of_plan_that_do_not_go_together_are_refused_at_their_line(read, keys, said):
    with pytest.raises(InputError, match=r"^[^\n]*$") as refused:
        read(changed("[plan]", f"[plan]\n{keys}"))
    assert said in str(refused.value)


def test_a_tolerance_of_the_tool_axis_is_read_into_si(read):
    assert read(changed("[plan]", "[plan]\ntilt_deg = 18")).options.tilt == Tilt(cone=np.pi / 10)
    keys = "tilt_deg = 9\ntilt_steps = 3\ntilt_cost_per_deg = 0.01"
    tilt = read(changed("[plan]", f"[plan]\n{keys}")).options.tilt
    assert (tilt.cone, tilt.steps) == (np.pi / 20, 3)
    # What the rim costs is the angle times the cost, in whichever unit.
    assert tilt.cone * tilt.cost == pytest.approx(9 * 0.01, rel=1e-12)


def test_what_is_certified_is_read_from_four_keys(read):
    def certify(keys):
        return read(changed("[plan]", f"[plan]\n{keys}")).options.certify

    assert read(JOB).options.certify == Certify(gap=0.005, seconds=None, keep=False)
    assert certify("certify = false") is certify("certify = false\ncertificate = false") is None
    keys = "certify_gap_percent = 2\ncertify_seconds = 3\ncertificate = true"
    assert certify(keys) == Certify(gap=0.02, seconds=3.0, keep=True)
    assert certify("certify = true\ncertify_gap_percent = 100") == Certify(gap=1.0)
    assert certify("certify_gap_percent = 0") == Certify(gap=0.0)


def test_a_rotation_limit_is_one_for_every_endless_axis(read):
    job = read(changed("[plan]", "[plan]\nrotation_deg = 180"))
    inf = np.inf
    assert job.options.rotation.tolist() == [inf, inf, inf, np.pi, inf, np.pi]
    none = changed("[plan]", "[plan]\nrotation_deg = 180").replace(
        "endless = [4, 6]", "endless = []"
    )
    with pytest.raises(InputError, match=r"plan.rotation_deg: expected an endless axis"):
        read(none)


def test_the_comfort_table_is_read_into_si(read):
    text = """[comfort]
wrist_margin_deg = 9
wrist_band_deg = 18
wrist_cost = 2
shoulder_margin_mm = 50
limits_band_deg = 3
limits_cost = 0.5
manipulability_margin_m3 = 0.02
[program]"""
    comfort = read(changed("[program]", text)).options.comfort
    assert comfort == Comfort(
        wrist=Band(margin=9 * np.radians(1), width=18 * np.radians(1), cost=2),
        shoulder=Band(margin=50 * 1e-3),
        limits=Band(margin=0.1 * np.radians(1), width=3 * np.radians(1), cost=0.5),
        manipulability=Band(margin=0.02),
    )
    usual = read(changed("[program]", "[comfort]\n[program]")).options.comfort
    assert usual == FOR_PROGRAMS["comfort"]


def test_every_key_says_what_it_expects():
    """Where pydantic finds a fault itself, the message is made of the field's own words."""
    from typing import Literal, get_args, get_origin

    from pydantic import BaseModel

    from kerfpath.job.format.tables import TABLES
    from kerfpath.post import languages

    def plain(annotation):
        kinds = get_args(annotation) if get_origin(annotation) is not Literal else ()
        return get_origin(annotation) is Literal or any(map(plain, kinds))

    def is_table(annotation):
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            return True
        return any(map(is_table, get_args(annotation)))

    models = [*TABLES.items(), *((f"program.{k}", v.settings) for k, v in languages().items())]
    for table, model in models:
        for name, field in model.model_fields.items():
            if not plain(field.annotation) and not is_table(field.annotation):
                assert field.description, f"[{table}] {name}"
                assert field.examples, f"[{table}] {name}"
