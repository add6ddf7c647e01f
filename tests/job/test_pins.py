"""A program is audited against the windows of gamma of its job."""

import pytest

from jobs import DEMO, SMALL
from kerfpath.job import audit_file, read_job, run_job, write_result

PINNED = "[[0, 10, 20, 20.5]]"


def job_in(folder, windows):
    (folder / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    path = folder / "job.toml"
    keys = f"[[contour]]\ngamma_windows = {windows}\n" if windows else "[[contour]]\n"
    path.write_text(SMALL.replace("[[contour]]\n", keys, 1))
    return path


def failed(found):
    rows = (row for table in found.tables.values() for row in table)
    return {row.code for row in rows if not row.ok and row.level == "error"}


@pytest.mark.slow
def test_a_program_that_leaves_its_windows_fails(tmp_path):
    path = job_in(tmp_path, PINNED)
    written = write_result(run_job(read_job(path)), tmp_path / "out")
    (program,) = (file for file in written.files if file.suffix == ".mod")
    found = audit_file(program, path)
    assert found.passed
    rows = [row for table in found.tables.values() for row in table if row.code == "gamma-window"]
    assert len(rows) == 1  # of the contour that is pinned
    # The same text by a job that pins gamma elsewhere, and by one that pins nothing.
    assert failed(audit_file(program, job_in(tmp_path, "[[0, 10, 40, 60]]"))) == {"gamma-window"}
    free = audit_file(program, job_in(tmp_path, None))
    assert free.passed
    assert "gamma-window" not in {row.code for t in free.tables.values() for row in t}


@pytest.mark.slow
@pytest.mark.parametrize("window", ["[[0, 10, 20, 20]]", "[[0, 31, 20, 20.5], [10, 20, 20, 21]]"])
def test_digits_of_a_text_leave_no_window(tmp_path, window):
    path = job_in(tmp_path, window)
    written = write_result(run_job(read_job(path)), tmp_path / "out")
    (program,) = (file for file in written.files if file.suffix == ".mod")
    assert audit_file(program, path).passed
