"""`kerfpath new`: the first job of a drawing; what is said to a drawing in the place of a job."""

import json

import ezdxf
import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath.cad import read
from kerfpath.errors import InputError
from kerfpath.job import check_job, foresee, job_text, prepare, read_job
from kerfpath.robots import robot

REST = """
[tool]
head = "laser-head-45"
[part]
file = "plate.dxf"
xyz_mm = [700, 0, 300]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "0/hole1"
speed_m_min = 1
count = 20
"""


def drawn(path, unit=4, size=180.0):
    """A DXF of a plate with a hole; by default in mm."""
    drawing = ezdxf.new(units=unit)
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0), (size, 0), (size, size / 2), (0, size / 2)], close=True)
    space.add_circle((size / 3, size / 4), size / 6)
    drawing.saveas(path)
    return path


def test_a_new_job_passes_its_check_and_is_never_overwritten(tmp_path):
    drawing = drawn(tmp_path / "door plate.dxf")
    made = run("new", drawing.name, "--robot", "KUKA KR 30 HA", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    job = drawing.with_suffix(".toml")
    text = job.read_text()
    assert 'model = "kuka_kr30_ha"\n' in text  # as asked for, not called a guess
    assert 'language = "krl"' in text
    assert run("check", job.name, cwd=tmp_path).returncode == 0
    assert all(start.poses for start in check_job(read_job(job)).starts)
    job.write_text(text + "# mine\n")
    assert_refused(run("new", drawing.name, cwd=tmp_path), job.name, "never overwritten", "--out")
    assert job.read_text().endswith("# mine\n")


def test_without_a_robot_the_job_has_a_placeholder_that_says_so(tmp_path):
    drawing = drawn(tmp_path / "plate.dxf")
    (tmp_path / "jobs").mkdir()
    job = tmp_path / "jobs" / "first.toml"
    said = json.loads(run("new", drawing, "--out", job, "--json").stdout)
    assert said["job"] == str(job)
    model = next(line for line in job.read_text().splitlines() if line.startswith("model"))
    assert "guess, a placeholder" in model
    assert read_job(job).part_file.resolve() == drawing  # relative to the job


@pytest.mark.parametrize(
    "name",
    [
        *("abb_irb1200_5_90", "fanuc_m20ia", "kuka_kr120_r2500_pro", "kuka_lbr_iiwa14_r820"),
        *("staubli_tx2_60", "ur_ur3e", "yaskawa_gp7"),
    ],
)
def test_the_job_of_every_robot_is_read_or_says_what_to_fill_in(tmp_path, name):
    job = tmp_path / "plate.toml"
    part = read(drawn(tmp_path / "plate.dxf"))
    job.write_text(job_text(part, job, robot=name))
    known = robot(name)
    if known.velocity is not None and known.joints == 6:
        assert not foresee(prepare(read_job(job), part))
        return
    missing = "lower_deg" if known.velocity is None else "acceleration_deg_s2"
    with pytest.raises(InputError, match=missing):
        read_job(job)
    assert f"# {missing} = [" in job.read_text()


@pytest.mark.parametrize("command", ["plan", "check", "speed"])
def test_a_drawing_in_the_place_of_a_job_is_told_how_to_get_one(tmp_path, command):
    drawn(tmp_path / "plate.dxf")
    assert_refused(run(command, "plate.dxf", cwd=tmp_path), "kerfpath new plate.dxf")
    assert_refused(run(command, "none.dxf", cwd=tmp_path), "no such file")


def test_a_job_in_the_place_of_a_drawing_or_a_plan_is_told_so(tmp_path):
    (tmp_path / "plate.toml").write_text("[part]\n")
    assert_refused(run("contours", tmp_path / "plate.toml"), "file in [part] of a job")
    assert_refused(run("audit", tmp_path / "plate.toml"), "kerfpath plan")


# A unit that is surely wrong is asked for.


@pytest.mark.parametrize(
    ("unit", "size", "asked", "meant"),
    [
        (6, 180.0, "the part is 180 m long in the unit of the file (m), and 180 mm in", "mm"),
        (5, 0.18, "the part is 1.8 mm long in the unit of the file (cm), and 180 mm in", "m"),
        (4, 2.5, "the part is 2.5 mm long in the unit of the file (mm), and 63.5 mm in", "in"),
        (1, 3600.0, "the part is 91.44 m long in the unit of the file (in), and 3.6 m in", "mm"),
    ],
)
def test_a_part_of_unlikely_size_asks_for_its_unit(tmp_path, unit, size, asked, meant):
    drawing = drawn(tmp_path / "plate.dxf", unit, size)
    asked += f' {meant}; set unit = "{meant}"'
    part = read(drawing)
    assert any(f"unit? {asked}" in note for note in part.notes)
    job = tmp_path / "plate.toml"
    job.write_text(f'[robot]\nmodel = "abb_irb1200_5_90"\n{REST}')
    checked = run("check", job)
    assert checked.returncode == 2
    assert "part.file: unit?" in checked.stderr
    assert asked in checked.stderr
    job.write_text(job_text(read(drawing, meant), job, unit=meant))
    assert run("check", job).returncode == 0
    assert not [note for note in read(drawing, part.unit).notes if "unit?" in note]  # confirmed


def test_a_part_of_likely_size_asks_nothing(tmp_path):
    for unit, size in ((4, 6.0), (4, 19_000.0), (6, 1.8), (1, 100.0)):
        part = read(drawn(tmp_path / "plate.dxf", unit, size))
        assert not [note for note in part.notes if "unit?" in note]
        assert np.ptp(part.bounding_box[:, 0]) > 0
