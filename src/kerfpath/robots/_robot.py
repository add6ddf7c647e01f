"""A six-axis robot: geometry, joint convention, limits, and closed-form kinematics in bulk."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import Array, Bools, Ints, bools, floats, freeze, positive
from kerfpath.errors import InputError
from kerfpath.kernels import kinematics, turns

__all__ = ["Coupling", "Robot", "Solutions", "posture_name", "postures_named"]

JOINTS = 6
LENGTHS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coupling:
    """A linear bound on several joints at once: lower <= row @ q <= upper.

    Parameters
    ----------
    row : (6,)
        Coefficients of the joints.
    lower, upper : float rad
        Bounds of the combination.
    note : str
        Where the bound comes from.
    """

    row: Array
    lower: float
    upper: float
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "row", floats(self.row, "coupling row", (JOINTS,)))
        if not self.lower < self.upper:
            raise InputError(
                f"coupling {self.row.tolist()}: the lower bound {np.degrees(self.lower):g} deg "
                f"must be below the upper bound {np.degrees(self.upper):g} deg"
            )

    @property
    def name(self) -> str:
        """Say the combination in words, such as "joint 2 + joint 3"."""
        words = ""
        for i, c in enumerate(self.row):
            if c:
                sign = " - " if c < 0 else " + " if words else ""
                size = "" if abs(c) == 1 else f"{abs(c):g} "
                words += f"{sign}{size}joint {i + 1}"
        return words.strip()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """Inverse kinematics of B poses: one row per solution.

    Parameters
    ----------
    q : (N, 6) rad
        Joint vectors.
    pose : (N,) int
        Which of the B poses each row solves, increasing.
    posture : (N,) int
        Posture mu of each row, 0 to 7; see `posture_name`.
    turn : (N, 6) int
        How many turns of 2 pi each joint is away from (-pi, pi].
    """

    q: Array
    pose: Ints
    posture: Ints
    turn: Ints

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Robot:
    """An ortho-parallel arm with a spherical wrist (OPW), its limits and where they come from.

    Joint vectors follow the robot's own description (its URDF where `frames` says so); poses are
    of the flange in the robot base, z along axis 6 and out of the flange.

    Parameters
    ----------
    id, manufacturer, model : str
    geometry : mapping
        Lengths a1, a2, b, c1, c2, c3, c4, m (Brandstoetter, Angerer and Hofbaur 2014).
    sign : (6,)
        +1 or -1, and
    offset : (6,) rad
        with q_model = sign * q - offset.
    lower, upper : (6,) rad or None
        Joint limits; None when they are not known, and then nothing is planned.
    velocity : (6,) rad/s or None
        Largest joint speeds.
    acceleration : (6,) rad/s^2 or None
        Largest joint accelerations; most makers publish none.
    endless : (6,) bool
        Joints that turn without end; their limits do not apply.
    couplings : tuple of Coupling
        Bounds on combinations of joints.

    Raises
    ------
    InputError
        Limits reversed, a speed that is not positive, a length missing.
    """

    id: str
    geometry: dict[str, float]
    sign: Array = field(default_factory=lambda: np.ones(JOINTS))
    offset: Array = field(default_factory=lambda: np.zeros(JOINTS))
    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    endless: Bools = field(default_factory=lambda: np.zeros(JOINTS, bool))
    couplings: tuple[Coupling, ...] = ()
    manufacturer: str = ""
    model: str = ""
    payload: float | None = None
    reach: float | None = None
    acceleration_source: str = ""
    acceleration_ratio: str = ""
    limits_missing: str = ""
    notes: tuple[str, ...] = ()
    frames: dict[str, object] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        _set = object.__setattr__
        missing = [k for k in LENGTHS if k not in self.geometry]
        if missing:
            raise InputError(f"robot {self.id!r}: geometry lacks {', '.join(missing)} (m)")
        _set(self, "sign", floats(self.sign, "sign", (JOINTS,)))
        if not (np.abs(self.sign) == 1).all():
            raise InputError(f"robot {self.id!r}: sign must be +1 or -1, got {self.sign.tolist()}")
        _set(self, "offset", floats(self.offset, "offset", (JOINTS,)))
        _set(self, "endless", bools(self.endless, "endless", (JOINTS,)))
        for name in ("lower", "upper"):
            if getattr(self, name) is not None:
                _set(self, name, floats(getattr(self, name), name, (JOINTS,)))
        for name in ("velocity", "acceleration"):
            if getattr(self, name) is not None:
                _set(self, name, positive(getattr(self, name), name, (JOINTS,)))
        if self.lower is not None and self.upper is not None:
            reversed_ = np.flatnonzero(~(self.lower < self.upper))
            if reversed_.size:
                i = int(reversed_[0])
                raise InputError(
                    f"robot {self.id!r}: limits of joint {i + 1} are reversed, lower "
                    f"{np.degrees(self.lower[i]):g} deg is not below upper "
                    f"{np.degrees(self.upper[i]):g} deg"
                )

    def with_limits(
        self,
        *,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        endless: ArrayLike | None = None,
    ) -> Robot:
        """Return this robot with some of its limits replaced (rad, rad/s, rad/s^2)."""
        given = {
            "lower": lower,
            "upper": upper,
            "velocity": velocity,
            "acceleration": acceleration,
            "endless": endless,
        }
        changes = {name: value for name, value in given.items() if value is not None}
        if acceleration is not None:
            changes["acceleration_source"] = "given by the user"
        return replace(self, **changes)  # type: ignore[arg-type]  # cast by __post_init__

    def forward(self, q: ArrayLike) -> Array:
        """Return the flange poses (..., 4, 4) in the robot base of joint vectors q (..., 6) rad."""
        q = np.asarray(q, dtype=float)
        rows = floats(q.reshape(-1, q.shape[-1]) if q.ndim else q, "q", (None, JOINTS))
        T = np.empty((len(rows), 4, 4))
        kinematics.forward_all(self.arm(), rows, T)
        return freeze(T.reshape(*q.shape[:-1], 4, 4))

    def inverse(self, T: ArrayLike, *, within_limits: bool = True) -> Solutions:
        """Return every joint vector that brings the flange to T (4, 4) or (B, 4, 4), base frame.

        Parameters
        ----------
        T : (4, 4) or (B, 4, 4)
            Flange poses, m.
        within_limits : bool
            True: all postures, all turns inside the joint limits. False: all postures, joints in
            (-pi, pi], limits ignored.

        Raises
        ------
        InputError
            A wrong shape, or limits that are not known.
        """
        poses = np.asarray(T, dtype=float)
        poses = floats(poses[None] if poses.ndim == 2 else poses, "T", (None, 4, 4))
        q = np.empty((len(poses), kinematics.POSTURES, JOINTS))
        reach = np.empty(q.shape[:2], dtype=np.bool_)
        kinematics.inverse_all(self.arm(), poses, q, reach)
        q, reach = q[:, None], reach[:, None]  # one node a pose, one sample of gamma
        if not within_limits:
            pose, _, posture = np.nonzero(reach)
            found = q[reach]
            turn = np.zeros(found.shape, dtype=np.int64)
            return Solutions(
                q=freeze(found), pose=freeze(pose), posture=freeze(posture), turn=freeze(turn)
            )
        limits = self.joint_limits()
        count, reason = np.empty(len(poses), np.int64), np.empty(reach.shape, np.uint8)
        every = np.ones(kinematics.POSTURES, np.bool_)
        turns.count_admissible(q, reach, every, limits, count, reason)
        total = int(count.sum())
        found, turn = np.empty((total, JOINTS)), np.empty((total, JOINTS), np.int64)
        sample, posture = np.empty(total, np.int64), np.empty(total, np.int64)
        turns.fill_admissible(q, reason, limits, found, sample, posture, turn)
        return Solutions(
            q=freeze(found),
            pose=freeze(np.repeat(np.arange(len(poses)), count)),
            posture=freeze(posture),
            turn=freeze(turn),
        )

    def arm(self) -> kinematics.Arm:
        """Return the geometry as the kernels take it."""
        lengths = {k: float(self.geometry[k]) for k in LENGTHS}
        return kinematics.Arm(**lengths, sign=self.sign, offset=self.offset)

    def joint_limits(self) -> turns.JointLimits:
        """Return the position limits as the kernels take them.

        Raises
        ------
        InputError
            The limits are not known.
        """
        if self.lower is None or self.upper is None:
            raise self._lacks("joint limits", "lower= and upper=")
        rows = [c.row for c in self.couplings]
        return turns.JointLimits(
            lower=self.lower,
            upper=self.upper,
            endless=self.endless,
            rows=np.array(rows).reshape(-1, JOINTS),
            row_lower=np.array([c.lower for c in self.couplings]),
            row_upper=np.array([c.upper for c in self.couplings]),
        )

    def speed_limits(self) -> tuple[Array, Array]:
        """Return joint velocity (6,) rad/s and acceleration (6,) rad/s^2.

        Raises
        ------
        InputError
            One of them is not known; says how to give it.
        """
        if self.velocity is None:
            raise self._lacks("joint velocities", "velocity=")
        if self.acceleration is None:
            ratio = self.acceleration_ratio
            hint = f", or robot({self.id!r}, acceleration_ratio={ratio!r})" if ratio else ""
            raise self._lacks("joint accelerations", "acceleration=", hint)
        return self.velocity, self.acceleration

    def reasons(self) -> tuple[str, ...]:
        """Say what each reason code of a dropped pose means, by code."""
        words = ["admitted", "unreachable"]
        for name in [f"joint {i + 1}" for i in range(JOINTS)] + [c.name for c in self.couplings]:
            words += [f"{name} low", f"{name} high"]
        return (*words, "posture not wanted")

    def _lacks(self, what: str, keys: str, hint: str = "") -> InputError:
        why = f" ({self.limits_missing})" if self.limits_missing else ""
        return InputError(
            f"robot {self.id!r}: {what} are not known{why}; "
            f"give them with robot.with_limits({keys}...){hint}"
        )


def posture_name(posture: int) -> str:
    """Say a posture in words: shoulder, elbow, wrist, as in "front/up/plus"."""
    return "/".join(
        (
            ("front", "rear")[posture // 4],
            ("up", "down")[posture // 2 % 2],
            ("plus", "minus")[posture % 2],
        )
    )


def postures_named(words: str) -> tuple[int, ...]:
    """Return the postures that fit some words: "front/up" fits 0 and 1, "rear" fits 4 to 7.

    Raises
    ------
    InputError
        A word that names no shoulder, elbow or wrist, or two that exclude each other.
    """
    wanted = [word for word in words.split("/") if word]
    fitting = [
        mu
        for mu in range(kinematics.POSTURES)
        if all(word in posture_name(mu).split("/") for word in wanted)
    ]
    if not fitting:
        raise InputError(
            f"posture {words!r}: expected words of front|rear / up|down / plus|minus, "
            'such as "front/up"'
        )
    return tuple(fitting)
