"""A placement moved by hand: what is in reach there; and a search that is watched, and left."""

import tomllib

import numpy as np
import pytest

from kerfpath.job import prepare, read_job
from kerfpath.study.placing import changes_of, layout_as, placed_text, placement_of
from kerfpath.study.placing.place import move_job
from layouts import CELL, HEAD, contours, job_file, rings

MOVES = [
    {},
    {"x_mm": 1000.0},
    {"base_x_mm": -980.0, "base_yaw_deg": 5.0},
    {"tilt_x_deg": 75.0, "yaw_deg": 40.0},
    {"mount_deg": 120.0, "z_mm": 1100.0},
]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    path = job_file(tmp_path_factory.mktemp("p"), HEAD + contours(speed=2, step=5))
    job = read_job(path)
    return prepare(job, job.read_part())


def test_out_of_reach_is_what_has_no_pose_at_any_sample_of_gamma(prepared):
    placement, counts = placement_of(prepared), []
    for offsets in MOVES:
        moved = move_job(prepared.job, placement.numbers(offsets))
        out = placement.out_of_reach(offsets)
        for request, lost in zip(prepared.contours, out, strict=True):
            graph = moved.graph(request.candidates[0].nodes, moved.options.without_penalties)
            assert lost.tolist() == np.flatnonzero(np.diff(graph.start) == 0).tolist()
        counts.append(sum(map(len, out)))
    nodes = sum(len(request.candidates[0].nodes) for request in prepared.contours)
    assert counts[0] == 0
    assert any(0 < count < nodes for count in counts)


def test_motions_are_those_of_the_numbers(prepared):
    placement = placement_of(prepared)
    for offsets in MOVES:
        part, rest = placement.motions(offsets)
        moved = move_job(prepared.job, placement.numbers(offsets))
        # Numbers have 0.1 um and 1e-6 deg, at less than 3 m.
        assert moved.placement == pytest.approx(part @ prepared.job.placement, abs=2e-7)
        if "base_x_mm" not in offsets:
            assert rest == pytest.approx(np.eye(4))


def test_what_a_move_changes_takes_out_what_would_say_otherwise(tmp_path):
    text = HEAD.replace("[part]", '[part]\nplaced_by = "centre"')
    job = read_job(job_file(tmp_path, text + contours(speed=2, step=10) + CELL))
    placement = placement_of(prepare(job, job.read_part()))
    offsets = {"x_mm": 30.0, "mount_deg": 10.0}
    numbers = placement.numbers(offsets)
    gone = [key for key, value in changes_of(job, numbers) if value is None]
    assert gone == [("part", "placed_by"), ("tool", "head")]
    again = read_job(job_file(tmp_path, placed_text(job, numbers, tmp_path, "moved"), "b.toml"))
    moved = move_job(job, numbers)
    assert again.placement == pytest.approx(moved.placement, abs=1e-12)
    assert again.tool == pytest.approx(moved.tool, abs=1e-12)
    assert tomllib.loads(again.text)["cell"]["fixture"][0]["xyz_mm"][0] == 1240


@pytest.mark.slow
def test_a_search_tells_of_each_placement_as_it_is_found(tmp_path):
    path = rings(tmp_path, 1200)
    table = read_job(path).layout.model_copy(update={"evaluations": 8, "map_points": 0})
    seen = {}

    def found(trial):
        seen.setdefault(trial, []).append((trial.result.stage, trial.result.value))

    result = layout_as(
        path, table, store=tmp_path / "s.sqlite", ranges={"x_mm": (-100.0, 100.0)}, processes=1,
        found=found,
    )  # fmt: skip
    assert list(seen) == list(result.tried)
    assert result.best is not None
    assert seen[result.best][-1] == (result.best.result.stage, result.best.result.value)
    assert any(len(steps) > 1 for steps in seen.values())
