"""Nothing is imported from the current folder, whatever lies there, by any process of ours."""

import os
import re
import shutil
import subprocess
import sys
import urllib.request
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from jobs import DEMO, SMALL
from kerfpath.isolated import python_command

COMMAND = [Path(sys.executable).parent / "kerfpath"]
MODULE = [sys.executable, "-m", "kerfpath"]
NAMES = {*sys.stdlib_module_names, *packages_distributions(), "sitecustomize", "kerfpath"}
HOSTILE = """\
import sys
with open({mark!r}, "a") as file:
    file.write(__name__ + "\\n")
path = sys.path[:]
sys.path[:] = [folder for folder in path if folder not in ("", {folder!r})]
del sys.modules[__name__]
try:
    __import__(__name__)
finally:
    sys.path[:] = path
"""
"""A module that notes its name, and then does what the module does in whose place it is."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a job, and with a module of every name that anyone may import."""
    folder = tmp_path_factory.mktemp("hostile")
    for name in filter(str.isidentifier, NAMES):
        text = HOSTILE.format(mark=str(folder / "imported"), folder=str(folder))
        (folder / f"{name}.py").write_text(text)
    shutil.copy(DEMO / "b_pillar.step", folder)
    for name, step in (("small", 6), ("again", 8)):
        text = SMALL.replace("[plan]", "[plan]\ncertify = false")
        (folder / f"{name}.toml").write_text(text.replace("_deg = 3", f"_deg = {step}"))
    return folder


@pytest.fixture
def imported(folder):
    """What has been imported from the folder since the last call."""
    mark = folder / "imported"

    def read():
        names = set(mark.read_text().split()) if mark.exists() else set()
        mark.unlink(missing_ok=True)
        return names

    read()
    return read


def environment():
    """That of this process, without what would already keep Python from the current folder."""
    return {k: v for k, v in os.environ.items() if k not in ("PYTHONSAFEPATH", "PYTHONPATH")}


def done(command, folder):
    result = subprocess.run(
        command, cwd=folder, env=environment(), capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        "robots",
        "contours b_pillar.step",  # read in a process of its own
        "plan small.toml",
        "batch small.toml again.toml --out batch --processes 2",
    ],
    ids=lambda words: words.split()[0],
)
def test_the_command_imports_nothing_from_there(folder, imported, words):
    done([*COMMAND, *words.split()], folder)
    assert imported() == set()


@pytest.mark.slow
def test_python_m_imports_no_more_than_python_itself(folder, imported):
    """What it imports before kerfpath runs is out of reach, and so is kerfpath.py."""
    (folder / "nothing.py").touch()
    done([sys.executable, "-m", "nothing"], folder)
    before = imported()
    ours = (folder / "kerfpath.py").rename(folder / "kerfpath.kept")
    try:
        done([*MODULE, "contours", "b_pillar.step"], folder)
        done([*MODULE, "batch", "small.toml", "--out", "module", "--processes", "1"], folder)
    finally:
        ours.rename(folder / "kerfpath.py")
    assert imported() == before
    done([sys.executable, "-P", "-m", "kerfpath", "contours", "b_pillar.step"], folder)
    assert imported() == set()


@pytest.mark.slow
def test_the_studio_imports_nothing_from_there(folder, imported):
    process = subprocess.Popen(
        [*COMMAND, "studio", "small.toml", "--port", "0", "--no-browser"], cwd=folder,
        env=environment(), stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        address = re.search(r"http://\S+", process.stdout.readline())[0]
        opener = urllib.request.build_opener(
            urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor()
        )
        with opener.open(address, timeout=30) as page:
            assert page.status == 200
    finally:
        process.kill()
        process.communicate()
    assert imported() == set()


@pytest.mark.slow
def test_processes_import_from_where_this_one_does(folder, imported):
    code = "import multiprocessing, numpy, kerfpath.compiling; print(sys.path)"
    assert done(python_command(code), folder).stdout == f"{sys.path}\n"
    assert imported() == set()


def test_a_sweep_of_a_script_imports_nothing_from_there(folder, imported, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "from kerfpath import sweep\n"
        "def double(*, x):\n"
        "    return 2 * x\n"
        "if __name__ == '__main__':\n"
        f"    for result in sweep.run(double, [{{'x': 21}}], store={str(tmp_path / 's')!r}):\n"
        "        print(result.value)\n"
    )
    assert done([sys.executable, script], folder).stdout == "42\n"
    assert imported() == set()
