"""What the [program] and [audit] tables say, in SI: a program's options, what an audit allows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.auditor import Check, Rounding, checks
from kerfpath.cell import Cell
from kerfpath.contour import Contour
from kerfpath.job.format.tables import AuditTable, ProgramTable
from kerfpath.plans import Plan
from kerfpath.post import (
    Handshake,
    LanguageSettings,
    Program,
    ProgramIssue,
    Zone,
    build_program,
    issues_before_planning,
)
from kerfpath.robots import Robot
from kerfpath.transfer import TransferMove

__all__ = ["ProgramOptions", "Tolerances", "program_options", "tolerances_of"]

_NAME_LENGTH = 32
"""Characters that a robot controller takes in a name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramOptions:
    """What the robot program needs beyond the plan.

    Parameters
    ----------
    language : str
        Robot language, or "none".
    settings : LanguageSettings or None
        Those of the language.
    name, retract, zone, zone_error, lead_time, pierce_time, approach_speed, air_speed,
    arc_tolerance, gas_lead, handshakes
        As in `kerfpath.post.build_program`.
    """

    language: str
    name: str
    retract: float
    zone: Zone
    zone_error: float
    settings: LanguageSettings | None
    lead_time: float
    pierce_time: float
    approach_speed: float
    air_speed: float | None
    arc_tolerance: float | None
    gas_lead: float | None
    handshakes: tuple[Handshake, ...] = ()

    __repr__ = short_repr

    def program(self, plans: Sequence[Plan], moves: Sequence[TransferMove] = ()) -> Program:
        """Return the neutral program that cuts the plans, see `kerfpath.post.build_program`.

        Raises
        ------
        InputError
            As there.
        """
        return build_program(
            plans,
            moves=moves,
            name=self.name,
            retract=self.retract,
            zone=self.zone,
            zone_error=self.zone_error,
            lead_time=self.lead_time,
            gas_lead=self.gas_lead,
            pierce_time=self.pierce_time,
            approach_speed=self.approach_speed,
            air_speed=self.air_speed,
            arc_tolerance=self.arc_tolerance,
            handshakes=self.handshakes,
        )

    def issues(self, cuts: Sequence[tuple[str, float]], robot: Robot) -> list[ProgramIssue]:
        """Return what the language refuses of cuts, see `kerfpath.post.issues_before_planning`."""
        return issues_before_planning(
            cuts,
            robot,
            self.language,
            self.settings,
            name=self.name,
            zone=self.zone,
            lead_time=self.lead_time,
            gas_lead=self.gas_lead,
            pierce_time=self.pierce_time,
            approach_speed=self.approach_speed,
            handshakes=self.handshakes,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """What the audit allows between the nodes.

    Parameters
    ----------
    path : float m
        Largest distance of the tool tip from the path.
    axis : float rad
        Largest angle of the tool axis from the one asked for.
    """

    path: float
    axis: float

    __repr__ = short_repr

    def checks(
        self,
        plan: Plan,
        *,
        reference: Contour | None = None,
        cell: Cell | None = None,
        rounding: Rounding | None = None,
    ) -> list[Check]:
        """Return the audit's table of a plan within these tolerances, see `auditor.checks`."""
        return checks(
            plan,
            reference=reference,
            path_tolerance=self.path,
            axis_tolerance=self.axis,
            cell=cell,
            rounding=rounding,
        )


def tolerances_of(table: AuditTable) -> Tolerances:
    """Return what an [audit] table allows."""
    return Tolerances(
        path=table.path_tolerance_mm / 1000, axis=float(np.radians(table.axis_tolerance_deg))
    )


def program_options(table: ProgramTable, stem: str, allowed: Tolerances) -> ProgramOptions:
    """Return the options of a [program] table; `stem` names the program where it does not.

    Corners are rounded as far as the path may be left, where the table does not say how far.
    """
    error = table.zone_error_mm
    stem = re.sub(r"[^A-Za-z0-9_]", "_", stem)
    stem = stem if stem[:1].isascii() and stem[:1].isalpha() else f"job_{stem}"
    return ProgramOptions(
        language=table.language,
        name=table.name or stem[:_NAME_LENGTH],
        retract=table.retract_mm / 1000,
        zone=table.zone_mm if table.zone_mm == "auto" else table.zone_mm / 1000,
        zone_error=allowed.path if error is None else error / 1000,
        settings=table.settings(),
        lead_time=table.lead_time_s,
        pierce_time=table.pierce_time_s,
        approach_speed=table.approach_mm_s / 1000,
        air_speed=table.air_speed,
        arc_tolerance=None if table.arcs_mm is None else table.arcs_mm / 1000,
        gas_lead=table.gas_lead_s,
        handshakes=table.handshakes(),
    )
