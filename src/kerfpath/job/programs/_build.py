"""The program of plans: written as text, read back, and audited before anyone gets it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.air import AirMove
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.errors import AuditFailed, InputError
from kerfpath.job.format import ContourTable, ContourTask, Job, ProgramOptions
from kerfpath.job.plan_file import Audited
from kerfpath.job.programs._audit import ProgramAsked
from kerfpath.job.run import Cut
from kerfpath.plans import Plan
from kerfpath.post import build_program, dry_run, language, post_and_read

__all__ = ["asked_of_cuts", "asked_of_plans", "program_of"]

REMEDIES = {
    "acceleration": "lower eta_acceleration in [plan] or raise the spacing of the nodes, and plan "
    "again; with arcs_mm, lower it or leave it out",
    "velocity": "lower eta_velocity in [plan], and plan again",
    "velocity-between": "lower eta_velocity in [plan], and plan again",
    "beam-stop": "write a zone_mm above 0, and cut without stops",
    "lead-time": "write a lead_time_s that the language can count",
    "pierce": "write a pierce_time_s that the language can count",
    "speed": "write a speed that the language can say",
    "tip-between-nodes": "lower arcs_mm, or sample the contour more finely",
    "axis-between-nodes": "leave arcs_mm out, or sample the contour more finely",
}
"""What to set where a check of a written program fails."""
OTHERWISE = "change the job there and plan it again"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Planned(ContourTask):
    """A contour whose nodes are those of its plan."""

    nodes: Contour

    def sample(self, contour: Contour) -> Contour:
        """Return its nodes, whatever the contour."""
        return self.nodes


def asked_of_cuts(job: Job, cuts: Sequence[Cut], cell: Cell | None) -> ProgramAsked:
    """Return what a job asks of the program of its cuts: their paths, nodes and speeds."""
    tasks = [
        _task(cut.task.name, cut.nodes, cut.task.speed) for cut in cuts if cut.plan is not None
    ]
    drawn = [(cut.drawn,) for cut in cuts if cut.plan is not None]
    return ProgramAsked(job=job, tasks=tuple(tasks), candidates=tuple(drawn), cell=cell)


def asked_of_plans(job: Job, plans: Sequence[Plan]) -> ProgramAsked:
    """Return what plans ask of their program, where drawing and cell of the job are not at hand."""
    tasks = []
    for made in plans:
        dt = float(np.diff(made.time).min())  # where the feed dips it is longer
        nodes = replace(made.contour, time=dt * np.arange(len(made.contour), dtype=float))
        tasks.append(_task(made.name, nodes, 0.0))
    drawn = tuple((made.contour,) for made in plans)
    return ProgramAsked(job=job, tasks=tuple(tasks), candidates=drawn, cell=None)


def _task(name: str, nodes: Contour, speed: float) -> ContourTask:
    table = ContourTable(pick=name, speed_m_min=1.0, count=len(nodes))  # not looked at
    return _Planned(pick=name, name=name, speed=speed, nodes=nodes, table=table)


def program_of(
    plans: Sequence[Plan],
    options: ProgramOptions,
    moves: Sequence[AirMove] = (),
    *,
    asked: ProgramAsked,
    strict: bool = False,
    dry_share: float | None = None,
) -> tuple[dict[str, str], list[str]]:
    """Return the files of the program that cuts `plans`, and the warnings of its preflight.

    Between them the robot moves as `moves` say; without any, straight to each. With `dry_share` it
    is a dry run at that share of the speed. The text is read back and audited as `kerfpath audit`
    would; of a dry run, that of the program at full speed.

    The caller answers for the audit of the plans.

    Raises
    ------
    AuditFailed
        There is no plan, or the program does not pass its audit: the first reason, and what to do.
    InputError
        The preflight refuses.
    """
    if not plans:
        raise AuditFailed("no program: there is no plan to write one from")
    chosen = language(options.language)
    if refusal := chosen.refusal(plans[0].robot):
        raise InputError(f"no program: {refusal}")
    program = build_program(
        plans,
        moves=moves,
        name=options.name,
        retract=options.retract,
        zone=options.zone,
        lead_time=options.lead_time,
        pierce_time=options.pierce_time,
        approach_speed=options.approach_speed,
        air_speed=options.air_speed,
        gas_lead=options.gas_lead,
        arc_tolerance=options.arc_tolerance,
        handshakes=options.handshakes,
    )
    written = post_and_read(program, options.language, options.settings, strict=strict)
    if written.read is not None:
        asked = replace(asked, job=replace(asked.job, program=options))
        settings = chosen.completed(options.settings)
        found = asked.audit(written.read, chosen, settings, next(iter(written.files)))
        _require_passed(found, chosen.title)
    if dry_share is not None:
        dry = dry_run(program, dry_share)
        written = post_and_read(dry, options.language, options.settings, strict=strict)
    return written.files, [str(issue) for issue in written.warnings]


def _require_passed(found: Audited, title: str) -> None:
    """Raise AuditFailed where a program fails: the first reason, how many more, and what to do."""
    failed = [
        (name, check)
        for name, table in found.tables.items()
        for check in table
        if not check.ok and check.level == "error"
    ]
    if failed:
        name, check = failed[0]
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        raise AuditFailed(
            f"no program: as {title} says it, {name} fails its audit at {found.place(name, check)}:"
            f" {check.issue().message}{more}; {REMEDIES.get(check.code, OTHERWISE)}"
        )
    if found.missing:
        raise AuditFailed(f"no program: as {title} says it, {found.missing[0]} is not cut")
