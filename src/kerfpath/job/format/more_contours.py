"""Add contours to the text of a job or remove them; all other lines stay as they are."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from kerfpath.cad import Loop, Part
from kerfpath.errors import InputError
from kerfpath.job.format.contour import keys_of_closed_loops
from kerfpath.job.format.reading import Job

FEWEST, MOST = 24, 400
"""Fewest and most nodes of an added loop, if the contour that it copies has spacing_mm."""
OWN = ("pick", "pick_all", "name", "start_mm")
"""Keys that an added loop does not copy from another contour."""
_CONTOUR = re.compile(r"[ \t]*\[\[[ \t]*contour[ \t]*\]\]")
_INSIDE = re.compile(r"[ \t]*\[\[?[ \t]*contour[ \t]*\.")
_HEADER = re.compile(r"[ \t]*\[")


def with_loops(job: Job, part: Part, names: Sequence[str]) -> str:
    """Return the text of a job that also cuts these loops of its part.

    Each new loop copies the settings of the most similar contour of the job: one of the same kind
    if there is one, with the closest length. Its spacing is changed if it would give very few or
    very many nodes. Holes are inserted before the first trim line, everything else at the end.

    Parameters
    ----------
    job : Job
    part : Part
        The part in the job's drawing.
    names : sequence of str
        Names of the loops to add.

    Raises
    ------
    InputError
        A loop does not exist, has a gap, or is cut already; or the contours of the job are not
        written as [[contour]] tables.
    """
    cut = _picks(job, part)
    return _with_loops(job, part, names, cut, set().union(*cut))


def _picks(job: Job, part: Part) -> list[set[str]]:
    """Return the loops of each table."""
    return [{task.pick for task in spec.expanded(part)} for spec in job.contours]


def _with_loops(
    job: Job, part: Part, names: Sequence[str], cut: Sequence[set[str]], barred: Collection[str]
) -> str:
    """Return the text with these loops, none of them barred; `cut` has those of each table."""
    text, source = job.text, tomllib.loads(job.text)
    tables: list[Mapping[str, object]] = list(source["contour"])
    outer = [i for i, picks in enumerate(cut) if any(_is_trim(part.loop(n)) for n in picks)]
    first_trim = outer[0] if outer else len(tables)
    for name in dict.fromkeys(names):
        loop = part.loop(name)
        _require_to_cut(loop, job, name in barred)
        at = first_trim if loop.kind == "inner" else len(tables)
        table = _like(job, source, part, loop)
        text = _inserted(text, at, _written(table))
        tables.insert(at, table)
        first_trim += loop.kind == "inner"
    return _required(text, source, tables)


def only_loops(job: Job, part: Part, names: Sequence[str]) -> str:
    """Return the text of a job that cuts these loops of its part alone.

    Contours of other loops are removed; loops that are not cut yet are added as `with_loops` does,
    also those of a table that picks others, too.

    Parameters
    ----------
    job : Job
    part : Part
        The part in the job's drawing.
    names : sequence of str
        Names of all loops to cut.

    Raises
    ------
    InputError
        As for `with_loops`; or no loop is named.
    """
    if not names:
        raise InputError("job: expected loops to cut, got none; name at least one")
    cut = _picks(job, part)
    whole = [bool(picks) and picks <= set(names) for picks in cut]
    stays = set().union(*(picks for picks, each in zip(cut, whole, strict=True) if each))
    source = tomllib.loads(job.text)
    gone = [each for each, stay in zip(source["contour"], whole, strict=True) if not stay]
    text = _with_loops(job, part, [name for name in names if name not in stays], cut, stays)
    tables: list[Mapping[str, object]] = list(tomllib.loads(text)["contour"])
    for index in reversed(range(len(tables))):
        if tables[index] in gone:
            text = _without(text, index, len(tables))
            del tables[index]
    return _required(text, source, tables)


def without_contour(job: Job, index: int) -> str:
    """Return the text of a job without one of its [[contour]] tables; its comments stay.

    Raises
    ------
    InputError
        There is no such table, it is the only one, or the contours are not written as [[contour]]
        tables.
    """
    source = tomllib.loads(job.text)
    tables = list(source["contour"])
    if not 0 <= index < len(tables):
        raise InputError(f"job: expected a contour from 0 to {len(tables) - 1}, got {index}")
    if len(tables) == 1:
        raise InputError("job: the only contour cannot be removed; add another one first")
    text = _without(job.text, index, len(tables))
    del tables[index]
    return _required(text, source, tables)


def _without(text: str, index: int, count: int) -> str:
    """Return a text without one of its [[contour]] tables, of which it has `count`."""
    lines = _lines(text)
    begin, end = _blocks(lines, count)[index]
    after = end
    while after < len(lines) and not lines[after].strip():
        after += 1
    if after == end and begin and not lines[begin - 1].strip():
        begin -= 1
    del lines[begin:after]
    return "".join(lines)


def _lines(text: str) -> list[str]:
    """Return lines with their ends; only a line feed ends a line of TOML."""
    return re.findall(r".*\n|.+", text)


def _is_trim(loop: Loop) -> bool:
    return loop.kind == "outer"


def _require_to_cut(loop: Loop, job: Job, cut: bool) -> None:
    if cut:
        raise InputError(f"loop {loop.name!r} is already a contour of the job; pick another one")
    if loop.kind != "open" and not loop.closed:
        raise InputError(
            f"loop {loop.name!r} has a gap of {loop.largest_gap * 1e3:.3g} mm, more than the "
            f"{job.drawing.gap * 1e3:g} mm that gap_mm of [part] bridges; close it in CAD"
        )


def _like(job: Job, source: Mapping[str, Any], part: Part, loop: Loop) -> Mapping[str, object]:
    """Return the [[contour]] table of a loop, copied from the most similar contour."""

    def unlike(index: int) -> tuple[bool, float]:
        loops = [part.loop(task.pick) for task in job.contours[index].expanded(part)]
        apart = [(each.kind != loop.kind, _ratio(each.length, loop.length)) for each in loops]
        return min(apart, default=(True, np.inf))

    nearest = min(range(len(job.contours)), key=unlike)
    barred = set(OWN)
    if loop.kind == "open":
        barred |= set(keys_of_closed_loops(job.contours[nearest].table))
    model: Mapping[str, object] = source["contour"][nearest]
    table = {key: value for key, value in model.items() if key not in barred}
    spacing = job.contours[nearest].spacing
    if spacing is not None:
        table["spacing_mm"] = _spacing(spacing, loop.length)
    return {"pick": loop.name, **table}


def _ratio(one: float, two: float) -> float:
    return abs(float(np.log(one / two)))


def _spacing(spacing: float, length: float) -> float:
    """Return the spacing of nodes in mm: as given (m), unless that makes too few or too many."""
    mm = float(np.clip(spacing, length / MOST, length / FEWEST)) * 1e3
    return float(f"{mm:.2g}") if mm != spacing * 1e3 else mm


def _blocks(lines: Sequence[str], count: int) -> list[tuple[int, int]]:
    """Return the range of lines of each [[contour]] table, from its header to its last key.

    Raises
    ------
    InputError
        The text does not have `count` such tables.
    """
    found = []
    for begin, line in enumerate(lines):
        if not _CONTOUR.match(line):
            continue
        end = begin + 1
        for k in range(begin + 1, len(lines)):
            if _HEADER.match(lines[k]) and not _INSIDE.match(lines[k]):
                break
            if (said := lines[k].strip()) and not said.startswith("#"):
                end = k + 1
        found.append((begin, end))
    if len(found) != count:
        raise _unwritten()
    return found


def _inserted(text: str, at: int, block: str) -> str:
    """Return a text with one more [[contour]] table, the `at`-th from 0 on."""
    lines = _lines(text)
    blocks = _blocks(lines, sum(bool(_CONTOUR.match(line)) for line in lines))
    if not blocks:
        raise _unwritten()
    if lines and not lines[-1].endswith("\n"):
        lines[-1] += "\n"
    line_end = "\r\n" if lines[0].endswith("\r\n") else "\n"
    place = blocks[at - 1][1] if at else blocks[0][0]
    # An empty line separates two tables.
    new = f"\n{block}" if at else f"{block}\n"
    lines[place:place] = [line + line_end for line in new.splitlines()]
    return "".join(lines)


def _written(table: Mapping[str, object]) -> str:
    """Return a [[contour]] table as text."""
    lines = ["[[contour]]"]
    lines += [f"{k} = {_value(v)}" for k, v in table.items() if not isinstance(v, Mapping)]
    for name, inner in table.items():
        if isinstance(inner, Mapping):
            lines += [f"[contour.{name}]", *(f"{k} = {_value(v)}" for k, v in inner.items())]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return json.dumps(value, ensure_ascii=False)


def _required(text: str, source: Mapping[str, object], tables: list[Mapping[str, object]]) -> str:
    """Return the text if it parses to the tables of the job with these contours, else raise."""
    try:
        said = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise _unwritten() from None
    if said != {**source, "contour": tables}:
        raise _unwritten()
    return text


def _unwritten() -> InputError:
    return InputError(
        "job: expected each contour as a table that begins with a line [[contour]], got another "
        "notation; edit the contours in the text of the job"
    )
