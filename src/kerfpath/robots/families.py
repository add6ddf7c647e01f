"""Kinematic families: the lengths that define a robot's geometry, and the kernels that solve it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import enclosure, enclosure_ur, five, kinematics, srs, ur
from kerfpath.kernels import seven as offset
from kerfpath.robots import general, seven

EIGHT = tuple(
    "/".join(words) for words in product(("front", "rear"), ("up", "down"), ("plus", "minus"))
)
"""Names of postures by shoulder, elbow and wrist: mu = 4 shoulder + 2 elbow + wrist."""
MORE = tuple(
    "/".join(words) for words in product(("front", "rear"), ("up", "down"), ("third", "fourth"))
)
"""Names of further postures, mu >= 8: of five-axis arms with an offset tool, of offset wrists."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Family:
    """A kinematic family: arms that share one model and one solver.

    Parameters
    ----------
    name : str
        Value of `Robot.kinematics`.
    words : str
        Description for messages.
    joints : int
        Number of joints of the arm.
    lengths : tuple of str
        The lengths (m) that a geometry must have.
    postures : tuple of str
        Name of every posture mu.
    model : callable
        Makes the kernels' model from the lengths, `sign` and `offset`; in a family without lengths
        from `chain`, the robot's joint frames, `sign` and `offset`.
    forward_all, inverse_all : callable
        (model, q (B, n), out_T (B, 4, 4)) and (model, T (B, 4, 4), out_q (B, P, n), out_reach
        (B, P)), between joints and the model's own base and end frames. Where a joint is `given`,
        its angles (B,) are the third argument of the inverse.
    inverse_nodes : callable, optional
        As `kernels.kinematics.inverse_nodes`, where the family has such a kernel.
    inverse_one : callable, optional
        (model, T (B, 4, 4), posture (B,), out_q (B, n)): the joints of each pose in one posture, or
        NaN, where that takes less time than all postures.
    follow_all : callable, optional
        (model, T (B, 4, 4), q (B, n)): brings each q onto its pose along its own branch, or makes
        it NaN; for a family where several branches share a posture.
    enclose_all : callable, optional
        As `kernels.enclosure.enclose_all`, where the family has proven bounds.
    wrist : str
        Name of the length by which the wrist centre is behind the end; "" without `enclose_all`.
    flips : int, optional
        The joint (from 0) that is mirrored about its offset when the wrist flips from posture 2 i
        to 2 i + 1 or back, while all others turn by a constant; None where there is none.
    poses_at_once : int
        Number of poses solved in one call: large enough to hide overhead, small enough for memory.
    given : int, optional
        The joint (from 0) that a pose leaves free: the inverse takes its value and returns the
        other joints.
    free_rotation : bool
        Whether the rotation about the tool axis is free for a given tip and axis. If not, a layer
        has one sample of gamma, and poses define only the tip and the axis.
    """

    name: str
    words: str
    joints: int
    lengths: tuple[str, ...]
    postures: tuple[str, ...]
    model: Callable[..., Any]
    forward_all: Callable[..., None]
    inverse_all: Callable[..., None]
    inverse_nodes: Callable[..., None] | None = None
    inverse_one: Callable[..., None] | None = None
    follow_all: Callable[..., None] | None = None
    enclose_all: Callable[..., None] | None = None
    wrist: str = ""
    flips: int | None = None
    poses_at_once: int = 100_000
    given: int | None = None
    free_rotation: bool = True

    __repr__ = short_repr


def _without_sixth(*, sign: Array, offset: Array, **lengths: float) -> kinematics.OpwArm:
    """Return the OPW arm whose sixth angle is held at zero."""
    return kinematics.OpwArm(**lengths, sign=np.append(sign, 1.0), offset=np.append(offset, 0.0))


FAMILIES = {
    family.name: family
    for family in (
        Family(
            name="opw",
            words="ortho-parallel arm with a spherical wrist",
            joints=6,
            lengths=("a1", "a2", "b", "c1", "c2", "c3", "c4"),
            postures=EIGHT,
            model=kinematics.OpwArm,
            forward_all=kinematics.forward_all,
            inverse_all=kinematics.inverse_all,
            inverse_nodes=kinematics.inverse_nodes,
            inverse_one=kinematics.inverse_one,
            enclose_all=enclosure.enclose_all,
            wrist="c4",
            flips=4,
        ),
        Family(
            name="ur",
            words="arm of the Universal Robots type, axes 2 to 4 parallel",
            joints=6,
            lengths=("d1", "a2", "a3", "d4", "d5", "d6"),
            postures=EIGHT,
            model=ur.UrArm,
            forward_all=ur.forward_all,
            inverse_all=ur.inverse_all,
            inverse_one=ur.inverse_one,
            enclose_all=enclosure_ur.enclose_all,
            wrist="d6",
        ),
        Family(
            name="five",
            words="five-axis arm: three axes to the forearm and a wrist of two",
            joints=5,
            lengths=("a1", "a2", "b", "c1", "c2", "c3", "c4"),
            postures=(*EIGHT, *MORE),
            model=_without_sixth,
            forward_all=five.forward_all,
            inverse_all=five.inverse_all,
            inverse_nodes=five.inverse_nodes,
            free_rotation=False,
        ),
        Family(
            name="srs",
            words="arm of seven axes with a spherical shoulder and wrist",
            joints=7,
            lengths=("c1", "c2", "c3", "c4"),
            postures=EIGHT,
            model=srs.SrsArm,
            forward_all=srs.forward_all,
            inverse_all=srs.inverse_all,
            given=2,
        ),
        Family(
            name="offset_shoulder",
            words="arm of seven axes with an offset shoulder and a spherical wrist",
            joints=7,
            lengths=(),
            postures=EIGHT,
            model=seven.offset_shoulder,
            forward_all=offset.forward_all,
            inverse_all=offset.inverse_all,
            given=0,
        ),
        Family(
            name="offset_wrist",
            words="arm of seven axes with a spherical shoulder and an offset wrist",
            joints=7,
            lengths=(),
            postures=EIGHT,
            model=seven.offset_wrist,
            forward_all=offset.forward_all,
            inverse_all=offset.inverse_all,
            given=6,
        ),
        Family(
            name="general",
            words="six-axis arm of any geometry, solved by ssik",
            joints=6,
            lengths=(),
            postures=(*EIGHT, *MORE),
            model=general.model,
            forward_all=general.forward_all,
            inverse_all=general.inverse_all,
            follow_all=general.follow_all,
            poses_at_once=10_000,
        ),
    )
}


def posture_name(posture: int) -> str:
    """Return the name of a posture by shoulder, elbow and wrist, such as "front/up/plus"."""
    return (*EIGHT, *MORE)[posture]


def postures_named(words: str, kinematics: str) -> tuple[int, ...]:
    """Return the postures of a family (`Robot.kinematics`) whose names contain all given words.

    "front/up" matches 0 and 1, "rear" matches 4 to 7; both also match postures from 8 on where the
    family has them.

    Raises
    ------
    InputError
        No posture of the family matches: a word is unknown, or two words exclude each other.
    """
    wanted = {word for word in words.split("/") if word}
    named = [set(name.split("/")) for name in FAMILIES[kinematics].postures]
    fitting = [mu for mu, name in enumerate(named) if wanted <= name]
    if not fitting:
        more = "|third|fourth" if len(named) > len(EIGHT) else ""
        raise InputError(
            f"expected a posture in words of front|rear / up|down / plus|minus{more}, such as "
            f'"front/up", got {words!r:.60}'
        )
    return tuple(fitting)
