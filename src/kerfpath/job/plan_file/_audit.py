"""Audit a plan.json against its job, or by itself if no job is given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from kerfpath import __version__
from kerfpath._repr import short_repr
from kerfpath.auditor import BOUND, Check, transfer_checks, worst_of
from kerfpath.job.as_run import as_run
from kerfpath.job.format import AuditTable, PreparedJob, prepare, read_job, tolerances_of
from kerfpath.job.plan_file._checks import check, count
from kerfpath.job.plan_file._compare import compare_jobs, compare_values
from kerfpath.job.plan_file._expected import ExpectedPlan, expect_plans
from kerfpath.job.plan_file._layout import NodesData, PlanData
from kerfpath.job.plan_file._moves import check_moves, expect_sequence
from kerfpath.job.plan_file._order_checks import check_sequence
from kerfpath.job.plan_file._read import PlanFile, read_plan_file, table_of
from kerfpath.job.plan_file._recompute import SAME, recompute
from kerfpath.job.plan_file._report import AuditReport, collision_note
from kerfpath.job.plan_file._write import plan_document, plan_entry
from kerfpath.options import EXACT_OR_BETTER
from kerfpath.plans import Plan

__all__ = ["PlanAudit", "audit_file"]

JOB, FILE = "those of the job and the joints", "those of the joints"
OWN_NODES = ("gamma_rad", "lead_lean_rad", "posture", "turn")
"""Columns of nodes that follow from the joints."""
AIR = "air"
"""Name of the table of the moves."""


def audit_file(plan_file: Path, job_file: Path | None = None) -> AuditReport:
    """Audit every contour of a plan.json.

    With a job, only the job defines what is required and allowed; values that the plan repeats, or
    that follow from its joints, must agree. Without one, limits, tool, placement and speed are
    those of the plan, and only values that follow from its joints are compared.

    Parameters
    ----------
    plan_file : Path
    job_file : Path, optional

    Raises
    ------
    InputError
        A file cannot be read.
    """
    if job_file is not None:
        return PlanAudit.of(job_file).audited(plan_file)
    return _by_itself(read_plan_file(plan_file))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlanAudit:
    """The audit of plan.json files of one job, whose drawing and cell are read once.

    Parameters
    ----------
    prepared : PreparedJob
    """

    prepared: PreparedJob

    __repr__ = short_repr

    @classmethod
    def of(cls, job_file: Path) -> PlanAudit:
        """Return the audit of a job's plans.

        Raises
        ------
        InputError
            The job, its drawing or its cell cannot be read.
        """
        return cls(prepared=prepare(read_job(job_file)))

    def audited(self, plan_file: Path) -> AuditReport:
        """Audit every contour of a plan.json against the job.

        Raises
        ------
        InputError
            The file cannot be read.
        """
        prepared, file = self.prepared, read_plan_file(plan_file)
        job, cell, entries = prepared.job, prepared.cell, file.entries
        expected, rows = expect_plans(prepared, file)
        tables: dict[str, list[Check]] = {file.path.name: rows}
        judged: list[PlanData] = []
        for each in expected:
            table = tables.setdefault(each.name, [])
            table += each.checks
            if each.plan is None:
                continue
            made = job.tolerances.checks(each.plan, reference=each.path, cell=cell)
            made += each.drawing
            table += as_run(job, each.plan, each.path or each.plan.contour).checks
            entry = _entry(each.plan, entries[each.name], made, file)
            judged.append(entry)
            table += made
            table += _claims(each.plan)
            table += compare_values(entry, entries[each.name], JOB)
        rows += compare_jobs(job, file.job)
        paths = [p.contour for p in file.plans]
        rows += check_sequence(prepared, [each.number for each in expected], paths)
        rows += self._whole(file, judged, expected)
        plans = [each.plan for each in expected if each.plan is not None]
        if len(plans) == len(expected) and plans:
            tables.setdefault(AIR, []).extend(check_moves(prepared, plans, file.moves))
        note = collision_note(cell, moves_too=job.sequence is not None)
        return AuditReport(
            tables={name: table for name, table in tables.items() if table},
            missing=file.missing,
            note=f"{note} {_list_claims(file, tables)}".strip(),
        )

    def _whole(
        self, file: PlanFile, judged: Sequence[PlanData], expected: Sequence[ExpectedPlan]
    ) -> list[Check]:
        """Compare the parts of the file beside its contours: robot, limits, cell, sequence."""
        prepared, job, data = self.prepared, self.prepared.job, file.data
        plans = [each.plan for each in expected if each.plan is not None]
        part = None
        if job.sequence is not None and data["sequence"] is not None and plans:
            part = expect_sequence(prepared, plans, file.moves, data["sequence"]["at_least_s"])
        own: Mapping[str, object] = data
        whole: Mapping[str, object] = plan_document(
            job.robot, job.tool, job.placement, judged, {}, prepared.cell, part
        )
        rows = []
        for key in whole.keys() - {"job", "contours", "kerfpath", "schema"}:
            if key == "sequence" and len(plans) < len(expected):
                continue  # a contour is refused already, and its times are not known
            rows += [row for row in compare_values(whole[key], own[key], JOB, (key,)) if not row.ok]
        if job.sequence is not None and data["sequence"] is None:
            rows.append(count("moves", "missing moves between contours", 1))
        return rows or compare_values({}, {}, JOB)


def _entry(plan: Plan, said: PlanData, made: Sequence[Check], file: PlanFile) -> PlanData:
    """Return the plan.json entry that a contour should have, with the record of its audit.

    The record of another version of kerfpath is not compared.
    """
    name = said["contour"]
    picked, shown = plan.name in file.picked, "certificate" in said
    entry = plan_entry(plan, name, made, picked=picked, certificate=shown)
    if file.data["kerfpath"] != __version__:
        entry["audit"]["checks"] = said["audit"]["checks"]
    return entry


def _claims(plan: Plan) -> list[Check]:
    """Check the claims about other motions, as far as they can be checked."""
    before, rows = plan.proof.grid_cost, []
    if before is not None:
        title = "cost above that of the path it was refined from"
        rows.append(check("grid-cost", title, plan.cost - before * (1 + SAME), SAME, "count"))
    if plan.settings.method not in EXACT_OR_BETTER:
        title = "claims of optimality that its method cannot prove"
        rows.append(count("optimal", title, plan.proof.optimal))
    return rows


def _list_claims(file: PlanFile, tables: Mapping[str, Sequence[Check]]) -> str:
    """Return the note on the bounds that are proved again, and on claims that are not verified."""
    proved = [
        name for name, table in tables.items() if any(c.code == BOUND and c.ok for c in table)
    ]
    said = [f"Proved again: the bound of {', '.join(proved)}."] if proved else []
    best = [p.name for p in file.plans if p.proof.optimal]
    claims = [f"that {', '.join(best)} is best of its grid"] if best else []
    bounded = [
        p.name for p in file.plans if p.proof.bound is not None and p.proof.certificate is None
    ]
    claims += [f"the bound of {', '.join(bounded)}"] if bounded else []
    if file.data["sequence"] is not None and file.data["sequence"]["optimal"]:
        claims.append("that no order takes less")
    if claims:
        said.append(f"Claimed, not verified: {' and '.join(claims)}.")
    if any(p.name in bounded and p.settings.objective == "sum" for p in file.plans):
        said.append("With certificate = true in [plan], plan.json keeps the proof of a bound.")
    return " ".join(said)


def _by_itself(file: PlanFile) -> AuditReport:
    """Audit a plan.json without its job."""
    tolerances = table_of(file, "audit", AuditTable, tolerances_of)
    tables = {}
    for p in file.plans:
        own, said = recompute(p), file.entries[p.name]
        made = tolerances.checks(own)
        entry = _entry(own, said, made, file)
        follow = {key: value for key, value in entry["nodes"].items() if key in OWN_NODES}
        entry["audit"], entry["nodes"] = said["audit"], cast(NodesData, said["nodes"] | follow)
        tables[p.name] = [*made, *_claims(own), *compare_values(entry, said, FILE)]
    if not file.plans and not file.missing:
        tables[file.path.name] = [count("contours", "missing plans: the file has none", 1)]
    if file.moves and file.plans:
        robot = file.plans[0].robot
        tables[AIR] = worst_of(transfer_checks(robot, m.q, m.time) for m in file.moves)
    note = (
        "Limits, tool, placement and speed were taken from the plan itself; give its job with "
        "--job to audit against the job."
    )
    collisions = (
        "The plan was made free of collisions in a cell, which was not checked again: give its "
        "job with --job."
        if file.in_cell
        else collision_note(None)
    )
    note = f"{note} {collisions} {_list_claims(file, tables)}".strip()
    return AuditReport(tables=tables, missing=file.missing, note=note)
