"""STEP files as CAD systems write them: protocols, nested assemblies, colours and layers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_StepModelType
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool
from tests.cad.test_part import box, compound

from kerfpath.cad import Part, read
from kerfpath.cad.shape import list_shapes
from kerfpath.errors import InputError

SCHEMAS = {"AP203": "CONFIG_CONTROL_DESIGN", "AP214IS": "AUTOMOTIVE", "AP242DIS": "AP242"}
QUARTER = gp_Trsf()
QUARTER.SetRotation(gp_Ax1(gp_Pnt(), gp_Dir(0, 0, 1)), np.pi / 2)
ALONG = gp_Trsf()
ALONG.SetTranslation(gp_Vec(100, 0, 0))
EXACT = 1e-8
"""m: STEP writes 13 digits, of inches and metres fewer are left."""


class Model:
    """A STEP file to be: shapes, assemblies, their names, colours and layers."""

    def __init__(self) -> None:
        Message.DefaultMessenger_s().ChangePrinters().Clear()
        self.document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
        main = self.document.Main()
        self.shapes = XCAFDoc_DocumentTool.ShapeTool_s(main)
        self.colours = XCAFDoc_DocumentTool.ColorTool_s(main)
        self.layers = XCAFDoc_DocumentTool.LayerTool_s(main)

    def assembly(self, name: str, *placed: tuple[TDF_Label, gp_Trsf]) -> TDF_Label:
        whole = self.shapes.NewShape()
        for label, move in placed:
            self.shapes.AddComponent(whole, label, TopLoc_Location(move))
        return named(whole, name)

    def coloured(self, label: TDF_Label, red: float, green: float, blue: float) -> None:
        colour = Quantity_Color(red, green, blue, Quantity_TypeOfColor.Quantity_TOC_sRGB)
        self.colours.SetColor(label, colour, XCAFDoc_ColorType.XCAFDoc_ColorSurf)

    def write(self, path: Path, *, schema: str = "AP214IS", unit: str = "MM") -> Path:
        self.shapes.UpdateAssemblies()
        writer = STEPCAFControl_Writer()
        Interface_Static.SetCVal_s("write.step.schema", schema)
        Interface_Static.SetCVal_s("write.step.unit", unit)
        try:
            writer.Transfer(self.document, STEPControl_StepModelType.STEPControl_AsIs)
            writer.Write(str(path))
        finally:
            Interface_Static.SetCVal_s("write.step.schema", "AP214IS")
            Interface_Static.SetCVal_s("write.step.unit", "MM")
        return path


def named(label: TDF_Label, name: str) -> TDF_Label:
    TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))
    return label


def painted() -> Model:
    """A blue box, its first face orange, its second on layer CUT."""
    model, box = Model(), BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()
    label = model.shapes.AddShape(box, False)
    first, second = list_shapes(box, TopAbs_ShapeEnum.TopAbs_FACE)[:2]
    model.coloured(label, 0, 0, 1)
    model.coloured(model.shapes.AddSubShape(label, first), 1, 0.5, 0)
    model.layers.SetLayer(
        model.shapes.AddSubShape(label, second), TCollection_ExtendedString("CUT")
    )
    return model


@pytest.mark.parametrize("schema", SCHEMAS)
def test_colours_and_layers_are_read_of_every_protocol(tmp_path: Path, schema: str) -> None:
    path = painted().write(tmp_path / "box.step", schema=schema)
    assert SCHEMAS[schema] in path.read_text("ascii")
    part = read(path)
    looks = [(loop.layer, loop.colour) for loop in part.loops]
    assert looks == [("", "#ff8000"), ("CUT", "blue"), *[("", "blue")] * 4]
    assert [loop.name for loop in part.pick(layer="CUT")] == ["face2/outer"]
    assert [loop.name for loop in part.pick(colour="#ff8000")] == ["face1/outer"]


def test_damaged_styles_are_left_out_with_a_note(tmp_path: Path) -> None:
    path = painted().write(tmp_path / "box.step")
    path.write_text(path.read_text("ascii").replace("COLOUR_RGB('',1.,", "COLOUR_RGB('',$,"))
    part = read(path)
    assert part.notes == ("colours and layers are damaged and not read",)
    assert {loop.colour for loop in part.loops} == {""}


def test_names_in_another_encoding_are_no_reason_to_refuse(tmp_path: Path) -> None:
    path = painted().write(tmp_path / "box.step")
    path.write_bytes(path.read_bytes().replace(b"'CUT'", "'T\u00dcR'".encode("latin-1")))
    assert read(path).loops[1].layer.startswith("T")


def nested(path: Path, unit: str) -> Part:
    """A box of 10 x 20 x 30 mm in a quarter turn in an assembly that is moved along x, twice."""
    model = Model()
    box = named(
        model.shapes.AddShape(BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape(), False), "plate"
    )
    inner = model.assembly("inner", (box, gp_Trsf()), (box, QUARTER))
    model.assembly("outer", (inner, gp_Trsf()), (inner, ALONG.Multiplied(QUARTER)))
    return read(model.write(path, unit=unit))


@pytest.mark.parametrize(("unit", "shown"), [("MM", "mm"), ("INCH", "in"), ("M", "m")])
def test_placements_nested_twice_are_applied(tmp_path: Path, unit: str, shown: str) -> None:
    part = nested(tmp_path / "nested.step", unit)
    assert part.unit == shown
    assert part.faces == 24
    boxes: dict[str, list[np.ndarray]] = {}
    for loop in part.loops:
        boxes.setdefault(loop.name.rsplit("/", 2)[0], []).append(loop.bounding_box)
    found = sorted(
        np.round(
            [np.min([b[0] for b in of], axis=0), np.max([b[1] for b in of], axis=0)], 6
        ).tolist()
        for of in boxes.values()
    )
    # Turned once: x from -20 to 0, y from 0 to 10; turned twice: both negative.
    wanted = sorted(
        [[x, y, 0.0], [x + dx, y + dy, 0.03]]
        for x, y, dx, dy in [
            (0.0, 0.0, 0.01, 0.02),
            (-0.02, 0.0, 0.02, 0.01),
            (0.08, 0.0, 0.02, 0.01),
            (0.09, -0.02, 0.01, 0.02),
        ]
    )
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_the_unit_of_an_assembly_can_be_overridden(tmp_path: Path) -> None:
    size = np.ptp(nested(tmp_path / "nested.step", "INCH").bounding_box, axis=0)
    told = read(tmp_path / "nested.step", unit="mm")
    assert told.unit == "mm"
    np.testing.assert_allclose(np.ptp(told.bounding_box, axis=0), size / 25.4, atol=EXACT)


@pytest.mark.parametrize("far", ["1.E8", "-1.E+400"])
def test_points_that_no_part_has_are_refused_before_occt_spends_minutes_on_them(
    tmp_path: Path, far: str
) -> None:
    path = painted().write(tmp_path / "box.step")
    path.write_text(path.read_text("ascii").replace("T('',(10.,", f"T('',({far},", 1))
    with pytest.raises(InputError, match=r"box\.step: a point lies at .* further than 10 km"):
        read(path)


def test_a_curve_on_a_face_that_is_none_is_refused(tmp_path: Path) -> None:
    path = painted().write(tmp_path / "box.step")
    text = path.read_text("ascii")
    path.write_text(
        text.replace(
            "DEFINITIONAL_REPRESENTATION('',(#38)", "DEFINITIONAL_REPRESENTATION('',(#17)", 1
        )
    )
    assert path.read_text() != text
    with pytest.raises(InputError, match=r"damaged .Pcurve: expected a curve"):
        read(path)


def test_parts_of_several_products_keep_their_names(tmp_path: Path) -> None:
    """Whatever is made of one solid or of several, once or more often, at any depth."""
    model = Model()
    plate, rod = (
        named(model.shapes.AddShape(BRepPrimAPI_MakeBox(*size).Shape(), False), name)
        for size, name in (((10.0, 20.0, 1.0), "plate 1.5"), ((5.0, 5.0, 50.0), "Stab ü"))
    )
    pair = named(model.shapes.AddShape(compound(box(1, 2, 3), box(4, 5, 6)), False), "pair")
    inner = model.assembly("inner", (plate, gp_Trsf()), (rod, QUARTER), (rod, ALONG))
    model.assembly("outer", (inner, gp_Trsf()), (pair, ALONG), (plate, QUARTER))
    part = read(model.write(tmp_path / "several.step"))
    counts: dict[str, int] = {}
    for loop in part.loops:
        name = loop.face.rsplit("/", 1)[0]
        counts[name] = counts.get(name, 0) + 1
    assert part.faces == 36
    assert sum(counts.values()) == 36
    assert counts["plate 1.5"] == counts["plate 1.5-2"] == 6
    rods = [name for name in counts if name.startswith("Stab")]
    assert len(rods) == 2
    assert sum(n for name, n in counts.items() if name.startswith("pair")) == 12


def with_frames(path, name, items=("#9004",)):
    """Put a placement at (10, 20, 30), z along x and x along y, among the items of a shape."""
    text = path.read_text()
    pattern = rf"({name}\('[^']*',\()"
    text, count = re.subn(pattern, rf"\g<1>{','.join(items)},", text)
    assert count
    frame = (
        "#9001=CARTESIAN_POINT('',(10.,20.,30.));#9002=DIRECTION('',(1.,0.,0.));"
        "#9003=DIRECTION('',(1.,2.,0.));#9004=AXIS2_PLACEMENT_3D('FIXTURE',#9001,#9002,#9003);"
        "#9005=AXIS2_PLACEMENT_3D('FIXTURE',#9001,$,$);"
    )
    path.write_text(text.replace("ENDSEC;\nEND-ISO", f"{frame}\nENDSEC;\nEND-ISO"))
    return path


@pytest.mark.parametrize(("unit", "mm"), [("MM", 1.0), ("INCH", 25.4)])
def test_named_placements_are_coordinate_systems_of_the_part(tmp_path, unit, mm):
    model = Model()
    model.shapes.AddShape(BRepPrimAPI_MakeBox(100.0, 50.0, 20.0).Shape(), False)
    path = model.write(tmp_path / "box.step", unit=unit)
    assert not read(path).frames
    part = read(with_frames(path, "ADVANCED_BREP_SHAPE_REPRESENTATION", ("#9004", "#9005")))
    assert list(part.frames) == ["FIXTURE", "FIXTURE-2"]
    size = np.array([100, 50, 20]) / 1000  # of the shape that OCCT writes in either unit
    np.testing.assert_allclose(part.bounding_box, [[0, 0, 0], size], atol=EXACT)
    expected = np.eye(4)
    expected[:3, :3] = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]).T  # x' = y, y' = z, z' = x
    expected[:3, 3] = np.array([10, 20, 30]) * mm / 1000
    np.testing.assert_allclose(part.frame("FIXTURE"), expected, atol=1e-12)
    expected[:3, :3] = np.eye(3)
    np.testing.assert_allclose(part.frame("FIXTURE-2"), expected, atol=1e-12)
    with pytest.raises(InputError, match=r"got 'TABLE'; it names 'FIXTURE', 'FIXTURE-2'"):
        part.frame("TABLE")


@pytest.mark.parametrize(
    ("representation", "frames"),
    [("[^_]SHAPE_REPRESENTATION", ["FIXTURE"]), ("ADVANCED_BREP_SHAPE_REPRESENTATION", [])],
)
def test_of_an_assembly_the_coordinate_systems_of_the_whole_count(tmp_path, representation, frames):
    model = Model()
    box = named(model.shapes.AddShape(BRepPrimAPI_MakeBox(100.0, 50.0, 20.0).Shape(), False), "box")
    model.assembly("whole", (box, ALONG), (box, QUARTER))
    path = model.write(tmp_path / "two.step")
    assert list(read(with_frames(path, representation)).frames) == frames
