"""Which side of a sheet is the outer one: by its shape, however it lies and whatever is cut in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape
from tests.cad.sheets import OUTER, PROFILES, rim_point, sheet, sunk
from tests.cad.test_part import write_step

from jobs import ROBOT_AND_HEAD
from kerfpath.cad import Part, read
from kerfpath.errors import InputError
from kerfpath.job import read_job

ON = 1e-5
"""m: a contour passes a point of its own side within its chords, one of the other at the wall."""


def turned(shape: TopoDS_Shape, seed: int) -> tuple[TopoDS_Shape, gp_Trsf]:
    """Return a shape turned and moved at random, and how."""
    rng = np.random.default_rng(seed)
    turn, move = gp_Trsf(), gp_Trsf()
    axis = gp_Dir(*rng.normal(size=3).tolist())
    turn.SetRotation(gp_Ax1(gp_Pnt(), axis), float(rng.uniform(0, 2 * np.pi)))
    move.SetTranslation(gp_Vec(*rng.uniform(-500, 500, 3).tolist()))
    both = move.Multiplied(turn)
    return shape.Moved(TopLoc_Location(both)), both


def distance(part: Part, side: str, at: np.ndarray) -> float:
    (trim,) = part.pick(kind="outer", side=side)
    points = part.contour(trim.name).points
    start, way = points[:-1], np.diff(points, axis=0)
    t = np.clip(((at - start) * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
    return float(np.linalg.norm(start + t[:, None] * way - at, axis=1).min())


def moved(point: np.ndarray, how: gp_Trsf) -> np.ndarray:
    p = gp_Pnt(*(point * 1000).tolist()).Transformed(how)
    return np.array([p.X(), p.Y(), p.Z()]) / 1000


@pytest.mark.slow
@pytest.mark.parametrize("sunk_from", ["", "left", "right"])
@pytest.mark.parametrize("name", PROFILES)
def test_the_outer_side_is_that_of_the_shape(tmp_path: Path, name: str, sunk_from: str) -> None:
    """Holes with countersinks from either side make its rims longer, and change nothing."""
    profile = PROFILES[name]
    shape = sheet(profile)
    if sunk_from:
        shape = sunk(shape, profile, sunk_from, 4)
    for seed in range(2):
        lying, how = turned(shape, seed)
        part = read(write_step(tmp_path / f"{seed}.step", lying))
        other = {"left": "right", "right": "left"}[OUTER[name]]
        mine = moved(rim_point(profile, OUTER[name]), how)
        theirs = moved(rim_point(profile, other), how)
        assert distance(part, "outer", mine) < ON
        assert distance(part, "inner", theirs) < ON
        assert not any("not certain" in note for note in part.notes)


def test_of_a_z_it_is_not_certain_and_can_be_said(tmp_path: Path) -> None:
    profile = (40.0, 90.0, 40.0, -90.0, 40.0)
    path = write_step(tmp_path / "z.step", sheet(profile))
    part = read(path)
    (note,) = (note for note in part.notes if "not certain" in note)
    assert note.startswith("skin")
    assert "outer_towards" in note
    # The flats of either side face +z and -z; the middle one is upright.
    for towards, side in (((0, 0, 1), "left"), ((0, 0, -2), "right")):
        said = read(path, outer_towards=towards)
        assert distance(said, "outer", rim_point(profile, side)) < ON
        assert said.notes == ()


def test_a_direction_turns_a_sheet_over_that_faces_it(tmp_path: Path) -> None:
    profile = PROFILES["U"]
    path = write_step(tmp_path / "u.step", sheet(profile))
    outward = (-1.0, 0.0, 0.0)  # the back of the U faces +x: said the other way round
    assert distance(read(path), "outer", rim_point(profile, "right")) < ON
    assert distance(read(path, outer_towards=outward), "outer", rim_point(profile, "left")) < ON
    # Its legs face +z and -z alike, which says nothing: the shape decides.
    same = read(path, outer_towards=(0, 1, 0))
    assert distance(same, "outer", rim_point(profile, "right")) < ON


@pytest.mark.parametrize(
    ("name", "towards", "words"),
    [
        ("u.step", (0, 0, 0), "expected a direction"),
        ("u.step", (0, 1), "outer_towards: expected shape"),
        ("u.step", (0, np.nan, 1), "outer_towards"),
        ("line.csv", (0, 0, 1), "expected a drawing of sheets, got a table"),
    ],
)
def test_a_direction_that_says_nothing_is_refused(
    tmp_path: Path, name: str, towards: tuple[float, ...], words: str
) -> None:
    if name == "u.step":
        write_step(tmp_path / name, sheet(PROFILES["U"]))
    else:
        (tmp_path / name).write_text("x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,1\n9,0,0,0,0,1\n")
    with pytest.raises(InputError, match=words):
        read(tmp_path / name, outer_towards=towards)


def test_a_job_says_it_too(tmp_path: Path) -> None:
    profile = (40.0, 90.0, 40.0, -90.0, 40.0)
    write_step(tmp_path / "z.step", sheet(profile))
    (tmp_path / "job.toml").write_text(
        ROBOT_AND_HEAD + '[part]\nfile = "z.step"\nxyz_mm = [1200, 0, 400]\nrpy_deg = [0, 0, 0]\n'
        "outer_towards = [0, 0, -1]\ngap_mm = 0.02\n"
        '[[contour]]\npick = "skin1/outer"\nspeed_m_min = 2\nspacing_mm = 2\n'
    )
    job = read_job(tmp_path / "job.toml")
    assert job.drawing.gap == pytest.approx(2e-5)
    assert distance(job.read_part(), "outer", rim_point(profile, "right")) < ON
