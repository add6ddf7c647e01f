"""The shortest moves of the controllers, by language."""

from __future__ import annotations

from kerfpath.post.languages import languages
from reference.markdown import table

__all__ = ["page"]


def page() -> str:
    """Return a table of the shortest moves that are assumed, as times and at two speeds."""
    rows = []
    for name, language in languages().items():
        controller = language.controller()
        if controller.shortest > 0:
            lengths = [f"{v * controller.shortest / 60 * 1e3:.2g} mm" for v in (2, 10)]
            cycle = (
                f", whole multiples of {controller.cycle * 1e3:g} ms" if controller.cycle else ""
            )
            rows.append((name, f"{controller.shortest * 1e3:g} ms{cycle}", *lengths))
    return table(("language", "assumed", "at 2 m/min", "at 10 m/min"), rows)
