"""Self-contained HTML pages: the report on a planned and audited job, and a drawing's loops."""

from kerfpath.report._drawing import DrawnLoop, render_drawing
from kerfpath.report._html import with_library, without_library
from kerfpath.report._map import feasibility_map
from kerfpath.report._page import render
from kerfpath.report._section import ContourSection

__all__ = [
    "ContourSection",
    "DrawnLoop",
    "feasibility_map",
    "render",
    "render_drawing",
    "with_library",
    "without_library",
]
