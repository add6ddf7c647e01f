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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from kerfpath.arrays import Array, Bools, Ints
from kerfpath.cell.links import shave
from kerfpath.cell.mesh import Mesh
from kerfpath.cell.scene import ACCURACY, Body, Scene
from kerfpath.cell.shapes import Shape
from kerfpath.urdf import KinematicChain

# -----------------------------------------------------------------------------
# Swept motions: bounds on the distance of bodies between two poses, and bisection by them.
#
# While the joints move evenly from q0 to q1, a point x of a body deviates from the straight line
# from x(0) to x(1) by at most M s (1 - s) / 2, where M bounds its second derivative. A body lies
# in the hull of its corners. If delta is the largest displacement of a corner, the distance of a
# pair is at least
#
#     (d(0) + d(1) - delta) / 2 - M / 8
#
# all the way. If that does not clear a pair, its distance half way is measured, and each half is
# judged in the same way: delta is halved, and M falls to a quarter. The second derivatives of a
# chain of revolute joints are z_i x (z_j x (x - o_j)) for i <= j, hence M = sum over i, j of
# |dq_i| |dq_j| r_max(i,j), where r_j bounds the distance of the point from axis j. A linear joint j
# contributes z_i x d_j with the joints before it, and nothing with those after it or with itself.

TOLERANCE = 1e-4
"""m: a motion that is not proved clear at this resolution is refused."""
HALVINGS = 24
"""Largest number of bisections, which no motion of a robot reaches; then a motion is refused."""

Distances = Callable[[Array, Array, Bools], Array]


class MotionBounds:
    """Bounds on the relative motion of judged pairs.

    Parameters
    ----------
    chain : KinematicChain
    bodies : sequence of Body
    pairs : (P, 2) int
        Indices of bodies; the second of a pair is in the later frame.
    """

    def __init__(self, chain: KinematicChain, bodies: Sequence[Body], pairs: Ints) -> None:
        self._chain = chain
        joints = np.arange(chain.joints)
        self._slides = chain.slides
        self._order = chain.order
        ways = [(bodies[a].frame, int(b)) for a, b in pairs]
        self._ways = sorted(set(ways))
        self._way = np.array([self._ways.index(way) for way in ways], dtype=np.int64)
        self._moves = [(a, bodies[b].frame, bodies[b].shape.corners) for a, b in self._ways]
        between = [(joints >= a) & (joints < frame) for a, frame, _ in self._moves]
        reach = [chain.reach(frame, corners) for _, frame, corners in self._moves]
        self._between = np.array(between).reshape(-1, len(joints))
        self._reach = np.array(reach).reshape(-1, len(joints))

    @property
    def arms(self) -> Array:
        """Largest reach (n,) m of any body from each joint's axis; 1 for a linear joint."""
        longest = np.empty(len(self._order))
        longest[self._order] = self._reach.max(axis=0, initial=0.0)
        return longest

    def shift(self, frames0: Array, frames1: Array) -> Array:
        """Return the largest displacement (B, P) m of any corner between poses (B, n+1, 4, 4).

        It is seen from the first body of the pair; the distance of the pair changes by no more.
        """
        out = np.empty((len(frames0), len(self._ways)))
        seen: dict[tuple[int, int], Array] = {}
        for i, (a, b, corners) in enumerate(self._moves):
            if (a, b) not in seen:
                seen[a, b] = (relative(frames1, a, b) - relative(frames0, a, b))[:, :3]
            moved = seen[a, b][:, :, :3] @ corners.T + seen[a, b][:, :, 3:]
            out[:, i] = np.sqrt((moved**2).sum(axis=1).max(axis=1))
        return out[:, self._way]

    def bend(self, dq: Array) -> Array:
        """Return bounds M (B, P) m on the second derivatives of corners along dq (B, n) rad."""
        step = np.abs(dq)[:, None, self._order] * self._between
        total = np.cumsum(np.where(self._slides, 0.0, step), axis=2)
        before = np.concatenate([np.zeros_like(total[..., :1]), total[..., :-1]], axis=2)
        bend = ((total**2 - before**2) * self._reach).sum(axis=2)
        if self._slides.any():
            bend += 2 * (before * np.where(self._slides, step, 0.0)).sum(axis=2)
        return np.asarray(bend[:, self._way])

    def least(
        self, d0: Array, d1: Array, frames0: Array, frames1: Array, dq: Array
    ) -> tuple[Array, Array]:
        """Return lower bounds (B, P) m on the distances along motions, and their slack (B, P) m."""
        delta, bow = self.shift(frames0, frames1), self.bend(dq) / 8
        return (d0 + d1 - delta) / 2 - bow - ACCURACY, delta / 2 + bow

    def clear(
        self,
        q0: Array,
        q1: Array,
        required: Array,
        distances: Distances,
        wanted: Bools | None = None,
    ) -> Bools:
        """Return which of the motions q0 to q1 (B, n) rad are proved to keep more than `required`.

        Pairs that are not `wanted` (B, P) are known to keep it already.
        """
        clear = self._chain.bounded(q0) & self._chain.bounded(q1)
        if not len(self._way):
            return clear
        motion = np.arange(len(q0))
        wanted = np.ones((len(q0), len(self._way)), bool) if wanted is None else wanted
        T0, T1 = self._chain.frames(q0), self._chain.frames(q1)
        enough = required + self._spent(T0, T1, q1 - q0)
        d0, d1 = distances(T0, enough, wanted), distances(T1, enough, wanted)
        for _ in range(HALVINGS):
            least, doubt = self.least(d0, d1, T0, T1, q1 - q0)
            hit = wanted & ~((d0 > required) & (d1 > required))
            open_ = wanted & ~(least > required)
            lost = hit.any(axis=1) | (open_ & (doubt < TOLERANCE)).any(axis=1)
            clear[motion[lost]] = False
            go = open_.any(axis=1) & clear[motion]
            if not go.any():
                return clear
            motion, wanted, d0, d1 = motion[go], open_[go], d0[go], d1[go]
            q0, q1, T0, T1 = q0[go], q1[go], T0[go], T1[go]
            half = (q0 + q1) / 2
            T_half = self._chain.frames(half)
            d_half = distances(T_half, required + self._spent(T0, T1, q1 - q0), wanted)
            motion, wanted = np.tile(motion, 2), np.tile(wanted, (2, 1))
            d0, d1 = np.vstack([d0, d_half]), np.vstack([d_half, d1])
            q0, q1 = np.vstack([q0, half]), np.vstack([half, q1])
            T0, T1 = np.concatenate([T0, T_half]), np.concatenate([T_half, T1])
        clear[motion] = False
        return clear

    def _spent(self, frames0: Array, frames1: Array, dq: Array) -> Array:
        """Return the distances (B, P) m beyond `required` that clear a motion, at either end."""
        return self.shift(frames0, frames1) + self.bend(dq) / 4 + 4 * ACCURACY


def relative(frames: Array, a: int, b: int) -> Array:
    """Return the poses (B, 4, 4) of frame b in frame a."""
    if (frames[:, a] == np.eye(4)).all():
        return frames[:, b]
    R, at = frames[:, a, :3, :3], frames[:, a, :3, 3:]
    T = np.zeros((len(frames), 4, 4))
    turned = np.swapaxes(R, 1, 2)
    T[:, :3, :3] = turned @ frames[:, b, :3, :3]
    T[:, :3, 3:] = turned @ (frames[:, b, :3, 3:] - at)
    T[:, 3, 3] = 1.0
    return T


# -----------------------------------------------------------------------------
# The distances that an arm's design leaves between its bodies, hence which pairs can be judged.

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
MAY_TOUCH = "they may touch"
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


def reason_not_judged(one: Body, two: Body) -> str:
    """Return why two bodies need not be judged whatever their shapes, or "" if they must be."""
    return "they do not move against each other" if one.frame == two.frame else ""


def design_clearances(
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


def clearance_at_every_angle(
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
    less = "" if needed[0] >= asked or design.depth else f" of {asked * 1e3:g} mm"
    words = f"they keep {needed[0] * 1e3:.3g} mm{less} at every angle of {chain.say(a)}"
    if not design.depth:
        return words
    return f"{words}, except for {design.depth * 1e3:g} mm that they overlap by design"


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
