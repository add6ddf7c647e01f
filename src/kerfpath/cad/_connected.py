"""Groups of things that pairs connect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kerfpath._arrays import Ints

__all__ = ["label_connected"]


def label_connected(pairs: NDArray[np.integer], count: int) -> Ints:
    """Return a number (count,) for each thing, the same for those that `pairs` (P, 2) connect."""
    ends = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
