"""Other placements of the part: the test of reach, and the search for the best one."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from os import cpu_count
from pathlib import Path
from typing import Literal

from kerfpath.errors import InputError
from kerfpath.job import PreparedJob
from kerfpath.studio._asks import LayoutOf, Place, ReachOf
from kerfpath.studio._document import Change, with_values
from kerfpath.studio._layout_messages import LayoutMessage, OutOfReach, ReachMessage, TryEntry
from kerfpath.studio._numbers import Message, flat
from kerfpath.studio._work import Newest, Seldom, Stop
from kerfpath.study import digest
from kerfpath.study.placing import (
    UNITS,
    Layout,
    Placement,
    PlacementTrial,
    changes_of,
    contours_of,
    layout_as,
    middle_of,
    nodes_of,
    placed_text,
    placement_of,
)

__all__ = ["Layouts"]

SHOWN = 20
"""Number of placements that a page gets, the best first."""
SHOWN_EVERY = 0.25
"""Least time between two messages about new placements, s."""
Say = Callable[[Message], None]
State = Literal["running", "done", "stopped"]


class Layouts:
    """Tests reach at placements and searches for the best one; only the newest request counts.

    Parameters
    ----------
    say : callable
        Takes messages, from any thread.
    failed : callable
        Takes the exception of failed work; called in its thread.
    """

    def __init__(self, say: Say, failed: Callable[[BaseException], None]) -> None:
        self._say = say
        self._search = Newest("layout", failed)
        self._hand = Newest("reach", failed)
        self._study: _Study | None = None
        self._stands: tuple[int, PreparedJob] | None = None

    def stands(self, prepared: PreparedJob, revision: int) -> None:
        """Take the job of the scene that is sent now; offsets refer to it."""
        self._stands = revision, prepared

    def reach(self, ask: ReachOf, answer: Say) -> None:
        """Answer which nodes are out of reach, unless a newer question comes first.

        Raises
        ------
        InputError
            There is no scene yet.
        """
        revision, prepared = self._there()

        def work(stop: Stop) -> None:
            at = placement_of(prepared)
            found = at.out_of_reach(ask.offsets)
            stop.check()
            answer(
                ReachMessage(
                    revision=revision,
                    number=ask.number,
                    middle=flat(at.middle),
                    contours=[
                        OutOfReach(
                            name=request.task.name,
                            nodes=len(request.candidates[0].nodes),
                            out=out.tolist(),
                        )
                        for request, out in zip(at.requests, found, strict=True)
                    ],
                )
            )

        self._hand.ask(work)

    def placed(self, ask: Place) -> list[Change]:
        """Return the changes of the job that apply offsets.

        Raises
        ------
        InputError
            There is no scene, or it has changed since.
        """
        scene, prepared = self._there()
        if scene != ask.scene:
            raise InputError("place: the scene has changed meanwhile; repeat the move")
        return _changes(placement_of(prepared), ask.offsets)

    def look(self, prepared: PreparedJob, ask: LayoutOf, revision: int) -> None:
        """Start the search for the best placement; it replaces a running search."""
        self._search.ask(partial(self._look, prepared, ask, revision))

    def changes(self, number: int, revision: int) -> list[Change]:
        """Return the changes of the job that apply a placement that was tried.

        Raises
        ------
        InputError
            There is no such placement, it is not feasible, or the job has changed since.
        """
        study = self._study
        if study is None or study.revision != revision or number >= len(study.trials):
            raise InputError("take: there is no such placement any more; search again")
        why = study.trials[number].result.infeasibility
        if why is not None:
            raise InputError(f"take: the placement is infeasible: {why.reason}; take another one")
        return _changes(study.placement, study.trials[number].offsets)

    def cancel(self) -> None:
        """Stop the search; the placements that it found stay."""
        self._search.cancel()

    def close(self) -> None:
        """Stop all work, and end the threads."""
        self._search.close()
        self._hand.close()

    def _there(self) -> tuple[int, PreparedJob]:
        if self._stands is None:
            raise InputError("the job is not read yet; wait until its part is shown")
        return self._stands

    def _look(self, prepared: PreparedJob, ask: LayoutOf, revision: int, stop: Stop) -> None:
        """Search on a copy of the job, as the job itself may be saved meanwhile."""
        folder = Path(tempfile.mkdtemp(prefix="kerfpath-layout-"))
        study: _Study | None = None
        try:
            job = folder / "job.toml"
            text = placed_text(prepared.job, {}, folder, "a copy")
            if ask.grid:
                text = with_values(text, [(("plan", "method"), "exact")])
            job.write_text(text, encoding="utf-8")
            nodes = nodes_of(contours_of(str(job), digest(job), ask.goal))
            at = Placement(
                job=prepared.job,
                requests=tuple(prepared.contours),
                middle=middle_of(prepared.job, nodes),
            )
            study = self._study = _Study(at, ask, revision, self._say, stop)
            table = prepared.job.layout.model_copy(
                update={"goal": ask.goal, "evaluations": ask.evaluations, "map_points": 0}
            )
            found = layout_as(
                job,
                table,
                store=folder / "store.sqlite",
                ranges=ask.ranges,
                processes=max(1, (cpu_count() or 1) - 1),
                progress=study.progress,
                found=study.found,
            )
            study.say("done", found)
        finally:
            if study is not None and study.state == "running":
                study.say("stopped")
            shutil.rmtree(folder, ignore_errors=True)


class _Study:
    """The placements that one search has tried so far."""

    def __init__(
        self, placement: Placement, ask: LayoutOf, revision: int, say: Say, stop: Stop
    ) -> None:
        self.placement, self.revision = placement, revision
        self.trials: list[PlacementTrial] = []
        self.state: State = "running"
        self._numbers: dict[PlacementTrial, int] = {}
        self._ask, self._say, self._stop = ask, say, stop
        self._seldom, self._at = Seldom(SHOWN_EVERY), ("", 0, 0)

    def progress(self, what: str, done: int, total: int, /) -> None:
        """Take the progress of the search, and stop it if requested.

        Raises
        ------
        Superseded
            The search is asked to stop.
        """
        self._stop.check()
        self._at = what, done, total
        if self._seldom.may():
            self.say("running")

    def found(self, trial: PlacementTrial) -> None:
        """Take a placement that is new or of which more is known."""
        if trial not in self._numbers:
            self._numbers[trial] = len(self.trials)
            self.trials.append(trial)

    def say(self, state: State, end: Layout | None = None) -> None:
        """Send the state of the search."""
        self.state = state
        label, done, total = self._at
        self._say(
            LayoutMessage(
                revision=self.revision,
                goal=self._ask.goal,
                grid=self._ask.grid,
                unit=UNITS[self._ask.goal],
                best=[self._entry(trial) for trial in sorted(self.trials, key=self._rank)[:SHOWN]],
                tried=len(self.trials),
                feasible=sum(trial.result.feasible for trial in self.trials),
                label=label,
                done=done,
                total=total,
                state=state,
                said="" if end is None else _said(end),
            )
        )

    def _rank(self, trial: PlacementTrial) -> tuple[int, float]:
        """Return a sort key: planned placements first, then estimates, then infeasible ones."""
        result, sign = trial.result, 1 if self._ask.goal == "motion" else -1
        if result.infeasibility is not None:
            return 2, -result.infeasibility.progress
        if result.value is not None:
            return 0, sign * result.value
        return 1, 0.0 if result.promise is None else sign * result.promise

    def _entry(self, trial: PlacementTrial) -> TryEntry:
        result = trial.result
        part, rest = self.placement.motions(trial.offsets)
        return TryEntry(
            number=self._numbers[trial],
            offsets=dict(trial.offsets),
            status=result.status,
            stage=result.stage,
            value=result.value,
            bound=result.bound,
            estimate=result.estimate,
            reason=None if result.infeasibility is None else result.infeasibility.reason,
            part=flat(part),
            rest=flat(rest),
        )


def _said(end: Layout) -> str:
    """Return in words what is known of the placements other than the best one."""
    if end.best is None:
        why = end.nearest.result.infeasibility
        return "No placement is feasible" + (f"; the nearest fails: {why.reason}" if why else "")
    if end.proved:
        return "Proved: no other placement that was tried is better."
    count = f"{end.estimated} of the placements that were tried"
    return f"{count} were judged by an estimate alone, which proves nothing."


def _changes(placement: Placement, offsets: Mapping[str, float]) -> list[Change]:
    """Return the changes of the job that apply offsets."""
    return list(changes_of(placement.job, placement.numbers(offsets)))
