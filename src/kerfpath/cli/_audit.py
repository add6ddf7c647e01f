"""`kerfpath audit`: every check of every contour of a plan, made again."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from kerfpath.auditor import in_words
from kerfpath.cli._show import out, print_json, table
from kerfpath.job import audit_file

__all__ = ["show_audit"]


def show_audit(plan_file: Path, job: Path | None, *, as_json: bool) -> bool:
    """Print the audit's table of each contour of a plan; return whether all of them pass."""
    found = audit_file(plan_file, job)
    if as_json:
        print_json(
            {
                "passed": found.passed,
                "notes": [found.note],
                "missing": list(found.missing),
                "contours": {
                    name: [asdict(c) | {"ok": c.ok} for c in checks]
                    for name, checks in found.tables.items()
                },
            }
        )
    else:
        for name, checks in found.tables.items():
            rows = [
                [
                    escape(c.title),
                    in_words(c.value, c.unit),
                    in_words(c.limit, c.unit),
                    str(c.node),
                    "ok" if c.ok else c.level.upper(),
                ]
                for c in checks
            ]
            table(
                ["check", "worst", "allowed", "node", ""],
                rows,
                title=escape(name),
                numbers=["worst", "allowed", "node"],
            )
        for name in found.missing:
            out.print(f"{escape(name)}: no plan")
        out.print(f"note: {escape(found.note)}")
        out.print("audit passed" if found.passed else "audit FAILED")
    return found.passed
