"""Cut charts of other programs: files of QtPlasmaC, tables (CSV), libraries of LightBurn.

They become the text of a chart, with notes on what they lack and on what was left out.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from pydantic import ValidationError
from python_calamine import CalamineError, CalamineWorkbook

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.isolated import call_apart
from kerfpath.job.format import ChartFile, RowTable, toml_lines
from kerfpath.job.format.toml_file import decoded, require_glyphs
from kerfpath.text import NOT_TEXT, named

MOST_BYTES = 10_000_000
"""Size of the largest file that is converted."""
INCH = 25.4
USEFUL = (
    "gas",
    "kerf_mm",
    "lead_in_mm",
    "stand_off_mm",
    "power_w",
    "pressure_bar",
    "nozzle_mm",
    "focus_mm",
    "pierce",
)
"""Keys whose absence from all rows is noted."""
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d{1,3})?", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Converted:
    """Rows of a foreign chart by the keys of a chart, where each is from, and notes."""

    source: str
    rows: list[dict[str, Any]] = field(default_factory=list)
    places: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    __repr__ = short_repr

    def add(self, place: str, row: Mapping[str, Any]) -> None:
        """Add a row; values that are None are left out."""
        self.rows.append({key: value for key, value in row.items() if value is not None})
        self.places.append(place)


def read_foreign(
    file: Path,
    *,
    columns: Sequence[str] = (),
    sheet: str | None = None,
    unit: str | None = None,
    said: Mapping[str, str | float | None] | None = None,
) -> tuple[str, tuple[str, ...]]:
    """Return the text of a chart with the rows of a foreign one, and notes for its reader.

    Parameters
    ----------
    file : Path
        A QtPlasmaC file (.cfg), a table (.csv, .xlsx, .xls, .ods) or a library of LightBurn (.clb).
    columns : sequence of str
        For a table: COLUMN=KEY, the key of a chart that a column has.
    sheet : str, optional
        For a spreadsheet: the name of the sheet; needed if there are several with rows.
    unit : {"mm", "inch"}, optional
        For a QtPlasmaC file: the unit of the machine, which the file does not say.
    said : mapping
        Material, thickness_mm and gas of rows that do not say them.

    Raises
    ------
    InputError
        The file cannot be read, or a row is not that of a chart; the message names both.
    """
    usual = {key: value for key, value in (said or {}).items() if value is not None}
    kind = file.suffix.lower()
    if kind not in (".cfg", ".csv", ".clb", *SPREADSHEETS):
        raise InputError(
            f"{file}: expected a chart of QtPlasmaC (.cfg), a table (.csv, "
            f"{', '.join(SPREADSHEETS)}) or a library of LightBurn (.clb), got "
            f"{kind or 'no suffix'}; name such a file"
        )
    is_table = kind == ".csv" or kind in SPREADSHEETS
    if columns and not is_table:
        raise InputError(f"{file}: expected a table with --map, got {kind}; remove --map")
    if sheet is not None and kind not in SPREADSHEETS:
        raise InputError(f"{file}: expected a spreadsheet with --sheet, got {kind}; remove --sheet")
    if unit is not None and kind != ".cfg":
        said_by = "its columns say their units" if is_table else "its units are known"
        raise InputError(f"{file}: expected no --unit, as {said_by}, got {unit}; remove it")
    if kind in SPREADSHEETS:
        made = _of_table(file, _spreadsheet(file, sheet), columns, usual, decimal_comma=True)
    elif kind == ".csv":
        table, delimiter = _csv(file, _text(file))
        made = _of_table(file, table, columns, usual, decimal_comma=delimiter != ",")
    elif kind == ".cfg":
        made = _of_qtplasmac(file, _text(file), unit, usual)
    else:
        made = _of_lightburn(file, _text(file), usual)
    if not made.rows:
        raise InputError(f"{file}: expected rows to convert, got none; {'; '.join(made.notes)}")
    chart = _checked(file, made)
    lacks = [key for key in USEFUL if not any(key in row for row in made.rows)]
    notes = [*made.notes, *([f"no row has {', '.join(lacks)}; add what you know"] if lacks else [])]
    return chart, tuple(notes)


def chart_text(source: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the text of a chart with these rows, by the keys of a chart."""
    return toml_lines({"source": source}) + "".join(f"\n[[row]]\n{toml_lines(r)}" for r in rows)


def _checked(file: Path, made: Converted) -> str:
    """Return the text of the chart, or raise InputError at the row that is none."""
    text = chart_text(made.source, made.rows)
    try:
        ChartFile.model_validate(tomllib.loads(text))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        context, loc = first.get("ctx", {}), [*first["loc"], *first.get("ctx", {}).get("where", ())]
        number = next((step for step in loc if isinstance(step, int)), 0)
        key = ".".join(step for step in loc if isinstance(step, str) and step != "row")
        known = RowTable.model_fields.get(key.partition(".")[0])
        expected = context.get("expected") or (known.description if known else None)
        if "expected" in context:
            said = f"expected {expected}, got {context['got']}; {context['remedy']}"
        elif first["type"] == "missing":
            said = f"expected {expected}, got nothing; say it with --{key.replace('_', '-')}"
        else:
            got = str(first["input"])[:60]
            said = f"expected {expected or 'another value'}, got {got}; correct it in the file"
        place = made.places[number] if number < len(made.places) else "the file"
        raise InputError(f"{file}: {place}: {key}: {said}") from None
    return text


def _bytes(file: Path) -> bytes:
    try:
        if not file.is_file():
            why = "it is not a file" if file.exists() else "no such file"
            raise InputError(f"{file}: {why}; give the path of a chart to convert")
        raw = file.read_bytes()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{file}: cannot be read ({why})") from None
    if len(raw) > MOST_BYTES:
        raise InputError(f"{file}: expected at most {MOST_BYTES / 1e6:.0f} MB, got more")
    return raw


def _text(file: Path) -> str:
    text = decoded(file, _bytes(file))
    require_glyphs(file, text)
    return text


def _number(words: str, where: str) -> float:
    """Return the number that a text is, or raise InputError."""
    if _NUMBER.fullmatch(words) is None:
        raise InputError(f"{where}: expected a number, got {words[:40]!r}; correct it in the file")
    return float(words)


# -----------------------------------------------------------------------------
# QtPlasmaC: sections [MATERIAL_NUMBER_n]; units are the machine's, speeds per minute.

NEEDED = ("PIERCE_HEIGHT", "PIERCE_DELAY", "CUT_HEIGHT", "CUT_SPEED")
NUMBERS = (
    *NEEDED, "KERF_WIDTH", "CUT_AMPS", "CUT_VOLTS", "PAUSE_AT_END", "THICKNESS", "THC",
    "PUDDLE_JUMP_HEIGHT", "PUDDLE_JUMP_DELAY", "GAS_PRESSURE", "CUT_MODE",
)  # fmt: skip
REMARKED = {
    "PUDDLE_JUMP_HEIGHT": "puddle jump height {:g} %",
    "PUDDLE_JUMP_DELAY": "puddle jump delay {:g} s",
    "GAS_PRESSURE": "gas pressure {:g}, in psi or bar",
    "CUT_MODE": "cut mode {:g}",
}
"""Keys that a chart has no key for: they are remarks on the row."""
USUAL = {"CUT_MODE": 1.0}
"""Values of them that need no remark, where that is not 0."""
_SECTION = re.compile(r"\[MATERIAL_NUMBER_(\d{1,9})\]", re.ASCII)
_AMPS = re.compile(r"\b\d+(\.\d+)?\s*A\b", re.ASCII)
_THICK = re.compile(r"(\d+(?:\.\d+)?)\s*(mm|in\b|inch|\")", re.I | re.ASCII)


def _of_qtplasmac(
    file: Path, text: str, unit: str | None, usual: Mapping[str, str | float]
) -> Converted:
    sections = _sections(file, text)
    if unit is None:
        speeds = [float(s["CUT_SPEED"][0]) for s in sections.values() if _is_number(s, "CUT_SPEED")]
        looks = "inch" if speeds and max(speeds) < 600 else "mm"
        raise InputError(
            f"{file}: expected --unit mm or --unit inch, as the file does not say the unit of its "
            f"machine, got none; its speeds look like {looks}"
        )
    scale = INCH if unit == "inch" else 1.0
    made = Converted(source=f"{file.name} of QtPlasmaC, converted")
    for section, keys in sections.items():
        where = f"{file}: [{section}]"
        name = keys.pop("NAME", ("", 0))[0]
        values = {k: _number(v, f"{file}:{line}: {k}") for k, (v, line) in keys.items()}
        for key in NEEDED:
            if key not in values:
                raise InputError(f"{where}: expected {key}, got none; add it to the section")
        thick = _THICK.search(name)
        thickness: str | float | None = usual.get("thickness_mm")
        if "THICKNESS" in values:
            thickness = values["THICKNESS"] * scale
        elif thickness is None and thick is not None:
            thickness = float(thick[1]) * (1 if thick[2].lower() == "mm" else INCH)
            made.notes.append(f"[{section}]: thickness {thickness:g} mm is taken from its name")
        material = usual.get("material")
        if material is None:
            bare = _THICK.sub("", name)
            material = _AMPS.sub("", bare).strip(" -,_") or None
            if material is not None:
                made.notes.append(f"[{section}]: material {material!r} is taken from its name")
        remarks = [name] if name else []
        for key, words in REMARKED.items():
            value = values.get(key, 0.0)
            if value not in (0.0, USUAL.get(key, 0.0)):
                remarks.append(words.format(value))
        stage = {
            "time_s": values["PIERCE_DELAY"],
            "height_mm": round(values["PIERCE_HEIGHT"] * scale, 6),
        }
        made.add(
            f"[{section}]",
            {
                "material": material,
                "thickness_mm": thickness,
                "gas": usual.get("gas"),
                "quality": f"{values['CUT_AMPS']:g} A" if "CUT_AMPS" in values else None,
                "speed_m_min": values["CUT_SPEED"] * scale / 1000,
                "kerf_mm": round(values["KERF_WIDTH"] * scale, 6)
                if "KERF_WIDTH" in values
                else None,
                "stand_off_mm": round(values["CUT_HEIGHT"] * scale, 6),
                "current_a": values.get("CUT_AMPS"),
                "voltage_v": values.get("CUT_VOLTS"),
                "pause_at_end_s": values.get("PAUSE_AT_END") or None,
                "note": ", ".join(remarks) or None,
                "pierce": [stage],
            },
        )
    if any("THC" in keys for keys in sections.values()):
        made.notes.append("THC is left out: height control is a matter of the cell")
    return made


def _is_number(keys: Mapping[str, tuple[str, int]], key: str) -> bool:
    return key in keys and _NUMBER.fullmatch(keys[key][0]) is not None


def _sections(file: Path, text: str) -> dict[str, dict[str, tuple[str, int]]]:
    """Return the sections of materials: text and line of each key."""
    found: dict[str, dict[str, tuple[str, int]]] = {}
    section: dict[str, tuple[str, int]] | None = None
    for number, line in enumerate(text.split("\n"), 1):
        row = line.strip()
        where = f"{file}:{number}"
        if not row or row.startswith(("#", ";")):
            continue
        if row.startswith("["):
            name = row.strip("[]")
            if _SECTION.fullmatch(row) is None:
                raise InputError(
                    f"{where}: expected [MATERIAL_NUMBER_n], got {row[:40]!r}; remove it"
                )
            if name in found:
                raise InputError(f"{where}: expected a section once, got [{name}] again; remove it")
            section = found.setdefault(name, {})
            continue
        key, equals, value = (part.strip() for part in row.partition("="))
        if not equals or section is None:
            raise InputError(
                f"{where}: expected KEY = value in a section, got {row[:40]!r}; remove it"
            )
        if key not in (*NUMBERS, "NAME"):
            raise InputError(f"{where}: expected a key of QtPlasmaC, got {key[:40]!r}; remove it")
        if key in section:
            raise InputError(f"{where}: expected {key} once, got it again; remove one")
        section[key] = (value, number)
    if not found:
        raise InputError(f"{file}: expected sections [MATERIAL_NUMBER_n], got none")
    return found


# -----------------------------------------------------------------------------
# Tables: the name of a column has quantity and unit, or --map says what it is.

SPREADSHEETS = (".xlsx", ".xls", ".ods")

UNITS: Mapping[str, Mapping[str, float]] = {
    "mm": {"mm": 1, "in": INCH, "inch": INCH, "um": 1e-3, "cm": 10},
    "m_min": {
        "m/min": 1, "m_min": 1, "mm/min": 1e-3, "mm_min": 1e-3, "mm/s": 0.06, "mm_s": 0.06,
        "in/min": INCH / 1e3, "ipm": INCH / 1e3,
    },
    "w": {"w": 1, "kw": 1e3},
    "hz": {"hz": 1, "khz": 1e3},
    "bar": {"bar": 1, "psi": 0.0689476, "mpa": 10, "kpa": 0.01},
    "s": {"s": 1, "ms": 1e-3, "sec": 1},
    "percent": {"percent": 1, "%": 1},
    "a": {"a": 1, "amps": 1},
    "v": {"v": 1, "volts": 1},
}  # fmt: skip
"""For each unit of a chart: the units of columns, and their size in it."""
NAMES = {
    "feed": "speed", "feed rate": "speed", "cutting speed": "speed", "cut speed": "speed",
    "kerf width": "kerf", "lead in": "lead_in", "lead out": "lead_out", "standoff": "stand_off",
    "stand off": "stand_off", "cut height": "stand_off", "laser power": "power",
    "gas pressure": "pressure", "duty cycle": "duty", "nozzle diameter": "nozzle",
    "focus position": "focus", "amps": "current", "volts": "voltage",
    "pierce delay": "pierce_time", "pierce time": "pierce_time",
    "pierce height": "pierce_height", "pierce power": "pierce_power", "micro joint": "micro_joint",
}  # fmt: skip
"""Other names of quantities."""
WORDS = ("material", "gas", "quality", "technique", "note")
PIERCE = {"pierce_time_s": "time_s", "pierce_height_mm": "height_mm", "pierce_power_w": "power_w"}
"""Columns of a single stage of the pierce, and its keys."""
EMPTY = ("", "-", "--", "n/a")
"""Cells without a value."""
_QUANTITIES = {
    key.rpartition("_m_min")[0] or key.rpartition("_")[0]: key
    for key in (*RowTable.model_fields, *PIERCE)
    if key.rpartition("_")[2] in UNITS or key == "speed_m_min"
}


@dataclass(frozen=True, slots=True)
class _Column:
    """What a column has: the key of a chart, and the size of its unit in that of the key."""

    key: str
    scale: float | None


def _column(words: str, where: str) -> _Column | None:
    """Return what a name of a column says; None if it is no quantity of a chart."""
    bare = re.sub(r"[\[\](),]", " ", words).strip().lower()
    bare = NAMES.get(bare, bare)
    if bare in WORDS:
        return _Column(bare, None)
    head, _, unit = bare.rpartition(" ")
    tails = [(head.strip(), unit)]
    tails += [
        (bare[: -len(u) - 1], u) for us in UNITS.values() for u in us if bare.endswith(f"_{u}")
    ]
    for name, own in sorted(tails, key=lambda each: len(each[0])):
        quantity = NAMES.get(name, name).replace(" ", "_").replace("-", "_")
        if (key := _QUANTITIES.get(quantity)) is None:
            continue
        of = "m_min" if key == "speed_m_min" else key.rpartition("_")[2]
        if own in UNITS[of]:
            return _Column(key, UNITS[of][own])
        raise InputError(
            f"{where}: expected a unit of {quantity} ({', '.join(UNITS[of])}), got {own!r}; say it "
            f"with --map '{words}={quantity} UNIT'"
        )
    quantity = NAMES.get(bare, bare).replace(" ", "_")
    if (key := _QUANTITIES.get(quantity)) is not None:
        of = "m_min" if key == "speed_m_min" else key.rpartition("_")[2]
        raise InputError(
            f"{where}: expected a unit in the name of the column ({', '.join(UNITS[of])}), got "
            f"{words!r}; say it with --map '{words}={quantity} UNIT'"
        )
    return None


def _csv(file: Path, text: str) -> tuple[list[list[str]], str]:
    """Return the cells of a CSV file, row by row, and what separates them."""
    first = text.partition("\n")[0]
    delimiter = max(";\t,", key=first.count)
    try:
        return list(csv.reader(text.splitlines(), delimiter=delimiter, strict=True)), delimiter
    except csv.Error as error:
        raise InputError(f"{file}: not a table: {error}; save it as CSV again") from None


def _spreadsheet(file: Path, sheet: str | None) -> list[list[str]]:
    """Return the cells of a sheet of a spreadsheet, row by row."""
    content = _bytes(file)
    try:
        sheets = call_apart(read_sheets, content, size=len(content))
    except InputError as error:
        raise InputError(f"{file}: {error}; save the sheet as CSV") from None
    filled = {name: rows for name, rows in sheets.items() if rows}
    names = ", ".join(map(repr, sheets))[:200]
    if sheet is None and len(filled) > 1:
        raise InputError(f"{file}: expected --sheet with one of {names}, got none")
    if sheet is not None and sheet not in sheets:
        raise InputError(f"{file}: --sheet: expected one of {names}, got {sheet!r}")
    rows = sheets[sheet] if sheet is not None else next(iter(filled.values()), [])
    for number, cells in enumerate(rows, 1):
        for cell in cells:
            if (found := NOT_TEXT.search(cell)) is not None:
                said = f"expected text, got {named(found[0])}; remove it"
                raise InputError(f"{file}:{number}: {said}")
    return rows


def read_sheets(content: bytes) -> dict[str, list[list[str]]]:
    """Return the cells of each sheet of a spreadsheet as text, row by row from the first.

    Raises
    ------
    InputError
        The file is no spreadsheet, or damaged; the message does not name it.
    """
    try:
        with CalamineWorkbook.from_filelike(BytesIO(content)) as book:
            sheets = {
                n: book.get_sheet_by_name(n).to_python(skip_empty_area=False)
                for n in book.sheet_names
            }
    except (CalamineError, OSError) as error:
        raise InputError(f"not a spreadsheet that can be read ({error})") from None
    return {name: [[_cell(cell) for cell in row] for row in rows] for name, rows in sheets.items()}


def _cell(value: object) -> str:
    """Return the value of a cell as text: a number to 15 digits, else on one line."""
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:.15g}"
    return " ".join(str(value).split())


def _of_table(
    file: Path,
    table: Sequence[Sequence[str]],
    columns: Sequence[str],
    usual: Mapping[str, str | float],
    *,
    decimal_comma: bool,
) -> Converted:
    if len(table) < 2:
        raise InputError(f"{file}: expected a line of names and rows under it, got {len(table)}")
    made = Converted(source=f"{file.name}, converted")
    kinds = _kinds(file, [name.strip() for name in table[0]], columns, made)
    for number, cells in enumerate(table[1:], 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(kinds):
            raise InputError(
                f"{file}:{number}: expected {len(kinds)} cells, as there are names of columns, got "
                f"{len(cells)}; correct the row"
            )
        row: dict[str, Any] = dict(usual)
        stage: dict[str, float] = {}
        for cell, kind, name in zip(cells, kinds, table[0], strict=True):
            said = cell.strip()
            if kind is None or said.lower() in EMPTY:
                continue
            if kind.scale is None:
                row[kind.key] = said
                continue
            plain = said.replace(",", ".") if decimal_comma else said
            value = _number(plain, f"{file}:{number}: column {name.strip()!r}") * kind.scale
            into, key = (stage, PIERCE[kind.key]) if kind.key in PIERCE else (row, kind.key)
            into[key] = round(value, 9)
        if "speed_m_min" not in row:
            made.notes.append(f"line {number}: left out, as it has no speed")
            continue
        if stage:
            row["pierce"] = [{"time_s": 0.0, **stage}]
        made.add(f"line {number}", row)
    return made


def _kinds(
    file: Path, names: Sequence[str], columns: Sequence[str], made: Converted
) -> list[_Column | None]:
    """Return what each column has, by --map or by its name."""
    mapped: dict[str, str] = {}
    for each in columns:
        name, equals, key = each.rpartition("=")
        if not equals or name not in names:
            known = ", ".join(map(repr, names))[:200]
            raise InputError(
                f"{file}: --map: expected COLUMN=KEY with one of {known}, got {each!r}"
            )
        mapped[name] = key
    kinds: list[_Column | None] = []
    for name in names:
        kind = _column(mapped.get(name, name), f"{file}: column {name!r}")
        if kind is None and name in mapped:
            known = ", ".join([*WORDS, *_QUANTITIES.values()])
            raise InputError(f"{file}: --map: expected a key ({known}), got {mapped[name]!r}")
        if kind is None:
            made.notes.append(f"column {name!r} is left out: it is no key of a chart")
        elif any(other is not None and other.key == kind.key for other in kinds):
            raise InputError(f"{file}: expected one column of {kind.key}, got {name!r}, too")
        kinds.append(kind)
    return kinds


# -----------------------------------------------------------------------------
# LightBurn: materials with entries by thickness; power in per cent of an unknown source.


def _of_lightburn(file: Path, text: str, usual: Mapping[str, str | float]) -> Converted:
    if "<!DOCTYPE" in text.upper():
        raise InputError(f"{file}: expected a library of LightBurn, got XML with a DOCTYPE")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, RecursionError, ValueError) as error:
        raise InputError(f"{file}: not valid XML ({error}); save the library again") from None
    if root.tag != "LightBurnLibrary":
        raise InputError(f"{file}: expected <LightBurnLibrary>, got <{root.tag[:40]}>")
    made = Converted(source=f"{file.name} of LightBurn, converted")
    for material in root.iter("Material"):
        name = material.get("name") or str(usual.get("material", ""))
        for entry in material.iter("Entry"):
            said = entry.get("Desc") or entry.get("NoThickTitle") or ""
            place = f"{name!r} {said!r}".strip()
            _add_entry(file, made, entry, place, {**usual, "material": name}, said)
    if made.rows:
        made.notes.append("powers are remarks, as LightBurn has them in per cent of the source")
    return made


def _add_entry(
    file: Path, made: Converted, entry: ElementTree.Element, place: str,
    usual: Mapping[str, str | float], said: str,
) -> None:  # fmt: skip
    """Add the entry of a library, or a note why it is left out."""
    setting = entry.find("CutSetting")
    if setting is None:
        made.notes.append(f"{place}: left out, as it has no CutSetting")
        return
    kind = setting.get("type") or setting.get("Type") or "Cut"
    if kind not in ("Cut", "Scan"):
        made.notes.append(f"{place}: left out, as it is {kind!r}, neither Cut nor Scan")
        return
    values: dict[str, str] = dict(_lightburn_values(setting))
    thickness: str | float | None = usual.get("thickness_mm")
    if (drawn := entry.get("Thickness")) is not None:
        own = _number(drawn.strip(), f"{file}: {place}: Thickness")
        thickness = own if own > 0 else thickness
    if thickness is None or "speed" not in values:
        lacks = "speed" if thickness is not None else "thickness"
        made.notes.append(f"{place}: left out, as it has no {lacks}")
        return
    numbers = {
        key: _number(values[key].strip(), f"{file}: {place}: {key}")
        for key in ("speed", "kerf", "frequency")
        if key in values
    }
    powers = [f"{key} {values[key]} %" for key in ("minPower", "maxPower") if key in values]
    passes = values.get("numPasses", "1")
    remarks = [said, *powers, *([] if passes == "1" else [f"{passes} passes"])]
    made.add(
        place,
        {
            "material": usual.get("material"),
            "thickness_mm": thickness,
            "gas": usual.get("gas"),
            "quality": said or None,
            "technique": "normal" if kind == "Cut" else "engraving",
            "speed_m_min": numbers["speed"] * 0.06,
            "kerf_mm": numbers.get("kerf") or None,
            "frequency_hz": numbers.get("frequency") or None,
            "note": ", ".join(each for each in remarks if each) or None,
        },
    )


def _lightburn_values(setting: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield the values of a setting: those of its elements, or in old files its attributes."""
    for name, value in setting.attrib.items():
        yield name[:1].lower() + name[1:], value
    for element in setting:
        if (said := element.get("Value")) is not None:
            yield element.tag, said
