"""The studio: a job seen, decided and watched in a browser; the library does all the work."""

from kerfpath.studio._serve import serve as serve
