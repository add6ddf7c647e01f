"""Self-contained HTML pages: a template of this package, its data, and the figures in it.

In a template, an indented line continues the one before: between words with a space, beside a tag
without one.
"""

from __future__ import annotations

import base64
import html
import math
import re
import zlib
from collections.abc import Collection, Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import TypedDict, Unpack

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from jinja2.ext import Extension
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from kerfpath.errors import printable

PASS, FAIL, WARN = "pass", "fail", "warn"
"""States of a verdict, which templates show by a sign and a colour."""
LEAN = '<script src="plotly.js"></script>'
"""Stands in place of the library; text from outside is escaped and cannot look like it."""
UNITS = {
    "m": (1e3, " mm"),
    "rad": (180.0 / math.pi, "°"),
    "m^3": (1.0, " m³"),
    "m/s": (60.0, " m/min"),
    "share": (100.0, " %"),
    "count": (1.0, ""),
}


class Figures:
    """The figures of a page: each is packed once, and drawn when its section is first opened."""

    def __init__(self) -> None:
        self.data: list[Markup] = []

    def place(self, figure: go.Figure, kind: str) -> Markup:
        """Pack `figure` and return the element that it is drawn into."""
        number = len(self.data) + 1
        # A map of 1500 x 360 x 8 codes has long runs: compression keeps a report with many small.
        packed = base64.b64encode(zlib.compress(figure.to_json().encode(), 9)).decode()
        self.data.append(
            Markup('<script type="application/octet-stream" id="figure-{}">{}</script>').format(
                number, packed
            )
        )
        return Markup(
            '<div class="figure {}" data-figure="figure-{}" style="min-height:{}px"></div>'
        ).format(kind, number, figure.layout.height)


class PageKeywords(TypedDict, total=False):
    """What every page may have: rows of (what, value), warnings, and the job file as read."""

    facts: Sequence[tuple[str, str]]
    notes: Sequence[str]
    job_text: str


def render_page(template: str, /, **data: object) -> str:
    """Return a page: a template filled with data; all texts among them are escaped.

    Every template needs `title` and `kind`, the heading and the kind of page above it; `facts` are
    rows of (what, value), `notes` are warnings, and `job_text` is the job file as read.
    """
    defaults = {"facts": (), "notes": (), "job_text": ""}
    return _templates.get_template(template).render(defaults | data, figures=Figures())


def render_table(
    title: str,
    *,
    kind: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[str]],
    text_columns: Collection[int] = (0,),
    caption: str = "",
    **page: Unpack[PageKeywords],
) -> str:
    """Return a self-contained HTML page with a table; the same input gives the same text.

    Parameters
    ----------
    title, kind : str
        Heading of the page, and the kind of page above it.
    heads : sequence of (title, unit)
    rows : sequence of sequence of str
        A text for each head.
    text_columns : collection of int
        Columns that are aligned left; the others are aligned right.
    caption : str
        Text above the table.
    **page
        As in `PageKeywords`.
    """
    return render_page(
        "table.html", title=title, kind=kind, heads=heads, rows=rows, text_columns=text_columns,
        caption=caption, **page,
    )  # fmt: skip


def number(value: float, digits: int) -> Markup:
    """Return `value` with `digits` decimals, or a word where it is not finite."""
    if math.isnan(value):
        return Markup("not a number")
    if math.isinf(value):
        return Markup("∞" if value > 0 else "&minus;∞")
    return with_minus(f"{value:.{digits}f}")


def quantity(value: float, unit: str) -> Markup:
    """Return `value` in the unit that is shown for `unit`, with four digits."""
    factor, suffix = UNITS[unit]
    scaled = value * factor
    if not math.isfinite(scaled) or unit == "count":
        return number(scaled, 0) + suffix
    if scaled and abs(scaled) < 1e-3:
        return with_minus(f"{scaled:.1e}") + suffix
    return with_minus(f"{scaled:.4g}") + suffix


def with_minus(text: str) -> Markup:
    """Return a number as HTML, with a minus sign in place of a hyphen."""
    return Markup(text.replace("-", "&minus;"))


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor from `unit` to the unit that is shown, and that unit."""
    return UNITS.get(unit, (1.0, f" {unit}" if unit else ""))


def without_library(text: str) -> str:
    """Return a page without the drawing library, which is most of its size, for storage."""
    return text.replace(_library(), LEAN)


def with_library(text: str) -> str:
    """Return a page shortened by `without_library` with the library restored."""
    return text.replace(LEAN, _library())


def _library() -> Markup:
    return Markup(f"<script>{get_plotlyjs()}</script>")


def _resource(name: str) -> Markup:
    return Markup((files("kerfpath.report") / name).read_text(encoding="utf-8"))


def _escaped(value: object) -> object:
    """Escape a value as `html` does, whose quotes differ from Jinja's, and what is no text."""
    if hasattr(value, "__html__"):
        return value
    return Markup(html.escape(printable(str(value), keep="\n\t")))


class _JoinLines(Extension):
    """Let an indented line continue the one before."""

    def preprocess(self, source: str, name: str | None, filename: str | None = None) -> str:
        return re.sub(r"\n +", " ", re.sub(r"(?:(?<=>)|(?<=%}))\n +|\n +(?=<|{%)", "", source))


_templates = Environment(
    loader=PackageLoader("kerfpath.report"),
    extensions=[_JoinLines],
    autoescape=True,
    finalize=_escaped,
    trim_blocks=True,
    keep_trailing_newline=True,
    undefined=StrictUndefined,
)
_templates.filters |= {"number": number, "quantity": quantity}
_templates.globals |= {
    "library": _library,
    "resource": _resource,
    "version": version("kerfpath"),
}
