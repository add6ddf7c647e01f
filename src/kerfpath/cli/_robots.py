"""`kerfpath robots`: print the library as a table, or one robot with its sources."""

from __future__ import annotations

import numpy as np
from rich.markup import escape

from kerfpath._arrays import Array
from kerfpath.cli._show import out, print_json, table
from kerfpath.robots import robot, robot_ids

__all__ = ["list_robots", "show_robot"]


def list_robots(*, as_json: bool) -> None:
    """Print id, maker, model, payload and reach of every robot, and which limits are known."""
    known = [robot(name) for name in robot_ids()]
    if as_json:
        print_json(
            {
                "robots": [
                    {
                        "id": r.id,
                        "manufacturer": r.manufacturer,
                        "model": r.model,
                        "payload_kg": r.payload,
                        "reach_m": r.reach,
                        "limits_known": not r.limits_missing,
                        "acceleration_known": r.acceleration is not None,
                    }
                    for r in known
                ]
            }
        )
        return
    rows = [
        [
            r.id,
            escape(f"{r.manufacturer} {r.model}"),
            f"{r.payload:g}",
            f"{r.reach:g}",
            "known" if r.acceleration is not None else "name it",
            "missing" if r.limits_missing else "",
        ]
        for r in known
    ]
    columns = ["robot", "model", "payload kg", "reach m", "acceleration", "limits"]
    table(columns, rows, numbers=["payload kg", "reach m"])
    out.print(
        f"{len(known)} robots. Where it says 'name it' the maker publishes no accelerations: give "
        "acceleration_deg_s2 or acceleration_ratio in the job."
    )


def show_robot(name: str, *, as_json: bool) -> None:
    """Print geometry, limits, notes and sources of one robot."""
    r = robot(name)
    limits = {
        "lower deg": _degrees(r.lower),
        "upper deg": _degrees(r.upper),
        "velocity deg/s": _degrees(r.velocity),
        "acceleration deg/s^2": _degrees(r.acceleration),
    }
    couplings = [
        {
            "what": c.name,
            "lower_deg": float(np.degrees(c.lower)),
            "upper_deg": float(np.degrees(c.upper)),
            "note": c.note,
        }
        for c in r.couplings
    ]
    if as_json:
        print_json(
            {
                "id": r.id,
                "manufacturer": r.manufacturer,
                "model": r.model,
                "payload_kg": r.payload,
                "reach_m": r.reach,
                "kinematics": r.kinematics,
                "geometry_m": dict(r.geometry),
                "sign": r.sign.tolist(),
                "offset_deg": _degrees(r.offset),
                **{
                    k.replace(" ", "_").replace("/", "_").replace("^", ""): v
                    for k, v in limits.items()
                },
                "axis_3": r.axis_3,
                "couplings": couplings,
                "endless": (np.flatnonzero(r.endless) + 1).tolist(),
                "limits_missing": r.limits_missing,
                "acceleration_source": r.acceleration_source,
                "acceleration_ratio": r.acceleration_ratio,
                "notes": list(r.notes),
                "frames": r.frames,
                "sources": r.sources,
            }
        )
        return
    out.print(f"[bold]{escape(r.manufacturer)} {escape(r.model)}[/] ({r.id})")
    out.print(f"payload {r.payload:g} kg, reach {r.reach:g} m")
    lengths = ", ".join(f"{k} {v * 1000:g}" for k, v in r.geometry.items())
    out.print(f"lengths ({r.kinematics.upper()}, mm): {lengths}")
    rows = [
        [what, *(["not known", *[""] * 5] if values is None else [f"{v:g}" for v in values])]
        for what, values in limits.items()
    ]
    joints = [f"joint {i}" for i in range(1, 7)]
    table(["limit", *joints], rows, numbers=joints)
    for c in couplings:
        out.print(
            f"{c['what']}: {c['lower_deg']:g} to {c['upper_deg']:g} deg ({escape(str(c['note']))})"
        )
    if r.limits_missing:
        out.print(f"limits missing: {escape(r.limits_missing)}")
    if r.acceleration is None:
        out.print(f"acceleration: not published; nearest named ratio: {r.acceleration_ratio}")
    else:
        out.print(f"acceleration: {escape(r.acceleration_source)}")
    for note in r.notes:
        out.print(f"note: {escape(note)}")
    for what, source in r.sources.items():
        out.print(f"source of {what.replace('_', ' ')}: {escape(source)}")


def _degrees(values: Array | None) -> list[float] | None:
    # Data sheets are in degrees; radians and back leave digits that nobody wrote.
    return None if values is None else np.degrees(values).round(9).tolist()
