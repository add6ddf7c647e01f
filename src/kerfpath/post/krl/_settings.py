"""Settings of a KUKA controller, and rules of its programs."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from kerfpath.post._controller import Controller
from kerfpath.post._settings import (
    LinesPerFile,
    OrientationSetting,
    PortSettings,
    PositionerFrame,
    Rules,
    numbered,
    setting,
)
from kerfpath.robots import MOST_EXTERNAL

__all__ = ["AXES", "LONGEST_NAME", "KrlSettings", "is_reserved", "rules"]

AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
LONGEST_NAME = 24
"""Characters of a name."""
SLOWEST = 1e-5
"""Lowest speed (m/s) that is written with an error of a tenth at most."""
POINT_STEP, ANGLE_STEP = 0.5e-7, float(np.radians(0.5e-6))
"""Rounding errors of four decimals of mm (m), and of six decimals of deg (rad)."""
SPEED_STEP = 1e-6
"""Speeds have six decimals of m/s."""
LONGEST_LEAD = 10.0
"""Longest lead (s) of a trigger; longer is a mistake in its unit (KUKA's bound is 10000 s)."""

KEYWORDS = (
    "and anin anout asyptp asycancel b_and b_exor b_not b_or bool brake c_dis c_ori c_ptp c_spl "
    "c_vel case cast_from cast_to char circ circ_rel confirm const continue decl def default "
    "defdat deffct delay distance do else end enddat endfct endfor endif endloop endspline "
    "endswitch endwhile enum exit exor ext extfct false for global goto halt if import in inout "
    "int interrupt is lin lin_rel loop maximum minimum not on onstart off or out path prio ptp "
    "ptp_rel ptp_spline public pulse real repeat resume return scirc scirc_rel sec signal slin "
    "slin_rel spl spl_rel spline sptp sptp_rel step struc switch then time_block to trigger true "
    "until wait when while with const_vel"
)
"""Keywords of the language."""
MEANINGS = (
    "abs acos atan2 cos sin sqrt tan axis e3axis e3pos e6axis e6pos frame load pos base_data "
    "tool_data load_data machine_def machine_tool_data bas bas_command cell home xhome sps "
    "ir_stopm p00 fdat pdat ldat fdat_act pdat_act ldat_act basis_sugg_t err_raise varstate cread "
    "on_error_proceed cwrite copen cclose sread swrite forward inverse strlen strclear stradd "
    "strcomp strcopy strfind strtofrm timer flag msgnotify msgquit msgdialog"
)
"""Types, functions, data and programs of a controller that a contour could have as its name."""
RESERVED = frozenset((KEYWORDS + " " + MEANINGS).split())

Output = Annotated[int | None, numbered("a digital output", 8192)]
Input = Annotated[int | None, numbered("a digital input", 8192)]

Number = Annotated[int, Field(ge=1, le=6)]
Numbers = Annotated[
    Annotated[list[Number], Field(min_length=1, max_length=MOST_EXTERNAL)] | None,
    setting("a list of numbers from 1 to 6, one for each external axis", "[1, 2]"),
]


class KrlSettings(PortSettings, output=Output, input=Input):
    """Outputs, inputs, tool and base, and limits of the machine data."""

    lines_per_file: LinesPerFile = 1400
    tool_number: Annotated[
        int | None, setting("the number of a TOOL_DATA, 1 to 128", "1", ge=1, le=128)
    ] = None
    base_number: Annotated[
        int | None, setting("the number of a BASE_DATA, 1 to 128", "1", ge=1, le=128)
    ] = None
    largest_speed_m_s: Annotated[
        float, setting("a speed from 0.01 to 10, in m/s ($VEL_MA.CP)", "3.0", ge=0.01, le=10)
    ] = 3.0
    machine_number: Annotated[
        int, setting("the number of a MACHINE_DEF, 1 to 16", "2", ge=1, le=16)
    ] = 2
    external_numbers: Numbers = None
    positioner_frame: PositionerFrame = None
    turning_speed_deg_s: Annotated[
        float, setting("a speed from 1 to 1000, in deg/s ($VEL.ORI1)", "200.0", ge=1, le=1000)
    ] = 200.0
    orientation: OrientationSetting = "two-angle"


def rules(settings: KrlSettings) -> Rules:
    """Return the rules of KRL programs."""
    return Rules(
        longest_name=LONGEST_NAME,
        slowest=SLOWEST,
        fastest=settings.largest_speed_m_s,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(
            turning_speed=float(np.radians(settings.turning_speed_deg_s)),
            orientation=settings.orientation,
        ),
        longest_lead=LONGEST_LEAD,
    )


def is_reserved(name: str) -> bool:
    """Return whether KRL or every KUKA controller gives `name` another meaning."""
    return name.lower() in RESERVED
