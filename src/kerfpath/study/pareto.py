"""The Pareto front of a contour of a job: find it, write it, and plan one of its runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from shlex import quote
from typing import TypedDict

import numpy as np

from kerfpath import __version__
from kerfpath.arrays import SHOWN_UNITS, short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.front import (
    AHEAD,
    CourseData,
    Evaluation,
    Front,
    FrontSearch,
    ParetoProblem,
    SearchKind,
    Subproblem,
    SubproblemData,
    course_data,
    course_from,
    criteria_named,
    follows_courses,
    graph_of_runs,
)
from kerfpath.job import Job, JobResult, cell_of_job, make_folder, prepare, run_prepared
from kerfpath.plans import Plan
from kerfpath.post import require_one_set, write_set
from kerfpath.progress import Progress, no_progress
from kerfpath.report import FrontAxis, FrontPlan, render_front
from kerfpath.robots import Robot
from kerfpath.study.loaded_job import LoadedJob, digest_of, job_key, load_job
from kerfpath.sweep import Result, Sweep

# -----------------------------------------------------------------------------
# Find the front; every run is a task of a sweep.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobFront:
    """The Pareto front of a contour of a job.

    Parameters
    ----------
    job : Job
    digest : str
        Hash of the job and its files.
    contour : str
        Name of the contour.
    others : tuple of str
        Names of the other contours of the job.
    front : Front
    """

    job: Job
    digest: str
    contour: str
    others: tuple[str, ...]
    front: Front

    __repr__ = short_repr


def pareto_of_job(
    job_file: Path,
    *,
    store: Path,
    contour: str | None = None,
    criteria: Sequence[str] = ("displacement", "velocity", "range"),
    runs: int = 100,
    search: SearchKind = "adaptive",
    seed: int = 0,
    ahead: int = AHEAD,
    scheduler: str | None = None,
    processes: int | None = None,
    progress: Progress = no_progress,
) -> JobFront:
    """Return the Pareto front of a contour; runs that are in the store are not repeated.

    Parameters
    ----------
    job_file : Path
    store : Path
        Store of the sweep, see `kerfpath.sweep.run`.
    contour : str, optional
        Name of the contour; default: the longest.
    criteria, runs, search, seed, ahead
        As in `kerfpath.pareto`; "time" starts from home_deg in [sequence] of the job.
    scheduler, processes, progress
        As in `kerfpath.sweep.run`.

    Raises
    ------
    NoFeasiblePath
        No run has a plan; the message says why.
    InputError
        As `read_job`, `kerfpath.pareto` and `kerfpath.sweep.run`; also where the job has no such
        contour.
    """
    key = job_key(job_file)
    known = load_job(**key)
    name, others = _named_contour(known, contour)
    problem = _problem(**key, contour=name, criteria=tuple(criteria))
    front_search = FrontSearch(problem, runs=runs, search=search, seed=seed, ahead=ahead)
    with Sweep(
        solve,
        store=store,
        scheduler=scheduler,
        processes=processes,
        progress=progress,
        total=front_search.runs,
    ) as sweep:

        def submit(number: int, run: Subproblem) -> Callable[[], Evaluation | str]:
            task = sweep.submit(
                **key,
                contour=name,
                criteria=list(criteria),
                run=run.to_data(),
                first=number == 0,
            )
            return lambda: _evaluation(sweep.result(task))

        front = front_search.run(submit)
    return JobFront(job=known.job, digest=key["digest"], contour=name, others=others, front=front)


class SolvedData(TypedDict, total=False):
    """The result of a run as JSON data: `why` it has no plan, or the evaluation of its plan."""

    why: str
    losses: list[float]
    course: CourseData


def solve(
    *,
    job: str,
    digest: str,
    contour: str,
    criteria: Sequence[str],
    run: SubproblemData,
    first: bool,
) -> SolvedData:
    """Do one run; this is the task of a sweep.

    Raises
    ------
    NoFeasiblePath
        The `first` run, which has the full limits, has no path.
    """
    problem = _problem(job, digest, contour, tuple(criteria))
    made = problem.solve(Subproblem.from_data(run), first=first)
    if isinstance(made, str):
        return {"why": made}
    found = problem.evaluate(made)
    return {"losses": found.losses.tolist(), "course": course_data(found.course)}


def _evaluation(result: Result) -> Evaluation | str:
    failure = result.failure
    if failure is None:
        found: SolvedData = result.value
        if "why" in found:
            return found["why"]
        return Evaluation(losses=np.array(found["losses"]), course=course_from(found["course"]))
    if failure.kind == "NoFeasiblePath":
        raise NoFeasiblePath(failure.message, proved=False, node=-1)
    if failure.kind == "InputError":
        raise InputError(failure.message)
    return failure.reason


@lru_cache(maxsize=2)
def _problem(job: str, digest: str, contour: str, criteria: tuple[str, ...]) -> ParetoProblem:
    """Return the problem that the runs of a contour share, cached for the next task of a worker."""
    known = load_job(job, digest)
    cell = cell_of_job(known.job, known.part)
    return problem_of_job(known.job, known.part, contour, criteria, cell)


def problem_of_job(
    job: Job, part: Part, contour: str, criteria: Sequence[str], cell: Cell | None
) -> ParetoProblem:
    """Return the problem that the runs of a contour of a job share.

    Parameters
    ----------
    job : Job
    part : Part
        The part of the job.
    contour : str
        Name of a contour of the job.
    criteria : sequence of str
        As in `kerfpath.pareto`.
    cell : Cell or None
        The cell of the job.

    Raises
    ------
    InputError
        A criterion is unknown, or something that it needs is missing.
    NoFeasiblePath
        No course of the external axes leads to a plan.
    """
    task = next(task for task in job.tasks(part) if task.name == contour)
    drawn = task.candidates(part)[0]
    nodes = task.sample(drawn)
    asked = task.asked(job.options)
    speed = task.speed if nodes.time is None else None
    if asked.method == "continuous":
        job.robot.require_no_free_joint("a Pareto set off the grid")
    options = replace(asked, feed="constant", refine=False, certify=None)
    setup = job.setup_in(cell)
    return ParetoProblem(
        contour=nodes,
        setup=setup,
        speed=speed,
        options=options,
        criteria=criteria_named(criteria, job.robot, options=options, cell=cell, home=job.home),
        graph=graph_of_runs(nodes, setup, asked, speed=speed),
        home=job.home,
        audit=lambda made: _faults(job, drawn, made, cell),
    )


def _faults(job: Job, drawn: Contour, made: Plan, cell: Cell | None) -> list[Check]:
    table = job.tolerances.checks(made, reference=drawn, cell=cell)
    return [check for check in table if check.level == "error" and not check.ok]


def _named_contour(known: LoadedJob, contour: str | None) -> tuple[str, tuple[str, ...]]:
    """Return the name of the contour (default: the longest) and the names of the others."""
    tasks = {task.name: task for task in known.job.tasks(known.part)}
    if contour is None:
        contour = max(tasks, key=lambda name: tasks[name].drawn(known.part).length)
    elif contour not in tasks:
        raise InputError(
            f"{known.job.path}: expected the name of a contour of the job, got {contour!r}; its "
            f"contours: {', '.join(tasks)}"
        )
    return contour, tuple(name for name in tasks if name != contour)


# -----------------------------------------------------------------------------
# Write the front to pareto.json and pareto.html, and plan a picked run.

SCHEMA = 1
"""Version of the format of pareto.json."""


def write_pareto(found: JobFront, folder: Path) -> list[Path]:
    """Write pareto.json and pareto.html of a study into a folder.

    Raises
    ------
    InputError
        The folder cannot be made or written to.
    """
    make_folder(folder)
    data = json.dumps(_entries(found), indent=1, allow_nan=False) + "\n"
    return write_set(folder, {"pareto.json": data, "pareto.html": _page(found, folder)})


def _entries(found: JobFront) -> dict[str, object]:
    front = found.front
    return {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": found.job.source,
        "digest": found.digest,
        "contour": found.contour,
        "criteria": [
            {"name": c.name, "unit": c.unit, "better": "more" if c.more_is_better else "less"}
            for c in front.axes
        ],
        "plans": [
            {"number": number, "values": values, "run": run.to_data()}
            for number, values, run in zip(
                front.numbers, front.values.tolist(), front.runs, strict=True
            )
        ],
        "marks": marks(front),
        "ideal": front.ideal.tolist(),
        "reference": front.reference.tolist(),
        "hypervolume": front.hypervolume,
        "gap": front.gap,
        "on_grid": front.on_grid.tolist(),
        "tried": front.tried,
        "feasible": front.feasible,
        "failures": dict(front.failures),
    }


def marks(front: Front) -> dict[str, int]:
    """Return the number of the best plan in each criterion, and of the balanced plan."""
    best = {name: front.numbers[front.best_at(name)] for name in front.criteria}
    return best | {"balanced": front.numbers[front.balanced_at]}


def axes_of(front: Front) -> list[FrontAxis]:
    """Return the criteria of a front in the form that pages show."""
    return [
        FrontAxis(name=axis.name, words=axis.words, unit=axis.unit, sense=axis.sense)
        for axis in front.axes
    ]


def _page(found: JobFront, folder: Path) -> str:
    front, job, axes = found.front, found.job, axes_of(found.front)
    plans = [
        FrontPlan(number=number, values=tuple(values), asked=tuple(rows_of_run(run, job.robot)))
        for number, values, run in zip(
            front.numbers, front.values.tolist(), front.runs, strict=True
        )
    ]
    facts = [
        ("Job", job.path.name),
        ("Contour", found.contour),
        ("Robot", f"{job.robot.manufacturer} {job.robot.model}".strip() or job.robot.id),
        ("Runs", f"{front.tried}, {front.feasible} of them with a plan that passed its audit"),
        ("Front", f"{len(front.runs)} plans that no other beats"),
        ("Hypervolume", f"{front.hypervolume:.4f} of the box from the ideal to the reference"),
        ("Largest gap", f"{front.gap:.3f} of that box, between neighbours in one criterion"),
    ]
    off_grid = any(run.continuous for run in front.runs)
    if off_grid:
        facts.append(("Off the grid", front.beyond_the_grid))
    facts += [(f"{number} runs without a plan", why) for why, number in front.failures.items()]
    many = len(found.others)
    others = [f"The front is of one contour; the job has {many} more."] if many else []
    titles = {"balanced": "balanced"} | {axis.name: f"best {axis.words}" for axis in axes}
    where = quote(str(folder))
    return render_front(
        f"{job.part_file.stem.replace('_', ' ')}: {found.contour}",
        axes=axes,
        plans=plans,
        dominated=front.beaten.tolist(),
        marks={titles[name]: number for name, number in marks(front).items()},
        facts=facts,
        notes=[_note(off_grid=off_grid), *_courses_note(job), *others],
        command=f"kerfpath pareto {quote(str(job.path))} --out {where} --pick {{number}}",
        job_text=job.path.read_text(encoding="utf-8-sig"),
    )


def _note(*, off_grid: bool) -> str:
    """Return the note on what is proved of the plans."""
    known = (
        "A plan over continuous rotation is the best motion found for its run; a plan on the grid "
        "is the proved optimum on that grid. No plan is certified before it is picked."
        if off_grid
        else "Every plan is the proved optimum of its run on the grid of the rotation and is not "
        "refined: off the grid there may be better or faster plans."
    )
    return f"{known} The set is a sample of the front."


def _courses_note(job: Job) -> list[str]:
    """Return the note on the courses of external axes along which plans are proved, if any."""
    if not follows_courses(job.robot, job.options):
        return []
    names = ", ".join(axis.name for axis in job.robot.externals)
    return [
        f"On the grid {names} follow the courses of the plans that kerfpath plan finds. An optimum "
        "is proved along these courses only, not for other courses. Over continuous rotation plans "
        "may leave them."
    ]


def rows_of_run(run: Subproblem, robot: Robot) -> list[tuple[str, str]]:
    """Return the settings of a run as rows of name and value in words."""
    each = run.weights * robot.speed_limits()[0]
    relative = each / np.exp(np.log(each).mean())
    rotation = "continuous" if run.continuous else "on its grid"
    if run.begin:
        rotation += ", refined from known plans"
    rows = [
        ("minimise", f"{run.objective} of {run.metric} distances"),
        ("rotation", rotation),
        ("limits", f"{run.eta_v:.1%} of velocity, {run.eta_a:.1%} of acceleration"),
        ("joints weigh", " ".join(f"{weight:.3g}" for weight in relative)),
    ]
    for joint, (low, high) in enumerate(run.window):
        if np.isfinite(high - low):
            factor, unit = SHOWN_UNITS[robot.units[joint]]
            span = f"{low * factor:.1f} to {high * factor:.1f} {unit}"
            rows.append((f"window of {robot.joint_names[joint]}", span))
    if run.clearance:
        rows.append(("clearance", f"{run.clearance * 1e3:.1f} mm"))
    return rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pick:
    """A plan of a front: its contour, its number, and the settings of its run."""

    contour: str
    number: int
    run: Subproblem

    __repr__ = short_repr


def read_pick(folder: Path, job_file: Path, which: str) -> Pick:
    """Return a plan of the front in a folder, by number, "balanced" or the name of a criterion.

    The name of a criterion stands for the plan that is best in it.

    Raises
    ------
    InputError
        The folder has no front, the front is from another version or another state of the job, or
        it has no such plan; its page is left of an earlier study.
    """
    path = folder / "pareto.json"
    require_one_set(path)
    again = f"run kerfpath pareto {job_file} --out {folder} first"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        schema, version, whole = data["schema"], data["kerfpath"], data["digest"]
        plans = {plan["number"]: plan for plan in data["plans"]}
        named, contour = data["marks"], data["contour"]
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {again}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: expected a front written by kerfpath; {again}") from None
    if (schema, version) != (SCHEMA, __version__):
        raise InputError(
            f"{path}: written by kerfpath {version}, but this is {__version__}; {again}, with "
            "another folder"
        )
    if whole != digest_of(job_file):
        raise InputError(
            f"{path}: the job or a file that it names has changed since this front; {again}"
        )
    number = int(which) if which.isdecimal() else named.get(which)
    if number not in plans:
        known = ", ".join(map(str, sorted(plans)))
        raise InputError(
            f"--pick {which}: expected one of {', '.join(named)}, or a plan of the front: {known}"
        )
    return Pick(contour=contour, number=number, run=Subproblem.from_data(plans[number]["run"]))


def plan_picked(
    job_file: Path, pick: Pick, *, refine: bool, progress: Progress = no_progress
) -> tuple[Part, JobResult]:
    """Return the part of the job and the result of the whole job with one contour as picked.

    With `refine`, the picked plan is refined off the grid of gamma; its criteria then differ.
    """
    known = load_job(**job_key(job_file))
    prepared = prepare(known.job, known.part)
    contours = [
        asked.picked(pick.run, refine=refine) if asked.task.name == pick.contour else asked
        for asked in prepared.contours
    ]
    return known.part, run_prepared(prepared.with_contours(contours), progress=progress)
