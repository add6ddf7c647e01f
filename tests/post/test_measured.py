"""Joints, poses and posture words as controllers themselves say them: facts that others published.

FANUC's are in test_post_fanuc.py, Staubli's in test_post_val3.py. No pair of a KUKA or a Universal
Robots controller, with joints, pose and words of one stand, was found in public.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Robot, robot
from kerfpath.post.arcs import faceplate, world
from kerfpath.post.inform import joints_from_axes, manipulator_type
from kerfpath.post.inform.controller import joints_at
from kerfpath.post.rapid import confdata
from kerfpath.robots import RobotLimits

PULSES = """
    208  -75312    1200       1 -127658     -69
 -65160 -163660 -127880  -27700  -57282   17604
-113924   37261  -15839  -53976  -37776   36022
 -88935   71842   22776  -38328  -30113   23127
 118388   64274   14120   47959  -74513  -50857
  75149 -145859 -123958   43122  -68431  -32519
  42804  -31159  -73294   53963  -32933  -35202
 148382  -75311    1200       0 -127658     -70
-154802  -75311    1200       0 -127658     -70
    206   -2208    1200       0 -127658     -70
    206 -166566    1200       0 -127658     -70
    206  -75311  123177       0 -127658     -70
    206  -75311  -86954       0 -127658     -70
    206  -75311    1200  153424 -127658     -70
    206  -75311    1200 -153424 -127658     -70
    206  -75311    1196       0    5700     -72
    206  -75312    1196       0 -132260     -71
    206  -75311    1200       0 -127658  109912
    206  -75311    1200       0 -127658 -109925
 -77633  -75310    1200       0 -127658     -70
"""
"""Pulses of S, L, U, R, B, T: icors2/Yaskawa-Job-Helper, fixtures/calibration/
CALIBRATION_STANDARD.JBI @ 87495b7570f6ce15027710c068869f5a0ab0ac87, of an AR2010 on a YRC1000."""
POSITIONS = """
 274.980    -0.008  875.000  179.9989  44.9997    0.0020 1,0,0,0,0,0
 622.573  -426.393 -101.139 -179.2940  -0.1745  -16.1282 1,0,0,0,0,0
 383.550 -1649.719 -105.735 -178.5001   0.5026  -41.4095 1,0,0,0,0,0
 933.399 -1756.204 -107.506 -178.6315   0.5025  -41.3677 1,0,0,0,0,0
 385.503  1598.413  -99.610 -179.5797  -0.3013   -6.9319 1,0,0,0,0,0
 613.623   374.870 -107.125 -179.5061  -0.2696   -6.9262 1,0,0,0,0,0
1163.774   478.153  -91.819 -179.4694  -0.2982   -6.9135 1,0,0,0,0,0
 -96.141   257.633  874.999  180.0000  45.0002  110.4650 1,0,0,0,0,0
-118.644  -248.076  874.999  180.0000  45.0002 -115.5590 1,0,0,0,0,0
 790.609     1.376  608.986  179.1795  83.3199   -0.7822 1,0,0,0,0,0
-414.668    -1.854  679.993 -179.8858  -2.8354    0.0446 1,0,1,0,0,0
-472.496    -2.009 1245.133 -179.8243 -31.5756    0.0258 1,0,1,0,0,0
 249.873    -0.073  250.348    0.7052  79.6569 -179.2402 1,0,0,0,0,0
-173.865  -186.177 1406.145  147.2368 -45.5002 -134.7207 1,0,0,0,0,0
-174.385   186.529 1405.578 -146.8336 -45.3818  134.7676 1,0,0,0,0,0
 818.445     1.458 1781.947   -6.0107 -88.9505 -173.7227 0,0,0,0,0,0
 229.198    -0.125  884.124  179.9802  49.6969   -0.0171 1,0,0,0,0,0
 404.652    79.634  874.999  179.9998  44.9999 -118.1512 1,0,0,0,1,0
 406.759   -76.550  874.999 -179.9998  44.9999  118.4297 1,0,0,0,1,0
 145.602  -233.286  874.998  180.0000  45.0007  -58.0294 1,0,0,0,0,0
"""
"""The same positions in the robot frame, mm and deg, with the six bits of RCONF that are used:
CALIBRATION_RELATIVE.JBI @ 549b81a697bf29b4d80f8966f80d891fa7b508e8."""
TOOL = [-88.687, 0.981, 463.147, 0.0, -45.0, 0.0]
"""Tool 0 there, mm and deg: fixtures/TOOL.CND @ 35f491a64b0548fd5198a3ed919d4599f95cdc67."""
PULSES_PER_DEG = np.array([241449, 295690, 254863, 204573, 147036, 206914]) / [
    180, 155, 160, 200, 150, 455,
]  # fmt: skip
"""The controller's pulse limits over its ranges: fixtures/RC.PRM there."""


def pose(values):
    """The pose (4, 4) m of mm and deg about fixed axes."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("xyz", values[3:6], degrees=True).as_matrix()
    T[:3, 3] = np.array(values[:3]) * 1e-3
    return T


def yaskawa():
    for pulses, row in zip(PULSES.split("\n")[1:-1], POSITIONS.split("\n")[1:-1], strict=True):
        *values, bits = row.split()
        axes = np.radians(np.array(pulses.split(), float) / PULSES_PER_DEG)
        yield axes, pose([float(v) for v in values]), tuple(int(bit) for bit in bits.split(","))


@pytest.mark.parametrize("number", range(20))
def test_a_yrc1000_says_the_same_pose_and_type_of_its_pulses(number):
    """Pulses of B leave 0.001 deg, over 1.7 m 0.03 mm; 0.05 mm and 0.01 deg are allowed."""
    arm = robot("yaskawa_ar2010")
    axes, T, bits = list(yaskawa())[number]
    q = joints_from_axes(arm, axes[None])[0]
    tip = np.linalg.inv(world(arm)) @ arm.forward(q) @ faceplate(arm) @ pose(TOOL)
    assert np.linalg.norm(tip[:3, 3] - T[:3, 3]) < 5e-5
    assert Rotation.from_matrix(tip[:3, :3].T @ T[:3, :3]).magnitude() < np.radians(0.01)
    assert tuple(manipulator_type(arm, [q])[0].tolist()) == bits


@pytest.mark.parametrize("number", range(20))
def test_pose_and_type_lead_back_to_the_pulses(number):
    """As a MOVJ to a position does; what digits leave of R and T is within 0.2 deg."""
    arm = robot("yaskawa_ar2010").with_limits(lower=np.full(6, -np.pi), upper=np.full(6, np.pi))
    axes, T, bits = list(yaskawa())[number]
    T_base_flange = world(arm) @ T @ np.linalg.inv(faceplate(arm) @ pose(TOOL))
    found = joints_at(arm, T_base_flange, bits, "B")
    assert found is not None
    assert np.abs(found - joints_from_axes(arm, axes[None])[0]).max() < np.radians(0.2)
    other = joints_at(arm, T_base_flange, (1 - bits[0], *bits[1:]), "B")
    assert other is None or np.abs(other - found).max() > 0.5, "the other wrist stands elsewhere"


ABB = """
 0    0    0    0 -90    0  0  0  0 1  1712.500    0.000 2455.000  1.000000  0.000000  0.000000  0.000000
 0    0    0    0  90    0  0  0  0 0  1712.500    0.000 1755.000  0.000000  0.000000 -1.000000  0.000000
 0    0    0    0 -30    0  0  0  0 1  2015.609    0.000 2280.000  0.866025  0.000000  0.500000  0.000000
 0    0    0    0  30    0  0  0  0 0  2015.609    0.000 1930.000  0.500000  0.000000  0.866025  0.000000
 0    0    0  185 -90    0  0  2  0 1  1712.500   30.505 1756.332  0.043619 -0.999048  0.000000  0.000000
 0    0    0 -185 -90    0  0 -3  0 1  1712.500  -30.505 1756.332  0.043619  0.999048  0.000000  0.000000
 0    0    0    0 -90  190  0  0  2 1  1712.500    0.000 2455.000  0.087156  0.000000  0.000000 -0.996195
 0    0    0    0 -90 -190  0  0 -3 1  1712.500    0.000 2455.000  0.087156  0.000000  0.000000  0.996195
 0    0    0    0 -90  350  0  0  3 1  1712.500    0.000 2455.000  0.996195  0.000000  0.000000 -0.087156
 0   40   60    0 -90    0  0  0  0 1  1342.975    0.000  174.949  0.642788  0.000000  0.766044  0.000000
 0   40  -60    0 -90    0  0  0  0 1  2163.547    0.000 2634.894  0.984808  0.000000 -0.173648  0.000000
 0  -60  -80    0 -90    0  0  0  0 5 -2074.529    0.000 1816.257  0.342020  0.000000 -0.939693  0.000000
 0  -60   80    0 -90    0  0  0  0 1   842.354    0.000 1383.068  0.984808  0.000000  0.173648  0.000000
 0   60   80    0 -90    0  0  0  0 1   581.095    0.000   26.094  0.342020  0.000000  0.939693  0.000000
90    0    0    0 -90    0  1  0  0 1     0.000 1712.500 2455.000  0.707107  0.000000  0.000000  0.707107
-150  0    0    0 -90    0 -2  0  0 1 -1483.068 -856.250 2455.000  0.258819  0.000000  0.000000 -0.965926
 0    0   60    0  90    0  0  0  0 0   886.346    0.000  624.060  0.500000  0.000000 -0.866025  0.000000
 0    0  -60    0  90    0  0  0  0 0  1146.154    0.000 3035.940  0.500000  0.000000  0.866025  0.000000
 0    0  -75    0  90    0  0  0  0 0   825.294    0.000 3211.229  0.608761  0.000000  0.793353  0.000000
 0    0  -80    0  90    0  0  0  0 0   709.526    0.000 3250.298  0.642788  0.000000  0.766044  0.000000
 0    0  -81.5  0  90    0  0  0  0 0   674.177    0.000 3260.033  0.652760  0.000000  0.757565  0.000000
 0    0  -82.2  0  90    0  0  0  0 2   657.596    0.000 3264.259  0.657375  0.000000  0.753563  0.000000
 0    0  -85    0  90    0  0  0  0 2   590.794    0.000 3279.128  0.675590  0.000000  0.737277  0.000000
 0    0  -90    0  90    0  0  0  0 2   470.000    0.000 3297.500  0.707107  0.000000  0.707107  0.000000
 0    0 -120    0  90    0  0  0  0 6  -246.346    0.000 3185.940  0.866025  0.000000  0.500000  0.000000
 0    0 -150    0  90    0  0  0  0 6  -810.940    0.000 2731.154  0.965926  0.000000  0.258819  0.000000
 0   40 -100    0  90    0  0  0  0 2  1869.290    0.000 2772.740  0.500000  0.000000  0.866025  0.000000
 0  -60 -100    0  90    0  0  0  0 6 -1911.498    0.000 1959.717  0.984808  0.000000  0.173648  0.000000
"""  # noqa: E501 - one position, one line
"""Axes (deg), cf1, cf4, cf6, cfx, X Y Z (mm) and q1 to q4 of tool0, as RobotStudio computed them:
LeroyDu56/robconv, tests/fixtures/probes/results/cfgprobe_robotstudio.txt @
57aa3650d2e232ec3bb32216e5939c5b482f1e9d, elbowprobe_robotstudio.txt @
b3ad552c5b52aaa58c18f556e8c596d8549fcaab. The lengths of the arm are those that the positions say;
its upper arm lies 200 mm over axis 3, so that it is stretched at J3 = -81.83 deg."""


@pytest.mark.parametrize("row", ABB.strip().split("\n"))
def test_a_virtual_abb_controller_says_the_same_pose_and_configuration(row):
    """Digits: 0.0005 mm and 5e-7 of a quaternion."""
    numbers = np.array(row.split(), float)
    lengths = {"a1": 0.32, "a2": -0.2, "b": 0.0, "c1": 0.78, "c2": 1.125, "c3": 1.3925, "c4": 0.35}
    like = robot("abb_irb6700_200_260")
    limits = RobotLimits(lower=np.full(6, -7.0), upper=np.full(6, 7.0))
    arm = Robot(id="probe", arm=replace(like.arm, geometry=lengths), limits=limits)
    q = np.radians(numbers[:6])
    T = arm.forward(q)
    np.testing.assert_allclose(T[:3, 3] * 1e3, numbers[10:13], atol=6e-4)
    turned = Rotation.from_quat(numbers[13:], scalar_first=True).as_matrix()
    np.testing.assert_allclose(T[:3, :3], turned, atol=3e-6)
    np.testing.assert_array_equal(confdata(arm, q[None])[0], numbers[6:10])
