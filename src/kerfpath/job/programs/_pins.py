"""Check that a program keeps gamma inside the windows of its job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from kerfpath.auditor import Check, window_checks
from kerfpath.job.format import Job
from kerfpath.job.programs._expected import TargetNodes, whole_cut
from kerfpath.job.programs._read import ReadCut
from kerfpath.plans import Plan
from kerfpath.post import Rules
from kerfpath.windows import GammaWindow

__all__ = ["check_pins"]

OUTSIDE = 1e-5
"""Tolerance of targets outside a window, rad, beyond their digits."""


def check_pins(
    job: Job,
    cut: ReadCut,
    asked: TargetNodes,
    plan: Plan,
    windows: Sequence[GammaWindow],
    rules: Rules,
) -> list[Check]:
    """Return the check of a cut's windows of gamma, at the nodes that the job asks for.

    Empty if the tool axis may be tilted, as a text does not state the nominal axis.
    """
    if not windows or job.options.tilt is not None:
        return []
    whole = whole_cut(job, cut, asked, plan)
    settings = replace(whole.settings, gamma_windows=tuple(windows))
    pinned = replace(whole, contour=asked.nodes, settings=settings)
    tool = job.robot.forward(pinned.q) @ job.tool
    # Digits of three angles, or of the four numbers of a quaternion.
    return window_checks(pinned, tool, slack=OUTSIDE + 4 * rules.angle_step)
