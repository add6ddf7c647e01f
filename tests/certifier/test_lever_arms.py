"""Bounds from lever arms: no motion that an arm makes costs less, whatever the arm."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from kerfpath import Contour, Plan, PlanOptions, Tilt, robot
from kerfpath.certifier import certify
from kerfpath.certifier.bound import bound_steps
from kerfpath.certifier.lever_arms import _lever_arms, _turning, lever_bounds
from kerfpath.plans import Proof
from kerfpath.robots import Arm, Robot, RobotLimits, chain_of
from kerfpath.urdf import KinematicChain

TRAVEL = {"lower": -1.0, "upper": 1.0, "velocity": 1.0, "acceleration": 5.0}
DT, NODES = 0.05, 120


def rated(arm):
    """An arm with limits of some size where it has none."""
    n = arm.arm.joints
    return arm.with_limits(
        lower=np.full(n, -3.0), upper=np.full(n, 3.0), velocity=np.linspace(1.5, 4.0, n),
        acceleration=np.full(n, 20.0),
    )  # fmt: skip


def any_chain(seed):
    """A six-axis arm whose axes stand anyhow."""
    rng = np.random.default_rng(seed)
    origins = np.tile(np.eye(4), (6, 1, 1))
    origins[:, :3, :3] = Rotation.random(6, rng=rng).as_matrix()
    origins[:, :3, 3] = rng.uniform(-0.4, 0.4, (6, 3))
    end = np.eye(4)
    end[:3, 3] = rng.uniform(-0.2, 0.2, 3)
    axes = Rotation.random(6, rng=rng).as_matrix()[:, 0]
    chain = KinematicChain(origins=origins, axes=axes, end=end)
    return Robot(
        id=f"any-{seed}",
        arm=Arm(kinematics="general", geometry={}, chain=chain),
        limits=RobotLimits(),
    )


FIVE = Robot(
    id="five",
    arm=Arm(
        kinematics="five",
        geometry={"a1": 0.3, "a2": -0.1, "b": 0.05, "c1": 0.7, "c2": 0.9, "c3": 0.8, "c4": 0.12},
    ),
    limits=RobotLimits(),
)
OPW = rated(robot("abb_irb4600_60_205"))
ARMS = {
    "opw": OPW,
    "ur": rated(robot("ur_10e")),
    "seven": rated(robot("kuka_lbr_iiwa14_r820")),
    "five": rated(FIVE),
    "any 1": rated(any_chain(1)),
    "any 2": rated(any_chain(2)),
    "rail": OPW.on_rail([1.0, 1.0, 0.0], **TRAVEL),
    "table": OPW.with_positioner([0.0, 0.2, 1.0], [1.2, 0.1, 0.3], **TRAVEL),
    "rail and table": OPW.on_rail([1.0, 0.0, 0.0], **TRAVEL).with_positioner(
        [0.0, 0.0, 1.0], [1.2, 0.1, 0.3], **TRAVEL
    ),
}


def motion(arm, seed, **options):
    """A plan that is any motion of an arm, with the path that its tool follows."""
    rng = np.random.default_rng(seed)
    most = arm.velocity_limits() * DT
    share = rng.uniform(-1, 1, (NODES - 1, arm.joints)) * rng.uniform(0, 1, (NODES - 1, 1))
    still = rng.random(share.shape) < 0.4
    still[np.arange(len(still)), rng.integers(arm.joints, size=len(still))] = False
    share[still] = 0.0
    start = rng.uniform(-0.5, 0.5, arm.joints)
    q = np.sin(np.concatenate([start[None], start + np.cumsum(share * most, axis=0)]))
    tool = np.eye(4)
    tool[:3, :3] = Rotation.random(rng=rng).as_matrix()
    tool[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    tips = arm.forward(q) @ tool
    return Plan(
        contour=Contour(tips[:, :3, 3], tips[:, :3, 2], closed=False, name="any"),
        robot=arm, T_flange_tip=tool, T_base_part=np.eye(4), q=q, gamma=np.zeros(NODES),
        posture=np.zeros(NODES, int), turn=np.zeros((NODES, arm.joints), int),
        time=DT * np.arange(NODES), settings=PlanOptions(**options), cost=1.0,
        proof=Proof(optimal=False, statement="any motion"), counts={},
    )  # fmt: skip


def costs(made):
    weighted = np.abs(made.increments) * made.settings.weights
    return {
        "manhattan": weighted.sum(axis=1),
        "euclid": np.linalg.norm(weighted, axis=1),
        "chebychev": weighted.max(axis=1),
    }[made.settings.metric]


@pytest.mark.parametrize("metric", ["manhattan", "euclid", "chebychev"])
@pytest.mark.parametrize("name", ARMS)
def test_no_step_of_any_motion_costs_less(name, metric):
    for seed in range(8):
        made = motion(ARMS[name], seed, metric=metric)
        least, real = lever_bounds(made, bound_steps(made)), costs(made)
        assert (least <= real + 1e-12).all()  # rounding of sums of numbers up to 10
        assert least.sum() > 0.05 * real.sum()


@pytest.mark.parametrize("name", ["seven", "any 1", "rail and table"])
def test_with_a_tilt_the_axis_may_be_off_at_both_ends(name):
    asked = Tilt(cone=0.05)
    made = motion(ARMS[name], 3)
    tilted = motion(ARMS[name], 3, tilt=asked)
    assert (
        lever_bounds(tilted, bound_steps(tilted)) <= lever_bounds(made, bound_steps(made))
    ).all()


def test_it_is_the_least_cost_that_the_lever_arms_allow():
    """The tip alone: with one row the dual is exact, against a linear program for each step."""
    made = motion(ARMS["seven"], 1)
    steps = bound_steps(made)
    chain = chain_of(made.robot)
    tool = chain.end @ made.T_flange_tip
    arms, turning = _lever_arms(made, steps, chain, tool, 0.0), _turning(chain, tool)
    least = lever_bounds(made, steps)
    moved = np.linalg.norm(np.diff(made.contour.points, axis=0), axis=1)
    for k in range(0, NODES - 1, 7):
        tip = linprog(steps.weight, A_ub=-arms[k][None], b_ub=[-moved[k]]).fun
        assert least[k] >= tip * (1 - 1e-9)  # the tolerance of the solver
    assert (turning <= 1).all()


@pytest.mark.parametrize("name", ["seven", "five", "any 1"])
@pytest.mark.parametrize("objective", ["sum", "max"])
def test_every_arm_has_a_bound_and_it_says_what_it_rests_on(name, objective):
    made = motion(ARMS[name], 5, objective=objective)
    real = costs(made)
    cost = float(real.max() if objective == "max" else real.sum())
    found = certify(replace(made, cost=cost))
    assert 0 < found.plan.proof.bound < cost
    assert found.plan.proof.certificate is None
    assert found.statement.endswith(
        "the bound takes only lever arms into account, has no certificate"
    )
