"""Batched inverse kinematics: solutions per second, beside py-opw-kinematics and EAIK."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from eaik.IK_HP import HPRobot
from py_opw_kinematics import KinematicModel
from py_opw_kinematics import Robot as OpwRobot
from scipy.spatial.transform import RigidTransform

from benchmarks._arm import arm, chain
from benchmarks._figures import Figure, Report, in_turn
from kerfpath import Robot
from kerfpath.arrays import Array, Bools, Ints
from kerfpath.kernels.kinematics import POSTURES, inverse_all

__all__ = ["run"]

HOW = """\
Poses of the IRB 2400 at uniformly random joints, the same for all; every posture of every pose,
joint limits ignored. A solution is a joint vector that exists; the rate counts those only. The
libraries take turns in every round. `inverse_all` is the loop over the kernel that the layered
graph is built with, into arrays made beforehand; `Robot.inverse` the public call around it, which
checks the poses and collects the solutions. py-opw-kinematics: `Robot.reach` returns all eight
branches and also the conditioning of each branch inside the joint limits given; with limits that
no branch meets it leaves that out, so that the second row is its inverse kinematics alone. EAIK:
`IK_batched`, and then its solutions read out of the list of objects it returns; its least-squares
rows (`is_LS`) are dropped. Two cores: two threads over halves (ours), the library's own threads
(the others)."""

NO_BRANCH = [(10.0, 11.0)] * 6
"""Joint limits (rad) outside (-pi, pi]: no branch reaches them."""


def run(*, quick: bool) -> Report:
    """Measure, and check that all find the same number of solutions of every pose."""
    poses, runs = (5_000, 3) if quick else (100_000, 7)
    robot = arm()
    q = np.random.default_rng(2008).uniform(-np.pi, np.pi, (poses, 6))
    T = robot.forward(q)
    ours_q, ours_reach = np.empty((poses, POSTURES, 6)), np.empty((poses, POSTURES), np.bool_)
    eaik = _Eaik(robot, T)
    opw = _opw(robot)
    rigid = RigidTransform.from_matrix(T)

    def in_halves(pool: ThreadPoolExecutor) -> None:
        parts = [slice(0, poses // 2), slice(poses // 2, poses)]
        model = robot.arm.model()
        list(pool.map(lambda p: inverse_all(model, T[p], ours_q[p], ours_reach[p]), parts))

    with ThreadPoolExecutor(2) as pool:
        calls: dict[str, Callable[[], object]] = {
            "kerfpath inverse_all, 1 core": lambda: inverse_all(
                robot.arm.model(), T, ours_q, ours_reach
            ),
            "kerfpath inverse_all, 2 cores": lambda: in_halves(pool),
            "kerfpath Robot.inverse, 1 core": lambda: robot.inverse(T, within_limits=False),
            "py-opw reach, 1 core": lambda: opw.reach(rigid, threads=1),
            "py-opw reach, 2 cores": lambda: opw.reach(rigid, threads=2),
            "py-opw reach without conditioning, 1 core": lambda: opw.reach(
                rigid, NO_BRANCH, threads=1
            ),
            "py-opw reach without conditioning, 2 cores": lambda: opw.reach(
                rigid, NO_BRANCH, threads=2
            ),
            "EAIK IK_batched, 1 core": lambda: eaik.solve(1),
            "EAIK IK_batched, 2 cores": lambda: eaik.solve(2),
        }
        seconds = in_turn(calls, runs)
    number = int(ours_reach.sum())
    figures = [
        Figure(what=name, values=[number / s / 1e6 for s in taken], unit="M solutions/s")
        for name, taken in seconds.items()
    ]
    opw_q = opw.reach(rigid, NO_BRANCH, threads=2).joints
    eaik_q, eaik_pose = eaik.solve(2)
    opw_pose, opw_branch = np.nonzero(np.isfinite(opw_q[:, :, 0]))
    ours_pose, ours_posture = np.nonzero(ours_reach)
    found: dict[str, tuple[Array, Ints]] = {
        "kerfpath": (ours_q[ours_pose, ours_posture], ours_pose),
        "py-opw": (opw_q[opw_pose, opw_branch], opw_pose),
        "EAIK": (eaik_q, eaik_pose),
    }
    findings = [f"{poses} poses, {number} solutions, {number / poses:.2f} a pose"]
    per_pose = ours_reach.sum(axis=1)
    for name, (solutions, pose) in found.items():
        same = (np.bincount(pose, minlength=poses) == per_pose).sum()
        agree = "" if name == "kerfpath" else f", as many as kerfpath at {same} of {poses} poses"
        error = np.abs(robot.forward(solutions) - T[pose]).max()
        findings.append(
            f"{name}: {len(solutions)} solutions{agree}; largest |FK(q) - T| (m or 1, by "
            f"kerfpath's FK): {error:.1e}"
        )
    return Report(title="Inverse kinematics", how=HOW, figures=figures, findings=findings)


def _opw(robot: Robot) -> OpwRobot:
    g, (o1, o2, o3, o4, o5, o6) = robot.geometry, robot.offset.tolist()
    model = KinematicModel(
        a1=g["a1"],
        a2=g["a2"],
        b=g["b"],
        c1=g["c1"],
        c2=g["c2"],
        c3=g["c3"],
        c4=g["c4"],
        offsets=(o1, o2, o3, o4, o5, o6),
    )
    return OpwRobot(model, degrees=False)


class _Eaik:
    """The arm in EAIK, whose flange frame is parallel to the base at q = 0."""

    def __init__(self, robot: Robot, T: Array) -> None:
        axes, origins = chain(robot)
        self._robot = HPRobot(axes, origins)
        self._T = T.copy()
        self._T[:, :3, :3] = T[:, :3, :3] @ robot.forward(np.zeros(6))[:3, :3].T

    def solve(self, threads: int) -> tuple[Array, Ints]:
        """Return all true solutions (N, 6) rad and the pose of each (N,)."""
        found = self._robot.IK_batched(self._T, threads)
        rows = [solution.Q for solution in found]
        true: Bools = ~np.concatenate([solution.is_LS for solution in found]).astype(np.bool_)
        pose = np.repeat(np.arange(len(found)), [len(r) for r in rows])
        return np.concatenate(rows)[true], pose[true]
