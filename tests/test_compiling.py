"""The first run: what it compiles in advance, and that nothing is left after that."""

import os
import subprocess
import sys

import pytest

from kerfpath import compiling

COUNT = """
import sys
from numba.core import event

found = []

class Listener(event.Listener):
    def on_start(self, event): pass
    def on_end(self, event):
        function = event.data["dispatcher"].py_func
        found.append((function.__module__, function.__name__, str(event.data["args"])))

event.register("numba:compile", Listener())
from kerfpath import compiling
assert compiling.warm_up({kinematics!r}, later=compiling.LATER)
assert compiling.is_compiled({kinematics!r})
{work}
print(*found, sep="\\n")
"""
DEMO = """
from kerfpath.cli import main
sys.argv = ["kerfpath", "--quiet", "demo", "--out", {folder!r}]
try:
    main()
except SystemExit as end:
    assert not end.code
"""
ELLIPSE = """
import numpy as np, kerfpath
t = np.linspace(0, 2 * np.pi, 201)
points = np.c_[0.03 * np.cos(t), 0.02 * np.sin(t), 0 * t]
nodes = kerfpath.Contour(points, np.tile([0, 0, -1], (201, 1)), closed=True).resample(count=40)
tool, placement = np.eye(4), np.eye(4)
tool[:3, :3] = [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]
tool[:3, 3], placement[:3, 3] = [0.1, 0, 0.1], [0.7, 0.2, 0.3]
arm = kerfpath.robot("ur_ur10e").with_limits(
    acceleration=np.full(6, 10.0), endless=np.ones(6, bool)
)
made = kerfpath.plan(
    nodes, arm, tool=tool, placement=placement, speed=0.02, gamma_step=np.radians(10)
)
assert made.proof.bound > 0
"""


@pytest.mark.slow
def test_a_first_run_compiles_nothing_that_was_not_compiled_in_advance(tmp_path):
    cache = tmp_path / "cache"  # of both: what they share is compiled once
    for number, (kinematics, work) in enumerate((("opw", DEMO), ("ur", ELLIPSE)), start=1):
        script = COUNT.format(kinematics=kinematics, work=work.format(folder=str(tmp_path)))
        done = subprocess.run(
            [sys.executable, "-c", script], env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert [line for line in done.stdout.splitlines() if "kerfpath.kernels" in line] == []
        assert len(list(cache.glob("*/*.compiled"))) == number * len(compiling.STAGES)


@pytest.fixture
def stages(monkeypatch, tmp_path):
    """An empty cache, and stages that note their calls."""
    calls = []
    monkeypatch.setattr(compiling, "CACHE", tmp_path)
    monkeypatch.setattr(compiling, "STAGES", dict.fromkeys(("poses", "bound"), calls.append))
    return calls


def test_what_is_noted_in_the_cache_is_not_compiled_again(stages):
    assert not compiling.is_compiled("ur")
    for stage in compiling.STAGES:
        compiling.compile_stage(stage, "ur")
    assert compiling.is_compiled("ur")
    assert not compiling.is_compiled("opw")
    assert not compiling.warm_up("ur")
    assert stages == ["ur", "ur"]


def test_a_stage_whose_process_fails_is_compiled_here(stages, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    assert compiling.warm_up("opw", later={"bound"})
    assert stages == ["opw"]  # the other one when it is needed
    compiling.finish_compiling()
    assert stages == ["opw", "opw"]
    assert compiling.is_compiled("opw")


def test_who_wants_all_waits_for_what_was_left_to_compile_later(stages, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    compiling.warm_up("opw", later={"bound"})
    compiling.warm_up("opw")
    assert stages == ["opw", "opw"]
    assert compiling.is_compiled("opw")


def test_without_a_cache_kernels_compile_as_they_go(stages, monkeypatch, tmp_path):
    monkeypatch.setattr(compiling, "is_kept", lambda: False)
    assert compiling.is_compiled("opw")
    assert not compiling.warm_up("opw")
    compiling.compile_stage("poses", "opw")  # asked for all the same: it is not noted
    assert stages == ["opw"]
    assert list(tmp_path.iterdir()) == []


def test_families_without_an_example_compile_as_they_go(stages):
    assert compiling.is_compiled("general")
    assert not compiling.warm_up("general")
