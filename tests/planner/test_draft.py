"""warm_start(): a motion near the one before, within what is asked for now."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import audit, plan
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph, warm_start

OPTIONS = PlanOptions(gamma_step=np.radians(4), postures=(0, 1))
SPEED = 0.1
CHANGES = {
    "weights": {"weights": [3, 1, 1, 1, 1, 1]},
    "metric": {"metric": "euclid"},
    "objective": {"objective": "max"},
    "eta": {"eta_v": 0.9, "eta_a": 0.9},
}


@pytest.fixture(scope="module")
def planned(circle, arm, tool, placement):
    given = {"tool": tool, "placement": placement, "speed": SPEED}
    graph = layered_graph(circle, arm, tool=tool, placement=placement, options=OPTIONS)

    def call(**change):
        return plan(circle, arm, options=replace(OPTIONS, **change), graph=graph, **given)

    return call


@pytest.fixture(scope="module")
def before(planned):
    return planned()


@pytest.mark.parametrize("change", CHANGES)
def test_a_draft_keeps_the_limits_and_is_between_the_motion_before_and_the_plan(
    change, planned, before
):
    options = replace(OPTIONS, **CHANGES[change])
    made = warm_start(before, options, dt=before.dt)
    assert audit(made) == []
    settings = made.settings
    for name, value in CHANGES[change].items():
        assert np.array_equal(getattr(settings, name), value)
    as_before = replace(before, settings=settings)
    start = draft_cost(as_before)
    best = planned(**CHANGES[change])
    # The plan is a local optimum, converged to 1e-4.
    assert best.cost * (1 - 1e-3) <= made.cost <= start * (1 + 1e-9)
    assert made.cost == pytest.approx(draft_cost(made))
    np.testing.assert_array_equal(made.posture, before.posture)


def draft_cost(made):
    """The objective of a plan by its own settings."""
    from kerfpath.plans import path_cost

    s = made.settings
    return path_cost(made.increments, s.weights, s.metric, s.objective)


def test_a_draft_at_another_speed_takes_its_time(before):
    made = warm_start(before, OPTIONS, dt=before.dt * 1.25)
    assert made.dt == pytest.approx(before.dt * 1.25)
    assert audit(made) == []


def test_a_draft_is_not_made_where_it_would_be_another_task(before):
    dt = before.dt
    for change in ({"method": "exact"}, {"closure": "periodic"}, {"feed": "dip"}):
        assert warm_start(before, replace(OPTIONS, **change), dt=dt) is None


def test_a_draft_that_cannot_keep_the_limits_is_none(before):
    assert warm_start(before, replace(OPTIONS, eta_v=1e-3), dt=before.dt) is None
