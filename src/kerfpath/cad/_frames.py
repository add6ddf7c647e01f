"""Named coordinate systems of STEP files: their placements."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from OCP.StepGeom import StepGeom_Axis2Placement3d, StepGeom_Direction
from OCP.StepRepr import StepRepr_Representation

from kerfpath._arrays import Array, freeze
from kerfpath.cad._shape import unique
from kerfpath.cad._step_model import Entities, name_of, outside_components
from kerfpath.cad._units import MM

__all__ = ["step_frames"]

PARALLEL = 1e-9
"""Sine of the angle between the axes of a placement below which they define no orientation."""


def step_frames(entities: Entities, mm: float) -> Mapping[str, Array]:
    """Return T_part_frame (4, 4) m of each coordinate system that a STEP file names.

    They are the named placements among the items of representations; in an assembly, only those of
    the assembly itself, not of its components. Repeated names are numbered.

    Parameters
    ----------
    entities : Entities
    mm : float
        The unit of coordinates, in mm.

    Notes
    -----
    ISO 10303-42, axis2_placement_3d and build_axes.
    """
    found = dict.fromkeys(
        item
        for representation in outside_components(entities)
        for item in _placements(representation)
        if name_of(item)
    )
    placed = [(name_of(item), _pose(item, mm * MM)) for item in found]
    made = [(name, pose) for name, pose in placed if pose is not None]
    return dict(zip(unique([name for name, _ in made]), (pose for _, pose in made), strict=True))


def _placements(
    representation: StepRepr_Representation,
) -> Iterator[StepGeom_Axis2Placement3d]:
    for number in range(1, representation.NbItems() + 1):
        item = representation.ItemsValue(number)
        if isinstance(item, StepGeom_Axis2Placement3d):
            yield item


def _pose(placement: StepGeom_Axis2Placement3d, scale: float) -> Array | None:
    """Return the pose (4, 4) m of a placement, or None if its axes are parallel."""
    point = placement.Location()
    z = _vector(placement.Axis() if placement.HasAxis() else None, [0.0, 0.0, 1.0])
    across = [1.0, 0.0, 0.0] if abs(z[0]) < 1 - PARALLEL else [0.0, 1.0, 0.0]
    x = _vector(placement.RefDirection() if placement.HasRefDirection() else None, across)
    x = x - (x @ z) * z
    length = np.linalg.norm(x)
    if not length > PARALLEL:
        return None
    T = np.eye(4)
    T[:3, 0] = x / length
    T[:3, 1] = np.cross(z, x / length)
    T[:3, 2] = z
    T[:3, 3] = [point.CoordinatesValue(k) * scale for k in (1, 2, 3)]
    return freeze(T)


def _vector(direction: StepGeom_Direction | None, default: list[float]) -> Array:
    if direction is None:
        return np.array(default)
    ratios = np.array([direction.DirectionRatiosValue(k) for k in (1, 2, 3)])
    along: Array = ratios / np.linalg.norm(ratios)
    return along
