"""What digits leave of an arm beside external axes, and moves through the air that move them."""

import numpy as np
import pytest
from tests.post.external_cells import CELLS, ExternalCase

from kerfpath.auditor import rounding_of, transfer_checks
from kerfpath.robots import base_in_part

POINT, ANGLE = 5e-7, 1e-6
"""m and rad: half a digit."""


@pytest.mark.parametrize("cell", CELLS)
def test_the_arm_stays_within_what_digits_leave_of_it(cell):
    """Poses and external values rounded at random, the arm solved anew: an oracle by samples."""
    plan, rng = ExternalCase(cell, "rapid").plan(count=6), np.random.default_rng(3)
    robot, arm = plan.robot, plan.robot.alone()
    left = rounding_of(plan, POINT, ANGLE, np.zeros(5), jointed=False)
    assert left.q.shape == plan.q.shape
    own = [POINT if axis.kind == "linear" else ANGLE for axis in robot.externals]
    np.testing.assert_array_equal(left.q[:, 6:], np.tile(own, (6, 1)))
    T = robot.forward(plan.q)
    most = np.zeros((6, 6))
    for _ in range(200):
        x = plan.q[:, 6:] + rng.choice([-1, 1], (6, len(own))) * own
        moved = T.copy()
        # The digits are those of the tip; the flange is that far off at least.
        moved[:, :3, 3] += rng.choice([-1, 1], (6, 3)) * POINT
        seen = np.linalg.inv(base_in_part(robot.externals, x)) @ moved
        q = arm.arm.follow(seen, plan.q[:, :6], plan.posture)
        most = np.maximum(most, np.abs(q - plan.q[:, :6]))
    # Of first order: what is left out is of the square of the digits.
    assert (most <= left.q[:, :6] * 1.01 + 1e-9).all()
    assert (left.q[:, :6] <= 60 * most.max()).all()  # and it is no bound that allows anything


def test_joints_that_are_said_keep_their_own_digits():
    plan = ExternalCase("rail+table", "csv").plan(count=6)
    left = rounding_of(plan, POINT, ANGLE, np.zeros(5), jointed=True)
    np.testing.assert_array_equal(left.q, np.tile([ANGLE] * 6 + [POINT, ANGLE], (6, 1)))


def test_a_move_through_the_air_is_held_to_the_limits_of_the_axes():
    robot = ExternalCase("rail+table", "rapid").plan(count=6).robot
    q = np.zeros((2, 8))
    q[:, :6] = np.radians([0, 10, 20, 0, 40, 0])
    q[1, 6] = 1.0
    # 1 m at 4 m/s^2 up to 2 m/s: half a second of ramps, and half a metre at full speed.
    rows = {row.code: row for row in transfer_checks(robot, q, [0.0, 1.0])}
    assert set(rows) == {"air-time", "air-limits", "air-external-limits"}
    assert rows["air-time"].value == pytest.approx(1.0)
    assert all(row.ok for row in rows.values())
    assert not {r.code: r for r in transfer_checks(robot, q, [0.0, 0.9])}["air-time"].ok
    q[1, 6] = 3.002
    row = {r.code: r for r in transfer_checks(robot, q, [0.0, 9.0])}["air-external-limits"]
    assert (row.ok, row.unit, row.title) == (False, "m", "excess over the limits of rail")
    assert row.value == pytest.approx(0.002)
