"""Every public data object says what it is in a line, however large it is."""

import dataclasses
import importlib
import pkgutil
import shutil
from collections.abc import Mapping

import numpy as np
import pytest

import kerfpath
from jobs import DEMO, SMALL
from kerfpath.arrays import LONGEST, short_repr
from kerfpath.cad import read
from kerfpath.cell import Cell
from kerfpath.job import read_job, run_job
from kerfpath.job.format.cell import cell_of_job

MOST = 300


def needs_its_extra(package):
    """What cannot be imported here; it has no data objects."""
    assert package in ("kerfpath.compas", "kerfpath.robodk")


def public_classes():
    found = {}
    for module in pkgutil.walk_packages(kerfpath.__path__, "kerfpath.", needs_its_extra):
        inner = module.name.split(".")[1:]
        # Public is what packages list; the kernels' tuples of arrays are nobody's to print.
        if not (module.ispkg or len(inner) == 1) or inner[0] in (
            "cli",
            "compas",
            "kernels",
            "robodk",
        ):
            continue
        for value in vars(importlib.import_module(module.name)).values():
            if (
                isinstance(value, type)
                and dataclasses.is_dataclass(value)
                and value.__name__[0] != "_"
                and value.__module__.startswith("kerfpath.")
            ):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return found


PUBLIC = public_classes()


def filled(cls):
    """An instance that nobody would build, with every field as large as it comes."""
    made = object.__new__(cls)
    for field in dataclasses.fields(cls):
        large = {"name": "x" * 5000, "id": "y" * 5000, "notes": ("z" * 500,) * 30}
        value = large.get(field.name, np.zeros((5000, 6)))
        object.__setattr__(made, field.name, value)
    return made


@pytest.mark.parametrize("name", PUBLIC)
def test_a_class_with_room_for_much_says_little(name):
    """The generated repr of a dataclass prints all that it holds."""
    cls = PUBLIC[name]
    generated = cls.__repr__.__qualname__.startswith("__create_fn__") or hasattr(
        cls.__repr__, "__wrapped__"
    )
    if generated:
        # Nothing but numbers and words of a list fits in.
        assert len(dataclasses.fields(cls)) <= 8
        for field in dataclasses.fields(cls):
            kinds = set(str(field.type).replace("|", " ").replace("np.", "").split())
            assert kinds <= {"float", "int", "bool", "None", "Level", "Signal", "Unit"} or (
                str(field.type).startswith("Literal")
            ), f"{name}.{field.name}: {field.type}; write __repr__ = short_repr"
    elif cls.__repr__ is short_repr:
        assert len(repr(filled(cls))) < MOST


def objects_in(thing, seen):
    """All data objects that hang on one."""
    if id(thing) in seen or isinstance(thing, np.ndarray | str | bytes | int | float):
        return
    seen[id(thing)] = thing
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        yield thing
        for field in dataclasses.fields(thing):
            yield from objects_in(getattr(thing, field.name), seen)
    elif isinstance(thing, Mapping):
        for value in thing.values():
            yield from objects_in(value, seen)
    elif isinstance(thing, tuple | list):
        for value in thing:
            yield from objects_in(value, seen)


def test_what_a_job_comes_to_is_said_in_lines(tmp_path):
    shutil.copy(DEMO / "b_pillar.step", tmp_path)
    (tmp_path / "job.toml").write_text(SMALL)
    job = read_job(tmp_path / "job.toml")
    outcome = run_job(job)
    part = read(job.part_file)
    kinds = {}
    for thing in objects_in((outcome, part), {}):
        kinds.setdefault(type(thing).__name__, []).append(repr(thing))
    results = {"JobResult", "CutResult", "CutRequest", "Candidate"}
    assert results | {"Job", "Plan", "Contour", "Robot", "LayeredGraph", "Part"} <= set(kinds)
    longest = {name: max(map(len, said)) for name, said in kinds.items()}
    assert max(longest.values()) < MOST, longest
    assert all("\n" not in line for said in kinds.values() for line in said)
    (plan, *_) = outcome.plans
    assert repr(plan).startswith(f"Plan({plan.name!r}, {len(plan.q)} nodes, ")
    assert f", gap {plan.proof.gap_shown} %, " in repr(plan)
    assert repr(plan.robot).startswith("Robot('abb_irb4600_60_205', ABB IRB 4600")
    assert repr(part) == "Part('b_pillar.step', 54 faces, 122 loops, 1200.0 x 325.2 x 116.8 mm)"


def test_a_cell_says_how_much_it_judges():
    job = read_job(DEMO / "b_pillar_cell.toml")
    cell = cell_of_job(job, read(job.part_file))
    assert isinstance(cell, Cell)
    assert repr(cell).startswith(f"Cell({len(cell.bodies)} bodies, {len(cell.pairs)} pairs judged")


def test_few_things_are_shown_and_many_are_counted():
    @dataclasses.dataclass
    class Thing:
        numbers: np.ndarray
        table: np.ndarray
        names: tuple[str, ...]
        share: float
        nothing: None = None

        __repr__ = short_repr

    thing = Thing(np.arange(3.0), np.zeros((700, 6)), ("a", "b"), 1 / 3)
    assert (
        repr(thing)
        == "Thing(numbers=[0, 1, 2], table=array 700 x 6, names=('a', 'b'), share=0.333333)"
    )
    assert "names=900 x str" in repr(dataclasses.replace(thing, names=("a",) * 900))
    assert len(repr(dataclasses.replace(thing, names="x" * 10**6))) < LONGEST
