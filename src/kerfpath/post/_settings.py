"""Settings of a language: what users state about a controller, and rules of its programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from kerfpath._repr import short_repr
from kerfpath.post._controller import PLAIN, Controller, Orientation
from kerfpath.post._program import PARTNERS, Partner

__all__ = [
    "LanguageSettings",
    "LinesPerFile",
    "OrientationSetting",
    "PortSettings",
    "PositionerFrame",
    "Rules",
    "handshakes",
    "numbered",
    "outputs",
    "setting",
]  # fmt: skip


def setting(expected: str, example: str, **bounds: Any) -> Any:
    """Return a setting with its bounds, and what is expected and an example for messages."""
    return Field(description=expected, examples=[example], **bounds)


def numbered(port: str, most: int, least: int = 1) -> Any:
    """Return a setting that is the number of a port, with its bounds."""
    return setting(f"the number of {port}, {least} to {most}", "5", ge=least, le=most)


LinesPerFile = Annotated[
    int, setting("a whole number of lines from 100 to 1000000", "5000", ge=100, le=1_000_000)
]


OrientationSetting = Annotated[
    Orientation,
    setting("how the tool turns between targets: slerp, two-angle or wrist", '"slerp"'),
]

PositionerFrame = Annotated[
    Annotated[list[float], Field(min_length=6, max_length=6)] | None,
    setting(
        "six numbers: the frame that moves with the part, in the robot base with all external axes "
        "at 0, as x, y, z in mm and rotations about fixed x, y, z in deg",
        "[1200.0, 0.0, 300.0, 0.0, 0.0, 90.0]",
    ),
]
"""For languages that couple the part frame to the axes that carry it; see `carrier_frame`."""


class LanguageSettings(BaseModel):
    """The settings of one language; in jobs the table [program.LANGUAGE]."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    lines_per_file: LinesPerFile = 5000


class PortSettings(LanguageSettings):
    """Settings that name inputs and outputs: of laser and gas, and of handshakes.

    A subclass gives, as keywords, the annotations of an output and an input in its language, with
    bounds and texts for messages. They apply to all fields here that it does not annotate itself.
    """

    laser_output: Any = None
    gas_output: Any = None
    ready_input: Any = None
    shutter_input: Any = None
    gas_pressure_input: Any = None
    height_input: Any = None
    interlock_input: Any = None
    ready_output: Any = None
    shutter_output: Any = None
    height_output: Any = None

    def __init_subclass__(cls, *, output: Any = None, input: Any = None, **others: Any) -> None:
        super().__init_subclass__(**others)
        if output is None:
            return
        own = cls.__annotations__
        ports = [name for name in PortSettings.__annotations__ if name not in own]
        for name in ports:
            setattr(cls, name, None)
        ways = {name: output if name.endswith("_output") else input for name in ports}
        cls.__annotations__ = ways | own


def handshakes(settings: LanguageSettings) -> dict[tuple[Partner, str], Any]:
    """Return the inputs and outputs of handshakes that settings can name, by partner and way."""
    fields = (name.rpartition("_") for name in type(settings).model_fields)
    return {
        (PARTNERS[partner], way): getattr(settings, f"{partner}_{way}")
        for partner, _, way in fields
        if partner in PARTNERS and way in ("input", "output")
    }


def outputs(settings: Any) -> list[Any]:
    """Return all outputs that settings name: laser, gas, and those of requests."""
    requests = (port for (_, way), port in handshakes(settings).items() if way == "output")
    named = (settings.laser_output, settings.gas_output, *requests)
    return [output for output in named if output is not None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """Rules that programs in a language must keep, with given settings.

    Parameters
    ----------
    longest_name : int
        Largest number of characters of a name.
    name : str
        Regular expression that every name matches.
    slowest, fastest : float m/s
        Range of tip speeds that can be written.
    speed_step : float m/s
        Speeds are written as multiples of this.
    controller : Controller
        How the controller runs the path.
    longest_lead : float s
        The longest lead time of a switch on the path.
    point_step, angle_step : float m, rad
        Rounding errors of positions and angles in the digits of targets.
    """

    longest_name: int = 32
    name: str = r"[A-Za-z][A-Za-z0-9_]*"
    slowest: float = 1e-5
    fastest: float = np.inf
    speed_step: float = 0.0
    controller: Controller = PLAIN
    longest_lead: float = np.inf
    point_step: float = 0.0
    angle_step: float = 0.0

    __repr__ = short_repr
