"""Distances in the cell along the plans: those of the cell itself, said once all is planned."""

import numpy as np
import pytest

from kerfpath.job import prepare, read_job
from studio.talk import QUICK, serving, talking, write_job

CELL = """
[cell]
near_miss_mm = 5
[[cell.fixture]]
name = "post"
size_mm = [60, 60, 900]
xyz_mm = [900, 300, 450]
"""


@pytest.fixture(scope="module")
def heard(tmp_path_factory):
    path = write_job(tmp_path_factory.mktemp("cell"), QUICK + CELL)
    with serving(path) as client, talking(client) as page:
        page.done(1)
        yield path, page.heard[:]


@pytest.mark.slow
def test_the_nearest_pair_is_that_of_the_cell(heard):
    path, messages = heard
    cell = prepare(read_job(path)).cell
    told = [m for m in messages if m["type"] == "clearance"]
    assert {m["contour"] for m in told} == {m["contour"] for m in messages if m["type"] == "plan"}
    for message in told:
        plan = [m for m in messages if m["type"] == "plan" and m["name"] == message["name"]][-1]
        q = np.array(plan["q"]).reshape(len(plan["time"]), -1)
        every = np.where(cell.own, np.inf, cell.distances(q))
        # Joints and distances are said to a nanometre, at arms of metres.
        assert message["distance"] == pytest.approx(every.min(axis=1), abs=1e-7)
        over = np.array(message["distance"]) - np.array(message["over"])
        assert over == pytest.approx(np.full(len(q), 0.005), abs=1e-8)
        for k in (0, len(q) // 2):
            names = tuple(message["pairs"][message["pair"][k]])
            at = cell.pair_names.index(names)
            assert every[k, at] == pytest.approx(every[k].min(), abs=1e-7)


def test_bodies_of_pairs_are_bodies_of_the_scene(heard):
    _, messages = heard
    names = {body["name"] for m in messages if m["type"] == "scene" for body in m["bodies"]}
    for message in messages:
        if message["type"] == "clearance":
            assert {name for pair in message["pairs"] for name in pair} <= names


def test_without_a_cell_nothing_is_measured(tmp_path):
    with serving(write_job(tmp_path)) as client, talking(client) as page:
        page.done(1)
        assert not any(m["type"] == "clearance" for m in page.heard)
