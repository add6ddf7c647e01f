"""Nodes at the ends of bends, between which the tool axis turns evenly."""

from __future__ import annotations

import numpy as np
import pytest

import kerfpath
from kerfpath.contour import angle_between, slerp
from kerfpath.errors import InputError
from kerfpath.job import prepare, read_job, run_prepared

JOB = """\
[robot]
model = "abb_irb4600_60_205"
endless = [6]
acceleration_ratio = "iontec_20_to_70kg"
[tool]
head = "laser-head-45"
[part]
file = "bent.csv"
xyz_mm = [1200, 0, 600]
rpy_deg = [0, 0, 0]
[[contour]]
pick = "contour"
speed_m_min = 1
spacing_mm = 2
[plan]
gamma_step_deg = 20
method = "exact"
refine = false
certify = false
feed = "dip"
[program]
language = "none"
"""


def bent(radius: float, angle: float, flats: tuple[float, float]) -> tuple[kerfpath.Contour, list]:
    """A cut across a bend of a sheet, in m: flat, arc, flat; and the places of the arc's ends."""
    arc = radius * angle
    s = np.concatenate([[0.0], flats[0] + np.linspace(0, arc, 400), [flats[0] + arc + flats[1]]])
    turn = np.clip((s - flats[0]) / radius, 0, angle)
    before, after = np.minimum(s - flats[0], 0), np.maximum(s - flats[0] - arc, 0)
    x = before + radius * np.sin(turn) + after * np.cos(angle)
    z = radius * (np.cos(turn) - 1) - after * np.sin(angle)
    points = np.column_stack([x, 0 * s, z])
    axes = -np.column_stack([np.sin(turn), 0 * s, np.cos(turn)])
    return kerfpath.Contour(points, axes, closed=False), [flats[0], flats[0] + arc]


@pytest.mark.parametrize("seed", range(20))
def test_the_ends_of_a_bend_are_nodes_where_asked_for(seed):
    """Between nodes the axis turns evenly: across the end of a bend it would leave the normal."""
    random = np.random.default_rng(seed)
    radius, angle = random.uniform(1e-3, 12e-3), random.uniform(0.5, np.pi / 2)
    contour, ends = bent(radius, angle, tuple(random.uniform(0.01, 0.05, 2)))
    assert contour.s[contour.bend_ends] == pytest.approx(ends, abs=1e-4 * radius)
    errors = []
    for keeps in (False, True):
        nodes = contour.resample(spacing=2e-3, bend_ends=keeps)
        steps = np.diff(nodes.s)
        assert steps.max() <= 2e-3 * (1 + 1e-9)
        assert steps.min() >= 0.8 * steps.max() * (1 - 1e-9)
        k = np.clip(np.searchsorted(nodes.s, contour.s, side="right") - 1, 0, len(nodes) - 2)
        part = ((contour.s - nodes.s[k]) / steps[k])[:, None]
        errors.append(angle_between(slerp(nodes.axes[k], nodes.axes[k + 1], part), contour.axes))
    assert errors[1].max() < 1e-3  # the digits of the places, and arcs cut to chords
    assert errors[0].max() > 0.02 * 2e-3 / radius
    timed = contour.resample(dt=0.04, speed=0.05, bend_ends=True)
    for end in ends:
        assert np.abs(timed.s - end).min() < 1e-4 * radius


def test_an_axis_that_turns_evenly_or_not_at_all_has_no_ends_of_bends():
    angle = np.linspace(0, 2 * np.pi, 400)
    circle = 0.02 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    flat = kerfpath.Contour(circle[:-1], np.tile([0, 0, -1.0], (399, 1)), closed=True)
    assert not len(flat.bend_ends)
    inward = kerfpath.Contour(circle[:-1], -circle[:-1], closed=True)
    assert not len(inward.bend_ends)
    with pytest.raises(InputError, match=r"bend_ends: nodes are kept only with spacing= or dt="):
        inward.resample(count=20, bend_ends=True)


def test_a_job_with_a_narrow_bend_has_nodes_at_its_ends_instead_of_many(tmp_path):
    """Nodes evenly spaced over a radius of 3 mm would have to be 0.2 mm apart for 1 deg."""
    contour, ends = bent(3e-3, np.pi / 2, (0.03, 0.02))
    rows = np.hstack([contour.points * 1e3, -contour.axes])
    lines = [",".join(f"{value:.9f}" for value in row) for row in rows]
    (tmp_path / "bent.csv").write_text("\n".join(["x_mm,y_mm,z_mm,nx,ny,nz", *lines, ""]))
    (tmp_path / "bent.toml").write_text(JOB)
    prepared = prepare(read_job(tmp_path / "bent.toml"))
    (request,) = prepared.contours
    assert "at the ends of bends, too, so that the path between its nodes" in request.closer
    nodes = request.candidates[0].nodes
    assert len(nodes) < 120
    for end in ends:
        assert np.abs(nodes.s - end).min() < 1e-6
    (cut,) = run_prepared(prepared).cuts
    rows = {row.code: row for row in cut.checks}
    assert rows["axis-between-nodes"].ok
    assert rows["tip-between-nodes"].ok
