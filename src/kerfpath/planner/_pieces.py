"""A cut that cannot be made in one go: the fewest interruptions, and a plan for every piece."""

from __future__ import annotations

from collections.abc import Callable
from typing import Unpack

from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.planner._clear import Finder
from kerfpath.planner._refined import refined
from kerfpath.planner._task import Options, Task, task_of
from kerfpath.plans import Plan, Proof
from kerfpath.robots import Robot
from kerfpath.search import Piece, interrupted_path

__all__ = ["plan_in_pieces"]


def plan_in_pieces(
    contour: Contour,
    robot: Robot,
    *,
    refine: bool = False,
    cell: Cell | None = None,
    least_piece: float | None = None,
    phase: Callable[[str], None] | None = None,
    **options: Unpack[Options],
) -> tuple[Plan, ...]:
    """Return the plans of the pieces that the contour is cut in, with the fewest interruptions.

    At an interruption the laser goes off, the robot takes another pose at the same node, and the
    cut goes on from there. No plan has fewer, and on this graph none with as many costs less, both
    exactly; each piece is then refined on its own, if that is asked for. The moves between the
    pieces are not planned here and cost nothing.

    Parameters
    ----------
    contour, robot, refine, cell, phase, options
        As in `plan`, with method "exact", closure "free" (a closed contour need not return to its
        first pose), no rotation limit and no tilt. Comfort: a node in two pieces costs in both.
    least_piece : float m, optional
        Every piece is at least as long, measured along the nodes; the number of interruptions is
        then the least with which that can be. A cut in one go may be shorter.

    Returns
    -------
    plans : tuple of Plan
        One for each piece, in order; a single one where nothing interrupts the cut. The contour of
        each is the part of nodes that it cuts, its arc length `s` that of the whole.

    Raises
    ------
    NoFeasiblePath
        No number of interruptions helps: a node without a pose, or an interval between two nodes
        that no poses can pass; or no pieces of the least length.
    InputError
        As `plan`; another method or closure, a rotation limit, a tilt.
    """
    comfort = options.get("comfort")
    if comfort is not None and comfort.clearance is not None:
        raise InputError("comfort clearance: is measured in a cell, and has no price in pieces")
    task = task_of(contour, robot, **options)
    settings = task.settings
    plain = settings.method == "exact" and settings.closure == "free"
    if not plain or settings.rotation is not None:
        raise InputError(
            'plan_in_pieces: needs method "exact", closure "free" and no rotation limit, got '
            f"{settings.method!r}, {settings.closure!r} and {settings.rotation}"
        )
    if settings.tilt is not None:
        raise InputError("plan_in_pieces: the tool axis cannot be tilted in pieces; leave out tilt")
    finder = Finder(task, cell)
    begin = phase or (lambda what: None)
    begin("search for pieces")
    try:
        found = finder.best(interrupted_path, **task.aim, s=contour.s, least_piece=least_piece)
    except NoFeasiblePath as broken:
        raise broken.retold(
            f"contour {contour.name!r}: no number of interruptions helps: {broken}"
        ) from None
    plans = []
    for number, piece in enumerate(found.pieces, 1):
        part, made = _planned(task, finder, piece, number, len(found.pieces))
        if refine:
            begin(f"refinement of piece {number} of {len(found.pieces)}")
        plans.append(refined(part, Finder(part, cell), made) if refine else made)
    return tuple(plans)


def _planned(
    task: Task, finder: Finder, piece: Piece, number: int, count: int
) -> tuple[Task, Plan]:
    """Return the task of one piece, and its plan on the grid."""
    claim = "the best path on this graph under the velocity and acceleration limits"
    if count > 1:
        last = piece.first + len(piece.index) - 1
        task = task.part(piece.first, last, f"{task.contour.name}, piece {number} of {count}")
        claim = f"piece {number} of the cheapest cut with the fewest interruptions, {count - 1}"
    proof = Proof(optimal=True, statement=finder.claimed(claim))
    return task, task.plan(piece.index, task.cost(piece.index), proof)
