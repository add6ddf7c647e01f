"""Build the cell of a robot: its links, head, part, fixtures and floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from kerfpath.arrays import as_pose, scalar, short_repr
from kerfpath.cell.cell import Cell, Pair
from kerfpath.cell.links import link_bodies
from kerfpath.cell.mesh import Mesh
from kerfpath.cell.pairs import BY_DESIGN, MAY_TOUCH
from kerfpath.cell.scene import Body
from kerfpath.cell.shapes import Capsule, Hull, Shape, box_between, frustum
from kerfpath.errors import InputError
from kerfpath.robots import CarriedChain, Robot, chain_of
from kerfpath.urdf import KinematicChain

# -----------------------------------------------------------------------------
# Caveats: sentences for plans, reports and audits about what a cell does not prove.

UNPROVED = "links drawn as capsules need not hold the real ones"
"""Text that follows "clear" wherever links are not known."""

LARGE, SMALL = {"robot": 1.0, "head": 1.0, "part": 5.0, "fixture": 20.0}, 0.005
"""Largest and smallest likely sizes in lengths of the arm; others suggest a wrong unit."""


def caveats(cell: Cell) -> tuple[str, ...]:
    """Return a sentence for each thing that a cell does not prove, or keeps less than requested.

    These are bodies that need not hold the real ones, pairs of the head or listed pairs that are
    not judged, pairs that may overlap by design, and pairs that cannot keep the requested distance.
    """
    sentences = []
    if cell.unproved:
        sentences.append(
            f"Not proved for the real links: {', '.join(cell.unproved)} are capsules of typical "
            "sizes, which need not hold the real ones. Check in a simulation that the links are "
            "clear of each other and of head, part and fixtures, or plan with the meshes of the "
            "robot's description."
        )
    kind = {body.name: body.kind for body in cell.bodies}
    left = {pair: why for pair, why in cell.unjudged.items() if why == BY_DESIGN}
    heads = [pair for pair in left if "head" in (kind[pair[0]], kind[pair[1]])]
    if heads:
        pairs = ", ".join(f"{a} - {b}" for a, b in heads)
        sentences.append(f"Not judged, as they touch at every pose by design: {pairs}.")
    allowed = {frozenset(pair) for pair in cell.may_touch}
    if meant := [
        f"{a} - {b}" + (f" ({why})" if why != MAY_TOUCH else "")
        for (a, b), why in cell.unjudged.items()
        if {a, b} in allowed
    ]:
        sentences.append(f"Not judged, as they may touch: {', '.join(meant)}.")
    rows = zip(cell.pair_names, cell.asked, cell.required, cell.depth, strict=True)
    deep, less = [], []
    for (a, b), asked, required, depth in rows:
        if depth > 0:
            deep.append(f"{a} - {b} {depth * 1e3:g} mm")
        elif required < asked:
            less.append(f"{a} - {b} {required * 1e3:.3g} of {asked * 1e3:g} mm")
    if deep:
        sentences.append(
            f"Judged only for overlaps deeper than by design, which are: {', '.join(deep)}."
        )
    if less:
        sentences.append(f"Closer than requested by design, so these keep only: {', '.join(less)}.")
    return tuple(sentences)


def unlikely_sizes(cell: Cell) -> tuple[str, ...]:
    """Return a sentence for each body whose size is unlikely, given the arm's length."""
    arm = cell.chain.length
    sentences = []
    for body in (body for body in cell.bodies if body.kind != "floor"):
        size = float(body.size.max())
        most = LARGE[body.kind] * arm
        if not SMALL * arm <= size <= most:
            sentences.append(
                f"{body.name!r} is {size * 1e3:.4g} mm long, and the arm {arm * 1e3:.4g} mm: "
                "is its unit right?"
            )
    return tuple(sentences)


# -----------------------------------------------------------------------------
# Cutting heads: a generic one given by dimensions, or a mesh.

PAST = 1e-5
"""m: a mesh may reach this far past the stand-off point, as files round their numbers."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Head:
    """Base class of cutting heads: a nozzle at a stand-off above the part."""

    stand_off: float = 1e-3
    share: float = 0.5
    nozzle_length: float = 0.06

    def __post_init__(self) -> None:
        for field in fields(self):
            if field.type == "float" and field.name != "share":
                scalar(getattr(self, field.name), f"head {field.name}", unit="m", above=0.0)
        if not 0 <= self.share < 1:
            raise InputError(f"head share: expected 0 to below 1, got {self.share:g}")

    @property
    def keeps(self) -> float:
        """Distance (m) that the nozzle must keep to the part."""
        return self.share * self.stand_off


@dataclass(frozen=True, slots=True, kw_only=True)
class CuttingHead(_Head):
    """A generic cutting head: a conical nozzle, a round body above it, an arm to the flange.

    Nozzle and body lie along the beam, the tip's z axis. The tip is where the beam meets the part;
    the nozzle ends at the stand-off above it, and must keep `share` of the stand-off to the part.

    Parameters
    ----------
    stand_off : float m
        Distance from the end of the nozzle to the part.
    share : float
        Share of the stand-off that the nozzle must keep, from 0 to below 1.
    nozzle_length : float m
    nozzle_radii : (2,) m
        Radii at the end of the nozzle and where it meets the body.
    body_length, body_radius : float m
    arm_radius : float m

    Raises
    ------
    InputError
        A length that is not positive, or a share out of range.
    """

    nozzle_radii: tuple[float, float] = (2.5e-3, 16e-3)
    body_length: float = 0.14
    body_radius: float = 0.04
    arm_radius: float = 0.05

    __repr__ = short_repr

    def bodies(self, chain: KinematicChain, T_flange_tip: ArrayLike) -> tuple[Body, ...]:
        """Return the nozzle, the head, and the arm from the flange to the head.

        `T_flange_tip` is a pose (4, 4), m.
        """
        tip = as_pose(T_flange_tip, "T_flange_tip")
        beam, at = tip[:3, 2], tip[:3, 3]
        end = at - self.stand_off * beam
        neck = end - self.nozzle_length * beam
        top = neck - self.body_length * beam
        shapes: dict[str, Shape] = {
            "nozzle": frustum(end, neck, self.nozzle_radii),
            "head": frustum(neck, top, (self.body_radius, self.body_radius)),
            "arm": Capsule(start=np.zeros(3), end=top, radius=self.arm_radius),
        }
        return _mounted(shapes, chain)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshHead(_Head):
    """A cutting head as a closed mesh, cut across the beam into the nozzle and the rest above it.

    The nozzle is the part of the mesh within `nozzle_length` of the stand-off point along the beam.
    It must keep `share` of the stand-off to the part; the rest must keep the near-miss distance.

    Parameters
    ----------
    mesh : Mesh
        Mesh in the flange frame.
    stand_off : float m
        Distance from the end of the nozzle to the part.
    share : float
        Share of the stand-off that the nozzle must keep, from 0 to below 1.
    nozzle_length : float m
    """

    mesh: Mesh

    __repr__ = short_repr

    def bodies(self, chain: KinematicChain, T_flange_tip: ArrayLike) -> tuple[Body, ...]:
        """Return the nozzle and the head above it; `T_flange_tip` is a pose (4, 4), m.

        Raises
        ------
        InputError
            The mesh reaches past the stand-off point, or ends too far before it.
        """
        tip, mesh = as_pose(T_flange_tip, "T_flange_tip"), self.mesh
        beam = tip[:3, 2]
        end = tip[:3, 3] - self.stand_off * beam
        past = float(((mesh.vertices - end) @ beam).max()) + mesh.deviation
        if past > PAST:
            raise InputError(
                f"head {mesh.name}: reaches {past * 1e3:.3g} mm past the stand-off point, "
                f"{self.stand_off * 1e3:g} mm before the tip; the mesh must be in the flange "
                "frame, and the tip where the beam meets the part"
            )
        if past < -self.nozzle_length:
            raise InputError(
                f"head {mesh.name}: ends {-past * 1e3:.3g} mm before the stand-off point, so there "
                f"is no nozzle in the {self.nozzle_length * 1e3:g} mm above it; the mesh must be "
                "in the flange frame, in m"
            )
        nozzle, above = mesh.cut(end - self.nozzle_length * beam, beam)
        return _mounted({"nozzle": nozzle, "head": above}, chain)


def _mounted(shapes: Mapping[str, Shape | None], chain: KinematicChain) -> tuple[Body, ...]:
    """Return bodies of the shapes in the flange frame that are not None."""
    return tuple(
        Body(name=name, shape=shape.moved(chain.end), frame=chain.joints, kind="head")
        for name, shape in shapes.items()
        if shape is not None
    )


# -----------------------------------------------------------------------------
# Build the cell.

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
        listed = {frozenset(pair) for pair in (*own, *may_touch)}
        if not isinstance(head, Sequence) and {"nozzle", "part"} not in listed:
            own["nozzle", "part"] = head.keeps
    stands = _fixture_frames(chain, fixtures or {}, on or {})
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


def _fixture_frames(
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
