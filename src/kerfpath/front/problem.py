"""The multi-objective problem: a contour on its graph, the criteria, and how runs are solved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import ClassVar, NotRequired, TypedDict, get_args

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, freeze, short_repr
from kerfpath.auditor import audit as full_audit
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.kernels.metric import turns_of
from kerfpath.losses import Loss, Reason
from kerfpath.options import PlanOptions
from kerfpath.planner import (
    best_motion,
    graph_over_courses,
    layered_graph,
    node_interval,
    plan,
    refined_motion,
    relaxations,
    require_rates_alone,
)
from kerfpath.plans import Plan, on_turns
from kerfpath.refiner import Goal, GoalKind
from kerfpath.robots import Robot
from kerfpath.search import Course, Metric, ObjectiveKind, Relaxations
from kerfpath.setup import Setup

# -----------------------------------------------------------------------------
# Subproblems: the settings of one run of the planner, and a plain grid of such settings.

LEVELS = (0.25, 4.0)
"""Factors on the weight of one joint at a time, in the grid."""
SHARES = (1.0, 0.9, 0.8)
"""Factors on eta in the grid."""


class SubproblemData(TypedDict):
    """A subproblem as JSON data; the window of a joint is null where it has none.

    A missing `continuous` means a run on the grid of gamma.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: list[float]
    eta_v: float
    eta_a: float
    window: list[list[float] | None]
    clearance: float
    continuous: NotRequired[bool]
    explored: NotRequired[bool]
    begin: NotRequired[list[CourseData]]
    goals: NotRequired[list[GoalData]]


class GoalData(TypedDict):
    """A goal of a refinement as JSON data, see `kerfpath.refiner.Goal`."""

    kind: GoalKind
    weight: list[float]
    price: float
    most: float


class CourseData(TypedDict):
    """A motion as JSON data: gamma (K,) and joints (K, n) in rad, posture (K,)."""

    gamma: list[float]
    q: list[list[float]]
    posture: list[int]


def course_data(course: Course) -> CourseData:
    """Return a motion as JSON data, from which `course_from` restores it exactly."""
    return {
        "gamma": course.gamma.tolist(),
        "q": course.q.tolist(),
        "posture": course.posture.tolist(),
    }


def course_from(data: CourseData) -> Course:
    """Return the motion that `course_data` wrote."""
    gamma, q, posture = (np.array(data[name]) for name in ("gamma", "q", "posture"))
    return Course(gamma, q, posture)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subproblem:
    """The objective and the epsilon constraints of one run of the planner.

    Parameters
    ----------
    objective, metric, eta_v, eta_a
        As in `kerfpath.plan`.
    weights : (n,) 1/rad
        Weights of the joint-space distance.
    window : (n, 2) rad
        Range that each joint must stay in (modulo 2 pi where it is endless); infinite where the
        joint has no window.
    clearance : float m
        Clearance of robot and head from all other bodies, beyond the near-miss distance.
    continuous : bool
        Whether gamma is continuous instead of on its grid.
    explored : bool
        Whether a continuous run explores all valleys.
    begin : tuple of Course
        Known motions from which a continuous run is refined; none: it searches everywhere.
    goals : tuple of Goal
        Criteria that such a refinement improves together, each held to its value, instead of the
        objective; none: the objective.
    """

    objective: ObjectiveKind
    metric: Metric
    weights: Array
    eta_v: float
    eta_a: float
    window: Array
    clearance: float = 0.0
    continuous: bool = False
    explored: bool = False
    begin: tuple[Course, ...] = ()
    goals: tuple[Goal, ...] = ()

    __repr__ = short_repr

    @classmethod
    def unbounded(cls, weights: Array, eta_v: float, eta_a: float) -> Subproblem:
        """Return the subproblem of least displacement with the full limits and no window."""
        return cls(
            objective="sum",
            metric="manhattan",
            weights=weights,
            eta_v=eta_v,
            eta_a=eta_a,
            window=freeze(np.tile([-np.inf, np.inf], (len(weights), 1))),
        )

    def applied_to(self, options: PlanOptions) -> PlanOptions:
        """Return the options with the settings of this subproblem, without costs of reversals."""
        return replace(
            options.without_reversals,
            method="continuous" if self.continuous else "exact",
            objective=self.objective,
            metric=self.metric,
            weights=self.weights,
            eta_v=self.eta_v,
            eta_a=self.eta_a,
        )

    def graph(self, graph: LayeredGraph, endless: Bools) -> LayeredGraph:
        """Return the layered graph without the vertices outside the windows, counted by joint."""
        outside = {}
        for joint in self.windowed(endless):
            low, high = self.window[joint]
            inside = is_in_window(graph.q[:, joint], low, high - low, endless=bool(endless[joint]))
            outside[Reason(Loss.WINDOW, joint + 1)] = ~inside
        return graph.without(outside) if outside else graph

    def windowed(self, endless: Bools) -> list[int]:
        """Return the joints with an effective window: finite, and below a turn where endless."""
        width = np.diff(self.window)[:, 0]
        narrow = np.isfinite(width) & ~(endless & (width >= 2 * np.pi))
        return [int(joint) for joint in np.flatnonzero(narrow)]

    def cell(self, cell: Cell | None) -> Cell | None:
        """Return the cell in which the clearance is kept beyond its near-miss distance."""
        if cell is None or not self.clearance:
            return cell
        names = [cell.pair_names[p] for p in np.flatnonzero(counts_as_clearance(cell))]
        asked = dict.fromkeys(names, cell.near_miss + self.clearance)
        return replace(cell, near_miss_of={**cell.near_miss_of, **asked})

    def quicker(self, factor: float) -> Subproblem:
        """Return the subproblem whose plans also keep the limits at `factor` times the speed."""
        return replace(self, eta_v=self.eta_v / factor, eta_a=self.eta_a / factor**2)

    def to_data(self) -> SubproblemData:
        """Return the subproblem as JSON data, from which `from_data` restores it exactly."""
        data: SubproblemData = {
            "objective": self.objective,
            "metric": self.metric,
            "weights": self.weights.tolist(),
            "eta_v": self.eta_v,
            "eta_a": self.eta_a,
            "window": [p if np.isfinite(p).all() else None for p in self.window.tolist()],
            "clearance": self.clearance,
        }
        if self.continuous:
            data["continuous"] = True
        if self.explored:
            data["explored"] = True
        if self.begin:
            data["begin"] = [course_data(course) for course in self.begin]
        if self.goals:
            data["goals"] = [
                {"kind": g.kind, "weight": g.weight.tolist(), "price": g.price, "most": g.most}
                for g in self.goals
            ]
        return data

    @classmethod
    def from_data(cls, data: SubproblemData) -> Subproblem:
        """Return the subproblem that `to_data` wrote."""
        free = [-np.inf, np.inf]
        window = [free if pair is None else pair for pair in data["window"]]
        weights = freeze(np.array(data["weights"], dtype=np.float64))
        return cls(
            objective=data["objective"],
            metric=data["metric"],
            weights=weights,
            eta_v=data["eta_v"],
            eta_a=data["eta_a"],
            window=freeze(np.array(window)),
            clearance=data["clearance"],
            continuous=data.get("continuous", False),
            explored=data.get("explored", False),
            begin=tuple(course_from(course) for course in data.get("begin", ())),
            goals=tuple(
                Goal(
                    kind=goal["kind"],
                    weight=freeze(np.array(goal["weight"], dtype=np.float64)),
                    price=goal["price"],
                    most=goal["most"],
                )
                for goal in data.get("goals", ())
            ),
        )


def grid(first: Subproblem, rng: np.random.Generator) -> Iterator[Subproblem]:
    """Yield a plain grid over objective, metric, weights and eta, in random order.

    Then yield it again with levels closer to those of the first run, and so on.
    """
    n = len(first.weights)
    kinds = list(product(get_args(ObjectiveKind), get_args(Metric), SHARES, SHARES, range(2 * n)))
    depth = 1
    while True:
        for number in rng.permutation(len(kinds)):
            objective, metric, share_v, share_a, which = kinds[number]
            weights = first.weights.copy()
            weights[which // 2] *= LEVELS[which % 2] ** (1 / depth)
            yield replace(
                first,
                objective=objective,
                metric=metric,
                weights=freeze(weights),
                eta_v=first.eta_v * share_v ** (1 / depth),
                eta_a=first.eta_a * share_a ** (1 / depth),
            )
        depth += 1


def is_in_window(q: Array, low: float, width: float, *, endless: bool) -> Bools:
    """Return which values (N,) of a joint are in a window, modulo 2 pi where it is endless."""
    above = (q - low) % (2 * np.pi) if endless else q - low
    return np.asarray((above >= 0) & (above <= width))


def counts_as_clearance(cell: Cell) -> Bools:
    """Return which judged pairs (P,) count: robot or head against other bodies of the cell.

    Pairs with their own near-miss distance, such as nozzle and part, are close by design, and links
    may be close to each other whatever the arm does.
    """
    moving = np.array([cell.bodies[b].kind in ("robot", "head") for b in cell.pairs.ravel()])
    one, two = moving.reshape(-1, 2).T
    return np.asarray((one != two) & ~cell.own, dtype=np.bool_)


# -----------------------------------------------------------------------------
# One run of the planner, on the grid of gamma or over continuous gamma in the same windows.
#
# External axes follow the courses of the best plans on the grid, and may leave them off the grid.


def follows_courses(robot: Robot, options: PlanOptions) -> bool:
    """Return whether runs on the grid use courses of the free joints instead of a grid of them."""
    return bool(robot.free.size) and options.method == "continuous"


def graph_of_runs(
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph that all runs of a front share.

    Arguments are as in `kerfpath.plan`; the options are those of the front, not of one run.

    Raises
    ------
    NoFeasiblePath
        No course of the external axes leads to a plan.
    InputError
        As `kerfpath.plan`.
    """
    if not follows_courses(setup.robot, options):
        return layered_graph(
            contour,
            setup.robot,
            tool=setup.tool,
            placement=setup.placement,
            options=options,
            progress=progress,
        )
    asked = replace(options, feed="constant", certify=None)
    return graph_over_courses(contour, setup, asked, speed=speed, progress=progress)


def plan_run(
    run: Subproblem,
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None,
    graph: LayeredGraph,
    phase: Callable[[str], None] | None = None,
) -> Plan:
    """Return the plan of a run.

    On the grid, windows remove vertices. Over continuous gamma they also become joint limits, so
    that the motion between samples stays in them; where they leave a node without a vertex, a
    course of the external axes is searched within them. A plan over continuous gamma keeps the
    run's shares of the limits, but states those of `options`, which apply to other moves and to its
    proof.

    Parameters
    ----------
    run : Subproblem
    contour, speed, phase
        As in `kerfpath.plan`.
    setup : Setup
    options : PlanOptions
        Options of the front; the run replaces some of them.
    graph : LayeredGraph
        The graph of the contour with all its vertices.

    Raises
    ------
    NoFeasiblePath
        As `kerfpath.plan`; over continuous gamma also where no motion is found, or a window cannot
        become a joint limit.
    InputError
        As `kerfpath.plan`.
    """
    robot, cell = setup.robot, run.cell(setup.cell)
    asked = run.applied_to(options)
    if not run.begin:
        graph = run.graph(graph, robot.endless)
    if not run.continuous:
        return plan(
            contour,
            robot,
            tool=setup.tool,
            placement=setup.placement,
            speed=speed,
            options=asked,
            cell=cell,
            graph=graph,
            phase=phase,
        )
    narrowed, windowed = robot, run.windowed(robot.endless)
    if windowed:
        _require_ranges(asked, windowed)
        narrowed, graph = _narrowed(robot, graph, run.window, windowed, asked)
        cell = cell and cell.with_endless(narrowed.endless)
    there = replace(setup, robot=narrowed, cell=cell)
    if run.begin:
        made = refined_motion(
            contour,
            there,
            asked,
            speed=speed,
            graph=graph,
            begin=run.begin,
            goals=run.goals,
        )
    else:
        empty = robot.externals and not graph.has_poses_throughout
        made = best_motion(
            contour,
            there,
            asked,
            speed=speed,
            graph=None if empty else graph,
            phase=phase,
            explored=run.explored,
        )
    limits = replace(made.settings, eta_v=options.eta_v, eta_a=options.eta_a)
    return replace(_widened(made, robot) if windowed else made, settings=limits)


def _require_ranges(options: PlanOptions, windowed: list[int]) -> None:
    """Raise NoFeasiblePath where turning windows into joint limits would change other terms too."""
    why = ""
    comfort = options.comfort
    if comfort is not None and comfort.limits is not None and comfort.limits.cost:
        why = "comfort has a penalty close to joint limits, which a window would move"
    elif options.rotation is not None and np.isfinite(options.rotation[windowed]).any():
        why = "the rotation of a joint with a window is limited"
    if why:
        raise NoFeasiblePath(f"windows hold on the grid only: {why}", proved=False, node=-1)


def _narrowed(
    robot: Robot, graph: LayeredGraph, window: Array, windowed: list[int], options: PlanOptions
) -> tuple[Robot, LayeredGraph]:
    """Return the robot with joint limits at the windows, and the graph on the turns within them.

    Where a margin is kept from limits, the limits lie beyond the windows by that margin.
    """
    band = None if options.comfort is None else options.comfort.limits
    margin = 0.0 if band is None else band.margin
    limits = robot.joint_limits()
    lower, upper, endless = limits.lower.copy(), limits.upper.copy(), robot.endless.copy()
    q, turn = graph.q.copy(), graph.turn.copy()
    for joint in windowed:
        low, high = window[joint]
        if endless[joint]:
            q[:, joint] = low + (q[:, joint] - low) % (2 * np.pi)
            turn[:, joint] = turns_of(q[:, joint])
            lower[joint], upper[joint], endless[joint] = low - margin, high + margin, False
        else:
            lower[joint] = max(lower[joint], low - margin)
            upper[joint] = min(upper[joint], high + margin)
    narrowed = robot.with_limits(lower=lower, upper=upper, endless=endless)
    return narrowed, replace(graph, q=freeze(q), turn=freeze(turn))


def _widened(made: Plan, robot: Robot) -> Plan:
    """Return a plan of the robot with narrowed limits as a plan of the original robot."""
    q, turn = on_turns(robot, made.q)
    return replace(made, robot=robot, q=q, turn=turn)


# -----------------------------------------------------------------------------
# The problem and its criteria.

DIGITS = 12
"""Significant digits of a criterion."""
ROOM = 1e-8
"""rad, and share of a limit: by how much windows and shares are wider than in the motion that they
hold. A refinement leaves as much free, so that it begins within them and ends as good."""
SMALLEST, ZERO, TINY = 0.01, 5e-7, 1e-9
"""Shares of the scale of a criterion: a value counts as at least the first when it is traded, and
one below that may be worse by the second; and the least value that is held, in any unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """A criterion for comparing plans; the subclasses are in `kerfpath.front.criteria`.

    Parameters
    ----------
    name : str
        Name in `pareto`.
    words : str
        Name in pages and tables.
    unit : str
    joint : int, optional
        The joint that it measures, from 0; None: all joints together.
    """

    name: str
    words: str
    unit: str
    joint: int | None = None

    more_is_better: ClassVar[bool] = False
    exact_anchor: ClassVar[bool] = False
    """Whether the best of the first runs in this criterion is the best on the graph."""
    bounded: ClassVar[bool] = False
    """Whether `bound` and `hold` can bound a run to a value of this criterion."""
    aimed: ClassVar[bool] = False
    """Whether its anchor minimises exactly this criterion; other terms only break ties."""

    __repr__ = short_repr

    @property
    def sense(self) -> float:
        """1 where less is better, -1 where more is."""
        return -1.0 if self.more_is_better else 1.0

    def require(self, options: PlanOptions, cell: Cell | None, home: ArrayLike | None) -> None:
        """Raise InputError where something that the criterion needs is missing."""

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        """Return the value of the criterion for a plan, in its unit."""
        raise NotImplementedError  # every quantity has its own

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        """Return the subproblem that should find its best value or come near it, or None."""
        return None

    def bound(
        self, run: Subproblem, value: float, gap: Gap, problem: ParetoProblem,
        rng: np.random.Generator,
    ) -> Subproblem:  # fmt: skip
        """Return a subproblem with the epsilon constraint that bounds the criterion to a value."""
        raise NotImplementedError  # asked of none that is not `bounded`

    def hold(
        self, run: Subproblem, value: float, spans: Array, problem: ParetoProblem
    ) -> Subproblem:
        """Return a subproblem bounded to be as good in this criterion as a plan.

        The plan has this value and joint spans (n, 2) rad, and keeps the bound itself. The
        subproblem is unchanged where the criterion cannot be bounded.
        """
        return run

    def goal(self, value: float, problem: ParetoProblem) -> Goal | None:
        """Return the goal of a refinement that is to be no worse than a value, at a price of 1.

        None where refinements cannot trade this criterion.
        """
        return None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """The data of a plan that the search uses: losses (C,) and its motion.

    Losses are the criteria with signs such that less is better.
    """

    losses: Array
    course: Course

    __repr__ = short_repr

    @property
    def spans(self) -> Array:
        """Lowest and highest joint values (n, 2) in rad; endless joints are not wrapped."""
        q = self.course.q
        return np.stack([q.min(axis=0), q.max(axis=0)], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution(Evaluation):
    """The evaluation of a run that has a plan, its number among all runs and its subproblem."""

    number: int
    run: Subproblem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gap:
    """Two neighbours on the front in a criterion; `better` is None beyond the best solution."""

    criterion: int
    better: Solution | None
    worse: Solution

    __repr__ = short_repr

    @property
    def key(self) -> tuple[int, int, int]:
        """Key of the gap, which does not depend on the rest of the front."""
        better, worse = self.better, self.worse
        return (self.criterion, *((-1, -1) if better is None else (better.number, worse.number)))


@dataclass(frozen=True, kw_only=True, eq=False)
class ParetoProblem:
    """A contour to plan on one layered graph, and the criteria that compare its plans.

    Parameters
    ----------
    contour, speed, options, graph
        As in `kerfpath.plan`; the runs change some of the options.
    setup : Setup
    criteria : tuple of Criterion
    home : (n,) rad, optional
        Where the arm comes from and goes back to.
    audit : callable, optional
        Returns the faults of a plan; default: `kerfpath.audit`, with the cell.
    """

    contour: Contour
    setup: Setup
    speed: float | None
    options: PlanOptions
    graph: LayeredGraph
    criteria: tuple[Criterion, ...]
    home: Array | None = None
    audit: Callable[[Plan], Sequence[object]] | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        require_rates_alone(self.robot, "the Pareto set")

    @property
    def robot(self) -> Robot:
        """The robot of the setup."""
        return self.setup.robot

    @cached_property
    def dt(self) -> float:
        """Time from node to node (s)."""
        return node_interval(self.contour, self.speed)

    @cached_property
    def unbounded(self) -> Subproblem:
        """The first run: the full limits and no window."""
        velocity, _ = self.robot.speed_limits()
        weights = freeze(1 / (velocity * self.dt))
        return Subproblem.unbounded(weights, self.options.eta_v, self.options.eta_a)

    @cached_property
    def least(self) -> Relaxations:
        """The least shares of the limits and the least node interval for which there is a path."""
        eta_v, eta_a = self.options.eta_v, self.options.eta_a
        return relaxations(
            self.contour, self.robot, self.graph, self.speed, eta_v=eta_v, eta_a=eta_a
        )

    def first_runs(self) -> list[Subproblem]:
        """Return the unbounded run, and one for the best of each criterion that has an anchor."""
        anchors = [criterion.anchor(self) for criterion in self.criteria]
        return [self.unbounded, *(run for run in anchors if run is not None)]

    @property
    def continuous(self) -> bool:
        """Whether there are also runs over continuous gamma."""
        return self.options.method == "continuous" and self.robot.family.free_rotation

    @property
    def refinable(self) -> bool:
        """Whether runs may begin with known motions: joints follow from gamma and posture alone."""
        return self.continuous and self.options.tilt is None and not self.robot.free.size

    @property
    def free_joints(self) -> int:
        """Number of leading joints that windows may narrow: those that follow no given course."""
        along = follows_courses(self.robot, self.options)
        return self.robot.family.joints if along else self.robot.joints

    def as_good(self, solution: Solution) -> Subproblem:
        """Return a run bounded to be as good as a plan in all criteria that can be bounded."""
        aim = self._aim or solution.run
        run = replace(
            self.unbounded, objective=aim.objective, metric=aim.metric, weights=aim.weights
        )
        for criterion, loss in zip(self.criteria, solution.losses, strict=True):
            run = criterion.hold(run, float(loss) * criterion.sense, solution.spans, self)
        return run

    def refining(self, solution: Solution, begin: tuple[Course, ...], scale: Array) -> Subproblem:
        """Return a run that improves a plan in all criteria together, from known motions.

        None gets worse; criteria that refinements cannot trade are bounded where that is possible.
        The price of a criterion is 1 for its whole value, which counts as at least `SMALLEST` of
        `scale` (C,). If no criterion can be traded, the run is that of `as_good`.
        """
        run, goals = replace(self.unbounded, continuous=True, begin=begin), list[Goal]()
        losses = zip(self.criteria, solution.losses, scale, strict=True)
        for criterion, loss, size in losses:
            goal = criterion.goal(value := float(loss) * criterion.sense, self)
            if goal is None:
                run = criterion.hold(run, value, solution.spans, self)
                continue
            unit = criterion.goal(1.0, self)
            assert unit is not None, "it has a goal for any value"
            least = unit.most * SMALLEST * size
            # A value that is nothing up to rounding is held to what fronts do not tell apart.
            room = ZERO * unit.most * size if abs(value) < SMALLEST * size else 0.0
            price = goal.price / max(goal.most, least, TINY)
            goals.append(replace(goal, price=price, most=goal.most * (1 + ROOM) + room + TINY))
        if not goals:
            return replace(self.as_good(solution), continuous=True, begin=begin)
        return replace(run, goals=tuple(goals))

    @cached_property
    def _aim(self) -> Subproblem | None:
        """The run that minimises the only criterion that cannot be bounded, if there is just one.

        If there is none, the run for the first criterion that a run can minimise. None means that
        each solution keeps the objective of its own run.
        """
        free = [criterion for criterion in self.criteria if not criterion.bounded]
        if len(free) > 1:
            return None
        aimed = [each for each in free or self.criteria if each.aimed]
        return (aimed[0].anchor(self) or self.unbounded) if aimed else None

    def solve(self, run: Subproblem, *, first: bool = False) -> Plan | str:
        """Return the plan of a run, if it passes its audit; otherwise the reason in a few words.

        Raises
        ------
        NoFeasiblePath
            The `first` run, which has the full limits, has no path, and all runs are on the grid,
            so that no other run can have one.
        """
        try:
            made = plan_run(
                run,
                self.contour,
                self.setup,
                self.options,
                speed=self.speed,
                graph=self.graph,
            )
        except NoFeasiblePath as broken:
            if first and not self.continuous:
                message = (
                    f"{broken}; this run had the full limits, so no run can have a plan. All runs "
                    "use the grid of the rotation: if kerfpath plan finds a motion by refinement, "
                    'choose a finer gamma_step_deg, a lower speed or method "continuous" here'
                )
                raise broken.with_message(message) from None
            counts = broken.counts
            if run.continuous and not counts:
                return "no motion found off the grid"
            if windows := broken.lost_by(Loss.WINDOW):
                return f"no pose in the {windows[0]}"
            return f"no edge within {max(counts, key=counts.__getitem__, default='the seam')}"
        wrong = self._faults(made)
        return f"audit: {getattr(wrong[0], 'code', wrong[0])}" if wrong else made

    def _faults(self, made: Plan) -> Sequence[object]:
        """Return the faults of a plan: by the tip's straight moves, or by even moves of the joints.

        The second only if the controller may move so, as where a motion passes a singularity.
        """
        if self.audit is not None:
            return self.audit(made)
        wrong = full_audit(made, cell=self.setup.cell)
        if wrong and self.options.interpolation == "joint":
            evenly = full_audit(made, cell=self.setup.cell, interpolation="joint")
            return evenly and wrong
        return wrong

    def evaluate(self, made: Plan) -> Evaluation:
        """Return the losses and joint spans of a plan.

        Criteria are rounded to `DIGITS` digits, so that a motion found twice with different
        rounding errors counts once.
        """
        values = [each.sense * each.value(made, self) for each in self.criteria]
        return Evaluation(
            losses=freeze(np.array([float(f"{value:.{DIGITS}g}") for value in values])),
            course=Course(made.gamma, made.unwrapped, made.posture),
        )
