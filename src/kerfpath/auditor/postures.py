"""Enclosures of the joint angles and their derivatives in every posture, as the tool turns.

They follow from the geometry alone. Both families have a vertical axis 1, a plane that turns with
it, and in that plane two links whose joints are perpendicular to it:

- the distance of the wrist point from that plane is fixed, which leaves two values of axis 1
  (shoulder);
- in the plane, two links reach a point by two triangles (elbow), with angles by the law of cosines
  and directions as differences of arguments;
- the rest is a rotation about two axes that meet, and its mirror image (wrist).

Where a square root may be zero, two branches meet; where an argument of zero is taken, a joint is
free. There the derivatives are not known, and the range of a free angle is a full turn, so the
continuum of solutions at a singularity is also covered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import Array, Bools, short_repr
from kerfpath.auditor.jets import HALF_TURN, Interval, Jet, argument, constant, exact

TWO = np.array([1.0, -1.0])
SHOULDER = TWO[:, None, None, None]
ELBOW = TWO[:, None, None]
WRIST = TWO[:, None]
"""Signs of the branches: front and rear, up and down, plus and minus; cells on the last axis."""
MIRRORED = Interval(np.array([[0.0], [HALF_TURN.lo]]), np.array([[0.0], [HALF_TURN.hi]]))
"""Half a turn for the second wrist."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Pose of the model's end in the model's base as the tool turns.

    Parameters
    ----------
    columns : Jet (3, 4, C)
        The axes of the end, and a point on the last axis where the wrist's axes meet, m.
    """

    columns: Jet

    __repr__ = short_repr

    @property
    def x(self) -> Jet:
        return self.columns[:, 0]

    @property
    def y(self) -> Jet:
        return self.columns[:, 1]

    @property
    def z(self) -> Jet:
        return self.columns[:, 2]

    @property
    def point(self) -> Jet:
        return self.columns[:, 3]


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """The angles of the model in every posture.

    Parameters
    ----------
    angles : tuple of 6 Jet
        Angles, rad, that broadcast to (2, 2, 2, C): shoulder, elbow, wrist and cell.
    none : (2, 2, 2, C) bool
        Whether no pose of the cell has a solution in this posture.
    """

    angles: tuple[Jet, ...]
    none: Bools

    __repr__ = short_repr


def _shoulder(pose: Pose, aside: float, side: Array) -> tuple[Jet, Jet, Bools]:
    """Return axis 1, how far the wrist point is ahead of it, and where it is too near to axis 1.

    The wrist point is `aside` m off the plane; `side` is 1 where it is ahead and -1 where behind.
    """
    x, y = pose.point[0], pose.point[1]
    ahead2 = (x.square() + y.square()).plus(-exact(aside).square())
    ahead = ahead2.sqrt().scaled(side)
    return argument(x, y) - argument(ahead, constant(exact(aside), x)), ahead, ahead2.value.hi < 0


def _two_links(
    x: Jet, y: Jet, first: Interval, second: Interval, side: Array
) -> tuple[Jet, Jet, Jet, Bools]:
    """Return the directions of two links that reach (x, y), their bend, and where they cannot.

    Directions are counted from x to y. The sine of the bend from the first to the second link has
    the sign `side`. Lengths (m) may be negative.
    """
    reach2 = x.square() + y.square()
    cosine = reach2.plus(-(first.square() + second.square())).times(
        exact(1.0) / (first * second).scaled(2.0)
    )
    one = constant(exact(1.0), cosine)
    sine = ((one - cosine) * (one + cosine)).sqrt().scaled(side)
    beyond = (cosine.value.lo > 1) | (cosine.value.hi < -1)
    held = Interval(np.fmax(cosine.value.lo, -1.0), np.fmin(cosine.value.hi, 1.0))
    cosine = Jet(cosine.at, cosine.slope, held, cosine.rate, cosine.bend, cosine.half)
    to, bend = argument(x, y), argument(cosine, sine)
    inner = argument(cosine.times(second).plus(first), sine.times(second))
    outer = argument(cosine.times(first).plus(second), -sine.times(first))
    return to - inner, to - outer, bend, beyond


def _turned(c: Jet, s: Jet, x: Jet, y: Jet) -> tuple[Jet, Jet]:
    """Return (x, y) in axes turned by the angle with cosine c and sine s."""
    return c * x + s * y, c * y - s * x


def _opw(lengths: dict[str, float], pose: Pose) -> Postures:
    """Return the postures of an ortho-parallel arm with a spherical wrist.

    The upper arm, of length c2, points upwards at zero and turns forward; the wrist is c3 along and
    a2 across from the elbow, and turns about z, y, z.
    """
    theta_1, ahead, near = _shoulder(pose, lengths["b"], SHOULDER)
    a2, c3 = exact(lengths["a2"]), exact(lengths["c3"])
    forearm = (a2.square() + c3.square()).sqrt()
    across = argument(constant(c3, theta_1), constant(a2, theta_1))
    height = pose.point[2].plus(-exact(lengths["c1"]))
    theta_2, to_wrist, bend, beyond = _two_links(
        height,
        ahead.plus(-exact(lengths["a1"])),
        exact(lengths["c2"]),
        forearm,
        SHOULDER * ELBOW,
    )
    forward = to_wrist - across
    c1, s1 = theta_1.cos_sin()
    c, s = forward.cos_sin()
    # The end's axes along and across the forearm (z), and to its front (x) and side (y).
    x_ahead, y_ahead = (c1 * e[0] + s1 * e[1] for e in (pose.x, pose.y))
    z_ahead, z_side = _turned(c1, s1, pose.z[0], pose.z[1])
    x_along, y_along = (s * a + c * e[2] for a, e in ((x_ahead, pose.x), (y_ahead, pose.y)))
    z_along, z_front = s * z_ahead + c * pose.z[2], c * z_ahead - s * pose.z[2]
    sine = (z_front.square() + z_side.square()).sqrt()
    angles = (
        theta_1,
        theta_2,
        bend - across,
        argument(z_front, z_side).plus(MIRRORED),
        argument(z_along, sine).scaled(WRIST),
        argument(-x_along, y_along).plus(MIRRORED),
    )
    return Postures(angles, near | beyond | np.zeros((2, 2, 2, 1), dtype=bool))


def _ur(lengths: dict[str, float], pose: Pose) -> Postures:
    """Return the postures of an arm of the Universal Robots type.

    The links a2 and a3 move in a plane at the distance d4 from axis 1. The wrist point, where axes
    5 and 6 meet, is d5 below axis 4 if angles 2 to 4 add up to zero. Axis 5 is in the plane, so the
    wrist is a turn out of the plane and one about axis 6.
    """
    front = np.copysign(1.0, lengths["a2"]) * SHOULDER
    theta_1, ahead, near = _shoulder(pose, -lengths["d4"], front)
    c1, s1 = theta_1.cos_sin()
    # Outwards is perpendicular to the plane, in the direction of axis 4.
    z_ahead = c1 * pose.z[0] + s1 * pose.z[1]
    x_out, y_out, z_out = (s1 * e[0] - c1 * e[1] for e in (pose.x, pose.y, pose.z))
    sine = (z_ahead.square() + pose.z[2].square()).sqrt()
    theta_5 = argument(z_out, sine).scaled(WRIST)
    theta_6 = argument(x_out.scaled(WRIST), (-y_out).scaled(WRIST))
    direction = argument(z_ahead.scaled(-WRIST), pose.z[2].scaled(-WRIST))
    c, s = direction.cos_sin()
    d5 = exact(lengths["d5"])
    theta_2, along, bend, beyond = _two_links(
        ahead - s.times(d5),
        pose.point[2].plus(-exact(lengths["d1"])) + c.times(d5),
        exact(lengths["a2"]),
        exact(lengths["a3"]),
        -np.copysign(1.0, lengths["a3"]) * SHOULDER * ELBOW,
    )
    angles = (theta_1, theta_2, bend, direction - along, theta_5, theta_6)
    return Postures(angles, near | beyond | np.zeros((2, 2, 2, 1), dtype=bool))


POSTURES_OF = {"opw": _opw, "ur": _ur}
"""The function of each enclosed family that returns its postures from lengths (m) and pose."""

TO_WRIST = {"opw": "c4", "ur": "d6"}
"""Name of the length (m) from the wrist point to the end, along the end's z-axis."""
