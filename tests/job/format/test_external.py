"""[[robot.external]]: axes of a job in their own units, and what is wrong with one, in a line."""

import numpy as np
import pytest
from tests.urdf.test_externals import written

from jobs import DEMO
from kerfpath import InputError, Robot
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
    ("velocity_mm_s = 1000", "velocity_deg_s = 90", "expected velocity_mm_s for a linear axis"),
    (
        "axis = [0, 1, 0]",
        "axis = [0, 0, 0]",
        "robot.external.axis: expected the direction of the axis",
    ),
    ("axis = [0, 1, 0]", "axis = [0, 1]", r"robot.external.axis: .*got \[0, 1\]"),
    ("lower_mm = -1500", "lower_mm = 2500", "external.upper_mm: expected upper_mm not below"),
    ("home_mm = 200", "home_mm = 2000", "external.home_mm: expected a home from -1500 to 1500"),
    ("home_mm = 200", "endless = true", "external.endless: expected false for a linear axis"),
    ("home_mm = 200", "point_mm = [0, 0, 0]", "point_mm: expected point_mm only for a rotary axis"),
    ('name = "rail"', 'name = "a rail"', "robot.external.name: expected a name of letters"),
    ('name = "rail"', 'name = "table"', "external.name: expected a name that no other external"),
    ('kind = "linear"', 'kind = "belt"', 'robot.external.kind: .*got "belt"'),
    ('carries = "robot"\n', "", "robot.external.carries: expected what it moves"),
    ("home_mm = 200", "home = 200", r"expected a key of \[\[robot.external\]\]"),
    ("endless = true", "endless = true\nlower_deg = -10", "expected no lower_deg for an endless"),
    ("endless = true\n", "", "external.lower_deg: expected every limit of the axis"),
    ("point_mm = [1200, 0, 500]\n", "", "external.point_mm: expected a point of its axis"),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_a_fault_is_said_in_one_line(old, new, message, tmp_path):
    tables = RAIL + TABLE
    assert tables.count(old) == 1
    with pytest.raises(InputError, match=message):
        read_job(job(tmp_path, tables.replace(old, new)))


POSITIONER = """
[[robot.external]]
model = "kuka_dkp400.tilt"
xyz_mm = [1600, 0, 0]
rpy_deg = [0, 0, 90]
acceleration_deg_s2 = 120
lower_deg = -60

[[robot.external]]
model = "kuka_dkp400.table"
name = "plate"
xyz_mm = [1600, 0, 0]
rpy_deg = [0, 0, 90]
acceleration_deg_s2 = 240
home_deg = 90
"""
TRACK = """
[[robot.external]]
model = "kuka_kl4000"
rpy_deg = [0, 0, 90]
lower_mm = 0
upper_mm = 5000
acceleration_mm_s2 = 1500
"""


def test_a_product_of_the_library_is_completed_by_the_job(tmp_path):
    home = "\n[sequence]\nhome_deg = [0, -20, 10, 0, 60, 0]\n"
    read = read_job(job(tmp_path, TRACK + POSITIONER, home))
    robot = read.robot
    assert [(a.name, a.kind, a.carries) for a in robot.externals] == [
        ("rail", "linear", "robot"),
        ("tilt", "rotary", "part"),
        ("plate", "rotary", "part"),
    ]
    ways = [[0, 1, 0], [0, 1, 0], [0, 0, 1]]  # x of the products, turned by 90 deg, and z
    np.testing.assert_allclose([axis.axis for axis in robot.externals], ways, atol=1e-12)
    for axis in robot.externals[1:]:
        np.testing.assert_allclose(axis.point, [1.6, 0, 0.51])
    np.testing.assert_allclose(robot.lower[6:], [0, -np.pi / 3, -np.pi])
    np.testing.assert_allclose(robot.upper[6:], [5, np.pi / 2, np.pi])
    np.testing.assert_allclose(robot.velocity[6:], [1.89, np.radians(94.5), np.radians(126)])
    np.testing.assert_allclose(robot.acceleration[6:], [1.5, np.radians(120), np.radians(240)])
    assert robot.endless[6:].tolist() == [False, False, True]
    np.testing.assert_allclose(read.home[6:], [0, 0, np.pi / 2])


def test_a_product_may_stand_where_its_axes_were_measured(tmp_path):
    place = "xyz_mm = [1600, 0, 0]\nrpy_deg = [0, 0, 90]\nacceleration_deg_s2 = 240"
    measured = "axis = [0.01, 0, 1]\npoint_mm = [1601, 2, 0]\nacceleration_deg_s2 = 240"
    assert POSITIONER.count(place) == 1
    robot = read_job(job(tmp_path, POSITIONER.replace(place, measured))).robot
    np.testing.assert_allclose(robot.externals[1].point, [1.601, 0.002, 0])
    np.testing.assert_allclose(robot.externals[1].axis, np.array([0.01, 0, 1]) / np.hypot(0.01, 1))


PRODUCT_FAULTS = [
    ('"kuka_dkp400.tilt"', '"kuka_dkp400"', "external.model: expected an axis of the library"),
    ("= 120\n", "= 120\nkind = 'rotary'\n", "external.kind: expected no kind with model"),
    ("acceleration_deg_s2 = 120\n", "", "acceleration_deg_s2: expected every limit of the axis"),
    ("lower_deg = -60", "lower_mm = -60", "expected lower_deg for a rotary axis"),
    ("lower_deg = -60", "lower_deg = 95", "external.upper_deg: expected upper_deg not below"),
    ("lower_deg = -60", "axis = [1, 0, 0]", "expected axis and point_mm, or xyz_mm and rpy_deg"),
    ("home_deg = 90", "lower_deg = 0", "expected no lower_deg .* write endless = false, too"),
    ("home_deg = 90", "joint = 'a'", "expected no model with joint"),
    ('name = "plate"\nxyz_mm = [1600', "xyz_mm = [1500", "xyz_mm: expected .*1600.* same product"),
    ('name = "plate"\nxyz_mm = [1600, 0, 0]', "", "xyz_mm: expected the place of the product"),
    ("upper_mm = 5000\n", "", "external.upper_mm: expected every limit of the axis, got no"),
    ("lower_mm = 0", "xyz_mm = [0, 0, 0]", "xyz_mm: expected xyz_mm only for a rotary axis"),
    ("rpy_deg = [0, 0, 90]\nlower_mm", "lower_mm", "rpy_deg: expected the place of the product"),
]


@pytest.mark.parametrize(("old", "new", "message"), PRODUCT_FAULTS)
def test_a_fault_of_a_product_is_said_in_one_line(old, new, message, tmp_path):
    tables = TRACK + POSITIONER
    assert tables.count(old) == 1
    with pytest.raises(InputError, match=f"^[^\n]*{message}"):
        read_job(job(tmp_path, tables.replace(old, new)))


def test_two_rails_of_one_kind_are_a_gantry(tmp_path):
    across = TRACK.replace("[0, 0, 90]", "[0, 0, 0]\nname = 'across'\nhome_mm = 5000")
    robot = read_job(job(tmp_path, TRACK + across)).robot
    assert [axis.name for axis in robot.externals] == ["rail", "across"]
    ways = [[0, 1, 0], [1, 0, 0]]
    np.testing.assert_allclose([axis.axis for axis in robot.externals], ways, atol=1e-12)


def test_axes_of_a_product_come_in_its_order(tmp_path):
    first, second = POSITIONER.split("\n\n")
    with pytest.raises(InputError, match=r'"kuka_dkp400.tilt" before "kuka_dkp400.table", w'):
        read_job(job(tmp_path, second + first))
    with pytest.raises(InputError, match=r"external.name: expected a name that no other"):
        read_job(job(tmp_path, POSITIONER.replace('"plate"', '"tilt"')))


DESCRIBED = ["model = ", 'urdf = "cell.urdf"\ntip = "tool0"\npart = "table_link"\n#']


def described_job(tmp_path, tables="", keys=""):
    """The demo's job with its robot described, on a rail, its part on a tilt and a table."""
    limit = '<limit lower="-1" upper="2" velocity="1.5" effort="1"/>'
    free = '<limit velocity="2" acceleration="4" effort="1"/>'
    before = [("rail", "prismatic", limit)]
    under = [("tilt", "revolute", limit), ("table", "continuous", free)]
    path, _ = written(tmp_path, before, under)
    path.rename(tmp_path / "cell.urdf")
    read = job(tmp_path, tables)
    text = read.read_text()
    assert text.count("model = ") == 1 + tables.count("model = ")
    read.write_text(text.replace(*DESCRIBED, 1).replace("[robot]", f"[robot]\n{keys}", 1))
    return read


RAIL_JOINT = """
[[robot.external]]
joint = "rail"
acceleration_mm_s2 = 1500
upper_mm = 1800
home_mm = 250
"""
TILT_JOINT = """
[[robot.external]]
joint = "tilt"
name = "swing"
acceleration_deg_s2 = 90
"""


def test_joints_of_a_description_are_external_axes_of_a_job(tmp_path):
    home = "\n[sequence]\nhome_deg = [0, -20, 10, 0, 60, 0]\n"
    path = described_job(tmp_path, TILT_JOINT + RAIL_JOINT)
    path.write_text(path.read_text() + home)
    read = read_job(path)
    given = {"rail": {"acceleration": 1.5, "upper": 1.8}, "tilt": {"acceleration": np.pi / 2}}
    same = Robot.from_urdf(
        tmp_path / "cell.urdf",
        tip="tool0",
        part="table_link",
        acceleration=read.robot.acceleration[:6],
        endless=read.robot.endless[:6],
        externals=given | {"tilt": given["tilt"] | {"name": "swing"}},
    )
    assert [axis.name for axis in read.robot.externals] == ["rail", "swing", "table"]
    for one, two in zip(read.robot.externals, same.externals, strict=True):
        np.testing.assert_array_equal(one.axis, two.axis)
        np.testing.assert_array_equal(one.point, two.point)
    for name in ("lower", "upper", "velocity", "acceleration", "endless"):
        np.testing.assert_allclose(getattr(read.robot, name), getattr(same, name), rtol=1e-12)
    np.testing.assert_allclose(read.home[6:], [0.25, 0, 0])


JOINT_FAULTS = [
    ("", "", 'robot.urdf: joint "rail": expected every limit .* no acceleration_mm_s2; .* joint ='),
    (RAIL_JOINT.replace("1800", "-1800"), "", "external.upper_mm: expected upper_mm not below"),
    (RAIL_JOINT.replace("mm_s2", "deg_s2"), "", "expected acceleration_mm_s2 for a linear axis"),
    (RAIL_JOINT.replace("joint = ", "model = "), "", "external.model: expected an axis of the lib"),
    (RAIL_JOINT.replace('"rail"', '"j2"'), "", 'joint: expected a joint of the desc.*"j2"; there'),
    (RAIL_JOINT + "axis = [0, 1, 0]\n", "", "axis: expected no axis with joint"),
    (RAIL_JOINT + TILT_JOINT, 'mount = "link_9"\n', "urdf: .*mount: expected a link between base"),
    (RAIL_JOINT + TILT_JOINT.replace("swing", "table"), "", "two of its external axes are named"),
]


@pytest.mark.parametrize(("tables", "keys", "message"), JOINT_FAULTS)
def test_a_fault_of_a_joint_is_said_in_one_line(tables, keys, message, tmp_path):
    with pytest.raises(InputError, match=f"^[^\n]*{message}"):
        read_job(described_job(tmp_path, tables, keys))


def test_a_joint_that_cannot_move_is_refused_at_the_key_that_it_needs(tmp_path):
    path = described_job(tmp_path, RAIL_JOINT + TILT_JOINT)
    description = tmp_path / "cell.urdf"
    text = description.read_text()
    description.write_text(text.replace('velocity="1.5"', 'velocity="0"', 1))
    with pytest.raises(
        InputError, match=r"velocity_mm_s: rail: its velocity is 0 m/s .*; give velo"
    ):
        read_job(path)


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
