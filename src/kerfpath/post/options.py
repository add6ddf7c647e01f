"""Program options: one object with what a program needs beyond its plans, and its language."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

from kerfpath.arrays import not_negative, short_repr
from kerfpath.errors import InputError
from kerfpath.post.arcs import Zone
from kerfpath.post.languages import Language, LanguageSettings, Rules, language, plain
from kerfpath.post.power import (
    PierceStages,
    PowerBySpeed,
    PowerCurve,
    PowerFollows,
    pierce_stages,
    power_curve,
)
from kerfpath.post.program import Gas, Handshake
from kerfpath.setting import check, documented, setting


class ProgramKeywords(TypedDict, total=False):
    """The options that `build_program` takes as keywords."""

    name: str
    retract: float
    zone: Zone
    zone_error: float
    lead_time: float
    gas_lead: float | None
    gas: Gas
    pierce_time: float
    approach_speed: float
    air_speed: float | None
    start_speed: float
    arc_tolerance: float | None
    thin_tolerance: float
    handshakes: Sequence[Handshake]
    remarks: Sequence[str]
    power_by_speed: PowerCurve | None
    power_step: float
    power_follows: PowerFollows
    pierce_stages: PierceStages | None
    pierce_power: float | None
    contours: Mapping[str, ProgramKeywords]


PIERCE = ("pierce_time", "pierce_stages", "pierce_power")
"""Options of the pierce, which replace each other."""
OF_CONTOURS = (*PIERCE, "gas_lead", "gas", "power_by_speed")
"""Options that a contour may have of its own."""
PIECE = ", piece "
"""What comes between the name of a contour and the number of one of its pieces."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramOptions:
    """Options of a program: its language, its name, and the process values of its contours.

    Raises
    ------
    InputError
        A number below its bounds.
    """

    language: str = setting(
        "rapid",
        "robot language, see `languages`; in a job also none, for no program",
        what="a robot language, or none for no program",
        example='"rapid"',
    )
    settings: LanguageSettings | None = setting(
        None,
        "settings of the language; none: its defaults",
        takes=None,
    )
    name: str = setting(
        "",
        "name of the program, made an identifier; empty: cut and the first contour, in a job the "
        "name of its file",
    )
    retract: float = setting(
        50.0,
        "how far the tool backs off before and after a contour",
        unit="mm",
        above=0,
        example="50",
    )
    zone: Zone = setting(
        "auto",
        "radius within which the corners at the inner nodes may be rounded. It is halved where "
        "nodes are close, until zones do not overlap. auto: up to half way to the next node, "
        "which keeps the limits between the nodes; see `kerfpath.execution`",
        unit="mm",
        what='"auto" or a number not below 0',
        example='"auto"',
    )
    zone_error: float = setting(
        0.1,
        "largest distance by which the tip may miss a node with `zone` auto; in a job by default "
        "the path tolerance of [audit]",
        unit="mm",
        above=0,
        example="0.1",
        in_jobs=None,
    )
    lead_time: float = setting(
        0.02,
        "time by which the laser is switched before the tip arrives",
        unit="s",
        least=0,
        example="0.02",
    )
    gas_lead: float | None = setting(
        None,
        "time by which the gas is switched on before the tip arrives at the start; none: the "
        "program does not switch the gas",
        unit="s",
        least=0,
        example="0.3",
    )
    gas: Gas = setting(
        "gas",
        "which gas the program switches, of those with an output: gas or gas_2",
        takes=None,
    )
    pierce_time: float = setting(
        0.0,
        "time to wait at the start with the laser on until the beam is through",
        unit="s",
        least=0,
        most=60,
        what="a number from 0 to 60",
        example="0.3",
    )
    approach_speed: float = setting(
        100.0,
        "speed along the tool axis before and after a contour",
        unit="mm/s",
        above=0,
        example="100",
        key="approach_mm_s",
    )
    air_speed: float | None = setting(
        None,
        "share of the full speed of joint moves: a move takes its least time within the limits, "
        "divided by this share. None: 1 with planned transfer moves, else 0.25",
        least=0.01,
        most=1,
        what="a share of the full speed, from 0.01 to 1",
        example="0.25",
    )
    start_speed: float = setting(
        0.1,
        "share of the full speed, at most `air_speed`, of the first move of each contour, because "
        "a program may be begun there from any pose. No standard gives one for automatic mode: "
        "with 0.1, an axis of 180 deg/s moves a tip 2 m away at 0.63 m/s",
        least=0.01,
        most=1,
        what="a share of the full speed, from 0.01 to 1",
        example="0.1",
    )
    arc_tolerance: float | None = setting(
        None,
        "arcs that stay within this distance of the planned path are written as circular moves, "
        "see `with_arcs`; none: no circular moves",
        unit="mm",
        above=0,
        example="0.01",
        key="arcs_mm",
    )
    thin_tolerance: float = setting(
        0.02,
        "where moves are too short for the controller, targets are left out if the move in their "
        "place stays this near; 0: none are left out",
        unit="mm",
        least=0,
        example="0.02",
        key="thin_mm",
    )
    power_by_speed: PowerCurve | None = setting(
        None,
        "the power by the speed that the tip really has: pairs of a share of the programmed speed "
        "and a share of the full power, with straight lines between. None: no program sets the "
        "power. See `kerfpath.execution.with_power`",
        takes=list[list[float]],
        what="pairs [share of the speed, share of the power] from speed 0 to 1",
        example="[[0.0, 0.3], [1.0, 1.0]]",
    )
    power_step: float = setting(
        0.1,
        "step of the power, as a share of the full power; it may differ from `power_by_speed` by "
        "three quarters of it",
        above=0,
        most=0.5,
        example="0.1",
    )
    power_follows: PowerFollows = setting(
        "steps",
        "who sets the power along the path: the program in steps, or the controller in proportion "
        "to the speed that it measures, for which the curve has to be a straight line from 0",
        what="steps or controller",
        example='"steps"',
    )
    pierce_stages: PierceStages | None = setting(
        None,
        "stages of the pierce, one after the other: pairs of a share of the full power and a time, "
        "s; they take the place of `pierce_time` and `pierce_power`, and need `power_by_speed`",
        takes=list[list[float]],
        what="pairs [share of the full power, time in s]",
        example="[[0.4, 0.2], [0.8, 0.2]]",
    )
    pierce_power: float | None = setting(
        None,
        "share of the full power while the beam pierces; none: that of the full speed",
        above=0,
        most=1,
        what="a share of the full power above 0, at most 1",
        example="0.6",
    )
    contours: Mapping[str, ProgramKeywords] = setting(
        dict,
        "what each contour has of its own, by its name: `pierce_time`, `pierce_stages`, "
        "`pierce_power`, `gas_lead`, `gas`, `power_by_speed`; empty: all have the same",
        takes=None,
    )
    handshakes: Sequence[Handshake] = setting(
        (),
        "handshakes before each contour, in order, with the tool backed off. Requests are "
        "withdrawn after the contour",
        takes=None,
    )

    remarks: Sequence[str] = setting(
        (),
        "lines for the comment at the head of the program, as the values that the operator sets",
        takes=None,
    )

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check(self)
        if self.power_by_speed is not None:
            object.__setattr__(self, "power_by_speed", power_curve(self.power_by_speed))
        if self.pierce_stages is not None:
            self._take_stages(pierce_stages(self.pierce_stages))
        if self.zone != "auto":
            object.__setattr__(self, "zone", not_negative(self.zone, "zone", unit="m"))
        object.__setattr__(self, "handshakes", tuple(self.handshakes))
        object.__setattr__(self, "remarks", tuple(map(plain, self.remarks)))
        self._check_contours()

    def _take_stages(self, stages: PierceStages) -> None:
        """Take the time of the pierce from its stages."""
        took = round(sum(time for _, time in stages), 9)
        if self.power_by_speed is None:
            raise InputError("pierce_stages: expected power_by_speed with it, got none; add it")
        if self.pierce_power is not None or self.pierce_time not in (0.0, took):
            raise InputError(
                "pierce_stages: expected no other time or power of the pierce with it, got both; "
                "leave pierce_time and pierce_power out"
            )
        object.__setattr__(self, "pierce_stages", stages)
        object.__setattr__(self, "pierce_time", took)

    def _check_contours(self) -> None:
        """Check the options of each contour: gas and power are switched in all of them or none."""
        for name, own in self.contours.items():
            if unknown := [key for key in own if key not in OF_CONTOURS]:
                raise InputError(
                    f"contours: expected {', '.join(OF_CONTOURS)} for {name!r}, got {unknown[0]!r}"
                )
        for key in ("gas_lead", "power_by_speed"):
            lacks = [name for name in self.contours if getattr(self.of(name), key) is None]
            if lacks and len(lacks) < len(self.contours):
                raise InputError(
                    f"contours: expected {key} for every contour or for none, got none for "
                    f"{lacks[0]!r}"
                )

    def of(self, contour: str) -> ProgramOptions:
        """Return the options of a contour, or of a piece of one, by its name.

        Raises
        ------
        InputError
            Other contours have options of their own, but this one is not among them.
        """
        if not self.contours:
            return self
        own = self.contours.get(contour, self.contours.get(contour.rpartition(PIECE)[0]))
        if own is None:
            raise InputError(f"contours: expected options for {contour!r}, got none")
        keywords: dict[str, Any] = {**own, "contours": {}}
        if {"pierce_time", "pierce_stages"} & set(own):
            keywords = {"pierce_time": 0.0, "pierce_stages": None} | keywords
        return replace(self, **keywords)

    def pierce_times(self, contours: Sequence[str]) -> float | tuple[float, ...]:
        """Return the time to pierce at each contour, s; one number if all have the same."""
        if not self.contours:
            return self.pierce_time
        return tuple(self.of(name).pierce_time for name in contours)

    @property
    def pierce(self) -> PierceStages:
        """The stages of the pierce; without a power that is set, one of any share."""
        if self.pierce_stages is not None:
            return self.pierce_stages
        share = 1.0 if self.power is None else self.power.piercing
        return ((share, self.pierce_time),) if self.pierce_time > 0 else ()

    @property
    def robot_language(self) -> Language:
        """The language itself."""
        return language(self.language)

    @property
    def language_settings(self) -> LanguageSettings:
        """The settings of the language, complete."""
        return self.robot_language.completed(self.settings)

    @property
    def power(self) -> PowerBySpeed | None:
        """How the power follows the speed; None if no program sets it."""
        if self.power_by_speed is None:
            return None
        return PowerBySpeed(
            curve=self.power_by_speed,
            step=self.power_step,
            pierce=self.pierce_power,
            follows=self.power_follows,
        )

    @property
    def rules(self) -> Rules:
        """The rules of programs in the language with these settings."""
        return self.robot_language.rules(self.language_settings)
