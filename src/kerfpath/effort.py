"""How hard to try: the limits on the work of searches and proofs, in one object."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError

__all__ = [
    "Effort",
    "changed_effort",
    "current_effort",
    "set_effort",
    "thread_count",
    "uncollected",
]

MOST_THREADS = 1024
"""Largest number of threads that may be asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """Limits on the work of searches and proofs; what a result claims holds with any of them.

    Parameters
    ----------
    certified : bool
        Whether plans are certified unless their options say otherwise.
    explored : bool
        Whether all valleys are explored where value function or bound leave room for a better
        motion; else wider beam searches follow.
    worth_exploring : float
        Relative gap of a motion to the value function, which leaves limits of acceleration out,
        beyond which all valleys are explored; half of it where that is between samples of gamma. A
        job of many contours raises it.
    certificate_pairs, certificate_pairs_per_node : int
        Most steps from cell to cell in a certificate, in all and in addition for each node, unless
        a time is given.
    minimax_pairs : int
        Most steps from cell to cell that a bound on the costliest step takes, unless a time is
        given.
    infeasibility_steps, infeasibility_pairs : int
        Most steps between cells in one round, and most pairs of steps in all, before a proof that
        no motion exists ends undecided.
    infeasibility_tubes : int
        Most tubes into which motions are divided in such a proof.
    binding_nodes : int
        Most nodes around which a speed is tested for being impossible.
    speed_factors : tuple of float
        Multiples of the speed reached at which beam searches look for a quicker motion. If no
        motion is as quick, they keep (6) as far as they can, and end in another local optimum.
    exact_edges : int
        Most edges with which the fastest path is searched exactly, in at most some ten seconds.
    recorded_states : int
        Most states that an exact search under a loose bound may remember: 8 bytes each.
    subsampled_from : int
        Number of intervals from which on a motion is first planned along every few nodes, divided
        by the number of free variables at a node (gamma and the joints that a pose leaves free).
        The closer the nodes, the less an increment may change by (6), compared with the samples of
        gamma: paths through these become poor, and their refinement takes long and may end in
        another optimum.
    """

    certified: bool = True
    explored: bool = True
    worth_exploring: float = 1e-2
    certificate_pairs: int = 10_000_000
    certificate_pairs_per_node: int = 60_000
    minimax_pairs: int = 3_000_000
    infeasibility_steps: int = 2_000_000
    infeasibility_pairs: int = 30_000_000
    infeasibility_tubes: int = 400
    binding_nodes: int = 12
    speed_factors: tuple[float, ...] = (1.06, 1.0, 1.1)
    exact_edges: int = 20_000_000
    recorded_states: int = 10_000_000
    subsampled_from: int = 800

    __repr__ = short_repr


_current = Effort()


def current_effort() -> Effort:
    """Return the effort of this process and its threads."""
    return _current


def set_effort(effort: Effort) -> None:
    """Set the effort of this process and its threads; workers of a sweep take it over."""
    global _current
    _current = effort


@contextmanager
def changed_effort(**limits: Any) -> Iterator[None]:
    """Change some limits, named as in `Effort`, until the block ends."""
    before = _current
    set_effort(replace(before, **limits))
    try:
        yield
    finally:
        set_effort(before)


@contextmanager
def uncollected() -> Iterator[None]:
    """Pause garbage collection while very many objects without cycles are created."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def thread_count() -> int:
    """Return the number of threads of a search: NUMBA_NUM_THREADS, or one per core.

    Raises
    ------
    InputError
        The variable is not a whole number from 1 on.
    """
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if not asked:
        return os.cpu_count() or 1
    if not asked.isdecimal() or not 1 <= int(asked) <= MOST_THREADS:
        raise InputError(
            f"NUMBA_NUM_THREADS: expected a whole number from 1 to {MOST_THREADS}, got {asked!r}; "
            "correct or unset it"
        )
    return int(asked)
