"""Which pairs of bodies are judged against each other; of every other pair, why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from kerfpath.cell._bodies import Body
from kerfpath.cell._scene import Scene
from kerfpath.urdf import Chain

__all__ = ["Places", "always_near", "fixed_together"]

Places = tuple[int, int]
"""Two bodies by their places in the cell, the one in the earlier frame first."""

ARM = {"robot", "head"}
JOINTS = 3
"""Links with more joints between them do not overlap by design, however they overlap."""
TRIED = (1, 15, 112)
"""Joint vectors tried, in rounds: all at zero, then random ones."""


def fixed_together(one: Body, two: Body) -> str:
    """Say why two bodies need no judging whatever their shapes; nothing where they do."""
    if one.frame == two.frame:
        return "do not move against each other"
    if {one.kind, two.kind} <= ARM and abs(one.frame - two.frame) == 1:
        return f"joined by joint {max(one.frame, two.frame)}"
    return ""


def always_near(
    chain: Chain, bodies: Sequence[Body], required: Mapping[Places, float]
) -> set[Places]:
    """Return the pairs of the arm that are nearer than `required` (m) at every pose tried.

    Links of a compact wrist and capsules drawn too thick overlap over two or three joints: such
    pairs say nothing about a pose. At `TRIED` poses, limits ignored.
    """
    near = [
        (a, b)
        for a, b in required
        if {bodies[a].kind, bodies[b].kind} <= ARM
        and 1 < bodies[b].frame - bodies[a].frame <= JOINTS
    ]
    if not near:
        return set()
    held = sorted({i for pair in near for i in pair})
    scene = Scene([bodies[i] for i in held], np.searchsorted(held, near))
    needed = np.array([required[pair] for pair in near])
    rng = np.random.default_rng(2008)
    left = np.ones(len(near), bool)
    for count in TRIED:
        q = rng.uniform(-np.pi, np.pi, (count, len(chain.axes))) * (count > 1)
        apart = scene.distances(chain.frames(q), needed + 1e-9, np.tile(left, (count, 1)))
        left &= (np.where(left, apart, np.inf) <= needed).all(axis=0)
    return {pair for pair, is_near in zip(near, left, strict=True) if is_near}
