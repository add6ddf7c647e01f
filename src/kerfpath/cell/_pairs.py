"""The distances that an arm's design leaves between its bodies, hence which pairs can be judged.

Links of a compact wrist overlap as convex hulls, a head touches the link that it is mounted before,
capsules are drawn too thick. What is so by design is so whatever the joints do: distances are found
at poses spread over whole turns of all joints, limits ignored, and never depend on what a cell asks
for. A pair that is apart at any pose is judged. Where it is never as far apart as asked, it keeps
nearly the most that a pose leaves it. Links that touch at every pose do so by their maker's design.
A head is not the maker's: where it touches a link at every pose it is judged, too, except for the
depth of that overlap, by which one of the two is shaved; so is any pair that touches at most poses
by a skin's depth.
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
"""Two bodies by their places in the cell, the one in the earlier frame first."""

ARM = {"robot", "head", "floor"}
"""Kinds of which the design says how near they are: an arm stands on its floor, too."""
JOINTS = 3
"""Bodies with more joints between them are not near each other by design."""
POSES, FIRST = 128, 32
"""Poses tried, a power of two, so that each joint stands at as many even steps of a turn; and how
many come first, to settle most pairs."""
TOUCH = 2 * TOLERANCE
"""m: nearer than this, hardly any motion could be proved clear, so it is as good as contact."""
SPARED = 0.1
"""Of the most that the design leaves a pair, what it need not keep, or no pose would be clear."""
SKIN = (5e-4, 1e-3, 2e-3)
"""m: depths to which bodies that touch by design may overlap."""
DEEPER = (3e-3, 4e-3, 6e-3, 8e-3, 0.012, 0.016, 0.024, 0.032, 0.048, 0.064, 0.096, 0.128)
"""m: depths to which a head may overlap a link at every pose and still be judged for more."""
HALVED = 3
"""Times that the step before a depth is halved to find the least that does."""
OFTEN, GONE, FREE = 0.5, 0.5, 0.25
"""Shares of the poses: at so many a pair touches that may do so by design, and of those so many are
freed by a skin where it does; of all, so many where a head touches a link at every pose.
"""
ARCS = 72
"""Pieces of a turn that a proof for a whole one begins with."""
FAIR = 0.1
"""m beyond what is required: greater distances are not distinguished."""
BY_DESIGN = "they touch at every pose tried, by design"
"""Why links, and a head that cannot be judged otherwise, are not judged."""
MEANT = "they may touch"
"""Why pairs are not judged that are listed without a reason."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignClearance:
    """The distance that the design leaves between two bodies, and what of them is judged.

    Parameters
    ----------
    most : float m
        The largest distance at any pose tried; infinite where that is more than is asked for, or
        they are shaved, and so asked for no distance at all.
    depth : float m
        To which they overlap by design: so far they are not judged.
    solid : (int, Shape) or None
        Which of the two is shaved by that depth, by its place in the cell, and what is left of it.
    judged : bool
        Whether anything is left that can be judged.
    """

    most: float = np.inf
    depth: float = 0.0
    solid: tuple[int, Shape] | None = None
    judged: bool = True

    def keeps(self, asked: float) -> float:
        """Return what (m) of a distance asked for such a pair keeps: no more than there is."""
        if self.solid is not None:
            return 0.0
        if self.most == np.inf:
            return asked
        return min(asked, self.most - max(SPARED * self.most, TOUCH))


def stand_still(one: Body, two: Body) -> str:
    """Return why two bodies need no judging whatever their shapes; "" where they do."""
    return "they do not move against each other" if one.frame == two.frame else ""


def designs(
    chain: KinematicChain, bodies: Sequence[Body], asked: Mapping[Places, float]
) -> dict[Places, DesignClearance]:
    """Return what the design leaves between the bodies of the arm that few joints are between.

    Parameters
    ----------
    chain : KinematicChain
    bodies : sequence of Body
    asked : mapping of (int, int) to float m
        What each pair is asked to keep: more is not told apart.
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
    """Return what a pair is proved to keep at every angle of the one joint between; "" if not."""
    a, b = (bodies[i].frame for i in pair)
    if b - a != 1 or chain.slides[a] or not {bodies[i].kind for i in pair} <= ARM:
        return ""
    two, needed = shaved_pair(bodies, pair, design), np.array([design.keeps(asked)])
    scene = Scene(two, np.array([[0, 1]]), chain.still)
    q = chain.spread(np.full((ARCS + 1, chain.joints), 0.5))
    q[:, chain.order[a]] = np.linspace(-np.pi, np.pi, ARCS + 1)
    # Not worth a proof where it is not so, or hardly.
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
    """Return joint vectors (POSES, n) rad, spread evenly over whole turns; zero is one."""
    from scipy.stats import qmc  # a quarter of a second to load, and not every job has a cell

    return chain.spread(qmc.Sobol(chain.joints, scramble=False).random(POSES))


def _enough(asked: float) -> float:
    """Return the distance (m) from which on the design leaves what is asked for."""
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
        """Return the design where shaving by a depth frees as many poses as it must."""
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
            # No more than need be, unless the shapes are but typical ones.
            for _ in range(HALVED if all(bodies[i].holds for i in pair) and less > 0 else 0):
                middle = (less + found.depth) / 2
                nearer = freed(middle)
                less, found = (middle, found) if nearer is None else (less, nearer)
            return found
        less = depth
    return DesignClearance(most=most, judged=False) if always else _design(most, enough)


def _first_shaved(bodies: Sequence[Body], pair: Places, depth: float) -> tuple[int, Shape] | None:
    """Return what is left of one of two bodies, a convex one if there is, and its place."""
    for i in sorted(pair, key=lambda i: isinstance(bodies[i].shape, Mesh)):
        if (shape := shave(bodies[i].shape, depth)) is not None:
            return i, shape
    return None
