"""Contour: input, sampling, frames, joining."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from kerfpath import Contour, InputError, join
from kerfpath.contour import KINDS, turned_about, unit

DOWN = (0.0, 0.0, -1.0)


def polyline(points, **kw):
    return Contour(points, np.tile(DOWN, (len(points), 1)), **kw)


def helix(K=400):
    t = np.linspace(0, 3, K)
    return Contour(
        np.c_[np.cos(t), np.sin(t), 0.3 * t], np.c_[np.cos(t), np.sin(t), 0.4 + 0 * t], name="helix"
    )


def test_axes_of_any_length_become_unit_vectors_and_arrays_are_read_only():
    c = Contour([[0, 0, 0], [1, 0, 0]], [[0, 0, -5], [0, 3, -4]])
    np.testing.assert_allclose(c.axes, [[0, 0, -1], [0, 0.6, -0.8]], atol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        c.points[0, 0] = 1


@pytest.mark.parametrize("repeat", [True, False])
def test_a_closed_contour_repeats_its_first_node_once(repeat):
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]] + ([[0, 0, 0]] if repeat else [])
    c = polyline(square, closed=True)
    assert len(c) == 5
    np.testing.assert_array_equal(c.points[0], c.points[-1])
    assert c.length == pytest.approx(4, abs=1e-15)


@pytest.mark.parametrize(
    ("points", "axes", "message"),
    [
        ([[0, 0, 0], [np.nan, 0, 0]], [DOWN, DOWN], r"points\[1, 0\] is nan"),
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0]], [DOWN] * 3, "nodes 1 and 2 are the same point"),
        ([[0, 0, 0], [1, 0, 0]], [DOWN, (0, 0, 0)], "axis of node 1 is zero"),
        ([[0, 0, 0]], [DOWN], "at least 2 nodes, got 1"),
        (np.zeros((0, 3)), np.zeros((0, 3)), "at least 2 nodes, got 0"),
        ([[0, 0], [1, 0]], [DOWN, DOWN], r"expected shape \(any, 3\)"),
        ([[0, 0, 0], [1, 0, 0]], [DOWN], r"expected shape \(2, 3\)"),
        ([["a", 0, 0], [1, 0, 0]], [DOWN, DOWN], "expected an array of numbers"),
    ],
)
def test_bad_points_and_axes_are_refused_with_the_place(points, axes, message):
    with pytest.raises(InputError, match=message):
        Contour(points, axes)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(
    points=hnp.arrays(float, st.tuples(st.integers(0, 5), st.integers(2, 4))),
    axes=hnp.arrays(float, st.tuples(st.integers(0, 5), st.integers(2, 4))),
    closed=st.booleans(),
)
def test_whatever_comes_the_answer_is_a_contour_or_one_line(points, axes, closed):
    with np.errstate(all="ignore"):
        try:
            axes = Contour(points, axes, closed=closed).axes
        except InputError as error:
            lines, axes = str(error).count("\n"), np.zeros((0, 3))
        else:
            lines = 0
    assert lines == 0
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1, atol=1e-9)


def test_spacing_divides_the_path_evenly_and_keeps_the_ends():
    c = helix().resample(spacing=0.01)
    steps = np.diff(c.s)
    assert steps.max() <= 0.01 * (1 + 1e-9)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    np.testing.assert_allclose(c.points[[0, -1]], helix().points[[0, -1]], atol=1e-15)
    assert len(helix().resample(count=57)) == 57


def test_a_spacing_that_divides_the_length_is_kept_exactly():
    assert len(polyline([[0, 0, 0], [1, 0, 0]]).resample(spacing=0.1)) == 11


@pytest.mark.parametrize(
    ("position", "angle"), [(1e-3, None), (1e-4, None), (None, 0.02), (1e-3, 0.05)]
)
def test_tolerance_gives_the_fewest_even_nodes_that_keep_it(position, angle):
    c = helix(200)
    fewest = len(c.resample(tolerance=position, axis_tolerance=angle))

    def error(count):
        """Largest chord and axis error over a dense walk along both: slow and obvious."""
        coarse, s = c.resample(count=count), c.s
        cell = np.clip(np.searchsorted(coarse.s, s, side="right") - 1, 0, count - 2)
        a, b = coarse.points[cell], coarse.points[cell + 1]
        f = np.linspace(0, 1, 1001)[:, None]
        off = [
            np.linalg.norm(a[i] + f * (b[i] - a[i]) - c.points[i], axis=1).min()
            for i in range(len(s))
        ]
        cosine = (coarse.at(s)[1] * c.axes).sum(1)
        return max(off), np.arccos(np.clip(cosine, -1, 1)).max()

    def keeps(count, slack):
        off, turned = error(count)
        return off <= (position or np.inf) + slack and turned <= (angle or np.inf) + slack

    # The walk can only overrate the error, by its step of 1/1000 of a chord (and arccos near 1).
    assert keeps(fewest, slack=1e-6)
    assert not any(keeps(n, slack=0) for n in range(2, fewest))


def test_sharp_corners_get_the_nodes_that_the_tolerance_asks_for(monkeypatch):
    side = np.sqrt(0.5)  # even nodes never hit all corners
    sheet = polyline([[0, 0, 0], [1, 0, 0], [1, side, 0], [0, side, 0]], closed=True)
    # Across a square corner a chord of length h leaves it by h / sqrt(8) at most.
    assert 5 < len(sheet.resample(tolerance=1e-3)) <= sheet.length / (np.sqrt(8) * 1e-3) + 2
    turning = Contour([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [DOWN, DOWN, (0, np.sin(1), -np.cos(1))])
    assert 2 < len(turning.resample(axis_tolerance=1e-3)) < 2001
    monkeypatch.setattr("kerfpath.contour.sampling.MOST_NODES", 20)
    with pytest.raises(InputError, match="more than 20 nodes"):
        sheet.resample(tolerance=1e-3)


@pytest.mark.equation(1)
def test_sampling_in_time_follows_the_speed():
    c = helix()
    even = c.resample(dt=0.02, speed=0.25)
    np.testing.assert_allclose(np.diff(even.s) / np.diff(even.time), 0.25, rtol=1e-9)
    profile = np.linspace(0.1, 0.3, len(c))
    timed = c.resample(dt=0.01, speed=profile)
    np.testing.assert_allclose(np.diff(timed.time), timed.time[1], rtol=1e-9)
    middle = (timed.s[1:] + timed.s[:-1]) / 2
    # Mean speed of a short interval against the profile at its middle: second order in dt.
    expected = np.interp(middle, c.s, profile)
    np.testing.assert_allclose(np.diff(timed.s) / np.diff(timed.time), expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "got none"),
        ({"spacing": 0.1, "count": 4}, "got spacing, count"),
        ({"spacing": -1}, "spacing: expected a number above 0"),
        ({"spacing": np.nan}, "spacing"),
        ({"count": 1}, "count: expected a whole number of nodes >= 2"),
        ({"count": 2.5}, "count"),
        ({"dt": 0.1}, "needs both"),
        ({"speed": 0.1}, "needs both"),
        ({"dt": 0.1, "speed": -0.2}, r"speed: must be positive"),
        ({"tolerance": 0}, "tolerance: expected a number above 0"),
    ],
)
def test_bad_sampling_is_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        helix().resample(**arguments)


@pytest.mark.parametrize("kind", ["tangent", "rotation-minimising"])
def test_frames_are_right_handed_with_z_along_the_tool(kind):
    c = helix()
    H = c.frames(kind)
    R = H[:, :3, :3]
    np.testing.assert_allclose(
        R.transpose(0, 2, 1) @ R, np.tile(np.eye(3), (len(c), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(R), 1, atol=1e-12)
    np.testing.assert_allclose(R[:, :, 2], c.axes, atol=1e-12)
    np.testing.assert_array_equal(H[:, :3, 3], c.points)


def test_the_tangent_frame_looks_along_the_path_in_the_plane_of_the_surface():
    c = helix()
    H = c.frames("tangent")
    ahead = np.diff(c.points, axis=0)
    x = H[:-1, :3, 0]
    assert (np.einsum("ki,ki->k", x, ahead) > 0).all()
    # x lies in the plane of path and tool axis: their triple product vanishes.
    volume = np.einsum("ki,ki->k", np.cross(x, c.axes[:-1]), ahead)
    np.testing.assert_allclose(volume, 0, atol=1e-12)


def test_the_last_node_of_a_closed_contour_takes_the_first_direction():
    square = polyline([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], closed=True)
    H = square.frames("tangent")
    np.testing.assert_array_equal(H[-1], H[0])


def test_rotation_minimising_frames_do_not_turn_about_the_tool_axis():
    c = helix()
    x, z = (c.frames("rotation-minimising")[:, :3, i] for i in (0, 2))
    # The turn from node to node has no part along the mean axis (parallel transport).
    spin = np.einsum("ki,ki->k", np.cross(x[:-1], x[1:]), z[:-1] + z[1:])
    assert np.abs(spin).max() < 1e-6
    tangent = c.frames("tangent")[:, :3, 0]
    np.testing.assert_allclose(x[0], tangent[0], atol=1e-12)


def test_rotation_minimising_frames_close_on_a_closed_contour():
    t = np.linspace(0, 2 * np.pi, 201)
    c = Contour(
        np.c_[np.cos(t), np.sin(t), 0 * t],
        np.c_[np.cos(t), np.sin(t), -np.ones_like(t)],
        closed=True,
    )
    H = c.frames("rotation-minimising")
    np.testing.assert_allclose(H[-1], H[0], atol=1e-12)
    # The axes sweep a cone: the twist 2 pi (1 - cos 45 deg) is real and spread evenly.
    x = H[:, :3, 0]
    assert np.linalg.norm(np.diff(x, axis=0), axis=1).max() < 0.05


@pytest.mark.parametrize("kind", ["tangent", "rotation-minimising"])
def test_a_node_whose_axis_lies_along_the_path_is_refused_with_its_index(kind):
    points = [[0, 0, 0], [1, 0, 0], [1, 0, -1], [2, 0, -1]]
    node = 1 if kind == "tangent" else 0
    c = polyline(points if kind == "tangent" else points[1:])
    with pytest.raises(InputError, match=f"node {node}"):
        c.frames(kind)


def test_an_axis_that_reverses_is_refused():
    c = Contour([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [DOWN, DOWN, (0, 0, 1)])
    with pytest.raises(InputError, match="node 2"):
        c.frames("rotation-minimising")
    with pytest.raises(InputError, match="expected one of tangent, rotation-minimising"):
        c.frames("frenet")


def test_joining_makes_one_contour_with_unified_sampling():
    first = polyline([[0, 0, 0], [1, 0, 0]], name="a")
    second = polyline([[1, 0, 0], [1, 2, 0]], name="b")
    c = join([first, second])
    np.testing.assert_array_equal(c.points, [[0, 0, 0], [1, 0, 0], [1, 2, 0]])
    assert c.name == "a+b"
    np.testing.assert_allclose(np.diff(join([first, second], spacing=0.25).s), 0.25)
    back = polyline([[1, 2, 0], [0, 0, 0]], name="c")
    assert join([first, second, back], closed=True).closed


def test_a_gap_over_the_tolerance_is_refused_and_a_small_one_bridged():
    first = polyline([[0, 0, 0], [1, 0, 0]], name="a")
    near = polyline([[1 + 5e-6, 0, 0], [2, 0, 0]], name="near")
    assert len(join([first, near])) == 3
    with pytest.raises(InputError, match=r"'a' ends 100.0000 mm from the start of 'far'"):
        join([first, polyline([[1.1, 0, 0], [2, 0, 0]], name="far")])
    with pytest.raises(InputError, match="got none"):
        join([])
    with pytest.raises(InputError, match="'loop' is closed"):
        join([first, polyline([[1, 0, 0], [2, 0, 0], [2, 1, 0]], closed=True, name="loop")])


SQUARE = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.07, 0], [0, 0.07, 0], [0, 0, 0]])


def test_corners_are_nodes_of_a_sampling_by_spacing_or_time():
    square = Contour(SQUARE, np.tile(DOWN, (5, 1)), closed=True)
    for sampled in (square.resample(spacing=0.0041), square.resample(dt=0.02, speed=0.205)):
        for corner in SQUARE:
            assert np.linalg.norm(sampled.points - corner, axis=1).min() < 1e-12
        steps = np.diff(sampled.s)
        assert steps.max() <= 0.0041 * (1 + 1e-9)
        assert steps.min() >= 0.8 * steps.max()
    assert sampled.time is not None
    # Evenly in time to rounding, so that accelerations are plain second differences.
    np.testing.assert_allclose(np.diff(sampled.time), np.diff(sampled.time)[0], rtol=1e-9)


def test_a_stretch_too_short_for_the_spacing_is_named():
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.0002, 0], [0.2, 0.0002, 0]])
    stepped = Contour(points, np.tile(DOWN, (4, 1)))
    with pytest.raises(InputError, match=r"0.2 mm that begins at 100 mm is too short .* 5 mm"):
        stepped.resample(spacing=0.005)


def test_kinds_and_speed_shares_follow_a_sampling():
    kind = [KINDS.index(word) for word in ("pierce", "lead-in", "cut", "cut", "lead-out")]
    points = np.c_[np.arange(5) * 0.05, np.zeros((5, 2))]
    share = [0.5, 0.5, 1, 1, 1]
    line = Contour(points, np.tile(DOWN, (5, 1)), kind=kind, speed_share=share)
    # The last node has the kind of the stretch before it.
    sampled = line.resample(spacing=0.01)
    assert sampled.kinds == ("pierce", *["lead-in"] * 9, *["cut"] * 11)
    np.testing.assert_allclose(np.interp(sampled.s, line.s, share), sampled.speed_share)
    timed = line.resample(dt=0.01, speed=1.0)
    assert timed.time is not None
    v = np.diff(timed.s) / np.diff(timed.time)
    # Half speed up to the end of the lead-in, then rising evenly along the path.
    assert v[0] == pytest.approx(0.5, rel=0.2)
    assert v[-1] == pytest.approx(1.0, rel=0.2)
    assert v.max() <= 1.0 + 1e-9


def test_only_the_first_node_can_be_a_pierce():
    with pytest.raises(InputError, match="only the first node"):
        Contour(np.eye(3), np.ones((3, 3)), kind=[0, KINDS.index("pierce"), 0])
    with pytest.raises(InputError, match="indices into KINDS"):
        Contour(np.eye(3), np.ones((3, 3)), kind=[0, 0, len(KINDS)])
    with pytest.raises(InputError, match=r"at most 1, got 1\.5"):
        Contour(np.eye(3), np.ones((3, 3)), speed_share=[1, 1, 1.5])


def test_kinds_survive_joining_and_closing():
    a = Contour([[0, 0, 0], [1, 0, 0]], np.tile(DOWN, (2, 1)), kind=[1, 2])
    b = Contour([[1, 0, 0], [1, 1, 0], [0, 1, 0]], np.tile(DOWN, (3, 1)))
    assert join([a, b]).kinds == ("pierce", "cut", "cut", "cut")
    assert join([a, b], closed=True).kinds == ("pierce", "cut", "cut", "cut", "cut")


@pytest.mark.parametrize("cone", [0.0, 0.5, -1.0])
def test_axes_that_turn_all_the_way_round_do_so_about_one_direction(cone):
    t = np.linspace(0.3, 2 * np.pi + 0.3, 73)
    about = unit(np.array([[0.2, -0.5, 0.8]]))[0]
    x = unit(np.cross(about, [[1.0, 0.0, 0.0]]))[0]
    across = np.cos(t)[:, None] * x + np.sin(t)[:, None] * np.cross(about, x)
    axes = np.cos(cone) * across + np.sin(cone) * about
    found = turned_about(axes)
    assert found is not None
    assert abs(found @ about) == pytest.approx(1.0, abs=1e-9)
    assert turned_about(axes[:60]) is None  # up to 295 deg
    assert turned_about(np.concatenate([axes[:40], axes[39::-1]])) is None  # there and back


def test_axes_that_hardly_turn_do_not_turn_round():
    rng = np.random.default_rng(2)
    assert turned_about(np.tile([0.0, 0.0, -1.0], (9, 1))) is None
    assert turned_about(unit([0.0, 0.0, -1.0] + 0.1 * rng.normal(size=(50, 3)))) is None
