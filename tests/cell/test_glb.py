"""Cells in motion as glTF: read by a reader of the format's own rules, and by trimesh."""

import json
import struct
from io import BytesIO

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import pose
from kerfpath import InputError
from kerfpath.cell import box, cell_of, glb_of, surface

NUMBERS = {5126: "<f4", 5125: "<u4"}
WIDTH = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
SINGLE = 2e-6
"""m, and entries of a rotation: numbers of a few m in single precision."""


@pytest.fixture(scope="module")
def cell(arm, tool):
    robot = arm.on_rail([0, 1, 0], lower=-1.0, upper=1.0, velocity=1.0, acceleration=2.0)
    turn = {"lower": -4.0, "upper": 4.0, "velocity": 1.0, "acceleration": 2.0}
    robot = robot.with_positioner([0, 0, 1], [1.5, 0.0, 0.3], name="table", **turn)
    things = {
        "clamp": box([0.1] * 3, pose([1.5, 0.2, 0.4])),
        "post": box([0.2] * 3, pose([0, -2, 1])),
    }
    return cell_of(robot, tool=tool, fixtures=things, on={"clamp": "table"}, floor=0.0)


@pytest.fixture(scope="module")
def motion(cell):
    """Every joint moves; the table by more than half a turn, where quaternions change sign."""
    share = np.linspace(0.0, 1.0, 9)[:, None]
    q = share * np.array([0.5, 0.4, 0.3, 3.5, 0.6, -3.5, 0.6, 3.9])
    return 5.0 + 2.0 * share[:, 0] ** 2, q


class Glb:
    """A binary glTF: its JSON, and its accessors as arrays."""

    def __init__(self, content):
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        chunks, at = {}, 12
        while at < length:
            size, name = struct.unpack_from("<I4s", content, at)
            assert size % 4 == 0
            chunks[name] = content[at + 8 : at + 8 + size]
            at += 8 + size
        assert list(chunks) == [b"JSON", b"BIN\0"]
        self.head, data = json.loads(chunks[b"JSON"]), chunks[b"BIN\0"]
        assert self.head["buffers"] == [{"byteLength": len(data)}]
        self.arrays = []
        for accessor in self.head["accessors"]:
            view, width = self.head["bufferViews"][accessor["bufferView"]], WIDTH[accessor["type"]]
            dtype, count = NUMBERS[accessor["componentType"]], accessor["count"] * width
            assert view["byteOffset"] % 4 == 0
            assert view["byteLength"] == 4 * count
            values = np.frombuffer(data, dtype, count, view["byteOffset"]).reshape(-1, width)
            for end, of in (("min", values.min), ("max", values.max)):
                assert accessor.get(end, of(axis=0).tolist()) == of(axis=0).tolist()
            self.arrays.append(values)

    def local(self, node, share):
        """The pose (4, 4) of a node after a share of its animation, as the format blends keys."""
        said, T = self.head["nodes"][node], np.eye(4)
        found = {path: np.array(said[path]) for path in ("translation", "rotation") if path in said}
        (animation,) = self.head["animations"]
        for channel in animation["channels"]:
            if channel["target"]["node"] == node:
                sampler = animation["samplers"][channel["sampler"]]
                time, keys = (self.arrays[sampler[end]] for end in ("input", "output"))
                place = share * time[-1, 0]
                k = min(int(np.searchsorted(time[1:, 0], place)), len(time) - 2)
                part = (place - time[k, 0]) / (time[k + 1, 0] - time[k, 0])
                found[channel["target"]["path"]] = (1 - part) * keys[k] + part * keys[k + 1]
        T[:3, 3] = found.get("translation", np.zeros(3))
        if "rotation" in found:
            T[:3, :3] = Rotation.from_quat(found["rotation"]).as_matrix()
        return T

    def placed(self, share):
        """The corners of each body in the scene, (V, 3) m, by its name."""
        drawn = {}

        def walk(node, T):
            T, said = T @ self.local(node, share), self.head["nodes"][node]
            if "mesh" in said:
                (body,) = self.head["meshes"][said["mesh"]]["primitives"]
                points = self.arrays[body["attributes"]["POSITION"]]
                assert self.arrays[body["indices"]].max() < len(points)
                drawn[said["name"]] = points @ T[:3, :3].T + T[:3, 3]
            for child in said.get("children", ()):
                walk(child, T)

        for root in self.head["scenes"][self.head["scene"]]["nodes"]:
            walk(root, np.eye(4))
        return drawn


def expected(cell, q):
    """Where the bodies are, y up."""
    frames, drawn = cell.frames(q[None])[0], {}
    for body in cell.bodies:
        T = frames[body.frame]
        x, y, z = (surface(body.shape)[0] @ T[:3, :3].T + T[:3, 3]).T
        drawn[body.name] = np.c_[x, z, -y]
    return drawn


def test_every_body_is_where_the_cell_has_it_at_every_time(cell, motion):
    time, q = motion
    file = Glb(glb_of(cell, time, q))
    for k in range(len(q)):
        placed = file.placed((time[k] - time[0]) / (time[-1] - time[0]))
        want = expected(cell, q[k])
        assert set(placed) == {body.name for body in cell.bodies}
        for name, points in want.items():
            # A floor reaches farther, and single precision is relative.
            size = max(1.0, np.abs(points).max())
            np.testing.assert_allclose(placed[name], points, atol=SINGLE * size)


def test_between_two_times_every_joint_goes_evenly(cell, motion):
    time, q = motion
    file = Glb(glb_of(cell, time, q))
    for k in range(len(q) - 1):
        share = ((time[k] + time[k + 1]) / 2 - time[0]) / (time[-1] - time[0])
        placed, want = file.placed(share), expected(cell, (q[k] + q[k + 1]) / 2)
        for name, points in want.items():
            size = max(1.0, np.abs(points).max())
            # The time of a key is in single precision, too: 1e-7 of 2 s at up to 8 rad/s and 2 m.
            np.testing.assert_allclose(placed[name], points, atol=2 * SINGLE * size)


def test_one_pose_is_a_file_too(cell):
    q = np.zeros((1, 8))
    file = Glb(glb_of(cell, [0.0], q))
    assert file.head["nodes"][0]["name"] == "table"
    assert {m["name"] for m in file.head["materials"]} == {
        "robot",
        "head",
        "part",
        "fixture",
        "floor",
    }


def test_trimesh_reads_the_first_pose(cell, motion):
    trimesh = pytest.importorskip("trimesh", reason="a benchmark requirement")
    scene = trimesh.load_scene(BytesIO(glb_of(cell, *motion)), file_type="glb")
    corners = np.vstack([*expected(cell, motion[1][0]).values()])
    np.testing.assert_allclose(scene.bounds, [corners.min(0), corners.max(0)], atol=1e-4)
    assert len(scene.geometry) == len(cell.bodies)


@pytest.mark.parametrize(
    ("time", "q", "said"),
    [
        ([0.0, 0.0], np.zeros((2, 8)), "each later than the one before"),
        ([0.0, 100.0, 100.000001], np.zeros((3, 8)), "the one before in single precision"),
        ([], np.zeros((0, 8)), "one or more times"),
        ([0.0, np.nan], np.zeros((2, 8)), "time: every number must be finite"),
        ([0.0, 1.0], np.zeros((2, 6)), "q: expected"),
        ([0.0, 1.0], np.zeros((3, 8)), "q: expected"),
        ([0.0], np.full((1, 8), np.inf), "q: every number must be finite"),
    ],
)
def test_what_is_no_motion_is_refused(cell, time, q, said):
    with pytest.raises(InputError, match=said):
        glb_of(cell, time, q)
