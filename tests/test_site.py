"""The site: every page is in its contents, and what its pages load is their own."""

import importlib
import re
import shutil
import tomllib

import numpy as np
import pytest

import kerfpath
import own_host
from conftest import ROOT
from kerfpath.job import prepare, read_job
from kerfpath.job.format.tables import TABLES, JobFile
from kerfpath.kernels import EQUATIONS
from kerfpath.post import languages
from kerfpath.robots import external, external_ids, robot, robot_ids
from reference import api, commands, equations, job_keys, library

DOCS = ROOT / "docs"


def bare(markdown):
    """Markdown without the marks that the generated pages set."""
    return re.sub(r"[`\\]", "", markdown)


def bare_code(cell):
    """The text of a cell that is code."""
    return cell.removeprefix("`").removesuffix("`")


def contents_of(page):
    """The pages that the tables of contents of a page lead to, directly and through those."""
    trees = re.findall(r"^```\{toctree\}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    for line in "\n".join(trees).splitlines():
        if line and not line.startswith(":"):
            entry = re.sub(r".*<(.*)>", r"\1", line)
            found = (page.parent / f"{entry}.md").resolve()
            yield found
            yield from contents_of(found)


def test_every_page_of_docs_is_in_the_contents_once():
    listed = [page for page in contents_of(DOCS / "index.md") if page.is_relative_to(DOCS)]
    assert sorted(listed) == sorted(set(DOCS.rglob("*.md")) - {DOCS / "index.md"})


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.html", '<script src="https://cdn.example/a.js"></script>'),
        ("a.html", '<link rel="stylesheet" href="//fonts.example/a.css">'),
        ("a.html", '<img src="http://img.example/a.png">'),
        ("a.html", "<style>@import 'https://fonts.example/a.css';</style>"),
        ("a.html", '<p style="background: url(https://img.example/a.png)">'),
        ("a.html", "<script>fetch('https://api.example/a')</script>"),
        ("a.svg", '<svg><image xlink:href="https://img.example/a.png"/></svg>'),
        ("a.css", "@font-face { src: url(//fonts.example/a.woff2) }"),
        ("a.js", 'new WebSocket("wss://api.example/")'),
    ],
)
def test_what_a_page_would_load_from_another_host_is_found(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    (address,) = own_host.foreign_in(tmp_path / name)
    assert ".example/" in address
    assert own_host.main(tmp_path) == 1


def test_links_to_follow_and_files_of_the_site_are_no_finding(tmp_path):
    page = '<a href="https://a.example/"><img src="_images/a.png"><script src="a.js"></script></a>'
    (tmp_path / "a.html").write_text(page)
    (tmp_path / "a.js").write_text(
        '// https://a.example/\nfetch("a.json"); "http://www.w3.org/2000/svg"'
    )
    assert own_host.main(tmp_path) == 0


def test_a_site_without_pages_is_refused(tmp_path):
    assert own_host.main(tmp_path) == 1


def test_the_page_of_commands_has_every_command_with_its_options_and_their_help():
    page = commands.page()
    sections = dict(re.findall(r"^## kerfpath (\S+)\n(.*?)(?=^## |\Z)", page, re.M | re.S))
    assert list(sections) == list(commands.program().commands)
    for name, command in commands.program().commands.items():
        text = bare(sections[name])
        assert bare(command.help.partition("\n")[0]) in text
        for parameter in command.params:
            assert f"| {parameter.metavar or parameter.name} |" in text or all(
                option in text for option in parameter.opts
            )
            assert bare(parameter.help) in text, parameter.name


SHOWN = [
    (page, line)
    for page in sorted(DOCS.rglob("*.md"))
    for line in re.findall(r"^ {4}kerfpath (\S.*)$", page.read_text(), re.MULTILINE)
]


@pytest.mark.parametrize(("page", "line"), SHOWN, ids=[f"{p.stem}: {n}" for p, n in SHOWN])
def test_a_command_that_a_page_shows_exists_with_its_options(page, line):
    name, *words = line.partition(" #")[0].split()
    options = {option for each in commands.program().commands[name].params for option in each.opts}
    assert {word for word in words if word.startswith("-")} <= options


@pytest.fixture(scope="module")
def sections_of_products():
    """What the page of the library says of each product, by its anchor."""
    _, *sections = re.split(r"^\((.+)\)=$", library.page(), flags=re.MULTILINE)
    return dict(zip(sections[::2], map(bare, sections[1::2]), strict=True))


@pytest.mark.parametrize(
    "known",
    [*map(robot, robot_ids()), *map(external, external_ids())],
    ids=lambda known: known.id,
)
def test_the_page_of_the_library_has_each_product_with_its_doubts_and_sources(
    sections_of_products, known
):
    section = sections_of_products[known.id.replace("_", "-")].partition("\n##")[0]
    assert all(note in section for note in known.notes)
    assert all(f": {source}" in section for source in known.sources.values())
    if known.id in robot_ids():
        rows = dict(re.findall(r"^\| (\w+) deg\S* \| (.*) \|$", section, re.MULTILINE))
        for limit in ("lower", "upper", "velocity", "acceleration"):
            values = getattr(known, limit)
            said = [np.radians(float(word)) for word in rows.get(limit, "").split("|") if word]
            assert said == pytest.approx([] if values is None else values, rel=1e-12)
    else:
        assert all(f"| {name} |" in section for name in known.axis_ids)


def words_in(schema):
    """The words that a JSON schema admits, wherever they are in it."""
    if isinstance(schema, dict):
        found = [*schema.get("enum", ()), schema.get("const")]
        yield from (word for word in found if isinstance(word, str))
        for inner in schema.values():
            yield from words_in(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from words_in(inner)


JOB_TABLES = {**TABLES, **{f"program.{name}": each.settings for name, each in languages().items()}}


@pytest.mark.parametrize("name", JOB_TABLES)
def test_the_page_of_job_keys_has_each_key_as_its_table_reads_it(name):
    (section,) = re.findall(
        rf"^## `\[+{re.escape(name)}\]+`\n(.*?)(?=^## |\Z)", job_keys.page(), re.M | re.S
    )
    rows = [row.split(" | ") for row in re.findall(r"^\| (`.*) \|$", section, re.MULTILINE)]
    assert [row[0].strip("`") for row in rows] == list(JOB_TABLES[name].model_fields)
    for key, takes, example, default in rows:
        field = JOB_TABLES[name].model_fields[key.strip("`")]
        assert takes
        if "below" not in takes:
            schema = JOB_TABLES[name].model_json_schema()["properties"][key.strip("`")]
            assert all(word in takes for word in words_in(schema))
        assert (default == "required") == field.is_required()
        if example:
            assert tomllib.loads(f"value = {bare_code(example)}")
        if default.startswith("`"):
            value = tomllib.loads(f"value = {bare_code(default)}")["value"]
            assert value == (list(field.default) if isinstance(value, list) else field.default)


def test_the_page_of_job_keys_begins_with_the_tables_of_the_file():
    tops = re.findall(r"^## `\[+([a-z]+)\]", job_keys.page(), re.MULTILINE)
    assert tuple(dict.fromkeys(tops)) == tuple(JobFile.model_fields)


def test_the_job_of_the_quickstart_reads(tmp_path):
    (text,) = re.findall(r"```toml\n(.*?)```", (DOCS / "quickstart.md").read_text(), re.DOTALL)
    (tmp_path / "door.toml").write_text(text)
    shutil.copy(ROOT / "src/kerfpath/demo/b_pillar.step", tmp_path / "door.step")
    (request,) = prepare(read_job(tmp_path / "door.toml")).contours
    assert request.task.pick == "skin/outer"


def test_the_index_of_equations_leads_to_the_code_and_the_tests_of_each():
    lines = re.findall(r"^- \*\*\((\d+)\)\*\* (.*)$", equations.page(), re.MULTILINE)
    assert [int(number) for number, _ in lines] == list(EQUATIONS)
    for number, line in lines:
        said, _, tests = line.partition(" [`kerfpath.")
        assert said
        assert tests.startswith(EQUATIONS[int(number)].replace(":", ".").removeprefix("kerfpath."))
        assert "[`test_" in tests
        for target in re.findall(r"\]\(([^)]+)\)", tests):
            assert (DOCS / "reference" / target).is_file()


@pytest.mark.parametrize("module", [api, commands, equations, job_keys, library])
def test_what_is_made_for_a_page_begins_with_a_heading(module):
    assert module.page().startswith("## ")


PACKAGES = re.findall(r"\[`(kerfpath[.a-z]*)`\]", (DOCS / "reference" / "python.md").read_text())


@pytest.mark.parametrize("package", PACKAGES)
def test_the_page_of_a_package_describes_each_name_once(package):
    page = api.page(package)
    here = re.findall(r"^\.\. \S+:: (?!kerfpath)(\w+)$", page, re.MULTILINE)
    assert set(re.findall(r"currentmodule:: (\S+)$", page, re.MULTILINE)) == {package}
    elsewhere = re.findall(r"\{py:obj\}`kerfpath\.(\w+)`", page)
    named = set(api.public_names(importlib.import_module(package)))
    assert sorted([*here, *elsewhere]) == sorted(named)
    assert set(elsewhere) <= set(kerfpath.__all__)
    stub = DOCS / "reference" / "python" / f"{package.rpartition('.')[2]}.md"
    assert f"```{{generated}} api {package}\n" in stub.read_text()


def test_every_package_that_is_an_interface_has_a_page():
    packages = {path.parent.name for path in (ROOT / "src/kerfpath").glob("[a-z]*/__init__.py")}
    # Those of other programs have pages of their own, and need their packages.
    others = {"cli", "compas", "freecad", "kernels", "robodk", "studio"}
    assert {f"kerfpath.{name}" for name in packages - others} <= set(PACKAGES)


def test_what_pages_import_from_is_described():
    used = {
        module
        for page in [ROOT / "README.md", *DOCS.rglob("*.md")]
        for module in re.findall(r"^ *from (kerfpath[.\w]*) import", page.read_text(), re.M)
        if page.name not in ("compas.md", "robodk.md")  # they describe what they import
    }
    assert "kerfpath.operations" in used
    assert {".".join(module.split(".")[:2]) for module in used} <= set(PACKAGES)
