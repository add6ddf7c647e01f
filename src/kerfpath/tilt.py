"""Tolerance of the tool axis: a cone about the nominal axis, sampled as lead and lean."""

from __future__ import annotations

from dataclasses import MISSING, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, freeze, in_radians, not_negative
from kerfpath.errors import InputError
from kerfpath.setting import Settings, documented, setting

__all__ = ["Tilt", "tilt_frames"]


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class Tilt(Settings):
    """Tilt allowed away from the nominal tool axis: largest angle, steps and cost.

    Lead and lean are in the frame of travel: x along the path, z along the nominal tool axis
    into the part, y = z x x across the path. Together they are one rotation: by hypot(lead, lean)
    about the axis lean x + lead y. A positive lead, which turns about y, points the beam ahead;
    a positive lean, which turns about x, points it away from y.

    Raises
    ------
    InputError
        A value out of these ranges.
    """

    cone: float = setting(
        MISSING,
        "largest angle between tool axis and nominal axis, to any side, less than a right angle",
        unit="deg",
        above=0,
        below=90,
        example="3",
        key="tilt_deg",
        in_jobs=None,
        group="Tolerance of the tool axis",
        label="Tilt, at most",
        concerns="graph",
    )
    steps: int = setting(
        1,
        "steps of lead and of lean from the nominal axis to the rim of the cone; 0: no tilt",
        least=1,
        most=10,
        example="2",
        key="tilt_steps",
        group="Tolerance of the tool axis",
        label="Steps of the tilt",
        concerns="graph",
    )
    cost: float = setting(
        0.0,
        "cost of each node per angle of tilt, on top of the distances of (14) or (15)",
        unit="1/deg",
        least=0,
        example="0.01",
        key="tilt_cost_per_deg",
        group="Tolerance of the tool axis",
        label="Cost of the tilt",
    )

    def __post_init__(self) -> None:
        for name, unit in (("cone", "rad"), ("cost", "1/rad")):
            value = not_negative(getattr(self, name), f"tilt {name}", unit=unit)
            object.__setattr__(self, name, value)
        if self.cone >= np.pi / 2:
            raise in_radians(self.cone, "tilt cone", "less than pi/2 rad")
        if not (isinstance(self.steps, int | np.integer) and self.steps >= 0):
            raise InputError(f"tilt steps: expected a whole number >= 0, got {self.steps!r}")
        object.__setattr__(self, "steps", int(self.steps))

    def samples(self) -> Array:
        """Return lead and lean of every sample (T, 2) rad, the nominal axis first."""
        if self.cone == 0 or self.steps == 0:
            return freeze(np.zeros((1, 2)))
        steps = np.arange(-self.steps, self.steps + 1)
        grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
        square = (grid**2).sum(axis=1)
        inside = np.argsort(square, kind="stable")[: (square <= self.steps**2).sum()]
        return freeze(np.asarray(grid[inside] * (self.cone / self.steps), dtype=float))

    def price(self, samples: Array) -> Array:
        """Return the cost (T,) of nodes with lead and lean (T, 2) rad."""
        return self.cost * np.hypot(samples[:, 0], samples[:, 1])


def tilt_frames(frames: Array, along: Array, tilt: Array) -> Array:
    """Return task frames tilted by lead and lean; their z is the tilted tool axis.

    Parameters
    ----------
    frames : (..., 4, 4)
    along : (..., 3)
        Directions of travel, see `Contour.along`.
    tilt : (..., 2) rad
        Lead and lean.
    """
    across = np.cross(frames[..., :3, 2], along)
    turn = tilt[..., 1:] * along + tilt[..., :1] * across
    rotation = Rotation.from_rotvec(turn.reshape(-1, 3)).as_matrix().reshape(*turn.shape[:-1], 3, 3)
    T = np.broadcast_to(frames, (*turn.shape[:-1], 4, 4)).copy()
    T[..., :3, :3] = rotation @ T[..., :3, :3]
    return T
