"""Which candidates the tool can go down to and leave, and further ones where those do not do."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kerfpath.air import End, backed_off, why_not_clear
from kerfpath.cell import Cell
from kerfpath.errors import InputError, NoFeasiblePath
from kerfpath.plans import Plan
from kerfpath.robots import posture_name

__all__ = ["Asked", "further", "reachable", "unused_postures"]

BACK_BY = (0.0, 0.1, 0.4, 0.7, 1.0)
"""Shares of the retract between which the joints are taken to run straight."""


def unused_postures(made: Sequence[Plan], wanted: Sequence[int] | None) -> list[int]:
    """Return the postures (default: all) that none of a contour's plans begins or ends in."""
    used = {int(p) for one in made for p in one.posture[[0, -1]]}
    every = range(made[0].robot.postures) if wanted is None else wanted
    return [int(p) for p in every if p not in used]


class Asked:
    """The contours that have been asked for more plans, and what came of it."""

    def __init__(self, every: list[list[Plan]], more: Callable[[int], Sequence[Plan]]) -> None:
        self._every, self._more = every, more
        self._got: dict[int, int] = {}

    def more_of(self, contour: int) -> range:
        """Ask a contour for further plans, once; return the numbers of its new candidates."""
        made = self._every[contour]
        first = len(made)
        if contour not in self._got:
            made += self._more(contour)
            self._got[contour] = len(made) - first
        return range(first, len(made))

    def told(self, broken: NoFeasiblePath) -> NoFeasiblePath:
        """Say of a failure which other plans have been tried."""
        tried = [
            f"{self._every[i][0].name!r} in {count} other postures"
            for i, count in self._got.items()
            if count
        ]
        if not tried:
            return broken
        return broken.retold(f"{broken}; tried as well: {', '.join(tried)}")


def reachable(
    every: Sequence[Sequence[Plan]], cell: Cell | None, retract: float, asked: Asked
) -> list[tuple[int, int]]:
    """Return contour and candidate of each plan that the tool can go down to and leave again."""
    places: list[tuple[int, int]] = []
    for i, made in enumerate(every):
        broken, found = _reached(made, range(len(made)), cell, retract)
        if broken is not None and not found:
            _, found = _reached(made, asked.more_of(i), cell, retract)
            if not found:
                raise asked.told(broken)
        places += [(i, c) for c in found]
    return places


def further(
    every: Sequence[Sequence[Plan]],
    cell: Cell | None,
    retract: float,
    asked: Asked,
    contours: Sequence[int],
) -> list[tuple[int, int]]:
    """Return contour and candidate of what contours have to offer beside what did not do."""
    return [
        (i, c) for i in contours for c in _reached(every[i], asked.more_of(i), cell, retract)[1]
    ]


def _reached(
    made: Sequence[Plan], which: range, cell: Cell | None, retract: float
) -> tuple[NoFeasiblePath | None, list[int]]:
    """Return those candidates that the tool can go down to and leave, and why not the first."""
    broken, found = None, []
    for c in which:
        try:
            _require_clear_ends(made[c], cell, retract)
            found.append(c)
        except NoFeasiblePath as error:
            broken = broken or error
    return broken, found


def _require_clear_ends(made: Plan, cell: Cell | None, retract: float) -> None:
    """Raise NoFeasiblePath where the tool cannot go down to a cut or back from it."""
    ends: tuple[tuple[End, int], ...] = (("start", 0), ("end", len(made.q) - 1))
    for end, node in ends:
        try:
            way = np.array([backed_off(made, end, part * retract) for part in BACK_BY])
        except InputError as broken:
            raise NoFeasiblePath(str(broken), proved=True, node=node) from broken
        if cell is None:
            continue
        if not cell.clear_through(way):
            raise NoFeasiblePath(
                f"contour {made.name!r}: in posture {posture_name(int(made.posture[node]))} the "
                f"tool is not clear while it backs off node {node} by {retract * 1e3:g} mm: "
                f"{why_not_clear(cell, way)}",
                proved=True,
                node=node,
            )
