"""plan(): the best joint motion of a robot along a contour."""

from __future__ import annotations

from collections.abc import Callable
from typing import Unpack

from numpy.typing import ArrayLike

from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.options import KEEPS, PlanKeywords, PlanOptions, with_keywords
from kerfpath.planner._certified import with_bound
from kerfpath.planner._clear import ClearSearch
from kerfpath.planner._continuous import plan_continuous
from kerfpath.planner._on_grid import plan_on_grid
from kerfpath.planner._over_courses import plan_over_courses
from kerfpath.planner._task import task_of
from kerfpath.planner._words import with_windows_said
from kerfpath.plans import Plan
from kerfpath.robots import Robot

__all__ = ["plan", "require_nodes_alone"]


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
        postures : sequence of int, optional
            The postures that may be used; default all. See `kerfpath.robots.postures_named`.
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
        seven-axis arm, those of joint 3 come first. Default: the method "continuous" looks for a
        smooth course, the others search a grid in the steps of these joints.
    progress : callable, optional
        Called with the number of nodes whose poses have been solved since the last call. With very
        many nodes some are solved first, and all only if these do not lead to a plan.
    phase : callable, optional
        Called with each phase that begins once the poses are solved: "search", "refinement",
        "certificate".

    Raises
    ------
    NoFeasiblePath
        There is no path; the message names the first node where it breaks, and counts what each
        test removed there.
    InputError
        Limits that are not known, nodes unevenly spaced, values out of range, or `between_nodes`
        "guaranteed".
    """
    asked = with_keywords(options, keywords, PlanKeywords)
    require_nodes_alone(asked, "plan")
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
        external=external,
        progress=progress,
    )
    finder = ClearSearch(task, cell)
    begin = phase or (lambda what: None)
    try:
        if asked.method == "continuous" and robot.free.size and not task.placed:
            made = plan_over_courses(task, finder, begin)
        elif asked.method == "continuous":
            made = plan_continuous(task, finder, begin)
        else:
            made = plan_on_grid(task, finder, begin, refine=asked.refine)
    except NoFeasiblePath as broken:
        raise with_windows_said(broken, asked) from None
    return with_bound(made, asked.certify, phase=phase)


def require_nodes_alone(options: PlanOptions, what: str) -> None:
    """Raise InputError if `between_nodes` is "guaranteed", which a plan by itself cannot be.

    The guarantee depends on the program and its controller, see `kerfpath.keep_limits` and jobs.
    """
    if options.between_nodes == "guaranteed":
        raise InputError(
            f'between_nodes: expected "reported" or "kept", got "guaranteed"; {what} holds the '
            f"limits at the nodes only: leave the option out, and {KEEPS}; or run a job"
        )
