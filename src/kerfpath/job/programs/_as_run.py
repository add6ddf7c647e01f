"""Check the joint limits of a program as a controller runs its text, with rounded corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kerfpath.auditor import MOST_ROUNDED, Check, Rounding
from kerfpath.contour import Contour
from kerfpath.execution import from_stop_to_stop, run_along
from kerfpath.job.as_run import checks_of_unknown, run_judged
from kerfpath.job.format import Job
from kerfpath.job.programs._read import ReadCut
from kerfpath.plans import Plan
from kerfpath.post import CircularMove, Controller, Language, LanguageSettings, LinearMove

__all__ = ["check_run"]

UNSAID = 1.0
"""Zone, m, for a text that gives no length; any value except zero."""
SHORTEST = 1e-9
"""Least duration of a move, s."""


def check_run(
    job: Job, cut: ReadCut, made: Plan, path: Contour, digits: Rounding, chosen: Language,
    settings: LanguageSettings,
) -> list[Check]:  # fmt: skip
    """Return the checks of a cut's motion along a path, by its own zones and speeds.

    The checks allow for the digits of the text, which over short intervals add accelerations.
    """
    if not chosen.zones:
        return [*checks_of_unknown(job, f"{chosen.name} has no zones")]
    controller = chosen.controller(settings)
    if any(move.zone is None for move in cut.targets) and not controller.rounds_by_itself:
        return [*checks_of_unknown(job, f"the zones of {chosen.name} here are not lengths")]
    runs = [
        run_along(
            part, job.robot, T_base_part=job.placement, T_flange_tip=job.tool,
            controller=controller,
        )
        for part in from_stop_to_stop(_moves(cut, controller))
    ]  # fmt: skip
    if not runs:
        return [*checks_of_unknown(job, "the robot stops at every node")]
    run = max(runs, key=lambda each: each.most)
    dq, dt = np.diff(made.q, axis=0), np.diff(made.time)
    velocity, acceleration = job.robot.speed_limits()
    allowed = (
        (digits.of_velocity(dq, dt) / velocity).max(),
        (digits.of_acceleration(dq, dt) / acceleration).max(initial=0.0),
    )
    fast, sharp, *others = run_judged(job, run, made, path).checks
    more = [min(float(each), MOST_ROUNDED) for each in allowed]
    return [
        replace(fast, limit=fast.limit + more[0]),
        replace(sharp, limit=sharp.limit + more[1]),
        *others,
    ]


def _moves(cut: ReadCut, controller: Controller) -> list[LinearMove]:
    """Return the moves of a cut as in its text; of the first one only the end matters.

    If the text gives no length for a zone, it is that of the controller.
    """
    found: list[LinearMove] = []
    before = int(cut.ends[0])
    for move, node in zip(cut.targets, cut.ends, strict=True):
        T, q = cut.T_part_tip[node], cut.q[node]
        took = max(float(cut.took[before:node].sum()), SHORTEST)
        way = np.diff(cut.T_part_tip[before : node + 1, :3, 3], axis=0)
        speed = move.speed or float(np.linalg.norm(way, axis=1).sum()) / took
        zone = controller.zone(UNSAID, speed) if move.zone is None else move.zone
        if move.T_part_via is None:
            made = LinearMove(T_part_tip=T, q=q, speed=speed, duration=took, zone=zone)
        else:
            made = CircularMove(
                T_part_tip=T, q=q, speed=speed, duration=took, zone=zone,
                T_part_via=move.T_part_via, q_via=q,
            )  # fmt: skip
        found.append(made)
        before = int(node)
    return found
