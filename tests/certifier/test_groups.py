"""Groups of cells: those that repeat another are bounded once, and no other is left out."""

import numpy as np
import pytest
from benchmarks import _arm

from kerfpath import plan
from kerfpath.certifier import certify
from kerfpath.certifier.cells import CellMaker
from kerfpath.certifier.stages import StageResult, Steps, solve_stage
from kerfpath.kernels.metric import MANHATTAN

RANGE = np.radians([180, 95, 70, 250, 115, 350])
"""Of joints 4 and 6 two turns here and there, one elsewhere."""


@pytest.fixture(scope="module", params=[(), (3, 5)], ids=["turns", "endless"])
def robot(request):
    return _arm.arm().with_limits(
        endless=np.isin(np.arange(6), request.param), lower=-RANGE, upper=RANGE
    )


@pytest.fixture(scope="module")
def stage(robot, arc, tool, placement):
    """Coarse cells at three nodes, steps so short that they fall into groups, and their maker."""
    planned = plan(arc, robot, tool=tool, placement=placement, speed=0.1, certify=None)
    maker = CellMaker(robot, planned.frames, planned.T_flange_tip)
    steps = Steps(
        weight=np.ones(6),
        velocity=np.full(6, 0.05),
        acceleration=np.full(6, 0.05),
        metric=MANHATTAN,
        endless=robot.endless,
    )
    return maker, solve_stage(maker.coarsest(np.arange(3)), steps)


def groups(result, kept):
    """Return the cells that steps join, by walking from one to the next."""
    ahead = [set() for _ in kept]
    for cell in np.flatnonzero(kept):
        for to in result.to[result.begin[cell] : result.begin[cell + 1]]:
            if kept[to]:
                ahead[cell].add(int(to))
                ahead[to].add(int(cell))
    left, found = set(np.flatnonzero(kept).tolist()), []
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = set().union(*(ahead[cell] for cell in edge)) - group
        left -= group
        found.append(sorted(group))
    return found


def repeats(cells, others, maker):
    """Return whether the joints on cells are those on others but for one shift of whole turns.

    As they are or with the wrist turned over, which turns joints 4 and 6 by half a turn and
    mirrors joint 5.
    """
    joint, middle = maker.flip
    return any(
        among(cells, cells.posture ^ over, centers, others, maker.endless)
        for over, centers in ((0, cells.center), (1, mirrored(cells.center, joint, middle)))
    )


def mirrored(center, joint, middle):
    turned = center + np.pi * np.isin(np.arange(6), (3, 5))
    turned[:, joint] = 2 * middle - center[:, joint]
    return turned


def among(cells, postures, centers, others, endless):
    def same(i):
        named = (others.node == cells.node[i]) & (others.posture == postures[i])
        return named & (others.level == cells.level[i]) & (others.index == cells.index[i])

    def fits(i, shift):
        off = others.center[same(i)] - centers[i] - shift
        off = np.where(endless, (off + np.pi) % (2 * np.pi) - np.pi, off)
        return (np.abs(off).max(axis=1, initial=0.0) < 1e-6).any()  # enclosures round at 1e-12

    shifts = others.center[same(0)] - centers[0]
    whole = shifts[(np.abs(np.sin(shifts / 2)) < 1e-6).all(axis=1)]
    return any(all(fits(i, shift) for i in range(len(cells))) for shift in whole)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_left_out_repeats_what_is_kept_and_nothing_kept_another(seed, stage):
    """Also where ranges, or what was proved before, left more of one copy than of another."""
    maker, result = stage
    rng = np.random.default_rng(seed)
    kept = rng.random(len(result.cells)) < (1.0, 0.99, 0.9, 0.7, 0.3, 0.0)[seed]
    found = [np.flatnonzero(group).tolist() for group in result.groups(kept, maker)]
    found = [group for group in found if group]
    every = groups(result, kept)
    assert all(group in every for group in found)
    taken = [result.cells.take(np.array(group)) for group in found]
    for group in every:
        cells = result.cells.take(np.array(group))
        others = [one for one, name in zip(taken, found, strict=True) if name != group]
        assert any(repeats(cells, one, maker) for one in others) == (group not in found)


def test_bounding_repeated_motions_once_proves_the_same(robot, arc, tool, placement, monkeypatch):
    best = plan(arc, robot, tool=tool, placement=placement, speed=0.96, certify=None)
    once = certify(best, checkable=False)

    def every(result, kept, _):
        return [np.isin(np.arange(len(kept)), group) for group in groups(result, kept)]

    monkeypatch.setattr(StageResult, "groups", every)
    twice = certify(best, checkable=False)
    assert once.pairs < twice.pairs
    # The same enclosures but for rounding, on other turns.
    assert once.plan.proof.bound == pytest.approx(twice.plan.proof.bound, rel=1e-9)
