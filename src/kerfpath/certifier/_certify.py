"""certify(): a lower bound on the cost of every motion along the contour of a plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from time import monotonic

import numpy as np

from kerfpath._arrays import Array, scalar
from kerfpath._repr import short_repr
from kerfpath.certificate import ALLOWANCE, Certificate, Stage
from kerfpath.certifier._cells import CellMaker, CellSet
from kerfpath.certifier._finer import cells_to_divide
from kerfpath.certifier._groups import distinct_groups
from kerfpath.certifier._largest import largest_step_bound
from kerfpath.certifier._nodes import between, turning_nodes
from kerfpath.certifier._parts import DEAREST, NARROW, Parts
from kerfpath.certifier._prices import limit_prices
from kerfpath.certifier._stage import StageResult, linked, solve_stage
from kerfpath.certifier._steps import Steps
from kerfpath.kernels.limits import LIMIT_TOLERANCE
from kerfpath.kernels.metric import CHEBYCHEV
from kerfpath.plans import Plan
from kerfpath.progress import Progress, no_progress
from kerfpath.search import METRIC_CODES

__all__ = ["Certified", "certify"]

LONGEST, TURNED = 3.0, 3e-4
"""How far a joint may turn in one step of the first stage, rad: less than half a turn; and the
share of its cost that the plan may lose if it went straight from step to step."""
DROPPED = 0.25
"""Share of its cells that a stage must rule out to be kept in the certificate."""
STALLED = 0.5
"""Share of the gap that a stage must close; less, and nodes come in between instead."""
CARE = 0.05
"""Share of the cost beyond the cheapest step up to which steps are bounded with care."""
FINE = 3
"""Level below which cells are too coarse to show whether they lack further nodes, or (6)."""
NEAR = 0.9
"""Share of what is wanted from which (6) may be what is left."""
DEEPEST = 12
"""Levels at most: cells of 0.001 deg."""
MOST_PAIRS, MOST_PER_NODE = 10_000_000, 60_000
"""Steps from cell to cell that are looked at, and for each node, unless a time is given."""
MOST_CELLS = 2_000_000
"""Cells of a stage after which it is left at that: some 2 GB."""
CLEARLY, USUAL_LEVEL, WIDER = 0.02, 3, 2.0
"""Share of its cost by which the motions through a cell of that level cost more than the plan
where it drops out, four times as much a level coarser: whoever checks the certificate has
enclosures of his own, and may find less. The curvature is taken so much wider, too. Where nobody
does: `SAME`, rounding."""
SAME = 1e-9
NOT_KEPT = 'a bound of the objective "max" has no certificate to keep'
AT_LIMIT = 0.98
"""Share of what (6) allows from which it may be what keeps the plan from costing less."""
EARLY, COARSE = 0.3, 1
"""Share of the work after which motions are bounded in parts in any case where (6) binds the plan;
and the level of the cells that this begins with at further nodes."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certified:
    """What came of certifying a plan.

    Parameters
    ----------
    plan : Plan
        With `proof.bound`, `gap` and `certificate` where something is proved.
    done : bool
        The gap asked for is reached.
    statement : str
        What is proved, or why nothing can be.
    stages, pairs : int
        Stages, and steps from cell to cell looked at in all of them; of the objective "max" the
        costs that were tried.
    """

    plan: Plan
    done: bool
    statement: str
    stages: int = 0
    pairs: int = 0

    __repr__ = short_repr


def certify(
    plan: Plan,
    *,
    gap: float = 0.005,
    seconds: float | None = None,
    checkable: bool = True,
    progress: Progress = no_progress,
) -> Certified:
    """Return the plan with a proved lower bound on the cost of any motion along its contour.

    Any motion that keeps (5) and (6) at the nodes, the ranges of the joints and their couplings, at
    any gamma, in the postures that the plan may use, on any turn. What else the plan keeps (a cell,
    comfort, a periodic closure, a limit on the rotation) only makes the best motion dearer.

    Parameters
    ----------
    plan : Plan
    gap : float
        (cost - bound) / cost at which to stop.
    seconds : float s, optional
        Time after which no further stage is begun; default: a limit on the work, which does not
        depend on the machine.
    checkable : bool
        Whether the plan is to have a certificate for others to check, with enclosures that may be
        wider: cells drop out where motions are clearly too dear only, which is more work, and (6)
        is left out, as the multipliers of parts do not fit into a certificate.
    progress : Progress

    Raises
    ------
    InputError
        A gap or a time that is not positive.
    """
    gap = scalar(gap, "gap", above=0.0)
    until = np.inf
    if seconds is not None:
        until = monotonic() + scalar(seconds, "seconds", unit="s", above=0.0)
    why = _why_not(plan)
    if why:
        return Certified(plan=plan, done=False, statement=f"no bound is proved: {why}")
    steps = _steps_of(plan)
    if plan.settings.objective == "max":
        best, tests = largest_step_bound(plan, steps, gap, lambda: monotonic() > until, progress)
        found = _certified(plan, best, gap, None, tests, 0)
        return replace(found, statement=f"{found.statement}; {NOT_KEPT}") if checkable else found
    course = _Course(plan, steps, gap, until, checkable, progress)
    course.run()
    stages = tuple(course.stages) if checkable else None
    return _certified(plan, course.best, gap, stages, course.count, course.pairs)


def _certified(
    plan: Plan, best: float, gap: float, kept: tuple[Stage, ...] | None, stages: int, pairs: int
) -> Certified:
    """Return the plan with what is proved of its cost, and the stages to keep where there are."""
    bound = max(best - ALLOWANCE * plan.cost, 0.0)
    reached = (plan.cost - bound) / plan.cost
    certificate = None if kept is None else Certificate(bound=bound, stages=kept)
    proof = replace(plan.proof, bound=bound, gap=reached, certificate=certificate)
    return Certified(
        plan=replace(plan, proof=proof),
        done=reached <= gap,
        statement=proof.bound_claim,
        stages=stages,
        pairs=pairs,
    )


def _why_not(plan: Plan) -> str:
    """Say why nothing can be proved of a plan; "" where it can."""
    robot, asked = plan.robot, plan.settings
    if robot.externals:
        return "the joints of an external axis are not enclosed"
    if not robot.encloses:
        return f"the joints of a robot of the kind {robot.kinematics!r} are not enclosed"
    if asked.tilt is not None:
        return "the tool axis may tilt"
    if plan.feed is not None:
        return "the feed is reduced"
    if not plan.cost > 0:
        return "its cost is not above 0"
    return ""


def _steps_of(plan: Plan) -> Steps:
    """Return what the steps of motions along the contour of a plan cost and may be."""
    asked, dt = plan.settings, float(np.diff(plan.time).max())
    limits = asked.limits(plan.robot)
    return Steps(
        weight=asked.weights,
        velocity=limits.velocity.per_interval(dt) + 2 * LIMIT_TOLERANCE,
        acceleration=limits.acceleration.per_interval(dt) + 2 * LIMIT_TOLERANCE,
        metric=METRIC_CODES[asked.metric],
        endless=plan.robot.endless,
    )


class _Course:
    """The stages of one certificate, from coarse cells at a few nodes to fine ones at more."""

    def __init__(
        self,
        plan: Plan,
        steps: Steps,
        gap: float,
        until: float,
        checkable: bool,
        progress: Progress,
    ) -> None:
        robot, asked = plan.robot, plan.settings
        self.steps = steps
        self.margin, width = (CLEARLY, WIDER) if checkable else (SAME, 1.0)
        self.maker = CellMaker(robot, plan.frames, plan.T_flange_tip, asked.postures, width)
        self.cost, self.until, self.progress = plan.cost, until, progress
        self.target = plan.cost * min(1.0, 1 - gap + ALLOWANCE)
        self.last = len(plan.q) - 1
        longest = max(1, int(LONGEST / self.steps.velocity.max()))
        self.nodes = turning_nodes(plan, TURNED, longest)
        self.best, self.pairs, self.count = 0.0, 0, 0
        self.at_node = 0.0  # cells of level 0
        self.stages: list[Stage] = []
        self.plan, self.checkable = plan, checkable
        self.proved = 0.0  # by the stages that are kept
        self.loose: tuple[int, StageResult] | None = None  # the best that is not, and its place

    def run(self) -> None:
        """Go from stage to stage until the gap is reached or it is enough."""
        cells = self.maker.coarsest(self.nodes)
        self.at_node = len(cells) / len(self.nodes)
        fresh = True  # cells that the certificate has to show
        while True:
            result = solve_stage(cells, self.steps, care=CARE * self.cost)
            gained, cells = self._take(result), result.cells
            clearly = self.margin * np.exp2(2.0 * (USUAL_LEVEL - cells.level))
            live = result.through <= self.cost * (1 + clearly)
            if not self.checkable:
                live = np.logical_or.reduce(distinct_groups(result, live, self.maker))
            low = result.through < self.target
            which, singular = cells_to_divide(cells, result.through, self.target, self.steps.weight)
            which &= cells.level < DEEPEST
            fine = not singular and low.any() and np.median(cells.level[low]) >= FINE
            slow = bool(fine) and gained < STALLED
            if fine and self._late(slow) and self._fits(self.last + 1) and self._priced:
                self._divide(cells.take(live))
                return
            if not low.any() or self._enough(result, float(live.mean() + which.mean())):
                self._finish(result)
                return
            if fresh or 1 - live.mean() > DROPPED:
                self._keep(result)
                fresh, kept = False, live
            else:
                if result.bound >= self.best:
                    self.loose = len(self.stages), result
                kept = np.ones(len(live), np.bool_)
            which &= kept
            more = between(self.nodes)
            if (slow or not which.any()) and len(more) > len(self.nodes) and self._fits(len(more)):
                self.nodes, fresh = more, True
                cells = self._with_nodes(cells.take(kept))
            elif not which.any():
                self._finish(result)
                return
            else:
                cells = self.maker.divided(cells.take(kept), which[kept])

    @cached_property
    def _priced(self) -> bool:
        """Whether (6) is worth more to the plan than the gap that may be left."""
        if self.checkable:
            return False
        share = np.abs(self.plan.acceleration_share)
        if self.steps.metric == CHEBYCHEV:  # its potentials are too loose for prices to tell
            return False
        if not (share > AT_LIMIT * self.plan.settings.eta_a).any():
            return False
        posture = int(np.bincount(self.plan.posture).argmax())
        prices = (self._prices(self.plan.gamma, posture, NARROW, most) for most in DEAREST)
        return max(map(self.steps.price, prices)) > self.cost - self.target

    def _prices(self, gamma: Array, posture: int, reach: float, most: float) -> Array | None:
        """Return multipliers of (6) about the motion with gamma (K,) in a posture."""
        if self._spent(self.pairs):
            return None
        motion = self.maker.motion(gamma, posture)
        if motion is None:
            return None
        q, slope = motion
        u = np.diff(q, axis=0)
        u -= 2 * np.pi * np.rint(u / (2 * np.pi))
        return limit_prices(u, slope, self.steps, reach, most)

    def _divide(self, cells: CellSet) -> None:
        """Go on at all nodes, with multipliers of (6), part by part."""
        self.nodes = np.arange(self.last + 1)
        cells = self._with_nodes(cells, COARSE)
        before = self.pairs

        def enough(pairs: int, held: int) -> bool:
            short = max(self.target - self.best, 0.0)
            self.progress("certificate", int(1000 * (1 - short / self.target)), 1000)
            return held > MOST_CELLS or self._spent(before + pairs)

        parts = Parts(
            self.maker,
            self.steps,
            self._prices,
            self.plan.gamma,
            cost=self.cost,
            target=self.target,
            enough=enough,
        )
        self.best = max(self.best, min(parts.bound(cells, self.best), self.cost))
        self.pairs, self.count = before + parts.pairs, self.count + parts.count

    def _keep(self, result: StageResult) -> None:
        """Take a stage into the certificate."""
        self.stages.append(result.stage())
        self.proved = max(self.proved, result.bound)

    def _finish(self, result: StageResult) -> None:
        """Take the last stage, and where none that is kept proves the bound the one that does.

        Further nodes and other potentials may prove less. What a stage that was left out covers,
        those after it cover, too: it ruled nothing out.
        """
        self._keep(result)
        if self.loose is not None and self.proved < self.best:
            place, best = self.loose
            self.stages.insert(place, best.stage())

    def _take(self, result: StageResult) -> float:
        """Take what a stage proves; return the share of the gap that it closes."""
        before, self.best = self.best, max(self.best, min(result.bound, self.cost))
        self.pairs, self.count = self.pairs + result.pairs, self.count + 1
        short = max(self.target - self.best, 0.0)
        self.progress("certificate", int(1000 * (1 - short / self.target)), 1000)
        return (self.best - before) / max(self.target - before, 1e-300)

    def _late(self, slow: bool) -> bool:
        """Return whether (6) is to be told by multipliers from here on."""
        close = slow and self.best > NEAR * self.target
        return close or self.pairs > EARLY * (MOST_PAIRS + MOST_PER_NODE * self.last)

    def _enough(self, result: StageResult, left: float) -> bool:
        """Return whether the next stage, of a share `left` of the cells, would be too much."""
        if len(result.cells) * left > MOST_CELLS:
            return True
        return self._spent(self.pairs + result.pairs * left**2)

    def _fits(self, nodes: int) -> bool:
        """Return whether coarse cells at so many nodes are few enough."""
        return nodes * self.at_node <= MOST_CELLS

    def _spent(self, pairs: float) -> bool:
        """Return whether so many steps, or the time, are all that may go into it."""
        if self.until < np.inf:
            return monotonic() > self.until
        return pairs > MOST_PAIRS + MOST_PER_NODE * self.last

    def _with_nodes(self, cells: CellSet, most: int = DEEPEST) -> CellSet:
        """Return the cells with those of further nodes, about as fine where motions may pass."""
        level = min(most, int(np.median(cells.level))) if len(cells) else 0
        missing = np.setdiff1d(self.nodes, cells.node)
        if not len(missing):
            return cells
        new = self.maker.coarsest(missing)
        while True:
            passed = linked(CellSet.join([cells, new]), self.steps)[len(cells) :]
            coarse = passed & (new.level < level)
            if not coarse.any() or len(new) > MOST_CELLS or self._spent(self.pairs):
                return CellSet.join([cells, new])
            new = self.maker.divided(new, coarse)
