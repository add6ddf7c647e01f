"""The certificate of a plan: what proves that no motion along its contour costs less than a bound.

Every motion passes, at each node, through one of the cells of a stage: an interval of gamma in one
posture and on one turn of each joint. A stage lays a function over its cells, the potential

    V(q) = max over m of  level_m - dual_m . (q - q_0),        m = 0, 1,

q_0 the joints at the middle of the cell. With any potential, a motion q_0, q_1, .. costs at least
V(q_0) plus, for each of its steps, the least of rho(q_{k+1} - q_k) + V(q_{k+1}) - V(q_k) over the
two cells of the step (the sum telescopes): so does the shortest path through the cells with these
reduced costs. Whoever checks it computes the enclosures of the joints, hence the reduced costs, on
his own; a potential that is wrong makes the bound weaker, not untrue.

The layers of a stage are the nodes that its cells are of; it need not have them all. A step from
node k to node k' > k + 1 spans k' - k intervals: its velocity bound is that many times the one of
(5), and rho of the whole is no more than the sum over its parts. An endless joint may turn further
in it than the short way: where another representative of the difference is within reach, either
counts.

A stage may carry multipliers nu of (6): they tilt the cost of a step (see `Stage`). Cells through
which every motion costs more than the plan drop out, and the next stage covers those that remain.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TypedDict, cast

import numpy as np
from numpy.typing import NDArray

from kerfpath._arrays import Array, scalar
from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = [
    "ALLOWANCE",
    "BASE",
    "LIFTS",
    "USUAL",
    "Certificate",
    "Certify",
    "CertifyData",
    "Stage",
    "cell_bounds",
]

BASE = 72
"""Cells that the circle of gamma is divided into at level 0; each level divides them in two."""
LIFTS = 8
"""Parts of half a turn in which the place of a joint is written, to distinguish its turns."""
ALLOWANCE = 2e-4
"""Share of the plan's cost by which the bound that is stated stays below the one computed: another
enclosure of the same joints may be a little wider."""


class CertifyData(TypedDict):
    """A `Certify` as JSON holds it."""

    gap: float
    seconds: float | None
    keep: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Certify:
    """How far a plan is certified: the gap to reach, and the time that may go into it.

    Parameters
    ----------
    gap : float
        Share of the plan's cost that may be left between the bound and the cost, from above 0 to
        1; nothing more is tried once it is reached.
    seconds : float s, optional
        Time to spend on each plan; None: no limit but the certifier's own limit on its work, so
        that the same task has the same bound on every machine.
    keep : bool
        Whether plan.json carries the certificate, for others to check; the bound is there anyhow.

    Raises
    ------
    InputError
        A gap or a time that is not positive, or a gap over 1.
    """

    gap: float = 0.005
    seconds: float | None = None
    keep: bool = False

    def __post_init__(self) -> None:
        gap = scalar(self.gap, "certify gap", above=0.0)
        if gap > 1:
            raise InputError(f"certify gap: expected a share of the cost up to 1, got {gap:g}")
        object.__setattr__(self, "gap", gap)
        if self.seconds is not None:
            seconds = scalar(self.seconds, "certify seconds", unit="s", above=0.0)
            object.__setattr__(self, "seconds", seconds)
        if not isinstance(self.keep, bool):
            raise InputError(f"certify keep: expected True or False, got {self.keep!r}")

    def to_data(self) -> CertifyData:
        """Return it as JSON holds it; `Certify(**data)` is the same again."""
        return cast(CertifyData, asdict(self))


USUAL = Certify()
"""How plans are certified where nothing else is asked for."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stage:
    """Cells and a potential over them.

    Parameters
    ----------
    node : (C,) int32
        Node of each cell; ascending. The nodes that occur are the layers.
    posture : (C,) int8
    level : (C,) int8
        Times that a cell of the coarsest grid (`BASE`) was divided in two.
    index : (C,) int32
        Place on the circle: gamma from -pi + width index to -pi + width (index + 1), with width
        2 pi / (`BASE` 2^level).
    lift : (C, n) int8
        About where the joints are, in parts of half a turn (pi / `LIFTS`): it tells which turn of
        a joint the cell is on. The enclosure of a joint is moved by whole turns until its middle
        is the one nearest to it.
    value : (C, 2) float64
        The levels of the potential, in units of cost.
    dual : (C, 2, n) float32
        Its slopes, 1/rad times cost.
    multipliers : (K, n) float64, optional
        nu at each node, zero at the first and the last: to the cost of a motion they add
        nu_k . (u_k - u_{k-1}) - |nu_k| . A, which is never above zero where (6) holds; u_k is the
        increment from node k to k + 1, A the bound of (6) on its change. Only where the cells are
        of all nodes.
    """

    node: NDArray[np.int32]
    posture: NDArray[np.int8]
    level: NDArray[np.int8]
    index: NDArray[np.int32]
    lift: NDArray[np.int8]
    value: Array
    dual: NDArray[np.float32]
    multipliers: Array | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certificate:
    """What proves a lower bound on the cost of every motion along a contour.

    Parameters
    ----------
    bound : float
        What is proved, `ALLOWANCE` less than computed.
    stages : tuple of Stage
        The first covers all motions, each further one what the one before it leaves.
    """

    bound: float
    stages: tuple[Stage, ...]

    __repr__ = short_repr


def cell_bounds(level: NDArray[np.int8], index: NDArray[np.int32]) -> tuple[Array, Array]:
    """Return the middle of the cells and half their width, (C,) rad each.

    The half is a few roundings too wide, so that neighbours overlap.
    """
    width = 2 * np.pi / (BASE * np.exp2(level.astype(float)))
    return -np.pi + width * (index + 0.5), width / 2 + 1e-15 * np.pi
