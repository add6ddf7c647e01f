"""Operations on contours: starts, kerf, leads, joints, corners, axes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kerfpath import Contour, InputError
from kerfpath.contour import KINDS, angle_between
from kerfpath.operations import (
    bevel,
    lead_in,
    lead_out,
    loop_corners,
    micro_joints,
    nearest,
    offset,
    overlap,
    reverse,
    round_corners,
    slow_corners,
    smooth_axes,
    smoothest_start,
    start_at,
)

DOWN = (0.0, 0.0, -1.0)
ANY = Rotation.from_rotvec([0.3, -0.5, 1.1]).as_matrix()


def flat(points, **kw):
    return Contour(points, np.tile(DOWN, (len(points), 1)), **kw)


def hole(radius=0.01, K=360):
    """A round hole as CAD has it: clockwise seen from the nozzle, scrap on the right."""
    t = -np.arange(K) * 2 * np.pi / K
    return flat(np.c_[radius * np.cos(t), radius * np.sin(t), 0 * t], closed=True, name="hole")


def square(size=0.1, K=50):
    """A plate's outline: counter-clockwise, scrap on the right, it begins amid an edge."""
    corners = size * np.array([[0.5, 0], [1, 0], [1, 1], [0, 1], [0, 0], [0.5, 0]])
    sides = [np.linspace(a, b, K, endpoint=False) for a, b in pairwise(corners)]
    points = np.vstack(sides)
    return flat(np.c_[points, np.zeros(len(points))], closed=True, name="plate")


def turned_by(contour, R):
    return replace(contour, points=contour.points @ R.T, axes=contour.axes @ R.T)


def test_a_contour_reversed_twice_is_itself():
    once = reverse(overlap(hole(), 0.003))
    np.testing.assert_array_equal(once.points[::-1], overlap(hole(), 0.003).points)
    assert once.kinds[0] == "overlap"
    assert reverse(once).kinds == overlap(hole(), 0.003).kinds


@given(part=st.floats(0, 1))
@settings(max_examples=30, deadline=None)
def test_a_new_start_keeps_the_path(part):
    moved = start_at(hole(), part * hole().length)
    assert moved.closed
    assert moved.length == pytest.approx(hole().length, abs=1e-12)
    np.testing.assert_allclose(moved.points[0], hole().at(part * hole().length)[0], atol=2e-7)


def test_the_smoothest_start_is_amid_an_edge():
    plate = start_at(square(), 0.05)  # begins in a corner
    s = smoothest_start(plate)
    x, y, _ = start_at(plate, s).points[0] / 0.1
    assert min(max(x, 1 - x), max(y, 1 - y)) < 0.95


def test_an_overlap_goes_over_its_own_start():
    cut = overlap(hole(), 0.005)
    assert not cut.closed
    assert cut.length == pytest.approx(hole().length + 0.005, rel=1e-4)
    assert set(cut.kinds) == {"cut", "overlap"}
    again = np.array(cut.kinds) == "overlap"
    apart = np.linalg.norm(cut.points[again][:, None] - hole().points, axis=2).min(axis=1)
    assert apart.max() < 2e-4  # a node may be added where the overlap ends


def test_an_offset_circle_is_a_circle():
    # Half the kerf into the scrap, then out of the part: the chords' error scales with the radius.
    for side, radius in (("right", 0.0098), ("left", 0.0102)):
        moved = offset(hole(), 0.0002, side=side)
        np.testing.assert_allclose(np.linalg.norm(moved.points, axis=1), radius, atol=1e-8)


def test_an_offset_does_not_depend_on_the_frame():
    plain, moved = offset(square(), 0.001), offset(turned_by(square(), ANY), 0.001)
    np.testing.assert_allclose(plain.points @ ANY.T, moved.points, atol=1e-12)


def test_outer_corners_become_arcs_and_inner_ones_meet():
    outside = offset(square(), 0.002, side="right")
    inside = offset(square(), 0.002, side="left")
    assert outside.length == pytest.approx(0.4 + 2 * np.pi * 0.002, rel=1e-3)
    assert inside.length == pytest.approx(4 * 0.096, rel=1e-9)
    # Every point of either keeps its distance to the plate's edge.
    for moved in (outside, inside):
        x, y = moved.points[:, 0], moved.points[:, 1]
        dx, dy = np.maximum(np.maximum(-x, x - 0.1), 0), np.maximum(np.maximum(-y, y - 0.1), 0)
        out = np.hypot(dx, dy)
        within = np.minimum(np.minimum(x, 0.1 - x), np.minimum(y, 0.1 - y))
        apart = np.where(out > 0, out, within)
        np.testing.assert_allclose(apart, 0.002, atol=1e-9)


@pytest.mark.parametrize("radius", [0.0005, 0.0015])
def test_a_kerf_wider_than_the_smallest_radius_is_named(radius):
    with pytest.raises(InputError, match=r"beam does not fit|too small"):
        offset(hole(radius), 0.002, side="right")


def slotted(radius):
    """A plate with a notch whose floor is an arc of `radius`, scrap in the notch."""
    t = np.linspace(np.pi, 2 * np.pi, 40)[1:-1]
    notch = np.c_[0.05 + radius * np.cos(t), 0.06 + radius * np.sin(t)][::1]
    points = np.vstack(
        [[[0, 0], [0.1, 0], [0.1, 0.1], [0.05 + radius, 0.1], [0.05 + radius, 0.06]],
         notch[::-1], [[0.05 - radius, 0.06], [0.05 - radius, 0.1], [0, 0.1]]]
    )  # fmt: skip
    return flat(np.c_[points, np.zeros(len(points))], closed=True, name="notched")


def test_a_notch_is_cut_where_the_beam_fits_and_refused_where_not():
    assert offset(slotted(0.003), 0.002).length > 0.4
    with pytest.raises(InputError, match=r"notched.*beam does not fit"):
        offset(slotted(0.001), 0.002)


@pytest.mark.parametrize("shape", ["line", "arc"])
def test_leads_lie_in_the_scrap_and_join_the_cut(shape):
    cut = lead_out(lead_in(hole(), 0.004, shape=shape), 0.002, shape=shape)
    kinds = np.array(cut.kinds)
    assert kinds[0] == "pierce"
    assert {*kinds} == {"pierce", "lead-in", "cut", "lead-out"}
    from_centre = np.linalg.norm(cut.points, axis=1)
    assert (from_centre[kinds != "cut"] <= 0.01 + 1e-9).all()
    assert from_centre[0] < 0.01 - 2e-4
    # Nothing is lost or doubled: the length is the hole's and the leads'.
    assert cut.length == pytest.approx(hole().length + 0.006, abs=1e-6)
    if shape == "arc":
        along = np.diff(cut.points, axis=0)
        along /= np.linalg.norm(along, axis=1)[:, None]
        # Tangent where it joins: no turn beyond those of arc and hole between nodes.
        assert angle_between(along[:-1], along[1:]).max() < np.radians(6)


def test_leads_follow_the_side():
    plate = square()
    ends = [lead_in(reverse(plate), 0.004, side="left"), lead_in(plate, 0.004, side="right")]
    for cut in ends:
        assert cut.points[0][1] < 0
    with pytest.raises(InputError, match=r"lead-in of 'plate' .* from the part"):
        lead_in(start_at(plate, 0.001), 0.004, angle=0.0)


def test_a_lead_longer_than_the_hole_hits_the_part():
    with pytest.raises(InputError, match="hits the part near"):
        lead_in(hole(0.002), 0.0045, angle=np.pi / 2)


class Ball:
    """A ball's surface about the origin."""

    def project(self, points):
        away = points / np.linalg.norm(points, axis=1)[:, None]
        return 0.5 * away, away


def test_a_lead_lies_on_the_surface_and_the_axis_fans_from_its_normal():
    t = -np.linspace(0, 2 * np.pi, 361)[:-1]
    ring = np.c_[0.02 * np.cos(t), 0.02 * np.sin(t), np.full(360, np.sqrt(0.25 - 0.0004))]
    normal = Contour(ring, -ring, closed=True, name="hole in a ball")
    tilted = bevel(normal, np.radians(20))
    cut = lead_in(tilted, 0.006, surface=Ball(), fan=0.003)
    lead = np.array([kind in ("pierce", "lead-in") for kind in cut.kinds])
    np.testing.assert_allclose(np.linalg.norm(cut.points[lead], axis=1), 0.5, atol=1e-12)
    lean = angle_between(cut.axes, -cut.points / np.linalg.norm(cut.points, axis=1)[:, None])
    assert lean[0] == pytest.approx(0, abs=1e-9)
    assert lean[np.flatnonzero(lead)[-1] + 1] == pytest.approx(np.radians(20), abs=1e-9)
    assert (np.diff(lean[lead]) > -1e-9).all()
    half = np.searchsorted(cut.s, 0.0029)
    assert lean[half] < 1e-9  # it fans over the last 3 mm only


def test_micro_joints_are_as_wide_as_asked_and_evenly_spread():
    cut = micro_joints(hole(), 0.0004, count=3)
    joint = np.array(cut.kinds[:-1]) == "micro joint"
    assert np.diff(cut.s)[joint].sum() == pytest.approx(3 * 0.0004, rel=1e-9)
    assert (np.diff(joint.astype(int)) == 1).sum() == 3
    with pytest.raises(InputError, match="3 joints of 30 mm do not fit"):
        micro_joints(hole(), 0.03, count=3)
    with pytest.raises(InputError, match="either count= or at="):
        micro_joints(hole(), 0.0004)


def test_rounded_corners_keep_the_tolerance_and_turn_gently():
    round_ = round_corners(square(), 0.0005)
    x, y = round_.points[:, 0], round_.points[:, 1]
    edge = np.minimum(np.minimum(x, 0.1 - x), np.minimum(y, 0.1 - y))
    assert edge.max() <= 0.0005 + 1e-12
    corner = np.linalg.norm(round_.points - [0.1, 0.1, 0], axis=1).min()
    assert corner == pytest.approx(0.0005, rel=1e-6)  # the middle of the arc is a node
    assert len(round_.corners) == 0
    # One that begins in a corner is rounded there, too.
    assert len(round_corners(start_at(square(), 0.05), 0.0005).corners) == 0


def star(draw, bend):
    """A closed outline of random corners, its ways bent by a share of their length."""
    angle = np.sort(draw.uniform(0, 2 * np.pi, 7))
    corners = draw.uniform(0.02, 0.05, 7)[:, None] * np.c_[np.cos(angle), np.sin(angle)]
    part = np.linspace(0, 1, 60, endpoint=False)[:, None]
    sides = []
    for a, b in pairwise([*corners, corners[0]]):
        across = np.array([a[1] - b[1], b[0] - a[0]])
        sides.append(a + part * (b - a) + bend * np.sin(np.pi * part) * across)
    points = np.vstack(sides)
    return flat(np.c_[points, np.zeros(len(points))], closed=True, name="star")


@pytest.mark.parametrize("spacing", [0.0003, 0.001, 0.004])
@pytest.mark.parametrize("bend", [0.0, 0.1, -0.1])
def test_the_nodes_of_rounded_corners_leave_the_drawing_by_no_more_than_was_asked_for(
    spacing, bend
):
    draw, tried = np.random.default_rng(round(1e5 * spacing)), 0
    for _ in range(12):
        outline = star(draw, bend)
        tolerance = draw.uniform(0.05e-3, 0.5e-3)
        try:
            made = round_corners(outline, tolerance)
            nodes = made.resample(spacing=spacing)
        except InputError:  # straight back, or two corners too near to each other for such steps
            continue
        tried += 1
        # Those that turn by less than 20 deg are no corners, and are left to the chords.
        drawn = outline.points[outline.corners]
        where, _ = nearest(nodes, drawn)
        # 1e-9 m: the sides between corners are chords of themselves; rounding.
        assert np.linalg.norm(where - drawn, axis=1).max() <= tolerance + 1e-9
        # And the nodes themselves: none is farther from the outline.
        where, _ = nearest(outline, nodes.points)
        assert np.linalg.norm(where - nodes.points, axis=1).max() <= tolerance + 1e-9
    assert tried > 6


def test_corners_too_near_share_their_room():
    tight = round_corners(square(0.001), 0.0005)
    assert len(tight.corners) == 0
    assert tight.length < 0.004


def test_loops_run_past_outer_corners_on_the_scrap_side():
    looped = loop_corners(square(), 0.002)
    loops = np.array(looped.kinds) == "loop"
    x, y = looped.points[loops][:, 0], looped.points[loops][:, 1]
    inside = (x > 1e-9) & (x < 0.1 - 1e-9) & (y > 1e-9) & (y < 0.1 - 1e-9)
    assert not inside.any()
    # Past the corner by the tangent length, three quarters of a circle, and back.
    assert looped.length - 0.4 == pytest.approx(4 * (2 * 0.002 + 1.5 * np.pi * 0.002), rel=1e-3)
    # The way is cut to the corner itself: no corner of the plate is rounded.
    assert np.linalg.norm(looped.points - [0.1, 0.1, 0], axis=1).min() < 1e-12
    assert loop_corners(reverse(square()), 0.002, side="right").kinds.count("loop") == 0


class Tube:
    """A tube's outside, 20 mm from the x axis."""

    def project(self, points):
        away = points * [0, 1, 1]
        away = away / np.linalg.norm(away, axis=1)[:, None]
        return points * [1, 0, 0] + 0.02 * away, away


@pytest.mark.parametrize(
    ("corners", "beside"), [(round_corners, 1e-6), (loop_corners, 1e-4)], ids=["round", "loop"]
)
def test_corners_on_a_tube_lie_on_it(corners, beside):
    flat_ = square(0.02, 400)
    turn = (flat_.points[:, 1] - 0.01) / 0.02
    away = np.c_[0 * turn, np.sin(turn), np.cos(turn)]
    trim = Contour(flat_.points * [1, 0, 0] + 0.02 * away, -away, closed=True, name="trim")
    made = corners(trim, 0.002, surface=Tube())
    off = np.abs(np.hypot(*made.points[:, 1:].T) - 0.02)
    assert off.max() < 1e-7  # chords of the trim's own 0.1 mm steps
    normal = made.points * [0, 1, 1] / np.hypot(*made.points[:, 1:].T)[:, None]
    np.testing.assert_allclose(made.axes, -normal, atol=1e-5)
    plain = corners(trim, 0.002)
    assert np.abs(np.hypot(*plain.points[:, 1:].T) - 0.02).max() > beside
    # A bevel stays; around the corner it leans from the one side over to the other.
    leant = corners(bevel(trim, np.radians(10)), 0.002, surface=Tube())
    angle = np.degrees(angle_between(leant.axes, made.axes))
    assert angle.max() == pytest.approx(10, abs=0.1)
    assert angle.min() > 9.9 * np.cos(np.radians(45))
    with pytest.raises(InputError, match="corner of 'trim' leaves the surface by"):
        corners(trim, 0.015, surface=Tube())


def test_corners_are_slowed_down_at_and_nothing_else():
    slowed = slow_corners(square(), 0.3, distance=0.001, ramp=0.004)
    apart = np.abs(slowed.points[:, None, :2] - 0.1 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]))
    apart = apart.max(axis=2).min(axis=1)  # along the edge to the nearest corner
    np.testing.assert_allclose(
        slowed.speed_share, 0.3 + 0.7 * np.clip((apart - 0.001) / 0.004, 0, 1), atol=1e-9
    )
    assert (slow_corners(hole(), 0.3).speed_share == 1).all()
    with pytest.raises(InputError, match="expected less than 1"):
        slow_corners(square(), 1.0)


def test_smoothing_takes_noise_and_keeps_its_bound():
    rng = np.random.default_rng(3)
    s = np.linspace(0, 0.2, 401)
    clean = np.c_[0.3 * np.sin(8 * s), 0 * s, -np.ones(401)]
    noisy = Contour(np.c_[s, 0 * s, 0 * s], clean + 0.05 * rng.normal(size=clean.shape))
    exact = replace(noisy, axes=clean)
    smooth = smooth_axes(noisy, 0.004, limit=np.radians(10))
    error = angle_between(smooth.axes, exact.axes)
    assert np.sqrt((error**2).mean()) < 0.3 * np.sqrt(
        (angle_between(noisy.axes, exact.axes) ** 2).mean()
    )
    bounded = smooth_axes(noisy, 0.004, limit=np.radians(0.5))
    assert angle_between(bounded.axes, noisy.axes).max() <= np.radians(0.5) + 1e-12


def test_smoothing_a_closed_contour_does_not_know_its_start():
    wavy = hole()
    axes = wavy.axes[:-1] + 0.2 * np.sin(3 * np.arange(360) * np.pi / 180)[:, None] * [1, 0, 0]
    wavy = Contour(wavy.points[:-1], axes, closed=True)
    smooth = smooth_axes(wavy, 0.002, limit=1.0)
    rolled = smooth_axes(start_at(wavy, wavy.s[100]), 0.002, limit=1.0)
    np.testing.assert_allclose(
        np.roll(smooth.axes[:-1], -100, axis=0), rolled.axes[:-1], atol=1e-12
    )


def test_a_bevel_leans_the_head_to_its_side():
    leant = bevel(square(), np.radians(30), side="right")
    assert angle_between(leant.axes, square().axes) == pytest.approx(np.radians(30))
    # The head, against the tool axis, stands over the scrap: outside the plate.
    head = leant.points - leant.axes
    assert (np.abs(head[:, :2] - 0.05).max(axis=1) > 0.05).all()
    with pytest.raises(InputError, match="up to 60 deg"):
        bevel(square(), 1.2)


def test_sharp_corners_of_an_offset_stay_for_what_is_made_of_them():
    moved = offset(square(), 0.002, sharp=True)
    # The mitred square is larger by the distance on every side; arcs leave no corner.
    assert moved.length == pytest.approx(4 * 0.104, abs=1e-12)
    assert len(moved.corners) == 4
    assert not len(offset(square(), 0.002).corners)
    assert KINDS.index("loop") in loop_corners(moved, 0.002).kind
    assert slow_corners(moved, 0.5).speed_share.min() == 0.5
    # A spike would be met too far off: it keeps its arc.
    spike = Contour(
        [[0, 0, 0], [0.1, 0.005, 0], [0, 0.01, 0]], np.tile([0, 0, -1], (3, 1)), closed=True
    )
    assert np.ptp(offset(spike, 0.001, sharp=True).points[:, 0]) < 0.1 + 0.02


def test_operations_on_closed_contours_refuse_open_ones():
    line = flat(np.eye(3))
    for operation in (
        lambda: start_at(line, 0.1),
        lambda: overlap(line, 0.1),
        lambda: smoothest_start(line),
    ):
        with pytest.raises(InputError, match="is open"):
            operation()


def test_a_whole_cut_is_sampled_with_all_its_features():
    cut = lead_out(overlap(micro_joints(hole(), 0.0006, count=2), 0.002), 0.003, shape="arc")
    cut = lead_in(cut, 0.005, shape="arc")
    sampled = cut.resample(dt=0.004, speed=0.15)
    for word in ("pierce", "lead-in", "cut", "micro joint", "overlap", "lead-out"):
        assert word in sampled.kinds
    ends = cut.s[np.flatnonzero(np.diff(cut.kind)) + 1][1:]
    assert np.abs(sampled.s[:, None] - ends).min(axis=0).max() < 1e-12
    assert KINDS[sampled.kind[-1]] == "lead-out"


def polygon(corners, step, name="part"):
    """A closed contour around corners (m), mm apart as given, with nodes every `step` mm."""
    ring = [*corners, corners[0]]
    sides = [
        np.linspace(a, b, max(1, round(np.hypot(*np.subtract(b, a)) / step)), endpoint=False)
        for a, b in pairwise(ring)
    ]
    points = np.vstack(sides) * 1e-3
    return flat(np.c_[points, np.zeros(len(points))], closed=True, name=name)


ELL = [(0, 0), (50, 0), (50, 20), (20, 20), (20, 50), (0, 50)]
STAIR = [(0, 0), (30, 0), (30, 10), (20, 10), (20, 10.15), (10, 10.15), (10, 30), (0, 30)]


def from_edge(contour, points):
    """Distances of points to a contour, segment by segment: slow and obvious."""
    a, ab = contour.points[:-1], np.diff(contour.points, axis=0)
    t = ((points[:, None] - a) * ab).sum(2) / (ab**2).sum(1)
    feet = a + np.clip(t, 0, 1)[..., None] * ab
    return np.linalg.norm(points[:, None] - feet, axis=2).min(axis=1)


@pytest.mark.parametrize("corners", [ELL, STAIR])
@pytest.mark.parametrize("step", [100, 0.5])
@pytest.mark.parametrize("distance", [0.0001, 0.0002, 0.001])
@pytest.mark.parametrize("side", ["left", "right"])
def test_no_point_of_an_offset_is_nearer_than_the_distance(corners, step, distance, side):
    # Also where corners are nearer to each other than the kerf, and nodes than that.
    part = polygon(corners, step)
    moved = offset(part, distance, side=side)
    apart = from_edge(part, moved.at(np.linspace(0, moved.length, 3000))[0])
    # A chord of an arc of 10 deg keeps 0.996 of the radius.
    assert apart.min() > 0.995 * distance
    # It keeps its direction and does not fold back.
    along = np.diff(moved.points, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    assert angle_between(along[:-1], along[1:]).max() < np.radians(91)


def test_an_offset_begins_where_its_contour_did():
    plate = polygon(ELL, 0.5)
    for s in (0.01, 0.05, 0.11):  # amid an edge, at an outer corner, amid another edge
        begun = start_at(plate, s)
        moved = offset(begun, 0.001)
        assert np.linalg.norm(moved.points[0] - begun.points[0]) < 1.0011e-3
        assert moved.length == pytest.approx(offset(plate, 0.001).length, rel=1e-9)


def test_a_neck_narrower_than_the_beam_is_refused():
    neck = [(0, 0), (40, 0), (40, 30), (20.1, 30), (20.1, 20), (25, 20), (25, 10), (15, 10),
            (15, 20), (19.9, 20), (19.9, 30), (0, 30)]  # fmt: skip
    with pytest.raises(InputError, match="slot or neck too narrow near"):
        offset(polygon(neck, 0.5), 0.0002)
    assert offset(polygon(neck, 0.5), 0.00009).length > 0.1
    slot = [(0, 0), (30, 0), (30, 20), (15.1, 20), (15.1, 19), (14.9, 19), (14.9, 20), (0, 20)]
    with pytest.raises(InputError, match="slot or neck too narrow near"):
        offset(polygon(slot, 0.5), 0.0002)


def test_what_would_be_lost_is_refused():
    cut = lead_in(hole(), 0.004)
    for operation in (
        lambda: offset(cut, 0.0002),
        lambda: offset(slow_corners(square(), 0.5), 0.0002),
        lambda: round_corners(lead_in(square(), 0.004), 0.0005),
        lambda: overlap(micro_joints(hole(), 0.0004, at=[0.001]), 0.002),
        lambda: micro_joints(cut, 0.0004, at=[0.002]),
        lambda: micro_joints(hole(), 0.0004, at=[]),
        lambda: round_corners(flat([[0, 0, 0], [0.01, 0, 0], [0.005, 0, 0]]), 0.0005),
    ):
        with pytest.raises(
            InputError, match=r"offset it before|corners before|cut through|lies in a lead|at=|back"
        ):
            operation()


def test_the_side_is_told_at_sharp_corners_too():
    # The part is a needle of 12 deg; beyond its tip there is scrap on all sides.
    needle = polygon([(0, 0), (30, 0), (30, 20), (17, 20), (15, 40), (13, 20), (0, 20)], 0.5)
    tip = int(np.argmax(needle.points[:, 1]))
    begun = start_at(needle, needle.s[tip])
    for angle in (0.0, np.pi / 4, np.pi / 2):
        assert lead_in(begun, 0.004, angle=angle).kinds[0] == "pierce"
    # The scrap is such a notch; the part lies around its tip.
    notch = polygon([(0, 0), (30, 0), (30, 40), (17, 40), (15, 20), (13, 40), (0, 40)], 0.5)
    tip = int(np.argmin(np.linalg.norm(notch.points - [0.015, 0.02, 0], axis=1)))
    for angle in (np.pi / 4, np.pi / 2):
        with pytest.raises(InputError, match="hits the part"):
            lead_in(start_at(notch, notch.s[tip]), 0.004, angle=angle)


def test_a_lead_out_may_meet_the_lead_in_but_not_the_part():
    cut = lead_in(square(), 0.004, shape="arc", angle=np.pi)
    both = lead_out(cut, 0.004, shape="arc", angle=np.pi)
    np.testing.assert_allclose(both.points[0], both.points[-1], atol=1e-9)
    other = lead_out(square(), 0.004, shape="arc", angle=np.pi)
    other = lead_in(other, 0.004, shape="arc", angle=np.pi)
    np.testing.assert_allclose(other.points, both.points, atol=1e-12)
    assert other.kinds == both.kinds
    # Nor are loops: a lead may lie inside one.
    begun = start_at(loop_corners(square(), 0.004), 0.0499)
    assert lead_in(begun, 0.003).kinds[0] == "pierce"


def test_a_loop_that_would_cut_the_part_is_refused():
    # A wall stands 5 mm beside the outer corner at (30, 20): a loop is two radii wide.
    walled = [(0, 0), (40, 0), (40, 40), (35, 40), (35, 10), (30, 10), (30, 20), (0, 20)]
    part = polygon(walled, 0.5)
    assert loop_corners(part, 0.0024).kinds.count("loop") > 0
    with pytest.raises(InputError, match="loop of 'part' hits the part near"):
        loop_corners(part, 0.003)


def test_corners_are_found_where_they_are_when_the_contour_begins_in_one():
    plate = start_at(square(), 0.05)
    looped, whole = loop_corners(plate, 0.002), loop_corners(square(), 0.002)
    assert looped.length == pytest.approx(whole.length, abs=1e-9)
    assert np.abs(looped.points - 0.05).max() == pytest.approx(0.05 + 0.004, abs=1e-4)


def test_the_smoothest_start_is_that_of_the_obvious_sum():
    wavy = slotted(0.003)
    along = np.diff(wavy.points, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    turn = angle_between(np.roll(along, 1, axis=0), along)
    apart = np.abs(wavy.s[:-1, None] - wavy.s[:-1])
    near = np.minimum(apart, wavy.length - apart) <= 0.01
    total = (turn * near).sum(axis=1)
    k = int(np.argmin(np.abs(wavy.s[:-1] - smoothest_start(wavy, window=0.02))))
    assert total[k] == pytest.approx(total.min(), abs=1e-6)


def test_an_arc_joins_a_coarse_curve_tangentially():
    # Chords of 2 degrees: the arc leaves the first by 4 micrometres.
    assert lead_in(hole(0.012, 180), 0.01, shape="arc", angle=np.pi / 2).kinds[0] == "pierce"


def test_the_speed_rises_evenly_along_a_lead_in_and_falls_along_a_lead_out():
    cut = lead_in(hole(), 0.004, shape="arc", speed_share=0.25)
    lead = np.array(cut.kinds) != "cut"
    np.testing.assert_allclose(cut.speed_share[lead], 0.25 + 0.75 * cut.s[lead] / 0.004, atol=1e-3)
    assert (cut.speed_share[~lead] == 1).all()
    out = lead_out(hole(), 0.004, shape="arc", speed_share=0.25)
    assert out.speed_share[-1] == pytest.approx(0.25)
    assert (np.diff(out.speed_share) <= 0).all()


def test_the_axis_of_a_lead_turns_on_into_the_cut():
    """On a curved surface neither path nor axis has a kink where a lead meets its hole."""
    t = -np.linspace(0, 2 * np.pi, 361)[:-1]
    x, y = 0.02 * np.cos(t), 0.02 * np.sin(t)
    ring = np.c_[x + 0.2, y, np.sqrt(0.25 - (x + 0.2) ** 2 - y**2)]
    cut = lead_in(Contour(ring, -ring, closed=True), 0.008, shape="arc", surface=Ball())
    rate = angle_between(cut.axes[:-1], cut.axes[1:]) / np.diff(cut.s)
    joint = cut.kinds.index("cut")
    assert rate[joint] == pytest.approx(rate[joint - 1], rel=0.05)
    assert rate[:joint].min() > 0.5 * rate[joint]


def test_corners_of_a_polygon_without_a_node_between_them() -> None:
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.06, 0], [0, 0.06, 0]])
    square = Contour(points, np.tile([0.0, 0.0, -1.0], (4, 1)), closed=True)
    rounded = round_corners(square, 0.002)
    looped = loop_corners(square, 0.005, side="right")
    # Each corner is cut short by its arc, or gains three quarters of a turn and its two tangents.
    assert rounded.closed
    assert looped.closed
    assert rounded.length < square.length < looped.length
    assert np.count_nonzero(np.diff((looped.kind == KINDS.index("loop")).astype(int)) == 1) == 4
