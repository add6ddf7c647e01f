"""certify(): a lower bound on the cost of every motion along the contour of a plan."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import monotonic

import numpy as np

from kerfpath.arrays import Array, Ints, not_negative, scalar, short_repr
from kerfpath.certificate import LEAST_GAP, Branch, Certificate, Stage, allowance
from kerfpath.certifier.cells import CellMaker, CellSet, cell_maker, foldable
from kerfpath.certifier.division import between, cells_to_divide, evenly, turning_nodes
from kerfpath.certifier.first_order import FirstOrder
from kerfpath.certifier.kept_tubes import KeptTubes
from kerfpath.certifier.lever_arms import lever_bounds
from kerfpath.certifier.minimax import largest_step_bound
from kerfpath.certifier.multipliers import limit_prices
from kerfpath.certifier.parts import CARE, DEAREST, NARROW, SAME_COST, Parts
from kerfpath.certifier.stages import (
    LONGEST,
    StageResult,
    Steps,
    linked,
    solve_stage,
)
from kerfpath.certifier.tubes import Tubes
from kerfpath.certifier.wide import thick, wide_bound
from kerfpath.effort import current_effort
from kerfpath.plans import OF_BOUND, Plan
from kerfpath.progress import Progress, StopEarly, no_progress
from kerfpath.search import METRIC_CODES, Course

TURNED = 3e-4
"""Share of its cost that the plan may lose with straight steps between the nodes of the first
stage."""
MUCH_LESS = 0.25
"""Share of what the bound lacks for want of nodes below which finer cells gain too little."""
LITTLE, DEAR = 0.1, 0.1
"""Shares of what the bound lacks that are little to gain, and of the work that are much to take: a
stage that may take much follows only one that gained more than little."""
LEAST = 0.02
"""Share that is little to gain, if a time is given."""
DROPPED = 0.25
"""Share of its cells that a stage must rule out to be kept in the certificate."""
STALLED = 0.5
"""Share of the gap that a stage must close; if it closes less, nodes are added in between."""
FINE = 3
"""Level below which cells are too coarse to show whether more nodes, or (6), are needed."""
NEAR = 0.9
"""Share of the target from which (6) may be what is missing."""
DEEPEST = 12
"""Largest level: cells of 0.001 deg."""
UNCERTAIN = 0.01
"""Share of the cost that the uncertainty of the joints on a new cell may be worth."""
MOST_CELLS = 2_000_000
"""Most cells of a stage, some 2 GB; the certifier stops before it exceeds them."""
CLEARLY, USUAL_LEVEL, WIDER = 0.02, 3, 2.0
"""For checkable certificates: a cell of this level drops out if motions through it cost more than
the plan by this share, four times the share per coarser level, because a checker's own enclosures
may give less; and the factor on the curvature. Otherwise only `SAME_COST`, for rounding."""
NOT_KEPT = f'{OF_BOUND}of the objective "max" has no certificate to keep'
LOWER, LOWER_NEW = 0.005, 0.1
"""Shares of the plan's cost by which the potential of a stage may be below the best bound, or below
that of a stage with new cells after it; the second with new cells. If it is lower, the stage is
laid again with more of its steps."""
UNFOLDED = 0.2
"""Share of the work within which cells must have been bounded on every turn of their joints, so
that turns are distinguished: joints with a range of a turn or more count as endless before."""
AT_LIMIT = 0.98
"""Share of the acceleration limit from which (6) may keep the plan from costing less."""
EARLY, COARSE = 0.3, 1
"""Share of the work after which motions are always bounded in parts if (6) binds the plan; and the
largest level of the new cells at further nodes."""
FEW, PARTS = 16, 0.2
"""Most layers between which motions are divided into tubes, and the share of the work that parts
take before. A contour of no more nodes than `SEVERAL` has all of them as layers."""
SEVERAL, HALF = 32, 0.5
"""The same if a time is given, and the share of the time that parts take if there are more than
`FEW`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certified:
    """Result of certifying a plan.

    Parameters
    ----------
    plan : Plan
        The plan, with `proof.bound`, `gap` and `certificate` if a bound is proved; or a cheaper one
        that the proof came upon.
    done : bool
        Whether the gap asked for is reached.
    statement : str
        The proved bound, or the reason why there is none.
    stages, pairs : int
        Number of stages, and of steps from cell to cell bounded in all of them.
    """

    plan: Plan
    done: bool
    statement: str
    stages: int = 0
    pairs: int = 0

    __repr__ = short_repr


class SharedWork:
    """The limit on the work of the bounds of several plans: that of the one with the most nodes.

    Each may take an equal share of what those before it have left, so that they take no longer
    than one of them could, however many they are.

    Parameters
    ----------
    nodes : sequence of int
        Number of nodes of each plan.
    """

    def __init__(self, nodes: Sequence[int]) -> None:
        self._pairs, self._plans = most_pairs(max(nodes, default=1)), len(nodes)

    @property
    def share(self) -> float:
        """Most steps from cell to cell that the next plan may take."""
        return self._pairs / max(self._plans, 1)

    def take(self, pairs: int) -> None:
        """Count the steps that a plan has taken."""
        self._pairs, self._plans = max(self._pairs - pairs, 0.0), self._plans - 1


def most_pairs(nodes: int) -> float:
    """Return the most steps from cell to cell that the bound of a plan alone takes."""
    effort = current_effort()
    return float(effort.certificate_pairs + effort.certificate_pairs_per_node * (nodes - 1))


def certify(
    plan: Plan,
    *,
    gap: float = 0.005,
    seconds: float | None = None,
    checkable: bool = True,
    most: float | None = None,
    progress: Progress = no_progress,
    refined: Callable[[Course], Plan | None] | None = None,
) -> Certified:
    """Return the plan with a proved lower bound on the cost of any motion along its contour.

    The bound holds for any motion that keeps (5) and (6) at the nodes, the ranges of the joints and
    their couplings, at any gamma, in the postures that the plan may use, on any turn, and at any
    tilt within the cone and any values of external axes if the plan has these. Unless it is
    checkable, it also counts on elbow, wrist and flange to stay above the floor of the plan, if
    there is one. Other constraints of the plan (cell, comfort, periodic closure, rotation limits)
    can only raise the cost of the best motion.

    Parameters
    ----------
    plan : Plan
    gap : float
        Value of (cost - bound) / cost at which it stops; `LEAST_GAP` if it is smaller.
    seconds : float s, optional
        Time after which no further stage is begun; default: a limit on the work, which does not
        depend on the machine, and an end where more work gains little.
    checkable : bool
        Whether the plan gets a certificate that others can check with enclosures that may be wider.
        Then cells drop out only if their motions clearly cost too much, which is more work, and (6)
        is used only along few nodes, in tubes, which the certificate then has as branches.
    most : float, optional
        Most steps from cell to cell that are bounded, see `SharedWork`; default: by the number of
        nodes. Objective "sum" only.
    progress : Progress
        Called with the progress of the proof.
    refined : callable, optional
        Returns the plan that a motion cheaper than the plan leads to, None for none. The proof
        comes upon such motions where it divides motions into tubes; then it is about that plan.

    Raises
    ------
    InputError
        A gap below 0, or a time that is not positive.
    """
    gap = max(not_negative(gap, "gap"), LEAST_GAP)
    until = np.inf
    if seconds is not None:
        until = monotonic() + scalar(seconds, "seconds", unit="s", above=0.0)
    if not plan.cost > 0:
        why = "its cost is not above 0"
        return Certified(plan=plan, done=False, statement=f"no bound is proved: {why}")
    steps, more = bound_steps(plan), _also_for(plan)
    checkable = checkable and not more
    if plan.robot.family.enclose_all is None:
        return _certified(plan, _lever_bound(plan, steps), gap, None, 0, 0, more)
    if plan.settings.objective == "max":
        best, rounds, pairs = largest_step_bound(
            plan, steps, gap, lambda: monotonic() > until, progress
        )
        found = _certified(plan, best, gap, None, rounds, pairs, more)
        return replace(found, statement=f"{found.statement}; {NOT_KEPT}") if checkable else found
    most = most_pairs(len(plan.q)) if most is None else most
    if thick(plan, steps):

        def spent(pairs: float) -> bool:
            """Return whether the time is over, or this number of steps exceeds the limit."""
            return monotonic() > until if until < np.inf else pairs > most

        best, rounds, pairs = wide_bound(plan, steps, gap, spent, progress)
        best = max(best, _lever_bound(plan, steps))
        return _certified(plan, best, gap, None, rounds, pairs, more)
    certification = _Certification(plan, steps, gap, until, most, checkable, progress, refined)
    try:
        certification.run()
    except StopEarly:  # a certificate must be whole
        if checkable or not certification.best:
            raise
    stages = tuple(certification.stages) if checkable else None
    return _certified(
        certification.plan,
        certification.best,
        gap,
        stages,
        certification.count,
        certification.pairs,
        more,
        certification.branches,
    )


def _certified(
    plan: Plan,
    best: float,
    gap: float,
    kept: tuple[Stage, ...] | None,
    stages: int,
    pairs: int,
    more: str = "",
    branches: tuple[Branch, ...] = (),
) -> Certified:
    """Return the plan with its proved bound, and with stages and branches to keep if there are any.

    `more` is what else it holds for, as `_also_for` says it.
    """
    bound = max(best - allowance(gap, checkable=kept is not None) * plan.cost, 0.0)
    reached = (plan.cost - bound) / plan.cost
    certificate = None if kept is None else Certificate(bound=bound, stages=kept, branches=branches)
    proof = replace(plan.proof, bound=bound, gap=reached, certificate=certificate)
    return Certified(
        plan=replace(plan, proof=proof),
        done=reached <= gap * (1 + SAME_COST),
        statement=f"{proof.bound_claim}; {more}" if more else proof.bound_claim,
        stages=stages,
        pairs=pairs,
    )


def _lever_bound(plan: Plan, steps: Steps) -> float:
    """Return the bound on the cost of a plan from lever arms."""
    least = lever_bounds(plan, steps)
    return float(least.max() if plan.settings.objective == "max" else least.sum())


def _also_for(plan: Plan) -> str:
    """Return what else the bound of a plan holds for, and what it leaves out; "" if nothing."""
    names, what = [axis.name for axis in plan.robot.externals], []
    if plan.settings.tilt is not None:
        what.append("any tilt within the cone")
    if names:
        what.append(f"any values of {' and '.join(names)}")
    if plan.feed is not None:
        what.append("motions at the times of this plan, each interval as long as the longest")
    holds = f"holds for {' and '.join(what)}, " if what else ""
    if plan.robot.family.enclose_all is None:
        return f"{OF_BOUND}{holds}takes only lever arms into account, has no certificate"
    if not what:
        return ""
    left_out = "the acceleration limit"
    if plan.settings.tilt is not None and plan.settings.tilt.cost:
        left_out += " and the cost of the tilt"
    return f"{OF_BOUND}{holds}leaves out {left_out}, has no certificate"


def bound_steps(plan: Plan) -> Steps:
    """Return the costs and limits of the steps of motions along the contour of a plan."""
    asked = plan.settings
    return Steps.within(
        asked.limits(plan.robot),
        float(np.diff(plan.time).max()),
        weight=asked.weights,
        metric=METRIC_CODES[asked.metric],
        endless=plan.robot.endless,
    )


class _Certification:
    """The stages of one certificate, from coarse cells at a few nodes to fine cells at more."""

    def __init__(
        self,
        plan: Plan,
        steps: Steps,
        gap: float,
        until: float,
        most: float,
        checkable: bool,
        progress: Progress,
        refined: Callable[[Course], Plan | None] | None = None,
    ) -> None:
        self.margin, width = (CLEARLY, WIDER) if checkable else (SAME_COST, 1.0)
        folded = foldable(plan.robot, steps.velocity)
        floor = None if checkable else plan.settings.floor
        self.maker = cell_maker(plan, steps.weight, width, floor=floor)
        self.unfolded: CellMaker | None = None
        if folded.any() and not checkable:
            self.unfolded = self.maker
            self.maker = cell_maker(plan, steps.weight, width, folded, floor)
        self.steps = replace(steps, endless=self.maker.endless)
        self.cost, self.until, self.progress = plan.cost, until, progress
        self.target = plan.cost * min(1.0, 1 - gap + allowance(gap, checkable=checkable))
        self.last = len(plan.q) - 1
        self.most_pairs = most
        longest = max(1, int(LONGEST / self.steps.velocity.max()))
        self.goal = self.target  # of the stages, which cannot pass the ceiling
        self.nodes = self._turning(plan.increments, evenly(self.last, longest))
        self.best, self.pairs, self.count = 0.0, 0, 0
        self.first_order = FirstOrder(self.maker, self.steps, self.last)
        if len(np.unique(plan.posture)) == 1:
            self.first_order.add(int(plan.posture[0]), plan.gamma, plan.increments)
        self.at_node = 0.0  # cells of level 0
        self.stages: list[Stage] = []
        self.branches: tuple[Branch, ...] = ()
        self.plan, self.checkable, self.refined = plan, checkable, refined
        self.by_fewer = 0.0  # the bound by fewer nodes; a stage that proves less lacks finer cells
        self.potential = 0.0  # what it is expected to reach at the first layer
        self.proved = 0.0  # by the stages that are kept
        self.loose: tuple[int, StageResult] | None = None  # the best one left out, and its place

    def run(self) -> None:
        """Run stages, and divide motions, until the gap is reached or the work is spent."""
        left = self._stages_until_stalled()
        if left is not None and self.best < self.target and not self._spent(self.pairs):
            (self._divide_kept if self.checkable else self._divide)(left)

    def _stages_until_stalled(self) -> CellSet | None:
        """Run stages; return the cells that are left if their motions are to be divided."""
        cells = self.maker.coarsest(self.nodes)
        self.at_node = len(cells) / len(self.nodes)
        cells = self.maker.certain(cells, self.steps.weight, UNCERTAIN * self.cost)
        fresh = True  # new cells, which the certificate must contain
        while True:
            result = self._solved(cells, fresh)
            alone = result.bound
            coarse = alone < self.by_fewer
            if not self.checkable:
                result = result.floored()
            gained, cells = self._take(result), result.cells
            self.potential = min(alone, self.best) if fresh else self.best
            live = result.through <= self.cost * (1 + self._clearly(cells))
            if not self.checkable:
                live = np.logical_or.reduce(result.groups(live, self.maker))
            self._lower_goal(result)
            low = result.through < self.goal
            which, singular = cells_to_divide(
                cells, result.through, self.goal, self.steps.weight, DEEPEST
            )
            fine = not singular and low.any() and np.median(cells.grain[low]) >= FINE
            slow = bool(fine) and gained < STALLED
            left = float(live.mean() + which.mean())
            ahead = self.pairs + result.pairs * left**2
            fits = self._fits(len(self._layers))
            late = fine and self._late(slow, ahead)
            vain = gained < LITTLE and ahead - self.pairs > DEAR * self.most_pairs
            # Cells may be below the goal though the bound, the best of all layers, is not.
            reached = not low.any() or (not self.checkable and self.best >= self.goal)
            if not reached and fits and self._priced and (late or vain):
                return cells.take(live)
            divisible = self._few and (self.checkable or self._patient or self._priced)
            last = cells.take(live) if divisible else None
            if reached or len(cells) * left > MOST_CELLS or self._spent(ahead):
                self._finish(result)
                return last
            if fresh or not self.checkable or 1 - live.mean() > DROPPED:
                self._keep(result)
                fresh, kept = False, live
            else:
                if result.bound >= self.best:
                    self.loose = len(self.stages), result
                kept = np.ones(len(live), np.bool_)
            which &= kept
            more = self._more_nodes((slow and (self._priced or not coarse)) or not which.any())
            if len(more) > len(self.nodes) and self._fits(len(more)):
                self.nodes, self.by_fewer, fresh = more, self.best, True
                cells = self._with_nodes(cells.take(kept))
            elif not which.any() or (vain and not self._patient):
                self._finish(result)
                return last
            elif fine and (lifted := self._unfold(cells.take(live), result.pairs)) is not None:
                which = (lifted.floor < self.goal) & (lifted.grain < DEEPEST)
                cells = self.maker.divided(lifted, which)
            else:
                cells = self.maker.divided(cells.take(kept), which[kept])

    def _clearly(self, cells: CellSet) -> Array:
        """Return the share of the plan's cost (C,) by which motions clearly cost more, by cell."""
        return np.asarray(self.margin * np.exp2(2.0 * (USUAL_LEVEL - cells.grain)))

    def _solved(self, cells: CellSet, fresh: bool) -> StageResult:
        """Return the bounds of a stage, without steps that only motions dearer than the plan take.

        A checker decides by its own potential, and has all steps.
        """
        care = CARE * self.cost
        if self.checkable or not self.count:
            return solve_stage(cells, self.steps, care=care)
        low = self.potential - (LOWER_NEW if fresh else LOWER) * self.cost
        worth = self.cost * (1 + self.margin)
        return solve_stage(cells, self.steps, care=care, worth=worth, low=low)

    @cached_property
    def _few(self) -> bool:
        """Whether the layers are so few that motions are divided into tubes."""
        other = self.maker.more or self.plan.feed is not None
        most = SEVERAL if self._patient and not self.checkable else FEW
        every = not self.checkable or (len(self._layers) == self.last + 1 and self._binding)
        return not other and every and self.last > 1 and len(self._layers) <= most

    @property
    def _patient(self) -> bool:
        """Whether a time is given, which may be spent though little is to be gained."""
        return self.until < np.inf

    def _more_nodes(self, wanted: bool) -> Ints:
        """Return the nodes of the next stage: more if wanted, or if cells can gain far less."""
        near = self.first_order.cheapest(self.nodes)
        if near is not None:
            straight, motion = near
            wanting = min(motion.cost, self.cost) - straight
            if straight - self.best < MUCH_LESS * wanting:
                turning = self._turning(motion.increments, self.nodes)
                if len(turning) > len(self.nodes):
                    return turning
        return between(self.nodes) if wanted else self.nodes

    def _turning(self, increments: Array, ends: Ints) -> Ints:
        """Return nodes, with the ends among them, where a motion turns."""
        return turning_nodes(increments, self.steps.weight, self.steps.metric, TURNED, ends)

    def _lower_goal(self, result: StageResult) -> None:
        """Look for cheap motions, and lower the goal of the stages if they cannot reach it.

        A bound without (6) is at most the cost of any motion that keeps (5). With (6), the stages
        only prepare the parts.
        """
        known = self.first_order
        if self.count == 1:
            alive = np.unique(result.cells.posture[np.isfinite(result.through)])
            known.look_about(self.nodes, alive.astype(np.int64))
        if np.isfinite(result.bound):
            known.look_at(result.cells.take(result.cheapest()))
        known.cheapest(self.nodes)
        if self._priced:
            return
        little = LEAST if self._patient else LITTLE
        rest = (known.ceiling - little * self.cost) / (1 - little)
        self.goal = min(self.goal, rest)

    def _unfold(self, cells: CellSet, pairs: int) -> CellSet | None:
        """Return the cells on all turns, to be distinguished from here on; None if too many."""
        if self.unfolded is None or not len(cells):
            return None
        lifted = self.unfolded.lifted(cells)
        if self.pairs + pairs * len(lifted) / len(cells) > UNFOLDED * self.most_pairs:
            return None
        self.maker, self.unfolded = self.unfolded, None
        self.steps = replace(self.steps, endless=self.maker.endless)
        return lifted

    @cached_property
    def _layers(self) -> Ints:
        """Nodes on which (6) is used."""
        if self.last < (SEVERAL if self._patient else FEW):
            return np.arange(self.last + 1)
        return self.steps.layers(0, self.last)

    @cached_property
    def _binding(self) -> bool:
        """Whether the plan is at a limit of acceleration."""
        share = np.abs(self.plan.acceleration_share)
        return bool((share > AT_LIMIT * self.plan.settings.eta_a).any())

    @cached_property
    def _priced(self) -> bool:
        """Whether (6) adds more to the cost of the plan than the gap that may be left."""
        if self.checkable or self.maker.more or self.plan.feed is not None:
            return False
        if not self._binding:
            return False
        posture = int(np.bincount(self.plan.posture).argmax())
        nodes = np.arange(self.last + 1)
        near = (self._prices(nodes, self.plan.gamma, posture, NARROW, most) for most in DEAREST)
        spans = np.diff(nodes)
        change = self.steps.changes(self.plan.q, 0.0, spans)
        most = max(self.steps.price(prices, spans, change) for prices in near)
        return most > self.cost - self.target

    def _prices(
        self, nodes: Ints, gamma: Array, posture: int, reach: float, most: float
    ) -> Array | None:
        """Return multipliers of (6) for the motion with gamma (M,) at nodes; None if none."""
        if self._spent(self.pairs):
            return None
        q, slope, reached = self.maker.joints(nodes, gamma, posture)
        if not reached.all():
            return None
        u = np.diff(q, axis=0)
        u -= 2 * np.pi * np.rint(u / (2 * np.pi))
        spans = np.diff(nodes)
        change = self.steps.changes(q, 0.0, spans)
        return limit_prices(u, slope, self.steps, spans, reach, most, change)

    def _divide(self, cells: CellSet) -> None:
        """Continue with multipliers of (6), part by part: in tubes, or at the layers of (6)."""
        self.nodes = self._layers
        cells = self._with_nodes(cells.take(np.isin(cells.node, self.nodes)), COARSE)
        before = self.pairs

        def enough(pairs: int, held: int) -> bool:
            short = max(self.target - self.best, 0.0)
            self.progress("certificate", int(1000 * (1 - short / self.target)), 1000)
            return held > MOST_CELLS or self._spent(before + pairs)

        begun = monotonic()

        def enough_parts(pairs: int, held: int) -> bool:
            if not self._few:
                ended = False
            elif len(self._layers) <= FEW:
                ended = pairs > PARTS * self.most_pairs
            else:
                ended = monotonic() > begun + HALF * (self.until - begun)
            return ended or enough(pairs, held)

        parts = Parts(
            self.maker,
            self.steps,
            partial(self._prices, self._layers),
            self.plan.gamma[self.nodes],
            cost=self.cost,
            target=self.target,
            enough=enough_parts,
        )
        self._took(parts, parts.bound(cells, self.best))
        if not self._few or self.best >= self.target or self._spent(self.pairs):
            return
        before = self.pairs
        tubes = Tubes(
            self.maker,
            self.steps,
            self.nodes,
            cost=self.cost,
            target=self.target,
            enough=enough,
            cheaper=self._cheaper,
        )
        bound = tubes.bound(parts.left)
        self._took(tubes, min(bound, self.target))

    def _divide_kept(self, cells: CellSet) -> None:
        """Continue in tubes, at all nodes, and keep their proof."""
        self.nodes = self._layers
        cells = self._with_nodes(cells, COARSE)
        before, posture = self.pairs, int(np.bincount(self.plan.posture).argmax())
        made = (self._prices(self.nodes, self.plan.gamma, posture, NARROW, m) for m in DEAREST)

        def enough(pairs: int, held: int) -> bool:
            return held > MOST_CELLS or self._spent(before + pairs)

        tubes = KeptTubes(
            self.maker,
            self.steps,
            self.nodes,
            cost=self.cost,
            target=self.target,
            enough=enough,
            clearly=self._clearly,
            prices=[nu for nu in made if nu is not None],
        )
        bound = min(tubes.bound([(self.best, cells)]), self.target)
        self._took(tubes, bound)
        self.branches = tubes.branches

    def _cheaper(self, course: Course) -> float:
        """Take the plan that a course leads to if it costs less; return its cost, or infinity."""
        every = len(self.nodes) == self.last + 1
        other = self.refined(course) if every and self.refined is not None else None
        if other is None or other.cost >= self.cost:
            return np.inf
        self.target *= other.cost / self.cost
        self.plan, self.cost = other, other.cost
        return other.cost

    def _took(self, parts: Parts | Tubes, bound: float) -> None:
        """Update bound and work with those of parts."""
        self.best = max(self.best, min(bound, self.cost))
        self.pairs, self.count = self.pairs + parts.pairs, self.count + parts.count

    def _keep(self, result: StageResult) -> None:
        """Add a stage to the certificate."""
        self.stages.append(result.stage())
        self.proved = max(self.proved, result.bound)

    def _finish(self, result: StageResult) -> None:
        """Add the last stage, and the stage that proves the bound if no kept one does.

        Stages with more nodes and other potentials may prove less. A stage that was left out ruled
        no cells out, so the stages after it cover the same motions.
        """
        self._keep(result)
        if self.loose is not None and self.proved < self.best:
            place, best = self.loose
            self.stages.insert(place, best.stage())

    def _take(self, result: StageResult) -> float:
        """Update the bound with a stage; return the share of the gap that it closes."""
        before, self.best = self.best, max(self.best, min(result.bound, self.cost))
        self.pairs, self.count = self.pairs + result.pairs, self.count + 1
        short = max(self.target - self.best, 0.0)
        self.progress("certificate", int(1000 * (1 - short / self.target)), 1000)
        return (self.best - before) / max(self.target - before, 1e-300)

    def _late(self, slow: bool, ahead: float) -> bool:
        """Return whether to use multipliers of (6) now; a stage more makes it `ahead` steps."""
        close = slow and self.best > NEAR * self.target
        return close or ahead > EARLY * self.most_pairs

    def _fits(self, nodes: int) -> bool:
        """Return whether coarse cells at this number of nodes are few enough."""
        return nodes * self.at_node <= MOST_CELLS

    def _spent(self, pairs: float) -> bool:
        """Return whether the time is over, or this number of steps exceeds the limit on work."""
        if self.until < np.inf:
            return monotonic() > self.until
        return pairs > self.most_pairs

    def _with_nodes(self, cells: CellSet, most: int = DEEPEST) -> CellSet:
        """Return the cells plus those of further nodes, similarly fine where motions may pass.

        They are one level coarser, as many drop out before they are halved; few do if (6) decides.
        """
        level = 0
        if len(cells):
            level = min(most, int(np.median(cells.grain)) - (not self._priced))
        missing = np.setdiff1d(self.nodes, cells.node)
        if not len(missing):
            return cells
        new = self.maker.coarsest(missing)
        while True:
            passed = linked(CellSet.join([cells, new]), self.steps)[len(cells) :]
            unsure = new.uncertain(self.steps.weight, UNCERTAIN * self.cost)
            coarse = passed & ((new.grain < level) | unsure)
            if not coarse.any() or len(new) > MOST_CELLS or self._spent(self.pairs):
                return CellSet.join([cells, new])
            new = self.maker.divided(new, coarse)
