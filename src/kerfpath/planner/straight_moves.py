"""Moves from node to node: whether the arm follows them, and the time that they take.

A search joins nodes by the change of each joint. Where the tool axis jumps, as at a sharp edge of a
sheet, or where nodes are far apart in time, the ends of a change may lie on two branches of the
arm: on the straight move between them the joints would have to leap. Near a singularity they can
follow it, but are faster on the way than the change from node to node says. A controller that moves
all joints evenly passes the singularity, and the tip hardly leaves the line there.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.contour import Contour, angle_between, turned_about
from kerfpath.errors import NoFeasiblePath
from kerfpath.losses import Loss, Reason
from kerfpath.plans import Plan
from kerfpath.robots import Robot, base_in_part
from kerfpath.tolerances import LIMIT_MARGIN, SAME_POINT

PARTS, FINE = 16, 256
"""Numbers of parts of a move at whose ends the joints are solved: first, and where they do not run
evenly."""
UNEVEN = 1.1
"""Multiple of the time that the change from node to node takes, from which a move is uneven."""
LEAP = np.radians(45)
"""rad: a joint that changes by more in one of these parts has left its branch, or passes so near a
singularity that the arm would nearly stop there."""
NEAR_TIP, NEAR_AXIS = 1e-4, np.radians(1.0)
"""m and rad: even moves of the joints that leave the straight move by no more follow it, as in an
audit of such moves."""


def largest_steps(contour: Contour, robot: Robot) -> Array:
    """Return the largest change (n,) rad of each joint that a search allows from node to node.

    It is a quarter turn more than the tool axis turns: beyond it, the arm passes a singularity or
    changes its posture. A linear axis may go any way.
    """
    turn = float(angle_between(contour.axes[:-1], contour.axes[1:]).max())
    rotary = np.array([unit == "rad" for unit in robot.units])
    return np.where(rotary, np.pi / 2 + turn, np.inf)


def least_times(made: Plan) -> Array:
    """Return the least time of each interval, (K-1,) s, in which straight moves keep (5).

    It is infinite where the joints cannot follow the move. Without a free rotation, it is that of
    the change from node to node.

    Parameters
    ----------
    made : Plan
        Its times do not matter.
    """
    change, velocity = np.abs(made.increments), made.settings.limits(made.robot).velocity.usable
    evenly = (change / velocity).max(axis=1)
    if not made.robot.family.free_rotation:
        return np.asarray(evenly)
    least = _times_in_parts(made, np.arange(len(change)), PARTS)
    uneven = np.flatnonzero((least > UNEVEN * evenly) & (least < np.inf))
    least[uneven] = _times_in_parts(made, uneven, FINE)
    return np.asarray(np.maximum(least, evenly))


def _times_in_parts(made: Plan, moves: Ints, parts: int) -> Array:
    """Return the least times (M,) s of some moves, from joints at the ends of equal parts."""
    robot, velocity = made.robot, made.settings.limits(made.robot).velocity.usable
    n, T = robot.alone().joints, made.T_part_tip
    begin, change = made.q[moves], made.increments[moves]
    R, start, to = T[moves, :3, :3], T[moves, :3, 3], T[moves + 1]
    turn = Rotation.from_matrix(R.transpose(0, 2, 1) @ to[:, :3, :3]).as_rotvec()
    tool, before, least = np.linalg.inv(made.T_flange_tip), begin, np.zeros(len(moves))
    last: Array | None = None
    for f in np.arange(1, parts + 1) / parts:
        evenly = begin + f * change
        wanted = np.tile(np.eye(4), (len(moves), 1, 1))
        wanted[:, :3, :3] = R @ Rotation.from_rotvec(f * turn).as_matrix()
        wanted[:, :3, 3] = start + f * (to[:, :3, 3] - start)
        wanted = made.T_base_part @ wanted
        if robot.externals:
            wanted = np.linalg.inv(base_in_part(robot.externals, evenly[:, n:])) @ wanted
        after = before.copy()
        after[:, robot.free] = evenly[:, robot.free]
        after[:, :n] = robot.arm.nearest(wanted @ tool, after[:, :n])
        after = evenly if f == 1.0 else after
        step = np.abs(after - before)
        leaps = ~(step[:, :n].max(axis=1) <= LEAP)  # a pose out of reach has no joints
        # At an end of a part a joint is faster than in its mean, by half the change to the next.
        most = step if last is None else np.maximum(step, last) + np.abs(step - last) / 2
        least = np.maximum(least, np.where(leaps, np.inf, parts * (most / velocity).max(axis=1)))
        last = step
        before = np.where(leaps[:, None], evenly, after)
    return least


def follows(made: Plan) -> bool:
    """Return whether the arm can follow every straight move of a plan."""
    return bool(np.isfinite(least_times(made)).all())


def not_followed(made: Plan) -> NoFeasiblePath | None:
    """Return the answer that the arm cannot follow a move of a plan; None if it can.

    At constant feed it cannot if the joints would have to leap; if they move evenly, and the tip
    keeps near the line, they need not. If the tip moves straight through a change of posture, they
    must also be fast enough, which near the singularity they seldom are.
    """
    least, asked = least_times(made), made.settings
    lost = np.isinf(least)
    if asked.feed == "constant":
        least[lost] = _times_in_parts(made, np.flatnonzero(lost), FINE)
        lost = np.isinf(least)  # seen closer, the joints may only be very fast
        if asked.interpolation == "joint":
            lost[lost] = ~_near_the_line(made, np.flatnonzero(lost))
        else:
            lost |= (np.diff(made.posture) != 0) & (least > np.diff(made.time) * (1 + LIMIT_MARGIN))
    leaps = np.flatnonzero(lost)
    if not leaps.size:
        return None
    k = int(leaps[0])
    return NoFeasiblePath(
        f"contour {made.name!r}: the motion found changes its posture between nodes {k} and "
        f"{k + 1}, which no straight move does, and none was found in one posture",
        proved=False,
        node=k,
        counts={Reason(Loss.LEAP): len(leaps)},
    )


def _near_the_line(made: Plan, moves: Ints) -> Bools:
    """Return whether the tip stays near the straight move, (M,), where all joints move evenly."""
    f = np.linspace(0.0, 1.0, PARTS + 1)[:, None, None]
    tool = made.robot.forward(made.q[moves] + f * made.increments[moves]) @ made.T_flange_tip
    tip, axis = tool[..., :3, 3], tool[..., :3, 2]
    along = tip[-1] - tip[0]
    way = tip - tip[0]
    length = np.maximum((along**2).sum(axis=-1, keepdims=True), SAME_POINT**2)
    share = (way * along).sum(axis=-1, keepdims=True) / length
    off = np.linalg.norm(way - np.clip(share, 0.0, 1.0) * along, axis=-1).max(axis=0)
    turned = angle_between(axis, axis[0] + f * (axis[-1] - axis[0])).max(axis=0)
    return np.asarray((off <= NEAR_TIP) & (turned <= NEAR_AXIS))


def remedy(contour: Contour) -> str:
    """Return what may give a motion where the tool axis turns sharply, or all the way round."""
    if turned_about(contour.axes) is not None:
        return (
            "the tool axis turns all the way round, which a rotary axis that carries the part "
            "([[robot.external]] in a job) can do; or stop where the posture changes "
            '(interruptions = "fewest")'
        )
    turns = angle_between(contour.axes[:-1], contour.axes[1:])
    k = int(np.argmax(turns))
    return (
        f"the tool axis turns by up to {np.degrees(turns[k]):.1f} deg from node to node (at node "
        f"{k}): round the corner or write smooth_axes, allow a tilt, place the part otherwise, or "
        'stop where the posture changes (interruptions = "fewest")'
    )
