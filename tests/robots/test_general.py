"""Six-axis arms of no other family: solved by a library, checked here against others."""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import ssik._native
from tests.urdf.test_urdf import LIMIT, joint, urdf

from conftest import pose, rebuilt
from kerfpath import Contour, InputError, Robot, audit, plan
from kerfpath.auditor import chain_of, checks
from kerfpath.graph import build, gamma_grid
from kerfpath.job import read_plan_file
from kerfpath.job.plan_file import plan_document, plan_entry, plan_text
from kerfpath.robots import Arm, RobotLimits, general, ssik_interface
from kerfpath.urdf import KinematicChain

HALF = np.pi / 2


def chain_from(alpha, a, d):
    """The chain of Denavit and Hartenberg's parameters, all angles zero."""
    links = np.tile(np.eye(4), (6, 1, 1))
    for i in range(6):
        c, s = np.cos(alpha[i]), np.sin(alpha[i])
        links[i, :3] = [[1, 0, 0, a[i]], [0, c, -s, 0], [0, s, c, d[i]]]
    origins = np.concatenate([np.eye(4)[None], links[:5]])
    return KinematicChain(origins=origins, axes=np.tile([0.0, 0.0, 1.0], (6, 1)), end=links[5])


def arm_from(*parameters, **limits):
    given = {"lower": -2 * np.ones(6), "upper": 3.1 * np.ones(6), **limits}
    arm = Arm(kinematics="general", geometry={}, chain=chain_from(*parameters))
    return Robot(id="any", arm=arm, limits=RobotLimits(**given))


def random_arm(kind, seed):
    """An arm with random lengths of a kind that needs no long preparation."""
    rng = np.random.default_rng(seed)
    alpha, a, d = rng.uniform(-2, 2, 6), *rng.uniform(0.1, 0.4, (2, 6))
    if kind == "three parallel axes":
        alpha[1:3] = 0
    elif kind == "three parallel axes, turning against each other":
        alpha[1:3] = np.pi
    elif kind == "three parallel axes that meet their neighbours":
        alpha[1:3], a[[0, 3, 4]] = 0, 0
    else:  # a spherical wrist on three axes that neither meet nor are parallel
        alpha[3:5], a[3:], d[4] = [1.2, -1.0], 0, 0
    return arm_from(alpha, a, d)


KINDS = (
    "three parallel axes",
    "three parallel axes, turning against each other",
    "three parallel axes that meet their neighbours",
    "a spherical wrist",
)

OFFSET_WRIST = (
    [-HALF, 0, -HALF, HALF, -HALF, 0],
    [0.1, 0.29, 0.08, 0, 0.076, 0],
    [0.267, 0.1, 0.05, 0.34, 0, 0.097],
)
"""Axes 2 and 3 parallel and a way along them apart, the wrist offset: solved by elimination."""


@pytest.fixture(scope="module")
def offset_wrist():
    with pytest.MonkeyPatch.context() as patch:
        # Which of three eliminations is best takes most of the preparation: here it is known.
        best = partial(ssik._native.rr_native_geometry, linearity_joint=1)
        patch.setattr("ssik._native.rr_native_geometry", best)
        arm = arm_from(*OFFSET_WRIST)
        arm.inverse(np.eye(4))
    return arm


def turned(angle):
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def solved(r, q):
    """Solve FK(q): q must be found, all must give the pose, none be there twice."""
    T = r.forward(q)
    np.testing.assert_allclose(chain_of(r).forward(q), T, atol=1e-13)
    found = r.inverse(T, within_limits=False)
    np.testing.assert_allclose(chain_of(r).forward(found.q), T[found.pose], atol=1e-9)
    nearest = np.full(len(q), np.inf)
    np.minimum.at(nearest, found.pose, np.abs(turned(found.q - q[found.pose])).max(axis=1))
    # 1e-12 of the pose is 1e-9 rad a thousandth from a singularity.
    assert nearest.max() < 1e-9
    for b in range(len(q)):
        rows = found.q[found.pose == b]
        apart = np.abs(turned(rows[:, None] - rows)).max(axis=2) + np.eye(len(rows))
        assert apart.min() > 1e-5
        assert len(set(found.posture[found.pose == b])) == len(rows) <= 16
    return found


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", KINDS)
def test_every_solution_of_a_random_arm_is_found(kind, seed):
    q = np.random.default_rng(40 + seed).uniform(-np.pi, np.pi, (100, 6))
    solved(random_arm(kind, seed), q)


def test_an_offset_wrist_is_solved(offset_wrist):
    found = solved(offset_wrist, np.random.default_rng(44).uniform(-np.pi, np.pi, (300, 6)))
    assert np.bincount(found.pose).max() > 8


def many_starts(arm, T, starts, seed):
    """Solutions (N, 6) of a pose by Newton's method from random joints, on the audit's chain."""
    chain = chain_of(arm)
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (starts, 6))
    for _ in range(40):
        now, J = chain.jacobian(q)
        off = np.empty((starts, 6))
        off[:, :3] = T[:3, 3] - now[:, :3, 3]
        off[:, 3:] = np.cross(now[:, :3, :3], T[None, :3, :3], axis=1).sum(axis=2) / 2
        step = np.linalg.solve(J.mT @ J + 1e-9 * np.eye(6), J.mT @ off[..., None])[..., 0]
        q = q + step / np.maximum(1, np.abs(step).max(axis=1, keepdims=True))
    q = turned(q[np.abs(chain.forward(q) - T).max(axis=(1, 2)) < 1e-8])
    different = []
    for row in q:
        if all(np.abs(turned(row - other)).max() > 1e-4 for other in different):
            different.append(row)
    return np.array(different)


def test_searching_from_many_starts_finds_the_same_solutions(offset_wrist):
    for seed, arm in enumerate([offset_wrist, offset_wrist, random_arm(KINDS[0], 0)]):
        T = arm.forward(np.random.default_rng(seed).uniform(-3, 3, 6))
        found = arm.inverse(T, within_limits=False).q
        want = many_starts(arm, T, 600, seed)
        assert len(found) == len(want)
        apart = np.abs(turned(found[:, None] - want)).max(axis=2)
        assert apart.min(axis=1).max() < 1e-6


def test_many_poses_go_to_a_process_and_come_back_the_same(offset_wrist, monkeypatch):
    T = offset_wrist.forward(np.random.default_rng(45).uniform(-3, 3, (60, 6)))
    q, reach = offset_wrist.arm.inverse_all(T)
    monkeypatch.setattr(ssik_interface, "A_PROCESS", 50)
    again, reached = offset_wrist.arm.inverse_all(T)
    np.testing.assert_array_equal(reach, reached)
    np.testing.assert_array_equal(q, again)


def test_a_branch_is_followed_where_its_posture_changes(offset_wrist):
    q = np.random.default_rng(46).uniform(-3, 3, (50, 6))
    step = np.random.default_rng(47).uniform(-1e-3, 1e-3, (50, 6))
    T = offset_wrist.forward(q + step)
    followed = offset_wrist.arm.follow(T, q, np.zeros(50, int))
    np.testing.assert_allclose(offset_wrist.forward(followed), T, atol=1e-9)
    assert np.abs(followed - q).max() < 2e-3
    far = offset_wrist.forward(q[:1]) + pose([5, 0, 0]) - np.eye(4)
    assert np.isnan(offset_wrist.arm.follow(far, q[:1], np.zeros(1, int))).all()


def test_the_turns_within_the_limits_are_all_there(offset_wrist):
    wide = offset_wrist.with_limits(lower=[-4] * 6, upper=[4] * 6)
    q = np.random.default_rng(48).uniform(-4, 4, (20, 6))
    found = wide.inverse(wide.forward(q))
    for b, row in enumerate(q):
        assert np.abs(found.q[found.pose == b] - row).max(axis=1).min() < 1e-9


def described(tmp_path, arm, inside=LIMIT):
    names = ["base", *(f"link_{i}" for i in range(1, 7)), "tool0"]
    chain = arm.chain
    joints = [
        joint(f"j{i + 1}", names[i], names[i + 1], chain.origins[i], chain.axes[i], inside=inside)
        for i in range(6)
    ]
    end = joint("end", "link_6", "tool0", chain.end, kind="fixed", inside="")
    return urdf(tmp_path, [*joints, end])


def test_a_general_arm_is_read_planned_and_audited(tmp_path):
    arm = random_arm("three parallel axes", 0)
    path = described(tmp_path, arm)
    read = Robot.from_urdf(path, acceleration=[200] * 6, velocity=[20] * 6)
    assert read.kinematics == "general"
    assert "not an ortho-parallel arm" in read.notes[0]
    middle = read.forward(np.full(6, 0.5))
    x = np.linspace(0, 0.03, 16)
    points = middle[:3, 3] + x[:, None] * middle[:3, 0]
    contour = Contour(points, np.tile(middle[:3, 2], (16, 1)), closed=False)
    tool = pose([0.05, 0, 0.1], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    done = plan(
        contour,
        read,
        tool=tool,
        placement=np.eye(4),
        speed=0.05,
        gamma_step=np.radians(15),
        refine=True,
    )
    assert audit(done) == []
    file = tmp_path / "plan.json"
    entry = plan_entry(done, done.name, checks(done))
    file.write_text(
        plan_text(plan_document(read, done.T_flange_tip, done.T_base_part, [entry], {}))
    )
    assert audit(read_plan_file(file).plans[0]) == []


def test_the_graph_counts_what_no_posture_reaches(offset_wrist):
    H = offset_wrist.forward(np.random.default_rng(49).uniform(-1, 1, (3, 6)))
    done = []
    graph = build(
        H, offset_wrist, T_flange_tip=np.eye(4), gamma=gamma_grid(0.5), progress=done.append
    )
    assert sum(done) == 3
    assert graph.reason.shape == (3, 13, 16)
    T = np.repeat(H, np.diff(graph.start), axis=0)
    c, s = np.cos(graph.gamma[graph.sample]), np.sin(graph.gamma[graph.sample])
    T[:, :3, 0], T[:, :3, 1] = (
        c[:, None] * T[:, :3, 0] + s[:, None] * T[:, :3, 1],
        c[:, None] * T[:, :3, 1] - s[:, None] * T[:, :3, 0],
    )
    np.testing.assert_allclose(offset_wrist.forward(graph.q), T, atol=1e-9)


def test_a_velocity_that_is_missing_is_asked_for(tmp_path):
    path = described(tmp_path, arm_from(*OFFSET_WRIST), '<limit lower="-3" upper="3" effort="1"/>')
    with pytest.raises(InputError, match="joint 'j1' has no velocity limit; give velocity"):
        Robot.from_urdf(path)


def test_seven_joints_without_a_spherical_shoulder_are_refused(tmp_path):
    names = ["base", *(f"link_{i}" for i in range(1, 8))]
    joints = [
        joint(f"j{i}", names[i], names[i + 1], pose([0.1, 0, 0.2]), axis=np.eye(3)[i % 3])
        for i in range(7)
    ]
    path = urdf(tmp_path, joints, names)
    with pytest.raises(
        InputError, match=r"axes 1, 2 and 3 miss a common point .* other seven-axis arms"
    ):
        Robot.from_urdf(path)


def test_without_the_solver_it_is_said_what_to_install(tmp_path, monkeypatch):
    path = described(tmp_path, arm_from(*OFFSET_WRIST))
    monkeypatch.setitem(sys.modules, "ssik", None)
    with pytest.raises(InputError, match=r"not a.*ortho.*pip install 'kerfpath\[general\]'$"):
        Robot.from_urdf(path)
    fresh = arm_from([0.5, 0, 0, 1, 1, 0], [0.2] * 6, [0.1] * 6)
    fresh.forward(np.zeros(6))
    with pytest.raises(InputError, match=r"^a six-axis arm.*pip install 'kerfpath\[general\]'$"):
        fresh.inverse(np.eye(4))


def test_an_arm_that_the_solver_does_not_solve_is_refused(monkeypatch):
    monkeypatch.setattr(general, "solve", lambda arm, T: (np.zeros((0, 6)), np.zeros(0, int)))
    with pytest.raises(InputError, match=r"does not solve this arm: it did not recover 24 of 24"):
        arm_from([0.4, 0, 0, 1, 1, 0], [0.2] * 6, [0.1] * 6).inverse(np.eye(4))


def test_a_general_robot_is_its_chain():
    with pytest.raises(InputError, match="needs the chain of its six joints"):
        Arm(kinematics="general", geometry={}).forward(np.zeros(6))
    with pytest.raises(InputError, match="remove sign= and offset="):
        rebuilt(arm_from(*OFFSET_WRIST), offset=np.ones(6)).forward(np.zeros(6))


def test_the_solver_is_not_loaded_for_other_robots():
    code = "import kerfpath, sys; kerfpath.robot('ur_ur10e'); sys.exit('ssik' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
