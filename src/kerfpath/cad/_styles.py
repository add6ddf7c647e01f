"""Colours and layers in STEP files, by entity."""

from __future__ import annotations

from collections.abc import Iterator

from OCP.Quantity import Quantity_Color
from OCP.STEPConstruct import STEPConstruct_Styles
from OCP.StepVisual import (
    StepVisual_Colour,
    StepVisual_PresentationLayerAssignment,
    StepVisual_StyledItem,
    StepVisual_SurfaceSideStyle,
)

from kerfpath.cad._step_model import Entities

__all__ = ["styles_in"]

COLOURS = {
    "#FF0000": "red",
    "#FFFF00": "yellow",
    "#00FF00": "green",
    "#00FFFF": "cyan",
    "#0000FF": "blue",
    "#FF00FF": "magenta",
    "#FFFFFF": "white",
}
"""Colours that have names in DXF drawings, too."""


def styles_in(entities: Entities) -> tuple[dict[object, str], dict[object, str]]:
    """Return the layers and the colours of entities.

    OCCT always returns the same object for an entity, as long as one of these mappings holds it.
    """
    layers: dict[object, str] = {}
    colours: dict[object, str] = {}
    for layer in entities.of(StepVisual_PresentationLayerAssignment):
        name = layer.Name()
        for k in range(1, layer.NbAssignedItems() + 1):
            layers[layer.AssignedItemsValue(k).Value()] = (
                "" if name is None else name.ToCString().strip()
            )
    for styled in entities.of(StepVisual_StyledItem):
        for colour in _fills(styled):
            colours[styled.Item()] = _named(colour)
    return layers, colours


def _fills(styled: StepVisual_StyledItem) -> Iterator[StepVisual_Colour]:
    """Yield the colours that a style fills a surface with."""
    for i in range(1, styled.NbStyles() + 1):
        style = styled.StylesValue(i)
        for j in range(1, style.NbStyles() + 1):
            usage = style.StylesValue(j).SurfaceStyleUsage()
            side = None if usage is None else usage.Style()
            if side is not None:
                yield from _areas(side)


def _areas(side: StepVisual_SurfaceSideStyle) -> Iterator[StepVisual_Colour]:
    for i in range(1, side.NbStyles() + 1):
        area = side.StylesValue(i).SurfaceStyleFillArea()
        fill = None if area is None else area.FillArea()
        for j in range(1, 1 + (0 if fill is None else fill.NbFillStyles())):
            colour = fill.FillStylesValue(j).FillAreaStyleColour()
            if colour is not None and colour.FillColour() is not None:
                yield colour.FillColour()


def _named(colour: StepVisual_Colour) -> str:
    """Return a colour's name, or #rrggbb; "" if it is not known."""
    known = Quantity_Color()
    if not STEPConstruct_Styles.DecodeColor_s(colour, known):
        return ""
    code = Quantity_Color.ColorToHex_s(known).ToCString()
    return COLOURS.get(code, code.lower())
