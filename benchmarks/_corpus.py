"""Random drawings with known loops, in all four formats."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from ezdxf.filemanagement import new
from ezdxf.layouts.layout import Modelspace
from OCP.BRep import BRep_Builder
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape

from kerfpath.arrays import Array

__all__ = ["Known", "corpus"]

MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
STEP_UNITS = {"mm": "MM", "cm": "CM", "m": "M", "in": "INCH"}
INSUNITS = {"in": 1, "mm": 4, "cm": 5, "m": 6}
AXIS = (0.2, -0.3, -0.9)


@dataclass(frozen=True, kw_only=True)
class Known:
    """A drawing, and what is known of it.

    Parameters
    ----------
    path : Path
    family : str
    unit : str
    loops : sequence of (str, float)
        Kind and length (mm) of each, of single faces where it has faces.
    sides : int
        How many loops lie on the outer side of a sheet; as many lie on its inner side.
    options : dict
        How to read it.
    """

    path: Path
    family: str
    unit: str
    loops: Sequence[tuple[str, float]]
    sides: int
    options: dict[str, Any]


def corpus(folder: Path, seeds: int) -> Iterator[Known]:
    """Write and yield drawings: every family once for each seed."""
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        unit = list(MM)[seed % len(MM)]
        for family, make in {**FLAT, **SOLID, **PATHS}.items():
            suffixes = ("dxf",) if family in FLAT else ("step", "iges")
            for suffix in (*suffixes, "dxf") if family in PATHS else suffixes:
                path = folder / f"{family.replace(' ', '_')}_{seed}.{suffix}"
                yield make(path, unit, rng, family)
        for family in TABLES:
            yield _table(folder / f"{family.replace(' ', '_')}_{seed}.csv", unit, rng, family)


# --- DXF -------------------------------------------------------------------------------------


def _dxf(path: Path, unit: str, family: str, draw: Any, loops: Any, **options: Any) -> Known:
    document = new("R2010", units=INSUNITS[unit])
    draw(document.modelspace())
    document.saveas(path)
    return Known(path=path, family=family, unit=unit, loops=loops, sides=0, options=options)


def _outline(space: Modelspace, corners: Sequence[Any], rng: Any) -> None:
    """Draw an outline as lines in any order and direction, or as one polyline."""
    if rng.random() < 0.3:
        space.add_lwpolyline(corners, close=True)
        return
    sides = list(itertools.pairwise([*corners, corners[0]]))
    for k in rng.permutation(len(sides)).tolist():
        space.add_line(*(sides[k] if rng.random() < 0.5 else sides[k][::-1]))


def _box(x: float, y: float, dx: float, dy: float) -> list[tuple[float, float]]:
    return [(x, y), (x + dx, y), (x + dx, y + dy), (x, y + dy)]


def _nested(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Rectangles within each other, circles in the last."""
    mm, sizes = MM[unit], np.sort(rng.uniform(20, 200, 4))[::-1].round(2)
    radius = float(sizes[-1] / 8)

    def draw(space: Modelspace) -> None:
        for size in sizes.tolist():
            _outline(space, _box(-size / 2, -size / 3, size, size / 1.5), rng)
        space.add_circle((radius, 0), radius)
        space.add_arc((-2 * radius, 0), radius, 20, 200)
        space.add_arc((-2 * radius, 0), radius, 200, 20)

    loops = [("inner" if k % 2 else "outer", size * 10 / 3 * mm) for k, size in enumerate(sizes)]
    known = _dxf(path, unit, family, draw, [*loops, *[("outer", 2 * np.pi * radius * mm)] * 2])
    # The outer rectangle could be a drawing frame.
    return replace(known, options={**known.options, "drawing_frame": "cut"})


def _grid(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Rectangles that touch, each with all its sides."""
    x, y = (np.cumsum(rng.uniform(5, 40, n)).round(3).tolist() for n in (4, 3))
    pairs = itertools.product(itertools.pairwise(x), itertools.pairwise(y))
    cells = [_box(a, c, b - a, d - c) for (a, b), (c, d) in pairs]

    def draw(space: Modelspace) -> None:
        for k in rng.permutation(len(cells)).tolist():
            _outline(space, cells[k], rng)

    lengths = [2 * (c[2][0] - c[0][0] + c[2][1] - c[0][1]) * MM[unit] for c in cells]
    return _dxf(path, unit, family, draw, [("outer", length) for length in lengths])


def _slots(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Slots of lines and arcs, and of polylines with bulges, in a block, in rows and columns."""
    long, radius = float(rng.uniform(10, 50)), float(rng.uniform(2, 8))
    rows, columns = (int(n) for n in rng.integers(1, 4, 2))

    def draw(space: Modelspace) -> None:
        assert space.doc is not None
        block = space.doc.blocks.new("SLOT")
        block.add_line((0, -radius), (long, -radius))
        block.add_arc((long, 0), radius, 270, 90)
        block.add_line((long, radius), (0, radius))
        block.add_arc((0, 0), radius, 90, 270)
        spacing = {"row_spacing": 4 * radius, "column_spacing": 2 * long + 4 * radius}
        counts = {"row_count": rows, "column_count": columns}
        space.add_blockref("SLOT", (3, 4), {**spacing, **counts, "rotation": 30})
        corners = [(0, -90), (long, -90, 1), (long, -90 + 2 * radius), (0, -90 + 2 * radius, 1)]
        space.add_lwpolyline(
            [(*c, *(0,) * (3 - len(c))) for c in corners], format="xyb", close=True
        )

    length = (2 * long + 2 * math.pi * radius) * MM[unit]
    return _dxf(path, unit, family, draw, [("outer", length)] * (rows * columns + 1))


def _open_lines(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Open polylines on layers, a closed one beside them, a text."""
    lines = [rng.uniform((0, 200 * k), (100, 200 * k + 100), (5, 2)).round(3) for k in range(3)]

    def draw(space: Modelspace) -> None:
        for k, corners in enumerate(lines):
            space.add_lwpolyline(corners.tolist(), dxfattribs={"layer": f"L{k}"})
        _outline(space, _box(-300, 0, 30, 20), rng)
        space.add_text("10 pieces")

    lengths = [np.linalg.norm(np.diff(c, axis=0), axis=1).sum() * MM[unit] for c in lines]
    loops = [*(("open", float(length)) for length in lengths), ("outer", 100 * MM[unit])]
    return _dxf(path, unit, family, draw, loops)


# --- solids ----------------------------------------------------------------------------------


def _write(path: Path, unit: str, shape: TopoDS_Shape) -> None:
    if path.suffix == ".step":
        to_step = STEPControl_Writer()
        Interface_Static.SetCVal_s("write.step.unit", STEP_UNITS[unit])
        to_step.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
        to_step.Write(str(path))
        Interface_Static.SetCVal_s("write.step.unit", "MM")
        return
    IGESControl_Controller.Init_s()
    to_iges = IGESControl_Writer(STEP_UNITS[unit].replace("INCH", "IN"), 0)
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    has_faces = explorer.More()
    while explorer.More():
        to_iges.AddShape(explorer.Current())
        explorer.Next()
    if not has_faces:
        to_iges.AddShape(shape)
    to_iges.ComputeModel()
    to_iges.Write(str(path))


def _moved(shape: TopoDS_Shape, rng: Any) -> TopoDS_Shape:
    turn, move = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(), gp_Dir(*rng.normal(size=3).tolist())), rng.uniform(0, 6))
    move.SetTranslation(gp_Vec(*rng.uniform(-500, 500, 3).tolist()))
    return shape.Moved(TopLoc_Location(move.Multiplied(turn)))


def _together(shapes: Sequence[TopoDS_Shape]) -> TopoDS_Shape:
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def _block(at: Sequence[float], size: Sequence[float]) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(*at), *size).Shape()


def _rod(at: Sequence[float], radius: float, height: float) -> TopoDS_Shape:
    axes = gp_Ax2(gp_Pnt(*at), gp_Dir(0, 0, 1))
    return BRepPrimAPI_MakeCylinder(axes, radius, height).Shape()


def _around_block(size: Sequence[float]) -> list[tuple[str, float]]:
    return [("outer", 2 * (a + b)) for a, b in itertools.combinations(size, 2)] * 2


def _drilled(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Write a plate with round holes."""
    a, b, thick = (float(v) for v in rng.uniform((80, 60, 1), (300, 200, 4)))
    radii = rng.uniform(2, 8, int(rng.integers(1, 5))).tolist()
    shape = _block((0, 0, 0), (a, b, thick))
    for k, radius in enumerate(radii):
        at = ((k + 1) * a / (len(radii) + 1), b / 2, -1)
        shape = BRepAlgoAPI_Cut(shape, _rod(at, radius, thick + 2)).Shape()
    _write(path, unit, _moved(shape, rng))
    around = [2 * math.pi * radius for radius in radii]
    loops = _around_block((a, b, thick)) + [(k, v) for v in around for k in ("inner", "outer") * 2]
    return Known(path=path, family=family, unit=unit, loops=loops, sides=1 + len(radii), options={})


def _tube(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Write a tube: its rims are two outer loops on either side."""
    radius, wall, long = (float(v) for v in rng.uniform((20, 1, 80), (50, 3, 200)))
    shape = BRepAlgoAPI_Cut(
        _rod((0, 0, 0), radius, long), _rod((0, 0, -1), radius - wall, long + 2)
    ).Shape()
    _write(path, unit, _moved(shape, rng))
    out, inside = 2 * math.pi * radius, 2 * math.pi * (radius - wall)
    loops = [("outer", out), ("inner", inside), ("outer", out), ("outer", inside)] * 2
    return Known(path=path, family=family, unit=unit, loops=loops, sides=2, options={})


def _touching(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Plates side by side, with two more standing on the first."""
    sizes = [(float(rng.uniform(50, 100)), 40.0, 2.0) for _ in range(3)]
    starts = np.concatenate([[0.0], np.cumsum([size[0] for size in sizes])])
    shapes = [_block((x, 0, 0), size) for x, size in zip(starts.tolist(), sizes, strict=False)]
    stood = (2.0, 40.0, 30.0)
    shapes += [_block((x, 0, 2), stood) for x in (0.0, 20.0)]
    _write(path, unit, _moved(_together(shapes), rng))
    loops = [loop for size in [*sizes, stood, stood] for loop in _around_block(size)]
    return Known(path=path, family=family, unit=unit, loops=loops, sides=5, options={})


def _path(path: Path, unit: str, rng: Any, family: str) -> Known:
    """Lines from corner to corner in space, in any order."""
    corners = rng.uniform(-200, 200, (7, 3)).round(3)
    pairs = [(p.tolist(), q.tolist()) for p, q in itertools.pairwise(corners)]
    pairs = [pairs[k] for k in rng.permutation(len(pairs)).tolist()]
    length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
    if path.suffix == ".dxf":

        def draw(space: Modelspace) -> None:
            for p, q in pairs:
                space.add_line(p, q)

        return _dxf(path, unit, family, draw, [("open", length * MM[unit])], axis=AXIS)
    edges = [BRepBuilderAPI_MakeEdge(gp_Pnt(*p), gp_Pnt(*q)).Edge() for p, q in pairs]
    _write(path, unit, _together(edges))
    loops, options = [("open", length)], {"axis": AXIS}
    return Known(path=path, family=family, unit=unit, loops=loops, sides=0, options=options)


# --- tables ----------------------------------------------------------------------------------


def _table(path: Path, unit: str, rng: Any, family: str) -> Known:
    points = rng.uniform(-100, 100, (6, 3)).round(3)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(steps.sum()) * MM[unit]
    text, options = TABLES[family](points, unit)
    path.write_text(text, encoding="utf-8")
    loops = [("open", length)]
    return Known(path=path, family=family, unit=unit, loops=loops, sides=0, options=options)


def _rows(cells: Sequence[Sequence[Any]], separator: str) -> str:
    return "\n".join(separator.join(map(str, row)) for row in cells)


def _plain(points: Array, unit: str) -> tuple[str, dict[str, Any]]:
    heads = [f"{axis}_{unit}" for axis in "xyz"] + ["nx", "ny", "nz"]
    return _rows([heads, *([*p, 0, 0, 1] for p in points.tolist())], ","), {}


def _commas(points: Array, unit: str) -> tuple[str, dict[str, Any]]:
    return _rows([*([*p, 0, 0, 1] for p in points.tolist())], ";").replace(".", ","), {"unit": unit}


def _odd_heads(points: Array, unit: str) -> tuple[str, dict[str, Any]]:
    heads = ["No", f"Pos Z [{unit}]", f"Pos X [{unit}]", f"Pos Y [{unit}]", "I", "J", "K"]
    rows = [[k, z, x, y, 0, 0, 1] for k, (x, y, z) in enumerate(points.tolist())]
    names = dict(zip(("z", "x", "y", "nx", "ny", "nz"), heads[1:], strict=True))
    return "# measured\n" + _rows([heads, *rows], "|"), {"columns": names}


def _no_heads(points: Array, unit: str) -> tuple[str, dict[str, Any]]:
    rows = [[k, x, y, z] for k, (x, y, z) in enumerate(points.tolist())]
    return _rows(rows, "\t"), {"columns": ["-", "x", "y", "z"], "axis": AXIS, "unit": unit}


FLAT = {"nested": _nested, "grid": _grid, "slots": _slots, "open lines": _open_lines}
SOLID = {"drilled": _drilled, "tube": _tube, "touching": _touching}
PATHS = {"path": _path}
TABLES = {"table": _plain, "commas": _commas, "odd heads": _odd_heads, "no heads": _no_heads}
