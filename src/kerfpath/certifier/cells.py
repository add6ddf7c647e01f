"""Cells of gamma: enclosures of the joints on them, and their division.

Where a pose leaves more free than gamma, a tilt or external axes, cells are boxes of all of these
parameters, and the one is halved that moves the joints most.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from kerfpath.acceleration_table import OVER
from kerfpath.arrays import Array, Bools, Ints, freeze, short_repr
from kerfpath.certificate import BASE, LIFTS, cell_bounds
from kerfpath.plans import Plan
from kerfpath.robots import Robot, chain_of, lowest_joint
from kerfpath.robots.regions import enclose_regions

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
COARSE_LEVEL = -2
"""Level of the first cells where they have more parameters than gamma: cells of 20 deg."""
WIDEST_TILT, WIDEST_LINEAR, WIDEST_ROTARY = 0.1, 0.25, 0.27
"""rad, m, rad: largest half width of the first cells in the other parameters."""
SAME_WORTH = 1e-3
"""Share of the largest weight that each joint counts when a parameter is chosen to be halved."""
BARELY = 1e-12
"""Share by which cells overlap in the other parameters, and by which a tilt may exceed its cone."""


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
        The joints are center + slope t + bend t^2 / 2 + tied . s +- spread on the cell, in rad.
    floor : (C,)
        Known lower bound on the cost of motions through each cell; minus infinity: none.
    at, reach : (C, M)
        The other parameters are at + s, |s| <= reach; see `enclose_regions`.
    tied : (C, M, n)
        Slopes of the joints by these.
    cuts : (C,)
        How often they were halved.
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
    at: Array
    reach: Array
    tied: Array
    cuts: NDArray[np.int16]

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.node)

    @property
    def box(self) -> Array:
        """Largest distance of a joint from its centre on the cell, (C, n) rad."""
        box = np.abs(self.slope) * self.half[:, None] + self.unsure
        return np.asarray(box + self.sway if self.reach.shape[1] else box)

    @property
    def sway(self) -> Array:
        """How far the other parameters may move a joint, (C, n) rad."""
        moved = (np.abs(self.tied) * self.reach[:, :, None]).sum(axis=1)
        return np.asarray(moved * (1 + ROUNDED))

    @property
    def unsure(self) -> Array:
        """Largest distance of a joint from a linear function over the cell, (C, n) rad."""
        return np.asarray(np.abs(self.bend) * self.half[:, None] ** 2 / 2 + self.spread)

    @property
    def grain(self) -> Ints:
        """How often the parameters were halved, on average: for cells of gamma their level."""
        return np.asarray((self.level.astype(np.int64) + self.cuts) // (1 + self.reach.shape[1]))

    def uncertain(self, weight: Array, worth: float) -> Bools:
        """Return on which cells (C,) the uncertainty of the joints is worth more than this cost.

        ``weight`` is (n,) 1/rad; cells of `CERTAIN_LEVEL` count as certain.
        """
        return np.asarray((self.unsure @ weight > worth) & (self.grain < CERTAIN_LEVEL))

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
        tied = self.tied.copy()
        tied[:, :, joint] *= -1
        posture = self.posture ^ 1
        return replace(self, posture=posture, center=center, slope=slope, bend=bend, tied=tied)

    def take(self, which: Bools | Ints | slice) -> CellSet:
        """Return some of the cells."""
        return CellSet(**{f.name: getattr(self, f.name)[which] for f in fields(self)})

    @staticmethod
    def join(sets: Sequence[CellSet]) -> CellSet:
        """Return the cells of several sets in one."""
        names = [f.name for f in fields(CellSet)]
        return CellSet(**{name: np.concatenate([getattr(s, name) for s in sets]) for name in names})


def foldable(robot: Robot, farthest: Array) -> Bools:
    """Return which joints (n,) of the arm may count as endless though they have a range.

    The range is at least a turn. Each step moves a joint by at most the ``farthest`` (n,) rad, less
    than half a turn, so that the increments of a motion are the same modulo turns. Joints over
    which accelerations have a table do not count.
    """
    limits = robot.joint_limits()
    wide = limits.upper - limits.lower >= TURN
    wide &= ~_placed(robot)
    wide[robot.arm.joints :] = False
    return np.asarray(wide & (farthest < np.pi) & ~limits.endless)


def _placed(robot: Robot) -> Bools:
    """Return the joints (n,) over which accelerations have a table, so that their turns matter."""
    tabled = robot.limits.acceleration_table is not None
    return np.asarray(tabled & np.isin(np.arange(robot.joints), OVER))


def cell_maker(
    plan: Plan,
    weight: Array,
    width: float = 1.0,
    folded: Bools | None = None,
    floor: float | None = None,
) -> CellMaker:
    """Return the maker of the cells of a plan's contour, see `CellMaker`.

    Where there is more than gamma the floor is left out.
    """
    asked = plan.settings
    more = asked.tilt is not None or plan.robot.externals
    return CellMaker(
        plan.robot,
        plan.nominal_frames,
        plan.T_flange_tip,
        asked.postures,
        width,
        folded,
        None if more else floor,
        cone=0.0 if asked.tilt is None else asked.tilt.cone,
        weight=weight,
    )


class CellMaker:
    """Makes the cells of a contour.

    Parameters
    ----------
    robot : Robot
        A robot whose arm has proven bounds; it may have external axes.
    frames : (K, 4, 4) m
        Task frames in the robot base, without tilt.
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
    cone : float rad
        Largest tilt of the tool axis.
    weight : (n,) 1/rad, optional
        By which the parameter to halve is chosen; needed where there is more than gamma.

    Attributes
    ----------
    more : bool
        Whether there are other parameters than gamma.
    columns : int
        Number of coarsest cells of a node, before postures and turns.
    turns : (n,) bool
        Which joints are angles that are known up to full turns.
    endless : (n,) bool
        With the folded ones.
    placed : (n,) bool
        Joints whose turns matter for (6).
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
        cone: float = 0.0,
        weight: Array | None = None,
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
        self.placed = _placed(robot)
        self._cone, self._axes = cone * (1 + BARELY), robot.externals
        self._weight = np.ones(len(limits.endless)) if weight is None else np.asarray(weight)
        self._first_at, self._first_reach = self._first_parameters()
        self.more = self._first_at.shape[1] > 0
        self.columns = len(self._first_at) * self._circle
        self.turns = np.arange(len(limits.endless)) < robot.arm.joints
        self.turns |= limits.endless

    def coarsest(self, nodes: Ints) -> CellSet:
        """Return the coarsest cells at some nodes, in postures and turns within the ranges."""
        coarse = COARSE_LEVEL if self.more else 0
        each, columns = self._circle, len(self._first_at)
        node = np.repeat(nodes.astype(np.int32), each * columns)
        index = np.tile(np.repeat(np.arange(each, dtype=np.int32), columns), len(nodes))
        column = np.tile(np.arange(columns), each * len(nodes))
        level = np.full(len(node), coarse, np.int8)
        cuts = np.zeros(len(node), np.int16)
        wanted = np.isin(np.arange(self._robot.postures), self._postures)[None]
        sets = []
        for first in range(0, len(node), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            at, reach = self._first_at[column[part]], self._first_reach[column[part]]
            keys = node[part], level[part], index[part], cuts[part], at, reach
            sets.append(self.lifted(self._enclosed_all(*keys, wanted)[0]))
        return CellSet.join(sets)

    @property
    def _circle(self) -> int:
        """Number of coarsest cells of the circle of gamma."""
        return int(BASE * 2.0**COARSE_LEVEL) if self.more else BASE

    def _first_parameters(self) -> tuple[Array, Array]:
        """Return middle and half-width (B, M) of the first boxes of the other parameters."""
        spans = [(-self._cone, self._cone, WIDEST_TILT)] * (2 if self._cone else 0)
        first, limits = self._robot.arm.joints, self._limits
        for i, axis in enumerate(self._axes, first):
            widest = WIDEST_LINEAR if axis.kind == "linear" else WIDEST_ROTARY
            turn = limits.endless[i]
            low, high = (-np.pi, np.pi) if turn else (limits.lower[i], limits.upper[i])
            spans.append((float(low) - EDGE, float(high) + EDGE, widest))
        middles, halves = [np.zeros((1, 0))], [np.zeros((1, 0))]
        for low, high, widest in spans:
            count = max(1, int(np.ceil((high - low) / (2 * widest))))
            half = (high - low) / (2 * count)
            middle = low + half * (2 * np.arange(count) + 1)
            old, own = middles[-1], np.full(count, half)
            pair = np.repeat(np.arange(len(old)), count), np.tile(np.arange(count), len(old))
            middles.append(np.column_stack([old[pair[0]], middle[pair[1]]]))
            halves.append(np.column_stack([halves[-1][pair[0]], own[pair[1]]]))
        at, reach = middles[-1], halves[-1] * (1 + BARELY) + 4 * ROUNDED
        some = self._in_cone(at, reach)
        return at[some], reach[some]

    def _in_cone(self, at: Array, reach: Array) -> Bools:
        """Return which boxes (B, M) hold a tilt within the cone."""
        if not self._cone:
            return np.ones(len(at), np.bool_)
        nearest = np.maximum(np.abs(at[:, :2]) - reach[:, :2], 0.0)
        return np.asarray(np.hypot(*nearest.T) <= self._cone)

    def joints(self, nodes: Ints, gamma: Array, posture: int) -> tuple[Array, Array, Bools]:
        """Return the approximate joints at gamma (M,) at nodes, in a posture, and their slopes.

        Both are (M, n), rad and rad/rad. Also returned is whether the posture reaches each (M,).
        Joints are on any turn, those that are `placed` near the middles of their ranges.
        """
        half = np.full(len(gamma), SLIGHT)
        found = self._robot.arm.enclose(self._frames, nodes, gamma, half, self._tool)
        q = self._on_turns(found.center[:, posture])
        return q, found.slope[:, posture], found.status[:, posture] > 0

    def _on_turns(self, q: Array) -> Array:
        """Return joints (M, n) with those that are `placed` near the middles of their ranges."""
        limits, at = self._limits, self.placed
        if at.any():
            middle = (limits.lower + limits.upper)[at] / 2
            q = q.copy()
            q[:, at] -= TURN * np.rint((q[:, at] - middle) / TURN)
        return q

    def curves(
        self, nodes: Ints, gamma: Array, half: Array, posture: Ints
    ) -> tuple[Array, Array, Array, Array] | None:
        """Return center, slope, bend and spread (M, n) on one interval of gamma at each node.

        They are as in `CellSet`, on turns as by `joints`. None if a posture (M,) has no solution on
        its interval.
        """
        found = self._robot.arm.enclose(self._frames, nodes, gamma, half, self._tool)
        each, h = (np.arange(len(nodes)), posture), half[:, None]
        if not (found.status[each] > 0).all():
            return None
        low, high, slope = found.low[each], found.high[each], found.slope[each]
        spread = found.radius[each] + self._width * (high - low) * h**2 / 4
        spread = spread * (1 + ROUNDED) + ROUNDED * (1 + np.abs(slope) * h)
        return self._on_turns(found.center[each]), slope, (low + high) / 2, spread

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

    def linear(
        self, nodes: Ints, gamma: Array, at: Array, posture: Ints
    ) -> tuple[Array, Array] | None:
        """Return the approximate joints (L, n) with gamma and other parameters at nodes.

        Also returns their slopes by gamma and the others, (L, 1 + M, n). None if a posture does not
        reach its node.
        """
        half, reach = np.full(len(gamma), SLIGHT), np.full(at.shape, SLIGHT)
        found = enclose_regions(
            self._robot.arm, self._axes, self._frames, self._tool, nodes, gamma, half, at, reach
        )
        each = np.arange(len(nodes)), posture
        if not (found.status[each] > 0).all():
            return None
        slope = np.concatenate([found.slope[each][:, None], found.tied[each]], axis=1)
        return found.center[each], slope

    def parameters(self, q: Array) -> Array:
        """Return the parameters (L, M) besides gamma at joints (L, n), as if without a tilt."""
        own = q[:, self._robot.arm.joints :]
        return np.concatenate([np.zeros((len(q), 2 if self._cone else 0)), own], axis=1)

    def room(self, at: Array, most: float) -> tuple[Array, Array]:
        """Return the least and the largest change (L, 1 + M) of gamma and the other parameters."""
        low, high = np.full((2, len(at), 1 + at.shape[1]), most)
        if self.more:
            middle, reach = self._first_at, self._first_reach
            first, last = (middle - reach).min(axis=0), (middle + reach).max(axis=0)
            low[:, 1:] = np.minimum(low[:, 1:], at - first)
            high[:, 1:] = np.minimum(high[:, 1:], last - at)
        return -np.maximum(low, 0.0), np.maximum(high, 0.0)

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
        which = self._widest(cells)[parent]
        turned, M = which < 0, cells.reach.shape[1]
        node, level = cells.node[parent], (cells.level[parent] + turned).astype(np.int8)
        index = np.where(turned, 2 * cells.index[parent] + right, cells.index[parent])
        cuts = (cells.cuts[parent] + ~turned).astype(np.int16)
        at, reach = cells.at[parent], cells.reach[parent]
        if M:
            own = which[:, None] == np.arange(M)
            half = np.where(own, reach / 2, 0.0)
            at, reach = at + (2 * right - 1)[:, None] * half, reach - half * (1 - BARELY)
            real = self._in_cone(at, reach)
            parent, right, turned = parent[real], right[real], turned[real]
            node, level, index, cuts = node[real], level[real], index[real], cuts[real]
            at, reach = at[real], reach[real]
        if M:
            key: Array | Ints = np.column_stack([node, level, index, at, reach])
        else:  # one number: sorting rows takes longer
            key = ((node.astype(np.int64) << 6) + level << 32) + index
        _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
        which = which.ravel()
        wanted = np.zeros((len(first), self._robot.postures), np.bool_)
        wanted[which, cells.posture[parent]] = True
        made, place = self._enclosed_all(
            node[first], level[first], index[first].astype(np.int32), cuts[first], at[first],
            reach[first], wanted,
        )  # fmt: skip
        row = place[which, cells.posture[parent]]
        real = row >= 0
        parent, right, row, turned = parent[real], right[real], row[real], turned[real]
        child = made.take(row)
        middle = np.where(turned, (2 * right - 1) * child.half, 0.0)[:, None]
        there = cells.center[parent] + cells.slope[parent] * middle
        there = there + cells.bend[parent] * middle**2 / 2
        if M:
            there += np.einsum("cmi,cm->ci", cells.tied[parent], child.at - cells.at[parent])
        shift = TURN * np.rint((there - child.center) / TURN)
        still = self._limits.endless.copy()
        still[self._robot.arm.joints :] = True
        moved = self._moved(child, np.where(still, 0.0, shift))
        moved = replace(moved, floor=cells.floor[parent])
        # Nothing known of a joint is forgotten: its turn would be lost with it.
        spread = cells.spread[parent]
        lost = (spread <= FREE) & (moved.spread > FREE)
        if lost.any():
            steep = cells.slope[parent] + cells.bend[parent] * middle
            moved = replace(
                moved,
                center=np.where(lost, there, moved.center),
                slope=np.where(lost, steep, moved.slope),
                bend=np.where(lost, cells.bend[parent], moved.bend),
                spread=np.where(lost, spread + ROUNDED * (1 + np.abs(there)), moved.spread),
                tied=np.where(lost[:, None], cells.tied[parent], moved.tied),
            )
        free = (cells.spread[parent] > FREE).any(axis=1)
        kept = [moved.take(self._inside(moved) & ~free)]
        if free.any():
            lifted = self.lifted(made.take(np.unique(row[free])))
            least = cells.floor[parent[free]].min()
            kept.append(replace(lifted, floor=np.full(len(lifted), least)))
        return CellSet.join(kept)

    def _widest(self, cells: CellSet) -> Ints:
        """Return the parameter (C,) that moves the joints most, and -1 for gamma."""
        if not cells.reach.shape[1]:
            return np.full(len(cells), -1)
        weight = np.maximum(self._weight, SAME_WORTH * self._weight.max())
        gamma = (np.abs(cells.slope) * cells.half[:, None]) @ weight
        others = (np.abs(cells.tied) @ weight) * cells.reach
        return np.asarray(np.argmax(np.column_stack([gamma, others]), axis=1) - 1)

    def _enclosed_all(
        self,
        node: NDArray[np.int32],
        level: NDArray[np.int8],
        index: NDArray[np.int32],
        cuts: NDArray[np.int16],
        at: Array,
        reach: Array,
        wanted: Bools,
    ) -> tuple[CellSet, Ints]:
        """Return the cells with a solution in postures that are wanted, (B, P).

        Also returned is the row of each posture (B, P), -1 for none.
        """
        gamma, half = cell_bounds(level, index)
        arm, frames, places, M = self._robot.arm, self._frames, node.astype(np.int64), at.shape[1]
        if M:
            found = enclose_regions(
                arm, self._axes, frames, self._tool, places, gamma, half, at, reach
            )
            status = found.status
        else:
            curves = arm.enclose(frames, places, gamma, half, self._tool)
            status = curves.status
        cell, posture = np.nonzero((status > 0) & wanted)
        of, h = (cell, posture), half[cell, None]
        if M:
            center, slope, bend = found.center[of], found.slope[of], found.bend[of]
            tied, spread = found.tied[of], found.radius[of]
        else:
            center, slope = curves.center[of], curves.slope[of]
            bend = (curves.high[of] + curves.low[of]) / 2
            unsure = (curves.high[of] - curves.low[of]) * h**2 / 4
            tied = np.zeros((len(cell), 0, center.shape[1]))
            spread = curves.radius[of] + self._width * unsure
        made = CellSet(
            node=node[cell],
            posture=posture.astype(np.int8),
            level=level[cell],
            index=index[cell],
            half=half[cell],
            center=center,
            slope=slope,
            bend=bend,
            spread=spread * (1 + ROUNDED) + ROUNDED * (1 + np.abs(slope) * h),
            floor=np.full(len(cell), -np.inf),
            at=at[cell],
            reach=reach[cell],
            tied=tied,
            cuts=cuts[cell],
        )
        above = self._above_floor(made)
        place = np.full(status.shape, -1, np.int64)
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
            if limits.endless[i] or i >= self._robot.arm.joints or not len(cells):
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
