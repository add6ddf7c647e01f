"""The best placement on the grid: bounds that hold, moves that are right, a repeatable search."""

import json
import re
import sqlite3
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from browser import CHROMIUM, dom_of, figures
from commands import assert_refused, run
from jobs import speeds_on_grid
from kerfpath.cad import read as read_drawing
from kerfpath.errors import InputError
from kerfpath.job import cell_of_job, pose, read_job
from kerfpath.study import job_key, layout, ranges_of
from kerfpath.study.loaded_job import EVERY
from kerfpath.study.placing.place import middle_of, move_job, numbers_of, placed_text
from kerfpath.study.placing.study import contours_of, nodes_of
from layouts import CELL, HEAD, contours, job_file, rings, worth

STANDING = """
[layout]
standing = ["column"]
"""
RANGES = {"x_mm": (-150.0, 150.0), "yaw_deg": (-30.0, 30.0)}
SOME = [
    {"x_mm": 120.0, "y_mm": -80.0, "yaw_deg": 25.0, "tilt_x_deg": 12.0},
    {"x_mm": -150.0, "z_mm": 90.0, "yaw_deg": -28.0, "tilt_y_deg": -9.0},
    {"base_x_mm": 60.0, "base_yaw_deg": 8.0, "mount_deg": 35.0},
]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Two openings at 2 m/min."""
    return job_file(tmp_path_factory.mktemp("a"), HEAD + contours(speed=2, step=5))


@pytest.fixture(scope="module")
def slow(tmp_path_factory):
    """The same so slow that over eight nodes an endless axis may turn more than half a turn."""
    return job_file(tmp_path_factory.mktemp("b"), HEAD + contours(speed=0.2, step=10))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    return rings(tmp_path_factory.mktemp("d"), 1200)


@pytest.fixture(scope="module")
def in_cell(tmp_path_factory):
    return job_file(
        tmp_path_factory.mktemp("c"),
        HEAD + contours(speed=2, step=10) + CELL + STANDING,
    )


def middle(path, goal="speed"):
    return middle_of(read_job(path), nodes_of(contours_of(**job_key(path))))


@pytest.mark.slow
@pytest.mark.parametrize("goal", ["speed", "margin", "motion"])
@pytest.mark.parametrize("which", ["plain", "slow", "in_cell"])
def test_no_bound_is_below_what_the_exact_search_finds(which, goal, request):
    job = request.getfixturevalue(which)
    rng = np.random.default_rng(3)
    sizes = [len(s.nodes) for s in contours_of(**job_key(job))]
    decided = 0
    for offsets in SOME:
        stretches = []
        for c, size in enumerate(sizes):
            first = int(rng.integers(0, size - 12))
            stretches.append((c, first, first + int(rng.integers(4, 12))))
        bound = worth(job, offsets, goal=goal, stretches=stretches)
        exact = worth(job, offsets, goal=goal, exact=True, whole=True)
        if bound.status != "feasible":
            assert exact.status != "feasible"
        elif exact.status == "feasible":
            decided += 1
            sign = -1 if goal == "motion" else 1
            # 1e-9 relative: what rounding of sums of a few dozen steps comes to.
            assert sign * bound.bound >= sign * exact.value * (1 - sign * 1e-9)
    assert decided


def test_the_bounds_are_near_the_value_where_the_stretch_is_the_one_that_binds(plain):
    whole = worth(plain, exact=True, whole=True)
    slowest = min(whole.contours, key=lambda c: c.value)
    about = (
        slowest.index,
        max(0, slowest.node - 24),
        min(slowest.nodes, slowest.node + 25) - 1,
    )
    bound = worth(plain, stretches=[about]).bound
    assert whole.value <= bound * (1 + 1e-9)
    assert bound <= whole.value * 1.1


def test_what_is_called_unreachable_has_a_node_without_a_pose(plain):
    job, lost = read_job(plain), 0
    subjects = {s.name: s for s in contours_of(**job_key(plain))}
    for x in (300.0, 600.0, 800.0, 1000.0):
        answer = worth(plain, {"x_mm": x})
        if answer.status != "unreachable":
            continue
        lost += 1
        there = move_job(job, numbers_of(job, {"x_mm": x}, middle(plain)))
        graph = there.graph(subjects[answer.infeasibility.contour].nodes)
        assert answer.infeasibility.node % EVERY == 0
        assert np.diff(graph.start)[answer.infeasibility.node] == 0
    assert lost


def test_infeasible_placements_rank_by_how_much_is_reached_and_then_by_how_far_it_is(plain):
    answers = [worth(plain, {"x_mm": x}) for x in (1000.0, 1400.0, 3000.0, 4000.0)]
    assert all(a.status == "unreachable" for a in answers)
    progress = [a.infeasibility.progress for a in answers]
    assert all(near > far for near, far in pairwise(progress))


def test_a_floor_ends_early_and_a_better_placement_is_still_found(plain):
    whole = worth(plain, SOME[0], exact=True, whole=True)
    beaten = worth(plain, SOME[0], exact=True, floor=whole.value * 1.01)
    assert beaten.value is None
    assert beaten.bound <= whole.value * 1.01
    found = worth(plain, SOME[0], exact=True, floor=whole.value * 0.99)
    assert found.value == pytest.approx(whole.value, rel=1e-12)  # the same search


@pytest.mark.parametrize("offsets", SOME)
def test_the_file_that_is_written_has_the_very_placement_that_was_looked_at(
    in_cell, offsets, tmp_path
):
    job = read_job(in_cell)
    numbers = numbers_of(job, offsets, middle(in_cell))
    text = placed_text(job, numbers, tmp_path, "placed")
    assert "# where it lies now" in text
    file = job_file(tmp_path, text)
    again, there = read_job(file), move_job(job, numbers)
    assert np.array_equal(again.placement, there.placement)
    assert np.array_equal(again.tool, there.tool)
    assert again.cell == there.cell
    part = read_drawing(job.part_file)
    q = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 6))
    distances = [cell_of_job(j, part).distances(q) for j in (again, there)]
    assert np.array_equal(*distances)
    found = worth(in_cell, offsets, exact=True, whole=True)
    speeds = speeds_on_grid(again)
    if found.status == "feasible":
        # The same graph and search twice.
        assert min(s.speed for s in speeds) * 60 == pytest.approx(found.value, rel=1e-12)
    else:
        assert any(isinstance(s, Exception) for s in speeds)


def test_fixtures_go_with_the_part_but_for_the_standing_ones_and_all_against_the_base(in_cell):
    job, mid = read_job(in_cell), middle(in_cell)
    offsets = {"x_mm": 40.0, "yaw_deg": 15.0, "base_y_mm": -30.0, "base_yaw_deg": 10.0}
    there = move_job(job, numbers_of(job, offsets, mid))
    base = np.linalg.inv(pose([0, -30, 0], [0, 0, 10]))
    to, turn, back = np.eye(4), pose([0, 0, 0], [0, 0, 15]), np.eye(4)
    to[:3, 3], back[:3, 3] = mid + np.array([0.04, 0, 0]), -mid
    part = to @ turn @ back
    drawing = read_drawing(job.part_file)
    before, after = ({b.name: b for b in cell_of_job(j, drawing).bodies} for j in (job, there))
    for name, motion in (("nest", base @ part), ("column", base)):
        corners = before[name].shape.corners @ motion[:3, :3].T + motion[:3, 3]
        # 1 um: numbers of a file are to 0.1 um and 1e-6 deg.
        assert np.allclose(
            np.sort(corners, axis=0), np.sort(after[name].shape.corners, axis=0), atol=1e-6
        )
    assert np.allclose(there.placement, base @ part @ job.placement, atol=1e-6)


def test_a_head_from_a_file_turns_with_its_mount(tmp_path):
    cone = stl_cone(tmp_path / "cone.stl")
    text = HEAD.replace('head = "laser-head-45"', "xyz_mm = [40, 0, 200]\nrpy_deg = [0, 0, 0]")
    file = f'[cell.head]\nfile = "{cone}"\nunit = "mm"\nxyz_mm = [40, 0, 100]\n'
    cell = (CELL + STANDING).replace(
        "[[cell.fixture]]", f"{file}nozzle_length_mm = 40\n\n[[cell.fixture]]", 1
    )
    job = read_job(job_file(tmp_path, text + contours(speed=2, step=10) + cell))
    there = move_job(job, numbers_of(job, {"mount_deg": 50.0}, np.zeros(3)))
    drawing = read_drawing(job.part_file)
    before, after = ({b.name: b for b in cell_of_job(j, drawing).bodies} for j in (job, there))
    end = cell_of_job(job, drawing).chain.end
    motion = end @ pose([0, 0, 0], [0, 0, 50]) @ np.linalg.inv(end)
    for name in ("nozzle", "head"):
        corners = before[name].shape.vertices @ motion[:3, :3].T + motion[:3, 3]
        # 1 um: numbers of a file are to 0.1 um and 1e-6 deg. A cut may order corners anew.
        far = cdist(corners, after[name].shape.vertices)
        assert max(far.min(axis=0).max(), far.min(axis=1).max()) < 1e-6
    assert np.allclose(there.tool, pose([0, 0, 0], [0, 0, 50]) @ job.tool, atol=1e-6)


def stl_cone(path):
    """Write a four-sided cone whose point is at z = 98 mm and base at z = 0; return its name."""
    base = np.array([[30, 20, 0], [-30, 20, 0], [-30, -20, 0], [30, -20, 0]], float)
    sides = [(base[i], base[(i + 1) % 4], [0, 0, 98]) for i in range(4)]
    faces = [*sides, (base[2], base[1], base[0]), (base[3], base[2], base[0])]
    lines = ["solid cone"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in face]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid cone"]))
    return path.name


def test_a_base_that_moves_is_a_part_that_moves_the_other_way(plain):
    # Rounding of the file's numbers, 0.1 um in a metre, may tip a pose over a limit: 1e-4.
    base = worth(plain, {"base_x_mm": 50.0, "base_y_mm": -20.0}, exact=True).value
    assert base == pytest.approx(
        worth(plain, {"x_mm": -50.0, "y_mm": 20.0}, exact=True).value, rel=1e-4
    )


def test_turning_the_head_on_an_endless_axis_changes_nothing(plain):
    # Axis 6 turns about the flange's z: it takes the turn back. 1e-6: rounding in the file.
    shipped = worth(plain, exact=True).value
    assert worth(plain, {"mount_deg": 40.0}, exact=True).value == pytest.approx(shipped, rel=1e-6)
    motion = worth(plain, goal="motion", exact=True).value
    turned = worth(plain, {"mount_deg": 40.0}, goal="motion", exact=True).value
    assert turned == pytest.approx(motion, rel=1e-6)


@pytest.mark.parametrize("goal", ["speed", "motion"])
def test_a_tolerance_never_makes_it_better(plain, goal):
    alone = worth(plain, {"x_mm": 30.0}, goal=goal, exact=True).value
    star = [{"x_mm": 30.0}, {"x_mm": 25.0}, {"x_mm": 35.0}]
    robust = worth(plain, *star, goal=goal, exact=True)
    values = [worth(plain, at, goal=goal, exact=True).value for at in star]
    worst = max(values) if goal == "motion" else min(values)
    assert robust.value == pytest.approx(worst, rel=1e-12)  # the same searches
    assert (robust.value >= alone) if goal == "motion" else (robust.value <= alone)
    assert values[robust.place] == pytest.approx(worst, rel=1e-12)


class Stopped(Exception):
    pass


def found(job, store, processes=1, **options):
    result = layout(job, store=store, ranges=RANGES, map_points=0, processes=processes, **options)
    story = [(dict(t.offsets), t.result.bound, t.result.value, t.searched) for t in result.tried]
    return result, json.dumps(story)


@pytest.mark.slow
def test_the_search_is_repeatable_goes_on_and_proves_what_it_says(coarse, tmp_path):
    result, story = found(coarse, tmp_path / "one.sqlite", evaluations=8)

    # Killed half way: the same call goes on, and what was done is not done again.
    def stop(what, done, total):
        if what == "placements" and done >= total // 2:
            raise Stopped

    store = tmp_path / "two.sqlite"
    with pytest.raises(Stopped):
        found(coarse, store, 2, evaluations=8, progress=stop)
    rows = len(kept(store))
    assert 0 < rows < len(kept(tmp_path / "one.sqlite"))
    assert found(coarse, store, 2, evaluations=8)[1] == story
    assert kept(store) == kept(tmp_path / "one.sqlite")
    # Oracle: every placement tried, each contour solved exactly.
    assert result.proved
    assert result.best is not None
    values = [worth(coarse, dict(t.offsets), exact=True).value for t in result.tried]
    assert result.best.result.value == pytest.approx(max(v for v in values if v), rel=1e-12)
    assert result.best.result.value >= result.before.value
    assert dict(result.tried[0].offsets) == dict.fromkeys(RANGES, 0.0)
    assert sum(result.stages.values()) == len(result.tried)
    assert sum(t.searched for t in result.tried) < len(result.tried)


def kept(store):
    with closing(sqlite3.connect(store)) as base:
        return {key for (key,) in base.execute("SELECT key FROM result")}


@pytest.mark.slow
def test_a_job_that_cannot_be_cut_where_it_lies_is_led_to_where_it_can(tmp_path):
    job = rings(tmp_path, 2600)
    assert worth(job).status == "unreachable"
    result = layout(
        job, store=tmp_path / "s.sqlite", ranges={"x_mm": (-1200.0, 0.0)}, evaluations=24,
        map_points=5, processes=1, tolerance_mm=20,
    )  # fmt: skip
    assert result.before.status == "unreachable"
    assert result.best is not None
    # Worth what the worst is of itself and the ends of its tolerance: the same searches again.
    x = result.best.offsets["x_mm"]
    star = [worth(job, {"x_mm": x + off}, exact=True).value for off in (-20.0, 0.0, 20.0)]
    assert result.best.result.value == pytest.approx(min(star), rel=1e-12)
    assert result.map is not None
    assert [trial.result.status for trial in result.map.trials][-1] == "unreachable"


def test_ranges_on_the_command_line():
    assert ranges_of(["x_mm=-200:200", "yaw_deg = -5 : 5.5"]) == {
        "x_mm": (-200.0, 200.0),
        "yaw_deg": (-5.0, 5.5),
    }
    for text, said in {
        "x=-1:1": "vary: expected one of x_mm, y_mm, z_mm",
        "x_mm=1": "expected x_mm=LOW:HIGH",
        "x_mm=a:b": "expected x_mm=LOW:HIGH",
        "x_mm=2:-2": "with LOW below HIGH",
        "x_mm=2:2": "with LOW below HIGH",
        "x_mm=0:inf": "with LOW below HIGH",
        "x_mm=0:nan": "with LOW below HIGH",
    }.items():
        with pytest.raises(InputError, match=re.escape(said)):
            ranges_of([text])
    with pytest.raises(InputError, match="x_mm is given twice"):
        ranges_of(["x_mm=0:1", "x_mm=0:2"])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("x_mm = [200, -200]", "a reversed one; write [-200, 200]"),
        ("yaw_deg = [5, 5]", "an empty range"),
        ("tilt_deg = [-5, 5]", "unknown name; nearest: tilt_y_deg"),
        ('standing = ["table"]', 'got "table"; there are none'),
        ('goal = "fast"', "'speed', 'margin' or 'motion'"),
        ("evaluations = 3", "a whole number of placements"),
    ],
)
def test_a_layout_table_is_refused_at_its_line(tmp_path, line, said):
    text = HEAD + contours(speed=2, step=10) + f"\n[layout]\n{line}\n"
    path = job_file(tmp_path, text)
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        read_job(path)
    assert f"job.toml:{text[: text.index(line)].count(chr(10)) + 1}: layout" in str(refused.value)


def test_numbers_in_place_of_the_table_are_checked(plain, tmp_path):
    with pytest.raises(InputError, match="evaluations: expected at least 8, got 2"):
        layout(plain, store=tmp_path / "s.sqlite", evaluations=2)
    with pytest.raises(InputError, match="tolerance_mm: expected at least 0, got -1"):
        layout(plain, store=tmp_path / "s.sqlite", tolerance_mm=-1)


@pytest.mark.slow
def test_the_command_leaves_a_page_its_data_and_a_job_that_plans(coarse, tmp_path):
    options = ["--vary", "x_mm=-300:0", "--vary", "yaw_deg=-30:30", "--evaluations", "8",
               "--map-points", "3", "--processes", "1", "--out", tmp_path / "out"]  # fmt: skip
    said = run("layout", coarse, *options, "--json")
    assert said.returncode == 0, said.stderr
    entry = json.loads(said.stdout)
    assert [Path(f).name for f in entry["files"]] == ["layout.json", "layout.html", "placed.toml"]
    data = json.loads((tmp_path / "out" / "layout.json").read_text())
    assert data == {key: value for key, value in entry.items() if key != "files"}
    assert set(data["best"]["offsets"]) == {"x_mm", "yaw_deg"}
    # The map is tried, too: none of its cells is better than what is called the best.
    bounds = [cell["bound"] for cell in data["map"]["cells"] if cell["status"] == "feasible"]
    assert len(data["map"]["cells"]) == 9
    assert max(bounds) <= data["best"]["value"] * (1 + 1e-9)
    placed = read_job(tmp_path / "out" / "placed.toml")
    speeds = [found.speed * 60 for found in speeds_on_grid(placed)]
    # The same graph and search twice.
    assert min(speeds) == pytest.approx(data["best"]["value"], rel=1e-12)
    # Again, from the store: the same files, and words for people.
    before = kept(tmp_path / "out" / "layout.sqlite")
    page = (tmp_path / "out" / "layout.html").read_bytes()
    again = run("layout", coarse, *options)
    assert again.returncode == 0
    assert kept(tmp_path / "out" / "layout.sqlite") == before
    assert (tmp_path / "out" / "layout.html").read_bytes() == page
    assert f"speed: {data['best']['value']:.3f} m/min" in again.stdout
    assert "it is proved that no other of them is better there" in again.stdout
    shown = dom_of(tmp_path / "out" / "layout.html") if CHROMIUM.exists() else None
    if shown is not None:
        assert shown.count('data-state="drawn"') == 2
        assert 'data-state="failed"' not in shown


@pytest.mark.slow
def test_the_command_says_why_no_placement_is_feasible(tmp_path):
    job = rings(tmp_path, 3500)
    said = run("layout", job, "--evaluations", "8", "--map-points", "0", "--processes", "1",
               cwd=tmp_path)  # fmt: skip
    assert said.returncode == 1
    assert "by default: no range in [layout] or --vary" in said.stdout
    assert re.search(
        r"of (\d+) tried \1 unreachable \(small, node 0\): bring the part nearer", said.stdout
    )
    # The nearest of those out of reach alike is the one nearest to the robot.
    assert re.search(r"nearest: x_mm = -\d", said.stdout)
    assert not (tmp_path / "job-layout" / "placed.toml").exists()
    (drawn,) = figures((tmp_path / "job-layout" / "layout.html").read_text())
    (why,) = drawn["layout"]["annotations"]
    assert "no placement is feasible" in why["text"].replace("<br>", " ")


def test_the_command_refuses_what_it_does_not_know(coarse, tmp_path):
    for given, word in (
        ("x=0:1", "got 'x'"),
        ("yaw_deg=5:-5", "with LOW below HIGH"),
    ):
        assert_refused(run("layout", coarse, "--vary", given, "--out", tmp_path / "out"), word)
    assert not (tmp_path / "out").exists()
