"""Program options and audit tolerances, in SI, from the [program] and [audit] tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath.arrays import short_repr
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

_NAME_LENGTH = 32
"""Longest name, in characters, that robot controllers take."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramOptions:
    """What the robot program needs beyond the plan.

    Parameters
    ----------
    language : str
        Robot language, or "none".
    settings : LanguageSettings or None
        Settings of the language.
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
            As `kerfpath.post.build_program`.
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
        """Return the issues of the language, see `kerfpath.post.issues_before_planning`.

        `cuts` are the names of the contours and their speeds in m/s.
        """
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
    """Tolerances of the audit between the nodes.

    Parameters
    ----------
    path : float m
        Largest distance of the tool tip from the path.
    axis : float rad
        Largest angle between the tool axis and the requested one.
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
    """Return the tolerances of an [audit] table, in SI."""
    return Tolerances(
        path=table.path_tolerance_mm / 1000, axis=float(np.radians(table.axis_tolerance_deg))
    )


def program_options(table: ProgramTable, stem: str, allowed: Tolerances) -> ProgramOptions:
    """Return the options of a [program] table; a program without a name is named after `stem`.

    Without zone_error_mm, corners may be rounded by the path tolerance that is `allowed`.
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
