"""A cell from the page: a drawing begins a job; robots have pictures, and facts to choose by."""

import asyncio
import tomllib

import ezdxf
import pytest

from cell.test_cell import stl_bytes
from conftest import ROOT
from jobs import DEMO
from kerfpath.cell import box
from kerfpath.errors import InputError
from kerfpath.job import read_job
from kerfpath.robots import robot, robot_ids
from kerfpath.studio.document import Document
from kerfpath.studio.options import options_message
from kerfpath.studio.session import Session
from studio.talk import client_of

JOB = """\
[robot]
model = "kuka_kr60_ha"
acceleration_ratio = "payload_60kg"
[tool]
head = "laser-head-90"
[program]
language = "krl"
"""


@pytest.fixture
def session(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    made = Session(Document(path))
    yield made
    made._answers.close()
    made._planning.close()


def plate(folder, units=4):
    drawing = ezdxf.new()
    drawing.header["$INSUNITS"] = units
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0), (300, 0), (300, 200), (0, 200)], close=True)
    space.add_circle((80, 100), 20)
    drawing.saveas(folder / "drawn.dxf")
    return (folder / "drawn.dxf").read_bytes()


def begin(session, name, data, **more):
    asyncio.run(session.begin(name, data, **({"robot": "kuka_kr60_ha", "unit": None} | more)))


def test_a_drawing_begins_a_job_that_can_be_undone(session, tmp_path):
    data = plate(tmp_path)
    begin(session, "plate.dxf", data)
    text = session.document.text
    found = tomllib.loads(text)
    assert (found["part"]["file"], found["robot"]["model"]) == ("plate.dxf", "kuka_kr60_ha")
    assert len(found["contour"]) == 2
    assert (tmp_path / "plate.dxf").read_bytes() == data
    read_job(session.document.file)  # nothing has to be written by hand
    begin(session, "plate.dxf", data)
    assert not (tmp_path / "plate-2.dxf").exists(), "it is there already"
    begin(session, "plate.dxf", data + b"\n")
    assert (tmp_path / "plate.dxf").read_bytes() == data, "no file is overwritten"
    assert tomllib.loads(session.document.text)["part"]["file"] == "plate-2.dxf"
    session.document.undo()
    session.document.undo()
    assert session.document.text == JOB


def test_what_is_no_drawing_is_refused_and_leaves_no_file(session, tmp_path):
    data = plate(tmp_path, units=6)  # 300 m
    there = sorted(file.name for file in tmp_path.iterdir())
    for name in ("../plate.dxf", "job.toml", "plate", "a/b.dxf", ".."):
        with pytest.raises(InputError, match="expected a drawing"):
            begin(session, name, data)
    with pytest.raises(InputError):
        begin(session, "broken.step", b"nothing")
    with pytest.raises(InputError, match="unit"):
        begin(session, "plate.dxf", data)
    assert sorted(file.name for file in tmp_path.iterdir()) == there
    assert session.document.text == JOB
    begin(session, "plate.dxf", data, unit="mm")
    assert tomllib.loads(session.document.text)["part"]["unit"] == "mm"


def test_a_solid_is_kept_beside_the_job_and_measured(session, tmp_path):
    data = stl_bytes(box([80, 120, 60]))

    def solid(name, data, unit="mm"):
        return asyncio.run(session.solid(name, data, unit=unit))

    assert solid("clamp.stl", data) == {
        "file": "clamp.stl",
        "unit": "mm",
        "bounds_mm": [[-40, -60, -30], [40, 60, 30]],
    }
    assert solid("clamp.stl", data, "cm")["bounds_mm"][1] == [400, 600, 300]
    found = solid("b_pillar.step", (DEMO / "b_pillar.step").read_bytes())
    assert set(found) == {"file", "bounds_mm"}  # a STEP file says its unit
    there = sorted(file.name for file in tmp_path.iterdir())
    for name, bad, said in (
        ("clamp.stl", data[:-50], "neither a text STL nor a complete binary one"),
        ("clamp.dxf", plate(tmp_path), "expected a solid, such as .step"),
        ("../clamp.stl", data, "expected a solid"),
    ):
        with pytest.raises(InputError, match=said) as refused:
            solid(name, bad)
        assert str(tmp_path) not in str(refused.value)
    assert sorted({file.name for file in tmp_path.iterdir()} - {"drawn.dxf"}) == there
    assert session.document.text == JOB


def test_the_page_can_choose_among_all_robots_and_see_them():
    known = {each.id: each for each in options_message(None).robots}
    assert set(known) == set(robot_ids())
    found = known["kuka_kr60_ha"]
    assert (found.reach, found.languages) == (robot("kuka_kr60_ha").reach, ["krl"])
    client = client_of(ROOT / "src" / "kerfpath" / "studio" / "client" / "index.html")
    answer = client.get("/robot/kuka_kr60_ha.svg")
    assert answer.headers["content-type"].startswith("image/svg+xml")
    assert f"{found.reach:g} m" in answer.text
    assert client.get("/robot/nonsense.svg").status_code == 404
