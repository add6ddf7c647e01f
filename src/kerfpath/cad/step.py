"""Read STEP files: length units, placements, face names, and a clear error for every bad file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from OCP.collections import Sequence_TCollection_AsciiString
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color
from OCP.StepBasic import StepBasic_ProductDefinition
from OCP.STEPConstruct import STEPConstruct_Styles
from OCP.STEPControl import STEPControl_Reader
from OCP.StepVisual import (
    StepVisual_Colour,
    StepVisual_PresentationLayerAssignment,
    StepVisual_StyledItem,
    StepVisual_SurfaceSideStyle,
)
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Shape

from kerfpath.cad.left_out import nothing_drawn
from kerfpath.cad.sewing import sewn_shape
from kerfpath.cad.shape import (
    NamedFace,
    NamedShape,
    children,
    occt,
    require_few_faces,
    unique,
)
from kerfpath.cad.step_model import (
    Entities,
    Origins,
    damaged,
    lost_faces,
    name_of,
    require_drawable,
    step_frames,
)
from kerfpath.cad.units import GIVE_UNIT, UNITS_MM
from kerfpath.effort import uncollected
from kerfpath.errors import InputError, printable

# -----------------------------------------------------------------------------
# Colours and layers in STEP files, by entity.

COLOURS = {
    "#FF0000": "red",
    "#FFFF00": "yellow",
    "#00FF00": "green",
    "#00FFFF": "cyan",
    "#0000FF": "blue",
    "#FF00FF": "magenta",
    "#FFFFFF": "white",
}
"""Colours that have names in DXF drawings, too."""


def styles_in(entities: Entities) -> tuple[dict[object, str], dict[object, str]]:
    """Return the layers and the colours of entities.

    OCCT always returns the same object for an entity, as long as one of these mappings holds it.
    """
    layers: dict[object, str] = {}
    colours: dict[object, str] = {}
    for layer in entities.of(StepVisual_PresentationLayerAssignment):
        name = layer.Name()
        for k in range(1, layer.NbAssignedItems() + 1):
            layers[layer.AssignedItemsValue(k).Value()] = (
                "" if name is None else printable(name.ToCString().strip())
            )
    for styled in entities.of(StepVisual_StyledItem):
        for colour in _fills(styled):
            colours[styled.Item()] = _named(colour)
    return layers, colours


def _fills(styled: StepVisual_StyledItem) -> Iterator[StepVisual_Colour]:
    """Yield the colours that a style fills a surface with."""
    for i in range(1, styled.NbStyles() + 1):
        style = styled.StylesValue(i)
        for j in range(1, style.NbStyles() + 1):
            usage = style.StylesValue(j).SurfaceStyleUsage()
            side = None if usage is None else usage.Style()
            if side is not None:
                yield from _areas(side)


def _areas(side: StepVisual_SurfaceSideStyle) -> Iterator[StepVisual_Colour]:
    for i in range(1, side.NbStyles() + 1):
        area = side.StylesValue(i).SurfaceStyleFillArea()
        fill = None if area is None else area.FillArea()
        for j in range(1, 1 + (0 if fill is None else fill.NbFillStyles())):
            colour = fill.FillStylesValue(j).FillAreaStyleColour()
            if colour is not None and colour.FillColour() is not None:
                yield colour.FillColour()


def _named(colour: StepVisual_Colour) -> str:
    """Return a colour's name, or #rrggbb; "" if it is not known."""
    known = Quantity_Color()
    if not STEPConstruct_Styles.DecodeColor_s(colour, known):
        return ""
    code = Quantity_Color.ColorToHex_s(known).ToCString()
    return COLOURS.get(code, code.lower())


# -----------------------------------------------------------------------------
# The grammar of STEP files (ISO 10303-21): faults that OCCT does not explain.

BLANKS = re.compile(rb"'[^']*'|/\*.*?\*/|\s+", re.DOTALL)
SECTION = re.compile(rb";DATA(?:\([^;]*\))?;(.*?)ENDSEC;", re.DOTALL | re.IGNORECASE)
NUMBER = rb"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?"
ITEM = rb"(?:\$++|\*|#\d++|%s|\.\w++\.|\"[0-9A-Fa-f]*+\")" % NUMBER
LIST = re.compile(rb"!?(?:(?<!\w)[A-Za-z_]\w*+)?\((?:%s(?:,%s)*+)?\)" % (ITEM, ITEM))
"""A list without inner lists; with a type in front of it, an entity."""
ENTITY = re.compile(rb"#\d+=\$+")
DEEPEST = 32
"""Deepest nesting of lists; files have about six levels."""
LARGEST_NUMBER = 2**31 - 1
"""Largest number of an entity: OCCT keeps them in 32 bits."""


def require_grammar(content: bytes) -> None:
    """Check the grammar of a STEP file.

    Raises
    ------
    InputError
        No data, a statement that is no entity, a number out of range or used twice, a reference to
        a missing entity.
    """
    plain = BLANKS.sub(lambda found: b"$" if found[0][:1] == b"'" else b"", content)
    data = b"".join(SECTION.findall(plain))
    if not data:
        raise InputError("the file cannot be parsed: it has no DATA; export the part as STEP again")
    # From the innermost lists on, each becomes one value, until every entity reads #1=$.
    reduced, count, depth = data, 1, 0
    while count and depth < DEEPEST:
        reduced, count = LIST.subn(b"$", reduced)
        depth += 1
    for statement in reduced.split(b";")[:-1]:
        if not ENTITY.fullmatch(statement):
            raise _damaged(f"{_line(content, statement)}: Incorrect syntax")
    made = Counter(re.findall(rb"#0*(\d+)=", data))
    number, times = made.most_common(1)[0]
    if times > 1:
        raise _damaged(f"#{number.decode()} is defined {times} times")
    largest = max(made, key=_size)
    if _size(largest) > _size(b"%d" % LARGEST_NUMBER):
        raise _damaged(f"#{largest.decode()} is more than {LARGEST_NUMBER}")
    if missing := set(re.findall(rb"#0*(\d+)(?![\d=])", data)) - made.keys():
        raise _damaged(f"Unresolved Reference to #{min(missing, key=_size).decode()}")


def _size(digits: bytes) -> tuple[int, bytes]:
    """Return what orders numbers, of more digits even than Python converts."""
    return len(digits), digits


def _line(content: bytes, statement: bytes) -> str:
    """Return the line of the entity of a statement, or how the statement begins."""
    number = re.match(rb"#\d+", statement)
    place = number and re.search(number[0] + rb"\s*=", content)
    if not place:
        return f"at {statement[:32].decode('ascii', 'replace')!r}"
    line = content.count(b"\n", 0, place.start()) + 1
    return f"Line {line}"


def _damaged(reason: str) -> InputError:
    return InputError(f"the file is damaged ({reason}); copy or export it again")


# -----------------------------------------------------------------------------
# Read the file.

HEADER_UNITS = {
    "micrometre": "um",
    "millimetre": "mm",
    "centimetre": "cm",
    "decimetre": "dm",
    "metre": "m",
    "kilometre": "km",
    "mil": "mil",
    "inch": "in",
    "foot": "ft",
}
"""Units by their names in STEP headers, in lower case."""

STARTS = re.compile(rb"#\d+\s*=")
"""Start of an entity."""


def read_step(path: Path, unit: str | None, gap: float) -> NamedShape:
    """Return the content of a STEP file (AP203, AP214, AP242), with its placements applied.

    Raises
    ------
    InputError
        Not a STEP file, a truncated or damaged one, one without faces, or one whose header declares
        no single unit while `unit` is not given. The message lacks the name of the file.
    """
    content = path.read_bytes()
    _require_whole(content)
    with occt(), uncollected():
        return _read(path, content, unit, gap)


def _require_whole(text: bytes) -> None:
    if b"ISO-10303-21;" not in text[:1024]:
        raise InputError(
            f"not a STEP file: expected ISO-10303-21; in its first line, "
            f"got {text[:32].decode('ascii', 'replace')!r}; export the part as STEP"
        )
    if b"END-ISO-10303-21;" not in text:
        raise InputError(
            f"the file is truncated: expected END-ISO-10303-21; at its end, "
            f"got {text[-32:].decode('ascii', 'replace')!r}; copy or export it again"
        )


def _read(path: Path, content: bytes, unit: str | None, gap: float) -> NamedShape:
    reader = STEPControl_Reader()
    # Otherwise OCCT moves the part by a coordinate system that is listed with its solids.
    Interface_Static.SetIVal_s("read.step.root.transformation", 0)
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError("the file cannot be parsed; export the part as STEP again")
    model = reader.WS().Model()
    if model.NbEntities() != len(STARTS.findall(content)):
        require_grammar(content)  # reports what OCCT has skipped, if anything
    del content
    entities = Entities(model)
    left_out, has_styles = damaged(reader)
    header = _header_unit(reader)
    if unit is None and header not in UNITS_MM:
        raise InputError(
            f"the header declares {header or 'no length unit'}, which is not known; {GIVE_UNIT}"
        )
    require_drawable(entities, UNITS_MM[unit or header])
    notes = [] if has_styles else ["colours and layers are damaged and not read"]
    if unit is not None and unit != header:
        # OCCT scales by the header's unit divided by this one, so its mm are `unit` then.
        reader.SetSystemLengthUnit(UNITS_MM.get(header, 1.0) / UNITS_MM[unit])
        notes.append(f"unit {unit} as given; the header says {header or 'nothing'}")
    reader.TransferRoots()
    shape = reader.OneShape()
    left_out += lost_faces(reader, entities)
    if shape is None or shape.IsNull():
        raise nothing_drawn(left_out)
    require_few_faces(shape)
    styles = styles_in(entities) if has_styles else ({}, {})
    faces = list(_faces(Origins(reader, entities), shape, *styles))
    drawn = sewn_shape(unit or header, shape, faces, gap=gap, notes=notes, left_out=left_out)
    return replace(drawn, frames=step_frames(entities, UNITS_MM[unit or header]))


def _faces(
    origins: Origins,
    shape: TopoDS_Shape,
    layers: Mapping[object, str],
    colours: Mapping[object, str],
) -> Iterator[NamedFace]:
    """Yield every face with its name and, in an assembly, the numbered name of its component.

    A face has its own layer and colour, or else those of its shell, solid or component.
    """
    components: list[tuple[str, list[NamedFace]]] = [("", [])]

    def walk(shape: TopoDS_Shape, into: list[NamedFace], layer: str, colour: str) -> None:
        entity = origins.of(shape)
        layer, colour = layers.get(entity, layer), colours.get(entity, colour)
        if shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_FACE:
            face, name = TopoDS.Face(shape), name_of(entity)
            into.append(NamedFace(face=face, name=name, layer=layer, colour=colour))
            return
        if (product := origins.product_of(shape)) is not None:
            into = []
            components.append((_product(product), into))
        for child in children(shape):
            walk(child, into, layer, colour)

    walk(shape, components[0][1], "", "")
    components = [(name, faces) for name, faces in components if faces]
    names = unique([name for name, _ in components])
    for name, (_, faces) in zip(names, components, strict=True):
        for face in faces:
            yield replace(face, component=name if len(components) > 1 else "")


def _product(definition: StepBasic_ProductDefinition) -> str:
    """Return the name of a product that an assembly uses."""
    formation = definition.Formation()
    product = None if formation is None else formation.OfProduct()
    name = None if product is None else product.Name()
    return printable(name.ToCString().strip() if name is not None else "") or "component"


def _header_unit(reader: STEPControl_Reader) -> str:
    """Return the header's length unit, "" if there is none, or several joined by "and"."""
    lengths, angles, solid_angles = (Sequence_TCollection_AsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    names = dict.fromkeys(length.ToCString().lower() for length in lengths)
    return " and ".join(HEADER_UNITS.get(name, name) for name in names)
