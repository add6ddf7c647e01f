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
HOUSES = {
    container: contract["layers"]
    for contract in PROJECT["tool"]["importlinter"]["contracts"]
    if contract["type"] == "layers"
    for container in contract["containers"]
}


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
def test_a_module_stays_under_400_lines_and_keeps_the_house_rules(source):
    text = source.read_text()
    assert len(text.splitlines()) <= 400
    assert not re.search(r"fastmath *= *True|prange|except Exception|except:", text)
    if "cli" not in source.parts:
        assert not re.search(r"(?<![\w.])print\(", text)
    if "kernels" not in source.parts:
        assert not re.search(r"^\s*(import|from) numba", text, re.MULTILINE)


def drawn_layers(container):
    """The layers of one drawing in CONTRIBUTING.md; deeper lines are words about the one above."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    (drawing,) = re.findall(rf"^Inside `{container}`.*\n\n((?: {{4}}.*\n)+)", text, re.MULTILINE)
    return [
        re.split(" {2,}", line)[0] for line in re.findall(r"^ {4}(\S.*)$", drawing, re.MULTILINE)
    ]


@pytest.mark.parametrize("container", HOUSES)
def test_the_drawing_of_the_house_has_the_layers_of_its_contract(container):
    drawn = [set(layer.split(" | ")) for layer in drawn_layers(container)]
    assert drawn == [set(layer.split(" | ")) for layer in HOUSES[container]]


PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NOT_USED = {
    r"\b(air moves?|moves? through the air)\b": "transfer move",
    r"\b(dips|dipped|dipping|a dip)\b": "feed reduction",
    r"\b(told|tells?)\b": "said, printed, reported, listed",
    r"\bled (to|out)\b": "moved to",
    r"\bof a rail m\b": "a rail is in m",
    r"\bgiv(e|es|ing) way\b": "relax a limit",
    r"\b(unrolled|unwrapped)\b": "not wrapped",
}
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text()


def require_chosen_words(text, where):
    """Code keeps its names: blocks, and spans between backticks, are left out."""
    prose = re.sub(r"```.*?```|`[^`\n]*`|^ {4}.*$", "", text, flags=re.DOTALL | re.MULTILINE)
    prose = re.sub(r"\s+", " ", prose)
    for pattern, instead in NOT_USED.items():
        found = re.search(rf".{{0,40}}{pattern}.{{0,40}}", prose, re.IGNORECASE)
        assert found is None, f"{where}: {found[0]!r}; write {instead}"


@pytest.mark.parametrize("page", PAGES, ids=lambda f: str(f.relative_to(ROOT)))
def test_a_page_uses_the_words_of_the_glossary(page):
    require_chosen_words(page.read_text().partition("## Words that are not used")[0], page.name)


def test_the_help_of_every_command_uses_the_words_of_the_glossary():
    from typer.main import get_command

    from kerfpath.cli._studies import app

    for name, command in get_command(app).commands.items():
        require_chosen_words(command.help or "", name)
        for parameter in command.params:
            require_chosen_words(getattr(parameter, "help", None) or "", f"{name} {parameter.name}")


def test_the_glossary_lists_every_word_that_is_not_used():
    words = GLOSSARY.partition("## Words that are not used")[2]
    assert all(re.search(pattern, words) for pattern in NOT_USED)


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
