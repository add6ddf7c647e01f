"""The audit of a program on disk: what its text means, against the job that it is to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array
from kerfpath.air import least_time
from kerfpath.auditor import Check, Rounding, Unit, air_checks, checks, rounding_of, worst_of
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job._asked import asked_of
from kerfpath.job._program_asked import AskedNodes, asked_nodes, asked_program
from kerfpath.job._program_beam import Process, beam_checks
from kerfpath.job._program_read import ReadCut, at_interval, cuts_of, language_of, program_on_disk
from kerfpath.job._read import Job, read_job
from kerfpath.job._task import ContourTask
from kerfpath.job._verdict import Audited, collision_note
from kerfpath.planner import node_interval
from kerfpath.plans import Plan, Proof
from kerfpath.plans import Settings as PlanSettings
from kerfpath.post import Language, ReadProgram, Rules, Settings, differences, with_tips

__all__ = ["ProgramAsked", "audit_program"]

NEAR = 5e-3
"""A cut that leaves every contour of the job by more (m), all along, is none of them."""
SAME_FRAME = 1e-6
"""How far (m, sine) tool and part may be from those of the job."""
SAME_SPEED = 0.02
"""Share by which a speed may differ from the one asked for, beyond its digits."""
SAME_TIME = 2e-3
"""How far (s) lead times and waits may differ from those asked for: controllers round them."""
FOLLOWED = ("postures",)
"""Differences that follow from the path that was read, and are judged with it."""
WHAT = {
    "added": "moves",
    "removed": "moves",
    "targets": "targets beside the cut",
    "joints": "joint targets",
    "times": "times of moves",
    "zones": "corners and stops",
    "switches": "laser and gas",
    "kinds": "kinds of moves",
}
"""What differs, by the code of the difference."""
CLIMB = 0.05
"""What a step along the path counts beside one away from it, where a place on it is looked for."""


def audit_program(path: Path, job_file: Path) -> Audited:
    """Return what the audit says of every cut of a program.

    Its targets are led through the robot's kinematics to joints, and these are audited as those of
    a plan are: against the drawing, the limits and the cell of the job. Frames, speeds, switches
    and waits are compared with what the job asks for.

    Parameters
    ----------
    path : Path
        The file that is started.
    job_file : Path
        The job that the program was made for.

    Raises
    ------
    InputError
        A file cannot be read, a line is not of our making, or the job is of a kind that programs
        cannot be compared with.
    """
    asked = ProgramAsked.of(job_file)
    chosen, settings = language_of(path, asked.job)
    read = program_on_disk(path, chosen, settings, asked.job.robot)
    return asked.audit(read, chosen, settings, path.name)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProgramAsked:
    """A job and its drawing, read once, to audit programs by.

    Parameters
    ----------
    job : Job
    tasks : tuple of ContourTask
    candidates : tuple of tuples of Contour
        The paths that each of them may be cut along.
    cell : Cell or None
    inner_first : tuple of (int, int)
        Contours of which the first is to be cut before the second.
    """

    job: Job
    tasks: tuple[ContourTask, ...]
    candidates: tuple[tuple[Contour, ...], ...]
    cell: Cell | None
    inner_first: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(cls, job_file: Path) -> ProgramAsked:
        """Return what a job asks of its program.

        Raises
        ------
        InputError
            A file cannot be read, or the job is of a kind that programs cannot be compared with.
        """
        job = read_job(job_file)
        if job.interruptions != "none":
            raise InputError(
                f"{job_file}: programs of jobs with interruptions cannot be compared with the "
                "drawing yet; audit the plan.json"
            )
        asked = asked_of(job)
        return cls(
            job=job,
            tasks=asked.tasks,
            candidates=tuple(tuple(way.path for way in ways) for ways in asked.candidates),
            cell=asked.cell,
            inner_first=asked.inner_first,
        )

    def audit(self, read: ReadProgram, chosen: Language, settings: Settings, name: str) -> Audited:
        """Return what the audit says of every cut of a program that was read."""
        job, tasks, candidates, cell = self.job, self.tasks, self.candidates, self.cell
        read = with_tips(read, job.robot, job.tool, job.placement)
        cuts, home = cuts_of(read, job.robot, job.tool, job.placement)
        tables: dict[str, list[Check]] = {}
        places: dict[str, tuple[str, ...]] = {name: tuple(step.place for step in read.steps)}
        tool = job.tool if read.T_flange_tip is None else read.T_flange_tip
        placed = job.placement if read.T_base_part is None else read.T_base_part
        off = max(np.abs(tool - job.tool).max(), np.abs(placed - job.placement).max())
        process = Process.of(job.program, ahead=chosen.ahead)
        tables[name] = [
            _check("frames", "tool and part, off the job's", off, SAME_FRAME, "m"),
            *beam_checks(read, job.robot, process),
        ]
        done: list[int] = []
        followed: list[tuple[ReadCut, AskedNodes, Plan]] = []
        for cut in cuts:
            apart, which, candidate = _closest(cut, candidates)
            title = f"{cut.name} ({tasks[which].name})" if apart < NEAR else cut.name
            places[title] = tuple(move.place for move in cut.moves)
            if apart >= NEAR:
                said = "distance from the nearest contour of the job"
                tables[title] = [_check("contour", said, apart, NEAR, "m")]
                continue
            reference = candidates[which][candidate]
            dt = _asked_times(tasks[which], reference)[1]
            cut = at_interval(cut, dt, job.robot, job.tool, job.placement)
            places[title] = tuple(move.place for move in (*cut.moves, cut.group.path[-1]))
            tables[title], along = _cut_checks(
                job, tasks[which], cut, reference, cell, chosen, settings
            )
            times = done.count(which)
            tables[title].append(_check("once", "earlier cuts of this contour", times, 0, "count"))
            done.append(which)
            followed += [] if along is None else [(cut, *along)]
        tables[name] += self._order(done, cuts, places[name])
        tables[name] += _asked_for(job, followed, home, read, chosen, settings)
        tables["air"] = _air(job, cuts, home, cell if job.sequence is not None else None)
        missing = tuple(task.name for i, task in enumerate(tasks) if i not in done)
        note = collision_note(cell, moves_too=job.sequence is not None)
        return Audited(tables=tables, missing=missing, note=note, places=places)

    def _order(
        self, done: Sequence[int], cuts: Sequence[ReadCut], places: Sequence[str]
    ) -> list[Check]:
        """Compare the order of contours with that of the job, or with the rules of [sequence]."""
        sequence = self.job.sequence
        given = sequence is None or sequence.order == "given"
        wrong = [
            k
            for k, i in enumerate(done)
            if (given and any(j > i for j in done[:k]))
            or any(inner == i and outer in done[:k] for inner, outer in self.inner_first)
        ]
        said = "contours cut after one that comes later in the job, or that they lie in"
        node = places.index(cuts[wrong[0]].moves[0].place) if wrong else 0
        return [_check("order", said, len(wrong), 0, "count", node)]


def _asked_for(
    job: Job, followed: Sequence[tuple[ReadCut, AskedNodes, Plan]], home: Array,
    read: ReadProgram, chosen: Language, settings: Settings,
) -> list[Check]:  # fmt: skip
    """Compare a program with the one that the job would have along the same paths.

    Whatever differs is a finding: how many moves, and where the largest stands.
    """
    if not followed:
        return []
    try:
        asked = asked_program(job, followed, home, chosen, settings)
    except InputError as error:
        said = f"a program as the job asks for cannot be made along these paths ({error})"
        return [_check("asked", said, 1, 0, "count")]
    rules = chosen.rules(settings)
    asked = with_tips(asked, job.robot, job.tool, job.placement)
    found = differences(asked, read, rules=(rules,), names=("the job", "the text"))
    places = [step.place for step in read.steps]
    rows = [
        _check(
            f"asked-{each.code}",
            f"not as asked for, {WHAT.get(each.code, each.code)}: {each.message}"
            + (f" (said in {each.said_at})" if each.said_at else ""),
            each.count,
            0,
            "count",
            places.index(each.place) if each.place in places else 0,
        )
        for each in found
        if each.code not in FOLLOWED
    ]
    return rows or [_check("asked", "moves that are not as asked for", 0, 0, "count")]


def _check(code: str, title: str, value: float, limit: float, unit: Unit, node: int = 0) -> Check:
    return Check(
        code=code, title=title, value=float(value), limit=float(limit), unit=unit, node=node
    )


def _closest(cut: ReadCut, candidates: Sequence[Sequence[Contour]]) -> tuple[float, int, int]:
    """Return how far (m) the cut leaves the contour that it follows best, its task and candidate.

    Compared at the same shares of the way.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    some = np.unique(np.linspace(0, len(points) - 1, 100).round().astype(int))
    found = []
    for i, tried in enumerate(candidates):
        for c, contour in enumerate(tried):
            s = contour.s[0] + way[some] / way[-1] * contour.length
            apart = np.linalg.norm(contour.at(s)[0] - points[some], axis=1)
            found.append((float(np.median(apart)), i, c))
    return min(found)


def _cut_checks(
    job: Job, task: ContourTask, cut: ReadCut, reference: Contour, cell: Cell | None,
    chosen: Language, settings: Settings,
) -> tuple[list[Check], tuple[AskedNodes, Plan] | None]:  # fmt: skip
    """Return the checks of a cut, and its nodes and plan where it can be compared with the job."""
    unreached = np.flatnonzero(np.isnan(cut.q).any(axis=1))
    if unreached.size:
        said = "targets out of the robot's reach in the posture of the start"
        return [_check("reach", said, unreached.size, 0, "count", int(unreached[0]))], None
    s, ends = _along(cut, reference)
    rows = [_check("ends", "ends of the cut, off those of the contour", ends.max(), 1e-4, "m")]
    if (np.diff(s) <= 0).any():
        node = int(np.flatnonzero(np.diff(s) <= 0)[0])
        said = "stretches that go back along the contour"
        return [*rows, _check("order", said, (np.diff(s) <= 0).sum(), 0, "count", node)], None
    took = np.where(np.isnan(cut.speed), cut.took, np.diff(s) / cut.speed)
    made = _plan(job, task, cut, s, np.append(0.0, np.cumsum(took)))
    options = dict(job.audit_options)
    if job.plan_options["tilt"] is not None:
        options["axis_tolerance"] += job.plan_options["tilt"].cone
    rules = chosen.rules(settings)
    digits = _rounding(cut, made, rules)
    rows += checks(made, reference=reference, cell=cell, rounding=digits, **options)
    rows += _asked(job, task, cut, reference, made, digits.time, ahead=chosen.ahead)
    rows += _postures(job, cut, chosen, settings, digits.q)
    asked = asked_nodes(job, task, cut, reference, s)
    off, alone = int(np.argmax(asked.off)), int(np.argmax(asked.alone))
    said = "targets that leave a node of the job out, or are none"
    rows += [
        _check("nodes", "targets, off the nodes that the job asks for", asked.off[off],
               options["path_tolerance"], "m", int(cut.ends[off])),
        _check("every-node", said, asked.alone.sum(), 0, "count", int(cut.ends[alone])),
    ]  # fmt: skip
    return rows, (asked, made) if asked.complete else None


def _along(cut: ReadCut, reference: Contour) -> tuple[Array, Array]:
    """Return arc lengths (K,) of the nodes on the contour, and how far (2,) m its ends are off.

    Where the contour comes by the same place twice, the share of the way decides.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    guess = reference.s[0] + way / way[-1] * reference.length
    fine = np.linspace(reference.s[0], reference.s[-1], 8 * len(reference))
    at = np.unique(np.concatenate([reference.s, fine]))
    tree = cKDTree(np.c_[reference.at(at)[0], CLIMB * at])
    near = np.asarray(tree.query(np.c_[points, CLIMB * guess])[1])
    s = at[near]
    for _ in range(3):  # on the chords beside the nearest sample
        before, after = (
            reference.at(np.maximum(s - 1e-5, at[0]))[0],
            reference.at(np.minimum(s + 1e-5, at[-1]))[0],
        )
        chord = after - before
        step = ((points - reference.at(s)[0]) * chord).sum(axis=1) / np.maximum(
            np.linalg.norm(chord, axis=1), 1e-12
        )
        s = np.clip(s + step, at[0], at[-1])
    ends = np.linalg.norm(points[[0, -1]] - reference.points[[0, -1]], axis=1)
    s[0], s[-1] = reference.s[0], reference.s[-1]
    return s, ends


def _plan(job: Job, task: ContourTask, cut: ReadCut, s: Array, time: Array) -> Plan:
    """Return what the text says of a cut as a plan, so that it is audited as one."""
    options, K = job.plan_options, len(cut.q)
    weights = options["weights"]
    return Plan(
        contour=Contour(cut.T_part_tip[:, :3, 3], cut.T_part_tip[:, :3, 2], s=s, name=task.name),
        robot=job.robot,
        T_flange_tip=job.tool,
        T_base_part=job.placement,
        q=cut.q,
        gamma=np.zeros(K),
        posture=np.zeros(K, dtype=np.int64),
        turn=np.zeros(cut.q.shape, dtype=np.int64),
        time=time,
        settings=PlanSettings(
            gamma_step=options["gamma_step"],
            frames=options["frames"],
            method=options["method"],
            objective=options["objective"],
            metric=options["metric"],
            weights=np.ones(job.robot.joints) if weights is None else np.asarray(weights),
            eta_v=options["eta_v"],
            eta_a=options["eta_a"],
            rotation=options["rotation"],
            comfort=options["comfort"],
        ),
        cost=0.0,
        proof=Proof(optimal=False, statement="read from a program"),
        counts={},
    )


def _rounding(cut: ReadCut, made: Plan, rules: Rules) -> Rounding:
    """Return what the digits of a language leave of the joints and times of a cut."""
    jointed = all(move.T_part_tip is None for move in cut.moves)
    time = np.where(np.isnan(cut.speed), 0.0, rules.speed_step / 2 / cut.speed)
    return rounding_of(made, rules.point_step, rules.angle_step, time, jointed=jointed)


def _asked(
    job: Job, task: ContourTask, cut: ReadCut, reference: Contour, made: Plan, digits: Array,
    *, ahead: bool,
) -> list[Check]:  # fmt: skip
    """Compare speeds, switches and waits with what the job asks for.

    Where the language cannot switch `ahead` of a target, it has to do so at the target.
    """
    s = made.contour.s
    middle = (s[1:] + s[:-1]) / 2
    asked, dt = _asked_times(task, reference)
    when = dt * np.arange(len(asked))
    k = np.clip(np.searchsorted(reference.s, middle, side="right") - 1, 0, len(reference) - 1)
    wanted = np.array([reference.kinds[j] != "micro joint" for j in k])
    wrong = wanted != cut.laser
    excess = np.diff(np.interp(s, asked.s, when)) / np.diff(made.time) - 1
    if job.plan_options["feed"] == "constant":
        excess = np.abs(excess)
    fast = int(np.argmax(excess - digits))
    node = int(np.argmax(wrong)) if wrong.any() else 0
    lead = np.abs(cut.lead_times - (job.program.lead_time if ahead else 0.0))
    wait = abs(float(cut.waits.sum()) - job.program.pierce_time)
    lengths = np.diff(s)[wrong].sum()
    return [
        _check(
            "speed",
            "speed, off the one asked for",
            excess[fast],
            SAME_SPEED + digits[fast],
            "share",
            fast,
        ),
        _check("laser", "length with the laser wrongly on or off", lengths, 1e-6, "m", node),
        _check("laser-off", "laser left on at the end", cut.left_on, 0, "count", len(s) - 1),
        _check("lead-time", "lead time of the laser, off", lead.max(initial=0), SAME_TIME, "s"),
        _check("pierce", "wait at the start, off the one asked for", wait, SAME_TIME, "s"),
    ]


def _asked_times(task: ContourTask, reference: Contour) -> tuple[Contour, float]:
    """Return the nodes that are asked for and the time (s) between them."""
    asked = task.sample(reference)
    return asked, node_interval(asked, task.speed if asked.time is None else None)


def _postures(
    job: Job, cut: ReadCut, chosen: Language, settings: Settings, left: Array
) -> list[Check]:
    """Count targets whose words of posture and turns are not those of the joints there.

    Joints are `left` (K, n) rad to digits: where they are that near to where a word changes, both
    words are right.
    """
    moves, q = (*cut.moves, cut.group.path[-1]), np.vstack([cut.q, cut.q_out])
    left = np.vstack([left, left[-1:]])
    told = [k for k in (*cut.ends.tolist(), len(cut.moves)) if moves[k].posture]
    if not told or chosen.posture is None:
        return []
    ways = [q[told] + sign * left[told] for sign in (0, -1, 1)]
    expected = zip(*(chosen.posture(job.robot, way, settings) for way in ways), strict=True)
    wrong = [
        k
        for k, words in zip(told, expected, strict=True)
        if len(moves[k].posture) != len(words[0])
        or any(said not in right for said, *right in zip(moves[k].posture, *words, strict=True))
    ]
    said = "targets whose posture or turn is not the motion's"
    return [_check("posture", said, len(wrong), 0, "count", wrong[0] if wrong else 0)]


def _air(job: Job, cuts: Sequence[ReadCut], home: Array, cell: Cell | None) -> list[Check]:
    """Check the joint moves to, between and after the cuts; the node is the number of the way."""
    starts: list[Array | None] = [None, *(cut.q_out for cut in cuts)]
    corners = [cut.approach for cut in cuts] + [home]
    ways = (
        way if start is None else np.vstack([start[None], way])
        for start, way in zip(starts, corners, strict=True)
    )
    return worst_of(_way_checks(job, way[~np.isnan(way).any(axis=1)], cell) for way in ways)


def _way_checks(job: Job, q: Array, cell: Cell | None) -> list[Check]:
    """Check straight joint motions between corners (m, n) rad in the least time that they need."""
    if len(q) < 2:
        return []
    took = np.maximum(least_time(np.diff(q, axis=0), *job.robot.speed_limits()), 1e-9)
    time = np.append(0.0, np.cumsum(took))
    checked = air_checks(job.robot, q, time, cell=cell)
    return [check for check in checked if check.code != "air-time"]
