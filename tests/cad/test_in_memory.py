"""Shapes in memory, bare or wrapped as other packages wrap them: the same parts as from files."""

from types import SimpleNamespace

import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape
from tests.cad.test_lines_in_space import line
from tests.cad.test_part import box, compound, plate, tube, write_step

from kerfpath import InputError
from kerfpath.cad import read
from kerfpath.cad.shape import list_shapes

FACE = TopAbs_ShapeEnum.TopAbs_FACE
FILE = 1e-9
"""m: what the digits of a file leave."""
SQUARE = [[0, 0, 0], [50, 0, 0], [50, 30, 10], [0, 30, 10]]


def wrapped(shape):
    return SimpleNamespace(wrapped=shape)


class Empty:
    """What build123d does of a part without anything in it."""

    @property
    def wrapped(self):
        raise AssertionError


def same(one, two, atol):
    assert [loop.name for loop in one.loops] == [loop.name for loop in two.loops]
    np.testing.assert_allclose(one.bounding_box, two.bounding_box, atol=atol)
    for a, b in zip(one.loops, two.loops, strict=True):
        assert (a.kind, a.surface, a.closed, a.side) == (b.kind, b.surface, b.closed, b.side)
        assert a.length == pytest.approx(b.length, abs=atol)
        np.testing.assert_allclose(a.bounding_box, b.bounding_box, atol=atol)


@pytest.mark.parametrize("build", [plate, tube])
def test_a_shape_is_the_part_that_its_file_is(tmp_path, build):
    shape = build()
    from_file = read(write_step(tmp_path / "part.step", shape))
    for given in (shape, wrapped(shape), [wrapped(shape)]):
        part = read(given)
        same(part, from_file, FILE)
        assert (part.unit, part.path.name) == ("mm", "shape")


def test_its_numbers_are_mm_unless_a_unit_is_given():
    shape = box(40.0, 30.0, 2.0)
    mm, inch = read(shape), read(shape, unit="in")
    np.testing.assert_allclose(np.ptp(mm.bounding_box, axis=0), [0.04, 0.03, 0.002], atol=1e-6)
    np.testing.assert_allclose(inch.loops[0].length, 25.4 * mm.loops[0].length, rtol=1e-12)
    assert inch.unit == "in"


def test_loose_faces_are_sewn_as_those_of_files_are():
    faces = [wrapped(face) for face in list_shapes(box(40.0, 30.0, 2.0), FACE)]
    part = read(faces)
    assert part.faces == 6
    assert "6 loose faces sewn" in part.notes[0]
    assert len(read(faces[0]).loops) == 1


def test_edges_are_a_drawing_of_lines_with_the_axis_that_is_given():
    edges = [line(SQUARE[k], SQUARE[k - 1]) for k in range(4)]
    (loop,) = read([wrapped(edge) for edge in edges], axis=[0, 0, -1]).loops
    assert loop.closed
    assert loop.length == pytest.approx(2 * (0.05 + np.hypot(0.03, 0.01)))
    with pytest.raises(InputError, match="shape: it has edges but no face; give the tool axis"):
        read(compound(*edges))


def test_the_shape_itself_is_left_as_it_is():
    """Triangles that are made of a part would else show up in the viewer of who gave it."""
    shape = plate()
    assert len(read(shape).mesh()[1])
    for face in list_shapes(shape, FACE):
        assert BRep_Tool.Triangulation_s(TopoDS.Face(face), TopLoc_Location()) is None


def hollow():
    nothing = TopoDS_Compound()
    BRep_Builder().MakeCompound(nothing)
    return nothing


def vertex(*at):
    return BRepBuilderAPI_MakeVertex(gp_Pnt(*at)).Vertex()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda: TopoDS_Shape(), "it is empty: nothing has been built yet"),
        (lambda: wrapped(None), "it is empty: nothing has been built yet"),
        (Empty, "it is empty: nothing has been built yet"),
        (hollow, "it is empty: it has neither faces nor edges"),
        (list, "it is empty: it has neither faces nor edges"),
        (lambda: vertex(1.0, 2.0, 3.0), "it has neither faces nor edges"),
        (lambda: [plate(), vertex(np.nan, 0.0, 0.0)], r"a point lies at \[nan, 0.0, 0.0\] mm"),
        (lambda: box(1e9, 1.0, 1.0), "a point lies at .* further than 10 km"),
        (lambda: 3, "expected a file, or a shape: .* got int"),
        (lambda: None, "got NoneType"),
        (lambda: b"part.step", "got bytes"),
        (lambda: ["part.step"], "got str"),
        (lambda: np.array(3.0), "got ndarray"),
        (lambda: SimpleNamespace(part=plate()), "pass the .part .* got SimpleNamespace"),
    ],
)
def test_what_is_no_part_is_refused_in_one_line(given, said):
    with pytest.raises(InputError, match=rf"^shape: .*{said}"):
        read(given())


def test_what_goes_with_tables_or_lines_alone_is_refused():
    with pytest.raises(InputError, match="shape: columns: expected a table, got a shape"):
        read(plate(), columns=["x", "y", "z"])
    with pytest.raises(InputError, match="shape: axis: expected a drawing of lines"):
        read(plate(), axis=[0, 0, 1])
    with pytest.raises(InputError, match="unit: expected one of"):
        read(plate(), unit="furlong")
