"""Plans on request: waypoints and a robot's description in, joints over time out."""

import json
import subprocess
import sys

import numpy as np
import pytest

from kerfpath.cell import box_between, surface
from kerfpath.pipe import answer
from kerfpath.robots import robot

START = np.radians([20, -80, 90, -100, -80, 10])
ARM = robot("ur_ur10e").with_limits(acceleration=np.full(6, 8.0))
POST = [0.15, -0.32, 0.0], [0.9, -0.28, 0.5]
TOOL = np.eye(4)
TOOL[2, 3] = 0.1


def circle(count, radius=0.1, at=(0.6, 0.2, 0.3)):
    a = np.linspace(0, 2 * np.pi, count)
    return np.array(at) + radius * np.c_[np.cos(a), np.sin(a), 0 * a]


def asked(points, *, x=None, cell=None, **more):
    request = {
        "urdf": ARM.to_urdf(),
        "base": "base_link",
        "tip": "tool0",
        "joints": [f"joint_{i}" for i in range(1, 7)],
        "start": START.tolist(),
        "acceleration": 8.0,
        "gamma_step": np.radians(20),
        "T_world_base": np.eye(4).tolist(),
        "T_flange_tip": TOOL.tolist(),
        "points": np.asarray(points).tolist(),
        "axes": np.tile([0.0, 0, -1], (len(points), 1)).tolist(),
        "x": x,
        "name": "circle",
        "speed": 0.15,
        "max_step": 0.02,
    }
    return request | ({} if cell is None else {"cell": cell}) | more


def body(low, high, **more):
    vertices, triangles = surface(box_between(low, high))
    mesh = {"vertices": vertices.tolist(), "triangles": triangles.tolist()}
    T = np.eye(4).tolist()
    of = {"name": "post", "of": "post", "mesh": mesh, "T": T, "held": False, "touch": []}
    return of | more


def require_within_limits(found, request):
    """Every step keeps the limits, from rest to rest, and every waypoint is met."""
    time, q, v, a = (np.array(found[name]) for name in ("time", "q", "v", "a"))
    np.testing.assert_array_equal(q[0], request["start"])
    assert not v[[0, -1]].any()
    rate = np.diff(q, axis=0) / np.diff(time)[:, None]
    assert (np.abs(rate) <= ARM.velocity * (1 + 1e-9)).all()
    # From rest, between points and at the end; between two points the joints move evenly here.
    rate = np.vstack([0 * rate[:1], rate, 0 * rate[:1]])
    steps = np.concatenate([[0], np.diff(time), [0]])
    change = np.diff(rate, axis=0) / ((steps[1:] + steps[:-1]) / 2)[:, None]
    inner = np.ones(len(time), bool)
    inner[[0, -1]] = False
    assert np.abs(change[inner]).max() <= 8 * (1 + 1e-2)
    T = ARM.forward(q[found["waypoints"]]) @ TOOL
    np.testing.assert_allclose(T[:, :3, 3], request["points"], atol=2e-9)
    np.testing.assert_allclose(T[:, :3, 2], request["axes"], atol=2e-9)
    assert a.shape == q.shape


def test_a_circle_is_followed_from_where_the_robot_stands():
    request = asked(circle(60))
    found = answer(request)
    require_within_limits(found, request)
    # At the speed asked for but near its ends.
    k = found["waypoints"]
    took = np.diff(np.array(found["time"])[k])
    step = np.linalg.norm(np.diff(circle(60), axis=0), axis=1)
    assert np.median(step / took) == pytest.approx(0.15, rel=1e-9)
    assert (step / took <= 0.15 * (1 + 1e-9)).all()


def test_waypoints_far_apart_and_uneven_are_joined_by_straight_lines():
    points = np.array([[0.5, 0.1, 0.3], [0.61, 0.1, 0.3], [0.61, 0.43, 0.3], [0.6, 0.43, 0.3]])
    request = asked(points)
    found = answer(request)
    require_within_limits(found, request)
    tips = (ARM.forward(np.array(found["q"])) @ TOOL)[:, :3, 3]
    at = found["waypoints"]
    for one, two, first, last in zip(points, points[1:], at, at[1:], strict=False):
        along = (two - one) / np.linalg.norm(two - one)
        off = np.cross(tips[first : last + 1] - one, along)
        assert np.abs(off).max() < 1e-9
        assert np.linalg.norm(np.diff(tips[first : last + 1], axis=0), axis=1).max() <= 0.0201


def test_frames_hold_the_rotation_about_the_axis():
    points = circle(30)
    turn = np.linspace(0, 0.8, 30)
    x = np.c_[np.cos(turn), np.sin(turn), 0 * turn]
    found = answer(asked(points, x=x.tolist()))
    T = ARM.forward(np.array(found["q"])[found["waypoints"]]) @ TOOL
    np.testing.assert_allclose(T[:, :3, 0], x, atol=2e-9)
    np.testing.assert_allclose(T[:, :3, 3], points, atol=2e-9)


def test_what_is_around_is_kept_clear_of():
    around = {"meshes": {}, "disabled": [], "bodies": []}
    there = body(*POST)
    request = asked(circle(20), start=np.radians([100, -80, 90, -100, -80, 10]).tolist())
    free = answer(request)
    found = answer(request | {"cell": around | {"bodies": [there]}})
    tips = (ARM.forward(np.array(found["q"])) @ TOOL)[:, :3, 3]
    assert not ((tips > POST[0]) & (tips < POST[1])).all(axis=1).any()
    assert found["time"][-1] > free["time"][-1]
    q, at = np.array(found["q"]), found["waypoints"][0]
    straight = np.outer(np.linspace(0, 1, at + 1), q[at] - q[0]) + q[0]
    assert np.abs(q[: at + 1] - straight).max() > 0.05


def test_what_cannot_be_is_said():
    inside = body([-0.5, -0.5, 0.3], [1.5, 1.5, 2.0])
    around = {"meshes": {}, "disabled": [], "bodies": [inside]}
    found = answer(asked(circle(20), cell=around))
    assert found["error"] == "start"
    far = circle(20)
    far[12:] += [2.0, 0, 0]
    found = answer(asked(far, max_step=5.0))
    assert (found["error"], found["waypoint"]) == ("reach", 12)
    for request, said in (
        (asked(circle(1)), "expected two or more, got 1"),
        (asked(np.repeat(circle(5), 2, axis=0)), "0 and 1 are at the same point"),
        (asked(circle(20), start=[0, 0, 0]), "start_q: expected shape"),
        (asked(circle(20), speed=0), "speed: "),
        (asked(circle(20), urdf="no XML"), "the description: "),
        (asked(circle(20), axes=[[0, 0, 0]] * 20), "axis 0 has no length"),
        (asked(circle(20), axes=[[0, 0, 1], [0, 0, -1]] * 10), "point opposite ways"),
        (asked([[0.5, 0, 0.3], [0.5000002, 0, 0.3], [0.7, 0, 0.3]]), "nodes are needed"),
    ):
        found = answer(request)
        assert found["error"] == "input", found
        assert said in found["message"]


def test_requests_are_answered_over_a_pipe():
    requests = [json.dumps(asked(circle(20))), "no JSON", "[]", '{"urdf": ""}']
    done = subprocess.run(
        [sys.executable, "-m", "kerfpath.pipe"], input="\n".join([*requests, requests[0]]) + "\n",
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [found.get("error") for found in answers] == [None, "input", "input", "input", None]
    for found, said in zip(
        answers[1:4], ("Expecting value", "an object, got '[]'", "expected 'p"), strict=True
    ):
        assert said in found["message"]
    assert answers[0]["q"] == answers[-1]["q"] == answer(asked(circle(20)))["q"]
