"""Jobs of very many contours, of which less is compared for each."""

import ezdxf
import pytest

from kerfpath.crew import Crew
from kerfpath.job import read_job, run_job
from kerfpath.job.output.writing import write_result
from kerfpath.job.run import job as module
from kerfpath.sequence import part as sequence

JOB = """\
[robot]
model = "abb_irb4600_60_205"
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-90"
[part]
file = "nest.dxf"
xyz_mm = [1100, -100, 300]
rpy_deg = [0, 0, 0]
[[contour]]
speed_m_min = 2
spacing_mm = 4
[contour.pick_all]
layer = "0"
[plan]
gamma_step_deg = 10
[sequence]
home_deg = [0, -20, 10, 0, 60, 0]
"""


@pytest.fixture
def nest(tmp_path, monkeypatch):
    """A nest of four rings, which are taken for very many, and work for two processes."""
    drawing = ezdxf.new(units=4)
    for k in range(4):
        drawing.modelspace().add_circle((60 * k, 20 * (k % 2)), 12 + 3 * k)
    drawing.saveas(tmp_path / "nest.dxf")
    (tmp_path / "nest.toml").write_text(JOB)
    monkeypatch.setattr(sequence, "MANY", 3)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    return tmp_path / "nest.toml"


@pytest.mark.slow
def test_very_many_contours_are_cut_in_the_posture_in_which_some_cost_least(nest, monkeypatch):
    crews, said = [], []

    def crew(others, name):
        crews.append(others)
        return Crew(others, name)

    monkeypatch.setattr(module, "Crew", crew)
    result = run_job(read_job(nest), progress=lambda *words: said.append(words))
    assert result.passed
    assert crews == [1]
    assert len({int(p) for plan in result.plans for p in plan.posture}) == 1
    assert all(plan.proof.bound is not None for plan in result.plans)
    # What may be chosen from stays in the report and in the bound.
    assert all(plan.settings.postures is None for plan in result.plans)
    whats = [what for what, _, _ in said]
    assert "choosing the posture" in whats
    assert not any("other postures" in what for what in whats)
    write_result(result, nest.parent / "out")
    assert (nest.parent / "out" / "plan.json").exists()
