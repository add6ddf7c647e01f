"""The library against what a second public source says of each robot, difference by difference."""

import tomllib

import numpy as np
import pytest

from conftest import ROOT
from kerfpath import robot
from kerfpath.robots import robot_ids

SAID = tomllib.loads((ROOT / "tests" / "data" / "second_source.toml").read_text())
LENGTH, ANGLE, SPEED = 0.06, 0.1, 0.6
"""mm, deg, deg/s: what sources round away."""


def differences(r, said):
    """Names of all that a source says otherwise than the library."""
    out = {
        key
        for key, mm in said.get("lengths_mm", {}).items()
        if abs(1000 * r.geometry[key] - mm) > LENGTH
    }
    for joint, ends in said.get("limits_deg", {}).items():
        i = int(joint) - 1
        ours = np.inf if r.lower is None else np.degrees([r.lower[i], r.upper[i]])
        if (np.abs(ours - np.array(ends)) > ANGLE).any():
            out.add(f"limits_{joint}")
    for i, speed in enumerate(said.get("velocity_deg_s", [])):
        if abs(np.degrees(r.velocity[i]) - speed) > SPEED:
            out.add(f"velocity_{i + 1}")
    if said.get("axis_3", r.axis_3) != r.axis_3:
        out.add("axis_3")
    if "axis_3_deg" in said:
        ours = [np.degrees([c.lower, c.upper]) for c in r.couplings]
        if not any((np.abs(o - np.array(said["axis_3_deg"])) <= ANGLE).all() for o in ours):
            out.add("axis_3_deg")
    return out


def test_every_robot_has_a_second_source():
    assert set(SAID) == set(robot_ids())
    assert all(sources for sources in SAID.values())


@pytest.mark.parametrize("name", robot_ids())
def test_every_value_that_differs_from_a_second_source_has_a_reason(name):
    r = robot(name)
    for said in SAID[name]:
        reasons = said.get("differs", {})
        assert differences(r, said) == set(reasons), said["source"]
        assert all(len(reason) >= len("rounded") for reason in reasons.values())
        # It is another source than the library's own.
        assert said["source"] not in r.sources.get("geometry_limits_velocity", "")


def test_what_was_found_wrong_by_it_is_mended():
    ar, mh = robot("yaskawa_ar2010"), robot("yaskawa_mh5")
    np.testing.assert_allclose(np.degrees(ar.lower[3:]), [-150, -135, -210])
    np.testing.assert_allclose(np.degrees(ar.upper[3:]), [150, 90, 210])
    assert mh.geometry["c4"] == 0.0865
    assert np.degrees(robot("abb_irb6640_185_280").velocity[4]) == pytest.approx(120)
    for name in robot_ids():
        if robot(name).manufacturer == "FANUC":
            (pendant,) = robot(name).couplings
            np.testing.assert_array_equal(pendant.row, [0, -1, 1, 0, 0, 0])
