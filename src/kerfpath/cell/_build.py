"""Build the cell of a robot: its links, head, part, fixtures and floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import as_pose
from kerfpath.cell._bodies import Body
from kerfpath.cell._cell import Cell, Pair
from kerfpath.cell._head import CuttingHead, MeshHead
from kerfpath.cell._links import link_bodies
from kerfpath.cell._mesh import Mesh
from kerfpath.cell._shapes import Capsule, Hull, Shape, box_between
from kerfpath.errors import InputError
from kerfpath.robots import CarriedChain, Robot, chain_of
from kerfpath.urdf import KinematicChain

__all__ = ["cell_of"]

FLOOR_REACH, THICK = 2.0, 0.5
"""How far a floor reaches to each side, in lengths of the arm (farther with external axes), and its
thickness, m."""


def cell_of(
    robot: Robot,
    *,
    tool: ArrayLike,
    head: CuttingHead | MeshHead | Sequence[Body] | None = None,
    part: Mesh | None = None,
    placement: ArrayLike | None = None,
    fixtures: Mapping[str, Shape] | None = None,
    on: Mapping[str, str] | None = None,
    links: Sequence[Body] | None = None,
    near_miss: float = 0.0,
    near_miss_of: Mapping[Pair, float] | None = None,
    may_touch: Sequence[Pair] | Mapping[Pair, str] = (),
    floor: float | None = None,
) -> Cell:
    """Return the cell of a robot with a cutting head, a part, fixtures and a floor.

    The nozzle works at its stand-off from the part, so it must keep only the head's `share` of the
    stand-off to the part. All other pairs must keep the near-miss distance.

    The part moves with all external axes that carry it, and the robot's base with all that carry
    the robot. A fixture moves with the axis that it stands `on`, or does not move. Places are given
    with every such axis at zero.

    Parameters
    ----------
    robot : Robot
    tool : (4, 4)
        T_flange_tip, m.
    head : CuttingHead, MeshHead or sequence of Body, optional
        Default: the generic head.
    part : Mesh, optional
        Mesh in the part frame.
    placement : (4, 4), optional
        T_base_part, m; needed with a part.
    fixtures : mapping of name to Shape, optional
        Shapes in the robot base.
    on : mapping of fixture to external axis, optional
        Names of the fixtures that move with an axis, and with those that carry it.
    links : sequence of Body, optional
        Default: `link_bodies(robot)`, the robot's description or else capsules.
    near_miss, near_miss_of, may_touch
        As in `Cell`.
    floor : float m, optional
        Height in the robot base of a floor, a body named "floor"; default: no floor.

    Raises
    ------
    InputError
        A part without its placement; a body of another package; a fixture on an axis that does not
        exist; whatever `Cell` raises.
    """
    chain = chain_of(robot)
    head = CuttingHead() if head is None else head
    own = dict(near_miss_of or {})
    tool_bodies = tuple(head if isinstance(head, Sequence) else head.bodies(chain, tool))
    parts: tuple[Body, ...] = ()
    for name, shape in (fixtures or {}).items():
        _require_solid(shape, f"fixture {name!r}")
    if part is not None:
        _require_solid(part, "part")
        if placement is None:
            raise InputError("cell: a part needs its placement, T_base_part (4, 4)")
        placed = part.moved(as_pose(placement, "placement"))
        parts = (Body(name="part", shape=placed, frame=0, kind="part"),)
        said = {frozenset(pair) for pair in (*own, *may_touch)}
        if not isinstance(head, Sequence) and {"nozzle", "part"} not in said:
            own["nozzle", "part"] = head.keeps
    stands = _stands(chain, fixtures or {}, on or {})
    things = tuple(
        Body(name=name, shape=shape, frame=stands[name], kind="fixture")
        for name, shape in (fixtures or {}).items()
    )
    ground: tuple[Body, ...] = ()
    if floor is not None:
        reach = FLOOR_REACH * chain.length
        if isinstance(chain, CarriedChain):
            reach += chain.sway + max((_extent(body) for body in (*parts, *things)), default=0.0)
        slab = box_between([-reach, -reach, floor - THICK], [reach, reach, floor])
        ground = (Body(name="floor", shape=slab, frame=chain.still, kind="floor"),)
    links = link_bodies(robot) if links is None else links
    return Cell(
        chain=chain,
        bodies=(*links, *tool_bodies, *parts, *things, *ground),
        near_miss=near_miss,
        near_miss_of=own,
        may_touch=may_touch,
        endless=robot.endless,
        T_flange_tip=as_pose(tool, "tool"),
        T_base_part=None if placement is None else as_pose(placement, "placement"),
    )


def _require_solid(shape: object, what: str) -> None:
    if not isinstance(shape, Capsule | Hull | Mesh):
        raise InputError(
            f"cell: {what}: expected a solid of kerfpath.cell, got {type(shape).__name__}; "
            "convert a mesh of another package with mesh_of(mesh, unit)"
        )


def _stands(
    chain: KinematicChain, fixtures: Mapping[str, Shape], on: Mapping[str, str]
) -> dict[str, int]:
    """Return the frame that each fixture stands in: on the ground, or on an external axis."""
    frames = dict.fromkeys(fixtures, chain.still)
    for name, axis in on.items():
        if name not in fixtures:
            raise InputError(f"cell on: no fixture is called {name!r}")
        if not isinstance(chain, CarriedChain):
            raise InputError(f"cell on: {name!r} stands on {axis!r}, but there is no external axis")
        frames[name] = chain.frame_on(axis)
    return frames


def _extent(body: Body) -> float:
    """Return how far (m) a body reaches from the origin of its frame."""
    return float(np.linalg.norm(body.shape.corners, axis=1).max()) + body.shape.radius
