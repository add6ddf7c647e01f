"""How far nodes leave the CAD curve: closed forms, a brute-force oracle, and what is refused."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import numpy as np
import pytest
from scipy.interpolate import BSpline
from tests.cad.test_part import cut, cylinder, plate, tube, write_step

from kerfpath.cad import Departure, Part, departure_from, read
from kerfpath.contour import Contour
from kerfpath.errors import InputError
from kerfpath.operations import lead_in, lead_out, loop_corners, offset, overlap, reverse, start_at

DENSE = 2e-6
"""m: nodes that sample a contour of the default tolerance lie this near to the curve."""
NODES = 25
RADIUS = 0.01
SAGITTA = RADIUS * (1 - np.cos(np.pi / (NODES - 1)))
"""m: of a chord of an even 24-gon in a circle of 10 mm, about 0.086 mm."""


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Part:
    return read(write_step(tmp_path_factory.mktemp("sheet") / "plate.step", plate()))


@pytest.fixture(scope="module")
def drawing(tmp_path_factory: pytest.TempPathFactory) -> Part:
    """A closed spline of one piece and a square."""
    document = ezdxf.new(units=ezdxf.units.MM)
    t = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    radius = 30 + 8 * np.cos(3 * t)
    points = [(r * np.cos(a), r * np.sin(a)) for r, a in zip(radius, t, strict=True)]
    document.modelspace().add_spline(fit_points=[(*p, 0) for p in (*points, points[0])])
    document.modelspace().add_lwpolyline(
        [(100, 0), (140, 0), (140, 40), (100, 40)], close=True, dxfattribs={"layer": "square"}
    )
    path = tmp_path_factory.mktemp("dxf") / "spline.dxf"
    document.saveas(path)
    return read(path)


def hole(part: Part, diameter: float) -> str:
    return part.pick(diameter=(diameter - 1e-4, diameter + 1e-4))[0].name


def same(a: Departure, b: Departure, *, m: float, rad: float) -> None:
    assert a.chord_error == pytest.approx(b.chord_error, abs=m)
    assert a.axis_error == pytest.approx(b.axis_error, abs=rad)
    assert a.axis_step == pytest.approx(b.axis_step, abs=rad)


def test_the_chord_error_of_a_circle_is_its_sagitta(sheet: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    # Nodes on the circle itself: only rounding is left, and the arc lengths along its chords.
    t = np.linspace(0, 2 * np.pi, NODES)[:-1]
    middle = sheet.loop(name).bounding_box.mean(axis=0)
    points = middle + RADIUS * np.c_[np.cos(t), np.sin(t), 0 * t]
    axes = sheet.contour(name).axes[:1].repeat(len(t), axis=0)
    exact = sheet.departure(name, Contour(points, axes, closed=True))
    assert exact.chord_error == pytest.approx(SAGITTA, abs=1e-10)
    assert exact.against == "CAD curve"
    assert exact.axis_error == exact.axis_step == 0 or exact.axis_error < 1e-12
    # Nodes on samples of it are off by what these leave.
    nodes = sheet.contour(name).resample(count=NODES)
    assert sheet.departure(name, nodes).chord_error == pytest.approx(SAGITTA, abs=DENSE)


def test_start_and_direction_do_not_matter(sheet: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    drawn = sheet.contour(name)
    straight = sheet.departure(name, drawn.resample(count=NODES))
    for begun in (start_at(drawn, 0.3 * drawn.length), reverse(drawn)):
        same(sheet.departure(name, begun.resample(count=NODES)), straight, m=DENSE, rad=1e-12)
    # Half of it has the same chords; a whole turn and two chords more, too.
    begun = start_at(drawn, 0.3 * drawn.length)
    half = begun.resample(count=NODES).part(6, 18, "tangent")
    more = overlap(begun, begun.length * 2 / (NODES - 1)).resample(count=NODES + 2)
    for some in (half, more, reverse(more)):
        same(sheet.departure(name, some), straight, m=DENSE, rad=1e-12)


def test_the_worst_chord_is_told_by_its_first_node(sheet: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    drawn = sheet.contour(name)
    s = np.delete(np.linspace(0, drawn.length, NODES), 8)  # one chord twice as long: 7 to 8
    double = RADIUS * (1 - np.cos(2 * np.pi / (NODES - 1)))
    nodes = drawn.at_nodes(s)
    found = sheet.departure(name, nodes)
    assert (found.chord_node, found.chord_error) == (7, pytest.approx(double, abs=DENSE))
    assert sheet.departure(name, reverse(nodes)).chord_node == NODES - 2 - 1 - 7


def test_on_a_cylinder_the_axis_turns_as_far_as_the_surface(tmp_path: Path) -> None:
    # The rim of a tube of radius 30: chords of 5 deg, and the axis turns by 5 deg in each.
    part = read(write_step(tmp_path / "rim.step", tube()))
    name = next(
        loop.name
        for loop in part.loops
        if loop.surface == "cylinder" and loop.diameter and abs(loop.diameter - 0.06) < 1e-9
    )
    found = part.departure(name, part.contour(name).resample(count=73))
    step = 2 * np.pi / 72
    assert found.chord_error == pytest.approx(0.03 * (1 - np.cos(step / 2)), abs=DENSE)
    # The samples are 0.002 rad apart at most; a share of such a chord is that of its arc but for
    # the third power of that.
    assert found.axis_step == pytest.approx(step, abs=1e-8)
    # Straight above the share x of a chord the normal is at arcsin((2x - 1) sin(step/2)), the axis
    # at (x - 1/2) step.
    x = np.linspace(0, 1, 2001)
    off = np.abs(np.arcsin((2 * x - 1) * np.sin(step / 2)) - (x - 0.5) * step).max()
    assert found.axis_error == pytest.approx(off, abs=1e-8)


def test_a_hole_in_a_cylinder_agrees_with_what_is_known_of_it(tmp_path: Path) -> None:
    """Of radius a in radius R: (a cos t, sqrt(R^2 - a^2 cos^2 t), a sin t), the normal radial."""
    R, a = 0.03, 0.012
    bored = cut(cylinder(30, 100), cylinder(12, 60, (0, 0, 50), "y"))
    part = read(write_step(tmp_path / "bored.step", bored))
    name = max(
        (loop for loop in part.loops if loop.surface == "cylinder" and loop.kind == "inner"),
        key=lambda loop: loop.bounding_box[0, 1],
    ).name
    nodes = part.contour(name).resample(count=31)
    t = np.linspace(0, 2 * np.pi, 200_001)
    x = a * np.cos(t)
    curve = np.c_[x, np.sqrt(R**2 - x**2), 0.05 + a * np.sin(t)]
    axes = -curve * [1 / R, 1 / R, 0]
    chord, axis = oracle(nodes, curve, axes)
    found = part.departure(name, nodes)
    # OCCT fits a spline to the section of the two cylinders, by its own tolerance of 1e-7 m.
    assert found.chord_error == pytest.approx(chord, abs=3e-7)
    assert found.axis_error == pytest.approx(axis, abs=2e-5)
    steps = np.arccos((nodes.axes[:-1] * nodes.axes[1:]).sum(axis=1))
    assert found.axis_step == pytest.approx(steps.max(), abs=1e-7)  # arccos near 1
    assert found.step_node == np.argmax(steps)


def oracle(nodes: Contour, curve: np.ndarray, axes: np.ndarray) -> tuple[float, float]:
    """Return the largest distance of curve points from all chords, and the axis error there."""
    best = np.full(len(curve), np.inf)
    angle = np.zeros(len(curve))
    for k in range(len(nodes) - 1):
        p, d = nodes.points[k], nodes.points[k + 1] - nodes.points[k]
        x = np.clip((curve - p) @ d / (d @ d), 0, 1)
        off = np.linalg.norm(p + x[:, None] * d - curve, axis=1)
        n0, n1 = nodes.axes[k : k + 2]
        whole = np.arccos(min(1.0, n0 @ n1))
        if whole > 1e-9:
            n = np.sin((1 - x) * whole)[:, None] * n0 + np.sin(x * whole)[:, None] * n1
            between = 2 * np.arcsin(np.linalg.norm(n / np.sin(whole) - axes, axis=1) / 2)
            angle = np.where(off < best, between, angle)
        best = np.minimum(best, off)
    return float(best.max()), float(angle.max())


def test_a_closed_spline_agrees_with_many_points_of_it(drawing: Part) -> None:
    name = "0/outer"
    spline: BSpline = drawing.loop(name)._trace.edges[0].homogeneous
    t = np.linspace(spline.t[0], spline.t[-1], 100_001)
    points = spline(t)[:, :3] / spline(t)[:, 3:] / 1000
    for count in (12, 60, 400):
        nodes = drawing.contour(name).resample(count=count)
        chord, _ = oracle(nodes, points, np.tile([0.0, 0.0, -1.0], (len(t), 1)))
        # 1e5 points on 0.25 m are 2.5 um apart: at a maximum that changes the distance by 1e-9 m.
        assert drawing.departure(name, nodes).chord_error == pytest.approx(chord, abs=2e-9)


def test_a_dense_contour_keeps_the_tolerances_it_was_asked_for(sheet: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    for tolerance in (2e-6, 1e-4):
        found = sheet.departure(name, sheet.contour(name, chord_tolerance=tolerance))
        assert 0.1 * tolerance < found.chord_error <= tolerance


def test_corners_kept_cost_nothing_and_corners_cut_do(drawing: Part) -> None:
    drawn = drawing.contour("square/outer")
    assert drawing.departure("square/outer", drawn.resample(spacing=0.003)).chord_error < 1e-12
    # 0.16 m in 7: a corner lies between nodes at u and v from it, h = u v / hypot(u, v) off.
    at = np.linspace(0, 0.16, 8)
    u = np.array([0.04 * k - at[at <= 0.04 * k].max() for k in (1, 2, 3)])
    v = 0.16 / 7 - u
    found = drawing.departure("square/outer", drawn.resample(count=8))
    assert found.chord_error == pytest.approx((u * v / np.hypot(u, v)).max(), abs=1e-9)


def test_leads_and_loops_in_the_scrap_are_not_measured(sheet: Part, drawing: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    drawn = sheet.contour(name)
    led = lead_out(lead_in(drawn, 0.004, shape="arc"), 0.002)
    nodes = led.resample(spacing=0.0025)
    step = np.diff(nodes.s)[5]
    found = sheet.departure(name, nodes)
    assert found.chord_error == pytest.approx(RADIUS * (1 - np.cos(step / RADIUS / 2)), abs=DENSE)
    looped = loop_corners(drawing.contour("square/outer"), 0.002).resample(spacing=0.001)
    assert drawing.departure("square/outer", looped).chord_error < 1e-9


def test_points_are_measured_against_the_lines_between_them(tmp_path: Path) -> None:
    t = np.linspace(0, 2 * np.pi, 41)
    ring = [f"{30 * np.cos(a)},{30 * np.sin(a)},5,0,0,1" for a in t]
    (tmp_path / "ring.csv").write_text("\n".join(["x_mm,y_mm,z_mm,nx,ny,nz", *ring]) + "\n")
    part = read(tmp_path / "ring.csv")
    name = part.loops[0].name
    drawn = part.contour(name)
    found = part.departure(name, drawn)
    assert (found.against, found.path) == ("points of the drawing", None)
    assert found.chord_error < 1e-15
    # Every second point: the chord leaves the ring, whose points it skips, by their sagitta.
    found = part.departure(name, drawn.at_nodes(drawn.s[::2]))
    assert found.chord_error == pytest.approx(0.03 * (1 - np.cos(2 * np.pi / 40)), abs=1e-12)


def test_from_a_path_that_operations_moved(sheet: Part) -> None:
    name = hole(sheet, 2 * RADIUS)
    drawn = sheet.contour(name)
    path = lead_in(overlap(offset(drawn, 1e-3, side="right"), 0.002), 0.003, shape="arc")
    nodes = path.resample(spacing=0.002)
    loop = sheet.departure(name, drawn)
    found = departure_from(path, nodes, loop)
    step = np.diff(nodes.s)[nodes.kind[:-1] == 0].max()
    sagitta = 0.009 * (1 - np.cos(step / 0.009 / 2))
    assert (found.against, found.path) == ("path as cut", loop)
    assert found.chord_error == pytest.approx(sagitta, abs=DENSE)
    with pytest.raises(InputError, match="off the path"):
        departure_from(drawn, nodes, loop)


def test_a_contour_that_is_not_on_the_loop_is_refused_in_one_line(sheet: Part) -> None:
    name, other = hole(sheet, 0.02), hole(sheet, 0.01)
    drawn = sheet.contour(name)
    zigzag = Contour(drawn.points[[0, 40, 20, 60]], drawn.axes[:4])
    for contour, said in (
        (sheet.contour(other), "mm off it"),
        (offset(drawn, 1e-4, side="right"), "0.1 mm off it"),
        (zigzag, "back and forth"),
    ):
        with pytest.raises(InputError, match=said) as caught:
            sheet.departure(name, contour)
        assert "\n" not in str(caught.value)
        assert name in str(caught.value)
    led = lead_in(drawn, 0.004)
    with pytest.raises(InputError, match="entirely in the scrap"):
        sheet.departure(name, led.part(0, 3, "tangent"))


def test_loops_in_the_scrap_longer_than_the_cut(tmp_path: Path) -> None:
    (tmp_path / "square.csv").write_text(
        "x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n50,0,0,0,0,1\n50,50,0,0,0,1\n0,50,0,0,0,1\n"
        "0,0,0,0,0,1\n"
    )
    part = read(tmp_path / "square.csv")
    looped = loop_corners(part.contour("contour"), 0.02, side="right").resample(spacing=0.005)
    assert looped.length > 2 * part.loops[0].length
    for way in (looped, reverse(looped)):
        assert part.departure("contour", way).chord_error < 1e-12
