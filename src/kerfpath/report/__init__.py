"""The report: one self-contained HTML page about a planned and audited job, and its figures."""

from kerfpath.report._map import feasibility_map
from kerfpath.report._page import render
from kerfpath.report._section import ContourSection

__all__ = ["ContourSection", "feasibility_map", "render"]
