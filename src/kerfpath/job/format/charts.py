"""Cut charts: read their files, find them, and choose the row for what a job cuts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from platformdirs import user_config_path
from pydantic import ValidationError

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.job.format.tables import (
    LONGEST_WORD,
    ChartFile,
    JobRowTable,
    ProcessTable,
    RowTable,
    tables_in,
)
from kerfpath.job.format.tables.table import nearest
from kerfpath.job.format.toml_file import error_at, read_tables, read_text, refusal

FOLDER = "charts"
"""Folder of charts beside a job, and in the user's folder of settings."""
NEAR = 0.01
"""Share of a thickness by which that of a row may differ: sheets are thinner or thicker by more."""
TABLES = dict(tables_in(ChartFile))
"""The model of each table of a chart."""
WORDS = ("material", "technique", "gas", "quality")
"""What has to fit besides the thickness; the quality last, as only some rows have one."""
FIXED = ("gas", "nozzle_mm", "note")
"""Values of which none lies between two others."""


class NoRow(InputError):
    """There is no row for a job, or no single one; `key` of [process] is what to change."""

    def __init__(self, message: str, key: str) -> None:
        super().__init__(message)
        self.key = key


# -----------------------------------------------------------------------------
# Files of charts, and the folders that they are found in.


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A chart that was read.

    Parameters
    ----------
    path : Path
    name : str
        What jobs call it.
    table : ChartFile
    """

    path: Path
    name: str
    table: ChartFile

    __repr__ = short_repr

    @property
    def rows(self) -> tuple[JobRowTable, ...]:
        """Its rows as in the table of a job, with chart, number and source."""
        said = self.table.model_dump(include={"source", "example", "machine"})
        return tuple(
            JobRowTable(**row.model_dump(), chart=self.name, number=number, **said)
            for number, row in enumerate(self.table.row, 1)
        )


def read_chart(path: Path, name: str = "") -> Chart:
    """Return the chart in a TOML file.

    Raises
    ------
    InputError
        The file is not a valid chart; one line for its first fault, and one for each other.
    """
    if path.suffix.lower() != ".toml" and _is_file(path):
        said = f"expected a chart (.toml), got {path.suffix or 'a file without a suffix'}"
        raise error_at(path, None, f"{said}; convert it with kerfpath charts convert {path}")
    text = read_text(path, "a chart")
    source = read_tables(path, text, "a chart", "source and [[row]]")
    try:
        table = ChartFile.model_validate(source)
    except ValidationError as error:
        raise refusal(path, text, error, TABLES) from None
    return Chart(path=path, name=name or str(path), table=table)


def user_folder() -> Path:
    """Return the folder of the user's own charts."""
    return user_config_path("kerfpath") / FOLDER


def shipped_folder() -> Path:
    """Return the folder of the charts that are shipped as examples."""
    return Path(str(files("kerfpath.job"))) / FOLDER


def chart_files(folder: Path | None = None) -> Iterator[tuple[str, str, Path]]:
    """Yield where each chart is found ("job", "user" or "shipped"), its name, and its file.

    `folder` is that of a job.
    """
    places = {} if folder is None else {"job": folder / FOLDER}
    places |= {"user": user_folder(), "shipped": shipped_folder()}
    for place, there in places.items():
        for path in sorted(there.glob("*.toml")):
            called = f"{FOLDER}/{path.name}" if place == "job" else f"{place}:{path.name}"
            yield place, called, path


def find_chart(name: str, folder: Path | None = None) -> Chart:
    """Return the chart of this path, relative to the folder of a job, or of this name.

    Raises
    ------
    InputError
        There is no such chart, or it is not valid.
    """
    path = (folder or Path()) / name
    if _is_file(path):
        return read_chart(path, name)
    known: dict[str, tuple[str, Path]] = {}
    for place, called, file in chart_files(folder):
        for word in (called, f"{place}:{file.stem}", file.name, file.stem):
            known.setdefault(word, (called, file))
    if name in known:
        called, file = known[name]
        return read_chart(file, called)
    names = sorted({called for called, _ in known.values()})
    raise InputError(f'expected a chart, got "{name[:LONGEST_WORD]}"; {nearest(name, names)}')


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that the file system cannot hold
        return False


# -----------------------------------------------------------------------------
# Values that are possible, but unusual: an error of units, more likely.

LASER: Mapping[str, tuple[float, float]] = {
    "speed_m_min": (0.1, 100),
    "kerf_mm": (0.05, 1),
    "stand_off_mm": (0.3, 3),
    "pressure_bar": (0.2, 30),
    "power_w": (100, 60_000),
    "frequency_hz": (50, 50_000),
    "nozzle_mm": (0.7, 6),
    "focus_mm": (-25, 25),
}
"""Usual values of a laser, least and most."""
PLASMA: Mapping[str, tuple[float, float]] = {
    "speed_m_min": (0.3, 15),
    "kerf_mm": (0.4, 6),
    "stand_off_mm": (0.5, 6),
    "pressure_bar": (3, 9),
    "current_a": (15, 800),
    "voltage_v": (60, 250),
}
"""Usual values of a plasma, which is what a row with a current is for."""


def doubts_of(chart: Chart) -> list[str]:
    """Return a sentence for each value that is unusual."""
    found = []
    for number, row in enumerate(chart.table.row, 1):
        for key, (low, high) in (LASER if row.current_a is None else PLASMA).items():
            value = getattr(row, key)
            if value is not None and not low <= value <= high:
                found.append(f"row {number}: {key} = {value:g}, usual is {low:g} to {high:g}")
        if row.kerf_mm and row.kerf_mm > row.thickness_mm and row.current_a is None:
            found.append(
                f"row {number}: kerf_mm = {row.kerf_mm:g} is wider than the sheet is thick"
            )
    return found


# -----------------------------------------------------------------------------
# The row for what a job cuts.


def choose(process: ProcessTable, technique: str, folder: Path) -> JobRowTable:
    """Return the row for a material, thickness, gas, quality and technique.

    The rows of the job come first; then those of the chart that it names, or else of the charts
    in the folder `charts` beside it, and of the user's. Shipped examples have to be named.

    Raises
    ------
    NoRow
        No row fits, or several do.
    InputError
        The chart that the job names does not exist, or one is not valid.
    """
    wanted = process.model_copy(update={"technique": technique})
    every: list[JobRowTable] = []
    for rows in _groups(process, folder):
        every += rows
        near = [row for row in _alike(rows, wanted) if _apart(row, wanted) <= NEAR]
        least = min((_apart(row, wanted) for row in near), default=0.0)
        if row := _picked([row for row in near if _apart(row, wanted) == least], wanted):
            return row
    if not every:
        raise NoRow(
            f"expected a chart in {folder / FOLDER} or {user_folder()}, got none; name one with "
            "chart (kerfpath charts list shows those that are shipped as examples)",
            "chart",
        )
    return _between(_fitting(every, wanted), wanted)


def _groups(process: ProcessTable, folder: Path) -> Iterator[Sequence[JobRowTable]]:
    """Yield the rows of each place, the first that counts first; files are read as they come."""
    yield process.row
    if process.chart is not None:
        yield find_chart(process.chart, folder).rows
        return
    for place in ("job", "user"):
        found = [(called, path) for at, called, path in chart_files(folder) if at == place]
        yield [row for called, path in found for row in read_chart(path, called).rows]


def _apart(row: RowTable, wanted: ProcessTable) -> float:
    return abs(row.thickness_mm - wanted.thickness_mm) / row.thickness_mm


def _alike(rows: Sequence[JobRowTable], wanted: ProcessTable) -> list[JobRowTable]:
    """Return the rows of the same material, technique and gas."""
    found = list(rows)
    for word in WORDS[:-1]:
        found = _with(found, word, wanted)
    return found


def _with(rows: Sequence[JobRowTable], word: str, wanted: ProcessTable) -> list[JobRowTable]:
    """Return the rows that fit one of `WORDS`; a gas or quality that is not said fits all."""
    said = getattr(wanted, word)
    if word == "material":
        return [row for row in rows if row.material.casefold() == said.casefold()]
    if word == "technique":
        return [row for row in rows if row.technique == said]
    return list(rows) if said is None else _of_word(rows, word, said)


def _picked(rows: Sequence[JobRowTable], wanted: ProcessTable) -> JobRowTable | None:
    """Return the one of several rows of a thickness that has the quality; None if none has."""
    if len({row.gas for row in rows}) > 1:
        rows = _of_word(rows, "gas", wanted.gas)
    if len({row.gas for row in rows}) == 1:
        rows = _of_word(rows, "quality", wanted.quality)
    return _only(rows) if rows else None


def _of_word(rows: Sequence[JobRowTable], word: str, said: str | None) -> list[JobRowTable]:
    """Return the rows of a gas or quality; those without one hold for any that has no row.

    Where none is said, rows without one come first.
    """
    same = [row for row in rows if getattr(row, word) == said]
    if same or said is None:
        return same or list(rows)
    return [row for row in rows if getattr(row, word) is None]


def _fitting(rows: Sequence[JobRowTable], wanted: ProcessTable) -> list[JobRowTable]:
    """Return the rows of the same words, or raise NoRow at the first word without a row."""
    found = list(rows)
    for word in WORDS:
        fitting = _with(found, word, wanted)
        if not fitting:
            said = getattr(wanted, word)
            of = "" if word == "material" else f" for {wanted.material}"
            known = sorted({getattr(row, word) or "none" for row in found})
            raise NoRow(
                f'expected a {word} that a chart has{of}, got "{said}"; {nearest(said, known)}',
                word,
            )
        found = fitting
    return found


def _only(rows: Sequence[JobRowTable]) -> JobRowTable:
    """Return the only one of several rows, or raise NoRow."""
    if len(rows) == 1:
        return rows[0]
    word = next(
        (w for w in ("gas", "quality") if len({getattr(row, w) for row in rows}) > 1), "chart"
    )
    which = ", ".join(f"{row.place} ({getattr(row, word) or 'none'})" for row in rows[:4])
    raise NoRow(f"expected one row, got {len(rows)}: {which}; name the {word}", word)


def _between(rows: Sequence[JobRowTable], wanted: ProcessTable) -> JobRowTable:
    """Return the row between those of the next thicknesses, if the job allows it, or raise."""
    below = [row for row in rows if row.thickness_mm < wanted.thickness_mm]
    above = [row for row in rows if row.thickness_mm > wanted.thickness_mm]
    thinner = max((row.thickness_mm for row in below), default=None)
    thicker = min((row.thickness_mm for row in above), default=None)
    under = [row for row in below if row.thickness_mm == thinner]
    over = [row for row in above if row.thickness_mm == thicker]
    shown = ", ".join(f"{row.thickness_mm:g} mm ({row.place})" for row in (*under, *over)[:4])
    got = f"{wanted.thickness_mm:g} mm"
    if not (under and over):
        raise NoRow(
            f"expected the thickness of a row, got {got}; the nearest has {shown}; add a row for "
            "it",
            "thickness_mm",
        )
    if wanted.between == "refuse":
        raise NoRow(
            f"expected the thickness of a row, got {got}; the nearest have {shown}; add a row, or "
            'write between = "linear"',
            "thickness_mm",
        )
    one, two = _picked(under, wanted), _picked(over, wanted)
    assert one is not None  # rows of the quality are left
    assert two is not None
    return _interpolated(one, two, wanted)


def _interpolated(one: JobRowTable, two: JobRowTable, wanted: ProcessTable) -> JobRowTable:
    """Return the row between two: numbers in proportion to the thickness, all else the same."""
    share = (wanted.thickness_mm - one.thickness_mm) / (two.thickness_mm - one.thickness_mm)
    which = f"{one.place} and {two.place}"

    def between(a: Any, b: Any, name: str) -> Any:
        if a == b:
            return a
        if isinstance(a, float) and isinstance(b, float) and name not in FIXED:
            return round(a + share * (b - a), 6)
        if isinstance(a, tuple) and isinstance(b, tuple) and len(a) == len(b):
            return tuple(between(x, y, name) for x, y in zip(a, b, strict=True))
        if isinstance(a, dict) and isinstance(b, dict):
            return {key: between(a[key], b[key], key) for key in a}
        raise NoRow(
            f"expected {name} alike in {which}, as none lies between, got {_said(a)} and "
            f"{_said(b)}; add a row of {wanted.thickness_mm:g} mm",
            "thickness_mm",
        )

    kept = ("chart", "number", "source", "example", "machine", "note")
    values = {
        name: between(a, b, name)
        for (name, a), b in zip(
            one.model_dump(exclude={*kept}).items(),
            two.model_dump(exclude={*kept}).values(),
            strict=True,
        )
    }
    return JobRowTable(
        **values,
        chart=one.chart,
        note=f"interpolated between {which}",
        source=one.source,
        example=one.example or two.example,
        machine=one.machine if one.machine == two.machine else None,
    )


def _said(value: object) -> str:
    if isinstance(value, tuple):
        return f"{len(value)} stages"
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else f'"{value}"'
