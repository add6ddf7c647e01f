"""How long a run takes: against a linear program over the same samples, and known motions."""

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

from kerfpath import plan
from kerfpath.execution import executed, timing_of
from kerfpath.post import build_program

SPEED = 0.3


@pytest.fixture(scope="module")
def made(circle, arm, tool, placement):
    return plan(circle, arm, tool=tool, placement=placement, speed=SPEED, certify=None)


def run_of(made, **options):
    (run,) = executed(build_program([made], **options))
    return run


def by_linear_program(run, arm, eta_a):
    """Return the largest squares of the pace at the samples, all of them together.

    Of two that keep the limits the larger at each sample keeps them too, so that one is largest
    everywhere, and the sum finds it.
    """
    velocity, acceleration = arm.speed_limits()
    first, second = run.velocity_share * velocity, run.acceleration_share * acceleration
    m, n = first.shape
    step = 2 * np.repeat(np.diff(run.time), n)
    row, at = np.arange((m - 1) * n), np.repeat(np.arange(m - 1), n)
    f, s = first[:-1].ravel(), second[:-1].ravel()
    A = sparse.csr_array(
        (np.r_[s - f / step, f / step], (np.r_[row, row], np.r_[at, at + 1])),
        shape=((m - 1) * n, m),
    )
    most = np.minimum(1.0, ((velocity / np.abs(first)) ** 2).min(axis=1))
    most[[0, -1]] = 0.0
    found = linprog(
        -np.ones(m),
        A_ub=sparse.vstack([A, -A]),
        b_ub=np.tile(eta_a * acceleration, 2 * (m - 1)),
        bounds=np.c_[np.zeros(m), most],
    )
    assert found.status == 0
    return found.x


@pytest.mark.parametrize("eta_a", [1.0, 0.3, 0.05])
def test_no_pace_within_the_limits_is_faster(made, arm, eta_a):
    run = run_of(made)
    timing = timing_of(run, eta_a=eta_a)
    best = by_linear_program(run, arm, eta_a)
    # Steps are finite: where the limits change fast the last digits of one step depend on it.
    np.testing.assert_allclose(timing.share**2, best, rtol=0, atol=1e-6 if eta_a > 0.1 else 1e-2)
    pace = np.sqrt(best)
    seconds = (np.diff(run.time) * 2 / (pace[1:] + pace[:-1])).sum()
    assert timing.seconds == pytest.approx(seconds, rel=1e-3)
    assert timing.seconds > timing.programmed


def test_limits_that_bind_slow_it_down_and_say_where(made, arm):
    run = run_of(made)
    free = timing_of(run)
    assert free.held == 1.0
    assert free.slowest[0] > 0.99
    assert free.seconds < free.programmed + 0.2  # the ramps
    peak = run.peak_acceleration
    tight = timing_of(run, eta_a=0.7 * peak.share)
    assert tight.held < 1
    share, at = tight.slowest
    assert share < 0.95
    assert tight.seconds > free.seconds
    inside = np.where(tight.under_way, tight.share, np.inf)
    assert at == tight.length[np.argmin(inside)]


def test_velocity_alone_leaves_its_share(made, arm):
    run = run_of(made)
    share = 0.8 * run.peak_velocity.share
    timing = timing_of(run, eta_v=share, eta_a=1e6)
    most = np.minimum(1, share / np.abs(run.velocity_share).max(axis=1))
    np.testing.assert_allclose(timing.share[3:-3], most[3:-3], rtol=1e-6)
    assert most.min() < 0.81


def test_a_long_run_is_as_long_as_its_programmed_speeds_say(made, arm):
    timing = timing_of(run_of(made), eta_a=1e6)
    assert timing.seconds == pytest.approx(timing.programmed, rel=1e-2)
    assert timing.length[-1] == pytest.approx(made.contour.length, rel=1e-2)
