"""Cells to divide: those near a singularity first, while they decide."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks import _arm
from benchmarks._random_contours import cut

from kerfpath import PlanOptions, plan
from kerfpath.certifier import bound, certify
from kerfpath.certifier.cells import CellMaker, CellSet
from kerfpath.certifier.division import cells_to_divide
from kerfpath.certifier.parts import CARE
from kerfpath.certifier.stages import solve_stage

WEIGHT, DEEPEST = np.array([1.0, 2.0]), 12


def cells(spread):
    """Return two cells at each of three nodes, on which joint 1 is known so far, (6,) rad."""
    spread = np.asarray(spread, float)
    C, nothing = len(spread), np.zeros((len(spread), 2))
    return CellSet(
        node=np.repeat(np.arange(3, dtype=np.int32), 2),
        posture=np.zeros(C, np.int8),
        level=np.zeros(C, np.int8),
        index=np.arange(C, dtype=np.int32),
        half=np.full(C, 0.04),
        center=nothing,
        slope=nothing,
        bend=nothing,
        spread=np.c_[spread, nothing[:, 0]],
        floor=np.full(C, -np.inf),
        at=np.zeros((C, 0)),
        reach=np.zeros((C, 0)),
        tied=np.zeros((C, 0, 2)),
        cuts=np.zeros(C, np.int16),
    )


def test_a_cell_that_decides_is_divided_alone():
    through = np.array([0.0, 5.0, 0.0, 5.0, 0.0, 5.0])
    which, singular = cells_to_divide(cells([0, 0, 3, 0, 0, 0]), through, 4.0, WEIGHT, DEEPEST)
    assert singular
    assert which.tolist() == [False, False, True, False, False, False]


def test_where_little_is_unknown_all_that_lack_something_are_divided():
    through = np.array([0.0, 5.0, 1.0, 5.0, 0.0, 3.9])
    which, singular = cells_to_divide(cells([0, 0, 0.5, 9, 0, 0]), through, 4.0, WEIGHT, DEEPEST)
    assert not singular  # the cell known to 9 rad is on no cheap motion
    assert which.tolist() == [True, False, True, False, True, True]


def test_uncertain_cells_that_are_as_fine_as_can_be_do_not_decide():
    """What is unknown on them stays so; the others are divided as if they were certain."""
    through = np.array([0.0, 5.0, 0.0, 5.0, 0.0, 5.0])
    some = cells([0, 0, 3, 0, 0, 0])
    fine = replace(some, level=np.array([0, 0, DEEPEST, 0, 0, 0], np.int8))
    which, singular = cells_to_divide(fine, through, 4.0, WEIGHT, DEEPEST)
    assert not singular
    assert which.tolist() == [True, False, False, False, True, False]


def test_nothing_is_divided_where_nothing_lacks():
    which, singular = cells_to_divide(cells([9.0] * 6), np.full(6, 4.0), 4.0, WEIGHT, DEEPEST)
    assert not which.any()
    assert not singular


def test_cells_without_any_bound_are_divided():
    """Minus infinity is what a part begins with."""
    which, _ = cells_to_divide(cells([1.0] * 6), np.full(6, -np.inf), 4.0, WEIGHT, DEEPEST)
    assert which.all()


@pytest.mark.usefixtures("certifier_at_work")
@pytest.mark.parametrize("checkable", [False, True])
def test_motions_past_a_wrist_singularity_are_bounded_closely(checkable):
    """At gamma of some 25 deg joint 5 passes zero: joint 4 may be anywhere in cells of 0.6 deg."""
    drawn = cut("abb_irb2400_155", 12)
    space = {"tool": drawn.tool, "placement": np.eye(4), "speed": drawn.speed}
    asked = replace(PlanOptions(), certify=None)
    made = plan(drawn.contour, drawn.robot, options=asked, **space)
    found = certify(made, gap=0.02, checkable=checkable)
    assert found.done
    assert found.plan.proof.gap <= 0.02


def test_joints_that_may_be_anywhere_do_not_make_coarse_cells_worthless():
    """Motions past the singularity on every turn: what the widest cells prove, all alike.

    Where potentials slope with a joint that may be anywhere it is -3 times the cost.
    """
    arm = _arm.arm()
    arm = arm.with_limits(acceleration=3 * arm.speed_limits()[1], endless=np.zeros(6, bool))
    space = {"tool": _arm.tool(), "placement": _arm.placement(), "speed": 1 / 6}
    made = plan(_arm.wave(100), arm, certify=None, **space)
    course = bound._Certification(
        made,
        bound.bound_steps(made),
        0.9,
        np.inf,
        bound.most_pairs(len(made.q)),
        False,
        lambda *_: None,
    )
    turns = CellMaker(made.robot, made.frames, made.T_flange_tip, made.settings.postures)
    for maker in (course.maker, turns):
        steps = replace(course.steps, endless=maker.endless)
        result = solve_stage(maker.coarsest(course.nodes), steps, care=CARE * made.cost)
        assert (result.cells.spread > 1).any()
        assert 0.9 * made.cost < result.bound <= made.cost
