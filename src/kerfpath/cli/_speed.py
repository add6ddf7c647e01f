"""`kerfpath speed`: find the fastest constant speed of each contour, and the limit that binds."""

from __future__ import annotations

from collections.abc import Sequence

from rich.markup import escape

from kerfpath.cli._show import out, print_json, table
from kerfpath.job import ContourSpeed
from kerfpath.planner import FastestSpeed, at_least, at_most

__all__ = ["show_speeds"]


def show_speeds(answers: Sequence[ContourSpeed], *, as_json: bool) -> bool:
    """Print the fastest speed of each contour; return whether every contour has one."""
    entries: list[dict[str, object]] = []
    rows = []
    for answer in answers:
        task, nodes, found, run = answer.task, answer.nodes, answer.at_nodes, answer.as_run
        entry: dict[str, object] = {"name": task.name, "asked_m_min": task.speed * 60}
        row = [escape(task.name), f"{task.speed * 60:g}"]
        if isinstance(found, FastestSpeed):
            place = (nodes.points[found.node] * 1000).round(1).tolist()
            entry |= {
                "fastest_m_min": found.speed * 60,
                "on_grid_m_min": None if found.on_grid is None else found.on_grid * 60,
                "as_run_m_min": None if run is None else run * 60,
                "impossible_from_m_min": None if found.ceiling is None else found.ceiling * 60,
                "joint": found.joint + 1,
                "limit": found.limit,
                "node": found.node,
                "point_mm": place,
            }
            what = f"joint {found.joint + 1} {found.limit}"
            at = " ".join(f"{v:g}" for v in place)
            on_grid = found.speed if found.on_grid is None else found.on_grid
            off_grid = "-" if found.on_grid is None else at_most(found.speed * 60)
            never = "-" if found.ceiling is None else at_least(found.ceiling * 60)
            kept = "-" if run is None else at_most(run * 60)
            speeds = [at_most(on_grid * 60), off_grid, kept, never]
            rows.append([*row, *speeds, str(found.node), what, at])
        else:
            entry |= {"fastest_m_min": None, "reason": str(found), "proved_for": found.scope}
            rows.append([*row, "-", "-", "-", "-", str(found.node + 1), "no admissible pose", ""])
        entries.append(entry)
    if as_json:
        print_json({"contours": entries})
    else:
        columns = [
            "contour",
            "asked m/min",
            "on the grid",
            "refined",
            "as run",
            "impossible from",
            "node",
            "what binds",
        ]
        at = "at x y z mm"
        table([*columns, at], rows, numbers=columns[1:7], spare=[at])
        out.print(
            "on the grid: the fastest constant speed there, exact; refined: the fastest speed "
            "found off the grid, not proved to be the fastest possible; both keep the limits at "
            "the nodes; as run: a speed at which the program keeps them between the nodes, too, "
            "if the job asks for it (between_nodes) and one was found; impossible from: at this "
            "speed and above it is proved that there is no motion, at any rotation"
        )
    return all(entry["fastest_m_min"] is not None for entry in entries)
