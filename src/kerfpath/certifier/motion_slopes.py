"""Slopes of a potential from a motion: the multipliers of its increments.

Where a pose leaves more free than gamma, cells are thick: the other parameters may take up much of
a step, and slopes that are guessed step by step do not fit together. Those that do are the dual of
a convex program: the cheapest motion near a given one, with joints linear in all parameters,

    minimise sum of rho(u_k),   u_k = increments,   |parameters - those of the motion| <= reach.

It is solved again from the motion found. A bound is valid with any slopes.
"""

from __future__ import annotations

from typing import Any

import clarabel
import numpy as np
from scipy import sparse

from kerfpath.arrays import Array, Ints
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.stages import Steps
from kerfpath.kernels.metric import CHEBYCHEV, MANHATTAN

ROUNDS = 4
"""How often the program is solved, each time around the motion found before."""
NEAR = 0.1
"""rad or m: largest change of a parameter in one program, halved each time."""
SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)


def motion_slopes(
    maker: CellMaker,
    nodes: Ints,
    gamma: Array,
    at: Array,
    posture: Ints,
    steps: Steps,
) -> Array | None:
    """Return slopes (L - 1, n) of a potential that fit to the cheapest motion near a given one.

    Parameters
    ----------
    maker : CellMaker
    nodes : (L,)
        The layers.
    gamma, at, posture : (L,) rad, (L, M), (L,)
        Gamma, the other parameters and the postures of the motion.
    steps : Steps
    """
    found, near = None, NEAR
    spans = np.diff(nodes)
    for _ in range(ROUNDS):
        known = maker.linear(nodes, gamma, at, posture)
        if known is None:
            break
        q, slope = known
        u = np.diff(q, axis=0)
        u -= np.where(maker.turns, 2 * np.pi * np.rint(u / (2 * np.pi)), 0.0)
        low, high = maker.room(at, near)
        solved = _solved(u, slope, low, high, steps, spans)
        if solved is None:
            break
        found, x = solved
        gamma, at, near = gamma + x[:, 0], at + x[:, 1:], near / 2
    return found


def _solved(
    u: Array, slope: Array, low: Array, high: Array, steps: Steps, spans: Ints
) -> tuple[Array, Array] | None:
    """Return the multipliers (L - 1, n) of the increments and the changes (L, P), None for neither.

    Parameters
    ----------
    u : (L - 1, n)
        Increments of the motion.
    slope : (L, P, n)
        Slopes of the joints by the parameters.
    low, high : (L, P)
        Least and largest change of each parameter.
    """
    L, P, n = slope.shape
    size = (L - 1) * n
    # The increments by the parameters, (size, L P).
    edge, joint, one = np.meshgrid(np.arange(L - 1), np.arange(n), np.arange(P), indexing="ij")
    row, column = (edge * n + joint).ravel(), (edge * P + one).ravel()
    ahead = slope[edge + 1, one, joint].ravel()
    behind = -slope[edge, one, joint].ravel()
    moved = sparse.csr_array(
        (np.concatenate([behind, ahead]), (np.tile(row, 2), np.concatenate([column, column + P]))),
        shape=(size, L * P),
    )
    weight = np.tile(steps.weight, L - 1)
    velocity = np.outer(spans, steps.velocity).ravel()
    lengths = size if steps.metric == MANHATTAN else L - 1
    each = np.arange(size) if steps.metric == MANHATTAN else np.arange(size) // n
    unknowns = L * P + lengths
    own = sparse.csr_array((np.ones(size), (np.arange(size), L * P + each)), shape=(size, unknowns))
    wide = sparse.hstack([moved, sparse.csr_array((size, lengths))])
    longer = sparse.diags_array(weight) @ wide
    box = sparse.hstack([sparse.eye_array(L * P), sparse.csr_array((L * P, lengths))])
    reach = np.concatenate([high.ravel(), -low.ravel(), velocity - u.ravel(), velocity + u.ravel()])
    rows = [sparse.vstack([box, -box, wide, -wide])]
    right, cones = [reach], [clarabel.NonnegativeConeT(len(reach))]
    drawn = weight * u.ravel()
    if steps.metric in (MANHATTAN, CHEBYCHEV):
        rows.append(sparse.vstack([longer - own, -longer - own]))
        right.append(np.concatenate([-drawn, drawn]))
        cones.append(clarabel.NonnegativeConeT(2 * size))
    else:
        order = np.argsort(np.append(np.arange(L - 1), each), kind="stable")
        head = sparse.csr_array(
            (np.ones(L - 1), (np.arange(L - 1), L * P + np.arange(L - 1))), shape=(L - 1, unknowns)
        )
        rows.append(sparse.csr_array(sparse.vstack([-head, -longer]))[order])
        right.append(np.append(np.zeros(L - 1), drawn)[order])
        cones += [clarabel.SecondOrderConeT(n + 1)] * (L - 1)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.append(np.zeros(L * P), np.ones(lengths))
    solver: Any = clarabel.DefaultSolver(
        sparse.csc_matrix((unknowns, unknowns)),
        cost,
        sparse.csc_matrix(sparse.vstack(rows)),
        np.concatenate(right),
        cones,
        settings,
    )
    found = solver.solve()
    if found.status not in SOLVED:
        return None
    z, x = np.array(found.z), np.array(found.x)[: L * P].reshape(L, P)
    first = 2 * L * P
    over = z[first : first + size] - z[first + size : first + 2 * size]
    rest = z[first + 2 * size :]
    if steps.metric in (MANHATTAN, CHEBYCHEV):
        y = weight * (rest[:size] - rest[size:])
    else:
        y = -weight * rest.reshape(L - 1, n + 1)[:, 1:].ravel()
    return (y + over).reshape(L - 1, n), x
