"""`kerfpath new`: the first job of a drawing; what is said to a drawing in the place of a job."""

import json

import ezdxf
import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from tests.cad.test_meshes import box, square_tube, stl
from tests.cad.test_part import write_step

import foreign
from commands import assert_refused, run
from kerfpath.cad import read
from kerfpath.errors import InputError
from kerfpath.job import Drawing, check_job, foresee, job_text, prepare, read_job
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


def test_how_the_drawing_was_read_is_in_the_job(tmp_path):
    table = tmp_path / "points.csv"
    angle = np.linspace(0, 2 * np.pi, 41)
    rows = np.c_[60 * np.cos(angle), 40 * np.sin(angle), 0 * angle]
    table.write_text("East,North,Up\n" + "".join(f"{x:.6f},{y:.6f},{z}\n" for x, y, z in rows))
    assert_refused(run("new", table.name, cwd=tmp_path), "--columns", "--axis 0 0 -1")
    given = ["--columns", "x=East,y=North,z=Up", "--axis", "0", "0", "-1", "--unit", "mm"]
    made = run("new", table.name, *given, "--gap-mm", "0.2", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    read_back = read_job(table.with_suffix(".toml")).drawing
    assert (read_back.unit, read_back.gap) == ("mm", pytest.approx(2e-4))
    assert read_back.columns == {"x": "East", "y": "North", "z": "Up"}
    assert read_back.axis.tolist() == [0, 0, -1]


def test_a_drawing_of_open_lines_gets_a_job_that_cuts_them(tmp_path):
    drawing = ezdxf.new(units=4)
    drawing.modelspace().add_line((0, 0), (200, 0))
    drawing.saveas(tmp_path / "mark.dxf")
    job = tmp_path / "mark.toml"
    job.write_text(job_text(read(tmp_path / "mark.dxf"), job))
    assert not foresee(prepare(read_job(job), read(tmp_path / "mark.dxf")))
    drawing.modelspace().add_circle((100, 100), 20)
    drawing.saveas(tmp_path / "both.dxf")
    text = job_text(read(tmp_path / "both.dxf"), job)
    assert "1 open line (0/line1) not in it" in text
    assert text.count("[[contour]]") == 1


def test_a_gap_that_may_be_a_slip_says_what_would_close_it(tmp_path):
    drawing = ezdxf.new(units=4)
    for ends in (((0, 0), (90, 0)), ((90, 0.3), (90, 60)), ((90, 60), (0, 0))):
        drawing.modelspace().add_line(*ends)
    drawing.saveas(tmp_path / "slip.dxf")
    (note,) = [one for one in read(tmp_path / "slip.dxf").notes if one.startswith("open line")]
    assert "set gap_mm = 0.31 in [part]" in note
    assert read(tmp_path / "slip.dxf", gap=0.31e-3).loops[0].closed


def test_bends_are_slowed_down(tmp_path):
    flat, bent = drawn(tmp_path / "plate.dxf"), tmp_path / "bent.csv"
    x = np.linspace(0, 1, 50)
    rows = np.c_[100 * x, 0 * x, 0 * x, np.sin(x), 0 * x, np.cos(x)]
    text = "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows)
    bent.write_text(f"x_mm,y_mm,z_mm,nx,ny,nz\n{text}")
    job = tmp_path / "job.toml"
    assert "\n# feed = " in job_text(read(flat), job)
    job.write_text(job_text(read(bent), job))
    assert read_job(job).options.feed == "dip"


def test_a_contour_out_of_reach_is_told_where_and_what_to_do(tmp_path):
    drawing = drawn(tmp_path / "long.dxf", size=4000.0)
    job = tmp_path / "long.toml"
    job.write_text(job_text(read(drawing), job))
    said = "".join(check_job(read_job(job)).warnings)
    assert "0/outer: the robot has no pose at" in said
    assert "unreachable" in said
    assert "kerfpath layout long.toml --robots" in said


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
    job.write_text(job_text(read(drawing, meant), job, drawing=Drawing(file=drawing, unit=meant)))
    assert run("check", job).returncode == 0
    assert not [note for note in read(drawing, part.unit).notes if "unit?" in note]  # confirmed


def test_a_part_of_likely_size_asks_nothing(tmp_path):
    for unit, size in ((4, 6.0), (4, 19_000.0), (6, 1.8), (1, 100.0)):
        part = read(drawn(tmp_path / "plate.dxf", unit, size))
        assert not [note for note in part.notes if "unit?" in note]
        assert np.ptp(part.bounding_box[:, 0]) > 0


@pytest.mark.parametrize(("radius", "spacing"), [(60.0, "2"), (4.0, "1"), (1.0, "0.51")])
def test_nodes_are_close_enough_for_small_radii(tmp_path, radius, spacing):
    path = tmp_path / "slot.dxf"
    drawing = ezdxf.new(units=4)
    end = (radius + 20, 0, 0, 0, 1), (radius + 20, 2 * radius, 0, 0, 0)  # bulge 1: half a circle
    ends = [(0, 2 * radius, 0, 0, 1), (0, 0, 0, 0, 0), *end]
    drawing.modelspace().add_lwpolyline(ends, close=True)
    drawing.saveas(path)
    text = job_text(read(path), tmp_path / "slot.toml")
    assert f"spacing_mm = {spacing}\n" in text


def test_a_small_circle_is_slower_by_the_lag_of_the_joints(tmp_path):
    """A low-pass of sigma leaves v^2 sigma^2 / (2 r) of the radius off, here at most 0.055 mm."""
    path = tmp_path / "plate.dxf"
    drawing = ezdxf.new(units=4)
    drawing.modelspace().add_lwpolyline([(0, 0), (200, 0), (200, 90), (0, 90)], close=True)
    for x, radius in ((30, 4.0), (80, 20.0), (160, 30.0)):
        drawing.modelspace().add_circle((x, 45), radius)
    drawing.saveas(path)
    job = tmp_path / "plate.toml"
    job.write_text(job_text(read(path), job))
    tasks = (each.task for each in prepare(read_job(job)).contours)
    speeds = {task.pick: round(task.speed * 60, 9) for task in tasks}
    small = speeds.pop("0/hole1")
    lost = (0.025 * small / 60) ** 2 / (2 * 0.004)
    assert 0.85 * 0.055e-3 < lost <= 0.055e-3  # the speed is rounded down to 0.1 m/min
    assert len(speeds) == 3
    assert set(speeds.values()) == {3.0}


def plate(path, *holes):
    """A DXF of a plate with round holes, (number, radius) each."""
    drawing = ezdxf.new(units=4)
    space = drawing.modelspace()
    radii = [radius for number, radius in holes for _ in range(number)]
    width = 20 * len(radii) + 20
    space.add_lwpolyline([(0, 0), (width, 0), (width, 90), (0, 90)], close=True)
    for k, radius in enumerate(radii):
        space.add_circle((20 + 20 * k, 30), radius)
    drawing.saveas(path)
    return path


def test_a_job_has_all_loops_and_one_table_for_many_alike(tmp_path):
    path, job = plate(tmp_path / "plate.dxf", (7, 8.0), (5, 4.0), (3, 9.0)), tmp_path / "plate.toml"
    text = job_text(read(path), job)
    job.write_text(text)
    tasks = [each.task for each in prepare(read_job(job)).contours]
    assert sorted(task.pick for task in tasks) == sorted(loop.name for loop in read(path).loops)
    # Two groups by their size; the three largest and the outline by name.
    assert (text.count("[contour.pick_all]"), text.count("pick = ")) == (2, 4)
    assert "16 of 16 loops" in text
    by_size = {}
    for task in tasks:
        loop = read(path).loop(task.pick)
        by_size.setdefault(loop.diameter and round(loop.diameter, 6), set()).add(task.speed)
    assert {len(speeds) for speeds in by_size.values()} == {1}


def test_a_job_of_some_of_very_many_holes_says_how_to_take_all(tmp_path):
    path, job = plate(tmp_path / "plate.dxf", (260, 8.0)), tmp_path / "plate.toml"
    text = job_text(read(path), job)
    assert "250 of 261 loops" in text
    instead = '[contour.pick_all]\nkind = "inner"'
    assert instead.split("\n")[1] in text[: text.index("[[contour]]")]
    table = "[[contour]]\nspeed_m_min = 2\nspacing_mm = 1.6\n" + instead
    job.write_text(text[: text.index("[[contour]]")] + table)
    assert len(prepare(read_job(job)).contours) == 260


def test_a_loop_all_the_way_round_comes_with_the_lines_of_a_rotary_axis(tmp_path):
    """They are comments, as there may be none; without the signs the job is read and checked."""
    path = tmp_path / "tube.step"
    wall = [BRepPrimAPI_MakeCylinder(radius, 200.0).Shape() for radius in (25.0, 23.0)]
    write_step(path, BRepAlgoAPI_Cut(*wall).Shape())
    job = tmp_path / "tube.toml"
    text = job_text(read(path), job)
    assert "all the way round" in text
    start = text.index("# [[robot.external]]")
    lines, rest = text[start:].split("\n\n", 1)
    job.write_text(text[:start] + lines.removeprefix("# ").replace("\n# ", "\n") + "\n\n" + rest)
    with_axis = read_job(job)
    (axis,) = with_axis.robot.externals
    assert axis.carries == "part"
    assert np.allclose(np.abs(axis.axis @ with_axis.placement[:3, :3]), [0, 0, 1])


HANDED_ON = {
    "sort": ["points.csv", "--sort", "closed"],
    "section": ["box.stl", "--unit", "mm", "--section", "0", "0", "1", "--section-mm", "20"],
    "beam": ["cut.script", "--beam", "digital_out[2]"],
    "drawing_frame": ["framed.dxf", "--drawing-frame", "cut"],
}


@pytest.mark.parametrize("key", HANDED_ON)
def test_what_a_drawing_needs_is_handed_on_to_its_job(tmp_path, key):
    angle = np.random.default_rng(1).permutation(np.linspace(0, 2 * np.pi, 60, endpoint=False))
    rows = "".join(f"{60 * np.cos(a):.6f},{40 * np.sin(a):.6f},0,0,0,1\n" for a in angle)
    (tmp_path / "points.csv").write_text(f"x_mm,y_mm,z_mm,nx,ny,nz\n{rows}")
    (tmp_path / "cut.script").write_text(foreign.TEXTS["trim.script"])
    stl(tmp_path / "box.stl", box(90, 60, 40))
    framed = ezdxf.new(units=4)
    framed.modelspace().add_lwpolyline([(0, 0), (180, 0), (180, 90), (0, 90)], close=True)
    framed.modelspace().add_lwpolyline([(20, 20), (160, 20), (160, 70), (20, 70)], close=True)
    framed.modelspace().add_circle((90, 45), 10)
    framed.saveas(tmp_path / "framed.dxf")
    name, *given = HANDED_ON[key]
    made = run("new", name, *given, "--out", "first.toml", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    assert f"\n{key} = " in (tmp_path / "first.toml").read_text()
    job = read_job(tmp_path / "first.toml")
    listed = json.loads(run("contours", name, *given, "--json", cwd=tmp_path).stdout)
    assert [loop.name for loop in job.read_part().loops] == [one["name"] for one in listed["loops"]]


def test_what_would_be_cut_from_below_is_not_in_a_first_job(tmp_path):
    """A tube has holes above; its ends would need a beam from below, unless something turns it."""
    job = tmp_path / "tube.toml"
    write_step(tmp_path / "tube.step", square_tube(3))
    text = job_text(read(tmp_path / "tube.step"), job)
    assert text.count("[[contour]]") == 3
    assert "# 2 loops (skin1/outer2, ...) not in it: as the part lies, the beam would" in text
    job.write_text(text)
    assert not check_job(read_job(job)).warnings
    write_step(tmp_path / "bare.step", square_tube(0))
    assert job_text(read(tmp_path / "bare.step"), job).count("[[contour]]") == 2


def test_points_alone_are_told_all_that_they_lack(tmp_path):
    (tmp_path / "bare.csv").write_text("0,0,0\n9,0,0\n9,9,0\n")
    assert_refused(run("new", "bare.csv", cwd=tmp_path), "--axis 0 0 -1", "--unit mm")
    given = ("--axis", "0", "0", "-1", "--unit", "mm")
    assert run("new", "bare.csv", *given, cwd=tmp_path).returncode == 0
