"""plan(): from a contour and a robot to a plan, through the layered graph and the search."""

from __future__ import annotations

from collections.abc import Callable
from typing import Unpack

from numpy.typing import ArrayLike

from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.options import PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner._certified import with_bound
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._dip import plan_slowed
from kerfpath.planner._refined import plan_off_grid, refine_plan
from kerfpath.planner._task import PlanningTask, task_of
from kerfpath.planner._words import ON_THIS_GRID
from kerfpath.plans import Plan, Proof
from kerfpath.robots import Robot, posture_name
from kerfpath.search import Method, find_shortest

__all__ = ["plan"]


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
    progress: Callable[[int], None] | None = None,
    phase: Callable[[str], None] | None = None,
    **keywords: Unpack[PlanKeywords],
) -> Plan:
    """Return the best joint motion along the contour.

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
        Speed along the path; left out where the contour carries its own times.
    options : PlanOptions, optional
        How the plan is asked for; default: `PlanOptions()`. Every option may also be given as a
        keyword of its own, which goes before:

        gamma_step : float rad
            Step of the free rotation about the beam.
        frames : {"rotation-minimising", "tangent"}
            Task frames that gamma is measured in.
        tilt : Tilt, optional
            Tolerance of the tool axis, searched too; default: the nominal axis alone.
        postures : sequence of int, optional
            The postures that may be used; default all. See `kerfpath.robots.postures_named`.
        method, objective, metric, weights, eta_v, eta_a, closure, rotation
            As in `shortest_path`; "periodic" closure needs a closed contour.
        feed : {"constant", "dip"}
            Where the limits do not let the speed be held: "constant" refuses, "dip" holds it
            wherever they do and slows down elsewhere, in the least time; `Plan.feed` says where.
            Needs objective "sum", closure "free" and no rotation limit.
        refine : bool
            Move gamma off its grid afterwards, see `kerfpath.refine`. Where the grid has no path
            (it quantises acceleration), one is looked for off it.
        comfort : Comfort, optional
            Margins that the nodes keep from singularities and limits, and what coming near costs;
            see `kerfpath.comfort`. Costs are added at every node visited (objective "max":
            maximised); with closure "periodic" the first node is visited twice.
        certify : Certify, optional
            The gap to reach between the plan's cost and what is proved of every other motion, and
            the time for it; None: nothing is proved beyond the grid. See `Proof.bound`.
    cell : Cell, optional
        The plan is clear in it, at the nodes and on straight joint motions between them: the best
        of all clear ones, though only what the search wants to use is checked. Exact method only.
    graph : LayeredGraph, optional
        The layered graph of this very task, kept from `layered_graph`.
    progress : callable, optional
        Called with the number of nodes whose poses have been solved since the last call.
    phase : callable, optional
        Called with what begins once the poses are solved: "search", "refinement", "certificate".

    Raises
    ------
    NoFeasiblePath
        Says the first node where the path breaks, and what each test removed there.
    InputError
        Limits that are not known, nodes unevenly spaced, values out of range.
    """
    asked = with_keywords(options, keywords, PlanKeywords)
    if cell is None and asked.comfort is not None and asked.comfort.clearance is not None:
        raise InputError("comfort clearance: is measured in a cell; give cell=")
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
    finder = ClearSearch(task, cell)
    begin = phase or (lambda what: None)
    begin("search")
    try:
        path = finder.find(find_shortest, task.problem)
    except NoFeasiblePath as at_speed:
        made = _otherwise(task, finder, at_speed, begin)
        return with_bound(made, asked.certify, phase=phase)
    made = task.plan(path.index, path.cost, _proof(asked.method, path.optimal, finder))
    if asked.refine:
        begin("refinement")
        made = refine_plan(task, finder, made)
    return with_bound(made, asked.certify, phase=phase)


def _otherwise(
    task: PlanningTask, finder: ClearSearch, broken: NoFeasiblePath, begin: Callable[[str], None]
) -> Plan:
    """Return a plan where the graph has none at the speed asked for: slower, or off the grid.

    Raises
    ------
    NoFeasiblePath
        There is none, or it was not asked for.
    """
    asked, found = task.settings, None
    if asked.feed == "dip":
        try:
            return plan_slowed(task, finder, refine=asked.refine)
        except NoFeasiblePath as at_any_speed:
            broken = at_any_speed
    elif asked.refine and asked.closure == "free":
        begin("refinement")
        found = plan_off_grid(task, finder)
    if found is not None and found.done:
        return found.plan
    tried = "" if found is None else f"; off the grid {found.statement}"
    where = f"{ON_THIS_GRID} " if task.robot.family.free_rotation else ""
    raise broken.with_message(
        f"contour {task.contour.name!r}: {where}{broken}{_bracket(broken, task)}{tried}"
    ) from None


def _bracket(broken: NoFeasiblePath, task: PlanningTask) -> str:
    """Say from where on paths reach the end, and which change of posture would join the two."""
    if broken.back is None:
        return ""
    said = f"; from the back, paths reach the end from node {broken.back} on"
    said = said if broken.back > broken.node + 1 else ""
    if broken.reached is None or broken.leaving is None:
        return said
    before, after = (
        {int(mu) for mu in task.graph.posture[task.graph.start[node] + vertices]}
        for node, vertices in ((broken.node, broken.reached), (broken.back, broken.leaving))
    )
    if before & after:
        return said
    names = (", ".join(posture_name(mu) for mu in sorted(group)) for group in (before, after))
    return f"{said}; the posture would have to change from {' to '.join(names)}"


def _proof(method: Method, optimal: bool, finder: ClearSearch) -> Proof:
    if optimal:
        claim = finder.claimed(
            "the best path on this graph under the velocity and acceleration limits"
        )
    elif method == "known":
        claim = "no claim: the known technique tests neither velocity nor acceleration"
    else:
        claim = "no claim: the acceleration test of the paper's procedure is greedy"
    return Proof(optimal=optimal, statement=claim)
