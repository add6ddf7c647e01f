"""Any six-axis arm, from its joint frames alone: axes as the solver wants them, and the check.

The solver is ssik, of the optional group "general". Any point of a joint axis may stand for it, but
ssik 8.2 places the frames of two parallel axes wrongly unless their points lie square to them: here
they do, and whether it solves an arm is tried before it is used.
"""

from __future__ import annotations

from threading import Lock

import numpy as np

from kerfpath._arrays import Array, Bools
from kerfpath._extras import require_extra
from kerfpath.errors import InputError
from kerfpath.kernels import general
from kerfpath.robots._ssik import SsikArm, prepare, solve
from kerfpath.urdf import KinematicChain

__all__ = ["follow_all", "forward_all", "inverse_all", "model", "require_solver"]

PARALLEL = 1e-9
TRIED = 24
"""Random joint vectors that the solver must find again."""
FOUND = 1e-6
"""rad: how near."""

follow_all, forward_all = general.follow_all, general.forward_all


def require_solver() -> None:
    """Raise InputError unless the solver is installed."""
    require_extra("general", "a six-axis arm of no other family")


def model(*, chain: KinematicChain | None, sign: Array, offset: Array) -> general.GeneralArm:
    """Return the axes of a chain at angle zero.

    Raises
    ------
    InputError
        No chain, not of six joints, or a joint convention beside the chain's.
    """
    if chain is None or len(chain.axes) != 6:
        raise InputError("a robot of family 'general' needs the chain of its six joints: chain=")
    if (sign != 1).any() or offset.any():
        raise InputError(
            "a robot of family 'general' turns its joints as its chain does: no sign, no offset"
        )
    T = chain.frames(np.zeros((1, 6)))[0, 1:]
    along = np.einsum("nij,nj->ni", T[:, :3, :3], chain.axes)
    place = T[:, :3, 3].copy()
    for i in range(1, 6):
        # The foot on axis i of the line square to it and to the axis before.
        normal = np.cross(along[i - 1], along[i])
        gap = place[i - 1] - place[i]
        if np.linalg.norm(normal) > PARALLEL:
            gap = np.cross(along[i - 1], gap) @ normal / (normal @ normal) * along[i]
        place[i] += (gap @ along[i]) * along[i]
    return general.GeneralArm(place=place, along=along, tip=T[-1] @ chain.end)


def inverse_all(arm: general.GeneralArm, T: Array, out_q: Array, out_reach: Bools) -> None:
    """Fill all solutions (B, 16, 6) of tip poses (B, 4, 4), each within `EXACT` of its pose.

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
    """Return the arm as the solver has it; what it prepares is made once and tried."""
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
    """Return an end at zero whose origin and z-axis are the sixth joint's: no length behind it."""
    z = arm.along[5]
    x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    end = np.eye(4)
    end[:3] = np.c_[x, np.cross(z, x), z, arm.place[5]]
    return end


def _require_solved(arm: general.GeneralArm, ready: SsikArm) -> None:
    """Raise InputError unless joint vectors of all kinds are found again from their poses."""
    want = np.random.default_rng(1986).uniform(-np.pi, np.pi, (TRIED, 6))
    T, q = np.empty((TRIED, 4, 4)), np.empty((TRIED, general.POSTURES, 6))
    reach = np.empty(q.shape[:2], np.bool_)
    general.forward_all(arm, want, T)
    _solve(arm, ready, T, q, reach)
    apart = np.abs(np.remainder(q - want[:, None] + np.pi, 2 * np.pi) - np.pi).max(axis=2)
    missed = int((np.where(reach, apart, np.inf).min(axis=1) > FOUND).sum())
    if missed:
        raise InputError(
            f"the solver ssik does not solve this arm: of {TRIED} joint vectors it did not find "
            f"{missed} again from their poses, so that nothing can be planned with it"
        )
