"""Very many nodes: sections of a motion are moved one after another, while their ends are held.

A program of all nodes takes time that grows faster than their number. The limits join only a few
successive nodes, so that a section may move freely between held nodes: the limits at and beside
its ends are among its own, and what it gains, the whole motion gains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kerfpath.arrays import Array
from kerfpath.refiner.descent import Descent, MotionState

MANY = 800
"""Nodes from which a motion is moved in sections, if it may be: below, one program is as fast."""
NODES = 400
"""Nodes of a section in the first sweep: enough that a program costs more than its preparation. In
each further sweep sections have twice as many, as those that the first leaves outside the limits
accelerate as much as they may over hundreds of nodes."""
OVERLAP = 80
"""Nodes that successive sections share, so that no end stays where it was."""
MOST_SWEEPS = 6
"""Most times that sections are moved; most of them move in the first two alone."""
SAME = 1e-5
"""Relative gain of a section below which it counts as unmoved."""
PROGRAMS = 8
"""Most programs of a section in one sweep."""
BENDS = 1e3
"""Largest change of gamma at first, in changes of an increment that (6) allows: a program keeps
these to some 1e-8 of the largest change, and needs no larger one where nodes are so close."""


def has_sections(descent: Descent, least: float) -> bool:
    """Return whether a motion is moved in sections; otherwise programs of all nodes move it.

    It has very many nodes, and it is close to the best one, as a bound `least` from fewer nodes
    tells: sections do not reach what must move along many of them, as motions do with the Chebychev
    metric. Limits and cost join successive nodes alone: a largest distance, a periodic closure and
    a limited rotation join all nodes.
    """
    return (
        len(descent.low) >= MANY
        and least > 0
        and descent.objective == "sum"
        and descent.metric != "chebychev"
        and not descent.rates.periodic
        and not np.isfinite(descent.rotation).any()
    )


def lowest_in_sections(
    descent: Descent, start: MotionState, enough: float
) -> tuple[MotionState, int]:
    """Return the best motion that sections find from a start, and the number of programs.

    They are not moved once the cost is no more than `enough`. If the start is not admissible and
    no section makes it so, neither is the result.
    """
    at, programs = start, 0
    moved = np.ones(len(start.free), np.bool_)
    for sweep in range(MOST_SWEEPS):
        if not moved.any() or (at.admitted and at.cost <= enough):
            break
        free, q = at.free.copy(), at.q.copy()
        before, moved = moved, np.zeros_like(moved)
        for first, last in _sections(len(free), NODES << sweep):
            nodes = slice(first, last + 1)
            if not before[nodes].any():
                continue
            part, begun = _section(descent, free, q, first, last)
            found, more = part.best(begun) if begun.admitted else part.admitted(begun)
            programs += more
            if found.admitted or (found.outside <= 0 and found.excess < begun.excess):
                free[nodes], q[nodes] = found.free, found.q
            gained = begun.cost - found.cost
            moved[nodes] |= not begun.admitted or gained > SAME * begun.cost
        at = descent.stand(free, q)
    return at, programs


def _sections(nodes: int, size: int) -> Iterator[tuple[int, int]]:
    """Yield the first and the last node of each section; the last has up to half as many more."""
    first, last = 0, size
    while last + size // 2 < nodes:
        yield first, last
        first = last - OVERLAP
        last = first + size
    yield first, nodes - 1


def _section(
    descent: Descent, free: Array, q: Array, first: int, last: int
) -> tuple[Descent, MotionState]:
    """Return the descent of nodes `first` to `last`, held at its inner ends, and its start.

    As many nodes are held as a limit joins with a free one.
    """
    nodes, ends = slice(first, last + 1), (first > 0, last < len(free) - 1)
    count = 2 if descent.rates.limits.jerk is None else 3
    held = np.zeros(last + 1 - first, np.bool_)
    held[:count], held[-count:] = ends
    here = free[nodes]
    low, high = (np.where(held[:, None], here, x[nodes]) for x in (descent.low, descent.high))
    rates = descent.rates.part(first, last)
    bend = float((rates.limits.acceleration.usable * rates.tau.min() ** 2).min())
    part = replace(
        descent,
        curves=descent.curves.part(nodes),
        rates=rates,
        low=low,
        high=high,
        node_cost=None,
        held=None if descent.held is None else descent.held[first:last],
        first=None,
        radius=min(descent.first or descent.radius, BENDS * bend),
        most=min(descent.most, PROGRAMS),
    )
    return part, part.stand(here, q[nodes])
