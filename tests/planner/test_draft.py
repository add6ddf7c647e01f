"""warm_start(): a motion near the one before, within what is asked for now."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kerfpath import audit, plan
from kerfpath.options import PlanOptions
from kerfpath.planner import layered_graph, warm_start
from kerfpath.planner.refinements import refine_from_random_starts

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


def test_more_random_starts_never_cost_more(before):
    options = replace(OPTIONS, weights=[3, 1, 1, 1, 1, 1])
    made = warm_start(before, options, dt=before.dt)
    free = SimpleNamespace(is_clear=lambda plan: True)
    found = [
        refine_from_random_starts(replace(made, settings=replace(made.settings, restarts=n)), free)
        for n in (0, 2, 6)
    ]
    assert np.array_equal(found[0].q, made.q)
    assert found[2].cost <= found[1].cost <= found[0].cost == made.cost
    assert found[2].cost < made.cost
    assert audit(found[2]) == []


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
