"""Messages about the job, its plans, contours without one, distances in the cell, and the part."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from kerfpath.arrays import Array, spread
from kerfpath.auditor import Check
from kerfpath.cad import Loop, Part
from kerfpath.cell import Cell
from kerfpath.comfort import MEASURES
from kerfpath.errors import InputError
from kerfpath.job import (
    CutResult,
    Job,
    JobFile,
)
from kerfpath.plans import Plan
from kerfpath.studio.document import Document
from kerfpath.studio.messages import (
    CheckEntry,
    ClearanceMessage,
    ContourName,
    CriteriaEntry,
    EditEntry,
    ExecutedEntry,
    FaceEntry,
    Fault,
    JobMessage,
    LoopEntry,
    LossEntry,
    NearestEntry,
    NoPathMessage,
    PartMessage,
    PlanMessage,
    Relaxation,
    flat,
    flat_or_none,
)
from kerfpath.studio.work import Stop
from kerfpath.study.placing import Placement, changes_of

EXECUTED = 1500
"""Number of points of an executed path; more are not seen."""

# -----------------------------------------------------------------------------
# The messages about a plan, and about the reason why there is none.


def plan_message(
    cut: CutResult,
    made: Plan,
    *,
    revision: int,
    graph: str,
    pieces: int,
    settled: bool,
    audited: bool,
    seconds: float,
) -> PlanMessage:
    """Return the message about the motion of a cut.

    Parameters
    ----------
    cut : CutResult
    made : Plan
        Plan of the cut.
    revision : int
        Revision of the job that it was planned for.
    graph : str
        Id of its map.
    pieces : int
        Number of plans of its contour.
    settled : bool
        False while its bound is still to be computed.
    audited : bool
        Whether the audit of the cut is complete.
    seconds : float
        Time that the search took, s.
    """
    velocity, acceleration = made.velocity_share, made.acceleration_share
    s, proof = made.contour.s, made.proof
    first = float(cut.request.candidates[0].nodes.s[0])
    return PlanMessage(
        revision=revision,
        contour=cut.contour,
        name=made.name,
        pieces=pieces,
        graph=graph,
        s=flat(s - first),
        time=flat(made.time),
        q=flat(made.unwrapped),
        gamma=flat(made.gamma),
        posture=made.posture.tolist(),
        points=flat(made.points),
        kind=list(made.contour.kinds),
        speed=flat(np.diff(s) / np.diff(made.time)),
        cost=made.cost,
        bound=proof.bound,
        gap=proof.gap,
        settled=settled,
        optimal=proof.optimal,
        statement=proof.statement,
        method=made.settings.method,
        weights=flat(np.asarray(made.settings.weights)),
        previous_cost=None,
        criteria=_criteria(made),
        velocity_share=flat(velocity, 6),
        acceleration_share=flat(acceleration, 6),
        joint_load=flat(_load(velocity, acceleration), 6),
        checks=check_entries((*cut.checks, *cut.as_run.checks)) if audited else None,
        passed=cut.passed if audited else None,
        executed=_executed(cut, made) if audited else None,
        feed=None if made.feed is None else str(made.feed),
        seconds=seconds,
    )


def _executed(cut: CutResult, made: Plan) -> ExecutedEntry | None:
    """Return the executed tip of a cut with its plan; None if it is not known."""
    off = cut.as_run.path_error
    if off is None:
        return None
    some = spread(len(off.s), EXECUTED)
    rotation, origin = made.T_base_part[:3, :3], made.T_base_part[:3, 3]
    drawn, tip = cut.candidate.path.at(off.s[some])[0], off.T[some, :3, 3]
    return ExecutedEntry(
        drawn=flat(drawn @ rotation.T + origin, 7),
        tip=flat(tip @ rotation.T + origin, 7),
        largest=off.largest,
        joints=off.response.words,
    )


def _load(velocity: Array, acceleration: Array) -> Array:
    """Return the largest share of any joint's limits at each node, (K,).

    Parameters
    ----------
    velocity : (K-1, n)
        Shares between nodes; a node takes the larger one of its two intervals.
    acceleration : (K-2, n)
        Shares at the inner nodes.
    """
    between = np.abs(velocity).max(axis=1)
    load = np.maximum(np.append(between, 0.0), np.append(0.0, between))
    load[1:-1] = np.maximum(load[1:-1], np.abs(acceleration).max(axis=1, initial=0.0))
    return np.asarray(load)


def _criteria(made: Plan) -> CriteriaEntry:
    found = made.criteria
    return CriteriaEntry(
        displacement=flat(found.displacement),
        largest_increment=flat(found.largest_increment),
        range=flat(found.range),
        peak_velocity=flat(found.peak_velocity),
        peak_acceleration=flat(found.peak_acceleration),
        nearest=[
            NearestEntry(name=name, value=value, unit=MEASURES[name].unit, node=node)
            for name, (value, node) in found.nearest.items()
        ],
    )


def check_entries(checks: Sequence[Check]) -> list[CheckEntry]:
    """Return the entries of an audit's checks."""
    return [
        CheckEntry(
            code=check.code,
            title=check.title,
            value=check.value if np.isfinite(check.value) else None,
            limit=check.limit if np.isfinite(check.limit) else None,
            unit=check.unit,
            level=check.level,
            ok=check.ok,
            node=check.node,
        )
        for check in checks
    ]


def no_path_message(
    cut: CutResult,
    placement: Array,
    *,
    revision: int,
    graph: str,
    relaxations: list[Relaxation] | None,
) -> NoPathMessage:
    """Return the message about the reason why a cut has no plan.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan.
    placement : (4, 4) m
        T_base_part.
    revision : int
        Revision of the job.
    graph : str
        Id of its map.
    relaxations : list of Relaxation or None
        Changes that would make a path; None while they are being searched for.
    """
    broken, nodes = cut.broken, cut.candidate.nodes
    assert broken is not None
    at = min(max(broken.node, 0), len(nodes) - 1)
    return NoPathMessage(
        revision=revision,
        contour=cut.contour,
        node=broken.node,
        back=broken.back,
        s=float(nodes.s[at] - nodes.s[0]),
        point=flat(placement[:3, :3] @ nodes.points[at] + placement[:3, 3]),
        statement=str(broken),
        scope=broken.scope,
        reasons=[LossEntry(name=str(why), count=count) for why, count in broken.counts.items()],
        graph=graph,
        relaxations=relaxations,
        remedy=cut.remedy,
    )


# -----------------------------------------------------------------------------
# Changes that may make a path where there is none, as edits of the job.


def alternatives(cut: CutResult, index: int, placement: Placement) -> list[Relaxation]:
    """Return possible changes for a cut without a plan, first those that gave one.

    Parameters
    ----------
    cut : CutResult
        A cut without a plan, with its advice.
    index : int
        Index of its [[contour]] table in the job.
    placement : Placement
        That of the part, with which fixtures may move.
    """
    found, advice = list[Relaxation](), cut.advice
    if advice is not None and advice.move is not None:
        by = dict(zip(("x_mm", "y_mm", "z_mm"), (advice.move.by * 1e3).tolist(), strict=True))
        changes = changes_of(placement.job, placement.numbers(by))
        edits = [EditEntry(path=list(path), value=value) for path, value in changes]
        return [Relaxation(label=f"move the part {advice.move.words}", edits=edits)]
    if advice is not None:
        if advice.without_windows:
            pins = EditEntry(path=["contour", index, "gamma_windows"], value=None)
            found.append(Relaxation(label="remove the pinned windows of gamma", edits=[pins]))
        if advice.other_method:
            found.append(_plan('search the grid exactly: method = "exact"', "method", "exact"))
        for speed in (advice.refined, advice.speed):
            if speed is not None:
                found.append(
                    Relaxation(
                        label=f"cut slower: {speed} m/min instead of "
                        f"{cut.request.task.speed * 60:g} m/min",
                        edits=[
                            EditEntry(path=["contour", index, "speed_m_min"], value=float(speed))
                        ],
                    )
                )
        for key, value in advice.shares.items():
            which = "velocity" if key == "eta_velocity" else "acceleration"
            words = f"use more of the {which} limits: {key} = {value}"
            found.append(_plan(words, key, float(value)))
    return found + _untried(cut)


def _untried(cut: CutResult) -> list[Relaxation]:
    """Return changes that have not been tried and that the other options allow."""
    found, options = list[Relaxation](), cut.request.options
    # A node without poses has none in a slower motion, either.
    plain = options.closure == "free" and options.rotation is None and options.objective == "sum"
    plain = plain and not cut.lacks_poses
    grid = options.method in ("continuous", "exact")
    if plain and grid and options.feed == "constant" and options.interruptions == "none":
        found.append(_plan('not tried: slow down where needed: feed = "dip"', "feed", "dip"))
        words = 'not tried: cut in the fewest pieces: interruptions = "fewest"'
        found.append(_plan(words, "interruptions", "fewest"))
    if options.postures is not None:
        found.append(_plan("not tried: allow every posture", "posture", None))
    return found


def _plan(label: str, key: str, value: object) -> Relaxation:
    return Relaxation(label=label, edits=[EditEntry(path=["plan", key], value=value)])


# -----------------------------------------------------------------------------
# The message about the job: its text, values with defaults, and errors.

_PLACE = re.compile(r"^.*?\.toml:(?:(\d+):)? ?(?:([a-z_][\w.]*): )?(.*)$", re.DOTALL)
"""File, line, key and text of an error message about a job."""
_TABLE = re.compile(r"^[ \t]*\[\[[ \t]*contour[ \t]*\]\]")


def job_message(
    document: Document,
    job: Job | None,
    contours: list[ContourName],
    faults: list[Fault],
    *,
    interval: float,
) -> JobMessage:
    """Return the message about the current job.

    Parameters
    ----------
    document : Document
    job : Job or None
        The job that the text describes; None if the text is not valid.
    contours : list of ContourName
        The contours that are cut.
    faults : list of Fault
    interval : float s
        Interval of the nodes of the first contour; the default weights depend on it.
    """
    weights = None
    if job is not None:
        weights = 1 / (job.robot.speed_limits()[0] * interval)
    return JobMessage(
        revision=document.revision,
        name=document.path.name,
        text=document.text,
        values=None if job is None else job_file(job).model_dump(mode="json"),
        given=[] if job is None else list(_given(job.source)),
        contours=contours,
        undo=document.can_undo,
        redo=document.can_redo,
        saved=document.saved,
        faults=faults,
        weights=[] if weights is None else flat(weights),
    )


def faults_of(error: InputError, text: str) -> list[Fault]:
    """Return the errors of a job once each, with line and key that the message names, if any."""
    lines = text.split("\n")
    return [_fault(said, lines) for said in dict.fromkeys((error.message, *error.others))]


def _fault(said: str, lines: list[str]) -> Fault:
    found = _PLACE.match(said)
    if found is None:
        return Fault(key=[], line=None, message=said)
    line, key, words = found.groups()
    way: list[str | int] = [] if key is None else list(key.split("."))
    if line is not None and way[:1] == ["contour"]:
        number = sum(map(bool, map(_TABLE.match, lines[: int(line)]))) - 1
        way[1:1] = [max(number, 0)]
    return Fault(key=way, line=None if line is None else int(line), message=words)


def job_file(job: Job) -> JobFile:
    """Return the tables of a job, with all defaults."""
    return JobFile.model_validate(dict(job.source), context={"folder": job.path.parent})


def _given(value: object, way: str = "") -> Iterator[str]:
    """Yield the dotted keys of a job, each table before its entries."""
    if way:
        yield way
    entries = list[tuple[object, object]]()
    if isinstance(value, Mapping):
        entries = list(value.items())
    elif isinstance(value, list) and all(isinstance(one, Mapping) for one in value):
        entries = list(enumerate(value))
    for name, inner in entries:
        yield from _given(inner, f"{way}.{name}" if way else str(name))


# -----------------------------------------------------------------------------
# The distances of bodies in the cell along each plan, computed once it is found.

AT_ONCE = 32
"""Number of nodes that are measured between two checks for a stop."""


def clearance_message(
    cell: Cell, cut: CutResult, revision: int, stop: Stop
) -> ClearanceMessage | None:
    """Return the nearest pair of bodies at each node of a planned cut, and its distance.

    Only pairs with the near-miss distance of the cell count. Pairs with a distance of their own,
    such as the nozzle and the part or neighbours in the arm, are left out: they are always near,
    and the plan keeps their distance. Return None if there is no other pair.

    Raises
    ------
    Superseded
        Something else has been requested meanwhile.
    """
    assert cut.plan is not None
    q, general = cut.plan.unwrapped, ~cell.own
    if not general.any():
        return None
    distance, pair = np.empty(len(q)), np.empty(len(q), dtype=np.int64)
    for begin in range(0, len(q), AT_ONCE):
        stop.check()
        part = slice(begin, begin + AT_ONCE)
        wanted = np.broadcast_to(general, (len(q[part]), len(general)))
        found = cell.distances(q[part], wanted=wanted)
        pair[part] = np.nanargmin(found, axis=1)
        distance[part] = np.nanmin(found, axis=1)
    used, index = np.unique(pair, return_inverse=True)
    return ClearanceMessage(
        revision=revision,
        contour=cut.contour,
        name=cut.plan.name,
        distance=flat_or_none(distance),
        over=flat_or_none(distance - cell.required[pair]),
        pair=index.tolist(),
        pairs=[list(cell.pair_names[k]) for k in used.tolist()],
    )


# -----------------------------------------------------------------------------
# The message about the part: its loops, cut or not, and the face of each of its triangles.

MOST_LOOPS = 3000
"""Number of loops that a page gets, the longest ones: more could not be distinguished."""
FINEST = 2e-5
"""Least chord error of a drawn loop, m: smaller errors are not visible."""
SHARE = 2e-3
"""Chord error as a share of the length of the loop, so that small holes look round."""
COARSEST = 2e-4
"""Largest chord error of a drawn loop, m."""


def part_message(job: Job, part: Part, revision: int) -> PartMessage:
    """Return the pickable loops of a part, in the robot base, and the faces of its mesh.

    As in `Part.pick`, loops of the pieces of a skin and loops around the thickness of a sheet are
    left out.
    """
    asked = [loop for loop in part.loops if loop.is_main]
    told = sorted(asked, key=lambda loop: -loop.length)[:MOST_LOOPS]
    kept = {loop.name for loop in told}
    return PartMessage(
        revision=revision,
        T=flat(job.placement, 15),
        loops=[_entry(loop, job) for loop in asked if loop.name in kept],
        faces=[FaceEntry(name=name, triangles=count) for name, count in part.mesh_faces()],
        left_out=len(part.loops) - len(told),
    )


def _entry(loop: Loop, job: Job) -> LoopEntry:
    off = float(np.clip(SHARE * loop.length, FINEST, COARSEST))
    points = loop.line(off) @ job.placement[:3, :3].T + job.placement[:3, 3]
    return LoopEntry(
        name=loop.name,
        face=loop.face,
        kind=loop.kind,
        side=loop.side,
        closed=loop.closed,
        length=loop.length,
        diameter=loop.diameter,
        gap=loop.largest_gap,
        points=flat(points, 6),
    )
