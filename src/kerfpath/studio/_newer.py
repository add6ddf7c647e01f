"""A filter that drops outdated messages of other threads and adds the previous cost to plans."""

from __future__ import annotations

from typing import NamedTuple

from kerfpath.studio._messages import NoPathMessage, PlanMessage
from kerfpath.studio._numbers import Message

__all__ = ["Newer"]


class _Cost(NamedTuple):
    """The cost of the plan of a revision, and of the previous revision."""

    revision: int
    cost: float
    before: float | None


class Newer:
    """A filter that drops messages older than one that was sent."""

    def __init__(self) -> None:
        self._said: dict[tuple[str, str], tuple[int, bool]] = {}
        self._costs: dict[str, _Cost] = {}

    def of(self, message: Message) -> Message | None:
        """Return the message, a plan with its previous cost; None if a newer one was sent.

        A draft counts as older than the plan of a run of the same revision.
        """
        revision = getattr(message, "revision", None)
        if revision is None:
            return message
        kind, contour = str(getattr(message, "type", "")), getattr(message, "contour", None) or ""
        if isinstance(message, PlanMessage | NoPathMessage):
            kind = "course"
        full = not isinstance(message, PlanMessage) or message.checks is not None
        if self._said.get((kind, contour), (0, False)) > (revision, full):
            return None
        self._said[kind, contour] = revision, full
        return self._with_cost(message) if isinstance(message, PlanMessage) else message

    def keep_only(self, contours: list[str]) -> None:
        """Forget the contours that the job no longer has."""
        known = {*contours, ""}
        self._said = {key: said for key, said in self._said.items() if key[1] in known}
        self._costs = {name: cost for name, cost in self._costs.items() if name in known}

    def _with_cost(self, message: PlanMessage) -> PlanMessage:
        if message.pieces > 1:
            return message
        known = self._costs.get(message.contour)
        if known is None:
            before = None
        elif known.revision < message.revision:
            before = known.cost
        else:
            before = known.before
        self._costs[message.contour] = _Cost(message.revision, message.cost, before)
        return message.model_copy(update={"previous_cost": before})
