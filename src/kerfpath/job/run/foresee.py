"""Find what is known before planning: faults of a job, each with its key, and warnings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, Bools, Ints, short_repr, spread
from kerfpath.cad import Part, Triangles
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.graph import LayeredGraph
from kerfpath.job.format import (
    CutRequest,
    Job,
    PreparedJob,
    all_of,
    cell_of_job,
    chord_error,
    closer_nodes,
    places_of,
    refusal_at,
)
from kerfpath.job.run.remedy import move_into_reach
from kerfpath.names import listed
from kerfpath.planner import folds
from kerfpath.plans import has_room
from kerfpath.post import issues_before_planning
from kerfpath.sequence import best_order, distances_between
from kerfpath.tolerances import SAME_PLACE

# -----------------------------------------------------------------------------
# Warn of contours that are cut through the part itself, from below, or from both sides.

CLEAR, BESIDE = 2e-3, 1e-3
"""m: the beam is looked at from this distance before the tip on, in the middle and this far beside
it to all sides, so that walls along which it passes are not in its way."""
MOST_NODES = 200
"""Most nodes of a contour that are looked at."""
FROM_BELOW = 0.5
"""Least rise of the mean tool axis, a sine, at which a contour is cut from below."""
OPPOSITE, ALIKE = -0.9, 0.05
"""Largest product of the mean axes of loops that face each other, and the share of their lengths by
which these differ at most, and by which one lies beside the other."""
MOST_LISTED = 3
"""Most contours that a warning names."""


def sides_in_doubt(
    job: Job, contours: Iterable[tuple[str, Contour]], mesh: tuple[Array, Ints]
) -> list[str]:
    """Return a warning for contours whose beam passes the part first, and for a part turned over.

    Parameters
    ----------
    job : Job
    contours : iterable of (str, Contour)
        Name and nodes of each contour, in the part.
    mesh : (V, 3) m and (F, 3)
        Vertices and triangles of the part; none for a drawing of lines.
    """
    vertices, faces = mesh
    corners = vertices[faces] * 1e3
    part = Triangles(corners, np.zeros(len(faces), np.int64)) if len(faces) else None
    through, below = dict[str, float](), list[str]()
    for name, nodes in contours:
        if part is not None and np.isfinite(distance := _before_the_tip(part, nodes)):
            through[name] = distance
        if (job.placement[:3, :3] @ nodes.axes.mean(axis=0))[2] > FROM_BELOW:
            below.append(name)
    said = [
        f"{name}: the beam passes the part itself {distance * 1e3:.0f} mm before the tip, so the "
        "head would stand inside or behind it; pick the loop on the outer side of the sheet, or "
        "set outer_towards in [part]"
        for name, distance in through.items()
    ]
    turned = any(axis.carries == "part" and axis.kind == "rotary" for axis in job.robot.externals)
    if below and not turned:
        said.append(
            f"{listed(below, MOST_LISTED)}: the beam comes from below, in the robot base, through "
            "whatever the part lies on; turn the part over (rpy_deg in [part]), or pick loops of "
            "its other side"
        )
    return said


def both_sides(part: Part, picked: Sequence[str]) -> list[str]:
    """Return a warning if loops on both sides of a sheet are picked that are the same cut.

    They face each other: opposite axes, nearly the same length, one behind the other.

    Parameters
    ----------
    part : Part
    picked : sequence of str
        Names of the loops.
    """
    loops = [part.loop(name) for name in picked]
    one, other = ([each for each in loops if each.side == s] for s in ("outer", "inner"))
    if not (one and other):
        return []
    axes = {each.name: part.contour(each.name).axes.mean(axis=0) for each in (*one, *other)}
    twice = list[tuple[str, str]]()
    for a in other:
        for b in one:
            away = (b.bounding_box - a.bounding_box).mean(axis=0)
            aside = np.linalg.norm(np.cross(away, axes[a.name]))
            is_behind = axes[a.name] @ axes[b.name] < OPPOSITE and aside < ALIKE * a.length
            if is_behind and abs(a.length - b.length) < ALIKE * b.length:
                twice.append((a.name, b.name))
                break
    if not twice:
        return []
    which = listed([" and ".join(each) for each in twice], MOST_LISTED)
    return [
        f"{which}: the job cuts through the sheet from both sides, twice at the same place; pick "
        'the loops of one side, with side = "outer" in [contour.pick_all] or by their names'
    ]


def _before_the_tip(part: Triangles, nodes: Contour) -> float:
    """Return how far before the tip the beam meets the part, m, at the nearest; inf if nowhere."""
    some = spread(len(nodes), min(len(nodes), MOST_NODES))
    axes = nodes.axes[some]
    across = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    along = np.cross(axes, across)
    met = np.zeros(len(some))
    for side in (0 * across, across, -across, along, -along):
        origins = nodes.points[some] - CLEAR * axes + BESIDE * side
        body = np.zeros(len(some), np.int64)
        met = np.maximum(met, part.first(origins * 1e3, -axes, body)[0])
    return float(met.min()) * 1e-3 + CLEAR


# -----------------------------------------------------------------------------
# Check a job without planning it: its cell, and the poses at the start of its contours.

PLACES = 25
"""Most nodes of a contour at which poses are looked for."""
CAUSES = 3
"""Most causes that a warning names."""
KEY = re.compile(r"(?P<key>\w+) in \[(?P<table>program[\w.]*)\]")
"""A key of the program in the words of a fault, and its table."""
FAR = 0.05
"""Distance in m beyond the near-miss distance up to which clearances are measured."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourStart:
    """The poses at the start of a contour.

    Parameters
    ----------
    name : str
    nodes : int
    poses : int
        Admissible poses at its first node.
    clear : int
        Poses among them that keep every near-miss distance.
    clearance : float m
        Least distance of the best pose, over the pairs that must keep the near-miss distance of
        the cell, up to 50 mm more than that; NaN without poses.
    pair : (str, str) or None
        The two bodies at this distance.
    """

    name: str
    nodes: int
    poses: int
    clear: int
    clearance: float
    pair: tuple[str, str] | None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JobPreview:
    """A job with its part, its cell if it has one, the start of every contour, and warnings."""

    job: Job
    part: Part
    cell: Cell | None
    starts: tuple[ContourStart, ...]
    warnings: tuple[str, ...] = ()

    __repr__ = short_repr


def check_job(job: Job, part: Part | None = None) -> JobPreview:
    """Return the cell of a job and the start of its contours; `part` if it is read already.

    Raises
    ------
    InputError
        As `run_job`.
    """
    part = part or job.read_part()
    cell = cell_of_job(job, part)
    plain = replace(job.options, comfort=None, retract=None, floor=None)
    starts, contours, asked, far = [], [], [], list[str]()
    tasks = job.tasks(part)
    for task in tasks:
        nodes = task.sample(task.candidates(part)[0])
        contours.append((task.name, nodes))
        asked.append((nodes, task.asked(job.options)))
        some = spread(len(nodes), PLACES)
        graph = job.graph(nodes, plain, only=some, external=places_of(job, nodes))
        q = graph.q[: graph.start[1]]
        starts.append(_start(task.name, len(nodes), q, cell))
        if not job.robot.free.size:  # external axes stand only at a few places here
            far += _out_of_reach(job, task.name, nodes.points[some], graph)
    if far and (move := move_into_reach(job, asked)):
        far.append(str(move))
    twice = both_sides(part, [task.pick for task in tasks])
    doubts = (*far, *twice, *sides_in_doubt(job, contours, part.mesh()))
    return JobPreview(job=job, part=part, cell=cell, starts=tuple(starts), warnings=doubts)


def _out_of_reach(job: Job, name: str, points: Array, graph: LayeredGraph) -> Iterator[str]:
    """Yield a warning if no pose reaches some of the points (M, 3) m, one per layer of a graph."""
    shut = np.flatnonzero(np.diff(graph.start) == 0)
    if not shut.size:
        return
    codes, counts = np.unique(graph.reason[shut[0]], return_counts=True)
    order = np.argsort(-counts)[:CAUSES]
    why = ", ".join(
        f"{counts[i] / counts.sum():.0%} {graph.reasons[codes[i]]}" for i in order.tolist()
    )
    place = (points[shut[0]] @ job.placement[:3, :3].T + job.placement[:3, 3]) * 1e3
    yield (
        f"{name}: the robot has no pose at {shut.size} of {len(points)} places that were looked "
        f"at, the first at {' '.join(f'{v:.0f}' for v in place)} mm in the robot base (of all "
        f"rotations and postures {why}); move or turn the part ([part]), with `kerfpath layout "
        f"{job.path.name}`, or list robots that can with `kerfpath layout {job.path.name} --robots`"
    )


def _start(name: str, nodes: int, q: np.ndarray, cell: Cell | None) -> ContourStart:
    clear, clearance, pair = len(q), np.nan, None
    if cell is not None and len(q) and len(cell.pairs):
        apart = cell.distances(q, enough=cell.required + FAR)
        clear = int((apart > cell.required).all(axis=1).sum())
        common = np.flatnonzero(~cell.own)
        if common.size:
            apart = np.minimum(apart[:, common], cell.near_miss + FAR)
            best = int(np.argmax(apart.min(axis=1)))
            nearest = int(np.argmin(apart[best]))
            clearance, pair = float(apart[best, nearest]), cell.pair_names[common[nearest]]
    return ContourStart(
        name=name, nodes=nodes, poses=len(q), clear=clear, clearance=clearance, pair=pair
    )


# -----------------------------------------------------------------------------
# Find the faults of a job that are known before planning, each with its key.

HALVINGS = 7
"""Bisections of a length to find one that would do."""
FINE = np.radians(1.0)
"""Largest step of gamma, rad, for the poses of both ends, even if that of the job is coarser."""
SECONDS = 2.0
"""Time limit, s, for finding that no order of the contours is possible."""


def require_foreseen(prepared: PreparedJob) -> None:
    """Require that a job has no fault that is known before planning.

    Raises
    ------
    InputError
        Every fault that is known before planning, each in a line.
    """
    if found := foresee(prepared):
        raise all_of(found)


def foresee(prepared: PreparedJob) -> list[InputError]:
    """Return the faults of a job that are known before it is planned, each with its key."""
    return [
        *_program_faults(prepared),
        *_floor_faults(prepared),
        *(fault for request in prepared.contours for fault in _sampling_faults(prepared, request)),
        *_order_faults(prepared),
        *(fault for request in prepared.contours for fault in _retract_faults(prepared, request)),
    ]


def _program_faults(prepared: PreparedJob) -> Iterator[InputError]:
    """Yield the names, numbers and outputs that the language of the program refuses."""
    job, p = prepared.job, prepared.job.program
    if p.language == "none":
        return
    said = set()
    cuts = [(request.task.name, request.task.speed) for request in prepared.contours]
    for issue in issues_before_planning(cuts, job.robot, p):
        words = issue.message
        if issue.code.startswith("name-") and issue.place == "a contour":
            words += " by name in [[contour]]"
        elif issue.code.startswith("name-") and issue.place == "the program":
            words += " by name in [program]"
        if words not in said:
            said.add(words)
            key = KEY.search(words)
            where = ("program",) if key is None else (*key["table"].split("."), key["key"])
            yield refusal_at(job.path, where, words)


def _floor_faults(prepared: PreparedJob) -> Iterator[InputError]:
    """Yield a fault if contours reach below the floor; it names the lowest."""
    job, floor = prepared.job, prepared.job.options.floor
    if floor is None:
        return
    up, rise = job.placement[2, :3], job.placement[2, 3]
    lowest = [
        min(float((each.nodes.points @ up).min()) for each in request.candidates) + rise
        for request in prepared.contours
    ]
    worst, below = int(np.argmin(lowest)), sum(z < floor - SAME_PLACE for z in lowest)
    if below:
        yield refusal_at(
            job.path,
            ("part", "xyz_mm"),
            f"contour {prepared.names[worst]!r} reaches {(floor - lowest[worst]) * 1e3:.4g} mm "
            f"below the floor, which is at z = {floor * 1e3:g} mm of the robot base ({below} of "
            f"{len(lowest)} contours reach below it); write floor_mm in [robot] if the floor is "
            "lower, or floor = false if there is none",
        )


def _sampling_faults(prepared: PreparedJob, request: CutRequest) -> Iterator[InputError]:
    """Yield a fault if chords between the nodes leave the path by more than the audit allows."""
    job, task = prepared.job, request.task
    if job.options.refine_parts > 1:
        return
    allowed = job.tolerances.path
    off = max(chord_error(each.path, each.nodes) for each in request.candidates)
    if off <= allowed:
        return
    key = task.sampled_by
    finer = closer_nodes(task, [each.path for each in request.candidates], job.tolerances)
    cure = "sample it more finely"
    if finer is not None:
        cure = f"write {key} = {getattr(finer.table, key):.4g}"
    yield refusal_at(
        job.path,
        ("contour", _table_of(job, request), key),
        f"contour {task.name!r}: chords between its nodes leave the path by {off * 1e3:.3g} mm, "
        f"but path_tolerance_mm in [audit] allows {allowed * 1e3:g} mm; {cure}, or raise "
        "path_tolerance_mm",
    )


def _table_of(job: Job, request: CutRequest) -> int:
    """Return the number of a request's [[contour]] table in the job."""
    tables = [spec.table for spec in job.contours]
    return next((i for i, table in enumerate(tables) if table is request.task.table), 0)


def _order_faults(prepared: PreparedJob) -> Iterator[InputError]:
    """Yield a fault if no order keeps the heat spacing; it has the largest that one keeps."""
    job, sequence = prepared.job, prepared.job.sequence
    if sequence is None or not sequence.heat_spacing_mm or job.options.interruptions != "none":
        return
    if sequence.heat_time_s:
        return  # how long the cuts between take is not known yet
    between = distances_between([request.candidates[0].nodes for request in prepared.contours])
    spacing = sequence.heat_spacing_mm / 1000
    if _has_order(prepared, between < spacing):
        return
    apart = np.unique(between[between < spacing])
    low, high = 0, len(apart)  # bisect the distance up to which an order exists
    while high - low > 1:
        middle = (low + high) // 2
        possible = _has_order(prepared, between < apart[middle])
        low, high = (middle, high) if possible else (low, middle)
    most = apart[low] if _has_order(prepared, between < apart[low]) else 0.0
    order = "the given order has" if sequence.order == "given" else "every order has"
    yield refusal_at(
        job.path,
        ("sequence", "heat_spacing_mm"),
        f"expected contours that follow each other to be {spacing * 1e3:g} mm apart, but {order} "
        f"nearer ones; write at most heat_spacing_mm = {np.floor(most * 1e4) / 10:g}"
        + (', or order = "best"' if sequence.order == "given" else ""),
    )


def _has_order(prepared: PreparedJob, near: Bools) -> bool:
    """Return whether an order exists in which no contour follows one that is near it, (G, G)."""
    count = len(near)
    assert prepared.job.sequence is not None
    if prepared.job.sequence.order == "given":
        return not any(near[i, i + 1] for i in range(count - 1))
    between = np.where(near, np.inf, 0.0)
    try:
        best_order(
            np.arange(count), np.zeros(count), between,
            before=prepared.inner_first, seconds=SECONDS,
        )  # fmt: skip
    except NoFeasiblePath as none:
        return not none.proved
    return True


def _retract_faults(prepared: PreparedJob, request: CutRequest) -> Iterator[InputError]:
    """Yield a fault if no pose at an end of a contour leaves room for the retract."""
    job, asked = prepared.job, prepared.job.options.retract
    if asked is None:
        return
    ends = [_end_poses(job, each.nodes) for each in request.candidates]
    shut = [[len(q) and not _room(job, q, mu, asked).any() for q, mu in both] for both in ends]
    if not all(any(both) for both in shut):
        return
    end = int(np.argmax(shut[0]))
    low, high = 0.0, asked
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if _room(job, *ends[0][end], middle).any() else (low, middle)
    cure = f"write at most retract_mm = {np.floor(low * 1e4) / 10:g}" if low else "move the part"
    yield refusal_at(
        job.path,
        ("program", "retract_mm"),
        f"contour {request.task.name!r}: at its {('start', 'end')[end]} the tool cannot back off "
        f"by {asked * 1e3:g} mm from any pose within the joint limits; {cure}",
    )


def _end_poses(job: Job, nodes: Contour) -> list[tuple[Array, Ints]]:
    """Return the admissible joints (B, n) rad of both ends, and their postures (B,)."""
    ends = np.array([0, len(nodes) - 1])
    fine = min(job.options.gamma_step, FINE)
    options = replace(job.options, retract=None, gamma_step=fine)
    graph = job.graph(nodes, options, only=ends, external=places_of(job, nodes), folded_at=0.0)
    cut = graph.start[1]
    posture = graph.posture.astype(np.int64)
    return [(graph.q[:cut], posture[:cut]), (graph.q[cut:], posture[cut:])]


def _room(job: Job, q: Array, posture: Ints, retract: float) -> Bools:
    options = replace(job.options, retract=retract)
    # A folded joint has room on one of its turns.
    robot = job.robot.folded(folds(job.robot, job.options, 0.0))
    return has_room(options, robot, q, posture, job.tool)
