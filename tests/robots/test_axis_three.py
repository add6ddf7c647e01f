"""What axis 3 of a controller measures: told of every arm, or no program that says it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.urdf.test_urdf import frames_of, joint, urdf

from conftest import rebuilt
from kerfpath import InputError, Robot, robot
from kerfpath.post import fanuc, inform, krl, rapid, val3
from kerfpath.post.languages import language
from kerfpath.robots import Arm, robot_ids

SAYS = {"ABB": rapid, "FANUC": fanuc, "KUKA": krl, "Staubli": val3, "Yaskawa": inform}
OPW = [name for name in robot_ids() if robot(name).kinematics == "opw"]
CODED = {"ABB": "rapid", "FANUC": "fanuc", "Yaskawa": "inform"}
"""Makers whose arms of six axes may be coupled, and what their programs are written in."""


def counted_otherwise(tmp_path, r, flip, shift):
    """Write a library robot as a URDF whose joints are p = flip q + shift, limits and all."""
    origins, axes, flange = frames_of(r)
    names = ["base", *(f"link_{i}" for i in range(1, 7)), "tool0"]
    joints = []
    for i in range(6):
        axis = flip[i] * axes[i]
        origins[i][:3, :3] = origins[i][:3, :3] @ Rotation.from_rotvec(-shift[i] * axis).as_matrix()
        ends = [-3.0, 3.0] if r.lower is None else [r.lower[i], r.upper[i]]
        low, high = sorted((flip[i] * np.array(ends) + shift[i]).tolist())
        limit = f'<limit lower="{low!r}" upper="{high!r}" velocity="2" effort="1"/>'
        joints.append(joint(f"j{i}", names[i], names[i + 1], origins[i], axis, inside=limit))
    end = joint("end", "link_6", "tool0", flange, kind="fixed", inside="")
    return urdf(tmp_path, [*joints, end])


def admits(r, q):
    limits = r.joint_limits()
    sums = q @ limits.rows.T
    inside = (q >= limits.lower - 1e-9) & (q <= limits.upper + 1e-9)
    held = (sums >= limits.row_lower - 1e-9) & (sums <= limits.row_upper + 1e-9)
    return (inside | limits.endless).all(axis=1) & held.all(axis=1)


@pytest.mark.parametrize("maker", ["told", "not told"])
@pytest.mark.parametrize("name", OPW)
def test_a_described_robot_has_the_axes_and_limits_of_the_library(tmp_path, name, maker):
    r = robot(name)
    draw = np.random.default_rng(robot_ids().index(name))
    flip, shift = draw.choice([-1.0, 1.0], 6), np.radians(draw.uniform(-80, 80, 6))
    path = counted_otherwise(tmp_path, r, flip, shift)
    back = Robot.from_urdf(path, manufacturer=r.manufacturer if maker == "told" else "")
    if maker == "not told" and back.axis_3 == "":
        # Arms by several makers have these lengths, and are not counted alike: not known, refused.
        assert not [t for t in CODED.values() if not language(t).refusal(back)]
        return
    assert back.axis_3 == r.axis_3
    low, high = (-3, 3) if r.lower is None else (r.lower, r.upper)
    q = draw.uniform(low, high, (400, 6))
    p = flip * q + shift
    np.testing.assert_allclose(back.forward(p), r.forward(q), atol=1e-9)
    if maker == "told":
        says = SAYS[r.manufacturer]
        off = says.axes_from_joints(back, p) - says.axes_from_joints(r, q)
        np.testing.assert_allclose(off, 0, atol=1e-9)  # not even by a turn
        np.testing.assert_allclose(
            says.joints_from_axes(back, says.axes_from_joints(back, p)), p, atol=1e-9
        )
    if r.lower is not None:
        ours, theirs = admits(r.with_limits(endless=np.zeros(6, bool)), q), admits(back, p)
        assert not (theirs & ~ours).any()
        alike = [t for t in OPW if t in " ".join(back.notes)]
        if len(alike) == 1:
            np.testing.assert_array_equal(ours, theirs)


def stretched(tmp_path, name, **options):
    """A robot of the library with another forearm: an arm that the library does not have."""
    r = robot(name)
    longer = rebuilt(r, geometry={**r.geometry, "c3": r.geometry["c3"] + 0.05})
    path = counted_otherwise(tmp_path, longer, np.ones(6), np.zeros(6))
    return Robot.from_urdf(path, manufacturer=r.manufacturer, **options)


@pytest.mark.parametrize("name", ["abb_irb2400_155", "fanuc_m710ic_50", "yaskawa_gp25"])
def test_an_arm_that_is_not_known_is_not_written_until_its_axis_3_is_told(tmp_path, name):
    coded = language(CODED[robot(name).manufacturer])
    unknown = stretched(tmp_path, name)
    assert unknown.axis_3 == ""
    assert "axis_3 = " in coded.refusal(unknown)
    assert not language("csv").refusal(unknown)  # which says the joints of the description
    r = robot(name)
    if r.axis_3 == "serial":
        told = stretched(tmp_path, name, axis_3="serial")
        assert told.couplings == ()
    else:
        ends = r.couplings[0].lower, r.couplings[0].upper
        told = stretched(tmp_path, name, axis_3="horizontal", axis_3_limits=ends)
        (mine,) = told.couplings
        q = np.random.default_rng(3).uniform(-3, 3, (50, 6))
        # The limits that were told are those of the axis as its controller shows it.
        axis = SAYS[r.manufacturer].axes_from_joints(told, q)[:, 2]
        np.testing.assert_allclose(axis - ends[0], q @ mine.row - mine.lower, atol=1e-9)
        np.testing.assert_allclose(ends[1] - axis, mine.upper - q @ mine.row, atol=1e-9)
    assert not coded.refusal(told)


def test_the_parallel_rod_of_a_description_is_that_of_the_library(tmp_path):
    r = robot("abb_irb2400_155")
    path = counted_otherwise(tmp_path, r, np.ones(6), np.zeros(6))
    back = Robot.from_urdf(path, manufacturer="ABB")
    q = np.radians([[10.0, 26.8, 15.91, 0, 30, 0]])
    assert np.degrees(rapid.axes_from_joints(back, q)[0, 2]) == pytest.approx(42.71)
    assert "abb_irb2400_155" in back.notes[0]
    assert not admits(back, np.radians([[0.0, 60, 60, 0, 0, 0]]))


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("abb_irb2400_155", {"axis_3": "serial"}, "expected 'horizontal', got 'serial'"),
        ("fanuc_m20ia", {"axis_3": "serial"}, "the convention of controllers by FANUC"),
        ("kuka_kr16_2", {"axis_3": "horizontal", "axis_3_limits": [-1, 1]}, "expected 'serial'"),
        ("abb_irb2400_155", {"axis_3": "horizontal"}, 'two limits of axis 3 with "horizontal"'),
        ("abb_irb2400_155", {"axis_3_limits": [-1, 1]}, 'expected them with axis_3 = "horizontal"'),
        ("abb_irb4600_60_205", {"axis_3": "serial", "axis_3_limits": [-1, 1]}, "none with"),
        (
            "abb_irb2400_155",
            {"axis_3": "horizontal", "axis_3_limits": [9, 10]},
            "is outside the range of axis 3",
        ),
    ],
)
def test_what_is_told_wrongly_of_axis_3_is_refused(tmp_path, name, options, said):
    r = robot(name)
    path = counted_otherwise(tmp_path, r, np.ones(6), np.zeros(6))
    with pytest.raises(InputError) as refused:
        Robot.from_urdf(path, manufacturer=r.manufacturer, **options)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_two_robots_of_a_maker_with_the_same_lengths_count_axis_3_otherwise():
    for name in OPW:
        r = robot(name)
        arm = Robot(
            id="arm",
            arm=Arm(geometry=r.geometry, sign=r.sign, offset=r.offset),
            manufacturer=r.manufacturer,
        )
        assert arm.with_axis_3().axis_3 == r.axis_3
