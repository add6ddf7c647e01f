"""Proven bounds of the joints on cells of gamma: nothing that reaches the pose is outside them."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from conftest import rebuilt
from kerfpath import InputError, robot
from kerfpath.kernels.enclosure import BOX, NONE, SMOOTH
from kerfpath.robots import FAMILIES, Arm, RobotLimits, robot_ids

IDS = [name for name in robot_ids() if robot(name).encloses]
SAMPLES = 15_000  # of each of the 68 robots: 10^6 in all
FLOAT_KINEMATICS = 1e-9
"""Error of the joints that floats find, rad: as in test_robot, away from what is singular."""


def pose(rng):
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    return T


def turned(frames, gamma):
    """Frames (C, 4, 4) each turned about its own z-axis."""
    spin = np.tile(np.eye(4), (len(gamma), 1, 1))
    spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
    spin[:, 1, 0], spin[:, 0, 1] = np.sin(gamma), -np.sin(gamma)
    return frames @ spin


def tasks(r, rng, count):
    """Task frames whose flange pose is within reach at gamma = 0, and the tool."""
    tool = pose(rng)
    q = rng.uniform(-np.pi, np.pi, (count, 6))
    return r.forward(q) @ tool, tool


def solutions(r, frames, gamma, tool):
    return r.arm.inverse_all(np.ascontiguousarray(turned(frames, gamma) @ np.linalg.inv(tool)))


def outside(e, q, t):
    """How far joints q (C, ..., n) are outside each posture of their cell at t (C,), (C, P)."""
    t = t[:, None, None]
    middle = e.center + e.slope * t + 0.25 * (e.low + e.high) * t**2
    radius = e.radius + 0.25 * (e.high - e.low) * t**2
    away = np.abs((q - middle + np.pi) % (2 * np.pi) - np.pi)
    return np.where(e.status > NONE, (away - radius).max(axis=-1), np.inf)


def near(rng, count):
    """Distances from a singularity, down to none at all."""
    size = 10.0 ** rng.uniform(-16, -2, count) * rng.choice([-1, 1], count)
    return np.where(rng.random(count) < 0.3, 0.0, size)


@pytest.mark.parametrize("name", IDS)
def test_every_solution_on_a_cell_is_in_the_enclosure_of_its_posture(name):
    r, rng = robot(name), np.random.default_rng(1)
    frames, tool = tasks(r, rng, 500)
    node = rng.integers(0, len(frames), SAMPLES)
    gamma = rng.uniform(-np.pi, np.pi, SAMPLES)
    half = 10.0 ** rng.uniform(-6, np.log10(0.2), SAMPLES)
    t = rng.choice([-1.0, 1.0, 0.0, rng.uniform(-1, 1)], SAMPLES) * half
    e = r.arm.enclose(frames, node, gamma, half, tool)
    q, reach = solutions(r, frames[node], gamma + t, tool)
    assert (outside(e, q, t)[reach] <= FLOAT_KINEMATICS).all()
    # Smooth means that a solution is there, all over the cell.
    assert reach[e.status == SMOOTH].all()
    assert (e.status == SMOOTH).any()
    assert (np.abs(e.center) <= np.pi).all()
    assert (e.low <= e.high).all()
    assert (e.radius >= 0).all()
    for nothing in (e.slope, e.low, e.high):
        assert not nothing[e.status == BOX].any()
    assert (e.radius[e.status == BOX] < np.pi + 1e-12).all()


def singular(r, rng, count):
    """Joints (count, 6) of the model at singularities of every kind, or near them."""
    a, q = r.arm.model(), rng.uniform(-np.pi, np.pi, (count, 6))
    straight = rng.choice([0.0, np.pi], count)
    kind = rng.integers(0, 4, count)
    wrist, elbow, shoulder = kind % 3 == 0, kind % 3 == 1, kind == 2
    psi = np.arctan2(a.a2, a.c3) if r.kinematics == "opw" else 0.0
    if r.kinematics == "opw":  # Wrist centre above axis 1, or as near to it as b allows.
        ahead = -(a.a1 + a.c2 * np.sin(q[:, 1])) / np.hypot(a.a2, a.c3)
        solved = np.arcsin(np.clip(ahead, -1, 1)) - psi - q[:, 1]
        q[shoulder, 2] = solved[shoulder]
    else:  # Axis 4 above axis 1, as near as d4 allows.
        ahead = -(a.a2 * np.cos(q[:, 1]) + a.a3 * np.cos(q[:, 1] + q[:, 2])) / a.d5
        solved = np.arcsin(np.clip(ahead, -1, 1)) - q[:, 1] - q[:, 2]
        q[shoulder, 3] = solved[shoulder]
    q[elbow, 2] = (straight - psi + near(rng, count))[elbow]
    q[wrist, 4] = (straight + near(rng, count))[wrist]
    return a.sign * (q + a.offset)


@pytest.mark.parametrize("name", IDS)
def test_joints_at_a_singularity_are_held_whatever_is_free_there(name):
    r, rng = robot(name), np.random.default_rng(2)
    tool, q = pose(rng), singular(r, rng, 600)
    half = 10.0 ** rng.uniform(-9, -1, len(q))
    t = rng.choice([0.0, 0.5, 1.0], len(q)) * half
    e = r.arm.enclose(r.forward(q) @ tool, np.arange(len(q)), -t, half, tool)
    # The pose of q has errors of 1e-15 m and rad, as the radii have that stand for them.
    assert (outside(e, q[:, None], t).min(axis=1) <= 1e-12).all()


@pytest.mark.parametrize("name", ["abb_irb2400_155", "staubli_tx2_90"])
def test_at_a_wrist_singularity_axes_4_and_6_are_free(name):
    r, rng = robot(name), np.random.default_rng(3)
    a, tool = r.arm.model(), pose(rng)
    q = np.tile(rng.uniform(-1, 1, 6), (50, 1))
    q[:, 4] = a.sign[4] * a.offset[4]
    q[:, 3] = np.linspace(-np.pi, np.pi, 50)
    q[:, 5] = 0.4 - a.sign[3] * a.sign[5] * q[:, 3]
    T = r.forward(q)
    # One pose for all of them, to rounding.
    np.testing.assert_allclose(T, np.broadcast_to(T[:1], T.shape), atol=1e-14)
    e = r.arm.enclose(T[:1] @ tool, np.zeros(50, int), np.zeros(50), np.full(50, 1e-9), tool)
    assert (outside(e, q[:, None], np.zeros(50)).min(axis=1) <= 0).all()


@pytest.mark.parametrize("name", ["kuka_kr70_r2100", "staubli_tx2_90", "ur_ur5e"])
def test_no_solution_is_proved_only_where_none_is_found(name):
    r, rng = robot(name), np.random.default_rng(4)
    frames, tool = tasks(r, rng, 300)
    node = rng.integers(0, 300, 300)
    gamma, half = rng.uniform(-np.pi, np.pi, 300), rng.uniform(0, 0.1, 300)
    e = r.arm.enclose(frames, node, gamma, half, tool)
    none = e.status == NONE
    for share in np.linspace(-1, 1, 41):
        _, reach = solutions(r, frames[node], gamma + share * half, tool)
        assert not (reach & none).any()
    # A posture is seldom in doubt: most of those out of reach are proved to be.
    assert none.any()
    _, reach = solutions(r, frames[node], gamma, tool)
    assert none[~reach].mean() > 0.8


@pytest.mark.parametrize("name", ["abb_irb4600_60_205", "staubli_tx2_90", "ur_ur10e"])
def test_curvature_is_the_true_one_to_what_the_cell_leaves(name):
    r, rng = robot(name), np.random.default_rng(5)
    frames, tool = tasks(r, rng, 2000)
    node, gamma = np.arange(2000), rng.uniform(-np.pi, np.pi, 2000)
    step = 1e-3
    q, reach = zip(*(solutions(r, frames, gamma + i * step, tool) for i in (-1, 0, 1)), strict=True)
    q = np.unwrap(np.array(q), axis=0)
    true = (q[2] - 2 * q[1] + q[0]) / step**2
    widths, at = [], np.all(reach, axis=0)
    for half in np.radians([0.5, 0.25, 0.125]):
        e = r.arm.enclose(frames, node, gamma, np.full(2000, half), tool)
        smooth = at & (e.status == SMOOTH)
        # Differences of second order over 0.001 rad, of joints known to 1e-13 or so.
        tame = smooth[..., None] & (np.abs(true) < 5)
        assert (e.low - 0.01 <= true)[tame].all()
        assert (true <= e.high + 0.01)[tame].all()
        size = np.maximum(np.abs(e.low), np.abs(e.high))
        widths.append(np.median((e.high - e.low)[smooth]))
        assert np.median((size / np.maximum(1.0, np.abs(true)))[smooth]) < 1.2
    # First order in the width of the cell, so that what t^2 leaves open is of third order.
    assert widths[0] > 1.8 * widths[1] > 3.2 * widths[2]


def rotation(axis, angle):
    i, j = (axis + 1) % 3, (axis + 2) % 3
    T = mp.eye(4)
    T[i, i] = T[j, j] = mp.cos(angle)
    T[j, i], T[i, j] = mp.sin(angle), -mp.sin(angle)
    return T


def along(x, y, z):
    T = mp.eye(4)
    T[0, 3], T[1, 3], T[2, 3] = x, y, z
    return T


def exact_forward(r, q):
    """The flange pose in forty digits, link by link."""
    g, X, Y, Z = r.geometry, 0, 1, 2
    m = [mp.mpf(r.sign[i]) * q[i] - mp.mpf(r.offset[i]) for i in range(6)]
    if r.kinematics == "opw":
        T = rotation(Z, m[0]) * along(g["a1"], g["b"], g["c1"]) * rotation(Y, m[1])
        T = T * along(0, 0, g["c2"]) * rotation(Y, m[2]) * along(g["a2"], 0, g["c3"])
        return T * rotation(Z, m[3]) * rotation(Y, m[4]) * rotation(Z, m[5]) * along(0, 0, g["c4"])
    T = rotation(Z, m[0]) * along(0, 0, g["d1"]) * rotation(X, mp.pi / 2)
    T = T * rotation(Z, m[1]) * along(g["a2"], 0, 0) * rotation(Z, m[2]) * along(g["a3"], 0, 0)
    T = T * rotation(Z, m[3]) * along(0, 0, g["d4"]) * rotation(X, mp.pi / 2)
    T = T * rotation(Z, m[4]) * along(0, 0, g["d5"]) * rotation(X, -mp.pi / 2)
    return T * rotation(Z, m[5]) * along(0, 0, g["d6"])


def nearest_pose(T):
    """The floats of a pose with the nearest rotation, in forty digits: Newton, as Higham has it."""
    M = mp.matrix(T.tolist())
    R = M[:3, :3]
    for _ in range(4):
        R = (R + (R**-1).T) / 2
    M[:3, :3] = R
    return M


def solved(r, T, q):
    """The joints near q that reach T in forty digits, by Newton's method."""
    q = mp.matrix(q.tolist())
    step = mp.mpf(10) ** -20
    rows = [(i, j) for i in range(3) for j in range(4)]
    for _ in range(8):
        F = exact_forward(r, q)
        J = mp.matrix(12, 6)
        for k in range(6):
            moved = q.copy()
            moved[k] += step
            D = (exact_forward(r, moved) - F) / step
            J[:, k] = mp.matrix([D[i, j] for i, j in rows])
        error = mp.matrix([T[i, j] - F[i, j] for i, j in rows])
        if mp.norm(error, mp.inf) < 1e-25:
            return q
        q += mp.lu_solve(J.T * J, J.T * error)
    raise AssertionError("Newton's method did not converge")


@pytest.mark.parametrize(
    "name", ["abb_irb2400_155", "fanuc_m710ic_50", "staubli_tx2_90", "ur_ur10e", "ur_ur3e"]
)
def test_solutions_in_forty_digits_are_inside_without_any_tolerance(name):
    mp.mp.dps = 40
    r, rng = robot(name), np.random.default_rng(6)
    frames, tool = tasks(r, rng, 20)
    gamma = rng.uniform(-np.pi, np.pi, 20)
    half = 10.0 ** rng.uniform(-12, -2, 20)
    e = r.arm.enclose(frames, np.arange(20), gamma, half, tool)
    t = rng.choice([-1.0, 0.0, 0.7, 1.0], 20) * half
    q, reach = solutions(r, frames, gamma + t, tool)
    end = nearest_pose(tool) ** -1
    for c, p in np.argwhere(reach & (e.status == SMOOTH))[::3]:
        T = nearest_pose(frames[c]) * rotation(2, mp.mpf(gamma[c]) + mp.mpf(t[c])) * end
        exact = solved(r, T, q[c, p])
        for i in range(6):
            center, slope = mp.mpf(e.center[c, p, i]), mp.mpf(e.slope[c, p, i])
            away = exact[i] - center - slope * mp.mpf(t[c])
            away -= 2 * mp.pi * mp.nint(away / (2 * mp.pi))
            radius = mp.mpf(e.radius[c, p, i])
            assert mp.mpf(e.low[c, p, i]) * mp.mpf(t[c]) ** 2 / 2 - radius <= away
            assert away <= mp.mpf(e.high[c, p, i]) * mp.mpf(t[c]) ** 2 / 2 + radius
            assert radius < 1e-8


def test_a_robot_that_stands_elsewhere_is_enclosed_there():
    rng = np.random.default_rng(7)
    r = rebuilt(robot("kuka_kr70_r2100"), T_base_foot=pose(rng), T_end_flange=pose(rng))
    frames, tool = tasks(r, rng, 500)
    half, zero = np.full(500, 1e-3), np.zeros(500)
    e = r.arm.enclose(frames, np.arange(500), zero, half, tool)
    q, reach = r.arm.inverse_nodes(frames, np.array([0.0005]), tool)
    assert (outside(e, q[:, 0], zero + 0.0005)[reach[:, 0]] <= FLOAT_KINEMATICS).all()
    assert reach.any()


def test_a_tool_of_seven_decimals_widens_the_radii_by_its_error():
    rng = np.random.default_rng(8)
    r = robot("abb_irb2400_155")
    frames, tool = tasks(r, rng, 500)
    rounded = np.round(tool, 7)
    cells = np.arange(500), np.zeros(500), np.zeros(500)
    q, reach = r.arm.inverse_nodes(frames, np.zeros(1), rounded)
    e, sharp = (r.arm.enclose(frames, *cells, T) for T in (rounded, tool))
    assert (outside(e, q[:, 0], np.zeros(500))[reach[:, 0]] <= 0).all()
    both = (e.status == SMOOTH) & (sharp.status == SMOOTH)
    assert np.median(sharp.radius[both]) < 1e-12
    assert 1e-8 < np.median(e.radius[both]) < 1e-4


def test_what_has_no_proven_bounds_says_so():
    r = robot("abb_irb2400_155").with_limits(acceleration=np.ones(6))
    cell = np.zeros(1, int), np.zeros(1), np.zeros(1)
    assert r.encloses
    railed = r.on_rail([1, 0, 0], lower=0, upper=1, velocity=1, acceleration=1, step=0.1)
    assert not railed.encloses
    arm = Arm(kinematics="five", geometry=r.geometry)
    five = replace(r, arm=arm, limits=RobotLimits())
    assert not five.encloses
    with pytest.raises(InputError, match=r"its family \(five-axis arm: .* has no proven bounds"):
        five.arm.enclose(np.eye(4)[None], *cell, np.eye(4))
    assert {name for name, f in FAMILIES.items() if f.enclose_all} == {"opw", "ur"}


@pytest.mark.parametrize(
    ("node", "gamma", "half", "words"),
    [
        ([0, 1], [0.0, 0.0], [0.1, 0.1], "from 0 to 0, got frame 1 for cell 1"),
        ([0], [0.0], [-0.1], "got 0 .- -0.1 rad for cell 0"),
        ([0], [np.nan], [0.1], "got nan .* for cell 0"),
        ([0], [0.0], [0.1, 0.1], "of the same length"),
    ],
)
def test_a_bad_cell_is_refused(node, gamma, half, words):
    r = robot("abb_irb2400_155")
    with pytest.raises(InputError, match=words):
        r.arm.enclose(np.eye(4)[None], np.array(node), np.array(gamma), np.array(half), np.eye(4))
