"""Advice for contours without a plan: values for the job, each tried as printed, and moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from kerfpath.arrays import Array, Bools, short_repr, spread
from kerfpath.cell import Capsule, Cell, link_capsules
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath, Relaxation
from kerfpath.graph import LayeredGraph
from kerfpath.job.format import Candidate, CutRequest, Job
from kerfpath.job.run.speeds import fastest_along, leaves_grid
from kerfpath.options import PlanOptions
from kerfpath.planner import (
    FINER,
    ON_THIS_GRID,
    FastestSpeed,
    at_least,
    at_most,
    plan,
    relaxations,
)
from kerfpath.progress import may_stop
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Where a part may move so that the robot has poses all along its contours.

STEP, FARTHEST = 0.02, 3.0
"""Step and largest length of the moves that are tried, m."""
COARSE = np.radians(10.0)
"""Least step of gamma, rad, with which places are looked at first."""
PLACES = 12
"""Nodes of each contour that are looked at first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Move:
    """A move of the part after which every node has poses.

    Parameters
    ----------
    by : (3,) m
        In the robot base, whole mm.
    where : str
        Where it leads, such as "up".
    """

    by: Array
    where: str

    __repr__ = short_repr

    @property
    def words(self) -> str:
        """How far it leads, and where."""
        return f"{np.linalg.norm(self.by) * 1e3:.0f} mm {self.where}"

    def __str__(self) -> str:
        """Return what the move is and what comes of it."""
        by = " ".join(f"{v:g}" for v in self.by * 1e3 + 0.0)
        return (
            f"with the part moved {self.words} (by {by} mm in the robot base, see xyz_mm in "
            "[part]) every node has poses"
        )


def move_into_reach(job: Job, contours: Sequence[tuple[Contour, PlanOptions]]) -> Move | None:
    """Return the shortest move of the part after which every node has poses, if one is known.

    It leads towards axis 1 of the robot or away from it, up or down. It is tried at every node of
    the contours, with all that their options ask of a pose; it is quickest if those without poses
    come first. No node comes to where the robot's base and link 1 are; otherwise it says nothing
    about motions and collisions. None is known with external axes.
    """
    if job.robot.free.size:
        return None
    for where, by in _moves(job, contours):
        may_stop()
        moved = replace(job, placement=_shifted(job.placement, by))
        if all(_reaches(moved, *each, PLACES) for each in contours) and all(
            _reaches(moved, *each) for each in contours
        ):
            return Move(by=by, where=where)
    return None


def _reaches(job: Job, nodes: Contour, options: PlanOptions, places: int = 0) -> bool:
    """Return whether every node has poses; with `places`, only so many, at a coarse gamma."""
    some = None
    if places:
        some = spread(len(nodes), places)
        options = replace(options, gamma_step=max(COARSE, options.gamma_step))
    return job.graph(nodes, options, only=some).has_poses_throughout


def _moves(
    job: Job, contours: Sequence[tuple[Contour, PlanOptions]]
) -> Iterator[tuple[str, Array]]:
    """Yield moves (3,) m in whole mm, the shortest first, and where they lead."""
    points = np.concatenate([nodes.points for nodes, _ in contours])
    points = points @ job.placement[:3, :3].T + job.placement[:3, 3]
    x, y, _ = points.mean(axis=0)
    column = _Column.of(job.robot)
    towards = -np.array([x, y, 0.0]) / max(np.hypot(x, y), STEP)
    up = np.array([0.0, 0.0, 1.0])
    ways = {
        "towards the robot": towards,
        "away from the robot": -towards,
        "up": up,
        "down": -up,
    }
    for far in STEP * np.arange(1, round(FARTHEST / STEP) + 1):
        for where, way in ways.items():
            by = np.round(far * way, 3)
            beyond = where == "towards the robot" and far >= np.hypot(x, y)
            if not beyond and not column.holds(points + by).any():
                yield where, by


@dataclass(frozen=True, slots=True)
class _Column:
    """The upright cylinder about the base's z that holds base and link 1, of typical sizes, m."""

    radius: float
    low: float
    high: float

    @classmethod
    def of(cls, robot: Robot) -> _Column:
        frames = robot.arm.joint_chain().frames(np.zeros((1, robot.arm.joints)))[0]
        ends, radii = np.empty((0, 3)), list[float]()
        for body in link_capsules(robot):
            frame = body.frame - len(robot.externals)
            if frame <= 1 and isinstance(body.shape, Capsule):
                placed = body.shape.moved(frames[frame])
                ends = np.vstack([ends, placed.start, placed.end])
                radii += [placed.radius, placed.radius]
        return cls(
            float((np.hypot(ends[:, 0], ends[:, 1]) + radii).max()),
            float((ends[:, 2] - radii).min()),
            float((ends[:, 2] + radii).max()),
        )

    def holds(self, points: Array) -> Bools:
        """Return which of the points (m, 3) m it holds."""
        level = (self.low < points[:, 2]) & (points[:, 2] < self.high)
        return np.asarray(level & (np.hypot(points[:, 0], points[:, 1]) < self.radius))


def _shifted(placement: Array, move: Array) -> Array:
    T = placement.copy()
    T[:3, 3] += move
    return T


# -----------------------------------------------------------------------------
# Advice for contours without a plan: speeds and shares of the limits, each tried as printed.

GIVE = (0.0, 2e-3, 1e-2, 3e-2)
"""Relative amounts by which a value is relaxed until a plan is found with it."""
MUCH = (*GIVE, 0.1, 0.2, 0.4, 0.6)
"""The same for a speed that is far below the one asked for, of a motion off the grid."""
ANY_PLAN: Mapping[str, Any] = {"between_nodes": "reported", "certify": None, "restarts": 0}
"""Options of trials, whose plans need not be good."""
FAR = 0.5
"""Share of the speed asked for up to which that of a motion found is advice enough: the fastest one
would take minutes, and limits cannot be raised that far."""
Share = Literal["eta_velocity", "eta_acceleration"]
"""Keys of a job for the share of a limit that may be used."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Remedy:
    """What makes a contour feasible, as values for a job; each of them alone has given a plan.

    Parameters
    ----------
    other_method : bool
        Whether all of it holds for method "exact" although the job asks for another one.
    speed : str or None
        Feasible speed below the requested one, m/min; None: the requested speed is feasible.
    fastest : bool
        Whether that is the fastest speed of the grid, and not just one with a plan.
    even : bool
        Whether the cut is as fast everywhere; `kerfpath speed` is about such cuts.
    binds : str
        The limit that binds at the higher of both speeds, and where; "" if that is not known.
    refined : str or None
        Higher speed, m/min, at which a motion off the grid was found.
    shares : mapping of str to str
        Keys of the shares of a limit, and their values above the requested ones.
    closed : tuple of str
        Keys for which no share up to 1 is enough.
    never : str or None
        Speed, m/min, from which on it is proved that no motion is possible at any rotation.
    without_windows : bool
        Whether there is a plan without gamma_windows, whatever the other values.
    move : Move or None
        Where nodes have no pose: a move of the part after which they have. There is no other advice
        then.
    """

    other_method: bool
    speed: str | None = None
    fastest: bool = True
    even: bool = True
    binds: str = ""
    refined: str | None = None
    shares: Mapping[str, str] = field(default_factory=dict)
    closed: tuple[str, ...] = ()
    never: str | None = None
    without_windows: bool = False
    move: Move | None = None

    __repr__ = short_repr

    def __str__(self) -> str:
        """Return the advice in one line."""
        if self.move is not None:
            return str(self.move)
        if self.without_windows:
            alone = self.speed is None and not self.other_method
            rest = "" if alone else f"; with them {replace(self, without_windows=False)}"
            return f"without gamma_windows there is a plan as asked for{rest}"
        how = ' with method = "exact"' if self.other_method else ""
        if self.speed is None:
            return f"{ON_THIS_GRID} a path exists at the speed asked for{how}"
        if not self.fastest:
            said = f"{self.speed} m/min cuts it in one piece"
            return f"{said}; `kerfpath speed` finds the fastest" if self.even else said
        said = f"{ON_THIS_GRID} a path exists up to {self.speed} m/min{how}"
        if self.refined is not None:
            said += f", refined up to {self.refined} m/min"
        said += self.binds and f", {self.binds}"
        if self.shares:
            ways = " or ".join(f"{key} = {value}" for key, value in self.shares.items())
            said += f"; at the speed asked for with {ways}"
        if self.closed:
            said += f"; no {' and no '.join(self.closed)} up to 1 is enough there"
        if self.never is not None:
            said += f"; proved impossible at any rotation from {self.never} m/min on"
        return f"{said}; {FINER}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trial:
    """A cut without a plan, to be tried at other speeds and shares of the limits."""

    job: Job
    request: CutRequest
    candidate: Candidate
    graph: LayeredGraph
    cell: Cell | None

    __repr__ = short_repr

    @property
    def asked(self) -> float:
        """Speed asked for, m/s."""
        return self.request.task.speed

    @property
    def on_grid(self) -> PlanOptions:
        """The options of the exact search on the grid alone."""
        return replace(self.job.options, method="exact", refine=False, refine_parts=1)

    def opens(self, options: PlanOptions, speed: float) -> bool:
        """Return whether there is a plan at a speed (m/s), with the nodes that a job has then."""
        nodes, graph, task = self.candidate.nodes, self.graph, self.request.task
        if speed != task.speed and (task.time_step is not None or nodes.time is not None):
            nodes = replace(task, speed=speed).sample(self.candidate.path)
            if task.time_step is not None:  # by spacing, nodes are at the same places
                graph = self.job.graph(nodes)
        at = speed if nodes.time is None else None
        try:
            plan(
                nodes, self.job.robot, tool=self.job.tool, placement=self.job.placement,
                speed=at, options=replace(options, **ANY_PLAN), cell=self.cell, graph=graph,
            )  # fmt: skip
        except NoFeasiblePath:
            return False
        return True

    def speed(
        self,
        options: PlanOptions,
        most: float,
        above: float = 0.0,
        give: Sequence[float] = GIVE,
    ) -> str | None:
        """Return a speed of `most` m/s or less by `give`, in m/min, with a plan; None without one.

        It is above `above` and below the requested speed, m/s.
        """

        def fits(figure: str) -> bool:
            return above < float(figure) / 60 < self.asked

        values = (at_most(min(most, self.asked) * 60 * (1 - less)) for less in give)
        return _first(values, lambda v: fits(v) and self.opens(options, float(v) / 60))

    def share(self, options: PlanOptions, key: Share, least: float) -> str | None:
        """Return a share of a limit of `least` or slightly more with a plan; None without one."""
        used = options.eta_v if key == "eta_velocity" else options.eta_a

        def found(figure: str) -> bool:
            value = float(figure)
            if key == "eta_velocity":
                raised = replace(options, eta_v=value)
            else:
                raised = replace(options, eta_a=value)
            return self.opens(raised, self.asked)

        values = (at_least(least * (1 + give)) for give in GIVE)
        return _first(values, lambda v: used < float(v) <= 1 and found(v))


def _first(values: Iterator[str], passes: Callable[[str], bool]) -> str | None:
    return next((value for value in values if passes(value)), None)


def find_remedy(
    job: Job,
    request: CutRequest,
    candidate: Candidate,
    graph: LayeredGraph,
    cell: Cell | None,
    relaxation: Relaxation | None = None,
) -> tuple[Remedy, FastestSpeed | None] | None:
    """Return what makes a cut without a plan feasible, and its fastest speed; None if unknown.

    The graph must have poses at every node, and the feed be constant. `relaxation` is what
    `NoFeasiblePath` states about a motion off the grid, whose speed is the advice; it is the only
    one for a cut that is slower in places.
    """
    trial = _Trial(job=job, request=request, candidate=candidate, graph=graph, cell=cell)
    continuous = job.options.method == "continuous"
    # If the continuous search finds nothing, it also searches the grid.
    other = not continuous and job.options.method != "exact"
    if other and trial.opens(trial.on_grid, trial.asked):
        return Remedy(other_method=True), None
    if continuous and relaxation is not None:
        slow = _slower(trial, relaxation)
        if slow is not None:
            even = candidate.nodes.time is None
            return Remedy(other_method=False, speed=slow, fastest=False, even=even), None
    if candidate.nodes.time is not None:
        return None
    # With a time step, another speed has other nodes, about which nothing would be proved.
    ceiling = continuous and request.task.time_step is None
    # Every speed found with folded joints is tried with all their turns by `trial`.
    folded = replace(job, robot=job.robot.folded(graph.is_folded))
    around = None if cell is None else cell.with_endless(folded.robot.endless)
    try:
        fastest = fastest_along(
            folded, candidate.nodes, around, refine=leaves_grid(job), graph=graph, ceiling=ceiling,
            explore=False,
        )  # fmt: skip
    except NoFeasiblePath:
        return None
    grid = fastest.speed if fastest.on_grid is None else fastest.on_grid
    speed = trial.speed(trial.on_grid, grid)
    if speed is None:
        return None
    refined = None
    if fastest.on_grid is not None:
        refined = trial.speed(job.options, fastest.speed, above=float(speed) / 60)
    # In a cell, shares of the limits are not looked for.
    shares, closed = ({}, ()) if cell is not None else _shares(trial, relaxation)
    made = Remedy(
        other_method=other,
        speed=speed,
        binds=_binds(candidate, fastest) if refined or fastest.on_grid is None else "",
        refined=refined,
        shares=shares,
        closed=closed,
        never=None if fastest.ceiling is None else at_least(fastest.ceiling * 60),
    )
    return made, fastest


def _slower(trial: _Trial, found: Relaxation) -> str | None:
    """Return a speed, m/min, at which a motion off the grid leads to a plan; None if none is known.

    The search for the quickest motion does not depend on the speed, so that a plan at the speed of
    the motion that it found needs no trial. It needs one where the nodes follow from the speed, in
    a cell, and where joints were folded. The speed of a motion that is slower by far, which is not
    of that search, is tried on the grid.
    """
    speed, graph = found.speed * trial.asked, trial.graph
    if found.speed <= FAR:
        return trial.speed(trial.on_grid, speed, give=MUCH)
    same_nodes = trial.request.task.time_step is None
    if same_nodes and trial.cell is None and not graph.is_folded.any():
        return at_most(speed * 60)
    return trial.speed(trial.job.options, speed)


def opens_without_windows(
    job: Job, request: CutRequest, candidate: Candidate, cell: Cell | None
) -> bool:
    """Return whether a cut without a plan would have one without its windows of gamma."""
    if not job.options.gamma_windows:
        return False
    free = replace(job, options=replace(job.options, gamma_windows=()))
    graph = free.graph(candidate.nodes)
    trial = _Trial(job=free, request=request, candidate=candidate, graph=graph, cell=cell)
    return trial.opens(free.options, trial.asked)


def _shares(trial: _Trial, relaxation: Relaxation | None) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the shares of one limit that are enough, and the keys for which no share is.

    They are those of the grid; for accelerations less, if a motion off the grid needs less.
    """
    options = trial.on_grid
    least = relaxations(
        trial.candidate.nodes,
        trial.job.robot.folded(trial.graph.is_folded),
        trial.graph,
        trial.asked,
        eta_v=options.eta_v,
        eta_a=options.eta_a,
    )
    shares, closed = dict[str, str](), list[str]()
    keys: tuple[tuple[Share, float | None], ...] = (
        ("eta_velocity", least.eta_v),
        ("eta_acceleration", least.eta_a),
    )
    for key, value in keys:
        found = None
        if key == "eta_acceleration" and relaxation is not None and relaxation.velocity == 1:
            off_grid = options.eta_a * relaxation.acceleration
            if value is None or off_grid < value:
                found = trial.share(trial.job.options, key, off_grid)
        if found is None and value is not None and value <= 1:
            found = trial.share(options, key, value)
        if found is not None:
            shares[key] = found
        elif value is None or value > 1:
            closed.append(key)
    return shares, tuple(closed)


def _binds(candidate: Candidate, found: FastestSpeed) -> str:
    at = " ".join(f"{v:.1f}" for v in candidate.nodes.points[found.node] * 1000)
    return f"where the {found.limit} of joint {found.joint + 1} binds at node {found.node}, {at} mm"
