"""The arm of a robot: kinematics of many joint vectors or poses at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import Array, Bools, Ints, as_pose, floats, freeze, short_repr
from kerfpath.errors import InputError
from kerfpath.kernels import turns
from kerfpath.kernels.enclosure import Curves
from kerfpath.robots.enclosure import Enclosure, ball_frames, require_cells
from kerfpath.robots.families import FAMILIES, Family
from kerfpath.robots.limits import for_each
from kerfpath.urdf import KinematicChain
from kerfpath.urdf import turns as rotations

# -----------------------------------------------------------------------------
# Solutions of the inverse kinematics: postures and turns of many poses in one table.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solutions:
    """Inverse kinematics of B poses: one row per solution.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors.
    pose : (N,) int
        Index of the pose that each row solves, in increasing order.
    posture : (N,) int
        Posture mu of each row; see `Family.postures`.
    turn : (N, n) int
        Number of turns of 2 pi that each joint is away from (-pi, pi].
    """

    q: Array
    pose: Ints
    posture: Ints
    turn: Ints

    __repr__ = short_repr

    def __len__(self) -> int:
        return len(self.q)


def all_solutions(q: Array, reach: Bools) -> Solutions:
    """Return the rows of q (B, P, n) that `reach` (B, P) marks as solutions, limits ignored."""
    pose, posture = np.nonzero(reach)
    found = q[reach]
    turn = np.zeros(found.shape, dtype=np.int64)
    return Solutions(q=freeze(found), pose=freeze(pose), posture=freeze(posture), turn=freeze(turn))


def solutions_within(q: Array, reach: Bools, limits: turns.JointLimits) -> Solutions:
    """Return all turns within the limits of the rows of q (B, P, n) that `reach` (B, P) marks."""
    B, P, n = q.shape
    q, reach = q[:, None], reach[:, None]  # one node a pose, one sample of gamma
    count, reason = np.empty(B, np.int64), np.empty(reach.shape, np.uint8)
    turns.count_admissible(q, reach, freeze(np.ones(P, np.bool_)), limits, count, reason)
    total = int(count.sum())
    found, small = np.empty((total, n)), np.empty((total, n), np.int8)
    sample, posture = np.empty(total, np.int32), np.empty(total, np.int8)
    turns.fill_admissible(q, reason, limits, found, sample, posture, small)
    # One joint alone may have more turns than the small integers of a graph can count.
    pose = np.repeat(np.arange(B), count)
    turn = np.rint((found - q[pose, 0, posture]) / (2 * np.pi))
    return Solutions(
        q=freeze(found),
        pose=freeze(pose),
        posture=freeze(posture.astype(np.int64)),
        turn=freeze(turn.astype(np.int64)),
    )


# -----------------------------------------------------------------------------
# The arm: its geometry, its joint convention and its kinematics.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arm:
    """The arm of a robot and its kinematics, without limits and external axes.

    Parameters
    ----------
    kinematics : {"opw", "ur", "five", "srs", "offset_shoulder", "offset_wrist", "general"}
        The family, see `kerfpath.robots.FAMILIES`.
    geometry : mapping
        Lengths, m. "opw" and "five": a1, a2, b, c1, c2, c3, c4 (Brandstoetter, Angerer and Hofbaur
        2014; for a five-axis arm c4 runs along the forearm to the head's flange at q5 = 0). "ur":
        d1, a2, a3, d4, d5, d6 (Denavit-Hartenberg, as Universal Robots publishes them). "srs": c1,
        c2, c3, c4 from foot to shoulder, elbow, wrist and flange. The others: none, see `chain`.
    sign : (n,)
        +1 or -1: q_model = sign * q - offset.
    offset : (n,) rad
    T_base_foot, T_end_flange : (4, 4) m
        Pose of the model in the robot base, and of the flange in the model's own end frame.
    chain : KinematicChain, optional
        The joint frames of the robot's description; the audit uses them as its kinematics.

    Raises
    ------
    InputError
        A length is missing, a sign is neither 1 nor -1, or the family is unknown.
    """

    kinematics: str = "opw"
    geometry: dict[str, float]
    sign: Array = field(default_factory=lambda: np.ones(()))
    offset: Array = field(default_factory=lambda: np.zeros(()))
    T_base_foot: Array = field(default_factory=lambda: np.eye(4))
    T_end_flange: Array = field(default_factory=lambda: np.eye(4))
    chain: KinematicChain | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        _set = object.__setattr__
        if self.kinematics not in FAMILIES:
            raise InputError(
                f"kinematics: expected one of {', '.join(FAMILIES)}, got {self.kinematics!r}"
            )
        missing = [k for k in self.family.lengths if k not in self.geometry]
        if missing:
            raise InputError(f"geometry lacks {', '.join(missing)} (m)")
        n = self.joints
        for name in ("sign", "offset"):
            _set(self, name, floats(for_each(getattr(self, name), n), name, (n,)))
        if not (np.abs(self.sign) == 1).all():
            raise InputError(f"sign must be +1 or -1, got {self.sign.tolist()}")
        for name in ("T_base_foot", "T_end_flange"):
            _set(self, name, as_pose(getattr(self, name), name))

    @property
    def family(self) -> Family:
        """The kinematic family."""
        return FAMILIES[self.kinematics]

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return self.family.joints

    @property
    def postures(self) -> int:
        """Number of postures P: mu runs from 0 to P - 1."""
        return len(self.family.postures)

    def moved(self, T: Array) -> Arm:
        """Return the arm with everything, chain included, moved by T (4, 4) m in the base."""
        chain = self.chain
        if chain is not None:
            origins = np.concatenate([T @ chain.origins[:1], chain.origins[1:]])
            chain = replace(chain, origins=origins)
        # A family without lengths uses the chain as its model, which has been moved already.
        foot = T @ self.T_base_foot if self.family.lengths else self.T_base_foot
        return replace(self, T_base_foot=foot, chain=chain)

    def joint_chain(self) -> KinematicChain:
        """Return the joint chain of the description, or of the model if there is none.

        Raises
        ------
        InputError
            As `model_chain`.
        """
        return self.model_chain() if self.chain is None else self.chain

    def model_chain(self) -> KinematicChain:
        """Return the joint chain of the family's model, ignoring the robot's description.

        Raises
        ------
        InputError
            The family has no model with joint frames.
        """
        if self.kinematics not in _MODELS:
            raise InputError(
                f"the joint frames of its family ({self.family.words}) are known only from a robot "
                "description (URDF); read it with Robot.from_urdf"
            )
        model = _MODELS[self.kinematics](self.geometry)
        # q_model = sign q - offset: a frame at angle zero is turned back by the offset.
        back = [rotations(axis, -self.offset[i : i + 1])[0] for i, axis in enumerate(model.axes)]
        origins = model.origins @ np.array(back)
        origins[0] = self.T_base_foot @ origins[0]
        return KinematicChain(
            origins=origins,
            axes=self.sign[:, None] * model.axes,
            end=model.end @ self.T_end_flange,
        )

    def forward(self, q: ArrayLike) -> Array:
        """Return the flange poses (..., 4, 4) m in the robot base at joint vectors q (..., n) rad.

        Raises
        ------
        InputError
            q has a wrong shape, or is not finite.
        """
        q = np.asarray(q, dtype=float)
        rows = floats(q.reshape(-1, q.shape[-1]) if q.ndim else q, "q", (None, self.joints))
        T = np.empty((len(rows), 4, 4))
        self.family.forward_all(self.model(), np.array(rows, order="C"), T)
        if self._placed:
            T = self.T_base_foot @ T @ self.T_end_flange
        return freeze(T.reshape(*q.shape[:-1], 4, 4))

    def inverse_all(self, T: Array, given: Array | None = None) -> tuple[Array, Bools]:
        """Return the solutions of every posture for flange poses T (B, 4, 4) m, limits ignored.

        Returns q (B, P, n) in (-pi, pi] and reach (B, P), which says which rows are solutions. A
        family without free rotation matches only the flange's origin and z-axis; one with a `given`
        joint needs its angles (B,) rad.

        Raises
        ------
        InputError
            `given` is missing or not allowed.
        """
        self._require_given(given)
        if not self.family.free_rotation:
            q, reach = self.inverse_nodes(T, np.zeros(1), np.eye(4))
            return q[:, 0], reach[:, 0]
        q = np.empty((len(T), self.postures, self.joints))
        reach = np.empty(q.shape[:2], dtype=np.bool_)
        more = () if given is None else (given,)
        self.family.inverse_all(self.model(), self._model_poses(T), *more, q, reach)
        return q, reach

    def follow(self, T: Array, q: Array, posture: Ints) -> Array:
        """Return the joints (B, n) that bring the flange to T (B, 4, 4) on the branch of each q.

        Each joint is on the turn nearest to q (B, n), whose postures (B,) are given; rows are NaN
        where the branch does not reach the pose. A `given` joint keeps its value.
        """
        if self.family.follow_all is not None:
            found = np.array(q)
            self.family.follow_all(self.model(), self._model_poses(T), found)
            return found
        if self.family.inverse_one is not None:
            found = np.empty(q.shape)
            one = np.array(posture, dtype=np.int64)
            self.family.inverse_one(self.model(), self._model_poses(T), one, found)
        else:
            solved, reach = self.inverse_all(T, self.given_of(q))
            b = np.arange(len(q))
            found = np.where(reach[b, posture, None], solved[b, posture], np.nan)
        return np.asarray(found + 2 * np.pi * np.round((q - found) / (2 * np.pi)))

    def nearest(self, T: Array, q: Array) -> Array:
        """Return the joints (B, n) rad nearest to q (B, n) that bring the flange to T (B, 4, 4).

        They may be of any posture, with each joint on the turn nearest to q; rows are NaN where
        there is no solution.
        """
        if self.family.follow_all is not None:
            return self.follow(T, q, np.zeros(len(T), dtype=np.int64))
        solved, reach = self.inverse_all(T, self.given_of(q))
        turned = solved + 2 * np.pi * np.round((q[:, None] - solved) / (2 * np.pi))
        apart = np.where(reach, np.abs(turned - q[:, None]).max(axis=2), np.inf)
        b, best = np.arange(len(q)), np.argmin(apart, axis=1)
        return np.where(reach[b, best, None], turned[b, best], np.nan)

    def inverse_nodes(
        self, H: Array, gamma: Array, T_flange_tip: Array, given: Array | None = None
    ) -> tuple[Array, Bools]:
        """Return the solutions of every posture for task frames H (K, 4, 4) m at each gamma (m,).

        Returns q (K, m, P, n) in (-pi, pi] and reach (K, m, P). Frames are in the robot base, gamma
        is in rad, and limits are ignored. A family with a `given` joint needs its angles (K,) rad.

        Raises
        ------
        InputError
            `given` is missing or not allowed.
        """
        T_tip_flange = np.linalg.inv(T_flange_tip)
        if self.family.inverse_nodes is None:
            spin = np.tile(np.eye(4), (len(gamma), 1, 1))
            spin[:, 0, 0] = spin[:, 1, 1] = np.cos(gamma)
            spin[:, 1, 0], spin[:, 0, 1] = np.sin(gamma), -np.sin(gamma)
            each = None if given is None else np.repeat(given, len(gamma))
            T = (H[:, None] @ (spin @ T_tip_flange)).reshape(-1, 4, 4)
            q, reach = self.inverse_all(T, each)
            size = (len(H), len(gamma), self.postures)
            return q.reshape(*size, self.joints), reach.reshape(size)
        if self._placed:
            H = np.linalg.inv(self.T_base_foot) @ H
            T_tip_flange = T_tip_flange @ np.linalg.inv(self.T_end_flange)
        q = np.empty((len(H), len(gamma), self.postures, self.joints))
        reach = np.empty(q.shape[:3], np.bool_)
        self.family.inverse_nodes(self.model(), H, gamma, T_tip_flange, q, reach)
        return q, reach

    @property
    def flip(self) -> tuple[int, float] | None:
        """The joint (from 0) that a wrist flip mirrors, and the angle (rad) about which it does.

        The posture changes from 2 i to 2 i + 1 or back, and every other joint changes by a
        constant, so a motion and its flipped copy have increments of the same size. None where the
        wrist is not spherical.
        """
        joint = self.family.flips
        if joint is None:
            return None
        return joint, float(self.sign[joint] * self.offset[joint])

    def enclose(
        self, frames: Array, node: Ints, gamma: Array, half: Array, T_flange_tip: Array
    ) -> Enclosure:
        """Return proven bounds on the joints of every posture over cells of gamma.

        Parameters
        ----------
        frames : (K, 4, 4) m
            Task frames in the robot base.
        node : (C,) int
            Index of the frame of each cell.
        gamma, half : (C,) rad
            Middle and half-width of each cell; half-widths are at most 1.
        T_flange_tip : (4, 4) m
            The tool.

        Raises
        ------
        InputError
            The family has no proven bounds; an index of a frame is out of range, or a half-width is
            not a number from 0 to 1.
        """
        if self.family.enclose_all is None:
            raise InputError(f"enclose: its family ({self.family.words}) has no proven bounds")
        require_cells(len(frames), node, gamma, half)
        if len(node) < len(frames):
            frames, node = frames[node], np.arange(len(node))
        foot, end = self.T_base_foot, self.T_end_flange
        wrist = float(self.geometry[self.family.wrist])
        size = (len(node), self.postures)
        curves = Curves(np.zeros(size, np.uint8), *np.zeros((5, *size, self.joints)))
        balls = ball_frames(frames, T_flange_tip, foot, end, wrist)
        self.family.enclose_all(self.model(), balls, node, np.array(gamma), half, curves)
        return Enclosure(**{k: freeze(a) for k, a in curves._asdict().items()})

    def model(self) -> Any:
        """Return the geometry in the form of the family's kernels."""
        lengths = {k: float(self.geometry[k]) for k in self.family.lengths}
        if not lengths:
            return self.family.model(chain=self.chain, sign=self.sign, offset=self.offset)
        return self.family.model(**lengths, sign=self.sign, offset=self.offset)

    def _model_poses(self, T: Array) -> Array:
        """Return flange poses (B, 4, 4) as poses of the model's end in the model's base."""
        if self._placed:
            T = np.linalg.inv(self.T_base_foot) @ T @ np.linalg.inv(self.T_end_flange)
        return np.array(T, order="C")

    def given_of(self, q: Array) -> Array | None:
        """Return the `given` angles (B,) rad in q (B, n); None where no joint is `given`."""
        i = self.family.given
        return None if i is None else np.ascontiguousarray(q[:, i])

    @property
    def _placed(self) -> bool:
        """Whether base or flange differ from the model's own."""
        return not all(np.array_equal(T, np.eye(4)) for T in (self.T_base_foot, self.T_end_flange))

    def _require_given(self, given: Array | None) -> None:
        """Raise InputError unless an angle is given where the family takes one, and only there."""
        i = self.family.given
        if i is not None and given is None:
            raise InputError(
                f"inverse: a pose has infinitely many solutions ({self.family.words}); give the "
                f"value of joint {i + 1} (rad), as in robot.inverse(T, given=0.0)"
            )
        if i is None and given is not None:
            raise InputError(
                f"inverse: given=: poses leave no joint free ({self.family.words}); remove it"
            )


# -----------------------------------------------------------------------------
# The joint chains of the models of the families.

X, Y, Z = np.eye(3)


def _opw(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm (Brandstoetter, Angerer and Hofbaur 2014, figure 1).

    The shoulder is at (a1, b, c1), the elbow c2 above it, the wrist centre at (a2, 0, c3) from the
    elbow, and the flange c4 further along.
    """
    origins, end = np.tile(np.eye(4), (6, 1, 1)), np.eye(4)
    origins[1, :3, 3] = g["a1"], g["b"], g["c1"]
    origins[2, 2, 3] = g["c2"]
    origins[3, :3, 3] = g["a2"], 0.0, g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Y, Z, Y, Z]), end=end)


def _five(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an OPW arm without axis 6."""
    whole = _opw(g)
    return replace(whole, origins=whole.origins[:5], axes=whole.axes[:5])


def _ur(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of a UR arm in DH frames, alpha = 90, 0, 0, 90, -90, 0 deg."""
    d = (g["d1"], 0.0, 0.0, g["d4"], g["d5"], g["d6"])
    a = (0.0, g["a2"], g["a3"], 0.0, 0.0, 0.0)
    after = rotations(X, np.radians([90.0, 0.0, 0.0, 90.0, -90.0, 0.0]))
    after[:, 0, 3], after[:, 2, 3] = a, d
    return KinematicChain(
        origins=np.array([np.eye(4), *after[:5]]), axes=np.tile(Z, (6, 1)), end=after[5]
    )


def _srs(g: Mapping[str, float]) -> KinematicChain:
    """Return the chain of an S-R-S arm, upright at zero, with axes z, y, z, y, z, y, z."""
    origins, end = np.tile(np.eye(4), (7, 1, 1)), np.eye(4)
    origins[[1, 3, 5], 2, 3] = g["c1"], g["c2"], g["c3"]
    end[2, 3] = g["c4"]
    return KinematicChain(origins=origins, axes=np.array([Z, Y, Z, Y, Z, Y, Z]), end=end)


_MODELS = {"opw": _opw, "ur": _ur, "five": _five, "srs": _srs}
