"""Programs of machines with rotary axes: what is written by forward kinematics is read back."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from commands import assert_refused, run
from kerfpath import cad
from kerfpath.cad import Machine, Part, read
from kerfpath.errors import InputError
from kerfpath.job import read_job

CHORD = 1e-3
"""mm: how far the points of a cut may leave the motion of the machine."""
DIGITS = 1e-6
"""mm and deg: what the programs of these tests hold; several of them add up."""

Angles = dict[str, float]

# ------------------------------------------------------------------- kinematics, and the writers


def about(letter: str, degrees: float) -> np.ndarray:
    """Rotation about X, Y or Z (Rodrigues), homogeneous."""
    x, y, z = np.eye(3)["ABC".index(letter)]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    turn = np.eye(4)
    turn[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def moved(xyz: np.ndarray) -> np.ndarray:
    move = np.eye(4)
    move[:3, 3] = xyz
    return move


def tool_in_part(machine: Machine, xyz: np.ndarray, angles: Angles) -> np.ndarray:
    """The pose of the tool in the part (mm), without control of the tip.

    The slides carry the head, whose axes meet the pivot above the tip. The table carries the part
    about its centre, the other way round, so that the tool turns about the part as counted.
    """
    turn = {
        name: about(name, -angles[name] if name in machine.reversed else angles[name])
        for name in machine.axes
    }
    up = np.array([0.0, 0.0, 1e3 * (machine.pivot or 0.0)])
    centre = 1e3 * np.array(machine.centre)
    tool = moved(xyz + up)
    for name in machine.head:
        tool = tool @ turn[name]
    part = moved(centre)
    for name in machine.table:
        part = part @ turn[name].T
    return np.linalg.inv(part @ moved(-centre)) @ tool @ moved(-up)


def slides_of(machine: Machine, tip: np.ndarray, angles: Angles) -> np.ndarray:
    """X, Y and Z (mm) for a tip in the part: it moves with the slides by a rotation."""
    start = tool_in_part(machine, np.zeros(3), angles)[:3, 3]
    ways = [tool_in_part(machine, unit, angles)[:3, 3] - start for unit in np.eye(3)]
    return np.linalg.solve(np.transpose(ways), tip - start)


def iso(points: np.ndarray, angles: Sequence[Angles], *head: str, feed: str = "G1") -> str:
    lines = ["G21 G90", *head]
    for k, (xyz, turned) in enumerate(zip(points, angles, strict=True)):
        words = [f"{name}{value:.6f}" for name, value in zip("XYZ", xyz, strict=True)]
        words += [f"{name}{value:.6f}" for name, value in turned.items()]
        lines.append(f"{feed if k else 'G0'} {' '.join(words)}")
    return "\n".join([*lines, "M30", ""])


def siemens(points: np.ndarray, angles: Sequence[Angles]) -> str:
    return iso(points, angles, "TRAORI").replace("G21", "G71")


def fanuc(points: np.ndarray, angles: Sequence[Angles]) -> str:
    return iso(points, angles, "G43.4 H1")


def heidenhain(points: np.ndarray, angles: Sequence[Angles]) -> str:
    lines = ["BEGIN PGM A MM", "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS"]
    for k, (xyz, turned) in enumerate(zip(points, angles, strict=True)):
        values = [*zip("XYZ", xyz, strict=True), *turned.items()]
        words = " ".join(f"{name}{value:+.6f}" for name, value in values)
        lines.append(f"L {words} {'F3000' if k else 'R0 FMAX'}")
    return "\n".join(f"{k} {line}" for k, line in enumerate([*lines, "END PGM A MM"]))


def program(folder: Path, text: str, machine: Machine | None = None) -> Part:
    file = folder / "cut.nc"
    file.write_text(text)
    return read(file, machine=machine)


def cut(folder: Path, text: str, machine: Machine | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Points (K, 3) mm and tool axes (K, 3) of the only cut."""
    contour = program(folder, text, machine).contour("cut1", closed=False)
    return 1e3 * contour.points, contour.axes


# ------------------------------------------------------------------------------------------- laws

MACHINES = {
    "laser head CB": Machine(head="CB", pivot=0.18),
    "laser head CA": Machine(head="CA", pivot=0.25, reversed="A"),
    "fork head AB": Machine(head="AB", pivot=0.12),
    "trunnion AC": Machine(table="AC", centre=(0.03, -0.02, -0.1)),
    "trunnion BC": Machine(table="BC", reversed="C"),
    "tube A": Machine(table="A", centre=(0.0, 0.0, -0.03)),
    "tube C": Machine(table="C", reversed="C"),
    "head B, table C": Machine(head="B", table="C", pivot=0.1, centre=(0.0, 0.05, 0.0)),
    "head BC over a tube A": Machine(head="BC", table="A", pivot=0.3),
}


def walk(machine: Machine, seed: int, size: int = 12) -> tuple[np.ndarray, list[Angles]]:
    """Places of the slides (mm) and angles of the axes (deg), in long steps, some beyond a turn."""
    random = np.random.default_rng(seed)
    steps = np.array([20.0, 0, 0]) + random.normal(size=(size, 3)) * 8
    turned = np.cumsum(random.normal(size=(size, 3)) * (25, 25, 90), axis=0)
    turned[:, :2] = np.clip(turned[:, :2], -70, 70)
    angles = [{name: row["ABC".index(name)] for name in machine.axes} for row in turned.round(6)]
    return np.cumsum(steps, axis=0).round(6), angles


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", MACHINES)
def test_a_cut_is_the_motion_of_the_machine(tmp_path: Path, name: str, seed: int) -> None:
    """All axes move evenly from block to block, so the tip runs along a curve in the part."""
    machine = replace(MACHINES[name], rollover=False, tcp=False)
    points, angles = walk(machine, seed)
    found, axes = cut(tmp_path, iso(points, angles), machine)
    for k, share in itertools.product(range(1, len(points)), np.linspace(0, 1, 25)):
        turned = {one: a + share * (angles[k][one] - a) for one, a in angles[k - 1].items()}
        pose = tool_in_part(machine, points[k - 1] + share * (points[k] - points[k - 1]), turned)
        tip, beam = pose[:3, 3], -pose[:3, 2]
        start, way = found[:-1], np.diff(found, axis=0)
        along = np.clip(((tip - start) * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
        off = np.linalg.norm(start + along[:, None] * way - tip, axis=1)
        j = int(off.argmin())
        evenly = axes[j] + along[j] * (axes[j + 1] - axes[j])
        assert off[j] <= (10 * DIGITS if share in (0, 1) else CHORD + 10 * DIGITS)
        # 0.01 deg; the cut is found by its place, which is 1 um off on ways of 0.1 mm
        assert evenly / np.linalg.norm(evenly) == pytest.approx(beam, abs=np.radians(0.03))


@pytest.mark.parametrize("written", [siemens, fanuc, heidenhain])
@pytest.mark.parametrize("name", MACHINES)
def test_with_control_of_the_tip_the_blocks_have_the_contour(
    tmp_path: Path, name: str, written: Callable[[np.ndarray, list[Angles]], str]
) -> None:
    machine = replace(MACHINES[name], rollover=False)
    points, angles = walk(machine, 3)
    found, axes = cut(tmp_path, written(points, angles), machine)
    for point, turned in zip(points, angles, strict=True):
        off = np.linalg.norm(found - point, axis=1)
        assert off.min() <= DIGITS
        beam = -tool_in_part(machine, point, turned)[:3, 2]
        assert axes[off.argmin()] == pytest.approx(beam, abs=1e-9)
    ways = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()  # straight between the blocks
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).sum() == pytest.approx(ways, abs=1e-4)


def test_machines_that_carry_axes_alike_cut_alike(tmp_path: Path) -> None:
    """The same angles, written for slides of each machine, cut the same contour."""
    random = np.random.default_rng(4)
    tips = np.cumsum([20.0, 0, 0] + random.normal(size=(9, 3)) * 5, axis=0)
    a, c = random.uniform(-50, 50, 9).round(6), random.uniform(-80, 80, 9).round(6)
    angles = [{"A": one, "C": other} for one, other in zip(a, c, strict=True)]
    ends = []
    for shape in ({"head": "CA"}, {"table": "AC"}, {"head": "A", "table": "C"}):
        machine = Machine(**shape, pivot=0.15, centre=(0.01, 0.02, -0.05))
        slides = [slides_of(machine, *each) for each in zip(tips, angles, strict=True)]
        found, axes = cut(tmp_path, iso(np.array(slides), angles), replace(machine, tcp=False))
        near = [np.linalg.norm(found - tip, axis=1).argmin() for tip in tips]
        assert found[near] == pytest.approx(tips, abs=10 * DIGITS)
        ends.append(axes[near])
    # u = Rz(c) Rx(a) z, worked out by hand
    a, c = np.radians(a), np.radians(c)
    by_hand = np.column_stack([np.sin(c) * np.sin(a), -np.cos(c) * np.sin(a), np.cos(a)])
    for axes in ends:
        assert -axes == pytest.approx(by_hand, abs=1e-7)


def test_a_ring_around_a_tube_is_a_circle(tmp_path: Path) -> None:
    """A tube of radius 30 that turns once under a fixed beam, with Z 0 at its surface."""
    machine = Machine(table="A", centre=(0, 0, -0.03))
    text = "G21\nG0 X50 Y0 Z0 A0\nG1 A360 F9000\nG0 Z40\nM30\n"
    part = program(tmp_path, text, machine)
    (loop,) = part.loops
    assert loop.closed
    assert loop.diameter == pytest.approx(0.06, abs=2e-6)
    contour = part.contour("cut1")
    inward = np.array([0.05, 0, -0.03]) - contour.points
    assert contour.axes == pytest.approx(inward / np.linalg.norm(inward, axis=1)[:, None], abs=1e-9)
    # By ISO 841 the tool turns counter-clockwise about X of the part as A grows: from +z to -y.
    assert contour.points[1, 1] < 0
    back = program(tmp_path, text, replace(machine, reversed="A")).contour("cut1")
    assert back.points[1, 1] > 0


def test_a_tube_is_turned_at_its_corner(tmp_path: Path) -> None:
    """A section of 40 x 20: along the upper wall, a quarter turn in one block, down the next."""
    text = "G21\nG0 X0 Y-15 Z10 A0\nG1 Y20\nA-90 Z20 Y-10\nY10\n"
    found, axes = cut(tmp_path, text + "M30\n", Machine(table="A"))
    assert found[0] == pytest.approx([0, -15, 10])
    assert np.linalg.norm(found - [0, 20, 10], axis=1).min() <= DIGITS
    assert axes[0] == pytest.approx([0, 0, -1])
    assert found[-1] == pytest.approx([0, 20, -10])
    assert axes[-1] == pytest.approx([0, -1, 0])
    with pytest.raises(InputError, match="line 6: a move along the tool axis within a cut"):
        cut(tmp_path, text + "Z40\nY20\n", Machine(table="A"))


# -------------------------------------------------------------------- turns of more than a half


AROUND = "G21\nG43.4\nG0 X0 Y0 Z0 B30 C350\nG1 X50 C{}\nX60\nM30\n"


def axes_along(folder: Path, angle: str, rollover: bool | None) -> np.ndarray:
    machine = Machine(head="CB", rollover=rollover)
    return cut(folder, AROUND.format(angle), machine)[1]


def swept(axes: np.ndarray) -> float:
    """Angle (deg) by which tool axes turn about Z on the whole."""
    return float(np.degrees(np.ptp(np.unwrap(np.arctan2(axes[:, 1], axes[:, 0])))))


def test_an_axis_that_passes_360_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 4: C turns from 350 to 10 deg at feed: say"):
        axes_along(tmp_path, "10", None)
    assert swept(axes_along(tmp_path, "10", True)) == pytest.approx(20, abs=1e-6)
    assert swept(axes_along(tmp_path, "10", False)) == pytest.approx(340, abs=1e-6)
    for rollover in (None, True, False):
        assert swept(axes_along(tmp_path, "370", rollover)) == pytest.approx(20, abs=1e-6)
    for rollover in (None, False):
        assert swept(axes_along(tmp_path, "-10", rollover)) == pytest.approx(360, abs=1e-6)


@pytest.mark.parametrize("rollover", [None, True, False])
def test_dc_is_the_shorter_way_round_whatever_the_machine(
    tmp_path: Path, rollover: bool | None
) -> None:
    assert swept(axes_along(tmp_path, "=DC(10)", rollover)) == pytest.approx(20, abs=1e-6)
    assert swept(axes_along(tmp_path, "=AC(370)", rollover)) == pytest.approx(20, abs=1e-6)


def test_a_tool_axis_that_the_control_turns_evenly(tmp_path: Path) -> None:
    """ORIVECT and PATHCTRL VECTOR turn it in the plane of both axes, without points between."""
    blocks = "G0 X0 Y0 Z0 B40 C0\nG1 X50 C90\nM30\n"
    machine = Machine(head="CB")
    found, _ = cut(tmp_path, f"G71\nTRAORI\nORIVECT\n{blocks}", machine)
    assert len(found) == 2
    found, _ = cut(tmp_path, f"G71\nTRAORI\nORIAXES\n{blocks}", machine)
    assert len(found) > 10
    klartext = "BEGIN PGM A MM\nFUNCTION TCPM F TCP AXIS POS PATHCTRL VECTOR\n"
    klartext += "L X0 Y0 Z0 B40 C0 FMAX\nL X50 C90 F900\nEND PGM A MM\n"
    assert len(cut(tmp_path, klartext, machine)[0]) == 2


# ------------------------------------------------------------------------ what is said and asked


def test_what_is_assumed_is_said(tmp_path: Path) -> None:
    text = "G21\nG0 X0 Y0 Z30\nG1 X40\nA90\nM30\n"
    notes = program(tmp_path, text, Machine(table="A")).notes
    assert "A is taken as 0 in line 3, as no line before gives it" in notes
    assert (
        "rotary axes A carry the part; X, Y and Z are those of the slides of the machine" in notes
    )
    text = fanuc(*walk(MACHINES["laser head CB"], 1)).replace("M30", "G49\nG0 Z50\nM30")
    notes = program(tmp_path, text, Machine(head="CB", rollover=True)).notes
    assert "rotary axes CB carry the tool; X, Y and Z are those of the tip in the part" in notes


CB = Machine(head="CB")
TUBE = Machine(table="A")
FLAT = "G21\nG0 X0 Y0 Z0 B0 C0\nG1 X10 B10\n"
REFUSED = {
    "no machine": (None, FLAT, r'line 2: B: a rotary axis; say which .* machine = \{ head = "CB"'),
    "G43.4 and no machine": (None, "G21\nG43.4 H1\n", "line 2: G43.4: rotary axes; say which axes"),
    "Heidenhain, no machine": (None, "BEGIN PGM A MM\nL B+5 FMAX\n", "line 2: B: a rotary axis"),
    "another axis": (TUBE, FLAT, "line 2: B: machine has the rotary axes A; add it to head or"),
    "whose tip": (CB, FLAT, "line 3: say whether the control keeps the tip .* tcp = true or tcp"),
    "no pivot": (replace(CB, tcp=False), FLAT, "line 3: not under tool-centre-point .* pivot_mm"),
    "a tip on the axis": (TUBE, "G21\nG0 X0 Y0 Z0 A0\nG1 X9\nA90\n", "line 4: the tip is on the"),
    "a vector": (CB, "G21\nG43.5\nG0 X0 Y0 Z0 K1\nG1 X9\n", "line 3: machine: expected rotary"),
    "angles of the control": (CB, "G71\nTRAORI\nG0 X0 Y0 Z0\nG1 X9 A2=5\n", "line 4: A2: the"),
    "spatial angles": (CB, "BEGIN PGM A MM\nFUNCTION TCPM F TCP AXIS SPAT\n", "line 2: 'AXIS SPA"),
    "a hundred turns": (TUBE, "G21\nG0 X0 Y0 Z9\nG1 A99999\n", "line 3: A turns by 99999 deg in"),
    "an axis in the machine": (
        TUBE, "G21\nG0 X0 Y0 Z9\nG53 A0\nG0 X0 Y0 Z9\nG1 X9\n", "line 5: .* but A was not given"
    ),
    "a dwell that turns": (TUBE, "G21\nG0 X0 Y0 Z9\nG4 A5\n", "line 3: G4 with X, Y or Z"),
    "a turn on the spot": (
        CB, "G21\nG43.4\nG0 X0 Y0 Z0 B0\nG1 X9\nB40\nX20\n", "line 5: the same point as line 4 with"
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_every_fault_is_refused_in_one_line(tmp_path: Path, fault: str) -> None:
    machine, text, message = REFUSED[fault]
    with pytest.raises(InputError, match=message) as error:
        program(tmp_path, text, machine)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "head and table: expected the rotary axes"),
        ({"head": "CB", "table": "C"}, "head and table: expected the rotary axes"),
        ({"head": "CC"}, "head: expected one of A, B, C, AB"),
        ({"table": "a"}, "table: expected one of A, B, C, AB"),
        ({"head": "CB", "reversed": "A"}, "reversed: expected axes of CB, got 'A'"),
        ({"head": "CB", "tcp": "on"}, "tcp: expected True, False or None, got 'on'"),
        ({"head": "CB", "pivot": -1}, "pivot: must not be negative"),
    ],
)
def test_a_machine_that_cannot_be_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Machine(**given)


def test_the_machine_of_a_job_is_in_its_part(tmp_path: Path) -> None:
    file = tmp_path / "tube.nc"
    file.write_text("G21\nG0 X50 Y0 Z0 A0\nG1 A360 F9000\nM30\n")
    assert_refused(run("new", file), "machine = {", "--machine")
    assert_refused(run("new", file, "--machine", "{ table = 'D' }"), "part.machine.head: table:")
    assert_refused(run("new", file, "--machine", "A"), "--machine:1: not valid TOML")
    given = "{ table = 'A', centre_mm = [0, 0, -30], rollover = false, reversed = 'A' }"
    made = run("new", file, "--machine", given)
    assert made.returncode == 0, made.stderr
    machine = read_job(tmp_path / "tube.toml").drawing.machine
    assert machine is not None
    assert (machine.table, machine.head, machine.reversed) == ("A", "", "A")
    assert (machine.tcp, machine.rollover, machine.pivot) == (None, False, None)
    assert machine.centre == pytest.approx((0, 0, -0.03))
    assert run("contours", file, "--machine", given).returncode == 0
    assert run("script", tmp_path / "tube.toml", "-o", tmp_path / "tube.py").returncode == 0
    (call,) = [row for row in (tmp_path / "tube.py").read_text().splitlines() if "cad.read" in row]
    again = eval(call.removeprefix("part = "), {"cad": cad, "HERE": tmp_path})
    assert again.loops[0].length == read(file, machine=machine).loops[0].length
    (tmp_path / "points.csv").write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n9,0,0,0,0,1\n")
    assert_refused(
        run("contours", tmp_path / "points.csv", "--machine", given),
        "machine: expected a program of a machine, got a table",
    )
