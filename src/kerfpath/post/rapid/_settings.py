"""Settings of an ABB controller, and rules of its programs."""

from __future__ import annotations

import re
from typing import Annotated

import numpy as np
from pydantic import Field, StringConstraints

from kerfpath.post._controller import Controller
from kerfpath.post._settings import (
    OrientationSetting,
    PortSettings,
    PositionerFrame,
    Rules,
    setting,
)
from kerfpath.robots import MOST_EXTERNAL

__all__ = ["SWITCH_OFF", "TURNING_SPEED", "RapidSettings", "is_reserved", "rules"]

SWITCH_OFF = "switchOff"
"""The routine that switches everything off."""
TURNING_SPEED = np.radians(500.0)
"""v_ori of all speed data, rad/s: ABB's own for its predefined speeds."""
SLOWEST = 1e-5
"""Lowest speed (m/s) that two decimals of mm/s give with an error of half at most."""
SPEED_STEP = 1e-5
"""Speeds (m/s) have two decimals of mm/s."""
POINT_STEP, ANGLE_STEP = 0.5e-7, 1e-8
"""Rounding errors of four decimals of mm (m), and of eight decimals of a quaternion (rad)."""
LONGEST_LEAD = 0.5
r"""Longest lead (s) that ``TriggIO \Time`` takes."""

KEYWORDS = (
    "alias and backward case connect const default div do else elseif endfor endfunc endif "
    "endmodule endproc endrecord endtest endtrap endwhile error exit false for from func goto "
    "if inout local mod module nostepin not noview or pers proc raise readonly record retry "
    "return step sysmodule task test then to trap true trynext undo var viewonly while with xor "
)
"""Keywords of the language."""
MEANINGS = (
    "bool byte clock confdata dnum errnum extjoint intnum jointtarget loaddata num orient pos "
    "pose robjoint robtarget signaldi signaldo speeddata string tooldata triggdata wobjdata "
    "zonedata abs accset break calcjointt calcrobt cjointt confj confl crobt deactunit "
    "exitcycle fine incr load moveabsj movec movej movel moveldo offs pulsedo reltool reset "
    "round set setao setdo setgo singarea sqrt start stop stopmove tool0 tpwrite triggc triggio "
    "triggj triggl trunc unload velset waitdi waitdo waittime wobj0 load0 "
)
"""Types, instructions and data of every controller that a contour could have as its name."""
RESERVED = frozenset((KEYWORDS + MEANINGS).split())
PREDEFINED = re.compile(r"[vz]\d+|vmax|vrot\d+|vlin\d+", re.IGNORECASE)
"""Speeds and zones that every controller defines: v100, z10."""


Name = Annotated[str, StringConstraints(min_length=1, max_length=80)]
Input = Annotated[Name | None, setting("the name of a digital input", '"diReady"')]
Request = Annotated[Name | None, setting("the name of a digital output", '"doShutter"')]
Units = Annotated[
    Annotated[list[Name], Field(min_length=1, max_length=MOST_EXTERNAL)] | None,
    setting("a list of mechanical units, one name for each external axis", '["TRACK_1", "STN_1"]'),
]
Letters = Annotated[
    Annotated[str, StringConstraints(pattern=r"^[a-f]{1,3}$")] | None,
    setting("letters from a to f, one for each external axis", '"ab"'),
]
Folder = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_:/.\-]{1,60}$")]


class RapidSettings(PortSettings, output=Request, input=Input):
    """Names of outputs, inputs, frames and units at the controller."""

    laser_output: Annotated[Name, setting("the name of a digital output", '"doLaser"')] = "doLaser"
    gas_output: Annotated[Name | None, setting("the name of a digital output", '"doGas"')] = None
    tool_name: Annotated[Name, setting("a name for the tool", '"tLaser"')] = "tLaser"
    folder: Annotated[Folder, setting("a folder of the controller", '"HOME:"')] = "HOME:"
    work_object: Annotated[Name, setting("a name for the part's frame", '"wPart"')] = "wPart"
    orientation: OrientationSetting = "slerp"
    mechanical_units: Units = None
    external_letters: Letters = None
    positioner_frame: PositionerFrame = None


def rules(settings: RapidSettings) -> Rules:
    """Return the rules of RAPID programs."""
    return Rules(
        longest_name=32,
        slowest=SLOWEST,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(turning_speed=float(TURNING_SPEED), orientation=settings.orientation),
        longest_lead=LONGEST_LEAD,
    )


def is_reserved(name: str) -> bool:
    """Return whether RAPID or every ABB controller gives `name` another meaning."""
    return name.lower() in RESERVED or PREDEFINED.fullmatch(name) is not None
