"""Circular moves in place of linear ones."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kerfpath import Contour, InputError, robot
from kerfpath.post import (
    CircularMove,
    LinearMove,
    build_program,
    deviations,
    language,
    post,
    preflight,
    with_arcs,
)
from programs import frames, hand_plan, read_text, text_of

RADIUS = 0.04
ARM = robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")


def slot(step=0.0015):
    """Two straight sides and two half circles, flat, seen from above counter-clockwise."""
    t = np.linspace(-np.pi / 2, np.pi / 2, 400)
    right = np.c_[0.03 + RADIUS * np.cos(t), RADIUS * np.sin(t)]
    points = np.vstack([right, -right])
    points = np.c_[points, np.zeros(len(points))]
    axes = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    return Contour(points, axes, closed=True, name="slot").resample(spacing=step)


@pytest.fixture(scope="module")
def made():
    return hand_plan(slot(), ARM, *frames(), speed=0.05)


def distance_to_slot(points):
    x = np.maximum(np.abs(points[:, 0]) - 0.03, 0.0)
    return np.abs(np.hypot(x, points[:, 1]) - RADIUS)


def along(move, start, count=50):
    """Points of an arc by the circle through three points, built from bisecting planes."""
    a, b, c = start, move.T_part_via[:3, 3], move.T_part_tip[:3, 3]
    normal = np.cross(b - a, c - a)
    rows = np.array([b - a, c - a, normal])
    sides = [(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, normal @ a]
    centre = np.linalg.solve(rows, sides)
    x = a - centre
    y = np.cross(normal / np.linalg.norm(normal), x)
    sweep = np.arctan2((c - centre) @ y, (c - centre) @ x) % (2 * np.pi)
    t = np.linspace(0, sweep, count)[:, None]
    return centre + np.cos(t) * x + np.sin(t) * y


def test_arcs_stay_on_the_path_and_save_most_of_the_moves(made):
    tolerance = 2e-5
    plain = build_program([made])
    program = build_program([made], arc_tolerance=tolerance)
    arcs = [m for m in program.moves if isinstance(m, CircularMove)]
    assert len(arcs) >= 4  # two half circles, none of them in one
    assert len(program.moves) < len(plain.moves) / 2
    moves = program.sections[0].moves[1:]
    # The contour is sampled, so that its nodes lie on the slot by their chords, 0.4 um here.
    for before, move in pairwise(moves):
        if isinstance(move, CircularMove):
            points = along(move, before.T_part_tip[:3, 3])
            assert distance_to_slot(points).max() < tolerance + 1e-6
            np.testing.assert_allclose(points[-1], move.T_part_tip[:3, 3], atol=1e-12)


def test_nothing_else_changes(made):
    plain, program = build_program([made]), build_program([made], arc_tolerance=2e-5)
    total = [
        sum(m.duration for m in p.moves if isinstance(m, LinearMove)) for p in (plain, program)
    ]
    assert total[0] == pytest.approx(total[1])
    for p in (plain, program):
        switches = [m.switches for m in p.moves if getattr(m, "switches", ())]
        assert [s.on for group in switches for s in group] == [True, False]
    targets = {tuple(m.q) for m in plain.moves}
    assert all(tuple(m.q) in targets for m in program.moves)
    assert not [issue for issue in preflight(program) if issue.level == "error"]


def test_where_the_tool_turns_otherwise_the_moves_stay_linear(made):
    program = build_program([made])
    half = Rotation.from_euler("z", 0.5, degrees=True).as_matrix()
    shaken = []
    for k, step in enumerate(program.sections[0].steps):
        if isinstance(step, LinearMove) and k % 2:
            T = step.T_part_tip.copy()
            T[:3, :3] = T[:3, :3] @ half
            shaken.append(replace(step, T_part_tip=T))
        else:
            shaken.append(step)
    section = replace(program.sections[0], steps=tuple(shaken))
    program = replace(program, sections=(section,))
    assert not any(isinstance(m, CircularMove) for m in with_arcs(program, 2e-5).moves)
    loose = with_arcs(program, 2e-5, angle=np.radians(1.0))
    assert any(isinstance(m, CircularMove) for m in loose.moves)


def test_a_polygon_is_no_circle():
    t = np.linspace(0, 2 * np.pi, 25)[:-1]
    points = np.c_[RADIUS * np.cos(t), RADIUS * np.sin(t), 0 * t]
    polygon = Contour(points, np.tile([0.0, 0.0, -1.0], (24, 1)), closed=True)
    made = hand_plan(polygon, ARM, *frames(), speed=0.02)
    sagitta = RADIUS * (1 - np.cos(np.pi / 24))
    for tolerance, expected in ((0.9 * sagitta, False), (1.1 * sagitta, True)):
        program = build_program([made], arc_tolerance=tolerance)
        assert any(isinstance(m, CircularMove) for m in program.moves) is expected


def test_rapid_says_arcs_and_reads_them_back(made):
    program = build_program([made], arc_tolerance=2e-5)
    text = text_of(post(program))
    arcs = [k for k, m in enumerate(program.moves) if isinstance(m, CircularMove)]
    assert text.count("MoveC ") + text.count("TriggC ") == len(arcs)
    read = read_text(text, program.robot)
    rapid = language("rapid")
    assert deviations(program, read, rapid, rapid.settings()) == []
    for k in arcs:
        via = program.moves[k].T_part_via
        np.testing.assert_allclose(read.moves[k].T_part_via, via, atol=1e-7)


def test_a_tolerance_must_be_positive(made):
    with pytest.raises(InputError, match="tolerance: expected a number above 0 m"):
        build_program([made], arc_tolerance=0.0)
