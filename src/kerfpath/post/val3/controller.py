"""A Staubli controller: its settings and axes, and the issues of VAL 3."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import StringConstraints

from kerfpath.arrays import Array, floats
from kerfpath.post.build import AxisCount, wrist_in_plane
from kerfpath.post.languages import (
    Controller,
    Inherited,
    OrientationSetting,
    OverrideSetting,
    PortSettings,
    Rules,
    ShortestMove,
    setting,
)
from kerfpath.post.program import (
    Program,
    ProgramIssue,
    warn_of_changed_postures,
    warn_of_late_switches,
)
from kerfpath.robots import Robot

# -----------------------------------------------------------------------------
# Settings of a Staubli controller, and rules of its programs.

SHORTEST_MS = 12.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
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
    shortest_move_ms: ShortestMove = None
    override: OverrideSetting = "full"
    controller: Annotated[Literal["CS8", "CS9"], setting("CS8 or CS9", '"CS8"')] = "CS9"
    version: Annotated[
        Annotated[str, StringConstraints(pattern=r"^s[0-9]+(\.[0-9]+){0,3}$")] | None,
        setting("the version of VAL 3 that projects are for", '"s7.3.1"'),
    ] = None


VERSIONS = {"CS8": "s7.3.1", "CS9": "s8.0"}
"""Version of VAL 3 that projects are for, by controller."""


def inherited(settings: Val3Settings) -> tuple[Inherited, ...]:
    """Return the states that another application may have left."""
    return (
        Inherited(
            state="speed",
            lines=("setMonitorSpeed(100)",) if settings.override == "full" else (),
            why="override; the operator may lower it again, and slower is not as planned",
        ),
        Inherited(state="tool and frame", why="each move and point names them"),
        Inherited(state="acceleration, corners", why="each move names its `mdesc`"),
        Inherited(state="displacement", why="points are written in place, not composed"),
    )


def rules(settings: Val3Settings) -> Rules:
    """Return the rules of VAL 3 programs."""
    return Rules(
        longest_name=LONGEST_NAME,
        slowest=SPEED_STEP,
        speed_step=SPEED_STEP,
        point_step=POINT_STEP,
        angle_step=ANGLE_STEP,
        controller=Controller(orientation=settings.orientation).with_shortest(
            settings.shortest_move_ms, SHORTEST_MS
        ),
    )


def is_reserved(name: str) -> bool:
    """Return whether VAL 3 or every Staubli controller gives `name` another meaning."""
    return name.lower() in RESERVED


# -----------------------------------------------------------------------------
# Axes of Staubli controllers, and the configuration of a pose.
#
# Axes: all of them turn by the right-hand rule and are zero with the arm upright. The flange is
# then parallel to the world, which has its origin on axis 1 at the height of axis 2. A public
# project for a TX90 confirms this: its joints lead to a point that it contains, to 1e-5 mm:
# ThenesVara/Checkers_Staubli, AA_Chessie.dtx @ 6129e2fb29f4b3461ddd9c3177d49867b4a5be20.
#
# Configuration: `lefty` where the wrist centre lies ahead of axis 1, as the arm faces, else
# `righty`; `epositive` where axis 3 is not negative, else `enegative`; `wpositive` where axis 5 is
# not negative, else `wnegative`. Two public post processors write them this way (RoboDK's,
# visose/Robots); the point of that project agrees in the first two, but has wpositive where axis 5
# is
# -14 deg. A straight move keeps the configuration, so that points may have "the same" instead.
# Points contain no turns.

SAME = ("ssame", "esame", "wsame")
"""Words of a point that keeps the configuration."""

COUNT = AxisCount()
axes_from_joints = COUNT.from_joints
joints_from_axes = COUNT.to_joints
NOISE = 1e-8
"""Sines and lengths (m) below zero by less than this count as zero."""


def posture(robot: Robot, q: Array, settings: Val3Settings) -> list[tuple[int | str, ...]]:
    """Return the words of points for shoulder, elbow and wrist at joint vectors q (K, 6) rad."""
    return [SAME] * len(q) if settings.configurations == "same" else configurations(robot, q)


def configurations(robot: Robot, q: ArrayLike) -> list[tuple[int | str, ...]]:
    """Return the words for shoulder, elbow and wrist at joint vectors q (K, 6) rad."""
    axes = axes_from_joints(robot, q)
    ahead, _ = wrist_in_plane(robot, floats(q, "q", (None, 6)))
    _, _, q3, _, q5, _ = axes.T
    words = (
        np.where(ahead < -NOISE, "righty", "lefty").tolist(),
        np.where(np.sin(q3) < -NOISE, "enegative", "epositive").tolist(),
        np.where(np.sin(q5) < -NOISE, "wnegative", "wpositive").tolist(),
    )
    return list(zip(*words, strict=True))


# -----------------------------------------------------------------------------
# Issues that only VAL 3 has.


def check(program: Program, settings: Val3Settings) -> Iterator[ProgramIssue]:
    """Yield the issues that only this language has."""
    for section in program.sections:
        yield from warn_of_late_switches(section, "VAL 3")
        q = np.array([move.q for move in section.moves]).reshape(-1, 6)
        yield from warn_of_changed_postures(section, configurations(program.robot, q))
