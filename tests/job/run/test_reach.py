"""A part that is out of reach: the shortest move along a few ways after which nodes have poses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from jobs import DEMO, SMALL
from kerfpath.job import check_job, prepare, read_job, run_job
from kerfpath.job.run.remedy import STEP, _moves, move_into_reach


def placed(folder, xyz):
    text = SMALL.replace("b_pillar.step", str(DEMO / "b_pillar.step"))
    path = folder / "job.toml"
    path.write_text(re.sub(r"xyz_mm = \[.*\]", f"xyz_mm = {list(xyz)}", text))
    return read_job(path)


def contours(job):
    return [(each.candidates[0].nodes, each.options) for each in prepare(job).contours]


def shifted(job, move):
    T = job.placement.copy()
    T[:3, 3] += move
    return replace(job, placement=T)


def reaches(job, asked):
    graphs = (job.graph(nodes, options) for nodes, options in asked)
    return all(np.diff(graph.start).all() for graph in graphs)


WAYS = {
    "towards the robot": (2500, -600, 500),
    "away from the robot": (200, -600, 0),
    "down": (1200, -600, 2500),
    "up": (1200, -600, -900),
}


@pytest.mark.parametrize(("where", "xyz"), WAYS.items(), ids=WAYS)
def test_the_move_is_enough_and_a_shorter_one_is_not(tmp_path, where, xyz):
    job = placed(tmp_path, xyz)
    asked = contours(job)
    move = move_into_reach(job, asked)
    assert move.where == where
    said = re.search(r"by (.*) mm in", str(move))[1]
    assert [float(v) for v in said.split()] == pytest.approx(1e3 * move.by, abs=1e-9)
    assert reaches(shifted(job, move.by), asked)
    length = np.linalg.norm(move.by)
    assert f"{length * 1e3:.0f} mm {where}" in str(move)
    assert not reaches(shifted(job, move.by * (1 - STEP / length)), asked)


def test_the_advice_of_a_plan_and_the_warning_of_a_check_name_it(tmp_path):
    job = placed(tmp_path, WAYS["towards the robot"])
    words = str(move_into_reach(job, contours(job)))
    assert words in check_job(job).warnings
    missing = [cut for cut in run_job(job).cuts if cut.broken is not None]
    assert missing
    assert all(cut.failure.startswith(words) for cut in missing)


def test_where_no_move_helps_nothing_is_said(tmp_path):
    job = placed(tmp_path, (9000, 0, 500))
    assert move_into_reach(job, contours(job)) is None


def test_no_move_leads_into_the_base_of_the_robot(tmp_path):
    job = placed(tmp_path, (200, -900, 200))
    asked = contours(job)
    points = np.concatenate([nodes.points for nodes, _ in asked])
    # Base and link 1 of an IRB 4600 are thicker than that up to axis 2, 0.495 m above the floor.
    inside, tried = [], [by for _, by in _moves(job, asked)]
    for by in tried:
        at = points @ job.placement[:3, :3].T + job.placement[:3, 3] + by
        inside.append(((np.hypot(*at[:, :2].T) < 0.25) & (at[:, 2] > 0) & (at[:, 2] < 0.5)).any())
    assert len(tried) > 100
    assert not any(inside)
