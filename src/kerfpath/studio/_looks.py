"""Answers to the read-only questions of pages about planned contours."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from kerfpath.errors import InputError
from kerfpath.studio._asks import ReasonOf, ShadeOf, TechniqueOf
from kerfpath.studio._hub import Page
from kerfpath.studio._map import map_message, pose_message, with_collisions
from kerfpath.studio._messages import MapMessage, PoseMessage
from kerfpath.studio._numbers import Message
from kerfpath.studio._planning import Planning
from kerfpath.studio._shade import shade_message, shades_of
from kerfpath.studio._technique import technique_message
from kerfpath.studio._work import Newest, Stop

__all__ = ["Looks"]


class Looks:
    """Answers the questions of pages about the current plans.

    Slow questions have a thread for each page and kind: a newer one stops the one before.

    Parameters
    ----------
    planning : Planning
    say : callable
        Takes the page and the answer, from any thread.
    failed : callable
        Takes the page, the kind of question and the exception; called in that thread.
    """

    def __init__(
        self,
        planning: Planning,
        say: Callable[[Page, Message], None],
        failed: Callable[[Page, str, BaseException], None],
    ) -> None:
        self._planning, self._say, self._failed = planning, say, failed
        self._work: dict[tuple[Page, str], Newest] = {}

    def map(self, contour: str, revision: int) -> MapMessage:
        """Return the map of a contour.

        Raises
        ------
        InputError
            The contour is not planned yet.
        """
        prepared, cuts, nodes, graph = self._planning.whole(contour)
        shades = shades_of(prepared.job, graph, prepared.cell)
        return map_message(
            cuts, nodes, graph, robot=prepared.job.robot, shades=shades, revision=revision
        )

    def pose(self, ask: ReasonOf) -> PoseMessage:
        """Return the joints of the robot at a place of a map.

        Raises
        ------
        InputError
            The contour is not planned yet, or the map has no such node or posture.
        """
        prepared, cuts, nodes, graph = self._planning.whole(ask.contour)
        K, _, postures = graph.reason.shape
        if not (ask.node < K and ask.posture < postures):
            raise InputError(
                f"reason: expected a node below {K} and a posture below {postures}, got "
                f"{ask.node} and {ask.posture}"
            )
        return pose_message(
            ask.contour, prepared.job, cuts, nodes, with_collisions(cuts[0], graph),
            node=ask.node, gamma=ask.gamma, posture=ask.posture,
        )  # fmt: skip

    def shade(self, page: Page, ask: ShadeOf, revision: int) -> None:
        """Compute a quantity over a map; `by` None stops a running computation."""
        by = ask.by
        if by is None:
            self._cancel(page, ask.type)
            return

        def look(stop: Stop) -> Message:
            prepared, _, _, graph = self._planning.whole(ask.contour)
            return shade_message(
                ask.contour, prepared.job, graph, prepared.cell, by, revision=revision, stop=stop
            )

        self._ask(page, ask.type, look)

    def technique(self, page: Page, ask: TechniqueOf) -> None:
        """Compute the course of another technique; `method` None stops a running computation."""
        method = ask.method
        if method is None:
            self._cancel(page, ask.type)
            return

        def look(stop: Stop) -> Message:
            revision = self._planning.revisions.get(ask.contour, 0)
            prepared, cuts, nodes, graph = self._planning.whole(ask.contour)
            return technique_message(prepared, cuts[0], nodes, graph, method, revision=revision)

        self._ask(page, ask.type, look)

    def leave(self, page: Page) -> None:
        """Stop the work of a page, and end its threads."""
        for key in [key for key in self._work if key[0] is page]:
            self._work.pop(key).close()

    def close(self) -> None:
        """Stop the work of all pages, and end the threads."""
        for page, _ in list(self._work):
            self.leave(page)

    def _ask(self, page: Page, kind: str, look: Callable[[Stop], Message]) -> None:
        if (page, kind) not in self._work:
            self._work[page, kind] = Newest(kind, partial(self._failed, page, kind))
        self._work[page, kind].ask(partial(self._answer, page, look))

    def _cancel(self, page: Page, kind: str) -> None:
        if (page, kind) in self._work:
            self._work[page, kind].cancel()

    def _answer(self, page: Page, look: Callable[[Stop], Message], stop: Stop) -> None:
        found = look(stop)
        stop.check()
        self._say(page, found)
