"""How far a run leaves its contour: corners of a square, known in closed form."""

import numpy as np
import pytest

from kerfpath import Contour
from kerfpath.execution import ToolMotion, deviation_of
from kerfpath.execution.executed import Executed
from kerfpath.post import LinearMove

SIDE, ZONE = 0.02, 0.004


def run_round_a_corner(zone, lean=0.0):
    T = np.tile(np.eye(4), (3, 1, 1))
    T[:, :3, 3] = [[0, 0, 0], [SIDE, 0, 0], [SIDE, SIDE, 0]]
    c, s = np.cos(lean), np.sin(lean)
    T[:, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    moves = [
        LinearMove(T_part_tip=pose, q=np.zeros(6), speed=0.1, duration=0.2, zone=each)
        for pose, each in zip(T[1:], (zone, 0.0), strict=True)
    ]
    motion = ToolMotion.of(T[0], moves)
    time = np.linspace(0, motion.time[-1], 2001)
    none = np.zeros((len(time), 6))
    run = Executed(
        section="", tool_motion=motion, time=time, planned=time, q=none, T=motion.poses(time),
        velocity_share=none,
        acceleration_share=none, velocity_bound=0.0, acceleration_bound=0.0,
    )  # fmt: skip
    points = np.array([[0, 0, 0], [SIDE / 2, 0, 0], [SIDE, 0, 0], [SIDE, SIDE / 2, 0]])
    points = np.vstack([points, [[SIDE, SIDE, 0]]])
    return run, Contour(points, np.tile([0.0, 0.0, 1.0], (5, 1)))


def test_a_rounded_corner_is_a_quarter_of_its_zone_from_either_side():
    run, path = run_round_a_corner(ZONE)
    off = deviation_of(run, path)
    # The vertex of the parabola: a quarter of the zone inwards along both sides.
    assert off.tip == pytest.approx(ZONE / 4, rel=1e-3)
    assert off.tip_time == pytest.approx(SIDE / 0.1, abs=1e-3)
    assert off.axis == pytest.approx(0, abs=1e-9)


def test_a_lean_of_the_tool_is_its_angle():
    run, path = run_round_a_corner(ZONE, lean=0.03)
    assert deviation_of(run, path).axis == pytest.approx(0.03, rel=1e-6)


def test_without_zones_it_stays_on_the_path():
    run, path = run_round_a_corner(0.0)
    assert deviation_of(run, path).tip == pytest.approx(0, abs=1e-12)
