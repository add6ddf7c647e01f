"""Layered graph: all admissible joint vectors of every node, and a count of every loss."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kerfpath.arrays import Array, Bools, Ints, freeze, scalar
from kerfpath.effort import thread_count
from kerfpath.errors import InputError
from kerfpath.kernels.turns import JointLimits, count_admissible, fill_admissible
from kerfpath.losses import Loss, Reason
from kerfpath.robots import Robot, base_in_part, samples_of

__all__ = ["LayeredGraph", "build", "external_grid", "gamma_grid"]

_WHOLE_STEPS = 1e-9
"""Relative distance of 2 pi / step from a whole number up to which it counts as one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LayeredGraph:
    """Vertices of all layers (Eq. 11); the edges (12) are implied by neighbouring layers.

    Parameters
    ----------
    q : (N, n) rad
        Joint vectors, layer after layer; within a layer by variant, gamma, posture, turn.
    start : (K+1,) int
        Layer k is ``q[start[k]:start[k+1]]``.
    gamma : (m,) rad
        The samples of gamma, ascending.
    tilt : (V, 2) rad
        Lead and lean of each variant of a layer; zero without a tolerance of the tool axis.
    sample, posture, variant : (N,) int
        Index into `gamma`, posture mu, and variant of each vertex.
    turn : (N, n) int
        Turns of 2 pi of each joint of each vertex.
    reason : (K, V m, P) uint8
        Result for each candidate: an index into `reasons`; all gamma of a variant are consecutive.
    reasons : tuple of Reason
        Meaning of the codes; code 0 is admitted.
    external : (K, X, E) rad or m, or None
        Values of the joints that a pose leaves free, at every node; each tilt has X variants.
        None: a pose leaves no joint free.
    folded : (n,) bool, or None
        Joints that count as endless though they have a range; None: none.
    kept : object
        What its vertices have been checked for (margins, floor, windows of gamma); None: nothing.
    """

    q: Array
    start: Ints
    gamma: Array
    tilt: Array
    sample: NDArray[np.int32]
    variant: NDArray[np.int32]
    posture: NDArray[np.int8]
    turn: NDArray[np.int8]
    reason: NDArray[np.uint8]
    reasons: tuple[Reason, ...]
    external: Array | None = None
    folded: Bools | None = None
    kept: object = None

    def __repr__(self) -> str:
        return (
            f"LayeredGraph({len(self.start) - 1} layers, {len(self.q)} vertices, "
            f"{len(self.gamma)} rotations, {self.q.shape[1]} joints)"
        )

    @property
    def candidate(self) -> NDArray[np.int32]:
        """Index of each vertex along the second axis of `reason`, (N,): its variant and gamma."""
        return self.variant * np.int32(len(self.gamma)) + self.sample

    @property
    def reason_by_gamma(self) -> NDArray[np.uint8]:
        """Result for each gamma and posture, (K, m, P): admitted if any of their variants is."""
        K, _, P = self.reason.shape
        return np.asarray(self.reason.reshape(K, -1, len(self.gamma), P).min(axis=1))

    @property
    def has_poses_throughout(self) -> bool:
        """Whether every node has a pose."""
        return bool(np.diff(self.start).all())

    @property
    def postures_throughout(self) -> Ints:
        """Numbers of the postures that have a pose at every node."""
        return np.flatnonzero((self.reason == 0).any(axis=1).all(axis=0))

    def gamma_at(self, place: Ints) -> Array:
        """Return gamma (...) rad of sample numbers, which go on beyond a full turn."""
        m = len(self.gamma)
        return np.asarray(self.gamma[place % m] + 2 * np.pi * (place // m))

    def counts(self, node: int | None = None) -> dict[str, int]:
        """Count the candidates by `Reason`, at all nodes or at one."""
        codes = self.reason if node is None else self.reason[node]
        number = np.bincount(codes.ravel(), minlength=len(self.reasons))
        return {why: int(c) for why, c in zip(self.reasons, number, strict=True) if c}

    def main_loss(self, node: int) -> str:
        """Return the reason why most candidates of a node are lost; "" if none applies.

        Admitted candidates and postures that are not wanted do not count.
        """
        counts = self.counts(node)
        for loss in (Loss.ADMITTED, Loss.UNWANTED):
            counts.pop(Reason(loss), None)
        return max(counts, key=counts.__getitem__, default="")

    def without(self, unwanted: Mapping[Reason, Bools]) -> LayeredGraph:
        """Return the graph without some vertices, given as (N,) bool for each reason.

        A candidate counts as dropped if none of its turns is left; its reason is the first one that
        applies to any of them.
        """
        gone = np.any([*unwanted.values()], axis=0)
        if not gone.any():
            return self
        keep, sizes = ~gone, np.diff(self.start)
        layer = np.repeat(np.arange(len(sizes)), sizes)
        at = layer, self.candidate, self.posture
        candidate = np.ravel_multi_index(at, self.reason.shape)
        left = np.zeros(self.reason.size, np.bool_)
        left[candidate[keep]] = True
        reason, reasons = self.reason.copy(), self.reasons
        for why, here in reversed(list(unwanted.items())):
            reasons = reasons if why in reasons else (*reasons, why)
            reason.flat[candidate[here & ~left[candidate]]] = reasons.index(why)
        left_of_layer = np.bincount(layer[keep], minlength=len(sizes))
        start = np.concatenate([[0], np.cumsum(left_of_layer)])
        return replace(self._of(keep, start, slice(None)), reason=freeze(reason), reasons=reasons)

    def fold(self, joints: Bools) -> LayeredGraph:
        """Return the graph with the poses on one turn each of joints (n,), wrapped, which fold."""
        if not (joints & ~self.is_folded).any():
            return self
        sizes = np.diff(self.start)
        layer = np.repeat(np.arange(len(sizes)), sizes)
        others = self.turn[:, ~joints]
        pose = np.column_stack([layer, self.candidate, self.posture, others])
        new = np.ones(len(pose), np.bool_)
        order = np.lexsort(pose.T)
        new[order[1:]] = (pose[order[1:]] != pose[order[:-1]]).any(axis=1)
        start = np.concatenate([[0], np.cumsum(np.bincount(layer[new], minlength=len(sizes)))])
        few = self._of(new, start, slice(None))
        return replace(
            few,
            q=freeze(few.q - np.where(joints, 2 * np.pi * few.turn, 0.0)),
            turn=freeze(np.where(joints, np.int8(0), few.turn)),
            folded=freeze(self.is_folded | joints),
        )

    @property
    def is_folded(self) -> Bools:
        """Which joints (n,) are folded."""
        return np.zeros(self.q.shape[1], np.bool_) if self.folded is None else self.folded

    def in_postures(self, postures: Sequence[int]) -> LayeredGraph:
        """Return the graph of some postures only; the others count as not wanted."""
        unwanted = ~_wanted(postures, self.reason.shape[2])
        keep, sizes = ~unwanted[self.posture], np.diff(self.start)
        left = np.bincount(np.repeat(np.arange(len(sizes)), sizes)[keep], minlength=len(sizes))
        start = np.concatenate([[0], np.cumsum(left)])
        reason = self.reason.copy()
        reason[:, :, unwanted] = self.reasons.index(Reason(Loss.UNWANTED))
        return replace(self._of(keep, start, slice(None)), reason=freeze(reason))

    def part(self, first: int, last: int) -> LayeredGraph:
        """Return the graph of nodes `first` to `last`, both included."""
        vertices = slice(self.start[first], self.start[last + 1])
        start = self.start[first : last + 2] - self.start[first]
        return self._of(vertices, start, slice(first, last + 1))

    def at_nodes(self, nodes: Ints) -> LayeredGraph:
        """Return the graph of some nodes (M,), in ascending order."""
        sizes, kept = np.diff(self.start), np.zeros(len(self.start) - 1, np.bool_)
        kept[nodes] = True
        start = np.concatenate([[0], np.cumsum(sizes[nodes])])
        return self._of(np.repeat(kept, sizes), start, nodes)

    def _of(self, vertices: Bools | slice, start: Ints, nodes: Ints | slice) -> LayeredGraph:
        """Return the graph of some vertices, which are those of some nodes."""
        return replace(
            self,
            q=freeze(self.q[vertices]),
            start=freeze(start),
            sample=freeze(self.sample[vertices]),
            variant=freeze(self.variant[vertices]),
            posture=freeze(self.posture[vertices]),
            turn=freeze(self.turn[vertices]),
            reason=freeze(self.reason[nodes]),
            external=None if self.external is None else freeze(self.external[nodes]),
            kept=None,
        )


def gamma_grid(step: float) -> Array:
    """Return the samples of gamma in (-pi, pi], at most `step` rad apart (section 3.1).

    Raises
    ------
    InputError
        A step that is not in (0, 2 pi].
    """
    step = scalar(step, "gamma_step", unit="rad", above=0.0)
    if step > 2 * np.pi * (1 + _WHOLE_STEPS):
        raise InputError(f"gamma_step: expected at most one turn (2 pi rad), got {step:g} rad")
    m = int(np.ceil(2 * np.pi / step * (1 - _WHOLE_STEPS)))
    return freeze(-np.pi + 2 * np.pi / m * np.arange(1, m + 1, dtype=float))


def build(
    frames: Array,
    robot: Robot,
    *,
    T_flange_tip: Array,
    gamma: Array,
    tilt: Array | None = None,
    postures: Sequence[int] | None = None,
    external: Array | None = None,
    progress: Callable[[int], None] | None = None,
) -> LayeredGraph:
    """Return the layered graph: all variants, gamma, postures and turns of every node (Eq. 10).

    Parameters
    ----------
    frames : (K, 4, 4) or (K, T, 4, 4)
        Task frames H_k in the robot base, m; or those of each tilt.
    robot : Robot
        Kinematics and joint limits.
    T_flange_tip : (4, 4) m
        Tool: tip frame in the flange.
    gamma : (m,) rad
        Samples of gamma, see `gamma_grid`; a single 0 instead if the robot leaves no rotation free.
    tilt : (T, 2) rad, optional
        Lead and lean of each tilt, see `kerfpath.tilt`; default: only the nominal axis.
    postures : sequence of int, optional
        The postures that may be used; default all. See `kerfpath.robots.postures_named`.
    external : (K, X, E) rad or m, optional
        Values of the joints that a pose leaves free (one of a seven-axis arm, then the external
        axes), in X variants of each tilt; default: a grid in the steps of these joints.
    progress : callable, optional
        Called with the number of nodes done since the last call.

    Raises
    ------
    InputError
        The robot's joint limits are not known or leave too many turns, or a posture that does not
        exist.
    """
    wanted = _wanted(postures, robot.postures)
    alone = robot.alone()
    alone.require_few_turns()
    limits, inner = alone.turn_limits(), len(alone.free)
    if not robot.family.free_rotation:
        gamma = freeze(np.zeros(1))
    tilt = freeze(np.zeros((1, 2))) if tilt is None else tilt
    frames = frames.reshape(len(frames), len(tilt), 4, 4)
    if external is None:
        external = np.broadcast_to(grid := external_grid(robot), (len(frames), *grid.shape))
    places = external.shape[1]
    tilt = freeze(np.repeat(tilt, places, axis=0))
    samples = len(tilt) * len(gamma)
    reason = np.empty((len(frames), samples, robot.postures), np.uint8)

    def layers_of(first: int, last: int) -> _NodeRun:
        """Solve nodes first..last-1 and keep the solutions within the limits."""
        H, x = frames[first:last, :, None], external[first:last]
        if robot.externals:
            H = np.linalg.inv(base_in_part(robot.externals, x[..., inner:]))[:, None] @ H
        H = np.ascontiguousarray(np.broadcast_to(H, (*H.shape[:2], places, 4, 4)))
        given = np.broadcast_to(x[:, None, :, 0], H.shape[:3]).ravel() if inner else None
        q, reach = robot.arm.inverse_nodes(H.reshape(-1, 4, 4), gamma, T_flange_tip, given)
        q = q.reshape(last - first, samples, *q.shape[2:])
        piece = _admitted(q, reach.reshape(q.shape[:3]), wanted, limits, reason[first:last])
        if robot.externals:
            node = np.repeat(np.arange(len(x)), piece.sizes)
            at = x[node, piece.sample // len(gamma) % places, inner:]
            still = np.zeros(at.shape, np.int8)
            piece = piece._replace(
                q=np.column_stack([piece.q, at]), turn=np.column_stack([piece.turn, still])
            )
        if progress is not None:
            progress(last - first)
        return piece

    nodes = max(1, robot.family.poses_at_once // samples)
    firsts = range(0, len(frames), nodes)
    with ThreadPoolExecutor(thread_count()) as pool:
        pieces = list(pool.map(lambda f: layers_of(f, min(f + nodes, len(frames))), firsts))
    sizes, q, sample, posture, turn = (list(parts) for parts in zip(*pieces, strict=True))
    pieces.clear()
    origin = _end_to_end(sample)
    return LayeredGraph(
        q=freeze(_end_to_end(q)),
        start=freeze(np.concatenate([[0], np.cumsum(np.concatenate(sizes))])),
        gamma=gamma,
        tilt=tilt,
        sample=freeze(origin % len(gamma)),
        variant=freeze(origin // len(gamma)),
        posture=freeze(_end_to_end(posture)),
        turn=freeze(_end_to_end(turn)),
        reason=freeze(reason),
        reasons=alone.reasons(),
        external=freeze(np.array(external)) if robot.free.size else None,
    )


def external_grid(robot: Robot) -> Array:
    """Return all combinations (X, E) of samples of the joints that a pose leaves free, rad or m.

    These are one joint of a seven-axis arm and the external axes.

    Raises
    ------
    InputError
        One of these joints has no step.
    """
    limits, free = robot.joint_limits(), robot.free.tolist()
    if not free:
        return np.zeros((1, 0))
    steps = [robot.elbow_step] * (len(free) - len(robot.externals))
    steps += [axis.step for axis in robot.externals]
    samples = [
        samples_of(
            robot.joint_names[i],
            step,
            float(limits.lower[i]),
            float(limits.upper[i]),
            endless=bool(robot.endless[i]),
            key="step=" if i >= robot.family.joints else "robot.with_elbow_step(...)",
        )
        for i, step in zip(free, steps, strict=True)
    ]
    return np.stack(np.meshgrid(*samples, indexing="ij"), axis=-1).reshape(-1, len(samples))


def _end_to_end(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """Return the arrays joined; each is freed when copied, so they are never all held twice."""
    whole = np.empty((sum(map(len, parts)), *parts[0].shape[1:]), parts[0].dtype)
    end = len(whole)
    while parts:
        part = parts.pop()
        whole[end - len(part) : end] = part
        end -= len(part)
    return whole


class _NodeRun(NamedTuple):
    """Vertices of successive nodes, and their number at each node."""

    sizes: Ints
    q: Array
    sample: NDArray[np.int32]
    posture: NDArray[np.int8]
    turn: NDArray[np.int8]


def _admitted(
    q: Array, reach: Bools, wanted: Bools, limits: JointLimits, out_reason: NDArray[np.uint8]
) -> _NodeRun:
    """Return the turns of q (K, V m, P, n) within the limits; fill the reasons (K, V m, P)."""
    sizes = np.empty(len(q), np.int64)
    count_admissible(q, reach, wanted, limits, sizes, out_reason)
    N, n = int(sizes.sum()), q.shape[3]
    sample, posture = np.empty(N, np.int32), np.empty(N, np.int8)
    found = _NodeRun(sizes, np.empty((N, n)), sample, posture, np.empty((N, n), np.int8))
    fill_admissible(q, out_reason, limits, *found[1:])
    return found


def _wanted(postures: Sequence[int] | None, number: int) -> Bools:
    every = range(number)
    chosen = every if postures is None else tuple(postures)
    if not chosen or any(mu not in every for mu in chosen):
        raise InputError(f"postures: expected some of 0 to {number - 1}, got {list(chosen)}")
    return freeze(np.isin(every, chosen))
