"""An oracle for which edits of a program do harm.

It is independent of the audit: it compares, step by step, what the reader makes of the text before
and after. If that is the same, the edit is harmless only if it touched nothing but what the `Words`
of the language list as harmless: any other text that a controller reads and our reader ignores
counts as harm.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._program_edits import Edit
from kerfpath.post import ReadHandshake, ReadMove, ReadProgram, ReadStep, ReadWait

__all__ = ["Verdict", "verdict"]

Verdict = Literal["harmful", "harmless", "either"]
"""Verdict on an edit: it must not pass; it must pass; or it may do either and is only counted."""
ALONG, TURNED = 0.25e-3, np.radians(1.5)
"""Least motion of a node (m) and of its axis (rad) that does harm: the job allows 0.1 mm, 1 deg."""
EXACT, SHARP = 2e-5, np.radians(0.02)
"""The same for targets outside the cut (m) and for joints (rad)."""
TIME = 2.5e-3
"""The same for waits and lead times, s: controllers count milliseconds."""
RATE = 0.025
"""The same for speeds, as a share."""
JUMP = 0.1
"""Least deviation of an external axis at one node (m, rad) that does harm: less may be within its
limits, and the arm follows."""


def verdict(edit: Edit, before: ReadProgram, after: ReadProgram) -> Verdict:
    """Return the verdict on an edit, from the meaning of the text before and after it."""
    found = _compared(before, after)
    if found == "same" and edit.idle:
        return "harmless" if edit.remark else "either"
    return "harmful" if found == "same" else found


def _compared(one: ReadProgram, two: ReadProgram) -> Literal["same", "either", "harmful"]:
    for what in ("T_flange_tip", "T_base_part"):
        a, b = getattr(one, what), getattr(two, what)
        if a is not None and np.abs(a - b).max() > EXACT:
            return "harmful"
    if len(one.steps) != len(two.steps):
        return "harmful"
    frames = ("T_flange_tip", "T_base_part")
    same = all(np.array_equal(getattr(one, what), getattr(two, what)) for what in frames)
    for k, (a, b) in enumerate(zip(one.steps, two.steps, strict=True)):
        found = _step(a, b, cut=_in_cut(one.steps, k))
        if found == "harmful":
            return "harmful"
        same = same and found == "same"
    return "same" if same else "either"


def _in_cut(steps: tuple[ReadStep, ...], k: int) -> bool:
    """Return whether a step is a node of a contour: neither its approach nor its retract."""
    step = steps[k]
    if not isinstance(step, ReadMove) or step.kind == "joint":
        return False
    rest = [s for s in steps[k + 1 :] if isinstance(s, ReadMove)]
    return bool(rest) and rest[0].kind != "joint"


def _step(a: ReadStep, b: ReadStep, *, cut: bool) -> Literal["same", "either", "harmful"]:
    if isinstance(a, ReadWait) and isinstance(b, ReadWait):
        return _far(a.time, b.time, TIME)
    if isinstance(a, ReadHandshake) and isinstance(b, ReadHandshake):
        return "same" if a.what == b.what else "harmful"
    if not isinstance(a, ReadMove) or not isinstance(b, ReadMove):
        return "harmful"
    if a.kind != b.kind or a.posture != b.posture or (a.zone is None) != (b.zone is None):
        return "harmful"
    switches = [[(s.signal, s.on) for s in move.switches] for move in (a, b)]
    if switches[0] != switches[1]:
        return "harmful"
    point, angle = (ALONG, TURNED) if cut else (EXACT, SHARP)
    found = [
        _far(s.lead_time, t.lead_time, TIME) for s, t in zip(a.switches, b.switches, strict=True)
    ]
    for one, two, most in (
        (a.speed, b.speed, RATE * (a.speed or 1)),
        (a.duration, b.duration, RATE * (a.duration or 1)),
        (a.zone, b.zone, EXACT),
    ):
        found.append(_far(one or 0.0, two or 0.0, most))
    if (a.T_part_tip is None) != (b.T_part_tip is None) or (a.q is None) != (b.q is None):
        return "harmful"
    if (
        a.T_part_tip is not None
        and b.T_part_tip is not None
        and (a.T_part_tip != b.T_part_tip).any()
    ):
        apart = float(np.linalg.norm(a.T_part_tip[:3, 3] - b.T_part_tip[:3, 3]))
        cosine = float(np.clip(a.T_part_tip[:3, 2] @ b.T_part_tip[:3, 2], -1, 1))
        turned = Rotation.from_matrix(a.T_part_tip[:3, :3].T @ b.T_part_tip[:3, :3]).magnitude()
        found += [_far(0, apart, point), _far(0, np.arccos(cosine), angle)]
        # The tool may turn about the beam freely, within the limits of the joints.
        found += [_far(0, float(turned), np.inf if cut else angle)]
    if (a.external is None) != (b.external is None):
        return "harmful"
    if a.external is not None and b.external is not None:
        aside = float(np.abs(a.external - b.external).max())
        found.append(_far(0, aside, JUMP if cut else EXACT))
    if a.q is not None and b.q is not None and (a.q != b.q).any():
        off = float(np.abs(a.q - b.q).max())
        found.append(_far(0, off, np.radians(5) if cut else angle))
    return max(found, key=["same", "either", "harmful"].index)


def _far(one: float, two: float, most: float) -> Literal["same", "either", "harmful"]:
    if one == two:
        return "same"
    return "harmful" if abs(one - two) > most else "either"
