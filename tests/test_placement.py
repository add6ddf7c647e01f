"""Measured frames: the fit of points, and plans and moves at another placement."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from conftest import pose
from kerfpath import (
    Contour,
    InputError,
    NoFeasiblePath,
    audit,
    placed,
    placement_from_points,
    plan,
    robot,
)
from kerfpath.cad import read_measured
from kerfpath.placement import place_moves
from kerfpath.transfer import back_off, transfer_move
from programs import arc, frames, hand_plan

POINTS = np.array([[0, 0, 0], [0.5, 0, 0.02], [0.4, 0.3, 0], [0.1, 0.25, 0.1]])
EXACT = 1e-9
"""m and rad: rounding of closed-form kinematics in double precision."""


@pytest.fixture(scope="module")
def arm():
    return robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")


@pytest.fixture(scope="module")
def made(arm):
    return hand_plan(arc(), arm, *frames(), speed=0.02)


def at(xyz, rpy):
    return pose(xyz, Rotation.from_euler("xyz", rpy).as_matrix())


def moved(T, points=POINTS):
    return points @ T[:3, :3].T + T[:3, 3]


def test_points_that_fit_give_the_placement_that_made_them():
    T = at([1.2, -0.4, 0.6], [0.3, -0.2, 2.0])
    found = placement_from_points(POINTS, moved(T))
    np.testing.assert_allclose(found.T_base_part, T, atol=1e-12)
    assert found.residuals.max() < 1e-12
    back = np.eye(4)
    back[:3, :3] = Rotation.from_euler("xyz", found.rpy_deg, degrees=True).as_matrix()
    back[:3, 3] = np.array(found.xyz_mm) / 1e3
    np.testing.assert_allclose(back, T, atol=6e-8)  # the digits that a job is told
    shift, turn = found.moved_from(at([1.2, -0.4, 0.59], [0, 0, 0]))
    assert shift == pytest.approx(0.01)
    assert turn == pytest.approx(Rotation.from_matrix(T[:3, :3]).magnitude())


def test_noisy_points_give_the_least_squares():
    rng = np.random.default_rng(3)
    measured = moved(at([1, 0, 0.5], [0.1, 0.2, 0.3])) + rng.normal(0, 1e-4, POINTS.shape)

    def off(x):
        return (Rotation.from_rotvec(x[:3]).apply(POINTS) + x[3:] - measured).ravel()

    other = least_squares(off, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    found = placement_from_points(POINTS, measured)
    # Both are at the minimum, where the sum of squares is flat.
    assert (found.residuals**2).sum() == pytest.approx(2 * other.cost, rel=1e-9)
    np.testing.assert_allclose(found.T_base_part[:3, 3], other.x[3:], atol=1e-8)


@pytest.mark.parametrize(
    ("nominal", "change", "message"),
    [
        (POINTS[:2], 0, "at least 3 points, got 2"),
        (np.outer([0, 0.1, 0.5, 0.9], [1, 2, 3]), 0, "lie on one line"),
        (np.zeros((4, 3)), 0, "lie on one line"),
        (POINTS, [[0, 0, 0], [0, 0, 0], [0, 0, 0.003], [0, 0, 0]], r"point \d of 4 is off .* mm"),
    ],
)
def test_points_that_tell_no_frame_are_refused(nominal, change, message):
    with pytest.raises(InputError, match=message):
        placement_from_points(nominal, moved(at([1, 0, 0], [0, 0, 1]), nominal) + change)


def test_points_in_another_order_are_refused():
    with pytest.raises(InputError, match="the order of the points"):
        placement_from_points(POINTS, moved(at([1, 0, 0], [0, 0, 1]), POINTS[[1, 0, 2, 3]]))


@pytest.mark.parametrize("angle", [0.0, 0.02, -1.5, 2.9])
def test_a_part_turned_about_the_first_axis_turns_that_joint_alone(made, angle):
    # Also where joint 1 comes to another side of half a turn on the way.
    free = replace(made, robot=made.robot.with_limits(lower=made.robot.lower * 3))
    T = at([0, 0, 0], [0, 0, angle])
    led = placed(free, T @ made.T_base_part)
    np.testing.assert_allclose(led.q - made.q, np.tile([angle, 0, 0, 0, 0, 0], (len(made.q), 1)),
                               atol=EXACT)  # fmt: skip
    wrapped = led.q - 2 * np.pi * led.turn
    assert ((wrapped > -np.pi) & (wrapped <= np.pi)).all()


def test_the_tool_keeps_its_pose_in_the_part_and_the_audit_its_limits(made):
    T = at([1.06, -0.14, 0.615], [0, 0, 0.01]) @ at([0, 0, 0], [0.01, 0, 0.55])
    led = placed(made, T)
    np.testing.assert_allclose(led.T_part_tip, made.T_part_tip, atol=EXACT)
    tip = made.robot.forward(led.q) @ made.T_flange_tip
    np.testing.assert_allclose(tip, T @ made.T_part_tip, atol=EXACT)
    turned = np.swapaxes(led.frames[:, :3, :3], 1, 2) @ tip[:, :3, :3]
    about = Rotation.from_matrix(turned).as_rotvec()
    np.testing.assert_allclose(about[:, 2], made.gamma, atol=1e-6)  # gamma is 0 by hand
    assert audit(led) == audit(made) == []
    assert led.cost == pytest.approx(np.abs(np.diff(led.q, axis=0)).sum())
    assert "moved to another placement" in led.proof.statement
    assert not led.proof.optimal


def test_a_place_out_of_reach_or_beyond_a_limit_is_told(made):
    far = made.T_base_part.copy()
    far[:3, 3] *= 3
    with pytest.raises(NoFeasiblePath, match=r"'skin/outer', node \d: out of the robot's reach"):
        placed(made, far)
    tight = replace(made, robot=made.robot.with_limits(upper=made.q.max(axis=0) + 0.01))
    assert audit(tight) == []
    found = audit(placed(tight, at([0, 0, 0], [0, 0, 0.05]) @ made.T_base_part))
    assert [issue.code for issue in found] == ["joint-limits"]


def test_an_endless_joint_stays_on_its_turn(made):
    endless = made.robot.with_limits(endless=[False] * 5 + [True])
    on = replace(made, robot=endless, q=made.q + 4 * np.pi * np.eye(6)[5])
    led = placed(on, made.T_base_part)
    np.testing.assert_allclose(led.q, on.q, atol=EXACT)
    assert (led.turn[:, 5] >= 1).all()


def test_moves_end_where_the_plans_begin_now(made, arm):
    home, retract = np.radians([0, -20, 10, 0, 60, 0]), 0.05
    start, end = (back_off(made, which, retract) for which in ("start", "end"))
    moves = [
        transfer_move(arm, home, start),
        transfer_move(arm, end, start),
        transfer_move(arm, end, home),
    ]
    T = at([0, 0, 0], [0, 0, 0.02]) @ made.T_base_part
    plans = [placed(made, T)] * 2
    led = place_moves(moves, plans, retract)
    shift = np.array([0.02, 0, 0, 0, 0, 0])
    for move, ends in zip(led, ((home, start + shift), (end + shift, start + shift),
                                (end + shift, home)), strict=True):  # fmt: skip
        np.testing.assert_allclose(move.q, ends, atol=EXACT)
        assert not move.clear
    (between,) = place_moves(moves[1:2], plans, retract)
    np.testing.assert_allclose(between.q, led[1].q)
    around = replace(moves[1], q=np.array([end, home, start]), time=np.arange(3.0))
    with pytest.raises(InputError, match="move 2 of 3 between contours goes around obstacles"):
        place_moves([moves[0], around, moves[2]], plans, retract)


TABLE = """\
# part 7, second shift
point;nominal_x_mm;nominal_y_mm;nominal_z_mm;measured_x_mm;measured_y_mm;measured_z_mm
A;0;0;0;1000,5;-200;300
B;500;0;0;1500,5;-200;300
C;0;250,25;0;1000,5;50,25;300
"""


def test_a_table_of_measured_points_is_read(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text(TABLE)
    nominal, measured = read_measured(path)
    np.testing.assert_allclose(nominal, [[0, 0, 0], [0.5, 0, 0], [0, 0.25025, 0]], atol=1e-15)
    np.testing.assert_allclose(measured - nominal, np.tile([1.0005, -0.2, 0.3], (3, 1)))
    path.write_text(TABLE.replace(",", ".").replace(";", ",").replace("_mm", " (cm)"))
    np.testing.assert_allclose(np.array(read_measured(path)), 10 * np.array([nominal, measured]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (TABLE, "", "holds no rows"),
        ("nominal_x_mm", "nominal_x", "line 2: expected columns nominal_x_mm .*, got 'nominal_x'"),
        ("nominal_x_mm", "nominal_x_furlong", "got 'nominal_x_furlong'"),
        (
            "nominal_y_mm",
            "nominal_x_mm",
            "line 2: expected each of the columns nominal_x_mm .* once",
        ),
        (
            "point;nominal_x_mm;",
            "point;point;",
            "line 2: expected each of the columns nominal_x_mm .* once",
        ),
        ("B;500;0", "B;500", "line 4: expected 7 columns, got 6"),
        ("B;500", "B;5oo", "line 4, column nominal_x: expected a number, got '5oo'"),
        ("1500,5", "nan", "line 4, column measured_x: expected a number, got 'nan'"),
    ],
)
def test_a_table_with_a_fault_is_refused_in_one_line(tmp_path, old, new, message):
    path = tmp_path / "points.csv"
    path.write_text(TABLE.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as refused:
        read_measured(path)
    assert str(refused.value).startswith(str(path))
    assert len(str(refused.value).splitlines()) == 1


def test_a_table_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file; expected a table of measured points"):
        read_measured(tmp_path / "none.csv")


def test_a_plan_with_external_axes_is_placed_with_the_axes_where_they_were(arm):
    """A table turns while a straight cut is made; the part lies elsewhere on it then."""
    turns = {"lower": -np.pi, "upper": np.pi, "velocity": 2.0, "acceleration": 4.0}
    robot = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, velocity=2.0, acceleration=4.0)
    robot = robot.with_positioner([0, 0, 1], [1.2, 0, 0.4], **turns)
    y = np.linspace(-0.2, 0.2, 9)
    line = Contour(np.c_[0 * y, y, 0 * y], np.tile([0, 0, -1.0], (9, 1)), name="line")
    tool, placement = frames()
    course = np.c_[np.linspace(0, 0.1, 9), np.linspace(0, 0.3, 9)]
    made = plan(line, robot, tool=tool, placement=placement, speed=0.05, external=course,
                gamma_step=np.radians(15))  # fmt: skip
    np.testing.assert_allclose(placed(made, placement).q, made.q, atol=EXACT)
    there = placed(made, at([0.02, -0.03, 0.01], [0.02, -0.01, 0.05]) @ placement)
    np.testing.assert_array_equal(there.external, made.external)
    np.testing.assert_allclose(there.T_part_tip, made.T_part_tip, atol=EXACT)
    assert audit(there, path_tolerance=1e-3) == []
