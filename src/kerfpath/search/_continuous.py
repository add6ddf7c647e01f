"""The first-order search over continuous gamma: values between the samples, and paths by them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Ints, integers
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import continuous as kernel
from kerfpath.kernels.continuous import Steps, Targets
from kerfpath.kernels.metric import increments_between
from kerfpath.search._problem import SearchProblem

__all__ = ["ContinuousPath", "ContinuousSearch"]

WIDEST, WIDEST_STEPS = 0.5, 6.0
"""rad, and steps of gamma: neighbouring samples are joined where no joint moves further."""
CAP_SLACK = 1e-2
"""Relative slack on the largest distance while the sum is brought down: between samples neither is
exact."""
_LAYERS_SAMPLED, _VERTICES_SAMPLED = 12, 16
"""Layers, and vertices of each, by which the joint that sorts the targets is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContinuousPath:
    """One point of each layer, at a vertex or between two of neighbouring samples.

    Parameters
    ----------
    one, other : (K,) int
        Rows of q that each point is between; the same at a vertex.
    share : (K,)
        Where between them, from 0 to 1.
    q : (K, n) rad
        Joints, interpolated, not wrapped.
    value : float
        What the value function says at its first vertex.
    """

    one: Ints
    other: Ints
    share: Array
    q: Array
    value: float

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, eq=False, init=False)
class ContinuousSearch:
    """Values and paths over continuous gamma of a problem whose vertices are samples of it.

    Parameters
    ----------
    problem : SearchProblem
        Its closure and rotation limits are left alone, as are shut edges.
    sample, variant, posture : (N,) int
        Sample of gamma, variant (tilt, external axis) and posture of each vertex; each layer is
        ordered by variant and sample.
    samples : int
        Number of samples on the circle.

    Raises
    ------
    InputError
        Shut edges; arrays that do not fit; a layer in another order.
    """

    problem: SearchProblem
    targets: Targets
    steps: Steps
    values: Array = field(repr=False)

    __repr__ = short_repr
