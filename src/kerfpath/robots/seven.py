"""Seven-axis arms with an offset shoulder or wrist: their axes in the form of the kernels."""

from __future__ import annotations

from functools import partial

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.kernels import seven
from kerfpath.urdf import KinematicChain


def _model(
    *, backwards: bool, chain: KinematicChain | None, sign: Array, offset: Array
) -> seven.SevenArm:
    """Return the axes of a chain at zero joint angles, from the base or `backwards`.

    Raises
    ------
    InputError
        There is no chain, it does not have seven joints, or a sign or an offset is given.
    """
    if chain is None or len(chain.axes) != 7:
        raise InputError(
            "a seven-axis arm with an offset shoulder or wrist needs the chain of its seven "
            "joints: read it with Robot.from_urdf"
        )
    if (sign != 1).any() or offset.any():
        raise InputError(
            "a seven-axis arm with an offset shoulder or wrist uses the joint convention of its "
            "chain: remove sign= and offset="
        )
    place, along, tip = chain.lines()
    if backwards:
        place, along = place[::-1].copy(), -along[::-1]
    place[1:3] = _meeting_point(place[1:3], along[1:3])
    place[4:] = _meeting_point(place[4:], along[4:])
    return seven.SevenArm(
        place=place, along=np.array(along, order="C"), tip=tip, backwards=backwards
    )


def _meeting_point(place: Array, along: Array) -> Array:
    """Return the point (3,) m nearest to lines through `place` (m, 3) m along `along` (m, 3)."""
    across = np.eye(3) - along[:, :, None] * along[:, None]
    found, *_ = np.linalg.lstsq(across.sum(axis=0), (across @ place[..., None]).sum(axis=0))
    return np.asarray(found[:, 0])


offset_shoulder = partial(_model, backwards=False)
offset_wrist = partial(_model, backwards=True)
