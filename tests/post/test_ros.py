"""Programs as ROS trajectories: what moves when, written and read back."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.post.cases import CASES

from kerfpath import InputError, robot
from kerfpath.post import (
    CircularMove,
    Comment,
    JointMove,
    build_program,
    post,
)
from kerfpath.post.ros import RosSettings, trajectory
from kerfpath.transfer import least_time
from programs import arc, changed, codes, five_axis_program, frames, hand_plan, with_steps

CASE = CASES["ros"]
GOLDEN = CASE.golden


@pytest.fixture(scope="module")
def arm(cell):
    return cell[0]


@pytest.fixture(scope="module")
def two(arm):
    """Two contours, so that a joint move leads from one to the other."""
    plans = [hand_plan(arc(name), arm, *frames(), speed=0.12) for name in ("one", "two")]
    return build_program(plans)


def same(program, settings=None):
    CASE.reads_back(program, settings)


def points_of(text):
    """Every point as five arrays, by JSON: flow mappings whose keys are quoted are JSON."""
    lines = [line[2:] for line in text.splitlines() if line.startswith("- {positions")]
    points = [json.loads(re.sub(r"(\w+):", r'"\1":', line)) for line in lines]
    names = ("positions", "velocities", "accelerations")
    time = [p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] * 1e-9 for p in points]
    return np.array(time), *(np.array([p[name] for p in points]) for name in names)


# The text.


def test_a_ros_2_type_store_takes_the_message_and_gives_it_back():
    """The fields of trajectory_msgs/msg/JointTrajectory, through CDR, as a bag stores them."""
    pytest.importorskip("rosbags", reason="a development requirement; see requirements/dev.txt")
    from rosbags.typesys import Stores, get_typestore
    from ruamel.yaml import YAML

    message = YAML(typ="safe").load(GOLDEN["cut_skin_outer.yaml"])
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    points = [
        types["JointTrajectoryPoint"](
            **{k: np.array(v, float) for k, v in point.items() if k != "time_from_start"},
            time_from_start=types["Duration"](**point["time_from_start"]),
        )
        for point in message["points"]
    ]
    header = types["Header"](types["Time"](**message["header"]["stamp"]), "")
    kind = "trajectory_msgs/msg/JointTrajectory"
    sent = store.types[kind](header=header, joint_names=message["joint_names"], points=points)
    got = store.deserialize_cdr(store.serialize_cdr(sent, kind), kind)
    time, q, *_ = points_of(GOLDEN["cut_skin_outer.yaml"])
    assert got.joint_names == [f"joint_{i}" for i in range(1, 7)]
    np.testing.assert_array_equal([point.positions for point in got.points], q)
    back = [p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in got.points]
    np.testing.assert_array_equal(back, time)
    events = YAML(typ="safe").load(GOLDEN["cut_skin_outer.events.yaml"])["events"]
    assert [event["set"] for event in events if "set" in event] == ["gas", "laser", "laser", "gas"]
    assert [event["to"] for event in events if "set" in event] == [True, True, False, False]


def test_joints_are_called_what_the_driver_calls_them(program):
    names = ["a_b", "c", "d", "e", "f", "g"]
    named = RosSettings(joint_names=names)
    text = post(program, "ros", named)["cut_skin_outer.yaml"]
    assert f"joint_names: {json.dumps(names)}" in text
    same(program, named)
    for wrong, code in (
        (names[:5], "joint-names"),
        (["a", *names[:4], "A"], "name-collision"),
        (['"x', *names[:5]], "name-identifier"),
    ):
        assert codes(program, "error", "ros", RosSettings(joint_names=wrong)) == [code]


# The motion.


def test_targets_are_reached_when_planned_and_points_follow_the_plan(two):
    """Times to 1 ns, joints to 1e-10 rad: the digits."""
    motion = trajectory(two, 0.02)
    assert (np.diff(motion.time) > 0).all()
    steps = [step for step in two.steps if not isinstance(step, Comment)]
    at = motion.done
    assert len(at) == len(steps)
    np.testing.assert_array_equal(motion.q[at], [step.q for step in steps])
    took = np.diff(motion.time[at])
    for k, step in enumerate(steps[1:]):
        if isinstance(step, JointMove) and step.duration is None:
            assert took[k] == 0, "where a contour may be begun, the robot is there already"
        elif isinstance(step, JointMove):
            dq = (step.q - steps[k].q)[None]
            least = least_time(dq, *two.robot.speed_limits())[0]
            # A quarter of the speed, though more is given to those who gain it in full.
            assert step.duration == pytest.approx(least / 0.25, rel=1e-12)
            assert took[k] == pytest.approx(step.duration, rel=1e-12)
        else:
            assert took[k] == pytest.approx(step.duration, rel=1e-12)


@pytest.mark.parametrize("step_ms", [1, 20, 300])
def test_joint_moves_keep_their_share_of_velocity_and_its_square_of_acceleration(two, step_ms):
    """Written velocities and accelerations; 1 % for the corners of the trapezoid."""
    time, q, velocity, acceleration = points_of(
        post(two, "ros", RosSettings(step_ms=step_ms))["cut_one.yaml"]
    )
    motion = trajectory(two, step_ms * 1e-3)
    number = len(two.sections[0].moves)
    first, last = motion.done[number], motion.done[number + 1]
    speed, gain = two.robot.speed_limits()
    rows = slice(first, last + 1)
    assert np.diff(time[rows]).max() <= step_ms * 1e-3 + 1e-9
    top = (np.abs(velocity[rows]) / speed).max() / 0.25
    push = (np.abs(acceleration[rows]) / gain).max() / 0.25**2
    assert max(top, push) <= 1.01
    if step_ms < 300:
        assert push > 0.98  # the limit is used
    way = q[last] - q[first]
    share = (q[rows] - q[first]) @ way / (way @ way)
    np.testing.assert_allclose(q[rows], q[first] + share[:, None] * way, atol=1e-9)
    assert (np.diff(share) > 0).all()


def test_straight_moves_from_stop_to_stop_are_straight(program):
    """The approach is 50 mm; a joint motion there would leave the line by some 0.1 mm."""
    motion = trajectory(program, 0.02)
    rows = slice(motion.done[0], motion.done[1] + 1)
    tips = program.robot.forward(motion.q[rows]) @ program.T_flange_tip
    assert len(tips) == 26  # 0.5 s
    way = tips[-1, :3, 3] - tips[0, :3, 3]
    share = (tips[:, :3, 3] - tips[0, :3, 3]) @ way / (way @ way)
    off = tips[:, :3, 3] - tips[0, :3, 3] - share[:, None] * way
    assert np.abs(off).max() < 1e-9
    tau = np.linspace(0, 1, 26)
    np.testing.assert_allclose(share, 3 * tau**2 - 2 * tau**3, atol=1e-6)
    turned = Rotation.from_matrix(tips[0, :3, :3].T @ tips[:, :3, :3]).magnitude()
    assert turned.max() < 1e-6  # backing off does not turn the tool


def test_rates_are_central_differences_and_nothing_at_stops(two):
    """Against np.gradient stretch by stretch, and numpy's parabola through three points."""
    time, q, velocity, acceleration = points_of(post(two, "ros")["cut_one.yaml"])
    stops = trajectory(two, 0.02).stops
    assert (velocity[stops] == 0).all()
    assert (acceleration[stops] == 0).all()
    expected = np.gradient(q, time, axis=0)
    np.testing.assert_allclose(velocity[~stops], expected[~stops], atol=1e-6)
    for k in np.flatnonzero(~stops)[::7]:
        bend = np.polyfit(time[k - 1 : k + 2] - time[k], q[k - 1 : k + 2], 2)[0]
        np.testing.assert_allclose(acceleration[k], 2 * bend, atol=1e-4)


def test_waits_keep_the_position(program):
    time, q, velocity, _ = points_of(GOLDEN["cut_skin_outer.yaml"])
    motion = trajectory(program, 0.02)
    before, after = motion.done[1:3]
    assert after == before + 1
    assert time[after] - time[before] == pytest.approx(0.3, abs=1e-9)
    np.testing.assert_array_equal(q[after], q[before])
    assert (velocity[[before, after]] == 0).all()


@pytest.mark.parametrize("id", ["ur_ur10e", "staubli_tx2_160l"])
def test_arms_of_other_makers_read_back(id):
    tool, placement = frames()
    placement = placement.copy()
    placement[:3, 3] = 0.75, 0.1, 0.2
    arm = robot(id).with_limits(acceleration=np.radians([500] * 6))
    same(build_program([hand_plan(arc(), arm, tool, placement)]))


def test_an_arm_of_five_axes_reads_back():
    same(five_axis_program())


# What the preflight refuses.


def test_what_a_trajectory_cannot_say_is_refused(program):
    steps = program.sections[0].steps
    assert codes(changed(program, 1, zone=0.01), "error", "ros") == ["zone"]
    assert codes(changed(program, -1, zone=0.001), "error", "ros") == ["zone"]
    assert codes(with_steps(program, steps[2:]), "error", "ros") == ["start"]
    assert codes(changed(program, 5, duration=np.nan), "error", "ros") == ["duration"]
    bent = CircularMove(
        T_part_tip=steps[5].T_part_tip,
        q=steps[5].q,
        T_part_via=steps[4].T_part_tip,
        q_via=steps[4].q,
        speed=0.1,
        duration=0.2,
        zone=0.0003,
    )
    assert codes(with_steps(program, [*steps[:4], bent, *steps[6:]]), "error", "ros") == ["arc"]
    limits = replace(program.robot.limits, acceleration=None)
    unknown = replace(program, robot=replace(program.robot, limits=limits))
    assert codes(unknown, "error", "ros") == ["joint-speed"]


def test_limits_that_the_trajectory_passes_are_named(program):
    quick = changed(program, 6, duration=0.001)
    assert codes(quick, "error", "ros") == ["joint-velocity"]
    weak = replace(program, robot=program.robot.with_limits(acceleration=np.full(6, 0.05)))
    assert codes(weak, "warning", "ros") == ["joint-acceleration", "air-moves"]


def test_a_straight_move_that_changes_posture_is_refused(program):
    """The wrist flipped, joints 4 and 6 by nearly half a turn."""
    q = program.sections[0].steps[2].q
    flipped = q * [1, 1, 1, 1, -1, 1] + np.array([0, 0, 0, 2.8, 0, -2.8])
    assert codes(changed(program, 2, q=flipped), "error", "ros") == ["straight"]


def test_more_points_than_a_file_may_have_are_refused(program):
    with pytest.raises(InputError, match=r"yaml: the program has \d+ lines, but lines_per_file"):
        post(program, "ros", RosSettings(lines_per_file=100, step_ms=1))


# What the reader refuses.


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (".yaml", "joint_2", "joint_x", "line 8: expected 'joint_names: ["),
        (".yaml", "- {positions", "- {places", "line 10: not a point of a trajectory"),
        (".yaml", "positions: [0.", "positions: [0, 0.", "line 10: expected 6 numbers"),
        (".yaml", "positions: [0.", "positions: [0.1.", "line 10: not a point of a trajectory"),
        (".yaml", "nanosec: 0}}", "nanosec: 00}}", "line 10: not a point of a trajectory"),
        (".yaml", "start: {sec: 0", "start: {sec: 00", "line 10: not a point of a trajectory"),
        (".yaml", "nanosec: 0}}", "nanosec: 1234567890}}", "line 10: not a point of a trajectory"),
        (".yaml", "positions: [0.", "positions: [00.", "line 10: not a point of a trajectory"),
        (".events.yaml", "- {time: 0", "- {time: 00", "line 10: not expected here"),
        (".yaml", "nanosec: 20000000}", "nanosec: 0}", "expected a time after that of the point"),
        (".yaml", "[0.12333", "[0.12334", "the velocities do not follow from the positions"),
        (".events.yaml", "cut_skin_outer.yaml", "x.yaml", "got those of x.yaml"),
        (".events.yaml", "events:", "events: []", "line 7: expected events, got"),
        (".events.yaml", '- {section: "skin_outer"}\n', "", "expected a section first"),
        (".events.yaml", "done: linear}", "done: wait}", "the robot moves during a wait"),
        (".events.yaml", "done: linear}", "done: joint}", "do not lie on a straight line"),
        (".events.yaml", "done: wait}", "done: waited}", "not expected here: '- {time: 0.8"),
        (".events.yaml", "0.800000000", "0.810000000", "the trajectory has no point"),
        (".events.yaml", "{time: 0.500000000, done", "{time: 0.800000000, done", "stops before"),
        (".events.yaml", "time: 0.000000000", "time: 0.020000000", "that is done at time 0"),
        (".events.yaml", "done: wait}", "done: wait}\n- {time: 0.800000000, set: laser, to: true}",
         "a switch must follow a linear move"),
    ],
)  # fmt: skip
def test_the_reader_refuses_what_it_does_not_know(file, old, new, message):
    CASE.refuses(f"cut_skin_outer{file}", old, new, message)


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (".events.yaml", "the trajectory goes on after the last event"),
        (".yaml", "must be at rest at the first and last point"),
    ],
)
def test_the_reader_refuses_a_lost_end(file, message):
    name = f"cut_skin_outer{file}"
    short = "\n".join(GOLDEN[name].splitlines()[:-1])
    with pytest.raises(InputError, match=message):
        CASE.read({**GOLDEN, name: short})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("time: 0.480000000", "time: 0.470000000"),
        ("set: laser, to: false", "set: gas, to: true"),
        ("tip_in_flange: [0.05", "tip_in_flange: [0.06"),
        ("part_in_base: [1.05", "part_in_base: [1.06"),
    ],
)
def test_an_edited_trajectory_is_read_as_edited(old, new):
    CASE.finds("cut_skin_outer.events.yaml", old, new)


def test_another_target_is_found_with_its_place(program):
    other = changed(program, 6, q=program.moves[5].q + 1e-4)
    assert [issue.place for issue in CASE.deviations(program, CASE.post(other))] != []
