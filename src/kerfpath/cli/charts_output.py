"""`kerfpath charts`: list, show and check cut charts, convert foreign ones, and trace a job's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.markup import escape

from kerfpath.cli.show import out, print_json, table, write_text
from kerfpath.errors import InputError
from kerfpath.job import (
    Chart,
    Origin,
    chart_files,
    doubts_of,
    find_chart,
    origins_of,
    read_chart,
    read_foreign,
    read_job,
    row_words,
    user_folder,
)

COLUMNS = ["row", "material", "mm", "gas", "quality", "technique", "m/min", "kerf mm", "more"]


def list_charts() -> None:
    """Print every chart in the current folder, of the user, and shipped."""
    entries: list[dict[str, object]] = []
    rows = []
    for place, name, path in chart_files(Path()):
        try:
            chart = read_chart(path, name)
        except InputError as error:
            entries.append({"name": name, "place": place, "file": str(path), "fault": str(error)})
            rows.append([name, "-", "", str(error)])
            continue
        materials = sorted({row.material for row in chart.table.row})
        entries.append(
            {
                "name": name,
                "place": place,
                "file": str(path),
                "rows": len(chart.table.row),
                "materials": materials,
                "example": chart.table.example,
                "source": chart.table.source,
            }
        )
        what = "example" if chart.table.example else ""
        rows.append([name, str(len(chart.table.row)), ", ".join(materials), what])
    print_json({"charts": entries, "user_folder": str(user_folder())})
    table(["chart", "rows", "materials", ""], [[*map(escape, row)] for row in rows])
    out.print(
        f"own charts are found in charts/ beside a job, and in {escape(str(user_folder()))}; "
        "examples are not measured, and are used only if a job names them"
    )


def show_charts(names: Sequence[str]) -> None:
    """Print the rows of charts."""
    charts = [find_chart(name) for name in _required(names, "the name or path of a chart")]
    print_json({"charts": [_entry(chart) for chart in charts]})
    for chart in charts:
        out.print(f"[bold]{escape(chart.name)}[/]: {escape(chart.table.source)}")
        _rows(chart)


def check_charts(names: Sequence[str]) -> None:
    """Read charts, and print what is unusual in them.

    Raises
    ------
    InputError
        One is not valid; its faults follow, and those of the others.
    """
    read: list[Chart] = []
    faults: list[str] = []
    for name in _required(names, "the path of a chart"):
        try:
            read.append(read_chart(Path(name), name))
        except InputError as error:
            faults += [error.message, *error.others]
    if faults:
        raise InputError(faults[0], faults[1:])
    print_json({"charts": [_entry(chart) for chart in read]})
    for chart in read:
        doubts = doubts_of(chart)
        out.print(f"{escape(chart.name)}: {len(chart.table.row)} rows, {len(doubts)} to look at")
        for said in doubts:
            out.print(f"  {escape(said)}")


def trace(job_file: Path) -> None:
    """Print where each value of the process of a job comes from."""
    job = read_job(job_file)
    origins = origins_of(job.text, job.source)
    if not origins:
        raise InputError(
            f"{job_file}: expected a job with [process], got one without; add [process] with "
            "material and thickness_mm"
        )
    small = job.small_holes
    holes = small and {"size_mm": small.size * 1e3, "row": small.row.place}
    print_json(
        {
            "origins": [origin_entry(each) for each in origins],
            "sheet": [*job.program.remarks],
            "small_holes": holes,
        }
    )
    rows = [
        [escape(each.of), each.key, escape(each.shown), escape(each.origin), _set_by(each)]
        for each in origins
    ]
    table(["of", "value", "is", "from", "set by"], rows)
    if small is not None:
        out.print(
            f"holes of at most {small.size * 1e3:g} mm: the technique {small.row.technique}, by "
            f"{escape(small.row.place)}, unless their contour has one; the drawing is not read here"
        )


def convert(
    file: Path,
    output: Path | None,
    *,
    columns: Sequence[str],
    sheet: str | None,
    unit: str | None,
    said: Mapping[str, str | float | None],
) -> None:
    """Convert a foreign chart, and print what it lacks; without `output` print the chart."""
    if output is not None and output.exists():
        raise InputError(f"{output}: exists already; name another file with --output")
    text, notes = read_foreign(file, columns=columns, sheet=sheet, unit=unit, said=said)
    print_json({"chart": text, "notes": list(notes)})
    if output is None:
        out.print(escape(text), end="")
    else:
        write_text(output, text, "--output")
    for note in notes:
        out.print(f"{'# ' if output is None else ''}{escape(note)}")


def origin_entry(each: Origin) -> dict[str, object]:
    """Return a value of the process and its origin for JSON."""
    return {
        "of": each.of,
        "key": each.key,
        "value": each.value,
        "from": each.origin,
        "by_hand": each.by_hand,
    }


def _required(names: Sequence[str], what: str) -> Sequence[str]:
    if not names:
        raise InputError(f"charts: expected {what}, got nothing; name one")
    return names


def _entry(chart: Chart) -> dict[str, object]:
    table_ = chart.table.model_dump(mode="json", exclude_none=True)
    return {"name": chart.name, "file": str(chart.path), **table_, "unusual": doubts_of(chart)}


def _rows(chart: Chart) -> None:
    rows = [
        [
            str(number),
            escape(row.material),
            f"{row.thickness_mm:g}",
            escape(row.gas or ""),
            escape(row.quality or ""),
            escape(row.technique),
            f"{row.speed_m_min:g}",
            "" if row.kerf_mm is None else f"{row.kerf_mm:g}",
            escape(row_words(row)),
        ]
        for number, row in enumerate(chart.table.row, 1)
    ]
    table(COLUMNS, rows, numbers=["row", "mm", "m/min", "kerf mm"])


def _set_by(each: Origin) -> str:
    return "hand" if each.by_hand else "program"
