"""The skeleton of an HTML page, and the figures packed into it."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from html import escape
from importlib.resources import files

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

__all__ = [
    "Figures",
    "facts_list",
    "header",
    "job_part",
    "page",
    "with_library",
    "without_library",
]

_SKELETON = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="kerfpath">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
</main>
{data}
{library}
<script>
{script}</script>
</body>
</html>
"""

_LEAN = '<script src="plotly.js"></script>'
"""Stands in place of the library; text from outside is escaped and cannot look like it."""


class Figures:
    """The figures of a page: each is packed once, and drawn when its section is first opened."""

    def __init__(self) -> None:
        self.data: list[str] = []

    def place(self, figure: go.Figure, kind: str) -> str:
        """Pack `figure` and return the element that it is drawn into."""
        number = len(self.data) + 1
        # A map of 1500 x 360 x 8 codes has long runs: compression keeps a report with many small.
        packed = base64.b64encode(zlib.compress(figure.to_json().encode(), 9)).decode()
        self.data.append(
            f'<script type="application/octet-stream" id="figure-{number}">{packed}</script>'
        )
        return (
            f'<div class="figure {kind}" data-figure="figure-{number}" '
            f'style="min-height:{figure.layout.height}px"></div>'
        )


def header(
    kind: str,
    title: str,
    *,
    facts: Sequence[tuple[str, str]],
    notes: Sequence[str],
    verdict: str = "",
    tools: str = "",
) -> str:
    """Return the head of a page: its kind, title, verdict (HTML), facts and notes.

    `tools` (HTML) is placed beside the title.
    """
    parts = [
        "<header>",
        tools,
        f'<p class="kind">{escape(kind)}</p>',
        f"<h1>{escape(title)}</h1>",
        verdict,
        facts_list(facts),
        "".join(f'<p class="note"><b>Note</b> {escape(note)}</p>' for note in notes),
        "</header>",
    ]
    return "\n".join(part for part in parts if part)


def facts_list(facts: Sequence[tuple[str, str]]) -> str:
    """Return the facts as a definition list."""
    rows = "".join(
        f"<div><dt>{escape(what)}</dt><dd>{escape(value)}</dd></div>" for what, value in facts
    )
    return f'<dl class="facts">{rows}</dl>' if rows else ""


def job_part(text: str) -> str:
    """Return the job file in a collapsible element; empty without a text."""
    if not text:
        return ""
    return (
        "<section><h2>Job</h2><details><summary><h3>Job file as read</h3></summary>"
        f"<pre>{escape(text)}</pre></details></section>"
    )


def page(title: str, body: Sequence[str], figures: Figures, *, also: str = "") -> str:
    """Return a self-contained page: its body in pieces of HTML, and the figures in it.

    `also` names a style sheet and a script that are added to those of every page.
    """
    names = ("page", also) if also else ("page",)
    return _SKELETON.format(
        title=escape(title),
        style="".join(_resource(f"{name}.css") for name in names),
        body="\n".join(part for part in body if part),
        data="\n".join(figures.data),
        library=_library() if figures.data else "",
        script="\n".join(_resource(f"{name}.js") for name in names),
    )


def without_library(text: str) -> str:
    """Return a page without the drawing library, which is most of its size, for storage."""
    return text.replace(_library(), _LEAN)


def with_library(text: str) -> str:
    """Return a page shortened by `without_library` with the library restored."""
    return text.replace(_LEAN, _library())


def _library() -> str:
    return f"<script>{get_plotlyjs()}</script>"


def _resource(name: str) -> str:
    return (files("kerfpath.report") / name).read_text(encoding="utf-8")
