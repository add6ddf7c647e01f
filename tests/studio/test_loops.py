"""The part in the studio: its loops are told, become contours of the job, and leave it again."""

import tomllib

import numpy as np
import pytest

from kerfpath.job import read_job
from kerfpath.studio.entries import part_message
from studio.talk import QUICK, serving, talking, write_job


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return read_job(write_job(tmp_path_factory.mktemp("part")))


@pytest.fixture(scope="module")
def part(job):
    return job.read_part()


def test_loops_are_where_the_part_stands_and_as_long_as_drawn(job, part):
    message = part_message(job, part, 1)
    assert {loop.name for loop in message.loops} == {loop.name for loop in part.pick()} | {
        loop.name for loop in part.loops if loop.side == "inner" and not loop.skin
    }
    for told in message.loops:
        loop, points = part.loop(told.name), np.array(told.points).reshape(-1, 3)
        away = (points - job.placement[:3, 3]) @ job.placement[:3, :3]
        # Points are rounded to a micrometre.
        assert (away >= loop.bounding_box[0] - 1e-6).all()
        assert (away <= loop.bounding_box[1] + 1e-6).all()
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        # Chords that are off by a small share of the length are hardly shorter than the loop.
        assert 0.97 * loop.length <= chords <= loop.length * (1 + 1e-4)
    assert message.left_out == len(part.loops) - len(message.loops)


def test_every_triangle_is_of_the_face_that_it_lies_on(job, part):
    message = part_message(job, part, 1)
    vertices, triangles = part.mesh()
    assert sum(face.triangles for face in message.faces) == len(triangles)
    begin = 0
    for face in message.faces:
        corners = vertices[triangles[begin : begin + face.triangles]].reshape(-1, 3)
        begin += face.triangles
        around = [loop.bounding_box for loop in part.loops if loop.face == face.name]
        assert around, face.name
        low = np.min([box[0] for box in around], axis=0)
        high = np.max([box[1] for box in around], axis=0)
        # A curved face bulges beyond its loops by less than the thickness of the part.
        assert (corners >= low - 0.06).all()
        assert (corners <= high + 0.06).all()


@pytest.mark.slow
def test_a_loop_becomes_a_contour_that_is_planned_in_one_step(tmp_path):
    path = write_job(tmp_path)
    with serving(path) as client, talking(client) as page:
        page.done(1)
        told = next(m for m in page.heard if m["type"] == "part")
        assert "skin/hole3" in [loop["name"] for loop in told["loops"]]
        page.say("cut", loops=["skin/hole3", "skin/hole4"])
        page.done(2)
        made = [m for m in page.heard if m["type"] == "plan" and m["contour"] == "skin/hole3"]
        assert made[-1]["passed"]
        scene = [m for m in page.heard if m["type"] == "scene"][-1]
        assert {c["name"]: c["loop"] for c in scene["contours"]}["skin/hole4"] == "skin/hole4"
        page.say("cut", loops=["skin/hole3"])
        assert "already" in page.until("error")["message"]
        index = next(c["index"] for c in scene["contours"] if c["name"] == "skin/hole4")
        page.say("leave", index=index)
        page.done(3)
        page.say("undo")
        page.until("job", revision=4)
        page.say("undo")
        text = page.until("job", revision=5)["text"]
        assert text == QUICK


def test_these_loops_alone_are_cut_in_one_step(tmp_path):
    with serving(write_job(tmp_path)) as client, talking(client) as page:
        page.until("part")
        page.say("cut", loops=["skin/hole3", "skin/hole11"], alone=True)
        text = page.until("job", revision=2)["text"]
        picks = {table["pick"] for table in tomllib.loads(text)["contour"]}
        assert picks == {"skin/hole3", "skin/hole11"}
        page.say("undo")
        assert page.until("job", revision=3)["text"] == QUICK


def test_of_a_job_with_a_fault_loops_can_still_be_seen_and_nothing_is_added(tmp_path):
    text = QUICK.replace('pick = "skin/hole11"', 'pick = "skin/hole999"')
    assert text != QUICK
    with serving(write_job(tmp_path, text)) as client, talking(client) as page:
        assert len(page.until("part")["loops"]) > 20
        page.say("cut", loops=["skin/hole3"])
        assert "skin/hole999" in page.until("error")["message"]
        page.say("leave", index=1)
        left = page.until("job", revision=2)["text"]
        assert [table["pick"] for table in tomllib.loads(left)["contour"]] == ["skin/hole16"]
        page.done(2)
