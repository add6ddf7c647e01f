"""A drawing that was read before is the same part, wherever its file lies; an edited one is not."""

import numpy as np

from jobs import DEMO
from kerfpath.cad import read
from kerfpath.cad import reading as module


def test_the_same_content_is_the_same_part_by_its_own_name(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_cache", {})
    first = read(DEMO / "b_pillar.step")
    (tmp_path / "copy.step").write_bytes((DEMO / "b_pillar.step").read_bytes())
    monkeypatch.setattr(module, "call_apart", None)  # it is not read again
    again = read(tmp_path / "copy.step")
    assert again.path == tmp_path / "copy.step"
    assert again.loops is first.loops
    coarse, fine, same = (again.mesh(d)[0] for d in (2e-3, 1e-3, 2e-3))
    assert len(coarse) < len(fine)
    assert np.array_equal(coarse, same)


def test_another_unit_or_another_content_is_another_part(tmp_path):
    text = (DEMO / "b_pillar.step").read_text()
    (tmp_path / "part.step").write_text(text)
    size = np.ptp(read(tmp_path / "part.step").bounding_box, axis=0)
    inches = np.ptp(read(tmp_path / "part.step", "in").bounding_box, axis=0)
    np.testing.assert_allclose(inches, 25.4 * size, rtol=1e-7)  # of boxes of curves
    (tmp_path / "part.step").write_text(text.replace("MILLI", "CENTI"))
    other = np.ptp(read(tmp_path / "part.step").bounding_box, axis=0)
    assert not np.allclose(other, size)


def test_no_more_parts_are_cached_than_that(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_cache", {})
    monkeypatch.setattr(module, "CACHED", 1)
    for unit in (None, "in"):
        read(DEMO / "b_pillar.step", unit)
    assert [key[2] for key in module._cache] == ["in"]
