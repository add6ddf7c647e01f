"""Contours that cannot be cut in one go: the fewest interruptions, and a plan for each piece."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Unpack

from numpy.typing import ArrayLike

from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.options import PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner._certified import with_bound
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._continuous import clear_motion, grid_reason
from kerfpath.planner._courses import along_a_course
from kerfpath.planner._plan import require_nodes_alone
from kerfpath.planner._refined import refine_plan
from kerfpath.planner._task import PlanningTask, task_of
from kerfpath.planner._words import limits_named
from kerfpath.plans import Plan, Proof
from kerfpath.robots import Robot
from kerfpath.search import Piece, find_interrupted

__all__ = ["plan_in_pieces"]


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
    goes on from there. On the graph it is proved that no plan has fewer interruptions, and that
    none with as many costs less; the grid thus decides where the cut is interrupted. Each piece is
    then planned on its own over continuous gamma (or refined, with the method "exact" and
    `refine`), and certified on its own: its bound holds for motions along that piece. The moves
    between pieces are not planned here and cost nothing.

    Parameters
    ----------
    contour, robot, tool, placement, speed, options, cell, graph, progress, phase
        As in `plan`, with method "continuous" or "exact", closure "free" (a closed contour need
        not return to its first pose), no rotation limit and no tilt. Comfort: a node in two pieces
        costs in both.
    least_piece : float m, optional
        Least length of every piece, measured along the nodes; the number of interruptions is then
        the least possible with this length. A cut in one go may be shorter.

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
    task = task_of(
        contour,
        robot,
        asked,
        tool=tool,
        placement=placement,
        speed=speed,
        graph=graph,
        progress=progress,
    )
    task = along_a_course(task, ClearSearch(task, cell).clear).whole()
    finder = ClearSearch(task, cell)
    begin = phase or (lambda what: None)
    begin("search for pieces")
    try:
        search = partial(find_interrupted, s=contour.s, least_piece=asked.least_piece)
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
            made = _off_grid(part, ClearSearch(part, cell), made)
        plans.append(with_bound(made, asked.certify, phase=begin))
    return tuple(plans)


def _off_grid(part: PlanningTask, finder: ClearSearch, made: Plan) -> Plan:
    """Return the plan of a piece moved off its grid: the best motion found there."""
    refined = refine_plan(part, finder, made)
    found = None
    if part.settings.method == "continuous" and not grid_reason(part):
        found = clear_motion(part, finder)
    if found is None or found.cost_after >= refined.cost:
        return refined
    claim = f"{made.proof.statement}; the best motion found over continuous rotation"
    return replace(found.plan, proof=Proof(optimal=False, statement=claim))


def _plan_piece(
    task: PlanningTask, finder: ClearSearch, piece: Piece, number: int, count: int
) -> tuple[PlanningTask, Plan]:
    """Return the task of one piece, and its plan on the grid."""
    claim = f"the best path on this graph under {limits_named(task.problem)}"
    if count > 1:
        last = piece.first + len(piece.index) - 1
        task = task.part(piece.first, last, f"{task.contour.name}, piece {number} of {count}")
        claim = f"piece {number} of the cheapest cut with the fewest interruptions, {count - 1}"
    proof = Proof(optimal=True, statement=finder.claimed(claim))
    return task, task.plan(piece.index, task.cost(piece.index), proof)
