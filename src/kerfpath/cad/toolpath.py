"""Contours of a tool path: one for each run of feed moves between two rapid moves."""

from __future__ import annotations

import codecs
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.cad.build import (
    REPEATED,
    kind_of_points,
    loop_of,
    part_without_faces,
    trace_of_points,
)
from kerfpath.cad.left_out import counted
from kerfpath.cad.machine import GIVE_CENTRE, GIVE_PIVOT, GIVE_TCP, Machine
from kerfpath.cad.part import Loop, Part
from kerfpath.cad.units import GIVE_AXIS, LARGEST, MM, NO_UNIT, UNITS_MM
from kerfpath.contour import angle_between, slerp
from kerfpath.errors import InputError
from kerfpath.text import number, text_lines, upper

Triple = tuple[float, float, float]
UNKNOWN = "the word is not known, and may change the path"
"""Why an unknown word is refused."""
ALONG = float(np.radians(1.0))
"""rad: a move closer to the tool axis than this cuts nothing new: an approach or retract."""
UNIT_AXIS = 1e-2
"""Largest deviation of the length of an axis from one: rounded digits pass, angles do not."""


ARC_CHORD = 1e-3
"""Largest distance (mm) of the chords of an arc from it."""
ARC_ENDS, ARC_SHARE = 0.01, 1e-3
"""Difference of the distances of the ends of an arc from its centre, by rounding of digits: mm, and
as a share of its radius."""


AXIS_CHORD = float(np.radians(0.01))
"""Largest angle (rad) between the tool axis while rotary axes move, and that turned evenly."""
ROTARY_STEP = 5.0
"""Largest step (deg) of a rotary axis between points."""
MOST_ROTARY = 36_000.0
"""Largest way (deg) of a rotary axis in one block; longer ones are typing errors."""


class Arc(NamedTuple):
    """An arc: its centre (3,), and the unit vector (3,) about which it runs counter-clockwise."""

    centre: Triple
    normal: Triple


ROUNDED = 1e-3
"""Share by which rounding may leave a radius too short for its chord."""


def centre_by_radius(start: Array, end: Array, normal: Array, radius: float, where: str) -> Array:
    """Return the centre (3,) of an arc that runs counter-clockwise about a unit `normal` (3,).

    A negative radius is that of an arc of more than a half turn.

    Raises
    ------
    InputError
        Ends (3,) too far apart for the radius, or in one place; the message begins with `where`.
    """
    way = end - start
    way = way - (way @ normal) * normal
    half, size = float(np.linalg.norm(way)) / 2, abs(radius)
    if not 0 < half <= size * (1 + ROUNDED):
        raise InputError(
            f"{where}: an arc of radius {size:g} between places {2 * half:g} apart; give a full "
            "circle by its centre"
        )
    aside = np.cross(normal, way) / (2 * half) * np.copysign(1.0, radius)
    return np.asarray(start + way / 2 + np.sqrt(max(size**2 - half**2, 0.0)) * aside)


class Rotary(NamedTuple):
    """The rotary axes of a machine at the end of a move.

    Parameters
    ----------
    angles : (3,) deg
        A, B and C.
    tcp : bool or None
        Whether the point is that of the tip in the part, see `Machine`; None if neither the program
        nor the machine says.
    even : bool
        Whether the tool axis turns evenly, not the rotary axes.
    """

    angles: Triple
    tcp: bool | None
    even: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """One move of a tool path, in the unit of its file.

    Parameters
    ----------
    line : int or str
        Line in the file, or line and file of another that belongs to it.
    kind : {"feed", "rapid", "away", "begin"}
        A feed move; a rapid move or a set position; a move to a position that is not in the file;
        or no move, but the begin of an operation, wherever the tool comes from.
    point : (3,) or None
        Target of the tip.
    axis : (3,) or None
        Unit vector from the tip towards the spindle; None if the file has none.
    operation : str
        Name of the operation in the file.
    arc : Arc or None
        The arc that a feed move runs along; it rises evenly if its ends differ in height.
    rotary : Rotary or None
        The rotary axes, instead of `axis`, in the program of a machine that has them.
    rate : float or None
        Speed of a feed move, in the unit of the file per minute; None if it is not known.
    """

    line: int | str
    kind: Literal["feed", "rapid", "away", "begin"]
    point: Triple | None = None
    axis: Triple | None = None
    operation: str = ""
    arc: Arc | None = None
    rotary: Rotary | None = None
    rate: float | None = None

    __repr__ = short_repr


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolPath:
    """The moves of a file, its unit ("" for none), notes, and the words that are not used."""

    moves: Sequence[Move]
    unit: str
    notes: Sequence[str] = ()
    unused: Collection[str] = ()

    __repr__ = short_repr


class Tip:
    """The tip of a tool, moved by the program of a machine; what a block leaves out is kept.

    Z is 0 in a program that never gives it, as one for a flat sheet. Rotary axes are at 0 until the
    program gives them.

    Parameters
    ----------
    machine : Machine or None
        The machine of a program with rotary axes.
    """

    def __init__(self, machine: Machine | None = None) -> None:
        self.moves: list[Move] = []
        self.machine = machine
        self.tcp: bool | None = None
        """What the program said last about tool-centre-point control."""
        self.even = False
        """Whether the control turns the tool axis evenly, not the rotary axes."""
        self._place: dict[str, float] = {}
        self._axis: Triple | None = None
        self._level: list[int] | None = []
        self._angles = dict.fromkeys(machine.axes, 0.0) if machine else {}
        self._assumed: dict[str, int] = {}

    def go(
        self, line: int, *, feed: bool, place: dict[str, float], axis: Triple | None,
        arc: Callable[[Triple, Triple], Arc] | None = None,
        angles: Mapping[str, float] = MappingProxyType({}), rate: float | None = None,
    ) -> None:  # fmt: skip
        """Move to `place`, of which any of the coordinates "X", "Y" and "Z" may be missing.

        `arc` returns the arc from the place before (3,) to this one (3,); `angles` (deg) has the
        rotary axes that move, by their letters; `rate` is the speed of a feed move, see `Move`.

        Raises
        ------
        InputError
            A feed move with a coordinate that was never given, a rotary axis that the machine does
            not have, or a turn of one that depends on the machine.
        """
        rotary = self._turned(line, angles, feed=feed, has_axis=axis is not None)
        if "Z" in place:
            self._leave_level()
        before = [self._place.get(name) for name in "XYZ"]
        self._place |= place
        if self._level is not None and {"X", "Y"} <= self._place.keys():
            self._level.append(len(self.moves))
            self._place["Z"] = 0.0
        self._axis = axis or self._axis
        unknown = [name for name in "XYZ" if name not in self._place]
        if unknown and feed:
            raise InputError(f"line {line}: a move at feed, but {unknown[0]} was not given before")
        if unknown:
            self.moves.append(Move(line=line, kind="away"))
            return
        point = self._place["X"], self._place["Y"], self._place["Z"]
        kind: Literal["feed", "rapid"] = "feed" if feed else "rapid"
        along = None
        if arc is not None:
            x, y, z = before
            if x is None or y is None or z is None:
                raise InputError(f"line {line}: an arc from a place that is not known")
            along = arc((x, y, z), point)
        self.moves.append(
            Move(
                line=line, kind=kind, point=point, axis=self._axis, arc=along, rotary=rotary,
                rate=rate,
            )
        )  # fmt: skip

    def nearest(self, name: str, angle: float) -> float:
        """Return an angle (deg) plus the turns that bring it nearest to where a rotary axis is."""
        before = self._angles.get(name, angle)
        return angle + 360 * round((before - angle) / 360)

    def _turned(
        self, line: int, angles: Mapping[str, float], *, feed: bool, has_axis: bool
    ) -> Rotary | None:
        """Return the rotary axes after they have moved."""
        if (machine := self.machine) is None:
            return None
        if has_axis:
            raise InputError(
                f"line {line}: machine: expected rotary axes, but the program has the tool axis as "
                "a vector; remove machine"
            )
        for name, angle in angles.items():
            if name not in machine.axes:
                raise InputError(
                    f"line {line}: {name}: machine has the rotary axes {', '.join(machine.axes)}; "
                    "add it to head or table"
                )
            before = self._angles.get(name)
            way = 0.0 if before is None else angle - before
            if abs(way) > MOST_ROTARY:
                raise InputError(
                    f"line {line}: {name} turns by {way:g} deg in one block, more than "
                    f"{MOST_ROTARY / 360:g} turns; correct it"
                )
            if before is not None and machine.rollover and abs(way) != 180:
                angle = before + way - 360 * round(way / 360)
            elif feed and machine.rollover is None and 180 < abs(way) < 360:
                raise InputError(
                    f"line {line}: {name} turns from {before:g} to {angle:g} deg at feed: say "
                    f"whether by {way - np.copysign(360, way):g} deg, rollover = true in machine, "
                    f"or by {way:g} deg, rollover = false"
                )
            self._angles[name] = angle
            self._assumed.setdefault(name, 0)
        if feed and (unknown := [name for name in machine.axes if name not in self._angles]):
            raise InputError(
                f"line {line}: a move at feed, but {unknown[0]} was not given after it moved to a "
                "place in the machine"
            )
        for name in machine.axes if feed else ():
            self._assumed.setdefault(name, line)
        a, b, c = (self._angles.get(name, 0.0) for name in "ABC")
        tcp = self.tcp if machine.tcp is None else machine.tcp
        return Rotary((a, b, c), tcp, self.even)

    def go_away(self, line: int, turned: Iterable[str] = ()) -> None:
        """Move to a position that is not known in the part, with the rotary axes `turned`, too."""
        self._place, self._axis = {}, None
        for name in turned:
            self._angles.pop(name, None)
        self.moves.append(Move(line=line, kind="away"))

    def forget(self, line: int) -> None:
        """Forget the position, because earlier coordinates have another meaning from here on."""
        if self.moves:
            self.go_away(line)

    def _leave_level(self) -> None:
        """Take back that Z is 0: rapid moves without it end where nothing is known."""
        for k in self._level or ():
            if (move := self.moves[k]).kind == "feed":
                raise InputError(f"line {move.line}: a move at feed, but Z was not given before")
            self.moves[k] = Move(line=move.line, kind="away")
        if self._level:
            self._place.pop("Z", None)
        self._level = None

    @property
    def notes(self) -> list[str]:
        """What was assumed."""
        notes = ["no move gives Z, which is taken as 0"] if self._level else []
        if self.machine is not None:
            notes += [
                f"{name} is taken as 0 in line {line}, as no line before gives it"
                for name, line in self._assumed.items()
                if line
            ]
        return notes

    @property
    def has_places(self) -> bool:
        """Whether any position in the part was given."""
        return any(move.point is not None for move in self.moves)


def lines_of(content: bytes) -> list[str]:
    """Return the lines of a file; characters that cannot be decoded are replaced.

    Raises
    ------
    InputError
        A control character, or another that no text contains (the message has the line).
    """
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    return text_lines(text)


def finite(text: str, where: str) -> float:
    """Return a finite number as CAM systems write it, also with the exponents of Fortran.

    Raises
    ------
    InputError
        Something else; the message begins with `where`.
    """
    try:
        value = number(upper(text).replace("D", "E"))
    except ValueError:
        raise InputError(f"{where}: expected a number, got {text[:40]!r}") from None
    if not np.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {text[:40]!r}")
    return value


def unit_axis(vector: Triple, where: str, *, any_length: bool = False) -> Triple:
    """Return a tool axis at length one; without `any_length` its length must be nearly one.

    Raises
    ------
    InputError
        A vector of length zero, or of another length than one.
    """
    size = max(map(abs, vector))
    if size == 0:
        raise InputError(f"{where}: the tool axis is 0 0 0; no direction")
    x, y, z = (np.array(vector) / size).tolist()  # no square overflows
    length = float(np.sqrt(x * x + y * y + z * z))
    if not any_length and abs(length * size - 1) > UNIT_AXIS:
        raise InputError(f"{where}: a tool axis of length {length * size:.3g}, expected 1")
    return x / length, y / length, z / length


def part_of_tool_path(
    path: Path, tool_path: ToolPath, unit: str | None, gap: float, axis: Array | None,
    machine: Machine | None = None,
) -> Part:  # fmt: skip
    """Return the part whose loops are the cuts of a tool path: `cut1`, `cut2`, ...

    Parameters
    ----------
    path : Path
    tool_path : ToolPath
    unit : str or None
        Unit of its numbers, instead of the one that the file states.
    gap : float m
        Largest distance between the ends of a closed cut.
    axis : (3,) or None
        The tool axis, into the part, where the file has none.
    machine : Machine or None
        The machine whose rotary axes the moves have.

    Raises
    ------
    InputError
        No known unit or tool axis, no cut, a cut from an unknown position, or one that is no
        contour (its line is named).
    """
    if not (unit or tool_path.unit):
        raise InputError(NO_UNIT)
    notes = list(tool_path.notes)
    if tool_path.unused:
        notes.append(f"words not used: {', '.join(sorted(tool_path.unused))}")
    if unit and tool_path.unit and unit != tool_path.unit:
        notes.append(f"unit {unit} as given; the file says {tool_path.unit}")
    if axis is not None and all(move.axis for move in tool_path.moves if move.kind == "feed"):
        raise InputError("axis: expected a tool path without tool axes, but this one has them")
    if machine is not None:
        cuts = [move for move in tool_path.moves if move.kind == "feed"]
        turned = [move.rotary.tcp for move in cuts if move.rotary is not None]
        notes.append(machine.said(tcp=bool(turned and turned[-1])))
    loops: list[Loop] = []
    holes = 0
    for run in _runs(tool_path.moves):
        name = f"cut{len(loops) + 1}"
        mm = UNITS_MM[unit or tool_path.unit]
        points, normals, lines, rates = _arrays(run, mm, axis, machine)
        first, last = _trimmed(points, normals)
        if last - first < 1:
            holes += 1
            continue
        notes += _left_out_of(name, points, normals, lines, first, last)
        inner = slice(first, last + 1)
        trace, repaired = trace_of_points(points[inner], normals[inner], lines[inner], gap / MM)
        _require_across(points[inner], normals[inner], lines[inner], turning=machine is not None)
        notes += [f"contour {name!r}: {what}" for what in repaired]
        if first == 0 and run[0].kind == "feed":
            notes.append(f"contour {name!r} begins in line {run[0].line}: no position before it")
        kind = kind_of_points(trace)
        loops.append(
            loop_of(
                name=name, face=name, kind=kind, trace=trace, surface="points", gap=gap,
                layer=run[-1].operation, feeds=_feeds(rates[first + 1 : last + 1] * mm * MM / 60),
            )
        )  # fmt: skip
    none = Counter({("feed move", "along the tool axis only, as for a hole", True): holes})
    left_out = counted(+none)
    if not loops:
        why = f" ({left_out[0]})" if left_out else ""
        raise InputError(f"holds no cut{why}; expected feed moves across the tool axis")
    return part_without_faces(
        path, unit or tool_path.unit, loops, gap=gap,
        notes=[*notes, *map(str, left_out)], left_out=left_out,
    )  # fmt: skip


def _runs(moves: Sequence[Move]) -> list[list[Move]]:
    """Return the runs of consecutive feed moves, each with the position that it starts from."""
    runs: list[list[Move]] = []
    before: Move | None = None
    for move in moves:
        if move.kind == "feed":
            if before is not None and before.kind == "feed":
                runs[-1].append(move)
            elif before is None or before.kind == "begin":
                runs.append([move])
            elif before.kind == "rapid":
                runs.append([before, move])
            else:
                raise InputError(
                    f"line {move.line}: a move at feed from a place that is not known, after "
                    f"line {before.line}; put a rapid move before it"
                )
        before = move
    return runs


def _arrays(
    run: Sequence[Move], mm: float, axis: Array | None, machine: Machine | None
) -> tuple[Array, Array, Array, Array]:
    """Return points (K, 3) mm, unit normals (K, 3), lines (K,) and speeds to them (K,) of a run.

    Speeds are in the unit of the file per minute, 0 where none is known.
    """
    ends = np.array([move.point for move in run]) * mm
    if (far := np.flatnonzero((np.abs(ends) > LARGEST).any(axis=1))).size:
        raise InputError(
            f"line {run[far[0]].line}: a point further than {LARGEST / 1e6:g} km from the "
            "origin; check the unit"
        )
    if run[0].arc is not None:
        raise InputError(f"line {run[0].line}: an arc from a place that is not known")
    ways = [_way(run[k], ends[k - 1], ends[k], mm) for k in range(1, len(run))]
    if machine is None:
        each = _with_axes(run, ends, ways, axis)
    else:
        each = _with_rotary_axes(run, ends, ways, machine)
    points, normals = (np.concatenate(one) for one in zip(*each, strict=True))
    sizes = [len(one) for one, _ in each]
    lines = np.repeat(np.array([move.line for move in run]), sizes)
    rates = np.repeat(_rates(run), sizes)
    return points, normals, lines, rates


def _rates(run: Sequence[Move]) -> Array:
    """Return the speed of the tip in each move of a run (K,), 0 where none is known.

    Where rotary axes turn without control of the tip, the speed in the program is not that of the
    tip in the part.
    """
    rates = np.array([move.rate or 0.0 for move in run])
    for k, (before, move) in enumerate(pairwise(run), start=1):
        if before.rotary is None or move.rotary is None or move.rotary.tcp:
            continue
        if before.rotary.angles != move.rotary.angles:
            rates[k] = 0.0
    return rates


def _feeds(speeds: Array) -> tuple[float, ...]:
    """Return the speeds (m/s) along a cut, each once in their order; none if one is not known."""
    feeds = tuple(dict.fromkeys(float(f"{speed:.12g}") for speed in speeds))
    return () if 0.0 in feeds else feeds


Placed = tuple[Array, Array]
"""Points (K, 3) mm, and unit normals (K, 3) there."""


class _Way(NamedTuple):
    """Least number of chords along a move, and a function of shares (K,): points (K, 3) mm."""

    steps: int
    at: Callable[[Array], Array]


def _with_axes(
    run: Sequence[Move], ends: Array, ways: Sequence[_Way], axis: Array | None
) -> list[Placed]:
    """Return the points (K, 3) mm and normals (K, 3) of each move; the tool axis turns evenly."""
    normals = np.empty_like(ends)
    for k, move in enumerate(run):
        if move.axis is not None:
            normals[k] = move.axis
        elif axis is not None:
            normals[k] = -axis / np.linalg.norm(axis)
        else:
            raise InputError(f"line {move.line}: no tool axis is known here; {GIVE_AXIS}")
    each = [(ends[:1], normals[:1])]
    return each + [_even(way, *normals[k : k + 2]) for k, way in enumerate(ways)]


def _even(way: _Way, before: Array, after: Array) -> Placed:
    share = np.linspace(0, 1, way.steps + 1)[1:]
    return way.at(share), slerp(before, after, share[:, None]) if way.steps > 1 else after[None]


def _with_rotary_axes(
    run: Sequence[Move], ends: Array, ways: Sequence[_Way], machine: Machine
) -> list[Placed]:
    """Return the points (K, 3) mm and normals (K, 3) of each move; all axes move evenly."""
    rotary = [move.rotary for move in run if move.rotary is not None]
    tcp = rotary[-1].tcp
    if tcp is None and machine.head:
        raise InputError(f"line {run[-1].line}: {GIVE_TCP}")
    if not tcp and machine.head and machine.pivot is None:
        raise InputError(f"line {run[-1].line}: {GIVE_PIVOT}")
    in_part = partial(machine.in_part, tcp=bool(tcp))
    each = [in_part(ends[:1], np.array([rotary[0].angles]))]
    for way, move, before, after in zip(ways, run[1:], rotary, rotary[1:], strict=False):
        start, turn = np.array(before.angles), np.subtract(after.angles, before.angles)
        if tcp and after.even:
            axes = in_part(np.zeros((2, 3)), np.array([before.angles, after.angles]))[1]
            each.append(_even(way, *axes))
            continue

        def at(share: Array, way: _Way = way, start: Array = start, turn: Array = turn) -> Placed:
            return in_part(way.at(share), start + share[:, None] * turn)

        steps = max(way.steps, int(np.ceil(np.abs(turn).max() / ROTARY_STEP)))
        sampled = _sampled(at, steps)
        if len(sampled[0]) == 1 and turn.any() and machine.table and not tcp:
            raise InputError(f"line {move.line}: {GIVE_CENTRE}")
        each.append(sampled)
    return each


def _sampled(at: Callable[[Array], Placed], steps: int) -> Placed:
    """Return points (K, 3) mm and normals (K, 3) along a move, without its start.

    Straight lines between them leave it by at most `ARC_CHORD`, the axis by at most `AXIS_CHORD`.
    The tip may stay in place: then only the end is returned.
    """
    while True:
        points, axes = at(np.linspace(0, 1, 2 * steps + 1))
        if np.ptp(points, axis=0).max() <= REPEATED:
            return points[-1:], axes[-1:]
        aside = np.linalg.norm(points[1::2] - (points[:-1:2] + points[2::2]) / 2, axis=1)
        turned = angle_between(axes[1::2], axes[:-1:2] + axes[2::2])
        excess = max(aside.max() / ARC_CHORD, turned.max() / AXIS_CHORD)
        if excess <= 1:
            return points[2::2], axes[2::2]
        steps = int(np.ceil(steps * max(np.sqrt(excess), 1.02)))


def _way(move: Move, start: Array, end: Array, mm: float) -> _Way:
    """Return the way of a move as its program has it: a line, or an arc."""
    arc = move.arc
    if arc is None:
        return _Way(1, lambda share: (1 - share[:, None]) * start + share[:, None] * end)
    z, centre = np.array(arc.normal), np.array(arc.centre) * mm
    flat = [p - centre - ((p - centre) @ z) * z for p in (start, end)]
    radii = [float(np.linalg.norm(p)) for p in flat]
    if not min(radii) > 0 or abs(radii[1] - radii[0]) > ARC_ENDS + ARC_SHARE * radii[0]:
        raise InputError(
            f"line {move.line}: an arc that begins {radii[0]:.6g} mm from its centre and ends "
            f"{radii[1]:.6g} mm from it; check its centre, and whether it is absolute or from the "
            "start"
        )
    x = flat[0] / radii[0]
    y = np.cross(z, x)
    turn = float(np.arctan2(flat[1] @ y, flat[1] @ x)) % (2 * np.pi)
    if np.linalg.norm(flat[1] - flat[0]) <= REPEATED:
        turn = 2 * np.pi
    step = 2 * np.arccos(max(0.0, 1 - ARC_CHORD / max(radii)))

    def at(share: Array) -> Array:
        angle, radius = turn * share[:, None], radii[0] + share[:, None] * (radii[1] - radii[0])
        rise = ((start - centre) @ z + share * ((end - start) @ z))[:, None]
        points = centre + radius * (np.cos(angle) * x + np.sin(angle) * y) + rise * z
        return np.where(share[:, None] == 1, end, points)

    return _Way(int(np.ceil(turn / step)), at)


def _along(points: Array, normals: Array, ends: np.ufunc = np.maximum) -> Array:
    """Return for each move (K - 1,) whether it is along the tool axis, or has no length.

    By default it is along the axes of both its ends, with `np.minimum` along that of one of them.
    """
    steps = np.diff(points, axis=0)
    length = np.linalg.norm(steps, axis=1)
    aside = ends(
        np.linalg.norm(np.cross(steps, normals[:-1]), axis=1),
        np.linalg.norm(np.cross(steps, normals[1:]), axis=1),
    )
    return np.asarray((length <= REPEATED) | (aside <= np.sin(ALONG) * length))


def _trimmed(points: Array, normals: Array) -> tuple[int, int]:
    """Return the first and last index of a cut without approach and retract."""
    across = np.flatnonzero(np.logical_not(_along(points, normals, np.minimum)))
    return (int(across[0]), int(across[-1]) + 1) if across.size else (0, 0)


def _left_out_of(
    name: str, points: Array, normals: Array, lines: Array, first: int, last: int
) -> list[str]:
    """Return notes on what is left out at the start and the end of a cut."""
    notes = []
    for where, part in (("start", slice(0, first + 1)), ("end", slice(last, None))):
        length = float(np.linalg.norm(np.diff(points[part], axis=0), axis=1).sum())
        turn = float(angle_between(normals[part][:1], normals[part][-1:])[0])
        what = [f"{length:.6g} mm along the tool axis"] if length > REPEATED else []
        what += [f"a turn of the axis by {np.degrees(turn):.3g} deg"] if turn > ALONG else []
        if what:
            notes.append(
                f"contour {name!r}: {' and '.join(what)} at its {where}, lines "
                f"{lines[part][0]} to {lines[part][-1]}, left out"
            )
    return notes


def _require_across(points: Array, normals: Array, lines: Array, *, turning: bool) -> None:
    """Raise InputError if the tip moves along the tool axis within a cut; if `turning`, steadily.

    Where rotary axes turn at a corner, the tip may do so in passing.
    """
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > REPEATED
    if turning:
        moved &= (normals[1:] == normals[:-1]).all(axis=1)
    if (bad := np.flatnonzero(moved & _along(points, normals))).size:
        raise InputError(
            f"line {lines[bad[0] + 1]}: a move along the tool axis within a cut; if it is an "
            "approach or a retract, put a rapid move before or after it"
        )
