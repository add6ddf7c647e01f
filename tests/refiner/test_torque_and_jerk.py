"""The refinement under limits on torque and jerk: kept by the audit's dynamics, at little cost."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from tests.arms import arm_with_masses
from tests.refiner.test_refine import _distances, _limited, _margins, _moved, _random_model

from kerfpath import Contour, InputError, NoFeasiblePath, fastest_speed, pareto, plan, refine
from kerfpath.auditor import audit, checks
from kerfpath.dynamics import Load
from kerfpath.limits import JerkLimit, Limits, jerks_of, rates_of
from kerfpath.options import PlanOptions
from kerfpath.refiner.convex_program import solve
from kerfpath.refiner.joint_curves import JointCurves
from kerfpath.refiner.rates import LinearTorque, RateLimits
from kerfpath.retime import retime

STEP = np.radians(5)
SPEED = 0.3
LOAD = Load(mass=40.0, centre=(0.05, 0.0, 0.2))


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    sharp = np.radians([320, 270, 420, 1300, 1400, 2000])
    return arm_with_masses(folder, acceleration=sharp, endless=[0, 0, 0, 1, 0, 1])


@pytest.fixture(scope="module")
def made(circle, arm, tool, placement):
    """A refined plan under neither limit."""
    return plan(
        circle, arm, tool=tool, placement=placement, speed=SPEED, gamma_step=STEP, method="exact",
        refine=True,
    )  # fmt: skip


def needs(made, *, periodic=False):
    """Return the peak torques N m and jerks rad/s^3 that a plan asks its joints for."""
    limit = made.robot.with_limits(torque=np.ones(6)).with_load(LOAD).torque_limit()
    tau, q = np.diff(made.time), made.unwrapped
    _, a = rates_of(np.diff(q, axis=0), tau, periodic=periodic)
    # A joint that all but stands still may have what any robot has.
    jerk = np.maximum(np.abs(jerks_of(a, tau, periodic=periodic)).max(axis=0), 1.0)
    return np.abs(limit.shares(q, tau, periodic=periodic)).max(axis=0), jerk


def tightened(torque, share, joint):
    """Return torque limits with room for all joints but one (0-based), which lacks some."""
    limits = 1.3 * torque
    limits[joint] = share * torque[joint]
    return limits


def rows_of(made):
    return {row.code: row for row in checks(made)}


@pytest.mark.parametrize(("joint", "share"), [(1, 0.99), (0, 0.95), (5, 0.95)])
def test_a_plan_is_brought_inside_torque_limits(made, joint, share):
    torque, _ = needs(made)
    robot = made.robot.with_limits(torque=tightened(torque, share, joint)).with_load(LOAD)
    before = replace(made, robot=robot)
    assert rows_of(before)["torque"].value == pytest.approx(1 / share, rel=1e-6)
    assert not rows_of(before)["torque"].ok
    found = refine(before)
    assert found.done, found.statement
    # Judged by the audit's own dynamics.
    rows = rows_of(found.plan)
    assert rows["torque"].ok
    assert rows["torque"].value > 0.99
    assert all(row.ok for row in rows.values())
    # Close by, as the limits are.
    assert found.cost_after < made.cost * 1.05


@pytest.mark.parametrize("share", [0.97, 0.8])
def test_a_plan_is_brought_inside_jerk_limits(made, share):
    _, jerk = needs(made)
    before = replace(made, robot=made.robot.with_limits(jerk=jerk * share))
    assert rows_of(before)["jerk"].value == pytest.approx(1 / share, rel=1e-6)
    found = refine(before)
    assert found.done, found.statement
    rows = rows_of(found.plan)
    assert rows["jerk"].ok
    assert all(row.ok for row in rows.values())
    assert found.cost_after < made.cost * 1.05


def test_both_at_once_and_a_jerk_of_one_joint(made):
    torque, jerk = needs(made)
    one = np.full(6, np.inf)
    one[4] = 0.7 * jerk[4]
    robot = made.robot.with_limits(torque=tightened(torque, 0.97, 5), jerk=one).with_load(LOAD)
    found = refine(replace(made, robot=robot))
    assert found.done, found.statement
    rows = rows_of(found.plan)
    assert rows["torque"].ok
    assert rows["jerk"].ok
    assert "joint 5" in rows["jerk"].title


@pytest.mark.parametrize("periodic", [False, True])
def test_the_program_holds_torques_and_jerks_as_they_are_defined(periodic):
    """No point is better that keeps the definitions: against a general solver."""
    rng = np.random.default_rng(9)
    bound = 0
    for _ in range(6):
        model, rates = _random_model(rng, "manhattan")
        rates = replace(rates, periodic=periodic)
        tau, n = rates.tau, model.q.shape[1]
        before, after = rates.meetings

        def jerks(d, model=model, tau=tau):
            v = np.diff(_moved(model, d), axis=0) / tau[:, None]
            pairs = [(k, k + 1) for k in range(len(v) - 1)] + (
                [(len(v) - 1, 0)] if periodic else []
            )
            a = [(v[j] - v[i]) / ((tau[i] + tau[j]) / 2) for i, j in pairs]
            last = len(a) if periodic else len(a) - 1
            return np.array([(a[(m + 1) % len(a)] - a[m]) / tau[pairs[m][1]] for m in range(last)])

        still = np.zeros(len(model.q))
        linear = LinearTorque(
            rng.uniform(-0.9, 0.9, (len(after), n)),
            np.stack([before, after, after + 1]),
            rng.normal(0, 1, (3, len(after), n)),
        )
        jerk = JerkLimit(bound=np.abs(jerks(still)).max(axis=0) * 1.02)
        sharp = np.abs(rates.of(np.diff(model.q, axis=0))[1]).max(axis=0) * 1.05
        rates = replace(rates, limits=Limits.of(rates.limits.velocity.bound, sharp, jerk=jerk))
        model = replace(_limited(model, rates), torque=linear)

        def margins(d, model=model, rates=rates, jerk=jerk, linear=linear, jerks=jerks):
            share = linear.share + sum(
                linear.slope[i] * d[linear.column[i]][:, None] for i in range(3)
            )
            own = _margins(model, rates, d)
            return np.concatenate([
                own, (1 - np.abs(share)).ravel(), (jerk.bound - np.abs(jerks(d))).ravel()
            ])  # fmt: skip

        found = solve(model, rates, "sum")
        assert found is not None
        found = found[:, 0]
        assert margins(found).min() > -1e-7
        bound += margins(found)[-jerks(still).size - linear.share.size :].min() < 1e-6
        ends = {"type": "eq", "fun": lambda d: d[0] - d[-1]}
        other = minimize(
            lambda d, m=model: _distances(m, d).sum(), still, method="SLSQP",
            constraints=[{"type": "ineq", "fun": margins}] + ([ends] if periodic else []),
            options={"maxiter": 300},
        )  # fmt: skip
        if margins(other.x).min() > -1e-9:
            assert _distances(model, found).sum() <= other.fun + 1e-6
    assert bound >= 3  # they are what holds the optimum back


def test_jerks_are_third_differences():
    q = np.cumsum(np.random.default_rng(3).normal(size=(9, 2)), axis=0)
    tau = np.full(8, 0.1)
    _, a = rates_of(np.diff(q, axis=0), tau)
    np.testing.assert_allclose(jerks_of(a, tau), np.diff(q, 3, axis=0) / 1e-3, rtol=1e-9)
    # Of a cubic it is constant, whatever the intervals: t^3 has jerk 6 at nodes t = k.
    t = np.arange(9.0)
    _, a = rates_of(np.diff(t[:, None] ** 3, axis=0), np.ones(8))
    np.testing.assert_allclose(jerks_of(a, np.ones(8)), 6.0)
    # Across a seam as inside: the same three increments, turned round.
    closed = np.vstack([q, q[:1]])
    _, a = rates_of(np.diff(closed, axis=0), np.full(9, 0.1), periodic=True)
    all_round = jerks_of(a, np.full(9, 0.1), periodic=True)
    shifted = np.vstack([q[3:], q[:4]])
    _, a = rates_of(np.diff(shifted, axis=0), np.full(9, 0.1), periodic=True)
    again = jerks_of(a, np.full(9, 0.1), periodic=True)
    np.testing.assert_allclose(np.roll(all_round, -3, axis=0), again, rtol=1e-9)


@pytest.mark.parametrize("periodic", [False, True])
def test_the_linear_torques_are_tangents(made, periodic):
    torque, _ = needs(made)
    robot = made.robot.with_limits(torque=torque).with_load(LOAD)
    curves = JointCurves(robot, made.frames, made.T_flange_tip, made.posture)
    limits = Limits.of(*robot.speed_limits(), torque=robot.torque_limit())
    rates = RateLimits(tau=np.diff(made.time), limits=limits, periodic=periodic)
    q = made.unwrapped
    free = made.gamma[:, None]
    found = rates.linear_torque(q, curves.slope(free, q)[..., 0])
    np.testing.assert_allclose(found.share, rates.torque_share(q), rtol=1e-12)
    rng, h = np.random.default_rng(4), 1e-5
    delta = h * rng.uniform(-1, 1, len(q))
    delta[-1] = delta[0] if periodic else delta[-1]
    ahead, behind = (
        rates.torque_share(curves.at(free + sign * delta[:, None], q)) for sign in (1, -1)
    )
    change = found.at(delta) - found.share
    # Third derivatives over dt^2: the difference is good to a share of h^2.
    np.testing.assert_allclose(
        change, (ahead - behind) / 2, rtol=0, atol=1e-4 * np.abs(change).max()
    )


def test_a_closed_contour_keeps_them_across_its_seam(circle, arm, tool, placement):
    made = plan(
        circle, arm, tool=tool, placement=placement, speed=SPEED, gamma_step=STEP, method="exact",
        closure="periodic", refine=True,
    )  # fmt: skip
    torque, jerk = needs(made, periodic=True)
    robot = arm.with_limits(torque=tightened(torque, 0.97, 0), jerk=jerk * 0.97).with_load(LOAD)
    found = refine(replace(made, robot=robot))
    assert found.done, found.statement
    tau, q = np.diff(found.plan.time), found.plan.unwrapped
    assert np.abs(robot.torque_limit().shares(q, tau, periodic=True)).max() <= 1 + 1e-9
    _, a = rates_of(np.diff(q, axis=0), tau, periodic=True)
    assert (np.abs(jerks_of(a, tau, periodic=True)) <= robot.limits.jerk * (1 + 1e-9)).all()


@pytest.mark.slow
def test_what_cannot_be_brought_inside_is_said(made):
    torque, jerk = needs(made)
    weak = made.robot.with_limits(torque=torque * [1, 0.3, 1, 1, 1, 1]).with_load(LOAD)
    found = refine(replace(made, robot=weak))
    assert not found.done
    assert "the torque of joint 2 at node" in found.statement
    soft = made.robot.with_limits(jerk=jerk * 1e-3)
    found = refine(replace(made, robot=soft))
    assert not found.done
    assert "the jerk of joint" in found.statement


def test_plans_of_the_grid_keep_torque_limits_and_are_the_best(circle, arm, tool, placement):
    here = {"tool": tool, "placement": placement, "speed": SPEED, "gamma_step": STEP}
    free = plan(circle, arm, method="exact", **here)
    torque, _ = needs(free)
    wide, tight = (
        plan(circle, arm.with_limits(torque=limits).with_load(LOAD), method="exact", **here)
        for limits in (torque * 1.001, tightened(torque, 0.999, 5))
    )
    for each in (wide, tight):
        assert audit(each) == []
        assert each.proof.optimal
        assert "under the velocity, acceleration and torque limits" in each.proof.statement
    # What the free path keeps is the best; what it does not keep costs something.
    assert wide.cost == free.cost < tight.cost


@pytest.mark.parametrize("method", ["exact", pytest.param("continuous", marks=pytest.mark.slow)])
def test_plans_off_the_grid_keep_both(circle, made, arm, tool, placement, method):
    torque, jerk = needs(made)
    here = {"tool": tool, "placement": placement, "speed": SPEED, "gamma_step": STEP}
    limits = {"torque": tightened(torque, 0.99, 1), "jerk": jerk * 0.97}
    limited = arm.with_limits(**limits).with_load(LOAD)
    found = plan(circle, limited, method=method, refine=True, **here)
    assert audit(found) == []
    rows = rows_of(found)
    assert rows["torque"].value > 0.9
    assert rows["jerk"].value > 0.9
    # The motion without them, found in the same way, costs less, but for the gain below which a
    # refinement ends.
    free = plan(circle, arm, method=method, refine=True, **here)
    assert found.cost >= free.cost * (1 - 1e-2)


@pytest.mark.slow
def test_where_no_motion_keeps_them_that_is_the_answer(circle, made, arm, tool, placement):
    torque, jerk = needs(made)
    here = {"tool": tool, "placement": placement, "speed": SPEED, "gamma_step": STEP}
    weak = arm.with_limits(torque=torque * 0.2).with_load(LOAD)
    with pytest.raises(NoFeasiblePath, match="torque, joint"):
        plan(circle, weak, method="exact", **here)
    soft = arm.with_limits(jerk=jerk * 1e-3)
    with pytest.raises(NoFeasiblePath, match="no motion was found within the jerk limits"):
        plan(circle, soft, method="exact", refine=True, **here)


def test_what_does_not_hold_them_refuses(circle, arm, tool, placement):
    here = {"tool": tool, "placement": placement, "gamma_step": STEP}
    loaded, smooth = arm.with_load(LOAD), arm.with_limits(jerk=np.full(6, 100.0))
    for robot, what in ((loaded, "torque"), (smooth, "jerk")):
        for method in ("paper", "known"):
            with pytest.raises(InputError, match=f'{what}: a limit needs method "continuous" or'):
                plan(circle, robot, speed=0.2, method=method, **here)
        with pytest.raises(InputError, match=f'{what}: a limit needs feed "constant", got "dip"'):
            plan(circle, robot, speed=0.2, feed="dip", **here)
        with pytest.raises(InputError, match=f"the fastest speed: .* has limits on {what}"):
            fastest_speed(circle, robot, **here)
        with pytest.raises(InputError, match=f"the Pareto set: .* has limits on {what}"):
            pareto(circle, robot, speed=0.2, **here)
    with pytest.raises(InputError, match="jerk: only the refinement keeps a limit"):
        plan(circle, smooth, speed=0.2, method="exact", **here)


def test_times_are_not_stretched_under_limits_that_are_not_known(arm):
    for robot in (arm.with_load(LOAD), arm.with_limits(jerk=np.full(6, 100.0))):
        with pytest.raises(InputError, match="retime: supports limits on velocity and acceler"):
            retime(np.full((5, 6), 0.01), 0.1, PlanOptions().limits(robot))


def test_few_nodes_have_no_jerk(arm, tool, placement):
    """Three nodes have one acceleration, and nothing that it changes to."""
    short = Contour([[0, 0, 0], [0.01, 0, 0], [0.02, 0, 0]], [[0, 0, -1]] * 3)
    robot = arm.with_limits(jerk=np.full(6, 1e-3)).with_load(LOAD)
    made = plan(short, robot, tool=tool, placement=placement, speed=0.1, gamma_step=STEP)
    assert "jerk" not in rows_of(made)
    assert rows_of(made)["torque"].ok
