"""The drawing of a job: what may have been to cut and is left out stops the job, unless it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ezdxf.filemanagement import new

from jobs import ROBOT_AND_HEAD
from kerfpath.errors import InputError
from kerfpath.job import check_job, read_job

JOB = f"""\
{ROBOT_AND_HEAD}[part]
file = "blank.dxf"
xyz_mm = [1200, 0, 400]
rpy_deg = [0, 0, 0]
{{more}}
[[contour]]
pick = "0/outer"
speed_m_min = 2
spacing_mm = 2
"""


def blank(path: Path, kind: str) -> None:
    document = new(units=4)
    space = document.modelspace()
    space.add_circle((0, 0), 20)
    if kind == "spline":
        space.add_open_spline([(30, 0), (35, 5), (40, 0), (42, 3)]).dxf.degree = 9
    elif kind == "xref":
        document.blocks.new("OTHER").block.dxf.flags = 4
        space.add_blockref("OTHER", (0, 0))
    elif kind == "text":
        space.add_text("10 pieces")
    else:
        document.layers.add("HELP").off()
        space.add_circle((0, 0), 5, dxfattribs={"layer": "HELP"})
    document.saveas(path)


@pytest.mark.parametrize(("kind", "name"), [("spline", "SPLINE"), ("xref", "INSERT")])
def test_a_drawing_that_is_not_read_whole_is_refused(tmp_path: Path, kind: str, name: str) -> None:
    blank(tmp_path / "blank.dxf", kind)
    path = tmp_path / "job.toml"
    path.write_text(JOB.format(more=""))
    with pytest.raises(InputError) as refused:
        check_job(read_job(path))
    said = str(refused.value)
    assert said.startswith(f"{path}:7: part.file: expected a drawing that can be read completely")
    assert f"1 {name}" in said
    assert 'left_out = "accept"' in said
    path.write_text(JOB.format(more='left_out = "accept"'))
    part = read_job(path).read_part()
    assert [loop.name for loop in part.loops] == ["0/outer"]
    assert part.left_out[0].kind == name


@pytest.mark.parametrize("kind", ["text", "hidden"])
def test_what_is_not_to_cut_stops_no_job(tmp_path: Path, kind: str) -> None:
    blank(tmp_path / "blank.dxf", kind)
    path = tmp_path / "job.toml"
    path.write_text(JOB.format(more=""))
    part = read_job(path).read_part()
    assert len(part.loops) == 1
    assert len(part.left_out) == 1


def test_a_part_is_placed_by_its_centre(tmp_path: Path) -> None:
    document = new(units=4)
    document.modelspace().add_circle((70, -30), 20)
    document.saveas(tmp_path / "blank.dxf")
    path = tmp_path / "job.toml"
    text = JOB.replace("rpy_deg = [0, 0, 0]\n{more}", "rpy_deg = [10, 20, 30]\n{more}")
    path.write_text(text.format(more='placed_by = "centre"'))
    job = read_job(path)
    centre = job.placement @ [0.07, -0.03, 0, 1]
    np.testing.assert_allclose(centre[:3], [1.2, 0, 0.4], atol=1e-12)
    path.write_text(text.format(more=""))
    np.testing.assert_array_equal(read_job(path).placement[:3, 3], [1.2, 0, 0.4])
    np.testing.assert_array_equal(read_job(path).placement[:3, :3], job.placement[:3, :3])


def test_a_part_is_placed_by_a_coordinate_system_of_its_drawing(tmp_path: Path) -> None:
    document = new(units=4)
    document.modelspace().add_circle((70, -30), 20)
    document.ucs.new(
        "BENCH", dxfattribs={"origin": (50, 0, 0), "xaxis": (0, 1, 0), "yaxis": (-1, 0, 0)}
    )
    document.saveas(tmp_path / "blank.dxf")
    path = tmp_path / "job.toml"
    text = JOB.replace("rpy_deg = [0, 0, 0]\n{more}", "rpy_deg = [10, 20, 30]\n{more}")
    path.write_text(text.format(more=""))
    pose = read_job(path).placement
    path.write_text(text.format(more='frame = "BENCH"'))
    job = read_job(path)
    np.testing.assert_allclose(job.placement @ job.read_part().frame("BENCH"), pose, atol=1e-12)
    for wrong, words in (
        ('frame = "FLOOR"', "got 'FLOOR'; it names 'BENCH'"),
        ('frame = "BENCH"\nplaced_by = "centre"', "expected frame or placed_by, got both"),
        ("frame = 1", "part.frame: expected the coordinate system"),
    ):
        path.write_text(text.format(more=wrong))
        with pytest.raises(InputError, match=words) as refused:
            read_job(path)
        assert "\n" not in str(refused.value)


def test_a_job_says_axis_and_columns_where_the_drawing_does_not(tmp_path: Path) -> None:
    (tmp_path / "line.csv").write_text("Pos X,Pos Y,Pos Z\n0,0,0\n30,0,0\n30,5,1\n")
    path = tmp_path / "job.toml"
    more = 'unit = "mm"\naxis = [0, 0, -1]\ncolumns = { x = "pos x", y = "pos y", z = "pos z" }'
    text = JOB.replace("blank.dxf", "line.csv").replace("0/outer", "contour")
    path.write_text(text.format(more=more))
    part = read_job(path).read_part()
    assert [loop.kind for loop in part.loops] == ["open"]
    contour = part.contour("contour", closed=False)
    np.testing.assert_array_equal(contour.axes, [[0, 0, -1]] * 3)
    (tmp_path / "line.csv").write_text("0,0,0\n30,0,0\n30,5,1\n")
    path.write_text(text.format(more='unit = "mm"\naxis = [0, 0, -1]\ncolumns = ["x", "y", "z"]'))
    np.testing.assert_array_equal(read_job(path).read_part().bounding_box, part.bounding_box)


def test_a_job_cuts_a_tool_path(tmp_path: Path) -> None:
    (tmp_path / "trim.cls").write_text(
        "TOOL PATH/TRIM\nRAPID\nGOTO/0,0,0,0,0,1\nGOTO/30,0,0\nGOTO/30,5,1\n"
        "RAPID\nGOTO/0,9,0\nGOTO/9,9,0\n"
    )
    path = tmp_path / "job.toml"
    text = JOB.replace("blank.dxf", "trim.cls").replace("0/outer", "cut1")
    path.write_text(text.format(more='unit = "mm"'))
    job = check_job(read_job(path))
    assert [loop.name for loop in read_job(path).read_part().loops] == ["cut1", "cut2"]
    assert job is not None
    path.write_text(text.format(more=""))
    with pytest.raises(InputError, match=r"trim\.cls: states no length unit"):
        read_job(path).read_part()


def test_a_table_adds_lines_to_the_loops_of_the_drawing(tmp_path: Path) -> None:
    blank(tmp_path / "blank.dxf", "layer")
    path, table = tmp_path / "job.toml", tmp_path / "lines.csv"
    path.write_text(JOB.format(more='lines = "lines.csv"').replace("0/outer", "line1"))
    with pytest.raises(InputError, match=r"part\.lines: expected a table of points"):
        read_job(path)
    rows = ["contour,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z", "line1,0,0,5,0,0,-1"]
    rows += ["line1,30,0,5,0,0,-1", "line1,30,40,5,0,0,-1"]
    table.write_text("\n".join(rows))
    part = read_job(path).read_part()
    assert [(loop.name, loop.kind) for loop in part.loops] == [
        ("0/outer", "outer"), ("line1", "open")
    ]  # fmt: skip
    assert part.loop("line1").length == pytest.approx(0.07)
    assert part.contour("line1", closed=False).axes[0].tolist() == [0, 0, -1]
    table.write_text("\n".join(rows).replace("line1", "0/outer"))
    with pytest.raises(InputError, match="the drawing has a loop '0/outer', too"):
        read_job(path).read_part()
