"""Settings of a Yaskawa controller, and rules of its jobs."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, StringConstraints

from kerfpath.post._controller import Controller
from kerfpath.post._settings import OrientationSetting, PortSettings, Rules, numbered, setting
from kerfpath.robots import MOST_EXTERNAL

__all__ = ["LEVEL_MM", "InformSettings", "is_reserved", "rules"]

LEVEL_MM = 12.5
"""Distance from a corner at which a position level is assumed to round it, if not given."""
SPEED_STEP = 1e-4
"""Speeds (m/s) have one decimal of mm/s."""
POINT_STEP = 0.5e-6
"""Positions (m) have three decimals of mm."""
ANGLE_STEP_DEG = 0.5e-4
"""Angles have four decimals of deg."""


def _not_zero(values: list[float]) -> list[float]:
    if not all(np.isfinite(values)) or not all(values):
        raise ValueError("zero pulses")
    return values


Output = Annotated[int | None, numbered("an output", 4096)]
Input = Annotated[int | None, numbered("an input", 4096)]


class InformSettings(PortSettings, output=Output, input=Input):
    """Frames, outputs, and the pulses of the individual robot."""

    lines_per_file: Annotated[
        int, setting("a whole number of lines from 100 to 9999", "9999", ge=100, le=9999)
    ] = 9999
    user_frame: Annotated[int, setting("a user frame, 1 to 63", "2", ge=1, le=63)] = 1
    tool_number: Annotated[int, setting("a tool, 0 to 63", "2", ge=0, le=63)] = 0
    pulses_per_deg: Annotated[
        Annotated[list[float], AfterValidator(_not_zero)] | None,
        setting(
            "six numbers, the pulses per deg of S, L, U, R, B and T",
            "[1341.4, 1341.4, 1000.0, 1000.0, 800.0, 500.0]",
            min_length=6,
            max_length=6,
        ),
    ] = None
    external_pulses: Annotated[
        Annotated[
            list[float], Field(min_length=1, max_length=MOST_EXTERNAL), AfterValidator(_not_zero)
        ]
        | None,
        setting(
            "a list of numbers, the pulses of each external axis per mm or per deg",
            "[100.0, -1019.7]",
        ),
    ] = None
    position_level: Annotated[
        int, setting("a position level for corners, 1 to 8", "1", ge=1, le=8)
    ] = 1
    position_level_mm: Annotated[
        float | None,
        setting("a length from 0.01 to 500, in mm, that the level has", "12.5", ge=0.01, le=500),
    ] = None
    fastest_mm_s: Annotated[
        float, setting("the largest speed of MOVL, in mm/s", "1500.0", ge=1, le=20_000)
    ] = 1500.0
    longest_name: Annotated[
        int, setting("the characters of a job's name, 8 to 32", "8", ge=8, le=32)
    ] = 32
    rconf_values: Annotated[
        Literal[6, 8, 24], setting("the values after RCONF: 6, 8 or 24", "6")
    ] = 24
    flip: Annotated[
        Literal["B", "R"], setting("the axis whose angle decides flip, B or R", '"R"')
    ] = "B"
    orientation: OrientationSetting = "slerp"
    date: Annotated[
        Annotated[str, StringConstraints(pattern=r"^\d{4}/\d\d/\d\d \d\d:\d\d$")],
        setting("a date as YYYY/MM/DD HH:MM", '"2026/11/21 10:00"'),
    ] = "2000/01/01 00:00"


def rules(settings: InformSettings) -> Rules:
    """Return the rules of jobs."""
    pulses = np.abs(settings.pulses_per_deg or [np.inf])
    external = np.abs(settings.external_pulses or [np.inf])
    return Rules(
        longest_name=settings.longest_name,
        name=r"[A-Z][A-Z0-9_]*",
        slowest=SPEED_STEP,
        fastest=settings.fastest_mm_s * 1e-3,
        speed_step=SPEED_STEP,
        point_step=max(POINT_STEP, 0.5e-3 / float(external.min())),
        angle_step=float(np.radians(max(ANGLE_STEP_DEG, 0.5 / min(pulses.min(), external.min())))),
        controller=_controller(settings),
    )


def _controller(settings: InformSettings) -> Controller:
    """Return the controller: the length of a position level is one of its parameters."""
    level, length = settings.position_level, settings.position_level_mm
    assumed = (
        f"PL={level} is assumed to round from {LEVEL_MM:g} mm before a corner; set "
        f"position_level_mm in [program.inform], the controller's parameter S1CxG{32 + level:03d}"
    )
    return Controller(
        orientation=settings.orientation,
        corner=(LEVEL_MM if length is None else length) * 1e-3,
        assumed=assumed if length is None else "",
    )


def is_reserved(name: str) -> bool:
    """Return whether a job cannot be called `name`: only MASTER is the controller's own."""
    return name.upper() == "MASTER"
