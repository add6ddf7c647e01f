"""Other places of the part: what is in reach there, the search for the best one, and taking it."""

import tomllib

import numpy as np
import pytest

from kerfpath.job import prepare, read_job
from kerfpath.study.placing import placement_of
from kerfpath.study.placing.place import move_job
from studio.talk import QUICK, serving, talking, write_job

ONE = QUICK.partition("[[contour]]")[0] + "[[contour]]" + QUICK.split("[[contour]]")[2]
JOB = ONE.replace("[plan]", '[plan]\nmethod = "exact"') + "\n[layout]\nseed = 3\n"
RANGES = {"x_mm": [-150, 150], "base_yaw_deg": [-10, 10]}
FAR = {"x_mm": 1500.0}
TURNED = {"x_mm": 40.0, "z_mm": -25.0, "yaw_deg": 20.0, "tilt_x_deg": 5.0}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write_job(tmp_path_factory.mktemp("layout"), JOB)


@pytest.fixture(scope="module")
def heard(path):
    """What a page hears that moves the part, and then looks for the best placement."""
    found = {}
    with serving(path) as client, talking(client) as page:
        page.say("layout", goal="speed", ranges=RANGES, evaluations=8, grid=False)
        found["early"] = page.until("error")
        page.done(1)
        for number, offsets in enumerate(({}, FAR, TURNED)):
            page.say("reach", offsets=offsets, number=number)
            found[number] = page.until("reach", number=number)
        page.say("place", scene=1, offsets=TURNED)
        found["moved"] = page.until("job", revision=2)
        found["scene"] = page.until("scene", revision=2)
        page.done(2)
        page.say("undo")
        found["back"] = page.until("job", revision=3)
        page.done(3)
        page.say("layout", goal="speed", ranges=RANGES, evaluations=8, grid=False)
        found["layout"] = page.until("layout", state="done")
        with talking(client) as second:
            found["later"] = second.until("layout")
        number = found["layout"]["best"][0]["number"]
        page.say("take", number=number)
        found["taken"] = page.until("job", revision=4)
        found["there"] = page.until("scene", revision=4)
        page.say("take", number=number)
        found["gone"] = page.until("error")
        page.done(4)
        page.say("fastest", contour=found["there"]["contours"][0]["name"])
        found["fastest"] = page.until("fastest")
        page.say("place", scene=1, offsets=FAR)
        found["other"] = page.until("error")
        page.say("place", scene=4, offsets=FAR)
        page.done(5)
        page.say("fastest", contour=found["there"]["contours"][0]["name"])
        found["no speed"] = page.until("error")
        page.say("undo")
        page.done(6)
        page.say("layout", goal="speed", ranges=RANGES, evaluations=5000, grid=True)
        page.until("layout", state="running", fits=lambda m: m["tried"] > 1)
        page.say("edit", path=["plan", "eta_velocity"], value=0.9)
        found["stopped"] = page.until("layout", fits=lambda m: m["state"] != "running")
    return found | {"heard": page.heard}


def pose_of(numbers):
    return np.reshape(numbers, (4, 4))


@pytest.mark.slow
def test_what_is_out_of_reach_is_what_has_no_pose(heard, path):
    job = read_job(path)
    prepared = prepare(job, job.read_part())
    nodes = prepared.contours[0].candidates[0].nodes
    for number, offsets in enumerate(({}, FAR, TURNED)):
        moved = move_job(job, placement_of(prepared).numbers(offsets))
        lost = np.diff(moved.graph(nodes).start) == 0
        (contour,) = heard[number]["contours"]
        assert contour["nodes"] == len(nodes)
        assert contour["out"] == np.flatnonzero(lost).tolist()
    assert heard[0]["contours"][0]["out"] == []
    assert len(heard[1]["contours"][0]["out"]) == len(nodes)


def test_a_move_is_one_step_through_the_middle_that_a_page_hears_of(heard, path):
    before, after = tomllib.loads(path.read_text()), tomllib.loads(heard["moved"]["text"])
    assert after["part"].pop("xyz_mm") != before["part"].pop("xyz_mm")
    assert after["part"].pop("rpy_deg") != before["part"].pop("rpy_deg")
    assert after == before
    assert heard["back"]["text"] == path.read_text()
    middle = np.append(heard[0]["middle"], 1.0)
    job = read_job(path)
    motion = pose_of(heard["scene"]["T_part"]) @ np.linalg.inv(job.placement)
    assert (motion @ middle - middle)[:3] == pytest.approx([0.04, 0, -0.025], abs=1e-6)


def test_the_search_shows_what_it_finds_and_the_best_can_be_taken(heard, path):
    layout = heard["layout"]
    best = layout["best"][0]
    own = next(each for each in layout["best"] if not any(each["offsets"].values()))
    assert best["stage"] == own["stage"] == "exact"
    assert best["value"] >= own["value"] > 0
    assert layout["tried"] >= 5
    assert layout["unit"] == "m/min"
    assert heard["later"] == layout
    values = [each["value"] for each in layout["best"] if each["value"] is not None]
    assert values == sorted(values, reverse=True)
    states = [m["state"] for m in heard["heard"] if m["type"] == "layout"]
    assert states[0] == "running"
    motion = pose_of(heard["there"]["T_part"]) @ np.linalg.inv(read_job(path).placement)
    assert pose_of(best["part"]) == pytest.approx(motion, abs=1e-6)
    # Taken, it can be cut as fast as the search says.
    assert heard["fastest"]["on_grid_m_min"] == pytest.approx(best["value"], rel=1e-3)


def test_a_change_of_the_job_stops_the_search(heard):
    assert heard["stopped"]["state"] == "stopped"
    assert heard["stopped"]["done"] < 5000


def test_what_cannot_be_done_is_an_answer(heard):
    assert "not planned yet" in heard["early"]["message"]
    assert "search again" in heard["gone"]["message"]
    assert "repeat the move" in heard["other"]["message"]
    assert heard["no speed"]["about"] == "fastest"
