"""The workbench in FreeCAD itself, on a screen in memory; the folder `PICTURES` gets pictures."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import platformdirs
import pytest

from jobs import DEMO
from kerfpath.freecad import install

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("in_freecad.py")
NEEDED = ("freecad", "xvfb-run", "xauth")
SCREEN = "-screen 0 1600x1000x24 -dpi 96"
"""Other resolutions of the screen make Qt scale the view, and clicks miss."""
SCENARIOS = (
    "the_shipped_part", "steps_of_undo", "a_robot_that_is_moved", "faces_and_lines",
    "a_model_that_changes", "nothing_to_cut", "no_path", "ends", "no_kerfpath",
)  # fmt: skip

SHOWN = ("picked", "planning", "playing", "fixture", "no-path")
"""Pictures that the documentation shows."""


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """The results of one session of FreeCAD, and the folder with its pictures."""
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if missing:
        said = f"{', '.join(missing)} not installed"
        pytest.fail(said) if os.environ.get("FREECAD") == "required" else pytest.skip(said)
    home, out = tmp_path_factory.mktemp("home"), tmp_path_factory.mktemp("out")
    part = out / "b_pillar.step"
    shutil.copy(DEMO / "b_pillar.step", part)
    install(home / ".local" / "share" / "FreeCAD" / "Mod")
    run = home / "run"
    run.mkdir(mode=0o700)
    kept = {k: v for k, v in os.environ.items() if k not in ("KERFPATH", "DISPLAY")}
    surroundings = {
        **kept,
        "HOME": str(home),
        "XDG_CACHE_HOME": str(platformdirs.user_cache_path()),  # the kernels are compiled there
        "XDG_RUNTIME_DIR": str(run),
        "QTWEBENGINE_DISABLE_SANDBOX": "1",
        "LIBGL_ALWAYS_SOFTWARE": "1",
        "KERFPATH_TEST_OUT": str(out),
        "KERFPATH_TEST_PART": str(part),
    }
    done = subprocess.run(
        ["xvfb-run", "-a", "-s", SCREEN, "freecad", str(SCRIPT)],
        env=surroundings, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, timeout=1500,
    )  # fmt: skip
    if (pictures := os.environ.get("PICTURES")) is not None:
        for name in SHOWN:
            shutil.copy(out / f"{name}.png", Path(pictures) / f"freecad-{name}.png")
    results = out / "results.json"
    # Its exit code says nothing: FreeCAD may crash when it ends.
    assert results.exists(), done.stdout[-4000:]
    return json.loads(results.read_text()), out


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_scenario(session, name):
    results, _ = session
    assert results.get(name) == "passed", results.get(name)


def test_the_program_is_what_the_job_asks_for(session):
    """From the opened file to an audited program in at most twelve clicks."""
    results, _ = session
    files = {Path(name).suffix: name for name in results["exported"]}
    assert files.keys() == {".mod", ".step", ".toml"}
    command = [sys.executable, "-m", "kerfpath", "audit", files[".mod"], "--job", files[".toml"]]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert results["clicks"] <= 12


def test_pictures_show_something(session):
    _, out = session
    for name in (*SHOWN, "program", "settings", "changed"):
        assert (out / f"{name}.png").stat().st_size > 20_000
