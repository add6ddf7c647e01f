"""Cutting heads: a generic one given by dimensions, or a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from kerfpath._arrays import as_pose, scalar
from kerfpath._repr import short_repr
from kerfpath.cell._bodies import Body
from kerfpath.cell._mesh import Mesh
from kerfpath.cell._shapes import Capsule, Shape, frustum
from kerfpath.errors import InputError
from kerfpath.urdf import KinematicChain

__all__ = ["CuttingHead", "MeshHead"]

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
