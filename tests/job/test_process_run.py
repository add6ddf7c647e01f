"""A job with a chart from its plan to its program: the audits see the chart, and its changes."""

import json
import re

import pytest
from tests.job.test_charts import CHART

from commands import run
from jobs import DEMO, SMALL

CONTOURS = 'gas = "N2"\nchart = "chart.toml"\n'
HOLES = CHART.replace("speed_m_min = 6", "speed_m_min = 2").replace(
    "lead_in_mm = 3", "lead_in_mm = 2"
)


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """The folder of a job with a chart, planned by the command, and what that printed."""
    folder = tmp_path_factory.mktemp("process")
    (folder / "b_pillar.step").symlink_to(DEMO / "b_pillar.step")
    (folder / "chart.toml").write_text(HOLES)
    one = re.sub(r'\[\[contour\]\]\npick = "skin/hole11"\n(?:\w.*\n)+', "", SMALL)
    text = re.sub(r"^speed_m_min.*\n", "", one, flags=re.MULTILINE)
    process = f'[process]\nmaterial = "steel"\nthickness_mm = 2\n{CONTOURS}'
    text = text.replace("[[contour]]", f"{process}\n[[contour]]", 1)
    text = (
        text.replace("[plan]\n", '[plan]\nfeed = "dip"\n')
        + '[program.rapid]\ngas_output = "doGas"\n'
    )
    (folder / "job.toml").write_text(text)
    made = run("plan", "job.toml", "--out", "out", "--json", cwd=folder)
    assert made.returncode == 0, made.stderr + made.stdout
    return folder, json.loads(made.stdout)


def audited(folder, file, chart=HOLES):
    (folder / "chart.toml").write_text(chart)
    try:
        return run("audit", file, "--job", "job.toml", cwd=folder)
    finally:
        (folder / "chart.toml").write_text(HOLES)


def test_the_plan_says_process_and_times(planned):
    _, said = planned
    values = {(each["of"], each["key"]): each for each in said["process"]["origins"]}
    assert values["hole 10", "speed_m_min"]["from"] == "chart.toml row 1"
    assert values["normal", "power_w"]["by_hand"]
    for contour in said["contours"]:
        assert contour["piercing_s"] == pytest.approx(0.3)
        assert contour["gas_s"] == pytest.approx(0.25 + 0.3 + contour["time_s"])
    assert any("power 1800 W; " in note for note in said["notes"])
    assert any("0.2 s 1800 W 1 mm high." in note for note in said["notes"])


def test_the_report_has_a_table_of_the_process(planned):
    folder, _ = planned
    page = (folder / "out" / "report.html").read_text()
    section = page.partition("<h2>Process</h2>")[2].partition("</section>")[0]
    assert "chart.toml row 1" in section
    assert "power_w" in section
    assert "Piercing" in section


@pytest.mark.parametrize("file", ["out/plan.json", "out/job.mod"])
def test_plan_and_program_pass_with_the_chart_of_the_plan(planned, file):
    folder, _ = planned
    result = audited(folder, file)
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("job.mod", "speed_m_min = 2\n", "speed_m_min = 1.8\n", "speed from the job's"),
        pytest.param(
            "job.mod", "time_s = 0.1", "time_s = 0.4", "wait at the start", marks=pytest.mark.slow
        ),
        pytest.param(
            "job.mod", "gas_lead_s = 0.25", "gas_lead_s = 0.4", "gas", marks=pytest.mark.slow
        ),
        (
            "job.mod",
            "power_w = 1800\n",
            "power_w = 1500\n",
            "job.mod, line 6: lines of",
        ),
        ("plan.json", "kerf_mm = 0.15", "kerf_mm = 0.4", "kerf_mm"),
        pytest.param(
            "plan.json", "nozzle_mm = 1.5", "nozzle_mm = 2", "nozzle_mm", marks=pytest.mark.slow
        ),
    ],
)
def test_a_chart_that_was_changed_after_planning_is_found(planned, file, old, new, words):
    folder, _ = planned
    chart = HOLES.replace(old, new, 1)
    assert chart != HOLES
    found = audited(folder, f"out/{file}", chart)
    assert found.returncode == 1, found.stdout
    assert words in found.stdout


def test_a_chart_may_get_more_rows_and_another_source(planned):
    folder, _ = planned
    row = '[[row]]\nmaterial = "copper"\nthickness_mm = 1\nspeed_m_min = 3\n\n'
    chart = HOLES.replace("[[row]]", f"{row}[[row]]", 1).replace("cut trials", "more trials")
    for file in ("out/plan.json", "out/job.mod"):
        result = audited(folder, file, chart)
        assert result.returncode == 0, result.stdout


def test_a_program_in_another_language_is_made_of_the_plan_alone(planned):
    folder, _ = planned
    (folder / "chart.toml").rename(folder / "away.toml")
    try:
        made = run("post", "out/plan.json", "--language", "linuxcnc", cwd=folder)
    finally:
        (folder / "away.toml").rename(folder / "chart.toml")
    assert made.returncode in (0, 2)
    assert "gas_output" in made.stderr or "power 1800 W" in made.stdout
