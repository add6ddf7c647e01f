"""Jobs that are kept: their plans and their texts, to be compared with the one that is shown."""

import json

import pytest

from studio.talk import QUICK, serving, talking, write_job


@pytest.fixture(scope="module")
def heard(tmp_path_factory):
    """What a page hears that keeps a job, changes it, and goes back to what it has kept."""
    path = write_job(tmp_path_factory.mktemp("kept"))
    with serving(path) as client, talking(client) as page:
        page.say("keep")
        early = page.until("error")
        page.done(1)
        page.say("keep")
        page.until("kept")
        page.say("rename", id=1, name=" slow ")
        page.until("kept")
        page.say("edit", path=["plan", "metric"], value="euclid")
        page.done(2)
        page.say("keep", name="other")
        both = page.until("kept")
        plans = {number: client.get(f"/kept/{number}").json() for number in (1, 2)}
        with talking(client) as second:
            later = second.until("kept")
        page.say("restore", id=1)
        job = page.until("job")
        page.done(job["revision"])
        page.say("undo")
        undone = page.until("job", revision=job["revision"] + 1)
        page.say("forget", id=1)
        left = page.until("kept")
        page.say("restore", id=1)
        gone = page.until("error")
        status = client.get("/kept/1").status_code
    return {
        "early": early, "both": both, "later": later, "plans": plans, "heard": page.heard,
        "job": job, "undone": undone, "left": left, "gone": gone, "status": status,
    }  # fmt: skip


def test_a_job_is_kept_once_it_is_planned_by_its_name_or_a_letter(heard):
    assert "not planned yet" in heard["early"]["message"]
    assert [(one["name"], one["metric"]) for one in heard["both"]["plans"]] == [
        ("slow", "manhattan"),
        ("other", "euclid"),
    ]
    assert heard["later"] == heard["both"]  # a page that comes later


def test_the_plans_that_are_kept_are_those_that_were_said(heard):
    for number, revision in ((1, 1), (2, 2)):
        said = {
            message["contour"]: message
            for message in heard["heard"]
            if message["type"] == "plan" and message["revision"] == revision
        }
        kept = {plan["contour"]: plan for plan in heard["plans"][number]}
        assert kept == said
        assert heard["both"]["plans"][number - 1]["contours"] == list(kept)
        assert heard["both"]["plans"][number - 1]["settled"]


def test_going_back_takes_the_text_in_one_step(heard):
    assert heard["job"]["text"] == QUICK
    assert 'metric = "euclid"' in heard["undone"]["text"]
    plans = [m for m in heard["heard"] if m["type"] == "plan"]
    again = [m for m in plans if m["revision"] == heard["job"]["revision"]]
    for kept in heard["plans"][1]:
        (same,) = [m for m in again if m["contour"] == kept["contour"] and m["passed"] is not None]
        assert same["q"] == kept["q"]


def test_what_is_forgotten_is_gone(heard):
    assert [one["id"] for one in heard["left"]["plans"]] == [2]
    assert "no such plan" in heard["gone"]["message"]
    assert heard["status"] == 404


def test_no_more_are_kept_than_can_be_told_apart(tmp_path):
    with serving(write_job(tmp_path)) as client, talking(client) as page:
        page.done(1)
        for _ in range(8):
            page.say("keep")
            page.until("kept")
        page.say("keep")
        assert "8 plans are kept already" in page.until("error")["message"]
        page.say("rename", id=1, name="  ")
        assert "expected a name" in page.until("error")["message"]
        assert json.loads(client.get("/kept/8").text)
