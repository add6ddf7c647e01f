"""What the generated pages are written with."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

__all__ = ["code", "plain", "prose", "table"]

NAMES = re.compile(
    r"`[^`]+`"  # code already
    r"|(?<![\w-])--[a-z][a-z-]*"  # an option
    r"|\[{1,2}[a-z][\w.]*\]{1,2}"  # a table
    r"|\b[\w-]+\.(?:csv|html|json|md|mod|sqlite|toml)\b"  # a file
    r"|(?<![\w/])[\w./+-]*[a-z0-9]_[\w./+-]*\w"  # a key, or a path with one
)


def code(text: object) -> str:
    """Return a text as code."""
    return f"`{text}`"


def prose(text: str) -> str:
    """Return a text of a help or a data file as Markdown, the names in it as code."""
    marked = NAMES.sub(lambda found: found[0] if found[0][0] == "`" else code(found[0]), text)
    return marked.replace("<", r"\<")


def plain(text: str) -> str:
    """Return a text in which nothing is marked, however it may look."""
    return re.sub(r"([\\`*_\[\]<>])", r"\\\1", text)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; a cell is Markdown of one line."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", r"\|").replace("\n", " ") for cell in line) + " |"
        for line in lines
    )
