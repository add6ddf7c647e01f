"""The files of the page: what is vendored is as published, and the rules of the house hold."""

import hashlib
import re
import shutil
import subprocess

import pytest

from conftest import ROOT
from studio.talk import client_of

CLIENT = ROOT / "src" / "kerfpath" / "studio" / "client"
BROWSER = ROOT / "tests" / "studio" / "browser"
VENDORED = [CLIENT / "vendor", BROWSER / "vendor"]
OWN = sorted(
    file
    for file in CLIENT.rglob("*")
    if file.suffix in (".js", ".css", ".html") and CLIENT / "vendor" not in file.parents
)


@pytest.mark.parametrize("file", OWN, ids=lambda f: str(f.relative_to(CLIENT)))
def test_the_page_makes_no_elements_from_text(file):
    """Names of contours, drawings and jobs are set as text, which is no code."""
    maker = r"(inner|outer)HTML|AdjacentHTML|dangerously|document\.write|srcdoc|\beval\(|Function\("
    assert re.findall(maker, file.read_text("utf-8")) == []


@pytest.mark.parametrize("folder", VENDORED, ids=lambda f: str(f.relative_to(ROOT)))
def test_vendored_files_are_those_that_were_published(folder):
    lines = (folder / "SHA256SUMS").read_text().splitlines()
    listed = {name: digest for digest, name in (line.split("  ") for line in lines)}
    there = [file for file in folder.rglob("*") if file.is_file() and file.parent != folder]
    assert sorted(listed) == sorted(str(file.relative_to(folder)) for file in there)
    for name, digest in listed.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


LICENCES = {"three": "MIT", "uplot": "MIT", "preact": "MIT", "htm": "Apache License"}


@pytest.mark.parametrize("package", LICENCES)
def test_every_vendored_package_has_its_licence(package):
    assert LICENCES[package] in (CLIENT / "vendor" / package / "LICENSE").read_text()


@pytest.mark.parametrize("file", OWN, ids=lambda f: str(f.relative_to(CLIENT)))
def test_a_module_of_the_page_is_small_and_puts_no_data_into_the_page_as_markup(file):
    text = file.read_text()
    assert len(text.splitlines()) <= 400
    # Whatever could turn data into markup or code, and whatever would come from another host.
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write", text)
    assert not re.search(r"\beval\(|new Function|setTimeout\(\s*[\"'`]|javascript:", text)
    without_names = text.replace("http://www.w3.org/", "")
    assert not re.search(r"https?://", without_names)
    assert not re.search(r"<[^>]*\s(on\w+|style)=", text) or file.suffix != ".html"


def test_the_page_loads_nothing_but_its_own_files_and_has_all_of_them():
    html = (CLIENT / "index.html").read_text()
    loaded = re.findall(r'(?:src|href)="(?!#)([^"]+)"', html)
    loaded += [path.removeprefix("./") for path in re.findall(r'": "(\./[^"]+\.js)"', html)]
    assert loaded
    assert all((CLIENT.parent / path).is_file() for path in loaded)


def test_the_page_asks_for_all_of_its_modules_at_once_and_after_its_import_map():
    client = client_of(CLIENT / "index.html")  # not at work: the page does not wait
    text = client.get("/").text
    loaded = re.findall(r'<link rel="modulepreload" href="client/([^"]+)">', text)
    modules = {str(file.relative_to(CLIENT)) for file in CLIENT.rglob("*.js")} - {"early.js"}
    assert sorted(loaded) == sorted(modules)
    # A module that is asked for before it would have no import map.
    assert text.index("importmap") < text.index("modulepreload") < text.index("</head>")
    assert all(client.get(f"/client/{name}").status_code == 200 for name in loaded)


def test_every_icon_that_is_used_is_on_the_sheet():
    sheet = set(re.findall(r'id="i-(\w+)"', (CLIENT / "index.html").read_text()))
    used = {name for file in OWN for name in re.findall(r'\bicon\("(\w+)"\)', file.read_text())}
    assert used
    assert used <= sheet


CHECKS = {
    "types": ["node_modules/.bin/tsc"],
    "format": ["node_modules/.bin/prettier", "--check", "--config", ".prettierrc.json"],
}


@pytest.mark.parametrize("check", CHECKS)
def test_the_page_passes_its_checks(check):
    if not (BROWSER / "node_modules").is_dir():
        pytest.skip("npm ci in tests/studio/browser installs what this needs")
    assert shutil.which("node")
    command = list(CHECKS[check])
    if check == "format":
        command += [str(file) for file in OWN if file.suffix == ".js"]
    done = subprocess.run(command, cwd=BROWSER, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
