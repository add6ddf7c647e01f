"""Read STEP files: length units, placements, face names, and a clear word for every bad file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from OCP.collections import Sequence_TCollection_AsciiString
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.STEPControl import STEPControl_Reader
from OCP.StepRepr import StepRepr_NextAssemblyUsageOccurrence, StepRepr_RepresentationItem
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Iterator, TopoDS_Shape

from kerfpath.cad._faces import NamedFace, unique
from kerfpath.cad._part import Part
from kerfpath.cad._shape import occt, part_of_shape
from kerfpath.cad._units import UNITS_MM
from kerfpath.errors import InputError

__all__ = ["read_step"]

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
"""The same units as STEP headers spell them, in lower case."""

UNNAMED = ("", "none")
"""What CAD systems write for a face without a name, in lower case."""


def read_step(path: Path, content: bytes, unit: str | None, gap: float) -> Part:
    """Return the part that a STEP file (AP203, AP214, AP242) holds, its placements applied.

    Raises
    ------
    InputError
        Not a STEP file, a truncated or damaged one, one without faces, or one whose header declares
        no single unit while `unit` is not given.
    """
    _require_whole(path, content)
    with occt(path):
        return _read(path, unit, gap)


def _require_whole(path: Path, text: bytes) -> None:
    if b"ISO-10303-21;" not in text[:1024]:
        raise InputError(
            f"{path}: not a STEP file: expected ISO-10303-21; in its first line, "
            f"got {text[:32].decode('ascii', 'replace')!r}; export the part as STEP"
        )
    if b"END-ISO-10303-21;" not in text:
        raise InputError(
            f"{path}: the file is truncated: expected END-ISO-10303-21; at its end, "
            f"got {text[-32:].decode('ascii', 'replace')!r}; copy or export it again"
        )


def _read(path: Path, unit: str | None, gap: float) -> Part:
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError(f"{path}: the file cannot be parsed; export the part as STEP again")
    _require_sound(path, reader)
    header = _header_unit(reader)
    if unit is None and header not in UNITS_MM:
        raise InputError(
            f"{path}: the header declares {header or 'no length unit'}, expected one of "
            f"{', '.join(UNITS_MM)}; say what the numbers mean with unit="
        )
    notes = []
    if unit is not None and unit != header:
        # OCCT scales by the header's unit over this one: what it takes for mm is then `unit`.
        reader.SetSystemLengthUnit(UNITS_MM.get(header, 1.0) / UNITS_MM[unit])
        notes.append(f"unit {unit} as asked; the header says {header or 'nothing'}")
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape is None or shape.IsNull():
        raise InputError(f"{path}: the file holds no face; export the part as a solid or a surface")
    return part_of_shape(
        path, unit or header, shape, list(_faces(reader, shape)), gap=gap, notes=notes
    )


def _faces(reader: STEPControl_Reader, shape: TopoDS_Shape) -> Iterator[NamedFace]:
    """Yield every face with its name; in an assembly with that of its component, numbered."""
    components: list[tuple[str, list[TopoDS_Shape]]] = []

    def walk(shape: TopoDS_Shape, component: str, into: list[TopoDS_Shape]) -> None:
        children = TopoDS_Iterator(shape)
        while children.More():
            child = children.Value()
            entity = reader.WS().TransferReader().EntityFromShapeResult(child, -1)
            if child.ShapeType() == TopAbs_ShapeEnum.TopAbs_FACE:
                into.append(child)
            elif isinstance(entity, StepRepr_NextAssemblyUsageOccurrence):
                components.append((_product(entity), []))
                walk(child, *components[-1])
            else:
                walk(child, component, into)
            children.Next()

    components.append(("", []))
    if shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_FACE:
        components[0][1].append(shape)
    walk(shape, *components[0])
    components = [(name, faces) for name, faces in components if faces]
    names = unique([name for name, _ in components])
    for name, (_, faces) in zip(names, components, strict=True):
        component = name if len(components) > 1 else ""
        for face in faces:
            yield NamedFace(face=TopoDS.Face(face), name=_name(reader, face), component=component)


def _product(used: StepRepr_NextAssemblyUsageOccurrence) -> str:
    """Return the name of the product that an assembly uses there."""
    definition = used.RelatedProductDefinition()
    formation = None if definition is None else definition.Formation()
    product = None if formation is None else formation.OfProduct()
    name = None if product is None else product.Name()
    return (name.ToCString().strip() if name is not None else "") or "component"


def _require_sound(path: Path, reader: STEPControl_Reader) -> None:
    """Refuse broken syntax and broken geometry, on which OCCT's transfer may crash the process."""
    model, checks = reader.WS().Model(), reader.WS().ModelCheckList()
    checks.Start()
    while checks.More():
        check, number = checks.Value(), checks.Number()
        checks.Next()
        if not check.HasFailed():
            continue
        where = ""
        if number:
            package, _, entity = type(model.Value(number)).__name__.partition("_")
            if package not in ("StepGeom", "StepShape"):
                continue
            where = f"{entity}: "
        reason = " ".join(check.CFail(1).split())
        raise InputError(f"{path}: the file is damaged ({where}{reason}); copy or export it again")


def _header_unit(reader: STEPControl_Reader) -> str:
    """Return the header's length unit, "" if there is none, or several joined by "and"."""
    lengths, angles, solid_angles = (Sequence_TCollection_AsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    names = dict.fromkeys(length.ToCString().lower() for length in lengths)
    return " and ".join(HEADER_UNITS.get(name, name) for name in names)


def _name(reader: STEPControl_Reader, face: TopoDS_Shape) -> str:
    """Return the name of the entity that `face` was read from, "" if it has none."""
    entity = reader.WS().TransferReader().EntityFromShapeResult(face, -1)
    if not isinstance(entity, StepRepr_RepresentationItem) or entity.Name() is None:
        return ""
    name = entity.Name().ToCString().strip()
    return "" if name.lower() in UNNAMED else name
