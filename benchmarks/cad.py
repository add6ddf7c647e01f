"""Drawings: from a file of two megabytes to contours."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from statistics import median

from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pln, gp_Pnt, gp_Vec
from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer
from OCP.Message import Message
from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer
from OCP.TopoDS import TopoDS, TopoDS_Shape

from benchmarks._figures import Figure, Report, in_turn
from kerfpath.cad import read

__all__ = ["run"]

PITCH = 20.0
"""Distance between the holes, mm."""
COLUMNS, ROWS = 32, 16
"""Number of holes, enough for two megabytes of STEP."""
LIMIT = 5.0
"""Time allowed for reading and for all contours of one side, s."""

HOW = """\
A perforated sheet, {holes} holes, written by OCCT as STEP ({step:.1f} MB) and IGES ({iges:.1f} MB).
Each run reads the file, as `kerfpath contours` does, and makes the contours of all loops of the
sheet's outer side at the default tolerances (2 um, 0.002 rad). OCCT is loaded before."""


def run(*, quick: bool = False) -> Report:
    """Return the figures of reading drawings."""
    columns, rows = (8, 5) if quick else (COLUMNS, ROWS)
    with tempfile.TemporaryDirectory() as folder:
        step, iges = Path(folder) / "sheet.step", Path(folder) / "sheet.iges"
        _write(step, iges, _sheet(columns, rows))
        calls = {path.suffix[1:].upper(): path for path in (step, iges)}
        seconds = in_turn(
            {name: partial(_contours, path) for name, path in calls.items()},
            runs=1 if quick else 3,
        )
        sizes = {path.suffix[1:]: path.stat().st_size * 1e-6 for path in calls.values()}
    report = Report(title="Drawings to contours", how=HOW.format(holes=columns * rows, **sizes))
    report.figures.extend(Figure(what=name, values=v) for name, v in seconds.items())
    worst = median(seconds["STEP"])
    verdict = "within" if worst < LIMIT else "over"
    report.findings.append(f"STEP to contours: {worst:.2f} s, {verdict} {LIMIT:g} s")
    return report


def _contours(path: Path) -> None:
    part = read(path)
    for loop in part.pick(side="outer"):
        part.contour(loop.name)


def _sheet(columns: int, rows: int) -> TopoDS_Shape:
    """Return a sheet 2 mm thick with a grid of round holes."""
    up = gp_Dir(0, 0, 1)
    plane = gp_Pln(gp_Pnt(), up)
    face = BRepBuilderAPI_MakeFace(plane, 0, (columns + 1) * PITCH, 0, (rows + 1) * PITCH)
    for k in range(columns * rows):
        x, y = (k % columns + 1) * PITCH, (k // columns + 1) * PITCH
        circle = gp_Circ(gp_Ax2(gp_Pnt(x, y, 0), up), 3.0 + 0.005 * k)
        wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire()
        face.Add(TopoDS.Wire(wire.Reversed()))
    return BRepPrimAPI_MakePrism(face.Face(), gp_Vec(0, 0, 2)).Shape()


def _write(step: Path, iges: Path, shape: TopoDS_Shape) -> None:
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    to_step = STEPControl_Writer()
    to_step.Transfer(shape, STEPControl_StepModelType.STEPControl_AsIs)
    to_step.Write(str(step))
    IGESControl_Controller.Init_s()
    to_iges = IGESControl_Writer("MM", 0)
    to_iges.AddShape(shape)
    to_iges.ComputeModel()
    to_iges.Write(str(iges))
