"""Read DXF files: flat curves with layers and colours, chained to loops.

Entities that are left out, also those that ezdxf drops when it repairs a file, are counted by kind
and reason.
"""

from __future__ import annotations

import logging
import re
import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from io import BytesIO
from itertools import islice, product
from math import isfinite
from pathlib import Path

import numpy as np
from ezdxf import recover
from ezdxf.audit import Auditor
from ezdxf.colors import BYBLOCK, BYLAYER, int2rgb
from ezdxf.document import Drawing
from ezdxf.entities.arc import Arc as DxfArc
from ezdxf.entities.circle import Circle
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.ellipse import Ellipse
from ezdxf.entities.insert import Insert
from ezdxf.entities.line import Line as DxfLine
from ezdxf.entities.lwpolyline import LWPolyline
from ezdxf.entities.polyline import DXFVertex, Polyline
from ezdxf.entities.spline import Spline as DxfSpline
from ezdxf.entities.ucs import UCSTableEntry
from ezdxf.lldxf.const import DXFError
from ezdxf.lldxf.tagger import binary_tags_loader
from ezdxf.math import Vec3
from ezdxf.xclip import XClip
from scipy.interpolate import BSpline

from kerfpath.arrays import Array, freeze
from kerfpath.cad.chains import Stroke, Style, part_of_strokes
from kerfpath.cad.curves import Arc, Curve, Line, Spline, measure
from kerfpath.cad.drawing_frame import ASK, NAMED, Choice, drawing_frame, is_around_islands
from kerfpath.cad.left_out import LeftOut
from kerfpath.cad.part import Part
from kerfpath.cad.units import GIVE_AXIS, LARGEST, MM, NO_UNIT, UNITS_MM
from kerfpath.errors import InputError, printable

# -----------------------------------------------------------------------------
# Convert the entities of a DXF that are lines to cut to curves.


def curves_of(entity: DXFGraphic, T: Array) -> Iterator[Curve]:
    """Yield the curves (mm) of an entity, or none if it is no line to cut.

    T (4, 4) maps its coordinates to mm. Blocks may have different scales in x and y; arcs, ellipses
    and splines stay exact under any such map, without division.
    """

    def point(at: Iterable[float]) -> Array:
        return np.asarray(T[:3, :3] @ np.array([*at], dtype=float) + T[:3, 3])

    def along(vector: Iterable[float]) -> Array:
        return np.asarray(T[:3, :3] @ np.array([*vector], dtype=float))

    if isinstance(entity, DxfLine):
        yield Line(point(entity.dxf.start), point(entity.dxf.end))
    elif isinstance(entity, Circle):  # ARC is a subclass
        first, last = 0.0, 360.0
        if isinstance(entity, DxfArc):
            first, last = float(entity.dxf.start_angle), float(entity.dxf.end_angle)
            last = first + ((last - first) % 360.0 or 360.0)
        ocs, radius = entity.ocs(), float(entity.dxf.radius)
        yield Arc(
            point(ocs.to_wcs(entity.dxf.center)),
            along(ocs.to_wcs((radius, 0, 0))),
            along(ocs.to_wcs((0, radius, 0))),
            *np.radians([first, last]).tolist(),
        )
    elif isinstance(entity, Ellipse):
        first, last = float(entity.dxf.start_param), float(entity.dxf.end_param)
        yield Arc(
            point(entity.dxf.center),
            along(entity.dxf.major_axis),
            along(entity.minor_axis),
            first,
            first + ((last - first) % (2 * np.pi) or 2 * np.pi),
        )
    elif isinstance(entity, LWPolyline) or (
        isinstance(entity, Polyline) and (entity.is_2d_polyline or entity.is_3d_polyline)
    ):
        if isinstance(entity, Polyline) and entity.dxf.flags & entity.SPLINE_FIT_VERTICES_ADDED:
            # Its first vertices are the frame of the spline, which is not drawn.
            frame = DXFVertex.SPLINE_FRAME_CONTROL_POINT
            entity.vertices[:] = [v for v in entity.vertices if not v.dxf.flags & frame]
            if not entity.vertices:
                raise DXFError("a splined polyline without its curve")
        for piece in entity.virtual_entities():
            yield from curves_of(piece, T)
    elif isinstance(entity, DxfSpline):
        tool = entity.construction_tool()
        weights = np.array(tool.weights() or np.ones(tool.count))
        points = np.array([point(p) for p in tool.control_points])
        net = np.column_stack([points * weights[:, None], weights])
        spline = BSpline(np.array(tool.knots()), net, tool.order - 1)
        low, high = spline.t[spline.k], spline.t[-spline.k - 1]
        yield Spline(spline, float(low), float(high))


# -----------------------------------------------------------------------------
# Open a DXF, text or binary, with ezdxf, and find what ezdxf repaired and dropped.

logger = logging.getLogger("ezdxf")
DAMAGED = (
    DXFError, ArithmeticError, AssertionError, AttributeError, LookupError, RecursionError,
    TypeError, ValueError, struct.error,
)  # fmt: skip
"""Exceptions that ezdxf and splines raise on bad values and on damaged structures."""
BINARY = b"AutoCAD Binary DXF"
LINES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "LWPOLYLINE", "POLYLINE", "SPLINE", "INSERT")
"""Kinds of entities that are lines to cut; none of them may be lost without a note."""
STANDS = re.compile(
    rf"^[ \t]*0[ \t]*\r?\n[ \t]*({'|'.join(LINES)})[ \t]*\r?$".encode(), re.MULTILINE
)
MARKERS = {b"LWPOLYLINE": b"AcDbPolyline", b"SPLINE": b"AcDbSpline"}
"""Kinds that ezdxf reads only after the marker of their class, which some writers leave out."""
MARKED = re.compile(
    rb"^([ \t]*0[ \t]*\r?\n[ \t]*(%s)[ \t]*\r?\n)(.*?)(?=^[ \t]*0[ \t]*\r?\n[ \t]*[A-Z])"
    % b"|".join(MARKERS),
    re.MULTILINE | re.DOTALL,
)
VERSION = re.compile(rb"(\$ACADVER[ \t]*\r?\n[ \t]*1[ \t]*\r?\n[ \t]*)(AC[0-9]{4})")
HEADER = re.compile(rb"^[ \t]*2[ \t]*\r?\nHEADER[ \t]*\r?\n", re.MULTILINE)
OLDEST, NEWER = b"AC1009", b"AC1015"
"""Version without these kinds, of which ezdxf drops their markers, and a version that has them."""
MOST = 100_000
"""Most curves, spans of splines and other entities in a drawing, blocks wherever inserted."""
TOO_MUCH = (
    f"at most {MOST} are read; save only what is to be cut, as a drawing of its own, or draw "
    "polylines and arcs instead of short lines"
)
MOST_TAGS = 3_000_000
"""Most pairs of a code and a value in a file; ezdxf takes 10 s and 0.5 GB for each million."""
COMMON = frozenset(map(str, (
    5, 6, 8, 48, 60, 62, 67, 92, 100, 102, 160, 284, 310, 330, 347, 348, 360, 370, 390, 410, 420,
    430, 440,
)))  # fmt: skip
"""Codes before the marker, the same for all kinds (DXF reference, common group codes)."""
CONTROL = re.compile(rb"[\0-\x08\v\f\x0e-\x1f\x7f](?!\s*\Z)|\r(?!\n)")
"""A control character in a text file, other than the end of file of DOS at its end."""
UNDERSCORE = re.compile(
    rb"^[ \t]*(?:[1-9][0-9]|1[1-7][0-9]|2[1-3789][0-9]|3[78][0-9]|4[0-69][0-9]|10[1-7][0-9])"
    rb"[ \t]*\r?\n[ \t]*[-+]?[0-9.]+_[0-9_.]+(?:[eE][-+]?[0-9_]+)?[ \t]*\r?$",
    re.MULTILINE,
)
"""A code of numbers, then a number with an underscore."""
DROPPED = re.compile(
    r"(?:Removed|Deleted) (?:[a-zDXF]+ )*([A-Z][A-Z0-9_]+)(?:\(#\w+\))? (?:entity )?(.*)"
)
"""Message of ezdxf when it drops an entity."""


def document_of(content: bytes) -> tuple[Drawing, list[str], Counter[tuple[str, str]]]:
    """Return the drawing, the repaired faults, and the count of lost entities by kind and reason.

    Raises
    ------
    InputError
        A file that is too large to be a part.
    one of DAMAGED
        Not a DXF, or one that cannot be repaired.
    """
    is_binary = content.startswith(BINARY)
    if not (is_binary or b"SECTION" in content[:4096]):
        raise DXFError(f"expected SECTION at its start, got {content[:32]!r}")
    if not is_binary:
        _require_text(content)
    stand = Counter(kind.decode() for kind in STANDS.findall(content))
    if stand.total() > MOST:
        raise InputError(f"holds {stand.total()} lines, {TOO_MUCH}")
    tags = len(content) // 10 if is_binary else content.count(b"\n") // 2
    if tags > MOST_TAGS:
        raise InputError(
            f"holds {tags / 1e6:.1f} million values, at most {MOST_TAGS / 1e6:g} million are read; "
            "save only what is to be cut, as a drawing of its own"
        )
    with _overheard() as logged:
        if is_binary:
            document = Drawing.load(binary_tags_loader(content))
            auditor: Auditor = document.audit()
        else:
            document, auditor = recover.read(BytesIO(_as_ezdxf_reads(content)))
    if wrong := [message for message in logged if message.startswith("recovered invalid")]:
        raise InputError(f"the file is damaged: {wrong[0]}; save the drawing as DXF again")
    faults = [*logged, *(fault.message for fault in (*auditor.fixes, *auditor.errors))]
    faults = [" ".join(fault.split())[:200] for fault in faults]
    return document, faults, _lost(document, stand, faults)


def _require_text(content: bytes) -> None:
    """Raise InputError with the line of a control character, or of what Python takes for a number.

    For `float` and `int`, which ezdxf uses, 1_0 is ten.
    """
    for pattern, what in ((CONTROL, "a control character"), (UNDERSCORE, "a number with _")):
        if (found := pattern.search(content)) is not None:
            line = content.count(b"\n", 0, found.end()) + 1
            raise InputError(
                f"the file is damaged: line {line} has {what}; save the drawing as DXF again"
            )


def _as_ezdxf_reads(content: bytes) -> bytes:
    """Return a file with the markers of its entities, and of the version that these have."""
    marked, count = MARKED.subn(_with_markers, content)
    stated = VERSION.search(content)
    if not count or (stated and stated[2] > OLDEST):
        return marked
    if stated:
        return VERSION.sub(rb"\g<1>" + NEWER, marked, count=1)
    end = b"\r\n" if b"\r\n" in content else b"\n"
    version = end.join([b"  9", b"$ACADVER", b"  1", NEWER, b""])
    if HEADER.search(marked):
        return HEADER.sub(lambda header: header[0] + version, marked, count=1)
    start, stop = ([b"  0", b"SECTION", b"  2", b"HEADER", b""], [b"  0", b"ENDSEC", b""])
    return end.join(start) + version + end.join(stop) + marked


def _with_markers(entity: re.Match[bytes]) -> bytes:
    """Return an entity with the markers of its classes, adding those that are missing."""
    head, kind, body = entity.groups()
    if MARKERS[kind] in body:
        return entity[0]
    lines = body.splitlines(keepends=True)
    pairs = [b"".join(lines[k : k + 2]) for k in range(0, len(lines), 2)]
    codes = [pair.split(b"\n", 1)[0].strip().decode("ascii", "replace") for pair in pairs]
    end = b"\r\n" if head.endswith(b"\r\n") else b"\n"
    own = next((k for k, code in enumerate(codes) if code not in COMMON), len(pairs))
    pairs.insert(own, b"100" + end + MARKERS[kind] + end)
    if b"AcDbEntity" not in body:
        common = codes.index("8") if "8" in codes[:own] else own
        pairs.insert(common, b"100" + end + b"AcDbEntity" + end)
    return head + b"".join(pairs)


def _lost(document: Drawing, stand: Counter[str], faults: list[str]) -> Counter[tuple[str, str]]:
    """Return which lines of the file, `stand` by kind, are not in the drawing."""
    kept = Counter(entity.dxftype() for entity in document.entitydb.values() if entity.is_alive)
    lost: Counter[tuple[str, str]] = Counter()
    for fault in faults:
        dropped = DROPPED.match(fault)
        if dropped and dropped[1] in LINES:
            lost[dropped[1], dropped[2].rstrip(".")] += 1
    for kind, count in stand.items():
        explained = sum(n for (lost_kind, _), n in lost.items() if lost_kind == kind)
        if (missing := count - kept[kind] - explained) > 0:
            lost[kind, "the file is damaged there"] += missing
    return lost


class _Listener(logging.Handler):
    """Keep the messages that are logged."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a message."""
        self.messages.append(record.getMessage())


@contextmanager
def _overheard() -> Iterator[list[str]]:
    """Collect what ezdxf logs about faults, instead of printing it on the terminal."""
    handler = _Listener(logging.WARNING)
    propagates, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield handler.messages
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates


# -----------------------------------------------------------------------------
# Read the drawing.

INSUNITS = {
    1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 9: "mil", 13: "um", 14: "dm",
}  # fmt: skip
"""Units by value of the header variable $INSUNITS."""
COLOURS = {1: "red", 2: "yellow", 3: "green", 4: "cyan", 5: "blue", 6: "magenta", 7: "white"}
"""Names of the first colours of the AutoCAD colour index."""
LOOSE = ("0", "white")
"""Layer and colour of entities outside blocks."""
DEEPEST = 32
"""Deepest nesting of blocks; more means that a block contains itself."""
FLAT = 1e-6
"""How far (mm) a curve may leave the drawing plane, as writers round numbers."""
REQUIRED = {
    "LINE": ("start", "end"),
    "CIRCLE": ("center", "radius"),
    "ARC": ("center", "radius", "start_angle", "end_angle"),
    "ELLIPSE": ("center", "major_axis"),
}
"""Attributes without which an entity is damaged, by its kind."""
NAMES_FRAME = "a drawing frame by the name of its layer or block"
"""Reason to leave out what is one."""
NEVER_CUT = frozenset([
    "TEXT", "MTEXT", "ATTDEF", "ATTRIB", "DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION",
    "LEADER", "MLEADER", "MULTILEADER", "TOLERANCE", "POINT", "VIEWPORT", "IMAGE", "WIPEOUT",
    "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "RAY", "XLINE", "ACAD_TABLE", "LIGHT", "SUN",
    "HATCH", "MPOLYGON",
])  # fmt: skip
"""Kinds of entities that annotate a part and are no lines to cut; others may be."""


def read_dxf(
    path: Path, content: bytes, unit: str | None, gap: float, axis: Array | None = None,
    frame: Choice | None = None,
) -> Part:  # fmt: skip
    """Return the part in a DXF drawing; the tool axis is -z of its plane, or the given `axis`.

    `frame` says what to do with a drawing frame; by default one that its names do not tell is left
    out as what may have to be cut.

    Raises
    ------
    InputError
        Not a DXF file, a damaged one, one without curves, curves that leave the plane, no known
        unit, or no frame to leave out.
    """
    try:
        document, repairs, lost = document_of(content)
        insunits = int(document.header.get("$INSUNITS", 0))
    except InputError:
        raise
    except DAMAGED as error:
        raise InputError(
            f"not a DXF file, or a damaged one ({_reason(error)}); save the drawing as DXF again"
        ) from None
    declared = INSUNITS.get(insunits, "")
    if unit is None and not declared:
        raise InputError(f"$INSUNITS is {insunits}: {NO_UNIT}")
    notes = []
    if unit is None:
        notes.append(f"unit {declared} taken from $INSUNITS, which is only a hint: check it")
    elif declared and declared != unit:
        notes.append(f"unit {unit} as given; $INSUNITS says {declared}")
    if repairs:
        notes.append(f"{len(repairs)} faults of the file repaired, the first: {repairs[0]}")
    scale = UNITS_MM[unit or declared]
    try:
        sheet = _Sheet(document, is_flat=axis is None, cuts_frame=frame == "cut")
        with np.errstate(all="ignore"):  # ezdxf divides by lengths that may be 0
            sheet.add(document.modelspace(), np.diag([scale, scale, scale, 1.0]))
            sheet.require_flat()
            sheet.look_on_paper()
    except InputError:
        raise
    except DAMAGED as error:
        raise InputError(f"damaged ({_reason(error)}); repair it in CAD") from None
    sheet.left_out.update(lost)

    def drawn() -> Part:
        return part_of_strokes(
            path, unit or declared, sheet.strokes, gap=gap, notes=notes, left_out=sheet.summed(),
            axis=axis,
        )  # fmt: skip

    part = drawn()
    if frame != "cut" and sheet.leave_frame_out(part, is_asked=frame is None):
        part = drawn()
    frames = {printable(str(ucs.dxf.name)): _frame(ucs, scale) for ucs in document.ucs}
    return replace(part, frames=frames)


def _size(curve: Curve) -> int:
    """Return how much work a curve is, in lines."""
    return len(curve.breaks()) - 1 if isinstance(curve, Spline) else 1


def _is_wide(entity: DXFGraphic) -> bool:
    """Return whether a polyline has a width: its middle line is not the border that is shown."""
    return isinstance(entity, LWPolyline | Polyline) and bool(entity.has_width)


def _frame(ucs: UCSTableEntry, scale: float) -> Array:
    """Return T_part_frame (4, 4) m of a user coordinate system of a drawing."""
    T = np.array(list(ucs.ucs().matrix.columns()))
    T[:3, 3] *= scale * MM
    return freeze(T)


def _reason(error: Exception) -> str:
    """Return the message of an exception, short enough for a line."""
    return " ".join(str(error).split())[:80] or type(error).__name__


@dataclass(frozen=True, kw_only=True)
class _Layer:
    """A layer: its name, its colour by the index of AutoCAD, and whether it is shown."""

    name: str
    colour: int = 7
    is_frozen: bool = False
    is_off: bool = False

    @cached_property
    def is_frame(self) -> bool:
        """Whether its name is that of a drawing frame."""
        return NAMED.search(self.name) is not None


@dataclass
class _Sheet:
    """Strokes gathered from the entities of a drawing, in mm, by (layer, colour)."""

    document: Drawing
    is_flat: bool = True
    cuts_frame: bool = False
    strokes: dict[Style, list[Stroke]] = field(default_factory=dict)
    left_out: Counter[tuple[str, str]] = field(default_factory=Counter)
    put_aside: Counter[tuple[str, str]] = field(default_factory=Counter)
    count: int = 0
    drawn: list[tuple[Curve, str, str]] = field(default_factory=list)
    texts: list[Array] = field(default_factory=list)
    layers: dict[str, _Layer] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        for layer in self.document.layers:
            name = str(layer.dxf.name)
            self.layers[name.casefold()] = _Layer(
                name=printable(name),
                colour=abs(int(layer.dxf.color)),
                is_frozen=layer.is_frozen(),
                is_off=layer.is_off(),
            )

    def summed(self) -> tuple[LeftOut, ...]:
        """Return what was left out by kind and reason, first what may have been a line to cut."""
        found = [
            LeftOut(
                kind=kind, reason=reason, count=count, may_cut=doubtful and kind not in NEVER_CUT
            )
            for what, doubtful in ((self.left_out, True), (self.put_aside, False))
            for (kind, reason), count in what.items()
        ]
        return tuple(sorted(found, key=lambda one: not one.may_cut))

    def look_on_paper(self) -> None:
        """Count the entities on the sheets for printing, outside the model."""
        for layout in self.document.layouts:
            if not layout.is_modelspace:
                for entity in layout:
                    self.put_aside[entity.dxftype(), f"on the sheet {layout.name}"] += 1

    def leave_frame_out(self, part: Part, *, is_asked: bool) -> bool:
        """Take the strokes of a drawing frame away; return whether there are any.

        If it `is_asked` what to do, they may have been lines to cut, and a rectangle is only taken
        if it has a title block or is around outlines.

        Raises
        ------
        InputError
            No rectangle is around the rest, and none was left out by its name.
        """
        has_islands = is_asked and is_around_islands(part.loops)
        has_lines = any(loop.kind == "open" for loop in part.loops)
        if is_asked and not (self.texts or has_lines or has_islands):
            return False
        found = drawing_frame(self.strokes, self.texts)
        if is_asked and not (found and (found.has_title or has_islands)):
            return False
        if found is None:
            if any(NAMES_FRAME in reason for _, reason in self.put_aside):
                return False
            raise InputError("drawing_frame: no rectangle is around all else; remove drawing_frame")
        what = "around all else" + (", with a title block" if found.has_title else "")
        reason = f"a rectangle {what}: {ASK}" if is_asked else f"the drawing frame, {what}"
        (self.left_out if is_asked else self.put_aside)["LINE", reason] += len(found.strokes)
        for style, strokes in self.strokes.items():
            self.strokes[style] = [
                stroke for k, stroke in enumerate(strokes) if (style, k) not in found.strokes
            ]
        return True

    def require_flat(self) -> None:
        """Raise InputError if a curve reaches too far, or leaves the plane of a flat drawing."""
        measure(curve for curve, _, _ in self.drawn)
        boxes = np.array([curve.bounds() for curve, _, _ in self.drawn]).reshape(-1, 2, 3)
        within = (np.abs(boxes) <= LARGEST).all(axis=(1, 2))
        flat = (boxes[:, 1, 2] - boxes[:, 0, 2] <= FLAT) | (not self.is_flat)
        if (wrong := np.flatnonzero(~(within & flat))).size:
            (_, kind, layer), box = self.drawn[wrong[0]], boxes[wrong[0]]
            if not within[wrong[0]]:
                raise InputError(
                    f"a {kind} on layer {layer} reaches further than {LARGEST / 1e6:g} km; its "
                    "numbers are damaged, or the unit is wrong"
                )
            raise InputError(
                f"a {kind} on layer {layer} leaves the drawing plane, z from {box[0, 2]:g} to "
                f"{box[1, 2]:g} mm; expected a flat drawing: project it to one plane, or "
                f"{GIVE_AXIS}"
            )

    def add(
        self, entities: Iterable[DXFGraphic], T: Array, inside: Style = LOOSE, depth: int = 0
    ) -> None:
        """Add entities; `inside` is the layer and colour of the insertion of their block.

        T (4, 4) maps their coordinates to those of the drawing, mm; it may scale.
        """
        if depth > DEEPEST:
            raise InputError(f"blocks nest deeper than {DEEPEST}: one contains itself; repair it")
        for entity in entities:
            self._counted(1)  # whatever it is: a block may repeat it
            kind = entity.dxftype()
            try:
                self._entity(entity, kind, T, inside, depth)
            except InputError:
                raise
            except DAMAGED as error:
                self.left_out[kind, f"it cannot be read: {_reason(error)}"] += 1

    def _entity(self, entity: DXFGraphic, kind: str, T: Array, inside: Style, depth: int) -> None:
        look = self._look(entity, inside)
        if entity.dxf.get("invisible", 0):
            self.put_aside[kind, "invisible"] += 1
            return
        layer = self._layer(look[0])
        # A block on a layer that is off shows what it has on other layers.
        if layer.is_frozen or (layer.is_off and not isinstance(entity, Insert)):
            self.put_aside[kind, f"on hidden layer {look[0]}"] += 1
            return
        name = str(entity.dxf.name) if isinstance(entity, Insert) else ""
        if not self.cuts_frame and (layer.is_frame or NAMED.search(name)):
            of = name if NAMED.search(name) else look[0]
            self.put_aside[kind, f"{NAMES_FRAME}, {printable(of)}"] += 1
            return
        if isinstance(entity, Insert):
            self.texts += [T[:3, :3] @ [*each.dxf.insert] + T[:3, 3] for each in entity.attribs]
            self._insert(entity, T, look, depth)
            return
        if kind in ("TEXT", "MTEXT"):
            self.texts.append(T[:3, :3] @ [*entity.dxf.insert] + T[:3, 3])
        if missing := [name for name in REQUIRED.get(kind, ()) if not entity.dxf.hasattr(name)]:
            self.left_out[kind, f"its {missing[0]} is missing"] += 1  # ezdxf has a default for it
            return
        curves = list(islice(curves_of(entity, T), MOST + 1))
        if not curves:
            self.left_out[kind, "not a line to cut"] += 1
        self._counted(max(0, sum(map(_size, curves)) - 1))
        if curves and _is_wide(entity):
            self.left_out[kind, "only its width: its middle line is read"] += 1
        for curve in curves:
            if isinstance(curve, Spline):
                curve.bounds()  # fails for a damaged one
            elif not isfinite(curve.end):
                raise DXFError("an angle is not a number")
        if curves:
            self.strokes.setdefault(look, []).append(tuple(curves))
            self.drawn += [(curve, kind, look[0]) for curve in curves]

    def _insert(self, insert: Insert, T: Array, look: Style, depth: int) -> None:
        """Add a block wherever it is inserted, once or in rows and columns."""
        block = insert.block()
        if block is None or block.block is None:
            self.left_out["INSERT", "its block is not in the file"] += 1
            return
        if block.block.is_xref:
            self.left_out["INSERT", "its block is in another file (XREF)"] += 1
            return
        if not (insert.dxf.xscale and insert.dxf.yscale):
            self.left_out["INSERT", "it is scaled by 0"] += 1
            return
        if XClip(insert).has_clipping_path:
            self.left_out["INSERT", "only its clipping: the whole block is read"] += 1
        ocs, own = insert.ocs(), np.array([*insert.matrix44()]).reshape(4, 4).T
        rows = max(insert.dxf.row_count, 1) if insert.dxf.row_spacing else 1
        columns = max(insert.dxf.column_count, 1) if insert.dxf.column_spacing else 1
        if rows * columns > MOST:
            raise InputError(f"a block is inserted {rows * columns} times, {TOO_MUCH}")
        self._counted(rows * columns - 1)
        for row, column in product(range(rows), range(columns)):
            place = Vec3(column * insert.dxf.column_spacing, row * insert.dxf.row_spacing)
            step = np.eye(4)
            step[:3, 3] = ocs.to_wcs(place.rotate_deg(insert.dxf.rotation)).xyz
            self.add(block, T @ step @ own, look, depth + 1)

    def _counted(self, more: int) -> None:
        self.count += more
        if self.count > MOST:
            raise InputError(f"holds more than {MOST} curves and blocks, {TOO_MUCH}")

    def _look(self, entity: DXFGraphic, inside: Style) -> Style:
        own = str(entity.dxf.layer)
        layer = inside[0] if own == "0" else self._layer(own).name
        if entity.dxf.hasattr("true_color"):
            return layer, "#{:02x}{:02x}{:02x}".format(*int2rgb(entity.dxf.true_color))
        index = int(entity.dxf.color)
        if index == BYBLOCK:
            return layer, inside[1]
        if index == BYLAYER:
            index = self._layer(layer).colour
        return layer, COLOURS.get(index, f"aci{index}")

    def _layer(self, name: str) -> _Layer:
        """Return a layer as its table has it, or as it is first used: case does not matter."""
        if (found := self.layers.get(name.casefold())) is None:
            found = self.layers[name.casefold()] = _Layer(name=printable(name))
        return found
