"""Rails and positioners of the library: every figure with a source, and what is not known asked."""

import tomllib
from importlib.resources import files

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kerfpath
from conftest import pose
from kerfpath import InputError, external
from kerfpath.robots import external_axes, external_ids

IDS = external_ids()
FIGURES = {"lower", "upper", "velocity", "acceleration"}
PLACE = pose([1.6, 0.2, 0.1], Rotation.from_euler("xyz", [3, -2, 40], degrees=True).as_matrix())


@pytest.mark.parametrize("name", IDS)
def test_every_entry_says_where_each_figure_comes_from(name):
    data = tomllib.loads((files("kerfpath.robots") / "externals" / f"{name}.toml").read_text())
    product = external(name)
    assert product.id == name == data["id"]
    assert product.payload > 0
    # Each kind of figure has a source if and only if there is such a figure.
    kinds = {"payload": "payload_kg", "geometry": "point_mm", "velocity": "velocity_"}
    kinds |= {"range": "lower_", "acceleration": "acceleration_"}
    keys = [*data, *(key for axis in data["axis"] for key in axis)]
    for kind, start in kinds.items():
        there = any(key.startswith(start) for key in keys)
        assert there == (not product.sources.get(kind, "none").startswith("none")), kind
    # What is not the maker's own is marked in its source, which can be looked up, and in a note.
    second = [source for source in product.sources.values() if source.startswith("secondary: ")]
    assert all(" @ " in source or "https://" in source for source in second)
    assert "secondary source" in product.notes[0]


@pytest.mark.parametrize("name", IDS)
def test_axes_of_a_product_are_in_order_and_placed_with_it(name, arm):
    product = external(name)
    given = {
        known.axis.name: {
            key: value
            for key, value in (
                ("lower", -1.0),
                ("upper", 1.0),
                ("velocity", 1.0),
                ("acceleration", 2.0),
            )
            if getattr(known, key) is None and not (known.endless and key in ("lower", "upper"))
        }
        for known in product.axes
    }
    made = arm.with_product(product, PLACE, given)
    assert [axis.name for axis in made.externals] == [known.axis.name for known in product.axes]
    assert [axis.name for axis in made.externals] in (["rail"], ["tilt", "table"])
    for axis, known in zip(made.externals, product.axes, strict=True):
        np.testing.assert_allclose(axis.axis, PLACE[:3, :3] @ known.axis.axis, atol=1e-12)
        there = PLACE[:3, :3] @ known.axis.point + PLACE[:3, 3]
        np.testing.assert_allclose(axis.point, there, atol=1e-12)
    for key in FIGURES:
        for i, known in enumerate(product.axes, 6):
            value = getattr(known, key)
            if value is not None:
                assert getattr(made, key)[i] == value
    # What no source says must be given, each in a line of its own.
    for axis, values in given.items():
        for key in values:
            less = given | {axis: {k: v for k, v in values.items() if k != key}}
            with pytest.raises(InputError, match=f"^{axis}: its {key} is not known .* give {key}"):
                arm.with_product(product, PLACE, less)


def test_a_tilted_table_turns_about_its_tilted_axis(arm):
    """The plate of a DKP-400, 347 mm above the tilt axis: where by hand it is after both turns."""
    free = {"acceleration": 1.0}
    made = arm.with_product(external("kuka_dkp400"), PLACE, {"tilt": free, "table": free})
    tilt, table = np.radians([30, 50])
    q = np.zeros(8)
    q[6:] = tilt, table
    height, out = (
        np.array([0, 0, 0.51]),
        np.array([0.2, 0, 0.347]),
    )  # of the tilt axis; on the plate
    spun = Rotation.from_rotvec([0, 0, table]).apply(out)
    tilted = Rotation.from_rotvec([tilt, 0, 0]).apply(spun) + height
    T = kerfpath.robots.carried(made.externals, q[6:], "part")
    at_zero, now = (PLACE @ [*p, 1.0] for p in (out + height, tilted))
    np.testing.assert_allclose(T @ at_zero, now, atol=1e-12)


def test_axes_have_the_names_that_jobs_call_them():
    assert list(external_axes()) == [
        "kuka_dkp400.tilt",
        "kuka_dkp400.table",
        "kuka_kl1000_2",
        "kuka_kl4000",
        "kuka_kp2_hv1100.tilt",
        "kuka_kp2_hv1100.table",
    ]


def test_an_unknown_product_and_an_unknown_axis_are_refused(arm):
    with pytest.raises(InputError, match=r"'kuka_dkp40' is not in the library of 4 rails and"):
        external("kuka_dkp40")
    with pytest.raises(InputError, match=r"kuka_kl4000: it has no external axis 'tilt'; .* rail"):
        arm.with_product(external("kuka_kl4000"), PLACE, {"tilt": {"acceleration": 1.0}})
