"""Arms as they are drawn: every robot of the library, where its joints are, and in its picture."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from kerfpath.cell import colours_of, drawn_links, picture_of
from kerfpath.robots import robot, robot_ids


@pytest.mark.parametrize(
    "name", ["abb_irb4600_60_205", "fanuc_m10ia", "ur_ur10e", "kuka_lbr_iiwa14_r820"]
)
def test_links_meet_at_their_joints_at_any_angles(name):
    one = robot(name)
    rng = np.random.default_rng(5)
    limits = one.joint_limits()
    q = rng.uniform(np.maximum(limits.lower, -2), np.minimum(limits.upper, 2), (5, one.joints))
    size = sum(abs(value) for value in one.geometry.values())
    for frames in one.arm.joint_chain().frames(q):
        ends = {}
        for link in drawn_links(one):
            T = frames[link.frame]
            points = link.vertices @ T[:3, :3].T + T[:3, 3]
            ends.setdefault(link.frame, []).append(points)
        for frame in range(one.joints):
            here, after = np.vstack(ends[frame]), np.vstack(ends[frame + 1])
            gap = np.linalg.norm(here[:, None] - after[None], axis=2).min()
            # Neighbours share a disc about their joint, whose corners turn: they stay close.
            assert gap < 0.04 * size
    end = one.forward(q[0])[:3, 3]
    frames = one.arm.joint_chain().frames(q[:1])[0]
    last = np.vstack([each.vertices for each in drawn_links(one) if each.frame == one.joints])
    shown = last @ frames[-1, :3, :3].T + frames[-1, :3, 3]
    assert np.linalg.norm(shown - end, axis=1).min() < 0.04 * size


def test_every_robot_of_the_library_has_a_picture_in_its_colours_with_its_reach():
    for name in robot_ids():
        one = robot(name)
        picture = ET.fromstring(picture_of(one))
        shapes = picture.findall(".//{*}polygon")
        assert {shape.get("fill") for shape in shapes} == set(colours_of(one))
        assert f"{one.reach:g} m" in picture.get("aria-label")
        x, y = np.array(
            [corner.split(",") for shape in shapes for corner in shape.get("points").split()], float
        ).T
        _, _, width, height = map(float, picture.get("viewBox").split())
        assert 0 <= x.min() < x.max() <= width
        assert 0 <= y.min() < y.max() <= height
