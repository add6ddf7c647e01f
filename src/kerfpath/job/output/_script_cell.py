"""Write the cell of a job as lines of a Python script."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from kerfpath.cell import Cell
from kerfpath.job.format import Job, pose
from kerfpath.job.format.tables import CellTable

__all__ = ["cell_lines", "has_files"]

SIZES = (
    "nozzle_length_mm", "nozzle_radii_mm", "body_length_mm", "body_radius_mm", "arm_radius_mm",
)  # fmt: skip
"""Keys of [cell.head] that are arguments of `CuttingHead` without their unit."""
SAME = 1e-6
"""Distance in m below which corners of the part are merged, as in jobs."""


def has_files(table: CellTable) -> bool:
    """Return whether anything in a cell except the part is read from a file."""
    return table.head.file is not None or any(each.file is not None for each in table.fixture)


def cell_lines(job: Job, cell: Cell) -> Iterator[str]:
    """Yield the lines that build `cell`, the cell of a job whose bodies need no files."""
    table = job.cell
    assert table is not None
    yield "# The bodies that the motions keep clear of."
    named = {"tool": "T_flange_tip", "head": _head(table)}
    if table.part:
        yield f"vertices, triangles = weld(*part.mesh({table.deviation_mm!r} * MM), {SAME!r})"
        if table.sheet_mm is not None:
            yield f"vertices, triangles = thicken(vertices, triangles, {table.sheet_mm!r} * MM)"
        yield "solid = Mesh("
        yield "    vertices=vertices,"
        yield "    triangles=triangles,"
        yield f"    deviation={table.deviation_mm!r} * MM,"
        yield f"    name={job.part_file.name!r},"
        yield ")"
        named |= {"part": "solid"}
    yield "fixtures = {"
    for fixture in table.fixture:
        size = ", ".join(f"{mm!r} * MM" for mm in fixture.size_mm or ())
        yield f"    {fixture.name!r}: box("
        yield f"        [{size}],"
        yield "        np.array(["
        yield from (
            f"            {row!r}," for row in pose(fixture.xyz_mm, fixture.rpy_deg).tolist()
        )
        yield "        ]),"
        yield "    ),"
    yield "}"
    floor = job.options.floor if all(each.name != "floor" for each in table.fixture) else None
    named |= {"placement": "T_base_part", "fixtures": "fixtures"}
    if on := {each.name: each.on for each in table.fixture if each.on is not None}:
        named["on"] = repr(on)
    if table.links == "capsules":
        named["links"] = "link_capsules(arm)"
    named |= {"near_miss": f"{table.near_miss_mm!r} * MM", "floor": repr(floor)}
    named["near_miss_of"] = repr(dict(cell.near_miss_of))
    touching = cell.may_touch
    named["may_touch"] = repr(dict(touching) if isinstance(touching, Mapping) else [*touching])
    yield "cell = cell_of("
    yield "    arm,"
    yield from (f"    {name}={value}," for name, value in named.items())
    yield ")"


def _head(table: CellTable) -> str:
    sizes = {"stand_off": f"{table.stand_off_mm!r} * MM", "share": repr(table.share)}
    for name in SIZES:
        mm = getattr(table.head, name)
        if isinstance(mm, tuple):
            sizes[name.removesuffix("_mm")] = f"({', '.join(f'{each!r} * MM' for each in mm)})"
        elif mm is not None:
            sizes[name.removesuffix("_mm")] = f"{mm!r} * MM"
    return f"CuttingHead({', '.join(f'{name}={value}' for name, value in sizes.items())})"
