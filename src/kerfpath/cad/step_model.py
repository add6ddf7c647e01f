"""Entities of a STEP file in OCCT: which are damaged, and which shapes were made from them.

OCCT makes shapes from most entities, also from some that fail its own checks. Entities that fail,
and faces without a shape, are counted, so that nothing is left out without a note.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import TypeVar, cast

import numpy as np
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as ShapeMap
from OCP.Interface import Interface_InterfaceModel
from OCP.Standard import Standard_Transient
from OCP.StepBasic import StepBasic_ProductDefinition
from OCP.STEPConstruct import STEPConstruct
from OCP.STEPControl import STEPControl_Reader
from OCP.StepGeom import (
    StepGeom_Axis2Placement3d,
    StepGeom_CartesianPoint,
    StepGeom_Curve,
    StepGeom_Direction,
    StepGeom_Pcurve,
)
from OCP.StepRepr import (
    StepRepr_NextAssemblyUsageOccurrence,
    StepRepr_Representation,
    StepRepr_RepresentationItem,
    StepRepr_ShapeRepresentationRelationship,
)
from OCP.StepShape import (
    StepShape_FaceSurface,
    StepShape_ShapeDefinitionRepresentation,
    StepShape_SolidModel,
)
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from kerfpath.arrays import Array, freeze
from kerfpath.cad.left_out import LOST, LeftOut, counted, kind_of
from kerfpath.cad.shape import failures, unique
from kerfpath.cad.units import LARGEST, MM
from kerfpath.errors import InputError, printable

ALONE = (TopAbs_ShapeEnum.TopAbs_FACE, TopAbs_ShapeEnum.TopAbs_SHELL)
"""Kinds of shapes that are never a component of an assembly."""
STYLES = "StepVisual"
UNNAMED = ("", "none")
"""Names that CAD systems write for items without a name, in lower case."""
DRAWN = ("StepGeom", "StepShape")
"""Prefixes of OCCT's classes for entities that are drawn."""
E = TypeVar("E", bound=Standard_Transient)


class Entities:
    """The entities of a model by their kind, listed once.

    Parameters
    ----------
    model : Interface_InterfaceModel
    """

    def __init__(self, model: Interface_InterfaceModel) -> None:
        self._of: dict[type, list[Standard_Transient]] = defaultdict(list)
        for number in range(1, model.NbEntities() + 1):
            entity = model.Value(number)
            self._of[type(entity)].append(entity)

    def of(self, kind: type[E]) -> Iterator[E]:
        """Yield the entities of a kind."""
        for own, entities in self._of.items():
            if issubclass(own, kind):
                yield from cast(list[E], entities)


def require_drawable(entities: Entities, mm: float) -> None:
    """Raise InputError for entities on which OCCT crashes or spends minutes.

    Parameters
    ----------
    entities : Entities
    mm : float
        The unit of coordinates, in mm.
    """
    for point in entities.of(StepGeom_CartesianPoint):
        here = [point.CoordinatesValue(k) * mm for k in range(1, point.NbCoordinates() + 1)]
        if len(here) == 3 and not all(abs(x) <= LARGEST for x in here):
            raise InputError(
                f"a point lies at {here} mm, further than {LARGEST / 1e6:g} km from the origin; "
                "the file is damaged, or its unit is wrong"
            )
    for drawn in entities.of(StepGeom_Pcurve):
        items = drawn.ReferenceToCurve()
        if not (items and items.NbItems() and isinstance(items.ItemsValue(1), StepGeom_Curve)):
            raise InputError(
                "the file is damaged (Pcurve: expected a curve); copy or export it again"
            )


def damaged(reader: STEPControl_Reader) -> tuple[list[LeftOut], bool]:
    """Return the entities that fail OCCT's checks, and whether all styles pass them.

    Raises
    ------
    InputError
        The whole file fails them.
    """
    model = reader.WS().Model()
    found: Counter[tuple[str, str, bool]] = Counter()
    has_styles = True
    for number, reason in failures(reader.WS().ModelCheckList()):
        if not number:
            raise InputError(f"the file is damaged ({reason}); copy or export it again")
        package, kind = type(model.Value(number)).__name__.split("_", 1)
        has_styles &= package != STYLES
        if package != STYLES:
            may_cut = package in DRAWN or kind == "DefinitionalRepresentation"
            found[kind, f"damaged: {reason}", may_cut] += 1
    return counted(found), has_styles


def lost_faces(reader: STEPControl_Reader, entities: Entities) -> list[LeftOut]:
    """Return the faces of the file that OCCT made no shape from."""
    process = reader.WS().TransferReader().TransientProcess()
    found: Counter[tuple[str, str, bool]] = Counter()
    for face in entities.of(StepShape_FaceSurface):
        shape = STEPConstruct.FindShape_s(process, face)
        if shape is None or shape.IsNull():
            found[kind_of(face), LOST, True] += 1
    return counted(found)


def name_of(entity: object) -> str:
    """Return the name of an item, "" if it has none."""
    if not isinstance(entity, StepRepr_RepresentationItem) or entity.Name() is None:
        return ""
    name = printable(entity.Name().ToCString().strip())
    return "" if name.lower() in UNNAMED else name


def outside_components(entities: Entities) -> Iterator[StepRepr_Representation]:
    """Yield the representations in the part's own frame, without those of its components."""
    uses = list(entities.of(StepRepr_NextAssemblyUsageOccurrence))
    components = {use.RelatedProductDefinition() for use in uses}
    drawn = _representations(entities)
    for representation in entities.of(StepRepr_Representation):
        product = drawn.get(representation)
        if not uses or (product is not None and product not in components):
            yield representation


class Origins:
    """The entity that each shape was made from.

    Parameters
    ----------
    reader : STEPControl_Reader
        The reader that made the shapes.
    entities : Entities
    """

    def __init__(self, reader: STEPControl_Reader, entities: Entities) -> None:
        self._reader = reader.WS().TransferReader()
        process = self._reader.TransientProcess()
        self._shapes, self._entities = ShapeMap(), list[Standard_Transient]()
        self._asked, self._answers = ShapeMap(), list[StepBasic_ProductDefinition | None]()
        self._is_assembly = any(True for _ in entities.of(StepRepr_NextAssemblyUsageOccurrence))
        self._products = _products(entities) if self._is_assembly else {}
        for number in range(1, process.NbMapped() + 1):
            entity = process.Mapped(number)
            if not isinstance(entity, StepRepr_RepresentationItem):
                continue
            shape = STEPConstruct.FindShape_s(process, entity)
            if shape is None or shape.IsNull():
                continue
            if self._shapes.Add(_unplaced(shape)) > len(self._entities):
                self._entities.append(entity)

    def of(self, shape: TopoDS_Shape) -> Standard_Transient | None:
        """Return the entity of a shape, wherever it is placed, or None if it has none."""
        number = self._shapes.FindIndex(_unplaced(shape))
        return self._entities[number - 1] if number else None

    def product_of(self, shape: TopoDS_Shape) -> StepBasic_ProductDefinition | None:
        """Return the product in an assembly whose whole shape this is, or None."""
        if not self._is_assembly or shape.ShapeType() in ALONE:
            return None
        product = self._products.get(self.of(shape))
        if product is None:
            # OCCT searches everything that it has made, so it is asked once for each shape.
            number = self._asked.Add(_unplaced(shape))
            if number > len(self._answers):
                used = self._reader.EntityFromShapeResult(shape, -1)
                if isinstance(used, StepRepr_NextAssemblyUsageOccurrence):
                    product = used.RelatedProductDefinition()
                self._answers.append(product)
            product = self._answers[number - 1]
        return product


def _products(
    entities: Entities,
) -> dict[Standard_Transient | None, StepBasic_ProductDefinition]:
    """Return the products of an assembly by their solid, if it is their whole shape."""
    found: dict[Standard_Transient | None, StepBasic_ProductDefinition] = {}
    for representation, product in _representations(entities).items():
        numbers = range(1, representation.NbItems() + 1)
        items = [representation.ItemsValue(k) for k in numbers]
        solids = [item for item in items if isinstance(item, StepShape_SolidModel)]
        if len(solids) == 1 and all(
            isinstance(i, (StepShape_SolidModel, StepGeom_Axis2Placement3d)) for i in items
        ):
            found[solids[0]] = product
    return found


def _representations(
    entities: Entities,
) -> dict[StepRepr_Representation, StepBasic_ProductDefinition]:
    """Return the products of a file by the representations that draw them."""
    drawn: dict[StepRepr_Representation, StepBasic_ProductDefinition] = {}
    for shape in entities.of(StepShape_ShapeDefinitionRepresentation):
        defined = shape.Definition().PropertyDefinition()
        product = None if defined is None else defined.Definition().ProductDefinition()
        if product is not None and shape.UsedRepresentation() is not None:
            drawn[shape.UsedRepresentation()] = product
    for same in entities.of(StepRepr_ShapeRepresentationRelationship):
        if type(same) is not StepRepr_ShapeRepresentationRelationship:
            continue  # a subtype that places one in the other
        for one, other in ((same.Rep1(), same.Rep2()), (same.Rep2(), same.Rep1())):
            if one in drawn and other is not None:
                drawn.setdefault(other, drawn[one])
    return drawn


def _unplaced(shape: TopoDS_Shape) -> TopoDS_Shape:
    return shape.Located(TopLoc_Location())


# -----------------------------------------------------------------------------
# Named coordinate systems of STEP files: their placements.

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
