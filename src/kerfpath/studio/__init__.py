"""The studio: show, edit and plan a job in a browser, with the functions of the library."""

from kerfpath.studio._serve import serve as serve
