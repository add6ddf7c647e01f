"""Hash keys of the inputs of each step of planning: equal keys allow results to be used again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from kerfpath._arrays import Array
from kerfpath.contour import Contour
from kerfpath.job import CutRequest, Job

__all__ = ["PROVING", "cut_key", "graph_key", "motion_key", "part_key", "setup_key"]

PROVING = frozenset(("certify", "certify_gap_percent", "certify_seconds", "certificate"))
"""Keys of [plan] that only concern the proof for a motion that has been found."""
LIGHT = PROVING | {
    "weights", "eta_velocity", "eta_acceleration", "metric", "objective", "method", "feed",
    "refine", "interruptions", "least_piece_mm",
}  # fmt: skip
"""Keys of [plan] that change neither the nodes nor the layered graph."""
PINS = "gamma_windows"
"""Key of [[contour]] that changes neither the nodes nor their speed."""
GRAPH = frozenset(["gamma_step_deg", "frames", "tilt_deg", "tilt_steps", "posture"])
"""Keys of [plan] that the layered graph depends on."""


def part_key(job: Job) -> str:
    """Return the key of the content of a job's drawing."""
    read = {k: v for k, v in job.source["part"].items() if k not in ("xyz_mm", "rpy_deg")}
    return _digest(read, _stamp(job.part_file))


def setup_key(job: Job) -> str:
    """Return the key of the inputs of a prepared job: everything except `LIGHT` keys and pins."""
    source = dict(job.source)
    source["plan"] = _but(source.get("plan", {}), LIGHT)
    source["contour"] = [_but(table, (PINS,)) for table in source["contour"]]
    return _digest(source, _stamps(job))


def motion_key(job: Job) -> str:
    """Return the key that a motion must share with the previous one to start from it."""
    source = dict(job.source)
    source["plan"] = _but(source.get("plan", {}), LIGHT)
    # If nodes are spaced by time, another speed gives other nodes.
    source["contour"] = [
        _but(table, (PINS,) if "time_step_ms" in table else (PINS, "speed_m_min"))
        for table in source["contour"]
    ]
    for name in ("sequence", "layout", "program", "audit"):
        source.pop(name, None)
    return _digest(source, _stamps(job))


def graph_key(job: Job, nodes: Contour, external: Array | None = None) -> str:
    """Return the key of the layered graph of `nodes`; `external` is as in `Job.graph`."""
    source, options = job.source, job.options
    plan = {k: v for k, v in source.get("plan", {}).items() if k in GRAPH}
    if job.robot.externals and external is None:  # the course of the axes depends on all of [plan]
        plan = _but(source.get("plan", {}), PROVING)
    tables = [source.get(name) for name in ("robot", "tool", "comfort")]
    arrays = [nodes.points, nodes.axes, nodes.s, job.placement]
    arrays += [array for array in (nodes.x, external) if array is not None]
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(array.tobytes())
    windows = [each.to_data() for each in options.gamma_windows]
    kept = [plan, tables, nodes.closed, options.retract, options.floor, windows]
    return _digest(kept, digest.hexdigest(), _stamps(job))


def cut_key(job: Job, request: CutRequest) -> str:
    """Return the key of the result of a contour, without the bound of its plan."""
    source = dict(job.source)
    for name in ("contour", "sequence", "layout", "program"):
        source.pop(name, None)
    source["plan"] = _but(source.get("plan", {}), PROVING)
    # A table that picks several loops makes one request for each of them, by its name.
    own = [request.task.name, request.task.pick, request.task.table.model_dump(mode="json")]
    return _digest(source, own, job.options.retract, _stamps(job))


def _stamps(job: Job) -> list[object]:
    """Return name, time and size of the files that a job names, to notice their changes."""
    folder, source = job.path.parent, job.source
    cell = source.get("cell", {})
    named = [source["robot"].get(key) for key in ("urdf", "srdf")]
    named += [cell.get("head", {}).get("file")]
    named += [fixture.get("file") for fixture in cell.get("fixture", [])]
    return [_stamp(job.part_file), *(_stamp(folder / name) for name in named if name)]


def _stamp(path: Path) -> list[object]:
    try:
        found = path.stat()
    except OSError:
        return [str(path)]
    return [str(path), found.st_mtime_ns, found.st_size]


def _but(table: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    return {k: v for k, v in table.items() if k not in keys}


def _digest(*parts: object) -> str:
    text = json.dumps(parts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()
