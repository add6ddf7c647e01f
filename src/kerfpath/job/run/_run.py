"""The run of a job: read the part, plan every contour, audit every plan."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kerfpath._arrays import Array, Ints
from kerfpath._told import told
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cad import read as read_drawing
from kerfpath.cell import Cell
from kerfpath.contour import FRAME_KINDS, Contour
from kerfpath.errors import NoFeasiblePath
from kerfpath.front import Run
from kerfpath.graph import LayeredGraph
from kerfpath.job.format import ContourTask, Job, cell_of_job
from kerfpath.job.run._cut import Cut
from kerfpath.job.run._order import ordered
from kerfpath.kernels import is_compiled
from kerfpath.planner import (
    FastestSpeed,
    clearance_map,
    fastest_speed,
    plan,
    plan_in_pieces,
    relaxations,
)
from kerfpath.plans import Plan
from kerfpath.refiner import refine
from kerfpath.robots import robot
from kerfpath.sequence import PartPlan, longest_search, unused_postures

__all__ = [
    "Chosen",
    "Cut",
    "Given",
    "Outcome",
    "Progress",
    "fastest_along",
    "fastest_speeds",
    "is_compiled",
    "run_job",
    "warm_up",
]

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and how much there is: 0 of what has no
measure, like a search."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What came of a job: every cut, in order, its cell, and the part's mesh for pictures.

    With [sequence]: the moves between the cuts and their audit, or why there is no way.
    """

    job: Job
    cuts: tuple[Cut, ...]
    mesh: tuple[Array, Ints]
    cell: Cell | None = None
    part: PartPlan | None = None
    stuck: NoFeasiblePath | None = None
    air: tuple[Check, ...] = ()

    __repr__ = told

    @property
    def passed(self) -> bool:
        """True when every contour has a plan that passes its audit, and every move too."""
        moves = self.stuck is None and all(check.ok for check in self.air)
        return moves and all(cut.passed for cut in self.cuts)

    @property
    def plans(self) -> tuple[Plan, ...]:
        """The plans there are, in the order of cutting."""
        return tuple(cut.plan for cut in self.cuts if cut.plan is not None)


class Given(NamedTuple):
    """The path to cut of a contour, its nodes, the postures, and whether the path is a new one."""

    path: Contour
    nodes: Contour
    postures: tuple[int, ...] | None
    touched: bool


class Chosen(NamedTuple):
    """The run of a Pareto set that a contour is planned by, and whether its plan is refined."""

    run: Run
    refine: bool


def run_job(
    job: Job,
    part: Part | None = None,
    *,
    given: Mapping[str, Given] | None = None,
    chosen: Mapping[str, Chosen] | None = None,
    progress: Progress = lambda what, done, total: None,
) -> Outcome:
    """Return what comes of planning and auditing every contour of a job.

    `part` is what its drawing holds, if that is read already. With `given`, paths for all contours
    by their names, they are cut along those and come in that order. What is `chosen` for a contour
    stands in place of what the job says of its plan; it is cut along the first of its candidates.

    A contour without a feasible path does not stop the others; it is reported as such.

    Raises
    ------
    InputError
        The part cannot be read, a loop does not exist, a contour cannot be sampled.
    """
    part = part or read_drawing(job.part_file, unit=job.part_unit)
    tasks = job.tasks(part)  # a misspelt name shall not wait for the contours before it
    if given is not None:
        tasks = tuple(sorted(tasks, key=lambda task: list(given).index(task.name)))
    cell = cell_of_job(job, part)
    loops = [task.drawn(part) for task in tasks]
    tries, first = [], []
    for task, loop in zip(tasks, loops, strict=True):
        if given is not None:
            paths = [given[task.name]]
        else:
            shaped = task.candidates(part, loop)
            if chosen is not None and task.name in chosen:
                shaped = shaped[:1]
            paths = [
                Given(path, task.sample(path), job.options.postures, touched=False)
                for path in shaped
            ]
        run = None if chosen is None else chosen.get(task.name)
        tries.append([_cut(job, task, path, cell, run, progress) for path in paths])
        first.append(paths[0])
    if job.sequence is not None:
        longest = longest_search(job.sequence.seconds)
        progress(f"order and moves, {longest:g} s at most without a way", 0, 0)

    def more(i: int, cuts: Sequence[Cut]) -> list[Cut]:
        if chosen is not None and tasks[i].name in chosen:
            return []  # its plan is settled
        return _in_other_postures(job, tasks[i], first[i], cuts, cell, progress)

    found = ordered(job, loops, tries, cell, more)
    moved = {
        task.name: part.departure(task.pick, loop)
        for task, loop in zip(tasks, loops, strict=True)
        if task.table.moves_the_path or (given is not None and given[task.name].touched)
    }
    return Outcome(
        job=job,
        cuts=tuple(cut.measured(part, moved.get(cut.contour)) for cut in found.cuts),
        mesh=part.mesh(),
        cell=cell,
        part=found.part,
        stuck=found.stuck,
        air=found.air,
    )


def _cut(
    job: Job,
    task: ContourTask,
    asked: Given,
    cell: Cell | None,
    chosen: Chosen | None,
    progress: Progress,
) -> tuple[Cut, ...]:
    """Return what came of a contour: one cut, or several where it is interrupted."""
    drawn, nodes = asked.path, asked.nodes
    options, done = replace(job.options, postures=asked.postures), 0
    if chosen is not None:
        options = replace(chosen.run.applied_to(options), feed="constant", refine=chosen.refine)
    whole_job, job = job, replace(job, options=options)

    def solved(count: int) -> None:
        nonlocal done
        done += count
        progress(task.name, done, len(nodes))

    progress(task.name, 0, len(nodes))
    graph = job.graph(nodes, progress=solved)
    clearance = None
    if cell is not None and job.cell is not None and job.cell.map:
        progress(f"{task.name}: map of the cell", 0, 0)
        clearance = clearance_map(graph, cell)
    whole = Cut(
        contour=task.name,
        task=task,
        drawn=drawn,
        nodes=nodes,
        graph=graph,
        clearance=clearance,
        picked=chosen is not None,
    )
    kept = cell
    if chosen is not None:
        graph, kept = chosen.run.graph(graph, job.robot.endless), chosen.run.cell(cell)

    def phase(what: str) -> None:
        progress(f"{task.name}: {what}", 0, 0)

    try:
        plans = _plans(job, task, nodes, graph, kept, phase)
    except NoFeasiblePath as broken:
        # With poses everywhere slower would do; for a loop that cannot close, or an axis that may
        # not turn as far, it need not, and a feed that dips has tried.
        plain = options.closure == "free" and options.rotation is None
        constant = options.feed == "constant" and nodes.time is None
        if not (np.diff(graph.start).all() and plain and constant):
            return (replace(whole, broken=broken),)
        phase("fastest speed")
        if cell is not None:
            # Shares of the limits at which a clear path exists are not looked for.
            with suppress(NoFeasiblePath):
                slower = fastest_along(job, nodes, cell, refine=options.refine, graph=graph)
                return (replace(whole, broken=broken, fastest=slower),)
            return (replace(whole, broken=broken),)
        least = relaxations(
            nodes, job.robot, graph, task.speed, eta_v=options.eta_v, eta_a=options.eta_a
        )
        fastest = FastestSpeed.of(nodes, least.slower)
        if options.refine:
            fastest = fastest_along(job, nodes, None, refine=True, graph=graph)
        return (replace(whole, broken=broken, fastest=fastest, relaxations=least),)
    phase("audit")
    return tuple(_audited(job, whole, _asked_by(whole_job, made), cell) for made in plans)


def _asked_by(job: Job, made: Plan) -> Plan:
    """Return a plan with the postures that the job allows, of which the search had only some."""
    return replace(made, settings=replace(made.settings, postures=job.options.postures))


def _in_other_postures(
    job: Job,
    task: ContourTask,
    asked: Given,
    made: Sequence[Cut],
    cell: Cell | None,
    progress: Progress,
) -> list[Cut]:
    """Return the cuts of a contour, each all in one of the postures that those made do not use."""
    found = []
    plans = [cut.plan for cut in made if cut.plan is not None]
    postures = unused_postures(plans, asked.postures)
    for k, posture in enumerate(postures):
        progress(f"{task.name}: other postures", k, len(postures))
        here = replace(job, options=replace(job.options, postures=(posture,)))
        graph = here.graph(asked.nodes)
        whole = Cut(contour=task.name, task=task, drawn=asked.path, nodes=asked.nodes, graph=graph)
        with suppress(NoFeasiblePath):
            one = _whole(here, task, asked.nodes, graph, cell, lambda phase: None)
            cut = _audited(here, whole, _asked_by(job, one), cell)
            found += [cut] if cut.passed else []
    return found


def fastest_along(
    job: Job,
    nodes: Contour,
    cell: Cell | None,
    *,
    refine: bool,
    graph: LayeredGraph | None = None,
) -> FastestSpeed:
    """Return the fastest constant speed of a contour, clear in the cell where there is one."""
    return fastest_speed(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        options=replace(job.options.without_penalties, refine=refine),
        cell=cell,
        graph=graph,
    )


def _plans(
    job: Job,
    task: ContourTask,
    nodes: Contour,
    graph: LayeredGraph,
    cell: Cell | None,
    phase: Callable[[str], None],
) -> tuple[Plan, ...]:
    """Return the plan of a contour, or those of its pieces where the job lets it be interrupted."""
    try:
        return (_whole(job, task, nodes, graph, cell, phase),)
    except NoFeasiblePath:
        if job.options.interruptions == "none" or not np.diff(graph.start).all():
            raise
    return plan_in_pieces(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        speed=_speed(task, nodes),
        options=job.options,
        cell=cell,
        graph=graph,
        phase=phase,
    )


def _whole(
    job: Job,
    task: ContourTask,
    nodes: Contour,
    graph: LayeredGraph,
    cell: Cell | None,
    phase: Callable[[str], None],
) -> Plan:
    """Return the plan of a contour that is cut in one go."""
    return plan(
        nodes,
        job.robot,
        tool=job.tool,
        placement=job.placement,
        speed=_speed(task, nodes),
        options=job.options,
        cell=cell,
        graph=graph,
        phase=phase,
    )


def _speed(task: ContourTask, nodes: Contour) -> float | None:
    """Return the speed (m/s) to plan at; None where the nodes carry their own times."""
    return task.speed if nodes.time is None else None


def _audited(job: Job, whole: Cut, made: Plan, cell: Cell | None) -> Cut:
    """Return the cut of one plan, at finer intervals if the job asks for them, and its audit."""
    drawn, graph, nodes, s = whole.drawn, whole.graph, whole.nodes, made.contour.s
    if len(s) < len(nodes):
        first = int(np.searchsorted(nodes.s, s[0]))
        drawn, nodes = drawn.between(float(s[0]), float(s[-1])), made.contour
        graph = graph.part(first, first + len(s) - 1)
    if job.options.refine_parts > 1:
        made = _divided(made, drawn, job.options.refine_parts)
    return replace(
        whole,
        task=replace(whole.task, name=made.name),
        drawn=drawn,
        nodes=nodes,
        graph=graph,
        plan=made,
        checks=tuple(job.tolerances.checks(made, reference=drawn, cell=cell)),
    )


def _divided(made: Plan, drawn: Contour, parts: int) -> Plan:
    """Return the plan on nodes that divide its intervals, where one keeps the limits there."""
    nodes = np.arange(len(made.contour))
    finer = drawn.at_nodes(
        np.interp(np.arange(nodes[-1] * parts + 1) / parts, nodes, made.contour.s)
    )
    found = refine(made, nodes=replace(finer, name=made.name))
    if found.done:
        return found.plan
    statement = f"{made.proof.statement}; at {parts} parts of an interval {found.statement}"
    return replace(made, proof=replace(made.proof, statement=statement))


def fastest_speeds(
    job: Job, *, progress: Progress = lambda what, done, total: None
) -> list[tuple[ContourTask, Contour, FastestSpeed | NoFeasiblePath]]:
    """Return, for each contour of a job, its task, its nodes and the fastest constant speed.

    The speeds that the job asks for, and shares of them, play no part, nor does what comfort costs.

    Raises
    ------
    InputError
        As `run_job`.
    """
    part = read_drawing(job.part_file, unit=job.part_unit)
    cell = cell_of_job(job, part)
    refine = job.options.refine
    answers: list[tuple[ContourTask, Contour, FastestSpeed | NoFeasiblePath]] = []
    tasks = job.tasks(part)
    for i, task in enumerate(tasks):
        progress("contours", i, len(tasks))
        progress(f"{task.name}: fastest speed", 0, 0)
        nodes = task.evenly_fast(part)
        try:
            found: FastestSpeed | NoFeasiblePath = fastest_along(job, nodes, cell, refine=refine)
        except NoFeasiblePath as broken:
            found = broken
        answers.append((task, nodes, found))
    return answers


def warm_up() -> bool:
    """Compile the kernels if this copy never has; return whether that was needed."""
    if is_compiled():
        return False
    arm = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
    corners = np.array([[1.2, 0.0, 0.5], [1.2, 0.001, 0.5], [1.201, 0.001, 0.5], [1.201, 0.0, 0.5]])
    contour = Contour(corners, np.tile([0.0, 0.0, -1.0], (4, 1)), closed=True)
    for frames in FRAME_KINDS:
        made = plan(
            contour,
            arm,
            tool=np.eye(4),
            placement=np.eye(4),
            speed=0.001,
            gamma_step=np.pi / 2,
            frames=frames,
        )
        _ = made.criteria
    arm.inverse(arm.forward(made.q))
    return True
