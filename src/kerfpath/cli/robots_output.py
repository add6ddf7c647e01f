"""`kerfpath robots`: list the library, show one robot or product, or write the URDF of a robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich.markup import escape

from kerfpath.arrays import SHOWN_UNITS, Array
from kerfpath.cli.show import out, print_json, table, write_text
from kerfpath.errors import InputError
from kerfpath.robots import (
    ExternalProduct,
    KnownAxis,
    acceleration_table_of,
    external,
    external_ids,
    robot,
    robot_ids,
    robots_with_tables,
)

UNITS = {"lower": "", "upper": "", "velocity": "/s", "acceleration": "/s^2"}
"""Limits of external axes, and the end of their units after mm or deg."""


def list_robots() -> None:
    """Print id, maker, model, payload and reach of every robot, and which limits are known.

    The axes of every rail and positioner follow with their limits.
    """
    known = [robot(name) for name in robot_ids()]
    products = [external(name) for name in external_ids()]
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
            ],
            "externals": [_entry(product) for product in products],
        }
    )
    rows = [
        [
            r.id,
            escape(f"{r.manufacturer} {r.model}"),
            f"{r.payload:g}",
            f"{r.reach:g}",
            "known" if r.acceleration is not None else "set in job",
            "missing" if r.limits_missing else "",
        ]
        for r in known
    ]
    columns = ["robot", "model", "payload kg", "reach m", "acceleration", "limits"]
    table(columns, rows, numbers=["payload kg", "reach m"])
    out.print(
        f"{len(known)} robots. 'set in job': the maker publishes no accelerations; set "
        "acceleration_deg_s2 or acceleration_ratio in the job."
    )
    heads = ["rail or positioner", "model", "payload kg", "range", "velocity", "acceleration"]
    rows = [
        [
            axis,
            escape(f"{product.manufacturer} {product.model}"),
            f"{product.payload:g}",
            _range(each),
            *(_limit_text(each, limit) for limit in ("velocity", "acceleration")),
        ]
        for product in products
        for axis, each in zip(product.axis_ids, product.axes, strict=True)
    ]
    table(heads, rows, numbers=["payload kg"])
    out.print(
        f"{len(products)} rails and positioners, by their axes. 'set in job': no source is known, "
        "or the value is chosen when the product is ordered; set it in the job."
    )


def show_external(name: str) -> None:
    """Print the axes, limits, notes and sources of one rail or positioner."""
    product = external(name)
    print_json(_entry(product))
    out.print(f"[bold]{escape(product.manufacturer)} {escape(product.model)}[/] ({product.id})")
    out.print(f"payload {product.payload:g} kg")
    heads = ["axis", "carries", "range", "velocity", "acceleration", "direction", "through mm"]
    rows = [
        [
            axis,
            f"the {each.axis.carries}",
            _range(each),
            *(_limit_text(each, limit) for limit in ("velocity", "acceleration")),
            _numbers(each.axis.axis),
            _numbers(1000 * each.axis.point) if each.axis.kind == "rotary" else "",
        ]
        for axis, each in zip(product.axis_ids, product.axes, strict=True)
    ]
    table(heads, rows)
    for note in product.notes:
        out.print(f"note: {escape(note)}")
    for what, source in product.sources.items():
        out.print(f"source of {what.replace('_', ' ')}: {escape(source)}")


def _in_unit(each: KnownAxis, limit: str) -> tuple[float | None, str]:
    """Return a limit in mm or deg, None where it is not known, and its unit."""
    value: float | None = getattr(each, limit)
    factor, unit = SHOWN_UNITS[each.axis.unit]
    # Data sheets are in these units; conversion to m or rad and back adds spurious digits.
    return None if value is None else round(factor * value, 9), unit + UNITS[limit]


def _limit_text(each: KnownAxis, limit: str) -> str:
    value, unit = _in_unit(each, limit)
    return "set in job" if value is None else f"{value:g} {unit}"


def _range(each: KnownAxis) -> str:
    if each.endless:
        return "endless"
    ends = [_limit_text(each, limit) for limit in ("lower", "upper")]
    return ends[0] if ends[0] == ends[1] else f"{ends[0].split()[0]} to {ends[1]}"


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values.round(9) + 0.0)


def _entry(product: ExternalProduct) -> dict[str, object]:
    """Return all known data of a product."""
    return {
        "id": product.id,
        "manufacturer": product.manufacturer,
        "model": product.model,
        "payload_kg": product.payload,
        "axes": [
            {
                "model": name,
                "name": each.axis.name,
                "kind": each.axis.kind,
                "carries": each.axis.carries,
                "axis": each.axis.axis.tolist(),
                "point_mm": (1000 * each.axis.point).round(9).tolist(),
                "endless": each.endless,
                **{
                    _key(f"{limit} {unit}"): value
                    for limit in UNITS
                    for value, unit in [_in_unit(each, limit)]
                },
            }
            for name, each in zip(product.axis_ids, product.axes, strict=True)
        ],
        "notes": list(product.notes),
        "sources": dict(product.sources),
    }


def show_robot(name: str) -> None:
    """Print geometry, limits, notes and sources of one robot."""
    r = robot(name)
    limits = {
        "lower deg": _degrees(r.lower),
        "upper deg": _degrees(r.upper),
        "velocity deg/s": _degrees(r.velocity),
        "acceleration deg/s^2": _degrees(r.acceleration),
    }
    by_place = [
        {
            "joint": joint,
            "least_deg_s2": float(np.degrees(values.min()).round(9)),
            "most_deg_s2": float(np.degrees(values.max()).round(9)),
        }
        for joint, values in _table_of(name).items()
    ]
    couplings = [
        {
            "what": c.name,
            "lower_deg": float(np.degrees(c.lower)),
            "upper_deg": float(np.degrees(c.upper)),
            "note": c.note,
        }
        for c in r.couplings
    ]
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
            **{_key(k): v for k, v in limits.items()},
            "axis_3": r.axis_3,
            "couplings": couplings,
            "endless": (np.flatnonzero(r.endless) + 1).tolist(),
            "limits_missing": r.limits_missing,
            "acceleration_source": r.acceleration_source,
            "acceleration_ratio": r.acceleration_ratio,
            "acceleration_table": by_place,
            "notes": list(r.notes),
            "frames": r.frames,
            "sources": r.sources,
        }
    )
    out.print(f"[bold]{escape(r.manufacturer)} {escape(r.model)}[/] ({r.id})")
    out.print(f"payload {r.payload:g} kg, reach {r.reach:g} m")
    lengths = ", ".join(f"{k} {v * 1000:g}" for k, v in r.geometry.items())
    out.print(f"lengths ({r.kinematics.upper()}, mm): {lengths}")
    rest = [""] * (r.joints - 1)
    rows = [
        [what, *(["not known", *rest] if values is None else [f"{v:g}" for v in values])]
        for what, values in limits.items()
    ]
    table(["limit", *r.joint_names], rows, numbers=r.joint_names)
    for c in couplings:
        out.print(
            f"{c['what']}: {c['lower_deg']:g} to {c['upper_deg']:g} deg ({escape(str(c['note']))})"
        )
    if r.limits_missing:
        out.print(f"limits missing: {escape(r.limits_missing)}")
    if r.acceleration is None:
        ratio = f"; nearest named ratio: {r.acceleration_ratio}" if r.acceleration_ratio else ""
        out.print(f"acceleration: not published{ratio}")
    else:
        out.print(f"acceleration: {escape(r.acceleration_source)}")
    for of in by_place:
        out.print(
            f"acceleration of joint {of['joint']} by joints 2 and 3: {of['least_deg_s2']:g} to "
            f'{of["most_deg_s2"]:g} deg/s^2, with acceleration_table = "library"'
        )
    for note in r.notes:
        out.print(f"note: {escape(note)}")
    for what, source in r.sources.items():
        out.print(f"source of {what.replace('_', ' ')}: {escape(source)}")


def _table_of(name: str) -> Mapping[int, Array]:
    """Return the accelerations by configuration that the library has of a robot; none: empty."""
    return acceleration_table_of(name).limits if name in robots_with_tables() else {}


def write_urdf(name: str | None, path: Path) -> None:
    """Write the description of a robot of the library to a file, and say so.

    Raises
    ------
    InputError
        `name` is not a robot, the file cannot be written, or as `Robot.to_urdf`.
    """
    if name is None or name in external_ids():
        raise InputError(
            f"--urdf: expected the id of a robot, got {name or 'none'}; kerfpath robots lists them"
        )
    write_text(path, robot(name).to_urdf(), "--urdf")
    print_json({"id": name, "files": [str(path)]})


def _key(text: str) -> str:
    """Return a limit and its unit as a key: "velocity_deg_s"."""
    return text.replace(" ", "_").replace("/", "_").replace("^", "")


def _degrees(values: Array | None) -> list[float] | None:
    # Data sheets are in degrees; conversion to radians and back adds spurious digits.
    return None if values is None else np.degrees(values).round(9).tolist()
