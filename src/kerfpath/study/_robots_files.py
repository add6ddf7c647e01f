"""Write the results of `which_robots` to robots.json and robots.html."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from kerfpath import __version__
from kerfpath.errors import InputError
from kerfpath.job import read_job
from kerfpath.planner import FINER
from kerfpath.post import write_files
from kerfpath.report import render_table
from kerfpath.study._robots import ContourSpeed, RobotSpeed

__all__ = [
    "ROBOT_COLUMNS",
    "ROBOT_NOTES",
    "ROBOT_WORDS",
    "robot_rows",
    "robots_entry",
    "write_robots",
]

ROBOT_COLUMNS = (
    ("Robot", ""),
    ("Payload", "kg"),
    ("Reach", "mm"),
    ("Margin", ""),
    ("Fastest", "m/min"),
    ("Accelerations", ""),
    ("Limiting contour, or reason", ""),
)
"""Head and unit of each column of the table of robots."""
ROBOT_WORDS = (0, 5, 6)
"""Columns of that table that hold text."""
ROBOT_NOTES = (
    "Margin: the fastest constant speed divided by the speed asked for, of the contour where this "
    "ratio is least. Speeds are exact on the job's grid (and along one course of external axes, "
    f"where the job has them). From a margin of 1 on the robot does the job as asked; {FINER}.",
    "Robot base, head and part stay where the job has them. The payload is listed but not checked, "
    "because the job does not state the weight of the head.",
)
"""Notes below the table of robots."""


def robots_entry(found: Sequence[RobotSpeed]) -> list[dict[str, object]]:
    """Return the results as plain data, with units in the names."""
    return [_entry(each) for each in found]


def _entry(each: RobotSpeed) -> dict[str, object]:
    binding, arm = each.binding, each.robot
    return {
        "robot": arm.id,
        "model": f"{arm.manufacturer} {arm.model}".strip(),
        "own": each.own,
        "payload_kg": arm.payload,
        "reach_m": arm.reach,
        "acceleration": arm.acceleration_source or None,
        "margin": binding and binding.margin,
        "binding_contour": binding and binding.name,
        "slowest_m_min": _slowest(each),
        "reached": each.reached if each.contours else None,
        "reason": each.reason or None,
        "contours": [_contour_entry(contour) for contour in each.contours],
    }


def _contour_entry(contour: ContourSpeed) -> dict[str, object]:
    return {
        "name": contour.name,
        "asked_m_min": contour.asked * 60,
        "reached": contour.reached,
        "fastest_m_min": None if contour.fastest is None else contour.fastest * 60,
        "margin": contour.margin,
        "joint": contour.joint,
        "limit": contour.limit,
        "reason": contour.reason or None,
    }


def _slowest(each: RobotSpeed) -> float | None:
    speeds = [contour.fastest for contour in each.contours if contour.fastest is not None]
    return min(speeds) * 60 if each.binding else None


def write_robots(
    job_file: str | Path,
    found: Sequence[RobotSpeed],
    folder: str | os.PathLike[str],
) -> list[Path]:
    """Write robots.json and robots.html into an existing folder.

    Raises
    ------
    InputError
        As `read_job`; also where there are no robots, or a file cannot be written.
    """
    job = read_job(job_file)
    whole = {"version": __version__, "job": job.source, "robots": robots_entry(found)}
    if not found:
        raise InputError("no robots to write: the list of results is empty")
    able = sum(each.binding is not None for each in found)
    page = render_table(
        f"Robots for {job.part_file.stem.replace('_', ' ')}",
        kind="Which robot",
        heads=ROBOT_COLUMNS,
        rows=robot_rows(found),
        text_columns=ROBOT_WORDS,
        caption=f"{able} of {len(found)} robots can cut every contour.",
        facts=[("Job", job.path.name), ("Part", job.part_file.name)],
        notes=ROBOT_NOTES,
        job_text=job.path.read_text(encoding="utf-8-sig"),
    )
    texts = {"robots.json": json.dumps(whole, indent=1, allow_nan=False), "robots.html": page}
    return write_files(folder, texts)


def robot_rows(found: Sequence[RobotSpeed]) -> list[list[str]]:
    """Return a row for each robot, with the columns of `ROBOT_COLUMNS`."""
    return [_row(each) for each in found]


def _row(each: RobotSpeed) -> list[str]:
    arm, binding = each.robot, each.binding
    row = [
        f"{arm.id} (the job's own)" if each.own else arm.id,
        "-" if arm.payload is None else f"{arm.payload:g}",
        "-" if arm.reach is None else f"{arm.reach * 1000:.0f}",
    ]
    if binding is None or binding.margin is None or binding.fastest is None:
        return [*row, "-", "-", "-", each.reason]
    source = arm.acceleration_source
    return [
        *row,
        f"{binding.margin:.3f}",
        f"{binding.fastest * 60:.3f}",
        source.removesuffix(" times the speeds") if source.startswith("assumed") else "known",
        f"{binding.name}: {binding.limit} of joint {binding.joint}",
    ]
