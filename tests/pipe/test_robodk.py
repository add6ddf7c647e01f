"""Machining projects of RoboDK, with its own package against a station that is not RoboDK."""

import ast
import configparser
import json
import os
import re
import subprocess
import sys
import time
import warnings
from functools import partial
from importlib.util import find_spec
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import ROOT
from kerfpath.errors import InputError
from kerfpath.pipe import answer
from kerfpath.pipe.station import station_robot
from kerfpath.robots import robot
from robodk_station import (
    FRAME,
    MACHINING,
    OBJECT,
    PROGRAM,
    ROBOT,
    TARGET,
    TOOL,
    Item,
    Station,
    ur10e,
)

OWN = ROOT / "src" / "kerfpath" / "robodk"
RATIO = "universal_robots"
pytestmark = pytest.mark.skipif(find_spec("robodk") is None, reason="robodk is not installed")


@pytest.fixture(scope="module")
def door():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the package warns of changes in itself
        import kerfpath.robodk
    return kerfpath.robodk


def pose(xyz, rpy=(0, 0, 0)):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("xyz", rpy, degrees=True).as_matrix(), xyz
    return T


def circle(count=41, radius=60.0):
    turn = np.linspace(0, 2 * np.pi, count)
    normals = np.tile([0.0, 0.0, 1.0], (count, 1))
    return np.c_[radius * np.cos(turn), radius * np.sin(turn), 0 * turn, normals]


class Cell:
    """A station with two robots, a turned base, a tool, and a circle on a turned part."""

    def __init__(self):
        T_world_base = pose([500, -200, 300], [0, 0, 40])
        T_base_part = pose([600, 250, 150], [10, -5, 70])
        frame = Item(FRAME, "UR10e base")
        self.tool = Item(TOOL, "Laser", tool=pose([20, 0, 140], [0, 15, 0]))
        self.part = Item(
            OBJECT, "Plate", absolute=T_world_base @ T_base_part, curves=[("edge", circle())]
        )
        self.T_base_part = T_base_part
        self.robot, self.other = (
            Item(
                ROBOT, name, absolute=T, parent=frame, forward=ur10e,
                lower=[-180.0] * 6, upper=[180.0] * 6, joints=[20.0, -80, 90, -100, -80, 10],
            )
            for name, T in (("UR10e", T_world_base), ("UR3e", np.eye(4)))
        )  # fmt: skip
        self.project = Item(
            MACHINING, "Trim", params={"Machining": json.dumps({"SpeedOperation": 50})},
            links={ROBOT: self.robot, FRAME: frame, TOOL: self.tool, OBJECT: self.part},
        )  # fmt: skip
        self.station = Station(self.other, self.robot, frame, self.tool, self.part, self.project)

    def plan(self, door, **settings):
        asked = {"acceleration": 400, "spacing": 6.0, "gamma_step": 20.0} | settings
        with self.station.served() as port:
            rdk = door.connect(port)
            try:
                project = rdk.ItemUserPick("", MACHINING)
                return door.plan_project(rdk, project, door.Settings(**asked))
            finally:
                rdk.Disconnect()

    def untouched(self):
        return not self.station.of(PROGRAM) and not self.station.of(TARGET)


def require_followed(cell, targets, rows, off_mm):
    """The station's own kinematics put the tool on the curve, against its normals."""
    T = np.array([ur10e(t.joints) @ cell.tool.tool for t in targets])
    back = np.linalg.inv(cell.T_base_part) @ T
    np.testing.assert_allclose(back[:, :3, 2], np.tile([0, 0, -1], (len(T), 1)), atol=2e-5)
    np.testing.assert_allclose(back[:, 2, 3], 0, atol=1e-2)
    ends = back[[0, -1], :3, 3]
    np.testing.assert_allclose(ends, rows[[0, -1], :3], atol=1e-2)
    from_middle = np.linalg.norm(back[:, :2, 3], axis=1)
    assert np.abs(from_middle - 60).max() < off_mm


def test_a_program_is_written_for_the_robot_of_the_project(door):
    cell = Cell()
    found = cell.plan(door)
    (program,), targets = cell.station.of(PROGRAM), cell.station.of(TARGET)
    assert program.robot is cell.robot
    assert program.name == "Trim kerfpath"
    said = dict(program.said[:4])
    assert said["frame"] is cell.project.links[FRAME]
    assert said["tool"] is cell.tool
    assert said["speed"] == [50, -1, -1, -1]
    assert said["rounding"] == 1
    assert program.shown == 0
    moves = program.said[4:]
    assert [kind for kind, _ in moves] == ["MoveJ"] + ["MoveL"] * (len(targets) - 1)
    assert [one for _, one in moves] == targets
    assert all(one.joint_target and one.robot is cell.robot for one in targets)
    assert all(one.parent is cell.project.links[FRAME] for one in targets)
    require_followed(cell, targets, circle(), 0.3)  # a chord of the drawn curve is 0.18 mm off it
    # Within the limits of the station and the library, at the speed of the project.
    q = np.array([one.joints for one in targets])
    assert np.abs(q).max() <= 180
    took = 2 * np.pi * 60 / 50 / (len(q) - 1)
    assert (np.abs(np.diff(q, axis=0)) / took <= np.degrees(robot("ur_ur10e").velocity)).all()
    assert np.abs(np.diff(q, n=2, axis=0)).max() / took**2 < 400 * 1.01
    assert found.sound
    assert "robot ur_ur10e of the library" in found.message.lower()
    assert "given by the user" in found.message
    assert "RoboDK's check, without collisions: no problems." in found.message
    # It is the check of RoboDK, in steps of 1 mm and 1 deg, with times.
    assert program.asked == [1, 1, 0, 3, 0.05]


def test_another_python_plans_and_what_the_check_finds_is_shown(door):
    cell = Cell()
    cell.tool.tool = pose([0, 0, 100])
    del cell.project.links[TOOL], cell.project.links[FRAME]
    cell.robot.tool = cell.tool.tool
    cell.station.check = ("Robot collides.", "100010", -3)
    found = cell.plan(
        door, python=sys.executable, collisions=True, acceleration=[400] * 6, speed=40
    )
    (program,), targets = cell.station.of(PROGRAM), cell.station.of(TARGET)
    assert not found.sound
    assert (
        "check with collisions: Robot collides; beyond a joint limit; collision." in found.message
    )
    assert program.asked[2] == 1
    said = dict(program.said[:4])
    assert said["frame"] is cell.robot.parent
    np.testing.assert_array_equal(said["tool"], cell.tool.tool)
    assert said["speed"][0] == pytest.approx(40, abs=1e-9)
    require_followed(cell, targets, circle(), 0.3)


def without_normals(cell):
    cell.part.curves = [("edge", circle()[:, :3])]


def with_a_null_normal(cell):
    rows = circle()
    rows[7, 3:] = 0
    cell.part.curves = [("edge", rows)]


def on(what, /, **values):
    return lambda cell: vars(getattr(cell, what)).update(values)


REFUSED = [
    (without_normals, {}, "edge: point 0 has no normal"),
    (with_a_null_normal, {}, "edge: point 7 has no normal"),
    (on("part", curves=[]), {}, "'Plate' has no curves"),
    (on("part", curves=[("a", circle()), ("b", circle())]), {}, "set curve to one of 0 a, 1 b"),
    (on("part"), {"curve": 1}, "curve: expected 0 to 0, got 1"),
    (on("part", geometry=pose([0, 0, 5])), {}, "the geometry of 'Plate' is moved"),
    (on("project", links={}), {}, "'Trim' has no robot"),
    (on("project", pose=pose([0, 0, 0], [10, 0, 0])), {}, "tilts the tool"),
    (on("project", pose=pose([0, 0, -3])), {}, "shifts or tilts the tool"),
    (on("project", params={"Machining": "{}"}), {}, "no operation speed"),
    (on("robot", name="Machine"), {}, "by its motion it could be ur_ur10e: give one as model"),
    (on("robot", name="UR10"), {}, "'UR10' moves otherwise than ur_ur10 of the library"),
    (on("robot", forward=partial(ur10e, a3=-572.6)), {}, "accepted; no robot of the library"),
    (on("robot"), {"model": "kuka_kr60_ha"}, "moves otherwise than kuka_kr60_ha"),
    (on("robot"), {"acceleration": None}, "acceleration: the library has none for ur_ur10e"),
    (on("robot"), {"acceleration": [1, 2]}, "acceleration: expected"),
    (on("robot"), {"speed": 5000.0}, "no program: "),
    (on("part", absolute=pose([5000, 0, 0])), {}, "no program: "),
    (on("robot"), {"spacing": -1.0}, "spacing"),
    (on("robot"), {"python": "/no/such/python"}, "python: expected the path of a Python"),
    (on("robot"), {"python": sys.executable, "seconds": 0.01}, "no program within 0.01 s"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "settings", "said"), REFUSED)
def test_what_is_refused_leaves_the_station_as_it_is(door, change, settings, said):
    cell = Cell()
    change(cell)
    with pytest.raises(door.StationError, match=re.escape(said)) as refused:
        cell.plan(door, **settings)
    assert "\n" not in str(refused.value)
    assert cell.untouched()
    assert not {"Render", "Add_PROG", "S_Thetas"} & set(cell.station.commands)


def test_a_robot_that_its_model_names_has_any_name(door):
    cell = Cell()
    cell.robot.name = "Machine"
    assert (
        "Robot ur_ur10e"
        in cell.plan(door, model="ur10e", acceleration="cybertech_8_to_20kg").message
    )


def test_a_station_whose_robot_changes_meanwhile_gets_no_program(door):
    cell, asked = Cell(), []

    def forward(q):  # as if another robot had taken its place after the comparison
        asked.append(q)
        return ur10e(q) if len(asked) <= 24 else ur10e(q, a3=-575.0)

    cell.robot.forward = forward
    with pytest.raises(door.StationError, match="its tool would be up to"):
        cell.plan(door)
    assert cell.untouched()


@pytest.mark.parametrize(
    ("command", "nth"), [("G_Name", 1), ("G_ObjPoint", 1), ("G_FK", 5), ("Add_TARGET", 9)]
)
def test_a_lost_connection_is_one_line(door, command, nth):
    cell = Cell()
    cell.station.drop_at = command, nth
    begun = time.monotonic()
    with pytest.raises(door.StationError, match="the connection to RoboDK was lost: ") as lost:
        cell.plan(door)
    assert time.monotonic() - begun < 60  # the package alone waits for ever
    assert ("delete what is left of program 'Trim kerfpath'" in str(lost.value)) == (nth == 9)
    assert "\n" not in str(lost.value)


def test_what_was_written_is_removed_if_the_station_refuses_the_rest(door):
    cell = Cell()
    cell.station.fail_at = "Add_INSMOVE"
    with pytest.raises(Exception, match="the station says no"):
        cell.plan(door)
    assert cell.untouched()
    assert cell.station.commands[-2:] == ["Remove", "Remove"]


# -----------------------------------------------------------------------------
# Robots that are the same: base and flange may be elsewhere.


def seen(name, *, seed=3, bend=0.0, **more):
    known, chance = robot(name), np.random.default_rng(seed)
    lower, upper = known.lower, known.upper
    q = chance.uniform(lower, upper, (24, known.joints))
    X, Y = np.eye(4), np.eye(4)
    for T in (X, Y):
        T[:3, :3], T[:3, 3] = Rotation.random(rng=chance).as_matrix(), chance.normal(size=3)
    T = X @ known.forward(q + bend * np.sin(q)) @ Y
    return {"name": known.model, "lower": lower, "upper": upper, "q": q, "T": T} | more, X, Y


@pytest.mark.parametrize(
    "name", ["kuka_kr60_ha", "ur_ur5e", "yaskawa_gp25", "kuka_lbr_iiwa14_r820"]
)
def test_base_and_flange_of_a_station_are_fitted(name):
    station, X, Y = seen(name)
    found = station_robot(station | {"name": name}, 5.0)
    q = np.random.default_rng(8).uniform(-1, 1, (9, found.robot.joints))
    there = found.T_station_base @ found.robot.forward(q) @ found.T_end_flange
    np.testing.assert_allclose(there, X @ found.robot.forward(q) @ Y, atol=1e-9)
    assert found.apart_mm < 1e-6


@pytest.mark.parametrize("name", ["fanuc_m10ia", "abb_irb2400_155"])
@pytest.mark.parametrize("horizontal", [True, False])
def test_axis_3_is_counted_as_the_station_counts_it(name, horizontal):
    known, chance = robot(name), np.random.default_rng(4)
    lower, upper = known.lower.copy(), known.upper.copy()
    counts = np.eye(6)
    if horizontal:
        counts[2] = known.couplings[0].row
        lower[2], upper[2] = known.couplings[0].lower + 0.1, known.couplings[0].upper - 0.1

    def flange(shown):
        return known.forward(np.linalg.solve(counts, np.atleast_2d(shown).T).T)

    shown = chance.uniform(lower, upper, (24, 6))
    start = counts @ np.radians([0, 20, -10, 0, -60, 0])
    T_start = flange(start)[0]
    points = T_start[:3, 3] + np.c_[0 * np.arange(9), np.linspace(0, 0.1, 9), 0 * np.arange(9)]
    found = answer({
        "station": {"name": name, "lower": lower, "upper": upper, "q": shown, "T": flange(shown)},
        "start": start.tolist(), "acceleration": 5.0, "gamma_step": np.radians(20), "x": None,
        "T_flange_tip": np.eye(4), "points": points, "axes": np.tile(T_start[:3, 2], (9, 1)),
        "name": "line", "speed": 0.05, "max_step": 0.02,
    })  # fmt: skip
    assert "error" not in found, found
    q = np.array(found["q"])
    np.testing.assert_allclose(q[0], start, atol=1e-12)
    assert ((q >= lower - 1e-9) & (q <= upper + 1e-9)).all()
    T = flange(q[found["waypoints"]])
    np.testing.assert_allclose(T[:, :3, 3], found["points"], atol=1e-8)
    np.testing.assert_allclose(T[:, :3, 2], found["axes"], atol=1e-8)
    # The station's range of axis 3 bounds what it shows.
    seen = station_robot(
        {"name": name, "lower": lower, "upper": upper, "q": shown, "T": flange(shown)}, 5.0
    )
    np.testing.assert_array_equal(seen.counts, counts)
    (bound,) = seen.robot.couplings
    assert (bound.note == "range of axis 3 of the station") == horizontal


def test_a_robot_that_bends_is_another_one():
    station, *_ = seen("kuka_kr60_ha", bend=1e-4)
    with pytest.raises(InputError, match="moves otherwise than kuka_kr60_ha"):
        station_robot(station | {"name": "KUKA KR 60 HA"}, 5.0)
    station["lower"], station["q"] = station["lower"][:5], station["q"][:, :5]
    with pytest.raises(InputError, match="synchronized external axes"):
        station_robot(station | {"name": "KUKA KR 60 HA"}, 5.0)


def test_names_of_stations_are_understood():
    for name, known in (
        ("ABB IRB 4600-60/2.05", "abb_irb4600_60_205"),
        ("KUKA KR 60 HA", "kuka_kr60_ha"),
        ("Motoman GP25", "yaskawa_gp25"),
        ("Staubli TX2-90L", "staubli_tx2_90l"),
        ("UR5e", "ur_ur5e"),
    ):
        station, *_ = seen(known)
        assert station_robot(station | {"name": name}, 5.0).robot.id == known


# -----------------------------------------------------------------------------
# The add-in: a folder for RoboDK, whose Python has only the robodk package.


def test_the_files_that_run_in_robodk_need_no_more_than_its_python():
    for file in (OWN / "station.py", *(OWN / "addin").glob("*.py")):
        tree = ast.parse(file.read_text(encoding="utf-8"), feature_version=(3, 7))
        at_top = [n for n in tree.body if isinstance(n, ast.Import | ast.ImportFrom)]
        names = {a.name if isinstance(n, ast.Import) else n.module for n in at_top for a in n.names}
        foreign = {n.split(".")[0] for n in names} - sys.stdlib_module_names
        assert foreign <= {"robodk", "_station"}


def installed(folder):
    run = [sys.executable, "-W", "ignore", "-m", "kerfpath.robodk", str(folder)]
    done = subprocess.run(run, capture_output=True, text=True, check=True)
    assert "settings.json" in done.stdout
    return folder / "Kerfpath"


def test_the_add_in_is_installed_and_plans_what_is_selected(tmp_path):
    to = installed(tmp_path)
    manifest = ElementTree.parse(to / "manifest.xml").getroot()
    listed = {e.text for e in manifest.iter() if e.tag.endswith("}asset")}
    files = {f"/Kerfpath/{one.name}" for one in to.iterdir()}
    assert listed == files - {"/Kerfpath/manifest.xml"}
    config = configparser.ConfigParser()
    config.read(to / "AppConfig.ini", encoding="utf-8")
    actions = {one.stem for one in to.glob("[!_]*.py")}
    assert set(config.sections()) == {"General"} | actions
    assert config["PlanWithKerfpath"]["TypeOnContextMenu"] == str(MACHINING)
    assert (to / "PlanWithKerfpath.svg").read_text().startswith("<svg")
    # The settings of the user stay.
    settings = json.loads((to / "settings.json").read_text())
    assert settings["python"] == sys.executable
    settings |= {"acceleration": 400, "spacing": 6, "gamma_step": 20}
    (to / "settings.json").write_text(json.dumps(settings))
    assert json.loads((installed(tmp_path) / "settings.json").read_text()) == settings

    def clicked(cell):
        with cell.station.served() as port:
            return subprocess.run(
                [sys.executable, "-W", "ignore", str(to / "PlanWithKerfpath.py")],
                env=os.environ | {"ROBODK_API_PORT": str(port)}, capture_output=True, text=True,
            )  # fmt: skip

    cell = Cell()
    done = clicked(cell)
    assert done.returncode == 0, done.stderr
    assert cell.station.messages[0] == "kerfpath plans Trim ..."
    assert "no problems.<br>" in cell.station.messages[1] + "<br>"
    assert len(cell.station.of(PROGRAM)) == 1
    cell = Cell()
    without_normals(cell)
    done = clicked(cell)
    assert done.returncode == 1
    assert cell.station.messages[-1].startswith("kerfpath: edge: point 0 has no normal")
    assert cell.untouched()
    cell = Cell()
    cell.station.drop_at = "G_FK", 3
    done = clicked(cell)
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("kerfpath: the connection to RoboDK was lost")
    assert "Traceback" not in done.stderr


def test_the_example_of_the_page_runs(door, monkeypatch, capsys):
    page = (ROOT / "docs" / "robodk.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    cell = Cell()
    with cell.station.served() as port:
        monkeypatch.setenv("ROBODK_API_PORT", str(port))
        names = {}
        exec(compile(block, "robodk.md", "exec"), names)
        names["rdk"].Disconnect()
    assert "assumed: ratio cybertech_8_to_20kg" in capsys.readouterr().out
    assert len(cell.station.of(PROGRAM)) == 1
    table = set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))
    assert table == set(vars(door.Settings()))
