"""The text of the program and the motion: a line says when it runs, a finding where it stands."""

from itertools import pairwise

import pytest

from studio.talk import serving, talking, write_job


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    with serving(write_job(tmp_path_factory.mktemp("lines"))) as client, talking(client) as page:
        page.done(1)
        yield page


def asked(page, **more):
    page.say("program", **more)
    return page.until("program_text")


@pytest.mark.parametrize("language", ["rapid", "krl", "inform", "csv"])
def test_lines_run_one_after_the_other_through_the_whole_program(planned, language):
    said = asked(planned, language=language)
    clock = next(m for m in reversed(planned.heard) if m["type"] == "program")
    assert said["revision"] == 1
    runs = []
    for file in said["files"]:
        text = file["text"].splitlines()
        assert all(text[number - 1].strip() for number in file["lines"])
        runs += zip(file["begin"], file["end"], strict=True)
    runs.sort()
    # Times are rounded to a microsecond.
    assert runs[-1][1] == pytest.approx(clock["total"], abs=2e-6)
    for (_, end), (begin, _) in pairwise(runs):
        assert begin >= end - 2e-6
    cuts = [s for s in clock["segments"] if s["kind"] == "cut"]
    # A cut begins and ends where lines do.
    ends = [end for _, end in runs]
    for cut in cuts:
        assert min(abs(end - cut["begin"]) for end in ends) < 2e-6
        assert min(abs(end - cut["end"]) for end in ends) < 2e-6


def test_findings_of_the_preflight_are_said_once(planned):
    said = asked(planned)
    assert {finding["level"] for finding in said["findings"]} == {"warning"}
    messages = [finding["message"] for finding in said["findings"]]
    assert len(messages) == len(set(messages)) > 0
    assert not any(message in note for message in messages for note in said["notes"])


def test_a_program_that_is_refused_says_what_speaks_against_it(planned):
    said = asked(planned, language="fanuc")
    assert said["files"] == []
    assert any(finding["level"] == "error" for finding in said["findings"])
    assert said["faults"]


def test_the_script_of_the_job_is_exported_under_its_name(tmp_path):
    with serving(write_job(tmp_path)) as client, talking(client) as page:
        assert client.get("/export/script").status_code == 409
        page.done(1)
        said = [m for m in page.heard if m["type"] == "outcome"][-1]
        assert {e["name"]: e["ready"] for e in said["exports"]}["script"]
        answer = client.get("/export/script")
        assert answer.status_code == 200
        assert "job.py" in answer.headers["content-disposition"]
        compile(answer.text, "job.py", "exec")
        assert "The job job.toml" in answer.text
