"""The studio: show, edit and plan a job in a browser, with the functions of the library."""

from kerfpath.studio.server import serve as serve
