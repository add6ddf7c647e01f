"""The least relaxation of each limit: just enough, and no less."""

import numpy as np
import pytest
from tests.search.posed import least_relaxations

import naive
from kerfpath import NoFeasiblePath, shortest_path


def is_feasible(q, start, **options):
    try:
        shortest_path(q, start, **options)
    except NoFeasiblePath:
        return False
    return True


@pytest.mark.slow
def test_each_relaxation_is_just_enough():
    rng = np.random.default_rng(41)
    closed = 0
    for _ in range(300):
        q, start, o = naive.random_instance(rng, layers=(3, 8), size=(1, 8))
        o = {k: o[k] for k in ("dt", "velocity", "acceleration", "endless", "eta_v", "eta_a")}
        if is_feasible(q, start, **o):
            continue
        closed += 1
        least = least_relaxations(q, start, **o)
        # (5) and (6) grant 1e-9 rad; a share changed by a thousandth is far more than that.
        for name, value in (("eta_v", least.eta_v), ("eta_a", least.eta_a), ("dt", least.dt)):
            if value is None:
                assert not is_feasible(q, start, **(o | {name: 1.9 if name == "eta_v" else 1e6}))
                continue
            assert value > o[name]
            assert is_feasible(q, start, **(o | {name: value * (1 + 1e-6)}))
            assert not is_feasible(q, start, **(o | {name: value * (1 - 1e-3)}))
    assert closed > 50


def test_what_is_open_already_needs_nothing_more():
    q = [[0.0], [0.1], [0.3]]
    least = least_relaxations(
        q, [0, 1, 2, 3], dt=1.0, velocity=[1.0], acceleration=[1.0], eta_v=1.0
    )
    assert least.eta_v == pytest.approx(0.2)
    assert least.eta_a == pytest.approx(0.1)
    assert least.dt == pytest.approx(np.sqrt(0.1))


def test_an_empty_layer_cannot_be_opened():
    with pytest.raises(NoFeasiblePath, match="layer 1 is empty"):
        least_relaxations([[0.0], [0.1]], [0, 1, 1, 2], dt=1.0, velocity=[1.0], acceleration=[1.0])
