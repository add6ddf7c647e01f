"""Whatever is written passes its audit: languages by settings of [program], generated."""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job import plan_file_text, program_from_file, read_job, read_plan_file, run_job
from kerfpath.job.audit import audit_file
from kerfpath.job.program_file import in_language_of
from kerfpath.post import MANIFEST, groups_of, read_program, write_files
from kerfpath.post import language as find_language
from kerfpath.post.languages import SHIPPED
from kerfpath.transfer import least_time

HEAD = """\
[robot]
model = "{robot}"
{limits}
[tool]
{tool}
[part]
file = "part.csv"
xyz_mm = {xyz}
rpy_deg = [0, 0, 30]
[plan]
gamma_step_deg = 10
certify = false
{plan}
"""
CONTOURS = """\
[[contour]]
pick = "slot"
speed_m_min = {slot}
spacing_mm = 1
[[contour]]
pick = "hole"
speed_m_min = {hole}
spacing_mm = 1
"""
SETTINGS = """\
[program.rapid]
gas_output = "doGas"
lines_per_file = {lines}
[program.krl]
laser_output = 5
gas_output = 6
lines_per_file = {lines}
[program.fanuc]
laser_output = 5
gas_output = 6
lines_per_file = {lines}
decimals = {decimals}
speed_unit = "{unit}"
[program.val3]
laser_output = 'BasicIO-1\\%Q0'
gas_output = 'BasicIO-1\\%Q1'
lines_per_file = {lines}
[program.inform]
laser_output = 5
gas_output = 6
lines_per_file = {lines}
{pulses}
[program.urscript]
laser_output = 0
gas_output = 1
[program.linuxcnc]
laser_output = 0
gas_output = 1
"""
PULSES = "pulses_per_deg = [1341.4, 1341.4, 1000.0, 1000.0, 800.0, 500.0]"
USUAL = {"lines": 5000, "decimals": 4, "unit": "cm/min", "pulses": PULSES}


def whole(robot, acceleration, xyz, home):
    """A job with its transfer moves, for an arm whose accelerations bind."""
    return (
        HEAD.format(
            robot=robot,
            limits=f"acceleration_deg_s2 = {acceleration}",
            tool='head = "laser-head-45"',
            xyz=xyz,
            plan='posture = "front/up"\neta_acceleration = 0.9',
        )
        + CONTOURS.format(slot=14, hole=10)
        + f"[sequence]\nhome_deg = {home}\n"
    )


WHOLE = whole(
    "abb_irb4600_60_205",
    [320, 270, 420, 1300, 1400, 2000],
    [1200, -200, 500],
    [0, -20, 10, 0, 60, 0],
)
"""Acceleration sits on its limit, at 4 ms from node to node: digits and arcs matter."""
RODS = whole(
    "fanuc_m20id_25", [215, 175, 260, 760, 860, 1190], [1000, -150, 300], [0, -20, 10, 0, 60, 0]
)
"""The same for an arm that measures its axis 3 from the horizontal, as listings do."""
SMALL = HEAD.format(
    robot="ur_ur10e",
    limits="acceleration_deg_s2 = [300, 300, 300, 600, 600, 600]",
    tool="xyz_mm = [0, 0, 150]\nrpy_deg = [0, 30, 0]",
    xyz="[700, -100, 100]",
    plan='method = "exact"\nrefine = false',
) + CONTOURS.format(slot=3, hole=3)
TURNS = HEAD.format(
    robot="yaskawa_gp25",
    limits="acceleration_deg_s2 = [300, 300, 300, 600, 600, 900]",
    tool='head = "laser-head-45"',
    xyz="[1000, -150, 300]",
    plan="",
) + CONTOURS.format(slot=6, hole=4)
"""Its axes do not turn beyond what the positions of INFORM say."""
OF = {
    "whole": ("rapid", "krl", "val3", "ros", "csv", "linuxcnc"),
    "rods": ("fanuc",),
    "small": ("urscript",),
    "turns": ("inform", "rapid"),
}
"""What each job is written in."""


def drawing():
    """A slot and a hole as a table of points, mm."""
    t = np.linspace(-np.pi / 2, np.pi / 2, 120)
    rows = ["contour,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z"]
    for name, centre, r, half in (("slot", (0, 0), 12.0, 10.0), ("hole", (90, 30), 8.0, 0.01)):
        right = np.c_[half + r * np.cos(t), r * np.sin(t)]
        loop = np.vstack([right, -right, right[:1]]) + centre
        rows += [f"{name},{x:.6f},{y:.6f},0,0,0,-1" for x, y in loop]
    return "\n".join([*rows, ""])


@pytest.fixture(scope="session")
def planned(tmp_path_factory):
    """A folder for each job, with its drawing and its plan.json: planned once."""
    folders = {}
    for name, job in {"whole": WHOLE, "rods": RODS, "small": SMALL, "turns": TURNS}.items():
        folder = folders[name] = tmp_path_factory.mktemp(name)
        (folder / "part.csv").write_text(drawing())
        path = folder / "job.toml"
        path.write_text(job + '[program]\nlanguage = "none"\n')
        outcome = run_job(read_job(path))
        assert outcome.passed
        (folder / "plan.json").write_text(plan_file_text(outcome))
    return folders


def job_file(folder, *, program="", **settings):
    """The job of a folder with another [program]."""
    text = (folder / "job.toml").read_text().split("[program]")[0]
    path = folder / f"{abs(hash((program, *sorted(settings.items()))))}.toml"
    path.write_text(
        f'{text}[program]\nname = "cut"\n{program}\n' + SETTINGS.format(**USUAL | settings)
    )
    return path


CHANGES = [
    {},
    {"program": "arcs_mm = 0.02\nzone_mm = 0.05"},
    {"program": "arcs_mm = 0.02\nlead_time_s = 0.0\ngas_lead_s = 0.1"},
    {"program": "zone_mm = 0.02\nlead_time_s = 0.01\npierce_time_s = 0.25"},
    {"program": "gas_lead_s = 0.3\napproach_mm_s = 40", "lines": 130},
    {"decimals": 3, "unit": "mm/sec", "pulses": ""},
]
"""Settings of [program]: arcs, zones, leads, gas, waits, files, digits."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "language", "change"),
    [
        (name, language, change)
        for name, known in OF.items()
        for language, change in product(known, range(len(CHANGES)))
    ],
)
def test_what_is_written_passes_its_audit_or_is_not_written(
    planned, tmp_path, name, language, change
):
    folder = planned[name]
    settings = CHANGES[change]
    if language == "inform" and "lines" in settings:
        settings = settings | {"lines": 270}  # it has two lines for each target
    job = job_file(folder, **settings)
    if (language, change) in NOT_WRITTEN:
        with pytest.raises((AuditFailed, InputError), match=NOT_WRITTEN[language, change]) as no:
            program_from_file(folder / "plan.json", language, job_file=job)
        assert "\n" not in str(no.value)
        return
    files, _ = program_from_file(folder / "plan.json", language, job_file=job)
    paths = write_files(tmp_path, files)
    found = audit_file(paths[0], job)
    assert found.passed, [c for t in found.tables.values() for c in t if not c.ok][:1]


NOT_WRITTEN = {
    ("ros", 1): "a trajectory has no arcs",
    ("ros", 2): "a trajectory has no arcs",
    ("linuxcnc", 1): "the joints have no arcs",
    ("linuxcnc", 2): "the joints have no arcs",
    ("fanuc", 5): "5 % of it for digits.*eta_acceleration",  # three, and nodes 4 ms apart
}
"""Refused in one line: what the language cannot say, or not with these digits."""


def test_every_language_is_tried():
    assert set(SHIPPED) == {name for known in OF.values() for name in known}


def test_arcs_are_written_where_they_keep_the_limits(planned):
    folder = planned["whole"]
    job = job_file(folder, **CHANGES[1])
    files, _ = program_from_file(folder / "plan.json", "rapid", job_file=job)
    assert files["cut.mod"].count("MoveC ") > 3


def test_without_a_job_a_program_is_audited_by_its_plan(planned):
    """Nothing is left of the drawing; what the plan says of speeds and limits is asked for."""
    file = planned["whole"] / "plan.json"
    files, _ = program_from_file(file, "rapid")
    assert list(files) == ["plan.mod"]
    narrow = replace(read_plan_file(file))
    text = file.read_text()
    eta = text.replace('"eta_a": 0.9', '"eta_a": 0.85')
    assert eta != text
    assert narrow.plans[0].settings.eta_a == 0.9
    (file.parent / "narrow.json").write_text(eta)
    with pytest.raises(AuditFailed):
        program_from_file(file.parent / "narrow.json", "rapid")


def test_moves_planned_with_another_retract_are_refused(planned):
    job = job_file(planned["whole"], program="retract_mm = 20")
    with pytest.raises(InputError, match=r"30 mm off .* retract_mm that it was planned with"):
        program_from_file(planned["whole"] / "plan.json", "rapid", job_file=job)


def another_retract(data):
    data["job"]["program"]["retract_mm"] = 20


def another_pierce_time(data):
    data["job"]["program"]["pierce_time_s"] = 1


def a_slower_way(data):
    times = data["sequence"]["moves"][1]["time_s"]
    times[:] = [2 * t for t in times]


@pytest.mark.parametrize(
    ("edit", "code"),
    [
        (another_retract, "air-ends|agrees"),
        (another_pierce_time, "agrees"),
        (a_slower_way, "agrees"),
    ],
)
def test_what_a_plan_says_of_its_own_program_binds_its_times_and_moves(
    planned, tmp_path, edit, code
):
    """[program] is that of the job as it is now, but a plan has to agree with its own."""
    data = json.loads((planned["whole"] / "plan.json").read_text())
    edit(data)
    (tmp_path / "plan.json").write_text(json.dumps(data))
    job = job_file(planned["whole"])
    with pytest.raises(AuditFailed, match=rf"\[({code})\]"):
        program_from_file(tmp_path / "plan.json", "rapid", job_file=job)


def programmed_time(read, robot, start):
    """Time of the joint moves of a program behind the first, by the model that docs state.

    All joints run together, the slowest at the share of its speed, and gain it in full.
    """
    velocity, acceleration = robot.speed_limits()
    total = 0.0
    for way, group in zip(start, groups_of(read), strict=True):
        for place, move in zip(range(len(way))[-len(group.joint) :], group.joint, strict=True):
            if place == 0:
                continue  # the first of all: nobody knows where it begins
            here, before = way[place] if move.q is None else move.q, way[place - 1]
            step = np.abs(here - before)
            gain = (step / acceleration).max()
            if move.duration is not None:
                total += move.duration
            elif move.cruise is not None:
                total += move.cruise + gain / move.cruise
            else:
                total += float(least_time(step[None], move.speed * velocity, acceleration)[0])
    return total


@pytest.mark.parametrize("air_speed", [None, 0.4])
@pytest.mark.parametrize(
    ("name", "language"), [(name, each) for name in ("whole", "rods") for each in OF[name]]
)
def test_joint_moves_take_the_time_that_was_planned(planned, name, language, air_speed):
    """Shares are counted in per cent by some: half of one, of the least share that is written."""
    folder = planned[name]
    file = read_plan_file(folder / "plan.json")
    planned_time = sum(move.duration for move in file.moves) / (air_speed or 1.0)
    said = "" if air_speed is None else f"air_speed = {air_speed}"
    job = job_file(folder, program=said)
    files, _ = program_from_file(folder / "plan.json", language, job_file=job)
    chosen = find_language(language)
    settings = in_language_of(Path(next(iter(files))), read_job(job)).program.settings
    read = read_program(files, language, file.plans[0].robot, chosen.completed(settings))
    ways = [move.q for move in file.moves]
    took = programmed_time(read, file.plans[0].robot, ways)
    shares = [move.speed for group in groups_of(read) for move in group.joint if move.speed]
    assert took == pytest.approx(planned_time, rel=max(0.015, 0.005 / min(shares, default=1.0)))


def test_post_follows_the_language_of_the_job(planned, tmp_path):
    folder = planned["whole"]
    plan = tmp_path / "plan.json"
    source = (folder / "plan.json").read_text()
    plan.write_text(source.replace('"language": "none"', '"language": "krl"', 1))
    job = job_file(folder, program='language = "krl"')
    result = run("post", plan, "--job", job, "-o", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"cut.dat", "cut.src", MANIFEST}
    assert_refused(
        run("post", plan, "--job", job, "-o", tmp_path / "cut.mod"), "krl", ".src", "rapid"
    )
    assert_refused(run("post", folder / "plan.json", "-o", tmp_path / "x"), "--language")
