"""Self-contained HTML pages: a job, a drawing, a Pareto set, a layout, a run, a fit, a table."""

from kerfpath.extras import require_extra

require_extra("report", "reports")

from kerfpath.report.drawing import DrawnLoop, render_drawing
from kerfpath.report.executed import ExecutedPath, PowerPath
from kerfpath.report.front import FrontAxis, FrontPlan, render_front
from kerfpath.report.layout import LayoutEntry, render_layout
from kerfpath.report.maps import feasibility_map, hidden_postures, shown_postures
from kerfpath.report.motion import plot
from kerfpath.report.page import render_table, with_library, without_library
from kerfpath.report.plan import render
from kerfpath.report.runs import FittedCut, render_controller_run, render_fit
from kerfpath.report.section import ContourSection, add_clearance
from kerfpath.report.style import reason_colours

__all__ = [
    "ContourSection",
    "DrawnLoop",
    "ExecutedPath",
    "FittedCut",
    "FrontAxis",
    "FrontPlan",
    "LayoutEntry",
    "PowerPath",
    "add_clearance",
    "feasibility_map",
    "hidden_postures",
    "plot",
    "reason_colours",
    "render",
    "render_controller_run",
    "render_drawing",
    "render_fit",
    "render_front",
    "render_layout",
    "render_table",
    "shown_postures",
    "with_library",
    "without_library",
]
