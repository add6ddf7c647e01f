"""What a new user of the Python interface gets wrong: the answer has the type and what to do."""

import re

import numpy as np
import pytest

import kerfpath
from kerfpath.arrays import POSE
from kerfpath.auditor import Issue, Issues
from kerfpath.robots import postures_named

ARM = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
TOOL = [[0.8, 0, 0.6, 0.15], [0, 1, 0, 0], [-0.6, 0, 0.8, 0.30], [0, 0, 0, 1]]
PLACE = [[1, 0, 0, 1.2], [0, 1, 0, 0], [0, 0, 1, 0.5], [0, 0, 0, 1]]
ANGLE = np.linspace(0, 2 * np.pi, 24, endpoint=False)
POINTS = np.column_stack([0.05 * np.cos(ANGLE), 0.05 * np.sin(ANGLE), 0 * ANGLE])
AXES = np.tile([0.0, 0.0, -1.0], (24, 1))
CIRCLE = kerfpath.Contour(POINTS, AXES, closed=True).resample(count=24)
QUICK = {"method": "exact", "gamma_step": np.radians(20), "certify": None}


def planned(contour=CIRCLE, robot=ARM, **given):
    common = {"tool": TOOL, "placement": PLACE, "speed": 0.05}
    return kerfpath.plan(contour, robot, **{**common, **QUICK, **given})


WRONG = {
    "step in deg": (
        lambda: planned(gamma_step=5),
        r"gamma_step: .* 5 rad, which is 286.5 deg; unit\? for 5 deg give np.radians\(5\)",
    ),
    "tilt in deg": (lambda: kerfpath.Tilt(cone=10), r"tilt cone: .*unit\? .*np.radians\(10\)"),
    "window in deg": (
        lambda: kerfpath.GammaWindow(start=0, end=0.1, low=-90, high=90),
        r"gamma_windows low: .*unit\? .*np.radians\(-90\)",
    ),
    "rotation in deg": (
        lambda: planned(rotation=[360] * 6),
        r"rotation: .*unit\? .*radians\(360\)",
    ),
    "rotation of one": (lambda: planned(rotation=6.0), "largest angle of every joint in rad"),
    "speeds in deg/s": (
        lambda: ARM.with_limits(velocity=[175, 175, 175, 250, 250, 360]),
        r"velocity: .*unit\? .*np.radians\(175\)",
    ),
    "accelerations in deg/s^2": (
        lambda: ARM.with_limits(acceleration=[320, 270, 420, 1300, 1400, 2000]),
        r"acceleration: .*unit\? .*np.radians\(270\)",
    ),
    "contour in mm": (
        lambda: planned(kerfpath.Contour(2e3 * POINTS, AXES, closed=True).resample(count=24)),
        r"unit\? lengths are in m, got [12][0-9.]+ m.*divide by 1000",
    ),
    "placement in mm": (
        lambda: planned(placement=[[1, 0, 0, 1200], [0, 1, 0, 0], [0, 0, 1, 500], [0, 0, 0, 1]]),
        r"placement: unit\? .*which gives 1.2 m",
    ),
    "tool in mm": (
        lambda: planned(tool=[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 350], [0, 0, 0, 1]]),
        r"tool: unit\? .*got 350 m.*which gives 0.35 m",
    ),
    "name for a robot": (
        lambda: planned(robot="abb_irb4600_60_205"),
        r"expected a kerfpath.Robot, got str 'abb_irb4600_60_205'; make one with kerfpath.robot\(",
    ),
    "no robot": (lambda: planned(robot=None), "robot: expected a kerfpath.Robot, got None"),
    "points for a contour": (
        lambda: planned(POINTS),
        r"expected a kerfpath.Contour, got ndarray of shape \(24, 3\); make one with",
    ),
    "translation for a pose": (lambda: planned(tool=[0.1, 0, 0.3]), re.escape(POSE)),
    "nothing for a pose": (lambda: planned(tool=None), "tool: expected an array.* got None"),
    "plane points": (lambda: kerfpath.Contour(POINTS[:, :2], AXES), "x, y, z in m of every node"),
    "one axis": (lambda: kerfpath.Contour(POINTS, [0, 0, -1]), "np.tile"),
    "file for a plan": (lambda: kerfpath.audit("plan.json"), "kerfpath.read_plan_file"),
    "unknown posture": (lambda: planned(postures=["top"]), "postures: .*front|rear"),
    "number for a name": (lambda: kerfpath.robot(30), "id of a robot"),
    "half a name": (lambda: kerfpath.robot("KR 30"), "nearest: kuka_kr30_ha, kuka_kr30_r2100;"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_argument_is_refused_with_what_to_do(case):
    call, said = WRONG[case]
    with pytest.raises(kerfpath.InputError, match=said):
        call()


def test_robots_are_found_in_any_spelling():
    for name in ("KUKA KR 30 HA", "kuka-kr30-ha", "KR 30 HA", "kuka_kr30_ha"):
        assert kerfpath.robot(name).id == "kuka_kr30_ha"


def test_postures_in_words_are_those_with_these_words():
    options = kerfpath.PlanOptions(postures=["front/up"]).resolve(ARM, 0.1)
    assert options.postures == postures_named("front/up", ARM.kinematics)
    assert kerfpath.PlanOptions(postures="front/up").resolve(ARM, 0.1) == options
    mixed = kerfpath.PlanOptions(postures=["front/up/plus", 5]).resolve(ARM, 0.1)
    assert mixed.postures == (*postures_named("front/up/plus", ARM.kinematics), 5)
    made = planned(postures=["front/up"])
    assert set(made.posture.tolist()) <= set(options.postures)
    assert made.settings.postures == options.postures


def test_an_audit_prints_its_verdict_and_is_a_list():
    passed = kerfpath.audit(planned())
    assert passed == []
    assert str(passed) == repr(passed) == "audit passed"
    issue = Issue(level="error", code="velocity", message="too fast at node 3", node=3)
    failed = Issues([issue])
    assert not failed.passed
    assert str(failed) == "audit FAILED\n  error: too fast at node 3 [velocity]"
    noted = Issues([Issue(level="warning", code="jerk", message="coarse", node=0)])
    assert noted.passed
    assert repr(noted).startswith("audit passed, with 1 warning\n")
