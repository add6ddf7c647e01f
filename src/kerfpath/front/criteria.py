"""The criteria of the Pareto front, registered by name in `CRITERIA` and `JOINT_CRITERIA`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, freeze
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES
from kerfpath.errors import InputError
from kerfpath.front.problem import (
    ROOM,
    Criterion,
    Gap,
    ParetoProblem,
    Subproblem,
    counts_as_clearance,
    is_in_window,
)
from kerfpath.kernels.metric import increments
from kerfpath.options import PlanOptions
from kerfpath.planner import longest_step
from kerfpath.plans import PLACING, Plan
from kerfpath.refiner import Goal, GoalKind
from kerfpath.robots import Robot
from kerfpath.transfer import least_time

FAINT = 1e-6
"""Weight of the other joints in a criterion of one joint; they only decide between equals."""
ROUNDING = 1e-9
"""Share by which limits are widened against rounding."""
TRIES = 8
"""Number of windows tried to find one with a pose of every node before a run uses it."""


class PerJoint(Criterion):
    """A criterion of one joint, or the sum over all joints, each divided by its velocity limit."""

    field: ClassVar[str]
    """Its name in `kerfpath.plans.Criteria`."""
    kind: ClassVar[GoalKind]
    """The kind of its goal."""

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        values: Array = getattr(plan.criteria, self.field)
        if self.joint is not None:
            return float(values[self.joint])
        return float((values / plan.robot.speed_limits()[0]).sum())

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        if self.joint is None:
            return None
        weights = FAINT * problem.unbounded.weights
        weights[self.joint] = problem.unbounded.weights[self.joint]
        return replace(problem.unbounded, weights=freeze(weights))

    def goal(self, value: float, problem: ParetoProblem) -> Goal:
        velocity, _ = problem.robot.speed_limits()
        one = np.arange(len(velocity)) == self.joint
        weight = 1 / velocity if self.joint is None else one.astype(np.float64)
        return Goal(kind=self.kind, most=value, weight=freeze(weight))


class Displacement(PerJoint):
    """Total displacement (7); the unbounded run is best for all joints together."""

    field, kind = "displacement", "way"
    exact_anchor = aimed = True


class Increment(PerJoint):
    """Largest increment (8)."""

    field, kind = "largest_increment", "step"
    exact_anchor = aimed = True

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        alone = PerJoint.anchor(self, problem)
        return alone and replace(alone, objective="max", metric="chebychev")


class Range(PerJoint):
    """Coordinate range (9), bounded by windows on the joints."""

    field, kind = "range", "span"
    bounded = True

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        if self.joint is None:
            return replace(problem.unbounded, metric="euclid")
        return PerJoint.anchor(self, problem)

    def bound(
        self, run: Subproblem, value: float, gap: Gap, problem: ParetoProblem,
        rng: np.random.Generator,
    ) -> Subproblem:  # fmt: skip
        """Return a subproblem with windows that bound the range to a value.

        The windows lie around the joints' spans in the better plan, inside those of the worse one
        or, for a single joint, anywhere that leaves every node a pose.
        """
        a, b = gap.better, gap.worse
        widths = [np.ptp(solution.spans, axis=1) for solution in (a or b, b)]
        around = a is not None and bool(rng.integers(2))
        window = run.window.copy()
        if self.joint is None:
            joints = np.arange(len(window))
            velocity, _ = problem.robot.speed_limits()
            if around and a is not None:
                low = np.minimum(a.spans[:, 0], b.spans[:, 0])
                more = np.maximum(a.spans[:, 1], b.spans[:, 1]) - low - widths[0]
                had, all_more = (float((w / velocity).sum()) for w in (widths[0], more))
                width = widths[0] + min(1.0, (value - had) / max(all_more, ROOM)) * more
            else:
                width, shares, free = widths[1].copy(), widths[1] / velocity, problem.free_joints
                left = max(0.0, value - float(shares[free:].sum()))
                width[:free] = width[:free] * left / float(shares[:free].sum())
        else:
            joints = np.array([self.joint])
            width = np.full(len(window), value)
        place = rng.uniform(size=len(window))
        held = a.spans if around and a is not None else b.spans
        low = held[:, 0] + place * (np.ptp(held, axis=1) - width)
        if self.joint is not None and rng.integers(2):
            low[self.joint] = self._elsewhere(problem, value, low[self.joint], rng)
        window[joints] = np.stack([low - ROOM, low + width + ROOM], axis=1)[joints]
        return replace(run, window=freeze(window))

    def hold(
        self, run: Subproblem, value: float, spans: Array, problem: ParetoProblem
    ) -> Subproblem:
        window = run.window.copy()
        joints = slice(None) if self.joint is None else [self.joint]
        window[joints] = (spans + np.array([-ROOM, ROOM]))[joints]
        return replace(run, window=freeze(window))

    def _elsewhere(
        self, problem: ParetoProblem, width: float, otherwise: float, rng: np.random.Generator
    ) -> float:
        """Return the start of a window of the joint with a pose of every node, or `otherwise`.

        Only windows that start at a vertex are tried, because the span of every path does.
        """
        graph, endless = problem.graph, bool(problem.robot.endless[self.joint])
        q = graph.q[:, self.joint]
        for _ in range(TRIES):
            low = q[rng.integers(len(q))]
            inside = is_in_window(q, low, width, endless=endless)
            if np.logical_or.reduceat(inside, graph.start[:-1]).all():
                return float(low)
        return otherwise


class Peak(Criterion):
    """A largest share of a limit, of any joint."""

    kind: ClassVar[GoalKind]
    """The kind of its goal."""

    def usable(self, problem: ParetoProblem) -> float:
        """Return the share of the limit that runs may use."""
        raise NotImplementedError  # every limit has its own

    def goal(self, value: float, problem: ParetoProblem) -> Goal:
        most = value / self.usable(problem)
        return Goal(kind=self.kind, most=most)


class Velocity(Peak):
    """Largest increment (8) of any joint, as a share of its velocity limit."""

    exact_anchor = bounded = aimed = True
    kind = "velocity"

    def usable(self, problem: ParetoProblem) -> float:
        return problem.options.eta_v

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        return float(plan.criteria.peak_velocity.max())

    def anchor(self, problem: ParetoProblem) -> Subproblem:
        return replace(problem.unbounded, objective="max", metric="chebychev")

    def bound(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, eta_v=value)

    def hold(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, eta_v=min(run.eta_v, value * (1 + ROOM)))


class Acceleration(Peak):
    """Largest second difference (6) of any joint, as a share of its acceleration limit."""

    exact_anchor = bounded = True
    kind = "acceleration"

    def usable(self, problem: ParetoProblem) -> float:
        return problem.options.eta_a

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        return float(plan.criteria.peak_acceleration.max())

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        eta_a = problem.least.eta_a
        if eta_a is None or eta_a > problem.options.eta_a:
            return None  # no path on the grid
        return replace(problem.unbounded, eta_a=eta_a * (1 + ROUNDING))

    def bound(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, eta_a=value)

    def hold(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, eta_a=min(run.eta_a, value * (1 + ROOM)))


class Speed(Criterion):
    """Fastest constant speed of the plan's path, within eta_v and eta_a."""

    more_is_better = exact_anchor = bounded = True

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        found, asked = plan.criteria, problem.options
        faster = [asked.eta_v / found.peak_velocity.max()]
        if (sharpest := found.peak_acceleration.max()) > 0:
            faster.append(np.sqrt(asked.eta_a / sharpest))
        return longest_step(plan.contour) / plan.dt * float(min(faster))

    def goal(self, value: float, problem: ParetoProblem) -> Goal:
        most = longest_step(problem.contour) / problem.dt / value
        return Goal(kind="interval", most=most)

    def anchor(self, problem: ParetoProblem) -> Subproblem | None:
        quicker = problem.dt / problem.least.slower.dt * (1 - ROUNDING)
        return None if quicker < 1 - 2 * ROUNDING else problem.unbounded.quicker(quicker)

    def bound(
        self, run: Subproblem, value: float, gap: Gap, problem: ParetoProblem, *_: object
    ) -> Subproblem:
        whole, asked = problem.unbounded, longest_step(problem.contour) / problem.dt
        return replace(run, eta_v=whole.eta_v, eta_a=whole.eta_a).quicker(value / asked)

    def hold(
        self, run: Subproblem, value: float, spans: Array, problem: ParetoProblem
    ) -> Subproblem:
        slower = value * (1 - ROOM)
        fast = problem.unbounded.quicker(slower * problem.dt / longest_step(problem.contour))
        return replace(run, eta_v=min(run.eta_v, fast.eta_v), eta_a=min(run.eta_a, fast.eta_a))


class Time(Criterion):
    """Time from home along the plan and back, with straight joint motions at full limits."""

    def require(self, options: PlanOptions, cell: Cell | None, home: ArrayLike | None) -> None:
        if home is None:
            raise InputError("criteria: 'time' needs a home position; give home=, or remove 'time'")

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        home = problem.home
        assert home is not None
        ends = np.stack([home, plan.q[0]]), np.stack([plan.q[-1], home])
        ways = np.vstack([increments(pair, plan.robot.endless) for pair in ends])
        return float(plan.time[-1] + least_time(ways, *plan.robot.speed_limits()).sum())


class Clearance(Criterion):
    """Least clearance of robot and head in the cell at the nodes, beyond the near-miss distance."""

    more_is_better = bounded = True

    def require(self, options: PlanOptions, cell: Cell | None, home: ArrayLike | None) -> None:
        if cell is None:
            raise InputError("criteria: 'clearance' needs a cell; give one, or remove 'clearance'")
        if not counts_as_clearance(cell).any():
            raise InputError(
                "criteria: 'clearance' needs a part or a fixture in the cell that uses the general "
                "near-miss distance; this cell has none"
            )
        if options.comfort is not None and options.comfort.clearance is not None:
            raise InputError(
                "criteria: 'clearance' is already a penalty in comfort; remove one of the two"
            )

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        cell = problem.setup.cell
        assert cell is not None
        wanted = counts_as_clearance(cell)
        apart = cell.distances(plan.q, wanted=np.broadcast_to(wanted, (len(plan.q), len(wanted))))
        return float((apart - cell.required)[:, wanted].min())

    def bound(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, clearance=value)

    def hold(self, run: Subproblem, value: float, *_: object) -> Subproblem:
        return replace(run, clearance=max(0.0, value * (1 - ROUNDING)))


class Rotation(Criterion):
    """Range of gamma: how far the head turns about the beam, which hoses and cables must follow."""

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        return float(np.ptp(np.unwrap(plan.gamma)))

    def goal(self, value: float, problem: ParetoProblem) -> Goal:
        return Goal(kind="turn", most=value)


class Reversals(Criterion):
    """How often joints 1 to 3 turn back: a joint lags by its friction where it does."""

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        return float(plan.criteria.reversals.sum())

    def anchor(self, problem: ParetoProblem) -> Subproblem:
        """Return the search for the least way of joints 1 to 3, which turn back less on it."""
        weights = problem.unbounded.weights.copy()
        weights[PLACING:] *= FAINT
        return replace(problem.unbounded, weights=freeze(weights))


class LeastMeasure(Criterion):
    """Least value at the nodes of the measure of `kerfpath.comfort` with the same name."""

    more_is_better = True

    def value(self, plan: Plan, problem: ParetoProblem) -> float:
        return plan.criteria.nearest[self.name][0]


JOINT_CRITERIA: dict[str, Criterion] = {
    "displacement": Displacement(name="displacement", words="total displacement", unit="s"),
    "increment": Increment(name="increment", words="largest increment", unit="s"),
    "range": Range(name="range", words="coordinate range", unit="s"),
}
"""Criteria of a single joint J, which `pareto` takes as "displacement_J" and so on."""
CRITERIA: dict[str, Criterion] = {
    each.name: each
    for each in (
        JOINT_CRITERIA["displacement"],
        JOINT_CRITERIA["range"],
        Velocity(name="velocity", words="peak velocity", unit="share"),
        Acceleration(name="acceleration", words="peak acceleration", unit="share"),
        Speed(name="speed", words="fastest speed of the path", unit="m/s"),
        Time(name="time", words="time from home and back", unit="s"),
        Rotation(name="rotation", words="rotation about the beam", unit="rad"),
        Reversals(name="reversals", words="reversals of joints 1 to 3", unit="times"),
        Clearance(name="clearance", words="clearance in the cell", unit="m"),
        *(LeastMeasure(name=name, words=name, unit=m.unit) for name, m in MEASURES.items()),
    )
}
"""Criteria of the whole motion."""


def criteria_named(
    names: Sequence[str],
    robot: Robot,
    *,
    options: PlanOptions,
    cell: Cell | None,
    home: ArrayLike | None,
) -> tuple[Criterion, ...]:
    """Return the criteria with these names.

    Raises
    ------
    InputError
        A name is unknown or given twice, there is none, the robot has no such joint, "clearance"
        has no cell or is also in `options.comfort`, or "time" has no home.
    """
    if isinstance(names, str) or not names or len(set(names)) != len(names):
        raise InputError(f"criteria: expected different names, at least one, got {names!r}")
    found = tuple(_named(name, robot) for name in names)
    for criterion in found:
        criterion.require(options, cell, home)
    return found


def _named(name: str, robot: Robot) -> Criterion:
    kind, _, number = str(name).rpartition("_")
    if kind in JOINT_CRITERIA and number in map(str, range(1, robot.joints + 1)):
        joint, each = int(number) - 1, JOINT_CRITERIA[kind]
        words = f"{each.words}, {robot.joint_names[joint]}"
        return replace(each, name=name, words=words, unit=robot.units[joint], joint=joint)
    if name in CRITERIA:
        return CRITERIA[name]
    raise InputError(
        f"criteria: expected names from {', '.join(CRITERIA)}, or "
        f"{', '.join(f'{kind}_J' for kind in JOINT_CRITERIA)} with a joint J from 1 to "
        f"{robot.joints}, got {name!r}"
    )
