"""Differences of controllers from the plan: switches only at stops, other postures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from kerfpath.post._issue import ProgramIssue
from kerfpath.post._program import LinearMove, Program, Section

__all__ = ["stop_to_switch", "warn_of_changed_postures", "warn_of_late_switches"]


def stop_to_switch(program: Program, settings: object = None) -> Program:
    """Return the program with a stop at each switch, and without lead times."""

    def stop(move: LinearMove) -> LinearMove:
        switches = tuple(replace(switch, lead_time=0.0) for switch in move.switches)
        return replace(move, switches=switches, zone=0.0)

    sections = tuple(
        replace(
            section,
            steps=tuple(
                stop(s) if isinstance(s, LinearMove) and s.switches else s for s in section.steps
            ),
        )
        for section in program.sections
    )
    return replace(program, sections=sections)


def warn_of_changed_postures(
    section: Section, words: Sequence[tuple[int | str, ...]]
) -> Iterator[ProgramIssue]:
    """Warn of straight moves that change the configuration; `words` has that of each target."""
    for k, move in enumerate(section.moves):
        if k > 0 and isinstance(move, LinearMove) and words[k] != words[k - 1]:
            before, after = (" ".join(map(str, words[i])) for i in (k - 1, k))
            message = f"the configuration changes from {before} to {after} in a straight move"
            place = f"{section.name}, move {k}"
            yield ProgramIssue(
                "warning", "posture-change", f"{message}, which the controller may refuse", place
            )


def warn_of_late_switches(section: Section, title: str) -> Iterator[ProgramIssue]:
    """Warn of switches that come later than planned, and of stops that they need."""
    moves = [m for m in section.moves if isinstance(m, LinearMove) and m.switches]
    leads = [switch.lead_time for m in moves for switch in m.switches if switch.lead_time > 0]
    if leads:
        yield ProgramIssue(
            "warning",
            "lead-time",
            f"{len(leads)} switches are planned up to {max(leads) * 1e3:g} ms ahead, but {title} "
            "switches only after the tip has stopped; measure the delay, and set no lead time",
            section.name,
        )
    if flying := sum(move.zone > 0 for move in moves):
        yield ProgramIssue(
            "warning",
            "stop-to-switch",
            f"the robot will stop at {flying} places to switch there, as at each micro joint, "
            f"because {title} switches only while it is stopped",
            section.name,
        )
