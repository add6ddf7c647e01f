"""Optional parts: what each installs, that the core does without them, and what is said."""

import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from kerfpath import InputError
from kerfpath.extras import NEEDS, imported, require_extra

ROOT = Path(__file__).parents[1]
WITHOUT = f"""
import sys
for name in {sorted(name for names in NEEDS.values() for name in names)}:
    sys.modules[name] = None  # as if it were not installed
"""


def run(code):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", WITHOUT + code], capture_output=True, text=True
    )


def test_what_an_extra_needs_is_what_it_installs():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    found = packages_distributions()
    for extra, modules in NEEDS.items():
        installed = {each.split(">=")[0].split("==")[0] for each in extras[extra]}
        assert {
            found.get(name, [name])[0].lower().replace("_", "-") for name in modules
        } <= installed, extra
    whole = sorted(NEEDS.keys() - {"compas"})  # large, and for those who have COMPAS FAB anyway
    assert extras["all"] == [f"kerfpath[{','.join(whole)}]"]


@pytest.mark.slow
def test_planning_from_arrays_needs_no_extra():
    done = run((ROOT / "tests" / "core_alone.py").read_text())
    assert done.stdout.split() == ["[]", "True"], done.stderr


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import kerfpath.job", "jobs: ortools, pydantic, python_calamine, rich"),
        ("import kerfpath.post", "robot programs: ortools, pydantic"),
        ("from kerfpath import read_plan_file", "kerfpath[programs]"),
        ("import kerfpath.report", "reports: jinja2, plotly is needed and not installed"),
        ("from kerfpath.cad import read; read('{part}')", "kerfpath[cad]"),
    ],
)
def test_what_is_missing_is_said_with_the_command_that_installs_it(code, said):
    part = ROOT / "src" / "kerfpath" / "demo" / "b_pillar.step"
    done = run(code.format(part=part))
    assert said in done.stderr.splitlines()[-1]
    assert "InputError" in done.stderr.splitlines()[-1]
    assert "run pip install 'kerfpath[" in done.stderr


def test_the_command_says_it_in_one_line():
    done = run("from kerfpath.cli import main; main()")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("kerfpath: error: the command line: ")


def test_a_module_in_place_of_one_that_is_missing_raises_where_it_is_used(monkeypatch):
    assert imported("math", "cells", "cells").sqrt(4.0) == 2.0
    monkeypatch.setitem(sys.modules, "coal", None)
    absent = imported("coal", "cells", "cells")
    with pytest.raises(InputError, match=r"cells: coal is needed .* 'kerfpath\[cells\]'"):
        absent.DistanceRequest()
    require_extra("report", "reports")
