"""A bound for any arm: how far the joints must move at least to carry the tool along the path.

A joint that turns by u moves a point of the tool by no more than u times its lever arm, the
distance of the point from its axis, and turns the tool axis by no more than u; a joint that slides
by u moves the point by u. Points on the tool axis, the tip among them, are known at every node, and
so is the axis. If they are c_i further at the next node, the increments keep

    sum over j of L_ij |u_j| >= c_i,

and for any shares a_i >= 0 the step costs at least sum of a_i c_i / rho*(sum of a_i L_i), where
rho* is the norm dual to the metric rho. This asks neither for postures nor for gamma, and is loose.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from kerfpath.arrays import Array
from kerfpath.certifier.stages import Steps
from kerfpath.kernels.metric import CHEBYCHEV, EUCLID
from kerfpath.plans import Plan
from kerfpath.robots import chain_of
from kerfpath.urdf import KinematicChain

PARTS = 12
"""Shares that are tried are multiples of one over this; each of them gives a bound."""


def lever_bounds(plan: Plan, steps: Steps) -> Array:
    """Return the least cost (K - 1,) of each step of any motion along the contour of a plan."""
    chain = chain_of(plan.robot)
    tool = chain.end @ plan.T_flange_tip
    backs = [0.0, float(-tool[:3, 3] @ tool[:3, 2])]  # the tip; what is nearest to the last joint
    points, axes = plan.contour.points, plan.contour.axes
    crossed = np.linalg.norm(np.cross(axes[:-1], axes[1:]), axis=1)
    turned = np.arctan2(crossed, (axes[:-1] * axes[1:]).sum(axis=1))
    if plan.settings.tilt is not None:  # with an axis that is not known
        turned, backs = np.maximum(turned - 2 * plan.settings.tilt.cone, 0.0), backs[:1]
    moved, arms = [turned], [np.tile(_turning(chain, tool), (len(turned), 1))]
    for back in backs:
        lever = _lever_arms(plan, steps, chain, tool, back)
        longest = lever.max(axis=1)
        way = np.linalg.norm(np.diff(points + back * axes, axis=0), axis=1)
        moved.append(way / longest)
        arms.append(lever / longest[:, None])
    best = np.zeros(len(turned))
    for parts in product(range(PARTS + 1), repeat=len(moved)):
        if sum(parts) == PARTS:
            gained = sum(a * c for a, c in zip(parts, moved, strict=True))
            slopes = sum(a * each for a, each in zip(parts, arms, strict=True))
            best = np.maximum(best, gained / _dual(np.asarray(slopes), steps))
    return best


def _turning(chain: KinematicChain, tool: Array) -> Array:
    """Return by how much each joint (n,) turns the tool axis at most, as a share of its turn.

    `tool` is the pose (4, 4) m of the tip in the frame of the last joint.
    """
    turning = np.empty(chain.joints)
    turning[chain.order] = ~chain.slides
    turning[len(chain.axes) - 1] = np.linalg.norm(np.cross(chain.axes[-1], tool[:3, 2]))
    return turning


def _lever_arms(plan: Plan, steps: Steps, chain: KinematicChain, tool: Array, back: float) -> Array:
    """Return bounds (K - 1, n) m on the lever arms of a point of the tool axis, beyond the tip.

    They hold all along a straight motion of the joints from node to node; such a motion need not be
    run, the argument takes it. On it the point leaves its chord by no more than an eighth of the
    longest lever arm times the square of what all joints turn.
    """
    arms = np.empty(chain.joints)
    arms[chain.order] = chain.reach(chain.joints, (tool[:3, 3] + back * tool[:3, 2])[None])
    every = np.tile(arms, (len(plan.q) - 1, 1))
    if plan.robot.externals:
        return every
    # Axis 1 stands still and axis 2 goes round it, so the path says how far the point is from them.
    points = plan.points + (back * plan.contour.axes) @ plan.T_base_part[:3, :3].T
    along = chain.origins[0][:3, :3] @ chain.axes[0]
    first, second = chain.origins[0][:3, 3], (chain.origins[0] @ chain.origins[1])[:3, 3]
    foot = first + ((second - first) @ along) * along
    from_first = np.linalg.norm(np.cross(points - foot, along), axis=1)
    from_second = np.linalg.norm(points - foot, axis=1) + np.linalg.norm(second - foot)
    away = np.stack([from_first, from_second], axis=1)
    bulge = arms.max() * steps.velocity.sum() ** 2 / 8
    every[:, :2] = np.minimum(every[:, :2], np.maximum(away[:-1], away[1:]) + bulge)
    return every


def _dual(slopes: Array, steps: Steps) -> Array:
    """Return the norm (K,) dual to the metric of slopes (K, n); infinite where a joint is free."""
    by_cost = np.full_like(slopes, np.inf)
    np.divide(slopes, steps.weight, out=by_cost, where=steps.weight > 0)
    by_cost[slopes == 0] = 0.0
    if steps.metric == EUCLID:
        return np.asarray(np.linalg.norm(by_cost, axis=1))
    return np.asarray(by_cost.sum(axis=1) if steps.metric == CHEBYCHEV else by_cost.max(axis=1))
