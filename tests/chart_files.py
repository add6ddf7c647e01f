"""Cut charts of this and of other programs, as files to read and to spoil."""

from __future__ import annotations

import shutil
from pathlib import Path

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
FOREIGN = {"mill_material.cfg": QTPLASMAC, "table.csv": TABLE, "shop.clb": LIGHTBURN}


def charts(folder: Path) -> list[Whole]:
    """The charts that are shipped."""
    found = []
    for _, _, path in chart_files():
        shutil.copy(path, folder)
        found.append(Whole(folder / path.name, folder / path.name))
    return found


def foreign_charts(folder: Path) -> list[Whole]:
    """A chart of QtPlasmaC, a table, and a library of LightBurn."""
    found = []
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
