"""Settings of a FANUC controller, and rules of its programs."""

from __future__ import annotations

import re
from typing import Annotated, Literal

import numpy as np
from pydantic import StringConstraints

from kerfpath.post._controller import Controller
from kerfpath.post._settings import OrientationSetting, PortSettings, Rules, numbered, setting

__all__ = ["CORNER_MS", "FanucSettings", "is_reserved", "rules", "unit"]

UNITS = {"cm/min": 0.01 / 60, "mm/sec": 1e-3}
"""Units of speeds in m/s; controllers count both in whole numbers."""
CORNER_MS = 100.0
"""Time before and after a corner in which CNT100 is assumed to round it, if not given."""
LONGEST_LEAD = 30.0
"""Longest time (s) of TB."""
SPECIAL = re.compile(r"(RSR|PNS|STYLE)\d*|CON|PRN|AUX|NUL|(COM|LPT)\d", re.IGNORECASE)
"""Names of programs that signals start, and names of devices on file systems."""
WORDS = (
    "abort call do else end endfor endif for gi go if ir jmp lbl macro message monitor override "
    "p pause payload pl pr r resume_prog return ro rs run select skip sr stop then timer ualm "
    "uframe uframe_num utool utool_num wait"
)
"""Words of the language that a contour could have as its name."""

Output = Annotated[int | None, numbered("a digital output", 4096)]
Input = Annotated[int | None, numbered("a digital input", 4096)]


class FanucSettings(PortSettings, output=Output, input=Input):
    """Frames, outputs and options of the controller."""

    lines_per_file: Annotated[
        int, setting("a whole number of lines from 100 to 9999", "9999", ge=100, le=9999)
    ] = 9999
    date: Annotated[
        Annotated[str, StringConstraints(pattern=r"^\d\d-\d\d-\d\d \d\d:\d\d:\d\d$")],
        setting("a date as YY-MM-DD hh:mm:ss", '"26-11-21 10:00:00"'),
    ] = "00-01-01 00:00:00"
    user_frame: Annotated[int, setting("a user frame, 1 to 61", "2", ge=1, le=61)] = 1
    tool_frame: Annotated[int, setting("a tool frame, 1 to 29", "2", ge=1, le=29)] = 1
    longest_name: Annotated[
        int, setting("the characters of a program's name, 8 to 36", "8", ge=8, le=36)
    ] = 36
    speed_unit: Annotated[Literal["cm/min", "mm/sec"], setting("cm/min or mm/sec", '"mm/sec"')] = (
        "cm/min"
    )
    fastest_mm_s: Annotated[
        float, setting("the largest speed of linear moves, in mm/s", "4000.0", ge=1, le=20_000)
    ] = 2000.0
    corner: Annotated[
        Literal["CNT", "CR"], setting("CNT, or CR where the controller has it", '"CR"')
    ] = "CNT"
    cnt_percent: Annotated[int, setting("a CNT value, 0 to 100", "50", ge=0, le=100)] = 100
    corner_ms: Annotated[
        float | None,
        setting("a time from 1 to 1000, in ms, in which CNT100 rounds", "100.0", ge=1, le=1000),
    ] = None
    turns: Annotated[
        Literal["J1 J4 J6", "J4 J5 J6"],
        setting("the axes whose turns are counted, J1 J4 J6 or J4 J5 J6", '"J4 J5 J6"'),
    ] = "J1 J4 J6"
    decimals: Annotated[
        int, setting("the decimals of mm and deg in positions, 3 to 6", "3", ge=3, le=6)
    ] = 4
    orientation: OrientationSetting = "two-angle"


def unit(settings: FanucSettings) -> float:
    """Return the step of speeds, m/s."""
    return UNITS[settings.speed_unit]


def rules(settings: FanucSettings) -> Rules:
    """Return the rules of TP programs."""
    half_digit = 0.5 * 10.0**-settings.decimals
    return Rules(
        longest_name=settings.longest_name,
        name=r"[A-Z][A-Z0-9_]*",
        slowest=unit(settings),
        fastest=settings.fastest_mm_s * 1e-3,
        speed_step=unit(settings),
        longest_lead=LONGEST_LEAD,
        point_step=half_digit * 1e-3,
        angle_step=float(np.radians(half_digit)),
        controller=_controller(settings),
    )


def _controller(settings: FanucSettings) -> Controller:
    """Return the controller: CNT rounds within a time, whatever zone a program has."""
    if settings.corner == "CR":
        return Controller(orientation=settings.orientation)
    full = CORNER_MS if settings.corner_ms is None else settings.corner_ms
    assumed = (
        f"CNT100 is assumed to round from {CORNER_MS:g} ms before a corner to {CORNER_MS:g} ms "
        "after it; set corner_ms in [program.fanuc]"
    )
    return Controller(
        orientation=settings.orientation,
        corner_time=full * 1e-3 * max(settings.cnt_percent, 1) / 100,  # CNT0 rounds, but hardly
        assumed=assumed if settings.corner_ms is None else "",
    )


def is_reserved(name: str) -> bool:
    """Return whether a controller gives programs called `name` another meaning."""
    return name.lower() in WORDS.split() or SPECIAL.fullmatch(name) is not None
