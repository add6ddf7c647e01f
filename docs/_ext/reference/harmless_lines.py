"""The lines of programs that readers ignore, by language."""

from __future__ import annotations

from kerfpath.post.harmless import HARMLESS
from reference.markdown import code, table

__all__ = ["page"]


WHERE = {"": "", "head": "before the program", "data": "in the `.dat`"}


def page() -> str:
    """Return a table with an example of each kind of line and the reason."""
    rows = [
        (name, code(each.example), WHERE[each.where], each.why)
        for name, known in HARMLESS.items()
        for each in known
    ]
    return table(("language", "lines like", "where", "why"), rows)
