"""Run benchmarks and print their tables: ``python -m benchmarks [NAME ...]``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from benchmarks._figures import Report, machine, markdown, show

RESULTS = Path(__file__).parent / "RESULTS.md"
NAMES = (
    "kinematics",
    "demo",
    "search",
    "invariance",
    "feed_reduction",
    "scale",
    "retiming",
    "contours",
    "refinement",
    "collision",
    "cad",
    "corpus",
    "bent_parts",
    "large_drawings",
    "nests",
    "mutants",
    "first_runs",
    "kerf",
    "part",
    "whole_parts",
    "programs",
    "program_edits",
    "program_characters",
    "handshakes",
    "plan_edits",
    "pareto",
    "sweeps",
    "layout",
    "continuum",
    "continuum_random",
    "continuum_bounds",
    "continuum_infeasible",
    "execution",
    "acceleration_table",
    "external",
    "seven_axes",
    "torque",
    "certificate_audits",
    "studio",
    "studio-endurance",
    "compas",
)


def main() -> None:
    """Read the arguments, run the benchmarks named, print them, and write them if asked."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}; all")
    parser.add_argument("--quick", action="store_true", help="small problems, few runs: a try")
    parser.add_argument(
        "--write", action="store_true", help=f"write into {RESULTS.name} beside this"
    )
    parser.add_argument("--date", default="", help="date that the written file bears")
    parser.add_argument("--note", default="", help="what else to say of the run, as its commit")
    parts = parser.add_argument_group("parts of invariance and feed_reduction")
    parts.add_argument("--tasks", type=int, help="number of tasks")
    parts.add_argument("--first", type=int, default=0, help="seed of the first one")
    parts.add_argument("--rows", type=Path, help="file to which the results of tasks are added")
    given = parser.parse_args()
    if unknown := set(given.names) - set(NAMES):
        parser.error(f"unknown benchmark {', '.join(sorted(unknown))}; known: {', '.join(NAMES)}")
    facts, reports = machine(), list[Report]()
    if given.note:
        facts["note"] = given.note
    console = Console() if sys.stdout.isatty() else Console(width=140)
    for name, value in facts.items():
        console.print(f"{name}: {value}", highlight=False)
    for name in NAMES:
        if given.names and name not in given.names:
            continue
        with console.status(name):
            made = _run(name, given)
        for report in made:
            show(report, console)
        reports += made
    if given.write:
        before = RESULTS.read_text(encoding="utf-8") if RESULTS.exists() else ""
        RESULTS.write_text(markdown(reports, facts, given.date, before), encoding="utf-8")
        console.print(f"wrote {RESULTS}")


def _run(name: str, given: argparse.Namespace) -> list[Report]:
    """Import a benchmark and run it; each imports libraries that the others do not need."""
    quick: bool = given.quick
    if name == "invariance":
        from benchmarks import invariance

        return [invariance.run(quick=quick, tasks=given.tasks, first=given.first, rows=given.rows)]
    if name == "feed_reduction":
        from benchmarks import feed_reduction

        return [
            feed_reduction.run(quick=quick, tasks=given.tasks, first=given.first, rows=given.rows)
        ]
    if name == "kinematics":
        from benchmarks import _enclosures, _families, kinematics

        modules = (kinematics, _families, _enclosures)
        return [module.run(quick=quick) for module in modules]
    if name == "seven_axes":
        from benchmarks import seven_axes

        return seven_axes.run(quick=quick)
    if name == "compas":
        from benchmarks import compas

        return compas.run(quick=quick)
    if name == "first_runs":
        from benchmarks import first_runs

        return [first_runs.run(quick=quick)]
    if name == "corpus":
        from benchmarks import corpus

        return [corpus.run(quick=quick)]
    if name == "bent_parts":
        from benchmarks import bent_parts

        return [bent_parts.run(quick=quick)]
    if name == "large_drawings":
        from benchmarks import large_drawings

        return [large_drawings.run(quick=quick)]
    if name == "nests":
        from benchmarks import nests

        return [nests.run(quick=quick)]
    if name == "mutants":
        from benchmarks import mutants

        return [mutants.run(quick=quick)]
    if name == "external":
        from benchmarks import external

        return external.run(quick=quick)
    if name == "execution":
        from benchmarks import execution

        return execution.run(quick=quick)
    if name == "acceleration_table":
        from benchmarks import acceleration_table

        return acceleration_table.run(quick=quick)
    if name == "torque":
        from benchmarks import torque

        return torque.run(quick=quick)
    if name == "kerf":
        from benchmarks import kerf

        return [kerf.run(quick=quick)]
    if name == "programs":
        from benchmarks import programs

        return [programs.run(quick=quick)]
    if name == "program_edits":
        from benchmarks import program_edits

        return [program_edits.run(quick=quick)]
    if name == "program_characters":
        from benchmarks import program_edits

        return [program_edits.run_characters(quick=quick)]
    if name == "handshakes":
        from benchmarks import handshakes

        return [handshakes.run(quick=quick)]
    if name == "plan_edits":
        from benchmarks import plan_edits

        return [plan_edits.run(quick=quick)]
    if name == "pareto":
        from benchmarks import pareto

        return pareto.run(quick=quick)
    if name == "layout":
        from benchmarks import layout

        return [layout.run(quick=quick)]
    if name == "sweeps":
        from benchmarks import sweeps

        return [sweeps.run(quick=quick)]
    if name == "demo":
        from benchmarks import demo

        return [demo.run(quick=quick)]
    if name == "scale":
        from benchmarks import scale

        return scale.run(quick=quick)
    if name == "retiming":
        from benchmarks import retiming

        return retiming.run(quick=quick)
    if name == "contours":
        from benchmarks import contours

        return contours.run(quick=quick)
    if name == "refinement":
        from benchmarks import refinement

        return refinement.run(quick=quick)
    if name == "continuum":
        from benchmarks import continuum

        return continuum.run(quick=quick)
    if name == "continuum_random":
        from benchmarks import continuum_random

        return continuum_random.run(quick=quick)
    if name == "continuum_bounds":
        from benchmarks import continuum_bounds

        return continuum_bounds.run(quick=quick)
    if name == "continuum_infeasible":
        from benchmarks import continuum_infeasible

        return continuum_infeasible.run(quick=quick)
    if name == "certificate_audits":
        from benchmarks import certificate_audits

        return certificate_audits.run(quick=quick)
    if name == "collision":
        from benchmarks import collision

        return collision.run(quick=quick)
    if name == "cad":
        from benchmarks import cad

        return [cad.run(quick=quick)]
    if name == "studio-endurance":
        from benchmarks import studio_endurance

        return [studio_endurance.run(quick=quick)]
    if name == "studio":
        from benchmarks import studio

        return [studio.run(quick=quick)]
    if name == "whole_parts":
        from benchmarks import whole_parts

        return whole_parts.run(quick=quick)
    if name == "part":
        from benchmarks import part

        return part.run(quick=quick)
    from benchmarks import search

    return search.run(quick=quick)


if __name__ == "__main__":
    main()
