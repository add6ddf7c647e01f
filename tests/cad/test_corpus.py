"""Drawings of the benchmark's generator, whose loops are known, are read as they are."""

from __future__ import annotations

from pathlib import Path

from benchmarks._corpus import corpus
from benchmarks.corpus import faults_of
from OCP.Message import Message
from tests.cad.test_part import plate, write_step

from kerfpath.cad import read


def test_a_drawing_of_every_family_and_format_is_read_right(tmp_path: Path) -> None:
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    faults = {known.path.name: faults_of(known) for known in corpus(tmp_path, seeds=1)}
    assert {Path(name).suffix for name in faults} == {".dxf", ".step", ".iges", ".csv"}
    assert {name: fault for name, fault in faults.items() if fault} == {}


def test_progress_goes_from_the_file_to_the_sides(tmp_path: Path) -> None:
    said: list[tuple[str, int, int]] = []
    read(write_step(tmp_path / "plate.step", plate()), progress=lambda *state: said.append(state))
    assert said[0] == ("reading plate.step", 0, 0)
    assert said[1:-1] == [("looking for loops", k, 8) for k in range(1, 9)]
    assert said[-1] == ("looking for the sides of sheets", 0, 0)
