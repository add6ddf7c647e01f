"""refine(): move gamma and external axes of a plan off the grid; tilts and postures stay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from kerfpath.arrays import Array, scalar, short_repr
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.kernels.metric import wrap
from kerfpath.losses import Loss, Reason
from kerfpath.plans import Plan, Proof, directions, has_room, on_turns, path_cost
from kerfpath.refiner.descent import MOST_PROGRAMS, Descent, MotionState
from kerfpath.refiner.goals import Goal
from kerfpath.refiner.joint_curves import JointCurves, room_at_ends
from kerfpath.refiner.rates import KeptShares, RateLimits
from kerfpath.refiner.sections import has_sections, lowest_in_sections
from kerfpath.robots import lowest_joint
from kerfpath.search import rotation_limits
from kerfpath.windows import nearest_inside, room_beside

MOST_INTERVALS = 10
"""Most times that the interval is shortened; convergence to the least is quadratic."""
SAME_INTERVAL = 1e-4
"""Relative change of the interval below which it counts as the least."""

FIRST_STEPS = 2
"""Grid steps by which gamma may move in the first iteration; later steps adapt to the gain."""
REPAIR = 0.2
"""Estimated relative extra cost of a motion for each limit that it exceeds by once the limit."""
CLOSE = 3e-5
"""Relative cost above the lower bound up to which a motion is not refined further: a third of the
gain below which a descent ends."""
ON_EDGE = 1e-8
"""rad: by how much a motion on the edge of a range, as a grid has it, may be outside: rounding."""
SAME_NODE = 1e-6
"""m: a node of a finer contour counts as one of the plan's up to this distance."""


class Binding(NamedTuple):
    """The limit that binds: its kind, its joint (0-based) and its node."""

    joint: int
    node: int
    limit: Literal["velocity", "acceleration"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Refinement:
    """Result of a refinement.

    Parameters
    ----------
    plan : Plan
        The refined plan, or the original plan if `done` is False.
    done : bool
        Whether the refined plan keeps every limit by the true kinematics.
    cost_before, cost_after : float
        Objective of the original motion and of `plan`.
    programs : int
        Number of convex programs solved.
    statement : str
        What was done, or why it could not be done.
    """

    plan: Plan
    done: bool
    cost_before: float
    cost_after: float
    programs: int
    statement: str

    __repr__ = short_repr


def refine(
    plan: Plan,
    *,
    nodes: Contour | None = None,
    eta_v: float | None = None,
    eta_a: float | None = None,
    kept: KeptShares | None = None,
    first: float | None = None,
    within: tuple[Array, Array] | None = None,
    least: float = 0.0,
    most: int | None = None,
    goals: tuple[Goal, ...] = (),
) -> Refinement:
    """Move gamma of a plan off its grid, to a lower cost or within limits that the grid breaks.

    Sequential convex programming on the true kinematics. (5), (6), limits on torque and jerk, the
    ranges of joints and couplings and a periodic closure are hard constraints of every iteration. A
    motion is accepted only if it keeps all of them by the kinematics and the dynamics themselves,
    not only by the linear model. Where reversals cost and the plan keeps the limits, there are two
    descents, one of which turns no joint back where the plan does not; the better result counts.

    Parameters
    ----------
    plan : Plan
        It may break (5) or (6), for example after a change of eta; the limits are met first, if
        possible.
    nodes : Contour, optional
        The same contour with every interval divided into the same number of parts; the refined plan
        keeps (5) and (6) at the shorter time step.
    eta_v, eta_a : float, optional
        Share of the velocity and acceleration limits; default: the plan's.
    kept : KeptShares, optional
        Shares of the usable limits, in every interval and where two meet; default: all.
    first : float rad, optional
        Largest change of gamma in the first iteration, for a motion that is close to the best;
        default: two steps of the plan's grid.
    within : two of (K, 1 + E) rad or m, optional
        Least and largest gamma of each node, on the turn of the plan's gamma, and of its external
        axes.
    least : float
        Known lower bound on the cost of such motions; a motion that costs hardly more is not
        refined further.
    most : int, optional
        Convex programs after which a descent ends early; default: when it has converged.
    goals : tuple of Goal
        Criteria that take the place of the objective, each with a largest value; default: the
        objective. The costs of the result are then sums of their prices times themselves.

    Returns
    -------
    Refinement
        If it fails, `done` is False, `plan` is the original plan, and `statement` says why. A
        refined plan has no `approach` and no `retreat`: its ends may have moved.

    Raises
    ------
    InputError
        Nodes that do not divide the plan's intervals evenly, or values out of range.
    """
    settings = replace(
        plan.settings,
        eta_v=plan.settings.eta_v if eta_v is None else scalar(eta_v, "eta_v", above=0.0),
        eta_a=plan.settings.eta_a if eta_a is None else scalar(eta_a, "eta_a", above=0.0),
    )
    if not plan.robot.family.free_rotation:
        return _unrefined(plan, "the robot leaves no rotation free that could be refined")
    asked = replace(plan, settings=settings)
    if nodes is not None:
        divided = _divide_plan(asked, nodes)
        if isinstance(divided, str):
            return _unrefined(plan, divided)
        asked = divided
    comfort = plan.settings.comfort
    if comfort is not None and comfort.prices_clearance:
        return _unrefined(plan, "the cost of clearance is known on the grid only")
    descent, start = _descent(asked, kept, within=within, most=most, goals=goals)
    ways = [replace(descent, first=first)]
    if comfort is not None and comfort.prices_reversals and start.admitted:
        price = comfort.price_of_reversals(plan.robot)
        held = directions(np.diff(start.q, axis=0) / descent.rates.tau[:, None])
        ways.append(replace(ways[0], held=np.where(price > 0, held, 0.0)))
    found = [_moved(plan, asked, way, start, least) for way in ways]
    return min(found, key=lambda each: (not each.done, each.cost_after))


def _moved(
    plan: Plan, asked: Plan, descent: Descent, start: MotionState, least: float
) -> Refinement:
    """Return the refinement of a plan, asked with other settings, by a descent from a start."""
    settings, comfort = asked.settings, asked.settings.comfort
    found, programs = _lowest(descent, start, least)
    if found.admitted and not _room_kept(asked, found):
        descent = _ends_held(descent, start)
        found, programs = _lowest(descent, start, least)
    if not found.admitted:
        return _unrefined(plan, _closest(descent, found))
    refined = _plan_with_motion(asked, found)
    broken = [] if comfort is None else [*comfort.broken(plan.robot, refined.q, plan.T_flange_tip)]
    if settings.floor is not None and (lowest_joint(plan.robot, refined.q) < settings.floor).any():
        broken.append(Reason(Loss.FLOOR))
    if broken:
        return _unrefined(plan, f"off the grid it would break: {' and '.join(broken)}")
    grid_cost = plan.proof.grid_cost
    if grid_cost is None and start.admitted and plan.settings.method != "continuous":
        grid_cost = plan.cost
    proof = Proof(
        optimal=plan.proof.optimal and start.admitted and refined.cost <= (grid_cost or 0.0),
        statement=f"{refined.proof.statement}; {_describe(plan, asked, start, refined.cost)}",
        grid_cost=grid_cost,
    )
    return Refinement(
        plan=replace(refined, proof=proof),
        done=True,
        cost_before=start.cost,
        cost_after=found.cost if descent.goals else refined.cost,
        programs=programs,
        statement=proof.statement,
    )


def _lowest(descent: Descent, start: MotionState, least: float) -> tuple[MotionState, int]:
    """Return the best motion found, or the one that breaks the limits least; number of programs."""
    enough, programs = (1 + CLOSE) * least, 0
    if has_sections(descent, least):
        start, programs = lowest_in_sections(descent, start, enough)
        if start.admitted:
            return start, programs
    begun, more = descent.admitted(start)
    programs += more
    if not begun.admitted or begun.cost <= enough:
        return begun, programs
    found, more = descent.best(begun)
    return found, programs + more


def _room_kept(plan: Plan, found: MotionState) -> bool:
    """Return whether the tool can still back off at both ends after external axes have moved."""
    if plan.settings.retract is None or not plan.robot.free.size:
        return True  # the bounds on gamma ensure it
    ends = [0, -1]
    q, _ = on_turns(plan.robot, found.q)
    room = has_room(plan.settings, plan.robot, q[ends], plan.posture[ends], plan.T_flange_tip)
    return bool(room.all())


def _ends_held(descent: Descent, start: MotionState) -> Descent:
    """Return the descent with the external axes fixed at both ends to where they start."""
    low, high = descent.low.copy(), descent.high.copy()
    low[[0, -1], 1:] = high[[0, -1], 1:] = start.free[[0, -1], 1:]
    return replace(descent, low=low, high=high)


def promise(plan: Plan) -> float:
    """Return an estimate of the refined cost of a plan: its cost, plus a share for broken limits.

    It is by the true kinematics, and infinite if a node is out of reach or a joint out of range.
    """
    _, start = _descent(plan)
    return start.cost * (1 + REPAIR * start.lost) if start.outside <= 0 else np.inf


def reduce_excess(
    plan: Plan,
    *,
    within: tuple[Array, Array] | None = None,
    most: int | None = None,
    goals: tuple[Goal, ...] = (),
) -> Plan:
    """Return the plan with gamma moved so that it exceeds the limits little, at little cost.

    The excess of every interval and every node over the limits has a price on top of the cost.
    `within`, `most` and `goals` are as in `refine`.
    """
    descent, start = _descent(plan, within=within, most=most, goals=goals)
    return _plan_with_motion(plan, descent.with_reduced_excess(start))


def quicken(plan: Plan, *, most: int = MOST_INTERVALS) -> tuple[Plan, Binding] | None:
    """Return the plan with gamma moved for the least interval between nodes, and what binds there.

    All intervals change by the same factor, at most `most` times; once is nearly enough. The cost
    is not minimised. None if a node of the plan
    is out of reach in its posture, as a node between two samples may be, or if a joint or a
    coupling stays out of its range.
    """
    for _ in range(most):
        descent, start = _descent(plan)
        if start.outside == np.inf:
            return None
        found = descent.gentlest(start)
        fast, sharp = descent.rates.shares(found.q)
        shorter, binding = _binding(descent, fast, sharp)
        plan = replace(_plan_with_motion(plan, found), time=plan.time * shorter)
        if shorter > 1 - SAME_INTERVAL:
            break
    return None if found.outside > ON_EDGE else (plan, binding)


def _binding(descent: Descent, fast: Array, sharp: Array) -> tuple[float, Binding]:
    """Return the share of the interval that would be enough, and the limit that binds there."""
    velocity, acceleration = float(fast.max()), float(np.sqrt(sharp.max(initial=0.0)))
    if velocity >= acceleration:
        edge, joint = np.unravel_index(np.argmax(fast), fast.shape)
        return velocity, Binding(int(joint), int(edge) + 1, "velocity")
    change, joint = np.unravel_index(np.argmax(sharp), sharp.shape)
    return acceleration, Binding(int(joint), int(descent.rates.meetings[1][change]), "acceleration")


def _describe(plan: Plan, asked: Plan, start: MotionState, cost: float) -> str:
    """Return text on what was done, with the cost before and after."""
    parts = (len(asked.q) - 1) // (len(plan.q) - 1)
    what = "refined off the grid" if parts == 1 else f"held at {parts} parts of every interval"
    if not start.admitted:
        what = f"brought inside limits that it did not keep and {what}"
    return f"{what}: cost {plan.cost:.6g} to {cost:.6g}"


def _unrefined(plan: Plan, why: str) -> Refinement:
    return Refinement(
        plan=plan,
        done=False,
        cost_before=plan.cost,
        cost_after=plan.cost,
        programs=0,
        statement=f"not refined: {why}",
    )


def _descent(
    plan: Plan,
    kept: KeptShares | None = None,
    *,
    within: tuple[Array, Array] | None = None,
    most: int | None = None,
    goals: tuple[Goal, ...] = (),
) -> tuple[Descent, MotionState]:
    """Return the descent of a plan, and the motion it starts from; `within` as in `refine`."""
    settings, comfort = plan.settings, plan.settings.comfort
    low, high = room_at_ends(plan)
    gamma, windows, q = plan.gamma, settings.gamma_windows, plan.unwrapped
    limits, mine = plan.robot.joint_limits(), plan.robot.free
    x, free = q[:, mine], np.where(limits.endless, np.inf, 0.0)
    ends = (limits.lower - free)[mine], (limits.upper + free)[mine]
    if windows:
        inside = nearest_inside(windows, plan.contour.s, gamma)
        gamma = np.full(len(gamma), np.nan) if inside is None else inside
        room = room_beside(windows, plan.contour.s, gamma)
        low, high = np.maximum(low, room[0]), np.minimum(high, room[1])
    least, largest = (
        np.column_stack([bound, np.broadcast_to(end, x.shape)])
        for bound, end in ((low, ends[0]), (high, ends[1]))
    )
    if within is not None:
        least, largest = np.maximum(least, within[0]), np.minimum(largest, within[1])
    descent = Descent(
        curves=JointCurves(plan.robot, plan.frames, plan.T_flange_tip, plan.posture),
        rates=RateLimits(
            tau=np.diff(plan.time),
            limits=settings.limits(plan.robot),
            periodic=settings.closure == "periodic",
            kept=kept,
        ),
        limits=limits if comfort is None else comfort.narrowed(plan.robot, plan.q),
        rotation=rotation_limits(settings.rotation, plan.robot.endless),
        weight=settings.weights,
        metric=settings.metric,
        objective=settings.objective,
        node_cost=plan.node_cost,
        radius=FIRST_STEPS * settings.gamma_step,
        low=least,
        high=largest,
        most=MOST_PROGRAMS if most is None else most,
        goals=goals,
    )
    return descent, descent.stand(np.column_stack([gamma, x]), q)


def _plan_with_motion(plan: Plan, found: MotionState) -> Plan:
    """Return the plan with the motion found and its cost.

    The bound of the plan is dropped, as its gap is that of another motion.
    """
    q, turn = on_turns(plan.robot, found.q)
    proof = plan.proof.without_bound()
    moved = replace(
        plan, q=q, gamma=wrap(found.free[:, 0]), turn=turn, proof=proof, approach=None, retreat=None
    )
    s, dq = plan.settings, np.diff(found.q, axis=0)
    return replace(moved, cost=path_cost(dq, s.weights, s.metric, s.objective, moved.node_cost))


def _divide_plan(plan: Plan, nodes: Contour) -> Plan | str:
    """Return the plan on finer nodes, with gamma by a spline; or the reason why it cannot be."""
    K, parts = len(plan.contour), (len(nodes) - 1) // (len(plan.contour) - 1)
    if len(nodes) != (K - 1) * parts + 1:
        raise InputError(
            f"nodes: expected a whole number of intervals for each of the plan's {K - 1}, got "
            f"{len(nodes) - 1}; resample the contour with count={(K - 1) * (parts + 1) + 1}"
        )
    own = slice(None, None, parts)
    off = float(np.linalg.norm(nodes.points[own] - plan.contour.points, axis=1).max())
    if off > SAME_NODE:
        raise InputError(
            f"nodes: the plan's nodes are not among them (off by {off * 1e3:.3g} mm); resample the "
            "contour that the plan's was sampled from"
        )
    kind, index = plan.settings.frames, np.arange(len(nodes)) / parts
    x = nodes.frames(kind)[own, :3, :2]
    before = plan.contour.frames(kind)[:, :3, 0]
    twist = np.arctan2((x[:, :, 1] * before).sum(1), (x[:, :, 0] * before).sum(1))
    coarse = np.arange(K)
    changes = np.flatnonzero(np.diff(plan.posture))
    if changes.size:
        return f"the posture changes after node {changes[0]}, an interval that cannot be divided"
    if parts == 1:
        return plan
    if plan.tilt.any():
        return "the tilts hold at the plan's own nodes, not between them"
    if plan.feed is not None:
        return "the times of a reduced feed hold at its own nodes, not between them"
    gamma = CubicSpline(coarse, np.unwrap(plan.gamma + twist))(index)
    near = np.stack([np.interp(index, coarse, q) for q in plan.unwrapped.T], axis=1)
    if (free := plan.robot.free).size:
        near[:, free] = CubicSpline(coarse, plan.unwrapped[:, free])(index)
    return replace(
        plan,
        contour=nodes,
        q=near,
        gamma=gamma,
        tilt=np.zeros((len(nodes), 2)),
        posture=np.repeat(plan.posture[:1], len(nodes)),
        turn=np.zeros((len(nodes), plan.robot.joints), np.int64),
        time=np.interp(index, coarse, plan.time),
    )


def _closest(descent: Descent, at: MotionState) -> str:
    """Return text on the limit that the motion breaking them least still breaks, and where."""
    if at.outside == np.inf:
        return "the motion leaves the reach of its posture between the nodes"
    rates = descent.rates
    fast, sharp = rates.shares(at.q)
    if at.outside > 0:
        return f"a joint stays out of its range by {np.degrees(at.outside):.3g} deg"
    after = rates.meetings[1]
    more = {
        "torque": np.abs(rates.torque_share(at.q)),
        "jerk": np.abs(rates.jerk_share(np.diff(at.q, axis=0))),
    }
    what, share = max(more.items(), key=lambda each: float(each[1].max(initial=0.0)))
    if share.max(initial=0.0) > max(fast.max(), sharp.max(initial=0.0)):
        row, joint = np.unravel_index(np.argmax(share), share.shape)
        return (
            f"the {what} of joint {joint + 1} at node {after[row]} could not be brought below "
            f"{share.max():.4f} of its limit"
        )
    _, worst = _binding(descent, fast, sharp)
    return (
        f"the {worst.limit} of joint {worst.joint + 1} at node {worst.node} could not be brought "
        f"below {1 + at.excess:.4f} of its limit"
    )
