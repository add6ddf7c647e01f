"""The Pareto set of a contour: as kerfpath pareto finds it, and each of its plans the job's."""

import numpy as np
import pytest

from kerfpath.job import read_job
from kerfpath.study import pareto_of_job
from studio.talk import QUICK, serving, talking, write_job

CRITERIA = ["displacement", "velocity"]
ONE = QUICK.partition("[[contour]]")[0] + "[[contour]]" + QUICK.split("[[contour]]")[2]
RUNS = 12


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("front")


@pytest.fixture(scope="module")
def heard(folder):
    """What a page hears that looks for a set, sees one of its points, and takes it."""
    path = write_job(folder, ONE.replace("[plan]", '[plan]\nmethod = "exact"'))
    name = read_job(path).contours[0].name
    with serving(path) as client, talking(client) as page:
        page.say("front", contour=name, criteria=CRITERIA, runs=RUNS)
        early = page.until("error")
        page.done(1)
        page.say("front", contour=name, criteria=["displacement", "nonsense"], runs=RUNS)
        wrong = page.until("error")
        page.say("front", contour=name, criteria=CRITERIA, runs=RUNS)
        front = page.until("front", state="done")
        with talking(client) as second:
            later = second.until("front")
        point = next(p for p in front["points"] if p["best"] and p["edits"] is not None)
        page.say("point", contour=name, number=point["number"])
        candidate = page.until("candidate")
        page.say("edits", edits=point["edits"])
        revision = page.until("job")["revision"]
        page.done(revision)
        page.say("point", contour=name, number=999)
        gone = page.until("error")
        page.say("front", contour=name, criteria=CRITERIA, runs=1000)
        page.until("front", state="running")
        page.say("cancel")
        stopped = page.until("front", state="stopped")
    plans = [m for m in page.heard if m["type"] == "plan" and m["revision"] == revision]
    return {
        "path": path, "early": early, "wrong": wrong, "front": front, "later": later,
        "point": point, "candidate": candidate, "taken": plans[-1], "gone": gone,
        "stopped": stopped, "heard": page.heard,
    }  # fmt: skip


@pytest.mark.slow
def test_it_is_the_set_that_kerfpath_pareto_finds(heard, folder):
    write_job(folder, heard["path"].read_text(), "again.toml")
    found = pareto_of_job(
        folder / "again.toml", store=folder / "store", criteria=CRITERIA, runs=RUNS, processes=1
    ).front
    best = {p["number"]: p["values"] for p in heard["front"]["points"] if p["best"]}
    assert sorted(best) == sorted(found.numbers)
    for number, values in zip(found.numbers, found.values, strict=True):
        assert best[number] == values.tolist()
    assert [axis["unit"] for axis in heard["front"]["axes"]] == list(found.units)
    assert heard["later"] == heard["front"]


def test_a_point_that_is_taken_is_the_plan_of_the_job(heard):
    candidate, taken = heard["candidate"]["plan"], heard["taken"]
    assert heard["candidate"]["number"] == heard["point"]["number"]
    assert candidate["passed"] is None
    # Both postures of the wrist cost the same here, and rounding decides between them.
    moved = [np.abs(np.diff(np.reshape(m["q"], (-1, 6)), axis=0)) for m in (taken, candidate)]
    assert moved[0] == pytest.approx(moved[1], abs=1e-6)  # weights are written to 12 digits
    assert taken["cost"] == pytest.approx(candidate["cost"], rel=1e-11)  # weights to 12 digits
    speeds = np.abs(np.array(candidate["velocity_share"])).max()
    (axis,) = [i for i, a in enumerate(heard["front"]["axes"]) if a["name"] == "velocity"]
    assert heard["point"]["values"][axis] == pytest.approx(speeds, abs=1e-6)  # shares to 1e-6


def test_points_come_as_they_are_found_and_it_can_be_stopped(heard):
    fronts = [m for m in heard["heard"] if m["type"] == "front"]
    assert fronts[0]["done"] == 0
    assert heard["stopped"]["done"] < heard["stopped"]["total"] == 1000


def test_what_cannot_be_looked_for_is_an_answer(heard):
    assert "not planned yet" in heard["early"]["message"]
    assert "nonsense" in heard["wrong"]["message"]
    assert "no such point" in heard["gone"]["message"]
