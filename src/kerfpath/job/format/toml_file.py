"""TOML files: read into tables or refused in one line that names the place; values written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from kerfpath.cad import SUFFIXES
from kerfpath.errors import InputError
from kerfpath.job.format.faults import error_at, refusal_at
from kerfpath.text import NOT_TEXT, named

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
    try:
        return raw.decode("utf-8-sig")  # some editors begin a UTF-8 file with a byte order mark
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise error_at(
            path,
            line,
            f"expected UTF-8 text, got the byte 0x{raw[error.start]:02x}; save the file as UTF-8",
        ) from None


def _require_text(path: Path, text: str, tables: Mapping[str, Any]) -> None:
    """Raise InputError for a character without a glyph in the file, or in a string of it."""
    if (found := NOT_TEXT.search(text)) is not None:
        line = text.count("\n", 0, found.start()) + 1
        raise error_at(path, line, f"expected text, got {named(found[0])}; remove it")

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
