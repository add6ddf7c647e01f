"""The library: every robot, rail and positioner that is shipped, its limits, doubts and sources."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from urllib.parse import quote

import numpy as np

from kerfpath.arrays import Array
from kerfpath.cell import picture_of
from kerfpath.robots import (
    FAMILIES,
    ExternalProduct,
    KnownAxis,
    Robot,
    acceleration_ratios,
    external,
    external_ids,
    robot,
    robot_ids,
)
from reference.markdown import code, prose, table

__all__ = ["page"]


def page() -> str:
    """Return tables of all, and a section on each."""
    robots = [robot(name) for name in robot_ids()]
    products = [external(name) for name in external_ids()]
    parts = ["## Robots", _list_of_robots(robots)]
    for each in robots:
        parts += [f"### {each.manufacturer} {each.model}", *_about_robot(each)]
    parts += ["## Rails and positioners", _list_of_axes(products)]
    for product in products:
        parts += [f"### {product.manufacturer} {product.model}", *_about_product(product)]
    parts += ["## Ratios of acceleration to velocity", _ratios()]
    return "\n\n".join(parts)


def _list_of_robots(robots: Sequence[Robot]) -> str:
    """Return one row for each robot."""
    rows = [
        [
            f"[{each.manufacturer} {each.model}](#{_anchor(each)})",
            code(each.id),
            str(each.joints),
            f"{each.payload:g}",
            f"{each.reach:g}",
            "missing" if each.limits_missing else "known",
            "known" if each.acceleration is not None else "not known",
        ]
        for each in robots
    ]
    heads = ["robot", "`model`", "joints", "payload kg", "reach m", "limits", "acceleration"]
    return table(heads, rows)


def _about_robot(each: Robot) -> Iterator[str]:
    """Yield what is known of one robot."""
    yield f"({_anchor(each)})="
    about = escape(f"{each.manufacturer} {each.model}, reach {each.reach:g} m")
    drawn = f"data:image/svg+xml,{quote(picture_of(each).strip())}"
    yield f'```{{raw}} html\n<img alt="{about}" width="260" src="{drawn}">\n```'
    lengths = ", ".join(f"{name} {1000 * value:g}" for name, value in each.geometry.items())
    yield (
        f"{code(each.id)}: {FAMILIES[each.kinematics].words}; payload {each.payload:g} kg, "
        f"reach {each.reach:g} m; lengths (mm): {lengths}."
    )
    limits = {
        "lower deg": each.lower,
        "upper deg": each.upper,
        "velocity deg/s": each.velocity,
        "acceleration deg/s²": each.acceleration,
    }
    rows = [[name, *_degrees(values)] for name, values in limits.items() if values is not None]
    yield table(["limit", *(f"joint {i + 1}" for i in range(each.joints))], rows)
    facts = [
        f"{code(c.name)}: {np.degrees(c.lower):g} to {np.degrees(c.upper):g} deg ({prose(c.note)})"
        for c in each.couplings
    ]
    if each.limits_missing:
        facts.append(f"**Limits missing**: {prose(each.limits_missing)}.")
    if each.acceleration is not None:
        facts.append(f"Acceleration: {prose(each.acceleration_source)}.")
    else:
        facts.append("**Acceleration not known.**")
    if each.acceleration_ratio:
        facts.append(f"Nearest ratio of acceleration to velocity: {code(each.acceleration_ratio)}.")
    facts += [f"**Note**: {prose(note)}" for note in each.notes]
    yield _items([*facts, *_sources(each.sources)])


def _list_of_axes(products: Sequence[ExternalProduct]) -> str:
    """Return one row for each axis of each product."""
    rows = [
        [
            f"[{product.manufacturer} {product.model}](#{_anchor(product)})",
            code(name),
            f"the {each.axis.carries}",
            f"{product.payload:g}",
            _range(each),
            _in_unit(each, each.velocity, "/s"),
            _in_unit(each, each.acceleration, "/s²"),
        ]
        for product in products
        for name, each in zip(product.axis_ids, product.axes, strict=True)
    ]
    heads = ["product", "`model`", "carries", "payload kg", "range", "velocity", "acceleration"]
    return table(heads, rows)


def _about_product(product: ExternalProduct) -> Iterator[str]:
    """Yield where the axes of a product are, its notes and its sources."""
    yield f"({_anchor(product)})="
    rows = []
    for name, each in zip(product.axis_ids, product.axes, strict=True):
        direction, through = each.axis.axis, 1000 * each.axis.point
        point = _numbers(through) if each.axis.kind == "rotary" else ""
        rows.append([code(name), each.axis.kind, _numbers(direction), point])
    yield table(["axis", "kind", "direction", "through mm"], rows)
    notes = [f"**Note**: {prose(note)}" for note in product.notes]
    yield _items([*notes, *_sources(product.sources)])


def _ratios() -> str:
    """Return the named ratios, 1/s."""
    ratios = acceleration_ratios()
    rows = [[code(name), *(f"{value:g}" for value in ratios[name])] for name in ratios]
    return table(["`acceleration_ratio`", *(f"joint {i}" for i in range(1, len(rows[0])))], rows)


def _anchor(each: Robot | ExternalProduct) -> str:
    return each.id.replace("_", "-")


def _items(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _sources(sources: Mapping[str, str]) -> Iterator[str]:
    for what, source in sources.items():
        yield f"Source of {what.replace('_', ' ')}: {prose(source)}"


def _degrees(values: Array) -> list[str]:
    # Data sheets are in degrees; radians and back leave digits that nobody wrote.
    return [f"{value:g}" for value in np.degrees(values).round(9)]


def _in_unit(each: KnownAxis, value: float | None, per: str = "") -> str:
    """Return a limit in mm or deg, or that the job gives it."""
    if value is None:
        return "the job gives it"
    unit, factor = ("mm", 1e3) if each.axis.kind == "linear" else ("deg", 180 / np.pi)
    return f"{round(factor * value, 9):g} {unit}{per}"


def _range(each: KnownAxis) -> str:
    if each.endless:
        return "endless"
    lower, upper = (_in_unit(each, value) for value in (each.lower, each.upper))
    return lower if lower == upper else f"{lower.split()[0]} to {upper}"


def _numbers(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values.round(9) + 0.0)
