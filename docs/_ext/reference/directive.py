"""The Sphinx directive that lays a generated page: {generated} and the name of its module."""

from __future__ import annotations

from importlib import import_module

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]


class Generated(SphinxDirective):
    """The sections that a module of this package returns, in place of the directive.

    They begin with a heading: MyST lays sections ahead of what comes before the first of them.
    """

    required_arguments = 1
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the page, which is made again at each build: its source is code."""
        self.env.note_reread()
        name, *about = self.arguments
        text = import_module(f"reference.{name}").page(*about)
        made: list[nodes.Node] = self.parse_text_to_nodes(text, allow_section_headings=True)
        return made


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive to Sphinx."""
    app.add_directive("generated", Generated)
    return {"parallel_read_safe": True}
