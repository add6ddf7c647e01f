"""Plans on request, as JSON over a pipe: for programs whose own Python cannot have kerfpath."""

from kerfpath.pipe.answer import answer as answer
