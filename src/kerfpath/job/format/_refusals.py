"""One-line messages about faults in a job file: place, key, expected, got, what to do."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, time
from pathlib import Path

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from kerfpath.errors import InputError
from kerfpath.job.format._lines import TomlPlaces
from kerfpath.job.format._values import FAULT, LARGEST, SMALLEST, nearest
from kerfpath.job.format.tables import REPEATED, TABLES

__all__ = ["all_of", "error_at", "refusal", "refusal_at"]

_LONGEST = 60
"""Characters of a wrong value that a message shows."""


def refusal(path: Path, text: str, error: ValidationError) -> InputError:
    """Return an error with one line for the first problem in the file and one for each other."""
    details = error.errors(include_url=False)
    locs, places = [d["loc"] for d in details], TomlPlaces(text)
    problems = []
    for detail in details:
        loc = detail["loc"]
        # pydantic also reports an array with a wrong element as too short: show the element only.
        if detail["type"] == "too_short" and any(p[: len(loc)] == loc != p for p in locs):
            continue
        where = (*loc, *detail["ctx"]["where"]) if detail["type"] == FAULT else loc
        # Missing keys come last: a misspelt key explains more.
        order = detail["type"] == "missing", *places.locate(where)
        key = ".".join(part for part in where if isinstance(part, str))
        problems.append((order, f"{key}: {_problem(detail)}"))
    return all_of([error_at(path, place[1], said) for place, said in sorted(problems)])


def refusal_at(path: Path, where: Sequence[str | int], said: str) -> InputError:
    """Return an error about a place in a job file that was read before."""
    line = TomlPlaces(path.read_text(encoding="utf-8-sig")).locate(where).line
    key = ".".join(part for part in where if isinstance(part, str))
    return error_at(path, line, f"{key}: {said}")


def _problem(detail: ErrorDetails) -> str:
    """Return the words about what was expected, what came and what to do."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == FAULT:
        if "said" in context:
            return str(context["said"])
        got = context["got"] or _shown(value)
        return f"expected {context['expected']}, got {got}; {context['remedy']}"
    table, keys = _table_of([part for part in detail["loc"] if isinstance(part, str)])
    header = f"[[{table}]]" if table in REPEATED else f"[{table}]"
    if kind == "extra_forbidden":
        known = TABLES[table].model_fields if keys else [t for t in TABLES if "." not in t]
        holder = f"a key of {header}" if keys else "a known table"
        unknown = keys[0] if keys else table
        return f"expected {holder}, got an unknown name; {nearest(unknown, known)}"
    if not keys:
        if kind == "tuple_type" and isinstance(value, dict):
            return f"expected tables {header}, got a single one; write it as {header}"
        got = "none" if kind == "missing" else _shown(value)
        return f"expected a table {header}, got {got}; write its header and its keys"
    field = TABLES[table].model_fields[keys[0]]
    expected, example = field.description, f"{keys[0]} = {(field.examples or [''])[0]}"
    if kind == "missing":
        return f"expected {expected}, got nothing; add, for example, {example}"
    if kind == "literal_error":
        return f"expected {context['expected']}, got {_shown(value)}; write one of them"
    bound = context.get("le", context.get("ge"))
    if bound in (-LARGEST, LARGEST) or (bound == SMALLEST and value > 0):
        expected = f"{expected}, at {'most' if 'le' in context else 'least'} {bound:g}"
    last = detail["loc"][-1]
    number = f" as number {last + 1}" if isinstance(last, int) else ""
    return f"expected {expected}, got {_shown(value)}{number}; write, for example, {example}"


def _table_of(names: list[str]) -> tuple[str, list[str]]:
    """Return the innermost table that contains a place, and the remaining keys."""
    for n in range(len(names), 0, -1):
        if (table := ".".join(names[:n])) in TABLES:
            return table, names[n:]
    return names[0], names[1:]


def _shown(value: object) -> str:
    """Return a value in TOML notation, shortened."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        inside = ("..." if isinstance(v, dict | list) else _shown(v) for v in value[:_LONGEST])
        text = f"[{', '.join(inside)}]"
    elif isinstance(value, bool):
        text = str(value).lower()
    elif isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, date | datetime | time):
        text = value.isoformat()
    elif isinstance(value, int) and abs(value) >= 1e20:
        return "a number of more than 20 digits"
    else:
        text = str(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def error_at(path: Path, line: int | None, said: str) -> InputError:
    """Return an error with its place in front of the message."""
    return InputError(f"{path}: {said}" if line is None else f"{path}:{line}: {said}")


def all_of(found: Sequence[InputError]) -> InputError:
    """Return several faults of one job as one error: the first, and lines of the others."""
    first, *rest = found
    if not rest:
        return first
    others = [*first.others, *(line for one in rest for line in (str(one), *one.others))]
    return InputError(f"{first} (and {len(others)} more)", others)
