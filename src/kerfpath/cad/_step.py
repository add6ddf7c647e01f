"""Read STEP files: length units, placements, face names, and a clear word for every bad file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from OCP.collections import Sequence_TCollection_AsciiString
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Message import Message
from OCP.Standard import Standard_Failure
from OCP.STEPControl import STEPControl_Reader
from OCP.StepRepr import StepRepr_RepresentationItem
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from kerfpath.cad._part import Part, part_of
from kerfpath.errors import InputError

__all__ = ["read_step"]

UNITS_MM = {
    "um": 1e-3,
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "km": 1e6,
    "mil": 0.0254,
    "in": 25.4,
    "ft": 304.8,
}
"""Length units by the name that users give, in mm."""

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


def read_step(path: str | Path, unit: str | None = None) -> Part:
    """Return the part that a STEP file holds, its placements applied.

    Parameters
    ----------
    path : str or Path
        The STEP file (AP203, AP214 or AP242).
    unit : str, optional
        What the numbers in the file mean, instead of what its header says: um, mm, cm, dm, m, km,
        mil, in or ft.

    Raises
    ------
    InputError
        No such file, not a STEP file, a truncated one, one without faces, or one whose header
        declares no single unit while `unit` is not given.
    """
    path = Path(path)
    if unit is not None and unit not in UNITS_MM:
        raise InputError(f"unit: expected one of {', '.join(UNITS_MM)}, got {unit!r}")
    _require_whole(path)
    try:
        with _quiet():
            return _read(path, unit)
    except (Standard_Failure, RuntimeError, UnicodeDecodeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"{path}: the geometry cannot be read ({reason}); export the part again"
        ) from None


def _require_whole(path: Path) -> None:
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; expected a STEP file (.step, .stp)") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; expected a STEP file (.step, .stp)") from None
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); expected a STEP file"
        ) from None
    if not text.strip():
        raise InputError(f"{path}: the file is empty; expected a STEP file")
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


def _read(path: Path, unit: str | None) -> Part:
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
    if unit is not None:
        # OCCT scales by the header's unit over this one: what it takes for mm is then `unit`.
        reader.SetSystemLengthUnit(UNITS_MM.get(header, 1.0) / UNITS_MM[unit])
    reader.TransferRoots()
    shape = reader.OneShape()
    faces: list[tuple[str, TopoDS_Face]] = []
    if shape is not None and not shape.IsNull():
        explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
        while explorer.More():
            faces.append((_name(reader, explorer.Current()), TopoDS.Face(explorer.Current())))
            explorer.Next()
    if not faces:
        raise InputError(f"{path}: the file holds no face; export the part as a solid or a surface")
    try:
        return part_of(path, header, shape, faces)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


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


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OCCT's own messages off the terminal."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    messenger.ChangePrinters().Clear()
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)
