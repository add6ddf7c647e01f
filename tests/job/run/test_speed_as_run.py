"""A speed at which the program keeps the limits, too: a job that asks for it is guaranteed."""

import re

import numpy as np
import pytest
from tests.cad.test_bent_parts import square_tube
from tests.cad.test_part import cylinder, write_step

from jobs import DEMO, SMALL
from kerfpath.job import fastest_speeds, read_job, run_job

GUARANTEED = re.sub(
    "eta_acceleration = .*",
    "eta_acceleration = 1",
    SMALL.replace("[plan]", '[plan]\ncertify = false\nbetween_nodes = "guaranteed"'),
).replace("spacing_mm = 1 ", "spacing_mm = 4 ")
GUARANTEED += "\n[program.rapid]\nshortest_move_ms = 0\n"
"""Every share of the limits is used at the nodes, which are far apart; any move is long enough."""


def read(folder, text):
    (folder / "b_pillar.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    (folder / "job.toml").write_text(text)
    return read_job(folder / "job.toml")


def at(speeds):
    """The job at a speed, m/s, for each of its two contours."""
    parts = re.split(r"speed_m_min = [\d.]+", GUARANTEED)
    assert len(parts) == 3
    first, second = (f"speed_m_min = {speed * 60!r}" for speed in speeds)
    return first.join(parts[:2]) + second + parts[2]


@pytest.mark.slow
def test_at_the_speed_as_run_the_job_is_guaranteed_at_that_of_the_nodes_not(tmp_path):
    found = fastest_speeds(read(tmp_path, GUARANTEED))
    speeds = [each.as_run for each in found]
    fastest = [each.at_nodes.speed for each in found]
    assert all(0.5 * most < speed <= most for speed, most in zip(speeds, fastest, strict=True))
    assert any(speed < most for speed, most in zip(speeds, fastest, strict=True))
    assert run_job(read(tmp_path, at(speeds))).passed
    assert not run_job(read(tmp_path, at([0.9999 * most for most in fastest]))).passed


@pytest.mark.slow
@pytest.mark.parametrize("without", ['between_nodes = "guaranteed"', 'language = "rapid"'])
def test_where_nothing_is_kept_there_is_no_such_speed(tmp_path, without):
    instead = {"b": 'between_nodes = "reported"', "l": 'language = "none"'}[without[0]]
    text = GUARANTEED.replace(without, instead)
    text = text.replace('between_nodes = "guaranteed"', 'between_nodes = "kept"')
    assert text != GUARANTEED
    assert [each.as_run for each in fastest_speeds(read(tmp_path, text))] == [None, None]


TUBE_JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-90"
[part]
file = "part.step"
xyz_mm = [1200, 0, 600]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "skin1/hole1"
speed_m_min = 3
spacing_mm = 2
[plan]
certify = false
gamma_step_deg = 10
[program]
language = "none"
"""


@pytest.mark.slow
def test_the_speed_holds_for_the_nodes_of_a_cut_that_is_slower_at_sharp_edges(tmp_path):
    """At one speed everywhere a turn of 90 deg would lie between two nodes: half the speed."""
    write_step(tmp_path / "part.step", square_tube(cylinder(6, 10, (100, 0, 35))))
    (tmp_path / "job.toml").write_text(TUBE_JOB)
    (found,) = fastest_speeds(read_job(tmp_path / "job.toml"))
    speed = found.at_nodes.speed
    assert speed < found.at_nodes.ceiling
    slower = TUBE_JOB.replace("speed_m_min = 3", f"speed_m_min = {0.9999 * speed * 60!r}")
    (tmp_path / "job.toml").write_text(slower)
    (cut,) = (result := run_job(read_job(tmp_path / "job.toml"))).cuts
    assert result.passed
    assert cut.plan.contour.s == pytest.approx(found.nodes.s, abs=1e-12)
    # The edges take most of the time, in which the tip moves by a tenth of a step.
    assert np.diff(cut.plan.contour.s).min() < 0.15 * np.diff(cut.plan.contour.s).max()
