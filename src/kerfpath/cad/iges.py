"""Read IGES files: loose faces, their unit and names, and a clear error for every bad file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from itertools import groupby, zip_longest
from pathlib import Path

from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.gp import gp_Pnt, gp_Trsf
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.IGESControl import IGESControl_Controller, IGESControl_Reader
from OCP.IGESData import IGESData_IGESEntity
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Shape

from kerfpath.cad.left_out import LOST, LeftOut, counted, kind_of
from kerfpath.cad.sewing import sewn_shape
from kerfpath.cad.shape import NamedFace, NamedShape, failures, list_shapes, occt, require_few_faces
from kerfpath.cad.units import GIVE_UNIT, UNITS_MM
from kerfpath.errors import InputError, printable

FLAGS = {1: "in", 2: "mm", 4: "ft", 6: "m", 7: "km", 8: "mil", 9: "um", 10: "cm"}
"""Units by the flag of the global section (IGES 5.3, table 2)."""
GLOBAL = "Global Section"
"""First words of OCCT's messages on the global section, which have the number of the whole file."""
FACES = (143, 144, 510)
"""Types of entities that become faces: bounded and trimmed surfaces, and faces of solids."""
SAID = ("IGESDimen", "IGESDraw", "IGESGraph", "IGESDefs", "IGESAppli")
"""Prefixes of OCCT's classes for annotations of a part."""
WIDTH = 80
"""Columns of a line; the 73rd names its section, the rest are its number in it."""


def read_iges(path: Path, unit: str | None, gap: float) -> NamedShape:
    """Return the content of an IGES file, with its loose faces sewn together within `gap` (m).

    Raises
    ------
    InputError
        Not an IGES file, a truncated or damaged one, one without faces, or one whose header
        declares no known unit while `unit` is not given. The message lacks the file's name.
    """
    _require_whole(path.read_bytes())
    with occt():
        return _read(path, unit, gap)


def _require_whole(content: bytes) -> None:
    lines = [line for line in content.splitlines() if line.strip()]
    marks = [line[72:WIDTH].decode("ascii", "replace").replace(" ", "0") for line in lines]
    if marks[0][:1] != "S":
        raise InputError(
            f"not an IGES file: expected S in column 73 of its first line, "
            f"got {marks[0][:1]!r}; export the part as IGES"
        )
    last = lines[-1].decode("ascii", "replace")
    sizes = re.match(r"S\s*(\d+)G\s*(\d+)D\s*(\d+)P\s*(\d+)", last)
    if marks[-1][:1] != "T" or sizes is None:
        raise InputError(
            f"the file is truncated: expected a line T at its end, got {last[:32]!r}; "
            "copy or export it again"
        )
    # OCCT may crash on lines that are missing or in another order.
    counts = zip("SGDPT", (*map(int, sizes.groups()), 1), strict=True)
    due = (f"{section}{k:07}" for section, count in counts for k in range(1, count + 1))
    for line, (want, got) in enumerate(zip_longest(due, marks), start=1):
        if got != want:
            raise InputError(
                f"the file is damaged: expected {want} in columns 73 to {WIDTH} of line "
                f"{line}, got {got or 'nothing'}; copy or export it again"
            )

    # Columns 65 to 72 of the parameters hold the directory entry that each line belongs to.
    owners = [line[64:72].strip() for line in lines if line[72:73] == b"P"]
    entries = [int(owner) if owner.isdigit() else 0 for owner, _ in groupby(owners)]
    known = range(1, int(sizes[3]) + 1, 2)
    if len(set(entries)) < len(entries) or not all(entry in known for entry in entries):
        raise InputError(
            "the file is damaged: parameters of section P belong to no entity, or are "
            "scattered; copy or export it again"
        )
    _require_numbers(lines)


# -----------------------------------------------------------------------------
# Numbers: OCCT takes 0 for any that it does not understand.

TYPES = re.compile(rb"[ 0+]*(?:[15]\d\d|[34]08|430)[ .]*")
"""Types of entities that are a shape or place one."""
USED = 14
"""Parameters of the global section up to the flag of the unit, the last that is used."""
NUMBER = rb" *+(?:[-+]?+(?:\d++\.?+\d*+|\.\d++)(?:[EeDd][-+]?+\d++)?+)?+ *+"
"""A number, or blanks in place of one that has its default."""
STRING = re.compile(rb" *(\d{1,5})H")
"""How a text begins: its length in bytes."""


def _require_numbers(lines: list[bytes]) -> None:
    """Check the numbers of the directory, and those of entities that are a shape or place one.

    Raises
    ------
    InputError
        One is no number.
    """
    of = {s: [k for k, line in enumerate(lines) if line[72:73] == s] for s in (b"G", b"D", b"P")}
    for row, k in enumerate(of[b"D"]):
        fields = lines[k][:40] if row % 2 else lines[k][:72]  # then reserved ones, and a label
        if (odd := re.search(rb"[^-+ \d]+", fields)) is not None:
            raise _no_number(odd[0], k)
    first = of[b"G"][0] if of[b"G"] else 0
    header = b"".join(lines[k][:72] for k in of[b"G"])
    comma, end = _delimiters(header)
    for number, (at, word) in enumerate(_words(header, comma, end)):
        if number < USED and not re.fullmatch(NUMBER, word):
            raise _no_number(word, first + at // 72)
    numbers = re.compile(rb"(?:%s%s)*+%s%s" % (NUMBER, comma, NUMBER, end))
    for _, rows in groupby(of[b"P"], lambda k: lines[k][64:72].strip()):
        first, *others = rows
        text = b"".join(lines[k][:64].ljust(64) for k in (first, *others))
        if numbers.match(text):
            continue
        for number, (at, word) in enumerate(_words(text, comma, end)):
            if not re.fullmatch(NUMBER, word):
                raise _no_number(word, first + at // 64)
            if number == 0 and not TYPES.fullmatch(word):
                break


def _words(text: bytes, comma: bytes, end: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield where each parameter is, and what it is; nothing for a text of the length it says."""
    stop, at = re.compile(rb"%s|%s" % (comma, end)), 0
    while at < len(text):
        string = STRING.match(text, at)
        first = at if string is None else string.end() + int(string[1])
        found = stop.search(text, first)
        last = len(text) if found is None else found.start()
        is_text = string is not None and not text[first:last].strip()
        yield at, b"" if is_text else text[at:last]
        if re.match(end, text[last : last + 1]):
            return
        at = last + 1


def _delimiters(content: bytes) -> tuple[bytes, bytes]:
    """Return what section G says is between parameters and after the last, as patterns."""
    said = re.match(rb" *(?:1H(.))?. *(?:1H(.))?", content, re.DOTALL)
    comma, end = (b"", b"") if said is None else said.groups(b"")
    return re.escape(comma or b","), re.escape(end or b";")


def _no_number(found: bytes, line: int) -> InputError:
    return InputError(
        f"the file is damaged: expected a number in line {line + 1}, got "
        f"{found.strip().decode('utf-8', 'replace')!r}; copy or export it again"
    )


# -----------------------------------------------------------------------------
# Read the file.


def _read(path: Path, unit: str | None, gap: float) -> NamedShape:
    IGESControl_Controller.Init_s()
    reader = IGESControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise InputError("the file cannot be parsed; export the part as IGES again")
    left_out = _damaged(reader)
    flag = reader.IGESModel().GlobalSection().UnitFlag()
    header = FLAGS.get(flag, "")
    if unit is None and not header:
        raise InputError(f"the header's unit flag is {flag}, which is not known; {GIVE_UNIT}")
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape is not None:
        require_few_faces(shape)
    left_out += _lost_faces(reader)
    loose = [] if shape is None else list_shapes(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    has_names = any(entity.HasName() for entity in _faces(reader))
    faces = [
        NamedFace(face=TopoDS.Face(face), name=_name(reader, face) if has_names else "")
        for face in loose
    ]
    notes = []
    if unit is not None and unit != header:
        # OCCT has converted the header's unit to mm.
        move = gp_Trsf()
        move.SetScale(gp_Pnt(), UNITS_MM[unit] / UNITS_MM.get(header, 1.0))
        moved = BRepBuilderAPI_Transform(shape, move, True)
        shape = moved.Shape()
        faces = [
            NamedFace(face=TopoDS.Face(moved.ModifiedShape(named.face)), name=named.name)
            for named in faces
        ]
        notes.append(f"unit {unit} as given; the header says {header or 'nothing'}")
    return sewn_shape(unit or header, shape, faces, gap=gap, notes=notes, left_out=left_out)


def _damaged(reader: IGESControl_Reader) -> list[LeftOut]:
    """Return the entities that fail OCCT's checks.

    Faults in the global section are ignored: only its unit is used, and odd dates, names and sizes
    say nothing about the part.

    Raises
    ------
    InputError
        The whole file fails them.
    """
    found: Counter[tuple[str, str, bool]] = Counter()
    for number, reason in failures(reader.WS().ModelCheckList()):
        if reason.startswith(GLOBAL):
            continue
        if not number:
            raise InputError(f"the file is damaged ({reason}); copy or export it again")
        entity = reader.IGESModel().Entity(number)
        may_cut = not type(entity).__name__.startswith(SAID)
        found[kind_of(entity), f"damaged: {reason}", may_cut] += 1
    return counted(found)


def _faces(reader: IGESControl_Reader) -> Iterator[IGESData_IGESEntity]:
    """Yield the entities that become faces."""
    model = reader.IGESModel()
    for number in range(1, model.NbEntities() + 1):
        entity = model.Entity(number)
        if entity.TypeNumber() in FACES:
            yield entity


def _lost_faces(reader: IGESControl_Reader) -> list[LeftOut]:
    """Return the faces of the file that OCCT made no shape from."""
    process = reader.WS().TransferReader().TransientProcess()
    made = {
        process.Mapped(number)
        for number in range(1, process.NbMapped() + 1)
        if process.MapItem(number) is not None and process.MapItem(number).HasResult()
    }
    found: Counter[tuple[str, str, bool]] = Counter()
    for entity in _faces(reader):
        if entity not in made:
            found[kind_of(entity), LOST, True] += 1
    return counted(found)


def _name(reader: IGESControl_Reader, face: TopoDS_Shape) -> str:
    """Return the name of the entity that `face` was read from, "" if it has none."""
    entity = reader.WS().TransferReader().EntityFromShapeResult(face, -1)
    if not isinstance(entity, IGESData_IGESEntity) or not entity.HasName():
        return ""
    name = entity.NameValue()
    return "" if name is None else printable(str(name.ToCString()).strip())
