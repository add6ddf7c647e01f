"""The [program] and [audit] tables: what is written, and what is allowed before it is."""

from __future__ import annotations

from typing import Annotated, Literal

from kerfpath.job._keys import Identifier, NotNegative, Positive, key
from kerfpath.job._tables._table import Table

__all__ = ["AuditTable", "ProgramTable"]


class ProgramTable(Table):
    """[program]: the robot program, its language, names and process values."""

    language: Annotated[
        Literal["rapid", "none"], key("a robot language, or none for no program", '"rapid"')
    ] = "rapid"
    name: Identifier | None = None
    retract_mm: Annotated[Positive, key("a number above 0, in mm", "50")] = 50.0
    zone_mm: Annotated[NotNegative, key("a number not below 0, in mm", "0.3")] = 0.3
    laser_output: Identifier = "doLaser"
    lead_time_s: Annotated[NotNegative, key("a number not below 0, in s", "0.02")] = 0.02
    work_object: Identifier = "wPart"
    tool_name: Identifier = "tLaser"
    pierce_time_s: Annotated[NotNegative, key("a number from 0 to 60, in s", "0.3", le=60)] = 0.0
    approach_mm_s: Annotated[Positive, key("a number above 0, in mm/s", "100")] = 100.0
    air_speed: Annotated[
        Positive, key("a number from 0.01 to 1, of the full speed", "0.25", ge=0.01, le=1)
    ] = 0.25


class AuditTable(Table):
    """[audit]: how far the tool may leave the path between the nodes."""

    path_tolerance_mm: Annotated[Positive, key("a number above 0, in mm", "0.1")] = 0.1
    axis_tolerance_deg: Annotated[Positive, key("a number above 0, in deg", "1")] = 1.0
