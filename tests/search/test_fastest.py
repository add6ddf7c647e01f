"""The least node interval against bisection, and by its own optimality."""

import itertools

import numpy as np
import pytest
from tests.search.posed import least_interval

import naive
from kerfpath import Contour, InputError, NoFeasiblePath, audit, fastest_speed, plan, shortest_path


@pytest.fixture(scope="module")
def uneven(circle):
    """The circle in steps of two lengths, the longest 5 % longer than the mean."""
    fine = circle.resample(count=361)
    kept = np.cumsum([0] + 18 * [6, 7, 7])
    return Contour(fine.points[kept], fine.axes[kept], closed=True, name="uneven")


def interval_of(q, v, a, endless):
    """Least interval of one path (K, n)."""
    d = naive.difference(q[:-1], q[1:], endless)
    sharp = np.sqrt(np.abs(np.diff(d, axis=0)) / a)
    return max((np.abs(d) / v).max(), sharp.max(initial=0.0))


def instance(rng):
    q, start, o = naive.random_instance(rng, layers=(2, 8), size=(1, 8))
    return q, start, {k: o[k] for k in ("velocity", "acceleration", "endless", "eta_v", "eta_a")}


def slack(dt, o):
    """Return what the 1e-9 rad that shortest_path grants on both limits is in time."""
    fast = 1e-9 / (o["eta_v"] * o["velocity"]).min()
    return fast + 1e-9 / (2 * dt * (o["eta_a"] * o["acceleration"]).min())


@pytest.mark.slow
def test_the_interval_agrees_with_bisection_over_shortest_path():
    rng = np.random.default_rng(31)
    for _ in range(150):
        q, start, o = instance(rng)
        found = least_interval(q, start, **o)

        def feasible(dt, q=q, start=start, o=o):
            try:
                shortest_path(q, start, dt=dt, **o)
            except NoFeasiblePath:
                return False
            return True

        low, high = 0.0, 4 * found.dt + 1e-6
        assert feasible(high)
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (low, middle) if feasible(middle) else (middle, high)
        assert high == pytest.approx(found.dt, rel=1e-9, abs=2 * slack(found.dt, o))


def test_the_path_keeps_the_interval_and_no_other_does_better():
    rng = np.random.default_rng(32)
    for _ in range(200):
        q, start, o = instance(rng)
        v, a = o["eta_v"] * o["velocity"], o["eta_a"] * o["acceleration"]
        found = least_interval(q, start, **o)
        path = q[start[:-1] + found.index]
        assert interval_of(path, v, a, o["endless"]) == pytest.approx(found.dt, rel=1e-12)
        for _ in range(20):
            other = q[[rng.integers(a_, b_) for a_, b_ in itertools.pairwise(start)]]
            assert found.dt <= interval_of(other, v, a, o["endless"]) * (1 + 1e-12)


@pytest.mark.parametrize("share", [1.0, 3.0])
def test_a_step_over_the_first_guess_is_not_lost(share):
    # A search goes up to a guess of the interval and leaves out the steps that alone take longer.
    rng = np.random.default_rng(34)
    for _ in range(600):
        q, start, o = instance(rng)
        o["acceleration"] = share * o["acceleration"]
        least = least_interval(q, start, **o).dt
        less = least * (1 - 1e-6) - 2 * slack(least, o)
        if less > 0:
            with pytest.raises(NoFeasiblePath):
                shortest_path(q, start, dt=less, **o)


def test_what_binds_is_named():
    q = [[0.0, 0.0], [0.1, 0.4], [0.2, 0.0]]
    options = {"velocity": [1.0, 1.0], "endless": [False, False]}
    sharp = least_interval(q, [0, 1, 2, 3], acceleration=[1.0, 1.0], **options)
    assert (sharp.joint, sharp.node, sharp.limit) == (1, 1, "acceleration")
    assert sharp.dt == pytest.approx(np.sqrt(0.8))
    fast = least_interval(q, [0, 1, 2, 3], acceleration=[100.0, 100.0], **options)
    assert (fast.joint, fast.node, fast.limit) == (1, 1, "velocity")
    assert fast.dt == pytest.approx(0.4)


def test_a_graph_that_stands_still_takes_no_time():
    assert least_interval(
        [[1.0], [1.0]], [0, 1, 2], velocity=[1.0], acceleration=[1.0]
    ).dt == pytest.approx(0.0)


def test_an_empty_layer_and_bad_input_are_refused():
    limits = {"velocity": [1.0], "acceleration": [1.0]}
    with pytest.raises(NoFeasiblePath, match="layer 1 is empty") as caught:
        least_interval([[0.0], [0.1]], [0, 1, 1, 2], **limits)
    assert caught.value.node == 0
    with pytest.raises(InputError, match="velocity: must be positive"):
        least_interval([[0.0], [0.1]], [0, 1, 2], velocity=[0.0], acceleration=[1.0])
    with pytest.raises(InputError, match="at least two layers"):
        least_interval([[0.0]], [0, 1], **limits)


def test_a_contour_is_feasible_at_its_fastest_speed_and_not_above(circle, arm, tool, placement):
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(5)}
    found = fastest_speed(circle, arm, **options)
    made = plan(circle, arm, speed=found.speed * (1 - 1e-6), method="exact", **options)
    assert made.criteria.peak_velocity.max() <= 1 + 1e-6
    with pytest.raises(NoFeasiblePath):
        plan(circle, arm, speed=found.speed * 1.001, method="exact", **options)
    assert 0 <= found.joint < 6
    assert 0 <= found.node < len(circle)


@pytest.mark.parametrize("refine", [False, True])
def test_uneven_nodes_have_one_speed_the_same_for_both(uneven, arm, tool, placement, refine):
    options = {"tool": tool, "placement": placement, "gamma_step": np.radians(5)}
    found = fastest_speed(uneven, arm, refine=refine, **options)
    options["method"] = "exact"
    made = plan(uneven, arm, speed=found.speed * (1 - 1e-6), refine=refine, **options)
    # The speed is that of the longest step, as it is where a plan is asked for at it.
    assert np.diff(uneven.s).max() / made.dt == pytest.approx(found.speed, rel=2e-6)
    on_grid = found.speed if found.on_grid is None else found.on_grid
    with pytest.raises(NoFeasiblePath):
        plan(uneven, arm, speed=on_grid * 1.001, **options)


@pytest.mark.slow
def test_off_the_grid_it_is_faster_and_the_motion_keeps_the_limits(circle, arm, tool, placement):
    cell = {"tool": tool, "placement": placement, "gamma_step": np.radians(4)}
    on_grid = fastest_speed(circle, arm, **cell)
    found = fastest_speed(circle, arm, refine=True, **cell)
    assert found.on_grid == on_grid.speed
    assert found.speed > on_grid.speed
    made = plan(circle, arm, speed=0.99 * found.speed, refine=True, **cell)
    assert audit(made) == []
    assert np.abs(made.acceleration_share).max() <= 1
    # What binds is used up: at that speed nothing is left of it.
    assert found.limit == "acceleration"


@pytest.mark.slow
def test_off_the_grid_a_plan_is_found_up_to_the_fastest_speed(circle, arm, tool, placement):
    nodes = circle.resample(count=41)
    cell = {"tool": tool, "placement": placement, "gamma_step": np.radians(5), "refine": True}
    found = fastest_speed(nodes, arm, **cell)
    for share in (0.99, 0.999, 0.99999):
        made = plan(nodes, arm, speed=share * found.speed, **cell)
        assert audit(made) == []


@pytest.mark.slow
def test_an_interval_found_past_the_ceiling_of_a_search_is_not_believed():
    # The search leaves out edges beyond its ceiling: up to 8 % of these intervals was given away.
    rng = np.random.default_rng(777)
    for _ in range(1500):
        q, start, o = instance(rng)
        found = least_interval(q, start, **o)
        with pytest.raises(NoFeasiblePath):
            shortest_path(q, start, dt=found.dt * (1 - 1e-4), **o)
