"""Courses through all valleys of a task, and the motions that they are screened to.

Under (6) the cheapest course by (5) alone need not lead to the best motion, nor to the quickest,
which may lie in any valley, in any posture. Courses are sought over samples of gamma that follow
the joints, along all nodes and along every few: the fewer nodes, the larger the steps between them,
beside which samples and kinks are fine. Motions that are known are changed by waves and smooth
steps of gamma. All are screened together.

A course may change its posture if the controller moves all joints evenly: the arm passes a
singularity between two nodes. If the tip moves straight, the joints turn much faster there than at
the nodes, so only courses in one posture are used.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import islice

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, freeze
from kerfpath.effort import current_effort
from kerfpath.kernels.continuous import Steps
from kerfpath.kernels.screening import Energy
from kerfpath.planner.branches import sample_branches
from kerfpath.planner.screening import Aim, Screening, Stage
from kerfpath.planner.task import Task
from kerfpath.plans import Plan
from kerfpath.robots import lowest_joint
from kerfpath.search import METRIC_CODES, Branches, Course, Valleys, change_table
from kerfpath.windows import inside

STEP, LEAST_STEPS = np.radians(10.0), 8
"""rad: typical largest increment along every few nodes, and fewest intervals between them."""
SLACK = 1.02
"""Factor of (5) along every few nodes, for contours whose intervals do not divide evenly."""
COURSES = 40
"""Most courses along the same nodes."""
SOONER_OR_LATER = range(-2, 3)
"""Nodes by which a change of posture is moved along a course: its place is rough."""
MOST_CHANGES = 2
"""Changes of posture from which on their places stay as they are."""
ANGLES = 36
"""Angles at which gamma is constant along further courses, in every posture: where (6) binds, the
best motion may hardly turn."""
SIZES = (0.15, 0.4, 0.8, 1.3)
"""rad: largest changes of gamma of a motion."""
SMOOTHED = 12
"""Share of the nodes over which gamma of a course is averaged in a second one."""
WAVES = 4
"""Number of cosines in a change; the slower ones are larger."""
EQUAL_SCORES = 1e-6
"""Relative difference of scores up to which courses of the same gamma are one motion."""
SEED = 5
"""Fixed, so that the same task always gets the same changes."""


def can_explore(task: Task) -> bool:
    """Return whether the joints of a pose follow from gamma alone, at not too many nodes.

    There must be no tilt and no free joints. Very many nodes are planned from every few of them,
    which are explored.
    """
    effort = current_effort()
    few = effort.explored and len(task.contour) <= effort.subsampled_from
    return few and task.settings.tilt is None and not task.robot.free.size


class Courses:
    """Courses through all valleys of a task, and the motions that they are screened to.

    Parameters
    ----------
    task : Task
        A task that `can_explore`.
    aim : {"cost", "interval", "time"}
        What motions are compared by, as in `Screening`.
    """

    def __init__(self, task: Task, *, aim: Aim = "cost") -> None:
        self._task = task
        s, robot, tool = task.settings, task.robot, task.setup.tool
        self._frames = task.setup.placement @ task.contour.frames(s.frames)
        limits, (velocity, acceleration) = robot.joint_limits(), robot.speed_limits()
        self._step = freeze(s.eta_v * velocity * task.dt)
        self._screening = Screening(
            robot=robot,
            frames=self._frames,
            tool=tool,
            limits=limits,
            energy=Energy(
                weight=freeze(np.array(s.weights, dtype=float)),
                metric=METRIC_CODES[s.metric],
                minimax=s.objective == "max",
                smooth=0.0,
                power=0.0,
                velocity=self._step,
                acceleration=freeze(s.eta_a * acceleration * task.dt**2),
                lower=freeze(np.where(limits.endless, -np.inf, limits.lower)),
                upper=freeze(np.where(limits.endless, np.inf, limits.upper)),
                price=0.0,
                table=change_table(s.limits(robot)),
            ),
            aim=aim,
        )
        self._allowed = _postures_of(task)
        self._one_posture = s.interpolation == "linear" or s.feed == "dip"
        self._rng = np.random.default_rng(SEED)
        self.followed: list[Course] = []
        """Courses through valleys among those of `all`, each once."""
        self.unfollowed = 0
        """Number of further valleys, beyond `COURSES` courses along the same nodes."""

    @property
    def value_along_few(self) -> float:
        """Cost of the best course under (5) alone along every few nodes; infinite if none."""
        return min(valleys.value for valleys, _ in self._along_few)

    @property
    def value(self) -> float:
        """Cost of the best course under (5) alone along all nodes; infinite if none."""
        return self._along_all[0].value

    @cached_property
    def _along_few(self) -> list[tuple[Valleys, Ints]]:
        half = max(1, self._few // 2)
        fewer = [] if half == self._few else [self._valleys(self._few)]
        return [self._along_all if half == 1 else self._valleys(half), *fewer]

    @cached_property
    def _along_all(self) -> tuple[Valleys, Ints]:
        return self._valleys(1)

    def _valleys(self, every: int) -> tuple[Valleys, Ints]:
        """Return the valleys along one of so many nodes, and these nodes (M,), evenly spread."""
        last = len(self._frames) - 1
        nodes = np.linspace(0, last, -(-last // every) + 1).round().astype(np.int64)
        gap = int(np.diff(nodes).max())
        step = self._step * gap * (SLACK if gap > 1 else 1.0)
        s, robot, tool = self._task.settings, self._task.robot, self._task.setup.tool
        branches = sample_branches(robot, self._frames[nodes], tool, step, s.postures)
        energy = self._screening.energy
        steps = Steps(energy.weight, energy.metric, energy.minimax, np.inf, -step, step)
        return Valleys(branches, steps, self._cost(branches, nodes)), nodes

    def _cost(self, branches: Branches, nodes: Ints) -> Array:
        """Return the cost (N,) of samples of some nodes (M,); infinite if not admitted."""
        asked, robot, tool = self._task.settings, self._task.robot, self._task.setup.tool
        q, node = branches.q, nodes[branches.node]
        cost = np.where(self._allowed[node, branches.posture], 0.0, np.inf)
        if asked.comfort is not None:
            cost += asked.comfort.price(robot, q, tool)
            for near in asked.comfort.too_near(robot, q, tool).values():
                cost[near] = np.inf
        if asked.floor is not None:
            cost[lowest_joint(robot, q) < asked.floor] = np.inf
        if asked.gamma_windows:
            s = self._task.contour.s[node]
            cost[~inside(asked.gamma_windows, s, branches.gamma)] = np.inf
        return cost

    @property
    def _few(self) -> int:
        """One of this many nodes is kept so that a typical step is about `STEP`."""
        every = int(np.ceil(STEP / np.median(self._step)))
        return max(1, min(every, (len(self._frames) - 1) // LEAST_STEPS))

    def all(self) -> list[Course]:
        """Return courses through all valleys, smoothed ones too, and those of constant gamma."""
        valleys = self._along_few
        if self._few // 2 > 1:
            valleys = [*valleys, self._along_all]
        courses = self._constant()
        self.followed, self.unfollowed = [], 0
        for through, nodes in valleys:
            own = list(islice(through.courses(), COURSES))
            for each in own:
                course = self._along_all_nodes(each, nodes)
                if not any(course.like(other) for other in self.followed):
                    self.followed.append(course)
                courses += varied(course)
            self.unfollowed += through.left(own) if len(own) == COURSES else 0
        return courses

    def cheapest(self) -> Iterator[Course]:
        """Yield courses through the valleys, the cheapest first.

        Where joints 4 to 6 of one course have the other pose of the same wrist, only one is
        yielded.
        """
        known = list[tuple[float, Course]]()
        valleys, nodes = self._along_few[0]
        for each in valleys.courses():
            course = self._along_all_nodes(each, nodes)
            score = float(self._screening.scores(course.q[None])[0])
            alike = (c for s, c in known if abs(s - score) <= EQUAL_SCORES * score)
            if not any(course._replace(posture=c.posture).like(c) for c in alike):
                known.append((score, course))
                yield course

    def _along_all_nodes(self, course: Course, nodes: Ints) -> Course:
        """Return a course along some nodes as one along all nodes, closed if it must be."""
        return self.closed(_spread(course, nodes, len(self._frames)))

    def _constant(self) -> list[Course]:
        """Return courses with a constant gamma; they need not be in reach."""
        robot, asked, K = self._task.robot, self._task.settings.postures, len(self._frames)
        return [
            Course(np.full(K, gamma), np.zeros((K, robot.joints)), np.full(K, posture))
            for posture in (range(robot.postures) if asked is None else asked)
            for gamma in 2 * np.pi * np.arange(ANGLES) / ANGLES
        ]

    def closed(self, course: Course) -> Course:
        """Return a course, shifted along the path if it must end where it begins."""
        return course._replace(gamma=self._task.closed(course.gamma))

    def same(self, one: Course, other: Course, within: float) -> bool:
        """Return whether gamma of two motions differs by less than `within` rad, in one posture.

        Or in two that differ in the pose of the wrist alone, where no range of it binds either.
        """
        if one.like(other, within):
            return True
        flipped, both = one._replace(posture=one.posture ^ 1), np.stack([one.q, other.q])
        return flipped.like(other, within) and bool(self._screening.is_unbound(both).all())

    def screened(
        self, courses: list[Course], *ways: tuple[Stage, ...]
    ) -> list[tuple[float, Course]]:
        """Return the motions that courses are screened to, each way, with scores, best first.

        Courses in postures that are not allowed are left out, and changes of posture if the tip
        moves straight.
        """
        every = np.arange(len(self._frames))
        courses = [
            course
            for course in courses
            if self._allowed[every, course.posture].all()
            and not (self._one_posture and np.ptp(course.posture))
        ]
        found = [c for stages in ways for c in self._screening.screened(courses, stages)]
        if not found:
            return []
        scores = self._screening.scores(np.array([course.q for course in found]))
        return [(float(scores[i]), found[i]) for i in np.argsort(scores, kind="stable")]

    def shaken(self, plans: list[Plan]) -> list[Course]:
        """Return motions changed at random."""
        count, K = self._task.settings.restarts, len(self._frames)
        return [
            self.closed(Course(np.unwrap(plan.gamma) + change, plan.unwrapped, plan.posture))
            for plan in plans
            for size in SIZES
            for made in (waves, ramps)
            for change in made(self._rng, K, count, size)
        ]


def _postures_of(task: Task) -> Bools:
    """Return which postures each node may have, (K, P): those in a graph that was given, or all."""
    allowed = np.ones((len(task.contour), task.robot.postures), np.bool_)
    if task.placed:
        graph = task.graph
        allowed[:] = False
        allowed[np.repeat(np.arange(len(allowed)), np.diff(graph.start)), graph.posture] = True
    return allowed


def _spread(course: Course, nodes: Ints, count: int) -> Course:
    """Return a course along some nodes as one along all nodes, with gamma linear between them."""
    if len(nodes) == count:
        return course
    at = np.arange(count)
    nearest = np.searchsorted((nodes[1:] + nodes[:-1]) / 2, at)
    return Course(
        gamma=np.interp(at, nodes, course.gamma),
        q=np.stack([np.interp(at, nodes, joint) for joint in course.q.T], axis=1),
        posture=course.posture[nearest],
    )


def varied(course: Course) -> list[Course]:
    """Return a course, and smoothed ones; one that changes posture also does so sooner and later.

    One with more than `MOST_CHANGES` is returned alone.
    """
    changes, K = np.flatnonzero(np.diff(course.posture)), len(course.gamma)
    if not changes.size:
        return [course, course._replace(gamma=smoothed(course.gamma, max(2, K // SMOOTHED)))]
    courses = [course]
    for shift in SOONER_OR_LATER if changes.size <= MOST_CHANGES else ():
        moved = changes + shift
        if moved[0] < 0 or moved[-1] >= K - 1:
            continue
        posture = course.posture[np.append(changes, K - 1)].repeat(
            np.diff(np.append(moved, K - 1), prepend=-1)
        )
        courses += [Course(smoothed(course.gamma, width), course.q, posture) for width in (2, 5)]
    return courses


def smoothed(gamma: Array, width: int) -> Array:
    """Return gamma (K,) averaged over `width` nodes on either side, the near ones more."""
    kernel = np.hanning(2 * width + 3)[1:-1]
    padded = np.pad(gamma, width, mode="reflect", reflect_type="odd")
    return np.asarray(np.convolve(padded, kernel / kernel.sum(), "valid"))


def waves(rng: np.random.Generator, nodes: int, count: int, size: float) -> Array:
    """Return random sums of slow cosines (count, K) whose largest absolute value is `size`."""
    t, change = np.linspace(0, np.pi, nodes), np.zeros((count, nodes))
    for m in range(WAVES):
        height = rng.normal(size=(count, 1)) / (1 + m)
        change += height * np.cos(m * t + rng.uniform(0, 2 * np.pi, (count, 1)))
    return np.asarray(size * change / np.abs(change).max(axis=1, keepdims=True))


def ramps(rng: np.random.Generator, nodes: int, count: int, size: float) -> Array:
    """Return random smooth steps (count, K), from 0 to at most `size` or back, either way."""
    centre = rng.uniform(0, nodes, (count, 1))
    width = rng.uniform(0.03, 0.15, (count, 1)) * nodes
    step = 1 / (1 + np.exp((centre - np.arange(nodes)) / width))
    step = np.where(rng.random((count, 1)) < 0.5, step, 1 - step)
    share = rng.choice([-1.0, 1.0], (count, 1)) * rng.uniform(0.5, 1, (count, 1))
    return np.asarray(size * share * step)
