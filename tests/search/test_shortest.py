"""shortest_path against the procedure written out line by line, its laws, edges and bad input."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import naive
from kerfpath import InputError, NoFeasiblePath, shortest_path
from kerfpath.kernels import limits, metric

ONE = {"dt": 1.0, "velocity": [1.0], "acceleration": [1.0], "method": "paper"}


@pytest.mark.slow
@pytest.mark.equation(16)
def test_the_procedure_agrees_with_the_paper_line_by_line():
    rng = np.random.default_rng(7)
    feasible = alike = 0
    for _ in range(1500):
        q, start, options = naive.random_instance(rng)
        want = naive.path_planning(q, start, **options)
        try:
            got = shortest_path(q, start, **options)
        except NoFeasiblePath:
            assert want is None
            continue
        feasible += 1
        assert want is not None
        # Sums in another order: rounding only.
        assert got.cost == pytest.approx(want[1], rel=1e-12, abs=1e-12)
        alike += np.array_equal(got.index, want[0])
        assert cost_of(q[start[:-1] + got.index], start, got.index, options) == pytest.approx(
            got.cost, rel=1e-12, abs=1e-12
        )
    assert 300 < feasible < 1450
    assert alike > 0.95 * feasible  # rounding decides ties, as on a line or for a maximum


def cost_of(path, start, index, o):
    """Cost of a path (K, n), which must keep (5) and (6) unless the technique ignores them."""
    d = naive.difference(path[:-1], path[1:], o["endless"])
    if o["method"] == "paper":
        assert (np.abs(d) <= o["eta_v"] * o["velocity"] * o["dt"] + 2e-9).all()
        change = np.abs(np.diff(d, axis=0))
        assert (change <= o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 2e-9).all()
    costs = [naive.distance(r, o["weights"], o["metric"]) for r in d]
    costs += list(o["vertex_cost"][start[:-1] + index])
    return sum(costs) if o["objective"] == "sum" else max(costs)


def test_optimal_is_claimed_only_for_the_true_optimum():
    rng = np.random.default_rng(8)
    claimed = 0
    for _ in range(300):
        q, start, options = naive.random_instance(rng, layers=(2, 5), size=(1, 5))
        options["method"] = "paper"
        try:
            got = shortest_path(q, start, **options)
        except NoFeasiblePath as broken:
            if broken.proved:
                assert best_by_enumeration(q, start, options) == np.inf
            continue
        best = best_by_enumeration(q, start, options)
        assert got.cost >= best - 1e-9
        if got.optimal:
            claimed += 1
            assert got.cost == pytest.approx(best, abs=1e-9)
    assert claimed > 50


def best_by_enumeration(q, start, o):
    """Cost of the best path among all paths that keep (5) and (6)."""
    best = np.inf
    for path in itertools.product(*[range(a, b) for a, b in itertools.pairwise(start)]):
        d = naive.difference(q[list(path[:-1])], q[list(path[1:])], o["endless"])
        if (np.abs(d) > o["eta_v"] * o["velocity"] * o["dt"] + 1e-9).any():
            continue
        if (
            np.abs(np.diff(d, axis=0)) > o["eta_a"] * o["acceleration"] * o["dt"] ** 2 + 1e-9
        ).any():
            continue
        costs = [naive.distance(row, o["weights"], o["metric"]) for row in d]
        vertices = list(o["vertex_cost"][list(path)])
        best = min(
            best, sum(costs + vertices) if o["objective"] == "sum" else max(costs + vertices)
        )
    return best


@pytest.mark.equation(12)
def test_the_window_never_hides_an_admissible_edge():
    # Limits that bind on one endless joint only, at and around the wrap of +-pi.
    rng = np.random.default_rng(9)
    for bound in (0.05, 1.0, 3.0, np.pi, 4.0):
        q = np.concatenate([rng.uniform(-np.pi, np.pi, (40, 1)) for _ in range(4)])
        q[::7] = np.pi
        q[3::7] = -np.pi
        start = np.arange(0, 161, 40)
        options = {
            "dt": 1.0, "velocity": np.array([bound]), "acceleration": np.array([1e6]),
            "endless": np.array([True]), "posture": np.zeros(160, int),
            "vertex_cost": np.zeros(160), "weights": np.ones(1), "metric": "manhattan",
            "objective": "sum", "method": "paper", "eta_v": 1.0, "eta_a": 1.0,
        }  # fmt: skip
        want = naive.path_planning(q, start, **options)
        assert shortest_path(q, start, **options).cost == pytest.approx(want[1], abs=1e-12)


@pytest.mark.equation(13)
def test_an_endless_joint_goes_the_short_way_round():
    q = [[3.0], [-3.0]]
    short = shortest_path(q, [0, 1, 2], endless=[True], weights=[1.0], **ONE)
    assert short.cost == pytest.approx(2 * np.pi - 6)
    with pytest.raises(NoFeasiblePath):
        shortest_path(q, [0, 1, 2], **ONE)
    assert metric.increment(7.0, True) == pytest.approx(7 - 2 * np.pi)
    assert metric.increment(7.0, False) == 7.0


@pytest.mark.equation(5)
@pytest.mark.equation(6)
def test_the_limits_name_the_joint_that_breaks_and_admit_equality():
    bound = np.array([0.5, 0.2])
    assert limits.velocity_excess(np.array([-0.5, 0.2]), bound) == -1
    assert limits.velocity_excess(np.array([0.1, -0.21]), bound) == 1
    assert limits.acceleration_excess(np.array([0.3, 0.1]), np.array([-0.2, -0.1]), bound) == -1
    assert limits.acceleration_excess(np.array([0.31, 0.1]), np.array([-0.2, -0.1]), bound) == 0


@pytest.mark.equation(7)
@pytest.mark.equation(8)
@pytest.mark.equation(9)
@pytest.mark.equation(14)
@pytest.mark.equation(15)
def test_the_criteria_of_a_worked_example():
    q = np.array([[0.0, 3.0], [0.5, -3.0], [0.2, -2.5]])
    dq = metric.increments(q, np.array([False, True]))
    turn = 2 * np.pi - 6
    np.testing.assert_allclose(dq, [[0.5, turn], [-0.3, 0.5]])
    np.testing.assert_allclose(metric.total_displacement(dq), [0.8, turn + 0.5])
    np.testing.assert_allclose(metric.largest_increment(dq), [0.5, 0.5])
    np.testing.assert_allclose(metric.coordinate_range(dq), [0.5, turn + 0.5])
    weight = np.array([2.0, 1.0])
    assert metric.total_distance(dq, weight, metric.MANHATTAN) == pytest.approx(2.1 + turn)
    assert metric.total_distance(dq, weight, metric.CHEBYCHEV) == pytest.approx(1.6)
    assert metric.maximum_distance(dq, weight, metric.MANHATTAN) == pytest.approx(1 + turn)
    assert metric.maximum_distance(dq, weight, metric.EUCLID) == pytest.approx(np.hypot(1, turn))


@settings(derandomize=True, max_examples=100, deadline=None)
@given(
    rows=hnp.arrays(float, (3, 4), elements=st.floats(-10, 10)),
    weight=hnp.arrays(float, 4, elements=st.floats(0.1, 5)),
    code=st.sampled_from([metric.EUCLID, metric.MANHATTAN, metric.CHEBYCHEV]),
)
def test_the_distance_is_a_metric(rows, weight, code):
    endless = np.array([True, False, True, False])

    def rho(a, b):
        dq = np.array([metric.increment(x, e) for x, e in zip(b - a, endless, strict=True)])
        return metric.rho(dq, weight, code)

    a, b, c = rows
    assert rho(a, a) == 0
    assert rho(a, b) == pytest.approx(rho(b, a), abs=1e-9)
    assert rho(a, c) <= rho(a, b) + rho(b, c) + 1e-9


def test_no_random_path_beats_the_first_order_optimum():
    rng = np.random.default_rng(10)
    for _ in range(50):
        q, start, options = naive.random_instance(rng, layers=(3, 9), size=(2, 20))
        options |= {"method": "known", "vertex_cost": np.zeros(len(q)), "posture": None}
        best = shortest_path(q, start, **options)
        join = sum if options["objective"] == "sum" else max
        for _ in range(50):
            path = q[[rng.integers(a, b) for a, b in itertools.pairwise(start)]]
            d = naive.difference(path[:-1], path[1:], options["endless"])
            cost = join(naive.distance(r, options["weights"], options["metric"]) for r in d)
            assert best.cost <= cost + 1e-9


def test_the_known_technique_stays_on_one_posture_and_ignores_the_limits():
    q, start = [[0.0], [9.0], [0.1], [9.1], [0.2], [9.2]], [0, 2, 4, 6]
    far = shortest_path(q, start, posture=[0, 1, 1, 0, 0, 0], **{**ONE, "method": "known"})
    np.testing.assert_array_equal(far.index, [0, 1, 1])
    assert not far.optimal


def test_ties_go_to_the_first_vertex():
    path = shortest_path([[0.0], [0.0], [0.0], [0.0]], [0, 2, 4], **ONE)
    np.testing.assert_array_equal(path.index, [0, 0])
    assert path.optimal


def test_one_layer_takes_its_cheapest_vertex():
    path = shortest_path([[0.0], [1.0]], [0, 2], vertex_cost=[2.0, 1.0], **ONE)
    assert path.index.tolist() == [1]
    assert path.cost == 1.0


@pytest.mark.parametrize(
    ("start", "node"), [([0, 0, 1, 2], -1), ([0, 1, 1, 2], 0), ([0, 1, 2, 2], 1)]
)
def test_an_empty_layer_is_an_answer_with_its_node(start, node):
    with pytest.raises(NoFeasiblePath, match="is empty") as caught:
        shortest_path([[0.0], [0.1]], start, **ONE)
    assert caught.value.node == node
    assert caught.value.proved


def test_where_a_path_breaks_and_what_forbids_it():
    q = [[0.0, 0.0], [0.5, 0.0], [0.6, 0.0], [3.0, 0.0], [0.7, 9.0]]
    with pytest.raises(NoFeasiblePath) as caught:
        shortest_path(q, [0, 1, 3, 5], dt=1.0, velocity=[1, 1], acceleration=[9, 9], method="paper")
    broken = caught.value
    assert (broken.node, broken.proved) == (1, True)
    assert broken.counts == {"velocity, joint 1": 2, "velocity, joint 2": 2}
    assert "from node 1 to node 2" in str(broken)


def test_a_greedy_refusal_is_not_called_a_proof():
    # The cheap first step leaves no admissible second one; the dear first step would.
    q = [[0.0], [0.4], [0.5], [1.0]]
    with pytest.raises(NoFeasiblePath, match="acceleration, joint 1") as caught:
        shortest_path(q, [0, 2, 3, 4], dt=1.0, velocity=[1.0], acceleration=[0.05], method="paper")
    assert not caught.value.proved
    # Without the cheap vertex the path through the dear one is found.
    kept = shortest_path(
        [q[0], q[2], q[3]],
        [0, 1, 2, 3],
        dt=1.0,
        velocity=[1.0],
        acceleration=[0.05],
        method="paper",
    )
    assert kept.cost == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start": [0, 1]}, "start: expected K\\+1 offsets"),
        ({"start": [0, 2, 1, 2]}, "start"),
        ({"start": [0.5, 2]}, "start: expected whole numbers"),
        ({"start": [1, 2]}, "start"),
        ({"q": [[np.nan], [1.0]]}, r"q\[0, 0\] is nan"),
        ({"q": [1.0, 2.0]}, r"q: expected shape \(any, any\)"),
        ({"dt": 0.0}, "dt: expected a number above 0 s"),
        ({"dt": "x"}, "dt: expected a number"),
        ({"velocity": [0.0]}, r"velocity: must be positive"),
        ({"acceleration": [-1.0]}, "acceleration: must be positive"),
        ({"velocity": [1.0, 1.0]}, r"velocity: expected shape \(1\)"),
        ({"endless": [2]}, "endless: expected true or false"),
        ({"posture": [0.5, 1]}, "posture: expected whole numbers"),
        ({"posture": [0]}, "posture: expected shape"),
        ({"vertex_cost": [np.nan, 0]}, "vertex_cost: every number must be a number"),
        ({"weights": [-1.0]}, "weights: must not be negative"),
        ({"metric": "taxi"}, "metric: expected one of euclid, manhattan, chebychev, got 'taxi'"),
        ({"objective": "mean"}, "objective: expected one of sum, max"),
        ({"method": "magic"}, "method: expected one of"),
        ({"closure": "open"}, "closure: expected one of"),
        ({"closure": "periodic"}, '"periodic" needs method="exact"'),
        ({"eta_v": 0}, "eta_v: expected a number above 0"),
        ({"eta_a": np.nan}, "eta_a"),
    ],
)
def test_bad_input_is_refused(change, message):
    arguments = {"q": [[0.0], [0.5]], "start": [0, 1, 2], **ONE} | change
    with pytest.raises(InputError, match=message):
        shortest_path(arguments.pop("q"), arguments.pop("start"), **arguments)


@settings(derandomize=True, max_examples=150, deadline=None)
@given(
    q=hnp.arrays(float, st.tuples(st.integers(0, 6), st.integers(0, 3)), elements=st.floats(-4, 4)),
    start=st.lists(st.integers(-1, 7), max_size=5),
    velocity=st.lists(st.floats(), max_size=3),
)
def test_whatever_comes_no_crash(q, start, velocity):
    try:
        path = shortest_path(
            q, start, dt=0.1, velocity=velocity, acceleration=velocity, method="paper"
        )
    except (InputError, NoFeasiblePath):
        return
    assert len(path.index) == len(start) - 1
