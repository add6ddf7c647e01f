"""Jobs that cut open lines, alone and among the loops of a part."""

import csv
import json
import shutil

import numpy as np
import pytest

from commands import assert_refused, run
from conftest import ROOT
from jobs import ROBOT_AND_HEAD, speeds_on_grid
from kerfpath.cad import read
from kerfpath.errors import InputError
from kerfpath.job import audit_file, check_job, fastest_speeds, read_job

PARTS = ROOT / "examples" / "parts"
HEAD = f"""\
{ROBOT_AND_HEAD}[part]
file = "blank.dxf"
xyz_mm = [1100, -50, 500]
rpy_deg = [0, 0, 0]
"""
LINE = """\
[[contour]]
pick = "MARK/line1"
name = "mark"
speed_m_min = 3
spacing_mm = 2
"""
HOLE = """\
[[contour]]
pick = "CUT/hole1"
speed_m_min = 3
spacing_mm = 1.5
"""
TRIM = """\
[[contour]]
pick = "CUT/outer"
name = "trim"
speed_m_min = 3
spacing_mm = 2.5
"""
EVERY = LINE.replace('pick = "MARK/line1"\nname = "mark"\n', "") + "[contour.pick_all]\n"
PLAN = '[plan]\ngamma_step_deg = 10\nposture = "front/up"\n'
LAST = '[sequence]\n[program]\nname = "job"\npierce_time_s = 0.1\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("open")
    shutil.copy(PARTS / "blank.dxf", folder)
    return folder


def job_of(folder, text, name="job.toml"):
    path = folder / name
    path.write_text(text)
    return path


def made_of(folder, keys):
    """Return what is cut of the mark with more keys, and the mark as drawn."""
    job = read_job(job_of(folder, HEAD + LINE + keys + PLAN, "made.toml"))
    part = read(job.part_file)
    (task,) = job.tasks(part)
    return task.sample(task.candidates(part)[0]), task.drawn(part)


@pytest.mark.slow
def test_an_open_line_is_planned_first_inside_its_trim_and_audited(folder):
    path = job_of(folder, HEAD + TRIM + LINE + HOLE + PLAN + LAST)
    result = run("plan", str(path), "--out", str(folder / "out"), "--json")
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    assert said["passed"]
    names = [entry["name"] for entry in said["contours"]]
    assert sorted(names[:2]) == ["CUT/hole1", "mark"]
    assert names[2] == "trim"
    rows = list(csv.DictReader((folder / "out" / "trajectory.csv").read_text().splitlines()))
    mark = [[float(row[f"{c}_mm"]) for c in "xyz"] for row in rows if row["contour"] == "mark"]
    # As drawn: (20, 75) to (80, 92) in the part, which lies at (1100, -50, 500).
    np.testing.assert_allclose(mark[0], [1120, 25, 500], atol=1e-6)
    np.testing.assert_allclose(mark[-1], [1180, 42, 500], atol=1e-6)
    assert audit_file(folder / "out" / "plan.json", path).passed
    assert (folder / "out" / "job.mod").exists()


@pytest.mark.slow
def test_the_other_commands_take_open_lines(folder):
    job = read_job(job_of(folder, HEAD + LINE + PLAN, "line.toml"))
    (start,) = check_job(job).starts
    assert start.name == "mark"
    (found,) = fastest_speeds(job)
    assert (found.task.name, found.nodes.closed) == ("mark", False)
    assert found.at_nodes.speed > 0.05
    # A slower lead has its nodes closer, which changes the speed on the grid a little.
    slow = LINE + "[contour.lead_in]\nlength_mm = 4\nangle_deg = 0\nspeed_share = 0.5\n"
    led = slow.replace("speed_share = 0.5\n", "")
    slowest, fastest = (
        speeds_on_grid(read_job(job_of(folder, HEAD + keys + PLAN, "led.toml")))[0].speed
        for keys in (slow, led)
    )
    assert slowest == pytest.approx(fastest, rel=0.05)


def test_open_lines_are_picked_as_such_alone(folder):
    job = read_job(job_of(folder, HEAD + EVERY + 'kind = "open"\n' + PLAN))
    part = read(job.part_file)
    (task,) = job.tasks(part)
    assert (task.name, task.drawn(part).closed) == ("MARK/line1", False)
    # A trim with a gap may end up as an open line: nobody asked for one here.
    job = read_job(job_of(folder, HEAD + EVERY + 'layer = "MARK"\n' + PLAN))
    (task,) = job.tasks(part)
    with pytest.raises(InputError, match=r"MARK/line1.*is open at .*or ask for an open one"):
        task.drawn(part)


def test_what_an_open_line_can_have(folder):
    nodes, drawn = made_of(folder, 'direction = "reversed"\nkerf_mm = 2\nscrap = "left"\n')
    # Scrap on the left as drawn: to +y of the first stretch, which runs along +x.
    np.testing.assert_allclose(nodes.points[-1] - drawn.points[0], [0, 0.001, 0], atol=1e-9)
    nodes, drawn = made_of(
        folder, "[contour.lead_in]\nlength_mm = 4\nangle_deg = 0\n[contour.lead_out]\nlength_mm = 3"
        "\nangle_deg = 0\n[contour.micro_joints]\nwidth_mm = 2\ncount = 1\n",
    )  # fmt: skip
    assert set(nodes.kinds) == {"pierce", "lead-in", "cut", "micro joint", "lead-out"}
    # At 0 degrees a lead goes straight on: the line begins along +x and ends along +y.
    np.testing.assert_allclose(nodes.points[0] - drawn.points[0], [-0.004, 0, 0], atol=1e-9)
    np.testing.assert_allclose(nodes.points[-1] - drawn.points[-1], [0, 0.003, 0], atol=1e-9)
    nodes, drawn = made_of(
        folder, "bevel_deg = 10\n[contour.smooth_axes]\ndistance_mm = 5\nlimit_deg = 5\n"
        "[contour.corners]\nslow_share = 0.5\n",
    )  # fmt: skip
    # The scrap is on the right: the head leans over to -y, the beam points to +y.
    np.testing.assert_allclose(
        nodes.axes[0], [0, np.sin(np.radians(10)), -np.cos(np.radians(10))], atol=1e-9
    )


REFUSED = [
    (LINE + 'start = "smoothest"', "contour.start: ", "begins at one of its ends"),
    (LINE + "start_mm = 4", "contour.start_mm: ", 'the other with direction = "reversed"'),
    (LINE + "overlap_mm = 2", "contour.overlap_mm: ", "does not return to its start"),
    (LINE + '[plan]\nclosure = "periodic"', "plan.closure: ", "does not return to its start"),
]


@pytest.mark.parametrize(("keys", "where", "why"), REFUSED)
def test_what_only_a_closed_loop_can_have_is_one_line(folder, keys, where, why):
    path = job_of(folder, HEAD + keys + "\n", "bad.toml")
    line = len(path.read_text().splitlines())
    result = run("plan", str(path), "--out", str(folder / "bad"))
    assert_refused(result, f"bad.toml:{line}: {where}loop 'MARK/line1' is an open line, which")
    assert why in result.stderr


def test_closed_loops_beside_open_lines_keep_what_they_ask_for(folder):
    job = read_job(job_of(folder, HEAD + LINE + HOLE + "overlap_mm = 2\n", "both.toml"))
    part = read(job.part_file)
    mark, hole = job.tasks(part)
    assert "overlap" in hole.sample(hole.candidates(part)[0]).kinds
    assert set(mark.sample(mark.candidates(part)[0]).kinds) == {"cut"}
