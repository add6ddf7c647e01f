"""Why candidates and edges are lost: one enumeration, from the kernels to the report."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Loss", "Reason"]


class Loss(IntEnum):
    """The tests that remove a candidate pose from its layer, or an edge from the graph.

    Kernels code the bounds of joint (or coupling) i as LOW + 2 i and HIGH + 2 i.
    """

    words: str

    def __new__(cls, code: int, words: str) -> Loss:
        """Return the member with a code; {} in its words is the joint, margin or place."""
        made = int.__new__(cls, code)
        made._value_, made.words = code, words
        return made

    ADMITTED = 0, "admitted"
    UNREACHABLE = 1, "unreachable"
    LOW = 2, "{} low"
    HIGH = 3, "{} high"
    UNWANTED = 4, "posture not wanted"
    MARGIN = 5, "{} margin"
    WINDOW = 6, "window of joint {}"
    LEFT_OUT = 7, "left out"
    SPARE = 8, "{} to spare"
    COLLISION = 9, "collision {}"
    CLOSED = 10, "closed vertices"
    SHUT = 11, "shut edges"
    VELOCITY = 12, "velocity, joint {}"
    ACCELERATION = 13, "acceleration, joint {}"
    NO_ROOM = 14, "no room to back off by {}"
    FLOOR = 15, "below the floor"
    PINNED = 16, "outside the pinned window of gamma"
    TORQUE = 17, "torque, joint {}"
    LEAP = 18, "change of posture between nodes"


class Reason(str):
    """A loss with its joint, margin or place, as plan.json and messages write it.

    The string is that text, such as "joint 3 low"; code compares its `loss`.
    """

    loss: Loss
    which: object

    def __new__(cls, loss: Loss, which: object = "") -> Reason:
        """Return the reason; `which` is the joint, margin or place that fills {} in the words."""
        made = str.__new__(cls, loss.words.format(which).rstrip())
        made.loss, made.which = loss, which
        return made

    def __getnewargs__(self) -> tuple[Loss, object]:  # type: ignore[override]  # not a str's own
        """Return the arguments that pickle and copy pass to `__new__`."""
        return self.loss, self.which
