"""plan(): the best joint motion of a robot along a contour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Bools
from kerfpath.cell import Cell
from kerfpath.certificate import Certify
from kerfpath.certifier import SharedWork, certify
from kerfpath.compiling import finish_compiling
from kerfpath.contour import Contour
from kerfpath.effort import changed_effort
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.losses import Loss
from kerfpath.options import KEEPS, PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner.attempt import Attempt, Strategy, first_plan, unheard
from kerfpath.planner.collision_free import CollisionFreeSearch
from kerfpath.planner.continuous import (
    FROM_GRID,
    OVER_CONTINUOUS_GAMMA,
    better_motion,
    claimed,
    clear_motion,
    grid_reason,
    refined_course,
)
from kerfpath.planner.ends import Ends
from kerfpath.planner.external_motion import along_a_course, best_external_motion
from kerfpath.planner.fewer_reversals import plan_with_fewer_reversals
from kerfpath.planner.folding import all_within_ranges, unfolded, within_ranges
from kerfpath.planner.on_grid import ON_GRID
from kerfpath.planner.refinements import refine_plan
from kerfpath.planner.screening import within
from kerfpath.planner.starts import Starts
from kerfpath.planner.statements import add_window_note, limits_named
from kerfpath.planner.straight_moves import not_followed, remedy
from kerfpath.planner.task import Task, planning_task
from kerfpath.plans import Plan, Proof
from kerfpath.progress import Progress, StopEarly, no_progress
from kerfpath.refiner import Goal
from kerfpath.robots import Robot
from kerfpath.search import Course, Piece, find_interrupted
from kerfpath.setup import Setup

# -----------------------------------------------------------------------------
# The best motion over continuous gamma, without falling back to the grid and without proofs.


def best_motion(
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None,
    graph: LayeredGraph | None = None,
    phase: Callable[[str], None] | None = None,
    thorough: bool = True,
    explored: bool = False,
) -> Plan:
    """Return the plan of the best motion found over continuous gamma.

    It is for plans that are made in number: not certified, and only if `explored` after an
    exploration of all valleys; else it may cost more than that of `kerfpath.plan`. Where
    `kerfpath.plan` would go to the grid, this raises NoFeasiblePath and spends no time on a proof.

    Parameters
    ----------
    contour, speed, options, graph, phase
        As in `kerfpath.plan`, method "continuous".
    setup : Setup
    thorough : bool
        Whether wider searches follow where the value function promises a better motion.
    explored : bool
        Whether these explore all valleys.

    Raises
    ------
    NoFeasiblePath
        No motion is found, or a node has no pose; only the latter is proved.
    InputError
        As `kerfpath.plan`.
    """
    options = replace(options, certify=None)
    begin = phase or unheard

    def planned(unfold: Bools) -> Plan:
        task = planning_task(contour, setup, options, speed=speed, graph=graph, unfold=unfold)
        task = along_a_course(task, CollisionFreeSearch(task).clear)
        finder, why = CollisionFreeSearch(task), grid_reason(task)
        begin("search")
        found = (
            None if why else clear_motion(task, finder, begin, thorough=thorough, explored=explored)
        )
        if found is None:
            raise NoFeasiblePath(
                f"contour {contour.name!r}: no motion over continuous rotation"
                f"{f': {why}' if why else ' was found'}",
                proved=False,
                node=-1,
                counts={},
            )
        return claimed(found, finder)

    return within_ranges(setup.robot, planned)


def refined_motion(
    contour: Contour,
    setup: Setup,
    options: PlanOptions,
    *,
    speed: float | None,
    graph: LayeredGraph,
    begin: Sequence[Course],
    goals: tuple[Goal, ...] = (),
) -> Plan:
    """Return the plan of the best motion that refinements from known motions lead to.

    Parameters
    ----------
    contour, speed, options, graph
        As in `kerfpath.plan`, method "continuous"; no tilt.
    setup : Setup
        Its robot has no free joints.
    begin : sequence of Course
        The motions to begin with, which need not keep the limits.
    goals : tuple of Goal
        Criteria that are refined instead of the objective; default: the objective.

    Raises
    ------
    NoFeasiblePath
        No refinement ends with a motion that keeps all limits and is clear.
    InputError
        As `kerfpath.plan`.
    """
    options = replace(options, certify=None)
    task = planning_task(contour, setup, options, speed=speed, graph=graph)
    starts, limits = Starts(task, CollisionFreeSearch(task), goals), setup.robot.joint_limits()
    for course in begin:
        starts.refine_course(course._replace(q=within(limits, course.q)), np.inf)
    if starts.best is None:
        raise NoFeasiblePath(
            f"contour {contour.name!r}: no refinement of a known motion keeps the limits",
            proved=False,
            node=-1,
            counts={},
        )
    return claimed(starts.best, starts.finder)


# -----------------------------------------------------------------------------
# Bound of a plan: its largest possible distance from the best motion.


def with_bound(
    made: Plan,
    asked: Certify | None,
    *,
    work: SharedWork | None = None,
    phase: Callable[[str], None] | None = None,
    progress: Progress = no_progress,
    refined: Callable[[Course], Plan | None] | None = None,
) -> Plan:
    """Return the plan with a proved bound, or with the reason why there is none.

    The plan keeps the certificate, which is large, only if `asked.keep`.

    Parameters
    ----------
    made : Plan
    asked : Certify or None
        How to certify it; becomes part of its settings. None: the plan stays without a bound.
    work : SharedWork, optional
        Work that its bound shares with those of other plans.
    phase : callable, optional
        Called with "certificate" when this begins.
    progress : callable
        As `kerfpath.certifier.certify` calls it.
    refined : callable, optional
        Returns the plan that a cheaper motion leads to, which the proof came upon; it takes the
        place of `made`.
    """
    settings = replace(made.settings, certify=asked)
    if asked is None:
        return replace(made, settings=settings)
    if phase is not None:
        phase("certificate")
    finish_compiling()
    begun = replace(made, proof=made.proof.without_bound())
    try:
        found = certify(
            begun,
            gap=asked.gap,
            seconds=asked.seconds,
            checkable=asked.keep,
            most=None if work is None else work.share,
            progress=progress,
            refined=refined,
        )
    except StopEarly:
        proof = begun.proof.also("stopped before a bound was proved")
        return replace(made, settings=settings, proof=proof)
    if work is not None:
        work.take(found.pairs)
    proof = replace(
        found.plan.proof,
        statement=f"{found.plan.proof.statement}; {found.statement}",
        certificate=found.plan.proof.certificate if asked.keep else None,
    )
    return replace(found.plan, settings=settings, proof=proof)


# -----------------------------------------------------------------------------
# plan(): the best joint motion of a robot along a contour.

WITHOUT_PROOFS = {
    "infeasibility_steps": 0, "infeasibility_tubes": 0, "binding_nodes": 0, "speed_factors": (),
}  # fmt: skip
"""Effort in other postures: where they have no motion, nobody asks for a proof."""


def plan(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
    graph: LayeredGraph | None = None,
    external: ArrayLike | None = None,
    start_q: ArrayLike | None = None,
    end_q: ArrayLike | None = None,
    progress: Callable[[int], None] | None = None,
    phase: Callable[[str], None] | None = None,
    **keywords: Unpack[PlanKeywords],
) -> Plan:
    """Return the best joint motion along the contour, and the moves to it and from it.

    Parameters
    ----------
    contour : Contour
        Nodes in the part frame, evenly spaced (see `Contour.resample`).
    robot : Robot
        With joint limits, velocities and accelerations.
    tool : (4, 4)
        T_flange_tip, m: tip frame in the flange, z along the beam into the part.
    placement : (4, 4)
        T_base_part, m: part frame in the robot base.
    speed : float m/s
        Speed along the path; omitted if the contour carries its own times.
    options : PlanOptions, optional
        Planning options; default: `PlanOptions()`. Each option may also be given as a keyword,
        which takes precedence:

        gamma_step : float rad
            Step of the free rotation about the beam.
        frames : {"rotation-minimising", "tangent"}
            Task frames that gamma is measured in.
        tilt : Tilt, optional
            Tolerance of the tool axis, which is then searched too; default: the nominal axis only.
        postures : sequence of int or str, optional
            The postures that may be used, by numbers or words: ["front/up"] are all with these
            words. Default: all. See `kerfpath.robots.postures_named`.
        method : {"continuous", "exact", "paper", "known"}
            "continuous" (the default): the best motion found over continuous gamma, by a value
            function between its samples, beam searches that keep the acceleration limits, and
            refinement. If this is not possible or finds nothing, it plans as "exact" with `refine`,
            and the proof says so. The others search the grid, as in `shortest_path`.
        objective, metric, weights, eta_v, eta_a, closure, rotation
            As in `shortest_path`; "periodic" closure needs a closed contour.
        feed : {"constant", "dip"}
            If the limits do not allow the speed everywhere: "constant" refuses, "dip" keeps it
            where they do and slows down elsewhere, in the least time; `Plan.feed` says where.
            "dip" needs objective "sum", closure "free" and no rotation limit.
        refine : bool
            After a search of the grid, move gamma off it, see `kerfpath.refine`. If the grid has
            no path (it quantises acceleration), one is looked for off it.
        comfort : Comfort, optional
            Margins that the nodes keep from singularities and limits, and the costs near them; see
            `kerfpath.comfort`. Costs are added at every node visited (objective "max":
            maximised); with closure "periodic" the first node is visited twice.
        gamma_windows : sequence of GammaWindow
            Stretches of the contour on which gamma is kept inside an interval; default none. Their
            ends are samples of gamma, too.
        certify : Certify, optional
            The gap to reach between the plan's cost and a lower bound on every motion's cost, and
            the time for it; None: nothing is proved beyond the grid. See `Proof.bound`.
    cell : Cell, optional
        Cell in which the plan is clear, at the nodes and on straight joint motions between them.
        Only poses and motions that the search would use are checked. Methods "continuous" and
        "exact" only; the latter finds the best of all clear paths.
    graph : LayeredGraph, optional
        The layered graph of this task, from `layered_graph`.
    external : (K, E) rad or m, optional
        Values of the robot's external axes at every node, from which they are refined; for a
        seven-axis arm, those of its free joint come first. Default: the method "continuous" looks
        for a smooth course, the others search a grid in the steps of these joints.
    start_q, end_q : (n,) rad, optional
        Where the robot stands before the cut, and where it goes after it: `Plan.approach` and
        `Plan.retreat` are the moves there, straight or around what is in the way of a cell. Of the
        motions that cost nearly the same, by turns of joints, rotation about the beam or posture,
        it is the one with the shortest moves; where none can be reached, the cheapest motion in
        another posture that can be.
    progress : callable, optional
        Called with the number of nodes whose poses have been solved since the last call. With very
        many nodes some are solved first, and all only if these do not lead to a plan.
    phase : callable, optional
        Called with each phase that begins once the poses are solved: "search", "refinement",
        "moves", "certificate".

    Raises
    ------
    NoFeasiblePath
        There is no path; the message names the first node where it breaks, and counts what each
        test removed there. Or there is no way from `start_q` or to `end_q`, or the robot is not
        clear there (proved).
    InputError
        Limits that are not known, nodes unevenly spaced, values out of range, `start_q` or `end_q`
        beyond the joint limits, or `between_nodes` "guaranteed".
    """
    asked = with_keywords(options, keywords, PlanKeywords)
    require_nodes_alone(asked, "plan")
    if cell is None and asked.comfort is not None and asked.comfort.clearance is not None:
        raise InputError("comfort clearance: is measured in a cell; give cell=")
    setup = Setup.of(robot, tool, placement, cell)
    ends = Ends.of(setup, start_q, end_q)
    attempt: Attempt | None = None

    def planned(unfold: Bools) -> Plan:
        nonlocal attempt
        task = planning_task(
            contour,
            setup,
            asked,
            speed=speed,
            graph=graph,
            external=external,
            progress=progress,
            unfold=unfold,
        )
        made, attempt = _planned(task, asked, phase or unheard)
        return made

    try:
        made = within_ranges(robot, planned)
    except NoFeasiblePath as broken:
        raise add_window_note(broken, asked) from None
    assert attempt is not None, "the plan is of an attempt"
    if not ends.given:
        return _bounded(made, attempt, asked, robot, phase)

    def in_posture(posture: int) -> Plan:
        alone = replace(asked, postures=(posture,), certify=None)
        with changed_effort(**WITHOUT_PROOFS):
            return plan(
                contour,
                robot,
                tool=tool,
                placement=placement,
                speed=speed,
                options=alone,
                cell=cell,
                external=external,
            )

    (phase or unheard)("moves")
    made = _joined(made, ends, in_posture)
    found = _bounded(made, attempt, asked, robot, phase)
    if found.approach is not None or found.retreat is not None:
        return found
    try:  # the search for a bound came upon a better motion
        return ends.joined([found])
    except NoFeasiblePath:
        return with_bound(made, asked.certify, phase=phase)


def _joined(made: Plan, ends: Ends, in_posture: Callable[[int], Plan]) -> Plan:
    """Return a plan, or one alike, with its moves; else the cheapest in another posture.

    Raises
    ------
    NoFeasiblePath
        There is no way from where the robot stands, or to where it goes.
    """
    try:
        return ends.joined(ends.alike(made))
    except NoFeasiblePath as broken:
        stuck = broken
    every, asked = made.settings.postures, made.settings
    others = []
    for posture in range(made.robot.postures) if every is None else every:
        if posture != made.posture[0] or np.ptp(made.posture):
            with suppress(NoFeasiblePath):
                others.append(replace(in_posture(posture), settings=asked))
    for other in sorted(others, key=lambda one: one.cost):
        with suppress(NoFeasiblePath):
            found = ends.joined([other])
            said = found.proof.also("no way was found to the best motion, in another posture")
            return replace(found, proof=said)
    tried = f"; also tried: {len(others)} other postures" if others else ""
    raise stuck.with_message(f"{stuck}{tried}")


def _bounded(
    made: Plan,
    attempt: Attempt,
    asked: PlanOptions,
    robot: Robot,
    phase: Callable[[str], None] | None,
) -> Plan:
    """Return a plan with the bound that is asked for, or the better motion that it leads to."""
    made = with_bound(
        made, asked.certify, phase=phase, refined=partial(_refined, attempt=attempt, robot=robot)
    )
    if asked.certify is None or made.proof.gap is None or made.proof.gap <= asked.certify.gap:
        return made
    if not robot.encloses or asked.tilt is not None or made.feed is not None:
        return made  # such a bound is too loose to call for more
    with suppress(StopEarly):
        better = better_motion(attempt)
        if better is not None:
            better, beyond = unfolded(better, robot)
            made = made if beyond.any() else with_bound(better, asked.certify, phase=phase)
    return made


def _refined(course: Course, *, attempt: Attempt, robot: Robot) -> Plan | None:
    """Return the plan that a cheap motion leads to; None if it is not clear or within limits."""
    found = refined_course(attempt, course)
    if found is None:
        return None
    made, beyond = unfolded(found, robot)
    return None if beyond.any() else made


def _planned(task: Task, asked: PlanOptions, begin: Callable[[str], None]) -> tuple[Plan, Attempt]:
    """Return the plan of a task, and the attempt that found it.

    Where the controller cannot follow the motion found between two nodes, it is the quickest and
    then the cheapest motion found in one posture. If there is none, a motion at constant speed
    stays as it is, for its audit to judge.

    Raises
    ------
    NoFeasiblePath
        There is none.
    """

    def attempt_of(task: Task) -> Attempt:
        return Attempt(
            task=task, finder=CollisionFreeSearch(task), begin=begin, refine=asked.refine
        )

    settings = task.settings.without_reversals
    if settings is not task.settings and (asked.refine or task.settings.method == "continuous"):
        unpriced = replace(task, settings=settings)
        begun = [_planned(unpriced, asked, begin)[0]]
        if task.settings.tilt is not None:
            rigid = task.with_settings(replace(task.settings, tilt=None))
            with suppress(NoFeasiblePath):
                begun.append(_planned(rigid, asked, begin)[0])
        return plan_with_fewer_reversals(task, unpriced, begun, begin), attempt_of(task)
    attempt, leaping = attempt_of(task), None
    try:
        leaping = first_plan(attempt, strategies(task))
        leap = not_followed(leaping) if task.settings.method == "continuous" else None
        if leap is None:
            return leaping, attempt
    except NoFeasiblePath as none:
        if not none.lost_by(Loss.LEAP):
            raise
        leap = none
    found = []
    has_grid = task.external is not None or not task.robot.free.size
    alone = task.graph.postures_throughout.tolist() if has_grid and not leap.proved else []
    for posture in alone:
        one = replace(task.settings, postures=(posture,))
        each = replace(attempt_of(task.with_settings(one)), failure=leap)
        quick = [way for way in strategies(task) if way not in FROM_GRID]
        with suppress(NoFeasiblePath):
            made = first_plan(each, tuple(quick))
            if not_followed(made) is None:
                found.append((made, each))
    if found:
        made, attempt = min(found, key=lambda way: (round(float(way[0].time[-1]), 9), way[0].cost))
        said = made.proof.also("in one posture, as straight moves cannot change it")
        return replace(made, settings=task.settings, proof=said), attempt
    if leaping is not None and task.settings.feed == "constant":
        return leaping, attempt
    raise leap.with_message(f"{leap}; {remedy(task.contour)}") from None


def strategies(task: Task) -> tuple[Strategy, ...]:
    """Return the strategies for a task, in the order in which they are tried."""
    if task.settings.method != "continuous":
        return ON_GRID
    if task.robot.free.size and not task.placed:
        return (best_external_motion,)
    return OVER_CONTINUOUS_GAMMA


def require_nodes_alone(options: PlanOptions, what: str) -> None:
    """Raise InputError if `between_nodes` is "guaranteed", which a plan by itself cannot be.

    The guarantee depends on the program and its controller, see `kerfpath.keep_limits` and jobs.
    """
    if options.between_nodes == "guaranteed":
        raise InputError(
            f'between_nodes: expected "reported" or "kept", got "guaranteed"; {what} holds the '
            f"limits at the nodes only: leave the option out, and {KEEPS}; or run a job"
        )


# -----------------------------------------------------------------------------
# Contours that cannot be cut in one go: the fewest interruptions, and a plan for each piece.


LEAST_PIECE = 0.01
"""Least length of a piece, m, unless another is asked for."""


class PieceKeywords(PlanKeywords, total=False):
    """The options that `plan_in_pieces` takes as keywords."""

    least_piece: float | None


def plan_in_pieces(
    contour: Contour,
    robot: Robot,
    *,
    tool: ArrayLike,
    placement: ArrayLike,
    speed: float | None = None,
    options: PlanOptions | None = None,
    cell: Cell | None = None,
    graph: LayeredGraph | None = None,
    progress: Callable[[int], None] | None = None,
    phase: Callable[[str], None] | None = None,
    **keywords: Unpack[PieceKeywords],
) -> tuple[Plan, ...]:
    """Return the plans of the pieces in which a contour is cut, with the fewest interruptions.

    At an interruption the beam goes off, the robot takes another pose at the same node, and the cut
    goes on from there. On the graph it is proved that no plan with pieces of the least length has
    fewer interruptions, and that none with as many costs less; the grid thus decides where the cut
    is interrupted. Each piece is then planned on its own over continuous gamma (or refined, with
    the method "exact" and `refine`), and certified on its own: its bound holds for motions along
    that piece. The moves between pieces are not planned here and cost nothing.

    Parameters
    ----------
    contour, robot, tool, placement, speed, options, cell, graph, progress, phase
        As in `plan`, with method "continuous" or "exact", closure "free" (a closed contour need
        not return to its first pose), no rotation limit and no tilt. Comfort: a node in two pieces
        costs in both.
    least_piece : float m, optional
        Least length of every piece, measured along the nodes; the number of interruptions is then
        the least possible with this length. A cut in one go may be shorter. Default: 10 mm, as a
        contour in pieces of a millimetre is not a cut.

    Returns
    -------
    plans : tuple of Plan
        One for each piece, in order; a single one if the cut needs no interruption. The contour of
        each has the nodes that it cuts, with the arc length `s` of the whole contour.

    Raises
    ------
    NoFeasiblePath
        No number of interruptions helps: a node has no pose, no poses can pass an interval between
        two nodes, or no pieces have the least length. Or no motion along a piece was found that
        keeps the jerk limits.
    InputError
        As `plan`; another method or closure, a rotation limit, or a tilt.
    """
    asked = with_keywords(options, keywords, PieceKeywords, interruptions="fewest")
    require_nodes_alone(asked, "plan_in_pieces")
    setup, begin = Setup.of(robot, tool, placement, cell), phase or unheard

    def planned(unfold: Bools) -> list[Plan]:
        task = planning_task(
            contour, setup, asked, speed=speed, graph=graph, progress=progress, unfold=unfold
        )
        task = along_a_course(task, CollisionFreeSearch(task).clear).whole()
        finder = CollisionFreeSearch(task)
        begin("search for pieces")
        try:
            least = LEAST_PIECE if asked.least_piece is None else asked.least_piece
            search = partial(find_interrupted, s=contour.s, least_piece=least)
            found = finder.find(search, task.problem)
        except NoFeasiblePath as broken:
            raise broken.with_message(
                f"contour {contour.name!r}: no number of interruptions helps: {broken}"
            ) from None
        plans = []
        for number, piece in enumerate(found.pieces, 1):
            part, made = _plan_piece(task, finder, piece, number, len(found.pieces))
            if asked.refine or asked.method == "continuous":
                begin(f"refinement of piece {number} of {len(found.pieces)}")
                made = _off_grid(part, CollisionFreeSearch(part), made)
            plans.append(made)
        return plans

    plans = all_within_ranges(robot, planned)
    return tuple(with_bound(made, asked.certify, phase=begin) for made in plans)


def _off_grid(part: Task, finder: CollisionFreeSearch, made: Plan) -> Plan:
    """Return the plan of a piece moved off its grid: the best motion found there."""
    refined = refine_plan(part, finder, made)
    found = None
    if part.settings.method == "continuous" and not grid_reason(part):
        found = clear_motion(part, finder)
    if found is None or found.cost_after >= refined.cost:
        return refined
    claim = made.proof.also("the best motion found over continuous rotation")
    return replace(found.plan, proof=Proof(optimal=False, statement=claim.statement))


def _plan_piece(
    task: Task, finder: CollisionFreeSearch, piece: Piece, number: int, count: int
) -> tuple[Task, Plan]:
    """Return the task of one piece, and its plan on the grid."""
    claim = f"the best path on this graph under {limits_named(task.problem)}"
    if count > 1:
        last = piece.first + len(piece.index) - 1
        task = task.part(piece.first, last, f"{task.contour.name}, piece {number} of {count}")
        claim = f"piece {number} of the cheapest cut with the fewest interruptions, {count - 1}"
    proof = Proof(optimal=True, statement=finder.claimed(claim))
    return task, task.plan(piece.index, task.cost(piece.index), proof)
