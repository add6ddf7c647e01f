"""Large STEP and DXF files: time and memory of reading."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time

from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pln, gp_Pnt, gp_Vec
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Reader, STEPControl_StepModelType, STEPControl_Writer
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape

from benchmarks._figures import Figure, Report, in_turn, peak_megabytes
from kerfpath import isolated
from kerfpath.cad import read, reading

__all__ = ["run"]

PITCH = 20.0
"""Distance between the holes, mm."""
SIDE = 7
"""Number of holes along a side of a plate: round holes and hexagons alternate."""
PLATES = (8, 32, 116)
"""Numbers of plates in the assembly; the last gives 82 MB."""
ENTITIES = (12_500, 25_000, 50_000, 100_000)
"""Numbers of entities of DXF drawings; more are refused."""
RATIO, GIGABYTES = 2.0, 3.0
"""Allowed time of reading, as a multiple of OCCT's, and allowed memory, GB."""

HOW = """\
An assembly of plates of 180 faces, each with {holes} holes, round ones and hexagons, written by
OCCT as STEP. "OCCT" reads the file and makes its shapes, no more, in this process; "kerfpath"
is `cad.read`: OCCT in a process of its own, which is started before, then the loops of all
faces, skins and sides of sheets. In turn, in one run. The memory is the larger of both
processes at its peak.

DXF drawings of circles in rows, and of squares of four lines, in text, read in this process."""


def run(*, quick: bool = False) -> Report:
    """Return the figures of reading assemblies of several sizes."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    report = Report(title="Large drawings", how=HOW.format(holes=SIDE * SIDE))
    with tempfile.TemporaryDirectory() as folder:
        for plates in PLATES[:1] if quick else PLATES:
            path = Path(folder) / f"{plates}.step"
            _write(path, plates)
            megabytes = path.stat().st_size * 1e-6
            seconds = in_turn(
                {"OCCT": partial(_bare, path), "kerfpath": partial(_ours, path)},
                runs=1 if quick else 3,
            )
            part = read(path)
            peak = max(_peak("self"), _peak(str(_worker())))
            of = f"{megabytes:.0f} MB, {part.faces} faces"
            report.figures.extend(
                Figure(what=f"{of}: {name}", values=values) for name, values in seconds.items()
            )
            ratio = median(seconds["kerfpath"]) / median(seconds["OCCT"])
            verdict = "within" if ratio <= RATIO and peak <= GIGABYTES else "over"
            report.findings.append(
                f"{of}: {ratio:.2f} times as long as OCCT alone, {peak:.1f} GB: {verdict} "
                f"{RATIO:g} times and {GIGABYTES:g} GB"
            )
        for count in ENTITIES[:1] if quick else ENTITIES:
            for shape, text in (("circles", _circles(count)), ("lines of squares", _lines(count))):
                path = Path(folder) / "drawing.dxf"
                path.write_text(text, encoding="ascii")
                start = process_time()
                peak = peak_megabytes(partial(read, path, "mm")) / 1e3
                each = (process_time() - start) * 1e5 / count
                report.figures.append(
                    Figure(
                        what=f"{count} {shape} in DXF",
                        values=[each],
                        unit="s of processor per 100 000 entities",
                        note=f"{path.stat().st_size * 1e-6:.0f} MB, {peak:.1f} GB",
                    )
                )
    return report


def _circles(count: int) -> str:
    side = math.isqrt(count)
    return _dxf(
        f"0\nCIRCLE\n8\n0\n10\n{k % side * 20}\n20\n{k // side * 20}\n40\n5\n" for k in range(count)
    )


def _lines(count: int) -> str:
    side = math.isqrt(count // 4)
    ends = ((0, 0, 9, 0), (9, 0, 9, 9), (9, 9, 0, 9), (0, 9, 0, 0))
    return _dxf(
        f"0\nLINE\n8\n0\n10\n{x + a}\n20\n{y + b}\n11\n{x + c}\n21\n{y + d}\n"
        for k in range(count // 4)
        for x, y in [(k % side * 20, k // side * 20)]
        for a, b, c, d in ends
    )


def _dxf(entities: Iterable[str]) -> str:
    return f"0\nSECTION\n2\nENTITIES\n{''.join(entities)}0\nENDSEC\n0\nEOF\n"


def _bare(path: Path) -> None:
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    reader.OneShape()


def _ours(path: Path) -> None:
    reading._cache.clear()
    read(path)


def _worker() -> int:
    assert isolated._worker is not None
    return isolated._worker.process.pid


def _peak(process: str) -> float:
    """Return the peak memory of a process, GB."""
    lines = Path(f"/proc/{process}/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1e-6


def _plate(z: float) -> TopoDS_Shape:
    up, size = gp_Dir(0, 0, 1), (SIDE + 1) * PITCH
    face = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, z), up), 0, size, 0, size)
    for k in range(SIDE * SIDE):
        x, y = (k % SIDE + 1) * PITCH, (k // SIDE + 1) * PITCH
        if k % 2:
            circle = gp_Circ(gp_Ax2(gp_Pnt(x, y, z), up), 3.0 + 0.01 * k)
            wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()
        else:
            corners = BRepBuilderAPI_MakePolygon()
            for turn in range(6):
                at = math.pi / 3 * turn
                corners.Add(gp_Pnt(x + 4 * math.cos(at), y + 4 * math.sin(at), z))
            corners.Close()
            wire = corners.Wire()
        face.Add(TopoDS.Wire(wire.Reversed()))
    return BRepPrimAPI_MakePrism(face.Face(), gp_Vec(0, 0, 2)).Shape()


def _write(path: Path, plates: int) -> None:
    whole, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(whole)
    for k in range(plates):
        builder.Add(whole, _plate(10.0 * k))
    writer = STEPControl_Writer()
    writer.Transfer(whole, STEPControl_StepModelType.STEPControl_AsIs)
    writer.Write(str(path))
