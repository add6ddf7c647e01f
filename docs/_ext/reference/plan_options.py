"""The planning options, from their declarations: name, what it takes, default and meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING
from typing import Literal, get_args, get_origin

from kerfpath.options import PlanOptions
from kerfpath.setting import Setting, settings
from reference.markdown import code, prose, table

__all__ = ["page"]


def page() -> str:
    """Return a row for each option, and for each part of one that has a key of its own."""
    heads = ["option", "key in `[plan]`", "takes", "default", "in plan.json", "meaning"]
    return table(heads, _rows())


def _rows() -> Iterator[list[str]]:
    for name, option in settings(PlanOptions).items():
        key = code(option.key) if option.takes is not None else ""
        takes = _takes(option) if key else ""
        yield [code(name), key, takes, _default(option), code(option.data), prose(option.help)]
        for inner, each in settings(option.kind).items():
            part = f"its {code(inner)}"
            yield [part, code(each.key), _takes(each), _default(each), "", prose(each.help)]


def _takes(each: Setting) -> str:
    words = get_args(each.takes) if get_origin(each.takes) is Literal else ()
    return ", ".join(map(code, words)) or prose(each.expected())


def _default(each: Setting) -> str:
    """Return the default of an option; the one in a job, too, if that is another."""
    if each.optional and callable(each.default):
        return "as below"
    plain = "none" if each.default in (None, MISSING, ()) else _word(each.default)
    unit = each.unit if isinstance(each.default, float) else ""
    other = each.in_jobs not in (None, each.default)
    return f"{plain} {unit}".strip() + (f"; in jobs {_word(each.in_jobs)}" if other else "")


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).lower()
