"""TOML files: read into tables or refused in one line that names the place; values written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tree_sitter_toml
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from tree_sitter import Language, Node, Parser

from kerfpath.cad import SUFFIXES
from kerfpath.errors import InputError
from kerfpath.job.format.tables import (
    REPEATED,
    TABLES,
)
from kerfpath.job.format.tables.table import FAULT, LARGEST, SMALLEST, example, nearest
from kerfpath.text import NOT_TEXT, named

# -----------------------------------------------------------------------------
# Locate keys and values in a TOML text, so that messages can name their line.

_TOML = Language(tree_sitter_toml.language())
_HEADERS = ("table", "table_array_element")
_KEYS = ("bare_key", "quoted_key", "dotted_key")
_VALUES = (
    "array",
    "boolean",
    "float",
    "inline_table",
    "integer",
    "local_date",
    "local_date_time",
    "local_time",
    "offset_date_time",
    "string",
)


class Position(NamedTuple):
    """Line and column (in characters) in a text, both counted from 1."""

    line: int
    column: int


@dataclass
class _Place:
    """One table, array or value: the node it starts at, and what lies inside it by key or index."""

    node: Node
    inside: dict[str | int, _Place] = field(default_factory=dict)
    is_array_of_tables: bool = False

    def reach(self, keys: Iterable[str], node: Node) -> _Place:
        """Return the place at `keys` below this one; new tables on the way start at `node`."""
        place = self.latest()
        for key in keys:
            place = place.inside.setdefault(key, _Place(node)).latest()
        return place

    def latest(self) -> _Place:
        """Return what further keys refer to: of an array of tables its last element, as in TOML."""
        return self.inside[len(self.inside) - 1] if self.is_array_of_tables else self


class TomlPlaces:
    """The places of all keys and values of a TOML document.

    Parameters
    ----------
    text : str
        A valid TOML document.
    """

    def __init__(self, text: str) -> None:
        source = text.encode()
        self._lines = source.split(b"\n")
        self._root = _tree(source)

    def locate(self, where: Sequence[str | int]) -> Position:
        """Return the position of the item at `where`, or of the table that should hold it.

        Parameters
        ----------
        where : sequence of str and int
            Keys, and indices from 0, from the document down: ``("contour", 1, "speed_m_min")``.
            A key is located at its start, an array element at its value, a table at its header,
            and a table that is missing at line 1.
        """
        place = self._root
        row, column = 0, 0
        for step in where:
            if step not in place.inside:
                break
            place = place.inside[step]
            row, column = place.node.start_point
        before = self._lines[row][:column].decode(errors="replace")
        return Position(row + 1, len(before) + 1)


def _tree(source: bytes) -> _Place:
    """Return the places of the whole document."""
    document = Parser(_TOML).parse(source).root_node
    root = _Place(document)
    waiting = [(document, root)]
    while waiting:  # no recursion: a document may nest deeper than Python's stack
        node, place = waiting.pop()
        for child, where in _children(node, place, root):
            waiting.append((child, where))
    return root


def _children(node: Node, place: _Place, root: _Place) -> Iterator[tuple[Node, _Place]]:
    """Yield the tables and values directly inside `node` with their places, made on the way."""
    if node.type == "document":
        for child in node.named_children:
            if child.type == "pair":
                yield from _children(child, root, root)
            elif child.type in _HEADERS:
                # A table's pairs belong to the element that is the last one now, not later.
                here = _open_table(child, root)
                for pair in child.named_children:
                    if pair.type == "pair":
                        yield from _children(pair, here, root)
    elif node.type == "pair":
        key = next((c for c in node.named_children if c.type in _KEYS), None)
        value = next((c for c in node.named_children if c.type in _VALUES), None)
        if key is not None and value is not None:
            yield value, place.reach(_keys(key), node)
    elif node.type == "array":
        elements = (c for c in node.named_children if c.type in _VALUES)
        for i, element in enumerate(elements):
            yield element, place.inside.setdefault(i, _Place(element))
    elif node.type == "inline_table":
        for pair in node.named_children:
            if pair.type == "pair":
                yield from _children(pair, place, root)


def _open_table(header: Node, root: _Place) -> _Place:
    """Return the place of the table that `header` opens."""
    key = next((c for c in header.named_children if c.type in _KEYS), None)
    if key is None:
        return _Place(header)
    *above, last = _keys(key)
    parent = root.reach(above, header)
    if header.type == "table":
        place = parent.inside.setdefault(last, _Place(header))
        place.node = header  # a sub-table may have named it earlier; its own header wins
        return place
    tables = parent.inside.setdefault(last, _Place(header))
    tables.is_array_of_tables = True
    return tables.inside.setdefault(len(tables.inside), _Place(header))


def _keys(key: Node) -> list[str]:
    """Return the parts of a bare, quoted or dotted key, read by TOML's own rules."""
    text = (key.text or b"").decode()
    if key.type == "bare_key":
        return [text]
    found, keys = tomllib.loads(f"{text} = 0"), []
    while isinstance(found, dict):
        ((name, found),) = found.items()
        keys.append(name)
    return keys


# -----------------------------------------------------------------------------
# One-line messages about faults in a job file: place, key, expected, got, what to do.

Tables = Mapping[str, type[BaseModel]]
"""The model of each table of a file, by its dotted name; "" has the keys outside of tables."""
_LONGEST = 60
"""Characters of a wrong value that a message shows."""


def refusal(path: Path, text: str, error: ValidationError, tables: Tables = TABLES) -> InputError:
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
        problems.append((order, f"{key}: {_problem(detail, tables)}"))
    return all_of([error_at(path, place[1], said) for place, said in sorted(problems)])


def refusal_at(path: Path, where: Sequence[str | int], said: str) -> InputError:
    """Return an error about a place in a job file that was read before."""
    line = TomlPlaces(path.read_text(encoding="utf-8-sig")).locate(where).line
    key = ".".join(part for part in where if isinstance(part, str))
    return error_at(path, line, f"{key}: {said}")


def _problem(detail: ErrorDetails, tables: Tables) -> str:
    """Return the words about what was expected, what came and what to do."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == FAULT:
        if "said" in context:
            return str(context["said"])
        got = context["got"] or _shown(value)
        return f"expected {context['expected']}, got {got}; {context['remedy']}"
    table, keys = _table_of([part for part in detail["loc"] if isinstance(part, str)], tables)
    header = f"[[{table}]]" if table in REPEATED else f"[{table}]" if table else "the file"
    if kind == "extra_forbidden":
        known = tables[table].model_fields if keys else [t for t in tables if "." not in t]
        holder = f"a key of {header}" if keys else "a known table"
        unknown = keys[0] if keys else table
        return f"expected {holder}, got an unknown name; {nearest(unknown, known)}"
    if not keys:
        if kind == "tuple_type" and isinstance(value, dict):
            return f"expected tables {header}, got a single one; write it as {header}"
        got = "none" if kind == "missing" else _shown(value)
        return f"expected a table {header}, got {got}; write its header and its keys"
    field = tables[table].model_fields[keys[0]]
    expected, line = field.description, example(tables[table], keys[0])
    if kind == "missing":
        return f"expected {expected}, got nothing; add, for example, {line}"
    if kind == "literal_error":
        return f"expected {context['expected']}, got {_shown(value)}; write one of them"
    bound = context.get("le", context.get("ge"))
    if bound in (-LARGEST, LARGEST) or (bound == SMALLEST and value > 0):
        expected = f"{expected}, at {'most' if 'le' in context else 'least'} {bound:g}"
    last = detail["loc"][-1]
    number = f" as number {last + 1}" if isinstance(last, int) else ""
    return f"expected {expected}, got {_shown(value)}{number}; write, for example, {line}"


def _table_of(names: list[str], tables: Tables) -> tuple[str, list[str]]:
    """Return the innermost table that contains a place, and the remaining keys."""
    for n in range(len(names), 0, -1):
        if (table := ".".join(names[:n])) in tables:
            return table, names[n:]
    return ("", names) if "" in tables else (names[0], names[1:])


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
    others = [*first.others, *(line for one in rest for line in (one.message, *one.others))]
    return InputError(first.message, others)


# -----------------------------------------------------------------------------
# TOML files: read into tables or refused in one line that names the place; values written.

MOST_TEXT = 10_000_000
"""Largest file, in characters; enough for many thousand contours."""
NOT_IN_STRINGS = re.compile(rf"{NOT_TEXT.pattern}|[\t\r\n]")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_DOTTED = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){33}")


def read_text(path: Path, what: str) -> str:
    """Return the text of a file in UTF-8; `what` it should be, "a job file", is for messages.

    Raises
    ------
    InputError
        The file cannot be read, or is not text in UTF-8.
    """
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is not None and path.is_file():
        said = f"expected {what}, got a drawing ({kind}); write a first job for it: "
        raise error_at(path, None, f"{said}kerfpath new {path}")
    try:
        endless = path.exists() and not (path.is_file() or path.is_dir())  # a device
        raw = b"" if endless else path.read_bytes()
    except IsADirectoryError:
        raise error_at(path, None, f"expected {what}, got a folder; name a file in it") from None
    except FileNotFoundError:
        raise error_at(path, None, f"no such file; give the path of {what}") from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise error_at(path, None, f"cannot be read ({why}); give the path of {what}") from None
    if endless:
        raise error_at(path, None, f"is not a file; give the path of {what}")
    return decoded(path, raw)


def decoded(path: Path, raw: bytes) -> str:
    """Return the text that a file in UTF-8 holds, or raise InputError at the line that is none."""
    try:
        return raw.decode("utf-8-sig")  # some editors begin a UTF-8 file with a byte order mark
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        said = f"expected UTF-8 text, got the byte 0x{raw[error.start]:02x}"
        raise error_at(path, line, f"{said}; save the file as UTF-8") from None


def require_glyphs(path: Path, text: str) -> None:
    """Raise InputError for a character without a glyph in a file."""
    if (found := NOT_TEXT.search(text)) is not None:
        line = text.count("\n", 0, found.start()) + 1
        raise error_at(path, line, f"expected text, got {named(found[0])}; remove it")


def _require_text(path: Path, text: str, tables: Mapping[str, Any]) -> None:
    """Raise InputError for a character without a glyph in the file, or in a string of it."""
    require_glyphs(path, text)

    def look(value: Any, key: tuple[str | int, ...]) -> None:
        if isinstance(value, dict | list):
            inner = value.items() if isinstance(value, dict) else enumerate(value)
            for each, its in inner:
                look(its, (*key, each))
                if isinstance(each, str):
                    look_at(each, (*key, each))
        elif isinstance(value, str):
            look_at(value, key)

    def look_at(value: str, key: tuple[str | int, ...]) -> None:
        if (found := NOT_IN_STRINGS.search(value)) is not None:
            raise refusal_at(
                path, key, f"expected one line of text, got {named(found[0])}; remove it"
            )

    look(tables, ())


def read_tables(path: Path, text: str, what: str, needed: str) -> dict[str, Any]:
    """Return the tables of a TOML text; an empty one lacks what is `needed`.

    Raises
    ------
    InputError
        The text is too long, empty or not valid TOML, or has a character without a glyph.
    """
    if len(text) > MOST_TEXT:
        raise error_at(
            path,
            None,
            f"expected {what} of at most {MOST_TEXT / 1e6:.0f} MB, got "
            f"{len(text) / 1e6:.0f} MB; give the path of {what}",
        )
    # The time that the TOML parser takes grows with the square of the number of parts.
    if (dotted := _DOTTED.search(text)) is not None:
        line = text.count("\n", 0, dotted.start()) + 1
        owner = what.removesuffix(" file")
        said = f"expected a key of {owner}, got one with too many dotted parts"
        raise error_at(path, line, said)
    try:
        tables = tomllib.loads(text)
        _require_text(path, text, tables)
    except RecursionError:
        raise error_at(path, None, "arrays or tables are nested too deeply; flatten them") from None
    except tomllib.TOMLDecodeError as error:
        said = str(error)
        at = re.search(r" \(at line (\d+), column \d+\)$", said)
        line = int(at[1]) if at else text.rstrip("\n").count("\n") + 1
        raise error_at(path, line, f"not valid TOML: {said}; correct it there") from None
    except InputError:
        raise
    except ValueError:  # what Python's int() refuses
        raise error_at(path, None, "not valid TOML: an integer is too long; shorten it") from None
    if not tables:
        raise error_at(path, 1, f"expected {needed}, got an empty file; add them")
    return tables


def toml_lines(table: Mapping[str, object]) -> str:
    """Return the lines of a table, each `key = value`."""
    return "".join(f"{_toml_key(key)} = {toml_value(value)}\n" for key, value in table.items())


def toml_value(value: object) -> str:
    """Return a value as TOML writes it, on one line; numbers to ten digits."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_lines(value).split("\n")[:-1]) + " }"
    if isinstance(value, (list, tuple, np.ndarray)):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, (bool, str)):
        return json.dumps(value, ensure_ascii=False)
    return f"{value:.10g}"


def _toml_key(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key, ensure_ascii=False)
