"""The cell: bodies, the pairs of them that are judged, and the distance that each pair keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, bools, floats, freeze, not_negative
from kerfpath.cell.pairs import (
    BY_DESIGN,
    MAY_TOUCH,
    DesignClearance,
    MotionBounds,
    Places,
    clearance_at_every_angle,
    design_clearances,
    reason_not_judged,
)
from kerfpath.cell.scene import Body, Scene
from kerfpath.errors import InputError
from kerfpath.urdf import KinematicChain

Pair = tuple[str, str]
"""Names of two bodies."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cell:
    """Robot, head, part and fixtures as solids, and the distance that each pair must keep.

    A joint vector is clear when every judged pair is farther apart than its near-miss distance. A
    larger requested distance never admits what a smaller one refused, because the judged pairs and
    the distances that the arm's design leaves them do not depend on it.

    Parameters
    ----------
    chain : KinematicChain
        The chain that moves the frames of the bodies.
    bodies : sequence of Body
    near_miss : float m
        Distance that two bodies must keep.
    near_miss_of : mapping of (name, name) to float m
        The same for single pairs.
    may_touch : sequence of (name, name), or mapping of these to str
        Pairs that are not judged, and why. Pairs without relative motion, and pairs of the arm that
        touch at every pose, need not be listed.
    endless : (n,) bool
        Joints that go the short way round between nodes.
    T_flange_tip, T_base_part : (4, 4) m, optional
        Poses at which the bodies of head and part were placed, to be compared with a plan's.

    Attributes
    ----------
    pairs : (P, 2) int
        The judged pairs, as indices into `bodies`.
    asked, required : (P,) m
        The near-miss distance of each pair, as requested and as kept; less is kept if the arm's
        design leaves less at every pose.
    depth : (P,) m
        Depth to which each pair may overlap, because it does so by design.
    own : (P,) bool
        Whether a pair has its own near-miss distance, requested or by the arm's design.
    unjudged : mapping of (name, name) to str
        Every other pair, and why it need not, or cannot, be judged.

    Raises
    ------
    InputError
        Two bodies with the same name, a pair with an unknown name, a distance for a pair that is
        not judged, a part or fixture that overlaps the robot's base.
    """

    chain: KinematicChain
    bodies: tuple[Body, ...]
    near_miss: float = 0.0
    near_miss_of: Mapping[Pair, float] = field(default_factory=dict)
    may_touch: Sequence[Pair] | Mapping[Pair, str] = ()
    endless: Bools
    T_flange_tip: Array | None = None
    T_base_part: Array | None = None
    pairs: Ints = field(init=False)
    asked: Array = field(init=False)
    required: Array = field(init=False)
    depth: Array = field(init=False)
    own: Bools = field(init=False)
    unjudged: Mapping[Pair, str] = field(init=False)
    _scene: Scene = field(init=False, repr=False)
    _sweep: MotionBounds = field(init=False, repr=False)

    def __repr__(self) -> str:
        return (
            f"Cell({len(self.bodies)} bodies, {len(self.pairs)} pairs judged, all keep "
            f"{self.near_miss * 1e3:g} mm)"
        )

    def __post_init__(self) -> None:
        _set = object.__setattr__
        bodies = tuple(sorted(self.bodies, key=lambda body: body.frame))
        _set(self, "bodies", bodies)
        n = self.chain.joints
        _set(self, "endless", bools(self.endless, "endless", (n,)))
        names = self.names
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise InputError(f"cell: two bodies are called {sorted(twice)[0]!r}; rename one")
        if any(not 0 <= body.frame <= n for body in bodies):
            raise InputError(f"cell: expected frames 0 to {n} for every body")
        own = {self._pair(k, "near_miss_of"): v for k, v in self.near_miss_of.items()}
        why, judged = self._sorted_out(own)
        _set(self, "unjudged", {(names[a], names[b]): words for (a, b), words in why.items()})
        _set(self, "pairs", freeze(np.array([*judged], np.int64).reshape(-1, 2)))
        rules = [(asked, design.keeps(asked), design.depth) for asked, design in judged.values()]
        asked, required, depth = np.array(rules, dtype=np.float64).reshape(-1, 3).T
        _set(self, "asked", freeze(asked))
        _set(self, "required", freeze(required))
        _set(self, "depth", freeze(depth))
        given = np.array([pair in own for pair in judged], dtype=np.bool_)
        _set(self, "own", freeze(given | (required < asked) | (depth > 0)))
        _set(self, "_scene", _scene(bodies, judged, self.chain.still))
        _set(self, "_sweep", MotionBounds(self.chain, bodies, self.pairs))
        self._require_room_for_the_base()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, by frame."""
        return tuple(body.name for body in self.bodies)

    @property
    def pair_names(self) -> tuple[Pair, ...]:
        """Names of each judged pair."""
        return tuple((self.names[a], self.names[b]) for a, b in self.pairs)

    @property
    def approximate(self) -> tuple[str, ...]:
        """Names of the bodies whose shape is only approximate."""
        return tuple(body.name for body in self.bodies if body.approximate)

    @property
    def unproved(self) -> tuple[str, ...]:
        """Names of bodies that need not hold the real ones, so clearance to them proves little."""
        return tuple(body.name for body in self.bodies if not body.holds)

    @property
    def queries(self) -> int:
        """Number of distances between two bodies that coal has computed so far."""
        return self._scene.queries

    def distances(
        self, q: ArrayLike, *, enough: float | Array = np.inf, wanted: Bools | None = None
    ) -> Array:
        """Return the distance (B, P) m of each judged pair at q (B, n) rad; overlaps negative.

        Parameters
        ----------
        q : (B, n) rad
        enough : float or (B, P) m
            Above it, any lower bound on the distance may be returned; far fewer are computed.
        wanted : (B, P) bool, optional
            Which distances to find; the others are NaN.

        Raises
        ------
        InputError
            A distance that is not a number, which is never taken as clear.
        """
        return self._scene.distances(self.frames(q), enough, wanted)

    def clearance(self, q: ArrayLike) -> tuple[Array, Ints]:
        """Return by how much q (B, n) rad keeps the near-miss distances, and the pair nearest it.

        Returns
        -------
        clearance : (B,) m
            Smallest distance beyond what its pair must keep; 0 or less is not clear.
        pair : (B,) int
            The pair with that distance, a row of `pairs`; -1 if no pair is judged.
        """
        q = floats(q, "q", (None, self.chain.joints))
        if not len(self.pairs):
            return np.full(len(q), np.inf), np.full(len(q), -1)
        over = self.distances(q) - self.required
        pair = np.argmin(over, axis=1)
        return over[np.arange(len(q)), pair], pair

    def clear(self, q: ArrayLike) -> Bools:
        """Return whether every pair keeps its near-miss distance, (B,), at each of q (B, n) rad."""
        enough = float(self.required.max(initial=0.0)) + 1e-9
        return np.asarray((self.distances(q, enough=enough) > self.required).all(axis=1))

    def clear_motion(self, q0: ArrayLike, q1: ArrayLike) -> Bools:
        """Return whether each straight joint motion from q0 to q1, (B, n) rad, is proved clear.

        Endless joints go the short way round. A motion is clear if it keeps more than the near-miss
        distances all the way; a motion that exceeds them by less than 0.1 mm may be refused.
        """
        n = self.chain.joints
        first, last = floats(q0, "q0", (None, n)), floats(q1, "q1", (None, n))
        if len(first) != len(last):
            raise InputError(f"q0, q1: expected equal lengths, got {len(first)} and {len(last)}")
        return self._sweep.clear(
            first, first + self.increments(first, last), self.required, self._scene.distances
        )

    def clear_through(self, q: ArrayLike) -> bool:
        """Return whether the straight joint motions through q (m, n) rad are all proved clear.

        This is as in `clear_motion`, but endless joints turn as q says.
        """
        corners = floats(q, "q", (None, self.chain.joints))
        motions = self._sweep.clear(corners[:-1], corners[1:], self.required, self._scene.distances)
        return bool(motions.all())

    def with_endless(self, endless: Bools) -> Cell:
        """Return this cell with other joints (n,) endless; its bodies are not prepared again."""
        other = copy(self)
        object.__setattr__(other, "endless", bools(endless, "endless", self.endless.shape))
        return other

    def increments(self, q0: Array, q1: Array) -> Array:
        """Return joint increments (B, n) rad from q0 to q1, endless joints the short way (13)."""
        dq = q1 - q0
        return np.where(self.endless, dq - 2 * np.pi * np.round(dq / (2 * np.pi)), dq)

    def frames(self, q: ArrayLike) -> Array:
        """Return the poses (B, n+1, 4, 4) of the frames at q (B, n) rad.

        They are in the robot base; with external axes, in the base with each axis at zero.
        """
        return self.chain.frames(floats(q, "q", (None, self.chain.joints)))

    @property
    def sweep(self) -> MotionBounds:
        """Bounds on the motion of bodies relative to each other."""
        return self._sweep

    @property
    def scene(self) -> Scene:
        """The bodies ready for distance queries."""
        return self._scene

    def _sorted_out(
        self, own: Mapping[Places, float]
    ) -> tuple[dict[Places, str], dict[Places, tuple[float, DesignClearance]]]:
        """Return why pairs are not judged; for the others, the requested distance and design."""
        bodies, names, touching = self.bodies, self.names, self.may_touch
        reasons = touching if isinstance(touching, Mapping) else dict.fromkeys(touching, MAY_TOUCH)
        why = {self._pair(pair, "may_touch"): words for pair, words in reasons.items()}
        asked: dict[Places, float] = {}
        for a, b in combinations(range(len(bodies)), 2):
            if words := why.get((a, b)) or reason_not_judged(bodies[a], bodies[b]):
                why[a, b] = words
            else:
                asked[a, b] = _distance(own.get((a, b), self.near_miss), names, (a, b))
        left = design_clearances(self.chain, bodies, asked)
        judged: dict[Places, tuple[float, DesignClearance]] = {}
        for pair, distance in asked.items():
            design = left.get(pair, DesignClearance())
            if not design.judged:
                why[pair] = BY_DESIGN
            else:
                judged[pair] = distance, design
        for a, b in own:
            if (a, b) in why:
                raise InputError(
                    f"cell near_miss_of: {names[a]!r} and {names[b]!r} are not judged: "
                    f"{why[a, b]}; leave the pair out"
                )
        for pair, (distance, design) in [*judged.items()]:
            if words := clearance_at_every_angle(self.chain, bodies, pair, distance, design):
                del judged[pair]
                why[pair] = words
        return why, judged

    def _pair(self, pair: Pair, where: str) -> tuple[int, int]:
        for name in pair:
            if name not in self.names:
                raise InputError(
                    f"cell {where}: no body is called {name!r}; there are {', '.join(self.names)}"
                )
        a, b = sorted(self.names.index(name) for name in pair)
        return a, b

    def _require_room_for_the_base(self) -> None:
        """Raise InputError if a part or fixture overlaps the fixed base of the robot."""
        free = {self._pair(pair, "may_touch") for pair in self.may_touch}
        base = self.chain.base
        still = [body for body in self.bodies if body.frame == base and body.kind != "floor"]
        pairs = [
            (a, b)
            for a, b in combinations(range(len(still)), 2)
            if (a, b) not in free and (still[a].kind == "robot") != (still[b].kind == "robot")
        ]
        if not pairs:
            return
        stand = np.tile(np.eye(4), (1, base + 1, 1, 1))
        gap = Scene(still, np.array(pairs), base).distances(stand, 1.0)[0]
        if gap.min() <= 0:
            a, b = pairs[int(np.argmin(gap))]
            one, two = sorted((still[a], still[b]), key=lambda body: body.kind != "robot")
            about = " (an approximate shape)" if one.approximate else ""
            raise InputError(
                f"cell: {two.name!r} overlaps the robot's {one.name!r}{about}; move it away from "
                f"the robot, or list ({one.name!r}, {two.name!r}) in may_touch if the robot "
                "stands on it"
            )


def _scene(
    bodies: Sequence[Body],
    judged: Mapping[Places, tuple[float, DesignClearance]],
    still: int,
) -> Scene:
    """Return the bodies ready for distance queries, shaved where pairs overlap by design."""
    solids, ends = [*bodies], []
    for pair, (_, design) in judged.items():
        two = [*pair]
        if design.solid is not None:
            place, shape = design.solid
            two[two.index(place)] = len(solids)
            solids.append(replace(bodies[place], shape=shape))
        ends.append(two)
    return Scene(solids, np.array(ends, np.int64).reshape(-1, 2), still)


def _distance(value: float, names: Sequence[str], pair: tuple[int, int]) -> float:
    what = f"near-miss distance of {names[pair[0]]!r} and {names[pair[1]]!r}"
    return not_negative(value, what, unit="m")
