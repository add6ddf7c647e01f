"""Kinematic families: what a robot's geometry is made of, and the kernels that solve it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from kerfpath._arrays import Array
from kerfpath._repr import short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import enclosure, enclosure_ur, five, kinematics, srs, ur
from kerfpath.robots import _general

__all__ = ["FAMILIES", "Family", "posture_name", "postures_named"]

EIGHT = tuple(
    "/".join(words) for words in product(("front", "rear"), ("up", "down"), ("plus", "minus"))
)
"""Postures by shoulder, elbow and wrist: mu = 4 shoulder + 2 elbow + wrist."""
MORE = tuple(
    "/".join(words) for words in product(("front", "rear"), ("up", "down"), ("third", "fourth"))
)
"""What an offset tool may add to them on a five-axis arm, an offset wrist on any, mu = 8 and on."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Family:
    """One kind of arm with a closed form of its own.

    Parameters
    ----------
    name : str
        As `Robot.kinematics` says it.
    words : str
        What it is, in words.
    joints : int
    lengths : tuple of str
        The lengths (m) that a geometry must have.
    postures : tuple of str
        Name of every posture mu.
    model : callable
        Makes what the kernels take from the lengths, `sign` and `offset`; without lengths, from
        `chain`, the robot's joint frames, in their place.
    forward_all, inverse_all : callable
        (model, q (B, n), out_T (B, 4, 4)) and (model, T (B, 4, 4), out_q (B, P, n), out_reach
        (B, P)), between joints and the model's own base and end frames. Where a joint is `given`,
        its angles (B,) are the third argument of the inverse.
    inverse_nodes : callable, optional
        As `kernels.kinematics.inverse_nodes`, where a family has it in one piece.
    follow_all : callable, optional
        (model, T (B, 4, 4), q (B, n)): brings each q onto its pose along its own branch, or makes
        it NaN. Of a family where several branches have one posture.
    enclose_all : callable, optional
        As `kernels.enclosure.enclose_all`, where a family has proven bounds.
    wrist : str
        The length by which its wrist centre is behind the end; "" without `enclose_all`.
    flips : int, optional
        The joint that is mirrored about its offset where the wrist is turned over, from posture
        2 i to 2 i + 1 or back, while all others turn by a constant; None where there is none.
    poses_at_once : int
        Poses solved per piece of work: large against the overhead, small against the memory.
    given : int, optional
        The joint, from 0, that a pose leaves free: the inverse finds the others where it stands.
    free_rotation : bool
        Whether a tool tip and a tool axis leave the rotation about that axis free. If not, a
        layer has one sample of gamma, and poses ask for the tip and the axis alone.
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
            name="general",
            words="six-axis arm of any geometry, solved by ssik",
            joints=6,
            lengths=(),
            postures=(*EIGHT, *MORE),
            model=_general.model,
            forward_all=_general.forward_all,
            inverse_all=_general.inverse_all,
            follow_all=_general.follow_all,
            poses_at_once=10_000,
        ),
    )
}


def posture_name(posture: int) -> str:
    """Return a posture in words: shoulder, elbow, wrist, as in "front/up/plus" (every family's)."""
    return (*EIGHT, *MORE)[posture]


def postures_named(words: str, kinematics: str) -> tuple[int, ...]:
    """Return the postures of a family of arms (`Robot.kinematics`) that fit some words.

    "front/up" fits 0 and 1, "rear" fits 4 to 7, and whatever the family has beyond these eight.

    Raises
    ------
    InputError
        Words that fit no posture of the family: an unknown one, two that exclude each other.
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
