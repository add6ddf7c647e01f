"""Which robots can do a job: the same speeds as of a job with that robot, reach pose by pose."""

import json
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from commands import assert_refused, run
from jobs import SLIT_JOB, speeds_on_grid, write_slit_jobs
from kerfpath.cad import read
from kerfpath.errors import InputError
from kerfpath.graph import gamma_grid
from kerfpath.job import read_job
from kerfpath.robots import robot
from kerfpath.study import (
    NEAREST,
    contour_speeds,
    job_key,
    robots_entry,
    which_robots,
    with_robot,
    write_robots,
)
from kerfpath.study import robots as robots_module
from kerfpath.study.robots import evaluate_robot
from kerfpath.sweep import workers

# The job gives accelerations of its own robot, and none that could be assumed of others.
KNOWN = SLIT_JOB.replace(
    'acceleration_ratio = "iontec_20_to_70kg"',
    "acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]\nendless = [4, 6]",
).replace('pick = "b"\nspeed_m_min = 2', 'pick = "b"\nspeed_m_min = 400')
OWN, STATED, SILENT = "abb_irb4600_60_205", "kuka_kr16_r2010_2", "abb_irb2400_155"
SMALL, UNKNOWN = "staubli_tx60", "kuka_kr120_r2500_pro"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("robots")
    write_slit_jobs(folder, {"job": KNOWN})
    return folder


@pytest.fixture(scope="module")
def found(folder):
    names = [SMALL, UNKNOWN, SILENT, STATED, OWN]
    return which_robots(
        folder / "job.toml", store=folder / "robots.sqlite", processes=1, robots=names
    )


def test_those_that_can_come_first_and_the_others_say_why_not(found):
    by_id = {each.robot.id: each for each in found}
    assert {each.robot.id for each in found[:2]} == {STATED, OWN}
    margins = [each.binding.margin for each in found[:2]]
    assert margins == sorted(margins, reverse=True)
    assert [each.own for each in found].count(True) == 1
    assert by_id[OWN].own
    assert all(each.binding is None for each in found[2:])
    said = {
        SMALL: "2 of 2 contours; a: no pose at 11 of 11 nodes, at node 0 mostly: unreachable",
        SILENT: "it reaches every node, but its accelerations are not known",
        UNKNOWN: "joint limits are not known: the published description carries",
    }
    assert all(by_id[name].reason.startswith(why) for name, why in said.items())
    assert by_id[SMALL].reached == 0.0


def test_speeds_are_those_of_a_job_with_that_robot(found, folder):
    text = KNOWN.replace(OWN, STATED)
    text = "".join(
        line for line in text.splitlines(True) if not line.startswith(("accel", "endless"))
    )
    (folder / "other.toml").write_text(text + "refine = false\n")
    (folder / "own.toml").write_text(KNOWN + "refine = false\n")
    for each, name in ((found[0], found[0].robot.id), (found[1], found[1].robot.id)):
        job = read_job(folder / ("own.toml" if name == OWN else "other.toml"))
        speeds = [best.speed for best in speeds_on_grid(job)]
        assert [contour.fastest for contour in each.contours] == speeds
        margins = [speed / asked for speed, asked in zip(speeds, (2 / 60, 400 / 60), strict=True)]
        assert each.binding.margin == pytest.approx(min(margins), rel=1e-12)
        assert each.binding.name == "b"


def test_reach_is_the_share_of_nodes_with_a_pose(tmp_path):
    # A slit that runs out of reach, nodes every 100 mm.
    far = KNOWN.replace("count = 11", "count = 21")
    write_slit_jobs(tmp_path, {"job": far})
    table = (tmp_path / "slits.csv").read_text().replace("a,30,0,0,0", "a,2000,0,0,0")
    (tmp_path / "slits.csv").write_text(table)
    job = read_job(tmp_path / "job.toml")
    part = read(job.part_file)
    a, b = contour_speeds(job, part)
    assert (b.reached, b.reason) == (1.0, "")
    assert a.fastest is b.fastest is None, "speeds are looked for where all is in reach"
    first = job.tasks(part)[0]
    nodes = first.sample(first.candidates(part)[0])
    H = job.placement @ nodes.frames(job.options.frames)
    there = np.zeros(len(H), bool)
    for gamma in gamma_grid(job.options.gamma_step):
        spin = np.eye(4)
        spin[:2, :2] = [[np.cos(gamma), -np.sin(gamma)], [np.sin(gamma), np.cos(gamma)]]
        poses = H @ spin @ np.linalg.inv(job.tool)
        found = job.robot.inverse(poses)
        there[np.unique(found.pose)] = True
    assert 0 < there.sum() < 21
    assert a.reached == pytest.approx(there.mean())
    assert a.reason.startswith(f"no pose at {21 - there.sum()} of 21 nodes")


@pytest.mark.slow
def test_accelerations_are_assumed_only_as_asked(folder, tmp_path):
    path = folder / "job.toml"
    given = {"store": tmp_path / "store.sqlite", "robots": [SILENT, STATED], "processes": 1}
    by_id = {e.robot.id: e for e in which_robots(path, acceleration_ratio=NEAREST, **given)}
    assumed = by_id[SILENT]
    assert assumed.robot.acceleration_source.startswith("assumed: ratio cybertech_8_to_20kg")
    told = evaluate_robot(**job_key(path), name=SILENT, ratio="cybertech_8_to_20kg")
    assert [contour["fastest"] for contour in told] == [c.fastest for c in assumed.contours]
    assert "assumed" not in by_id[STATED].robot.acceleration_source
    with pytest.raises(InputError, match=r"expected one of nearest, .*, got 'heavy'"):
        which_robots(path, acceleration_ratio="heavy", **given)
    with pytest.raises(InputError, match="'abb_irb9' is not in the library"):
        which_robots(path, **(given | {"robots": ["abb_irb9"]}))


def test_what_is_wrong_with_the_job_is_refused_once_and_not_listed_for_each_robot(tmp_path):
    write_slit_jobs(tmp_path, {"job": SLIT_JOB.replace('pick = "b"', 'pick = "door"')})
    with pytest.raises(InputError, match="no loop 'door'"):
        which_robots(tmp_path / "job.toml", store=tmp_path / "store.sqlite", processes=1)
    assert not (tmp_path / "store.sqlite").exists()


def test_a_second_call_computes_nothing(found, folder, monkeypatch):
    def none(*_):
        raise AssertionError("a process was started")

    monkeypatch.setattr(workers, "get_context", none)
    names = [each.robot.id for each in found]
    again = which_robots(folder / "job.toml", store=folder / "robots.sqlite", robots=names)
    assert [each.contours for each in again] == [each.contours for each in found]
    with closing(sqlite3.connect(folder / "robots.sqlite")) as store:
        assert store.execute("SELECT count(*) FROM result").fetchone() == (len(names),)


def test_postures_are_those_of_the_other_family(folder):
    job = read_job(folder / "job.toml")
    job.source["plan"]["posture"] = "rear"
    assert with_robot(job, robot("ur_ur10e")).options.postures == (4, 5, 6, 7)
    job.source["plan"]["posture"] = "third"
    with pytest.raises(InputError, match="expected a posture in words"):
        with_robot(job, robot("ur_ur10e"))


def test_a_cell_is_kept_clear_of_and_links_are_never_guessed(tmp_path):
    cell = (
        '[cell]\nnear_miss_mm = 5\npart = false\n[[cell.fixture]]\nname = "wall"\n'
        "size_mm = [40, 900, 900]\nxyz_mm = [1215, 0, 520]\n"
    )
    write_slit_jobs(tmp_path, {"job": SLIT_JOB + cell})
    job = read_job(tmp_path / "job.toml")
    part = read(job.part_file)
    other = with_robot(job, robot(STATED))
    blocked = contour_speeds(other, part)
    assert [contour.reached for contour in blocked] == [1.0, 1.0]
    assert [c.reason for c in blocked] == ["collision: no clear pose at node 0"] * 2
    described = replace(job, cell=job.cell.model_copy(update={"links": "description"}))
    with pytest.raises(InputError, match="links are not known"):
        with_robot(described, robot(STATED))


def test_files_hold_what_was_found(found, folder):
    paths = write_robots(folder / "job.toml", found, folder)
    assert [path.name for path in paths] == ["robots.json", "robots.html"]
    told = json.loads(paths[0].read_text())["robots"]
    assert told == json.loads(json.dumps(robots_entry(found)))
    assert [entry["robot"] for entry in told] == [each.robot.id for each in found]
    page = paths[1].read_text()
    assert "2 of 5 robots can cut every contour" in page
    assert all(each.robot.id in page for each in found)
    assert len(page) < 100_000, "a table needs no drawing library"


def test_the_command_prints_and_writes_what_was_found(folder, found, monkeypatch):
    names = [each.robot.id for each in found]
    monkeypatch.setattr(robots_module, "robot_ids", lambda: names)
    (folder / "out").mkdir()
    shutil.copy(folder / "robots.sqlite", folder / "out")
    command = ["layout", "job.toml", "--robots", "--out", "out"]
    result = run(*command, cwd=folder)
    assert result.returncode == 1, "b is asked for faster than any can"
    rows = [line.split()[0] for line in result.stdout.splitlines() if line.startswith(tuple(names))]
    assert rows == names
    assert f"{OWN} (the job's own)" in result.stdout
    assert "wrote out/robots.html" in result.stdout
    told = json.loads(run(*command, "--json", cwd=folder).stdout)
    assert not told["able"]
    assert told["robots"] == json.loads(json.dumps(robots_entry(found)))


def test_bad_input_of_the_command_is_one_line(folder):
    def said(*arguments):
        result = run("layout", "job.toml", *arguments, cwd=folder)
        assert_refused(result)
        return result.stderr

    (folder / "file").write_text("")
    options = ("--goal", "speed", "--map-points", 0)
    assert "remove --goal, --map-points" in said("--robots", *options)
    assert "only with --robots" in said("--acceleration-ratio", "nearest")
    assert ", got 'heavy'" in said("--robots", "--acceleration-ratio", "heavy")
    assert "expected a folder, but file is a file" in said("--robots", "--out", "file")
