"""Inverse kinematics of the other families than OPW: the same poses for us and for a library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import ur_analytic_ik
from eaik.IK_DH import DhRobot

from benchmarks._figures import Figure, Report, in_turn
from kerfpath import robot
from kerfpath.arrays import Array
from kerfpath.robots import Arm
from kerfpath.urdf import KinematicChain

__all__ = ["run"]

HOW = """\
One core, poses at uniformly random joints, the same for all that solve a family; every solution of
every pose, joint limits ignored. `inverse_all` is what the layered graph is built with. UR10e:
ur-analytic-ik in a Python loop, its only interface, and EAIK's `IK_batched`, least-squares rows
dropped. Five axes: no library solves position and tool axis of such an arm for all postures, so
there is no row beside ours. General, here three parallel axes with ways along and between them, is
solved by ssik inside `inverse_all`; EAIK knows this kind too and stands beside it. Arms that EAIK
refuses need ssik's elimination, which is in docs/robots-from-urdf.md."""

GENERAL = (
    [1.0, 0, 0, 0.8, -1.2, 0],
    [0.2, 0.3, 0.25, 0.1, 0.15, 0],
    [0.2, 0.1, 0.3, 0.2, 0.1, 0.1],
)
"""Denavit-Hartenberg parameters alpha (rad), a and d (m)."""


def run(*, quick: bool) -> Report:
    """Measure each family, and count the solutions that each library finds."""
    poses, runs = (500, 2) if quick else (5_000, 5)
    q = np.random.default_rng(2008).uniform(-np.pi, np.pi, (poses, 6))
    ur, general, five = robot("ur_ur10e"), _general(), _five()
    T_ur, T_general, T_five = ur.forward(q), general.forward(q), five.forward(q[:, :5])
    g = ur.geometry
    half = np.pi / 2
    a = np.array([0, g["a2"], g["a3"], 0, 0, 0])
    d = np.array([g["d1"], 0, 0, g["d4"], g["d5"], g["d6"]])
    eaik_ur = DhRobot(np.array([half, 0, 0, half, -half, 0]), a, d)
    eaik_general = DhRobot(*map(np.array, GENERAL))
    calls: dict[str, Callable[[], int]] = {
        "UR10e: kerfpath inverse_all": lambda: int(ur.arm.inverse_all(T_ur)[1].sum()),
        "UR10e: ur-analytic-ik": lambda: _looped(T_ur),
        "UR10e: EAIK IK_batched": lambda: _batched(eaik_ur, T_ur),
        "five axes: kerfpath inverse_all": lambda: int(five.inverse_all(T_five)[1].sum()),
        "general: kerfpath inverse_all": lambda: int(general.inverse_all(T_general)[1].sum()),
        "general: EAIK IK_batched": lambda: _batched(eaik_general, T_general),
    }
    found = {name: call() for name, call in calls.items()}
    seconds = in_turn(calls, runs)
    figures = [
        Figure(what=name, values=[found[name] / s / 1e3 for s in taken], unit="k solutions/s")
        for name, taken in seconds.items()
    ]
    findings = [f"{poses} poses of each family"]
    findings += [f"{name}: {number} solutions" for name, number in found.items()]
    return Report(
        title="Inverse kinematics, other families", how=HOW, figures=figures, findings=findings
    )


def _general() -> Arm:
    links = np.tile(np.eye(4), (6, 1, 1))
    for link, alpha, a, d in zip(links, *GENERAL, strict=True):
        c, s = np.cos(alpha), np.sin(alpha)
        link[:3] = [[1, 0, 0, a], [0, c, -s, 0], [0, s, c, d]]
    origins = np.concatenate([np.eye(4)[None], links[:5]])
    axes = np.tile([0.0, 0.0, 1.0], (6, 1))
    chain = KinematicChain(origins=origins, axes=axes, end=links[5])
    return Arm(kinematics="general", geometry={}, chain=chain)


def _five() -> Arm:
    geometry = {"a1": 0.3, "a2": -0.1, "b": 0.0, "c1": 0.7, "c2": 0.9, "c3": 0.8, "c4": 0.12}
    return Arm(kinematics="five", geometry=geometry)


def _looped(T: Array) -> int:
    """Count the solutions of ur-analytic-ik, called in a Python loop."""
    return sum(len(ur_analytic_ik.ur10e.inverse_kinematics(one)) for one in T)


def _batched(arm: DhRobot, T: Array) -> int:
    return sum(int((~np.asarray(one.is_LS, bool)).sum()) for one in arm.IK_batched(T, 1))
