"""An ABB controller: its settings, axes and external axes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, StringConstraints

from kerfpath.arrays import Array, Ints, floats, freeze, short_repr
from kerfpath.post.build import (
    AxisCount,
    axes_that_carry,
    calibration_remarks,
    from_controller_units,
    setup_remarks,
    to_controller_units,
    wrist_in_plane,
)
from kerfpath.post.languages import (
    Controller,
    Inherited,
    OrientationSetting,
    PositionerFrame,
    PowerSettings,
    Rules,
    ShortestMove,
    number,
    plain,
    setting,
)
from kerfpath.robots import MOST_EXTERNAL, Robot

# -----------------------------------------------------------------------------
# Axes of ABB controllers, and the configuration (confdata) of a pose.
#
# From ABB's manuals: cf1, cf4 and cf6 are the quarter turns of axes 1, 4 and 6, 0 for 0 to 90 deg,
# -1 for -90 to 0 deg, unbounded both ways; cfx numbers the eight postures of a bending-backwards
# arm by three bits: 4 = wrist centre behind axis 1, 2 = wrist centre behind the lower arm, 1 =
# axis 5 negative. We read "behind" as follows: 4 where the wrist centre lies on the side of axis 1
# away from which the arm faces, 2 where it lies behind the extended line from axis 2 through axis
# 3. That bit therefore changes at the stretched arm, where the elbow is singular. RobotStudio
# agrees at 28 positions of an IRB 6700, which others published (tests/post/test_measured.py).

UPRIGHT = (0.0, 0.0, -90.0, 0.0, 0.0, 0.0)
"""ABB's axes (deg) where the angles of the model are 0, with the arm upright."""
ROD = np.eye(6) + np.outer(np.eye(6)[2], np.eye(6)[1])
"""With a parallel rod, axis 3 is joint 2 + joint 3."""
SERIAL = AxisCount(counted_from=UPRIGHT, shift=np.radians(UPRIGHT))
HORIZONTAL = replace(SERIAL, matrix=ROD)
NOISE_DECIMALS = 6
"""Angles are rounded to this many decimals (deg) before their quadrant: -1e-15 deg is zero."""


def axes_from_joints(robot: Robot, q: ArrayLike) -> Array:
    """Return the controller's axes (K, 6) rad of the arm for joint vectors q (K, n) rad.

    With a parallel rod (IRB 2400, IRB 4400: `Robot.axis_3` is "horizontal"), axis 3 is joint 2 +
    joint 3. Descriptions that count joints differently from ABB are converted by the arm's model.
    """
    return _count(robot).from_joints(robot, q)


def joints_from_axes(robot: Robot, axes: ArrayLike) -> Array:
    """Return the joints (K, 6) rad of the arm for the controller's axes (K, 6) rad."""
    return _count(robot).to_joints(robot, axes)


def _count(robot: Robot) -> AxisCount:
    return HORIZONTAL if robot.axis_3 == "horizontal" else SERIAL


def confdata(robot: Robot, q: ArrayLike) -> Ints:
    """Return cf1, cf4, cf6 and cfx, (K, 4), for joint vectors q (K, n) rad.

    The docstring of the module says what is from ABB's manuals and what is our reading.
    """
    q = floats(q, "q", (None, robot.joints))
    ahead, bend = wrist_in_plane(robot, q)
    axes_deg = np.round(np.degrees(axes_from_joints(robot, q)), NOISE_DECIMALS)
    conf = np.empty((len(q), 4), dtype=np.int64)
    conf[:, :3] = np.floor(axes_deg[:, [0, 3, 5]] / 90.0)
    conf[:, 3] = 4 * (ahead < 0) + 2 * (bend < 0) + (axes_deg[:, 4] < 0)
    return freeze(conf)


def posture(robot: Robot, q: Array, settings: object) -> list[tuple[int | str, ...]]:
    """Return `confdata` for joint vectors q (K, n) rad, as tuples."""
    return [tuple(row) for row in confdata(robot, q).tolist()]


# -----------------------------------------------------------------------------
# Settings of an ABB controller, and rules of its programs.

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
SHORTEST_MS = 24.0
"""Shortest time (ms) of a move of the path, if the settings give none."""
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
Analogue = Annotated[Name | None, setting("the name of an analogue output", '"aoPower"')]
Units = Annotated[
    Annotated[list[Name], Field(min_length=1, max_length=MOST_EXTERNAL)] | None,
    setting("a list of mechanical units, one name for each external axis", '["TRACK_1", "STN_1"]'),
]
Letters = Annotated[
    Annotated[str, StringConstraints(pattern=r"^[a-f]{1,3}$")] | None,
    setting("letters from a to f, one for each external axis", '"ab"'),
]
Folder = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_:/.\-]{1,60}$")]


class RapidSettings(PowerSettings, output=Request, input=Input, analogue=Analogue):
    """Names of outputs, inputs, frames and units at the controller."""

    laser_output: Annotated[Name, setting("the name of a digital output", '"doLaser"')] = "doLaser"
    gas_output: Annotated[Name | None, setting("the name of a digital output", '"doGas"')] = None
    tool_name: Annotated[Name, setting("a name for the tool", '"tLaser"')] = "tLaser"
    folder: Annotated[Folder, setting("a folder of the controller", '"HOME:"')] = "HOME:"
    work_object: Annotated[Name, setting("a name for the part's frame", '"wPart"')] = "wPart"
    orientation: OrientationSetting = "slerp"
    shortest_move_ms: ShortestMove = None
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
        controller=Controller(
            turning_speed=float(TURNING_SPEED),
            orientation=settings.orientation,
        ).with_shortest(settings.shortest_move_ms, SHORTEST_MS),
        longest_lead=LONGEST_LEAD,
    )


def inherited(settings: RapidSettings) -> tuple[Inherited, ...]:
    """Return the states that another routine may have left, which PP to Main alone resets."""
    singular = "Wrist" if settings.orientation == "wrist" else "Off"
    return (
        Inherited(
            state="configuration",
            lines=(r"ConfL\Off;", r"ConfJ\Off;"),
            why="the configuration of a target is not supervised",
        ),
        Inherited(
            state="singularity",
            lines=(rf"SingArea\{singular};",),
            why="how the tool turns between targets",
        ),
        Inherited(
            state="displacement",
            lines=("PDispOff;", "EOffsOff;"),
            why="of the program, and offsets of external axes",
        ),
        Inherited(
            state="speed",
            lines=("VelSet 100,vmax.v_tcp;", "SpeedRefresh 100;"),
            why="overrides of the program; not that of the operator",
        ),
        Inherited(
            state="acceleration",
            lines=("AccSet 100,100;", "PathAccLim FALSE,FALSE;", r"WorldAccLim \Off;"),
            why="shares and limits of it",
        ),
        Inherited(state="softness", lines=("SoftDeact;",), why="of the servos"),
        Inherited(state="path correction", why=r"no move has `\Corr`"),
        Inherited(state="tool and work object", why="each move names them"),
        Inherited(
            state="collision detection, independent axes",
            why="left to the caller: their instructions are there only with an option",
        ),
    )


def is_reserved(name: str) -> bool:
    """Return whether RAPID or every ABB controller gives `name` another meaning."""
    return name.lower() in RESERVED or PREDEFINED.fullmatch(name) is not None


# -----------------------------------------------------------------------------
# External axes in RAPID: their letters, mechanical units and speeds.
#
# A target gives each external axis under a letter, eax_a to eax_f, in mm or deg; 9E9 means no axis.
# A unit that carries the part moves the user frame of the work object that names it (wobjdata:
# ufprog FALSE, ufmec). The calibration of the unit defines that frame, and the object frame is the
# part in it. A track moves the base of the robot, which the controller knows from its own
# configuration; a fixed work object is in the world.

LETTERS = "abcdef"
NONE = "9E9"
ABSENT = 9e9
"""Value for an axis that does not exist."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExternalSpeeds:
    """v_leax (mm/s) and v_reax (deg/s) of speed data.

    Parameters
    ----------
    linear_mm_s, rotary_deg_s : float
        Speeds of linear and rotary axes at full speed.
    shared : bool
        Whether joint moves at a share of the full speed also take that share of these speeds.
    """

    linear_mm_s: float = 5000.0
    rotary_deg_s: float = 1000.0
    shared: bool = False

    __repr__ = short_repr

    def said(self, share: float) -> str:
        """Return both speeds as text, at a share of the full speed."""
        share = share if self.shared else 1.0
        return f"{number(share * self.linear_mm_s, 0)},{number(share * self.rotary_deg_s, 0)}"


NO_EXTERNAL = ExternalSpeeds()
"""Speeds for an arm alone, because speed data must contain some."""


class ExternalUnits:
    """The external axes of a robot as its controller knows them.

    Parameters
    ----------
    robot : Robot
    settings : RapidSettings
        Names of a unit and letters for every axis; `missing` reports before if they lack.
    """

    def __init__(self, robot: Robot, settings: RapidSettings) -> None:
        self.robot = robot
        count = len(robot.externals)
        self.frame = settings.positioner_frame
        self.units: Sequence[str] = (settings.mechanical_units or [])[:count]
        self.letters = (settings.external_letters or LETTERS)[:count]
        carrying = [self.units[i] for i in axes_that_carry(robot, "part") if i < len(self.units)]
        self.coupled = carrying[0] if carrying else ""
        """The unit that carries the part; empty if none does."""

    @property
    def speeds(self) -> ExternalSpeeds:
        """The largest speeds of the linear and rotary axes."""
        robot = self.robot
        if not robot.externals:
            return NO_EXTERNAL
        own = robot.speed_limits()[0][robot.family.joints :]
        linear = [1e3 * v for v, a in zip(own, robot.externals, strict=True) if a.kind == "linear"]
        turning = [
            float(np.degrees(v))
            for v, a in zip(own, robot.externals, strict=True)
            if a.kind == "rotary"
        ]
        return ExternalSpeeds(
            linear_mm_s=max(linear, default=NO_EXTERNAL.linear_mm_s),
            rotary_deg_s=max(turning, default=NO_EXTERNAL.rotary_deg_s),
            shared=True,
        )

    def values(self, q: Array) -> list[str]:
        """Return the text of the external axes in targets at joint vectors q (K, n)."""
        texts = []
        for row in to_controller_units(self.robot, q).tolist():
            values = dict(zip(self.letters, row, strict=True))
            words = [number(values[c], 6) if c in values else NONE for c in LETTERS]
            texts.append(f"[{','.join(words)}]")
        return texts

    def read(self, values: Sequence[float]) -> Array | str:
        """Return the values (E,) m and rad in a target, or what is wrong with them."""
        axes = self.robot.externals
        names = {c: axis.name for c, axis in zip(self.letters, axes, strict=True)}
        for letter, value in zip(LETTERS, values, strict=True):
            if letter in names and value == ABSENT:
                return f"eax_{letter} has no value for {names[letter]}"
            if letter not in names and value != ABSENT:
                return f"eax_{letter} = {value:g}: the robot has no such axis, expected {NONE}"
        said_values = [values[LETTERS.index(letter)] for letter in self.letters]
        return from_controller_units(self.robot, said_values) if axes else freeze(np.zeros(0))

    def activated(self) -> list[str]:
        """Return the lines that activate every unit; the robot is stopped."""
        return [f"ActUnit {unit};" for unit in dict.fromkeys(self.units)]

    def deactivated(self) -> list[str]:
        """Return the lines that deactivate the unit that carries the part; a track stays active."""
        return [f"DeactUnit {self.coupled};"] if self.coupled else []

    def remarks(self) -> Iterator[str]:
        """Yield remarks on what must be set up at the controller."""
        yield from map(plain, setup_remarks(self.robot))
        for axis, unit, letter in zip(self.robot.externals, self.units, self.letters, strict=True):
            yield f"{plain(axis.name)} is eax_{letter}, of the mechanical unit {unit}."
        if self.coupled:
            yield from calibration_remarks(self.robot, self.coupled, self.frame)


def missing(robot: Robot, settings: RapidSettings) -> Iterator[str]:
    """Yield what is missing or wrong in the settings for a robot's external axes."""
    count, letters = len(robot.externals), settings.external_letters
    names = ", ".join(axis.name for axis in robot.externals)
    for key, values, what in (
        ("mechanical_units", settings.mechanical_units or (), "mechanical unit"),
        ("external_letters", letters or LETTERS[:count], "letter"),
    ):
        if len(values) != count:
            yield (
                f"expected a {what} for each external axis ({names}), got {len(values)}; name them "
                f"with {key} in [program.rapid]"
            )
    if len(set(letters or "")) < len(letters or ""):
        yield f"external_letters: two external axes have the same letter, {letters!r}"
    units = list(zip(settings.mechanical_units or (), robot.externals, strict=False))
    carry = {what: {u for u, axis in units if axis.carries == what} for what in ("part", "robot")}
    if len(carry["part"]) > 1:
        yield (
            f"the part is carried by {' and '.join(sorted(carry['part']))}; a work object can be "
            "coordinated with one mechanical unit only"
        )
    for unit in sorted(carry["part"] & carry["robot"]):
        yield f"the mechanical unit {unit} cannot carry both robot and part; name two"
