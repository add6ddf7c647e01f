"""The bound where a pose leaves more free than gamma: a tilt of the tool axis, or external axes.

Cells are boxes of gamma and the other parameters. Stages are as for gamma alone, but the slopes of
the potential are also those of whole motions (`motion_slopes`): that of the plan, and those that
looked cheapest in earlier stages. (6) is not used, nor is anything that limits how fast a tilt
changes, so that the bound may be loose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array, Ints
from kerfpath.certificate import allowance, cell_bounds
from kerfpath.certifier.cells import MORE_CELLS, CellSet, cell_maker, foldable
from kerfpath.certifier.division import between, cells_to_divide, evenly, turning_nodes
from kerfpath.certifier.motion_slopes import motion_slopes
from kerfpath.certifier.parts import CARE, SAME_COST
from kerfpath.certifier.stages import LONGEST, Steps, solve_stage
from kerfpath.plans import Plan
from kerfpath.progress import Progress

TURNED = 0.03
"""Share of its cost that the plan may lose with straight steps between the nodes of a stage."""
UNCERTAIN = 0.01
"""Share of the cost that the uncertainty of the joints on a new cell may be worth."""
DEEPEST = 12
"""Largest average level of the parameters of a cell."""
MOST_CELLS = 500_000
"""Most cells of a stage."""
MOST_REGIONS = 60_000
"""Most regions that are enclosed before the first stage; with more there is no bound above 0."""
LINKED, MOST_PAIRS = 0.1, 1e9
"""Share of all pairs of cells of neighbouring layers that steps join at least, to judge the work of
the first stage; and the most pairs with a time limit."""
MOST_SETS = 5
"""Most motions whose slopes a stage tries."""
AGAIN = 0.05
"""Share of what the bound lacks that the slopes of another motion must gain to be tried again."""
AIM = 1.0
"""Share of what the bound lacks up to which cells are divided."""
THICK = 0.03
"""Share of the cost of a plan that the other parameters may take up where gamma alone decides."""
STALLED, THIN = 0.3, 0.25
"""Share of what the bound lacks that a division must gain; if it gains less, and all that is unsure
of the joints along the cheapest motion is worth less than the second share, nodes are added."""


def thick(plan: Plan, steps: Steps) -> bool:
    """Return whether other parameters than gamma may take up much of the cost of a plan."""
    maker = cell_maker(plan, steps.weight)
    if not maker.more:
        return False
    nodes = _first_nodes(plan, steps, float(steps.velocity.max()))
    at = maker.parameters(plan.q[nodes])
    known = maker.linear(nodes, plan.gamma[nodes], at, plan.posture[nodes].astype(np.int64))
    if known is None:
        return True
    low, high = maker.room(at, np.inf)
    moved = ((np.abs(known[1]) @ steps.weight) * np.maximum(high, -low))[:, 1:]
    return bool(moved.sum() > THICK * plan.cost)


def _first_nodes(plan: Plan, steps: Steps, fastest: float) -> Ints:
    """Return the nodes (M,) of the first stage; no step turns a joint of that speed by half."""
    ends = evenly(len(plan.q) - 1, max(1, int(LONGEST / fastest)))
    return turning_nodes(plan.increments, steps.weight, steps.metric, TURNED, ends)


def wide_bound(
    plan: Plan,
    steps: Steps,
    gap: float,
    spent: Callable[[float], bool],
    progress: Progress,
) -> tuple[float, int, int]:
    """Return a lower bound on the cost of any motion, the number of stages, and that of steps.

    Parameters
    ----------
    plan : Plan
        With the objective "sum".
    steps : Steps
        Bound (5), weights and metric; (6) is not used.
    gap : float
        Value of (cost - bound) / cost at which it stops.
    spent : callable
        Takes the number of steps after the next stage; returns whether the work is over.
    progress : Progress
    """
    target = plan.cost * min(1.0, 1 - gap + allowance(gap, checkable=False))
    maker = cell_maker(plan, steps.weight, folded=foldable(plan.robot, steps.velocity))
    # Motions in which a joint moves farther between any two nodes cost more than the plan.
    alone: Array = np.divide(
        plan.cost, steps.weight, out=np.full_like(steps.weight, np.inf), where=steps.weight > 0
    )
    steps = replace(steps, endless=maker.endless, farthest=alone * (1 + SAME_COST))
    quick = maker.endless & (steps.farthest > LONGEST)
    fastest = float(steps.velocity[quick].max(initial=LONGEST / len(plan.q)))
    nodes = _first_nodes(plan, steps, fastest)
    if len(nodes) * maker.columns > MOST_REGIONS:  # hopeless with several long axes
        return 0.0, 0, 0
    cells = maker.coarsest(nodes)
    if MORE_CELLS * len(cells) <= MOST_REGIONS:
        cells = maker.certain(cells, steps.weight, UNCERTAIN * plan.cost)
    each = np.unique(cells.node, return_counts=True)[1].astype(float)
    all_steps = float(each[:-1] @ each[1:])
    if spent(LINKED * all_steps) or all_steps > MOST_PAIRS:
        return 0.0, 0, 0

    def slopes_of(gamma: Array, at: Array, posture: Ints) -> list[Array]:
        found = motion_slopes(maker, nodes, gamma, at, posture, steps)
        return [] if found is None else [found]

    def own() -> list[Array]:
        at = maker.parameters(plan.q[nodes])
        return slopes_of(plan.gamma[nodes], at, plan.posture[nodes].astype(np.int64))

    sets = own()
    best, last, stages, pairs = 0.0, 0.0, 0, 0
    while True:
        tried = sets[:1] + sets[1:][1 - MOST_SETS :]
        given = np.stack(tried, axis=1) if tried else None
        result = solve_stage(cells, steps, care=CARE * plan.cost, given=given).floored()
        before, best = best, max(best, min(result.bound, plan.cost))
        stages, pairs = stages + 1, pairs + result.pairs
        progress("certificate", int(1000 * min(best / target, 1.0)), 1000)
        live = result.through <= plan.cost * (1 + SAME_COST)
        if best >= target or not live.any():
            break
        lack, ahead = target - best, pairs + result.pairs * float(live.mean()) ** 2
        if spent(ahead):
            break
        motion = result.cells.take(result.cheapest())
        gamma, _ = cell_bounds(motion.level, motion.index)
        new = slopes_of(gamma, motion.at, motion.posture.astype(np.int64))
        sets = sets + new
        cells = result.cells.take(live)
        if new and best - before >= AGAIN * (target - before):
            continue
        more, slow = between(nodes), best - last < STALLED * (target - last)
        spread = float(((motion.unsure + motion.sway) @ steps.weight).sum())
        if spread < THIN * lack and len(more) > len(nodes) and slow:
            missing = np.setdiff1d(more, nodes)
            nodes = more
            cells = CellSet.join([cells, maker.coarsest(missing)])
            sets, last = own(), best
            continue
        last = best
        which, singular = cells_to_divide(cells, cells.floor, target, steps.weight, DEEPEST)
        if not singular:
            which &= cells.floor <= best + AIM * lack
        part = float(which.mean())
        if not which.any() or len(cells) * (1 + part) > MOST_CELLS:
            break
        if spent(pairs + result.pairs * (float(live.mean()) * (1 + part)) ** 2):
            break
        cells = maker.divided(cells, which)
    return best, stages, pairs
