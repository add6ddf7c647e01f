"""Joints of a wide range are sought on one turn, and their motion is put on turns within it."""

import numpy as np
import pytest

import kerfpath
from kerfpath import Contour, NoFeasiblePath, plan
from kerfpath.auditor import checks
from kerfpath.planner import folds, layered_graph, planning
from kerfpath.plans import Plan

STEP, SPEED = np.radians(15), 0.05


def ring(radius: float, loops: float, nodes: int) -> Contour:
    t = np.linspace(0, 2 * np.pi * loops, nodes)
    points = np.c_[radius * np.cos(t), radius * np.sin(t), 0 * t]
    return Contour(points, np.tile([0.0, 0, -1], (nodes, 1)), name="ring")


@pytest.fixture(scope="module")
def ur() -> kerfpath.Robot:
    return kerfpath.robot("ur_ur10", acceleration_ratio="cybertech_8_to_20kg")


def at(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def test_a_folded_search_finds_the_cost_of_all_turns(ur, monkeypatch):
    asked = {"tool": at(0, 0, 0.15), "placement": at(0.6, 0.1, 0.1), "certify": None}
    asked |= {"gamma_step": STEP, "method": "exact", "refine": False, "speed": SPEED}
    one = ring(0.03, 1, 12)
    folded = plan(one, ur, **asked)
    joints = folds(ur, folded.settings, one.length / 11 / SPEED)
    assert joints.tolist() == [True, True, False, True, True, True]  # joint 3 turns 180 deg
    given = {name: asked[name] for name in ("tool", "placement", "gamma_step")}
    every = layered_graph(one, ur, **given)
    few = layered_graph(one, ur, fold=joints, **given)
    assert len(every.q) == 2**5 * len(few.q)
    np.testing.assert_array_equal(every.reason, few.reason)
    again = every.fold(joints)
    np.testing.assert_allclose(again.q, few.q, atol=1e-12)
    np.testing.assert_array_equal(again.posture, few.posture)
    for graph in (every, few):
        assert plan(one, ur, graph=graph, **asked).cost == pytest.approx(folded.cost, rel=1e-9)
    monkeypatch.setattr("kerfpath.planner.task.folds", lambda robot, *_: np.zeros(6, bool))
    whole = plan(one, ur, graph=every, **asked)
    assert folded.cost == pytest.approx(whole.cost, rel=1e-9)
    assert all(check.ok for check in checks(folded))
    assert (np.abs(folded.q[:, joints].mean(axis=0)) <= np.pi).all()  # furthest from the limits


def around(robot: kerfpath.Robot, loops: float, **more: object) -> Plan:
    """Plan a ring around the foot of a robot, so that joint 1 winds as often."""
    asked = {"tool": at(0, 0, 0.15), "placement": at(0, 0, 0.1), "certify": None}
    nodes = int(40 * loops) + 1
    asked |= {"gamma_step": STEP, "method": "exact", "refine": False, "postures": ["front/up/plus"]}
    return plan(ring(0.6, loops, nodes), robot, speed=0.2, **asked, **more)


@pytest.mark.parametrize(("degrees", "loops"), [(360, 1.5), (360, 1.2), (300, 1.2)])
def test_a_motion_that_winds_is_put_within_the_range(ur, degrees, loops):
    lower, upper = ur.lower.copy(), ur.upper.copy()
    lower[0], upper[0] = np.radians([-degrees, degrees])
    arm = ur.with_limits(lower=lower, upper=upper)
    made = around(arm, loops)
    assert np.ptp(made.q[:, 0]) == pytest.approx(2 * np.pi * loops, abs=0.5)
    assert made.q[:, 0].min() >= lower[0]
    assert made.q[:, 0].max() <= upper[0]
    assert all(check.ok for check in checks(made))


def test_what_winds_further_than_its_range_is_refused(ur, monkeypatch):
    tried = []
    before = planning.planning_task
    monkeypatch.setattr(
        planning,
        "planning_task",
        lambda *a, **k: (tried.append(k["unfold"].tolist()), before(*a, **k))[1],
    )
    with pytest.raises(NoFeasiblePath):
        around(ur, 2.5)
    assert [unfold[0] for unfold in tried] == [False, True]
