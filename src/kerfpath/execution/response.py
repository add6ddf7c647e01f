"""How the joints of an arm answer what its controller commands: they lag, give way and stick.

A controller interpolates the joints that the program asks for; the arm executes others. Compared
with runs of a robot and of its simulation, most of the difference is that of a low-pass of each
joint in time. A symmetric one moves the path and not the clock, so delays that all joints share,
which leave the path as it is, are left out. What more is known of an arm are deflections by inertia
and the lag by friction after a joint reverses.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from kerfpath.arrays import Array, counted, floats, freeze, short_repr
from kerfpath.comfort import jacobian
from kerfpath.errors import InputError, about
from kerfpath.plans import PLACING, STILL
from kerfpath.robots import Robot, responses_of
from kerfpath.setting import check, documented, setting, settings

Standing = Literal["assumed", "fitted", "measured"]
"""Where parameters come from: a guess, runs of another arm of the model, or of the user's own."""

SETTLED = 3.0
"""Time constants of recovery after which 5 % of the lag by friction is left."""
WIDTH = 4.0
"""Standard deviations after which the low-pass is cut off: beyond are 6e-5 of it."""


@documented
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """How the joints of an arm follow what is commanded.

    Raises
    ------
    InputError
        A parameter is not a number or below zero, or the range of sigma does not contain it.
    """

    sigma: Array = setting(
        lambda: np.zeros(1),
        "standard deviation in time of the low-pass of each joint; one number holds for all",
        takes=tuple[float, ...],
        unit="ms",
        least=0,
        example="[30, 29, 21, 17, 20, 26]",
    )
    sigma_range: Array | None = setting(
        None,
        "least and largest sigma for which errors are given, too",
        takes=tuple[float, ...],
        unit="ms",
        least=0,
        example="[15, 35]",
        what="2 numbers not below 0, the least and the largest",
    )
    mass: Array = setting(
        lambda: np.zeros(3),
        "deflection of joints 1 to 3 by a mass at the wrist centre: compliance times mass, "
        "multiplied by the torque that a unit mass would need",
        takes=tuple[float, ...],
        unit="ms^2/m^2",
        key="mass_ms2_m2",
        example="[117, 86, -31]",
        what="3 numbers",
    )
    inertia: Array = setting(
        lambda: np.zeros(3),
        "deflection of joints 1 to 3 by inertias that do not change: compliance times inertia",
        takes=tuple[float, ...],
        unit="ms^2",
        key="inertia_ms2",
        example="[0, 179, -13]",
        what="3 numbers",
    )
    wrist_ahead: float = setting(
        0.0,
        "time by which joints 4 to 6 are ahead of joints 1 to 3",
        unit="ms",
        example="0.3",
        what="a number",
    )
    friction: float = setting(
        0.0,
        "half the lag of a joint after it has reversed",
        unit="urad",
        least=0,
        example="129",
    )
    friction_rise: float = setting(
        50.0, "time constant with which that lag rises", unit="ms", above=0, example="50"
    )
    friction_recovery: float = setting(
        400.0, "time constant with which it goes", unit="ms", above=0, example="400"
    )
    fastest: float | None = setting(
        None,
        "tip speed up to which it was compared with runs",
        unit="mm/s",
        above=0,
        example="400",
    )
    standing: Standing = setting(
        "assumed", "where the parameters come from", example='"measured"', takes=Standing,
        what='"assumed", "fitted" or "measured"',
    )  # fmt: skip
    runs: int = setting(
        0, "number of runs that the parameters were fitted to", least=0, most=100_000, example="5"
    )
    reference: str = setting(
        "", "what runs, of which arm, or what else", takes=str, example='"runs of 3 May, cell 2"',
        what="one line of text",
    )  # fmt: skip
    name: str = field(default="")

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check(self)
        for parameter in ("sigma", "sigma_range", "mass", "inertia"):
            value = getattr(self, parameter)
            if value is not None:
                value = floats(np.atleast_1d(value), parameter, (None,))
                object.__setattr__(self, parameter, value)
        if (self.sigma < 0).any():
            raise InputError(f"sigma: expected numbers not below 0, in s, got {self.sigma.min():g}")
        for parameter in ("mass", "inertia"):
            if len(getattr(self, parameter)) != PLACING:
                raise InputError(
                    f"{parameter}: expected {PLACING} numbers, for joints 1 to 3, got "
                    f"{len(getattr(self, parameter))}"
                )
        if self.sigma_range is not None:
            low, high = (*self.sigma_range, np.nan, np.nan)[:2]
            if len(self.sigma_range) != 2 or not 0 < low <= self.sigma.max() <= high:
                raise InputError(
                    "sigma_range: expected the least and the largest sigma, with the largest of "
                    f"sigma between them, in s, got {self.sigma_range.tolist()}"
                )

    @property
    def model(self) -> Literal["ideal", "filter", "elastic"]:
        """What it models: nothing, a low-pass of each joint, or deflection and friction, too."""
        if self.mass.any() or self.inertia.any() or self.friction or self.wrist_ahead:
            return "elastic"
        return "filter" if self.sigma.any() else "ideal"

    @property
    def words(self) -> str:
        """The model and its standing in one phrase."""
        if self.model == "ideal":
            return "ideal joints, without lag"
        by = {"assumed": "assumed", "fitted": "fitted to", "measured": "measured in"}[self.standing]
        by += f" {counted(self.runs, 'run')}" if self.standing != "assumed" else ""
        what = {"filter": "lag", "elastic": "lag, deflection and friction"}[self.model]
        low, high = (f"{s * 1e3:.3g}" for s in (self.sigma.min(), self.sigma.max()))
        sigma = low if low == high else f"{low} to {high}"
        return f"{what} of the joints {by}, sigma {sigma} ms"

    def standing_around(self, q: Array, step: float) -> Array:
        """Return joints (m, n) every `step` s with those before and after, where they stand still.

        There are enough for the lag to begin before the first and to end after the last.
        """
        widest = self.sigma if self.sigma_range is None else self.sigma_range
        settled = WIDTH * float(widest.max(initial=0.0)) + abs(self.wrist_ahead)
        settled += SETTLED * self.friction_recovery if self.friction else 0.0
        pad = int(np.ceil(settled / step))
        return np.pad(q, ((pad, pad), (0, 0)), mode="edge")

    def ends(self) -> tuple[Response, ...]:
        """Return the responses at both ends of the range of sigma; none without a range."""
        if self.sigma_range is None:
            return ()
        shares = self.sigma_range / self.sigma.max()
        return tuple(replace(self, sigma=self.sigma * share) for share in shares)

    def without_friction(self) -> Response:
        """Return the same response of joints that do not stick."""
        return replace(self, friction=0.0)

    def require_for(self, robot: Robot) -> None:
        """Raise InputError unless the response fits the joints and the family of a robot."""
        if len(self.sigma) not in (1, robot.joints):
            raise InputError(
                f"response: expected sigma for the {robot.joints} joints of {robot.id!r}, or one "
                f"for all, got {len(self.sigma)}"
            )
        if self.model == "elastic" and (robot.kinematics != "opw" or robot.externals):
            raise InputError(
                "response: deflection and friction are modelled for ortho-parallel arms with a "
                f"spherical wrist and without external axes, {robot.id!r} is not one; give only "
                "sigma"
            )

    def executed(self, q: Array, step: float, robot: Robot) -> Array:
        """Return the joints (m, n) that an arm executes, of those commanded at even times.

        The arm stands still before the first and after the last sample.

        Parameters
        ----------
        q : (m, n) rad
            Commanded joints, m or rad for external axes.
        step : float s
            Time between two samples.
        robot : Robot

        Raises
        ------
        InputError
            The response does not fit the robot.
        """
        from scipy.ndimage import gaussian_filter1d  # loaded where joints lag

        self.require_for(robot)
        sigma = np.broadcast_to(self.sigma, (robot.joints,)) / step
        lagging = np.stack(
            [
                gaussian_filter1d(joint, width, mode="nearest", truncate=WIDTH) if width else joint
                for joint, width in zip(q.T, sigma, strict=True)
            ],
            axis=1,
        )
        if self.model != "elastic":
            return freeze(lagging)
        rate = np.gradient(lagging, step, axis=0)
        out = lagging.copy()
        out[:, :PLACING] += self._deflection(lagging, np.gradient(rate, step, axis=0), step, robot)
        out[:, PLACING:] += self.wrist_ahead * rate[:, PLACING:]
        if self.friction:
            out -= self.friction * self._stuck(rate, step)
        return freeze(out)

    def _deflection(self, q: Array, acceleration: Array, step: float, robot: Robot) -> Array:
        """Return the deflections (m, 3) rad by a mass at the wrist centre and by inertias."""
        T_flange_wrist = np.linalg.inv(robot.arm.T_end_flange)
        T_flange_wrist = T_flange_wrist @ _behind(float(robot.arm.geometry["c4"]))
        centre = (robot.forward(q) @ T_flange_wrist)[:, :3, 3]
        pull = np.gradient(np.gradient(centre, step, axis=0), step, axis=0)
        J = jacobian(robot, q, tool=T_flange_wrist)[:, :3, :PLACING]
        torque = np.einsum("mij,mi->mj", J, pull)
        return np.asarray(self.mass * torque + self.inertia * acceleration[:, :PLACING])

    def _stuck(self, rate: Array, step: float) -> Array:
        """Return the state of friction (m, n): 2 at a reversal, rising and then forgotten."""
        from scipy.signal import lfilter  # takes long to load, and few responses need it

        direction = np.where(np.abs(rate) > STILL, np.sign(rate), 0.0)
        last = np.maximum.accumulate(
            np.where(direction != 0, np.arange(len(rate))[:, None], 0), axis=0
        )
        direction = np.take_along_axis(direction, last, axis=0)
        rise, forget = (
            np.exp(-step / time) for time in (self.friction_rise, self.friction_recovery)
        )
        risen = lfilter([1 - rise], [1, -rise], direction, axis=0)
        half = (1 + forget) / 2
        return np.asarray(lfilter([half, -half], [1, -forget], risen, axis=0))


def _behind(length: float) -> Array:
    """Return the pose (4, 4) of a point a length, m, behind an origin on its z axis."""
    T = np.eye(4)
    T[2, 3] = -length
    return T


# -----------------------------------------------------------------------------
# Where responses come from: the library, a file, or an assumption.

IDEAL = Response(name="ideal", reference="no lag")
"""Joints that are where they are commanded to be."""
ASSUMED = Response(
    name="assumed",
    sigma=np.array([0.025]),
    sigma_range=np.array([0.015, 0.035]),
    reference="no runs of this arm are known; the joints of an ABB IRB 6640 have 17 to 30 ms",
)
"""What is taken for an arm of which no runs are known."""


def sources_of(robot_name: str | None) -> tuple[str, ...]:
    """Return the names of the responses of a robot of the library; of None those of any arm.

    Raises
    ------
    InputError
        The robot is unknown.
    """
    known = {} if robot_name is None else responses_of(robot_name)
    return (*known, ASSUMED.name, IDEAL.name)


def response(robot_name: str | None, source: str | None = None) -> Response:
    """Return how the joints of an arm follow what is commanded, as far as that is known.

    Parameters
    ----------
    robot_name : str or None
        Id of a robot of the library, as in `kerfpath.robot`; None for any other arm.
    source : str, optional
        "real" or another name of the library's (ABB IRB 6640-180/2.55: "robotstudio", too),
        "assumed" or "ideal"; default: "real" where it is known, else "assumed".

    Raises
    ------
    InputError
        The robot is unknown, or has no such response; the message names those that there are.
    """
    known = {} if robot_name is None else responses_of(robot_name)
    source = source or ("real" if "real" in known else ASSUMED.name)
    for one in (ASSUMED, IDEAL):
        if source == one.name:
            return one
    if source not in known:
        raise InputError(
            f"response: expected one of {', '.join(sources_of(robot_name))} for "
            f"{robot_name or 'this arm'}, got {source!r}"
        )
    return response_from(known[source], source)


def read_response(path: str | Path) -> Response:
    """Return the response that a file holds, as `kerfpath fit` writes it.

    Raises
    ------
    InputError
        The file cannot be read, is no TOML, or has a key or a value that no response has.
    """
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as fault:
        raise InputError(f"{path}: expected a response of an arm in TOML, got {fault}") from None
    with about(path):
        return response_from(data, path.name)


def response_from(data: Mapping[str, Any], name: str) -> Response:
    """Return the response that keys with units hold, as in a job or a file.

    Raises
    ------
    InputError
        An unknown key, or as `Response`.
    """
    known = {one.key: one for one in settings(Response).values()}
    for key in data:
        if key not in known:
            raise InputError(f"expected one of {', '.join(known)}, got the key {key!r}")
    found: dict[str, Any] = {}
    for key, value in data.items():
        one = known[key]
        found[one.name] = [one.si(x) for x in value] if isinstance(value, list) else one.si(value)
    return Response(name=name, **found)
