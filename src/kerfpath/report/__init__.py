"""Self-contained HTML pages of a job, a drawing, a Pareto set, a layout, or a single table."""

from kerfpath._extras import require_extra

require_extra("report", "reports")

from kerfpath.report._drawing import DrawnLoop, render_drawing
from kerfpath.report._front import FrontAxis, FrontPlan
from kerfpath.report._front_page import render_front
from kerfpath.report._html import with_library, without_library
from kerfpath.report._layout import render_layout
from kerfpath.report._layout_entry import LayoutEntry
from kerfpath.report._look import reason_colours
from kerfpath.report._map import feasibility_map, hidden_postures, shown_postures
from kerfpath.report._motion import plot
from kerfpath.report._page import render
from kerfpath.report._section import ContourSection, add_clearance
from kerfpath.report._table_page import render_table

__all__ = [
    "ContourSection",
    "DrawnLoop",
    "FrontAxis",
    "FrontPlan",
    "LayoutEntry",
    "add_clearance",
    "feasibility_map",
    "hidden_postures",
    "plot",
    "reason_colours",
    "render",
    "render_drawing",
    "render_front",
    "render_layout",
    "render_table",
    "shown_postures",
    "with_library",
    "without_library",
]
