"""Very many nodes: a subsample is planned first, and its motion is the start for all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from kerfpath.arrays import Ints, short_repr
from kerfpath.contour import Contour
from kerfpath.effort import current_effort
from kerfpath.errors import Closed, NoFeasiblePath
from kerfpath.planner.impossible import proved_impossible
from kerfpath.planner.task import Layered, Task
from kerfpath.plans import Plan, Proof, on_turns

EVERY = 5, 4, 6, 3, 7
"""One of this many nodes is kept: the first number that divides the intervals, else the first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SubsampledTask:
    """A task with every few nodes of another task, at the same speed.

    Parameters
    ----------
    task : Task
        The subsampled task; it lacks the last few nodes if the intervals do not divide evenly.
    whole : Task
        The other task, with all nodes.
    nodes : (M,) int
        The nodes of `whole` that are kept.
    """

    task: Task
    whole: Task
    nodes: Ints

    __repr__ = short_repr

    def at_all_nodes(self, made: Plan) -> Plan | None:
        """Return the motion at all nodes, with gamma and external axes interpolated by splines.

        It need not keep the limits; beyond the last kept node it goes on at the same rate. None if
        the posture changes on the way.
        """
        task, at = self.whole, np.arange(len(self.whole.contour))
        if np.ptp(made.posture):
            return None
        q = np.stack([np.interp(at, self.nodes, joint) for joint in made.unwrapped.T], axis=1)
        free = np.column_stack([np.unwrap(made.gamma), made.unwrapped[:, task.robot.free]])
        spline, end = CubicSpline(self.nodes, free), self.nodes[-1]
        free = spline(np.minimum(at, end)) + spline(end, 1) * np.maximum(at - end, 0)[:, None]
        gamma, q[:, task.robot.free] = free[:, 0], free[:, 1:]
        claim = Proof(optimal=False, statement="found over continuous rotation")
        return Plan(
            contour=task.contour,
            robot=task.robot,
            T_flange_tip=task.setup.tool,
            T_base_part=task.setup.placement,
            q=q,
            gamma=gamma,
            posture=np.repeat(made.posture[:1], len(at)),
            turn=on_turns(task.robot, q)[1],
            time=task.times,
            settings=task.settings,
            cost=made.cost,
            proof=claim,
            counts=made.counts,
        )

    def along_all_nodes(self, none: NoFeasiblePath, closed: Closed) -> NoFeasiblePath:
        """Return the answer that no motion passes a place, which is proved along the kept nodes.

        The lower speed or higher limits of a motion along them may not be enough for all nodes, so
        that they are only named.
        """
        nodes = self.nodes
        named = nodes[closed.node + 1] - 1 if closed.joint is None else nodes[closed.node]
        broken = proved_impossible(self.whole, replace(closed, node=int(named)))
        if none.relaxation is None:
            return broken
        every = int(nodes[1] - nodes[0])
        return broken.with_message(
            f"{broken}; along one node of every {every} a motion was found at "
            f"{none.relaxation.speed:g} of the speed"
        )


def subsampled(task: Task) -> SubsampledTask | None:
    """Return a task with every few of very many nodes; None if it has fewer.

    It is also None with a tilt or a grid of external axes, and with a periodic closure whose
    intervals do not divide evenly. No graph is built for it: that of the kept nodes is built when
    it is needed, which raises NoFeasiblePath if one of them has no pose.
    """
    last, axes = len(task.contour) - 1, len(task.robot.free)
    if last < current_effort().subsampled_from / (1 + axes) or task.settings.tilt is not None:
        return None
    if axes and task.external is None:
        return None
    even = [every for every in EVERY if last % every == 0]
    if task.settings.closure == "periodic" and not even:
        return None
    every = (even or EVERY)[0]
    nodes = np.arange(0, last + 1, every)
    whole = task.contour
    contour = Contour(
        whole.points[nodes],
        whole.axes[nodes],
        closed=whole.closed and bool(even),
        s=whole.s[nodes],
        x=whole.frames(task.settings.frames)[nodes, :3, 0],
        name=whole.name,
    )

    def layers(thin: Task, some: Ints | None) -> Layered:
        built = task.at_nodes(nodes if some is None else nodes[some])
        empty = np.flatnonzero(np.diff(built.graph.start) == 0)
        if some is None and empty.size:
            raise NoFeasiblePath(
                f"contour {whole.name!r}: node {nodes[empty[0]]} has no pose",
                proved=False,
                node=int(empty[0]),
            )
        return replace(built, problem=replace(built.problem, dt=thin.dt))

    thin = replace(
        task,
        contour=contour,
        dt=every * task.dt,
        layers=layers,
        external=None if task.external is None else task.external[nodes],
    )
    return SubsampledTask(task=thin, whole=task, nodes=nodes)
