"""One contour of a job: its loop, speed, operations and sampling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import pdist

from kerfpath.arrays import Array, short_repr
from kerfpath.cad import Loop, Part
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.format.tables import ContourTable
from kerfpath.job.format.tables.part import SAMPLINGS, LeadTable
from kerfpath.job.format.tables.table import LARGEST, MOST_NODES, SMALLEST
from kerfpath.names import listed
from kerfpath.operations import (
    Side,
    Surface,
    bevel,
    lead_in,
    lead_out,
    loop_corners,
    micro_joints,
    offset,
    overlap,
    reverse,
    round_corners,
    slow_corners,
    slow_turns,
    smooth_axes,
    smoothest_start,
    start_at,
)
from kerfpath.options import PlanOptions
from kerfpath.tolerances import SAME_PLACE
from kerfpath.windows import GammaWindow

# -----------------------------------------------------------------------------
# Apply the operations of a [[contour]] table to a drawn loop.

MM = 1e-3
ROUNDED = 1e-3
"""Share by which a hole may be larger than the size of small holes, for chords of its line."""
OTHER_SIDE: dict[Side, Side] = {"left": "right", "right": "left"}


def keys_of_closed_loops(table: ContourTable) -> dict[str, str]:
    """Return the used keys that need a closed loop, each with what holds for an open line."""
    ends = 'begins at one of its ends (at the other with direction = "reversed")'
    asked = {
        "start": (table.start != "drawn", ends),
        "start_mm": (table.start_mm is not None, ends),
        "overlap_mm": (table.overlap_mm is not None, "does not return to its start"),
    }
    return {key: lacks for key, (used, lacks) in asked.items() if used}


def shape_contour(table: ContourTable, drawn: Contour, surface: Surface | None) -> list[Contour]:
    """Return the contours that may be cut for a loop: one, or one for each start and direction.

    The operations are applied in this order: direction, smoothed axes, kerf, corners, start, bevel,
    micro joints, overlap, leads, reduced speed at corners (also where a lead meets the cut at an
    angle). Corners and leads lie on `surface`.

    Raises
    ------
    InputError
        An operation cannot be applied to the loop.
    """
    ways = {"drawn": (False,), "reversed": (True,), "best": (False, True)}[table.direction]
    return [cut for way in ways for cut in _run(table, drawn, surface, backwards=way)]


def _run(
    table: ContourTable, contour: Contour, surface: Surface | None, *, backwards: bool
) -> list[Contour]:
    scrap: Side = OTHER_SIDE[table.scrap] if backwards else table.scrap
    contour = reverse(contour) if backwards else contour
    if table.smooth_axes is not None:
        contour = smooth_axes(
            contour,
            table.smooth_axes.distance_mm * MM,
            limit=float(np.radians(table.smooth_axes.limit_deg)),
        )
    if table.kerf_mm:
        sharp = table.corners is not None
        contour = offset(contour, table.kerf_mm * MM / 2, side=scrap, sharp=sharp)
    if table.corners is not None and table.corners.round_mm is not None:
        contour = round_corners(contour, table.corners.round_mm * MM, surface=surface)
    if table.corners is not None and table.corners.loop_mm is not None:
        contour = loop_corners(contour, table.corners.loop_mm * MM, side=scrap, surface=surface)
    return [_add_features(table, begun, surface, scrap) for begun in _start_contour(table, contour)]


def _start_contour(table: ContourTable, contour: Contour) -> list[Contour]:
    """Return the contour with the start, or with each of the starts, that the table asks for."""
    if table.start_mm is not None:
        return [start_at(contour, contour.s[0] + table.start_mm * MM)]
    if table.start == "smoothest":
        return [start_at(contour, smoothest_start(contour))]
    if table.start == "best":
        places = np.linspace(contour.s[0], contour.s[-1], table.candidates, endpoint=False)
        return [start_at(contour, s) for s in places]
    return [contour]


def _add_features(
    table: ContourTable, contour: Contour, surface: Surface | None, scrap: Side
) -> Contour:
    """Return the contour with its bevel, joints, slow corners, overlap and leads."""
    if table.bevel_deg:
        contour = bevel(contour, float(np.radians(table.bevel_deg)), side=scrap)
    if table.micro_joints is not None:
        joints = table.micro_joints
        contour = micro_joints(contour, joints.width_mm * MM, count=joints.count)
    if table.overlap_mm is not None:
        contour = overlap(contour, table.overlap_mm * MM)
    if table.lead_out is not None:
        contour = _with_lead(lead_out, contour, table.lead_out, scrap, surface)
    if table.lead_in is not None:
        contour = _with_lead(lead_in, contour, table.lead_in, scrap, surface)
    corners = table.corners
    if corners is not None and corners.slow_share is not None:
        contour = slow_corners(
            contour,
            corners.slow_share,
            distance=corners.slow_mm * MM,
            ramp=corners.ramp_mm * MM,
        )
    return contour


def _with_lead(
    lead: Callable[..., Contour], contour: Contour, table: LeadTable, scrap: Side,
    surface: Surface | None,
) -> Contour:  # fmt: skip
    return lead(
        contour,
        table.length_mm * MM,
        shape=table.shape,
        angle=float(np.radians(table.angle_deg)),
        side=scrap,
        surface=surface,
        fan=None if table.fan_mm is None else table.fan_mm * MM,
        speed_share=table.speed_share,
    )


# -----------------------------------------------------------------------------
# One contour of a job: its loop, speed, operations and sampling.


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourSpec:
    """One contour to cut: its loop, speed, operations and sampling.

    Exactly one of `spacing`, `time_step`, `count` and `tolerance` is given.

    Parameters
    ----------
    pick : str
        Name of the loop in the part; "" if the table picks several loops, see `expanded`.
    name : str
        Name of the contour in messages, reports and programs.
    speed : float m/s
        Speed along the path; 0 until it is that of the program that the loop is read from, see
        `expanded`.
    spacing : float m, optional
        Largest distance between nodes.
    time_step : float s, optional
        Largest time between nodes.
    count : int, optional
        Number of nodes.
    tolerance : float m, optional
        Largest distance of the chords from the contour.
    axis_tolerance : float rad, optional
        Largest angle between the tool axis along a chord and the contour's, with `tolerance`.
    bend_ends : bool
        Whether nodes are at the ends of bends, too, with `spacing` or `time_step`.
    turn_step : float m, optional
        Distance between nodes that the job asks for, by which the speed is reduced at sharp edges.
    table : ContourTable
        The table in the file, with the operations on the loop before it is sampled.
    small : ContourSpec, optional
        How the loop is cut instead, if it is a hole of at most `small_size` (m).
    by_size : bool
        Whether this is how such a hole is cut.
    """

    pick: str
    name: str
    speed: float
    spacing: float | None = None
    time_step: float | None = None
    count: int | None = None
    tolerance: float | None = None
    axis_tolerance: float | None = None
    bend_ends: bool = False
    turn_step: float | None = None
    table: ContourTable
    small: ContourSpec | None = None
    small_size: float = 0.0
    by_size: bool = False

    __repr__ = short_repr

    def expanded(self, part: Part) -> list[ContourSpec]:
        """Return one spec for each loop of the part that this one picks.

        Without a speed in the table it is the one that the program says along the loop; it stays 0
        if that says none or several, see `lacks_speed`.

        Raises
        ------
        InputError
            The part has no such loop.
        """
        if self.table.pick_all is None:
            loop = part.loop(self.pick)
            named = {self.name: loop}
        else:
            named = {loop.name: loop for loop in self.table.pick_all.loops(part)}
        return [
            replace(self._of_size(loop)._at_speed(loop), pick=loop.name, name=name)
            for name, loop in named.items()
        ]

    def _at_speed(self, loop: Loop) -> ContourSpec:
        """Return the spec at its own speed, or else at the only one of the loop's program."""
        if self.speed > 0 or len(loop.feeds) != 1:
            return self
        speed = float(f"{loop.feeds[0] * 60:.12g}")
        if not SMALLEST <= speed <= LARGEST:
            return self
        return contour_request(self.table.model_copy(update={"speed_m_min": speed}))

    def lacks_speed(self, loop: Loop) -> str:
        """Return why there is no speed along a loop and what to do, "" if there is one."""
        if self.speed > 0:
            return ""
        said = listed([f"{feed * 60:.4g}" for feed in loop.feeds], 5)
        got = (
            f"{said} m/min along {loop.name!r} in its program"
            if said
            else f"none for {loop.name!r}"
        )
        example = f"{max(loop.feeds) * 60:.4g}" if loop.feeds[1:] else "3"
        return f"expected one speed, got {got}; add, for example, speed_m_min = {example}"

    def _of_size(self, loop: Loop) -> ContourSpec:
        """Return how a loop is cut: as a small hole if it is one.

        Tables of points and tool paths do not tell holes from other closed contours.
        """
        hole = loop.kind == "inner" or (loop.kind == "outer" and loop.surface == "points")
        if self.small is None or not hole:
            return self
        if np.ptp(loop.bounding_box, axis=0).max() > self.small_size + SAME_PLACE:
            return self
        across = float(pdist(loop.line(self.small_size * ROUNDED)).max())
        return self.small if across <= self.small_size * (1 + ROUNDED) else self

    def drawn(self, part: Part) -> Contour:
        """Return the loop as drawn in the part.

        Raises
        ------
        InputError
            The loop has a gap; or it is an open line that was picked neither by name nor by
            kind = "open", and may be a trim that was meant to be closed.
        """
        everything = self.table.pick_all
        return part.contour(self.pick, closed=everything is not None and everything.kind != "open")

    def candidates(self, part: Part, drawn: Contour | None = None) -> list[Contour]:
        """Return the alternative contours that may be cut for the loop, see `shape_contour`.

        They are slower where the beam turns about sharp edges, see `slow_turns`.

        `drawn` is the loop as drawn; by default it is taken from the part.
        """
        laid = self.table.lead_in or self.table.lead_out or self.table.corners
        surface = part.surface(self.pick) if laid else None
        drawn = self.drawn(part) if drawn is None else drawn
        cuts = shape_contour(self.table, drawn, surface)
        if self.turn_step is None:
            return cuts
        edges = self.edges(part)
        return [
            slow_turns(cut, edges, distance=part.edge_turn, step=self.turn_step) for cut in cuts
        ]

    def edges(self, part: Part) -> list[Array]:
        """Return where the loop crosses sharp edges, (3,) m each."""
        return [turn.at for turn in part.loop(self.pick).edge_turns]

    @property
    def rounded(self) -> float | None:
        """Distance of the rounded corners from the drawn ones, m; None without rounding."""
        corners = self.table.corners
        return None if corners is None else _metres(corners.round_mm)

    def unrounded(self, part: Part, drawn: Contour) -> list[Contour]:
        """Return the same contours without rounded corners."""
        corners = self.table.corners
        assert corners is not None
        sharp = corners.model_copy(update={"round_mm": None})
        table = self.table.model_copy(update={"corners": sharp})
        return replace(self, table=table).candidates(part, drawn)

    def sample(self, contour: Contour) -> Contour:
        """Return the contour, sampled and named as this spec says.

        Raises
        ------
        InputError
            The spacing would give too many nodes, or the tolerance cannot be kept.
        """
        named, slowed = replace(contour, name=self.name), bool((contour.speed_share < 1).any())
        spacing, time_step = self.spacing, self.time_step
        if time_step is not None:
            self._require_few(contour, time_step * self.speed, "time_step_ms")
        elif spacing is not None:
            self._require_few(contour, spacing, "spacing_mm")
            time_step = spacing / self.speed if slowed else None
        if time_step is not None:
            timed = named.resample(dt=time_step, speed=self.speed, bend_ends=self.bend_ends)
            return timed if slowed else replace(timed, time=None)  # one speed: the plan's to say
        return named.resample(
            spacing=spacing,
            count=self.count,
            tolerance=self.tolerance,
            axis_tolerance=self.axis_tolerance,
            bend_ends=self.bend_ends,
        )

    def finer(self, share: float) -> ContourSpec:
        """Return the spec with the distance between nodes multiplied by a share below 1."""
        # The chord error grows with the square of the chord length.
        power = {"spacing_mm": 1, "time_step_ms": 1, "tolerance_mm": 2}
        given = self.table.model_dump(include=set(power), exclude_none=True)
        update = {key: value * share ** power[key] for key, value in given.items()}
        count = None if self.count is None else int(np.ceil((self.count - 1) / share)) + 1
        table = self.table.model_copy(update={**update, "count": count})
        asked = contour_request(table)
        return replace(
            asked,
            pick=self.pick,
            name=self.name,
            bend_ends=self.bend_ends,
            turn_step=self.turn_step,
            by_size=self.by_size,
        )

    def asked(self, options: PlanOptions) -> PlanOptions:
        """Return the options of the job with the windows of gamma of this contour."""
        return replace(options, gamma_windows=self.windows)

    @property
    def windows(self) -> tuple[GammaWindow, ...]:
        """Windows of gamma, by the arc length of the path."""
        return tuple(
            GammaWindow(
                start=first / 1000,
                end=last / 1000,
                low=float(np.radians(low)),
                high=float(np.radians(high)),
            )
            for first, last, low, high in self.table.gamma_windows or ()
        )

    @property
    def technique(self) -> str:
        """Its technique, and whether its size led to it; empty if the job names none for it."""
        said = self.table.technique or ""
        return f"{said} (by size)" if self.by_size else said

    @property
    def sampled_by(self) -> str:
        """The key of the table that sets the sampling."""
        return next(key for key in SAMPLINGS if getattr(self.table, key) is not None)

    def _require_few(self, contour: Contour, spacing: float, key: str) -> None:
        if contour.length / spacing > MOST_NODES:
            raise InputError(
                f"contour {self.name!r}: expected at most {MOST_NODES} nodes, got more with "
                f"{spacing * 1e3:g} mm between nodes over {contour.length * 1e3:g} mm; raise {key}"
            )


def contour_request(table: ContourTable) -> ContourSpec:
    """Return what a [[contour]] table asks for, in SI."""
    angle, step = table.axis_tolerance_deg, table.time_step_ms
    speed = 0.0 if table.speed_m_min is None else table.speed_m_min / 60
    return ContourSpec(
        pick=table.pick or "",
        name=table.name or table.pick or "",
        speed=speed,
        spacing=_metres(table.spacing_mm),
        time_step=None if step is None else step / 1000,
        count=table.count,
        tolerance=_metres(table.tolerance_mm),
        axis_tolerance=None if angle is None else float(np.radians(angle)),
        turn_step=_metres(table.spacing_mm) if step is None else step / 1000 * speed,
        table=table,
    )


def _metres(mm: float | None) -> float | None:
    return None if mm is None else mm / 1000
