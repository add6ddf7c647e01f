"""The keys of a job, from the tables that read them: what each takes, an example, the default."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Literal, get_args, get_origin

import tomlkit
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from kerfpath.job.format.tables import REPEATED, TABLES, JobFile
from kerfpath.post import languages
from reference.markdown import code, prose, table

__all__ = ["page"]


def page() -> str:
    """Return a section on every table: those of a job in the order of the file, then languages."""
    parts = []
    for top, field in JobFile.model_fields.items():
        for name in (top, *(name for name in TABLES if name.startswith(f"{top}."))):
            head = f"[[{name}]]" if name in REPEATED else f"[{name}]"
            needed = ["Every job has it."] if name == top and field.is_required() else []
            parts += [f"## {code(head)}", _about(TABLES[name]), *needed, _keys(name, TABLES[name])]
    for name, language in languages().items():
        settings = language.settings
        parts += [f"## {code(f'[program.{name}]')}", _about(settings), _keys(name, settings)]
    return "\n\n".join(parts)


def _about(model: type[BaseModel]) -> str:
    """Return what a table is, in the words of its class, which may begin with its name."""
    said = re.sub(r"^\[.*?\]: ", "", (model.__doc__ or "").partition("\n\n")[0])
    return prose(said[0].upper() + said[1:])


def _keys(name: str, model: type[BaseModel]) -> str:
    """Return one row for each key of a table."""
    rows = list(_rows(name, model.model_fields))
    return table(["key", "takes", "for example", "default"], rows) if rows else "It has no keys."


def _rows(name: str, fields: Mapping[str, FieldInfo]) -> Iterator[list[str]]:
    for key, field in fields.items():
        inner = f"{name}.{key}"
        if inner in TABLES:
            takes = "tables, below" if inner in REPEATED else "a table, below"
            yield [code(key), takes, "", ""]
            continue
        yield [
            code(key),
            _takes(field),
            ", ".join(map(code, field.examples or ())),
            "required" if field.is_required() else _default(field),
        ]


def _default(field: FieldInfo) -> str:
    """Return the default of a key that has one."""
    value = field.get_default(call_default_factory=True)
    return "" if value in (None, ()) else code(_toml(value))


def _takes(field: FieldInfo) -> str:
    """Return what a message says was expected, and the words that the key takes."""
    expected, words = field.description or "", list(_words(field.annotation))
    if all(word in expected for word in words):
        return prose(expected)
    said = ", ".join(code(_toml(word)) for word in words)
    return f"{prose(expected)}: {said}" if expected else said


def _words(annotation: object) -> Iterator[str]:
    """Yield the words of every Literal in an annotation."""
    for inner in get_args(annotation):
        if get_origin(annotation) is not Literal:
            yield from _words(inner)
        elif isinstance(inner, str):
            yield inner


def _toml(value: object) -> str:
    return tomlkit.item(value).as_string()
