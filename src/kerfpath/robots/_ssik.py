"""ssik, the solver of six-axis arms without a closed form here: in this process or in another.

It holds the interpreter lock while it solves, so that many poses go to a process of their own:
this file run as a program, which needs nothing of kerfpath. What is taken of ssik beside its public
classes are the two functions behind the programs that `ssik build` writes, five times faster than
`Manipulator.solve`.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SsikArm", "prepare", "solve"]

Array = NDArray[np.float64]

GENERAL = "ikgeo.general_6r"
A_PROCESS = 4000
"""Poses worth a process: some two seconds of work against half a second to start it."""


class SsikArm(NamedTuple):
    """An arm as ssik takes it: its joint frames at angle zero, and an elimination done once."""

    trafos: Array
    """(7, 4, 4): each joint frame in the one before it, and the end in the last."""
    axes: Array
    """(6, 3)"""
    elimination: Any
    """Of an arm without intersecting or parallel axes that would spare it."""


def prepare(trafos: Array, axes: Array) -> SsikArm:
    """Prepare an arm: seconds to minutes of algebra, which ssik keeps in the user's cache."""
    from ssik import Manipulator
    from ssik._native import native_available, rr_native_geometry

    arm = Manipulator.from_transforms(trafos, axes)
    eliminated = arm.solver_name == GENERAL and native_available()
    return SsikArm(trafos, axes, rr_native_geometry(arm.kinbody) if eliminated else None)


def solve(arm: SsikArm, T: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return candidates (N, 6) rad for poses T (B, 4, 4) of the end, and the pose of each (N,)."""
    if len(T) < A_PROCESS:
        return _solve(arm, T)
    done = subprocess.run(
        [sys.executable, "-P", __file__],
        input=pickle.dumps((*arm, T)),
        stdout=subprocess.PIPE,
        check=True,
    )
    q, pose = pickle.loads(done.stdout)
    return q, pose


def _solve(arm: SsikArm, T: Array) -> tuple[Array, NDArray[np.int64]]:
    from ssik import Manipulator
    from ssik._native import try_native_solve

    chain = Manipulator.from_transforms(arm.trafos, arm.axes)
    name, body = chain.solver_name, chain.kinbody
    q: list[Array] = []
    pose: list[int] = []
    for b, one in enumerate(T):
        found = try_native_solve(
            name,
            body,
            one,
            respect_limits=False,
            allow_rescue=False,
            rr_geometry=arm.elimination,
        )
        if found is None:  # no compiled solver for this arm or this system
            found = chain.solve(one, respect_limits=False, allow_rescue=False)
        q += [solution.q for solution in found]
        pose += [b] * len(found)
    return np.array(q, dtype=float).reshape(-1, 6), np.array(pose, dtype=np.int64)


if __name__ == "__main__":
    *known, poses = pickle.load(sys.stdin.buffer)
    sys.stdout.buffer.write(pickle.dumps(_solve(SsikArm(*known), poses)))
