"""A dry run before the first cut: the same motions, slower, with nothing switched."""

from __future__ import annotations

from dataclasses import replace

from kerfpath._arrays import scalar
from kerfpath._names import identifiers
from kerfpath.errors import InputError
from kerfpath.post._preflight import LOWEST_SHARE
from kerfpath.post._program import (
    Await,
    Comment,
    JointMove,
    LinearMove,
    Program,
    Request,
    Section,
    Step,
    Wait,
)

__all__ = ["dry_run"]


def dry_run(program: Program, share: float) -> Program:
    """Return the program at a lower speed, without switches, waits and handshakes.

    It stops where the program stops and passes the same targets in the same posture. Its name and
    those of its sections begin with "dry_", so that neither program ever calls a routine of the
    other. Each section begins with a comment.

    Parameters
    ----------
    program : Program
    share : float
        Speed of every move as a share of that in the program, above 0 and at most 1. Joint moves
        keep at least 1 % of the full speed, because languages cannot express less.

    Raises
    ------
    InputError
        `share` is not above 0 and at most 1.
    """
    share = scalar(share, "dry run", above=0.0)
    if share > 1:
        raise InputError(f"dry run: expected a share of the speed of at most 1, got {share:g}")
    said = Comment(f"DRY RUN at {share * 100:g} % of the speed: laser and gas are never switched")
    title, *names = identifiers(
        [f"dry_{program.name}", *(f"dry_{section.name}" for section in program.sections)], ()
    )
    sections = tuple(
        Section(name=name, steps=(said, *_slow_steps(section, share)))
        for name, section in zip(names, program.sections, strict=True)
    )
    return replace(program, name=title, sections=sections)


def _slow_steps(section: Section, share: float) -> list[Step]:
    left_out = Wait | Request | Await
    return [_slow(step, share) for step in section.steps if not isinstance(step, left_out)]


def _slow(step: Step, share: float) -> Step:
    if isinstance(step, LinearMove):
        return replace(step, speed=share * step.speed, duration=step.duration / share, switches=())
    if isinstance(step, JointMove):
        slow = max(share * step.speed, LOWEST_SHARE)
        took = None if step.duration is None else step.duration * step.speed / slow
        return replace(step, speed=slow, duration=took)
    return step
