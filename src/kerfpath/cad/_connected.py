"""Connected groups of numbered things."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from kerfpath._arrays import Ints

__all__ = ["label_connected"]


def label_connected(pairs: NDArray[np.integer], count: int) -> Ints:
    """Return a group number (count,) for each thing, equal for those joined by `pairs` (P, 2)."""
    ends = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int64)
