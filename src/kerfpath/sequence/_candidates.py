"""Select the candidates that the tool can approach and leave, and plan more where none is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.plans import Plan
from kerfpath.robots import posture_name
from kerfpath.transfer import End, back_off, explain_collision

__all__ = ["MorePlans", "more_reachable", "reachable", "unused_postures"]

BACK_BY = (0.0, 0.1, 0.4, 0.7, 1.0)
"""Shares of the retract between which the joints are assumed to move linearly."""


def unused_postures(made: Sequence[Plan], wanted: Sequence[int] | None) -> list[int]:
    """Return the wanted postures (None: all) in which no plan of a contour begins or ends."""
    used = {int(p) for one in made for p in one.posture[[0, -1]]}
    every = range(made[0].robot.postures) if wanted is None else wanted
    return [int(p) for p in every if p not in used]


class MorePlans:
    """Further plans of contours, requested once for each contour, and how many were found."""

    def __init__(self, every: list[list[Plan]], more: Callable[[int], Sequence[Plan]]) -> None:
        self._every, self._more = every, more
        self._got: dict[int, int] = {}

    def of(self, contour: int) -> range:
        """Request further plans of a contour, once; return the numbers of the new candidates."""
        made = self._every[contour]
        first = len(made)
        if contour not in self._got:
            made += self._more(contour)
            self._got[contour] = len(made) - first
        return range(first, len(made))

    def mentioned_in(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Return the failure with the further plans that were tried added to its message."""
        tried = [
            f"{self._every[i][0].name!r} in {count} other postures"
            for i, count in self._got.items()
            if count
        ]
        if not tried:
            return broken
        return broken.with_message(f"{broken}; also tried: {', '.join(tried)}")


def reachable(
    every: Sequence[Sequence[Plan]], cell: Cell | None, retract: float, further: MorePlans
) -> list[tuple[int, int]]:
    """Return (contour, candidate) of each plan that the tool can approach and leave."""
    places: list[tuple[int, int]] = []
    for i, made in enumerate(every):
        broken, found = _reachable(made, range(len(made)), cell, retract)
        if broken is not None and not found:
            _, found = _reachable(made, further.of(i), cell, retract)
            if not found:
                raise further.mentioned_in(broken)
        places += [(i, c) for c in found]
    return places


def more_reachable(
    every: Sequence[Sequence[Plan]], cell: Cell | None, retract: float, further: MorePlans,
    contours: Sequence[int],
) -> list[tuple[int, int]]:  # fmt: skip
    """Return (contour, candidate) of each further plan that the tool can approach and leave."""
    return [(i, c) for i in contours for c in _reachable(every[i], further.of(i), cell, retract)[1]]


def _reachable(
    made: Sequence[Plan], which: range, cell: Cell | None, retract: float
) -> tuple[NoFeasiblePath | None, list[int]]:
    """Return the first failure and the candidates that the tool can approach and leave."""
    broken, found = None, []
    for c in which:
        try:
            _require_clear_ends(made[c], cell, retract)
            found.append(c)
        except NoFeasiblePath as error:
            broken = broken or error
    return broken, found


def _require_clear_ends(made: Plan, cell: Cell | None, retract: float) -> None:
    """Raise NoFeasiblePath where the tool cannot approach a cut or back off from it."""
    ends: tuple[tuple[End, int], ...] = (("start", 0), ("end", len(made.q) - 1))
    for end, node in ends:
        try:
            way = np.array([back_off(made, end, part * retract) for part in BACK_BY])
        except InputError as broken:
            raise NoFeasiblePath(str(broken), proved=True, node=node) from broken
        if cell is None:
            continue
        if not cell.clear_through(way):
            raise NoFeasiblePath(
                f"contour {made.name!r}: in posture {posture_name(int(made.posture[node]))} the "
                f"tool is not clear while it backs off node {node} by {retract * 1e3:g} mm: "
                f"{explain_collision(cell, way)}",
                proved=True,
                node=node,
            )
