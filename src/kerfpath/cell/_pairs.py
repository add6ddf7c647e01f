"""The distances that an arm's design leaves between its bodies, hence which pairs can be judged.

Links of a compact wrist overlap as convex hulls, a head touches the link that it is mounted on, and
capsules are drawn too thick. Such overlaps do not depend on the joints, so distances are measured
at poses spread over full turns of all joints, without limits, and never depend on the requested
distances. A pair that is apart at any pose is judged. If it is never as far apart as requested, it
keeps nearly the largest distance of any pose. Links that touch at every pose do so by their maker's
design and are not judged. A head is not the maker's: if it touches a link at every pose, the pair
is judged except for the depth of that overlap, by which one of the two bodies is shaved. The same
holds for any pair that overlaps by a small depth at most poses.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath._arrays import Array
from kerfpath.cell._bodies import Body
from kerfpath.cell._mesh import Mesh
from kerfpath.cell._motion import TOLERANCE, MotionBounds
from kerfpath.cell._scene import ACCURACY, Scene
from kerfpath.cell._shapes import Shape
from kerfpath.cell._shaved import shave
from kerfpath.urdf import KinematicChain

__all__ = [
    "BY_DESIGN",
    "MEANT",
    "DesignClearance",
    "Places",
    "designs",
    "say_kept_all_round",
    "stand_still",
]

Places = tuple[int, int]
"""Indices of two bodies of the cell, the one in the earlier frame first."""

ARM = {"robot", "head", "floor"}
"""Kinds of bodies whose distances the design determines; an arm stands on its floor, too."""
JOINTS = 3
"""Bodies with more joints between them are not close to each other by design."""
POSES, FIRST = 128, 32
"""Number of poses tried, a power of two so that each joint takes evenly spaced values; and how many
are tried first, to settle most pairs."""
TOUCH = 2 * TOLERANCE
"""m: a smaller distance counts as contact, because hardly any motion could be proved clear."""
SPARED = 0.1
"""Share of the largest distance by design that a pair need not keep; else no pose is clear."""
SKIN = (5e-4, 1e-3, 2e-3)
"""m: depths to which bodies that touch by design may overlap."""
DEEPER = (3e-3, 4e-3, 6e-3, 8e-3, 0.012, 0.016, 0.024, 0.032, 0.048, 0.064, 0.096, 0.128)
"""m: depths to which a head may overlap a link at every pose and still be judged beyond them."""
HALVED = 3
"""Number of bisections between two depths to find the smallest sufficient one."""
OFTEN, GONE, FREE = 0.5, 0.5, 0.25
"""Shares of poses: a pair that touches at `OFTEN` of all poses touches by design; shaving must free
`GONE` of these, or `FREE` of them if the pair touches at every pose."""
ARCS = 72
"""Number of arcs with which a proof for a full turn begins."""
FAIR = 0.1
"""m beyond what is required: larger distances are not distinguished."""
BY_DESIGN = "they touch at every pose tried, by design"
"""Why links, and a head that cannot be shaved enough, are not judged."""
MEANT = "they may touch"
"""Why pairs that are listed without a reason are not judged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignClearance:
    """The distance that the design leaves between two bodies, and how the pair is judged.

    Parameters
    ----------
    most : float m
        Largest distance at any pose tried; infinite if it is more than requested, or if one body is
        shaved, since no distance is required then.
    depth : float m
        Depth to which the bodies overlap by design, which is not judged.
    solid : (int, Shape) or None
        Index of the body that is shaved by that depth, and what is left of it.
    judged : bool
        Whether the pair can be judged.
    """

    most: float = np.inf
    depth: float = 0.0
    solid: tuple[int, Shape] | None = None
    judged: bool = True

    def keeps(self, asked: float) -> float:
        """Return the distance (m) that the pair keeps of a requested one: at most what there is."""
        if self.solid is not None:
            return 0.0
        if self.most == np.inf:
            return asked
        return min(asked, self.most - max(SPARED * self.most, TOUCH))


def stand_still(one: Body, two: Body) -> str:
    """Return why two bodies need not be judged whatever their shapes, or "" if they must be."""
    return "they do not move against each other" if one.frame == two.frame else ""


def designs(
    chain: KinematicChain, bodies: Sequence[Body], asked: Mapping[Places, float]
) -> dict[Places, DesignClearance]:
    """Return the design clearance of the pairs of the arm's bodies with few joints between them.

    Parameters
    ----------
    chain : KinematicChain
    bodies : sequence of Body
    asked : mapping of (int, int) to float m
        Distance requested of each pair; larger ones are not distinguished.
    """
    pairs = [
        (a, b)
        for a, b in asked
        if {bodies[a].kind, bodies[b].kind} <= ARM
        and bodies[b].frame - max(bodies[a].frame, chain.base) <= JOINTS
    ]
    if not pairs:
        return {}
    frames = chain.frames(_poses(chain))
    enough = np.array([_enough(asked[pair]) for pair in pairs])
    apart = np.full((POSES, len(pairs)), np.nan)
    apart[:FIRST] = _apart(chain, bodies, pairs, frames[:FIRST], enough)
    often = (apart[:FIRST] <= TOUCH).mean(axis=0) >= OFTEN / 2
    more = np.flatnonzero(often | (apart[:FIRST].max(axis=0) < enough))
    if more.size:
        some = [pairs[i] for i in more]
        apart[FIRST:, more] = _apart(chain, bodies, some, frames[FIRST:], enough[more])
    found = {}
    for i, pair in enumerate(pairs):
        if often[i] and (apart[:, i] <= TOUCH).mean() >= OFTEN:
            found[pair] = _touching(chain, bodies, pair, frames, enough[i], apart[:, i])
        else:
            found[pair] = _design(float(np.nanmax(apart[:, i])), enough[i])
    return found


def say_kept_all_round(
    chain: KinematicChain,
    bodies: Sequence[Body],
    pair: Places,
    asked: float,
    design: DesignClearance,
) -> str:
    """Return in words what a pair provably keeps at every angle of the one joint between, or ""."""
    a, b = (bodies[i].frame for i in pair)
    if b - a != 1 or chain.slides[a] or not {bodies[i].kind for i in pair} <= ARM:
        return ""
    two, needed = shaved_pair(bodies, pair, design), np.array([design.keeps(asked)])
    scene = Scene(two, np.array([[0, 1]]), chain.still)
    q = chain.spread(np.full((ARCS + 1, chain.joints), 0.5))
    q[:, chain.order[a]] = np.linspace(-np.pi, np.pi, ARCS + 1)
    # No proof is tried if samples keep too little.
    if not (scene.distances(chain.frames(q), needed + FAIR) > needed + TOLERANCE).all():
        return ""
    sweep = MotionBounds(chain, two, np.array([[0, 1]]))
    if not sweep.clear(q[:-1], q[1:], needed, scene.distances).all():
        return ""
    said = (
        ""
        if not design.depth
        else f", except for {design.depth * 1e3:g} mm that they overlap by design"
    )
    less = "" if needed[0] >= asked or design.depth else f" of {asked * 1e3:g} mm"
    return f"they keep {needed[0] * 1e3:.3g} mm{less} at every angle of {chain.say(a)}{said}"


def shaved_pair(bodies: Sequence[Body], pair: Places, design: DesignClearance) -> tuple[Body, Body]:
    """Return two bodies, one of them shaved by its design."""
    a, b = (
        bodies[i] if design.solid is None or design.solid[0] != i
        else replace(bodies[i], shape=design.solid[1])
        for i in pair
    )  # fmt: skip
    return a, b


def _poses(chain: KinematicChain) -> Array:
    """Return joint vectors (POSES, n) rad, spread evenly over full turns; zero is one of them."""
    from scipy.stats import qmc  # takes a quarter of a second to load; not every job has a cell

    return chain.spread(qmc.Sobol(chain.joints, scramble=False).random(POSES))


def _enough(asked: float) -> float:
    """Return the distance (m) by design that is enough for the requested one."""
    return max(asked / (1 - SPARED), asked + TOUCH) + ACCURACY


def _apart(
    chain: KinematicChain,
    bodies: Sequence[Body],
    pairs: Sequence[Places],
    frames: Array,
    enough: Array,
) -> Array:
    held = sorted({i for pair in pairs for i in pair})
    scene = Scene([bodies[i] for i in held], np.searchsorted(held, pairs), chain.still)
    return scene.distances(frames, enough)


def _design(most: float, enough: float) -> DesignClearance:
    return DesignClearance() if most >= enough else DesignClearance(most=most)


def _touching(
    chain: KinematicChain,
    bodies: Sequence[Body],
    pair: Places,
    frames: Array,
    enough: float,
    apart: Array,
) -> DesignClearance:
    """Return the design of two bodies that touch often: `apart` (POSES,) m is their distance."""
    touching = apart <= TOUCH
    most, always = float(apart.max()), bool(touching.all())
    if always and {bodies[i].kind for i in pair} <= {"robot", "floor"}:
        return DesignClearance(most=most, judged=False)

    def freed(depth: float) -> DesignClearance | None:
        """Return the design if shaving by a depth frees enough poses, else None."""
        solid = _first_shaved(bodies, pair, depth)
        if solid is None:
            return None
        found = DesignClearance(depth=depth, solid=solid)
        two = shaved_pair(bodies, pair, found)
        left = _apart(chain, two, [(0, 1)], frames[touching], np.array([enough]))[:, 0]
        return found if (left > TOUCH).mean() >= (FREE if always else GONE) else None

    less = 0.0
    for depth in (*SKIN, *(DEEPER if always else ())):
        if (found := freed(depth)) is not None:
            # As little as necessary, unless the shapes are only typical ones.
            for _ in range(HALVED if all(bodies[i].holds for i in pair) and less > 0 else 0):
                middle = (less + found.depth) / 2
                nearer = freed(middle)
                less, found = (middle, found) if nearer is None else (less, nearer)
            return found
        less = depth
    return DesignClearance(most=most, judged=False) if always else _design(most, enough)


def _first_shaved(bodies: Sequence[Body], pair: Places, depth: float) -> tuple[int, Shape] | None:
    """Return index and shaved shape of one of two bodies, a convex one if there is one."""
    for i in sorted(pair, key=lambda i: isinstance(bodies[i].shape, Mesh)):
        if (shape := shave(bodies[i].shape, depth)) is not None:
            return i, shape
    return None
