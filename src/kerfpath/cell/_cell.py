"""The cell: bodies, which of them are judged against each other, and how near they may come."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, as_pose, bools, floats, freeze, scalar
from kerfpath.cell._bodies import Body, CuttingHead, link_capsules
from kerfpath.cell._chain import Chain, chain_of
from kerfpath.cell._mesh import Mesh
from kerfpath.cell._motion import Sweep
from kerfpath.cell._scene import Scene
from kerfpath.cell._shapes import Shape
from kerfpath.errors import InputError
from kerfpath.robots import Robot

__all__ = ["Cell", "cell_of"]

Pair = tuple[str, str]

WRIST = 3
"""From this frame on, the links of a compact wrist overlap by design."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cell:
    """Robot, head, part and fixtures as solids, and how near any two may come.

    A joint vector is clear when every judged pair is farther apart than its near-miss distance.

    Parameters
    ----------
    chain : Chain
        Moves the frames that bodies are fixed in.
    bodies : sequence of Body
    near_miss : float m
        How near two bodies may come.
    near_miss_of : mapping of (name, name) to float m
        The same for single pairs.
    may_touch : sequence of (name, name)
        Pairs that are not judged, beside those that do not move against each other and links that
        are joined.
    endless : (n,) bool
        Joints that go the short way round between nodes.
    T_flange_tip, T_base_part : (4, 4) m, optional
        Where the bodies of head and part were put, for a plan to be held against.

    Attributes
    ----------
    pairs : (P, 2) int
        The judged pairs, as places in `bodies`.
    required : (P,) m
        The near-miss distance of each.
    own : (P,) bool
        Those that have one of their own.

    Raises
    ------
    InputError
        Two bodies of one name, a pair that names none, a part that overlaps the robot's base.
    """

    chain: Chain
    bodies: tuple[Body, ...]
    near_miss: float = 0.0
    near_miss_of: Mapping[Pair, float] = field(default_factory=dict)
    may_touch: Sequence[Pair] = ()
    endless: Bools
    T_flange_tip: Array | None = None
    T_base_part: Array | None = None
    pairs: Ints = field(init=False)
    required: Array = field(init=False)
    own: Bools = field(init=False)
    _scene: Scene = field(init=False, repr=False)
    _sweep: Sweep = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _set = object.__setattr__
        bodies = tuple(sorted(self.bodies, key=lambda body: body.frame))
        _set(self, "bodies", bodies)
        n = len(self.chain.axes)
        _set(self, "endless", bools(self.endless, "endless", (n,)))
        names = self.names
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise InputError(f"cell: two bodies are called {sorted(twice)[0]!r}; rename one")
        if any(not 0 <= body.frame <= n for body in bodies):
            raise InputError(f"cell: expected frames 0 to {n} for every body")
        free = {self._pair(pair, "may_touch") for pair in self.may_touch}
        judged = [
            (a, b)
            for b, body in enumerate(bodies)
            for a in range(b)
            if (a, b) not in free and not _joined(bodies[a], body)
        ]
        _set(self, "pairs", freeze(np.array(judged, np.int64).reshape(-1, 2)))
        own = {self._pair(k, "near_miss_of"): v for k, v in self.near_miss_of.items()}
        needed = [_distance(own.get(pair, self.near_miss), names, pair) for pair in judged]
        _set(self, "required", freeze(np.array(needed, dtype=np.float64)))
        _set(self, "own", freeze(np.array([pair in own for pair in judged], dtype=np.bool_)))
        _set(self, "_scene", Scene(bodies, self.pairs))
        _set(self, "_sweep", Sweep(self.chain, bodies, self.pairs))
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
        """Names of the bodies whose shape only stands in for the real one."""
        return tuple(body.name for body in self.bodies if body.approximate)

    @property
    def queries(self) -> int:
        """How many distances between two bodies coal has been asked for so far."""
        return self._scene.queries

    def distances(
        self, q: ArrayLike, *, enough: float | Array = np.inf, wanted: Bools | None = None
    ) -> Array:
        """Return the distance (B, P) m of each judged pair at q (B, n) rad; overlaps negative.

        Parameters
        ----------
        q : (B, n) rad
        enough : float or (B, P) m
            From there on any lower bound on the distance will do: far fewer are computed.
        wanted : (B, P) bool, optional
            Which to find; the others are NaN.

        Raises
        ------
        InputError
            A distance that is not a number: it is never taken for free.
        """
        return self._scene.distances(self.frames(q), enough, wanted)

    def clearance(self, q: ArrayLike) -> tuple[Array, Ints]:
        """Return by how much q (B, n) rad keeps the near-miss distances, and the pair nearest it.

        Returns
        -------
        clearance : (B,) m
            Least distance beyond what its pair must keep; not clear where it is 0 or less.
        pair : (B,) int
            Which pair that is, a row of `pairs`.
        """
        q = floats(q, "q", (None, len(self.chain.axes)))
        if not len(self.pairs):
            return np.full(len(q), np.inf), np.full(len(q), -1)
        over = self.distances(q) - self.required
        pair = np.argmin(over, axis=1)
        return over[np.arange(len(q)), pair], pair

    def clear(self, q: ArrayLike) -> Bools:
        """Say for each of q (B, n) rad whether every pair keeps its near-miss distance."""
        enough = float(self.required.max(initial=0.0)) + 1e-9
        return np.asarray((self.distances(q, enough=enough) > self.required).all(axis=1))

    def clear_motion(self, q0: ArrayLike, q1: ArrayLike) -> Bools:
        """Say for each straight joint motion q0 to q1, (B, n) rad, whether it is proved clear.

        Endless joints go the short way round. Clear is what keeps more than the near-miss
        distances all the way; what keeps them by less than 0.1 mm may be refused.
        """
        n = len(self.chain.axes)
        first, last = floats(q0, "q0", (None, n)), floats(q1, "q1", (None, n))
        if len(first) != len(last):
            raise InputError(f"q0, q1: expected as many of each, got {len(first)}, {len(last)}")
        return self._sweep.clear(
            first, first + self.increments(first, last), self.required, self._scene.distances
        )

    def increments(self, q0: Array, q1: Array) -> Array:
        """Return joint increments (B, n) rad from q0 to q1, endless joints the short way (13)."""
        dq = q1 - q0
        return np.where(self.endless, dq - 2 * np.pi * np.round(dq / (2 * np.pi)), dq)

    def frames(self, q: ArrayLike) -> Array:
        """Return the poses (B, n+1, 4, 4) in the base of the frames at q (B, n) rad."""
        return self.chain.frames(floats(q, "q", (None, len(self.chain.axes))))

    @property
    def sweep(self) -> Sweep:
        """Bounds on how far bodies move against each other."""
        return self._sweep

    @property
    def scene(self) -> Scene:
        """The bodies ready for distance queries."""
        return self._scene

    def _pair(self, pair: Pair, where: str) -> tuple[int, int]:
        for name in pair:
            if name not in self.names:
                raise InputError(
                    f"cell {where}: no body is called {name!r}; there are {', '.join(self.names)}"
                )
        a, b = sorted(self.names.index(name) for name in pair)
        return a, b

    def _require_room_for_the_base(self) -> None:
        base = [b for b in self.bodies if b.frame == 0 and b.kind == "robot"]
        part = [b for b in self.bodies if b.frame == 0 and b.kind == "part"]
        pairs = np.array([(i, len(base) + j) for i in range(len(base)) for j in range(len(part))])
        if not pairs.size:
            return
        gap = Scene([*base, *part], pairs).distances(np.eye(4)[None, None], 1.0)[0]
        p = int(np.argmin(gap))
        if gap[p] <= 0:
            one, two = base[pairs[p, 0]], part[pairs[p, 1] - len(base)]
            about = " (an approximate capsule)" if one.approximate else ""
            raise InputError(
                f"cell: {two.name!r} overlaps the robot's {one.name!r}{about}; move the part away "
                "from the robot"
            )


def cell_of(
    robot: Robot,
    *,
    tool: ArrayLike,
    head: CuttingHead | Sequence[Body] | None = None,
    part: Mesh | None = None,
    placement: ArrayLike | None = None,
    fixtures: Mapping[str, Shape] | None = None,
    links: Sequence[Body] | None = None,
    near_miss: float = 0.0,
    near_miss_of: Mapping[Pair, float] | None = None,
    may_touch: Sequence[Pair] = (),
) -> Cell:
    """Return the cell of a robot with a cutting head, a part and what else stands around.

    The nozzle works at stand-off, so it is judged against the part by that: it must keep the
    head's `share` of the stand-off to it. All else must keep the near-miss distance.

    Parameters
    ----------
    robot : Robot
    tool : (4, 4)
        T_flange_tip, m.
    head : CuttingHead or sequence of Body, optional
        Default: the generic head.
    part : Mesh, optional
        In the part frame.
    placement : (4, 4), optional
        T_base_part, m; needed with a part.
    fixtures : mapping of name to Shape, optional
        In the robot base.
    links : sequence of Body, optional
        Default: capsules along the robot's lengths, marked approximate.
    near_miss, near_miss_of, may_touch
        As in `Cell`.
    """
    chain = chain_of(robot)
    head = CuttingHead() if head is None else head
    own = dict(near_miss_of or {})
    tool_bodies = tuple(head.bodies(chain, tool) if isinstance(head, CuttingHead) else head)
    parts: tuple[Body, ...] = ()
    if part is not None:
        if placement is None:
            raise InputError("cell: a part needs its placement, T_base_part (4, 4)")
        placed = part.moved(as_pose(placement, "placement"))
        parts = (Body(name="part", shape=placed, frame=0, kind="part"),)
        if isinstance(head, CuttingHead) and not {("nozzle", "part"), ("part", "nozzle")} & set(
            own
        ):
            own["nozzle", "part"] = head.keeps
    things = tuple(
        Body(name=name, shape=shape, frame=0, kind="fixture")
        for name, shape in (fixtures or {}).items()
    )
    return Cell(
        chain=chain,
        bodies=(*(link_capsules(robot) if links is None else links), *tool_bodies, *parts, *things),
        near_miss=near_miss,
        near_miss_of=own,
        may_touch=may_touch,
        endless=robot.endless,
        T_flange_tip=as_pose(tool, "tool"),
        T_base_part=None if placement is None else as_pose(placement, "placement"),
    )


def _joined(one: Body, two: Body) -> bool:
    """Say whether two bodies never move against each other, or are links joined by design."""
    apart = abs(one.frame - two.frame)
    if apart == 0:
        return True
    if {one.kind, two.kind} <= {"robot"}:
        # Capsules drawn rather too thick overlap over two joints.
        return apart <= (2 if one.approximate or two.approximate else 1) or one.frame >= WRIST
    if {one.kind, two.kind} == {"robot", "head"}:
        robot, head = (one, two) if one.kind == "robot" else (two, one)
        return apart <= 1 or (head.name == "arm" and robot.frame >= WRIST)
    return False


def _distance(value: float, names: Sequence[str], pair: tuple[int, int]) -> float:
    what = f"near-miss distance of {names[pair[0]]!r} and {names[pair[1]]!r}"
    number = scalar(value, what, unit="m")
    if number < 0:
        raise InputError(f"{what}: must not be negative, got {number:g} m")
    return number
