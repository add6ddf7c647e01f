"""One contour of a job: which loop, how fast, what is made of it and how it is sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.cad import Part
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.job.format._operations import shape_contour
from kerfpath.job.format._values import MOST_NODES
from kerfpath.job.format.tables import ContourTable
from kerfpath.job.format.tables._contour import SAMPLINGS
from kerfpath.options import PlanOptions
from kerfpath.windows import GammaWindow

__all__ = ["ContourSpec", "task_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ContourSpec:
    """One contour to cut: which, how fast, and how it is sampled.

    Parameters
    ----------
    pick : str
        Name of the loop in the part; "" where the table picks several, see `expanded`.
    name : str
        What the contour is called in messages, reports and programs.
    speed : float m/s
        Speed along the path.
    spacing : float m, optional
        Largest distance between nodes; or
    time_step : float s, optional
        largest time between nodes; or
    count : int, optional
        number of nodes; or
    tolerance : float m, optional
        largest distance of the chords from the contour; exactly one of the four is given.
    axis_tolerance : float rad, optional
        Largest angle between the axis along a chord and the contour's, with `tolerance`.
    table : ContourTable
        What is made of the loop before it is sampled, as the file says it.
    """

    pick: str
    name: str
    speed: float
    spacing: float | None = None
    time_step: float | None = None
    count: int | None = None
    tolerance: float | None = None
    axis_tolerance: float | None = None
    table: ContourTable

    __repr__ = short_repr

    def expanded(self, part: Part) -> list[ContourSpec]:
        """Return a task for each loop of the part that this one picks.

        Raises
        ------
        InputError
            No such loop.
        """
        if self.table.pick_all is None:
            return [replace(self, pick=part.loop(self.pick).name)]
        return [
            replace(self, pick=loop.name, name=loop.name)
            for loop in self.table.pick_all.loops(part)
        ]

    def drawn(self, part: Part) -> Contour:
        """Return its loop as the part has it.

        Raises
        ------
        InputError
            A loop with a gap; a line drawn open that is not asked for by name or as such, as a
            trim that was meant to be closed may end up as one.
        """
        everything = self.table.pick_all
        return part.contour(self.pick, closed=everything is not None and everything.kind != "open")

    def candidates(self, part: Part, drawn: Contour | None = None) -> list[Contour]:
        """Return the contours that may be cut for its loop, see `shape_contour`.

        `drawn` is the loop as the part has it, where that is at hand.
        """
        laid = self.table.lead_in or self.table.lead_out or self.table.corners
        surface = part.surface(self.pick) if laid else None
        drawn = self.drawn(part) if drawn is None else drawn
        return shape_contour(self.table, drawn, surface)

    @property
    def rounded(self) -> float | None:
        """By how much its corners are rounded, m; None where they are not."""
        corners = self.table.corners
        return None if corners is None else _metres(corners.round_mm)

    def unrounded(self, part: Part, drawn: Contour) -> list[Contour]:
        """Return the same contours with their corners as they were before they were rounded."""
        corners = self.table.corners
        assert corners is not None
        sharp = corners.model_copy(update={"round_mm": None})
        table = self.table.model_copy(update={"corners": sharp})
        return replace(self, table=table).candidates(part, drawn)

    def evenly_fast(self, part: Part) -> Contour:
        """Return the first of its paths, sampled, without shares of the speed."""
        path = self.candidates(part)[0]
        return self.sample(replace(path, speed_share=np.ones(len(path))))

    def sample(self, contour: Contour) -> Contour:
        """Return the contour sampled as this task says, under the task's name.

        Raises
        ------
        InputError
            A spacing that would make too many nodes, a tolerance that cannot be kept.
        """
        named, slowed = replace(contour, name=self.name), bool((contour.speed_share < 1).any())
        spacing, time_step = self.spacing, self.time_step
        if time_step is not None:
            self._require_few(contour, time_step * self.speed, "time_step_ms")
        elif spacing is not None:
            self._require_few(contour, spacing, "spacing_mm")
            time_step = spacing / self.speed if slowed else None
        if time_step is not None:
            timed = named.resample(dt=time_step, speed=self.speed)
            return timed if slowed else replace(timed, time=None)  # one speed: the plan's to say
        return named.resample(
            spacing=spacing,
            count=self.count,
            tolerance=self.tolerance,
            axis_tolerance=self.axis_tolerance,
        )

    def finer(self, share: float) -> ContourSpec:
        """Return the task with its nodes nearer to each other by a share below 1."""
        # What chords leave out grows with the square of their length.
        power = {"spacing_mm": 1, "time_step_ms": 1, "tolerance_mm": 2}
        given = self.table.model_dump(include=set(power), exclude_none=True)
        update = {key: value * share ** power[key] for key, value in given.items()}
        count = None if self.count is None else int(np.ceil((self.count - 1) / share)) + 1
        table = self.table.model_copy(update={**update, "count": count})
        return replace(task_of(table), pick=self.pick, name=self.name)

    def asked(self, options: PlanOptions) -> PlanOptions:
        """Return the options of its job with what its table asks for besides."""
        return replace(options, gamma_windows=self.windows)

    @property
    def windows(self) -> tuple[GammaWindow, ...]:
        """Where gamma is kept inside an interval, by the arc length of its path."""
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
    def sampled_by(self) -> str:
        """The key of its table that says how finely it is sampled."""
        return next(key for key in SAMPLINGS if getattr(self.table, key) is not None)

    def _require_few(self, contour: Contour, spacing: float, key: str) -> None:
        if contour.length / spacing > MOST_NODES:
            raise InputError(
                f"contour {self.name!r}: {spacing * 1e3:g} mm between nodes would make more "
                f"than {MOST_NODES} of them over {contour.length * 1e3:g} mm; raise {key}"
            )


def task_of(table: ContourTable) -> ContourSpec:
    """Return what a [[contour]] table asks for, in SI."""
    angle, step = table.axis_tolerance_deg, table.time_step_ms
    return ContourSpec(
        pick=table.pick or "",
        name=table.name or table.pick or "",
        speed=table.speed_m_min / 60,
        spacing=_metres(table.spacing_mm),
        time_step=None if step is None else step / 1000,
        count=table.count,
        tolerance=_metres(table.tolerance_mm),
        axis_tolerance=None if angle is None else float(np.radians(angle)),
        table=table,
    )


def _metres(mm: float | None) -> float | None:
    return None if mm is None else mm / 1000
