"""A job as a Python script: run, it comes to what the run of the job comes to."""

import json
import runpy
import shutil

import numpy as np
import pytest

from jobs import CONTOURS, DEMO, HEAD, RAIL_AND_TABLE, SMALL, WHOLE
from kerfpath.errors import InputError
from kerfpath.job import prepare, program_texts, python_script, read_job, run_job

QUICK = SMALL.replace("[plan]", "[plan]\ncertify = false")
SHAPED = HEAD + CONTOURS.replace('start = "best"\ncandidates = 2\n', "").replace(
    'direction = "best"', 'direction = "reversed"'
)
FEATURES = (
    SHAPED
    + """\
[plan]
gamma_step_deg = 10
posture = "front/up"
certify = false
weights = [0.3, 0.3, 0.3, 0.2, 0.2, 0.1]
method = "exact"
[comfort]
wrist_margin_deg = 2
[audit]
path_tolerance_mm = 0.5
axis_tolerance_deg = 3
[program]
language = "rapid"
name = "shaped"
pierce_time_s = 0.2
"""
)
"""Leads, a kerf, joints, corners, weights and margins."""

CELLED = (
    QUICK
    + """
[cell]
near_miss_mm = 5
stand_off_mm = 2
[cell.head]
body_radius_mm = 35
nozzle_radii_mm = [2, 15]
[[cell.fixture]]
name = "post"
size_mm = [60, 60, 900]
xyz_mm = [900, 300, 450]
rpy_deg = [0, 0, 30]
[[cell.fixture]]
name = "pin"
cylinder_mm = [80, 300]
xyz_mm = [-900, 300, 450]
rpy_deg = [0, 90, 0]
[[cell.pair]]
between = ["post", "head"]
near_miss_mm = 8
[[cell.pair]]
between = ["post", "arm"]
allowed = "it bends"
"""
)
"""Two contours that are clear of a post, by pairs of their own."""

PRODUCT = """
[[robot.external]]
model = "kuka_dkp400.tilt"
xyz_mm = [1600, 0, 0]
rpy_deg = [0, 0, 30]
acceleration_deg_s2 = 120

[[robot.external]]
model = "kuka_dkp400.table"
xyz_mm = [1600, 0, 0]
rpy_deg = [0, 0, 30]
acceleration_deg_s2 = 240
"""
"""A positioner of the library."""

CARRIED = RAIL_AND_TABLE.replace("axis = [0, 0, 1]", "axis = [0.1, 0, 1]")
UNITS = '[program.rapid]\nmechanical_units = ["TRACK", "STATION"]\n'
TURNED = QUICK.replace("[tool]", CARRIED + "[tool]").replace("spacing_mm = 1", "spacing_mm = 2")
TURNED += UNITS
"""On a rail, with a table whose axis leans: what a direction is made a unit vector of matters."""


def scripted(folder, text):
    """The job of a text beside the part of the demo, and its script there."""
    shutil.copy(DEMO / "b_pillar.step", folder)
    path = folder / "job.toml"
    path.write_text(text)
    job = read_job(path)
    script = folder / "job.py"
    script.write_text(python_script(prepare(job)))
    return job, script


@pytest.mark.slow
@pytest.mark.parametrize(
    "text", [QUICK, FEATURES, CELLED, TURNED], ids=["plain", "features", "cell", "external"]
)
def test_the_script_comes_to_the_plans_and_the_program_of_the_job(tmp_path, text):
    job, script = scripted(tmp_path, text)
    made = runpy.run_path(str(script))
    result = run_job(job)
    assert [plan.name for plan in made["plans"]] == [cut.name for cut in result.cuts]
    for plan, cut in zip(made["plans"], result.cuts, strict=True):
        # The same numbers go the same way.
        assert plan.cost == pytest.approx(cut.plan.cost, rel=1e-9)
        assert plan.q == pytest.approx(cut.plan.q, abs=1e-9)
    texts = program_texts(result)
    for name in texts.program:
        assert (tmp_path / "out" / name).read_text() == texts.files[name]


def test_the_script_says_units_and_keeps_what_the_job_says(tmp_path):
    _, script = scripted(tmp_path, QUICK)
    text = script.read_text()
    assert "gamma_step=np.radians(3)" in text
    assert "acceleration=np.radians([320, 270, 420, 1300, 1400, 2000])" in text
    assert "path.resample(spacing=1 * MM)" in text
    assert "3 * M_MIN" in text
    assert max(map(len, text.splitlines())) < 110


def test_the_script_says_external_axes_in_their_units(tmp_path):
    _, script = scripted(tmp_path, TURNED)
    text = script.read_text()
    assert "lower=-400 * MM" in text
    assert "velocity=1000 * MM" in text
    assert "acceleration=np.radians(180)" in text
    assert text.count("endless=True") == 1


def test_the_script_has_external_axes_of_the_library_as_they_stand(tmp_path):
    job, script = scripted(tmp_path, QUICK + PRODUCT)
    names = {"__file__": str(script)}
    exec(script.read_text().split("# The options of every plan")[0], names)
    arm = names["arm"]
    for made, meant in zip(arm.externals, job.robot.externals, strict=True):
        assert (made.name, made.kind, made.carries) == (meant.name, meant.kind, meant.carries)
        assert made.axis.tolist() == meant.axis.tolist()
        assert made.point.tolist() == meant.point.tolist()
    assert arm.joint_limits().upper.tolist() == job.robot.joint_limits().upper.tolist()
    assert [each.tolist() for each in arm.speed_limits()] == [
        each.tolist() for each in job.robot.speed_limits()
    ]


def test_names_cannot_become_code(tmp_path):
    name = """x\"\"\" # ' \\ {y} é"""
    text = QUICK.replace('name = "slot"', f"name = {json.dumps(name)}")
    job, script = scripted(tmp_path, text)
    assert name in [spec.name for spec in job.contours]
    made = runpy.run_path(str(script))
    assert [plan.name for plan in made["plans"]] == [spec.name for spec in job.contours]


@pytest.mark.slow
def test_a_cell_is_that_of_the_job(tmp_path):
    job, script = scripted(tmp_path, CELLED)
    made, meant = runpy.run_path(str(script))["cell"], prepare(job).cell
    assert made.names == meant.names
    assert made.pair_names == meant.pair_names
    assert made.unjudged == meant.unjudged
    assert made.required.tolist() == meant.required.tolist()
    q = np.array([[0.1, -0.2, 0.3, 0.4, 1.0, 0.6], [-0.6, 0.3, -0.2, 1.0, -1.1, 0]])
    assert made.distances(q) == pytest.approx(meant.distances(q), abs=1e-12)


def test_a_script_fails_where_a_guarantee_of_its_job_is_not_kept(tmp_path):
    asked = QUICK.replace("[plan]\n", '[plan]\nbetween_nodes = "guaranteed"\n')
    assert "faults" not in scripted(tmp_path, QUICK)[1].read_text().partition("kept.done")[2][:80]
    narrow = asked.replace("[program]\n", "[program]\nzone_mm = 0.05\n")
    _, script = scripted(tmp_path, narrow)
    with pytest.raises(SystemExit, match="between the nodes joint"):
        runpy.run_path(str(script))
    assert not list((tmp_path / "out").glob("*"))
    stopping = asked.replace("[program]\n", "[program]\nzone_mm = 0\n")
    with pytest.raises(InputError, match='between_nodes = "guaranteed" without a proof'):
        scripted(tmp_path, stopping)


def test_solids_from_files_are_refused(tmp_path):
    fixture = """
[cell]
near_miss_mm = 5
[[cell.fixture]]
name = "rest"
file = "b_pillar.step"
xyz_mm = [3000, 0, 0]
"""
    with pytest.raises(InputError, match=r"solids from files in \[cell\]"):
        scripted(tmp_path, QUICK + fixture)


def test_what_a_script_has_no_lines_for_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\[sequence\].*best") as refused:
        scripted(tmp_path, WHOLE)
    assert "\n" not in str(refused.value)
