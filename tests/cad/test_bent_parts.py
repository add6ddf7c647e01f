"""Every through hole of a bent part is listed once, cut from outside, and none is invented."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks._bent_parts import FAMILIES, bent_part
from benchmarks.bent_parts import faults_of
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopoDS import TopoDS_Shape
from tests.cad.test_part import cut, cylinder

from kerfpath.cad import Part, read
from kerfpath.cad.sides import Triangles

EXACT = 1e-9
"""m: lines and circles are exact."""


def block(x: float, y: float, z: float, at: tuple[float, float, float]) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(*at), x, y, z).Shape()


def square_tube(*holes: TopoDS_Shape) -> TopoDS_Shape:
    """Return a tube of 60 x 40 x 2 mm, 300 mm long, without radii."""
    return cut(block(300, 60, 40, (0, 0, 0)), block(320, 56, 36, (-10, 2, 2)), *holes)


def cut_lengths(part: Part) -> list[float]:
    picked = part.pick(kind="inner", side="outer")
    return sorted(round(1e3 * loop.length / np.pi, 3) for loop in picked)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(2))
def test_the_holes_of_a_random_part_are_what_is_picked(family: str, seed: int) -> None:
    assert faults_of(bent_part(family, seed)) == ""


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_the_holes_of_many_random_parts_are_what_is_picked(family: str) -> None:
    assert {
        seed: fault for seed in range(2, 42) if (fault := faults_of(bent_part(family, seed)))
    } == {}


def test_a_square_tube_is_cut_from_outside_and_its_ends_are_rims() -> None:
    drills = cylinder(5, 60, (100, 30, -10)), cylinder(8, 10, (200, 30, 35))
    part = read(square_tube(*drills))
    assert cut_lengths(part) == [10, 10, 16]
    for loop in part.pick(kind="inner", side="outer"):
        contour = part.contour(loop.name)
        inwards = np.array([0.15, 0.03, 0.02]) - contour.points.mean(axis=0)
        assert contour.axes[0, 2] * inwards[2] > 0
    rims = part.pick(kind="outer", side="outer")
    assert [rim.length for rim in rims] == pytest.approx([0.2, 0.2], abs=EXACT)
    assert {rim.face for rim in rims} == {"skin1"}


def test_a_hole_across_a_sharp_edge_is_one_hole() -> None:
    part = read(square_tube(cylinder(6, 10, (100, 0, 35))))
    (hole,) = part.pick(kind="inner", side="outer")
    assert (hole.face, hole.closed) == ("skin1", True)
    # Half a circle on the top; on the side two lines down and one along.
    assert hole.length == pytest.approx((6 * np.pi + 2 * 5 + 12) * 1e-3, abs=EXACT)


def test_a_hole_about_the_pole_of_a_sphere_is_a_hole() -> None:
    ball = cut(BRepPrimAPI_MakeSphere(60).Shape(), BRepPrimAPI_MakeSphere(58).Shape())
    cap = cut(ball, block(200, 200, 130, (-100, -100, -100)), cylinder(8, 100, (0, 0, 0)))
    part = read(cap)
    (hole,) = part.pick(kind="inner", side="outer")
    assert hole.diameter == pytest.approx(0.016, abs=EXACT)
    assert len(part.pick(kind="outer", side="outer")) == 1


def test_what_does_not_go_through_is_named_and_not_picked() -> None:
    plate = block(100, 60, 3, (0, 0, 0))
    part = read(
        cut(plate, cylinder(5, 9, (20, 30, -3)), cylinder(5, 9, (50, 30, 1.5)),
            block(20, 20, 9, (70, 20, 2.8)))
    )  # fmt: skip
    assert cut_lengths(part) == [10]
    (outline,) = part.pick(kind="outer", side="outer")
    assert outline.length == pytest.approx(0.32, abs=EXACT)
    blind = [loop.name for loop in part.pick(side="blind", kind="inner")]
    (note,) = part.notes
    assert len(blind) == 2
    assert all(name in note for name in blind)


def cone(
    at: tuple[float, float, float], way: tuple[float, float, float], wide: float, deep: float
) -> TopoDS_Shape:
    """Return a cone of 90 deg, `wide` (mm radius) at its start."""
    axes = gp_Ax2(gp_Pnt(*at), gp_Dir(*way))
    return BRepPrimAPI_MakeCone(axes, wide, wide - deep, deep).Shape()


def test_a_sunk_hole_is_cut_from_outside_along_its_bore() -> None:
    up, down = (0, 0, 1), (0, 0, -1)
    sunk = {
        20: [cone((20, 30, 3), down, 5, 2)],
        45: [cone((45, 30, 0), up, 5, 2)],
        70: [cone((70, 30, 0), up, 4, 1), cone((70, 30, 3), down, 4, 1)],
        95: [cylinder(5, 9, (95, 30, 1.5))],  # a counterbore
        120: [cylinder(5, 9, (120, 30, 2)), cylinder(5, 9, (120, 30, -8))],
        145: [cone((145, 30, 3), down, 6, 3)],  # through the whole sheet
        170: [cylinder(4, 9, (170, 30, 2.8))],
    }
    bores = [cylinder(3, 9, (x, 30, -3)) for x in (*sunk, 195)]
    tools = [tool for tools in sunk.values() for tool in tools]
    part = read(cut(block(220, 60, 3, (0, 0, 0)), *bores, *tools))
    holes = part.pick(kind="inner", side="outer")
    by_place = {round(1e3 * hole.bounding_box[:, 0].mean()): hole for hole in holes}
    assert sorted(by_place) == [*sunk, 195]
    assert by_place[195].countersink == ""
    for x, hole in by_place.items():
        assert hole.diameter == pytest.approx(0.006, abs=EXACT), x
        assert hole.length == pytest.approx(0.006 * np.pi, abs=EXACT), x
        contour = part.contour(hole.name)
        assert contour.points[:, 2] == pytest.approx(0.003, abs=EXACT), x
        assert contour.axes == pytest.approx(np.tile(down, (len(contour), 1)), abs=EXACT), x
        # Clockwise about the outward normal, as around any hole.
        assert np.cross(contour.points[0] - [x / 1e3, 0.03, 0.003], contour.along[0])[2] < 0
        assert part.departure(hole.name, contour).chord_error < 2e-6
        if x != 195:
            border = part.loop(hole.countersink)
            assert (border.side, border.face) == ("sunk", "face5" if x == 45 else hole.face)
    assert len(part.pick(side="sunk")) == 9
    (note,) = part.notes
    assert all(hole.name in note for hole in holes if hole.countersink)


def test_a_sunk_hole_in_a_round_tube_lies_on_its_outside() -> None:
    """The bore is round along its axis, so it is where a bore without a sink meets the tube."""
    tube = cut(cylinder(30, 200, (0, 0, 0)), cylinder(26, 220, (0, 0, -10)))
    drill = gp_Ax2(gp_Pnt(0, 0, 100), gp_Dir(1, 0, 0))
    bore = BRepPrimAPI_MakeCylinder(drill, 4, 60).Shape()
    plain, part = (
        read(cut(tube, bore, *sinks)) for sinks in ([], [cone((31, 0, 100), (-1, 0, 0), 9, 3)])
    )
    (hole,), (like,) = (each.pick(kind="inner", side="outer") for each in (part, plain))
    assert (bool(hole.countersink), like.countersink) == (True, "")
    assert hole.length == pytest.approx(like.length, abs=EXACT)
    assert plain.departure(like.name, part.contour(hole.name)).chord_error < 3e-6
    # Leads are laid on the tube, which goes on over the hole.
    middle, _ = part.surface(hole.name).project(np.array([[0.031, 0.0, 0.1]]))
    assert middle[0] == pytest.approx([0.03, 0, 0.1], abs=1e-9)


def test_a_hole_drilled_askew_is_no_countersink() -> None:
    axes = gp_Ax2(gp_Pnt(50, 30, -5), gp_Dir(1, 0, 1))
    drill = BRepPrimAPI_MakeCylinder(axes, 4, 60).Shape()
    part = read(cut(block(100, 60, 3, (0, 0, 0)), drill))
    (hole,) = part.pick(kind="inner", side="outer")
    assert hole.countersink == ""


def test_rays_meet_first_what_each_triangle_alone_says() -> None:
    rng = np.random.default_rng(3)
    corners = rng.normal(size=(500, 1, 3)) * 20 + rng.normal(size=(500, 3, 3)) * 4
    body = rng.integers(0, 2, 500)
    origins, ways = rng.normal(size=(2, 400, 3)) * 20
    own = rng.integers(0, 2, 400)
    ways[:50, 0] = 0.0  # along a side of the boxes
    far, hit = Triangles(corners, body).first(origins, ways, own)
    for k in range(400):
        # Solve origin + t way = a + u e1 + v e2 for every triangle.
        e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        A = np.stack([np.broadcast_to(-ways[k], e1.shape), e1, e2], axis=2)
        t, u, v = np.linalg.solve(A, (origins[k] - corners[:, 0])[:, :, None])[:, :, 0].T
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (body == own[k])
        if not met.any():
            assert hit[k] == -1
        else:
            assert far[k] == pytest.approx(t[met].min(), rel=1e-9)
            assert hit[k] == np.flatnonzero(met)[np.argmin(t[met])]
