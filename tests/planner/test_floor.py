"""The floor: no node has the elbow, the wrist or the flange below it, on the grid and off it."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import NoFeasiblePath, PlanOptions
from kerfpath.auditor import chain_of, checks
from kerfpath.cell import box, cell_of
from kerfpath.contour import Contour
from kerfpath.losses import Loss
from kerfpath.planner import plan
from kerfpath.robots import lowest_joint, robot, robot_ids

SLIT = Contour(
    np.c_[np.linspace(0, 0.03, 11), np.zeros((11, 2))], np.tile([0.0, 0.0, -1.0], (11, 1))
)


def planned(arm, tool, place, **options):
    asked = PlanOptions(gamma_step=np.radians(10), certify=None, **options)
    return plan(SLIT, arm, tool=tool, placement=place, speed=0.04, options=asked)


@pytest.fixture(scope="module")
def places():
    draw, found = np.random.default_rng(8), []
    for _ in range(12):
        place = np.eye(4)
        place[:3, 3] = draw.uniform([0.6, -0.8, 0.0], [2.0, 0.8, 0.3])
        found.append(place)
    return found


@pytest.mark.parametrize("method", ["continuous", "exact"])
def test_no_node_is_below_the_floor_that_is_asked_for(arm, tool, places, method):
    free_below = 0
    for place in places:
        try:
            free = planned(arm, tool, place, method=method)
        except NoFeasiblePath:
            continue
        free_below += bool((lowest_joint(arm, free.q) < 0.2).any())
        try:
            made = planned(arm, tool, place, method=method, floor=0.2)
        except NoFeasiblePath:
            continue
        assert (lowest_joint(arm, made.q) >= 0.2).all()
        assert next(row for row in checks(made) if row.code == "floor").ok
    assert free_below  # else the law would be about nothing


def test_a_floor_above_the_part_is_why_there_is_no_path(arm, tool, places):
    with pytest.raises(NoFeasiblePath, match="below the floor") as none:
        planned(arm, tool, places[0], floor=3.0)
    assert none.value.lost_by(Loss.FLOOR)


def test_the_audit_finds_what_is_below_the_floor(arm, tool, places):
    for place in places[:4]:
        free = planned(arm, tool, place)
        lowest = float(lowest_joint(arm, free.q).min())
        for floor, ok in ((lowest - 1e-3, True), (lowest + 1e-3, False)):
            asked = replace(free, settings=replace(free.settings, floor=floor))
            row = next(row for row in checks(asked) if row.code == "floor")
            assert row.ok == ok
            # Two kinematics in double precision.
            assert row.value == pytest.approx(floor - lowest, abs=1e-9)


@pytest.mark.parametrize("name", robot_ids())
def test_heights_are_those_of_the_audits_chain(name):
    arm = robot(name)
    q = np.random.default_rng(1).uniform(-2, 2, (20, arm.joints))
    chain = chain_of(arm)
    heights = [T[:, 2, 3] for T in (*chain.joints(q)[2:], chain.forward(q))]
    np.testing.assert_allclose(lowest_joint(arm, q), np.min(heights, axis=0), atol=1e-9)


@pytest.mark.parametrize("name", ["abb_irb4600_60_205", "ur5", "ur3"])
def test_an_arm_stands_on_the_floor_of_its_cell_and_keeps_off_it(name):
    arm = robot(next(known for known in robot_ids() if name in known))
    cell = cell_of(arm, tool=np.eye(4), near_miss=0.02, floor=0.0)
    assert {"base", "floor"} in [{*pair} for pair in cell.unjudged]
    q = np.random.default_rng(2).uniform(-3, 3, (400, arm.joints))
    low = lowest_joint(arm, q)
    assert not cell.clear(q)[low < 0].any()
    # What is well above it is nearly always clear of it: links are as thick as 0.2 m.
    floor = np.array(["floor" in pair for pair in cell.pair_names])
    free = (cell.distances(q)[:, floor] > cell.required[floor]).all(axis=1)
    assert free[low > 0.3].mean() > 0.9


def test_a_box_on_the_floor_is_no_fault(arm, tool):
    place = np.eye(4)
    place[:3, 3] = 1.5, 0.0, 0.15
    crate = box([0.3, 0.3, 0.3], place)
    made = cell_of(arm, tool=tool, near_miss=0.01, floor=0.0, fixtures={"crate": crate})
    assert {"crate", "floor"} not in [{*pair} for pair in made.pair_names]
