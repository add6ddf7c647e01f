"""The example parts: drawings as modelled, and jobs that plan whole parts with a passing audit."""

import json
import re
import shutil

import numpy as np
import pytest

from commands import run
from conftest import ROOT
from kerfpath.cad import read

PARTS = ROOT / "examples" / "parts"


@pytest.mark.parametrize("name", ["bracket.step", "tube.step", "beam.step", "blank.dxf"])
def test_the_shipped_drawings_are_what_the_script_models(examples, tmp_path, name):
    shape = getattr(examples, name.removesuffix(".step"), None)
    if shape is None:
        examples.write_blank(tmp_path / name)
    else:
        examples.write_step(tmp_path / name, shape())
    made, kept = (read(folder / name).loops for folder in (tmp_path, PARTS))
    assert [(a.name, a.kind, a.side, a.edges) for a in made] == [
        (b.name, b.kind, b.side, b.edges) for b in kept
    ]
    # 1 um: what the intersector of another version of OCCT may be off.
    np.testing.assert_allclose([a.length for a in made], [b.length for b in kept], atol=1e-6)


# The job, its gamma step, a coarser one that does, the contours, and those that come last.
JOBS = [
    ("bracket", 3, 4, 4, {"trim"}),
    ("tube", 10, 15, 10, set()),
    ("blank", 5, 15, 7, {"trim"}),
    ("turned_tube", 3, 6, 9, set()),
    ("beam", 3, 6, 3, set()),
    ("table_tube", 3, 6, 8, set()),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "step", "coarser", "contours", "last"), JOBS)
def test_an_example_part_is_planned_audited_and_written(
    tmp_path, name, step, coarser, contours, last
):
    for file in (PARTS / f"{name}.toml", *PARTS.glob("*.step"), *PARTS.glob("*.dxf")):
        shutil.copy(file, tmp_path)
    job = tmp_path / f"{name}.toml"
    text = job.read_text()
    assert f"gamma_step_deg = {step}\n" in text
    text = text.replace(f"gamma_step_deg = {step}\n", f"gamma_step_deg = {coarser}\n")
    suffix = ".src" if 'language = "krl"' in text else ".mod"
    # What is proved of them has tests of its own, and takes as long as all the rest.
    text = text.replace("[plan]\n", "[plan]\ncertify = false\n")
    if name == "tube":  # half a minute of distances to its walls; the bracket has a cell, too
        text = re.sub(r"\[cell\].*(?=\[program\])", "", text, flags=re.DOTALL)
    job.write_text(text)
    result = run("plan", str(job), "--out", str(tmp_path / "out"), "--json")
    assert result.returncode == 0, result.stdout + result.stderr
    said = json.loads(result.stdout)
    assert said["passed"]
    names = [entry["name"] for entry in said["contours"]]
    assert len(names) == contours
    assert not last or names[-1] in last
    assert len(said["sequence"]["moves"]) == contours + 1  # from home and back to it
    assert (tmp_path / "out" / f"{name}{suffix}").exists()


def test_the_page_of_whole_parts_lists_every_example():
    page = (PARTS.parent.parent / "docs" / "whole-part.md").read_text(encoding="utf-8")
    assert all(f"examples/parts/{job.name}" in page for job in PARTS.glob("*.toml"))
