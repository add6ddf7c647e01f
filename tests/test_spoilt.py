"""Every spoilt drawing gives a part, or one line that names the file; `spoilt.py` looks deeper."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spoilt

EXAMPLES = {".step": 60, ".iges": 40, ".dxf": 60, ".csv": 100, ".tsv": 50}
"""How many of each format: as many as a few seconds allow."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("spoilt")


@pytest.mark.parametrize("suffix", EXAMPLES)
def test_a_spoilt_drawing_gives_a_part_or_one_line(folder, suffix, capfd):
    whole = spoilt.drawings(folder / "whole")
    names = [name for name in whole if name.endswith(suffix) and len(whole[name]) < 60_000]

    @settings(max_examples=EXAMPLES[suffix], derandomize=True, deadline=None, database=None)
    @given(seed=st.integers(0, 2**32), name=st.sampled_from(names))
    def holds(seed, name):
        path = folder / name
        path.write_bytes(spoilt.spoil(whole[name], random.Random(seed)))
        assert spoilt.complaint(path) == ""
        assert capfd.readouterr().err == ""

    holds()


@pytest.mark.parametrize("name", ["plate.step", "pair.step", "plate.iges", "old.dxf", "points.csv"])
def test_a_drawing_cut_off_anywhere_gives_a_part_or_one_line(folder, name):
    whole = spoilt.drawings(folder / "whole")[name]
    path = folder / name
    for at in range(0, len(whole), len(whole) // 40):
        path.write_bytes(whole[:at])
        assert spoilt.complaint(path) == ""
