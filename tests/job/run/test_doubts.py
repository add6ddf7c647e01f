"""A contour that is cut through the part itself, or from below, is warned of."""

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.StlAPI import StlAPI_Writer

from cad.test_part import write_step
from commands import run
from kerfpath import cad
from kerfpath.contour import Contour
from kerfpath.job import read_job
from kerfpath.job.run.foresee import both_sides, sides_in_doubt

HEIGHT, WALL = 60.0, 3.0


def box(low, high):
    return BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Shape()


def cut(shape, tool):
    return BRepAlgoAPI_Cut(shape, tool).Shape()


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """A square tube along x with a hole of 20 mm in its upper wall."""
    shape = cut(box((0, 0, 0), (200, 60, HEIGHT)), box((-1, 3, 3), (201, 57, HEIGHT - WALL)))
    drill = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(100, 30, 50), gp_Dir(0, 0, 1)), 10, 20).Shape()
    path = tmp_path_factory.mktemp("tube") / "tube.step"
    write_step(path, cut(shape, drill))
    return path


def job(tube, side, rpy=(0, 0, 0), more=""):
    hole = next(
        loop.name for loop in cad.read(tube).loops
        if loop.side == side and loop.diameter is not None
    )  # fmt: skip
    path = tube.with_name(f"{side}{rpy[0]}.toml")
    path.write_text(f"""
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
floor = false
[tool]
head = "laser-head-45"
[part]
file = "tube.step"
xyz_mm = [1200, 0, 700]
rpy_deg = {list(rpy)}
[[contour]]
pick = "{hole}"
name = "hole"
speed_m_min = 1
count = 24
[plan]
gamma_step_deg = 15
certify = false
[program]
language = "none"
{more}""")
    return path


def warnings(path):
    return [line for line in run("check", path).stdout.splitlines() if "warning: " in line]


def test_the_outer_side_from_above_is_not_doubted(tube):
    assert not warnings(job(tube, "outer"))


def test_a_hole_picked_on_the_inner_side_of_a_tube_is_warned_of(tube):
    through, below = warnings(job(tube, "inner"))
    inside = HEIGHT - 2 * WALL  # from the edge of the hole inside the tube to its lower wall
    assert f"hole: the beam passes the part itself {inside:.0f} mm before the tip" in through
    assert "outer side" in through
    assert "hole: the beam comes from below" in below


def test_a_part_turned_over_is_warned_of_by_check_plan_and_report(tube, tmp_path):
    turned = job(tube, "outer", rpy=(180, 0, 0))
    assert ["the beam comes from below" in line for line in warnings(turned)] == [True]
    made = run("plan", turned, "--out", tmp_path / "out")
    assert "note: hole: the beam comes from below" in made.stdout
    assert "the beam comes from below" in (tmp_path / "out" / "report.html").read_text()


def test_a_beam_along_a_wall_does_not_pass_the_part(tube):
    """The trim of an angle's flange runs along the other flange, which is not in the way."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1.0]]) * 0.1
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]])
    points = np.linspace([0.01, 0, 0], [0.09, 0, 0], 9)
    along = Contour(points, np.tile([0, 0, -1.0], (9, 1)))
    asked = read_job(job(tube, "outer"))
    assert not sides_in_doubt(asked, [("trim", along)], (vertices, faces))
    under = Contour(points + np.array([0, 0.03, -0.05]), np.tile([0, 0, -1.0], (9, 1)))
    (said,) = sides_in_doubt(asked, [("trim", under)], (vertices, faces))
    assert "50 mm before the tip" in said


def test_a_drawing_of_lines_has_nothing_to_pass(tube):
    none = np.empty((0, 3)), np.empty((0, 3), np.int64)
    line = Contour(np.eye(3)[:2], np.tile([0, 0, -1.0], (2, 1)))
    assert not sides_in_doubt(read_job(job(tube, "outer")), [("line", line)], none)


def drilled(shape, at, radius=5.0):
    axis = gp_Ax2(gp_Pnt(*at), gp_Dir(0, 0, 1))
    return cut(shape, BRepPrimAPI_MakeCylinder(axis, radius, 20).Shape())


@pytest.mark.parametrize("write", ["step", "stl"])
def test_a_sheet_that_is_cut_from_both_sides_is_warned_of(tmp_path, write):
    sheet = drilled(drilled(box((0, 0, 0), (120, 60, 2)), (30, 30, -5)), (80, 30, -5), 8.0)
    path = tmp_path / f"sheet.{write}"
    if write == "step":
        write_step(path, sheet)
    else:
        BRepMesh_IncrementalMesh(sheet, 0.05)
        StlAPI_Writer().Write(sheet, str(path))
    part = cad.read(path, unit="mm")
    names = {s: [loop.name for loop in part.loops if loop.side == s and loop.is_main]
             for s in ("outer", "inner")}  # fmt: skip
    assert [len(each) for each in names.values()] == [3, 3]
    (said,) = both_sides(part, [*names["outer"], *names["inner"]])
    assert said.count(" and ") >= 3  # a pair each
    assert 'side = "outer"' in said
    for each in names.values():
        assert both_sides(part, each) == []


def test_opposite_walls_of_a_tube_are_not_cut_from_both_sides(tmp_path):
    tube = cut(box((0, 0, 0), (200, 60, HEIGHT)), box((-1, 3, 3), (201, 57, HEIGHT - WALL)))
    path = tmp_path / "walls.step"
    write_step(path, drilled(drilled(tube, (100, 30, 50)), (100, 30, -5)))
    part = cad.read(path)
    holes = [loop.name for loop in part.loops if loop.side == "outer" and loop.diameter]
    assert len(holes) == 2
    assert both_sides(part, holes) == []
