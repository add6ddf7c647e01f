"""STEP and IGES files of which something is damaged: the rest is read, and what is not is said."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.gp import gp_Pnt
from tests.cad.test_bodies import write_faces
from tests.cad.test_part import box, compound, plate, write_step

from kerfpath.cad import read
from kerfpath.errors import InputError

GEOMETRY = (
    "CARTESIAN_POINT", "DIRECTION", "VECTOR", "LINE", "CIRCLE", "AXIS2_PLACEMENT_3D", "PLANE",
    "CYLINDRICAL_SURFACE", "EDGE_CURVE", "ORIENTED_EDGE", "EDGE_LOOP", "FACE_BOUND",
    "ADVANCED_FACE", "VERTEX_POINT", "CLOSED_SHELL", "PCURVE", "SURFACE_CURVE", "SEAM_CURVE",
)  # fmt: skip
SPOILT: dict[str, Callable[[str], str]] = {
    "a reference is missing": lambda text: re.sub(r"#\d+(?=[,)])", "$", text, count=1),
    "a reference is to something else": lambda text: re.sub(r"#\d+(?=[,)])", "#1", text, count=1),
    "a number is missing": lambda text: re.sub(r"(?<=[(,])-?\d+\.[\dE+-]*", "$", text, count=1),
    "one parameter too few": lambda text: re.sub(r",[^,()]*\)$", ")", text, count=1),
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("whole")
    return write_step(folder / "plate.step", plate()).read_text("ascii")


def spoilt(text: str, kind: str, way: str) -> str | None:
    """Return a file with one entity of a kind spoilt, None if it cannot be in that way."""
    found = list(re.finditer(rf"= ({kind})(\([^;]*\));", text))
    one = found[len(found) // 2]
    other = SPOILT[way](one[2])
    return None if other == one[2] else text[: one.start(2)] + other + text[one.end(2) :]


@pytest.mark.parametrize("way", SPOILT)
@pytest.mark.parametrize("kind", GEOMETRY)
def test_a_damaged_entity_is_said_and_the_rest_is_read(
    tmp_path: Path, whole: str, kind: str, way: str
) -> None:
    """Nothing of a drawing that is damaged goes without a word, whatever OCCT makes of it."""
    text = spoilt(whole, kind, way)
    if text is None:
        return
    path = tmp_path / "spoilt.step"
    path.write_text(text, "ascii")
    part = None
    with contextlib.suppress(InputError):  # all of it may hang on what is spoilt
        part = read(path)
    if part is None:
        with pytest.raises(InputError, match=r"damaged|no face"):
            read(path)
        return
    assert any(each.may_cut for each in part.left_out)
    assert all(str(each) in part.notes for each in part.left_out)
    lost = sum(
        each.count
        for each in part.left_out
        if each.kind in ("AdvancedFace", "face") and "damaged" not in each.reason
    )
    assert part.faces + lost >= 8


def test_what_is_no_geometry_may_be_damaged(tmp_path: Path, whole: str) -> None:
    path = tmp_path / "spoilt.step"
    path.write_text(re.sub(r"(= PRODUCT\([^;]*)\(#\d+\)\);", r"\1($));", whole), "ascii")
    part = read(path)
    assert part.faces == 8
    assert [(each.kind, each.may_cut) for each in part.left_out] == [("Product", False)]


def test_a_face_without_a_plane_is_one_face_less(tmp_path: Path, whole: str) -> None:
    path = tmp_path / "spoilt.step"
    path.write_text(spoilt(whole, "PLANE", "a reference is missing") or "", "ascii")
    part = read(path)
    assert part.faces == 7
    kinds = [(each.kind, each.count, each.may_cut) for each in part.left_out]
    assert kinds == [("Plane", 1, True), ("AdvancedFace", 1, True)]
    assert part.left_out[1].reason == "no face could be made from it"


def test_a_cylinder_of_no_radius_loses_one_face_alone(tmp_path: Path, whole: str) -> None:
    """A face that has no normals is left out, and the others are read."""
    path = tmp_path / "spoilt.step"
    path.write_text(spoilt(whole, "CYLINDRICAL_SURFACE", "a number is missing") or "", "ascii")
    part = read(path)
    assert part.faces == 7
    assert "no normal" in part.left_out[-1].reason


def test_curves_beside_a_solid_are_counted(tmp_path: Path) -> None:
    lines = [BRepBuilderAPI_MakeEdge(gp_Pnt(0, y, 0), gp_Pnt(9, y, 0)).Edge() for y in (50, 60)]
    part = read(write_step(tmp_path / "both.step", compound(box(1, 2, 3), *lines)))
    assert part.faces == 6
    (only,) = part.left_out
    assert (only.kind, only.count, only.may_cut) == ("curve", 2, True)


def test_a_damaged_surface_of_an_iges_file_is_one_face_less(tmp_path: Path) -> None:
    path = write_faces(tmp_path / "plate.iges", [plate()], 0)
    lines = path.read_text("ascii").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("144,") and "P" in line[72:])
    lines[first] = lines[first].replace("144,", "144,0", 1)[:64].ljust(64) + lines[first][64:]
    lines[first] = re.sub(r"^144,\d+,", "144,0,", lines[first][:64]).ljust(64) + lines[first][64:]
    path.write_text("\n".join(lines) + "\n", "ascii")
    part = read(path)
    assert part.faces == 7
    # Curves that bounded it and lie on edges of its neighbours are drawn there already.
    assert all(
        each.may_cut != (each.reason == "it lies on edges of faces") for each in part.left_out
    )
    lost = [each.count for each in part.left_out if each.reason == "no face could be made from it"]
    assert lost == [1]
    # Of the surface and what bounds it, which belong to nothing any more.
    assert {each.kind for each in part.left_out} == {"TrimmedSurface", "curve"}
