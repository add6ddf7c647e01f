"""The code and the jobs that the pages show: all of them run, or are parts of a job."""

import re
import shutil
import subprocess
import sys
import tomllib

import pytest

from conftest import ROOT
from kerfpath.job import foresee, prepare, read_job
from kerfpath.job.format.tables import TABLES, ChartFile
from kerfpath.post import languages

PAGES = sorted(
    page
    for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    if "```" in page.read_text(encoding="utf-8")
)
HERE = ROOT / "tests"
OF_OTHERS = {"project"}
"""Tables of TOML files that are no job."""
SMALL_JOB = """
[robot]
model = "abb_irb4600_60_205"
acceleration_deg_s2 = [320, 270, 420, 1300, 1400, 2000]
[tool]
head = "laser-head-45"
[part]
file = "b_pillar.step"
xyz_mm = [1450, -600, 450]
rpy_deg = [0, 0, 90]
[[contour]]
pick = "skin/hole10"
speed_m_min = 3
spacing_mm = 3
[plan]
gamma_step_deg = 15
"""


def blocks(page, language):
    """The blocks of a page in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), re.M | re.S)


def tables_of(fragment, name=""):
    """The tables of a parsed job, each with its dotted name and its keys."""
    yield name, {key for key, value in fragment.items() if not nested(value, name, key)}
    for key, value in fragment.items():
        if nested(value, name, key):
            for table in value if isinstance(value, list) else [value]:
                yield from tables_of(table, f"{name}.{key}".lstrip("."))


def nested(value, name, key):
    """Whether a value is a table, or a list of tables, that a job knows."""
    one = value[0] if isinstance(value, list) and value else value
    return isinstance(one, dict) and f"{name}.{key}".lstrip(".") in TABLES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_jobs_and_charts_of_a_page_have_only_keys_that_they_have(page):
    for text in blocks(page, "toml"):
        if "row" in (tables := tomllib.loads(text)):
            ChartFile.model_validate(tables)
            continue
        for name, keys in tables_of(tables):
            known = set(TABLES[name].model_fields) if name else OF_OTHERS
            known |= set(languages()) if name == "program" else set()
            assert keys <= known, f"{page.name}: [{name}] {sorted(keys - known)}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_code_of_a_page_is_run_by_a_test(page):
    if blocks(page, "python"):
        runners = [test for test in HERE.rglob("test_*.py") if page.name in test.read_text("utf-8")]
        assert runners, page.name


def script(page, folder):
    """Run the code of a page as users do, in a folder; return what it prints."""
    (code,) = blocks(ROOT / "docs" / page, "python")
    (folder / "script.py").write_text(code)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout


def test_a_program_of_targets_is_executed(tmp_path):
    seconds, joints = script("execution.md", tmp_path).split(" ", 1)
    assert 2 < float(seconds) < 6  # 0.2 m at 0.1 m/s, and standing before and after
    assert joints.strip().endswith(", 6)")


def test_the_angles_of_controllers_become_those_of_a_job(tmp_path):
    said = dict(line.split(" ", 1) for line in script("measuring.md", tmp_path).splitlines())
    assert said["ABB"] == "[0.0, 0.0, 90.0]"
    assert said["KUKA"] == "[180.0, 0.0, 90.0]"  # [C, B, A]
    assert said["Staubli"] == "[180.0, 0.0, -90.0]"
    assert said["UR"] == "[0.0, 0.0, 90.0002]"  # 1.5708 rad


@pytest.mark.slow
def test_the_whole_job_of_its_page_is_a_job_without_faults(tmp_path):
    (text,) = blocks(ROOT / "docs" / "job-file.md", "toml")[:1]
    shutil.copy(ROOT / "examples" / "parts" / "bracket.step", tmp_path)
    (tmp_path / "whole.toml").write_text(text)
    assert not foresee(prepare(read_job(tmp_path / "whole.toml")))


@pytest.mark.slow
def test_the_code_about_certificates_proves_a_bound(tmp_path):
    cost, bound, gap = map(float, script("certificate.md", tmp_path).split()[:3])
    assert 0 < bound <= cost
    assert gap == pytest.approx((cost - bound) / cost, abs=1e-12)
    assert gap < 0.005  # what plans stop at by default


@pytest.mark.slow
def test_the_code_about_other_robots_runs_as_a_script(tmp_path):
    shutil.copy(ROOT / "src" / "kerfpath" / "demo" / "b_pillar.step", tmp_path)
    (tmp_path / "door.toml").write_text(SMALL_JOB)
    assert "abb_irb4600_60_205" in script("which-robot.md", tmp_path)
    assert (tmp_path / "robots.html").exists()
