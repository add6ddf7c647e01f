"""Jobs whose best motions end at limits: what passes is written, and what cannot back off fails."""

from dataclasses import replace

import numpy as np
import pytest

from commands import run
from jobs import SLIT_JOB, SLITS
from kerfpath.job import prepare, read_job, run_prepared
from kerfpath.job.output.writing import result_texts

FREE = SLIT_JOB.replace("[plan]", "[plan]\ncertify = false").replace(
    "step_deg = 15", "step_deg = 5"
)


@pytest.fixture(scope="module")
def reach(tmp_path_factory):
    """Give the least and the largest joints, deg, of the best motions within wide ranges."""
    folder = tmp_path_factory.mktemp("free")
    write(folder, FREE)
    joints = np.degrees(
        [cut.plan.q for cut in run_prepared(prepare(read_job(folder / "slits.toml"))).cuts]
    )
    return joints.min(axis=(0, 1)), joints.max(axis=(0, 1))


def write(folder, text):
    (folder / "slits.csv").write_text(SLITS)
    (folder / "slits.toml").write_text(text)
    return folder / "slits.toml"


def narrow(folder, reach, seed, more=""):
    """A job of two slits by an arm whose ranges end about where its best motions do."""
    draw = np.random.default_rng(seed)
    room = draw.uniform(0, [90, 40, 40, 40, 6, 60], (2, 6))
    lower, upper = reach[0] - room[0], reach[1] + room[1]
    ranges = f"lower_deg = {lower.round(3).tolist()}\nupper_deg = {upper.round(3).tolist()}\n"
    return write(folder, FREE.replace("[tool]", f"endless = []\n{ranges}[tool]", 1) + more)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("language", ["rapid", "krl"])
def test_what_passes_is_written(tmp_path, reach, seed, language):
    laser = "[program.krl]\nlaser_output = 1\n" if language == "krl" else ""
    more = f'[program]\nlanguage = "{language}"\n{laser}'
    result = run_prepared(prepare(read_job(narrow(tmp_path, reach, seed, more))))
    texts = result_texts(result)
    assert bool(texts.program) == result.passed
    assert not texts.refused


@pytest.mark.slow
def test_what_can_be_written_without_regard_to_retract_and_limits_still_is(tmp_path, reach):
    refused = 0
    for seed in range(8):
        job = read_job(narrow(tmp_path, reach, seed))
        blind = replace(job, options=replace(job.options, retract=None, comfort=None))
        texts = result_texts(run_prepared(prepare(blind)))
        refused += bool(texts.refused)
        if texts.program:
            assert result_texts(run_prepared(prepare(job))).program
    assert refused  # else ranges would be too wide to try anything


def test_what_cannot_back_off_is_no_plan_in_exit_code_message_and_report(tmp_path, reach):
    # Found before planning where no pose at all has room: here some have, but no motion begins so.
    path = narrow(tmp_path, reach, 3, "[program]\nretract_mm = 2500\n")
    shown = run("plan", path, cwd=tmp_path)
    assert shown.returncode == 2
    assert "retract_mm" in shown.stderr
    result = run_prepared(prepare(read_job(path)))
    assert not result.passed
    for cut in result.cuts:
        row = next(row for row in cut.checks if row.code == "retract")
        assert not row.ok
        assert "lower retract_mm in [program]" in str(row.issue())
    texts = result_texts(result)
    assert not texts.program
    assert "Planned, but the audit failed for 2 of 2 contours" in texts.files["report.html"]
