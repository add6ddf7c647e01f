"""Compile the kernels of the search over continuous gamma by a small search."""

from __future__ import annotations

import numpy as np

from kerfpath._arrays import freeze
from kerfpath.limits import Limits
from kerfpath.search._continuous import ContinuousSearch, Effort, GammaSamples
from kerfpath.search._problem import SearchProblem

__all__ = ["compile_search"]


def compile_search() -> None:
    """Compile the kernels of `ContinuousSearch` by a search of three nodes with 4 samples each."""
    nodes, samples, joints = 3, 4, 6
    sample = np.tile(np.arange(samples), nodes)
    q = np.zeros((nodes * samples, joints))
    q[:, -1] = sample
    ones = np.ones(joints)
    problem = SearchProblem(
        q=freeze(q),
        start=freeze(np.arange(0, len(q) + 1, samples)),
        dt=1.0,
        limits=Limits.of(ones, ones),
        endless=ones > 0,
    )
    on_grid = GammaSamples(
        sample=sample,
        variant=np.zeros_like(sample),
        posture=np.zeros_like(sample),
        samples=samples,
    )
    for _ in ContinuousSearch(problem, on_grid).paths(Effort(4, (0.1, 0.1))):
        pass
