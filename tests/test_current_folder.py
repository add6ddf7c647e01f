"""No process of ours imports what lies beside a job, its drawing or its files."""

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
from kerfpath.isolated import clean_environment, python_command

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


FOLDERS = ("job", "drawing", "out")


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Folders of a job, its drawing and its files, with a module of every name that is imported."""
    place = tmp_path_factory.mktemp("hostile")
    for folder in (place / name for name in FOLDERS):
        folder.mkdir()
        for name in filter(str.isidentifier, NAMES):
            text = HOSTILE.format(mark=str(place / "imported"), folder=str(folder))
            (folder / f"{name}.py").write_text(text)
        # Numba would read it, and then compiled code from that folder.
        (folder / ".numba_config.yaml").write_text(f"cache_dir: {folder / 'numba'}\n")
    shutil.copy(DEMO / "b_pillar.step", place / "drawing")
    for name, step in (("small", 6), ("again", 8)):
        text = SMALL.replace("[plan]", "[plan]\ncertify = false")
        text = text.replace("b_pillar.step", "../drawing/b_pillar.step")
        (place / "job" / f"{name}.toml").write_text(text.replace("_deg = 3", f"_deg = {step}"))
    return place


@pytest.fixture
def folder(place):
    """The folder of the job, to run commands in."""
    return place / "job"


@pytest.fixture
def imported(place):
    """What has been imported from the folders since the last call."""
    mark = place / "imported"

    def read():
        names = set(mark.read_text().split()) if mark.exists() else set()
        mark.unlink(missing_ok=True)
        return names | {str(path) for path in place.glob("*/numba")}

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


COMMANDS = [
    "robots",
    "contours ../drawing/b_pillar.step",  # read in a process of its own
    "plan ../job/small.toml --out ../out",
    "check ../job/small.toml",
    "audit ../out/plan.json --job ../job/small.toml",
    "audit ../out/small.mod --job ../job/small.toml",
    "post ../out/plan.json -o ../out/small.mod",
    "batch ../job/small.toml ../job/again.toml --out ../out/batch --processes 2",
]
"""In an order in which each finds the files of those before."""


@pytest.mark.slow
def test_the_commands_import_nothing_from_there(place, imported):
    for where in FOLDERS:
        # What plans runs once, as it takes most of the time.
        again = [words for words in COMMANDS if not words.startswith(("plan", "batch"))]
        for words in COMMANDS if where == "job" else again:
            done([*COMMAND, *words.split()], place / where)
            assert imported() == set(), words


@pytest.mark.slow
def test_python_m_imports_no_more_than_python_itself(folder, imported):
    """What it imports before kerfpath runs is out of reach, and so is kerfpath.py."""
    (folder / "nothing.py").touch()
    done([sys.executable, "-m", "nothing"], folder)
    before = imported()
    ours = (folder / "kerfpath.py").rename(folder / "kerfpath.kept")
    try:
        done([*MODULE, "contours", "../drawing/b_pillar.step"], folder)
        done([*MODULE, "batch", "small.toml", "--out", "module", "--processes", "1"], folder)
    finally:
        ours.rename(folder / "kerfpath.py")
    assert imported() == before
    done([sys.executable, "-P", "-m", "kerfpath", "contours", "../drawing/b_pillar.step"], folder)
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
    code = "import multiprocessing, numpy, kerfpath.compiling; print(*sys.path, sep='\\n')"
    known = done(python_command(code), folder).stdout.splitlines()
    assert known == [folder for folder in sys.path if folder in known]
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


def test_a_script_beside_its_drawing_lets_no_process_of_ours_import_from_there(place, imported):
    """Python itself looks there for what the script imports; what reads the drawing does not."""
    folder = place / "drawing"
    script = folder / "script.py"
    script.write_text(
        "import sys\n"
        "here = sys.path.pop(0)\n"
        "import OCP\n"  # as this process does for what it gets
        "from kerfpath.cad import read\n"
        "import numba\n"
        "numba.njit(lambda: 0)()\n"  # the first kernel imports more
        "sys.path.insert(0, here)\n"  # as if the imports had been harmless
        "print(len(read('b_pillar.step').loops))\n"
    )
    imported()
    assert done([sys.executable, script], folder).stdout == "122\n"
    assert imported() == set()


def test_a_process_has_no_variables_that_run_other_code(monkeypatch):
    for name in ("PYTHONPATH", "PYTHONSTARTUP", "PYTHONINSPECT"):
        monkeypatch.setenv(name, "/nowhere")
    clean = clean_environment()
    assert clean.keys() & {"PYTHONPATH", "PYTHONSTARTUP", "PYTHONINSPECT"} == set()
    assert clean["PYTHONSAFEPATH"] == "1"
    assert os.environ["PYTHONPATH"] == "/nowhere"
