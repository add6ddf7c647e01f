"""`kerfpath contours` for every source, and the page that it draws."""

import json

import numpy as np
import pytest

from browser import figures
from commands import run
from kerfpath.report import DrawnLoop, render_drawing


@pytest.fixture(scope="module")
def drawings(tmp_path_factory, examples):
    folder = tmp_path_factory.mktemp("drawings")
    examples.write(folder)
    examples.write_iges(folder / "bracket.iges", examples.bracket())
    (folder / "line.csv").write_text("x_mm;y_mm;z_mm;nx;ny;nz\n0;0;0;0;0;1\n10,5;0;0;0;0;1\n")
    return folder


@pytest.mark.parametrize("name", ["bracket.step", "bracket.iges", "blank.dxf", "line.csv"])
def test_every_source_is_listed_and_drawn(drawings, name):
    html = drawings / f"{name}.html"
    result = run("contours", drawings / name, "--html", html)
    assert result.returncode == 0, result.stderr
    assert "largest gap" in result.stdout
    assert "shortest edge" in result.stdout
    data = json.loads(run("contours", drawings / name, "--json").stdout)
    shown = [loop for loop in data["loops"] if not loop["skin"] and loop["side"] != "edge"]
    (figure,) = figures(html.read_text())
    labels = [label["text"] for label in figure["layout"]["scene"]["annotations"]]
    assert labels == [loop["name"] for loop in shown]
    assert all(loop["name"] in result.stdout for loop in shown)
    everything = run("contours", drawings / name, "--all").stdout
    assert all(loop["name"] in everything for loop in data["loops"])


def test_faults_are_drawn_apart_and_names_are_escaped():
    loop = DrawnLoop(name="<b>", kind="outer", points=np.eye(3)[:2], fault=True)
    page = render_drawing("a & b", [loop], mesh=([[0, 0, 0]], [[0, 0, 0]]))
    assert "<h1>a &amp; b</h1>" in page
    (figure,) = figures(page)
    assert "1 trim line with faults" in [trace["name"] for trace in figure["data"]]
    assert figure["layout"]["scene"]["annotations"][0]["text"] == "&lt;b&gt;"


def test_names_lie_beside_each_other():
    """Of nine loops that begin within a millimetre in a plate of a metre; letters are 8 px wide."""
    plate = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    loops = [DrawnLoop(name="plate", kind="outer", points=plate[[0, 1, 2, 3, 0]])]
    for k in range(9):
        hole = (0.5 + 1e-4 * k + 0.1 * (plate - 0.5)) * [1, 1, 0]
        loops.append(DrawnLoop(name=f"hole{k}", kind="inner", points=hole[[2, 3, 0, 1, 2]]))
    (figure,) = figures(render_drawing("plate", loops, mesh=(plate, np.zeros((0, 3), np.int64))))
    seen = figure["layout"]["scene"]
    assert seen["dragmode"] == "pan"
    names = [each for each in seen["annotations"] if each["text"] != "plate"]
    assert len(names) == 9
    for one in names:
        for other in names:
            apart = abs(one["ax"] - other["ax"]) > 8 * 5 or abs(one["ay"] - other["ay"]) > 13
            assert one is other or apart


def test_bad_drawings_end_with_exit_code_2(drawings):
    (drawings / "bad.csv").write_text("1,2\n")
    result = run("contours", drawings / "bad.csv", "--unit", "mm")
    assert result.returncode == 2
    assert "line 1: without a header expected 6 columns" in result.stderr
