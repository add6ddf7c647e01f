"""General six-axis arms: their axes in the form that the solver needs, and a check of the solver.

The solver is ssik, of the optional group "general". A joint axis may be given by any of its points,
but ssik 8.2 places the frames of two parallel axes wrongly unless the line between their points is
perpendicular to them. The points are chosen so here, and the solver is tested on each arm before it
is used.
"""

from __future__ import annotations

from threading import Lock

import numpy as np

from kerfpath.arrays import Array, Bools
from kerfpath.errors import InputError
from kerfpath.extras import require_extra
from kerfpath.kernels import general
from kerfpath.robots.ssik_interface import SsikArm, prepare, solve
from kerfpath.urdf import KinematicChain

PARALLEL = 1e-9
TRIED = 24
"""Number of random joint vectors that the solver must recover from their poses."""
FOUND = 1e-6
"""rad: largest error of a recovered joint vector."""

follow_all, forward_all = general.follow_all, general.forward_all


def require_solver() -> None:
    """Raise InputError unless the solver for general arms is installed."""
    require_extra("general", "a six-axis arm of no other family")


def model(*, chain: KinematicChain | None, sign: Array, offset: Array) -> general.GeneralArm:
    """Return the axes of a chain at zero joint angles.

    Raises
    ------
    InputError
        There is no chain, it does not have six joints, or a sign or an offset is given.
    """
    if chain is None or len(chain.axes) != 6:
        raise InputError("a robot of family 'general' needs the chain of its six joints: chain=")
    if (sign != 1).any() or offset.any():
        raise InputError(
            "a robot of family 'general' uses the joint convention of its chain: remove sign= and "
            "offset="
        )
    place, along, tip = chain.lines()
    for i in range(1, 6):
        # Move the point to the foot of the common perpendicular of axes i - 1 and i.
        normal = np.cross(along[i - 1], along[i])
        gap = place[i - 1] - place[i]
        if np.linalg.norm(normal) > PARALLEL:
            gap = np.cross(along[i - 1], gap) @ normal / (normal @ normal) * along[i]
        place[i] += (gap @ along[i]) * along[i]
    return general.GeneralArm(place=place, along=along, tip=tip)


def inverse_all(arm: general.GeneralArm, T: Array, out_q: Array, out_reach: Bools) -> None:
    """Fill out_q (B, 16, 6) rad and out_reach (B, 16) with all solutions of tip poses (B, 4, 4) m.

    Each solution reaches its pose within `kernels.general.EXACT`.

    Raises
    ------
    InputError
        The solver is not installed, or does not solve this arm.
    """
    _solve(arm, _prepared(arm), T, out_q, out_reach)


def _solve(
    arm: general.GeneralArm, ready: SsikArm, T: Array, out_q: Array, out_reach: Bools
) -> None:
    end = _end(arm)
    q, pose = solve(ready, T @ np.linalg.inv(arm.tip) @ end)
    general.sort_in(arm, T, q, pose, out_q, out_reach)


_ready: dict[bytes, SsikArm] = {}
_preparing = Lock()


def _prepared(arm: general.GeneralArm) -> SsikArm:
    """Return the arm as prepared by the solver, once for each arm, and tested."""
    key = b"".join(part.tobytes() for part in arm)
    with _preparing:
        if key not in _ready:
            require_solver()
            trafos = np.tile(np.eye(4), (7, 1, 1))
            trafos[:6, :3, 3] = np.diff(arm.place, axis=0, prepend=0.0)
            trafos[6, :3, :3] = _end(arm)[:3, :3]
            ready = prepare(trafos, arm.along)
            _require_solved(arm, ready)
            _ready[key] = ready
        return _ready[key]


def _end(arm: general.GeneralArm) -> Array:
    """Return an end frame at zero on axis 6: its z-axis is the joint axis, its origin on it."""
    z = arm.along[5]
    x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    end = np.eye(4)
    end[:3] = np.c_[x, np.cross(z, x), z, arm.place[5]]
    return end


def _require_solved(arm: general.GeneralArm, ready: SsikArm) -> None:
    """Raise InputError unless the solver recovers random joint vectors from their poses."""
    want = np.random.default_rng(1986).uniform(-np.pi, np.pi, (TRIED, 6))
    T, q = np.empty((TRIED, 4, 4)), np.empty((TRIED, general.POSTURES, 6))
    reach = np.empty(q.shape[:2], np.bool_)
    general.forward_all(arm, want, T)
    _solve(arm, ready, T, q, reach)
    apart = np.abs(np.remainder(q - want[:, None] + np.pi, 2 * np.pi) - np.pi).max(axis=2)
    missed = int((np.where(reach, apart, np.inf).min(axis=1) > FOUND).sum())
    if missed:
        raise InputError(
            f"the solver ssik does not solve this arm: it did not recover {missed} of {TRIED} "
            "joint vectors from their poses, so nothing can be planned with this arm"
        )
