"""Prepare a job: read its drawing and cell, and list the ways to cut each contour."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.arrays import Array, Ints, short_repr
from kerfpath.auditor import Check
from kerfpath.cad import Part
from kerfpath.cad import read as read_drawing
from kerfpath.cell import (
    MAY_TOUCH,
    Cell,
    CuttingHead,
    Mesh,
    MeshHead,
    Shape,
    allowed_pairs,
    box,
    cell_of,
    edges_of,
    link_capsules,
    read_stl,
    thicken,
    weld,
)
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.front import Subproblem
from kerfpath.job.format.contour import ContourSpec
from kerfpath.job.format.reading import Job, all_of, refusal_at
from kerfpath.job.format.tables import CellTable, FixtureTable, given
from kerfpath.job.format.tolerances import Tolerances
from kerfpath.job.format.values import pose
from kerfpath.operations import edge, nearest
from kerfpath.options import PlanOptions
from kerfpath.planner import node_interval
from kerfpath.sequence import inner_first
from kerfpath.tolerances import SAME_PLACE
from kerfpath.urdf import read_srdf

# -----------------------------------------------------------------------------
# Build the cell of a job from its [cell] table and its part.

SIZES = (
    "nozzle_length_mm", "nozzle_radii_mm", "body_length_mm", "body_radius_mm", "arm_radius_mm",
)  # fmt: skip
"""Keys of [cell.head] that are arguments of `CuttingHead` without their unit."""


def cell_of_job(job: Job, part: Part) -> Cell | None:
    """Return the cell that a job describes; None without [cell]: collisions are not checked then.

    Raises
    ------
    InputError
        With its line in the job file: a file without a closed solid, a pair with an unknown body,
        a part drawn as a surface without a thickness, or a robot with unknown links.
    """
    table = job.cell
    if table is None:
        return None
    fixtures: dict[str, Shape] = {}
    axes = [axis.name for axis in job.robot.externals]
    on = {fixture.name: fixture.on for fixture in table.fixture if fixture.on is not None}
    for i, fixture in enumerate(table.fixture):
        if fixture.on is not None and fixture.on not in axes:
            raise refusal_at(
                job.path,
                ("cell", "fixture", i, "on"),
                f'expected the name of a [[robot.external]] table, got "{fixture.on}"; there are '
                f"{', '.join(axes) or 'none'}",
            )
        with _at(job, "cell", "fixture", i):
            fixtures[fixture.name] = _shape(fixture, job.path.parent, table.deviation_mm / 1000)
    solid = _solid(job, table, part) if table.part else None
    with _at(job, "cell", "head"):
        head = _head(table, job.path.parent)
    with _at(job, "cell"):
        bare = cell_of(
            job.robot,
            tool=job.tool,
            head=head,
            part=solid,
            placement=job.placement,
            fixtures=fixtures,
            on=on,
            links=link_capsules(job.robot) if table.links == "capsules" else None,
            near_miss=table.near_miss_mm / 1000,
            floor=None if "floor" in fixtures else job.options.floor,
        )
    for i, pair in enumerate(table.pair):
        _require_known(job, bare, pair.between, ("cell", "pair", i, "between"))
    for i, names in enumerate(table.may_touch):
        _require_known(job, bare, names, ("cell", "may_touch", i))
    own = {_two(p.between): p.near_miss_mm / 1000 for p in table.pair if p.near_miss_mm is not None}
    touching = _described_as_touching(job, {frozenset(pair) for pair in own})
    touching |= {_two(names): MAY_TOUCH for names in table.may_touch}
    touching |= {_two(p.between): p.allowed for p in table.pair if p.allowed is not None}
    with _at(job, "cell"):
        return replace(bare, near_miss_of={**bare.near_miss_of, **own}, may_touch=touching)


def with_map(job: Job) -> Job:
    """Return the job with its collision map switched on.

    Raises
    ------
    InputError
        The job has no [cell].
    """
    if job.cell is None:
        raise refusal_at(
            job.path, ("cell",), "expected a [cell] for the collision map, got none; add one"
        )
    return replace(job, cell=job.cell.model_copy(update={"map": True}))


def _described_as_touching(
    job: Job, judged: Container[frozenset[str]]
) -> dict[tuple[str, str], str]:
    """Return the pairs that the SRDF of the robot disables, except those with a rule in the job."""
    robot = job.source["robot"]
    if "srdf" not in robot:
        return {}
    assert job.cell is not None
    if job.cell.links == "capsules":
        raise refusal_at(
            job.path,
            ("cell", "links"),
            'expected links = "description" with srdf in [robot], got "capsules"; change links, '
            "or remove srdf",
        )
    folder = job.path.parent
    with _at(job, "robot", "srdf"):
        pairs = allowed_pairs(job.robot, read_srdf(folder / robot["srdf"], folder / robot["urdf"]))
    return {pair: why for pair, why in pairs.items() if frozenset(pair) not in judged}


@contextmanager
def _at(job: Job, *where: str | int) -> Iterator[None]:
    """Add the place in the job file to errors about a part of the cell."""
    try:
        yield
    except InputError as error:
        said = str(error)
        raise (
            error if said.startswith(f"{job.path}:") else refusal_at(job.path, where, said)
        ) from None


def _require_known(
    job: Job, cell: Cell, names: tuple[str, ...], where: tuple[str | int, ...]
) -> None:
    for name in names:
        if name not in cell.names:
            raise refusal_at(
                job.path,
                where,
                f'expected names of bodies of the cell, got "{name}"; there are '
                f"{', '.join(cell.names)}",
            )
    if names[0] == names[1]:
        raise refusal_at(job.path, where, f'expected two bodies, got "{names[0]}" twice')


def _two(names: tuple[str, ...]) -> tuple[str, str]:
    one, two = names
    return one, two


def _head(table: CellTable, folder: Path) -> CuttingHead | MeshHead:
    """Return the head from its file, or the generic head with the given sizes."""
    head = table.head
    sizes: dict[str, Any] = {"stand_off": table.stand_off_mm / 1000, "share": table.share}
    for name in given(head, *SIZES):
        mm = getattr(head, name)
        many = isinstance(mm, tuple)
        sizes[name.removesuffix("_mm")] = tuple(v / 1000 for v in mm) if many else mm / 1000
    if head.file is None:
        return CuttingHead(**sizes)
    solid = _read_solid(folder / head.file, head.unit, table.deviation_mm / 1000)
    place = pose(head.xyz_mm or (0.0, 0.0, 0.0), head.rpy_deg or (0.0, 0.0, 0.0))
    return MeshHead(mesh=solid.moved(place), **sizes)


def _solid(job: Job, table: CellTable, part: Part) -> Mesh:
    """Return the part as a solid; a part drawn as a surface is thickened by sheet_mm."""
    if not part.faces:
        raise refusal_at(
            job.path,
            ("cell", "part"),
            f"expected a part with a solid, got only curves in {job.part_file.name}; write "
            "part = false to leave it out of the cell, or draw it as a solid",
        )
    vertices, triangles = _triangles(part, table.deviation_mm / 1000)
    is_open = bool(edges_of(triangles)[1].any())
    if is_open and table.sheet_mm is None:
        raise refusal_at(
            job.path,
            ("cell", "sheet_mm"),
            f"{job.part_file.name} is drawn as a surface, not as a closed solid, so its thickness "
            "is unknown; add sheet_mm, the thickness behind the surface as seen from the nozzle, "
            "or part = false to leave it out of the cell",
        )
    if not is_open and table.sheet_mm is not None:
        raise refusal_at(
            job.path,
            ("cell", "sheet_mm"),
            f"{job.part_file.name} is a closed solid with its own thickness; remove sheet_mm",
        )
    if table.sheet_mm is not None:
        vertices, triangles = thicken(vertices, triangles, table.sheet_mm / 1000)
    return Mesh(
        vertices=vertices,
        triangles=triangles,
        deviation=table.deviation_mm / 1000,
        name=job.part_file.name,
    )


def _shape(fixture: FixtureTable, folder: Path, deviation: float) -> Shape:
    place = pose(fixture.xyz_mm, fixture.rpy_deg)
    if fixture.size_mm is not None:
        return box([mm / 1000 for mm in fixture.size_mm], place)
    assert fixture.file is not None
    return _read_solid(folder / fixture.file, fixture.unit, deviation).moved(place)


def _read_solid(path: Path, unit: str | None, deviation: float) -> Mesh:
    """Return the solid in an STL file of a given unit, or in a STEP file, which states its own."""
    stamp = path.stat()
    return _solid_in(path, unit, deviation, (stamp.st_mtime_ns, stamp.st_size))


@lru_cache(maxsize=16)
def _solid_in(path: Path, unit: str | None, deviation: float, _stamp: tuple[int, int]) -> Mesh:
    """Read a solid; cached because a layout study reads the same file for every placement."""
    if path.suffix.lower() == ".stl":
        assert unit is not None
        return read_stl(path, unit)
    vertices, triangles = _triangles(read_drawing(path, unit=unit), deviation)
    return Mesh(vertices=vertices, triangles=triangles, deviation=deviation, name=path.name)


@lru_cache(maxsize=2)
def _triangles(part: Part, deviation: float) -> tuple[Array, Ints]:
    return weld(*part.mesh(deviation), SAME_PLACE)


# -----------------------------------------------------------------------------
# Sample contours finely enough to keep the tolerances of the audit between the nodes.

MOST_TIMES = 8
"""Largest factor on the number of nodes that was asked for."""
KEPT = 0.9
"""Share of a tolerance that finer sampling aims at, as the curvature varies along a contour."""
LEAST, MOST = 0.2, 0.9
"""Least and largest factor on the distance between nodes in one step."""


def closer_nodes(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    """Return the task with its nodes close enough to keep the tolerances.

    This is the task itself if its nodes are close enough. If the tool axis turns too fast for its
    tolerance, only the tolerance of the path is kept; None if that is impossible, too.

    Parameters
    ----------
    task : ContourSpec
    paths : sequence of Contour
        The paths to sample.
    tolerances : Tolerances
    """
    found = _closer(task, paths, tolerances)
    return found or _closer(task, paths, replace(tolerances, axis=np.inf))


def chord_error(path: Contour, nodes: Contour) -> float:
    """Return the largest distance (m) of a path's own points from the chords of its nodes."""
    return _between(path, nodes)[0]


def _closer(
    task: ContourSpec, paths: Sequence[Contour], tolerances: Tolerances
) -> ContourSpec | None:
    times = 1.0
    while times < MOST_TIMES:
        try:
            excess = max(_excess(path, task.sample(path), tolerances) for path in paths)
        except InputError:
            return None
        if excess <= 1:
            return task
        # The chord error grows with the square of the chord length.
        share = float(np.clip(np.sqrt(KEPT / excess), LEAST, MOST))
        task, times = task.finer(share), times / share
    return None


def _excess(path: Contour, nodes: Contour, tolerances: Tolerances) -> float:
    off, turned = _between(path, nodes)
    return max(off / tolerances.path, turned / tolerances.axis)


def _between(path: Contour, nodes: Contour) -> tuple[float, float]:
    """Return the largest errors between nodes: of the path's points (m) and of its axes (rad).

    Along a chord the tip moves straight and the axis turns evenly, as in a linear robot motion.
    """
    k = np.clip(np.searchsorted(nodes.s, path.s, side="right") - 1, 0, len(nodes) - 2)
    start, chord = nodes.points[k], np.diff(nodes.points, axis=0)[k]
    part = ((path.points - start) * chord).sum(axis=1) / (chord**2).sum(axis=1)
    part = np.clip(part, 0.0, 1.0)[:, None]
    off = np.linalg.norm(path.points - start - part * chord, axis=1)
    axes = (1 - part) * nodes.axes[k] + part * nodes.axes[k + 1]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turned = 2 * np.arcsin(np.clip(np.linalg.norm(axes - path.axes, axis=1) / 2, 0.0, 1.0))
    return float(off.max()), float(turned.max())


# -----------------------------------------------------------------------------
# Prepare a job: read its drawing and cell, and list the ways to cut each contour.

SHORTER = 0.1
"""Share of its length by which chords may be shorter than a path of which they sample all."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """One way to cut a contour.

    Parameters
    ----------
    path : Contour
        The path to cut with its operations (leads, micro joints, ...), part frame.
    nodes : Contour
        The path sampled as the job says: points, axes, kinds, speed shares and arc lengths.
    speed : float m/s, optional
        Speed along the path; None if the nodes carry their own times.
    unrounded : Contour, optional
        The path before its corners were rounded; None without rounding.
    rounded : float m, optional
        Distance of the rounded corners from the drawn ones.
    """

    path: Contour
    nodes: Contour
    speed: float | None = None
    unrounded: Contour | None = None
    rounded: float | None = None

    __repr__ = short_repr

    @classmethod
    def at(cls, speed: float, path: Contour, nodes: Contour) -> Candidate:
        """Return the candidate with nodes of a path; `speed` (m/s) unless they carry times."""
        return cls(path=path, nodes=nodes, speed=speed if nodes.time is None else None)

    @property
    def dt(self) -> float:
        """Time from node to node at the requested speed, s."""
        return node_interval(self.nodes, self.speed)

    def drawing_checks(self, nodes: Contour, path: float) -> list[Check]:
        """Return the check of rounded corners against the drawing; empty without such corners.

        Parameters
        ----------
        nodes : Contour
            The nodes that are cut; nothing is checked unless they sample the complete path.
        path : float m
            Tolerance of the chords between nodes from the path.
        """
        rounded, sharp = self.rounded, self.unrounded
        whole = abs(nodes.length - self.path.length) <= SHORTER * self.path.length
        if rounded is None or sharp is None or not whole:
            return []
        drawn = edge(sharp).points
        where, k = nearest(edge(nodes), drawn)
        off = np.linalg.norm(where - drawn, axis=1)
        worst = int(np.argmax(off))
        return [
            Check(
                code="drawing",
                title=f"distance of the drawing from the chords of the nodes, corners rounded by "
                f"{rounded * 1e3:g} mm",
                value=float(off[worst]),
                limit=max(rounded, path) + SAME_PLACE,
                unit="m",
                node=int(k[worst]),
                advice="lower round_mm in [contour.corners], or sample the contour more finely",
            )
        ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutRequest:
    """The request to cut one contour: the ways to cut it and the options of its plan.

    Parameters
    ----------
    task : ContourSpec
        The contour as the job describes it.
    loop : Contour
        The loop as drawn, part frame.
    candidates : tuple of Candidate
        The ways to cut it, of which one is chosen.
    options : PlanOptions
        Options of its plan.
    run : Subproblem or None
        The run of a Pareto set that the plan follows, with its windows and clearance.
    touched_up : bool
        Whether targets of the path were moved by hand.
    closer : str
        Note on nodes that are closer together than the job says, and why; "" if they are not.
    """

    task: ContourSpec
    loop: Contour
    candidates: tuple[Candidate, ...]
    options: PlanOptions
    run: Subproblem | None = None
    touched_up: bool = False
    closer: str = ""

    __repr__ = short_repr

    @property
    def leaves_the_loop(self) -> bool:
        """Whether points or tool axes of the cut differ from the drawn loop."""
        return self.touched_up or self.task.table.moves_the_path

    def picked(self, run: Subproblem, *, refine: bool) -> CutRequest:
        """Return the request for the first candidate, planned as a run of a Pareto set."""
        mine = self.options
        options = run.applied_to(replace(mine, feed="constant", refine=refine))
        if run.continuous:  # such a run keeps the job's shares of the limits
            options = replace(options, eta_v=mine.eta_v, eta_a=mine.eta_a)
        return replace(self, candidates=self.candidates[:1], options=options, run=run)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedJob:
    """A job with its drawing and cell read, ready to run and to audit plans and programs against.

    Parameters
    ----------
    job : Job
    part : Part
    cell : Cell or None
    contours : tuple of CutRequest
        The contours, in the order of the job or in the order of cutting.
    inner_first : tuple of (int, int)
        Pairs of contours (from 0) of which the first is to be cut before the second.
    """

    job: Job
    part: Part
    cell: Cell | None
    contours: tuple[CutRequest, ...]
    inner_first: tuple[tuple[int, int], ...]

    __repr__ = short_repr

    @classmethod
    def of(
        cls, job: Job, part: Part, cell: Cell | None, contours: Sequence[CutRequest]
    ) -> PreparedJob:
        """Return the job with these contours; their nesting follows from their loops."""
        inner: Sequence[tuple[int, int]] = ()
        if job.sequence is not None and job.sequence.inner_first:
            inner = inner_first([contour.loop for contour in contours])
        return cls(
            job=job, part=part, cell=cell, contours=tuple(contours), inner_first=tuple(inner)
        )

    def with_contours(self, contours: Sequence[CutRequest]) -> PreparedJob:
        """Return the job with other requests, in their order."""
        return PreparedJob.of(self.job, self.part, self.cell, contours)

    @property
    def names(self) -> list[str]:
        """The names of the contours."""
        return [contour.task.name for contour in self.contours]


def prepare(job: Job, part: Part | None = None, cell: Cell | None = None) -> PreparedJob:
    """Return a job with its drawing and cell read; `part` and `cell` if they are read already.

    Raises
    ------
    InputError
        The drawing or the cell cannot be read, a loop does not exist, or contours cannot be
        sampled; the error has a line for each problem.
    """
    part = part or job.read_part()
    tasks = job.tasks(part)  # first, so that a misspelt name is reported before the cell is read
    requests, faults = list[CutRequest](), list[InputError]()
    try:
        cell = cell_of_job(job, part) if cell is None else cell
    except InputError as fault:
        faults.append(fault)
    for task in tasks:
        try:
            requests.append(_request(job, task, part))
        except InputError as fault:
            faults.append(fault)
    if faults:
        raise all_of(faults)
    return PreparedJob.of(job, part, cell, requests)


def _request(job: Job, task: ContourSpec, part: Part) -> CutRequest:
    loop = task.drawn(part)
    paths = task.candidates(part, loop)
    task, closer = _within_tolerances(job, task, paths)
    candidates = tuple(Candidate.at(task.speed, path, task.sample(path)) for path in paths)
    if task.rounded is not None:
        candidates = tuple(
            replace(each, unrounded=sharp, rounded=task.rounded)
            for each, sharp in zip(candidates, task.unrounded(part, loop), strict=True)
        )
    return CutRequest(
        task=task,
        loop=loop,
        candidates=candidates,
        options=task.asked(job.options),
        closer=closer,
    )


def _within_tolerances(
    job: Job, task: ContourSpec, paths: Sequence[Contour]
) -> tuple[ContourSpec, str]:
    """Return the task with nodes close enough for the tolerances of the audit, and a note on it.

    A number of nodes (`count`) is kept, and so are nodes that are divided later (refine_parts).
    """
    if task.count is not None or job.options.refine_parts > 1:
        return task, ""
    finer = closer_nodes(task, paths, job.tolerances)
    if finer is None or finer is task:
        return task, ""
    key = task.sampled_by
    asked, used = (getattr(each.table, key) for each in (task, finer))
    return finer, (
        f"{key} = {used:.3g} is used in place of {asked:g}, so that the path between its nodes "
        "keeps the tolerances of [audit]"
    )


def divide_nodes(path: Contour, nodes: Contour, parts: int) -> Contour:
    """Return the nodes of a path that divide every interval between `nodes` into parts."""
    k = np.arange(len(nodes))
    s = np.interp(np.arange(k[-1] * parts + 1) / parts, k, nodes.s)
    return replace(path.at_nodes(s), name=nodes.name)
