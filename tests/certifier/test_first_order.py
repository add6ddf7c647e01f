"""What stages without (6) cannot exceed, and that they end where more work gains little."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Contour, NoFeasiblePath, PlanOptions, plan, robot
from kerfpath.certifier import certify
from kerfpath.certifier.bound import bound_steps
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.first_order import FirstOrder
from kerfpath.robots import lowest_joint

LAST = 5
"""The joint that alone turns the tool about a beam on the flange axis."""


@pytest.fixture(scope="module")
def hole():
    """Give plans of a hole in a plate before a UR10, its beam on the flange axis, by posture."""
    t = np.linspace(0, 2 * np.pi, 2001)
    points = np.c_[0.016 * np.cos(t), 0.016 * np.sin(t), 0 * t]
    nodes = Contour(points, np.tile([0.0, 0.0, -1.0], (2001, 1)), closed=True).resample(count=60)
    arm = robot("ur_ur10", acceleration_ratio="cybertech_8_to_20kg")
    tool, place = np.eye(4), np.eye(4)
    tool[2, 3], place[:3, 3] = 0.15, [0.56, -0.09, 0.1]

    def planned(posture, **options):
        asked = PlanOptions(gamma_step=np.radians(10), certify=None, postures=(posture,), **options)
        return plan(nodes, arm, tool=tool, placement=place, speed=0.05, options=asked)

    return planned


def free(made):
    """Return a plan as if it might use every posture."""
    return replace(made, settings=replace(made.settings, postures=None))


def costs_by_posture(made):
    """Return what the best motion in each posture costs: the last joint stays as it is."""
    maker, nodes = CellMaker(made.robot, made.frames, made.T_flange_tip), np.arange(len(made.q))
    costs = []
    for posture in range(made.robot.postures):
        q, _, reached = maker.joints(nodes, np.zeros(len(nodes)), posture)
        assert reached.all()
        dq = np.diff(q[:, :LAST], axis=0)
        dq -= 2 * np.pi * np.rint(dq / (2 * np.pi))
        costs.append(float((np.abs(dq) * made.settings.weights[:LAST]).sum()))
    return costs


def test_a_bound_comes_close_to_the_best_posture_and_ends_there(hole):
    """The plan is in a dear posture, so that no work closes the gap."""
    made = free(hole(0))
    costs = costs_by_posture(made)
    assert made.cost == pytest.approx(costs[0], rel=1e-6)
    assert min(costs) < 0.95 * made.cost
    found = certify(made, checkable=False)
    proof = found.plan.proof
    assert not found.done
    assert proof.bound <= min(costs)
    assert proof.gap - (made.cost - min(costs)) / made.cost < 0.1 * proof.gap
    longer = certify(made, checkable=False, most=1e9)
    assert (longer.pairs, longer.plan.proof.bound) == (found.pairs, proof.bound)


def test_more_work_never_lowers_the_bound_of_any_plan(hole, plans):
    for made in (free(hole(0)), plans(), plans(metric="chebychev")):
        before = -np.inf
        for most in (1e3, 1e5, 1e6):
            bound = certify(made, checkable=False, most=most).plan.proof.bound
            assert before <= bound <= made.cost
            before = bound


def test_no_bound_is_above_the_cheapest_motion_known(plans):
    """Known motions keep (5) and cost at least any bound, also one that a stage has proved."""
    for metric in ("manhattan", "euclid", "chebychev"):
        made = plans(metric=metric)
        maker = CellMaker(made.robot, made.frames, made.T_flange_tip, made.settings.postures)
        steps, layers = bound_steps(made), np.array([0, 10, 20, len(made.q) - 1])
        known = FirstOrder(maker, steps, len(made.q) - 1)
        known.look_about(layers, np.arange(made.robot.postures))
        straight, motion = known.cheapest(layers)
        assert straight <= motion.cost + 1e-9
        assert motion.cost == known.ceiling
        assert (np.abs(motion.increments) <= steps.velocity).all()
        q, _, _ = maker.joints(np.arange(len(made.q)), motion.gamma, int(made.posture[0]))
        assert motion.cost == pytest.approx(steps.distance(np.diff(q, axis=0)).sum(), rel=1e-9)
        assert motion.cost < 1.01 * made.cost  # the plan also keeps (6)
        assert certify(made, checkable=False).plan.proof.bound <= known.ceiling


def test_cells_below_the_floor_hold_no_motion_above_it(hole):
    """None that is left out holds a joint value above the floor, and the bound holds above it."""
    made = free(hole(0))
    floor = 0.0
    asked = replace(made, settings=replace(made.settings, floor=floor))
    cheaper, bound = [], certify(asked, checkable=False).plan.proof.bound
    assert bound > certify(made, checkable=False).plan.proof.bound
    for posture in range(made.robot.postures):
        try:
            cheaper.append(hole(posture, floor=floor).cost)
        except NoFeasiblePath:
            continue
    assert 0.9 * min(cheaper) < bound <= min(cheaper)
    task, nodes = (made.robot, made.frames, made.T_flange_tip), np.arange(0, 60, 20)
    every, kept = CellMaker(*task).coarsest(nodes), CellMaker(*task, floor=floor).coarsest(nodes)
    names = set(_names(kept))
    out = np.array([name not in names for name in _names(every)])
    assert 0 < out.sum() < len(out)
    left = every.take(out)
    draw = np.random.default_rng(3)
    for _ in range(5):
        t = draw.uniform(-1, 1, (len(left), 1)) * left.half[:, None]
        q = left.center + left.slope * t + left.bend * t**2 / 2
        assert (lowest_joint(made.robot, q) < floor).all()


def _names(cells):
    return list(zip(cells.node.tolist(), cells.posture.tolist(), cells.index.tolist(), strict=True))
