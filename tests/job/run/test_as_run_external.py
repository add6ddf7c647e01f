"""Jobs with a rail and a table: what is kept between the nodes, and at which speed."""

import re

import numpy as np
import pytest
from benchmarks import program_edits

from conftest import ROOT
from jobs import WITHOUT_LAG
from kerfpath.job import audit_file, fastest_speeds, read_job, run_job, write_result


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """A job of a hole and a slit, as programs are written for in other tests."""
    folder = tmp_path_factory.mktemp("job")
    list(program_edits.subjects(folder, only=("rapid",), external=True))
    said = (folder / "rapid.toml").read_text().replace("[tool]", WITHOUT_LAG)
    return said.replace('"points.csv"', f'"{folder / "points.csv"}"').replace(
        "[plan]\n", '[plan]\ncertify = false\nbetween_nodes = "guaranteed"\n'
    )


def job_of(folder, text):
    (folder / "job.toml").write_text(text)
    return read_job(folder / "job.toml")


def rows_of(cut):
    return {row.code: row for row in cut.as_run.checks}


@pytest.mark.slow
def test_a_chuck_that_turns_while_it_is_cut_is_guaranteed_and_so_is_the_text(tmp_path):
    example = (ROOT / "examples" / "parts" / "turned_tube.toml").read_text()
    head, _, end = example.split("[[contour]]\n")
    said = f"{head}[[contour]]\n{end}".replace(
        '"tube.step"', f'"{ROOT / "examples" / "parts" / "tube.step"}"'
    ).replace("[plan]\n", '[plan]\ncertify = false\nbetween_nodes = "reported"\n')
    said = said.replace("[sequence]\nhome_deg = [0, -20, 10, 0, 60, 0]\n", "")
    said = said.replace("spacing_mm = 1\n", "spacing_mm = 2\n")
    (before,) = run_job(job_of(tmp_path, said)).cuts
    assert {code for code, row in rows_of(before).items() if not row.ok} >= {"acceleration-as-run"}
    assert rows_of(before)["acceleration-as-run"].level == "warning"
    assert "chuck exceeds its limit" in rows_of(before)["acceleration-as-run"].advice
    result = run_job(job_of(tmp_path, said.replace("reported", "guaranteed")))
    assert result.passed
    (cut,) = result.cuts
    assert np.ptp(cut.plan.external) > 5  # rad: almost once around
    assert cut.plan.settings.between_nodes == "guaranteed"
    for what in ("velocity", "acceleration"):
        row = rows_of(cut)[f"{what}-as-run"]
        assert row.ok
        assert row.level == "error"
        assert row.title == f"joint {what} share as run, at every instant"
    assert cut.as_run.timing.seconds < before.as_run.timing.seconds
    write_result(result, tmp_path / "out")
    (program,) = (tmp_path / "out").glob("*.mod")
    audited = audit_file(program, tmp_path / "job.toml")
    assert audited.passed
    read = {row.code: row for table in audited.tables.values() for row in table}
    for what in ("velocity", "acceleration"):
        # Digits of the text move it a little.
        own = rows_of(cut)[f"{what}-as-run"]
        assert read[own.code].value == pytest.approx(own.value, abs=0.03)
        assert read[own.code].title == own.title


@pytest.mark.slow
@pytest.mark.parametrize(
    ("said", "why"),
    [
        ('orientation = "wrist"\n', "nothing is proved if the controller moves the wrist by its"),
        ('language = "csv"\n', "csv has no zones"),
    ],
)
def test_where_nothing_is_proved_the_guarantee_fails(tmp_path, text, said, why):
    if "language" in said:
        text = text.replace('language = "rapid"\n', said)
    else:
        text = text.replace("[program.rapid]\n", f"[program.rapid]\n{said}")
    result = run_job(job_of(tmp_path, text))
    assert not result.passed
    for cut in result.cuts:
        (row,) = [row for row in cut.as_run.checks if not row.ok]
        assert (row.code, row.level) == ("between-nodes", "error")
        assert why in row.issue().message
        if "wrist" in said:
            assert rows_of(cut)["velocity-as-run"].title.endswith("as run, sampled")


@pytest.mark.slow
def test_the_speed_as_run_is_found_with_axes_too(tmp_path, text):
    slit = text[: text.index("[[contour]]")] + text[text.rindex("[[contour]]") :]
    slit = slit.replace("[program.rapid]\n", "[program.rapid]\nshortest_move_ms = 0\n")
    (found,) = fastest_speeds(job_of(tmp_path, slit))
    assert 0.5 * found.at_nodes.speed < found.as_run <= found.at_nodes.speed
    kept = re.sub("speed_m_min = .*", f"speed_m_min = {found.as_run * 60!r}", slit)
    assert run_job(job_of(tmp_path, kept)).passed
