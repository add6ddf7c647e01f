"""Check the names, numbers and outputs of a program before there is a plan for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kerfpath._names import identifier, identifiers
from kerfpath.post._issue import ProgramIssue
from kerfpath.post._languages import language as find_language
from kerfpath.post._preflight import foresee
from kerfpath.post._program import Handshake, JointMove, LinearMove, Program, Section, Switch, Wait
from kerfpath.post._settings import LanguageSettings
from kerfpath.post._zones import Zone
from kerfpath.robots import Robot

__all__ = ["issues_before_planning"]

SOME_ZONE = 1.23456e-3
"""Zone (m) in place of those that depend on the spacing of nodes and are no round numbers."""


def issues_before_planning(
    cuts: Sequence[tuple[str, float]],
    robot: Robot,
    language: str,
    settings: LanguageSettings | None = None,
    *,
    name: str,
    zone: Zone,
    lead_time: float,
    approach_speed: float,
    pierce_time: float = 0.0,
    gas_lead: float | None = None,
    handshakes: Sequence[Handshake] = (),
) -> list[ProgramIssue]:
    """Return the errors that the program of some cuts will have, whatever its targets are.

    Parameters
    ----------
    cuts : sequence of (str, float m/s)
        Name and speed of each contour.
    robot, language, settings
        As in `preflight`.
    name, zone, lead_time, approach_speed, pierce_time, gas_lead, handshakes
        As in `build_program`.
    """
    chosen = find_language(language)
    settings = chosen.settings() if settings is None else settings
    title = identifier(name)
    names = identifiers((cut for cut, _ in cuts), taken=(title,))
    here, q = np.eye(4), np.zeros(robot.joints)
    radius = SOME_ZONE if zone == "auto" else zone
    sections = []
    for section, (_, speed) in zip(names, cuts, strict=True):
        on = [Switch(signal="laser", on=True, lead_time=lead_time)]
        off = [Switch(signal="laser", on=False, lead_time=lead_time)]
        if gas_lead is not None:
            on.insert(0, Switch(signal="gas", on=True, lead_time=gas_lead))
            off.append(Switch(signal="gas", on=False))
        steps = (
            JointMove(q=q, speed=1.0),
            *handshakes,
            LinearMove(
                T_part_tip=here, q=q, speed=approach_speed, duration=1.0, switches=tuple(on)
            ),
            *([Wait(time=pierce_time)] if pierce_time else []),
            LinearMove(T_part_tip=here, q=q, speed=speed, duration=1.0, zone=radius),
            LinearMove(T_part_tip=here, q=q, speed=speed, duration=1.0, switches=tuple(off)),
        )
        sections.append(Section(name=section, steps=steps))
    outline = Program(
        name=title, robot=robot, T_flange_tip=here, T_base_part=here, sections=tuple(sections)
    )
    return [issue for issue in foresee(outline, chosen, settings) if issue.level == "error"]
