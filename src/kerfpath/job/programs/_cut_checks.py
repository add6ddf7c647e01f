"""The checks of one cut of a program: its path, motion, speeds, nodes and posture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from kerfpath._arrays import Array
from kerfpath.auditor import Check, Rounding, rounding_of
from kerfpath.cell import Cell
from kerfpath.contour import KINDS, Contour
from kerfpath.job.format import Candidate, Job
from kerfpath.job.plan_file import check, count
from kerfpath.job.programs._as_run import check_run
from kerfpath.job.programs._expected import TargetNodes, nodes_at_targets
from kerfpath.job.programs._read import ReadCut
from kerfpath.plans import Plan, Proof
from kerfpath.post import Language, LanguageSettings, Rules

__all__ = ["check_cut"]

SAME_SPEED = 0.02
"""Share by which a speed may differ from that of the job, beyond its digits."""
SAME_TIME = 2e-3
"""Tolerance (s) of lead times and waits against the job; controllers round them."""
CLIMB = 0.05
"""Weight of distances along the path against those from it, in the search for a place on it."""


def check_cut(
    job: Job, candidate: Candidate, cut: ReadCut, cell: Cell | None, chosen: Language,
    settings: LanguageSettings,
) -> tuple[list[Check], tuple[TargetNodes, Plan] | None]:  # fmt: skip
    """Return the checks of a cut, and its nodes and plan if it can be compared with the job."""
    unreached = np.flatnonzero(np.isnan(cut.q).any(axis=1))
    if unreached.size:
        said = "targets out of the robot's reach in the posture of the start"
        return [count("reach", said, unreached.size, int(unreached[0]))], None
    reference = candidate.path
    s, ends = _along(cut, reference)
    rows = [check("ends", "distance of the ends from those of the contour", ends.max(), 1e-4, "m")]
    if (np.diff(s) <= 0).any():
        node = int(np.flatnonzero(np.diff(s) <= 0)[0])
        said = "stretches that go back along the contour"
        return [*rows, count("order", said, (np.diff(s) <= 0).sum(), node)], None
    took = np.where(np.isnan(cut.speed), cut.took, np.diff(s) / cut.speed)
    made = _plan(job, candidate.nodes.name, cut, s, np.append(0.0, np.cumsum(took)))
    allowed, tilt = job.tolerances, job.options.tilt
    if tilt is not None:
        allowed = replace(allowed, axis=allowed.axis + tilt.cone)
    rules = chosen.rules(settings)
    digits = _rounding(cut, made, rules)
    rows += allowed.checks(made, reference=reference, cell=cell, rounding=digits)
    rows += _process_checks(job, candidate, cut, made, digits.time, ahead=chosen.ahead)
    rows += _postures(job, cut, chosen, settings, digits.q)
    rows += check_run(job, cut, made, reference, digits, chosen, settings)
    found = nodes_at_targets(job, candidate, cut, s)
    off, alone = int(np.argmax(found.off)), int(np.argmax(found.alone))
    said = "distance of the targets from the nodes of the job"
    rows.append(check("nodes", said, found.off[off], allowed.path, "m", int(cut.ends[off])))
    said = "targets that skip a node of the job, or are not at a new one"
    rows.append(count("every-node", said, found.alone.sum(), int(cut.ends[alone])))
    return rows, (found, made) if found.complete else None


def _along(cut: ReadCut, reference: Contour) -> tuple[Array, Array]:
    """Return arc lengths (K,) m of the nodes on the contour, and distances (2,) m of its ends.

    If the contour passes the same place twice, the share of the length decides.
    """
    points = cut.T_part_tip[:, :3, 3]
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    guess = reference.s[0] + way / way[-1] * reference.length
    # A drawn line with few corners needs samples as close as the nodes of the cut.
    fine = np.linspace(reference.s[0], reference.s[-1], 8 * max(len(reference), len(points)))
    at = np.unique(np.concatenate([reference.s, fine]))
    tree = cKDTree(np.c_[reference.at(at)[0], CLIMB * at])
    near = np.asarray(tree.query(np.c_[points, CLIMB * guess])[1])
    s = at[near]
    for _ in range(3):  # on the chords beside the nearest sample
        before, after = (
            reference.at(np.maximum(s - 1e-5, at[0]))[0],
            reference.at(np.minimum(s + 1e-5, at[-1]))[0],
        )
        chord = after - before
        step = ((points - reference.at(s)[0]) * chord).sum(axis=1) / np.maximum(
            np.linalg.norm(chord, axis=1), 1e-12
        )
        s = np.clip(s + step, at[0], at[-1])
    ends = np.linalg.norm(points[[0, -1]] - reference.points[[0, -1]], axis=1)
    s[0], s[-1] = reference.s[0], reference.s[-1]
    return s, ends


def _plan(job: Job, name: str, cut: ReadCut, s: Array, time: Array) -> Plan:
    """Return the cut in the text as a plan, so that it can be audited as one."""
    K = len(cut.q)
    return Plan(
        contour=Contour(cut.T_part_tip[:, :3, 3], cut.T_part_tip[:, :3, 2], s=s, name=name),
        robot=job.robot,
        T_flange_tip=job.tool,
        T_base_part=job.placement,
        q=cut.q,
        gamma=np.zeros(K),
        posture=np.zeros(K, dtype=np.int64),
        turn=np.zeros(cut.q.shape, dtype=np.int64),
        time=time,
        settings=replace(job.options, tilt=None, closure="free"),
        cost=0.0,
        proof=Proof(optimal=False, statement="read from a program"),
        counts={},
    )


def _rounding(cut: ReadCut, made: Plan, rules: Rules) -> Rounding:
    """Return the rounding of joints and times of a cut by the digits of a language."""
    jointed = all(move.T_part_tip is None for move in cut.moves)
    time = np.where(np.isnan(cut.speed), 0.0, rules.speed_step / 2 / cut.speed)
    return rounding_of(made, rules.point_step, rules.angle_step, time, jointed=jointed)


def _process_checks(
    job: Job, candidate: Candidate, cut: ReadCut, made: Plan, digits: Array, *, ahead: bool
) -> list[Check]:
    """Compare speeds, switches and waits with those of the job.

    If the language cannot switch `ahead` of a target, it must switch at the target.
    """
    s, nodes, path = made.contour.s, candidate.nodes, candidate.path
    middle = (s[1:] + s[:-1]) / 2
    when = candidate.dt * np.arange(len(nodes))
    k = np.clip(np.searchsorted(path.s, middle, side="right") - 1, 0, len(path) - 1)
    wrong = (path.kind[k] != KINDS.index("micro joint")) != cut.laser
    excess = np.diff(np.interp(s, nodes.s, when)) / np.diff(made.time) - 1
    if job.options.feed == "constant":
        excess = np.abs(excess)
    fast = int(np.argmax(excess - digits))
    most = SAME_SPEED + digits[fast]
    node = int(np.argmax(wrong)) if wrong.any() else 0
    lead = np.abs(cut.lead_times - (job.program.lead_time if ahead else 0.0))
    wait = abs(float(cut.waits.sum()) - job.program.pierce_time)
    lengths = np.diff(s)[wrong].sum()
    return [
        check("speed", "difference of the speed from the job's", excess[fast], most, "share", fast),
        check("laser", "length with the laser wrongly on or off", lengths, 1e-6, "m", node),
        count("laser-off", "laser left on at the end", cut.left_on, len(s) - 1),
        check(
            "lead-time",
            "difference of the laser's lead time from the job's",
            lead.max(initial=0),
            SAME_TIME,
            "s",
        ),
        check("pierce", "difference of the wait at the start from the job's", wait, SAME_TIME, "s"),
    ]


def _postures(
    job: Job, cut: ReadCut, chosen: Language, settings: LanguageSettings, left: Array
) -> list[Check]:
    """Count the targets whose words for posture and turn do not fit the joints there.

    Digits leave joints uncertain by `left` (K, n) rad: that near to a change of a word, both words
    are right.
    """
    moves, q = (*cut.moves, cut.group.path[-1]), np.vstack([cut.q, cut.q_out])
    left = np.vstack([left, left[-1:]])
    worded = [k for k in (*cut.ends.tolist(), len(cut.moves)) if moves[k].posture]
    if not worded or chosen.posture is None:
        return []
    ways = [q[worded] + sign * left[worded] for sign in (0, -1, 1)]
    expected = zip(*(chosen.posture(job.robot, way, settings) for way in ways), strict=True)
    wrong = [
        k
        for k, words in zip(worded, expected, strict=True)
        if len(moves[k].posture) != len(words[0])
        or any(said not in right for said, *right in zip(moves[k].posture, *words, strict=True))
    ]
    said = "targets whose posture or turn differs from the motion"
    return [count("posture", said, len(wrong), wrong[0] if wrong else 0)]
