"""The power of the beam by the speed of the tip: a curve, and the steps in which outputs follow it.

An output is set at targets alone. It keeps a step until the curve has left it by more than half a
step and a margin, so that a speed between two steps does not switch it to and fro.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from kerfpath.arrays import Array, short_repr
from kerfpath.errors import InputError

PowerCurve = tuple[tuple[float, float], ...]
"""Pairs of a share of the programmed speed and a share of the full power, by rising speed."""
PierceStages = tuple[tuple[float, float], ...]
"""Pairs of a share of the full power and a time, s: the stages of a pierce in their order."""
MOST_STAGES, LONGEST_STAGE = 20, 60.0
"""Most stages of a pierce, and the longest one, s."""
PowerFollows = Literal["steps", "controller"]
"""Whether the program sets the power in steps, or the controller by the speed that it measures."""
SAME_POWER = 2e-3
"""Tolerance of shares of the full power, for the digits of analogue outputs."""
MARGIN = 0.25
"""Share of a step by which the curve passes the border to the next before the power follows."""


def power_curve(pairs: Sequence[Sequence[float]]) -> PowerCurve:
    """Return a curve as given by pairs.

    Raises
    ------
    InputError
        There are fewer than two pairs, or the speeds do not rise from 0 to 1, or a power is not a
        share from 0 to 1.
    """
    expected = "power_by_speed: expected pairs [share of the speed, share of the power]"
    try:
        found = tuple((float(speed), float(power)) for speed, power in pairs)
    except (TypeError, ValueError):
        raise InputError(f"{expected}, got {pairs!r}") from None
    speeds = [speed for speed, _ in found]
    if len(found) < 2 or speeds[0] != 0 or speeds[-1] != 1:
        raise InputError(f"{expected} from speed 0 to speed 1, got speeds {speeds}")
    if not all(one < two for one, two in pairwise(speeds)):
        raise InputError(f"{expected} with rising speeds, got {speeds}")
    if wrong := [power for _, power in found if not 0 <= power <= 1]:
        raise InputError(f"{expected} with powers from 0 to 1, got {wrong[0]:g}")
    if found[-1][1] == 0:
        raise InputError(f"{expected} with a power above 0 at speed 1, got 0")
    return found


def pierce_stages(pairs: Sequence[Sequence[float]]) -> PierceStages:
    """Return the stages of a pierce as given by pairs.

    Raises
    ------
    InputError
        There are none or too many, a power is not a share above 0, or a time is not above 0.
    """
    expected = "pierce_stages: expected pairs [share of the full power, time in s]"
    try:
        found = tuple((float(share), float(time)) for share, time in pairs)
    except (TypeError, ValueError):
        raise InputError(f"{expected}, got {pairs!r}") from None
    if not 1 <= len(found) <= MOST_STAGES:
        raise InputError(f"{expected}, 1 to {MOST_STAGES} of them, got {len(found)}")
    for share, time in found:
        if not 0 < share <= 1:
            raise InputError(f"{expected} with powers above 0, at most 1, got {share:g}")
        if not 0 < time <= LONGEST_STAGE:
            raise InputError(f"{expected}, above 0 and at most {LONGEST_STAGE:g} s, got {time:g} s")
    return found


@dataclass(frozen=True, slots=True)
class PowerBySpeed:
    """How the power follows the speed.

    Parameters
    ----------
    curve : tuple of (float, float)
        As `power_curve` returns it.
    step : float
        Step of the power, a share of the full power; one of the steps is the power at full speed.
    pierce : float or None
        Share of the full power while the beam pierces; None: that of the full speed.
    follows : {"steps", "controller"}
        A controller sets the power in proportion to the speed.
    """

    curve: PowerCurve
    step: float
    pierce: float | None = None
    follows: PowerFollows = "steps"

    __repr__ = short_repr

    @property
    def full(self) -> float:
        """Share of the full power at full speed."""
        return self.curve[-1][1]

    @property
    def piercing(self) -> float:
        """Share of the full power while the beam pierces."""
        return self.full if self.pierce is None else self.pierce

    @property
    def tolerance(self) -> float:
        """Largest difference of a step from the curve, a share of the full power."""
        return (0.5 + MARGIN) * self.step

    @property
    def proportional(self) -> float:
        """The share at full speed of the power in proportion to the speed nearest to the curve."""
        pairs = [(v, p) for v, p in self.curve if v > 0]
        slopes = (min((p + r) / (v + w), 1.0) for v, p in pairs for w, r in pairs)
        return min(slopes, key=lambda slope: (self._off(slope), slope))

    def _off(self, slope: float) -> float:
        """Return the largest difference of a power in proportion to the speed from the curve."""
        return max(abs(slope * v - p) for v, p in self.curve)

    def refusal(self) -> str:
        """Return why no controller can follow the curve; empty if one can."""
        off = self._off(self.proportional)
        if self.follows == "steps" or off <= self.tolerance:
            return ""
        return (
            "power_by_speed: a controller sets the power in proportion to the speed, which is "
            f"{off:.1%} of the full power off the curve, allowed {self.tolerance:.1%}; write a "
            'straight line from [0, 0], or power_follows = "steps"'
        )

    def at(self, speed: Array) -> Array:
        """Return the shares of the full power at shares (m,) of the programmed speed."""
        return np.asarray(np.interp(speed, *np.array(self.curve).T))

    def nearest(self, power: Array) -> Array:
        """Return the steps next to shares (m,) of the full power."""
        return np.asarray(
            np.clip(self.full + self.step * np.round((power - self.full) / self.step), 0.0, 1.0)
        )

    def steps(self, speed: Array) -> Array:
        """Return the step of the power in each of m moves with shares (m,) of the speed."""
        asked = self.at(speed)
        found = self.nearest(asked)
        for k in range(1, len(found)):
            if abs(asked[k] - found[k - 1]) <= self.tolerance:
                found[k] = found[k - 1]
        return found
