"""Arms and heads made of boxes whose overlaps have a formula: an oracle for collision checks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from kerfpath import Robot
from kerfpath.arrays import Array, Bools
from kerfpath.cell import Body, Capsule, Cell, Hull, Mesh, box, link_capsules
from kerfpath.cell.scene import Kind
from kerfpath.robots import chain_of

__all__ = ["Boxes", "Verdicts", "with_collimator"]

Box = tuple[Array, Array]
"""Pose (4, 4) of its centre in a frame, and half its edges (3,), m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdicts:
    """Numbers of poses called clear, of those that overlap, and of refused poses that do not."""

    clear: int
    wrong: int
    lost: int


class Boxes:
    """Solids made of boxes in the frames of an arm.

    Parameters
    ----------
    arm : Robot
    solids : dict of name to (frame, kind, boxes)
    """

    def __init__(self, arm: Robot, solids: dict[str, tuple[int, Kind, list[Box]]]) -> None:
        self.chain, self.solids = chain_of(arm), solids

    def bodies(self, *, meshes: bool) -> list[Body]:
        """Return them for a cell: links as meshes or as their hulls, the head as a mesh."""
        made = []
        for name, (frame, kind, boxes) in self.solids.items():
            hulls = [box(2 * half, T) for T, half in boxes]
            start = np.cumsum([0, *(len(h.points) for h in hulls)])
            vertices = np.vstack([h.points for h in hulls])
            triangles = np.vstack([h.triangles + s for h, s in zip(hulls, start, strict=False)])
            hull = kind == "robot" and not meshes
            shape = Hull(vertices) if hull else Mesh(vertices=vertices, triangles=triangles)
            made.append(Body(name=name, shape=shape, frame=frame, kind=kind))
        return made

    def overlap(self, one: str, two: str, q: Array, depth: float) -> Bools:
        """Return at which q (B, n) rad two solids overlap, the first shrunk by a depth (m)."""
        frames = self.chain.frames(q)
        (i, _, first), (j, _, second) = self.solids[one], self.solids[two]
        hit = np.zeros(len(q), bool)
        for T, half in first:
            for U, other in second:
                hit |= ~_apart(frames[:, i] @ T, half - depth, frames[:, j] @ U, other)
        return hit

    def verdicts(self, cell: Cell, q: Array) -> Verdicts:
        """Compare a cell's verdicts on q (B, n) rad with the formula, on the pairs it judges.

        Pairs proved clear everywhere are checked too; those that touch by design are not.
        """
        clear, hit, near = cell.clear(q), np.zeros(len(q), bool), np.zeros(len(q), bool)
        depths = dict(zip(cell.pair_names, cell.depth.tolist(), strict=True))
        for pair in combinations(cell.names, 2):
            if pair in depths:
                hit |= self.overlap(*pair, q, depths[pair])
                near |= self.overlap(*pair, q, 0.0)
            elif "at every angle" in cell.unjudged[pair] and "overlap" not in cell.unjudged[pair]:
                hit |= self.overlap(*pair, q, 0.0)
        return Verdicts(
            clear=int(clear.sum()), wrong=int((clear & hit).sum()), lost=int((~clear & ~near).sum())
        )


def with_collimator(arm: Robot, *, gap: float, behind: float) -> Boxes:
    """Return an arm of boxes with a head, one box of which reaches behind the flange.

    Link 5 ends `gap` (m) before the flange, or beyond it if `gap` is negative; the box beside the
    head starts `behind` (m) before the flange, far enough out to pass the sides of link 5 but not
    its edges.
    """
    solids: dict[str, tuple[int, Kind, list[Box]]] = {}
    for body in link_capsules(arm):
        assert isinstance(body.shape, Capsule)
        line, radius = body.shape.end - body.shape.start, 0.5 * body.shape.radius
        length = float(np.linalg.norm(line))
        if length == 0:
            continue
        z = line / length
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        T = np.eye(4)
        T[:3, :3] = np.array([x, np.cross(z, x), z]).T
        T[:3, 3] = (body.shape.start + body.shape.end) / 2
        half = np.array([radius, radius, length / 2])
        solids[body.name] = (body.frame, "robot", [(T, half)])
    chain = chain_of(arm)
    at = chain.frames(np.zeros((1, arm.joints)))[0]
    T_5_flange = np.linalg.inv(at[5]) @ at[6] @ chain.end
    flange = float(np.linalg.norm(chain.end[:3, 3]))
    T, half = _between([-0.05, -0.05, -flange - 0.05], [0.05, 0.05, -gap])
    solids["link 5"] = (5, "robot", [(T_5_flange @ T, half)])
    column = _between([-0.06, -0.05, 0], [0.061, 0.05, 0.2])
    collimator = _between([0.06, -0.03, -behind], [0.12, 0.03, 0.1])
    solids["head"] = (6, "head", [(chain.end @ T, half) for T, half in (column, collimator)])
    return Boxes(arm, solids)


def _between(low: list[float], high: list[float]) -> Box:
    T = np.eye(4)
    T[:3, 3] = (np.array(low) + high) / 2
    return T, (np.array(high) - low) / 2


def _apart(T_a: Array, half_a: Array, T_b: Array, half_b: Array) -> Bools:
    """Return whether any of 15 axes separates boxes at poses (B, 4, 4) (Gottschalk 1996)."""
    A, B = T_a[:, :3, :3], T_b[:, :3, :3]
    crossed = np.cross(A[:, :, :, None], B[:, :, None, :], axis=1).reshape(len(A), 3, 9)
    axes = np.concatenate([A, B, crossed], axis=2)
    between = np.einsum("bi,bik->bk", T_b[:, :3, 3] - T_a[:, :3, 3], axes)
    reach = np.einsum("bij,bik->bjk", A, axes), np.einsum("bij,bik->bjk", B, axes)
    held = half_a @ np.abs(reach[0]) + half_b @ np.abs(reach[1])
    return np.asarray((np.abs(between) > held).any(axis=1))
