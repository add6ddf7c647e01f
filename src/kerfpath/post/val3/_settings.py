"""Settings of a Staubli controller, and rules of its programs."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import StringConstraints

from kerfpath.post._controller import Controller
from kerfpath.post._settings import OrientationSetting, PortSettings, Rules, setting

__all__ = ["LONGEST_NAME", "Val3Settings", "is_reserved", "rules"]

LONGEST_NAME = 15
"""Characters of a name."""
POINT_STEP, ANGLE_STEP = 0.5e-7, float(np.radians(0.5e-6))
"""Rounding errors of four decimals of mm (m), and of six decimals of deg (rad)."""
SPEED_STEP = 1e-6
"""Speeds (m/s) have three decimals of mm/s."""

KEYWORDS = (
    "and as begin bnot break call case continue default do else elseif end endfor endif endswitch "
    "endwhile false for global if in not or out popup return step switch then to true until while "
    "with xor"
)
"""Keywords of the language."""
MEANINGS = (
    "start stop world flange aio bool cartesian config configrx configrs dio fieldbus frame joint "
    "jointrs jointrx mdesc num off point pointrs pointrx screen sio string tool trsf same free "
    "lefty righty ssame sfree epositive enegative esame efree wpositive wnegative wsame wfree "
    "abs acos align appro asc asin atan autoconnectmove bit_and bit_or chr clock close cls "
    "codeascii compose cos delay delete dialog disablepower distance enablepower esstatus exp "
    "find getdate getkey getlatch getmoveid getspeed getversion gotoxy here herej insert "
    "interpolatec interpolatel ioget iolink isempty iskeypressed ispowered isinrange iscalibrated "
    "issettled "
    "jointtopoint left len libdelete liblist libload libpath libsave limit link ln log logmsg max "
    "mid min movec movej movel open pi pointtojoint position power put putln random replace "
    "resetmotion resetturn resize restartmove right round rounddown roundup sel setframe setlatch "
    "setmonitorspeed setmoveid setmutex setprofile settextmode setvelcmd sin size sqrt stopmove "
    "tan taskcreate taskcreatesync taskkill taskresume taskstatus tasksuspend title tostring tonum "
    "userpage wait waitendmove watch workingmode"
)
"""Types, data, words and instructions of a controller that a contour could have as its name."""
RESERVED = frozenset((KEYWORDS + " " + MEANINGS).split())

Link = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.%\\/:\-]{1,80}$")]
Output = Annotated[
    Link | None,
    setting("the link of a digital output, as the controller lists it", r'"BasicIO-1\\%Q0"'),
]
Input = Annotated[
    Link | None,
    setting("the link of a digital input, as the controller lists it", r'"BasicIO-1\\%I0"'),
]


class Val3Settings(PortSettings, output=Output, input=Input):
    """Outputs and inputs, the folder of projects, and the version that they are for."""

    tool_link: Annotated[
        Link,
        setting("the link of the tool's own output, as the controller lists it", '"valve1"'),
    ] = "valve1"
    configurations: Annotated[Literal["named", "same"], setting('"named" or "same"', '"named"')] = (
        "named"
    )
    folder: Annotated[
        Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_:/.\-]{1,60}/$")],
        setting("the folder of projects, as the controller calls it", '"Disk://"'),
    ] = "Disk://"
    orientation: OrientationSetting = "slerp"
    version: Annotated[
        Annotated[str, StringConstraints(pattern=r"^s[0-9]+(\.[0-9]+){0,3}$")],
        setting("the version of VAL 3 that projects are for", '"s7.3.1"'),
    ] = "s7.3.1"


def rules(settings: Val3Settings) -> Rules:
    """Return the rules of VAL 3 programs."""
    return Rules(
        longest_name=LONGEST_NAME,
        slowest=SPEED_STEP,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(orientation=settings.orientation),
    )


def is_reserved(name: str) -> bool:
    """Return whether VAL 3 or every Staubli controller gives `name` another meaning."""
    return name.lower() in RESERVED
