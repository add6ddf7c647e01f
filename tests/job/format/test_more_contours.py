"""Contours put into the text of a job and taken out: nothing else of the text changes."""

import shutil
import tomllib

import pytest

from jobs import DEMO, SLIT_JOB, WHOLE, write_slit_jobs
from kerfpath.errors import InputError
from kerfpath.job import only_loops, read_job, with_loops, without_contour

SLITS_JOB = SLIT_JOB.replace('[[contour]]\npick = "b"\nspeed_m_min = 2\ncount = 11\n', "")
"""One of the two slits is cut."""


def job_of(folder, text):
    if not (folder / "b_pillar.step").exists():
        shutil.copy(DEMO / "b_pillar.step", folder)
    path = folder / "job.toml"
    path.write_bytes(text.encode())
    return read_job(path)


@pytest.fixture(scope="module")
def demo():
    job = read_job(DEMO / "b_pillar.toml")
    return job, job.read_part()


def tables(text):
    return tomllib.loads(text)["contour"]


def test_a_hole_is_cut_as_the_hole_most_like_it_before_the_trim_line(demo):
    job, part = demo
    text = with_loops(job, part, ["skin/hole2"])
    added = tables(text)[6]
    # It has the diameter of hole1, which is cut at 3 m/min with nodes 1.25 mm apart.
    assert added == {"pick": "skin/hole2", "speed_m_min": 3, "spacing_mm": 1.25}
    assert tables(text)[:6] + tables(text)[7:] == job.source["contour"]
    assert tables(text)[-1]["name"] == "trim"


def test_what_is_cut_at_last_and_every_comment_stay(demo):
    job, part = demo
    text = with_loops(job, part, ["skin/hole2", "skin/hole20"])
    before, after = job.text.splitlines(), text.splitlines()
    # Every line of the job is there, in its order.
    rest = iter(after)
    assert all(line in rest for line in before)
    assert len(after) == len(before) + 2 * 5  # header, three keys and an empty line


def test_one_in_and_out_again_is_the_text_as_it_was(demo, tmp_path):
    job, part = demo
    text = with_loops(job, part, ["skin/hole2"])
    assert without_contour(job_of(tmp_path, text), 6) == job.text


@pytest.mark.parametrize("index", range(7))
def test_a_contour_taken_out_leaves_all_other_lines(demo, index):
    job, _ = demo
    text = without_contour(job, index)
    assert tables(text) == job.source["contour"][:index] + job.source["contour"][index + 1 :]
    comments = [line for line in job.text.splitlines() if line.startswith("#")]
    assert [line for line in text.splitlines() if line.startswith("#")] == comments


def test_a_separator_in_a_remark_is_refused(tmp_path):
    """An editor that takes it for the end of a line shows a table that is none."""
    with pytest.raises(InputError, match=r"job.toml:1: expected text, got U\+2028 LINE SEPARATOR"):
        job_of(tmp_path, "# note\u2028[[contour]]\n" + WHOLE)


def test_leads_and_corners_of_the_model_come_along_and_its_name_does_not(tmp_path):
    job = job_of(tmp_path, WHOLE)
    part = job.read_part()
    added = tables(with_loops(job, part, ["skin/hole2"]))[-1]
    model = job.source["contour"][0]
    assert added["lead_in"] == model["lead_in"]
    assert added["kerf_mm"] == model["kerf_mm"]
    assert "name" not in added
    out = job_of(tmp_path, with_loops(job, part, ["skin/hole2"]))
    assert out.tasks(part)[-1].name == "skin/hole2"
    assert without_contour(out, 3) == WHOLE


def test_nodes_are_neither_few_nor_many(demo):
    job, part = demo
    small = min((each for each in part.pick(kind="inner", side="outer")), key=lambda e: e.length)
    large = max(part.pick(kind="outer"), key=lambda each: each.length)
    for loop in (small, large):
        if loop.name == "skin/outer":
            continue
        (added,) = [t for t in tables(with_loops(job, part, [loop.name])) if t["pick"] == loop.name]
        # Written with two digits, so that the number is within 5 % of what it should be.
        assert 24 * 0.95 <= loop.length * 1e3 / added["spacing_mm"] <= 400 * 1.05


def test_an_open_line_has_no_keys_of_closed_ones(tmp_path):
    write_slit_jobs(tmp_path, {"slits": SLITS_JOB})
    job = read_job(tmp_path / "slits.toml")
    text = with_loops(job, job.read_part(), ["b"])
    assert tables(text)[1] == {"pick": "b", "speed_m_min": 2, "count": 11}


def test_lines_end_as_they_did(demo, tmp_path):
    job, part = demo
    windows = job_of(tmp_path, job.text.replace("\n", "\r\n"))
    text = with_loops(windows, part, ["skin/hole2"])
    assert text.count("\n") == text.count("\r\n")
    assert text.replace("\r\n", "\n") == with_loops(job, part, ["skin/hole2"])


@pytest.mark.parametrize("name", ["skin/hole1", "nowhere", "skin/hole1 "])
def test_what_cannot_be_added_is_refused_in_one_line(demo, name):
    job, part = demo
    with pytest.raises(InputError) as refused:
        with_loops(job, part, [name])
    assert "\n" not in str(refused.value)


def test_the_only_contour_stays(tmp_path):
    write_slit_jobs(tmp_path, {"slits": SLITS_JOB})
    job = read_job(tmp_path / "slits.toml")
    with pytest.raises(InputError, match="only contour"):
        without_contour(job, 0)
    with pytest.raises(InputError, match="expected a contour"):
        without_contour(job, 1)


def test_contours_in_one_line_are_left_to_their_writer(tmp_path):
    head, _, _ = SLITS_JOB.partition("[[contour]]")
    text = 'contour = [{ pick = "a", speed_m_min = 2, count = 11 }]\n' + head
    write_slit_jobs(tmp_path, {"slits": text})
    job = read_job(tmp_path / "slits.toml")
    with pytest.raises(InputError, match=r"\[\[contour\]\]"):
        with_loops(job, job.read_part(), ["b"])


def test_only_some_loops_are_cut_where_others_were(demo):
    job, part = demo
    text = only_loops(job, part, ["skin/hole2", "skin/outer", "skin/hole1"])
    assert [(t["pick"], t["speed_m_min"]) for t in tables(text)] == [
        ("skin/hole1", 3),
        ("skin/hole2", 3),
        ("skin/outer", 9),
    ]
    before = {**tomllib.loads(job.text), "contour": None}
    assert {**tomllib.loads(text), "contour": None} == before
    assert only_loops(job, part, [t["pick"] for t in tables(job.text)]) == job.text


def test_a_loop_of_a_table_of_many_gets_a_table_of_its_own(demo, tmp_path):
    job, part = demo
    head, _, rest = job.text.partition("[[contour]]")
    holes = '[[contour]]\nspeed_m_min = 3\nspacing_mm = 1\n[contour.pick_all]\nkind = "inner"\n\n'
    many = job_of(tmp_path, head + holes + rest[rest.index("[plan]") :])
    text = only_loops(many, part, ["skin/hole16"])
    (table,) = tables(text)
    assert table["pick"] == "skin/hole16"
    assert table["speed_m_min"] == 3
    with pytest.raises(InputError, match="expected loops to cut"):
        only_loops(many, part, [])
