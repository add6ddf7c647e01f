"""A page with one table: the results of a study, row by row."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape
from importlib.metadata import version

from kerfpath.report._html import Figures, header, job_part, page
from kerfpath.report._tables import table, td

__all__ = ["render_table"]


def render_table(
    title: str,
    *,
    kind: str,
    heads: Sequence[tuple[str, str]],
    rows: Sequence[Sequence[str]],
    text_columns: Collection[int] = (0,),
    caption: str = "",
    facts: Sequence[tuple[str, str]] = (),
    notes: Sequence[str] = (),
    job_text: str = "",
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
    facts : sequence of (what, value)
    notes : sequence of str
    job_text : str
        The job file as read.
    """
    lines = [
        "<tr>"
        + "".join(
            f"<td>{escape(text)}</td>" if i in text_columns else td(escape(text))
            for i, text in enumerate(row)
        )
        + "</tr>"
        for row in rows
    ]
    body = [
        header(kind, title, facts=facts, notes=notes),
        f'<section><p class="caption">{escape(caption)}</p>' if caption else "<section>",
        table(heads, lines, text_columns=tuple(text_columns)),
        "</section>",
        job_part(job_text),
        f"<footer>kerfpath {escape(version('kerfpath'))}</footer>",
    ]
    return page(title, body, Figures())
