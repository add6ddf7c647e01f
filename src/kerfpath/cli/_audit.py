"""`kerfpath audit`: check every contour of a plan or a program again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from kerfpath.auditor import format_value
from kerfpath.cli._show import busy, out, print_json, table
from kerfpath.errors import InputError, about
from kerfpath.job import AuditReport, audit_file, audit_program

__all__ = ["show_audit"]


def show_audit(file: Path, job: Path | None, *, as_json: bool) -> bool:
    """Print the table of checks of each contour of a file; return whether all of them pass."""
    found = _run_audit(file, job)
    if as_json:
        print_json(
            {
                "passed": found.passed,
                "notes": [found.note],
                "missing": list(found.missing),
                "contours": {
                    name: [asdict(c) | {"ok": c.ok, "place": found.place(name, c)} for c in checks]
                    for name, checks in found.tables.items()
                },
            }
        )
    else:
        for name, checks in found.tables.items():
            if found.places and all(c.ok for c in checks):
                out.print(f"{escape(name)}: {len(checks)} checks passed")
                continue
            rows = [
                [
                    escape(c.title),
                    format_value(c.value, c.unit),
                    format_value(c.limit, c.unit),
                    str(c.node),
                    "ok" if c.ok else c.level.upper(),
                ]
                for c in checks
            ]
            table(
                ["check", "worst", "allowed", "node", "verdict"],
                rows,
                title=escape(name),
                numbers=["worst", "allowed", "node"],
                whole=["verdict"],
            )
            for c in checks:
                if not c.ok:
                    said = f"{name}: {c.issue()}"
                    if name in found.places:
                        said = found.sentence(name, c)
                    out.print(escape(said), soft_wrap=True)
        for name in found.missing:
            out.print(f"{escape(name)}: {'not cut' if found.places else 'no plan'}")
        out.print(f"note: {escape(found.note)}")
        out.print("audit passed" if found.passed else "audit FAILED")
    return found.passed


def _run_audit(file: Path, job: Path | None) -> AuditReport:
    if file.suffix.lower() == ".json":
        with about(file):
            return audit_file(file, job)
    if job is None:
        raise InputError(f"{file}: a program is compared with its job; give it with --job JOB.toml")
    with about(file), busy("auditing the program"):
        return audit_program(file, job)
