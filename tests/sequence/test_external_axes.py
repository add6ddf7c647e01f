"""Transfer moves that move external axes, too: straight, around, and a part's order."""

import numpy as np
import pytest

from conftest import pose
from kerfpath import Contour, InputError
from kerfpath.auditor import transfer_checks
from kerfpath.cell import box, cell_of
from kerfpath.job.plan_file import read_moves, sequence_entry
from kerfpath.sequence import plan_part
from kerfpath.transfer import back_off, least_time, transfer_move

RAIL = {"lower": -1.0, "upper": 1.2, "velocity": 0.8, "acceleration": 1.5}
TABLE = {"lower": -np.pi, "upper": np.pi, "endless": True, "velocity": 1.5, "acceleration": 3.0}
CENTRE = [1.3, 0.0, 0.5]


@pytest.fixture(scope="module")
def robot(arm):
    return arm.on_rail([0, 1, 0], **RAIL).with_positioner([0, 0, 1], CENTRE, name="table", **TABLE)


def at(x, table=0.0, q=(0, 0.3, 0.2, 0, 0.7, 0)):
    return np.array([*q, x, table])


@pytest.fixture(scope="module")
def walled(robot, tool):
    """A wall beside the rail, that a stretched-out arm must be drawn back to pass."""
    wall = box([0.3, 0.1, 1.8], pose([1.3, 0.0, 0.9]))
    return cell_of(robot, tool=tool, fixtures={"wall": wall}, near_miss=5e-3)


def within(robot, move, eta=1.0):
    """Every limit of every axis, by the true trapezoid of the slowest."""
    limits = robot.joint_limits()
    inside = (move.q >= limits.lower - 1e-9) & (move.q <= limits.upper + 1e-9)
    assert (inside | robot.endless).all()
    velocity, acceleration = robot.speed_limits()
    took = least_time(np.diff(move.q, axis=0), eta * velocity, eta * acceleration)
    assert (np.diff(move.time) >= took * (1 - 1e-9)).all()


def test_a_move_takes_as_long_as_the_slowest_of_arm_and_axes(robot):
    move = transfer_move(robot, at(-0.9), at(1.1, 0.2), eta_v=0.5, eta_a=0.5)
    # 2 m on the rail at 0.4 m/s and 0.75 m/s^2: speed / acceleration to gain it, once.
    assert move.duration == pytest.approx(2.0 / 0.4 + 0.4 / 0.75)
    within(robot, move, 0.5)
    with pytest.raises(InputError, match="transfer move: rail is beyond its limits at an end"):
        transfer_move(robot, at(-0.9), at(1.3))
    turned = transfer_move(robot, at(0.0, 3.0), at(0.0, 4.0))
    assert turned.duration == pytest.approx(1.0 / 1.5 + 1.5 / 3.0)


def test_a_move_along_the_rail_goes_around_what_stands_there(robot, walled):
    ends = at(-0.8), at(0.8)
    assert walled.clear(np.array(ends)).all()
    assert not walled.clear_through(np.array(ends))
    move = transfer_move(robot, *ends, cell=walled)
    assert move.clear
    assert len(move.q) > 2
    within(robot, move)
    fine = np.vstack([a + np.linspace(0, 1, 200)[:, None] * (b - a)
                      for a, b in zip(move.q, move.q[1:], strict=False)])  # fmt: skip
    assert walled.clear(fine).all()
    rows = {row.code: row for row in transfer_checks(robot, move.q, move.time, cell=walled)}
    assert set(rows) >= {
        "air-time",
        "air-limits",
        "air-external-limits",
        "collision",
        "collision-open",
    }
    assert all(row.ok for row in rows.values())


def test_the_audit_finds_what_an_edit_of_an_axis_breaks(robot, walled, arm):
    move = transfer_move(robot, at(-0.8), at(0.8), cell=walled)

    def broken(q, time):
        rows = transfer_checks(robot, q, time, cell=walled)
        return {row.code for row in rows if not row.ok}

    assert broken(move.q[[0, -1]], [0.0, 9.0]) == {"collision"}
    assert broken(move.q, 0.9 * move.time) == {"air-time"}
    far = move.q.copy()
    far[-1, 6] = 1.25
    slow = np.linspace(0, 99, len(far))
    assert broken(far, slow) == {"air-external-limits"}
    with pytest.raises(InputError, match="other external axes"):
        transfer_checks(arm, move.q[:, :6], move.time, cell=walled)
    with pytest.raises(InputError, match="other external axes"):
        transfer_move(arm, move.q[0, :6], move.q[-1, :6], cell=walled)


def cut(y, name):
    points = np.c_[np.linspace(-0.05, 0.05, 11), np.full(11, y), np.zeros(11)]
    return Contour(points, np.tile([0, 0, -1.0], (11, 1)), name=name)


@pytest.fixture(scope="module")
def part(robot, tool):
    home = at(0.3, 4 * np.pi)  # where a table may be that has turned twice
    asked = {"tool": tool, "placement": pose(CENTRE), "speed": 0.05, "gamma_step": np.radians(10)}
    contours = [cut(y, name) for y, name in ((1.1, "far"), (-1.1, "near"), (0.0, "middle"))]
    return home, plan_part(contours, robot, home=home, retract=0.03, **asked)


def test_a_part_is_cut_in_the_order_that_moves_all_axes_least(part, robot):
    home, found = part
    assert len(found.moves) == 4
    np.testing.assert_array_equal(found.moves[0].q[0], home)
    turns = (found.moves[-1].q[-1] - home) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    np.testing.assert_allclose(turns[~robot.endless], 0.0, atol=1e-12)
    for move in found.moves:
        within(robot, move)
    for made, before, after in zip(found.plans, found.moves, found.moves[1:], strict=False):
        assert np.abs(made.q[:, 7] - 4 * np.pi).max() < 2 * np.pi  # it goes on from there
        assert not made.turn[:, 6:].any()  # turns are of the arm's joints
        np.testing.assert_allclose(before.q[-1], back_off(made, "start", 0.03), atol=1e-9)
        np.testing.assert_allclose(after.q[0], back_off(made, "end", 0.03), atol=1e-9)
        # The tool is straight behind the cut, and the axes stand as at its end.
        tip = [robot.forward(q) @ made.T_flange_tip for q in (made.q[0], before.q[-1])]
        np.testing.assert_allclose(tip[1][:3, 3], tip[0][:3, 3] - 0.03 * tip[0][:3, 2], atol=1e-9)
        np.testing.assert_allclose(before.q[-1][6:], made.q[0, 6:], atol=1e-12)


def test_a_plan_file_keeps_moves_of_all_axes(part, robot, arm):
    _, found = part
    entry = sequence_entry(found)
    assert np.shape(entry["moves"][0]["q_rad"])[1] == 6
    assert np.shape(entry["moves"][0]["external_q"])[1] == 2
    for move, back in zip(found.moves, read_moves(entry, robot), strict=True):
        np.testing.assert_array_equal(move.q, back.q)
    del entry["moves"][1]["external_q"]
    with pytest.raises(InputError, match="external_q: expected 2 numbers for each of q_rad"):
        read_moves(entry, robot)
