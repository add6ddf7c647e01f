"""Jobs with a cell, and robots that no library has: read, looked at, planned, audited, refused."""

import json
import re
import shutil
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from tests.robots.test_five_axes import ARM
from tests.urdf.test_urdf import described

from commands import assert_refused, run
from conftest import rebuilt
from kerfpath.cad import read as read_drawing
from kerfpath.cell import Mesh, box, edges_of, thicken
from kerfpath.comfort import Band
from kerfpath.errors import InputError
from kerfpath.graph import LayeredGraph
from kerfpath.job import (
    audit_file,
    cell_of_job,
    check_job,
    collision_note,
    fastest_speeds,
    read_job,
    read_plan_file,
    require_language,
    run_job,
)
from kerfpath.planner import ClearanceMap
from kerfpath.report.section import add_clearance

DEMO = Path(str(files("kerfpath") / "demo"))
SHIPPED = (DEMO / "b_pillar_cell.toml").read_text()
# The slot alone at a coarse step: a cell's job in seconds. The map is the shipped job's.
HEAD, OPENING, SLOT, REST = re.split(r"(?=\[\[contour\]\]|\[plan\])", SHIPPED)
SMALL = HEAD + SLOT + REST.replace("gamma_step_deg = 2", "gamma_step_deg = 6")
SMALL = SMALL.replace("map = true ", "map = false ").replace("deviation_mm = 0.1", "")
FIVE = """\
[robot]
kinematics = "five"
geometry_mm = { a1 = 300, a2 = -100, b = 0, c1 = 700, c2 = 900, c3 = 800, c4 = 120 }
lower_deg = [-170, -90, -60, -180, -180]
upper_deg = [170, 120, 170, 180, 180]
velocity_deg_s = [120, 110, 130, 300, 300]
acceleration_deg_s2 = [400, 300, 500, 1500, 1500]
endless = [4, 5]
"""
ROBOT = HEAD[HEAD.index("[robot]") : HEAD.index("[tool]")]
NEAR = "[comfort]\nclearance_band_mm = 30\nclearance_cost = 0.5\n"
NO_PROGRAM = REST[REST.index("[program]") :]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    shutil.copy(DEMO / "b_pillar.step", folder)
    lump = box([0.1, 0.1, 0.1])
    stl(folder / "lump.stl", lump.points * 1e3, lump.triangles)
    stl(folder / "open.stl", lump.points * 1e3, lump.triangles[1:])
    return folder


def stl(path, vertices, triangles):
    lines = ["solid x"]
    for triangle in vertices[triangles].tolist():
        corners = "\n".join(f"vertex {x} {y} {z}" for x, y, z in triangle)
        lines.append(f"facet normal 0 0 0\nouter loop\n{corners}\nendloop\nendfacet")
    path.write_text("\n".join([*lines, "endsolid x"]))


def job(folder, text, name="job.toml"):
    (folder / name).write_text(text)
    return folder / name


def with_keys(table, *lines):
    """Return the small job with lines added to a table that it has."""
    return SMALL.replace(f"{table}\n", "\n".join([table, *lines, ""]), 1)


@pytest.fixture(scope="module")
def planned(folder):
    job(folder, SMALL, "small.toml")
    result = run("plan", "small.toml", "--json", cwd=folder)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def test_a_job_in_a_cell_is_planned_audited_and_says_so(planned, folder):
    assert planned["passed"]
    assert "Collisions are checked along the contours, among 15 bodies" in planned["notes"][0]
    plan = json.loads((folder / "small-plan" / "plan.json").read_text())
    assert "clear in the cell" in plan["contours"][0]["proof"]
    assert len(plan["cell"]["bodies"]) == 15
    asked = {tuple(p["between"]): p["at_least"] for p in plan["cell"]["near_miss_m"]}
    assert asked["post", "head"] == 0.02
    assert asked["part", "nozzle"] == 0.0005
    assert asked["table", "head"] == 0.01
    # Links drawn as capsules are never told of as the real ones, wherever it says clear.
    unproved = "need not hold the real ones"
    assert unproved in planned["notes"][0]
    assert unproved in plan["contours"][0]["proof"]
    assert unproved in plan["cell"]["not_proved"][0]
    assert unproved in (folder / "small-plan" / "report.html").read_text()
    (program,) = (folder / "small-plan").glob("*.mod")
    assert "clear of the real ones is not proved" in program.read_text()
    deep = [p for p in plan["cell"]["near_miss_m"] if p["overlap_by_design"] > 0]
    assert [p["between"] for p in deep] == [["link 3", "arm"]]
    assert "link 3 - arm 24 mm" in planned["notes"][0]
    checks = {c["code"]: c for c in plan["contours"][0]["audit"]["checks"]}
    assert re.search(r"nearest: .* mm apart, \d+ mm asked", checks["collision"]["title"])
    assert "part and nozzle" in checks["collision-own"]["title"]


def test_the_report_draws_the_cell(planned, folder):
    from tests.report.test_pages import _figures

    scene = _figures((folder / "small-plan" / "report.html").read_text())[0]
    names = [trace.get("name") for trace in scene["data"]]
    assert {"table", "nest left", "post"} <= set(names)
    # Two poses of nine bodies that move, and a step of the slider more to hide them.
    assert names.count("nozzle") == 2
    assert len(scene["layout"]["sliders"][0]["steps"]) == 3


@pytest.mark.slow
def test_the_audit_checks_the_cell_again_with_the_job_and_says_so_without(planned, folder):
    file = folder / "small-plan" / "plan.json"
    again = audit_file(file, folder / "small.toml")
    assert again.passed
    assert {"collision", "collision-own"} <= {c.code for c in again.tables["slot"]}
    alone = audit_file(file)
    assert "not checked again: give its job with --job" in alone.note
    # A fixture where the head passes: the same plan fails.
    blocked = SMALL.replace("xyz_mm = [1390, -210, 600]", "xyz_mm = [1225, -130, 700]")
    assert not audit_file(file, job(folder, blocked, "blocked.toml")).passed
    moved = SMALL.replace("xyz_mm = [1200, -600, 500]", "xyz_mm = [1200, -600, 501]")
    found = audit_file(file, job(folder, moved, "moved.toml"))
    (said,) = (c.title for c in found.tables["plan.json"] if "T_base_part" in c.title)
    assert "expected 0.501, found 0.5" in said


@pytest.mark.slow
def test_a_blocked_contour_says_that_it_is_collision(folder):
    blocked = with_keys("[cell]", "part = false").replace("spacing_mm = 1", "spacing_mm = 2")
    blocked = blocked.replace("xyz_mm = [1390, -210, 600]", "xyz_mm = [1225, -130, 700]")
    result = run("plan", job(folder, blocked, "b.toml"), "--json", cwd=folder)
    assert result.returncode == 1
    (entry,) = json.loads(result.stdout)["contours"]
    assert "collision" in entry["reason"]
    assert entry["fastest_speed_m_s"] is None


@pytest.mark.slow
def test_the_fastest_speed_in_a_cell_is_clear_and_no_higher(folder):
    coarse = SMALL.replace("spacing_mm = 1", "spacing_mm = 3")
    free = coarse[: coarse.index("[cell]")] + NO_PROGRAM
    (alone,) = fastest_speeds(read_job(job(folder, free, "free.toml")))
    (there,) = fastest_speeds(read_job(job(folder, coarse, "coarse.toml")))
    assert 0 < there.at_nodes.on_grid <= alone.at_nodes.on_grid
    assert 0 < alone.as_run <= alone.at_nodes.speed


@pytest.mark.slow
@pytest.mark.parametrize("key", ['feed = "dip"', 'interruptions = "fewest"\nleast_piece_mm = 1'])
def test_over_the_fastest_speed_a_cut_in_a_cell_dips_or_is_interrupted(folder, key):
    keys = ('method = "exact"', "refine = false", "certify = false", key)
    over = with_keys("[plan]", *keys).replace("spacing_mm = 1", "spacing_mm = 2")
    over = over.replace("speed_m_min = 3", "speed_m_min = 4.5")
    outcome = run_job(read_job(job(folder, over)))
    assert outcome.passed
    dips = "dip" in key
    assert (len(outcome.cuts) > 1) is not dips
    for cut in outcome.cuts:
        assert (cut.plan.feed is not None) is dips
        assert "clear in the cell" in cut.plan.proof.statement
        assert {"collision", "collision-own"} <= {check.code for check in cut.checks}


@pytest.mark.slow
def test_a_tilted_cut_in_a_cell_stays_out_of_the_band_of_clearance(folder):
    keys = ("tilt_deg = 4", "tilt_cost_per_deg = 0.001", "rotation_deg = 10")
    keys = ('method = "exact"', "refine = false", *keys)
    tilted = with_keys("[plan]", *keys).replace("[cell]", f"{NEAR}[cell]", 1)
    path = job(folder, tilted.replace("spacing_mm = 1", "spacing_mm = 2"), "tilted.toml")
    result = run("plan", path, cwd=folder)
    assert result.returncode == 0, result.stderr or result.stdout
    assert "slot: tool axis tilted by up to 4.00 deg" in result.stdout
    (made,) = read_plan_file(folder / "tilted-plan" / "plan.json").plans
    assert made.proof.optimal
    assert made.settings.comfort.clearance == Band(width=0.03, cost=0.5)
    np.testing.assert_allclose(made.settings.rotation[made.robot.endless], np.radians(10))
    read = read_job(path)
    cell = cell_of_job(read, read_drawing(read.part_file))
    apart = cell.distances(made.q, enough=cell.required + 0.03)[:, ~cell.own]
    assert apart.min() >= cell.near_miss + 0.03 - 1e-6  # convex distances are exact to 1e-6 m


@pytest.mark.slow
def test_check_shows_bodies_pairs_and_the_start(folder):
    checked = check_job(read_job(job(folder, SMALL, "small.toml")))
    (start,) = checked.starts
    assert 0 < start.clear <= start.poses
    assert start.clearance > checked.cell.near_miss
    shown = run("check", "small.toml", cwd=folder)
    assert shown.returncode == 0, shown.stderr
    for words in (
        "nest left", "post - head: 20 mm", "not judged", "base - table", "slot",
        "800 x 1500 x 50", "not the real shape", "beyond the 24 mm that they overlap by design",
    ):  # fmt: skip
        assert words in shown.stdout
    assert "is its unit right?" not in shown.stdout
    told = json.loads(run("check", "small.toml", "--json", cwd=folder).stdout)
    pairs = len(told["cell"]["judged"]) + len(told["cell"]["not_judged"])
    assert pairs == 15 * 14 // 2  # every pair is one or the other, those of the floor, too
    assert all(entry["why"] for entry in told["cell"]["not_judged"])
    assert {"at_least_m", "asked_m", "overlap_by_design_m"} < set(told["cell"]["judged"][0])
    sizes = {body["name"]: body["size_m"] for body in told["cell"]["bodies"]}
    np.testing.assert_allclose(sizes["table"], [0.8, 1.5, 0.05])
    free = SMALL[: SMALL.index("[cell]")] + NO_PROGRAM
    shown = run("check", job(folder, free, "free.toml"), cwd=folder)
    assert "Collisions are not checked" in shown.stdout


def test_pairs_and_files_of_the_job_make_its_cell(folder):
    text = with_keys(
        "[cell]", 'may_touch = [["arm", "post"]]', "share = 0.25", 'links = "capsules"'
    )
    text = text.replace(
        "near_miss_mm = 20", 'near_miss_mm = 20\n[[cell.pair]]\nbetween = ["head", "link 3"]\n'
        'allowed = "the bracket is drawn too thick"', 1,
    )  # fmt: skip
    text += '\n[[cell.fixture]]\nname = "lump"\nfile = "lump.stl"\nunit = "mm"\n'
    text += "xyz_mm = [2000, 0, 0]\n"
    text += '[[cell.fixture]]\nname = "twin"\nfile = "b_pillar.step"\nxyz_mm = [0, 3000, 0]\n'
    text += '[[cell.fixture]]\nname = "pin"\ncylinder_mm = [80, 500]\n'
    text += "xyz_mm = [0, 2000, 1000]\nrpy_deg = [0, 90, 0]\n"
    text += "[cell.head]\nbody_radius_mm = 55\n"
    read = read_job(job(folder, text))
    cell = cell_of_job(read, read_drawing(read.part_file))
    bodies = {body.name: body.shape for body in cell.bodies}
    assert ("post", "arm") not in cell.pair_names
    assert cell.unjudged["link 3", "head"] == "the bracket is drawn too thick"
    assert "link 3 - head (the bracket is drawn too thick)" in collision_note(cell)
    assert cell.required[cell.pair_names.index(("part", "nozzle"))] == 0.25e-3
    np.testing.assert_allclose(bodies["lump"].bounds, [[1.95, -0.05, -0.05], [2.05, 0.05, 0.05]])
    # A round body of 24 sides around the cylinder, along x once its z axis is turned there.
    pin = bodies["pin"].points - [0, 2, 1]
    assert np.ptp(pin[:, 0]) == pytest.approx(0.5, abs=1e-12)
    around = np.hypot(pin[:, 1], pin[:, 2])
    assert around == pytest.approx(0.04 / np.cos(np.pi / 24), abs=1e-12)
    assert bodies["twin"].deviation == 0.2e-3
    assert np.ptp(bodies["twin"].bounds[:, 0]) == pytest.approx(1.2, abs=1e-3)


FAULTS = [
    ("near_miss_mm = 10", "", "cell.near_miss_mm: expected a number not below 0.*got nothing"),
    ("near_miss_mm = 10", "near_miss = 10", "expected a key of .cell., .*nearest: near_miss_mm"),
    ('name = "post"', 'nam = "post"', r"expected a key of \[\[cell.fixture\]\].*nearest: name"),
    ('name = "post"', 'name = "table"', "cell.fixture.name: expected a name that no other body"),
    ('name = "post"', 'name = "part"', "two bodies are called 'part'; rename one"),
    ("size_mm = [60, 60, 600]", "", "cell.fixture.size_mm: expected one of size_mm .*got none"),
    ("size_mm = [60, 60, 600]", 'file = "no.stl"', "cell.fixture.file: .*it is not in"),
    (
        "size_mm = [60, 60, 600]",
        'file = "a.off"',
        r"cell.fixture.file: expected a mesh or STEP.*\.ply",
    ),
    ("size_mm = [60, 60, 600]", 'file = "lump.stl"', "cell.fixture.unit: expected the unit of the"),
    ("size_mm = [60, 60, 600]", 'size_mm = [1, 1, 1]\nunit = "mm"', "unit only with file"),
    ("size_mm = [60, 60, 600]", "cylinder_mm = [0, 60]", r"fixture.cylinder_mm: .*got 0"),
    ("size_mm = [60, 60, 600]", "size_mm = [60, 60]", r"fixture.size_mm: .*got \[60, 60\]"),
    (
        "size_mm = [60, 60, 600]",
        'file = "open.stl"\nunit = "mm"',
        "cell.fixture: open.stl: the surface is not closed",
    ),
    ('["head", "post"]', '["head", "pots"]', 'cell.pair.between: .*got "pots"; there are base'),
    ('["head", "post"]', '["head", "head"]', 'expected two bodies, got "head" twice'),
    ('["head", "post"]', '["head"]', "cell.pair.between: expected the names of two bodies"),
    ("near_miss_mm = 20", "near_miss_mm = -1", "cell.pair.near_miss_mm: .*got -1"),
    ("near_miss_mm = 20", "", "cell.pair.near_miss_mm: expected one of .*allowed .*got none"),
    ("near_miss_mm = 20", 'near_miss_mm = 2\nallowed = "why"', "expected one of .*got both"),
    ("stand_off_mm = 1", "share = 1.5", "cell.share: .*below 1"),
    ("stand_off_mm = 1", 'may_touch = [["arm", "wall"]]', 'cell.may_touch: .*got "wall"'),
    ("stand_off_mm = 1", 'links = "description"', "cell.links: .*only with urdf"),
    ("stand_off_mm = 1", "sheet_mm = 1.5", "closed solid with its own thickness; remove"),
    ("stand_off_mm = 1", "head.unit = 'mm'", "cell.head.unit: expected unit only with file"),
    ("stand_off_mm = 1", "head.xyz_mm = [0, 0, 0]", "cell.head.xyz_mm: .*only with file"),
    (
        "stand_off_mm = 1",
        "head.file = 'lump.stl'\nhead.unit = 'mm'",
        "cell: head lump.stl: .*stand-off point",
    ),
    (
        "[plan]",
        '[plan]\nmethod = "known"',
        'plan.method: expected method = "continuous" or "exact" with .cell.',
    ),
    ('posture = "front/up"', 'posture = "third"', "plan.posture: .*plus.minus, such .*got 'third'"),
    (
        "[plan]",
        f'{NEAR}[plan]\nfeed = "dip"',
        'comfort.clearance_band_mm: expected feed = "constant" with .*got "dip"',
    ),
    (
        "[plan]",
        f'{NEAR}[plan]\ninterruptions = "fewest"',
        'comfort.clearance_band_mm: expected interruptions = "none" .*got "fewest"',
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), FAULTS)
def test_a_fault_in_the_cell_is_told_in_one_line(folder, old, new, message):
    assert SMALL.count(old) >= 1
    path = job(folder, SMALL.replace(old, new, 1), "fault.toml")
    result = run("check", path, cwd=folder)
    assert_refused(result, f"{path}:")
    assert re.search(message, result.stderr), result.stderr


def test_a_part_drawn_as_a_surface_needs_its_thickness(folder, monkeypatch):
    whole = read_job(job(folder, SMALL))
    part = read_drawing(whole.part_file)
    n = 5
    x, y = (v.ravel() / n for v in np.meshgrid(range(n), range(n)))
    corner = np.arange(n * (n - 1)).reshape(n - 1, n)[:, :-1].ravel()
    sheet = np.vstack(
        [np.c_[corner, corner + 1, corner + n], np.c_[corner + 1, corner + n + 1, corner + n]]
    )
    surface = np.c_[x, y, 0 * x], sheet
    monkeypatch.setattr(type(part), "mesh", lambda self, deflection: surface)
    with pytest.raises(InputError, match=r"cell\.sheet_mm: .*drawn as a surface.*add sheet_mm"):
        cell_of_job(whole, part)
    thick = read_job(job(folder, with_keys("[cell]", "sheet_mm = 2")))
    (solid,) = (b.shape for b in cell_of_job(thick, part).bodies if b.kind == "part")
    # Placed at z = 0.5 m; the drawn side is the upper one.
    np.testing.assert_allclose(solid.bounds[:, 2], [0.498, 0.5], atol=1e-12)


def test_a_thickened_sheet_is_closed_and_as_thick_as_asked():
    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = np.c_[np.cos(t), np.sin(t)]
    vertices = np.vstack([np.c_[ring, 0 * t], np.c_[ring, 0 * t + 1]])
    i = np.arange(40)
    j = (i + 1) % 40
    pipe = np.vstack([np.c_[i, j, i + 40], np.c_[j, j + 40, i + 40]])  # outward, open at both ends
    assert edges_of(pipe)[1].sum() == 80
    points, triangles = thicken(vertices, pipe, 0.1)
    solid = Mesh(vertices=points, triangles=triangles)
    radius = np.hypot(*solid.vertices[:, :2].T)
    # Of a corner's three triangles two are of one side: the mean normal leans by a few degrees.
    np.testing.assert_allclose(np.unique(radius.round(9)), [0.9, 1.0], atol=1e-3)
    assert solid.contains(np.array([[0.95, 0, 0.5], [0.5, 0, 0.5], [1.1, 0, 0.5]])).tolist() == [
        True,
        False,
        False,
    ]


def test_the_map_tells_collisions_and_what_is_to_spare():
    graph = LayeredGraph(
        q=np.zeros((4, 6)),
        start=np.array([0, 3, 4]),
        gamma=np.array([0.0, 1.0, 2.0]),
        tilt=np.zeros((1, 2)),
        sample=np.array([0, 1, 2, 1], np.int32),
        variant=np.zeros(4, np.int32),
        posture=np.zeros(4, np.int8),
        turn=np.zeros((4, 6), np.int8),
        reason=np.array([[[0], [0], [0]], [[1], [0], [2]]], np.uint8),
        reasons=("admitted", "unreachable", "joint 1 low"),
    )
    lower = np.array([0.5, 0.012, -np.inf, 0.001])
    found = ClearanceMap(
        clear=np.array([True, True, False, True]),
        lower=lower,
        upper=lower + 1e-3,
        pair=np.zeros(4, np.int64),
        pairs=(("a", "b"),),
        band=0.02,
        resolution=1e-3,
        poses=4,
        queries=0,
    )
    mapped = add_clearance(graph, found)
    words = np.array(mapped.reasons)[mapped.reason[:, :, 0]]
    assert words.tolist() == [
        ["admitted", "10 to 20 mm to spare", "collision"],
        ["unreachable", "0 to 5 mm to spare", "joint 1 low"],
    ]


# Robots.


def free(robot, rest=""):
    """Return the small job without a cell for another robot, planned without a program."""
    tail = SMALL[SMALL.index("[tool]") : SMALL.index("[cell]")].replace('posture = "front/up"', "")
    return f'{robot}{tail}{rest}[program]\nlanguage = "none"\n'


def test_an_arm_by_its_lengths_plans_without_a_program(folder):
    text = free(FIVE).replace('head = "laser-head-45"', "xyz_mm = [0, 0, 200]\nrpy_deg = [0, 0, 0]")
    read = read_job(job(folder, text, "five.toml"))
    q = np.random.default_rng(4).uniform(-1, 1, (20, 5))
    np.testing.assert_allclose(read.robot.forward(q), ARM.forward(q), atol=1e-12)
    np.testing.assert_allclose(read.robot.velocity, ARM.velocity)
    assert read.robot.endless.tolist() == [False, False, False, True, True]
    result = run("plan", "five.toml", "--out", "five", "--json", cwd=folder)
    said = json.loads(result.stdout)
    assert result.returncode in (0, 1), result.stderr
    written = {Path(f).name for f in said["files"]}
    assert written == {"plan.json", "trajectory.csv", "report.html"}


def test_a_posture_in_words_is_one_of_the_robot_s_family(folder):
    text = free(FIVE).replace("[plan]", '[plan]\nposture = "rear/third"')
    assert read_job(job(folder, text)).options.postures == (12, 14)
    with pytest.raises(InputError, match=r"plan\.posture: .*minus\|third\|fourth, such"):
        read_job(job(folder, text.replace("third", "fifth")))


@pytest.mark.slow
@pytest.mark.parametrize("cell", [False, True])
def test_a_described_robot_plans_what_the_library_s_own_does(folder, arm, cell):
    described(folder, rebuilt(arm, T_base_foot=np.eye(4)))  # writes arm.urdf
    table = '[robot]\nurdf = "arm.urdf"\ntip = "tool0"\nendless = [4, 6]\n'
    table += "acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]\n"
    limits = "lower_deg = [-172, -172, -172, -172, -172, -172]\n"
    limits += "upper_deg = [172, 172, 172, 172, 172, 172]\n"
    limits += "velocity_deg_s = [115, 115, 115, 115, 115, 115]\n"
    rest = SMALL[SMALL.index("[cell]") : SMALL.index("[program]")] if cell else ""
    rest = rest.replace("[cell]", "[cell]\npart = false")
    costs = []
    for name, robot in (("urdf.toml", table + limits), ("library.toml", ROBOT + limits)):
        path = job(
            folder,
            free(robot, rest).replace("[plan]", '[plan]\nmethod = "exact"\nrefine = false'),
            name,
        )
        result = run("plan", path, "--out", name.removesuffix(".toml"), "--json", cwd=folder)
        assert result.returncode == 0, result.stderr or result.stdout
        costs.append(json.loads(result.stdout)["contours"][0]["cost"])
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)


ROBOTS = [
    ('model = "abb_irb4600_60_205"', 'urdf = "no.urdf"', "robot.urdf: .*it is not in"),
    ('model = "abb_irb4600_60_205"', 'urdf = "bad.urdf"', "robot.urdf: .*bad.urdf"),
    ("endless = [4, 6]", 'urdf = "bad.urdf"', "robot.urdf: expected one of model .*got model and"),
    ("endless = [4, 6]", 'tip = "tool0"', "robot.tip: expected tip only with urdf"),
    ("endless = [4, 6]", 'kinematics = "five"', "robot.kinematics: expected one of model"),
    ("1300, ", "", "robot.acceleration_deg_s2: expected 6 numbers, .*got 5"),
]


@pytest.mark.parametrize(("old", "new", "message"), ROBOTS)
def test_a_fault_of_the_robot_is_told_in_one_line(folder, old, new, message):
    (folder / "bad.urdf").write_text("<robot name='x'><link name='a'/></robot>")
    path = job(folder, SMALL.replace(old, new, 1), "fault.toml")
    result = run("check", path, cwd=folder)
    assert_refused(result, f"{path}:")
    assert re.search(message, result.stderr), result.stderr


FIVES = [
    (
        "endless = [4, 5]",
        "endless = [6]",
        "robot.endless: expected axis numbers .*to 5, got 6",
    ),
    (", c4 = 120", "", "robot.geometry_mm: .*geometry lacks c4"),
    (", c4 = 120", ", c4 = 120, d9 = 1", "robot.geometry_mm: .*got d9; remove it"),
    ("1500, 1500]", "1500]", "robot.acceleration_deg_s2: expected 5 numbers, .*got 4"),
    (
        "velocity_deg_s = [120, 110, 130, 300, 300]\n",
        "",
        "robot.velocity_deg_s: expected 5 numbers",
    ),
    ("endless", "sign = [1, 1, 2, 1, 1]\nendless", "robot.sign"),
    (
        "acceleration_deg_s2 = [400, 300, 500, 1500, 1500]",
        'acceleration_ratio = "iontec_20_to_70kg"',
        "robot.acceleration_ratio: expected a ratio for 5 joints, got one for 6",
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), FIVES)
def test_a_five_axis_arm_is_asked_for_five_of_everything(folder, old, new, message):
    assert old in FIVE
    with pytest.raises(InputError, match=message):
        read_job(job(folder, free(FIVE.replace(old, new, 1))))


def test_weights_are_one_for_every_joint(folder):
    text = SMALL.replace("[plan]", "[plan]\nweights = [1, 1, 1, 1, 1]")
    with pytest.raises(InputError, match=r"plan\.weights: expected 6 numbers, .*got 5"):
        read_job(job(folder, text))


def test_a_description_without_speeds_asks_for_them_in_the_job_s_words(folder, arm):
    described(folder, arm, inside='<limit lower="-3" upper="3" effort="1"/>')
    robot = '[robot]\nurdf = "arm.urdf"\nacceleration_deg_s2 = [1, 1, 1, 1, 1, 1]\n'
    with pytest.raises(InputError, match=r"robot\.velocity_deg_s: .*give velocity for all 6"):
        read_job(job(folder, free(robot)))


def test_a_language_that_the_robot_does_not_speak_is_refused_before_planning(folder):
    robot = '[robot]\nmodel = "ur_ur10e"\nacceleration_deg_s2 = [300, 300, 300, 300, 300, 300]\n'
    text = free(robot).replace('language = "none"', 'language = "rapid"')
    path = job(folder, text, "ur.toml")
    result = run("plan", path, cwd=folder)
    assert_refused(
        result, f"{path}:", "program.language", "cannot yet express the axes", 'language = "none"'
    )


def test_an_arm_whose_axis_3_is_not_known_is_asked_for_it_before_planning(folder, arm):
    # The arm with a longer forearm is none of the library; by its description or by its lengths.
    lengths = {**arm.geometry, "c3": arm.geometry["c3"] + 0.03}
    described(folder, rebuilt(arm, geometry=lengths, T_base_foot=np.eye(4)))
    rest = 'manufacturer = "ABB"\nacceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]\n'
    geometry = ", ".join(f"{name} = {1000 * value}" for name, value in lengths.items())
    limits = "lower_deg = [-172, -172, -172, -172, -172, -172]\n"
    limits += "upper_deg = [172, 172, 172, 172, 172, 172]\n"
    limits += "velocity_deg_s = [115, 115, 115, 115, 115, 115]\n"
    for number, table in enumerate(
        (
            '[robot]\nurdf = "arm.urdf"\ntip = "tool0"\n' + rest,
            f'[robot]\nkinematics = "opw"\ngeometry_mm = {{ {geometry} }}\n{rest}{limits}',
        )
    ):
        text = free(table).replace('language = "none"', 'language = "rapid"')
        with pytest.raises(InputError, match=r"program\.language: .*axis_3 = .*axis_3_deg"):
            require_language(read_job(job(folder, text, f"{number}.toml")))
        told = 'axis_3 = "horizontal"\naxis_3_deg = [-60, 65]\n'
        require_language(held := read_job(job(folder, text.replace(table, table + told), "a.toml")))
        (bound,) = held.robot.couplings
        upright = 90 * number  # lengths alone count joint 3 from the upright arm
        assert np.degrees([bound.lower, bound.upper]) == pytest.approx(
            [-60 + upright, 65 + upright]
        )
        for wrong, where in (
            ('axis_3 = "horizontal"\n', r"robot\.axis_3_deg: expected the two limits of axis 3"),
            (told.replace("horizontal", "serial"), r"robot\.axis_3_deg: .*got them with 'serial'"),
            (told.replace("horizontal", "coupled"), r"robot\.axis_3: expected 'serial' or"),
        ):
            with pytest.raises(InputError, match=where):
                read_job(job(folder, text.replace(table, table + wrong), "w.toml"))
    with pytest.raises(InputError, match="axis_3 only with urdf or kinematics"):
        read_job(job(folder, free(ROBOT + 'axis_3 = "serial"\n')))
