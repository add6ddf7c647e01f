"""NOTICE names what is under a GNU licence, and what is vendored; it goes into the wheel."""

import re
import tomllib
from importlib.metadata import metadata

import pytest

from conftest import ROOT

NOTICE = (ROOT / "NOTICE").read_text()
PINNED = re.findall(r"^([\w.-]+)==", (ROOT / "requirements" / "run.txt").read_text(), re.MULTILINE)
IN_WHEELS = {"cadquery-ocp-novtk": "Open CASCADE", "numpy": "libquadmath", "scipy": "libgfortran"}
"""Packages whose metadata does not say which licences their wheels contain."""


def licence(package: str) -> str:
    """The licence that a package states, in a word, or by the classifiers of the index."""
    facts = metadata(package)
    stated = facts.get("License-Expression") or facts.get("License") or ""
    kinds = [each for each in facts.get_all("Classifier") or [] if each.startswith("License")]
    return " ".join([stated.split("\n")[0], *kinds])


def test_packages_under_gnu_licences_are_named():
    installed = [name for name in PINNED if name != "colorama"]  # of Windows
    gnu = {name for name in installed if re.search(r"GPL|GNU", licence(name))}
    assert "moocore" in gnu
    assert all(re.search(rf"\b{name}\b", NOTICE) for name in gnu)


@pytest.mark.parametrize("package", IN_WHEELS)
def test_packages_whose_wheels_contain_such_are_named(package):
    assert package in PINNED
    assert package in NOTICE
    assert IN_WHEELS[package] in NOTICE


def test_what_is_vendored_is_named_and_has_its_licence():
    vendor = ROOT / "src" / "kerfpath" / "studio" / "client" / "vendor"
    for folder in (each for each in vendor.iterdir() if each.is_dir()):
        assert folder.name in NOTICE.lower()
        assert (folder / "LICENSE").exists()


def test_it_goes_into_the_wheel():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["license-files"] == ["LICENSE", "NOTICE"]
