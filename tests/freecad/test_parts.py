"""The parts of the workbench that need no FreeCAD: the process, fingerprints, loops, the motion."""

import ast
import json
import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath import __version__, cad
from kerfpath.errors import InputError
from kerfpath.freecad import WORKBENCH, install, mod_folders
from studio.talk import write_job

sys.path.append(str(WORKBENCH / "freecad"))  # the namespace `freecad` may be that of a FreeCAD
kerfpath_wb = pytest.importorskip("kerfpath_wb")
from kerfpath_wb import geometry, motion, process  # noqa: E402

# -----------------------------------------------------------------------------
# The folder.


def test_the_versions_are_those_of_kerfpath():
    tree = ElementTree.parse(WORKBENCH / "package.xml")
    space = {"p": "https://wiki.freecad.org/Package_Metadata"}
    assert tree.findtext("p:version", namespaces=space) == __version__ == kerfpath_wb.VERSION
    icon = tree.findtext("p:icon", namespaces=space)
    assert (WORKBENCH / icon).is_file()
    assert (WORKBENCH / "LICENSE").read_bytes() == Path("LICENSE").read_bytes()


def test_every_module_is_python_3_8():
    files = sorted(WORKBENCH.rglob("*.py"))
    assert len(files) > 5
    for file in files:
        ast.parse(file.read_text(), feature_version=(3, 8))


def test_every_icon_that_is_named_is_there():
    named = set()
    for file in WORKBENCH.rglob("*.py"):
        named |= set(re.findall(r'icon\("(\w+)"\)|NAME(?:, \w+)* = "(\w+)"', file.read_text()))
    for name in {first or second for first, second in named}:
        assert (WORKBENCH / "freecad" / "kerfpath_wb" / "icons" / f"{name}.svg").is_file()


def test_the_workbench_is_installed_with_the_python_that_has_kerfpath(tmp_path):
    mod = tmp_path / "Mod"
    (folder,) = install(mod)
    assert folder == mod / "kerfpath_wb"
    assert (folder / "python.txt").read_text().strip() == sys.executable
    assert (folder / "freecad" / "kerfpath_wb" / "init_gui.py").is_file()
    (folder / "old").touch()
    assert install(mod) == [folder]
    assert not (folder / "old").exists()
    assert [each.name for each in mod.iterdir()] == ["kerfpath_wb"]
    assert process.find(written=str(folder / "python.txt"), variables={}) == [
        sys.executable, "-I", "-m", "kerfpath"
    ]  # fmt: skip


def test_each_version_of_freecad_has_its_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    base = tmp_path / "FreeCAD"
    assert mod_folders() == [base / "Mod"]
    (base / "v1-1").mkdir(parents=True)
    assert mod_folders() == [base / "v1-1" / "Mod"]
    (base / "Mod").mkdir()
    assert mod_folders() == [base / "Mod", base / "v1-1" / "Mod"]


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="give the Mod folder"):
        install(tmp_path / "file" / "Mod")


def test_the_command_installs_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run("freecad", "--to", "Mod", "--json")
    assert json.loads(done.stdout) == {"installed": ["Mod/kerfpath_wb"]}
    (tmp_path / "file").touch()
    assert_refused(run("freecad", "--to", "file"))


# -----------------------------------------------------------------------------
# Finding kerfpath.


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home with nothing in it."""
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def executable(file):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("#!/bin/sh\n")
    file.chmod(0o755)
    return str(file)


def test_what_is_told_comes_before_what_is_found(home):
    own = executable(home / "own" / "bin" / "python")
    local = executable(home / ".local" / "bin" / "kerfpath")
    on_path = executable(home / "bin" / "kerfpath")
    told = executable(home / "told" / "kerfpath")
    preferred = executable(home / "env" / "bin" / "python")
    python = ["-I", "-m", "kerfpath"]
    find = process.find
    assert find(variables={}) == [local]
    variables = {"PATH": os.pathsep.join([str(home / "x" / "Mod" / "y"), str(home / "bin")])}
    assert find(variables=variables) == [on_path]
    variables["KERFPATH"] = told
    assert find(variables=variables) == [told]
    assert find(variables=variables, preference=str(home / "env")) == [preferred, *python]
    Path(local).unlink()
    assert find(variables={}, own=str(home / "own")) == [own, *python]
    with pytest.raises(process.NotFound, match="run `kerfpath freecad`"):
        find(variables={}, own=str(home / "no environment"), written=str(home / "python.txt"))


@pytest.mark.parametrize("way", ["preference", "KERFPATH", "written"])
def test_what_is_told_and_not_there_is_refused(home, way):
    local = executable(home / ".local" / "bin" / "kerfpath")
    (home / "python.txt").write_text("/nowhere/python\n")
    given = {
        "preference": {"preference": "/nowhere/python"},
        "KERFPATH": {"variables": {"KERFPATH": "/nowhere/python"}},
        "written": {"written": str(home / "python.txt")},
    }[way]
    with pytest.raises(process.ProcessError, match="there is no kerfpath at /nowhere/python"):
        process.find(**{"variables": {}, **given})
    assert process.find(variables={}) == [local]


def test_variables_of_freecad_are_left_out():
    given = {
        "PATH": os.pathsep.join(["/usr/lib/freecad/Mod/Draft", "/usr/bin"]),
        "PYTHONHOME": "/tmp/.mount",
        "PYTHONPATH": "/usr/lib/freecad",
        "QT_QPA_PLATFORM": "xcb",
        "SSL_CERT_FILE": "x",
        "LANG": "C",
    }
    assert process.clean_environment(given) == {
        "PATH": "/usr/bin", "LANG": "C", "PYTHONUTF8": "1"
    }  # fmt: skip


def test_an_environment_is_made_by_uv_or_by_a_python(home):
    with pytest.raises(process.ProcessError, match=r"uv or a Python of version 3\.11"):
        process.installation("env", "kerfpath", variables={"PATH": str(home)})
    folder = str(Path(sys.executable).resolve().parent)
    make, fill = process.installation("env", "kerfpath", variables={"PATH": folder})
    assert make[1:] == ["-I", "-m", "venv", "--clear", "env"]
    assert fill == ["env/bin/python", "-I", "-m", "pip", "install", "kerfpath"]
    uv = executable(home / "bin" / "uv")
    make, fill = process.installation("env", "kerfpath", variables={"PATH": str(home / "bin")})
    assert make[0] == fill[0] == uv


def test_an_installation_that_fails_says_why_and_leaves_nothing(home, monkeypatch):
    monkeypatch.setenv("PATH", str(Path(sys.executable).resolve().parent))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(process.ProcessError, match="kerfpath-that-is-nowhere"):
        process.install(str(home / "env"), "kerfpath-that-is-nowhere")
    assert not (home / "env").exists()


# -----------------------------------------------------------------------------
# The process.


def heard(studio, kind, seconds=120):
    """Everything up to a message of a kind."""
    found, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        found += studio.heard()
        if any(each["type"] in (kind, "ended") for each in found):
            return found
        time.sleep(0.02)
    raise AssertionError(f"no {kind} among {[each['type'] for each in found]}")


def ended(pid):
    with_it = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True)
    return not with_it.stdout.strip() or with_it.stdout.startswith("Z")


PYTHON = [sys.executable, "-I", "-m", "kerfpath"]


@pytest.mark.slow
def test_a_job_is_served_to_the_workbench(tmp_path):
    job = write_job(tmp_path)
    studio = process.Studio(PYTHON, str(job), __version__)
    long = "# " + "ü" * 40_000 + "\n"  # a frame with a length of 64 bits
    studio.send("text", text=long + job.read_text())
    found = heard(studio, "part")
    said = {each["type"]: each for each in found}
    assert said["job"]["text"] == long + job.read_text()
    scene = said["scene"] if said["scene"]["contours"] else None
    while scene is None or not scene["contours"]:
        scene = next(e for e in heard(studio, "scene") if e["type"] == "scene")
    mesh = studio.get("/mesh/" + scene["bodies"][0]["mesh"])
    assert len(mesh) > 8
    with pytest.raises(process.ProcessError, match="no such mesh"):
        studio.get("/mesh/none")
    # The frames of the joints, by the rule of the protocol.
    tip = motion.frames(scene["robot"], scene["sample"]["q"])[-1]
    np.testing.assert_allclose(tip, scene["sample"]["T"], atol=1e-12)
    # Loops are in the part, in mm: the longest is the trim line, which is cut last.
    part = said["part"]
    loops = {each["name"]: geometry.Loop(each, part["T"]) for each in part["loops"]}
    box = np.array(loops["skin/outer"].points)
    assert np.ptp(box, axis=0)[0] == pytest.approx(1200, abs=1)
    pid = studio.pid
    studio.close()
    assert ended(pid)


@pytest.mark.slow
def test_the_process_ends_with_the_program_that_started_it(tmp_path):
    job = write_job(tmp_path)
    code = (
        "import sys; sys.path.append(sys.argv[1]); from kerfpath_wb import process; "
        "s = process.Studio(sys.argv[3:], sys.argv[2], '" + __version__ + "'); "
        "print(s.pid, flush=True); import time; time.sleep(60)"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", code, str(WORKBENCH / "freecad"), str(job), *PYTHON],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    pid = int(parent.stdout.readline())
    time.sleep(3)
    assert not ended(pid)
    parent.kill()  # no chance to clean up
    parent.communicate()
    until = time.monotonic() + 30
    while not ended(pid):
        assert time.monotonic() < until
        time.sleep(0.1)


@pytest.mark.parametrize(
    ("says", "match"),
    [
        (
            'print(\'{"version": "0.0.1", "job": "j", "address": "http://h:1/?token=t"}\')',
            "0.0.1",
        ),
        ("sys.exit('kerfpath: error: job.toml: no such file')", "job.toml: no such file"),
        ("sys.exit('No such option: --json')", "older version"),
        ("sys.exit('No module named kerfpath')", "has no kerfpath"),
        ("pass", "said nothing"),
    ],
)
def test_what_does_not_serve_is_told_in_words(tmp_path, says, match):
    file = tmp_path / "fake.py"
    file.write_text(f"import sys\n{says}\n")
    studio = process.Studio([sys.executable, str(file)], str(tmp_path / "job.toml"), __version__)
    (last,) = heard(studio, "ended", 20)
    assert last["type"] == "ended"
    assert re.search(match, last["message"])
    studio.close()


def test_a_program_that_does_not_start_is_told():
    with pytest.raises(process.ProcessError, match="cannot be started"):
        process.Studio(["/nowhere/kerfpath"], "/job.toml", __version__)


# -----------------------------------------------------------------------------
# Edges: anything with the attributes of those of FreeCAD.


class Circle:
    def __init__(self, radius):
        self.Radius = radius


class Line:
    pass


def circle(x, y, radius, z=0.0):
    """A circle about z."""

    def discretize(Number):
        angles = np.linspace(0, 2 * np.pi, Number)
        return [(x + radius * math.cos(a), y + radius * math.sin(a), z) for a in angles]

    point = SimpleNamespace(Point=(x + radius, y, z))
    return SimpleNamespace(
        Curve=Circle(radius), Length=2 * math.pi * radius, CenterOfMass=(x, y, z),
        Vertexes=[point], discretize=discretize,
    )  # fmt: skip


def line(a, b):
    def discretize(Number):
        return [tuple(p) for p in np.linspace(a, b, Number)]

    return SimpleNamespace(
        Curve=Line(), Length=math.dist(a, b), CenterOfMass=tuple((np.add(a, b)) / 2),
        Vertexes=[SimpleNamespace(Point=a), SimpleNamespace(Point=b)], discretize=discretize,
    )  # fmt: skip


def test_an_edge_is_found_again_under_another_number():
    before = [circle(0, 0, 5), circle(50, 0, 8)]
    prints = [geometry.fingerprint(edge) for edge in before]
    after = [before[0], line((0, 0, 0), (9, 0, 0)), before[1]]
    assert geometry.found_again(["Edge2"], prints[1:], after) == ["Edge3"]
    assert geometry.found_again(["Edge1"], prints[:1], after) == ["Edge1"]


@pytest.mark.parametrize(
    ("after", "match"),
    [
        (
            [circle(0, 0, 5), circle(50, 0, 8.1)],
            r"Edge2 was a circle of radius 8 mm .*now a circle",
        ),
        ([circle(0, 0, 5)], "it is gone"),
        ([circle(0, 0, 5), line((50, 0, 0), (60, 0, 0))], "now a line of length 10"),
        ([circle(50, 0, 8), circle(0, 0, 5), circle(50, 0, 8)], "several edges"),
        ([circle(0, 0, 5), circle(50, 0, 8, z=1.0)], "no edge is as it was"),
    ],
)
def test_an_edge_that_is_another_one_is_refused_by_name(after, match):
    prints = [geometry.fingerprint(circle(50, 0, 8))]
    with pytest.raises(geometry.PickError, match=match):
        geometry.found_again(["Edge2"], prints, after)


def test_a_fingerprint_survives_json_and_small_errors():
    one = geometry.fingerprint(circle(10, 20, 5))
    again = json.loads(json.dumps(one))
    assert geometry.same(one, again)
    assert geometry.same(one, geometry.fingerprint(circle(10 + 4e-4, 20, 5)))
    assert not geometry.same(one, geometry.fingerprint(circle(10 + 4e-3, 20, 5)))


def loop(name, kind, edges, T=motion.IDENTITY):
    """A loop of edges in a row, as the process says it."""
    points = np.concatenate([edge.discretize(200) for edge in edges]) / 1e3
    moved = points @ np.reshape(T, (4, 4))[:3, :3].T + np.reshape(T, (4, 4))[:3, 3]
    entry = {
        "name": name, "kind": kind, "face": name.split("/")[0],
        "length": sum(edge.Length for edge in edges) / 1e3, "points": moved.ravel().tolist(),
    }  # fmt: skip
    return geometry.Loop(entry, T)


CORNERS = [(0, 0, 0), (100, 0, 0), (100, 60, 0), (0, 60, 0)]
SIDES = [line(a, b) for a, b in zip(CORNERS, CORNERS[1:] + CORNERS[:1], strict=True)]
WALL = [
    SIDES[0], line((100, 0, 0), (100, 0, -3)), line((100, 0, -3), (0, 0, -3)),
    line((0, 0, -3), (0, 0, 0)),
]  # fmt: skip
LOOPS = [
    loop("top/outer", "outer", SIDES),
    loop("side/outer", "outer", WALL),
    loop("top/hole1", "inner", [circle(50, 30, 10)]),
    loop("bore/outer", "outer", [circle(50, 30, 10)]),
]


def test_the_rim_of_a_hole_is_the_hole():
    assert geometry.loops_of({"Edge9": [[circle(50, 30, 10)]]}, LOOPS) == [LOOPS[2]]


def test_an_edge_between_two_faces_needs_more_of_the_loop():
    with pytest.raises(geometry.PickError, match="Edge1 is on side/outer and on top/outer"):
        geometry.loops_of({"Edge1": [[SIDES[0]]]}, LOOPS)
    two = {"Edge1": [[SIDES[0]]], "Edge2": [[SIDES[1]]]}
    assert geometry.loops_of(two, LOOPS) == [LOOPS[0]]


def test_a_face_is_all_of_its_loops_and_its_border_to_the_next_face_is_none():
    wires = [SIDES, [circle(50, 30, 10)]]
    assert geometry.loops_of({"Face1": wires}, LOOPS) == [LOOPS[0], LOOPS[2]]
    border = [line((-9, 0, 0), (0, 0, 0)), *SIDES[1:]]
    assert geometry.loops_of({"Face1": [border, wires[1]]}, LOOPS) == [LOOPS[2]]
    with pytest.raises(geometry.PickError, match="Face1 is on no loop"):
        geometry.loops_of({"Face1": [border]}, LOOPS)


def test_edges_are_open_lines_in_order():
    names = ["Edge1", "Edge2", "Edge3", "Edge4", "Edge5"]
    a, b, c, d = CORNERS
    ends = [(b, c), (b, a), ((9, 9, 9), (9, 9, 5)), (d, c)]
    assert geometry.chains(names, ends) == [
        [(1, True), (0, False), (3, True)], [(2, False)]
    ]  # fmt: skip
    with pytest.raises(geometry.PickError, match="Edge1, Edge2, Edge3, Edge4 are a whole loop"):
        geometry.chains(names, [(a, b), (b, c), (c, d), (d, a)])
    with pytest.raises(geometry.PickError, match="Edge1 are a whole loop"):
        geometry.chains(names, [(a, a)])
    with pytest.raises(geometry.PickError, match="Edge1, Edge2, Edge3 meet at one point"):
        geometry.chains(names, [(a, b), (b, c), (d, b)])


def test_lines_are_a_table_that_a_job_reads(tmp_path):
    down = (0, 0, -1)
    lines = {"line1": [((0, 0, 3), down), ((10, 0, 3), down)], "line2": [((1e-9, 5, 3), down)]}
    lines["line2"].append(((0, 95.123456, 3), (0, 0.6, -0.8)))
    (tmp_path / "lines.csv").write_text(geometry.table(lines))
    read_back = cad.read(tmp_path / "lines.csv")
    assert [(loop.name, loop.kind) for loop in read_back.loops] == [
        ("line1", "open"), ("line2", "open")
    ]  # fmt: skip
    contour = read_back.contour("line2", closed=False)
    np.testing.assert_allclose(contour.points[-1], [0, 0.095123456, 0.003], atol=1e-12)
    np.testing.assert_allclose(contour.axes[-1], [0, 0.6, -0.8], atol=1e-12)


def test_an_edge_of_no_loop_is_refused_by_name():
    with pytest.raises(geometry.PickError, match="Edge7 is on no loop"):
        geometry.loops_of({"Edge7": [[circle(50, 30, 10.5)]]}, LOOPS)


def test_all_edges_of_a_loop_are_found_wherever_the_part_is():
    T = np.eye(4)
    T[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T[:3, 3] = [1.2, -0.3, 0.5]
    placed = loop("top/outer", "outer", SIDES, T.ravel().tolist())
    np.testing.assert_allclose(placed.points, LOOPS[0].points, atol=1e-9)
    edges = [circle(50, 30, 10), *SIDES, *WALL[1:]]
    assert geometry.edges_on(placed, edges) == ["Edge2", "Edge3", "Edge4", "Edge5"]
    with pytest.raises(geometry.PickError, match="only 260 of the 320 mm"):
        geometry.edges_on(placed, [SIDES[0], *SIDES[2:]])


# -----------------------------------------------------------------------------
# The motion.


def test_the_motion_is_that_of_the_program():
    plan = {"name": "a", "contour": "c", "time": [0, 1, 2], "q": [0, 0, 1, 2, 3, 2]}
    move = {"plan": None, "contour": None, "time": [0, 2], "q": [4, 4, 0, 0]}
    program = {
        "segments": [
            {**move, "begin": 0, "end": 2},
            {"plan": "a", "contour": "c", "begin": 2, "end": 4, "time": None, "q": None},
        ]
    }
    timeline = motion.Timeline(program, [plan])
    assert timeline.whole
    assert timeline.total == 4
    assert timeline.at(1) == ([2, 2], None, None, 0)
    assert timeline.at(2.5) == ([0.5, 1], "c", "a", 0)
    assert timeline.at(9) == ([3, 2], "c", "a", 1)
    assert timeline.when("a", 1) == 3
    assert timeline.when("b", 1) is None
    alone = motion.Timeline(None, [plan])  # no program yet
    assert not alone.whole
    assert alone.at(1.5) == ([2, 2], "c", "a", 1)


def test_a_part_on_a_table_stands_and_the_robot_turns_about_it():
    turn = motion.rotation([0, 0, 1], 0.7)
    joint = {"carries": None, "T": motion.IDENTITY, "axis": [0, 0, 1], "unit": "rad"}
    place = list(motion.IDENTITY)
    place[3] = 1.0  # the axis of the table is at x = 1
    table = {"carries": "part", "T": place, "axis": [0, 0, 1], "unit": "rad"}
    robot = {"joints": [joint, table], "T_flange": motion.IDENTITY, "T_tool": motion.IDENTITY}
    frames = motion.frames(robot, [0.0, 0.7])
    np.testing.assert_allclose(frames[0], motion.IDENTITY, atol=1e-12)
    # The base goes the other way about the axis of the table.
    back = np.reshape(motion.inverse(turn), (4, 4))
    base = np.reshape(frames[1], (4, 4))
    np.testing.assert_allclose(base[:3, :3], back[:3, :3], atol=1e-12)
    axis = np.array([1.0, 0, 0])
    np.testing.assert_allclose(base[:3, :3] @ axis + base[:3, 3], axis, atol=1e-12)
