"""The states that another program may have left, and what sets them, by language."""

from __future__ import annotations

from kerfpath.post.languages import languages
from reference.markdown import code, table

__all__ = ["page"]


def page() -> str:
    """Return a table of the states of each language, the lines that set them, and the reason."""
    rows = [
        (name, each.state, " ".join(map(code, each.lines)) or "nothing", each.why)
        for name, language in languages().items()
        for each in language.inherited(language.settings())
    ]
    return table(("language", "state", "set by", "why"), rows)
