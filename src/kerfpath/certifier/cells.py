"""Cells of gamma: enclosures of the joints on them, and their division."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certificate import BASE, LIFTS, cell_bounds
from kerfpath.robots import Robot, chain_of, lowest_joint

TURN = 2 * np.pi
AT_ONCE = 50_000
"""Cells enclosed at a time: all their postures take less than 100 MB."""
FREE = 1.0
"""rad: a joint whose position is less certain than this may be on more than one turn."""
ROUNDED = 1e-14
"""Rounding error of a joint, in rad per rad and in rad."""
SLIGHT = 1e-9
"""rad: half the width of a cell that represents a single gamma."""
MORE_CELLS = 4
"""Factor on the number of cells within which those with uncertain joints are halved: the work of a
bound grows with its square."""
CERTAIN_LEVEL = 11
"""Largest level of cells that are halved because the joints on them are uncertain: 0.0024 deg."""
EDGE = 1e-8
"""rad: joints this far out of their range still count as inside, as in the graph and the audit."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellSet:
    """Cells of gamma, each in one posture and on one turn of every joint, with their enclosures.

    Parameters
    ----------
    node, posture, level, index : (C,)
        See `kerfpath.certificate.Stage`.
    half : (C,) rad
        Half the width.
    center, slope, bend, spread : (C, n)
        The joints are center + slope t + bend t^2 / 2 +- spread on the cell, in rad.
    floor : (C,)
        Known lower bound on the cost of motions through each cell; minus infinity: none.
    """

    node: NDArray[np.int32]
    posture: NDArray[np.int8]
    level: NDArray[np.int8]
    index: NDArray[np.int32]
    half: Array
    center: Array
    slope: Array
    bend: Array
    spread: Array
    floor: Array

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.node)

    @property
    def box(self) -> Array:
        """Largest distance of a joint from its centre on the cell, (C, n) rad."""
        return np.asarray(np.abs(self.slope) * self.half[:, None] + self.unsure)

    @property
    def unsure(self) -> Array:
        """Largest distance of a joint from a straight line over the cell, (C, n) rad."""
        return np.asarray(np.abs(self.bend) * self.half[:, None] ** 2 / 2 + self.spread)

    def uncertain(self, weight: Array, worth: float) -> Bools:
        """Return on which cells (C,) the uncertainty of the joints is worth more than this cost.

        ``weight`` is (n,) 1/rad; cells of `CERTAIN_LEVEL` count as certain.
        """
        return np.asarray((self.unsure @ weight > worth) & (self.level < CERTAIN_LEVEL))

    @property
    def lift(self) -> NDArray[np.int8]:
        """Approximate joints, (C, n), in units of pi / `LIFTS`."""
        return np.rint(self.center * (LIFTS / np.pi)).astype(np.int8)

    def flipped(self, joint: int, middle: float) -> CellSet:
        """Return the cells with the wrist flipped (`Arm.flip`), up to constant turns."""
        center, slope, bend = self.center.copy(), self.slope.copy(), self.bend.copy()
        center[:, joint] = 2 * middle - center[:, joint]
        slope[:, joint] *= -1
        bend[:, joint] *= -1
        posture = self.posture ^ 1
        return replace(self, posture=posture, center=center, slope=slope, bend=bend)

    def take(self, which: Bools | Ints | slice) -> CellSet:
        """Return some of the cells."""
        return CellSet(**{f.name: getattr(self, f.name)[which] for f in fields(self)})

    @staticmethod
    def join(sets: Sequence[CellSet]) -> CellSet:
        """Return the cells of several sets in one."""
        names = [f.name for f in fields(CellSet)]
        return CellSet(**{name: np.concatenate([getattr(s, name) for s in sets]) for name in names})


def foldable(robot: Robot, farthest: Array) -> Bools:
    """Return which joints (n,) may count as endless though they have a range.

    The range is at least a turn. Each step moves a joint by at most the ``farthest`` (n,) rad, less
    than half a turn, so that the increments of a motion are the same modulo turns.
    """
    limits = robot.joint_limits()
    wide = limits.upper - limits.lower >= TURN
    return np.asarray(wide & (farthest < np.pi) & ~limits.endless)


class CellMaker:
    """Makes the cells of a contour.

    Parameters
    ----------
    robot : Robot
        A robot that `encloses`.
    frames : (K, 4, 4) m
        Task frames in the robot base.
    T_flange_tip : (4, 4) m
    postures : sequence of int, optional
        The postures that may be used; default all.
    width : float
        Factor on the uncertainty of the curvature, 1 as proved.
    folded : (n,) bool, optional
        Joints with a range of at least a turn that count as endless; default none. Their couplings
        are left out.
    floor : float m, optional
        Height above which motions keep elbow, wrist and flange at the nodes.

    Attributes
    ----------
    endless : (n,) bool
        With the folded ones.
    flip : tuple, optional
        As `Arm.flip`.
    """

    def __init__(
        self,
        robot: Robot,
        frames: Array,
        T_flange_tip: Array,
        postures: Iterable[int] | None = None,
        width: float = 1.0,
        folded: Bools | None = None,
        floor: float | None = None,
    ) -> None:
        self._floor, chain = floor, chain_of(robot)
        lengths = np.linalg.norm([*chain.origins[1:, :3, 3], chain.end[:3, 3]], axis=1)
        self._reach = np.cumsum(lengths[::-1])[::-1]  # from each axis to the end at most
        self._robot, self._frames, self._tool = robot, frames, T_flange_tip
        limits = robot.joint_limits()
        if folded is not None:
            limits = limits._replace(endless=freeze(limits.endless | folded))
        # A coupling of an endless joint holds on one of its turns, which cells do not distinguish.
        plain = ~(limits.rows[:, limits.endless] != 0).any(axis=1)
        self._limits = limits._replace(
            rows=limits.rows[plain],
            row_lower=limits.row_lower[plain],
            row_upper=limits.row_upper[plain],
        )
        used = range(robot.postures) if postures is None else sorted(postures)
        self._postures, self._width = np.array(used, np.int8), width
        self.endless, self.flip = limits.endless, robot.arm.flip

    def coarsest(self, nodes: Ints) -> CellSet:
        """Return the cells of level 0 at some nodes, in postures and turns within the ranges."""
        node = np.repeat(nodes.astype(np.int32), BASE)
        index = np.tile(np.arange(BASE, dtype=np.int32), len(nodes))
        level = np.zeros(len(node), np.int8)
        sets = []
        for first in range(0, len(node), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            sets.append(self.lifted(self._enclosed(node[part], level[part], index[part])))
        return CellSet.join(sets)

    def joints(self, nodes: Ints, gamma: Array, posture: int) -> tuple[Array, Array, Bools]:
        """Return the approximate joints at gamma (M,) at nodes, in a posture, and their slopes.

        Both are (M, n), rad and rad/rad. Also returned is whether the posture reaches each (M,).
        """
        half = np.full(len(gamma), SLIGHT)
        found = self._robot.arm.enclose(self._frames, nodes, gamma, half, self._tool)
        return found.center[:, posture], found.slope[:, posture], found.status[:, posture] > 0

    def fits(self, course: Array) -> bool:
        """Return whether a course (K, n) rad is in the ranges on some turn, and above the floor.

        Its increments are those of the motion. Folded joints have ranges here, too.
        """
        limits = self._robot.joint_limits()
        low, high = course.min(axis=0), course.max(axis=0)
        lower = np.where(limits.endless, low, limits.lower)
        upper = np.where(limits.endless, high, limits.upper)
        shift = TURN * np.rint((lower + upper - low - high) / (2 * TURN))
        inside = (low + shift >= lower - EDGE) & (high + shift <= upper + EDGE)
        value = (course + shift) @ limits.rows.T
        held = (value >= limits.row_lower - EDGE) & (value <= limits.row_upper + EDGE)
        above = self._floor is None or lowest_joint(self._robot, course).min() >= self._floor
        return bool(inside.all() and held.all() and above)

    def divided(self, cells: CellSet, which: Bools) -> CellSet:
        """Return the cells with some of them (C,) halved."""
        return CellSet.join([cells.take(~which), self.halves(cells.take(which))])

    def certain(self, cells: CellSet, weight: Array, worth: float) -> CellSet:
        """Return the cells, with those halved on which the joints are too uncertain.

        Near a singularity bounds would find such cells one halving after the other.

        Parameters
        ----------
        cells : CellSet
        weight : (n,) 1/rad
        worth : float
            The largest cost of the uncertainty of the joints on a cell that may remain, unless
            there are more than `MORE_CELLS` times as many cells then.
        """
        most = MORE_CELLS * len(cells)
        while True:
            which = cells.uncertain(weight, worth)
            if not which.any() or len(cells) + which.sum() > most:
                return cells
            cells = self.divided(cells, which)

    def halves(self, cells: CellSet) -> CellSet:
        """Return both halves of the cells, on the same turns."""
        sets = [
            self._bisected(cells.take(slice(first, first + AT_ONCE // 2)))
            for first in range(0, len(cells), AT_ONCE // 2)
        ]
        return CellSet.join(sets) if sets else cells

    def _bisected(self, cells: CellSet) -> CellSet:
        parent = np.repeat(np.arange(len(cells)), 2)
        right = np.tile([0, 1], len(cells))
        node, level = cells.node[parent], (cells.level[parent] + 1).astype(np.int8)
        index = (2 * cells.index[parent] + right).astype(np.int32)
        key = np.stack([node, level, index], axis=1)
        alone, which = np.unique(key, axis=0, return_inverse=True)
        which = which.ravel()
        made, place = self._enclosed_all(*alone.T)
        row = place[which, cells.posture[parent]]
        real = row >= 0
        parent, right, row = parent[real], right[real], row[real]
        child = made.take(row)
        middle = ((2 * right - 1) * child.half)[:, None]
        there = cells.center[parent] + cells.slope[parent] * middle
        there = there + cells.bend[parent] * middle**2 / 2
        shift = TURN * np.rint((there - child.center) / TURN)
        moved = self._moved(child, np.where(self._limits.endless, 0.0, shift))
        moved = replace(moved, floor=cells.floor[parent])
        free = (cells.spread[parent] > FREE).any(axis=1)
        kept = [moved.take(self._inside(moved) & ~free)]
        if free.any():
            lifted = self.lifted(made.take(np.unique(row[free])))
            least = cells.floor[parent[free]].min()
            kept.append(replace(lifted, floor=np.full(len(lifted), least)))
        return CellSet.join(kept)

    def _enclosed(
        self, node: NDArray[np.int32], level: NDArray[np.int8], index: NDArray[np.int32]
    ) -> CellSet:
        """Return the cells with a solution, in every posture that may be used."""
        return self._enclosed_all(node, level, index)[0]

    def _enclosed_all(
        self, node: NDArray[np.int32], level: NDArray[np.int8], index: NDArray[np.int32]
    ) -> tuple[CellSet, Ints]:
        """Return the cells with a solution, and the row of each posture (B, P), -1 for none."""
        node, level, index = (
            node.astype(np.int32),
            level.astype(np.int8),
            index.astype(np.int32),
        )
        gamma, half = cell_bounds(level, index)
        found = self._robot.arm.enclose(
            self._frames, node.astype(np.int64), gamma, half, self._tool
        )
        wanted = np.zeros(found.status.shape[1], np.bool_)
        wanted[self._postures] = True
        cell, posture = np.nonzero((found.status > 0) & wanted)
        at, h = (cell, posture), half[cell, None]
        center = found.center[at]
        unsure = (found.high[at] - found.low[at]) * h**2 / 4
        spread = found.radius[at] + self._width * unsure
        made = CellSet(
            node=node[cell],
            posture=posture.astype(np.int8),
            level=level[cell],
            index=index[cell],
            half=half[cell],
            center=center,
            slope=found.slope[at],
            bend=(found.high[at] + found.low[at]) / 2,
            spread=spread * (1 + ROUNDED) + ROUNDED * (1 + np.abs(found.slope[at]) * h),
            floor=np.full(len(cell), -np.inf),
        )
        above = self._above_floor(made)
        place = np.full(found.status.shape, -1, np.int64)
        place[cell[above], posture[above]] = np.arange(above.sum())
        return made.take(above), place

    def _above_floor(self, cells: CellSet) -> Bools:
        """Return which cells may hold joints (C,) with elbow, wrist and flange above the floor.

        A joint lifts what it moves by at most its rotation times the distance to its axis.
        """
        if self._floor is None:
            return np.ones(len(cells), np.bool_)
        highest = lowest_joint(self._robot, cells.center) + cells.box @ self._reach
        return np.asarray(highest >= self._floor - EDGE)

    def lifted(self, cells: CellSet) -> CellSet:
        """Return the cells on all turns within the ranges."""
        limits, box = self._limits, cells.box
        shifts = []
        for i in range(cells.center.shape[1]):
            if limits.endless[i] or not len(cells):
                shifts.append([0])
                continue
            low = (limits.lower[i] - EDGE - (cells.center[:, i] + box[:, i]).max()) / TURN
            high = (limits.upper[i] + EDGE - (cells.center[:, i] - box[:, i]).min()) / TURN
            shifts.append(list(range(int(np.ceil(low)), int(np.floor(high)) + 1)))
        sets = [cells.take(slice(0))]  # there may be no turn at all
        for shift in product(*shifts):
            moved = self._moved(cells, TURN * np.array(shift, float))
            sets.append(moved.take(self._inside(moved)))
        return CellSet.join(sets)

    @staticmethod
    def _moved(cells: CellSet, shift: Array) -> CellSet:
        center = cells.center + shift
        spread = cells.spread + ROUNDED * np.abs(center)
        return replace(cells, center=center, spread=spread)

    def _inside(self, cells: CellSet) -> Bools:
        """Return which cells may hold joints within the ranges and couplings, (C,)."""
        limits, box = self._limits, cells.box + EDGE
        within = (cells.center - box <= limits.upper) & (cells.center + box >= limits.lower)
        inside = (within | limits.endless).all(axis=1)
        value, over = cells.center @ limits.rows.T, box @ np.abs(limits.rows).T + EDGE
        held = (value - over <= limits.row_upper) & (value + over >= limits.row_lower)
        return np.asarray(inside & held.all(axis=1))
