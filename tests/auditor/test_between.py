"""Between the nodes nothing hides from the audit: not in joints and speeds, not from collisions."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Contour, Plan
from kerfpath.auditor import chain_of, checks
from kerfpath.auditor.between import HIDDEN_ANGLE, HIDDEN_SPEED, bound_between_nodes
from kerfpath.auditor.collision import HIDDEN, collision_along
from kerfpath.auditor.motion import follow, motion_of, straight
from kerfpath.cell import CuttingHead, box, cell_of
from kerfpath.options import PlanOptions
from kerfpath.plans import Proof

DENSE = 2000
"""Samples of an interval that stand for all of it: 16 times as dense as the audit's own begin."""


def plan_of(arm, tool, q, seconds):
    """Return a plan whose nodes are joints q (K, n), so many seconds apart."""
    T = chain_of(arm).forward(np.asarray(q)) @ tool
    n = arm.joints
    return Plan(
        contour=Contour(T[:, :3, 3], T[:, :3, 2]),
        robot=arm,
        T_flange_tip=tool,
        T_base_part=np.eye(4),
        q=q,
        gamma=np.zeros(len(q)),
        posture=np.zeros(len(q), int),
        turn=np.zeros((len(q), n), int),
        time=seconds * np.arange(len(q)),
        settings=PlanOptions(gamma_step=0.1, frames="tangent", weights=np.ones(n)),
        cost=0.0,
        proof=Proof(optimal=False, statement=""),
        counts={},
    )  # fmt: skip


def dense(plan):
    """Return joints (DENSE, n) along the first straight move of a plan, and speeds per interval."""
    chain = chain_of(plan.robot)
    chain = replace(chain, tip=chain.tip @ plan.T_flange_tip)
    poses = chain.forward(plan.q)
    f = np.linspace(0, 1, DENSE)
    wanted = straight(poses[:1], poses[1:2], np.zeros(DENSE, int), f)
    near, here = [], plan.q[:1]
    for i in range(0, DENSE, 20):  # one after the other, so that the branch is kept
        here, _ = follow(chain, wanted[i : i + 1], here)
        near.append(here[0])
    guess = np.stack(
        [np.interp(np.arange(DENSE) / 20, range(len(near)), c) for c in zip(*near, strict=True)],
        axis=1,
    )
    q, missed = follow(chain, wanted, guess)
    assert missed.max() < 1e-6
    return q, np.abs(np.diff(q, axis=0)) * (DENSE - 1)


@pytest.mark.parametrize("seed", range(12))
def test_no_joint_goes_farther_or_faster_than_the_audit_says(arm, tool, seed):
    rng = np.random.default_rng(seed)
    q0 = np.array([0.1, 0.2, 0.1, 0.3, 0.0, 0.1]) + rng.normal(0, 0.2, 6)
    q0[4] = rng.choice([-1, 1]) * rng.uniform(0.01, 1.2)  # some near the singularity of the wrist
    plan = plan_of(arm, tool, np.array([q0, q0 + rng.normal(0, 0.05, 6)]), 0.2)
    found = bound_between_nodes(
        plan, chain_of(arm), motion_of(plan, chain_of(arm), "linear", 8), "linear"
    )
    if found.open.any():
        assert np.abs(q0[4]) < 0.3  # it says so itself, and only where the wrist is near straight
        return
    q, speed = dense(plan)
    limits = arm.lower, arm.upper
    over = np.maximum(limits[0] - q.min(axis=0), q.max(axis=0) - limits[1])
    said = np.maximum(limits[0] - found.low[0], found.high[0] - limits[1])
    assert (np.maximum(over, 0) <= np.maximum(said, 0) + HIDDEN_ANGLE).all()
    fast = 0.2 * arm.velocity
    hidden = np.maximum(found.speed[0], fast) + HIDDEN_SPEED * fast
    assert (speed.max(axis=0) <= hidden * (1 + 1e-3)).all()


def flip(arm, tool, off):
    """Return a plan of one interval: early in it the wrist passes its singularity within `off`.

    Joint 4 turns by half a turn between the first two of nine samples, and nearly nothing else
    happens.
    """
    chain = chain_of(arm)
    chain = replace(chain, tip=chain.tip @ tool)
    middle = np.array([0.1, 0.2, 0.1, 0.3, off, 0.1])
    T = chain.forward(middle[None])[0]
    axis = np.cross(*(chain.joints(middle[None])[i][0, :3, :3] @ chain.axes[i] for i in (4, 5)))
    q, at = [], 1 / 16
    for end in (0.0, 1.0):
        here = middle[None]
        for f in np.linspace(at, end, 200):
            pose = T.copy()
            pose[:3, :3] = Rotation.from_rotvec((f - at) * 0.6 * axis).as_matrix() @ T[:3, :3]
            pose[:3, 3] += (f - at) * 1e-3 * T[:3, 0]
            here, _ = follow(chain, pose[None], here)
        q.append(here[0])
    return np.array(q)


def test_a_wrist_that_swings_between_two_samples_is_seen(arm, tool):
    q = flip(arm, tool, 2e-3)
    # So slow that all eight parts keep the limit on the average, and the nodes do by far.
    plan = plan_of(arm, tool, q, 1.0)
    coarse = motion_of(plan, chain_of(arm), "linear", 8)
    average = (np.abs(np.diff(coarse.q, axis=1)) * 8).max() / arm.velocity[3]
    slow = plan_of(arm, tool, q, 1.05 * average)
    coarse = motion_of(slow, chain_of(arm), "linear", 8)
    shares = np.abs(np.diff(coarse.q, axis=1)) * 8 / slow.time[1] / arm.velocity
    assert shares.max() < 1
    table = {check.code: check for check in checks(slow)}
    assert table["velocity"].ok
    assert not table["velocity-between"].ok
    assert table["velocity-between"].value > 3  # the true peak, not the average of an eighth


def test_a_thin_bar_between_two_samples_is_hit(arm, tool):
    # Both ends and the seven samples between are clear of a bar; the way is not.
    q0 = np.array([0.0, 0.2, 0.1, 0.0, 0.6, 0.0])
    q1 = q0 + np.array([0.4, 0, 0, 0, 0, 0])
    steps = np.linspace(q0, q1, 9)
    tip = arm.forward((steps[3] + steps[4]) / 2)[:3, 3]
    for size in ([0.004, 0.004, 0.5], [0.004, 0.004, 0.004]):
        place = np.eye(4)
        place[:3, 3] = tip - np.array([0.0, 0.0, size[2] / 2 - 0.02])
        cell = cell_of(
            arm, tool=tool, head=CuttingHead(), fixtures={"bar": box(size, place)}, near_miss=1e-3
        )
        along = collision_along(cell, steps[:-1], steps[1:], np.arange(8), chain_of(arm))
        finest = np.linspace(q0, q1, 4001)
        nearest = (cell.required - cell.distances(finest)).max()
        worst = max(c.value for c in along if c.code.startswith("collision") and c.unit == "m")
        assert worst >= nearest - HIDDEN or worst > 0
        assert (worst > 0) == (nearest > 0)
