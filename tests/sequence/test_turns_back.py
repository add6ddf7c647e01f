"""Endless joints that turn back between contours, to the turns that a program can express."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Contour, Plan, plan
from kerfpath.auditor import transfer_checks
from kerfpath.job.format import pose
from kerfpath.post import build_program, languages, preflight
from kerfpath.robots import robot
from kerfpath.sequence import PartPlan, order_plans
from kerfpath.transfer import back_off

TURN = 2 * np.pi
HOME = np.radians([0, 0, 0, 0, -90, 0])
ENDLESS = np.arange(6) == 5
HOLES = 12
"""Each winds joint 6 up by two turns, of which seven can be expressed either way."""


@pytest.fixture(scope="module")
def arm():
    return robot("fanuc_m20ia").with_limits(
        endless=ENDLESS, acceleration=np.radians([400, 400, 400, 1000, 1000, 1500])
    )


@pytest.fixture(scope="module")
def wound(arm) -> list[list[Plan]]:
    """Holes along which the flange, about whose axis the beam is, winds up by two turns."""
    angle, found = np.linspace(0, TURN, 33), []
    for k in range(HOLES):
        x, y = 0.02 * np.cos(-angle) + 0.06 * (k % 4), 0.02 * np.sin(-angle) + 0.06 * (k // 4)
        points = np.stack([x, y, 0 * x], axis=1)
        hole = Contour(points, np.tile([0, 0, -1.0], (33, 1)), closed=True, name=f"hole {k}")
        made = plan(
            hole, arm,
            tool=pose((0, 0, 150), (0, 0, 0)), placement=pose((900, -90, 100), (0, 0, 0)),
            speed=0.02, gamma_step=np.radians(30), certify=None,
        )  # fmt: skip
        q, turn = made.q.copy(), made.turn.copy()
        q[:, 5] += np.linspace(0, 2 * TURN, 33)
        turn[:, 5] = np.round(q[:, 5] / TURN)
        found.append([replace(made, q=q, turn=turn)])
    return found


def errors(part: PartPlan) -> list[str]:
    program = build_program(part.plans, moves=part.moves, retract=part.retract, name="holes")
    return [issue.code for issue in preflight(program, "fanuc") if issue.level == "error"]


def test_joints_turn_back_to_the_turns_of_a_configuration(arm, wound):
    within = languages()["fanuc"].turns_within(arm)
    assert within is not None
    lower, upper = within
    free = order_plans(wound, home=HOME)
    assert max(made.q[:, 5].max() for made in free.plans) > upper[5]  # nothing to do otherwise
    assert "turns" in errors(free)
    part = order_plans(wound, home=HOME, turns_within=within)
    assert errors(part) == []

    # The same motion modulo whole turns of the endless joint.
    assert part.chosen == free.chosen
    for one, other in zip(part.plans, free.plans, strict=True):
        off = (one.q - other.q) / TURN
        np.testing.assert_allclose(off, np.broadcast_to(np.round(off[0]), off.shape), atol=1e-12)
        assert not off[:, ~arm.endless].round().any()
        np.testing.assert_array_equal(one.turn - other.turn, np.round(off))
        assert (one.q >= lower).all()
        assert (one.q <= upper).all()

    # Moves join the contours exactly, keep the limits, and are as long as the order says.
    ends = [back_off(made, "end", part.retract) for made in part.plans]
    starts = [back_off(made, "start", part.retract) for made in part.plans]
    for move, before, after in zip(part.moves, [HOME, *ends], [*starts, None], strict=True):
        np.testing.assert_allclose(move.q[0], before, atol=1e-9)
        if after is not None:
            np.testing.assert_allclose(move.q[-1], after, atol=1e-9)
        checks = transfer_checks(arm, move.q, move.time, cell=None, eta_v=1.0, eta_a=1.0)
        assert all(check.ok for check in checks)
    home = (part.moves[-1].q[-1] - HOME) / TURN
    np.testing.assert_allclose(home, np.round(home), atol=1e-9)
    longer = part.air_time - free.air_time
    assert part.order.duration - free.order.duration == pytest.approx(longer, abs=1e-9)
    assert longer > 0
    assert part.order.at_least <= part.order.duration


def test_no_joint_turns_back_where_all_turns_can_be_expressed(arm, wound):
    few = wound[:3]
    within = languages()["fanuc"].turns_within(arm)
    free, bound = order_plans(few, home=HOME), order_plans(few, home=HOME, turns_within=within)
    for one, other in zip((*free.plans, *free.moves), (*bound.plans, *bound.moves), strict=True):
        np.testing.assert_array_equal(one.q, other.q)
    assert free.order.duration == bound.order.duration


def test_a_contour_of_more_turns_than_can_be_expressed_stays_as_it_is(arm, wound):
    q = wound[0][0].q.copy()
    q[:, 5] *= 10
    long = [replace(wound[0][0], q=q)]
    part = order_plans([long], turns_within=languages()["fanuc"].turns_within(arm))
    np.testing.assert_array_equal(part.plans[0].q, q)  # whose program the preflight refuses


def test_a_language_of_all_turns_and_an_arm_without_endless_joints_have_no_bounds(arm):
    assert languages()["rapid"].turns_within(arm) is None
    bound = arm.with_limits(endless=np.zeros(6, bool), lower=-6 * np.ones(6), upper=6 * np.ones(6))
    assert languages()["fanuc"].turns_within(bound) is None
