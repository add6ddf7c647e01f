"""Studies: the job of their tasks is the same for every worker."""

import shutil

import pytest

from conftest import ROOT
from kerfpath.errors import InputError
from kerfpath.study import digest_of, load_job
from kerfpath.sweep import UnfitWorker

PARTS = ROOT / "examples" / "parts"


@pytest.fixture
def bracket(tmp_path):
    for file in PARTS.glob("bracket.*"):
        shutil.copy(file, tmp_path)
    return tmp_path / "bracket.toml"


def test_the_digest_is_that_of_the_contents_wherever_they_lie(bracket):
    assert digest_of(bracket) == digest_of(PARTS / "bracket.toml")
    before = digest_of(bracket)
    with (bracket.parent / "bracket.step").open("a") as file:
        file.write("\n")
    assert digest_of(bracket) != before


def test_a_worker_refuses_a_job_that_has_changed(bracket):
    then = digest_of(bracket)
    assert load_job(str(bracket), then).job.path == bracket
    assert load_job(str(bracket), then) is load_job(str(bracket), then)
    bracket.write_text(bracket.read_text() + "\n# a remark\n")
    load_job.cache_clear()
    with pytest.raises(UnfitWorker, match="since the study began, or differs on this worker"):
        load_job(str(bracket), then)


def test_a_job_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        digest_of(tmp_path / "no.toml")


def test_a_worker_without_the_job_is_unfit_and_does_not_fail_the_task(bracket):
    then = digest_of(bracket)
    (bracket.parent / "bracket.step").unlink()
    with pytest.raises(UnfitWorker, match=r"bracket\.step.*every worker needs the job and"):
        load_job(str(bracket), then)
