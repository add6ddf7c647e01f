"""Jobs that are kept for comparison: their texts, and the motions that were found for them."""

from __future__ import annotations

from string import ascii_uppercase
from typing import NamedTuple

from kerfpath.errors import InputError
from kerfpath.studio._decide_messages import KeptEntry, KeptMessage
from kerfpath.studio._document import Document
from kerfpath.studio._messages import Cycle, OutcomeMessage, PlanMessage
from kerfpath.studio._numbers import Message

__all__ = ["Kept"]

MOST_KEPT = 8
"""Largest number of kept jobs: more could not be distinguished, and each holds its motions."""

Plans = dict[str, dict[str, PlanMessage]]
"""Plans by contour, then by the name of the plan."""


class _Copy(NamedTuple):
    """A job that is kept."""

    id: int
    name: str
    revision: int
    text: str
    metric: str
    objective: str
    plans: Plans
    cycle: Cycle | None


class Kept:
    """The kept jobs, and the newest plans and outcome of the current one."""

    def __init__(self) -> None:
        self._now: Plans = {}
        self._outcome: OutcomeMessage | None = None
        self._copies: dict[int, _Copy] = {}
        self._count = 0

    def take(self, message: Message) -> bool:
        """Take a message about the job; return whether it concerns a kept job."""
        if isinstance(message, OutcomeMessage):
            self._outcome = message
            found = [one for one in self._copies.values() if one.revision == message.revision]
            for one in found:
                self._copies[one.id] = one._replace(cycle=message.cycle)
            return bool(found)
        if not isinstance(message, PlanMessage):
            return False
        _put(self._now, message)
        # The bound of a plan, and the turns of its joints, follow later than the plan.
        found = [one for one in self._copies.values() if one.revision == message.revision]
        for one in found:
            _put(one.plans, message)
        return bool(found)

    def keep(self, document: Document, name: str | None, metric: str, objective: str) -> None:
        """Keep the current job under a name, by default the next letter.

        Raises
        ------
        InputError
            The job is not planned yet, `MOST_KEPT` jobs are kept already, or the name is blank.
        """
        now = document.revision
        plans = {
            contour: dict(pieces)
            for contour, pieces in self._now.items()
            if all(one.revision == now and one.checks is not None for one in pieces.values())
        }
        if not plans:
            raise InputError("keep: the current job is not planned yet; wait until it is")
        if len(self._copies) >= MOST_KEPT:
            raise InputError(f"keep: {MOST_KEPT} plans are kept already; forget one of them first")
        self._count += 1
        known = self._outcome if self._outcome and self._outcome.revision == now else None
        self._copies[self._count] = _Copy(
            id=self._count,
            name=_words(name or self._letter()),
            revision=now,
            text=document.text,
            metric=metric,
            objective=objective,
            plans=plans,
            cycle=None if known is None else known.cycle,
        )

    def rename(self, number: int, name: str) -> None:
        """Rename a kept job.

        Raises
        ------
        InputError
            No kept job has this number, or the name is blank.
        """
        self._copies[number] = self._of(number)._replace(name=_words(name))

    def forget(self, number: int) -> None:
        """Drop a kept job.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        del self._copies[self._of(number).id]

    def text(self, number: int) -> str:
        """Return the text of a kept job.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        return self._of(number).text

    def plans(self, number: int) -> str:
        """Return the plans of a kept job as a JSON list.

        Raises
        ------
        InputError
            No kept job has this number.
        """
        found = self._of(number).plans.values()
        said = [plan.model_dump_json() for pieces in found for plan in pieces.values()]
        return f"[{','.join(said)}]"

    def message(self) -> KeptMessage:
        """Return the message that lists the kept jobs, without their motions."""
        return KeptMessage(
            plans=[
                KeptEntry(
                    id=one.id,
                    name=one.name,
                    revision=one.revision,
                    metric=one.metric,
                    objective=one.objective,
                    contours=list(one.plans),
                    cycle=one.cycle,
                    settled=all(
                        plan.settled for pieces in one.plans.values() for plan in pieces.values()
                    ),
                )
                for one in self._copies.values()
            ]
        )

    def keep_only(self, contours: list[str]) -> None:
        """Forget the plans of contours that the job no longer has."""
        self._now = {name: pieces for name, pieces in self._now.items() if name in set(contours)}

    def _of(self, number: int) -> _Copy:
        found = self._copies.get(number)
        if found is None:
            raise InputError("there is no such plan any more; it has been forgotten")
        return found

    def _letter(self) -> str:
        taken = {one.name for one in self._copies.values()}
        return next(letter for letter in ascii_uppercase if letter not in taken)


def _put(plans: Plans, message: PlanMessage) -> None:
    """Add a plan to the pieces of its contour; drop the pieces that it replaces."""
    held = plans.setdefault(message.contour, {})
    others = [one for one in held.values() if one.name != message.name]
    if message.pieces == 1 or any(one.revision != message.revision for one in others):
        held.clear()
    held[message.name] = message


def _words(name: str) -> str:
    if not name.strip():
        raise InputError('keep: expected a name such as "A" or "slower", got none')
    return name.strip()
