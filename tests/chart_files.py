"""Cut charts of this and of other programs, as files to read and to spoil."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from xml.sax.saxutils import escape

from kerfpath.job import chart_files, read_chart, read_foreign
from spoilt import Whole

QTPLASMAC = """\
# QtPlasmaC material file
[MATERIAL_NUMBER_1]
NAME               = 5mm Mild Steel 40A
KERF_WIDTH         = 0.5
THC                = 1
PIERCE_HEIGHT      = 3.1
PIERCE_DELAY       = 0.1
CUT_HEIGHT         = 0.75
CUT_SPEED          = 3000
CUT_AMPS           = 40
CUT_VOLTS          = 110
PAUSE_AT_END       = 0.1
GAS_PRESSURE       = 5
CUT_MODE           = 1

[MATERIAL_NUMBER_4]
NAME               = 2mm Mild Steel 45A
KERF_WIDTH         = 1.0
PIERCE_HEIGHT      = 3.8
PIERCE_DELAY       = 0.2
PUDDLE_JUMP_HEIGHT = 100
CUT_HEIGHT         = 1.5
CUT_SPEED          = 5560
CUT_AMPS           = 45
CUT_VOLTS          = 128
"""
TABLE = """\
Material;Thickness [mm];Gas;Speed (mm/min);kerf mm;Power kW;gas pressure psi;pierce time s;colour
steel;3;N2;4200,5;0,2;3;200;0,3;red
steel;4;N2;-;;;;;
steel;6;O2;2600;0,25;3;10;0,9;red
"""
LIGHTBURN = """\
<?xml version="1.0" encoding="UTF-8"?>
<LightBurnLibrary DisplayName="shop">
  <Material name="plywood">
    <Entry Thickness="3.0000" Desc="cut" NoThickTitle="">
      <CutSetting type="Cut">
        <speed Value="12"/><maxPower Value="80"/><kerf Value="0.1"/><numPasses Value="2"/>
      </CutSetting>
    </Entry>
    <Entry Thickness="3.0000" Desc="mark" NoThickTitle="">
      <CutSetting type="Scan"><speed Value="100"/><maxPower Value="15"/></CutSetting>
    </Entry>
    <Entry Thickness="-1.0000" Desc="paper" NoThickTitle="thin">
      <CutSetting type="Cut"><speed Value="50"/></CutSetting>
    </Entry>
  </Material>
</LightBurnLibrary>
"""
CONTENT = """\
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
<Default Extension="xml" ContentType="application/xml"/>
<Override PartName="/xl/workbook.xml" ContentType=
"application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/>
</Types>"""
MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
FOREIGN = {"mill_material.cfg": QTPLASMAC, "table.csv": TABLE, "shop.clb": LIGHTBURN}


def write_spreadsheet(path: Path, **sheets: list[list[str | float | None]]) -> None:
    """Write sheets of cells, text or numbers, as a spreadsheet (.xlsx)."""

    def cell(value: str | float | None) -> str:
        if value is None:
            return "<c/>"
        if isinstance(value, str):
            return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>'
        return f"<c><v>{value!r}</v></c>"

    def relations(*kinds: tuple[str, str]) -> str:
        parts = "".join(
            f'<Relationship Id="r{i}" Type="{OFFICE}/{kind}" Target="{target}"/>'
            for i, (kind, target) in enumerate(kinds, 1)
        )
        return f'<Relationships xmlns="{PACKAGE}">{parts}</Relationships>'

    names = "".join(
        f'<sheet name="{name}" sheetId="{i}" r:id="r{i}"/>' for i, name in enumerate(sheets, 1)
    )
    book = f'<workbook xmlns="{MAIN}" xmlns:r="{OFFICE}"><sheets>{names}</sheets></workbook>'
    files = [f"worksheets/sheet{i}.xml" for i in range(1, len(sheets) + 1)]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("[Content_Types].xml", CONTENT)
        archive.writestr("_rels/.rels", relations(("officeDocument", "xl/workbook.xml")))
        archive.writestr("xl/workbook.xml", book)
        archive.writestr(
            "xl/_rels/workbook.xml.rels", relations(*(("worksheet", file) for file in files))
        )
        for file, rows in zip(files, sheets.values(), strict=True):
            data = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in rows)
            sheet = f'<worksheet xmlns="{MAIN}"><sheetData>{data}</sheetData></worksheet>'
            archive.writestr(f"xl/{file}", sheet)


def charts(folder: Path) -> list[Whole]:
    """The charts that are shipped."""
    found = []
    for _, _, path in chart_files():
        shutil.copy(path, folder)
        found.append(Whole(folder / path.name, folder / path.name))
    return found


def foreign_charts(folder: Path) -> list[Whole]:
    """A chart of QtPlasmaC, a table, a spreadsheet, and a library of LightBurn."""
    write_spreadsheet(folder / "table.xlsx", steel=[line.split(";") for line in TABLE.split("\n")])
    found = [Whole(folder / "table.xlsx", folder / "table.xlsx")]
    for name, text in FOREIGN.items():
        (folder / name).write_text(text, encoding="utf-8")
        found.append(Whole(folder / name, folder / name))
    return found


def read_foreign_chart(path: Path) -> None:
    """Convert a foreign chart, and read what that makes."""
    text, _ = read_foreign(path, unit="mm" if path.suffix == ".cfg" else None)
    chart = path.with_name("converted.toml")
    chart.write_text(text, encoding="utf-8")
    read_chart(chart)
