"""The searches, asked by the flat keywords that random instances come in."""

from kerfpath import shortest_path
from kerfpath.limits import Limits
from kerfpath.search import (
    SearchProblem,
    find_clear,
    find_interrupted,
    find_least_interval,
    find_relaxations,
    find_shortest,
    find_slowed,
)

LIMITS = ("velocity", "acceleration", "eta_v", "eta_a")


def problem_of(q, start, *, dt=1.0, **options):
    """Return the problem of a graph with its limits and shares given one by one."""
    limits = Limits.of(**{name: options.pop(name) for name in LIMITS if name in options})
    return SearchProblem(q=q, start=start, dt=dt, limits=limits, **options)


def slowed_path(q, start, *, penalty=100.0, **options):
    return find_slowed(problem_of(q, start, **options), penalty=penalty)


def interrupted_path(q, start, *, s=None, least_piece=None, **options):
    return find_interrupted(problem_of(q, start, **options), s=s, least_piece=least_piece)


def least_interval(q, start, **options):
    return find_least_interval(problem_of(q, start, **options))


def least_relaxations(q, start, **options):
    return find_relaxations(problem_of(q, start, **options))


FIND = {
    shortest_path: find_shortest,
    slowed_path: find_slowed,
    interrupted_path: find_interrupted,
    least_interval: find_least_interval,
}


def clear_path(search, known, **options):
    return find_clear(FIND[search], problem_of(known.q, known.start, **options), known)
