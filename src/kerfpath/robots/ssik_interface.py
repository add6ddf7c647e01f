"""Interface to ssik, the solver of general six-axis arms, in this process or in another.

ssik holds the interpreter lock while it solves, so many poses are solved in a separate process:
this file run as a program, which imports next to nothing of kerfpath. Besides the public classes of
ssik it uses the two functions behind the programs that `ssik build` writes; they are five times
faster than `Manipulator.solve`.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GENERAL = "ikgeo.general_6r"
A_PROCESS = 4000
"""Poses for which a process pays off: about 2 s of work against 0.5 s to start it."""


class SsikArm(NamedTuple):
    """An arm in the form of ssik: joint frames at angle zero, and an elimination computed once."""

    trafos: Array
    """(7, 4, 4): each joint frame in the one before it, and the end in the last."""
    axes: Array
    """(6, 3): direction of each joint axis in its frame."""
    elimination: Any
    """The prepared elimination, for arms without intersecting or parallel axes; otherwise None."""


def prepare(trafos: Array, axes: Array) -> SsikArm:
    """Prepare an arm: algebra of seconds to minutes, which ssik keeps in the user's cache."""
    from ssik import Manipulator
    from ssik._native import native_available, rr_native_geometry

    arm = Manipulator.from_transforms(trafos, axes)
    eliminated = arm.solver_name == GENERAL and native_available()
    return SsikArm(trafos, axes, rr_native_geometry(arm.kinbody) if eliminated else None)


def solve(arm: SsikArm, T: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return candidates (N, 6) rad for poses T (B, 4, 4) of the end, and the pose of each (N,)."""
    if len(T) < A_PROCESS:
        return _solve(arm, T)
    from kerfpath.isolated import clean_environment, python_command

    begin = f"from kerfpath.isolated import end_with; end_with({os.getpid()}); "
    run = f"from runpy import run_path; run_path({__file__!r}, run_name='__main__')"
    done = subprocess.run(
        python_command(begin + run),
        env=clean_environment(),
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
