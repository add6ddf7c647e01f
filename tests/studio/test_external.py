"""Jobs with external axes: what the scene, the plans, the map and the clock say of them."""

import re
from functools import reduce

import numpy as np
import pytest

from jobs import RAIL_AND_TABLE
from kerfpath.job import prepare, read_job
from kerfpath.robots import chain_of
from kerfpath.studio.scene import scene_of
from studio.talk import QUICK, serving, talking, write_job
from studio.test_session import last, matrix

CELL = """
[cell]
near_miss_mm = 2
[[cell.fixture]]
name = "plate"
size_mm = [100, 100, 10]
xyz_mm = [1200, 0, 300]
on = "table"
[[cell.fixture]]
name = "post"
size_mm = [100, 100, 100]
xyz_mm = [1200, 900, 50]
"""
TURNED = (
    re.sub(r'\[\[contour\]\]\npick = "skin/hole11".*?\n\n', "", QUICK, flags=re.DOTALL)
    .replace("[tool]", RAIL_AND_TABLE + "[tool]")
    .replace("gamma_step_deg = 3", "gamma_step_deg = 6\nweights = [1, 1, 1, 1, 1, 1, 0.1, 0.1]")
    .replace("spacing_mm = 1", "spacing_mm = 2")
)
"""A small contour with a rail and a table, which cost little: they move."""
ARM, N = 6, 8


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write_job(tmp_path_factory.mktemp("external"), TURNED)


@pytest.fixture(scope="module")
def planned(path):
    with serving(path) as client, talking(client) as page:
        page.done(1)
        yield page, page.heard[:]


def rows(message, n=N):
    return np.array(message["q"]).reshape(-1, n)


def turn(axis, angle):
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    T = np.eye(4)
    T[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return T


def moved(joint, value):
    """How far an external axis has moved what it carries, by what README.md says."""
    if joint["unit"] == "m":
        T = np.eye(4)
        T[:3, 3] = value * np.array(joint["axis"])
        return T
    T = matrix(joint["T"])
    return T @ turn(joint["axis"], value) @ np.linalg.inv(T)


def frames(robot, q):
    """All frames and the tip, by what README.md says."""
    joints = list(zip(robot["joints"], q, strict=True))
    part, base = (
        [moved(joint, value) for joint, value in joints if joint["carries"] == what]
        for what in ("part", "robot")
    )
    found = [reduce(np.matmul, part[:k], np.eye(4)) for k in range(len(part), -1, -1)]
    found += [reduce(np.matmul, base[:k], np.eye(4)) for k in range(1, len(base) + 1)]
    for joint, value in joints:
        if joint["carries"] is None:
            found.append(found[-1] @ matrix(joint["T"]) @ turn(joint["axis"], value))
    return [*found, found[-1] @ matrix(robot["T_flange"]) @ matrix(robot["T_tool"])]


def test_the_scene_has_the_axes_after_the_joints_of_the_arm(planned, path):
    scene, robot = last(planned[1], "scene"), read_job(path).robot
    joints = scene["robot"]["joints"]
    assert [joint["name"] for joint in joints] == list(robot.joint_names)
    assert [joint["unit"] for joint in joints] == ["rad"] * 6 + ["m", "rad"]
    assert [joint["carries"] for joint in joints] == [None] * 6 + ["robot", "part"]
    rail, table = joints[ARM:]
    assert (rail["lower"], rail["upper"], rail["velocity"]) == pytest.approx((-0.4, 0.4, 1.0))
    assert table["endless"]
    assert table["lower"] is None


def test_a_page_that_does_as_it_is_told_has_the_frames_of_the_cell(planned, path):
    scene, job = last(planned[1], "scene"), read_job(path)
    robot = scene["robot"]
    # Products of a few matrices of numbers of order one, in double precision.
    assert frames(robot, scene["sample"]["q"])[-1] == pytest.approx(
        matrix(scene["sample"]["T"]), abs=1e-12
    )
    for q in np.random.default_rng(7).uniform(-1, 1, (5, N)):
        expected = chain_of(job.robot).frames(q[None])[0]
        assert np.array(frames(robot, q)[:-1]) == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
def test_bodies_move_with_what_carries_them(tmp_path):
    for text, fixtures in ((TURNED, {}), (TURNED + CELL, {"plate": 0, "post": 1, "floor": 1})):
        scene, _ = scene_of(prepare(read_job(write_job(tmp_path, text))), 1)
        frames = {body.name: body.frame for body in scene.bodies}
        assert fixtures.items() <= frames.items()
        assert frames["part"] == 0
        kinds = {
            kind: {b.frame for b in scene.bodies if b.kind == kind} for kind in ("robot", "head")
        }
        assert min(kinds["robot"]) == 2  # its base, on the rail
        assert kinds["head"] == {N}


def test_plans_lead_the_tip_along_contours_that_turn_with_the_table(planned):
    _, heard = planned
    robot = last(heard, "scene")["robot"]
    for contour in last(heard, "scene")["contours"]:
        made = last(heard, "plan", contour=contour["name"])
        q, points = rows(made), np.array(made["points"]).reshape(-1, 3)
        assert np.ptp(q[:, ARM:], axis=0).max() > 1e-3  # or this would say nothing
        assert points == pytest.approx(np.array(contour["points"]).reshape(-1, 3), abs=1e-8)
        for x, point in zip(q, points, strict=True):
            found = frames(robot, x)
            # Joints are said to a nanoradian, at arms of metres.
            assert found[-1][:3, 3] == pytest.approx((found[0] @ [*point, 1])[:3], abs=1e-6)
        assert np.array(made["weights"]).shape == (N,)
        assert made["passed"]


def test_the_tool_backs_off_straight_while_the_axes_stand(planned):
    _, heard = planned
    program, robot = last(heard, "program"), last(heard, "scene")["robot"]
    straight = [each for each in program["segments"] if each["kind"] in ("approach", "retract")]
    assert straight
    for segment in straight:
        q = rows(segment)
        assert np.ptp(q[:, ARM:], axis=0) == pytest.approx(0, abs=1e-9)
        tips = np.array([frames(robot, x)[-1] for x in q])
        way = tips[-1, :3, 3] - tips[0, :3, 3]
        off = tips[:, :3, 3] - tips[0, :3, 3]
        off -= np.outer(off @ way, way) / (way @ way)
        # Joints are said to a nanoradian; these are solved at every point.
        assert np.abs(off).max() < 1e-6
        assert np.abs(np.cross(tips[:, :3, 2], way)).max() < 1e-6


def test_the_map_is_that_along_the_plan_and_so_are_its_poses(planned):
    page, heard = planned
    robot = last(heard, "scene")["robot"]
    made = last(heard, "plan", contour="hole 10")
    page.say("map", contour="hole 10")
    seen = page.until("map", contour="hole 10")
    assert seen["external"] == "The map has rail and table where the plan has them."
    q = rows(made)
    for node in (0, len(q) // 2, len(q) - 1):
        gamma, posture = made["gamma"][node], made["posture"][node]
        page.say("reason", contour="hole 10", node=node, gamma=gamma, posture=posture)
        pose = page.until("pose")
        assert pose["admitted"]
        assert pose["q"][ARM:] == pytest.approx(q[node, ARM:], abs=1e-8)
        found = frames(robot, pose["q"])
        point = np.array(made["points"]).reshape(-1, 3)[node]
        assert found[-1][:3, 3] == pytest.approx((found[0] @ [*point, 1])[:3], abs=1e-6)
        turned = np.linalg.inv(found[0]) @ found[-1]
        own = frames(robot, q[node])
        off = (np.linalg.inv(own[0]) @ own[-1])[:3, :3].T @ turned[:3, :3]
        angle = np.arctan2(off[1, 0], off[0, 0])
        assert np.exp(1j * angle) == pytest.approx(np.exp(1j * (pose["gamma"] - gamma)), abs=1e-6)


@pytest.mark.slow
def test_what_is_changed_of_an_axis_is_planned_and_undone(planned):
    page, _ = planned
    page.say("edit", path=["robot", "external", 0, "velocity_mm_s"], value=500)
    revision = page.until("job")["revision"]
    page.done(revision)
    scene = last(page.heard, "scene")
    assert scene["revision"] == revision
    assert scene["robot"]["joints"][ARM]["velocity"] == pytest.approx(0.5)
    page.say("undo")
    page.done(page.until("job")["revision"])
    assert last(page.heard, "scene")["robot"]["joints"][ARM]["velocity"] == pytest.approx(1.0)
