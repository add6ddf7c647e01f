"""[[robot.external]]: axes of a job in their own units, and what is wrong with one, in a line."""

import numpy as np
import pytest

from jobs import DEMO
from kerfpath import InputError
from kerfpath.job import read_job
from kerfpath.job.format import cell_of_job

RAIL = """
[[robot.external]]
name = "rail"
kind = "linear"
carries = "robot"
axis = [0, 1, 0]
lower_mm = -1500
upper_mm = 1500
velocity_mm_s = 1000
acceleration_mm_s2 = 1500
home_mm = 200
"""
TABLE = """
[[robot.external]]
name = "table"
kind = "rotary"
carries = "part"
axis = [0, 0, 1]
point_mm = [1200, 0, 500]
endless = true
velocity_deg_s = 90
acceleration_deg_s2 = 180
"""


def job(tmp_path, tables, extra=""):
    text = (DEMO / "b_pillar.toml").read_text()
    (tmp_path / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    path = tmp_path / "job.toml"
    path.write_text(text.replace("[tool]", f"{tables}\n[tool]", 1) + extra)
    return path


def test_axes_are_read_in_their_own_units(tmp_path):
    home = "\n[sequence]\nhome_deg = [0, -20, 10, 0, 60, 0]\n"
    read = read_job(job(tmp_path, RAIL + TABLE, home))
    robot = read.robot
    rail, table = robot.externals
    assert (rail.name, rail.kind, rail.carries) == ("rail", "linear", "robot")
    assert (table.name, table.kind, table.carries) == ("table", "rotary", "part")
    np.testing.assert_allclose(table.point, [1.2, 0, 0.5])
    np.testing.assert_allclose(robot.lower[6:], [-1.5, -np.pi])
    np.testing.assert_allclose(robot.upper[6:], [1.5, np.pi])
    np.testing.assert_allclose(robot.velocity[6:], [1.0, np.pi / 2])
    np.testing.assert_allclose(robot.acceleration[6:], [1.5, np.pi])
    assert robot.endless[6:].tolist() == [False, True]
    np.testing.assert_allclose(read.home[6:], [0.2, 0.0])
    assert read.options.resolve(robot, 0.01).weights.shape == (8,)


FAULTS = [
    ("upper_mm = 1500\n", "", "robot.external.upper_mm: expected every limit of the axis, got no"),
    ("velocity_mm_s = 1000\n", "", "external.velocity_mm_s: expected every limit of the axis"),
    ("velocity_mm_s = 1000", "velocity_deg_s = 90", "expected velocity_mm_s of a linear axis"),
    ("axis = [0, 1, 0]", "axis = [0, 0, 0]", "robot.external.axis: expected a direction"),
    ("axis = [0, 1, 0]", "axis = [0, 1]", r"robot.external.axis: .*got \[0, 1\]"),
    ("lower_mm = -1500", "lower_mm = 2500", "external.upper_mm: expected upper_mm not below"),
    ("home_mm = 200", "home_mm = 2000", "external.home_mm: expected a home from -1500 to 1500"),
    ("home_mm = 200", "endless = true", "external.endless: expected false of a linear axis"),
    ("home_mm = 200", "point_mm = [0, 0, 0]", "point_mm: expected point_mm only of a rotary axis"),
    ('name = "rail"', 'name = "a rail"', "robot.external.name: expected a name of letters"),
    ('name = "rail"', 'name = "table"', "external.name: expected a name that no other external"),
    ('kind = "linear"', 'kind = "belt"', 'robot.external.kind: .*got "belt"'),
    ('carries = "robot"\n', "", "robot.external.carries: expected what it moves"),
    ("home_mm = 200", "home = 200", r"expected a key of \[\[robot.external\]\]"),
    ("endless = true", "endless = true\nlower_deg = -10", "expected no lower_deg of an endless"),
    ("endless = true\n", "", "external.lower_deg: expected every limit of the axis"),
    ("point_mm = [1200, 0, 500]\n", "", "external.point_mm: expected a point of its axis"),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_a_fault_is_said_in_one_line(old, new, message, tmp_path):
    tables = RAIL + TABLE
    assert tables.count(old) == 1
    with pytest.raises(InputError, match=message):
        read_job(job(tmp_path, tables.replace(old, new)))


def test_fixtures_stand_on_the_ground_or_on_an_axis(tmp_path):
    clamp = """
[[cell.fixture]]
name = "clamp"
size_mm = [100, 100, 100]
xyz_mm = [1500, 400, 100]
on = "table"
"""
    path = job(tmp_path, RAIL + TABLE)
    text = path.read_text()
    assert text.count("\n[cell]") == 0
    path.write_text(
        text
        + "\n[cell]\nnear_miss_mm = 5\n"
        + clamp
        + clamp.replace('"clamp"', '"post"').replace('on = "table"', "").replace("400", "800")
    )
    read = read_job(path)
    cell = cell_of_job(read, read.read_part())
    moves = {body.name: cell.chain.moves_with(body.frame) for body in cell.bodies}
    assert moves["clamp"] == moves["part"] == "table"
    assert moves["post"] == moves["floor"] == "ground"
    assert moves["base"] == "rail"
    assert moves["nozzle"] == "joint 6"
    path.write_text(path.read_text().replace('on = "table"', 'on = "crane"'))
    wrong = read_job(path)
    part, said = wrong.read_part(), r'fixture\.on: expected the name of a .*"crane"; there are'
    with pytest.raises(InputError, match=said):
        cell_of_job(wrong, part)


def test_more_than_three_axes_are_refused(tmp_path):
    four = "".join(RAIL.replace('"rail"', f'"rail{i}"') for i in range(4))
    with pytest.raises(InputError, match=r"robot\.external: "):
        read_job(job(tmp_path, four))


def test_weights_are_one_for_every_joint_and_axis(tmp_path):
    path = job(tmp_path, RAIL)
    text = path.read_text().replace("[plan]", "[plan]\nweights = [1, 1, 1, 1, 1, 1]", 1)
    path.write_text(text)
    with pytest.raises(InputError, match=r"expected 7 numbers, .* 1 of them for external axes"):
        read_job(path)
