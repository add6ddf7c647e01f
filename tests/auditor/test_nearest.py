"""The nearest of many poses is found exactly, though few distances are asked for."""

import numpy as np
import pytest

from kerfpath.auditor import chain_of
from kerfpath.auditor.collision import Moves, nearest
from kerfpath.cell import Mesh, box, cell_of


@pytest.fixture(scope="module")
def cell(arm, tool):
    """A bar, and a part as a mesh, that the arm may touch, enter and leave."""
    solid, place, bar = box([0.4, 0.6, 0.2]), np.eye(4), np.eye(4)
    place[:3, 3], bar[:3, 3] = (1.4, 0.0, 0.5), (1.2, -0.7, 0.9)
    part = Mesh(vertices=solid.points, triangles=solid.triangles, name="part")
    return cell_of(
        arm, tool=tool, part=part, placement=place, near_miss=5e-3,
        fixtures={"bar": box([0.05, 0.05, 0.8], bar)},
    )  # fmt: skip


@pytest.mark.parametrize("lift", [0.0, -0.4, -0.8])  # from deep in the part to clear of it
@pytest.mark.parametrize("seed", range(4))
def test_the_least_of_all_distances_is_found(arm, cell, seed, lift):
    rng = np.random.default_rng(seed)
    ends = np.array([0, 0.6 + lift, 0.3, 0, 0.8, 0]) + rng.uniform(-0.6, 0.6, (2, 6))
    q = np.linspace(*ends, 80)
    chain = chain_of(arm)
    frames, moves = chain.links(q), Moves(cell, chain, q[:-1], q[1:])
    beyond = cell.scene.distances(frames, np.inf) - cell.required
    for wanted in (cell.own, ~cell.own):
        among = np.where(wanted, beyond, np.inf)
        asked = cell.queries
        row, pair, found = nearest(cell, moves.rates, q, frames, wanted)
        assert found == among.min()
        assert (row, pair) == np.unravel_index(np.argmin(among), among.shape)
        assert cell.queries - asked < 0.6 * wanted.sum() * len(q)  # one of a hundred, where clear


def test_a_pose_that_is_no_number_is_the_worst(arm, cell):
    q = np.zeros((3, 6))
    chain = chain_of(arm)
    frames, moves = chain.links(q), Moves(cell, chain, q[:-1], q[1:])
    frames[1] = np.nan
    row, _, found = nearest(cell, moves.rates, q, frames, ~cell.own)
    assert row == 1
    assert np.isnan(found)
