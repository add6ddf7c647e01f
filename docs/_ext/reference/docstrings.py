"""Docstrings in the manner of numpy, as Sphinx's autodoc is to read them."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config, NumpyDocstring
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]

CONFIG = Config(
    napoleon_use_param=False,
    napoleon_use_rtype=False,
    napoleon_custom_sections=[("Attributes", "params_style")],
)
NOT_MARKED = re.compile(r"(``.+?``)|\||(?<=\w)_(?!\w)|\*")
"""What marks something in reStructuredText, and nothing in a docstring of this house; or code."""


def _read(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """Rewrite a docstring in place; only those of classes and functions have sections."""
    lines[:] = [NOT_MARKED.sub(lambda found: found[1] or f"\\{found[0]}", line) for line in lines]
    if what in {"class", "exception", "function", "method"}:
        text = NumpyDocstring("\n".join(lines), CONFIG, app, what, name, thing, options)
        lines[:] = text.lines()


def _unknown(
    app: Sphinx, env: object, node: nodes.Element, content: nodes.Element
) -> nodes.Element | None:
    """Return a name between backticks as code where no page describes it: a parameter, a word."""
    return content if node["reftype"] == "obj" else None


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add both to Sphinx."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _read)
    app.connect("missing-reference", _unknown)
    return {"parallel_read_safe": True}
