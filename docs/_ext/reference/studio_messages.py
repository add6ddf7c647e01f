"""The messages between the studio's server and its page: a section of the site, and types.

Both are made from the models of the messages. In `docs/_ext`, `python -m reference.studio_messages`
writes the types, which the checks of the page read; a test compares them.
"""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from kerfpath.studio import messages
from reference.markdown import code, table

__all__ = ["page", "types"]

TYPES = Path(__file__).parents[3] / "src" / "kerfpath" / "studio" / "client" / "messages.d.ts"
HEAD = """\
// The messages between server and page, made from kerfpath.studio.messages.
"""
NAMES = {str: "string", int: "number", float: "number", bool: "boolean", NoneType: "null"}
"""The types of the page by those of Python; any other one is checked by the server alone."""


def page() -> str:
    """Return one section for each side, with the keys of each of its messages."""
    asks, said = map(list, (_messages(messages.Request), _messages(messages.Said)))
    parts = ["## From the page", *map(_section, asks), "## From the server", *map(_section, said)]
    entries = [each for each in _models() if each not in {*asks, *said}]
    return "\n\n".join([*parts, "## Entries of messages", *map(_section, entries)])


def types() -> str:
    """Return the types of all messages in TypeScript."""
    unions = {"ServerMessage": messages.Said, "ClientMessage": messages.Request}
    parts = [_interface(model) for model in _models()]
    for name, union in unions.items():
        names = "".join(f"\n  | {model.__name__}" for model in _messages(union))
        parts.append(f"export type {name} ={names};\n")
    return "\n".join([HEAD, *parts])


def _messages(union: Any) -> tuple[type[BaseModel], ...]:
    return get_args(union)


def _models() -> Iterator[type[BaseModel]]:
    """Yield all models of the protocol, in the order of their definition."""
    for each in vars(messages).values():
        if inspect.isclass(each) and issubclass(each, BaseModel) and each.model_fields:
            yield each


def _section(model: type[BaseModel]) -> str:
    kinds = get_args(model.model_fields["type"].annotation) if "type" in model.model_fields else ()
    title = ", ".join(map(code, kinds)) or code(model.__name__)
    rows = [
        [code(name), code(_typescript(field.annotation)), _meanings(model).get(name, "")]
        for name, field in model.model_fields.items()
        if name != "type"
    ]
    keys = [table(["key", "type", "meaning"], rows)] if rows else []
    return "\n\n".join([f"### {title}", _one_line(model.__doc__), *keys])


def _interface(model: type[BaseModel]) -> str:
    lines = [f"/** {_one_line(model.__doc__)} */", f"export interface {model.__name__} {{"]
    for name, field in model.model_fields.items():
        meaning = _meanings(model).get(name)
        lines += [f"  /** {meaning} */"] if meaning else []
        optional = "?" if _may_be_missing(model, field) else ""
        lines.append(f"  {name}{optional}: {_typescript(field.annotation)};")
    return "\n".join([*lines, "}", ""])


def _may_be_missing(model: type[BaseModel], field: FieldInfo) -> bool:
    """Whether a page may leave a key out; the server sends all of them."""
    return not issubclass(model, messages.Message) and not field.is_required()


@cache
def _meanings(model: type[BaseModel]) -> dict[str, str]:
    """Return the texts below the fields of a model in its source."""
    (made,) = ast.parse(inspect.getsource(model)).body
    assert isinstance(made, ast.ClassDef)
    return {
        field.target.id: _one_line(ast.literal_eval(text.value))
        for field, text in zip(made.body, made.body[1:], strict=False)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant)
    }  # fmt: skip


def _one_line(text: str | None) -> str:
    return " ".join((text or "").split())


def _typescript(annotation: Any) -> str:
    """Return a type in TypeScript."""
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _typescript(inner[0])
    if origin is Literal:
        return " | ".join(json.dumps(word) for word in inner)
    if origin in (Union, UnionType):
        return " | ".join(dict.fromkeys(map(_typescript, inner)))
    if origin is dict:
        return f"Record<string, {_typescript(inner[1])}>"
    if origin is tuple and inner[-1] is not Ellipsis:
        return f"[{', '.join(map(_typescript, inner))}]"
    if origin in (list, tuple):
        item = _typescript(inner[0])
        return f"({item})[]" if " | " in item else f"{item}[]"
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return annotation.__name__
    return NAMES.get(annotation, "any")


if __name__ == "__main__":
    TYPES.write_text(types())
