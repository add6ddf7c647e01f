"""Write a cell in motion as a binary glTF 2.0 file: bodies are meshes, frames are animated nodes.

Format: Khronos Group, glTF 2.0 specification (ISO/IEC 12113:2022). Lengths in m, time in s.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from kerfpath.arrays import Array, Ints, floats
from kerfpath.cell.cell import Cell
from kerfpath.cell.scene import Kind
from kerfpath.cell.shapes import surface
from kerfpath.errors import InputError
from kerfpath.robots import CarriedChain
from kerfpath.urdf import KinematicChain

COLOURS: Mapping[Kind, tuple[float, float, float]] = {
    "robot": (0.58, 0.36, 0.02),
    "head": (0.10, 0.13, 0.18),
    "part": (0.35, 0.40, 0.45),
    "fixture": (0.27, 0.39, 0.55),
    "floor": (0.75, 0.75, 0.75),
}
"""Colour of each kind of body: linear red, green and blue."""
UP = (-np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))
"""Quaternion x, y, z, w from z up, as in robotics, to y up, as in glTF."""
FLOAT, UNSIGNED = 5126, 5125
VERTICES, INDICES = 34962, 34963
"""Codes of the format for the type of numbers and for their use."""


def glb_of(cell: Cell, time: ArrayLike, q: ArrayLike) -> bytes:
    """Return a .glb file of a moving cell, for viewers, browsers and Blender.

    Every body is drawn with the shape that is judged, so a link may be a capsule or a hull. Between
    the times, each joint moves evenly by the short way round, which is less than half a turn.

    Parameters
    ----------
    cell : Cell
    time : (K,) s
        Increasing times.
    q : (K, n) rad
        Joints; linear axes in m.

    Raises
    ------
    InputError
        Other shapes, numbers that are not finite, times that do not increase in single precision.
    """
    at = floats(time, "time", (None,))
    frames = cell.frames(floats(q, "q", (len(at), cell.chain.joints)))
    if not len(at) or (np.diff((at - at[0]).astype(np.float32)) <= 0).any():
        raise InputError(
            "time: expected one or more times, each later than the one before in single precision"
        )
    file, chain = _File(), cell.chain
    root = chain.joints + 1
    # The nodes: one that moves for each frame, the root, and one at the pivot in each frame.
    pivots = [_pivot(chain, frame) for frame in range(root)]
    nodes: list[dict[str, object]] = [{"name": chain.moves_with(frame)} for frame in range(root)]
    nodes.append({"name": "cell", "rotation": UP, "children": [chain.still]})
    inside: list[list[int]] = [[] for _ in range(root)]
    for frame in range(root):
        nodes[frame]["children"] = [len(nodes)]
        place = {"translation": (-pivots[frame]).tolist()}
        nodes.append({"name": f"in {chain.moves_with(frame)}", "children": inside[frame]} | place)
        if frame != chain.still:
            inside[_parent(chain, frame)].append(frame)
    meshes: list[dict[str, object]] = []
    for body in cell.bodies:
        vertices, triangles = surface(body.shape)
        drawn = {
            "attributes": {"POSITION": file.add(vertices, "VEC3", bounds=True, target=VERTICES)},
            "indices": file.add_indices(triangles),
            "material": list(COLOURS).index(body.kind),
        }
        inside[body.frame].append(len(nodes))
        nodes.append({"name": body.name, "mesh": len(meshes)})
        meshes.append({"name": body.name, "primitives": [drawn]})
    for frame in range(root):
        if not inside[frame]:
            del nodes[root + 1 + frame]["children"]  # the format has no empty lists
    moves = _moves(file, at, _steps(chain, frames, pivots), nodes)
    return file.written(
        {
            "asset": {"version": "2.0", "generator": "kerfpath"},
            "scene": 0,
            "scenes": [{"nodes": [root]}],
            "nodes": nodes,
            "meshes": meshes,
            "materials": [_material(kind) for kind in COLOURS],
            "animations": [moves],
        }
    )


def _material(kind: Kind) -> dict[str, object]:
    look = {"baseColorFactor": [*COLOURS[kind], 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": kind, "pbrMetallicRoughness": look, "doubleSided": True}


def _pivot(chain: KinematicChain, frame: int) -> Array:
    """Return a point (3,) m of a frame that does not move as the frame turns in its parent."""
    place = frame if frame < chain.still else frame - 1
    if isinstance(chain, CarriedChain) and frame != chain.still and place < chain.base:
        return chain.externals[int(chain.order[place]) - len(chain.axes)].point
    return np.zeros(3)


def _parent(chain: KinematicChain, frame: int) -> int:
    return frame + 1 if frame < chain.still else frame - 1


def _steps(chain: KinematicChain, frames: Array, pivots: Sequence[Array]) -> Iterator[Array]:
    """Yield the pose (K, 4, 4) of each frame in its parent, from pivot to pivot."""
    for frame, pivot in enumerate(pivots):
        T = np.array(frames[:, frame])
        if frame != chain.still:
            T = np.linalg.inv(frames[:, _parent(chain, frame)]) @ T
        T[:, :3, 3] += T[:, :3, :3] @ pivot
        yield T


def _moves(
    file: _File, time: Array, steps: Iterable[Array], nodes: Sequence[dict[str, object]]
) -> dict[str, object]:
    """Return the animation of nodes with poses (K, 4, 4), and set each node to its first pose."""
    samplers: list[dict[str, object]] = []
    channels: list[dict[str, object]] = []
    input_ = file.add(time[:, None] - time[0], "SCALAR", bounds=True)
    for i, T in enumerate(steps):
        turned = Rotation.from_matrix(T[:, :3, :3]).as_quat()
        # A quaternion and its negative are the same rotation; take the nearer one.
        flips = np.einsum("ki,ki->k", turned[1:], turned[:-1]) < 0
        turned[1:] *= np.where(np.cumsum(flips) % 2, -1.0, 1.0)[:, None]
        for path, kind, values in (
            ("translation", "VEC3", T[:, :3, 3]),
            ("rotation", "VEC4", turned),
        ):
            nodes[i][path] = values[0].tolist()
            channels.append({"sampler": len(samplers), "target": {"node": i, "path": path}})
            samplers.append({"input": input_, "output": file.add(values, kind)})
    return {"name": "motion", "samplers": samplers, "channels": channels}


class _File:
    """The binary data of a file, and the place of each array in it."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._views: list[dict[str, int]] = []
        self._accessors: list[dict[str, object]] = []

    def add(self, rows: Array, kind: str, *, bounds: bool = False, target: int = 0) -> int:
        """Add rows (K, c) in single precision, and return the number of their accessor."""
        kept = np.ascontiguousarray(rows, "<f4")
        ends = {"min": kept.min(axis=0).tolist(), "max": kept.max(axis=0).tolist()}
        accessor = {"componentType": FLOAT, "count": len(kept), "type": kind}
        return self._add(kept.tobytes(), accessor | (ends if bounds else {}), target)

    def add_indices(self, triangles: Ints) -> int:
        """Add triangles (F, 3), and return the number of their accessor."""
        kept = np.ascontiguousarray(triangles, "<u4")
        accessor = {"componentType": UNSIGNED, "count": kept.size, "type": "SCALAR"}
        return self._add(kept.tobytes(), accessor, INDICES)

    def _add(self, content: bytes, accessor: dict[str, object], target: int) -> int:
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(content)}
        self._views.append(view | ({"target": target} if target else {}))
        self._accessors.append({"bufferView": len(self._views) - 1, **accessor})
        self._data += content
        return len(self._accessors) - 1

    def written(self, head: dict[str, object]) -> bytes:
        """Return the file: a header, its content as JSON, and the binary data."""
        lying = {
            "buffers": [{"byteLength": len(self._data)}],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(head | lying, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = b"".join(
            struct.pack("<I4s", len(content), name) + content
            for name, content in ((b"JSON", text), (b"BIN\0", bytes(self._data)))
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
