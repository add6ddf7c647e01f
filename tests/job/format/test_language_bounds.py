"""A job plans within the joints that targets in its language can express."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kerfpath.errors import InputError
from kerfpath.job import read_job
from kerfpath.post import fanuc, inform, krl, languages
from kerfpath.robots import robot

JOB = """\
[robot]
model = "yaskawa_gp25"
acceleration_deg_s2 = [900, 900, 900, 900, 900, 900]
{limits}
[tool]
head = "laser-head-45"
[part]
file = "ring.csv"
xyz_mm = [1000, 0, 400]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "contour"
speed_m_min = 1
count = 20
[program]
language = "{language}"
"""


def limits_of(folder: Path, language: str, limits: str = "") -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 30)
    rows = zip(60 * np.cos(angle), 40 * np.sin(angle), strict=True)
    text = "".join(f"{x:.6f},{y:.6f},0,0,0,1\n" for x, y in rows)
    (folder / "ring.csv").write_text(f"x_mm,y_mm,z_mm,nx,ny,nz\n{text}")
    (folder / "job.toml").write_text(JOB.format(language=language, limits=limits))
    read = read_job(folder / "job.toml").robot.joint_limits()
    return np.degrees([read.lower, read.upper])


def test_a_job_in_inform_keeps_axis_t_within_a_turn(tmp_path: Path) -> None:
    """Its positions express R, T and S up to 360 deg; T of this arm turns to 455 deg."""
    free, bound = limits_of(tmp_path, "none"), limits_of(tmp_path, "inform")
    assert free[:, 5] == pytest.approx([-455, 455])
    assert bound[:, :5] == pytest.approx(free[:, :5])
    arm = robot("yaskawa_gp25")
    at_ends = np.zeros((2, 6))
    at_ends[:, 5] = np.radians(bound[:, 5])
    axes = np.degrees(inform.axes_from_joints(arm, at_ends)[:, 5])
    assert sorted(axes) == pytest.approx([-360, 360])


def test_no_angle_that_the_language_can_express_is_refused_before_planning(tmp_path: Path) -> None:
    beyond = (
        "lower_deg = [-180, -105, -86, -200, -150, 400]\nupper_deg = [180, 155, 160, 200, 150, 455]"
    )
    assert limits_of(tmp_path, "none", beyond)[0, 5] == pytest.approx(400)
    with pytest.raises(
        InputError, match=r"Yaskawa INFORM can express no angle of joint 6 from 400"
    ):
        limits_of(tmp_path, "inform", beyond)


@pytest.mark.parametrize("name", ["kuka_kr60_ha", "kuka_kr16_r1610_2"])
def test_bounds_of_krl_are_those_of_turn(name: str) -> None:
    arm = robot(name)
    least, most = languages()["krl"].bounds(arm)
    for joint in range(6):
        ends = np.zeros((2, 6))
        ends[:, joint] = least[joint], most[joint]
        axes = np.degrees(krl.axes_from_joints(arm, ends)[:, joint])
        assert sorted(axes) == pytest.approx([-360, 360])
    endless = arm.with_limits(endless=np.arange(6) == 5)
    assert np.isinf(languages()["krl"].bounds(endless)[0][5])


@pytest.mark.parametrize("name", ["fanuc_m20id_25", "fanuc_r2000ic_210f"])
def test_bounds_of_fanuc_are_those_of_the_turn_numbers(name: str) -> None:
    """Turn numbers hold -8 to 7; limits that a program can have are kept."""
    arm, language = robot(name), languages()["fanuc"]
    limits = arm.joint_limits()
    least, most = language.expressible(arm, limits.lower, limits.upper)
    np.testing.assert_array_equal([least, most], [limits.lower, limits.upper])
    wide = np.full(6, np.radians(5000))
    ends = np.zeros((2, 6))
    ends[:, [3, 4, 5]] = np.array(language.expressible(arm, -wide, wide))[:, [3, 4, 5]]
    for turns in ("J1 J4 J6", "J4 J5 J6"):
        counted = fanuc.posture(arm, ends, fanuc.FanucSettings(turns=turns))
        numbers = np.array([each[3:] for each in counted])[:, -2:]
        assert (np.abs(numbers) == 7).all()


def test_endless_joints_of_a_job_turn_back_only_in_a_language_that_counts_turns(
    tmp_path: Path,
) -> None:
    limits_of(tmp_path, "none")  # writes the drawing
    for language, bounded in (("fanuc", True), ("rapid", False), ("none", False)):
        text = JOB.format(language=language, limits="endless = [6]")
        (tmp_path / "job.toml").write_text(text.replace("yaskawa_gp25", "fanuc_m20ia"))
        within = read_job(tmp_path / "job.toml").turns_within
        assert (within is not None) == bounded
        if within is not None:
            assert np.isinf(within[0][:5]).all()
            assert np.degrees(within[1][5] - within[0][5]) == pytest.approx(2 * 2700, abs=0.01)
