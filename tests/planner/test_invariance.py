"""A plan does not depend on how its task is written down: sampling, frames, direction, start."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import invariance

from kerfpath.planner import node_interval

pytestmark = pytest.mark.usefixtures("explored")

CASES = [
    (0, ()), (29, ()), (192, ()), (203, ()), (334, ()), (28, ("as drawn", "reversed")),
]  # fmt: skip
"""Tasks whose first paths, on coarse samples of gamma, lie in another valley than the best motion:
in another posture, half a turn away, and in postures that two joints at their limits leave less
than 4 degrees of gamma; they cost 0.6, 2.9, 10.4 and 2.6 % more. In the last two only the largest
step counts: motions refined in some of the forms cost 1.3 and 2.6 % more."""


def test_a_seed_decides_all_of_a_task():
    one, other = (invariance.drawn(7).task for _ in range(2))
    np.testing.assert_array_equal(one.contour.points, other.contour.points)
    assert (one.robot.id, one.speed) == (other.robot.id, other.speed)


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_the_forms_of_a_task_are_the_same_task(seed):
    """Tip and beam in the base, kinematics, and limits of a step in intervals, to rounding."""
    rng = np.random.default_rng(seed)
    task = invariance.drawn(seed).task
    last = len(task.contour) - 1
    order = {"reversed": np.arange(last, -1, -1), "start": np.r_[last // 2 : last, : last // 2 + 1]}
    q = rng.uniform(-1, 1, (20, 6))
    for name, change in invariance.FORMS.items():
        form = change(task, rng)
        if form is None:
            assert (name, task.options.closure) == ("start", "free")
            continue
        for mine, own in zip(_nodes(form), _nodes(task), strict=True):
            np.testing.assert_allclose(mine, own[order.get(name, slice(None))], atol=1e-9)
        for mine, own in zip(_steps(form), _steps(task), strict=True):
            np.testing.assert_allclose(mine, own, rtol=1e-9)
        tips = [[each.robot.forward(one) @ each.tool for one in q] for each in (form, task)]
        np.testing.assert_allclose(*np.array(tips)[..., 2:], atol=1e-9)


def _nodes(task):
    R, p = task.placement[:3, :3], task.placement[:3, 3]
    return task.contour.points @ R.T + p, task.contour.axes @ R.T


def _steps(task):
    dt = node_interval(task.contour, task.speed)
    velocity, acceleration = task.robot.speed_limits()
    return velocity * dt, acceleration * dt**2


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "forms"), CASES)
def test_a_plan_costs_the_same_in_all_forms_of_its_task(seed, forms):
    costs = invariance.planned(seed, forms)["costs"].values()
    assert None not in costs
    assert max(costs) <= min(costs) * (1 + invariance.TOLERANCE)


@pytest.mark.slow
def test_a_reduced_feed_takes_the_same_time_whatever_the_step_of_gamma():
    """At 3.3 times its speed; the first paths alone take 1.29 and 1.65 times the time asked for."""
    own = invariance.drawn(30).task
    task = replace(own, speed=3.26 * own.speed, options=replace(own.options, feed="dip"))
    changed = (
        invariance.FORMS[name](task, np.random.default_rng(0)) for name in ("5 deg", "10 deg")
    )
    times = [form.planned().time[-1] for form in changed]
    assert max(times) <= min(times) * (1 + invariance.TOLERANCE)
    assert max(times) < 1.21 * task.contour.s[-1] / task.speed
