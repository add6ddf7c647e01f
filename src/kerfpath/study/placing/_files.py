"""Write the results of the layout study: layout.json, layout.html and the moved job placed.toml."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import cast

from kerfpath import __version__
from kerfpath.job import make_folder
from kerfpath.post import write_files
from kerfpath.report import LayoutEntry, render_layout
from kerfpath.study.placing._layout import Layout
from kerfpath.study.placing._place import placed_text
from kerfpath.study.placing._search import PlacementTrial
from kerfpath.study.placing._value import PlacementValue

__all__ = ["UNITS", "layout_entry", "write_layout"]

SCHEMA = 2
"""Version of the format of layout.json."""
UNITS = {"speed": "m/min", "margin": "times the speed asked for", "motion": ""}
OF_CONTOUR = ("value", "at_least", "fastest_m_min", "joint", "limit", "node")
WHY = ("reason", "contour", "node", "nodes", "progress")


def layout_entry(found: Layout) -> LayoutEntry:
    """Return the content of layout.json as plain data, which is the same for the same seed."""
    best, before = found.best, found.before
    entry = {
        "schema": SCHEMA,
        "kerfpath": __version__,
        "job": found.job.path.name,
        "goal": found.goal,
        "off_grid": found.off_grid,
        "unit": UNITS[found.goal],
        "ranges": {name: list(span) for name, span in found.ranges.items()},
        "default_ranges": found.by_default,
        "standing": list(found.job.layout.standing),
        "tolerance": dict(found.tolerance),
        "seed": found.seed,
        "evaluations": found.evaluations,
        "feasible": best is not None,
        "shipped": before.entry("status", "value", *WHY),
        "best": None if best is None else _best(found, best),
        "contours": _contours(before, found.after),
        "proved": found.proved,
        "open_bound": found.open_bound,
        "statuses": found.statuses,
        "stages": found.stages,
        "exact_searches": found.solved,
        "estimated": found.estimated,
        "estimate_error": None if found.estimate_error is None else list(found.estimate_error),
        "reasons": _reasons(found),
        "nearest": None if best is not None else _trial(found.nearest),
        "evolved": found.evolved,
        "tried": [_trial(trial) for trial in found.tried],
        "map": _map(found),
    }
    return cast(LayoutEntry, entry)


def _best(found: Layout, best: PlacementTrial) -> dict[str, object]:
    value, shipped = best.result.value, found.before.value
    gain = None
    if shipped is not None and value is not None:
        gain = shipped / value - 1 if found.goal == "motion" else value / shipped - 1
    cell = found.job.cell
    names = {
        "fixture": [] if cell is None else [fixture.name for fixture in cell.fixture],
        "external": [axis.name for axis in found.job.robot.externals],
    }
    numbers = {
        ".".join(
            names[str(before)][step] if isinstance(step, int) else step
            for before, step in zip(("", *where), where, strict=False)
        ): value
        for where, value in found.numbers.items()
    }
    return {"offsets": dict(best.offsets), "value": value, "gain": gain, "numbers": numbers}


def _contours(before: PlacementValue, after: PlacementValue | None) -> list[dict[str, object]]:
    """Return the value of each contour in the job's placement and in the best one."""
    sides = [
        {
            contour.name: {k: v for k in OF_CONTOUR if (v := getattr(contour, k)) is not None}
            for contour in (() if side is None else side.contours)
        }
        for side in (before, after)
    ]
    names = dict.fromkeys([*sides[0], *sides[1]])
    return [{"name": n, "before": sides[0].get(n), "after": sides[1].get(n)} for n in names]


def _trial(trial: PlacementTrial) -> dict[str, object]:
    known = trial.result.entry("status", "stage", "bound", "value", "estimate", *WHY)
    return {"offsets": dict(trial.offsets), **known}


def _reasons(found: Layout) -> list[dict[str, object]]:
    """Return why placements are infeasible, by contour, the most common first."""
    every = [why for trial in found.tried if (why := trial.result.infeasibility)]
    reasons: list[dict[str, object]] = []
    for (status, contour), number in Counter((w.status, w.contour) for w in every).most_common():
        same = [why for why in every if (why.status, why.contour) == (status, contour)]
        nodes = Counter(why.node for why in same).most_common(1)
        reasons.append(
            {
                "status": status,
                "contour": contour,
                "count": number,
                "node": nodes[0][0],
                "reason": Counter(why.reason for why in same).most_common(1)[0][0],
            }
        )
    return reasons


def _map(found: Layout) -> dict[str, object] | None:
    if found.map is None:
        return None
    return {
        "variables": list(found.ranges)[:2],
        "x": found.map.x.tolist(),
        "y": found.map.y.tolist(),
        "cells": [
            each.result.entry("status", "bound", "value", "estimate", "reason", "contour", "node")
            for each in found.map.trials
        ],
    }


def write_layout(found: Layout, folder: Path) -> list[Path]:
    """Write layout.json and layout.html, and placed.toml if a placement is feasible.

    Raises
    ------
    InputError
        The folder cannot be created or written to.
    """
    make_folder(folder)
    entry = layout_entry(found)
    files = {
        "layout.json": json.dumps(entry, indent=1, allow_nan=False) + "\n",
        "layout.html": render_layout(entry, job_text=found.job.path.read_text("utf-8-sig")),
    }
    if found.best is not None:
        files["placed.toml"] = placed_text(
            found.job, found.numbers, folder.resolve(), _remark(found.job.path, found.best.offsets)
        )
    return write_files(folder, files)


def _remark(job: Path, offsets: Mapping[str, float]) -> str:
    moves = ", ".join(f"{name} = {value:g}" for name, value in offsets.items())
    return f"{job.name} as placed by kerfpath layout: {moves}. Ranges now count from here."
