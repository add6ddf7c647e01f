"""Build the cell of a job from its [cell] table and its part."""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from kerfpath.arrays import Array, Ints
from kerfpath.cad import Part
from kerfpath.cad import read as read_drawing
from kerfpath.cell import (
    MAY_TOUCH,
    MESHES,
    Cell,
    CuttingHead,
    Mesh,
    MeshHead,
    Shape,
    allowed_pairs,
    box,
    cell_of,
    cylinder,
    edges_of,
    link_capsules,
    read_mesh,
    thicken,
    weld,
)
from kerfpath.errors import InputError
from kerfpath.job.format.reading import Job
from kerfpath.job.format.tables import CellTable, FixtureTable, given
from kerfpath.job.format.tables.table import pose
from kerfpath.job.format.toml_file import refusal_at
from kerfpath.tolerances import SAME_PLACE
from kerfpath.urdf import read_srdf

SIZES = (
    "nozzle_length_mm", "nozzle_radii_mm", "body_length_mm", "body_radius_mm", "arm_radius_mm",
)  # fmt: skip
"""Keys of [cell.head] that are arguments of `CuttingHead` without their unit."""
SHAPES = {"size_mm": box, "cylinder_mm": cylinder}
"""Keys of a fixture with the size of a shape, and what makes the shape of a size and a pose, m."""


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
    solid = read_solid(folder / head.file, head.unit, table.deviation_mm / 1000)
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
    for name in given(fixture, *SHAPES):
        return SHAPES[name]([mm / 1000 for mm in getattr(fixture, name)], place)
    assert fixture.file is not None
    return read_solid(folder / fixture.file, fixture.unit, deviation).moved(place)


def read_solid(path: Path, unit: str | None, deviation: float) -> Mesh:
    """Return the solid in a mesh of a given unit, or in a STEP file, which states its own.

    Parameters
    ----------
    path : Path
    unit : str or None
    deviation : float m
        Largest distance of the triangles from the faces of a STEP file.

    Raises
    ------
    InputError
        A file that cannot be read, or no closed solid in it.
    """
    stamp = path.stat()
    return _solid_in(path, unit, deviation, (stamp.st_mtime_ns, stamp.st_size))


@lru_cache(maxsize=16)
def _solid_in(path: Path, unit: str | None, deviation: float, _stamp: tuple[int, int]) -> Mesh:
    """Read a solid; cached because a layout study reads the same file for every placement."""
    if path.suffix.lower() in MESHES:
        assert unit is not None
        return read_mesh(path, unit)
    vertices, triangles = _triangles(read_drawing(path, unit=unit), deviation)
    return Mesh(vertices=vertices, triangles=triangles, deviation=deviation, name=path.name)


@lru_cache(maxsize=2)
def _triangles(part: Part, deviation: float) -> tuple[Array, Ints]:
    return weld(*part.mesh(deviation), SAME_PLACE)
