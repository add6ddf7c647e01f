"""The rules of the house that a machine can check."""

import importlib
import re
import subprocess
import sys
import tomllib

import pytest

from conftest import ROOT
from kerfpath.kernels import EQUATIONS

SOURCES = sorted((ROOT / "src").rglob("*.py"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
(LAYERS,) = (
    contract["layers"]
    for contract in PROJECT["tool"]["importlinter"]["contracts"]
    if contract["type"] == "layers" and contract["containers"] == ["kerfpath"]
)


def test_every_numbered_equation_of_the_paper_is_in_the_index():
    assert sorted(EQUATIONS) == list(range(1, 17))


@pytest.mark.parametrize("number", sorted(EQUATIONS))
def test_an_equation_is_where_the_index_says_and_only_there(number):
    module, _, name = EQUATIONS[number].partition(":")
    found = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    lines = [line.strip() for line in found.__doc__.splitlines()]
    assert f"(Eq. {number})" in " ".join(lines[:2])
    mentions = [f for f in SOURCES for _ in re.findall(rf"\(Eq\. {number}\)", f.read_text())]
    assert [f.stem for f in mentions] == [module.rpartition(".")[2]]


@pytest.mark.parametrize("number", sorted(EQUATIONS))
def test_every_equation_has_a_test_that_names_it(number):
    tests = "".join(f.read_text() for f in (ROOT / "tests").rglob("test_*.py"))
    assert f"@pytest.mark.equation({number})" in tests


@pytest.mark.parametrize("source", SOURCES, ids=lambda f: str(f.relative_to(ROOT)))
def test_a_module_keeps_the_house_rules(source):
    text = source.read_text()
    assert not re.search(r"fastmath *= *True|prange|except Exception|except:", text)
    if "cli" not in source.parts:
        assert not re.search(r"(?<![\w.])print\(", text)
    if "kernels" not in source.parts:
        assert not re.search(r"^\s*(import|from) numba", text, re.MULTILINE)


def test_the_drawing_of_the_layers_is_their_contract():
    """Lines of the drawing that are deeper are words about the one above."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    (drawing,) = re.findall(r"^Inside `kerfpath`:\n\n((?: {4}.*\n)+)", text, re.MULTILINE)
    lines = re.findall(r"^ {4}(\S.*)$", drawing, re.MULTILINE)
    names = [re.match(r"\w+(?: \| \w+)*", line).group() for line in lines]
    drawn = [set(name.split(" | ")) for name in names]
    assert drawn == [set(layer.split(" | ")) for layer in LAYERS]


GLOSSARY = (ROOT / "docs" / "glossary.md").read_text()


@pytest.mark.parametrize("name", sorted(set(re.findall(r"`(kerfpath\.[\w.]+)`", GLOSSARY))))
def test_a_name_in_the_glossary_is_there(name):
    thing, path = importlib.import_module("kerfpath"), "kerfpath"
    for part in name.split(".")[1:]:
        path = f"{path}.{part}"
        if not hasattr(thing, part) and part not in getattr(thing, "__dataclass_fields__", {}):
            importlib.import_module(path)
        thing = getattr(thing, part, None)


def test_asking_for_help_does_not_load_the_kernels():
    code = "import kerfpath.cli, sys; sys.exit('numba' in sys.modules or 'OCP' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_jobs_load_what_only_models_and_cells_need_when_they_have_them():
    code = "import kerfpath.job, sys; sys.exit(bool({'OCP', 'scipy.stats'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_public_name_loads():
    import kerfpath

    for name in kerfpath.__all__:
        assert getattr(kerfpath, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = kerfpath.nonsense
