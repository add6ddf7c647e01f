"""Read DXF files: flat contours in millimetres, with layers and colours, chained to loops."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
from ezdxf import recover
from ezdxf.colors import BYBLOCK, BYLAYER, int2rgb
from ezdxf.document import Drawing
from ezdxf.entities.arc import Arc as DxfArc
from ezdxf.entities.circle import Circle
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.ellipse import Ellipse
from ezdxf.entities.insert import Insert
from ezdxf.entities.line import Line as DxfLine
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.polyline import Polyline
from ezdxf.entities.spline import Spline as DxfSpline
from ezdxf.lldxf.const import DXFError
from scipy.interpolate import BSpline

from kerfpath._arrays import Array
from kerfpath.cad._chains import Look, loops_in
from kerfpath.cad._curves import Arc, Curve, Line, Spline
from kerfpath.cad._part import Part
from kerfpath.cad._units import LARGEST, UNITS_MM
from kerfpath.errors import InputError

__all__ = ["read_dxf"]

logger = logging.getLogger("ezdxf")
INSUNITS = {
    1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 9: "mil", 13: "um", 14: "dm",
}  # fmt: skip
"""Units by the header variable $INSUNITS."""
COLOURS = {1: "red", 2: "yellow", 3: "green", 4: "cyan", 5: "blue", 6: "magenta", 7: "white"}
"""Names of the first colours of the AutoCAD colour index."""
LOOSE = ("0", "white")
"""Layer and colour of what stands in no block."""
DEEPEST = 32
"""Blocks inside blocks; more means that a block holds itself."""
MOST = 200_000
"""Curves in a drawing; more is a slip in the rows and columns of a block."""
FLAT = 1e-6
"""How far (mm) a curve may leave the drawing plane: what writers round to."""
DAMAGED = (
    DXFError, ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError,
)  # fmt: skip
"""What ezdxf and splines raise on values that are none, and on structures that are torn."""


def read_dxf(path: Path, content: bytes, unit: str | None, gap: float) -> Part:
    """Return the loops of a DXF drawing; the tool axis is -z of its plane.

    Raises
    ------
    InputError
        Not a DXF file, a damaged one, one without curves, curves that leave the plane, or no unit
        known.
    """
    try:
        document, repairs = _document(content)
        insunits = int(document.header.get("$INSUNITS", 0))
    except DAMAGED as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"{path}: not a DXF file, or a damaged one ({reason}); save the drawing as DXF again"
        ) from None
    declared = INSUNITS.get(insunits, "")
    if unit is None and not declared:
        raise InputError(
            f"{path}: states no length unit ($INSUNITS is {insunits}); "
            f"say what its numbers mean with unit= one of {', '.join(UNITS_MM)}"
        )
    notes = []
    if unit is None:
        notes.append(f"unit {declared} taken from $INSUNITS, which is no more than a hint: check")
    elif declared and declared != unit:
        notes.append(f"unit {unit} as asked; $INSUNITS says {declared}")
    if repairs:
        notes.append(f"{len(repairs)} faults of the file repaired, the first: {repairs[0]}")
    sheet = _Sheet(document, UNITS_MM[unit or declared])
    try:
        with np.errstate(all="ignore"):  # ezdxf divides by lengths that may be 0
            sheet.add(document.modelspace())
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except DAMAGED as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: a damaged entity ({reason}); repair it in CAD") from None
    return loops_in(path, unit or declared, sheet.curves, gap=gap, notes=notes + sheet.notes())


def _document(content: bytes) -> tuple[Drawing, list[str]]:
    """Return the drawing and what was repaired in reading it."""
    if b"AutoCAD Binary DXF" in content[:22]:
        raise InputError("a binary DXF; save it as text")
    if b"SECTION" not in content[:4096]:
        raise DXFError(f"expected SECTION at its start, got {content[:32]!r}")
    with _overheard() as said:
        document, auditor = recover.read(BytesIO(content))
    faults = [*said, *(fault.message for fault in (*auditor.fixes, *auditor.errors))]
    return document, [" ".join(fault.split())[:200] for fault in faults]


class _Listener(logging.Handler):
    """Keeps what is logged."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.said.append(record.getMessage())


@contextmanager
def _overheard() -> Iterator[list[str]]:
    """Give what ezdxf logs about faults, which would go to the terminal otherwise."""
    handler = _Listener(logging.WARNING)
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield handler.said
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates


@dataclass
class _Sheet:
    """Curves gathered from the entities of a drawing, in mm, by (layer, colour)."""

    document: Drawing
    mm: float
    curves: dict[Look, list[Curve]] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    count: int = 0

    def notes(self) -> list[str]:
        """Say what was left out."""
        told = ", ".join(f"{count} {what}" for what, count in self.left_out.items())
        return [f"left out: {told}"] if told else []

    def add(self, entities: Iterable[DXFGraphic], inside: Look = LOOSE, depth: int = 0) -> None:
        """Add entities; those of a block stand `inside` the layer and colour of its insertion."""
        if depth > DEEPEST:
            raise InputError(f"blocks nest deeper than {DEEPEST}: one holds itself; repair it")
        for entity in entities:
            layer, colour = self._look(entity, inside)
            kind = entity.dxftype()
            if self.document.layers.has_entry(layer):
                drawn = self.document.layers.get(layer)
                if drawn.is_off() or drawn.is_frozen():
                    self.left_out[f"{kind} on hidden layer {layer}"] += 1
                    continue
            if isinstance(entity, Insert):
                if entity.mcount > MOST:
                    raise InputError(f"a block is inserted {entity.mcount} times (at most {MOST})")
                for single in entity.multi_insert() if entity.mcount > 1 else (entity,):
                    self.add(single.virtual_entities(), (layer, colour), depth + 1)
                continue
            curves = list(self._curves(entity))
            if not curves:
                self.left_out[kind] += 1
            self.count += len(curves)
            if self.count > MOST:
                raise InputError(f"more than {MOST} curves; leave out what is not to be cut")
            for curve in curves:
                self._require_flat(curve, kind, layer)
            self.curves.setdefault((layer, colour), []).extend(curves)

    def _look(self, entity: DXFGraphic, inside: Look) -> Look:
        layer = inside[0] if entity.dxf.layer == "0" else str(entity.dxf.layer)
        if entity.dxf.hasattr("true_color"):
            return layer, "#{:02x}{:02x}{:02x}".format(*int2rgb(entity.dxf.true_color))
        index = int(entity.dxf.color)
        if index == BYBLOCK:
            return layer, inside[1]
        if index == BYLAYER:
            known = self.document.layers.has_entry(layer)
            index = abs(int(self.document.layers.get(layer).dxf.color)) if known else 7
        return layer, COLOURS.get(index, f"aci{index}")

    def _curves(self, entity: DXFGraphic) -> Iterator[Curve]:
        """Yield the curves (mm) of an entity, none if it is not one."""
        if isinstance(entity, DxfLine):
            yield Line(self._point(entity.dxf.start), self._point(entity.dxf.end))
        elif isinstance(entity, Circle):  # of which ARC is a kind
            first, last = 0.0, 360.0
            if isinstance(entity, DxfArc):
                first, last = float(entity.dxf.start_angle), float(entity.dxf.end_angle)
                last = first + ((last - first) % 360.0 or 360.0)
            ocs, radius = entity.ocs(), float(entity.dxf.radius)
            yield Arc(
                self._point(ocs.to_wcs(entity.dxf.center)),
                self._point(ocs.to_wcs((radius, 0, 0))),
                self._point(ocs.to_wcs((0, radius, 0))),
                *np.radians([first, last]).tolist(),
            )
        elif isinstance(entity, Ellipse):
            first, last = float(entity.dxf.start_param), float(entity.dxf.end_param)
            yield Arc(
                self._point(entity.dxf.center),
                self._point(entity.dxf.major_axis),
                self._point(entity.minor_axis),
                first,
                first + ((last - first) % (2 * np.pi) or 2 * np.pi),
            )
        elif isinstance(entity, LWPolyline) or (
            isinstance(entity, Polyline) and (entity.is_2d_polyline or entity.is_3d_polyline)
        ):
            for piece in entity.virtual_entities():
                yield from self._curves(piece)
        elif isinstance(entity, DxfSpline):
            tool = entity.construction_tool()
            weights = np.array(tool.weights() or np.ones(tool.count))
            points = np.array([self._point(p) for p in tool.control_points])
            net = np.column_stack([points * weights[:, None], weights])
            spline = BSpline(np.array(tool.knots()), net, tool.order - 1)
            low, high = spline.t[spline.k], spline.t[-spline.k - 1]
            yield Spline(spline, float(low), float(high))

    def _point(self, point: Iterable[float]) -> Array:
        return np.array([*point], dtype=float) * self.mm

    def _require_flat(self, curve: Curve, kind: str, layer: str) -> None:
        box = curve.bounds()
        if not (np.abs(box) <= LARGEST).all():
            raise InputError(
                f"a {kind} on layer {layer} reaches further than {LARGEST / 1e6:g} km; its numbers "
                "are damaged, or the unit is wrong"
            )
        if box[1, 2] - box[0, 2] > FLAT:
            raise InputError(
                f"a {kind} on layer {layer} leaves the drawing plane, z from {box[0, 2]:g} to "
                f"{box[1, 2]:g} mm; a DXF is read as a flat drawing: project it to one plane"
            )
