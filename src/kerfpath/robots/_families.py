"""Kinematic families: what a robot's geometry is made of, and the kernels that solve it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

from kerfpath.errors import InputError
from kerfpath.kernels import kinematics, ur

__all__ = ["FAMILIES", "Family", "posture_name", "postures_named"]

EIGHT = tuple(
    "/".join(words) for words in product(("front", "rear"), ("up", "down"), ("plus", "minus"))
)
"""Postures by shoulder, elbow and wrist: mu = 4 shoulder + 2 elbow + wrist."""


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
        Makes what the kernels take from the lengths, `sign` and `offset`.
    forward_all, inverse_all : callable
        (model, q (B, n), out_T (B, 4, 4)) and (model, T (B, 4, 4), out_q (B, P, n), out_reach
        (B, P)), between joints and the model's own base and end frames.
    inverse_nodes : callable, optional
        As `kernels.kinematics.inverse_nodes`, where a family has it in one piece.
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


FAMILIES = {
    family.name: family
    for family in (
        Family(
            name="opw",
            words="ortho-parallel arm with a spherical wrist",
            joints=6,
            lengths=("a1", "a2", "b", "c1", "c2", "c3", "c4"),
            postures=EIGHT,
            model=kinematics.Arm,
            forward_all=kinematics.forward_all,
            inverse_all=kinematics.inverse_all,
            inverse_nodes=kinematics.inverse_nodes,
        ),
        Family(
            name="ur",
            words="arm of the Universal Robots type, axes 2 to 4 parallel",
            joints=6,
            lengths=("d1", "a2", "a3", "d4", "d5", "d6"),
            postures=EIGHT,
            model=ur.Arm,
            forward_all=ur.forward_all,
            inverse_all=ur.inverse_all,
        ),
    )
}


def posture_name(posture: int) -> str:
    """Say a posture in words: shoulder, elbow, wrist, as in "front/up/plus"."""
    return EIGHT[posture]


def postures_named(words: str) -> tuple[int, ...]:
    """Return the postures that fit some words: "front/up" fits 0 and 1, "rear" fits 4 to 7.

    Raises
    ------
    InputError
        A word that names no shoulder, elbow or wrist, or two that exclude each other.
    """
    wanted = [word for word in words.split("/") if word]
    fitting = [mu for mu, name in enumerate(EIGHT) if all(w in name.split("/") for w in wanted)]
    if not fitting:
        raise InputError(
            f"posture {words!r}: expected words of front|rear / up|down / plus|minus, "
            'such as "front/up"'
        )
    return tuple(fitting)
